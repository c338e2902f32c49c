"""The certifier of arithmetic "exact": every conclusion in rationals (theory, sections 6.5 and 7.9)."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

from flint import fmpq, fmpq_mat

from enumsol.arithmetic.rationals import rational
from enumsol.relaxation.interval import IntervalRowKind
from enumsol.relaxation.rows import INEQUALITY, RowKind, imposed_rows
from enumsol.search.certifiers.floats import solve_or_open
from enumsol.search.certifiers.protocol import WithoutProof
from enumsol.selections.rationals import ExactSelections

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from enumsol.condensation.condensed import ScaledSystem
    from enumsol.relaxation.engine import Relaxation
    from enumsol.search.certifiers.protocol import UndecidedPart
    from enumsol.selections.solution import Codes, SelectionSolution

    #: Kind of a row, its contact node, and the multiplier in the problem's units.
    Term = tuple[int, int, Any]

_FORCE_ROWS = (
    RowKind.NORMAL_FORCE,
    RowKind.TANGENTIAL_FORCE,
    RowKind.CONE_PLUS,
    RowKind.CONE_MINUS,
    IntervalRowKind.SLIP_AT_LEAST_PLUS,
    IntervalRowKind.SLIP_AT_LEAST_MINUS,
)


class DualBound:
    """The lower bound that multipliers give on the energy (theory, (6.1)).

    Parameters
    ----------
    S : fmpq_mat (2p, 2p)
    """

    def __init__(self, S: Any) -> None:
        self._S, self._rows = S, S.tolist()

    @cached_property
    def _inverse(self) -> Any:
        return self._S.inv()

    def positive(self, terms: Iterable[Term], g: Sequence[Any], lowest: Sequence[Any], highest: Sequence[Any]) -> bool:
        """Whether -1/4 v' S^-1 v - sum u * constant > 0 with v = g + sum u * form.

        ``lowest`` and ``highest`` are the friction coefficients between which F lies.
        """
        p, v, total = len(lowest), list(g), fmpq(0)
        for kind, node, u in terms:
            if kind == RowKind.NORMAL_FORCE:
                v[node] += u
            elif kind == RowKind.TANGENTIAL_FORCE:
                v[p + node] += u
            elif kind in (RowKind.CONE_PLUS, RowKind.CONE_MINUS):
                v[node] += u * highest[node]
                v[p + node] += -u if kind == RowKind.CONE_PLUS else u
            elif kind in (IntervalRowKind.SLIP_AT_LEAST_PLUS, IntervalRowKind.SLIP_AT_LEAST_MINUS):
                v[node] -= u * lowest[node]
                v[p + node] += u if kind == IntervalRowKind.SLIP_AT_LEAST_PLUS else -u
            else:
                index = node if kind == RowKind.PENETRATION else p + node
                factor = u if kind == RowKind.SLIP_FORWARD else -u
                # a row factor * w, w = g - S lambda
                v = [x - factor * s for x, s in zip(v, self._rows[index], strict=True)]
                total -= factor * g[index]
        column = fmpq_mat([[x] for x in v])
        square = (column.transpose() * (self._inverse * column))[0, 0]
        return bool(4 * total > square)


def terms_of(
    rows: NDArray[np.intp],
    values: NDArray[np.float64],
    scaled: ScaledSystem,
    imposed: Callable[[int], Mapping[Any, int]],
) -> list[Term]:
    """The multipliers that a bound may use; ``imposed`` gives the mode of every row kind that a node imposes."""
    terms = []
    for row, value in zip(rows, values, strict=True):
        kind, node = divmod(int(row), scaled.p)
        mode = imposed(node).get(kind)
        if mode is None or (mode == INEQUALITY and value <= 0):
            continue
        # multipliers of the scaled problem, back in the problem's units
        unit = scaled.length[node] if kind in _FORCE_ROWS else scaled.force[node]
        terms.append((kind, node, rational(float(value)) * rational(float(unit))))
    return terms


class ExactCertifier(WithoutProof):
    """Rationals: a pruning needs multipliers whose dual bound is positive, exactly."""

    def __init__(self, selections: ExactSelections, scaled: ScaledSystem) -> None:
        self._selections = selections
        self._scaled = scaled
        self._bound = DualBound(selections.system.S)

    def selection(self, codes: Codes) -> SelectionSolution | UndecidedPart | None:
        """All roots in the selection."""
        return solve_or_open(self._selections, codes)

    def excluded(self, codes: Codes, relaxation: Relaxation) -> bool:
        """Whether the multipliers prove a positive lower bound on the energy."""
        system, friction = self._selections.system, self._selections.F_positive
        rows, values = relaxation.multipliers()
        terms = terms_of(rows, values, self._scaled, lambda i: imposed_rows(codes[i], friction=friction[i]))
        return self._bound.positive(terms, system.g, system.F, system.F)
