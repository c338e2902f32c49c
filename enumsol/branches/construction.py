"""branch_graph: every solution for every alpha in an interval, as a graph of arcs (theory, section 7)."""

from __future__ import annotations

import time
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from typing import TYPE_CHECKING

from enumsol.branches.graph import BranchGraph
from enumsol.branches.graph_data import GraphStats
from enumsol.branches.ways import Arithmetic, Made, Way, way_of
from enumsol.condensation.data import exactly_at
from enumsol.errors import InvalidArgumentError
from enumsol.model.problem import ContactProblem, check_is_problem
from enumsol.search.outcome import Stop, StopReason
from enumsol.support import arguments
from enumsol.support.deadlines import Deadline, TimeOverError, within
from enumsol.support.keeping import keeping
from enumsol.support.workers import workers_of

if TYPE_CHECKING:
    from collections.abc import Callable
    from concurrent.futures import Executor

    from enumsol.model.problem3d import AnyProblem, ContactProblem3D
    from enumsol.search.interval.subintervals import IntervalSearch
    from enumsol.support.array_types import AlphaLike, Codes
    from enumsol.support.keeping import Ending

#: Of the time that is left when arcs are begun: for working them out, and for joining them too, where there is a limit.
#: To join them takes a fifth as long as to work them out by exact algebra, to make a graph of them another tenth.
_WORKED_OUT, _JOINED = 0.55, 0.75
#: Alternatives in messages about bodies that nothing holds and that have no graph.
_AT_SINGLE_ALPHAS = " (weak ones will do), or multiplicity_table, which counts the solutions at single alphas"


def branch_graph(
    problem: AnyProblem,
    interval: tuple[AlphaLike, AlphaLike],
    arithmetic: Arithmetic = "verified",
    *,
    progress: Callable[[str, float], object] | None = None,
    max_nodes: int | None = None,
    time_limit: float | None = None,
    executor: Executor | None = None,
    jobs: int | None = None,
) -> BranchGraph:
    """All solutions over an interval of alpha, as arcs glued at vertices (theory, section 7).

    A tree search over the interval gives the selections that may hold somewhere in it. Each of them is followed over
    alpha, in ball arithmetic or by the roots of integer polynomials; an arc is where it holds. Arcs are glued by the
    statuses that hold at their ends, never by comparing numbers.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
        In 3D the coefficients of a node must have the same ratio for all alpha.
    interval : pair of alphas
        First and last alpha, in increasing order: float, Fraction or whatever enumerate_roots accepts as alpha.
    arithmetic : {"verified", "fast", "exact"}
        "verified": every leaf of the search is proven empty over its whole piece of the interval, and every surviving
        selection is followed, by rigorous error bounds for the problem's own matrices (theory, section 7.14). The graph
        is made of these arcs; up to 24 degrees of freedom, and up to 250 if bounds left something open, it is made by
        exact algebra instead, for the same matrices (``graph.arcs_by`` says which). Beyond 250, or where exact
        algebra would take more than some minutes, what is left open is a vertex of kind "unsettled", and the graph is
        not complete. Only where A is positive definite within rounding are more than 24 degrees of freedom about S and
        g as computed in floats (``graph.certified_data``).
        "fast": exact algebra, but the search trusts floats; never claimed to be complete; S and g as computed beyond 24
        degrees of freedom. "exact": everything in rationals, for the problem's own matrices of up to 250 degrees of
        freedom, and slow beyond some ten contact nodes.
        In 3D there is only "verified": solutions lie on curves in boxes, followed in balls (theory, sections 12.8 to
        12.10). Where there is one solution at every alpha, that takes seconds for some thirty contact nodes; with
        several solutions, seconds to half a minute for up to eight. What stays open is named in ``graph.reasons``.
    progress : callable, optional
        Called with the name of the stage ("search", "arcs") and the share of it that is done.
    max_nodes : int, optional
        Stop the search after this many nodes; the graph is then reported as incomplete.
    time_limit : float, optional
        Stop after this many seconds; the graph is then made of what was found, which takes a fifth of them and two
        seconds at most.
    executor : concurrent.futures.Executor, optional
        Searches the pieces of the interval, and parts of large ones, in its workers. The graph and its proof are those
        found without it. In 3D workers search parts of the tree; its proof may have other leaves than without them, but
        does not depend on their number and timing, and the calling process follows the curves.

    jobs : int, optional
        Number of processes that work, instead of an ``executor``; a script then needs ``if __name__ == "__main__":``.

    Returns
    -------
    BranchGraph

    Raises
    ------
    InvalidArgumentError
        The interval or another argument is out of range, friction is negative somewhere in the interval (the node
        and the alpha are named), or a problem in 3D has another arithmetic than "verified".
    TooLargeError
        Exact arithmetic was asked for and the problem is too large for it.
    MissingDependencyError
        The compiled solver of the relaxations is not installed.
    Interrupted, OutOfMemoryError
        On Ctrl-C, or where the memory does not suffice; ``partial`` is the graph of what was found so far, which is not
        complete. After an interrupted search only the arcs of some of the selections found are in it, if there are
        many: ``partial.reasons`` says how many.

    Examples
    --------
    >>> import enumsol
    >>> enumsol.branch_graph(enumsol.gallery.one_node_triangle(), (0, 10))
    BranchGraph for alpha in [0, 10] (verified)
    ...
    complete: yes (proven)
    """
    check_is_problem(problem)
    a, b = (Fraction(end) for end in arguments.alpha_interval(interval))
    arguments.one_of(arithmetic, "arithmetic", ("fast", "verified", "exact"))
    arguments.optional_callable(progress, "progress")
    arguments.optional_executor(executor, jobs)
    max_nodes, time_limit = arguments.optional_count(max_nodes, "max_nodes"), arguments.optional_seconds(time_limit)
    started = time.perf_counter()
    limits = Deadline.after(started, time_limit)
    if not isinstance(problem, ContactProblem):
        with workers_of(executor, jobs) as pool:
            return _in_space(problem, (a, b), arithmetic, progress, max_nodes, limits, pool)
    if not problem.held:
        _check_floating(problem, arithmetic)
    _check_friction(problem, a, b)
    call = _Construction(problem, (a, b), arithmetic, started)
    with workers_of(executor, jobs) as pool:
        work = partial(call.run, progress, max_nodes, limits, pool)
        return keeping("branch_graph", work, call.cut_short, lambda _: "; the arcs found so far are kept")


