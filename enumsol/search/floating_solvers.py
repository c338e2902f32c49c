"""The search for a body that nothing holds (theory, section 14): its solvers, and what its certifiers conclude.

The tree, its relaxations and complete selections are those of other bodies; what rests on a positive definite A, such
as one certificate for the whole problem, is not used.
"""

from __future__ import annotations

from fractions import Fraction
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.condensation.condensed import ScaledSystem
from enumsol.condensation.enclosure import EnclosedSystem, NotEnclosedError, RigidRows, enclosure_of
from enumsol.proof import leaves, records
from enumsol.search.certifiers.protocol import Bound, Certifier, UndecidedPart
from enumsol.search.certifiers.rational_certifier import ExactCertifier
from enumsol.search.certifiers.verified import VerifiedCertifier, proven
from enumsol.search.closing import TreeCloser
from enumsol.search.reference_closer import LeadingCloser, reference_numbers
from enumsol.search.solvers import Solvers
from enumsol.search.splitting import PlaneSplitting
from enumsol.selections.solution import SelectionSolution
from enumsol.trusted.at_alpha import holds_no_root, solve_selection
from enumsol.trusted.confinement import motion_against, without_bound
from enumsol.trusted.exclusion import Terms, exclusion_margin
from enumsol.trusted.floating_bounds import is_unbalanced
from enumsol.trusted.joint_roots import JointRoot, joint_root
from enumsol.trusted.reference import Reference
from enumsol.trusted.selection import PENETRATION, SLIP_BACKWARD, SLIP_FORWARD
from enumsol.trusted.status_rows import CONDITIONS, FORBIDDEN, FREE, SLIP_MINUS, SLIP_PLUS, STICK, row_signs

if TYPE_CHECKING:
    from collections.abc import Callable

    from enumsol.proof.writer import Recorder
    from enumsol.search.certifiers.protocol import Margin
    from enumsol.search.reference_closer import OnlyRoot
    from enumsol.selections.rational_selections import ExactSelections
    from enumsol.support.array_types import Codes, Floats, Indices
    from enumsol.trusted.at_alpha import VerifiedSelection

#: How a node slips, or is about to, where one of these kinds of rows is zero.
_SLIPS = {2: SLIP_PLUS, 5: SLIP_PLUS, 3: SLIP_MINUS, 6: SLIP_MINUS}
#: Stiffness of the springs of the relaxations, relative to that of the body (theory, section 14.5).
WEAK = 2.0**-20
#: Weight of multipliers that are zero, relative to the largest: they change only where the others cannot do it.
_SPARE = 2.0**-20
#: How often multipliers that would change their sign are set to zero, and what is left is balanced again.
_BALANCES = 8


