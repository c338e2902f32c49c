"""The alpha at which one selection holds: its critical points and the intervals between them (theory, section 7.3).

A selection is cut at every alpha where its determinant or one of its conditions vanishes. Between neighbouring critical
points all signs are constant, so one rational sample decides whether the selection is consistent there; at a critical
point the signs follow from those beside it and from what vanishes there. Nothing is rounded.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cache
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from enumsol.arithmetic.algebraic import CriticalAlpha, merge, rational_between, real_roots, sign
from enumsol.model.statuses import CONDITIONS, FINAL, STICK, RowKind
from enumsol.selections.functions import SelectionFunctions

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flint import fmpq, fmpz_poly

    from enumsol.condensation.exact import ExactCondensed
    from enumsol.selections.rational_selections import FiberSelections
    from enumsol.selections.solution import ActiveSets, SelectionSolution
    from enumsol.support.array_types import Codes

#: What makes a critical point, apart from the numbers of rows: the determinant vanishes; an end of the interval.
_DET, _END = -1, -2


@dataclass(eq=False)
class SelectionEvent:
    """A critical point of a selection.

    Attributes
    ----------
    codes : the selection
    alpha : CriticalAlpha
    holds : bool
        The selection has a solution there.
    singular : bool
        Its determinant vanishes there: its solutions form a polytope, or it has none.
    polytope : (FiberSelections, SelectionSolution) or None
        Its solutions there, where it is singular, with their solver.
    active : per node all codes that hold on its solutions, once asked for
    settled : bool
        Every selection that holds there is known.
    bounded : bool
        A solution there lies at a bound of the rigid displacement of a body that nothing holds.
    vertex : int
        The vertex of the graph it belongs to, once glued; -1 before.
    """

    codes: Codes
    alpha: CriticalAlpha
    holds: bool = False
    singular: bool = False
    polytope: tuple[FiberSelections, SelectionSolution] | None = None
    active: ActiveSets = ()
    settled: bool = True
    bounded: bool = False
    vertex: int = -1


@dataclass
class Cell:
    """An open interval between neighbouring events of a selection.

    Attributes
    ----------
    sample : fmpq
        A point in it.
    holds : bool
        The selection is consistent there.
    det_sign : int
        Sign of its determinant, the index of an arc on which no condition vanishes identically.
    """

    sample: Any
    holds: bool
    det_sign: int


@dataclass
class SelectionArcs:
    """Cells in which one selection holds: events, and the cells between them (one fewer).

    Attributes
    ----------
    codes : tuple of status codes
    functions : SelectionFunctions
    events, cells : lists in the order of alpha
    grazing : bool
        A condition vanishes identically: on its cells other selections hold too.
    bounded : bool
        So does the slack of a bound of the rigid displacement.
    """

    codes: Codes
    functions: SelectionFunctions
    events: list[SelectionEvent] = field(default_factory=list)
    cells: list[Cell] = field(default_factory=list)
    grazing: bool = False
    bounded: bool = False

    @property
    def empty(self) -> bool:
        """True if the selection holds nowhere in the interval."""
        return not any(event.holds for event in self.events)

    def beside(self, event: SelectionEvent) -> bool:
        """True if the selection holds in a cell beside the event."""
        k = self.events.index(event)
        return any(self.cells[j].holds for j in (k - 1, k) if 0 <= j < len(self.cells))

    def event_at(self, alpha: CriticalAlpha) -> tuple[SelectionEvent, bool]:
        """The event at this alpha; where there is none, the cell is cut in two (True)."""
        after, high = 0, len(self.events)
        while after < high:
            middle = (after + high) // 2
            order = self.events[middle].alpha.compare(alpha)
            if order == 0:
                return self.events[middle], False
            after, high = (middle + 1, high) if order < 0 else (after, middle)
        cell = self.cells[after - 1]
        event = SelectionEvent(self.codes, alpha, cell.holds, self.functions.singular, bounded=self.bounded)
        left = rational_between(self.events[after - 1].alpha, alpha)
        right = rational_between(alpha, self.events[after].alpha)
        halves = [replace(cell, sample=left), replace(cell, sample=right)]
        # together: an interruption comes before or after this
        self.events[after:after], self.cells[after - 1 : after] = [event], halves
        return event, True


def selection_arcs(exact: ExactCondensed, codes: Codes, a: fmpq, b: fmpq) -> SelectionArcs | None:
    """Cells and events of a selection in [a, b]; None when its determinant vanishes identically.

    Parameters
    ----------
    exact : ExactCondensed
    codes : status codes
    a, b : fmpq, a <= b
    """
    functions = SelectionFunctions(exact, codes)
    if functions.singular:
        return None
    rows = [functions.row(kind, i) for i, code in enumerate(codes) for kind in _required(code)]
    margins = functions.margins()
    arcs = SelectionArcs(codes, functions, grazing=any(row.is_zero() for row in rows))
    arcs.bounded = any(margin.is_zero() for margin in margins)
    rows = [row for row in rows if not row.is_zero()]
    contact = len(rows)
    rows += [margin for margin in margins if not margin.is_zero()]
    # as on weak springs (theory, section 14.2)
    side = -1 if len(exact.reach) % 2 else 1
    points = _critical_points(functions.det, rows, a, b)
    if points is None:
        return arcs
    groups = merge(points)
    vanishing = [{points[number] for number in group} for group in groups]
    arcs.events = [
        SelectionEvent(codes, group[0], singular=_DET in zero) for group, zero in zip(groups, vanishing, strict=True)
    ]
    signs = []
    for left, right in pairwise(arcs.events):
        at = rational_between(left.alpha, right.alpha)
        det = sign(functions.det(at))
        signs.append([det * sign(row(at)) for row in rows])
        arcs.cells.append(Cell(at, min(signs[-1], default=1) > 0, side * det))
    for k, (event, zero) in enumerate(zip(arcs.events, vanishing, strict=True)):
        if any(cell.holds for cell in arcs.cells[max(k - 1, 0) : k + 1]):
            event.holds = True
        elif event.singular:
            # consistent only where every numerator vanishes too; whether the polytope is empty is decided elsewhere
            event.holds = all(event.alpha.sign_of(poly) == 0 for poly in functions.numerators)
        elif arcs.cells:
            near = signs[max(k - 1, 0)]
            event.holds = all(j in zero or s > 0 for j, s in enumerate(near))
        else:
            det = event.alpha.sign_of(functions.det)
            event.holds = all(det * event.alpha.sign_of(row) >= 0 for row in rows)
        event.bounded = arcs.bounded or any(k >= contact for k in zero)
    return arcs


def _required(code: int) -> tuple[RowKind, ...]:
    """Rows that are not negative in a status: at a sticking node lambda_n too, which its cone does not imply at F = 0.

    A friction coefficient that is positive inside the interval may vanish at one of its ends.
    """
    inequalities = CONDITIONS[code].inequalities
    return (RowKind.NORMAL_FORCE, *inequalities) if code == STICK else inequalities


def _critical_points(det: fmpz_poly, rows: Sequence[Any], a: fmpq, b: fmpq) -> dict[CriticalAlpha, int] | None:
    """Roots of the determinant and of the rows, and both ends of the interval, with what vanishes there.

    That is the number of a row, _DET or, at an end, _END. None when a row is negative on the whole interval: the
    selection then holds nowhere in it.
    """
    points = dict.fromkeys(real_roots(det, a, b), _DET)
    det_sign = 0 if points else sign(det(a))
    for k, row in enumerate(rows):
        roots = real_roots(row, a, b)
        if not roots and det_sign * sign(row(a)) < 0:
            return None
        points |= dict.fromkeys(roots, k)
    return points | dict.fromkeys((CriticalAlpha.rational(end) for end in ((a, b) if a != b else (a,))), _END)


def active_sets(functions: SelectionFunctions, alpha: CriticalAlpha, exact: ExactCondensed) -> ActiveSets:
    """Per node the codes that hold at the selection's solution at ``alpha``, where its determinant does not vanish."""
    det_sign = alpha.sign_of(functions.det)

    @cache
    def row_sign(kind: RowKind, i: int) -> int:
        if kind in CONDITIONS[functions.codes[i]].equations or (row := functions.row(kind, i)).is_zero():
            return 0
        return det_sign * alpha.sign_of(row)

    def holds(code: int, i: int) -> bool:
        return all(row_sign(kind, i) == 0 for kind in CONDITIONS[code].equations) and all(
            row_sign(kind, i) >= 0 for kind in _required(code)
        )

    return tuple(
        frozenset(code for code in FINAL[not exact.frictionless[i]] if code == own or holds(code, i))
        for i, own in enumerate(functions.codes)
    )
