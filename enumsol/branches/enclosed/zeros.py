"""Where conditions of a selection seem to vanish over an interval of alpha (theory, section 7.14).

Nothing here is trusted: bounds of a zero are proposed, and proven where signs at them are.
"""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np
from flint import arb

from enumsol.arithmetic.balls import TINY
from enumsol.trusted.arcs.taylor import ball_of, precision

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.support.array_types import Floats
    from enumsol.trusted.arcs.over_parts import Expansion
    from enumsol.trusted.arcs.taylor import AlphaFunctions, ShortExpansion

    Number = float | Fraction
    Bounds = tuple[Number, Number]

#: Zeros are enclosed to 2^-ZERO_BITS relative to the interval in many digits, and closer ones are one: with more bits
#: several zeros are told apart that rounding in PRECISION bits may hide.
ZERO_BITS = 200


class SeriesZeros:
    """Zeros of conditions over an interval, by their polynomials in double arithmetic.

    Attributes
    ----------
    expansion : Expansion
    apart : float
        Zeros closer than this are not told apart.
    rough : bool
        The series was truncated too early for bounds near those of rounding: the interval is long.
    final : bool
        False: zeros that are not told apart may be in a shorter interval.
    """

    final = False

    def __init__(self, expansion: Expansion) -> None:
        self.expansion, self.apart = expansion, 1e-5 * (expansion.high - expansion.low)
        self.rough = expansion.truncated and bool(np.median(expansion.error / (expansion.size + TINY)) > 1e-9)

    def split(self) -> Number | None:
        """None: cuts are made around zeros."""
        return None

    def zeros(self, condition: int) -> Sequence[Number]:
        """Alphas inside the interval at which a condition seems to vanish."""
        of = self.expansion
        polynomial = of.coefficients[condition]
        # trailing noise would only give roots far away
        noise = max(2.0**-48 * float(of.size[condition]), 0.01 * float(of.rounded[condition]))
        kept = np.flatnonzero(np.abs(polynomial) > noise)
        last = int(kept[-1]) if len(kept) else 0
        if last < 2:
            real = -polynomial[:1] / polynomial[1] if last else np.empty(0)
        else:
            roots = np.linalg.eigvals(_companion(polynomial[: last + 1]))
            # what is so near to a real number may be one
            real = np.sort(roots.real[np.abs(roots.imag) < 1e-2])
        found = [of.middle + of.radius * float(x) for x in real]
        return [alpha for alpha in found if of.low < alpha < of.high]

    def flat(self, condition: int) -> bool:
        """True if a condition is nowhere larger than the bound of its error allows to tell."""
        return bool(self.expansion.size[condition] <= 32.0 * self.expansion.rounded[condition])

    def near(self, condition: int, low: Number, high: Number) -> Bounds:
        """Presumed bounds of the only zero of a condition in a part."""
        of = self.expansion
        value, slope = of.coefficients[condition].tolist(), of.slope[condition].tolist()
        first, last = of.tau(float(low), float(high))
        tau, rise = 0.5 * (first + last), 0.0
        for _ in range(4):
            rise = _horner(slope, tau)
            step = _horner(value, tau) / rise if rise else np.inf
            tau = min(max(tau - step, first), last)
        zero = of.middle + of.radius * tau
        reach = 1.01 * float(of.rounded[condition]) / abs(rise) * of.radius if rise else np.inf
        reach += 32.0 * float(np.spacing(max(abs(of.low), abs(of.high))))
        return zero - reach, zero + reach

    def zero_bounds(self, condition: int, slope: int, low: Number, high: Number) -> Bounds:
        """Proven bounds of the only zero of a condition in a part, at whose ends it has opposite signs.

        ``slope`` is the sign of its slope there.
        """
        selection = self.expansion.selection
        zero = float(next((alpha for alpha in self.zeros(condition) if low < alpha < high), 0.5 * (low + high)))
        found, rise = selection.at(zero), self._rise(condition, zero)
        if found is None or not np.isfinite(rise) or rise * slope <= 0.0:
            return low, high
        zero -= float(found[2].mid[condition]) / rise
        width = 4.0 * float(found[2].rad[condition]) / abs(rise) + 2.0 * float(np.spacing(abs(zero)))
        for _ in range(60):
            first, last = zero - width, zero + width
            if not low <= first < last <= high:
                break
            if [selection.sign_at(alpha, condition) for alpha in (first, last)] == [-slope, slope]:
                return first, last
            width *= 2.0
        return low, high

    def _rise(self, condition: int, alpha: float) -> float:
        """Slope of a condition over t at an alpha at which it vanishes, nearly."""
        of = self.expansion
        tau = (alpha - of.middle) / of.radius
        t = _horner(of.coefficients[-1].tolist(), tau)
        return _horner(of.slope[condition].tolist(), tau) / t / of.radius if t else np.inf


