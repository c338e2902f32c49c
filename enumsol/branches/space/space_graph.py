"""branch_graph in 3D: curves, and the tree that shows that there are no others (theory, section 12.9)."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from enumsol.branches.graph import BranchGraph
from enumsol.branches.graph_data import GraphStats
from enumsol.branches.remedies import ANOTHER_INTERVAL, MORE_TIME, SHORT_INTERVAL
from enumsol.branches.space.cover import SpaceCover
from enumsol.branches.space.make_curved import CurvedGraph
from enumsol.branches.space.pieces import runs_and_turns
from enumsol.condensation.enclosure import NotEnclosedError
from enumsol.errors import Interrupted
from enumsol.proof.space_records import CutPiece
from enumsol.search.outcome import Stop, StopReason
from enumsol.search.space.piece_tree import joined
from enumsol.support.deadlines import Deadline, TimeOverError, within
from enumsol.support.messages import counted
from enumsol.trusted.space.curve_parts import Run
from enumsol.trusted.space.solution_curve import AlphaProblem

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from concurrent.futures import Executor
    from fractions import Fraction

    from enumsol.branches.elements import Arc, Vertex
    from enumsol.model.problem3d import ContactProblem3D
    from enumsol.proof.space_records import CurvePart
    from enumsol.trusted.space.curve_parts import Turn

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
    Interrupted
        On Ctrl-C; ``partial`` has the curves that were found.
    """
    started = time.perf_counter()
    cover = SpaceCover(problem, interval)
    stop: Stop | None = None
    reasons: list[str] = []
    try:
        with within(limits):
            cover.search(max_nodes, progress, executor)
        stop = None if cover.stopped is None else Stop(cover.stopped, cover.nodes)
    except NotEnclosedError as error:
        reasons.append(str(error))
    except TimeOverError:
        stop = Stop(StopReason.TIME_LIMIT, cover.nodes)
    except KeyboardInterrupt:
        stop = Stop(StopReason.INTERRUPTED, cover.nodes)
    searched = time.perf_counter()
    with within(limits.extended(started)):
        made = _elements(cover, interval, progress, stop)
    if made.interrupted:
        stop = Stop(StopReason.INTERRUPTED, cover.nodes)
    reasons += [] if stop is None else [str(stop)]
    graph = BranchGraph(
        problem=problem,
        exact=None,
        exact_interval=interval,
        arithmetic="verified",
        vertices=tuple(made.vertices),
        arcs=tuple(made.arcs),
        undecided=(*reasons, *([] if reasons else _gaps(cover)), *made.reasons),
        stats=GraphStats(
            pieces=1 + sum(isinstance(record, CutPiece) for record in cover.records),
            nodes=cover.nodes,
            selections=len({arc.selections for arc in made.arcs}),
            search_seconds=searched - started,
            seconds=time.perf_counter() - started,
        ),
        make_proof=None if reasons else partial(cover.proof, made.cuts),
        left_open=_left_open(cover, made),
    )
    if stop is not None and stop.interrupted:
        raise Interrupted("branch_graph was interrupted; the curves found so far are kept", graph)
    return graph


@dataclass
class _Elements:
    """Vertices and arcs of the curves.

    Attributes
    ----------
    reasons : what stayed open about the curves
    left_open : ranges of alpha outside of which nothing of that is missing; None where that is not known
    interrupted : whether somebody did that
    cuts : of every curve the parts into which it is cut, and their records; None where the time was over before that
    """

    vertices: Sequence[Vertex] = ()
    arcs: Sequence[Arc] = ()
    reasons: Sequence[str] = ()
    left_open: Sequence[tuple[Fraction, Fraction]] | None = ()
    interrupted: bool = False
    cuts: Sequence[tuple[Sequence[Run | Turn], Sequence[CurvePart]]] | None = ()


def _elements(
    cover: SpaceCover,
    interval: tuple[Fraction, Fraction],
    progress: Callable[[str, float], object] | None,
    stop: Stop | None,
) -> _Elements:
    """Those of all curves that were found."""
    # what the tree left open is told by its gaps
    remedy, curves = None if stop is None else MORE_TIME, cover.chains
    if not curves:
        return _Elements()
    given = AlphaProblem.of(cover.problem.enclosure)
    made, whole, interrupted = CurvedGraph(cover.problem, given, interval), True, False
    cuts: list[tuple[Sequence[Run | Turn], Sequence[CurvePart]]] = []
    for k, chain in enumerate(curves):
        found: list[Run | Turn] = []
        try:
            if progress is not None:
                progress("arcs", k / len(curves))
            records: list[CurvePart] = []
            parts = runs_and_turns(given, chain, found, records)
            made.add(parts, chain.ends, remedy, closed=chain.closed)
            cuts.append((parts, records))
        except TimeOverError:
            cut = f"the time was over before curve {k + 1} of {len(curves)} was cut into arcs"
            made.reasons.append(f"{cut}; {MORE_TIME}")
            made.add(found, _ends_of(found), MORE_TIME)
            whole = False
        except KeyboardInterrupt:
            made.add(found, _ends_of(found), MORE_TIME)
            whole, interrupted = False, True
            break
    else:
        if progress is not None:
            progress("arcs", 1.0)
    vertices, arcs = made.made()
    left_open, known = (made.left_open, cuts) if whole else (None, None)
    return _Elements(vertices, arcs, made.reasons, left_open, interrupted, known)


def _ends_of(parts: Sequence[Run | Turn]) -> tuple[Any, Any]:
    """Bounds of alpha at both ends of a part of a curve."""
    if not parts:
        return None, None
    first, last = parts[0], parts[-1]
    return first.start if isinstance(first, Run) else first.alphas, last.end if isinstance(last, Run) else last.alphas


def _left_open(cover: SpaceCover, made: _Elements) -> tuple[tuple[Fraction, Fraction], ...] | None:
    """Ranges of alpha outside of which nothing is missing; None where that is not known."""
    if not cover.records or made.left_open is None:
        return None
    low, high = cover.interval
    ranges = ((max(begin, low), min(end, high)) for begin, end in (*cover.gaps, *made.left_open))
    return tuple(joined(ends for ends in ranges if ends[0] <= ends[1]))


def _gaps(cover: SpaceCover) -> list[str]:
    """Where solutions may be missing, why, and what may decide it, in words."""
    found = []
    for low, high in cover.gaps[:_NAMED]:
        ends = sum(low <= begin and end <= high for begin, end in cover.ends)
        why, remedy = "pieces of alpha as short as are tried left statuses undecided", SHORT_INTERVAL
        if ends:
            curves = counted(ends, "end of a curve", "ends of curves")
            why, remedy = f"nothing is proven beyond {curves} there, as where branches meet", ANOTHER_INTERVAL
        elif cover.unexplained(low, high):
            why, remedy = "no curve through a solution there was proven", ANOTHER_INTERVAL
        found.append(f"solutions may be missing for alpha in [{float(low):.8g}, {float(high):.8g}]: {why}; {remedy}")
    more = len(cover.gaps) - _NAMED
    return [*found, f"and {more} gaps more"] if more > 0 else found
