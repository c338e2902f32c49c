"""The way in which a graph is worked out: what is searched, what certifies it, and how arcs are followed."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Literal

import numpy as np
from flint import fmpq_mat

from enumsol.arithmetic.rationals import rational
from enumsol.branches.elements import Effort
from enumsol.branches.enclosed.following import Followed, TracedProblem, follow_selections, make_traced
from enumsol.branches.enclosed.single_branches import ClosedPieces
from enumsol.branches.gluing import glue
from enumsol.branches.graph_data import GraphData, GraphStats
from enumsol.branches.known_selections import KnownSelections
from enumsol.branches.proof_records import write_graph_proof
from enumsol.condensation.data import EXACT_DOF_LIMIT
from enumsol.condensation.enclosure import NotEnclosedError
from enumsol.condensation.exact import FAST_EXACT_DOF, ExactCondensed, check_definite
from enumsol.condensation.unloaded import never_loaded, vanishing_alpha
from enumsol.errors import TooLargeError
from enumsol.model.statuses import OPEN, SLIP_MINUS, SLIP_PLUS, STICK
from enumsol.search.certifiers.interval_certifiers import ExactIntervalCertifier, VerifiedIntervalCertifier
from enumsol.search.outcome import Stop, StopReason
from enumsol.search.subintervals import IntervalCertifier, IntervalSearch, on_weak_springs, run_parallel
from enumsol.support.deadlines import Deadline, TimeOverError, over, within

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from concurrent.futures import Executor
    from fractions import Fraction

    from enumsol.branches.elements import Arc, Tick, Vertex
    from enumsol.branches.enclosed.cutting import Trace
    from enumsol.model.problem import ContactProblem
    from enumsol.model.problem3d import AnyProblem
    from enumsol.proof.proof_file import Proof
    from enumsol.search.subintervals import SearchedPiece
    from enumsol.support.array_types import Codes

Arithmetic = Literal["fast", "verified", "exact"]

#: Exact algebra is not begun where it would take more than this by ``_exact_work``: some five minutes.
LARGEST_EXACT_WORK = 3 * 10**9
#: Of the time that is left when arcs are begun: for working them out, and for joining them too, where there is a limit.
#: To join them takes a fifth as long as to work them out by exact algebra, to make a graph of them another tenth.
_WORKED_OUT, _JOINED = 0.55, 0.75
#: Boxes in which arcs are followed when the search was interrupted.
_BOXES_AFTER_INTERRUPT = 500
#: Selections whose arcs are then worked out without rounding: 8 at least, or so many by p^2.
_SELECTIONS_AFTER_INTERRUPT = 4096


@dataclass
class PlaneWay:
    """The way in 2D: the selections that a search over the interval leaves, and their arcs.

    Arcs are followed in balls; or by algebra, as functions of alpha in rationals, where there are no balls, or these
    leave something open and algebra does not take too long. A way keeps what it has worked out, so that an interruption
    loses none of it. Those in 3D are in ``space_graph``.

    Attributes
    ----------
    problem : ContactProblem
    interval : (Fraction, Fraction)
    arithmetic : str
    certifier : IntervalCertifier
    exact : ExactCondensed or None
        The problem in rationals, where arcs are worked out by algebra.
    traced : TracedProblem or None
        The problem in balls, where they are followed in these.
    search : IntervalSearch or None
        None until it has begun.
    candidates : set of codes, or None
        Selections that may hold somewhere; None while they are searched.
    closed : ClosedPieces
    traces : list of Trace
        Of selections that are finished.
    followed : Followed or None
        Arcs in balls that left something open.
    known : KnownSelections or None
    """

    problem: ContactProblem
    interval: tuple[Fraction, Fraction]
    arithmetic: Arithmetic
    certifier: IntervalCertifier
    exact: ExactCondensed | None = None
    traced: TracedProblem | None = None
    search: IntervalSearch | None = None
    candidates: set[Codes] | None = None
    closed: ClosedPieces = field(default_factory=ClosedPieces)
    traces: list[Trace] = field(default_factory=list)
    followed: Followed | None = None
    known: KnownSelections | None = None

    @property
    def origin(self) -> Fraction | None:
        """The alpha at which g vanishes."""
        if self.traced is not None:
            return self.traced.origin
        return None if self.exact is None else self.exact.zero

    def begin(
        self, max_nodes: int | None = None, limits: Deadline | None = None, tick: Tick | None = None
    ) -> IntervalSearch:
        """The search over the interval; of what nothing holds, on weak springs (theory, section 14.8)."""
        problem, deadline = self.problem, None if limits is None else limits.deadline
        self.search = IntervalSearch(
            problem.condensed if problem.held else on_weak_springs(problem),
            self.interval,
            self.origin,
            self.certifier,
            max_nodes=max_nodes,
            deadline=deadline,
            progress=tick,
        )
        return self.search

    def run(self, max_nodes: int | None, limits: Deadline, tick: Tick | None, executor: Executor | None) -> None:
        """Search the interval."""
        try:
            with within(limits):
                search = self.begin(max_nodes, limits, tick)
        except TimeOverError:
            return
        if self.exact is not None and self.exact.unloaded:
            # lambda = 0 is the only solution at every alpha, and every selection holds there: one is enough
            self.candidates = {(OPEN,) * self.exact.p}
            return
        if self.traced is not None:
            # pieces that need no tree are found while there is time
            search.closed = self.closed.pieces
            with suppress(TimeOverError), within(Deadline(search.deadline)):
                self.closed.find(self.traced, search.worker)
        if executor is None:
            search.run()
        else:
            run_parallel(executor, search)
        self.candidates = search.selections

    def made(self, limits: Deadline, tick: Tick | None) -> GraphData:
        """Arcs, worked out and joined by a deadline; what is not joined stays open."""
        if self.search is None:
            return self.ended(StopReason.TIME_LIMIT)
        with within(limits.part(_JOINED)):
            return self.worked_out(Effort(tick, limits.part(_WORKED_OUT)))

    def ended(self, reason: StopReason) -> GraphData:
        """Arcs that were worked out by then, and some more if the search was ended."""
        search = self.search
        if search is None:
            return not_condensed(self.problem, self.interval, self.arithmetic, reason)
        if self.candidates is None and (search.stopped is None or not search.stopped.interrupted):
            search.stopped = Stop(reason, search.nodes)
        return self.worked_out(Effort(ended=reason))

    def worked_out(self, effort: Effort) -> GraphData:
        """Arcs of the selections that were found."""
        search, candidates = self._found()
        if self.exact is None and self.traced is not None:
            self.followed = followed = self._follow(self.traced, effort)
            joined, problem = followed.joined, self.problem
            stopped = search.stopped is not None or followed.stopped is not None
            large = over() or problem.n > EXACT_DOF_LIMIT or _exact_work(problem, candidates) > LARGEST_EXACT_WORK
            if (joined.ordered and not joined.open) or stopped or large:
                return self._made(make_traced(self.traced, joined), followed.reasons, followed.stopped)
            # several conditions vanish at one alpha, or a selection is singular
            self.exact = ExactCondensed.from_problem(problem)
        if self.known is None:
            assert self.exact is not None
            a, b = (rational(end) for end in search.interval)
            self.known = KnownSelections(self.exact, a, b, cut_short=search.stopped is not None)
        few = max(8, _SELECTIONS_AFTER_INTERRUPT // self.problem.p**2)
        vertices, arcs, stopped_at = glue(self.known, candidates, self._bounded(effort, few))
        return self._made((vertices, arcs), self.known.reasons, stopped_at)

    def _follow(self, traced: TracedProblem, effort: Effort) -> Followed:
        search, _ = self._found()
        return follow_selections(
            traced,
            search.pieces,
            self._bounded(effort, _BOXES_AFTER_INTERRUPT),
            known=self.closed.traces,
            done=self.traces,
            cut_short=search.stopped is not None,
        )

    def _found(self) -> tuple[IntervalSearch, set[Codes]]:
        """The search and the selections that it left."""
        assert self.search is not None
        return self.search, self.search.selections if self.candidates is None else self.candidates

    def _bounded(self, effort: Effort, few: int) -> Effort:
        """All arcs; after an interruption only a few, and none if it was not the search that was ended."""
        search, _ = self._found()
        if effort.ended is None:
            return effort
        return replace(effort, most=few if search.stopped is not None and search.stopped.interrupted else 0)

    def _made(
        self, elements: tuple[Sequence[Vertex], Sequence[Arc]], reasons: Sequence[str], stopped: Stop | None
    ) -> GraphData:
        """Vertices and arcs with what is told of them; there is no proof if the time was over."""
        search, candidates = self._found()
        stops = [stop for stop in (search.stopped, stopped) if stop is not None]
        proof: Callable[[], Proof | None] | None = None
        if search.checkable and search.pieces and search.stopped is None and all(stop.interrupted for stop in stops):
            given = self.problem, search.interval
            if self.exact is None or self.exact.condensed_exactly:
                proof = partial(_proof_of_problem, *given, search.pieces, self.followed)
            else:
                proof = partial(write_graph_proof, *given, "condensed", search.pieces, None)
        stats = GraphStats(
            pieces=len(search.pieces),
            closed=sum(found.closed is not None for found in search.pieces),
            nodes=search.nodes,
            selections=len(candidates),
            bounded=sum(found.closed.bounded if found.closed else found.system is not None for found in search.pieces),
        )
        (vertices, arcs), undecided = elements, (*map(str, stops), *reasons)
        found = tuple(vertices), tuple(arcs), undecided, stats, tuple(search.pieces), proof
        return GraphData(self.problem, self.exact, self.interval, self.arithmetic, *found)


def not_condensed(
    problem: AnyProblem, interval: tuple[Fraction, Fraction], arithmetic: Arithmetic, reason: StopReason
) -> GraphData:
    """Nothing, of a call that ended before the body was condensed."""
    why = f"{Stop(reason)} before the body was condensed to its contact nodes"
    return GraphData(problem, None, interval, arithmetic, (), (), (why,), GraphStats())


def by_algebra(
    problem: ContactProblem, interval: tuple[Fraction, Fraction], exact: ExactCondensed, arithmetic: Arithmetic
) -> PlaneWay:
    """The way without balls, with the certifier of an arithmetic."""
    certifier = IntervalCertifier()
    if not problem.held:
        certifier = VerifiedIntervalCertifier(problem, None)
        certifier.checkable = arithmetic == "verified"
    elif arithmetic == "exact":
        certifier = ExactIntervalCertifier(exact)
    elif arithmetic == "verified":
        certifier = VerifiedIntervalCertifier(problem, exact)
    return PlaneWay(problem, interval, arithmetic, certifier, exact)


def way_of(problem: ContactProblem, interval: tuple[Fraction, Fraction], arithmetic: Arithmetic) -> PlaneWay:
    """The way for a problem in 2D: by algebra where that is fast, and where balls cannot hold the data.

    Raises
    ------
    TooLargeError
        Exact arithmetic was asked for, or what nothing holds cannot be enclosed, and the problem is too large for it.
    TimeOverError
        The body is so large that the time was over before it was condensed.
    """
    held, large = problem.held, arithmetic == "verified" and problem.n > FAST_EXACT_DOF
    at_rest = large and held and never_loaded(problem)
    if large and not at_rest and (traced := _traced(problem, interval)) is not None:
        certifier = VerifiedIntervalCertifier(problem, None, traced.origin if held else None)
        return PlaneWay(problem, interval, arithmetic, certifier, traced=traced)
    if held and arithmetic != "exact" and problem.n > (EXACT_DOF_LIMIT if at_rest else FAST_EXACT_DOF):
        return by_algebra(problem, interval, ExactCondensed.from_condensed(problem), arithmetic)
    if large and not held and problem.n > EXACT_DOF_LIMIT:
        raise TooLargeError(
            "the stiffness of the body on springs is positive definite only within rounding, and exact algebra takes "
            f"at most n = {EXACT_DOF_LIMIT} degrees of freedom; the problem has n = {problem.n}"
        )
    exact, size = ExactCondensed.from_problem(problem), 2 * problem.p
    if not problem.on_springs.condensed.definite:
        check_definite(fmpq_mat([list(row[:size]) for row in exact.rows[:size]]))
    return by_algebra(problem, interval, exact, arithmetic)


def _exact_work(problem: ContactProblem, candidates: set[Codes]) -> float:
    """Cost of exact algebra of selections in units of 1e-7 s: (slips whose friction varies + 1) size^4 n.

    The entries of S have digits in proportion to n, and determinants so many times their number as their size.
    Measured, within a factor of two, with dovetails, wedges and clips of 6 to 14 contact nodes and 56 to 210 degrees of
    freedom.
    """
    varying = np.array(problem.friction_slope) != 0
    codes = np.array(sorted(candidates), dtype=np.intp).reshape(-1, problem.p)
    slips = np.sum(((codes == SLIP_PLUS) | (codes == SLIP_MINUS)) & varying, axis=1)
    sizes = np.sum(codes != OPEN, axis=1) + np.sum(codes == STICK, axis=1)
    return problem.n * float(np.sum((slips + 1.0) * sizes.astype(float) ** 4))


def _traced(problem: ContactProblem, interval: tuple[Fraction, Fraction]) -> TracedProblem | None:
    """The problem in balls; None where its data cannot be enclosed."""
    try:
        return TracedProblem(problem, interval, vanishing_alpha(problem, "problem"))
    except NotEnclosedError:
        return None


def _proof_of_problem(
    problem: ContactProblem,
    interval: tuple[Fraction, Fraction],
    pieces: Sequence[SearchedPiece],
    followed: Followed | None,
) -> Proof | None:
    """The proof for the problem's own data, with the arcs where they can be followed in balls."""
    if followed is None and (traced := _traced(problem, interval)) is not None:
        followed = follow_selections(traced, pieces)
    whole = followed is None or followed.stopped is None
    return write_graph_proof(problem, interval, "problem", pieces, followed if whole else None)
