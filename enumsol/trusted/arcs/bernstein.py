"""Signs of polynomials over parts of [-1, 1] by their Bernstein coefficients (theory, section 7.14)."""

from __future__ import annotations

from functools import cache
from math import comb
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Signs = NDArray[np.int8]


def bernstein_values(coefficients: Array, low: Array, high: Array) -> Array:
    """Bernstein coefficients (c, m, d + 1) of polynomials (c, m, d + 1), of every c over its own part.

    The first and the last are the values at ``low`` and ``high``. Rounding errors are at most gamma_(8d+8) times the
    sum of the sizes of a polynomial's coefficients.
    """
    return np.asarray(coefficients @ to_bernstein(coefficients.shape[2] - 1, low, high))


def signs_beyond(values: Array, error: Array) -> Signs:
    """1 or -1 where all values along the last axis are larger than an error, or smaller than minus it; else 0."""
    positive, negative = np.min(values, axis=-1) > error, np.max(values, axis=-1) < -error
    return np.asarray(positive.astype(np.int8) - negative.astype(np.int8))


def to_bernstein(degree: int, low: Array, high: Array) -> Array:
    """Bernstein coefficients over parts [low, high] of 1, tau, ..., a row each: (c, d + 1, d + 1).

    That of number j of tau^k is the mean of the products of k of the numbers low, .., low, high, .., high, of which j
    are high: a sum of terms whose sizes add up to at most one, for |low|, |high| <= 1.
    """
    if degree == 0:
        return np.ones((len(low), 1, 1))
    # powers by products, whose rounding is known
    factors = np.ones((degree + 1, 2, len(low)))
    factors[1:, 0], factors[1:, 1] = low, high
    of_low, of_high = np.multiply.accumulate(factors, axis=0).transpose(1, 0, 2)
    powers = np.arange(degree + 1)
    # by k, i and part: low^(k - i) high^i
    products = np.where((powers[:, None] >= powers)[..., None], of_low[powers[:, None] - powers] * of_high, 0.0)
    return np.asarray((_weights(degree) @ products).transpose(2, 0, 1))


@cache
def _weights(degree: int) -> Array:
    """Shares of high^i low^(k - i) in Bernstein coefficient j of tau^k, by [k, j, i]."""
    n = range(degree + 1)
    return np.array(
        [[[comb(j, i) * comb(degree - j, k - i) / comb(degree, k) if i <= k else 0.0 for i in n] for j in n] for k in n]
    )
