"""Subtrees of a search run by a concurrent.futures executor, their proofs put together in the tree's order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from enumsol.executors import WorkerLost, has_result, result_of, submit
from enumsol.search.resume import Replay
from enumsol.search.stopping import Stop, StopReason
from enumsol.search.tree import SearchLimits, SearchOutcome, TreeNode

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from concurrent.futures import Executor, Future

    from enumsol.proof.begun import BegunProof
    from enumsol.proof.proof_file import Recorder
    from enumsol.search.certifiers.protocol import Certified, Certifier
    from enumsol.search.resume import Reader
    from enumsol.search.tree import SearchProgress, TreeSearch
    from enumsol.selections.solution import Codes

#: Levels of the tree that are examined here; the subtrees below are handed out. Their sizes differ widely, so there
#: are many more of them than workers.
LEVELS = 7


class Searchable(Protocol):
    """A problem in 2D or 3D at one alpha in one arithmetic: all that a search of its tree is made from."""

    @property
    def arithmetic(self) -> str:
        """In which it is searched."""

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

    def unloaded(self) -> bool:
        """Whether g = 0, so that only lambda = 0 solves."""

    def reader(self) -> Reader:
        """Understands the records of an earlier proof."""

    def proof_header(self) -> dict[str, Any]:
        """First record of a proof."""


@dataclass(frozen=True)
class _Answer:
    outcome: SearchOutcome
    records: list[Any]
    certified: Certified


def run_parallel(
    executor: Executor,
    solvers: Searchable,
    search: TreeSearch,
    begun: BegunProof | None = None,
    passed: Callable[[], None] | None = None,
) -> None:
    """Search the tree with the help of an executor; ``search`` collects the outcome, which does not depend on timing.

    Its outcome is filled as the subtrees come in, so that an interruption keeps those that did. It goes on with an
    earlier proof, if there is one (see Replay.run).

    Raises
    ------
    WorkerLost
        A worker died. The outcome holds the subtrees that were finished by then; the others are undecided in it and in
        its proof.
    """
    limits, remake = search.limits, solvers.remake()

    def hand_out(codes: Codes) -> Future[_Answer]:
        return submit(executor, _subtree, codes, remake, limits.max_nodes, limits.remaining())

    plan = _Plan(hand_out)
    try:
        if begun is None or passed is None:
            _examine_top(plan, search)
        else:
            _go_on(plan, search, Replay(search, solvers.reader(), plan.submit), begun, passed)
        _collect(plan, search)
    finally:
        for handed in plan.handed:
            if handed.future is not None:
                handed.future.cancel()
    if plan.lost is not None:
        raise plan.lost


def _examine_top(plan: _Plan, search: TreeSearch) -> None:
    """Examine the top of the tree, whose records go to the plan, and hand out what lies below."""
    certifier = search.certifier
    recorder, certifier.recorder = certifier.recorder, plan
    try:
        stack: list[tuple[TreeNode, int]] = [(search.first(), 0)]
        while stack:
            item, level = stack.pop()
            if level >= LEVELS:
                plan.submit(item)
            else:
                children = reversed(list(search.examine(item)))
                # presolve goes down without spreading out
                stack.extend((child, level + (child.forced is None)) for child in children)
    finally:
        certifier.recorder = recorder


def _go_on(plan: _Plan, search: TreeSearch, replay: Replay, begun: BegunProof, passed: Callable[[], None]) -> None:
    """Take over an earlier proof, and hand out what it leaves."""
    certifier = search.certifier
    recorder, certifier.recorder = certifier.recorder, plan
    try:
        for item in reversed(replay.run(begun, lambda: plan.items.append(passed))):
            plan.submit(item)
    finally:
        certifier.recorder = recorder


@dataclass(frozen=True)
class _Handed:
    """The place of a subtree's records among those written here; no future when the executor took no task."""

    future: Future[_Answer] | None
    codes: Codes


class _Plan:
    """Records written while the top of the tree is examined, with places left for the subtrees handed out."""

    def __init__(self, hand_out: Callable[[Codes], Future[_Answer]]) -> None:
        self.items: list[Any] = []
        self.handed: list[_Handed] = []
        self.lost: WorkerLost | None = None
        self._hand_out = hand_out

    def write(self, record: Any) -> None:
        """Keep a record of the top of the tree."""
        self.items.append(record)

    def submit(self, item: TreeNode) -> None:
        """Hand out a subtree, as long as the executor takes any."""
        future, codes = None, item.codes
        if self.lost is None:
            try:
                future = self._hand_out(codes)
            except WorkerLost as loss:
                self.lost = loss
        self.handed.append(_Handed(future, codes))
        self.items.append(self.handed[-1])


class _Records:
    """Records of one subtree."""

    def __init__(self) -> None:
        self.records: list[Any] = []

    def write(self, record: Any) -> None:
        self.records.append(record)


def _subtree(codes: Codes, remake: Callable[[], Searchable], max_nodes: int | None, seconds: float | None) -> _Answer:
    """Search below a partial assignment, in a worker; everything here can be pickled."""
    solvers, records = remake(), _Records()
    certifier = solvers.certifier(records)
    limits = SearchLimits(max_nodes=max_nodes, deadline=SearchLimits.deadline_in(seconds))
    outcome = solvers.search(certifier, limits).run([codes])
    return _Answer(outcome, records.records, certifier.certified)


def _collect(plan: _Plan, search: TreeSearch) -> None:
    """Wait for the subtrees in the tree's order, until enough is found or a worker lost; put their records in place."""
    limits, outcome, total, done = search.limits, search.outcome, len(plan.handed), 0
    # once enough is found or a worker lost: the subtrees that are finished, which still count
    finished: set[Future[_Answer]] | None = None
    if plan.lost is not None:
        finished = _finished(plan.handed, plan.lost, outcome)
    for item in plan.items:
        if callable(item):
            item()
            continue
        if not isinstance(item, _Handed):
            search.certifier.recorder.write(item)
            continue
        answer = None
        if item.future is not None and (finished is None or item.future in finished):
            try:
                answer = result_of(item.future)
            except WorkerLost as loss:
                plan.lost = loss
                finished = _finished(plan.handed[done:], loss, outcome)
        if answer is None:
            hint = "search again, with fewer workers" if plan.lost is not None else "raise the limit"
            search.skip(item.codes, hint)
            continue
        outcome.add(answer.outcome)
        search.certifier.add(answer.certified)
        for record in answer.records:
            search.certifier.recorder.write(record)
        done += 1
        search.report(done / total)
        if finished is None and limits.enough is not None and limits.enough(outcome.solutions):
            outcome.stopped = outcome.stopped or Stop(StopReason.ENOUGH_ROOTS, unexamined=total - done)
            finished = set()


def _finished(handed: Sequence[_Handed], loss: WorkerLost, outcome: SearchOutcome) -> set[Future[_Answer]]:
    """Of the subtrees still out when a worker was lost, those with an answer; the outcome says how many have none."""
    found = {item.future for item in handed if item.future is not None and has_result(item.future)}
    outcome.stopped = Stop(StopReason.WORKER_LOST, unexamined=len(handed) - len(found), loss=loss.what)
    return found
