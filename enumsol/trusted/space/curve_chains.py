"""The trusted test that boxes which share points hold one curve from end to end (theory, section 12.9)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from enumsol.arithmetic.balls import SAFE, Ball
from enumsol.trusted.space.solution_curve import (
    AlphaProblem,
    CurveBox,
    SolutionCurve,
    lies_in,
    only_curve,
    parameter_in,
)


@dataclass(frozen=True, eq=False)
class CurveLink:
    """A curve in a box and the part of it between two of its points.

    Attributes
    ----------
    curve : SolutionCurve
    start, end : Balls
        t at both points; those of ``end`` are larger.
    """

    curve: SolutionCurve
    start: Ball
    end: Ball


def link_between(curve: SolutionCurve, start: SolutionCurve, end: SolutionCurve) -> CurveLink | None:
    """The part of a curve between two of its points, if both lie in its box and in this order."""
    ends = start.at(0.0), end.at(0.0)
    if not all(lies_in(curve.box, x) for x in ends):
        return None
    low, high = (parameter_in(curve.box, x) for x in ends)
    between = high - low
    return CurveLink(curve, low, high) if between.mid > between.rad * SAFE else None


def goes_on(before: CurveLink, after: CurveLink, joint: SolutionCurve) -> bool:
    """Whether two links with a point in common run through it in the same direction.

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
    """One whole curve over an interval.

    Attributes
    ----------
    links : sequence of CurveLink
    joints : sequence of SolutionCurve
        One more than links: its points between them, and both ends.
    closed : bool
        Whether the last point is the first one.
    """

    links: Sequence[CurveLink]
    joints: Sequence[SolutionCurve]
    closed: bool


def whole_chain(
    problem: AlphaProblem, boxes: Sequence[CurveBox], points: Sequence[CurveBox], interval: tuple[Fraction, Fraction]
) -> CurveChain | None:
    """The curve through boxes, if it leaves the interval at both ends or is closed; None where that is not proven.

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
    if not all(map(goes_on, links[:-1], links[1:], known[1:-1])):
        return None
    if _same(points[0], points[-1]):
        return CurveChain(links, known, True) if goes_on(links[-1], links[0], known[0]) else None
    return CurveChain(links, known, False) if leaves_interval(links, known, interval) else None


def leaves_interval(
    links: Sequence[CurveLink], joints: Sequence[SolutionCurve], interval: tuple[Fraction, Fraction]
) -> bool:
    """Whether both ends of a curve are beyond an interval, and all that its first and last box hold beyond them."""
    return _leaves(links[0], joints[0], -1, interval) and _leaves(links[-1], joints[-1], 1, interval)


def apart(one: CurveChain, other: CurveChain) -> bool:
    """Whether two whole curves have no point in common.

    From a point in common they run on together until one of them ends, or, if both are closed, all the way round. So
    the ends of neither lie in a box of the other one, of a closed curve any of its points.
    """
    return _ends_outside(one, other) and _ends_outside(other, one)


def _ends_outside(one: CurveChain, other: CurveChain) -> bool:
    ends = one.joints[:1] if one.closed else (one.joints[0], one.joints[-1])
    return all(_outside(link.curve, end.at(0.0)) for end in ends for link in other.links)


def _outside(curve: SolutionCurve, x: Ball) -> bool:
    """Whether a curve has no point in a ball: it may bend beyond its box where a node changes its status."""
    t = parameter_in(curve.box, x)
    if abs(t.mid) - t.rad * SAFE > curve.box.half:
        return True
    beside = (x - Ball.exact(curve.box.centre)) - t * Ball.exact(curve.box.direction)
    return bool(np.any(np.abs(beside.mid) - beside.rad * SAFE > curve.spread))


def _same(one: CurveBox, other: CurveBox) -> bool:
    """Whether two boxes are given by the same numbers, so that they hold the same solution."""
    parts = ("centre", "direction", "border", "radius", "rho")
    return all(np.array_equal(getattr(one, part), getattr(other, part)) for part in parts)


def _leaves(link: CurveLink, end: SolutionCurve, side: int, interval: tuple[Fraction, Fraction]) -> bool:
    """Whether an end is beyond the interval, and the rest of its box is, too: alpha increases or decreases in it."""
    alpha, rises = end.at(0.0)[-1], link.curve.rises * side
    low, high = (float(np.nextafter(x, y)) for x, y in ((float(interval[0]), -np.inf), (float(interval[1]), np.inf)))
    if rises > 0:
        return bool(alpha.mid - alpha.rad * SAFE >= high)
    return bool(rises < 0 and alpha.mid + alpha.rad * SAFE <= low)
