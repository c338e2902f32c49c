"""Leaves of proofs about problems in 3D, and the table of their kinds (see ``proof.records``)."""

from __future__ import annotations

import base64
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.model.sectors import DEEPEST, RUN, SECTORS, is_sector
from enumsol.proof.reading import bytes_from, numbers_from, quoted, rational_from
from enumsol.proof.records import (
    Alone,
    ClosingRecord,
    DeclaredForm,
    EnclosureRecord,
    Exclusion,
    Limits,
    NoRoot,
    Record,
    RecordError,
    RegularRoot,
    Solved,
    Unbalanced,
    UndecidedRecord,
    Unloaded,
    table_of,
)
from enumsol.trusted.space.sector_rows import FORCE, GAP, RIGHT, UNDECIDED
from enumsol.trusted.space.solution_curve import CurveBox

if TYPE_CHECKING:
    from fractions import Fraction

    from enumsol.support.array_types import Floats
    from enumsol.trusted.space.sector_rows import Row


#: Numbers of directions and sectors in rows are less; directions of tangents are less than RUN.
_NUMBERS = RUN << DEEPEST


@dataclass(frozen=True, eq=False)
class ExcludedInSpace(Exclusion):
    """Multipliers of rows exclude the assignment."""

    kind, sizes = "x", (3,)

    rows: list[Row]
    values: Floats

    @classmethod
    def of(cls, entries: list[Any], limits: Limits) -> ExcludedInSpace:
        """Rows and as many multipliers."""
        return cls(*_multiplied(entries, limits))

    def entries(self) -> Iterable[Any]:
        """Rows, and the multipliers as a text."""
        return self.rows, _text(self.values)


@dataclass(frozen=True, eq=False)
class ExcludedOverPiece(Exclusion):
    """The same over a piece of alpha: multipliers at its lower and at its upper end, between which they are affine."""

    kind, sizes = ExcludedInSpace.kind, (4,)

    rows: list[Row]
    low: Floats
    high: Floats

    @classmethod
    def of(cls, entries: list[Any], limits: Limits) -> ExcludedOverPiece:
        """Rows and as many multipliers, twice."""
        return cls(*_multiplied(entries, limits))

    def entries(self) -> Iterable[Any]:
        """Rows, and both lists of multipliers as texts."""
        return self.rows, _text(self.low), _text(self.high)


@dataclass(frozen=True, eq=False)
class DeclaredSlipForm(Record):
    """A form to which later leaves refer: mu and kappa of every node, and a number for each tau."""

    kind, sizes, unfit = DeclaredForm.kind, (2,), "a form has {} entries; expected {}"

    numbers: Floats

    @classmethod
    def of(cls, entries: list[Any], limits: Limits) -> DeclaredSlipForm:
        """The numbers; ValueError where there are not as many as tau."""
        try:
            return cls(numbers_from(entries[0], limits.components + limits.p))
        except ValueError as error:
            raise ValueError(f"a form cannot be read: {error}") from None


@dataclass(frozen=True, eq=False)
class DeclaredProductForm(Record):
    """A sum of products over an assignment, to whose ellipsoid later leaves refer.

    Attributes
    ----------
    codes : of the assignment, which has no undecided node
    centre : (m,) array
        A point near the minimiser of the form.
    numbers : a multiplier for every product, as ``trusted.space.product_forms.Ellipsoid.of`` takes them
    """

    kind, sizes, unfit = DeclaredForm.kind, (4,), "a form has {} entries; expected {}"

    codes: tuple[int, ...]
    centre: Floats
    numbers: Floats

    @classmethod
    def of(cls, entries: list[Any], limits: Limits) -> DeclaredProductForm:
        """Codes and numbers; ValueError where they make no sense."""
        codes, centre, numbers = entries
        if not isinstance(codes, list) or len(codes) != limits.p or not all(map(_is_final, codes)):
            raise ValueError("a form cannot be read: it is about no assignment")
        try:
            count = len(numbers) if isinstance(numbers, list) else 0
            return cls(tuple(codes), numbers_from(centre, limits.components), numbers_from(numbers, count))
        except ValueError as error:
            raise ValueError(f"a form cannot be read: {error}") from None


