"""Arguments of calls: alpha."""

from __future__ import annotations

import math
from fractions import Fraction

from enumsol.errors import InvalidArgumentError

Alpha = float | Fraction


def finite_alpha(alpha: Alpha) -> float:
    """Value of alpha as a float.

    Raises
    ------
    InvalidArgumentError
        alpha is not a finite real number.
    """
    try:
        value = float(alpha)
    except (TypeError, ValueError, OverflowError):
        raise InvalidArgumentError(f"alpha is {alpha!r}; expected a finite real number") from None
    if not math.isfinite(value):
        raise InvalidArgumentError(f"alpha is {value}; expected a finite real number")
    return value
