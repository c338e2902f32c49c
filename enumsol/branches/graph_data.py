"""Data of a branch graph, and its text and tables (theory, section 7)."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import groupby
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from enumsol.arithmetic.algebraic import CriticalAlpha
from enumsol.arithmetic.rationals import rational
from enumsol.branches.claims import Claims, Standing, ranges_text
from enumsol.branches.elements import VertexKind, make_branches, make_components, multigraph, shape_of
from enumsol.errors import InvalidArgumentError
from enumsol.roots.root_set import ABOUT_STABILITY, by_axis
from enumsol.support.arguments import alpha_value
from enumsol.support.immutable import Immutable, Listed
from enumsol.support.messages import PRINTED, counted, html_lines, html_table

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    import pandas as pd

    from enumsol.branches.elements import Arc, Branch, Component, Vertex
    from enumsol.branches.stability import Span
    from enumsol.condensation.exact import ExactCondensed
    from enumsol.proof.proof_file import Proof
    from enumsol.search.subintervals import SearchedPiece
    from enumsol.support.array_types import AlphaLike


@dataclass(frozen=True)
class GraphStats:
    """Counts and times of the construction.

    Attributes
    ----------
    pieces : int
        Parts of the interval that were looked at; each is searched by a tree of its own, closed, or cut in halves.
    closed : int
        Of these, pieces without a tree: one branch is proven to hold all their solutions (theory, section 7.15).
    nodes : int
        Nodes of all trees.
    selections : int
        Complete selections whose arcs were computed.
    bounded : int
        Of a body that nothing holds, pieces whose proof rests, or may rest, on the bound of its rigid displacement.
    search_seconds, seconds : float
        Wall time of the search, and of everything.
    """

    pieces: int = 0
    closed: int = 0
    nodes: int = 0
    selections: int = 0
    bounded: int = 1
    search_seconds: float = 0.0
    seconds: float = 0.0


@dataclass(eq=False, repr=False)
class GraphData(Immutable):
    """Vertices and arcs over an interval, where they come from, and what they are parts of; see BranchGraph.

    A way of working out a graph (``ways``) makes one, without the times.

    Attributes
    ----------
    problem : ContactProblem or ContactProblem3D
    exact : ExactCondensed or None
        The condensed problem in rationals, on which the arcs rest; None where they were followed in ball arithmetic.
    exact_interval : (Fraction, Fraction)
    arithmetic : str
    vertices : tuple of Vertex
        In the order of alpha.
    arcs : tuple of Arc
    undecided : tuple of str
        What search and gluing left out or could not decide.
    stats : GraphStats
    pieces : tuple of SearchedPiece
        Not kept in files.
    make_proof : callable or None
        Makes the proof; not kept in files.
    left_open : tuple of (Fraction, Fraction), or None
        Ranges of alpha, in order, outside of which nothing of what is undecided is missing; None where that is not
        known.
    """

    problem: Any
    exact: ExactCondensed | None
    exact_interval: tuple[Fraction, Fraction]
    arithmetic: str
    vertices: tuple[Vertex, ...]
    arcs: tuple[Arc, ...]
    undecided: tuple[str, ...]
    stats: GraphStats
    pieces: tuple[SearchedPiece, ...] = ()
    make_proof: Callable[[], Proof | None] | None = None
    left_open: tuple[tuple[Fraction, Fraction], ...] | None = None

    def __post_init__(self) -> None:
        self.vertices = Listed(self.vertices, "vertex", "vertices")
        self.arcs = Listed(self.arcs, "arc")
        self._freeze()

    @cached_property
    def proof(self) -> Proof | None:
        """The proof, made when it is first asked for; None when there is none."""
        return None if self.make_proof is None else self.make_proof()

    @property
    def interval(self) -> tuple[float, float]:
        """First and last alpha, rounded."""
        return float(self.exact_interval[0]), float(self.exact_interval[1])

    @property
    def certified_data(self) -> str:
        """Subject of completeness: "problem" (A, Bn, Bt, f as given) or "condensed" (S and g as computed)."""
        return "problem" if self.exact is None or self.exact.condensed_exactly else "condensed"

    @property
    def arcs_by(self) -> str:
        """Way in which arcs were followed: "exact" (functions of alpha in rationals) or "balls"."""
        return "balls" if self.exact is None else "exact"

    @property
    def complete(self) -> bool:
        """True if it is proven that no solution is missing: proven leaves, nothing undecided, degrees balanced."""
        return self.arithmetic != "fast" and not self.reasons

    @cached_property
    def reasons(self) -> tuple[str, ...]:
        """Why the graph is not complete: what was left out, and what contradicts the balance of degrees."""
        return (*self.undecided, *self.gaps)

    @cached_property
    def claims(self) -> Claims:
        """Knowledge of the number of solutions: exact counts, or lower bounds for a graph with gaps."""
        whole = Standing.PROVEN if self.complete else Standing.NOT_PROVEN
        standing = Standing.INCOMPLETE if self.reasons else whole
        # what contradicts itself may be wrong anywhere
        known = None if self.gaps else self.left_open
        held = self.problem.held
        return Claims(self.vertices, self.arcs, self.exact_interval, standing, held=held, open_ranges=known)

    @property
    def open_ranges(self) -> tuple[tuple[Fraction, Fraction], ...]:
        """Ranges of alpha in which solutions may be missing, in order; of a graph without gaps none.

        At every other alpha all solutions are known, so that ``multiplicity_at`` and ``roots_at`` give all of them. In
        2D, and where nothing is known about where something is missing, a graph with gaps has one: the interval.
        """
        return self.claims.open_ranges

    @property
    def closing_line(self) -> str:
        """The closing line of the printed summary: whether the graph is complete, and of what, or why not."""
        if self.reasons:
            more = f"; {counted(len(self.reasons) - 1, 'more reason')}" if len(self.reasons) > 1 else ""
            return f"complete: no ({self.reasons[0]}{more})"
        if not self.complete:
            return "complete: not proven (degrees balance at every vertex)"
        about = "" if self.certified_data == "problem" else " for S and g as computed"
        if not self.problem.held and self.stats.bounded:
            about = f", within rigid displacements of {self.problem.rigid_reach:g}"
        return f"complete: yes (proven{about})"

    # -- parts -----------------------------------------------------------------------------------------------------

    @cached_property
    def graph(self) -> Any:
        """The networkx.MultiGraph of vertices and arcs."""
        return multigraph(self.vertices, self.arcs)

    @cached_property
    def components(self) -> tuple[Component, ...]:
        """Connected components of what was found, in the order of their smallest alpha."""
        return Listed(make_components(self.graph, self.vertices, self.arcs), "component")

    @cached_property
    def branches(self) -> tuple[Branch, ...]:
        """Components cut at bifurcations, families and sheets: paths and closed loops of arcs, and sheets."""
        return Listed(make_branches(self.components, self.vertices), "branch", "branches")

    @cached_property
    def branch_of(self) -> Mapping[int, int]:
        """Number of the branch of every arc, by the arc's number."""
        return MappingProxyType({arc.number: branch.number for branch in self.branches for arc in branch.arcs})

    @cached_property
    def _found(self) -> dict[str, list[tuple[Span, ...]]]:
        """Findings about the arcs, arc by arc; they may be cut short."""
        return {}

    @property
    def verdicts(self) -> tuple[tuple[Span, ...], ...] | None:
        """Verdicts that `BranchGraph.stability` found last, or those of a file; None if not asked for, or cut short."""
        found = self._found.get("verdicts")
        if found is None or len(found) < len(self.arcs):
            found = self._found.get("read")
        return None if found is None else tuple(found)

    @property
    def verdicts_read(self) -> bool:
        """True if ``verdicts`` are those of a file, which nothing has checked."""
        return "read" in self._found and len(self._found.get("verdicts", [])) < len(self.arcs)

    def inside(self, alpha: AlphaLike) -> Fraction:
        """An alpha of the interval."""
        value, (low, high) = Fraction(alpha_value(alpha)), self.exact_interval
        if low <= value <= high:
            return value
        raise InvalidArgumentError(
            f"alpha is {float(value):.17g}; expected a value in the graph's interval [{float(low):g}, {float(high):g}]"
        )

    def located(self, alpha: AlphaLike) -> tuple[list[Arc], list[Vertex], list[Vertex]]:
        """Arcs over an alpha, vertices at it, and vertices whose bounds are too wide to tell on which side it lies."""
        point = CriticalAlpha.rational(rational(self.inside(alpha)))
        arcs = [arc for arc in self.arcs if arc.passes_over(point)]
        equal = [v for v in self.vertices if v.exact.compare(point) == 0]
        known = [v for v in equal if v.exact.is_rational]
        return arcs, known, [v for v in equal if v not in known]

    @cached_property
    def gaps(self) -> tuple[str, ...]:
        """Violations of the balance of degrees, and vertices that are not settled (theory, (7.3)).

        Each of them proves that something is missing. Of a body that nothing holds, degrees balance only where its
        rigid displacement is within its bounds, and there is no sum that they must have (theory, section 14.8).
        """
        found, first = [], float(self.exact_interval[0])
        unsettled = sum(v.kind is VertexKind.UNSETTLED for v in self.vertices)
        if unsettled and not self.undecided:
            found.append(f"selections that were not examined hold at {unsettled} of {len(self.vertices)} vertices")
        for v in self.vertices:
            if v.kind is VertexKind.UNSETTLED:
                continue
            if v.bounded:
                continue  # beyond the bound nothing is known
            if v.index_left is None or v.index_right is None:
                # where a body slides it may be that of a continuum that reaches the bound
                if not self.problem.held:
                    continue
                found.append(f"vertex {v.number} at alpha = {v.alpha:.17g}: the degree of an arc is not known")
            elif not v.border and v.index_left != v.index_right:
                found.append(
                    f"vertex {v.number} at alpha = {v.alpha:.17g} ({v.kind}): degrees {v.index_left:+d} from the left "
                    f"and {v.index_right:+d} to the right do not balance"
                )
        start = [v.index_right for v in self.vertices if v.border and v.alpha == first]
        total = sum(k for k in start if k is not None)
        if self.problem.held and not self.undecided and None not in start and total != 1:
            found.append(f"the degrees of all arcs at alpha = {first:g} sum to {total:+d} and not to +1")
        return tuple(found)


