"""The certifier of arithmetic "verified" (and the one that writes proofs): only proven conclusions.

Escalation only where needed: balls in double arithmetic first, rationals where a sign cannot be decided and the
problem is small enough, otherwise the selection is left undecided with the reason.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.model.statuses import CONDITIONS, RowKind
from enumsol.proof import leaves, records
from enumsol.proof.proof_file import fraction_text
from enumsol.search.certifiers import protocol
from enumsol.search.certifiers.exclusions import proven
from enumsol.search.fathoming import propose, without_load
from enumsol.search.reduction import NEAR
from enumsol.selections.solution import SelectionSolution
from enumsol.trusted.at_alpha import ClosedSolution, VerifiedSelection, settled_selection, solve_selection
from enumsol.trusted.exclusion import Terms
from enumsol.trusted.status_rows import CONDITIONS as ROWS, FREE, NONNEGATIVE, SLIP_MINUS, SLIP_PLUS, row_signs
from enumsol.trusted.uniqueness import closed_solution, same_solution

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from enumsol.condensation.condensed import ScaledSystem
    from enumsol.proof.records import EnclosureRecord, Record
    from enumsol.proof.writer import Recorder
    from enumsol.search.certifiers.exclusions import Exclusions
    from enumsol.search.certifiers.rational_certifier import ExactCertifier
    from enumsol.search.reduction import Point, Proposal
    from enumsol.support.array_types import Codes, Floats, Indices
    from enumsol.trusted.quadratic_forms import EnclosedForm
    from enumsol.trusted.reference import PlaneReference


_ROW_NAMES = {
    RowKind.NORMAL_FORCE: "the normal force of node {}",
    RowKind.CONE_PLUS: "the slip bound of node {} (forward)",
    RowKind.CONE_MINUS: "the slip bound of node {} (backward)",
    RowKind.PENETRATION: "the gap of node {}",
    RowKind.SLIP_FORWARD: "the slip condition of node {}",
    RowKind.SLIP_BACKWARD: "the slip condition of node {}",
}
#: How a node slips, or is about to, where one of these kinds of rows is zero.
_SLIPS = {2: SLIP_PLUS, 5: SLIP_PLUS, 3: SLIP_MINUS, 6: SLIP_MINUS}


class VerifiedCertifier(protocol.Certifier):
    """Proves prunings and complete selections, and writes the proof.

    Parameters
    ----------
    scaled : ScaledSystem
        The system that the search works on; it gives the units of the multipliers.
    exclusions : Exclusions or None
        With balls for the same system; None sends everything to rationals.
    exact : callable giving an ExactCertifier, or None when the problem is too large for rationals
    recorder : Recorder
        Where the records of the proof go.
    node_ids : labels of the contact nodes, for messages
    precisely : callable giving the verified solution of a complete selection in many digits, or None
        Asked where balls in double arithmetic do not decide.
    """

    exactly, lone = False, True
    _escalations: protocol.Escalations

    def __init__(
        self,
        scaled: ScaledSystem,
        exclusions: Exclusions | None,
        exact: Callable[[], ExactCertifier | None],
        recorder: Recorder,
        node_ids: Sequence[Any],
        precisely: Callable[[Codes], VerifiedSelection | None] = lambda _: None,
    ) -> None:
        super().__init__(recorder)
        self._precisely = precisely
        self._scaled = scaled
        self._exclusions = exclusions
        self._enclosed = None if exclusions is None else exclusions.system
        self._exact = exact
        self._node_ids = node_ids
        self._escalations = protocol.Escalations()
        self._margin_of = cache(partial(protocol.margin_of_form, errors=protocol.FORM_ERRORS))
        #: Selections of the roots found in rationals.
        self._known: list[Codes] = []

    def excluded(self, codes: Codes, relaxation: protocol.Bound) -> bool:
        """True if the relaxation's multipliers are proven to exclude the partial assignment."""
        if relaxation.form is not None:
            return self._excluded_by(relaxation.form, codes, *relaxation.multipliers())
        if self._exclusions is not None:
            if (found := self._exclusions.record(codes, relaxation, within=self.bounded)) is not None:
                self._nothing(*found)
                return True
        elif (certifier := self._exact()) is not None and certifier.excluded(codes, relaxation):
            # no balls for an S that is positive definite only within rounding
            self._escalations.rationals += 1
            # the certifier passes over multipliers that prove nothing, a checker refuses them
            terms = self._allowed(codes, *relaxation.multipliers())
            self._leaf(leaves.Excluded(*terms, leaves.RATIONAL))
            return True
        self._escalations.refined += 1
        return False

    def _nothing(self, record: Record, bounded: bool = False) -> None:
        """Write a leaf without a root."""
        self.bounded |= bounded
        self._escalations.balls += 1
        self._leaf(record)

    def _excluded_by(self, form: EnclosedForm, codes: Codes, rows: Indices, values: Floats) -> bool:
        """True if multipliers exclude the assignment with a form in place of the energy."""
        kept = proven(self._margin_of(form), codes, rows, values)
        if kept is None:
            self._escalations.refined += 1
            return False
        numbers, weight = np.asarray(form.multipliers).ravel(), np.array([form.weight])
        back = self._back(form, lambda: records.DeclaredForm(form.codes, numbers, weight))
        self._escalations.balls += 1
        self._leaf(leaves.Excluded(rows, kept, back))
        return True

    def _allowed(self, codes: Codes, rows: Indices, values: Floats) -> Terms:
        """Rows and multipliers that may prove something."""
        kind, node = np.divmod(rows, self._scaled.p)
        signs = row_signs(np.array(codes), self._scaled.F)[node, kind]
        keep = (signs == FREE) | ((signs == NONNEGATIVE) & (values > 0))
        return Terms(rows[keep], values[keep])

    def selection(self, codes: Codes) -> SelectionSolution | protocol.UndecidedPart | None:
        """All roots in a complete selection."""
        exclusions, ball = self._exclusions, None
        if exclusions is not None:
            if (unbalanced := exclusions.unbalanced(codes)) is not None:
                self._nothing(unbalanced)
                return None
            found = settled_selection(exclusions.system, codes, self._precisely)
            if isinstance(found, VerifiedSelection):
                self._escalations.balls += 1
                return self._regular(codes, found)
            if (none := exclusions.no_root(codes, none=found is None, within=self.bounded)) is not None:
                self._nothing(*none)
                return None
            ball = None if found is None else found.near
        self.hard = True
        certifier = self._exact()
        held = exclusions is None or exclusions.system.held
        if certifier is None:
            if not held:
                return self._shared(codes, ball) or self._open(codes, ball)
            if (closed := self._closed_selection(codes, ball)) is not None:
                return closed[0] if closed else None
            return self._open(codes, ball)
        solution = certifier.selection(codes)
        self.bounded |= certifier.bounded
        if isinstance(solution, SelectionSolution):
            self._known.append(codes)
            if ball is not None and held:
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
        if certifier is not None:
            closing = propose(self._scaled, codes, near, exactly=True)
            solutions = certifier.closed(codes, closing, near)
            if closing is not None and solutions is not None:
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

    def alone(self, codes: Codes, record: leaves.Alone) -> list[SelectionSolution] | None:
        """The root of a record, if it is proven to be the only one below a partial assignment; else None."""
        if self._enclosed is None or record.terms is None:
            return None
        leaf = replace(record, terms=self._allowed(codes, *record.terms))
        root = leaf.holds(self._enclosed, codes)
        if root is None:
            return None
        self._escalations.balls += 1
        return [self._regular(leaf.selection, root, lambda said: replace(leaf, enclosure=said))]

    def _take_note(self, force: Floats, w: Floats) -> None:
        """Take note of nodes that slide without load at a solution."""
        self.sliding |= without_load(self._scaled, force, w)

    def _closed_selection(self, codes: Codes, near: VerifiedSelection | None) -> list[SelectionSolution] | None:
        """The solutions of a selection whose conditions are not decided, without rationals; None if not proven."""
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
        self._leaf(leaves.Closed(*record, self._ball(ball)))
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
        self._leaf(leaf(self._ball(ball)))
        return SelectionSolution(codes, (ball.force.mid,), 0, ball.index, strict=True)

    def _undecided(self, codes: Codes, reason: str, hint: str) -> protocol.UndecidedPart:
        self._escalations.undecided += 1
        self._leaf(leaves.UndecidedRecord(reason))
        return protocol.UndecidedPart(codes, reason, hint, examined=True)

    def _ball(self, found: VerifiedSelection) -> EnclosureRecord:
        """Enclosure of a root, in the problem's units."""
        return records.EnclosureRecord.around(found.force, self._scaled.force, found.index, protocol.WIDEN)

    # -- a body that nothing holds (theory, section 14) ----------------------------------------------------------------

    def reference(self, selection: Codes) -> PlaneReference | None:
        """The form of a root, if one is proven definite."""
        return None if self._exclusions is None else self._exclusions.reference(selection)

    def only_root(
        self, codes: Codes, reference: PlaneReference, proposal: leaves.OnlyReference
    ) -> list[SelectionSolution] | None:
        """The roots below an assignment, that of a form or none; None if that is not proven."""
        exclusions = self._exclusions
        within = self.bounded or self._exact() is None
        needs = None if exclusions is None else exclusions.only_root(codes, reference, proposal, within=within)
        if needs is None or exclusions is None:
            return None
        self.bounded |= needs
        self._escalations.balls += 1
        selection = reference.selection
        back = self._back(selection, lambda: exclusions.declared[selection])
        leaf = replace(proposal, back=back)
        if reference.lies_below(codes):
            assert reference.root is not None
            return [self._regular(selection, reference.root, lambda said: replace(leaf, enclosure=said))]
        self._leaf(leaf)
        return []

    def _shared(self, codes: Codes, ball: VerifiedSelection | None) -> SelectionSolution | None:
        """The root that a selection may share with others, some nodes being between stick and slip."""
        shared = [known for known in self._verified.values() if isinstance(known, ClosedSolution)]
        root = next((known for known in shared if known.has(codes)), None)
        if root is None:
            slips = None if ball is None else _between(codes, ball)
            if not slips or self._enclosed is None:
                return None
            leaf = leaves.SharedRoot(tuple(sorted(slips.items())), records.NOWHERE)
            core, root = leaf.core(codes), leaf.holds(self._enclosed, codes)
            # one that is known has other nodes between stick and slip
            if root is None or any(known.core == core for known in shared):
                return None
            self._verified[core] = root
        self._escalations.balls += 1
        self._leaf(leaves.SharedRoot(root.slips, self._ball(root)))
        point, sign = (root.force.mid,), root.index
        return SelectionSolution(root.core, point, 0, sign, strict=False, index=sign, possible=root.possible)


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


def _between(codes: Codes, ball: VerifiedSelection) -> dict[int, int] | None:
    """Nodes whose slip bound or slip is open, and how they slip or may slip; None if another condition is open."""
    slips = {}
    rows = [(kind, i) for i, code in enumerate(codes) for kind in ROWS[code][1]]
    for number in np.flatnonzero(~(ball.slack.mid > ball.slack.rad)).tolist():
        kind, node = rows[number] if number < len(rows) else (None, 0)
        if kind not in _SLIPS:
            return None
        slips[node] = _SLIPS[kind]
    return slips
