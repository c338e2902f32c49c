"""Tresca problems by Clarabel (theory, section 11.2).

On the condensed problem: a QP in 2D, second-order cones in 3D; and in the displacements, written down in CVXPY: the
readable reference.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from enumsol.errors import MissingDependencyError
from enumsol.fixed_points.system import checked_problem
from enumsol.fixed_points.tresca_newton import TrescaData, TrescaNotSolved
from enumsol.support.conic import conic_answer

if TYPE_CHECKING:
    from enumsol.fixed_points.system import Problem
    from enumsol.support.array_types import Floats


def interior_point(data: TrescaData) -> tuple[Floats | None, Floats]:
    """The x that solves a Tresca problem to about 1e-9, from scratch, None if Clarabel fails; and a rigid displacement.

    If no forces balance the load on a body that nothing holds, they do not along the latter, scaled and of shape (r,).
    Components of lambda_t that do not occur are left out, so that every cone has an interior.
    """
    import clarabel  # takes a while to import

    system, occurs = data.system, data.occurs
    p = system.p
    bound = np.minimum(data.bound, _reach(data))
    node_one = np.flatnonzero(np.sum(occurs, axis=1) == 1)
    node_two = np.flatnonzero(np.sum(occurs, axis=1) == 2)
    free = np.concatenate([np.ones(p, dtype=bool), occurs.T.ravel()])
    column = np.cumsum(free) - 1
    axis = np.argmax(occurs[node_one], axis=1)
    F = data.F[node_one, axis]
    # 0 <= lambda_n;  |lambda_t| <= s F for one axis;  (s, lambda_t / F), scaled, in the second-order cone for two
    least = np.min(data.F[node_two], axis=1)
    parts = [(np.arange(p), np.arange(p), -np.ones(p))]
    first = p
    interval = column[(1 + axis) * p + node_one]
    for sign in (1.0, -1.0):
        parts.append((first + np.arange(len(node_one)), interval, np.full(len(node_one), sign)))
        first += len(node_one)
    for k in range(2 if len(node_two) else 0):
        rows = first + 3 * np.arange(len(node_two)) + 1 + k
        parts.append((rows, column[(1 + k) * p + node_two], -least / data.F[node_two, k]))
    size = first + 3 * len(node_two)
    offset = np.zeros(size)
    offset[p:first] = np.tile(bound[node_one] * F, 2)
    offset[first::3] = bound[node_two] * least
    rows, columns, values = (np.concatenate(part) for part in zip(*parts, strict=True))
    limits = sp.csc_matrix((values, (rows, columns)), shape=(size, int(np.sum(free))))
    tolerances = ("tol_gap_abs", "tol_gap_rel", "tol_feas", "tol_infeas_abs", "tol_infeas_rel")
    answer = conic_answer(
        (sp.csc_matrix(np.triu(system.S[np.ix_(free, free)])), -system.g[free]),
        (sp.csc_matrix(sp.vstack([system.G[:, free], limits])), np.append(system.h, offset)),
        [
            clarabel.ZeroConeT(system.modes),
            clarabel.NonnegativeConeT(first),
            *[clarabel.SecondOrderConeT(3)] * len(node_two),
        ],
        system.S.size,
        direct_solve_method="faer",  # the Hessian is dense, for which the default is several times slower
        **dict.fromkeys(tolerances, 1e-11),
    )
    found, rigid = np.array(answer.x), -np.array(answer.z)[: system.modes]
    if not (np.all(np.isfinite(found)) and np.all(np.isfinite(rigid))):
        return None, np.zeros(system.modes)
    forces = np.zeros(system.m)
    forces[free] = found
    return np.append(forces, rigid), rigid


def _reach(data: TrescaData) -> Floats:
    """Sizes that |tau| cannot exceed, by `largest_forces`, shape (p,): larger bounds are none.

    With them the solver meets no numbers that are large for no reason.
    """
    most = data.system.split(data.system.largest_forces)[1]
    with np.errstate(over="ignore"):
        tau = np.divide(most, data.F, out=np.zeros_like(most), where=data.occurs)
        return np.asarray(2.0 * np.sum(tau, axis=1))


class TrescaReference:
    """Minimise u' A u / 2 - f' u + sum_i s_i ``|F_i u_t,i|`` subject to Bn u <= gap.

    Slip bounds, coefficients and load are parameters, so that CVXPY canonicalizes the problem only once
    for many solutions. The multipliers of the constraints are the contact forces.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D

    Attributes
    ----------
    program : cvxpy.Problem

    Raises
    ------
    MissingDependencyError
        CVXPY is not installed.
    """

    def __init__(self, problem: Problem) -> None:
        problem = checked_problem(problem)
        try:
            import cvxpy
        except ImportError as error:
            raise MissingDependencyError(
                "solver is 'cvxpy', but CVXPY is not installed; install it with: pip install 'enumsol[cvxpy]'"
            ) from error

        cp: Any = cvxpy  # its names are gathered at run time, and a type checker does not see them
        offsets = problem.slip_offset.reshape(problem.p, -1)
        d = offsets.shape[1]
        tangents = [problem.contact_rows[(1 + k) * problem.p : (2 + k) * problem.p] for k in range(d)]
        self._u = cp.Variable(problem.n)
        slips = cp.Variable((problem.p, d))
        self._work = cp.Parameter((problem.p, d), nonneg=True)
        self._load = cp.Parameter(problem.n)
        self._normal = problem.Bn @ self._u <= problem.gap
        self._tangential = [tangents[k] @ self._u - offsets[:, k] == slips[:, k] for k in range(d)]
        friction = cp.sum(cp.norm(cp.multiply(self._work, slips), axis=1))
        energy = 0.5 * cp.quad_form(self._u, cp.psd_wrap(sp.csc_matrix(problem.A)))
        self.program: Any = cp.Problem(
            cp.Minimize(energy - self._load @ self._u + friction), [self._normal, *self._tangential]
        )

    def solve(self, bound: Floats, F: Floats, load: Floats) -> tuple[Floats, Floats, Floats]:
        """Contact forces and displacement for slip bounds and coefficients of friction.

        Parameters
        ----------
        bound : (p,) array
            Slip bounds s >= 0 [force].
        F : (p, d) array
            Friction coefficients in the d = 1 or 2 tangents [-].
        load : (n,) array
            f [force].

        Returns
        -------
        lambda_n : (p,) array [force]
        lambda_t : (p, d) array [force]
        u : (n,) array [length]

        Raises
        ------
        TrescaNotSolved
            There is no solution: no forces within the bounds hold a body that nothing else holds.
        """
        self._work.value, self._load.value = bound[:, None] * F, load
        settings: dict[str, Any] = {"tol_gap_abs": 1e-11, "tol_gap_rel": 1e-11, "tol_feas": 1e-11}
        self.program.solve(solver="CLARABEL", **settings)
        if self._u.value is None:
            raise TrescaNotSolved(f"CVXPY found no solution of the Tresca problem (status: {self.program.status})")
        tangential = np.stack([constraint.dual_value for constraint in self._tangential], axis=1)
        return np.asarray(self._normal.dual_value), tangential, np.asarray(self._u.value)
