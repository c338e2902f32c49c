"""Parts of a branch graph: vertices, arcs, components and branches (theory, section 7.11), and what bounds the work.

Vertices have their kinds and degrees here, whichever arithmetic they come from.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

import networkx as nx
import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.model.statuses import OPEN, SLIP_MINUS, SLIP_PLUS, STICK, ContactStatus, contact_status
from enumsol.roots.local_branch import ContactState
from enumsol.roots.root import RootFamily, summary
from enumsol.search.outcome import StopReason
from enumsol.support.arguments import alpha_value
from enumsol.support.deadlines import Deadline, TimeOverError, look, within
from enumsol.support.messages import TextEnum

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence, Set

    from enumsol.arithmetic.algebraic import CriticalAlpha
    from enumsol.support.array_types import AlphaLike, Codes, Floats

    Pair = tuple[Floats, Floats]
    Tick = Callable[[float], object]


class VertexKind(TextEnum):
    """Kind of a vertex; members compare with their texts: ``vertex.kind == "fold"``."""

    #: One arc from the left goes on as another to the right.
    TRANSITION = "transition"
    #: Two arcs meet on one side: alpha turns back.
    FOLD = "fold"
    #: Any other number of arcs meet.
    BIFURCATION = "bifurcation"
    #: A continuum of solutions at one alpha: a vertical arc.
    FAMILY = "family"
    #: The border of a sheet.
    SHEET = "sheet"
    #: A status is met and left again.
    TOUCH = "touch"
    #: No arc at all.
    POINT = "point"
    #: Selections hold here that were not examined, because the search was cut short or a limit was reached. Unknown
    #: arcs may end here, so the kind is not known.
    UNSETTLED = "unsettled"
    #: One arc of degree 0 begins or ends alone.
    TERMINAL = "terminal"
    #: The degrees of the arcs on both sides do not balance: something is missing, and the graph is not complete.
    BROKEN = "broken"
    #: The body has moved by the largest rigid displacement that was asked for; beyond, nothing is known.
    BOUND = "bound"
    #: On the interval's border.
    END = "end"


def tangential(values: Floats, p: int) -> Floats:
    """The tangential part of forces or displacements of p nodes: (p,), in 3D (p, 2)."""
    return values[p:] if len(values) == 2 * p else values[p:].reshape(2, p).T


def index_sum(indices: Iterable[int | None]) -> int | None:
    """The sum of indices; None where one is not known."""
    known = list(indices)
    return None if None in known else sum(index for index in known if index is not None)


#: Kinds of vertices at which branches are cut.
CUTS = (VertexKind.BIFURCATION, VertexKind.FAMILY, VertexKind.SHEET, VertexKind.UNSETTLED)


@dataclass(frozen=True, eq=False, kw_only=True)
class Vertex(ContactState):
    """A connected set of solutions at one critical alpha, where arcs begin and end.

    Attributes
    ----------
    number : int
        Its place in ``graph.vertices``, which are in the order of alpha.
    alpha : float
        Rounded from ``exact``.
    kind : VertexKind
        "transition", "fold", "bifurcation", "family", "sheet", "touch", "point", "terminal", "unsettled", "broken",
        "bound" or "end".
    border : bool
        It lies at the first or last alpha.
    statuses, active, lambda_n, lambda_t, u_n, u_t
        As in Root. For a family, ``active`` holds every status that occurs on it, and the arrays belong to one point.
    family : RootFamily or None
    index_left, index_right : int or None
        Sums of the indices of the arcs that end and begin here; equal inside the interval (balance of degrees), but for
        a vertex at a bound. None where one is not known, or not all arcs.
    selections : tuple of status codes that hold here
    exact : CriticalAlpha
    bounded : bool
        Of a body that nothing holds: a solution in it is at the bound of its rigid displacement.
    """

    number: int
    alpha: float
    kind: VertexKind
    border: bool
    family: RootFamily | None
    index_left: int | None
    index_right: int | None
    selections: tuple[Codes, ...] = field(repr=False)
    exact: CriticalAlpha = field(repr=False)
    bounded: bool = field(default=False, repr=False)

    @property
    def enclosure(self) -> tuple[Fraction, Fraction]:
        """Rational bounds on alpha, equal where it is known exactly.

        They are less than a unit in its last place apart, except for a vertex in balls of double arithmetic (a problem
        of more than 250 degrees of freedom) and one that was left open.
        """
        return self.exact.enclosure()


class ArcValues(Protocol):
    """lambda and w of a selection's solutions."""

    def at(self, alpha: Fraction) -> Pair:
        """At an alpha of the arc; beside its rounded ends, those of a point on it."""

    def record(self) -> dict[str, Any]:
        """Entries that a file needs besides the selection and an alpha inside the arc."""
        return {}


