"""A search of the tree by the workers of a concurrent.futures executor, its proof put together in the tree's order.

The result of a task (``search/parts.py``) depends on it alone, and results are taken in the order of the tree: roots
and proof depend neither on timing nor on the number of workers.
"""

from __future__ import annotations

import pickle
import threading
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from enumsol.proof.writer import KeptRecords, Part, Recorder
from enumsol.search.outcome import SearchLimits, SearchOutcome, SearchProgress, Stop, StopReason
from enumsol.search.parts import PartCrew, TreePart
from enumsol.search.tree import TreeNode, TreeSearch

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence
    from concurrent.futures import Executor

    from enumsol.search.certifiers.protocol import Certified, Certifier
    from enumsol.search.load_limit import LoadLimit
    from enumsol.search.resume import Reader
    from enumsol.support.array_types import Alpha

#: Nodes of a task, and those that are examined here before there are any.
NODES, FIRST = 512, 64


class Searchable(Protocol):
    """A problem in 2D or 3D at one alpha in one arithmetic: all that a search of its tree is made from."""

    problem: Any
    alpha: Alpha

    @property
    def arithmetic(self) -> str:
        """The arithmetic of the search."""

    @property
    def has_solution(self) -> bool:
        """True if there is a solution for certain, once something can be proven."""

    @property
    def at_limit(self) -> LoadLimit | None:
        """The limit of what contact can hold, if the load of a body that nothing holds is there."""

    @property
    def undecidable(self) -> str | None:
        """Why nothing can be proven about this problem, or None."""

    def certifier(self, recorder: Recorder | None) -> Certifier:
        """The certifier of this arithmetic."""

    def search(
        self,
        certifier: Certifier,
        limits: SearchLimits | None = None,
        progress: Callable[[SearchProgress], object] | None = None,
    ) -> TreeSearch:
        """A search of the tree with a certifier made here."""

    def remake(self) -> Callable[[], Searchable]:
        """Makes the same again, also in another process."""

    def fresh(self) -> Searchable:
        """The same without anything that searches leave behind and others would depend on."""

    def unloaded(self) -> bool:
        """True if g = 0, so that only lambda = 0 solves."""

    def reader(self) -> Reader:
        """Understands the records of an earlier proof."""

    def proof_header(self) -> dict[str, Any]:
        """First record of a proof."""


@dataclass(frozen=True)
class _Sent:
    """What a worker makes its solvers from, and uses for many tasks."""

    form: Any
    sliding: dict[int, int]
    data: bytes

    @classmethod
    def of(cls, remake: Callable[[], Searchable], form: Any, sliding: dict[int, int], known: Any) -> _Sent:
        return cls(form, dict(sliding), pickle.dumps((remake, form, sliding, known)))


@dataclass(frozen=True)
class _Answer:
    """What a task came to; ``rest`` are the subtrees that are left, the first one last."""

    outcome: SearchOutcome
    records: Part | None
    certified: Certified
    covered: float
    rest: list[TreeNode]


