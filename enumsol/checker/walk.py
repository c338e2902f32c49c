"""Bases of checkers: the walk through trees, at one alpha or over pieces of alpha, whose leaves cover their roots."""

from __future__ import annotations

from abc import ABC, abstractmethod
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Generic, NamedTuple, TypeVar

import numpy as np

from enumsol.checker.reports import MAX_FAILURES, VerificationReport
from enumsol.condensation.enclosure import CondensedEnclosure, EnclosedSystem, NotEnclosedError
from enumsol.errors import InvalidArgumentError, InvalidProblemError
from enumsol.proof import leaves as kinds
from enumsol.proof.reading import RecordError, RefusedError, quoted, same
from enumsol.proof.records import Branching, CutPiece, DeclaredForm, Limits, Tree
from enumsol.support.deadlines import tell
from enumsol.trusted.exclusion import Leaves, Terms, exclusion_margins
from enumsol.trusted.over_interval import EnclosedPiece
from enumsol.trusted.status_rows import UNDECIDED

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable, Iterator, Sequence
    from fractions import Fraction

    from enumsol.arithmetic.balls import Ball
    from enumsol.condensation.data import Data
    from enumsol.proof.records import EnclosureRecord, Record
    from enumsol.support.array_types import Codes, Mask
    from enumsol.trusted.positions import Among

    #: Checks what a leaf of one kind says; the reason when it proves nothing.
    Test = Callable[[Codes, Any], str | None]

#: Balls of a problem, at one alpha or over a piece; at one alpha; and roots of its leaves.
Enclosed = TypeVar("Enclosed", bound=EnclosedSystem | EnclosedPiece)
System = TypeVar("System", bound=EnclosedSystem)
Root = TypeVar("Root")
_REPORT_EVERY = 256
#: Exclusion leaves in 2D checked together.
_BATCH = 256
#: Forms that are kept as they were made: a file that alternates between more has each of them made again.
_KEPT = 16
_END = object()
#: Reasons why leaves of both dimensions prove nothing.
_OPEN = "what it holds is not proven"
NO_FORM = "no form that is convex was declared over it"


@dataclass(frozen=True, eq=False)
class Located:
    """Place of a root, as a leaf shows it.

    Attributes
    ----------
    forces : Ball
        In the problem's units: all normal components first.
    still : bool array
        Tangential components with u_t = 0 for certain.
    codes : p status codes, or None
        Where they are certain; in 3D any one but open and stick means slip.
    rigid : Ball or None
        Of a body that nothing holds, the coordinates of its rigid displacement, in the problem's units.
    among : per node the codes that it may have, or None
        Of a root that is in one of these selections for certain.
    open : (p,) bool array, or None
        Nodes with w_n < 0 for certain.
    """

    forces: Ball
    still: Mask
    codes: tuple[int, ...] | None = None
    rigid: Ball | None = None
    among: Among | None = None
    open: Mask | None = None


@dataclass
class ProofChecker:
    """Base of the checkers of one proof: what they found wrong."""

    failures: list[str] = field(default_factory=list, kw_only=True)

    def fail(self, message: str) -> None:
        """Take note of a failure.

        Raises
        ------
        RefusedError
            There have been MAX_FAILURES: whoever wrote this may have written any number of such leaves.
        """
        self.failures.append(message)
        if len(self.failures) == MAX_FAILURES:
            raise RefusedError(f"the check ends after {MAX_FAILURES} failures")

    @staticmethod
    def check_end(records: Iterator[Any]) -> None:
        """Raise RefusedError where there are more records than there should be."""
        if next(records, _END) is not _END:
            raise RefusedError("records follow after the end of the proof")

    @contextmanager
    def refusing(self) -> Iterator[None]:
        """Within this context what makes no sense, or data that cannot be enclosed, end the check as a failure."""
        try:
            yield
        except RefusedError as refusal:
            self.failures.append(str(refusal))
        except (NotEnclosedError, InvalidProblemError, InvalidArgumentError) as error:
            self.failures.append(f"the problem's data cannot be enclosed: {error}")


class TreeCell(NamedTuple):
    """A node of a tree: a (partial) assignment, and in trees that are cut its piece of alpha."""

    codes: tuple[int, ...]
    piece: tuple[Fraction, Fraction] | None = None