class FloatingSolvers(Solvers):
    """Solvers and certifier for a body that nothing holds, at one alpha; parameters as of Solvers."""

    @cached_property
    def rows(self) -> RigidRows:
        """Equilibrium of the body as a whole."""
        return RigidRows.of(self.problem, Fraction(self.alpha), self.scaled.force, self.scaled.length)

    @property
    def rigid_unit(self) -> Floats:  # type: ignore[override]
        """Units of the coordinates of the rigid displacement, (r,)."""
        return self.rows.unit

    @cached_property
    def exact(self) -> ExactSelections | None:
        """Selections in rationals; None when the problem is too large for them."""
        from enumsol.condensation.exact import ExactSystem, check_definite  # python-flint
        from enumsol.selections.rational_selections import ExactSelections  # python-flint

        if self.arithmetic != "exact" and not self._in_rationals:
            return None
        system = ExactSystem.from_problem(self.problem, self.alpha)
        if self.enclosed is None:
            check_definite(system.contact_compliance)
        return ExactSelections(system)

    @cached_property
    def exact_certifier(self) -> FloatingExactCertifier | None:
        """The certifier in rationals; None when the problem is too large."""
        return None if self.exact is None else FloatingExactCertifier(self.exact, self.scaled, self.exclusions)

    @cached_property
    def exclusions(self) -> Exclusions | None:
        """What excludes assignments, for the certifiers of both arithmetics; None without balls."""
        if self._enclosed[0] is None:
            return None
        return Exclusions(self._enclosed[0], self._rests_on_reach, within=self._rounding_decides)

    @cached_property
    def _rounding_decides(self) -> bool:
        """True if what a bound is needed for is not worth being found in rationals (theory, section 14.12)."""
        from enumsol.condensation.exact import FAST_EXACT_DOF  # python-flint

        return self.problem.n > FAST_EXACT_DOF and self.at_limit is not None

    def _rests_on_reach(self, codes: Codes) -> bool:
        """True if a complete selection without a solution may have one beyond the bound."""
        return self._rounding_decides or self.exact is None or self.exact.rests_on_reach(codes, None)

    @cached_property
    def _enclosed(self) -> tuple[EnclosedSystem | None, str]:
        try:
            enclosed = enclosure_of(self.problem).at(self.alpha, self.scaled.force, self.scaled.length)
            definite = enclosed.smallest_eigenvalue > 0
        except NotEnclosedError:
            return None, "problem"
        return (enclosed if definite else None), "problem"

    def certifier(self, recorder: Recorder | None) -> Certifier:
        """The certifier of this arithmetic."""
        if self.arithmetic == "exact":
            if self.exact_certifier is None:
                raise AssertionError("exact arithmetic has a solver, or refuses the problem")
            return self.exact_certifier
        if recorder is None:
            raise AssertionError("verified arithmetic writes a proof")
        ids = self.problem.node_ids
        return FloatingCertifier(self.scaled, self.exclusions, lambda: self.exact_certifier, recorder, ids)

    @cached_property
    def relaxed(self) -> ScaledSystem:
        """The body on weak springs (theory, section 14.5)."""
        return on_weak_springs(self.scaled, self.rows)

    def _on_springs(self, stiffness: float) -> ScaledSystem:
        return on_weak_springs(self.scaled, self.rows, stiffness)

    def _splitting(self, certifier: Certifier) -> PlaneSplitting:
        return PlaneSplitting(self.scaled.F)

    def _closer(self, certifier: Certifier) -> TreeCloser:
        return LeadingCloser(certifier, lambda: self.known_root)


def on_weak_springs(scaled: ScaledSystem, rows: RigidRows, stiffness: float = WEAK) -> ScaledSystem:
    """The body on weak springs, which the relaxations of the search are about (theory, section 14.5)."""
    S, g = weakly_held(scaled.S, scaled.g, rows, stiffness)
    cholesky = np.asarray(np.linalg.cholesky(S), dtype=np.float64)
    return ScaledSystem(S, g, scaled.F, scaled.force, scaled.length, cholesky)


def weakly_held(S: Floats, g: Floats, rows: RigidRows, stiffness: float = WEAK) -> tuple[Floats, ...]:
    """S and g with weak springs in place of those that they have."""
    G, h = rows.G.mid, rows.h.mid
    soft = G.T / stiffness
    S = S + soft @ G
    return 0.5 * (S + S.T), g + soft @ h


