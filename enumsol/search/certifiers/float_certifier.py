"""The certifier of arithmetic "fast": prunings accepted, complete selections decided in floats."""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial
from typing import TYPE_CHECKING

import numpy as np

from enumsol.relaxation.engine import PRUNE_MARGIN
from enumsol.search.certifiers.protocol import Bound, Certifier, UndecidedPart, margin_of_form
from enumsol.search.fathoming import holds_below, without_load
from enumsol.search.reduction import NEAR
from enumsol.selections.solution import SelectionSolution, SelectionSolver, VertexLimitError

if TYPE_CHECKING:
    from enumsol.search.reduction import Point, Proposal
    from enumsol.selections.float_selections import FloatSelections
    from enumsol.support.array_types import Codes


#: A condition is broken beyond doubt: one that is broken by less may hold within the tolerance at another point.
_CLEARLY = 1e-6


def solve_or_open(solver: SelectionSolver, codes: Codes) -> SelectionSolution | UndecidedPart | None:
    """The solver's answer; a polytope with too many candidate vertices leaves the selection open."""
    try:
        return solver.solve(codes)
    except VertexLimitError as error:
        return UndecidedPart(codes, str(error), "perturb the load or the friction coefficient", examined=True)


class FastCertifier(Certifier):
    """Floats and tolerances: the result of the engine is trusted unless the tolerance could overturn it.

    A condition within the tolerance of zero counts as satisfied. Shifting every row of a certificate by twice that
    changes its bound by the multipliers times the shift; a pruning that does not survive it is branched on.
    """

    writes = False
    # with other numbers forms are definite where they nearly are not: several points may hold within the tolerance
    plain = True

    def __init__(self, selections: FloatSelections) -> None:
        self._selections = selections
        super().__init__()
        self._norms = selections.row_norms()
        self._margin_of = cache(partial(margin_of_form, errors=1.0))

    def excluded(self, codes: Codes, relaxation: Bound) -> bool:
        """Accept the pruning if conditions may be off by twice the tolerance."""
        rows, values = relaxation.multipliers()
        shift = float(np.abs(values) @ self._norms[rows])
        if relaxation.form is not None:
            # hardly convex: its bound is worth what is left of it after rounding
            return self._margin_of(relaxation.form)(codes, rows, values) > 2.0 * self._selections.tolerance * shift
        return relaxation.bound > PRUNE_MARGIN + 2.0 * self._selections.tolerance * shift

    def closed(self, codes: Codes, proposal: Proposal | None, near: Point) -> list[SelectionSolution] | None:
        """The solutions below a partial assignment, none or one, if it can hold one only; within the tolerance."""
        solver = self._selections
        if proposal is None or proposal.weights is None:
            return None
        # a point whose conditions hold within the tolerance is nearer than this to the solution of a closed subtree
        if 2.0 * solver.tolerance * proposal.reduction.sensitivity > 1e-3:
            return None
        if proposal.least < -max(_CLEARLY, 2.0 * solver.tolerance):
            return []
        solution = solver.solve(proposal.selection)
        if solution is None or solution.dimension > 0 or not holds_below(codes, solver.active(solution.vertices[0])):
            return None
        return [replace(solution, index=proposal.reduction.sign if proposal.least > NEAR else None)]

    def selection(self, codes: Codes) -> SelectionSolution | UndecidedPart | None:
        """All roots in the selection within the tolerance."""
        found = solve_or_open(self._selections, codes)
        if isinstance(found, SelectionSolution) and not found.strict:
            system, force = self._selections.system, found.vertices[0]
            self.sliding |= without_load(system, force, system.g - system.S @ force)
        return found