@dataclass
class _Construction:
    """One call of branch_graph in 2D, and how far it came."""

    problem: ContactProblem
    interval: tuple[Fraction, Fraction]
    arithmetic: Arithmetic
    started: float
    way: Way | None = None
    search: IntervalSearch | None = None
    candidates: set[Codes] | None = None
    searched: float | None = None

    def run(
        self,
        progress: Callable[[str, float], object] | None,
        max_nodes: int | None,
        limits: Deadline,
        executor: Executor | None,
    ) -> BranchGraph:
        """Search, then work out arcs and join them."""
        try:
            with within(limits):
                way = self.way = way_of(self.problem, self.interval, self.arithmetic)
                search = way.search(self.interval, max_nodes, limits.deadline, _stage(progress, "search"))
                self.search = search
        except TimeOverError:
            return self._nothing(StopReason.TIME_LIMIT)
        found = way.candidates(search, executor)
        self.searched = time.perf_counter()
        self.candidates = found
        limits = limits.extended(self.started)
        with within(limits.part(_JOINED)):
            made = way.made(search, found, _stage(progress, "arcs"), limits.part(_WORKED_OUT))
        return self._graph(search, found, made)

    def cut_short(self, ending: Ending) -> BranchGraph:
        """The graph of what was found before something ended ``run``, wherever that was."""
        reason, way, search = StopReason.of(ending), self.way, self.search
        if way is None or search is None:
            return self._nothing(reason)
        if self.candidates is None and (search.stopped is None or not search.stopped.interrupted):
            search.stopped = Stop(reason, search.nodes)
        found = search.selections if self.candidates is None else self.candidates
        return self._graph(search, found, way.made(search, found, ended=reason))

    def _nothing(self, reason: StopReason) -> BranchGraph:
        """Graph without vertices and arcs, of a call that ended before the body was condensed."""
        why = f"{Stop(reason)} before the body was condensed to its contact nodes"
        given = self.problem, None, self.interval, self.arithmetic
        stats = GraphStats(seconds=time.perf_counter() - self.started)
        return BranchGraph(*given, vertices=(), arcs=(), undecided=(why,), stats=stats)

    def _graph(self, search: IntervalSearch, candidates: set[Codes], made: Made) -> BranchGraph:
        now = time.perf_counter()
        stats = GraphStats(
            pieces=len(search.pieces),
            closed=sum(found.numbers is not None for found in search.pieces),
            nodes=search.nodes,
            selections=len(candidates),
            search_seconds=(now if self.searched is None else self.searched) - self.started,
            seconds=now - self.started,
        )
        return BranchGraph(
            problem=self.problem,
            exact=made.exact,
            exact_interval=self.interval,
            arithmetic=self.arithmetic,
            vertices=tuple(made.vertices),
            arcs=tuple(made.arcs),
            undecided=(*map(str, made.stops), *made.reasons),
            stats=stats,
            pieces=tuple(search.pieces),
            make_proof=made.proof(search, self.problem),
        )


def _in_space(
    problem: ContactProblem3D,
    interval: tuple[Fraction, Fraction],
    arithmetic: Arithmetic,
    progress: Callable[[str, float], object] | None,
    max_nodes: int | None,
    limits: Deadline,
    executor: Executor | None,
) -> BranchGraph:
    """The graph of a problem in 3D."""
    from enumsol.branches.space.space_graph import space_graph  # continuation, and what only 3D needs

    if arithmetic != "verified":
        raise InvalidArgumentError(f'arithmetic is "{arithmetic}" for a problem in 3D; expected "verified"')
    for end in interval:
        problem.friction_at(end)
    return space_graph(problem, interval, progress, max_nodes, limits, executor)


def _check_floating(problem: ContactProblem, arithmetic: Arithmetic) -> None:
    """Refuse what is not there for a body that nothing holds."""
    if arithmetic == "fast":
        raise InvalidArgumentError('arithmetic is "fast" for a body that nothing holds; expected "verified" or "exact"')


def _stage(progress: Callable[[str, float], object] | None, name: str) -> Callable[[float], object] | None:
    return None if progress is None else lambda share: progress(name, share)


def _check_friction(problem: ContactProblem, a: Fraction, b: Fraction) -> None:
    """Refuse negative and huge friction inside the interval; F is affine, so the two ends suffice."""
    values = [exactly_at(end, *problem.affine_friction) for end in (a, b)]
    for node, *pair, F0, F1 in zip(problem.node_ids, *values, *problem.affine_friction, strict=True):
        for end, value in zip((a, b), pair, strict=True):
            if value < 0:
                zero = -Fraction(F0) / Fraction(F1) if F1 else end
                raise InvalidArgumentError(
                    f"friction at contact node {node} is negative in the interval: {float(value):g} at "
                    f"alpha = {float(end):g} (it is zero at alpha = {float(zero):.17g}); expected F >= 0"
                )
    for end in (a, b):
        problem.friction_at(end)
