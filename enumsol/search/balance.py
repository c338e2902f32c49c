"""Multipliers for bodies that nothing holds (theory, section 14.5); nothing here is trusted."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from enumsol.trusted.selection import PENETRATION, SLIP_BACKWARD, SLIP_FORWARD
from enumsol.trusted.status_rows import FORBIDDEN, FREE, row_signs

if TYPE_CHECKING:
    from enumsol.condensation.enclosure import EnclosedSystem
    from enumsol.support.array_types import Codes, Floats, Indices

#: Weight of multipliers that are zero, relative to the largest: they change only where the others cannot do it.
_SPARE = 2.0**-20
#: How often multipliers that would change their sign are set to zero, and what is left is balanced again.
_ROUNDS = 8


def in_balance(system: EnclosedSystem, codes: Codes, rows: Indices, values: Floats) -> tuple[Indices, Floats]:
    """Multipliers next to given ones with G y = h, up to rounding, or these where there are none.

    Those of the body on weak springs satisfy this up to the springs only, times the rigid displacement.
    """
    p, G, h = system.p, system.rows.G.mid, system.rows.h.mid
    signs = row_signs(np.array(codes), system.F)
    normal, forward, backward = (signs[:, kind] for kind in (PENETRATION, SLIP_FORWARD, SLIP_BACKWARD))
    low = np.concatenate([normal == FREE, forward != FORBIDDEN])
    high = np.concatenate([normal != FORBIDDEN, backward != FORBIDDEN])
    table = np.bincount(rows, values, minlength=signs.size).reshape(-1, p)
    y = np.concatenate([table[PENETRATION], table[SLIP_BACKWARD] - table[SLIP_FORWARD]])
    size = np.abs(y)
    weight = np.where(low | high, size + _SPARE * np.max(size), 0.0)
    for _ in range(_ROUNDS):
        step = np.linalg.lstsq((G * weight) @ G.T, h - G @ y, rcond=1e-13)[0]
        y = y + weight * (step @ G)
        wrong = np.where(y < 0, ~low, ~high) & (y != 0)
        if not np.any(wrong):
            break
        y, weight = np.where(wrong, 0.0, y), np.where(wrong, 0.0, weight)
    else:
        return rows, values
    forces = rows < PENETRATION * p
    kind = np.repeat([PENETRATION, SLIP_BACKWARD], p)
    kind[p:][y[p:] < 0] = SLIP_FORWARD
    given, of = np.flatnonzero(y), np.tile(np.arange(p), 2)
    sizes = np.where(kind == PENETRATION, y, np.abs(y))
    return np.concatenate([rows[forces], kind[given] * p + of[given]]), np.concatenate([values[forces], sizes[given]])
