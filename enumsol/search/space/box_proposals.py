"""Boxes that may hold one solution in 3D (theory, section 12.7).

Nothing here is trusted: ``trusted.space.boxed_solution`` proves what is proposed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from enumsol.trusted.space.boxed_solution import Box, BoxProblem
from enumsol.trusted.space.space_uniqueness import moderate_units

if TYPE_CHECKING:
    from enumsol.condensation.space_condensed import EnclosedSpace
    from enumsol.support.array_types import Floats


#: Size of the box that is tried first, by the forces that would hold one node alone, and how often it is halved.
_FIRST, _HALVINGS = 1.0, 24
#: Where rho is tried between compliance and stiffness, as an exponent of the latter.
_SHARES = 0.5, 1.0


def box_around(system: EnclosedSpace, y: Floats) -> Box | None:
    """A box, as large as is found, that seems to hold one solution, near scaled forces y."""
    if not moderate_units(system.unit) or not np.all(np.isfinite(y)):
        return None
    with np.errstate(all="ignore"):
        for rho in proposed_rho(system):
            problem = BoxProblem.of(system, rho)
            centre = None if problem is None else problem.zero(y * system.unit)
            if problem is None or centre is None:
                continue
            near = problem.around(centre)
            radius = np.full(len(y), _FIRST * float(np.max(np.abs(problem.g.mid) / np.diagonal(problem.S.mid))))
            for _ in range(_HALVINGS):
                if near.mapped(radius, 2.0) is not None:
                    return Box.of(system, centre / system.unit, radius / system.unit, rho)
                radius *= 0.5
    return None


def proposed_rho(system: EnclosedSpace) -> list[Floats]:
    """rho, one for lambda_n and one for tau of every node, scaled: between 1 / S_ii and the stiffness S^-1_ii."""
    soft = system.unit**2 / np.diagonal(system.S)
    try:
        stiff = np.diagonal(np.linalg.inv(system.S)) * system.unit**2
    except np.linalg.LinAlgError:
        return []
    found = []
    for share in _SHARES:
        rho = soft ** (1.0 - share) * stiff**share
        for t in system.tau:
            rho[t[t >= 0]] = np.min(rho[t[t >= 0]], initial=np.inf)
        found.append(rho / system.unit**2)
    return found
