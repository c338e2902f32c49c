"""Checker of the arcs of a branch graph: where every surviving selection holds, and how arcs are joined.

Records are those of docs/proof_format.md (7.3).

Every box is expanded anew by the trusted core, and every part of it is tested (``arc_boxes``). Then events are paired
by the condition that vanishes: each must have exactly one partner, arcs end at events, at the interval's ends or where
g vanishes, and indices balance. What a proof leaves open is counted.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.checker.arc_boxes import (
    Boxes,
    ClaimedArc,
    ClaimedEvent,
    ClaimedTrace,
    alpha_number,
    check_entries,
    inside,
    shown,
)
from enumsol.proof.leaves import OnlyReference, Unbalanced
from enumsol.proof.reading import RefusedError, names_only, quoted, same, units_from
from enumsol.support.deadlines import tell
from enumsol.trusted.arcs.only_branch import branch_references, only_roots
from enumsol.trusted.arcs.selection_balls import ArcSelection, ArcSystem
from enumsol.trusted.floating_bounds import without_bound
from enumsol.trusted.over_interval import PieceNumbers
from enumsol.trusted.selection import CONE_MINUS, CONE_PLUS, NORMAL_FORCE, PENETRATION, SLIP_BACKWARD, SLIP_FORWARD
from enumsol.trusted.status_rows import FRICTIONLESS, OPEN, SLIP_MINUS, SLIP_PLUS, STICK

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from enumsol.arithmetic.balls import Ball
    from enumsol.condensation.enclosure import CondensedEnclosure
    from enumsol.model.problem import ContactProblem
    from enumsol.support.array_types import Codes

    Span = tuple[Fraction, Fraction, int]


@dataclass(eq=False)
class PieceOnArcs:
    """Leaves over a piece that say that its solutions lie on the arcs through it, by one form.

    Attributes
    ----------
    a, b : Fraction
    numbers : PieceNumbers
    leaves : list of (codes, record)
        Below which assignments there is nothing else.
    bounded : bool
        That was shown within the bound of its rigid displacement only.
    """

    a: Fraction
    b: Fraction
    numbers: PieceNumbers
    leaves: list[tuple[Codes, OnlyReference | Unbalanced]] = field(default_factory=list)
    bounded: bool = False

    def failure(
        self, arcs: Sequence[ClaimedArc], systems: dict[int, ArcSystem[Ball]], origin: Fraction | None
    ) -> str | None:
        """Why the arcs are not shown to hold all its solutions, or None. Events have their partners."""
        side = 0 if origin is None else 1 if self.b > origin else -1
        chain = self._chain([arc for arc in arcs if arc.side == side])
        if chain is None:
            return "no arcs lead through it"
        spans = []
        for arc in chain:
            low = self.a if arc.tail is None else max(self.a, arc.tail.zero[0])
            high = self.b if arc.head is None else min(self.b, arc.head.zero[1])
            spans.append((ArcSelection(systems[side], arc.codes), _below(low), -_below(-high)))
        system = systems[side]
        proven = all(only_roots(spans, self.numbers)) if not len(system.reach) else self._covered(spans, system)
        return None if proven else "its arcs are not proven to hold all its solutions"

    def _covered(self, spans: Sequence[tuple[ArcSelection, float, float]], system: ArcSystem[Ball]) -> bool:
        """True if every leaf is proven to hold nothing beside the arcs (theory, section 14.16)."""
        ends = _below(self.a), -_below(-self.b)
        known, free = branch_references(spans, self.numbers), without_bound(system.at(*ends)).reach
        for codes, leaf in self.leaves:
            if isinstance(leaf, Unbalanced):
                if not system.unbalanced(codes, *ends, leaf.direction):
                    return False
            elif not known:
                return False
            elif not all(leaf.holds(one, codes, free) for one in known):
                self.bounded = True
                if not all(leaf.holds(one, codes, system.reach) for one in known):
                    return False
        return True

    def _chain(self, arcs: Sequence[ClaimedArc]) -> list[ClaimedArc] | None:
        """Arcs one after another, of which one holds at every alpha of the piece."""
        begins = {arc.tail: arc for arc in arcs if arc.tail is not None}
        arc = next((arc for arc in arcs if arc.low <= self.a and self.a <= _end(arc)), None)
        found = []
        while arc is not None:
            found.append(arc)
            if arc.high >= self.b:
                return found
            partners = [] if arc.head is None else arc.head.partners
            goes_on = len(partners) == 1 and partners[0].rising
            arc = begins.get(partners[0]) if goes_on else None
        return None


def _end(arc: ClaimedArc) -> Fraction:
    return arc.high if arc.head is None else arc.head.zero[1]


def _below(alpha: Fraction) -> float:
    """The largest float that is not larger."""
    value = float(alpha)
    return value if value <= alpha else float(np.nextafter(value, -np.inf))


#: Most boxes of a trace, and most parts of a box.
_MOST_BOXES, _MOST_PARTS = 1000, 1000
#: Conditions that vanish together where a node changes from one status to another: status, condition.
_PAIRS = (
    ((OPEN, PENETRATION), (SLIP_PLUS, NORMAL_FORCE)),
    ((OPEN, PENETRATION), (SLIP_MINUS, NORMAL_FORCE)),
    ((OPEN, PENETRATION), (FRICTIONLESS, NORMAL_FORCE)),
    ((STICK, CONE_PLUS), (SLIP_PLUS, SLIP_FORWARD)),
    ((STICK, CONE_MINUS), (SLIP_MINUS, SLIP_BACKWARD)),
)


@dataclass
class ArcChecker:
    """Checks the traces of a graph's proof.

    Attributes
    ----------
    problem : ContactProblem
    enclosure : CondensedEnclosure
        Of the problem's own data.
    interval : (Fraction, Fraction)
    origin : Fraction or None
        The alpha at which g vanishes, if it lies in the interval.
    pieces : mapping of codes to lists of (Fraction, Fraction)
        Where selections survive.
    closed : sequence of PieceOnArcs
        Pieces whose solutions are said to lie on the arcs through them.
    fail : called with a sentence for every failure
    traces : int
    arcs : list of ClaimedArc
    events : list of ClaimedEvent
    open : int
        Intervals that were left open, and events without a partner beside them.
    """

    problem: ContactProblem
    enclosure: CondensedEnclosure
    interval: tuple[Fraction, Fraction]
    origin: Fraction | None
    pieces: Mapping[Codes, list[tuple[Fraction, Fraction]]]
    closed: Sequence[PieceOnArcs]
    fail: Callable[[str], None]
    traces: int = 0
    arcs: list[ClaimedArc] = field(default_factory=list)
    events: list[ClaimedEvent] = field(default_factory=list)
    open: int = 0
    _systems: dict[int, ArcSystem[Ball]] = field(default_factory=dict)
    #: Sums of the indices of arcs that begin there.
    _degrees: dict[str, int] = field(default_factory=lambda: {"first": 0})

    def __post_init__(self) -> None:
        self._due = {(codes, *span) for codes, where in self.pieces.items() for span in self._spans(where)}
        self._boxes = Boxes(self.fail)
        if self.origin is not None and self.interval[0] < self.origin < self.interval[1]:
            self._degrees["unloaded"] = 0

    def run(self, head: dict[str, Any], records: Iterator[Any]) -> Any:
        """Check all traces; gives the record after them."""
        try:
            names_only(head, ("traces", "force", "length"))
            units = units_from(head, self.problem.p)
        except ValueError as error:
            raise RefusedError(f"the arcs cannot be read: {error}") from None
        sides = (0,) if self.origin is None else (-1, 1)
        system = ArcSystem.of(self.problem, self.enclosure, *units)
        self._systems = {side: system.beside_zero(float(side)) for side in sides}
        record, due = next(records, None), len(self._due)
        while isinstance(record, list):
            tell("selections followed", min(self.traces, due), due)
            self.traces += 1
            try:
                record = self._trace(record, records)
            except (ValueError, OverflowError) as error:
                raise RefusedError(f"trace {self.traces} cannot be read: {error}") from None
        self._boxes.check()
        if not same(head["traces"], self.traces):
            self.fail(f"there are {self.traces} traces; the arcs begin with {quoted(head['traces'])}")
        if self._due:
            self.fail(f"{len(self._due)} of the surviving selections are not traced")
        self._pair()
        for piece in self.closed:
            failure = piece.failure(self.arcs, self._systems, self.origin)
            if failure is not None:
                self.fail(f"the piece from {float(piece.a)} to {float(piece.b)}: {failure}")
        for place, total in self._degrees.items():
            if self.problem.held and not self.open and total != 1:
                self.fail(f"the indices at the {place} alpha add up to {total}; expected 1")
        return record

    def _spans(self, pieces: list[tuple[Fraction, Fraction]]) -> Iterator[Span]:
        """Pieces joined where they touch, cut where g vanishes, with the side of that alpha."""
        merged: list[list[Fraction]] = []
        for a, b in sorted(pieces):
            if merged and (a < merged[-1][1] or a == merged[-1][1] != self.origin):
                merged[-1][1] = max(b, merged[-1][1])
            else:
                merged.append([a, b])
        for a, b in merged:
            cuts = [a, b]
            if self.origin is not None and a < self.origin < b:
                cuts.insert(1, self.origin)
            for x, y in pairwise(cuts):
                yield x, y, 0 if self.origin is None else 1 if y > self.origin else -1

    # -- one trace -------------------------------------------------------------------------------------------------

    def _trace(self, record: Any, records: Iterator[Any]) -> Any:
        """Check a trace and follow its arcs; gives the record after it."""
        if len(record) != 5 or record[0] != "t" or type(record[4]) is not int or record[4] not in (-1, 0, 1):
            raise ValueError(f"{quoted(record)} begins no trace")
        low, high, side = alpha_number(record[2]), alpha_number(record[3]), record[4]
        spans = (d for d in self._due if same(record[1], [*d[0]]) and d[3] == side)
        due = next((d for d in spans if _is_next(-low, -d[1]) and _is_next(high, d[2])), None)
        if due is None:
            raise ValueError("its selection does not survive there, or the trace is repeated")
        self._due.remove(due)
        codes = due[0]
        trace = ClaimedTrace(self, ArcSelection(self._systems[side], codes), side, (low, high))
        end, boxes = low, 0
        record = next(records, None)
        while isinstance(record, list) and record and record[0] == "w":
            boxes += 1
            if boxes > _MOST_BOXES:
                raise ValueError(f"it has more than {_MOST_BOXES} boxes")
            end = self._box(record, trace, end)
            record = next(records, None)
        if end != high:
            self.fail(f"the boxes of selection {shown(codes)} do not cover its trace")
        trace.finish()
        return record

    def _box(self, record: list[Any], trace: ClaimedTrace, start: Fraction) -> Fraction:
        """Follow the arcs through the parts of a box, and keep what they say; the end of the last one."""
        if len(record) != 5 or type(record[3]) is not int or record[3] not in (0, 1) or not isinstance(record[4], list):
            raise ValueError(f"{quoted(record)} is not a box")
        low, high = alpha_number(record[1]), alpha_number(record[2])
        if not low == start < high or not 0 < len(record[4]) <= _MOST_PARTS:
            raise ValueError("a box does not begin where the one before ends, or has no parts or too many")
        end: Any = record[1]
        said: list[tuple[list[Any], Any, Any]] = []
        for part in record[4]:
            check_entries(part, len(trace.plain.rows.conditions))
            before, end = end, part[1]
            first, last = alpha_number(before), alpha_number(end)
            if not first < last <= high:
                raise ValueError("the parts of a box are not in order")
            if part[0] != "u":
                said.append((part, before, end))
            trace.part(part[0], part, (first, last))
        if said:
            self._boxes.add(trace, record[1], record[2], said, precise=bool(record[3]))
        return alpha_number(end)

    # -- all of them -----------------------------------------------------------------------------------------------

    def end_at(self, alpha: Fraction, side: int, *, upper: bool) -> bool:
        """True if an arc may end there: at an end of the interval, or where g vanishes."""
        if self.origin is not None and side == (-1 if upper else 1):
            return alpha >= self.origin if upper else alpha <= self.origin
        return alpha >= self.interval[1] if upper else alpha <= self.interval[0]

    def arc(self, arc: ClaimedArc, index: int, starts: int | None) -> None:
        """Keep an arc; one that begins at an end of the interval, or where g vanishes, with its side."""
        self.arcs.append(arc)
        if starts is not None:
            self._degrees["unloaded" if starts == 1 and "unloaded" in self._degrees else "first"] += index

    @cached_property
    def precise_system(self) -> Any:
        """The problem in many digits."""
        from enumsol.trusted.arcs.precise import (
            affordable,
            system_in_many_digits,  # python-flint, not for all proofs
        )

        if not affordable(self.problem):
            raise RefusedError("a box in many digits belongs to a problem that is too large for it")
        system = system_in_many_digits(self.problem)
        if system is None:
            raise RefusedError("A is positive definite only within rounding")
        return system

    def loose_end(self, codes: Codes, alpha: Fraction) -> None:
        """Fail since an arc begins or ends where it must not."""
        self.fail(f"an arc of selection {shown(codes)} begins or ends at {float(alpha)} for no reason")

    def _pair(self) -> None:
        """Pair events; each belongs to exactly one other, unless something beside it was left open."""
        by_codes: dict[tuple[Codes, int, tuple[int, int]], list[ClaimedEvent]] = {}
        for event in self.events:
            by_codes.setdefault((event.codes, event.side, event.condition), []).append(event)
        for event in self.events:
            node, kind = event.condition
            if event.bound:
                continue
            for one, other in (*_PAIRS, *((b, a) for a, b in _PAIRS)):
                if one != (event.codes[node], kind):
                    continue
                codes = (*event.codes[:node], other[0], *event.codes[node + 1 :])
                for found in by_codes.get((codes, event.side, (node, other[1])), ()):
                    if inside(event.zero, found.part) or inside(found.zero, event.part):
                        event.partners.append(found)
        for event in self.events:
            if len(event.partners) == 1:
                partner = event.partners[0]
                # going on the index stays, turning back it changes its sign
                same = event.rising != partner.rising
                if event.index != (partner.index if same else -partner.index):
                    self.fail(f"indices do not balance at {float(event.zero[0])}")
            elif event.bound:
                continue  # beyond, nothing is asked
            elif event.partners:
                where = f"selection {shown(event.codes)} at {float(event.zero[0])}"
                self.fail(f"an event of {where} has {len(event.partners)} partners")
            else:
                self.open += 1  # bounds too wide to find the partner, or it was left open


def _is_next(value: Fraction, end: Fraction) -> bool:
    """True if it is the smallest float that is not smaller than ``end``: what is beyond would not be about it."""
    return value == end or (value > end and Fraction(np.nextafter(float(value), -np.inf)) < end)
