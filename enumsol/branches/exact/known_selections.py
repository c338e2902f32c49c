"""Selections of a graph that the search found, with the alpha at which they hold (theory, section 7.6)."""

from __future__ import annotations

from itertools import product
from math import prod
from typing import TYPE_CHECKING, Any

from enumsol.arithmetic.number_field import exact_value
from enumsol.branches.exact.selection_arcs import SelectionArcs, SelectionEvent, active_sets, selection_arcs
from enumsol.branches.remedies import DEFECT, FEWER, named
from enumsol.branches.sheets import sheet_arcs
from enumsol.selections.rational_selections import FiberSelections
from enumsol.selections.solution import VertexLimitError
from enumsol.support.deadlines import look

if TYPE_CHECKING:
    from enumsol.arithmetic.algebraic import CriticalAlpha
    from enumsol.condensation.exact import ExactCondensed
    from enumsol.selections.solution import ActiveSets, Codes


class KnownSelections:
    """Selections that hold somewhere in [a, b].

    Parameters
    ----------
    exact : ExactCondensed
    a, b : fmpq

    Attributes
    ----------
    arcs : dict of SelectionArcs by codes
    cut_short : bool
        The search was stopped: selections it did not find are left out, and arcs may end without neighbours.
    late : bool
        The time was over before all of them were joined.
    waiting : list of SelectionEvent
        Events at which other selections have not been looked for yet.
    reasons : list of str
        What stayed undecided or contradicts completeness.
    """

    def __init__(self, exact: ExactCondensed, a: Any, b: Any, *, cut_short: bool) -> None:
        self.exact, self.a, self.b, self.cut_short = exact, a, b, cut_short
        self.late = False
        self.arcs: dict[Codes, SelectionArcs] = {}
        self.waiting: list[SelectionEvent] = []
        self.reasons: list[str] = []
        self._refused: set[Codes] = set()
        self._fibers: list[tuple[CriticalAlpha, FiberSelections]] = []

    @property
    def gaps(self) -> bool:
        """Whether selections that hold may be missing."""
        return self.cut_short or bool(self._refused)

    def complain(self, reason: str) -> None:
        """Add a reason, once."""
        if reason not in self.reasons:
            self.reasons.append(reason)

    def contradict(self, what: str) -> None:
        """Add a reason that contradicts what the search has proven."""
        self.complain(f"{what}; {DEFECT}")

    # -- taking in -------------------------------------------------------------------------------------------------

    def add(self, codes: Codes) -> None:
        """Work out where a selection holds; ``close`` decides its singular events."""
        try:
            arcs = selection_arcs(self.exact, codes, self.a, self.b)
            if arcs is None:
                arcs = sheet_arcs(self.exact, codes, self.a, self.b)
        except VertexLimitError as error:
            self._refused.add(codes)
            self.complain(f"{named(codes)}: {error}; {FEWER}")
            return
        if not arcs.empty:
            self.arcs[codes] = arcs

    def close(self, codes: Codes) -> None:
        """Decide a selection's singular events: which have solutions, and the polytopes they form."""
        arcs = self.arcs[codes]
        for event in arcs.events:
            if not (event.singular and event.holds) or self.solve(event):
                continue
            if arcs.beside(event):
                self.contradict(f"an arc of {named(codes)} has no limit at alpha = {float(event.alpha):.17g}")
            else:
                event.holds = False
        if arcs.empty:
            del self.arcs[codes]

    def solve(self, event: SelectionEvent) -> bool:
        """Find the polytope of a selection at a singular event; False when it has no solution there."""
        look()
        solver = self._fiber(event.alpha)
        try:
            solution = solver.solve(event.codes)
        except VertexLimitError as error:
            event.settled = False
            self.complain(f"{named(event.codes)} at alpha = {float(event.alpha):.17g}: {error}; {FEWER}")
            return True
        if solution is not None:
            event.polytope = (solver, solution)
            event.bounded = solver.rests_on_reach(event.codes, solution)
        return solution is not None

    def _fiber(self, alpha: CriticalAlpha) -> FiberSelections:
        """The exact solver at this alpha."""
        for known, solver in self._fibers:
            if known.compare(alpha) == 0:
                return solver
        solver = FiberSelections(self.exact, exact_value(alpha))
        self._fibers.append((alpha, solver))
        return solver

    # -- asking ----------------------------------------------------------------------------------------------------

    def active_at(self, event: SelectionEvent) -> list[ActiveSets]:
        """Active sets of the selection's solution at an event: one, or one for every vertex of its polytope."""
        if event.polytope is not None:
            solver, solution = event.polytope
            sets = [solver.active(vertex) for vertex in solution.vertices]
        elif event.singular:
            sets = []
        else:
            functions = self.arcs[event.codes].functions
            sets = [active_sets(functions, event.alpha, self.exact)]
        event.active = tuple(
            frozenset({code}.union(*(active[i] for active in sets))) for i, code in enumerate(event.codes)
        )
        return sets

    def members(self, active: ActiveSets) -> tuple[list[Codes], bool]:
        """Known selections among those that hold, and whether these are all of them.

        If the search was not cut short, a selection it left out is a contradiction, and is added.
        """
        count = prod(len(a) for a in active)
        if count > 2 * len(self.arcs) + 64:
            known = [c for c in self.arcs if all(code in a for code, a in zip(c, active, strict=True))]
            return known, not self.gaps
        known = [
            codes
            for codes in product(*(sorted(a) for a in active))
            if codes in self.arcs or (not self.cut_short and self._add_left_out(codes))
        ]
        return known, len(known) == count

    def _add_left_out(self, codes: Codes) -> bool:
        """Add a selection that a complete search should have found; whether it holds anywhere."""
        if codes not in self._refused:
            self.add(codes)
        if codes in self._refused:
            return False
        if codes in self.arcs:
            self.close(codes)
        if codes not in self.arcs:
            self.contradict(f"{named(codes)} holds and its own functions say otherwise")
            return False
        self.contradict(f"the search left out {named(codes)}, which holds somewhere")
        self.waiting += [event for event in self.arcs[codes].events if event.holds]
        return True
