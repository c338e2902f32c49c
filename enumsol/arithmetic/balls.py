"""A-priori rounding-error bounds of IEEE double arithmetic, and what is proven with them (theory, sections 4 and 6).

The bounds hold for rounding to nearest, any order of summation and fused multiply-adds, so ordinary dense kernels may
be used. A ball is a pair of arrays (midpoint, radius), and `Ball` has both, with linear systems of balls.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any, SupportsIndex

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from scipy.linalg import cho_solve
from scipy.linalg.lapack import dgetrf, dtrtri

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import ArrayLike, NDArray

    from enumsol.arithmetic._balls import Pair

    Array = NDArray[np.float64]
    Places = SupportsIndex | slice | list[int] | NDArray[Any]
    Index = Places | tuple[Places | None, ...]
else:
    try:
        from enumsol.arithmetic._balls import Pair
    except ImportError:
        from enumsol.arithmetic.plain_pairs import Pair

#: Unit roundoff of double arithmetic.
UNIT = 2.0**-53
#: Covers the rounding of bounds themselves: sums of up to 2^12 nonnegative terms and some operations more.
SAFE = 1.0 + 2.0**-40
#: Covers underflow in the products of scaled data (even where subnormal numbers are flushed to zero).
TINY = 2.0**-960
#: The same for the norms of such data, 2^-480.
ROOT_TINY = float(np.sqrt(TINY))


def gamma(k: int) -> float:
    """Bound k u / (1 - k u) on the relative error of k operations."""
    return k * UNIT / (1.0 - k * UNIT) * SAFE


def upper_sum(values: Array, axis: int | None = None) -> Any:
    """Upper bound of a sum of nonnegative floats."""
    count = values.size if axis is None else values.shape[axis]
    return np.add.reduce(values, axis=axis) * (1.0 + gamma(count + 2)) * SAFE + TINY


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
    estimate = _smallest_eigenvalue(S)
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


def _smallest_eigenvalue(S: Array) -> float:
    """An estimate of the smallest eigenvalue of a symmetric dense matrix, which need not be near if it is large."""
    if len(S) <= 500:  # all eigenvalues of larger ones take longer than some steps of inverse iteration
        try:
            return float(np.linalg.eigvalsh(S)[0])
        except np.linalg.LinAlgError:
            return 0.0
    L, x, size = factor_above(S), np.ones(len(S)), np.sqrt(len(S))
    if L is None:
        return 0.0
    for _ in range(8):
        x = cho_solve((L, True), x / size, check_finite=False)
        size = np.linalg.norm(x)
    return float(1.0 / size)


def least_eigenvalue(M: Ball) -> float:
    """Lower bound of the smallest eigenvalue of symmetric matrices; at most 0 where none positive is proven."""
    return (dense_eigenvalue_bound(M.mid) - float(upper_norm(M.rad))) / SAFE if M.finite else 0.0


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


#: Entries of |I - R M| must sum to less than this in every row for a selection to count as regular.
_CONTRACTION = 0.5
#: Of rounding in long double, which some processors have no better than double; what an operation adds is half of it.
_LONG = float(np.finfo(np.longdouble).eps)
#: The same for several right-hand sides, in a weighted norm; steps of the power method that finds the weights.
_LARGEST_CONTRACTION, _POWER_STEPS = 0.95, 6


class Ball(Pair):
    """An array with radii; every operation gives a ball that holds all results. It is not to be given other arrays.

    On small arrays of doubles the compiled `Pair` does it, and to the last bit as the numpy code here does.
    """

    __slots__ = ()

    def __repr__(self) -> str:
        return f"Ball(mid={self.mid!r}, rad={self.rad!r})"

    def __reduce__(self) -> tuple[type[Ball], tuple[Array, Array]]:
        return Ball, (self.mid, self.rad)

    @classmethod
    def joined(cls, *parts: Ball) -> Ball:
        """Several balls, one below the other."""
        return cls(np.concatenate([part.mid for part in parts]), np.concatenate([part.rad for part in parts]))

    @classmethod
    def beside(cls, *parts: Ball) -> Ball:
        """Several matrices, one to the right of the other, (n, m)."""
        return cls(np.hstack([part.mid for part in parts]), np.hstack([part.rad for part in parts]))

    def _matrix_multiplied(self, other: Ball) -> Ball:
        k = gamma(self.mid.shape[-1] + 4)
        left, right = np.abs(self.mid), np.abs(other.mid)
        spread = _of_radii(self.rad, right + other.rad) + _of_radii(left, other.rad)
        rad = spread + k * (left @ right)
        return Ball(self.mid @ other.mid, rad * (1.0 + k) * SAFE + TINY)

    def _added(self, other: Ball) -> Ball:
        mid = self.mid + other.mid
        return Ball(mid, (self.rad + other.rad + 2 * UNIT * np.abs(mid)) * SAFE + TINY)

    def _subtracted(self, other: Ball) -> Ball:
        mid = self.mid - other.mid
        return Ball(mid, (self.rad + other.rad + 2 * UNIT * np.abs(mid)) * SAFE + TINY)

    def __neg__(self) -> Ball:
        return Ball(-self.mid, self.rad)

    def _multiplied(self, other: Ball) -> Ball:
        mid = self.mid * other.mid
        rad = np.abs(self.mid) * other.rad + self.rad * (np.abs(other.mid) + other.rad) + 2 * UNIT * np.abs(mid)
        return Ball(mid, rad * SAFE + TINY)

    def __setitem__(self, item: Index, value: Ball | ArrayLike) -> None:
        """Put in a ball, or what is exact."""
        mid, rad = (value.mid, value.rad) if isinstance(value, Ball) else (value, 0.0)
        self.mid[item], self.rad[item] = mid, rad

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the midpoints."""
        return self.mid.shape

    @property
    def ndim(self) -> int:
        """Number of axes."""
        return self.mid.ndim

    def _sized(self) -> Array:
        return np.asarray((np.abs(self.mid) + self.rad) * SAFE)

    @property
    def high(self) -> Array:
        """Upper ends, up to rounding."""
        return self.mid + self.rad

    @property
    def low(self) -> Array:
        """Lower ends, up to rounding."""
        return self.mid - self.rad

    @property
    def finite(self) -> bool:
        """True if all numbers are bounded."""
        return bool(np.all(np.isfinite(self.mid)) and np.all(np.isfinite(self.rad)))

    @property
    def symmetric(self) -> Ball:
        """The symmetric part of square matrices: it lies in the mean of both triangles."""
        mid = 0.5 * (self.mid + self.mid.T)
        return Ball(mid, (np.maximum(self.rad, self.rad.T) + 4 * UNIT * np.abs(mid)) * SAFE)

    def copy(self) -> Ball:
        """Another one that may be changed."""
        return Ball(self.mid.copy(), self.rad.copy())


