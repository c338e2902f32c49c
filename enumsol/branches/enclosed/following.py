"""The selections that survive a search, followed over alpha in ball arithmetic and joined (theory, section 7.14)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from enumsol.branches.enclosed.arc_parts import OpenCause
from enumsol.branches.enclosed.joining import Joined, join
from enumsol.branches.remedies import END_ELSEWHERE, SHORT_INTERVAL, TOLD_APART
from enumsol.condensation.data import EXACT_DOF_LIMIT
from enumsol.search.outcome import Stop, StopReason
from enumsol.support.deadlines import Deadline, TimeOverError, within
from enumsol.support.messages import counted, listed

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from fractions import Fraction

    import numpy as np
    from numpy.typing import NDArray

    from enumsol.branches.enclosed.arc_parts import Trace
    from enumsol.branches.enclosed.joining import EventPlace
    from enumsol.branches.enclosed.traced import TracedProblem
    from enumsol.model.problem import ContactProblem
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
    cut_short : bool
        The search was stopped before, so that selections may be missing.
    problem : ContactProblem
    """

    problem: ContactProblem
    force: NDArray[np.float64]
    length: NDArray[np.float64]
    cut_short: bool = False
    traces: list[Trace] = field(default_factory=list)
    joined: Joined = field(default_factory=Joined)
    stopped: Stop | None = None

    @property
    def reasons(self) -> list[str]:
        """What was left open or contradicts completeness."""
        found = [(place.low, _undecided(place, self.problem), place.cause) for place in self.joined.open]
        ends = [(place.low, place.high) for place in self.joined.open if place.cause is OpenCause.END]
        for alpha in self.joined.unordered:
            line = f"the order of two critical alphas near {float(alpha):.17g} is not known"
            at_end = any(low <= alpha <= high for low, high in ends)
            found.append((alpha, line, OpenCause.END if at_end else OpenCause.TOGETHER))
        found.sort(key=lambda entry: entry[:2])
        # a search that was cut short has a remedy of its own
        missing = self.cut_short or self.stopped is not None
        lines = [line if missing else f"{line}; {_remedy(cause, self.problem)}" for _, line, cause in found]
        return list(dict.fromkeys([*self.joined.reasons, *lines]))


def _undecided(place: EventPlace, problem: ContactProblem) -> str:
    """What is not decided at a place, and why not."""
    count = len(place.members)
    does = f"{counted(count, 'selection')} {'does' if count == 1 else 'do'}"
    where = f"[{float(place.low):.17g}, {float(place.high):.17g}]"
    nodes = [problem.node_ids[i] for i in sorted(place.nodes)]
    of = f"of contact nodes {listed(nodes)}" if len(nodes) > 1 else "of several contact nodes"
    why = {
        OpenCause.BOXES: "one of them was cut into as many boxes as are tried",
        OpenCause.END: "an end of the interval is too close to tell",
        OpenCause.SINGULAR: "the determinant of one of them may vanish there",
        OpenCause.TOGETHER: f"conditions {of} vanish there, too close together to be told apart",
        OpenCause.FLAT: f"a condition of contact node {listed(nodes)} may vanish there together with its slope",
        OpenCause.PARTNER: "where one of them ends, the one that goes on was not identified",
    }[place.cause]
    return f"what {does} for alpha in {where} is not decided: {why}"


def _remedy(cause: OpenCause, problem: ContactProblem) -> str:
    """What decides such a place."""
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
    followed = Followed(traced.problem, traced.force, traced.length, cut_short=cut_short)
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
