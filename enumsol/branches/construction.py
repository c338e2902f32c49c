"""branch_graph: every solution for every alpha in an interval, as a graph of arcs (theory, section 7)."""

from __future__ import annotations

import time
from contextlib import suppress
from dataclasses import dataclass, field
from fractions import Fraction
from functools import partial
from typing import TYPE_CHECKING, Literal

import numpy as np
from flint import fmpq_mat

from enumsol.arithmetic.rationals import rational
from enumsol.branches.enclosed.following import follow_selections
from enumsol.branches.enclosed.make_traced import make_traced
from enumsol.branches.enclosed.single_branches import ClosedPieces
from enumsol.branches.enclosed.traced import TracedProblem
from enumsol.branches.exact.gluing import glue
from enumsol.branches.exact.make_elements import make_arcs, make_vertices
from enumsol.branches.graph import BranchGraph
from enumsol.branches.graph_data import GraphStats
from enumsol.branches.proof_records import write_graph_proof
from enumsol.condensation.affine import exactly_at
from enumsol.condensation.data import EXACT_DOF_LIMIT
from enumsol.condensation.enclosure import NotEnclosedError
from enumsol.condensation.exact import FAST_EXACT_DOF, ExactCondensed, check_definite
from enumsol.condensation.unloaded import never_loaded, vanishing_alpha
from enumsol.errors import Interrupted, InvalidArgumentError, TooLargeError
from enumsol.model.problem import ContactProblem
from enumsol.model.statuses import OPEN, SLIP_MINUS, SLIP_PLUS, STICK
from enumsol.search.certifiers.interval_certifiers import ExactIntervalCertifier, VerifiedIntervalCertifier
from enumsol.search.interval.floating_interval import FloatingIntervalCertifier, on_weak_springs
from enumsol.search.interval.interval_parallel import run_parallel
from enumsol.search.interval.subintervals import FastIntervalCertifier, IntervalSearch
from enumsol.search.outcome import Stop, StopReason
from enumsol.support.arguments import (
    alpha_interval,
    instance_of,
    one_of,
    optional_callable,
    optional_count,
    optional_executor,
    optional_seconds,
)
from enumsol.support.deadlines import Deadline, TimeOverError, over, within

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from concurrent.futures import Executor

    from enumsol.branches.elements import Arc, Vertex
    from enumsol.branches.enclosed.following import Followed
    from enumsol.proof.proof_file import Proof
    from enumsol.search.interval.subintervals import IntervalCertifier, SearchedPiece
    from enumsol.selections.solution import Codes
    from enumsol.support.arguments import AlphaLike
    from enumsol.support.deadlines import Limited

Arithmetic = Literal["fast", "verified", "exact"]

#: Exact algebra is not begun where it would take more than this by ``_exact_work``: some five minutes.
LARGEST_EXACT_WORK = 2**22
#: Of the time that is left when arcs are begun: for working them out, and for joining them too, where there is a limit.
#: To join them takes a fifth as long as to work them out by exact algebra, to make a graph of them another tenth.
_WORKED_OUT, _JOINED = 0.55, 0.75
#: Boxes in which arcs are followed when the search was interrupted.
_BOXES_AFTER_INTERRUPT = 500
#: Selections whose arcs are then worked out without rounding: 8 at least, or so many by p^2.
_SELECTIONS_AFTER_INTERRUPT = 4096


