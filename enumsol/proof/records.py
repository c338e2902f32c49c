"""Certificates of a proof as classes: one for each kind of record, which writes it and reads it strictly.

A search writes a record by making one of these. The checker, and a search that resumes from an earlier proof, read it
by the class that its letter gives in the tree at hand (``proof.leaves``). Reading says whether a record makes sense,
never that it is true. docs/proof_format.md says what each of them claims and how that is tested.

A new kind of leaf begins here, with the trees in which its theorem holds; docs/architecture.md lists the other places
that it touches. What stands in trees over pieces of alpha only is in ``proof.curve_records``. Records of graphs in 2D
have no classes (see ``branches.proof_records``).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, fields
from enum import Flag, auto
from typing import Any, ClassVar, cast

import numpy as np

from enumsol.proof.proof_file import packed
from enumsol.proof.reading import multipliers_from, numbers_from, quoted
from enumsol.support.array_types import Codes, Floats, Indices
from enumsol.trusted.exclusion import Terms
from enumsol.trusted.status_rows import (
    BACKWARD,
    CONTACT,
    FORWARD,
    ROW_KINDS,
    SLIP_MINUS,
    SLIP_PLUS,
    STICK,
    UNDECIDED,
    final_codes,
    refines,
)
from enumsol.trusted.uniqueness import numbers_of

#: A row in 3D: its kind, its node, and the number of a direction or sector.
Row = tuple[int, int, int]

_SLIDING = FORWARD, BACKWARD
#: Codes that are not final.
_PARTIAL = CONTACT, UNDECIDED, *_SLIDING
#: Last entry of a record that is to be tested in rational arithmetic.
RATIONAL = "rational"


class RecordError(ValueError):
    """A record makes no sense; what it says is a whole sentence about it."""


class Tree(Flag):
    """Trees of a proof: at one alpha in 2D and in 3D, and over an interval in 3D, of bodies held and not."""

    PLANE, SPACE, PIECE = auto(), auto(), auto()
    FLOATING_PLANE, FLOATING_SPACE, FLOATING_PIECE = auto(), auto(), auto()
    #: Bodies with a stiffness that is positive definite, on which most theorems rest.
    HELD = PLANE | SPACE | PIECE
    FLOATING = FLOATING_PLANE | FLOATING_SPACE | FLOATING_PIECE
    #: Problems in 3D; trees over pieces of alpha; trees at one alpha.
    IN_SPACE = SPACE | PIECE | FLOATING_SPACE | FLOATING_PIECE
    PIECES = PIECE | FLOATING_PIECE
    POINTS = PLANE | SPACE | FLOATING_PLANE | FLOATING_SPACE


@dataclass(frozen=True, eq=False)
class Limits:
    """What a record may say, by the place in the tree where it stands.

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


class Record:
    """Base of all kinds, which are frozen dataclasses. Entries after the first are the fields, in their order.

    Attributes
    ----------
    kind : str
        The first entry.
    sizes : how many entries a record may have
    unfit : what is said where it has another number of them
    trees : where its theorem holds
    """

    kind: ClassVar[str]
    sizes: ClassVar[tuple[int, ...]]
    unfit: ClassVar[str] = "its record has {} entries; expected {}"
    trees: ClassVar[Tree] = Tree.HELD | Tree.FLOATING

    @classmethod
    def read(cls, record: list[Any], limits: Limits) -> Any:
        """What a record of this kind says; ValueError where it makes no sense."""
        if len(record) not in cls.sizes:
            raise RecordError(cls.unfit.format(len(record), " or ".join(map(str, cls.sizes))))
        return cls.of(record[1:], limits)

    @classmethod
    def of(cls, entries: list[Any], limits: Limits) -> Any:
        """The same from the entries after the first, of which there are as many as there may be."""
        return cls(*entries)

    def write(self) -> list[Any]:
        """The record as a JSON value."""
        return [self.kind, *(value.tolist() if isinstance(value, np.ndarray) else value for value in self.entries())]

    def entries(self) -> Iterable[Any]:
        """What follows the kind: the fields, arrays as one list, enclosures by parts, and nothing for None."""
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


