"""compare_result: which of all equilibria another solver's displacements are, and which it did not find.

Known solutions at one alpha are points and polytopes, from which an answer has a distance.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.support.arguments import positive_number
from enumsol.support.array_arguments import plain_array
from enumsol.support.messages import counted, listed

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.model.problem3d import AnyProblem
    from enumsol.roots.root import Polytope
    from enumsol.roots.root_set import RootSet
    from enumsol.support.array_types import ArrayLike, Floats

    Name = tuple[str, int]


class KnownSolutions:
    """Solutions as vectors of one kind: forces, or displacements.

    Forces are measured by the largest one of all solutions, as that of an open one is zero; displacements by those of
    the solution itself, as a body that is free may move many times as far as one that is held.

    Parameters
    ----------
    roots : sequence of (1, m) arrays
    families : sequence of lists of (v, m) arrays
        Of each continuum the vertices of its polytopes.
    each_by_itself : bool
        Each is measured by its own largest component (displacements), not by that of all.
    otherwise : float
        By which they are measured if all are zero.
    """

    def __init__(
        self,
        roots: Sequence[Floats],
        families: Sequence[Sequence[Floats]] = (),
        *,
        each_by_itself: bool,
        otherwise: float = 1.0,
    ) -> None:
        known: dict[Name, list[Floats]] = {("root", k): [root] for k, root in enumerate(roots)}
        known |= {("family", k): list(parts) for k, parts in enumerate(families)}
        sizes = {name: max(float(np.max(np.abs(part), initial=0.0)) for part in parts) for name, parts in known.items()}
        largest = max(sizes.values(), default=0.0) or otherwise or 1.0
        self._known = known
        self._sizes = {name: (size or largest) if each_by_itself else largest for name, size in sizes.items()}

    def distances(self, values: Floats) -> dict[Name, float]:
        """Distance of an answer (m,) from every solution, in the largest component and in parts of its size."""
        if not np.all(np.isfinite(values)):
            return dict.fromkeys(self._known, np.inf)
        return {name: self._distance(name, [values[None]], self._sizes[name]) for name in self._known}

    def nearest(self, values: Floats) -> tuple[Name | None, float]:
        """The nearest solution, as ("root", k) or ("family", k), and its distance; None for values that are not finite.

        Parameters
        ----------
        values : (m,) array
        """
        distances = self.distances(values)
        name = min(distances, key=distances.__getitem__, default=None)
        return (None, np.inf) if name is None or np.isinf(distances[name]) else (name, distances[name])

    def apart(self, one: Name, other: Name) -> float:
        """Least distance of two solutions, in parts of the larger size."""
        return self._distance(one, self._known[other], max(self._sizes[one], self._sizes[other]))

    def check_apart(self, tolerance: float, name: str) -> None:
        """Refuse a tolerance at which one answer could be two solutions.

        Raises
        ------
        InvalidArgumentError
            It is not below half of the least distance between two solutions.
        """
        for one, other in combinations(self._known, 2):
            least = self.apart(one, other)
            if not tolerance < least / 2:
                raise InvalidArgumentError(
                    f"tolerance is {tolerance:g}, but {' '.join(map(str, one))} and {' '.join(map(str, other))} of "
                    f"{name} are only {least:.2g} apart; expected less than half of that"
                )

    def _distance(self, name: Name, others: list[Floats], size: float) -> float:
        """Least distance of a solution from the convex hulls of others, in parts of a size."""
        return min(hull_distance(part / size, other / size) for part in self._known[name] for other in others)


def hull_distance(first: Floats, second: Floats) -> float:
    """Least distance, in the largest component, of the convex hulls of points, (k, m) and (l, m)."""
    if len(first) == len(second) == 1:
        return float(np.max(np.abs(first - second)))
    from scipy.optimize import linprog  # for continua only

    # weights of both hulls and the distance t: |first' v - second' w| <= t, and t is least
    difference = np.hstack([first.T, -second.T])
    bound = -np.ones((len(difference), 1))
    sums = np.zeros((2, len(first) + len(second) + 1))
    sums[0, : len(first)] = sums[1, len(first) : -1] = 1.0
    rows = np.vstack([np.hstack([difference, bound]), np.hstack([-difference, bound])])
    cost = np.append(np.zeros(len(first) + len(second)), 1.0)
    return float(linprog(cost, rows, np.zeros(len(rows)), sums, np.ones(2)).fun)


#: Of the largest displacement: what penalties and finite steps of other solvers leave.
TOLERANCE = 0.05


@dataclass(frozen=True)
class ResultComparison:
    """Displacements that another solver computed, beside all equilibria; ``print`` says it in words.

    Attributes
    ----------
    distances : dict of ("root", k) or ("family", k) to float
        Largest difference of a displacement, in parts of the largest displacement of that solution [-].
    found : ("root", k), ("family", k) or None
        The solution that the result is: within the tolerance, and nearer than half way to any other.
    tolerance : float
    complete : bool
        Whether it is proven that the solutions are all that there are.
    """

    distances: dict[tuple[str, int], float]
    found: tuple[str, int] | None
    tolerance: float
    complete: bool

    @property
    def missed(self) -> list[tuple[str, int]]:
        """Solutions that the result is not."""
        return [name for name in self.distances if name != self.found]

    def summary(self) -> dict[str, Any]:
        """Contents as plain numbers and texts."""
        return {
            "found": None if self.found is None else _named(self.found),
            "distances": {_named(name): distance for name, distance in self.distances.items()},
            "tolerance": self.tolerance,
            "complete": self.complete,
        }

    def __str__(self) -> str:
        order = sorted(self.distances, key=self.distances.__getitem__)
        off = {name: f"{_named(name)} by {_percent(self.distances[name])}" for name in order}
        known = (
            f"{counted(len(order), 'solution')}, {'all that there are (proven)' if self.complete else 'maybe not all'}"
        )
        if self.found is not None:
            of_own = off.pop(self.found).replace(" by", ": it differs by")
            rest = f"\nnot found: it differs from {listed(off.values())}" if off else ""
            return f"the result is {of_own} of the largest displacement{rest}\n{known}"
        if not order:
            return f"there is nothing to compare the result with: {known}"
        why = "two are too close to tell which" if self.distances[order[0]] <= self.tolerance else "it is too far away"
        return (
            f"the result is taken for no solution ({why}): it differs from {listed(off.values())} of its largest "
            f"displacement\n{known}"
        )


def _percent(share: float) -> str:
    return f"{100.0 * share:.0f} %" if share >= 0.1 else f"{100.0 * share:.2g} %"


def _named(name: tuple[str, int]) -> str:
    return f"{name[0]} {name[1]}"


def compare_result(
    problem: AnyProblem, roots: RootSet, displacements: ArrayLike, *, tolerance: float = TOLERANCE
) -> ResultComparison:
    """Which of all equilibria the displacements of another solver are.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
        With a mesh.
    roots : RootSet
        Its equilibria, by `enumerate_roots`.
    displacements : (N, d) array_like
        Of the nodes of the mesh, such as ``NodalResult.on``; NaN where a displacement is not known [length].
    tolerance : float
        In parts of the largest displacement of a solution: up to which it is taken for that solution, if it is also
        nearer than half way to any other [-].

    Returns
    -------
    ResultComparison

    Raises
    ------
    InvalidArgumentError
        The problem has no mesh, or the array has another shape or no number.

    Examples
    --------
    >>> import enumsol
    >>> problem = enumsol.gallery.clamped_block(2, 1)
    >>> roots = enumsol.enumerate_roots(problem, alpha=0.5)
    >>> moved = problem.mesh.displacements(roots[0].u)
    >>> print(enumsol.compare_result(problem, roots, 1.01 * moved))
    the result is root 0: it differs by 1 % of the largest displacement
    1 solution, all that there are (proven)
    """
    limit = positive_number(tolerance, "tolerance")
    if problem.mesh is None:
        raise InvalidArgumentError("the problem has no mesh; expected one made of a mesh")
    given = plain_array(displacements, "displacements", error=InvalidArgumentError)
    if given.shape != problem.mesh.points.shape or given.dtype.kind not in "fiu":
        raise InvalidArgumentError(f"displacements has shape {given.shape}; expected {problem.mesh.points.shape}")
    known = np.isfinite(given)
    if not np.any(known):
        raise InvalidArgumentError("displacements has no finite number; expected some")

    def at_nodes(u: Floats) -> Floats:
        return np.asarray(problem.mesh.displacements(u)[known][None])  # type: ignore[union-attr]

    families = [
        [np.concatenate([at_nodes(u) for u in _corners(problem, roots, part)]) for part in family.polytopes]
        for family in roots.families
    ]
    size = float(np.max(np.abs(given[known])))
    solutions = KnownSolutions([at_nodes(root.u) for root in roots], families, each_by_itself=True, otherwise=size)
    distances = solutions.distances(given[known])
    found = min(distances, key=distances.__getitem__, default=None)
    if found is not None:
        others = [0.5 * solutions.apart(found, other) for other in distances if other != found]
        if distances[found] > limit or not all(distances[found] < half for half in others):
            found = None
    return ResultComparison(distances, found, limit, roots.complete)


def _corners(problem: AnyProblem, roots: RootSet, part: Polytope) -> list[Floats]:
    """Displacements at the vertices of a polytope of solutions."""
    condensed = problem.condensed
    found: list[Floats] = []
    for k, forces in enumerate(part.vertices):
        u = condensed.displacement(roots.alpha, forces.T.ravel())
        if part.rigid_coordinates is not None:
            u = u + problem.rigid_modes @ part.rigid_coordinates[k]
        found.append(u)
    return found
