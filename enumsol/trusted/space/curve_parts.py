"""The trusted tests of what a curve in 3D does over alpha, in a box and between two points (theory, section 12.10).

A run is a part on which all statuses hold and alpha goes one way. A turn is a part in which one condition changes its
sign, or several do so close together that their order is not known, or alpha turns back once. A turn of which none of
this is proven is left open.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from itertools import pairwise, permutations, product

import numpy as np

from enumsol.arithmetic.balls import SAFE, UNIT, Ball, solution
from enumsol.support.array_types import Codes, Floats
from enumsol.trusted.space.curve_runs import CurveLink, Range
from enumsol.trusted.space.natural_map import Slips
from enumsol.trusted.space.sector_rows import FRICTIONLESS, OPEN, STICK
from enumsol.trusted.space.solution_curve import (
    SLIP,
    CurveBox,
    SolutionCurve,
    lies_in,
    map_around,
    only_curve,
    parameter_in,
)

#: Pairs of statuses between which one condition decides: the sign of |z_t| - F z_n, or of z_n.
_BY_FRICTION = frozenset({STICK, SLIP})
_BY_CONTACT = (frozenset({OPEN, SLIP}), frozenset({OPEN, FRICTIONLESS}))


class CurveMotion:
    """How the solutions of a curve in a box move with its parameter.

    Derivatives with respect to t are bounded for all points of the curve that have given statuses; at its kinks they
    are those of one side.

    Parameters
    ----------
    curve : SolutionCurve
    border : (m + 1,) array, optional
        The row e of the parameter; that of the curve's box by default, and of another box that holds a point if the
        curve is a point.
    """

    def __init__(self, curve: SolutionCurve, border: Floats | None = None) -> None:
        problem = self.problem = curve.problem
        unit, box = problem.unit, curve.box
        self._border = (box.border if border is None else border) * unit
        near = map_around(problem, replace(box, rho=np.ones(problem.m)))
        extent, self._Z = near.extent(curve.spread / unit), near.moves
        #: (z, alpha) at all points of the curve.
        self.z = extent.near
        discs = problem.discs(self.z[-1])
        with np.errstate(all="ignore"):
            slips = Slips(discs, extent)
        self._F, self._at, self._lengths = discs.F, slips.at, problem.lengths(self.z)
        #: The statuses that every node may have at points of the curve.
        self.possible = problem.possible(self.z, slips.gap)
        self._speeds: dict[tuple[int, ...], Ball | None] = {}

    # -- first derivatives -----------------------------------------------------------------------------------------

    def speed(self, codes: Sequence[int]) -> Ball | None:
        """dx/dt where the nodes have these statuses, scaled, (m + 1,); the last one is that of alpha.

        None where there is no bound.
        """
        key = tuple(codes)
        if key not in self._speeds:
            B, m = self._bordered(key), self.problem.m
            right = np.zeros((m + 1, 1))
            right[m] = 1.0
            found = None if B is None else solution(B, Ball.exact(right))
            self._speeds[key] = None if found is None else found[:, 0]
        return self._speeds[key]

    def rises(self, codes: Sequence[int]) -> int:
        """The sign of the derivative of alpha where the nodes have these statuses; 0 where it is not known."""
        speed = self.speed(codes)
        return 0 if speed is None else _sign(speed[-1])

    def _bordered(self, codes: Sequence[int]) -> Ball | None:
        """The derivatives of the natural map and the border, (m + 1, m + 1)."""
        D = self._derivative(codes)
        return None if D is None else Ball.joined(self.problem.part - D @ self._Z, Ball.exact(self._border[None]))

    def _derivative(self, codes: Sequence[int]) -> Ball | None:
        """Derivative of the projection P with respect to (z, alpha), by (12.11)."""
        m = self.problem.m
        D = Ball(np.zeros((m, m + 1)), np.zeros((m, m + 1)))
        kept = np.arange(3 * self.problem.p, m)
        D.mid[kept, kept] = 1.0
        for i, (code, t) in enumerate(zip(codes, self.problem.tau, strict=True)):
            if code == OPEN:
                continue
            D.mid[i, i] = 1.0
            if code == STICK:
                D.mid[t, t] = 1.0
            elif code == SLIP:
                found = self._direction(i)
                if found is None:
                    return None
                e, across, inverse = found
                D[t, i] = self._F[i] * e
                D[np.ix_(t, t)] = self._F[i] * self.z[i] * inverse * across
                D[t, m] = Ball.exact(self.problem.F1[i]) * self.z[i] * e
        return D

    def _direction(self, i: int) -> tuple[Ball, Ball, Ball] | None:
        """e = z_t / |z_t|, 1 - e e' and 1 / |z_t|; None where z_t may vanish."""
        t, least, most = self.problem.tau[i], *(float(part[i]) for part in self._lengths)
        if not least > 0:
            return None
        middle, half = 0.5 * (1.0 / least + 1.0 / most), 0.5 * (1.0 / least - 1.0 / most)
        inverse = Ball(np.array(middle), np.array((half + 4 * UNIT * middle) * SAFE))
        if len(t) == 1:
            return Ball.exact(np.sign(self.z.mid[t])), Ball.exact(np.zeros((1, 1))), inverse
        at = self._at
        return Ball(at.e[i], at.turn[i]), Ball(at.across[i], at.bent[i] + 16 * UNIT), inverse

    # -- conditions ------------------------------------------------------------------------------------------------

    def decides(self, codes: Sequence[int], i: int, other: int) -> int:
        """The sign with which the condition grows that tells a node's status from another one.

        It is that of |z_t| - F z_n between stick and slip, and of z_n between open and contact. 0 where it does not
        grow, or fall, along all of the curve, for both statuses of the node, or where another condition decides.
        """
        pair = frozenset({codes[i], other})
        if pair != _BY_FRICTION and pair not in _BY_CONTACT:
            return 0
        signs = set()
        for code in pair:
            speed = self.speed((*codes[:i], code, *codes[i + 1 :]))
            signs.add(0 if speed is None else self._grows(i, speed, contact=pair != _BY_FRICTION))
        return signs.pop() if len(signs) == 1 else 0

    def _grows(self, i: int, speed: Ball, *, contact: bool) -> int:
        moved = (self._Z @ speed[:, None])[:, 0]
        if contact:
            return _sign(moved[i])
        found = self._direction(i)
        if found is None:
            return 0
        along = (found[0][None] @ moved[self.problem.tau[i], None])[0, 0]
        return _sign(along - self._F[i] * moved[i] - Ball.exact(self.problem.F1[i]) * moved[-1] * self.z[i])

    # -- second derivatives ----------------------------------------------------------------------------------------

    def bends(self, codes: Sequence[int]) -> int:
        """The sign of the second derivative of alpha where the nodes have these statuses; 0 where it is not known."""
        speed, m = self.speed(codes), self.problem.m
        B = None if speed is None else self._bordered(codes)
        if speed is None or B is None:
            return 0
        moved = (self._Z @ speed[:, None])[:, 0]
        right = Ball(np.zeros((m + 1, 1)), np.zeros((m + 1, 1)))
        for i, code in enumerate(codes):
            if code == SLIP:
                bent = self._bent(i, moved)
                if bent is None:
                    return 0
                right[self.problem.tau[i], 0] = bent
        found = solution(B, right)
        return 0 if found is None else _sign(found[m, 0])

    def _bent(self, i: int, moved: Ball) -> Ball | None:
        """The second derivative of F z_n e along a node's speed (12.26)."""
        found, t = self._direction(i), self.problem.tau[i]
        if found is None:
            return None
        e, across, inverse = found
        F, F1, z, two = self._F[i], Ball.exact(self.problem.F1[i]), self.z[i], Ball.exact(np.array(2.0))
        normal, alpha, tangential = moved[i], moved[-1], moved[t]
        beside = (across @ tangential[:, None])[:, 0] * inverse
        along = (e[None] @ tangential[:, None])[0, 0] * inverse
        size = (beside[None] @ beside[:, None])[0, 0]
        turned = two * (F * normal + F1 * alpha * z) * beside
        return two * F1 * alpha * normal * e + turned - F * z * (two * along * beside + size * e)