@dataclass(frozen=True, eq=False)
class EnclosureRecord:
    """Where a record says that its root is, and the root's index; read where they are compared with the root's own."""

    mid: Any
    rad: Any
    index: Any

    def numbers(self, size: int) -> tuple[Floats, Floats]:
        """Midpoint and radius; ValueError where they are no ``size`` numbers each."""
        return numbers_from(self.mid, size), numbers_from(self.rad, size)

    def refusal(self, index: int, *, inside: bool) -> str | None:
        """Why it is not that of a root of this index, which was found inside or not; None where it is."""
        if not inside:
            return "its enclosure does not hold the root"
        return None if type(self.index) is int and self.index == index else "its index is wrong"

    def __iter__(self) -> Any:
        """The entries of a record."""
        return iter((self.mid, self.rad, self.index))


@dataclass(frozen=True, eq=False)
class DeclaredForm(Record):
    """A form to which later leaves refer: of an assignment, or of a root of a body that nothing holds.

    Attributes
    ----------
    codes : of the assignment for which it is made, or of the leaf that holds the root
    numbers : array
        For a body that is held, in 2D the four rows of its multipliers one after the other; in 3D those of
        ``trusted.quadratic_forms.SlipForm`` over the whole tree, else those of ``product_forms.Ellipsoid``. For
        other bodies those of ``trusted.reference.Reference`` or ``trusted.space.space_uniqueness.LeafReference``.
    more : array
        In 2D the weight of the equations; of an ellipsoid a point near its centre; of a root balance and share.
    enclosure : EnclosureRecord or None
        Of the root, in 3D.
    """

    kind, sizes, unfit = "q", (4, 7), "a form has {} entries; expected {}"

    codes: Codes
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
        if limits.tree & Tree.PLANE and (np.any(given[0][2 * limits.p :] < 0) or given[1][0] < 0):
            raise ValueError("a multiplier of a form is negative and must not be")
        return cls(tuple(codes), *given, EnclosureRecord(*enclosure) if enclosure else None)

    @staticmethod
    def _counts(codes: Any, numbers: Any, limits: Limits) -> tuple[int, int]:
        """How many numbers there are of both kinds, of codes that a form may have."""
        if not isinstance(codes, list) or len(codes) != limits.p or not all(type(code) is int for code in codes):
            raise ValueError(f"its codes are not a list of {limits.p} codes")
        whole = all(code == UNDECIDED for code in codes)
        if not limits.in_space:
            if limits.held:
                if not all(0 <= code <= UNDECIDED for code in codes):
                    raise ValueError(f"a status code is not among 0 to {UNDECIDED}")
                return 4 * limits.p, 1
            _selection(codes, limits.friction)
            return limits.p + 3 * sum(limits.friction), 2
        if not (whole and limits.held) and not all(map(is_code_of_leaf, codes)):
            raise ValueError("it is about no assignment")
        if not limits.held:
            return limits.p + 2 * limits.components, 2
        count = limits.p + limits.components if whole else len(numbers) if isinstance(numbers, list) else 0
        return count, 0 if whole else limits.components

    def same(self, other: DeclaredForm) -> bool:
        """Whether another record says the same."""
        pairs = (self.numbers, other.numbers), (self.more, other.more)
        return self.codes == other.codes and all(np.array_equal(*pair) for pair in pairs)

    def serves(self, codes: Sequence[int], *, in_space: bool = False) -> bool:
        """Whether a partial assignment is part of the one that this form is made for."""
        if in_space and any(code != UNDECIDED for code in self.codes):
            from enumsol.trusted.space.product_forms import refines as is_below  # in 3D only

            return is_below(tuple(codes), self.codes)
        return all(mine == UNDECIDED or refines(code, mine) for code, mine in zip(codes, self.codes, strict=True))


# -- leaves of which nothing, or all, is told --------------------------------------------------------------------------


@dataclass(frozen=True)
class UndecidedRecord(Record):
    """A leaf of which nothing is shown, for this reason."""

    kind, sizes = "u", (2,)

    reason: Any


@dataclass(frozen=True)
class Unloaded(Record):
    """The whole tree: the body is unloaded, so that nothing but lambda = 0 solves."""

    kind, sizes, trees = "z", (1,), Tree.HELD & Tree.POINTS


