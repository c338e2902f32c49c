"""Where a selection holds over an interval of alpha, found by the polynomials of the kernel (theory, section 7.14).

The interval is cut into boxes, on each of which the conditions are known with bounds of their errors, and the boxes
into parts: the selection holds throughout, or nowhere, or exactly one condition changes its sign. What is left stays
open.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from enumsol.kernel.arcs import ArcSelection, OverInterval
    from enumsol.kernel.precise import PreciseSelection
    from enumsol.kernel.selection_rows import SelectionRows

    Number = float | Fraction
    Interval = tuple[Number, Number]


class AlphaExpansion(Protocol):
    """Conditions of a selection over an interval, as arcs.Expansion and precise.PreciseExpansion know them."""

    low: Any
    high: Any
    apart: Any
    final: bool

    @property
    def rough(self) -> bool:
        """Whether shorter intervals give smaller errors."""

    def over(self, low: Any, high: Any) -> OverInterval:
        """What is known over a part."""

    def slopes(self, low: Any, high: Any) -> Any:
        """Signs of the conditions' slopes over a part."""

    def index(self, low: Any, high: Any) -> int:
        """Sign of the determinant over a part."""

    def zeros(self, condition: int) -> list[Any]:
        """Where a condition seems to vanish."""

    def flat(self, condition: int) -> bool:
        """Whether a condition cannot be told from zero."""

    def zero_bounds(self, condition: int, slope: int, low: Any, high: Any) -> Any:
        """Bounds of the only zero in a part."""


#: Bounds of errors are multiplied by this, so that a checker that rounds otherwise agrees.
ERRORS = 2.0
#: Boxes are not cut below so many units in the last place of alpha, or in many digits below this share of the interval.
_SMALLEST_UNITS, _SMALLEST_PRECISE = 64.0, 2.0**-60
#: Boxes shorter than this share of the interval are traced in many digits.
_PRECISE_BOX, _PRECISE_ANYWHERE = 2.0**-10, 2.0**-40
#: Boxes on which a selection seems to be singular are not cut below this share.
_SINGULAR = 2.0**-26
#: Expansions of one selection, after which what is left stays open.
_MOST_BOXES = 200
#: Boxes shorter than this share of the interval are not cut because of a condition that cannot be told from zero.
_FLAT_BOX = 2.0**-12
#: Halvings of a part that is not decided.
_HALVINGS = 5


class PartKind(enum.StrEnum):
    """What a selection does on a part of an interval; as in proofs (docs/proof_format.md)."""

    HOLDS = "h"
    NONE = "n"
    EVENT = "e"
    OPEN = "u"


@dataclass(frozen=True, eq=False)
class Part:
    """A part [low, high] of a box; another part with the same content is not the same.

    Attributes
    ----------
    kind : PartKind
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
    """

    kind: PartKind
    low: Number
    high: Number
    condition: int = -1
    zero: Interval = (np.nan, np.nan)
    rising: bool = False
    index: int = 0
    doubtful: frozenset[int] = frozenset()


@dataclass(frozen=True)
class Box:
    """An interval on which one expansion decides.

    Attributes
    ----------
    low, high : float or Fraction
        Those of the expansion; the parts may end before.
    parts : tuple of Part
        From left to right.
    precise : bool
        Decided in many digits.
    """

    low: Number
    high: Number
    parts: tuple[Part, ...]
    precise: bool = False


@dataclass
class Trace:
    """What a selection does on an interval.

    Attributes
    ----------
    selection : ArcSelection
    low, high : float
    side : float
        1 or -1 above or below an alpha at which g vanishes (see kernel.interval), else 0.
    boxes : list of Box
        Its parts, box by box from left to right. A box may reach beyond its parts.
    """

    selection: ArcSelection
    low: float
    high: float
    side: float = 0.0
    boxes: list[Box] = field(default_factory=list)

    @property
    def parts(self) -> Iterator[Part]:
        """All parts, from left to right."""
        return (part for box in self.boxes for part in box.parts)


def trace(
    selection: ArcSelection,
    low: float,
    high: float,
    precise: Callable[[], PreciseSelection | None],
    side: float = 0.0,
) -> Trace:
    """Cut [low, high] into boxes and parts.

    Parameters
    ----------
    selection : ArcSelection
    low, high : float
    precise : gives the same selection in balls of many digits, for short boxes; None where there is none
    side : that of the selection's system
    """
    return _Tracing(Trace(selection, low, high, side), precise).run()


