"""Arcs and vertices by exact algebra: ends of arcs are glued by the statuses that hold there (theory, section 7.6).

Two selections share a point at a critical alpha when both hold there; the signs at one of them decide this exactly.
An isolated point needs only the functions of its own selection; where a selection is singular its polytope of
solutions is computed in exact arithmetic at that alpha.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, partial
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
from flint import fmpq
from networkx.utils import UnionFind

from enumsol.arithmetic.algebraic import CriticalAlpha, merge
from enumsol.arithmetic.rationals import rational, to_fraction
from enumsol.branches.elements import (
    TOLD_APART,
    Arc,
    ArcValues,
    Effort,
    Sides,
    Vertex,
    degree_of,
    make_vertex,
    named,
    sides_of,
    with_exact_zeros,
)
from enumsol.branches.known_selections import KnownSelections
from enumsol.model.statuses import FINAL, OPEN, RowKind, contact_status
from enumsol.roots.components import RootComponent, connected_components, polytope
from enumsol.roots.local_branch import named_statuses, sign_over
from enumsol.roots.root import Polytope, RootFamily
from enumsol.search.outcome import Stop, StopReason
from enumsol.selections.functions import SelectionFunctions
from enumsol.selections.rational_selections import FiberSelections, as_float, dot
from enumsol.support.deadlines import TimeOverError, look, tell

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from fractions import Fraction

    from enumsol.branches.elements import Pair
    from enumsol.branches.known_selections import SelectionEvent
    from enumsol.condensation.exact import ExactCondensed
    from enumsol.selections.solution import ActiveSets, SelectionSolution
    from enumsol.support.array_types import Codes

    #: Tail, head and selections of an arc; the selection that represents it (of a sheet: one of its largest polytopes),
    #: an alpha inside it, its index and its dimension.
    _About = tuple[int, int, tuple[Codes, ...]]
    _More = tuple[Codes, fmpq, int | None, int]


@dataclass(frozen=True)
class ExactArcValues(ArcValues):
    """Values from exact functions, rounded last.

    Attributes
    ----------
    exact : ExactCondensed
    codes : status codes
    sample : Fraction
        An alpha inside the arc.
    """

    exact: ExactCondensed
    codes: Codes
    sample: Fraction

    @cached_property
    def _functions(self) -> SelectionFunctions:
        return SelectionFunctions(self.exact, self.codes)

    def at(self, alpha: Fraction) -> Pair:
        """Forces and displacements at an alpha."""
        point: Any = self._functions.forces_at(rational(alpha))
        if point is None:  # bounded arcs have no poles, but a rounded end may lie beyond the exact one
            point = self._functions.forces_at(rational(self.sample)) or ()
        return _as_floats(self.exact, rational(alpha), point)


def _as_floats(exact: ExactCondensed, alpha: fmpq, point: Sequence[fmpq]) -> Pair:
    """Contact forces and displacements at a point."""
    size = 2 * exact.p
    moves = [as_float(g - dot(row, point)) for g, row in zip(exact.at(alpha)[0][:size], exact.rows, strict=False)]
    return np.array([as_float(v) for v in point[:size]]), np.array(moves)


@dataclass
class GluedVertex:
    """A connected set of solutions at one critical alpha.

    Attributes
    ----------
    alpha : CriticalAlpha
    members : codes of the selections that hold there
    active : per node all codes that hold somewhere on it
    solutions : polytopes of the singular selections (empty at an isolated point)
    solver : FiberSelections of those polytopes, or None
    settled : every selection that holds there is known, and with it every arc that ends there
    bounded : it reaches a bound of the rigid displacement
    """

    alpha: CriticalAlpha
    members: list[Codes]
    active: ActiveSets
    solutions: list[SelectionSolution] = field(default_factory=list)
    solver: FiberSelections | None = None
    settled: bool = True
    bounded: bool = False

    @property
    def dimension(self) -> int:
        """0 for an isolated point."""
        return max((s.dimension for s in self.solutions), default=0)


def glue(
    known: KnownSelections,
    candidates: Iterable[Codes],
    effort: Effort = Effort(),  # noqa: B008 (frozen)
) -> tuple[list[Vertex], list[Arc], Stop | None]:
    """Vertices and arcs over [a, b] of the selections that the search found, and how far it got if not to the end.

    What stayed undecided or contradicts completeness is in ``known.reasons``.

    Parameters
    ----------
    known : KnownSelections
        Takes them in; or has those of a call that was interrupted, which are not worked out again.
    candidates : codes of the selections that may hold somewhere in [a, b]; all do if g vanishes at every alpha
    effort : Effort
        Bounds the number of candidates that are worked out. What is not joined by the deadline that holds where this is
        called is unsettled.
    """
    exact = known.exact
    # where all selections hold, with lambda = 0, one arc stands for them
    wanted = [(OPEN,) * exact.p] if exact.unloaded else sorted(set(candidates))
    waiting = [codes for codes in wanted if codes not in known.added]
    reason = effort.over(waiting, 1, lambda group: known.add(*group), lambda: len(known.added))
    stopped = None if reason is None else Stop(reason, len(known.added), arcs_of=len(wanted))
    known.cut_short = known.cut_short or len(known.added) < len(wanted)
    for codes in list(known.arcs):
        try:
            known.close(codes)
        except TimeOverError:
            del known.arcs[codes]
            known.late = known.cut_short = True
    glued = _glued(_joined(known))
    arcs = _arcs(known, glued)  # may unsettle vertices and add reasons
    if known.late and stopped is None:
        stopped = Stop(StopReason.TIME_LIMIT)
    return make_vertices(known, glued, arcs), arcs, stopped


# -- joining events ----------------------------------------------------------------------------------------------------


def _joined(known: KnownSelections) -> list[list[SelectionEvent]]:
    """Events at which selections hold, grouped by connected sets of solutions."""
    exact, union = known.exact, UnionFind()
    seen: dict[SelectionEvent, None] = {}
    waiting = known.waiting = [event for arcs in known.arcs.values() for event in arcs.events if event.holds]
    origin = exact.origin
    if origin is not None and known.a <= origin <= known.b:
        waiting += _hold_everywhere(known, CriticalAlpha.rational(origin), union)
    everything = tuple(frozenset(FINAL[not without]) for without in exact.frictionless)
    while waiting:
        event = waiting.pop()
        seen[event] = None
        if exact.unloaded or (origin is not None and event.alpha.is_rational and event.alpha.lo == origin):
            event.active = everything
            event.settled = event.settled and not known.gaps
            continue
        event.active = tuple(frozenset((code,)) for code in event.codes)
        try:
            look()
            if event.singular:
                known.solve(event)
            tell("ends of arcs joined", len(seen), len(seen) + len(waiting))
            for active in known.active_at(event):
                _join_members(known, event, active, union)
        except TimeOverError:
            event.settled, known.late = False, True
    _join_polytopes(known, seen, union)
    groups: dict[SelectionEvent, list[SelectionEvent]] = {}
    for event in seen:
        groups.setdefault(union[event], []).append(event)
    return list(groups.values())


def _hold_everywhere(known: KnownSelections, alpha: CriticalAlpha, union: UnionFind) -> list[SelectionEvent]:
    """Join all selections at the alpha where g vanishes; the events that are new."""
    events = [arcs.event_at(alpha) for arcs in known.arcs.values()]
    for event, _ in events:
        event.holds = True
        union.union(events[0][0], event)
    return [event for event, new in events if new]


def _join_members(known: KnownSelections, event: SelectionEvent, active: ActiveSets, union: UnionFind) -> None:
    """Join an event with those of all selections that hold at a point of it."""
    members, whole = known.members(active)
    event.settled = event.settled and whole
    for codes in members:
        arcs = known.arcs[codes]
        other, new = arcs.event_at(event.alpha)
        if not other.holds:
            known.contradict(f"{named(codes)} should hold at alpha = {float(event.alpha):.17g} and does not")
            event.settled = False
            continue
        if new:
            known.waiting.append(other)
        union.union(event, other)


def _join_polytopes(known: KnownSelections, events: Iterable[SelectionEvent], union: UnionFind) -> None:
    """Join polytopes at one alpha that meet away from the vertices of both."""
    by_solver: dict[FiberSelections, list[tuple[SelectionEvent, SelectionSolution]]] = {}
    for event in events:
        if event.polytope is not None and event.polytope[1].dimension > 0:
            by_solver.setdefault(event.polytope[0], []).append((event, event.polytope[1]))
    for solver, found in by_solver.items():
        try:
            for (first, a), (second, b) in combinations(found, 2):
                look()
                if union[first] != union[second] and solver.meet(a, b):
                    union.union(first, second)
        except TimeOverError:
            known.late = True
            for event, _ in found:
                event.settled = False


# -- the graph ---------------------------------------------------------------------------------------------------------


def _glued(groups: Sequence[list[SelectionEvent]]) -> list[GluedVertex]:
    """Vertices, one for each group of events, in the order of alpha."""
    by_alpha: dict[CriticalAlpha, list[list[SelectionEvent]]] = {}
    for events in groups:
        by_alpha.setdefault(events[0].alpha, []).append(events)
    vertices: list[GluedVertex] = []
    for equal in merge(by_alpha):
        alike = [events for alpha in equal for events in by_alpha[alpha]]
        for events in sorted(alike, key=lambda events: min(event.codes for event in events)):
            active = tuple(frozenset().union(*sets) for sets in zip(*(event.active for event in events), strict=True))
            settled = all(event.settled for event in events)
            vertex = GluedVertex(equal[0], sorted(event.codes for event in events), active, settled=settled)
            vertex.bounded = any(event.bounded for event in events)
            for event in events:
                event.vertex = len(vertices)
                if event.polytope is not None:
                    vertex.solver, solution = event.polytope
                    vertex.solutions.append(solution)
            vertices.append(vertex)
    return vertices


def _arcs(known: KnownSelections, vertices: list[GluedVertex]) -> list[Arc]:
    """Arcs, one for each cell in which a selection holds; of selections that coincide there, one for all."""
    found: dict[_About, _More] = {}
    for number, (codes, arcs) in enumerate(known.arcs.items()):
        tell("selections whose arcs are made", number, len(known.arcs))
        for k, cell in enumerate(arcs.cells):
            if not cell.holds:
                continue
            tail, head = arcs.events[k].vertex, arcs.events[k + 1].vertex
            first, dimension = codes, 0
            selections: tuple[Codes, ...] = (codes,)
            index: int | None = cell.det_sign
            if arcs.grazing and known.exact.unloaded:
                index = 1
            elif arcs.grazing:
                try:
                    component = _component(known, codes, cell.sample)
                except TimeOverError:
                    component, known.late = None, True
                # unknown selections that coincide here may have critical points that cut the arc further
                if component is None or (known.cut_short and not _all_known(known, component)):
                    vertices[tail].settled = vertices[head].settled = False
                    continue
                selections = tuple(sorted(s.codes for s in component.solutions))
                # a search that was cut short may not have found the others
                first = next(s.codes for s in component.solutions if s.codes in known.arcs)
                index, dimension = component.index, component.dimension
            found.setdefault((tail, head, selections), (first, cell.sample, index, dimension))
    ordered = sorted(found.items(), key=lambda item: (*item[0][:2], item[1][0]))
    return [_arc(known, number, vertices, about, more) for number, (about, more) in enumerate(ordered)]


def _arc(known: KnownSelections, number: int, vertices: Sequence[GluedVertex], about: _About, more: _More) -> Arc:
    """An arc between two vertices."""
    (tail, head, selections), (codes, at, index, dimension) = about, more
    sample = to_fraction(fmpq(at))
    begin, end = vertices[tail].alpha, vertices[head].alpha
    return Arc(
        number=number,
        statuses=tuple(map(contact_status, codes, _slips(known.exact, codes, at))),
        lo=float(begin),
        hi=float(end),
        tail=tail,
        head=head,
        index=index,
        dimension=dimension,
        grazing=known.arcs[codes].grazing,
        selections=(codes, *(c for c in selections if c != codes)),
        begin=begin,
        end=end,
        sample=sample,
        _values=ExactArcValues(known.exact, codes, sample),
    )


def _slips(exact: ExactCondensed, codes: Codes, sample: fmpq) -> tuple[int, ...]:
    """Signs of u_t in the middle of an arc, which name the slip of nodes without friction; zeros if there are none."""
    if not any(exact.frictionless):
        return (0,) * exact.p
    solver = FiberSelections(exact, fmpq(sample))
    solution = solver.solve(codes)
    return (0,) * exact.p if solution is None else solver.slip_signs(solution.vertices[0])


def _all_known(known: KnownSelections, component: RootComponent) -> bool:
    """True if all selections that hold on a component were found."""
    return component.whole and all(solution.codes in known.arcs for solution in component.solutions)


def _component(known: KnownSelections, codes: Codes, sample: fmpq) -> RootComponent | None:
    """The connected set of solutions that a degenerate selection belongs to at a point of its cell."""
    look()
    solver = FiberSelections(known.exact, sample)
    solution = solver.solve(codes)
    if solution is None:
        known.contradict(f"{named(codes)} should hold at alpha = {sample} and does not")
        return None
    component = connected_components([solution], solver)[0]
    if component.index is None and not known.exact.reach:
        known.complain(f"the degree of a degenerate arc near alpha = {sample} could not be found; {TOLD_APART}")
    return component


# -- vertices in the user's terms (theory, section 7.11) ---------------------------------------------------------------


def make_vertices(known: KnownSelections, vertices: Sequence[GluedVertex], arcs: Sequence[Arc]) -> list[Vertex]:
    """Vertices with their kinds and degrees."""
    sides = sides_of(arcs, len(vertices))
    return [_vertex(known, k, glued, sides[k]) for k, glued in enumerate(vertices)]


def _vertex(known: KnownSelections, number: int, glued: GluedVertex, sides: Sides) -> Vertex:
    border = glued.alpha.is_rational and glued.alpha.lo in (known.a, known.b)
    # at the last alpha there are arcs from the left only
    beside = sides[0 if border and glued.alpha.lo == known.b else 1]
    degree = degree_of(beside) if glued.settled else None
    return make_vertex(
        number,
        glued.alpha,
        sides,
        _values(known, glued),
        named_statuses(glued.active, partial(_slip_sign, known, glued))[1],
        glued.members,
        border=border,
        settled=glued.settled,
        bounded=glued.bounded,
        family=_family(glued, degree, proven=known.exact.condensed_exactly),
    )


def _slip_sign(known: KnownSelections, glued: GluedVertex, node: int) -> int:
    """Sign of u_t of a node at a vertex, exactly; 0 on a continuum over which it changes."""
    if glued.solver is not None:
        signs = (glued.solver.slip_signs(v)[node] for s in glued.solutions for v in s.vertices)
        return sign_over(signs)
    for codes in glued.members:
        functions = known.arcs[codes].functions
        if not functions.singular and (det := glued.alpha.sign_of(functions.det)) != 0:
            slip = functions.row(RowKind.SLIP_FORWARD, node)
            return 0 if slip.is_zero() else int(det * glued.alpha.sign_of(slip))
    return 0  # the unloaded body at rest


def _values(known: KnownSelections, glued: GluedVertex) -> Pair:
    """Forces and displacements at a vertex as floats, with exact zeros where the statuses say so."""
    exact = known.exact
    if glued.solutions and glued.solver is not None:
        point = glued.solutions[0].vertices[0]
        return glued.solver.forces(point) + 0.0, glued.solver.displacements(point) + 0.0
    # an irrational alpha is replaced by a rational one that agrees with it far beyond float precision
    glued.alpha.narrow(fmpq(1, 2**256))
    alpha = (glued.alpha.lo + glued.alpha.hi) / 2
    point = next(
        (
            found
            for c in glued.members
            if not known.arcs[c].functions.singular and (found := known.arcs[c].functions.forces_at(alpha)) is not None
        ),
        (fmpq(0),) * len(exact.rows),
    )
    return with_exact_zeros(_as_floats(exact, alpha, point), glued.active)


def _family(glued: GluedVertex, index: int | None, *, proven: bool) -> RootFamily | None:
    if not glued.dimension or glued.solver is None:
        return None
    parts = [polytope(s, s.vertices, glued.solver) for s in glued.solutions if s.dimension > 0]
    return RootFamily(float(glued.alpha), tuple(_without_repetition(parts)), index, vertices_proven=proven)


def _without_repetition(parts: Sequence[Polytope]) -> list[Polytope]:
    """Polytopes whose vertices are not among those of another (of equal ones the first)."""
    sets = [set(map(tuple, part.coordinates.tolist())) for part in parts]
    return [
        part
        for k, part in enumerate(parts)
        if not any(sets[k] < other or (sets[k] == other and j < k) for j, other in enumerate(sets) if j != k)
    ]
