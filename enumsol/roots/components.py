"""From solutions of selections to roots and families in the user's terms: merging, connectivity and the local degree.

A root at which several statuses hold solves several selections and is one root; roots that touch a polytope belong to
its family. The local degree (index) of a root or family is the sum of sign det over the regular selections whose root
stays one when g is moved a little in a generic direction (theory, sections 6.6 and 6.7).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product
from math import prod
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from enumsol.condensation.condensed import condensation_of
from enumsol.model.statuses import (
    CONTACT,
    FRICTIONLESS,
    OPEN,
    SLIDING,
    STATUSES,
    STICK,
    UNDECIDED,
    ContactStatus,
    contact_status,
)
from enumsol.roots.local_branch import SelectionTangent, SlipSigns, named_statuses, sign_over
from enumsol.roots.root import Enclosure, Polytope, Root, RootFamily
from enumsol.roots.root_set import Undecided
from enumsol.search.outcome import SearchLimits
from enumsol.search.reduction import Reduction
from enumsol.search.solvers import FastCertifier, plane_search
from enumsol.search.splitting import PlaneSplitting
from enumsol.selections.float_selections import FloatSelections
from enumsol.selections.solution import ActiveSets, SelectionSolution, SelectionSolver, VertexLimitError
from enumsol.support.deadlines import current, look
from enumsol.trusted.uniqueness import same_solution

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from enumsol.model.problem import ContactProblem
    from enumsol.search.certifiers.protocol import UndecidedPart
    from enumsol.selections.rational_selections import ExactSelections
    from enumsol.support.array_types import Alpha, Codes, Floats
    from enumsol.trusted.at_alpha import VerifiedSelection

    Apart = tuple[list[SelectionSolution], list[SelectionSolution], list[Codes]]


#: Selections examined around one degenerate root or family to find all that hold there; beyond, a search on the
#: perturbed problem gives the index.
MAX_LOCAL_SELECTIONS = 256


@dataclass(frozen=True)
class RootComponent:
    """A connected set of roots: an isolated root or a family.

    Attributes
    ----------
    solutions : list of SelectionSolution
        All selections known to hold on a part of it.
    active : per node the codes that hold (for a family: somewhere on it)
    dimension : int
        0 for an isolated root.
    index : int or None
        Local degree; None when it could not be found within the limits.
    whole : bool
        All selections that hold on it were examined.
    """

    solutions: tuple[SelectionSolution, ...]
    active: ActiveSets
    dimension: int
    index: int | None
    whole: bool

    @property
    def regular(self) -> bool:
        """True if one selection holds, strictly, and is not singular."""
        first = self.solutions[0]
        return len(self.solutions) == 1 and self.dimension == 0 and first.strict and first.det_sign != 0


def connected_components(
    solutions: Iterable[SelectionSolution], solver: SelectionSolver, floats: FloatSelections | None = None
) -> list[RootComponent]:
    """Roots and families that the given solutions of selections form, every root once.

    Parameters
    ----------
    solutions : solutions of selections, in any order, duplicates allowed
    solver : the solver that made them
    floats : the same system in floats, which gives the index where more than MAX_LOCAL_SELECTIONS hold
    """
    known: dict[Codes, SelectionSolution] = {}
    singles: list[RootComponent] = []
    for solution in solutions:
        if solution.codes not in known or solution.index is not None:
            known[solution.codes] = solution
    degenerate = []
    for solution in known.values():
        if solution.dimension == 0 and solution.strict and solution.det_sign != 0:
            active = tuple(frozenset((code,)) for code in solution.codes)
            singles.append(RootComponent((solution,), active, 0, solution.det_sign, whole=True))
        else:
            degenerate.append(solution)
    groups = _grow(degenerate, known, solver)
    absorbed = {s.codes for group, _ in groups for s in group}
    singles = [c for c in singles if c.solutions[0].codes not in absorbed]
    return singles + [_component(group, whole, solver, floats) for group, whole in groups]


def _grow(
    degenerate: Sequence[SelectionSolution], known: dict[Codes, SelectionSolution], solver: SelectionSolver
) -> list[tuple[list[SelectionSolution], bool]]:
    """Add to every degenerate solution the selections that hold with it, and join those that meet."""
    solved: dict[Codes, SelectionSolution | None] = dict(known)
    refused: set[Codes] = set()

    def solve(codes: Codes) -> SelectionSolution | None:
        if codes not in solved:
            look()
            try:
                solved[codes] = solver.solve(codes)
            except VertexLimitError:  # the search lists this selection as open
                solved[codes] = None
                refused.add(codes)
        return solved[codes]

    groups: list[tuple[list[SelectionSolution], bool]] = []
    placed: set[Codes] = set()
    for seed in degenerate:
        if seed.codes in placed:
            continue
        placed.add(seed.codes)
        group, whole = [seed], True
        for solution in group:  # which grows on the way
            candidates, all_of_them = _holding_at_vertices(solution, solver)
            others = [other for codes in candidates - placed if (other := solve(codes)) is not None]
            joined = [other for other in others if _touch(solution, other, solver)]
            group += joined
            placed |= {other.codes for other in joined}
            whole = whole and all_of_them and not candidates & refused
        groups.append((group, whole))
    return _join(groups, solver)


def _holding_at_vertices(solution: SelectionSolution, solver: SelectionSolver) -> tuple[set[Codes], bool]:
    """Selections that hold at a vertex of a solution, and whether none was left out (see MAX_LOCAL_SELECTIONS)."""
    found: set[Codes] = set()
    whole = True
    for vertex in solution.vertices:
        look()
        active = solver.active(vertex)
        if solution.dimension == 0:
            active = tuple(held | {code} for held, code in zip(active, solution.codes, strict=True))
        if prod(len(a) for a in active) > MAX_LOCAL_SELECTIONS:
            whole = False
        else:
            found.update(product(*active))
    return found, whole


def _join(
    groups: list[tuple[list[SelectionSolution], bool]], solver: SelectionSolver
) -> list[tuple[list[SelectionSolution], bool]]:
    """Join groups that have a point in common (a family may be met away from its vertices)."""
    merged: list[tuple[list[SelectionSolution], bool]] = []
    for group, whole in groups:
        current, flag = group, whole
        rest = []
        for other, other_whole in merged:
            if any(_touch(a, b, solver) for a in current for b in other):
                current, flag = other + current, flag and other_whole
            else:
                rest.append((other, other_whole))
        merged = [*rest, (current, flag)]
    return merged


def _touch(a: SelectionSolution, b: SelectionSolution, solver: SelectionSolver) -> bool:
    """True if two solutions share a point; points must agree, and each lie in the other's selection."""
    look()
    if a.dimension == 0 and b.dimension == 0:
        return solver.equal(a.vertices[0], b.vertices[0])
    return any(_holds(b.codes, v, solver) for v in a.vertices) or (
        any(_holds(a.codes, v, solver) for v in b.vertices)
        or (a.dimension > 0 and b.dimension > 0 and solver.meet(a, b))
    )