# -- no solution -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Excluded(Record):
    """Multipliers of rows exclude the assignment.

    Attributes
    ----------
    rows : row numbers, kind * p + node; in 3D a list of rows
    values : (k,) array
        The multipliers; over a piece of alpha (2, k), at its lower and at its upper end, between which they are affine.
    by : int, RATIONAL or None
        They bound the energy; or the form declared so many before; or the energy, tested in rational arithmetic.
    """

    kind, sizes = "x", (3, 4)

    rows: Indices | list[Row]
    values: Floats
    by: int | str | None = None

    @classmethod
    def of(cls, entries: list[Any], limits: Limits) -> Excluded:
        """The multipliers from two texts, once there is the form and it holds for the assignment."""
        by = entries[2] if len(entries) > 2 else None
        if by == RATIONAL and not limits.tree & Tree.PLANE:
            raise RecordError("it cannot be tested in rational arithmetic")
        if len(entries) > 2 and by != RATIONAL:
            _check_form(by, limits)
        if not limits.in_space:
            return cls(*multipliers_from(entries[:2], ROW_KINDS * limits.p), by)
        rows, values = multipliers_from(entries[:2], None, ends=2 if limits.tree & Tree.PIECES else 1)
        return cls([checked_row(row, limits.p) for row in rows], values, by)

    @property
    def lines(self) -> list[Row]:
        """Rows in 3D."""
        return cast("list[Row]", self.rows)

    @property
    def terms(self) -> Terms:
        """Rows and multipliers in 2D."""
        return Terms(np.asarray(self.rows), self.values)

    def entries(self) -> Iterable[Any]:
        """Rows and multipliers as two texts."""
        return (*packed(self.rows, self.values), *(() if self.by is None else (self.by,)))


@dataclass(frozen=True, eq=False)
class Unbalanced(Record):
    """Of a body that nothing holds: no forces below the assignment are in balance with its load."""

    kind, sizes, trees = "i", (2,), Tree.FLOATING

    direction: Floats

    @classmethod
    def of(cls, entries: list[Any], limits: Limits) -> Unbalanced:
        """A number for each rigid mode."""
        return cls(numbers_from(entries[0], limits.modes))


# -- complete assignments ----------------------------------------------------------------------------------------------


class Solved(Record):
    """Base of leaves that say all of a selection; they stand at complete assignments only."""

    @classmethod
    def read(cls, record: list[Any], limits: Limits) -> Any:
        """As of any record, once the assignment is complete."""
        check_complete(limits.codes)
        return super().read(record, limits)


@dataclass(frozen=True)
class NoRoot(Solved):
    """A selection holds no root; by RATIONAL, that is tested in rational arithmetic."""

    kind, sizes = "n", (1, 2)

    by: str | None = None

    @classmethod
    def of(cls, entries: list[Any], limits: Limits) -> NoRoot:
        """In 2D it may be tested in rationals."""
        if entries and (entries != [RATIONAL] or limits.in_space):
            raise RecordError("it cannot be tested in rational arithmetic")
        return cls(*entries)


@dataclass(frozen=True, eq=False)
class RegularRoot(Solved):
    """A selection holds one root, which is regular."""

    kind, sizes, trees = "r", (4,), Tree.POINTS

    enclosure: EnclosureRecord

    @classmethod
    def of(cls, entries: list[Any], limits: Limits) -> RegularRoot:
        """The enclosure."""
        return cls(EnclosureRecord(*entries))


@dataclass(frozen=True, eq=False)
class SharedRoot(Solved):
    """Selections of a body that nothing holds share one root, in which some nodes of this one stick or slip.

    Attributes
    ----------
    slips : pairs of a node and SLIP_PLUS or SLIP_MINUS
    enclosure : EnclosureRecord
    """

    kind, sizes, trees = "g", (5,), Tree.FLOATING_PLANE

    slips: tuple[tuple[int, int], ...]
    enclosure: EnclosureRecord

    @classmethod
    def of(cls, entries: list[Any], limits: Limits) -> SharedRoot:
        """The nodes, ascending, which stick or slip so in the assignment, and the enclosure."""
        pairs = entries[0]
        if not isinstance(pairs, list) or not all(isinstance(pair, list) and len(pair) == 2 for pair in pairs):
            raise ValueError("its nodes are not a list of pairs")
        nodes = _nodes([node for node, _ in pairs], limits.p)
        for node, (_, code) in zip(nodes, pairs, strict=True):
            if type(code) is not int or code not in (SLIP_PLUS, SLIP_MINUS) or not limits.friction[node]:
                raise RecordError(f"node {node} cannot slip so")
            if limits.codes[node] not in (STICK, code):
                raise RecordError(f"node {node} has another status in its assignment")
        slips = tuple((node, code) for node, (_, code) in zip(nodes, pairs, strict=True))
        return cls(slips, EnclosureRecord(*entries[1:]))

    def core(self, codes: Codes) -> Codes:
        """The codes of the selection in which all of these nodes stick."""
        between = dict(self.slips)
        return tuple(STICK if i in between else code for i, code in enumerate(codes))


