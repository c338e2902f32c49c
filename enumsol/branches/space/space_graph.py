"""branch_graph in 3D: curves, and the tree that shows that there are no others (theory, section 12.9)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from enumsol.branches.graph_data import GraphStats
from enumsol.branches.space.cover import SpaceCover
from enumsol.branches.space.make_curved import CurvedGraph
from enumsol.branches.space.pieces import runs_and_turns
from enumsol.branches.unfinished import ANOTHER_INTERVAL, MORE_NODES, MORE_TIME, SHORT_INTERVAL
from enumsol.branches.ways import Made
from enumsol.condensation.enclosure import NotEnclosedError
from enumsol.proof.curve_records import CutPiece
from enumsol.search.outcome import Stop, StopReason
from enumsol.search.space.known_curves import joined
from enumsol.support.deadlines import TimeOverError, within
from enumsol.support.messages import counted
from enumsol.trusted.space.curve_parts import Run
from enumsol.trusted.space.solution_curve import AlphaProblem

if TYPE_CHECKING:
    from collections.abc import Sequence
    from concurrent.futures import Executor
    from fractions import Fraction

    from enumsol.branches.elements import Arc, Vertex
    from enumsol.branches.unfinished import Tick
    from enumsol.model.problem3d import ContactProblem3D
    from enumsol.proof.curve_records import CurvePart
    from enumsol.support.deadlines import Deadline
    from enumsol.trusted.space.curve_parts import Turn

    #: The parts into which a curve is cut, and their records.
    _Cut = tuple[Sequence[Run | Turn], Sequence[CurvePart]]

#: Gaps that are named one by one.
_NAMED = 5


class ByCurves:
    """The way in 3D: curves that a tree finds, cut into arcs.

    Parameters
    ----------
    problem : ContactProblem3D
    interval : (Fraction, Fraction)

    Attributes
    ----------
    cover : SpaceCover
    reasons : what ended the search, other than a limit
    stop : how far the search came, if a limit ended it
    searched : whether it was searched
    cuts : by the number of a curve the parts into which it is cut, and their records
    begun : parts of the others
    """

    def __init__(self, problem: ContactProblem3D, interval: tuple[Fraction, Fraction]) -> None:
        self.cover, self.interval = SpaceCover(problem, interval), interval
        self.reasons: list[str] = []
        self.stop: Stop | None = None
        self.searched = False
        self.cuts: dict[int, _Cut] = {}
        self.begun: dict[int, list[Run | Turn]] = {}

    def run(self, max_nodes: int | None, limits: Deadline, tick: Tick | None, executor: Executor | None) -> None:
        """Search the interval."""
        cover = self.cover
        try:
            with within(limits):
                cover.search(max_nodes, tick, executor)
            self.stop = None if cover.stopped is None else Stop(cover.stopped, cover.nodes)
        except NotEnclosedError as error:
            self.reasons.append(str(error))
        except TimeOverError:
            self.stop = Stop(StopReason.TIME_LIMIT, cover.nodes)
        self.searched = True

    def made(self, limits: Deadline, tick: Tick | None) -> Made:
        """Arcs into which the curves are cut."""
        with within(limits):
            return self._made(self._elements(tick, self.stop), self.stop)

    def ended(self, reason: StopReason) -> Made:
        """Arcs of the curves that were found."""
        stop = Stop(reason, self.cover.nodes)
        return self._made(self._elements(None, stop), stop)

    def _made(self, made: _Elements, stop: Stop | None) -> Made:
        cover = self.cover
        reasons = [*self.reasons, *([] if stop is None else [str(stop)])]
        return Made(
            made.vertices,
            made.arcs,
            (*reasons, *([] if reasons else _gaps(cover)), *made.reasons),
            GraphStats(
                pieces=1 + sum(isinstance(record, CutPiece) for record in cover.records),
                nodes=cover.nodes,
                selections=len({arc.selections for arc in made.arcs}),
            ),
            make_proof=None if reasons else partial(cover.proof, made.cuts),
            left_open=_left_open(cover, made),
        )

    def _elements(self, tick: Tick | None, stop: Stop | None) -> _Elements:
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
        over = stop is not None and stop.interrupted and self.searched
        for k, chain in enumerate(curves):
            try:
                if tick is not None:
                    tick(k / len(curves))
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
        if tick is not None:
            tick(1.0)
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