@dataclass
class TreeWalker(ProofChecker, ABC, Generic[Enclosed]):
    """Walks through trees and tests every leaf, at one alpha or over a piece of alpha."""

    problem: Any  # in 2D or 3D
    progress: Callable[[int], object] | None
    leaves: int = 0
    #: How many they are, if it is known.
    _all: int = 0
    #: Of a body that nothing holds: some leaf rests on the bound of its rigid displacement.
    bounded: bool = False

    #: What later leaves may refer to, and what was made of the last of these by their places.
    declared: list[DeclaredForm] = field(default_factory=list)
    _forms: dict[int, Any] = field(default_factory=dict)
    #: Leaves in 2D to be tested together, by the places of their forms: numbers, codes and multipliers.
    _waiting: dict[int | None, list[tuple[int, Codes, Terms]]] = field(default_factory=dict)

    #: Trees of bodies that are held, and of others.
    trees: ClassVar[tuple[Tree, Tree]]
    #: What its leaves are called in failures.
    of_tree: ClassVar[str] = ""

    @property
    def tree(self) -> Tree:
        """Kind of its tree: some theorems rest on a stiffness that is positive definite, others on balance."""
        return self.trees[0 if self.problem.held else 1]

    @property
    @abstractmethod
    def system(self) -> Enclosed:
        """Balls for the data in the proof's units."""

    @cached_property
    def free(self) -> Enclosed:
        """The system with bounds of the rigid displacement beyond which there are no solutions."""
        return self.system if self.problem.held else self._without_bound()

    def _without_bound(self) -> Enclosed:
        """See ``free``, for a body that nothing holds."""
        raise NotImplementedError

    @abstractmethod
    def _covers(self, node: int, code: int, children: list[int]) -> bool:
        """True if codes, in any order, cover a partial one of a node."""

    @abstractmethod
    def _limits(self, codes: Codes, kind: type[Record]) -> Limits:
        """Limits of what a record of this kind may say at this assignment."""

    @cached_property
    @abstractmethod
    def tests(self) -> dict[type[Record], Test]:
        """Tests of leaves, by their kinds."""

    # -- the tree --------------------------------------------------------------------------------------------------

    def _leaves(
        self, records: Iterator[Any], roots: Sequence[TreeCell], *, survey: bool = False
    ) -> Iterator[tuple[TreeCell, list[Any]]]:
        """Leaves of the trees below some cells, one after the other, with their cells, which together cover these."""
        stack = [*roots[::-1]]
        while stack:
            cell = stack.pop()
            record = next(records, None)
            if not isinstance(record, list) or not record:
                raise RefusedError(f"{len(stack) + 1} subtrees are not accounted for: the tree breaks off")
            try:
                if record[0] == Branching.kind:
                    split = Branching.covering(record, cell.codes, self._covers)
                    stack += [TreeCell(codes, cell.piece) for codes in reversed(split.below(cell.codes))]
                elif record[0] == CutPiece.kind and cell.piece is not None:
                    low, high = cell.piece
                    alpha = CutPiece.read(record, Limits(cell.codes)).between(low, high)
                    stack += [TreeCell(cell.codes, (alpha, high)), TreeCell(cell.codes, (low, alpha))]
                elif record[0] == DeclaredForm.kind:
                    if not survey:
                        self._declare(record)
                    stack.append(cell)
                else:
                    yield cell, record
            except RecordError as error:
                raise RefusedError(str(error)) from None

    def _walk(self, records: Iterator[Any], roots: Sequence[TreeCell]) -> None:
        for cell, record in self._leaves(records, roots):
            self.leaves += 1
            problem = self._leaf(cell, record)
            if problem is not None:
                self.fail(f"leaf {self.leaves}{self.of_tree}: {problem}")
            self._flush(last=False)
            if self.leaves % _REPORT_EVERY == 0:
                if self._all:
                    tell("leaves", self.leaves, self._all)
                if self.progress is not None:
                    self.progress(self.leaves)
        self._flush(last=True)

    # -- leaves ----------------------------------------------------------------------------------------------------

    def _leaf(self, cell: TreeCell, record: list[Any]) -> str | None:
        """Check one leaf; the reason when it proves nothing."""
        kind = kinds.kind_of(record, self.tree)
        if kind is None:
            return f"unknown kind of record {quoted(record[0])}"
        try:
            return self.tests[kind](cell.codes, kind.read(record, self._limits(cell.codes, kind)))
        except RecordError as error:
            return str(error)
        except ValueError as error:
            return f"its record cannot be followed ({error})"

    def _excluded(self, codes: Codes, said: kinds.Excluded) -> str | None:
        """In 2D multipliers are tested together with those of other leaves."""
        place = len(self.declared) - said.by if isinstance(said.by, int) else None
        self._waiting.setdefault(place, []).append((self.leaves, codes, said.terms))
        return None

    def _flush(self, *, last: bool) -> None:
        """Check the dual inequalities of the leaves that wait, form by form, at the end or when they are many."""
        if not last and sum(map(len, self._waiting.values())) < _BATCH:
            return
        waiting, self._waiting = self._waiting, {}
        for place, leaves in waiting.items():
            numbers, codes, terms = zip(*leaves, strict=True)
            proven = self._proven(place, Leaves.of(codes, terms))
            for k in np.flatnonzero(~proven):
                # alone it is summed in the order of the search, which may matter for a nearly singular S
                if not self._proven(place, Leaves.of([codes[k]], [terms[k]]))[0]:
                    form = "" if place is None else "form and "
                    self.fail(f"leaf {numbers[k]}: its {form}multipliers do not exclude it")

    def _proven(self, place: int | None, leaves: Leaves) -> Mask:
        """Mask of assignments that have no solution, by the form at this place of those declared, or by the energy."""
        if place is None:
            return self._excludes(leaves)
        with np.errstate(over="ignore", invalid="ignore"):
            return exclusion_margins(self._form(len(self.declared) - place), leaves) > 0

    def _excludes(self, leaves: Leaves) -> Mask:
        """Mask of assignments without a solution, if possible without the bound of the rigid displacement."""
        proven = exclusion_margins(self.free, leaves) > 0
        if not self.problem.held and not np.all(proven):
            self.bounded = True
            proven |= exclusion_margins(self.system, leaves) > 0
        return proven

    def _declare(self, record: list[Any]) -> None:
        """Take note of what later leaves refer to."""
        try:
            limits = self._limits((UNDECIDED,) * self.problem.p, DeclaredForm)
            self.declared.append(DeclaredForm.read(record, limits))
        except ValueError as error:
            raise RefusedError(str(error)) from None

    def _form(self, back: int) -> Any:
        """The form that was declared so many before, as ``DeclaredForm.form`` gives it."""
        place = len(self.declared) - back
        if place not in self._forms:
            if len(self._forms) == _KEPT:
                del self._forms[next(iter(self._forms))]
            self._forms[place] = self.declared[place].form(self.system)
        return self._forms[place]


