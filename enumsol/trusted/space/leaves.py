"""The trusted core in 3D: what a leaf holds, by Krawczyk's operator on balls (theory, section 12.3).

A leaf gives every node a status: open, in contact without friction, slip+ or slip- along one axis, stick, or a sector
of slip directions. What is concluded here holds for all data in the balls.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np
from scipy.linalg import qr

from enumsol.arithmetic.balls import (
    SAFE,
    TINY,
    UNIT,
    Ball,
    determinant_sign,
    nearly_singular,
    rough_inverse,
    smaller,
    solution,
    upper_norm,
    upper_sum,
)
from enumsol.model.sectors import SECTORS, direction, end_number
from enumsol.trusted.same_roots import Apart, told_apart
from enumsol.trusted.space.sector_rows import OPEN, SLIP_PLUS, STICK
from enumsol.trusted.space.turning import LIBRARY, AngleBox, Combined, Turning, turned_by

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from enumsol.condensation.space_condensed import EnclosedSpace
    from enumsol.support.array_types import Floats, Mask

    _RootLeaf = tuple[tuple[int, ...], "SpaceRoot"]


#: A sector's box of directions is this share of its width wider on both sides: a root on an end lies inside two boxes.
_WIDENED = 0.125
#: Contractions of a box before the leaf is given up.
_CONTRACTIONS = 10
#: Contractions of a box that holds exactly one zero, down to rounding.
_REFINEMENTS = 60
#: The same over a piece of alpha, over which the zero moves.
_OVER_PIECE = 2
#: What is rounded of an angle between two directions.
ROUNDED_ANGLE = 1e-12
#: Boxes of directions narrower than this hold a point, and forces known no better are not known; neither is halved for.
_POINT = 2.0**-24
#: Rigid modes that move what the equations fix by no more than this, relatively, are left free by them.
_DEPENDENT = 1e-9
#: Directions that change no G by more (scaled) are not halved, nor for a linear system that they change by no more.
_NEGLIGIBLE, _SINGULAR = 2.0**-44, 2.0**-36
#: A normal force is left free where the linear equations change by this share over a sector.
_COUPLED = 0.0625


def _cut(angle: Floats, radius: Floats, reach: Floats, move: Ball) -> tuple[Floats, Floats]:
    """The part of a box of angles that lies within ``move`` of its centre."""
    low, high = np.maximum(move.mid - move.rad, -radius), np.minimum(move.mid + move.rad, radius)
    middle = 0.5 * (low + high)
    # low, high, their middle and the new centre are rounded by less than a unit each
    return angle + middle, np.maximum(high - middle, middle - low) * SAFE + 4 * UNIT * reach


class Drift(NamedTuple):
    """Two bounds of y, then w, (2 m,), and of s, between which all solutions of a leaf lie over a piece of alpha.

    Every solution is in (1 - t) ``low`` + t ``high`` with a t from 0 to 1; s goes from -1 to 1 over the piece.
    """

    low: tuple[Ball, Ball]
    high: tuple[Ball, Ball]


class _Sweep(NamedTuple):
    """Bounds along a parameter t, |t| <= reach, which is s or one of the directions: y, then w, are middle + t turn.

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


def _allowed(high: Floats, slope: Floats) -> tuple[float, float] | None:
    """Bounds of the s from 0 to 1 at which no high + slope s is negative; None if there are none."""
    zero = -high / np.where(slope == 0, 1.0, slope)
    first = np.where(high < 0, np.where(slope > 0, zero, np.inf), 0.0)
    last = np.where((high >= 0) & (slope < 0), zero, np.inf)
    low, up = float(np.max(first, initial=0.0)) / SAFE, min(float(np.min(last, initial=1.0)) * SAFE, 1.0)
    return (low, up) if low <= up else None


@dataclass(frozen=True)
class SpaceRoot:
    """Exactly one root in a box of directions, regular: all conditions hold strictly.

    Attributes
    ----------
    y, w : Ball of shape (m,)
        Forces (lambda_n, tau) and displacements, scaled.
    centre : (q, 2) array
        A direction for every node in a sector; angles count from there.
    angle, angle_rad : (q,) arrays
        The root's directions.
    reach : (q,) array
        There is no other root with these statuses and angles up to ``reach``.
    index : int
    slack : float
        A lower bound of the least slack.
    rigid : Ball of shape (r,), or None
        Of a body that nothing holds, the coordinates q of its rigid displacement.
    drift : Drift or None
        Over a piece of alpha.
    """

    y: Ball
    w: Ball
    centre: Floats
    angle: Floats
    angle_rad: Floats
    reach: Floats
    index: int
    slack: float
    rigid: Ball | None = None
    drift: Drift | None = None


class Cause(Enum):
    """Why a leaf is not settled."""

    EQUALITY = "a condition holds with equality, or nearly so, at what may be a root"
    DIRECTIONS = "slip directions are not isolated, or hardly so, at what may be a root: a fold or a continuum is near"
    EQUATIONS = "the equations of its statuses are singular, or nearly so, for some slip directions: the body may wedge"
    RIGID = "the equations of its statuses leave the body free to move as a whole, or nearly so"
    ROUNDING = "rounding leaves the forces there open: the body is almost free to move"


