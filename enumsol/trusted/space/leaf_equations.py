"""The equations and inequalities of a leaf in 3D, over boxes of directions and pieces of alpha.

See theory, sections 12.3 and 12.9.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np
from scipy.linalg import qr

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball, smaller, solution, upper_norm, upper_sum
from enumsol.model.sectors import SECTORS, direction, end_number
from enumsol.trusted.space.sector_rows import OPEN, SLIP_MINUS, SLIP_PLUS, STICK
from enumsol.trusted.space.turning import LIBRARY, AngleBox, Combined, Turning, sums_of_both, turned_by

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.condensation.space_condensed import EnclosedSpace
    from enumsol.support.array_types import Codes, Floats, Mask

#: A sector's box of directions is this share of its width wider on both sides: a root on an end lies inside two boxes.
_WIDENED = 0.125
#: What is rounded of an angle between two directions.
ROUNDED_ANGLE = 1e-12
#: Rigid modes that move what the equations fix by no more than this, relatively, are left free by them.
_DEPENDENT = 1e-9
#: A normal force is left free where the linear equations change by this share over a sector.
_COUPLED = 0.0625


class State(NamedTuple):
    """y, w, G and dG/dpsi over a box of angles, and what they are made of."""

    y: Ball
    w: Ball
    G: Ball
    J: Ball
    box: AngleBox
    #: Derivatives of G along a piece of alpha.
    G_turn: Ball | None = None

    @property
    def whole_J(self) -> Ball:  # noqa: N802 (as J)
        """Derivatives with respect to psi and, over a piece of alpha, s."""
        return self.J if self.G_turn is None else Ball.beside(self.J, self.G_turn[:, None])


class Leaf:
    """Equations of a leaf: y = E(psi) x with x = (lambda_n of the nodes in contact, tau of the sticking ones).

    psi are angles of the slip directions d = cos psi c + sin psi c' from a direction c in every sector, c' a quarter
    turn further. P picks w_n of the nodes in contact and the slips of the sticking ones: P (g - S E x) = 0. The
    directions are zeros of G_i = v_i1 d_i2 - v_i2 d_i1.

    Of a body that nothing holds S and g are bordered (theory, (14.3)): -q is part of x and y, and P picks the rows of
    its equilibrium, too; but for rigid modes that move neither w_n nor the slips that P picks. Theirs are unknowns s
    beside psi, and their rows of equilibrium are zeros beside G (theory, section 14.6).

    Over a piece of alpha the normal force of a node in a sector may be left free, too, its w_n being a zero beside G:
    where P S E is singular, both together determine it (theory, section 12.9).

    In what follows ``angle`` and ``radius`` are a box of psi and of the free unknowns after them; ``still`` is in the
    middle of a piece of alpha, otherwise all of it is meant.

    Parameters
    ----------
    system : EnclosedSpace
    codes : complete
    loose : nodes in sectors whose normal forces are left free
    """

    def __init__(self, system: EnclosedSpace, codes: Sequence[int], loose: Sequence[int] = ()) -> None:
        self.system, self.codes, self.loose = system, codes, list(loose)
        tau, turn = system.tau, system.turn
        self.open = [i for i, code in enumerate(codes) if code == OPEN]
        self.closed = [i for i, code in enumerate(codes) if code != OPEN]
        sticking = [(i, [int(t) for t in tau[i] if t >= 0]) for i, code in enumerate(codes) if code == STICK]
        #: Nodes that stick and rub, with the places of their tau.
        self.stick = [(i, t) for i, t in sticking if t]
        self.sliding = [i for i in self.closed if codes[i] in (SLIP_PLUS, SLIP_MINUS)]
        #: Which tau is that of a node that slips along one axis, and its sign.
        self.slid = np.array([int(np.max(tau[i])) for i in self.sliding], dtype=np.intp)
        self.way = np.array([1.0 if codes[i] == SLIP_PLUS else -1.0 for i in self.sliding])
        self.turning = [i for i, code in enumerate(codes) if code > SECTORS]
        size, modes = len(system.g), len(system.reach)
        solved = [i for i in self.closed if i not in self.loose]
        self.rows = [*solved, *(t for _, places in self.stick for t in places)]
        free = self._free_modes() if modes else []
        self.free = [*self.loose, *(size + mode for mode in free)]
        #: How far the free unknowns may be from 0.
        self.room = np.append(np.full(len(self.loose), np.inf), system.reach[np.array(free, dtype=np.intp)])
        self.rows += [size + mode for mode in range(modes) if mode not in free]
        self.column = [-1 if i in self.loose else solved.index(i) for i in self.turning]
        self.t = tau[self.turning].reshape(-1, 2)
        self.piece = turn is not None
        self.discs: tuple[Ball, Ball | None] = system.discs[self.turning], None
        if turn is not None:
            self.discs = turn.disc[self.turning], turn.disc_turn[self.turning]
        # v = w / unit; slips as ``slips`` of FrictionUnits has them, which have the same directions
        self.slip_scale = system.slip_scale[self.turning][:, None] / system.unit[self.t]
        E = np.zeros((size + modes, len(self.rows)))
        E[self.rows, np.arange(len(self.rows))] = 1.0
        normals = np.array([solved.index(i) for i in self.sliding], dtype=np.intp)
        E[self.slid, normals] = self.way / system.unit[self.slid]
        self.E = E
        self.centre, self.half = _sector_boxes([codes[i] - SECTORS for i in self.turning])
        #: Angles up to which a root of the leaf is looked for.
        self.widened = (1.0 + 2.0 * _WIDENED) * self.half
        self._last: tuple[bytes, Turning | None] | None = None
        self._known: dict[tuple[bytes, bytes, bool], State | None] = {}

    def loosened(self) -> Self | None:
        """Over a piece of alpha, the leaf with the normal force left free that its equations determine least.

        None where they hardly change over the sectors.
        """
        if not self.piece or not self.turning or self.free:
            return None
        turning = self.equations(np.zeros(len(self.turning)))
        if turning is not None and np.max(np.sum(turning.coupling(self.widened), axis=1)) < _COUPLED:
            return None
        try:
            left, _, right = np.linalg.svd(self.middle_matrix(self.centre))
        except np.linalg.LinAlgError:
            return None
        # the minor without its row and column is largest
        least = int(np.argmax(np.abs(left[self.column, -1] * right[-1, self.column])))
        return type(self)(self.system, self.codes, [self.turning[least]])

    def middle_matrix(self, directions: Floats) -> Floats:
        """P S E for directions, (q, 2), as floats have it."""
        E = self.E.copy()
        E[self.t, np.array(self.column, dtype=np.intp)[:, None]] = directions / self.system.unit[self.t]
        return np.asarray((self.system.balls[0].mid @ E)[self.rows])

    def _free_modes(self) -> list[int]:
        """Rigid modes that the equations leave free, one of those that are no other ones' combinations there."""
        if not self.rows:
            return []
        moved = self.system.balls[0].mid[self.rows][:, len(self.system.g) :]
        _, R, order = qr(moved, mode="economic", pivoting=True)
        sizes = np.abs(np.diagonal(R))
        rank = int(np.sum(sizes > _DEPENDENT * np.max(np.abs(moved))))
        return sorted(order[rank:].tolist())

    # -- evaluation over a box -------------------------------------------------------------------------------------

    def directions(self, angle: Floats, radius: Floats) -> tuple[Ball, Ball]:
        """d (q, 2) and d' (q, 2) over a box of angles."""
        q = len(self.turning)
        mid_d, mid_turned = turned_by(self.centre, angle[:q])
        # |d(psi + r) - d(psi)| <= min(|d'(psi)| r + r^2 / 2, r), and d' likewise; libraries are off by a few units
        r = np.minimum(radius[:q], 2.0)[:, None]
        bent = 0.5 * r * r
        d = Ball(mid_d, np.minimum(np.abs(mid_turned) * r + bent, r) * SAFE + LIBRARY)
        return d, Ball(mid_turned, np.minimum(np.abs(mid_d) * r + bent, r) * SAFE + LIBRARY)

    def slips(self, w: Ball) -> tuple[Ball, Ball]:
        """Both components of v at the nodes in sectors, times ``slip_scale`` of FrictionUnits; ``w`` by rows."""
        first, second = (w[self.t[:, k]] for k in (0, 1))
        scales = (self.slip_scale[:, k].reshape(-1, *[1] * (w.mid.ndim - 1)) for k in (0, 1))
        pairs = zip((first, second), scales, strict=True)
        one, other = (Ball(part.mid * scale, part.rad * scale) for part, scale in pairs)
        return one, other

    def equations(self, angle: Floats) -> Turning | None:
        """The linear equations with the directions at these angles in the middle; None if not proven regular there."""
        angle = angle[: len(self.turning)]
        key = angle.tobytes()
        if self._last is None or self._last[0] != key:
            directions = turned_by(self.centre, angle)
            at = self.rows, self.column, self.t
            loose = [self.turning.index(i) for i in self.loose]
            self._last = key, Turning.of(self.system, self.E, at, directions, self.discs, self.free, loose)
        return self._last[1]

    def over(self, angle: Floats, radius: Floats, *, still: bool = False) -> State | None:
        """y, w, G and dG/dpsi over a box; None where the linear system is not proven regular in it."""
        key = angle.tobytes(), radius.tobytes(), still
        if key not in self._known:
            self._known[key] = self._evaluated(angle, radius, still=still)
        return self._known[key]

    def _evaluated(self, angle: Floats, radius: Floats, *, still: bool) -> State | None:
        turning = self.equations(angle)
        q = len(self.turning)
        free = Ball(angle[q:], radius[q:])
        if self.piece:
            free = Ball.joined(free, Ball(np.zeros(1), np.full(1, 0.0 if still else 1.0)))
        box = None if turning is None else turning.over(radius[:q], free)
        if box is None:
            return None
        (v1, v2), (dv1, dv2) = self.slips(box.w), self.slips(box.dw)
        d, turned = self.directions(angle, radius)
        d1, d2 = d[:, 0], d[:, 1]
        J = dv1 * d2[:, None] - dv2 * d1[:, None]
        diagonal = np.arange(q)
        J[diagonal, diagonal] = J[diagonal, diagonal] + (v1 * turned[:, 1] - v2 * turned[:, 0])
        G = v1 * d2 - v2 * d1
        if self.free or self.piece:
            (s1, s2), w = self.slips(box.ds), box.w[self.free]
            G = Ball.joined(G, w)
            across = Ball.joined(s1 * d2[:, None] - s2 * d1[:, None], box.ds[self.free])
            along = Ball.joined(J, box.dw[self.free])
            J = Ball.beside(along, across)
        w = box.w.copy()
        w[self.loose] = 0.0
        return State(box.y, w, G, J[:, :-1], box, J[:, -1]) if self.piece else State(box.y, w, G, J, box)

    def bends(self, Y: Floats, over: tuple[State, State], angle: Floats, radius: Floats) -> tuple[Combined, Floats]:
        """Rows of w that Y G has for directions that are held, and how much Y dG/dpsi differs over the box, (n, q).

        The latter bounds sums over k of the sizes of Y times the second derivatives by angles j and k times ``radius``.
        ``over``: the states over the box and in its middle.
        """
        (state, point), (d, turned), q = over, self.directions(angle, radius), len(self.turning)
        # v_i1 d_i2 - v_i2 d_i1
        rows = Ball(np.zeros((len(Y), len(state.box.w.mid))), np.zeros((len(Y), len(state.box.w.mid))))
        scale = Ball.exact(Y[:, :q]), Ball.exact(self.slip_scale)
        rows[:, self.free] = Ball.exact(Y[:, q:])
        for k, part in enumerate((d[:, 1], -d[:, 0])):
            rows[:, self.t[:, k]] = scale[0] * (scale[1][:, k] * part)
        w = state.box.combined(rows, point.box, radius[:q])
        beside, own = w.bends(radius[:q])
        # psi_i turns d_i itself, in both orders, and d_i'' = -d_i
        (dv1, dv2), (v1, v2) = (self.slips(part) for part in (state.box.dw, state.box.w))
        turn = dv1 * turned[:, 1][:, None] - dv2 * turned[:, 0][:, None]
        twice = Ball(np.diagonal(turn.mid), np.diagonal(turn.rad))
        own = own + scale[0] * (twice + twice + (v2 * d[:, 0] - v1 * d[:, 1]))
        beside = beside + sums_of_both(np.abs(scale[0].mid), turn.size, radius[:q])
        return w, np.asarray((beside + own.size * radius[:q]) * SAFE + TINY)

    def second(self, Y: Floats, over: tuple[State, State], angle: Floats, radius: Floats) -> tuple[Floats, Floats]:
        """Bounds of how Y times the derivatives by n unknowns and s differ, over a box and a piece, (n, n + 1) each.

        The first bounds sums over the unknowns k of the sizes of Y times the second derivatives times ``radius``, the
        second is the size of those by s.
        """
        (w, bends), n, q = self.bends(Y, over, angle, radius), len(angle), len(self.turning)
        (s1, s2), (_, turned) = self.slips(over[0].box.ds), self.directions(angle, radius)
        turn = Ball.exact(Y[:, :q])[:, :, None] * (s1 * turned[:, 1][:, None] - s2 * turned[:, 0][:, None])
        by_angle, swept = w.loosened()
        loose, mixed = (by_angle + turn[:, :, :-1]).size, (w.mixed() + turn[:, :, -1]).size
        along = np.column_stack([mixed, swept.size, w.twice().size])
        over_box = np.zeros((n, n + 1))
        over_box[:, :q] = (bends + upper_sum(loose * radius[q:], axis=2)) * SAFE
        over_box[:, q:n] = upper_sum(loose * radius[:q, None], axis=1)
        over_box[:, n] = upper_sum(along[:, :n] * radius, axis=1)
        return over_box, along