@dataclass(frozen=True, eq=False)
class RootSetRecord(Solved):
    """In rational arithmetic, the roots of a selection are the hull of these points: lists of fractions as texts."""

    kind, sizes, trees = "D", (3,), Tree.PLANE | Tree.FLOATING_PLANE

    points: list[list[str]]
    dimension: Any

    @classmethod
    def of(cls, entries: list[Any], limits: Limits) -> RootSetRecord:
        """The points, lists of texts, one for each force and rigid mode, and the dimension as it stands."""
        points, size = entries[0], 2 * limits.p + limits.modes
        if not isinstance(points, list) or not all(isinstance(point, list) and len(point) == size for point in points):
            raise ValueError(f"expected points of {size} fractions")
        if not all(isinstance(x, str) for point in points for x in point):
            raise ValueError("a coordinate is not a text")
        return cls(*entries)


# -- one solution at most ----------------------------------------------------------------------------------------------


class ClosingRecord(Record):
    """Base of leaves below which there can be one solution only."""


@dataclass(frozen=True, eq=False)
class Closed(ClosingRecord):
    """With an enclosure, or a count of 1, that solution is a root, else it is none.

    Attributes
    ----------
    selection : final codes; FORWARD and BACKWARD at nodes that slide
    free : nodes
    weights : numbers of the form
    at : array or int
        Midpoint of the enclosure, or a point near the solution. In rational arithmetic, in which the solution solves
        the selection, 1 if it is a root and 0 if it is none.
    enclosure : EnclosureRecord or None
    """

    kind, sizes, trees = "m", (5, 7), Tree.PLANE

    selection: Codes
    free: Codes
    weights: Floats | list[float]
    at: Floats | int
    enclosure: EnclosureRecord | None = None

    @classmethod
    def of(cls, entries: list[Any], limits: Limits) -> Closed:
        """Nodes, codes and numbers, if they fit each other and the assignment."""
        given, nodes, weights, at, *_ = entries
        codes, friction, free = limits.codes, limits.friction, _nodes(nodes, limits.p)
        if len(entries) == 4 and type(at) is int:
            selection = _selection(given, friction)
            if free != tuple(i for i, code in enumerate(codes) if code in (CONTACT, UNDECIDED)):
                raise RecordError("its free nodes are not those of its assignment")
            if any(not refines(selection[i], code) for i, code in enumerate(codes) if i not in free):
                raise RecordError("its selection does not lie below its assignment")
            return cls(selection, free, _weights(weights, free, codes, friction), at)
        selection = _selection(given, friction, sliding=set(range(limits.p)) - set(free))
        numbers = _weights(weights, free, selection, friction)
        force = numbers_from(at, 2 * limits.p)
        if any(not refines(code, selection[i]) for i, code in enumerate(codes) if i not in free):
            raise RecordError("a node that has a status in its proof has another one in its assignment")
        return cls(selection, free, numbers, force, EnclosureRecord(*entries[3:]) if len(entries) > 4 else None)

    def entries(self) -> Iterable[Any]:
        """The midpoint is that of the enclosure."""
        return self.selection, self.free, self.weights, *(self.enclosure or [self.at])


