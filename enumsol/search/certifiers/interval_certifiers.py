"""Leaves proven empty over a whole piece of the interval: in balls or in rationals (theory, section 7.9)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from enumsol.arithmetic.rationals import rational
from enumsol.condensation.enclosure import CondensedEnclosure, NotEnclosedError, enclosure_of
from enumsol.condensation.exact import ExactCondensed, ExactSystem
from enumsol.model.statuses import RowKind
from enumsol.relaxation.active_set import IntervalRowKind, IntervalSystem, interval_rows
from enumsol.relaxation.engine import with_implied
from enumsol.search.certifiers.protocol import FORM_ERRORS, energy_margin
from enumsol.search.certifiers.rational_certifier import accepted, energy_bound_positive
from enumsol.search.subintervals import IntervalCertifier, Piece
from enumsol.selections.rational_selections import ExactSelections
from enumsol.trusted.exclusion import exclusion_margin
from enumsol.trusted.over_interval import EnclosedPiece

if TYPE_CHECKING:
    from fractions import Fraction

    from enumsol.model.problem import ContactProblem
    from enumsol.search.certifiers.protocol import Margin
    from enumsol.search.interval_tree import EmptyLeaf
    from enumsol.support.array_types import Floats

#: Bounds must be this large [energy unit of the piece], so that a checker that sums in another order agrees.
_MARGIN = 1e-12
_CONES: dict[int, RowKind] = {
    IntervalRowKind.SLIP_AT_LEAST_PLUS: RowKind.CONE_PLUS,
    IntervalRowKind.SLIP_AT_LEAST_MINUS: RowKind.CONE_MINUS,
}


class VerifiedIntervalCertifier(IntervalCertifier):
    """Accepts a leaf when the dual bounds of its multipliers are proven positive at both ends of the piece.

    A leaf that the balls cannot exclude is branched on. Only where there are no balls at all (S positive definite
    within rounding) do rationals decide, if S and g were condensed without rounding; there is not a proof file then.
    Leaves of a body that nothing holds are empty within the bound of its rigid displacement (theory, section 14.8).

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
        self._form: tuple[Floats, EnclosedPiece] | None = None
        #: Rationals decide where there are no balls; the checker repeats what balls accepted.
        self.forms, self.rational, self.checkable = problem.held, self._rationals is not None, True

    def excluded(self, piece: Piece, system: IntervalSystem, leaf: EmptyLeaf) -> bool:
        """True if the dual bounds at both ends of the piece are positive."""
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

    def convex(self, piece: Piece, system: IntervalSystem, form: Floats) -> bool:
        """True if the form of these multipliers is proven convex on the piece, for all data in the balls."""
        enclosed = self._on(piece, system)[0]
        if enclosed is None:
            return False
        return all(one.smallest_eigenvalue > 0 for one in self._with_form(enclosed, form).forms)

    def needs_bound(self, piece: Piece, system: IntervalSystem, leaf: EmptyLeaf) -> bool:
        """True unless a leaf is excluded without a bound of the rigid displacement."""
        enclosed = self._on(piece, system)[0]
        return (
            enclosed is None or not exclusion_margin(enclosed.unbounded, leaf.codes, leaf.rows, leaf.values) > _MARGIN
        )

    def _with_form(self, enclosed: EnclosedPiece, form: Floats) -> EnclosedPiece:
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
        return CondensedEnclosure.as_computed(problem)
    try:
        return enclosure_of(problem)
    except NotEnclosedError:
        return None


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
        """True if the dual bounds at both ends of the piece are positive."""
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
        """True if the energy is bounded below by a positive number, at one g and for all friction of the piece."""
        forms = (
            # lambda_t - F_lo lambda_n is the cone's row of F_lo with its sign changed
            (-u, lowest.form(_CONES[kind], node)) if kind in _CONES else (u, highest.form(RowKind(kind), node))
            for kind, node, u in terms
        )
        return energy_bound_positive(highest.system.g, self._inverse, forms)
