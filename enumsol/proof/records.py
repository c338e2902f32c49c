"""Records of a proof as classes: one for each kind, which writes it and reads it strictly (docs/proof_format.md).

The certifiers write a record by making one. Checkers, and a search that resumes from an earlier proof, read it by the
class that a table gives for its first entry. Reading says whether a record makes sense, never that it is true.

A new kind of leaf begins here and in ``LEAVES``; docs/architecture.md lists the other places that it touches. Leaves of
problems in 3D are in ``proof.space_records``. Records of graphs have no classes (see ``branches.proof_records``).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, fields
from typing import Any, ClassVar

import numpy as np

from enumsol.proof.proof_file import packed
from enumsol.proof.reading import codes_from, multipliers_from, numbers_from, quoted
from enumsol.support.array_types import Codes, Floats
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

_SLIDING = FORWARD, BACKWARD
#: Codes that are not final.
_PARTIAL = CONTACT, UNDECIDED, *_SLIDING


class RecordError(ValueError):
    """A record makes no sense; what it says is a whole sentence about it."""


@dataclass(frozen=True, eq=False)
class Limits:
    """What a record may say, by the place in the tree where it stands.

    Attributes
    ----------
    codes : status codes of the assignment that is due
    friction : whether each contact node has any
    declared : forms that were declared before
    components : of all forces, in 3D
    modes : rigid modes of a body that nothing holds
    boxes : around curves, in a graph in 3D
    """

    codes: Codes
    friction: Sequence[bool] = ()
    declared: Sequence[Any] = ()
    components: int = 0
    modes: int = 0
    boxes: int = 0

    @property
    def p(self) -> int:
        """Number of contact nodes."""
        return len(self.codes)


class Record:
    """Base of all kinds, which are frozen dataclasses. Entries after the first are the fields, in their order.

    Attributes
    ----------
    kind : str
        The first entry.
    sizes : how many entries a record may have
    unfit : what is said where it has another number of them
    """

    kind: ClassVar[str]
    sizes: ClassVar[tuple[int, ...]]
    unfit: ClassVar[str] = "its record has {} entries; expected {}"

    @classmethod
    def read(cls, record: list[Any], limits: Limits) -> Any:
        """What a record of this kind says; ValueError where it makes no sense."""
        cls.check(record, limits)
        return cls.of(record[1:], limits)

    @classmethod
    def check(cls, record: list[Any], limits: Limits) -> None:
        """Raise RecordError where a record has another number of entries, or may not stand at its place."""
        if len(record) not in cls.sizes:
            raise RecordError(cls.unfit.format(len(record), " or ".join(map(str, cls.sizes))))

    @classmethod
    def of(cls, entries: list[Any], limits: Limits) -> Any:
        """The same from the entries after the first, of which there are as many as there must be."""
        return cls(*entries)

    def write(self) -> list[Any]:
        """The record as a JSON value."""
        return [self.kind, *(value.tolist() if isinstance(value, np.ndarray) else value for value in self.entries())]

    def entries(self) -> Iterable[Any]:
        """What follows the kind: the fields, arrays as one list, multipliers as two texts and enclosures by parts."""
        for field in fields(self):  # type: ignore[arg-type]
            value = getattr(self, field.name)
            if isinstance(value, Terms):
                yield from packed(*value)
            elif isinstance(value, EnclosureRecord):
                yield from value
            else:
                yield value.ravel() if isinstance(value, np.ndarray) else value


def table_of(*records: type[Record]) -> dict[str, type[Any]]:
    """The table of some kinds of records."""
    table = {record.kind: record for record in records}
    if len(table) < len(records):
        raise AssertionError(f"two of the kinds {', '.join(record.kind for record in records)} begin alike")
    return table


def kind_of(record: list[Any], kinds: dict[str, type[Any]]) -> type[Any] | None:
    """The class of a record; None for one of another kind."""
    return kinds.get(record[0]) if record and isinstance(record[0], str) else None


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
class DeclaredForm(Record):
    """A form to which later leaves refer.

    Attributes
    ----------
    codes : status codes of the assignment for which it is made
    multipliers : (4, p) array
    weight : float
    """

    kind, sizes, unfit = "q", (7,), "a form has {} entries; expected {}"

    codes: Codes
    multipliers: Floats
    weight: float

    def entries(self) -> Iterable[Any]:
        """Codes as a text, and the rows of the multipliers."""
        return ["".join(map(str, self.codes)), *self.multipliers, self.weight]

    @classmethod
    def of(cls, entries: list[Any], limits: Limits) -> DeclaredForm:
        """The form in a record; ValueError where it makes no sense."""
        text, *rows, weight = entries
        try:
            codes = tuple(codes_from([text], limits.p)[0].tolist())
            multipliers = np.array([numbers_from(values, limits.p) for values in rows])
            weight = float(numbers_from([weight], 1)[0])
        except ValueError as error:
            raise ValueError(f"a form cannot be read: {error}") from None
        if np.any(multipliers[2:] < 0) or weight < 0:
            raise ValueError("a multiplier of a form is negative and must not be")
        return cls(codes, multipliers, weight)

    def same(self, other: DeclaredForm) -> bool:
        """Whether another record says the same."""
        alike = self.codes == other.codes and self.weight == other.weight
        return alike and np.array_equal(self.multipliers, other.multipliers)

    def holds(self, codes: Sequence[int]) -> bool:
        """Whether a partial assignment is part of the one that this form is made for."""
        return all(refines(code, mine) for code, mine in zip(codes, self.codes, strict=True))


# -- leaves in two and in three dimensions -----------------------------------------------------------------------------


@dataclass(frozen=True)
class UndecidedRecord(Record):
    """A leaf of which nothing is shown, for this reason."""

    kind, sizes = "u", (2,)

    reason: Any


@dataclass(frozen=True)
class Unloaded(Record):
    """The whole tree: the body is unloaded, so that nothing but lambda = 0 solves."""

    kind, sizes = "z", (1,)


class Solved(Record):
    """Base of leaves that say all of a selection; they stand at complete assignments only."""

    @classmethod
    def check(cls, record: list[Any], limits: Limits) -> None:
        """The same, and that the assignment is complete."""
        super().check(record, limits)
        if any(code in _PARTIAL for code in limits.codes):
            raise RecordError("a root or a solved selection is claimed where statuses are still open")


@dataclass(frozen=True)
class NoRoot(Solved):
    """A selection holds no root."""

    kind, sizes = "n", (1,)


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
class RegularRoot(Solved):
    """A selection holds one root, which is regular."""

    kind, sizes = "r", (4,)

    enclosure: EnclosureRecord

    @classmethod
    def of(cls, entries: list[Any], limits: Limits) -> RegularRoot:
        """The enclosure."""
        return cls(EnclosureRecord(*entries))


# -- leaves in two dimensions ------------------------------------------------------------------------------------------


class Exclusion(Record):
    """Base of leaves without a solution, by multipliers of rows."""


@dataclass(frozen=True, eq=False)
class Excluded(Exclusion):
    """Multipliers of rows exclude the assignment."""

    kind, sizes = "x", (3,)

    terms: Terms

    @classmethod
    def of(cls, entries: list[Any], limits: Limits) -> Excluded:
        """The multipliers from two texts."""
        return cls(multipliers_from(entries, ROW_KINDS * limits.p))


class ExcludedInRationals(Excluded):
    """The same, to be checked in rational arithmetic."""

    kind = "X"


@dataclass(frozen=True, eq=False)
class ExcludedByForm(Exclusion):
    """The same with the form declared as the ``back``-th before."""

    kind, sizes = "f", (4,)

    back: int
    terms: Terms

    @classmethod
    def of(cls, entries: list[Any], limits: Limits) -> ExcludedByForm:
        """The multipliers, once there is the form and it holds for the assignment."""
        back = entries[0]
        if type(back) is not int or not 1 <= back <= len(limits.declared):
            raise RecordError("its form was not declared")
        if not limits.declared[-back].holds(limits.codes):
            raise RecordError("its form was made for another assignment")
        return cls(back, multipliers_from(entries[1:], ROW_KINDS * limits.p))


@dataclass(frozen=True, eq=False)
class Unbalanced(Exclusion):
    """Of a body that nothing holds: no forces below the assignment are in balance with its load."""

    kind, sizes = "i", (2,)

    direction: Floats

    @classmethod
    def of(cls, entries: list[Any], limits: Limits) -> Unbalanced:
        """A number for each rigid mode."""
        return cls(numbers_from(entries[0], limits.modes))


@dataclass(frozen=True, eq=False)
class SharedRoot(Solved):
    """Selections of a body that nothing holds share one root, in which some nodes of this one stick or slip.

    Attributes
    ----------
    slips : pairs of a node and SLIP_PLUS or SLIP_MINUS
    enclosure : EnclosureRecord
    """

    kind, sizes = "g", (5,)

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


class NoRootInRationals(NoRoot):
    """A selection holds no root, to be checked in rational arithmetic."""

    kind = "N"


@dataclass(frozen=True, eq=False)
class RootSetRecord(Solved):
    """In rational arithmetic, the roots of a selection are the hull of these points: lists of fractions as texts."""

    kind, sizes = "D", (3,)

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


class ClosingRecord(Record):
    """Base of leaves below which there can be one solution only."""


@dataclass(frozen=True, eq=False)
class Closed(ClosingRecord):
    """With an enclosure that solution is a root, without one it is none.

    Attributes
    ----------
    selection : final codes; FORWARD and BACKWARD at nodes that slide
    free : nodes
    weights : numbers of the form
    force : midpoint of the enclosure, or a point near the solution
    enclosure : EnclosureRecord or None
    """

    kind, sizes = "m", (5, 7)

    selection: Codes
    free: Codes
    weights: Any
    force: Floats
    enclosure: EnclosureRecord | None = None

    @classmethod
    def of(cls, entries: list[Any], limits: Limits) -> Closed:
        """Nodes, codes and numbers, if they fit each other and the assignment."""
        free = _nodes(entries[1], limits.p)
        selection = _selection(entries[0], limits.friction, sliding=set(range(limits.p)) - set(free))
        weights = _weights(entries[2], free, selection, limits.friction)
        force = numbers_from(entries[3], 2 * limits.p)
        if any(not refines(code, selection[i]) for i, code in enumerate(limits.codes) if i not in free):
            raise RecordError("a node that has a status in its proof has another one in its assignment")
        return cls(selection, free, weights, force, EnclosureRecord(*entries[3:]) if len(entries) > 4 else None)

    def entries(self) -> Iterable[Any]:
        """The midpoint is that of the enclosure."""
        return self.selection, self.free, self.weights, *(self.enclosure or [self.force])


@dataclass(frozen=True, eq=False)
class ClosedInRationals(ClosingRecord):
    """In rational arithmetic that solution solves this selection; ``count`` says whether it is a root."""

    kind, sizes = "M", (4,)

    selection: Codes
    weights: Any
    count: Any

    @classmethod
    def of(cls, entries: list[Any], limits: Limits) -> ClosedInRationals:
        """Codes and numbers, if they fit each other and the assignment."""
        codes, selection, free = limits.codes, _selection(entries[0], limits.friction), cls.free(limits.codes)
        if any(not refines(selection[i], code) for i, code in enumerate(codes) if i not in free):
            raise RecordError("its selection does not lie below its assignment")
        return cls(selection, _weights(entries[1], free, codes, limits.friction), entries[2])

    @staticmethod
    def free(codes: Codes) -> Codes:
        """The nodes of an assignment that are free: which they are is not written."""
        return tuple(i for i, code in enumerate(codes) if code in (CONTACT, UNDECIDED))


@dataclass(frozen=True, eq=False)
class Alone(Record):
    """The root of a selection is the only one below the assignment.

    Attributes
    ----------
    selection : final codes
    weights, strengths, terms : arrays, as ``trusted.uniqueness.lone_root`` takes them
    enclosure : EnclosureRecord
    """

    kind, sizes, unfit = "a", (9,), "its record cannot be followed (it has {} entries; expected {})"

    selection: Codes
    weights: Floats
    strengths: Floats
    terms: Terms
    enclosure: EnclosureRecord

    @classmethod
    def of(cls, entries: list[Any], limits: Limits) -> Alone:
        """Codes and numbers, if they fit each other and the assignment."""
        selection = _selection(entries[0], limits.friction)
        nodes, own = numbers_of(limits.codes, limits.friction)
        weights = numbers_from(entries[1], len(nodes) + 3 * int(np.count_nonzero(own)))
        strengths = numbers_from(entries[2], 2 * limits.p).reshape(2, -1)
        terms = multipliers_from(entries[3:5], ROW_KINDS * limits.p)
        return cls(selection, weights, strengths, terms, EnclosureRecord(*entries[5:]))

    @property
    def arguments(self) -> tuple[Any, ...]:
        """Those of ``trusted.uniqueness.lone_root`` after the assignment."""
        return self.selection, self.weights, self.strengths, *self.terms


@dataclass(frozen=True, eq=False)
class DeclaredReference(Record):
    """A root of a body that nothing holds and the numbers of its form, to which leaves refer.

    Attributes
    ----------
    selection : final codes
    weights, balance, share : as ``trusted.reference.Reference.of`` takes them
    """

    kind, sizes, unfit = DeclaredForm.kind, (5,), "a form has {} entries; expected {}"

    selection: Codes
    weights: Floats
    balance: float
    share: float

    @classmethod
    def of(cls, entries: list[Any], limits: Limits) -> DeclaredReference:
        """Codes and numbers, if they fit each other."""
        selection = _selection(entries[0], limits.friction)
        weights = numbers_from(entries[1], limits.p + 3 * sum(limits.friction))
        return cls(selection, weights, *numbers_from(entries[2:], 2).tolist())


@dataclass(frozen=True, eq=False)
class OnlyReference(Record):
    """No root but that of a form lies below the assignment; with an enclosure, this one does.

    Attributes
    ----------
    back : int
        So many forms were declared since, and this one.
    rows : list of int
        Rows on displacements that are equations.
    products : list of (row, row, factor)
    enclosure : EnclosureRecord or None
    """

    kind, sizes = Alone.kind, (4, 7)

    back: int
    rows: list[int]
    products: list[tuple[int, int, float]]
    enclosure: EnclosureRecord | None = None

    @classmethod
    def of(cls, entries: list[Any], limits: Limits) -> OnlyReference:
        """Numbers that fit the problem."""
        back, rows, products = entries[:3]
        if type(back) is not int or not 0 < back <= len(limits.declared):
            raise RecordError("its form is not declared")
        if not all(isinstance(value, list) for value in (rows, products)):
            raise RecordError("its rows are not a list")
        factors = [float(numbers_from(product, 3)[2]) for product in products]
        pairs = [product[:2] for product in products]
        if any(type(row) is not int or not 0 <= row < ROW_KINDS * limits.p for row in sum(pairs, rows)):
            raise RecordError("its rows are not numbers of rows")
        said = [(one, other, factor) for (one, other), factor in zip(pairs, factors, strict=True)]
        return cls(back, rows, said, EnclosureRecord(*entries[3:]) if entries[3:] else None)

    def entries(self) -> Iterable[Any]:
        """Without an enclosure where there is none."""
        found = self.back, self.rows, [list(product) for product in self.products]
        return (*found, *(self.enclosure or ()))


#: All kinds of leaves in 2D.
LEAVES = table_of(
    *(Excluded, ExcludedInRationals, ExcludedByForm, NoRoot, NoRootInRationals, RegularRoot, RootSetRecord),
    *(Closed, ClosedInRationals, Alone, Unloaded, UndecidedRecord),
)
#: The same of a body that nothing holds; others rest on a stiffness that is positive definite.
FLOATING_LEAVES = table_of(
    *(Excluded, Unbalanced, NoRoot, NoRootInRationals, RegularRoot, SharedRoot, RootSetRecord, OnlyReference),
    UndecidedRecord,
)


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
