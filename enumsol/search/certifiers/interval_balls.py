"""Leaves proven empty over a whole piece of the interval by error bounds in double arithmetic ("verified")."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from enumsol.condensation.enclosure import CondensedEnclosure, NotEnclosedError
from enumsol.kernel.interval import EnclosedPiece, as_computed, interval_exclusion_margins
from enumsol.search.certifiers.interval_rationals import ExactIntervalCertifier

if TYPE_CHECKING:
    from enumsol.condensation.exact import ExactCondensed
    from enumsol.problem import ContactProblem
    from enumsol.relaxation.interval import IntervalSystem
    from enumsol.search.interval import EmptyLeaf, Piece


#: Bounds must be this large [energy unit of the piece], so that a checker that sums in another order agrees.
_MARGIN = 1e-12


class VerifiedIntervalCertifier:
    """Accepts a leaf when the dual bounds of its multipliers are proven positive at both ends of the piece.

    A leaf that the balls cannot exclude is branched on. Only where there are no balls at all (S positive definite
    within rounding) do rationals decide, if S and g were condensed without rounding; there is no proof file then.

    Parameters
    ----------
    problem : ContactProblem
    exact : ExactCondensed
        Its data are certified: those of the problem, or S and g as computed.
    """

    def __init__(self, problem: ContactProblem, exact: ExactCondensed) -> None:
        self._enclosure = certified_enclosure(problem, exactly=exact.condensed_exactly)
        self._rationals = ExactIntervalCertifier(exact) if exact.condensed_exactly else None
        self._zero = exact.zero
        self._used_rationals = False
        self._piece: tuple[Piece, EnclosedPiece | None] | None = None

    @property
    def checkable(self) -> bool:
        """Whether balls accepted every leaf so far."""
        return not self._used_rationals

    def excluded(self, piece: Piece, system: IntervalSystem, leaf: EmptyLeaf) -> bool:
        """Whether the dual bounds at both ends of the piece are positive."""
        enclosed = self._enclosed(piece, system)
        if enclosed is not None:
            codes = np.array([leaf.codes], dtype=np.intp)
            first = np.zeros(len(leaf.rows), dtype=np.intp)
            margins = interval_exclusion_margins(enclosed, codes, first, leaf.rows, leaf.values, errors=2.0)
            return bool(margins[0] > _MARGIN)
        if self._rationals is None:
            return False
        self._used_rationals = True
        return self._rationals.excluded(piece, system, leaf)

    def _enclosed(self, piece: Piece, system: IntervalSystem) -> EnclosedPiece | None:
        if self._piece is None or self._piece[0] != piece:
            self._piece = (piece, self._make(piece, system))
        return self._piece[1]

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
