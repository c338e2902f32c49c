"""The exclusion inequality of a body that nothing holds, and bounds of its motion, in floats (theory, section 14.3).

With multipliers y on S lambda - g - G'q and c on lambda, and any z on G lambda - h,

    min e - h'q  >=  B(y, c + G'z) + z'h + min (G y - h)'q

where B is the bound of the body on springs (``energy_bounds``). The last term vanishes if G y = h, and is at
least -reach'|G y - h| otherwise. Where no forces are in balance with the load, no energy is asked for.

Far away the body moves as if it were rigid (theory, section 14.4): w is G'q but for an elastic part that is bounded,
and so the motion tells what most nodes do. Motions are covered by cells; one holds no solution if it makes a node
penetrate, or if no forces with the statuses that it tells are in balance with the load.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball, gamma, upper_norm
from enumsol.condensation.enclosure import NotEnclosedError
from enumsol.support.deadlines import look
from enumsol.trusted.quadratic_forms import dots, energy_bounds
from enumsol.trusted.status_rows import BACKWARD, FORWARD, FRICTIONLESS, OPEN, SLIP_MINUS, SLIP_PLUS, UNDECIDED

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.condensation.enclosure import EnclosedSystem
    from enumsol.support.array_types import Floats, Mask


def floating_bounds(ends: Sequence[EnclosedSystem], y: Floats, c: Floats, c_rad: Floats, errors: float = 1.0) -> Floats:
    """Lower bounds on e - h'q for multipliers y (m, 2p) and c, a ball; as energy_bounds.

    At one alpha, or for all between two, at which g and h are those of the ends (theory, section 14.8).
    """
    none = np.zeros_like(y)
    # between the ends the bound is concave for multipliers that are the same at both
    z = np.mean([balancing(end, y, c) for end in ends], axis=0)
    first = np.min([bounds_within(end, y, none, c, c_rad, errors, z) for end in ends], axis=0)
    # others are affine between the ends
    found = [(end, *balanced(end.rows.G, end.rows.h, y, errors)) for end in ends]
    own = [balancing(end, there, c) for end, there, _, _ in found]
    second = np.min(
        [
            bounds_within(end, there, change, c, c_rad, errors, z, at_balance=True)
            for (end, there, change, _), z in zip(found, own, strict=True)
        ],
        axis=0,
    )
    if len(ends) > 1:
        second = second - _bend(found, own)
    sure = np.all([exists for *_, exists in found], axis=0)
    return np.asarray(np.fmax(first, np.where(sure & np.isfinite(second), second, -np.inf)))


def _bend(found: Sequence[tuple[EnclosedSystem, Floats, Floats, Mask]], z: Sequence[Floats]) -> Floats:
    """Bounds of the sag between two ends, (m,), for multipliers that are affine in alpha."""
    (one, y0, change0, _), (other, y1, change1, _) = found
    k = gamma(len(one.g) + len(one.reach) + 8)
    turned = np.abs(y1 - y0) + change0 + change1
    loaded = np.abs(other.g - one.g) + other.g_rad + one.g_rad
    h0, h1 = one.rows.h, other.rows.h
    work = turned @ loaded + np.abs(z[1] - z[0]) @ (np.abs(h1.mid - h0.mid) + h1.rad + h0.rad)
    return np.asarray(0.25 * work * (1 + k) * SAFE * SAFE + TINY)


def balancing(system: EnclosedSystem, y: Floats, c: Floats) -> Floats:
    """Multipliers z of G lambda - h, (m, r), that are good for these y and c; any z is a choice."""
    G, h = system.rows.G.mid, system.rows.h.mid
    z = (2 * h - (system.g + c) @ system.inverse.T @ G.T - y @ G.T) @ system.mode_inverse
    return np.where(np.isfinite(z), z, 0.0)


def bounds_within(
    system: EnclosedSystem,
    y: Floats,
    y_rad: Floats,
    c: Floats,
    c_rad: Floats,
    errors: float,
    z: Floats | None = None,
    *,
    at_balance: bool = False,
) -> Floats:
    """Lower bounds on e - h'q for a y and a c, both balls, within the bounds of the rigid displacement.

    ``at_balance``: for the y of the ball with G y = h, which are known to exist, at any displacement.
    """
    z = balancing(system, y, c) if z is None else z
    h, h_rad, k = system.rows.h.mid, system.rows.h.rad, gamma(2 * len(system.g) + 8)
    G, G_rad = system.rows.G.mid, system.rows.G.rad
    y_abs, bounds = np.abs(y), np.zeros(len(y))
    if not at_balance:
        moved = np.abs(h - y @ G.T)
        slack = h_rad + y_abs @ G_rad.T + y_rad @ (np.abs(G) + G_rad).T + k * (np.abs(h) + y_abs @ np.abs(G).T)
        price = (moved + errors * slack * (1 + k) * SAFE) * SAFE
        # a mode without load that moves no contact node costs nothing, whatever its bound
        bounds -= np.where(price > 0, price * system.reach, 0.0).sum(axis=1) * (1 + k) * SAFE
    z_abs = np.abs(z)
    size = np.abs(c) + z_abs @ np.abs(G)
    all_c, all_c_rad = c + z @ G, (c_rad + z_abs @ G_rad + k * size) * (1 + k) * SAFE
    lifted = z @ h - errors * (z_abs @ (h_rad + k * np.abs(h))) * (1 + k) * SAFE - TINY
    # the better one of both: what is added may be less than zero
    own = energy_bounds(system, y, all_c, all_c_rad, errors, enough=np.inf)
    bounds += own + lifted - 4 * UNIT * (np.abs(own) + np.abs(lifted))
    # the bound is quadratic in y, with the gradient (g - c - S y) / 2
    slope = np.abs(system.g) + system.g_rad + np.abs(all_c) + all_c_rad
    slope += (y_abs + y_rad) @ (np.abs(system.S) + system.S_rad)
    loss = dots(y_rad, 0.5 * slope) * (1 + k) * SAFE * SAFE
    return np.where(np.isfinite(loss), bounds - errors * loss, -np.inf)


def balanced(G: Ball, h: Ball, y: Floats, errors: float = 1.0) -> tuple[Floats, Floats, Mask]:
    """Multipliers next to y (m, k) of the same signs that satisfy G y = h exactly, as midpoints and radii.

    They are y + |y| G's: every component keeps its sign as long as |G's| <= 1. A first step is taken in floats. What it
    leaves is enclosed: with W = G |y| G' and an approximate inverse R, ||I - R W|| < 1/2 gives ||s|| <= 2 ||R rest||.
    The third array, (m,), says which of them are shown to exist.
    """
    G_mid, G_rad, h_mid, h_rad = G.mid, G.rad, h.mid, h.rad
    G_abs, h_abs, k = np.abs(G_mid) + G_rad, np.abs(h_mid) + h_rad, gamma(2 * G.shape[1] + 8)
    turn = np.einsum("mrs,ms->mr", _inverses(G_mid, np.abs(y)), h_mid - y @ G_mid.T) @ G_mid
    small = np.all(np.abs(turn) < 0.5, axis=1)
    y = y * (1.0 + np.where(small[:, None], turn, 0.0))
    y_abs = np.abs(y)
    W, R = _weighted(G_mid, y_abs), _inverses(G_mid, y_abs)
    W_rad = (
        k * _weighted(np.abs(G_mid), y_abs) + 2 * _product(G_rad, y_abs, G_abs) + 2 * _product(G_abs, y_abs, G_rad)
    ) * (1 + k) * SAFE + TINY
    R_abs, j = np.abs(R), gamma(len(h_abs) + 4)
    # modes without load that move nothing where y is not zero ask for nothing: s is zero there
    asked = (h_abs > 0) | ((y_abs > 0) @ (G_abs > 0).T)
    defect = np.abs(np.eye(len(h_abs)) * asked[:, None, :] - R @ W) + j * (R_abs @ np.abs(W)) + R_abs @ W_rad
    sure = np.all(np.sum(defect * (1 + j) * SAFE, axis=2) < 0.5, axis=1)
    rest = np.abs(h_mid - y @ G_mid.T) + h_rad + y_abs @ G_rad.T + k * (np.abs(h_mid) + y_abs @ np.abs(G_mid).T)
    step = 2 * np.max(np.einsum("mrs,ms->mr", R_abs, rest), axis=1) * (1 + k) * (1 + j) * SAFE * SAFE
    share = step[:, None] * G_abs.sum(axis=0) * (1 + j) * SAFE
    sure &= small & np.all(share <= 1.0 / errors, axis=1)
    return y, y_abs * share * SAFE + TINY * (y_abs > 0), sure


def is_unbalanced(system: EnclosedSystem, codes: Sequence[int], z: Floats) -> bool:
    """True if no forces below a partial assignment are in balance with the load, by z (r,); see theory, (14.7).

    z'h > 0, and z'G lambda <= 0 for the forces that span those of every node: (1, F) or (1, -F), or (1, 0) where F = 0.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        (load, off), normal, turned, spread = _work(system, z)
        most = np.stack([normal, normal + turned, normal - turned]) + spread
    given, F = np.array(codes), system.F
    contact = given != OPEN
    without = contact & (F == 0)
    with_friction = contact & (F != 0)
    rays = np.stack(
        [
            without,
            with_friction & (given != SLIP_MINUS) & (given != BACKWARD),
            with_friction & (given != SLIP_PLUS) & (given != FORWARD),
        ]
    )
    return load - off > 0 and bool(np.all(most[rays] <= 0))


