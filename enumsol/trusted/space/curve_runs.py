"""The trusted tests that boxes hold one curve in 3D, and bounds of its solutions over alpha (theory, section 12.9)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball, upper_norm
from enumsol.trusted.space.natural_map import upper_product
from enumsol.trusted.space.sector_rows import OPEN, STICK, UNDECIDED
from enumsol.trusted.space.solution_curve import (
    AlphaProblem,
    CurveBox,
    SolutionCurve,
    lies_in,
    only_curve,
    parameter_in,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Flags = NDArray[np.bool_]

#: Bounds of alpha.
Range = tuple[Fraction, Fraction]
#: Parts of a run at least, and for every link that comes to the piece; into how many a part is cut at most; how often.
_PARTS, _OF_LINK, _CUT, _CUTS = 64, 4, 64, 24


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

    # -- its solutions over a piece of alpha -----------------------------------------------------------------------

    @property
    def problem(self) -> AlphaProblem:
        """The problem whose solutions they are."""
        return self.joints[0].problem

    def places(self, run: LinkRange) -> NDArray[np.intp] | None:
        """The links of a run; None where there are no such links."""
        count, (first, last) = len(self.links), run
        if not (0 <= first < count and 0 <= last < count) or (last < first and not self.closed):
            return None
        return np.arange(first, last + 1 + (count if last < first else 0)) % count

    def passes(self, run: LinkRange, low: Fraction, high: Fraction) -> bool:
        """True if a run passes every alpha of a piece: its ends lie on either side of it, or at its ends."""
        if self.places(run) is None:
            return False
        start, end = self.joints[run.first].alphas, self.joints[run.last + 1].alphas
        return (start[1] <= low and high <= end[0]) or (end[1] <= low and high <= start[0])

    @cached_property
    def _links(self) -> _Links:
        found = []
        with np.errstate(all="ignore"):
            for link in self.links:
                curve, near, radius = link.curve, link.curve.found.near, link.curve.found.spread[0]
                begin, end = (float(link.start.mid - link.start.rad * SAFE), float(link.end.mid + link.end.rad * SAFE))
                t = 0.5 * (begin + end), 0.5 * (end - begin) * SAFE + 4 * UNIT * (abs(begin) + abs(end))
                m, wide = self.problem.m, upper_product(near.moves.size, radius) * SAFE
                z, along, rho = near.z[:m], near.zd[:m], self.problem.rho * curve.box.rho
                numbers = z.mid, z.rad, along.mid, along.rad, wide[:m], rho
                found.append((*t, curve.box.centre[m], near.d[m], radius[m], *numbers))
        t_mid, t_rad, alpha, rate, reach, *rest = map(np.array, zip(*found, strict=True))
        z_mid, z_rad, slope, slope_rad, wides, steps = rest
        return _Links(Ball(t_mid, t_rad), alpha, rate, reach, Ball(z_mid, z_rad), Ball(slope, slope_rad), wides, steps)

    @cached_property
    def joint_alphas(self) -> tuple[Array, Array]:
        """Bounds of alpha at the points between two links, and at both ends."""
        bounds = [joint.alphas for joint in self.joints]
        low, high = (np.array([float(pair[k]) for pair in bounds]) for k in (0, 1))
        return np.nextafter(low, -np.inf), np.nextafter(high, np.inf)

    def over(self, run: LinkRange, low: Fraction, high: Fraction) -> CurveParts:
        """The part of a run with alphas in a piece, in parts in its order; none where it does not come there."""
        links, places = self._links, self.places(run)
        assert places is not None
        where, t, wanted = places, links.t[places], _PARTS
        least, most = (float(np.nextafter(float(x), y)) for x, y in ((low, -np.inf), (high, np.inf)))
        for k in range(_CUTS):
            alpha = self._alphas(where, t)
            # what overflows is not known to be beyond the piece, and stays
            beyond = (alpha.mid + alpha.rad * SAFE < least) | (alpha.mid - alpha.rad * SAFE > most)
            where, t, alpha = where[~beyond], t[~beyond], alpha[~beyond]
            wanted = wanted if k else max(_PARTS, _OF_LINK * len(where))
            if len(where) >= wanted or not len(where):
                break
            # a power of two
            count = min(1 << (-(-wanted // len(where)) - 1).bit_length(), _CUT)
            shares = (2.0 * np.arange(count) + 1.0) / count - 1.0
            mid = (t.mid[:, None] + shares * t.rad[:, None]).ravel()
            # of the sum and of the product
            rad = np.repeat(t.rad / count * SAFE + 2 * UNIT * (np.abs(t.mid) + t.rad), count)
            t, where = Ball(mid, rad), np.repeat(where, count)
        order = np.lexsort((t.mid, np.argsort(places)[np.searchsorted(np.sort(places), where)]))
        where, t = where[order], t[order]
        alpha = self._alphas(where, t)
        # the solutions that are spoken of have their alphas in the piece
        begin, end = np.maximum(alpha.mid - alpha.rad * SAFE, least), np.minimum(alpha.mid + alpha.rad * SAFE, most)
        rounded = 2 * UNIT * (np.abs(begin) + np.abs(end))
        alpha = Ball(0.5 * (begin + end), (0.5 * np.maximum(end - begin, 0.0) + rounded) * SAFE + TINY)
        z = links.z[where] + t[:, None] * links.slope[where]
        F = Ball.exact(self.problem.F0) + alpha[:, None] * Ball.exact(self.problem.F1)
        z = Ball(z.mid, (z.rad + links.wide[where]) * SAFE)
        return CurveParts(alpha, F, z, links.rho[where], self._rubs, where, t)

    @cached_property
    def _rubs(self) -> Flags:
        p = self.problem.p
        return np.array([[(1 + k) * p + i in t for k in (0, 1)] for i, t in enumerate(self.problem.tau)])

    def _alphas(self, where: NDArray[np.intp], t: Ball) -> Ball:
        links = self._links
        alpha = Ball.exact(links.alpha[where]) + t * Ball.exact(links.rate[where])
        return Ball(alpha.mid, (alpha.rad + links.reach[where]) * SAFE)


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


class LinkRange(NamedTuple):
    """Links of a curve, one after the other, by the numbers of the first and the last one.

    Along a closed curve the last one may come first: the links between go through the curve's first point.
    """

    first: int
    last: int


@dataclass(frozen=True, eq=False)
class CurveParts:
    """Short parts of a curve, N of them, that hold a solution for every alpha of a piece.

    Attributes
    ----------
    alpha : Ball of shape (N,)
        Within the piece.
    F : Ball of shape (N, p)
        Friction at these alphas.
    z : Ball of shape (N, m)
        Arguments of P at all solutions of a part: y / q + rho q w (see AlphaProblem).
    rho : (N, m) array
    rubs : (p, 2) bool array
        Axes along which there is friction.
    links : (N,) array of ints
    t : Ball of shape (N,)
        Parameters of the links there.
    """

    alpha: Ball
    F: Ball
    z: Ball
    rho: Array
    rubs: Flags
    links: NDArray[np.intp]
    t: Ball

    @cached_property
    def open(self) -> Flags:
        """Mask of nodes open all along a part, (N, p): z_n <= 0, so that no force acts."""
        p = len(self.rubs)
        return self.z.mid[:, :p] + self.z.rad[:, :p] * SAFE <= 0

    @cached_property
    def touching(self) -> Flags:
        """Mask of nodes that touch all along a part, (N, p): z_n >= 0, so that w_n = 0."""
        p = len(self.rubs)
        return self.z.mid[:, :p] - self.z.rad[:, :p] * SAFE >= 0

    @cached_property
    def sticking(self) -> Flags:
        """Mask of nodes that stick all along a part, (N, p): |z_t| <= F z_n, so that w = 0."""
        p = len(self.rubs)
        most = upper_norm(self.tangents.size, axis=2)
        normal = (self.z.mid[:, :p] - self.z.rad[:, :p] * SAFE) / SAFE
        least = (self.F.mid - self.F.rad * SAFE) / SAFE
        return np.asarray(self.touching & (least >= 0) & (most * SAFE <= least * normal / SAFE - TINY))

    @cached_property
    def tangents(self) -> Ball:
        """z_t of every node, (N, p, 2), 0 where there is no friction along an axis."""
        return self._tangents(self.z)

    def _tangents(self, x: Ball) -> Ball:
        p = len(self.rubs)
        both = (np.stack([part[:, p : 2 * p], part[:, 2 * p : 3 * p]], axis=2) for part in (x.mid, x.rad))
        return Ball(*(np.where(self.rubs, part, 0.0) for part in both))

    @cached_property
    def slips(self) -> tuple[Ball, Ball]:
        """w_n and q w_t where a node is open, (N, p) and (N, p, 2), in the same unit: there z is rho w.

        Without bounds where rho, a product of two numbers of a proof, may have over- or underflowed.
        """
        p, inverse = len(self.rubs), 1.0 / self.rho
        known = (self.rho > TINY) & (self.rho < 1.0 / TINY)
        w = self.z * Ball(inverse, np.where(known, 4 * UNIT * inverse, np.inf))
        return w[:, :p], self._tangents(w)

    @cached_property
    def thetas(self) -> tuple[Array, Array]:
        """A theta that serves every solution of a part, (N, p, 2), and how far others of them are from it, (N, p).

        theta = z_t / max(|z_t|, F z_n) with z_n at least 0. Within a ball its derivatives by z_t and by F z_n are at
        most 1 over the least of this maximum; where that may vanish the distance is infinite.
        """
        p = len(self.rubs)
        normal, tangent = np.maximum(self.z.mid[:, :p], 0.0), self.tangents
        disc, length = np.abs(self.F.mid) * normal, np.linalg.norm(tangent.mid, axis=2)
        away = upper_norm(tangent.rad, axis=2)
        change = (self.F.size * self.z.rad[:, :p] + self.F.rad * normal) * SAFE + 4 * UNIT * disc + TINY
        divisor = np.maximum(length, disc)
        least = np.maximum(length * (1.0 - 8 * UNIT) - away * SAFE, disc * (1.0 - 8 * UNIT) - change * SAFE) / SAFE
        known = least > 0
        far = (away + change) / np.where(known, least, 1.0) * SAFE * SAFE + 32 * UNIT
        theta = tangent.mid / np.where(divisor > 0, divisor, 1.0)[:, :, None]
        return theta, np.where(known, far, np.inf)

    def held(self, codes: Sequence[int]) -> Flags:
        """Mask of parts in which all solutions have the statuses of an assignment, (N,); a sector counts as contact."""
        held = np.ones(len(self.alpha.mid), dtype=bool)
        for i, code in enumerate(codes):
            if code != UNDECIDED:
                known = self.open if code == OPEN else self.sticking if code == STICK else self.touching
                held &= known[:, i]
        return held

    def allowed(self, codes: Sequence[int]) -> bool:
        """True if they have them in all parts."""
        return bool(np.all(self.held(codes)))


class _Links(NamedTuple):
    """Numbers of all links of a curve: its solutions are at x = c + t d + b, |b| <= radius, t between two points.

    z, slope and wide are those of the arguments of P, (links, m); alpha, rate and reach of alpha, (links,).
    """

    t: Ball
    alpha: Array
    rate: Array
    reach: Array
    z: Ball
    slope: Ball
    wide: Array
    rho: Array
