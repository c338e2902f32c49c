"""Continuation output against the enumeration: points off the graph, arcs not visited, jumps between branches."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from typing import TYPE_CHECKING

from enumsol.auditing.audit_report import AuditedPoint, AuditReport, Jump, MissedArc, Verdict
from enumsol.auditing.graph_map import GraphMap, GraphPlace, GraphPlaceKind
from enumsol.auditing.points import Columns, PointRun, read_points
from enumsol.continuation.path import Path
from enumsol.errors import InvalidArgumentError
from enumsol.support.arguments import real_or_nan, shown

if TYPE_CHECKING:
    import pandas as pd

    from enumsol.branches.graph import BranchGraph
    from enumsol.support.array_types import Floats

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
