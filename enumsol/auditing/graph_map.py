"""Points that an audit is given, and their places on a branch graph.

Points are those of followed paths, frames and CSV files, sorted into runs with their row numbers. Places have distances
from arcs and vertices, and ways lead along the graph from one to another.
"""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby, pairwise
from typing import IO, TYPE_CHECKING, Any, Literal, cast

import numpy as np

from enumsol.continuation.newton import ALPHA_FRACTION, equation_on
from enumsol.continuation.path import Path
from enumsol.continuation.transitions import selection_distance
from enumsol.errors import InvalidArgumentError
from enumsol.model.contact_body import ContactBody
from enumsol.model.problem import ContactProblem
from enumsol.support.arguments import real_or_nan, shown
from enumsol.support.messages import TextEnum, counted
from enumsol.support.saved import table_text

if TYPE_CHECKING:
    from collections.abc import Iterable

    import pandas as pd

    from enumsol.branches.elements import Arc, Vertex
    from enumsol.branches.graph import BranchGraph
    from enumsol.model.problem3d import AnyProblem
    from enumsol.roots.root import Polytope
    from enumsol.support.array_types import Floats, Indices


#: How the names of columns tell the contact nodes apart; "auto" takes the one for which all columns are there.
Columns = Literal["auto", "rows", "labels"]
#: Names of columns that an error lists.
_LISTED = 12


@dataclass(frozen=True)
class PointRun:
    """Points of one path in the order in which they were computed.

    Attributes
    ----------
    path : int or str
        What the source calls the path; 0 where it has one path without a name.
    rows : (m,) array
        Row of every point in its frame or file, counted from 0 as ``frame.iloc`` does (row 0 of a file is the first
        one below the names of the columns), or its number in its Path.
    alpha : (m,) array
    forces : (m, 2p) array
        lambda_n and lambda_t [force]; in 3D (m, 3p): lambda_n and both components of lambda_t.
    rigid : (m, r) array
        Of a body that nothing holds, coordinates of its rigid displacement; r is 0 for others.
    """

    path: Any
    rows: Indices
    alpha: Floats
    forces: Floats
    rigid: Floats