class _Tracing:
    """One selection being traced."""

    def __init__(self, found: Trace, precise: Callable[[], PreciseSelection | None]) -> None:
        self._found, self._selection, self._precise = found, found.selection, precise
        self._length = found.high - found.low
        self._spacing = _SMALLEST_UNITS * float(np.spacing(max(abs(found.low), abs(found.high))))
        self._count = 0

    def run(self) -> Trace:
        """Box by box, from left to right."""
        waiting: list[Interval] = [(self._found.low, self._found.high)]
        while waiting:
            first, last = waiting.pop()
            self._count += 1
            waiting += reversed(self._box(first, last))
        return self._found

    def _box(self, first: Number, last: Number) -> list[Interval]:
        """Add a box, or as much of it as is decided; what is left."""
        first, last = _as_float(first), _as_float(last)
        rows, share = self._selection.rows, float(last - first) / self._length
        # short beside alpha too, or so short that this does not matter
        beside = float(last - first) / max(abs(float(first)), abs(float(last)))
        short, tiny = (
            share < limit and (share < _PRECISE_ANYWHERE or beside < limit) for limit in (_PRECISE_BOX, _SINGULAR)
        )
        precise = self._precise() if short and self._count <= _MOST_BOXES else None
        smallest = share < _SMALLEST_PRECISE if precise is not None else float(last - first) <= self._spacing
        whole = self._count > _MOST_BOXES or smallest
        tried: list[tuple[Box, list[Interval]]] = []
        if self._count <= _MOST_BOXES and isinstance(first, float) and isinstance(last, float):
            expansion = self._selection.expansion(first, last, ERRORS)
            if expansion is not None:
                flat = short and share < _FLAT_BOX and precise is None
                tried.append(_Cutting(rows, expansion, whole=whole, flat=flat).run())
        if precise is not None and not (tried and _decides(*tried[0])):
            found = precise.expansion(first, last)
            if found is not None:
                tried.insert(0, _Cutting(rows, found, whole=whole, flat=share < _PRECISE_BOX).run())
        whole = whole or (tiny and not tried)
        if tried:
            box, rest = tried[0]
            if box.parts:
                self._found.boxes.append(box)
            return rest
        if whole:
            everywhere = frozenset(range(len(rows.codes)))
            part = Part(PartKind.OPEN, first, last, doubtful=everywhere)
            fine = not isinstance(first, float) or not isinstance(last, float)
            self._found.boxes.append(Box(first, last, (part,), fine))
            return []
        middle = _between(first, last)
        return [(first, middle), (middle, last)]


def _decides(box: Box, rest: list[Interval]) -> bool:
    """Whether nothing stays open."""
    return not rest and all(part.kind is not PartKind.OPEN for part in box.parts)


