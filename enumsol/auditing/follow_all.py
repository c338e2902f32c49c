"""Every branch of a graph followed from its starting points, and single arcs followed from where they meet."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from enumsol.auditing.audit_report import AuditReport
from enumsol.auditing.auditor import DETOUR, POINT_TOLERANCE, audit_on
from enumsol.auditing.graph_map import GraphMap, GraphPlaceKind, checked_graph
from enumsol.auditing.points import read_points
from enumsol.continuation.path import AmbiguousStart, Path, follow, start_tangents
from enumsol.continuation.path_data import PathStats, PathStatus
from enumsol.errors import InvalidArgumentError, TooLargeError
from enumsol.model.problem import check_is_problem
from enumsol.support.arguments import alpha_interval, optional_callable, positive_integer, shown
from enumsol.support.messages import counted

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from enumsol.branches.elements import Arc
    from enumsol.branches.graph import BranchGraph
    from enumsol.continuation.path_data import ContinuationOptions
    from enumsol.model.problem3d import AnyProblem
    from enumsol.roots.root import Root
    from enumsol.support.array_types import AlphaLike, Floats


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
