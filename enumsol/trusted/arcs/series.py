"""Conditions of selections over intervals of alpha as polynomials with error bounds (theory, section 7.14).

Selections of about the same size are expanded together, as a stack of matrices; smaller ones are filled up with
equations x = 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from math import comb
from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, Ball, gamma, upper_sum

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from enumsol.support.array_types import Floats, NDArray
    from enumsol.trusted.arcs.selection_balls import ArcSelection

    Asked = tuple[ArcSelection, float, float]

    Signs = NDArray[np.int8]


#: Terms of the series of z, of one that is affine, squarings of its resolvent's bound, and the largest such bound.
_TERMS, _FEW_TERMS, _SQUARINGS, _LARGEST_GROWTH = 16, 2, 6, 1e6
#: Largest coefficients with which sums do not overflow; smallest weights, far above underflow.
_LARGEST, _LEAST = 2.0**1000, 2.0**-480
#: Weights are at least this share of the largest.
_SHARE = 1e-3
#: Sizes are rounded up to multiples of this one; most entries of a stack.
_STEP, _MOST_ENTRIES = 4, 2**20


@dataclass(frozen=True)
class Series:
    """Conditions at alpha = middle + tau radius as polynomials in tau, |tau| <= 1, with bounds of their errors.

    Attributes
    ----------
    middle, radius : float
    coefficients : (m + 1, terms + 1) array
        Conditions of z, and t last.
    error, slope_error : (m + 1,) arrays
        Bounds of the errors of values and of derivatives by tau.
    truncated : bool
        What the series leaves out is the largest part of its error.
    bordered : Ball
        N at the middle.
    """

    middle: float
    radius: float
    coefficients: Floats
    error: Floats
    slope_error: Floats
    truncated: bool
    bordered: Ball


def expand(asked: Sequence[Asked], errors: float) -> list[Series | None]:
    """The series of selections over intervals; None where none is proven. Errors are multiplied by ``errors``."""
    found: list[Series | None] = [None] * len(asked)
    plain = [selection.affine for selection, _, _ in asked]
    for first in (True, False):
        # where M is constant, z is affine with t = 1, unless M is singular
        waiting = [k for k in range(len(asked)) if plain[k] or not first]
        if not first:
            waiting = [k for k in waiting if found[k] is None]
        for group in _groups(asked, waiting):
            stack = _Stack([asked[k] for k in group], _FEW_TERMS if first else _TERMS, errors, plain=first)
            for k, series in zip(group, stack.series(), strict=True):
                found[k] = series
    return found


def _groups(asked: Sequence[Asked], waiting: Sequence[int]) -> Iterator[list[int]]:
    """Numbers of those that are expanded together."""
    sizes: dict[int, list[int]] = {}
    for k in waiting:
        sizes.setdefault(-(-len(asked[k][0].rows.unknown) // _STEP) * _STEP, []).append(k)
    for size, group in sizes.items():
        most = max(1, _MOST_ENTRIES // ((size + 1) * (size + 1 + 3 * asked[group[0]][0].system.p)))
        for first in range(0, len(group), most):
            yield group[first : first + most]


class _Stack:
    """Selections expanded together: b matrices H + tau H1 of k columns, z = (y, filling, t).

    Their rows are the k of N, the conditions and t. Norms are max |x_i| / u_i, by b.
    """

    def __init__(self, asked: Sequence[Asked], terms: int, errors: float, *, plain: bool) -> None:
        self._asked, self._terms, self._errors, self._plain = asked, terms, errors, plain
        self._sizes = [(len(s.rows.unknown), len(s.rows.conditions)) for s, _, _ in asked]
        self._k = -(-max(size for size, _ in self._sizes) // _STEP) * _STEP + 1
        low, high = np.array([part for _, *part in asked]).T
        self._middle = 0.5 * (low + high)
        # so much more that tau stays within [-1, 1] where it is rounded
        self._radius = np.maximum(high - self._middle, self._middle - low) * (1.0 + 2.0**-20) + TINY
        self._H, self._H1, self._H_rad, self._H1_rad = self._forms()
        self._H[:, self._k - 1] = _last_row(self._k) if plain else self._directions()
        # bounds of rounding errors below are themselves rounded, in two products and a few operations
        self._safe = (1.0 + gamma(2 * self._k + 8)) * SAFE

    def _forms(self) -> tuple[Floats, Floats, Floats, Floats]:
        """H and H1 with radii; the last row of N is left empty."""
        k, most = self._k, max(m for _, m in self._sizes)
        found = np.zeros((4, len(self._asked), k + most + 1, k))
        found[0, :, -1, -1] = 1.0
        for b, ((selection, _, _), (size, m)) in enumerate(zip(self._asked, self._sizes, strict=True)):
            for part, form in zip(found[:, b], selection.forms, strict=True):
                part[:size, :size], part[:size, -1] = form[:size, :-1], form[:size, -1]
                part[k : k + m, :size], part[k : k + m, -1] = form[size:, :-1], form[size:, -1]
            filling = np.arange(size, k - 1)
            found[0, b, filling, filling] = 1.0
        H0, H1, H0_rad, H1_rad = found
        middle, radius = self._middle[:, None, None], self._radius[:, None, None]
        moved = middle * H1
        H0_rad += np.abs(middle) * H1_rad + gamma(4) * (np.abs(H0) + np.abs(moved))
        H1_rad = radius * H1_rad + gamma(4) * np.abs(radius * H1)
        return H0 + moved, radius * H1, H0_rad * SAFE + TINY, H1_rad * SAFE + TINY

    def _directions(self) -> Floats:
        """The last rows of N: z at the middle, of length one, so that N is regular even where det M vanishes."""
        M, g = self._H[:, : self._k - 1, :-1], -self._H[:, : self._k - 1, -1:]
        # with infinite entries lapack may not come back
        usable = np.all(np.isfinite(self._H), axis=(1, 2))
        self._H[~usable] = np.nan
        y = _each(np.linalg.solve, M, g)[:, :, 0]
        v = np.concatenate([y, np.ones((len(y), 1))], axis=1)
        for b in np.flatnonzero(usable & ~np.all(np.isfinite(v), axis=1)).tolist():
            try:
                v[b] = np.linalg.svd(self._H[b, : self._k - 1])[2][-1]
            except np.linalg.LinAlgError:
                v[b] = np.nan
        return np.asarray(v / np.linalg.norm(v, axis=1, keepdims=True))

    def series(self) -> list[Series | None]:
        """The series, None where there is none."""
        k, H, H1 = self._k, self._H, self._H1
        H_rad, H1_rad = self._H_rad, self._H1_rad
        H_rad[:, k - 1], H1_rad[:, k - 1] = 0.0, 0.0
        N, N1 = H[:, :k], H1[:, :k]
        R = _each(np.linalg.inv, N)
        Q = R @ N1
        Z, powers = self._guess(R[:, :, -1:], Q)
        sizes = np.sum(np.abs(Z), axis=2)
        u = sizes + _SHARE * np.max(sizes, axis=1, keepdims=True)
        u[~np.all(np.isfinite(u) & (u > _LEAST), axis=1)] = np.nan
        u = u[:, :, None]
        # by how much products with these matrices may be off
        off, off1 = gamma(k + 6) * np.abs(H) + H_rad, gamma(k + 6) * np.abs(H1) + H1_rad
        R_abs = np.abs(R)
        wrong1 = self._norm(R_abs @ (off1[:, :k] @ u), u)
        wrong = self._norm(np.abs(R @ N - np.eye(k)) @ u + R_abs @ (off[:, :k] @ u), u) + wrong1
        growth = self._growth(powers, wrong * SAFE, u)
        # residuals of the truncated series, conditions and t, by powers of tau
        sums = _shifted(H @ Z, H1 @ Z)
        sums[:, k - 1, 0] -= 1.0
        radius = _shifted(off @ np.abs(Z), off1 @ np.abs(Z)) * self._safe + TINY
        rest = sums[:, :k]
        left = np.abs(R @ rest) + R_abs @ (radius[:, :k] + gamma(k + 6) * np.abs(rest))
        share = np.max((left * self._safe + TINY) / u, axis=1) * SAFE + TINY
        degrees = np.arange(self._terms + 1)
        error = growth * upper_sum(share, axis=1) * SAFE
        turning = (self._norm(np.abs(Q) @ u, u) + wrong1) * error
        slope_error = growth * (upper_sum(share * degrees, axis=1) + turning) * SAFE * SAFE
        # |c1| u and |c0| u + |c1| u for the conditions c0 + tau c1
        turn = ((np.abs(H1[:, k:]) + off1[:, k:]) @ u)[:, :, 0] * self._safe + TINY
        reach = ((np.abs(H[:, k:]) + off[:, k:]) @ u)[:, :, 0] * self._safe + TINY + turn
        values, slopes = upper_sum(radius[:, k:], axis=2), upper_sum(radius[:, k:] * degrees, axis=2)
        values = (values + reach * error[:, None]) * SAFE * self._errors
        slopes = (slopes + reach * slope_error[:, None] + turn * error[:, None]) * SAFE * self._errors
        truncated = share[:, -1] > 0.5 * np.sum(share, axis=1)
        return [
            self._one(b, sums[b, k:], values[b], slopes[b], truncated=bool(truncated[b])) if good else None
            for b, good in enumerate(np.isfinite(growth).tolist())
        ]

    def _one(self, b: int, sums: Floats, values: Floats, slopes: Floats, *, truncated: bool) -> Series | None:
        """A series, without what was filled up."""
        size, m = self._sizes[b]
        rows, kept = [*range(m), -1], [*range(size), self._k - 1]
        if not np.max(np.abs(sums)) < _LARGEST:
            return None
        inner = np.ix_(kept, kept)
        return Series(
            middle=float(self._middle[b]),
            radius=float(self._radius[b]),
            coefficients=sums[rows],
            error=values[rows],
            slope_error=slopes[rows],
            truncated=truncated,
            bordered=Ball(self._H[b][inner], self._H_rad[b][inner]),
        )

    def _guess(self, z: Floats, Q: Floats) -> tuple[Floats, list[Floats]]:
        """The series of z, z_k = -Q z_(k-1), and powers Q, Q^2, Q^4, ...; no claim rests on its accuracy."""
        Z, powers = np.concatenate([z, -Q @ z], axis=2), [Q]
        while Z.shape[2] < self._terms:
            last = powers[-1]
            powers.append(last @ last)
            Z = np.concatenate([Z, powers[-1] @ Z], axis=2)
        return Z, powers

    def _norm(self, product: Floats, u: Floats) -> Floats:
        """Bound of a matrix, from the product of its absolute values and u."""
        return np.asarray(np.max((product[:, :, 0] * self._safe + TINY) / u[:, :, 0], axis=1) * SAFE)

    def _growth(self, powers: list[Floats], wrong: Floats, u: Floats) -> Floats:
        """Bounds of (R N)^{-1} for |tau| <= 1, where R N = I + tau Q - E and |E| <= wrong; nan where none is found.

        With X = -tau Q it is (I - X)^{-1} = (I + X)(I + X^2)(I + X^4) ... (I - X^q)^{-1}, q a power of two.
        """
        # a search stays off the borders at which its checker may find nothing
        largest = 0.5 if self._errors == 1.0 else 0.499
        bound, off = np.ones(len(u)), np.zeros(len(u))
        found = np.full(len(u), np.nan)
        for j in range(_SQUARINGS):
            if j == len(powers):
                powers.append(powers[-1] @ powers[-1])
            size = self._norm(np.abs(powers[j]) @ u, u)
            norm = (size + off) * SAFE
            ready = np.isnan(found) & (norm < largest)
            found[ready] = bound[ready] / (1.0 - norm[ready]) * SAFE
            if not np.any(np.isnan(found)):
                break
            bound = bound * (1.0 + norm) * SAFE
            off = (gamma(self._k + 4) * size * size + 2.0 * size * off + off * off) * SAFE + TINY
        share = wrong * found * SAFE
        # where a constant M is so far from singular, t = 1 is as good as any other last row: search and checker, which
        # may choose differently close to this, both find good series there
        most = 2.0**-10 if self._plain else 0.5 / self._errors
        found = np.where(share < most, found / (1.0 - share) * SAFE, np.nan)
        return np.asarray(np.where(found * self._errors < _LARGEST_GROWTH, found, np.nan))


def _last_row(k: int) -> Floats:
    """The last row of N with which t = 1."""
    found = np.zeros(k)
    found[-1] = 1.0
    return found


def _each(function: Callable[..., Floats], *stacks: Floats) -> Floats:
    """A function of numpy.linalg of stacks of matrices; nan for those that are singular."""
    try:
        return np.asarray(function(*stacks))
    except np.linalg.LinAlgError:
        if len(stacks[0]) == 1:
            return np.full_like(stacks[-1], np.nan)
        return np.concatenate([_each(function, *(s[b : b + 1] for s in stacks)) for b in range(len(stacks[0]))])


def _shifted(constant: Floats, slope: Floats) -> Floats:
    """Coefficients of a + tau b, given those of a and b by powers of tau."""
    found = np.zeros((*constant.shape[:2], constant.shape[2] + 1))
    found[:, :, :-1] = constant
    found[:, :, 1:] += slope
    return found


def bernstein_values(coefficients: Floats, low: Floats, high: Floats) -> Floats:
    """Bernstein coefficients (c, m, d + 1) of polynomials (c, m, d + 1), of every c over its own part.

    The first and the last are the values at ``low`` and ``high``. Rounding errors are at most gamma_(8d+8) times the
    sum of the sizes of a polynomial's coefficients.
    """
    return np.asarray(coefficients @ to_bernstein(coefficients.shape[2] - 1, low, high))


def signs_beyond(values: Floats, error: Floats) -> Signs:
    """1 or -1 where all values along the last axis are larger than an error, or smaller than minus it; else 0."""
    positive, negative = np.min(values, axis=-1) > error, np.max(values, axis=-1) < -error
    return np.asarray(positive.astype(np.int8) - negative.astype(np.int8))


def to_bernstein(degree: int, low: Floats, high: Floats) -> Floats:
    """Bernstein coefficients over parts [low, high] of 1, tau, ..., a row each: (c, d + 1, d + 1).

    That of number j of tau^k is the mean of the products of k of the numbers low, .., low, high, .., high, of which j
    are high: a sum of terms whose sizes add up to at most one, for |low|, |high| <= 1.
    """
    if degree == 0:
        return np.ones((len(low), 1, 1))
    # powers by products, whose rounding is known
    factors = np.ones((degree + 1, 2, len(low)))
    factors[1:, 0], factors[1:, 1] = low, high
    of_low, of_high = np.multiply.accumulate(factors, axis=0).transpose(1, 0, 2)
    powers = np.arange(degree + 1)
    # by k, i and part: low^(k - i) high^i
    products = np.where((powers[:, None] >= powers)[..., None], of_low[powers[:, None] - powers] * of_high, 0.0)
    return np.asarray((_weights(degree) @ products).transpose(2, 0, 1))


@cache
def _weights(degree: int) -> Floats:
    """Shares of high^i low^(k - i) in Bernstein coefficient j of tau^k, by [k, j, i]."""
    n = range(degree + 1)
    return np.array(
        [[[comb(j, i) * comb(degree - j, k - i) / comb(degree, k) if i <= k else 0.0 for i in n] for j in n] for k in n]
    )
