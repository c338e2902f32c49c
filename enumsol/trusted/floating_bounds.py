"""The exclusion inequality of a body that nothing holds, in floats (theory, section 14.3).

With multipliers y on S lambda - g - G'q and c on lambda, and any z on G lambda - h,

    min e - h'q  >=  B(y, c + G'z) + z'h + min (G y - h)'q

where B is the bound of the body on springs (``trusted.energy_bounds``). The last term vanishes if G y = h, and is at
least -reach'|G y - h| otherwise. Where no forces are in balance with the load, no energy is asked for.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, gamma
from enumsol.trusted.energy_bounds import dots, energy_bounds
from enumsol.trusted.status_rows import BACKWARD, FORWARD, OPEN, SLIP_MINUS, SLIP_PLUS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.arithmetic.balls import Array
    from enumsol.condensation.floating import FloatingSystem


def floating_bounds(system: FloatingSystem, y: Array, c: Array, c_rad: Array, errors: float = 1.0) -> Array:
    """Lower bounds on e - h'q for multipliers y (m, 2p) and c, a ball; as energy_bounds."""
    h, h_rad, k = system.rows.h.mid, system.rows.h.rad, gamma(2 * len(system.g) + 8)
    G, G_rad = system.rows.G.mid, system.rows.G.rad
    moved = np.abs(h - y @ G.T)
    slack = h_rad + np.abs(y) @ G_rad.T + k * (np.abs(h) + np.abs(y) @ np.abs(G).T)
    price = (moved + errors * slack * (1 + k) * SAFE) * SAFE
    # a mode without load that moves no contact node costs nothing, whatever its bound
    cost = np.where(price > 0, price * system.reach, 0.0).sum(axis=1) * (1 + k) * SAFE
    first = _held_bounds(system, y, c, c_rad, errors)[0] - cost
    return np.asarray(np.fmax(first, _balanced_bounds(system, y, c, c_rad, errors)))


def _held_bounds(system: FloatingSystem, y: Array, c: Array, c_rad: Array, errors: float) -> tuple[Array, Array]:
    """B(y, c + G'z) + z'h for the best z, and the size of g, of c + G'z and of their radii."""
    h, h_rad, k = system.rows.h.mid, system.rows.h.rad, gamma(2 * len(system.g) + 8)
    G, G_rad = system.rows.G.mid, system.rows.G.rad
    # any z is a choice
    z = (2 * h - (system.g + c) @ system.inverse.T @ G.T - y @ G.T) @ system.mode_inverse
    z = np.where(np.isfinite(z), z, 0.0)
    z_abs = np.abs(z)
    size = np.abs(c) + z_abs @ np.abs(G)
    all_c, all_c_rad = c + z @ G, (c_rad + z_abs @ G_rad + k * size) * (1 + k) * SAFE
    lifted = z @ h - errors * (z_abs @ (h_rad + k * np.abs(h))) * (1 + k) * SAFE - TINY
    # the better one of both: what is added may be less than zero
    own = energy_bounds(system, y, all_c, all_c_rad, errors, enough=np.inf)
    bounds = own + lifted - 4 * UNIT * (np.abs(own) + np.abs(lifted))
    return bounds, np.abs(system.g) + system.g_rad + np.abs(all_c) + all_c_rad


