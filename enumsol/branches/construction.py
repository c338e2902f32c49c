"""branch_graph: every solution for every alpha in an interval, as a graph of arcs (theory, section 7)."""

from __future__ import annotations

import time
from dataclasses import dataclass, fields, replace
from fractions import Fraction
from functools import partial
from typing import TYPE_CHECKING

from enumsol.branches.graph import BranchGraph
from enumsol.branches.ways import Arithmetic, PlaneWay, not_condensed, way_of
from enumsol.condensation.data import exactly_at
from enumsol.errors import InvalidArgumentError
from enumsol.model.problem import ContactProblem, check_is_problem
from enumsol.search.outcome import StopReason
from enumsol.support import arguments
from enumsol.support.deadlines import Deadline, TimeOverError, keeping, within
from enumsol.support.workers import workers_of

if TYPE_CHECKING:
    from collections.abc import Callable
    from concurrent.futures import Executor

    from enumsol.branches.graph_data import GraphData
    from enumsol.branches.space.space_graph import ByCurves
    from enumsol.model.problem3d import AnyProblem
    from enumsol.support.array_types import AlphaLike
    from enumsol.support.deadlines import Ending


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
    _check_arithmetic(problem, arithmetic)
    if isinstance(problem, ContactProblem):
        _check_friction(problem, a, b)
    for end in (a, b):
        problem.friction_at(end)
    call = _Construction(problem, (a, b), arithmetic, started)
    kept = "arcs" if isinstance(problem, ContactProblem) else "curves"
    with workers_of(executor, jobs) as pool:
        work = partial(call.run, progress, max_nodes, limits, pool)
        return keeping("branch_graph", work, call.cut_short, lambda _: f"; the {kept} found so far are kept")


@dataclass
class _Construction:
    """A call of branch_graph, and how far it came."""

    problem: AnyProblem
    interval: tuple[Fraction, Fraction]
    arithmetic: Arithmetic
    started: float
    way: PlaneWay | ByCurves | None = None
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
                way = self.way = self._way()
        except TimeOverError:
            return self._graph(self._nothing(StopReason.TIME_LIMIT))
        way.run(max_nodes, limits, _stage(progress, "search"), executor)
        self.searched = time.perf_counter()
        return self._graph(way.made(limits.extended(self.started), _stage(progress, "arcs")))

    def _way(self) -> PlaneWay | ByCurves:
        if isinstance(self.problem, ContactProblem):
            return way_of(self.problem, self.interval, self.arithmetic)
        from enumsol.branches.space.space_graph import ByCurves  # continuation, and what only 3D needs

        return ByCurves(self.problem, self.interval)

    def cut_short(self, ending: Ending) -> BranchGraph:
        """The graph of what was found before something ended ``run``, wherever that was."""
        reason = StopReason.of(ending)
        return self._graph(self._nothing(reason) if self.way is None else self.way.ended(reason))

    def _nothing(self, reason: StopReason) -> GraphData:
        return not_condensed(self.problem, self.interval, self.arithmetic, reason)

    def _graph(self, made: GraphData) -> BranchGraph:
        now = time.perf_counter()
        searched = (now if self.searched is None else self.searched) - self.started
        parts = {item.name: getattr(made, item.name) for item in fields(made)}
        return BranchGraph(
            **parts | {"stats": replace(made.stats, search_seconds=searched, seconds=now - self.started)}
        )


def _check_arithmetic(problem: AnyProblem, arithmetic: Arithmetic) -> None:
    """Refuse what is not there in 3D, and for a body that nothing holds."""
    if not isinstance(problem, ContactProblem) and arithmetic != "verified":
        raise InvalidArgumentError(f'arithmetic is "{arithmetic}" for a problem in 3D; expected "verified"')
    if not problem.held and arithmetic == "fast":
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
