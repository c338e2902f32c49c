"""One problem at one alpha in one arithmetic: the solvers and the certifier that a search needs."""

from __future__ import annotations

import warnings
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from functools import cache, cached_property, partial
from typing import TYPE_CHECKING, Literal, TypeVar

import numpy as np

from enumsol.condensation.data import EXACT_DOF_LIMIT, exactly_at
from enumsol.condensation.enclosure import EnclosedSystem, NotEnclosedError, RigidRows, enclosure_of
from enumsol.errors import InvalidArgumentError, MissingDependencyError
from enumsol.model.statuses import UNDECIDED
from enumsol.proof.records import Limits, Tree
from enumsol.proof.writer import Recorder
from enumsol.relaxation.active_set import ActiveSetEngine
from enumsol.relaxation.engine import PRUNE_MARGIN, Engine, not_compiled
from enumsol.relaxation.interior_point import InteriorPointEngine, SoftenedEngine
from enumsol.search.certifiers.exclusions import Exclusions
from enumsol.search.certifiers.protocol import Bound, Certifier, UndecidedPart, margin_of_form, solve_or_open
from enumsol.search.certifiers.verified import VerifiedCertifier
from enumsol.search.fathoming import Closer, holds_below, propose, without_load
from enumsol.search.nodes import Forms, Relaxations, TreeCloser, ascended
from enumsol.search.reduction import NEAR, WeightSource
from enumsol.search.reference_closer import Cover, ReferenceCloser, proposed
from enumsol.search.setup import WEAK, SearchSetup, weakly_held
from enumsol.search.splitting import PlaneSplitting
from enumsol.search.tree import TreeSearch
from enumsol.selections.float_selections import FloatSelections
from enumsol.selections.solution import SelectionSolution

if TYPE_CHECKING:
    from collections.abc import Callable

    from enumsol.condensation.condensed import ScaledSystem
    from enumsol.model.problem import ContactProblem
    from enumsol.search.certifiers.rational_certifier import ExactCertifier
    from enumsol.search.outcome import SearchLimits
    from enumsol.search.reduction import Point, Proposal
    from enumsol.selections.rational_selections import ExactSelections
    from enumsol.support.array_types import Alpha, Codes, Floats
    from enumsol.trusted.at_alpha import VerifiedSelection


Arithmetic = Literal["fast", "verified", "exact"]
_T = TypeVar("_T")


def make_engine(system: ScaledSystem, name: str | None = None) -> Engine:
    """The relaxation engine of that name; by default the compiled one, or the fallback with a warning.

    Raises
    ------
    MissingDependencyError
        The compiled one was asked for and cannot be imported.
    """
    if name == InteriorPointEngine.name:
        return InteriorPointEngine(system)
    try:
        return ActiveSetEngine(system)
    except ImportError as error:
        missing = not_compiled(error)
        if name is not None:
            raise MissingDependencyError(missing) from error
        warnings.warn(f"{missing}; the much slower interior-point solver is used", RuntimeWarning, stacklevel=2)
        return InteriorPointEngine(system)


def plane_search(
    system: ScaledSystem,
    certifier: Certifier,
    splitting: PlaneSplitting | None = None,
    limits: SearchLimits | None = None,
    engine: Engine | None = None,
) -> TreeSearch:
    """A search of the tree of a system, by default with the best engine and all statuses."""
    engine, splitting = engine or make_engine(system), splitting or PlaneSplitting(system.F)
    relaxations = Relaxations(engine, splitting, system.p, fallback=partial(InteriorPointEngine, system))
    return TreeSearch(relaxations, certifier, limits=limits)


