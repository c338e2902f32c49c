"""Multipliers that may exclude a partial assignment over a piece of alpha in 3D (theory, section 12.9).

Relaxations are those of one alpha. Their multipliers serve around it; what does not serve all of a piece may serve
together with that of others. What is proposed here proves nothing.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import nnls

from enumsol.condensation.space_condensed import EnclosedSpace, SpaceSystem
from enumsol.proof.leaves import Excluded, Unbalanced
from enumsol.relaxation.space_relaxation import SpaceEngine
from enumsol.search.setup import weakly_held
from enumsol.search.space.space_newton import Isotropic
from enumsol.search.space.space_search import SpaceSplitting
from enumsol.search.splitting import ImposedRows
from enumsol.trusted.floating_bounds import motion_beside
from enumsol.trusted.space.force_bound import resultants
from enumsol.trusted.space.sector_rows import FORCE, FREE, GAP, OF_DISCS, TAU, Row, row_sign, sector_row_terms

if TYPE_CHECKING:
    from collections.abc import Sequence
    from fractions import Fraction

    from enumsol.condensation.space_condensed import AlphaSpace
    from enumsol.relaxation.space_relaxation import SpaceRelaxation
    from enumsol.support.array_types import Codes, Floats
    from enumsol.trusted.space.pieces import AlphaPiece


#: How often a writer of proofs counts errors.
COUNTED = 2.0


class AlphaPoint:
    """The problem at one alpha, for relaxations.

    Parameters
    ----------
    space : AlphaSpace
    alpha : Fraction
    """

    def __init__(self, space: AlphaSpace, alpha: Fraction) -> None:
        self.alpha = alpha
        self.system, self._floats = _relaxed(space, alpha), not space.fixed.held
        # the rows of a program at one alpha
        self.engine = SpaceEngine(self.system, 4096)
        self.splitting = SpaceSplitting(self.engine)
        self.rows = ImposedRows(self.splitting, self.system.p)
        self._discs = space.discs(alpha).mid

    def root(self, codes: Codes) -> SpaceRelaxation:
        """The relaxation of an assignment."""
        return self.engine.root(*self.rows.over(codes, range(self.system.p)))

    def multipliers(self, relaxation: SpaceRelaxation) -> tuple[list[Row], Floats]:
        """Multipliers of a relaxation in the variables of a space: tau is less there by the discs' radii, v is more."""
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
        """Forces of a solution in the units of the problem, (3p,), by Newton's method; no claim.

        None of a body that nothing holds.
        """
        system = self.system
        if self._floats:
            return None
        with np.errstate(all="ignore"):
            y = Isotropic.of(system).solution()
        if y is None:
            return None
        F = system.F / np.where(system.tau >= 0, system.unit[system.tau], 1.0)
        return np.concatenate([y[:, 0], *(F * y[:, 1:]).T]) * np.tile(system.force, 3)


def _relaxed(space: AlphaSpace, alpha: Fraction) -> SpaceSystem:
    """The problem at one alpha, of a body that nothing holds on weak springs (theory, section 14.5)."""
    enclosed = EnclosedSpace.of_problem(space.enclosure, alpha, *space.units)
    S, g = _held(enclosed)
    return replace(SpaceSystem.in_middle(enclosed, space.units), S=S, g=g)


def unbalanced(piece: AlphaPiece, codes: Codes) -> Unbalanced | None:
    """A record that no forces below an assignment are in balance with the load over a piece; or None."""
    for end in () if piece.whole.held else (*piece.ends, piece.whole):
        z = motion_beside(end, resultants(end, codes))
        if piece.is_unbalanced(codes, z):
            return Unbalanced(z)
    return None


