"""Rational numbers and matrices of python-flint: exact values of floats, and what is decided with them."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, Any

from flint import fmpq, fmpq_mat

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


def rational(value: float | Fraction) -> Any:
    """The exact value of a float or Fraction as fmpq."""
    return fmpq(*Fraction(value).as_integer_ratio())


def to_fraction(value: Any) -> Fraction:
    """An fmpq as a Fraction."""
    return Fraction(int(value.p), int(value.q))


def rational_matrix(array: NDArray[np.float64]) -> Any:
    """The exact values of a matrix of floats as fmpq_mat."""
    rows, columns = array.shape
    return fmpq_mat(rows, columns, [fmpq(*float(v).as_integer_ratio()) for v in array.ravel()])


def is_positive_definite(matrix: Any) -> bool:
    """Whether all pivots of a symmetric rational matrix, eliminated in order, are positive."""
    rows = matrix.tolist()
    for k, row in enumerate(rows):
        if not row[k] > 0:
            return False
        for other in rows[k + 1 :]:
            factor = other[k] / row[k]
            if factor != 0:
                other[k:] = [x - factor * y for x, y in zip(other[k:], row[k:], strict=True)]
    return True
