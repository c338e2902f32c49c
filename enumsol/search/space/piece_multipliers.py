"""Multipliers that may exclude a partial assignment over a piece of alpha in 3D (theory, section 12.9).

Those of the middle alone often fail at the ends of a piece. What is proposed here proves nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import nnls

from enumsol.trusted.space.sector_rows import FREE, OF_DISCS, Row, row_sign, sector_row_terms

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.condensation.space_condensed import EnclosedSpace
    from enumsol.support.array_types import Floats
    from enumsol.trusted.space.pieces import AlphaPiece


#: The weight of the squares of multipliers, each by the length of its row, which keeps them bounded.
_RIDGE = 1e-12
#: How often the share of an end in the bound that is made as large as possible is halved.
_HALVINGS = 4


def balanced(piece: AlphaPiece, codes: Sequence[int], rows: Sequence[Row]) -> Floats | None:
    """Multipliers of rows for which the bounds (12.21) at both ends of a piece seem to be positive.

    With h = g + A m a bound is -h' S^-1 h / 4 - q'm, A and q by the rows at that end. A mean of both is largest at the
    solution of a problem of nonnegative least squares, where multipliers without a sign count twice; the smaller one
    is, for the weight at which both are the same.
    """
    both = [_columns(end, rows) for end in piece.ends]
    try:
        lower = np.linalg.cholesky(piece.ends[0].S)
    except np.linalg.LinAlgError:
        return None
    free = np.array([row_sign(codes[row[1]], row) == FREE for row in rows])
    M = np.stack([solve_triangular(lower, A, lower=True) for A, _ in both])
    v = np.stack([solve_triangular(lower, end.g, lower=True) for end in piece.ends])
    q = np.stack([own for _, own in both])
    size = np.sqrt(np.sum(M * M, axis=(0, 1))) + 1e-300
    M, q = M / size, q / size
    M, q = np.concatenate([M, -M[:, :, free]], axis=2), np.concatenate([q, -q[:, free]], axis=1)
    low, high, ridge = 0.0, 1.0, np.sqrt(_RIDGE)
    for _ in range(_HALVINGS):
        share = 0.5 * (low + high)
        weight = np.array([1.0 - share, share])
        root = np.sqrt(weight)
        target = np.concatenate([root[0] * v[0], root[1] * v[1], 2.0 / ridge * (weight @ q)])
        matrix = np.vstack([root[0] * M[0], root[1] * M[1], ridge * np.eye(M.shape[2])])
        try:
            m, _ = nnls(matrix, -target)
        except RuntimeError:
            return None
        bounds = -0.25 * np.sum((v + M @ m) ** 2, axis=1) - q @ m
        if np.all(bounds > 0):
            values = m[: len(rows)].copy()
            values[free] -= m[len(rows) :]
            return np.asarray(values / size)
        if weight @ bounds < 0:
            return None
        low, high = (share, high) if bounds[1] < bounds[0] else (low, share)
    return None


def _columns(system: EnclosedSpace, rows: Sequence[Row]) -> tuple[Floats, Floats]:
    """What each row adds to the load, (m, rows), and its value where y = 0, (rows,)."""
    size, units, discs = len(system.g), system.row_unit, system.discs.mid
    forces, slips = np.zeros((size, len(rows))), np.zeros((size, len(rows)))
    for k, row in enumerate(rows):
        for i, coefficient in zip(*sector_row_terms(row, system.tau, size), strict=True):
            factor = coefficient * units[i]
            if i < size:
                forces[i, k] += factor * (discs[i] if i == row[1] and row[0] in OF_DISCS else 1.0)
            else:
                slips[i - size, k] += factor
    return forces - system.S @ slips, system.g @ slips