@dataclass(frozen=True, eq=False, kw_only=True)
class Arc:
    """All solutions of one selection between two neighbouring critical alphas, one for every alpha (many on a sheet).

    Attributes
    ----------
    number : int
        Its place in ``graph.arcs``.
    statuses : tuple of p ContactStatus
        Those of the first selection where several coincide (grazing). At a node in contact with F = 0 throughout the
        sign of u_t at the middle of the arc names the slip.
    lo, hi : float
        ``begin`` and ``end``, rounded.
    tail, head : int
        Numbers of the vertices at its lower and upper end.
    index : int or None
        Local degree of its roots.
    dimension : int
        0 for an arc, for a sheet the dimension of its families.
    grazing : bool
        Several selections coincide on it, or it is a sheet: no root on it is regular.
    selections : tuple of status codes
    begin, end : CriticalAlpha
        It was found to hold between them: up to its vertices, or beside a place that ball arithmetic left open (an
        unsettled vertex of which only bounds are known) up to the last alpha where that was shown.
    """

    number: int
    statuses: tuple[ContactStatus, ...]
    lo: float
    hi: float
    tail: int
    head: int
    index: int | None
    dimension: int = 0
    grazing: bool = False
    selections: tuple[Codes, ...] = field(repr=False)
    begin: CriticalAlpha = field(repr=False)
    end: CriticalAlpha = field(repr=False)
    sample: Fraction = field(repr=False)
    _values: ArcValues = field(repr=False)

    @property
    def interval(self) -> tuple[float, float]:
        """(lo, hi)."""
        return self.lo, self.hi

    @property
    def length(self) -> float:
        """hi - lo."""
        return self.hi - self.lo

    def passes_over(self, alpha: CriticalAlpha) -> bool:
        """True if it is known to begin below an alpha and to end above it."""
        return self.begin.compare(alpha) < 0 < self.end.compare(alpha)

    def state(self, alpha: AlphaLike) -> Pair:
        """Forces and displacements at an alpha of the arc, normal ones first; errors as ``values``.

        Both have shape (2p,), in 3D (3p,).
        """
        exact = alpha_value(alpha)
        value = float(exact)
        if self.dimension:
            raise InvalidArgumentError(
                f"arc {self.number} is a sheet and has many solutions at one alpha; use roots_at(alpha).families"
            )
        if not self.lo <= value <= self.hi:
            raise InvalidArgumentError(
                f"alpha is {value:.17g}; expected a value on the arc, [{self.lo!r}, {self.hi!r}]"
            )
        return self._values.at(Fraction(exact))

    def values(self, alpha: AlphaLike) -> Pair:
        """(lambda_n, lambda_t) at an alpha of the arc, arrays of shape (p,), in 3D (p,) and (p, 2) [force].

        Exact, then rounded, on a graph whose ``arcs_by`` is "exact"; else in double arithmetic.

        Raises
        ------
        InvalidArgumentError
            alpha is outside the arc, or the arc is a sheet.
        """
        forces, p = self.state(alpha)[0], len(self.statuses)
        return forces[:p], tangential(forces, p)

    def displacements(self, alpha: AlphaLike) -> Pair:
        """(u_n, u_t) at an alpha of the arc, of the shapes of ``values`` [length]; errors as there."""
        moves, p = self.state(alpha)[1], len(self.statuses)
        return moves[:p], tangential(moves, p)

    def sampled(self, count: int = 33) -> Floats:
        """Values of alpha along the arc, denser towards its ends (Chebyshev points), ends included."""
        points = 0.5 * (1 - np.cos(np.linspace(0.0, np.pi, count)))
        alphas = self.lo + points * (self.hi - self.lo)
        alphas[-1] = self.hi
        return np.unique(np.clip(alphas, self.lo, self.hi))


@dataclass(frozen=True, eq=False)
class Component:
    """A connected component of the graph.

    Attributes
    ----------
    number : int
    vertices : tuple of Vertex
    arcs : tuple of Arc
    """

    number: int
    vertices: tuple[Vertex, ...]
    arcs: tuple[Arc, ...]

    @property
    def interval(self) -> tuple[float, float]:
        """Smallest and largest alpha on it."""
        return self.vertices[0].alpha, self.vertices[-1].alpha


