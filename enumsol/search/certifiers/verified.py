"""The certifier of arithmetic "verified" (and the one that writes proofs): only proven conclusions.

Escalation only where needed: balls in double arithmetic first, rationals where a sign cannot be decided and the
problem is small enough, otherwise the selection is left undecided with the reason.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.model.statuses import CONDITIONS, RowKind
from enumsol.proof import leaves, records
from enumsol.proof.proof_file import coarse, fraction_text
from enumsol.search.certifiers import protocol
from enumsol.search.fathoming import Proposal, propose, without_load
from enumsol.search.reduction import NEAR
from enumsol.selections.solution import SelectionSolution
from enumsol.trusted.at_alpha import VerifiedSelection, holds_no_root, solve_selection
from enumsol.trusted.exclusion import Terms
from enumsol.trusted.status_rows import FREE, NONNEGATIVE, row_signs
from enumsol.trusted.uniqueness import ClosedSolution, closed_solution, lone_root, same_solution

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from enumsol.condensation.condensed import ScaledSystem
    from enumsol.condensation.enclosure import EnclosedSystem
    from enumsol.proof.records import EnclosureRecord, Record
    from enumsol.proof.writer import Recorder
    from enumsol.search.certifiers.rational_certifier import ExactCertifier
    from enumsol.search.fathoming import Point
    from enumsol.search.fathoming_in_contact import LoneProposal
    from enumsol.support.array_types import Codes, Floats, Indices
    from enumsol.trusted.joint_roots import JointRoot
    from enumsol.trusted.quadratic_forms import EnclosedForm


_ROW_NAMES = {
    RowKind.NORMAL_FORCE: "the normal force of node {}",
    RowKind.CONE_PLUS: "the slip bound of node {} (forward)",
    RowKind.CONE_MINUS: "the slip bound of node {} (backward)",
    RowKind.PENETRATION: "the gap of node {}",
    RowKind.SLIP_FORWARD: "the slip condition of node {}",
    RowKind.SLIP_BACKWARD: "the slip condition of node {}",
}
#: Rounding the multipliers hardly lowers bounds above this: for a wedge, 10 of 28,196 bounds are halved.
_CLEAR = 1e-6


class VerifiedCertifier(protocol.RecordingCertifier):
    """Proves prunings and complete selections, and writes the proof.

    Parameters
    ----------
    scaled : ScaledSystem
        The system that the search works on; it gives the units of the multipliers.
    enclosed : EnclosedSystem or None
        Balls for the same system; None sends everything to rationals.
    exact : callable giving an ExactCertifier, or None when the problem is too large for rationals
    recorder : Recorder
        Where the records of the proof go.
    node_ids : labels of the contact nodes, for messages
    precisely : callable giving the verified solution of a complete selection in many digits, or None
        Asked where balls in double arithmetic do not decide.
    """

    exactly, plain, lone = False, False, True
    _escalations: protocol.Escalations

    def __init__(
        self,
        scaled: ScaledSystem,
        enclosed: EnclosedSystem | None,
        exact: Callable[[], ExactCertifier | None],
        recorder: Recorder,
        node_ids: Sequence[Any],
        precisely: Callable[[Codes], VerifiedSelection | None] = lambda _: None,
    ) -> None:
        super().__init__(recorder)
        self._precisely = precisely
        self._scaled = scaled
        self._enclosed = enclosed
        self._margin = None if enclosed is None else protocol.energy_margin(enclosed)
        self._exact = exact
        self._node_ids = node_ids
        self._escalations = protocol.Escalations()
        self._form_margins: dict[EnclosedForm, protocol.Margin] = {}
        #: A complete selection was not decided by balls.
        self.hard = False
        #: Selections of the roots found in rationals.
        self._known: list[Codes] = []

    def excluded(self, codes: Codes, relaxation: protocol.Bound) -> bool:
        """True if the relaxation's multipliers are proven to exclude the partial assignment."""
        rows, values = relaxation.multipliers()
        if relaxation.form is not None:
            return self._excluded_by(relaxation.form, codes, rows, values)
        if self._margin is not None:
            if (kept := proven(self._margin, codes, rows, values)) is not None:
                self._escalations.balls += 1
                self._leaf(leaves.Excluded(rows, kept))
                return True
        elif (certifier := self._exact()) is not None and certifier.excluded(codes, relaxation):
            # no balls for an S that is positive definite only within rounding
            self._escalations.rationals += 1
            # the certifier passes over multipliers that prove nothing, a checker refuses them
            self._leaf(leaves.Excluded(*self._allowed(codes, rows, values), leaves.RATIONAL))
            return True
        self._escalations.refined += 1
        return False

    def _excluded_by(self, form: EnclosedForm, codes: Codes, rows: Indices, values: Floats) -> bool:
        """The same with a form in place of the energy."""
        margin = self._form_margins.get(form)
        if margin is None:
            margin = self._form_margins[form] = protocol.margin_of_form(form, protocol.FORM_ERRORS)
        kept = proven(margin, codes, rows, values)
        if kept is None:
            self._escalations.refined += 1
            return False
        numbers, weight = np.asarray(form.multipliers).ravel(), np.array([form.weight])
        back = self._back(form, lambda: records.DeclaredForm(form.codes, numbers, weight))
        self._escalations.balls += 1
        self._leaf(leaves.Excluded(rows, kept, back))
        return True

    def _allowed(self, codes: Codes, rows: Indices, values: Floats) -> Terms:
        """Those rows and multipliers that may prove something."""
        kind, node = np.divmod(rows, self._scaled.p)
        signs = row_signs(np.array(codes), self._scaled.F)[node, kind]
        keep = (signs == FREE) | ((signs == NONNEGATIVE) & (values > 0))
        return Terms(rows[keep], values[keep])

    def selection(self, codes: Codes) -> SelectionSolution | protocol.UndecidedPart | None:
        """All roots in a complete selection."""
        ball = None if self._enclosed is None else solve_selection(self._enclosed, codes)
        if self._enclosed is not None and not (ball is not None and ball.is_root):
            if holds_no_root(self._enclosed, codes, ball):
                self._escalations.balls += 1
                self._leaf(leaves.NoRoot())
                return None
            ball = self._precisely(codes) or ball
        if ball is not None and ball.is_root:
            self._escalations.balls += 1
            return self._regular(codes, ball)
        if ball is not None and ball.is_excluded:
            self._escalations.balls += 1
            self._leaf(leaves.NoRoot())
            return None
        self.hard = True
        certifier = self._exact()
        if certifier is None:
            if (found := self._closed_selection(codes, ball)) is not None:
                return found[0] if found else None
            return self._open(codes, ball)
        solution = certifier.selection(codes)
        if isinstance(solution, SelectionSolution):
            self._known.append(codes)
            if ball is not None:
                self._take_note(ball.force.mid, ball.w.mid)
        return self._in_rationals(codes, solution)

    def _open(self, codes: Codes, ball: VerifiedSelection | None) -> protocol.UndecidedPart:
        """Write a selection that balls do not decide, of a problem too large for rationals."""
        return self._undecided(codes, *_reason(codes, ball, self._node_ids))

    def _in_rationals(
        self, codes: Codes, solution: SelectionSolution | protocol.UndecidedPart | None
    ) -> SelectionSolution | protocol.UndecidedPart | None:
        """Write what was found in rationals."""
        if isinstance(solution, protocol.UndecidedPart):
            return self._undecided(codes, solution.reason, solution.hint)
        self._escalations.rationals += 1
        if solution is None:
            self._leaf(leaves.NoRoot(leaves.RATIONAL))
        else:
            points = [[_fraction(v) for v in vertex] for vertex in solution.vertices]
            self._leaf(leaves.RootSetRecord(points, solution.dimension))
        return solution

    # -- subtrees closed by their only possible solution (theory, section 6.11) ---------------------------------------

    def closed(self, codes: Codes, proposal: Proposal | None, near: Point) -> list[SelectionSolution] | None:
        """The solutions below a partial assignment, none or one, if it can hold one only; None if not proven."""
        if self._enclosed is None:
            return None
        if proposal is not None and proposal.least >= -NEAR:
            self._take_note(proposal.force, self._scaled.g - self._scaled.S @ proposal.force)
        ball = None if proposal is None else self._proven(proposal)
        # statuses that do not hold strictly are decided in rationals, where available; so is a root with wide bounds
        told = ball is not None and (ball.is_excluded or self._is_known(ball))
        if proposal is not None and ball is not None and (told or (proposal.strict and not ball.is_wide)):
            return self._closed_by(proposal, ball)
        certifier = None if proposal is not None and proposal.hopeless else self._exact()
        if certifier is not None and (exact := certifier.closing(codes, near)) is not None:
            closing, solutions = exact
            self._known += [solution.codes for solution in solutions]
            self._escalations.rationals += 1
            self._leaf(leaves.Closed(closing.selection, closing.free, closing.numbers, len(solutions)))
            return solutions
        found = None if proposal is None or ball is None or ball.is_wide else self._closed_by(proposal, ball)
        if found and proposal is not None and certifier is not None:
            exactly = certifier.solution_near(proposal)
            if exactly is not None:
                self._known.append(exactly.codes)
                return [exactly]
        return found

    def alone(self, codes: Codes, proposal: LoneProposal, bound: protocol.Bound) -> list[SelectionSolution] | None:
        """The root of what is proposed, if it is proven to be the only one below a partial assignment; else None."""
        if self._enclosed is None:
            return None
        terms = self._allowed(codes, *bound.multipliers())
        given = proposal.selection, proposal.weights, proposal.strengths
        root = lone_root(self._enclosed, codes, *given, *terms)
        if root is None:
            return None
        self._escalations.balls += 1
        chosen, weights, strengths = given
        return [self._regular(chosen, root, lambda ball: leaves.Alone(chosen, weights, ball, strengths, terms))]

    def _take_note(self, force: Floats, w: Floats) -> None:
        """Take note of nodes that slide without load at a solution."""
        self.sliding |= without_load(self._scaled, force, w)

    def _closed_selection(self, codes: Codes, near: VerifiedSelection | None) -> list[SelectionSolution] | None:
        """The same for a selection whose conditions are not decided, without rationals."""
        if near is None:
            return None
        point = near.force.mid, near.w.mid
        self._take_note(*point)
        proposal = propose(self._scaled, codes, point, exactly=False)
        ball = None if proposal is None else self._proven(proposal)
        return None if proposal is None or ball is None or ball.is_wide else self._closed_by(proposal, ball)

    def _proven(self, proposal: Proposal) -> ClosedSolution | None:
        system = self._enclosed
        if proposal.weights is None or system is None:
            return None
        ball = closed_solution(system, proposal.named, proposal.free, proposal.weights, proposal.force)
        return ball if ball is not None and (ball.is_root or ball.is_excluded) else None

    def _is_known(self, ball: ClosedSolution) -> bool:
        """True if it is a root that was found in rationals before."""
        return any(same_solution(ball.core, ball.possible, codes, _only(codes)) for codes in self._known)

    def _closed_by(self, proposal: Proposal, ball: ClosedSolution) -> list[SelectionSolution] | None:
        """Write a leaf and give its solutions; None where a root could not be told from another one."""
        record = proposal.named, proposal.free, proposal.numbers, ball.force.mid * self._scaled.force
        if ball.is_excluded:
            self._escalations.balls += 1
            self._leaf(leaves.Closed(*record))
            return []
        solution = self._regular_one(ball)
        if solution is None:
            known = [other for other in self._verified.values() if isinstance(other, ClosedSolution)]
            alike = [same_solution(ball.core, ball.possible, other.core, other.possible) for other in known]
            if None in alike and True not in alike:
                return None
            self._verified[ball.core] = ball
            solution = SelectionSolution(
                ball.core, (ball.force.mid,), 0, 0, strict=False, index=ball.index, possible=ball.possible
            )
        self._escalations.balls += 1
        self._leaf(leaves.Closed(*record, self._ball(ball, ball.index)))
        return [solution]

    def _regular_one(self, ball: ClosedSolution) -> SelectionSolution | None:
        """The solution in its only selection, if there is one only and it is regular."""
        if any(len(codes) > 1 for codes in ball.possible):
            return None
        codes = tuple(code for (code,) in ball.possible)
        regular = ball.regular
        if regular is None and self._enclosed is not None:
            regular = solve_selection(self._enclosed, codes)
        if regular is None or not regular.is_root:
            return None
        self._verified[codes] = regular
        return SelectionSolution(codes, (regular.force.mid,), 0, regular.index, strict=True)

    def add(self, part: protocol.Certified) -> None:
        """Take over what the certifier of a subtree has proven."""
        super().add(part)
        if part.escalations is not None:
            self._escalations.add(part.escalations)

    def forget(self) -> None:
        """Forget what was proven."""
        super().forget()
        self._escalations = protocol.Escalations()
        self._known.clear()

    def _regular(
        self, codes: Codes, ball: VerifiedSelection, leaf: Callable[[EnclosureRecord], Record] = leaves.RegularRoot
    ) -> SelectionSolution:
        """Write a leaf with a regular root, made of its enclosure."""
        self._verified[codes] = ball
        self._leaf(leaf(self._ball(ball, ball.index)))
        return SelectionSolution(codes, (ball.force.mid,), 0, ball.index, strict=True)

    def _undecided(self, codes: Codes, reason: str, hint: str) -> protocol.UndecidedPart:
        self._escalations.undecided += 1
        self._leaf(leaves.UndecidedRecord(reason))
        return protocol.UndecidedPart(codes, reason, hint, examined=True)

    def _ball(self, found: VerifiedSelection | ClosedSolution | JointRoot, index: int | None) -> EnclosureRecord:
        """Where a root is, in the problem's units."""
        force = self._scaled.force
        return records.EnclosureRecord(found.force.mid * force, found.force.rad * force * protocol.WIDEN, index)


