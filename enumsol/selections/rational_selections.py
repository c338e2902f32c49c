"""Selections solved in rational arithmetic: the given data read as exact rationals (theory, section 6.5).

Of singular selections the vertices of polytopes of roots, in any exact ordered field (theory, section 2.4).
"""

from __future__ import annotations

import math
from copy import copy
from fractions import Fraction
from functools import cached_property
from itertools import combinations
from typing import TYPE_CHECKING, Any, SupportsFloat

import numpy as np
from flint import fmpq, fmpq_mat

from enumsol.arithmetic.rationals import as_objects, rational, to_fraction
from enumsol.condensation.exact import ExactCondensed, ExactSystem, UncondensedSystem
from enumsol.model.statuses import CONDITIONS, FINAL, FRICTIONLESS, OPEN, SLIP_MINUS, SLIP_PLUS, STICK, RowKind
from enumsol.selections.solution import MAX_BASES, ActiveSets, SelectionSolution, VertexLimitError
from enumsol.support.deadlines import look
from enumsol.trusted.selection import Selection, row_values

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from enumsol.model.statuses import Conditions
    from enumsol.support.array_types import Codes, Floats, Integers, NDArray

    Table = list[list[Any]]
    #: Rows of the reduced row echelon form that are not zero, and their pivot columns.
    Reduction = Callable[[Table], tuple[Table, list[int]]]

Point = tuple[Any, ...]
#: A linear form over lambda and its constant: value = form . lambda + constant.
Form = tuple[list[Any], Any]


def _outward(number: fmpq) -> tuple[float, float]:
    """The floats next below and above a rational; the same one twice if it is a float."""
    ratio = int(number.p), int(number.q)  # in lowest terms, as those of a float
    near = ratio[0] / ratio[1]
    if near.as_integer_ratio() == ratio:
        return near, near
    return math.nextafter(near, -math.inf), math.nextafter(near, math.inf)


def _holds(conditions: Conditions, rows: Sequence[Any]) -> bool:
    return all(rows[k] == 0 for k in conditions.equations) and all(rows[k] >= 0 for k in conditions.inequalities)


def _homogeneous(forms: Sequence[Form]) -> list[Form]:
    """Forms with what is added as the coefficient of one variable more."""
    return [([*form, constant], fmpq(0)) for form, constant in forms]


