"""All solutions of selections at one exact alpha, rational or irrational (theory, sections 2, 6 and 7)."""

from __future__ import annotations

from itertools import combinations
from math import comb
from typing import TYPE_CHECKING, Any

import numpy as np
from flint import fmpq

from enumsol.branches.algebraic import to_fraction
from enumsol.enumeration.exact_selections import ExactSelections, ExactSystem
from enumsol.enumeration.solutions import MAX_BASES, ActiveSets, Codes, SelectionSolution, VertexLimitError
from enumsol.selections import FRICTIONLESS, OPEN, SLIP_MINUS, SLIP_PLUS, STICK

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from enumsol.branches.path import ExactPath
    from enumsol.enumeration.exact_selections import Form, Point


class FiberSelections(ExactSelections):
    """Solver of selections at one alpha in any exact ordered field.

    Unlike its base class it keeps the four statuses where F = 0 at the end of an interval, as the limits of arcs need
    them; nodes with F = 0 throughout are FRICTIONLESS.

    Parameters
    ----------
    path : ExactPath
    alpha : fmpq or NumberFieldElement
    push : direction that replaces g, in the perturbations that give the local degree
    """

    def __init__(self, path: ExactPath, alpha: Any, push: tuple[Any, ...] | None = None) -> None:
        g, F = path.at(alpha)
        super().__init__(ExactSystem(path.S, g if push is None else push, F))
        self.path, self.alpha = path, alpha
        self.F_positive = tuple(not without for without in path.frictionless)

    def _solve_reduced(self, codes: Codes, target: tuple[Any, ...]) -> tuple[Point, int] | None:
        rows, columns = self.reduced(codes)
        if not rows:
            return tuple(self._zero), 1
        table = [[*(_dot(self._S[r], column) for column in columns), target[r]] for r in rows]
        det = row_reduce(table)[0]
        if det == 0:
            return None
        y = [row[-1] for row in table]
        point = tuple(_dot(y, [column[j] for column in columns]) for j in range(2 * self.p))
        return point, 1 if det > 0 else -1

    def solve(self, codes: Codes) -> SelectionSolution | None:
        """All roots in the selection, or None."""
        regular = self._solve_reduced(codes, self.system.g)
        equations, inequalities = self.forms(codes)
        if regular is not None:
            point, det_sign = regular
            values = [_dot(form, point) + constant for form, constant in inequalities]
            if any(v < 0 for v in values):
                return None
            return SelectionSolution(codes, (point,), 0, det_sign, all(v > 0 for v in values))
        vertices = polytope_vertices(equations, inequalities)
        if not vertices:
            return None
        rows = [[a - b for a, b in zip(v, vertices[0], strict=True)] for v in vertices[1:]]
        return SelectionSolution(codes, tuple(vertices), _rank(rows), 0, strict=False)

    def forms(self, codes: Codes) -> tuple[list[Form], list[Form]]:
        """Equations and inequalities (>= 0) of a selection as forms over lambda."""
        equations, inequalities = super().forms(codes)
        # where F = 0 the cone of a sticking node does not imply that its normal force is none of tension
        return equations, inequalities + [self.force_form(i) for i, code in enumerate(codes) if code == STICK]

    def _w(self, point: Point) -> list[Any]:
        return [g - _dot(row, point) for g, row in zip(self.system.g, self._S, strict=True)]

    def active(self, point: Point) -> ActiveSets:
        """Per node the codes whose conditions hold at the point, exactly."""
        p, w = self.p, self._w(point)
        result = []
        for i, F in enumerate(self.system.F):
            n, t, w_t = point[i], point[p + i], w[p + i]
            holds = set()
            if n == 0 and t == 0 and w[i] <= 0:
                holds.add(OPEN)
            if w[i] == 0 and n >= 0:
                bound = F * n
                if self.path.frictionless[i]:
                    holds |= {FRICTIONLESS} if t == 0 else set()
                else:
                    holds |= {STICK} if w_t == 0 and -bound <= t <= bound else set()
                    holds |= {SLIP_PLUS} if t == bound and w_t >= 0 else set()
                    holds |= {SLIP_MINUS} if t == -bound and w_t <= 0 else set()
            result.append(frozenset(holds))
        return tuple(result)

    def meet(self, a: SelectionSolution, b: SelectionSolution) -> bool:
        """Whether both selections' conditions hold at a common point, exactly."""
        first, second = self.forms(a.codes), self.forms(b.codes)
        return bool(polytope_vertices(first[0] + second[0], first[1] + second[1]))

    def departure(self, solution: SelectionSolution, direction: NDArray[np.int64]) -> int | None:
        """See SelectionSolver.departure."""
        if solution.det_sign == 0:
            return 0
        push = tuple(fmpq(int(v)) for v in direction)
        moved = self._solve_reduced(solution.codes, push)
        if moved is None:  # det_sign says otherwise
            raise AssertionError("a regular selection became singular")
        step, det_sign = moved
        rates = FiberSelections(self.path, self.alpha, push).forms(solution.codes)[1]
        point = solution.vertices[0]
        for (form, constant), (rate, push_constant) in zip(self.forms(solution.codes)[1], rates, strict=True):
            if _dot(form, point) + constant == 0:
                change = _dot(rate, step) + push_constant
                if change == 0:
                    return None
                if change < 0:
                    return 0
        return det_sign

    def forces(self, point: Point) -> NDArray[np.float64]:
        """lambda as floats."""
        return np.array([as_float(v) for v in point])

    def displacements(self, point: Point) -> NDArray[np.float64]:
        """w = g - S lambda as floats, rounded once."""
        return np.array([as_float(v) for v in self._w(point)])


