"""The checker of proofs about problems in 3D: leaves are statuses and sectors of slip directions."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.arithmetic.balls import Ball
from enumsol.checker.walk import NO_FORM, Located, TreeChecker
from enumsol.condensation.data import exactly_at
from enumsol.condensation.space_condensed import EnclosedSpace
from enumsol.proof.leaves import Alone, BoxedRoot, Excluded, OnlyReference
from enumsol.proof.reading import RefusedError, data_of, rational_from, shown_alpha, units_from
from enumsol.proof.records import DeclaredForm, Limits, Tree
from enumsol.trusted.space.boxed_solution import Box, BoxedSolution, apart_in_boxes, is_inside, solution_in_box
from enumsol.trusted.space.force_bound import unbounded
from enumsol.trusted.space.leaves import Open, SpaceRoot, distinct_roots, settle
from enumsol.trusted.space.sector_rows import OPEN, STICK, is_sector_covering
from enumsol.trusted.space.space_uniqueness import LooseSolution

if TYPE_CHECKING:
    from enumsol.checker.walk import Test
    from enumsol.proof.records import EnclosureRecord, Record
    from enumsol.support.array_types import Codes


@dataclass
class SpaceChecker(TreeChecker[EnclosedSpace, "SpaceRoot | LooseSolution"]):
    """Checks one proof of a problem in 3D."""

    trees = Tree.SPACE, Tree.FLOATING_SPACE

    boxed: list[tuple[tuple[int, ...], BoxedSolution]] = field(default_factory=list)
    #: What boxes hold that were tested.
    known: dict[bytes, BoxedSolution | None] = field(default_factory=dict)

    # -- header and tree -------------------------------------------------------------------------------------------

    def _read_header(self, header: Any) -> None:
        self.data = data_of(header, self.problem, "space")
        if self.data != "problem":
            raise RefusedError("a proof about a problem in 3D certifies the problem's own data only")
        try:
            self.force, self.length = units_from(header, self.problem.p, by_node=True)
            self.alpha = rational_from(header.get("alpha"))
            pairs = zip(self.problem.friction, self.problem.friction_slope, strict=True)
            exact = [exactly_at(self.alpha, *pair) for pair in pairs]
        except ValueError as error:
            raise RefusedError(f"the header cannot be read: {error}") from None
        if min(min(column) for column in exact) < 0:
            raise RefusedError(f"friction is negative at alpha = {shown_alpha(self.alpha)}")
        self.tangents = [sum(F > 0 for F in node) for node in zip(*exact, strict=True)]

    @cached_property
    def system(self) -> EnclosedSpace:
        """Balls for S, g and F in the proof's units."""
        enclosed = EnclosedSpace.of_problem(self.enclosed(), self.alpha, self.force, self.length)
        if not enclosed.smallest_eigenvalue > 0:
            raise RefusedError("S is not proven positive definite")
        return enclosed

    def _covers(self, node: int, code: int, children: list[int]) -> bool:
        return is_sector_covering(code, children, self.tangents[node])

    # -- leaves ----------------------------------------------------------------------------------------------------

    def _limits(self, codes: Codes, kind: type[Record]) -> Limits:
        components = len(self.system.g) if kind in (DeclaredForm, Alone, OnlyReference) else 0
        return Limits(codes, self.tree, (), self.declared, components, self.problem.modes.r)

    def _without_bound(self) -> EnclosedSpace:
        return unbounded(self.system)

    @cached_property
    def tests(self) -> dict[type[Record], Test]:
        """Tests of leaves, by their kinds."""
        return super().tests | {BoxedRoot: self._in_box}

    def _settled(self, system: EnclosedSpace, codes: Codes) -> SpaceRoot | Open | None:
        return settle(system, codes)

    def _is_root(self, found: object) -> bool:
        return isinstance(found, SpaceRoot)

    def _wrongly_said(self, found: SpaceRoot | LooseSolution, said: EnclosureRecord) -> str | None:
        return said.refusal(found.y, self.system.unit, found.index)

    def _at_rest(self) -> None:
        self.regular += 1
        still = np.ones(2 * self.problem.p, dtype=bool)
        self.locate(None, Located(Ball.exact(np.zeros(3 * self.problem.p)), still))

    def _excluded(self, codes: Codes, said: Excluded) -> str | None:
        if not isinstance(said.by, int):
            excluded = self._either(lambda system: said.holds(system, codes))
            return None if excluded else "its multipliers do not exclude it"
        form = self._form(said.by)
        if form is None:
            return NO_FORM
        return None if said.holds(form, codes) else "its multipliers and its form do not exclude it"

    def _declare(self, record: list[Any]) -> None:
        super()._declare(record)
        if not self.problem.held:
            try:
                self._declare_root(self.declared[-1])
            except ValueError as error:
                raise RefusedError(str(error)) from None

    def _declare_root(self, said: DeclaredForm) -> None:
        """Take note of a root, which is one whatever leaves refer to it."""
        known = self._form(1)
        if known is None or said.enclosure is None:
            self.fail("the root that is declared is not proven to be one whose form is definite")
            return
        if (reason := self._regular(said.codes, known.root, said.enclosure)) is not None:
            self.fail(f"the root that is declared: {reason}")

    def _regular(self, codes: Codes, found: SpaceRoot | LooseSolution, said: EnclosureRecord) -> str | None:
        if isinstance(found, SpaceRoot):
            return super()._regular(codes, found, said)
        self.regular += 1
        self._locate(codes, found, codes)
        return self._wrongly_said(found, said)

    def _in_box(self, codes: Codes, said: BoxedRoot) -> str | None:
        """The only solution of a box, in which all roots of a leaf lie."""
        leaf = settle(self.system, codes)
        (mid, rad, rho), unit = said.box(len(self.system.g)), self.system.unit
        with np.errstate(over="ignore", invalid="ignore"):
            box = Box.of(self.system, mid / unit, rad / unit, rho / unit**2)
        key = b"".join(numbers.tobytes() for numbers in box.numbers)
        if key not in self.known:
            self.known[key] = solution_in_box(self.system, box)
        found = self.known[key]
        if found is None:
            return "its box is not proven to hold one solution"
        if leaf is not None and (leaf.y is None or leaf.w is None or not is_inside(leaf.y, leaf.w, box)):
            return "its roots are not proven to lie in its box"
        self.boxed.append((codes, found))
        self._locate(codes, found)
        return self._wrongly_said(found, said.enclosure)

    # -- counting --------------------------------------------------------------------------------------------------

    def _count(self) -> tuple[int, int]:
        """Roots that two leaves share count once; what cannot be told apart leaves the count open."""
        regular = distinct_roots(self.roots)
        boxed = apart_in_boxes(regular.kept, self.boxed)
        self.doubtful = len(regular.doubtful) + len(boxed.doubtful)
        self.same = {_name(*one): _name(*other) for one, other in (*regular.same, *boxed.same)}
        return len(regular.kept) + len(boxed.kept), 0

    def locate_rational_roots(self) -> None:
        """Nothing: in 3D there are none."""

    def _locate(self, name: Codes, found: SpaceRoot | LooseSolution, codes: Codes = ()) -> None:
        """Take note of a root: forces in the problem's units, and statuses, by its leaf's ``codes`` if there is one.

        ``name`` are the codes by which it is counted.
        """
        if self.located is None:
            return
        p, system = self.problem.p, self.system
        forces = system.forces_of(found.y, self.force)
        idle = np.tile([code == OPEN for code in codes or (STICK,) * p], 3)
        forces.mid[idle] = forces.rad[idle] = 0.0
        certain: Codes | None = tuple(codes)
        if isinstance(found, LooseSolution):
            certain, still = found.certain(np.any(system.tau >= 0, axis=1)), ~(found.slip | found.open)
        else:
            still = np.array(codes) == STICK
        # where a coefficient is 0 a sticking node may move all the same
        still = np.concatenate([still & (system.tau[:, k] >= 0) for k in (0, 1)])
        rigid = found.rigid if isinstance(found, SpaceRoot) else None
        rigid = None if rigid is None else rigid * Ball.exact(system.rigid_unit)
        gaps = found.w[:p]
        self.locate(_name(name, found), Located(forces, still, certain, rigid, open=-gaps.mid > gaps.rad))

    def _claim(self, isolated: int, families: int) -> dict[str, int]:
        return {"roots": self.regular + isolated, "undecided": self.undecided, "leaves": self.leaves}


def _name(codes: Codes, found: SpaceRoot | LooseSolution) -> tuple[int, ...]:
    """Name of a root; roots not proven to be one differ in it, for a solution may lie beyond its leaf."""
    return (*codes, int(isinstance(found, LooseSolution)))
