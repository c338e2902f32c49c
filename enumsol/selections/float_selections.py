"""Selections solved in float64 with named, scaled tolerances (arithmetic "fast")."""

from __future__ import annotations

from itertools import combinations, islice
from math import comb
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import cho_solve

from enumsol.model.statuses import CONDITIONS, FRICTIONLESS, SLIP_PLUS, RowKind, active_within
from enumsol.selections.solution import MAX_BASES, RANK_TOLERANCE, ActiveSets, SelectionSolution, VertexLimitError
from enumsol.trusted.selection import Selection, row_values

if TYPE_CHECKING:
    from enumsol.condensation.condensed import ScaledSystem
    from enumsol.support.array_types import Codes, Floats, Indices, Integers

#: Default of arithmetic "fast": a condition within this of zero counts as zero. It is relative to the energy norm of
#: the load: forces are measured by sqrt((S^-1)_ii) and displacements by sqrt(S_ii), the bounds that hold at roots.
SIGN_TOLERANCE = 1e-9


class FloatSelections:
    """Solver of selections in float64 for one scaled system (a SelectionSolver; points are scaled lambda arrays).

    Parameters
    ----------
    system : ScaledSystem
    tolerance : float
        See SIGN_TOLERANCE.
    """

    def __init__(self, system: ScaledSystem, tolerance: float = SIGN_TOLERANCE) -> None:
        self.system = system
        self.tolerance = tolerance
        self.p = p = system.p
        self.F_positive = tuple(bool(f > 0) for f in system.F)
        S, F = system.S, system.F
        inverse = cho_solve((system.cholesky, True), np.eye(2 * p))
        inverse = 0.5 * (inverse + inverse.T)
        self._force_scale = np.sqrt(np.diagonal(inverse))
        self._length_scale = np.sqrt(np.diagonal(S))
        nn, tt, nt = np.diagonal(inverse)[:p], np.diagonal(inverse)[p:], np.diagonal(inverse, p)
        turn = np.array([[1.0], [-1.0]])
        # F = size * f: the square of F may overflow
        size = np.maximum(F, 1.0)
        f, one = F / size, 1.0 / size
        cone = size * np.sqrt(np.maximum(f**2 * nn + one**2 * tt - 2 * f * one * nt * turn, 0.0))
        length = self._length_scale.reshape(2, p)
        self._norms = np.concatenate([self._force_scale.reshape(2, p), cone, length[[0, 1, 1]]])
        snn, stt, snt = np.diagonal(S)[:p], np.diagonal(S)[p:], np.diagonal(S, p)
        # energy norm of the force direction (1, +F) or (1, -F) of a slipping node
        self._slip_scale = size * np.sqrt(np.maximum(one**2 * snn + f**2 * stt + 2 * f * one * snt * turn, 0.0))

    def row_norms(self) -> Floats:
        """Norms by which the rows of relaxations are measured, in the order of their numbers kind * p + node."""
        return self._norms.ravel()

    # -- solving ---------------------------------------------------------------------------------------------------

    def reduced(self, codes: Codes) -> tuple[Indices, Floats]:
        """Rows of S that vanish in the selection, and E with lambda = E y, columns of unit energy norm."""
        selection, size = Selection(codes), self._length_scale.copy()
        size[selection.slip] = self._slip_scale[np.where(selection.slip_signs > 0, 0, 1), selection.slip]
        rows = selection.unknown
        return rows, selection.forces(np.diag(1.0 / size[rows]), self.system.F)

    def matrix(self, codes: Codes) -> tuple[Floats, Floats, Floats]:
        """Scaled matrix and right-hand side of the reduced selection system, and E."""
        rows, E = self.reduced(codes)
        scale = 1.0 / self._length_scale[rows]
        return scale[:, None] * (self.system.S[rows] @ E), scale * self.system.g[rows], E

    def solve(self, codes: Codes) -> SelectionSolution | None:
        """All roots in the selection, or None."""
        M, b, E = self.matrix(codes)
        if len(b) == 0:
            return self._accept(codes, np.zeros(2 * self.p), 1)
        U, sigma, Vt = np.linalg.svd(M)
        rank = int(np.sum(sigma > RANK_TOLERANCE))
        if rank == len(b):
            # the LU solve is backward stable per row; the SVD serves the rank decision only
            y = np.linalg.solve(M, b)
            y += np.linalg.solve(M, b - M @ y)
            sign = int(np.linalg.slogdet(M)[0])
            return self._accept(codes, E @ y, sign)
        y = Vt[:rank].T @ ((U[:, :rank].T @ b) / sigma[:rank])
        if np.max(np.abs(M @ y - b)) > self.tolerance:
            return None
        return self._polytope(codes, E @ y, E @ Vt[rank:].T)

    def _accept(self, codes: Codes, point: Floats, sign: int) -> SelectionSolution | None:
        slack = self.slacks(codes, point, self._w(point))
        least = float(np.min(slack)) if len(slack) else np.inf
        if not least >= -self.tolerance:
            return None
        return SelectionSolution(codes, (point,), 0, sign, least > self.tolerance)

    def _polytope(self, codes: Codes, point: Floats, kernel: Floats) -> SelectionSolution | None:
        d = self.slacks(codes, point, self._w(point))
        C = np.column_stack([self.slacks(codes, column, -self.system.S @ column) for column in kernel.T])
        steps = _vertices(C, d, self.tolerance)
        if not len(steps):
            return None
        points = point + steps @ kernel.T
        spread = np.linalg.svd((points - points[0]) / self._force_scale, compute_uv=False)
        dimension = int(np.sum(spread > 10 * self.tolerance))
        if dimension == 0:
            points = points[:1]
        return SelectionSolution(codes, tuple(points), dimension, 0, strict=False)

    # -- conditions ------------------------------------------------------------------------------------------------

    def _w(self, point: Floats) -> Floats:
        return np.asarray(self.system.g - self.system.S @ point)

    def slacks(self, codes: Codes, point: Floats, w: Floats) -> Floats:
        """Scaled slacks of the selection's inequalities at forces ``point`` and displacements ``w``, in node order."""
        rows, out = row_values(point, w, self.system.F), []
        for i, code in enumerate(codes):
            for kind in CONDITIONS[code].inequalities:
                if kind == RowKind.NORMAL_FORCE and code != FRICTIONLESS:
                    out.append(point[i] * self._slip_scale[code - SLIP_PLUS, i])
                else:
                    out.append(rows[kind, i] / self._norms[kind, i])
        return np.array(out)

    def active(self, point: Floats) -> ActiveSets:
        """Per node the codes whose conditions hold at the point within the tolerance."""
        rows = row_values(point, self._w(point), self.system.F) / np.where(self._norms > 0, self._norms, 1)
        return active_within(rows, self.F_positive, self.tolerance)

    def equal(self, a: Floats, b: Floats) -> bool:
        """True if two points agree within ten tolerances in scaled forces."""
        return bool(np.max(np.abs(a - b) / self._force_scale) <= 10 * self.tolerance)

    def meet(self, a: SelectionSolution, b: SelectionSolution) -> bool:
        """True if two polytopes share a point, within the tolerance: the distance of their hulls, a linear program."""
        from scipy.optimize import linprog  # only families need it

        Va = np.array(a.vertices) / self._force_scale
        Vb = np.array(b.vertices) / self._force_scale
        columns = np.concatenate([Va, -Vb]).T
        ones = np.zeros((2, columns.shape[1]))
        ones[0, : len(Va)] = 1
        ones[1, len(Va) :] = 1
        # smallest distance in the maximum norm between the two hulls
        size = columns.shape[0]
        upper = np.block([[columns, -np.ones((size, 1))], [-columns, -np.ones((size, 1))]])
        equal = np.column_stack([ones, np.zeros(2)])
        cost = np.zeros(columns.shape[1] + 1)
        cost[-1] = 1
        answer = linprog(cost, A_ub=upper, b_ub=np.zeros(2 * size), A_eq=equal, b_eq=np.ones(2))
        return bool(answer.status == 0 and answer.fun <= 10 * self.tolerance)

    def departure(self, solution: SelectionSolution, direction: Integers) -> int | None:
        """See SelectionSolver.departure."""
        if solution.det_sign == 0:
            return 0
        rows, E = self.reduced(solution.codes)
        step = np.zeros(2 * self.p)
        push = direction * self._length_scale
        if len(rows):
            scale = 1.0 / self._length_scale[rows]
            step = E @ np.linalg.solve(scale[:, None] * (self.system.S[rows] @ E), scale * push[rows])
        moved = self.slacks(solution.codes, step, push - self.system.S @ step)
        slack = self.slacks(solution.codes, solution.vertices[0], self._w(solution.vertices[0]))
        rate = moved[slack <= self.tolerance]
        if np.any(np.abs(rate) <= self.tolerance * (1 + np.max(np.abs(moved), initial=0.0))):
            return None
        return solution.det_sign if np.all(rate > 0) else 0

    # -- values ----------------------------------------------------------------------------------------------------

    def forces(self, point: Floats) -> Floats:
        """Unscaled lambda."""
        return point * self.system.force

    def displacements(self, point: Floats) -> Floats:
        """Unscaled w = g - S lambda."""
        return self._w(point) * self.system.length

    def bounds(self, point: Floats) -> None:
        """Floats prove no bounds."""

    def exact_slips(self, point: Floats) -> None:
        """Floats are not exact."""
        del point

    def slip_signs(self, point: Floats) -> tuple[int, ...]:
        """Signs of w_t; zero within the tolerance."""
        w = (self._w(point) / self._length_scale)[self.p :]
        return tuple(int(np.sign(v)) if abs(v) > self.tolerance else 0 for v in w)


