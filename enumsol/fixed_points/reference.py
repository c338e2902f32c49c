"""Tresca problems in the displacements, written down in CVXPY: the readable reference (theory, section 11.2)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from enumsol.errors import MissingDependencyError
from enumsol.fixed_points.system import checked_problem
from enumsol.fixed_points.tresca_newton import TrescaNotSolved

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from enumsol.fixed_points.system import Problem

    Vector = NDArray[np.float64]


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

    def solve(self, bound: Vector, F: NDArray[np.float64], load: Vector) -> tuple[Vector, NDArray[np.float64], Vector]:
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
