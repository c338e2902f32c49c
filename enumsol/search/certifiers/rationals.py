"""The certifier of arithmetic "exact": every conclusion in rationals (theory, section 6.5)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from flint import fmpq, fmpq_mat

from enumsol.arithmetic.rationals import rational
from enumsol.relaxation.rows import INEQUALITY, RowKind, imposed_rows
from enumsol.search.certifiers.floats import solve_or_open
from enumsol.search.certifiers.protocol import WithoutProof
from enumsol.selections.rationals import ExactSelections

if TYPE_CHECKING:
    from enumsol.condensation.condensed import ScaledSystem
    from enumsol.relaxation.engine import Relaxation
    from enumsol.search.certifiers.protocol import UndecidedPart
    from enumsol.selections.polytopes import Form
    from enumsol.selections.solution import Codes, SelectionSolution

_FORCE_ROWS = (RowKind.NORMAL_FORCE, RowKind.TANGENTIAL_FORCE, RowKind.CONE_PLUS, RowKind.CONE_MINUS)


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
        solver, p = self._selections, self._selections.p
        v, total = list(solver.system.g), fmpq(0)
        for row, value in zip(*relaxation.multipliers(), strict=True):
            kind, node = RowKind(int(row) // p), int(row) % p
            mode = imposed_rows(codes[node], friction=solver.F_positive[node]).get(kind)
            if mode is None or (mode == INEQUALITY and value <= 0):
                continue
            # multipliers of the scaled problem, back in the problem's units
            unit = self._scaled.length[node] if kind in _FORCE_ROWS else self._scaled.force[node]
            u = rational(float(value)) * rational(float(unit))
            form, constant = self._form(kind, node)
            v = [a + u * b for a, b in zip(v, form, strict=True)]
            total -= u * constant
        if self._inverse is None:
            self._inverse = solver.system.S.inv()
        column = fmpq_mat([[a] for a in v])
        square = (column.transpose() * (self._inverse * column))[0, 0]
        return bool(4 * total > square)

    def _form(self, kind: RowKind, node: int) -> Form:
        """The row as a form over lambda, value = form . lambda + constant."""
        solver, p = self._selections, self._selections.p
        if kind in (RowKind.NORMAL_FORCE, RowKind.TANGENTIAL_FORCE):
            return solver.force_form(node if kind is RowKind.NORMAL_FORCE else p + node)
        if kind in (RowKind.CONE_PLUS, RowKind.CONE_MINUS):
            return solver.cone_form(node, 1 if kind is RowKind.CONE_PLUS else -1)
        if kind is RowKind.PENETRATION:
            return solver.gap_form(node, -1)
        return solver.gap_form(p + node, 1 if kind is RowKind.SLIP_FORWARD else -1)
