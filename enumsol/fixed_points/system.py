"""A condensed problem in 2D or 3D at one alpha, without units: what Tresca problems are solved on."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import cho_solve, solve_triangular

from enumsol.arithmetic.balls import UNIT
from enumsol.condensation.condensed import cholesky_factor, load_unit, node_units
from enumsol.errors import InvalidArgumentError
from enumsol.model.problem import ContactProblem
from enumsol.model.problem3d import ContactProblem3D
from enumsol.support.arguments import Alpha, alpha_value

if TYPE_CHECKING:
    from typing import Any

    from numpy.typing import NDArray

    Vector = NDArray[np.float64]
    Matrix = NDArray[np.float64]
    Problem = ContactProblem | ContactProblem3D

#: Most that coefficients may be, and given forces and slips, in units in which those of the load have size 1.
_LARGEST = 1e100


def checked_problem(value: Any) -> Problem:
    """Value as a contact problem in 2D or 3D.

    Raises
    ------
    InvalidArgumentError
        It is neither.
    NotHeldError
        Nothing holds the body: its Tresca problems need not have solutions.
    """
    if isinstance(value, (ContactProblem, ContactProblem3D)):
        # theory, section 14.9
        value.check_held("a fixed point", "for given bounds of friction may be too small to balance its load")
        return value
    raise InvalidArgumentError(f"problem is a {type(value).__name__}; expected a ContactProblem or a ContactProblem3D")


@dataclass(frozen=True)
class ContactSystem:
    """w = g - S lambda at one alpha, scaled by powers of two (theory, section 11.2).

    One factor per node makes its compliance of size one, alike in all directions, and one factor for all forces brings
    the energy of the load, g' S^-1 g, into [1, 4) unless g = 0. Friction coefficients are unchanged.

    Attributes
    ----------
    problem : ContactProblem or ContactProblem3D
    alpha : float or Fraction
    S : ((1 + d) p, (1 + d) p) array, with d = 1 or 2 tangents
    g : ((1 + d) p,) array
    force, length : (p,) arrays
        Factors: a force is ``force`` times its scaled one, a displacement ``length`` times.
    cholesky : array of the shape of S
        L with S = L L'.
    """

    problem: Problem
    alpha: Alpha
    S: Matrix = field(repr=False)
    g: Vector = field(repr=False)
    force: Vector = field(repr=False)
    length: Vector = field(repr=False)
    cholesky: Matrix = field(repr=False)

    @classmethod
    def at(cls, problem: Problem, alpha: Any) -> ContactSystem:
        """The system of a problem at one alpha.

        Raises
        ------
        InvalidArgumentError
            alpha is not finite.
        InvalidProblemError
            The compliance is not positive definite within rounding.
        """
        value = alpha_value(alpha)
        condensed = problem.condensed
        p = problem.p
        factor = node_units(condensed.S, p)
        everywhere = np.tile(factor, len(condensed.S) // p)
        S = condensed.S * everywhere[:, None] * everywhere[None, :]
        g = condensed.free_displacements(value) * everywhere
        cholesky = cholesky_factor(S)
        size = load_unit(g, cholesky)
        return cls(problem, value, S, g / size, factor * size, size / factor, cholesky)

    @property
    def p(self) -> int:
        """Number of contact nodes."""
        return len(self.force)

    @property
    def tangents(self) -> int:
        """Number of tangents, 1 or 2."""
        return len(self.g) // self.p - 1

    @cached_property
    def load_energy(self) -> float:
        """||g||_(S^-1): no solution has a larger energy norm (theory, section 11.3)."""
        return float(np.linalg.norm(solve_triangular(self.cholesky, self.g, lower=True, check_finite=False)))

    @cached_property
    def largest_forces(self) -> Vector:
        """What no force of a solution exceeds, by the energy bound (theory, section 11.3), over all rows."""
        inverse = solve_triangular(self.cholesky, np.eye(len(self.S)), lower=True, check_finite=False)
        return np.asarray(self.load_energy * np.linalg.norm(inverse, axis=0))

    @cached_property
    def normal_stiffness(self) -> Matrix:
        """((S^-1)_nn)^-1, the matrix of the norm of normal forces (theory, (11.4)), shape (p, p)."""
        p = self.p
        coupling = self.S[:p, p:]
        return np.asarray(self.S[:p, :p] - coupling @ np.linalg.solve(self.S[p:, p:], coupling.T))

    def force_norm(self, normal: Vector) -> float:
        """||normal||_D of scaled normal forces (theory, (11.4)): at most ``load_energy`` at solutions."""
        return float(np.sqrt(np.maximum(normal @ self.normal_stiffness @ normal, 0.0)))

    def coefficients(self, slip: Vector) -> Matrix:
        """Friction coefficients for scaled slips of shape (p,), shape (p, d)."""
        if isinstance(self.problem, ContactProblem3D):
            F = self.problem.coefficients(self.alpha, slip * self.length)
        else:
            F = self.problem.friction_at(self.alpha)[:, None]
        if np.max(F) > _LARGEST:
            raise InvalidArgumentError(f"friction is {np.max(F):g}; expected at most {_LARGEST:g} here")
        return F

    def slip(self, forces: Vector, w: Vector) -> Vector:
        """The scaled slip that coefficients depend on, shape (p,), for scaled forces and displacements of all rows."""
        mean = self.problem.slip_mean if isinstance(self.problem, ContactProblem3D) else None
        if mean is None:
            return np.asarray(np.linalg.norm(self.split(w)[1], axis=1))
        return np.asarray(mean(self.displacement(forces)) / self.length)

    def displacement(self, forces: Vector) -> Vector:
        """u in the problem's units, shape (n,), for scaled forces of all rows."""
        scaled = forces * np.tile(self.force, 1 + self.tangents)
        return self.problem.condensed.displacement(self.alpha, scaled)

    def corrected(self, forces: Vector) -> tuple[ContactSystem, Vector]:
        """The system with w as the body itself has it at scaled forces, and what that changes (theory, section 11.7).

        Returns
        -------
        (ContactSystem, ((1 + d) p,) array)
            The change S^-1 dg of the forces, scaled, in which statuses are not looked at.
        """
        problem = self.problem
        offset = np.concatenate([problem.gap, problem.slip_offset.ravel(order="F")])
        w = (problem.contact_rows @ self.displacement(forces) - offset) / np.tile(self.length, 1 + self.tangents)
        g = w + self.S @ forces
        return replace(self, g=g), np.asarray(cho_solve((self.cholesky, True), g - self.g, check_finite=False))

    def noise(self, forces: Vector) -> Vector:
        """What every scaled force changes by, in the mean, where S lambda is rounded (theory, (11.13))."""
        inverse = cho_solve((self.cholesky, True), np.eye(len(self.S)), check_finite=False)
        return np.asarray(UNIT * np.sqrt(inverse**2 @ (self.S**2 @ forces**2)))

    def scaled(self, values: Vector, unit: Vector, name: str) -> Vector:
        """Forces or displacements of nodes or rows by the factors ``unit``, which are those of one tangent or of all.

        Raises
        ------
        InvalidArgumentError
            One is so large beside the load that squares would overflow.
        """
        with np.errstate(over="ignore"):
            scaled = values / np.tile(unit, len(values) // self.p)
        if np.any(np.abs(scaled) > _LARGEST):
            raise InvalidArgumentError(
                f"{name} has the value {np.max(np.abs(values)):g}; expected at most {_LARGEST:g} times the load's"
            )
        return np.asarray(scaled)

    def split(self, values: Vector) -> tuple[Vector, Matrix]:
        """Normal part (p,) and tangential part (p, d) of a vector over all rows."""
        p = self.p
        return values[:p], values[p:].reshape(-1, p).T

    def joined(self, normal: Vector, tangential: Matrix) -> Vector:
        """The vector over all rows with these parts."""
        return np.concatenate([normal, tangential.T.ravel()])