def _work(system: EnclosedSystem, z: Floats) -> tuple[tuple[float, float], Floats, Floats, Floats]:
    """Work z'h of the load on a motion and a bound of its error; of every node that of (1, 0) and of (0, F), errors.

    The last, (p,), bounds the errors of sums and differences of both.
    """
    (G, h), p, k = (system.rows.G, system.rows.h), system.p, gamma(len(z) + 8)
    z_abs, work, F = np.abs(z), z @ G.mid, system.F
    off = float(z_abs @ (h.rad + k * np.abs(h.mid))) * (1 + k) * SAFE * SAFE + TINY
    size = z_abs @ (np.abs(G.mid) + G.rad)
    slack = (z_abs @ G.rad + k * size) * (1 + k) * SAFE
    normal, turned = work[:p], F * work[p:]
    # F is below zero where it vanishes at an end of an interval that is rounded outward
    spread = slack[:p] + (np.abs(F) + system.F_rad) * slack[p:] + system.F_rad * np.abs(work[p:])
    spread += k * (np.abs(normal) + np.abs(turned))
    # what underflows is less, and nothing of it is left where all is zero
    spread = np.where(size[:p] + size[p:] > 0, spread * (1 + k) * SAFE + TINY, 0.0)
    return (float(z @ h.mid), off), normal, turned, spread