class Solvers(SearchSetup):
    """Solvers and certifier for one problem at one alpha.

    Parameters
    ----------
    problem : ContactProblem
    alpha : float or Fraction
    arithmetic : {"fast", "verified", "exact"}
    tolerance : float
        Sign tolerance of fast arithmetic.
    engine : {"active-set", "clarabel"} or None
        Solver of the relaxations; None for the best available.

    Raises
    ------
    InvalidArgumentError
        A friction coefficient is positive and underflows to zero: its node would count as one without friction.
    InvalidProblemError
        S is not positive definite: exactly where rationals decide what balls leave open, otherwise beyond rounding.
    """

    scaled: ScaledSystem

    def __init__(
        self, problem: ContactProblem, alpha: Alpha, arithmetic: Arithmetic, tolerance: float, engine: str | None = None
    ) -> None:
        super().__init__(problem, alpha, arithmetic)
        self.arithmetic: Arithmetic = arithmetic
        self.engine = engine
        body = problem.on_springs
        system = body.condensed.at(alpha)
        self._in_rationals = problem.n <= EXACT_DOF_LIMIT and problem.known_exactly
        exactly = arithmetic != "fast" and self._in_rationals
        self.scaled = system.proposals if exactly else system.scaled
        self.floats = FloatSelections(self.scaled, tolerance)
        if exactly and not body.condensed.definite:
            _ = self.exact  # definite, or refused
        exact = exactly_at(Fraction(alpha), *problem.affine_friction)
        lost = [not F and x != 0 for F, x in zip(self.scaled.F, exact, strict=True)]
        if any(lost):
            node = problem.node_ids[lost.index(True)]
            raise InvalidArgumentError(
                f"friction at contact node {node} is positive at this alpha and too small for float64; "
                "expected 0 or more than 1e-307"
            )

    @cached_property
    def rows(self) -> RigidRows:
        """Equilibrium of a body as a whole that nothing holds."""
        return RigidRows.of(self.problem, Fraction(self.alpha), self.scaled.force, self.scaled.length)

    @property
    def rigid_unit(self) -> Floats | None:
        """Units of the coordinates of the rigid displacement, (r,); None of a body that is held."""
        return None if self.problem.held else self.rows.unit

    @cached_property
    def relaxed(self) -> ScaledSystem:
        """The system of the relaxations; of a body that nothing holds, on weak springs (theory, section 14.5)."""
        return self._on_springs(WEAK)

    def _on_springs(self, stiffness: float) -> ScaledSystem:
        if self.problem.held:
            return self.scaled
        S, g = weakly_held(self.scaled.S, self.scaled.g, self.rows, stiffness)
        return replace(self.scaled, S=S, g=g, cholesky=np.asarray(np.linalg.cholesky(S), dtype=np.float64))

    @cached_property
    def exact(self) -> ExactSelections | None:
        """Selections in rationals; None when the problem is too large for them.

        Raises
        ------
        InvalidProblemError
            S is not positive definite, exactly.
        """
        from enumsol.condensation.exact import FAST_EXACT_DOF, ExactSystem, UncondensedSystem, check_definite
        from enumsol.selections.rational_selections import ExactSelections  # python-flint

        if self.arithmetic != "exact" and not self._in_rationals:
            return None
        system: ExactSystem | UncondensedSystem
        if self.problem.held and self.arithmetic == "verified" and self.problem.n > FAST_EXACT_DOF:
            # verified arithmetic asks about few selections, exact arithmetic about all
            system = UncondensedSystem(self.problem, self.alpha, self._index)
        else:
            system = ExactSystem.from_problem(self.problem, self.alpha)
        enclosed, data = self._enclosed
        if enclosed is None or data == "condensed":
            check_definite(system.contact_compliance if isinstance(system, ExactSystem) else system.S)
        return ExactSelections(system)

    @cached_property
    def exact_certifier(self) -> ExactCertifier | None:
        """The certifier in rationals; None when the problem is too large, or only condensed data are certified."""
        if self.data == "condensed" or self.exact is None:
            return None
        return self._in_exact_arithmetic(self.exact)

    def _in_exact_arithmetic(self, exact: ExactSelections) -> ExactCertifier:
        from enumsol.search.certifiers.rational_certifier import ExactCertifier  # python-flint

        precisely = None if self.arithmetic == "exact" else self._solved_precisely
        return ExactCertifier(exact, self.scaled, self.exclusions, precisely)

    @cached_property
    def exclusions(self) -> Exclusions | None:
        """Ways to exclude assignments; None without balls."""
        if self.enclosed is None or self.problem.held:
            return None if self.enclosed is None else Exclusions(self.enclosed)
        return Exclusions(self.enclosed, self._rests_on_reach, within=self._rounding_decides)

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
        system = self.scaled
        with suppress(NotEnclosedError):
            enclosed = enclosure_of(self.problem).at(self.alpha, system.force, system.length)
            if enclosed.smallest_eigenvalue > 0:
                return enclosed, "problem"
        if self._in_rationals or not (self.problem.known_exactly and self.problem.held):
            return None, "problem"
        with suppress(NotEnclosedError):
            enclosed = EnclosedSystem.as_computed(system.S, system.g, system.F)
            if enclosed.smallest_eigenvalue > 0:
                return enclosed, "condensed"
        return None, "condensed"

    @property
    def enclosed(self) -> EnclosedSystem | None:
        """Balls for the scaled system; None when S is not proven positive definite by them."""
        return self._enclosed[0]

    @property
    def data(self) -> str:
        """Data that a proof is about: "problem" (the matrices as given) or "condensed" (S and g as computed)."""
        return self._enclosed[1] if self.arithmetic == "verified" else "problem"

    @property
    def undecidable(self) -> str | None:
        """Why verified arithmetic cannot prove anything about this problem, or None."""
        if self.arithmetic != "verified" or self.enclosed is not None or self.exact_certifier is not None:
            return None
        return "the condensed compliance S is positive definite only within rounding"

    def certifier(self, recorder: Recorder | None) -> Certifier:
        """The certifier of this arithmetic."""
        if self.arithmetic == "fast":
            return FastCertifier(self.floats)
        if self.arithmetic == "exact":
            # of a body that nothing holds it is known once whether a conclusion rests on the bound
            own = self._in_exact_arithmetic(_present(self.exact)) if self.problem.held else self.exact_certifier
            return _present(own)
        ids = self.problem.node_ids
        exact = lambda: self.exact_certifier  # noqa: E731
        return VerifiedCertifier(self.scaled, self.exclusions, exact, _present(recorder), ids, self._solved_precisely)

    def _solved_precisely(self, codes: Codes) -> VerifiedSelection | None:
        """The verified solution of a complete selection in many digits; None where that is not to be had."""
        return None if self._precise is None else self._precise(codes)

    def _index(self, codes: Codes) -> int:
        """The sign of det M of a selection where many digits show it, else 0."""
        found = self._solved_precisely(codes)
        return 0 if found is None else found.index

    @cached_property
    def _precise(self) -> Callable[[Codes], VerifiedSelection | None] | None:
        """Solutions of selections in many digits; None for small ones, which rationals decide as fast."""
        from enumsol.condensation.exact import FAST_EXACT_DOF
        from enumsol.trusted.arcs.precise import verified_in_many_digits  # python-flint

        if self.problem.n <= FAST_EXACT_DOF or self.data == "condensed" or not self.problem.held:
            return None
        return verified_in_many_digits(self.problem, Fraction(self.alpha), self.scaled.force, self.scaled.length)

    @cached_property
    def _engine(self) -> Engine:
        return make_engine(self.relaxed, self.engine)

    @property
    def _fallback(self) -> Callable[[], InteriorPointEngine]:
        if self.arithmetic == "verified" and self.problem.held and (enclosed := self.enclosed) is not None:
            # an error of S y of form_error |y| costs this much: theory, (6.3)
            return partial(SoftenedEngine, self.relaxed, 0.25 * enclosed.form_error**2 / enclosed.smallest_eigenvalue)
        return partial(InteriorPointEngine, self.relaxed)

    def _solved(self, system: ScaledSystem, near: Point | None) -> tuple[list[Codes], Point] | None:
        codes, none = (UNDECIDED,) * system.p, (np.zeros(2 * system.p), system.g)
        for start in (none, None) if near is None else (near, none, None):
            found = propose(system, codes, start, exactly=False, sought=WeightSource.PLAIN)
            if found is not None:
                return [found.selection], (found.force, system.g - system.S @ found.force)
        return None

    def _splitting(self, certifier: Certifier) -> PlaneSplitting:
        return PlaneSplitting(self.scaled.F, sliding=certifier.sliding if self.problem.held else None)

    def _closer(self, certifier: Certifier) -> TreeCloser | None:
        if self.problem.held:
            return Closer(self.scaled, certifier)
        return ReferenceCloser(
            certifier,
            lambda: self.known_root,
            lambda reference, codes: proposed([reference], codes),
            cover=lambda reference: Cover([reference]),
        )

    @cached_property
    def _forms(self) -> Forms | None:
        """Forms for a long search; None where the energy is the only one, or there are no balls to prove them by."""
        scaled = self.scaled
        fast = self.arithmetic == "fast"
        system = EnclosedSystem.as_computed(scaled.S, scaled.g, scaled.F) if fast else self.enclosed
        return None if self.arithmetic == "exact" or system is None else Forms(partial(ascended, scaled, system))

    def remake(self) -> Callable[[], Solvers]:
        """Makes the same again, also in another process."""
        return partial(type(self), self.problem, self.alpha, self.arithmetic, self.floats.tolerance, self.engine)

    def unloaded(self) -> bool:
        """True if g = 0, so that only lambda = 0 solves: in the data (verified, exact) or as computed (fast)."""
        if self.arithmetic == "fast":
            return not np.any(self.scaled.g)
        if self.arithmetic == "exact" and self.problem.held:
            return not any(_present(self.exact).system.g)
        return super().unloaded()

    @property
    def limits(self) -> Limits:
        """Limits of the records at the root of the tree of a proof."""
        tree = Tree.PLANE if self.problem.held else Tree.FLOATING_PLANE
        return Limits((UNDECIDED,) * self.problem.p, tree, (self.scaled.F > 0).tolist(), modes=self.problem.modes.r)


