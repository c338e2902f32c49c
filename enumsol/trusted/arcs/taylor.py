"""Functions that depend smoothly on alpha over a short interval, in balls of many digits (theory, section 7.14).

Alpha is given by tau in [-1, 1]; the unknowns of linear equations are polynomials in tau, with balls around zero for
what is left of them and of their slopes. Conditions whose slopes have one sign are known from their values at both
ends.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from flint import arb, arb_mat

from enumsol.arithmetic.balls import SAFE, UNIT, upper_sum
from enumsol.trusted.arcs.many_digits import (
    ZERO_BITS,
    ball_of,
    column,
    fraction_of,
    matrix,
    precision,
    rounded,
    signs_of,
    uppers,
)
from enumsol.trusted.arcs.over_parts import OverInterval

if TYPE_CHECKING:
    from enumsol.support.array_types import Floats, NDArray

    Signs = NDArray[np.int8]
    Number = float | Fraction
    Bounds = tuple[Fraction, Fraction]

#: Powers of tau in the unknowns.
_TERMS = 12
#: Bound of how much M may change over an interval; of this the norm is chosen where that is small enough; and steps
#: to such a norm.
_LARGEST_SHIFT, _SMALL_SHIFT, _STEPS = 0.5, 0.25, 20
#: Steps of Newton's method to a zero, and enlargements of its bounds.
_NEWTON_STEPS, _WIDENINGS = 10, 6


@dataclass(frozen=True, eq=False)
class Smooth:
    """Functions of tau, the entries of columns.

    Attributes
    ----------
    terms : list of columns
        Coefficients of the powers of tau.
    left, left_slope : columns
        Balls that hold what is left, and its slopes.
    shift : float
        Bound of how much the matrix changes of the equations that they solve.
    """

    terms: list[Any]
    left: Any
    left_slope: Any
    shift: float = 0.0

    @classmethod
    def solution(cls, y: arb_mat, rise: arb_mat, P: arb_mat, sizes: Floats | None = None) -> Smooth | None:
        """The unknowns of M y = g, with y and their slopes ``rise`` at tau = 0 and P = M(0)^{-1} M'.

        They are y + tau (I + tau P)^{-1} rise (theory, (7.16)). None where P is too large. ``sizes`` are at least those
        of the entries of P, if they are known.
        """
        terms = [y, rise]
        while len(terms) <= _TERMS:
            terms.append(-(P * terms[-1]))
        rest = P * terms[-1]
        found = _norm(uppers(rise)[:, 0], uppers(P) if sizes is None else sizes)
        if found is None:
            return None
        u, k = found
        norm = float(np.max(uppers(rest)[:, 0] / u)) * SAFE
        # ||P^m d|| times bounds of (I + tau P)^-1, and of the slope of tau^(m + 1) (I + tau P)^-1
        growths = 1.0 / (1.0 - k), (_TERMS + 1) / (1.0 - k) + k / (1.0 - k) ** 2
        # covers underflow of some products
        errors = [u * (norm * growth * (1.0 + 16 * UNIT) * SAFE) + 2.0**-1070 for growth in growths]
        left, left_slope = (column([arb(0, float(e)) for e in error]) for error in errors)
        return cls(terms, left, left_slope, k)

    def mapped(self, C: arb_mat, C1: arb_mat, c: arb_mat, c1: arb_mat) -> Smooth:
        """(c + tau c1) + (C + tau C1) times these functions."""
        before = [None, *self.terms]
        terms = [
            (C * term if term is not None else c * 0) + (C1 * last if last is not None else c * 0)
            for term, last in zip([*self.terms, None], before, strict=True)
        ]
        terms[0], terms[1] = terms[0] + c, terms[1] + c1
        turned = C + C1 * arb(0, 1)
        return Smooth(terms, turned * self.left, C1 * self.left + turned * self.left_slope, self.shift)

    def entry(self, i: int) -> Smooth:
        """A single function among them."""
        return Smooth(
            [column([x[i, 0]]) for x in self.terms], *(column([x[i, 0]]) for x in (self.left, self.left_slope))
        )

    @cached_property
    def values(self) -> Any:
        """All values."""
        found = self.left
        for k, term in enumerate(self.terms):
            found = found + term * _power(k)
        return found

    @cached_property
    def slopes(self) -> Any:
        """All slopes."""
        found = self.left_slope
        for k, term in enumerate(self.terms[1:]):
            found = found + term * (_power(k) * (k + 1))
        return found

    def times(self, factor: Smooth) -> Smooth:
        """Every one of them times the one function ``factor``."""
        scalars = [term[0, 0] for term in factor.terms]
        nothing = self.left * 0
        terms = [nothing] * (len(self.terms) + len(scalars) - 1)
        for i, term in enumerate(self.terms):
            for j, scalar in enumerate(scalars):
                terms[i + j] = terms[i + j] + term * scalar
        # (f + e) (p + r) - f p = e (p + r) + f r
        whole, whole_slope = factor.values[0, 0], factor.slopes[0, 0]
        left, left_slope = factor.left[0, 0], factor.left_slope[0, 0]
        smooth = Smooth(self.terms, nothing, nothing)
        rest = self.left * whole + smooth.values * left
        rest_slope = (
            self.left * whole_slope + self.left_slope * whole + smooth.slopes * left + smooth.values * left_slope
        )
        return Smooth(terms, rest, rest_slope)

    def minus(self, other: Smooth) -> Smooth:
        """The difference of functions of equally many terms."""
        terms = [a - b for a, b in zip(self.terms, other.terms, strict=True)]
        return Smooth(terms, self.left - other.left, self.left_slope - other.left_slope)


def _norm(sizes: Floats, P: Floats) -> tuple[Floats, float] | None:
    """u > 0 and k with ||P|| <= k in the norm max |x| / u; None where k is too large.

    u has the proportions of ``sizes``, unless k is smaller with some parts of it larger.
    """
    largest = float(np.max(sizes))
    # rises that count as none where norms are chosen
    least = u = sizes / largest + 1e-3 if largest > 1e-250 else np.ones(len(sizes))
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(_STEPS):
            grown = upper_sum(P * u, axis=1)
            k = float(np.max(grown / u)) * SAFE
            if k < _SMALL_SHIFT:
                break
            u = np.maximum(least, grown / _SMALL_SHIFT)
    return (u, k) if k < _LARGEST_SHIFT and np.all(np.isfinite(u)) else None


def _power(k: int) -> Any:
    """All values of tau^k."""
    return arb(1) if k == 0 else arb(0.5, 0.5) if k % 2 == 0 else arb(0, 1)


def joined(*parts: arb_mat) -> Any:
    """Matrices beside one another."""
    return matrix([[x for row in rows for x in row] for rows in zip(*(part.tolist() for part in parts), strict=True)])


def columns_of(X: arb_mat, *counts: int) -> list[Any]:
    """A matrix cut into matrices of so many columns."""
    rows, found, first = X.tolist(), [], 0
    for count in counts:
        found.append(matrix([row[first : first + count] for row in rows]))
        first += count
    return found


class AlphaFunctions:
    """Functions of alpha with the signs of a selection's conditions; the last has that of det M times a constant."""

    @cached_property
    def _signs(self) -> dict[Fraction, Signs | None]:
        return {}

    def signs_by(self, a: arb, algorithm: str | None) -> Signs | None:
        """Signs of the functions over a ball; None where the equations are not proven regular."""
        raise NotImplementedError

    def rise(self, a: arb, k: int) -> tuple[Any, Any] | None:
        """About the value of a function and its slope; no claim rests on them."""
        raise NotImplementedError

    def signs_at(self, alpha: Fraction) -> Signs | None:
        """1 or -1 where a function is positive or negative at an alpha, else 0; None where it is not regular."""
        if alpha not in self._signs:
            with precision():
                # the faster way gives wider balls
                signs = self.signs_by(ball_of(alpha), "lu")
                self._signs[alpha] = (
                    self.signs_by(ball_of(alpha), None) if signs is None or not np.all(signs) else signs
                )
        return self._signs[alpha]

    def newton(
        self, k: int, low: Fraction, high: Fraction, width: Fraction, steps: int = _NEWTON_STEPS
    ) -> Fraction | None:
        """Alpha between two at which a function seems to vanish, to a part of ``width``; no claim rests on it."""
        with precision():
            alpha, unit = (low + high) / 2, width / 2**8
            for _ in range(steps):
                found = self.rise(ball_of(alpha), k)
                if found is None:
                    return None
                value, slope = (x.mid() for x in found)
                if not value.is_finite() or not slope.is_finite() or slope == 0:
                    return None
                step = fraction_of((value / slope).mid())
                alpha = rounded(alpha - step, low, high, unit)
                # the next step is about the square of this one
                if step * step <= unit * (high - low):
                    break
            return alpha

    def enclosed(self, k: int, low: Fraction, high: Fraction, width: Fraction | None = None) -> Bounds | None:
        """Bounds of the only zero of a function between two alphas: its signs there are proven to be opposite.

        They are about ``width`` apart, by default as close as zeros are told apart.
        """
        width = Fraction(1, 2**ZERO_BITS) * (high - low) if width is None else width
        # bounds that are narrow already are so near that one step is enough
        # intervals shorter than this share of alpha are narrow beside the distances at which conditions bend
        near = high - low <= Fraction(1, 2**30) * max(abs(low), abs(high))
        for steps, widenings in ((1, 1), (_NEWTON_STEPS, _WIDENINGS))[not near :]:
            alpha = self.newton(k, low, high, width, steps)
            if alpha is None:
                return None
            reach = width
            for _ in range(widenings):
                ends = max(alpha - reach, low), min(alpha + reach, high)
                below, above = (self.signs_at(end) for end in ends)
                if below is not None and above is not None and int(below[k]) * int(above[k]) < 0:
                    return ends
                reach *= 2**20
        return None