class ExactSelections:
    """Solver of selections in rationals (a SelectionSolver; points are tuples of 2p fmpq).

    Of a body that nothing holds points have 2p + r of them: the last ones are -q (theory, section 14.2).

    Parameters
    ----------
    system : ExactSystem or UncondensedSystem
    """

    def __init__(self, system: ExactSystem | UncondensedSystem) -> None:
        self.system = system
        self.p = p = system.p
        self.F_positive = tuple(bool(f > 0) for f in system.F)
        self._F = as_objects(system.F)
        #: Rigid modes of a body that nothing holds: as many numbers of a point follow its contact forces.
        self.modes = len(system.reach)
        self._zero = [fmpq(0)] * (2 * p + self.modes)

    @cached_property
    def _S(self) -> NDArray[Any]:  # noqa: N802 (the field's letter)
        return as_objects(self.system.S.tolist())

    # -- linear forms ----------------------------------------------------------------------------------------------

    def form(self, kind: RowKind, node: int) -> Form:
        """A row as an affine function of lambda: 2p coefficients, and what is added."""
        p, form = self.p, list(self._zero)
        if kind >= RowKind.PENETRATION:
            row, sign = (node, -1) if kind == RowKind.PENETRATION else (p + node, 1)
            sign = -sign if kind == RowKind.SLIP_BACKWARD else sign
            return (-sign * self._S[row]).tolist(), sign * self.system.g[row]
        if kind != RowKind.TANGENTIAL_FORCE:
            form[node] = fmpq(1) if kind == RowKind.NORMAL_FORCE else self.system.F[node]
        if kind != RowKind.NORMAL_FORCE:
            form[p + node] = fmpq(-1 if kind == RowKind.CONE_PLUS else 1)
        return form, fmpq(0)

    def forms(self, codes: Codes) -> tuple[list[Form], list[Form]]:
        """Equations and inequalities (>= 0) of a selection as forms over lambda."""
        equations, inequalities = (
            [self.form(kind, i) for i, code in enumerate(codes) for kind in CONDITIONS[code][part]] for part in (0, 1)
        )
        for place, reach in enumerate(self.system.reach, start=2 * self.p):
            equations.append(((-self._S[place]).tolist(), self.system.g[place]))
            for side in (-1, 1):
                bound = list(self._zero)
                bound[place] = fmpq(side)
                inequalities.append((bound, reach))
        return equations, inequalities

    # -- the field -------------------------------------------------------------------------------------------------

    @staticmethod
    def row_reduced(table: Table) -> tuple[Table, list[int]]:
        """Rows of the reduced row echelon form that are not zero, and their pivot columns."""
        reduced, rank = fmpq_mat(table).rref()
        rows = reduced.tolist()[:rank]
        return rows, [next(j for j, v in enumerate(row) if v != 0) for row in rows]

    # -- solving ---------------------------------------------------------------------------------------------------

    def solve_equations(self, codes: Codes, target: tuple[Any, ...] | None = None) -> tuple[Point, int] | None:
        """The selection's forces and sign det, or None when it is singular; ``target`` takes the place of g."""
        selection = Selection(codes, self.modes)
        if target is None and isinstance(self.system, UncondensedSystem):
            return self._solved_apart(self.system, selection)
        if not len(selection.unknown):
            return tuple(self._zero), 1
        right = self.system.g if target is None else target
        solved = self._solved(selection.matrix(self._S, self._F), [right[r] for r in selection.unknown])
        if solved is None:
            return None
        y, sign = solved
        # the columns of -q change the sign
        return tuple(selection.forces(as_objects(y), self._F, fmpq(0))), -sign if self.modes % 2 else sign

    def _solved_apart(self, system: UncondensedSystem, selection: Selection) -> tuple[Point, int] | None:
        """Solution of a selection from the matrices of the problem, for its own load."""
        index = system.index(selection.codes)
        solved = system.solved(lambda K: selection.columns(K, self._F), selection.unknown, index)
        if solved is None:
            return None
        y, u, sign = solved
        point = tuple(selection.forces(as_objects(y), self._F, fmpq(0)))
        system.keep(point, u)
        return point, sign

    @staticmethod
    def _solved(M: NDArray[Any], b: Sequence[Any]) -> tuple[Sequence[Any], int] | None:
        """y with M y = b, and sign det M; None where it is zero."""
        matrix = fmpq_mat(M.tolist())
        det = matrix.det()
        if det == 0:
            return None
        return matrix.solve(fmpq_mat([[v] for v in b])).entries(), 1 if det > 0 else -1

    def solve(self, codes: Codes) -> SelectionSolution | None:
        """All roots in the selection, or None."""
        regular = self.solve_equations(codes)
        if regular is not None:
            point, sign = regular
            values = self._slacks(codes, point)
            if any(v < 0 for v in values):
                return None
            return SelectionSolution(codes, (point,), 0, sign, all(v > 0 for v in values), exact=True)
        vertices = polytope_vertices(*self.forms(codes), self.row_reduced)
        if not vertices:
            return None
        differences = [[a - b for a, b in zip(v, vertices[0], strict=True)] for v in vertices[1:]]
        dimension = len(self.row_reduced(differences)[1]) if differences else 0
        return SelectionSolution(codes, tuple(vertices), dimension, 0, strict=False, exact=True)

    def _slacks(self, codes: Codes, point: Point) -> list[Any]:
        """Values of the inequalities of ``forms`` at a point."""
        rows = self._rows(point)
        values = [rows[kind][i] for i, code in enumerate(codes) for kind in CONDITIONS[code].inequalities]
        pairs = zip(point[2 * self.p :], self.system.reach, strict=True)
        return values + [most + side * x for x, most in pairs for side in (-1, 1)]

    def _rows(self, point: Point) -> NDArray[Any]:
        """Values of the seven rows of every node, (7, p)."""
        rows: NDArray[Any] = row_values(as_objects(point), as_objects(self.moved(point)), self._F)
        return rows

    def rests_on_reach(self, codes: Codes, found: SelectionSolution | None) -> bool:
        """True if a selection, in which this was found, holds other points without the bounds (theory, section 14.4).

        True as well if more than MAX_BASES bases would have to be tried to find out.
        """
        if not self.modes:
            return False
        if found is not None:
            # of a convex set that lies within the bounds, nothing lies beyond them
            reach, places = self.system.reach, range(2 * self.p, 2 * self.p + self.modes)
            pairs = [(v[i], most) for v in found.vertices for i, most in zip(places, reach, strict=True)]
            return any(x in (most, -most) for x, most in pairs)
        equations, inequalities = self.forms(codes)
        own, bounds = inequalities[: -2 * self.modes], inequalities[-2 * self.modes :]
        # (s x, s) with a solution x anywhere and some 0 < s <= 1 such that s x is within the bounds
        size, none = len(self._zero), fmpq(0)
        shares = [([*self._zero, fmpq(1)], none), ([*self._zero, fmpq(-1)], fmpq(1))]
        rows = [*_homogeneous(own), *(([*form, none], most) for form, most in bounds), *shares]
        try:
            points = polytope_vertices(_homogeneous(equations), rows, self.row_reduced)
        except VertexLimitError:
            return True
        return any(point[size] > 0 for point in points)

    # -- decisions -------------------------------------------------------------------------------------------------

    def moved(self, point: Point) -> list[Any]:
        """w = g - S lambda."""
        return self.system.moved(point)

    def active(self, point: Point) -> ActiveSets:
        """Per node the codes whose conditions hold at the point, exactly."""
        return tuple(
            frozenset(code for code in FINAL[friction] if rows[0] >= 0 and _holds(CONDITIONS[code], rows))
            for rows, friction in zip(self._rows(point).T, self.F_positive, strict=True)
        )

    def statuses_by_test_functions(self, point: Point, r: Floats) -> tuple[int, ...]:
        """Per node the code that the signs of theory, (1.7), name at any point; ``r`` holds powers of two."""
        p, w = self.p, self.moved(point)
        codes = []
        for i, (F, friction) in enumerate(zip(self.system.F, self.F_positive, strict=True)):
            unit = rational(float(r[i]))
            bound, across = F * point[i], point[p + i] + unit * w[p + i]
            if point[i] + unit * w[i] <= 0:
                codes.append(OPEN)
            elif not friction:
                codes.append(FRICTIONLESS)
            else:
                codes.append(SLIP_PLUS if across > bound else SLIP_MINUS if across < -bound else STICK)
        return tuple(codes)

    def equal(self, a: Point, b: Point) -> bool:
        """Exact equality."""
        return a == b

    def meet(self, a: SelectionSolution, b: SelectionSolution) -> bool:
        """True if both selections' conditions hold at a common point, exactly."""
        first, second = self.forms(a.codes), self.forms(b.codes)
        return bool(polytope_vertices(first[0] + second[0], first[1] + second[1], self.row_reduced))

    def departure(self, solution: SelectionSolution, direction: Integers) -> int | None:
        """See SelectionSolver.departure."""
        if solution.det_sign == 0:
            return 0
        push = tuple(fmpq(int(v)) for v in direction)
        pushed = copy(self)
        pushed.system = self.system.along(push)
        moved = self.solve_equations(solution.codes, pushed.system.g)
        if moved is None:  # det_sign says otherwise
            raise AssertionError("a regular selection became singular")
        step, sign = moved
        _, inequalities = self.forms(solution.codes)
        _, rates = pushed.forms(solution.codes)
        point = solution.vertices[0]
        for condition, rate in zip(inequalities, rates, strict=True):
            if value(condition, point) == 0:
                change = value(rate, step)
                if change == 0:
                    return None
                if change < 0:
                    return 0
        return sign

    # -- values ----------------------------------------------------------------------------------------------------

    def forces(self, point: Point) -> Floats:
        """lambda as floats."""
        return np.array([as_float(v) for v in point[: 2 * self.p]])

    def rigid(self, point: Point) -> Floats:
        """Coordinates q of the rigid displacement as floats, shape (r,)."""
        return np.array([-as_float(v) for v in point[2 * self.p :]])

    def displacements(self, point: Point) -> Floats:
        """w = g - S lambda as floats, rounded once."""
        return np.array([as_float(v) for v in self.moved(point)[: 2 * self.p]])

    def slip_signs(self, point: Point) -> tuple[int, ...]:
        """Signs of w_t, exactly."""
        return tuple((v > 0) - (v < 0) for v in self.moved(point)[self.p : 2 * self.p])

    def exact_slips(self, point: Point) -> tuple[Fraction, ...]:
        """w_t, exactly."""
        return tuple(map(to_fraction, self.moved(point)[self.p : 2 * self.p]))

    def bounds(self, point: Point) -> tuple[Floats, Floats]:
        """Floats below and above (lambda, w, q), two arrays of shape (4p + r,), equal where a value is a float."""
        forces = 2 * self.p
        rigid = [-v for v in point[forces:]]
        pairs = [_outward(v) for v in (*point[:forces], *self.moved(point)[:forces], *rigid)]
        return np.array([low for low, _ in pairs]), np.array([high for _, high in pairs])


