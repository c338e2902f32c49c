"""Curves of solutions in 3D over alpha as chains of boxes, each proven to hold one curve (theory, section 12.8).

Where to put the boxes is told by paths of continuation, in floats; what a chain says does not depend on them.
"""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import brentq

from enumsol.continuation.path import follow
from enumsol.continuation.path_data import ContinuationOptions, PathStatus
from enumsol.errors import EnumsolError, Interrupted, OutOfMemoryError
from enumsol.search.space.curve_proposals import curve_along, curve_point, placed, proven_point, stretch
from enumsol.support.deadlines import TimeOverError, look, tell
from enumsol.trusted.space.curve_runs import CurveChain, CurveLink, goes_on, link_between
from enumsol.trusted.space.solution_curve import only_curve

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from fractions import Fraction

    from numpy.typing import NDArray

    from enumsol.continuation.path import Path
    from enumsol.model.problem3d import ContactProblem3D
    from enumsol.search.space.curve_proposals import CurvePoint
    from enumsol.trusted.space.solution_curve import AlphaProblem, SolutionCurve

    Array = NDArray[np.float64]

#: The shortest way between two joints, relative to the length of a path's step: where boxes need to be shorter the
#: curve is left open.
_SHORTEST = 1e-7
#: Which share of what seems possible is taken at first as the way between two joints, and how the way shrinks at least:
#: with more of the first boxes fail more often, with less they are many.
_TRUST, _SHRINK = 0.95, 0.5
#: How far a skeleton is prolonged beyond the interval, relative to its last step: more only takes time.
_BEYOND = 0.05


@dataclass(frozen=True, eq=False)
class Skeleton:
    """Points along a curve of solutions, in floats.

    Attributes
    ----------
    points : (N, m + 1) array
        Forces and alpha; of a body that nothing holds its rigid displacement is between both.
    corners : sequence of int
        Points at which a status changes.
    closed : bool
    start : int
        The point from which it was followed.
    """

    points: Array
    corners: Sequence[int]
    closed: bool
    start: int = 0

    def half(self, way: int) -> Skeleton:
        """From the start to the last point, or back to the first one."""
        kept = range(len(self.points))[None if self.closed else self.start :: way]
        corners = sorted(kept.index(corner) for corner in self.corners if corner in kept)
        return Skeleton(self.points[list(kept)], corners, closed=False)


@dataclass(frozen=True, eq=False)
class _Corner:
    """Places of a skeleton before and after a corner, the joints there and the link between them, if proven."""

    low: float
    high: float
    start: SolutionCurve | None
    link: CurveLink | None
    end: SolutionCurve | None


def chain_through(
    given: AlphaProblem,
    problem: ContactProblem3D,
    x: Array,
    interval: tuple[Fraction, Fraction],
    begun: Callable[[CurveChain], object] | None = None,
) -> CurveChain | None:
    """The curve through a regular root x, (m + 1,), until it leaves the interval on both sides or is closed.

    As much of it as is proven, with x if possible; None where that is nothing. ``begun`` is called with what there is
    of it when the time is over or somebody interrupts.
    """
    skeleton = skeleton_through(problem, x, (float(interval[0]), float(interval[1])))
    if skeleton is None:
        return None
    builder = ChainBuilder(given, interval)
    try:
        return builder.chain(skeleton)
    except (TimeOverError, KeyboardInterrupt, MemoryError):
        if begun is not None and (part := builder.begun) is not None:
            begun(part)
        raise


def skeleton_through(problem: ContactProblem3D, x: Array, span: tuple[float, float]) -> Skeleton | None:
    """Skeleton that continuation finds, a little longer than the interval; None if it does not start."""
    p = problem.p
    start = float(x[-1]), x[:p], x[p : 3 * p].reshape(2, p).T, *([] if problem.held else [x[3 * p : -1]])
    try:
        ahead = _path(problem, start, 1, span)
        closed = ahead.status == PathStatus.CLOSED
        paths = [ahead] if closed else [_path(problem, start, -1, span), ahead]
    except (Interrupted, OutOfMemoryError):
        raise
    except EnumsolError:
        return None
    lines = [_line(path) for path in paths]
    corners = [sorted(item.point for item in path.transitions if item.nodes) for path in paths]
    if closed:
        return Skeleton(lines[0], corners[0], closed=True)
    for k, (line, path) in enumerate(zip(lines, paths, strict=True)):
        if path.status in (PathStatus.INTERVAL_LEFT, PathStatus.RIGID_BOUND):
            # relative to the last step
            beyond = _BEYOND if path.status == PathStatus.INTERVAL_LEFT else 2.0**-10
            lines[k] = np.vstack([line, line[-1] + beyond * (line[-1] - line[-2])])
    back, last = lines[0][::-1], len(lines[0]) - 1
    places = {last - k for k in corners[0]} | {last + k for k in corners[1]}
    points = np.vstack([back, lines[1][1:]])
    # from a fold continuation may start in neither direction
    return Skeleton(points, sorted(places), closed=False, start=last) if len(points) > 1 else None


