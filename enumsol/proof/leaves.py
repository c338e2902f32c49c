"""Leaves of proofs as classes, and the trees in which they may stand (docs/proof_format.md).

What a leaf says of its assignment is true where its method ``holds`` shows it, which search and checker both call. What
stands in trees over pieces of alpha in 3D only is in ``proof.curve_records``.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from enumsol.condensation.enclosure import EnclosedSystem
from enumsol.proof.proof_file import packed
from enumsol.proof.reading import (
    RecordError,
    checked_row,
    multipliers_from,
    nodes_from,
    numbers_from,
    selection_from,
    weights_from,
)
from enumsol.proof.records import CutPiece, EnclosureRecord, Limits, Record, Tree
from enumsol.support.array_types import Codes, Floats, Indices
from enumsol.trusted.at_alpha import joint_root
from enumsol.trusted.exclusion import Terms, exclusion_margin
from enumsol.trusted.floating_bounds import is_unbalanced
from enumsol.trusted.over_interval import KINDS
from enumsol.trusted.status_rows import CONTACT, ROW_KINDS, SLIP_MINUS, SLIP_PLUS, STICK, UNDECIDED, refines
from enumsol.trusted.uniqueness import closed_solution, lone_root, numbers_of

if TYPE_CHECKING:
    from enumsol.condensation.space_condensed import EnclosedSpace
    from enumsol.proof.reading import Row
    from enumsol.trusted.at_alpha import ClosedSolution
    from enumsol.trusted.over_interval import EnclosedPiece
    from enumsol.trusted.quadratic_forms import EnclosedForm
    from enumsol.trusted.reference import PlaneReference
    from enumsol.trusted.space.pieces import AlphaPiece
    from enumsol.trusted.space.sector_margins import SlipForm
    from enumsol.trusted.space.space_uniqueness import LeafReference

    #: What multipliers bound.
    Bounded = EnclosedSystem | EnclosedForm | EnclosedPiece | SlipForm | AlphaPiece

#: Last entry of a record that is to be tested in rational arithmetic.
RATIONAL = "rational"


# -- leaves of which nothing, or all, is told --------------------------------------------------------------------------


@dataclass(frozen=True)
class UndecidedRecord(Record):
    """A leaf of which nothing is shown, for this reason."""

    kind, sizes, trees = "u", (2,), Tree.POINTS | Tree.PIECES

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
            limits.check_form(by)
        if not limits.in_space:
            kinds = KINDS if limits.tree & Tree.GRAPHS else ROW_KINDS
            return cls(*multipliers_from(entries[:2], kinds * limits.p), by)
        rows, values = multipliers_from(entries[:2], None, ends=2 if limits.tree & Tree.PIECES else 1)
        return cls([checked_row(row, limits.p) for row in rows], values, by)

    def holds(self, within: Bounded, codes: Codes, errors: float = 1.0) -> bool:
        """True if the assignment is proven to hold no solution (theory, sections 6, 12.2, 12.9 and 14).

        Parameters
        ----------
        within : a system, or one of its forms; an EnclosedPiece or AlphaPiece for all alpha of it
        codes : of the assignment
        errors : how often error bounds are subtracted: 1 proves, a writer of proofs takes more
        """
        if not isinstance(self.rows, list):
            return exclusion_margin(cast("Any", within), codes, self.rows, self.values, errors) > 0
        from enumsol.trusted.space.sector_margins import space_margin  # in 3D only

        return space_margin(cast("Any", within), codes, self.rows, self.values, errors) > 0

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
    """No forces below the assignment are in balance with the load, of a body that nothing holds."""

    kind, sizes, trees = "i", (2,), Tree.FLOATING

    direction: Floats

    @classmethod
    def of(cls, entries: list[Any], limits: Limits) -> Unbalanced:
        """A number for each rigid mode."""
        return cls(numbers_from(entries[0], limits.modes))

    def holds(self, within: EnclosedSystem | AlphaPiece, codes: Codes) -> bool:
        """True if no forces below the assignment balance the load, of a system or an AlphaPiece (theory, (14.7))."""
        if not isinstance(within, EnclosedSystem):
            return within.is_unbalanced(codes, self.direction)
        if within.tangents == 1:
            return is_unbalanced(within, codes, self.direction)
        from enumsol.trusted.space.force_bound import is_unbalanced_in_space  # in 3D only

        return is_unbalanced_in_space(cast("EnclosedSpace", within), codes, self.direction)


# -- complete assignments ----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class NoRoot(Record):
    """A selection holds no root; by RATIONAL, that is tested in rational arithmetic."""

    kind, sizes, trees, final = "n", (1, 2), Tree.POINTS | Tree.PIECES, True

    by: str | None = None

    @classmethod
    def of(cls, entries: list[Any], limits: Limits) -> NoRoot:
        """In 2D it may be tested in rationals."""
        if entries and (entries != [RATIONAL] or limits.in_space):
            raise RecordError("it cannot be tested in rational arithmetic")
        return cls(*entries)


@dataclass(frozen=True, eq=False)
class RegularRoot(Record):
    """A selection holds one root, which is regular."""

    kind, sizes, trees, final = "r", (4,), Tree.POINTS, True

    enclosure: EnclosureRecord

    @classmethod
    def of(cls, entries: list[Any], limits: Limits) -> RegularRoot:
        """The enclosure."""
        return cls(EnclosureRecord(*entries))


@dataclass(frozen=True, eq=False)
class SharedRoot(Record):
    """Selections of a body that nothing holds share one root, in which some nodes of this one stick or slip.

    Attributes
    ----------
    slips : pairs of a node and SLIP_PLUS or SLIP_MINUS
    enclosure : EnclosureRecord
    """

    kind, sizes, trees, final = "g", (5,), Tree.FLOATING_PLANE, True

    slips: tuple[tuple[int, int], ...]
    enclosure: EnclosureRecord

    @classmethod
    def of(cls, entries: list[Any], limits: Limits) -> SharedRoot:
        """The nodes, ascending, which stick or slip so in the assignment, and the enclosure."""
        pairs = entries[0]
        if not isinstance(pairs, list) or not all(isinstance(pair, list) and len(pair) == 2 for pair in pairs):
            raise ValueError("its nodes are not a list of pairs")
        nodes = nodes_from([node for node, _ in pairs], limits.p)
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

    def holds(self, system: EnclosedSystem, codes: Codes) -> ClosedSolution | None:
        """The root that the selections share; None where that is not proven (theory, section 14.9)."""
        return joint_root(system, self.core(codes), dict(self.slips))


@dataclass(frozen=True, eq=False)
class RootSetRecord(Record):
    """In rational arithmetic, the roots of a selection are the hull of these points: lists of fractions as texts."""

    kind, sizes, trees, final = "D", (3,), Tree.PLANE | Tree.FLOATING_PLANE, True

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


@dataclass(frozen=True)
class Survivor(Record):
    """A selection that may hold somewhere in a piece of alpha."""

    kind, sizes, trees, final = "s", (1,), Tree.GRAPHS, True


# -- one solution at most ----------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Closed(Record):
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

    kind, sizes, trees, closing = "m", (5, 7), Tree.PLANE, True

    selection: Codes
    free: Codes
    weights: Floats | list[float]
    at: Floats | int
    enclosure: EnclosureRecord | None = None

    @classmethod
    def of(cls, entries: list[Any], limits: Limits) -> Closed:
        """Nodes, codes and numbers, if they fit each other and the assignment."""
        given, nodes, weights, at, *_ = entries
        codes, friction, free = limits.codes, limits.friction, nodes_from(nodes, limits.p)
        if len(entries) == 4 and type(at) is int:
            selection = selection_from(given, friction)
            if free != tuple(i for i, code in enumerate(codes) if code in (CONTACT, UNDECIDED)):
                raise RecordError("its free nodes are not those of its assignment")
            if any(not refines(selection[i], code) for i, code in enumerate(codes) if i not in free):
                raise RecordError("its selection does not lie below its assignment")
            return cls(selection, free, weights_from(weights, free, codes, friction), at)
        selection = selection_from(given, friction, sliding=set(range(limits.p)) - set(free))
        numbers = weights_from(weights, free, selection, friction)
        force = numbers_from(at, 2 * limits.p)
        if any(not refines(code, selection[i]) for i, code in enumerate(codes) if i not in free):
            raise RecordError("a node that has a status in its proof has another one in its assignment")
        return cls(selection, free, numbers, force, EnclosureRecord(*entries[3:]) if len(entries) > 4 else None)

    def holds(self, system: EnclosedSystem, unit: Floats) -> ClosedSolution | None:
        """The only solution that there can be, near its point in these units of force; None where that is not proven.

        Not for a record in rational arithmetic (theory, section 6.11).
        """
        return closed_solution(system, self.selection, self.free, np.asarray(self.weights), np.asarray(self.at) / unit)

    def entries(self) -> Iterable[Any]:
        """The midpoint is that of the enclosure."""
        return self.selection, self.free, self.weights, *(self.enclosure or [self.at])


@dataclass(frozen=True, eq=False)
class Alone(Record):
    """Below the assignment there is this solution only, or in 3D none; in 3D it may lie beyond its sectors.

    Attributes
    ----------
    selection : final codes of the solution; in 3D those of a leaf, or none for the whole tree
    numbers : of the form, as ``trusted.uniqueness.lone_root`` or ``space_uniqueness.SpaceWeights.of`` takes them
    enclosure : EnclosureRecord
    strengths, terms : arrays, as ``trusted.uniqueness.lone_root`` takes them; None in 3D
    """

    kind, sizes, trees, closing = "a", (6, 9), Tree.PLANE | Tree.SPACE, True

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
        chosen = selection_from(selection, limits.friction)
        nodes, own = numbers_of(limits.codes, limits.friction)
        weights = numbers_from(numbers, len(nodes) + 3 * int(np.count_nonzero(own)))
        strengths = numbers_from(more[0], 2 * limits.p).reshape(2, -1)
        return cls(chosen, weights, enclosure, strengths, multipliers_from(more[1:], ROW_KINDS * limits.p))

    def holds(self, system: EnclosedSystem, codes: Codes, errors: float = 1.0, near: Floats | None = None) -> Any:
        """The only solution below the assignment, None where that is not proven (theory, sections 6.13 and 12.6).

        A VerifiedSelection; in 3D a SpaceRoot, or a LooseSolution where no leaf is named, near these normal forces, by
        default those of the enclosure. ``errors`` as of Excluded.
        """
        if self.strengths is not None and self.terms is not None:
            return lone_root(system, codes, self.selection, self.numbers, self.strengths, *self.terms)
        from enumsol.trusted.space import space_uniqueness as space  # in 3D only

        given = cast("EnclosedSpace", system)
        if self.selection:
            return space.lone_root(given, codes, self.numbers, self.selection, errors)
        if near is None:
            near = self.enclosure.numbers(len(system.g))[0][: len(codes)]
        return space.only_solution_in_space(given, self.numbers, near, errors)

    def entries(self) -> Iterable[Any]:
        """Multipliers as two texts."""
        yield from (self.selection, self.numbers, *self.enclosure)
        if self.strengths is not None and self.terms is not None:
            yield from (self.strengths.ravel(), *packed(*self.terms))


@dataclass(frozen=True, eq=False)
class BoxedRoot(Record):
    """All solutions of a complete assignment lie in a box that holds one solution.

    Attributes
    ----------
    mid, rad, rho : centre and radius of the box, and its weights of displacements, read where they are needed
    enclosure : EnclosureRecord
    """

    kind, sizes, trees, final = "l", (7,), Tree.SPACE, True

    mid: Any
    rad: Any
    rho: Any
    enclosure: EnclosureRecord

    @classmethod
    def of(cls, entries: list[Any], limits: Limits) -> BoxedRoot:
        """The box and the enclosure."""
        mid, rad, rho, *enclosure = entries
        return cls(mid, rad, rho, EnclosureRecord(*enclosure))

    def box(self, size: int) -> tuple[Floats, Floats, Floats]:
        """Centre, radius and rho of the box; ValueError where they are no ``size`` numbers each."""
        return numbers_from(self.mid, size), numbers_from(self.rad, size), numbers_from(self.rho, size)


@dataclass(frozen=True, eq=False)
class OnlyReference(Record):
    """No root but that of a form lies below the assignment; with an enclosure, at one alpha in 2D, this one does.

    Over a piece of alpha in 2D: none beside the arcs of a form.

    Attributes
    ----------
    back : int
        So many forms were declared since, and this one.
    rows : list of rows on displacements that are equations
    products : list of (row, row, factor)
    enclosure : EnclosureRecord or None
    turns : array or None
        In 3D, theta with which no other root is left at all; then there are no rows.
    """

    kind, sizes, trees, closing = "o", (4, 5, 7), (Tree.FLOATING & Tree.POINTS) | Tree.GRAPHS, True

    back: int
    rows: list[Any]
    products: list[tuple[Any, Any, float]]
    enclosure: EnclosureRecord | None = None
    turns: Floats | None = None

    @classmethod
    def of(cls, entries: list[Any], limits: Limits) -> OnlyReference:
        """Numbers that fit the problem."""
        back, rows, products, *enclosure = entries
        turns = None
        if limits.in_space and len(enclosure) == 1:
            turns = numbers_from(enclosure.pop(), limits.components - limits.p)
        if len(enclosure) not in ((0, 3) if limits.tree & Tree.FLOATING_PLANE else (0,)):
            raise RecordError(cls.unfit.format(len(entries) + 1, 4))
        if type(back) is not int or not 0 < back <= len(limits.declared):
            raise RecordError("its form is not declared")
        if not all(isinstance(value, list) for value in (rows, products)):
            raise RecordError("its rows are not a list")
        if (turns is not None or limits.held) and (rows or products):
            raise RecordError("it has rows beside theta" if limits.in_space else "it has rows, of a body that is held")
        if not all(isinstance(product, list) and len(product) == 3 for product in products):
            raise RecordError("its products are not pairs of rows with a factor")
        factors = numbers_from([factor for *_, factor in products], len(products)).tolist()
        pairs = [tuple(cls._row(row, limits) for row in pair) for *pair, _ in products]
        said = [(one, other, factor) for (one, other), factor in zip(pairs, factors, strict=True)]
        equations = [cls._row(row, limits) for row in rows]
        return cls(back, equations, said, EnclosureRecord(*enclosure) if enclosure else None, turns)

    @staticmethod
    def _row(row: object, limits: Limits) -> Any:
        if limits.in_space:
            return checked_row(row, limits.p)
        if type(row) is not int or not 0 <= row < ROW_KINDS * limits.p:
            raise RecordError("its rows are not numbers of rows")
        return row

    def holds(self, known: PlaneReference | LeafReference, codes: Codes, reach: Floats) -> bool:
        """True if no other root lies below the assignment than that of a form, a PlaneReference or LeafReference.

        ``reach``: within these bounds of the rigid displacement (theory, sections 14.11 and 14.15).
        """
        if self.turns is not None:
            return cast("LeafReference", known).is_sole(self.turns, reach)
        return known.is_only_root(codes, self.rows, self.products, reach)

    def entries(self) -> Iterable[Any]:
        """Without an enclosure, and theta, where there is none."""
        turns = () if self.turns is None else (self.turns,)
        return self.back, self.rows, [list(product) for product in self.products], *(self.enclosure or ()), *turns


# -- trees -------------------------------------------------------------------------------------------------------------

_LEAVES: tuple[type[Record], ...] = (
    *(Excluded, Unbalanced, NoRoot, RegularRoot, SharedRoot, RootSetRecord),
    *(Closed, Alone, BoxedRoot, OnlyReference, Unloaded, UndecidedRecord, Survivor, CutPiece),
)


@cache
def leaves_of(tree: Tree) -> dict[str, type[Any]]:
    """The kinds of leaves whose theorems hold in a tree, by their letters."""
    every = _LEAVES
    if tree & Tree.PIECES:
        from enumsol.proof.curve_records import OnCurve, ThroughCurveBox  # for graphs in 3D only

        every += OnCurve, ThroughCurveBox
    return {record.kind: record for record in every if record.trees & tree}


def kind_of(record: list[Any], tree: Tree) -> type[Any] | None:
    """The class of a leaf; None for one that may not stand in a tree."""
    return leaves_of(tree).get(record[0]) if record and isinstance(record[0], str) else None
