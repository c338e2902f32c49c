"""The linear algebra of one selection, once for floats, exact numbers and balls (theory, sections 2.3 and 7.14).

Every arithmetic writes a selection with the same index arrays. The unknowns y are lambda_n of the nodes in contact and
lambda_t of those that stick, lambda = E y, and the selection's equations are M y = g in the rows of w that vanish,
with M the same rows of S E.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any, TypeVar

import numpy as np

from enumsol.arithmetic.balls import Ball
from enumsol.support.array_types import Indices, Mask, NDArray
from enumsol.trusted.status_rows import OPEN, STICK

#: Balls of double arithmetic, or arrays of floats or of exact numbers.
Numbers = TypeVar("Numbers", Ball, NDArray[Any])

NORMAL_FORCE, TANGENTIAL_FORCE, CONE_PLUS, CONE_MINUS, PENETRATION, SLIP_FORWARD, SLIP_BACKWARD = range(7)
#: 1 for slip+, -1 for slip-, by status code.
_SIDES = np.array([0, 0, 1, -1, 0, 0, 0, 0, 0])
#: rho - q and rho + q, of a coordinate q of the rigid displacement and its bound; 7 and 8 are rows over an interval.
BOUND_PLUS, BOUND_MINUS = 9, 10


class Unknowns:
    """Forces of some nodes: lambda_n, and lambda_t where it is neither zero nor a multiple of lambda_n.

    Arrays of S, F and of these forces may hold floats, exact numbers (dtype object) or be a Ball.

    Parameters
    ----------
    p : number of contact nodes
    nodes : int array
    own : bool array, those of them with a lambda_t of their own
    directions : 1 or -1 for each node whose lambda_t is F or -F times lambda_n, else 0

    Attributes
    ----------
    places : int array, of lambda_n of all these nodes and of lambda_t of those that have one, in lambda
    normal : int array, numbers among ``nodes`` of those with a lambda_t
    side : int array, numbers among ``nodes`` of those whose lambda_t turns with lambda_n
    """

    def __init__(self, p: int, nodes: Indices, own: Mask, directions: Indices) -> None:
        self.nodes, self.normal = nodes, own.nonzero()[0]
        self.places = np.concatenate([nodes, p + nodes[own]])
        self.side = directions.nonzero()[0]
        self._turned, self._directions = nodes[self.side], directions[self.side]
        self._along = p + self._turned

    @cached_property
    def tangential(self) -> Indices:
        """Places among these forces of the lambda_t of every node, -1 without one."""
        found = np.full(len(self.nodes), -1, dtype=np.intp)
        found[self.normal] = len(self.nodes) + np.arange(len(self.normal))
        return found

    def columns(self, S: Any, F: Any, unit: Any = 1) -> Any:
        """S E for S, or for any of its rows: a column for each of these forces, which are y, lambda = E y.

        E is linear in (unit, F). With ``unit`` 0 and the slope of F this is the slope of S E; with F as integers over a
        common denominator ``unit``, y is lambda / unit.

        Parameters
        ----------
        S : (m, 2p) array or Ball
        F : (p,) array or Ball
            Friction coefficients, times ``unit``.
        """
        columns = _times(S[:, self.places], unit)
        if len(self.side):
            turned = S[:, self._along] * signed(F[self._turned], self._directions)
            columns[:, self.side] = columns[:, self.side] + turned if unit != 0 else turned
        return columns

    def put(self, y: Any, F: Any, force: Any, unit: Any = 1) -> None:
        """Put these forces into lambda, (2p,) or (2p, k)."""
        force[self.places] = _times(y, unit)
        if len(self.side):
            turn, slipping = signed(F[self._turned], self._directions), y[self.side]
            force[self._along] = slipping * (turn if slipping.ndim == 1 else turn[:, None])


class Selection(Unknowns):
    """Unknown forces of a selection, its equations, and the conditions that have to be nonnegative.

    Parameters
    ----------
    codes : p status codes
        Complete; of a partial assignment those of the nodes that are fixed, and OPEN at the others.
    modes : int
        Of a body that nothing holds, its rigid modes: as many rows of S, g and lambda follow those of the contact
        nodes, and are always among the unknowns and the equations (theory, section 14.2). Their bounds are among the
        conditions.

    Attributes
    ----------
    codes : tuple of status codes
    closed, stick, slip : int arrays
        Nodes in contact, and those of them that stick or slip; the places of their lambda_n among the unknowns are
        ``normal`` and ``side``.
    unknown : int array
        Rows of lambda (and of w = 0) that the unknowns stand for: p + node for tangential ones.
    slip_signs : int array
        1 for slip+, -1 for slip-.
    moving, moving_signs : int arrays
        Rows of w that have to be nonnegative, and the signs by which they are multiplied.
    """

    def __init__(self, codes: Sequence[int], modes: int = 0) -> None:
        self.codes = tuple(codes)
        self.p = p = len(self.codes)
        self.size, self.modes = 2 * p + modes, np.arange(modes)
        given = np.array(self.codes, dtype=np.intp)
        opened, self.closed = (given == OPEN).nonzero()[0], (given != OPEN).nonzero()[0]
        own = given[self.closed]
        super().__init__(p, self.closed, own == STICK, _SIDES[own])
        self.places = self.unknown = np.concatenate([self.places, 2 * p + self.modes])
        self.stick, self.slip, self.slip_signs = self.closed[self.normal], self._turned, self._directions
        self.moving = np.concatenate([opened, self._along])
        self.moving_signs = np.concatenate([-np.ones(len(opened), dtype=np.intp), self.slip_signs])

    @cached_property
    def conditions(self) -> tuple[tuple[int, int], ...]:
        """Nodes and kinds of what has to be nonnegative.

        Rows of w, forces lambda_n, then both sides of the cones of sticking nodes, then both bounds of the rigid
        displacement; for its mode j the node is p + j.
        """
        p, modes, moving = self.p, range(len(self.modes)), self.moving.tolist()
        stick, slips = self.stick.tolist(), zip(self.slip.tolist(), self.slip_signs.tolist(), strict=True)
        return (
            *((row, PENETRATION) for row in moving if row < p),
            *((i, SLIP_FORWARD if sign > 0 else SLIP_BACKWARD) for i, sign in slips),
            *((i, NORMAL_FORCE) for i in self.closed.tolist()),
            *((i, CONE_PLUS) for i in stick),
            *((i, CONE_MINUS) for i in stick),
            *((p + j, BOUND_PLUS) for j in modes),
            *((p + j, BOUND_MINUS) for j in modes),
        )

    def matrix(self, S: Any, F: Any) -> Any:
        """M of the selection's equations, square; S is (2p, 2p)."""
        return self.columns(S[self.unknown], F)

    def forces(self, y: Any, F: Any, zero: Any = 0.0, unit: Any = 1) -> Any:
        """lambda = E y, shape (2p,) or (2p, k), for unknowns in rows; ``zero`` is that of the arithmetic."""
        force = _filled(y, (self.size, *y.shape[1:]), zero)
        self.put(y, F, force, unit)
        return force

    def inequalities(self, W: Any, g: Any, F: Any, zero: Any = 0.0, unit: Any = 1, reach: Any = ()) -> tuple[Any, Any]:
        """C and c of the conditions c + C y, in their order, from W = ``columns`` of S and g, all rows.

        ``reach`` are the bounds of the last unknowns, which are q.
        """
        count, size, closed = len(self.conditions), len(self.unknown), len(self.closed)
        C, c = _filled(W, (count, size), zero), _filled(g, (count,), zero)
        first, stick = len(self.moving), np.arange(len(self.stick))
        C[:first], c[:first] = (
            signed(W[self.moving], -self.moving_signs[:, None]),
            signed(g[self.moving], self.moving_signs),
        )
        C[first + np.arange(closed), np.arange(closed)] = zero + unit
        for start, side in ((first + closed, -unit), (first + closed + len(stick), unit)):
            C[start + stick, self.normal] = F[self.stick]
            C[start + stick, closed + stick] = zero + side
        for j, side in ((self.modes - 2 * len(self.modes), -unit), (self.modes - len(self.modes), unit)):
            if len(j):
                C[j, self.modes - len(self.modes)], c[j] = zero + side, _times(reach, unit)
        return C, c

    def slacks(self, y: Any, w: Any, F: Any, reach: Any = None) -> Any:
        """Values of the conditions at y and w = g - S E y; also their slopes, but for the change of F.

        ``reach`` as of ``inequalities``; None where nothing is bounded.
        """
        closed = len(self.closed)
        bound, stuck = F[self.stick] * y[self.normal], y[closed : closed + len(self.stick)]
        moves = signed(w[self.moving], self.moving_signs)
        bounds = () if reach is None else (reach - y[-len(self.modes) :], reach + y[-len(self.modes) :])
        return joined(moves, y[: len(self.closed)], bound - stuck, bound + stuck, *bounds)