class _Cutting:
    """One box cut into parts, from left to right until a part needs a box of its own.

    Parameters
    ----------
    rows : SelectionRows
    expansion : AlphaExpansion
        That of the box.
    whole : bool
        The box is not to be cut further: what is not decided stays open.
    flat : bool
        Nor is it where a condition is flat.
    """

    def __init__(self, rows: SelectionRows, expansion: AlphaExpansion, *, whole: bool, flat: bool) -> None:
        self._rows, self._expansion, self._whole, self._keep_flat = rows, expansion, whole, flat
        self.low: Number
        self.high: Number
        self.low, self.high = expansion.low, expansion.high

    @cached_property
    def _doubtful(self) -> list[int]:
        """Conditions that may vanish; their number stands for the determinant."""
        known = self._expansion.over(self.low, self.high)
        return [*known.doubtful.tolist(), *([] if known.regular else [len(self._rows.conditions)])]

    @cached_property
    def _flat(self) -> list[int]:
        """Those of which the expansion cannot tell."""
        return [k for k in self._doubtful if self._expansion.flat(k)]

    @cached_property
    def _zeros(self) -> list[tuple[Any, int]]:
        """Where the others seem to vanish."""
        some = [k for k in self._doubtful if k not in self._flat]
        return sorted((zero, k) for k in some for zero in self._expansion.zeros(k))

    def run(self) -> tuple[Box, list[Interval]]:
        """The box with its parts, and the intervals behind them that need boxes of their own."""
        if self._expansion.rough and not self._whole and self._decided(self.low, self.high) is None:
            return Box(self.low, self.high, ()), self._rest(self.low, self.high)
        parts: list[Part] = []
        cells = [(low, high, _HALVINGS) for low, high in pairwise(self._ends())]
        cells.reverse()
        while cells:
            low, high, halvings = cells.pop()
            part = self._decided(low, high)
            middle = _between(low, high)
            if part is not None:
                self._append(parts, part)
            elif halvings and low < middle < high and not self._tight(low, high):
                cells += [(middle, high, halvings - 1), (low, middle, halvings - 1)]
            elif self._whole or self._stays_open(low, high):
                self._append(parts, self._open(low, high))
            else:
                return Box(self.low, self.high, tuple(parts), self._expansion.final), self._rest(low, high)
        return Box(self.low, self.high, tuple(parts), self._expansion.final), []

    def _append(self, parts: list[Part], part: Part) -> None:
        """Add a part, joined with the last one where the expansion shows at once what both say."""
        last = parts[-1] if parts else None
        if last is not None and last.kind is part.kind and last.index == part.index:
            known = self._expansion.over(last.low, part.high)
            both = {
                PartKind.NONE: known.none,
                PartKind.HOLDS: known.holds and self._expansion.index(last.low, part.high) == part.index,
                PartKind.OPEN: True,
            }
            if both.get(part.kind):
                doubtful = last.doubtful | part.doubtful
                parts[-1] = Part(part.kind, last.low, part.high, index=part.index, doubtful=doubtful)
                return
        parts.append(part)

    def _rest(self, low: Number, high: Number) -> list[Interval]:
        """What is left when a part cannot be decided: the part and what lies behind it, or two halves."""
        middle = _between(low, self.high)
        # had the part come off the box's beginning, the rest would be as long as the box, again and again
        if self._expansion.rough or low == self.low:
            return [(low, middle), (middle, self.high)]
        return [(low, high), *([(high, self.high)] if high < self.high else [])]

    def _ends(self) -> list[Any]:
        """Where the box is cut first: around groups of zeros."""
        reach = self._expansion.apart
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
            ends += [_simple(first - before, first - before / 2), _simple(last + after / 2, last + after)]
        ends.append(self.high)
        return [x for k, x in enumerate(ends) if not k or x > ends[k - 1]]

    def _tight(self, low: Number, high: Number) -> bool:
        """Whether halving does not help: several zeros close together, or a condition that is flat."""
        if self._is_flat(low, high):
            return True
        inside = [(zero, k) for zero, k in self._zeros if low < zero < high]
        return len(inside) > 1 and inside[-1][0] - inside[0][0] <= self._expansion.apart

    def _stays_open(self, low: Number, high: Number) -> bool:
        """Whether a box of its own would not decide a part."""
        return (self._expansion.final and self._tight(low, high)) or (self._keep_flat and self._is_flat(low, high))

    def _is_flat(self, low: Number, high: Number) -> bool:
        """Whether a condition cannot be told from zero."""
        known = self._expansion.over(low, high)
        doubtful = [*known.doubtful.tolist(), *([] if known.regular else [len(known.conditions)])]
        return any(k in self._flat for k in doubtful)

    def _decided(self, low: Number, high: Number) -> Part | None:
        expansion = self._expansion
        known = expansion.over(low, high)
        if known.none:
            return Part(PartKind.NONE, low, high)
        doubtful = known.doubtful
        if not known.regular or len(doubtful) > 1:
            return None
        index = expansion.index(low, high)
        if not index:
            return None
        if not len(doubtful):
            return Part(PartKind.HOLDS, low, high, index=index)
        condition = int(doubtful[0])
        slope = int(expansion.slopes(low, high)[condition])
        signs = [self._sign(alpha, condition) for alpha in (low, high)]
        if not slope or signs != [-slope, slope]:
            return None
        zero = expansion.zero_bounds(condition, slope, low, high)
        return Part(PartKind.EVENT, low, high, condition, zero, slope > 0, index)

    def _sign(self, alpha: Number, condition: int) -> int:
        return int(self._expansion.over(alpha, alpha).conditions[condition])

    def _open(self, low: Number, high: Number) -> Part:
        known = self._expansion.over(low, high)
        nodes = frozenset(range(len(self._rows.codes)))
        if known.regular:
            nodes = frozenset(self._rows.conditions[k][0] for k in known.doubtful)
        return Part(PartKind.OPEN, low, high, doubtful=nodes)


def _between(low: Number, high: Number) -> Number:
    """The middle; as a fraction where no float lies between, then only roughly."""
    middle = (low + high) / 2
    if isinstance(middle, float) and low < middle < high:
        return middle
    first, last = Fraction(low), Fraction(high)
    roughly: Fraction = _simple((5 * first + 3 * last) / 8, (3 * first + 5 * last) / 8)
    return roughly


def _simple(low: Any, high: Any) -> Any:
    """A fraction of few bits in [low, high]; of floats the first."""
    if isinstance(low, float) or not low < high:
        return low
    # of the form k / 2^e or k 2^e, with 2^e nearly as large as the interval is long
    length = high - low
    unit = Fraction(2) ** (length.numerator.bit_length() - length.denominator.bit_length() - 1)
    return -((-low) // unit) * unit


def _as_float(alpha: Number) -> Number:
    """A float where the number is one."""
    value = float(alpha)
    return value if value == alpha else alpha
