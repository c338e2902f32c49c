"""BranchGraph: all solutions over an interval of alpha, and the questions it answers (theory, section 7.11)."""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any

from enumsol.branches.claims import Multiplicity, MultiplicitySteps, uniqueness_bound
from enumsol.branches.elements import Arc, Branch, Vertex, VertexKind
from enumsol.branches.figures.graph_plots import plot_graph
from enumsol.branches.graph_data import GraphData, arcs_frame, graph_html, graph_text, vertices_frame
from enumsol.branches.graph_files import load_graph, save_graph, write_graphml
from enumsol.branches.roots_at import roots_at, roots_on
from enumsol.errors import IncompleteGraphError, InvalidArgumentError
from enumsol.support.arguments import alpha_value

if TYPE_CHECKING:
    from pathlib import Path

    import scipy.sparse as sp

    from enumsol.branches.stability import Span
    from enumsol.roots.root import Root, RootFamily
    from enumsol.support.array_types import AlphaLike, ArrayLike


class BranchGraph(GraphData):
    """All solutions over an interval of alpha: arcs of single selections, glued at vertices (made by ``branch_graph``).

    A graph with ``reasons`` is not complete. It shows what was found, and every part of it is true: arcs are solutions,
    and a vertex has a kind only where everything that meets there is known (it is "unsettled" otherwise). What needs
    the whole graph (``steps``, ``uniqueness_limit``; ``multiplicity_at`` in ``open_ranges``) raises
    IncompleteGraphError then; ``at_least`` and ``claims`` give what is known.

    Attributes
    ----------
    problem : ContactProblem or ContactProblem3D
    interval, exact_interval : (float, float), (Fraction, Fraction)
    arithmetic, arcs_by, certified_data : str
        How leaves were decided; how arcs were followed, "exact" (functions of alpha in rationals) or "balls"; and what
        completeness is about, "problem" (A, Bn, Bt, f as given) or "condensed" (S and g as computed).
    complete : bool
        Whether it is proven that no solution is missing.
    claims : Claims
        What is known about the number of solutions.
    vertices : tuple of Vertex
        In the order of alpha.
    arcs : tuple of Arc
    graph : networkx.MultiGraph
        Nodes are the numbers of vertices (attributes alpha, kind, statuses, ..., vertex), edges the arcs, keyed by
        their numbers (attributes statuses, alpha, index, values, ..., arc).
    components, branches : tuples of Component, and of Branch
        Connected components, and the parts of them if they are cut at bifurcations, families and sheets.
    branch_of : mapping
        Number of the branch of every arc, by the arc's number.
    reasons : tuple of str
        Why the graph is not complete: what was left out, stayed undecided or contradicts the balance of degrees.
    open_ranges : tuple of (Fraction, Fraction)
        Ranges of alpha in which solutions may be missing; at every other alpha all are known.
    stats : GraphStats
    pieces : tuple of SearchedPiece
        The search's leaves with their multipliers, piece by piece of the interval (empty after ``load``).
    proof : Proof or None
        In verified arithmetic: the search's leaves and the arcs of the surviving selections, for ``enumsol.verify``
        (None after ``load``, for a search that was cut short, where rationals had to decide about leaves, and without
        any load, where no search is needed: lambda = 0 by (5.3)).

    Examples
    --------
    >>> import enumsol
    >>> graph = enumsol.branch_graph(enumsol.gallery.two_node_square(), (0, 10))
    >>> graph.uniqueness_limit, graph.multiplicity_at(3.5), len(graph.folds)
    (3.0, 5, 3)
    """

    def _whole(self, name: str, instead: str, alpha: Fraction | None = None) -> None:
        """Refuse a statement about all solutions, at one alpha or all, unless nothing is known to be missing."""
        if not (self.claims.whole if alpha is None else self.claims.knows(alpha)):
            raise IncompleteGraphError(f"{name} is not known: the graph is not complete ({self.reasons[0]}); {instead}")

    # -- parts -----------------------------------------------------------------------------------------------------

    def _of_kind(self, kind: VertexKind) -> tuple[Vertex, ...]:
        return tuple(v for v in self.vertices if v.kind is kind)

    @property
    def transitions(self) -> tuple[Vertex, ...]:
        """Vertices at which one arc goes on as another on the other side."""
        return self._of_kind(VertexKind.TRANSITION)

    @property
    def folds(self) -> tuple[Vertex, ...]:
        """Vertices at which two arcs meet on one side: alpha turns back."""
        return self._of_kind(VertexKind.FOLD)

    @property
    def bifurcations(self) -> tuple[Vertex, ...]:
        """Isolated points where other numbers of arcs meet, and families inside the interval that arcs reach."""
        reached = {v for arc in self.arcs for v in (arc.tail, arc.head)}
        return tuple(
            v
            for v in self.vertices
            if v.kind is VertexKind.BIFURCATION
            or (v.kind is VertexKind.FAMILY and not v.border and v.number in reached)
        )

    @cached_property
    def families(self) -> tuple[RootFamily, ...]:
        """Continua of solutions at single alphas (vertical arcs); those of sheets are found by ``roots_at``."""
        return tuple(v.family for v in self._of_kind(VertexKind.FAMILY) if v.family is not None)

    @property
    def sheets(self) -> tuple[Arc, ...]:
        """Families over an interval of alpha."""
        return tuple(arc for arc in self.arcs if arc.dimension)

    @property
    def jumps(self) -> tuple[Vertex, ...]:
        """Settled vertices that no arc leaves to the right: with increasing alpha a branch must be left there.

        Those at a bound of the rigid displacement are left out.
        """
        tails = {arc.tail for arc in self.arcs}
        heads = {arc.head for arc in self.arcs}
        return tuple(
            v
            for v in self.vertices
            if not (v.border or v.bounded or v.kind is VertexKind.UNSETTLED)
            and v.number in heads
            and v.number not in tails
        )

    # -- solutions at one alpha ------------------------------------------------------------------------------------

    def arcs_at(self, alpha: AlphaLike) -> tuple[Arc, ...]:
        """Arcs and sheets that pass over an alpha inside the interval (vertices at it do not count).

        Raises
        ------
        InvalidArgumentError
            alpha is outside the interval, or cannot be distinguished from a vertex of which only bounds are known.
        """
        arcs, _, near = self.located(alpha)
        if not near:
            return tuple(arcs)
        low, high = map(float, near[0].enclosure)
        raise InvalidArgumentError(
            f"alpha is {float(alpha_value(alpha))!r}, which cannot be told from vertex {near[0].number}, between "
            f"{low!r} and {high!r}; expected another alpha, or roots_at, which solves there"
        )

    roots_at = roots_at

    def multiplicity_at(self, alpha: AlphaLike) -> int:
        """Number of isolated roots and of families at one alpha, together.

        Raises
        ------
        InvalidArgumentError
            alpha is outside the interval.
        IncompleteGraphError
            The graph has gaps, and this alpha is in one of ``open_ranges``; ``at_least`` gives a lower bound.
        """
        found = self._multiplicity(alpha)
        where = f"there are {found} at alpha = {float(alpha_value(alpha)):.8g}"
        self._whole("the number of solutions", where, self.inside(alpha))
        if not found.exact:
            raise IncompleteGraphError(f"the number of solutions is not known so close to a vertex; {where}")
        return found.count

    def at_least(self, alpha: AlphaLike) -> int:
        """Lower bound of the number of isolated roots and families at one alpha, for graphs with gaps too.

        Raises
        ------
        InvalidArgumentError
            alpha is outside the interval.
        """
        return self._multiplicity(alpha).count

    def _multiplicity(self, alpha: AlphaLike) -> Multiplicity:
        found = self.claims.multiplicity(self.inside(alpha))
        if self.claims.knows(self.inside(alpha)) and not found.exact:
            # only the side on which a vertex lies is not known
            roots = self.roots_at(alpha)
            return Multiplicity(max(roots.at_least, found.count), exact=roots.whole)
        return found

    @cached_property
    def _steps(self) -> MultiplicitySteps:
        return self.claims.steps()

    @property
    def steps(self) -> tuple[list[Fraction], list[int], list[int]]:
        """Multiplicity as a step function: critical alphas (rounded), values at them and on the intervals between.

        Raises
        ------
        IncompleteGraphError
            The graph has gaps; ``claims.steps()`` gives lower bounds.
        """
        self._whole("the number of solutions", "claims.steps() gives lower bounds")
        return list(self._steps.alphas), list(self._steps.at), list(self._steps.between)

    # -- answers ---------------------------------------------------------------------------------------------------

    @property
    def uniqueness_limit(self) -> float | None:
        """The critical alpha: there is one solution from the interval's first alpha up to it; None when throughout.

        Raises
        ------
        IncompleteGraphError
            The graph has gaps; ``claims.uniqueness()`` tells what is known.
        """
        found = self.claims.uniqueness()
        several = found.several_by
        known = "no second solution was found" if several is None else f"it is not beyond alpha = {several:.8g}"
        self._whole("up to where the solution is unique", known)
        return found.limit

    @property
    def uniqueness_bound(self) -> float | None:
        """An alpha up to which uniqueness follows without any search (theory, section 5.6), if there is one.

        F^2 lmax((S^-1)_nn) lmax(S_tt) < 1 at every contact node, in 3D for both coefficients; evaluated in floats. None
        for a body that nothing holds.
        """
        return uniqueness_bound(self.problem, self.interval) if self.problem.held else None

    def stability(self, *, mass: ArrayLike | sp.sparray | sp.spmatrix | None = None) -> tuple[tuple[Span, ...], ...]:
        """Which arcs run away: one tuple of ranges of alpha an arc, in their order (see `enumsol.stability`).

        In 2D, where friction does not depend on alpha, an arc has one verdict; in 3D the directions of slip turn along
        an arc. Sheets and grazing arcs are undecided. Printed graphs, tables, figures and files show the verdicts from
        then on, for the last mass that was asked for. Those of a graph that was loaded are as its file says until they
        are asked for. A call that is cut short loses nothing: the next one goes on after the last arc that was done.

        Parameters
        ----------
        mass : (n, n) array_like or sparse, optional
            By default that of the problem.

        Returns
        -------
        tuple of tuples of Span

        Raises
        ------
        InvalidArgumentError
            There is no mass.
        InvalidProblemError
            The mass cannot be used.

        Examples
        --------
        >>> import enumsol
        >>> graph = enumsol.branch_graph(enumsol.gallery.one_node_triangle(), (0, 3))
        >>> [[span.verdict for span in spans] for spans in graph.stability()]
        [['does not run away'], ['does not run away'], ['runs away']]
        """
        from enumsol.branches.stability import ArcStabilities  # sparse graphs and solvers come with it

        if mass is not None or self.verdicts is None or self.verdicts_read:
            asked = ArcStabilities(self.problem, mass)
            found = self._found.setdefault("verdicts", []) if mass is None else []
            for arc in self.arcs[len(found) :]:
                found.append(asked.spans(arc, self.arcs))
            self._found["verdicts"] = found
        return self.verdicts or ()

    def _told(self) -> dict[str, Any]:
        """The verdicts in a summary."""
        spans = [list(map(asdict, spans)) for spans in self.verdicts or ()]
        return {"stability": spans, "stability_read": self.verdicts_read}

    def starting_point(self, branch: Branch) -> Root | None:
        """A regular root in the middle of the branch's longest arc; None when there is none at any float alpha."""
        for arc in sorted(branch.arcs, key=lambda arc: -arc.length):
            alpha = 0.5 * (arc.lo + arc.hi)
            if arc.grazing or not arc.lo < alpha < arc.hi:
                continue
            roots = roots_on(self, alpha, [arc])
            if len(roots) and roots[0].regular:
                return roots[0]
        return None

    def starting_points(self) -> tuple[Root, ...]:
        """Regular roots, one on every branch that has any, as starting points of continuation, in order."""
        found = (self.starting_point(branch) for branch in self.branches)
        return tuple(root for root in found if root is not None)

    # -- tables, files and figures ---------------------------------------------------------------------------------

    to_frame = arcs_frame
    vertices_frame = vertices_frame
    save = save_graph
    write_graphml = write_graphml
    plot = plot_graph
    __repr__ = graph_text
    _repr_html_ = graph_html

    @classmethod
    def load(cls, file: str | Path) -> BranchGraph:
        """Read a graph that ``save`` wrote.

        Raises
        ------
        InvalidArgumentError
            The file is not such a graph.
        """
        return load_graph(cls, file)

    def summary(self) -> dict[str, Any]:
        """Counts and answers as plain values, for JSON; what is not known is None.

        Once `stability` was asked for, ``stability`` has its ranges of alpha, arc by arc, and ``stability_read`` tells
        whether they are only those of a file.
        """
        uniqueness, steps = self.claims.uniqueness(), self._steps
        return {
            "interval": list(self.interval),
            "arithmetic": self.arithmetic,
            "complete": self.complete,
            "standing": self.claims.standing.value,
            "reasons": list(self.reasons),
            "open_ranges": [[float(end) for end in ends] for ends in self.open_ranges],
            "components": len(self.components),
            "branches": len(self.branches),
            "arcs": len(self.arcs),
            "vertices": dict(Counter(v.kind.value for v in self.vertices)),
            "folds": [v.alpha for v in self.folds],
            "bifurcations": [v.alpha for v in self.bifurcations],
            "jumps": [v.alpha for v in self.jumps],
            "unique_throughout": uniqueness.throughout,
            "uniqueness_limit": uniqueness.limit,
            "several_solutions_by": uniqueness.several_by,
            "no_solution_by": uniqueness.none_by,
            "uniqueness_bound": self.uniqueness_bound,
            "multiplicity": {
                "exact": steps.exact,
                "alphas": [float(alpha) for alpha in steps.alphas],
                "at": list(steps.at),
                "between": list(steps.between),
            },
            **({} if self.verdicts is None else self._told()),
            "stats": asdict(self.stats),
        }
