"""Cuts curves in 3D into runs, on which statuses hold and alpha goes one way, and turns between them.

Where to cut is found in floats; what holds of the parts is shown in ``trusted.space.curve_parts``
(theory, section 12.10).
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import brentq

from enumsol.proof.curve_records import CurvePart
from enumsol.search.space.curve_proposals import curve_along, curve_point, proven_point
from enumsol.support.deadlines import look, tell
from enumsol.trusted.space.curve_parts import (
    CurveMotion,
    LinkParts,
    Place,
    Run,
    Turn,
    in_order,
    put_behind,
    up_to_bound,
)
from enumsol.trusted.space.sector_rows import OPEN, STICK
from enumsol.trusted.space.solution_curve import SLIP, only_curve

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from enumsol.search.space.curve_proposals import CurvePoint
    from enumsol.selections.solution import Codes
    from enumsol.trusted.space.curve_runs import CurveChain, CurveLink
    from enumsol.trusted.space.solution_curve import AlphaProblem, SolutionCurve

    Array = NDArray[np.float64]

#: How often a part is halved; how near to the place that floats find the points beside it are put at
#: best, relative to the part, how much of this that place may be off, by what factor farther others are, and how many.
_HALVINGS = 12
_BESIDE, _CLOSE, _FARTHER, _TRIALS = 2.0**-44, 0.25, 8.0, 15
#: Parts are wider by this than their ends are known.
_ROUNDED = 16.0


def runs_and_turns(
    chain: CurveChain,
    found: list[Run | Turn] | None = None,
    records: list[CurvePart] | None = None,
) -> list[Run | Turn]:
    """Runs and turns of a curve, in its order; see ``in_order``.

    ``found`` is filled on the way, so that it has what there is when the time is over, and ``records`` with those of a
    proof.
    """
    found, nearness = [] if found is None else found, _TRIALS // 2
    for k, (link, start, end) in enumerate(zip(chain.links, chain.joints[:-1], chain.joints[1:], strict=True)):
        look()
        tell("boxes of a curve cut into arcs", k, len(chain.links))
        cutter = LinkCutter(link, nearness, records)
        _put(found, up_to_bound(link, cutter.parts(start, end)))
        nearness = cutter.nearness
    whole = in_order([found], closed=chain.closed)
    assert whole is not None
    return whole


def _put(found: list[Run | Turn], parts: Sequence[Run | Turn]) -> None:
    """Put parts behind others."""
    if not put_behind(found, parts):
        raise AssertionError("a curve changes at a regular point")


def status_margin(problem: AlphaProblem, z: Array, nodes: Sequence[int], codes: Sequence[int]) -> float:
    """The least of the conditions of nodes' statuses at (z, alpha), negative where one does not hold."""
    i = np.asarray(nodes)
    normal, F = z[i], np.maximum(problem.F0 + z[-1] * problem.F1, 0.0)[i]
    tangent = np.where(problem.places[i] >= 0, z[problem.places[i]], 0.0)
    gap = np.linalg.norm(tangent, axis=1) - F * normal
    status, sticks, slips = np.asarray(codes), np.minimum(normal, -gap), np.minimum(normal, gap)
    return float(np.min(np.select([status == OPEN, status == STICK, status == SLIP], [-normal, sticks, slips], normal)))


