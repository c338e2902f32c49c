"""Continuation output against the enumeration: points off the graph, arcs not visited, jumps between branches."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.continuation.graph_map import GraphLike, GraphMap, Place
from enumsol.continuation.path import Path
from enumsol.errors import InvalidArgumentError
from enumsol.roots.root_set import summary

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import NDArray

    from enumsol.continuation.condensed_equation import Vector
    from enumsol.statuses import ContactStatus

#: A point further than this from every arc and vertex lies off the graph: ten times the tolerance of the corrections.
POINT_TOLERANCE = 1e-5
#: Two points follow each other on the graph when the way along it is at most this many times their distance.
DETOUR = 10.0
_PRINTED = 8


@dataclass(frozen=True)
class Jump:
    """Two neighbouring points of a path between which it left its branch.

    Attributes
    ----------
    path, point : int
        Between ``point`` and the next one of this path (0 when there is one only).
    alpha : (float, float)
        Of both points.
    arcs : (int, int)
        Arcs on which they lie; -1 for a vertex.
    branches : (int, int)
        Branches of these arcs; -1 for a vertex.
    distance : float
        Between the points [-].
    way : float
        Length of the shortest way along the graph; infinite when there is none.
    """

    path: int
    point: int
    alpha: tuple[float, float]
    arcs: tuple[int, int]
    branches: tuple[int, int]
    distance: float
    way: float


@dataclass(frozen=True)
class MissedArc:
    """An arc (or sheet) of the graph on which no point lies.

    Attributes
    ----------
    arc, branch : int
    statuses : tuple of p ContactStatus
    interval : (float, float)
    sheet : bool
        A family over an interval of alpha, which no path can cover.
    """

    arc: int
    branch: int
    statuses: tuple[ContactStatus, ...]
    interval: tuple[float, float]
    sheet: bool


@dataclass(frozen=True)
class AuditReport:
    """Result of an audit.

    Attributes
    ----------
    alpha, distances : (m,) arrays
        Of every point: its alpha, and its distance from the nearest arc or vertex, in the lengths of
        ContinuationOptions [-].
    places : tuple of m Place
    off : tuple of int
        Points further than ``tolerance`` from the graph.
    jumps : tuple of Jump
    visited : frozenset of int
        Arcs on which a point lies, or that lie whole between two neighbouring points.
    missed : tuple of MissedArc
    missed_families : tuple of int
        Vertices with a continuum of solutions that no point touches.
    tolerance : float
    """

    alpha: NDArray[np.float64]
    distances: NDArray[np.float64]
    places: tuple[Place, ...]
    off: tuple[int, ...]
    jumps: tuple[Jump, ...]
    visited: frozenset[int]
    missed: tuple[MissedArc, ...]
    missed_families: tuple[int, ...]
    tolerance: float
    _starts: tuple[int, ...] = field(default=(0,), repr=False)

    @property
    def ok(self) -> bool:
        """Every point lies on the graph, and no jump was found."""
        return not self.off and not self.jumps

    @property
    def complete(self) -> bool:
        """No arc and no family was missed."""
        return not self.missed and not self.missed_families

    @property
    def max_distance(self) -> float:
        """Largest distance of a point from the graph [-]."""
        return float(np.max(self.distances, initial=0.0))

    def to_frame(self) -> pd.DataFrame:
        """One row a point: alpha, kind of place, its number, distance, off, jump (to the next point)."""
        import pandas as pd  # slow to import, used here only

        count = len(self.alpha)
        jumps = np.zeros(count, dtype=bool)
        jumps[[self._starts[jump.path] + jump.point for jump in self.jumps]] = True
        return pd.DataFrame(
            {
                "alpha": self.alpha,
                "place": [place.kind for place in self.places],
                "number": [place.number for place in self.places],
                "distance": self.distances,
                "off": np.isin(np.arange(count), self.off),
                "jump": jumps,
            }
        )

    def __repr__(self) -> str:
        lines = [
            f"Audit of {len(self.alpha)} points: {'ok' if self.ok else 'not ok'}, "
            f"{'complete' if self.complete else 'not complete'}",
            f"  largest distance  {self.max_distance:.2e} (tolerance {self.tolerance:.1e}), {len(self.off)} points off",
            f"  jumps             {len(self.jumps)}",
        ]
        lines += [
            f"    between alpha = {jump.alpha[0]:.8g} and {jump.alpha[1]:.8g}: branch {jump.branches[0]} -> "
            f"{jump.branches[1]} (arc {jump.arcs[0]} -> {jump.arcs[1]})"
            for jump in self.jumps[:_PRINTED]
        ]
        lines.append(f"  arcs              {len(self.visited)} visited, {len(self.missed)} missed")
        for item in self.missed[:_PRINTED]:
            name = "sheet" if item.sheet else "arc"
            lines.append(
                f"    {name} {item.arc} of branch {item.branch}, alpha from {item.interval[0]:.8g} to "
                f"{item.interval[1]:.8g}: {summary(item.statuses)}"
            )
        if len(self.missed) > _PRINTED:
            lines.append(f"    ... {len(self.missed) - _PRINTED} more")
        if self.missed_families:
            lines.append(f"  families missed   at the vertices {', '.join(map(str, self.missed_families))}")
        return "\n".join(lines)


def audit(
    path: Path | Sequence[Path] | pd.DataFrame | str | os.PathLike[str],
    graph: GraphLike,
    *,
    tolerance: float = POINT_TOLERANCE,
    detour: float = DETOUR,
) -> AuditReport:
    """Check points of a continuation, of this package or any other, against a branch graph.

    Parameters
    ----------
    path : Path, sequence of Path, pandas.DataFrame, or file name of a CSV
        Points in the order in which they were computed. Frames and CSV files have the columns alpha, lambda_n_0 ..,
        lambda_t_0 .. (others are ignored), and may number several paths in a column ``path``.
    graph : BranchGraph
    tolerance : float
        Distance at which a point lies off the graph: energy norm of forces relative to the load, and alpha relative to
        a twentieth of the graph's interval.
    detour : float
        Neighbouring points of a path with a longer way between them along the graph, in multiples of their distance,
        are a jump.

    Returns
    -------
    AuditReport

    Raises
    ------
    InvalidArgumentError
        A column is missing, or the points do not fit the graph's problem.
    """
    return audit_on(GraphMap(graph, tolerance), path, detour)


def audit_on(chart: GraphMap, path: Any, detour: float) -> AuditReport:
    """The audit on a graph that was mapped before; see `audit`."""
    graph, tolerance = chart.graph, chart.tolerance
    tally = _Tally(chart, detour)
    for run in _runs(path):
        tally.add(_points(run, graph.problem.p, chart))
    touched = {place.number for place in tally.places if place.kind == "vertex" and place.distance <= tolerance}
    return AuditReport(
        alpha=np.array(tally.alpha),
        distances=np.array([place.distance for place in tally.places]),
        places=tuple(tally.places),
        off=tuple(k for k, place in enumerate(tally.places) if place.distance > tolerance),
        jumps=tuple(tally.jumps),
        visited=frozenset(tally.visited),
        missed=_missed(graph, tally.visited),
        missed_families=tuple(v.number for v in graph.vertices if v.family is not None and v.number not in touched),
        tolerance=tolerance,
        _starts=tuple(tally.starts),
    )


class _Tally:
    """Places of all points so far, the arcs visited and the jumps found."""

    def __init__(self, chart: GraphMap, detour: float) -> None:
        self.chart, self.detour = chart, detour
        self.alpha: list[float] = []
        self.places: list[Place] = []
        self.jumps: list[Jump] = []
        self.visited: set[int] = set()
        self.starts: list[int] = []
        self._branch_of = {arc.number: branch.number for branch in chart.graph.branches for arc in branch.arcs}

    def add(self, points: Sequence[Vector]) -> None:
        """One run of points."""
        run = len(self.starts)
        self.starts.append(len(self.places))
        here: Place | None = None
        for k, x in enumerate(points):
            previous, here = here, self._locate(x, here)
            if previous is not None and here is not None:
                passed, jump = _passage(
                    self.chart, points[k - 1 : k + 1], (previous, here), self.detour, self._branch_of
                )
                self.visited |= passed
                if jump is not None:
                    self.jumps.append(Jump(run, k - 1, *jump))

    def _locate(self, x: Vector, near: Place | None) -> Place | None:
        """Place of one point; None when it lies outside the graph's interval or off the graph."""
        chart = self.chart
        alpha = chart.equation.alpha(x)
        low, high = (float(end) for end in chart.graph.interval)
        slack = chart.tolerance * chart.equation.alpha_scale
        outside = not low - slack <= alpha <= high + slack
        place = Place("outside", -1, 0.0) if outside else chart.place(x, near)
        self.alpha.append(alpha)
        self.places.append(place)
        if outside or place.distance > chart.tolerance:
            return None
        if place.kind == "arc":
            self.visited.add(place.number)
        return place


