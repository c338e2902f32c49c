"""branch_graph in 3D: curves, and the tree that shows that there are no others (theory, section 12.9)."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any

from enumsol.branches.graph import BranchGraph
from enumsol.branches.graph_data import GraphStats
from enumsol.branches.remedies import ANOTHER_INTERVAL, MORE_NODES, MORE_TIME, SHORT_INTERVAL
from enumsol.branches.space.cover import SpaceCover
from enumsol.branches.space.make_curved import CurvedGraph
from enumsol.branches.space.pieces import runs_and_turns
from enumsol.condensation.enclosure import NotEnclosedError
from enumsol.proof.curve_records import CutPiece
from enumsol.search.outcome import Stop, StopReason
from enumsol.search.space.known_curves import joined
from enumsol.support.deadlines import Deadline, TimeOverError, within
from enumsol.support.keeping import keeping
from enumsol.support.messages import counted
from enumsol.trusted.space.curve_parts import Run
from enumsol.trusted.space.solution_curve import AlphaProblem

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from concurrent.futures import Executor
    from fractions import Fraction

    from enumsol.branches.elements import Arc, Vertex
    from enumsol.model.problem3d import ContactProblem3D
    from enumsol.proof.curve_records import CurvePart
    from enumsol.support.keeping import Ending
    from enumsol.trusted.space.curve_parts import Turn

    #: The parts into which a curve is cut, and their records.
    _Cut = tuple[Sequence[Run | Turn], Sequence[CurvePart]]

#: Gaps that are named one by one.
_NAMED = 5


def space_graph(
    problem: ContactProblem3D,
    interval: tuple[Fraction, Fraction],
    progress: Callable[[str, float], object] | None,
    max_nodes: int | None,
    limits: Deadline,
    executor: Executor | None = None,
) -> BranchGraph:
    """See ``branch_graph``.

    Raises
    ------
    Interrupted, OutOfMemoryError
        On Ctrl-C, or where the memory does not suffice; ``partial`` has the curves that were found.
    """
    call = _Construction(problem, interval, SpaceCover(problem, interval))
    work = partial(call.run, progress, max_nodes, limits, executor)
    return keeping("branch_graph", work, call.cut_short, lambda _: "; the curves found so far are kept")


@dataclass
class _Construction:
    """One call, and how far it came.

    Attributes
    ----------
    reasons : what ended the search, other than a limit
    searched : when it ended
    cuts : by the number of a curve the parts into which it is cut, and their records
    begun : parts of the others
    """

    problem: ContactProblem3D
    interval: tuple[Fraction, Fraction]
    cover: SpaceCover
    started: float = field(default_factory=time.perf_counter)
    reasons: list[str] = field(default_factory=list)
    searched: float | None = None
    cuts: dict[int, _Cut] = field(default_factory=dict)
    begun: dict[int, list[Run | Turn]] = field(default_factory=dict)

    def run(
        self,
        progress: Callable[[str, float], object] | None,
        max_nodes: int | None,
        limits: Deadline,
        executor: Executor | None,
    ) -> BranchGraph:
        """Search, then cut the curves into arcs."""
        cover, stop = self.cover, None
        try:
            with within(limits):
                cover.search(max_nodes, progress, executor)
            stop = None if cover.stopped is None else Stop(cover.stopped, cover.nodes)
        except NotEnclosedError as error:
            self.reasons.append(str(error))
        except TimeOverError:
            stop = Stop(StopReason.TIME_LIMIT, cover.nodes)
        self.searched = time.perf_counter()
        with within(limits.extended(self.started)):
            return self._graph(self._elements(progress, stop), stop)

    def cut_short(self, ending: Ending) -> BranchGraph:
        """The graph of what was found before something ended ``run``, wherever that was."""
        stop = Stop(StopReason.of(ending), self.cover.nodes)
        return self._graph(self._elements(None, stop), stop)

    def _graph(self, made: _Elements, stop: Stop | None) -> BranchGraph:
        cover, now = self.cover, time.perf_counter()
        reasons = [*self.reasons, *([] if stop is None else [str(stop)])]
        return BranchGraph(
            problem=self.problem,
            exact=None,
            exact_interval=self.interval,
            arithmetic="verified",
            vertices=tuple(made.vertices),
            arcs=tuple(made.arcs),
            undecided=(*reasons, *([] if reasons else _gaps(cover)), *made.reasons),
            stats=GraphStats(
                pieces=1 + sum(isinstance(record, CutPiece) for record in cover.records),
                nodes=cover.nodes,
                selections=len({arc.selections for arc in made.arcs}),
                search_seconds=(now if self.searched is None else self.searched) - self.started,
                seconds=now - self.started,
            ),
            make_proof=None if reasons else partial(cover.proof, made.cuts),
            left_open=_left_open(cover, made),
        )

    def _elements(self, progress: Callable[[str, float], object] | None, stop: Stop | None) -> _Elements:
        """Vertices and arcs of all curves found; after an interruption while they were cut, of those cut by then."""
        # the gaps tell what the tree left open
        cover, remedy = self.cover, None
        if stop is not None:
            remedy = MORE_NODES if stop.reason is StopReason.NODE_LIMIT else MORE_TIME
        curves = cover.chains
        if not curves:
            return _Elements()
        given = AlphaProblem.of(cover.enclosure)
        made = CurvedGraph(cover.problem, given, self.interval)
        over = stop is not None and stop.interrupted and self.searched is not None
        for k, chain in enumerate(curves):
            try:
                if progress is not None:
                    progress("arcs", k / len(curves))
                if k not in self.cuts and not over:
                    found = self.begun.setdefault(k, [])
                    records: list[CurvePart] = []
                    found.clear()
                    self.cuts[k] = runs_and_turns(given, chain, found, records), records
            except TimeOverError:
                cut = f"the time was over before curve {k + 1} of {len(curves)} was cut into arcs"
                made.reasons.append(f"{cut}; {MORE_TIME}")
            if k in self.cuts:
                made.add(self.cuts[k][0], chain.ends, remedy, closed=chain.closed)
            else:
                parts = self.begun.get(k, [])
                made.add(parts, _ends_of(parts), MORE_TIME)
        if progress is not None:
            progress("arcs", 1.0)
        vertices, arcs = made.made()
        if len(self.cuts) < len(curves):
            return _Elements(vertices, arcs, made.reasons, None, None)
        return _Elements(vertices, arcs, made.reasons, made.left_open, [self.cuts[k] for k in range(len(curves))])


@dataclass
class _Elements:
    """Vertices and arcs of the curves.

    Attributes
    ----------
    reasons : what stayed open about the curves
    left_open : ranges of alpha outside of which nothing of that is missing; None where that is not known
    cuts : of every curve the parts into which it is cut, and their records; None where not all are cut
    """

    vertices: Sequence[Vertex] = ()
    arcs: Sequence[Arc] = ()
    reasons: Sequence[str] = ()
    left_open: Sequence[tuple[Fraction, Fraction]] | None = ()
    cuts: Sequence[_Cut] | None = ()


def _ends_of(parts: Sequence[Run | Turn]) -> tuple[Any, Any]:
    """Bounds of alpha at both ends of a part of a curve."""
    if not parts:
        return None, None
    first, last = parts[0], parts[-1]
    return first.start if isinstance(first, Run) else first.alphas, last.end if isinstance(last, Run) else last.alphas


def _left_open(cover: SpaceCover, made: _Elements) -> tuple[tuple[Fraction, Fraction], ...] | None:
    """Ranges of alpha outside of which nothing is missing; None where that is not known."""
    if not cover.settled or made.left_open is None:
        return None
    low, high = cover.interval
    ranges = ((max(begin, low), min(end, high)) for begin, end in (*cover.gaps, *made.left_open))
    return tuple(joined(ends for ends in ranges if ends[0] <= ends[1]))


def _gaps(cover: SpaceCover) -> list[str]:
    """Sentences on where solutions may be missing, why, and what may decide it."""
    found = []
    for low, high in cover.gaps[:_NAMED]:
        ends = sum(low <= begin and end <= high for begin, end in cover.ends)
        why, remedy = "pieces of alpha as short as are tried left statuses undecided", SHORT_INTERVAL
        if ends:
            curves = counted(ends, "end of a curve", "ends of curves")
            floats = not cover.problem.held
            where = "branches meet" + (" or a rigid displacement reaches its bound" if floats else "")
            why, remedy = f"nothing is proven beyond {curves} there, as where {where}", ANOTHER_INTERVAL
        elif cover.unexplained(low, high):
            why, remedy = "no curve through a solution there was proven", ANOTHER_INTERVAL
        found.append(f"solutions may be missing for alpha in [{float(low):.8g}, {float(high):.8g}]: {why}; {remedy}")
    more = len(cover.gaps) - _NAMED
    return [*found, f"and {more} gaps more"] if more > 0 else found
