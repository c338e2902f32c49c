"""Vertices and arcs in the user's terms, made from a gluing (theory, section 7.11)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np
from flint import fmpq

from enumsol.arithmetic.rationals import rational, to_fraction
from enumsol.branches.elements import Arc, ArcValues, Sides, Vertex, degree_of, make_vertex, sides_of, with_exact_zeros
from enumsol.model.statuses import RowKind, contact_status
from enumsol.roots.builder import polytope
from enumsol.roots.linearisation import named_statuses, sign_over
from enumsol.roots.root import Polytope, RootFamily
from enumsol.selections.functions import SelectionFunctions
from enumsol.selections.polytopes import dot
from enumsol.selections.rational_selections import FiberSelections, as_float

if TYPE_CHECKING:
    from collections.abc import Sequence
    from fractions import Fraction

    from enumsol.branches.elements import Pair
    from enumsol.branches.exact.gluing import GluedArc, GluedVertex, Gluing
    from enumsol.condensation.exact import ExactCondensed
    from enumsol.support.array_types import Codes


@dataclass(frozen=True)
class ExactArcValues(ArcValues):
    """Values from exact functions, rounded last.

    Attributes
    ----------
    exact : ExactCondensed
    codes : status codes
    sample : Fraction
        An alpha inside the arc.
    """

    exact: ExactCondensed
    codes: Codes
    sample: Fraction

    @cached_property
    def _functions(self) -> SelectionFunctions:
        return SelectionFunctions(self.exact, self.codes)

    def at(self, alpha: Fraction) -> Pair:
        """Forces and displacements at an alpha."""
        point: Any = self._functions.forces_at(rational(alpha))
        if point is None:  # bounded arcs have no poles, but a rounded end may lie beyond the exact one
            point = self._functions.forces_at(rational(self.sample)) or ()
        return _as_floats(self.exact, rational(alpha), point)


def _as_floats(exact: ExactCondensed, alpha: fmpq, point: Any) -> Pair:
    """Contact forces and displacements at a point."""
    size = 2 * exact.p
    moves = [as_float(g - dot(row, point)) for g, row in zip(exact.at(alpha)[0][:size], exact.rows, strict=False)]
    return np.array([as_float(v) for v in point[:size]]), np.array(moves)


def make_arcs(gluing: Gluing) -> list[Arc]:
    """The arcs of a gluing."""
    return [_arc(gluing, number, edge) for number, edge in enumerate(gluing.edges)]


def _arc(gluing: Gluing, number: int, edge: GluedArc) -> Arc:
    begin, end = (gluing.vertices[vertex].alpha for vertex in (edge.tail, edge.head))
    sample = to_fraction(fmpq(edge.sample))
    return Arc(
        number=number,
        statuses=tuple(map(contact_status, edge.codes, _slips(gluing.exact, edge))),
        lo=float(begin),
        hi=float(end),
        tail=edge.tail,
        head=edge.head,
        index=edge.index,
        dimension=edge.dimension,
        grazing=gluing.arcs[edge.codes].grazing,
        selections=(edge.codes, *(c for c in edge.selections if c != edge.codes)),
        begin=begin,
        end=end,
        sample=sample,
        _values=ExactArcValues(gluing.exact, edge.codes, sample),
    )


def _slips(exact: ExactCondensed, edge: GluedArc) -> tuple[int, ...]:
    """Signs of u_t in the middle of an arc, which name the slip of nodes without friction; zeros if there are none."""
    if not any(exact.frictionless):
        return (0,) * exact.p
    solver = FiberSelections(exact, fmpq(edge.sample))
    solution = solver.solve(edge.codes)
    return (0,) * exact.p if solution is None else solver.slip_signs(solution.vertices[0])


def make_vertices(gluing: Gluing, arcs: Sequence[Arc]) -> list[Vertex]:
    """The vertices of a gluing, with their kinds and degrees."""
    sides = sides_of(arcs, len(gluing.vertices))
    return [_vertex(gluing, k, glued, sides[k]) for k, glued in enumerate(gluing.vertices)]


def _vertex(gluing: Gluing, number: int, glued: GluedVertex, sides: Sides) -> Vertex:
    border = glued.alpha.is_rational and glued.alpha.lo in (gluing.a, gluing.b)
    # at the last alpha there are arcs from the left only
    beside = sides[0 if border and glued.alpha.lo == gluing.b else 1]
    degree = degree_of(beside) if glued.settled else None
    return make_vertex(
        number,
        glued.alpha,
        sides,
        _values(gluing, glued),
        named_statuses(glued.active, partial(_slip_sign, gluing, glued))[1],
        glued.members,
        border=border,
        settled=glued.settled,
        bounded=glued.bounded,
        family=_family(glued, degree, proven=gluing.exact.condensed_exactly),
    )


def _slip_sign(gluing: Gluing, glued: GluedVertex, node: int) -> int:
    """Sign of u_t of a node at a vertex, exactly; 0 on a continuum over which it changes."""
    if glued.solver is not None:
        signs = (glued.solver.slip_signs(v)[node] for s in glued.solutions for v in s.vertices)
        return sign_over(signs)
    for codes in glued.members:
        functions = gluing.arcs[codes].functions
        if not functions.singular and (det := glued.alpha.sign_of(functions.det)) != 0:
            slip = functions.row(RowKind.SLIP_FORWARD, node)
            return 0 if slip.is_zero() else int(det * glued.alpha.sign_of(slip))
    return 0  # the unloaded body at rest


def _values(gluing: Gluing, glued: GluedVertex) -> Pair:
    """Forces and displacements at a vertex as floats, with exact zeros where the statuses say so."""
    exact = gluing.exact
    if glued.solutions and glued.solver is not None:
        point = glued.solutions[0].vertices[0]
        return glued.solver.forces(point) + 0.0, glued.solver.displacements(point) + 0.0
    # an irrational alpha is replaced by a rational one that agrees with it far beyond float precision
    glued.alpha.narrow(fmpq(1, 2**256))
    alpha = (glued.alpha.lo + glued.alpha.hi) / 2
    point = next(
        (
            found
            for c in glued.members
            if not gluing.arcs[c].functions.singular
            and (found := gluing.arcs[c].functions.forces_at(alpha)) is not None
        ),
        (fmpq(0),) * len(exact.rows),
    )
    return with_exact_zeros(_as_floats(exact, alpha, point), glued.active)


def _family(glued: GluedVertex, index: int | None, *, proven: bool) -> RootFamily | None:
    if not glued.dimension or glued.solver is None:
        return None
    parts = [polytope(s, s.vertices, glued.solver) for s in glued.solutions if s.dimension > 0]
    return RootFamily(float(glued.alpha), tuple(_without_repetition(parts)), index, vertices_proven=proven)


def _without_repetition(parts: Sequence[Polytope]) -> list[Polytope]:
    """Polytopes whose vertices are not among those of another (of equal ones the first)."""
    sets = [set(map(tuple, part.coordinates.tolist())) for part in parts]
    return [
        part
        for k, part in enumerate(parts)
        if not any(sets[k] < other or (sets[k] == other and j < k) for j, other in enumerate(sets) if j != k)
    ]
