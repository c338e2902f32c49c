"""Claims at one value of a map's second parameter: a branch graph over alpha, in numbers."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from enumsol.branches.construction import branch_graph
from enumsol.model.problem import ContactProblem
from enumsol.support import arguments

if TYPE_CHECKING:
    from collections.abc import Callable
    from fractions import Fraction

    from enumsol.support.array_types import Alpha


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


def map_row(
    make: Callable[[float], ContactProblem], value: float, interval: tuple[Alpha, Alpha], options: dict[str, Any]
) -> MapRow:
    """Row of a map (a module-level function, so that other processes can import it)."""
    started = time.perf_counter()
    problem = arguments.instance_of(make(value), ContactProblem, "the problem that over makes")
    graph = branch_graph(problem, interval, **options)
    steps, uniqueness = graph.claims.steps(), graph.claims.uniqueness()
    arcs = {vertex.number: [] for vertex in graph.folds}  # type: dict[int, list[tuple[str, ...]]]
    for arc in graph.arcs:
        for end in {arc.tail, arc.head} & arcs.keys():
            arcs[end].append(tuple(status.value for status in arc.statuses))
    folds = tuple(MapFold(fold.alpha, tuple(sorted(arcs[fold.number]))) for fold in graph.folds)
    return MapRow(
        value=value,
        alphas=steps.alphas,
        at_alphas=steps.at,
        between=steps.between,
        exact=steps.exact,
        folds=folds,
        complete=graph.complete,
        reasons=tuple(graph.reasons),
        limit=uniqueness.limit,
        unique=uniqueness.throughout,
        seconds=time.perf_counter() - started,
        within=None if problem.held else problem.rigid_reach,
    )
