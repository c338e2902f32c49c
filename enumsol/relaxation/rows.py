"""Rows of the relaxation: what a (partial) status of a contact node imposes, as linear rows (theory, section 5)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from enumsol.statuses import CONDITIONS, FRICTIONLESS, OPEN, UNDECIDED, RowKind

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray


INEQUALITY, EQUALITY = 1, 2
_R = RowKind


def status_rows(code: int, *, friction: bool) -> tuple[tuple[RowKind, int], ...]:
    """(kind, mode) of the rows that a node of this code imposes; those of a child extend its parent's."""
    if not friction and code == UNDECIDED:
        return (_R.PENETRATION, INEQUALITY), (_R.NORMAL_FORCE, INEQUALITY), (_R.TANGENTIAL_FORCE, EQUALITY)
    return _STATUS_ROWS[code]


def _rows_of(code: int) -> tuple[tuple[RowKind, int], ...]:
    """The rows of a status; in contact with friction the cone of its parent stands for lambda_n >= 0."""
    equations, inequalities = CONDITIONS[code]
    parent = (_R.PENETRATION,) if code in (OPEN, FRICTIONLESS) else CONDITIONS[UNDECIDED].inequalities
    rows = dict.fromkeys(parent, INEQUALITY)
    rows |= dict.fromkeys(inequalities, INEQUALITY) | dict.fromkeys(equations, EQUALITY)
    if rows.keys() >= {_R.CONE_PLUS, _R.CONE_MINUS}:
        rows.pop(_R.NORMAL_FORCE, None)
    return tuple(rows.items())


_STATUS_ROWS = {code: _rows_of(code) for code in CONDITIONS}


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


def row_normals(
    p: int, F: NDArray[np.float64], S: NDArray[np.float64], numbers: NDArray[np.intp]
) -> NDArray[np.float64]:
    """Gradients by lambda of some rows, up to sign, one below the other; w = g - S lambda."""
    kind, node = np.divmod(numbers, p)
    normals = np.zeros((len(numbers), 2 * p))
    for k, i, normal in zip(kind.tolist(), node.tolist(), normals, strict=True):
        if k >= _R.PENETRATION:
            normal[:] = S[i if k == _R.PENETRATION else p + i]
        elif k in (_R.CONE_PLUS, _R.CONE_MINUS):
            normal[i], normal[p + i] = F[i], -1.0 if k == _R.CONE_PLUS else 1.0
        else:
            normal[i if k == _R.NORMAL_FORCE else p + i] = 1.0
    return normals


def imposed_rows(code: int, *, friction: bool) -> dict[int, int]:
    """Mode of every row that holds in a (partial) status, those implied by others included (see with_implied)."""
    return with_implied(code, status_rows(code, friction=friction))


def with_implied(code: int, rows: Iterable[tuple[int, int]]) -> dict[int, int]:
    """Mode of every row that holds in a (partial) status of these rows, those implied by others included.

    A multiplier of an INEQUALITY must be nonnegative, one of an EQUALITY is free; any other row proves nothing.
    """
    imposed: dict[int, int] = dict.fromkeys((_R.NORMAL_FORCE, _R.CONE_PLUS, _R.CONE_MINUS, _R.PENETRATION), INEQUALITY)
    imposed |= dict(rows)
    if code == OPEN:
        imposed |= dict.fromkeys((_R.CONE_PLUS, _R.CONE_MINUS), EQUALITY)
    return imposed