@dataclass
class TreeChecker(TreeWalker[System], Generic[System, Root]):
    """Checks one proof at one alpha: its header, then the tree alone, then every leaf.

    Whatever does not fit together is found before anything is computed, which may take long.
    """

    alpha: Fraction = field(init=False)
    regular: int = 0
    undecided: int = 0
    #: undecided parts besides undecided leaves
    doubtful: int = 0
    data: Data = "problem"
    #: Places of the roots in leaves, by the roots' names; None if nobody asks where the roots leave the nodes.
    located: dict[Hashable, list[Located]] | None = None
    #: Names of roots by other names of the same roots.
    same: dict[Hashable, Hashable] = field(default_factory=dict)
    #: The problem's balls, where whoever asks for the check has made them already.
    enclosure: CondensedEnclosure | None = None

    #: Regular roots of leaves, with the codes of these.
    roots: list[tuple[Codes, Any]] = field(default_factory=list)

    def run(self, read: Callable[[], Iterator[Any]]) -> VerificationReport:
        """Check all records, which are read twice.

        Raises
        ------
        ProofFormatError
            The content is not a sequence of records.
        """
        families = isolated = 0
        with self.refusing():
            records = read()
            self._read_header(next(records, None))
            footer = self._survey(records)
            records = read()
            next(records, None)
            self._walk(records, self._whole)
            isolated, families = self._count()
            claim = self._claim(isolated, families)
            if not same(footer, claim):
                self.fail(f"the counts at the end are {quoted(footer)}; the leaves give {claim}")
        return VerificationReport(
            not self.failures,
            tuple(self.failures),
            self.regular + isolated,
            families,
            self.undecided + self.doubtful,
            self.leaves,
            self.data,
            getattr(self, "alpha", None),
            self._within,
        )

    @property
    def _within(self) -> float | None:
        """The bound of rigid displacements that the leaves rest on."""
        return self.problem.rigid_reach if self.bounded else None

    def _either(self, holds: Callable[[System], bool]) -> bool:
        """True if something holds of the system, if possible without the bound of the rigid displacement."""
        if holds(self.free):
            return True
        if self.problem.held:
            return False
        self.bounded = True
        return holds(self.system)

    def enclosed(self) -> CondensedEnclosure:
        """Balls for S and g of the problem's own data."""
        return self.enclosure or CondensedEnclosure.from_problem(self.problem)

    @property
    def _whole(self) -> list[TreeCell]:
        """Root of its tree."""
        return [TreeCell((UNDECIDED,) * self.problem.p)]

    # -- what a checker adds ---------------------------------------------------------------------------------------

    def _read_header(self, header: Any) -> None:
        raise NotImplementedError

    @abstractmethod
    def _settled(self, system: System, codes: Codes) -> Any:
        """The root of a complete assignment, None where it has none, or that this is open."""

    @abstractmethod
    def _is_root(self, found: object) -> bool:
        """True if what a complete assignment holds is a root."""

    @abstractmethod
    def _wrongly_said(self, found: Root, said: EnclosureRecord) -> str | None:
        """Why the ball and the index that are said to be those of a root are not, or None."""

    @abstractmethod
    def _locate(self, name: Codes, found: Root, codes: Codes = ()) -> None:
        """Take note of where a root is, by its name and, if they are known, its codes."""

    @abstractmethod
    def _at_rest(self) -> None:
        """Count the root of the unloaded body."""

    @abstractmethod
    def _count(self) -> tuple[int, int]:
        """Isolated roots besides ``regular``, and families."""

    @abstractmethod
    def _claim(self, isolated: int, families: int) -> dict[str, int]:
        """The footer that fits the leaves."""

    def _survey(self, records: Iterator[Any]) -> Any:
        """Walk the tree without a look at its leaves; gives the counts at the end."""
        leaves = self._all = sum(1 for _ in self._leaves(records, self._whole, survey=True))
        footer = next(records, None)
        if not isinstance(footer, dict) or footer.get("leaves") != leaves:
            found = "missing" if footer is None else quoted(footer)
            raise RefusedError(f"the counts at the end are {found}; the tree has {leaves} leaves")
        self.check_end(records)
        return footer

    @cached_property
    def tests(self) -> dict[type[Record], Test]:
        """Tests of leaves, by their kinds."""
        return {
            kinds.Excluded: self._excluded,
            kinds.UndecidedRecord: self._undecided,
            kinds.Unloaded: self._unloaded,
            kinds.Unbalanced: self._unbalanced,
            kinds.NoRoot: self._no_root,
            kinds.RegularRoot: self._regular_root,
            kinds.Alone: self._alone,
            kinds.OnlyReference: self._only_reference,
        }

    def _undecided(self, codes: Codes, said: kinds.UndecidedRecord) -> str | None:
        self.undecided += 1
        return None if isinstance(said.reason, str) else "its reason is not a text"

    def _unloaded(self, codes: Codes, said: kinds.Unloaded) -> str | None:
        unloaded = all(code == UNDECIDED for code in codes) and self.problem.is_unloaded(self.alpha)
        # g = 0: by the energy bound nothing but lambda = 0 solves
        self._at_rest()
        return None if unloaded else "the problem is not unloaded"

    def _unbalanced(self, codes: Codes, said: kinds.Unbalanced) -> str | None:
        return None if said.holds(self.system, codes) else "forces below it may be in balance with the load"

    def _no_root(self, codes: Codes, said: kinds.NoRoot) -> str | None:
        del said
        if self._either(lambda system: self._settled(system, codes) is None):
            return None
        return "it holds a root" if self._is_root(self._settled(self.system, codes)) else _OPEN

    def _regular_root(self, codes: Codes, said: kinds.RegularRoot) -> str | None:
        found = self._settled(self.system, codes)
        if not self._is_root(found):
            return "it holds no root" if found is None else _OPEN
        return self._regular(codes, found, said.enclosure)

    def _alone(self, codes: Codes, said: kinds.Alone) -> str | None:
        found = said.holds(self.system, codes)
        if found is None:
            if all(code == UNDECIDED for code in codes):
                return "its solution is not proven to be the only one"
            return "its root is not proven to be the only one in it"
        return self._regular(said.selection, found, said.enclosure)

    def _only_reference(self, codes: Codes, said: kinds.OnlyReference) -> str | None:
        """The declared root is the only one below a leaf, if any is."""
        known = self._form(said.back)
        if known is None:
            return "the root that was declared is not proven"
        proven = self._either(lambda system: said.holds(known, codes, system.reach))
        return None if proven else "the root that was declared is not proven to be the only one in it"

    def _regular(self, codes: Codes, found: Root, said: EnclosureRecord) -> str | None:
        """Count a regular root of a leaf, and look at what is said of it."""
        self.roots.append((codes, found))
        if not self.problem.held and not self.bounded:
            self.bounded = not self._is_root(self._settled(self.free, codes))
        self._locate(codes, found, codes)
        return self._wrongly_said(found, said)

    def locate(self, name: Hashable, found: Located) -> None:
        """Add the place of a root in a leaf to ``located`` if places are collected."""
        if self.located is not None:
            self.located.setdefault(name, []).append(found)

    def located_roots(self) -> list[list[Located]]:
        """Places of every root, one for each of the leaves that hold it."""
        roots: dict[Hashable, list[Located]] = {}
        for name, found in (self.located or {}).items():
            roots.setdefault(self.same.get(name, name), []).extend(found)
        return list(roots.values())
