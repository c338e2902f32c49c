"""Rigorous enclosures of the condensed problem, from the user's own A, Bn, Bt, f (theory, section 4.4).

With X an approximation of A^{-1} K, K = [B', f, load_slope], R = K - A X its residual and Y an approximation of
A^{-1} R,

    B A^{-1} K  =  B X  +  B Y  +  B A^{-1} (R - A Y),      |b_i' A^{-1} z|  <=  ||A^{-1} b_i|| ||z||,

where ||A^{-1} b_i|| <= ||X_i + Y_i|| + ||(R - A Y)_i|| / lambda_min(A). So the error is that of the rounding of two
sums and of second order in the residual, which is computed in more than the working precision.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from enumsol.arithmetic.balls import (
    SAFE,
    TINY,
    UNIT,
    dense_eigenvalue_bound,
    gamma,
    residual,
    sparse_eigenvalue_bound,
    upper_norm,
)
from enumsol.checks import alpha_value
from enumsol.condensation.affine import exactly_at
from enumsol.errors import EnumsolError
from enumsol.sealed import Sealed

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from enumsol.arithmetic.balls import Array
    from enumsol.checks import AlphaLike
    from enumsol.condensation.data import CondensableData

#: Columns that are made dense together.
_COLUMNS = 32


class NotEnclosedError(EnumsolError):
    """The data could not be enclosed: A or S is positive definite only within rounding, or float64 overflows."""


@dataclass(frozen=True)
class CondensedEnclosure(Sealed):
    """Balls that hold S, g0 and g1 of a problem for its exact data (theory, section 4.4).

    Attributes
    ----------
    S, S_rad : (2p, 2p) arrays [length / force]
    g0, g0_rad, g1, g1_rad : (2p,) arrays [length]
    stiffness_bound : float
        Proven lower bound on the smallest eigenvalue of A after scaling to a diagonal near one.
    """

    S: Array
    S_rad: Array
    g0: Array
    g0_rad: Array
    g1: Array
    g1_rad: Array
    stiffness_bound: float
    problem: Any = field(repr=False)  # in 2D or 3D

    @classmethod
    def from_problem(cls, problem: CondensableData) -> CondensedEnclosure:
        """Enclose S and g from the problem's own matrices.

        Raises
        ------
        NotEnclosedError
            A is positive definite only within rounding.
        """
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            enclosed = cls._from_problem(problem)
        balls = (enclosed.S, enclosed.S_rad, enclosed.g0, enclosed.g0_rad, enclosed.g1, enclosed.g1_rad)
        if not all(np.all(np.isfinite(array)) for array in balls):
            raise NotEnclosedError(_OVERFLOW)
        return enclosed

    @classmethod
    def _from_problem(cls, problem: CondensableData) -> CondensedEnclosure:
        n = problem.n
        # np.ldexp, and not a power function, gives powers of two by definition
        scale = np.ldexp(1.0, -np.round(0.5 * np.log2(problem.A.diagonal())).astype(int))
        A = _scaled(sp.csr_array(problem.A), scale, scale)
        rows = problem.contact_rows
        size = rows.shape[0]
        B = _scaled(rows, np.ones(size), scale)
        slope = np.zeros(n) if problem.load_slope is None else problem.load_slope
        loads = np.column_stack([_exact_product(array, scale) for array in (problem.f, slope)])
        # loads of size one, so that norms of their residuals neither overflow nor underflow
        lift = np.ldexp(1.0, np.clip(np.frexp(np.max(np.abs(loads), axis=0))[1], -1000, 1000))
        K = sp.hstack([B.T, sp.csc_array(_exact_product(loads, 1.0 / lift))], format="csc")
        # before there are dense columns: the factors of A - mu I are what takes most memory
        bound = sparse_eigenvalue_bound(sp.csc_array(A), _smallest_eigenvalue(problem, scale))
        if not bound > 0:
            raise NotEnclosedError(
                "A is positive definite only within rounding: its smallest eigenvalue, after scaling to a unit "
                "diagonal, could not be proven positive"
            )

        def solve(columns: Array) -> Array:
            # not refined: what is left is bounded
            return np.asarray(problem.factorization.solve(columns / scale[:, None], refined=False) / scale[:, None])

        mid, rad = _products(A, B, K, solve, bound)
        S, S_rad = mid[:, :size], rad[:, :size]
        # the exact S is symmetric and lies in both triangles' balls
        sym = 0.5 * (S + S.T)
        S_rad = (np.maximum(S_rad, S_rad.T) + np.abs(S - S.T) + 2 * UNIT * np.abs(sym)) * SAFE
        offset = np.concatenate([problem.gap, problem.slip_offset.ravel(order="F")])
        free, free_rad = mid[:, size:] * lift, rad[:, size:] * lift + TINY
        # no load moves nothing, exactly: what covers underflow in a norm would be huge beside a tiny load
        still = ~np.any(loads, axis=0)
        free[:, still] = free_rad[:, still] = 0.0
        g0 = free[:, 0] - offset
        g0_rad = (free_rad[:, 0] + 2 * UNIT * np.abs(g0)) * SAFE + TINY
        return cls(sym, S_rad, g0, g0_rad, free[:, 1], free_rad[:, 1], bound, problem)

    def at(self, alpha: AlphaLike, force: Array, length: Array) -> EnclosedSystem:
        """The enclosed system of a 2D problem at one alpha, in units given by powers of two (see ScaledSystem)."""
        a = alpha if isinstance(alpha, Fraction) else Fraction(alpha_value(alpha))
        exact = exactly_at(a, *self.problem.friction)
        try:
            F = np.array([float(x) for x in exact])
        except OverflowError:
            raise NotEnclosedError(_OVERFLOW) from None
        inexact = np.array([Fraction(x) != y for x, y in zip(F.tolist(), exact, strict=True)])
        if np.any(inexact & (F == 0)):
            raise NotEnclosedError("a friction coefficient underflows float64")
        F_rad = np.where(inexact, 2 * UNIT * F + TINY, 0.0)
        S, S_rad, g, g_rad = self.in_units(a, force, length)
        return EnclosedSystem(S, S_rad, g, g_rad, F, F_rad)

    def in_units(self, alpha: Fraction, force: Array, length: Array) -> tuple[Array, Array, Array, Array]:
        """S and g(alpha) with radii, in units of every row given by powers of two.

        Raises
        ------
        NotEnclosedError
            Something over- or underflows.
        """
        if np.any(np.frexp(np.concatenate([force, length]))[0] != 0.5):
            raise AssertionError("units of force and length must be powers of two")
        try:
            value = float(alpha)
        except OverflowError:
            raise NotEnclosedError(_OVERFLOW) from None
        slack = 0.0 if Fraction(value) == alpha else 2 * UNIT * abs(value) + TINY
        with np.errstate(over="ignore", invalid="ignore"):
            g = self.g0 + value * self.g1
            size = np.abs(value * self.g1)
            g_rad = (self.g0_rad + (abs(value) + slack) * self.g1_rad + slack * np.abs(self.g1)) * SAFE
            g_rad = (g_rad + 4 * UNIT * (size + np.abs(g))) * SAFE + TINY
            # scaling rounds nothing but what underflows
            pair = force[:, None] / length[None, :]
            arrays = (self.S * pair, self.S_rad * pair + TINY, g / length, g_rad / length + TINY)
        if not np.all(pair >= _LEAST_PAIR) or not all(np.all(np.isfinite(array)) for array in arrays):
            raise NotEnclosedError(_OVERFLOW)
        return arrays


#: Smallest quotient of units, far above underflow.
_LEAST_PAIR = 2.0**-1000
_OVERFLOW = "the condensed problem over- or underflows float64; expected data in other units"


def _exact_product(values: Array, factor: Array) -> Array:
    """Values times powers of two; refused where that is not exact."""
    product = values * factor
    if not (np.all(np.isfinite(product)) and np.array_equal(product / factor, values)):
        raise NotEnclosedError(_OVERFLOW)
    return np.asarray(product)


def _scaled(matrix: sp.csr_array, left: Array, right: Array) -> sp.csr_array:
    """diag(left) matrix diag(right), exactly, for powers of two."""
    rows = np.repeat(np.arange(matrix.shape[0]), np.diff(matrix.indptr))
    data = _exact_product(matrix.data, left[rows] * right[matrix.indices])
    return sp.csr_array((data, matrix.indices, matrix.indptr), shape=matrix.shape)


def _smallest_eigenvalue(problem: CondensableData, scale: Array) -> float:
    """Estimate of the smallest eigenvalue of the scaled A by inverse iteration."""
    vector = np.random.default_rng(1).normal(size=problem.n)
    value = 1.0
    for _ in range(4):
        vector /= np.linalg.norm(vector)
        image = problem.factorization.solve(vector / scale, refined=False) / scale
        value = 1.0 / float(np.linalg.norm(image))
        vector = image
    return value


def _column_blocks(K: sp.csc_array) -> Iterator[slice]:
    """Columns of K, as many at a time as are made dense."""
    for start in range(0, K.shape[1], _COLUMNS):
        yield slice(start, min(start + _COLUMNS, K.shape[1]))


def _products(
    A: sp.csr_array, B: sp.csr_array, K: sp.csc_array, solve: Callable[[Array], Array], bound: float
) -> tuple[Array, Array]:
    """B A^{-1} K as a ball; of what is n long only a block of columns is dense."""
    n, rows = A.shape[0], B.shape[0]
    k, few = gamma(int(np.max(np.diff(B.indptr))) + 1), gamma(int(np.max(np.diff(A.indptr))) + 3)
    B_size, A_size = abs(B), abs(A)
    mid, rad = np.empty((rows, K.shape[1])), np.empty((rows, K.shape[1]))
    lengths, left = np.empty(K.shape[1]), np.empty(K.shape[1])
    for part in _column_blocks(K):
        columns = K[:, part].toarray()
        X = solve(columns)
        R, R_rad = residual(A, X, columns)
        Y = solve(R)
        first, second = B @ X, B @ Y
        mid[:, part] = first + second
        # what Y leaves of R, with the rounding of this
        R_rad += few * (np.abs(R) + A_size @ np.abs(Y)) * (1 + few) * SAFE
        left[part] = upper_norm(np.abs(R - A @ Y) + R_rad, axis=0) * SAFE
        sizes = np.abs(X) + np.abs(Y)
        rad[:, part] = (k * (B_size @ sizes) * (1 + 2 * k) + 2 * UNIT * np.abs(mid[:, part])) * SAFE
        lengths[part] = (upper_norm(sizes, axis=0) + left[part] / bound) * SAFE
    return mid, (rad + lengths[:rows, None] * left) * SAFE + (n + 2) * TINY


@dataclass(frozen=True)
class EnclosedSystem:
    """The condensed problem at one alpha as balls, in scaled units: w = g - S lambda.

    Attributes
    ----------
    S, S_rad : (2p, 2p) arrays
    g, g_rad : (2p,) arrays
    F, F_rad : (p,) arrays
    """

    S: Array
    S_rad: Array
    g: Array
    g_rad: Array
    F: Array
    F_rad: Array

    @property
    def p(self) -> int:
        """Number of contact nodes."""
        return len(self.F)

    @cached_property
    def smallest_eigenvalue(self) -> float:
        """Proven lower bound on the smallest eigenvalue of every S in the enclosure.

        Raises
        ------
        NotEnclosedError
            S is not proven positive definite.
        """
        with np.errstate(over="ignore", invalid="ignore"):
            bound = (dense_eigenvalue_bound(self.S) - float(upper_norm(self.S_rad))) / SAFE
        if not bound > 0:
            raise NotEnclosedError("the condensed compliance S is positive definite only within rounding")
        return bound

    @cached_property
    def inverse(self) -> Array:
        """Approximate inverse of S; no claim rests on its accuracy."""
        return np.asarray(np.linalg.inv(self.S))

    @cached_property
    def form_error(self) -> float:
        """kappa with |fl(x'S x) - x'S x| <= kappa ||x||^2 for every S in the enclosure.

        Two roundings of inner products of 2p terms would ask for gamma(4p + 2); what is more covers underflow in them.
        """
        size = 4 * len(self.g) + 4
        return float((upper_norm(self.S_rad) + gamma(size) * upper_norm(self.S)) * SAFE)
