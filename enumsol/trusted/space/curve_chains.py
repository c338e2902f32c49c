"""The trusted test that boxes which share points hold one curve from end to end (theory, section 12.9)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from enumsol.arithmetic.balls import SAFE, UNIT, Ball
from enumsol.trusted.space.solution_curve import (
    AlphaProblem,
    CurveBox,
    SolutionCurve,
    lies_in,
    only_curve,
    parameter_in,
)

#: Bounds of alpha.
Range = tuple[Fraction, Fraction]


@dataclass(frozen=True, eq=False)
class CurveLink:
    """A curve in a box and the part of it between two of its points.

    Attributes
    ----------
    curve : SolutionCurve
    start, end : Balls
        t at both points; those of ``end`` are larger.
    leaves : int
        Of a body that nothing holds: 1 if its rigid displacement is within its bounds at ``start``, reaches one of them
        at one t and is beyond it from there on; -1 if it comes from beyond one; 0 if it is within all along.
    """

    curve: SolutionCurve
    start: Ball
    end: Ball
    leaves: int = 0


def link_between(curve: SolutionCurve, start: SolutionCurve, end: SolutionCurve) -> CurveLink | None:
    """The part of a curve between two of its points, if both lie in its box and in this order.

    Of a body that nothing holds, if its rigid displacement is within its bounds at one of them at least and does not
    come back to them from beyond (theory, section 14.14).
    """
    ends = start.at(0.0), end.at(0.0)
    if not all(lies_in(curve.box, x) for x in ends):
        return None
    low, high = (parameter_in(curve.box, x) for x in ends)
    between = high - low
    if not between.mid > between.rad * SAFE:
        return None
    if curve.problem.within(curve.at(_hull(low, high))):
        return CurveLink(curve, low, high)
    sides = [side for side, inner, outer in ((1, *ends), (-1, *ends[::-1])) if _leaves(curve, inner, outer, side)]
    return CurveLink(curve, low, high, sides[0]) if sides else None


def _leaves(curve: SolutionCurve, inner: Ball, outer: Ball, side: int) -> bool:
    """True if the rigid displacement is within its bounds at one point, and no bound is passed twice on the way out."""
    problem = curve.problem
    if not problem.within(inner):
        return False
    rigid = problem.rigid
    there, slope, reach = outer[rigid], curve.slope[rigid], problem.reach
    # what may be beyond its bound grows all the way
    outwards = (side * slope.mid * np.sign(there.mid) > slope.rad * SAFE) & (np.abs(there.mid) > there.rad * SAFE)
    beside = curve.at(_hull(parameter_in(curve.box, inner), parameter_in(curve.box, outer)))[rigid].size * SAFE < reach
    return bool(np.all(outwards | beside))


def _is_beyond(curve: SolutionCurve, end: SolutionCurve, side: int) -> bool:
    """True if the rigid displacement is beyond a bound at an end, and even more so in all that a box has behind."""
    rigid = curve.problem.rigid
    there, slope = end.at(0.0)[rigid], curve.slope[rigid]
    far = np.abs(there.mid) - there.rad * SAFE > curve.problem.reach * SAFE
    return bool(np.any(far & (side * slope.mid * np.sign(there.mid) > slope.rad * SAFE)))


def _hull(low: Ball, high: Ball) -> Ball:
    """A ball of all numbers between two others, which is a little wider."""
    middle = 0.5 * (low.mid + high.mid)
    rad = 0.5 * np.abs(high.mid - low.mid) + low.rad + high.rad + 4 * UNIT * (np.abs(low.mid) + np.abs(high.mid))
    return Ball(middle, rad * SAFE)


def goes_on(before: CurveLink, after: CurveLink, joint: SolutionCurve) -> bool:
    """True if two links with a point in common run through it in the same direction.

    Where all statuses hold strictly the curve is smooth, and the slope of the point is its direction.
    """
    if None in joint.statuses:
        return False
    signs = []
    for link in (before, after):
        along = (Ball.exact(link.curve.box.border[None]) @ joint.slope[:, None])[0, 0]
        signs.append(int(along.mid > along.rad * SAFE) - int(along.mid < -along.rad * SAFE))
    return signs[0] * signs[1] > 0


@dataclass(frozen=True, eq=False)
class CurveChain:
    """One curve over an interval.

    Attributes
    ----------
    links : sequence of CurveLink
    joints : sequence of SolutionCurve
        One more than links: its points between them, and both ends.
    closed : bool
        Whether the last point is the first one.
    ends : pair of (Fraction, Fraction) or None
        Of a first and a last point that are not beyond the interval, or beyond the bounds of the rigid displacement:
        bounds of alpha there, and of all that boxes hold beyond them.
    """

    links: Sequence[CurveLink]
    joints: Sequence[SolutionCurve]
    closed: bool
    ends: tuple[Range | None, Range | None]

    @classmethod
    def of(cls, links: Sequence[CurveLink], joints: Sequence[SolutionCurve], interval: Range) -> CurveChain | None:
        """Chain of links and joints; None where they do not run on from each other, or do so more than once round."""
        if not links or not all(map(goes_on, links[:-1], links[1:], joints[1:-1])):
            return None
        if any(link.leaves > 0 for link in links[:-1]) or any(link.leaves < 0 for link in links[1:]):
            return None
        closed = _same(joints[0].box, joints[-1].box)
        if closed and any(link.leaves for link in links):
            return None
        if closed and not goes_on(links[-1], links[0], joints[0]):
            return None
        # a curve that came back to where it was would have an end on a link that is not the one at that end
        others = [(joints[0], links[1:-1])] if closed else [(joints[0], links[1:]), (joints[-1], links[:-1])]
        if not all(_not_on(link, end.at(0.0)) for end, rest in others for link in rest):
            return None
        return cls(links, joints, closed, (None, None) if closed else _open_ends(links, joints, interval))

    @property
    def whole(self) -> bool:
        """True if it is closed, or leaves the interval, or the bounds of the rigid displacement, at both ends."""
        return not self.gaps

    @property
    def gaps(self) -> list[Range]:
        """Alphas at which it may go on where nothing is known of it."""
        return [end for end in self.ends if end is not None]

    def runs_through(self, low: Fraction, high: Fraction) -> bool:
        """True if solutions over [low, high] that are connected with a point in one of its boxes are all on it."""
        return all(end < low or begin > high for begin, end in self.gaps)


def chain_of(
    problem: AlphaProblem, boxes: Sequence[CurveBox], points: Sequence[CurveBox], interval: Range
) -> CurveChain | None:
    """The curve through boxes; None where it is not proven to be one.

    Parameters
    ----------
    problem : AlphaProblem
    boxes : of n curves, one after the other
    points : n + 1 boxes without length around the solutions that two of them share, and the ends; the last one is the
        first one again where the curve is closed
    interval : first and last alpha
    """
    if not boxes or len(points) != len(boxes) + 1 or any(point.half != 0 for point in points):
        return None
    joints = [only_curve(problem, point) for point in points]
    curves = [only_curve(problem, box) for box in boxes]
    known = [joint for joint in joints if joint is not None]
    links = []
    if len(known) < len(joints):
        return None
    for curve, start, end in zip(curves, known[:-1], known[1:], strict=True):
        link = None if curve is None else link_between(curve, start, end)
        if link is None:
            return None
        links.append(link)
    return CurveChain.of(links, known, interval)


def _open_ends(
    links: Sequence[CurveLink], joints: Sequence[SolutionCurve], interval: Range
) -> tuple[Range | None, Range | None]:
    """See ``CurveChain.ends``."""
    low, high = interval
    ranges = [_beyond(links, joints[0], -1), _beyond(links, joints[-1], 1)]
    inside = [None if there is None or there[1] < low or there[0] > high else there for there in ranges]
    return inside[0], inside[1]


def _beyond(links: Sequence[CurveLink], end: SolutionCurve, side: int) -> Range | None:
    """Bounds of alpha at an end, and of all that any box which holds this end has beyond it.

    The boxes before the last one may be longer than that. None if all of it is beyond the bounds of the rigid
    displacement.
    """
    x = end.at(0.0)
    curves = [link.curve for link in links if not _outside(link.curve, x)]
    if all(_is_beyond(curve, end, side) for curve in curves):
        return None
    ranges = [_beyond_in(curve, end, side) for curve in curves]
    return min(low for low, _ in ranges), max(high for _, high in ranges)


def _beyond_in(curve: SolutionCurve, end: SolutionCurve, side: int) -> Range:
    """Bounds of alpha at an end, and of all that one box holds beyond it."""
    half, t = curve.box.half, parameter_in(curve.box, end.at(0.0))
    near = max(float(side * t.mid - t.rad * SAFE), -half)
    reach = (0.5 * max(half - near, 0.0) + 2 * UNIT * (abs(near) + half)) * SAFE
    alpha = curve.at(Ball(np.array(0.5 * side * (near + half)), np.array(reach)))[-1]
    low, high = (Fraction(float(alpha.mid)) + sign * Fraction(float(alpha.rad)) for sign in (-1, 1))
    rises, (least, most) = curve.rises * side, end.alphas
    return (max(low, least) if rises > 0 else low), (min(high, most) if rises < 0 else high)


def apart(one: CurveChain, other: CurveChain) -> bool:
    """True if two curves have no point in common.

    From a point in common they run on together until one of them ends, or, if both are closed, all the way round. So
    the ends of neither lie in a box of the other one, of a closed curve any of its points.
    """
    return _ends_outside(one, other) and _ends_outside(other, one)


def _ends_outside(one: CurveChain, other: CurveChain) -> bool:
    ends = one.joints[:1] if one.closed else (one.joints[0], one.joints[-1])
    return all(_outside(link.curve, end.at(0.0)) for end in ends for link in other.links)


def _not_on(link: CurveLink, x: Ball) -> bool:
    """True if a link has no point in a ball between its two joints."""
    t = parameter_in(link.curve.box, x)
    before, after = t - link.start, t - link.end
    return bool(before.mid < -before.rad * SAFE or after.mid > after.rad * SAFE) or _outside(link.curve, x)


def _outside(curve: SolutionCurve, x: Ball) -> bool:
    """True if a curve has no point in a ball: it may bend beyond its box where a node changes its status."""
    t = parameter_in(curve.box, x)
    if abs(t.mid) - t.rad * SAFE > curve.box.half:
        return True
    beside = (x - Ball.exact(curve.box.centre)) - t * Ball.exact(curve.box.direction)
    return bool(np.any(np.abs(beside.mid) - beside.rad * SAFE > curve.spread))


def _same(one: CurveBox, other: CurveBox) -> bool:
    """True if two boxes are given by the same numbers, so that they hold the same solution."""
    parts = ("centre", "direction", "border", "radius", "rho")
    return all(np.array_equal(getattr(one, part), getattr(other, part)) for part in parts)
