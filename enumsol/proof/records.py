"""Records of all trees of a proof: branchings, forms, and the base of all kinds, with their limits.

A record is a class: a search writes it, and the checker, and a search that resumes from an earlier proof, read it
strictly. Reading says whether a record makes sense, never that it is true. docs/proof_format.md says what each of them
claims and how that is tested. Leaves are in ``proof.leaves``, what stands in trees over pieces of alpha in 3D only in
``proof.curve_records``; docs/architecture.md lists the other places that a new kind of leaf touches.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, fields
from enum import Flag, auto
from typing import TYPE_CHECKING, Any, ClassVar, cast

import numpy as np

from enumsol.arithmetic.balls import SAFE
from enumsol.proof.reading import (
    RecordError,
    check_complete,
    is_code_of_leaf,
    numbers_from,
    quoted,
    rational_from,
    selection_from,
)
from enumsol.support.array_types import Codes, Floats
from enumsol.trusted.over_interval import EnclosedPiece
from enumsol.trusted.quadratic_forms import EnclosedForm
from enumsol.trusted.reference import PlaneReference
from enumsol.trusted.status_rows import UNDECIDED, refines

if TYPE_CHECKING:
    from fractions import Fraction

    from enumsol.arithmetic.balls import Ball
    from enumsol.condensation.enclosure import EnclosedSystem
    from enumsol.condensation.space_condensed import EnclosedSpace

#: Covers underflow of one product.
_SUBNORMAL = 2.0**-1070


class Tree(Flag):
    """Trees of a proof: at one alpha in 2D and in 3D, over pieces of alpha in both, of bodies held and not."""

    PLANE, SPACE, GRAPH, PIECE = auto(), auto(), auto(), auto()
    FLOATING_PLANE, FLOATING_SPACE, FLOATING_GRAPH, FLOATING_PIECE = auto(), auto(), auto(), auto()
    #: Bodies with a stiffness that is positive definite, on which most theorems rest.
    HELD = PLANE | SPACE | GRAPH | PIECE
    FLOATING = FLOATING_PLANE | FLOATING_SPACE | FLOATING_GRAPH | FLOATING_PIECE
    #: Problems in 3D; trees over pieces of alpha in 2D, and in 3D; trees at one alpha.
    IN_SPACE = SPACE | PIECE | FLOATING_SPACE | FLOATING_PIECE
    GRAPHS = GRAPH | FLOATING_GRAPH
    PIECES = PIECE | FLOATING_PIECE
    POINTS = PLANE | SPACE | FLOATING_PLANE | FLOATING_SPACE


@dataclass(frozen=True, eq=False)
class Limits:
    """Limits of a record, by the place in the tree where it stands.

    Attributes
    ----------
    codes : status codes of the assignment that is due
    tree : Tree
    friction : whether each contact node has any; in 2D
    declared : forms that were declared before
    components : of all forces, in 3D
    modes : number of rigid modes
    boxes : around curves, in a graph in 3D
    """

    codes: Codes
    tree: Tree = Tree.PLANE
    friction: Sequence[bool] = ()
    declared: Sequence[DeclaredForm] = ()
    components: int = 0
    modes: int = 0
    boxes: int = 0

    @property
    def p(self) -> int:
        """Number of contact nodes."""
        return len(self.codes)

    @property
    def in_space(self) -> bool:
        """True in 3D."""
        return bool(self.tree & Tree.IN_SPACE)

    @property
    def held(self) -> bool:
        """True for a body whose stiffness is positive definite."""
        return bool(self.tree & Tree.HELD)

    def check_form(self, back: Any) -> None:
        """Raise RecordError unless a form that serves the assignment was declared so many before."""
        by_form = Tree.PLANE | Tree.SPACE | Tree.GRAPH
        if not (self.tree & by_form and type(back) is int and 1 <= back <= len(self.declared)):
            raise RecordError("its form was not declared")
        if not self.declared[-back].serves(self.codes):
            raise RecordError("its form was made for another assignment")


class Record:
    """Base of all kinds, which are frozen dataclasses. Entries after the first are the fields, in their order.

    Attributes
    ----------
    kind : str
        The first entry.
    sizes : how many entries a record may have
    unfit : what is said where it has another number of them
    trees : where its theorem holds
    final : bool
        It stands at complete assignments only.
    closing : bool
        There can be one solution only below it.
    """

    kind: ClassVar[str]
    sizes: ClassVar[tuple[int, ...]]
    unfit: ClassVar[str] = "its record has {} entries; expected {}"
    trees: ClassVar[Tree] = Tree.HELD | Tree.FLOATING
    final: ClassVar[bool] = False
    closing: ClassVar[bool] = False

    @classmethod
    def read(cls, record: list[Any], limits: Limits) -> Any:
        """A record of this kind; ValueError where it makes no sense."""
        if cls.final:
            check_complete(limits.codes)
        if len(record) not in cls.sizes:
            raise RecordError(cls.unfit.format(len(record), " or ".join(map(str, cls.sizes))))
        return cls.of(record[1:], limits)

    @classmethod
    def of(cls, entries: list[Any], limits: Limits) -> Any:
        """A record from its entries after the first, of which there are as many as there may be."""
        return cls(*entries)

    def write(self) -> list[Any]:
        """The record as a JSON value."""
        return [self.kind, *(value.tolist() if isinstance(value, np.ndarray) else value for value in self.entries())]

    def entries(self) -> Iterable[Any]:
        """Entries after the kind: the fields, arrays as one list, enclosures by parts, and nothing for None."""
        for field in fields(self):  # type: ignore[arg-type]
            value = getattr(self, field.name)
            if isinstance(value, EnclosureRecord):
                yield from value
            elif value is not None:
                yield value.ravel() if isinstance(value, np.ndarray) else value


# -- branchings and forms ----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Branching(Record):
    """An assignment is split at a node into these codes, whose subtrees follow in this order."""

    kind, sizes = "b", (3,)

    node: int
    children: list[int]

    @classmethod
    def covering(cls, record: list[Any], codes: Codes, covers: Callable[[int, int, list[int]], bool]) -> Branching:
        """Read the split of an assignment; RecordError unless its codes cover the code of its node."""
        node, children = record[1:] if len(record) in cls.sizes else (None, None)
        if type(node) is int and 0 <= node < len(codes) and isinstance(children, list):
            known = all(type(code) is int for code in children)
            if known and covers(node, codes[node], children):
                return cls(node, children)
        raise RecordError(f"a branching {quoted(record)} does not cover the assignment that it splits")

    def below(self, codes: Codes) -> list[Codes]:
        """The assignments into which it splits one."""
        return [(*codes[: self.node], code, *codes[self.node + 1 :]) for code in self.children]


@dataclass(frozen=True)
class CutPiece(Record):
    """The piece of alpha is cut here.

    The subtrees of both parts follow, the lower one first; in 2D after all trees over the piece, which is halved.
    """

    kind, sizes, trees = "p", (2,), Tree.PIECES | Tree.GRAPHS

    alpha: str

    def between(self, low: Fraction, high: Fraction) -> Fraction:
        """Alpha of the cut; RecordError where it is not within the piece."""
        try:
            alpha = rational_from(self.alpha)
        except ValueError as error:
            raise RecordError(f"a piece is cut nowhere: {error}") from None
        if not low < alpha < high:
            raise RecordError("a piece is not cut within")
        return alpha


@dataclass(frozen=True, eq=False)
class EnclosureRecord:
    """Ball and index of a root, as a record has them; read where they are compared with the root's own."""

    mid: Any
    rad: Any
    index: Any

    def numbers(self, size: int) -> tuple[Floats, Floats]:
        """Midpoint and radius; ValueError where they are no ``size`` numbers each."""
        return numbers_from(self.mid, size), numbers_from(self.rad, size)

    @classmethod
    def around(cls, ball: Ball, unit: Floats, index: int | None, wider: float) -> EnclosureRecord:
        """Enclosure of a root, wider than its ball in these units, so that a checker's own ball fits in."""
        return cls(ball.mid * unit, wider * ball.rad * unit, index)

    def refusal(self, ball: Ball, unit: Floats, index: int) -> str | None:
        """Why it is not that of a root in this ball, in units that are powers of two; None where it is."""
        centre, radius = self.numbers(len(ball.mid))
        with np.errstate(over="ignore", invalid="ignore"):
            reach = (np.abs(centre - ball.mid * unit) + ball.rad * unit) * SAFE
            inside = reach + np.where(ball.rad > 0, _SUBNORMAL, 0.0) <= radius
        if not np.all(inside):
            return "its enclosure does not hold the root"
        return None if type(self.index) is int and self.index == index else "its index is wrong"

    def __iter__(self) -> Any:
        """The entries of a record."""
        return iter((self.mid, self.rad, self.index))


