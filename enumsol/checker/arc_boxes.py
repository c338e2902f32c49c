"""Traces of a graph's proof: the arcs that they claim, and tests of what their boxes claim, many at once."""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any

from enumsol.proof.reading import quoted, rational_from
from enumsol.trusted.arcs.over_parts import OverInterval, expansions, over_parts

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from enumsol.support.array_types import Codes
    from enumsol.trusted.arcs.selection_balls import ArcSelection

    #: A part as it is in the proof, and both its ends.
    Said = tuple[list[Any], Any, Any]

#: Entries of a part, by its kind.
_ENTRIES = {"h": 3, "n": 2, "e": 7, "u": 2}
#: Boxes and parts that are tested together.
_BOXES, _PARTS = 256, 2048


@dataclass(eq=False)
class ClaimedEvent:
    """A point at which one condition of a selection vanishes."""

    codes: tuple[int, ...]
    side: int
    condition: tuple[int, int]
    part: tuple[Fraction, Fraction]
    zero: tuple[Fraction, Fraction]
    rising: bool
    index: int
    partners: list[ClaimedEvent]

    @property
    def bound(self) -> bool:
        """True if it is the rigid displacement that reaches a bound there."""
        return self.condition[0] >= len(self.codes)


@dataclass(eq=False)
class ClaimedArc:
    """Interval over which a trace shows a root of its selection at every alpha.

    Attributes
    ----------
    codes : status codes
    side : int
        Of the alpha at which g vanishes.
    low, high : Fraction
        It holds from here to there at least.
    tail, head : ClaimedEvent or None
        Where it begins, and where it ends.
    """

    codes: tuple[int, ...]
    side: int
    low: Fraction
    high: Fraction
    tail: ClaimedEvent | None = None
    head: ClaimedEvent | None = None


@dataclass
class ClaimedTrace:
    """A selection in both arithmetics along the interval in which it survives, and its arcs from left to right.

    Attributes
    ----------
    owner : ArcChecker
        Takes the arcs and events, and has the problem in many digits.
    plain : ArcSelection
    side : int
        Of the alpha at which g vanishes.
    ends : (Fraction, Fraction)
    """

    owner: Any
    plain: ArcSelection
    side: int
    ends: tuple[Fraction, Fraction]
    _index: int = 0
    _first: bool = True
    _open: bool = False
    _arc: ClaimedArc | None = None

    @property
    def codes(self) -> Codes:
        """Codes of the selection."""
        return self.plain.rows.codes

    @cached_property
    def precise(self) -> Any:
        """The selection in many digits."""
        from enumsol.trusted.arcs.precise import PreciseSelection  # python-flint, not for all proofs

        return PreciseSelection(self.owner.precise_system.beside_zero(float(self.side)), self.codes)

    def signs_differ(self, part: list[Any]) -> bool:
        """True if the bounds of an event's zero lie on both sides of it."""
        condition, bounds = part[3], part[5:7]
        signs = []
        for bound in bounds:
            if isinstance(bound, float):
                signs.append(self.plain.sign_at(bound, condition))
            else:
                found = self.precise.functions.signs_at(alpha_number(bound))
                signs.append(0 if found is None else int(found[condition]))
        return signs == _expected(part)

    def part(self, kind: str, part: list[Any], ends: tuple[Fraction, Fraction]) -> None:
        """Go on through a part."""
        if kind == "u":
            if not self._open:  # parts that touch are one interval
                self.owner.open += 1
            self._arc = None
        elif kind == "n":
            if self._arc is not None:
                self.owner.loose_end(self.codes, ends[0])
            self._arc = None
        else:
            self._present(kind, part, ends)
        self._open, self._first = kind == "u", False

    def _present(self, kind: str, part: list[Any], ends: tuple[Fraction, Fraction]) -> None:
        """A part in which the selection holds somewhere."""
        event = None
        if kind == "e":
            zero = (alpha_number(part[5]), alpha_number(part[6]))
            condition = self.plain.rows.conditions[part[3]]
            event = ClaimedEvent(self.codes, self.side, condition, ends, zero, part[4] == 1, part[2], [])
            self.owner.events.append(event)
        rising = event is not None and event.rising
        if rising and self._arc is not None:
            self.owner.loose_end(self.codes, ends[0])
        if not rising and self._arc is None:
            starts = self._first and self.owner.end_at(self.ends[0], self.side, upper=False)
            if not starts and not self._open:
                self.owner.loose_end(self.codes, ends[0])
            self._arc = ClaimedArc(self.codes, self.side, ends[0], ends[0])
            self.owner.arc(self._arc, part[2], self.side if starts else None)
        elif event is not None and rising:
            self._arc = ClaimedArc(self.codes, self.side, event.zero[1], event.zero[1], event)
            self.owner.arc(self._arc, part[2], None)
        elif part[2] != self._index:
            self.owner.loose_end(self.codes, ends[0])
        self._index = part[2]
        assert self._arc is not None
        self._arc.high = ends[1]
        if event is not None and not rising:
            self._arc.high, self._arc.head = event.zero[0], event
            self._arc = None

    def finish(self) -> None:
        """The end of the trace."""
        if self._arc is not None and not self.owner.end_at(self.ends[1], self.side, upper=True):
            self.owner.loose_end(self.codes, self.ends[1])


@dataclass
class _Box:
    """A box that waits for its test."""

    trace: ClaimedTrace
    low: Any
    high: Any
    said: list[Said]


