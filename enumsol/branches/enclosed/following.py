"""The selections that survive a search, followed over alpha in ball arithmetic and joined (theory, section 7.14).

`TracedProblem` has the problem's data as given: in balls of double arithmetic, and of many digits where they are asked
for.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property, partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.arithmetic.algebraic import EnclosedAlpha
from enumsol.arithmetic.rationals import rational
from enumsol.branches.elements import (
    END_ELSEWHERE,
    SHORT_INTERVAL,
    TOLD_APART,
    Arc,
    ArcValues,
    Effort,
    Sides,
    Vertex,
    make_vertex,
    sides_of,
    with_exact_zeros,
)
from enumsol.branches.enclosed.cutting import ArcPart, OpenCause, Trace
from enumsol.branches.enclosed.joining import EventPlace, EventPlaceKind, Joined, JoinedArc, join
from enumsol.branches.enclosed.tracing import trace
from enumsol.branches.enclosed.zeros import enclosed
from enumsol.condensation.data import EXACT_DOF_LIMIT
from enumsol.model.statuses import FINAL, FRICTIONLESS, contact_status
from enumsol.roots.local_branch import named_statuses
from enumsol.search.outcome import Stop
from enumsol.support.deadlines import TimeOverError, over
from enumsol.support.messages import counted, listed
from enumsol.trusted.arcs.precise import PreciseSelection, system_in_many_digits
from enumsol.trusted.arcs.selection_balls import ArcSelection, ArcSystem

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence, Set

    from enumsol.arithmetic.balls import Ball
    from enumsol.branches.elements import Pair
    from enumsol.model.problem import ContactProblem
    from enumsol.search.subintervals import SearchedPiece
    from enumsol.selections.solution import ActiveSets
    from enumsol.support.array_types import Codes, Floats

    Bounds = tuple[Fraction, Fraction]


class TracedProblem:
    """Selections of one problem over alpha, in double arithmetic and, where that is affordable, in many digits.

    Parameters
    ----------
    problem : ContactProblem
    interval : (Fraction, Fraction)
    origin : Fraction or None
        The alpha at which g vanishes. Solutions on either side of it are those of a constant load times the distance.

    Raises
    ------
    NotEnclosedError
        A is positive definite only within rounding.
    """

    def __init__(self, problem: ContactProblem, interval: Bounds, origin: Fraction | None) -> None:
        self.problem, self.interval = problem, interval
        self.origin = origin if origin is not None and interval[0] <= origin <= interval[1] else None
        held = problem.on_springs
        scaled = held.condensed.at(float(sum(interval) / 2)).scaled if self.origin is None else None
        if scaled is None:
            # the load at the end that is farther away
            far = max(interval, key=lambda end: abs(end - Fraction(self.origin or 0)))
            scaled = held.condensed.at(float(far)).scaled
        self.units = scaled
        self.force, self.length = scaled.force, scaled.length
        self._systems = {
            side: ArcSystem.of(problem, held.enclosure, self.force, self.length).beside_zero(side)
            for side in ((0.0,) if self.origin is None else (-1.0, 1.0))
        }
        self._selections: dict[tuple[Codes, float], ArcSelection] = {}
        self._precise: dict[tuple[Codes, float], PreciseSelection] = {}

    @property
    def sparing(self) -> bool:
        """Many digits cost much here, and are asked for only where balls in double arithmetic do not decide."""
        return self.problem.n > EXACT_DOF_LIMIT

    def __reduce__(self) -> tuple[Any, ...]:
        """Made again: balls of many digits cannot be pickled."""
        return type(self), (self.problem, self.interval, self.origin)

    @cached_property
    def _precise_system(self) -> ArcSystem[Any] | None:
        return system_in_many_digits(self.problem)

    def system(self, side: float) -> ArcSystem[Ball]:
        """All selections in double arithmetic."""
        return self._systems[side]

    def selection(self, codes: Codes, side: float) -> ArcSelection:
        """A selection in double arithmetic."""
        if (codes, side) not in self._selections:
            self._selections[codes, side] = ArcSelection(self._systems[side], codes)
        return self._selections[codes, side]

    def precise(self, codes: Codes, side: float) -> PreciseSelection | None:
        """A selection in many digits; None where the body is too large for them, and once the time is over."""
        try:
            if over() or self._precise_system is None:
                return None
        except TimeOverError:
            return None
        if (codes, side) not in self._precise:
            self._precise[codes, side] = PreciseSelection(self._precise_system.beside_zero(side), codes)
        return self._precise[codes, side]

    # -- traces ----------------------------------------------------------------------------------------------------

    def spans(self, pieces: Iterable[Bounds]) -> list[tuple[float, float, float]]:
        """Pieces of the interval joined where they touch, rounded outward, with the side of the origin."""
        merged: list[list[Fraction]] = []
        for a, b in sorted(pieces):
            if merged and merged[-1][1] >= a and merged[-1][1] != self.origin:
                merged[-1][1] = max(b, merged[-1][1])
            else:
                merged.append([a, b])
        found = []
        for a, b in merged:
            inside = self.origin is not None and a < self.origin < b
            for x, y in pairwise((a, self.origin, b) if inside and self.origin is not None else (a, b)):
                side = 0.0 if self.origin is None else 1.0 if y > self.origin else -1.0
                found.append((_down(x), -_down(-y), side))
        return found

    def trace(self, where: Mapping[Codes, Iterable[Bounds]], found: list[Trace]) -> None:
        """Trace selections over pieces of the interval, of every selection its own.

        ``found`` takes the traces; on Ctrl-C those of the selections that are finished.
        """
        trace(
            [
                (self.selection(codes, side), low, high, partial(self.precise, codes, side), side)
                for codes, pieces in where.items()
                for low, high, side in self.spans(pieces)
            ],
            found,
            sharpened=not self.sparing,
        )

    def sharpen(self, found: Trace, part: ArcPart) -> Bounds | None:
        """Narrower bounds of an event's zero; None where there is no need or no means."""
        low, high = (Fraction(end) for end in part.zero)
        # events are not sharpened when their bounds are this narrow, relative to alpha
        width = Fraction(2.0**-60 * max(abs(float(low)), abs(float(high))))
        if high - low <= width:
            return None
        precise = self.precise(found.selection.rows.codes, found.side)
        return None if precise is None else enclosed(precise.functions, part.condition, low, high, width / 4)

    # -- values ----------------------------------------------------------------------------------------------------

    def values(self, codes: Codes, alpha: Fraction, *, precisely: bool) -> tuple[Floats, Floats] | None:
        """lambda [force] and w [length] of a selection's solution, 2p each; None where it is not proven regular.

        ``precisely`` asks for many digits, to be rounded last, where they are affordable and make a difference.
        """
        factor, side = Fraction(1), 0.0
        if self.origin is not None:
            if alpha == self.origin:
                return np.zeros(2 * self.problem.p), np.zeros(2 * self.problem.p)
            factor, side = abs(alpha - self.origin), 1.0 if alpha > self.origin else -1.0
        plain = self.selection(codes, side).at(float(alpha)) if self.sparing or not precisely else None
        close = plain is not None and all(_is_close(part.mid, part.rad) for part in plain[:2])
        precise = self.precise(codes, side) if precisely and not close else None
        if precise is not None:
            found = precise.forces(alpha)
            if found is not None:
                return tuple(np.array([float(v.mid()) for v in part]) * float(factor) for part in found)  # type: ignore[return-value]
        plain = plain or self.selection(codes, side).at(float(alpha))
        if plain is None:
            return None
        forces, w, _ = plain
        return forces.mid * self.force * float(factor), w.mid * self.length * float(factor)

    def slip_signs(self, codes: Codes, alpha: Fraction, nodes: Sequence[int]) -> Mapping[int, int]:
        """Signs of w_t of some nodes at a selection's solution, 0 where they are not proven."""
        side = 0.0 if self.origin is None else 1.0 if alpha > self.origin else -1.0
        found = self.selection(codes, side).at(float(alpha)) if alpha != self.origin else None
        if found is None:
            return dict.fromkeys(nodes, 0)
        w, p = found[1], self.problem.p
        return {i: int(w.mid[p + i] > 2 * w.rad[p + i]) - int(w.mid[p + i] < -2 * w.rad[p + i]) for i in nodes}