def _holds(codes: Codes, point: object, solver: SelectionSolver) -> bool:
    look()
    return all(code in active for code, active in zip(codes, solver.active(point), strict=True))


def _component(
    group: list[SelectionSolution], whole: bool, solver: SelectionSolver, floats: FloatSelections | None
) -> RootComponent:
    group = sorted(group, key=lambda s: (-s.dimension, s.codes))
    dimension = group[0].dimension
    sets = [set() for _ in range(solver.p)]  # type: list[set[int]]
    for solution in group:
        for node, code in enumerate(solution.codes):
            sets[node].add(code)
        if not whole:
            for vertex in solution.vertices:
                for node, codes in enumerate(solver.active(vertex)):
                    sets[node] |= codes
    active = tuple(frozenset(s) for s in sets)
    index = next((solution.index for solution in group if solution.index is not None), None)
    if index is None:
        if whole:
            index = _index(group, solver)
        elif floats is not None:
            point = group[0].vertices[0]
            known = None if dimension else (solver.forces(point), solver.displacements(point))
            index = local_degree(floats, active, known)
    if dimension > 0:
        group = _maximal(group, solver)
    return RootComponent(tuple(group), active, dimension, index, whole)


def _maximal(group: list[SelectionSolution], solver: SelectionSolver) -> list[SelectionSolution]:
    """The polytopes that lie in no other one; of equal ones (several statuses hold on all of it) the first."""

    def inside(a: SelectionSolution, b: SelectionSolution) -> bool:
        return a.dimension <= b.dimension and all(_holds(b.codes, v, solver) for v in a.vertices)

    return [
        a
        for k, a in enumerate(group)
        if not any(inside(a, b) and (j < k or not inside(b, a)) for j, b in enumerate(group) if j != k)
    ]


