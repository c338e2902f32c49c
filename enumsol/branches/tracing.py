"""Where a selection holds over an interval of alpha, found by the polynomials of the kernel (theory, section 7.14).

The interval is cut into boxes, on each of which the conditions are polynomials with bounds of their errors, and the boxes
into parts: the selection holds throughout, or nowhere, or exactly one condition changes its sign. What is left stays open.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from enumsol.kernel.arcs import ArcSelection, Expansion

#: Bounds of errors are multiplied by this, so that a checker that rounds otherwise agrees.
ERRORS = 2.0
#: Boxes are not cut below this share of the interval, nor below so many units in the last place of alpha.
_SMALLEST_BOX, _SMALLEST_UNITS = 2.0**-40, 64.0
#: Expansions of one selection, after which what is left stays open.
_MOST_BOXES = 200
#: Zeros closer than this, relative to their box, are not separated in it.
_APART = 1e-5
#: Boxes shorter than this share of the interval are not cut because of a condition too small for the bound of its error.
_FLAT_BOX = 2.0**-5
#: Halvings of a part that is not decided, and enlargements of a zero's enclosure.
_HALVINGS, _WIDENINGS = 5, 60


class PartKind(enum.StrEnum):
    """What a selection does on a part of an interval; as in proofs (docs/proof_format.md)."""

    HOLDS = "h"
    NONE = "n"
    EVENT = "e"
    OPEN = "u"


@dataclass(frozen=True)
class Part:
    """A part [low, high] of a box.

    Attributes
    ----------
    kind : PartKind
    low, high : float
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
    low: float
    high: float
    condition: int = -1
    zero: tuple[float, float] = (np.nan, np.nan)
    rising: bool = False
    index: int = 0
    doubtful: frozenset[int] = frozenset()


@dataclass(frozen=True)
class Box:
    """An interval on which one expansion decides: its parts, from left to right."""

    low: float
    high: float
    parts: tuple[Part, ...]


@dataclass
class Trace:
    """What a selection does on an interval.

    Attributes
    ----------
    selection : ArcSelection
    low, high : float
    boxes : list of Box
        Its parts, box by box from left to right. A box may reach beyond its parts.
    """

    selection: ArcSelection
    low: float
    high: float
    boxes: list[Box] = field(default_factory=list)

    @property
    def parts(self) -> Iterator[Part]:
        """All parts, from left to right."""
        return (part for box in self.boxes for part in box.parts)


def trace(selection: ArcSelection, low: float, high: float) -> Trace:
    """Cut [low, high] into boxes and parts."""
    found = Trace(selection, low, high)
    smallest = max(_SMALLEST_BOX * (high - low), _SMALLEST_UNITS * float(np.spacing(max(abs(low), abs(high)))))
    waiting = [(low, high)]
    count = 0
    while waiting:
        first, last = waiting.pop()
        count += 1
        middle = 0.5 * (first + last)
        whole = count > _MOST_BOXES or last - first <= smallest or not first < middle < last
        expansion = None if count > _MOST_BOXES else selection.expansion(first, last, ERRORS)
        if expansion is not None:
            share = (last - first) / (high - low)
            box, rest = _Cutting(selection, expansion, whole=whole, flat=share < _FLAT_BOX).run()
            if box.parts:
                found.boxes.append(box)
            waiting += reversed(rest)
        elif whole:
            everywhere = frozenset(range(selection.system.p))
            found.boxes.append(Box(first, last, (Part(PartKind.OPEN, first, last, doubtful=everywhere),)))
        else:
            waiting += [(middle, last), (first, middle)]
    return found


