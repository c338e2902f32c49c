"""B A^{-1} [B', f, load_slope] in floats, with what bounds its error (theory, section 4.4)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball, SlicedMatrix, gamma, upper_norm
from enumsol.condensation.data import ProblemData
from enumsol.support.array_types import Floats, Mask
from enumsol.support.deadlines import look, tell
from enumsol.support.immutable import Sealed


@dataclass(frozen=True)
class Products(Sealed):
    """S = B A^{-1} B' and what the loads move, as computed, before anything is known of A's smallest eigenvalue.

    With X an approximation of A^{-1} K, K = [B', f, load_slope], R = K - A X its residual and Y an approximation of
    A^{-1} R,

        B A^{-1} K  =  B X  +  B Y  +  B A^{-1} (R - A Y),      |b_i' A^{-1} z|  <=  ||A^{-1} b_i|| ||z||,

    where ||A^{-1} b_i|| <= ||X_i + Y_i|| + ||(R - A Y)_i|| / lambda_min(A). So the error is that of the rounding of two
    sums and of second order in the residual, which is computed in more than the working precision.

    Attributes
    ----------
    mid : (m, m + 2) array
        B X + B Y, of loads divided by ``lift``.
    rounded : (m, m + 2) array
        Bounds of its rounding errors.
    lengths, left : (m + 2,) arrays
        Bounds of ||X + Y|| and ||R - A Y||, A scaled by ``scale`` to a diagonal near one.
    scale : (n,) array of powers of two
    lift : (2,) array of powers of two
    still : (2,) bool array
        Loads that are zero.
    bounded : bool
        Whether the data could be scaled without rounding. Without it nothing bounds the errors.
    """

    mid: Floats
    rounded: Floats
    lengths: Floats
    left: Floats
    scale: Floats
    lift: Floats
    still: Mask
    bounded: bool

    @classmethod
    def of(cls, problem: ProblemData, *, refined: bool = True) -> Products:
        """Products of a problem; if they are not refined, Y = 0, and the error is of first order in the residual."""
        return cls._of(problem, problem.contact_rows.shape[0], refined=refined)

    def with_loads_of(self, problem: ProblemData) -> Products:
        """Products for another load on the same matrices: only the columns of the load are solved for."""
        loads, rows = self._of(problem, 0), len(self.mid)
        columns = {
            name: np.concatenate([getattr(self, name)[..., :rows], getattr(loads, name)], axis=-1)
            for name in ("mid", "rounded", "lengths", "left")
        }
        return replace(loads, **columns, bounded=self.bounded and loads.bounded)

    @classmethod
    def _of(cls, problem: ProblemData, columns: int, *, refined: bool = True) -> Products:
        """Products with the first columns of B' and with the loads."""
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            # np.ldexp, and not a power function, gives powers of two by definition
            exponent = -np.round(0.5 * np.log2(problem.A.diagonal())).astype(int)
            scale = np.ldexp(1.0, exponent)
            A, exact_A = scaled(sp.csr_array(problem.A), scale, scale)
            B, exact_B = scaled(problem.contact_rows, np.ones(problem.contact_rows.shape[0]), scale)
            slope = np.zeros(problem.n) if problem.load_slope is None else problem.load_slope
            loads = np.column_stack([problem.f, slope])
            # loads of size one, so that norms of their residuals neither overflow nor underflow
            size = np.max(np.where(loads != 0, np.frexp(loads)[1] + exponent[:, None], -1000), axis=0)
            lift = np.clip(size, -1000, 1000)
            power = exponent[:, None] - lift
            K = sp.hstack([B.T[:, :columns], sp.csc_array(np.ldexp(loads, power))], format="csc")
            exact_loads = np.array_equal(np.ldexp(np.ldexp(loads, power), -power), loads)

            def solve(columns: Floats) -> Floats:
                # not refined: what is left is bounded
                return np.asarray(problem.factorization.solve(columns / scale[:, None], refined=False) / scale[:, None])

            k = gamma(int(np.max(np.diff(B.indptr))) + 1)
            B_size, sliced = abs(B), SlicedMatrix(A) if refined else None
            mid, rounded = np.empty((B.shape[0], K.shape[1])), np.empty((B.shape[0], K.shape[1]))
            lengths, left = np.empty(K.shape[1]), np.empty(K.shape[1])
            width = problem.factorization.columns
            for start in range(0, K.shape[1], width):
                look()
                tell("columns of A^-1 B'", start, K.shape[1])
                part = slice(start, min(start + width, K.shape[1]))
                given = K[:, part].toarray()
                X = solve(given)
                if sliced is None:
                    image, Y = product(A, X), np.zeros_like(X)
                    rest = given - image.mid
                    R_rad, rest_rad = image.rad, 2 * UNIT * np.abs(rest)
                else:
                    R, R_rad = sliced.residual(X, given)
                    Y = solve(R)
                    rest, rest_rad = sliced.residual(Y, R)
                mid[:, part] = B @ X + B @ Y
                left[part] = upper_norm((np.abs(rest) + rest_rad + R_rad) * SAFE, axis=0) * SAFE
                sizes = np.abs(X) + np.abs(Y)
                rounded[:, part] = (k * (B_size @ sizes) * (1 + 2 * k) + 2 * UNIT * np.abs(mid[:, part])) * SAFE
                lengths[part] = upper_norm(sizes, axis=0) * SAFE
            bounded = exact_A and exact_B and exact_loads
            return cls(mid, rounded, lengths, left, scale, np.ldexp(1.0, lift), ~np.any(loads, axis=0), bounded)

    def radii(self, bound: float) -> Floats:
        """Bounds of all errors, for a lower bound on the smallest eigenvalue of the scaled A."""
        rows = len(self.mid)
        lengths = (self.lengths[:rows] + self.left[:rows] / bound) * SAFE
        return (self.rounded + lengths[:, None] * self.left) * SAFE + (len(self.scale) + 2) * TINY


def scaled(matrix: sp.csr_array, left: Floats, right: Floats) -> tuple[sp.csr_array, bool]:
    """diag(left) matrix diag(right) for powers of two, and whether that is exact."""
    rows = np.repeat(np.arange(matrix.shape[0]), np.diff(matrix.indptr))
    factor = left[rows] * right[matrix.indices]
    data = matrix.data * factor
    exact = bool(np.all(np.isfinite(data))) and np.array_equal(data / factor, matrix.data)
    return sp.csr_array((data, matrix.indices, matrix.indptr), shape=matrix.shape), exact


def product(left: Floats | sp.csr_array, right: Floats) -> Ball:
    """The product of two matrices, the first of which may be sparse, with the error of its sums; zeros are exact."""
    mid = np.asarray(left @ right)
    size = np.asarray(abs(left) @ np.abs(right))
    terms = int(np.max(np.diff(sp.csr_array(left).indptr))) if sp.issparse(left) else left.shape[1]
    k = gamma(terms + 2)
    return Ball(mid, np.where(size > 0, size * k * (1 + 2 * k) * SAFE + TINY, 0.0))