def proven(margin: protocol.Margin, codes: Codes, rows: Indices, values: Floats) -> Floats | None:
    """Multipliers that exclude a partial assignment, rounded if these do it as well; None if those given do not."""
    short = coarse(values)
    if margin(codes, rows, short) > _CLEAR:
        return short
    return values if margin(codes, rows, values) > 0 else None


def _only(codes: Codes) -> tuple[frozenset[int], ...]:
    return tuple(frozenset((code,)) for code in codes)


def _fraction(value: Any) -> str:
    return fraction_text(int(value.p), int(value.q))


def _reason(codes: Codes, ball: VerifiedSelection | None, node_ids: Sequence[Any]) -> tuple[str, str]:
    """Why a selection could not be decided, and what may help."""
    hint = (
        "the problem is too large for exact arithmetic; perturb the load, or take problem.at_contact_nodes() of a body "
        "that is held"
    )
    if ball is None:
        return "the matrix of a selection may be singular", hint
    if not ball.slack.finite:
        return "the solution of a selection overflows float64", "scale the data"
    names = [
        _ROW_NAMES[kind].format(node)
        for node, code in zip(node_ids, codes, strict=True)
        for kind in CONDITIONS[code].inequalities
    ]
    slack = np.abs(ball.slack.mid)
    k = int(np.argmin(np.where(slack <= ball.slack.rad, slack, np.inf)))
    if k >= len(names):
        # of a body that nothing holds both bounds of every coordinate of its rigid displacement follow
        mode = (k - len(names)) % ((len(slack) - len(names)) // 2)
        names += [f"what is left of max_rigid_displacement along mode {mode}"] * (len(slack) - len(names))
        hint = "take another max_rigid_displacement"
    return f"{names[k]} is zero to {slack[k] + ball.slack.rad[k]:.0e} (scaled)", hint