def _line(path: Path) -> Array:
    """The points of a path, as those of a skeleton."""
    rigid = np.zeros((len(path.alpha), 0)) if path.rigid_coordinates is None else path.rigid_coordinates
    return np.column_stack([path.lambda_n, path.lambda_t[:, :, 0], path.lambda_t[:, :, 1], rigid, path.alpha])


def _path(problem: ContactProblem3D, start: tuple[Any, ...], way: int, span: tuple[float, float]) -> Path:
    """A path that may take shorter steps where it stalls: near a fold of a short interval it has to."""
    path = follow(problem, start, way, span)
    if path.status == PathStatus.STALLED:
        # the shortest step of continuation where it stalls with that of its own
        path = follow(problem, start, way, span, ContinuationOptions(h_min=1e-8))
    return path


class ChainBuilder:
    """Puts boxes along skeletons.

    Parameters
    ----------
    problem : AlphaProblem
    interval : first and last alpha
    """

    def __init__(self, problem: AlphaProblem, interval: tuple[Fraction, Fraction]) -> None:
        self.problem, self._interval = problem, interval
        self.unit = np.append(problem.force, 1.0)
        self._ends: dict[int, tuple[Array, ...]] = {}
        self._links: list[CurveLink] = []
        self._joints: list[SolutionCurve] = []

    @property
    def begun(self) -> CurveChain | None:
        """Part of the chain in the making that is proven so far, without links at its ends that run into others."""
        count = min(len(self._links), len(self._joints) - 1)
        # so many links less one, at most, are left out at an end of a curve that run into others of it
        for off in range(min(4, count)):
            for first, last in dict.fromkeys(((0, count - off), (off, count), (off, count - off))):
                links, joints = self._links[first:last], self._joints[first : last + 1]
                chain = CurveChain.of(links, joints, self._interval)
                if chain is not None:
                    return chain
        return None

    def chain(self, skeleton: Skeleton) -> CurveChain | None:
        """A chain along a skeleton, as far as it is proven; if that is not to its start, from there both ways."""
        skeleton = replace(skeleton, points=placed(self.problem, skeleton.points))
        self._links, self._joints = [], []
        if not self._put(skeleton):
            self._links, self._joints = [], []
            self._put(skeleton.half(-1))
            self._turn_back()
            self._put(skeleton.half(1))
        return self.begun

    def _put(self, skeleton: Skeleton) -> bool:
        """Put further links along a skeleton as far as they are proven; whether that is beyond its start."""
        skeleton = self._thinned(skeleton)
        line, links, joints = skeleton.points, self._links, self._joints
        self._ends = {}
        first = joints[-1] if joints else self.joint(*self._at(line, 0.0))
        if first is None:
            return False
        joints[len(links) :] = [first]
        place, last = 0.0, len(line) - 1.0
        for corner in self._around(skeleton):
            place = self._filled(line, place, corner.low, links, joints, corner.start, closed=skeleton.closed)
            if place < corner.low or corner.link is None or corner.end is None:
                break
            # two corners may be so near to each other that the places around them overlap
            link = (
                corner.link if joints[-1] is corner.start else link_between(corner.link.curve, joints[-1], corner.end)
            )
            if link is None or (links and not goes_on(links[-1], link, joints[-1])):
                break
            links.append(link)
            joints.append(corner.end)
            place = corner.high
        else:
            known = first if skeleton.closed else None
            place = self._filled(line, place, last, links, joints, known, closed=skeleton.closed)
        return place == last or (not skeleton.closed and place > skeleton.start)

    def _turn_back(self) -> None:
        """Have the links that there are run the other way, as far as that is proven of those next to the last joint."""
        links: list[CurveLink] = []
        joints: list[SolutionCurve] = []
        curves = [self._turned(link.curve) for link in self._links[::-1]]
        for k, joint in enumerate(map(self._turned, self._joints[::-1])):
            curve = curves[k - 1] if k else None
            link = link_between(curve, joints[-1], joint) if curve and joint and joints else None
            if link is None:
                links, joints = [], []
            links += [] if link is None else [link]
            joints += [] if joint is None else [joint]
        self._links, self._joints = links, joints

    def _turned(self, curve: SolutionCurve) -> SolutionCurve | None:
        """Curve in the opposite direction."""
        box = curve.box
        return only_curve(self.problem, replace(box, direction=-box.direction, border=-box.border))

    def _thinned(self, skeleton: Skeleton) -> Skeleton:
        """Without points close to a corner, so that the edges on both sides of it have about the same length."""
        line, places = skeleton.points / self.unit, set(skeleton.corners)
        kept = list(range(len(line)))
        for corner in skeleton.corners:
            at = kept.index(corner)
            while 0 < at < len(kept) - 1:
                before, after = (float(np.linalg.norm(line[kept[k]] - line[corner])) for k in (at - 1, at + 1))
                k, near = (at - 1, before < 0.125 * after) if before < after else (at + 1, after < 0.125 * before)
                if not near or kept[k] in places or k in (0, len(kept) - 1):
                    break
                del kept[k]
                at = kept.index(corner)
        corners = [kept.index(corner) for corner in skeleton.corners]
        return Skeleton(skeleton.points[kept], corners, skeleton.closed, bisect_left(kept, skeleton.start))

    def _around(self, skeleton: Skeleton) -> Iterator[_Corner]:
        """Places before and after every corner and what is proven between them, one box where that is possible."""
        line, last = skeleton.points, len(skeleton.points) - 1
        for corner in skeleton.corners:
            if not 0 < corner < last:
                continue
            # the longest way from a corner to the ends of its box, which then shrinks
            share, start, proven = 0.4, None, None
            steps: dict[tuple[int, ...], tuple[Array, float]] = {}
            while share > _SHORTEST:
                look()
                start = self.joint(*self._at(line, corner - share))
                if start is not None:
                    proven = self._link(line, corner - share, corner + share, start, None, steps=steps)
                if proven is not None:
                    break
                share *= 0.3
            yield _Corner(corner - share, corner + share, start, *(proven or (None, None)))

    def _filled(
        self,
        line: Array,
        place: float,
        last: float,
        links: list[CurveLink],
        joints: list[SolutionCurve],
        known: SolutionCurve | None,
        *,
        closed: bool,
    ) -> float:
        """Add links from one place of a skeleton to another one; how far they come.

        ``known``: the joint there, if there is one; ``closed``: the skeleton is.
        """
        way, trust, failed = 1.0, _TRUST, False
        while place < last:
            look()
            tell("steps along a curve", int(place), len(line) - 1)
            # no link is left that is too short
            further = place + way if last - place - way > _SHORTEST else last
            if further != last and abs(further - round(further)) < 1e-3:
                # points of the skeleton are perhaps folds, at which no side of a joint is that of a rising alpha
                further -= 0.1 * (further - place)
            end = known if further == last else None
            found = self._link(line, place, further, joints[-1], links[-1] if links else None, end)
            # that what a box at an end holds is beyond the interval is seen where alpha goes one way
            outer = not closed and (not links or further == len(line) - 1.0)
            if found is None or (outer and not (found[0].curve.rises or found[0].leaves)):
                way = (_SHRINK if failed else 0.7) * (further - place)
                failed = True
                if way < _SHORTEST:
                    return place
                continue
            if found[0].leaves:
                parts, ends = self._up_to_bound(found[0], joints[-1], found[1])
                links += parts
                joints[-1:] = ends
                if found[0].leaves > 0:
                    return last
            else:
                links.append(found[0])
                joints.append(found[1])
            trust = 0.85 * trust if failed else min(1.05 * trust, _TRUST)
            way = (further - place) * min(max(trust * stretch(found[0].curve), _SHRINK), 8.0)
            place, failed = further, False
        return place

    def _up_to_bound(
        self, link: CurveLink, start: SolutionCurve, end: SolutionCurve
    ) -> tuple[list[CurveLink], list[SolutionCurve]]:
        """A link that leaves the bounds of the rigid displacement in two, the outer one short, and their joints."""
        box, (rigid, reach) = link.curve.box, (self.problem.rigid, self.problem.reach)
        inner, outer = (float(t.mid) for t in (link.start, link.end)[:: link.leaves])

        def near(t: float) -> CurvePoint | None:
            return curve_point(self.problem, box.centre + t * box.direction, box.border)

        def beyond(t: float) -> float:
            point = near(t)
            return np.nan if point is None else float(np.max(np.abs(point.x[rigid]) / reach)) - 1.0

        # how near to the bound the joints beside it are put at best, then farther away
        for k in range(6):
            away = 2.0**-36 * 16.0**k * (outer - inner)
            try:
                middle = float(brentq(beyond, inner, outer, xtol=0.1 * abs(away)))
            except ValueError:
                break
            points = [near(t) for t in (middle - away, middle + away)]
            sides = [proven_point(self.problem, point, box.border) for point in points]
            joints = [side for side in sides if side is not None][:: link.leaves]
            if len(joints) < len(sides):
                continue
            joints = [start, *joints] if link.leaves > 0 else [*joints, end]
            links = [link_between(link.curve, *pair) for pair in pairwise(joints)]
            kept = [part for part in links if part is not None]
            if len(kept) == len(links) and sum(abs(part.leaves) for part in kept) == 1:
                return kept, joints
        return [link], [start, end]

    def joint(self, x: Array, direction: Array) -> SolutionCurve | None:
        """The solution near a point, in a box without length across a direction."""
        border = self.across(direction)
        return proven_point(self.problem, curve_point(self.problem, x, border), border)

    def across(self, direction: Array) -> Array:
        """The border in which a direction has the product one, orthogonal to it in units of the nodes."""
        scaled = direction / self.unit
        return np.asarray(scaled / (scaled @ scaled) / self.unit)

    def _at(self, line: Array, place: float) -> tuple[Array, Array]:
        """A point near the curve between two points of a skeleton, and a direction there.

        On the cubic with the curve's directions at both: where it bends, the chord may lead to another solution.
        """
        k = min(int(place), len(line) - 2)
        edge, t = line[k + 1] - line[k], place - k
        if k not in self._ends:
            border = self.across(edge)
            # not at a corner itself
            inside = 2.0**-10, 1.0 - 2.0**-10
            near = [curve_point(self.problem, line[k] + share * edge, border) for share in inside]
            self._ends[k] = tuple(edge if one is None else one.direction for one in near)
        # beside the chord; both directions have the product 1 with the border, as the edge has
        begin, end = (direction - edge for direction in self._ends[k])
        point = line[k] + t * edge + t * (1.0 - t) * ((1.0 - t) * begin - t * end)
        return point, edge + (1.0 - t) * (1.0 - 3.0 * t) * begin + t * (3.0 * t - 2.0) * end

    def _link(
        self,
        line: Array,
        place: float,
        further: float,
        joint: SolutionCurve,
        former: CurveLink | None,
        end: SolutionCurve | None = None,
        steps: dict[tuple[int, ...], tuple[Array, float]] | None = None,
    ) -> tuple[CurveLink, SolutionCurve] | None:
        """A box from a joint to the one at another place of the skeleton, and that joint.

        ``steps``: those of the natural map at a corner, by the nodes that change, put in when they are known.
        """
        x, ahead = self._at(line, further)
        border = self.across(ahead)
        near = curve_point(self.problem, x, border) if end is None else None
        if near is not None:
            x, ahead, after = near.x, near.direction, near.statuses
        elif end is not None:
            x, ahead, after = end.at(0.0).mid, end.box.direction, end.statuses
        else:
            return None
        changing = [i for i in range(self.problem.p) if joint.statuses[i] != after[i]]
        ends, across = (joint.at(0.0).mid, x), self._between(joint.box.direction, ahead)
        curve = curve_along(self.problem, ends, across, changing, {} if steps is None else steps, roomy=True)
        if curve is None:
            return None
        following = end if near is None else proven_point(self.problem, near, border)
        link = None if following is None else link_between(curve, joint, following)
        if following is None or link is None or (former is not None and not goes_on(former, link, joint)):
            return None
        return link, following

    def _between(self, one: Array, other: Array) -> Array:
        """A border for a chord: the directions at both ends go on along it."""
        total = np.zeros_like(one)
        for direction in (one, other):
            scaled = direction / self.unit
            total += scaled / np.linalg.norm(scaled)
        return np.asarray(total / np.linalg.norm(total) / self.unit)
