"""Leaves proven empty over a whole piece of the interval by error bounds in double arithmetic ("verified")."""

from __future__ import annotations

from typing import TYPE_CHECKING

from enumsol.condensation.enclosure import CondensedEnclosure, NotEnclosedError
from enumsol.search.certifiers.interval_rationals import ExactIntervalCertifier
from enumsol.search.certifiers.margins import FORM_ERRORS, energy_margin
from enumsol.search.interval.subintervals import IntervalCertifier
from enumsol.trusted.exclusion import exclusion_margin
from enumsol.trusted.over_interval import EnclosedPiece, as_computed

if TYPE_CHECKING:
    from fractions import Fraction

    import numpy as np
    from numpy.typing import NDArray

    from enumsol.condensation.exact import ExactCondensed
    from enumsol.model.problem import ContactProblem
    from enumsol.relaxation.interval_relaxation import IntervalSystem
    from enumsol.search.certifiers.margins import Margin
    from enumsol.search.interval.interval_tree import EmptyLeaf
    from enumsol.search.interval.subintervals import Piece

#: Bounds must be this large [energy unit of the piece], so that a checker that sums in another order agrees.
_MARGIN = 1e-12


class VerifiedIntervalCertifier(IntervalCertifier):
    """Accepts a leaf when the dual bounds of its multipliers are proven positive at both ends of the piece.

    A leaf that the balls cannot exclude is branched on. Only where there are no balls at all (S positive definite
    within rounding) do rationals decide, if S and g were condensed without rounding; there is no proof file then.

    Parameters
    ----------
    problem : ContactProblem
    exact : ExactCondensed or None
        Its data are certified: those of the problem, or S and g as computed. None: those of the problem, without
        recourse to rationals.
    zero : Fraction or None
        The alpha at which g vanishes, where ``exact`` does not say it.
    """

    def __init__(self, problem: ContactProblem, exact: ExactCondensed | None, zero: Fraction | None = None) -> None:
        exactly = exact is None or exact.condensed_exactly
        self._enclosure = certified_enclosure(problem, exactly=exactly)
        self._rationals = ExactIntervalCertifier(exact) if exact is not None and exactly else None
        self._zero = zero if exact is None else exact.zero
        self._piece: tuple[Piece, EnclosedPiece | None, Margin | None] | None = None
        self._form: tuple[NDArray[np.float64], EnclosedPiece] | None = None
        #: Rationals decide where there are no balls; the checker repeats what balls accepted.
        self.forms, self.rational, self.checkable = True, self._rationals is not None, True

    def excluded(self, piece: Piece, system: IntervalSystem, leaf: EmptyLeaf) -> bool:
        """Whether the dual bounds at both ends of the piece are positive."""
        enclosed, margin = self._on(piece, system)
        if enclosed is not None and leaf.form is not None:
            within = self._with_form(enclosed, leaf.form)
            return exclusion_margin(within, leaf.codes, leaf.rows, leaf.values, FORM_ERRORS) > 0
        if margin is not None:
            return margin(leaf.codes, leaf.rows, leaf.values) > _MARGIN
        if self._rationals is None:
            return False
        self.checkable = False
        return self._rationals.excluded(piece, system, leaf)

    def convex(self, piece: Piece, system: IntervalSystem, form: NDArray[np.float64]) -> bool:
        """Whether the form of these multipliers is proven convex on the piece, for all data in the balls."""
        enclosed = self._on(piece, system)[0]
        if enclosed is None:
            return False
        return all(one.smallest_eigenvalue > 0 for one in self._with_form(enclosed, form).forms)

    def _with_form(self, enclosed: EnclosedPiece, form: NDArray[np.float64]) -> EnclosedPiece:
        if self._form is None or self._form[0] is not form or self._form[1].ends is not enclosed.ends:
            self._form = form, enclosed.with_form(form)
        return self._form[1]

    def _on(self, piece: Piece, system: IntervalSystem) -> tuple[EnclosedPiece | None, Margin | None]:
        if self._piece is None or self._piece[0] != piece:
            enclosed = self._make(piece, system)
            self._piece = (piece, enclosed, None if enclosed is None else energy_margin(enclosed))
        return self._piece[1:]

    def _make(self, piece: Piece, system: IntervalSystem) -> EnclosedPiece | None:
        if self._enclosure is None:
            return None
        origin = self._zero if self._zero in (piece.a, piece.b) else None
        units = system.scaled
        try:
            enclosed = EnclosedPiece.from_enclosure(
                self._enclosure, piece.a, piece.b, units.force, units.length, origin
            )
            positive = all(end.smallest_eigenvalue > 0 for end in enclosed.ends)
        except NotEnclosedError:
            return None
        return enclosed if positive else None


def certified_enclosure(problem: ContactProblem, *, exactly: bool) -> CondensedEnclosure | None:
    """Balls for the data that a graph certifies; None when the problem's own data cannot be enclosed."""
    if not exactly:
        return as_computed(problem)
    try:
        return problem.enclosure
    except NotEnclosedError:
        return None
