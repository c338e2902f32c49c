"""Checks of the numbers that describe a mesh or a gallery problem; each says what was found and what was expected."""

from __future__ import annotations

import math
import operator
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.errors import InvalidArgumentError

if TYPE_CHECKING:
    from numpy.typing import NDArray


def positive_integer(value: Any, name: str, least: int = 1) -> int:
    """Value as an int of at least ``least``.

    Raises
    ------
    InvalidArgumentError
        The value is not an integer, or is smaller.
    """
    try:
        number = operator.index(value)
    except TypeError:
        number = least - 1
    if number < least or isinstance(value, bool):
        raise InvalidArgumentError(f"{name} is {value!r}; expected an integer of at least {least}")
    return number


def positive_number(value: Any, name: str) -> float:
    """Value as a finite float above zero.

    Raises
    ------
    InvalidArgumentError
        The value is no such number.
    """
    number = _real(value)
    if not (math.isfinite(number) and number > 0):
        raise InvalidArgumentError(f"{name} is {value!r}; expected a finite number > 0")
    return number


def finite_number(value: Any, name: str) -> float:
    """Value as a finite float.

    Raises
    ------
    InvalidArgumentError
        The value is no such number.
    """
    number = _real(value)
    if not math.isfinite(number):
        raise InvalidArgumentError(f"{name} is {value!r}; expected a finite number")
    return number


def nonnegative_number(value: Any, name: str) -> float:
    """Value as a finite float of at least zero.

    Raises
    ------
    InvalidArgumentError
        The value is no such number.
    """
    number = _real(value)
    if not (math.isfinite(number) and number >= 0):
        raise InvalidArgumentError(f"{name} is {value!r}; expected a finite number >= 0")
    return number


def vector_2d(value: Any, name: str) -> NDArray[np.float64]:
    """Value as a finite array of shape (2,).

    Raises
    ------
    InvalidArgumentError
        The value is not two finite real numbers.
    """
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        array = np.empty(0)
    if array.shape != (2,) or not np.all(np.isfinite(array)):
        raise InvalidArgumentError(f"{name} is {value!r}; expected two finite numbers")
    return array


def lame_coefficients(value: Any) -> tuple[float, float]:
    """Value as the Lame coefficients (l, m) with m > 0 and l + m > 0, which make plane-strain energy positive.

    Raises
    ------
    InvalidArgumentError
        The value is not two such numbers.
    """
    lam, mu = (float(entry) for entry in vector_2d(value, "lame"))
    if not (mu > 0 and lam + mu > 0):
        raise InvalidArgumentError(f"lame is {value!r}; expected Lame coefficients (l, m) with m > 0 and l + m > 0")
    return lam, mu


def _real(value: Any) -> float:
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError):
        return math.nan
