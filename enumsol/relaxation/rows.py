"""Rows of the relaxation: what a (partial) status of a contact node imposes, as linear rows (theory, section 5)."""

from __future__ import annotations

import enum
from typing import TYPE_CHECKING

import numpy as np

from enumsol.statuses import CONTACT, FRICTIONLESS, OPEN, SLIP_MINUS, SLIP_PLUS, STICK, UNDECIDED

if TYPE_CHECKING:
    from numpy.typing import NDArray


class RowKind(enum.IntEnum):
    """Rows ``row >= 0`` (or ``= 0``, as an equality) of a contact node; row number = kind * p + node."""

    NORMAL_FORCE = 0  # lambda_n
    TANGENTIAL_FORCE = 1  # lambda_t
    CONE_PLUS = 2  # F lambda_n - lambda_t
    CONE_MINUS = 3  # F lambda_n + lambda_t
    PENETRATION = 4  # -w_n
    SLIP_FORWARD = 5  # w_t
    SLIP_BACKWARD = 6  # -w_t


_R = RowKind
INEQUALITY, EQUALITY = 1, 2

#: Rows of every status (rows of a child extend its parent's).
STATUS_ROWS: dict[int, tuple[tuple[RowKind, int], ...]] = {
    UNDECIDED: ((_R.PENETRATION, 1), (_R.CONE_PLUS, 1), (_R.CONE_MINUS, 1)),
    OPEN: ((_R.PENETRATION, 1), (_R.NORMAL_FORCE, 2), (_R.TANGENTIAL_FORCE, 2)),
    CONTACT: ((_R.PENETRATION, 2), (_R.CONE_PLUS, 1), (_R.CONE_MINUS, 1)),
    STICK: ((_R.PENETRATION, 2), (_R.CONE_PLUS, 1), (_R.CONE_MINUS, 1), (_R.SLIP_FORWARD, 2)),
    SLIP_PLUS: ((_R.PENETRATION, 2), (_R.CONE_PLUS, 2), (_R.CONE_MINUS, 1), (_R.SLIP_FORWARD, 1)),
    SLIP_MINUS: ((_R.PENETRATION, 2), (_R.CONE_MINUS, 2), (_R.CONE_PLUS, 1), (_R.SLIP_BACKWARD, 1)),
    FRICTIONLESS: ((_R.PENETRATION, 2), (_R.NORMAL_FORCE, 1), (_R.TANGENTIAL_FORCE, 2)),
}
_UNDECIDED_FRICTIONLESS = ((_R.PENETRATION, 1), (_R.NORMAL_FORCE, 1), (_R.TANGENTIAL_FORCE, 2))


def status_rows(code: int, *, friction: bool) -> tuple[tuple[RowKind, int], ...]:
    """(kind, mode) of the rows that a node of this code imposes."""
    if code == UNDECIDED and not friction:
        return _UNDECIDED_FRICTIONLESS
    return STATUS_ROWS[code]


def row_terms(p: int, F: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float64]]:
    """All rows as sparse combinations of y = (lambda, w), w of shape (2p,): start, index and value arrays."""
    start, index, value = [0], [], []
    for kind in RowKind:
        for i in range(p):
            terms = {
                _R.NORMAL_FORCE: ((i, 1.0),),
                _R.TANGENTIAL_FORCE: ((p + i, 1.0),),
                _R.CONE_PLUS: ((i, F[i]), (p + i, -1.0)),
                _R.CONE_MINUS: ((i, F[i]), (p + i, 1.0)),
                _R.PENETRATION: ((2 * p + i, -1.0),),
                _R.SLIP_FORWARD: ((3 * p + i, 1.0),),
                _R.SLIP_BACKWARD: ((3 * p + i, -1.0),),
            }[kind]
            for j, v in terms:
                index.append(j)
                value.append(v)
            start.append(len(index))
    return np.array(start, dtype=np.intp), np.array(index, dtype=np.intp), np.array(value, dtype=np.float64)


def imposed_rows(code: int, *, friction: bool) -> dict[RowKind, int]:
    """Mode of every row that holds in a (partial) status, those implied by others included.

    A multiplier of an INEQUALITY must be nonnegative, one of an EQUALITY is free; any other row proves nothing.
    """
    rows = dict.fromkeys((_R.NORMAL_FORCE, _R.CONE_PLUS, _R.CONE_MINUS, _R.PENETRATION), INEQUALITY)
    rows |= dict(status_rows(code, friction=friction))
    if code == OPEN:
        rows |= dict.fromkeys((_R.CONE_PLUS, _R.CONE_MINUS), EQUALITY)
    return rows