@dataclass(frozen=True)
class Open:
    """A leaf that is not settled, with bounds of all solutions in it.

    Attributes
    ----------
    node : int or None
        The node whose sector is to be halved, the widest; None where that is not expected to help.
    y, w : Ball of shape (m,), or None
        As in SpaceRoot; None where the linear system is not proven regular in the box.
    centre : (q, 2) array
    angle, angle_rad : (q,) arrays
        As in SpaceRoot.
    cause : Cause
        What stands in the way, as computed in the middle of the box; no claim.
    mode : int or None
        The rigid mode that is free for that cause.
    drift : Drift or None
        Over a piece of alpha, where it is known.
    swept : bool
        Whether rather the piece of alpha stands in the way than the widths of sectors, as computed; no claim.
    span : pair of floats
        Over a piece of alpha, bounds of s, from -1 to 1, at all solutions in it.
    rigid : Ball of shape (r,), or None
        As in SpaceRoot; None where y is.
    """

    node: int | None
    y: Ball | None
    w: Ball | None
    centre: Floats
    angle: Floats
    angle_rad: Floats
    cause: Cause
    mode: int | None = None
    drift: Drift | None = None
    swept: bool = False
    span: tuple[float, float] = (-1.0, 1.0)
    rigid: Ball | None = None

    def tells_more(self, other: Open) -> bool:
        """True if this leaves less of a piece open than ``other``, or has bounds where that has none; no claim."""
        shorter = self.span[1] - self.span[0] < other.span[1] - other.span[0]
        return self.y is not None and (other.y is None or shorter)


def settle(system: EnclosedSpace, codes: Sequence[int]) -> SpaceRoot | Open | None:
    """Contents of a leaf: exactly one root in its box, no root (None), or it is not settled."""
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        leaf = Leaf(system, codes)
        found = leaf.settle()
        loosened = leaf.loosened() if isinstance(found, Open) else None
        again = found if loosened is None else loosened.settle()
        return found if isinstance(again, Open) and isinstance(found, Open) and found.tells_more(again) else again


