"""The tree in three dimensions: slip directions in sectors of the circle (theory, section 12)."""

from __future__ import annotations

import copy
from dataclasses import replace
from fractions import Fraction
from functools import cached_property, partial
from typing import TYPE_CHECKING, cast

import numpy as np

from enumsol.condensation.enclosure import NotEnclosedError, enclosure_of
from enumsol.condensation.space_condensed import EnclosedSpace, SpaceSystem
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
from enumsol.proof.records import NOWHERE, DeclaredForm, EnclosureRecord, Limits, Tree
from enumsol.proof.writer import Recorder
from enumsol.relaxation.convex_forms import SlipFormAscent
from enumsol.relaxation.engine import PRUNE_MARGIN, Relaxation
from enumsol.relaxation.space_relaxation import SpaceEngine, SpaceRelaxation
from enumsol.search.certifiers.protocol import ERRORS, WIDEN, Bound, Certifier, Refine, UndecidedPart, Unrecorded
from enumsol.search.nodes import Forms, TreeCloser
from enumsol.search.outcome import HOLD
from enumsol.search.setup import WEAK, SearchSetup, weakly_held
from enumsol.search.space.open_leaves import Cause, KnownBoxes, obstacle, sector_to_halve
from enumsol.search.space.space_fathoming import SpaceCloser, SpaceClosing, solved
from enumsol.trusted.floating_bounds import motion_beside
from enumsol.trusted.space.force_bound import unbounded
from enumsol.trusted.space.leaves import Open, SpaceRoot, settle
from enumsol.trusted.space.sector_rows import FRICTIONLESS, OPEN, is_sector_covering, is_within
from enumsol.trusted.space.space_uniqueness import LeafReference
from enumsol.trusted.space.turning import turned_by

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from enumsol.model.problem3d import ContactProblem3D
    from enumsol.support.array_types import Alpha, Codes, Floats
    from enumsol.trusted.space.boxed_solution import BoxedSolution
    from enumsol.trusted.space.pieces import AlphaPiece
    from enumsol.trusted.space.sector_margins import SlipForm
    from enumsol.trusted.space.sector_rows import Row
    from enumsol.trusted.space.space_uniqueness import LooseSolution


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
        system = self._system
        tau = system.tangential(relaxation.forces)[node] * system.tau_scale[node]
        v = system.slips(relaxation.displacements)[node]
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
        if len(rows) and excluded.holds(self.free, codes, ERRORS):
            return excluded, False
        if self.system.held:
            return None
        if (without := self.unbalanced(codes)) is not None:
            return without, False
        told = not any(code in (UNDECIDED, CONTACT) for code in codes)
        if (within or told) and len(rows) and excluded.holds(self.system, codes, ERRORS):
            if told and settle(self.free, codes) is None:
                return NoRoot(), False
            return excluded, True
        return None

    def unbalanced(self, codes: Codes) -> Unbalanced | None:
        """A record that no forces below a partial assignment are in balance with the load; or None."""
        return unbalanced(self.system, [self.system], codes)


#: A disc of forces lies in a polygon of so many corners.
_CORNERS = 16


def unbalanced(within: EnclosedSpace | AlphaPiece, ends: Sequence[EnclosedSpace], codes: Codes) -> Unbalanced | None:
    """A record that no forces below an assignment are in balance with the load, by the data at some alphas; or None."""
    records = (Unbalanced(motion_beside(end, resultants(end, codes))) for end in ends if not end.held)
    return next((record for record in records if record.holds(within, codes)), None)


def resultants(system: EnclosedSpace, codes: Sequence[int]) -> list[Floats]:
    """Resultants G y, (r,) each, whose cone holds all that the forces of an assignment can have, but for rounding."""
    G, discs = system.rows.G.mid / system.unit, system.discs.mid.tolist()
    found = []
    for i, code in enumerate(codes):
        if code == OPEN:
            continue
        places = [int(t) for t in system.tau[i] if t >= 0]
        found += [
            G[:, i] + discs[i] * sum((x * G[:, t] for x, t in zip(tau, places, strict=True)), 0.0 * G[:, i])
            for tau in _corners(code, len(places))
        ]
    return found


