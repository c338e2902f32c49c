"""The rows of a map: what is proven at one value of its second parameter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fractions import Fraction

    from enumsol.support.arguments import Alpha


@dataclass(frozen=True)
class MapFold:
    """A fold on one row of a map.

    Attributes
    ----------
    alpha : float
    statuses : tuple of tuples of str
        Of the arcs that meet there, in order: by them folds of neighbouring rows are matched.
    """

    alpha: float
    statuses: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class MapRow:
    """What is proven at one value of the second parameter: a branch graph over alpha, in numbers.

    Attributes
    ----------
    value : float
    alphas : tuple of Fraction
        Where the number of solutions changes.
    at_alphas, between : tuples of int
        Numbers of solutions at these alphas, and between them.
    exact : bool
        These are the numbers and not lower bounds.
    folds : tuple of MapFold
    complete : bool
    reasons : tuple of str
    limit : float or None
        Up to which alpha the solution is unique, from the first one; None: throughout, or not known.
    unique : bool or None
        Whether there is one solution at every alpha; None: not known.
    seconds : float
    within : float or None
        Of a body that nothing holds: the numbers are those of solutions whose rigid displacement is within this bound
        [length].
    """

    value: float
    alphas: tuple[Fraction, ...]
    at_alphas: tuple[int, ...]
    between: tuple[int, ...]
    exact: bool
    folds: tuple[MapFold, ...]
    complete: bool
    reasons: tuple[str, ...]
    limit: float | None
    unique: bool | None
    seconds: float
    within: float | None = None

    def count_at(self, alpha: Alpha) -> int:
        """Number of solutions at an alpha of the interval; a lower bound where the row is not exact."""
        for k, critical in enumerate(self.alphas):
            if alpha == critical:
                return self.at_alphas[k]
            if alpha < critical:
                return self.between[k - 1]
        return self.between[-1]