@dataclass(frozen=True, eq=False)
class DeclaredSpaceReference(Record):
    """A root of a body that nothing holds and the numbers of its form, to which later leaves refer.

    Attributes
    ----------
    leaf : codes of a leaf that holds the root
    numbers, balance, share : as ``trusted.space.space_reference.SpaceReference.of`` takes them
    enclosure : EnclosureRecord
    """

    kind, sizes, unfit = DeclaredForm.kind, (8,), "a form has {} entries; expected {}"

    leaf: tuple[int, ...]
    numbers: Floats
    balance: float
    share: float
    enclosure: EnclosureRecord

    @classmethod
    def of(cls, entries: list[Any], limits: Limits) -> DeclaredSpaceReference:
        """Codes and numbers; ValueError where they make no sense."""
        leaf, numbers, balance, share, *enclosure = entries
        if not isinstance(leaf, list) or len(leaf) != limits.p or not all(map(_is_final, leaf)):
            raise ValueError("a form cannot be read: it is about no leaf")
        try:
            values = numbers_from(numbers, limits.p + 2 * limits.components)
            balance, share = numbers_from([balance, share], 2).tolist()
        except ValueError as error:
            raise ValueError(f"a form cannot be read: {error}") from None
        return cls(tuple(leaf), values, balance, share, EnclosureRecord(*enclosure))


@dataclass(frozen=True, eq=False)
class OnlySpaceReference(ClosingRecord):
    """No root but that of the form that was declared last lies below the assignment.

    Attributes
    ----------
    rows : rows on displacements that are equations
    products : list of (row, row, factor)
    """

    kind, sizes = Alone.kind, (3,)

    rows: list[Row]
    products: list[tuple[Row, Row, float]]

    @classmethod
    def of(cls, entries: list[Any], limits: Limits) -> OnlySpaceReference:
        """Rows and factors."""
        if not all(isinstance(entry, list) for entry in entries):
            raise RecordError("its rows are not a list")
        rows, products = entries
        if not all(isinstance(product, list) and len(product) == 3 for product in products):
            raise RecordError("its products are not pairs of rows with a factor")
        factors = numbers_from([factor for *_, factor in products], len(products)).tolist()
        pairs = [tuple(_row(row, limits.p) for row in product[:2]) for product in products]
        said = [(one, other, factor) for (one, other), factor in zip(pairs, factors, strict=True)]
        return cls([_row(row, limits.p) for row in rows], said)


@dataclass(frozen=True)
class MissedByProducts(Exclusion):
    """The ellipsoid of the form of products that was declared last leaves no solution."""

    kind, sizes = "e", (1,)


@dataclass(frozen=True, eq=False)
class ExcludedBySlipForm(ExcludedInSpace):
    """The same with the form that was declared last in place of the energy."""

    kind = "f"


@dataclass(frozen=True, eq=False)
class OnlyRoot(ClosingRecord):
    """Below the assignment there is this solution only, or none; if it is the whole tree, the problem has it only.

    Attributes
    ----------
    numbers : of the form, as ``trusted.space.space_uniqueness.Numbers.of`` takes them
    leaf : codes of a leaf that holds the solution, or none
    force : midpoint of the enclosure
    enclosure : EnclosureRecord
    """

    kind, sizes = "m", (6,)

    numbers: Floats
    leaf: tuple[int, ...]
    force: Floats
    enclosure: EnclosureRecord

    @classmethod
    def of(cls, entries: list[Any], limits: Limits) -> OnlyRoot:
        """Numbers and codes; below the root of the tree those of a leaf."""
        values, leaf, mid, *_ = entries
        if not leaf and any(code != UNDECIDED for code in limits.codes):
            raise RecordError("its only solution is claimed below the root of the tree without a leaf")
        numbers, force = numbers_from(values, limits.p + 2 * limits.components), numbers_from(mid, limits.components)
        if not isinstance(leaf, list) or not all(type(code) is int for code in leaf):
            raise RecordError("its leaf is not a list of codes")
        return cls(numbers, tuple(leaf), force, EnclosureRecord(*entries[2:]))

    def entries(self) -> Iterable[Any]:
        """The enclosure has the midpoint."""
        return self.numbers, self.leaf, *self.enclosure


@dataclass(frozen=True, eq=False)
class BoxedRoot(Solved):
    """All roots of a leaf lie in a box that holds one solution.

    Attributes
    ----------
    mid, rad, rho : centre and radius of the box, and its weights of displacements, read where they are needed
    enclosure : EnclosureRecord
    """

    kind, sizes = "l", (7,)

    mid: Any
    rad: Any
    rho: Any
    enclosure: EnclosureRecord

    @classmethod
    def of(cls, entries: list[Any], limits: Limits) -> BoxedRoot:
        """The box and the enclosure."""
        del limits
        mid, rad, rho, *enclosure = entries
        return cls(mid, rad, rho, EnclosureRecord(*enclosure))

    def box(self, size: int) -> tuple[Floats, Floats, Floats]:
        """Centre, radius and rho of the box; ValueError where they are no ``size`` numbers each."""
        return numbers_from(self.mid, size), numbers_from(self.rad, size), numbers_from(self.rho, size)

    def entries(self) -> Iterable[Any]:
        """Those of the enclosure after the box."""
        return self.mid, self.rad, self.rho, *self.enclosure


