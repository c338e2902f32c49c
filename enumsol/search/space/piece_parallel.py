"""The tree over alpha searched by the workers of a concurrent.futures executor, put together in the tree's order.

A task is a part of the tree with the curves that are known. It depends on nothing else, ends after a number of nodes,
and gives back the subtrees that it did not reach, which are new tasks. Where it would look for another curve it ends as
well: that is done by the calling process when the walk through the tree comes to it, and what lies behind is searched
again if a curve was found. So curves and proof depend neither on timing nor on the number of workers.
"""

from __future__ import annotations

import hashlib
import heapq
import pickle
import threading
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from enumsol.search.outcome import StopReason
from enumsol.search.space.piece_tree import PieceTree
from enumsol.support.deadlines import Deadline, TimeOverError, current, within
from enumsol.support.workers import Crew, Job
from enumsol.trusted.space.curve_runs import KnownCurve
from enumsol.trusted.space.solution_curve import AlphaProblem

if TYPE_CHECKING:
    from collections.abc import Sequence
    from concurrent.futures import Executor

    from enumsol.search.space.piece_tree import Known, Waiting

#: Nodes of a task.
NODES = 16
#: Of the subtrees that a task gives back, so many become tasks of their own: those nearest to the root of the tree.
ALONE = 4


class CurveWantedError(Exception):
    """A tree whose curves are given would look for another one."""


class FixedTree(PieceTree):
    """A tree whose curves are given; where it would look for another one, it raises CurveWantedError.

    Parameters
    ----------
    known : Known
    curves : sequence of KnownCurve
        Those of its chains.
    """

    def __init__(self, known: Known, curves: Sequence[KnownCurve]) -> None:
        enclosure, interval, units, smallest = known.problem
        super().__init__(enclosure, interval, units, smallest=smallest)
        self._sampled, self._sought, self._final = known.sampled, known.sought, known.final
        for curve in curves:
            self._take(curve)

    def _follow(self, x: Any) -> bool:
        if self._final or self._is_known(x):
            return False
        raise CurveWantedError

    def _sample(self) -> bool:
        raise CurveWantedError

    def _seek(self, at: Any) -> bool:
        raise CurveWantedError


@dataclass(frozen=True)
class _Answer:
    """What a task came to.

    Attributes
    ----------
    records : those of the nodes that were examined
    nodes : int
    covered : the share of the tree that is done
    rest : the subtrees that are left, the first one last
    wanted : whether the first of these is to look for a curve
    """

    records: list[Any]
    nodes: int
    covered: float
    rest: list[Waiting]
    wanted: bool


@dataclass(eq=False)
class _Part:
    """A part of the tree: subtrees that follow on each other, the first one last.

    Attributes
    ----------
    place : where it is in the tree, for an order
    roots : sequence of Waiting
    wanted : whether the first of them is to look for a curve
    """

    place: tuple[int, ...]
    roots: Sequence[Waiting]
    wanted: bool = False
    answer: _Answer | None = None
    further: Sequence[_Part] = ()

    def __lt__(self, other: _Part) -> bool:
        return self.place < other.place


def spread_over(executor: Executor, tree: PieceTree, waiting: list[Waiting]) -> None:
    """Examine what waits with the help of an executor, as ``PieceTree.examined`` does without; see there."""
    spread = _Spread(executor, tree)
    try:
        spread.run(waiting)
    finally:
        spread.cancel()


