"""Places of points on a branch graph: distances to arcs and vertices, and ways along the graph from one to another."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from enumsol.continuation.newton import ALPHA_FRACTION, equation_on
from enumsol.continuation.transitions import selection_distance
from enumsol.errors import InvalidArgumentError
from enumsol.model.contact_body import ContactBody
from enumsol.support.arguments import real_or_nan, shown
from enumsol.support.messages import TextEnum

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from enumsol.branches.elements import Arc, Vertex
    from enumsol.branches.graph import BranchGraph
    from enumsol.roots.root import Polytope
    from enumsol.support.array_types import Floats

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