def in_balance(system: EnclosedSystem, codes: Codes, rows: Indices, values: Floats) -> tuple[Indices, Floats]:
    """Multipliers next to given ones with G y = h, up to rounding, or these where there are none.

    Those of the body on weak springs satisfy this up to the springs only, times the rigid displacement.
    """
    p, G, h = system.p, system.rows.G.mid, system.rows.h.mid
    signs = row_signs(np.array(codes), system.F)
    normal, forward, backward = (signs[:, kind] for kind in (PENETRATION, SLIP_FORWARD, SLIP_BACKWARD))
    low = np.concatenate([normal == FREE, forward != FORBIDDEN])
    high = np.concatenate([normal != FORBIDDEN, backward != FORBIDDEN])
    table = np.bincount(rows, values, minlength=signs.size).reshape(-1, p)
    y = np.concatenate([table[PENETRATION], table[SLIP_BACKWARD] - table[SLIP_FORWARD]])
    size = np.abs(y)
    weight = np.where(low | high, size + _SPARE * np.max(size), 0.0)
    for _ in range(_BALANCES):
        step = np.linalg.lstsq((G * weight) @ G.T, h - G @ y, rcond=1e-13)[0]
        y = y + weight * (step @ G)
        wrong = np.where(y < 0, ~low, ~high) & (y != 0)
        if not np.any(wrong):
            break
        y, weight = np.where(wrong, 0.0, y), np.where(wrong, 0.0, weight)
    else:
        return rows, values
    forces = rows < PENETRATION * p
    kind = np.repeat([PENETRATION, SLIP_BACKWARD], p)
    kind[p:][y[p:] < 0] = SLIP_FORWARD
    given, of = np.flatnonzero(y), np.tile(np.arange(p), 2)
    sizes = np.where(kind == PENETRATION, y, np.abs(y))
    return np.concatenate([rows[forces], kind[given] * p + of[given]]), np.concatenate([values[forces], sizes[given]])


class Exclusions:
    """What excludes assignments of a body that nothing holds, if possible without a bound of the rigid displacement.

    Parameters
    ----------
    enclosed : EnclosedSystem
    rests_on_reach : of a complete selection without a solution, whether it may have one beyond the bound
    within : whether exclusions may use the bound from the beginning

    Attributes
    ----------
    system, free : EnclosedSystem
        With its bound, and with one beyond which there are no solutions.
    """

    def __init__(
        self, enclosed: EnclosedSystem, rests_on_reach: Callable[[Codes], bool], *, within: bool = False
    ) -> None:
        self.rests_on_reach, self._within = rests_on_reach, within
        self.system, self.free = enclosed, without_bound(enclosed)
        self._references: dict[Codes, Reference | None] = {}
        #: How the forms of roots are declared, by their selections.
        self.declared: dict[Codes, records.DeclaredForm] = {}
        self._margins: tuple[Margin, Margin] = (
            partial(exclusion_margin, self.free, errors=2.0),
            partial(exclusion_margin, enclosed, errors=2.0),
        )

    def record(
        self, codes: Codes, bound: Bound, *, within: bool
    ) -> tuple[leaves.Excluded | leaves.Unbalanced, bool] | None:
        """A record that excludes a partial assignment, and whether it needs the bound; or None.

        Whether the bound is needed must not depend on the numbers that a relaxation arrives at. So an assignment that
        only the bound excludes is split, down to complete selections, unless ``within``: the bound is known to be
        needed (theory, section 14.4).
        """
        found, tried = None, list[Terms]()
        if bound.form is None and len(bound.multipliers()[0]):
            # as given first: those of an earlier proof stay as they are, and many need no other ones
            given = Terms(*bound.multipliers())
            if (found := self._excluded(0, codes, [given])) is None:
                tried = [given, Terms(*in_balance(self.system, codes, *given))]
        if (found := found or self._excluded(0, codes, tried[1:])) is not None:
            return found, False
        if (unbalanced := self.unbalanced(codes)) is not None:
            return unbalanced, False
        found, within = self._excluded(1, codes, tried), within or self._within
        if found is None or not (within or (all(code in CONDITIONS for code in codes) and self.rests_on_reach(codes))):
            return None
        return found, True

    def _excluded(self, margin: int, codes: Codes, tried: list[Terms]) -> leaves.Excluded | None:
        """The first multipliers that prove something, with bounds beyond which there are no solutions, or its own."""
        kept = ((terms, proven(self._margins[margin], codes, *terms)) for terms in tried)
        return next((leaves.Excluded(terms.rows, values) for terms, values in kept if values is not None), None)

    def reference(self, selection: Codes) -> Reference | None:
        """The form of a root, if one is proven definite."""
        if selection not in self._references:
            self._references[selection] = None
            for weights, *more in reference_numbers(self.system, selection):
                found = Reference.of(self.system, selection, weights, *more)
                if found is not None:
                    self.declared[selection] = records.DeclaredForm(selection, weights, np.array(more))
                    self._references[selection] = found
                    break
        return self._references[selection]

    def only_root(self, codes: Codes, reference: Reference, proposal: OnlyRoot, *, within: bool) -> bool | None:
        """True if the bound is needed for no other root to lie below an assignment; None if that is not proven."""
        for system in (self.free, self.system)[: 2 if within else 1]:
            if reference.is_only_root(codes, proposal.rows, proposal.products, system.reach):
                return system is self.system
        return None

    def unbalanced(self, codes: Codes) -> leaves.Unbalanced | None:
        """A record that no forces below a partial assignment are in balance with the load; or None."""
        z = motion_against(self.system, codes)
        return leaves.Unbalanced(z) if is_unbalanced(self.system, codes, z) else None


