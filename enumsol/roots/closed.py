"""Roots that close subtrees and are known by their enclosures: each once, beside those of single selections."""

from __future__ import annotations

from typing import TYPE_CHECKING

from enumsol.kernel.closing import same_solution
from enumsol.roots.components import RootComponent

if TYPE_CHECKING:
    from collections.abc import Iterable

    from enumsol.selections.solution import ActiveSets, Codes, SelectionSolution

Kept = tuple[list["SelectionSolution"], list["SelectionSolution"], list["Codes"]]


def apart(solutions: Iterable[SelectionSolution]) -> Kept:
    """Solutions of selections, closed roots that are none of them, each once, and the cores of those in doubt.

    Neither depends on the order of the solutions. A closed root in doubt may be the same as another one (theory,
    section 6.11).
    """
    single, closed = [], {}
    for solution in solutions:
        if solution.possible is None:
            single.append(solution)
        else:
            closed[solution.codes] = solution
    known: list[tuple[Codes, ActiveSets]] = [
        (s.codes, tuple(frozenset((code,)) for code in s.codes)) for s in single if closed
    ]
    kept, doubtful = [], []
    for core, solution in sorted(closed.items()):
        possible = solution.possible or ()
        answers = [same_solution(core, possible, *other) for other in known]
        if True in answers:
            continue
        if None in answers:
            doubtful.append(core)
        known.append((core, possible))
        kept.append(solution)
    return single, kept, doubtful


def closed_component(solution: SelectionSolution) -> RootComponent:
    """A closed root, of which all is known that ever will be."""
    return RootComponent((solution,), solution.possible or (), 0, solution.index, whole=True)
