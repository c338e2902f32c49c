"""Arcs from the traces of selections, joined where a condition of one vanishes with one of its neighbour's.

Two neighbouring selections differ at one node. Where exactly one condition of a selection vanishes, its solution also
solves the neighbour, whose own condition vanishes there; both have only one such zero in the parts that hold it, so
that no numbers need be compared (theory, section 7.14).
"""

from __future__ import annotations

import enum
from bisect import bisect_right
from dataclasses import dataclass, field
from fractions import Fraction
from typing import TYPE_CHECKING

from networkx.utils import UnionFind

from enumsol.branches.elements import DEFECT, named
from enumsol.branches.enclosed.cutting import ArcPart, ArcPartKind, OpenCause, Trace, parts_between
from enumsol.model.statuses import ACROSS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from enumsol.support.array_types import Codes

    Bounds = tuple[Fraction, Fraction]


class EventPlaceKind(enum.StrEnum):
    """Kind of a place at which arcs end."""

    #: The first or last alpha.
    BORDER = "border"
    #: Where g vanishes, and every selection holds.
    ORIGIN = "origin"
    #: A condition vanishes.
    EVENT = "event"
    #: The rigid displacement reaches a bound.
    BOUND = "bound"
    #: Not decided.
    OPEN = "open"


@dataclass(eq=False)
class EventPlace:
    """A point at which arcs end, or a short interval that was left open.

    Attributes
    ----------
    kind : EventPlaceKind
    low, high : Fraction
        Bounds of its alpha.
    members : list of codes
        Selections that hold there, or at an open place may.
    node : int
        At an event the node whose status changes.
    whole : bool
        Every selection that holds there was examined (which open places leave undecided).
    cause : OpenCause
        At an open place why it was left open.
    nodes : frozenset of int
        At an open place the nodes whose conditions may vanish, as far as they are known.
    """

    kind: EventPlaceKind
    low: Fraction
    high: Fraction
    members: list[Codes]
    node: int = -1
    whole: bool = True
    cause: OpenCause = OpenCause.PARTNER
    nodes: frozenset[int] = frozenset()


@dataclass
class JoinedArc:
    """Interval between two places in which one selection holds.

    Attributes
    ----------
    trace : Trace
    tail, head : EventPlace
    low, high : Fraction
        It holds between them at least. Beside an open place, which may stand for many parts, that is more than between
        the places.
    index : int
        Sign of the determinant.
    """

    trace: Trace
    tail: EventPlace
    head: EventPlace
    low: Fraction
    high: Fraction
    index: int = 0

    @property
    def codes(self) -> Codes:
        """The selection."""
        return self.trace.selection.rows.codes


@dataclass
class Joined:
    """Places in the order of alpha, and arcs between them.

    Attributes
    ----------
    places : list of EventPlace
    arcs : list of JoinedArc
    reasons : list of str
        What contradicts completeness.
    unordered : list of Fraction
        Where the order of two places is not known.
    """

    places: list[EventPlace] = field(default_factory=list)
    arcs: list[JoinedArc] = field(default_factory=list)
    reasons: list[str] = field(default_factory=list)
    unordered: list[Fraction] = field(default_factory=list)

    @property
    def ordered(self) -> bool:
        """True if the order of all places is known."""
        return not self.unordered

    @property
    def open(self) -> list[EventPlace]:
        """Places that were left open."""
        return [place for place in self.places if place.kind is EventPlaceKind.OPEN]


@dataclass(eq=False)
class _Found:
    """An event or an open part of a trace."""

    trace: Trace
    part: ArcPart
    place: EventPlace | None = None

    @property
    def codes(self) -> Codes:
        return self.trace.selection.rows.codes

    @property
    def low(self) -> Fraction:
        return Fraction(self.part.zero[0] if self.part.kind is ArcPartKind.EVENT else self.part.low)

    @property
    def high(self) -> Fraction:
        return Fraction(self.part.zero[1] if self.part.kind is ArcPartKind.EVENT else self.part.high)

    @property
    def condition(self) -> tuple[int, int]:
        return self.trace.selection.rows.conditions[self.part.condition]

    @property
    def doubtful(self) -> frozenset[int]:
        return frozenset((self.condition[0],)) if self.part.kind is ArcPartKind.EVENT else self.part.doubtful

    def inside(self, other: _Found) -> bool:
        """True if the zero lies in the other's part."""
        return Fraction(other.part.low) <= self.low and self.high <= Fraction(other.part.high)


