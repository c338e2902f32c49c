"""Multipliers in proofs about problems in 3D, read as strictly as in ``proof.reading``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.model.sectors import DEEPEST
from enumsol.proof.reading import bytes_from, shown
from enumsol.trusted.space.sector_rows import FORCE, GAP, RIGHT

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from enumsol.trusted.space.sector_rows import Row

#: Numbers of directions and sectors in rows are less: tangents may be two levels finer than the finest sector.
_NUMBERS = 1 << (DEEPEST + 3)


def multipliers_in_space(rows: Any, text: Any, p: int) -> tuple[list[Row], NDArray[np.float64]]:
    """Rows and as many multipliers."""
    if not all((isinstance(rows, list), isinstance(text, str))):
        raise ValueError("its multipliers are no list of rows and a text")
    values = np.frombuffer(bytes_from(text), dtype="<f8").astype(np.float64)
    if len(rows) != len(values):
        raise ValueError(f"{len(rows)} rows and {len(values)} multipliers")
    return [_row(row, p) for row in rows], values


def _row(row: Any, p: int) -> Row:
    if not isinstance(row, list) or len(row) != 3 or not all(type(x) is int for x in row):
        raise ValueError(f"{shown(row)} is no row")
    kind, node, number = row
    known = 0 <= kind <= RIGHT and 0 <= node < p and -1 <= number < _NUMBERS
    if not known or (kind in (GAP, FORCE) and number):
        raise ValueError(f"row {shown(row)} does not exist")
    return kind, node, number
