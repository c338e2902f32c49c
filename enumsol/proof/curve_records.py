"""Records of graphs in 3D: boxes of curves, parts of curves, and what stands in trees over pieces of alpha only."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from enumsol.proof.reading import (
    RecordError,
    check_complete,
    is_code_of_leaf,
    numbers_from,
    quoted,
    rational_from,
)
from enumsol.proof.records import Limits, Record, Tree
from enumsol.trusted.space.curve_runs import LinkRange
from enumsol.trusted.space.solution_curve import CurveBox

if TYPE_CHECKING:
    from collections.abc import Sequence
    from fractions import Fraction

    from enumsol.support.array_types import Codes, Floats
    from enumsol.trusted.space.curve_runs import CurveChain
    from enumsol.trusted.space.pieces import AlphaPiece

    #: Boxes of curves in the order in which they are numbered: the curve, and which one of its links it is.
    Boxes = Sequence[tuple[CurveChain, int]]


#: The first entry of a box around a curve of solutions over alpha, or around a point of one.
BOX = "w"


def box_from(record: object, limits: Limits) -> CurveBox:
    """A box; RecordError where it is none, or has not as many numbers as it must have."""
    if not isinstance(record, list) or record[:1] != [BOX]:
        raise RecordError(f"{quoted(record)} is no box")
    if len(record) != 7:
        raise RecordError(Record.unfit.format(len(record), 7))
    m = 3 * limits.p + limits.modes
    try:
        centre, direction, border, radius = (numbers_from(part, m + 1) for part in record[1:5])
        rho, (half,) = numbers_from(record[5], m), numbers_from(record[6:], 1)
    except ValueError as error:
        raise RecordError(f"a box around a curve cannot be read: {error}") from None
    return CurveBox(centre, direction, border, float(half), radius, rho)


def box_record(box: CurveBox) -> list[Any]:
    """The record that ``box_from`` reads."""
    arrays = box.centre, box.direction, box.border, box.radius, box.rho
    return [BOX, *(part.tolist() for part in arrays), box.half]


#: Boxes of the kinds of parts: of the part itself, then of places and of what lies between them.
PARTS = {"s": 1, "f": 3, "c": 4, "h": 2, "u": 1}


@dataclass(frozen=True, eq=False)
class CurvePart:
    """A part of the curve of a link between two places, or a cut of it (theory, section 12.10).

    Attributes
    ----------
    kind : of PARTS
        A run, a fold between two places, a change of statuses between two places, a middle place, or nothing is known.
    boxes : of CurveBox, or None
        The part's own box first, None where one is known that holds it, or none is needed.
    """

    kind: str
    boxes: tuple[CurveBox | None, ...]

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
        """The part as ``read`` takes it."""
        return [self.kind, *(None if box is None else box_record(box) for box in self.boxes)]


@dataclass(frozen=True, eq=False)
class OnCurve(Record):
    """All solutions over the piece lie on a curve, in these of its boxes, one after the other.

    Attributes
    ----------
    first, last : int
        Boxes of the curve.
    numbers : array or None
        Of a form (see ``trusted.space.space_uniqueness.PieceWeights.of``) by which a run of the curve from the first to
        the last box has all solutions with the statuses of the assignment. Without it the assignment is complete, and
        its solutions lie in the boxes.
    """

    kind, sizes, trees, closing = "k", (3, 4), Tree.PIECES, True

    first: int
    last: int
    numbers: Floats | None = None

    @classmethod
    def of(cls, entries: list[Any], limits: Limits) -> OnCurve:
        """The numbers; RecordError where there are not as many as there must be, or no such boxes."""
        first, last, *form = entries
        _boxes([first, last], limits)
        if not form:
            check_complete(limits.codes)
            return cls(first, last)
        if not limits.held:
            raise RecordError("its form is that of a body that is held")
        try:
            return cls(first, last, numbers_from(form[0], 3 * limits.components - limits.p))
        except ValueError as error:
            raise RecordError(f"a form over a piece cannot be read: {error}") from None

    def holds(self, piece: AlphaPiece, codes: Codes, boxes: Boxes, errors: float = 1.0) -> bool:
        """True if all solutions are proven to lie on the curve (theory, section 12.9)."""
        (known, first), (other, last) = boxes[self.first], boxes[self.last]
        if known is not other:
            return False
        if self.numbers is not None:
            return piece.lies_on(known, LinkRange(first, last), codes, self.numbers, errors)
        curves = [link.curve for link in known.links[first : last + 1]]
        return piece.holds_all(codes, known.problem, curves, errors)


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

    kind, sizes, trees, final, closing = "t", (6,), Tree.PIECES, True, True

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
        if not isinstance(leaf, list) or len(leaf) != limits.p or not all(map(is_code_of_leaf, leaf)):
            raise RecordError("the leaf of a point of an arc is none")
        try:
            inside = rational_from(low) <= rational_from(alpha) <= rational_from(high)
        except ValueError as error:
            raise RecordError(f"an arc is over no piece: {error}") from None
        if not inside:
            raise RecordError("a point of an arc is not over its piece")
        return cls(box, low, high, alpha, tuple(leaf))

    def holds(self, piece: AlphaPiece, codes: Codes, boxes: Boxes, interval: tuple[Fraction, Fraction]) -> bool:
        """True if all roots are proven to lie on an arc through the box, over its piece of an interval."""
        (a, b), low, high = interval, rational_from(self.low), rational_from(self.high)
        narrowed = piece.narrowed(codes)[0]
        if not a <= low <= narrowed.low <= narrowed.high <= high <= b:
            return False
        whole, (known, number) = piece.over(low, high), boxes[self.box]
        arc, (at, root) = whole.arc(codes), whole.root_at(rational_from(self.alpha), self.leaf)
        if arc is None or root is None or not arc.has(root, self.leaf):
            return False
        place = at.place(root, known.problem)
        met = place is not None and known.links[number].curve.holds(place)
        return met and known.runs_through(low, high)


def _boxes(entries: list[Any], limits: Limits) -> list[int]:
    """Numbers of boxes around curves."""
    for box in entries:
        if type(box) is not int or not 0 <= box < limits.boxes:
            raise RecordError(f"there is no box {quoted(box)}")
    return entries
