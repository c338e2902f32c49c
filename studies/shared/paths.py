"""Paths with several roots, folds and transitions, and their branch graphs in rational arithmetic."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from enumsol import BranchGraph, ContactProblem, branch_graph, gallery
from shared.random_paths import random_path

if TYPE_CHECKING:
    from typing import Any

GALLERY = (
    ("one-node-6.1", (0.0, 20.0)),
    ("two-node-6.4", (0.0, 10.0)),
    ("two-node-6.7-minus", (-3.0, 3.0)),
    ("chain-2-coupled", (0.0, 8.0)),
)
#: (seed, p, loading path) of random problems with several roots, folds and transitions.
RANDOM = (
    (15, 3, False),
    (18, 3, False),
    (7, 4, False),
    (21, 4, False),
    (3, 3, True),
    (15, 3, True),
    (14, 4, True),
    (17, 4, True),
)


class Path(NamedTuple):
    """A problem over an interval and its branch graph in rational arithmetic."""

    problem: ContactProblem
    interval: tuple[float, float]
    graph: BranchGraph


def exact_path(problem: ContactProblem, interval: tuple[float, float]) -> Path:
    """The path with its graph, which must be complete."""
    graph = branch_graph(problem, interval, "exact")
    assert graph.complete
    return Path(problem, interval, graph)


def paths(*, smoke: bool = False) -> list[Path]:
    """Twelve paths; for a smoke run the first two."""
    found = [exact_path(gallery.get(name).build(), interval) for name, interval in GALLERY[: 2 if smoke else None]]
    if not smoke:
        found += [exact_path(*random_path(seed, p, loading=loading)) for seed, p, loading in RANDOM]
    return found


def located(graph: BranchGraph) -> tuple[Any, ...]:
    """Vertices that a path or a sampling should show: transitions and folds."""
    return (*graph.transitions, *graph.folds)
