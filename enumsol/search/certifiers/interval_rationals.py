"""Leaves proven empty over a whole piece of the interval in rational arithmetic (theory, section 7.9)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from enumsol.arithmetic.rationals import rational
from enumsol.relaxation.interval import imposed_interval_rows
from enumsol.search.certifiers.rationals import DualBound, terms_of

if TYPE_CHECKING:
    from collections.abc import Mapping
    from fractions import Fraction

    from enumsol.condensation.exact import ExactPath
    from enumsol.relaxation.interval import IntervalSystem
    from enumsol.search.interval import EmptyLeaf, Piece


class ExactIntervalCertifier:
    """Accepts a leaf when the dual bound of its multipliers is positive at both ends of the piece, exactly.

    With fixed multipliers the bound is concave in alpha, so that it is positive between the ends too.

    Parameters
    ----------
    exact : ExactPath
    """

    checkable = False

    def __init__(self, exact: ExactPath) -> None:
        self._exact = exact
        self._bound = DualBound(exact.S)
        self._friction_on: tuple[Piece, tuple[Any, ...], tuple[Any, ...]] | None = None

    def excluded(self, piece: Piece, system: IntervalSystem, leaf: EmptyLeaf) -> bool:
        """Whether the dual bounds at both ends of the piece are positive."""
        lowest, highest = self._friction(piece)

        def imposed(node: int) -> Mapping[Any, int]:
            constant = lowest[node] == highest[node]
            return imposed_interval_rows(leaf.codes[node], friction=highest[node] > 0, constant=constant)

        terms = terms_of(leaf.rows, leaf.values, system.scaled, imposed)
        return all(self._bound.positive(terms, g, lowest, highest) for g in self._loads(piece))

    def _friction(self, piece: Piece) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
        """Smallest and largest coefficients on the piece."""
        if self._friction_on is None or self._friction_on[0] != piece:
            ends = [self._exact.at(rational(alpha))[1] for alpha in (piece.a, piece.b)]
            self._friction_on = (piece, tuple(map(min, *ends)), tuple(map(max, *ends)))
        return self._friction_on[1], self._friction_on[2]

    def _loads(self, piece: Piece) -> list[tuple[Any, ...]]:
        """g at both ends, once where it does not vary; at an end where g vanishes its direction stands for it."""
        exact = self._exact
        origin = exact.origin
        ends: list[Fraction] = [piece.a, piece.b]
        if origin is not None and origin in [rational(end) for end in ends]:
            direction = 1 if rational(piece.b) > origin else -1
            return [tuple(direction * v for v in exact.g1)]
        return [exact.at(rational(end))[0] for end in (ends if exact.loaded else ends[:1])]