def _index(group: list[SelectionSolution], solver: SelectionSolver) -> int | None:
    """Sum of sign det over the regular selections whose root survives; two generic directions must agree."""
    found: list[int] = []
    for seed in (20121, 20122, 20123, 20124):
        direction = np.random.default_rng(seed).integers(-1000, 1001, size=2 * solver.p)
        total = 0
        for solution in group:
            if solution.dimension == 0:
                part = solver.departure(solution, direction)
                if part is None:
                    break
                total += part
        else:
            found.append(total)
            if len(found) == 2:
                break
    return found[0] if len(found) == 2 and found[0] == found[1] else None


# -- roots known by enclosures --------------------------------------------------------------------------------------


def apart(solutions: Iterable[SelectionSolution]) -> Apart:
    """Solutions of selections; other roots that closed subtrees, each once; the cores of those in doubt.

    The results do not depend on the order of the solutions. A root that closed a subtree and is a degenerate solution
    of a selection gives that solution its index. A root in doubt may be the same as another one (theory, section 6.11).
    """
    single, closed, doubtful = [], dict[Any, Any](), list[Any]()
    for solution in solutions:
        if solution.possible is None:
            single.append(solution)
        else:
            known = closed.get(solution.codes, solution)
            # shared by other selections in another part of the search
            doubtful += [solution.codes] * (solution.det_sign != 0 and known.possible != solution.possible)
            closed[solution.codes] = solution
    # a strict solution may have closed several subtrees, decided by balls in one of them and by rationals in another
    strict = {s.codes: s for s in single if s.strict and not s.exact}
    single = [*strict.values(), *(s for s in single if s.codes not in strict)]
    kept: list[SelectionSolution] = []
    for core, solution in sorted(closed.items()):
        same = [_same(solution, other) for other in single]
        for k in (k for k, answer in enumerate(same) if answer and not single[k].strict):
            single[k] = replace(single[k], index=solution.index)
        same += [_same(solution, other) for other in kept]
        if True in same:
            continue
        if None in same:
            doubtful.append(core)
        kept.append(solution)
    return single, kept, doubtful


def _same(closed: SelectionSolution, other: SelectionSolution) -> bool | None:
    possible = other.possible or tuple(frozenset((code,)) for code in other.codes)
    return same_solution(closed.codes, closed.possible or (), other.codes, possible)


def closed_component(solution: SelectionSolution) -> RootComponent:
    """Component of a root known only by its enclosure; nothing further can be computed."""
    return RootComponent((solution,), solution.possible or (), 0, solution.index, whole=True)


#: Sizes of the perturbation of g relative to the load's energy norm (to one for an unloaded body), and of which two
#: the roots must lie in the same selections: statuses that hold strictly must not be lost on the way.
_STEPS, _DIRECTIONS = (1e-5, 1e-6), 2


def local_degree(solver: FloatSelections, active: ActiveSets, point: tuple[Floats, Floats] | None) -> int | None:
    """Local degree of a degenerate root, or of a family; None where it is not found.

    Parameters
    ----------
    solver : FloatSelections
    active : per node the codes that hold
    point : lambda and w of an isolated root
    """
    index = None if point is None else _reduced_degree(solver, active, *point)
    return perturbed_degree(solver, active) if index is None else index


def _reduced_degree(solver: FloatSelections, active: ActiveSets, force: Floats, w: Floats) -> int | None:
    """The sign of the determinant of the strict nodes' equations, if the others have one solution.

    See theory, section 6.11.
    """
    system = solver.system
    codes = tuple(min(held) for held in active)
    free = tuple(i for i, held in enumerate(active) if len(held) > 1)
    try:
        reduction = Reduction(system, codes, free, {})
    except np.linalg.LinAlgError:
        return None
    x, v = ((values / unit)[reduction.places] for values, unit in ((force, system.force), (w, system.length)))
    found = reduction.weights(x, v, exactly=True)
    return None if found is None else reduction.sign


def perturbed_degree(solver: FloatSelections, active: ActiveSets) -> int | None:
    """Sum of sign det over the roots near a degenerate one after a small generic perturbation of g.

    The active sets restrict the search to the selections that hold at the root; a regular one among them has its root
    there before the perturbation. None when perturbations do not agree, or a perturbed root is not regular.
    """
    found = []
    for seed in range(_DIRECTIONS):
        push = np.random.default_rng(seed + 1).normal(size=2 * solver.p) * np.sqrt(np.diagonal(solver.system.S))
        near, nearer = (_perturbed(solver, active, step * push) for step in _STEPS)
        if near is None or near != nearer:
            return None
        found.append(sum(near.values()))
    return found[0] if found[0] == found[1] else None


