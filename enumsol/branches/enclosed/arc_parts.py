"""What a selection does on an interval of alpha, part by part (theory, section 7.14)."""

from __future__ import annotations

import enum
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from enumsol.trusted.arcs.selection_balls import ArcSelection

Number = float | Fraction
Interval = tuple[Number, Number]


class ArcPartKind(enum.StrEnum):
    """What a selection does on a part of an interval; as in proofs (docs/proof_format.md)."""

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


@dataclass
class Trace:
    """What a selection does on an interval.

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
