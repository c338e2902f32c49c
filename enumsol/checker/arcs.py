"""Checker of the arcs of a branch graph: where every selection handed on holds, and how arcs are joined.

Records (see docs/proof_format.md, under Arcs): ``{"traces", "force", "length"}``; for every selection and every
interval on which it was handed on ``["t", codes, low, high, side]``, then its boxes ``["b", low, high, precise,
parts]``.

Every box is expanded anew by the trusted kernel, and every part of it is tested. Then events are paired by the
condition that vanishes: each must have exactly one partner, arcs end at events, at the interval's ends or where g
vanishes, and indices balance. What a proof leaves open is counted.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from enumsol.kernel.arcs import ArcSelection, ArcSystem
from enumsol.kernel.rows import FRICTIONLESS, OPEN, SLIP_MINUS, SLIP_PLUS, STICK
from enumsol.kernel.selection_rows import (
    CONE_MINUS,
    CONE_PLUS,
    NORMAL_FORCE,
    PENETRATION,
    SLIP_BACKWARD,
    SLIP_FORWARD,
)
from enumsol.proof.reading import RefusedError, codes_from, rational_from, shown, units_from

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from enumsol.condensation.enclosure import CondensedEnclosure
    from enumsol.problem import ContactProblem

    Codes = tuple[int, ...]
    Span = tuple[Fraction, Fraction, int]

_END: Any = object()
#: Most boxes of a trace, and most parts of a box.
_MOST_BOXES, _MOST_PARTS = 1000, 1000
#: Entries of a part, by its kind.
_ENTRIES = {"h": 3, "n": 2, "e": 7, "u": 2}
#: Conditions that vanish together where a node changes from one status to another: status, condition.
_PAIRS = (
    ((OPEN, PENETRATION), (SLIP_PLUS, NORMAL_FORCE)),
    ((OPEN, PENETRATION), (SLIP_MINUS, NORMAL_FORCE)),
    ((OPEN, PENETRATION), (FRICTIONLESS, NORMAL_FORCE)),
    ((STICK, CONE_PLUS), (SLIP_PLUS, SLIP_FORWARD)),
    ((STICK, CONE_MINUS), (SLIP_MINUS, SLIP_BACKWARD)),
)


@dataclass
class _Event:
    """A point at which one condition of a selection vanishes."""

    codes: Codes
    side: int
    condition: tuple[int, int]
    part: tuple[Fraction, Fraction]
    zero: tuple[Fraction, Fraction]
    rising: bool
    index: int
    partners: list[_Event] = field(default_factory=list)


@dataclass
class ArcCount:
    """What the traces show.

    Attributes
    ----------
    arcs : int
    open : int
        Parts that were left open, and events without a partner beside them.
    """

    arcs: int = 0
    open: int = 0


class ArcChecker:
    """Checks the traces of a graph's proof.

    Parameters
    ----------
    problem : ContactProblem
    enclosure : CondensedEnclosure
        Of the problem's own data.
    interval : (Fraction, Fraction)
    origin : Fraction or None
        The alpha at which g vanishes, if it lies in the interval.
    pieces : mapping of codes to lists of (Fraction, Fraction)
        Where selections were handed on.
    fail : called with a sentence for every failure
    """

    def __init__(
        self,
        problem: ContactProblem,
        enclosure: CondensedEnclosure,
        interval: tuple[Fraction, Fraction],
        origin: Fraction | None,
        pieces: Mapping[Codes, list[tuple[Fraction, Fraction]]],
        fail: Callable[[str], None],
    ) -> None:
        self._problem, self._enclosure, self._interval, self._origin = problem, enclosure, interval, origin
        self._fail = fail
        self._due = {(codes, *span) for codes, where in pieces.items() for span in self._spans(where)}
        self._systems: dict[int, ArcSystem] = {}
        self._events: list[_Event] = []
        self._count = ArcCount()
        self._border = self.traces = 0

    def run(self, head: dict[str, Any], records: Iterator[Any]) -> tuple[ArcCount, Any]:
        """Check all traces; what they show, and the record after them."""
        try:
            units = units_from(head, self._problem.p)
        except ValueError as error:
            raise RefusedError(f"the arcs cannot be read: {error}") from None
        sides = (0,) if self._origin is None else (-1, 1)
        self._systems = {side: ArcSystem.of(self._enclosure, *units, float(side)) for side in sides}
        record = next(records, _END)
        while isinstance(record, list):
            self.traces += 1
            try:
                record = self._trace(record, records)
            except (ValueError, OverflowError) as error:
                raise RefusedError(f"trace {self.traces} cannot be read: {error}") from None
        if self.traces != head.get("traces"):
            self._fail(f"there are {self.traces} traces; the arcs begin with {shown(head.get('traces'))}")
        if self._due:
            self._fail(f"{len(self._due)} of the selections handed on are not traced")
        self._pair()
        if not self._count.open and self._border != 1:
            self._fail(f"the indices at the first alpha add up to {self._border}; expected 1")
        return self._count, record

    def _spans(self, pieces: list[tuple[Fraction, Fraction]]) -> Iterator[Span]:
        """Pieces joined where they touch, cut where g vanishes, with the side of that alpha."""
        merged: list[list[Fraction]] = []
        for a, b in sorted(pieces):
            if merged and a <= merged[-1][1] and a != self._origin:
                merged[-1][1] = max(b, merged[-1][1])
            else:
                merged.append([a, b])
        for a, b in merged:
            cuts = [a, b]
            if self._origin is not None and a < self._origin < b:
                cuts.insert(1, self._origin)
            for x, y in pairwise(cuts):
                yield x, y, 0 if self._origin is None else 1 if y > self._origin else -1

    # -- one trace -------------------------------------------------------------------------------------------------

    def _trace(self, record: list[Any], records: Iterator[Any]) -> Any:
        """Check a trace and follow its arcs; gives the record after it."""
        if len(record) != 5 or record[0] != "t" or record[4] not in (-1, 0, 1):
            raise ValueError(f"{shown(record)} begins no trace")
        codes = tuple(codes_from([record[1]], self._problem.p)[0].tolist())
        low, high, side = _number(record[2]), _number(record[3]), int(record[4])
        found = [d for d in self._due if d[0] == codes and d[3] == side and low <= d[1] < d[2] <= high]
        due = min(found, default=None)
        if due is None:
            raise ValueError("it is about no selection that was handed on there, or repeated")
        self._due.remove(due)
        selection = _Selection(self, ArcSelection(self._systems[side], codes), side)
        follower = _Follower(self, selection.conditions, codes, side, (low, high))
        end, boxes = low, 0
        record = next(records, _END)
        while isinstance(record, list) and record and record[0] == "b":
            boxes += 1
            if boxes > _MOST_BOXES:
                raise ValueError(f"it has more than {_MOST_BOXES} boxes")
            end = self._box(record, selection, follower, end)
            record = next(records, _END)
        if end != high:
            self._fail(f"the boxes of selection {_text(codes)} do not cover its trace")
        follower.finish()
        return record

    def _box(self, record: list[Any], selection: _Selection, follower: _Follower, start: Fraction) -> Fraction:
        """Check the parts of a box; the end of the last one."""
        if len(record) != 5 or record[3] not in (0, 1) or not isinstance(record[4], list):
            raise ValueError(f"{shown(record)} is no box")
        low, high = _number(record[1]), _number(record[2])
        if not low == start < high or not 0 < len(record[4]) <= _MOST_PARTS:
            raise ValueError("a box does not begin where the one before ends, or has no parts or too many")
        nothing = all(isinstance(part, list) and part[:1] == ["u"] for part in record[4])
        expansion = None if nothing else selection.expansion(record[1], record[2], precise=bool(record[3]))
        end: Any = record[1]
        for part in record[4]:
            kind = part[0] if isinstance(part, list) and part else None
            if not isinstance(kind, str) or kind not in _ENTRIES or len(part) != _ENTRIES[kind]:
                raise ValueError(f"{shown(part)} is no part of a box")
            before, end = end, part[1]
            first, last = _number(before), _number(end)
            if not first < last <= high:
                raise ValueError("the parts of a box are not in order")
            _check_entries(part, len(selection.conditions))
            if kind != "u" and (expansion is None or not _proven(expansion, part, before, end)):
                where = f"[{float(first)}, {float(last)}]"
                self._fail(f"selection {_text(follower.codes)}: what is said of {where} is not proven")
            if kind == "e" and not selection.signs_differ(part):
                self._fail(f"selection {_text(follower.codes)}: bounds of an event near {float(first)} are not proven")
            follower.part(kind, part, (first, last))
        return _number(end)

    # -- all of them -----------------------------------------------------------------------------------------------

    def end_at(self, alpha: Fraction, side: int, *, upper: bool) -> bool:
        """Whether an arc may end there: at an end of the interval, or where g vanishes."""
        if self._origin is not None and side == (-1 if upper else 1):
            return alpha >= self._origin if upper else alpha <= self._origin
        return alpha >= self._interval[1] if upper else alpha <= self._interval[0]

    def arc(self, index: int, starts: int | None) -> None:
        """Count an arc; one that begins at an end of the interval, or where g vanishes, with its side."""
        self._count.arcs += 1
        if starts is not None and (starts != 1 or self._origin == self._interval[0]):
            self._border += index

    def left_open(self) -> None:
        """Count a part that was left open."""
        self._count.open += 1

    def event(self, event: _Event) -> None:
        """Keep an event for pairing."""
        self._events.append(event)

    @cached_property
    def precise_system(self) -> Any:
        """The problem in many digits."""
        from enumsol.condensation.data import EXACT_DOF_LIMIT
        from enumsol.kernel.precise import PreciseSystem  # python-flint, not for all proofs

        if self._problem.n > EXACT_DOF_LIMIT:
            raise ValueError("a box in many digits belongs to a problem that is too large for it")
        system = PreciseSystem.of(self._problem)
        if system is None:
            raise ValueError("A is singular within many digits")
        return system

    def fail(self, codes: Codes, alpha: Fraction) -> None:
        """An arc that begins or ends where it must not."""
        self._fail(f"an arc of selection {_text(codes)} begins or ends at {float(alpha)} for no reason")

    def _pair(self) -> None:
        """Pair events; each belongs to exactly one other, unless something beside it was left open."""
        by_codes: dict[tuple[Codes, int, tuple[int, int]], list[_Event]] = {}
        for event in self._events:
            by_codes.setdefault((event.codes, event.side, event.condition), []).append(event)
        for event in self._events:
            node, kind = event.condition
            for one, other in (*_PAIRS, *((b, a) for a, b in _PAIRS)):
                if one != (event.codes[node], kind):
                    continue
                codes = (*event.codes[:node], other[0], *event.codes[node + 1 :])
                for found in by_codes.get((codes, event.side, (node, other[1])), ()):
                    if _inside(event.zero, found.part) or _inside(found.zero, event.part):
                        event.partners.append(found)
        for event in self._events:
            if len(event.partners) == 1:
                partner = event.partners[0]
                # going on the index stays, turning back it changes its sign
                same = event.rising != partner.rising
                if event.index != (partner.index if same else -partner.index):
                    self._fail(f"indices do not balance at {float(event.zero[0])}")
            elif event.partners or not self._count.open:
                self._fail(f"an event of selection {_text(event.codes)} at {float(event.zero[0])} has no partner")
            else:
                self._count.open += 1


class _Selection:
    """A selection in both arithmetics."""

    def __init__(self, checker: ArcChecker, plain: ArcSelection, side: int) -> None:
        self._checker, self._plain, self._side = checker, plain, side

    @cached_property
    def _precise(self) -> Any:
        from enumsol.kernel.precise import PreciseSelection  # as above

        system = self._checker.precise_system
        system = system.constant_load(float(self._side)) if self._side else system
        return PreciseSelection(system, self._plain.rows.codes)

    @property
    def conditions(self) -> tuple[tuple[int, int], ...]:
        """Those of the selection, by their numbers."""
        return self._plain.rows.conditions

    def expansion(self, low: Any, high: Any, *, precise: bool) -> Any:
        """The expansion over a box, or None."""
        if precise:
            return self._precise.expansion(_number(low), _number(high))
        if not isinstance(low, float) or not isinstance(high, float):
            raise ValueError("the ends of a box in double arithmetic are floats")  # noqa: TRY004 (as in reading)
        return self._plain.expansion(low, high)

    def signs_differ(self, part: list[Any]) -> bool:
        """Whether the bounds of an event's zero lie on both sides of it."""
        condition, rising, bounds = part[3], bool(part[4]), part[5:7]
        slope = 1 if rising else -1
        signs = []
        for bound in bounds:
            if isinstance(bound, float):
                signs.append(self._plain.sign_at(bound, condition))
            else:
                found = self._precise.signs_at(_number(bound))
                signs.append(0 if found is None else int(found[condition]))
        return signs == [-slope, slope]


