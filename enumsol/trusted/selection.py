"""The linear algebra of one selection, once for floats, exact numbers and balls (theory, sections 2.3 and 7.14).

Every arithmetic writes a selection with the same index arrays. The unknowns y are lambda_n of the nodes in contact and
lambda_t of those that stick, lambda = E y, and the selection's equations are M y = g in the rows of w that vanish,
with M the same rows of S E.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.arithmetic.ball_arrays import Ball
from enumsol.trusted.status_rows import OPEN, SLIP_MINUS, SLIP_PLUS, STICK

if TYPE_CHECKING:
    from collections.abc import Sequence

NORMAL_FORCE, TANGENTIAL_FORCE, CONE_PLUS, CONE_MINUS, PENETRATION, SLIP_FORWARD, SLIP_BACKWARD = range(7)


class Selection:
    """Which forces of a selection are unknown, its equations, and what has to be nonnegative.

    Arrays of S, F, g and y may hold floats, exact numbers (dtype object) or be a Ball.

    Parameters
    ----------
    codes : p status codes
        Complete; of a partial assignment those of the nodes that are fixed, and OPEN at the others.

    Attributes
    ----------
    codes : tuple of status codes
    closed, stick, slip : int arrays
        Nodes in contact, and those of them that stick or slip.
    unknown : int array
        Rows of lambda (and of w = 0) that the unknowns stand for: p + node for tangential ones.
    slip_columns, stick_columns : int arrays
        Places among the unknowns of lambda_n of the slipping and the sticking nodes.
    slip_signs : int array
        1 for slip+, -1 for slip-.
    moving, moving_signs : int arrays
        Rows of w that have to be nonnegative, and the signs by which they are multiplied.
    conditions : tuple of (node, kind)
        What has to be nonnegative: rows of w, forces lambda_n, then both sides of the cones of sticking nodes.
    """

    def __init__(self, codes: Sequence[int]) -> None:
        self.codes = tuple(codes)
        self.p = p = len(self.codes)
        opened = [i for i, code in enumerate(self.codes) if code == OPEN]
        closed = [i for i, code in enumerate(self.codes) if code != OPEN]
        stick = [i for i in closed if self.codes[i] == STICK]
        slip = [i for i in closed if self.codes[i] in (SLIP_PLUS, SLIP_MINUS)]
        place = {i: j for j, i in enumerate(closed)}
        self.closed, self.stick, self.slip = (np.array(nodes, dtype=np.intp) for nodes in (closed, stick, slip))
        self.unknown = np.array([*closed, *(p + i for i in stick)], dtype=np.intp)
        self.slip_columns = np.array([place[i] for i in slip], dtype=np.intp)
        self.stick_columns = np.array([place[i] for i in stick], dtype=np.intp)
        self.slip_signs = np.array([1 if self.codes[i] == SLIP_PLUS else -1 for i in slip], dtype=np.intp)
        self.moving = np.array([*opened, *(p + i for i in slip)], dtype=np.intp)
        self.moving_signs = np.concatenate([-np.ones(len(opened), dtype=np.intp), self.slip_signs])
        directions = [SLIP_FORWARD if self.codes[i] == SLIP_PLUS else SLIP_BACKWARD for i in slip]
        self.conditions: tuple[tuple[int, int], ...] = (
            *((i, PENETRATION) for i in opened),
            *zip(slip, directions, strict=True),
            *((i, NORMAL_FORCE) for i in closed),
            *((i, CONE_PLUS) for i in stick),
            *((i, CONE_MINUS) for i in stick),
        )

    def columns(self, S: Any, F: Any, unit: Any = 1) -> Any:
        """S E for S, or for any of its rows: a column for every unknown.

        Parameters
        ----------
        S : (m, 2p) array or Ball
        F : (p,) array or Ball
            Friction coefficients, times ``unit``: integers have a common denominator, and y is lambda / unit then.
        """
        columns = S[:, self.unknown] if unit == 1 else S[:, self.unknown] * unit
        if len(self.slip):
            columns[:, self.slip_columns] = columns[:, self.slip_columns] + S[:, self.p + self.slip] * self._turn(F)
        return columns

    def matrix(self, S: Any, F: Any) -> Any:
        """M of the selection's equations, square; S is (2p, 2p)."""
        return self.columns(S[self.unknown], F)

    def forces(self, y: Any, F: Any, zero: Any = 0.0, unit: Any = 1) -> Any:
        """lambda = E y, shape (2p,) or (2p, k), for unknowns in rows; ``zero`` is that of the arithmetic."""
        rows = 2 * self.p
        force: Any
        if isinstance(y, Ball):
            force = Ball.exact(np.zeros((rows, *y.mid.shape[1:])))
        else:
            force = np.empty((rows, *y.shape[1:]), y.dtype)
            force.fill(zero)
        force[self.unknown] = y if unit == 1 else y * unit
        if len(self.slip):
            turn = self._turn(F)
            slipping = y[self.slip_columns]
            force[self.p + self.slip] = slipping * (turn if slipping.ndim == 1 else turn[:, None])
        return force

    def _turn(self, F: Any) -> Any:
        """lambda_t / lambda_n of the slipping nodes."""
        chosen = F[self.slip]
        return Ball(chosen.mid * self.slip_signs, chosen.rad) if isinstance(chosen, Ball) else chosen * self.slip_signs


def row_values(force: Any, w: Any, F: Any) -> Any:
    """Values of the seven rows of every node, shape (7, p), in the order of their kinds (see status_rows)."""
    p = len(F)
    bound, t = F * force[:p], force[p:]
    return np.array([force[:p], t, bound - t, bound + t, -w[:p], w[p:], -w[p:]])