def _vertices(C: Floats, d: Floats, tolerance: float) -> Floats:
    """Vertices t of {C t + d >= 0}, shape (k, dim), by trying every basis; the set is known to be bounded."""
    size = C.shape[1]
    norms = np.linalg.norm(C, axis=1)
    flat = norms <= RANK_TOLERANCE * max(float(np.max(norms, initial=0.0)), 1.0)
    if np.any(d[flat] < -tolerance):
        return np.zeros((0, size))
    C, d = C[~flat], d[~flat]
    if comb(len(d), size) > MAX_BASES:
        raise VertexLimitError(
            f"a family of roots has {comb(len(d), size)} candidate vertices; at most {MAX_BASES} are enumerated"
        )
    unit, offset = C / norms[~flat, None], d / norms[~flat]
    found: list[Floats] = []
    bases = combinations(range(len(d)), size)
    while block := list(islice(bases, 4096)):
        index = np.array(block)
        matrices = unit[index]
        usable = np.linalg.svd(matrices, compute_uv=False)[:, -1] > 1e-9
        if not np.any(usable):
            continue
        points = np.linalg.solve(matrices[usable], -offset[index[usable]][:, :, None])[:, :, 0]
        feasible = np.all(points @ C.T + d >= -tolerance, axis=1)
        for point in points[feasible]:
            if all(np.max(np.abs(C @ (point - other))) > 10 * tolerance for other in found):
                found.append(point)
    return np.array(found).reshape(-1, size)