#: Verdicts of stability, in the order of legends.
VERDICTS = ("does not run away", "runs away", "undecided")


def verdict_words(data: GraphData) -> tuple[str, ...]:
    """The verdicts along every arc, one or several in turn; none where they are not known."""
    return tuple(map(_in_turn, data.verdicts or ()))


def _in_turn(spans: Sequence[Span]) -> str:
    """The verdicts along an arc; an undecided range in which one changes to the other is not told."""
    decided = [verdict for verdict, _ in groupby(span.verdict for span in spans if span.verdict != VERDICTS[2])]
    if not decided:
        return VERDICTS[2]
    left = sum(span.verdict == VERDICTS[2] for span in spans) > len(decided) - 1
    return ", then ".join(decided) + (", partly undecided" if left else "")


def branch_stability(data: GraphData, branch: Branch) -> str:
    """The verdicts along the arcs of a branch, and of how many arcs where they differ."""
    words = verdict_words(data)
    kinds = Counter(words[arc.number] for arc in branch.arcs)
    if len(kinds) == 1:
        return next(iter(kinds))
    return "; ".join(f"{verdict} ({counted(count, 'arc')})" for verdict, count in sorted(kinds.items()))


def about_stability(data: GraphData) -> str:
    """The line that says what verdicts are, and whether they are proven."""
    read = "stability: as the file of this graph says, which nothing has checked; graph.stability() finds it again"
    return read if data.verdicts_read else ABOUT_STABILITY


