"""The certifier of arithmetic "exact": every conclusion in rationals (theory, section 6.5).

The checker has a dual bound of its own, ``enumsol.checker.rational``; a test compares the two.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from flint import fmpq, fmpq_mat

from enumsol.arithmetic.rationals import rational
from enumsol.model.statuses import CONDITIONS, OPEN, SLIDING, RowKind
from enumsol.relaxation.engine import INEQUALITY, imposed_rows
from enumsol.search.certifiers.protocol import Bound, Certifier, UndecidedPart, solve_or_open
from enumsol.search.fathoming import holds_below
from enumsol.selections.solution import SelectionSolution
from enumsol.support.deadlines import look
from enumsol.trusted.uniqueness import only_solution

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

    from enumsol.condensation.condensed import ScaledSystem
    from enumsol.proof.leaves import OnlyReference
    from enumsol.search.certifiers.exclusions import Exclusions
    from enumsol.search.reduction import Point, Proposal
    from enumsol.selections.rational_selections import ExactSelections, Form
    from enumsol.support.array_types import Codes, Floats, Indices
    from enumsol.trusted.at_alpha import VerifiedSelection
    from enumsol.trusted.reference import PlaneReference


_NEWTON_STEPS = 8
_DISPLACEMENTS = (RowKind.PENETRATION, RowKind.SLIP_FORWARD, RowKind.SLIP_BACKWARD)


def accepted(
    rows: Indices, values: Floats, imposed: Callable[[int], Mapping[int, int]], scaled: ScaledSystem
) -> Iterator[tuple[int, int, Any]]:
    """Kind, node and multiplier, in the problem's units, of the rows that a node imposes and signs that they admit."""
    for row, value in zip(rows, values, strict=True):
        kind, node = divmod(int(row), scaled.p)
        mode = imposed(node).get(kind)
        if mode is None or (mode == INEQUALITY and value <= 0):
            continue
        unit = scaled.force[node] if kind in _DISPLACEMENTS else scaled.length[node]
        yield kind, node, rational(float(value)) * rational(float(unit))


def energy_bound_positive(g: tuple[Any, ...], inverse: Any, terms: Iterable[tuple[Any, Form]]) -> bool:
    """True if -1/4 v' S^-1 v - sum u * constant > 0 with v = g + sum u * form, for multipliers u of affine forms."""
    v, total = list(g), fmpq(0)
    for u, (form, constant) in terms:
        v = [a + u * b for a, b in zip(v, form, strict=True)]
        total -= u * constant
    column = fmpq_mat([[a] for a in v])
    return bool(4 * total > (column.transpose() * (inverse * column))[0, 0])