def _corners(code: int, tangents: int) -> list[tuple[float, ...]]:
    """Corners of a polygon around the tau of a node, |tau| <= 1."""
    if code == FRICTIONLESS or not tangents:
        return [(0.0,) * tangents]
    if tangents == 1:
        return [(sign,) for sign in (1.0, -1.0) if code != (SLIP_MINUS if sign > 0 else SLIP_PLUS)]
    if code > SECTORS:
        a, b = (np.array(direction(n)) for n in (code - SECTORS, end_number(code - SECTORS)))
        return [tuple(corner) for corner in (a, b, (a + b) / (1.0 + a @ b))]
    angles = 2.0 * np.pi * np.arange(_CORNERS) / _CORNERS
    return list(zip(*(np.array([np.cos(angles), np.sin(angles)]) / np.cos(np.pi / _CORNERS)).tolist(), strict=True))


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
        if not leaf.holds(form, codes, ERRORS):
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
        if (without := self._exclusions.unbalanced(codes)) is not None:
            self._leaf(without)
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
            hints = {Cause.ROUNDING: "hold the body by stiffer springs", Cause.RIGID: HOLD}
            hint = hints.get(cause, "perturb the load, by 1e-4 of its largest entry, say")
            return UndecidedPart(codes, reason, hint, examined=True)
        else:
            self._leaf(RegularRoot(self._ball(answer)))
            answer = self._verified[codes] = self._placed(codes, answer)
        return answer

    def _in_box(self, codes: Codes, found: BoxedSolution) -> BoxedSolution:
        """The solution of a box, and its leaf written."""
        self._verified[codes], unit = found, self.enclosed.unit
        centre, radius, rho = found.box.numbers
        # enclosures of solutions in boxes are made in steps of four
        self._leaf(BoxedRoot(centre * unit, radius * unit, rho * unit**2, self._ball(found, wider=4.0 * WIDEN)))
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

    def close(self, numbers: Floats, codes: Codes | None, normal: Floats) -> list[SpaceRoot | LooseSolution] | None:
        """The only solution of the whole problem, as a list, and its leaf written; None if that is not proven.

        Parameters
        ----------
        numbers : of the form, as ``trusted.space.space_uniqueness.Numbers.of`` takes them
        codes : of a leaf that holds the solution; None: its statuses need not hold strictly
        normal : (p,) array, lambda_n near the solution
        """
        found: SpaceRoot | LooseSolution | None
        record = Alone(codes or (), numbers, NOWHERE)
        try:
            found = record.holds(self.enclosed, self._whole, errors=ERRORS, near=normal)
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
        found = record.holds(self.enclosed, codes, errors=ERRORS)
        if found is None:
            return None
        self._leaf(replace(record, enclosure=self._ball(found)))
        found = self._verified[leaf] = self._placed(leaf, found)
        return [found]

    def reference(self, leaf: Codes) -> LeafReference | None:
        """The form of the root of a leaf, if one is proven definite."""
        return self._exclusions.reference(self._engine.system, leaf)

    def only_root(self, codes: Codes, reference: LeafReference, proposal: OnlyReference) -> list[SpaceRoot] | None:
        """The root, as a list, unless it was declared before; None if it is not proven that no other one lies below."""
        exclusions, leaf, found = self._exclusions, reference.selection, list[SpaceRoot]()
        if not proposal.holds(reference, codes, exclusions.free.reach):
            if not proposal.holds(reference, codes, exclusions.system.reach):
                return None
            self.bounded = True
        if leaf not in self._declared:
            self.bounded |= not isinstance(settle(exclusions.free, leaf), SpaceRoot)
            found = [self._placed(leaf, reference.root)]
            self._verified[leaf] = found[0]
        declared = DeclaredForm(leaf, *exclusions.numbers[leaf], self._ball(reference.root))
        self._leaf(replace(proposal, back=self._back(leaf, lambda: declared)))
        return found

    def _ball(self, found: SpaceRoot | LooseSolution, wider: float = WIDEN) -> EnclosureRecord:
        """Ball of a root, in the problem's units."""
        return EnclosureRecord.around(found.y, self.enclosed.unit, found.index, wider)


# -- one problem at one alpha in one arithmetic: what a search needs ---------------------------------------------------

#: A form is used where it leaves no more than this share of the gap to the pruning bound at the root of the tree.
_SHARE = 0.25
#: Nodes examined with the energy before a form that knows where the body slides is tried (theory, section 12.2).
NODES = 256


