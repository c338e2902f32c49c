"""Friction and load at an alpha without rounding: whether one is zero, or negative, is decided with these values."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


def exactly_at(alpha: Fraction, first: NDArray[np.float64], slope: NDArray[np.float64]) -> list[Fraction]:
    """The values first + alpha slope of floats, exactly: F(alpha) for the parts of ``problem.friction``."""
    return [Fraction(x) + alpha * Fraction(y) for x, y in zip(first.tolist(), slope.tolist(), strict=True)]
