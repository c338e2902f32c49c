"""The unloaded body, g = 0: it rests, lambda = 0 and w = 0, and nothing else solves (theory, section 5.1)."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.model.statuses import FINAL, OPEN
from enumsol.roots.components import RootComponent
from enumsol.selections.solution import SelectionSolution

if TYPE_CHECKING:
    from numpy.typing import NDArray


class AtRest:
    """The one root of a body with g = 0, at which every selection holds, and its values (PointValues).

    The energy bound is lambda' S lambda <= 0 there, so that lambda = 0; its degree is that of all roots, +1.

    Parameters
    ----------
    F_positive : tuple of p bool
    proven : bool
        g = 0 holds in the data and not only as computed in floats.
    """

    def __init__(self, F_positive: tuple[bool, ...], *, proven: bool) -> None:
        self._F_positive, self._p, self._proven = F_positive, len(F_positive), proven

    @property
    def component(self) -> RootComponent:
        """The root."""
        solution = SelectionSolution((OPEN,) * self._p, (np.zeros(2 * self._p),), 0, 0, strict=False)
        active = tuple(frozenset(FINAL[positive]) for positive in self._F_positive)
        return RootComponent((solution,), active, 0, 1, whole=True)

    def forces(self, point: Any) -> NDArray[np.float64]:
        """Zeros."""
        del point
        return np.zeros(2 * self._p)

    def displacements(self, point: Any) -> NDArray[np.float64]:
        """Zeros."""
        del point
        return np.zeros(2 * self._p)

    def slip_signs(self, point: Any) -> tuple[int, ...]:
        """Zeros."""
        del point
        return (0,) * self._p

    def exact_slips(self, point: Any) -> tuple[Fraction, ...]:
        """Zeros."""
        del point
        return (Fraction(0),) * self._p

    def bounds(self, point: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        """Zeros where they are proven."""
        del point
        return (np.zeros(4 * self._p), np.zeros(4 * self._p)) if self._proven else None
