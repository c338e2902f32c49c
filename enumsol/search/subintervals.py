"""Which selections may hold somewhere in an interval of alpha: the tree search on pieces of it (theory, section 7.8).

A piece is a subinterval. It is searched by trees whose leaves cover all selections: a leaf is proven empty on the whole
piece, or it is a complete selection that survives, or it is left to both halves of the piece. What was proven for the
whole piece is proven for its halves, too.
"""

from __future__ import annotations

import itertools
import pickle
import time
from dataclasses import dataclass, field
from fractions import Fraction
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from enumsol.model.statuses import UNDECIDED
from enumsol.relaxation.active_set import IntervalSystem
from enumsol.search.interval_tree import LARGEST_TREE, EmptyLeaf, SubintervalTree, Subtree, TreeResult
from enumsol.search.outcome import Stop, StopReason
from enumsol.search.setup import WEAK
from enumsol.support.workers import Crew, Job, kept_in_thread
from enumsol.trusted.over_interval import PieceNumbers

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from concurrent.futures import Executor

    from enumsol.condensation.condensed import CondensedProblem
    from enumsol.model.problem import ContactProblem
    from enumsol.proof.leaves import Excluded, OnlyReference, Unbalanced
    from enumsol.support.array_types import Codes, Floats


#: Pieces are not cut below this part of the interval.
SMALLEST_PIECE = 2.0**-40
#: Trees are given up over pieces longer than this part of the interval, which only have to be cut, where friction
#: varies: a block with p = 64 takes a quarter of the nodes then, and under a varying load 1.6 times as many.
LONG_PIECE = 2.0**-9


@dataclass(frozen=True)
class Piece:
    """A closed part [a, b] of the interval of alpha; exact, since its ends are floats or halves of them."""

    a: Fraction
    b: Fraction

    @property
    def middle(self) -> Fraction:
        """(a + b) / 2."""
        return (self.a + self.b) / 2


@dataclass
class SearchedPiece:
    """Result of the trees over one piece: together the leaves cover all selections below ``roots``.

    Attributes
    ----------
    piece : Piece
    system : IntervalSystem or None
        None where there was no tree.
    roots : list of codes
        Partial assignments whose subtrees were searched.
    empty : list of EmptyLeaf
        Leaves proven empty on the whole piece.
    selections : list of codes
        Complete selections that survive: they may hold somewhere in the piece.
    cut : list of codes
        Subtrees that both halves of the piece take over as their roots; or that a search stopped early left.
    closed : ClosedPiece or None
        Why the arcs of its selections hold all solutions: no tree was searched (theory, sections 7.15 and 14.16).
    """

    piece: Piece
    system: IntervalSystem | None
    roots: list[Codes]
    empty: list[EmptyLeaf] = field(default_factory=list)
    selections: list[Codes] = field(default_factory=list)
    cut: list[Codes] = field(default_factory=list)
    closed: ClosedPiece | None = None


@dataclass(frozen=True)
class ClosedPiece:
    """A piece of which all solutions lie on the arcs of some selections.

    Attributes
    ----------
    numbers : PieceNumbers
    selections : sequence of codes
    leaves : sequence of (codes, record)
        Of a body that nothing holds, assignments that cover all, below which there is nothing else.
    bounded : bool
        That rests on the bound of its rigid displacement.
    """

    numbers: PieceNumbers
    selections: Sequence[Codes]
    leaves: Sequence[tuple[Codes, OnlyReference | Unbalanced | Excluded]] = ()
    bounded: bool = False


class IntervalCertifier:
    """Decides whether multipliers prove a leaf empty on the whole piece; here in floats, which accept all prunings.

    Those of other arithmetics are derived from it.
    """

    #: Whether leaves may be excluded by forms other than the energy.
    forms: bool = False
    #: Whether rationals decide what is left open, so that floats only propose.
    rational: bool = False
    #: Whether a checker can repeat what was accepted so far, so that it makes a proof.
    checkable: bool = False

    def excluded(self, piece: Piece, system: IntervalSystem, leaf: EmptyLeaf) -> bool:
        """True if the dual bounds at both ends of the piece are positive."""
        return True

    def convex(self, piece: Piece, system: IntervalSystem, form: Floats) -> bool:
        """True if the form of these multipliers is proven convex on the piece."""
        return False

    def needs_bound(self, piece: Piece, system: IntervalSystem, leaf: EmptyLeaf) -> bool:
        """True unless a leaf is excluded without a bound of the rigid displacement."""
        return True