@dataclass
class Boxes:
    """Boxes to be tested.

    Attributes
    ----------
    fail : called with a sentence for every claim that is not proven
    """

    fail: Callable[[str], None]
    _waiting: list[_Box] = field(default_factory=list)
    _parts: int = 0

    def add(self, trace: ClaimedTrace, low: object, high: object, said: list[Said], *, precise: bool) -> None:
        """Test a box, at once or together with others; ValueError if it can not be tested at all."""
        if precise:
            expansion = trace.precise.expansion(alpha_number(low), alpha_number(high))
            known = [expansion and expansion.over(alpha_number(x), alpha_number(y)) for _, x, y in said]
            for one, what in zip(said, known, strict=True):
                self._test(trace, one, what, [])
            return
        if not isinstance(low, float) or not isinstance(high, float):
            raise ValueError("the ends of a box in double arithmetic are floats")  # noqa: TRY004 (as in reading)
        self._waiting.append(_Box(trace, low, high, [(part, _plain(x), _plain(y)) for part, x, y in said]))
        self._parts += len(said)
        if len(self._waiting) >= _BOXES or self._parts >= _PARTS:
            self.check()

    def check(self) -> None:
        """Test all that wait."""
        boxes, self._waiting, self._parts = self._waiting, [], 0
        found = expansions([(box.trace.plain, box.low, box.high) for box in boxes])
        asked = [
            [(expansion, *part) for part in _questions(one)]
            for box, expansion in zip(boxes, found, strict=True)
            for one in box.said
        ]
        known = iter(over_parts([(one, x, y) for questions in asked for one, x, y in questions if one is not None]))
        claims = ((box.trace, one) for box in boxes for one in box.said)
        for (trace, one), questions in zip(claims, asked, strict=True):
            answers = [next(known) for expansion, *_ in questions if expansion is not None]
            self._test(trace, one, answers[0] if answers else None, answers[1:])
        for box in boxes:
            box.trace.plain.forget()

    def _test(self, trace: ClaimedTrace, one: Said, known: OverInterval | None, bounds: Sequence[OverInterval]) -> None:
        """Fail where a part's claim does not follow from what is known of the part, and at bounds of its zero."""
        part, low, high = one
        if known is None or not _proven(known, part, alpha_number(low), alpha_number(high)):
            where = f"[{float(alpha_number(low))}, {float(alpha_number(high))}]"
            self.fail(f"selection {shown(trace.codes)}: the claim about {where} is not proven")
        if part[0] != "e":
            return
        seen = [int(found.ends[0][part[3]]) for found in bounds] == _expected(part)
        if not seen and not trace.signs_differ(part):
            near = float(alpha_number(low))
            self.fail(f"selection {shown(trace.codes)}: bounds of an event near {near} are not proven")


def _questions(one: Said) -> Iterator[tuple[Any, Any]]:
    """Over what an expansion is needed: a part and, where they lie in it, the bounds of its zero."""
    part, low, high = one
    yield low, high
    if part[0] == "e" and all(isinstance(bound, float) for bound in part[5:7]):
        zero = alpha_number(part[5]), alpha_number(part[6])
        if inside(zero, (alpha_number(low), alpha_number(high))):
            yield from ((bound, bound) for bound in part[5:7])


def _expected(part: list[Any]) -> list[int]:
    """Signs of an event's condition at the bounds of its zero, and at the ends of its part."""
    return [-1, 1] if part[4] else [1, -1]


def _proven(known: OverInterval, part: list[Any], low: Fraction, high: Fraction) -> bool:
    """True if what is known shows what a part says."""
    kind = part[0]
    if kind == "n":
        return bool(known.none)
    if known.index != part[2] or not known.regular:
        return False
    if kind == "h":
        return bool(known.holds)
    condition = part[3]
    others = [k for k in known.doubtful.tolist() if k != condition]
    return bool(
        not others
        and not any(k < 0 for k in known.conditions.tolist())
        and int(known.slopes[condition]) == (1 if part[4] else -1)
        and [int(end[condition]) for end in known.ends] == _expected(part)
        and inside((alpha_number(part[5]), alpha_number(part[6])), (low, high))
    )


def check_entries(part: Any, conditions: int) -> None:
    """Refuse what is no part, or has entries that its kind has not."""
    kind = part[0] if isinstance(part, list) and part else None
    if not isinstance(kind, str) or kind not in _ENTRIES or len(part) != _ENTRIES[kind]:
        raise ValueError(f"{quoted(part)} is not a part of a box")
    if kind in ("h", "e") and (type(part[2]) is not int or part[2] not in (-1, 1)):
        raise ValueError("an index is neither 1 nor -1")
    if kind == "e" and not (
        type(part[3]) is int and 0 <= part[3] < conditions and type(part[4]) is int and part[4] in (0, 1)
    ):
        raise ValueError("an event names no condition")


def shown(codes: Codes) -> str:
    """A selection as text."""
    return "".join(map(str, codes))


def inside(zero: tuple[Fraction, Fraction], part: tuple[Fraction, Fraction]) -> bool:
    """True if the bounds of a zero lie in a part, in their order."""
    return part[0] <= zero[0] < zero[1] <= part[1]


def alpha_number(value: object) -> Fraction:
    """An alpha: a float, or a fraction as text."""
    if type(value) is float or isinstance(value, Fraction):
        return Fraction(value)
    return rational_from(value)


def _plain(value: object) -> float | Fraction:
    """An alpha for an expansion in double arithmetic, as a float if it is one."""
    return value if isinstance(value, float) else alpha_number(value)
