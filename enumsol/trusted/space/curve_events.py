"""The trusted tests in 3D of what happens along a curve in a box (theory, section 12.10).

Which way alpha goes, where it turns back, and where a node changes its status.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball, solution, upper_norm
from enumsol.support.array_types import Floats
from enumsol.trusted.space.natural_map import Directions, upper_product
from enumsol.trusted.space.sector_rows import FRICTIONLESS, OPEN, STICK
from enumsol.trusted.space.solution_curve import SLIP, AlphaProblem, SolutionCurve, map_around

#: Pairs of statuses between which one condition decides: the sign of |z_t| - F z_n, or of z_n.
_BY_FRICTION = frozenset({STICK, SLIP})
_BY_CONTACT = (frozenset({OPEN, SLIP}), frozenset({OPEN, FRICTIONLESS}))


class CurveMotion:
    """How the solutions of a curve in a box move with its parameter.

    Derivatives with respect to t are bounded for all points of the curve that have given statuses; at its kinks they
    are those of one side.

    Parameters
    ----------
    problem : AlphaProblem
    curve : SolutionCurve
    border : (m + 1,) array, optional
        The row e of the parameter; that of the curve's box by default, and of another box that holds a point if the
        curve is a point.
    """

    def __init__(self, problem: AlphaProblem, curve: SolutionCurve, border: Floats | None = None) -> None:
        self.problem = problem
        unit, box = problem.unit, curve.box
        self._border = (box.border if border is None else border) * unit
        near = map_around(problem, replace(box, rho=np.ones(problem.m)))
        self._Z, z, along = near.moves, near.z, near.zd
        side = upper_product(self._Z.size, curve.spread / unit)
        #: (z, alpha) at all points of the curve.
        self.z = Ball(z.mid, (z.rad + along.size * box.half + side) * SAFE + TINY)
        self._past = problem.past(z, along, box.half, side * SAFE)
        self._F = problem.friction(self.z[-1])
        self._speeds: dict[tuple[int, ...], Ball | None] = {}

    # -- statuses --------------------------------------------------------------------------------------------------

    @cached_property
    def possible(self) -> tuple[frozenset[int], ...]:
        """The statuses that every node may have at points of the curve."""
        return tuple(map(self._possible, range(self.problem.p)))

    def _possible(self, i: int) -> frozenset[int]:
        low, high = _ends(self.z[i])
        found = {OPEN} if low <= 0 else set()
        if high < 0:
            return frozenset(found)
        if not len(self.problem.tau[i]):
            return frozenset(found | {FRICTIONLESS})
        least, most = self._lengths(i)
        F_low, F_high = _ends(self._F[i])
        past = _sign(self._past[i])
        if past <= 0 and F_high >= 0 and least <= F_high * high * SAFE + TINY:
            found.add(STICK)
        if past >= 0 and (F_low < 0 or most >= F_low * max(low, 0.0) / SAFE - TINY):
            found.add(SLIP)
        return frozenset(found)

    def _lengths(self, i: int) -> tuple[float, float]:
        """Bounds of |z_t|; the lower one may be negative."""
        t = self.problem.tau[i]
        length, away = float(np.linalg.norm(self.z.mid[t])), float(upper_norm(self.z.rad[t]))
        rounded = 8 * UNIT * length + TINY
        return length - away * SAFE - rounded, length + away * SAFE + rounded

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
        """Derivative of the projection P with respect to (z, alpha), by (12.17)."""
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
        t, (least, most) = self.problem.tau[i], self._lengths(i)
        if not least > 0:
            return None
        middle, half = 0.5 * (1.0 / least + 1.0 / most), 0.5 * (1.0 / least - 1.0 / most)
        inverse = Ball(np.array(middle), np.array((half + 4 * UNIT * middle) * SAFE))
        if len(t) == 1:
            return Ball.exact(np.sign(self.z.mid[t])), Ball.exact(np.zeros((1, 1))), inverse
        at = self._directions
        return Ball(at.e[i], at.turn[i]), Ball(at.across[i], at.bent[i] + 16 * UNIT), inverse

    @cached_property
    def _directions(self) -> Directions:
        """Directions of z_t of all nodes; they serve where it has two components and does not vanish."""
        places = self.problem.places
        x = Ball(np.where(places >= 0, self.z.mid[places], 0.0), np.where(places >= 0, self.z.rad[places], 0.0))
        with np.errstate(all="ignore"):
            return Directions.of(x)

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
        """The second derivative of F z_n e along a node's speed (12.24)."""
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


def _ends(ball: Ball) -> tuple[float, float]:
    """Rounded outwards."""
    low, high = float(ball.mid - ball.rad), float(ball.mid + ball.rad)
    return low - 2 * UNIT * abs(low) - TINY, high + 2 * UNIT * abs(high) + TINY


def _sign(ball: Ball) -> int:
    return int(np.sign(ball.mid)) if abs(ball.mid) > ball.rad * SAFE else 0