@dataclass(frozen=True)
class Task:
    """One tree: its result depends on nothing but this and the problem.

    Attributes
    ----------
    piece : Piece
    roots : tuple of Subtree
    """

    piece: Piece
    roots: tuple[Subtree, ...]

    def further(self, result: TreeResult) -> list[Task]:
        """The trees over the same piece for what this one did not examine."""
        # eight trees, which workers share
        size = -(-len(result.rest) // 8) or 1
        return [Task(self.piece, tuple(result.rest[k : k + size])) for k in range(0, len(result.rest), size)]

    @staticmethod
    def halves(piece: Piece, cut: Sequence[Subtree]) -> list[Task]:
        """Both halves of a piece with what its trees left to them; none if that is nothing."""
        ends = (piece.a, piece.middle, piece.b)
        return [Task(Piece(*half), tuple(cut)) for half in itertools.pairwise(ends)] if cut else []


class IntervalWorker:
    """Searches trees over pieces of an interval.

    Parameters
    ----------
    condensed : CondensedProblem
    interval : (Fraction, Fraction)
    origin : Fraction or None
        The alpha at which g vanishes.
    leaves : IntervalCertifier
    """

    def __init__(
        self,
        condensed: CondensedProblem,
        interval: tuple[Fraction, Fraction],
        origin: Fraction | None,
        leaves: IntervalCertifier,
    ) -> None:
        self._condensed, self._origin, self.leaves = condensed, origin, leaves
        self._length = float(interval[1] - interval[0])
        self._trees: tuple[Piece, IntervalSystem, SubintervalTree] | None = None

    def run(self, task: Task, max_nodes: int | None = None, deadline: float | None = None) -> TreeResult:
        """Search the tree of a task."""
        trees = self._on(task.piece)[2]
        result = trees.run(task.roots, LARGEST_TREE if max_nodes is None else min(LARGEST_TREE, max_nodes), deadline)
        result.checkable = self.leaves.checkable
        return result

    def system(self, piece: Piece) -> IntervalSystem:
        """The system of a piece."""
        return self._on(piece)[1]

    def _on(self, piece: Piece) -> tuple[Piece, IntervalSystem, SubintervalTree]:
        if self._trees is None or self._trees[0] != piece:
            system, middle = self._make(piece), None
            share = float(piece.b - piece.a) / self._length
            if share > SMALLEST_PIECE:
                middle = self._make(Piece(piece.middle, piece.middle))
            convex = partial(self.leaves.convex, piece, system) if self.leaves.forms else None
            long = share > LONG_PIECE and bool(np.any(system.F_lo != system.F))
            trees = SubintervalTree(system, middle, partial(self.leaves.excluded, piece, system), convex, long=long)
            self._trees = (piece, system, trees)
        return self._trees

    def _make(self, piece: Piece) -> IntervalSystem:
        origin = self._origin if self._origin in (piece.a, piece.b) else None
        ends = piece.a, piece.b
        return IntervalSystem.from_problem(self._condensed, *ends, origin, proposals=self.leaves.rational)


def whole_pieces(a: Fraction, b: Fraction, origin: Fraction | None) -> list[Piece]:
    """The interval, or its parts on both sides of the alpha at which g vanishes."""
    ends = [a, origin, b] if origin is not None and a < origin < b else [a, b]
    return [Piece(x, y) for x, y in itertools.pairwise(ends)]


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
    worker : IntervalWorker
    pieces : list of SearchedPiece
        In the order of their trees: the halves come directly after what was cut.
    nodes : int
    stopped : Stop or None
    selections : set of codes
        All complete selections that the trees could not exclude.
    closed : mapping of Piece to ClosedPiece
        Pieces that need no tree.
    checkable : bool
        Whether a checker can repeat what was excluded.
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
        self.worker = IntervalWorker(condensed, interval, origin, leaves)
        self._p, self._origin = len(condensed.F0), origin
        self.interval, self.progress = interval, progress
        self.max_nodes, self.deadline = max_nodes, deadline
        self.pieces: list[SearchedPiece] = []
        self.nodes = 0
        self.stopped: Stop | None = None
        self.selections: set[Codes] = set()
        self.closed: Mapping[Piece, ClosedPiece] = {}
        self.checkable = leaves.checkable

    def first(self) -> list[Task]:
        """The whole tree over the whole interval, or over both sides of the alpha at which g vanishes."""
        everything = (Subtree((UNDECIDED,) * self._p),)
        return [Task(piece, everything) for piece in whole_pieces(*self.interval, self._origin)]

    def in_halves(self, task: Task) -> list[Task]:
        """Both halves at once, where a part of the piece needs no tree."""
        a, b = task.piece.a, task.piece.b
        inside = any(a <= piece.a and piece.b <= b for piece in self.closed if piece != task.piece)
        return Task.halves(task.piece, task.roots) if inside else []

    def share(self, piece: Piece) -> Fraction:
        """The part of the interval that a piece is."""
        return (piece.b - piece.a) / (self.interval[1] - self.interval[0])

    def run(self, known: Mapping[Task, TreeResult] | None = None) -> None:
        """Search all pieces; ``known`` holds the results of tasks that were searched elsewhere.

        With ``stopped`` set before, nothing but these results counts.
        """
        known = {} if known is None else known
        go_on = self.stopped is not None
        waiting = self.first()[::-1]
        while waiting:
            task = waiting.pop()
            found = SearchedPiece(task.piece, None, [root.codes for root in task.roots])
            self.pieces.append(found)
            halves = self.in_halves(task)
            if task.piece in self.closed:
                found.closed = self.closed[task.piece]
                found.selections[:] = found.closed.selections
                if len(found.closed.leaves):
                    found.system = self.worker.system(task.piece)
                self.selections.update(found.selections)
                cut = []
            elif halves:
                cut = list(task.roots)
            else:
                found.system = self.worker.system(task.piece)
                cut = self._search(task, found, known)
            if self.stopped is not None and found.cut:
                if not go_on:
                    return
                continue
            found.cut = [subtree.codes for subtree in cut]
            waiting += Task.halves(task.piece, cut)[::-1]
            if not cut and not known and self.progress is not None:
                a, b = self.interval
                self.progress(float((task.piece.b - a) / (b - a)))

    def _search(self, first: Task, found: SearchedPiece, known: Mapping[Task, TreeResult]) -> list[Subtree]:
        """All trees over a piece; gives what they leave to its halves. A limit leaves the rest in ``found.cut``."""
        waiting, cut = [first], list[Subtree]()
        while waiting:
            task = waiting.pop()
            result = self._result(task, known.get(task))
            if result is None:
                left = [*cut, *(root for other in [task, *waiting[::-1]] for root in other.roots)]
                found.cut = [subtree.codes for subtree in left]
                return []
            self.nodes += result.nodes
            self.checkable = self.checkable and result.checkable
            found.empty += result.empty
            found.selections += result.selections
            self.selections.update(result.selections)
            cut += result.cut
            waiting += task.further(result)[::-1]
        return cut

    def _result(self, task: Task, known: TreeResult | None) -> TreeResult | None:
        """The result of the tree of a task; None once a limit is reached."""
        rest = None if self.max_nodes is None else self.max_nodes - self.nodes
        # near the limit a tree is smaller than it was without it
        if known is not None and (rest is None or rest >= LARGEST_TREE):
            return known
        if self.stopped is None and rest is not None and rest <= 0:
            self.stopped = Stop(StopReason.NODE_LIMIT, self.max_nodes)
        elif self.stopped is None and self.deadline is not None and time.perf_counter() > self.deadline:
            self.stopped = Stop(StopReason.TIME_LIMIT)
        return None if self.stopped is not None else self.worker.run(task, rest, self.deadline)


def run_parallel(executor: Executor, search: IntervalSearch) -> None:
    """Run a search with the help of an executor: the same result, whatever their number and timing.

    Raises
    ------
    KeyboardInterrupt, MemoryError
        The search then holds what was found by then.
    """
    ahead = _Ahead(executor, search)
    try:
        ahead.run()
    except (KeyboardInterrupt, MemoryError) as error:
        search.stopped = Stop(StopReason.of(type(error)), ahead.nodes)
        search.run(ahead.known)
        raise
    finally:
        ahead.cancel()
    search.run(ahead.known)


class _Ahead:
    """The trees that are searched ahead.

    Attributes
    ----------
    known : dict
        Results of tasks.
    nodes : int
        Of all these.
    """

    def __init__(self, executor: Executor, search: IntervalSearch) -> None:
        self.known: dict[Task, TreeResult] = {}
        self.nodes = 0
        self._crew, self._search = Crew(executor), search
        self._worker = pickle.dumps(search.worker)
        self._tasks: dict[Job, Task] = {}
        #: of every piece its first tree, and the number of its trees that are not finished
        self._first: dict[Piece, Task] = {}
        self._waiting: dict[Piece, int] = {}
        self._share = Fraction(0)

    def run(self) -> None:
        """Search all trees, until a limit is reached."""
        search = self._search
        for task in search.first():
            self._begin(task)
        while self._tasks:
            job = self._crew.next(self._seconds())
            if job is None or not job.result.nodes:
                # there is no time left, here or for the worker
                search.stopped = Stop(StopReason.TIME_LIMIT)
                return
            self._take(self._tasks.pop(job), job.result)
            if search.max_nodes is not None and self.nodes >= search.max_nodes:
                return

    def _seconds(self) -> float | None:
        """Until the deadline."""
        deadline = self._search.deadline
        return None if deadline is None else max(deadline - time.perf_counter(), 0.0)

    def _begin(self, task: Task) -> None:
        """Hand out the first tree over a piece, or those of its halves where a part of it needs no tree."""
        if task.piece in self._search.closed:
            self._share += self._search.share(task.piece)
        elif halves := self._search.in_halves(task):
            for half in halves:
                self._begin(half)
        else:
            self._first[task.piece], self._waiting[task.piece] = task, 1
            self._hand_out(task)

    def _hand_out(self, task: Task) -> None:
        self._tasks[self._crew.submit(_search_tree, self._worker, task, self._seconds())] = task

    def _take(self, task: Task, result: TreeResult) -> None:
        """Keep a result, and hand out the trees that follow from it."""
        piece, further = task.piece, task.further(result)
        self.known[task] = result
        self.nodes += result.nodes
        self._waiting[piece] += len(further) - 1
        for another in further:
            self._hand_out(another)
        if self._waiting[piece]:
            return
        halves = Task.halves(piece, self._cut(piece))
        for half in halves:
            self._begin(half)
        if not halves and self._search.progress is not None:
            self._share += self._search.share(piece)
            self._search.progress(float(self._share))

    def _cut(self, piece: Piece) -> list[Subtree]:
        """Subtrees that a piece leaves to its halves, in the order in which a search without workers finds them."""
        cut: list[Subtree] = []
        waiting = [self._first[piece]]
        while waiting:
            task = waiting.pop()
            cut += self.known[task].cut
            waiting += task.further(self.known[task])[::-1]
        return cut

    def cancel(self) -> None:
        """Cancel what has not begun."""
        self._crew.cancel()


def _search_tree(packed: bytes, task: Task, seconds: float | None) -> TreeResult:
    """Search one tree, in a worker; every thread has a searcher of its own, and keeps it for the next tree."""
    worker: IntervalWorker = kept_in_thread(packed, packed)
    return worker.run(task, deadline=None if seconds is None else time.perf_counter() + seconds)


def on_weak_springs(problem: ContactProblem) -> CondensedProblem:
    """The body on weak springs at the degrees of freedom where springs hold it, which relaxations are about."""
    modes = problem.modes
    if modes.r == 0:
        raise AssertionError("the body is held")
    condensed: CondensedProblem = problem.on_springs.replace(A=problem.A + WEAK * modes.springs()).condensed
    return condensed
