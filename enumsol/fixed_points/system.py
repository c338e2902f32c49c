"""A condensed problem in 2D or 3D at one alpha, without units: what Tresca problems are solved on.

The unknowns x are the scaled contact forces and, of a body that nothing holds, the scaled coordinates q of its rigid
displacement (theory, section 14.10); of others there are r = 0 of these.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import block_diag, cho_solve, solve_triangular

from enumsol.arithmetic.balls import UNIT
from enumsol.condensation.condensed import (
    LARGEST_NUMBER,
    CondensedProblem,
    cholesky_factor,
    condensation_of,
    load_unit,
    node_units,
)
from enumsol.errors import InvalidArgumentError
from enumsol.model.problem import ContactProblem
from enumsol.model.problem3d import ContactProblem3D
from enumsol.model.rigid_modes import modes_of
from enumsol.support.arguments import alpha_value

if TYPE_CHECKING:
    from enumsol.support.array_types import Alpha, AlphaLike, Floats

    Problem = ContactProblem | ContactProblem3D


def checked_problem(value: object) -> Problem:
    """Value as a contact problem in 2D or 3D.

    Raises
    ------
    InvalidArgumentError
        It is neither.
    """
    if isinstance(value, (ContactProblem, ContactProblem3D)):
        return value
    raise InvalidArgumentError(f"problem is a {type(value).__name__}; expected a ContactProblem or a ContactProblem3D")


@dataclass(frozen=True)
class ContactSystem:
    """w = g - S lambda + G' q with G lambda = h at one alpha, without units (theory, sections 11.2 and 14.10).

    One factor per node, a power of two, makes its compliance of size one, alike in all directions, and one factor for
    all forces brings the energy of the load, g' S^-1 g + |h|^2, into [1, 4) unless g = 0 and h = 0. Friction
    coefficients are unchanged. Units of q are such that G S^-1 G' = I.

    Attributes
    ----------
    problem : ContactProblem or ContactProblem3D
    alpha : float or Fraction
    condensed : CondensedProblem
    S : (m, m) array, m = (1 + d) p, with d = 1 or 2 tangents
    g : (m,) array
    G : (r, m) array
    h : (r,) array
    force, length : (p,) arrays
        Factors: a force is ``force`` times its scaled one, a displacement ``length`` times.
    rigid : (r, r) array
        Coordinates of the rigid displacement are ``rigid`` times scaled ones.
    cholesky : array of the shape of S
        L with S = L L'.
    compliance : float
        Of springs that hold the body: G lambda + compliance q = h.
    """

    problem: Problem
    alpha: Alpha
    condensed: CondensedProblem = field(repr=False)
    S: Floats = field(repr=False)
    g: Floats = field(repr=False)
    G: Floats = field(repr=False)
    h: Floats = field(repr=False)
    force: Floats = field(repr=False)
    length: Floats = field(repr=False)
    rigid: Floats = field(repr=False)
    cholesky: Floats = field(repr=False)
    compliance: float = 0.0

    @classmethod
    def at(cls, problem: Problem, alpha: AlphaLike) -> ContactSystem:
        """The system of a problem at one alpha.

        Raises
        ------
        InvalidArgumentError
            alpha is not finite.
        InvalidProblemError
            The compliance is not positive definite within rounding.
        NotHeldError
            Some rigid displacement moves no contact node.
        """
        value = alpha_value(alpha)
        condensed = condensation_of(problem)
        p = problem.p
        factor = node_units(condensed.S, p)
        everywhere = np.tile(factor, len(condensed.S) // p)
        S = condensed.S * everywhere[:, None] * everywhere[None, :]
        g = condensed.free_displacements(value) * everywhere
        cholesky = cholesky_factor(S)
        (still, slope), L = condensed.h, condensed.mixing
        G = solve_triangular(L, condensed.G * everywhere, lower=True, check_finite=False)
        h = solve_triangular(L, still + float(value) * slope, lower=True, check_finite=False)
        size = load_unit(np.append(g, h), block_diag(cholesky, np.eye(len(L))))
        force, length = factor * size, size / factor
        rigid = np.asarray(size * np.linalg.inv(L.T), dtype=np.float64)
        return cls(problem, value, condensed, S, g / size, G, h / size, force, length, rigid, cholesky)

    @property
    def p(self) -> int:
        """Number of contact nodes."""
        return len(self.force)

    @property
    def tangents(self) -> int:
        """Number of tangents, 1 or 2."""
        return len(self.g) // self.p - 1

    @property
    def m(self) -> int:
        """Number of contact forces, (1 + d) p."""
        return len(self.g)

    @property
    def modes(self) -> int:
        """Number r of rigid modes of a body that nothing holds; otherwise 0."""
        return len(self.h)

    def moves(self, x: Floats) -> Floats:
        """Scaled displacements w of all rows, shape (m,)."""
        return np.asarray(self.g - self.S @ x[: self.m] + self.G.T @ x[self.m :])

    def imbalance(self, x: Floats) -> Floats:
        """Load on the body as a whole less contact forces and, if there are any, springs, shape (r,)."""
        return np.asarray(self.h - self.G @ x[: self.m] - self.compliance * x[self.m :])

    @cached_property
    def load_energy(self) -> float:
        """Root of ||g||^2 in the norm of S^-1 plus |h|^2.

        No solution of a body that is held has a larger energy norm (theory, section 11.3).
        """
        elastic = solve_triangular(self.cholesky, self.g, lower=True, check_finite=False)
        return float(np.linalg.norm(np.append(elastic, self.h)))

    @cached_property
    def largest_forces(self) -> Floats:
        """Bounds on the forces of a solution, shape (m,): by the energy bound (theory, section 11.3).

        Of a body that nothing holds there is no such bound; forces so large are taken for none (theory, section 14.10).
        """
        if self.modes:
            # larger forces are taken for none
            return np.full(self.m, 1e6)
        inverse = solve_triangular(self.cholesky, np.eye(len(self.S)), lower=True, check_finite=False)
        return np.asarray(self.load_energy * np.linalg.norm(inverse, axis=0))

    @cached_property
    def normal_stiffness(self) -> Floats:
        """((S^-1)_nn)^-1, the matrix of the norm of normal forces (theory, (11.4)), shape (p, p)."""
        p = self.p
        coupling = self.S[:p, p:]
        return np.asarray(self.S[:p, :p] - coupling @ np.linalg.solve(self.S[p:, p:], coupling.T))

    def force_norm(self, normal: Floats) -> float:
        """||normal||_D of scaled normal forces (theory, (11.4)): at most ``load_energy`` at solutions."""
        return float(np.sqrt(np.maximum(normal @ self.normal_stiffness @ normal, 0.0)))

    def coefficients(self, slip: Floats) -> Floats:
        """Friction coefficients for scaled slips of shape (p,), shape (p, d)."""
        if isinstance(self.problem, ContactProblem3D):
            F = self.problem.coefficients(self.alpha, slip * self.length)
        else:
            F = self.problem.friction_at(self.alpha)[:, None]
        if np.max(F) > LARGEST_NUMBER:
            raise InvalidArgumentError(f"friction is {np.max(F):g}; expected at most {LARGEST_NUMBER:g} here")
        return F

    def slip(self, x: Floats) -> Floats:
        """The scaled slip that coefficients depend on, shape (p,)."""
        mean = self.problem.slip_mean if isinstance(self.problem, ContactProblem3D) else None
        if mean is None:
            return np.asarray(np.linalg.norm(self.split(self.moves(x))[1], axis=1))
        u = self._elastic(x) + self.problem.modes.N @ self.rigid_of(x)
        return np.asarray(mean(u) / self.length)

    def rigid_of(self, x: Floats) -> Floats:
        """Coordinates of the rigid displacement in the problem's units, shape (r,)."""
        return np.asarray(self.rigid @ x[self.m :])

    def unit_motion(self, rigid: Floats) -> Floats:
        """Coordinates, in the problem's units, of a scaled rigid displacement, whose largest component becomes 1."""
        given = self.rigid @ rigid
        return np.asarray(given / np.max(np.abs(self.problem.modes.N @ given)))

    def scaled_rigid(self, coordinates: Floats) -> Floats:
        """Scaled coordinates of a rigid displacement, shape (r,)."""
        return np.asarray(np.linalg.solve(self.rigid, coordinates))

    def _elastic(self, x: Floats) -> Floats:
        """u less the rigid displacement in the problem's units, shape (n,)."""
        return self.condensed.displacement(self.alpha, x[: self.m] * np.tile(self.force, 1 + self.tangents))

    def corrected(self, x: Floats) -> tuple[ContactSystem, Floats]:
        """The system with w as the body itself has it at scaled forces, and what that changes (theory, section 11.7).

        Returns
        -------
        (ContactSystem, (m,) array)
            The change S^-1 dg of the forces, scaled, in which statuses are not looked at.
        """
        problem = self.problem
        offset = np.concatenate([problem.gap, problem.slip_offset.ravel(order="F")])
        w = (problem.contact_rows @ self._elastic(x) - offset) / np.tile(self.length, 1 + self.tangents)
        g = w + self.S @ x[: self.m]
        return replace(self, g=g), np.asarray(cho_solve((self.cholesky, True), g - self.g, check_finite=False))

    def noise(self, x: Floats) -> Floats:
        """Mean change of every scaled force where S lambda is rounded (theory, (11.13))."""
        inverse = cho_solve((self.cholesky, True), np.eye(len(self.S)), check_finite=False)
        return np.asarray(UNIT * np.sqrt(inverse**2 @ (self.S**2 @ x[: self.m] ** 2)))

    def scaled(self, values: Floats, unit: Floats, name: str) -> Floats:
        """Forces or displacements of nodes or rows by the factors ``unit``, which are those of one tangent or of all.

        Raises
        ------
        InvalidArgumentError
            One is so large beside the load that squares would overflow.
        """
        with np.errstate(over="ignore"):
            scaled = values / np.tile(unit, len(values) // self.p)
        if np.any(np.abs(scaled) > LARGEST_NUMBER):
            raise InvalidArgumentError(
                f"{name} has the value {np.max(np.abs(values)):g}; expected at most {LARGEST_NUMBER:g} times the load's"
            )
        return np.asarray(scaled)

    def split(self, values: Floats) -> tuple[Floats, Floats]:
        """Normal part (p,) and tangential part (p, d) of a vector over all rows, or of x."""
        p = self.p
        return values[:p], values[p : self.m].reshape(-1, p).T

    def joined(self, normal: Floats, tangential: Floats, rigid: Floats) -> Floats:
        """The x with these parts."""
        return np.concatenate([normal, tangential.T.ravel(), rigid])


def driven(problem: Problem, alpha: Alpha, slip_bound: Floats, coefficients: Floats, motion: Floats) -> str:
    """In words: how the load drives the body along a rigid displacement, and how friction resists at given bounds."""
    moved = problem.modes.N @ motion
    slips = (problem.contact_rows @ moved)[problem.p :].reshape(-1, problem.p).T
    work = float(problem.load_at(alpha) @ moved)
    against = float(slip_bound @ np.linalg.norm(coefficients * slips, axis=1))
    return (
        f"along {modes_of(problem.modes.N, motion)} the load drives it with {work:.4g}, and friction within these "
        f"bounds resists with at most {against:.4g}"
    )