class ShortExpansion:
    """Conditions of a selection over a short interval, like ``over_parts.Expansion``.

    Parameters
    ----------
    functions : AlphaFunctions
    low, high : Fraction
    values, slopes : columns
        Those of the functions over the whole interval.
    orientation : int
        Sign of det M where the last function is positive.
    shift : float
        Bound of how much the matrix of the equations changes.
    nowhere : bool
        The selection has no root, whatever the signs of the functions are.
    near : column, optional
        Values of the conditions in the middle, where M is regular throughout.

    Attributes
    ----------
    apart : Fraction
        Zeros closer than this are not told apart.
    rough, final : bool
        A shorter interval gives neither smaller errors, nor does it tell more zeros apart.
    """

    rough, final = False, True

    def __init__(
        self,
        functions: AlphaFunctions,
        ends: Bounds,
        values: arb_mat,
        slopes: arb_mat,
        orientation: int,
        *,
        shift: float = 0.0,
        nowhere: bool = False,
        near: arb_mat | None = None,
    ) -> None:
        (self.low, self.high), self.shift = ends, shift
        self.apart = (self.high - self.low) * Fraction(4, 2**ZERO_BITS)
        self._functions, self._orientation, self._nowhere = functions, orientation, nowhere
        self._whole, self._rises = signs_of(values), signs_of(slopes)
        self._small = [bool(abs(values[k, 0]) < arb(2) ** -ZERO_BITS) for k in range(values.nrows())]
        #: about where conditions vanish, by tau in [-1, 1], with the signs of their slopes
        self._crossings: list[tuple[int, float]] = []
        if near is not None:
            rises = enumerate(self._rises[: near.nrows()].tolist())
            self._crossings = [(rise, -float((near[k, 0] / slopes[k, 0]).mid())) for k, rise in rises if rise]

    def split(self) -> Fraction | None:
        """An alpha below which one condition seems to be negative, and above which another; None where there is none.

        No claim rests on it.
        """
        rising, falling = ([tau for rise, tau in self._crossings if rise == sign] for sign in (1, -1))
        # zeros are farther apart (tau), or the rounding of floats hides it
        if not rising or not falling or max(rising) - min(falling) < 1e-12:
            return None
        tau = 0.5 * (max(rising) + min(falling))
        return self.low + Fraction(1 + tau) * (self.high - self.low) / 2 if abs(tau) < 1.0 else None

    def over(self, low: Number, high: Number) -> OverInterval:
        """Knowledge of a part of the interval."""
        signs, unknown = self._whole.copy(), np.zeros_like(self._whole)
        found = [self._functions.signs_at(Fraction(alpha)) for alpha in (low, high)]
        first, last = (unknown if end is None else end for end in found)
        # without a change of the slope's sign, values lie between those at the ends
        same = (signs == 0) & (first == last) & ((self._rises != 0) | (low == high))
        signs[same] = first[same]
        # a root has functions that are all positive or zero, or all negative or zero
        none = self._nowhere or bool(np.any(signs < 0) and np.any(signs > 0))
        sign = int(signs[-1])
        index = sign * self._orientation
        signs, first, last, rises = (part[:-1] * (sign or 1) for part in (signs, first, last, self._rises))
        return OverInterval(signs, bool(index), none, index, (first, last), rises * abs(sign))

    def near(self, condition: int, low: Number, high: Number) -> tuple[Number, Number]:
        """Nothing yet: bounds are found at once, by ``zero_bounds``; see ``over_parts.Expansion``."""
        return low, low

    def zeros(self, condition: int) -> list[Fraction]:
        """Alphas inside the interval at which a condition, or last det M, seems to vanish; no claim rests on them."""
        if not self._rises[condition]:
            return []
        found = self._functions.newton(condition, self.low, self.high, self.apart / 4)
        return [] if found is None or not self.low < found < self.high else [found]

    def flat(self, condition: int) -> bool:
        """True if a condition, or last det M, cannot be distinguished from zero."""
        return self._small[condition]

    def zero_bounds(self, condition: int, slope: int, low: Number, high: Number) -> Bounds:
        """Bounds of the only zero of a condition in a part, at whose ends it has opposite signs."""
        part = Fraction(low), Fraction(high)
        return self._functions.enclosed(condition, *part) or part
