"""Local degree of a root at which very many selections hold: a search on a perturbed problem (theory, section 6.7)."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from enumsol.search.certifiers.floats import FastCertifier
from enumsol.search.outcome import SearchLimits
from enumsol.search.splitting import PlaneSplitting
from enumsol.search.tree import TreeSearch
from enumsol.selections.floats import FloatSelections

if TYPE_CHECKING:
    from enumsol.selections.solution import ActiveSets

#: Size of the perturbation of g relative to the load's energy norm (to one for an unloaded body).
_STEPS = (1e-3, 1e-4)
_MAX_NODES = 200_000


def perturbed_degree(solver: FloatSelections, active: ActiveSets) -> int | None:
    """Sum of sign det over the roots near a degenerate one after a small generic perturbation of g.

    The active sets restrict the search to the selections that hold at the root; a regular one among them has its root
    there before the perturbation. None when two perturbations do not agree, or a perturbed root is not regular.
    """
    found = []
    for seed, step in enumerate(_STEPS):
        push = np.random.default_rng(seed + 1).normal(size=2 * solver.p) * np.sqrt(np.diagonal(solver.system.S))
        loaded = bool(np.any(solver.system.g))
        system = replace(solver.system, g=solver.system.g + (step if loaded else 1.0) * push)
        moved = FloatSelections(system, solver.tolerance)
        splitting, limits = PlaneSplitting(system.F, active), SearchLimits(max_nodes=_MAX_NODES)
        search = TreeSearch(system, FastCertifier(moved), splitting=splitting, limits=limits)
        outcome = search.run()
        if outcome.stopped is not None or any(not s.strict or s.det_sign == 0 for s in outcome.solutions):
            return None
        found.append(sum(solution.det_sign for solution in outcome.solutions))
    return found[0] if found[0] == found[1] else None
