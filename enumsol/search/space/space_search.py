"""The tree in three dimensions: slip directions in sectors of the circle (theory, section 12)."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from enumsol.condensation.enclosure import NotEnclosedError
from enumsol.model.sectors import (
    DEEPEST,
    RUN,
    SECTORS,
    around,
    direction,
    end_number,
    is_sector,
    level_of,
    nearest,
    parts_around,
    span,
)
from enumsol.model.statuses import CONTACT, SLIP_MINUS, SLIP_PLUS, STICK, UNDECIDED
from enumsol.proof.leaves import (
    Alone,
    BoxedRoot,
    Excluded,
    NoRoot,
    OnlyReference,
    RegularRoot,
    Unbalanced,
    UndecidedRecord,
)
from enumsol.proof.records import NOWHERE, DeclaredForm, EnclosureRecord
from enumsol.relaxation.engine import PRUNE_MARGIN, Relaxation
from enumsol.relaxation.space_relaxation import SpaceEngine, SpaceRelaxation
from enumsol.search.certifiers.protocol import WIDEN, Bound, Certifier, Refine, UndecidedPart
from enumsol.search.outcome import HOLD
from enumsol.search.space.open_leaves import Cause, KnownBoxes, obstacle, sector_to_halve
from enumsol.trusted.floating_bounds import motion_beside
from enumsol.trusted.space.force_bound import resultants, unbounded
from enumsol.trusted.space.leaves import Open, SpaceRoot, settle
from enumsol.trusted.space.sector_rows import is_sector_covering, is_within
from enumsol.trusted.space.space_uniqueness import LeafReference, OnlySolution
from enumsol.trusted.space.turning import turned_by

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from enumsol.condensation.space_condensed import EnclosedSpace, SpaceSystem
    from enumsol.proof.writer import Recorder
    from enumsol.search.reference_closer import OnlyRoot
    from enumsol.support.array_types import Codes, Floats
    from enumsol.trusted.space.boxed_solution import BoxedSolution
    from enumsol.trusted.space.sector_rows import Row
    from enumsol.trusted.space.space_uniqueness import LooseSolution


#: Enclosures of solutions in boxes are made in steps of four.
_WIDER = 4.0 * WIDEN
_PERTURB, _HOLD = "perturb the load, by 1e-4 of its largest entry, say", "hold the body by stiffer springs"


class SpaceSplitting:
    """Open or in contact; then stick, or slip in one of four sectors, from which slices are cut; or it is halved."""

    def __init__(self, engine: SpaceEngine) -> None:
        self._engine, self._system = engine, engine.system

    def rows(self, node: int, code: int) -> Sequence[tuple[int, int]]:
        """(slot, mode) of the rows that a contact node imposes in a status."""
        rows, modes = self._engine.imposed(node, code)
        return [(row // self._system.p, mode) for row, mode in zip(rows, modes, strict=True)]

    def children(self, codes: Codes, node: int, relaxation: Relaxation | None) -> list[int]:
        """Codes of the children, the one nearest to the minimiser first."""
        children = list(self._engine.children(node, codes[node]))
        if relaxation is None:
            return children
        if isinstance(relaxation, SpaceRelaxation) and relaxation.cut is not None and relaxation.cut[0] == node:
            return list(relaxation.cut[1])
        if codes[node] == UNDECIDED:
            force, w = relaxation.at(node)
            return children[:: -1 if force > -w else 1]
        if codes[node] == CONTACT and self._engine.tangents[node] == 1:
            return children
        tau, v = self._system.taus(relaxation.forces)[node], self._system.slips(relaxation.displacements)[node]
        towards = tau / (np.linalg.norm(tau) + 1e-300) + v / (np.linalg.norm(v) + 1e-300)
        return sorted(children, key=lambda code: -_towards(code, towards) if code > SECTORS else -10.0)

    def covers(self, node: int, code: int, children: Sequence[int]) -> bool:
        """True if codes, in any order, cover a partial status of a node."""
        return is_sector_covering(code, children, self._engine.tangents[node])

    def holds(self, code: int, final: int) -> bool:
        """True if a status allows a final one."""
        return code == UNDECIDED or is_within(final, code)

    def towards(self, codes: Codes, node: int, final: int) -> list[int]:
        """Codes of the node's children, in a sector the final one's and what is beside it."""
        code = codes[node]
        if code < SECTORS or final < SECTORS:
            return list(self._engine.children(node, code))
        begin, end = span(final - SECTORS)
        parts = parts_around(code - SECTORS, begin, end - 1, level_of(final - SECTORS))
        return [SECTORS + part for part in parts]

    def above(self, code: int, deeper: Iterable[int]) -> int:
        """The code of which this one is a child."""
        if code > SECTORS and level_of(code - SECTORS) > 2:
            return SECTORS + around([other - SECTORS for other in (code, *deeper)])
        return CONTACT if code > SECTORS or code in (STICK, SLIP_PLUS, SLIP_MINUS) else UNDECIDED


def _towards(code: int, vector: np.ndarray) -> float:
    """Component of a vector along the middle direction of a sector."""
    number = code - SECTORS
    middle = np.add(direction(number), direction(end_number(number)))
    return float(middle @ vector / np.linalg.norm(middle))


class SpaceExclusions:
    """Exclusions of assignments; of a body that nothing holds if possible without a bound of its rigid displacement.

    Parameters
    ----------
    enclosed : EnclosedSpace

    Attributes
    ----------
    system, free : EnclosedSpace
        With its bound, and with one beyond which there are no solutions; the same of a body that is held.
    """

    def __init__(self, enclosed: EnclosedSpace) -> None:
        self.system, self.free = enclosed, enclosed if enclosed.held else unbounded(enclosed)
        self._references: dict[Codes, LeafReference | None] = {}
        #: How the forms of roots are declared, but for enclosures, by their leaves.
        self.numbers: dict[Codes, tuple[Floats, Floats]] = {}

    def reference(self, system: SpaceSystem, leaf: Codes) -> LeafReference | None:
        """The form of the root of a leaf, if one is proven definite."""
        from enumsol.search.space.space_references import reference_numbers  # of bodies that nothing holds only

        if leaf not in self._references:
            self._references[leaf], root = None, settle(self.system, leaf)
            with np.errstate(all="ignore"):
                tried = reference_numbers(system, self.system, root, leaf) if isinstance(root, SpaceRoot) else ()
                for numbers, *more in tried:
                    found = LeafReference.of(self.system, leaf, numbers, *more)
                    if found is not None:
                        self.numbers[leaf], self._references[leaf] = (numbers, np.array(more)), found
                        break
        return self._references[leaf]

    def record(
        self, codes: Codes, rows: list[Row], values: Floats, *, within: bool
    ) -> tuple[Excluded | Unbalanced | NoRoot, bool] | None:
        """A record that excludes a partial assignment, and whether it needs the bound; or None.

        ``within``: the bound is known to be needed. Otherwise it is used only where all statuses are determined
        (theory, section 14.4).
        """
        excluded = Excluded(rows, values)
        if len(rows) and excluded.holds(self.free, codes, 2.0):
            return excluded, False
        if self.system.held:
            return None
        if (unbalanced := self.unbalanced(codes)) is not None:
            return unbalanced, False
        told = not any(code in (UNDECIDED, CONTACT) for code in codes)
        if (within or told) and len(rows) and excluded.holds(self.system, codes, 2.0):
            if told and settle(self.free, codes) is None:
                return NoRoot(), False
            return excluded, True
        return None

    def unbalanced(self, codes: Codes) -> Unbalanced | None:
        """A record that no forces below a partial assignment are in balance with the load; or None."""
        if self.system.held:
            return None
        record = Unbalanced(motion_beside(self.system, resultants(self.system, codes)))
        return record if record.holds(self.system, codes) else None


class SpaceCertifier(Certifier):
    """Proves prunings and leaves with the trusted core, and writes the proof.

    Parameters
    ----------
    engine : SpaceEngine
    enclosed : EnclosedSpace
        Balls for its system; without radii in fast arithmetic.
    recorder : Recorder
    exclusions : SpaceExclusions, optional
        By these balls, where they are known already.
    """

    def __init__(
        self,
        engine: SpaceEngine,
        enclosed: EnclosedSpace,
        recorder: Recorder,
        exclusions: SpaceExclusions | None = None,
    ) -> None:
        super().__init__(recorder)
        self._engine, self.enclosed = engine, enclosed
        self._exclusions = exclusions or SpaceExclusions(enclosed)
        self._boxes = KnownBoxes(engine.system, enclosed)

    def excluded(self, codes: Codes, relaxation: Bound) -> bool:
        """True if the relaxation's multipliers are proven to exclude the partial assignment."""
        if not relaxation.bound > PRUNE_MARGIN:
            return False
        rows, values = self._multipliers(relaxation)
        if (form := relaxation.form) is None:
            found = self._exclusions.record(codes, rows, values, within=self.bounded)
            if found is not None:
                self.bounded |= found[1]
                self._leaf(found[0])
            return found is not None
        leaf = Excluded(rows, values)
        if not leaf.holds(form, codes, 2.0):
            return False
        by = self._back(form, lambda: DeclaredForm(self._whole, form.numbers, np.zeros(0)))
        self._leaf(replace(leaf, by=by))
        return True

    def _multipliers(self, bound: Bound) -> tuple[list[Row], Floats]:
        """Rows, which the engine numbers, and their multipliers."""
        numbers, values = bound.multipliers()
        if isinstance(numbers, list):
            return numbers, values
        return [self._engine.rows[number] for number in numbers.tolist()], values

    @property
    def _whole(self) -> Codes:
        return (UNDECIDED,) * self._engine.system.p

    def selection(self, codes: Codes) -> SpaceRoot | BoxedSolution | UndecidedPart | Refine | None:
        """The root of a leaf, a sector to halve, or why the leaf stays open."""
        if (unbalanced := self._exclusions.unbalanced(codes)) is not None:
            self._leaf(unbalanced)
            return None
        answer = self._settled(codes)
        if not self.enclosed.held and (answer is None or isinstance(answer, SpaceRoot)):
            self.bounded |= not isinstance(settle(self._exclusions.free, codes), type(answer))
        return answer

    def _settled(self, codes: Codes) -> SpaceRoot | BoxedSolution | UndecidedPart | Refine | None:
        """The answer for a leaf, which is written."""
        answer = settle(self.enclosed, codes)
        if answer is None:
            self._leaf(NoRoot())
        elif isinstance(answer, Open):
            node = sector_to_halve(answer)
            # boxes rest on a stiffness that is positive definite
            boxed = self._boxes.holding(answer, halved=node is not None) if self.enclosed.held else None
            if boxed is not None:
                return self._in_box(codes, boxed)
            if node is not None and level_of(codes[node] - SECTORS) < DEEPEST:
                return Refine(node)
            cause, mode = obstacle(answer)
            reason = cause.value if mode is None else f"{cause.value} (rigid mode {mode})"
            self._leaf(UndecidedRecord(reason))
            hint = {Cause.ROUNDING: _HOLD, Cause.RIGID: HOLD}.get(cause, _PERTURB)
            return UndecidedPart(codes, reason, hint, examined=True)
        else:
            self._leaf(RegularRoot(self._ball(answer)))
            answer = self._verified[codes] = self._placed(codes, answer)
        return answer

    def _in_box(self, codes: Codes, found: BoxedSolution) -> BoxedSolution:
        """The solution of a box, and its leaf written."""
        self._verified[codes], unit = found, self.enclosed.unit
        centre, radius, rho = found.box.numbers
        self._leaf(BoxedRoot(centre * unit, radius * unit, rho * unit**2, self._ball(found, wider=_WIDER)))
        return found

    def _placed(self, codes: Codes, root: SpaceRoot) -> SpaceRoot:
        """A root, settled anew from sectors around it, so that its numbers do not depend on the way to its leaf."""
        there = list(codes)
        turning = [i for i, code in enumerate(codes) if code > SECTORS]
        for i, (x, y) in zip(turning, turned_by(root.centre, root.angle)[0].tolist(), strict=True):
            number = nearest(x, y, 17) - 1  # of two sectors of this level around the direction
            if not is_sector(number + RUN):  # next to the end of a quarter
                return root
            there[i] = SECTORS + number + RUN
        # its directions lie in that box: the only root there is this one
        again = settle(self.enclosed, tuple(there)) if turning else None
        return again if isinstance(again, SpaceRoot) else root

    def close(self, numbers: Floats, codes: Codes | None, normal: Floats) -> list[SpaceRoot | OnlySolution] | None:
        """The only solution of the whole problem, as a list, and its leaf written; None if that is not proven.

        Parameters
        ----------
        numbers : of the form, as ``trusted.space.space_uniqueness.Numbers.of`` takes them
        codes : of a leaf that holds the solution; None: its statuses need not hold strictly
        normal : (p,) array, lambda_n near the solution
        """
        found: SpaceRoot | OnlySolution | None
        record = Alone(codes or (), numbers, NOWHERE)
        try:
            found = record.holds(self.enclosed, self._whole, errors=2.0, near=normal)
        except NotEnclosedError:
            return None
        # forces that are known no better, relative to the largest one, are left to the tree
        if found is None or not np.max(found.y.rad) <= 1e-3 * np.max(np.abs(found.y.mid), initial=1e-6):
            return None
        self._verified[codes or (UNDECIDED,) * len(normal)] = found
        self._leaf(replace(record, enclosure=self._ball(found)))
        return [found]

    def alone_in(self, codes: Codes, numbers: Floats, leaf: Codes) -> list[SpaceRoot] | None:
        """The root of a leaf, if no other solution has the statuses of an assignment, and that record written; or None.

        Parameters
        ----------
        codes : of the assignment
        numbers : of the form, as for ``close``
        leaf : codes of the leaf
        """
        record = Alone(leaf, numbers, NOWHERE)
        found = record.holds(self.enclosed, codes, errors=2.0)
        if found is None:
            return None
        self._leaf(replace(record, enclosure=self._ball(found)))
        found = self._verified[leaf] = self._placed(leaf, found)
        return [found]

    def reference(self, leaf: Codes) -> LeafReference | None:
        """The form of the root of a leaf, if one is proven definite."""
        return self._exclusions.reference(self._engine.system, leaf)

    def only_root(self, codes: Codes, reference: LeafReference, proposal: OnlyRoot) -> list[SpaceRoot] | None:
        """The root, as a list, unless it was declared before; None if it is not proven that no other one lies below."""
        exclusions, leaf, found = self._exclusions, reference.selection, list[SpaceRoot]()
        record = OnlyReference(0, proposal.rows, proposal.products, turns=proposal.turns)
        if not record.holds(reference, codes, exclusions.free.reach):
            if not record.holds(reference, codes, exclusions.system.reach):
                return None
            self.bounded = True
        if leaf not in self._declared:
            self.bounded |= not isinstance(settle(exclusions.free, leaf), SpaceRoot)
            found = [self._placed(leaf, reference.root)]
            self._verified[leaf] = found[0]
        declared = DeclaredForm(leaf, *exclusions.numbers[leaf], self._ball(reference.root))
        self._leaf(replace(record, back=self._back(leaf, lambda: declared)))
        return found

    def _ball(self, found: SpaceRoot | LooseSolution, wider: float = WIDEN) -> EnclosureRecord:
        """Ball of a root, in the problem's units."""
        return EnclosureRecord.around(found.y, self.enclosed.unit, found.index, wider)