def _weighted(G: Floats, weights: Floats) -> Floats:
    """G diag(weights) G' for every row of weights."""
    return _product(G, weights, G)


def _product(left: Floats, weights: Floats, right: Floats) -> Floats:
    return np.asarray(np.einsum("ri,mi,si->mrs", left, weights, right))


def _inverses(G: Floats, weights: Floats) -> Floats:
    """Approximate inverses of G diag(weights) G'; what is not finite proves nothing."""
    W = _weighted(G, weights)
    size = np.sqrt(np.einsum("mrr->mr", W))
    # modes of one size: a mode may be moved by small multipliers only
    unit = 1.0 / np.where(size > 0, size, 1.0)
    W = W * unit[:, :, None] * unit[:, None, :]
    R = np.linalg.pinv(np.where(np.isfinite(W), W, 0.0), rcond=1e-13, hermitian=True)
    return np.asarray(R * unit[:, :, None] * unit[:, None, :])


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
    """True if it is proven that no solution has a coordinate of its rigid displacement beyond its bound."""
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            return _Cells(system).all_excluded()
    except NotEnclosedError:
        return False


def motion_against(system: EnclosedSystem, codes: Sequence[int], other: EnclosedSystem | None = None) -> Floats:
    """A rigid motion against which the load works, and no forces of an assignment do, nor any that are near these.

    What is left of the load after its projection onto the cone of resultants G lambda, which is made wider by a share.
    Whether it is one, ``is_unbalanced`` tells. With ``other`` for the forces at another alpha as well.
    """
    return motion_beside(system, [ray for end in (system, other) if end is not None for ray in _rays(end, codes)])


def motion_beside(system: EnclosedSystem, resultants: Sequence[Floats]) -> Floats:
    """``motion_against`` for forces whose resultants are combinations of these with positive coefficients."""
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
        (load, off), normal, turned, spread = _work(system, found.x[:r])
        least = normal - np.abs(turned) - spread
        return np.asarray(max(load + off, 0.0) / least * SAFE) if np.all(least > 0) else None

    def all_excluded(self) -> bool:
        """True if every cell is shown to hold no solution."""
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
        """True if a cell holds no solution."""
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