def _balanced_bounds(system: FloatingSystem, y: Array, c: Array, c_rad: Array, errors: float) -> Array:
    """Bounds for the multipliers next to y that satisfy G y = h exactly; -inf where these are not shown to exist.

    They are y + |y| G's: every component keeps its sign as long as |G's| <= 1. A first step is taken in floats. What it
    leaves is enclosed: with W = G |y| G' and an approximate inverse R, ||I - R W|| < 1/2 gives ||s|| <= 2 ||R rest||.
    """
    G, G_rad = system.rows.G.mid, system.rows.G.rad
    h, h_rad, k = system.rows.h.mid, system.rows.h.rad, gamma(2 * len(system.g) + 8)
    G_abs = np.abs(G) + G_rad
    # modes without load that move no contact node ask for nothing
    used = np.flatnonzero(np.any(G_abs > 0, axis=1) | (np.abs(h) + h_rad > 0))
    G, G_rad, G_abs, h, h_rad = G[used], G_rad[used], G_abs[used], h[used], h_rad[used]
    m = len(y)
    if not len(used):
        return _held_bounds(system, y, c, c_rad, errors)[0]
    turn = np.einsum("mrs,ms->mr", _inverses(G, np.abs(y)), h - y @ G.T) @ G
    small = np.all(np.abs(turn) < 0.5, axis=1)
    y = y * (1.0 + np.where(small[:, None], turn, 0.0))
    y_abs = np.abs(y)
    W, R = _weighted(G, y_abs), _inverses(G, y_abs)
    W_rad = (
        k * _weighted(np.abs(G), y_abs) + 2 * _product(G_rad, y_abs, G_abs) + 2 * _product(G_abs, y_abs, G_rad)
    ) * (1 + k) * SAFE + TINY
    R_abs, j = np.abs(R), gamma(len(used) + 4)
    defect = np.abs(np.eye(len(used)) - R @ W) + j * (R_abs @ np.abs(W)) + R_abs @ W_rad
    sure = np.all(np.sum(defect * (1 + j) * SAFE, axis=2) < 0.5, axis=1)
    rest = np.abs(h - y @ G.T) + h_rad + y_abs @ G_rad.T + k * (np.abs(h) + y_abs @ np.abs(G).T)
    step = 2 * np.max(np.einsum("mrs,ms->mr", R_abs, rest), axis=1) * (1 + k) * (1 + j) * SAFE * SAFE
    share = step[:, None] * G_abs.sum(axis=0) * (1 + j) * SAFE
    sure &= small & np.all(share <= 1.0 / errors, axis=1)
    change = y_abs * share * SAFE + TINY * (y_abs > 0)
    bounds, size = _held_bounds(system, y, c, c_rad, errors)
    S_abs = np.abs(system.S) + system.S_rad
    slope = 0.5 * (size + (y_abs + change) @ S_abs)
    loss = dots(change, slope) * (1 + k) * SAFE * SAFE
    return np.where(sure & (np.isfinite(loss)), bounds - errors * loss, np.full(m, -np.inf))


def is_unbalanced(system: FloatingSystem, codes: Sequence[int], z: Array) -> bool:
    """Whether no forces below a partial assignment are in balance with the load, by z (r,); see theory, (14.7).

    z'h > 0, and z'G lambda <= 0 for the forces that span those of every node: (1, F) or (1, -F), or (1, 0) where F = 0.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        (G, h), p, k = (system.rows.G, system.rows.h), system.p, gamma(len(z) + 8)
        z_abs = np.abs(z)
        load = float(z @ h.mid - (z_abs @ (h.rad + k * np.abs(h.mid))) * (1 + k) * SAFE - TINY)
        work = z @ G.mid
        size = z_abs @ (np.abs(G.mid) + G.rad)
        slack = (z_abs @ G.rad + k * size) * (1 + k) * SAFE
        normal, across, F = work[:p], work[p:], system.F
        spread = slack[:p] + (F + system.F_rad) * slack[p:] + system.F_rad * np.abs(across)
        spread += k * (np.abs(normal) + F * np.abs(across))
        # what underflows is less, and nothing of it is left where all is zero
        spread = np.where(size[:p] + size[p:] > 0, spread * (1 + k) * SAFE + TINY, 0.0)
        most = np.stack([normal, normal + F * across, normal - F * across]) + spread
    given = np.array(codes)
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
    return load > 0 and bool(np.all(most[rays] <= 0))


def _weighted(G: Array, weights: Array) -> Array:
    """G diag(weights) G' for every row of weights."""
    return _product(G, weights, G)


def _product(left: Array, weights: Array, right: Array) -> Array:
    return np.asarray(np.einsum("ri,mi,si->mrs", left, weights, right))


def _inverses(G: Array, weights: Array) -> Array:
    """Approximate inverses of G diag(weights) G'; what is not finite proves nothing."""
    W = _weighted(G, weights)
    W = np.where(np.isfinite(W), W, 0.0)
    return np.asarray(np.linalg.pinv(W, rcond=1e-13, hermitian=True))
