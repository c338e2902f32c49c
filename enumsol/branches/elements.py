"""What a branch graph is made of: vertices, arcs, components and branches (theory, section 7.11)."""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.roots.root import ContactState
from enumsol.support.arguments import alpha_value
from enumsol.support.messages import TextEnum

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from enumsol.arithmetic.algebraic import CriticalAlpha
    from enumsol.model.statuses import ContactStatus
    from enumsol.roots.root import RootFamily
    from enumsol.selections.solution import Codes
    from enumsol.support.arguments import AlphaLike

    #: Forces and displacements, arrays of length 2p, in 3D of length 3p: all normals first.
    Pair = tuple[NDArray[np.float64], NDArray[np.float64]]


class VertexKind(TextEnum):
    """What a vertex is; members compare with their texts: ``vertex.kind == "fold"``."""

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


def tangential(values: NDArray[np.float64], p: int) -> NDArray[np.float64]:
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
        """What a file needs besides the selection and an alpha inside the arc."""
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
        """Whether it is known to begin below an alpha and to end above it."""
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

    def sampled(self, count: int = 33) -> NDArray[np.float64]:
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
        """Whether it is a sheet."""
        return any(arc.dimension for arc in self.arcs)