class EnclosedByProducts(BoxedRoot, ClosingRecord):
    """All solutions lie in the ellipsoid that was declared last, which lies in a box with one solution."""

    kind = "j"

    @classmethod
    def check(cls, record: list[Any], limits: Limits) -> None:
        """The same; statuses may be open."""
        super(Solved, cls).check(record, limits)


@dataclass(frozen=True, eq=False)
class CurveBoxRecord(Record):
    """A box around a curve of solutions over alpha, or around a point of one.

    Attributes
    ----------
    centre, direction, border, radius : (m + 1,) arrays, m = 3p, with rigid modes 3p + r
    rho : (m,) array
    half : float
    """

    kind, sizes = "w", (7,)

    centre: Floats
    direction: Floats
    border: Floats
    radius: Floats
    rho: Floats
    half: float

    @classmethod
    def of(cls, entries: list[Any], limits: Limits) -> CurveBoxRecord:
        """The numbers; RecordError where there are not as many as there must be."""
        try:
            m = 3 * limits.p + limits.modes
            c, d, e, radius = (numbers_from(part, m + 1) for part in entries[:4])
            rho = numbers_from(entries[4], m)
            (half,) = numbers_from([entries[5]], 1)
        except ValueError as error:
            raise RecordError(f"a box around a curve cannot be read: {error}") from None
        return cls(c, d, e, radius, rho, float(half))

    @classmethod
    def around(cls, box: CurveBox) -> CurveBoxRecord:
        """That of a box."""
        return cls(box.centre, box.direction, box.border, box.radius, box.rho, box.half)

    @property
    def box(self) -> CurveBox:
        """What it stands for."""
        return CurveBox(self.centre, self.direction, self.border, self.half, self.radius, self.rho)


#: Boxes of the kinds of parts: of the part itself, then of places and of what lies between them.
PARTS = {"s": 1, "f": 3, "c": 4, "h": 2, "u": 1}


@dataclass(frozen=True, eq=False)
class CurvePart:
    """What the curve of a link does between two places, or how that part is cut (theory, section 12.10).

    Attributes
    ----------
    kind : of PARTS
        A run, a fold between two places, a change of statuses between two places, a middle place, or nothing is known.
    boxes : of CurveBoxRecord, or None
        The part's own box first, None where one is known that holds it, or none is needed.
    """

    kind: str
    boxes: tuple[CurveBoxRecord | None, ...]

    @classmethod
    def read(cls, record: Any, limits: Limits) -> CurvePart:
        """A part; RecordError where it is none."""
        kind = record[0] if isinstance(record, list) and record and isinstance(record[0], str) else None
        if kind not in PARTS or len(record) != 1 + PARTS[kind]:
            raise RecordError(f"{quoted(record)} is no part of a curve")
        boxes = [None if box is None else box_from(box, limits) for box in record[1:]]
        places = boxes[1:3] if kind in ("f", "c") else boxes[1:]
        if None in places:
            raise RecordError("a place on a curve is missing")
        return cls(kind, tuple(boxes))

    def write(self) -> list[Any]:
        """As ``read`` takes it."""
        return [self.kind, *(None if box is None else box.write() for box in self.boxes)]


def box_from(record: Any, limits: Limits) -> CurveBoxRecord:
    """A box; RecordError where it is none."""
    if not isinstance(record, list) or record[:1] != [CurveBoxRecord.kind]:
        raise RecordError(f"{quoted(record)} is no box")
    found: CurveBoxRecord = CurveBoxRecord.read(record, limits)
    return found


@dataclass(frozen=True)
class CutPiece(Record):
    """The piece of alpha is cut here; the subtrees of both parts follow, the lower one first."""

    kind, sizes = "a", (2,)

    alpha: str

    def between(self, low: Fraction, high: Fraction) -> Fraction:
        """Where it is cut; RecordError where that is not within the piece."""
        try:
            alpha = rational_from(self.alpha)
        except ValueError as error:
            raise RecordError(f"a piece is cut nowhere: {error}") from None
        if not low < alpha < high:
            raise RecordError("a piece is not cut within")
        return alpha


@dataclass(frozen=True)
class InCurveBoxes(Record):
    """All solutions over the piece lie in these boxes of a curve, one after the other."""

    kind, sizes = "k", (3,)

    first: int
    last: int

    @classmethod
    def of(cls, entries: list[Any], limits: Limits) -> InCurveBoxes:
        """The numbers of the boxes."""
        return cls(*_boxes(entries, limits))


