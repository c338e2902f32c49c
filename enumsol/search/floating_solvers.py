"""The search for a body that nothing holds (theory, section 14): its solvers, and what its certifiers conclude.

The tree, its relaxations and complete selections are those of other bodies; what rests on a positive definite A, such
as one certificate for the whole problem, is not used.
"""

from __future__ import annotations

from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from enumsol.condensation.condensed import ScaledSystem
from enumsol.condensation.enclosure import EnclosedSystem, NotEnclosedError, RigidRows, enclosure_of
from enumsol.search.certifiers.exclusions import Exclusions
from enumsol.search.certifiers.protocol import Certifier
from enumsol.search.closing import TreeCloser
from enumsol.search.reference_closer import LeadingCloser
from enumsol.search.solvers import Solvers
from enumsol.search.splitting import PlaneSplitting

if TYPE_CHECKING:
    from enumsol.selections.rational_selections import ExactSelections
    from enumsol.support.array_types import Codes, Floats

#: Stiffness of the springs of the relaxations, relative to that of the body (theory, section 14.5).
WEAK = 2.0**-20


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
    def exclusions(self) -> Exclusions | None:
        """What excludes assignments; None without balls."""
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
