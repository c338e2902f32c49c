"""Contact forces and displacements at one alpha: what a Tresca problem or a fixed-point iteration ends with."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from enumsol.sealed import Sealed, sealed
from enumsol.statuses import ContactStatus

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pandas as pd
    from numpy.typing import NDArray

    from enumsol.checks import Alpha
    from enumsol.fixed_points.newton import TrescaData
    from enumsol.fixed_points.system import ContactSystem, Problem

    Vector = NDArray[np.float64]

#: For statuses: a force below this fraction of the largest is zero, and |tau| this close to its bound has reached it.
STATUS_TOLERANCE = 1e-9


@dataclass(frozen=True)
class ContactState(Sealed):
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
    """

    problem: Problem = field(repr=False)
    alpha: Alpha
    slip_bound: Vector
    coefficients: Vector
    lambda_n: Vector
    lambda_t: Vector
    u_n: Vector
    u_t: Vector

    @classmethod
    def of(cls, data: TrescaData, forces: Vector, **more: Any) -> Self:
        """The state of scaled forces that solve a Tresca problem."""
        system = data.system
        w = data.displacements(forces)
        (normal, tangential), (w_n, w_t) = system.split(forces), system.split(w)
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
            **more,
        )

    @property
    def forces(self) -> Vector:
        """lambda_n and lambda_t as one vector over the rows of ``problem.contact_rows`` [force]."""
        return np.concatenate([self.lambda_n, self.lambda_t.ravel(order="F")])

    @cached_property
    def u(self) -> Vector:
        """Displacement A^-1 (f(alpha) - B' lambda), shape (n,) [length]."""
        return sealed(self.problem.condensed.displacement(self.alpha, self.forces))

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

    def _slip(self, u_t: Vector) -> ContactStatus:
        if not np.any(u_t):
            return ContactStatus.STICK
        if len(u_t) == 2:
            return ContactStatus.SLIP
        return ContactStatus.SLIP_PLUS if u_t[0] > 0 else ContactStatus.SLIP_MINUS

    @cached_property
    def residuals(self) -> Mapping[str, float]:
        """How far the state is from a solution with Coulomb friction, |tau| <= lambda_n; all relative to the load [-].

        ``equilibrium`` is |A u + B' lambda - f| / |f|; ``penetration`` the largest u_n and ``tension`` the largest
        -lambda_n, as forces and displacements of the contact nodes; ``complementarity`` the sum of |lambda_n u_n|;
        ``cone`` the largest |tau| - lambda_n; ``dissipation`` the sum of |lambda_n |F u_t| - lambda_t . u_t|. Forces
        are divided by the largest contact force, displacements by the largest displacement of a contact node without
        contact forces, work by g' S^-1 g.
        """
        p = len(self.lambda_n)
        condensed = self.problem.condensed
        g = condensed.free_displacements(self.alpha)
        load = self.problem.load_at(self.alpha)
        work = float(np.linalg.solve(condensed.S, g) @ g) or 1.0
        force = float(np.max(np.abs(self.forces), initial=0.0)) or 1.0
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
        return MappingProxyType({name: float(value) for name, value in values.items()})

    def to_frame(self) -> pd.DataFrame:
        """One row a contact node: label, coordinates, status, coefficients, forces and displacements."""
        import pandas as pd  # for frames only

        problem, p = self.problem, len(self.lambda_n)
        columns: dict[str, Any] = {"alpha": [float(self.alpha)] * p, "node": list(problem.node_ids)}
        if problem.coordinates is not None:
            columns |= dict(zip("xyz", problem.coordinates.T, strict=False))
        columns["status"] = [status.value for status in self.statuses]
        columns["slip_bound"] = self.slip_bound
        for name, values in (("F", self.coefficients), ("lambda_t", self.lambda_t), ("u_t", self.u_t)):
            table = values.reshape(p, -1)
            names = [name] if table.shape[1] == 1 else [f"{name}{k + 1}" for k in range(2)]
            columns |= dict(zip(names, table.T, strict=True))
            if name == "F":
                columns["lambda_n"] = self.lambda_n
            elif name == "lambda_t":
                columns["u_n"] = self.u_n
        return pd.DataFrame(columns)


def slips_of(state: Any, p: int) -> Vector:
    """Slips on which coefficients depend, shape (p,): the ``slip`` of a fixed point, |u_t| of a root [length]."""
    slip = getattr(state, "slip", None)
    return np.asarray(np.linalg.norm(np.reshape(state.u_t, (p, -1)), axis=1) if slip is None else slip)


def scaled_forces(system: ContactSystem, state: Any) -> Vector:
    """Scaled forces of a state or root, as a start."""
    forces = np.concatenate([state.lambda_n, np.asarray(state.lambda_t).ravel(order="F")])
    return np.asarray(forces / np.tile(system.force, 1 + system.tangents))
