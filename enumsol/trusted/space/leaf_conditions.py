"""The inequalities of a leaf in 3D: in a box and along a parameter, and bounds of its solutions by them.

See theory, sections 12.3 and 12.9.

Those of slips and of sticking are in the units of ``slips`` and ``taus`` of FrictionUnits.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball, upper_norm
from enumsol.trusted.space.leaf_equations import (
    Leaf,
    State,
    around_middle,
)

if TYPE_CHECKING:
    from enumsol.support.array_types import Floats, Mask


def affine_conditions(leaf: Leaf, y: Ball, w: Ball, *, rates: bool = False) -> Ball:
    """Gaps of open nodes, normal forces of the others, slips along one axis, and distances from rigid bounds.

    All are affine in (y, w); their rates for ``rates`` of y and w.
    """
    bounded = np.isfinite(leaf.system.reach)
    rigid, reach = y[len(leaf.system.g) :][bounded], Ball.exact(leaf.system.reach[bounded])
    sides = (-rigid, rigid) if rates else (reach - rigid, reach + rigid)
    slid = Ball(leaf.way * w.mid[leaf.slid], w.rad[leaf.slid])
    return Ball.joined(-w[leaf.open], y[leaf.closed], slid, *sides)


def _sticking(leaf: Leaf, y: Ball) -> tuple[Floats, Floats]:
    """By how much |tau| is within its disc where nodes stick, as midpoints and radii; by |tau| in both."""
    scale, mid, rad = leaf.system.disc_scale, [], []
    for i, t in leaf.stick:
        units, disc = leaf.system.unit[t] * scale[i], leaf.system.discs[i]
        most, uncertain = y.mid[i] * scale[i] * disc.mid, y.rad[i] * scale[i] * (disc.mid + disc.rad)
        uncertain += abs(y.mid[i]) * scale[i] * disc.rad
        length = float(np.linalg.norm(y.mid[t] * units))
        uncertain += float(upper_norm(y.rad[t] * units)) + 16 * UNIT * (abs(most) + length)
        mid.append(most - length)
        rad.append(uncertain * SAFE + TINY)
    return np.array(mid), np.array(rad)


def _ahead(leaf: Leaf, w: Ball, angle: Floats, radius: Floats) -> tuple[Floats, Floats]:
    """v . d of the nodes in sectors, and v_1 d_1 and v_2 d_2 alone, as midpoints and radii, (3, q) each.

    Where G vanishes v = t d: none of the three is negative if t >= 0, and t > 0 if one is positive. A component
    alone tells where the rounding of the other would hide it, as its coefficient is much larger.
    """
    d, _ = leaf.directions(angle, radius)
    v1, v2 = leaf.slips(w)
    products = (v1 * d[:, 0] + v2 * d[:, 1], w[leaf.t[:, 0]] * d[:, 0], w[leaf.t[:, 1]] * d[:, 1])
    return np.array([product.mid for product in products]), np.array([product.rad for product in products])


def _conditions(leaf: Leaf, y: Ball, w: Ball) -> tuple[Floats, Floats]:
    """Conditions that a root has to satisfy but for directions, as midpoints and radii."""
    affine, (mid, rad) = affine_conditions(leaf, y, w), _sticking(leaf, y)
    return np.append(affine.mid, mid), np.append(affine.rad, rad)


def is_broken(leaf: Leaf, y: Ball, w: Ball, angle: Floats, radius: Floats) -> bool:
    """True if some condition is broken at every zero of G in the box."""
    (mid, rad), (forward, uncertain) = _conditions(leaf, y, w), _ahead(leaf, w, angle, radius)
    return bool(np.any(mid < -rad) or np.any(forward < -uncertain))


def slacks(leaf: Leaf, y: Ball, w: Ball, angle: Floats, radius: Floats) -> Floats:
    """Lower bounds of the conditions at zeros of G in the box; of directions, numbers of the same signs."""
    (mid, rad), (forward, uncertain) = _conditions(leaf, y, w), _ahead(leaf, w, angle, radius)
    return np.concatenate([mid - rad * SAFE, np.max(forward - uncertain * SAFE, axis=0)])


def are_outside(leaf: Leaf, angle: Floats, radius: Floats) -> Mask:
    """True for directions that are outside of their sectors for certain; what lies there belongs to another leaf."""
    q = len(leaf.turning)
    return np.abs(angle[:q]) - radius[:q] > leaf.half * (1.0 + 1e-9)


# -- along a parameter -------------------------------------------------------------------------------------------------


class Sweep(NamedTuple):
    """Bounds along a parameter t, |t| <= reach, which is s or another unknown: y, then w, are middle + t turn.

    The other unknowns are beside + t along; ``place`` is that of the parameter among all.
    """

    middle: Ball
    turn: Ball
    beside: Ball
    along: Ball
    reach: float
    place: int

    @property
    def by_alpha(self) -> bool:
        """True if the parameter is s."""
        return self.place == len(self.beside.mid)

    @property
    def unknowns(self) -> tuple[Ball, Ball]:
        """``beside`` and ``along`` of all unknowns, the parameter among them, s last."""
        beside, along = (
            Ball(np.insert(part.mid, self.place, own), np.insert(part.rad, self.place, 0.0))
            for part, own in ((self.beside, 0.0), (self.along, 1.0))
        )
        return beside, along


def parameters_allowed(leaf: Leaf, sweep: Sweep, angle: Floats, radius: Floats) -> tuple[float, float] | None:
    """Bounds of the parameter at all solutions in a box, as shares of its reach; None if there are none.

    Every condition is at most a + b t with some a and b in balls, and so is what is left to an end of a sector.
    """
    m, q, (middle, turn) = len(leaf.E), len(leaf.turning), sweep[:2]
    values = [affine_conditions(leaf, middle[:m], middle[m:])]
    rates = [affine_conditions(leaf, turn[:m], turn[m:], rates=True)]
    for value, rate in _sticking_along(leaf, sweep):
        values.append(value[None])
        rates.append(rate[None])
    if q:
        d, _ = leaf.directions(angle, radius)
        ahead, turned = (one * d[:, 0] + other * d[:, 1] for one, other in map(leaf.slips, (middle[m:], turn[m:])))
        beside, turns_by = (part[:q] for part in sweep.unknowns)
        values += [ahead, Ball.exact(leaf.half - angle[:q]) - beside, Ball.exact(leaf.half + angle[:q]) + beside]
        rates += [turned, -turns_by, turns_by]
    high, slope = Ball.joined(*values).high, Ball.joined(*rates)
    least, most = slope.low * sweep.reach, slope.high * sweep.reach
    slack = 8 * UNIT * (np.abs(high) + np.maximum(np.abs(least), np.abs(most))) + TINY
    if not np.all(np.isfinite(slack)):
        return -1.0, 1.0
    after, before = _allowed(high + slack, most + slack), _allowed(high + slack, slack - least)
    if after is None and before is None:
        return None
    low = -before[1] if before is not None else after[0] if after is not None else 0.0
    return low, after[1] if after is not None else -before[0] if before is not None else 0.0


def _allowed(high: Floats, slope: Floats) -> tuple[float, float] | None:
    """Bounds of the s from 0 to 1 at which no high + slope s is negative; None if there are none."""
    zero = -high / np.where(slope == 0, 1.0, slope)
    first = np.where(high < 0, np.where(slope > 0, zero, np.inf), 0.0)
    last = np.where((high >= 0) & (slope < 0), zero, np.inf)
    low, up = float(np.max(first, initial=0.0)) / SAFE, min(float(np.min(last, initial=1.0)) * SAFE, 1.0)
    return (low, up) if low <= up else None


def _sticking_along(leaf: Leaf, sweep: Sweep) -> list[tuple[Ball, Ball]]:
    """By how much nodes that stick are within their discs at most, and how that changes by the parameter."""
    turns, unit, (middle, turn), pairs = leaf.system.turn, leaf.system.unit, sweep[:2], []
    assert turns is not None
    for i, t in leaf.stick:
        # |tau| is at least e . tau with |e| = 1
        rubbed = unit[t] * middle.mid[t]
        length = float(np.linalg.norm(rubbed))
        e = (rubbed / length if length > 0 else np.zeros(len(t))) * unit[t]
        towards = Ball(e, 16 * UNIT * np.abs(e))[None]
        disc, disc_turn = turns.disc[i], turns.disc_turn[i]
        most, rate = (-(towards @ part[t][:, None])[0, 0] for part in (middle, turn))
        if sweep.by_alpha:
            bent = (disc_turn * turn[i]).size
            most, rate = disc * middle[i] + most, disc * turn[i] + disc_turn * middle[i] + rate
            most = Ball(most.mid, (most.rad + bent) * SAFE)
        else:
            disc = Ball(disc.mid, (disc.rad + disc_turn.size) * SAFE)
            most, rate = disc * middle[i] + most, disc * turn[i] + rate
        pairs.append((most, rate))
    return pairs


def condition_rates(
    leaf: Leaf, y: Ball, rates: tuple[Ball, Ball, Ball], angle: Floats, radius: Floats
) -> tuple[Floats, Floats]:
    """Rates of the conditions of ``slacks`` along an arc, by those of y, w and s, as midpoints and radii."""
    turn, unit, scale, (y_rate, w_rate, s_rate) = leaf.system.turn, leaf.system.unit, leaf.system.disc_scale, rates
    assert turn is not None
    found = [affine_conditions(leaf, y_rate, w_rate, rates=True)]
    for i, t in leaf.stick:
        size = Ball.exact(np.array(scale[i]))
        disc = turn.disc[i] + turn.disc_turn[i] * Ball(np.zeros(1), np.ones(1))[0]
        most = (disc * y_rate[i] + turn.disc_turn[i] * s_rate * y[i]) * size
        units = Ball.exact(unit[t] * scale[i])
        rubbed = y[t] * units
        length = float(np.linalg.norm(rubbed.mid)) / SAFE - float(np.linalg.norm(rubbed.rad)) * SAFE
        # (tau . tau') / |tau| is tau' times a vector of length one that is within rad of that in the middle
        towards = rubbed.mid / max(float(np.linalg.norm(rubbed.mid)), TINY)
        turned = 2.0 * float(np.linalg.norm(rubbed.rad)) / length * SAFE if length > 0 else 2.0
        direction = Ball(towards, np.full(len(t), min(turned, 2.0) + 8 * UNIT))
        found.append((most - (direction[None] @ (y_rate[t] * units)[:, None])[0, 0])[None])
    # v is along d at zeros of G, so that what turns d does not change v . d
    d, _ = leaf.directions(angle, radius)
    v1, v2 = leaf.slips(w_rate)
    all_rates = Ball.joined(*found, v1 * d[:, 0] + v2 * d[:, 1])
    return all_rates.mid, all_rates.rad


# -- over a piece of alpha --------------------------------------------------------------------------------------------


class Drift(NamedTuple):
    """Two bounds of y, then w, (2 m,), and of s, between which all solutions of a leaf lie over a piece of alpha.

    Every solution is in (1 - t) ``low`` + t ``high`` with a t from 0 to 1; s goes from -1 to 1 over the piece.
    """

    low: tuple[Ball, Ball]
    high: tuple[Ball, Ball]


def chosen_parameter(point: State, radius: Floats, *, by_alpha: bool = False) -> tuple[int, Floats] | None:
    """The place k of the unknown that changes most along the zeros of G in the middle, or of s if asked; and J_u^-1.

    J_u are the derivatives with respect to the other unknowns. None where they are singular.
    """
    q, k = len(radius), len(radius)
    J = point.whole_J.mid
    if q and not by_alpha:
        k = int(np.argmax(np.abs(np.linalg.svd(J * np.r_[radius, 1.0])[2][-1])))
    try:
        return k, np.asarray(np.linalg.inv(np.delete(J, k, axis=1)), dtype=np.float64)
    except np.linalg.LinAlgError:
        return None


def by_parameter(leaf: Leaf, over: tuple[State, State], k: int, others: Ball, along: Ball) -> tuple[Ball, Ball]:
    """y, then w, and their rates, to first order in z_k, the other unknowns being others + z_k along."""
    (state, point), places = over, np.delete(np.arange(len(others.mid) + 1), k)
    slopes = Ball.beside(state.box.slope, state.box.lone)
    turn = (slopes[:, places] @ along[:, None])[:, 0] + slopes[:, k]
    middle = Ball.joined(point.y, point.w) + (slopes[:, places] @ others[:, None])[:, 0]
    fixed = len(point.y.mid) + np.array([*leaf.rows, *leaf.loose], dtype=np.intp)
    for part in (middle, turn):
        part[fixed] = 0.0
    return middle, turn


def _swept(leaf: Leaf, angle: Floats, radius: Floats, *, by_alpha: bool = False) -> Sweep | None:
    """y, w and all unknowns z = (psi, s) at solutions in a box over a piece of alpha, to first order in one of z.

    That is the one that changes most along the zeros of G in the middle, or s if asked; the others are affine in it
    but for what is left over (``around_middle``), and so are y and w, by their derivatives.
    """
    state = leaf.over(angle, radius) if leaf.piece else None
    point = None if state is None else leaf.over(angle, 0.0 * radius, still=True)
    if state is None or point is None or not (state.whole_J.finite and point.whole_J.finite):
        return None
    chosen = chosen_parameter(point, radius, by_alpha=by_alpha)
    if chosen is None:
        return None
    (k, Y), sizes = chosen, np.r_[radius, 1.0]
    left, along, start = around_middle(leaf, Y, k, (angle, radius), (state, point))
    beside = left @ Ball(np.zeros(len(angle)), np.delete(sizes, k)) + start
    middle, turn = by_parameter(leaf, (state, point), k, beside, along)
    return Sweep(middle, turn, beside, along, float(sizes[k]), k)


def drift_in(leaf: Leaf, angle: Floats, radius: Floats) -> tuple[Drift | None, bool]:
    """Between which two bounds all solutions in a box lie over a piece of alpha; and whether there may be any."""
    sweep = _swept(leaf, angle, radius)
    allowed = None if sweep is None else parameters_allowed(leaf, sweep, angle, radius)
    if sweep is None or allowed is None:
        return None, sweep is None
    ends = []
    for share in allowed:
        t = Ball.exact(np.array(sweep.reach * share))
        s = t if sweep.by_alpha else sweep.beside[-1] + sweep.along[-1] * t
        ends.append((sweep.middle + sweep.turn * t, s))
    return Drift(*ends), True


def span_in(leaf: Leaf, angle: Floats, radius: Floats) -> tuple[float, float] | None:
    """Bounds of s at all solutions in a box over a piece of alpha; None if there are none."""
    sweep = _swept(leaf, angle, radius, by_alpha=True)
    return (-1.0, 1.0) if sweep is None else parameters_allowed(leaf, sweep, angle, radius)