def graph_text(data: GraphData) -> str:
    """Counts, a line a branch, and whether the graph is complete."""
    lines = [*_heading(data), *(_branch_line(data, branch) for branch in data.branches[:PRINTED])]
    if len(data.branches) > PRINTED:
        lines.append(f"  ... {len(data.branches) - PRINTED} more branches")
    lines += [f"  {about_stability(data)}"] if data.verdicts is not None else []
    lines += _left_open(data)
    return "\n".join([*lines, data.closing_line])


def graph_html(data: GraphData) -> str:
    """HTML of the graph for a notebook."""
    rows = [
        (
            branch.number,
            shape_of(branch),
            len(branch.arcs),
            *(f"{end:.6g}" for end in branch.interval),
            ", ".join(f"{v.alpha:.6g}" for v in branch.folds),
            *(() if data.verdicts is None else (branch_stability(data, branch),)),
        )
        for branch in data.branches[:PRINTED]
    ]
    more = len(data.branches) - PRINTED
    heads = ("branch", "shape", "arcs", "alpha from", "to", "folds at")
    table = html_table(heads if data.verdicts is None else (*heads, "stability"), rows) if rows else ""
    closing = [*([f"... {more} more branches"] if more > 0 else []), *_left_open(data), data.closing_line]
    closing[:0] = [about_stability(data)] if data.verdicts is not None else []
    return html_lines(_heading(data)) + table + html_lines(closing)


