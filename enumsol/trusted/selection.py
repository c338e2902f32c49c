"""Unknowns and conditions of a complete selection, in one order for all arithmetics (theory, section 7.14)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from enumsol.trusted.status_rows import OPEN, SLIP_MINUS, SLIP_PLUS, STICK

if TYPE_CHECKING:
    from collections.abc import Sequence

NORMAL_FORCE, TANGENTIAL_FORCE, CONE_PLUS, CONE_MINUS, PENETRATION, SLIP_FORWARD, SLIP_BACKWARD = range(7)


class SelectionRows:
    """Which forces of a selection are unknown, and what has to be nonnegative.

    The unknowns y are lambda_n of the nodes in contact, then lambda_t of those that stick.

    Parameters
    ----------
    codes : p status codes, complete

    Attributes
    ----------
    codes : tuple of status codes
    closed, stick, slip : int arrays
        Nodes in contact, and those of them that stick or slip.
    unknown : int array
        Rows of lambda (and of w = 0) that the unknowns stand for: p + node for tangential ones.
    slip_columns, stick_columns : int arrays
        Places among the unknowns of lambda_n of the slipping and the sticking nodes.
    slip_signs : array
        1 for slip+, -1 for slip-.
    moving, moving_signs : arrays
        Rows of w that have to be nonnegative, and the signs by which they are multiplied.
    conditions : tuple of (node, kind)
        What has to be nonnegative: rows of w, forces lambda_n, then both sides of the cones of sticking nodes.
    """

    def __init__(self, codes: Sequence[int]) -> None:
        self.codes = tuple(codes)
        p = len(self.codes)
        opened = [i for i, code in enumerate(self.codes) if code == OPEN]
        closed = [i for i, code in enumerate(self.codes) if code != OPEN]
        stick = [i for i in closed if self.codes[i] == STICK]
        slip = [i for i in closed if self.codes[i] in (SLIP_PLUS, SLIP_MINUS)]
        place = {i: j for j, i in enumerate(closed)}
        self.closed, self.stick, self.slip = (np.array(nodes, dtype=np.intp) for nodes in (closed, stick, slip))
        self.unknown = np.array([*closed, *(p + i for i in stick)], dtype=np.intp)
        self.slip_columns = np.array([place[i] for i in slip], dtype=np.intp)
        self.stick_columns = np.array([place[i] for i in stick], dtype=np.intp)
        self.slip_signs = np.array([1.0 if self.codes[i] == SLIP_PLUS else -1.0 for i in slip])
        self.moving = np.array([*opened, *(p + i for i in slip)], dtype=np.intp)
        self.moving_signs = np.concatenate([-np.ones(len(opened)), self.slip_signs])
        directions = [SLIP_FORWARD if self.codes[i] == SLIP_PLUS else SLIP_BACKWARD for i in slip]
        self.conditions: tuple[tuple[int, int], ...] = (
            *((i, PENETRATION) for i in opened),
            *zip(slip, directions, strict=True),
            *((i, NORMAL_FORCE) for i in closed),
            *((i, CONE_PLUS) for i in stick),
            *((i, CONE_MINUS) for i in stick),
        )
