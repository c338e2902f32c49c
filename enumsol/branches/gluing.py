"""Ends of arcs glued into vertices by the statuses that hold there, never by distance (theory, section 7.6).

Two selections share a point at a critical alpha when both hold there, which the signs at one of them decide exactly.
Isolated points need only their selection's own functions; where a selection is singular its polytope of solutions is
computed in exact arithmetic at that alpha.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import product
from math import prod
from typing import TYPE_CHECKING, Any

from enumsol.arithmetic.algebraic import CriticalAlpha, merge
from enumsol.arithmetic.number_field import exact_value
from enumsol.branches.selection_arcs import SelectionArcs, active_sets, selection_arcs
from enumsol.branches.sheets import sheet_arcs
from enumsol.roots.components import connected_components
from enumsol.search.stopping import Stop, StopReason
from enumsol.selections.ordered_field import FiberSelections
from enumsol.selections.solution import SelectionSolution, VertexLimitError

if TYPE_CHECKING:
    from collections.abc import Iterable

    from enumsol.condensation.exact import ExactPath
    from enumsol.roots.components import RootComponent
    from enumsol.selections.solution import ActiveSets, Codes

Place = tuple["Codes", int]


@dataclass
class GluedVertex:
    """A connected set of solutions at one critical alpha.

    Attributes
    ----------
    alpha : CriticalAlpha
    members : the selections that hold there, as places (codes, event id)
    active : per node all codes that hold somewhere on it
    solutions : polytopes of the singular selections (empty at an isolated point)
    solver : FiberSelections of those polytopes, or None
    settled : every selection that holds there is known, and with it every arc that ends there
    """

    alpha: CriticalAlpha
    members: list[Codes]
    active: ActiveSets
    solutions: list[SelectionSolution] = field(default_factory=list)
    solver: FiberSelections | None = None
    settled: bool = True

    @property
    def dimension(self) -> int:
        """0 for an isolated point."""
        return max((s.dimension for s in self.solutions), default=0)


@dataclass(frozen=True)
class GluedArc:
    """A set of solutions over an open interval of alpha: an arc, or a sheet.

    Attributes
    ----------
    codes : the selection that represents it (of a sheet: one of its largest polytopes)
    selections : all selections that coincide on it
    sample : fmpq inside the interval
    tail, head : vertices at its lower and upper end
    index : int or None
    dimension : 0 for an arc
    """

    codes: Codes
    selections: tuple[Codes, ...]
    sample: Any
    tail: int
    head: int
    index: int | None
    dimension: int


class _UnionFind:
    def __init__(self) -> None:
        self._parent: dict[int, int] = {}

    def find(self, item: int) -> int:
        parent = self._parent.setdefault(item, item)
        while parent != item:
            self._parent[item] = self._parent.setdefault(parent, parent)
            item, parent = parent, self._parent[parent]
        return item

    def join(self, a: int, b: int) -> None:
        self._parent[self.find(a)] = self.find(b)


class Gluing:
    """Vertices and arcs of the graph, from the selections that the search found.

    Parameters
    ----------
    path : ExactPath
    candidates : codes of the selections that may hold somewhere in [a, b]
    a, b : fmpq
    tick : called with the share of the candidates done
    cut_short : the search was stopped: selections that it did not give are left out, and arcs end without neighbours

    Attributes
    ----------
    arcs : dict of SelectionArcs by codes, those that hold somewhere
    vertices : list of GluedVertex in the order of alpha
    edges : list of GluedArc
    interrupted : str or None
        How far it came, when Ctrl-C was pressed while the arcs of the selections were worked out.
    reasons : list of str
        What stayed undecided or contradicts completeness; empty when nothing does.
    """

    def __init__(
        self,
        path: ExactPath,
        candidates: Iterable[Codes],
        a: Any,
        b: Any,
        tick: Any = None,
        *,
        cut_short: bool = False,
    ) -> None:
        self._cut_short = cut_short
        self._waiting: list[tuple[Codes, Any]] = []
        self.path, self.a, self.b = path, a, b
        self.arcs: dict[Codes, SelectionArcs] = {}
        self.reasons: list[str] = []
        self.vertices: list[GluedVertex] = []
        self.edges: list[GluedArc] = []
        self._union = _UnionFind()
        self._solutions: dict[int, tuple[FiberSelections, SelectionSolution]] = {}
        self._active: dict[int, ActiveSets] = {}
        self._events: dict[int, tuple[Codes, Any]] = {}
        self._fibers: list[tuple[CriticalAlpha, FiberSelections]] = []
        self._refused: set[Codes] = set()
        self._unsettled: set[int] = set()
        self.interrupted: Stop | None = None
        todo = sorted(set(candidates))
        for k, codes in enumerate(todo):
            try:
                self._add(codes)
                if tick is not None:
                    tick((k + 1) / len(todo))
            except KeyboardInterrupt:
                # as after a search that was cut short, what is known so far is glued
                self._cut_short = True
                self.interrupted = Stop(StopReason.INTERRUPTED, k, arcs_of=len(todo))
                break
        for codes in list(self.arcs):
            self._close(codes)
        self._glue()
        self._make_vertices()
        self._make_edges()

    # -- selections ------------------------------------------------------------------------------------------------

    def _add(self, codes: Codes) -> None:
        try:
            arcs = selection_arcs(self.path, codes, self.a, self.b)
            if arcs is None:
                arcs = sheet_arcs(self.path, codes, self.a, self.b)
        except VertexLimitError as error:
            self._refused.add(codes)
            self._complain(f"selection {codes}: {error}")
            return
        if not arcs.empty:
            self.arcs[codes] = arcs

    def _fiber(self, alpha: CriticalAlpha) -> FiberSelections:
        """The exact solver at this alpha."""
        for known, solver in self._fibers:
            if known.compare(alpha) == 0:
                return solver
        solver = FiberSelections(self.path, exact_value(alpha))
        self._fibers.append((alpha, solver))
        return solver

    def _close(self, codes: Codes) -> None:
        """Decide a selection's singular events: which have solutions, and the polytopes they form."""
        arcs = self.arcs[codes]
        for event in arcs.events:
            if not (event.singular and event.holds) or self._solve(codes, event):
                continue
            if arcs.beside(event):
                self._complain(f"an arc of selection {codes} has no limit at alpha = {float(event.alpha):.17g}")
            else:
                event.holds = False
        if arcs.empty:
            del self.arcs[codes]

    def _solve(self, codes: Codes, event: Any) -> bool:
        """Find the polytope of a selection at a singular event; False when it holds nothing there."""
        solver = self._fiber(event.alpha)
        try:
            solution = solver.solve(codes)
        except VertexLimitError as error:
            self._unsettled.add(id(event))
            self._complain(f"alpha = {float(event.alpha):.17g}: {error}")
            return True
        if solution is not None:
            self._solutions[id(event)] = (solver, solution)
        return solution is not None

    # -- gluing ----------------------------------------------------------------------------------------------------

    def _glue(self) -> None:
        waiting = self._waiting
        waiting += [(codes, event) for codes, arcs in self.arcs.items() for event in arcs.events if event.holds]
        origin = self.path.origin
        if origin is not None and self.a <= origin <= self.b:
            waiting += self._place_everywhere(CriticalAlpha.rational(origin))
        while waiting:
            codes, event = waiting.pop()
            self._events[id(event)] = (codes, event)
            self._union.find(id(event))
            if self.path.unloaded or (origin is not None and event.alpha.is_rational and event.alpha.lo == origin):
                self._active[id(event)] = self._everything()
                if self._cut_short or self._refused:
                    self._unsettled.add(id(event))
                continue
            for active in self._active_at(codes, event):
                members, whole = self._members(active)
                if not whole:
                    self._unsettled.add(id(event))
                for other in members:
                    partner = self.arcs[other]
                    place, new = partner.place(event.alpha)
                    theirs = partner.events[place]
                    if not theirs.holds:
                        self._complain(
                            f"selection {other} should hold at alpha = {float(event.alpha):.17g} and does not"
                        )
                        self._unsettled.add(id(event))
                        continue
                    if new:
                        waiting.append((other, theirs))
                        theirs.singular = partner.functions.singular
                        if theirs.singular:
                            self._solve(other, theirs)
                    self._union.join(id(event), id(theirs))
        self._join_polytopes()

    def _place_everywhere(self, alpha: CriticalAlpha) -> list[tuple[Codes, Any]]:
        new, first = [], None
        for codes, arcs in self.arcs.items():
            place, inserted = arcs.place(alpha)
            event = arcs.events[place]
            event.holds = True
            if inserted:
                new.append((codes, event))
            first = event if first is None else first
            self._union.join(id(event), id(first))
        return new

    def _everything(self) -> ActiveSets:
        return tuple(frozenset((0, 4)) if without else frozenset(range(4)) for without in self.path.frictionless)

    def _active_at(self, codes: Codes, event: Any) -> list[ActiveSets]:
        """Active sets of the selection's solution at an event: one, or one for every vertex of its polytope."""
        if id(event) in self._solutions:
            solver, solution = self._solutions[id(event)]
            sets = [solver.active(vertex) for vertex in solution.vertices]
        elif event.singular:
            sets = []
        else:
            arcs = self.arcs[codes]
            sets = [active_sets(arcs.functions, event.alpha, self._det_sign(arcs, event), self.path)]
        own = [frozenset((code,)) for code in codes]
        joined = [frozenset().union(*(s[i] for s in sets), own[i]) for i in range(self.path.p)]
        self._active[id(event)] = tuple(joined)
        return sets

    def _det_sign(self, arcs: SelectionArcs, event: Any) -> int:
        return int(event.alpha.sign_of(arcs.functions.det))

    def _members(self, active: ActiveSets) -> tuple[list[Codes], bool]:
        """Known selections among those that hold, and whether these are all of them.

        If the search was not cut short, one that it left out is a contradiction, and is taken in.
        """
        count = prod(len(a) for a in active)
        if count > 2 * len(self.arcs) + 64:
            known = [c for c in self.arcs if all(code in a for code, a in zip(c, active, strict=True))]
            return known, not (self._cut_short or self._refused)
        known = [
            codes
            for codes in product(*(sorted(a) for a in active))
            if codes in self.arcs or (not self._cut_short and self._add_left_out(codes))
        ]
        return known, len(known) == count

    def _add_left_out(self, codes: Codes) -> bool:
        """Take in a selection that a search without gaps should have given; whether it holds anywhere."""
        if codes not in self._refused:
            self._add(codes)
        if codes in self._refused:
            return False
        if codes in self.arcs:
            self._close(codes)
        if codes not in self.arcs:
            self._complain(f"selection {codes} holds and its own functions say otherwise")
            return False
        self._complain(f"the search left out selection {codes}, which holds somewhere")
        self._waiting += [(codes, event) for event in self.arcs[codes].events if event.holds]
        return True

    def _join_polytopes(self) -> None:
        """Join polytopes at one alpha that meet away from the vertices of both."""
        by_solver: dict[int, list[int]] = {}
        for key, (solver, solution) in self._solutions.items():
            if solution.dimension > 0:
                by_solver.setdefault(id(solver), []).append(key)
        for keys in by_solver.values():
            for k, first in enumerate(keys):
                solver, a = self._solutions[first]
                for second in keys[k + 1 :]:
                    b = self._solutions[second][1]
                    if self._union.find(first) != self._union.find(second) and solver.meet(a, b):
                        self._union.join(first, second)

    def _complain(self, reason: str) -> None:
        if reason not in self.reasons:
            self.reasons.append(reason)

    # -- the graph -------------------------------------------------------------------------------------------------

    def _make_vertices(self) -> None:
        groups: dict[int, list[int]] = {}
        for key in self._events:
            groups.setdefault(self._union.find(key), []).append(key)
        leaders = [(self._events[keys[0]][1].alpha, keys) for keys in groups.values()]
        by_alpha: dict[int, list[list[int]]] = {}
        for alpha, keys in leaders:
            by_alpha.setdefault(id(alpha), []).append(keys)
        known = {id(alpha): alpha for alpha, _ in leaders}
        for group in merge(known.values()):
            alike = [keys for alpha in group for keys in by_alpha[id(alpha)]]
            for keys in sorted(alike, key=lambda keys: min(self._events[k][0] for k in keys)):
                self._make_vertex(group[0], keys)

    def _make_vertex(self, alpha: CriticalAlpha, keys: list[int]) -> None:
        number = len(self.vertices)
        members = sorted(self._events[key][0] for key in keys)
        active = tuple(frozenset().union(*(self._active[key][i] for key in keys)) for i in range(self.path.p))
        vertex = GluedVertex(alpha, members, active, settled=self._unsettled.isdisjoint(keys))
        for key in keys:
            self._events[key][1].vertex = number
            if key in self._solutions:
                vertex.solver, solution = self._solutions[key]
                vertex.solutions.append(solution)
        self.vertices.append(vertex)

    def _make_edges(self) -> None:
        seen: set[tuple[int, int, frozenset[Codes]]] = set()
        found: list[GluedArc] = []
        for codes, arcs in self.arcs.items():
            for k, cell in enumerate(arcs.cells):
                if not cell.holds:
                    continue
                tail, head = arcs.events[k].vertex, arcs.events[k + 1].vertex
                if not arcs.grazing:
                    found.append(GluedArc(codes, (codes,), cell.sample, tail, head, cell.det_sign, 0))
                    continue
                if self.path.unloaded:
                    found.append(GluedArc(codes, (codes,), cell.sample, tail, head, 1, 0))
                    continue
                component = self._component(codes, cell.sample)
                # the critical points of selections that coincide here and were not found may cut the arc further
                if component is None or (self._cut_short and not self._knows(component)):
                    self.vertices[tail].settled = self.vertices[head].settled = False
                    continue
                selections = tuple(sorted(s.codes for s in component.solutions))
                key = (tail, head, frozenset(selections))
                if key not in seen:
                    seen.add(key)
                    # a search that was cut short may not have given the others
                    first = next(s.codes for s in component.solutions if s.codes in self.arcs)
                    found.append(
                        GluedArc(first, selections, cell.sample, tail, head, component.index, component.dimension)
                    )
        self.edges = sorted(found, key=lambda e: (e.tail, e.head, e.codes))

    def _knows(self, component: RootComponent) -> bool:
        """Whether all selections that hold on a component were found."""
        return component.whole and all(solution.codes in self.arcs for solution in component.solutions)

    def _component(self, codes: Codes, sample: Any) -> RootComponent | None:
        """The connected set of solutions that a degenerate selection belongs to at a point of its cell."""
        solver = FiberSelections(self.path, sample)
        solution = solver.solve(codes)
        if solution is None:
            self._complain(f"selection {codes} should hold at alpha = {sample} and does not")
            return None
        component = connected_components([solution], solver)[0]
        if component.index is None:
            self._complain(f"the degree of a degenerate arc near alpha = {sample} could not be found")
        return component
