"""The equation H = 0 condensed to the contact nodes and without units, on which the continuation works.

The first block of H is linear in u and is eliminated once and for all: w = g(alpha) - S lambda (theory, section 8.1).
What is left has 2p + 1 unknowns x = (lambda, alpha), scaled so that

- the energy of the load is one: forces are measured by G / s_i and displacements by G s_i, where s_i^2 is the geometric
  mean of the node's normal and tangential compliance and G^2 the largest g' S^-1 g on the interval,
- alpha is measured by ``alpha_scale``.

Lengths are those of the metric W = diag(S, 1) in these variables: the arclength ds of a path satisfies

    ds^2 = d lambda' S d lambda / G^2 + (d alpha / alpha_scale)^2.

On a friction path its first part is the elastic energy of the change of displacement. Signs of determinants of the full
Jacobian of H bordered by a tangent are those of the condensed one, because A is positive definite.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from enumsol.continuation.equation import pieces
from enumsol.model.statuses import (
    CONDITIONS,
    FRICTIONLESS,
    OPEN,
    SIGNS,
    SLIP_MINUS,
    SLIP_PLUS,
    STICK,
    RowKind,
    active_within,
    contact_status,
)
from enumsol.trusted.selection import row_values

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from enumsol.continuation.parameter_path import ParameterPath, PathValues
    from enumsol.model.problem import ContactProblem
    from enumsol.model.statuses import ContactStatus

    Vector = NDArray[np.float64]
    Codes = tuple[int, ...]

#: A condition within this of zero counts as met with equality; forces and displacements are of size one after scaling,
#: points are converged to about 1e-12.
STATUS_TOLERANCE = 1e-9
#: Interval points at which the size of a load that varies is measured.
_LOAD_SAMPLES = 9


#: Rows of the inequalities of every status, -1 where there is one only.
_KINDS = np.array([[*CONDITIONS[code].inequalities, -1][:2] for code in SIGNS])


class CondensedEquation:
    """H, its selections, their conditions and the metric of the path.

    Points x have shape (2p + 1,): scaled lambda_n, lambda_t and alpha. Selections are named by sign rows (p, 3) of
    booleans (True where a test function is positive) or, at solutions, by status codes.

    Parameters
    ----------
    path : ParameterPath
    interval : (float, float)
        Where the load is measured; may be infinite.
    start : float
        An alpha on the path.
    r : float or None
        The r of H [force / length]; None for each node's own stiffness.
    alpha_scale : float
        Change of alpha that counts as one.
    """

    def __init__(
        self,
        path: ParameterPath,
        interval: tuple[float, float] = (-math.inf, math.inf),
        start: float = 0.0,
        r: float | None = None,
        alpha_scale: float = 1.0,
    ) -> None:
        self.path = path
        self.problem: ContactProblem = path.problem
        self.p = p = self.problem.p
        self.alpha_scale = alpha_scale
        condensed = self.problem.condensed
        sigma, self.S = condensed.node_scale, condensed.balanced
        self.frictionless = path.frictionless
        load = self._load_energy(interval, start, sigma)
        self.force, self.length = load / sigma, load * sigma
        # the r of each row in scaled variables
        self.r = np.ones(2 * p) if r is None else r * sigma**2
        self._last: tuple[float, PathValues] | None = None

    def _load_energy(self, interval: tuple[float, float], start: float, sigma: Vector) -> float:
        low, high = interval
        samples = [start]
        if math.isfinite(low) and math.isfinite(high):
            samples += list(np.linspace(low, high, _LOAD_SAMPLES))
        loads = np.array([self.path.at(alpha).g for alpha in samples]) / sigma
        loads = loads[np.all(np.isfinite(loads), axis=1)]
        size = float(np.max(np.abs(loads), initial=0.0))
        if size == 0:
            return 1.0
        # loads of size one: their squares neither overflow nor underflow
        loads = loads / size
        try:
            forces = np.linalg.solve(self.S, loads.T)
        except np.linalg.LinAlgError:  # S is singular within rounding
            forces = np.linalg.lstsq(self.S, loads.T, rcond=None)[0]
        energy = float(np.max(np.einsum("ij,ji->i", loads, forces)))
        return size * math.sqrt(energy) if energy > 0 else size

    # -- values ----------------------------------------------------------------------------------------------------

    @cached_property
    def metric(self) -> Vector:
        """W, shape (2p + 1, 2p + 1)."""
        W = np.zeros((2 * self.p + 1, 2 * self.p + 1))
        W[:-1, :-1] = self.S
        W[-1, -1] = 1.0
        return W

    def dot(self, a: Vector, b: Vector) -> float:
        """Inner product of two vectors in the metric W."""
        return float(a[:-1] @ (self.S @ b[:-1]) + a[-1] * b[-1])

    def norm(self, a: Vector) -> float:
        """Length of a vector."""
        return math.sqrt(max(self.dot(a, a), 0.0))

    def point(self, alpha: float, forces: Vector) -> Vector:
        """The scaled point x of unscaled alpha and lambda (2p,)."""
        return np.concatenate([forces / self.force, [alpha / self.alpha_scale]])

    def alpha(self, x: Vector) -> float:
        """Unscaled alpha."""
        return float(x[-1] * self.alpha_scale)

    def forces(self, x: Vector) -> Vector:
        """Unscaled lambda, shape (2p,)."""
        return np.asarray(x[:-1] * self.force)

    def at(self, x: Vector) -> PathValues:
        """Scaled values of the paths; derivatives are with respect to the scaled alpha."""
        alpha = self.alpha(x)
        if self._last is None or self._last[0] != alpha:
            raw = self.path.at(alpha)
            a = self.alpha_scale
            scaled = type(raw)(raw.g / self.length, raw.F, raw.dg * a / self.length, raw.dF * a)
            self._last = (alpha, scaled)
        return self._last[1]

    def w(self, x: Vector) -> Vector:
        """Scaled (u_n, u_t), shape (2p,)."""
        return np.asarray(self.at(x).g - self.S @ x[:-1])

    def displacements(self, x: Vector) -> Vector:
        """Unscaled (u_n, u_t), shape (2p,)."""
        return self.w(x) * self.length

    # -- H and its selections ----------------------------------------------------------------------------------------

    def test_functions(self, x: Vector) -> Vector:
        """theta1, theta2, theta3 as columns, shape (p, 3): their signs depend on the r of H."""
        return self._test_functions(x, self.r)

    def _test_functions(self, x: Vector, r: Vector) -> Vector:
        p = self.p
        trial = x[:-1] + r * self.w(x)
        bound = self.at(x).F * x[:p]
        return np.column_stack([trial[:p], trial[p:] - bound, trial[p:] + bound])

    def residual(self, x: Vector) -> Vector:
        """H(x) for each node's own r, shape (2p,).

        Solutions do not depend on r, and neither may the decision whether x is one: a tiny r would make any
        displacement small, and a huge one any rounding error large.
        """
        return self._projected(x, np.ones(2 * self.p))

    def merit(self, x: Vector) -> float:
        """Norm of H(x) for the given r, which its Newton directions lower."""
        return float(np.linalg.norm(self._projected(x, self.r)))

    def _projected(self, x: Vector, r: Vector) -> Vector:
        """H(x), piece by piece: no digits of w are lost where r is small, nor of lambda where it is large."""
        p, w = self.p, self.w(x)
        closed, slips, count = pieces(self._test_functions(x, r) > 0)
        bound = self.at(x).F * x[:p]
        tangential = (1 - count) * x[p:-1] - slips * bound - count * r[p:] * w[p:]
        return np.concatenate([np.where(closed, -r[:p] * w[:p], x[:p]), tangential])

    def selection(self, codes: Codes) -> NDArray[np.bool_]:
        """Sign rows of the selection in which the nodes have these statuses, shape (p, 3)."""
        return np.array([SIGNS[code] for code in codes]).reshape(-1, 3) > 0

    def selection_residual(self, rows: NDArray[np.bool_], x: Vector) -> Vector:
        """The named selection function of H, shape (2p,), its rows scaled by positive factors to size one."""
        p = self.p
        closed, slips, count = pieces(rows)
        lengths, forces = self._shares(count)
        w = self.w(x)
        normal = np.where(closed, -w[:p], x[:p])
        bound = self.at(x).F * x[:p]
        return np.concatenate([normal, forces * x[p:-1] - slips * bound - lengths * w[p:]])

    def _shares(self, count: Vector) -> tuple[Vector, Vector]:
        """Factors of w_t and lambda_t in the tangential rows; only the fourth piece, 2 lambda_t + r w_t, needs r."""
        r = self.r[self.p :]
        fourth = count < 0
        scale = np.where(fourth, 2.0 / (1.0 + r), 1.0)
        return np.where(fourth, -r * scale, count), (1 - count) * scale

    def jacobian(self, rows: NDArray[np.bool_], x: Vector) -> Vector:
        """Gradient of the named selection function (see selection_residual), shape (2p, 2p + 1)."""
        p, values = self.p, self.at(x)
        closed, slips, count = pieces(rows)
        lengths, forces = self._shares(count)
        share = np.concatenate([closed.astype(float), lengths])
        J = np.empty((2 * p, 2 * p + 1))
        J[:, :-1] = share[:, None] * self.S
        node = np.arange(p)
        J[node, node] += ~closed
        J[p + node, p + node] += forces
        J[p + node, node] -= slips * values.F
        J[:, -1] = -share * values.dg
        J[p:, -1] -= slips * values.dF * x[:p]
        return J

    # -- statuses and their conditions -------------------------------------------------------------------------------

    def _row_values(self, x: Vector) -> Vector:
        """Values of all rows in the order of RowKind, those of the cone over 1 + F, shape (7, p)."""
        F = self.at(x).F
        rows: Vector = row_values(x[:-1], self.w(x), F)
        rows[[RowKind.CONE_PLUS, RowKind.CONE_MINUS]] /= 1.0 + F
        return rows

    def _of_inequalities(self, codes: Codes, rows: Vector, missing: float) -> Vector:
        kinds = _KINDS[np.array(codes, dtype=np.intp)]
        return np.where(kinds < 0, missing, rows[kinds, np.arange(self.p)[:, None]])

    def slacks(self, codes: Codes, x: Vector) -> Vector:
        """What must be >= 0 for the statuses to hold at a root, shape (p, 2); infinite where there is one condition."""
        return self._of_inequalities(codes, self._row_values(x), np.inf)

    def slack_gradient(self, codes: Codes, x: Vector, which: tuple[int, int]) -> Vector:
        """Gradient of one slack with respect to x, shape (2p + 1,)."""
        (i, k), p, values = which, self.p, self.at(x)
        row, kind = np.zeros(2 * p + 1), CONDITIONS[codes[i]].inequalities[k]
        if kind == RowKind.NORMAL_FORCE:
            row[i] = 1.0
        elif kind in (RowKind.CONE_PLUS, RowKind.CONE_MINUS):
            F, dF = values.F[i], values.dF[i]
            sign = -1.0 if kind == RowKind.CONE_PLUS else 1.0
            row[i], row[p + i], row[-1] = F, sign, dF * x[i]
            row /= 1.0 + F
            row[-1] -= dF / (1.0 + F) ** 2 * (F * x[i] + sign * x[p + i])
        else:
            at, sign = (i, -1.0) if kind == RowKind.PENETRATION else (p + i, 1.0)
            sign = -1.0 if kind == RowKind.SLIP_BACKWARD else sign
            row[:-1], row[-1] = -sign * self.S[at], sign * values.dg[at]
        return row

    def slack_rates(self, codes: Codes, x: Vector, tangent: Vector) -> Vector:
        """Derivatives of the slacks along a tangent, shape (p, 2); zero where there is one condition."""
        p, values, da = self.p, self.at(x), tangent[-1]
        F, dF, cone = values.F, values.dF * da, 1.0 + values.F
        bound, t, dt = F * x[:p], x[p:-1], tangent[p:-1]
        moved, turn = F * tangent[:p] + dF * x[:p], dF / cone
        dw = values.dg * da - self.S @ tangent[:-1]
        plus, minus = (moved - dt - turn * (bound - t)) / cone, (moved + dt - turn * (bound + t)) / cone
        rows = np.concatenate([tangent[:-1], plus, minus, -dw[:p], dw[p:], -dw[p:]]).reshape(-1, p)
        return self._of_inequalities(codes, rows, 0.0)

    def active(self, x: Vector, tolerance: float = STATUS_TOLERANCE) -> tuple[frozenset[int], ...]:
        """Per node the status codes whose equations and conditions hold within the tolerance."""
        return active_within(self._row_values(x), ~self.frictionless, tolerance)

    def codes(self, x: Vector, prefer: Codes | None = None, tolerance: float = STATUS_TOLERANCE) -> Codes:
        """Statuses at a solution by the signs of the test functions; ``prefer`` is kept where it holds too."""
        # statuses of a solution do not depend on r
        theta = self._test_functions(x, np.ones(2 * self.p))
        active = None if prefer is None else self.active(x, tolerance)
        out = []
        for i in range(self.p):
            if active is not None and prefer is not None and prefer[i] in active[i]:
                out.append(prefer[i])
            elif theta[i, 0] <= 0:
                out.append(OPEN)
            elif self.frictionless[i]:
                out.append(FRICTIONLESS)
            elif theta[i, 1] < 0 < theta[i, 2]:
                out.append(STICK)
            else:
                out.append(SLIP_PLUS if theta[i, 1] + theta[i, 2] > 0 else SLIP_MINUS)
        return tuple(out)

    def statuses(self, codes: Sequence[int], slip: Vector) -> tuple[ContactStatus, ...]:
        """Names of the statuses; a frictionless node in contact is named by the sign of its u_t."""
        return tuple(contact_status(code, float(u)) for code, u in zip(codes, slip, strict=True))
