"""The RootSet of given selections at one alpha, as enumerate_roots builds it."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, Any

from enumsol.arithmetic.rationals import rational
from enumsol.condensation.data import exactly_at
from enumsol.model.problem import ContactProblem
from enumsol.model.statuses import FRICTIONLESS, OPEN
from enumsol.roots.components import RootBuilder, connected_components, in_order, root_family
from enumsol.roots.enumerate import roots_of_selections
from enumsol.roots.root_set import RootSet, SearchStats
from enumsol.search.outcome import Stop, StopReason
from enumsol.selections.float_selections import FloatSelections
from enumsol.selections.rational_selections import ExactSelections
from enumsol.support.arguments import alpha_value

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.branches.elements import Arc, Vertex
    from enumsol.branches.graph_data import GraphData
    from enumsol.selections.solution import SelectionSolution
    from enumsol.support.array_types import Alpha, AlphaLike, Codes


def roots_at(data: GraphData, alpha: AlphaLike) -> RootSet:
    """All solutions at one alpha, as enumerate_roots returns them; of a graph with gaps, those that were found.

    Raises
    ------
    InvalidArgumentError
        alpha is outside the interval.
    """
    return roots_on(data, alpha_value(alpha), *data.located(alpha))


def roots_on(
    data: GraphData, alpha: Alpha, arcs: Sequence[Arc], vertices: Sequence[Vertex] = (), near: Sequence[Vertex] = ()
) -> RootSet:
    """Solutions on arcs, at vertices at ``alpha``, and at vertices of which only bounds are known that hold it."""
    if not isinstance(data.problem, ContactProblem):
        from enumsol.branches.space.space_graph import roots_on_arcs  # for problems in 3D only

        return roots_on_arcs(data, alpha, arcs, vertices, near)
    beside = {v.number for v in near}
    arcs = [*arcs, *(arc for arc in data.arcs if beside & {arc.tail, arc.head})]
    codes = {c for arc in arcs for c in arc.selections} | {c for v in (*vertices, *near) for c in v.selections}
    return _roots_of(data, alpha, sorted(codes))


def _roots_of(data: GraphData, alpha: Alpha, selections: Sequence[Codes]) -> RootSet:
    """Roots and families that the selections have at ``alpha``; in floats where these find all of them."""
    problem = data.problem
    if data.exact is None or not problem.held:
        # those that are proven for the problem's data as given
        positive = tuple(F > 0 for F in exactly_at(Fraction(alpha), *problem.affine_friction))
        return roots_of_selections(problem, alpha, _codes_at(selections, positive), whole=not data.reasons)
    floats = FloatSelections(problem.condensed.at(alpha).proposals)
    solver: Any = floats
    exact = data.arithmetic != "fast"
    solutions: list[SelectionSolution | None] = []
    if not exact:
        solutions = [solver.solve(codes) for codes in _codes_at(selections, floats.F_positive)]
        exact = any(solution is None for solution in solutions)
    if exact:
        solver = ExactSelections(data.exact.system(rational(alpha)))
        solutions = [solver.solve(codes) for codes in _codes_at(selections, solver.F_positive)]
    components = connected_components([s for s in solutions if s is not None], solver, floats)
    builder = RootBuilder(problem, alpha, solver, floats, {})
    roots = [builder.root(c) for c in components if c.dimension == 0]
    families = [root_family(alpha, c, solver, proven=exact) for c in components if c.dimension > 0]
    roots, families = in_order(roots, families)
    whole = sum(c.whole for c in components)
    return RootSet(
        alpha=alpha,
        roots=roots,
        families=families,
        undecided=(),
        arithmetic=data.arithmetic,
        method="graph",
        stopped=str(Stop(StopReason.GRAPH_INCOMPLETE)) if data.reasons else None,
        stats=SearchStats(selections=len(selections)),
        node_ids=problem.node_ids,
        at_least=whole + int(whole < len(components)) if data.reasons else None,
    )


def _codes_at(selections: Sequence[Codes], F_positive: tuple[bool, ...]) -> list[Codes]:
    """The selections' codes at one alpha, where a node without friction has one status in contact."""
    found = {
        tuple(c if c == OPEN or positive else FRICTIONLESS for c, positive in zip(codes, F_positive, strict=True))
        for codes in selections
    }
    return sorted(found)