@dataclass(frozen=True)
class ThroughCurveBox(Record):
    """All roots over the piece lie on one arc, and one of its points in this box.

    Attributes
    ----------
    box : int
    low, high : str
        The arc is one over this piece, which has all alpha of the roots.
    alpha : str
    leaf : codes of a leaf whose root at that alpha is the point
    """

    kind, sizes = "r", (6,)

    box: int
    low: str
    high: str
    alpha: str
    leaf: tuple[int, ...]

    @classmethod
    def of(cls, entries: list[Any], limits: Limits) -> ThroughCurveBox:
        """The entries; RecordError where there is no such box, or they are no numbers or no leaf."""
        box, low, high, alpha, leaf = entries
        _boxes([box], limits)
        if not isinstance(leaf, list) or len(leaf) != limits.p or not all(map(_is_final, leaf)):
            raise RecordError("the leaf of a point of an arc is none")
        try:
            inside = rational_from(low) <= rational_from(alpha) <= rational_from(high)
        except ValueError as error:
            raise RecordError(f"an arc is over no piece: {error}") from None
        if not inside:
            raise RecordError("a point of an arc is not over its piece")
        return cls(box, low, high, alpha, tuple(leaf))

    @property
    def piece(self) -> tuple[Fraction, Fraction]:
        """Of the arc."""
        return rational_from(self.low), rational_from(self.high)

    @property
    def point(self) -> tuple[Fraction, tuple[int, ...]]:
        """Alpha and the leaf."""
        return rational_from(self.alpha), self.leaf


def _boxes(entries: list[Any], limits: Limits) -> list[int]:
    """Numbers of boxes around curves."""
    for box in entries:
        if type(box) is not int or not 0 <= box < limits.boxes:
            raise RecordError(f"there is no box {quoted(box)}")
    return entries


@dataclass(frozen=True, eq=False)
class OnlyOnCurve(Record):
    """A run of a curve has all solutions over the piece with the statuses of the assignment.

    Attributes
    ----------
    numbers : of the form, as ``trusted.space.piece_forms.PieceWeights.of`` takes them
    first, last : boxes of the curve at which the run begins and ends
    """

    kind, sizes = "m", (4,)

    numbers: Floats
    first: int
    last: int

    @classmethod
    def of(cls, entries: list[Any], limits: Limits) -> OnlyOnCurve:
        """The numbers; RecordError where there are not as many as there must be, or no such boxes."""
        values, *run = entries
        _boxes(run, limits)
        try:
            return cls(numbers_from(values, 2 * limits.p + 3 * limits.components - 3 * limits.p), *run)
        except ValueError as error:
            raise RecordError(f"a form over a piece cannot be read: {error}") from None


#: All kinds of leaves in 3D.
LEAVES = table_of(
    ExcludedInSpace,
    ExcludedBySlipForm,
    MissedByProducts,
    NoRoot,
    RegularRoot,
    BoxedRoot,
    EnclosedByProducts,
    OnlyRoot,
    Unloaded,
    UndecidedRecord,
)
#: The same of a body that nothing holds; others rest on a stiffness that is positive definite.
FLOATING_LEAVES = table_of(ExcludedInSpace, Unbalanced, NoRoot, RegularRoot, OnlySpaceReference, UndecidedRecord)
#: Of a tree over alpha, too.
PIECE_LEAVES = table_of(ExcludedOverPiece, NoRoot, InCurveBoxes, ThroughCurveBox, OnlyOnCurve, UndecidedRecord)
#: The same of a body that nothing holds.
FLOATING_PIECE_LEAVES = table_of(ExcludedOverPiece, Unbalanced, NoRoot, InCurveBoxes, ThroughCurveBox, UndecidedRecord)


def _multiplied(entries: list[Any], limits: Limits) -> Iterable[Any]:
    """Rows, and lists of as many multipliers."""
    rows, *texts = entries
    if not isinstance(rows, list) or not all(isinstance(text, str) for text in texts):
        raise ValueError("its multipliers are not a list of rows and a text")
    lists = [np.frombuffer(bytes_from(text), dtype="<f8").astype(np.float64) for text in texts]
    for values in lists:
        if len(rows) != len(values):
            raise ValueError(f"{len(rows)} rows and {len(values)} multipliers")
    return [_row(row, limits.p) for row in rows], *lists


def _text(values: Floats) -> str:
    return base64.b64encode(values.astype("<f8").tobytes()).decode()


def _is_final(code: Any) -> bool:
    """Whether a code is a status that is not undecided, or that of a sector."""
    return type(code) is int and (0 <= code < UNDECIDED or (code > SECTORS and is_sector(code - SECTORS)))


def _row(row: Any, p: int) -> Row:
    if not isinstance(row, list) or len(row) != 3 or not all(type(x) is int for x in row):
        raise ValueError(f"{quoted(row)} is not a row")
    kind, node, number = row
    known = 0 <= kind <= RIGHT and 0 <= node < p and -1 <= number < _NUMBERS
    if not known or (kind in (GAP, FORCE) and number):
        raise ValueError(f"row {quoted(row)} does not exist")
    return kind, node, number
