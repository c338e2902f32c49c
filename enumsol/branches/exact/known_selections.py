"""Selections of a graph that the search found, with the alpha at which they hold (theory, section 7.6).

Some are singular for every alpha: they hold families over an interval, sheets (theory, section 7.5).
"""

from __future__ import annotations

from itertools import combinations, pairwise, product
from math import comb, prod
from typing import TYPE_CHECKING, Any

from flint import fmpq, fmpq_mat, fmpq_poly

from enumsol.arithmetic import algebraic
from enumsol.branches.exact.selection_arcs import Cell, SelectionArcs, SelectionEvent, active_sets, selection_arcs
from enumsol.branches.unfinished import DEFECT, FEWER, named
from enumsol.selections.functions import SelectionFunctions
from enumsol.selections.rational_selections import FiberSelections, row_reduce
from enumsol.selections.solution import MAX_BASES, ActiveSets, VertexLimitError
from enumsol.support.deadlines import look

if TYPE_CHECKING:
    from enumsol.condensation.exact import ExactCondensed
    from enumsol.support.array_types import Codes


#: Bases whose vertex functions are followed over alpha; a sheet that needs more is refused.
MAX_SHEET_BASES = min(2000, MAX_BASES)


def sheet_arcs(exact: ExactCondensed, codes: Codes, a: fmpq, b: fmpq) -> SelectionArcs:
    """Cells and events of a selection that is singular for every alpha, in [a, b].

    A vertex of its polytope solves the equations and as many of the inequalities as its kernel has dimensions. All
    alpha at which the determinant of such a basis, another condition or an equation's residual vanishes are
    candidates for events; those at which nothing changes are removed. Cost: exponential in the dimension of
    the kernel.

    Raises
    ------
    VertexLimitError
        More than MAX_SHEET_BASES bases would have to be followed.
    """
    points = [algebraic.CriticalAlpha.rational(end) for end in ((a, b) if a != b else (a,))]
    for poly in _critical_polynomials(exact, codes):
        points += algebraic.real_roots(poly, a, b)
    events = [SelectionEvent(codes, group[0], singular=True) for group in algebraic.merge(points)]
    patterns = []
    for event in events:
        pattern = _pattern(exact, codes, algebraic.exact_value(event.alpha))
        event.holds = pattern is not None
        patterns.append(pattern)
    cells, between = [], []
    for left, right in pairwise(events):
        at = algebraic.rational_between(left.alpha, right.alpha)
        between.append(_pattern(exact, codes, at))
        cells.append(Cell(at, between[-1] is not None, 0))
    for k in range(len(events) - 2, 0, -1):
        if patterns[k] == between[k - 1] == between[k]:
            del events[k], patterns[k], cells[k], between[k]
    arcs = SelectionArcs(codes, SelectionFunctions(exact, codes), events, cells, grazing=True)
    for event in arcs.events:
        event.singular = True
    return arcs


def _pattern(exact: ExactCondensed, codes: Codes, alpha: fmpq) -> Any:
    """Shape of a polytope: the active sets of its vertices; None when it is empty."""
    solver = FiberSelections(exact, alpha)
    solution = solver.solve(codes)
    if solution is None:
        return None
    return frozenset(solver.active(vertex) for vertex in solution.vertices)


def _critical_polynomials(exact: ExactCondensed, codes: Codes) -> list[Any]:
    """Nonzero integer polynomials whose roots include every alpha at which the polytope changes its shape."""
    size = len(exact.rows)

    def rows_at(alpha: fmpq) -> tuple[list[list[Any]], list[list[Any]]]:
        equations, inequalities = FiberSelections(exact, alpha).forms(codes)
        return [[*form, c] for form, c in equations], [[*form, c] for form, c in inequalities]

    # a rank that holds for all but finitely many alpha is found at one of more points than the degree of any minor
    independent = max((_independent_rows(rows_at(fmpq(k))[0]) for k in range(size + 2)), key=len)
    dimension = size - len(independent)
    count = len(rows_at(fmpq(0))[1])
    if comb(count, dimension) > MAX_SHEET_BASES:
        raise VertexLimitError(
            f"a sheet of roots has {comb(count, dimension)} candidate vertices; at most {MAX_SHEET_BASES} are followed"
        )
    # numerators have at most one factor affine in alpha from every row
    nodes = [fmpq(k) for k in range(size + 2)]
    samples = [rows_at(node) for node in nodes]
    inverse = fmpq_mat([[node**k for k in range(len(nodes))] for node in nodes]).inv()
    found = []
    for basis in combinations(range(count), dimension):
        look()
        table = [_bordered(equations, inequalities, independent, basis, size) for equations, inequalities in samples]
        for column in (inverse * fmpq_mat(table)).transpose().tolist():
            poly = algebraic.integer_polynomial(fmpq_poly(column))
            if poly.degree() > 0 and poly not in found:
                found.append(poly)
    return found


def _independent_rows(rows: list[list[Any]]) -> list[int]:
    """Numbers of rows that span the others (constants left out)."""
    return row_reduce([list(column) for column in zip(*(row[:-1] for row in rows), strict=True)])[1]


def _bordered(
    equations: list[list[Any]], inequalities: list[list[Any]], independent: list[int], basis: tuple[int, ...], size: int
) -> list[Any]:
    """Determinant of a basis, and of it bordered by every other row: det times the row's value at the basis' point."""
    chosen = [equations[k] for k in independent] + [inequalities[k] for k in basis]
    values = [fmpq_mat([row[:size] for row in chosen]).det()]
    others = [row for k, row in enumerate(equations) if k not in independent]
    others += [row for k, row in enumerate(inequalities) if k not in basis]
    return values + [fmpq_mat([*chosen, row]).det() for row in others]


class KnownSelections:
    """Selections that hold somewhere in [a, b].

    Parameters
    ----------
    exact : ExactCondensed
    a, b : fmpq

    Attributes
    ----------
    arcs : dict of SelectionArcs by codes
    added : set of codes
        Selections that were worked out, also those that hold nowhere.
    cut_short : bool
        The search was stopped: selections it did not find are left out, and arcs may end without neighbours.
    late : bool
        The time was over before all of them were joined.
    waiting : list of SelectionEvent
        Events at which other selections have not been looked for yet.
    reasons : list of str
        What stayed undecided or contradicts completeness.
    """

    def __init__(self, exact: ExactCondensed, a: fmpq, b: fmpq, *, cut_short: bool) -> None:
        self.exact, self.a, self.b, self.cut_short = exact, a, b, cut_short
        self.late = False
        self.arcs: dict[Codes, SelectionArcs] = {}
        self.added: set[Codes] = set()
        self.waiting: list[SelectionEvent] = []
        self.reasons: list[str] = []
        self._refused: set[Codes] = set()
        self._fibers: list[tuple[algebraic.CriticalAlpha, FiberSelections]] = []

    @property
    def gaps(self) -> bool:
        """True if selections that hold may be missing."""
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
        else:
            if not arcs.empty:
                self.arcs[codes] = arcs
        self.added.add(codes)

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
        if event.polytope is not None:
            return True
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

    def _fiber(self, alpha: algebraic.CriticalAlpha) -> FiberSelections:
        """The exact solver at this alpha."""
        for known, solver in self._fibers:
            if known.compare(alpha) == 0:
                return solver
        solver = FiberSelections(self.exact, algebraic.exact_value(alpha))
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