def _heading(data: GraphData) -> list[str]:
    kinds = Counter(v.kind for v in data.vertices)
    numbers = ", ".join(f"{kinds[kind]} {kind}" for kind in VertexKind if kinds[kind])
    a, b = data.interval
    found = "" if data.claims.whole else ", not complete; of what was found:"
    return [
        f"BranchGraph for alpha in [{a:g}, {b:g}] ({data.arithmetic}){found}",
        f"  components {len(data.components)}, branches {len(data.branches)}, arcs {len(data.arcs)}",
        f"  vertices {len(data.vertices)}" + (f": {numbers}" if numbers else ""),
    ]


def _left_open(data: GraphData) -> list[str]:
    return [f"  left open: {ranges_text(data.open_ranges)}"] if data.claims.partly else []


def _branch_line(data: GraphData, branch: Branch) -> str:
    lo, hi = branch.interval
    folds = ", ".join(f"{v.alpha:.6g}" for v in branch.folds)
    width = f", length {hi - lo:.3g}" if f"{lo:.6g}" == f"{hi:.6g}" else ""
    arcs = counted(len(branch.arcs), "arc")
    return (
        f"  branch {branch.number}: {shape_of(branch)}, {arcs}, alpha in [{lo:.6g}, {hi:.6g}]{width}"
        + (f", folds at {folds}" if folds else "")
        + ("" if data.verdicts is None else f"\n    stability: {branch_stability(data, branch)}")
    )


def arcs_frame(data: GraphData) -> pd.DataFrame:
    """Table with a row for each arc: branch, component, ends and their kinds, index, dimension and statuses by node.

    Once ``stability`` was asked for, a column has the verdict, or several in the order of alpha.
    """
    import pandas as pd

    words = verdict_words(data)
    place = {arc.number: c.number for c in data.components for arc in c.arcs}
    rows = [
        {
            "arc": arc.number,
            "branch": data.branch_of[arc.number],
            "component": place[arc.number],
            "alpha_from": arc.lo,
            "alpha_to": arc.hi,
            "vertex_from": arc.tail,
            "vertex_to": arc.head,
            "kind_from": data.vertices[arc.tail].kind.value,
            "kind_to": data.vertices[arc.head].kind.value,
            "index": arc.index,
            **({"stability": words[arc.number]} if words else {}),
            "dimension": arc.dimension,
            "grazing": arc.grazing,
            "statuses": " ".join(s.value for s in arc.statuses),
        }
        for arc in data.arcs
    ]
    return pd.DataFrame(rows)


def vertices_frame(data: GraphData) -> pd.DataFrame:
    """Table with a row for each vertex and contact node: alpha, kind, statuses that hold, and values."""
    import pandas as pd

    rows = [
        {
            "vertex": v.number,
            "alpha": v.alpha,
            "kind": v.kind.value,
            "node": node,
            "active": " ".join(sorted(s.value for s in v.active[i])),
            **{
                column: part[i]
                for name in ("lambda_n", "lambda_t", "u_n", "u_t")
                for column, part in by_axis(name, getattr(v, name))
            },
            "index_left": v.index_left,
            "index_right": v.index_right,
        }
        for v in data.vertices
        for i, node in enumerate(data.problem.node_ids)
    ]
    return pd.DataFrame(rows)
