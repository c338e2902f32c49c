"""All roots of a selection in rationals, for the checker: an affine solution set cut by the conditions."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations
from math import comb
from typing import TYPE_CHECKING, Any, Protocol

from flint import fmpq, fmpq_mat

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

Point = tuple[Fraction, ...]

#: Candidate vertices beyond which a root set is not enumerated: a leaf that needs more is refused.
MAX_CANDIDATES = 200_000


class HullTooLargeError(ValueError):
    """A root set has more than MAX_CANDIDATES candidate vertices."""


class Conditions(Protocol):
    """Equations and inequalities of selections, as of a RationalSystem."""

    @property
    def size(self) -> int:
        """Numbers of a point."""

    def equations(self, codes: Sequence[int]) -> tuple[Any, Sequence[Any]]:
        """Matrix and right-hand side."""

    def conditions(self, codes: Sequence[int], point: list[Any]) -> Sequence[Any]:
        """Values of the inequalities at a point, which must not be negative; affine in the point."""


@dataclass(frozen=True)
class Hull:
    """The points that solve one selection, or several at once.

    Attributes
    ----------
    points : list of points
        All vertices, without repetition; the root set is their convex hull.
    dimension : int
    """

    points: list[Point]
    dimension: int


def hull_of_selections(system: Conditions, *selections: Sequence[int]) -> Hull:
    """The root set that the given selections have in common, a polytope.

    It is bounded, and therefore the hull of its vertices, because S is positive definite (theory, section 5.1), and
    where nothing holds the body its rigid displacement is (theory, section 14.2). Every
    vertex is the only common zero of some of the conditions on the affine solution set.

    Raises
    ------
    HullTooLargeError
        More than MAX_CANDIDATES sets of conditions would have to be tried.
    """
    affine = _solution_set(system, selections)
    if affine is None:
        return Hull([], 0)
    origin, directions = affine
    values = [x for codes in selections for x in system.conditions(codes, origin)]
    moved = [
        [x for codes in selections for x in system.conditions(codes, _sum(origin, [(1, direction)]))]
        for direction in directions
    ]
    # each condition is affine: value + slopes . t >= 0
    rows = {tuple([m[k] - value for m in moved] + [value]) for k, value in enumerate(values)}
    flat = [row for row in rows if not any(row[:-1])]
    if any(row[-1] < 0 for row in flat):
        return Hull([], 0)
    steep = sorted((row for row in rows if any(row[:-1])), key=str)
    found = {_as_point(_sum(origin, zip(t, directions, strict=True))) for t in _corners(steep, len(directions))}
    return Hull(sorted(found), _dimension(sorted(found)))


def _solution_set(system: Conditions, selections: Sequence[Sequence[int]]) -> tuple[list[Any], list[Any]] | None:
    """A point that solves all equations and a basis of their kernel, or None if they contradict each other."""
    size = system.size
    table = []
    for codes in selections:
        M, b = system.equations(codes)
        table += [[*row, x] for row, x in zip(M.tolist(), b, strict=True)]
    reduced, rank = fmpq_mat(table).rref()
    rows = reduced.tolist()[:rank]
    pivots = [next(j for j, x in enumerate(row) if x != 0) for row in rows]
    if size in pivots:
        return None
    origin, directions = [fmpq(0)] * size, []
    for row, pivot in zip(rows, pivots, strict=True):
        origin[pivot] = row[size]
    for free in (j for j in range(size) if j not in pivots):
        direction = [fmpq(0)] * size
        direction[free] = fmpq(1)
        for row, pivot in zip(rows, pivots, strict=True):
            direction[pivot] = -row[free]
        directions.append(direction)
    return origin, directions


def _corners(rows: list[tuple[Any, ...]], size: int) -> Iterator[list[Any]]:
    """Parameters t of the vertices of {value + slopes . t >= 0}."""
    if comb(len(rows), size) > MAX_CANDIDATES:
        raise HullTooLargeError(f"its root set has {comb(len(rows), size)} candidate vertices")
    for chosen in combinations(rows, size):
        t: list[Any] = []
        if size:
            matrix = fmpq_mat([list(row[:-1]) for row in chosen])
            if matrix.det() == 0:
                continue
            t = matrix.solve(fmpq_mat([[-row[-1]] for row in chosen])).entries()
        if all(sum((a * x for a, x in zip(row[:-1], t, strict=True)), row[-1]) >= 0 for row in rows):
            yield t


def _sum(origin: list[Any], steps: Any) -> list[Any]:
    total = list(origin)
    for factor, direction in steps:
        total = [x + factor * d for x, d in zip(total, direction, strict=True)]
    return total


def _as_point(vector: list[Any]) -> Point:
    return tuple(Fraction(int(x.p), int(x.q)) for x in vector)


def _dimension(points: list[Point]) -> int:
    if len(points) < 2:
        return 0
    first = points[0]
    rows = [[x - y for x, y in zip(point, first, strict=True)] for point in points[1:]]
    return int(fmpq_mat([[fmpq(x.numerator, x.denominator) for x in row] for row in rows]).rank())
