"""The exclusion inequality of a body that nothing holds, in floats (theory, section 14.3).

With multipliers y on S lambda - g - G'q and c on lambda, and any z on G lambda - h,

    min e - h'q  >=  B(y, c + G'z) + z'h + min (G y - h)'q

where B is the bound of the body on springs (``trusted.energy_bounds``). The last term vanishes if G y = h, and is at
least -reach'|G y - h| otherwise. Where no forces are in balance with the load, no energy is asked for.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball, gamma
from enumsol.trusted.energy_bounds import dots, energy_bounds
from enumsol.trusted.status_rows import BACKWARD, FORWARD, OPEN, SLIP_MINUS, SLIP_PLUS

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
    """How far the bound may sag between two ends, (m,), for multipliers that are affine in alpha."""
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
    G_abs, k = np.abs(G.mid) + G.rad, gamma(2 * G.shape[1] + 8)
    # modes without load that move no contact node ask for nothing
    used = np.flatnonzero(np.any(G_abs > 0, axis=1) | (np.abs(h.mid) + h.rad > 0))
    (G_mid, G_rad), G_abs, (h_mid, h_rad) = (G.mid[used], G.rad[used]), G_abs[used], (h.mid[used], h.rad[used])
    if not len(used):
        return y, np.zeros_like(y), np.ones(len(y), dtype=bool)
    turn = np.einsum("mrs,ms->mr", _inverses(G_mid, np.abs(y)), h_mid - y @ G_mid.T) @ G_mid
    small = np.all(np.abs(turn) < 0.5, axis=1)
    y = y * (1.0 + np.where(small[:, None], turn, 0.0))
    y_abs = np.abs(y)
    W, R = _weighted(G_mid, y_abs), _inverses(G_mid, y_abs)
    W_rad = (
        k * _weighted(np.abs(G_mid), y_abs) + 2 * _product(G_rad, y_abs, G_abs) + 2 * _product(G_abs, y_abs, G_rad)
    ) * (1 + k) * SAFE + TINY
    R_abs, j = np.abs(R), gamma(len(used) + 4)
    defect = np.abs(np.eye(len(used)) - R @ W) + j * (R_abs @ np.abs(W)) + R_abs @ W_rad
    sure = np.all(np.sum(defect * (1 + j) * SAFE, axis=2) < 0.5, axis=1)
    rest = np.abs(h_mid - y @ G_mid.T) + h_rad + y_abs @ G_rad.T + k * (np.abs(h_mid) + y_abs @ np.abs(G_mid).T)
    step = 2 * np.max(np.einsum("mrs,ms->mr", R_abs, rest), axis=1) * (1 + k) * (1 + j) * SAFE * SAFE
    share = step[:, None] * G_abs.sum(axis=0) * (1 + j) * SAFE
    sure &= small & np.all(share <= 1.0 / errors, axis=1)
    return y, y_abs * share * SAFE + TINY * (y_abs > 0), sure


def is_unbalanced(system: EnclosedSystem, codes: Sequence[int], z: Floats) -> bool:
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


def _weighted(G: Floats, weights: Floats) -> Floats:
    """G diag(weights) G' for every row of weights."""
    return _product(G, weights, G)


def _product(left: Floats, weights: Floats, right: Floats) -> Floats:
    return np.asarray(np.einsum("ri,mi,si->mrs", left, weights, right))


def _inverses(G: Floats, weights: Floats) -> Floats:
    """Approximate inverses of G diag(weights) G'; what is not finite proves nothing."""
    W = _weighted(G, weights)
    W = np.where(np.isfinite(W), W, 0.0)
    return np.asarray(np.linalg.pinv(W, rcond=1e-13, hermitian=True))
