"""Reports of audits: points, jumps, missed arcs, and the claims that they allow."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.auditing.graph_map import GraphPlace, GraphPlaceKind
from enumsol.roots.root import summary
from enumsol.support.messages import TextEnum, counted

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    import pandas as pd

    from enumsol.model.statuses import ContactStatus
    from enumsol.support.array_types import Floats

#: How rows are counted, printed with a report.
ROWS = "rows are counted from 0: in a file from the first row below the names of the columns, in a frame as by iloc"
_PRINTED = 8


class Verdict(TextEnum):
    """Verdict on a point; members compare with their texts: ``point.verdict == "on"``."""

    #: Within the tolerance of its place.
    ON = "on"
    #: Further from it, and nothing is known to be missing from the graph.
    OFF = "off"
    #: Whether it is on the graph is not known, for the reason given.
    NOT_COMPARED = "not compared"


@dataclass(frozen=True)
class AuditedPoint:
    """A point of a path with its place on the graph.

    Attributes
    ----------
    path : int or str
        Name of its path: as in the column ``path``, or the number of a Path among those given.
    row : int
        Its row in the frame or file, counted from 0 (row 0 of a file is the first one below the names of the columns),
        or its number in its Path.
    alpha : float
    place : GraphPlace
        The nearest arc or vertex and the distance from it.
    branch : int
        Branch of that arc; -1 for a vertex.
    verdict : Verdict
    reason : str
        Why it was not compared; empty for other points.
    """

    path: int | str
    row: int
    alpha: float
    place: GraphPlace
    branch: int
    verdict: Verdict
    reason: str = ""

    @property
    def distance(self) -> float:
        """From the place; nan outside the graph's interval [-]."""
        return self.place.distance


@dataclass(frozen=True)
class Jump:
    """Two neighbouring points of a path between which it left its branch.

    Attributes
    ----------
    path : int or str
        Name of the path, as in AuditedPoint.
    point : int
        Between this point of the path, counted from 0, and the next one.
    rows : (int, int)
        Of both points, as in AuditedPoint.
    alpha : (float, float)
        Of both points.
    places : (GraphPlace, GraphPlace)
        The arcs or vertices on which they lie.
    arcs : (int, int)
        Numbers of these arcs; -1 for a vertex.
    branches : (int, int)
        Branches of these arcs; -1 for a vertex.
    distance : float
        Between the points [-].
    way : float
        Length of the shortest way along the graph; infinite when there is none.
    """

    path: int | str
    point: int
    rows: tuple[int, int]
    alpha: tuple[float, float]
    places: tuple[GraphPlace, GraphPlace]
    branches: tuple[int, int]
    distance: float
    way: float

    @property
    def arcs(self) -> tuple[int, int]:
        """Numbers of the arcs on which the points lie; -1 for a vertex."""
        first, second = (place.number if place.kind is GraphPlaceKind.ARC else -1 for place in self.places)
        return first, second


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


