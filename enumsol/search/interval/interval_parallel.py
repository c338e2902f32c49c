"""The trees of a search over an interval run by a concurrent.futures executor.

The result of a tree depends on its task alone. So the trees are searched ahead in whatever order the workers take them,
and the search then goes through its pieces as it does without workers, with their results at hand.
"""

from __future__ import annotations

import pickle
import threading
import time
from fractions import Fraction
from typing import TYPE_CHECKING

from enumsol.search.interval.subintervals import IntervalSearch, Piece, Task, Worker
from enumsol.search.outcome import Stop, StopReason
from enumsol.support.workers import Crew, Job

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from enumsol.search.interval.interval_tree import Subtree, TreeResult


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
        a, b = search.interval
        self._share = sum((piece.b - piece.a for piece in search.closed), Fraction(0)) / (b - a)
        for task in search.trees():
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
        """Hand out the first tree over a piece."""
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
            a, b = self._search.interval
            self._share += (piece.b - piece.a) / (b - a)
            self._search.progress(float(self._share))

    def _cut(self, piece: Piece) -> list[Subtree]:
        """What the trees over a piece leave to its halves, in the order in which a search without workers finds it."""
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


_local = threading.local()


def _search_tree(packed: bytes, task: Task, seconds: float | None) -> TreeResult:
    """Search one tree, in a worker; every thread has a searcher of its own, and keeps it for the next tree."""
    if getattr(_local, "packed", None) != packed:
        _local.worker, _local.packed = pickle.loads(packed), packed
    worker: Worker = _local.worker
    return worker.run(task, deadline=None if seconds is None else time.perf_counter() + seconds)