def _sector_boxes(numbers: Sequence[int]) -> tuple[Floats, Floats]:
    """A direction in the middle of every sector, and an angle on both sides that covers it."""
    centres, halves = [], []
    for number in numbers:
        a, b = (np.array(direction(n)) for n in (number, end_number(number)))
        c = a + b
        c /= np.hypot(*c)
        # the angle to an end is 2 arcsin(|a - c| / 2), at most 1.12 |a - c| for sectors of a quarter
        halves.append(1.12 * max(np.hypot(*(a - c)), np.hypot(*(b - c))) + 1e-14)
        centres.append(c)
    return np.array(centres).reshape(-1, 2), np.array(halves)


def patterns(codes: Sequence[int]) -> Codes:
    """Statuses, one code for all sectors."""
    return tuple(min(code, SECTORS) for code in codes)


def turned(one: Floats, other: Floats) -> Floats:
    """Angles from directions to others, (q,), for which ``ROUNDED_ANGLE`` has room."""
    return np.asarray(np.arctan2(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0], np.sum(one * other, axis=1)))


def slopes_by_second(inverse: Ball, point: Ball, box: Ball, beside: Floats) -> Ball:
    """Y dG over a box, by dG there, or by that in its middle and how much Y dG differs ``beside`` it."""
    middle = inverse @ point
    return smaller(Ball(middle.mid, (middle.rad + beside) * SAFE), inverse @ box)