def _is_close(middle: Floats, radius: Floats) -> bool:
    # error of the values at a vertex, relative to the largest, up to which balls in double arithmetic will do where
    # many digits cost much
    return bool(np.max(radius) <= 2.0**-20 * np.max(np.abs(middle)))


def _down(value: Fraction) -> float:
    """The largest float that is not larger."""
    rounded = float(value)
    return rounded if Fraction(rounded) <= value else float(np.nextafter(rounded, -np.inf))


#: Selections that are followed side by side: so many at least, at most, and for one contact node; and where the user
#: waits for an end.
_LEAST, _MOST, _TOGETHER, _FEW = 16, 256, 2**16, 8


@dataclass
class Followed:
    """Traces of selections, and what they join to.

    Attributes
    ----------
    traced : TracedProblem
    cut_short : bool
        The search was stopped before, so that selections may be missing.
    traces : list of Trace
    joined : Joined
    stopped : Stop or None
        How far it got, if Ctrl-C was pressed or the time was over.
    """

    traced: TracedProblem
    cut_short: bool = False
    traces: list[Trace] = field(default_factory=list)
    joined: Joined = field(default_factory=Joined)
    stopped: Stop | None = None

    @property
    def reasons(self) -> list[str]:
        """Reasons against completeness: what was left open or contradicts it."""
        problem = self.traced.problem
        found = [(place.low, _undecided(place, problem), place.cause) for place in self.joined.open]
        ends = [(place.low, place.high) for place in self.joined.open if place.cause is OpenCause.END]
        for alpha in self.joined.unordered:
            line = f"the order of two critical alphas near {float(alpha):.17g} is not known"
            at_end = any(low <= alpha <= high for low, high in ends)
            found.append((alpha, line, OpenCause.END if at_end else OpenCause.TOGETHER))
        found.sort(key=lambda entry: entry[:2])
        # a search that was cut short has a remedy of its own
        missing = self.cut_short or self.stopped is not None
        lines = [line if missing else f"{line}; {_remedy(cause, problem)}" for _, line, cause in found]
        return list(dict.fromkeys([*self.joined.reasons, *lines]))


