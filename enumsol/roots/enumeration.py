"""One call of enumerate_roots: what it is in 2D and 3D alike."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from dataclasses import fields
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import numpy as np

from enumsol.condensation.condensed import condensation_of
from enumsol.errors import OutputError
from enumsol.model.statuses import STATUSES, ContactStatus
from enumsol.proof.writer import BegunProof, ProofWriter, begun_proof
from enumsol.roots.root import Enclosure, Root
from enumsol.roots.root_set import RigidBound, RootSet, SearchStats, Undecided
from enumsol.search.certifiers.protocol import UndecidedPart
from enumsol.search.outcome import AWAY, HOLD, SearchLimits, SearchOutcome, SearchProgress, Stop, StopReason
from enumsol.search.setup import Replay, SearchSetup, SpreadSearch
from enumsol.support.deadlines import Deadline, within

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from concurrent.futures import Executor

    from enumsol.model.contact_body import ContactBody
    from enumsol.proof.proof_file import Proof
    from enumsol.roots.root import RootFamily
    from enumsol.search.tree import TreeSearch
    from enumsol.support.array_types import Alpha, Codes
    from enumsol.support.deadlines import Ending

_Solvers = TypeVar("_Solvers", bound=SearchSetup)


class Enumeration(ABC, Generic[_Solvers]):
    """A search at one alpha, its proof, and its result.

    Parameters
    ----------
    solvers : SearchSetup
    progress : callable or None
    proof_path : path or None
        Where to write the proof (arithmetic "verified"); None keeps it in memory.
    method : str
        How selections are found, for the result.
    resumed : bool
        Go on with the proof in that file, if there is one.
    started : time.perf_counter() value, optional
        When the call began; by default now.

    Raises
    ------
    InvalidArgumentError
        The file holds something else, or cannot be written.
    """

    def __init__(
        self,
        solvers: _Solvers,
        progress: Callable[[SearchProgress], object] | None,
        proof_path: str | Path | None,
        *,
        method: str = "tree",
        resumed: bool = False,
        started: float | None = None,
    ) -> None:
        self.solvers, self.progress, self.method = solvers, progress, method
        self.problem, self.alpha, self.arithmetic = solvers.problem, solvers.alpha, solvers.arithmetic
        self.started = time.perf_counter() if started is None else started
        self.outcome = SearchOutcome()
        self.unloaded = False
        self.tree: TreeSearch | None = None
        self.writer: ProofWriter | None = None
        self._begun: BegunProof | None = None
        if self.arithmetic == "verified":
            header = solvers.proof_header()
            if resumed and proof_path is not None:
                self._begun = begun_proof(Path(proof_path), header)
            self.writer = ProofWriter(proof_path, beside=self._begun is not None)
            self.writer.write(header)
        self.certifier = solvers.certifier(self.writer)

    def run(
        self, executor: Executor | None, stop_after: int | None, max_nodes: int | None, time_limit: float | None
    ) -> RootSet:
        """Search, then build the result."""
        enough, until = (
            None if stop_after is None else self._enough(stop_after),
            Deadline.after(self.started, time_limit),
        )
        limits = SearchLimits(until.deadline, enough, max_nodes)
        self._search(limits, executor)
        if self.writer is not None:
            self.writer.replace()
        # a search that goes on with an earlier one has moved its deadline
        with within(limits.extended(self.started)):
            result = self._result()
        if self.writer is not None and self.writer.failure is not None:
            raise OutputError(self.writer.failure, result)
        return result

    def cut_short(self, ending: Ending) -> RootSet:
        """The result of what was found before something ended ``run``, wherever that was."""
        self.outcome.stopped = Stop(StopReason.of(ending), self._examined())
        if self.tree is not None and not self.unloaded and not issubclass(ending, MemoryError):
            self.tree.rest.add_known()
        return self._result()

    def _at_least(self, known: int) -> int:
        """Least number of roots that exist: a body that is proven stable has a solution (theory, section 12.6)."""
        return max(known, int(self.solvers.has_solution and self.solvers.undecidable is None))

    def _search(self, limits: SearchLimits, executor: Executor | None) -> None:
        """Search the tree."""
        solvers = self.solvers
        self.tree = search = solvers.search(self.certifier, limits, self.progress)
        earlier = () if self._begun is None or self.writer is None else (self._begun, self.writer.replace)
        self.outcome = search.outcome
        limit = solvers.at_limit
        search.at_limit = None if limit is None else limit.nodes
        search.rest.otherwise = AWAY if limit is not None else "" if self.problem.held else HOLD
        search.rest.continua = self._continua
        if solvers.unloaded():
            self.certifier.unloaded()
            self.unloaded = True
        elif (reason := solvers.undecidable) is not None:
            # without any means of proof the tree would only grow
            codes = search.first().codes
            self.certifier.skipped(codes, reason)
            self.outcome.undecided.append(UndecidedPart(codes, reason, "hold the body better, or scale the data"))
        else:
            spread = None if executor is None else SpreadSearch(executor, solvers, search)
            if spread is not None:
                search.loop = spread.run
            try:
                if earlier:
                    Replay(search, solvers.limits, solvers.enclosed).run(*earlier)
                else:
                    search.run()
            finally:
                if spread is not None:
                    spread.cancel()

    def _examined(self) -> int:
        """Number of selections that an interruption says were done."""
        return self.outcome.nodes

    @abstractmethod
    def _enough(self, stop_after: int) -> Callable[[list[Any]], bool]:
        """True if solutions of leaves are so many roots and families."""

    def _continua(self) -> list[Codes]:
        """Complete selections that hold on the families of which solutions were found; in 3D there are none."""
        return []

    @abstractmethod
    def _result(self) -> RootSet:
        """Root set of what was found, in the user's terms."""

    def _root_set(
        self,
        roots: list[Root],
        undecided: list[Undecided],
        at_least: int | None,
        certified_data: str = "problem",
        families: Sequence[RootFamily] | None = None,
    ) -> RootSet:
        """The result; ``at_least`` is None where nothing is known to be missing, ``families`` in 3D, which has none."""
        modes, stopped = self.problem.modes, self.outcome.stopped
        beyond = None if (limit := self.solvers.at_limit) is None else limit.beyond
        needed = self.certifier.certified.bounded or self.method != "tree"
        counts = {"roots": len(roots)} | ({} if families is None else {"families": len(families)})
        return RootSet(
            alpha=self.alpha,
            roots=roots,
            families=families or (),
            undecided=undecided,
            arithmetic=self.arithmetic,
            method=self.method,
            stopped=None if stopped is None else str(stopped),
            stats=self._stats(),
            node_ids=self.problem.node_ids,
            at_least=at_least,
            certified_data=certified_data,
            proof=self._proof(**counts),
            rigid_bound=None if modes.r == 0 else RigidBound(self.problem.rigid_reach, needed, beyond),
        )

    def _rest(self) -> Root:
        """The unloaded body: nothing moves, every status holds, and the index is that of all roots together.

        The energy bound is lambda' S lambda <= 0 there, so that lambda = 0.
        """
        p, normal, tangential = self.problem.p, np.zeros(self.problem.p), np.zeros(self.problem.slip_offset.shape)
        plane = tangential.ndim == 1
        return Root(
            alpha=self.alpha,
            statuses=(ContactStatus.OPEN,) * p,
            active=(frozenset(STATUSES if plane else (*STATUSES[:2], ContactStatus.SLIP)),) * p,
            lambda_n=normal,
            lambda_t=tangential,
            u_n=normal,
            u_t=tangential,
            slip_angle=None if plane else np.full(tangential.shape, np.nan),
            index=1,
            regular=False,
            margin=0.0,
            enclosure=Enclosure(*(np.zeros((*part.shape, 2)) for part in (normal, tangential) * 2))
            if self.arithmetic != "fast"
            else None,
            _condensed=condensation_of(self.problem),
            _exact_slips=(Fraction(0),) * p if plane else None,
        )

    def _stats(self) -> SearchStats:
        own: dict[str, Any] = {
            "seconds": time.perf_counter() - self.started,
            "escalations": self.certifier.certified.escalations,
        }
        counts = {part.name: getattr(self.outcome, part.name) for part in fields(SearchStats) if part.name not in own}
        return SearchStats(**own, **counts)

    def _proof(self, **counts: int) -> Proof | None:
        """The proof, closed; None when the search was interrupted, or there was no room or time to write its end."""
        if self.writer is None:
            return None
        outcome = self.outcome
        whole = not outcome.late and (outcome.stopped is None or not outcome.stopped.interrupted)
        if whole:
            leaves = self.certifier.certified.leaves
            self.writer.write({**counts, "undecided": len(outcome.undecided), "leaves": leaves})
        proof = self.writer.close()
        return proof if whole and self.writer.failure is None else None


def not_begun(
    problem: ContactBody, alpha: Alpha, arithmetic: str, method: str, seconds: float, stop: StopReason
) -> RootSet:
    """Root set of a search that ended before the body was condensed: nothing is known."""
    what = {StopReason.INTERRUPTED: "it was interrupted", StopReason.OUT_OF_MEMORY: "the memory did not suffice"}
    reason = f"{what.get(stop, 'the time was over')} before the body was condensed to its contact nodes"
    return RootSet(
        alpha=alpha,
        roots=[],
        families=[],
        undecided=[Undecided((None,) * problem.p, reason, Stop(stop).remedy)],
        arithmetic=arithmetic,
        method=method,
        stopped=str(Stop(stop)),
        stats=SearchStats(seconds=seconds),
        node_ids=problem.node_ids,
        at_least=0,
    )