#: Of a leaf that is tested before its root is known; it is written with another one.
NOWHERE = EnclosureRecord(None, None, None)


@dataclass(frozen=True, eq=False)
class DeclaredForm(Record):
    """A form to which later leaves refer: of an assignment, of a root of a body that nothing holds, or of arcs.

    Attributes
    ----------
    codes : of the assignment for which it is made, or of the leaf that holds the root
        Of arcs over a piece in 2D, a tuple of their selections.
    numbers : array
        For a body that is held, in 2D the four rows of its multipliers one after the other, in 3D those of
        ``sector_margins.SlipForm``, over the whole tree. For other bodies those of ``PlaneReference.of`` or
        ``trusted.space.space_uniqueness.LeafReference.of``. Of arcs mu, kappa and nu of ``PieceNumbers``.
    more : array
        At one alpha in 2D the weight of the equations; of a root balance and share, of arcs the degree, too.
    enclosure : EnclosureRecord or None
        Of the root, in 3D.
    """

    kind, sizes, unfit = "q", (4, 7), "a form has {} entries; expected {}"

    codes: tuple[Any, ...]
    numbers: Floats
    more: Floats
    enclosure: EnclosureRecord | None = None

    @classmethod
    def of(cls, entries: list[Any], limits: Limits) -> DeclaredForm:
        """The form in a record; ValueError where it makes no sense."""
        codes, numbers, more, *enclosure = entries
        if bool(enclosure) != (limits.in_space and not limits.held):
            raise RecordError(cls.unfit.format(len(entries) + 1, 4 if enclosure else 7))
        try:
            count, further = cls._counts(codes, numbers, limits)
            given = numbers_from(numbers, count), numbers_from(more, further)
        except ValueError as error:
            raise ValueError(f"a form cannot be read: {error}") from None
        chosen = tuple(tuple(code) if isinstance(code, list) else code for code in codes)
        found = cls(chosen, *given, EnclosureRecord(*enclosure) if enclosure else None)
        in_plane = limits.tree & (Tree.PLANE | Tree.GRAPH) and not found.of_arcs
        if in_plane and (np.any(given[0][2 * limits.p :] < 0) or np.any(given[1] < 0)):
            raise ValueError("a multiplier of a form is negative and must not be")
        return found

    @staticmethod
    def _counts(codes: object, numbers: object, limits: Limits) -> tuple[int, int]:
        """Counts of numbers of both kinds, for codes that a form may have."""
        if limits.tree & Tree.GRAPHS and isinstance(codes, list) and codes and isinstance(codes[0], list):
            for selection in codes:
                selection_from(selection, limits.friction)
            return 3 * limits.p, 0 if limits.held else 3
        if not isinstance(codes, list) or len(codes) != limits.p or not all(type(code) is int for code in codes):
            raise ValueError(f"its codes are not a list of {limits.p} codes")
        whole = all(code == UNDECIDED for code in codes)
        if limits.tree & Tree.GRAPH and whole:
            return 4 * limits.p, 0
        if limits.tree & (Tree.PLANE | Tree.FLOATING_PLANE):
            if limits.held:
                if not all(0 <= code <= UNDECIDED for code in codes):
                    raise ValueError(f"a status code is not among 0 to {UNDECIDED}")
                return 4 * limits.p, 1
            selection_from(codes, limits.friction)
            return limits.p + 3 * sum(limits.friction), 2
        if limits.tree & Tree.GRAPHS or not (whole if limits.held else all(map(is_code_of_leaf, codes))):
            raise ValueError("it is about no assignment")
        return (limits.p + limits.components, 0) if limits.held else (limits.p + 2 * limits.components, 2)

    def same(self, other: DeclaredForm) -> bool:
        """True if another record says the same."""
        pairs = (self.numbers, other.numbers), (self.more, other.more)
        return self.codes == other.codes and all(np.array_equal(*pair) for pair in pairs)

    @property
    def of_arcs(self) -> bool:
        """True for a form of arcs."""
        return isinstance(self.codes[0], tuple)

    def serves(self, codes: Sequence[int]) -> bool:
        """True if a partial assignment is part of the one that this form is made for."""
        pairs = zip(codes, self.codes, strict=True)
        return not self.of_arcs and all(mine == UNDECIDED or refines(code, mine) for code, mine in pairs)

    @np.errstate(over="ignore", invalid="ignore")
    def form(self, system: EnclosedSystem | EnclosedPiece) -> Any:
        """The form of an assignment, or of a root; None where it is not proven to be definite.

        An EnclosedForm or PlaneReference, over a piece the piece with it, in 3D a SlipForm (of the whole tree) or
        LeafReference. Numbers of arcs are those of a ``PieceNumbers``.

        Raises
        ------
        ValueError
            A multiplier is not allowed.
        """
        if isinstance(system, EnclosedPiece):
            return system.with_form(self.numbers.reshape(4, -1))
        if system.tangents == 1:
            if not system.held:
                return PlaneReference.of(system, self.codes, self.numbers, *self.more.tolist())
            return EnclosedForm.of(system, self.codes, self.numbers.reshape(4, -1), float(self.more[0]))
        from enumsol.trusted.space.sector_margins import SlipForm  # in 3D only
        from enumsol.trusted.space.space_uniqueness import LeafReference

        given = cast("EnclosedSpace", system)
        if not system.held:
            return LeafReference.of(given, self.codes, self.numbers, *self.more.tolist())
        return SlipForm.of(given, self.numbers)
