"""The Tresca problem: contact with given slip bounds, in 2D and 3D (theory, section 11.2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.fixed_points.state import TrescaState, scaled_unknowns
from enumsol.fixed_points.system import ContactSystem, checked_problem
from enumsol.fixed_points.tresca_newton import ACCEPTED, TrescaData, TrescaNotFeasible, TrescaNotSolved
from enumsol.support.arguments import one_of
from enumsol.support.array_arguments import real_array
from enumsol.support.messages import counted

if TYPE_CHECKING:
    from enumsol.fixed_points.system import Problem
    from enumsol.support.array_types import AlphaLike, ArrayLike, Floats


Solver = Literal["newton", "clarabel", "cvxpy"]
SOLVERS = ("newton", "clarabel", "cvxpy")
#: Residual of a solution by an interior-point method that is good enough where Newton's method does not improve it.
_INTERIOR_POINT_ACCEPTED = 1e-7


@dataclass(frozen=True)
class TrescaSolution(TrescaState):
    """The solution of a Tresca problem (see TrescaState for its forces and displacements).

    Attributes
    ----------
    residual : float
        Largest violation of (theory, (11.3)), in forces relative to the load [-].
    solver : str
        What found it: "newton", "clarabel" or "cvxpy".

    Examples
    --------
    >>> import enumsol
    >>> solution = enumsol.solve_tresca(enumsol.gallery.one_node_triangle(), slip_bound=1, alpha=2)
    >>> [str(status) for status in solution.statuses], solution.slip_bound
    (['slip-'], array([1.]))
    """

    residual: float
    solver: str

    def __repr__(self) -> str:
        return (
            f"TrescaSolution at alpha = {float(self.alpha):g} on {counted(len(self.lambda_n), 'contact node')}: "
            f"sum of lambda_n {np.sum(self.lambda_n):.6g}, residual {self.residual:.1e}, by {self.solver}"
        )


def solve_tresca(
    problem: Problem,
    slip_bound: ArrayLike,
    alpha: AlphaLike,
    *,
    slip: ArrayLike | None = None,
    start: Any = None,
    solver: Solver = "newton",
) -> TrescaSolution:
    """The one solution of the contact problem with friction of Tresca's type (theory, sections 11.2 and 14.10).

    ``|tau| <= s`` replaces ``|tau| <= lambda_n``, lambda_t = F(alpha) tau: slip bounds s are given where Coulomb's law
    has the unknown normal force.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
    slip_bound : float or (p,) array_like
        Bounds s >= 0 [force]; the friction coefficients multiply them.
    alpha : float, Fraction or str
        Parameter of friction and load.
    slip : float or (p,) array_like or None
        Slips at which coefficients that depend on the solution are taken [length]; None is 0.
    start : TrescaSolution, Root or other with lambda_n and lambda_t, or None
        Where Newton's method starts.
    solver : {"newton", "clarabel", "cvxpy"}
        Newton's method, with Clarabel where it does not converge; Clarabel on the condensed problem; CVXPY on the
        problem in u, slow and readable (for many solutions by it, see `enumsol.fixed_points.TrescaReference`).

    Returns
    -------
    TrescaSolution

    Raises
    ------
    InvalidArgumentError
        A bound or slip is negative or has the wrong shape; alpha makes a coefficient negative.
    TrescaNotSolved
        No solver came close.
    TrescaNotFeasible
        No forces within these bounds hold a body that nothing else holds (``rigid_modes``).
    NotHeldError
        Some rigid displacement of a body that nothing holds moves no contact node.
    MissingDependencyError
        CVXPY is asked for and not installed.

    Examples
    --------
    >>> import enumsol
    >>> problem = enumsol.gallery.one_node_triangle()  # f = (1.5, -4)
    >>> enumsol.solve_tresca(problem, slip_bound=1, alpha=3)  # slides: |lambda_t| = 3
    TrescaSolution at alpha = 3 on 1 contact node: sum of lambda_n 1, residual ..., by newton
    """
    body = checked_problem(problem)
    one_of(solver, "solver", SOLVERS)
    system = ContactSystem.at(body, alpha)
    bound = system.scaled(node_values(slip_bound, "slip_bound", body.p), system.force, "slip_bound")
    slips = node_values(0.0 if slip is None else slip, "slip", body.p)
    data = TrescaData(system, bound, system.coefficients(system.scaled(slips, system.length, "slip")))
    if solver == "cvxpy":
        return _by_cvxpy(data)
    guess = np.zeros(system.m + system.modes) if start is None else scaled_unknowns(system, start)
    x, residual, used = solve_scaled(data, guess, first="clarabel" if solver == "clarabel" else "newton")
    return TrescaSolution.of(data, x, residual=residual, solver=used)


def node_values(value: ArrayLike, name: str, p: int) -> Floats:
    """Value as p numbers >= 0, one for each contact node.

    Raises
    ------
    InvalidArgumentError
        It has another shape, or a negative entry.
    """
    array = real_array(value, name, error=InvalidArgumentError)
    if array.ndim == 0:
        array = np.full(p, float(array))
    if array.shape != (p,):
        raise InvalidArgumentError(f"{name} has shape {array.shape}; expected (p,) = ({p},) or a single number")
    if np.min(array) < 0:
        raise InvalidArgumentError(
            f"{name} is {np.min(array):g} at index {int(np.argmin(array))}; expected values >= 0"
        )
    return array


def solve_scaled(data: TrescaData, start: Floats, first: str = "newton") -> tuple[Floats, float, str]:
    """The x that solves a Tresca problem, its residual, and what found it.

    Raises
    ------
    TrescaNotSolved
        Neither Newton's method nor Clarabel came close.
    TrescaNotFeasible
        There is none, for a body that nothing holds.
    """
    from enumsol.fixed_points.clarabel_solver import interior_point  # a fallback

    if not (np.any(data.system.g) or np.any(data.system.h)):
        return np.zeros(len(start)), 0.0, first
    found: list[tuple[float, str, Floats]] = []
    if first == "newton":
        x, residual = data.newton(start)
        if residual <= ACCEPTED:
            return x, residual, "newton"
        found.append((residual, "newton", x))
    rough, motion = interior_point(data)
    if (driving := data.unresisted(motion)) is not None:
        raise TrescaNotFeasible(data, driving)
    if rough is not None:
        x, residual = data.newton(rough)
        if residual > ACCEPTED:
            x, residual = data.proximal(x)
        found.append((residual, "clarabel", x))
    residual, used, x = min(found, key=lambda item: item[0], default=(np.inf, "", start))
    if residual > _INTERIOR_POINT_ACCEPTED:
        raise TrescaNotSolved(
            f"the Tresca problem at alpha = {float(data.system.alpha):g} was not solved: the residual relative to the "
            f"load is {residual:.1e}; expected at most {_INTERIOR_POINT_ACCEPTED:g} (are the data badly scaled?)"
        )
    return x, residual, used


def _by_cvxpy(data: TrescaData) -> TrescaSolution:
    from enumsol.fixed_points.clarabel_solver import TrescaReference  # CVXPY takes a while to import

    system = data.system
    reference = TrescaReference(system.problem)
    normal, tangential, u = reference.solve(data.bound * system.force, data.F, system.problem.load_at(system.alpha))
    # springs at ``held`` would carry nothing (theory, section 14.1)
    modes = system.problem.modes
    q = np.linalg.solve(modes.N[modes.held], u[modes.held])
    x = system.joined(normal / system.force, tangential / system.force[:, None], system.scaled_rigid(q))
    return TrescaSolution.of(data, x, residual=data.residual(x), solver="cvxpy")