class FiberSelections(ExactSelections):
    """Solver of selections at one alpha in any exact ordered field.

    Unlike its base class it keeps the four statuses where F = 0 at the end of an interval, as the limits of arcs need
    them; nodes with F = 0 throughout are FRICTIONLESS.

    Parameters
    ----------
    exact : ExactCondensed
    alpha : fmpq or NumberFieldElement
    """

    def __init__(self, exact: ExactCondensed, alpha: object) -> None:
        super().__init__(exact.system(alpha))
        self.F_positive = tuple(not without for without in exact.frictionless)

    @staticmethod
    def _solved(M: NDArray[Any], b: Sequence[Any]) -> tuple[Sequence[Any], int] | None:
        """y with M y = b, and sign det M; None where it is zero."""
        table = [[*row, value] for row, value in zip(M.tolist(), b, strict=True)]
        det = row_reduce(table)[0]
        return None if det == 0 else ([row[-1] for row in table], 1 if det > 0 else -1)

    def forms(self, codes: Codes) -> tuple[list[Form], list[Form]]:
        """Equations and inequalities (>= 0) of a selection as forms over lambda."""
        equations, inequalities = super().forms(codes)
        # where F = 0 the cone of a sticking node does not imply lambda_n >= 0
        return equations, inequalities + [
            self.form(RowKind.NORMAL_FORCE, i) for i, code in enumerate(codes) if code == STICK
        ]

    def _slacks(self, codes: Codes, point: Point) -> list[Any]:
        """Values of the inequalities of ``forms`` at a point."""
        return super()._slacks(codes, point) + [point[i] for i, code in enumerate(codes) if code == STICK]

    def moved(self, point: Point) -> list[Any]:
        """w = g - S lambda."""
        return [g - dot(row, point) for g, row in zip(self.system.g, self._S, strict=True)]

    # -- the field -------------------------------------------------------------------------------------------------

    @staticmethod
    def row_reduced(table: Table) -> tuple[Table, list[int]]:
        """Rows of the reduced row echelon form that are not zero, and their pivot columns."""
        pivots = row_reduce(table)[1]
        return table[: len(pivots)], pivots


