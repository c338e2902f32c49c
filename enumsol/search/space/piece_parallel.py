"""The tree over alpha searched by the workers of a concurrent.futures executor, put together in the tree's order.

A task (``search/parts.py``) is a part of the tree with the curves that are known, and depends on nothing else. Where it
would look for another curve it ends: that is done by the calling process when the walk through the tree comes to it,
and what lies behind is searched again if a curve is found. So curves and proof depend neither on timing nor on the
number of workers.
"""

from __future__ import annotations

import pickle
import threading
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from enumsol.search.outcome import StopReason
from enumsol.search.parts import PartCrew, TreePart
from enumsol.search.space.piece_tree import PieceTree
from enumsol.support.deadlines import Deadline, remaining, within
from enumsol.trusted.space.curve_runs import KnownCurve
from enumsol.trusted.space.solution_curve import AlphaProblem

if TYPE_CHECKING:
    from collections.abc import Sequence
    from concurrent.futures import Executor

    from enumsol.search.space.piece_tree import Known, Waiting

#: Nodes of a task.
NODES = 16
#: In place of the answer of a part that is to look for a curve.
WANTED = "a curve is wanted"


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


def spread_over(executor: Executor, tree: PieceTree, waiting: list[Waiting]) -> None:
    """Examine what waits with the help of an executor, as ``PieceTree.examined`` does without; see there."""
    _Spread(executor, tree).run(waiting)


class _Crew(PartCrew):
    """Workers; a part whose first root is to look for a curve has ``WANTED`` in place of an answer."""

    def further(self, part: TreePart) -> list[TreePart]:
        """What an answer leaves, the root that is to look for a curve in a part of its own."""
        rest, place = part.answer.rest, part.place
        if not part.answer.wanted:
            return self.parts(place, rest)
        return [TreePart((*place, -1), rest[-1:], WANTED), *self.parts(place, rest[:-1])]


class _Spread:
    """See ``spread_over``."""

    def __init__(self, executor: Executor, tree: PieceTree) -> None:
        self._crew, self._tree = _Crew(executor, _search_part, NODES, remaining), tree
        self._use(tree.known())

    def _use(self, known: Known) -> None:
        """Have workers know these curves."""
        self._known = known
        self._crew.use(pickle.dumps(known))

    def run(self, waiting: list[Waiting]) -> None:
        """Examine what waits; what no worker has examined when a limit is reached is open."""
        stack = self._crew.parts((), [_sent(item) for item in waiting])[::-1]
        try:
            self._tree.away = True
            waiting.clear()
            self._crew.hand_out(stack)
            while stack and self._tree.stopped is None:
                self._next(stack)
        finally:
            self._leave(stack)
            self._crew.cancel()

    def _next(self, stack: list[TreePart]) -> None:
        """Take the next part of the tree."""
        tree, part, left = self._tree, stack[-1], self._tree.left
        if left == 0:
            tree.stopped = StopReason.NODE_LIMIT
        elif part.answer is WANTED:
            self._look_for_curve(stack)
        elif not self._crew.answered(part) or not (part.answer.records or part.answer.wanted):
            # the time is over, or was so for the worker
            tree.stopped = StopReason.TIME_LIMIT
        else:
            if left is not None and part.answer.nodes > left:
                # the last part before the limit is shorter
                part.answer = _examined(FixedTree(self._known, tree.curves), part.roots, left)
                part.further = [TreePart(part.place, part.answer.rest)]
            self._take(stack)

    def _look_for_curve(self, stack: list[TreePart]) -> None:
        """Examine here the node that may need another curve, and search again what was searched without it."""
        tree, part = self._tree, stack[-1]
        waiting = list(part.roots)
        tree.examined(waiting, 1)
        if tree.stopped is not None:
            return
        parts = self._crew.parts(part.place, [_sent(item) for item in waiting])
        stack[-1:] = parts[::-1]
        known = tree.known()
        if known.state == self._known.state:
            self._crew.hand_out(parts)
            return
        self._crew.cancel()
        self._use(known)
        for other in stack:
            other.answer, other.further = None, ()
        self._crew.hand_out(stack)

    def _take(self, stack: list[TreePart]) -> None:
        """Take the answer of the next part, in whose place are the parts that follow from it."""
        part, tree = stack[-1], self._tree
        # whenever somebody interrupts, what is not on the stack is in the records
        tree.records += part.answer.records
        tree.nodes += part.answer.nodes
        stack[-1:] = part.further[::-1]
        tree.report(part.answer.covered)

    def _leave(self, stack: list[TreePart]) -> None:
        """What is left is open, but for parts that are there when the time is over or somebody interrupts."""
        kept = self._tree.stopped is not StopReason.NODE_LIMIT  # as many as without workers
        while stack:
            if kept and stack[-1].answer not in (None, WANTED):
                self._take(stack)
            else:
                self._tree.leave(stack[-1].roots)
                stack.pop()
        self._tree.away = False


def _sent(item: Waiting) -> Waiting:
    """A subtree as a task begins with it: without what is known from above."""
    (low, high, codes, _, _, _, cuts), share = item
    return (low, high, codes, None, -1, False, cuts), share


_local = threading.local()


def _search_part(
    key: bytes, data: bytes | None, roots: Sequence[Waiting], nodes: int, seconds: float | None
) -> _Answer | None:
    """Search a part, in a worker; every thread makes what it needs once. None where it was not given that yet."""
    if getattr(_local, "key", None) != key:
        if data is None:
            return None
        known: Known = pickle.loads(data)
        given = AlphaProblem.of(known.problem[0])
        _local.known, _local.curves = known, [KnownCurve(given, chain) for chain in known.chains]
        _local.key = key
    with within(Deadline.after(time.perf_counter(), seconds)):
        return _examined(FixedTree(_local.known, _local.curves), roots, nodes)


def _examined(tree: FixedTree, roots: Sequence[Waiting], most: int) -> _Answer:
    """Examine so many nodes."""
    waiting, wanted = list(roots), False
    try:
        tree.examined(waiting, most)
    except CurveWantedError:
        wanted = True
    return _Answer(tree.records, tree.nodes, tree.covered, [_sent(item) for item in waiting], wanted)