def _sign(ball: Ball) -> int:
    return int(np.sign(ball.mid)) if abs(ball.mid) > ball.rad * SAFE else 0


@dataclass(frozen=True, eq=False)
class Place:
    """A proven point of a curve, at which all statuses hold strictly.

    Attributes
    ----------
    point : SolutionCurve
        Without length.
    motion : CurveMotion
        With the border of the link that it lies in.
    """

    point: SolutionCurve
    motion: CurveMotion

    @property
    def codes(self) -> Codes:
        """The statuses."""
        return tuple(code for code in self.point.statuses if code is not None)

    @cached_property
    def x(self) -> Floats:
        """Forces and alpha, in the middle of their bounds."""
        return self.point.at(0.0).mid

    @property
    def alphas(self) -> Range:
        """Bounds of alpha."""
        return self.point.alphas

    @cached_property
    def rises(self) -> int:
        """The sign of d alpha / dt; 0 where it is not known."""
        return self.motion.rises(self.codes)


@dataclass(frozen=True, eq=False)
class Run:
    """A part of a curve on which alpha goes one way and the statuses stay.

    Attributes
    ----------
    codes : statuses
    rises : int
    index : int
        Of the roots on it.
    knots : sequence of (m + 1,) arrays
        Points on it, in floats, in the order of the curve.
    borders : sequence of (m + 1,) arrays
        Rows of the parameter between two of them.
    start, end : pairs of Fraction
        Bounds of alpha at its first and last point that is known.
    """

    codes: Codes
    rises: int
    index: int
    knots: tuple[Floats, ...]
    borders: tuple[Floats, ...]
    start: Range
    end: Range

    def joined(self, other: Run) -> Run:
        """With the run that goes on from it."""
        knots, borders = (*self.knots, *other.knots[1:]), (*self.borders, *other.borders)
        return replace(self, knots=knots, borders=borders, end=other.end)


