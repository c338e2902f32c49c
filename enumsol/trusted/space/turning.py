"""The linear equations of a leaf in 3D over a box of slip directions (theory, section 12.3)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball, Inverse, determinant_sign, gamma, smaller

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.condensation.space_condensed import EnclosedSpace
    from enumsol.support.array_types import Floats, Indices


#: Cosine and sine of numerical libraries, and what is made of two of them here, are off by no more.
LIBRARY = 64 * UNIT


def turned_by(centre: Floats, angle: Floats) -> tuple[Floats, Floats]:
    """Directions at angles from their centres and those a quarter turn further, (q, 2) each, off by ``LIBRARY``."""
    across = np.stack([-centre[:, 1], centre[:, 0]], axis=1)
    cos, sin = np.cos(angle)[:, None], np.sin(angle)[:, None]
    return cos * centre + sin * across, cos * across - sin * centre


@dataclass(frozen=True)
class AngleBox:
    """Values over a box of angles, and their derivatives with respect to these.

    Attributes
    ----------
    y, w : Ball of shape (m,)
        w is zero, exactly, where the equations say so.
    slope, lone : Ball of shape (2 m, q), (2 m, k)
        Derivatives of y, then of w, with respect to the angles and to the free unknowns.
    x : Ball of shape (q,)
        The turning nodes' normal forces.
    pushed : Ball of shape (q + 2 m, q)
        z, where -dx_i / dpsi_j is z_ij x_j; then changes of y and w with forces of size one a quarter turn further than
        d, so that d(y, w)_j is x_j times these.
    led : Ball of shape (q + 2 m, q)
        The same with forces along d.
    lag : Ball of shape (q, k)
        -dx with respect to the free unknowns.
    share : Ball of shape (q,), or None
        Over a piece of alpha (see Turning).
    """

    y: Ball
    w: Ball
    slope: Ball
    lone: Ball
    x: Ball
    pushed: Ball
    led: Ball
    lag: Ball
    share: Ball | None

    @property
    def z(self) -> Ball:
        """See ``pushed``."""
        return self.pushed[: len(self.x.mid)]

    @property
    def across(self) -> Ball:
        """Changes of w with forces of size one a quarter turn further than d, (m, q)."""
        return self.pushed[-len(self.w.mid) :]

    @property
    def along(self) -> Ball:
        """Changes of w with forces of size one along d, (m, q)."""
        return self.led[-len(self.w.mid) :]

    @property
    def dw(self) -> Ball:
        """Derivatives of w with respect to the angles."""
        return self.slope[len(self.w.mid) :]

    @property
    def ds(self) -> Ball:
        """Derivatives of w with respect to the free unknowns."""
        return self.lone[len(self.w.mid) :]

    def combined(self, rows: Ball, point: AngleBox, radius: Floats) -> Combined:
        """Rows times w over the box, with what is known in its middle.

        Combined first and bounded then, so that what cancels in the middle does so over the box, too.

        Parameters
        ----------
        rows : Ball of shape (k, m)
        point : the middle
        radius : (q,) array
            Of the box.
        """
        swept = np.zeros_like(radius) if self.share is None else grown_share(self.share).size
        z, t = (part[: len(radius)].size for part in (self.pushed, self.led))
        across, along = (rows @ part for part in (self.across, self.along))
        middle = tuple(rows @ part for part in (point.across, point.along))
        more = (1.0 + gamma(2 * len(radius) + 8)) * SAFE
        # twice bounded by their own derivatives
        for _ in range(2):
            # by (12.8), and with g = share / (1 + s share), whose bounds are ``swept``,
            # dp_j / ds = p_j g_j - sum q_k g_k z_kj, and the same for q with t in place of z. Forces here are
            # 1 + s share times d or its turn; what needs them for d alone has that too, as the radii hold all s
            p, q = across.size, along.size
            turned, led = p * radius, q * swept
            moves = turned @ z + q * radius + p * swept + led @ z, turned @ t + turned + led + led @ t
            across, along = (
                smaller(part, Ball(near.mid, (near.rad + by * more) * SAFE + TINY))
                for part, near, by in zip((across, along), middle, moves, strict=True)
            )
        return Combined(self, across, along)


class Combined(NamedTuple):
    """Combinations of w over a box, k of them: ``across`` and ``along``, (k, q), are as those of w (see AngleBox)."""

    box: AngleBox
    across: Ball
    along: Ball

    def bends(self, radius: Floats) -> tuple[Floats, Ball]:
        """Second derivatives with respect to the angles j and k: bounds of sums over k, and those with j = k, (k, q).

        Added up is over all other angles, the sizes of the derivatives times ``radius``: the tensor of all is not made.
        """
        across, (x, z) = self.across, (self.box.x, self.box.z)
        # d^2 w / dpsi_j dpsi_k = -(across_k z_kj x_j + across_j z_jk x_k), and -along_j x_j more where j = k
        moved, twice = z * x, across * Ball(np.diagonal(z.mid), np.diagonal(z.rad))
        return sums_of_both(across.size, moved.size, radius), -((twice + twice + self.along) * x)

    def mixed(self) -> Ball:
        """Over a piece of alpha, second derivatives with respect to the angles and to s, (k, q).

        With x_s = -lag, and across_j,s = across_j share_j / (1 + s share_j) - sum_k along_k share_k z_kj.
        """
        box = self.box
        assert box.share is not None
        turned = self.across * grown_share(box.share) - self.along @ (box.share[:, None] * box.z)
        return turned * box.x - self.across * box.lag[:, -1]

    def loosened(self) -> tuple[Ball, Ball]:
        """Over a piece of alpha, those by angles and other free unknowns, (k, q, f), and by s and the latter, (k, f).

        w is affine in them, and what forces along d and across it change w by does not depend on them (12.21).
        """
        box = self.box
        assert box.share is not None
        lag = box.lag[:, :-1]
        return -(self.across[:, :, None] * lag), -(self.along @ (box.share[:, None] * lag))

    def twice(self) -> Ball:
        """Over a piece of alpha, second derivatives with respect to s, (k,): x_ss is 2 straight share lag."""
        assert self.box.share is not None
        moved = self.box.share * self.box.lag[:, -1]
        return -(self.along @ (moved + moved)[:, None])[:, 0]


@dataclass(frozen=True)
class Turning:
    """y and w of a leaf for directions d_k in its sectors, and what other ones change.

    With x the unknowns, y = E x and P (g - S E x) = 0. Directions that turn by D, E = E0 + T D (T the tangential
    forces in sectors), change

        x_c = (I + B_c D)^-1 x_0c,     y = y_0 + Pi_0 T D x_c,     w = w_0 - S Pi_0 T D x_c,

    x_c the normal forces of the turning nodes, B = (P S E0)^-1 P S T and Pi_0 = I - E0 (P S E0)^-1 P S. S Pi_0 is the
    compliance of what is left free. It is small where weak springs make S large, and known as well as S is: all
    products are taken before anything is widened by a box. Some unknowns s of y may be left free, as those rigid modes
    are that P does not determine (theory, section 14.6): they are what forces in T are for which x is solved as well,

        x_c = (I + B_c D)^-1 (x_0c - B_s s),   y = y_0 + Pi_0 (T D x_c + T_s s),   w = w_0 - S Pi_0 (T D x_c + T_s s).

    So may normal forces of turning nodes, which come first: x_c then has s itself, and B_c no other entries in its row.

    Attributes
    ----------
    d, turned : (q, 2) arrays
        The directions as they are computed, in the units of y, and those a quarter turn further.
    x : Ball of shape (q,)
        x_0c.
    start : Ball of shape (2 m,)
        y_0, then w_0.
    B : Ball of shape (q, 2 q + k)
        B_c; columns are tangential forces, both of one node side by side, then what is free, as of ``change``.
    change : Ball of shape (2 m, 2 q + k)
        Pi_0 T, then -S Pi_0 T.
    matrix : Ball of shape (n, n)
        P S E0.
    rows : sequence of n ints
        Those that P picks.
    off : (q,) array
        How much directions may be off in the units of y, for every node.
    share : Ball of shape (q,), or None
        Over a piece of alpha forces in T are 1 + s share times d, with s from -1 to 1, which is free (PieceTurn).
    """

    d: Floats
    turned: Floats
    x: Ball
    start: Ball
    B: Ball
    change: Ball
    matrix: Ball
    rows: Sequence[int]
    off: Floats
    share: Ball | None = None

    @classmethod
    def of(
        cls,
        system: EnclosedSpace,
        E: Floats,
        at: tuple[Sequence[int], Sequence[int], Indices],
        directions: tuple[Floats, Floats],
        swept: tuple[Ball, Ball | None],
        free: Sequence[int] = (),
        loose: Sequence[int] = (),
    ) -> Turning | None:
        """None where the equations are not proven regular for these directions.

        Parameters
        ----------
        system : EnclosedSpace
            Of a body that nothing holds m counts its rigid modes, whose rows and unknowns are the last of all.
        E : (m, n) array, without the directions
        at : rows of the unknowns in y, n; columns of the turning nodes' normal forces among them, q; and, (q, 2), the
            rows of the turning nodes' tangential forces
        directions : as of ``turned_by``
        swept : of the turning nodes, (q,), tau over lambda_n where they slip; over a piece of alpha for s = 0, and what
            one s more adds
        free : rows of the free unknowns in y, k
        loose : which turning nodes' normal forces are the first of these; their columns are not used
        """
        (rows, column, t), (discs, turn), loose = at, swept, list(loose)
        units = system.unit[t]
        d, turned = (part * discs.mid[:, None] / units for part in directions)
        share = None if turn is None else Ball(turn.mid / discs.mid, _quotient_error(turn, discs))
        piece = system.turn
        loads = [system.balls[1]] if piece is None else [piece.g, piece.g_turn]
        E, held = E.copy(), np.delete(np.arange(len(t)), loose)
        E[t[held], np.asarray(column, dtype=np.intp)[held, None]] = d[held]
        (S, _, _), sparse, both = system.balls, Ball.exact(E), np.r_[t.ravel(), np.asarray(free, dtype=np.intp)]
        # forces in the sectors, and those that free unknowns are: a loose node's is along its direction, too
        forces, others = np.zeros((len(S.mid), len(both))), t.size + np.arange(len(loose))
        forces[both, np.arange(len(both))] = 1.0
        forces[t[loose], others[:, None]] = d[loose]
        pushed = S[:, both]
        if loose:
            pushed[:, others] = S @ Ball.exact(forces[:, others])
        columns, SE = [*loads, pushed], S @ sparse
        load = Ball(*(np.column_stack([getattr(part, name) for part in columns]) for name in ("mid", "rad")))
        matrix = SE[rows]
        found = held_by(matrix, SE, load, rows)
        if found is None:
            return None
        all_x, w = found
        y, k = sparse @ all_x, len(loads)
        start, change = Ball.joined(y[:, 0], w[:, 0]), Ball.joined(Ball.exact(forces) - y[:, k:], w[:, k:])
        change = Ball(np.where(np.arange(len(change.mid))[:, None] < len(y.mid), 1.0, -1.0) * change.mid, change.rad)
        x = Ball.exact(np.zeros((len(t), len(load.mid[0]))))
        x[held] = all_x[np.asarray(column, dtype=np.intp)[held]]
        x[loose, k + others] = -1.0
        B = x[:, k:]
        if piece is not None:
            # s is what is left free
            change, B = Ball.beside(change, Ball.joined(y[:, 1:2], w[:, 1:2])), Ball.beside(B, -x[:, 1:2])
        off = (LIBRARY * (discs.mid + discs.rad) + discs.rad * (1.0 + LIBRARY)) / np.min(units, axis=1)
        if share is not None:
            off = off * (1.0 + share.size) * SAFE
        return cls(d, turned, x[:, 0], start, B, change, matrix, rows, off, share)

    @property
    def sign(self) -> int:
        """Sign of det P S E over every box in which the equations are regular; 0 where it is not proven."""
        return determinant_sign(self.matrix)

    def over(self, radius: Floats, free: Ball) -> AngleBox | None:
        """Bounds over all angles up to ``radius``, (q,), from the middle; None if they are not proven regular.

        ``free`` are the values of the free unknowns, (k,). In the middle directions are known but for rounding.
        """
        key = free.mid.tobytes()
        if self._points.get(key) is None:
            self._points[key] = self._over(np.zeros(len(self.d)), Ball.exact(free.mid), None)
        point = self._points[key]
        if point is None or not (np.any(radius) or np.any(free.rad)):
            return point
        return self._over(radius, free, point)

    @cached_property
    def _points(self) -> dict[bytes, AngleBox | None]:
        """Bounds in the middle, by values of the free unknowns."""
        return {}

    def coupling(self, radius: Floats) -> Floats:
        """Sizes of B_c D over a box, (q, q): nothing is singular in it while they are small."""
        return self._turned(self.B, radius)[0].size

    def _turned(self, A: Ball, radius: Floats) -> tuple[Ball, Ball, Ball]:
        """A D, A dD/dpsi and A d for directions d and their changes D over a box; A has two columns for every node."""
        turning = A[:, : 2 * len(self.d)]
        first, second = turning[:, 0::2], turning[:, 1::2]
        along, across = (first * Ball.exact(d[:, 0]) + second * Ball.exact(d[:, 1]) for d in (self.d, self.turned))
        rounding = Ball(np.zeros_like(along.mid), (first.size + second.size) * self.off * SAFE)
        # D = turned sin r - d (1 - cos r), dD/dpsi = turned cos r - d sin r
        sin = Ball(0.0 * radius, np.where(radius < 1.5, np.minimum(radius, np.sin(radius) * (1.0 + LIBRARY)), 1.0))
        half = np.minimum(0.25 * radius * radius * SAFE, 1.0)
        lost = Ball(half, half)
        cos = Ball.exact(np.ones(len(half))) - lost
        return (
            across * sin - along * lost + rounding,
            across * cos - along * sin + rounding,
            along * cos + across * sin + rounding,
        )

    def _swept(self, part: Ball, led: Ball, x: Ball) -> Ball:
        """Derivatives with respect to the free unknowns: by s, the last one, forces along d grow as well."""
        if self.share is None:
            return part
        grown = (led @ (self.share * x)[:, None])[:, 0]
        swept = Ball(part.mid.copy(), part.rad.copy())
        swept[:, -1] = part[:, -1] + grown
        return swept

    def _over(self, radius: Floats, free: Ball, point: AngleBox | None) -> AngleBox | None:
        q, m = len(radius), len(self.start.mid) // 2
        lone, start, base = self.change[:, 2 * q :], self.start, self.x
        if len(free.mid):
            start, base = start + (lone @ free[:, None])[:, 0], base - (self.B[:, 2 * q :] @ free[:, None])[:, 0]
        moved, push, ahead = self._turned(self.change, radius)
        B_moved, B_push, B_ahead = self._turned(self.B, radius)
        share = Ball.exact(np.zeros(q)) if self.share is None else self.share
        if self.share is not None:
            grown = share * Ball(np.zeros(1), free.rad[-1:])
            more = Ball.exact(np.ones(q)) + grown
            moved, push, ahead = moved + ahead * grown, push * more, ahead * more
            B_moved, B_push, B_ahead = B_moved + B_ahead * grown, B_push * more, B_ahead * more
        x, z, straight = base, Ball.exact(np.zeros((q, q))), Ball.exact(np.zeros((q, q)))
        shift = Ball.exact(np.zeros((q, len(free.mid))))
        if q:
            inverse = Inverse.of(Ball.exact(np.eye(q)) + B_moved)
            if inverse is None:
                return None
            both = inverse.solve(Ball.beside(B_push, B_ahead, self.B[:, 2 * q :]))
            x = inverse.solve(base[:, None])[:, 0]
            z, straight, shift = both[:, :q], both[:, q : 2 * q], both[:, 2 * q :]
        span, beside = Ball(np.zeros((q, 1)), radius[:, None]), Ball(np.zeros_like(free.mid), free.rad)[:, None]
        if point is not None:
            for _ in range(2):
                # the mean value form: what the box adds to the values in its middle, dx = -z x dpsi
                moves = (z * x) @ span
                lag = self._swept(shift, straight, x)
                x = smaller(x, point.x - (moves + lag @ beside if len(free.mid) else moves)[:, 0])
        pushed, led = Ball.joined(z, push - moved @ z), Ball.joined(straight, ahead - moved @ straight)
        lag = self._swept(shift, straight, x)
        value, slope = start + (moved @ x[:, None])[:, 0], pushed[q:] * x
        lone = self._swept(lone - moved @ shift, led[q:], x)
        if point is not None:
            moves = slope @ span
            moves = moves + lone @ beside if len(free.mid) else moves
            value = smaller(value, Ball.joined(point.y, point.w) + moves[:, 0])
        w = value[m:]
        w.mid[self.rows], w.rad[self.rows] = 0.0, 0.0
        return AngleBox(value[:m], w, slope, lone, x, pushed, led, lag, self.share)


def held_by(matrix: Ball, SE: Ball, load: Ball, rows: Sequence[int]) -> tuple[Ball, Ball] | None:
    """x and w of P (load - S E0 x) = 0, with ``matrix`` P S E0; None where that is not proven regular."""
    if not len(rows):
        return Ball.exact(np.zeros((0, len(load.mid[0])))), load
    inverse = Inverse.of(matrix)
    if inverse is None:
        return None
    near = Ball.exact(inverse.near(load.mid[rows]))
    left = load - SE @ near
    # what is left of the equations is rounding; (P S E0)^-1 is taken of that, and S E0 (P S E0)^-1, which is
    # Q + (S E0 - Q P S E0) (P S E0)^-1 for whatever Q
    rest = inverse.solve(left[rows])
    Q = Ball.exact(SE.mid @ inverse.near(np.eye(len(rows))))
    w = left - (Q @ left[rows] + (SE - Q @ matrix) @ rest)
    w.mid[rows], w.rad[rows] = 0.0, 0.0
    return near + rest, w


def sums_of_both(left: Floats, right: Floats, radius: Floats) -> Floats:
    """Bounds of the sums over all k but j of (left_ik right_kj + left_ij right_jk) radius_k, of nonnegative floats."""
    others = right * (1.0 - np.eye(len(right)))
    # what underflows in one product may be large in the next
    sums = (left * radius + TINY) @ others + left * (others @ radius + TINY)
    return np.asarray(sums * (1.0 + gamma(2 * len(right) + 8)) * SAFE + TINY)


def grown_share(share: Ball) -> Ball:
    """share / (1 + s share) for all s from -1 to 1."""
    size = share.size
    return Ball(share.mid, (share.rad + size * size / np.where(size < 1, 1.0 - size, 0.0)) * SAFE)


def _quotient_error(one: Ball, other: Ball) -> Floats:
    """Radius of a quotient of balls around that of their midpoints, of which the other's are positive."""
    size = np.abs(one.mid / other.mid)
    return np.asarray((4 * UNIT * size + (one.rad + size * other.rad) / (other.mid - other.rad)) * SAFE)