class ShortZeros:
    """Zeros of conditions, and of det M as the last, over a short interval, in many digits.

    Attributes
    ----------
    expansion : ShortExpansion
    apart : Fraction
        Zeros closer than this are not told apart.
    rough, final : bool
        A shorter interval gives neither smaller errors, nor does it tell more zeros apart.
    """

    rough, final = False, True

    def __init__(self, expansion: ShortExpansion) -> None:
        self.expansion, self.apart = expansion, (expansion.high - expansion.low) * Fraction(4, 2**ZERO_BITS)
        with precision():
            values = expansion.values.entries()
            self._small = [bool(abs(value) < arb(2) ** -ZERO_BITS) for value in values]
            #: about where conditions vanish, by tau in [-1, 1], with the signs of their slopes
            self._crossings: list[tuple[int, float]] = []
            if expansion.near is not None:
                near, slopes = expansion.near.entries(), expansion.slopes.entries()
                self._crossings = [
                    (rise, -float((near[k] / slopes[k]).mid()))
                    for k, rise in enumerate(expansion.rises.tolist())
                    if rise
                ]

    def split(self) -> Number | None:
        """An alpha below which one condition seems to be negative, and above which another, if there is one."""
        rising, falling = ([tau for rise, tau in self._crossings if rise == sign] for sign in (1, -1))
        # zeros are farther apart (tau), or the rounding of floats hides it
        if not rising or not falling or max(rising) - min(falling) < 1e-12:
            return None
        tau, low, high = 0.5 * (max(rising) + min(falling)), self.expansion.low, self.expansion.high
        return low + Fraction(1 + tau) * (high - low) / 2 if abs(tau) < 1.0 else None

    def near(self, condition: int, low: Number, high: Number) -> Bounds:
        """Nothing yet: bounds are found at once, by ``zero_bounds``."""
        return low, low

    def zeros(self, condition: int) -> Sequence[Number]:
        """Alphas inside the interval at which a condition seems to vanish."""
        of = self.expansion
        if not of.rises[condition]:
            return []
        found = newton(of.functions, condition, (of.low, of.high), self.apart / 4)
        return [] if found is None or not of.low < found < of.high else [found]

    def flat(self, condition: int) -> bool:
        """True if a condition cannot be distinguished from zero."""
        return self._small[condition]

    def zero_bounds(self, condition: int, slope: int, low: Number, high: Number) -> Bounds:
        """Proven bounds of the only zero of a condition in a part, at whose ends it has opposite signs."""
        part = Fraction(low), Fraction(high)
        return enclosed(self.expansion.functions, condition, *part) or part


def zeros_of(expansion: Expansion | ShortExpansion) -> SeriesZeros | ShortZeros:
    """Zeros of an expansion, in its arithmetic."""
    return ShortZeros(expansion) if isinstance(expansion.low, Fraction) else SeriesZeros(expansion)


def newton(
    functions: AlphaFunctions, k: int, ends: tuple[Fraction, Fraction], width: Fraction, steps: int = 10
) -> Fraction | None:
    """Alpha between two at which a function seems to vanish, to a part of ``width``."""
    low, high = ends
    with precision():
        alpha, unit = (low + high) / 2, width / 2**8
        for _ in range(steps):
            found = _value_and_slope(functions, ball_of(alpha), k)
            if found is None:
                return None
            value, slope = (x.mid() for x in found)
            if not value.is_finite() or not slope.is_finite() or slope == 0:
                return None
            step = _fraction_of((value / slope).mid())
            alpha = _rounded(alpha - step, low, high, unit)
            # the next step is about the square of this one
            if step * step <= unit * (high - low):
                break
        return alpha


def enclosed(
    functions: AlphaFunctions, k: int, low: Fraction, high: Fraction, width: Fraction | None = None
) -> tuple[Fraction, Fraction] | None:
    """Bounds of the only zero of a function between two alphas: its signs there are proven to be opposite.

    They are about ``width`` apart, by default as close as zeros are told apart.
    """
    width = Fraction(1, 2**ZERO_BITS) * (high - low) if width is None else width
    # bounds that are narrow beside the distances at which conditions bend, by this share of alpha, are so near that one
    # step is enough
    near = high - low <= Fraction(1, 2**30) * max(abs(low), abs(high))
    for steps, widenings in ((1, 1), (10, 6))[not near :]:
        alpha = newton(functions, k, (low, high), width, steps)
        if alpha is None:
            return None
        reach = width
        for _ in range(widenings):
            ends = max(alpha - reach, low), min(alpha + reach, high)
            below, above = (functions.signs_at(end) for end in ends)
            if below is not None and above is not None and int(below[k]) * int(above[k]) < 0:
                return ends
            reach *= 2**20
    return None


def _value_and_slope(of: AlphaFunctions, a: arb, k: int) -> tuple[Any, Any] | None:
    """About the value of a function and its slope."""
    if of.lines is not None:
        constant, slope = (part[k, 0] for part in of.lines)
        return constant + slope * a, slope
    X = of.solve(a, "approx")
    if X is None:
        return None
    M, C, c = (part[0] + part[1] * a for part in (of.M, of.C, of.c))
    X1 = M.solve(of.g[1] - of.M[1] * X, algorithm="approx") if M.nrows() else X
    Y, Y1, j = C * X, of.C[1] * X + C * X1, X.ncols() - 1
    q, q1 = c[k, 0] + Y[k, j], of.c[1][k, 0] + Y1[k, j]
    if not j:
        return q, q1
    # with a border
    (mu, rho), (mu1, rho1) = X.tolist()[-1], X1.tolist()[-1]
    return q * mu - Y[k, 0] * rho, q1 * mu + q * mu1 - Y1[k, 0] * rho - Y[k, 0] * rho1


def _rounded(alpha: Fraction, low: Fraction, high: Fraction, unit: Fraction) -> Fraction:
    """An alpha within bounds at a multiple of a unit from the first: ends of enclosures keep few digits."""
    return min(max(low + round((alpha - low) / unit) * unit, low), high)


def _fraction_of(value: arb) -> Fraction:
    """The exact value of an arb without radius."""
    mantissa, exponent = (int(part) for part in value.man_exp())
    return Fraction(mantissa) * Fraction(2) ** exponent


def _companion(polynomial: Floats) -> Floats:
    """A matrix whose eigenvalues are the zeros."""
    degree = len(polynomial) - 1
    found = np.eye(degree, k=-1)
    found[:, -1] = -polynomial[:-1] / polynomial[-1]
    return found


def _horner(polynomial: Sequence[float], tau: float) -> float:
    value = 0.0
    for coefficient in reversed(polynomial):
        value = value * tau + coefficient
    return value
