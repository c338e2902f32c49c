"""Forces in 3D that are in balance with a load, or not (theory, section 14.6)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, gamma
from enumsol.model.sectors import SECTORS, direction, end_number
from enumsol.trusted.space.sector_rows import FRICTIONLESS, OPEN, SLIP_MINUS, SLIP_PLUS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.condensation.space_condensed import EnclosedSpace, PieceSpace
    from enumsol.support.array_types import Floats

#: A disc of forces lies in a polygon of so many corners.
_CORNERS = 16


def is_unbalanced_in_space(system: EnclosedSpace | PieceSpace, codes: Sequence[int], z: Floats) -> bool:
    """True if no forces below a partial assignment are in balance with the load, by z (r,); see theory, (14.7).

    z'h > 0, and z'G y <= 0 for all y of every node: (1, tau) with tau in the disc, or on the arc of its sector. Proven
    at both ends of a piece of alpha, it is so in between (theory, section 14.14).
    """
    with np.errstate(over="ignore", invalid="ignore"):
        (G, h), p, k = (system.rows.G, system.rows.h), system.p, gamma(len(z) + 16)
        z_abs = np.abs(z)
        load = float(z @ h.mid - (z_abs @ (h.rad + k * np.abs(h.mid))) * (1 + k) * SAFE - TINY)
        work = z @ G.mid / system.unit
        size = z_abs @ (np.abs(G.mid) + G.rad) / system.unit
        # what underflows is less, and nothing of it is left where all is zero
        slack = np.where(size > 0, (z_abs @ G.rad / system.unit + k * size) * (1 + k) * SAFE + TINY, 0.0)
        across, spread = system.tangential(work), system.tangential(slack).sum(axis=1)
        length = np.sqrt(np.sum(across * across, axis=1)) * (1 + 8 * UNIT) * SAFE
        # a direction in floats, and products with it, are off by less
        spread = (spread + 8 * UNIT * length) * SAFE
        most, discs = work[:p] + slack[:p], system.discs
        radii = np.stack([discs.mid - discs.rad * SAFE, discs.mid + discs.rad * SAFE])
    if not load > 0:
        return False
    for i, code in enumerate(codes):
        if code == OPEN:
            continue
        friction = _most_friction(code, across[i], float(length[i]), float(spread[i]))
        friction = max(float(radius) * friction for radius in radii[:, i])
        # products and their sum are rounded by less than their parts' units
        if not float(most[i]) + friction + 8 * UNIT * (abs(float(work[i])) + abs(friction)) <= 0:
            return False
    return True


def _most_friction(code: int, across: Floats, length: float, spread: float) -> float:
    """Maximum of across . tau for the tau of a node of this code, |tau| <= 1."""
    if code == FRICTIONLESS:
        return 0.0
    if code in (SLIP_PLUS, SLIP_MINUS):  # one component only: the other one is zero
        return float(across[0] + across[1]) * (1.0 if code == SLIP_PLUS else -1.0) + spread
    if code > SECTORS:
        (a1, a2), (b1, b2) = direction(code - SECTORS), direction(end_number(code - SECTORS))
        x, y = across.tolist()
        if min(a1 * y - a2 * x, x * b2 - y * b1) < -spread:
            # it points out of the sector, so that an end is the best
            return float(max(x * a1 + y * a2, x * b1 + y * b2)) + spread
    return length + spread


def unbounded(system: EnclosedSpace) -> EnclosedSpace:
    """The system without bounds of the rigid displacement."""
    return system.reaching(np.full_like(system.reach, np.inf))


def resultants(system: EnclosedSpace | PieceSpace, codes: Sequence[int]) -> list[Floats]:
    """Resultants G y, (r,) each, whose cone holds all that the forces of an assignment can have, but for rounding."""
    G, discs = system.rows.G.mid / system.unit, system.discs.mid.tolist()
    found = []
    for i, code in enumerate(codes):
        if code == OPEN:
            continue
        places = [int(t) for t in system.tau[i] if t >= 0]
        found += [
            G[:, i] + discs[i] * sum((x * G[:, t] for x, t in zip(tau, places, strict=True)), 0.0 * G[:, i])
            for tau in _corners(code, len(places))
        ]
    return found


def _corners(code: int, tangents: int) -> list[tuple[float, ...]]:
    """Corners of a polygon around the tau of a node, |tau| <= 1."""
    if code == FRICTIONLESS or not tangents:
        return [(0.0,) * tangents]
    if tangents == 1:
        return [(sign,) for sign in (1.0, -1.0) if code != (SLIP_MINUS if sign > 0 else SLIP_PLUS)]
    if code > SECTORS:
        a, b = (np.array(direction(n)) for n in (code - SECTORS, end_number(code - SECTORS)))
        return [tuple(corner) for corner in (a, b, (a + b) / (1.0 + a @ b))]
    angles = 2.0 * np.pi * np.arange(_CORNERS) / _CORNERS
    return list(zip(*(np.array([np.cos(angles), np.sin(angles)]) / np.cos(np.pi / _CORNERS)).tolist(), strict=True))
