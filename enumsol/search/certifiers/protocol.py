"""The base of all certifiers, what they take and give, and how proposals are proven to exclude an assignment.

The exclusion inequalities are compiled here, if that module is installed, else those of the trusted core.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, fields
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.proof.leaves import UndecidedRecord, Unloaded
from enumsol.proof.records import Branching, Record
from enumsol.relaxation.engine import Relaxation
from enumsol.selections.solution import VertexLimitError
from enumsol.trusted.exclusion import exclusion_margin
from enumsol.trusted.over_interval import EnclosedPiece

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from enumsol.condensation.enclosure import EnclosedSystem
    from enumsol.proof.leaves import Alone, OnlyReference
    from enumsol.proof.records import DeclaredForm
    from enumsol.proof.writer import Part, Recorder
    from enumsol.search.reduction import Point, Proposal
    from enumsol.selections.solution import SelectionSolution, SelectionSolver
    from enumsol.support.array_types import Codes, Floats, Indices
    from enumsol.trusted.quadratic_forms import EnclosedForm

    #: All solutions below a partial assignment, or a node to split and the codes of its children.
    Led = list[Any] | tuple[int, list[int]]

    #: A lower bound over a partial assignment, proven by the multipliers of its rows.
    Margin = Callable[[Codes, Indices, Floats], float]


#: The balls written into a proof are wider than those found by this factor, so that a checker's own balls fit in.
WIDEN = 4.0
#: Error bounds count so many times where a proof is written, so that a checker that rounds otherwise agrees.
ERRORS = 2.0


@dataclass(frozen=True)
class UndecidedPart:
    """A part of the selections that the search left undecided.

    Attributes
    ----------
    codes : status codes
    reason, hint : str
    examined : bool
        A leaf that could not be decided; otherwise the search did not come to it.
    """

    codes: Codes
    reason: str
    hint: str
    examined: bool = False


@dataclass(frozen=True)
class Refine:
    """A complete selection that is to be split further, at a node."""

    node: int


@dataclass
class Escalations:
    """Counts of the selections and prunings that needed each arithmetic.

    Attributes
    ----------
    balls : int
        Decided by error bounds in double arithmetic.
    rationals : int
        Decided in rational arithmetic.
    refined : int
        Prunings whose inequality failed; smaller multipliers proved them, or they were branched on.
    undecided : int
    """

    balls: int = 0
    rationals: int = 0
    refined: int = 0
    undecided: int = 0

    def add(self, other: Escalations) -> None:
        """Add the counts of another part of the search."""
        for count in fields(self):
            setattr(self, count.name, getattr(self, count.name) + getattr(other, count.name))


@dataclass(frozen=True)
class Certified:
    """Conclusions of a certifier; of one that writes no proof, nothing.

    Attributes
    ----------
    verified : balls of the regular roots, by their codes: VerifiedSelection, in 3D SpaceRoot
    escalations : Escalations or None
    leaves : int
        Leaves written to the proof.
    sliding : as of the certifier
    bounded : bool
        Of a body that nothing holds: some conclusion rests on the bound of its rigid displacement.
    """

    verified: Mapping[Codes, Any] = field(default_factory=dict)
    escalations: Escalations | None = None
    leaves: int = 0
    sliding: Mapping[int, int] = field(default_factory=dict)
    bounded: bool = False


@dataclass(frozen=True)
class RecordedBound:
    """Multipliers that are said to bound the energy, or a form, from below; in place of a relaxation's.

    Rows are those of a record: in 3D a list of kind, node and number.
    """

    rows: Any
    values: Floats
    form: Any = None
    bound: float = np.inf

    def multipliers(self) -> tuple[Any, Floats]:
        """Rows and their multipliers."""
        return self.rows, self.values


#: Multipliers of a relaxation, or of a record of an earlier proof, for an assignment without a solution.
Bound = Relaxation | RecordedBound
#: No multipliers: a certifier may know of other reasons why an assignment holds no solution.
NO_BOUND = RecordedBound(np.zeros(0, dtype=np.intp), np.zeros(0))


class Unrecorded:
    """A recorder for searches without a proof."""

    def write(self, record: Any) -> None:
        """Nothing to write."""

    def add(self, part: Part) -> None:
        """Nothing to write."""


class Certifier(ABC):
    """Decides in one arithmetic what the tree may conclude, and writes the proof, if one is wanted.

    Parameters
    ----------
    recorder : Recorder, optional
        Where the records of the proof go.

    Attributes
    ----------
    sliding : dict
        FORWARD or BACKWARD for nodes that touch without load and slide at a solution met (theory, section 6.11).
    bounded : bool
        Of a body that nothing holds: some conclusion rests on the bound of its rigid displacement.
    hard : bool
        A complete selection was met that is degenerate, or nearly so.
    """

    #: It writes a proof, and keeps what it has proven; otherwise nothing is.
    writes = True
    #: Of closing subtrees: it knows a solution exactly, so that statuses need not hold strictly; it takes plain numbers
    #: only, mu = kappa = 1 and nu = 0; it can prove that a regular root is alone.
    exactly, plain, lone = True, False, False
    hard = False
    _escalations: Escalations | None = None

    def __init__(self, recorder: Recorder | None = None) -> None:
        self.recorder: Recorder = Unrecorded() if recorder is None else recorder
        self.sliding: dict[int, int] = {}
        self.bounded = False
        self._verified: dict[Codes, Any] = {}
        self._leaves = 0
        #: Forms that were declared, by what they are known by, and how many were before each.
        self._declared: dict[Any, int] = {}

    # -- what is concluded -----------------------------------------------------------------------------------------

    @abstractmethod
    def excluded(self, codes: Codes, relaxation: Bound) -> bool:
        """True if the relaxation's multipliers prove that the partial assignment holds no solution."""

    @abstractmethod
    def selection(self, codes: Codes) -> Any:
        """All roots in a complete selection, None when it holds none, why that is open, or what to split further."""

    def closed(self, codes: Codes, proposal: Proposal | None, near: Point) -> list[Any] | None:
        """The solutions below a partial assignment, none or one, if it can hold one only; None if not proven.

        Parameters
        ----------
        codes : of the assignment
        proposal : what may close it, if anything was found
        near : lambda and w from which its solution was sought
        """
        del codes, proposal, near
        return None

    def alone(self, codes: Codes, record: Alone) -> list[Any] | None:
        """The root of a record, if it is proven to be the only one below a partial assignment; else None."""
        del codes, record
        return None

    def reference(self, selection: Codes) -> Any:
        """The form of a root of a body that nothing holds, a Reference or LeafReference, if one is definite; or None.

        In 2D the root of a selection, in 3D that of a leaf.
        """
        del selection
        return None

    def only_root(self, codes: Codes, reference: Any, proposal: OnlyReference) -> list[Any] | None:
        """The roots below an assignment, that of a form if it was not told before, or none; None if not proven."""
        del codes, reference, proposal
        return None

    # -- the proof -------------------------------------------------------------------------------------------------

    @property
    def certified(self) -> Certified:
        """Conclusions so far."""
        return Certified(self._verified, self._escalations, self._leaves, self.sliding, self.bounded)

    def branching(self, node: int, children: Sequence[int]) -> None:
        """Record that a partial assignment is split at ``node`` (called in preorder, for the proof)."""
        if self.writes:
            self.recorder.write(Branching(node, list(children)).write())

    def skipped(self, codes: Codes, reason: str) -> None:
        """Record that a subtree was not examined, and why."""
        self._leaf(UndecidedRecord(reason))

    def unloaded(self) -> None:
        """Record that the body is unloaded, which decides the whole tree."""
        self._leaf(Unloaded())

    def add(self, part: Certified) -> None:
        """Take over what the certifier of a subtree has proven; its records were written already."""
        self.sliding |= part.sliding
        self.bounded |= part.bounded
        if not self.writes:
            return
        self._verified |= part.verified
        self._leaves += part.leaves
        if self._escalations is not None and part.escalations is not None:
            self._escalations.add(part.escalations)
        self._declared.clear()  # it may have declared others

    def forget(self) -> None:
        """Forget what was proven, as the search begins again; its records were dropped already."""
        self._verified, self._leaves, self.bounded = {}, 0, self.bounded and not self.writes
        self._declared.clear()

    def _back(self, form: Any, declaration: Callable[[], DeclaredForm]) -> int:
        """Number of forms since one was declared, 1 for the last; one that was not is declared."""
        if form not in self._declared:
            self._declared[form] = len(self._declared)
            self.recorder.write(declaration().write())
        return len(self._declared) - self._declared[form]

    def _leaf(self, leaf: Record) -> None:
        if self.writes:
            self._leaves += 1
            self.recorder.write(leaf.write())


