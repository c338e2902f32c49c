"""The trusted forms in 3D that are sums of products of rows of one node: where they are not positive is an ellipsoid.

All solutions of a partial assignment lie in it (theory, section 12.11).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
import scipy.linalg

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball, upper_norm
from enumsol.model.sectors import SECTORS, contains, direction, end_number
from enumsol.trusted.space.boxed_solution import Box
from enumsol.trusted.space.krawczyk import MARGIN
from enumsol.trusted.space.sector_rows import CONTACT, OPEN, STICK, UNDECIDED
from enumsol.trusted.space.space_uniqueness import displacements, moderate_units

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.condensation.space_condensed import EnclosedSpace
    from enumsol.support.array_types import Floats
    from enumsol.trusted.space.sector_rows import Row


#: Kinds of multipliers of products: of a sign, of any sign, and triples whose first is at least the length of the rest.
SIGNED, FREE, CONE = range(3)
#: lambda_n, tau and v of a node, by which its products are quadratic.
_N, _T, _V = 0, slice(1, 3), slice(3, 5)
#: Which entries of a matrix on (lambda_n, tau, v) are those of two components of v.
_OF_SLIPS = np.pad(np.ones((2, 2)), ((3, 0), (3, 0)))
#: Where between the ends of a sector the directions are with which slips are compared.
_ACROSS = 0.0, 0.25, 0.5, 0.75, 1.0
#: The squares of the equations get so many times the weight that the products ask for; a form is proven by a
#: matrix that is within this of the unit matrix.
_HEAVIER, _NEAR = 16.0, 0.5


def _times(a: Floats, b: Floats) -> Floats:
    return 0.5 * (np.outer(a, b) + np.outer(b, a))


def _basis() -> tuple[Floats, Floats, Floats]:
    unit = np.eye(5)
    return unit[_N], unit[_T], unit[_V]


@lru_cache(maxsize=1 << 14)
def node_products(code: int) -> tuple[tuple[Ball, ...], tuple[int, ...]]:
    """Products of a node with two components of tau, as matrices on (lambda_n, tau, v), and kinds of multipliers.

    At every solution in which the node has this status, times a multiplier of its kind, each is at least zero.
    """
    n, tau, v = _basis()
    disc = Ball.exact(_times(n, n) - _times(tau[0], tau[0]) - _times(tau[1], tau[1]))
    if code == STICK:
        return (disc,), (SIGNED,)
    if code != CONTACT and code <= SECTORS:
        return (), ()
    turn, work = _times(tau[0], v[1]) - _times(tau[1], v[0]), _times(tau[0], v[0]) + _times(tau[1], v[1])
    if code == CONTACT:
        found = [disc, *map(Ball.exact, (turn, work, -_times(n, v[0]), -_times(n, v[1])))]
        return tuple(found), (SIGNED, FREE, CONE, CONE, CONE)
    a, b = (direction(number) for number in (code - SECTORS, end_number(code - SECTORS)))
    ends = _times(a[0] * v[1] - a[1] * v[0], b[1] * v[0] - b[0] * v[1])
    # ends are off by half a unit, and a few roundings follow; those of halves are none
    found = [disc, Ball.exact(turn), Ball(ends, _OF_SLIPS * 16 * UNIT)]
    for share in _ACROSS:
        # any vector will do that is no longer than one
        c = (1.0 - share) * np.array(a) + share * np.array(b)
        lost = work - (1.0 - 16 * UNIT) / np.hypot(*c) * _times(n, c @ v)
        found.append(Ball(lost, 4 * UNIT * np.abs(lost)))
    return tuple(found), (FREE, FREE, SIGNED) + len(_ACROSS) * (SIGNED,)


@dataclass(frozen=True, eq=False)
class Frame:
    """Forces and displacements around a point, and the equations of a partial assignment.

    Attributes
    ----------
    parts : Ball of shape (p, 5, m)
        lambda_n, tau and v of every node by y, in the units of theory, section 12.1; zero where there is none.
    values : Ball of shape (p, 5)
        The same at the point.
    equations : Ball of shape (e, m)
    rest : Ball of shape (e,)
        What they leave at the point.
    """

    system: EnclosedSpace
    codes: tuple[int, ...]
    centre: Floats
    w: Ball
    parts: Ball
    values: Ball
    equations: Ball
    rest: Ball

    @classmethod
    def of(cls, system: EnclosedSpace, codes: Sequence[int], centre: Floats) -> Frame:
        """Around scaled forces.

        Raises
        ------
        ValueError
            A node is undecided.
        """
        if UNDECIDED in codes:
            raise ValueError("a form of products where a node is undecided")
        m, p, tau, unit = len(system.g), len(system.tau), system.tau, system.unit
        S, point = Ball(system.S, system.S_rad), Ball.exact(centre)
        w = displacements(system, point)
        parts, values = Ball(np.zeros((p, 5, m)), np.zeros((p, 5, m))), Ball(np.zeros((p, 5)), np.zeros((p, 5)))
        nodes = np.arange(p)
        parts.mid[nodes, 0, nodes] = 1.0
        values.mid[:, 0] = centre[:p]
        for k in range(2):
            has = np.flatnonzero(tau[:, k] >= 0)
            t = tau[has, k]
            # units are powers of two: what is rounded is less than TINY
            parts.mid[has, 1 + k, t] = unit[t]
            values.mid[has, 1 + k] = centre[t] * unit[t]
            parts[has, 3 + k] = Ball(-S.mid[t] / unit[t, None], S.rad[t] / unit[t, None] + TINY)
            values[has, 3 + k] = Ball(w.mid[t] / unit[t], w.rad[t] / unit[t] + TINY)
        rows, rest = [], []
        for i, code in enumerate(codes):
            if code == OPEN:
                rows += [parts[i, k] for k in range(3) if k == 0 or tau[i, k - 1] >= 0]
                rest += [values[i, k] for k in range(3) if k == 0 or tau[i, k - 1] >= 0]
                continue
            rows.append(-S[i])
            rest.append(w[i])
            if code == STICK:
                rows += [parts[i, 3 + k] for k in range(2) if tau[i, k] >= 0]
                rest += [values[i, 3 + k] for k in range(2) if tau[i, k] >= 0]
        equations = Ball(np.array([row.mid for row in rows]), np.array([row.rad for row in rows]))
        left = Ball(np.array([float(x.mid) for x in rest]), np.array([float(x.rad) for x in rest]))
        return cls(system, tuple(codes), centre, w, parts, values, equations, left)

    def products(self) -> list[tuple[int, Ball, int]]:
        """Node, matrix and kind of multiplier of every product."""
        found = []
        for i, code in enumerate(self.codes):
            if np.all(self.system.tau[i] >= 0):
                found += [(i, matrix, kind) for matrix, kind in zip(*node_products(code), strict=True)]
        return found

    def matrices(self, numbers: Floats) -> Ball | None:
        """The products of every node times their multipliers, (p, 5, 5); None where a multiplier is not allowed."""
        products = self.products()
        if numbers.shape != (len(products),) or not np.all(np.isfinite(numbers)):
            return None
        sums = Ball(np.zeros((len(self.codes), 5, 5)), np.zeros((len(self.codes), 5, 5)))
        k = 0
        while k < len(products):
            node, matrix, kind = products[k]
            if kind == SIGNED and numbers[k] < 0:
                return None
            if kind == CONE:
                if not np.hypot(numbers[k + 1], numbers[k + 2]) * SAFE + TINY <= numbers[k]:
                    return None
                for j in range(k, k + 3):
                    sums[node] = sums[node] + products[j][1] * Ball.exact(numbers[j])
                k += 3
                continue
            sums[node] = sums[node] + matrix * Ball.exact(numbers[k])
            k += 1
        return sums


@dataclass(frozen=True, eq=False)
class Ellipsoid:
    """All solutions of a partial assignment: centre + T u with |u| <= reach; none where ``reach`` is negative.

    Attributes
    ----------
    codes : of the assignment
    numbers : multipliers of its products
    T : (m, m) array
    """

    frame: Frame
    numbers: Floats
    T: Floats
    reach: float

    @property
    def codes(self) -> tuple[int, ...]:
        """Codes of the assignment."""
        return self.frame.codes

    @classmethod
    def of(
        cls, system: EnclosedSpace, codes: Sequence[int], centre: Floats, numbers: Floats, errors: float = 1.0
    ) -> Ellipsoid | None:
        """Ellipsoid of the form with these multipliers; None where the form is not proven convex.

        Parameters
        ----------
        system : EnclosedSpace
        codes : of an assignment without undecided nodes
        centre : (m,) array, scaled forces near the minimiser
        numbers : a multiplier for every product of ``Frame.products``
        errors : 1 proves; a writer of proofs takes more, so that a checker comes to the same answer

        Raises
        ------
        ValueError
            A node is undecided.
        """
        if not moderate_units(system.unit) or not np.all(np.isfinite(centre)):
            return None
        with np.errstate(all="ignore"):
            frame = Frame.of(system, codes, centre)
            sums = frame.matrices(numbers)
            if sums is None:
                return None
            found = _columns(frame, sums.mid)
            if found is None:
                return None
            T, heavy = found
            columns = Ball.exact(T)
            K, h, k = Ball(np.zeros_like(T), np.zeros_like(T)), Ball.exact(np.zeros(len(T))), Ball.exact(np.zeros(()))
            for i in np.flatnonzero(np.any(sums.mid != 0, axis=(1, 2))):
                rows, value = frame.parts[i] @ columns, frame.values[i][:, None]
                pushed = sums[i] @ value
                K = K - rows.T @ (sums[i] @ rows)
                h = h - (rows.T @ pushed)[:, 0]
                k = k - (value.T @ pushed)[0, 0]
            scale = Ball.exact(heavy[:, None])
            rows, value = (frame.equations @ columns) * scale, frame.rest[:, None] * scale
            K, h, k = K + rows.T @ rows, h + (rows.T @ value)[:, 0], k + (value.T @ value)[0, 0]
            # u'K u + 2 h'u + k <= 0, and K is near the unit matrix
            off = float(upper_norm((K.symmetric - Ball.exact(np.eye(len(T)))).size)) * SAFE * errors
            pull = float(upper_norm(h.size)) * SAFE
            low = float(k.mid) - errors * (float(k.rad) + 4 * UNIT * abs(float(k.mid))) * SAFE - TINY
            if not off < _NEAR or not np.isfinite(pull) or not np.isfinite(low):
                return None
            least = (1.0 - off) / SAFE
            # least |u|^2 - 2 pull |u| + low <= 0
            under = pull * pull * SAFE * SAFE - least * low / (SAFE if low > 0 else 1.0 / SAFE)
            reach = -1.0 if under < 0 else (pull + np.sqrt(under) * SAFE) / least * SAFE * SAFE
            reach = reach if reach < 0 else reach * (1.0 + (errors - 1.0) * MARGIN)
        return cls(frame, numbers, T, float(reach)) if np.isfinite(reach) else None

    @property
    def empty(self) -> bool:
        """True if the assignment has no solution."""
        return self.reach < 0

    def _bounds(self, rows: Ball, value: Ball) -> tuple[Floats, Floats]:
        """Lower and upper bounds of value + rows (y - centre)."""
        moved = Ball.exact(self.T).T @ rows.T
        away = upper_norm(moved.size, axis=0) * self.reach * SAFE + value.rad
        away = away * SAFE + 4 * UNIT * np.abs(value.mid) + TINY
        return value.mid - away, value.mid + away

    def misses(self, codes: Sequence[int]) -> bool:
        """True if no solution of the assignment has the statuses of another one, which refines it."""
        if self.empty:
            return True
        pairs = enumerate(zip(self.codes, codes, strict=True))
        return any(one != other and self.node_misses(i, other) for i, (one, other) in pairs)

    def margin(self, codes: Sequence[int], rows: Sequence[Row], values: Floats, errors: float = 1.0) -> float:
        """Infinite where no solution has the statuses of an assignment, otherwise -inf; of no multipliers."""
        del values, errors
        return np.inf if not len(rows) and self.misses(codes) else -np.inf

    def node_misses(self, i: int, code: int) -> bool:
        """True if node i has this status at no solution of the assignment."""
        if code == STICK:
            low, high = self._bounds(self.frame.parts[i, _V], self.frame.values[i, _V])
            return bool(np.any((low > 0) | (high < 0)))
        if code <= SECTORS:
            return False
        a, b = (np.array(direction(number)) for number in (code - SECTORS, end_number(code - SECTORS)))
        inner = Ball(np.array([[-a[1], a[0]], [b[1], -b[0]]]), np.full((2, 2), UNIT))
        for part in (_T, _V):
            rows = inner @ self.frame.parts[i, part]
            value = (inner @ self.frame.values[i, part][:, None])[:, 0]
            if np.any(self._bounds(rows, value)[1] < 0):
                return True
        return False

    def is_in(self, box: Box, errors: float = 1.0) -> bool:
        """True if all solutions of the assignment lie in a box (``errors`` as above)."""
        if self.empty:
            return True
        with np.errstate(all="ignore"):
            frame, rho, T = self.frame, Ball.exact(box.rho), Ball.exact(self.T)
            S = Ball(frame.system.S, frame.system.S_rad)
            away = (Ball.exact(frame.centre) - Ball.exact(box.centre)) - rho * (frame.w - box.w)
            columns = T + rho[:, None] * (S @ T)
            size = (away.size + upper_norm(columns.size, axis=1) * self.reach) * SAFE
            return bool(np.all(size * SAFE <= (1.0 - (errors - 1.0) * MARGIN) * box.radius))


def refines(codes: Sequence[int], over: Sequence[int]) -> bool:
    """True if every node has a status in one assignment that its status in another one allows."""
    return len(codes) == len(over) and all(map(_within, codes, over))


def _within(code: int, over: int) -> bool:
    if code == over:
        return True
    if over == CONTACT:
        return code not in (OPEN, UNDECIDED)
    return over > SECTORS and code > SECTORS and contains(over - SECTORS, code - SECTORS)


def _columns(frame: Frame, sums: Floats) -> tuple[Floats, Floats] | None:
    """Columns in which the form with the squares of the equations is near the unit matrix, and their weights' roots.

    Nothing rests on it: what is near it is proven.
    """
    rows = frame.equations.mid
    size = np.linalg.norm(rows, axis=1)
    scaled = rows / size[:, None]
    inside = scipy.linalg.null_space(scaled, rcond=1e-13)
    if inside.shape[1] + len(rows) != rows.shape[1]:
        return None
    H = -np.einsum("iak,iab,ibl->kl", frame.parts.mid, sums, frame.parts.mid, optimize=True)
    try:
        own = inside.T @ H @ inside
        scale = 1.0 / np.sqrt(np.diagonal(own))
        factor = np.linalg.cholesky(scale[:, None] * own * scale)
        T = inside @ (scale[:, None] * np.linalg.inv(factor).T)
        across = np.linalg.pinv(scaled)
    except np.linalg.LinAlgError:
        return None
    if not np.all(np.isfinite(T)):
        return None
    # across less what the form couples to the inside
    across = across - T @ (T.T @ (H @ across))
    weight = _HEAVIER * (float(np.linalg.norm(across.T @ H @ across, 2)) + 1e-300)
    root = np.sqrt(weight)
    return np.column_stack([T, across / root]), root / size