def _passage(
    chart: GraphMap,
    points: Sequence[Vector],
    places: tuple[Place, Place],
    detour: float,
    branch_of: dict[int, int],
) -> tuple[set[int], tuple[Any, ...] | None]:
    """Arcs passed whole between two neighbouring points, and what a Jump says if they do not follow each other."""
    x, y = points
    length, passed = chart.way(x, places[0], y, places[1])
    distance = chart.equation.norm(y - x)
    if length <= detour * distance + 10 * chart.tolerance:
        return _between(chart, points, places) | set(passed), None
    arcs = tuple(place.number if place.kind == "arc" else -1 for place in places)
    alphas = (chart.equation.alpha(x), chart.equation.alpha(y))
    branches = tuple(branch_of.get(arc, -1) for arc in arcs)
    return set(), (alphas, arcs, branches, distance, length)


def _between(chart: GraphMap, points: Sequence[Vector], places: tuple[Place, Place]) -> set[int]:
    """The arc that joins two neighbouring vertices on which the points lie: passed although no point is inside."""
    if places[0].kind != "vertex" or places[1].kind != "vertex" or places[0].number == places[1].number:
        return set()
    ends = {places[0].number, places[1].number}
    joining = [arc for arc in chart.curves if {arc.tail, arc.head} == ends]
    middle = 0.5 * (points[0] + points[1])
    joining.sort(key=lambda arc: chart.arc_distance(middle, arc))
    return {joining[0].number} if joining else set()


