"""A box cut into parts, on each of which a selection holds, or nowhere, or has one event (theory, section 7.14).

What is asked of an expansion is handed up, so that many selections are examined at once.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.arithmetic.rationals import simplest

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterator

    from enumsol.branches.enclosed.zeros import SeriesZeros, ShortZeros
    from enumsol.trusted.arcs.over_parts import OverInterval
    from enumsol.trusted.arcs.selection_balls import ArcSelection
    from enumsol.trusted.selection import Selection

    Shared = frozenset[Any]


Number = float | Fraction
Interval = tuple[Number, Number]


class ArcPartKind(enum.StrEnum):
    """Behaviour of a selection on a part of an interval; as in proofs (docs/proof_format.md)."""

    HOLDS = "h"
    NONE = "n"
    EVENT = "e"
    OPEN = "u"


class OpenCause(enum.Enum):
    """Why a part is left open (theory, section 7.14); what is said of a place is the first that it has."""

    #: The selection was cut into as many boxes as are tried.
    BOXES = enum.auto()
    #: An event cannot be told from an end of the interval.
    END = enum.auto()
    #: The determinant may vanish.
    SINGULAR = enum.auto()
    #: Several conditions may vanish.
    TOGETHER = enum.auto()
    #: A condition may vanish together with its slope.
    FLAT = enum.auto()
    #: The neighbour of an event was not identified.
    PARTNER = enum.auto()


@dataclass(frozen=True, eq=False)
class ArcPart:
    """A part [low, high] of a box; another part with the same content is not the same.

    Attributes
    ----------
    kind : ArcPartKind
    low, high : float or Fraction
    condition : int
        At an event the condition that changes its sign, as numbered by the selection; -1 elsewhere.
    zero : (float, float)
        At an event the bounds of the alpha where it vanishes.
    rising : bool
        At an event whether the selection holds above it, and not below.
    index : int
        Sign of the determinant where the selection holds, or at an event; 0 elsewhere.
    doubtful : frozenset of int
        At an open part the nodes whose conditions may vanish there.
    cause : OpenCause or None
        At an open part why it is left open.
    """

    kind: ArcPartKind
    low: Number
    high: Number
    condition: int = -1
    zero: Interval = (np.nan, np.nan)
    rising: bool = False
    index: int = 0
    doubtful: frozenset[int] = frozenset()
    cause: OpenCause | None = None


@dataclass(frozen=True)
class AlphaBox:
    """An interval on which one expansion decides.

    Attributes
    ----------
    low, high : float or Fraction
        Those of the expansion; the parts may end before.
    parts : tuple of ArcPart
        From left to right.
    precise : bool
        Decided in many digits.
    """

    low: Number
    high: Number
    parts: tuple[ArcPart, ...]
    precise: bool = False


#: A box and the intervals to be cut next.
Result = tuple[AlphaBox, list[Interval]]


@dataclass
class Trace:
    """Behaviour of a selection on an interval.

    Attributes
    ----------
    selection : ArcSelection
    low, high : float
    side : float
        1 or -1 above or below an alpha at which g vanishes (see trusted.over_interval), else 0.
    boxes : list of AlphaBox
        Its parts, box by box from left to right. A box may reach beyond its parts.
    """

    selection: ArcSelection
    low: float
    high: float
    side: float = 0.0
    boxes: list[AlphaBox] = field(default_factory=list)

    @property
    def parts(self) -> Iterator[ArcPart]:
        """All parts, from left to right."""
        return (part for box in self.boxes for part in box.parts)


def parts_between(
    trace: Trace, low: Fraction, high: Fraction, sharpen: Callable[[Trace, ArcPart], tuple[Fraction, Fraction] | None]
) -> Iterator[ArcPart]:
    """The parts of a trace between two alphas, beyond which it was rounded outward; no event lies beyond them.

    ``sharpen`` gives narrower bounds of an event's zero, or None.
    """
    for part in trace.parts:
        if low <= trace.low and trace.high <= high:
            yield part
        elif part.high < low or part.low > high:
            continue
        elif part.kind is ArcPartKind.EVENT:
            found = list(_event_inside(trace, part, (low, high), part.zero))
            if any(item.kind is ArcPartKind.OPEN for item in found) and (zero := sharpen(trace, part)) is not None:
                found = list(_event_inside(trace, part, (low, high), zero))
            yield from found
        else:
            yield part


def _event_inside(trace: Trace, part: ArcPart, ends: tuple[Fraction, Fraction], zero: Interval) -> Iterator[ArcPart]:
    """An event; or, where its zero lies outside or cannot be told from an end, what the selection does inside."""
    (low, high), (first, last) = ends, zero
    below, above = (ArcPartKind.NONE, ArcPartKind.HOLDS) if part.rising else (ArcPartKind.HOLDS, ArcPartKind.NONE)
    if not (trace.low < low and first <= low) and not (trace.high > high and last >= high):
        yield part
    elif last < low:
        yield replace(part, kind=above)
    elif first > high:
        yield replace(part, kind=below)
    else:
        doubtful = frozenset((trace.selection.rows.conditions[part.condition][0],))
        if first > low:
            yield replace(part, kind=below, high=first)
            yield ArcPart(ArcPartKind.OPEN, first, part.high, doubtful=doubtful, cause=OpenCause.END)
        else:
            yield ArcPart(ArcPartKind.OPEN, part.low, last, doubtful=doubtful, cause=OpenCause.END)
            if last < min(part.high, high):
                yield replace(part, kind=above, low=last)


#: Bounds of a zero that are wider, relative to alpha, are looked for anew at single alphas; the second where they are
#: sharpened later.
_NARROW, _NARROW_ENOUGH = 2.0**-44, 2.0**-16
#: Halvings of a part that is not decided.
_HALVINGS = 5


class Cutting:
    """A box cut into parts, from left to right until a part needs a box of its own.

    Parameters
    ----------
    rows : Selection
    zeros : SeriesZeros or ShortZeros
        Of the box's expansion.
    whole : bool
        The box is not to be cut further: what is not decided stays open.
    flat : bool
        Nor is it where a condition is flat.
    level : bool
        Nor is it where all conditions in doubt are flat.
    sharpened : bool
        Bounds of events will be made narrower.
    """

    def __init__(
        self, rows: Selection, zeros: SeriesZeros | ShortZeros, *, whole: bool, flat: bool, level: bool, sharpened: bool
    ) -> None:
        self._narrow = _NARROW_ENOUGH if sharpened else _NARROW
        self._rows, self._whole, self._keep_flat, self._keep_level = rows, whole, flat, level
        self._places = zeros
        self.low: Number = zeros.expansion.low
        self.high: Number = zeros.expansion.high
        self._known: dict[ArcPart, OverInterval] = {}  # of parts in which nothing holds

    def run(self) -> Generator[list[Interval], list[OverInterval], Result]:
        """Asks for what is known of parts; the box with its parts, and the intervals behind that need their own."""
        (known,) = yield [(self.low, self.high)]
        whole = self._decided(self.low, self.high, known)
        if whole is None and self._places.rough and not self._whole:
            return AlphaBox(self.low, self.high, ()), self._rest(self.low, self.high)
        parts, rest = (
            (yield from self._cut(known)) if whole is None or whole.kind is ArcPartKind.EVENT else ([whole], [])
        )
        parts = yield from self._tidied(parts)
        return AlphaBox(self.low, self.high, tuple(parts), self._places.final), rest

    def _cut(
        self, whole: OverInterval
    ) -> Generator[list[Interval], list[OverInterval], tuple[list[ArcPart], list[Interval]]]:
        """Parts, and the intervals behind them."""
        cut = self._places.split()
        if cut is not None:
            halves = [(self.low, cut), (cut, self.high)]
            known = yield halves
            decided = [self._decided(*half, found) for half, found in zip(halves, known, strict=True)]
            if all(found.none for found in known):
                return [part for part in decided if part is not None], []
        doubtful = _in_doubt(whole)
        self._flat = [k for k in doubtful if self._places.flat(k)]
        # where the others seem to vanish
        some = [k for k in doubtful if k not in self._flat]
        self._zeros = sorted((zero, k) for k in some for zero in self._places.zeros(k))
        parts: list[ArcPart] = []
        ends = list(pairwise(self._ends()))
        known = [whole] if len(ends) == 1 else (yield ends)
        cells = [(*cell, found, _HALVINGS) for cell, found in zip(ends, known, strict=True)]
        cells.reverse()
        while cells:
            low, high, found, halvings = cells.pop()
            part = self._decided(low, high, found)
            if part is not None:
                parts.append(part)
            elif halvings and not self._tight(low, high, found) and low < (middle := between(low, high)) < high:
                halves = [(low, middle), (middle, high)]
                known = yield halves
                pairs = [(*half, answer, halvings - 1) for half, answer in zip(halves, known, strict=True)]
                cells += reversed(pairs)
            elif self._whole or self._stays_open(low, high, found):
                parts.append(self._open(low, high, found))
            else:
                return parts, self._rest(low, high)
        return parts, []

    def _tidied(self, parts: list[ArcPart]) -> Generator[list[Interval], list[OverInterval], list[ArcPart]]:
        """Neighbouring parts that say the same joined, and events with bounds."""
        runs: list[list[ArcPart]] = []
        shared: Shared = frozenset()
        for part in parts:
            reasons = self._reasons(part)
            if runs and runs[-1][0].kind is part.kind and reasons & shared:
                runs[-1].append(part)
                shared &= reasons
            else:
                runs.append([part])
                shared = reasons
        asked = [self._questions(run[0], run[-1]) for run in runs]
        everything = [part for questions in asked for part in questions]
        answers = iter((yield everything) if everything else [])
        tidied: list[ArcPart] = []
        for run, questions in zip(runs, asked, strict=True):
            tidied += self._settled(run, questions, [next(answers) for _ in questions])
        return tidied

    def _reasons(self, part: ArcPart) -> Shared:
        """Facts of which neighbours of the same kind must share one to be joined."""
        if part.kind is ArcPartKind.EVENT:
            return frozenset()
        known = self._known.get(part)
        if part.kind is not ArcPartKind.NONE or known is None:
            return frozenset([part.index])
        # conditions that are negative, or of opposite signs
        signs = known.conditions
        below = np.flatnonzero(signs < 0).tolist()
        return frozenset(
            below if known.regular else [(j, k) for j in below for k in np.flatnonzero(signs > 0).tolist()]
        )

    def _questions(self, first: ArcPart, last: ArcPart) -> list[Interval]:
        """Parts that have to be examined to join neighbours, or at the presumed bounds of an event."""
        if first.kind is ArcPartKind.EVENT:
            low, high = self._places.near(first.condition, first.low, first.high)
            narrow = first.low <= low < high <= first.high and high - low <= self._narrow * max(
                abs(float(low)), abs(float(high))
            )
            return [(low, low), (high, high)] if narrow else []
        return [(first.low, last.high)] if first is not last and first.kind is not ArcPartKind.OPEN else []

    def _settled(self, run: list[ArcPart], questions: list[Interval], known: list[OverInterval]) -> list[ArcPart]:
        """Neighbours joined, or an event with its bounds, where that is known."""
        first, last = run[0], run[-1]
        if first.kind is ArcPartKind.EVENT:
            k, slope = first.condition, 1 if first.rising else -1
            if [int(found.ends[0][k]) for found in known] == [-slope, slope]:
                zero = questions[0][0], questions[1][0]
            else:
                zero = self._places.zero_bounds(k, slope, first.low, first.high)
            return [replace(first, zero=zero)]
        if first is last or (known and not (known[0].none or (known[0].holds and known[0].index == first.index))):
            return run
        doubtful = frozenset(node for part in run for node in part.doubtful)
        return [replace(first, high=last.high, doubtful=doubtful)]

    def _rest(self, low: Number, high: Number) -> list[Interval]:
        """Intervals left when a part cannot be decided: the part and what lies behind it, or two halves."""
        middle = between(low, self.high)
        # had the part come off the box's beginning, the rest would be as long as the box, again and again
        if self._places.rough or low == self.low:
            return [(low, middle), (middle, self.high)]
        return [(low, high), *([(high, self.high)] if high < self.high else [])]

    def _ends(self) -> list[Any]:
        """Ends of the parts into which the box is cut first: around groups of zeros."""
        reach = self._places.apart
        groups: list[list[Any]] = []
        for zero, _ in self._zeros:
            if groups and zero - groups[-1][1] <= reach:
                groups[-1][1] = zero
            else:
                groups.append([zero, zero])
        borders = [self.low, *(x for group in groups for x in group), self.high]
        ends = [self.low]
        for k, (first, last) in enumerate(groups):
            before, after = (first - borders[2 * k]) / 4, (borders[2 * k + 3] - last) / 4
            if first < last:
                before, after = min(before, 4 * reach), min(after, 4 * reach)
            for low, high in ((first - before, first - before / 2), (last + after / 2, last + after)):
                ends.append(simplest(low, high) if isinstance(low, Fraction) and low < high else low)
        ends.append(self.high)
        return [x for k, x in enumerate(ends) if not k or x > ends[k - 1]]

    def _tight(self, low: Number, high: Number, known: OverInterval) -> bool:
        """True if halving does not help: several zeros close together, or a condition that is flat."""
        if self._is_flat(known):
            return True
        inside = [(zero, k) for zero, k in self._zeros if low < zero < high]
        return len(inside) > 1 and inside[-1][0] - inside[0][0] <= self._places.apart

    def _stays_open(self, low: Number, high: Number, known: OverInterval) -> bool:
        """True if a box of its own would not decide a part."""
        if self._keep_level and all(k in self._flat for k in _in_doubt(known)):
            return True
        return (self._places.final and self._tight(low, high, known)) or (self._keep_flat and self._is_flat(known))

    def _is_flat(self, known: OverInterval) -> bool:
        """True if a condition cannot be distinguished from zero."""
        return any(k in self._flat for k in _in_doubt(known))

    def _decided(self, low: Number, high: Number, known: OverInterval) -> ArcPart | None:
        if known.none:
            nowhere = ArcPart(ArcPartKind.NONE, low, high)
            self._known[nowhere] = known
            return nowhere
        doubtful = known.doubtful
        if not known.regular or len(doubtful) > 1 or not known.index:
            return None
        if not len(doubtful):
            return ArcPart(ArcPartKind.HOLDS, low, high, index=known.index)
        condition = int(doubtful[0])
        slope = int(known.slopes[condition])
        if not slope or [int(end[condition]) for end in known.ends] != [-slope, slope]:
            return None
        return ArcPart(ArcPartKind.EVENT, low, high, condition, (low, high), slope > 0, known.index)

    def _open(self, low: Number, high: Number, known: OverInterval) -> ArcPart:
        nodes, cause = frozenset(range(len(self._rows.codes))), OpenCause.SINGULAR
        if known.regular:
            nodes = frozenset(self._rows.conditions[k][0] for k in known.doubtful)
            cause = OpenCause.TOGETHER if len(known.doubtful) > 1 else OpenCause.FLAT
        return ArcPart(ArcPartKind.OPEN, low, high, doubtful=nodes, cause=cause)


def _in_doubt(known: OverInterval) -> list[int]:
    """Conditions that may vanish; their number stands for the determinant."""
    return [*known.doubtful.tolist(), *([] if known.regular else [len(known.conditions)])]


def between(low: Number, high: Number) -> Number:
    """The middle; as a fraction where no float lies between, then only roughly."""
    middle = (low + high) / 2
    if isinstance(middle, float) and low < middle < high:
        return middle
    first, last = Fraction(low), Fraction(high)
    return simplest((5 * first + 3 * last) / 8, (3 * first + 5 * last) / 8)
