"""The trusted core over alpha: where one selection holds, and where its conditions vanish (theory, section 7.14).

A selection with unknowns y (lambda_n of the nodes in contact, lambda_t of the sticking ones) asks for M(alpha) y =
g_R(alpha), both affine in alpha. Here it is written with one unknown more: N(alpha) z = e for z = (y, t), where N has
the rows [M, -g_R] and one row v', and e is the last unit vector. Where N is regular and t is not zero, y / t is the
selection's only solution; where t = 0 there is none. So zeros of det M need no care, as long as N is regular there.

Many selections and many parts are examined at once, in stacks of matrices: conditions are polynomials in tau with
bounds of their errors. Selections of about the same size are expanded together; smaller ones are filled up with
equations x = 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from math import comb
from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball, determinant_sign, gamma, upper_sum

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from enumsol.support.array_types import Floats, Indices, NDArray
    from enumsol.trusted.arcs.selection_balls import ArcSelection

    Asked = tuple[ArcSelection, float, float]
    Signs = NDArray[np.int8]


@dataclass(frozen=True)
class OverInterval:
    """Knowledge of a selection over an interval of alpha.

    Attributes
    ----------
    conditions : int8 array
        Only where the selection is regular: 1 or -1 where a condition of ``Selection.conditions`` is positive or
        negative throughout, else 0.
    regular : bool
        The selection has exactly one solution at every alpha.
    none : bool
        It has no root at any alpha.
    index : int
        Sign of det M; 0 where it was not asked for: where the selection has no root, or is not regular, or the signs
        of several conditions are not known.
    ends : (int8 array, int8 array)
        Signs of the conditions at the first and the last alpha, as above.
    slopes : int8 array
        1 or -1 where a positive multiple of a condition grows or falls with alpha throughout, else 0. Only where the
        selection is regular, and not more than one condition's sign is unknown.
    """

    conditions: Signs
    regular: bool
    none: bool
    index: int
    ends: tuple[Signs, Signs]
    slopes: Signs

    @property
    def holds(self) -> bool:
        """True if the selection has exactly one root at every alpha, with all conditions strict."""
        return self.regular and bool(np.all(self.conditions > 0))

    @property
    def doubtful(self) -> Indices:
        """Numbers of the conditions whose signs are not known."""
        return np.flatnonzero(self.conditions == 0)


@dataclass(frozen=True, eq=False)
class Expansion:
    """Conditions of a selection over [low, high] as polynomials in tau with bounds of their errors; t is the last.

    alpha is middle + tau radius, |tau| <= 1. At every alpha they are the conditions of z, that is t times those of y.

    Attributes
    ----------
    selection : ArcSelection
    low, high, middle, radius : float
    coefficients : (m + 1, terms + 1) array
    error, slope_error : (m + 1,) arrays
        Bounds of the errors of values and of derivatives by tau.
    truncated : bool
        What the series leaves out is the largest part of its error.
    bordered : Ball
        N at the middle.
    """

    selection: ArcSelection
    low: float
    high: float
    middle: float
    radius: float
    coefficients: Floats
    error: Floats
    slope_error: Floats
    truncated: bool
    bordered: Ball

    @cached_property
    def slope(self) -> Floats:
        """Coefficients of the derivatives by tau."""
        return np.asarray(self.coefficients[:, 1:] * np.arange(1, self.coefficients.shape[1]))

    @cached_property
    def size(self) -> Floats:
        """Bounds of the polynomials."""
        return np.asarray(upper_sum(np.abs(self.coefficients), axis=1))

    @cached_property
    def steepest(self) -> Floats:
        """Bounds of the derivatives."""
        return np.asarray(upper_sum(np.abs(self.slope), axis=1))

    @cached_property
    def _rounding(self) -> float:
        # Bernstein polynomials have coefficients that add up to at most these sizes
        return gamma(8 * self.coefficients.shape[1])

    @cached_property
    def rounded(self) -> Floats:
        """Bounds of the errors of values from Bernstein coefficients."""
        return np.asarray((self.error + self._rounding * self.size) * SAFE)

    @cached_property
    def slope_rounded(self) -> Floats:
        """Bounds of the errors of derivatives, likewise."""
        return np.asarray((self.slope_error + self._rounding * self.steepest) * SAFE)

    @cached_property
    def orientation(self) -> int:
        """Sign of det N."""
        return determinant_sign(self.bordered)

    @cached_property
    def unbalanced(self) -> bool:
        """True if no forces of the selection are in balance with the load anywhere in the interval."""
        return self.selection.system.unbalanced(self.selection.rows.codes, self.low, self.high)

    def over(self, low: float, high: float) -> OverInterval:
        """Knowledge of a part of the interval."""
        return over_parts([(self, low, high)])[0]

    def slack(self) -> float:
        """Bound of the error of tau of an alpha."""
        return 8.0 * UNIT * (1.0 + max(abs(self.low), abs(self.high)) / self.radius)

    def tau(self, low: float, high: float) -> tuple[float, float]:
        """The part in terms of tau, rounded outward."""
        slack, middle, radius = self.slack(), self.middle, self.radius
        ends = (low - middle) / radius - slack, (high - middle) / radius + slack
        return max(ends[0], -1.0), min(ends[1], 1.0)


def expansions(asked: Sequence[Asked], errors: float = 1.0) -> list[Expansion | OverInterval | None]:
    """The conditions of selections over intervals as polynomials, or that nothing holds there; None where neither is.

    Bounds of errors are multiplied by ``errors``: a search asks for more than its checker, which may round otherwise.
    """
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        found = _expanded(asked, errors)
        return [one or _nowhere(*what) for what, one in zip(asked, found, strict=True)]


def _nowhere(selection: ArcSelection, low: float, high: float) -> OverInterval | None:
    """Knowledge of an interval in which no forces of a selection are in balance with the load (theory, (14.7))."""
    if not selection.system.unbalanced(selection.rows.codes, low, high):
        return None
    unknown = np.zeros(len(selection.rows.conditions), dtype=np.int8)
    return OverInterval(unknown, False, True, 0, (unknown, unknown), unknown)


def over_parts(asked: Sequence[tuple[Expansion | OverInterval, float, float]]) -> list[OverInterval]:
    """Knowledge of expansions over parts of their intervals; what is known of a whole interval is so of its parts."""
    found = [one if isinstance(one, OverInterval) else None for one, _, _ in asked]
    groups: dict[int, list[tuple[int, tuple[Expansion, float, float]]]] = {}
    for k, (one, *part) in enumerate(asked):
        if isinstance(one, Expansion):
            groups.setdefault(one.coefficients.shape[1], []).append((k, (one, part[0], part[1])))
    for group in groups.values():
        for (k, _), known in zip(group, _over([one for _, one in group]), strict=True):
            found[k] = known
    return [known for known in found if known is not None]


def _over(asked: Sequence[tuple[Expansion, float, float]]) -> list[OverInterval]:
    """over_parts for series of one length."""
    expansions = [part[0] for part in asked]
    places, counts = np.arange(len(asked)), np.array([len(e.rounded) - 1 for e in expansions])
    low, high = np.array([e.tau(*part) for e, *part in asked]).T
    rounded = _stacked([e.rounded for e in expansions], np.inf)
    values = bernstein_values(_stacked([e.coefficients for e in expansions]), low, high)
    signs = signs_beyond(values, rounded)
    t = signs[places, counts][:, None]
    # a root has all conditions >= 0 where t > 0, or all <= 0 where t < 0
    none = np.any(signs < 0, axis=1) & np.any(signs > 0, axis=1)
    known = np.where(t, signs * t, signs)
    # tau of the first or last alpha lies within twice the slack of the part's end
    slack = 2.0 * np.array([e.slack() for e in expansions])[:, None]
    error = (rounded + slack * _stacked([e.steepest for e in expansions])) * SAFE
    ends = [signs_beyond(values[:, :, k, None], error) * t for k in (0, -1)]
    doubtful = np.count_nonzero((known == 0) & (np.arange(known.shape[1]) < counts[:, None]), axis=1)
    settled = (t[:, 0] != 0) & (doubtful <= 1)
    slopes = np.zeros_like(known)
    steep = np.flatnonzero(settled)
    if len(steep):
        rises = bernstein_values(_stacked([expansions[k].slope for k in steep]), low[steep], high[steep])
        errors = _stacked([expansions[k].slope_rounded for k in steep], np.inf)
        slopes[steep, : rises.shape[1]] = signs_beyond(rises, errors) * t[steep]
    found = []
    for k, (expansion, count) in enumerate(zip(expansions, counts.tolist(), strict=True)):
        sign = int(t[k, 0])
        # by Cramer's rule t = det M / det N, and N is regular throughout
        index = sign * expansion.orientation if settled[k] and not none[k] else 0
        first, last = (part[k, :count] for part in ends)
        nowhere = bool(none[k]) or (not sign and expansion.unbalanced)
        found.append(OverInterval(known[k, :count], bool(sign), nowhere, index, (first, last), slopes[k, :count]))
    return found


def _stacked(parts: Sequence[Floats], fill: float = 0.0) -> Floats:
    """Arrays of different lengths in one."""
    found = np.full((len(parts), max(map(len, parts)), *parts[0].shape[1:]), fill)
    for k, part in enumerate(parts):
        found[k, : len(part)] = part
    return found


# -- series -----------------------------------------------------------------------------------------------------------

#: Terms of the series of z: with more of them boxes are longer and cost more. Sizes are rounded up to multiples of the
#: second: larger stacks, and more filling.
_TERMS, _STEP = 16, 4


def _expanded(asked: Sequence[Asked], errors: float) -> list[Expansion | None]:
    """The series of selections over intervals; None where none is proven. Errors are multiplied by ``errors``."""
    found: list[Expansion | None] = [None] * len(asked)
    plain = [selection.affine for selection, _, _ in asked]
    for first in (True, False):
        # where M is constant, z is affine with t = 1, unless M is singular
        waiting = [k for k in range(len(asked)) if plain[k] or not first]
        if not first:
            waiting = [k for k in waiting if found[k] is None]
        for group in _groups(asked, waiting):
            stack = _Stack([asked[k] for k in group], 2 if first else _TERMS, errors, plain=first)
            for k, series in zip(group, stack.series(), strict=True):
                found[k] = series
    return found


def _groups(asked: Sequence[Asked], waiting: Sequence[int]) -> Iterator[list[int]]:
    """Numbers of those that are expanded together."""
    sizes: dict[int, list[int]] = {}
    for k in waiting:
        sizes.setdefault(-(-len(asked[k][0].rows.unknown) // _STEP) * _STEP, []).append(k)
    for size, group in sizes.items():
        # entries of a stack
        most = max(1, 2**20 // ((size + 1) * (size + 1 + 3 * asked[group[0]][0].system.p)))
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
        # with the last unit vector t = 1
        self._H[:, self._k - 1] = np.eye(self._k)[-1] if plain else self._directions()
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

    def series(self) -> list[Expansion | None]:
        """The series, None where there is none."""
        k, H, H1 = self._k, self._H, self._H1
        H_rad, H1_rad = self._H_rad, self._H1_rad
        H_rad[:, k - 1], H1_rad[:, k - 1] = 0.0, 0.0
        N, N1 = H[:, :k], H1[:, :k]
        R = _each(np.linalg.inv, N)
        Q = R @ N1
        Z, powers = self._guess(R[:, :, -1:], Q)
        sizes = np.sum(np.abs(Z), axis=2)
        # weights are at least this share of the largest
        u = sizes + 1e-3 * np.max(sizes, axis=1, keepdims=True)
        # far above underflow
        u[~np.all(np.isfinite(u) & (u > 2.0**-480), axis=1)] = np.nan
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

    def _one(self, b: int, sums: Floats, values: Floats, slopes: Floats, *, truncated: bool) -> Expansion | None:
        """A series, without what was filled up."""
        size, m = self._sizes[b]
        rows, kept = [*range(m), -1], [*range(size), self._k - 1]
        # sums of smaller ones do not overflow
        if not np.max(np.abs(sums)) < 2.0**1000:
            return None
        inner = np.ix_(kept, kept)
        return Expansion(
            *self._asked[b],
            middle=float(self._middle[b]),
            radius=float(self._radius[b]),
            coefficients=sums[rows],
            error=values[rows],
            slope_error=slopes[rows],
            truncated=truncated,
            bordered=Ball(self._H[b][inner], self._H_rad[b][inner]),
        )

    def _guess(self, z: Floats, Q: Floats) -> tuple[Floats, list[Floats]]:
        """About the series of z, z_k = -Q z_(k-1), whose residual is bounded, and powers Q, Q^2, Q^4, ..."""
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
        for j in range(6):
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
        return np.asarray(np.where(found * self._errors < 1e6, found, np.nan))


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
