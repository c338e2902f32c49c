"""Arrays with radii, and linear systems of them, in outward rounding."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.linalg.lapack import dgetrf, dtrtri

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, gamma, upper_sum

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

#: Entries of |I - R M| must sum to less than this in every row for a selection to count as regular.
_CONTRACTION = 0.5
#: Of rounding in long double, which some processors have no better than double; what an operation adds is half of it.
_LONG = float(np.finfo(np.longdouble).eps)
#: The same for several right-hand sides, in a weighted norm; steps of the power method that finds the weights.
_LARGEST_CONTRACTION, _POWER_STEPS = 0.95, 6


@dataclass(frozen=True)
class Ball:
    """An array with radii; every operation gives a ball that holds all results."""

    mid: Array
    rad: Array

    @classmethod
    def exact(cls, mid: Array) -> Ball:
        """No radius."""
        return cls(np.asarray(mid), np.zeros_like(np.asarray(mid)))

    @classmethod
    def joined(cls, *parts: Ball) -> Ball:
        """One below the other."""
        return cls(np.concatenate([part.mid for part in parts]), np.concatenate([part.rad for part in parts]))

    def __matmul__(self, other: Ball) -> Ball:
        k = gamma(self.mid.shape[-1] + 4)
        left, right = np.abs(self.mid), np.abs(other.mid)
        rad = self.rad @ (right + other.rad) + left @ other.rad + k * (left @ right)
        return Ball(self.mid @ other.mid, rad * (1.0 + k) * SAFE + TINY)

    def __add__(self, other: Ball) -> Ball:
        mid = self.mid + other.mid
        return Ball(mid, (self.rad + other.rad + 2 * UNIT * np.abs(mid)) * SAFE + TINY)

    def __sub__(self, other: Ball) -> Ball:
        mid = self.mid - other.mid
        return Ball(mid, (self.rad + other.rad + 2 * UNIT * np.abs(mid)) * SAFE + TINY)

    def __neg__(self) -> Ball:
        return Ball(-self.mid, self.rad)

    def __mul__(self, other: Ball) -> Ball:
        mid = self.mid * other.mid
        rad = np.abs(self.mid) * other.rad + self.rad * (np.abs(other.mid) + other.rad) + 2 * UNIT * np.abs(mid)
        return Ball(mid, rad * SAFE + TINY)

    def __getitem__(self, item: Any) -> Ball:
        return Ball(self.mid[item], self.rad[item])

    def __setitem__(self, item: Any, value: Any) -> None:
        """Put in a ball, or what is exact."""
        exact = not isinstance(value, Ball)
        self.mid[item], self.rad[item] = (value, 0.0) if exact else (value.mid, value.rad)

    @property
    def shape(self) -> tuple[int, ...]:
        """As of an array."""
        return self.mid.shape

    @property
    def ndim(self) -> int:
        """Number of axes."""
        return self.mid.ndim

    @property
    def T(self) -> Ball:  # noqa: N802 (as of an array)
        """The transpose."""
        return Ball(self.mid.T, self.rad.T)

    @property
    def size(self) -> Array:
        """Largest absolute values."""
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
        """Whether all numbers are bounded."""
        return bool(np.all(np.isfinite(self.mid)) and np.all(np.isfinite(self.rad)))

    @property
    def symmetric(self) -> Ball:
        """The symmetric part of square matrices: it lies in the mean of both triangles."""
        mid = 0.5 * (self.mid + self.mid.T)
        return Ball(mid, (np.maximum(self.rad, self.rad.T) + 4 * UNIT * np.abs(mid)) * SAFE)

    def copy(self) -> Ball:
        """Another one that may be changed."""
        return Ball(self.mid.copy(), self.rad.copy())


def smaller(one: Ball, other: Ball) -> Ball:
    """Entry by entry the ball with the smaller radius, of two that hold the same values."""
    first = one.rad <= other.rad
    return Ball(np.where(first, one.mid, other.mid), np.where(first, one.rad, other.rad))


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
        step = (R @ (B - self._M @ X)).size
        # |error| <= step + defect |error|; with step <= t u in every column |error| <= t u / (1 - contraction)
        u = self._weights
        largest = np.max(step / u[:, None], axis=0) / self._share * SAFE
        rad = (step + upper_sum(self._defect * u, axis=1)[:, None] * largest) * SAFE
        return Ball(X.mid * self._scale[:, None], rad * self._scale[:, None] + TINY)


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
    """Whether a finite matrix has a condition number above a million."""
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