class _Follower:
    """The arcs of one trace, from left to right."""

    def __init__(
        self,
        checker: ArcChecker,
        conditions: tuple[tuple[int, int], ...],
        codes: Codes,
        side: int,
        ends: tuple[Fraction, Fraction],
    ) -> None:
        self.codes, self._conditions = codes, conditions
        self._checker, self._side, self._ends = checker, side, ends
        self._holds, self._index, self._first, self._open = False, 0, True, False

    def part(self, kind: str, part: list[Any], ends: tuple[Fraction, Fraction]) -> None:
        """Go on through a part."""
        if kind == "u":
            self._checker.left_open()
            self._holds = False
        elif kind == "n":
            if self._holds:
                self._checker.fail(self.codes, ends[0])
            self._holds = False
        else:
            self._present(kind, part, ends)
        self._open, self._first = kind == "u", False

    def _present(self, kind: str, part: list[Any], ends: tuple[Fraction, Fraction]) -> None:
        """A part in which the selection holds somewhere."""
        rising = kind == "e" and part[4] == 1
        if rising and self._holds:
            self._checker.fail(self.codes, ends[0])
        if not rising and not self._holds:
            starts = self._first and self._checker.end_at(self._ends[0], self._side, upper=False)
            if not starts and not self._open:
                self._checker.fail(self.codes, ends[0])
            self._checker.arc(part[2], self._side if starts else None)
        elif rising:
            self._checker.arc(part[2], None)
        elif part[2] != self._index:
            self._checker.fail(self.codes, ends[0])
        self._holds, self._index = not (kind == "e" and part[4] == 0), part[2]
        if kind == "e":
            zero = (_number(part[5]), _number(part[6]))
            condition = self._conditions[part[3]]
            self._checker.event(_Event(self.codes, self._side, condition, ends, zero, rising, part[2]))

    def finish(self) -> None:
        """The end of the trace."""
        if self._holds and not self._checker.end_at(self._ends[1], self._side, upper=True):
            self._checker.fail(self.codes, self._ends[1])


