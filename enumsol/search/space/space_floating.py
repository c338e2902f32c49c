"""The search for a body in 3D that nothing holds: its solvers, and what its certifier concludes (theory, section 14.6).

The tree, its relaxations and leaves are those of other bodies; what rests on a positive definite A is not used.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from enumsol.condensation.space_condensed import EnclosedSpace, SpaceSystem
from enumsol.model.statuses import CONTACT, UNDECIDED
from enumsol.proof.leaves import Excluded, NoRoot, OnlyReference, Unbalanced
from enumsol.proof.records import DeclaredForm
from enumsol.relaxation.engine import PRUNE_MARGIN
from enumsol.search.certifiers.protocol import Bound, Refine, UndecidedPart
from enumsol.search.space.space_references import reference_numbers
from enumsol.search.space.space_search import SpaceCertifier
from enumsol.trusted.floating_bounds import motion_beside
from enumsol.trusted.space.leaves import Open, SpaceRoot, settle
from enumsol.trusted.space.resultants import resultants, unbounded
from enumsol.trusted.space.space_uniqueness import LeafReference

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.proof.writer import Recorder
    from enumsol.relaxation.space_relaxation import SpaceEngine
    from enumsol.search.reference_closer import OnlyRoot
    from enumsol.support.array_types import Codes, Floats
    from enumsol.trusted.space.boxed_solution import BoxedSolution
    from enumsol.trusted.space.sector_rows import Row


class SpaceExclusions:
    """What excludes assignments of a body that nothing holds, if possible without a bound of the rigid displacement.

    Parameters
    ----------
    enclosed : EnclosedSpace

    Attributes
    ----------
    system, free : EnclosedSpace
        With its bound, and with one beyond which there are no solutions.
    """

    def __init__(self, enclosed: EnclosedSpace) -> None:
        self.system, self.free = enclosed, unbounded(enclosed)
        self._references: dict[Codes, LeafReference | None] = {}
        #: How the forms of roots are declared, but for enclosures, by their leaves.
        self.numbers: dict[Codes, tuple[Floats, Floats]] = {}

    def reference(self, system: SpaceSystem, leaf: Codes) -> LeafReference | None:
        """The form of the root of a leaf, if one is proven definite."""
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
        self, codes: Codes, rows: Sequence[Row], values: Floats, *, within: bool
    ) -> tuple[Excluded | Unbalanced | NoRoot, bool] | None:
        """A record that excludes a partial assignment, and whether it needs the bound; or None.

        ``within``: the bound is known to be needed. Otherwise it is used only where all statuses are determined
        (theory, section 14.4).
        """
        excluded = Excluded(list(rows), values)
        if len(rows) and excluded.holds(self.free, codes, 2.0):
            return excluded, False
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
        record = Unbalanced(motion_beside(self.system, resultants(self.system, codes)))
        return record if record.holds(self.system, codes) else None


class FloatingSpaceCertifier(SpaceCertifier):
    """Proves prunings and leaves of a body that nothing holds.

    Parameters
    ----------
    exclusions : SpaceExclusions or None
        Without balls nothing is proven.
    engine, enclosed, recorder : as of SpaceCertifier
    """

    def __init__(
        self, engine: SpaceEngine, enclosed: EnclosedSpace, exclusions: SpaceExclusions | None, recorder: Recorder
    ) -> None:
        super().__init__(engine, enclosed, recorder)
        self._exclusions = exclusions

    def reference(self, leaf: Codes) -> LeafReference | None:
        """The form of the root of a leaf, if one is proven definite."""
        return None if self._exclusions is None else self._exclusions.reference(self._engine.system, leaf)

    def only_root(self, codes: Codes, reference: LeafReference, proposal: OnlyRoot) -> list[SpaceRoot] | None:
        """The root, as a list, unless it was declared before; None if it is not proven that no other one lies below."""
        exclusions, leaf, found = self._exclusions, reference.selection, list[SpaceRoot]()
        if exclusions is None:
            return None
        record = OnlyReference(0, *proposal)
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

    def excluded(self, codes: Codes, relaxation: Bound) -> bool:
        """True if the relaxation's multipliers, or balance alone, are proven to exclude the partial assignment."""
        if self._exclusions is None or not relaxation.bound > PRUNE_MARGIN:
            return False
        rows, values = self._multipliers(relaxation)
        found = self._exclusions.record(codes, rows, values, within=self.bounded)
        if found is None:
            return False
        self.bounded |= found[1]
        self._leaf(found[0])
        return True

    def selection(self, codes: Codes) -> SpaceRoot | BoxedSolution | UndecidedPart | Refine | None:
        """The root of a leaf, a sector to halve, or why the leaf stays open."""
        if self._exclusions is not None and (unbalanced := self._exclusions.unbalanced(codes)) is not None:
            self._leaf(unbalanced)
            return None
        answer = super().selection(codes)
        if self._exclusions is not None and (answer is None or isinstance(answer, SpaceRoot)):
            self.bounded |= not isinstance(settle(self._exclusions.free, codes), type(answer))
        return answer

    def _boxed(self, leaf: Open, *, halved: bool) -> None:
        """Boxes rest on a stiffness that is positive definite."""