class SpaceSolvers(SearchSetup):
    """System, balls, engine and certifier for one problem in 3D at one alpha.

    Parameters
    ----------
    problem : ContactProblem3D
    alpha : float or Fraction
    arithmetic : {"fast", "verified"}

    Raises
    ------
    InvalidArgumentError, InvalidProblemError
        Of ``problem.friction_at`` and of the condensation.
    """

    _offered, _kind = '"verified"', {"kind": "space"}

    def __init__(self, problem: ContactProblem3D, alpha: Alpha, arithmetic: str) -> None:
        super().__init__(problem, alpha, arithmetic)
        friction = problem.friction_at(alpha)  # refuses what cannot be enumerated before anything is computed
        condensed = problem.on_springs.condensed
        self.system = self.scaled = SpaceSystem.scaled(condensed.S, condensed.free_displacements(alpha), friction)

    @cached_property
    def _engine(self) -> SpaceEngine:
        """Its rows are numbered in the order in which certifier, splitting and relaxations ask for them."""
        return SpaceEngine(self.relaxed)

    @cached_property
    def _enclosed(self) -> tuple[EnclosedSpace, str | None]:
        floats = EnclosedSpace.of_floats(self.system)
        if self.arithmetic == "fast":
            return floats, None
        try:
            enclosed = self._in_balls(Fraction(self.alpha), self.system.force, self.system.length)
            _ = enclosed.smallest_eigenvalue  # proven positive, or refused
        except NotEnclosedError as error:
            return floats, str(error)
        return enclosed, None

    def _in_balls(self, alpha: Fraction, force: Floats, length: Floats) -> EnclosedSpace:
        """The problem in balls; NotEnclosedError where that cannot be."""
        return EnclosedSpace.of_problem(enclosure_of(self.problem), alpha, force, length)

    @property
    def enclosed(self) -> EnclosedSpace:
        """Balls for the scaled system; in fast arithmetic, or where nothing can be proven, without radii."""
        return self._enclosed[0]

    @property
    def undecidable(self) -> str | None:
        """Why verified arithmetic cannot prove anything about this problem, or None."""
        return self._enclosed[1]

    @cached_property
    def relaxed(self) -> SpaceSystem:
        """System of the relaxations; a body that nothing holds is on weak springs (theory, section 14.5)."""
        return self._on_springs(WEAK)

    def _on_springs(self, stiffness: float) -> SpaceSystem:
        if self.problem.held or self.enclosed.held:
            return self.system
        S, g = weakly_held(self.system.S, self.system.g, self.enclosed.rows, stiffness)
        return replace(self.system, S=S, g=g)

    @cached_property
    def _exclusions(self) -> SpaceExclusions:
        """Proofs that assignments have no solution."""
        return SpaceExclusions(self.enclosed)

    def certifier(self, recorder: Recorder | None) -> SpaceCertifier:
        """The certifier of this arithmetic."""
        if recorder is None or self.arithmetic == "fast":
            recorder = Unrecorded()
        return SpaceCertifier(self._engine, self.enclosed, recorder, self._exclusions)

    def _solved(self, system: SpaceSystem, near: Floats | None) -> tuple[list[Codes], Floats] | None:
        with np.errstate(all="ignore"):
            found = solved(system, near)
        # a body on springs has slightly different directions
        # from sectors of three degrees on
        return None if found is None else ([found[0].leaf(7), found[0].codes], found[1])

    def _splitting(self, certifier: Certifier) -> SpaceSplitting:
        return SpaceSplitting(self._engine)

    def _closer(self, certifier: Certifier) -> TreeCloser | None:
        if not self.problem.held:
            from enumsol.search.space.space_references import space_closer  # for such bodies only

            return None if self.enclosed.held else space_closer(certifier, self._engine, lambda: self.known_root)
        return SpaceCloser(self.system, cast("SpaceClosing", certifier), regular=self.arithmetic == "fast")

    @property
    def _forms(self) -> Forms | None:
        """Forms with which a long search may bound in place of the energy."""
        return Forms(self._better, NODES)

    def _better(self, engine: SpaceEngine, codes: Codes, rows: tuple[list[int], list[int]]) -> SlipForm | None:
        """A form that is clearly tighter than the energy over a partial assignment, or None."""
        plain = engine.root(*rows)
        if plain.stalled or plain.pruned:
            return None
        found = SlipFormAscent(engine, self.enclosed, rows).ascended()
        return None if found is None or not found[1].bound > _SHARE * plain.bound else found[0]

    def remake(self) -> Callable[[], SpaceSolvers]:
        """Makes the same again, also in another process."""
        return partial(type(self), self.problem, self.alpha, self.arithmetic)

    def fresh(self) -> SpaceSolvers:
        """Solvers with an engine of their own: which rows it has already changes what it finds."""
        other = copy.copy(self)
        other.__dict__.pop("_engine", None)
        return other

    @property
    def limits(self) -> Limits:
        """Limits of the records at the root of the tree of a proof."""
        system, tree = self.system, Tree.SPACE if self.problem.held else Tree.FLOATING_SPACE
        codes, modes = (UNDECIDED,) * system.p, self.problem.modes.r
        return Limits(codes, tree, components=len(system.g), modes=modes)
