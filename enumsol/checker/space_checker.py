"""The checker of proofs about problems in 3D: leaves are statuses and sectors of slip directions."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, Ball
from enumsol.checker.walk import Located, TreeChecker
from enumsol.condensation.data import exactly_at
from enumsol.condensation.space_condensed import EnclosedSpace
from enumsol.proof.declared_forms import space_form
from enumsol.proof.reading import RefusedError, data_of, exponents_from, rational_from, shown_alpha
from enumsol.proof.records import (
    Alone,
    BoxedRoot,
    DeclaredForm,
    EnclosureRecord,
    Excluded,
    Limits,
    NoRoot,
    OnlyReference,
    RegularRoot,
    Tree,
    Unbalanced,
)
from enumsol.trusted.quadratic_forms import SlipForm
from enumsol.trusted.space.boxed_solution import Box, BoxedSolution, apart_in_boxes, is_inside, solution_in_box
from enumsol.trusted.space.leaves import Open, SpaceRoot, distinct_roots, settle
from enumsol.trusted.space.product_forms import Ellipsoid
from enumsol.trusted.space.resultants import floating_margin, is_unbalanced_in_space, unbounded
from enumsol.trusted.space.sector_rows import OPEN, STICK, UNDECIDED, is_sector_covering, sector_margin
from enumsol.trusted.space.space_uniqueness import LooseSolution, lone_root, only_root, only_solution_in_space

if TYPE_CHECKING:
    from collections.abc import Callable

    from enumsol.checker.walk import Test
    from enumsol.proof.records import Record
    from enumsol.support.array_types import Codes, Floats
    from enumsol.trusted.space.space_uniqueness import LeafReference

_OPEN = "what it holds is not proven"
_NO_FORM = "no form that is convex was declared over it"


@dataclass
class SpaceChecker(TreeChecker):
    """Checks one proof of a problem in 3D."""

    trees = Tree.SPACE, Tree.FLOATING_SPACE

    roots: list[tuple[tuple[int, ...], SpaceRoot]] = field(default_factory=list)
    boxed: list[tuple[tuple[int, ...], BoxedSolution]] = field(default_factory=list)
    #: What boxes hold that were tested.
    known: dict[bytes, BoxedSolution | None] = field(default_factory=dict)

    # -- header and tree -------------------------------------------------------------------------------------------

    def _read_header(self, header: Any) -> None:
        self.data = data_of(header, self.problem, "space")
        if self.data != "problem":
            raise RefusedError("a proof about a problem in 3D certifies the problem's own data only")
        try:
            self.force, self.length = _units(header, self.problem.p)
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
        components = len(self.system.g) if kind in (DeclaredForm, Alone) else 0
        return Limits(codes, self.tree, (), self.declared, components, self.problem.modes.r)

    def _without_bound(self) -> EnclosedSpace:
        return unbounded(self.system)

    def _made(self, said: DeclaredForm) -> SlipForm | Ellipsoid | LeafReference | None:
        return space_form(self.system, said)

    def _tests(self) -> dict[type[Record], Test]:
        return {
            Excluded: self._excluded,
            NoRoot: self._no_root,
            RegularRoot: self._regular_root,
            BoxedRoot: self._in_box,
            Alone: self._only,
            Unbalanced: self._unbalanced,
            OnlyReference: self._only_reference,
        }

    def _at_rest(self) -> None:
        self.regular += 1
        still = np.ones(2 * self.problem.p, dtype=bool)
        self.locate(None, Located(Ball.exact(np.zeros(3 * self.problem.p)), still))

    def _excluded(self, codes: Codes, said: Excluded) -> str | None:
        rows, values = said.lines, said.values
        if isinstance(said.by, int):
            form = self._form(said.by)
            if isinstance(form, SlipForm):
                positive = sector_margin(self.system, codes, rows, values, form=form) > 0
                return None if positive else "its multipliers and its form do not exclude it"
            if form is None or len(rows):
                return _NO_FORM if form is None else "it has multipliers beside those of a form of products"
            return None if form.misses(codes) else "its ellipsoid does not exclude it"
        margin = sector_margin if self.problem.held else floating_margin
        positive = self._either(lambda system: margin(system, codes, rows, values) > 0)
        return None if positive else "its multipliers do not exclude it"

    def _unbalanced(self, codes: Codes, said: Unbalanced) -> str | None:
        if is_unbalanced_in_space(self.system, codes, said.direction):
            return None
        return "forces below it may be in balance with the load"

    def _only_reference(self, codes: Codes, said: OnlyReference) -> str | None:
        known = self._form(said.back)
        if known is None:
            return "the root that was declared is not proven"
        proven = self._either(lambda system: known.is_only_root(codes, said.rows, said.products, system.reach))
        return None if proven else "the root that was declared is not proven to be the only one in it"

    def _flush(self, *, last: bool) -> None:
        """Nothing waits: every leaf is checked as it is read."""

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
        root = known.root
        if (reason := self._placed(root, said.enclosure)) is not None:
            self.fail(f"the root that is declared: {reason}")
        self._ask_without_bound(said.codes)
        self.roots.append((said.codes, root))
        self._locate(said.codes, root, said.codes)

    def _no_root(self, codes: Codes, said: NoRoot) -> str | None:
        del said
        if self._either(lambda system: settle(system, codes) is None):
            return None
        return _OPEN if isinstance(settle(self.system, codes), Open) else "it holds a root"

    def _ask_without_bound(self, leaf: Codes) -> None:
        """Take note of a root that is not proven without the bound of the rigid displacement."""
        if not self.problem.held:
            self.bounded |= not isinstance(settle(self.free, leaf), SpaceRoot)

    def _regular_root(self, codes: Codes, said: RegularRoot) -> str | None:
        self._ask_without_bound(codes)
        found = settle(self.system, codes)
        if isinstance(found, Open):
            return _OPEN
        if found is None:
            return "it holds no root"
        self.roots.append((codes, found))
        self._locate(codes, found, codes)
        return self._placed(found, said.enclosure)

    def _in_box(self, codes: Codes, said: BoxedRoot) -> str | None:
        """The only solution of a box, in which all roots of a leaf lie, or the ellipsoid of an assignment."""
        if said.by is not None:
            form = self._form(said.by)
            return self._of_box(codes, said, form.is_in) if isinstance(form, Ellipsoid) else _NO_FORM
        leaf = settle(self.system, codes)
        bounds = None if leaf is None else (leaf.y, leaf.w)

        def within(box: Box) -> bool:
            if bounds is None:
                return True
            y, w = bounds
            return y is not None and w is not None and is_inside(y, w, box)

        return self._of_box(codes, said, within)

    def _of_box(self, codes: Codes, said: BoxedRoot, within: Callable[[Box], bool]) -> str | None:
        """The only solution of a box, of which ``within`` tells whether all roots of the leaf lie in it."""
        (mid, rad, rho), unit = said.box(len(self.system.g)), self.system.unit
        with np.errstate(over="ignore", invalid="ignore"):
            box = Box.of(self.system, mid / unit, rad / unit, rho / unit**2)
        key = b"".join(numbers.tobytes() for numbers in box.numbers)
        if key not in self.known:
            self.known[key] = solution_in_box(self.system, box)
        found = self.known[key]
        if found is None:
            return "its box is not proven to hold one solution"
        if not within(box):
            return "its roots are not proven to lie in its box"
        self.boxed.append((codes, found))
        self._locate(codes, found)
        return self._placed(found, said.enclosure)

    def _only(self, codes: Codes, said: Alone) -> str | None:
        """The only solution of all, or of an assignment."""
        found: LooseSolution | SpaceRoot | None
        if any(code != UNDECIDED for code in codes):
            found = lone_root(self.system, codes, said.numbers, said.selection)
            if found is None:
                return "its root is not proven to be the only one in it"
            self.roots.append((said.selection, found))
            self._locate(said.selection, found, said.selection)
            return self._placed(found, said.enclosure)
        if said.selection:
            found = only_root(self.system, said.numbers, said.selection)
        else:
            force, _ = said.enclosure.numbers(len(self.system.g))
            found = only_solution_in_space(self.system, said.numbers, force[: self.problem.p])
        if found is None:
            return "its solution is not proven to be the only one"
        self.regular += 1
        self._locate(said.selection, found, said.selection)
        return self._placed(found, said.enclosure)

    def _placed(self, found: SpaceRoot | LooseSolution, said: EnclosureRecord) -> str | None:
        """Why the ball and the index that are said to be those of a root are not, or None."""
        centre, radius = said.numbers(len(found.y.mid))
        with np.errstate(over="ignore", invalid="ignore"):
            unit = self.system.unit
            inside = (np.abs(centre - found.y.mid * unit) + found.y.rad * unit) * SAFE <= radius
        return said.refusal(found.index, inside=bool(np.all(inside)))

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
        p, system, y = self.problem.p, self.system, found.y
        forces, unit = Ball(np.zeros(3 * p), np.zeros(3 * p)), np.tile(self.force, 3)
        pressed = np.array([code != OPEN for code in codes or (STICK,) * p])
        forces[:p] = Ball(np.where(pressed, y.mid[:p], 0.0), np.where(pressed, y.rad[:p], 0.0))
        for k in (0, 1):
            nodes = np.flatnonzero((system.tau[:, k] >= 0) & pressed)
            forces[(1 + k) * p + nodes] = y[system.tau[nodes, k]] * Ball(system.F[nodes, k], system.F_rad[nodes, k])
        zero = (forces.mid == 0) & (forces.rad == 0)
        forces = Ball(forces.mid * unit, np.where(zero, 0.0, forces.rad * unit + TINY))
        certain: Codes | None = tuple(codes)
        if isinstance(found, LooseSolution):
            certain, still = found.certain(np.any(system.tau >= 0, axis=1)), ~(found.slip | found.open)
        else:
            still = np.array(codes) == STICK
        # where a coefficient is 0 a sticking node may move all the same
        still = np.concatenate([still & (system.tau[:, k] >= 0) for k in (0, 1)])
        rigid = found.rigid if isinstance(found, SpaceRoot) else None
        rigid = None if rigid is None else rigid * Ball.exact(system.rigid_unit)
        self.locate(_name(name, found), Located(forces, still, certain, rigid))

    def _claim(self, isolated: int, families: int) -> dict[str, int]:
        return {"roots": self.regular + isolated, "undecided": self.undecided, "leaves": self.leaves}


def _name(codes: Codes, found: SpaceRoot | LooseSolution) -> tuple[int, ...]:
    """Name of a root; roots not proven to be one differ in it, for a solution may lie beyond its leaf."""
    return (*codes, int(isinstance(found, LooseSolution)))


def _units(header: dict[str, Any], p: int) -> tuple[Floats, Floats]:
    """Units of forces and displacements of the nodes, powers of two with one product."""
    force, length = (exponents_from(header.get(key), p) for key in ("force", "length"))
    if len({a + b for a, b in zip(force, length, strict=True)}) != 1:
        raise ValueError("the units are not a common scaling of energy")
    return np.ldexp(1.0, np.array(force)), np.ldexp(1.0, np.array(length))