def _present(value: _T | None) -> _T:
    if value is None:
        raise AssertionError("this arithmetic has no such solver")
    return value


#: A condition is broken beyond doubt: one that is broken by less may hold within the tolerance at another point, or was
#: computed with rounding.
BEYOND_DOUBT = 1e-6


class FastCertifier(Certifier):
    """Floats and tolerances: the result of the engine is trusted unless the tolerance could overturn it.

    A condition within the tolerance of zero counts as satisfied. Shifting every row of a certificate by twice that
    changes its bound by the multipliers times the shift; a pruning that does not survive it is branched on.
    """

    writes = False
    # with other numbers forms are definite where they nearly are not: several points may hold within the tolerance
    plain = True

    def __init__(self, selections: FloatSelections) -> None:
        self._selections = selections
        super().__init__()
        self._norms = selections.row_norms()
        self._margin_of = cache(partial(margin_of_form, errors=1.0))

    def excluded(self, codes: Codes, relaxation: Bound) -> bool:
        """Accept the pruning if conditions may be off by twice the tolerance."""
        rows, values = relaxation.multipliers()
        shift = float(np.abs(values) @ self._norms[rows])
        if relaxation.form is not None:
            # hardly convex: its bound is worth what is left of it after rounding
            return self._margin_of(relaxation.form)(codes, rows, values) > 2.0 * self._selections.tolerance * shift
        return relaxation.bound > PRUNE_MARGIN + 2.0 * self._selections.tolerance * shift

    def closed(self, codes: Codes, proposal: Proposal | None, near: Point) -> list[SelectionSolution] | None:
        """The solutions below a partial assignment, none or one, if it can hold one only; within the tolerance."""
        solver = self._selections
        if proposal is None or proposal.weights is None:
            return None
        # a point whose conditions hold within the tolerance is nearer than this to the solution of a closed subtree
        if 2.0 * solver.tolerance * proposal.reduction.sensitivity > 1e-3:
            return None
        if proposal.least < -max(BEYOND_DOUBT, 2.0 * solver.tolerance):
            return []
        solution = solver.solve(proposal.selection)
        if solution is None or solution.dimension > 0 or not holds_below(codes, solver.active(solution.vertices[0])):
            return None
        return [replace(solution, index=proposal.reduction.sign if proposal.least > NEAR else None)]

    def selection(self, codes: Codes) -> SelectionSolution | UndecidedPart | None:
        """All roots in the selection within the tolerance."""
        found = solve_or_open(self._selections, codes)
        if isinstance(found, SelectionSolution) and not found.strict:
            system, force = self._selections.system, found.vertices[0]
            self.sliding |= without_load(system, force, system.g - system.S @ force)
        return found