def unsettled(system: EnclosedSpace, codes: Sequence[int]) -> Open:
    """A leaf of which nothing is known but its sectors."""
    leaf = Leaf(system, codes)
    return Open(None, None, None, leaf.centre, np.zeros(len(leaf.half)), leaf.half, Cause.EQUALITY)


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
        """Derivatives with respect to (psi, s), over a piece of alpha."""
        assert self.G_turn is not None
        return Ball.beside(self.J, self.G_turn[:, None])


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

    Parameters
    ----------
    system : EnclosedSpace
    codes : complete
    loose : nodes in sectors whose normal forces are left free
    """

    def __init__(self, system: EnclosedSpace, codes: Sequence[int], loose: Sequence[int] = ()) -> None:
        self.system, self.codes, self.loose = system, codes, list(loose)
        tau = system.tau
        self.open = [i for i, code in enumerate(codes) if code == OPEN]
        self.closed = [i for i, code in enumerate(codes) if code != OPEN]
        self.stick = [i for i, code in enumerate(codes) if code == STICK]
        self.sliding = [(i, 1.0 if codes[i] == SLIP_PLUS else -1.0) for i in self.closed if codes[i] in (2, 3)]
        self.turning = [i for i, code in enumerate(codes) if code > SECTORS]
        self.numbers = [codes[i] - SECTORS for i in self.turning]
        size, modes = len(system.g), len(system.reach)
        solved = [i for i in self.closed if i not in self.loose]
        self.rows = [*solved, *(int(t) for i in self.stick for t in tau[i] if t >= 0)]
        free = self._free_modes() if modes else []
        self.free = [*self.loose, *(size + mode for mode in free)]
        self.rows += [size + mode for mode in range(modes) if mode not in free]
        self.column = [-1 if i in self.loose else solved.index(i) for i in self.turning]
        self.t = tau[self.turning].reshape(-1, 2)
        turn = system.turn
        self.piece = turn is not None
        self.discs: tuple[Ball, Ball | None] = system.discs[self.turning], None
        if turn is not None:
            self.discs = turn.disc[self.turning], turn.disc_turn[self.turning]
        # v = w / unit; slips as ``slips`` of FrictionUnits has them, which have the same directions
        self.slip_scale = system.slip_scale[self.turning][:, None] / system.unit[self.t]
        E = np.zeros((size + modes, len(self.rows)))
        E[self.rows, np.arange(len(self.rows))] = 1.0
        for i, sign in self.sliding:
            along = int(np.max(tau[i]))
            E[along, solved.index(i)] = sign / system.unit[along]
        self.E = E
        self.centre, self.half = self._boxes()
        self._last: tuple[bytes, Turning | None] | None = None
        self._known: dict[tuple[bytes, bytes, bool], State | None] = {}

    def loosened(self) -> Self | None:
        """Over a piece of alpha, the leaf with the normal force left free that its equations determine least.

        None where they hardly change over the sectors.
        """
        if not self.piece or not self.turning or self.free:
            return None
        turning, turns = self._turning(np.zeros(len(self.turning))), (1.0 + 2.0 * _WIDENED) * self.half
        if turning is not None and np.max(np.sum(turning.coupling(turns), axis=1)) < _COUPLED:
            return None
        E = self.E.copy()
        E[self.t, np.array(self.column, dtype=np.intp)[:, None]] = self.centre / self.system.unit[self.t]
        try:
            left, _, right = np.linalg.svd((self.system.balls[0].mid @ E)[self.rows])
        except np.linalg.LinAlgError:
            return None
        # the minor without its row and column is largest
        least = int(np.argmax(np.abs(left[self.column, -1] * right[-1, self.column])))
        return type(self)(self.system, self.codes, [self.turning[least]])

    def _free_modes(self) -> list[int]:
        """Rigid modes that the equations leave free, one of those that are no other ones' combinations there."""
        if not self.rows:
            return []
        moved = self.system.balls[0].mid[self.rows][:, len(self.system.g) :]
        _, R, order = qr(moved, mode="economic", pivoting=True)
        sizes = np.abs(np.diagonal(R))
        rank = int(np.sum(sizes > _DEPENDENT * np.max(np.abs(moved))))
        return sorted(order[rank:].tolist())

    def _boxes(self) -> tuple[Floats, Floats]:
        """A direction in the middle of every sector, and an angle on both sides that covers it."""
        centres, halves = [], []
        for number in self.numbers:
            a, b = (np.array(direction(n)) for n in (number, end_number(number)))
            c = a + b
            c /= np.hypot(*c)
            # the angle to an end is 2 arcsin(|a - c| / 2), at most 1.12 |a - c| for sectors of a quarter
            halves.append(1.12 * max(np.hypot(*(a - c)), np.hypot(*(b - c))) + 1e-14)
            centres.append(c)
        return np.array(centres).reshape(-1, 2), np.array(halves)

    # -- what the leaf holds ---------------------------------------------------------------------------------------

    def settle(self) -> SpaceRoot | Open | None:
        """Angles in what follows are the values of the free unknowns, too, after those of the directions."""
        q, modes = len(self.turning), np.array(self.free[len(self.loose) :], dtype=np.intp) - len(self.system.g)
        turns = (1.0 + 2.0 * _WIDENED) * self.half
        radius = np.r_[turns, np.full(len(self.loose), np.inf), self.system.reach[modes]]
        angle = np.zeros(len(radius))
        state, rough = None, False
        for _ in range(_CONTRACTIONS):
            if self.free:
                cut = self._cut_free(angle, radius)
                if cut is None:
                    return None
                angle, radius = cut
                if not np.all(np.isfinite(radius)):
                    break
            reach = np.r_[turns, np.abs(angle[q:]) + radius[q:]]
            state = self._state(angle, radius) or state
            if state is None:
                break
            if self._broken(state.y, state.w, angle, radius) or np.any(self._outside(angle, radius)):
                return None
            if not len(angle):
                return self._root(state, angle, radius, reach)
            new_angle, new_radius = angle, radius
            move = self._move(angle, radius, state, rough=rough)
            if move is not None:
                if np.any(np.abs(move.mid) > (move.rad + radius) * SAFE):
                    return None
                new_angle, new_radius = _cut(angle, radius, reach, move)
                # the box holds exactly one zero
                if np.all(move.size < radius):
                    return self._refined(new_angle, new_radius, reach)
            if np.any(new_radius <= 0.9 * radius):
                angle, radius = new_angle, new_radius
            elif rough or (move is not None and not nearly_singular(state.J.mid)):
                break
            else:
                rough = True
        return self._left_open(angle, radius, state)

    def _cut_free(self, angle: Floats, radius: Floats, *, still: bool = False) -> tuple[Floats, Floats] | None:
        """The box with the free unknowns that its angles leave; None if there are none.

        G and the rows beside it are affine in them: G = G_0 + R s, so that (Y R) s = -Y G_0 with any Y. Over all of a
        piece of alpha, or ``still`` in its middle.
        """
        q = len(self.turning)
        none = np.r_[angle[:q], 0.0 * angle[q:]]
        state = self._state(none, np.r_[radius[:q], 0.0 * angle[q:]], still=still)
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

    def _move(self, angle: Floats, radius: Floats, state: State, *, rough: bool = False) -> Ball | None:
        """Krawczyk's operator: a ball of psi - angle for all zeros psi in a box over which the state is known."""
        found = self._moves(angle, radius, state, rough=rough)
        if found is None:
            return None
        move, along = found
        # from the middle of a piece to any alpha, the angles held, then to any angles
        return move if along is None else Ball(move.mid, (move.rad + along.size) * SAFE)

    def _moves(
        self, angle: Floats, radius: Floats, state: State, *, rough: bool = False
    ) -> tuple[Ball, Ball | None] | None:
        """Balls u and v: psi - angle is in u for all zeros psi in a box, or over a piece of alpha in u + s v at s.

        ``rough``: only in the directions in which dG/dpsi is surely not singular, so that those of other nodes are cut.
        """
        q = len(angle)
        point = self._state(angle, np.zeros(q), still=True)
        if point is None or not (state.J.finite and point.J.finite):
            return None
        try:
            Y = np.asarray(rough_inverse(state.J) if rough else np.linalg.inv(point.J.mid), dtype=np.float64)
        except np.linalg.LinAlgError:
            return None
        if self.piece:
            return self._along(Y, q, angle, radius, state, point)
        inverse, span = Ball.exact(Y), Ball(np.zeros(q), radius)
        if self.free:
            return (Ball.exact(np.eye(q)) - inverse @ state.J) @ span - inverse @ point.G, None
        slope = self._preconditioned(inverse, point.J, state.J, self._bends(Y, (state, point), angle, radius), radius)
        return (Ball.exact(np.eye(q)) - slope) @ span - inverse @ point.G, None

    @staticmethod
    def _preconditioned(inverse: Ball, point: Ball, box: Ball, second: Ball, reach: Floats) -> Ball:
        """Y dG over a box, by Y times the second derivatives there."""
        middle = inverse @ point
        beside = upper_sum(second.size * reach, axis=2)
        return smaller(Ball(middle.mid, (middle.rad + beside) * SAFE), inverse @ box)

    def _along(self, Y: Floats, k: int, angle: Floats, radius: Floats, state: State, point: State) -> tuple[Ball, Ball]:
        """Balls u and v over a piece: for all zeros z = (psi - angle, s) in a box z without z_k is in u + z_k v."""
        left, along, middle = self._around(Y, k, angle, radius, state, point)
        others = np.delete(np.r_[radius, 1.0], k)
        return left @ Ball(np.zeros(len(angle)), others) + middle, along

    def _around(
        self, Y: Floats, k: int, angle: Floats, radius: Floats, state: State, point: State
    ) -> tuple[Ball, Ball, Ball]:
        """I - Y J_u, -Y J_k and -Y G(c) of (12.22d) over a box and a piece."""
        q = len(angle)
        if not q:
            return Ball.exact(np.zeros((0, 0))), Ball.exact(np.zeros(0)), Ball.exact(np.zeros(0))
        inverse, second = Ball.exact(Y), self._second(Y, (state, point), angle, radius)
        slope = self._preconditioned(inverse, point.whole_J, state.whole_J, second, np.r_[radius, 1.0])
        others = np.delete(np.arange(q + 1), k)
        return Ball.exact(np.eye(q)) - slope[:, others], -slope[:, k], -(inverse @ point.G)

    def _swept(self, angle: Floats, radius: Floats, *, by_alpha: bool = False) -> _Sweep | None:
        """y, w and all unknowns z = (psi, s) at solutions in a box over a piece of alpha, to first order in one of z.

        That is the one that changes most along the zeros of G in the middle, or s if asked; the others are affine in it
        but for what is left over (``_along``), and so are y and w, by their derivatives.
        """
        q = len(angle)
        state = self._state(angle, radius) if self.piece else None
        point = None if state is None else self._state(angle, 0.0 * radius, still=True)
        if state is None or point is None or not (state.whole_J.finite and point.J.finite):
            return None
        slopes, k = Ball.beside(state.box.slope, state.box.lone), q
        beside, along = Ball.exact(np.zeros(0)), Ball.exact(np.zeros(0))
        sizes = np.r_[radius, 1.0]
        if q:
            J = point.whole_J.mid
            k = q if by_alpha else int(np.argmax(np.abs(np.linalg.svd(J * sizes)[2][-1])))
            try:
                Y = np.asarray(np.linalg.inv(np.delete(J, k, axis=1)), dtype=np.float64)
            except np.linalg.LinAlgError:
                return None
            beside, along = self._along(Y, k, angle, radius, state, point)
        others = np.delete(np.arange(q + 1), k)
        turn = (slopes[:, others] @ along[:, None])[:, 0] + slopes[:, k]
        middle = Ball.joined(point.y, point.w) + (slopes[:, others] @ beside[:, None])[:, 0]
        fixed = len(point.y.mid) + np.array([*self.rows, *self.loose], dtype=np.intp)
        for part in (middle, turn):
            part.mid[fixed], part.rad[fixed] = 0.0, 0.0
        return _Sweep(middle, turn, beside, along, float(sizes[k]), k)

    def _drift(self, angle: Floats, radius: Floats) -> tuple[Drift | None, bool]:
        """Between which two bounds all solutions in a box lie over a piece of alpha; and whether there may be any."""
        sweep = self._swept(angle, radius)
        allowed = None if sweep is None else self._allowed_along(sweep, angle, radius)
        if sweep is None or allowed is None:
            return None, sweep is None
        ends = []
        for share in allowed:
            t = Ball.exact(np.array(sweep.reach * share))
            s = t if sweep.by_alpha else sweep.beside[-1] + sweep.along[-1] * t
            ends.append((sweep.middle + sweep.turn * t, s))
        return Drift(*ends), True

    def _span(self, angle: Floats, radius: Floats) -> tuple[float, float] | None:
        """Bounds of s at all solutions in a box over a piece of alpha; None if there are none."""
        sweep = self._swept(angle, radius, by_alpha=True) if self.piece else None
        return (-1.0, 1.0) if sweep is None else self._allowed_along(sweep, angle, radius)

    def _allowed_along(self, sweep: _Sweep, angle: Floats, radius: Floats) -> tuple[float, float] | None:
        """Bounds of the parameter at all solutions in a box, as shares of its reach; None if there are none.

        Every condition is at most a + b t with some a and b in balls, and so is what is left to an end of a sector.
        """
        m, q, (middle, turn) = len(self.E), len(self.turning), sweep[:2]
        pairs = [*self._sticking_along(sweep), *self._rigid_along(sweep)]
        pairs += [(middle[i], turn[i]) for i in self.closed] + [(-middle[m + i], -turn[m + i]) for i in self.open]
        for i, sign in self.sliding:
            along, way = m + int(np.max(self.system.tau[i])), Ball.exact(np.array(sign))
            pairs.append((way * middle[along], way * turn[along]))
        high = np.array([part.mid + part.rad for part, _ in pairs])
        slopes = np.array([[part.mid - part.rad, part.mid + part.rad] for _, part in pairs]).reshape(-1, 2)
        if q:
            d, _ = self._directions(angle, radius)
            ahead, rate = (
                one * d[:, 0] + other * d[:, 1] for one, other in (self._slips(part[m:]) for part in sweep[:2])
            )
            beside, turns_by = (part[:q] for part in sweep.unknowns)
            left = Ball.exact(self.half - angle[:q]) - beside, Ball.exact(self.half + angle[:q]) + beside
            first, second = Ball.joined(ahead, *left), Ball.joined(rate, -turns_by, turns_by)
            high = np.concatenate([high, first.mid + first.rad])
            slopes = np.vstack([slopes, np.column_stack([second.mid - second.rad, second.mid + second.rad])])
        slopes = slopes * sweep.reach
        slack = 8 * UNIT * (np.abs(high) + np.max(np.abs(slopes), axis=1)) + TINY
        if not np.all(np.isfinite(slack)):
            return -1.0, 1.0
        after, before = _allowed(high + slack, slopes[:, 1] + slack), _allowed(high + slack, slack - slopes[:, 0])
        if after is None and before is None:
            return None
        low = -before[1] if before is not None else after[0] if after is not None else 0.0
        return low, after[1] if after is not None else -before[0] if before is not None else 0.0

    def _sticking_along(self, sweep: _Sweep) -> list[tuple[Ball, Ball]]:
        """By how much nodes that stick are within their discs at most, see ``_allowed_along``."""
        turns, unit, (middle, turn), pairs = self.system.turn, self.system.unit, sweep[:2], []
        assert turns is not None
        for i in self.stick:
            t = [int(k) for k in self.system.tau[i] if k >= 0]
            if not t:
                continue
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

    def _rigid_along(self, sweep: _Sweep) -> list[tuple[Ball, Ball]]:
        """Distances of the rigid displacement from its bounds, see ``_allowed_along``."""
        reach, first = self.system.reach, len(self.system.g)
        sides = [(Ball.exact(np.array(sign)), k) for k in range(len(reach)) for sign in (1.0, -1.0)]
        middle, turn = sweep[:2]
        return [
            (Ball.exact(reach[k]) + sign * middle[first + k], sign * turn[first + k])
            for sign, k in sides
            if np.isfinite(reach[k])
        ]

    def _is_swept(self, angle: Floats, radius: Floats, state: State | None) -> bool:
        """True if dG/dpsi changes more along the piece than over the angles."""
        if not np.all(np.isfinite(radius)):
            # whether a free unknown would be bounded in the middle of the piece
            cut = self._cut_free(angle, radius, still=True)
            return cut is None or bool(np.all(np.isfinite(cut[1])))
        point = self._state(angle, 0.0 * radius, still=True)
        if point is None or not len(angle):
            return True
        if state is None or not state.J.finite:
            return self._state(angle, radius, still=True) is not None
        try:
            Y = np.asarray(np.linalg.inv(point.J.mid), dtype=np.float64)
        except np.linalg.LinAlgError:
            return False
        second = self._second(Y, (state, point), angle, radius).size
        bends, mixed = second[:, :-1, :-1] @ radius, second[:, :-1, -1]
        turned, swept = (np.max(part @ radius / radius) for part in (bends, mixed))
        return bool(swept > turned)

    def _refined(self, angle: Floats, radius: Floats, reach: Floats) -> SpaceRoot | Open | None:
        """The one zero of a box, enclosed as closely as floats can."""
        for _ in range(_OVER_PIECE if self.piece else _REFINEMENTS):
            if np.any(self._outside(angle, radius)):
                return None
            state = self._state(angle, radius)
            move = None if state is None else self._move(angle, radius, state)
            if move is None:
                break
            new_angle, new_radius = _cut(angle, radius, reach, move)
            # the zero lies in both boxes, angle by angle: an angle that rounding keeps from becoming narrower stays
            narrower = new_radius < radius
            done = not np.any(new_radius <= 0.9 * radius)
            angle, radius = np.where(narrower, new_angle, angle), np.where(narrower, new_radius, radius)
            if done:
                break
        state = self._state(angle, radius)
        if state is None:
            return self._left_open(angle, radius, None)
        if self._broken(state.y, state.w, angle, radius) or np.any(self._outside(angle, radius)):
            return None
        return self._root(state, angle, radius, reach)

    def _left_open(self, angle: Floats, radius: Floats, state: State | None) -> Open | None:
        """Bounds of a leaf that is not settled; None if nothing is known of it."""
        node = None
        # what is proven does not depend on which sector is halved, and whether any is
        q = len(self.turning)
        if q and (state is None or not np.all(radius[:q] < _POINT)):
            worth = self._worth_halving(angle, radius, state)
            node = self.turning[int(np.argmax(worth))] if np.any(worth) else None
        m = len(self.system.g)
        y, w = (None, None) if state is None else (state.y[:m], state.w[:m])
        rigid = None if state is None or not len(self.system.reach) else -state.y[m:]
        cause = self._cause(angle, state)
        mode = self._free_mode(angle) if cause is Cause.RIGID else None
        span = self._span(angle, radius)
        if span is None:
            return None
        drift, possible = self._drift(angle, radius)
        if not possible:
            return None
        swept = self.piece and self._is_swept(angle, radius, state)
        angle, radius = angle[:q], radius[:q]
        low, high = np.maximum(angle - radius, -self.half), np.minimum(angle + radius, self.half)
        box = 0.5 * (low + high), 0.5 * np.abs(high - low) * SAFE + 4 * UNIT
        return Open(node, y, w, self.centre, *box, cause, mode, drift, swept, span, rigid)

    def _free_mode(self, angle: Floats) -> int:
        """The rigid mode that moves most along what the equations in the middle leave free; no claim."""
        point, q = self._state(angle, np.zeros(len(angle))), len(self.turning)
        if self.free and point is not None and point.J.finite:
            along = np.linalg.svd(point.J.mid)[2][-1][q:]
            return self.free[int(np.argmax(np.abs(along)))] - len(self.system.g)
        E, k = self.E.copy(), len(self.system.reach)
        E[self.t, np.array(self.column, dtype=np.intp)[:, None]] = (
            turned_by(self.centre, angle[:q])[0] / self.system.unit[self.t]
        )
        _, _, rows = np.linalg.svd((self.system.balls[0].mid @ E)[self.rows])
        return int(np.argmax(np.abs(rows[-1][-k:])))

    def _cause(self, angle: Floats, state: State | None) -> Cause:
        point = self._state(angle, np.zeros(len(angle)))
        if state is None or point is None:
            return Cause.RIGID if len(self.system.reach) else Cause.EQUATIONS
        if len(self.system.reach) and self.free and nearly_singular(point.J.mid):
            return Cause.RIGID
        if not np.all(point.y.rad <= _POINT):
            return Cause.ROUNDING
        return Cause.DIRECTIONS if len(angle) and nearly_singular(point.J.mid) else Cause.EQUALITY

    def _worth_halving(self, angle: Floats, radius: Floats, state: State | None) -> Floats:
        """Gain that is expected of halving each sector; 0 where smaller ones would be left open, too."""
        point = self._state(angle, np.zeros(len(angle)))
        if state is not None and point is not None and np.all(point.y.rad <= _POINT):
            # the width, where it changes more than what is not known anyway
            known = np.maximum(_NEGLIGIBLE, point.G.rad)[:, None]
            moves = np.any(state.J.size * radius > known, axis=0)
            # what free unknowns may be depends on all directions
            return np.where(moves[: len(self.half)] | np.any(moves[len(self.half) :]), self.half, 0.0)
        # the change of the linear system, where it keeps that from being regular
        if not self.rows:
            return self.half
        widths = self._directions(angle, radius)[0].rad / self.system.unit[self.t]
        changes = np.max(np.sum(np.abs(self.system.balls[0].mid[self.rows][:, self.t]) * widths, axis=2), axis=0)
        turning = self._turning(angle)
        worth = changes if turning is None else np.max(turning.coupling(radius[: len(self.half)]), axis=0)
        return worth if changes[int(np.argmax(worth))] > _SINGULAR else np.zeros_like(worth)

    def _outside(self, angle: Floats, radius: Floats) -> Mask:
        """Which directions are outside of their sectors for certain; what lies there belongs to another leaf."""
        q = len(self.turning)
        return np.abs(angle[:q]) - radius[:q] > self.half * (1.0 + 1e-9)

    def _root(self, state: State, angle: Floats, radius: Floats, reach: Floats) -> SpaceRoot | Open | None:
        slack = self._slacks(state.y, state.w, angle, radius)
        turning = self._turning(angle) if np.all(slack > 0) else None
        sign = 0 if turning is None else turning.sign * determinant_sign(state.J)
        if not sign:
            return self._left_open(angle, radius, state)
        least = float(np.min(slack)) if len(slack) else np.inf
        m, modes = len(self.system.g), len(self.system.reach)
        # with the columns of q in place of those of -q, and with the rows of equilibrium of the other sign
        sign = -sign if (modes + len(self.free)) % 2 else sign
        q = len(self.turning)
        drift = self._drift(angle, radius)[0]
        angle, radius, reach = angle[:q], radius[:q], reach[:q]
        rigid = -state.y[m:] if modes else None
        return SpaceRoot(state.y[:m], state.w[:m], self.centre, angle, radius, reach, sign, least, rigid, drift)

    # -- evaluation over a box -------------------------------------------------------------------------------------

    def _directions(self, angle: Floats, radius: Floats) -> tuple[Ball, Ball]:
        """d (q, 2) and d' (q, 2) over a box of angles."""
        q = len(self.turning)
        mid_d, mid_turned = turned_by(self.centre, angle[:q])
        # |d(psi + r) - d(psi)| <= min(|d'(psi)| r + r^2 / 2, r), and d' likewise; libraries are off by a few units
        r = np.minimum(radius[:q], 2.0)[:, None]
        bent = 0.5 * r * r
        d = Ball(mid_d, np.minimum(np.abs(mid_turned) * r + bent, r) * SAFE + LIBRARY)
        return d, Ball(mid_turned, np.minimum(np.abs(mid_d) * r + bent, r) * SAFE + LIBRARY)

    def _turning(self, angle: Floats) -> Turning | None:
        """The linear equations with the directions at these angles in the middle; None if not proven regular there."""
        angle = angle[: len(self.turning)]
        key = angle.tobytes()
        if self._last is None or self._last[0] != key:
            directions = turned_by(self.centre, angle)
            at = self.rows, self.column, self.t
            loose = [self.turning.index(i) for i in self.loose]
            self._last = key, Turning.of(self.system, self.E, at, directions, self.discs, self.free, loose)
        return self._last[1]

    def _state(self, angle: Floats, radius: Floats, *, still: bool = False) -> State | None:
        """y, w, G and dG/dpsi over a box; None where the linear system is not proven regular in it.

        Over all of a piece of alpha, if there is one, or ``still`` in its middle.
        """
        key = angle.tobytes(), radius.tobytes(), still
        if key not in self._known:
            self._known[key] = self._evaluated(angle, radius, still=still)
        return self._known[key]

    def _evaluated(self, angle: Floats, radius: Floats, *, still: bool) -> State | None:
        turning = self._turning(angle)
        q = len(self.turning)
        free = Ball(angle[q:], radius[q:])
        if self.piece:
            free = Ball.joined(free, Ball(np.zeros(1), np.full(1, 0.0 if still else 1.0)))
        box = None if turning is None else turning.over(radius[:q], free)
        if box is None:
            return None
        (v1, v2), (dv1, dv2) = self._slips(box.w), self._slips(box.dw)
        d, turned = self._directions(angle, radius)
        d1, d2 = d[:, 0], d[:, 1]
        J = dv1 * d2[:, None] - dv2 * d1[:, None]
        diagonal = np.arange(q)
        corrected = J[diagonal, diagonal] + (v1 * turned[:, 1] - v2 * turned[:, 0])
        J.mid[diagonal, diagonal], J.rad[diagonal, diagonal] = corrected.mid, corrected.rad
        G = v1 * d2 - v2 * d1
        if self.free or self.piece:
            (s1, s2), w = self._slips(box.ds), box.w[self.free]
            G = Ball.joined(G, w)
            across = Ball.joined(s1 * d2[:, None] - s2 * d1[:, None], box.ds[self.free])
            along = Ball.joined(J, box.dw[self.free])
            J = Ball.beside(along, across)
        w = Ball(box.w.mid.copy(), box.w.rad.copy())
        w[self.loose] = 0.0
        return State(box.y, w, G, J[:, :-1], box, J[:, -1]) if self.piece else State(box.y, w, G, J, box)

    def _bends(self, Y: Floats, over: tuple[State, State], angle: Floats, radius: Floats) -> Ball:
        """Y times second derivatives of G over a box by the angles, by what is known there and in its middle."""
        return self._curved(Y, over, angle, radius)[1]

    def _second(self, Y: Floats, over: tuple[State, State], angle: Floats, radius: Floats) -> Ball:
        """Second derivatives over a box and a piece of alpha by all n unknowns and s, (n, n + 1, n + 1)."""
        (w, bends), n, q = self._curved(Y, over, angle, radius), len(angle), len(self.turning)
        (s1, s2), (_, turned) = self._slips(over[0].box.ds), self._directions(angle, radius)
        turn = Ball.exact(Y[:, :q])[:, :, None] * (s1 * turned[:, 1][:, None] - s2 * turned[:, 0][:, None])
        second = Ball(np.zeros((n, n + 1, n + 1)), np.zeros((n, n + 1, n + 1)))
        (by_angle, swept), mixed = w.loosened(), w.mixed() + turn[:, :, -1]
        second[:, :q, :q], second[:, n, n] = bends, w.twice()
        second[:, :q, q:n] = by_angle + turn[:, :, :-1]
        second[:, :q, n], second[:, q:n, n] = mixed, swept
        # the same on the other side of the diagonal
        for part in (second.mid, second.rad):
            part[:, q:, :q], part[:, n, q:n] = part[:, :q, q:].transpose(0, 2, 1), part[:, q:n, n]
        return second

    def _curved(self, Y: Floats, over: tuple[State, State], angle: Floats, radius: Floats) -> tuple[Combined, Ball]:
        """Part of w that Y G takes for directions that are held, and Y times second derivatives of G by the angles."""
        (state, point), (d, turned), own = over, self._directions(angle, radius), np.arange(len(self.turning))
        # v_i1 d_i2 - v_i2 d_i1
        rows = Ball(np.zeros((len(Y), len(state.box.w.mid))), np.zeros((len(Y), len(state.box.w.mid))))
        scale = Ball.exact(Y[:, : len(own)]), Ball.exact(self.slip_scale)
        rows[:, self.free] = Ball.exact(Y[:, len(own) :])
        for k, part in enumerate((d[:, 1], -d[:, 0])):
            rows[:, self.t[:, k]] = scale[0] * (scale[1][:, k] * part)
        w = state.box.combined(rows, point.box, radius[: len(own)])
        bends = w.bends()
        # psi_i turns d_i itself, in both orders, and d_i'' = -d_i
        (dv1, dv2), (v1, v2) = (self._slips(part) for part in (state.box.dw, state.box.w))
        turn = scale[0][:, :, None] * (dv1 * turned[:, 1][:, None] - dv2 * turned[:, 0][:, None])
        bent = scale[0] * (v2 * d[:, 0] - v1 * d[:, 1])
        bends = bends + turn + Ball(turn.mid.transpose(0, 2, 1), turn.rad.transpose(0, 2, 1))
        bends[:, own, own] = bends[:, own, own] + bent
        return w, bends

    def _slips(self, w: Ball) -> tuple[Ball, Ball]:
        """Both components of v at the nodes in sectors, times ``slip_scale`` of FrictionUnits; ``w`` by rows."""
        first, second = (w[self.t[:, k]] for k in (0, 1))
        scales = (self.slip_scale[:, k].reshape(-1, *[1] * (w.mid.ndim - 1)) for k in (0, 1))
        pairs = zip((first, second), scales, strict=True)
        one, other = (Ball(part.mid * scale, part.rad * scale) for part, scale in pairs)
        return one, other

    def _conditions(self, y: Ball, w: Ball) -> tuple[Floats, Floats]:
        """Conditions that a root has to satisfy but for directions, as midpoints and radii; stick by |tau| in both.

        Those of slips and of sticking are in the units of ``slips`` and ``taus`` of FrictionUnits.
        """
        tau, unit, scale = self.system.tau, self.system.unit, self.system.disc_scale
        mid = [-w.mid[i] for i in self.open] + [y.mid[i] for i in self.closed]
        rad = [w.rad[i] for i in self.open] + [y.rad[i] for i in self.closed]
        for i in self.stick:
            t = [int(k) for k in tau[i] if k >= 0]
            if t:
                units, disc = unit[t] * scale[i], self.system.discs[i]
                most, uncertain = y.mid[i] * scale[i] * disc.mid, y.rad[i] * scale[i] * (disc.mid + disc.rad)
                uncertain += abs(y.mid[i]) * scale[i] * disc.rad
                length = float(np.linalg.norm(y.mid[t] * units))
                mid.append(most - length)
                uncertain += float(upper_norm(y.rad[t] * units)) + 16 * UNIT * (abs(most) + length)
                rad.append(uncertain * SAFE + TINY)
        for i, sign in self.sliding:
            along = int(np.max(tau[i]))
            mid.append(sign * w.mid[along])
            rad.append(w.rad[along])
        if np.all(np.isfinite(self.system.reach)):
            rigid, reach = y[len(self.system.g) :], Ball.exact(self.system.reach)
            ends = Ball.joined(reach - rigid, reach + rigid)
            mid, rad = [*mid, *ends.mid], [*rad, *ends.rad]
        return np.array(mid), np.array(rad)

    def _forward(self, w: Ball, angle: Floats, radius: Floats) -> tuple[Floats, Floats]:
        """v . d of the nodes in sectors, and v_1 d_1 and v_2 d_2 alone, as midpoints and radii, (3, q) each.

        Where G vanishes v = t d: none of the three is negative if t >= 0, and t > 0 if one is positive. A component
        alone tells where the rounding of the other would hide it, as its coefficient is much larger.
        """
        d, _ = self._directions(angle, radius)
        v1, v2 = self._slips(w)
        products = (v1 * d[:, 0] + v2 * d[:, 1], w[self.t[:, 0]] * d[:, 0], w[self.t[:, 1]] * d[:, 1])
        return np.array([product.mid for product in products]), np.array([product.rad for product in products])

    def _broken(self, y: Ball, w: Ball, angle: Floats, radius: Floats) -> bool:
        """True if some condition is broken at every zero of G in the box."""
        mid, rad = self._conditions(y, w)
        forward, uncertain = self._forward(w, angle, radius)
        return bool(np.any(mid < -rad) or np.any(forward < -uncertain))

    def _slacks(self, y: Ball, w: Ball, angle: Floats, radius: Floats) -> Floats:
        """Lower bounds of the conditions at zeros of G in the box; of directions, numbers of the same signs."""
        mid, rad = self._conditions(y, w)
        forward, uncertain = self._forward(w, angle, radius)
        return np.concatenate([mid - rad * SAFE, np.max(forward - uncertain * SAFE, axis=0)])