class PieceBounds:
    """The numbers (12.21a) of a piece, as functions of multipliers m of rows at its lower, then its upper end, (2 n,).

    They are q'm - |v + B m|^2 / 4; the last one is for what lies between the ends.

    Parameters
    ----------
    piece : AlphaPiece
    codes : (partial) status codes
    rows : sequence of n rows
    """

    def __init__(self, piece: AlphaPiece, codes: Sequence[int], rows: Sequence[Row]) -> None:
        self._free = np.flatnonzero(2 * [row_sign(codes[row[1]], row) == FREE for row in rows])
        (low, high), n = piece.ends, len(rows)
        held, normals, slips = _columns(low, rows)
        discs = [np.r_[end.discs.mid, np.zeros(len(low.g) - len(low.tau))] for end in (low, high)]
        both = [held + disc[:, None] * normals for disc in discs]
        (S, g_low), (_, g_high) = map(_held, (low, high))
        lower = np.linalg.cholesky(S)
        scaled = solve_triangular(lower, np.column_stack([g_low, g_high, *both]), lower=True, check_finite=False)
        g, A = scaled.T[:2], (scaled[:, 2 : 2 + n], scaled[:, 2 + n :])
        own = [-load @ slips for load in (g_low, g_high)]
        none = np.zeros_like(A[0])
        self._v = np.stack([g[0], g[1], 0.5 * (g[0] + g[1])])
        self._B = np.stack([np.hstack([A[0], none]), np.hstack([none, A[1]]), 0.5 * np.hstack([A[1], A[0]])])
        self._q = np.stack([np.r_[own[0], none[0]], np.r_[none[0], own[1]], 0.5 * np.r_[own[1], own[0]]])

    def of(self, m: Floats) -> Floats:
        """The three numbers."""
        return np.asarray(self._q @ m - 0.25 * np.sum((self._v + self._B @ m) ** 2, axis=1))

    def positive(self) -> Floats | None:
        """Multipliers for which all three seem to be positive; None if none are found.

        For fixed weights their mean is largest at the solution of a problem of nonnegative least squares, where
        multipliers without a sign count twice; weights move to the number that is the least.
        """
        size = np.sqrt(np.sum(self._B * self._B, axis=(0, 1))) + 1e-300
        B, q = self._B / size, self._q / size
        B, q = np.concatenate([B, -B[:, :, self._free]], axis=2), np.concatenate([q, -q[:, self._free]], axis=1)
        # squares of multipliers, by the lengths of their rows, keep these bounded
        weight, ridge = np.full(3, 1 / 3), np.sqrt(1e-12)
        for _ in range(6):
            root = np.sqrt(weight)[:, None]
            matrix = np.vstack([*(root[:, :, None] * B), ridge * np.eye(B.shape[2])])
            target = np.concatenate([*(root * self._v), -2.0 / ridge * (weight @ q)])
            try:
                found, _ = nnls(matrix, -target)
            except (RuntimeError, ValueError):
                # it does not end, or something overflows
                return None
            m = found[: len(size)].copy()
            m[self._free] -= found[len(size) :]
            m /= size
            bounds = self.of(m)
            if np.all(bounds > 0):
                return np.asarray(m)
            if not weight @ bounds > 0:
                return None
            weight = weight * np.exp(-bounds / np.max(np.abs(bounds)))
            weight /= np.sum(weight)
        return None


def exclusion(piece: AlphaPiece, codes: Sequence[int], rows: Sequence[Row]) -> Excluded | None:
    """The proof by multipliers of rows that a piece holds no solution; None if none are found."""
    with np.errstate(over="ignore", invalid="ignore"):
        try:
            found = PieceBounds(piece, codes, rows).positive()
        except np.linalg.LinAlgError:
            found = None
    if found is None:
        return None
    low, high = np.split(found, 2)
    if not piece.margin(codes, rows, (low, high), COUNTED) > 0:
        return None
    used = np.flatnonzero((low != 0) | (high != 0))
    return Excluded([rows[k] for k in used.tolist()], np.stack([low[used], high[used]]))


def _columns(system: EnclosedSpace, rows: Sequence[Row]) -> tuple[Floats, Floats, Floats]:
    """Parts of the load that rows add: but for discs, by these, and the rows on w, (m, n) each."""
    size, units = len(system.g), system.row_unit
    columns, normals = np.zeros((2 * size, len(rows))), np.zeros((size, len(rows)))
    for k, row in enumerate(rows):
        for i, coefficient in zip(*sector_row_terms(row, system.tau, size), strict=True):
            of_disc = i == row[1] and row[0] in OF_DISCS
            (normals if of_disc else columns)[i, k] += coefficient * units[i]
    return columns[:size] - _held(system)[0] @ columns[size:], normals, columns[size:]


def _held(system: EnclosedSpace) -> tuple[Floats, Floats]:
    """S and g, of a body that nothing holds on weak springs."""
    if system.held:
        return system.S, system.g
    S, g = weakly_held(system.S, system.g, system.rows)
    return S, g
