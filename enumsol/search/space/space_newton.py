"""Newton's method in 3D in floats: the projection P, and a solution in isotropic variables (theory, section 12.6)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from enumsol.support.deadlines import look

if TYPE_CHECKING:
    from enumsol.condensation.space_condensed import SpaceSystem
    from enumsol.support.array_types import Floats, Indices


#: Residual at which a point counts as a solution, relative to forces of size one.
_SOLVED = 1e-10


def projected(tau: Indices, F: Floats, slope: Floats, z: Floats) -> tuple[Floats, Floats]:
    """P of arguments z, the last of them that of F, (m,), and derivatives by (n, t1, t2) and the last one, (p, 3, 4).

    Parameters
    ----------
    tau : (p, 2) array of int, places of both components, -1 where there is none
    F, slope : (p,) arrays
        Radii of the discs over lambda_n, and their derivatives by the last argument.
    z : (m + 1,) array
        All lambda_n first; what is behind 3p of them P keeps.
    """
    p, m = len(tau), len(z) - 1
    has, kept = tau >= 0, np.arange(3 * p, m)
    normal, tangent = np.maximum(z[:p], 0.0), np.where(has, z[tau], 0.0)
    most, length = F * normal, np.linalg.norm(tangent, axis=1)
    touches = z[:p] > 0
    sticks, divisor = touches & (length <= most), np.where(length > 0, length, 1.0)
    ratio = np.where(sticks, 1.0, most / divisor)[:, None]
    e = np.where(sticks, 0.0, 1.0 / divisor)[:, None] * tangent
    P, D = np.zeros(m), np.zeros((p, 3, 4))
    P[kept], P[:p], P[tau[has]] = z[kept], normal, (ratio * tangent)[has]
    D[:, 0, 0], D[:, 1:, 0], D[:, 1:, 3] = touches, (touches * F)[:, None] * e, (slope * normal)[:, None] * e
    D[:, 1:, 1:3] = (ratio * has)[:, :, None] * (np.eye(2) - e[:, :, None] * e[:, None, :])
    return P, D


@dataclass(frozen=True)
class Isotropic:
    """w = g - S y in the variables (lambda_n, tau) of a system without its units.

    Attributes
    ----------
    S : (m, m) array
    g : (m,) array
    unit : (m,) array
        Powers of two: S is scaled back by them before a system is solved.
    tau : (p, 2) array of int
        Places of the tau of every node, -1 where there is none.
    rho : (m,) array
        Steps of the natural map y - P(y + rho w), one for lambda_n and one for tau of every node.
    """

    S: Floats
    g: Floats
    unit: Floats
    tau: Indices
    rho: Floats

    @classmethod
    def of(cls, system: SpaceSystem) -> Isotropic:
        """The problem of a scaled system."""
        S = system.S / np.outer(system.unit, system.unit)
        rho = 1.0 / np.diagonal(S)
        for t in system.tau:
            rho[t[t >= 0]] = np.min(rho[t[t >= 0]], initial=np.inf)
        return cls(S, system.g / system.unit, system.unit, system.tau, rho)

    def displacements(self, y: Floats) -> Floats:
        """w, (m,)."""
        return self.g - self.S @ y

    def solution(self, near: Floats | None = None) -> Floats | None:
        """A solution y, (m,), or None: by Newton's method from one near it or from 0, else with growing discs."""
        found = None if near is None else self.near(near)
        if found is None:
            found = self.near(np.zeros_like(self.g))
        return self._grown() if found is None else found

    def near(self, y: Floats) -> Floats | None:
        """A solution like y near one; None if Newton's method finds none."""
        return self._newton(y, 1.0)

    def _grown(self) -> Floats | None:
        y = self._newton(np.zeros_like(self.g), 0.0)
        radius, step = 0.0, 0.25
        for _ in range(24):
            if y is None or radius >= 1.0:
                break
            further = min(radius + step, 1.0)
            found = self._newton(y, further)
            if found is None:
                step *= 0.5
                if step < 0.02:
                    return None
            else:
                y, radius, step = found, further, 1.5 * step
        return y if radius >= 1.0 else None

    def _newton(self, y: Floats, radius: float) -> Floats | None:
        """A solution for discs |tau| <= radius lambda_n from a point near it, (m,)."""
        H, slopes = self._natural(y, radius)
        size, best, waited = self._merit(H), np.inf, 0
        for _ in range(40):
            if size <= _SOLVED:
                return y
            best, waited = (size, 0) if size < 0.5 * best else (best, waited + 1)
            if waited > 12:  # so many steps without a merit half as large
                return None
            look()
            step = self._step(H, slopes)
            if step is None:
                return None
            share = 1.0
            for _ in range(7):
                trial = y - share * step
                found = self._natural(trial, radius)
                if self._merit(found[0]) < size:
                    break
                share *= 0.5
            y, (H, slopes) = trial, found
            size = self._merit(H)
        return y if size <= _SOLVED else None

    def _merit(self, H: Floats) -> float:
        return float(np.linalg.norm(H / self.unit))

    def _step(self, H: Floats, D: Floats) -> Floats | None:
        """The solution of J step = H, J = I - D (I - rho S), solved for where D is not 0; elsewhere step = H."""
        moving = np.flatnonzero(np.any(D, axis=(1, 2)))
        at, D = np.column_stack([np.arange(len(self.tau)), self.tau])[moving], D[moving]
        has, step = at >= 0, H.copy()
        rows, number = at[has], np.zeros(at.shape, dtype=np.intp)
        number[has] = np.arange(len(rows))
        J = (D @ (self.S[at] * self.rho[at][:, :, None]))[has]
        step[rows] = 0.0
        given = H[rows] - J @ step
        J = J[:, rows]
        for i, j in np.ndindex(3, 3):
            both = has[:, i] & has[:, j]
            J[number[both, i], number[both, j]] += (i == j) - D[both, i, j]
        try:
            # in the units of the system, in which no row is small
            unit = self.unit[rows]
            step[rows] = np.linalg.solve(J / unit[:, None] * unit, given / unit) * unit
        except np.linalg.LinAlgError:
            return None
        return step if np.all(np.isfinite(step)) else None

    def _natural(self, y: Floats, radius: float) -> tuple[Floats, Floats]:
        """The natural map y - P(z), z = y + rho w, with discs as large as z has lambda_n, and dP/dz, (p, 3, 3)."""
        F, z = np.full(len(self.tau), radius), y + self.rho * self.displacements(y)
        P, D = projected(self.tau, F, 0.0 * F, np.append(z, 0.0))
        return y - P, D[:, :, :3]
