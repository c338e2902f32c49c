"""Checker of how the curves of a graph's proof in 3D are cut into arcs (theory, section 12.10).

Records of a curve: ``{"parts": true}``, then parts in the order of a walk, those of every box between its two points:
``["s", box]`` (statuses stay and alpha goes one way), ``["f", box, before, after]`` (statuses stay and alpha turns back
once, between two places), ``["c", box, before, after, near]`` (nodes change their statuses between two places, each of
them once; the parts before and behind follow), ``["h", box, middle]`` (both halves follow) and ``["u", box]`` (open).
Boxes and places are given as those of a curve are; the first one may be null where a box is known, the last one of "c"
where the part's own box serves.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from enumsol.proof.curve_records import CurvePart
from enumsol.proof.reading import RefusedError
from enumsol.proof.records import Limits, RecordError
from enumsol.trusted.space.curve_events import CurveMotion
from enumsol.trusted.space.curve_parts import LinkParts, in_order, up_to_bound
from enumsol.trusted.space.solution_curve import only_curve

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from enumsol.proof.curve_records import CurveBoxRecord
    from enumsol.trusted.space.curve_chains import CurveChain, CurveLink
    from enumsol.trusted.space.curve_parts import Place, Run, Turn
    from enumsol.trusted.space.solution_curve import AlphaProblem, SolutionCurve

    Codes = tuple[int, ...]


def parts_of(problem: AlphaProblem, chain: CurveChain, records: Iterator[Any], limits: Limits) -> list[Run | Turn]:
    """The runs and turns of a curve, each of them proven.

    Raises
    ------
    RefusedError
        A record is no part, or does not prove what it says.
    """
    joined = zip(chain.links, chain.joints[:-1], chain.joints[1:], strict=True)
    links = (up_to_bound(link, LinkCuts(problem, link, records, limits).parts(*ends)) for link, *ends in joined)
    found = in_order(links, closed=chain.closed)
    if found is None:
        raise RefusedError("a curve changes its statuses where two of its boxes meet")
    return found


class LinkCuts(LinkParts):
    """Reads the parts of a link.

    Parameters
    ----------
    problem : AlphaProblem
    link : CurveLink
    records : iterator
    limits : of the problem
    """

    def __init__(self, problem: AlphaProblem, link: CurveLink, records: Iterator[Any], limits: Limits) -> None:
        super().__init__(problem, link)
        self._records, self._limits = records, limits

    def parts(self, start: SolutionCurve, end: SolutionCurve) -> list[Run | Turn]:
        """From one joint to another one."""
        if None in start.statuses or None in end.statuses:
            raise RefusedError("at a point of a curve that is cut into arcs a status is not known")
        # parts that are cut more often than this are no honest proof's
        return self._read(self.curve, self.place(start), self.place(end), None, 64)

    def _read(
        self, curve: SolutionCurve | None, start: Place, end: Place, codes: Codes | None, deepest: int
    ) -> list[Run | Turn]:
        """Parts between two places; a curve that has both, and the statuses that hold, where they are known."""
        if not deepest:
            raise RefusedError("a curve is cut too often")
        try:
            part = CurvePart.read(next(self._records, None), self._limits)
        except RecordError as error:
            raise RefusedError(f"a part of a curve cannot be read: {error}") from None
        own, *boxes = part.boxes
        if own is not None:
            curve = self.curve_in(own.box, start, end)
            if curve is None:
                raise RefusedError("the box of a part of a curve is not proven to hold it")
        if part.kind == "u":
            return [self.left_open(curve, start, end)]
        motion = None if curve is None else CurveMotion(self.problem, curve)
        changing: Sequence[int] = ()
        if codes is None and motion is not None:
            codes, changing = self.statuses(motion, start, end)
        if part.kind == "h":
            return self._halves(start, self._place_in(boxes[0]), end, codes, deepest)
        if motion is None:
            raise RefusedError("a part of a curve has no box")
        if part.kind == "c":
            return self._changed(motion, (start, end), changing, boxes, deepest)
        return self._unchanged(part.kind, motion, (start, end), codes, boxes)

    def _halves(self, start: Place, middle: Place, end: Place, codes: Codes | None, deepest: int) -> list[Run | Turn]:
        if not self.is_between(start, middle, end):
            raise RefusedError("a curve is cut beside the part that is to be cut")
        first = self._read(None, start, middle, codes, deepest - 1)
        return [*first, *self._read(None, middle, end, codes, deepest - 1)]

    def _unchanged(
        self,
        kind: str,
        motion: CurveMotion,
        ends: tuple[Place, Place],
        codes: Codes | None,
        boxes: Sequence[CurveBoxRecord | None],
    ) -> list[Run | Turn]:
        """A run, or two with a fold between them."""
        found: Sequence[Run | Turn | None] | None = None
        if codes is not None and kind == "s":
            found = [self.run(motion, *ends, codes)]
        elif codes is not None:
            found = self.fold(motion, *ends, codes, (self._place_in(boxes[0]), self._place_in(boxes[1])))
        proven = [part for part in found or () if part is not None]
        if not proven:
            raise RefusedError("it is not proven which way alpha goes along a part of a curve")
        return proven

    def _changed(
        self,
        motion: CurveMotion,
        ends: tuple[Place, Place],
        changing: Sequence[int],
        boxes: Sequence[CurveBoxRecord | None],
        deepest: int,
    ) -> list[Run | Turn]:
        """A corner, with what is before and behind it."""
        before, after, near = self._place_in(boxes[0]), self._place_in(boxes[1]), boxes[2]
        if near is not None:
            curve = self.curve_in(near.box, before, after)
            if curve is None:
                raise RefusedError("the box between two places of a curve is not proven to hold them")
            motion = CurveMotion(self.problem, curve)
        turn = self.corner(motion, *ends, (before, after)) if changing else None
        if turn is None:
            raise RefusedError("it is not proven that a curve changes its statuses between two places")
        first = self._read(self.curve, ends[0], before, ends[0].codes, deepest - 1)
        return [*first, turn, *self._read(*self.behind(after, ends[1]), deepest - 1)]

    def _place_in(self, record: CurveBoxRecord | None) -> Place:
        """A proven place of the curve."""
        point = None if record is None else only_curve(self.problem, record.box)
        place = self.place_at(point)
        if place is None:
            raise RefusedError("a place is not proven to be on its curve")
        return place