def _of_radii(one: Array, other: Array) -> Any:
    """A product, which is not formed where one factor is zero and the other bounded: many matrices are exact."""
    idle = any(not np.any(a) and np.all(np.isfinite(b)) for a, b in ((one, other), (other, one)))
    return 0.0 if idle else one @ other


def nearest(exact: Sequence[Fraction]) -> Ball:
    """Balls around the floats next to numbers, of radius zero where these are floats and unbounded beyond them."""
    mid, rad = np.zeros(len(exact)), np.zeros(len(exact))
    for i, number in enumerate(exact):
        try:
            mid[i] = value = float(number)
        except OverflowError:
            rad[i] = np.inf
        else:
            rad[i] = 0.0 if Fraction(value) == number else 2 * UNIT * abs(value) + TINY
    return Ball(mid, rad)


def smaller(one: Ball, other: Ball) -> Ball:
    """Entry by entry the ball with the smaller radius, of two that hold the same values."""
    first = one.rad <= other.rad
    return Ball(np.where(first, one.mid, other.mid), np.where(first, one.rad, other.rad))


def hull(balls: Sequence[Ball]) -> Ball:
    """The ball that holds all; equal entries are kept as they are."""
    first = balls[0]
    same = np.all([(ball.mid == first.mid) & (ball.rad == first.rad) for ball in balls], axis=0)
    mid = 0.5 * np.min([ball.mid for ball in balls], axis=0) + 0.5 * np.max([ball.mid for ball in balls], axis=0)
    rad = np.max([np.abs(ball.mid - mid) * (1 + 4 * UNIT) + ball.rad for ball in balls], axis=0) * SAFE + TINY
    return Ball(np.where(same, first.mid, mid), np.where(same, first.rad, rad))