def same_root(one: SpaceRoot, other: SpaceRoot) -> bool | None:
    """True if two roots of leaves with the same statuses up to sectors are one; None where that is open.

    The leaves have the same nodes open, sticking and slipping. They are one if one root's directions lie in the box in
    which the other is the only root; they are two if their forces differ.
    """
    if _apart(one.y, other.y) or (one.rigid is not None and other.rigid is not None and _apart(one.rigid, other.rigid)):
        return False
    away = np.abs(turned(other.centre, one.centre) + one.angle) + one.angle_rad + ROUNDED_ANGLE
    return True if np.all(away < other.reach) else None


def turned(one: Floats, other: Floats) -> Floats:
    """Angles from directions to others, (q,), for which ``ROUNDED_ANGLE`` has room."""
    return np.asarray(np.arctan2(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0], np.sum(one * other, axis=1)))


def _apart(one: Ball, other: Ball) -> bool:
    return bool(np.any(np.abs(one.mid - other.mid) > (one.rad + other.rad) * SAFE))


def distinct_roots(found: Iterable[_RootLeaf]) -> Apart[_RootLeaf]:
    """Leaves by the roots that they hold, whatever the order in which they are given."""

    def same(other: _RootLeaf, one: _RootLeaf) -> bool | None:
        patterns = [[min(code, SECTORS) for code in codes] for codes, _ in (other, one)]
        return same_root(one[1], other[1]) if patterns[0] == patterns[1] else False

    return told_apart(sorted(found, key=lambda leaf: leaf[0]), same)
