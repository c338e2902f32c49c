"""Vertices with their kinds and degrees, components and branches, in either arithmetic (theory, section 7.11)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import networkx as nx

from enumsol.branches.elements import CUTS, Arc, Branch, Component, Vertex, VertexKind, index_sum, tangential
from enumsol.model.statuses import OPEN, SLIP_MINUS, SLIP_PLUS, STICK, ContactStatus

if TYPE_CHECKING:
    from collections.abc import Sequence, Set

    from enumsol.arithmetic.algebraic import CriticalAlpha
    from enumsol.branches.elements import Pair
    from enumsol.roots.root import RootFamily
    from enumsol.selections.solution import Codes

    #: Arcs that end at a vertex from the left, and that begin there to the right.
    Sides = tuple[list[Arc], list[Arc]]


#: What networkx's graph shows of vertices and arcs.
_NODE_DATA = ("alpha", "kind", "border", "statuses", "active", "lambda_n", "lambda_t", "index_left", "index_right")
_EDGE_DATA = ("statuses", "index", "dimension", "values")


def sides_of(arcs: Sequence[Arc], count: int) -> list[Sides]:
    """The arcs on both sides of every vertex."""
    sides: list[Sides] = [([], []) for _ in range(count)]
    for arc in arcs:
        sides[arc.head][0].append(arc)
        sides[arc.tail][1].append(arc)
    return sides


def make_vertex(
    number: int,
    alpha: CriticalAlpha,
    sides: Sides,
    state: Pair,
    names: Sequence[frozenset[ContactStatus]],
    selections: Sequence[Codes],
    *,
    border: bool,
    settled: bool,
    bounded: bool = False,
    family: RootFamily | None = None,
) -> Vertex:
    """A vertex with the kind and the degrees that the arcs on its sides give it, if all of these are known.

    Parameters
    ----------
    state : forces and displacements, (2p,) arrays, in 3D (3p,)
    names : the statuses that hold at every node
    bounded : it reaches a bound of the rigid displacement, beyond which arcs are not known
    """
    p, (forces, w) = len(names), state
    dimension = 0 if family is None else family.dimension
    kind = VertexKind.UNSETTLED
    if settled:
        kind = vertex_kind(*sides, border=border, dimension=dimension, bounded=bounded)
    left, right = map(degree_of, sides) if settled else (None, None)
    return Vertex(
        number=number,
        alpha=float(alpha),
        kind=kind,
        border=border,
        statuses=tuple(next(status for status in ContactStatus if status in held) for held in names),
        active=tuple(names),
        lambda_n=forces[:p],
        lambda_t=tangential(forces, p),
        u_n=w[:p],
        u_t=tangential(w, p),
        family=family,
        index_left=left,
        index_right=right,
        selections=tuple(selections),
        exact=alpha,
        bounded=bounded,
    )


def with_exact_zeros(state: Pair, active: Sequence[Set[int]]) -> Pair:
    """Forces and displacements with exact zeros where the statuses say so."""
    (forces, w), p = state, len(active)
    for i, codes in enumerate(active):
        if OPEN in codes:
            forces[i::p] = 0.0
        if codes - {OPEN}:
            w[i] = 0.0
        if STICK in codes or {SLIP_PLUS, SLIP_MINUS} <= codes:
            w[p + i :: p] = 0.0
    return forces + 0.0, w + 0.0


def degree_of(arcs: Sequence[Arc]) -> int | None:
    """Sum of the indices; None where one is not known."""
    return index_sum(arc.index for arc in arcs)


def vertex_kind(
    left: Sequence[Arc], right: Sequence[Arc], *, border: bool, dimension: int, bounded: bool = False
) -> VertexKind:
    """What a settled vertex is, by the arcs that end there from the left and begin there to the right."""
    if any(arc.dimension for arc in (*left, *right)):
        return VertexKind.SHEET
    if dimension:
        return VertexKind.FAMILY
    if border:
        return VertexKind.END
    if bounded:
        return VertexKind.BOUND
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