@dataclass(frozen=True)
class VerifiedSolution:
    """The solutions of M y = b for all M and b in balls.

    Attributes
    ----------
    y, radius : (n,) arrays
    sign : of det M
    inverse, rounded : (n, n) arrays
        The midpoint and the radius of a matrix R near M^-1, of rows in another order.
    rest : (n,) array
        Bound of |b - M y| in that order.
    defect : (n, n) array
        Bound of |I - R M|.
    """

    y: Array
    radius: Array
    sign: int
    inverse: Array
    rounded: Array
    rest: Array
    defect: Array


def verified_solve(M: Array, M_rad: Array, b: Array, b_rad: Array) -> VerifiedSolution | None:
    """Ball of the solutions of M y = b and the sign of det M, or None when M is not proven regular.

    R = U^{-1} L^{-1} P with explicit triangular approximations has a determinant of known sign; ||I - R M|| < 1 then
    proves M regular and gives det M the same sign.
    """
    n = len(b)
    lu, pivots, _ = dgetrf(M)
    if not np.all(np.isfinite(lu)) or np.any(np.diagonal(lu) == 0):
        return None
    sign = 1 - 2 * (int(np.sum(pivots != np.arange(n))) % 2)
    order = np.arange(n)
    for i, j in enumerate(pivots):
        order[[i, j]] = order[[j, i]]
    lower = np.tril(dtrtri(lu, lower=1, unitdiag=1)[0], -1) + np.eye(n)
    upper = np.triu(dtrtri(lu)[0])
    if not (np.all(np.isfinite(lower)) and np.all(np.isfinite(upper))) or np.any(np.diagonal(upper) == 0):
        return None
    negative = int(np.sum(np.diagonal(upper) < 0))
    MP, MP_rad, bP, bP_rad = M[order], M_rad[order], b[order], b_rad[order]
    k = gamma(3 * n + 6)
    product = upper @ (lower @ MP)
    reach = np.abs(upper) @ np.abs(lower) * (1 + k)
    error = (reach @ (k * np.abs(MP) + MP_rad)) * (1 + k) * SAFE + TINY
    defect = np.abs(np.eye(n) - product) * (1 + 2 * UNIT) + error
    contraction = float(np.max(upper_sum(defect, axis=1)))
    if not contraction < _CONTRACTION:
        return None
    y = upper @ (lower @ bP)
    y = y + upper @ (lower @ (bP - MP @ y))
    # what the rounding of the rest would add is more than all the rest where M is ill-conditioned
    rest = (bP.astype(np.longdouble) - MP.astype(np.longdouble) @ y.astype(np.longdouble)).astype(np.float64)
    size = (np.abs(bP) + np.abs(MP) @ np.abs(y)) * (1 + k)
    rest_rad = (bP_rad + MP_rad @ np.abs(y)) * (1 + k) + (n + 4) * _LONG * size + 2 * UNIT * np.abs(rest) + TINY
    inverse, rounded = upper @ lower, k * reach
    step = np.abs(upper @ (lower @ rest)) + rounded @ np.abs(rest) + (np.abs(inverse) + rounded) @ rest_rad
    step = step * (1 + k) * SAFE + TINY
    # |error| <= step + defect |error|, and ||error|| <= ||step|| / (1 - contraction)
    largest = float(np.max(step)) / (1.0 - contraction) * SAFE
    radius = (step + upper_sum(defect, axis=1) * largest) * SAFE
    rest = (np.abs(rest) + rest_rad) * (1 + k)
    return VerifiedSolution(y, radius, sign * (1 - 2 * (negative % 2)), inverse, rounded, rest, defect)