@dataclass(frozen=True, repr=False)
class AuditReport:
    """Result of an audit.

    An incomplete graph (one with ``graph_reasons``) may lack the arc on which a point lies, or the arc that joins two
    points. Then ``off`` and ``jumps`` are empty; such points are ``not_compared`` and such pairs ``unjoined``.

    Attributes
    ----------
    points : tuple of m AuditedPoint
        Path by path.
    jumps : tuple of Jump
    unjoined : tuple of Jump
        Neighbouring points of a path that the graph does not join, when something is missing from it.
    visited : frozenset of int
        Arcs on which a point lies, or that lie whole between two neighbouring points.
    missed : tuple of MissedArc
        Arcs of the graph that are not visited.
    missed_families : tuple of int
        Vertices with a continuum of solutions that no point touches (the ends of sheets count with these).
    tolerance : float
    graph_complete : bool
        Whether it is proven that the graph holds every solution.
    graph_reasons : tuple of str
        Why solutions may be missing from it. Empty without ``graph_complete``: nothing is known to be missing, but
        completeness is not proven (fast arithmetic).
    """

    points: tuple[AuditedPoint, ...]
    jumps: tuple[Jump, ...]
    unjoined: tuple[Jump, ...]
    visited: frozenset[int]
    missed: tuple[MissedArc, ...]
    missed_families: tuple[int, ...]
    tolerance: float
    graph_complete: bool
    graph_reasons: tuple[str, ...]

    # -- claims ------------------------------------------------------------------------------------------------------

    @property
    def ok(self) -> bool:
        """There are points, every one was compared and lies on the graph, and no path jumped."""
        return bool(self.points) and not (self.off or self.not_compared or self.jumps or self.unjoined)

    @property
    def all_visited(self) -> bool:
        """No arc and no family that the graph holds was missed; the graph may lack others."""
        return not self.missed and not self.missed_families

    @property
    def complete(self) -> bool:
        """No arc and no family was missed, of a graph that is proven complete."""
        return self.all_visited and self.graph_complete

    @property
    def off(self) -> tuple[int, ...]:
        """Numbers, among ``points``, of those that are off the graph."""
        return tuple(k for k, point in enumerate(self.points) if point.verdict is Verdict.OFF)

    @property
    def not_compared(self) -> tuple[int, ...]:
        """Numbers, among ``points``, of those that could not be compared."""
        return tuple(k for k, point in enumerate(self.points) if point.verdict is Verdict.NOT_COMPARED)

    def graph_state(self) -> str:
        """Clause about the completeness of the graph."""
        if self.graph_complete:
            return "the graph is complete"
        if not self.graph_reasons:
            return "the graph is not proven complete"
        more = f" and {len(self.graph_reasons) - 1} more" if len(self.graph_reasons) > 1 else ""
        return f"the graph is not complete: {self.graph_reasons[0]}{more}"

    # -- arrays over points ------------------------------------------------------------------------------------------

    @cached_property
    def alpha(self) -> Floats:
        """Alpha of every point, shape (m,)."""
        return np.array([point.alpha for point in self.points], dtype=np.float64)

    @cached_property
    def distances(self) -> Floats:
        """Distance of every point from the nearest arc or vertex, shape (m,) [-]; nan outside the graph's interval."""
        return np.array([point.distance for point in self.points], dtype=np.float64)

    @property
    def places(self) -> tuple[GraphPlace, ...]:
        """Nearest arc or vertex of every point."""
        return tuple(point.place for point in self.points)

    @property
    def max_distance(self) -> float:
        """Largest distance of a compared point from the graph [-]; nan when none was compared."""
        return max(
            (point.distance for point in self.points if point.verdict is not Verdict.NOT_COMPARED), default=np.nan
        )

    # -- output ------------------------------------------------------------------------------------------------------

    def to_frame(self) -> pd.DataFrame:
        """Table with a row for each point.

        Columns: path, row, alpha, place ("arc", "vertex", "outside" or "none"), number and branch of the place (-1 for
        none), distance, off, compared, reason (why not), jump and unjoined (to the next point).
        """
        import pandas as pd  # slow to import, used here only

        def before(pairs: Sequence[Jump]) -> list[bool]:
            first = {(pair.path, pair.rows[0]) for pair in pairs}
            return [(point.path, point.row) in first for point in self.points]

        return pd.DataFrame(
            {
                "path": [point.path for point in self.points],
                "row": np.array([point.row for point in self.points], dtype=np.int64),
                "alpha": self.alpha,
                "place": [point.place.kind.value for point in self.points],
                "number": np.array([point.place.number for point in self.points], dtype=np.int64),
                "branch": np.array([point.branch for point in self.points], dtype=np.int64),
                "distance": self.distances,
                "off": [point.verdict is Verdict.OFF for point in self.points],
                "compared": [point.verdict is not Verdict.NOT_COMPARED for point in self.points],
                "reason": [point.reason for point in self.points],
                "jump": before(self.jumps),
                "unjoined": before(self.unjoined),
            }
        )

    def summary(self) -> dict[str, Any]:
        """Counts, claims and lists as plain values, for JSON."""
        return {
            **{name: getattr(self, name) for name in ("ok", "complete", "all_visited", "graph_complete")},
            "graph_reasons": list(self.graph_reasons),
            "points": len(self.points),
            "row_numbers": ROWS,
            "tolerance": self.tolerance,
            "max_distance": self.max_distance,
            **{name: [_point_record(self.points[k]) for k in getattr(self, name)] for name in ("off", "not_compared")},
            **{name: [_jump_record(jump) for jump in getattr(self, name)] for name in ("jumps", "unjoined")},
            "visited": sorted(self.visited),
            "missed": [{**vars(item), "statuses": [status.value for status in item.statuses]} for item in self.missed],
            "missed_families": list(self.missed_families),
        }

    def __repr__(self) -> str:
        count, paths = len(self.points), len({point.path for point in self.points})
        largest = "none" if np.isnan(self.max_distance) else f"{self.max_distance:.2e}"
        lines = [
            f"Audit of {counted(count, 'point')} of {counted(paths, 'path')}: {self._headline()}",
            f"  largest distance  {largest} (tolerance {self.tolerance:.1e}), {counted(len(self.off), 'point')} off",
            *self._listed(self.points[k] for k in self.off),
        ]
        if self.not_compared:
            lines.append(f"  not compared      {counted(len(self.not_compared), 'point')}")
            lines += self._listed(_stretches([self.points[k] for k in self.not_compared]))
        lines += [f"  jumps             {len(self.jumps)}", *self._listed(self.jumps)]
        if self.unjoined:
            lines.append(
                f"  not joined        {counted(len(self.unjoined), 'pair')} of points, by the arcs of this graph"
            )
            lines += self._listed(self.unjoined)
        lines.append(f"  arcs              {len(self.visited)} visited, {len(self.missed)} missed")
        lines += self._listed(self.missed)
        if self.missed_families:
            lines.append(f"  families missed   at the vertices {', '.join(map(str, self.missed_families))}")
        if self.off or self.not_compared or self.jumps or self.unjoined:
            lines.append(f"  ({ROWS})")
        return "\n".join(lines)

    def _headline(self) -> str:
        if not self.points:
            return f"not ok (there is no point to compare); {self.graph_state()}"
        if self.complete:
            visits = "complete" if self.ok else "every arc was visited"
        elif self.all_visited:
            visits = f"every arc that the graph holds was visited, but {self.graph_state()}"
        else:
            visits = "not complete" if self.graph_complete else f"not complete, and {self.graph_state()}"
        return f"{'ok' if self.ok else 'not ok'}, {visits}"

    @staticmethod
    def _listed(items: Iterable[AuditedPoint | Jump | MissedArc | str]) -> Iterator[str]:
        found = tuple(items)
        for item in found[:_PRINTED]:
            yield f"    {_line(item)}"
        if len(found) > _PRINTED:
            yield f"    ... {len(found) - _PRINTED} more"


