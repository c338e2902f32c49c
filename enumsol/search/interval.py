"""Which selections may hold somewhere in an interval of alpha: the tree search on pieces of it (theory, section 7.8).

Every piece is a tree of its own whose leaves cover all selections: a leaf is either proven empty on the whole piece
or a complete selection that is handed on. A piece whose tree grows too large is cut in two; both halves go on with
the subtrees that are left, and what was proven for the whole piece is proven for them too.
"""

from __future__ import annotations

import itertools
import time
from collections import deque
from dataclasses import dataclass, field
from fractions import Fraction
from typing import TYPE_CHECKING, Protocol

from enumsol.relaxation.interval import IntervalEngine, IntervalSystem, interval_rows
from enumsol.search.certifiers.protocol import WithoutProof
from enumsol.search.splitting import PlaneSplitting
from enumsol.search.stopping import Stop, StopReason
from enumsol.search.tree import SearchLimits, TreeSearch
from enumsol.statuses import UNDECIDED

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from enumsol.condensation.condensed import CondensedProblem
    from enumsol.relaxation.engine import Relaxation
    from enumsol.search.certifiers.protocol import Certifier
    from enumsol.selections.solution import Codes

#: Nodes of a piece's tree, per contact node, after which the tree at its middle is computed for comparison.
NODES_PER_CONTACT = 20
#: A piece whose tree grows beyond this multiple of the tree at its middle alone is cut in two.
WORTH_CUTTING = 3
#: New complete selections in one piece beyond which it is cut in two (an exact arc costs some hundred tree nodes).
NEW_SELECTIONS = 16
#: Pieces are not cut below this part of the interval.
SMALLEST_PIECE = 2.0**-40


@dataclass(frozen=True)
class Piece:
    """A closed part [a, b] of the interval of alpha; exact, since its ends are floats or halves of them."""

    a: Fraction
    b: Fraction

    @property
    def middle(self) -> Fraction:
        """(a + b) / 2."""
        return (self.a + self.b) / 2


@dataclass(frozen=True)
class EmptyLeaf:
    """A partial assignment that holds no solution on a piece, with the multipliers that prove it.

    Attributes
    ----------
    codes : status codes, CONTACT and UNDECIDED included
    rows : int array, kind * p + node with the kinds of RowKind and IntervalRowKind
    values : float array, multipliers in the scaling of the piece's IntervalSystem
    """

    codes: Codes
    rows: NDArray[np.intp]
    values: NDArray[np.float64]


@dataclass
class SearchedPiece:
    """What the trees over one piece left: together the leaves cover all selections below ``roots``.

    Attributes
    ----------
    piece : Piece
    system : IntervalSystem
    roots : list of codes
        Partial assignments whose subtrees were searched.
    empty : list of EmptyLeaf
        Leaves proven empty on the whole piece.
    selections : list of codes
        Complete selections, handed on.
    cut : list of codes
        Subtrees (and complete selections) that both halves of the piece take over as their roots.
    """

    piece: Piece
    system: IntervalSystem
    roots: list[Codes]
    empty: list[EmptyLeaf] = field(default_factory=list)
    selections: list[Codes] = field(default_factory=list)
    cut: list[Codes] = field(default_factory=list)


class IntervalCertifier(Protocol):
    """Decides in one arithmetic whether multipliers prove a leaf empty on the whole piece."""

    @property
    def checkable(self) -> bool:
        """Whether a checker can repeat what was accepted so far, so that it makes a proof."""

    def excluded(self, piece: Piece, system: IntervalSystem, leaf: EmptyLeaf) -> bool:
        """Whether the dual bounds at both ends of the piece are positive."""


class FastIntervalCertifier:
    """Floats: the result of the engine is trusted."""

    checkable = False

    def excluded(self, piece: Piece, system: IntervalSystem, leaf: EmptyLeaf) -> bool:
        """Accept the pruning."""
        del piece, system, leaf
        return True


class _Collector(WithoutProof):
    """The certifier of one piece's tree: keeps the leaves, and counts the selections not known before.

    Branchings and subtrees left over need no note: the leaves cover everything, with those in SearchedPiece.cut.
    """

    def __init__(self, found: SearchedPiece, leaves: IntervalCertifier, known: set[Codes]) -> None:
        self._found, self._leaves, self._known = found, leaves, known
        self.new = 0

    def excluded(self, codes: Codes, relaxation: Relaxation) -> bool:
        leaf = EmptyLeaf(codes, *relaxation.multipliers())
        if not self._leaves.excluded(self._found.piece, self._found.system, leaf):
            return False
        self._found.empty.append(leaf)
        return True

    def selection(self, codes: Codes) -> None:
        self._found.selections.append(codes)
        self.new += codes not in self._known


class _SizeOnly(_Collector):
    """The certifier of a tree of which only the size matters."""

    def excluded(self, codes: Codes, relaxation: Relaxation) -> bool:
        del codes, relaxation
        return True


class IntervalSplitting(PlaneSplitting):
    """Two dimensions over an interval of alpha.

    Parameters
    ----------
    system : IntervalSystem
    """

    def __init__(self, system: IntervalSystem) -> None:
        super().__init__(system.F)
        self._constant = [bool(v) for v in system.F_lo == system.F]

    def rows(self, node: int, code: int) -> Sequence[tuple[int, int]]:
        """(kind, mode) of the rows that a contact node imposes in a status over the interval."""
        return interval_rows(code, friction=self.friction[node], constant=self._constant[node])


