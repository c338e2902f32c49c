"""A tree searched by the workers of a concurrent.futures executor, its parts taken in the tree's order.

A task is a part of the tree. It ends after a number of nodes and gives back the subtrees that it did not reach, which
are new tasks: so no part is long, however uneven the tree. What a task gives back depends on it alone, and results are
taken in the order of the tree: they depend neither on timing nor on the number of workers.
"""

from __future__ import annotations

import hashlib
import heapq
import pickle
import time
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

from enumsol.search.outcome import StopReason
from enumsol.support.deadlines import Deadline, within
from enumsol.support.workers import Crew, Job, kept_in_thread

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence
    from concurrent.futures import Executor

    #: Examines so many nodes of a part, in a worker; it is sent there once and used for many tasks.
    Worker = Callable[[Sequence[Any], int], "Answer"]

#: Of the subtrees that a task gives back, so many become tasks of their own: those nearest to the root of the tree.
ALONE = 4
#: Tasks that follow on others examine twice as many nodes as these, up to so many times.
DOUBLED = 3


@dataclass(frozen=True)
class Answer:
    """Result of a task.

    Attributes
    ----------
    found : what the tree takes in
    nodes : int
        Nodes that were examined.
    covered : float
        The share of the tree that is done.
    rest : list
        The subtrees that are left, the first one last.
    wanted : bool
        The first of these is to be examined by the calling process.
    """

    found: Any
    nodes: int
    covered: float
    rest: list[Any]
    wanted: bool = False


@dataclass(order=True)
class TreePart:
    """A part of the tree: subtrees that follow on each other, the first one last.

    Attributes
    ----------
    place : where it is in the tree, for an order
    roots : sequence
    answer : Answer or None
    here : bool
        The calling process is to examine it.
    """

    place: tuple[int, ...]
    roots: Sequence[Any] = field(compare=False)
    answer: Answer | None = field(default=None, compare=False)
    here: bool = field(default=False, compare=False)
    #: The parts that are left once there is an answer.
    further: Sequence[TreePart] = field(default=(), compare=False)


class SharedTree(Protocol):
    """A tree that takes in what workers made of its parts; subtrees are in lists, the first one last."""

    @property
    def left(self) -> int | None:
        """Number of nodes that may still be examined; None for any number."""

    @property
    def stopped(self) -> StopReason | None:
        """Reason for an early end."""

    def must_stop(self) -> bool:
        """Look at the limits."""

    def stop_for_time(self) -> None:
        """Take note that the time is over."""

    def examined(self, items: Sequence[Any], nodes: int) -> list[Any]:
        """Examine so many nodes of subtrees; gives those that still wait then, or when the time is over."""

    def take(self, answer: Answer) -> None:
        """Take in what a worker found."""

    def report(self, share: float) -> None:
        """Tell that so much more of the tree is done."""

    def leave(self, items: Sequence[Any]) -> None:
        """Leave subtrees unexamined."""