@dataclass(frozen=True, eq=False)
class Alone(ClosingRecord):
    """Below the assignment there is this solution only, or in 3D none; in 3D it may lie beyond its sectors.

    Attributes
    ----------
    selection : final codes of the solution; in 3D those of a leaf, or none for the whole tree
    numbers : of the form, as ``trusted.uniqueness.lone_root`` or ``space_uniqueness.SpaceWeights.of`` takes them
    enclosure : EnclosureRecord
    strengths, terms : arrays, as ``trusted.uniqueness.lone_root`` takes them; None in 3D
    """

    kind, sizes, trees = "a", (6, 9), Tree.PLANE | Tree.SPACE

    selection: Codes
    numbers: Floats
    enclosure: EnclosureRecord
    strengths: Floats | None = None
    terms: Terms | None = None

    @classmethod
    def of(cls, entries: list[Any], limits: Limits) -> Alone:
        """Codes and numbers, if they fit each other and the assignment."""
        selection, numbers, mid, rad, index, *more = entries
        if bool(more) == limits.in_space:
            raise RecordError(cls.unfit.format(len(entries) + 1, 6 if limits.in_space else 9))
        enclosure = EnclosureRecord(mid, rad, index)
        if limits.in_space:
            if not selection and any(code != UNDECIDED for code in limits.codes):
                raise RecordError("its only solution is claimed below the root of the tree without a leaf")
            values = numbers_from(numbers, limits.p + 2 * limits.components)
            numbers_from(mid, limits.components)
            if not isinstance(selection, list) or not all(type(code) is int for code in selection):
                raise RecordError("its leaf is not a list of codes")
            return cls(tuple(selection), values, enclosure)
        chosen = _selection(selection, limits.friction)
        nodes, own = numbers_of(limits.codes, limits.friction)
        weights = numbers_from(numbers, len(nodes) + 3 * int(np.count_nonzero(own)))
        strengths = numbers_from(more[0], 2 * limits.p).reshape(2, -1)
        return cls(chosen, weights, enclosure, strengths, multipliers_from(more[1:], ROW_KINDS * limits.p))

    def entries(self) -> Iterable[Any]:
        """Multipliers as two texts."""
        yield from (self.selection, self.numbers, *self.enclosure)
        if self.strengths is not None and self.terms is not None:
            yield from (self.strengths.ravel(), *packed(*self.terms))


@dataclass(frozen=True, eq=False)
class BoxedRoot(ClosingRecord):
    """All solutions lie in a box that holds one solution.

    Attributes
    ----------
    mid, rad, rho : centre and radius of the box, and its weights of displacements, read where they are needed
    enclosure : EnclosureRecord
    by : int or None
        All solutions below the assignment lie in the ellipsoid of the form declared so many before, which lies in the
        box. Without it the assignment is complete.
    """

    kind, sizes, trees = "l", (7, 8), Tree.SPACE

    mid: Any
    rad: Any
    rho: Any
    enclosure: EnclosureRecord
    by: int | None = None

    @classmethod
    def of(cls, entries: list[Any], limits: Limits) -> BoxedRoot:
        """The box and the enclosure."""
        mid, rad, rho, *enclosure = entries[:6]
        if entries[6:]:
            _check_form(entries[6], limits)
        else:
            check_complete(limits.codes)
        return cls(mid, rad, rho, EnclosureRecord(*enclosure), *entries[6:])

    def box(self, size: int) -> tuple[Floats, Floats, Floats]:
        """Centre, radius and rho of the box; ValueError where they are no ``size`` numbers each."""
        return numbers_from(self.mid, size), numbers_from(self.rad, size), numbers_from(self.rho, size)