class IntervalTreeSearch(TreeSearch):
    """The tree search with the rows of an interval; a relaxation that stalls is branched on.

    Parameters
    ----------
    system : IntervalSystem
    certifier : Certifier
    limits : SearchLimits
    """

    def __init__(self, system: IntervalSystem, certifier: Certifier, limits: SearchLimits) -> None:
        splitting = IntervalSplitting(system)
        super().__init__(system.scaled, certifier, engine=IntervalEngine(system), splitting=splitting, limits=limits)

    def _fall_back(self, codes: Codes) -> None:
        """No other engine handles intervals: the partial assignment is branched on."""
        del codes


class IntervalSearch:
    """The search over the whole interval.

    Parameters
    ----------
    condensed : CondensedProblem
    interval : (Fraction, Fraction)
    origin : Fraction or None
        The alpha at which g vanishes.
    leaves : IntervalCertifier
    max_nodes : int or None
        Stop after so many nodes of all trees.
    deadline : time.perf_counter() value or None
    progress : called with the share of the interval that is done

    Attributes
    ----------
    interval : (Fraction, Fraction)
    pieces : list of SearchedPiece
    nodes : int
    stopped : Stop or None
    selections : set of codes
        All complete selections that the trees could not exclude.
    """

    def __init__(
        self,
        condensed: CondensedProblem,
        interval: tuple[Fraction, Fraction],
        origin: Fraction | None,
        leaves: IntervalCertifier,
        *,
        max_nodes: int | None = None,
        deadline: float | None = None,
        progress: Callable[[float], object] | None = None,
    ) -> None:
        self._condensed, self._origin, self._leaves = condensed, origin, leaves
        self.interval = interval
        self._max_nodes, self._deadline, self._progress = max_nodes, deadline, progress
        self.pieces: list[SearchedPiece] = []
        self.nodes = 0
        self.stopped: Stop | None = None
        self.selections: set[Codes] = set()

    def run(self) -> None:
        """Search all pieces, cutting those whose trees grow too large."""
        a, b = self.interval
        ends = [a, b]
        if self._origin is not None and a < self._origin < b:
            ends.insert(1, self._origin)
        everything = [(UNDECIDED,) * len(self._condensed.F0)]
        waiting = deque((Piece(x, y), everything) for x, y in itertools.pairwise(ends))
        while waiting:
            piece, roots = waiting.popleft()
            found = self._search(piece, roots)
            self.pieces.append(found)
            self.selections.update(found.selections)
            if self.stopped is not None:
                return
            if found.cut:
                halves = (Piece(piece.middle, piece.b), Piece(piece.a, piece.middle))
                waiting.extendleft((half, found.cut) for half in halves)
            elif self._progress is not None:
                self._progress(float((piece.b - a) / (b - a)))

    def _search(self, piece: Piece, roots: list[Codes]) -> SearchedPiece:
        """The trees over a piece; what is left over when cutting it is better, or a limit is reached, is in ``cut``."""
        system = self._system(piece)
        found = SearchedPiece(piece, system, roots)
        certifier = _Collector(found, self._leaves, self.selections)
        whole = float(piece.b - piece.a) <= SMALLEST_PIECE * float(self.interval[1] - self.interval[0])
        limit: int | None = None if whole else NODES_PER_CONTACT * (system.p + 2)
        spent, left = 0, roots
        while True:
            allowed = None if limit is None else max(limit - spent, 1)
            if self._max_nodes is not None:
                rest = max(self._max_nodes - self.nodes, 1)
                allowed = rest if allowed is None else min(allowed, rest)
            enough = None if whole else (lambda _: certifier.new > NEW_SELECTIONS)
            outcome = IntervalTreeSearch(system, certifier, SearchLimits(enough, allowed, self._deadline)).run(left)
            self.nodes += outcome.nodes
            spent += outcome.nodes
            if outcome.stopped is None:
                return found
            left = [item.codes for item in outcome.undecided]
            if self._must_stop():
                found.cut = left
                return found
            if certifier.new > NEW_SELECTIONS:
                found.cut = left + [codes for codes in found.selections if codes not in self.selections]
                found.selections = [codes for codes in found.selections if codes in self.selections]
                return found
            assert limit is not None
            raised = WORTH_CUTTING * self._size_at(piece.middle)
            if raised <= spent:
                found.cut = left
                return found
            limit = raised

    def _must_stop(self) -> bool:
        if self._max_nodes is not None and self.nodes >= self._max_nodes:
            self.stopped = Stop(StopReason.NODE_LIMIT, self._max_nodes)
        elif self._deadline is not None and time.perf_counter() > self._deadline:
            self.stopped = Stop(StopReason.TIME_LIMIT)
        return self.stopped is not None

    def _system(self, piece: Piece) -> IntervalSystem:
        origin = self._origin if self._origin in (piece.a, piece.b) else None
        return IntervalSystem.from_problem(self._condensed, piece.a, piece.b, origin)

    def _size_at(self, alpha: Fraction) -> int:
        """Nodes of the tree at one alpha."""
        piece = Piece(alpha, alpha)
        system = self._system(piece)
        certifier = _SizeOnly(SearchedPiece(piece, system, []), self._leaves, set())
        limits = SearchLimits(max_nodes=self._max_nodes, deadline=self._deadline)
        outcome = IntervalTreeSearch(system, certifier, limits).run()
        self.nodes += outcome.nodes
        return outcome.nodes