def _perturbed(solver: FloatSelections, active: ActiveSets, push: Floats) -> dict[tuple[int, ...], int] | None:
    """Selections of the roots of a perturbed problem, with sign det; None where it is not found."""
    loaded = bool(np.any(solver.system.g))
    system = replace(solver.system, g=solver.system.g + push if loaded else push / _STEPS[-1])
    splitting, limits = PlaneSplitting(system.F, active), SearchLimits(max_nodes=100_000, deadline=current())
    certifier = FastCertifier(FloatSelections(system, solver.tolerance))
    outcome = plane_search(system, certifier, splitting, limits).run()
    if outcome.stopped is not None or any(not s.strict or s.det_sign == 0 for s in outcome.solutions):
        return None
    return {solution.codes: solution.det_sign for solution in outcome.solutions}


@dataclass(frozen=True)
class RootBuilder:
    """Builds the Root objects at one alpha.

    Attributes
    ----------
    problem, alpha : what was enumerated
    points : values of the points that the components hold
    floats : the float solver of the same system, for scaled margins and derivatives
    verified : balls of the verified regular roots by their codes
    rigid_unit : (r,) array, or None
        Of a body that nothing holds, the units of the coordinates of its rigid displacement in balls.
    """

    problem: ContactProblem
    alpha: Alpha
    points: SelectionSolver
    floats: FloatSelections
    verified: Mapping[Codes, VerifiedSelection]
    rigid_unit: Floats | None = None

    def root(self, component: RootComponent) -> Root:
        """The isolated root of a component."""
        p = self.problem.p
        solution = component.solutions[0]
        canonical = tuple(min(codes) for codes in component.active)
        force, w = self._values(canonical, solution)
        slips = self._slip_signs(canonical, solution)
        statuses, active = named_statuses(component.active, slips.sign)
        regular = component.regular
        scaled = force / self.floats.system.force
        slack = self.floats.slacks(canonical, scaled, w / self.floats.system.length)
        return Root(
            alpha=self.alpha,
            statuses=statuses,
            active=active,
            lambda_n=force[:p],
            lambda_t=force[p:],
            u_n=w[:p],
            u_t=w[p:],
            index=component.index,
            regular=regular,
            margin=max(float(np.min(slack)), 0.0) if regular else 0.0,
            enclosure=self._enclosure(solution),
            _condensed=condensation_of(self.problem),
            _tangent=self._tangent(canonical, force, w) if regular else None,
            _rigid=self._rigid(solution),
            _slips=slips,
            _exact_slips=self.points.exact_slips(solution.vertices[0]),
        )

    def _tangent(self, codes: Codes, force: Floats, w: Floats) -> SelectionTangent:
        return SelectionTangent.at(self.problem, self.alpha, codes, force, w, self.floats)

    def _rigid(self, solution: SelectionSolution) -> Floats | None:
        """Coordinates of the rigid displacement of a body that nothing holds."""
        if self.rigid_unit is None:
            return None
        ball = self.verified.get(solution.codes)
        if ball is None or ball.rigid is None:
            return np.asarray(cast("ExactSelections", self.points).rigid(solution.vertices[0]) + 0.0)
        # -0.0 prints badly
        return np.asarray(ball.rigid.mid * self.rigid_unit + 0.0)

    def _slip_signs(self, codes: Codes, solution: SelectionSolution) -> SlipSigns:
        """Signs of u_t: from the ball where it does not hold zero, otherwise those of the solver's arithmetic."""
        p, ball = self.problem.p, self.verified.get(solution.codes)
        known: tuple[int | None, ...]
        if ball is None:
            known = self.points.slip_signs(solution.vertices[0])
        else:
            balls = zip(ball.w.mid[p:].tolist(), ball.w.rad[p:].tolist(), strict=True)
            known = tuple(int(np.sign(w)) if abs(w) > r or w == r == 0 else None for w, r in balls)
        return SlipSigns(self.problem, self.alpha, codes, known)

    def _enclosure(self, solution: SelectionSolution) -> Enclosure | None:
        """Bounds of forces and displacements: from the balls, or the floats next to a rational root."""
        p, system = self.problem.p, self.floats.system
        ball = self.verified.get(solution.codes)
        if ball is not None:
            mid = np.concatenate([ball.force.mid * system.force, ball.w.mid * system.length])
            rad = np.concatenate([ball.force.rad * system.force, ball.w.rad * system.length])
            if self.rigid_unit is not None and ball.rigid is not None:
                mid = np.append(mid, ball.rigid.mid * self.rigid_unit)
                rad = np.append(rad, ball.rigid.rad * self.rigid_unit)
            low = np.where(rad > 0, np.nextafter(mid - rad, -np.inf), mid)
            high = np.where(rad > 0, np.nextafter(mid + rad, np.inf), mid)
        elif (around := self.points.bounds(solution.vertices[0])) is not None:
            low, high = around
        else:
            return None
        bounds = np.stack([low, high], axis=1)
        rigid = None if self.rigid_unit is None else bounds[4 * p :]
        return Enclosure(bounds[:p], bounds[p : 2 * p], bounds[2 * p : 3 * p], bounds[3 * p : 4 * p], rigid)

    def _values(self, codes: Codes, solution: SelectionSolution) -> tuple[Floats, Floats]:
        """Forces and displacements with the zeros that the statuses impose set exactly."""
        p, point, ball = self.problem.p, solution.vertices[0], self.verified.get(solution.codes)
        if ball is None:
            force, w = self.points.forces(point), self.points.displacements(point)
        else:
            # the floats' own S and g may be off by more than the ball's radius
            force, w = ball.force.mid * self.floats.system.force, ball.w.mid * self.floats.system.length
        for i, code in enumerate(codes):
            if code == OPEN:
                force[[i, p + i]] = 0.0
            else:
                w[i] = 0.0
                if code == STICK:
                    w[p + i] = 0.0
        # -0.0 prints badly
        return force + 0.0, w + 0.0