def as_float(value: fmpq | SupportsFloat) -> float:
    """The nearest float of a field element."""
    return int(value.p) / int(value.q) if isinstance(value, fmpq) else float(value)


def row_reduce(table: list[list[Any]]) -> tuple[Any, list[int]]:
    """Reduce a table to row echelon form in place; its determinant (a last column left out) and pivots."""
    det: Any = fmpq(1)
    pivots: list[int] = []
    columns = len(table[0]) if table else 0
    for column in range(columns):
        look()
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


def dot(a: Sequence[Any], b: Sequence[Any]) -> Any:
    """Inner product; factors that are zero cost nothing."""
    return sum((x * y for x, y in zip(a, b, strict=True) if x != 0 and y != 0), fmpq(0))


def value(form: Form, point: Sequence[Any]) -> Any:
    """A form at a point."""
    return dot(form[0], point) + form[1]


def polytope_vertices(equations: list[Form], inequalities: list[Form], reduce: Reduction) -> list[Point]:
    """Vertices of a bounded polyhedron {equations = 0, inequalities >= 0}; empty when it is.

    Raises
    ------
    VertexLimitError
        More than MAX_BASES bases would have to be tried.
    """
    solved = _affine_solutions(equations, reduce)
    if solved is None:
        return []
    origin, kernel = solved
    rows = _distinct([([dot(form, k) for k in kernel], dot(form, origin) + c) for form, c in inequalities])
    if any(constant < 0 for row, constant in rows if not any(row)):
        return []
    if not kernel:
        return [origin]
    return _corners(origin, kernel, [(row, constant) for row, constant in rows if any(row)], reduce)


