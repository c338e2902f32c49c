"""Tresca problems by a semismooth Newton method (theory, (11.3)): a few steps from a point that is near."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
from scipy.linalg import LinAlgError, cho_factor, cho_solve

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from enumsol.fixed_points.system import ContactSystem

    Vector = NDArray[np.float64]
    Matrix = NDArray[np.float64]

#: Steps after which the method stops; from a near start it needs two to five.
MOST_STEPS = 30
#: The residual below which a point counts as the solution [unit of the scaled system, in which solutions have size 1],
#: and the one below which the method stops.
ACCEPTED, ROUNDING = 1e-11, 1e-15
#: Steps of the proximal point method, and its weights in a system whose S has a diagonal near 1.
MOST_PROXIMAL, _FIRST_RHO, _LEAST_RHO = 60, 1e-3, 1e-14
#: Tangential forces that cannot get larger than this [as above] are none: far below rounding, far above underflow.
_NEGLIGIBLE = 1e-100


@dataclass(frozen=True)
class TrescaData:
    """A Tresca problem in the variables y = (lambda_n, tau), lambda_t = F tau.

    Attributes
    ----------
    system : ContactSystem
    bound : (p,) array
        Scaled slip bounds s >= 0.
    F : (p, d) array
        Friction coefficients; where F s is 0 or negligible, tau does not occur (theory, section 11.1).
    """

    system: ContactSystem
    bound: Vector
    F: Matrix

    @property
    def occurs(self) -> NDArray[np.bool_]:
        """Which tau occur, shape (p, d)."""
        with np.errstate(over="ignore"):
            return np.asarray(self.F * self.bound[:, None] > _NEGLIGIBLE)

    def displacements(self, forces: Vector) -> Vector:
        """Scaled w = g - S lambda of all rows."""
        return np.asarray(self.system.g - self.system.S @ forces)

    def steps(self) -> tuple[Vector, Vector]:
        """Factors r of (11.3), by node: for normals and for tangents, each (p,)."""
        normal, tangential = self.system.split(np.diagonal(self.system.S))
        largest = np.max(self.F**2 * tangential, axis=1)
        return 1.0 / normal, 1.0 / np.where(largest > 0, largest, 1.0)

    def residual(self, forces: Vector, w: Vector) -> float:
        """The largest entry of (11.3) at scaled forces and displacements, in forces."""
        normal, tangential = self.system.split(forces)
        w_n, v, tau = self._in_tau(forces, w)
        r_n, r_t = self.steps()
        moved = tau + r_t[:, None] * v
        size = np.linalg.norm(moved, axis=1)
        projected = moved * (self.bound / np.maximum(size, self.bound, where=size > 0, out=np.ones_like(size)))[:, None]
        gap_n = normal - np.maximum(normal + r_n * w_n, 0.0)
        gap_t = np.where(self.occurs, self.F * (tau - projected), tangential)
        return float(max(np.max(np.abs(gap_n)), np.max(np.abs(gap_t))))

    def newton(self, start: Vector) -> tuple[Vector, float]:
        """The best point of a Newton method from scaled forces, and its residual, which the caller judges."""
        normal, tangential = self.system.split(start)
        forces = self.system.joined(normal, np.where(self.occurs, tangential, 0.0))
        w = self.displacements(forces)
        best, least, stalled = forces, self.residual(forces, w), 0
        for _ in range(MOST_STEPS):
            if least <= ROUNDING or (least <= ACCEPTED and stalled):
                break
            try:
                forces = forces + self._step(forces, w)
            except LinAlgError:
                break
            w = self.displacements(forces)
            residual = self.residual(forces, w)
            if not np.isfinite(residual):
                break
            stalled = stalled + 1 if residual >= 0.5 * least else 0
            if residual < least:
                best, least = forces, residual
        return best, least

    def proximal(self, start: Vector) -> tuple[Vector, float]:
        """The best point of a proximal point method from scaled forces, and its residual: slower than Newton's alone.

        The solutions for (S + rho, g + rho lambda) converge to that of the problem from everywhere, and Newton's
        method finds them where it does not find the solution itself: rho grows until it does, and shrinks after that.
        """
        best, least = start, self.residual(start, self.displacements(start))
        forces, rho = best, _FIRST_RHO
        for _ in range(MOST_PROXIMAL):
            if least <= ACCEPTED:
                break
            S = self.system.S + rho * np.eye(len(forces))
            near = replace(self, system=replace(self.system, S=S, g=self.system.g + rho * forces))
            found, inner = near.newton(forces)
            if inner > ACCEPTED:
                rho *= 8.0
                continue
            forces, rho = found, max(0.125 * rho, _LEAST_RHO)
            residual = self.residual(forces, self.displacements(forces))
            if residual < least:
                best, least = forces, residual
        return best, least

    def _in_tau(self, forces: Vector, w: Vector) -> tuple[Vector, Matrix, Matrix]:
        """w_n, v = F w_t and tau at a point; zero where tau does not occur."""
        (_, lambda_t), (w_n, w_t) = self.system.split(forces), self.system.split(w)
        tau = np.divide(lambda_t, self.F, out=np.zeros_like(lambda_t), where=self.occurs)
        return w_n, np.where(self.occurs, self.F * w_t, 0.0), tau

    def _step(self, forces: Vector, w: Vector) -> Vector:
        """One Newton step of (11.3).

        Some directions of lambda move by known steps: normals that open, and sliding pairs along z = tau + r v. In the
        others, the columns of Q, the equation is Q' S dlambda + shift = Q' w weight, symmetric positive definite: for
        normals in contact and for sticking tau w vanishes after the step; across z the derivative of the projection
        is delta = s / |z|, which gives the shift (1 - delta) / r and the weight 1 / delta for columns times delta^1/2.
        """
        p, d = self.system.p, self.system.tangents
        normal, _ = self.system.split(forces)
        w_n, v, tau = self._in_tau(forces, w)
        r_n, r_t = self.steps()
        moved = tau + r_t[:, None] * v
        size = np.linalg.norm(moved, axis=1)
        sliding = (size > self.bound) & np.any(self.occurs, axis=1)
        along = np.divide(moved, size[:, None], out=np.zeros_like(moved), where=sliding[:, None])
        active = normal + r_n * w_n > 0

        known = np.zeros((1 + d, p))
        known[0] = np.where(active, 0.0, -normal)
        known[1:] = (self.F * along * (np.where(sliding, self.bound, 0.0) - np.sum(along * tau, axis=1))[:, None]).T

        node_n = np.flatnonzero(active)
        node_s, axis_s = np.nonzero(self.occurs & ~sliding[:, None])
        node_a = np.flatnonzero(sliding & np.all(self.occurs, axis=1)) if d == 2 else np.empty(0, dtype=np.intp)
        delta = self.bound[node_a] / size[node_a]
        root = np.sqrt(delta)
        across = (
            root[:, None] * self.F[node_a] * np.stack([-along[node_a, -1], along[node_a, 0]], axis=1)
            if d == 2
            else np.empty((0, 2))
        )
        counts = np.cumsum([0, len(node_n), len(node_s), len(node_a)])
        columns = [np.arange(counts[k], counts[k + 1]) for k in range(3)]
        Q = sp.csc_array(
            (
                np.concatenate([np.ones(len(node_n)), self.F[node_s, axis_s], across[:, 0], across[:, 1]]),
                (
                    np.concatenate([node_n, (1 + axis_s) * p + node_s, p + node_a, 2 * p + node_a]),
                    np.concatenate([columns[0], columns[1], columns[2], columns[2]]),
                ),
            ),
            shape=((1 + d) * p, counts[-1]),
        )
        ones = np.ones(counts[2])
        weight = np.concatenate([ones, 1.0 / delta])
        shift = np.concatenate([0.0 * ones, (1.0 - delta) / r_t[node_a]])
        rows = Q.T @ self.system.S
        rhs = weight * (Q.T @ w) - rows @ known.ravel()
        matrix = rows @ Q
        matrix[np.diag_indices_from(matrix)] += shift
        if len(matrix) == 0:
            return known.ravel()
        factor = cho_factor(matrix, lower=True, overwrite_a=True, check_finite=False)
        return np.asarray(known.ravel() + Q @ cho_solve(factor, rhs, check_finite=False))
