"""The dual bound in rationals: whether multipliers prove the energy positive (theory, (6.1)).

The checker has a bound of its own, ``enumsol.checker.rational``; a test compares the two.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from flint import fmpq, fmpq_mat

from enumsol.arithmetic.rationals import rational
from enumsol.model.statuses import RowKind
from enumsol.relaxation.imposed_rows import INEQUALITY

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

    import numpy as np
    from numpy.typing import NDArray

    from enumsol.condensation.condensed import ScaledSystem
    from enumsol.selections.polytopes import Form

_DISPLACEMENTS = (RowKind.PENETRATION, RowKind.SLIP_FORWARD, RowKind.SLIP_BACKWARD)


def accepted(
    rows: NDArray[np.intp],
    values: NDArray[np.float64],
    imposed: Callable[[int], Mapping[int, int]],
    scaled: ScaledSystem,
) -> Iterator[tuple[int, int, Any]]:
    """Kind, node and multiplier, in the problem's units, of the rows that a node imposes and signs that they admit."""
    for row, value in zip(rows, values, strict=True):
        kind, node = divmod(int(row), scaled.p)
        mode = imposed(node).get(kind)
        if mode is None or (mode == INEQUALITY and value <= 0):
            continue
        unit = scaled.force[node] if kind in _DISPLACEMENTS else scaled.length[node]
        yield kind, node, rational(float(value)) * rational(float(unit))


def energy_bound_positive(g: tuple[Any, ...], inverse: Any, terms: Iterable[tuple[Any, Form]]) -> bool:
    """Whether -1/4 v' S^-1 v - sum u * constant > 0 with v = g + sum u * form, for multipliers u of affine forms."""
    v, total = list(g), fmpq(0)
    for u, (form, constant) in terms:
        v = [a + u * b for a, b in zip(v, form, strict=True)]
        total -= u * constant
    column = fmpq_mat([[a] for a in v])
    return bool(4 * total > (column.transpose() * (inverse * column))[0, 0])