class FloatingCertifier(VerifiedCertifier):
    """Proves prunings and complete selections of a body that nothing holds.

    Parameters
    ----------
    exclusions : Exclusions or None
        Without balls everything is sent to rationals.
    scaled, exact, recorder, node_ids : as of VerifiedCertifier
    """

    lone = False

    def __init__(
        self,
        scaled: ScaledSystem,
        exclusions: Exclusions | None,
        exact: Callable[[], FloatingExactCertifier | None],
        recorder: Recorder,
        node_ids: Any,
    ) -> None:
        super().__init__(scaled, None, exact, recorder, node_ids)
        self._exclusions, self._exactly = exclusions, exact

    def excluded(self, codes: Codes, relaxation: Bound) -> bool:
        """True if the relaxation's multipliers are proven to exclude the partial assignment."""
        found = None if self._exclusions is None else self._exclusions.record(codes, relaxation, within=self.bounded)
        if found is None:
            self._escalations.refined += 1
            return False
        self._excluded_by_record(found[0], bounded=found[1])
        return True

    def reference(self, selection: Codes) -> Reference | None:
        """The form of a root, if one is proven definite."""
        return None if self._exclusions is None else self._exclusions.reference(selection)

    def only_root(self, codes: Codes, reference: Reference, proposal: OnlyRoot) -> list[SelectionSolution] | None:
        """The roots below an assignment, that of a form or none; None if that is not proven."""
        exclusions = self._exclusions
        within = self.bounded or self._exactly() is None
        needs = None if exclusions is None else exclusions.only_root(codes, reference, proposal, within=within)
        if needs is None or exclusions is None:
            return None
        self.bounded |= needs
        self._escalations.balls += 1
        selection = reference.selection
        back = self._back(selection, lambda: exclusions.declared[selection])
        leaf = partial(leaves.OnlyReference, back, proposal.rows, proposal.products)
        if reference.lies_below(codes):
            return [self._regular(selection, reference.root, leaf)]
        self._leaf(leaf())
        return []

    def _excluded_by_record(
        self, record: leaves.Excluded | leaves.Unbalanced | leaves.NoRoot, *, bounded: bool
    ) -> None:
        self.bounded |= bounded
        self._escalations.balls += 1
        self._leaf(record)

    def selection(self, codes: Codes) -> SelectionSolution | UndecidedPart | None:
        """All roots in a complete selection."""
        ball = None
        if self._exclusions is not None:
            system = self._exclusions.system
            ball = solve_selection(system, codes)
            if ball is not None and ball.is_root:
                self._escalations.balls += 1
                return self._regular(codes, ball)
            found: leaves.Excluded | leaves.Unbalanced | leaves.NoRoot | None = self._exclusions.unbalanced(codes)
            if found is None and _holds_none(self._exclusions.free, codes):
                found = leaves.NoRoot()
            if found is not None:
                self._excluded_by_record(found, bounded=False)
                return None
            # with the bound as in Exclusions.record
            if holds_no_root(system, codes, ball) and (self.bounded or self._exclusions.rests_on_reach(codes)):
                self._excluded_by_record(leaves.NoRoot(), bounded=True)
                return None
        certifier = self._exactly()
        if certifier is None:
            return self._shared(codes, ball) or self._open(codes, ball)
        solution = certifier.selection(codes)
        self.bounded |= certifier.bounded
        return self._in_rationals(codes, solution)

    def _shared(self, codes: Codes, ball: VerifiedSelection | None) -> SelectionSolution | None:
        """The root that a selection may share with others, some nodes being between stick and slip."""
        shared = [known for known in self._verified.values() if isinstance(known, JointRoot)]
        root = next((known for known in shared if known.has(codes)), None)
        if root is None:
            slips = None if ball is None else _between(codes, ball)
            if not slips or self._exclusions is None:
                return None
            core = tuple(STICK if i in slips else code for i, code in enumerate(codes))
            root = joint_root(self._exclusions.system, core, slips)
            # one that is known has other nodes between stick and slip
            if root is None or any(known.core == core for known in shared):
                return None
            self._verified[core] = root
        self._escalations.balls += 1
        self._leaf(leaves.SharedRoot(root.slips, self._ball(root, root.index)))
        point, sign = (root.force.mid,), root.index
        return SelectionSolution(root.core, point, 0, sign, strict=False, index=sign, possible=root.possible)


