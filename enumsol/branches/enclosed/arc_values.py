"""Forces and displacements along an arc, from exact functions or in ball arithmetic."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from enumsol.arithmetic.rationals import rational
from enumsol.selections.functions import SelectionFunctions
from enumsol.selections.ordered_field import as_float
from enumsol.selections.polytopes import dot

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from enumsol.branches.enclosed.traced import TracedProblem
    from enumsol.condensation.exact import ExactCondensed
    from enumsol.selections.solution import Codes

    Pair = tuple[NDArray[np.float64], NDArray[np.float64]]


class ArcValues(Protocol):
    """lambda and w of a selection's solutions, arrays of length 2p."""

    def at(self, alpha: Fraction) -> Pair:
        """At an alpha of the arc; beside its rounded ends, those of a point on it."""


@dataclass(frozen=True)
class ExactArcValues:
    """Values from exact functions, rounded last.

    Attributes
    ----------
    exact : ExactCondensed
    codes : status codes
    sample : Fraction
        An alpha inside the arc.
    """

    exact: ExactCondensed
    codes: Codes
    sample: Fraction

    @cached_property
    def _functions(self) -> SelectionFunctions:
        return SelectionFunctions(self.exact, self.codes)

    def at(self, alpha: Fraction) -> Pair:
        """Forces and displacements at an alpha."""
        point: Any = self._functions.forces_at(rational(alpha))
        if point is None:  # bounded arcs have no poles, but a rounded end may lie beyond the exact one
            point = self._functions.forces_at(rational(self.sample)) or ()
        g = self.exact.at(rational(alpha))[0]
        moves = [as_float(a - dot(row, point)) for a, row in zip(g, self.exact.rows, strict=True)]
        return np.array([as_float(v) for v in point]), np.array(moves)


@dataclass(frozen=True)
class TracedArcValues:
    """Values in double arithmetic, with the rounding errors of S.

    Attributes
    ----------
    traced : TracedProblem
    codes : status codes
    sample : Fraction
        An alpha inside the arc.
    """

    traced: TracedProblem
    codes: Codes
    sample: Fraction

    def at(self, alpha: Fraction) -> Pair:
        """Forces and displacements at an alpha."""
        for value in (alpha, self.sample):
            found = self.traced.values(self.codes, value, precisely=False)
            if found is None:
                found = self.traced.values(self.codes, value, precisely=True)
            if found is not None:
                return found
        raise AssertionError("an arc's selection is not regular inside it")
