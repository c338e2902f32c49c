"""Whether solutions of a body that nothing holds lie within bounds of its rigid displacement (theory, section 14.4).

Far away the body moves as if it were rigid: w is G'q but for an elastic part that is bounded, and so the motion tells
what most nodes do. Motions are covered by cells; one holds no solution if it makes a node penetrate, or if no forces
with the statuses that it tells are in balance with the load.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, gamma, upper_norm
from enumsol.condensation.enclosure import NotEnclosedError
from enumsol.support.deadlines import look
from enumsol.trusted.floating_bounds import is_unbalanced
from enumsol.trusted.status_rows import BACKWARD, FORWARD, FRICTIONLESS, OPEN, SLIP_MINUS, SLIP_PLUS, UNDECIDED

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.condensation.enclosure import EnclosedSystem
    from enumsol.support.array_types import Floats

#: Cells that are looked at before it is left open, and how narrow they may become.
_MOST_CELLS, _NARROW = 1000, 2.0**-10
#: Multiples of the bounds that are tried.
_FACTORS = 1.0, 2.0, 4.0, 8.0, 16.0, 64.0, 256.0, 4096.0, 65536.0
#: In which directions forces of a node with friction are at the limit, by its status.
_SIDES = {SLIP_PLUS: (1,), FORWARD: (1,), SLIP_MINUS: (-1,), BACKWARD: (-1,), FRICTIONLESS: (0,)}
#: By so much resultants of contact forces are varied where a motion is sought that none of them opposes.
_WIDER = 1e-6


def without_bound(system: EnclosedSystem) -> EnclosedSystem:
    """The system with bounds of the rigid displacement beyond which it is proven that there is no solution.

    They are some multiple of its own; infinite where none was found to serve.
    """
    # where the widest do not serve, narrower ones hardly do
    if is_confined(system.reaching(system.reach * _FACTORS[-1])):
        for factor in _FACTORS:
            wider = system.reaching(system.reach * factor)
            if is_confined(wider):
                return wider
    return system.reaching(np.full_like(system.reach, np.inf))


def is_confined(system: EnclosedSystem) -> bool:
    """Whether it is proven that no solution has a coordinate of its rigid displacement beyond its bound."""
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            return _Cells(system).all_excluded()
    except NotEnclosedError:
        return False


def motion_against(system: EnclosedSystem, codes: Sequence[int]) -> Floats:
    """A rigid motion against which the load works, and no forces of an assignment do, nor any that are near these.

    What is left of the load after its projection onto the cone of resultants G lambda, which is made wider by a share.
    Whether it is one, ``is_unbalanced`` tells.
    """
    return motion_beside(system, _rays(system, codes))


def motion_beside(system: EnclosedSystem, resultants: Sequence[Floats]) -> Floats:
    """As ``motion_against``, for forces whose resultants are combinations of these with positive coefficients."""
    h = system.rows.h.mid
    size = float(np.linalg.norm(h))
    rays = [ray for ray in resultants if np.any(ray)]
    if not rays or size == 0:
        return h
    columns = np.array([ray / np.linalg.norm(ray) for ray in rays])
    around = _WIDER * np.vstack([np.zeros(len(h)), np.eye(len(h)), -np.eye(len(h))])
    wide = (columns[:, None, :] + around).reshape(-1, len(h)).T
    try:
        from scipy.optimize import nnls  # only bodies that nothing holds need it

        forces, _ = nnls(wide, h / size)
    except RuntimeError:  # it does not converge
        return h
    rest = np.asarray(h / size - wide @ forces)
    length = float(np.max(np.abs(rest)))
    return rest / length if length > 0 else rest


def _rays(system: EnclosedSystem, codes: Sequence[int]) -> list[Floats]:
    """Resultants that span those of all forces of an assignment."""
    G, F, p = system.rows.G.mid, system.F, system.p
    return [
        G[:, i] + side * F[i] * G[:, p + i]
        for i, code in enumerate(codes)
        if code != OPEN
        for side in (_SIDES.get(code, (1, -1)) if F[i] > 0 else (0,))
    ]


class _Cells:
    """Motions q / (s rho), s > 1: points of the surface of the cube [-1, 1]^r.

    Parameters
    ----------
    system : EnclosedSystem
    """

    def __init__(self, system: EnclosedSystem) -> None:
        self._system, self._p, self._reach = system, system.p, system.reach
        self._known: dict[tuple[int, ...], bool] = {}
        G, k = system.rows.G, gamma(len(self._reach) + 8)
        self._G = G.mid * self._reach[:, None]
        size = self._reach @ (np.abs(G.mid) + G.rad)
        #: What w / s may be beside G'q / s.
        self._elastic = (self._largest_elastic() + self._reach @ G.rad + 4 * k * size) * (1 + k) * SAFE + TINY

    def _largest_elastic(self) -> Floats:
        """Bounds of |g - S lambda| / s, by the energy (theory, (14.5)) or, if it is better, by balance."""
        system, k = self._system, gamma(2 * len(self._system.g) + 8)
        S = np.abs(system.S) + system.S_rad
        g, moved = np.abs(system.g) + system.g_rad, np.asarray(upper_norm(S, axis=1)) * system.largest_forces
        if (most := self._largest_forces()) is not None:
            moved = np.minimum(moved, S @ np.concatenate([most, (system.F + system.F_rad) * most]) * (1 + k) * SAFE)
        return np.asarray((g + moved) * SAFE)

    def _largest_forces(self) -> Floats | None:
        """Bounds of lambda_n, (p,), by a motion that all contact forces oppose; None without one."""
        system, p = self._system, self._p
        G, h, k = system.rows.G, system.rows.h, gamma(len(self._reach) + 8)
        rays = np.array(_rays(system, (UNDECIDED,) * p))
        size = np.linalg.norm(rays, axis=1)
        if not np.all(size > 0):
            return None
        r = len(self._reach)
        ones, limits = np.ones((len(rays), 1)), [(-1.0, 1.0)] * r + [(0.0, None)]
        rows = np.hstack([-rays / size[:, None], ones])
        from scipy.optimize import linprog  # only bodies that nothing holds need it

        found = linprog(np.r_[np.zeros(r), -1.0], rows, np.zeros(len(rays)), bounds=limits)
        if found.status != 0:
            return None
        z = found.x[:r]
        z_abs, F = np.abs(z), system.F
        work = z @ G.mid
        slack = (z_abs @ G.rad + k * (z_abs @ np.abs(G.mid))) * (1 + k) * SAFE
        across = F * np.abs(work[p:])
        spread = slack[:p] + (F + system.F_rad) * slack[p:] + system.F_rad * np.abs(work[p:])
        spread += k * (np.abs(work[:p]) + across)
        least = work[:p] - across - spread * (1 + k) * SAFE - TINY
        load = float(z @ h.mid + z_abs @ (h.rad + k * np.abs(h.mid)) * (1 + k) * SAFE + TINY)
        if not np.all(least > 0):
            return None
        return np.asarray(max(load, 0.0) / least * SAFE)

    def all_excluded(self) -> bool:
        """Whether every cell is shown to hold no solution."""
        r = len(self._reach)
        waiting = []
        for face in range(r):
            for side in (-1.0, 1.0):
                low, high = -np.ones(r), np.ones(r)
                low[face] = high[face] = side
                waiting.append((low, high))
        for _ in range(_MOST_CELLS):
            if not waiting:
                return True
            look()
            low, high = waiting.pop()
            if self._is_excluded(low, high):
                continue
            wide = int(np.argmax((high - low) * np.max(np.abs(self._G), axis=1)))
            if not high[wide] - low[wide] > _NARROW:
                return False
            middle = 0.5 * (low[wide] + high[wide])
            below, above = high.copy(), low.copy()
            below[wide] = above[wide] = middle
            waiting += [(low, below), (above, high)]
        return not waiting

    def _is_excluded(self, low: Floats, high: Floats) -> bool:
        """Whether a cell holds no solution."""
        p, middle, half = self._p, 0.5 * (low + high), 0.5 * (high - low)
        # the ends of cells are few binary digits: these sums round nothing
        centre = middle @ self._G
        spread = half @ np.abs(self._G) + self._elastic
        if np.any(centre[:p] - spread[:p] > 0):
            return True
        opened, forward, backward = centre[:p] + spread[:p] < 0, centre > spread, centre < -spread
        rubs = self._system.F > 0
        given = np.where(rubs & forward[p:], FORWARD, np.where(rubs & backward[p:], BACKWARD, UNDECIDED))
        codes = tuple(np.where(opened, OPEN, given).tolist())
        if codes not in self._known:
            self._known[codes] = is_unbalanced(self._system, codes, motion_against(self._system, codes))
        return self._known[codes]
