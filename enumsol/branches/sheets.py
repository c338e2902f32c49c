"""Selections that are singular for every alpha: families over an interval, sheets (theory, section 7.5)."""

from __future__ import annotations

from itertools import combinations, pairwise
from math import comb
from typing import TYPE_CHECKING, Any

from flint import fmpq, fmpq_mat, fmpq_poly

from enumsol.arithmetic.algebraic import CriticalAlpha, integer_polynomial, merge, rational_between, real_roots
from enumsol.arithmetic.number_field import exact_value
from enumsol.branches.exact.selection_arcs import Cell, SelectionArcs, SelectionEvent
from enumsol.selections.functions import SelectionFunctions
from enumsol.selections.rational_selections import FiberSelections, row_reduce
from enumsol.selections.solution import MAX_BASES, VertexLimitError
from enumsol.support.deadlines import look

if TYPE_CHECKING:
    from enumsol.condensation.exact import ExactCondensed
    from enumsol.selections.solution import Codes

#: Bases whose vertex functions are followed over alpha; a sheet that needs more is refused.
MAX_SHEET_BASES = min(2000, MAX_BASES)


def sheet_arcs(exact: ExactCondensed, codes: Codes, a: Any, b: Any) -> SelectionArcs:
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
    points = [CriticalAlpha.rational(end) for end in ((a, b) if a != b else (a,))]
    for poly in _critical_polynomials(exact, codes):
        points += real_roots(poly, a, b)
    events = [SelectionEvent(codes, group[0], singular=True) for group in merge(points)]
    patterns = []
    for event in events:
        pattern = _pattern(exact, codes, exact_value(event.alpha))
        event.holds = pattern is not None
        patterns.append(pattern)
    cells, between = [], []
    for left, right in pairwise(events):
        at = rational_between(left.alpha, right.alpha)
        between.append(_pattern(exact, codes, at))
        cells.append(Cell(at, between[-1] is not None, 0))
    for k in range(len(events) - 2, 0, -1):
        if patterns[k] == between[k - 1] == between[k]:
            del events[k], patterns[k], cells[k], between[k]
    arcs = SelectionArcs(codes, SelectionFunctions(exact, codes), events, cells, grazing=True)
    for event in arcs.events:
        event.singular = True
    return arcs


def _pattern(exact: ExactCondensed, codes: Codes, alpha: Any) -> Any:
    """What a polytope looks like: the active sets of its vertices; None when it is empty."""
    solver = FiberSelections(exact, alpha)
    solution = solver.solve(codes)
    if solution is None:
        return None
    return frozenset(solver.active(vertex) for vertex in solution.vertices)


def _critical_polynomials(exact: ExactCondensed, codes: Codes) -> list[Any]:
    """Nonzero integer polynomials whose roots include every alpha at which the polytope changes its shape."""
    size = len(exact.rows)

    def rows_at(alpha: Any) -> tuple[list[list[Any]], list[list[Any]]]:
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
            poly = integer_polynomial(fmpq_poly(column))
            if poly.degree() > 0 and poly not in found:
                found.append(poly)
    return found


def _independent_rows(rows: list[list[Any]]) -> list[int]:
    """Numbers of rows that span the others (constants left out)."""
    return row_reduce([list(column) for column in zip(*(row[:-1] for row in rows), strict=True)])[1]


def _bordered(
    equations: list[list[Any]],
    inequalities: list[list[Any]],
    independent: list[int],
    basis: tuple[int, ...],
    size: int,
) -> list[Any]:
    """Determinant of a basis, and of it bordered by every other row: det times the row's value at the basis' point."""
    chosen = [equations[k] for k in independent] + [inequalities[k] for k in basis]
    values = [fmpq_mat([row[:size] for row in chosen]).det()]
    others = [row for k, row in enumerate(equations) if k not in independent]
    others += [row for k, row in enumerate(inequalities) if k not in basis]
    return values + [fmpq_mat([*chosen, row]).det() for row in others]