def _undecided(place: EventPlace, problem: ContactProblem) -> str:
    """Sentence on what is not decided at a place, and why not."""
    count = len(place.members)
    does = f"{counted(count, 'selection')} {'does' if count == 1 else 'do'}"
    where = f"[{float(place.low):.17g}, {float(place.high):.17g}]"
    nodes = [problem.node_ids[i] for i in sorted(place.nodes) if i < problem.p]
    of = f"of contact nodes {listed(nodes)}" if len(nodes) > 1 else "of several contact nodes"
    bounded = len(nodes) < len(place.nodes)
    of = f"{of if nodes else ''}{' and ' if nodes else ''}of the rigid displacement's bounds" if bounded else of
    one = f"of contact node {listed(nodes)}" if nodes else of
    why = {
        OpenCause.BOXES: "one of them was cut into as many boxes as are tried",
        OpenCause.END: "an end of the interval is too close to tell",
        OpenCause.SINGULAR: "the determinant of one of them may vanish there",
        OpenCause.TOGETHER: f"conditions {of} vanish there, too close together to be told apart",
        OpenCause.FLAT: f"a condition {one} may vanish there together with its slope",
        OpenCause.PARTNER: "where one of them ends, the one that goes on was not identified",
    }[place.cause]
    return f"what {does} for alpha in {where} is not decided: {why}"


def _remedy(cause: OpenCause, problem: ContactProblem) -> str:
    """Advice on what decides such a place."""
    if cause is OpenCause.END:
        return END_ELSEWHERE
    if problem.n <= EXACT_DOF_LIMIT:
        return 'arithmetic="exact" decides it, which may take long'
    if 2 * problem.p <= EXACT_DOF_LIMIT:
        return "the graph of problem.at_contact_nodes(), the same body up to rounding, is made by exact algebra"
    if cause is OpenCause.BOXES:
        return SHORT_INTERVAL
    return TOLD_APART


def follow_selections(
    traced: TracedProblem,
    pieces: Sequence[SearchedPiece],
    effort: Effort = Effort(),  # noqa: B008 (frozen)
    *,
    known: Sequence[Trace] = (),
    done: list[Trace] | None = None,
    cut_short: bool = False,
) -> Followed:
    """Trace all surviving selections where they survive; after a search that was cut short, over the whole interval.

    Parameters
    ----------
    traced : TracedProblem
    pieces : sequence of SearchedPiece
    effort : Effort
        Bounds the number of boxes. Selections that are not finished are left out.
    known : traces of selections that are taken over if they are as long
    done : list of Trace, optional
        Takes the traces, and has those of a call that was interrupted; their selections are not followed again.
    cut_short : the search was stopped before it had looked everywhere
    """
    where: dict[Codes, list[Bounds]] = {}
    for found in pieces:
        for codes in found.selections:
            where.setdefault(codes, []).append((found.piece.a, found.piece.b))
    followed = Followed(traced, cut_short=cut_short)
    traces, count = [] if done is None else done, len(where)
    if not cut_short and not traces:
        traces += _taken_over(traced, where, known)
    waiting = sorted(where.keys() - {trace.selection.rows.codes for trace in traces})
    # their matrices grow with the square of the number of nodes
    together = min(max(_LEAST, _TOGETHER // traced.problem.p**2), _MOST) if effort.most is None else _FEW

    def work(group: Sequence[Codes]) -> None:
        traced.trace({codes: [traced.interval] if cut_short else where[codes] for codes in group}, traces)

    stopped = effort.over(waiting, together, work, lambda: sum(len(trace.boxes) for trace in traces))
    finished = len({trace.selection.rows.codes for trace in traces})
    if stopped is not None:
        followed.stopped = Stop(stopped, finished, arcs_of=count)
    followed.traces = sorted(traces, key=lambda one: one.selection.rows.codes)
    missing = cut_short or finished < count
    followed.joined = join(
        followed.traces, traced.interval, traced.origin, traced.sharpen, cut_short=missing, sparing=traced.sparing
    )
    return followed


def _taken_over(traced: TracedProblem, where: dict[Codes, list[Bounds]], known: Sequence[Trace]) -> list[Trace]:
    """Known traces of selections that have all of theirs; these are taken out of ``where``."""
    found: dict[Codes, list[Trace]] = {}
    for one in known:
        found.setdefault(one.selection.rows.codes, []).append(one)
    taken: list[Trace] = []
    for codes, traces in found.items():
        spans = [(one.low, one.high, one.side) for one in traces]
        if codes in where and sorted(spans) == sorted(traced.spans(where[codes])):
            taken += traces
            del where[codes]
    return taken


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