def row_values(force: Any, w: Any, F: Any) -> Any:
    """Values of the seven rows of every node, shape (7, p), in the order of their kinds (see status_rows)."""
    p = F.shape[0]
    bound, t, w_t = F * force[:p], force[p : 2 * p], w[p : 2 * p]
    rows = force[:p], t, bound - t, bound + t, -w[:p], w_t, -w_t
    if isinstance(F, Ball):
        return Ball(np.stack([row.mid for row in rows]), np.stack([row.rad for row in rows]))
    return np.array(rows)


def signed(values: Any, signs: Any) -> Any:
    """Values times 1 or -1, without rounding."""
    return Ball(values.mid * signs, values.rad) if isinstance(values, Ball) else values * signs


def _times(values: Any, unit: Any) -> Any:
    """Values times 1 or 0, or exact numbers times an integer."""
    if unit == 1:
        return values
    return Ball.exact(np.zeros(values.shape)) if isinstance(values, Ball) else values * unit


def _filled(like: Any, shape: tuple[int, ...], zero: Any) -> Any:
    if isinstance(like, Ball):
        return Ball.exact(np.zeros(shape))
    found = np.empty(shape, like.dtype)
    found.fill(zero)
    return found


def joined(*parts: Any) -> Any:
    """Balls or arrays one after the other."""
    if isinstance(parts[0], Ball):
        return Ball.joined(*parts)
    return np.concatenate(parts)