class Spread(ABC):
    """Searches a tree with the help of an executor.

    Parameters
    ----------
    executor : Executor
    tree : SharedTree
        Takes in parts as they come, so that an interruption keeps those that did.
    nodes : int
        Nodes of a task.
    remaining : callable
        Gives the seconds that are left, or None.
    """

    def __init__(self, executor: Executor, tree: SharedTree, nodes: int, remaining: Callable[[], float | None]) -> None:
        self._crew, self._tree, self._nodes, self._remaining = Crew(executor), tree, nodes, remaining
        #: The worker's data and key, and whether a worker has it: it is sent along until then.
        self._data, self._key, self._known = b"", b"", False
        self._waiting: list[TreePart] = []
        self._out: dict[Job, TreePart] = {}

    @abstractmethod
    def _worker(self) -> Worker:
        """The object that is sent to workers."""

    @abstractmethod
    def _is_current(self, *, afresh: bool) -> bool:
        """True if workers have what they need; ``afresh``: the search begins with other subtrees."""

    def _examine(self, stack: list[TreePart], until: Callable[[], bool] | None = None) -> bool:
        """Examine what waits; True if it is time to stop although no limit is reached."""
        while stack:
            if until is not None and until():
                return True
            if self._tree.must_stop():
                break
            self._next(stack)
        return False

    def _next(self, stack: list[TreePart]) -> None:
        """Take the next part of the tree."""
        tree, part, left = self._tree, stack[-1], self._tree.left
        if part.here:
            self._examine_here(stack)
        elif not self._answered(part) or part.answer is None or not (part.answer.nodes or part.answer.wanted):
            # the time is over, or was so for the worker
            tree.stop_for_time()
        elif left is not None and part.answer.nodes > left:
            # the last part before the limit is shorter
            parts = self._parts(part.place, tree.examined(part.roots, left))
            stack[-1:] = parts[::-1]
            if tree.left:
                self._hand_out(parts)
        else:
            self._take(stack, part.answer)

    def _examine_here(self, stack: list[TreePart]) -> None:
        """Examine one node; what was searched without that which is found there is searched again."""
        rest = self._tree.examined(stack[-1].roots, 1)
        if rest == list(stack[-1].roots):
            return  # for a limit, or for what is to be found first
        parts = self._parts(stack[-1].place, rest)
        stack[-1:] = parts[::-1]
        if self._is_current(afresh=False):
            self._hand_out(parts)
            return
        self._renew()
        for other in stack:
            other.answer, other.here, other.further = None, False, ()
        self._hand_out(stack)

    def _take(self, stack: list[TreePart], answer: Answer) -> None:
        """Take in the answer of the next part, in whose place are the parts that follow from it."""
        # whenever somebody interrupts, what is not on the stack was taken in
        self._tree.take(answer)
        stack[-1:] = stack[-1].further[::-1]
        self._tree.report(answer.covered)

    def _leave(self, stack: list[TreePart]) -> None:
        """Leave what no limit allows, but for parts that are there when the time is over or somebody interrupts."""
        kept = self._tree.stopped in (None, StopReason.TIME_LIMIT)
        while stack:
            answer = stack[-1].answer
            if kept and answer is not None and not stack[-1].here:
                self._take(stack, answer)
            else:
                self._tree.leave(stack.pop().roots)
        self.cancel()

    # -- tasks -----------------------------------------------------------------------------------------------------

    def _begin(self, items: Iterable[Any]) -> list[TreePart]:
        """Hand out subtrees; gives the parts that they form, the first one last."""
        parts = self._parts((), items)
        self._hand_out(parts)
        return parts[::-1]

    def _renew(self) -> None:
        """Drop what was handed out, and have workers make what they need anew."""
        self.cancel()
        self._data = pickle.dumps(self._worker())
        self._key, self._known = hashlib.sha256(self._data).digest(), False

    def cancel(self) -> None:
        """Cancel what has not begun."""
        self._crew.cancel()
        self._out.clear()
        self._waiting.clear()

    @staticmethod
    def _parts(place: tuple[int, ...], items: Iterable[Any]) -> list[TreePart]:
        """Parts in the order of the tree; of the subtrees the last ones are near its root, and so large."""
        roots = [item.sent() for item in items]
        groups: list[Sequence[Any]] = [[root] for root in roots[:ALONE][::-1]]
        if roots[ALONE:]:
            groups.insert(0, roots[ALONE:])
        return [TreePart((*place, k), group) for k, group in enumerate(groups)]

    def further(self, part: TreePart, answer: Answer) -> list[TreePart]:
        """The parts that an answer leaves; the root that is to be examined here is one of its own."""
        if not answer.wanted:
            return self._parts(part.place, answer.rest)
        wanted = TreePart((*part.place, -1), answer.rest[-1:], here=True)
        return [wanted, *self._parts(part.place, answer.rest[:-1])]

    def _hand_out(self, parts: Sequence[TreePart]) -> None:
        """Keep the workers busy with what has no answer yet and comes first in the tree."""
        for part in parts:
            if part.answer is None and not part.here:
                heapq.heappush(self._waiting, part)
        # one task for each worker carries what they need, which may be much; then one is as good as any other
        spare = 0 if self._known else 3 * self._crew.workers
        while self._waiting and self._crew.room > spare:
            self._send(heapq.heappop(self._waiting), whole=not self._known)

    def _send(self, part: TreePart, *, whole: bool) -> None:
        """Hand out a part; ``whole``: with all that a worker needs, which may be much."""
        data, seconds = self._data if whole else None, self._remaining()
        # in a cluster each costs as much to hand out as a few dozen nodes: once there are enough they are longer
        nodes = self._nodes if self._crew.near else self._nodes << min(len(part.place) - 1, DOUBLED)
        self._out[self._crew.submit(_examined, self._key, data, part.roots, nodes, seconds)] = part

    def _answered(self, part: TreePart) -> bool:
        """Wait for the answer of a part; False when the time is over."""
        while part.answer is None:
            seconds = self._remaining()
            job = self._crew.next(None if seconds is None else max(seconds, 0.0))
            if job is None:
                return False
            done = self._out.pop(job)
            if job.result is None:
                self._send(done, whole=True)  # it went to a worker that had nothing yet
                continue
            self._known, done.answer = True, job.result
            done.further = self.further(done, job.result)
            self._hand_out(done.further)
        return True


def _examined(key: bytes, data: bytes | None, roots: Sequence[Any], nodes: int, seconds: float | None) -> Answer | None:
    """Examine a part, in a worker; every thread makes what it needs once. None where it was not given that yet."""
    worker: Worker | None = kept_in_thread(key, data)
    if worker is None:
        return None
    with within(Deadline.after(time.perf_counter(), seconds)):
        return worker(roots, nodes)
