"""Vertices and arcs in the user's terms, made from joined traces (theory, section 7.14)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.algebraic import EnclosedAlpha
from enumsol.arithmetic.rationals import rational
from enumsol.branches.elements import Arc, ArcValues, Sides, Vertex, make_vertex, sides_of, with_exact_zeros
from enumsol.branches.enclosed.joining import EventPlace, EventPlaceKind, Joined, JoinedArc
from enumsol.model.statuses import FINAL, FRICTIONLESS, contact_status
from enumsol.roots.linearisation import named_statuses

if TYPE_CHECKING:
    from collections.abc import Sequence, Set
    from fractions import Fraction

    from enumsol.branches.elements import Pair
    from enumsol.branches.enclosed.following import TracedProblem
    from enumsol.selections.solution import ActiveSets
    from enumsol.support.array_types import Codes


@dataclass(frozen=True)
class TracedArcValues(ArcValues):
    """Values in double arithmetic, with the rounding errors of S.

    Attributes
    ----------
    traced : TracedProblem
    codes : status codes
    sample : Fraction
        An alpha inside the arc.
    """

    traced: TracedProblem
    codes: Codes
    sample: Fraction

    def at(self, alpha: Fraction) -> Pair:
        """Forces and displacements at an alpha."""
        for value in (alpha, self.sample):
            found = self.traced.values(self.codes, value, precisely=False)
            if found is None:
                found = self.traced.values(self.codes, value, precisely=True)
            if found is not None:
                return found
        raise AssertionError("an arc's selection is not regular inside it")


def make_traced(traced: TracedProblem, joined: Joined) -> tuple[list[Vertex], list[Arc]]:
    """The vertices and arcs of joined traces."""
    number = {place: k for k, place in enumerate(joined.places)}
    exact = [EnclosedAlpha(rational(place.low), rational(place.high)) for place in joined.places]
    arcs = [_arc(traced, k, arc, (number[arc.tail], number[arc.head]), exact) for k, arc in enumerate(joined.arcs)]
    sides = sides_of(arcs, len(exact))
    return [_vertex(traced, k, place, exact[k], sides[k]) for k, place in enumerate(joined.places)], arcs


def _arc(
    traced: TracedProblem, number: int, arc: JoinedArc, ends: tuple[int, int], exact: Sequence[EnclosedAlpha]
) -> Arc:
    sample = (arc.low + arc.high) / 2
    # beside what was left open only inner bounds are known
    begin, end = (
        EnclosedAlpha(rational(known), rational(known)) if place.kind is EventPlaceKind.OPEN else exact[vertex]
        for place, known, vertex in zip((arc.tail, arc.head), (arc.low, arc.high), ends, strict=True)
    )
    signs = _slip_signs(traced, [arc.codes], sample, [{code} for code in arc.codes])
    return Arc(
        number=number,
        statuses=tuple(map(contact_status, arc.codes, signs)),
        lo=float(begin),
        hi=float(end),
        tail=ends[0],
        head=ends[1],
        index=arc.index or None,
        selections=(arc.codes,),
        begin=begin,
        end=end,
        sample=sample,
        _values=TracedArcValues(traced, arc.codes, sample),
    )


def _vertex(traced: TracedProblem, number: int, place: EventPlace, exact: EnclosedAlpha, sides: Sides) -> Vertex:
    p = traced.problem.p
    settled = place.kind is not EventPlaceKind.OPEN and place.whole
    active = _active(traced, place)
    middle = (place.low + place.high) / 2
    known = traced.values(place.members[0], middle, precisely=True) if place.members else None
    state = (np.zeros(2 * p), np.zeros(2 * p)) if known is None else known
    return make_vertex(
        number,
        exact,
        sides,
        with_exact_zeros(state, active) if settled else state,
        named_statuses(active, _slip_signs(traced, place.members, middle, active).__getitem__)[1],
        place.members,
        border=place.low == place.high and place.low in traced.interval,
        settled=settled,
        bounded=place.kind is EventPlaceKind.BOUND,
    )


def _slip_signs(
    traced: TracedProblem, members: Sequence[Codes], alpha: Fraction, active: Sequence[Set[int]]
) -> list[int]:
    """Signs of u_t at the nodes without friction, by the first selection that holds; 0 elsewhere."""
    still = [i for i, codes in enumerate(active) if FRICTIONLESS in codes]
    signs = traced.slip_signs(members[0], alpha, still) if still and members else {}
    return [signs.get(i, 0) for i in range(len(active))]


def _active(traced: TracedProblem, place: EventPlace) -> ActiveSets:
    """Codes that hold at every node, or may hold where the place was left open."""
    if place.kind is EventPlaceKind.ORIGIN:
        F0, F1 = traced.problem.affine_friction
        return tuple(frozenset(FINAL[rubs]) for rubs in ((F0 != 0) | (F1 != 0)).tolist())
    return tuple(frozenset(codes) for codes in zip(*place.members, strict=True))
