"""The trusted core in 3D: branchings, rows and exclusions (theory, section 12.2); leaves are in ``leaves``."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball, gamma, upper_norm, upper_sum
from enumsol.model import sectors
from enumsol.trusted.energy_bounds import energy_bounds, form_bounds
from enumsol.trusted.quadratic_forms import QuadraticForm

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.condensation.space_condensed import EnclosedSpace
    from enumsol.support.array_types import Floats, Indices


OPEN, STICK, SLIP_PLUS, SLIP_MINUS, FRICTIONLESS, CONTACT, UNDECIDED = range(7)
#: Kinds of rows (theory, section 12.2); a row is (kind, node, number), the number that of a direction or sector.
GAP, FORCE, TAU, SLIP, END, ALONG, TANGENT, CHORD, LEFT, RIGHT = range(10)
#: Rows in which lambda_n has the radius of the disc as a factor.
OF_DISCS = END, TANGENT, CHORD
FORBIDDEN, NONNEGATIVE, FREE = range(3)
Row = tuple[int, int, int]
#: Rows whose terms and signs are kept: the same ones occur in many exclusions.
_KEPT = 1 << 16


def sector_children(code: int, tangents: int) -> tuple[int, ...]:
    """Codes that together cover a partial status of a node with so many components of tau; empty for a final one."""
    if code == UNDECIDED:
        return (OPEN, CONTACT) if tangents else (OPEN, FRICTIONLESS)
    if code == CONTACT:
        if tangents == 1:
            return STICK, SLIP_PLUS, SLIP_MINUS
        return STICK, *(sectors.SECTORS + i for i in range(4, 8))
    if code > sectors.SECTORS:
        one, other = sectors.cut(code - sectors.SECTORS, 0, 1)
        return sectors.SECTORS + one, sectors.SECTORS + other
    return ()


def is_sector_covering(code: int, children: Sequence[int], tangents: int) -> bool:
    """Whether statuses, in any order, cover a partial one: those of ``sector_children``, or any parts of a sector."""
    if code <= sectors.SECTORS:
        return bool(children) and sorted(children) == sorted(sector_children(code, tangents))
    numbers = [child - sectors.SECTORS for child in children]
    if len(numbers) < 2 or not all(
        sectors.is_sector(number) and sectors.level_of(number) <= sectors.DEEPEST + 1 for number in numbers
    ):
        return False
    spans = sorted(map(sectors.span, numbers))
    begin, end = sectors.span(code - sectors.SECTORS)
    return [a for a, _ in spans] + [end] == [begin] + [b for _, b in spans]


@lru_cache(maxsize=_KEPT)
def row_sign(code: int, row: Row) -> int:
    """What the multiplier of a row may be at a node of this code."""
    kind, _, number = row
    if kind == GAP:
        return NONNEGATIVE if code in (OPEN, UNDECIDED) else FREE
    if kind == FORCE:
        return FREE if code == OPEN else NONNEGATIVE
    if kind == TAU:
        return FREE if code == OPEN else FORBIDDEN
    if kind == SLIP:
        return FREE if code == STICK else FORBIDDEN
    if kind == END:
        return FREE if code == (SLIP_PLUS if number > 0 else SLIP_MINUS) else NONNEGATIVE
    if kind == ALONG:
        return NONNEGATIVE if code == (SLIP_PLUS if number > 0 else SLIP_MINUS) else FORBIDDEN
    if kind == TANGENT:
        return NONNEGATIVE
    return NONNEGATIVE if code > sectors.SECTORS and sectors.contains(number, code - sectors.SECTORS) else FORBIDDEN


def sector_row_terms(row: Row, tau: Indices, size: int) -> tuple[tuple[int, ...], tuple[float, ...]]:
    """A row as a sum over y and, from ``size`` on, over w: indices and coefficients, off by half a unit at most.

    Raises
    ------
    ValueError
        The node has no such row.
    """
    t1, t2 = tau[row[1]]
    return _terms(row, int(t1), int(t2), size)


@lru_cache(maxsize=_KEPT)
def _terms(row: Row, t1: int, t2: int, size: int) -> tuple[tuple[int, ...], tuple[float, ...]]:
    kind, node, number = row
    if kind == GAP:
        return (size + node,), (-1.0,)
    if kind == FORCE:
        return (node,), (1.0,)
    if kind in (TAU, SLIP):
        t = (t1, t2)[number] if number in (0, 1) else -1
        _exists(t >= 0)
        return (t if kind == TAU else size + t,), (1.0,)
    if kind in (END, ALONG):
        _exists((t1 < 0) != (t2 < 0) and number in (1, -1))
        t = max(t1, t2)
        return ((node, t), (1.0, -float(number))) if kind == END else ((size + t,), (float(number),))
    _exists(t1 >= 0 and t2 >= 0 and number >= 4)
    x, y = sectors.direction(number)
    if kind == TANGENT:
        _exists(number < sectors.RUN)
        return (node, t1, t2), (1.0, -x, -y)
    _exists(sectors.is_sector(number))
    if kind == CHORD:
        along, across, most = sectors.chord_of(number)
        return (t1, t2, node), (along, across, -most)
    p, q = sectors.direction(sectors.end_number(number))
    return ((size + t1, size + t2), (-y, x)) if kind == LEFT else ((size + t1, size + t2), (q, -p))


def _exists(condition: bool) -> None:
    if not condition:
        raise ValueError("a node has no such row")


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
            for i, coefficient in zip(*_terms(row, *tau[node], size), strict=True):
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


@np.errstate(over="ignore", invalid="ignore")
def sector_margin(
    system: EnclosedSpace,
    codes: Sequence[int],
    rows: Sequence[Row],
    values: Floats,
    errors: float = 1.0,
    form: QuadraticForm | None = None,
) -> float:
    """Proven lower bound on the energy over a partial assignment; positive means that it holds no solution.

    ``errors`` as in ``energy_bounds``; -inf where a multiplier has the wrong sign. With a ``form`` of the same system
    the bound is on that form, and -inf where it is not proven convex.
    """
    if form is not None and not form.smallest_eigenvalue > 0:
        return -np.inf
    added = Multiplied.of(system, codes, rows, values)
    if added is None:
        return -np.inf
    y, c = added.y, added.c
    if form is None:
        return _margin(system, y, c, errors)
    # y and what it is off by act on S y - g
    c_rad = (c.rad + (np.abs(system.S) + system.S_rad) @ y.rad * (1 + gamma(len(y.mid)))) * SAFE
    bound = float(form_bounds(form, y.mid[None], c.mid[None], c_rad[None], errors)[0])
    bound -= errors * float(upper_sum(y.rad * (np.abs(system.g) + system.g_rad))) * SAFE
    return bound if np.isfinite(bound) else -np.inf


@np.errstate(over="ignore", invalid="ignore")
def swept_margin(
    ends: tuple[EnclosedSpace, EnclosedSpace],
    middle: EnclosedSpace,
    codes: Sequence[int],
    rows: Sequence[Row],
    values: tuple[Floats, Floats],
    errors: float = 1.0,
) -> float:
    """The same between two systems, with multipliers between those of both ends: the least number of (12.21a).

    That of an end, if it is not positive.

    Parameters
    ----------
    ends, middle : with one S, and g and discs that are affine from one end to the other
    values : at the ends
    """
    first, last = (Multiplied.of(end, codes, rows, part) for end, part in zip(ends, values, strict=True))
    if first is None or last is None:
        return -np.inf
    least = np.inf
    for end, added in zip(ends, (first, last), strict=True):
        least = min(least, _margin(end, added.y, added.c, errors))
        if not least > 0:
            return least
    one, other = (Multiplied.of(end, codes, rows, part) for end, part in zip(ends, values[::-1], strict=True))
    if one is None or other is None:
        return -np.inf
    half, (low, high) = Ball.exact(np.array(0.5)), (Ball(end.g, end.g_rad) for end in ends)
    lost = ((last.y - first.y)[None] @ (high - low)[:, None])[0, 0]
    bound = _margin(middle, (one.y + other.y) * half, (one.c + other.c) * half, errors) - 0.25 * float(lost.mid)
    bound -= errors * (0.25 * float(lost.rad) + 4 * UNIT * (abs(bound) + abs(float(lost.mid)))) * SAFE
    return min(least, bound) if np.isfinite(bound) else -np.inf


def _margin(system: EnclosedSpace, on_slips: Ball, on_forces: Ball, errors: float) -> float:
    """By multipliers on S y - g and on the forces."""
    y, c, c_rad = on_slips.mid, on_forces.mid, on_forces.rad
    bound = float(energy_bounds(system, y[None], c[None], c_rad[None], errors)[0])
    # rounded y are not quite multipliers: the bound is quadratic in y with the gradient g - v / 2, v = g + c + S y
    v = np.abs(system.g + c + system.S @ y) + system.product_error @ np.abs(y)
    v += system.g_rad + c_rad + gamma(len(system.g) + 4) * (np.abs(c) + np.abs(system.g))
    slope = np.abs(system.g) + system.g_rad + 0.5 * v * SAFE
    lost = upper_sum(on_slips.rad * slope) + system.largest_norm * upper_norm(on_slips.rad) ** 2
    bound -= errors * float(lost) * SAFE * SAFE
    return bound if np.isfinite(bound) else -np.inf


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

    def margin(self, codes: Sequence[int], rows: Sequence[Row], values: Floats, errors: float = 1.0) -> float:
        """See ``sector_margin``."""
        return sector_margin(self.system, codes, rows, values, errors, self)