@dataclass(frozen=True, eq=False)
class Turn:
    """Between two runs.

    Attributes
    ----------
    alphas : pair of Fraction
        Between them is all alpha of it.
    x : (m + 1,) array
        A point of it, in floats.
    selections : statuses on both sides, one or two
    settled : bool
        Conditions change their sign once each, or alpha turns back once, and nothing else happens. Where several do,
        alpha goes one way or turns back once in whichever order they do.
    bounded : bool
        At an end of the curve: the rigid displacement reaches its bound there, once.
    """

    alphas: Range
    x: Floats
    selections: tuple[Codes, ...]
    settled: bool
    bounded: bool = False

    def joined(self, other: Turn) -> Turn:
        """With one that follows at once: what happens there is not settled."""
        ends = (*self.alphas, *other.alphas)
        selections = tuple(dict.fromkeys((*self.selections, *other.selections)))
        bounded = self.bounded or other.bounded
        return Turn((min(ends), max(ends)), other.x, selections, settled=False, bounded=bounded)


def in_order(links: Iterable[Sequence[Run | Turn]], *, closed: bool) -> list[Run | Turn] | None:
    """Runs and turns of the links of a curve, which alternate; None where a run does not go on at a joint.

    Begins and ends with a run, but where a part at an end is left open, and for a curve that is closed and has a turn:
    it begins with that and ends with a run.
    """
    found: list[Run | Turn] = []
    for parts in links:
        if not put_behind(found, parts):
            return None
    if closed:
        first = next((k for k, part in enumerate(found) if isinstance(part, Turn)), 0)
        ahead, found = found[:first], found[first:]
        if not put_behind(found, ahead):
            return None
    return found


def up_to_bound(link: CurveLink, parts: Sequence[Run | Turn]) -> Sequence[Run | Turn]:
    """Parts of a link; one turn where the rigid displacement reaches its bound, with all alpha between both points."""
    if not link.leaves:
        return parts
    alphas: list[Fraction] = []
    selections: list[Codes] = []
    for part in parts:
        alphas += (*part.start, *part.end) if isinstance(part, Run) else part.alphas
        selections += (part.codes,) if isinstance(part, Run) else part.selections
    joined: list[Run | Turn] = []
    first, whole = parts[0], put_behind(joined, parts) and len(joined) == 1
    x, settled = (first.knots[0], whole) if isinstance(first, Run) else (first.x, False)
    return [Turn((min(alphas), max(alphas)), x, tuple(dict.fromkeys(selections)), settled, bounded=True)]


def arcs_over(parts: Sequence[Run | Turn], interval: Range, *, closed: bool) -> tuple[int, list[Range]]:
    """The number of runs of a curve over an interval, and where it is not known how they are joined, or whether."""
    gaps = []
    for turn in parts:
        if isinstance(turn, Turn):
            side = side_of(turn.alphas, interval)
            if side is None or (side == 0 and not turn.settled):
                gaps.append((max(turn.alphas[0], interval[0]), min(turn.alphas[1], interval[1])))
    ends = [ends_of(parts, k, closed=closed) for k, part in enumerate(parts) if isinstance(part, Run)]
    sides = [[side_of(alphas, interval) for _, alphas, _ in both] for both in ends]
    return sum(low != 1 and high != -1 for low, high in sides), gaps


def ends_of(parts: Sequence[Run | Turn], k: int, *, closed: bool) -> list[tuple[int | None, Range, Range]]:
    """The lower and the upper end of a run: the number of a turn there, bounds of alpha, and those of the run itself.

    None in place of a number where there is no turn.
    """
    run = parts[k]
    assert isinstance(run, Run)
    # a closed curve goes on from its end to its first turn
    numbers = k - 1, (k + 1) % len(parts) if closed else k + 1
    found: list[tuple[int | None, Range, Range]] = []
    for number, own in zip(numbers, (run.start, run.end), strict=True):
        turn = parts[number] if 0 <= number < len(parts) else None
        found.append((number, turn.alphas, own) if isinstance(turn, Turn) else (None, own, own))
    return found[:: run.rises]


