"""Known solutions at one alpha as points and polytopes, and how far an answer of another solver is from them."""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from enumsol.errors import InvalidArgumentError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.support.array_types import Floats

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
