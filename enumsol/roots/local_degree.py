"""Local degree of a root at which very many selections hold (theory, section 6.7)."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from enumsol.search.certifiers.float_certifier import FastCertifier
from enumsol.search.outcome import SearchLimits
from enumsol.search.reduction import Reduction
from enumsol.search.solvers import plane_search
from enumsol.search.splitting import PlaneSplitting
from enumsol.selections.float_selections import FloatSelections
from enumsol.support.deadlines import current

if TYPE_CHECKING:
    from enumsol.selections.solution import ActiveSets
    from enumsol.support.array_types import Floats


#: Sizes of the perturbation of g relative to the load's energy norm (to one for an unloaded body), and of which two
#: the roots must lie in the same selections: statuses that hold strictly must not be lost on the way.
_STEPS, _DIRECTIONS = (1e-5, 1e-6), 2
_MAX_NODES = 100_000


def local_degree(solver: FloatSelections, active: ActiveSets, point: tuple[Floats, Floats] | None) -> int | None:
    """Local degree of a degenerate root, or of a family; None where it is not found.

    Parameters
    ----------
    solver : FloatSelections
    active : per node the codes that hold
    point : lambda and w of an isolated root
    """
    index = None if point is None else _reduced_degree(solver, active, *point)
    return perturbed_degree(solver, active) if index is None else index


def _reduced_degree(solver: FloatSelections, active: ActiveSets, force: Floats, w: Floats) -> int | None:
    """The sign of the determinant of the strict nodes' equations, if the others have one solution.

    See theory, section 6.11.
    """
    system = solver.system
    codes = tuple(min(held) for held in active)
    free = tuple(i for i, held in enumerate(active) if len(held) > 1)
    try:
        reduction = Reduction(system, codes, free, {})
    except np.linalg.LinAlgError:
        return None
    x, v = ((values / unit)[reduction.places] for values, unit in ((force, system.force), (w, system.length)))
    found = reduction.weights(x, v, exactly=True)
    return None if found is None else reduction.sign


def perturbed_degree(solver: FloatSelections, active: ActiveSets) -> int | None:
    """Sum of sign det over the roots near a degenerate one after a small generic perturbation of g.

    The active sets restrict the search to the selections that hold at the root; a regular one among them has its root
    there before the perturbation. None when perturbations do not agree, or a perturbed root is not regular.
    """
    found = []
    for seed in range(_DIRECTIONS):
        push = np.random.default_rng(seed + 1).normal(size=2 * solver.p) * np.sqrt(np.diagonal(solver.system.S))
        near, nearer = (_perturbed(solver, active, step * push) for step in _STEPS)
        if near is None or near != nearer:
            return None
        found.append(sum(near.values()))
    return found[0] if found[0] == found[1] else None


def _perturbed(solver: FloatSelections, active: ActiveSets, push: Floats) -> dict[tuple[int, ...], int] | None:
    """Selections of the roots of a perturbed problem, with sign det; None where it is not found."""
    loaded = bool(np.any(solver.system.g))
    system = replace(solver.system, g=solver.system.g + push if loaded else push / _STEPS[-1])
    splitting, limits = PlaneSplitting(system.F, active), SearchLimits(max_nodes=_MAX_NODES, deadline=current())
    certifier = FastCertifier(FloatSelections(system, solver.tolerance))
    outcome = plane_search(system, certifier, splitting, limits).run()
    if outcome.stopped is not None or any(not s.strict or s.det_sign == 0 for s in outcome.solutions):
        return None
    return {solution.codes: solution.det_sign for solution in outcome.solutions}
