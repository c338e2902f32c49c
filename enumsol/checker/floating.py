"""The checker of root sets of a body that nothing holds (theory, section 14), as `enumsol.verify` uses it."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

from enumsol.checker.plane_checker import Checker
from enumsol.checker.walk import TreeChecker
from enumsol.condensation.enclosure import EnclosedSystem
from enumsol.proof import records
from enumsol.proof.reading import RefusedError, quoted, same
from enumsol.trusted.at_alpha import holds_no_root, solve_selection
from enumsol.trusted.confinement import without_bound
from enumsol.trusted.exclusion import Leaves, exclusion_margins
from enumsol.trusted.floating_bounds import is_unbalanced
from enumsol.trusted.joint_roots import JointRoot, joint_root
from enumsol.trusted.reference import Reference
from enumsol.trusted.status_rows import UNDECIDED

if TYPE_CHECKING:
    from collections.abc import Sequence
    from fractions import Fraction

    from enumsol.checker.rational import RationalSystem
    from enumsol.checker.walk import Test
    from enumsol.proof.records import Record
    from enumsol.support.array_types import Codes, Indices


@dataclass
class WithinReach(TreeChecker):
    """What checkers of bodies that nothing holds in 2D and 3D share: the bound of the rigid displacement."""

    #: Some leaf rests on it.
    bounded: bool = False

    def _read_header(self, header: Any) -> None:
        super()._read_header(header)
        if self.data != "problem":
            raise RefusedError("a proof about S and g as computed, of a body that nothing holds")
        check_bound(header, self.problem)

    @property
    def _within(self) -> float | None:
        return self.problem.rigid_reach if self.bounded else None

    def _declare(self, record: list[Any]) -> None:
        raise RefusedError(f"a record {quoted(record)} that no leaf of this proof can refer to")


def check_bound(header: dict[str, Any], problem: Any) -> None:
    """Refuse a proof about another bound of the rigid displacement."""
    found, reach = header.get("max_rigid_displacement"), problem.rigid_reach
    if not same(found, reach):
        raise RefusedError(f"its bound of the rigid displacement is {quoted(found)}; the problem's is {reach:g}")


@dataclass
class FloatingChecker(WithinReach, Checker):
    """Checks one proof of a body that nothing holds."""

    kinds = records.FLOATING_LEAVES

    #: What was declared of roots, and their forms; None where these are not proven definite.
    _declared: list[records.DeclaredReference] = field(default_factory=list)
    _references: dict[int, Reference | None] = field(default_factory=dict)
    #: Roots that selections share, by the one in which all their nodes stick, and by how these slip.
    shared: dict[tuple[Codes, tuple[tuple[int, int], ...]], JointRoot | None] = field(default_factory=dict)

    @cached_property
    def system(self) -> EnclosedSystem:
        """Balls for S, g, F, G and h in the proof's units."""
        system = self.enclosed().at(self.alpha, self.force, self.length)
        if not system.smallest_eigenvalue > 0:
            raise RefusedError("S is not proven positive definite")
        return system

    @cached_property
    def free(self) -> EnclosedSystem:
        """The same with bounds beyond which there are no solutions."""
        return without_bound(self.system)

    @cached_property
    def rational(self) -> RationalSystem:
        """The condensed problem in rationals; computed only if a leaf needs it."""
        from enumsol.checker.rational import FloatingRationalSystem  # python-flint, not always needed

        return FloatingRationalSystem(self.problem, self.alpha)

    def _limits(self, codes: Codes, kind: type[Record]) -> records.Limits:
        return records.Limits(codes, self.friction, self._declared, modes=self.problem.modes.r)

    def _declare(self, record: list[Any]) -> None:
        limits = records.Limits((UNDECIDED,) * self.problem.p, (self.system.F > 0).tolist())
        try:
            self._declared.append(records.DeclaredReference.read(record, limits))
        except ValueError as error:
            raise RefusedError(str(error)) from None

    def _tests(self) -> dict[type[Record], Test]:
        return super()._tests() | {
            records.Unbalanced: self._unbalanced,
            records.OnlyReference: self._only_reference,
            records.SharedRoot: self._shared,
        }

    def _reference(self, place: int) -> Reference | None:
        if place not in self._references:
            said = self._declared[place]
            numbers = said.weights, said.balance, said.share
            self._references[place] = Reference.of(self.system, said.selection, *numbers)
        return self._references[place]

    def _only_reference(self, codes: Codes, said: records.OnlyReference) -> str | None:
        reference = self._reference(len(self._declared) - said.back)
        if reference is None:
            return "the form of its root is not proven definite"
        if not reference.is_only_root(codes, said.rows, said.products, self.free.reach):
            self.bounded = True
            if not reference.is_only_root(codes, said.rows, said.products, self.system.reach):
                return "its root is not proven to be the only one"
        if not reference.lies_below(codes):
            return None if said.enclosure is None else "its root does not lie below its assignment"
        if said.enclosure is None:
            return "it has no enclosure of the root that lies below its assignment"
        return self._regular(reference.selection, reference.root, said.enclosure)

    def _check_exclusions(self, numbers: Indices, leaves: Leaves) -> None:
        free = exclusion_margins(self.free, leaves) > 0
        margins = exclusion_margins(self.system, leaves)
        self.bounded |= bool((~free).any())
        for number in numbers[~(free | (margins > 0))]:
            self.fail(f"leaf {number}: its multipliers do not exclude it")

    def _unbalanced(self, codes: Codes, said: records.Unbalanced) -> str | None:
        if is_unbalanced(self.system, codes, said.direction):
            return None
        return "forces below it may be in balance with the load"

    def _no_root(self, codes: Codes, said: records.NoRoot) -> str | None:
        if holds_no_root(self.free, codes, solve_selection(self.free, codes)):
            return None
        self.bounded = True
        return super()._no_root(codes, said)

    def _shared(self, codes: Codes, said: records.SharedRoot) -> str | None:
        core = said.core(codes)
        if (core, said.slips) not in self.shared:
            self.shared[core, said.slips] = joint_root(self.system, core, dict(said.slips))
        found = self.shared[core, said.slips]
        if found is None:
            return "its selections are not proven to share one root"
        if self.closed.setdefault(core, found) is not found:
            return "its selections overlap with others that share a root"
        self._locate(core, found)
        return self._placed(found, said.enclosure)

    def _no_rational_root(self, codes: Codes, said: records.NoRootInRationals) -> str | None:
        self.bounded |= self._rests_on_reach(codes, [])
        return super()._no_rational_root(codes, said)

    def _root_set(self, codes: Codes, said: records.RootSetRecord) -> str | None:
        reason, found = super()._root_set(codes, said), self.polytopes
        if reason is None:
            self.bounded |= self._rests_on_reach(codes, found[-1][1])
        return reason

    def _slips(self, point: list[Fraction]) -> list[Any]:
        from enumsol.arithmetic.rationals import rational  # python-flint, as above

        numbers = [rational(x) for x in point]
        rows = (self.rational.row(5, node) for node in range(self.problem.p))
        return [sum((a * x for a, x in zip(form, numbers, strict=True)), constant) for form, constant in rows]

    def _rests_on_reach(self, codes: Codes, points: Sequence[Sequence[Fraction]]) -> bool:
        """Whether what a selection holds may be other without the bounds of the rigid displacement."""
        return self.rational.rests_on_reach(codes, points)  # type: ignore[attr-defined, no-any-return]