def read_points(
    source: object, problem: AnyProblem, *, columns: Columns = "auto", name: str | None = None
) -> tuple[PointRun, ...]:
    """The runs of points in a source; none where it holds no point.

    Parameters
    ----------
    source : Path, sequence of Path, pandas.DataFrame, file name or open text file of a CSV, or list of PointRun
        Frames and files have the columns alpha, lambda_n_X and lambda_t_X (in 3D lambda_t1_X and lambda_t2_X), one X
        a contact node, and may name several paths in a column ``path``; of a body that nothing holds rigid_0, rigid_1,
        .. as well. Others are ignored.
    problem : ContactProblem or ContactProblem3D
    columns : {"auto", "rows", "labels"}
        Whether X is the node's row number or its label in ``problem.node_ids``. "auto": the one for which all columns
        are there; a source that has all columns for both, and different ones for a node, is refused.
    name : str, optional
        What errors call the source; default: the file's name, or "path" for what is no file.

    Raises
    ------
    InvalidArgumentError
        The source is of another kind or cannot be read, a column is missing or named ambiguously, a value is not a
        finite number, or the path of a row is not named.
    """
    if columns not in ("auto", "rows", "labels"):
        raise InvalidArgumentError(f"columns is {columns!r}; expected 'auto', 'rows' or 'labels'")
    if isinstance(source, Path):
        source = [source]
    if isinstance(source, Sequence) and not isinstance(source, str):
        if all(isinstance(item, PointRun) for item in source):
            for run in source:
                _check_nodes(run.forces.shape[1] // len(_forces(problem)), problem.p)
                _check_modes(run.rigid.shape[1], problem)
            return tuple(source)
        if all(isinstance(item, Path) for item in source):
            return tuple(_from_path(k, path, problem) for k, path in enumerate(source))
    if isinstance(source, (str, os.PathLike)) or hasattr(source, "read"):
        place = os.fspath(source) if isinstance(source, (str, os.PathLike)) else getattr(source, "name", "the file")
        name = name or str(place)
        source = _read_csv(cast("str | IO[str]", source), name)
    if hasattr(source, "columns") and hasattr(source, "iloc"):
        return _from_frame(cast("pd.DataFrame", source), problem, columns, name or "path")
    kind = type(source).__name__
    raise InvalidArgumentError(f"path is a {kind}; expected a Path, several of them, a DataFrame or a CSV file")


def _from_path(number: int, path: Path, problem: AnyProblem) -> PointRun:
    _check_nodes(path.lambda_n.shape[1], problem.p)
    found, wanted = ("3D" if solid else "2D" for solid in (path.lambda_t.ndim == 3, len(_forces(problem)) == 3))
    if found != wanted:
        raise InvalidArgumentError(f"path {number} is one in {found}; expected a path in {wanted}, as the graph is")
    parts = [path.lambda_t] if path.lambda_t.ndim == 2 else [path.lambda_t[:, :, 0], path.lambda_t[:, :, 1]]
    forces = np.hstack([path.lambda_n, *parts])
    rigid = np.zeros((len(path), 0)) if path.rigid_coordinates is None else path.rigid_coordinates
    _check_modes(rigid.shape[1], problem)
    finite = np.isfinite(path.alpha) & np.all(np.isfinite(np.hstack([forces, rigid])), axis=1)
    if not np.all(finite):
        raise InvalidArgumentError(
            f"path {number} is not finite at point {int(np.argmin(finite))}; expected finite numbers"
        )
    return PointRun(number, np.arange(len(path)), path.alpha, forces, rigid)


def _forces(problem: AnyProblem) -> tuple[str, ...]:
    """Names of the forces of a contact node."""
    return ("lambda_n", *(("lambda_t",) if isinstance(problem, ContactProblem) else ("lambda_t1", "lambda_t2")))


def _check_nodes(found: int, p: int) -> None:
    if found != p:
        raise InvalidArgumentError(f"path has {found} contact nodes; expected the graph's {p}")


def _check_modes(found: int, problem: AnyProblem) -> None:
    if found != problem.modes.r:
        raise InvalidArgumentError(
            f"path has a rigid displacement of {counted(found, 'coordinate')}; expected the graph's {problem.modes.r}"
        )


def _read_csv(source: str | os.PathLike[str] | IO[str], name: str) -> pd.DataFrame:
    """The texts of the file, unconverted: files and frames are converted in one place."""
    import pandas as pd  # slow to import, used here only

    try:
        # a header of its own: a row longer than the names would otherwise shift the columns under them
        table = pd.read_csv(table_text(source), header=None, dtype=str, na_filter=False, skipinitialspace=True)
    except OSError as error:
        raise InvalidArgumentError(
            f"{name} cannot be read ({error.strerror or error}); expected a CSV file of points"
        ) from error
    except ValueError as error:
        why = str(error).strip().removeprefix("Error tokenizing data. C error: ")
        raise InvalidArgumentError(f"{name}: {why}; expected a CSV file of points, with commas") from error
    frame = table.iloc[1:].reset_index(drop=True)
    frame.columns = pd.Index([str(title).strip() for title in table.iloc[0]])
    return frame


def _from_frame(frame: pd.DataFrame, problem: AnyProblem, columns: Columns, name: str) -> tuple[PointRun, ...]:
    titles = _titles(frame, problem, columns, name)
    values = np.column_stack([_numbers(frame, title, name) for title in titles])
    rigid = _rigid(frame, problem, name)
    return tuple(
        PointRun(path, rows, values[rows, 0], values[rows, 1:], rigid[rows])
        for path, rows in _rows_by_path(frame, name).items()
    )


def _rigid(frame: pd.DataFrame, problem: AnyProblem, name: str) -> Floats:
    """Columns with the coordinates of the rigid displacement, (rows, r)."""
    known, titles = list(frame.columns), [f"rigid_{mode}" for mode in range(problem.modes.r)]
    for title in titles:
        if known.count(title) != 1:
            raise InvalidArgumentError(
                f"{name} has {known.count(title) or 'no'} column{'s' if title in known else ''} {title!r}; expected "
                "one for every coordinate of the rigid displacement of a body that nothing holds"
            )
    columns = [_numbers(frame, title, name) for title in titles]
    return np.reshape(columns, (len(titles), len(frame))).T


# -- names of columns --------------------------------------------------------------------------------------------------


def _titles(frame: pd.DataFrame, problem: AnyProblem, columns: Columns, name: str) -> list[str]:
    """Names of the columns with alpha, lambda_n and lambda_t of the nodes in the order of their rows."""
    known = [title if isinstance(title, str) else repr(title) for title in frame.columns]
    ways = _ways(problem, columns, name)
    lacking = {way: [title for title in titles if title not in known] for way, titles in ways.items()}
    whole = [way for way in ways if not lacking[way]]
    if not whole:
        least = min(ways, key=lambda way: len(lacking[way]))
        expected = " or ".join(f"{_span(ways[way])} by {_MEANING[way]}" for way in ways)
        raise InvalidArgumentError(
            f"{name} has no column {lacking[least][0]!r}; expected {expected}; found {_listed(known)}"
        )
    if len(whole) > 1:
        raise InvalidArgumentError(
            f"{name} has columns that fit the nodes' row numbers ({_span(ways['rows'])}) as well as their labels "
            f"({_span(ways['labels'])}), and these differ; expected columns=rows or columns=labels to say which"
        )
    titles = ways[whole[0]]
    count = Counter(known)
    twice = [title for title in titles if count[title] > 1]
    if twice:
        raise InvalidArgumentError(f"{name} has {count[twice[0]]} columns {twice[0]!r}; expected one")
    return titles


_MEANING = {"rows": "row number", "labels": "label"}


def _ways(problem: AnyProblem, columns: Columns, name: str) -> dict[str, list[str]]:
    """The admissible ways to name the nodes, with all names of columns; one where both are the same."""
    rows = [str(row) for row in range(problem.p)]
    labels = [str(label) for label in problem.node_ids]
    distinct = len(set(labels)) == len(labels)
    if columns == "labels" and not distinct:
        raise InvalidArgumentError(f"{name}: columns=labels, but two labels are the same text; expected columns=rows")
    ways = {"rows": rows} if columns != "labels" else {}
    if columns != "rows" and distinct and labels not in ways.values():
        ways["labels"] = labels
    return {
        way: ["alpha", *(f"{force}_{node}" for force in _forces(problem) for node in nodes)]
        for way, nodes in ways.items()
    }


def _span(titles: Sequence[str]) -> str:
    """Names of columns, those between the first and the last node of many left out."""
    alpha = titles[0]
    parts = [list(part) for _, part in groupby(titles[1:], key=lambda title: title.split("_", 2)[1])]
    p = len(parts[0])
    return ", ".join([alpha, *(", ".join(part) if p <= 3 else f"{part[0]}, .., {part[-1]}" for part in parts)])


def _listed(known: Sequence[str]) -> str:
    more = f" and {len(known) - _LISTED} more" if len(known) > _LISTED else ""
    return (", ".join(known[:_LISTED]) or "none") + more


# -- cells -------------------------------------------------------------------------------------------------------------


def _numbers(frame: pd.DataFrame, title: str, name: str) -> Floats:
    """A column as finite floats."""
    column = frame[title]
    if column.dtype.kind in "iuf":
        values = column.to_numpy(dtype=np.float64, na_value=np.nan)
    else:
        values = np.array([_number(cell, f"{name}: {title}", row) for row, cell in enumerate(column)], dtype=np.float64)
    finite = np.isfinite(values)
    if not np.all(finite):
        row = int(np.argmin(finite))
        found = "empty or nan" if np.isnan(values[row]) else values[row]
        raise InvalidArgumentError(f"{name}: {title} is not finite in row {row} ({found}); expected a finite number")
    return values


def _number(cell: float | str, what: str, row: int) -> float:
    if _empty(cell):
        return np.nan
    try:
        return float(cell)
    except (TypeError, ValueError):
        raise InvalidArgumentError(f"{what} is not numeric in row {row} ({str(cell)!r}); expected a number") from None


def _empty(cell: float | str) -> bool:
    if isinstance(cell, str):
        return not cell.strip()
    import pandas as pd  # slow to import, used here only

    return bool(pd.api.types.is_scalar(cell) and pd.isna(cell))


def _rows_by_path(frame: pd.DataFrame, name: str) -> dict[Any, Indices]:
    """Rows of every path, paths in the order of their first rows."""
    if "path" not in frame.columns:
        return {0: np.arange(len(frame))} if len(frame) else {}
    if list(frame.columns).count("path") > 1:
        raise InvalidArgumentError(f"{name} has several columns 'path'; expected one")
    cells = frame["path"].tolist()
    unnamed = [row for row, cell in enumerate(cells) if _empty(cell)]
    if unnamed:
        # whether it belongs to the path above or to none is not guessed
        more = f" and {len(unnamed) - 1} more" if len(unnamed) > 1 else ""
        raise InvalidArgumentError(
            f"{name}: path is empty in row {unnamed[0]}{more}; expected the name of its path in every row, or no "
            "column 'path' for a single one"
        )
    rows: dict[Any, list[int]] = {}
    for row, path in enumerate(_names(cells)):
        rows.setdefault(path, []).append(row)
    return {path: np.array(members) for path, members in rows.items()}


def _names(cells: Sequence[Any]) -> list[int] | list[str]:
    """Names of paths: int where all are whole numbers (a frame may hold them as floats, a file as texts), else text."""
    texts = [str(int(cell)) if isinstance(cell, float) and cell.is_integer() else str(cell).strip() for cell in cells]
    numbers = [int(text) if text.removeprefix("-").isdecimal() else None for text in texts]
    whole = [number for number, text in zip(numbers, texts, strict=True) if number is not None and str(number) == text]
    return whole if len(whole) == len(texts) else texts


#: What a graph must have.
_ASKED = ("problem", "interval", "arcs", "vertices", "branches", "complete", "reasons")


def checked_graph(graph: object) -> BranchGraph:
    """The argument ``graph`` as a branch graph.

    Raises
    ------
    InvalidArgumentError
        It is something else.
    """
    lacking = [name for name in _ASKED if not hasattr(graph, name)]
    if lacking or not isinstance(getattr(graph, "problem", None), ContactBody):
        why = f", which has no {lacking[0]}" if lacking else ""
        raise InvalidArgumentError(
            f"graph is a {type(graph).__name__}{why}; expected a BranchGraph, which holds arcs over an interval "
            "(of branch_graph or BranchGraph.load)"
        )
    return cast("BranchGraph", graph)


class GraphPlaceKind(TextEnum):
    """Kind of the place of a point; members compare with their texts."""

    #: An arc, or a sheet.
    ARC = "arc"
    VERTEX = "vertex"
    #: Not compared, because its alpha is outside the graph's interval.
    OUTSIDE = "outside"
    #: The graph has no arc and no vertex.
    NONE = "none"


@dataclass(frozen=True)
class GraphPlace:
    """Place of a point on the graph.

    Attributes
    ----------
    kind : GraphPlaceKind
        "arc", "vertex", "outside" or "none".
    number : int
        Of the arc or vertex; -1 for none.
    distance : float
        From it, in the lengths of ContinuationOptions [-]; nan outside, infinite for none.
    """

    kind: GraphPlaceKind
    number: int
    distance: float


def checked_tolerance(tolerance: float) -> float:
    """The argument ``tolerance``, below 1 because the forces of every solution have at most length 1.

    Raises
    ------
    InvalidArgumentError
        It is not a number between 0 and 1.
    """
    number = real_or_nan(tolerance)
    if not 0 < number < 1:
        raise InvalidArgumentError(f"tolerance is {shown(tolerance)}; expected a number above 0 and below 1")
    return number


class GraphMap:
    """A branch graph in the metric of the continuation.

    Parameters
    ----------
    graph : BranchGraph
    tolerance : float
        Points within this of an arc or vertex lie on it.

    Raises
    ------
    InvalidArgumentError
        The graph is no branch graph, or the tolerance is not between 0 and 1.
    """

    def __init__(self, graph: BranchGraph, tolerance: float) -> None:
        self.graph, self.tolerance = checked_graph(graph), checked_tolerance(tolerance)
        low, high = (float(end) for end in graph.interval)
        scale = ALPHA_FRACTION * (high - low)
        self.equation = equation_on(graph.problem, None, low, (low, high), alpha_scale=scale)
        self.arcs: dict[int, Arc] = {arc.number: arc for arc in graph.arcs}
        self.vertices: dict[int, Vertex] = {vertex.number: vertex for vertex in graph.vertices}
        self.curves = [arc for arc in self.arcs.values() if not arc.dimension]
        self._corners = {number: self._corner_points(vertex) for number, vertex in self.vertices.items()}

    def point(self, alpha: float, lambda_n: Floats, lambda_t: Floats, rigid: Floats | None = None) -> Floats:
        """Scaled point of the condensed equation; ``rigid``: coordinates of the rigid displacement, if there is one."""
        return self.equation.point(alpha, np.concatenate([lambda_n, lambda_t.ravel(order="F")]), rigid)

    # -- distances ---------------------------------------------------------------------------------------------------

    def outside(self, alpha: float) -> bool:
        """True if an alpha is outside the graph's interval, by more than the tolerance."""
        low, high = (float(end) for end in self.graph.interval)
        slack = self.tolerance * self.equation.alpha_scale
        return not low - slack <= alpha <= high + slack

    def beyond(self, rigid: Floats) -> bool:
        """True if the body has moved farther than the graph asks for, by more than the tolerance."""
        return bool(np.any(np.abs(rigid) > self.equation.reach * (1 + self.tolerance)))

    def place(self, x: Floats, near: GraphPlace | None = None) -> GraphPlace:
        """Nearest arc or vertex; the arc of the point before is tried first, until one is close enough."""
        vertex = min(
            (GraphPlace(GraphPlaceKind.VERTEX, number, self.vertex_distance(x, number)) for number in self.vertices),
            key=lambda place: place.distance,
            default=GraphPlace(GraphPlaceKind.NONE, -1, math.inf),
        )
        if vertex.distance <= self.tolerance:
            return self._at_vertex(x, vertex)
        best = GraphPlace(GraphPlaceKind.NONE, -1, math.inf)
        for arc in self._in_order(near):
            if self._gap(x, arc) <= min(best.distance, vertex.distance):
                distance = self.arc_distance(x, arc)
                if distance < best.distance:
                    best = GraphPlace(GraphPlaceKind.ARC, arc.number, distance)
                if distance <= self.tolerance:
                    break
        # a vertex is nearer than the arcs that end there only when it is so by more than rounding
        return vertex if vertex.distance < (1 - 1e-9) * best.distance else best

    def _at_vertex(self, x: Floats, place: GraphPlace) -> GraphPlace:
        """A place at a vertex with the distance from it or from an arc that ends there."""
        ends = [arc for arc in self.curves if place.number in (arc.tail, arc.head)]
        distance = min((self.arc_distance(x, arc) for arc in ends), default=math.inf)
        return GraphPlace(GraphPlaceKind.VERTEX, place.number, min(place.distance, distance))

    def _gap(self, x: Floats, arc: Arc) -> float:
        """Distance in alpha alone, a lower bound."""
        alpha = self.equation.alpha(x)
        return max(arc.lo - alpha, alpha - arc.hi, 0.0) / self.equation.alpha_scale

    def _in_order(self, near: GraphPlace | None) -> Iterable[Arc]:
        if near is None:
            return self.arcs.values()
        if near.kind is GraphPlaceKind.ARC and near.number in self.arcs:
            arc = self.arcs[near.number]
            ends, first = {arc.tail, arc.head}, arc.number
        else:
            ends, first = {near.number}, -1
        return sorted(self.arcs.values(), key=lambda a: (a.number != first, not ends & {a.tail, a.head}, a.number))

    def arc_distance(self, x: Floats, arc: Arc) -> float:
        """Distance of a point from an arc (from a sheet: at the alpha of the point)."""
        low, high = arc.lo, arc.hi
        alpha = min(max(self.equation.alpha(x), low), high)
        if arc.dimension:
            return self._sheet_distance(x, arc, alpha)
        best = math.inf
        # Gauss-Newton iterations towards the nearest point of an arc
        for _ in range(8):
            y = self.on_arc(arc, alpha)
            distance = self.equation.norm(x - y)
            if distance >= 0.999 * best:
                break
            best = distance
            step = 1e-6 * (high - low)
            # a distance below this fraction of the tolerance need not be made smaller
            if best <= 1e-4 * self.tolerance or step == 0:
                break
            other = alpha + step if alpha + step <= high else alpha - step
            if other == alpha:  # an arc of a few floats' length
                break
            slope = (self.on_arc(arc, other) - y) / (other - alpha)
            alpha = min(max(alpha + self.equation.dot(x - y, slope) / self.equation.dot(slope, slope), low), high)
        return best

    def _sheet_distance(self, x: Floats, arc: Arc, alpha: float) -> float:
        y = np.append(x[:-1], alpha / self.equation.alpha_scale)
        across = min(selection_distance(self.equation, codes, y) for codes in arc.selections)
        return math.hypot(across, float(x[-1] - y[-1]))

    def on_arc(self, arc: Arc, alpha: float) -> Floats:
        """Scaled point of an arc."""
        if not self.equation.modes:
            return self.point(alpha, *arc.values(alpha))
        return self.equation.point_of(alpha, *arc.state(alpha))

    def at_vertex(self, vertex: Vertex) -> Floats:
        """Scaled point of a vertex that is no family."""
        if not self.equation.modes:
            return self.point(vertex.alpha, vertex.lambda_n, vertex.lambda_t)
        forces, moves = np.append(vertex.lambda_n, vertex.lambda_t), np.append(vertex.u_n, vertex.u_t)
        return self.equation.point_of(vertex.alpha, forces, moves)

    def rigid(self, x: Floats) -> Floats | None:
        """Coordinates of the rigid displacement at a scaled point; None of a body that is held."""
        return self.equation.rigid(x) if self.equation.modes else None

    def vertex_distance(self, x: Floats, number: int) -> float:
        """Distance of a point from a vertex, or from the nearest polytope of a family."""
        return min(self._hull_distance(x, corners) for corners in self._corners[number])

    def _corner_points(self, vertex: Vertex) -> list[Floats]:
        if vertex.family is None:
            return [self.at_vertex(vertex)[None, :]]
        return [self._corners_of(vertex.alpha, part) for part in vertex.family.polytopes]

    def _corners_of(self, alpha: float, part: Polytope) -> Floats:
        rigid = [None] * len(part.vertices) if part.rigid_coordinates is None else part.rigid_coordinates
        corners = zip(part.vertices, rigid, strict=True)
        return np.array([self.point(alpha, corner[:, 0], corner[:, 1], q) for corner, q in corners])

    def _hull_distance(self, x: Floats, corners: Floats) -> float:
        if len(corners) == 1:
            return self.equation.norm(x - corners[0])
        from scipy.optimize import nnls  # only families need it

        root = np.linalg.cholesky(self.equation.metric).T
        weight = 1e4  # of the condition that the shares sum to one; its error is the square of the distance over this
        matrix = np.vstack([root @ corners.T, weight * np.ones(len(corners))])
        shares, _ = nnls(matrix, np.append(root @ x, weight))
        return self.equation.norm(x - shares / np.sum(shares) @ corners)

    # -- ways along the graph ----------------------------------------------------------------------------------------

    @cached_property
    def _network(self) -> Any:
        """Vertices joined by arcs, weighted by their lengths."""
        import networkx as nx  # audits only

        network = nx.MultiGraph()
        network.add_nodes_from(self.vertices)
        for arc in self.arcs.values():
            network.add_edge(arc.tail, arc.head, key=arc.number, weight=self._length(arc))
        return network

    def _length(self, arc: Arc) -> float:
        """Length of an arc; of a sheet, what every way across it has at least."""
        if arc.dimension:
            return (arc.hi - arc.lo) / self.equation.alpha_scale
        # points at which the length of an arc is measured
        points = [self.on_arc(arc, alpha) for alpha in np.linspace(arc.lo, arc.hi, 9)]
        return sum(self.equation.norm(b - a) for a, b in pairwise(points))

    def way(self, x: Floats, start: GraphPlace, y: Floats, end: GraphPlace) -> tuple[float, tuple[int, ...]]:
        """Length of the shortest way along the graph between two points, and the arcs that it passes whole.

        The length is infinite when no way leads from one to the other.
        """
        import networkx as nx  # audits only

        if start.kind is end.kind and start.number == end.number:
            return 0.0, ()
        best: tuple[float, tuple[int, ...]] = (math.inf, ())
        leave, arrive = self._exits(x, start), self._exits(y, end)
        for first, head in leave.items():
            lengths, routes = nx.single_source_dijkstra(self._network, first)
            for last, tail in arrive.items():
                if last in lengths and head + lengths[last] + tail < best[0]:
                    best = (head + lengths[last] + tail, self._passed(routes[last]))
        return best

    def _exits(self, x: Floats, place: GraphPlace) -> dict[int, float]:
        """Vertices next to a point with their distances."""
        if place.kind is GraphPlaceKind.VERTEX:
            return {place.number: 0.0}
        arc = self.arcs[place.number]
        return {number: self.vertex_distance(x, number) for number in (arc.tail, arc.head)}

    def _passed(self, route: Sequence[int]) -> tuple[int, ...]:
        return tuple(
            min(self._network[a][b], key=lambda number: self._network[a][b][number]["weight"])
            for a, b in pairwise(route)
        )
