"""Selections over alpha in balls: their equations and conditions as affine forms (theory, section 7.14)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.ball_arrays import Ball, solution
from enumsol.arithmetic.balls import SAFE, TINY
from enumsol.condensation.enclosure import NotEnclosedError
from enumsol.trusted.selection import Selection

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from enumsol.condensation.enclosure import CondensedEnclosure

    Array = NDArray[np.float64]

#: Smallest quotient of units, far above underflow.
_LEAST_PAIR = 2.0**-1000


@dataclass(frozen=True)
class ArcSystem:
    """The condensed problem over alpha as balls, in units given by powers of two: w = g0 + alpha g1 - S lambda.

    Attributes
    ----------
    S : Ball of shape (2p, 2p)
    g0, g1 : Ball of shape (2p,)
    F0, F1 : (p,) arrays, F = F0 + alpha F1
    """

    S: Ball
    g0: Ball
    g1: Ball
    F0: Array
    F1: Array

    @classmethod
    def of(cls, enclosure: CondensedEnclosure, force: Array, length: Array, side: float = 0.0) -> ArcSystem:
        """An enclosed problem; with ``side`` 1 or -1 for the constant load +-g1 (see trusted.over_interval)."""
        with np.errstate(over="ignore", invalid="ignore"):  # what overflows proves nothing
            return cls._of(enclosure, force, length, side)

    @classmethod
    def _of(cls, enclosure: CondensedEnclosure, force: Array, length: Array, side: float) -> ArcSystem:
        pair = force[:, None] / length[None, :]
        if not np.all(pair >= _LEAST_PAIR):
            raise NotEnclosedError("the units of the arcs underflow float64; expected data in other units")
        F0, F1 = (np.asarray(part, dtype=np.float64) for part in enclosure.problem.friction)

        def in_units(value: Array, radius: Array) -> Ball:
            return Ball(value / length, radius / length + TINY)

        g0, g1 = in_units(enclosure.g0, enclosure.g0_rad), in_units(enclosure.g1, enclosure.g1_rad)
        if side:
            g0, g1 = Ball(side * g1.mid, g1.rad), Ball.exact(np.zeros_like(g1.mid))
        elif enclosure.problem.load_slope is None:
            g1 = Ball.exact(np.zeros_like(g1.mid))
        return cls(Ball(enclosure.S * pair, enclosure.S_rad * pair + TINY), g0, g1, F0, F1)

    @property
    def p(self) -> int:
        """Number of contact nodes."""
        return len(self.F0)


class ArcSelection:
    """One selection as a function of alpha.

    Parameters
    ----------
    system : ArcSystem
    codes : p status codes, complete

    Attributes
    ----------
    system : ArcSystem
    rows : Selection
    affine : bool
        M is constant.
    """

    def __init__(self, system: ArcSystem, codes: Sequence[int]) -> None:
        self.system = system
        self.rows = rows = Selection(codes)
        self.affine = not np.any(system.F1[rows.slip])
        self._fixed = system.S[:, rows.unknown]
        turning = system.S[:, system.p + rows.slip]
        self._turning = Ball(turning.mid * rows.slip_signs, turning.rad)

    def at(self, alpha: float) -> tuple[Ball, Ball, Ball] | None:
        """lambda, w and the conditions at one alpha, scaled; None where the selection is not proven regular."""
        p, rows = self.system.p, self.rows.unknown
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            F = _affine(Ball.exact(self.system.F0), Ball.exact(self.system.F1), alpha)
            g = _affine(self.system.g0, self.system.g1, alpha)
            W = self._columns(F)
            y = solution(W[rows], g[rows, None])
            if y is None:
                return None
            w = g - (W @ y)[:, 0]
            w.mid[rows] = w.rad[rows] = 0.0
            y = y[:, 0]
            forces = Ball(np.zeros(2 * p), np.zeros(2 * p))
            forces.mid[rows], forces.rad[rows] = y.mid, y.rad
            slip = F[self.rows.slip] * y[self.rows.slip_columns]
            forces.mid[p + self.rows.slip], forces.rad[p + self.rows.slip] = slip.mid * self.rows.slip_signs, slip.rad
            bound, stuck, moves = (
                F[self.rows.stick] * y[self.rows.stick_columns],
                y[len(self.rows.closed) :],
                w[self.rows.moving],
            )
            moves = Ball(moves.mid * self.rows.moving_signs, moves.rad)
            return forces, w, _joined(moves, y[: len(self.rows.closed)], bound - stuck, bound + stuck)

    def sign_at(self, alpha: float, condition: int) -> int:
        """Sign of a condition at an alpha at which the selection is regular; 0 where it is not proven."""
        found = self.at(alpha)
        if found is None:
            return 0
        value, radius = float(found[2].mid[condition]), SAFE * float(found[2].rad[condition])
        return int(value > radius) - int(value < -radius)

    @cached_property
    def forms(self) -> tuple[Array, Array, Array, Array]:
        """H0, H1 and their radii: H0 + alpha H1 are rows of coefficients for (y, t), [M, -g_R] and the conditions."""
        system, rows = self.system, self.rows
        size, m = len(rows.unknown), len(rows.conditions)
        constant, slope = (np.zeros((2, size + m, size + 1)) for _ in range(2))
        first = size + len(rows.moving)
        closed, stick = np.arange(len(rows.closed)), np.arange(len(rows.stick))
        plus = first + len(closed) + stick
        minus = plus + len(stick)
        constant[0, first + closed, closed] = 1.0
        constant[0, plus, len(closed) + stick], constant[0, minus, len(closed) + stick] = -1.0, 1.0
        signs = rows.moving_signs
        for (mid, rad), W, g, F in (
            (constant, self._columns(Ball.exact(system.F0)), system.g0, system.F0),
            (slope, self._slope(), system.g1, system.F1),
        ):
            mid[:size, :size], rad[:size, :size] = W.mid[rows.unknown], W.rad[rows.unknown]
            mid[:size, size], rad[:size, size] = -g.mid[rows.unknown], g.rad[rows.unknown]
            mid[size:first, :size], rad[size:first, :size] = -signs[:, None] * W.mid[rows.moving], W.rad[rows.moving]
            mid[size:first, size], rad[size:first, size] = signs * g.mid[rows.moving], g.rad[rows.moving]
            mid[plus, rows.stick_columns] = mid[minus, rows.stick_columns] = F[rows.stick]
        return constant[0], slope[0], constant[1], slope[1]

    def forget(self) -> None:
        """Let go of the forms, which are made again where they are asked for."""
        self.__dict__.pop("forms", None)

    def _columns(self, F: Ball) -> Ball:
        """S dlambda/dy, (2p, size)."""
        mid, rad = self._fixed.mid.copy(), self._fixed.rad.copy()
        k = self.rows.slip_columns
        moved = self._fixed[:, k] + F[self.rows.slip] * self._turning
        mid[:, k], rad[:, k] = moved.mid, moved.rad
        return Ball(mid, rad)

    def _slope(self) -> Ball:
        """dW/dalpha."""
        mid, rad = np.zeros_like(self._fixed.mid), np.zeros_like(self._fixed.mid)
        if not self.affine:
            moved = Ball.exact(self.system.F1[self.rows.slip]) * self._turning
            mid[:, self.rows.slip_columns], rad[:, self.rows.slip_columns] = moved.mid, moved.rad
        return Ball(mid, rad)


def _joined(*parts: Ball) -> Ball:
    return Ball(np.concatenate([b.mid for b in parts]), np.concatenate([b.rad for b in parts]))


def _affine(constant: Ball, slope: Ball, alpha: float) -> Ball:
    return constant + Ball.exact(np.full(1, alpha)) * slope