def around_middle(
    leaf: Leaf, Y: Floats, k: int, box: tuple[Floats, Floats], over: tuple[State, State]
) -> tuple[Ball, Ball, Ball]:
    """I - Y J_u and -Y J_k of (12.22) over a box and a piece, and where u is but for z_k (-Y J_k).

    z = (psi, s), u being all of these but z_k. For all zeros in the box u is in (I - Y J_u) u + z_k (-Y J_k) - Y G(c).
    At one alpha there is no s, and nothing along it. ``over``: see ``Leaf.bends``.
    """
    (angle, radius), (state, point), q = box, over, len(box[0])
    if not q:
        return Ball.exact(np.zeros((0, 0))), Ball.exact(np.zeros(0)), Ball.exact(np.zeros(0))
    inverse, others = Ball.exact(Y), np.delete(np.arange(q + 1), k)
    if leaf.piece:
        turned, swept = leaf.second(Y, over, angle, radius)
        slope = slopes_by_second(inverse, point.whole_J, state.whole_J, (turned + swept) * SAFE)
        along = -slope[:, k]
    else:
        known = None if leaf.free else leaf.bends(Y, over, angle, radius)[1]
        slope = inverse @ state.J if known is None else slopes_by_second(inverse, point.J, state.J, known)
        along = Ball.exact(np.zeros(q))
    left = Ball.exact(np.eye(q)) - slope[:, others]
    return left, along, left @ Ball(np.zeros(q), np.append(radius, 1.0)[others]) - inverse @ point.G