class ExactCertifier(Certifier):
    """Rationals: a pruning needs multipliers whose dual bound is positive, exactly (theory, (6.1)).

    Of a body that nothing holds balls prove prunings as well (theory, section 14.3).

    Parameters
    ----------
    selections : ExactSelections
    scaled : ScaledSystem
    exclusions : Exclusions or None
        With balls for it; without them no subtree is closed.
    precisely : callable giving the verified solution of a complete selection in many digits, or None
        Asked first whether a selection is worth being solved in rationals.
    """

    writes = False

    def __init__(
        self,
        selections: ExactSelections,
        scaled: ScaledSystem,
        exclusions: Exclusions | None = None,
        precisely: Callable[[Codes], VerifiedSelection | None] | None = None,
    ) -> None:
        self._selections = selections
        self._precisely = precisely
        self._scaled = scaled
        self._exclusions = exclusions
        super().__init__()
        self._inverse: Any = None

    def selection(self, codes: Codes) -> SelectionSolution | UndecidedPart | None:
        """All roots in the selection."""
        found = solve_or_open(self._selections, codes)
        if not isinstance(found, UndecidedPart) and not self.bounded:
            self.bounded = self._selections.rests_on_reach(codes, found)
        return found

    def reference(self, selection: Codes) -> PlaneReference | None:
        """The form of a root of a body that nothing holds, if one is proven definite."""
        return None if self._exclusions is None else self._exclusions.reference(selection)

    def only_root(
        self, codes: Codes, reference: PlaneReference, proposal: OnlyReference
    ) -> list[SelectionSolution] | None:
        """The roots below an assignment, that of a form or none; None if that is not proven."""
        exclusions = self._exclusions
        needs = None if exclusions is None else exclusions.only_root(codes, reference, proposal, within=self.bounded)
        if needs is None:
            return None
        if not reference.lies_below(codes):
            return []
        root = solve_or_open(self._selections, reference.selection)
        return [root] if isinstance(root, SelectionSolution) else None

    def closed(self, codes: Codes, proposal: Proposal | None, near: Point) -> list[SelectionSolution] | None:
        """The solutions below a partial assignment, none or one (theory, section 6.11); None if not proven."""
        if self._exclusions is None or proposal is None or proposal.weights is None:
            return None
        solver, selection = self._selections, proposal.selection
        solved = None if self._fails(proposal) else solver.solve_equations(selection)
        if solved is None:
            return None
        point, determinant = solved
        active, moved = solver.active(point), solver.moved(point)
        if not all(selection[i] in active[i] for i in proposal.free):
            return None
        if any(moved[i] > 0 if selection[i] == OPEN else point[i] < 0 for i in proposal.sliding):
            return None
        sign = only_solution(self._exclusions.system, proposal.named, proposal.free, proposal.weights, point, moved)
        if not sign:
            return None
        if not holds_below(codes, active):
            return []
        fixed = [i for i in range(solver.p) if i not in proposal.free]
        sides = {i: SLIDING[code] for i, code in proposal.sliding.items()}
        index = sign if all(active[i] <= set(sides.get(i, (selection[i],))) for i in fixed) else None
        strict = all(len(held) == 1 for held in active)
        return [SelectionSolution(proposal.selection, (point,), 0, determinant, strict, exact=True, index=index)]

    def _fails(self, proposal: Proposal) -> bool:
        """True if many digits show that the solution of a proposal breaks a condition at a node that is free."""
        found = None if self._precisely is None else self._precisely(proposal.selection)
        if found is None:
            return False
        kinds = [(i, kind) for i, code in enumerate(proposal.selection) for kind in CONDITIONS[code].inequalities]
        broken = (found.slack.mid < -found.slack.rad).tolist()
        free = {*proposal.free}
        return any(is_broken and i in free for (i, _), is_broken in zip(kinds, broken, strict=True))

    def solution_near(self, proposal: Proposal) -> SelectionSolution | None:
        """The root of what is proposed with the statuses that hold exactly, by Newton's method; None if not found."""
        solver, free, codes = self._selections, {*proposal.free, *proposal.sliding}, proposal.selection
        units = self._scaled.force / self._scaled.length
        for _ in range(_NEWTON_STEPS):
            look()
            solved = solver.solve_equations(codes)
            if solved is None:
                return None
            point, determinant = solved
            active = solver.active(point)
            if all(code in held for code, held in zip(codes, active, strict=True)):
                strict = all(len(held) == 1 for held in active)
                return SelectionSolution(codes, (point,), 0, determinant, strict, exact=True)
            moved = solver.statuses_by_test_functions(point, units)
            codes = tuple(moved[i] if i in free else code for i, code in enumerate(codes))
        return None

    def excluded(self, codes: Codes, relaxation: Bound) -> bool:
        """True if the multipliers prove a positive lower bound on the energy."""
        solver = self._selections
        if solver.modes:
            if self._exclusions is None:
                return False
            found = self._exclusions.record(codes, relaxation, within=self.bounded)
            self.bounded |= found is not None and found[1]
            return found is not None

        def imposed(node: int) -> dict[int, int]:
            return imposed_rows(codes[node], friction=solver.F_positive[node])

        if self._inverse is None:
            self._inverse = solver.system.S.inv()
        rows, values = relaxation.multipliers()
        terms = accepted(rows, values, imposed, self._scaled)
        forms = ((u, solver.form(RowKind(kind), node)) for kind, node, u in terms)
        return energy_bound_positive(solver.system.g, self._inverse, forms)
