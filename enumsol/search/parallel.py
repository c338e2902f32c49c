"""Subtrees of a search run by a concurrent.futures executor, their proofs put together in the tree's order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from enumsol.search.certifiers.verified import VerifiedCertifier
from enumsol.search.solvers import Solvers
from enumsol.search.tree import SearchLimits, SearchOutcome, TreeNode, TreeSearch, UndecidedPart

if TYPE_CHECKING:
    from collections.abc import Callable
    from concurrent.futures import Executor, Future

    from enumsol.checks import Alpha
    from enumsol.kernel.point import VerifiedSelection
    from enumsol.problem import ContactProblem
    from enumsol.proof.proof_file import Recorder
    from enumsol.search.certifiers.verified import Escalations
    from enumsol.search.solvers import Arithmetic
    from enumsol.selections.solution import Codes

#: Levels of the tree that are examined here; what lies below is handed out. Subtrees differ widely in size, so there
#: are many more of them than workers.
LEVELS = 7


@dataclass(frozen=True)
class _Task:
    """A subtree for a worker; everything in it can be pickled."""

    problem: ContactProblem
    alpha: Alpha
    arithmetic: Arithmetic
    tolerance: float
    engine: str | None
    codes: Codes
    max_nodes: int | None
    seconds: float | None


@dataclass(frozen=True)
class _Answer:
    outcome: SearchOutcome
    records: list[Any]
    verified: dict[Codes, VerifiedSelection]
    escalations: Escalations | None
    leaves: int


def run_parallel(
    executor: Executor, solvers: Solvers, search: TreeSearch, engine: str | None, tolerance: float
) -> None:
    """Search the tree with the help of an executor; ``search`` collects the outcome, which does not depend on timing.

    Its outcome is filled as the subtrees come in, so that an interruption keeps those that did.
    """
    limits, outcome = search.limits, search.outcome
    plan = _Plan(executor, solvers, limits, engine, tolerance)
    certifier = search.certifier if isinstance(search.certifier, VerifiedCertifier) else None
    recorder = None
    if certifier is not None:
        recorder, certifier.recorder = certifier.recorder, plan
    try:
        stack: list[tuple[TreeNode, int]] = [(search.first(), 0)]
        while stack:
            branch, level = stack.pop()
            if level >= LEVELS:
                plan.submit(branch)
            else:
                children = reversed(list(search.examine(branch)))
                # presolve goes down without spreading out
                stack.extend((child, level + (child.forced is None)) for child in children)
        total, done, enough = len(plan.futures), 0, False
        for item in plan.items:
            if not isinstance(item, _Handed):
                if recorder is not None:
                    recorder.write(item)
                continue
            if enough:
                _skip(search, item.codes, recorder)
                continue
            _add(search, item.future.result(), recorder)
            done += 1
            search.report(done / total)
            if limits.enough is not None and limits.enough(outcome.solutions):
                outcome.stopped = outcome.stopped or f"stopped after enough roots, {total - done} subtrees not examined"
                enough = True
    finally:
        if certifier is not None and recorder is not None:
            certifier.recorder = recorder
        for future in plan.futures:
            future.cancel()


@dataclass(frozen=True)
class _Handed:
    """The place of a subtree's records among those written here."""

    future: Future[_Answer]
    codes: Codes


class _Plan:
    """Records written while the top of the tree is examined, with places left for the subtrees handed out."""

    def __init__(
        self, executor: Executor, solvers: Solvers, limits: SearchLimits, engine: str | None, tolerance: float
    ) -> None:
        self.items: list[Any] = []
        self.futures: list[Future[_Answer]] = []
        self._executor = executor
        self._limits = limits
        self._make: Callable[[Codes], _Task] = lambda codes: _Task(
            solvers.problem,
            solvers.alpha,
            solvers.arithmetic,
            tolerance,
            engine,
            codes,
            limits.max_nodes,
            limits.remaining(),
        )

    def write(self, record: Any) -> None:
        """Keep a record of the top of the tree."""
        self.items.append(record)

    def submit(self, branch: TreeNode) -> None:
        """Hand out a subtree."""
        future = self._executor.submit(_subtree, self._make(branch.codes))
        self.futures.append(future)
        self.items.append(_Handed(future, branch.codes))


class _Records:
    """Records of one subtree."""

    def __init__(self) -> None:
        self.records: list[Any] = []

    def write(self, record: Any) -> None:
        self.records.append(record)


def _subtree(task: _Task) -> _Answer:
    solvers = Solvers(task.problem, task.alpha, task.arithmetic, task.tolerance)
    records = _Records()
    certifier = solvers.certifier(records)
    limits = SearchLimits(max_nodes=task.max_nodes, deadline=SearchLimits.deadline_in(task.seconds))
    outcome = TreeSearch(solvers.scaled, certifier, engine=task.engine, limits=limits).run([task.codes])
    if isinstance(certifier, VerifiedCertifier):
        return _Answer(outcome, records.records, certifier.verified, certifier.escalations, certifier.leaves)
    return _Answer(outcome, [], {}, None, 0)


def _skip(search: TreeSearch, codes: Codes, recorder: Recorder | None) -> None:
    """Leave a subtree undecided because enough was found."""
    reason = str(search.outcome.stopped)
    if isinstance(search.certifier, VerifiedCertifier) and recorder is not None:
        recorder.write(["u", reason])
        search.certifier.leaves += 1
    search.outcome.undecided.append(
        UndecidedPart(codes, "the search was stopped before it came here", "raise the limit")
    )


def _add(search: TreeSearch, part: _Answer, recorder: Recorder | None) -> None:
    total = search.outcome
    total.solutions += part.outcome.solutions
    total.undecided += part.outcome.undecided
    total.stopped = total.stopped or part.outcome.stopped
    for name in ("nodes", "pruned", "selections", "qps", "fallback_qps"):
        setattr(total, name, getattr(total, name) + getattr(part.outcome, name))
    if isinstance(search.certifier, VerifiedCertifier) and part.escalations is not None:
        search.certifier.verified |= part.verified
        search.certifier.leaves += part.leaves
        search.certifier.escalations.add(part.escalations)
        for record in part.records:
            if recorder is not None:
                recorder.write(record)
