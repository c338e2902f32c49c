"""How many solutions there are at least, as a graph with gaps proves it: the one place that counts them.

Counted are arcs of regular roots, settled vertices, pieces of settled vertices and arcs that lead past an alpha, and
one more solution where another is known to exist, if only because the indices of all solutions add up to +1. Why no
solution is counted twice, and none that does not exist: theory, section 7.13.
"""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass, field
from itertools import accumulate
from math import inf, nextafter
from typing import TYPE_CHECKING

from networkx.utils import UnionFind

from enumsol.arithmetic.algebraic import CriticalAlpha
from enumsol.arithmetic.rationals import rational
from enumsol.branches.elements import VertexKind, index_sum

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from fractions import Fraction

    from enumsol.branches.elements import Arc, Vertex


@dataclass
class _Tally:
    """What is known at one alpha, or at all alphas between two neighbouring floats.

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
    tally = _Tally(
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
    here = [_Tally() for _ in range(positions.count)]
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
