"""The checker of root sets of a body in 3D that nothing holds (theory, section 14.6), as `enumsol.verify` uses it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from enumsol.checker.floating import WithinReach
from enumsol.checker.space_checker import SpaceChecker
from enumsol.condensation.space_condensed import FloatingSpace
from enumsol.proof import records
from enumsol.proof.reading import RefusedError
from enumsol.proof.space_records import FLOATING_LEAVES, ExcludedInSpace
from enumsol.trusted.space.leaves import SpaceRoot, settle
from enumsol.trusted.space.resultants import floating_margin, is_unbalanced_in_space, unbounded

if TYPE_CHECKING:
    from enumsol.checker.walk import Codes, Test
    from enumsol.proof.records import Record


@dataclass
class FloatingSpaceChecker(WithinReach, SpaceChecker):
    """Checks one proof of a body in 3D that nothing holds."""

    kinds = FLOATING_LEAVES

    @cached_property
    def system(self) -> FloatingSpace:
        """Balls for S, g, F, G and h in the proof's units."""
        enclosed = FloatingSpace.of(self.problem, self.alpha, self.force, self.length)
        if not enclosed.smallest_eigenvalue > 0:
            raise RefusedError("S is not proven positive definite")
        return enclosed

    @cached_property
    def free(self) -> FloatingSpace:
        """The same without bounds of the rigid displacement."""
        return unbounded(self.system)

    def _limits(self, codes: Codes, kind: type[Record]) -> records.Limits:
        del kind
        return records.Limits(codes, modes=self.problem.modes.r)

    def _tests(self) -> dict[type[Record], Test]:
        return super()._tests() | {records.Unbalanced: self._unbalanced}

    def _excluded(self, codes: Codes, said: ExcludedInSpace) -> str | None:
        if floating_margin(self.free, codes, said.rows, said.values) > 0:
            return None
        self.bounded = True
        positive = floating_margin(self.system, codes, said.rows, said.values) > 0
        return None if positive else "its multipliers do not exclude it"

    def _unbalanced(self, codes: Codes, said: records.Unbalanced) -> str | None:
        if is_unbalanced_in_space(self.system, codes, said.direction):
            return None
        return "forces below it may be in balance with the load"

    def _no_root(self, codes: Codes, said: records.NoRoot) -> str | None:
        if settle(self.free, codes) is None:
            return None
        self.bounded = True
        return super()._no_root(codes, said)

    def _regular_root(self, codes: Codes, said: records.RegularRoot) -> str | None:
        self.bounded |= not isinstance(settle(self.free, codes), SpaceRoot)
        return super()._regular_root(codes, said)