def side_of(alphas: Range, interval: Range) -> int | None:
    """-1 below an interval, 0 inside, 1 above it; None where it may be either."""
    (a, b), (low, high) = interval, alphas
    if high < a:
        return -1
    if low > b:
        return 1
    return 0 if a < low and high < b else None


def put_behind(found: list[Run | Turn], parts: Iterable[Run | Turn]) -> bool:
    """Put parts behind others; False where statuses or the direction of alpha change between two runs."""
    for part in parts:
        last = found[-1] if found else None
        if isinstance(last, Run) and isinstance(part, Run):
            if (last.codes, last.rises) != (part.codes, part.rises):
                return False
            found[-1] = last.joined(part)
        elif isinstance(last, Turn) and isinstance(part, Turn):
            found[-1] = last.joined(part)
        else:
            found.append(part)
    return True


def changed(codes: Codes, nodes: Sequence[int], to: Sequence[int]) -> Codes:
    """Codes with those of some nodes replaced."""
    new = dict(zip(nodes, to, strict=True))
    return tuple(new.get(i, code) for i, code in enumerate(codes))


def orders(one: Codes, other: Codes) -> list[list[Codes]]:
    """The ways from some statuses to others along which the nodes change one by one."""
    nodes = [i for i, pair in enumerate(zip(one, other, strict=True)) if pair[0] != pair[1]]
    return [
        [changed(one, order[:k], [other[i] for i in order[:k]]) for k in range(len(order) + 1)]
        for order in permutations(nodes)
    ]