def _proven(expansion: Any, part: list[Any], low: Any, high: Any) -> bool:
    """Whether the expansion shows what a part says."""
    kind = part[0]
    ends = (low, high) if isinstance(low, float) and isinstance(high, float) else (_number(low), _number(high))
    known = expansion.over(*ends)
    if kind == "n":
        return bool(known.none)
    if expansion.index(*ends) != part[2]:
        return False
    if kind == "h":
        return bool(known.holds)
    condition = part[3]
    zero = _number(part[5]), _number(part[6])
    slope = 1 if part[4] else -1
    others = [k for k in known.doubtful.tolist() if k != condition]
    at = [int(expansion.over(end, end).conditions[condition]) for end in ends]
    return bool(
        known.regular
        and not others
        and not any(k < 0 for k in known.conditions.tolist())
        and int(expansion.slopes(*ends)[condition]) == slope
        and at == [-slope, slope]
        and _inside(zero, (_number(low), _number(high)))
    )


def _check_entries(part: list[Any], conditions: int) -> None:
    """Refuse a part whose entries are none of those that its kind has."""
    if part[0] in ("h", "e") and (type(part[2]) is not int or part[2] not in (-1, 1)):
        raise ValueError("an index is neither 1 nor -1")
    if part[0] == "e" and not (
        type(part[3]) is int and 0 <= part[3] < conditions and type(part[4]) is int and part[4] in (0, 1)
    ):
        raise ValueError("an event names no condition")


def _inside(zero: tuple[Fraction, Fraction], part: tuple[Fraction, Fraction]) -> bool:
    return part[0] <= zero[0] < zero[1] <= part[1]


def _number(value: Any) -> Fraction:
    """An alpha: a float, or a fraction as text."""
    if type(value) is float or isinstance(value, Fraction):
        return Fraction(value)
    return rational_from(value)


def _text(codes: Codes) -> str:
    return "".join(map(str, codes))