class LinkCutter(LinkParts):
    """Cuts the curve of a link into runs and turns.

    Parameters
    ----------
    link : CurveLink
    nearness : int
        Which of the distances from a change to the points beside it is tried first: then that of the last change.
    records : list, optional
        Filled with the records of a proof, in the order of a walk.
    """

    def __init__(self, link: CurveLink, nearness: int = _TRIALS // 2, records: list[CurvePart] | None = None) -> None:
        super().__init__(link)
        self.nearness, self._open, self._records = nearness, 0, [] if records is None else records
        # a link is cut into so many parts at most: near the limit of sliding alpha hardly changes along a curve
        self._last = len(self._records) + 256

    def parts(self, start: SolutionCurve, end: SolutionCurve) -> list[Run | Turn]:
        """From one joint to another one."""
        return self._cut(self.curve, self.place(start), self.place(end), None, _HALVINGS)

    def _told(self, kind: str, own: SolutionCurve | None, *places: Place, near: SolutionCurve | None = None) -> None:
        """Add a record of a part with a box of its own, if it has one, and these places."""
        curves = [own, *(place.point for place in places), *([near] if kind == "c" else [])]
        boxes = (None if curve is None else curve.box for curve in curves)
        self._records.append(CurvePart(kind, tuple(boxes)))

    def _cut(
        self, curve: SolutionCurve | None, start: Place, end: Place, codes: Codes | None, times: int
    ) -> list[Run | Turn]:
        """Runs and turns between two places.

        Parameters
        ----------
        curve : one in whose box both places lie, None to look for one
        codes : the statuses that hold all along, if that is known
        times : how often it may be halved
        """
        own = self._between(start, end) if curve is None else None
        curve = own if curve is None else curve
        if curve is not None:
            motion = CurveMotion(curve)
            changing: Sequence[int] = ()
            if codes is None:
                codes, changing = self.statuses(motion, start, end)
            found = None
            if changing:
                found = self._corner(own, motion, start, end, changing, times)
            elif codes is not None:
                found = self._smooth(own, motion, start, end, codes)
            if found is not None:
                return found
        # as where a body slides at one alpha
        still = codes is not None and not start.rises and not end.rises
        own = self._between(start, end) if still and own is None else own
        # a part along which alpha does not change is left open where its bounds are as close as this
        done = still and own is not None and own.alphas[1] - own.alphas[0] <= Fraction(2.0**-32)
        left = times > 0 or (still and times > -_HALVINGS)
        # after so many parts of a link that stay open none is halved: along a continuum of solutions all would
        left &= not done and self._open < 16 and len(self._records) < self._last
        middle = self._middle(start, end) if left else None
        if middle is None:
            self._open += not done
            self._told("u", own)
            return [self.left_open(curve if own is None else own, start, end)]
        self._told("h", own, middle)
        found = []
        for one, other in ((start, middle), (middle, end)):
            _put(found, self._cut(None, one, other, codes, times - 1))
        return found

    def _smooth(
        self, own: SolutionCurve | None, motion: CurveMotion, start: Place, end: Place, codes: Codes
    ) -> list[Run | Turn] | None:
        """Parts without a change of statuses: one run, or two with a fold between them."""
        run = self.run(motion, start, end, codes)
        if run is not None:
            self._told("s", own)
            return [run]
        if not (start.rises and start.rises == -end.rises and motion.bends(codes)):
            return None
        # farther away beside a smooth fold, where alpha is a square of the distance
        sides = self._beside(start, end, lambda point: start.rises * float(point.direction[-1]), 2.0**-24)
        found = None if sides is None else self.fold(motion, start, end, codes, sides)
        if sides is not None and found is not None:
            self._told("f", own, *sides)
        return found

    def _corner(
        self,
        own: SolutionCurve | None,
        motion: CurveMotion,
        start: Place,
        end: Place,
        nodes: Sequence[int],
        times: int,
    ) -> list[Run | Turn] | None:
        """Parts in which nodes change their statuses, each of them once: the first change, and what follows."""
        one = start.codes
        mine = [one[i] for i in nodes]
        sides = self._beside(start, end, lambda point: status_margin(self.problem, point.z, nodes, mine), _BESIDE)
        if sides is None or sides[0].codes != one:
            return None
        near = self._between(*sides)
        turn = self.corner(motion if near is None else CurveMotion(near), start, end, sides)
        if turn is None:
            return None
        self._told("c", own, *sides, near=near)
        found: list[Run | Turn] = []
        _put(found, self._cut(self.curve, start, sides[0], one, times - 1))
        _put(found, [turn])
        _put(found, self._cut(*self.behind(sides[1], end), times - 1))
        return found

    # -- places ----------------------------------------------------------------------------------------------------

    def _near(self, start: Place, end: Place, share: float) -> CurvePoint | None:
        """The point of the curve with this share of the way, in floats."""
        return curve_point(self.problem, start.x + share * (end.x - start.x), self.border)

    def _at(self, start: Place, end: Place, share: float) -> Place | None:
        """The place there, proven."""
        return self.place_at(proven_point(self.problem, self._near(start, end, share), self.border))

    def _middle(self, start: Place, end: Place) -> Place | None:
        # where a part is cut: at the first of these shares where the solution is regular
        found = (self._at(start, end, share) for share in (0.5, 0.4375, 0.59375))
        return next((place for place in found if place is not None and self.is_between(start, place, end)), None)

    def _passage(self, start: Place, end: Place, value: Callable[[CurvePoint], float], close: float) -> float | None:
        """The share of the way at which a number that is positive before and negative behind is 0, in floats."""

        def at(share: float) -> float:
            point = self._near(start, end, share)
            return np.nan if point is None else value(point)

        try:
            return float(brentq(at, 0.0, 1.0, xtol=close))
        except ValueError:  # no point is found, or there is no change of signs
            return None

    def _beside(
        self, start: Place, end: Place, value: Callable[[CurvePoint], float], least: float
    ) -> tuple[Place, Place] | None:
        """Places close to where a number changes its sign, on both sides of it."""
        share = self._passage(start, end, value, _CLOSE * least)
        if share is None:
            return None
        found, nearest, farthest = None, 0, _TRIALS
        while nearest < farthest:
            k = min(max(self.nearness, nearest), farthest - 1)
            away = least * _FARTHER**k
            # both ends may be as near to it as the points beside it are put
            shares = max(share - away, 0.5 * share), min(share + away, 0.5 * (1.0 + share))
            sides = self._apart(start, end, shares)
            if sides is None:
                nearest = k + 1
            else:
                found, farthest = sides, k
        if found is not None:
            self.nearness = farthest
        return found

    def _apart(self, start: Place, end: Place, shares: tuple[float, float]) -> tuple[Place, Place] | None:
        """Places at two shares of the way, if they are proven to be on different sides."""
        before = self._at(start, end, shares[0])
        after = None if before is None else self._at(start, end, shares[1])
        return (before, after) if before is not None and after is not None and self._tells(before, after) else None

    @staticmethod
    def _tells(one: Place, other: Place) -> bool:
        """True if two places are proven to be on different sides."""
        return one.codes != other.codes or one.rises * other.rises < 0

    def _between(self, start: Place, end: Place) -> SolutionCurve | None:
        """A curve in a box of its own that has two places of the link."""
        return curve_between(start, end, self.border)


def curve_between(start: Place, end: Place, border: Array) -> SolutionCurve | None:
    """A curve in a box of its own that has two places; None where none is proven to have them."""
    problem = start.point.problem
    changing = [i for i, pair in enumerate(zip(start.codes, end.codes, strict=True)) if pair[0] != pair[1]]
    curve = curve_along(problem, (start.x, end.x), border, changing)
    if curve is None:
        return None
    # a curve that only alpha changes along needs a box of the size of rounding errors
    least = _ROUNDED * np.maximum(*(place.point.at(0.0).rad for place in (start, end)))
    if np.any(curve.box.radius < least):
        curve = only_curve(problem, replace(curve.box, radius=np.maximum(curve.box.radius, least)))
    return curve if curve is not None and LinkParts.has(curve, start, end) else None
