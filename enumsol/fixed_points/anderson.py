"""Anderson's mixing of the last iterates of a fixed-point map."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Vector = NDArray[np.float64]

#: Differences of residuals that depend on each other to this degree are dropped.
_RANK_TOLERANCE = 1e-10
#: A residual this many times the smallest so far drops the history.
_WORSE = 10.0


class AndersonMixing:
    """x_(k+1) = Psi(x_k) - sum_j gamma_j (Psi(x_(j+1)) - Psi(x_j)), gamma of least squares over the residuals.

    Parameters
    ----------
    depth : int
        Differences that are kept; 0 is plain iteration.
    """

    def __init__(self, depth: int) -> None:
        self._residuals: deque[Vector] = deque(maxlen=depth + 1)
        self._images: deque[Vector] = deque(maxlen=depth + 1)
        self._least = np.inf

    def next(self, x: Vector, image: Vector) -> Vector:
        """The next iterate after x with Psi(x) = image; its entries are not negative."""
        residual = image - x
        size = float(np.linalg.norm(residual))
        if size > _WORSE * self._least:
            self._residuals.clear()
            self._images.clear()
        self._least = min(self._least, size)
        self._residuals.append(residual)
        self._images.append(image)
        if len(self._residuals) < 2:
            return image
        steps = np.diff(np.array(self._residuals), axis=0).T
        gamma = np.linalg.lstsq(steps, residual, rcond=_RANK_TOLERANCE)[0]
        return np.maximum(image - np.diff(np.array(self._images), axis=0).T @ gamma, 0.0)
