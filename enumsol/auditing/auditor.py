"""Continuation output against the enumeration: points off the graph, arcs not visited, jumps between branches.

And every branch of a graph followed from its starting points, or a single arc from where it meets others.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from enumsol.auditing.audit_report import AuditedPoint, AuditReport, Jump, MissedArc, Verdict
from enumsol.auditing.graph_map import (
    Columns,
    GraphMap,
    GraphPlace,
    GraphPlaceKind,
    PointRun,
    checked_graph,
    read_points,
)
from enumsol.continuation.path import AmbiguousStart, Path, follow, start_tangents
from enumsol.continuation.path_data import PathStats, PathStatus
from enumsol.errors import InvalidArgumentError, TooLargeError
from enumsol.model.problem import check_is_problem
from enumsol.support.arguments import alpha_interval, optional_callable, positive_integer, real_or_nan, shown
from enumsol.support.messages import counted

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    import pandas as pd

    from enumsol.branches.elements import Arc
    from enumsol.branches.graph import BranchGraph
    from enumsol.continuation.path_data import ContinuationOptions
    from enumsol.model.problem3d import AnyProblem
    from enumsol.roots.root import Root
    from enumsol.support.array_types import AlphaLike, Floats


#: A point further than this from every arc and vertex lies off the graph: ten times the tolerance of the corrections.
POINT_TOLERANCE = 1e-5
#: Two points follow each other on the graph when the way along it is at most this many times their distance.
DETOUR = 10.0


def audit(
    path: Path | Sequence[Path] | pd.DataFrame | str | os.PathLike[str] | Sequence[PointRun],
    graph: BranchGraph,
    *,
    tolerance: float = POINT_TOLERANCE,
    detour: float = DETOUR,
    columns: Columns = "auto",
) -> AuditReport:
    """Check points of a continuation, of this package or any other, against a branch graph.

    The distance between two points is sqrt(e^2 + a^2). Here e is the energy norm sqrt(d' S d) of the difference d of
    their contact forces, relative to the largest sqrt(g' S^-1 g) on the graph's interval, so that the forces of every
    solution have at most length one; a is their difference in alpha, in twentieths of the interval. Of a body that
    nothing holds the difference of rigid displacements counts as well (theory, section 9.1).

    Parameters
    ----------
    path : Path, sequence of Path, pandas.DataFrame, or file name of a CSV
        Points in the order in which they were computed. Frames and CSV files have the columns alpha, lambda_n_X and
        lambda_t_X (in 3D lambda_t1_X and lambda_t2_X), one X a contact node (others are ignored), and may name several
        paths in a column ``path``. Of a body that nothing holds they also have rigid_0, rigid_1, ..: the coordinates q
        of its rigid displacement N q, which equals u at the degrees of freedom ``problem.modes.held``.
    graph : BranchGraph
    tolerance : float
        Distance from the nearest arc or vertex at which a point lies off the graph, above 0 and below 1. For points of
        another code, about ten times the relative error of its contact forces. Solutions closer to each other than
        this are not distinguished.
    detour : float
        Neighbouring points of a path with a longer way between them along the graph, in multiples of their distance,
        are a jump.
    columns : {"auto", "rows", "labels"}
        Whether X is the node's row number or its label in ``node_ids``; see ``read_points``.

    Returns
    -------
    AuditReport

    Raises
    ------
    InvalidArgumentError
        The points cannot be read, a column is missing, a row names no path, the points do not fit the graph's problem,
        the graph is no branch graph, or the tolerance or detour is out of range.

    Examples
    --------
    >>> import enumsol
    >>> problem = enumsol.gallery.one_node_triangle()
    >>> graph = enumsol.branch_graph(problem, (0, 10))
    >>> path = enumsol.follow(problem, enumsol.newton(problem, 0), interval=(0, 10))
    >>> report = enumsol.audit(path, graph)
    >>> report.ok, report.complete, len(report.missed)  # both arcs of the other branch
    (True, False, 2)
    """
    factor = real_or_nan(detour)
    if not 1 <= factor < math.inf:
        raise InvalidArgumentError(f"detour is {shown(detour)}; expected a finite number of at least 1")
    chart = GraphMap(graph, tolerance)
    return audit_on(chart, read_points(path, graph.problem, columns=columns), factor)


def audit_on(chart: GraphMap, runs: Sequence[PointRun], detour: float) -> AuditReport:
    """The audit on a graph that was mapped before; see `audit`."""
    graph = chart.graph
    tally = _Tally(chart, detour)
    for run in runs:
        tally.add(run)
    touched = {place.number for place in tally.on if place.kind is GraphPlaceKind.VERTEX}
    # the ends of a sheet are parts of it
    single = {v.number for v in graph.vertices if v.family is not None}
    single -= {end for arc in graph.arcs if arc.dimension for end in (arc.tail, arc.head)}
    return AuditReport(
        points=tuple(tally.points),
        jumps=() if graph.reasons else tuple(tally.breaks),
        unjoined=tuple(tally.breaks) if graph.reasons else (),
        visited=frozenset(tally.visited),
        missed=_missed(graph, tally.visited),
        missed_families=tuple(sorted(single - touched)),
        tolerance=chart.tolerance,
        graph_complete=graph.complete,
        graph_reasons=tuple(graph.reasons),
    )


class _Tally:
    """Verdicts on all points so far, the arcs visited, and the pairs of points between which there is no way."""

    def __init__(self, chart: GraphMap, detour: float) -> None:
        self.chart, self.detour = chart, detour
        self.points: list[AuditedPoint] = []
        self.on: list[GraphPlace] = []
        self.breaks: list[Jump] = []
        self.visited: set[int] = set()
        self._branch_of = {arc.number: branch.number for branch in chart.graph.branches for arc in branch.arcs}

    def add(self, run: PointRun) -> None:
        """Take in a run of points."""
        equation = self.chart.equation
        points = [
            equation.point(float(a), forces, rigid)
            for a, forces, rigid in zip(run.alpha, run.forces, run.rigid, strict=True)
        ]
        here: GraphPlace | None = None
        for k, x in enumerate(points):
            previous, here = here, self._locate(run, k, x, here)
            if previous is not None and here is not None:
                self._connect(run, k - 1, (points[k - 1], x), (previous, here))

    def _locate(self, run: PointRun, k: int, x: Floats, near: GraphPlace | None) -> GraphPlace | None:
        """GraphPlace of one point; None unless it lies on the graph."""
        chart, alpha = self.chart, float(run.alpha[k])
        place, verdict, reason = GraphPlace(GraphPlaceKind.OUTSIDE, -1, math.nan), Verdict.NOT_COMPARED, ""
        if chart.outside(alpha):
            low, high = (float(end) for end in chart.graph.interval)
            reason = f"outside the graph's interval [{low:.10g}, {high:.10g}]"
        elif chart.beyond(run.rigid[k]):
            reason = "beyond the bound of the rigid displacement"
        else:
            place, verdict = chart.place(x, near), Verdict.ON
            if place.distance > chart.tolerance:
                verdict, reason = (
                    (Verdict.NOT_COMPARED, "on no arc that the graph holds, and the graph is not complete")
                    if chart.graph.reasons
                    else (Verdict.OFF, "")
                )
        self.points.append(AuditedPoint(run.path, int(run.rows[k]), alpha, place, self._branch(place), verdict, reason))
        if verdict is not Verdict.ON:
            return None
        self.on.append(place)
        if place.kind is GraphPlaceKind.ARC:
            self.visited.add(place.number)
        return place

    def _branch(self, place: GraphPlace) -> int:
        return self._branch_of.get(place.number, -1) if place.kind is GraphPlaceKind.ARC else -1

    def _connect(
        self, run: PointRun, k: int, points: tuple[Floats, Floats], places: tuple[GraphPlace, GraphPlace]
    ) -> None:
        """Arcs passed whole between two neighbouring points, or the break between them."""
        chart, (x, y) = self.chart, points
        length, passed = chart.way(x, places[0], y, places[1])
        distance = chart.equation.norm(y - x)
        if length <= self.detour * distance + 10 * chart.tolerance:
            self.visited |= _between(chart, points, places) | set(passed)
            return
        self.breaks.append(
            Jump(
                path=run.path,
                point=k,
                rows=(int(run.rows[k]), int(run.rows[k + 1])),
                alpha=(float(run.alpha[k]), float(run.alpha[k + 1])),
                places=places,
                branches=(self._branch(places[0]), self._branch(places[1])),
                distance=distance,
                way=length,
            )
        )


def _between(chart: GraphMap, points: tuple[Floats, Floats], places: tuple[GraphPlace, GraphPlace]) -> set[int]:
    """The arc that joins two neighbouring vertices on which the points lie: passed although no point is inside."""
    if any(place.kind is not GraphPlaceKind.VERTEX for place in places) or places[0].number == places[1].number:
        return set()
    ends = {places[0].number, places[1].number}
    joining = [arc for arc in chart.curves if {arc.tail, arc.head} == ends]
    middle = 0.5 * (points[0] + points[1])
    joining.sort(key=lambda arc: chart.arc_distance(middle, arc))
    return {joining[0].number} if joining else set()


def _missed(graph: BranchGraph, visited: set[int]) -> tuple[MissedArc, ...]:
    return tuple(
        MissedArc(arc.number, branch.number, arc.statuses, (arc.lo, arc.hi), bool(arc.dimension))
        for branch in graph.branches
        for arc in branch.arcs
        if arc.number not in visited
    )


@dataclass(frozen=True)
class FollowAllResult:
    """All branches followed.

    Attributes
    ----------
    paths : tuple of Path
    report : AuditReport
        Of all paths together.
    failures : tuple of (alpha, str)
        Starts from which no path could be followed, and paths that stalled, with the reason.
    reseeded : int
        Paths that were started on arcs which those from the starting points had missed.
    graph : BranchGraph
    """

    paths: tuple[Path, ...]
    report: AuditReport
    failures: tuple[tuple[float, str], ...]
    reseeded: int
    graph: Any

    @property
    def complete(self) -> bool:
        """The graph is proven complete, every arc was visited, every point lies on it, and there is no jump."""
        return self.report.ok and self.report.complete

    @property
    def stats(self) -> PathStats:
        """Steps and corrections of all paths."""
        return sum((path.stats for path in self.paths), PathStats())

    def __repr__(self) -> str:
        stats = self.stats
        lines = [
            f"{counted(len(self.paths), 'path')} ({self.reseeded} reseeded), {counted(stats.accepted, 'step')}, "
            f"{counted(stats.corrections, 'correction')}",
            *(f"  failed at alpha = {alpha:.8g}: {reason}" for alpha, reason in self.failures),
            repr(self.report),
        ]
        return "\n".join(lines)


def follow_all(
    problem: AnyProblem,
    interval: tuple[AlphaLike, AlphaLike],
    options: ContinuationOptions | None = None,
    *,
    graph: BranchGraph | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> FollowAllResult:
    """Every branch in the interval followed in both directions, and the audit of all paths.

    Paths start from ``graph.starting_points()``; starts on arcs that were already passed are left out. Arcs missed by
    these, which may happen beyond bifurcations, are started anew. Points outside the graph's interval, such as
    those of an ``overshoot``, are not compared, and the result is then not complete.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
    interval : pair of alphas
    options : ContinuationOptions or None
    graph : BranchGraph or None
        Of this problem over this interval; made by ``branch_graph`` when None.
    progress : callable or None
        Called with the number of arcs visited and of all arcs after every path.

    Returns
    -------
    FollowAllResult

    Raises
    ------
    InvalidArgumentError
        The graph belongs to another problem, or is no branch graph.

    Examples
    --------
    >>> import enumsol
    >>> enumsol.follow_all(enumsol.gallery.one_node_triangle(), (0, 10)).complete
    True
    """
    check_is_problem(problem)
    ends = alpha_interval(interval)
    optional_callable(progress, "progress")
    if graph is None:
        from enumsol.branches import branch_graph  # python-flint and networkx, slow to import

        graph = branch_graph(problem, ends)
    chart = GraphMap(checked_graph(graph), POINT_TOLERANCE)
    if not isinstance(graph.problem, type(problem)):
        raise InvalidArgumentError("graph is one of a problem in another dimension; expected one of this problem")
    if graph.problem is not problem and graph.problem.p != problem.p:
        raise InvalidArgumentError(f"graph has {graph.problem.p} contact nodes; expected the problem's {problem.p}")
    coverage = _Coverage(problem, (float(ends[0]), float(ends[1])), options, chart, progress)
    for start in graph.starting_points():
        coverage.start(start)
    seeded = len(coverage.paths)
    for seed in coverage.missed_seeds():
        coverage.start(seed)
    report = audit_on(chart, read_points(coverage.paths, graph.problem), DETOUR)
    return FollowAllResult(tuple(coverage.paths), report, tuple(coverage.failures), len(coverage.paths) - seeded, graph)


@dataclass
class _Coverage:
    """Paths so far, and the arcs that they passed."""

    problem: AnyProblem
    interval: tuple[float, float]
    options: ContinuationOptions | None
    chart: GraphMap
    progress: Callable[[int, int], object] | None
    paths: list[Path] = field(default_factory=list)
    failures: list[tuple[float, str]] = field(default_factory=list)
    visited: set[int] = field(default_factory=set)

    def start(self, start: Root | _Seed) -> None:
        """Follow a start in both directions unless its arc was passed before."""
        x = self.chart.point(float(start.alpha), start.lambda_n, start.lambda_t, start.rigid_coordinates)
        place = self.chart.place(x)
        if place.kind is GraphPlaceKind.ARC and place.distance <= POINT_TOLERANCE and place.number in self.visited:
            return
        for direction in (1, -1):
            try:
                path = follow(self.problem, start, direction, self.interval, self.options)
            except (AmbiguousStart, TooLargeError) as error:
                self.failures.append((float(start.alpha), str(error)))
                continue
            self.paths.append(path)
            if path.status in (PathStatus.STALLED, PathStatus.DEAD_END, PathStatus.STEP_LIMIT):
                self.failures.append((float(path.alpha[-1]), path.message))
            self.visited |= audit_on(self.chart, read_points(path, self.problem), DETOUR).visited
            if self.progress is not None:
                self.progress(len(self.visited), len(self.chart.graph.arcs))
            if path.closed:
                break

    def missed_seeds(self) -> Iterator[Any]:
        """Roots on arcs that were not visited so far."""
        for arc in self.chart.graph.arcs:
            if arc.dimension or not arc.lo < arc.hi:
                continue
            # where on a missed arc it is started anew, as fractions of its interval; its ends are transition points
            for share in (0.5, 0.25, 0.75):
                if arc.number in self.visited:
                    break
                alpha = arc.lo + share * (arc.hi - arc.lo)
                yield _seed(self.chart, arc, alpha)


class _Seed(NamedTuple):
    """A root of the graph, to start from."""

    alpha: float
    lambda_n: Floats
    lambda_t: Floats
    rigid_coordinates: Floats | None


def _seed(chart: GraphMap, arc: Arc, alpha: float) -> _Seed:
    return _Seed(alpha, *arc.values(alpha), chart.rigid(chart.on_arc(arc, alpha)))


def follow_arc(
    problem: AnyProblem,
    graph: BranchGraph,
    vertex: int,
    arc: int,
    interval: tuple[AlphaLike, AlphaLike] | None = None,
    options: ContinuationOptions | None = None,
) -> Path:
    """A path that leaves a vertex of the graph on one of the arcs that meet there (branch switching).

    The path starts at the vertex itself where its tangents tell the arcs apart by first derivatives, and in the middle
    of the arc where they do not, or where the vertex is a family.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
    graph : BranchGraph
    vertex, arc : int
        Numbers of the vertex and of an arc that ends there.
    interval : (float, float) or None
        None: the graph's.
    options : ContinuationOptions or None

    Raises
    ------
    InvalidArgumentError
        The arc does not end at the vertex, or is a sheet.
    """
    check_is_problem(problem)
    chart = GraphMap(graph, POINT_TOLERANCE)
    vertex, arc = positive_integer(vertex, "vertex", 0), positive_integer(arc, "arc", 0)
    chosen = next((item for item in graph.arcs if item.number == arc), None)
    point = next((item for item in graph.vertices if item.number == vertex), None)
    if chosen is None or point is None or vertex not in (chosen.tail, chosen.head) or chosen.dimension:
        raise InvalidArgumentError(
            f"arc {shown(arc)} is not an arc of single roots that ends at vertex {shown(vertex)} of the graph"
        )
    span: Any = interval if interval is not None else (float(graph.interval[0]), float(graph.interval[1]))
    sign = 1 if vertex == chosen.tail else -1
    if point.family is None:
        start = _Seed(point.alpha, point.lambda_n, point.lambda_t, chart.rigid(chart.at_vertex(point)))
        tangents = start_tangents(problem, start, span, options)
        fitting = [k for k, t in enumerate(tangents) if t.statuses == chosen.statuses and np.sign(t.dalpha) == sign]
        if len(fitting) == 1:
            return follow(problem, start, 1, span, options, tangent=fitting[0])
    middle = _seed(chart, chosen, 0.5 * (chosen.lo + chosen.hi))
    tangents = start_tangents(problem, middle, span, options)
    k = max(range(len(tangents)), key=lambda k: sign * tangents[k].dalpha)
    return follow(problem, middle, 1, span, options, tangent=k)
