"""Directions in which nodes slip along an arc in 3D, enclosed over ranges of alpha (theory, section 15.6)."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.balls import Ball, hull
from enumsol.branches.space.make_curved import CurvedArcValues
from enumsol.branches.space.pieces import curve_between
from enumsol.search.space.curve_proposals import border_of_zeta, curve_along, curve_point, placed, proven_point
from enumsol.support.deadlines import look
from enumsol.trusted.motions_of_body import direction
from enumsol.trusted.space.curve_parts import CurveMotion, Place
from enumsol.trusted.space.solution_curve import SLIP, SolutionCurve, lies_in, parameter_in

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.branches.elements import Arc
    from enumsol.support.array_types import Floats
    from enumsol.trusted.space.solution_curve import AlphaProblem

#: Shares of the ways to the knots on both sides of a vertex at which a box over it ends: a longer one holds more
#: directions, and one that is too short is not proven, since rounding errors are as large.
_SHARES = (0.0, 2.0**-32, 2.0**-24, 2.0**-16, 2.0**-8, 1.0)
#: A part of an arc: the places at its ends, of which one may lie behind a vertex, and the curve that has both.
_Part = tuple[Place, SolutionCurve, Place]


class SlipDirections:
    """Directions of friction of the nodes that slip along an arc.

    The arc's curve is boxed again between its knots, and over its vertices up to the next knot there, where one other
    arc goes on; over shorter ranges of alpha in shorter boxes within these.

    Parameters
    ----------
    arc : Arc
    arcs : sequence of Arc
        All arcs of its graph.

    Raises
    ------
    TypeError
        The arc is not one of a graph in 3D.
    """

    def __init__(self, arc: Arc, arcs: Sequence[Arc]) -> None:
        values = arc._values
        if not isinstance(values, CurvedArcValues):
            raise TypeError("expected an arc of a graph in 3D")
        self._values: CurvedArcValues = values
        self._given: AlphaProblem = values.given
        self._nodes = [i for i, code in enumerate(values.codes) if code == SLIP]
        self._behind = [_knots_behind(arc, number, arcs) for number in (arc.tail, arc.head)]
        knots = placed(self._given, values.knots)
        borders = [border_of_zeta(self._given, border) for border in values.borders]
        # alpha rises from knot to knot, whichever way the curve went
        self._borders = [
            border * np.sign(border @ (end - start))
            for border, start, end in zip(borders, knots[:-1], knots[1:], strict=True)
        ]
        self._knots = knots
        self._parts: dict[int, _Part | None] = {}

    @property
    def turning(self) -> bool:
        """True if there are nodes whose directions may turn along the arc."""
        return any(len(self._given.tau[i]) > 1 for i in self._nodes)

    def at(self, alpha: float) -> Ball:
        """Directions at one alpha, (p, 2), in floats."""
        x = placed(self._given, self._values.point(alpha))
        near = curve_point(self._given, x, self._borders[0])
        found = self._none()
        if near is not None:
            for i in self._nodes:
                found[i] = self._direction(i, Ball.exact(near.z))
        return found

    def over(self, low: float, high: float) -> Ball | None:
        """Bounds of the directions at all alpha of the arc between two, (p, 2); None where they are not enclosed."""
        if not self._nodes:
            return self._none()
        found: list[Ball] = []
        for k in range(-1, len(self._borders) + 1):
            look()
            ends = self._ends(k)
            if ends is None:
                return None
            if ends[1] < low or ends[0] > high:
                continue
            part = self._part(k)
            if part is None:
                return None
            curve = part[1]
            if low > ends[0] or high < ends[1]:
                curve = self._shorter(part, k, max(low, ends[0]), min(high, ends[1])) or curve
            if (own := self._along(curve)) is None:
                return None
            found.append(own)
        return hull(found) if found else None

    # -- parts of the curve ----------------------------------------------------------------------------------------

    @cached_property
    def _alphas(self) -> list[tuple[float, float]] | None:
        """Bounds of alpha at all knots, if they are proven to be regular points."""
        own = [self._place(x, self._borders[max(k - 1, 0)]) for k, x in enumerate(self._knots)]
        known = [tuple(map(float, place.alphas)) for place in own if place is not None]
        # as floats outwards
        return [(np.nextafter(a, -np.inf), np.nextafter(b, np.inf)) for a, b in known] if None not in own else None

    def _ends(self, k: int) -> tuple[float, float] | None:
        """Bounds of the alphas of a part, of those at the ends without end; None where they are not known."""
        known, last = self._alphas, len(self._borders)
        if known is None:
            return None
        return -np.inf if k < 0 else known[k][0], np.inf if k == last else known[k + 1][1]

    def _part(self, k: int) -> _Part | None:
        """The part between two knots, before the first one (k = -1) or behind the last one."""
        if k not in self._parts:
            self._parts[k] = self._boxed(k)
        return self._parts[k]

    def _boxed(self, k: int) -> _Part | None:
        last = len(self._borders)
        border = self._borders[min(max(k, 0), last - 1)]
        if 0 <= k < last:
            return self._between(self._knots[k], self._knots[k + 1], border)
        own, behind = self._knots[:2] if k < 0 else self._knots[:-3:-1], self._behind[k == last]
        for share in _SHARES if len(behind) else ():
            inner, outer = (side[0] + share * (side[1] - side[0]) for side in (own, behind))
            part = self._between(*((outer, inner) if k < 0 else (inner, outer)), border, over=k)
            if part is not None:
                return part
        return None

    def _between(self, first: Floats, other: Floats, border: Floats, *, over: int = 0) -> _Part | None:
        """The part between two points; ``over`` is other than 0 if one of them lies behind a vertex."""
        start, end = self._place(first, border), self._place(other, border)
        if start is None or end is None:
            return None
        own = [place for place, behind in ((start, over < 0), (end, over > 0)) if not behind]
        # from its own point the arc goes on towards what lies behind the vertex
        if any(place.codes != self._values.codes or (over and place.rises <= 0) for place in own):
            return None
        curve = curve_between(start, end, border)
        return None if curve is None else (start, curve, end)

    def _place(self, x: Floats, border: Floats) -> Place | None:
        """A proven point of the curve near x."""
        found = proven_point(self._given, curve_point(self._given, x, border), border)
        return None if found is None else Place(found, CurveMotion(found, border))

    def _shorter(self, part: _Part, k: int, low: float, high: float) -> SolutionCurve | None:
        """A curve within a part that has all of its solutions between two alphas; None where none is proven."""
        if not 0 <= k < len(self._borders) or not low < high:
            return None
        start, whole, end = part
        border = self._borders[k]
        first, last = (placed(self._given, self._values.point(alpha)) for alpha in (low, high))
        curve = curve_along(self._given, (first, last), border, ())
        if curve is None:
            return None
        # boxes are convex
        half = curve.box.half
        if not (lies_in(whole.box, curve.at(-half)) and lies_in(whole.box, curve.at(half))):
            return None
        # its middle is on the arc, on which alpha rises from below the range to above it
        middle = curve.at(0.0)
        behind = parameter_in(whole.box, middle) - parameter_in(whole.box, start.point.at(0.0))
        ahead = parameter_in(whole.box, end.point.at(0.0)) - parameter_in(whole.box, middle)
        outer = curve.at(-half)[-1], curve.at(half)[-1]
        reaches = outer[0].mid + outer[0].rad < low and high < outer[1].mid - outer[1].rad
        return curve if reaches and behind.mid > behind.rad and ahead.mid > ahead.rad else None

    # -- directions ------------------------------------------------------------------------------------------------

    def _along(self, curve: SolutionCurve) -> Ball | None:
        """Directions at all points of a curve; None where a node has none."""
        z = Ball(curve.found.near.z.mid, curve.found.spread[1])
        found = self._none()
        for i in self._nodes:
            t = self._given.tau[i]
            if not float(np.hypot(*_two(z.rad[t]))) < float(np.hypot(*_two(z.mid[t]))):
                return None
            found[i] = self._direction(i, z)
        return found

    def _direction(self, i: int, z: Ball) -> Ball:
        """The direction of the tangential arguments of P at a node that slips: that of its friction."""
        t = self._given.tau[i]
        if len(t) == 2:
            return direction(z[t])[0]
        axis = (int(t[0]) // self._given.p) - 1
        return Ball.exact(np.sign(z.mid[t[0]]) * np.eye(2)[axis])

    def _none(self) -> Ball:
        return Ball.exact(np.zeros((self._given.p, 2)))


def _two(values: Floats) -> Floats:
    return np.append(values, 0.0)[:2]


def _knots_behind(arc: Arc, vertex: int, arcs: Sequence[Arc]) -> Floats:
    """The points of the only other arc that ends at a vertex, the next one first, (N, m + 1); none if it is not one."""
    ends = [(other, way) for other in arcs for way, number in ((1, other.tail), (-1, other.head)) if number == vertex]
    others = [(other, way) for other, way in ends if other is not arc]
    if len(others) != 1:
        return np.zeros((0, 0))
    values, way = others[0][0]._values, others[0][1]
    return placed(values.given, values.knots)[::way] if isinstance(values, CurvedArcValues) else np.zeros((0, 0))