@dataclass(frozen=True, eq=False)
class Branch:
    """A path or closed loop of arcs: a part of a component that is cut at bifurcations, families and sheets.

    Attributes
    ----------
    number : int
    arcs : tuple of Arc
        In the order in which the branch runs through them.
    vertices : tuple of Vertex
        Passed on the way, ends included: one more than arcs, or as many when it is closed.
    component : int
        Number of its component.
    closed : bool
    """

    number: int
    arcs: tuple[Arc, ...]
    vertices: tuple[Vertex, ...]
    component: int
    closed: bool

    @property
    def interval(self) -> tuple[float, float]:
        """Smallest and largest alpha on it."""
        return min(arc.lo for arc in self.arcs), max(arc.hi for arc in self.arcs)

    @property
    def folds(self) -> tuple[Vertex, ...]:
        """Its folds, in the order in which it runs through them."""
        return tuple(vertex for vertex in self.vertices if vertex.kind is VertexKind.FOLD)

    @property
    def sheet(self) -> bool:
        """True if it is a sheet."""
        return any(arc.dimension for arc in self.arcs)


def shape_of(branch: Branch) -> str:
    """Shape of a branch in a word: sheet, loop, path, or unfinished where something at it was left open."""
    if branch.sheet or branch.closed:
        return "sheet" if branch.sheet else "loop"
    return "unfinished" if any(v.kind is VertexKind.UNSETTLED for v in branch.vertices) else "path"


#: What networkx's graph shows of vertices and arcs.
_NODE_DATA = ("alpha", "kind", "border", "statuses", "active", "lambda_n", "lambda_t", "index_left", "index_right")
_EDGE_DATA = ("statuses", "index", "dimension", "values")


#: The arcs on the left and on the right of a vertex.
Sides = tuple[list[Arc], list[Arc]]


def sides_of(arcs: Sequence[Arc], count: int) -> list[Sides]:
    """The arcs on both sides of every vertex."""
    sides: list[Sides] = [([], []) for _ in range(count)]
    for arc in arcs:
        sides[arc.head][0].append(arc)
        sides[arc.tail][1].append(arc)
    return sides


def make_vertex(
    number: int,
    alpha: CriticalAlpha,
    sides: Sides,
    state: Pair,
    names: Sequence[frozenset[ContactStatus]],
    selections: Sequence[Codes],
    *,
    border: bool,
    settled: bool,
    bounded: bool = False,
    family: RootFamily | None = None,
) -> Vertex:
    """A vertex with the kind and the degrees that the arcs on its sides give it, if all of these are known.

    Parameters
    ----------
    state : forces and displacements, (2p,) arrays, in 3D (3p,)
    names : the statuses that hold at every node
    bounded : it reaches a bound of the rigid displacement, beyond which arcs are not known
    """
    p, (forces, w) = len(names), state
    dimension = 0 if family is None else family.dimension
    kind = VertexKind.UNSETTLED
    if settled:
        kind = vertex_kind(*sides, border=border, dimension=dimension, bounded=bounded)
    left, right = map(degree_of, sides) if settled else (None, None)
    return Vertex(
        number=number,
        alpha=float(alpha),
        kind=kind,
        border=border,
        statuses=tuple(next(status for status in ContactStatus if status in held) for held in names),
        active=tuple(names),
        lambda_n=forces[:p],
        lambda_t=tangential(forces, p),
        u_n=w[:p],
        u_t=tangential(w, p),
        family=family,
        index_left=left,
        index_right=right,
        selections=tuple(selections),
        exact=alpha,
        bounded=bounded,
    )


def with_exact_zeros(state: Pair, active: Sequence[Set[int]]) -> Pair:
    """Forces and displacements with exact zeros where the statuses say so."""
    (forces, w), p = state, len(active)
    for i, codes in enumerate(active):
        if OPEN in codes:
            forces[i::p] = 0.0
        if codes - {OPEN}:
            w[i] = 0.0
        if STICK in codes or {SLIP_PLUS, SLIP_MINUS} <= codes:
            w[p + i :: p] = 0.0
    return forces + 0.0, w + 0.0


def degree_of(arcs: Sequence[Arc]) -> int | None:
    """Sum of the indices; None where one is not known."""
    return index_sum(arc.index for arc in arcs)


def vertex_kind(
    left: Sequence[Arc], right: Sequence[Arc], *, border: bool, dimension: int, bounded: bool = False
) -> VertexKind:
    """Kind of a settled vertex, by the arcs that end there from the left and begin there to the right."""
    if any(arc.dimension for arc in (*left, *right)):
        return VertexKind.SHEET
    if dimension:
        return VertexKind.FAMILY
    if border:
        return VertexKind.END
    if bounded:
        return VertexKind.BOUND
    degrees = degree_of(left), degree_of(right)
    if None not in degrees and degrees[0] != degrees[1]:
        return VertexKind.BROKEN
    match len(left), len(right):
        case 1, 1:
            same = left[0].selections == right[0].selections
            return VertexKind.TOUCH if same else VertexKind.TRANSITION
        case 0, 0:
            return VertexKind.POINT
        case (1, 0) | (0, 1):
            return VertexKind.TERMINAL
        case (2, 0) | (0, 2):
            return VertexKind.FOLD
    return VertexKind.BIFURCATION