def as_float(value: Any) -> float:
    """The nearest float of a field element."""
    return float(to_fraction(value)) if isinstance(value, fmpq) else float(value)


def _dot(a: Any, b: Any) -> Any:
    return sum((x * y for x, y in zip(a, b, strict=True) if x != 0 and y != 0), fmpq(0))


def row_reduce(table: list[list[Any]]) -> tuple[Any, list[int]]:
    """Reduce a table to row echelon form in place; its determinant (a last column left out) and pivots."""
    det: Any = fmpq(1)
    pivots: list[int] = []
    columns = len(table[0]) if table else 0
    for column in range(columns):
        rank = len(pivots)
        pivot = next((r for r in range(rank, len(table)) if table[r][column] != 0), None)
        if pivot is None:
            continue
        if pivot != rank:
            table[rank], table[pivot] = table[pivot], table[rank]
            det = -det
        head = table[rank][column]
        det = det * head
        table[rank] = [v / head for v in table[rank]]
        for r, row in enumerate(table):
            if r != rank and row[column] != 0:
                factor = row[column]
                table[r] = [v - factor * u for v, u in zip(row, table[rank], strict=True)]
        pivots.append(column)
    full = pivots == list(range(len(table)))
    return (det if full else fmpq(0)), pivots


def _rank(rows: list[list[Any]]) -> int:
    return len(row_reduce([list(row) for row in rows])[1]) if rows else 0


def polytope_vertices(equations: list[Form], inequalities: list[Form]) -> list[Point]:
    """Vertices of a bounded polyhedron {equations = 0, inequalities >= 0}; empty when it is.

    Raises
    ------
    VertexLimitError
        More than MAX_BASES bases would have to be tried.
    """
    table = [[*form, -constant] for form, constant in equations]
    size = len(equations[0][0])
    pivots = row_reduce(table)[1]
    if size in pivots:
        return []
    origin: list[Any] = [fmpq(0)] * size
    for row, pivot in zip(table, pivots, strict=False):
        origin[pivot] = row[size]
    kernel = []
    for free in (j for j in range(size) if j not in pivots):
        vector: list[Any] = [fmpq(0)] * size
        vector[free] = fmpq(1)
        for row, pivot in zip(table, pivots, strict=False):
            vector[pivot] = -row[free]
        kernel.append(vector)
    rows = _distinct([([_dot(form, k) for k in kernel], _dot(form, origin) + c) for form, c in inequalities])
    if any(value < 0 for row, value in rows if not any(row)):
        return []
    rows = [(row, value) for row, value in rows if any(row)]
    if not kernel:
        return [tuple(origin)]
    return _corner_points(origin, kernel, rows)


def _distinct(rows: list[tuple[list[Any], Any]]) -> list[tuple[list[Any], Any]]:
    """Rows without repetition; every row is divided by the size of its first entry that is not zero."""
    found: list[tuple[list[Any], Any]] = []
    for row, value in rows:
        head = next((v for v in row if v != 0), None)
        if head is None:
            scaled = (row, value)
        else:
            size = head if head > 0 else -head
            scaled = ([v / size for v in row], value / size)
        if scaled not in found:
            found.append(scaled)
    return found


def _corner_points(origin: list[Any], kernel: list[list[Any]], rows: list[tuple[list[Any], Any]]) -> list[Point]:
    size = len(kernel)
    if comb(len(rows), size) > MAX_BASES:
        raise VertexLimitError(
            f"a family of roots has {comb(len(rows), size)} candidate vertices; at most {MAX_BASES} are enumerated"
        )
    found: list[Point] = []
    for basis in combinations(rows, size):
        table = [[*row, -value] for row, value in basis]
        if row_reduce(table)[0] == 0:
            continue
        t = [row[-1] for row in table]
        if all(_dot(row, t) + value >= 0 for row, value in rows):
            point = tuple(o + _dot(t, [k[j] for k in kernel]) for j, o in enumerate(origin))
            if point not in found:
                found.append(point)
    return found