def _stretches(points: Sequence[AuditedPoint]) -> list[str]:
    """Lines about points that were not compared: one for neighbouring rows with the same reason."""
    stretches: list[list[AuditedPoint]] = []
    for point in points:
        last = stretches[-1][-1] if stretches else None
        if last and (last.path, last.row + 1, last.reason) == (point.path, point.row, point.reason):
            stretches[-1].append(point)
        else:
            stretches.append([point])
    lines = []
    for first, *others in stretches:
        last = others[-1] if others else first
        rows, span = f"row {first.row}", f"alpha = {first.alpha:.8g}"
        if others:
            rows, span = f"rows {first.row} to {last.row}", f"alpha from {first.alpha:.8g} to {last.alpha:.8g}"
        lines.append(f"path {first.path}, {rows}, {span}: {first.reason}")
    return lines


def _line(item: AuditedPoint | Jump | MissedArc | str) -> str:
    """Line about a point off the graph, a jump or a missed arc."""
    if isinstance(item, str):
        return item
    if isinstance(item, MissedArc):
        name = "sheet" if item.sheet else "arc"
        return (
            f"{name} {item.arc} of branch {item.branch}, alpha from {item.interval[0]:.8g} to "
            f"{item.interval[1]:.8g}: {summary(item.statuses)}"
        )
    if isinstance(item, Jump):
        if -1 in item.branches:
            ends = " -> ".join(
                f"{place.kind} {place.number}" + (f" of branch {branch}" if place.kind is GraphPlaceKind.ARC else "")
                for place, branch in zip(item.places, item.branches, strict=True)
            )
        else:
            (a, b), (c, d) = item.branches, item.arcs
            ends = f"branch {a} -> {b} (arc {c} -> {d})"
        way = "no way" if np.isinf(item.way) else f"{item.way:.2e}"
        return (
            f"path {item.path}, rows {item.rows[0]} and {item.rows[1]}, between alpha = {item.alpha[0]:.8g} and "
            f"{item.alpha[1]:.8g}: {ends}, {item.distance:.2e} apart and {way} along the graph"
        )
    where = f"path {item.path}, row {item.row}, alpha = {item.alpha:.8g}"
    nearest = {
        GraphPlaceKind.ARC: f"{item.distance:.2e} from arc {item.place.number} of branch {item.branch}",
        GraphPlaceKind.VERTEX: f"{item.distance:.2e} from vertex {item.place.number}",
        GraphPlaceKind.NONE: "the graph holds no arc",
    }[item.place.kind]
    return f"{where}: {nearest}"


def _point_record(point: AuditedPoint) -> dict[str, Any]:
    place = {"place": point.place.kind.value, "number": point.place.number, "branch": point.branch}
    record = {"path": point.path, "row": point.row, "alpha": point.alpha, **place, "distance": point.distance}
    return record | ({"reason": point.reason} if point.reason else {})


def _jump_record(jump: Jump) -> dict[str, Any]:
    return {**asdict(jump), "arcs": jump.arcs}
