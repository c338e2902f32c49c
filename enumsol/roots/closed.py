"""Roots that fathom subtrees by uniqueness and are known by enclosures: each once, beside roots of selections."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from enumsol.roots.components import RootComponent
from enumsol.trusted.uniqueness import same_solution

if TYPE_CHECKING:
    from collections.abc import Iterable

    from enumsol.selections.solution import Codes, SelectionSolution

Kept = tuple[list["SelectionSolution"], list["SelectionSolution"], list["Codes"]]


def apart(solutions: Iterable[SelectionSolution]) -> Kept:
    """Solutions of selections; other roots that closed subtrees, each once; the cores of those in doubt.

    The results do not depend on the order of the solutions. A root that closed a subtree and is a degenerate solution
    of a selection gives that solution its index. A root in doubt may be the same as another one (theory, section 6.11).
    """
    single, closed = [], {}
    for solution in solutions:
        if solution.possible is None:
            single.append(solution)
        else:
            closed[solution.codes] = solution
    # a strict solution may have closed several subtrees, decided by balls in one of them and by rationals in another
    strict = {s.codes: s for s in single if s.strict and not s.exact}
    single = [*strict.values(), *(s for s in single if s.codes not in strict)]
    kept: list[SelectionSolution] = []
    doubtful = []
    for core, solution in sorted(closed.items()):
        same = [_same(solution, other) for other in single]
        for k in (k for k, answer in enumerate(same) if answer and not single[k].strict):
            single[k] = replace(single[k], index=solution.index)
        same += [_same(solution, other) for other in kept]
        if True in same:
            continue
        if None in same:
            doubtful.append(core)
        kept.append(solution)
    return single, kept, doubtful


def _same(closed: SelectionSolution, other: SelectionSolution) -> bool | None:
    possible = other.possible or tuple(frozenset((code,)) for code in other.codes)
    return same_solution(closed.codes, closed.possible or (), other.codes, possible)


def closed_component(solution: SelectionSolution) -> RootComponent:
    """Component of a root known only by its enclosure; nothing further can be computed."""
    return RootComponent((solution,), solution.possible or (), 0, solution.index, whole=True)
