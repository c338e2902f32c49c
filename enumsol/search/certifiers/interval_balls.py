"""Leaves proven empty over a whole piece of the interval by error bounds in double arithmetic ("verified")."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from enumsol.condensation.enclosure import CondensedEnclosure, NotEnclosedError
from enumsol.search.certifiers.interval_rationals import ExactIntervalCertifier
from enumsol.trusted.over_interval import (
    EnclosedPiece,
    as_computed,
    interval_exclusion_margin,
    interval_form_margins,
    piece_forms,
)

if TYPE_CHECKING:
    from collections.abc import Callable
    from fractions import Fraction

    from numpy.typing import NDArray

    from enumsol.condensation.exact import ExactCondensed
    from enumsol.model.problem import ContactProblem
    from enumsol.relaxation.interval_relaxation import IntervalSystem
    from enumsol.search.interval.interval_tree import EmptyLeaf
    from enumsol.search.interval.subintervals import Piece
    from enumsol.selections.solution import Codes
    from enumsol.trusted.quadratic_forms import EnclosedForm

    Margin = Callable[[Codes, NDArray[np.intp], NDArray[np.float64]], float]

#: Bounds must be this large [energy unit of the piece], so that a checker that sums in another order agrees.
_MARGIN = 1e-12
#: How often the error bound of an exclusion with a form is subtracted.
_FORM_ERRORS = 4.0


class VerifiedIntervalCertifier:
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
        self._used_rationals = False
        self._piece: tuple[Piece, EnclosedPiece | None, Margin | None] | None = None
        self._forms: tuple[EnclosedPiece, NDArray[np.float64], tuple[EnclosedForm, ...]] | None = None

    forms = True

    @property
    def checkable(self) -> bool:
        """Whether balls accepted every leaf so far."""
        return not self._used_rationals

    @property
    def rational(self) -> bool:
        """Whether rationals decide where there are no balls."""
        return self._rationals is not None

    def excluded(self, piece: Piece, system: IntervalSystem, leaf: EmptyLeaf) -> bool:
        """Whether the dual bounds at both ends of the piece are positive."""
        enclosed, margin = self._on(piece, system)
        if enclosed is not None and leaf.form is not None:
            forms = self._forms_on(enclosed, leaf.form)
            alone = np.array([leaf.codes], dtype=np.intp), np.zeros(len(leaf.rows), dtype=np.intp)
            found = interval_form_margins(enclosed, forms, *alone, leaf.rows, leaf.values, _FORM_ERRORS)
            return bool(found[0] > 0)
        if margin is not None:
            return margin(leaf.codes, leaf.rows, leaf.values) > _MARGIN
        if self._rationals is None:
            return False
        self._used_rationals = True
        return self._rationals.excluded(piece, system, leaf)

    def convex(self, piece: Piece, system: IntervalSystem, form: NDArray[np.float64]) -> bool:
        """Whether the form of these multipliers is proven convex on the piece, for all data in the balls."""
        enclosed = self._on(piece, system)[0]
        return enclosed is not None and all(one.smallest_eigenvalue > 0 for one in self._forms_on(enclosed, form))

    def _forms_on(self, enclosed: EnclosedPiece, form: NDArray[np.float64]) -> tuple[EnclosedForm, ...]:
        if self._forms is None or self._forms[0] is not enclosed or self._forms[1] is not form:
            self._forms = enclosed, form, piece_forms(enclosed, form)
        return self._forms[2]

    def _on(self, piece: Piece, system: IntervalSystem) -> tuple[EnclosedPiece | None, Margin | None]:
        if self._piece is None or self._piece[0] != piece:
            enclosed = self._make(piece, system)
            self._piece = (piece, enclosed, None if enclosed is None else _margin(enclosed))
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


def _margin(piece: EnclosedPiece) -> Margin:
    """The exclusion inequality, compiled where that is installed."""
    try:
        from enumsol.search.certifiers._margin import Margins
    except ImportError:
        return partial(interval_exclusion_margin, piece, errors=2.0)
    return Margins(piece.ends, piece.low, piece.high).margin


def certified_enclosure(problem: ContactProblem, *, exactly: bool) -> CondensedEnclosure | None:
    """Balls for the data that a graph certifies; None when the problem's own data cannot be enclosed."""
    if not exactly:
        return as_computed(problem)
    try:
        return problem.enclosure
    except NotEnclosedError:
        return None
