"""Increments halved until the statuses along all histories no longer change."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import networkx as nx

from enumsol.loading.history_data import Refinement

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from enumsol.loading.history_data import HistoryData
    from enumsol.loading.steps import LoadStep

    #: The statuses of all nodes at the given steps along one history.
    Shape = tuple[tuple[Any, ...], ...]

#: Histories that are compared at most.
_MOST = 20_000


def refined(
    grown: Callable[[Sequence[LoadStep]], HistoryData],
    steps: Sequence[LoadStep],
    way: tuple[LoadStep, LoadStep],
    most: int,
) -> HistoryData:
    """The history with the finest increments that were tried: the first of which halving changed nothing, halved.

    ``way``: from where to where the load goes in the first step.
    """
    history = grown(steps)
    changes: list[int] = []
    reason = _incomparable(history)
    while reason is None and len(changes) < most and (not changes or changes[-1]):
        parts = 2 ** (len(changes) + 1)
        finer = grown(halved(steps, way, parts))
        reason = _incomparable(finer)
        if reason is None:
            changes.append(_changed(shapes(history, parts // 2), shapes(finer, parts), len(steps)))
            history = finer
    settled = bool(changes) and changes[-1] == 0
    return replace(history, refinement=Refinement(len(changes), settled, tuple(changes), reason))


def halved(steps: Sequence[LoadStep], way: tuple[LoadStep, LoadStep], parts: int) -> list[LoadStep]:
    """Every step in so many equal parts; ``way``: from where to where the load goes in the first one."""
    found: list[LoadStep] = []
    for (start, end), step in zip([way, *pairwise(steps)], steps, strict=True):
        found += [start.between(end, Fraction(k, parts)) for k in range(1, parts)]
        found.append(step)
    return found


def shapes(history: HistoryData, every: int) -> set[Shape]:
    """The statuses along the histories, seen after every so many steps."""
    statuses = nx.get_node_attributes(history.graph, "statuses")
    return {tuple(statuses[node] for node in path if node[0] % every == 0) for path in history.paths()}


def _changed(one: set[Shape], other: set[Shape], steps: int) -> int:
    """The first step up to which two sets of histories have different statuses; 0 where they have the same."""
    for number in range(1, steps + 1):
        if {shape[:number] for shape in one} != {shape[:number] for shape in other}:
            return number
    return 0


def _incomparable(history: HistoryData) -> str | None:
    """Why comparing a history would tell nothing about its increments, or None."""
    if history.counts[-1] > _MOST:
        return f"there are {history.counts[-1]} histories, too many to compare (at most {_MOST})"
    return history.reasons[0] if history.reasons else None
