"""The search over an interval of alpha for a body that nothing holds (theory, section 14.8)."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from enumsol.condensation.enclosure import NotEnclosedError
from enumsol.search.floating_solvers import WEAK
from enumsol.search.interval.subintervals import IntervalCertifier
from enumsol.trusted.exclusion import exclusion_margin
from enumsol.trusted.over_interval import EnclosedPiece

if TYPE_CHECKING:
    from enumsol.condensation.condensed import CondensedProblem
    from enumsol.model.problem import ContactProblem
    from enumsol.relaxation.interval_relaxation import IntervalSystem
    from enumsol.search.certifiers.margins import Margin
    from enumsol.search.interval.interval_tree import EmptyLeaf
    from enumsol.search.interval.subintervals import Piece

#: As of other intervals.
_MARGIN = 1e-12


def on_weak_springs(problem: ContactProblem) -> CondensedProblem:
    """What the relaxations are about: the body on weak springs at the degrees of freedom where springs hold it."""
    modes = problem.modes
    if modes is None:
        raise AssertionError("the body is held")
    condensed: CondensedProblem = problem.on_springs.replace(A=problem.A + WEAK * modes.springs()).condensed
    return condensed


class FloatingIntervalCertifier(IntervalCertifier):
    """Accepts a leaf when the bounds of its multipliers prove it empty on the whole piece, within the bound or without.

    What balls cannot exclude is branched on: complete selections are followed by algebra.

    Parameters
    ----------
    problem : ContactProblem
    checkable : bool
        A proof is wanted.
    """

    def __init__(self, problem: ContactProblem, *, checkable: bool) -> None:
        self._problem, self.checkable = problem, checkable
        self._piece: tuple[Piece, Margin | None] | None = None

    def excluded(self, piece: Piece, system: IntervalSystem, leaf: EmptyLeaf) -> bool:
        """Whether the bounds at both ends of the piece are positive."""
        if self._piece is None or self._piece[0] != piece:
            self._piece = piece, self._on(piece, system)
        margin = self._piece[1]
        return margin is not None and margin(leaf.codes, leaf.rows, leaf.values) > _MARGIN

    def _on(self, piece: Piece, system: IntervalSystem) -> Margin | None:
        units = system.scaled
        try:
            within = EnclosedPiece.floating(self._problem, piece.a, piece.b, units.force, units.length)
        except NotEnclosedError:
            return None
        if not all(end.smallest_eigenvalue > 0 for end in within.ends):
            return None
        return partial(exclusion_margin, within, errors=2.0)