def solve_or_open(solver: SelectionSolver, codes: Codes) -> SelectionSolution | UndecidedPart | None:
    """The solver's answer; a polytope with too many candidate vertices leaves the selection open."""
    try:
        return solver.solve(codes)
    except VertexLimitError as error:
        return UndecidedPart(codes, str(error), "perturb the load or the friction coefficient", examined=True)


#: How often the error bound of an exclusion with a form is subtracted where a proof is written.
FORM_ERRORS = 4.0


def energy_margin(within: EnclosedSystem | EnclosedPiece) -> Margin:
    """Lower bounds on the energy, less twice the error bound (theory, sections 6.2 and 7.9)."""
    plain = partial(exclusion_margin, within, errors=ERRORS)
    # the compiled margins know no rows of a body as a whole
    if not (within.ends[0] if isinstance(within, EnclosedPiece) else within).held:
        return plain
    try:
        from enumsol.search.certifiers._margin import Margins
    except ImportError:
        return plain
    if isinstance(within, EnclosedPiece):
        return Margins(within.ends, within.low, within.high).margin
    return Margins((within,), within.F, within.F).margin


def margin_of_form(form: EnclosedForm, errors: float) -> Margin:
    """Lower bounds on a form, less the error bound so many times (theory, section 6.12)."""
    try:
        from enumsol.search.certifiers._margin import FormMargins
    except ImportError:
        return partial(exclusion_margin, form, errors=errors)
    return FormMargins(form, errors).margin