class Inverse:
    """Systems with a matrix of balls that is proven regular; made by ``of``.

    Attributes
    ----------
    approximate : (n, n) array
        An approximate inverse of the matrix with its columns scaled; no claim rests on its accuracy.
    """

    def __init__(self, M: Ball, scale: Array, approximate: Array, defect: Array, weights: Array, share: float) -> None:
        self.approximate = approximate
        self._M, self._scale, self._defect, self._weights, self._share = M, scale, defect, weights, share

    @classmethod
    def of(cls, M: Ball, approximate: Array | None = None) -> Inverse | None:
        """None where the matrix is not proven regular.

        Parameters
        ----------
        M : Ball of shape (n, n), n > 0
        approximate : that of another matrix with the same midpoints, if it is known
        """
        n = len(M.mid)
        scale = column_scale(M)
        M = Ball(M.mid * scale, M.rad * scale + TINY)
        if approximate is None:
            try:
                approximate = np.asarray(np.linalg.inv(M.mid), dtype=np.float64)
            except np.linalg.LinAlgError:
                return None
        defect = (Ball.exact(approximate) @ M - Ball.exact(np.eye(n))).size
        # weights u > 0 near the Perron vector of the defect: it contracts in the norm max |x| / u if anywhere
        u = np.ones(n)
        for _ in range(_POWER_STEPS):
            u = defect @ u + 1e-3 * u
            u = u / np.max(u) + 1e-9
        contraction = float(np.max(upper_sum(defect * u, axis=1) / u)) * SAFE
        if not contraction < _LARGEST_CONTRACTION:
            return None
        return cls(M, scale, approximate, defect, u, 1.0 - contraction)

    def near(self, B: Array) -> Array:
        """X for which M X is near B; no claim."""
        return np.asarray(self._near(B) * self._scale[:, None])

    def _near(self, B: Array) -> Array:
        first = self.approximate @ B
        # One step of refinement, as in verified_solve: without it M X misses B by as much as the inverse is rounded,
        # and forces X leave a resultant that weak springs turn into a large displacement.
        return np.asarray(first + self.approximate @ (B - self._M.mid @ first))

    def solve(self, B: Ball) -> Ball:
        """All X with M X = B, columns of unknowns."""
        R, X = Ball.exact(self.approximate), Ball.exact(self._near(B.mid))
        return self._within(X.mid, (R @ (B - self._M @ X)).size)

    def whole(self) -> Ball:
        """All inverses."""
        # R M = I - E: M^-1 - R = E R + E (M^-1 - R)
        R, k = self.approximate, gamma(len(self.approximate) + 2)
        return self._within(R, (self._defect @ np.abs(R)) * (1.0 + k) + TINY)

    def _within(self, X: Array, step: Array) -> Ball:
        """X with its error, |error| <= step + defect |error|, columns of unknowns."""
        # with step <= t u in every column |error| <= t u / (1 - contraction)
        u = self._weights
        largest = np.max(step / u[:, None], axis=0) / self._share * SAFE
        rad = (step + upper_sum(self._defect * u, axis=1)[:, None] * largest) * SAFE
        return Ball(X * self._scale[:, None], rad * self._scale[:, None] + TINY)


def solution(M: Ball, B: Ball) -> Ball | None:
    """All X with M X = B, columns of unknowns; None where M is not proven regular."""
    if not len(M.mid):
        return Ball.exact(np.zeros_like(B.mid))
    inverse = Inverse.of(M)
    return None if inverse is None else inverse.solve(B)


def determinant_sign(M: Ball) -> int:
    """The sign of all determinants in a ball, 0 where it is not proven."""
    n = len(M.mid)
    if not n:
        return 1
    scale = column_scale(M)
    solved = verified_solve(M.mid * scale, M.rad * scale + TINY, np.zeros(n), np.zeros(n))
    return 0 if solved is None else solved.sign


def nearly_singular(M: Array) -> bool:
    """True if a finite matrix has a condition number above a million."""
    return bool(np.all(np.isfinite(M))) and not np.linalg.cond(M) < 1e6


def rough_inverse(J: Ball) -> Array:
    """An inverse of J's middle in the rows and directions in which J is surely not singular."""
    known = np.linalg.norm(J.rad, axis=1) < 0.5 * np.linalg.norm(J.mid, axis=1)
    mid, rad = J.mid * known[:, None], J.rad * known[:, None]
    size = float(np.linalg.norm(mid, 2))
    cut = min(1.0, 2.0 * float(np.linalg.norm(rad)) / size + 1e-10) if size > 0 else 1.0
    return np.asarray(np.linalg.pinv(mid, cut))


def column_scale(M: Ball) -> Array:
    """Powers of two by which columns get a size near one."""
    return np.asarray(np.ldexp(1.0, -np.frexp(np.max(np.abs(M.mid), axis=0) + TINY)[1]))
