"""Roots, families and undecided parts in the user's terms, built from what the search found."""

from __future__ import annotations

from dataclasses import dataclass
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

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from enumsol.model.problem import ContactProblem
    from enumsol.roots.components import RootComponent
    from enumsol.search.certifiers.protocol import UndecidedPart
    from enumsol.selections.float_selections import FloatSelections
    from enumsol.selections.rational_selections import ExactSelections
    from enumsol.selections.solution import SelectionSolution, SelectionSolver
    from enumsol.support.array_types import Alpha, Codes, Floats
    from enumsol.trusted.at_alpha import VerifiedSelection


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
