"""The alpha at which one selection holds: its critical points and the intervals between them (theory, section 7.3).

A selection is cut at every alpha where its determinant or one of its conditions vanishes. Between neighbouring critical
points all signs are constant, so one rational sample decides whether the selection is consistent there; at a critical
point the signs follow from those beside it and from what vanishes there. Nothing is rounded.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

from enumsol.arithmetic.algebraic import CriticalAlpha, merge, rational_between, real_roots, sign
from enumsol.selections.functions import SelectionFunctions
from enumsol.statuses import FRICTIONLESS, OPEN, SLIP_MINUS, SLIP_PLUS, STICK

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.condensation.exact import ExactCondensed
    from enumsol.selections.ordered_field import FiberSelections
    from enumsol.selections.solution import ActiveSets, Codes, SelectionSolution


class Condition(NamedTuple):
    """A condition ``sign * poly / det >= 0`` of a selection."""

    sign: int
    poly: Any


def conditions(functions: SelectionFunctions) -> list[Condition]:
    """The inequalities of a selection, those that vanish identically included.

    A sticking node has lambda_n >= 0 too: its cone does not imply it where F = 0, at an end of the interval.
    """
    found = []
    for i, code in enumerate(functions.codes):
        if code == OPEN:
            found.append(Condition(-1, functions.gap(i)))
            continue
        found.append(Condition(1, functions.normal_force(i)))
        if code == STICK:
            found.append(Condition(1, functions.cone(i, 1)))
            found.append(Condition(1, functions.cone(i, -1)))
        elif code in (SLIP_PLUS, SLIP_MINUS):
            found.append(Condition(1 if code == SLIP_PLUS else -1, functions.slip(i)))
    return found


@dataclass(eq=False)
class Event:
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
    """Where one selection holds: events, and the cells between them (one fewer).

    Attributes
    ----------
    codes : tuple of status codes
    functions : SelectionFunctions
    events, cells : lists in the order of alpha
    grazing : bool
        A condition vanishes identically: on its cells other selections hold too.
    """

    codes: Codes
    functions: SelectionFunctions
    events: list[Event] = field(default_factory=list)
    cells: list[Cell] = field(default_factory=list)
    grazing: bool = False

    @property
    def empty(self) -> bool:
        """Whether the selection holds nowhere in the interval."""
        return not any(event.holds for event in self.events)

    def beside(self, event: Event) -> bool:
        """Whether the selection holds in a cell beside the event."""
        k = self.events.index(event)
        return any(self.cells[j].holds for j in (k - 1, k) if 0 <= j < len(self.cells))

    def event_at(self, alpha: CriticalAlpha) -> tuple[Event, bool]:
        """The event at this alpha; where there is none, the cell is cut in two (True)."""
        after, high = 0, len(self.events)
        while after < high:
            middle = (after + high) // 2
            order = self.events[middle].alpha.compare(alpha)
            if order == 0:
                return self.events[middle], False
            after, high = (middle + 1, high) if order < 0 else (after, middle)
        cell, event = self.cells[after - 1], Event(self.codes, alpha, self.cells[after - 1].holds)
        self.events.insert(after, event)
        left = rational_between(self.events[after - 1].alpha, alpha)
        right = rational_between(alpha, self.events[after + 1].alpha)
        self.cells[after - 1 : after] = [Cell(left, cell.holds, cell.det_sign), Cell(right, cell.holds, cell.det_sign)]
        return event, True


def selection_arcs(exact: ExactCondensed, codes: Codes, a: Any, b: Any) -> SelectionArcs | None:
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
    arcs = SelectionArcs(codes, functions)
    required = conditions(functions)
    arcs.grazing = any(c.poly.is_zero() for c in required)
    required = [c for c in required if not c.poly.is_zero()]
    events = _critical_points(functions.det, required, a, b)
    if events is None:
        return arcs
    owners = dict(events)
    groups = merge(owners)
    vanishing = [{owners[number] for number in group} for group in groups]
    arcs.events = [Event(codes, group[0], singular=-1 in owner) for group, owner in zip(groups, vanishing, strict=True)]
    signs = []
    for left, right in zip(arcs.events, arcs.events[1:], strict=False):
        at = rational_between(left.alpha, right.alpha)
        det = sign(functions.det(at))
        signs.append([c.sign * det * sign(c.poly(at)) for c in required])
        arcs.cells.append(Cell(at, min(signs[-1], default=1) > 0, det))
    for k, (event, zero) in enumerate(zip(arcs.events, vanishing, strict=True)):
        beside = [arcs.cells[j].holds for j in (k - 1, k) if 0 <= j < len(arcs.cells)]
        if any(beside):
            event.holds = True
        elif event.singular:
            # consistent only where every numerator vanishes too; whether the polytope is empty is decided elsewhere
            event.holds = all(event.alpha.sign_of(poly) == 0 for poly in functions.numerators)
        elif arcs.cells:
            near = signs[k - 1] if k else signs[0]
            event.holds = all(j in zero or s > 0 for j, s in enumerate(near))
        else:
            det = event.alpha.sign_of(functions.det)
            event.holds = all(c.sign * det * event.alpha.sign_of(c.poly) >= 0 for c in required)
    return arcs


def _critical_points(det: Any, required: Sequence[Condition], a: Any, b: Any) -> list[tuple[CriticalAlpha, int]] | None:
    """Roots of the determinant (owner -1) and of the conditions (their numbers), and both ends of the interval (-2).

    None when a condition is broken on the whole interval: the selection then holds nowhere in it.
    """
    points = [(number, -1) for number in real_roots(det, a, b)]
    det_sign = 0 if points else sign(det(a))
    for k, condition in enumerate(required):
        roots = real_roots(condition.poly, a, b)
        if not roots and condition.sign * det_sign * sign(condition.poly(a)) < 0:
            return None
        points += [(number, k) for number in roots]
    return points + [(CriticalAlpha.rational(end), -2) for end in ((a, b) if a != b else (a,))]


def active_sets(functions: SelectionFunctions, alpha: Any, det_sign: int, exact: ExactCondensed) -> ActiveSets:
    """Per node the codes that hold at the selection's solution at ``alpha``, where its determinant does not vanish.

    Parameters
    ----------
    functions : the selection's functions
    alpha : CriticalAlpha
    det_sign : sign of the determinant there
    exact : ExactCondensed
    """

    def at(poly: Any) -> int:
        return 0 if poly.is_zero() else det_sign * alpha.sign_of(poly)

    found = []
    for i, code in enumerate(functions.codes):
        holds = {code}
        if exact.frictionless[i]:
            value = at(functions.gap(i)) if code == OPEN else at(functions.normal_force(i))
            holds |= {OPEN, FRICTIONLESS} if value == 0 else set()
        elif code == OPEN:
            if at(functions.gap(i)) == 0:
                holds |= _tangential(at(functions.slip(i)))
        elif code == STICK:
            plus, minus = at(functions.cone(i, 1)), at(functions.cone(i, -1))
            holds |= {c for c, slack in ((SLIP_PLUS, plus), (SLIP_MINUS, minus)) if slack == 0}
            # at F = 0 both slacks vanish under a positive force
            if plus == minus == 0 and at(functions.normal_force(i)) == 0:
                holds.add(OPEN)
        else:
            moves = at(functions.slip(i))
            if at(functions.normal_force(i)) == 0:
                holds |= {OPEN} | _tangential(moves)
            elif alpha.is_rational and exact.F0[i] + exact.F1[i] * alpha.lo == 0:
                holds |= _tangential(moves)
            elif moves == 0:
                holds.add(STICK)
        found.append(frozenset(holds))
    return tuple(found)


def _tangential(slip_sign: int) -> set[int]:
    """Contact statuses that hold at a node whose slip bound is zero, by the sign of w_t."""
    return {STICK, SLIP_PLUS, SLIP_MINUS} if slip_sign == 0 else {SLIP_PLUS if slip_sign > 0 else SLIP_MINUS}
