"""Claims of a branch graph: the one place that knows how far its statements reach (theory, section 7.13).

Arcs and settled vertices of any graph are solutions, whatever cut the search short: each arc is one of regular roots,
and no two of them meet between their ends. So a graph that is not complete gives lower bounds, which are counted here,
too. The number of solutions, uniqueness and a critical alpha need a graph without gaps. Texts, JSON, plots and Python
all ask here.
"""

from __future__ import annotations

import enum
from bisect import bisect_left
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import accumulate, pairwise
from math import floor, inf, log10, nextafter
from typing import TYPE_CHECKING

import numpy as np
from networkx.utils import UnionFind

from enumsol.arithmetic.algebraic import CriticalAlpha
from enumsol.arithmetic.rationals import rational
from enumsol.branches.elements import Arc, Vertex, VertexKind, index_sum
from enumsol.model.problem import ContactProblem
from enumsol.support.messages import counted, listed

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from enumsol.model.problem3d import ContactProblem3D

    Range = tuple[Fraction, Fraction]

#: Most ranges of alpha that a text names, and most single alphas with another number of solutions.
_SHOWN, _SINGLE = 6, 3
#: Numbers of solutions in words.
_WORDS = ("none", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve")


@dataclass
class _RootCount:
    """Solutions found at one alpha, or at all alphas between two neighbouring floats.

    Attributes
    ----------
    apart : int
        Solutions that differ, and that nothing unknown joins.
    index : int or None
        Sum of their indices; None where one is not known.
    another : bool
        Some other solution was found, which may be joined to further ones.
    vertices : list of Vertex
        Settled ones that may lie there.
    arcs : list of (Arc, int, int)
        Those with an end that may lie there: the sides of their ends, -1 below, 1 above, and 0.
    """

    apart: int = 0
    index: int | None = 0
    another: bool = False
    vertices: list[Vertex] = field(default_factory=list)
    arcs: list[tuple[Arc, int, int]] = field(default_factory=list)

    def add(self, index: int | None) -> None:
        """Count a solution."""
        self.apart += 1
        self.index = None if self.index is None or index is None else self.index + index

    def pass_over(self, arc: Arc) -> None:
        """Count an arc that passes over."""
        if arc.grazing:
            self.another = True
        else:
            self.add(arc.index)

    def least(self, settled: Sequence[bool], *, exactly: bool) -> int:
        """The lower bound.

        Parameters
        ----------
        settled : of all vertices, whether they are
        exactly : this is one alpha, so that a rational number that may lie there does
        """
        here = [v for v in self.vertices if exactly and v.exact.is_rational]
        for v in here:
            self.add(_degree(v))
        for arc, begin, end in self.arcs:
            ends = ((begin, arc.begin, arc.tail), (end, arc.end, arc.head))
            if exactly and any(side == 0 and at.is_rational and not settled[number] for side, at, number in ends):
                self.another = True  # the roots of the arc have a limit
        self._add_pieces([v.number for v in self.vertices if v not in here])
        return self.apart + int(self.another or self.index not in (None, 1))

    def _add_pieces(self, near: Sequence[int]) -> None:
        """Count pieces of vertices and arcs that lead from below to above."""
        union: UnionFind = UnionFind(near)
        inside = set(near)
        for arc, _, _ in self.arcs:
            if arc.tail in inside and arc.head in inside:
                union.union(arc.tail, arc.head)
        pieces: dict[int, list[tuple[Arc, int, int]]] = {union[number]: [] for number in near}
        for arc, begin, end in self.arcs:
            place = next((union[number] for number in (arc.tail, arc.head) if number in inside), None)
            if place is not None:
                pieces[place].append((arc, begin, end))
        for arcs in pieces.values():
            below = [arc.index for arc, begin, _ in arcs if begin < 0]
            above = [arc.index for arc, _, end in arcs if end > 0]
            if not below or not above:
                continue
            if any(arc.grazing for arc, _, _ in arcs):
                self.another = True
                continue
            # elsewhere arcs lead away to what is not known
            closed = all(
                (begin < 0 or arc.tail in inside) and (end > 0 or arc.head in inside) for arc, begin, end in arcs
            )
            sums = {index_sum(below), index_sum(above)}
            self.add(sums.pop() if closed and len(sums) == 1 else None)


def least_at(alpha: Fraction, vertices: Sequence[Vertex], arcs: Sequence[Arc], *, held: bool = True) -> int:
    """Lower bound of the number of isolated roots and families at one alpha.

    Parameters
    ----------
    alpha : Fraction
    vertices : sequence of Vertex, each at the place of its number
    arcs : sequence of Arc
    held : the indices of all solutions add up to +1
    """
    point = CriticalAlpha.rational(rational(alpha))
    settled = [v.kind is not VertexKind.UNSETTLED for v in vertices]
    tally = _RootCount(
        index=0 if held else None, vertices=[v for v in vertices if settled[v.number] and v.exact.compare(point) == 0]
    )
    for arc in arcs:
        begin, end = arc.begin.compare(point), arc.end.compare(point)
        if begin < 0 < end:
            tally.pass_over(arc)
        elif begin * end == 0:
            tally.arcs.append((arc, begin, end))
    return tally.least(settled, exactly=True)


def least_steps(
    interval: tuple[Fraction, Fraction], vertices: Sequence[Vertex], arcs: Sequence[Arc], *, held: bool = True
) -> tuple[list[float], list[int], list[int]]:
    """The lower bound as a step function: floats inside the interval, bounds at them and over all alphas between.

    A number that is no float, or of which only bounds are known, lies between two of these floats, and the step there
    holds on both sides of it.
    """
    settled = [v for v in vertices if v.kind is not VertexKind.UNSETTLED]
    positions = _Positions(interval, [*(v.exact for v in settled), *(c for arc in arcs for c in (arc.begin, arc.end))])
    over, graze, index, unknown = ([0] * (positions.count + 1) for _ in range(4))
    here = [_RootCount() for _ in range(positions.count)]
    for v in settled:
        for k in positions.clipped(*positions.of(v.exact)):
            here[k].vertices.append(v)
    for arc in arcs:
        (first, begun), (ending, last) = positions.of(arc.begin), positions.of(arc.end)
        for k in sorted({*positions.clipped(first, begun), *positions.clipped(ending, last)}):
            sides = [int(low > k) - int(high < k) for low, high in ((first, begun), (ending, last))]
            here[k].arcs.append((arc, sides[0], sides[1]))
        start, stop = max(begun + 1, 0), min(ending, positions.count)
        if start < stop:
            for sums, value in (
                ((graze, 1),) if arc.grazing else ((over, 1), (index, arc.index or 0), (unknown, arc.index is None))
            ):
                sums[start] += value
                sums[stop] -= value
    known = [v.kind is not VertexKind.UNSETTLED for v in vertices]
    found = []
    for k, (tally, *sums) in enumerate(zip(here, *map(accumulate, (over, graze, index, unknown)), strict=False)):
        tally.apart, tally.another, tally.index = sums[0], sums[1] > 0, sums[2] if held and not sums[3] else None
        found.append(tally.least(known, exactly=k % 2 == 0))
    return positions.steps(found)


class _Positions:
    """Floats around numbers, and the open intervals between neighbours: numbered in turn, 0 for the first float.

    Parameters
    ----------
    interval : (Fraction, Fraction)
        Only floats inside it count.
    numbers : CriticalAlphas
    """

    def __init__(self, interval: tuple[Fraction, Fraction], numbers: Iterable[CriticalAlpha]) -> None:
        # the vertices' numbers are those of the arcs as well
        self._brackets = {number: _bracket(number) for number in numbers}
        first, last = (_outward(end, up=up) for end, up in zip(interval, (True, False), strict=True))
        inside = {x for pair in self._brackets.values() for x in pair if first <= x <= last}
        self.floats = sorted(inside | {x for x in (first, last) if first <= last})
        self.count = max(2 * len(self.floats) - 1, 0)

    def of(self, number: CriticalAlpha) -> tuple[int, int]:
        """First and last position at which a number may lie, -1 and ``count`` for all below and above."""
        low, high = self._brackets[number]
        k, j = self._index(low), self._index(high)
        return (2 * k, 2 * k) if low == high else (2 * k + 1, 2 * j - 1)

    def _index(self, value: float) -> int:
        """The place of a float, -1 if it lies below all."""
        return -1 if not self.floats or value < self.floats[0] else bisect_left(self.floats, value)

    def clipped(self, first: int, last: int) -> range:
        """Positions that there are."""
        return range(max(first, 0), min(last + 1, self.count))

    def steps(self, values: Sequence[int]) -> tuple[list[float], list[int], list[int]]:
        """Floats at which values change, and both ends; values at them, and between."""
        ends = (0, self.count - 1)
        kept = [k for k in range(0, self.count, 2) if k in ends or not values[k - 1] == values[k] == values[k + 1]]
        return [self.floats[k // 2] for k in kept], [values[k] for k in kept], [values[k + 1] for k in kept[:-1]]


def _bracket(number: CriticalAlpha) -> tuple[float, float]:
    """A number that is a float, twice; else floats between which it lies, with all bounds that are known of it."""
    low, high = number.enclosure()
    if low == high == float(low):
        return float(low), float(low)
    below, above = float(low), float(high)
    return below if below < low else nextafter(below, -inf), above if above > high else nextafter(above, inf)


def _outward(value: Fraction, *, up: bool) -> float:
    """The nearest float that is not smaller, or not larger."""
    rounded = float(value)
    if (rounded < value) if up else (rounded > value):
        return nextafter(rounded, inf if up else -inf)
    return rounded


def _degree(v: Vertex) -> int | None:
    """The degree of a settled vertex, by the arcs on its sides (at the interval's border all are on one side)."""
    left, right = v.index_left, v.index_right
    if left is None or right is None:
        return None
    if v.border:
        return left + right
    return left if left == right else None


class Standing(enum.Enum):
    """Reach of the statements of a branch graph."""

    PROVEN = "proven"
    NOT_PROVEN = "not proven"
    INCOMPLETE = "incomplete"


@dataclass(frozen=True)
class Multiplicity:
    """A number of solutions (isolated roots and families together), or a lower bound of it.

    Attributes
    ----------
    count : int
    exact : bool
        ``count`` is the number itself; otherwise it is a lower bound.
    """

    count: int
    exact: bool

    def __str__(self) -> str:
        return str(self.count) if self.exact else f"at least {self.count}"


@dataclass(frozen=True)
class MultiplicitySteps:
    """The number of solutions as a step function of alpha, or a lower bound of it.

    Attributes
    ----------
    alphas : tuple of Fraction
        Critical alphas, rounded to floats, in order. Where these are lower bounds: the floats at which they change, on
        the safe side of a critical alpha that is no float or not known exactly, and the first and last float.
    at : tuple of int
        Values at these alphas (at the critical ones themselves, unless these are lower bounds).
    between : tuple of int
        Values on the open intervals between them (one fewer).
    exact : bool
        Whether these are the numbers of solutions and not lower bounds.
    """

    alphas: tuple[Fraction, ...]
    at: tuple[int, ...]
    between: tuple[int, ...]
    exact: bool

    def ranges(self, narrow: float = 0.0) -> list[tuple[float, float, int]]:
        """Ranges of alpha with their numbers, (low, high, number): single alphas inside of them may have another.

        Ranges below ``narrow`` are left out.
        """
        pieces = [
            (low, high, n) for (low, high), n in zip(pairwise(map(float, self.alphas)), self.between, strict=True)
        ]
        return _joined([piece for piece in _joined(pieces) if piece[1] - piece[0] >= narrow])

    def busiest(self) -> float:
        """The middle of the widest range with most solutions, or beside it where it is a critical alpha itself."""
        ends = [float(alpha) for alpha in self.alphas]
        # ranges narrower than this share of the interval are no place to begin in: a slider hardly finds them again
        ranges = self.ranges(0.005 * (ends[-1] - ends[0])) or self.ranges()
        if not ranges:
            return ends[0]
        low, high, _ = max(ranges, key=lambda span: (span[2], span[1] - span[0]))
        middle = 0.5 * (low + high)
        return 0.5 * (middle + min(x for x in ends if x > middle)) if middle in ends and middle < high else middle

    def sentence(self) -> str:
        """Numbers of solutions over ranges of alpha, as in "three solutions for alpha between 1 and 2, one elsewhere".

        Empty if there is nowhere more than one solution.
        """
        width = float(self.alphas[-1] - self.alphas[0]) if self.alphas else 0.0
        if not width > 0 or max((*self.between, *(self.at if self.exact else ()))) < 2:
            return ""
        digits = 4 - floor(log10(width))
        ranges, spans = self.ranges(10.0**-digits) or self.ranges(), dict[int, list[str]]()
        for low, high, number in sorted(ranges, key=lambda span: (-span[2], span[0])):
            spans.setdefault(number, []).append(f"between {_rounded(low, digits)} and {_rounded(high, digits)}")
        most = max(spans)
        rest = min(spans, key=lambda number: (-len(spans[number]), number))
        if len(ranges) > _SHOWN:
            more = len(spans[most]) - 2
            where = spans[most][:2] + ([f"in {counted(more, 'more range')}"] if more > 0 else [])
            fewer = "fewer" if self.exact else self._words(min((*self.at, *self.between)))
            return f"{self._head(most)} for alpha {listed(where)}, {fewer} elsewhere{self._odd(ranges, most)}"
        parts = [(number, listed(spans[number])) for number in spans if number != rest]
        if not parts:
            return f"{self._head(rest)} throughout{self._single(ranges, rest, digits)}"
        words = [f"{self._head(parts[0][0])} for alpha {parts[0][1]}"]
        words += [f"{self._words(number)} {place}" for number, place in [*parts[1:], (rest, "elsewhere")]]
        return ", ".join(words) + self._single(ranges, rest, digits)

    def _head(self, number: int) -> str:
        return f"{self._words(number)} solution{'' if number == 1 else 's'}"

    def _odd(self, ranges: Sequence[tuple[float, float, int]], most: int) -> str:
        """Note, if single alphas within ranges of most solutions have fewer, or any alpha has more."""
        inside = [(low, high) for low, high, number in ranges if number == most]
        places = [*zip(map(float, self.alphas), self.at, strict=True)]
        places += [
            (float(low + high) / 2, n) for (low, high), n in zip(pairwise(self.alphas), self.between, strict=True)
        ]
        odd = any(n < most and any(low < x < high for low, high in inside) for x, n in places)
        above = self.exact and max(n for _, n in places) > most
        return "; other numbers at single alphas" if odd or above else ""

    def _words(self, number: int) -> str:
        word = _WORDS[number] if number < len(_WORDS) else f"{number:,}"
        if self.exact:
            return word
        return f"at least {word}" if number else "perhaps none"

    def _single(self, ranges: Sequence[tuple[float, float, int]], rest: int, digits: int) -> str:
        """Single alphas, and ranges too narrow to be told from them, whose number is none that was said of them."""
        narrow, values = 10.0**-digits, dict[str, list[int]]()
        said: dict[str, set[int]] = {}
        for k, alpha in enumerate(map(float, self.alphas)):
            place = _rounded(alpha, digits)
            inside = k < len(self.between) and float(self.alphas[k + 1]) - alpha < narrow
            values.setdefault(place, []).extend([self.at[k], *([self.between[k]] if inside else [])])
            said.setdefault(place, set()).update(n for low, high, n in ranges if low <= alpha <= high)
        found = []
        for place, numbers in values.items():
            expected = min(said[place]) if len(said[place]) == 1 else rest
            low, high = min(numbers), max(numbers)
            if low >= expected and (high <= expected or not self.exact):
                continue
            if len(numbers) > 1 and said[place] and min(said[place]) <= low and high <= max(said[place]):
                continue  # the end of a range is only rounded
            count = self._words(low) if low == high or not self.exact else f"{self._words(low)} to {self._words(high)}"
            found.append(f"{count} {'at' if len(numbers) == 1 else 'near'} {place}")
        if len(found) > _SINGLE:
            return f"; other numbers at {len(found)} single alphas"
        return f"; {listed(found)}" if found else ""


def _joined(pieces: Iterable[tuple[float, float, int]]) -> list[tuple[float, float, int]]:
    """Pieces (low, high, number), of which neighbours with the same number are merged."""
    found: list[tuple[float, float, int]] = []
    for low, high, number in pieces:
        begin = found.pop()[0] if found and found[-1][2] == number else low
        found.append((begin, high, number))
    return found


def _rounded(alpha: float, digits: int) -> str:
    return f"{round(alpha, digits) + 0.0:.12g}"


@dataclass(frozen=True)
class Uniqueness:
    """Up to which alpha the solution is unique.

    Attributes
    ----------
    known : bool
        False for a graph with gaps: then only ``several_by`` is known.
    throughout : bool or None
        One solution at every alpha of the interval; None when that is not known.
    limit : float or None
        The alpha up to which there is one solution, from the interval's first alpha on; None when there is one
        throughout, and when that is not known.
    several_by : float or None
        There are several solutions at this alpha or right above it, so that the limit is not larger. None when no
        second solution was found.
    none_by : float or None
        There is no solution at this alpha or right above it, which happens to a body that nothing holds only. None when
        there is always one, and for a graph with gaps.
    """

    known: bool
    throughout: bool | None
    limit: float | None
    several_by: float | None
    none_by: float | None = None


class Claims:
    """Statements that the arcs and vertices found prove.

    Parameters
    ----------
    vertices : sequence of Vertex, in the order of alpha
    arcs : sequence of Arc
    interval : (Fraction, Fraction)
    standing : Standing
    held : bool
        The body is held, so that the indices of all solutions add up to +1.
    open_ranges : sequence of (Fraction, Fraction), optional
        Of a graph with gaps, in order: at all other alphas nothing is missing. Default: the interval.
    """

    def __init__(
        self,
        vertices: Sequence[Vertex],
        arcs: Sequence[Arc],
        interval: tuple[Fraction, Fraction],
        standing: Standing,
        *,
        held: bool = True,
        open_ranges: Sequence[Range] | None = None,
    ) -> None:
        self._vertices, self._arcs, self._interval = vertices, arcs, interval
        self.standing, self._held = standing, held
        self.open_ranges: tuple[Range, ...] = () if self.whole else (interval,)
        if not self.whole and open_ranges is not None:
            self.open_ranges = tuple(open_ranges)

    def __repr__(self) -> str:
        low, high = map(float, self._interval)
        arcs, vertices = counted(len(self._arcs), "arc"), counted(len(self._vertices), "vertex", "vertices")
        return f"Claims of {arcs} and {vertices} for alpha in [{low:g}, {high:g}]: {self.standing.value}"

    @property
    def whole(self) -> bool:
        """True if nothing is known to be missing: counts are then exact and not lower bounds."""
        return self.standing is not Standing.INCOMPLETE

    def knows(self, alpha: Fraction) -> bool:
        """True if nothing is known to be missing at this alpha."""
        return not any(low <= alpha <= high for low, high in self.open_ranges)

    @property
    def partly(self) -> bool:
        """True if something is missing, but not everywhere."""
        return not self.whole and self.open_ranges != (self._interval,)

    def multiplicity(self, alpha: Fraction) -> Multiplicity:
        """Number of solutions at an alpha of the interval, or its lower bound.

        It is a bound, too, where bounds of a vertex do not tell on which side of the alpha it lies.
        """
        point = CriticalAlpha.rational(rational(alpha))
        at = [v.exact for v in self._vertices if v.exact.compare(point) == 0]
        if not self.knows(alpha) or not all(place.is_rational for place in at):
            return Multiplicity(least_at(alpha, self._vertices, self._arcs, held=self._held), exact=False)
        over = sum(arc.passes_over(point) for arc in self._arcs)
        return Multiplicity(over + len(at), exact=True)

    def steps(self) -> MultiplicitySteps:
        """The number of solutions over the whole interval, or its lower bound."""
        if not self.whole:
            alphas, least, between = least_steps(self._interval, self._vertices, self._arcs, held=self._held)
            return MultiplicitySteps(tuple(map(Fraction, alphas)), tuple(least), tuple(between), exact=False)
        groups: list[list[Vertex]] = []
        for v in self._vertices:
            if groups and groups[-1][0].exact.compare(v.exact) == 0:
                groups[-1].append(v)
            else:
                groups.append([v])
        place = {v.number: k for k, group in enumerate(groups) for v in group}
        over, between = _cover(((place[arc.tail], place[arc.head]) for arc in self._arcs), len(groups))
        at = [passing + len(group) for group, passing in zip(groups, over, strict=True)]
        places = [Fraction(group[0].alpha) for group in groups]
        # where nothing holds the body there may be no solution at an end, and no vertex
        first, last = self._interval
        outer = [CriticalAlpha.rational(rational(end)) for end in (first, last)]
        if not groups or groups[0][0].exact.compare(outer[0]) > 0:
            places, at, between = [first, *places], [0, *at], [0, *between] if groups else []
        if not groups or groups[-1][0].exact.compare(outer[1]) < 0:
            places, at, between = [*places, last], [*at, 0], [*between, 0]
        return MultiplicitySteps(tuple(places), tuple(at), tuple(between), exact=True)

    def uniqueness(self) -> Uniqueness:
        """Up to which alpha the solution is unique, or what is known about it."""
        steps = self.steps()
        behind = (*steps.between, 1)
        found = [float(x) for x, n, m in zip(steps.alphas, steps.at, behind, strict=False) if max(n, m) > 1]
        # a continuum is one solution to be counted, and many to be told apart
        found += [v.alpha for v in self._vertices if v.family is not None] + [
            arc.lo for arc in self._arcs if arc.dimension
        ]
        several = min(found, default=None)
        if not self.whole:
            return Uniqueness(known=False, throughout=None, limit=None, several_by=several)
        none = min(
            (float(x) for x, n, m in zip(steps.alphas, steps.at, behind, strict=False) if min(n, m) == 0), default=None
        )
        limit = min((end for end in (several, none) if end is not None), default=None)
        return Uniqueness(known=True, throughout=limit is None, limit=limit, several_by=several, none_by=none)

    def sentences(self, bound: float | None) -> list[str]:
        """Answers to what a user asks first, as lines of text.

        Parameters
        ----------
        bound : float or None
            An alpha up to which uniqueness follows without any search.
        """
        found = self.uniqueness()
        if not found.known and found.several_by is None:
            line = "no second solution was found; whether there is one is not known"
        elif not found.known:
            line = f"several solutions at or right above alpha = {found.several_by:.8g}; where they begin is not known"
        elif found.limit is None:
            line = "one solution throughout"
        elif found.limit > self._interval[0]:
            line = f"one solution below alpha = {found.limit:.8g}"
        elif found.limit == found.several_by:
            line = "several solutions from the first alpha on"
        else:
            line = "no solution at or right above the first alpha"
        if found.none_by is not None and found.none_by > self._interval[0]:
            line += f"; none at or right above alpha = {found.none_by:.8g}"
        several = found.several_by
        if found.none_by is not None and several is None:
            line += "; nowhere several"
        elif found.none_by is not None and several is not None and several > found.none_by:
            line += f"; several at or right above alpha = {several:.8g}"
        where = self.steps().sentence()
        lines = [where, line] if where else [line]
        if self.standing is Standing.NOT_PROVEN:
            lines = [f"{line}, not proven" for line in lines]
        if self.partly:
            lines.append(f"all solutions are known but for {ranges_text(self.open_ranges)}")
        if bound is not None:
            lines.append(
                f"up to alpha = {bound:.8g} the stiffness alone rules out a second solution (estimate in floats)"
            )
        return lines


def ranges_text(ranges: Sequence[Range]) -> str:
    """Ranges of alpha in words, of many the first."""
    shown = [f"[{float(low):.8g}, {float(high):.8g}]" for low, high in ranges[:_SHOWN]]
    more = len(ranges) - len(shown)
    return "alpha in " + ", ".join(shown) + (f" and {counted(more, 'more range')}" if more else "")


def uniqueness_bound(problem: ContactProblem | ContactProblem3D, interval: tuple[float, float]) -> float | None:
    """An alpha up to which uniqueness follows without any search (theory, section 5.6), if there is one."""
    (a, b), p, condensed = interval, problem.p, problem.condensed
    F0, F1 = problem.affine_friction
    if not condensed.definite:  # within rounding, and the bound nearly zero
        return None
    inverse = np.linalg.inv(condensed.S)
    product = np.linalg.eigvalsh(inverse[:p, :p])[-1] * np.linalg.eigvalsh(condensed.S[p:, p:])[-1]
    largest = 1.0 / float(np.sqrt(product))
    if np.any(F0 + a * F1 >= largest):
        return None
    rising = F1 > 0
    reached = (largest - F0[rising]) / F1[rising]
    return min(b, float(np.min(reached, initial=np.inf)))


def _cover(spans: Iterable[tuple[int, int]], count: int) -> tuple[list[int], list[int]]:
    """Numbers of arcs that pass over each of ``count`` critical alphas, and over each interval between two of them."""
    through, beside = np.zeros((2, count + 1), dtype=int)
    for tail, head in spans:
        beside[tail] += 1
        beside[head] -= 1
        through[tail + 1] += 1
        through[head] -= 1
    return np.cumsum(through)[:-1].tolist(), np.cumsum(beside)[:-2].tolist()