def _between(codes: Codes, ball: VerifiedSelection) -> dict[int, int] | None:
    """Nodes whose slip bound or slip is open, and how they slip or may slip; None if another condition is open."""
    slips = {}
    rows = [(kind, i) for i, code in enumerate(codes) for kind in CONDITIONS[code][1]]
    for number in np.flatnonzero(~(ball.slack.mid > ball.slack.rad)).tolist():
        kind, node = rows[number] if number < len(rows) else (None, 0)
        if kind not in _SLIPS:
            return None
        slips[node] = _SLIPS[kind]
    return slips


def _holds_none(system: EnclosedSystem, codes: Codes) -> bool:
    return holds_no_root(system, codes, solve_selection(system, codes))


class FloatingExactCertifier(ExactCertifier):
    """Complete selections in rationals; prunings by balls, which prove them as well (theory, section 14.3)."""

    def __init__(self, selections: ExactSelections, scaled: ScaledSystem, exclusions: Exclusions | None = None) -> None:
        super().__init__(selections, scaled)
        self._exclusions = exclusions

    def excluded(self, codes: Codes, relaxation: Bound) -> bool:
        """True if the multipliers prove that the partial assignment holds no solution."""
        found = None if self._exclusions is None else self._exclusions.record(codes, relaxation, within=self.bounded)
        self.bounded |= found is not None and found[1]
        return found is not None

    def reference(self, selection: Codes) -> Reference | None:
        """The form of a root, if one is proven definite."""
        return None if self._exclusions is None else self._exclusions.reference(selection)

    def only_root(self, codes: Codes, reference: Reference, proposal: OnlyRoot) -> list[SelectionSolution] | None:
        """The roots below an assignment, that of a form or none; None if that is not proven."""
        exclusions = self._exclusions
        needs = None if exclusions is None else exclusions.only_root(codes, reference, proposal, within=self.bounded)
        if needs is None:
            return None
        if not reference.lies_below(codes):
            return []
        root = super().selection(reference.selection)
        return [root] if isinstance(root, SelectionSolution) else None

    def selection(self, codes: Codes) -> SelectionSolution | UndecidedPart | None:
        """All roots in the selection."""
        found = super().selection(codes)
        if not isinstance(found, UndecidedPart) and not self.bounded:
            self.bounded = self._selections.rests_on_reach(codes, found)
        return found