def multigraph(vertices: Sequence[Vertex], arcs: Sequence[Arc]) -> Any:
    """The networkx.MultiGraph, frozen: vertices by number, arcs as edges keyed by their number."""
    graph = nx.MultiGraph()
    for v in vertices:
        graph.add_node(v.number, **{name: getattr(v, name) for name in _NODE_DATA}, vertex=v)
    for arc in arcs:
        shown = {name: getattr(arc, name) for name in _EDGE_DATA}
        graph.add_edge(arc.tail, arc.head, key=arc.number, alpha=arc.interval, **shown, arc=arc)
    return nx.freeze(graph)


def make_components(graph: nx.MultiGraph, vertices: Sequence[Vertex], arcs: Sequence[Arc]) -> tuple[Component, ...]:
    """Connected components in the order of their first vertex."""
    groups = sorted((sorted(group) for group in nx.connected_components(graph)), key=lambda group: group[0])
    place = {v: k for k, group in enumerate(groups) for v in group}
    return tuple(
        Component(k, tuple(vertices[v] for v in group), tuple(arc for arc in arcs if place[arc.tail] == k))
        for k, group in enumerate(groups)
    )


def make_branches(components: Sequence[Component], vertices: Sequence[Vertex]) -> tuple[Branch, ...]:
    """Components cut at bifurcations, families and sheets; every sheet is a branch of its own."""
    found: list[Branch] = []
    for component in components:
        at: dict[int, list[Arc]] = {}
        for arc in component.arcs:
            at.setdefault(arc.tail, []).append(arc)
            at.setdefault(arc.head, []).append(arc)

        def cut(number: int, arcs_at: dict[int, list[Arc]] = at) -> bool:
            return vertices[number].kind in CUTS or len(arcs_at[number]) != 2

        left = set(component.arcs)
        # open branches from their ends first, what then remains is closed
        starts = [(v, arc) for v in at if cut(v) for arc in at[v]]
        starts += [(arc.tail, arc) for arc in component.arcs]
        for start, first in starts:
            if first not in left:
                continue
            run, passed, here, arc = [], [start], start, first
            while arc in left:
                left.remove(arc)
                run.append(arc)
                here = arc.head if here == arc.tail else arc.tail
                passed.append(here)
                if cut(here):
                    break
                arc = next((other for other in at[here] if other in left), arc)
            closed = passed[0] == passed[-1] and not cut(start)
            along = tuple(vertices[v] for v in (passed[:-1] if closed else passed))
            found.append(Branch(len(found), tuple(run), along, component.number, closed))
    return tuple(found)


_Item = TypeVar("_Item")

END_ELSEWHERE = "an interval that ends elsewhere decides it"
ANOTHER_INTERVAL = "another interval, or data that differ by a little, may decide it"
SHORT_INTERVAL = "a graph over a short interval around it may decide it"
MORE_TIME, MORE_NODES = "more time may decide it", "more nodes may decide it"
TOLD_APART = "data that differ by a little may tell it apart"
FEWER = "data that differ by a little may leave fewer"
#: Of what contradicts the search.
DEFECT = 'arithmetic="verified" decides it if the search was "fast"; otherwise this is a defect: please report it'


def named(codes: Codes) -> str:
    """A selection as text, with the statuses of its nodes in their order."""
    return f"the selection {summary([contact_status(code, 0.0) for code in codes])}"


@dataclass(frozen=True)
class Effort:
    """Bounds of the work on arcs.

    Attributes
    ----------
    tick : callable, optional
    limits : Deadline
        What is not worked out by this deadline is left out.
    ended : StopReason, optional
        Reason for a bound of the work: the call was ended, and only little more of what it found is worked out.
    most : int, optional
        Nothing more is begun after so much.
    """

    tick: Tick | None = None
    limits: Deadline = field(default_factory=Deadline)
    ended: StopReason | None = None
    most: int | None = None

    def over(
        self, items: Sequence[_Item], together: int, work: Callable[[Sequence[_Item]], object], done: Callable[[], int]
    ) -> StopReason | None:
        """Reason why not all items were worked out, so many together; None where they were.

        ``done`` gives how much there is, in the unit of ``most``.
        """
        for first in range(0, len(items), together):
            group = items[first : first + together]
            if self.most is not None and done() >= self.most:
                return self.ended
            try:
                with within(self.limits):
                    look()
                    work(group)
            except TimeOverError:
                return self.ended or StopReason.TIME_LIMIT
            if self.tick is not None:
                self.tick((first + len(group)) / len(items))
        return self.ended if self.most == 0 else None
