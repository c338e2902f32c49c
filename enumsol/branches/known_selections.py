"""Selections of a graph that the search found, with the alpha at which they hold (theory, section 7.6).

Some are singular for every alpha: they hold families over an interval, sheets (theory, section 7.5).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cache
from itertools import combinations, pairwise, product
from math import comb, prod
from typing import TYPE_CHECKING, Any

from flint import fmpq, fmpq_mat, fmpq_poly

from enumsol.arithmetic import algebraic
from enumsol.arithmetic.algebraic import CriticalAlpha, merge, rational_between, real_roots, sign
from enumsol.branches.elements import DEFECT, FEWER, named
from enumsol.model.statuses import CONDITIONS, FINAL, STICK, RowKind
from enumsol.selections.functions import SelectionFunctions
from enumsol.selections.rational_selections import FiberSelections, row_reduce
from enumsol.selections.solution import MAX_BASES, ActiveSets, VertexLimitError
from enumsol.support.deadlines import look

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flint import fmpz_poly

    from enumsol.condensation.exact import ExactCondensed
    from enumsol.selections.solution import SelectionSolution
    from enumsol.support.array_types import Codes


#: What makes a critical point, apart from the numbers of rows: the determinant vanishes; an end of the interval.
_DET, _END = -1, -2


@dataclass(eq=False)
class SelectionEvent:
    """A critical point of a selection.

    Attributes
    ----------
    codes : the selection
    alpha : CriticalAlpha
    holds : bool
        The selection has a solution there.
    singular : bool
        Its determinant vanishes there: its solutions form a polytope, or it has none.
    polytope : (FiberSelections, SelectionSolution) or None
        Its solutions there, where it is singular, with their solver.
    active : per node all codes that hold on its solutions, once asked for
    settled : bool
        Every selection that holds there is known.
    bounded : bool
        A solution there lies at a bound of the rigid displacement of a body that nothing holds.
    vertex : int
        The vertex of the graph it belongs to, once glued; -1 before.
    """

    codes: Codes
    alpha: CriticalAlpha
    holds: bool = False
    singular: bool = False
    polytope: tuple[FiberSelections, SelectionSolution] | None = None
    active: ActiveSets = ()
    settled: bool = True
    bounded: bool = False
    vertex: int = -1


@dataclass
class Cell:
    """An open interval between neighbouring events of a selection.

    Attributes
    ----------
    sample : fmpq
        A point in it.
    holds : bool
        The selection is consistent there.
    det_sign : int
        Sign of its determinant, the index of an arc on which no condition vanishes identically.
    """

    sample: Any
    holds: bool
    det_sign: int


@dataclass
class SelectionArcs:
    """Cells in which one selection holds: events, and the cells between them (one fewer).

    Attributes
    ----------
    codes : tuple of status codes
    functions : SelectionFunctions
    events, cells : lists in the order of alpha
    grazing : bool
        A condition vanishes identically: on its cells other selections hold too.
    bounded : bool
        So does the slack of a bound of the rigid displacement.
    """

    codes: Codes
    functions: SelectionFunctions
    events: list[SelectionEvent] = field(default_factory=list)
    cells: list[Cell] = field(default_factory=list)
    grazing: bool = False
    bounded: bool = False

    @property
    def empty(self) -> bool:
        """True if the selection holds nowhere in the interval."""
        return not any(event.holds for event in self.events)

    def beside(self, event: SelectionEvent) -> bool:
        """True if the selection holds in a cell beside the event."""
        k = self.events.index(event)
        return any(self.cells[j].holds for j in (k - 1, k) if 0 <= j < len(self.cells))

    def event_at(self, alpha: CriticalAlpha) -> tuple[SelectionEvent, bool]:
        """The event at this alpha; where there is none, the cell is cut in two (True)."""
        after, high = 0, len(self.events)
        while after < high:
            middle = (after + high) // 2
            order = self.events[middle].alpha.compare(alpha)
            if order == 0:
                return self.events[middle], False
            after, high = (middle + 1, high) if order < 0 else (after, middle)
        cell = self.cells[after - 1]
        event = SelectionEvent(self.codes, alpha, cell.holds, self.functions.singular, bounded=self.bounded)
        left = rational_between(self.events[after - 1].alpha, alpha)
        right = rational_between(alpha, self.events[after].alpha)
        halves = [replace(cell, sample=left), replace(cell, sample=right)]
        # together: an interruption comes before or after this
        self.events[after:after], self.cells[after - 1 : after] = [event], halves
        return event, True


def selection_arcs(exact: ExactCondensed, codes: Codes, a: fmpq, b: fmpq) -> SelectionArcs | None:
    """Cells and events of a selection in [a, b]; None when its determinant vanishes identically.

    Parameters
    ----------
    exact : ExactCondensed
    codes : status codes
    a, b : fmpq, a <= b
    """
    functions = SelectionFunctions(exact, codes)
    if functions.singular:
        return None
    rows = [functions.row(kind, i) for i, code in enumerate(codes) for kind in _required(code)]
    margins = functions.margins()
    arcs = SelectionArcs(codes, functions, grazing=any(row.is_zero() for row in rows))
    arcs.bounded = any(margin.is_zero() for margin in margins)
    rows = [row for row in rows if not row.is_zero()]
    contact = len(rows)
    rows += [margin for margin in margins if not margin.is_zero()]
    # as on weak springs (theory, section 14.2)
    side = -1 if len(exact.reach) % 2 else 1
    points = _critical_points(functions.det, rows, a, b)
    if points is None:
        return arcs
    groups = merge(points)
    vanishing = [{points[number] for number in group} for group in groups]
    arcs.events = [
        SelectionEvent(codes, group[0], singular=_DET in zero) for group, zero in zip(groups, vanishing, strict=True)
    ]
    signs = []
    for left, right in pairwise(arcs.events):
        at = rational_between(left.alpha, right.alpha)
        det = sign(functions.det(at))
        signs.append([det * sign(row(at)) for row in rows])
        arcs.cells.append(Cell(at, min(signs[-1], default=1) > 0, side * det))
    for k, (event, zero) in enumerate(zip(arcs.events, vanishing, strict=True)):
        if any(cell.holds for cell in arcs.cells[max(k - 1, 0) : k + 1]):
            event.holds = True
        elif event.singular:
            # consistent only where every numerator vanishes too; whether the polytope is empty is decided elsewhere
            event.holds = all(event.alpha.sign_of(poly) == 0 for poly in functions.numerators)
        elif arcs.cells:
            near = signs[max(k - 1, 0)]
            event.holds = all(j in zero or s > 0 for j, s in enumerate(near))
        else:
            det = event.alpha.sign_of(functions.det)
            event.holds = all(det * event.alpha.sign_of(row) >= 0 for row in rows)
        event.bounded = arcs.bounded or any(k >= contact for k in zero)
    return arcs


def _required(code: int) -> tuple[RowKind, ...]:
    """Rows that are not negative in a status: at a sticking node lambda_n too, which its cone does not imply at F = 0.

    A friction coefficient that is positive inside the interval may vanish at one of its ends.
    """
    inequalities = CONDITIONS[code].inequalities
    return (RowKind.NORMAL_FORCE, *inequalities) if code == STICK else inequalities


def _critical_points(det: fmpz_poly, rows: Sequence[Any], a: fmpq, b: fmpq) -> dict[CriticalAlpha, int] | None:
    """Roots of the determinant and of the rows, and both ends of the interval, with what vanishes there.

    That is the number of a row, _DET or, at an end, _END. None when a row is negative on the whole interval: the
    selection then holds nowhere in it.
    """
    points = dict.fromkeys(real_roots(det, a, b), _DET)
    det_sign = 0 if points else sign(det(a))
    for k, row in enumerate(rows):
        roots = real_roots(row, a, b)
        if not roots and det_sign * sign(row(a)) < 0:
            return None
        points |= dict.fromkeys(roots, k)
    return points | dict.fromkeys((CriticalAlpha.rational(end) for end in ((a, b) if a != b else (a,))), _END)


def active_sets(functions: SelectionFunctions, alpha: CriticalAlpha, exact: ExactCondensed) -> ActiveSets:
    """Per node the codes that hold at the selection's solution at ``alpha``, where its determinant does not vanish."""
    det_sign = alpha.sign_of(functions.det)

    @cache
    def row_sign(kind: RowKind, i: int) -> int:
        if kind in CONDITIONS[functions.codes[i]].equations or (row := functions.row(kind, i)).is_zero():
            return 0
        return det_sign * alpha.sign_of(row)

    def holds(code: int, i: int) -> bool:
        return all(row_sign(kind, i) == 0 for kind in CONDITIONS[code].equations) and all(
            row_sign(kind, i) >= 0 for kind in _required(code)
        )

    return tuple(
        frozenset(code for code in FINAL[not exact.frictionless[i]] if code == own or holds(code, i))
        for i, own in enumerate(functions.codes)
    )


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