def with_free_bounds(leaf: Leaf, angle: Floats, radius: Floats, *, still: bool = False) -> tuple[Floats, Floats] | None:
    """The box with the free unknowns that its angles leave; None if there are none.

    G and the rows beside it are affine in them: G = G_0 + R s, so that (Y R) s = -Y G_0 with any Y.
    """
    q = len(leaf.turning)
    none = np.r_[angle[:q], 0.0 * angle[q:]]
    state = leaf.over(none, np.r_[radius[:q], 0.0 * angle[q:]], still=still)
    if state is None or not (state.G.finite and state.J.finite):
        return angle, radius
    R = state.J[:, q:]
    Y = Ball.exact(np.asarray(np.linalg.pinv(R.mid), dtype=np.float64))
    found = solution(Y @ R, Y @ -state.G[:, None])
    if found is None:
        return angle, radius
    low = np.maximum((found.mid - found.rad)[:, 0], angle[q:] - radius[q:])
    high = np.minimum((found.mid + found.rad)[:, 0], angle[q:] + radius[q:])
    known = np.where(np.isfinite(radius[q:]), np.abs(angle[q:]) + radius[q:], 0.0)
    slack = 8 * UNIT * (found.size[:, 0] + known)
    if np.any(low - slack > high + slack):
        return None
    middle = 0.5 * (low + high)
    wide = np.maximum(high - middle, middle - low) * SAFE + slack + TINY
    return np.r_[angle[:q], middle], np.r_[radius[:q], np.maximum(wide, 0.0)]


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
    _, along, beside = around_middle(leaf, Y, k, (angle, radius), (state, point))
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