class LinkParts:
    """Tests of what the curve of a link does between two of its places.

    Places have the border of the link and are solutions that lie in its box. Two curves with the same border that
    share a point go on together as long as both are in their boxes, of which they do not reach the sides.

    Parameters
    ----------
    link : CurveLink
    """

    def __init__(self, link: CurveLink) -> None:
        self.curve, self.problem, self.border = link.curve, link.curve.problem, link.curve.box.border

    # -- places and boxes ------------------------------------------------------------------------------------------

    def place(self, point: SolutionCurve) -> Place:
        """The place of a joint between two boxes."""
        return Place(point, CurveMotion(point, self.border))

    def place_at(self, point: SolutionCurve | None) -> Place | None:
        """At a point of the curve; None where it is not proven to be one at which all statuses hold strictly."""
        if point is None or point.box.half or None in point.statuses or not self.curve.holds(point.at(0.0)):
            return None
        return self.place(point)

    def is_between(self, start: Place, place: Place, end: Place) -> bool:
        """True if a place is behind another one and before a third one."""
        t = [parameter_in(self.curve.box, one.point.at(0.0)) for one in (start, place, end)]
        steps = [two - one for one, two in pairwise(t)]
        return all(step.mid > step.rad * SAFE for step in steps)

    def curve_in(self, box: CurveBox, start: Place, end: Place) -> SolutionCurve | None:
        """The curve in a box of its own that has two places; None where it is not proven to be the link's."""
        if not np.array_equal(box.border, self.border):
            return None
        curve = only_curve(self.problem, box)
        return curve if curve is not None and self.has(curve, start, end) else None

    @staticmethod
    def has(curve: SolutionCurve, start: Place, end: Place) -> bool:
        """True if two places lie in the box of a curve."""
        return all(lies_in(curve.box, place.point.at(0.0)) for place in (start, end))

    # -- parts -----------------------------------------------------------------------------------------------------

    def statuses(self, motion: CurveMotion, start: Place, end: Place) -> tuple[Codes | None, list[int]]:
        """The statuses that hold all along, or the nodes that change their status exactly once, or neither."""
        loose = [i for i, codes in enumerate(motion.possible) if len(codes) > 1]
        here = start.codes
        if not loose:
            return here, []
        # three at most are told apart whatever their order is
        if len(loose) > 3 or any(len(motion.possible[i]) > 2 for i in loose):
            return None, []
        pairs = [(here[i], next((code for code in motion.possible[i] if code != here[i]), here[i])) for i in loose]
        # every condition passes zero once at most, whatever the statuses of the other nodes are
        for i, pair in zip(loose, pairs, strict=True):
            beside = product(*(pair[:1] if j == i else ends for j, ends in zip(loose, pairs, strict=True)))
            signs = {motion.decides(changed(here, loose, codes), i, pair[1]) for codes in beside}
            if len(signs) > 1 or 0 in signs:
                return None, []
        nodes = [i for i in loose if here[i] != end.codes[i]]
        return (None, nodes) if nodes else (here, [])

    def run(self, motion: CurveMotion, start: Place, end: Place, codes: Codes) -> Run | None:
        """Run of a part where statuses hold all along, if alpha goes one way."""
        rises = motion.rises(codes)
        if not rises and start.rises == end.rises and motion.bends(codes):
            # the derivative of alpha is monotone
            rises = start.rises
        return self._run(start, end, codes, rises) if rises else None

    def fold(
        self, motion: CurveMotion, start: Place, end: Place, codes: Codes, sides: tuple[Place, Place]
    ) -> list[Run | Turn] | None:
        """Two runs and the fold between them, where statuses hold all along and alpha turns back once."""
        before, after = sides
        if not start.rises or start.rises != -end.rises or not motion.bends(codes):
            return None
        if [side.rises for side in sides] != [start.rises, end.rises]:
            return None
        if not (self.is_between(start, before, end) and self.is_between(start, after, end)):
            return None
        turn = Turn(self._fold(before, after), 0.5 * (before.x + after.x), (codes,), settled=True)
        return [self._run(start, before, codes, start.rises), turn, self._run(after, end, codes, end.rises)]

    def corner(self, motion: CurveMotion, start: Place, end: Place, sides: tuple[Place, Place]) -> Turn | None:
        """First change, between places, where nodes change their statuses, each of them once.

        ``motion`` is that of a curve that has both. It is not settled where alpha hardly changes beside it, as where a
        body begins to slide.
        """
        (before, after), one = sides, start.codes
        if before.codes != one or after.codes == one:
            return None
        if not (self.is_between(start, before, end) and self.is_between(start, after, end)):
            return None
        other = after.codes
        between = list(orders(one, other))
        passed = dict.fromkeys(codes for order in between for codes in order)
        rises = {codes: motion.rises(codes) for codes in passed}
        # in any order of the changes alpha turns back once, or never
        turned = {sum(rises[x] != rises[y] for x, y in pairwise(order)) for order in between}
        settled = all(rises.values()) and turned in ({0}, {1})
        if not settled and before.rises and after.rises:
            return None
        step = self._step(before, after)
        reach = Fraction(0)
        for codes in passed:
            speed = motion.speed(codes)
            if speed is None:
                return None
            reach = max(reach, Fraction(float(speed.size[-1])) * step)
        alphas = before.alphas[0] - reach, before.alphas[1] + reach
        return Turn(alphas, 0.5 * (before.x + after.x), (one, other), settled)

    def behind(self, after: Place, end: Place) -> tuple[SolutionCurve | None, Place, Place, Codes | None]:
        """Part that follows a corner: the link's curve and the statuses, where these do not change again."""
        known = after.codes == end.codes
        return (self.curve if known else None), after, end, (end.codes if known else None)

    def left_open(self, curve: SolutionCurve | None, start: Place, end: Place) -> Turn:
        """A part of which is not known what it does."""
        alphas = (self.curve if curve is None else curve).alphas
        selections = tuple(dict.fromkeys((start.codes, end.codes)))
        return Turn(alphas, 0.5 * (start.x + end.x), selections, settled=False)

    def _run(self, start: Place, end: Place, codes: Codes, rises: int) -> Run:
        knots, index = (start.x, end.x), self.curve.sign * rises
        return Run(codes, rises, index, knots, (self.border,), start.alphas, end.alphas)

    def _step(self, start: Place, end: Place) -> Fraction:
        """An upper bound of how much the parameter increases between two places."""
        ends = [parameter_in(self.curve.box, place.point.at(0.0)) for place in (start, end)]
        return sum(
            (Fraction(float(t.mid)) * s + Fraction(float(t.rad)) for s, t in zip((-1, 1), ends, strict=True)),
            Fraction(0),
        )

    def _fold(self, before: Place, after: Place) -> Range:
        """Bounds of alpha where it turns back once between two places, beyond both of them.

        Its derivative is monotone, so that alpha lies on one side of its tangents.
        """
        step, sign = self._step(before, after), before.rises
        inner = [sign * place.alphas[0 if sign > 0 else 1] for place in (before, after)]
        outer = []
        for place in (before, after):
            speed = place.motion.speed(place.codes)
            if speed is not None:
                outer.append(sign * place.alphas[1 if sign > 0 else 0] + Fraction(float(speed.size[-1])) * step)
        ends = sign * max(inner), sign * min(outer)
        return min(ends), max(ends)
