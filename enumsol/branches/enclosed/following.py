"""The selections that survive a search, followed over alpha in ball arithmetic and joined (theory, section 7.14)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from enumsol.branches.enclosed.joining import Joined, join
from enumsol.search.outcome import Stop, StopReason
from enumsol.support.deadlines import Deadline, TimeOverError, within
from enumsol.support.messages import counted

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from fractions import Fraction

    import numpy as np
    from numpy.typing import NDArray

    from enumsol.branches.enclosed.arc_parts import Trace
    from enumsol.branches.enclosed.traced import TracedProblem
    from enumsol.search.interval.subintervals import SearchedPiece
    from enumsol.selections.solution import Codes
    from enumsol.support.deadlines import Limited

    Bounds = tuple[Fraction, Fraction]

#: Selections that are followed side by side: so many at least, at most, and for one contact node; and where the user
#: waits for an end.
_LEAST, _MOST, _TOGETHER, _FEW = 16, 256, 2**16, 8


@dataclass
class Followed:
    """Traces of selections, and what they join to.

    Attributes
    ----------
    traces : list of Trace
    joined : Joined
    force, length : (2p,) arrays
        Units in which they were followed.
    stopped : Stop or None
        How far it got, if Ctrl-C was pressed or the time was over.
    """

    force: NDArray[np.float64]
    length: NDArray[np.float64]
    traces: list[Trace] = field(default_factory=list)
    joined: Joined = field(default_factory=Joined)
    stopped: Stop | None = None

    @property
    def reasons(self) -> list[str]:
        """What was left open or contradicts completeness."""
        found = list(self.joined.reasons)
        for place in self.joined.open:
            count = len(place.members)
            does = f"{counted(count, 'selection')} {'does' if count == 1 else 'do'}"
            found.append(f"what {does} for alpha in [{float(place.low):.17g}, {float(place.high):.17g}] is not decided")
        return found


def follow_selections(
    traced: TracedProblem,
    pieces: Sequence[SearchedPiece],
    tick: Callable[[float], object] | None = None,
    *,
    known: Sequence[Trace] = (),
    cut_short: bool = False,
    most: int | None = None,
    limits: Limited | None = None,
) -> Followed:
    """Trace all surviving selections where they survive; after a search that was cut short, over the whole interval.

    Parameters
    ----------
    traced : TracedProblem
    pieces : sequence of SearchedPiece
    tick : called with the share of the selections done
    known : traces of selections that are taken over if they are as long
    cut_short : the search was stopped before it had looked everywhere
    most : int, optional
        No further selections are followed after so many boxes, as if Ctrl-C had been pressed.
    limits : Limited, optional
        Selections that are not finished by this deadline are left out.
    """
    where: dict[Codes, list[Bounds]] = {}
    for found in pieces:
        for codes in found.selections:
            where.setdefault(codes, []).append((found.piece.a, found.piece.b))
    followed = Followed(traced.force, traced.length)
    if not cut_short:
        followed.traces += _taken_over(traced, where, known)
    waiting = sorted(where)
    # their matrices grow with the square of the number of nodes
    together = min(max(_LEAST, _TOGETHER // traced.problem.p**2), _MOST) if most is None else _FEW
    for first in range(0, len(waiting), together):
        group = waiting[first : first + together]
        enough = most is not None and sum(len(trace.boxes) for trace in followed.traces) >= most
        reason = StopReason.INTERRUPTED if enough else None
        places = {codes: [traced.interval] if cut_short else where[codes] for codes in group}
        try:
            with within(limits or Deadline()):
                traced.trace({} if enough else places, followed.traces)
            if tick is not None and not enough:
                tick(min(first + together, len(waiting)) / len(waiting))
        except KeyboardInterrupt:
            reason = StopReason.INTERRUPTED
        except TimeOverError:
            reason = StopReason.TIME_LIMIT
        if reason is not None:
            done = len({trace.selection.rows.codes for trace in followed.traces})
            followed.stopped = Stop(reason, done, arcs_of=len(waiting))
            break
    followed.traces.sort(key=lambda trace: trace.selection.rows.codes)
    missing = cut_short or followed.stopped is not None
    followed.joined = join(
        followed.traces, traced.interval, traced.origin, traced.sharpen, cut_short=missing, sparing=traced.sparing
    )
    return followed


def _taken_over(traced: TracedProblem, where: dict[Codes, list[Bounds]], known: Sequence[Trace]) -> list[Trace]:
    """Of the known traces those of selections that have all of theirs; these are taken out of ``where``."""
    found: dict[Codes, list[Trace]] = {}
    for trace in known:
        found.setdefault(trace.selection.rows.codes, []).append(trace)
    taken: list[Trace] = []
    for codes, traces in found.items():
        spans = [(trace.low, trace.high, trace.side) for trace in traces]
        if codes in where and sorted(spans) == sorted(traced.spans(where[codes])):
            taken += traces
            del where[codes]
    return taken