class Spread:
    """Searches a tree with the help of an executor; its `run` takes the place of the loop of a TreeSearch.

    Parameters
    ----------
    executor : Executor
    solvers : Searchable
    search : TreeSearch
        Collects the outcome as parts come in, so that an interruption keeps those that did.
    """

    def __init__(self, executor: Executor, solvers: Searchable, search: TreeSearch) -> None:
        self._crew, self._search = PartCrew(executor, _search_part, NODES, search.limits.remaining), search
        self._remake = solvers.remake()
        #: What workers make their solvers from.
        self._sent: _Sent | None = None

    def run(self, waiting: Iterable[Any], until: Callable[[], bool] | None = None) -> list[Any]:
        """Examine what waits, the last first; what still waits when it is time to stop."""
        search, outcome = self._search, self._search.outcome
        stack = self._begin(list(waiting))
        while stack:
            if until is not None and until():
                return stack
            if search.must_stop(0):
                break
            part = stack.pop()
            if not self._crew.answered(part):
                stack.append(part)
                outcome.stopped = Stop(StopReason.TIME_LIMIT, unexamined=0)
                break
            stack.extend(reversed(self._take(part)))
        self._leave(stack)
        return []

    def cancel(self) -> None:
        """Cancel what has not begun."""
        self._search.outcome.redone = self._crew.redone
        self._crew.cancel()

    # -- parts -----------------------------------------------------------------------------------------------------

    def _begin(self, waiting: list[Any]) -> list[TreePart]:
        """Parts of what waits, which are these already where the search goes on as before."""
        form = None if self._search.forms is None else self._search.forms.form
        afresh = not all(isinstance(item, TreePart) for item in waiting)
        sliding = self._search.certifier.sliding
        if self._sent is None or self._sent.form is not form or (afresh and self._sent.sliding != sliding):
            known = None if self._search.closer is None else self._search.closer.known
            self._sent = _Sent.of(self._remake, form, sliding, known)
            self._crew.use(self._sent.data)
        elif not afresh:
            return waiting
        self.cancel()
        items: list[TreeNode] = []
        for item in waiting:
            items += item.roots if isinstance(item, TreePart) else [item]
        limits, done = self._search.limits, self._search.outcome.nodes
        first = FIRST if limits.max_nodes is None else min(FIRST, limits.max_nodes - done)
        rest = self._search.examined(items, first, limits.deadline)
        parts = self._crew.parts((), [item.sent() for item in rest])
        self._crew.hand_out(parts)
        return parts[::-1]

    def _take(self, part: TreePart) -> Sequence[TreePart]:
        """Take the answer of a part; gives those that follow from it."""
        search, answer, most = self._search, part.answer, self._search.limits.max_nodes
        assert answer is not None
        rest = None if most is None else most - search.outcome.nodes
        if rest is not None and answer.outcome.nodes > rest:
            # the last part before the limit is shorter
            left = search.examined(part.roots, rest)
            return self._crew.parts(part.place, [item.sent() for item in left])
        search.outcome.add(answer.outcome)
        search.certifier.add(answer.certified)
        if answer.records is not None:
            search.certifier.recorder.add(answer.records)
        search.covered += answer.covered
        search.report(search.covered)
        return part.further

    def _leave(self, stack: list[TreePart]) -> None:
        """What is left after a limit: undecided, but for parts that are there when the time is over."""
        search = self._search
        timely = search.outcome.stopped is not None and search.outcome.stopped.reason is StopReason.TIME_LIMIT
        while stack:
            part = stack.pop()
            if timely and part.answer is not None:
                stack.extend(reversed(self._take(part)))
                continue
            for root in reversed(part.roots):
                search.skip(root.codes)
        self.cancel()


_local = threading.local()


def _search_part(
    key: bytes, data: bytes | None, roots: Sequence[TreeNode], nodes: int, seconds: float | None
) -> _Answer | None:
    """Search a part, in a worker; every thread makes what it needs once. None where it was not given that yet."""
    if getattr(_local, "key", None) != key:
        if data is None:
            return None
        remake, _local.form, _local.sliding, _local.known = pickle.loads(data)
        _local.solvers, _local.key = remake(), key
    solvers: Searchable = _local.solvers.fresh()
    records = KeptRecords()
    certifier = solvers.certifier(records)
    certifier.sliding.update(_local.sliding)
    search = solvers.search(certifier)
    if search.closer is not None:
        search.closer.known = _local.known
    if search.forms is not None:
        search.forms.use(search.engine, _local.form)
    deadline = None if seconds is None else time.perf_counter() + seconds
    rest = search.examined(roots, nodes, deadline)
    left = [item.sent() for item in rest]
    return _Answer(search.outcome, records.part(), certifier.certified, search.covered, left)