class _Cutting:
    """One box cut into parts, from left to right until a part needs a box of its own.

    Parameters
    ----------
    selection : ArcSelection
    expansion : Expansion
        That of the box.
    whole : bool
        The box is not to be cut further: what is not decided stays open.
    flat : bool
        Nor is it where a condition is flat.
    """

    def __init__(self, selection: ArcSelection, expansion: Expansion, *, whole: bool, flat: bool) -> None:
        self._selection, self._expansion, self._whole, self._keep_flat = selection, expansion, whole, flat
        self.low, self.high = expansion.low, expansion.high
        known = expansion.over(self.low, self.high)
        count = len(selection.conditions)
        # of conditions that may vanish: those of which this expansion cannot tell, and the zeros of the others
        doubtful = [*known.doubtful.tolist(), *([] if known.regular else [count])]
        self._flat = [k for k in doubtful if expansion.flat(k)]
        self._zeros = sorted((zero, k) for k in doubtful if k not in self._flat for zero in expansion.zeros(k))

    def run(self) -> tuple[Box, list[tuple[float, float]]]:
        """The box with its parts, and the intervals behind them that need boxes of their own."""
        if self._expansion.rough and not self._whole and self._decided(self.low, self.high) is None:
            return Box(self.low, self.high, ()), self._rest(self.low, self.high)
        parts: list[Part] = []
        cells = [(low, high, _HALVINGS) for low, high in pairwise(self._ends())]
        cells.reverse()
        while cells:
            low, high, halvings = cells.pop()
            part = self._decided(low, high)
            middle = 0.5 * (low + high)
            if part is not None:
                _append(parts, part)
            elif halvings and low < middle < high and not self._tight(low, high):
                cells += [(middle, high, halvings - 1), (low, middle, halvings - 1)]
            elif self._whole or (self._keep_flat and self._is_flat(low, high)):
                _append(parts, self._open(low, high))
            else:
                return Box(self.low, self.high, tuple(parts)), self._rest(low, high)
        return Box(self.low, self.high, tuple(parts)), []

    def _rest(self, low: float, high: float) -> list[tuple[float, float]]:
        """What is left when a part cannot be decided: the part and what lies behind it, or two halves."""
        middle = 0.5 * (low + self.high)
        if self._expansion.rough or (low, high) == (self.low, self.high):
            return [(low, middle), (middle, self.high)]
        return [(low, high), *([(high, self.high)] if high < self.high else [])]

    def _ends(self) -> list[float]:
        """Where the box is cut first: around groups of zeros."""
        reach = _APART * (self.high - self.low)
        groups: list[list[float]] = []
        for zero, _ in self._zeros:
            if groups and zero - groups[-1][1] <= reach:
                groups[-1][1] = zero
            else:
                groups.append([zero, zero])
        borders = [self.low, *(x for group in groups for x in group), self.high]
        ends = [self.low]
        for k, (first, last) in enumerate(groups):
            before, after = first - borders[2 * k], borders[2 * k + 3] - last
            ends += [first - before / 3.0, last + after / 3.0]
        ends.append(self.high)
        return [x for k, x in enumerate(ends) if not k or x > ends[k - 1]]

    def _tight(self, low: float, high: float) -> bool:
        """Whether halving does not help: several zeros close together, or a condition that is flat."""
        if self._is_flat(low, high):
            return True
        inside = [(zero, k) for zero, k in self._zeros if low < zero < high]
        return len(inside) > 1 and inside[-1][0] - inside[0][0] <= _APART * (self.high - self.low)

    def _is_flat(self, low: float, high: float) -> bool:
        """Whether a condition cannot be told from zero."""
        known = self._expansion.over(low, high)
        doubtful = [*known.doubtful.tolist(), *([] if known.regular else [len(known.conditions)])]
        return any(k in self._flat for k in doubtful)

    def _decided(self, low: float, high: float) -> Part | None:
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
        zero = self._enclosed(condition, slope, low, high)
        return Part(PartKind.EVENT, low, high, condition, zero, slope > 0, index)

    def _sign(self, alpha: float, condition: int) -> int:
        return int(self._expansion.over(alpha, alpha).conditions[condition])

    def _enclosed(self, condition: int, slope: int, low: float, high: float) -> tuple[float, float]:
        """Floats on both sides of the zero at which the condition has opposite signs, proven."""
        at = self._selection.at
        zero = next((z for z, k in self._zeros if k == condition and low < z < high), 0.5 * (low + high))
        rise = self._expansion.rise(condition, zero)
        found = at(zero)
        if found is None or not np.isfinite(rise) or rise * slope <= 0.0:
            return low, high
        zero -= float(found[2].mid[condition]) / rise
        width = 2.0 * ERRORS * float(found[2].rad[condition]) / abs(rise) + 2.0 * float(np.spacing(abs(zero)))
        for _ in range(_WIDENINGS):
            first, last = zero - width, zero + width
            if not low <= first < last <= high:
                break
            if [self._selection.sign_at(alpha, condition, ERRORS) for alpha in (first, last)] == [-slope, slope]:
                return first, last
            width *= 2.0
        return low, high

    def _open(self, low: float, high: float) -> Part:
        known = self._expansion.over(low, high)
        nodes = frozenset(range(self._selection.system.p))
        if known.regular:
            nodes = frozenset(self._selection.conditions[k][0] for k in known.doubtful)
        return Part(PartKind.OPEN, low, high, doubtful=nodes)


def _append(parts: list[Part], part: Part) -> None:
    """Add a part, joined with the last one where both say the same."""
    last = parts[-1] if parts else None
    if last is not None and last.kind is part.kind and part.kind is not PartKind.EVENT and last.index == part.index:
        parts[-1] = Part(part.kind, last.low, part.high, index=part.index, doubtful=last.doubtful | part.doubtful)
    else:
        parts.append(part)
