"""The proof's vocabulary: status codes, rows, which multipliers are allowed, and how branchings split an assignment.

This module states the mathematics on which a proof rests (theory, sections 5.2, 5.4); it holds no algorithm. It
is the checkers' own copy of the table in ``enumsol.model.statuses``, which the search reads.

Status codes: 0 open, 1 stick, 2 slip+, 3 slip-, 4 in contact at a node with F = 0, 5 in contact, 6 undecided,
7 open or slip+, 8 open or slip-.

Rows of node i, row number kind * p + i, as expressions that are nonnegative (or zero):
0 lambda_n; 1 lambda_t; 2 F lambda_n - lambda_t; 3 F lambda_n + lambda_t; 4 -w_n; 5 w_t; 6 -w_t.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from enumsol.support.array_types import Floats, Indices, NDArray

#: Rows of a node at one alpha.
ROW_KINDS = 7
OPEN, STICK, SLIP_PLUS, SLIP_MINUS, FRICTIONLESS, CONTACT, UNDECIDED, FORWARD, BACKWARD = range(9)
#: The row of tables by status codes for an undecided node with F = 0.
STILL = 9

#: What a multiplier of a row may be: the row is not imposed; it holds as an inequality; it holds as an equation.
FORBIDDEN, NONNEGATIVE, FREE = 0, 1, 2

#: Of every final status, by kinds of rows, its two equations and its inequalities; its other rows follow from these.
CONDITIONS = {
    OPEN: ((0, 1), (4,)),
    STICK: ((4, 5), (2, 3)),
    SLIP_PLUS: ((4, 2), (0, 5)),
    SLIP_MINUS: ((4, 3), (0, 6)),
    FRICTIONLESS: ((4, 1), (0,)),
}

# columns are the kinds of rows 0..6, rows the status codes; last: STILL
_ROWS = np.array(
    [
        [2, 2, 2, 2, 1, 0, 0],  # open: lambda = 0, w_n <= 0
        [1, 0, 1, 1, 2, 2, 2],  # stick: w = 0
        [1, 0, 2, 1, 2, 1, 0],  # slip+: w_n = 0, lambda_t = F lambda_n, w_t >= 0
        [1, 0, 1, 2, 2, 0, 1],  # slip-: w_n = 0, lambda_t = -F lambda_n, w_t <= 0
        [1, 2, 2, 2, 2, 0, 0],  # frictionless contact: w_n = 0, lambda_t = 0 and F = 0
        [1, 0, 1, 1, 2, 0, 0],  # contact: w_n = 0, |lambda_t| <= F lambda_n
        [1, 0, 1, 1, 1, 0, 0],  # undecided: lambda_n >= 0, w_n <= 0, |lambda_t| <= F lambda_n
        [1, 0, 2, 1, 1, 0, 0],  # open or slip+: lambda_n >= 0, w_n <= 0, lambda_t = F lambda_n
        [1, 0, 1, 2, 1, 0, 0],  # open or slip-: lambda_n >= 0, w_n <= 0, lambda_t = -F lambda_n
        [1, 2, 1, 1, 1, 0, 0],  # undecided with F = 0: lambda_t = 0
    ],
    dtype=np.int8,
)


def row_table() -> NDArray[np.int8]:
    """Signs that multipliers may have, by status code (9: undecided with F = 0) and kind of row, shape (10, 7)."""
    return _ROWS.copy()


def row_signs(codes: Indices, F: Floats) -> NDArray[np.int8]:
    """Signs that multipliers of all rows may have, shape (..., p, 7), for (partial) status codes of shape (..., p)."""
    return np.asarray(_ROWS[np.where((codes == UNDECIDED) & (F == 0), STILL, codes)])


_DIRECTIONS = np.array([0, 0, 1, -1, 0, 0, 0, 1, -1])


def slip_directions(codes: Sequence[int] | Indices) -> Indices:
    """1 or -1 where a (partial) status makes lambda_t F or -F times lambda_n, else 0."""
    return np.asarray(_DIRECTIONS[np.asarray(codes, dtype=np.intp)])


def children_of(code: int, *, friction: bool) -> tuple[int, ...]:
    """The codes that together cover a partial status; empty for a final one.

    Every root in the parent lies in at least one child: open or in contact; stick, slip+ or slip-.
    """
    if code == UNDECIDED:
        return (OPEN, CONTACT) if friction else (OPEN, FRICTIONLESS)
    return _CHILDREN.get(code, ())


_CHILDREN = {
    CONTACT: (STICK, SLIP_PLUS, SLIP_MINUS),
    FORWARD: (OPEN, SLIP_PLUS),
    BACKWARD: (OPEN, SLIP_MINUS),
}
_SLIDING = (FORWARD, STICK, SLIP_MINUS), (BACKWARD, STICK, SLIP_PLUS)


def coverings_of(code: int, *, friction: bool) -> tuple[tuple[int, ...], ...]:
    """All ways to split a partial status at one alpha; none for a final one.

    An undecided node with friction may also be split three ways: stick, slip in one direction, or "open or slip in the
    other direction".
    """
    children = children_of(code, friction=friction)
    return ((children,) if children else ()) + (_SLIDING if code == UNDECIDED and friction else ())


def is_covering(code: int, children: Sequence[int], *, friction: bool) -> bool:
    """True if statuses, in any order, are a way to split a partial one."""
    return sorted(children) in map(sorted, coverings_of(code, friction=friction))


def final_codes(friction: bool) -> tuple[int, ...]:
    """The final codes of a node."""
    return (OPEN, STICK, SLIP_PLUS, SLIP_MINUS) if friction else (OPEN, FRICTIONLESS)


def refines(code: int, partial: int) -> bool:
    """True if a (partial) status is part of another one."""
    return partial in (code, UNDECIDED) or code in _CHILDREN.get(partial, ())
