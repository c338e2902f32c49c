"""A-priori rounding-error bounds of IEEE double arithmetic, and what is proven with them (theory, sections 4 and 6).

The bounds hold for rounding to nearest, any order of summation and fused multiply-adds, so ordinary dense kernels may
be used. A ball is a pair of arrays (midpoint, radius).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

#: Unit roundoff of double arithmetic.
UNIT = 2.0**-53
#: Covers the rounding of bounds themselves: sums of up to 2^12 nonnegative terms and some operations more.
SAFE = 1.0 + 2.0**-40
#: Covers underflow in the products of scaled data (even where subnormal numbers are flushed to zero).
TINY = 2.0**-960
#: The same for the norms of such data.
ROOT_TINY = 2.0**-480


def gamma(k: int) -> float:
    """Bound k u / (1 - k u) on the relative error of k operations."""
    return k * UNIT / (1.0 - k * UNIT) * SAFE


def upper_sum(values: Array, axis: int | None = None) -> Any:
    """Upper bound of a sum of nonnegative floats."""
    count = values.size if axis is None else values.shape[axis]
    return np.sum(values, axis=axis) * (1.0 + gamma(count + 2)) * SAFE + TINY


def upper_norm(values: Array, axis: int | None = None) -> Any:
    """Upper bound of the Euclidean norm."""
    return np.sqrt(upper_sum(values * values, axis=axis)) * SAFE


class SlicedMatrix:
    """A sparse matrix, cut for residuals in about twice the working precision.

    A and X are cut into three slices, A1 + A2 + A3 and X1 + X2 + X3: the leading bits, those that follow, both as
    multiples of one unit in every row of A and column of X and few enough that A1 X1, A1 X2 and A2 X1 are summed
    without any rounding (Ozaki and others 2012), and what is left, which is small.
    """

    def __init__(self, A: sp.csr_array) -> None:
        longest = int(np.max(np.diff(A.indptr), initial=0))
        rows = np.repeat(np.arange(A.shape[0]), np.diff(A.indptr))

        def of_rows(data: Array) -> sp.csr_array:
            return sp.csr_array((data, A.indices, A.indptr), shape=A.shape)

        def largest(data: Array) -> Array:
            return np.asarray(of_rows(np.abs(data)).max(axis=1).toarray().ravel()[rows])

        self._bits = (52 - longest.bit_length()) // 2
        self._longest = longest
        self._slices = [of_rows(data) for data in _slices(A.data, largest, self._bits)]
        self._sums = [upper_sum_of_rows(part) for part in self._slices]

    def residual(self, X: Array, K: Array) -> tuple[Array, Array]:
        """K - A X as a ball."""
        A1, A2, A3 = self._slices
        X1, X2, X3 = _slices(X, _largest_of_columns, self._bits)
        value, correction, lost = K, np.zeros_like(K), np.zeros_like(K)
        for exact in (A1 @ X1, A1 @ X2, A2 @ X1):
            value, error = _two_sum(value, -exact)
            correction, lost = correction + error, lost + np.abs(error)
        later = X2 + X3
        rest = A1 @ X3 + A2 @ later + A3 @ X
        value = value + (correction - rest)
        size = sum(map(np.outer, self._sums, map(_largest_of_columns, (X3, later, X))))
        k = gamma(self._longest + 5)
        radius = 2.0 * UNIT * np.abs(value) + 4.0 * UNIT * (lost + np.abs(rest)) + k * size * (1.0 + k)
        return value, (radius + (8 * self._longest + 8) * TINY) * SAFE


def _slices(values: Array, largest: Callable[[Array], Array], bits: int) -> tuple[Array, Array, Array]:
    """Values as a sum without rounding: of leading bits, of as many that follow, and of the rest."""
    first = _leading(values, largest(values), bits)
    rest = values - first
    second = _leading(rest, largest(rest), bits)
    return first, second, rest - second


def _largest_of_columns(values: Array) -> Array:
    return np.asarray(np.max(np.abs(values), axis=0, initial=0.0))


def _leading(values: Array, size: Array, bits: int) -> Array:
    """Values rounded to multiples of unit, a power of two with size <= 2^bits unit; the difference is exact."""
    unit = np.ldexp(1.0, np.maximum(np.frexp(size)[1] - bits, -1020))
    return np.asarray(np.rint(values / unit) * unit)


def upper_sum_of_rows(matrix: sp.csr_array) -> Array:
    """Upper bounds of the sums of the absolute values of the rows."""
    sums = np.asarray(abs(matrix).sum(axis=1)).ravel()
    return np.asarray(sums * (1.0 + gamma(matrix.shape[1] + 2)) * SAFE + TINY)


def _two_sum(a: Array, b: Array) -> tuple[Array, Array]:
    s = a + b
    z = s - a
    return s, (a - (s - z)) + (b - z)


def factor_above(M: Array, shift: float = 0.0) -> Array | None:
    """The Cholesky factor of M - shift I; None where the factorization does not run to its end."""
    try:
        return np.asarray(np.linalg.cholesky(M - shift * np.eye(len(M)) if shift else M))
    except np.linalg.LinAlgError:
        return None


def dense_eigenvalue_bound(S: Array) -> float:
    """Lower bound on the smallest eigenvalue of a symmetric dense matrix; at most 0 when none positive was proven.

    A Cholesky factorization of S - mu I that runs to its end proves S - mu I >= -gamma trace (Rump 2006).
    """
    n = len(S)
    try:
        estimate = float(np.linalg.eigvalsh(S)[0])
    except np.linalg.LinAlgError:
        return 0.0
    slack = gamma(n + 2) / (1 - gamma(n + 2)) * float(np.trace(np.abs(S))) * SAFE + TINY
    shift = 0.9 * estimate
    for _ in range(4):
        if not shift > slack:
            break
        if factor_above(S, shift) is not None:
            # forming the shifted diagonal rounds once, and so do the two differences here
            return (shift - slack - 4 * UNIT * (float(np.max(np.abs(np.diagonal(S)))) + shift)) / SAFE
        shift *= 0.5
    return 0.0


def sparse_eigenvalue_bound(A: sp.csc_array, estimate: float) -> float:
    """Lower bound on the smallest eigenvalue of a sparse symmetric matrix, from one factorization of A - mu I.

    With A - mu I = L U + E and U = D L' up to rounding, positive pivots D prove A - mu I >= -||E||; the bound
    |E| <= gamma_k |L| |U| (Higham, Theorem 9.3) is summed by rows and columns.
    """
    n = A.shape[0]
    largest = float(np.max(np.abs(A.diagonal())))
    shift = 0.5 * estimate
    for _ in range(6):
        shifted = sp.csc_array(A - shift * sp.eye_array(n, format="csc"))
        error = _factor_error(shifted)
        if error is not None:
            bound = (shift - error - 4 * UNIT * (largest + shift)) / SAFE
            if bound > 0:
                return float(bound)
        shift *= 0.25
    return 0.0


def _factor_error(A: sp.csc_array) -> float | None:
    """Bound on ||A - L D L'|| with D > 0, or None when the factorization fails."""
    options = {"SymmetricMode": True, "Equil": False}
    try:
        lu = spla.splu(A, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
    except RuntimeError:  # exactly singular
        return None
    L, U = sp.csc_array(lu.L), sp.csc_array(lu.U)
    d = U.diagonal()
    if not np.array_equal(lu.perm_r, lu.perm_c) or not np.all(d > 0) or not np.all(np.isfinite(U.data)):
        return None
    del lu  # its own copy of the factors would stand beside L and U
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        k = int(np.max(np.bincount(L.indices))) + 2
        # U' D^{-1} should be L; the columns of U are the rows of U'
        mirrored = sp.csr_array((U.data * (1.0 / d)[U.indices], U.indices, U.indptr), shape=U.shape)
        difference = sp.csr_array(mirrored - L.tocsr())
        del mirrored
        for matrix in (difference, L, U):
            np.abs(matrix.data, out=matrix.data)
        product = _product_norm(L, U)
        # and the rounding of the quotients and of the difference, whose sizes are those of U' D^{-1} and of the result
        rest = _product_norm(L, sp.csc_array(sp.diags_array(d) @ difference.T)) * (1.0 + 8 * UNIT) + 8 * UNIT * product
        error = float((gamma(k) * product + rest) * (1.0 + gamma(k + 4)) * SAFE)
    return error if np.isfinite(error) else None


def _product_norm(left: sp.csc_array, right: sp.csc_array) -> float:
    """Upper bound of ||left right|| for nonnegative matrices, by ||M||^2 <= ||M||_1 ||M||_inf.

    The sums of the rows and columns of the product need no product. For the factors of a finite-element matrix they do
    not grow with its size, as the Frobenius norms of the factors do.
    """
    ones = np.ones(left.shape[0])
    rows = float(np.max(left @ (right @ ones)))
    columns = float(np.max((ones @ left) @ right))
    # two products of nonnegative numbers, each off by at most gamma(n + 1) of itself
    return float(np.sqrt(rows * columns) * (1.0 + 2 * gamma(left.shape[0] + 2)) * SAFE + ROOT_TINY)
