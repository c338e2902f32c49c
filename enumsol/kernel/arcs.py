"""The trusted kernel over alpha: where one selection holds, and where its conditions vanish (theory, section 7.14).

A selection with unknowns y (lambda_n of the nodes in contact, lambda_t of the sticking ones) asks for M(alpha) y =
g_R(alpha), both affine in alpha. Here it is written with one unknown more: N(alpha) z = e for z = (y, t), where N has
the rows [M, -g_R] and one row v', and e is the last unit vector. Where N is regular and t is not zero, y / t is the
selection's only solution; where t = 0 there is none. So zeros of det M need no care, as long as N is regular there.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from math import comb
from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, gamma, upper_sum
from enumsol.condensation.enclosure import NotEnclosedError
from enumsol.kernel.ball_arrays import Ball, Inverse, determinant_sign, solution
from enumsol.kernel.selection_rows import SelectionRows

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from enumsol.condensation.enclosure import CondensedEnclosure

    Array = NDArray[np.float64]
    Signs = NDArray[np.int8]

#: Terms of the series of z, squarings of its resolvent's bound, and the largest such bound.
_TERMS, _SQUARINGS, _LARGEST_GROWTH = 16, 6, 1e6
#: Smallest quotient of units, far above underflow.
_LEAST_PAIR = 2.0**-1000
#: Largest coefficients with which sums do not overflow.
_LARGEST = 2.0**1000
#: Imaginary parts (tau) of what counts as a zero, and sizes by error bounds of what counts as flat, and errors
#: of what counts as rough; for guesses.
_NEAR_REAL, _FLAT, _ROUGH = 1e-2, 32.0, 1e-9
#: Zeros closer than this, relative to their interval, are not told apart; a zero's first enclosure by its radius, and
#: enlargements of it.
_APART, _MARGIN, _WIDENINGS = 1e-5, 4.0, 60


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
        """An enclosed problem; with ``side`` 1 or -1 for the constant load +-g1 (see kernel.interval)."""
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


@dataclass(frozen=True)
class OverInterval:
    """What is known of a selection over an interval of alpha.

    Attributes
    ----------
    conditions : int8 array
        1 or -1 where a condition of ``SelectionRows.conditions`` is positive or negative throughout, else 0.
    regular : bool
        The selection has exactly one solution at every alpha.
    none : bool
        It has no root at any alpha.
    """

    conditions: Signs
    regular: bool
    none: bool

    @property
    def holds(self) -> bool:
        """Whether the selection has exactly one root at every alpha, with all conditions strict."""
        return self.regular and bool(np.all(self.conditions > 0))

    @property
    def doubtful(self) -> NDArray[np.intp]:
        """Numbers of the conditions whose signs are not known."""
        return np.flatnonzero(self.conditions == 0)


class Expansion:
    """Conditions of a selection over [low, high] as polynomials in tau with bounds of their errors; t is the last.

    tau runs from -1 to 1. At every alpha they are the conditions of z, that is t times those of y.

    Attributes
    ----------
    low, high : float
    apart : float
        Zeros closer than this are not told apart.
    final : bool
        False: they may be in a shorter interval.
    """

    final = False

    def __init__(
        self,
        ends: tuple[float, float],
        scale: tuple[float, float],
        coefficients: Array,
        error: Array,
        slope_error: Array,
        bordered: Ball,
        selection: ArcSelection,
    ) -> None:
        self.low, self.high = ends
        self.apart = _APART * (ends[1] - ends[0])
        self._selection = selection
        self._middle, self._radius = scale
        self._bordered = bordered
        self._coefficients, self._error, self._slope_error = coefficients, error, slope_error
        self._slope = coefficients[:, 1:] * np.arange(1, coefficients.shape[1])
        # the sums below have coefficients of Bernstein polynomials that add up to at most these sizes
        k = gamma(8 * coefficients.shape[1])
        self._rounded = (error + k * upper_sum(np.abs(coefficients), axis=1)) * SAFE
        self._slope_rounded = (slope_error + k * upper_sum(np.abs(self._slope), axis=1)) * SAFE

    def over(self, low: float, high: float) -> OverInterval:
        """What is known over a part of the interval."""
        signs = _bernstein_signs(self._coefficients, self._rounded, *self._tau(low, high))
        # a root has all conditions >= 0 where t > 0, or all <= 0 where t < 0
        none = bool(np.any(signs < 0) and np.any(signs > 0))
        return OverInterval(signs[:-1] * np.int8(-1 if signs[-1] < 0 else 1), bool(signs[-1]), none)

    def slopes(self, low: float, high: float) -> Signs:
        """1 or -1 where a positive multiple of a condition grows or falls with alpha over a part, else 0.

        Only where the selection is regular there.
        """
        part = self._tau(low, high)
        t = _bernstein_signs(self._coefficients[-1:], self._rounded[-1:], *part)[0]
        return np.asarray(_bernstein_signs(self._slope, self._slope_rounded, *part)[:-1] * t, dtype=np.int8)

    def index(self, low: float, high: float) -> int:
        """Sign of det M over a part, 0 where it is not proven."""
        # by Cramer's rule t = det M / det N, and N is regular throughout
        t = _bernstein_signs(self._coefficients[-1:], self._rounded[-1:], *self._tau(low, high))[0]
        return int(t) * self._orientation

    @cached_property
    def _orientation(self) -> int:
        """Sign of det N."""
        return determinant_sign(self._bordered)

    def zeros(self, condition: int) -> list[float]:
        """Alphas inside the interval at which a condition seems to vanish; no claim rests on them."""
        polynomial = self._coefficients[condition]
        # trailing noise would only give roots far away
        kept = np.flatnonzero(np.abs(polynomial) > UNIT * np.max(np.abs(polynomial)))
        roots = np.roots(polynomial[: kept[-1] + 1][::-1]) if len(kept) else np.empty(0)
        real = np.sort(roots.real[np.abs(roots.imag) < _NEAR_REAL])
        found = [self._middle + self._radius * float(x) for x in real]
        return [alpha for alpha in found if self.low < alpha < self.high]

    @property
    def rough(self) -> bool:
        """Whether the series was truncated too early for bounds near those of rounding: the interval is long."""
        size = np.sum(np.abs(self._coefficients), axis=1)
        return bool(np.median(self._error / (size + TINY)) > _ROUGH)

    def flat(self, condition: int) -> bool:
        """Whether a condition is nowhere larger than the bound of its error allows to tell."""
        return bool(np.sum(np.abs(self._coefficients[condition])) <= _FLAT * self._rounded[condition])

    def zero_bounds(self, condition: int, slope: int, low: float, high: float) -> tuple[float, float]:
        """Bounds of the only zero of a condition in a part, at whose ends it has opposite signs.

        ``slope`` is the sign of its slope there.
        """
        zero = next((alpha for alpha in self.zeros(condition) if low < alpha < high), 0.5 * (low + high))
        found, rise = self._selection.at(zero), self._rise(condition, zero)
        if found is None or not np.isfinite(rise) or rise * slope <= 0.0:
            return low, high
        zero -= float(found[2].mid[condition]) / rise
        width = _MARGIN * float(found[2].rad[condition]) / abs(rise) + 2.0 * float(np.spacing(abs(zero)))
        for _ in range(_WIDENINGS):
            first, last = zero - width, zero + width
            if not low <= first < last <= high:
                break
            if [self._selection.sign_at(alpha, condition) for alpha in (first, last)] == [-slope, slope]:
                return first, last
            width *= 2.0
        return low, high

    def _rise(self, condition: int, alpha: float) -> float:
        """Slope of a condition over t at an alpha at which it vanishes, nearly."""
        tau = (alpha - self._middle) / self._radius
        t = np.polynomial.polynomial.polyval(tau, self._coefficients[-1])
        return float(np.polynomial.polynomial.polyval(tau, self._slope[condition]) / t / self._radius)

    def _tau(self, low: float, high: float) -> tuple[float, float]:
        """The part in terms of tau, rounded outward."""
        slack = 8.0 * UNIT * (1.0 + max(abs(self.low), abs(self.high)) / self._radius)
        ends = (low - self._middle) / self._radius - slack, (high - self._middle) / self._radius + slack
        return max(ends[0], -1.0), min(ends[1], 1.0)


class ArcSelection:
    """One selection as a function of alpha.

    Parameters
    ----------
    system : ArcSystem
    codes : p status codes, complete

    Attributes
    ----------
    system : ArcSystem
    rows : SelectionRows
    """

    def __init__(self, system: ArcSystem, codes: Sequence[int]) -> None:
        self.system = system
        self.rows = rows = SelectionRows(codes)
        self._size = len(rows.unknown)
        self._fixed = system.S[:, rows.unknown]
        turning = system.S[:, system.p + rows.slip]
        self._turning = Ball(turning.mid * rows.slip_signs, turning.rad)

    # -- what is proven --------------------------------------------------------------------------------------------

    def expansion(self, low: float, high: float, errors: float = 1.0) -> Expansion | None:
        """The conditions over [low, high] as polynomials; None where the interval is too long.

        Bounds of errors are multiplied by ``errors``: a search asks for more than its checker, which may round
        otherwise.
        """
        middle = 0.5 * (low + high)
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            v = self._direction(middle)
            return None if v is None else self._expansion((low, high), v, errors)

    def at(self, alpha: float) -> tuple[Ball, Ball, Ball] | None:
        """lambda, w and the conditions at one alpha, scaled; None where the selection is not proven regular."""
        p, rows = self.system.p, self.rows.unknown
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            F, g = self._friction(alpha), self._load(alpha)
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

    # -- evaluation ------------------------------------------------------------------------------------------------

    def _friction(self, alpha: float) -> Ball:
        return _affine(Ball.exact(self.system.F0), Ball.exact(self.system.F1), alpha)

    def _columns(self, F: Ball) -> Ball:
        """S dlambda/dy, (2p, size)."""
        mid, rad = self._fixed.mid.copy(), self._fixed.rad.copy()
        k = self.rows.slip_columns
        moved = self._fixed[:, k] + F[self.rows.slip] * self._turning
        mid[:, k], rad[:, k] = moved.mid, moved.rad
        return Ball(mid, rad)

    @cached_property
    def _regular(self) -> bool:
        """Whether a constant M is proven regular."""
        return not self._size or Inverse.of(self._columns(self._friction(0.0))[self.rows.unknown]) is not None

    @property
    def _plain(self) -> Array:
        """The last row of N with which t = 1."""
        v = np.zeros(self._size + 1)
        v[-1] = 1.0
        return v

    def _direction(self, alpha: float) -> Array | None:
        """The last row of N: z at this alpha, of length one, so that N is regular even where det M vanishes."""
        if not np.any(self.system.F1[self.rows.slip]) and self._regular:
            return self._plain  # z is affine
        M, g = self._columns(self._friction(alpha)).mid[self.rows.unknown], self._load(alpha).mid[self.rows.unknown]
        try:
            v = np.append(np.linalg.solve(M, g), 1.0)
        except np.linalg.LinAlgError:
            v = np.array([np.inf])
        if not np.all(np.isfinite(v)):
            try:
                v = np.linalg.svd(np.column_stack([M, -g]))[2][-1]
            except np.linalg.LinAlgError:
                return None
        return np.asarray(v / np.linalg.norm(v))

    def _load(self, alpha: float) -> Ball:
        return _affine(self.system.g0, self.system.g1, alpha)

    def _expansion(self, ends: tuple[float, float], v: Array, errors: float) -> Expansion | None:
        middle = 0.5 * (ends[0] + ends[1])
        # so much more that tau stays within [-1, 1] where it is rounded
        radius = max(ends[1] - middle, middle - ends[0]) * (1.0 + 2.0**-20) + TINY
        F, g = self._friction(middle), self._load(middle)
        step = Ball.exact(np.full(1, radius))
        W, W1, g1 = self._columns(F), self._slope() * step, self.system.g1 * step
        N, N1 = self._bordered(W, g, v), self._bordered(W1, g1, np.zeros_like(v))
        inverse = Inverse.of(N)
        if inverse is None:
            return None
        # N(tau) = N + tau N1, and z = sum of z_k tau^k with z_k = -N^{-1} N1 z_{k-1}
        P = inverse.solve(N1)
        z = np.zeros((len(v), _TERMS))
        z[:, 0] = inverse.solve(_unit(len(v))).mid[:, 0]
        for k in range(1, _TERMS):
            z[:, k] = -P.mid @ z[:, k - 1]
        size = np.sum(np.abs(z), axis=1)
        u = size + 1e-3 * np.max(size)
        if not np.all(np.isfinite(u)):
            return None
        growth = _resolvent(P, u)
        if growth is None:
            return None
        # residuals of the truncated series, by powers of tau
        Z = Ball.exact(z)
        rest = Ball(np.zeros((len(v), _TERMS + 1)), np.zeros((len(v), _TERMS + 1)))
        rest.mid[-1, 0] = 1.0
        rest = rest - _shifted(N @ Z, N1 @ Z)
        defect = np.max(inverse.solve(rest).size / u[:, None], axis=0)
        error = growth * float(upper_sum(defect)) * SAFE
        powers = np.arange(_TERMS + 1)
        norm = float(np.max(upper_sum(P.size * u, axis=1) / u))
        slope_error = growth * (float(upper_sum(defect * powers)) + norm * error) * SAFE * SAFE
        F1 = Ball.exact(self.system.F1) * step
        coefficients, off, off_slope = self._polynomials((W, W1), (g, g1), (F, F1), Z, u, (error, slope_error))
        if not np.max(np.abs(coefficients)) < _LARGEST:
            return None
        return Expansion(ends, (middle, radius), coefficients, errors * off, errors * off_slope, N, self)

    def _slope(self) -> Ball:
        """dW/dalpha."""
        mid, rad = np.zeros_like(self._fixed.mid), np.zeros_like(self._fixed.mid)
        moved = Ball.exact(self.system.F1[self.rows.slip]) * self._turning
        mid[:, self.rows.slip_columns], rad[:, self.rows.slip_columns] = moved.mid, moved.rad
        return Ball(mid, rad)

    def _bordered(self, W: Ball, g: Ball, v: Array) -> Ball:
        k = self._size
        mid, rad = np.empty((k + 1, k + 1)), np.zeros((k + 1, k + 1))
        mid[:k, :k], rad[:k, :k] = W.mid[self.rows.unknown], W.rad[self.rows.unknown]
        mid[:k, k], rad[:k, k] = -g.mid[self.rows.unknown], g.rad[self.rows.unknown]
        mid[k] = v
        return Ball(mid, rad)

    def _polynomials(
        self,
        columns: tuple[Ball, Ball],
        load: tuple[Ball, Ball],
        friction: tuple[Ball, Ball],
        Z: Ball,
        u: Array,
        errors: tuple[float, float],
    ) -> tuple[Array, Array, Array]:
        """Coefficients of the conditions and bounds of the errors of values and slopes.

        z is a series whose error is at most ``errors[0]`` u, and that of its slope ``errors[1]`` u.
        """
        (W, W1), (g, g1), (F, F1) = columns, load, friction
        rows, closed = self.rows.moving, len(self.rows.closed)
        y, t = Z[:-1], Z[-1:]
        parts, moving = [], []

        def add(constant: Ball, slope: Ball, reach: Array, turn: Array) -> None:
            # c0 z + tau c1 z, where |c0| u and |c1| u are at most reach and turn
            parts.append(_shifted(constant, slope))
            moving.append((reach, turn))

        signs = self.rows.moving_signs[:, None]
        w = g[rows][:, None] * t - W[rows] @ y
        w1 = g1[rows][:, None] * t - W1[rows] @ y
        add(
            Ball(signs * w.mid, w.rad),
            Ball(signs * w1.mid, w1.rad),
            g[rows].size * u[-1] + W[rows].size @ u[:-1],
            g1[rows].size * u[-1] + W1[rows].size @ u[:-1],
        )
        nothing = Ball.exact(np.zeros((closed, _TERMS)))
        add(y[:closed], nothing, u[:closed], np.zeros(closed))
        held, stuck, j = y[self.rows.stick_columns], y[closed:], self.rows.stick_columns
        bound, bound1 = F[self.rows.stick][:, None] * held, F1[self.rows.stick][:, None] * held
        reach, turn = F[self.rows.stick].size * u[j] + u[closed:-1], F1[self.rows.stick].size * u[j]
        add(bound - stuck, bound1, reach, turn)
        add(bound + stuck, bound1, reach, turn)
        add(t, Ball.exact(np.zeros((1, _TERMS))), u[-1:], np.zeros(1))
        coefficients = np.concatenate([part.mid for part in parts])
        radius = np.concatenate([part.rad for part in parts])
        reach, turn = (np.concatenate([pair[k] for pair in moving]) for k in (0, 1))
        k = 1.0 + gamma(2 * len(u) + 8)
        error = (upper_sum(radius, axis=1) + (reach + turn) * (errors[0] * k)) * SAFE
        slope_error = upper_sum(radius * np.arange(_TERMS + 1), axis=1)
        slope_error = (slope_error + (reach + turn) * (errors[1] * k) + turn * (errors[0] * k)) * SAFE
        return coefficients, error, slope_error


def _joined(*parts: Ball) -> Ball:
    return Ball(np.concatenate([b.mid for b in parts]), np.concatenate([b.rad for b in parts]))


def _unit(size: int) -> Ball:
    """The last unit vector, as a column."""
    e = np.zeros((size, 1))
    e[-1] = 1.0
    return Ball.exact(e)


def _shifted(constant: Ball, slope: Ball) -> Ball:
    """Coefficients of a + tau b, given those of a and b by powers of tau."""
    rows = len(constant.mid)
    none = np.zeros((rows, 1))

    def sides(first: Array, second: Array) -> tuple[Array, Array]:
        return np.hstack([first, none]), np.hstack([none, second])

    mids, rads = sides(constant.mid, slope.mid), sides(constant.rad, slope.rad)
    return Ball(mids[0], rads[0]) + Ball(mids[1], rads[1])


def _resolvent(P: Ball, u: Array) -> float | None:
    """Bound of (I + tau P)^{-1} for |tau| <= 1 in the norm max |x| / u; None where none is found.

    With X = -tau P it is (I + X)(I + X^2)(I + X^4) ... (I - X^q)^{-1}, q a power of two.
    """
    bound = 1.0
    for _ in range(_SQUARINGS):
        norm = float(np.max(upper_sum(P.size * u, axis=1) / u)) * SAFE
        if norm < 0.5:
            return bound / (1.0 - norm) * SAFE
        bound *= (1.0 + norm) * SAFE
        if not bound < _LARGEST_GROWTH:
            return None
        P = P @ P
    return None


def _bernstein_signs(coefficients: Array, error: Array, low: float, high: float) -> Signs:
    """1 or -1 where a polynomial is proven positive or negative over [low, high], else 0."""
    values = coefficients @ _to_bernstein(coefficients.shape[1] - 1, low, high)
    positive, negative = np.min(values, axis=1) > error, np.max(values, axis=1) < -error
    return np.asarray(positive.astype(np.int8) - negative.astype(np.int8))


def _to_bernstein(degree: int, low: float, high: float) -> Array:
    """Bernstein coefficients over [low, high] of 1, tau, ..., a row each.

    That of number j of tau^k is the mean of the products of k of the numbers low, .., low, high, .., high, of which j
    are high: a sum of terms whose sizes add up to at most one, for |low|, |high| <= 1.
    """
    powers = np.arange(degree + 1)
    # by products, whose rounding is known
    factors = np.ones((2, degree + 1))
    factors[0, 1:], factors[1, 1:] = low, high
    of_low, of_high = np.multiply.accumulate(factors, axis=1)
    lows = np.where(powers[:, None] >= powers, of_low[np.maximum(powers[:, None] - powers, 0)], 0.0)
    return np.asarray(np.einsum("jki,ki,i->kj", _weights(degree), lows, of_high))


@cache
def _weights(degree: int) -> Array:
    """Shares of high^i low^(k - i) in Bernstein coefficient j of tau^k, by [j, k, i]."""
    n = range(degree + 1)
    return np.array(
        [[[comb(j, i) * comb(degree - j, k - i) / comb(degree, k) if i <= k else 0.0 for i in n] for k in n] for j in n]
    )


def _affine(constant: Ball, slope: Ball, alpha: float) -> Ball:
    return constant + Ball.exact(np.full(1, alpha)) * slope


def _negative(b: Ball) -> Ball:
    return Ball(-b.mid, b.rad)