def _missed(graph: GraphLike, visited: set[int]) -> tuple[MissedArc, ...]:
    return tuple(
        MissedArc(arc.number, branch.number, arc.statuses, (arc.lo, arc.hi), bool(arc.dimension))
        for branch in graph.branches
        for arc in branch.arcs
        if arc.number not in visited
    )


def _runs(source: Any) -> list[Any]:
    """Single runs of points: paths, or frames."""
    if isinstance(source, Path):
        return [source]
    if isinstance(source, (str, os.PathLike)):
        import pandas as pd  # slow to import, used here only

        try:
            source = pd.read_csv(source)
        except (OSError, ValueError) as error:
            raise InvalidArgumentError(f"path: {error}; expected a CSV file of points") from error
    if hasattr(source, "columns"):
        return [group for _, group in source.groupby("path", sort=False)] if "path" in source.columns else [source]
    if isinstance(source, Sequence) and all(isinstance(item, Path) for item in source):
        return list(source)
    kind = type(source).__name__
    raise InvalidArgumentError(f"path is a {kind}; expected a Path, several of them, a DataFrame or a CSV file")


def _points(run: Any, p: int, chart: GraphMap) -> list[Vector]:
    """Scaled points of one run."""
    if isinstance(run, Path):
        columns = [run.alpha, *run.lambda_n.T, *run.lambda_t.T]
        if len(columns) != 2 * p + 1:
            raise InvalidArgumentError(f"path has {run.lambda_n.shape[1]} contact nodes; expected the graph's {p}")
    else:
        names = ["alpha", *(f"lambda_n_{i}" for i in range(p)), *(f"lambda_t_{i}" for i in range(p))]
        missing = [name for name in names if name not in run.columns]
        if missing:
            raise InvalidArgumentError(f"path has no column {missing[0]!r}; expected the columns {', '.join(names)}")
        try:
            columns = [np.asarray(run[name], dtype=np.float64) for name in names]
        except ValueError as error:
            raise InvalidArgumentError(f"path is not numeric ({error}); expected numbers only") from error
    table = np.column_stack(columns)
    if not np.all(np.isfinite(table)):
        row = int(np.argmin(np.all(np.isfinite(table), axis=1)))
        raise InvalidArgumentError(f"path has a value that is not finite in row {row}; expected finite numbers")
    return [chart.equation.point(float(row[0]), row[1:]) for row in table]
