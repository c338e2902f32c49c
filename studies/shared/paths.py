"""Paths with several roots, folds and transitions for parts 2 and 3 of accuracy_vs_speed, with their exact graphs."""

from __future__ import annotations

import time
from functools import cache
from typing import TYPE_CHECKING, NamedTuple

from _random_paths import random_path

from enumsol import BranchGraph, ContactProblem, branch_graph, gallery

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

GALLERY = (
    ("one-node-6.1", (0.0, 20.0)),
    ("two-node-6.4", (0.0, 10.0)),
    ("two-node-6.7-minus", (-3.0, 3.0)),
    ("chain-2-coupled", (0.0, 8.0)),
)
#: (seed, p, loading path): random problems with several roots, folds and transitions.
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
BLUE, ORANGE, RED, GREEN, GREY = "#1f5fa8", "#d9730d", "#c23b4b", "#2c7a4b", "#555555"


class Path(NamedTuple):
    """A problem over an interval and its branch graph in rational arithmetic."""

    problem: ContactProblem
    interval: tuple[float, float]
    graph: BranchGraph


@cache
def paths() -> tuple[Path, ...]:
    """The twelve paths that continuation is tried on."""
    gallery_paths = [(gallery.get(name).build(), interval) for name, interval in GALLERY]
    random_paths = [random_path(seed, p, loading=loading) for seed, p, loading in RANDOM]
    return tuple(
        Path(problem, interval, exact_graph(problem, interval)) for problem, interval in gallery_paths + random_paths
    )


def exact_graph(problem: ContactProblem, interval: tuple[float, float]) -> BranchGraph:
    graph = branch_graph(problem, interval, "exact")
    assert graph.complete
    return graph


def timed(action: Callable[..., Any], *arguments: Any) -> tuple[Any, float]:
    """What an action returns, and its process time."""
    started = time.process_time()
    answer = action(*arguments)
    return answer, time.process_time() - started


def located(graph: BranchGraph) -> tuple[Any, ...]:
    """Vertices that a path or a sampling should show: transitions and folds."""
    return (*graph.transitions, *graph.folds)


def series(rows: list[dict[str, Any]], name: str) -> str:
    """A column as text."""
    return " ".join(f"{row[name]:.3g}" if isinstance(row[name], float) else str(row[name]) for row in rows)
