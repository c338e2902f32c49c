"""Rational numbers and matrices of python-flint: exact values of floats, and what is decided with them."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np
from flint import fmpq, fmpq_mat

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray


def rational(value: float | Fraction) -> fmpq:
    """The exact value of a float or Fraction as fmpq."""
    return fmpq(*Fraction(value).as_integer_ratio())


def to_fraction(value: fmpq) -> Fraction:
    """An fmpq as a Fraction."""
    return Fraction(int(value.p), int(value.q))


def simplest(low: Fraction, high: Fraction) -> Fraction:
    """The number with the smallest power of two as its denominator from one number to another, larger one."""
    length = high - low
    # no smaller than the length
    step = Fraction(2) ** (length.numerator.bit_length() - length.denominator.bit_length() + 1)
    while (number := -((-low) // step) * step) > high:
        step /= 2
    return number


def rational_matrix(array: NDArray[np.float64]) -> fmpq_mat:
    """The exact values of a matrix of floats as fmpq_mat."""
    rows, columns = array.shape
    return fmpq_mat(rows, columns, [fmpq(*float(v).as_integer_ratio()) for v in array.ravel()])


def as_objects(values: Sequence[Any]) -> NDArray[Any]:
    """Exact numbers, or rows of them, as an array, on which the algebra of a selection works as on floats."""
    if len(values) and isinstance(values[0], list | tuple):
        return np.array([as_objects(row) for row in values], dtype=object)
    return np.fromiter(values, object, len(values))  # polynomials are sequences, which np.array would unpack


def is_positive_definite(matrix: fmpq_mat, tell: Callable[[int, int], object] | None = None) -> bool:
    """True if all pivots of a symmetric rational matrix, eliminated in order, are positive.

    ``tell`` is called with the number of pivots found so far, and of all.
    """
    rows = matrix.tolist()
    for k, row in enumerate(rows):
        if tell is not None:
            tell(k, len(rows))
        if not row[k] > 0:
            return False
        for other in rows[k + 1 :]:
            factor = other[k] / row[k]
            if factor != 0:
                other[k:] = [x - factor * y for x, y in zip(other[k:], row[k:], strict=True)]
    return True
