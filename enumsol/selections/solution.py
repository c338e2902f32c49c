"""The solution set of one selection, and what a solver offers (theory, section 2.4)."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Protocol

import numpy as np

from enumsol.errors import TooLargeError

Codes = tuple[int, ...]
ActiveSets = tuple[frozenset[int], ...]

#: Vertex enumeration tries at most this many bases; a polytope that needs more is refused.
MAX_BASES = 200_000
#: In floats, a singular value of the scaled matrix of a selection or of the normal map, with entries at most one, below
#: this counts as zero.
RANK_TOLERANCE = 1e-12


@dataclass(frozen=True)
class SelectionSolution:
    """All roots in one selection: a point or a polytope.

    Attributes
    ----------
    codes : tuple of p status codes
    vertices : tuple of points in the solver's own representation of lambda
    dimension : int
        0 for a point.
    det_sign : int
        Sign of the selection's determinant; 0 when it is singular.
    strict : bool
        All conditions of the selection hold strictly (only asked of points).
    exact : bool
        Vertices are tuples of field elements, not arrays of floats.
    index : int or None
        Local degree of the point, where it is proven by other means than its selections' determinants.
    possible : tuple of p frozensets of codes, or None
        Of a point known by its enclosure, which need not hold in any one selection for certain: the codes that may hold
        there. ``codes`` is then UNDECIDED where they are several (theory, section 6.11), or those of one of the
        selections that share the point (theory, section 14.9).
    """

    codes: Codes
    vertices: tuple[Any, ...]
    dimension: int
    det_sign: int
    strict: bool
    exact: bool = False
    index: int | None = None
    possible: ActiveSets | None = None


class SelectionSolver(Protocol):
    """Solves selections and decides about their solutions in one arithmetic (floats with a tolerance, or rationals).

    The representation of lambda at points is the solver's own.
    """

    p: int
    F_positive: tuple[bool, ...]

    def forces(self, point: Any) -> np.ndarray[Any, Any]:
        """The point's lambda as floats, shape (2p,), unscaled."""

    def displacements(self, point: Any) -> np.ndarray[Any, Any]:
        """w = g - S lambda at the point as floats, shape (2p,), unscaled, exact zeros where the status says so."""

    def slip_signs(self, point: Any) -> tuple[int, ...]:
        """Signs of w_t at the point, one per node."""

    def exact_slips(self, point: Any) -> tuple[Fraction, ...] | None:
        """w_t at the point, p rationals; None in an arithmetic without them."""

    def bounds(self, point: Any) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]] | None:
        """Proven bounds of (lambda, w, q) at the point, two (4p + r,) arrays; None in an arithmetic without any."""

    def solve(self, codes: Codes) -> SelectionSolution | None:
        """All roots in the selection, or None when there is none."""

    def active(self, point: Any) -> ActiveSets:
        """Per node the codes whose conditions hold at a root."""

    def equal(self, a: Any, b: Any) -> bool:
        """True if two points are the same."""

    def meet(self, a: SelectionSolution, b: SelectionSolution) -> bool:
        """True if two polytopes have a point in common."""

    def departure(self, solution: SelectionSolution, direction: np.ndarray[Any, Any]) -> int | None:
        """det_sign if the regular selection's root stays a root when g moves a little along ``direction``.

        0 if it does not; None if the direction is not generic. ``direction`` holds 2p small integers.
        """


class VertexLimitError(TooLargeError):
    """A polytope of roots has too many candidate vertices to enumerate."""
