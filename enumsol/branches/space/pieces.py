"""What a curve in 3D says over alpha: runs on which statuses hold and alpha goes one way, and turns between them.

A turn is where one condition changes its sign, or a few do too near to each other to be told apart, or where alpha
turns back, once; a part of the curve of which nothing of this could be shown is left open (theory, section 12.10).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from itertools import pairwise, permutations, product
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import brentq

from enumsol.support.deadlines import look, tell
from enumsol.trusted.space.curve_events import CurveMotion
from enumsol.trusted.space.solution_curve import (
    curve_around,
    curve_point,
    lies_in,
    only_curve,
    parameter_in,
    status_margin,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from enumsol.selections.solution import Codes
    from enumsol.trusted.space.curve_chains import CurveChain, CurveLink
    from enumsol.trusted.space.solution_curve import AlphaProblem, CurvePoint, SolutionCurve

    Array = NDArray[np.float64]

#: How often a part is halved; how near to the place that floats find the points beside it are put at
#: best, relative to the part, how much of this that place may be off, by what factor farther others are, and how many.
_HALVINGS = 12
_BESIDE, _CLOSE, _FARTHER, _TRIALS = 2.0**-44, 0.25, 8.0, 15
#: The same beside a smooth fold, where alpha is a square of the distance.
_BESIDE_FOLD = 2.0**-24
#: Parts are longer than the way between their ends by this, and wider than their ends are known.
_LONGER, _ROUNDED = 1.05, 16.0
#: After so many parts of a link that stay open none is halved: along a continuum of solutions all would.
_MOST_OPEN = 16
#: So many nodes at most may change their statuses too near to each other to be told apart.
_AT_ONCE = 3
#: Where a part is cut: at the first of these shares where the solution is regular.
_CUTS = (0.5, 0.4375, 0.59375)


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
    def x(self) -> Array:
        """Forces and alpha, in the middle of their bounds."""
        return self.point.at(0.0).mid

    @property
    def alphas(self) -> tuple[Fraction, Fraction]:
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
    knots : sequence of (3p + 1,) arrays
        Points on it, in floats, in the order of the curve.
    borders : sequence of (3p + 1,) arrays
        Rows of the parameter between two of them.
    start, end : pairs of Fraction
        Bounds of alpha at its first and last point that is known.
    """

    codes: Codes
    rises: int
    index: int
    knots: tuple[Array, ...]
    borders: tuple[Array, ...]
    start: tuple[Fraction, Fraction]
    end: tuple[Fraction, Fraction]

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
    x : (3p + 1,) array
        A point of it, in floats.
    selections : statuses on both sides, one or two
    settled : bool
        Conditions change their sign once each, or alpha turns back once, and nothing else happens. Where several do,
        alpha goes one way or turns back once in whichever order they do.
    """

    alphas: tuple[Fraction, Fraction]
    x: Array
    selections: tuple[Codes, ...]
    settled: bool


def runs_and_turns(problem: AlphaProblem, chain: CurveChain, found: list[Run | Turn] | None = None) -> list[Run | Turn]:
    """Those of a curve, in its order; runs and turns alternate.

    Begins and ends with a run, but for a curve that is closed and has a turn: it begins with that and ends with a run.
    ``found`` is filled on the way, so that it has what there is when the time is over.
    """
    found, nearness = [] if found is None else found, _TRIALS // 2
    for k, (link, start, end) in enumerate(zip(chain.links, chain.joints[:-1], chain.joints[1:], strict=True)):
        look()
        tell("boxes of a curve cut into arcs", k, len(chain.links))
        cutter = LinkCutter(problem, link, nearness)
        for part in cutter.parts(start, end):
            _append(found, part)
        nearness = cutter.nearness
    if chain.closed:
        first = next((k for k, part in enumerate(found) if isinstance(part, Turn)), 0)
        ahead, found = found[:first], found[first:]
        for part in ahead:
            _append(found, part)
    return found


def _append(found: list[Run | Turn], part: Run | Turn) -> None:
    """Put a part behind others: a run goes on where the statuses and the direction are those of the last one."""
    if not found or isinstance(part, Run) != isinstance(found[-1], Run):
        found.append(part)
        return
    last = found.pop()
    if isinstance(last, Run) and isinstance(part, Run):
        if (last.codes, last.rises) != (part.codes, part.rises):
            raise AssertionError("a curve changes at a regular point")
        found.append(last.joined(part))
    elif isinstance(last, Turn) and isinstance(part, Turn):
        ends = (*last.alphas, *part.alphas)
        selections = tuple(dict.fromkeys((*last.selections, *part.selections)))
        found.append(Turn((min(ends), max(ends)), part.x, selections, settled=False))


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


class LinkCutter:
    """Cuts the curve of a link into runs and turns.

    Parts have the border of the link and end in solutions that lie in its box. Two curves with the same border that
    share a point go on together as long as both are in their boxes, of which they do not reach the sides.

    Parameters
    ----------
    problem : AlphaProblem
    link : CurveLink
    nearness : int
        Which of the distances from a change to the points beside it is tried first: then that of the last change.
    """

    def __init__(self, problem: AlphaProblem, link: CurveLink, nearness: int = _TRIALS // 2) -> None:
        self.problem, self.curve, self.nearness = problem, link.curve, nearness
        self.border, self._open = link.curve.box.border, 0

    def parts(self, start: SolutionCurve, end: SolutionCurve) -> list[Run | Turn]:
        """From one joint to another one."""
        return self._cut(self.curve, self._place(start), self._place(end), None, _HALVINGS)

    def _place(self, point: SolutionCurve) -> Place:
        return Place(point, CurveMotion(self.problem, point, self.border))

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
        curve = self._between(start, end) if curve is None else curve
        if curve is not None:
            motion = CurveMotion(self.problem, curve)
            changing: Sequence[int] = ()
            if codes is None:
                codes, changing = self._statuses(motion, start, end)
            found = None
            if changing:
                found = self._corner(motion, start, end, changing, times)
            elif codes is not None:
                found = self._smooth(motion, start, end, codes)
            if found is not None:
                return found
        middle = self._middle(start, end) if times > 0 and self._open < _MOST_OPEN else None
        if middle is None:
            self._open += 1
            return [self._left_open(curve, start, end)]
        halves = (start, middle), (middle, end)
        found = []
        for one, other in halves:
            for part in self._cut(None, one, other, codes, times - 1):
                _append(found, part)
        return found

    def _statuses(self, motion: CurveMotion, start: Place, end: Place) -> tuple[Codes | None, list[int]]:
        """The statuses that hold all along, or the nodes that change their status exactly once, or neither."""
        loose = [i for i, codes in enumerate(motion.possible) if len(codes) > 1]
        here = start.codes
        if not loose:
            return here, []
        if len(loose) > _AT_ONCE or any(len(motion.possible[i]) > 2 for i in loose):
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

    def _smooth(self, motion: CurveMotion, start: Place, end: Place, codes: Codes) -> list[Run | Turn] | None:
        """Where the statuses do not change: one run, or two with a fold between them."""
        rises = motion.rises(codes)
        if rises:
            return [self._run(start, end, codes, rises)]
        if not (start.rises and end.rises and motion.bends(codes)):
            return None
        # the derivative of alpha is monotone
        if start.rises == end.rises:
            return [self._run(start, end, codes, start.rises)]
        sides = self._beside(start, end, lambda point: start.rises * float(point.direction[-1]), _BESIDE_FOLD)
        if sides is None or [side.rises for side in sides] != [start.rises, end.rises]:
            return None
        alphas = self._fold(*sides)
        turn = Turn(alphas, 0.5 * (sides[0].x + sides[1].x), (codes,), settled=True)
        before, after = self._run(start, sides[0], codes, start.rises), self._run(sides[1], end, codes, end.rises)
        return [before, turn, after]

    def _corner(
        self, motion: CurveMotion, start: Place, end: Place, nodes: Sequence[int], times: int
    ) -> list[Run | Turn] | None:
        """Where nodes change their statuses, each of them once: the first change, and what follows."""
        one = start.codes
        own = [one[i] for i in nodes]
        sides = self._beside(start, end, lambda point: status_margin(self.problem, point.z, nodes, own), _BESIDE)
        if sides is None or sides[0].codes != one:
            return None
        other = sides[1].codes
        near = self._between(*sides)
        motion = motion if near is None else CurveMotion(self.problem, near)
        between = list(orders(one, other))
        passed = dict.fromkeys(codes for order in between for codes in order)
        rises = {codes: motion.rises(codes) for codes in passed}
        # in any order of the changes alpha turns back once, or never
        turned = {sum(rises[x] != rises[y] for x, y in pairwise(order)) for order in between}
        if not all(rises.values()) or turned not in ({0}, {1}):
            return None
        step = self._step(*sides)
        reach = Fraction(0)
        for codes in passed:
            speed = motion.speed(codes)
            if speed is None:
                return None
            reach = max(reach, Fraction(float(speed.size[-1])) * step)
        alphas = sides[0].alphas[0] - reach, sides[0].alphas[1] + reach
        turn = Turn(alphas, 0.5 * (sides[0].x + sides[1].x), (one, other), settled=True)
        found: list[Run | Turn] = []
        rest = (self.curve, other) if other == end.codes else (None, None)
        for part in (
            *self._cut(self.curve, start, sides[0], one, times - 1),
            turn,
            *self._cut(rest[0], sides[1], end, rest[1], times - 1),
        ):
            _append(found, part)
        return found

    # -- places ----------------------------------------------------------------------------------------------------

    def _near(self, start: Place, end: Place, share: float) -> CurvePoint | None:
        """The point of the curve with this share of the way, in floats."""
        return curve_point(self.problem, start.x + share * (end.x - start.x), self.border)

    def _at(self, start: Place, end: Place, share: float) -> Place | None:
        """The place there, proven."""
        near = self._near(start, end, share)
        if near is None:
            return None
        point = curve_around(self.problem, near.x, near.direction, self.border, 0.0, roomy=False)
        if point is None or None in point.statuses or not self.curve.holds(point.at(0.0)):
            return None
        return self._place(point)

    def _middle(self, start: Place, end: Place) -> Place | None:
        found = (self._at(start, end, share) for share in _CUTS)
        return next((place for place in found if place is not None), None)

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
        """Whether two places are proven to be on different sides."""
        return one.codes != other.codes or one.rises * other.rises < 0

    def _between(self, start: Place, end: Place) -> SolutionCurve | None:
        """A curve in a box of its own that has two places of the link."""
        chord = end.x - start.x
        length = float(self.border @ chord)
        if not length > 0:
            return None
        changing = [i for i, pair in enumerate(zip(start.codes, end.codes, strict=True)) if pair[0] != pair[1]]
        middle, half = start.x + 0.5 * chord, 0.5 * _LONGER * length
        curve = curve_around(self.problem, middle, chord / length, self.border, half, changing, roomy=False)
        if curve is None:
            return None
        # a curve that only alpha changes along needs a box of the size of rounding errors
        least = _ROUNDED * np.maximum(*(place.point.at(0.0).rad for place in (start, end)))
        if np.any(curve.box.radius < least):
            curve = only_curve(self.problem, replace(curve.box, radius=np.maximum(curve.box.radius, least)))
        if curve is None or not all(lies_in(curve.box, place.point.at(0.0)) for place in (start, end)):
            return None
        return curve

    # -- what is known ---------------------------------------------------------------------------------------------

    def _run(self, start: Place, end: Place, codes: Codes, rises: int) -> Run:
        knots, index = (start.x, end.x), self.curve.sign * rises
        return Run(codes, rises, index, knots, (self.border,), start.alphas, end.alphas)

    def _left_open(self, curve: SolutionCurve | None, start: Place, end: Place) -> Turn:
        """A part of which is not known what it does."""
        alphas = (self.curve if curve is None else curve).alphas
        selections = tuple(dict.fromkeys((start.codes, end.codes)))
        return Turn(alphas, 0.5 * (start.x + end.x), selections, settled=False)

    def _step(self, start: Place, end: Place) -> Fraction:
        """An upper bound of how much the parameter increases between two places."""
        ends = [parameter_in(self.curve.box, place.point.at(0.0)) for place in (start, end)]
        return sum(
            (Fraction(float(t.mid)) * s + Fraction(float(t.rad)) for s, t in zip((-1, 1), ends, strict=True)),
            Fraction(0),
        )

    def _fold(self, before: Place, after: Place) -> tuple[Fraction, Fraction]:
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
