"""The ways in which a graph is worked out: what is searched, what certifies it, and how arcs are followed.

By balls, where the problem can be enclosed; by algebra in rationals, where that is fast or balls leave something open.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Literal

import numpy as np
from flint import fmpq_mat

from enumsol.arithmetic.rationals import rational
from enumsol.branches.enclosed.following import Followed, TracedProblem, follow_selections
from enumsol.branches.enclosed.make_traced import make_traced
from enumsol.branches.enclosed.single_branches import ClosedPieces
from enumsol.branches.exact.gluing import glue
from enumsol.branches.exact.known_selections import KnownSelections
from enumsol.branches.exact.make_elements import make_arcs, make_vertices
from enumsol.branches.proof_records import write_graph_proof
from enumsol.condensation.data import EXACT_DOF_LIMIT
from enumsol.condensation.enclosure import NotEnclosedError
from enumsol.condensation.exact import FAST_EXACT_DOF, ExactCondensed, check_definite
from enumsol.condensation.unloaded import never_loaded, vanishing_alpha
from enumsol.errors import TooLargeError
from enumsol.model.statuses import OPEN, SLIP_MINUS, SLIP_PLUS, STICK
from enumsol.search.certifiers.interval_certifiers import ExactIntervalCertifier, VerifiedIntervalCertifier
from enumsol.search.interval.interval_parallel import run_parallel
from enumsol.search.interval.subintervals import (
    FastIntervalCertifier,
    FloatingIntervalCertifier,
    IntervalSearch,
    on_weak_springs,
)
from enumsol.search.outcome import Stop, StopReason
from enumsol.support.deadlines import Deadline, Limited, TimeOverError, over, within

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from concurrent.futures import Executor
    from fractions import Fraction

    from enumsol.branches.elements import Arc, Vertex
    from enumsol.branches.enclosed.cutting import Trace
    from enumsol.condensation.condensed import CondensedProblem
    from enumsol.model.problem import ContactProblem
    from enumsol.proof.proof_file import Proof
    from enumsol.search.interval.subintervals import IntervalCertifier, SearchedPiece
    from enumsol.support.array_types import Codes

    #: Told the share of the work that is done.
    Tick = Callable[[float], object]

Arithmetic = Literal["fast", "verified", "exact"]

#: Exact algebra is not begun where it would take more than this by ``_exact_work``: some five minutes.
LARGEST_EXACT_WORK = 3 * 10**9
#: Boxes in which arcs are followed when the search was interrupted.
_BOXES_AFTER_INTERRUPT = 500
#: Selections whose arcs are then worked out without rounding: 8 at least, or so many by p^2.
_SELECTIONS_AFTER_INTERRUPT = 4096


@dataclass
class Made:
    """Vertices and arcs, how they were found, and what cut that short."""

    vertices: Sequence[Vertex]
    arcs: Sequence[Arc]
    reasons: Sequence[str]
    stops: list[Stop]
    exact: ExactCondensed | None = None
    followed: Followed | None = None

    def proof(self, search: IntervalSearch, problem: ContactProblem) -> Callable[[], Proof | None] | None:
        """Function that makes the proof once it is asked for; None when there is none, or the time was over."""
        if not search.checkable or not search.pieces or any(not stop.interrupted for stop in self.stops):
            return None
        if search.stopped is not None:
            return None
        if self.exact is None or self.exact.condensed_exactly:
            return partial(_proof_of_problem, problem, search.interval, search.pieces, self.followed)
        return partial(write_graph_proof, problem, search.interval, "condensed", search.pieces, None)


class Way:
    """Base of the ways: the search over the interval, and the selections that it leaves.

    A way keeps the arcs that it has worked out, so that an interruption loses none of them.

    Attributes
    ----------
    problem : ContactProblem
    condensed : CondensedProblem
        What the relaxations of the search are about.
    certifier : IntervalCertifier
    origin : Fraction or None
        The alpha at which g vanishes.
    exact : ExactCondensed or None
        The problem in rationals, where arcs are worked out by algebra.
    """

    problem: ContactProblem
    certifier: IntervalCertifier
    exact: ExactCondensed | None

    @property
    def condensed(self) -> CondensedProblem:
        """System of the relaxations of the search: the body, or that on weak springs (theory, section 14.8)."""
        return self.problem.condensed if self.problem.held else on_weak_springs(self.problem)

    @property
    def origin(self) -> Fraction | None:
        """The alpha at which g vanishes."""
        raise NotImplementedError

    def search(
        self,
        interval: tuple[Fraction, Fraction],
        max_nodes: int | None,
        deadline: float | None,
        progress: Callable[[float], object] | None,
    ) -> IntervalSearch:
        """The search over the interval, not begun yet."""
        problem, leaves, origin = self.condensed, self.certifier, self.origin
        return IntervalSearch(
            problem, interval, origin, leaves, max_nodes=max_nodes, deadline=deadline, progress=progress
        )

    def candidates(self, search: IntervalSearch, executor: Executor | None) -> set[Codes]:
        """The selections that may hold somewhere."""
        if self.exact is not None and self.exact.unloaded:
            # lambda = 0 is the only solution at every alpha, and every selection holds there: one is enough
            return {(OPEN,) * self.exact.p}
        self.close(search)
        if executor is None:
            search.run()
        else:
            run_parallel(executor, search)
        return search.selections

    def close(self, search: IntervalSearch) -> None:
        """Find pieces that need no tree, while there is time; none are known here."""

    def made(
        self,
        search: IntervalSearch,
        candidates: set[Codes],
        tick: Tick | None = None,
        limits: Limited | None = None,
        ended: StopReason | None = None,
    ) -> Made:
        """Arcs worked out by the deadline of ``limits``; what is not joined by the one that holds here stays open.

        After an interruption, ``ended``, they are those that were worked out; some more if the search was interrupted.
        """
        raise NotImplementedError


def _some(search: IntervalSearch, ended: StopReason | None, few: int) -> int | None:
    """Number of arcs, or of boxes of them, to work out (None: all); after an interruption only a few."""
    if ended is None:
        return None
    return few if search.stopped is not None and search.stopped.interrupted else 0


@dataclass
class ByAlgebra(Way):
    """Arcs as functions of alpha in rationals: nothing stays open but what the time does not suffice for."""

    problem: ContactProblem
    exact: ExactCondensed
    certifier: IntervalCertifier
    followed: Followed | None = None
    known: KnownSelections | None = None

    @classmethod
    def of(cls, problem: ContactProblem, exact: ExactCondensed, arithmetic: Arithmetic) -> ByAlgebra:
        """With the certifier of an arithmetic."""
        certifier: IntervalCertifier = FastIntervalCertifier()
        if not problem.held:
            certifier = FloatingIntervalCertifier(problem, checkable=arithmetic == "verified")
        elif arithmetic == "exact":
            certifier = ExactIntervalCertifier(exact)
        elif arithmetic == "verified":
            certifier = VerifiedIntervalCertifier(problem, exact)
        return cls(problem, exact, certifier)

    @property
    def origin(self) -> Fraction | None:
        """The alpha at which g vanishes."""
        return self.exact.zero

    def made(
        self,
        search: IntervalSearch,
        candidates: set[Codes],
        tick: Tick | None = None,
        limits: Limited | None = None,
        ended: StopReason | None = None,
    ) -> Made:
        """See ``Way.made``."""
        if self.known is None:
            a, b = (rational(end) for end in search.interval)
            self.known = KnownSelections(self.exact, a, b, cut_short=search.stopped is not None)
        few = max(8, _SELECTIONS_AFTER_INTERRUPT // self.problem.p**2)
        gluing = glue(self.known, candidates, tick, most=_some(search, ended, few), limits=limits, ended=ended)
        stops = [stop for stop in (search.stopped, gluing.stopped) if stop is not None]
        arcs = make_arcs(gluing)
        return Made(make_vertices(gluing, arcs), arcs, gluing.reasons, stops, self.exact, self.followed)


class ByBalls(Way):
    """Arcs in ball arithmetic; by algebra where balls leave something open and that does not take too long.

    Parameters
    ----------
    traced : TracedProblem
    """

    exact = None

    def __init__(self, traced: TracedProblem) -> None:
        self.problem, self.traced, self.closed = traced.problem, traced, ClosedPieces()
        self._traces: list[Trace] = []
        self._algebra: ByAlgebra | None = None
        if self.problem.held:
            self.certifier = VerifiedIntervalCertifier(traced.problem, None, traced.origin)
        else:
            self.certifier = FloatingIntervalCertifier(traced.problem, checkable=True)

    @property
    def origin(self) -> Fraction | None:
        """The alpha at which g vanishes."""
        return self.traced.origin

    def close(self, search: IntervalSearch) -> None:
        """Find pieces that need no tree, while there is time."""
        if not self.problem.held:
            return
        search.closed = self.closed.pieces
        with suppress(TimeOverError), within(Deadline(search.deadline)):
            self.closed.find(self.traced)

    def made(
        self,
        search: IntervalSearch,
        candidates: set[Codes],
        tick: Tick | None = None,
        limits: Limited | None = None,
        ended: StopReason | None = None,
    ) -> Made:
        """See ``Way.made``."""
        if self._algebra is not None:
            return self._algebra.made(search, candidates, tick, limits, ended)
        problem = self.problem
        followed = follow_selections(
            self.traced,
            search.pieces,
            tick,
            known=self.closed.traces,
            done=self._traces,
            cut_short=search.stopped is not None,
            most=_some(search, ended, _BOXES_AFTER_INTERRUPT),
            limits=limits,
            ended=ended,
        )
        joined = followed.joined
        stops = [stop for stop in (search.stopped, followed.stopped) if stop is not None]
        large = over() or problem.n > EXACT_DOF_LIMIT or _exact_work(problem, candidates) > LARGEST_EXACT_WORK
        if (joined.ordered and not joined.open) or stops or large:
            return Made(*make_traced(self.traced, joined), followed.reasons, stops, followed=followed)
        # several conditions vanish at one alpha, or a selection is singular
        self._algebra = ByAlgebra(problem, ExactCondensed.from_problem(problem), self.certifier, followed)
        return self._algebra.made(search, candidates, tick, limits)


def way_of(problem: ContactProblem, interval: tuple[Fraction, Fraction], arithmetic: Arithmetic) -> Way:
    """The way for a problem: by algebra where that is fast, and where balls cannot hold the data.

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
        return ByBalls(traced)
    if held and arithmetic != "exact" and problem.n > (EXACT_DOF_LIMIT if at_rest else FAST_EXACT_DOF):
        return ByAlgebra.of(problem, ExactCondensed.from_condensed(problem), arithmetic)
    if large and not held and problem.n > EXACT_DOF_LIMIT:
        raise TooLargeError(
            "the stiffness of the body on springs is positive definite only within rounding, and exact algebra takes "
            f"at most n = {EXACT_DOF_LIMIT} degrees of freedom; the problem has n = {problem.n}"
        )
    exact, size = ExactCondensed.from_problem(problem), 2 * problem.p
    if not problem.on_springs.condensed.definite:
        check_definite(fmpq_mat([list(row[:size]) for row in exact.rows[:size]]))
    return ByAlgebra.of(problem, exact, arithmetic)


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
