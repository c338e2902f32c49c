"""Multipliers that may exclude a partial assignment over a piece of alpha in 3D (theory, section 12.9).

Relaxations are those of one alpha. Their multipliers serve around it; what does not serve all of a piece may serve
together with that of others. What is proposed here proves nothing.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import nnls

from enumsol.condensation.space_condensed import EnclosedSpace, SpaceSystem
from enumsol.relaxation.space_relaxation import SpaceEngine
from enumsol.search.space.space_newton import Isotropic
from enumsol.search.space.space_search import SpaceSplitting
from enumsol.search.splitting import ImposedRows
from enumsol.trusted.space.sector_rows import FORCE, FREE, GAP, OF_DISCS, TAU, Row, row_sign, sector_row_terms

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.condensation.space_condensed import AlphaSpace
    from enumsol.relaxation.space_relaxation import SpaceRelaxation
    from enumsol.support.array_types import Codes, Floats
    from enumsol.trusted.space.pieces import AlphaPiece


#: The weight of the squares of multipliers, each by the length of its row, which keeps them bounded.
_RIDGE = 1e-12
#: How often the share of an end in the bound that is made as large as possible is halved.
_HALVINGS = 4
#: Rows of a program at one alpha.
_ROWS = 4096
#: What is used of the alphas, on either side of a relaxation's, at which its multipliers seem to serve.
_USED = Fraction(15, 16), Fraction(63, 64)


class AlphaPoint:
    """The problem at one alpha, for relaxations.

    Parameters
    ----------
    space : AlphaSpace
    alpha : Fraction
    """

    def __init__(self, space: AlphaSpace, alpha: Fraction) -> None:
        self.alpha = alpha
        enclosed = EnclosedSpace.of_problem(space.enclosure, alpha, *space.units)
        self.system = SpaceSystem.in_middle(enclosed, space.units)
        self.engine = SpaceEngine(self.system, _ROWS)
        self.splitting = SpaceSplitting(self.engine)
        self.rows = ImposedRows(self.splitting, self.system.p)
        self._discs = space.discs(alpha).mid

    def root(self, codes: Codes) -> SpaceRelaxation:
        """The relaxation of an assignment."""
        return self.engine.root(*self.rows.over(codes, range(self.system.p)))

    def multipliers(self, relaxation: SpaceRelaxation) -> tuple[list[Row], Floats]:
        """Those of a relaxation, in the variables of a space: tau is less there by the discs' radii, v is more."""
        numbers, values = relaxation.multipliers()
        rows = [self.engine.rows[number] for number in numbers.tolist()]
        return rows, values * np.array([self._factor(row) for row in rows])

    def _factor(self, row: Row) -> float:
        kind, node, _ = row
        disc = float(self._discs[node])
        return 1.0 if kind in (GAP, FORCE) else 1.0 / disc if kind == TAU or kind in OF_DISCS else disc

    def imposed(self, codes: Codes) -> list[Row]:
        """The rows that an assignment imposes."""
        return [self.engine.rows[number] for number in self.rows.over(codes, range(self.system.p))[0]]

    def solution(self) -> Floats | None:
        """Forces of a solution in the units of the problem, (3p,), by Newton's method; no claim."""
        system = self.system
        with np.errstate(all="ignore"):
            y = Isotropic.of(system).solution()
        if y is None:
            return None
        F = system.F / np.where(system.tau >= 0, system.unit[system.tau], 1.0)
        return np.concatenate([y[:, 0], *(F * y[:, 1:]).T]) * np.tile(system.force, 3)


def simplest(low: Fraction, high: Fraction) -> Fraction:
    """The number with the smallest power of two as its denominator from one number to another, larger one."""
    step = Fraction(2) ** math.ceil(math.log2(high - low))
    while True:
        number = math.ceil(low / step) * step
        if number <= high:
            return number
        step /= 2


def served(piece: AlphaPiece, alpha: Fraction, rows: Sequence[Row], values: Floats) -> tuple[Fraction, Fraction] | None:
    """The part of a piece, around one alpha of it, at which multipliers seem to exclude; None if there is none.

    The bound (12.21) is a concave square in alpha.
    """
    low, high = piece.ends
    columns = [_columns(end, rows) for end in (low, high)]
    loads = np.array([end.g + A @ values for end, (A, _) in zip((low, high), columns, strict=True)])
    squares = -0.25 * loads @ low.inverse @ loads.T
    first, last = (float(-own @ values) for _, own in columns)
    # of t from 0 to 1: value + slope t + bend t^2
    value = float(squares[0, 0]) + first
    slope = 2.0 * float(squares[0, 1] - squares[0, 0]) + last - first
    bend = float(squares[0, 0] - 2.0 * squares[0, 1] + squares[1, 1])
    length = piece.high - piece.low
    t = float((alpha - piece.low) / length) if length else 0.0
    here = value + (slope + bend * t) * t
    if not here > 0:
        return None
    ends = []
    for end, bound, side in ((piece.low, value, -1.0), (piece.high, value + slope + bend, 1.0)):
        far = _zero(here, slope + 2.0 * bend * t, bend, side) if not bound > 0 else 0.0
        if not bound > 0 and not far:
            return None
        ends.append(simplest(*sorted(alpha + share * Fraction(far) * length for share in _USED)) if far else end)
    return ends[0], ends[1]


def _zero(value: float, slope: float, bend: float, side: float) -> float:
    """The zero of value + slope u + bend u^2 next to 0 on a side, with value > 0; 0 if there is none."""
    root = slope * slope - 4.0 * bend * value
    below = slope * side - np.sqrt(root) if 0 <= root < np.inf else 0.0
    found = -2.0 * value / below if below else 0.0
    return float(side * found) if found > 0 else 0.0


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