def branch_graph(
    problem: ContactProblem,
    interval: tuple[AlphaLike, AlphaLike],
    arithmetic: Arithmetic = "verified",
    *,
    progress: Callable[[str, float], object] | None = None,
    max_nodes: int | None = None,
    time_limit: float | None = None,
    executor: Executor | None = None,
) -> BranchGraph:
    """All solutions over an interval of alpha, as arcs glued at vertices (theory, section 7).

    A tree search over the interval gives the selections that may hold somewhere in it. Each of them is followed over
    alpha, in ball arithmetic or by the roots of integer polynomials; an arc is where it holds. Arcs are glued by the
    statuses that hold at their ends, never by comparing numbers.

    Parameters
    ----------
    problem : ContactProblem
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
    progress : callable, optional
        Called with the name of the stage ("search", "arcs") and the share of it that is done.
    max_nodes : int, optional
        Stop the search after this many nodes; the graph is then reported as incomplete.
    time_limit : float, optional
        Stop after this many seconds; the graph is then made of what was found, which takes a fifth of them and two
        seconds at most.
    executor : concurrent.futures.Executor, optional
        Searches the pieces of the interval, and parts of large ones, in its workers. The graph and its proof are those
        found without it.

    Returns
    -------
    BranchGraph

    Raises
    ------
    InvalidArgumentError
        The interval or another argument is out of range, or friction is negative somewhere in the interval (the node
        and the alpha are named).
    TooLargeError
        Exact arithmetic was asked for and the problem is too large for it.
    MissingDependencyError
        The compiled solver of the relaxations is not installed.
    Interrupted
        On Ctrl-C during the search, or while arcs are worked out; ``partial`` is the graph of what was found so far,
        which is not complete. Beyond 24 degrees of freedom only the arcs of some of the selections found are in it, if
        there are many: ``partial.reasons`` says how many.

    Examples
    --------
    >>> import enumsol
    >>> enumsol.branch_graph(enumsol.gallery.one_node_triangle(), (0, 10))
    BranchGraph for alpha in [0, 10] (verified)
    ...
    complete: yes (proven)
    """
    instance_of(problem, ContactProblem, "problem")
    a, b = (Fraction(end) for end in alpha_interval(interval))
    one_of(arithmetic, "arithmetic", ("fast", "verified", "exact"))
    if problem.modes is not None:
        _check_floating(problem, arithmetic)
    optional_callable(progress, "progress")
    optional_executor(executor)
    max_nodes, time_limit = optional_count(max_nodes, "max_nodes"), optional_seconds(time_limit)
    _check_friction(problem, a, b)
    started = time.perf_counter()
    limits = Deadline.after(started, time_limit)
    try:
        with within(limits):
            way, search = _prepared(problem, (a, b), arithmetic, max_nodes, limits, progress)
    except TimeOverError:
        late = f"{Stop(StopReason.TIME_LIMIT)} before the body was condensed to its contact nodes"
        stats = GraphStats(seconds=time.perf_counter() - started)
        return BranchGraph(problem, None, (a, b), arithmetic, vertices=(), arcs=(), undecided=(late,), stats=stats)
    candidates = _candidates(search, way, executor)
    searched = time.perf_counter()
    limits = limits.extended(started)
    stops = [] if search.stopped is None else [search.stopped]
    with within(limits.part(_JOINED)):
        made = way.made(search, candidates, _stage(progress, "arcs"), limits.part(_WORKED_OUT), stops)
    stats = GraphStats(
        pieces=len(search.pieces),
        closed=sum(found.numbers is not None for found in search.pieces),
        nodes=search.nodes,
        selections=len(candidates),
        search_seconds=searched - started,
        seconds=time.perf_counter() - started,
    )
    graph = BranchGraph(
        problem=problem,
        exact=made.exact,
        exact_interval=(a, b),
        arithmetic=arithmetic,
        vertices=tuple(made.vertices),
        arcs=tuple(made.arcs),
        undecided=(*map(str, made.stops), *made.reasons),
        stats=stats,
        pieces=tuple(search.pieces),
        make_proof=_proof(search, problem, made),
    )
    if any(stop.interrupted for stop in made.stops):
        raise Interrupted("branch_graph was interrupted; the arcs found so far are kept", graph)
    return graph


def _prepared(
    problem: ContactProblem,
    interval: tuple[Fraction, Fraction],
    arithmetic: Arithmetic,
    max_nodes: int | None,
    limits: Deadline,
    progress: Callable[[str, float], object] | None,
) -> tuple[_ByBalls | _ByAlgebra, IntervalSearch]:
    """How arcs are to be worked out, and the search over the interval.

    Raises
    ------
    TimeOverError
        The body is so large that the time was over before it was condensed.
    """
    if problem.modes is None:
        way, condensed = _way(problem, interval, arithmetic), problem.condensed
        certifier = _certifier(problem, way, arithmetic)
    else:
        way, condensed = _ByAlgebra(problem, _floating(problem)), on_weak_springs(problem)
        certifier = FloatingIntervalCertifier(problem, checkable=arithmetic == "verified")
    search = IntervalSearch(
        condensed,
        interval,
        way.origin,
        certifier,
        max_nodes=max_nodes,
        deadline=limits.deadline,
        progress=_stage(progress, "search"),
    )
    return way, search


@dataclass
class _Made:
    """Vertices and arcs, how they were found, and what cut that short."""

    vertices: Sequence[Vertex]
    arcs: Sequence[Arc]
    reasons: Sequence[str]
    stops: list[Stop]
    exact: ExactCondensed | None = None
    followed: Followed | None = None


