"""The solution set of one selection, vertices of its polytopes, and what a solver offers (theory, section 2.4)."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations
from math import comb
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from enumsol.errors import TooLargeError
from enumsol.support.deadlines import look

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    Table = list[list[Any]]
    Reduction = Callable[[Table], tuple[Table, list[int]]]

Codes = tuple[int, ...]
ActiveSets = tuple[frozenset[int], ...]

#: Vertex enumeration tries at most this many bases; a polytope that needs more is refused.
MAX_BASES = 200_000


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


Point = tuple[Any, ...]
#: A linear form over lambda and its constant: value = form . lambda + constant.
Form = tuple[list[Any], Any]


def dot(a: Sequence[Any], b: Sequence[Any]) -> Any:
    """Inner product; factors that are zero cost nothing."""
    from flint import fmpq  # only here are roots rational

    return sum((x * y for x, y in zip(a, b, strict=True) if x != 0 and y != 0), fmpq(0))


def value(form: Form, point: Sequence[Any]) -> Any:
    """A form at a point."""
    return dot(form[0], point) + form[1]


def polytope_vertices(equations: list[Form], inequalities: list[Form], reduce: Reduction) -> list[Point]:
    """Vertices of a bounded polyhedron {equations = 0, inequalities >= 0}; empty when it is.

    Raises
    ------
    VertexLimitError
        More than MAX_BASES bases would have to be tried.
    """
    solved = _affine_solutions(equations, reduce)
    if solved is None:
        return []
    origin, kernel = solved
    rows = _distinct([([dot(form, k) for k in kernel], dot(form, origin) + c) for form, c in inequalities])
    if any(constant < 0 for row, constant in rows if not any(row)):
        return []
    if not kernel:
        return [origin]
    return _corners(origin, kernel, [(row, constant) for row, constant in rows if any(row)], reduce)


def _affine_solutions(equations: list[Form], reduce: Reduction) -> tuple[Point, list[Point]] | None:
    """Solution of the equations and a kernel basis, or None when they contradict each other."""
    from flint import fmpq

    size = len(equations[0][0])
    table, pivots = reduce([[*form, -constant] for form, constant in equations])
    if size in pivots:
        return None
    origin = [fmpq(0)] * size
    for row, pivot in zip(table, pivots, strict=True):
        origin[pivot] = row[size]
    kernel = []
    for free in (j for j in range(size) if j not in pivots):
        vector = [fmpq(0)] * size
        vector[free] = fmpq(1)
        for row, pivot in zip(table, pivots, strict=True):
            vector[pivot] = -row[free]
        kernel.append(tuple(vector))
    return tuple(origin), kernel


def _distinct(rows: list[Form]) -> list[Form]:
    """Rows without repetition; every row is divided by the size of its first entry that is not zero."""
    found: list[Form] = []
    for row, constant in rows:
        head = next((v for v in row if v != 0), None)
        if head is None:
            scaled = (row, constant)
        else:
            size = head if head > 0 else -head
            scaled = ([v / size for v in row], constant / size)
        if scaled not in found:
            found.append(scaled)
    return found


def _corners(origin: Point, kernel: list[Point], rows: list[Form], reduce: Reduction) -> list[Point]:
    """Points origin + sum of t_k kernel_k at which as many rows vanish as there are t, and none is negative."""
    size = len(kernel)
    if comb(len(rows), size) > MAX_BASES:
        raise VertexLimitError(
            f"a family of roots has {comb(len(rows), size)} candidate vertices; at most {MAX_BASES} are enumerated"
        )
    found: list[Point] = []
    for basis in combinations(rows, size):
        look()
        table, pivots = reduce([[*row, -constant] for row, constant in basis])
        if pivots != list(range(size)):
            continue
        t = [row[-1] for row in table]
        if all(value(row, t) >= 0 for row in rows):
            point = tuple(o + dot(t, [k[j] for k in kernel]) for j, o in enumerate(origin))
            if point not in found:  # elements of number fields have no hash
                found.append(point)
    return found