def root_family(alpha: Alpha, component: RootComponent, solver: SelectionSolver, *, proven: bool) -> RootFamily:
    """The family of a component of positive dimension."""
    known: list[Any] = []

    def shared(vertex: object) -> Any:
        """Vertex that stands for all equal ones, so that polytopes that meet share their corners to the last bit."""
        found = next((other for other in known if solver.equal(vertex, other)), None)
        if found is None:
            known.append(vertex)
        return vertex if found is None else found

    parts = tuple(polytope(s, [shared(vertex) for vertex in s.vertices], solver) for s in component.solutions)
    return RootFamily(alpha, parts, component.index, vertices_proven=proven)


def polytope(solution: SelectionSolution, corners: Sequence[Any], solver: SelectionSolver) -> Polytope:
    """The roots of one selection; ``corners`` are its vertices, or points equal to them."""
    points = np.array([solver.forces(corner) for corner in corners])
    slips = [solver.slip_signs(vertex) for vertex in solution.vertices]
    statuses = tuple(contact_status(code, sign_over(s[i] for s in slips)) for i, code in enumerate(solution.codes))
    exact = cast("ExactSelections", solver)  # which alone has rigid displacements
    rigid = np.array([exact.rigid(corner) + 0.0 for corner in corners]) if getattr(solver, "modes", 0) else None
    order = np.lexsort((points if rigid is None else np.hstack([points, rigid])).T[::-1])
    points = points[order]
    vertices = np.stack([points[:, : solver.p], points[:, solver.p :]], axis=2)
    return Polytope(statuses, vertices, solution.dimension, None if rigid is None else rigid[order])


def in_order(roots: list[Root], families: list[RootFamily]) -> tuple[list[Root], list[RootFamily]]:
    """Roots by statuses and forces, families by vertices: an order that does not depend on the search."""
    return (
        sorted(roots, key=lambda r: ([s.value for s in r.statuses], r.lambda_n.tolist(), r.lambda_t.tolist())),
        sorted(families, key=lambda family: family.vertices.tolist()),
    )


def named(part: UndecidedPart) -> Undecided:
    """An undecided part in the user's terms."""
    names: list[ContactStatus | str | None] = []
    for code in part.codes:
        if code == UNDECIDED:
            names.append(None)
        elif code in SLIDING:
            names.append(" or ".join(STATUSES[held].value for held in SLIDING[code]))
        else:
            names.append("contact" if code in (CONTACT, FRICTIONLESS) else STATUSES[code])
    return Undecided(tuple(names), part.reason, part.hint)