def _affine_solutions(equations: list[Form], reduce: Reduction) -> tuple[Point, list[Point]] | None:
    """Solution of the equations and a kernel basis, or None when they contradict each other."""
    size = len(equations[0][0])
    table, pivots = reduce([[*form, -constant] for form, constant in equations])
    if size in pivots:
        return None
    origin = [fmpq(0)] * size
    for row, pivot in zip(table, pivots, strict=True):
        origin[pivot] = row[size]
    kernel = []
    for free in (j for j in range(size) if j not in pivots):
        vector = [fmpq(0)] * size
        vector[free] = fmpq(1)
        for row, pivot in zip(table, pivots, strict=True):
            vector[pivot] = -row[free]
        kernel.append(tuple(vector))
    return tuple(origin), kernel


def _distinct(rows: list[Form]) -> list[Form]:
    """Rows without repetition; every row is divided by the size of its first entry that is not zero."""
    found: list[Form] = []
    for row, constant in rows:
        head = next((v for v in row if v != 0), None)
        if head is None:
            scaled = (row, constant)
        else:
            size = head if head > 0 else -head
            scaled = ([v / size for v in row], constant / size)
        if scaled not in found:
            found.append(scaled)
    return found


def _corners(origin: Point, kernel: list[Point], rows: list[Form], reduce: Reduction) -> list[Point]:
    """Points origin + sum of t_k kernel_k at which as many rows vanish as there are t, and none is negative."""
    size = len(kernel)
    if math.comb(len(rows), size) > MAX_BASES:
        raise VertexLimitError(
            f"a family of roots has {math.comb(len(rows), size)} candidate vertices; at most {MAX_BASES} are enumerated"
        )
    found: list[Point] = []
    for basis in combinations(rows, size):
        look()
        table, pivots = reduce([[*row, -constant] for row, constant in basis])
        if pivots != list(range(size)):
            continue
        t = [row[-1] for row in table]
        if all(value(row, t) >= 0 for row in rows):
            point = tuple(o + dot(t, [k[j] for k in kernel]) for j, o in enumerate(origin))
            if point not in found:  # elements of number fields have no hash
                found.append(point)
    return found
