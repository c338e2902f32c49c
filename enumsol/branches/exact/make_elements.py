"""Vertices, arcs, components and branches in the user's terms, made from a gluing (theory, section 7.11)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import networkx as nx
import numpy as np
from flint import fmpq

from enumsol.arithmetic.rationals import to_fraction
from enumsol.branches.elements import CUTS, Arc, Branch, Component, Vertex, VertexKind
from enumsol.branches.enclosed.arc_values import ExactArcValues
from enumsol.model.statuses import FRICTIONLESS, OPEN, SLIP_MINUS, SLIP_PLUS, STATUSES, STICK, RowKind
from enumsol.roots.builder import polytope
from enumsol.roots.root import RootFamily
from enumsol.roots.slip_signs import shown_status, sign_over, slip_names
from enumsol.selections.ordered_field import FiberSelections, as_float
from enumsol.selections.polytopes import dot

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from enumsol.branches.exact.gluing import GluedArc, GluedVertex, Gluing
    from enumsol.condensation.exact import ExactCondensed
    from enumsol.model.statuses import ContactStatus
    from enumsol.roots.root import Polytope
    from enumsol.selections.solution import ActiveSets

    Array = NDArray[np.float64]


#: What networkx's graph shows of vertices and arcs.
_NODE_DATA = ("alpha", "kind", "border", "statuses", "active", "lambda_n", "lambda_t", "index_left", "index_right")
_EDGE_DATA = ("statuses", "index", "dimension", "values")


def make_arcs(gluing: Gluing) -> list[Arc]:
    """The arcs of a gluing."""
    exact = gluing.exact
    return [
        Arc(
            number=number,
            statuses=tuple(shown_status(c, s) for c, s in zip(edge.codes, _slips(exact, edge), strict=True)),
            lo=float(gluing.vertices[edge.tail].alpha),
            hi=float(gluing.vertices[edge.head].alpha),
            tail=edge.tail,
            head=edge.head,
            index=edge.index,
            dimension=edge.dimension,
            grazing=gluing.arcs[edge.codes].grazing,
            selections=(edge.codes, *(c for c in edge.selections if c != edge.codes)),
            begin=gluing.vertices[edge.tail].alpha,
            end=gluing.vertices[edge.head].alpha,
            sample=to_fraction(fmpq(edge.sample)),
            _values=ExactArcValues(exact, edge.codes, to_fraction(fmpq(edge.sample))),
        )
        for number, edge in enumerate(gluing.edges)
    ]


def _slips(exact: ExactCondensed, edge: GluedArc) -> tuple[int, ...]:
    """Signs of u_t in the middle of an arc, which name the slip of nodes without friction; zeros if there are none."""
    if not any(exact.frictionless):
        return (0,) * exact.p
    solver = FiberSelections(exact, fmpq(edge.sample))
    solution = solver.solve(edge.codes)
    return (0,) * exact.p if solution is None else solver.slip_signs(solution.vertices[0])


def make_vertices(gluing: Gluing, arcs: Sequence[Arc]) -> list[Vertex]:
    """The vertices of a gluing, with their kinds and degrees."""
    left: list[list[Arc]] = [[] for _ in gluing.vertices]
    right: list[list[Arc]] = [[] for _ in gluing.vertices]
    for arc in arcs:
        right[arc.tail].append(arc)
        left[arc.head].append(arc)
    return [_vertex(gluing, number, glued, left[number], right[number]) for number, glued in enumerate(gluing.vertices)]


def _vertex(gluing: Gluing, number: int, glued: GluedVertex, left: Sequence[Arc], right: Sequence[Arc]) -> Vertex:
    """A vertex with the arcs that end there from the left and begin there to the right."""
    border = glued.alpha.is_rational and glued.alpha.lo in (gluing.a, gluing.b)
    p = gluing.exact.p
    degrees = (degree_of(left), degree_of(right)) if glued.settled else (None, None)
    # at the last alpha there are arcs from the left only
    degree = degrees[0] if border and glued.alpha.lo == gluing.b else degrees[1]
    forces, w = _values(gluing, glued)
    active = named_active(glued.active, lambda node: _slip_sign(gluing, glued, node))
    return Vertex(
        number=number,
        alpha=float(glued.alpha),
        kind=vertex_kind(left, right, border=border, dimension=glued.dimension)
        if glued.settled
        else VertexKind.UNSETTLED,
        border=border,
        statuses=tuple(next(s for s in STATUSES if s in names) for names in active),
        active=active,
        lambda_n=forces[:p],
        lambda_t=forces[p:],
        u_n=w[:p],
        u_t=w[p:],
        family=_family(glued, degree, proven=gluing.exact.condensed_exactly),
        index_left=degrees[0],
        index_right=degrees[1],
        selections=tuple(glued.members),
        exact=glued.alpha,
    )


def named_active(active: ActiveSets, slip_sign: Callable[[int], int]) -> tuple[frozenset[ContactStatus], ...]:
    """Names of the statuses that hold at every node; ``slip_sign`` gives the sign of u_t where there is no friction."""
    return tuple(
        frozenset(
            name
            for code in codes
            for name in (slip_names(slip_sign(node)) if code == FRICTIONLESS else (STATUSES[code],))
        )
        for node, codes in enumerate(active)
    )


def with_exact_zeros(forces: Array, w: Array, active: ActiveSets) -> tuple[Array, Array]:
    """Forces and displacements with exact zeros where the statuses say so."""
    p = len(active)
    for i, codes in enumerate(active):
        if OPEN in codes:
            forces[[i, p + i]] = 0.0
        if codes - {OPEN}:
            w[i] = 0.0
        if STICK in codes or {SLIP_PLUS, SLIP_MINUS} <= codes:
            w[p + i] = 0.0
    return forces + 0.0, w + 0.0


def degree_of(arcs: Sequence[Arc]) -> int | None:
    """Sum of the indices; None where one is not known."""
    indices = [arc.index for arc in arcs]
    return None if any(index is None for index in indices) else sum(index for index in indices if index is not None)


def vertex_kind(left: Sequence[Arc], right: Sequence[Arc], *, border: bool, dimension: int) -> VertexKind:
    """What a settled vertex is, by the arcs that end there from the left and begin there to the right."""
    if any(arc.dimension for arc in (*left, *right)):
        return VertexKind.SHEET
    if dimension:
        return VertexKind.FAMILY
    if border:
        return VertexKind.END
    degrees = degree_of(left), degree_of(right)
    if None not in degrees and degrees[0] != degrees[1]:
        return VertexKind.BROKEN
    match len(left), len(right):
        case 1, 1:
            same = left[0].selections == right[0].selections
            return VertexKind.TOUCH if same else VertexKind.TRANSITION
        case 0, 0:
            return VertexKind.POINT
        case (1, 0) | (0, 1):
            return VertexKind.TERMINAL
        case (2, 0) | (0, 2):
            return VertexKind.FOLD
    return VertexKind.BIFURCATION


def _slip_sign(gluing: Gluing, glued: GluedVertex, node: int) -> int:
    """Sign of u_t of a node at a vertex, exactly; 0 on a continuum over which it changes."""
    if glued.solver is not None:
        signs = (glued.solver.slip_signs(v)[node] for s in glued.solutions for v in s.vertices)
        return sign_over(signs)
    for codes in glued.members:
        functions = gluing.arcs[codes].functions
        if not functions.singular and (det := glued.alpha.sign_of(functions.det)) != 0:
            slip = functions.row(RowKind.SLIP_FORWARD, node)
            return 0 if slip.is_zero() else int(det * glued.alpha.sign_of(slip))
    return 0  # the unloaded body at rest


def _values(gluing: Gluing, glued: GluedVertex) -> tuple[Any, Any]:
    """Forces and displacements at a vertex as floats, with exact zeros where the statuses say so."""
    exact, p = gluing.exact, gluing.exact.p
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
            if not gluing.arcs[c].functions.singular
            and (found := gluing.arcs[c].functions.forces_at(alpha)) is not None
        ),
        (fmpq(0),) * (2 * p),
    )
    w = np.array([as_float(a - dot(row, point)) for a, row in zip(exact.at(alpha)[0], exact.rows, strict=True)])
    return with_exact_zeros(np.array([as_float(v) for v in point]), w, glued.active)


def _family(glued: GluedVertex, index: int | None, *, proven: bool) -> RootFamily | None:
    if not glued.dimension or glued.solver is None:
        return None
    parts = [polytope(s, s.vertices, glued.solver) for s in glued.solutions if s.dimension > 0]
    return RootFamily(float(glued.alpha), tuple(_without_repetition(parts)), index, vertices_proven=proven)


def _without_repetition(parts: Sequence[Polytope]) -> list[Polytope]:
    """Polytopes whose vertices are not among those of another (of equal ones the first)."""
    sets = [{tuple(v.ravel().tolist()) for v in part.vertices} for part in parts]
    return [
        part
        for k, part in enumerate(parts)
        if not any(sets[k] < other or (sets[k] == other and j < k) for j, other in enumerate(sets) if j != k)
    ]


def multigraph(vertices: Sequence[Vertex], arcs: Sequence[Arc]) -> Any:
    """The networkx.MultiGraph, frozen: vertices by number, arcs as edges keyed by their number."""
    graph = nx.MultiGraph()
    for v in vertices:
        graph.add_node(v.number, **{name: getattr(v, name) for name in _NODE_DATA}, vertex=v)
    for arc in arcs:
        shown = {name: getattr(arc, name) for name in _EDGE_DATA}
        graph.add_edge(arc.tail, arc.head, key=arc.number, alpha=arc.interval, **shown, arc=arc)
    return nx.freeze(graph)


def make_components(graph: Any, vertices: Sequence[Vertex], arcs: Sequence[Arc]) -> tuple[Component, ...]:
    """Connected components in the order of their first vertex."""
    groups = sorted((sorted(group) for group in nx.connected_components(graph)), key=lambda group: group[0])
    place = {v: k for k, group in enumerate(groups) for v in group}
    return tuple(
        Component(k, tuple(vertices[v] for v in group), tuple(arc for arc in arcs if place[arc.tail] == k))
        for k, group in enumerate(groups)
    )


def make_branches(components: Sequence[Component], vertices: Sequence[Vertex]) -> tuple[Branch, ...]:
    """Components cut at bifurcations, families and sheets; every sheet is a branch of its own."""
    found: list[Branch] = []
    for component in components:
        at: dict[int, list[Arc]] = {}
        for arc in component.arcs:
            at.setdefault(arc.tail, []).append(arc)
            at.setdefault(arc.head, []).append(arc)

        def cut(number: int, arcs_at: dict[int, list[Arc]] = at) -> bool:
            return vertices[number].kind in CUTS or len(arcs_at[number]) != 2

        left = set(component.arcs)
        # open branches from their ends first, what then remains is closed
        starts = [(v, arc) for v in at if cut(v) for arc in at[v]]
        starts += [(arc.tail, arc) for arc in component.arcs]
        for start, first in starts:
            if first not in left:
                continue
            run, passed, here, arc = [], [start], start, first
            while arc in left:
                left.remove(arc)
                run.append(arc)
                here = arc.head if here == arc.tail else arc.tail
                passed.append(here)
                if cut(here):
                    break
                arc = next((other for other in at[here] if other in left), arc)
            closed = passed[0] == passed[-1] and not cut(start)
            along = tuple(vertices[v] for v in (passed[:-1] if closed else passed))
            found.append(Branch(len(found), tuple(run), along, component.number, closed))
    return tuple(found)
