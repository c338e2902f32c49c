"""The certifier of arithmetic "exact": every conclusion in rationals (theory, section 6.5)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from enumsol.relaxation.rows import imposed_rows
from enumsol.search.certifiers.dual_bound import accepted, energy_bound_positive
from enumsol.search.certifiers.floats import solve_or_open
from enumsol.search.certifiers.protocol import WithoutProof
from enumsol.statuses import RowKind

if TYPE_CHECKING:
    from enumsol.condensation.condensed import ScaledSystem
    from enumsol.relaxation.engine import Relaxation
    from enumsol.search.certifiers.protocol import UndecidedPart
    from enumsol.selections.rationals import ExactSelections
    from enumsol.selections.solution import Codes, SelectionSolution


class ExactCertifier(WithoutProof):
    """Rationals: a pruning needs multipliers whose dual bound is positive, exactly (theory, (6.1))."""

    def __init__(self, selections: ExactSelections, scaled: ScaledSystem) -> None:
        self._selections = selections
        self._scaled = scaled
        self._inverse: Any = None

    def selection(self, codes: Codes) -> SelectionSolution | UndecidedPart | None:
        """All roots in the selection."""
        return solve_or_open(self._selections, codes)

    def excluded(self, codes: Codes, relaxation: Relaxation) -> bool:
        """Whether the multipliers prove a positive lower bound on the energy."""
        solver = self._selections

        def imposed(node: int) -> dict[int, int]:
            return imposed_rows(codes[node], friction=solver.F_positive[node])

        if self._inverse is None:
            self._inverse = solver.system.S.inv()
        terms = accepted(*relaxation.multipliers(), imposed, self._scaled)
        forms = ((u, solver.form(RowKind(kind), node)) for kind, node, u in terms)
        return energy_bound_positive(solver.system.g, self._inverse, forms)
