"""Tresca problems, contact with given slip bounds in 2D and 3D, and what they end with (theory, section 11.2)."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal, Self, get_args

import numpy as np

from enumsol.condensation.condensed import condensation_of
from enumsol.errors import InvalidArgumentError
from enumsol.fixed_points.system import ContactSystem, checked_problem
from enumsol.fixed_points.tresca_solvers import (
    ACCEPTED,
    TrescaData,
    TrescaNotFeasible,
    TrescaNotSolved,
    TrescaReference,
    interior_point,
)
from enumsol.model.statuses import STATUS_TOLERANCE, ContactStatus
from enumsol.support.arguments import one_of
from enumsol.support.array_arguments import real_array
from enumsol.support.immutable import Sealed, sealed
from enumsol.support.messages import counted

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pandas as pd

    from enumsol.fixed_points.system import Problem
    from enumsol.support.array_types import Alpha, AlphaLike, ArrayLike, Floats


@dataclass(frozen=True)
class TrescaState(Sealed):
    """Contact forces and displacements of a problem in 2D (d = 1) or 3D (d = 2) under given slip bounds.

    Attributes
    ----------
    problem : ContactProblem or ContactProblem3D
    alpha : float or Fraction
    slip_bound : (p,) array
        The bounds s in |tau| <= s, lambda_t = F tau [force].
    coefficients : (p, d) array
        Friction coefficients [-].
    lambda_n : (p,) array
        Normal contact forces, >= 0 [force].
    lambda_t : (p,) array in 2D, (p, 2) in 3D
        Tangential contact forces [force].
    u_n, u_t : arrays of the same shapes
        Bn u - gap, and the tangential displacements minus the slip offset [length].
    rigid_coordinates : (r,) array or None
        Of a body that nothing holds: q of its rigid displacement N q [length]. Where it is not unique, one of them.
    """

    problem: Problem = field(repr=False)
    alpha: Alpha
    slip_bound: Floats
    coefficients: Floats
    lambda_n: Floats
    lambda_t: Floats
    u_n: Floats
    u_t: Floats
    rigid_coordinates: Floats | None = field(default=None, kw_only=True)

    @classmethod
    def of(cls, data: TrescaData, x: Floats, **more: Any) -> Self:
        """The state of an x that solves a Tresca problem."""
        system = data.system
        (normal, tangential), (w_n, w_t) = system.split(x), system.split(system.moves(x))
        flat = system.tangents == 1
        parts = (tangential * system.force[:, None], w_t * system.length[:, None])
        lambda_t, u_t = (part[:, 0] if flat else part for part in parts)
        return cls(
            problem=system.problem,
            alpha=system.alpha,
            slip_bound=data.bound * system.force,
            coefficients=data.F,
            lambda_n=normal * system.force,
            lambda_t=lambda_t,
            u_n=w_n * system.length,
            u_t=u_t,
            rigid_coordinates=system.rigid_of(x) if system.modes else None,
            **more,
        )

    @property
    def forces(self) -> Floats:
        """lambda_n and lambda_t as one vector over the rows of ``problem.contact_rows`` [force]."""
        return np.concatenate([self.lambda_n, self.lambda_t.ravel(order="F")])

    @cached_property
    def u(self) -> Floats:
        """Displacement of all degrees of freedom, shape (n,) [length]."""
        u, rigid = condensation_of(self.problem).displacement(self.alpha, self.forces), self.rigid_displacement
        return sealed(u if rigid is None else u + rigid)

    @property
    def rigid_displacement(self) -> Floats | None:
        """Displacement N q of a body that nothing holds as a whole, shape (n,) [length]; None of others."""
        N, q = self.problem.rigid_modes, self.rigid_coordinates
        return None if N is None or q is None else np.asarray(N @ q)

    @cached_property
    def statuses(self) -> tuple[ContactStatus, ...]:
        """Per node OPEN, STICK or a slip (in 3D SLIP), by the forces within rounding and the direction of u_t."""
        p = len(self.lambda_n)
        size = float(np.max(np.abs(self.forces), initial=0.0))
        lambda_t, u_t = self.lambda_t.reshape(p, -1), self.u_t.reshape(p, -1)
        F = self.coefficients
        tau = np.divide(lambda_t, F, out=np.zeros_like(lambda_t), where=F > 0)
        work = np.where(F > 0, u_t, 0.0) if np.any(F > 0) else u_t
        found = []
        for i in range(p):
            if self.lambda_n[i] <= STATUS_TOLERANCE * size:
                found.append(ContactStatus.OPEN)
            elif not np.any(F[i] > 0):
                found.append(self._slip(u_t[i]))
            elif np.linalg.norm(tau[i]) < self.slip_bound[i] * (1.0 - STATUS_TOLERANCE):
                found.append(ContactStatus.STICK)
            else:
                found.append(self._slip(work[i]))
        return tuple(found)

    def _slip(self, u_t: Floats) -> ContactStatus:
        if not np.any(u_t):
            return ContactStatus.STICK
        if len(u_t) == 2:
            return ContactStatus.SLIP
        return ContactStatus.SLIP_PLUS if u_t[0] > 0 else ContactStatus.SLIP_MINUS

    @cached_property
    def residuals(self) -> Mapping[str, float]:
        """Distances from a solution with Coulomb friction, |tau| <= lambda_n; all relative to the load [-].

        ``equilibrium`` is |A u + B' lambda - f| / |f|; ``penetration`` the largest u_n and ``tension`` the largest
        -lambda_n, as forces and displacements of the contact nodes; ``complementarity`` the sum of |lambda_n u_n|;
        ``cone`` the largest |tau| - lambda_n; ``dissipation`` the sum of |lambda_n |F u_t| - lambda_t . u_t|; where
        friction depends on the slip ``coefficients``, the largest |F(slip) - F| [-], F those it was solved with. Forces
        are divided by the largest contact force, but at least 1e-9 of the largest entry of f, displacements by the
        largest displacement of a contact node without contact forces, work by g' S^-1 g; of a body that nothing holds
        these are taken as springs hold it (theory, section 14.1).
        """
        p = len(self.lambda_n)
        condensed = condensation_of(self.problem)
        g = condensed.free_displacements(self.alpha)
        load = self.problem.load_at(self.alpha)
        work = float(np.linalg.solve(condensed.S, g) @ g) or 1.0
        force = max(float(np.max(np.abs(self.forces))), STATUS_TOLERANCE * float(np.max(np.abs(load)))) or 1.0
        length = float(np.max(np.abs(g))) or 1.0
        lambda_t, u_t, F = self.lambda_t.reshape(p, -1), self.u_t.reshape(p, -1), self.coefficients
        tau = np.linalg.norm(np.divide(lambda_t, F, out=np.zeros_like(lambda_t), where=F > 0), axis=1)
        slip_work = self.lambda_n * np.linalg.norm(F * u_t, axis=1)
        rest = self.problem.A @ self.u + self.problem.contact_rows.T @ self.forces - load
        values = {
            "equilibrium": np.linalg.norm(rest) / (np.linalg.norm(load) or 1.0),
            "penetration": max(np.max(self.u_n), 0.0) / length,
            "tension": max(-np.min(self.lambda_n), 0.0) / force,
            "complementarity": np.sum(np.abs(self.lambda_n * self.u_n)) / work,
            "cone": max(np.max(tau - self.lambda_n), 0.0) / force,
            "dissipation": np.sum(np.abs(slip_work - np.sum(lambda_t * u_t, axis=1))) / work,
        }
        if getattr(self.problem, "depends_on_solution", False):
            values["coefficients"] = np.max(np.abs(self._coefficients_at_slips() - F))
        return MappingProxyType({name: float(value) + 0.0 for name, value in values.items()})

    def _coefficients_at_slips(self) -> Floats:
        problem: Any = self.problem
        slip = np.linalg.norm(self.u_t, axis=1) if problem.slip_mean is None else problem.slip_mean(self.u)
        return np.asarray(problem.coefficients(self.alpha, slip))

    def __getstate__(self) -> dict[str, Any]:
        # a mappingproxy cannot be pickled; copies compute it again
        return {name: value for name, value in self.__dict__.items() if name != "residuals"}

    def to_frame(self) -> pd.DataFrame:
        """Table with a row per contact node: label, coordinates, status, coefficients, forces and displacements."""
        import pandas as pd  # for frames only

        problem, p = self.problem, len(self.lambda_n)
        columns: dict[str, Any] = {"alpha": [float(self.alpha)] * p, "node": list(problem.node_ids)}
        if problem.coordinates is not None:
            columns |= dict(zip("xyz", problem.coordinates.T, strict=False))
        columns["status"] = [status.value for status in self.statuses]
        columns["slip_bound"] = self.slip_bound
        state = [(name, getattr(self, name)) for name in ("lambda_n", "lambda_t", "u_n", "u_t")]
        for name, values in (("F", self.coefficients), *state):
            table = values.reshape(p, -1)
            names = [name] if table.shape[1] == 1 else [f"{name}{k + 1}" for k in range(2)]
            columns |= dict(zip(names, table.T, strict=True))
        return pd.DataFrame(columns)


Solver = Literal["newton", "clarabel", "cvxpy"]
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
    start: object = None,
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
    one_of(solver, "solver", get_args(Solver))
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
    system = data.system
    reference = TrescaReference(system.problem)
    normal, tangential, u = reference.solve(data.bound * system.force, data.F, system.problem.load_at(system.alpha))
    # springs at ``held`` would carry nothing (theory, section 14.1)
    modes = system.problem.modes
    q = np.linalg.solve(modes.N[modes.held], u[modes.held])
    x = system.joined(normal / system.force, tangential / system.force[:, None], system.scaled_rigid(q))
    return TrescaSolution.of(data, x, residual=data.residual(x), solver="cvxpy")


def scaled_unknowns(system: ContactSystem, state: object, name: str = "start") -> Floats:
    """The x of a state or root: its scaled forces and rigid displacement, which is zero if it has none.

    Raises
    ------
    InvalidArgumentError
        It has no lambda_n or lambda_t, or none of these shapes, or they are huge, or it has a rigid displacement with
        another number of coordinates; ``name`` is what it is called in the message.
    """
    p, d = system.p, system.tangents
    parts = []
    for attribute, shape in (("lambda_n", (p,)), ("lambda_t", (p,) if d == 1 else (p, 2))):
        if not hasattr(state, attribute):
            raise InvalidArgumentError(
                f"{name} is a {type(state).__name__} without {attribute}; expected a root of enumerate_roots or a "
                "fixed point"
            )
        values = real_array(getattr(state, attribute), f"{attribute} of {name}", error=InvalidArgumentError)
        if values.shape != shape:
            raise InvalidArgumentError(
                f"{name} has {attribute} of shape {values.shape}; expected {shape}, as the problem has p = {p} contact "
                "nodes"
            )
        parts.append(values.ravel(order="F"))
    forces, rigid = system.scaled(np.concatenate(parts), system.force, name), np.zeros(system.modes)
    given = getattr(state, "rigid_coordinates", None)
    if given is not None and system.modes:
        given = real_array(given, f"rigid_coordinates of {name}", error=InvalidArgumentError)
        if given.shape != rigid.shape:
            raise InvalidArgumentError(
                f"{name} has rigid_coordinates of shape {given.shape}; expected {rigid.shape}, as the problem has "
                f"{counted(system.modes, 'rigid mode')}"
            )
        rigid = system.scaled_rigid(given)
    return np.append(forces, rigid)


def slips_of(state: object, p: int, name: str) -> Floats:
    """The slips that a state or root has: its ``slip``, or |u_t|, shape (p,) [length].

    Raises
    ------
    InvalidArgumentError
        It has neither, or u_t is not p numbers or pairs.
    """
    slip = getattr(state, "slip", None)
    if slip is not None:
        return np.asarray(slip)
    u_t = real_array(getattr(state, "u_t", None), f"u_t of {name}", error=InvalidArgumentError)
    if u_t.shape not in ((p,), (p, 2)):
        raise InvalidArgumentError(f"{name} has u_t of shape {u_t.shape}; expected ({p},) or ({p}, 2)")
    return np.asarray(np.linalg.norm(u_t.reshape(p, -1), axis=1))
