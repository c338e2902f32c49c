"""Vertices and arcs in the user's terms, made from joined traces (theory, section 7.14)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.algebraic import EnclosedAlpha
from enumsol.arithmetic.rationals import rational
from enumsol.branches.elements import Arc, Vertex, VertexKind
from enumsol.branches.enclosed.arc_values import TracedArcValues
from enumsol.branches.enclosed.joining import EventPlaceKind
from enumsol.branches.exact.make_elements import degree_of, named_active, vertex_kind, with_exact_zeros
from enumsol.model.statuses import FRICTIONLESS, OPEN, SLIP_MINUS, SLIP_PLUS, STATUSES, STICK
from enumsol.roots.slip_signs import shown_status

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.branches.enclosed.joining import EventPlace, Joined, JoinedArc
    from enumsol.branches.enclosed.traced import TracedProblem
    from enumsol.selections.solution import ActiveSets


def make_traced(traced: TracedProblem, joined: Joined) -> tuple[list[Vertex], list[Arc]]:
    """The vertices and arcs of joined traces."""
    number = {place: k for k, place in enumerate(joined.places)}
    exact = [EnclosedAlpha(rational(place.low), rational(place.high)) for place in joined.places]
    arcs = [_arc(traced, k, arc, (number[arc.tail], number[arc.head]), exact) for k, arc in enumerate(joined.arcs)]
    left: list[list[Arc]] = [[] for _ in exact]
    right: list[list[Arc]] = [[] for _ in exact]
    for arc in arcs:
        right[arc.tail].append(arc)
        left[arc.head].append(arc)
    sides = zip(joined.places, exact, left, right, strict=True)
    return [_vertex(traced, k, *parts) for k, parts in enumerate(sides)], arcs


def _arc(
    traced: TracedProblem, number: int, arc: JoinedArc, ends: tuple[int, int], exact: Sequence[EnclosedAlpha]
) -> Arc:
    sample = (arc.low + arc.high) / 2
    # beside what was left open only inner bounds are known
    begin, end = (
        EnclosedAlpha(rational(known), rational(known)) if place.kind is EventPlaceKind.OPEN else exact[vertex]
        for place, known, vertex in zip((arc.tail, arc.head), (arc.low, arc.high), ends, strict=True)
    )
    still = [i for i, code in enumerate(arc.codes) if code == FRICTIONLESS]
    signs = traced.slip_signs(arc.codes, sample, still) if still else {}
    return Arc(
        number=number,
        statuses=tuple(shown_status(code, signs.get(i, 0)) for i, code in enumerate(arc.codes)),
        lo=float(begin),
        hi=float(end),
        tail=ends[0],
        head=ends[1],
        index=arc.index or None,
        dimension=0,
        grazing=False,
        selections=(arc.codes,),
        begin=begin,
        end=end,
        sample=sample,
        _values=TracedArcValues(traced, arc.codes, sample),
    )


def _vertex(
    traced: TracedProblem,
    number: int,
    place: EventPlace,
    exact: EnclosedAlpha,
    left: Sequence[Arc],
    right: Sequence[Arc],
) -> Vertex:
    p, border = traced.problem.p, place.low == place.high and place.low in traced.interval
    settled = place.kind is not EventPlaceKind.OPEN and place.whole
    degrees = (degree_of(left), degree_of(right)) if settled else (None, None)
    active = _active(traced, place)
    middle = (place.low + place.high) / 2
    values = traced.values(place.members[0], middle, precisely=True) if place.members else None
    forces, w = (np.zeros(2 * p), np.zeros(2 * p)) if values is None else values
    if settled:
        forces, w = with_exact_zeros(forces, w, active)
    still = [i for i, codes in enumerate(active) if FRICTIONLESS in codes]
    signs = traced.slip_signs(place.members[0], middle, still) if still and place.members else {}
    names = named_active(active, lambda node: signs.get(node, 0))
    return Vertex(
        number=number,
        alpha=float(exact),
        kind=vertex_kind(left, right, border=border, dimension=0) if settled else VertexKind.UNSETTLED,
        border=border,
        statuses=tuple(next(s for s in STATUSES if s in found) for found in names),
        active=names,
        lambda_n=forces[:p],
        lambda_t=forces[p:],
        u_n=w[:p],
        u_t=w[p:],
        family=None,
        index_left=degrees[0],
        index_right=degrees[1],
        selections=tuple(place.members),
        exact=exact,
    )


def _active(traced: TracedProblem, place: EventPlace) -> ActiveSets:
    """Codes that hold at every node, or may hold where the place was left open."""
    if place.kind is EventPlaceKind.ORIGIN:
        F0, F1 = traced.problem.friction
        without = ((F0 == 0) & (F1 == 0)).tolist()
        return tuple(
            frozenset((OPEN, FRICTIONLESS) if still else (OPEN, STICK, SLIP_PLUS, SLIP_MINUS)) for still in without
        )
    return tuple(frozenset(codes) for codes in zip(*place.members, strict=True))
