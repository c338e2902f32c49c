"""A solution in 3D by Newton's method in isotropic variables (theory, section 12.6), in floats."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from enumsol.support.deadlines import look

if TYPE_CHECKING:
    from enumsol.condensation.space_condensed import SpaceSystem
    from enumsol.support.array_types import Floats


#: Residual at which a point counts as a solution, relative to forces of size one.
_SOLVED = 1e-10


@dataclass(frozen=True)
class Isotropic:
    """w = g - S y for y (p, 3): lambda_n and both tau, those that do not occur with equations tau = 0 of their own.

    Attributes
    ----------
    S : (3 p, 3 p) array
    g : (3 p,) array
    unit : (3 p,) array
        Powers of two: S is scaled back by them before a system is solved.
    rho : (3 p,) array
        Steps of the natural map y - P(y + rho w), one for lambda_n and one for tau of every node.
    """

    S: Floats
    g: Floats
    unit: Floats
    rho: Floats

    @classmethod
    def of(cls, system: SpaceSystem) -> Isotropic:
        """The problem of a scaled system."""
        p, tau = system.p, system.tau
        places = np.column_stack([np.arange(p), tau]).ravel()
        occurs = places >= 0
        unit = np.where(occurs, system.unit[places], 1.0)
        both = occurs[:, None] & occurs[None, :]
        S = np.where(both, system.S[np.ix_(places, places)] / np.outer(unit, unit), 0.0)
        S[~occurs, ~occurs] = 1.0
        rho = 1.0 / np.diagonal(S).reshape(p, 3)
        friction = np.min(np.where(occurs.reshape(p, 3)[:, 1:], rho[:, 1:], np.inf), axis=1, keepdims=True)
        rho[:, 1:] = np.where(np.isfinite(friction), friction, 1.0)
        return cls(S, np.where(occurs, system.g[places] / unit, 0.0), unit, rho.ravel())

    def displacements(self, y: Floats) -> Floats:
        """w, (p, 3)."""
        return (self.g - self.S @ y.ravel()).reshape(-1, 3)

    def solution(self, near: Floats | None = None) -> Floats | None:
        """A solution y, (p, 3), or None: by Newton's method from one near it or from 0, else with growing discs."""
        found = None if near is None else self._newton(near.ravel(), 1.0)
        if found is None:
            found = self._newton(np.zeros_like(self.g), 1.0)
        if found is None:
            found = self._grown()
        return None if found is None else found.reshape(-1, 3)

    def near(self, y: Floats, system: SpaceSystem) -> Floats | None:
        """A solution like y near one, both as ``system`` has them, (m,); None if Newton's method finds none."""
        found = self._newton(self.by_node(y, system).ravel(), 1.0)
        if found is None:
            return None
        near, found = np.empty_like(y), found.reshape(-1, 3)
        near[: system.p] = found[:, 0]
        occurs = system.tau >= 0
        near[system.tau[occurs]] = (found[:, 1:] / np.where(occurs, system.unit[system.tau], 1.0))[occurs]
        return near

    @staticmethod
    def by_node(y: Floats, system: SpaceSystem) -> Floats:
        """Forces as ``system`` has them, (m,), as they are here, (p, 3)."""
        units = np.where(system.tau >= 0, system.unit[system.tau], 1.0)
        return np.column_stack([y[: system.p], system.tangential(y) * units])

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
        """A solution for discs |tau| <= radius lambda_n from a point near it, (3 p,)."""
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

    def _step(self, H: Floats, slopes: Floats) -> Floats | None:
        """The solution of J step = H, J = I - D (I - rho S), solved for where D is not 0; elsewhere step = H."""
        moving = np.flatnonzero(np.any(slopes, axis=(1, 2)))
        D, S = slopes[moving], self.S.reshape(-1, 3, len(H))[moving] * self.rho.reshape(-1, 3, 1)[moving]
        J = (D @ S).reshape(-1, len(H))
        rows = (3 * moving[:, None] + np.arange(3)).ravel()
        step = H.copy()
        step[rows] = 0.0
        given = H[rows] - J @ step
        J = J[:, rows]
        for i, j in np.ndindex(3, 3):
            J[i::3, j::3][np.diag_indices(len(moving))] += (i == j) - D[:, i, j]
        try:
            # in the units of the system, in which no row is small
            unit = self.unit[rows]
            step[rows] = np.linalg.solve(J / unit[:, None] * unit, given / unit) * unit
        except np.linalg.LinAlgError:
            return None
        return step if np.all(np.isfinite(step)) else None

    def _natural(self, y: Floats, radius: float) -> tuple[Floats, Floats]:
        """The natural map y - P(z), z = y + rho w, with discs as large as z has lambda_n, and dP/dz, (p, 3, 3)."""
        z = (y + self.rho * (self.g - self.S @ y)).reshape(-1, 3)
        closed, pair = z[:, 0] > 0, z[:, 1:]
        normal = np.where(closed, z[:, 0], 0.0)
        length = np.linalg.norm(pair, axis=1)
        inside = length <= radius * normal
        safe = np.where(inside, 1.0, length)
        e = pair / safe[:, None]
        bend = np.where(inside, 1.0, radius * normal / safe)
        slides = ~inside & closed
        slopes = np.zeros((len(z), 3, 3))
        slopes[:, 0, 0] = closed
        slopes[:, 1:, 1:] = bend[:, None, None] * (np.eye(2) - slides[:, None, None] * e[:, :, None] * e[:, None, :])
        slopes[:, 1:, 0] = radius * slides[:, None] * e
        return y - np.column_stack([normal, bend[:, None] * pair]).ravel(), slopes
