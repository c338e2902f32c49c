"""Checker of a branch graph: every solution in the interval lies in one of the surviving selections, or on its arcs.

Records are those of docs/proof_format.md (7). Pieces partition the interval (it is cut first where g vanishes,
see ``condensation.unloaded``). Over every piece the records are trees, of all selections or of the subtrees that the
longer piece left to its halves; each exclusion is proven at both ends of the piece. Where surviving selections hold,
and how their arcs are joined, is checked by ``enumsol.checker.arcs``, if the proof says it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.checker.arcs import ArcChecker, PieceOnArcs
from enumsol.checker.reports import GraphVerificationReport
from enumsol.checker.walk import TreeCell, TreeWalker
from enumsol.condensation.enclosure import CondensedEnclosure
from enumsol.condensation.unloaded import vanishing_alpha
from enumsol.proof import leaves as kinds, reading
from enumsol.proof.records import CutPiece, Limits, Tree
from enumsol.support.deadlines import tell
from enumsol.trusted.exclusion import Leaves, exclusion_margins
from enumsol.trusted.over_interval import EnclosedPiece, PieceNumbers
from enumsol.trusted.status_rows import UNDECIDED, is_covering

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from fractions import Fraction

    from enumsol.checker.walk import Test
    from enumsol.condensation.data import Data
    from enumsol.proof.records import Record
    from enumsol.support.array_types import Codes, Floats, Mask

#: Of a piece's leaves beside arcs, at most so many times p^2.
_MOST_BESIDE_ARCS = 64


@dataclass
class GraphChecker(TreeWalker[EnclosedPiece]):
    """Checks the records of a graph's proof in 2D.

    Attributes
    ----------
    header : the proof's first record
    pieces : int
    interval : (Fraction, Fraction) or None
    """

    trees = Tree.GRAPH, Tree.FLOATING_GRAPH

    header: Any = None
    pieces: int = 0
    interval: tuple[Fraction, Fraction] | None = None
    data: Data = "problem"
    _friction: list[bool] = field(default_factory=list)
    #: The alpha at which g vanishes.
    _zero: Fraction | None = None
    #: Pieces in which selections survive; leaves that are not counted.
    _handed: dict[Codes, list[tuple[Fraction, Fraction]]] = field(default_factory=dict)
    _uncounted: int = 0
    #: Pieces whose solutions are said to lie on arcs, by the places of their forms those of this piece; and the arcs.
    _closed: list[PieceOnArcs] = field(default_factory=list)
    #: How many pieces have one solution by that alone.
    _alone: int = 0
    _on_arcs: dict[int, PieceOnArcs] = field(default_factory=dict)
    _arcs: ArcChecker | None = None
    #: The piece and its units; its data, made when there is something to exclude; what it leaves to its halves.
    _ends: tuple[Fraction, Fraction] = field(init=False)
    _units: tuple[Floats, Floats] = field(init=False)
    _system: EnclosedPiece | None = None
    _cut: list[Codes] = field(default_factory=list)

    def run(self, records: Iterator[Any]) -> GraphVerificationReport:
        """Check all records after the header."""
        with self.refusing():
            self._check(records)
        return replace(
            self._report(),
            ok=not self.failures,
            failures=tuple(self.failures),
            interval=self.interval,
            leaves=self.leaves - self._uncounted,
            within=self.problem.rigid_reach if self.bounded else None,
        )

    def _report(self) -> GraphVerificationReport:
        """Counts of what was checked."""
        return GraphVerificationReport(
            pieces=self.pieces,
            selections=frozenset() if self.failures else frozenset(self._handed),
            data=self.data,
            arcs=None if self._arcs is None else len(self._arcs.arcs),
            open=0 if self._arcs is None else self._arcs.open,
            closed=self._alone,
        )

    def _check(self, records: Iterator[Any]) -> None:
        a, b = self._read_header()
        self._zero = vanishing_alpha(self.problem, self.data)
        ends = [a, self._zero, b] if self._zero is not None and a < self._zero < b else [a, b]
        everything = [(UNDECIDED,) * self.problem.p]
        # pieces in the order in which they are searched, the next one last: halves come directly after what was cut
        waiting = [(x, y, everything) for x, y in pairwise(ends)][::-1]
        while waiting:
            x, y, roots = waiting.pop()
            tell("per cent of the interval", int(100 * (x - a) / (b - a)), 100)
            cut = self._over_piece(x, y, roots, records)
            if cut:
                waiting += [((x + y) / 2, y, cut), (x, (x + y) / 2, cut)]
        record = next(records, None)
        leaves = self.leaves - self._uncounted
        claim = {"pieces": self.pieces, "leaves": leaves, "selections": len(self._handed)}
        if self.data == "problem" and isinstance(record, dict) and "force" in record and "piece" not in record:
            origin = self._zero if self._zero is not None and a <= self._zero <= b else None
            checker = ArcChecker(self.problem, self.enclosure, (a, b), origin, self._handed, self._closed, self.fail)
            record, self._arcs = checker.run(record, records), checker
            claim |= {"traces": checker.traces, "arcs": len(checker.arcs)}
            self.bounded |= any(closed.bounded for closed in self._closed)
        elif self._closed:
            self.fail("pieces are said to be decided by their arcs, but there are none")
        self._check_counts(record, claim, "pieces", records)

    def _check_counts(self, record: object, claim: Mapping[str, int | None], what: str, records: Iterator[Any]) -> None:
        """Compare the counts in the last record with those of what was read."""
        if not reading.same(record, claim):
            found = reading.quoted(record) if isinstance(record, (dict, list)) else "missing"
            self.fail(f"the counts at the end are {found}; the {what} give {claim!r}")
        self.check_end(records)

    @cached_property
    def enclosure(self) -> CondensedEnclosure:
        """Balls for what is certified; only exclusions need them."""
        of = CondensedEnclosure.as_computed if self.data == "condensed" else CondensedEnclosure.from_problem
        return of(self.problem)

    def _read_header(self) -> tuple[Fraction, Fraction]:
        self.data = reading.data_of(self.header, self.problem, "graph")
        try:
            a, b = interval_from(self.header.get("interval"))
            ends = [reading.friction_at(self.problem, end) for end in (a, b)]
        except ValueError as error:
            raise reading.RefusedError(f"the header cannot be read: {error}") from None
        self.interval = (a, b)
        self._friction = [max(pair) > 0 for pair in zip(*ends, strict=True)]
        return a, b

    # -- pieces ----------------------------------------------------------------------------------------------------

    def _over_piece(self, x: Fraction, y: Fraction, roots: list[Codes], records: Iterator[Any]) -> list[Codes]:
        """Check the trees over the piece that is due; the assignments that they leave to its halves."""
        number, record = self.pieces + 1, next(records, None)
        if not isinstance(record, dict):
            raise reading.RefusedError(f"piece {number} is missing")
        try:
            reading.names_only(record, ("piece", "force", "length"))
            ends, units = interval_from(record["piece"]), reading.units_from(record, self.problem.p)
        except ValueError as error:
            raise reading.RefusedError(f"piece {number} cannot be read: {error}") from None
        if ends != (x, y):
            raise reading.RefusedError(f"piece {number} is not the next one: the interval is not covered")
        self.pieces, self._ends, self._units, self._system, self._cut = number, ends, units, None, []
        self.declared, self._forms, self._on_arcs, before = [], {}, {}, self._uncounted
        self._walk(records, [TreeCell(codes) for codes in roots])
        used = [closed for closed in self._on_arcs.values() if closed.leaves]
        self._closed += used
        # of a body that nothing holds the form is about its leaves only: here they are all, and none survives or is cut
        whole = self._uncounted == before and roots == [(UNDECIDED,) * self.problem.p]
        self._alone += bool(used) and (self.problem.held or whole)
        if self.progress is not None:
            self.progress(self.leaves)
        return self._cut

    @property
    def system(self) -> EnclosedPiece:
        """The data at both ends of the piece, with S proven positive definite."""
        if self._system is None:
            origin = self._zero if self._zero in self._ends else None
            self._system = EnclosedPiece.from_enclosure(self.enclosure, *self._ends, *self._units, origin)
            if not all(end.smallest_eigenvalue > 0 for end in self._system.ends):
                raise reading.RefusedError("S is not proven positive definite")
        return self._system

    def _covers(self, node: int, code: int, children: list[int]) -> bool:
        return is_covering(code, children, friction=self._friction[node])

    def _limits(self, codes: Codes, kind: type[Record]) -> Limits:
        return Limits(codes, self.tree, self._friction, self.declared, modes=self.problem.modes.r)

    def _declare(self, record: list[Any]) -> None:
        """Take note of a form, and of the selections that survive if it is one of arcs."""
        super()._declare(record)
        said = self.declared[-1]
        if said.of_arcs:
            try:
                numbers = PieceNumbers.of(said.numbers, said.more)
            except ValueError as error:
                raise reading.RefusedError(f"a form cannot be read: {error}") from None
            self._on_arcs[len(self.declared) - 1] = PieceOnArcs(*self._ends, numbers)
            for codes in said.codes:
                self._handed.setdefault(codes, []).append(self._ends)

    # -- leaves ----------------------------------------------------------------------------------------------------

    @cached_property
    def tests(self) -> dict[type[Record], Test]:
        """Tests of leaves, by their kinds."""
        return {
            kinds.Excluded: self._excluded,
            kinds.Unbalanced: self._beside_arcs,
            kinds.OnlyReference: self._beside_arcs,
            kinds.Survivor: self._survives,
            CutPiece: self._left,
        }

    def _survives(self, codes: Codes, said: kinds.Survivor) -> str | None:
        del said
        self._uncounted += 1
        # its arcs lie within the bound of the rigid displacement
        self.bounded |= not self.problem.held
        self._handed.setdefault(codes, []).append(self._ends)
        return None

    def _left(self, codes: Codes, said: CutPiece) -> str | None:
        self._uncounted += 1
        self._cut.append(codes)
        return None if 2 * said.between(*self._ends) == sum(self._ends) else "its piece is not cut in halves"

    def _beside_arcs(self, codes: Codes, said: kinds.OnlyReference | kinds.Unbalanced) -> str | None:
        """Keep a leaf below which there is nothing beside arcs, or nothing at all, until the arcs are known."""
        last = max(self._on_arcs, default=-1)
        closed = self._on_arcs.get(len(self.declared) - said.back if isinstance(said, kinds.OnlyReference) else last)
        self._uncounted += self.problem.held
        if closed is None:
            return "no arcs were declared for it"
        if len(closed.leaves) >= _MOST_BESIDE_ARCS * self.problem.p**2:
            raise reading.RefusedError("a piece has too many leaves beside its arcs")
        closed.leaves.append((codes, said))
        return None

    def _excludes(self, leaves: Leaves) -> Mask:
        """Mask of assignments without a solution in the piece."""
        if not self.problem.held and not self.bounded:
            # where arcs are all, perhaps without the bound of the rigid displacement
            margins = exclusion_margins(self.system.unbounded, leaves) if self._on_arcs else np.zeros(1)
            self.bounded = not np.all(margins > 0)
        return exclusion_margins(self.system, leaves) > 0


def interval_from(ends: object) -> tuple[Fraction, Fraction]:
    """Both ends of an interval."""
    if not isinstance(ends, list) or len(ends) != 2:
        raise ValueError(f"{reading.quoted(ends)} is not an interval")
    a, b = (reading.rational_from(end) for end in ends)
    if not a < b:
        raise ValueError("an interval is empty")
    return a, b
