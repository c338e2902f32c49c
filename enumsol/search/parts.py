"""Parts of a tree that workers search and that are taken in the tree's order, whatever the tree is.

A task is a part of the tree. It ends after a number of nodes and gives back the subtrees that it did not reach, which
are new tasks: so no part is long, however uneven the tree. What a task gives back depends on it alone.
"""

from __future__ import annotations

import hashlib
import heapq
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from enumsol.support.workers import Crew, Job

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from concurrent.futures import Executor

#: Of the subtrees that a task gives back, so many become tasks of their own: those nearest to the root of the tree.
ALONE = 4


@dataclass(eq=False)
class TreePart:
    """A part of the tree: subtrees that follow on each other, the first one last.

    Attributes
    ----------
    place : where it is in the tree, for an order
    roots : sequence
    answer : what a worker made of it, with ``rest``, the subtrees that are left, the first one last
    further : the parts that are left
    """

    place: tuple[int, ...]
    roots: Sequence[Any]
    answer: Any = None
    further: Sequence[TreePart] = ()

    def __lt__(self, other: TreePart) -> bool:
        return self.place < other.place


class PartCrew:
    """Workers that search parts of a tree.

    Parameters
    ----------
    executor : Executor
    search : callable
        Called in a worker with a key, what has that key or None, the roots of a part, a number of nodes and the seconds
        that are left or None. Gives an answer; None where it was not given what has the key yet.
    nodes : of a task
    remaining : callable
        Gives the seconds that are left, or None.
    """

    def __init__(
        self,
        executor: Executor,
        search: Callable[..., Any],
        nodes: int,
        remaining: Callable[[], float | None],
    ) -> None:
        self._crew, self._search, self._nodes, self._remaining = Crew(executor), search, nodes, remaining
        self._data, self._key, self._known = b"", b"", False
        self._waiting: list[TreePart] = []
        self._out: dict[Job, TreePart] = {}

    @property
    def redone(self) -> int:
        """Tasks that were lost and done again."""
        return self._crew.redone

    def use(self, data: bytes) -> None:
        """Have workers make what they need from this; it is sent along until one of them has it."""
        self._data, self._key, self._known = data, hashlib.sha256(data).digest(), False

    def cancel(self) -> None:
        """Cancel what has not begun."""
        self._crew.cancel()
        self._out.clear()
        self._waiting.clear()

    @staticmethod
    def parts(place: tuple[int, ...], roots: Sequence[Any]) -> list[TreePart]:
        """In the order of the tree; of the subtrees the last ones are near its root, and so large."""
        groups: list[Sequence[Any]] = [[root] for root in roots[:ALONE][::-1]]
        if roots[ALONE:]:
            groups.insert(0, roots[ALONE:])
        return [TreePart((*place, k), group) for k, group in enumerate(groups)]

    def further(self, part: TreePart) -> list[TreePart]:
        """What the answer of a part leaves."""
        return self.parts(part.place, part.answer.rest)

    def hand_out(self, parts: Sequence[TreePart]) -> None:
        """Keep the workers busy with what has no answer yet and comes first in the tree."""
        for part in parts:
            if part.answer is None:
                heapq.heappush(self._waiting, part)
        while self._waiting and self._crew.room > 0:
            self._send(heapq.heappop(self._waiting), whole=not self._known)

    def _send(self, part: TreePart, *, whole: bool) -> None:
        """Hand out a part; ``whole``: with all that a worker needs, which may be much."""
        data, seconds = self._data if whole else None, self._remaining()
        self._out[self._crew.submit(self._search, self._key, data, part.roots, self._nodes, seconds)] = part

    def answered(self, part: TreePart) -> bool:
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
            done.further = self.further(done)
            self.hand_out(done.further)
        return True