class _Spread:
    """See ``spread_over``."""

    def __init__(self, executor: Executor, tree: PieceTree) -> None:
        self._crew, self._tree = Crew(executor), tree
        self._use(tree.known())
        self._heap: list[_Part] = []
        self._out: dict[Job, _Part] = {}

    def _use(self, known: Known) -> None:
        """Have workers know these curves."""
        self._known, self._data, self._told = known, pickle.dumps(known), False
        self._key = hashlib.sha256(self._data).digest()

    def run(self, waiting: list[Waiting]) -> None:
        """Examine what waits; what no worker has examined when a limit is reached is open."""
        stack = self._parts((), [_sent(item) for item in waiting])[::-1]
        try:
            waiting.clear()
            self._hand_out(stack)
            while stack and self._tree.stopped is None:
                self._next(stack)
        finally:
            self._leave(stack)

    def cancel(self) -> None:
        """Cancel what has not begun."""
        self._crew.cancel()
        self._out.clear()
        self._heap.clear()

    def _next(self, stack: list[_Part]) -> None:
        """Take the next part of the tree."""
        tree, part, left = self._tree, stack[-1], self._tree.left
        if left == 0:
            tree.stopped = StopReason.NODE_LIMIT
        elif part.wanted:
            self._look_for_curve(stack)
        else:
            try:
                answer = self._answer(part)
            except TimeOverError:
                tree.stopped = StopReason.TIME_LIMIT
                return
            if left is not None and answer.nodes > left:
                # the last part before the limit is shorter
                part.answer = answer = _examined(FixedTree(self._known, tree.curves), part.roots, left)
                part.further = [_Part(part.place, answer.rest)]
            self._take(stack)

    def _look_for_curve(self, stack: list[_Part]) -> None:
        """Examine here the node that may need another curve, and search again what was searched without it."""
        tree, part = self._tree, stack[-1]
        waiting = list(part.roots)
        tree.examined(waiting, 1)
        if tree.stopped is not None:
            return
        parts = self._parts(part.place, [_sent(item) for item in waiting])
        stack[-1:] = parts[::-1]
        known = tree.known()
        if known.state == self._known.state:
            self._hand_out(parts)
            return
        self.cancel()
        self._use(known)
        for other in stack:
            other.answer, other.further, other.wanted = None, (), False
        self._hand_out(stack)

    def _take(self, stack: list[_Part]) -> None:
        """Take the answer of the next part, in whose place are the parts that follow from it."""
        answer = stack[-1].answer
        assert answer is not None
        # whenever somebody interrupts, what is not on the stack is in the records
        self._tree.records += answer.records
        self._tree.nodes += answer.nodes
        stack[-1:] = stack[-1].further[::-1]
        self._tree.report(answer.covered)

    def _leave(self, stack: list[_Part]) -> None:
        """What is left after a limit is open, but for parts that are there when the time is over."""
        timely = self._tree.stopped is StopReason.TIME_LIMIT
        while stack:
            if timely and stack[-1].answer is not None:
                self._take(stack)
            else:
                self._tree.leave(stack[-1].roots)
                stack.pop()

    def _parts(self, place: tuple[int, ...], roots: list[Waiting], *, wanted: bool = False) -> list[_Part]:
        """In the order of the tree; of the subtrees the last ones are near its root, and so large."""
        first = [roots.pop()] if wanted else []
        groups = [[root] for root in roots[:ALONE][::-1]]
        if roots[ALONE:]:
            groups.insert(0, roots[ALONE:])
        found = [_Part((*place, k + 1), group) for k, group in enumerate(groups)]
        return [_Part((*place, 0), first, wanted=True), *found] if wanted else found

    def _hand_out(self, parts: Sequence[_Part]) -> None:
        """Hand out parts, those that come first in the tree before others, as many as keep the workers busy."""
        for part in parts:
            if not part.wanted:
                heapq.heappush(self._heap, part)
        while self._heap and self._crew.room > 0:
            self._send(heapq.heappop(self._heap))

    def _send(self, part: _Part, *, whole: bool = False) -> None:
        """Hand out a part; ``whole``: with all that a worker needs, which may be much."""
        deadline = current()
        seconds = None if deadline is None else deadline - time.perf_counter()
        data = self._data if whole or not self._told else None
        self._out[self._crew.submit(_search_part, self._key, data, part.roots, seconds)] = part

    def _answer(self, part: _Part) -> _Answer:
        """Wait for the answer of a part.

        Raises
        ------
        TimeOverError
            The time is over before it is there.
        """
        while part.answer is None:
            deadline = current()
            job = self._crew.next(None if deadline is None else max(deadline - time.perf_counter(), 0.0))
            if job is None:
                raise TimeOverError
            done = self._out.pop(job)
            if job.result is None:
                self._send(done, whole=True)  # it went to a worker that had nothing yet
                continue
            self._told, done.answer = True, job.result
            done.further = self._parts(done.place, list(job.result.rest), wanted=job.result.wanted)
            self._hand_out(done.further)
        if not part.answer.records and not part.answer.wanted:
            raise TimeOverError  # it was over for the worker
        return part.answer


def _sent(item: Waiting) -> Waiting:
    """A subtree as a task begins with it: without what is known from above."""
    (low, high, codes, _, _, _, cuts), share = item
    return (low, high, codes, None, -1, False, cuts), share


_local = threading.local()


def _search_part(key: bytes, data: bytes | None, roots: Sequence[Waiting], seconds: float | None) -> _Answer | None:
    """Search a part, in a worker; every thread makes what it needs once. None where it was not given that yet."""
    if getattr(_local, "key", None) != key:
        if data is None:
            return None
        known: Known = pickle.loads(data)
        given = AlphaProblem.of(known.problem[0])
        _local.known, _local.curves = known, [KnownCurve(given, chain) for chain in known.chains]
        _local.key = key
    with within(Deadline.after(time.perf_counter(), seconds)):
        return _examined(FixedTree(_local.known, _local.curves), roots, NODES)


def _examined(tree: FixedTree, roots: Sequence[Waiting], most: int) -> _Answer:
    """Examine so many nodes."""
    waiting, wanted = list(roots), False
    try:
        tree.examined(waiting, most)
    except CurveWantedError:
        wanted = True
    return _Answer(tree.records, tree.nodes, tree.covered, [_sent(item) for item in waiting], wanted)
