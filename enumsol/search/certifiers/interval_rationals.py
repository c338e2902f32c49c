"""Leaves proven empty over a whole piece of the interval in rational arithmetic (theory, section 7.9)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from enumsol.arithmetic.rationals import rational
from enumsol.condensation.exact import ExactSystem
from enumsol.model.statuses import RowKind
from enumsol.relaxation.imposed_rows import with_implied
from enumsol.relaxation.interval_relaxation import IntervalRowKind, interval_rows
from enumsol.search.certifiers.rational_certifier import accepted, energy_bound_positive
from enumsol.search.interval.subintervals import IntervalCertifier
from enumsol.selections.rational_selections import ExactSelections

if TYPE_CHECKING:
    from fractions import Fraction

    from enumsol.condensation.exact import ExactCondensed
    from enumsol.relaxation.interval_relaxation import IntervalSystem
    from enumsol.search.interval.interval_tree import EmptyLeaf
    from enumsol.search.interval.subintervals import Piece

_CONES: dict[int, RowKind] = {
    IntervalRowKind.SLIP_AT_LEAST_PLUS: RowKind.CONE_PLUS,
    IntervalRowKind.SLIP_AT_LEAST_MINUS: RowKind.CONE_MINUS,
}


class ExactIntervalCertifier(IntervalCertifier):
    """Accepts a leaf when the dual bound of its multipliers is positive at both ends of the piece, exactly.

    With fixed multipliers the bound is concave in alpha, so that it is positive between the ends too.

    Parameters
    ----------
    exact : ExactCondensed
    """

    rational = True

    def __init__(self, exact: ExactCondensed) -> None:
        self._exact = exact
        self._inverse: Any = None
        self._systems: tuple[Piece, list[tuple[ExactSelections, ExactSelections]]] | None = None

    def excluded(self, piece: Piece, system: IntervalSystem, leaf: EmptyLeaf) -> bool:
        """Whether the dual bounds at both ends of the piece are positive."""
        if self._inverse is None:
            self._inverse = self._exact.S.inv()
        if self._systems is None or self._systems[0] != piece:
            self._systems = piece, self._systems_of(piece)
        ends = self._systems[1]
        lowest, highest = (solver.system.F for solver in ends[0])

        def imposed(node: int) -> dict[int, int]:
            constant, code = lowest[node] == highest[node], leaf.codes[node]
            return with_implied(code, interval_rows(code, friction=highest[node] > 0, constant=constant))

        terms = list(accepted(leaf.rows, leaf.values, imposed, system.scaled))
        return all(self._positive(terms, *solvers) for solvers in ends)

    def _systems_of(self, piece: Piece) -> list[tuple[ExactSelections, ExactSelections]]:
        """At both ends, with the smallest and with the largest coefficients on the piece."""
        S, F = self._exact.S, [self._exact.at(rational(alpha))[1] for alpha in (piece.a, piece.b)]
        bounds = [tuple(bound(pair) for pair in zip(*F, strict=True)) for bound in (min, max)]
        lowest, highest = (
            [ExactSelections(ExactSystem(S, g, coefficients)) for g in self._loads(piece)] for coefficients in bounds
        )
        return list(zip(lowest, highest, strict=True))

    def _loads(self, piece: Piece) -> list[tuple[Any, ...]]:
        """g at both ends, once where it does not vary; at an end where g vanishes its direction stands for it."""
        exact = self._exact
        origin = exact.origin
        ends: list[Fraction] = [piece.a, piece.b]
        if origin is not None and origin in [rational(end) for end in ends]:
            direction = 1 if rational(piece.b) > origin else -1
            return [tuple(direction * v for v in exact.g1)]
        return [exact.at(rational(end))[0] for end in (ends if exact.loaded else ends[:1])]

    def _positive(self, terms: list[tuple[int, int, Any]], lowest: ExactSelections, highest: ExactSelections) -> bool:
        """Whether the energy is bounded below by a positive number, at one g and for all friction of the piece."""
        forms = (
            # lambda_t - F_lo lambda_n is the cone's row of F_lo with its sign changed
            (-u, lowest.form(_CONES[kind], node)) if kind in _CONES else (u, highest.form(RowKind(kind), node))
            for kind, node, u in terms
        )
        return energy_bound_positive(highest.system.g, self._inverse, forms)