@dataclass(frozen=True, eq=False)
class OnlyReference(ClosingRecord):
    """No root but that of a form lies below the assignment; with an enclosure, in 2D, this one does.

    Attributes
    ----------
    back : int
        So many forms were declared since, and this one.
    rows : list of rows on displacements that are equations
    products : list of (row, row, factor)
    enclosure : EnclosureRecord or None
    """

    kind, sizes, trees = "o", (4, 7), Tree.FLOATING & Tree.POINTS

    back: int
    rows: list[Any]
    products: list[tuple[Any, Any, float]]
    enclosure: EnclosureRecord | None = None

    @classmethod
    def of(cls, entries: list[Any], limits: Limits) -> OnlyReference:
        """Numbers that fit the problem."""
        back, rows, products, *enclosure = entries
        if enclosure and limits.in_space:
            raise RecordError(cls.unfit.format(len(entries) + 1, 4))
        if type(back) is not int or not 0 < back <= len(limits.declared):
            raise RecordError("its form is not declared")
        if not all(isinstance(value, list) for value in (rows, products)):
            raise RecordError("its rows are not a list")
        if not all(isinstance(product, list) and len(product) == 3 for product in products):
            raise RecordError("its products are not pairs of rows with a factor")
        factors = numbers_from([factor for *_, factor in products], len(products)).tolist()
        pairs = [tuple(cls._row(row, limits) for row in pair) for *pair, _ in products]
        said = [(one, other, factor) for (one, other), factor in zip(pairs, factors, strict=True)]
        equations = [cls._row(row, limits) for row in rows]
        return cls(back, equations, said, EnclosureRecord(*enclosure) if enclosure else None)

    @staticmethod
    def _row(row: Any, limits: Limits) -> Any:
        if limits.in_space:
            return checked_row(row, limits.p)
        if type(row) is not int or not 0 <= row < ROW_KINDS * limits.p:
            raise RecordError("its rows are not numbers of rows")
        return row

    def entries(self) -> Iterable[Any]:
        """Without an enclosure where there is none."""
        return self.back, self.rows, [list(product) for product in self.products], *(self.enclosure or ())


def check_complete(codes: Codes) -> None:
    """Raise RecordError where an assignment is not complete."""
    if any(code in _PARTIAL for code in codes):
        raise RecordError("a root or a solved selection is claimed where statuses are still open")


def is_code_of_leaf(code: Any) -> bool:
    """True for a status in 3D that is not undecided, or that of a sector."""
    from enumsol.model.sectors import SECTORS, is_sector  # in 3D only

    return type(code) is int and (0 <= code < UNDECIDED or (code > SECTORS and is_sector(code - SECTORS)))


def checked_row(row: Any, p: int) -> Row:
    """A row in 3D; ValueError where there is none such."""
    from enumsol.model.sectors import DEEPEST, RUN  # in 3D only
    from enumsol.trusted.space.sector_rows import FORCE, GAP, RIGHT

    if not isinstance(row, list | tuple) or len(row) != 3 or not all(type(x) is int for x in row):
        raise ValueError(f"{quoted(row)} is not a row")
    kind, node, number = row
    # numbers of directions and sectors are less; directions of tangents are less than RUN
    known = 0 <= kind <= RIGHT and 0 <= node < p and -1 <= number < RUN << DEEPEST
    if not known or (kind in (GAP, FORCE) and number):
        raise ValueError(f"row {quoted(list(row))} does not exist")
    return kind, node, number


def _check_form(back: Any, limits: Limits) -> None:
    """Raise RecordError unless a form was declared so many before which serves the assignment."""
    if not limits.tree & (Tree.PLANE | Tree.SPACE) or type(back) is not int or not 1 <= back <= len(limits.declared):
        raise RecordError("its form was not declared")
    if not limits.declared[-back].serves(limits.codes, in_space=limits.in_space):
        raise RecordError("its form was made for another assignment")


def _selection(value: Any, friction: Sequence[bool], sliding: Iterable[int] = ()) -> Codes:
    """Final codes; FORWARD and BACKWARD are allowed as well at the given nodes."""
    if not isinstance(value, list) or len(value) != len(friction) or not all(type(code) is int for code in value):
        raise ValueError(f"its selection is not a list of {len(friction)} codes")
    for i, (code, positive) in enumerate(zip(value, friction, strict=True)):
        if code in final_codes(positive) or (positive and code in _SLIDING and i in sliding):
            continue
        raise ValueError("a node cannot have the code that its selection gives it")
    return tuple(value)


def _nodes(value: Any, p: int) -> Codes:
    if not isinstance(value, list) or not all(type(i) is int and 0 <= i < p for i in value):
        raise ValueError("its free nodes are not a list of nodes")
    if sorted(set(value)) != value:
        raise ValueError("its free nodes are not ascending")
    return tuple(value)


def _weights(value: Any, free: Codes, codes: Codes, friction: Sequence[bool]) -> Floats:
    """The numbers of the form: one for every free or sliding node, and four more where a free node has friction."""
    sliding = sum(code in _SLIDING for code in codes)
    return numbers_from(value, len(free) + sliding + 4 * sum(friction[i] for i in free))