def join(
    traces: Sequence[Trace],
    interval: Bounds,
    origin: Fraction | None,
    sharpen: Callable[[Trace, ArcPart], Bounds | None],
    *,
    cut_short: bool = False,
    sparing: bool = False,
) -> Joined:
    """Arcs and the places at which they end.

    Parameters
    ----------
    traces : sequence of Trace
    interval : (Fraction, Fraction)
    origin : Fraction or None
        The alpha at which g vanishes, if it lies in the interval; no trace crosses it.
    sharpen : gives narrower bounds of an event's zero, or None
    cut_short : selections that hold somewhere may be missing, as all do at the origin
    sparing : bounds are made narrower only where the order of the places is not known otherwise
    """
    joined = _Joining(traces, interval, origin, sharpen, not cut_short, sparing).run()
    if sparing and not joined.ordered:
        joined = _Joining(traces, interval, origin, sharpen, not cut_short, sparing=False).run()
    return joined


@dataclass
class _Joining:
    """Traces being joined."""

    traces: Sequence[Trace]
    interval: Bounds
    origin: Fraction | None
    sharpen: Callable[[Trace, ArcPart], Bounds | None]
    whole: bool
    sparing: bool

    def __post_init__(self) -> None:
        origin, self._joined = self.origin, Joined()
        self._origin = None
        if origin is not None:
            self._origin = EventPlace(EventPlaceKind.ORIGIN, origin, origin, [], whole=self.whole)
        self._parts = []
        for trace in self.traces:
            low, high = self.interval
            if origin is not None:
                low, high = (origin, high) if trace.side > 0 else (low, origin)
            self._parts.append(list(parts_between(trace, low, high, self.sharpen)))
        self._found = {
            part: _Found(trace, part)
            for trace, parts in zip(self.traces, self._parts, strict=True)
            for part in parts
            if part.kind in (ArcPartKind.EVENT, ArcPartKind.OPEN)
        }

    def run(self) -> Joined:
        """Places first, then the arcs between them."""
        self._match()
        self._gather()
        for trace, parts in zip(self.traces, self._parts, strict=True):
            self._follow(trace, parts)
        places = self._joined.places
        if self._origin is not None:
            self._origin.members = sorted({trace.selection.rows.codes for trace in self.traces})
            if any(place.low <= self._origin.low <= place.high for place in self._joined.open):
                self._origin.kind = EventPlaceKind.OPEN  # unknown arcs may end there
            places.append(self._origin)
        places.sort(key=lambda place: (place.low, place.high, place.members))
        self._check_order()
        number = {place: k for k, place in enumerate(places)}
        self._joined.arcs.sort(key=lambda arc: (number[arc.tail], number[arc.head], arc.codes))
        return self._joined

    # -- places ----------------------------------------------------------------------------------------------------

    def _match(self) -> None:
        """Pair events of neighbouring selections that are the same point."""
        by_codes: dict[Codes, list[_Found]] = {}
        for found in self._found.values():
            if found.part.kind is ArcPartKind.EVENT:
                by_codes.setdefault(found.codes, []).append(found)
        for codes, events in by_codes.items():
            for event in events:
                if event.place is not None:
                    continue
                if event.condition[0] >= len(codes):
                    bounds = self._bounds(event, event)
                    event.place = EventPlace(EventPlaceKind.BOUND, *bounds, [codes])
                    self._joined.places.append(event.place)
                    continue
                partners = [
                    other
                    for other in self._neighbours(event, by_codes)
                    if other.place is None and (event.inside(other) or other.inside(event))
                ]
                if len(partners) == 1:
                    low, high = self._bounds(event, partners[0])
                    members = sorted((codes, partners[0].codes))
                    place = EventPlace(EventPlaceKind.EVENT, low, high, members, event.condition[0])
                    event.place = partners[0].place = place
                    self._joined.places.append(place)

    def _neighbours(self, event: _Found, by_codes: dict[Codes, list[_Found]]) -> Iterator[_Found]:
        """Events at which the condition across the vanishing one vanishes."""
        node, kind = event.condition
        for code, across in ACROSS.get((event.codes[node], kind), ()):
            other = (*event.codes[:node], code, *event.codes[node + 1 :])
            for found in by_codes.get(other, ()):
                if found.condition == (node, across) and found.trace.side == event.trace.side:
                    yield found

    def _bounds(self, one: _Found, other: _Found) -> Bounds:
        """Bounds of the zero that two events have in common."""
        low, high = max(one.low, other.low), min(one.high, other.high)
        for event in () if self.sparing else sorted((one, other), key=lambda event: event.codes):
            sharper = self.sharpen(event.trace, event.part)
            if sharper is not None:
                return max(low, sharper[0]), min(high, sharper[1])
        return low, high

    def _gather(self) -> None:
        """Make one place of all that was left open and may be connected."""
        left = sorted((found for found in self._found.values() if found.place is None), key=lambda f: (f.low, f.codes))
        union: UnionFind = UnionFind(range(len(left)))
        lows = [found.low for found in left]
        for j, one in enumerate(left):
            # in the order of their beginnings
            for k in range(j + 1, bisect_right(lows, one.high)):
                if _connected(one, left[k]):
                    union.union(j, k)
        groups: dict[int, list[_Found]] = {}
        for k, found in enumerate(left):
            groups.setdefault(union[k], []).append(found)
        for group in groups.values():
            members = sorted({found.codes for found in group})
            low, high = min(found.low for found in group), max(found.high for found in group)
            causes = {found.part.cause for found in group}
            cause = next((cause for cause in OpenCause if cause in causes), OpenCause.PARTNER)
            # what is shorter, beside the interval, and left open at its end would be decided elsewhere
            if high - low <= Fraction(1, 2**30) * (self.interval[1] - self.interval[0]) and any(
                low <= end <= high for end in self.interval
            ):
                cause = OpenCause.END
            some = [found.doubtful for found in group if len(found.doubtful) < len(found.codes)]
            nodes: frozenset[int] = frozenset().union(*some)
            place = EventPlace(EventPlaceKind.OPEN, low, high, members, cause=cause, nodes=nodes)
            for found in group:
                found.place = place
            self._joined.places.append(place)

    def _border(self, trace: Trace, alpha: float, *, upper: bool) -> EventPlace | None:
        """Place at the end of a trace that holds up to it; None inside the interval."""
        origin = self._origin
        towards = origin is not None and trace.side == (-1.0 if upper else 1.0)
        if origin is not None and towards and ((alpha >= origin.low) if upper else (alpha <= origin.low)):
            return origin
        end = self.interval[int(upper)]
        if (alpha < end) if upper else (alpha > end):
            return None
        place = EventPlace(EventPlaceKind.BORDER, end, end, [trace.selection.rows.codes])
        self._joined.places.append(place)
        return place

    def _check_order(self) -> None:
        places = self._joined.places
        last = None
        for place in places:
            if last is not None and place.low <= last.high and not place.low == place.high == last.low == last.high:
                self._joined.unordered.append(place.low)
            if last is None or place.high > last.high:
                last = place

    # -- arcs ------------------------------------------------------------------------------------------------------

    def _follow(self, trace: Trace, parts: Sequence[ArcPart]) -> None:
        """The arcs of one trace."""
        arc: JoinedArc | None = None
        before: EventPlace | None = None  # what was left open directly before
        first = True
        for part in parts:
            if part.kind is ArcPartKind.OPEN:
                place = self._found[part].place
                if arc is not None and place is not None:
                    self._end(arc, place, Fraction(part.low))
                arc, before = None, place
            elif part.kind is ArcPartKind.NONE:
                if arc is not None:
                    self._contradiction(trace, part)
                arc = before = None
            else:
                rises = part.kind is ArcPartKind.EVENT and part.rising
                if arc is None and not rises:
                    start = self._border(trace, trace.low, upper=False) if first else before
                    if start is None:
                        self._contradiction(trace, part)
                    else:
                        arc = _begun(trace, start, part)
                elif arc is not None and rises:
                    self._contradiction(trace, part)
                before = None
                if part.kind is ArcPartKind.EVENT:
                    place = self._found[part].place
                    assert place is not None
                    if rises:
                        arc = _begun(trace, place, part)
                    elif arc is not None:
                        unpaired = place.kind is EventPlaceKind.OPEN
                        self._end(arc, place, Fraction(part.zero[0]) if unpaired else place.low)
                        arc = None
            first = False
        if arc is not None:
            end = self._border(trace, trace.high, upper=True)
            if end is None:
                self._contradiction(trace, part)
            else:
                self._end(arc, end, end.low)

    def _end(self, arc: JoinedArc, place: EventPlace, alpha: Fraction) -> None:
        arc.head, arc.high = place, alpha
        self._joined.arcs.append(arc)

    def _contradiction(self, trace: Trace, part: ArcPart) -> None:
        where = f"begins or ends at no event near alpha = {float(part.low):.17g}"
        reason = f"{named(trace.selection.rows.codes)} {where}; {DEFECT}"
        if reason not in self._joined.reasons:
            self._joined.reasons.append(reason)


def _begun(trace: Trace, place: EventPlace, part: ArcPart) -> JoinedArc:
    """An arc that begins at a place, with this part."""
    low = place.high
    if place.kind is EventPlaceKind.OPEN:
        low = Fraction(part.zero[1] if part.kind is ArcPartKind.EVENT and part.rising else part.low)
    return JoinedArc(trace, place, place, low, low, part.index)


def _connected(one: _Found, other: _Found) -> bool:
    """True if two selections may have a solution in common: where they differ, conditions of both may vanish."""
    differ = {i for i, (a, b) in enumerate(zip(one.codes, other.codes, strict=True)) if a != b}
    return differ <= one.doubtful & other.doubtful
