"""The checker of root sets in 2D: whether a proof shows that its list of roots is complete.

It imports nothing of the search; ``enumsol.checker`` lists what both rest on. It recomputes S, g and F (or
their enclosures) from the problem, proves S positive definite, walks the tree from its root, so that the leaves cover
all selections by construction, and checks every leaf.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.arithmetic.balls import TINY, UNIT, Ball
from enumsol.checker.walk import Located, TreeChecker
from enumsol.condensation.enclosure import EnclosedSystem, NotEnclosedError
from enumsol.proof import leaves as kinds
from enumsol.proof.proof_file import fraction_text
from enumsol.proof.reading import RefusedError, data_of, friction_at, rational_from, same, units_from
from enumsol.proof.records import DeclaredForm, Limits, Tree
from enumsol.trusted.at_alpha import ClosedSolution, VerifiedSelection, settled_selection, told_apart
from enumsol.trusted.floating_bounds import without_bound
from enumsol.trusted.positions import certain_statuses
from enumsol.trusted.status_rows import (
    ROW_KINDS,
    is_covering,
    row_signs,
)
from enumsol.trusted.uniqueness import same_solution

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from enumsol.checker.rational import Hull, RationalBody, RationalSystem
    from enumsol.checker.walk import Test
    from enumsol.proof.records import EnclosureRecord, Record
    from enumsol.support.array_types import Codes
    from enumsol.trusted.at_alpha import Unsettled
    from enumsol.trusted.positions import Among

    #: codes of a selection, the vertices of its root set, and its dimension
    Polytope = tuple[tuple[int, ...], list[Any], int]
    #: The core of a solution, and per node the codes that may hold there.
    Known = tuple[Codes, Sequence[frozenset[int]]]


@dataclass
class Checker(TreeChecker[EnclosedSystem, VerifiedSelection]):
    """Checks one proof of a problem in 2D."""

    trees = Tree.PLANE, Tree.FLOATING_PLANE

    polytopes: list[Polytope] = field(default_factory=list)
    closed: dict[tuple[int, ...], ClosedSolution] = field(default_factory=dict)
    #: Roots that selections share, by the one in which all their nodes stick, and by how these slip.
    shared: dict[tuple[Codes, tuple[tuple[int, int], ...]], ClosedSolution | None] = field(default_factory=dict)

    # -- header and tree -------------------------------------------------------------------------------------------

    def _read_header(self, header: Any) -> None:
        self.data = data_of(header, self.problem, None)
        try:
            self.force, self.length = units_from(header, self.problem.p)
            self.alpha = rational_from(header.get("alpha"))
            self.friction = [F > 0 for F in friction_at(self.problem, self.alpha)]
        except ValueError as error:
            raise RefusedError(f"the header cannot be read: {error}") from None

    @cached_property
    def system(self) -> EnclosedSystem:
        """Balls for S, g and F in the proof's units."""
        if self.data == "condensed":
            if not self.problem.known_exactly:
                raise RefusedError("a proof about S and g as computed, of a problem whose slip offset is a ball")
            scaled = self.problem.condensed.at(self.alpha)
            with np.errstate(over="ignore", invalid="ignore"):
                pair = self.force[:, None] / self.length[None, :]
                S, g = scaled.S * pair, scaled.g / self.length
            finite = np.all(np.isfinite(S)) and np.all(np.isfinite(g))
            if not finite or np.any(np.array(self.friction) & (scaled.F == 0)):
                raise RefusedError("S, g or F over- or underflow in the proof's units")
            enclosed = EnclosedSystem.as_computed(S, g, scaled.F)
        else:
            enclosed = self.enclosed().at(self.alpha, self.force, self.length)
        if not enclosed.smallest_eigenvalue > 0:
            raise RefusedError("S is not proven positive definite")
        return enclosed

    def _without_bound(self) -> EnclosedSystem:
        return without_bound(self.system)

    @cached_property
    def rational(self) -> RationalSystem:
        """The condensed problem in rationals; computed only if a leaf needs it."""
        self._allow_rationals()
        from enumsol.checker.rational import RationalSystem  # python-flint, not always needed

        return RationalSystem(self.problem, self.alpha, definite=self.problem.held and self._definite)

    @cached_property
    def _body(self) -> RationalBody:
        """The problem in rationals, not condensed: all that single points need."""
        self._allow_rationals()
        from enumsol.checker.rational import RationalBody  # python-flint, not always needed

        return RationalBody(self.problem, self.alpha)

    def _allow_rationals(self) -> None:
        if self.data == "condensed":
            raise RefusedError("a rational leaf in a proof about S and g as computed")
        if not self.problem.known_exactly:
            raise RefusedError("a rational leaf in a proof about a problem whose slip offset is a ball")

    @cached_property
    def _definite(self) -> bool:
        """S is proven positive definite by balls."""
        try:
            return self.system.smallest_eigenvalue > 0
        except (NotEnclosedError, RefusedError):
            return False

    def _limits(self, codes: Codes, kind: type[Record]) -> Limits:
        friction = self.friction
        if kind is kinds.Closed or (kind is DeclaredForm and not self.problem.held):
            friction = (self.system.F > 0).tolist()  # as the kernel has it
        return Limits(codes, self.tree, friction, self.declared, modes=self.problem.modes.r)

    def _covers(self, node: int, code: int, children: list[int]) -> bool:
        return is_covering(code, children, friction=self.friction[node])

    def _claim(self, isolated: int, families: int) -> dict[str, int]:
        return {"roots": isolated, "families": families, "undecided": self.undecided, "leaves": self.leaves}

    # -- leaves ----------------------------------------------------------------------------------------------------

    @cached_property
    def tests(self) -> dict[type[Record], Test]:
        """Tests of leaves, by their kinds."""
        return super().tests | {
            kinds.RootSetRecord: self._root_set,
            kinds.Closed: self._closed,
            kinds.SharedRoot: self._shared,
        }

    def _at_rest(self) -> None:
        self.polytopes.append(((0,) * self.problem.p, [tuple([Fraction(0)] * (2 * self.problem.p))], 0))

    def _excluded(self, codes: Codes, said: kinds.Excluded) -> str | None:
        return self._excluded_in_rationals(codes, said) if said.by == kinds.RATIONAL else super()._excluded(codes, said)

    def _settled(self, system: EnclosedSystem, codes: Codes) -> VerifiedSelection | Unsettled | None:
        return settled_selection(system, codes, self._in_many_digits)

    def _in_many_digits(self, codes: Codes) -> VerifiedSelection | None:
        return None if self._precise is None else self._precise(codes)

    def _is_root(self, found: object) -> bool:
        return isinstance(found, VerifiedSelection)

    @cached_property
    def _precise(self) -> Callable[[Codes], VerifiedSelection | None] | None:
        """Solutions in many digits; None where these are not to be had, or the proof is about S and g as computed."""
        if self.data == "condensed" or not self.problem.held:
            return None
        from enumsol.trusted.arcs.precise import verified_in_many_digits  # python-flint, not always needed

        return verified_in_many_digits(self.problem, self.alpha, self.force, self.length)

    def _no_root(self, codes: Codes, said: kinds.NoRoot) -> str | None:
        if said.by != kinds.RATIONAL:
            return super()._no_root(codes, said)
        self.bounded |= self._rests_on_reach(codes, [])
        return "it holds a root" if self._hull(codes).points else None

    def _wrongly_said(self, found: VerifiedSelection, said: EnclosureRecord) -> str | None:
        return said.refusal(found.force, self.force, found.index)

    def _only_reference(self, codes: Codes, said: kinds.OnlyReference) -> str | None:
        if (reason := super()._only_reference(codes, said)) is not None:
            return reason
        known = self._form(said.back)
        if not known.lies_below(codes):
            return None if said.enclosure is None else "its root does not lie below its assignment"
        if said.enclosure is None:
            return "it has no enclosure of the root that lies below its assignment"
        return self._regular(known.selection, known.root, said.enclosure)

    def _shared(self, codes: Codes, said: kinds.SharedRoot) -> str | None:
        core = said.core(codes)
        if (core, said.slips) not in self.shared:
            self.shared[core, said.slips] = said.holds(self.system, codes)
        found = self.shared[core, said.slips]
        if found is None:
            return "its selections are not proven to share one root"
        if self.closed.setdefault(core, found) is not found:
            return "its selections overlap with others that share a root"
        return self._only_below(found, said.enclosure)

    def _closed(self, codes: Codes, said: kinds.Closed) -> str | None:
        if isinstance(said.at, int):
            from enumsol.checker.rational import closed_in_rationals  # python-flint, not always needed

            reason, point = closed_in_rationals(self.system, self._body, codes, said)
            self.polytopes += [(said.selection, [point], 0)] if point else []
            return reason
        ball = said.holds(self.system, self.force)
        if ball is None:
            return "its reduced problem is not proven to have one solution"
        if said.enclosure is None:
            return None if ball.is_excluded else "its only solution does not break a condition strictly"
        if not ball.is_root:
            return "its only solution is not proven to be a root"
        self.closed[ball.core] = ball
        return self._only_below(ball, said.enclosure)

    def _only_below(self, found: ClosedSolution, said: EnclosureRecord) -> str | None:
        """Look at what is said of a root that closes a subtree, or that selections share."""
        self._locate(found.core, found)
        return self._wrongly_said(found, said)

    def _locate(self, name: Codes, ball: VerifiedSelection, codes: Codes = ()) -> None:
        del codes  # those that are certain follow from the balls
        if self.located is not None:
            mid, rad = ball.force.mid, ball.force.rad
            rad = np.where((mid == 0) & (rad == 0), 0.0, rad * self.force + TINY)
            rigid = None if ball.rigid is None else ball.rigid * Ball.exact(self.system.rigid_unit)
            among = ball.possible if isinstance(ball, ClosedSolution) else None
            self._locate_by(name, Ball(mid * self.force, rad), ball.w, rigid, among)

    def _locate_by(self, name: Codes, forces: Ball, w: Ball, rigid: Ball | None, among: Among | None = None) -> None:
        """Take note of a root by its forces and rigid displacement in the problem's units, and by w in any unit."""
        p = self.problem.p
        gaps, slips = w[:p], w[p:]
        still, codes = (slips.mid == 0) & (slips.rad == 0), certain_statuses(forces, slips)
        self.locate(name, Located(forces, still, codes, rigid, among, -gaps.mid > gaps.rad))

    def locate_rational_roots(self) -> None:
        """Add the isolated roots that rationals have found to ``located``."""
        p = self.problem.p
        for codes, points, dimension in self.polytopes:
            if dimension:
                continue
            exact = [Fraction(x) for x in points[0]]
            near = np.array([float(x) for x in exact])
            w = [Fraction(0)] * 2 * p if not any(exact) and self.problem.is_unloaded(self.alpha) else self._moved(exact)
            signs = np.array([float(x > 0) - float(x < 0) for x in w])
            known = Ball(near, np.where([x == 0 for x in exact], 0.0, np.abs(near) * 2 * UNIT + TINY))
            rigid = -known[2 * p :] if len(exact) > 2 * p else None
            self._locate_by(codes, known[: 2 * p], Ball(signs, np.zeros(2 * p)), rigid)

    def _moved(self, point: list[Fraction]) -> list[Any]:
        """Numbers with the signs of w at a point."""
        from enumsol.arithmetic.rationals import rational  # python-flint, as above

        numbers = [rational(x) for x in point]
        if self.problem.held:
            return list(self._body.moved(numbers))
        signs = ((kind, sign, node) for kind, sign in ((4, -1), (5, 1)) for node in range(self.problem.p))
        rows = ((sign, *self.rational.row(kind, node)) for kind, sign, node in signs)
        return [
            sign * sum((a * x for a, x in zip(form, numbers, strict=True)), constant) for sign, form, constant in rows
        ]

    def _rests_on_reach(self, codes: Codes, points: Sequence[Sequence[Fraction]]) -> bool:
        """True if a selection may hold more without the bounds of the rigid displacement."""
        return not self.problem.held and self.rational.rests_on_reach(codes, points)

    def _excluded_in_rationals(self, codes: Codes, said: kinds.Excluded) -> str | None:
        p = self.problem.p
        signs = row_signs(np.array(codes), np.array(self.friction, dtype=float))
        units = [Fraction(self.length[r % p] if r // p < 4 else self.force[r % p]) for r in range(ROW_KINDS * p)]
        rows, values = (part.tolist() for part in said.terms)
        positive = self.rational.energy_bound_positive(signs, rows, values, units)
        return None if positive else "its multipliers do not exclude it in rational arithmetic"

    def _hull(self, codes: Codes) -> Hull:
        """All that a selection holds; S is computed only where its equations are singular."""
        from enumsol.arithmetic.rationals import to_fraction  # python-flint, not always needed
        from enumsol.checker.rational import Hull, hull_of_selections

        regular = self.problem.held and self._definite
        point = self._body.point(codes) if regular else None
        if point is None:
            return hull_of_selections(self.rational, codes)
        holds = all(self._body.least(code, i, point) >= 0 for i, code in enumerate(codes))
        return Hull([tuple(map(to_fraction, point))] if holds else [], 0)

    def _root_set(self, codes: Codes, said: kinds.RootSetRecord) -> str | None:
        hull = self._hull(codes)
        # in lowest terms a number has one text: the texts in a file need no conversion
        found = [[fraction_text(x.numerator, x.denominator) for x in point] for point in hull.points]
        if not found or sorted(said.points) != sorted(found) or not same(said.dimension, hull.dimension):
            return "its roots are not those that are claimed"
        self.polytopes.append((codes, hull.points, hull.dimension))
        self.bounded |= self._rests_on_reach(codes, hull.points)
        return None

    # -- counting --------------------------------------------------------------------------------------------------

    def _count(self) -> tuple[int, int]:
        """Isolated roots and families: rational solutions are joined where they have a point in common.

        A strict root solves no second selection: it is not among these, and strict roots of two leaves are different.
        """
        groups = list(range(len(self.polytopes)))

        def group_of(k: int) -> int:
            while groups[k] != k:
                groups[k] = k = groups[groups[k]]
            return k

        owner: dict[Any, int] = {}
        for k, (_, points, _) in enumerate(self.polytopes):
            for point in points:
                groups[group_of(k)] = group_of(owner.setdefault(point, k))
        # points are equal or disjoint; larger polytopes may meet away from their vertices
        for k in [k for k, polytope in enumerate(self.polytopes) if polytope[2] > 0]:
            for m in range(len(self.polytopes)):
                if group_of(k) != group_of(m) and self._meet(k, m):
                    groups[group_of(k)] = group_of(m)
        found = {group_of(k) for k in range(len(groups))}
        families = {group_of(k) for k, polytope in enumerate(self.polytopes) if polytope[2] > 0}
        apart = 0
        if self.closed:
            # without those that are roots of complete selections
            complete = [codes for codes, _ in self.roots] + [codes for codes, *_ in self.polytopes]
            known: list[Known] = [(codes, tuple(frozenset((code,)) for code in codes)) for codes in complete]
            closed: list[Known] = [(core, ball.possible) for core, ball in sorted(self.closed.items())]
            others = told_apart(closed, lambda other, one: same_solution(*one, *other), known)
            apart, self.doubtful = len(others.kept), len(others.doubtful)
            self.same = {core: other for (core, _), (other, _) in others.same}
        return len(self.roots) + len(found) - len(families) + apart, len(families)

    def _meet(self, k: int, m: int) -> bool:
        """True if two root sets have a point in common."""
        from enumsol.checker.rational import hull_of_selections

        return bool(hull_of_selections(self.rational, self.polytopes[k][0], self.polytopes[m][0]).points)
