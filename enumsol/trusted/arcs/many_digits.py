"""Balls of many digits, and what is read off them."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np
from flint import arb, arb_mat, ctx, fmpq

from enumsol.arithmetic.balls import SAFE, UNIT, upper_sum

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Signs = NDArray[np.int8]

#: Bits of the arithmetic.
PRECISION = 320
#: Bound of how much M may change over an interval, and of rises that count as none where norms are chosen.
_LARGEST_SHIFT, _NO_RISE = 0.5, 1e-250
#: Covers underflow of some products.
_SUBNORMAL = 2.0**-1070


def taylor_around(rise: Any, P: Any) -> tuple[Any, Any, Any] | None:
    """The second term of the unknowns as functions of tau, and balls around zero for what is left of them.

    With M(0)^{-1} M' = P and the slopes ``rise`` at tau = 0 the unknowns are y + tau (I + tau P)^{-1} rise, and their
    slopes (I + tau P)^{-2} rise (theory, (7.16)). The first result is bend = P rise, the second holds what the unknowns
    differ by from y + tau rise - tau^2 bend, the third what their slopes do from rise - 2 tau bend, for all tau in
    [-1, 1]. None where P is too large, in the norm max |x| / u.
    """
    bend = P * rise
    third = P * bend
    sizes, left = (np.array([upper(x[i, 0]) for i in range(x.nrows())]) for x in (rise, third))
    largest = float(np.max(sizes))
    u = sizes / largest + 1e-3 if largest > _NO_RISE else np.ones(len(sizes))
    rows = np.array([[upper(P[i, j]) for j in range(P.ncols())] for i in range(P.nrows())])
    k = float(np.max(upper_sum(rows * u, axis=1) / u)) * SAFE
    if not k < _LARGEST_SHIFT:
        return None
    norm = float(np.max(left / u)) * SAFE
    growths = ((1.0 + 8 * UNIT) / (1.0 - k), (3.0 + 2.0 * k) * (1.0 + 8 * UNIT) / (1.0 - k) ** 2)
    first, second = (u * (norm * growth * SAFE) + _SUBNORMAL for growth in growths)
    return bend, *(column([arb(0, float(e)) for e in error]) for error in (first, second))


def upper(value: Any) -> float:
    """At least the size of all numbers in a ball."""
    return float(np.nextafter(float(abs(value).upper()), np.inf))


class precision:  # noqa: N801 (a context manager, used like a function)
    """The precision of flint's balls, for a while."""

    def __enter__(self) -> None:
        self._before = ctx.prec
        ctx.prec = PRECISION

    def __exit__(self, *error: object) -> None:
        ctx.prec = self._before


def rounded(alpha: Fraction, low: Fraction, high: Fraction, unit: Fraction) -> Fraction:
    """An alpha within bounds at a multiple of a unit from the first: ends of enclosures keep few digits."""
    return min(max(low + round((alpha - low) / unit) * unit, low), high)


def matrix(rows: list[list[Any]]) -> Any:
    """A matrix of balls, by its rows."""
    return arb_mat(len(rows), len(rows[0]) if rows else 0, [x for row in rows for x in row])


def column(values: Sequence[Any]) -> Any:
    """A matrix with one column."""
    return arb_mat(len(values), 1, list(values))


def ball_of(alpha: Fraction) -> Any:
    """A ball that holds a fraction."""
    return arb(fmpq(alpha.numerator, alpha.denominator))


def sign_of(value: Any) -> int:
    """Sign of all numbers in a ball, 0 where it is not proven."""
    return int(value > 0) - int(value < 0)


def signs_of(values: Any) -> Signs:
    """Signs of the balls in a column."""
    return np.array([sign_of(values[k, 0]) for k in range(values.nrows())], dtype=np.int8)


def fraction_of(value: Any) -> Fraction:
    """The exact value of an arb without radius."""
    mantissa, exponent = (int(part) for part in value.man_exp())
    return Fraction(mantissa) * Fraction(2) ** exponent
