"""Exclusions in 3D, by multipliers of rows: at one alpha, over a piece, and of bodies that nothing holds.

See theory, sections 12.2, 12.9 and 14.6.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball, gamma, upper_norm, upper_sum
from enumsol.condensation.space_condensed import EnclosedSpace
from enumsol.trusted.floating_bounds import balanced, balancing, bounds_within
from enumsol.trusted.quadratic_forms import QuadraticForm, energy_bounds, form_bounds
from enumsol.trusted.space.sector_rows import FORBIDDEN, NONNEGATIVE, OF_DISCS, row_sign, row_terms

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.support.array_types import Floats
    from enumsol.trusted.space.sector_rows import Row

#: Binary digits of multipliers of the rows of balance over a piece.
_DIGITS = 40
_HALF = Ball.exact(np.array(0.5))


class Bounding(Protocol):
    """A form, or a piece of alpha, that has bounds of its own: SlipForm and AlphaPiece."""

    def margin(self, codes: Sequence[int], rows: Sequence[Row], values: Floats, errors: float = 1.0) -> float:
        """See ``space_margin``."""


def space_margin(
    within: EnclosedSpace | Bounding, codes: Sequence[int], rows: Sequence[Row], values: Floats, errors: float = 1.0
) -> float:
    """Proven lower bound over a partial assignment in 3D; positive means that it holds no solution.

    On the energy, of a body that nothing holds e - h'q, the better one of both of (14.6); or on what has bounds of its
    own. ``errors`` as in ``energy_bounds``; -inf where a multiplier has the wrong sign.
    """
    if not isinstance(within, EnclosedSpace):
        return within.margin(codes, rows, values, errors)
    return swept_margin((within,), within, codes, rows, (values,), errors)


@np.errstate(over="ignore", invalid="ignore")
def swept_margin(
    ends: Sequence[EnclosedSpace],
    middle: EnclosedSpace,
    codes: Sequence[int],
    rows: Sequence[Row],
    values: Sequence[Floats],
    errors: float = 1.0,
) -> float:
    """Lower bound between two systems, with multipliers between those of both ends: the least number of (12.19).

    Of a body that nothing holds that, too. Or that of an end, if it is not positive; and of one system that.

    Parameters
    ----------
    ends, middle : with one S, and g and discs that are affine from one end to the other
    values : at the ends
    """
    own = [Multiplied.of(end, codes, rows, part) for end, part in zip(ends, values, strict=True)]
    known = [added for added in own if added is not None]
    if len(known) < len(ends):
        return -np.inf

    def bound(y: Sequence[Ball], *, at_balance: bool) -> float:
        least, parts = np.inf, list(zip(ends, y, known, strict=True))
        if len(ends) == 1:
            return _bound(middle, y[0], known[0].c, errors, at_balance=at_balance)
        z = _rounded(np.array([_balancing(end, there, added.c) for end, there, added in parts]))
        for (end, there, added), own in zip(parts, z, strict=True):
            least = min(least, _bound(end, there, added.c, errors, own, at_balance=at_balance))
            if not least > 0:
                return least
        # the signs of multipliers are right at both ends
        mixed = [Multiplied.of(end, codes, rows, part) for end, part in zip(ends, values[::-1], strict=True)]
        c = [added.c for added in mixed if added is not None]
        mean = 0.5 * (z[0] + z[1])
        found = _bound(middle, (y[0] + y[1]) * _HALF, (c[0] + c[1]) * _HALF, errors, mean, at_balance=at_balance)
        (low, high), turn = (Ball.joined(Ball(end.g, end.g_rad), end.rows.h) for end in ends), Ball.exact(z[1] - z[0])
        lost = (Ball.joined(y[1] - y[0], turn)[None] @ (high - low)[:, None])[0, 0]
        found -= 0.25 * float(lost.mid)
        found -= errors * (0.25 * float(lost.rad) + 4 * UNIT * (abs(found) + abs(float(lost.mid)))) * SAFE
        return min(least, found) if np.isfinite(found) else -np.inf

    first = bound([added.y for added in known], at_balance=False)
    if first > 0:
        return first
    balances = [_at_balance(end, added, errors) for end, added in zip(ends, known, strict=True)]
    y = [there for there in balances if there is not None]
    return first if len(y) < len(ends) else max(first, bound(y, at_balance=True))


def _balancing(system: EnclosedSpace, y: Ball, c: Ball) -> Floats:
    """Multipliers of the rows of balance, (r,): any serve."""
    return np.zeros(0) if system.held else balancing(system, y.mid[None], c.mid[None])[0]


def _rounded(z: Floats) -> Floats:
    """Numbers near z of so few digits that the mean of any two is exact."""
    largest = float(np.max(np.abs(z), initial=0.0))
    unit = 2.0 ** (np.frexp(largest)[1] - _DIGITS) if largest > TINY else 1.0
    return np.asarray(np.round(z / unit) * unit)


def _bound(
    system: EnclosedSpace, y: Ball, c: Ball, errors: float, z: Floats | None = None, *, at_balance: bool = False
) -> float:
    """Lower bound by multipliers on S y - g and on the forces, and z on the rows of balance; -inf where there is none.

    ``at_balance``: see ``bounds_within``.
    """
    if system.held:
        bound = float(energy_bounds(system, y.mid[None], c.mid[None], c.rad[None], errors)[0])
        # rounded y are not quite multipliers: the bound is quadratic in y with the gradient g - v / 2, v = g + c + S y
        v = np.abs(system.g + c.mid + system.S @ y.mid) + system.product_error @ np.abs(y.mid)
        v += system.g_rad + c.rad + gamma(len(system.g) + 4) * (np.abs(c.mid) + np.abs(system.g))
        slope = np.abs(system.g) + system.g_rad + 0.5 * v * SAFE
        lost = upper_sum(y.rad * slope) + system.largest_norm * upper_norm(y.rad) ** 2
        bound -= errors * float(lost) * SAFE * SAFE
    else:
        y_mid, y_rad, c_mid, c_rad = (part[None] for part in (y.mid, y.rad, c.mid, c.rad))
        z = None if z is None else z[None]
        bound = float(bounds_within(system, y_mid, y_rad, c_mid, c_rad, errors, z, at_balance=at_balance)[0])
    return bound if np.isfinite(bound) else -np.inf


def _at_balance(system: EnclosedSpace, rows: Multiplied, errors: float) -> Ball | None:
    """The y of multipliers of the same signs next to those given for which G y = h; None where none are shown to exist.

    What changes is the multipliers of the rows on w: each y belongs to several of them.
    """
    if system.held or not rows.pushes:
        return None
    size, k = len(system.g), gamma(len(rows.pushes) + 8)
    T, values = np.zeros((size, len(rows.pushes))), np.array([value for value, _ in rows.pushes])
    for column, (_, terms) in enumerate(rows.pushes):
        for i, coefficient in terms:
            T[i, column] += coefficient
    T_abs = np.abs(T)
    along, change, sure = balanced(system.rows.G @ Ball(T, 2 * UNIT * T_abs), system.rows.h, values[None], errors)
    if not sure[0]:
        return None
    y_rad = (T_abs @ (change[0] + k * np.abs(along[0]))) * (1 + k) * SAFE + TINY
    return Ball(T @ along[0], y_rad)


@dataclass(frozen=True)
class Multiplied:
    """Rows of a partial assignment, each times its multiplier: y on S y - g and c on the forces, as balls.

    Attributes
    ----------
    y, c : Ball of shape (m,)
    pushes : list of pairs
        Of the rows on w, the multiplier and its terms in y by their places, each off by half a unit at most.
    """

    y: Ball
    c: Ball
    pushes: list[tuple[float, list[tuple[int, float]]]]

    @classmethod
    def of(cls, system: EnclosedSpace, codes: Sequence[int], rows: Sequence[Row], values: Floats) -> Multiplied | None:
        """None where a multiplier has the wrong sign."""
        size, units, tau = len(system.g), system.row_unit.tolist(), system.tau.tolist()
        discs, known = system.discs.mid.tolist(), system.discs.rad.tolist()
        unsure = [0.0] * size
        sums = [[0.0] * size for _ in range(4)]  # numbers of Python: faster one by one than those of arrays
        w_sum, w_sizes, y_sum, y_sizes = sums
        pushes = []
        for row, value in zip(rows, values.tolist(), strict=True):
            node = row[1]
            sign = row_sign(codes[node], row)
            if sign == FORBIDDEN or (sign == NONNEGATIVE and value < 0) or not math.isfinite(value):
                return None
            push = []
            for i, coefficient in zip(*row_terms(row, *tau[node], size), strict=True):
                # a power of two: nothing is rounded but what underflows, which is less than TINY
                factor = coefficient * units[i]
                if i == node and row[0] in OF_DISCS:
                    unsure[i] += abs(value * factor) * known[node]
                    factor *= discs[node]
                term = value * factor
                if i < size:
                    y_sum[i] += term
                    y_sizes[i] += abs(term)
                else:
                    # w = g - S lambda: a row on w acts on S lambda - g with the opposite sign
                    w_sum[i - size] -= term
                    w_sizes[i - size] += abs(term)
                    push.append((i - size, -factor))
            if push:
                pushes.append((value, push))
        y, y_size, c, c_size = np.array(sums)
        k = gamma(len(rows) + 24)
        k *= 1.0 + 2.0 * k  # the sizes are sums as long
        c_rad = (k * c_size + (1.0 + k) * np.array(unsure)) * SAFE + TINY
        return cls(Ball(y, k * y_size * SAFE + TINY), Ball(c, c_rad), pushes)


@dataclass(frozen=True, eq=False)
class SlipForm(QuadraticForm):
    """q(y) = - sum over all nodes of mu lambda_n w_n + kappa tau . v - lambda_n c . v; theory, section 12.2.

    It is at most zero at every solution, since tau . v = lambda_n |v| is at least lambda_n c . v for every vector c
    that is no longer than one.

    Attributes
    ----------
    numbers : (m + p,) array
        mu and kappa of all nodes, and the components of c, one for each tau, in their order in y.
    """

    system: EnclosedSpace
    numbers: Floats

    @classmethod
    def of(cls, system: EnclosedSpace, numbers: Floats) -> SlipForm:
        """The form of given multipliers.

        Raises
        ------
        ValueError
            There are not as many numbers as a form has, or the c of a node is longer than its kappa.
        """
        tau, p = system.tau, len(system.tau)
        if numbers.shape != (len(system.g) + p,):
            raise ValueError(f"a form has {len(numbers)} numbers; expected {len(system.g) + p}")
        mu, kappa, c = np.split(numbers, [p, 2 * p])
        place = np.where(tau >= 0, tau - p, len(c))
        first, second = np.append(c, 0.0)[place].T
        if not np.all(np.hypot(first, second) * SAFE + TINY <= kappa):
            raise ValueError("the vector c of a node is longer than its kappa")
        # units are powers of two: what is rounded is less than TINY
        with np.errstate(over="ignore", invalid="ignore"):
            share = Ball(c / system.unit[p:], np.full(len(c), TINY))
            node, axis = np.nonzero(tau >= 0)
            weight = np.append(mu, np.zeros(len(c)))
            weight[tau[node, axis]] = kappa[node]
            S, g, factor = Ball(system.S, system.S_rad), Ball(system.g, system.g_rad), Ball.exact(weight)
            H, h = S * factor[:, None], g * factor
            for k in range(2):
                n = np.flatnonzero(tau[:, k] >= 0)
                t = tau[n, k]
                H[n] = H[n] - S[t] * share[t - p][:, None]
                h[n] = h[n] - g[t] * share[t - p]
            mid = 0.5 * (H.mid + H.mid.T)
            rad = 0.5 * (H.rad + H.rad.T) * (1 + 4 * UNIT) + 4 * UNIT * np.abs(mid) + TINY
        return cls(system, mid, rad, h.mid, h.rad, 0.0, 0.0, numbers)

    @np.errstate(over="ignore", invalid="ignore")
    def margin(self, codes: Sequence[int], rows: Sequence[Row], values: Floats, errors: float = 1.0) -> float:
        """Lower bound on the form, as ``space_margin``; -inf where it is not proven convex."""
        added = Multiplied.of(self.system, codes, rows, values) if self.smallest_eigenvalue > 0 else None
        if added is None:
            return -np.inf
        (y, c), system = (added.y, added.c), self.system
        # y and what it is off by act on S y - g
        c_rad = (c.rad + (np.abs(system.S) + system.S_rad) @ y.rad * (1 + gamma(len(y.mid)))) * SAFE
        bound = float(form_bounds(self, y.mid[None], c.mid[None], c_rad[None], errors)[0])
        bound -= errors * float(upper_sum(y.rad * (np.abs(system.g) + system.g_rad))) * SAFE
        return bound if np.isfinite(bound) else -np.inf
