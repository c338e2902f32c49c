"""The trusted core over alpha: where one selection holds, and where its conditions vanish (theory, section 7.14).

A selection with unknowns y (lambda_n of the nodes in contact, lambda_t of the sticking ones) asks for M(alpha) y =
g_R(alpha), both affine in alpha. Here it is written with one unknown more: N(alpha) z = e for z = (y, t), where N has
the rows [M, -g_R] and one row v', and e is the last unit vector. Where N is regular and t is not zero, y / t is the
selection's only solution; where t = 0 there is none. So zeros of det M need no care, as long as N is regular there.

Many selections and many parts are examined at once, in stacks of matrices.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, determinant_sign, gamma, upper_sum
from enumsol.trusted.arcs.series import Series, bernstein_values, expand, signs_beyond

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.support.array_types import Floats, Indices, NDArray
    from enumsol.trusted.arcs.selection_balls import ArcSelection

    Signs = NDArray[np.int8]

#: Imaginary parts (tau) of what counts as a zero; coefficients that do not matter for it, by the polynomial's size and
#: by its error; sizes by errors of what counts as flat, and errors of what counts as rough; for guesses.
_NEAR_REAL, _NOISE, _SHARE, _FLAT, _ROUGH = 1e-2, 2.0**-48, 0.01, 32.0, 1e-9
#: Zeros closer than this, relative to their interval, are not told apart; a zero's first enclosure by its radius, and
#: enlargements of it; steps of Newton's method to it.
_APART, _MARGIN, _WIDENINGS, _STEPS = 1e-5, 4.0, 60, 4


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


class Expansion:
    """Conditions of a selection over [low, high] as polynomials in tau with bounds of their errors; t is the last.

    tau runs from -1 to 1. At every alpha they are the conditions of z, that is t times those of y.

    Attributes
    ----------
    low, high : float
    apart : float
        Zeros closer than this are not told apart.
    final : bool
        False: they may be in a shorter interval.
    series : Series
    """

    final = False

    def __init__(self, selection: ArcSelection, low: float, high: float, series: Series) -> None:
        self.low, self.high, self.series = low, high, series
        self.apart = _APART * (high - low)
        self.selection = selection
        coefficients = series.coefficients
        # the sums below have coefficients of Bernstein polynomials that add up to at most these sizes
        k = gamma(8 * coefficients.shape[1])
        size, self.slope = (
            upper_sum(np.abs(coefficients), axis=1),
            coefficients[:, 1:] * np.arange(1, coefficients.shape[1]),
        )
        self.steepest = upper_sum(np.abs(self.slope), axis=1)
        self.rounded = (series.error + k * size) * SAFE
        self.slope_rounded = (series.slope_error + k * self.steepest) * SAFE
        self._size = size

    @cached_property
    def orientation(self) -> int:
        """Sign of det N."""
        return determinant_sign(self.series.bordered)

    @cached_property
    def unbalanced(self) -> bool:
        """True if no forces of the selection are in balance with the load anywhere in the interval."""
        return self.selection.unbalanced(self.low, self.high)

    @property
    def rough(self) -> bool:
        """True if the series was truncated too early for bounds near those of rounding: the interval is long."""
        return self.series.truncated and bool(np.median(self.series.error / (self._size + TINY)) > _ROUGH)

    def over(self, low: float, high: float) -> OverInterval:
        """Knowledge of a part of the interval."""
        return over_parts([(self, low, high)])[0]

    def zeros(self, condition: int) -> list[float]:
        """Alphas inside the interval at which a condition seems to vanish; no claim rests on them."""
        polynomial = self.series.coefficients[condition]
        # trailing noise would only give roots far away
        noise = max(_NOISE * float(self._size[condition]), _SHARE * float(self.rounded[condition]))
        kept = np.flatnonzero(np.abs(polynomial) > noise)
        last = int(kept[-1]) if len(kept) else 0
        if last < 2:
            real = -polynomial[:1] / polynomial[1] if last else np.empty(0)
        else:
            roots = np.linalg.eigvals(_companion(polynomial[: last + 1]))
            real = np.sort(roots.real[np.abs(roots.imag) < _NEAR_REAL])
        found = [self.series.middle + self.series.radius * float(x) for x in real]
        return [alpha for alpha in found if self.low < alpha < self.high]

    def flat(self, condition: int) -> bool:
        """True if a condition is nowhere larger than the bound of its error allows to tell."""
        return bool(self._size[condition] <= _FLAT * self.rounded[condition])

    def zero_bounds(self, condition: int, slope: int, low: float, high: float) -> tuple[float, float]:
        """Bounds of the only zero of a condition in a part, at whose ends it has opposite signs.

        ``slope`` is the sign of its slope there.
        """
        zero = next((alpha for alpha in self.zeros(condition) if low < alpha < high), 0.5 * (low + high))
        found, rise = self.selection.at(zero), self._rise(condition, zero)
        if found is None or not np.isfinite(rise) or rise * slope <= 0.0:
            return low, high
        zero -= float(found[2].mid[condition]) / rise
        width = _MARGIN * float(found[2].rad[condition]) / abs(rise) + 2.0 * float(np.spacing(abs(zero)))
        for _ in range(_WIDENINGS):
            first, last = zero - width, zero + width
            if not low <= first < last <= high:
                break
            if [self.selection.sign_at(alpha, condition) for alpha in (first, last)] == [-slope, slope]:
                return first, last
            width *= 2.0
        return low, high

    def split(self) -> None:
        """Cuts are made around zeros; see ``taylor.ShortExpansion``."""

    def near(self, condition: int, low: float, high: float) -> tuple[float, float]:
        """Presumed bounds of the only zero of a condition in a part; no claim rests on them."""
        value, slope = self.series.coefficients[condition].tolist(), self.slope[condition].tolist()
        first, last = self.tau(low, high)
        tau, rise = 0.5 * (first + last), 0.0
        for _ in range(_STEPS):
            rise = _horner(slope, tau)
            step = _horner(value, tau) / rise if rise else np.inf
            tau = min(max(tau - step, first), last)
        zero = self.series.middle + self.series.radius * tau
        reach = 1.01 * float(self.rounded[condition]) / abs(rise) * self.series.radius if rise else np.inf
        reach += 32.0 * float(np.spacing(max(abs(self.low), abs(self.high))))
        return zero - reach, zero + reach

    def _rise(self, condition: int, alpha: float) -> float:
        """Slope of a condition over t at an alpha at which it vanishes, nearly."""
        tau = (alpha - self.series.middle) / self.series.radius
        t = _horner(self.series.coefficients[-1].tolist(), tau)
        return _horner(self.slope[condition].tolist(), tau) / t / self.series.radius if t else np.inf

    def slack(self) -> float:
        """Bound of the error of tau of an alpha."""
        return 8.0 * UNIT * (1.0 + max(abs(self.low), abs(self.high)) / self.series.radius)

    def tau(self, low: float, high: float) -> tuple[float, float]:
        """The part in terms of tau, rounded outward."""
        slack, middle, radius = self.slack(), self.series.middle, self.series.radius
        ends = (low - middle) / radius - slack, (high - middle) / radius + slack
        return max(ends[0], -1.0), min(ends[1], 1.0)


@dataclass(frozen=True)
class Nowhere:
    """An interval in which no forces of a selection are in balance with the load (theory, (14.7)).

    Attributes
    ----------
    selection : ArcSelection
    low, high : float
    """

    selection: ArcSelection
    low: float
    high: float
    final: ClassVar = False

    @property
    def known(self) -> OverInterval:
        """Knowledge of every part of it."""
        unknown = np.zeros(len(self.selection.rows.conditions), dtype=np.int8)
        return OverInterval(unknown, False, True, 0, (unknown, unknown), unknown)


def expansions(
    asked: Sequence[tuple[ArcSelection, float, float]], errors: float = 1.0
) -> list[Expansion | Nowhere | None]:
    """The conditions of selections over intervals as polynomials, or that there are no forces; None where neither is.

    Bounds of errors are multiplied by ``errors``: a search asks for more than its checker, which may round otherwise.
    """
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        found = expand(asked, errors)
        return [
            Expansion(*what, series) if series else Nowhere(*what) if what[0].unbalanced(*what[1:]) else None
            for what, series in zip(asked, found, strict=True)
        ]


def over_parts(asked: Sequence[tuple[Expansion | Nowhere, float, float]]) -> list[OverInterval]:
    """Knowledge of expansions over parts of their intervals."""
    found = [one.known if isinstance(one, Nowhere) else None for one, _, _ in asked]
    groups: dict[int, list[tuple[int, tuple[Expansion, float, float]]]] = {}
    for k, (one, *part) in enumerate(asked):
        if isinstance(one, Expansion):
            groups.setdefault(one.series.coefficients.shape[1], []).append((k, (one, part[0], part[1])))
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
    values = bernstein_values(_stacked([e.series.coefficients for e in expansions]), low, high)
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


def _companion(polynomial: Floats) -> Floats:
    """A matrix whose eigenvalues are the zeros."""
    degree = len(polynomial) - 1
    found = np.eye(degree, k=-1)
    found[:, -1] = -polynomial[:-1] / polynomial[-1]
    return found


def _horner(polynomial: Sequence[float], tau: float) -> float:
    value = 0.0
    for coefficient in reversed(polynomial):
        value = value * tau + coefficient
    return value