@dataclass(frozen=True)
class _ByAlgebra:
    """Arcs as functions of alpha in rationals: nothing stays open but what the time does not suffice for."""

    problem: ContactProblem
    exact: ExactCondensed
    followed: Followed | None = None

    @property
    def origin(self) -> Fraction | None:
        """The alpha at which g vanishes."""
        return self.exact.zero

    def close(self, search: IntervalSearch) -> None:
        """No piece is known that needs no tree."""

    def made(
        self,
        search: IntervalSearch,
        candidates: set[Codes],
        tick: Callable[[float], object] | None,
        limits: Limited,
        stops: list[Stop],
    ) -> _Made:
        """Arcs worked out by the deadline of ``limits``; what is not joined by the one that holds here stays open."""
        a, b = (rational(end) for end in search.interval)
        # after Ctrl-C only as much as takes a moment
        few = max(8, _SELECTIONS_AFTER_INTERRUPT // self.problem.p**2)
        most = few if any(stop.interrupted for stop in stops) else None
        gluing = glue(self.exact, candidates, a, b, tick, cut_short=bool(stops), most=most, limits=limits)
        stops += [] if gluing.stopped is None else [gluing.stopped]
        arcs = make_arcs(gluing)
        return _Made(make_vertices(gluing, arcs), arcs, gluing.reasons, stops, self.exact, self.followed)


@dataclass(frozen=True)
class _ByBalls:
    """Arcs in ball arithmetic; by algebra where balls leave something open and that does not take too long."""

    traced: TracedProblem
    closed: ClosedPieces = field(default_factory=ClosedPieces)
    exact: None = None

    @property
    def origin(self) -> Fraction | None:
        """The alpha at which g vanishes."""
        return self.traced.origin

    def close(self, search: IntervalSearch) -> None:
        """Find pieces that need no tree, while there is time."""
        search.closed = self.closed.pieces
        with suppress(TimeOverError), within(Deadline(search.deadline)):
            self.closed.find(self.traced)

    def made(
        self,
        search: IntervalSearch,
        candidates: set[Codes],
        tick: Callable[[float], object] | None,
        limits: Limited,
        stops: list[Stop],
    ) -> _Made:
        """Arcs followed by the deadline of ``limits``; see ``_ByAlgebra.made``."""
        problem = self.traced.problem
        followed = follow_selections(
            self.traced,
            search.pieces,
            tick,
            known=self.closed.traces,
            cut_short=bool(stops),
            # after Ctrl-C only as much as takes a moment
            most=_BOXES_AFTER_INTERRUPT if any(stop.interrupted for stop in stops) else None,
            limits=limits,
        )
        joined = followed.joined
        stops += [] if followed.stopped is None else [followed.stopped]
        large = over() or problem.n > EXACT_DOF_LIMIT or _exact_work(problem, candidates) > LARGEST_EXACT_WORK
        if (joined.ordered and not joined.open) or stops or large:
            return _Made(*make_traced(self.traced, joined), followed.reasons, stops, followed=followed)
        # several conditions vanish at one alpha, or a selection is singular
        algebra = _ByAlgebra(problem, ExactCondensed.from_problem(problem), followed)
        return algebra.made(search, candidates, tick, limits, stops)


def _way(problem: ContactProblem, interval: tuple[Fraction, Fraction], arithmetic: Arithmetic) -> _ByBalls | _ByAlgebra:
    """How arcs are worked out: by algebra where that is fast, and where balls cannot hold the data."""
    large = arithmetic == "verified" and problem.n > FAST_EXACT_DOF
    at_rest = large and never_loaded(problem)
    if large and not at_rest and (traced := _traced(problem, interval)) is not None:
        return _ByBalls(traced)
    if arithmetic != "exact" and problem.n > (EXACT_DOF_LIMIT if at_rest else FAST_EXACT_DOF):
        return _ByAlgebra(problem, ExactCondensed.from_condensed(problem))
    exact = ExactCondensed.from_problem(problem)
    if not problem.condensed.definite:
        check_definite(exact.S)
    return _ByAlgebra(problem, exact)


def _floating(problem: ContactProblem) -> ExactCondensed:
    """The body that nothing holds in rationals; refused if its stiffness on springs is not positive definite."""
    exact, size = ExactCondensed.floating(problem), 2 * problem.p
    if not problem.on_springs.condensed.definite:
        check_definite(fmpq_mat([list(row[:size]) for row in exact.rows[:size]]))
    return exact


def _check_floating(problem: ContactProblem, arithmetic: Arithmetic) -> None:
    """Refuse what is not there for a body that nothing holds."""
    if arithmetic == "fast":
        raise InvalidArgumentError('arithmetic is "fast" for a body that nothing holds; expected "verified" or "exact"')
    if problem.n > EXACT_DOF_LIMIT:
        raise TooLargeError(
            f"branch_graph follows a body that nothing holds in rationals, up to n = {EXACT_DOF_LIMIT} degrees of "
            f"freedom, and the problem has n = {problem.n}; condense the body to its contact nodes first, or use "
            "multiplicity_table"
        )


def _exact_work(problem: ContactProblem, candidates: set[Codes]) -> int:
    """What exact algebra of selections costs, roughly, in units of 7e-5 s: (slips whose friction varies + 1) size^3.

    Measured with wedges of 6 to 32 contact nodes and 40 to 170 degrees of freedom.
    """
    varying = np.array(problem.friction[1]) != 0
    codes = np.array(sorted(candidates), dtype=np.intp).reshape(-1, problem.p)
    slips = np.sum(((codes == SLIP_PLUS) | (codes == SLIP_MINUS)) & varying, axis=1)
    sizes = np.sum(codes != OPEN, axis=1) + np.sum(codes == STICK, axis=1)
    return int(np.sum((slips + 1) * sizes**3))


def _traced(problem: ContactProblem, interval: tuple[Fraction, Fraction]) -> TracedProblem | None:
    """The problem in balls; None where its data cannot be enclosed."""
    try:
        return TracedProblem(problem, interval, vanishing_alpha(problem, "problem"))
    except NotEnclosedError:
        return None


def _certifier(problem: ContactProblem, way: _ByBalls | _ByAlgebra, arithmetic: Arithmetic) -> IntervalCertifier:
    if arithmetic == "exact" and way.exact is not None:
        return ExactIntervalCertifier(way.exact)
    if arithmetic == "fast":
        return FastIntervalCertifier()
    return VerifiedIntervalCertifier(problem, way.exact, way.origin)


def _candidates(search: IntervalSearch, way: _ByBalls | _ByAlgebra, executor: Executor | None) -> set[Codes]:
    """The selections that may hold somewhere; Ctrl-C keeps those that were found."""
    if way.exact is not None and way.exact.unloaded:
        # lambda = 0 is the only solution at every alpha, and every selection holds there: one is enough
        return {(OPEN,) * way.exact.p}
    try:
        way.close(search)
        if executor is None:
            search.run()
        else:
            run_parallel(executor, search)
    except KeyboardInterrupt:
        search.stopped = Stop(StopReason.INTERRUPTED, search.nodes)
    return search.selections


def _proof(search: IntervalSearch, problem: ContactProblem, made: _Made) -> Callable[[], Proof | None] | None:
    """What makes the proof, once it is asked for; None when there is none, or the time was over."""
    exact = made.exact
    if not search.checkable or not search.pieces or any(not stop.interrupted for stop in made.stops):
        return None
    if search.stopped is not None:
        return None
    if exact is None or exact.condensed_exactly:
        return partial(_proof_of_problem, problem, search.interval, search.pieces, made.followed)
    return partial(write_graph_proof, problem, search.interval, "condensed", search.pieces, None)


def _proof_of_problem(
    problem: ContactProblem,
    interval: tuple[Fraction, Fraction],
    pieces: Sequence[SearchedPiece],
    followed: Followed | None,
) -> Proof | None:
    """The proof for the problem's own data, with the arcs where they can be followed in balls."""
    if followed is None and problem.modes is None and (traced := _traced(problem, interval)) is not None:
        followed = follow_selections(traced, pieces)
    whole = followed is None or followed.stopped is None
    return write_graph_proof(problem, interval, "problem", pieces, followed if whole else None)


def _stage(progress: Callable[[str, float], object] | None, name: str) -> Callable[[float], object] | None:
    return None if progress is None else lambda share: progress(name, share)


def _check_friction(problem: ContactProblem, a: Fraction, b: Fraction) -> None:
    """Refuse negative and huge friction inside the interval; F is affine, so the two ends suffice."""
    values = [exactly_at(end, *problem.friction) for end in (a, b)]
    for node, *pair, F0, F1 in zip(problem.node_ids, *values, *problem.friction, strict=True):
        for end, value in zip((a, b), pair, strict=True):
            if value < 0:
                zero = -Fraction(F0) / Fraction(F1) if F1 else end
                raise InvalidArgumentError(
                    f"friction at contact node {node} is negative in the interval: {float(value):g} at "
                    f"alpha = {float(end):g} (it is zero at alpha = {float(zero):.17g}); expected F >= 0"
                )
    for end in (a, b):
        problem.friction_at(end)
