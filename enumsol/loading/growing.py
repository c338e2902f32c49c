"""histories: every history of solutions that a sequence of loads may leave behind (theory, section 13).

Increments are halved until the statuses along all histories no longer change, if that is asked for.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import networkx as nx
import numpy as np

from enumsol.condensation.enclosure import NotEnclosedError
from enumsol.errors import InvalidArgumentError
from enumsol.loading.history import History
from enumsol.loading.history_data import (
    Refinement,
    Rounding,
    Stage,
    case_of,
    contact_displacements,
    start_after,
)
from enumsol.loading.steps import LoadStep, steps_of, way_to
from enumsol.model.problem import check_is_problem
from enumsol.model.restart import SlipStart, restarted
from enumsol.roots.enumerate import enumerate_roots
from enumsol.roots.root import Root
from enumsol.search.outcome import Stop, StopReason
from enumsol.support import arguments
from enumsol.support.deadlines import Deadline, TimeOverError, keeping, within
from enumsol.support.messages import counted
from enumsol.support.workers import workers_of

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from enumsol.loading.history_data import Node
    from enumsol.model.problem3d import AnyProblem
    from enumsol.roots.root_set import RootSet
    from enumsol.roots.stability import Stability
    from enumsol.support.array_types import Alpha
    from enumsol.support.deadlines import Ending

    #: Of a parent's root (None in the first step) and the roots of the next step, those that are followed.
    Choice = Callable[[Root | None, RootSet], Any]
    #: The statuses of all nodes at the given steps along one history.
    Shape = tuple[tuple[Any, ...], ...]


#: Advice on a step in 3D whose start is not known closely enough.
_CURE = "change the load of this step slightly, or hold the body by stiffer springs"
#: Of ``follow``: all roots but those that run away.
_RESTING = "not running away"
#: Histories that are compared at most.
_MOST = 20_000


def refined(
    grown: Callable[[Sequence[LoadStep]], History],
    steps: Sequence[LoadStep],
    way: tuple[LoadStep, LoadStep],
    most: int,
) -> History:
    """The history with the finest increments that were tried: the first of which halving changed nothing, halved.

    ``way``: from where to where the load goes in the first step.
    """
    history = grown(steps)
    changes: list[int] = []
    reason = _incomparable(history)
    while reason is None and len(changes) < most and (not changes or changes[-1]):
        parts = 2 ** (len(changes) + 1)
        finer = grown(halved(steps, way, parts))
        reason = _incomparable(finer)
        if reason is None:
            changes.append(_changed(shapes(history, parts // 2), shapes(finer, parts), len(steps)))
            history = finer
    settled = bool(changes) and changes[-1] == 0
    return replace(history, refinement=Refinement(len(changes), settled, tuple(changes), reason))


def halved(steps: Sequence[LoadStep], way: tuple[LoadStep, LoadStep], parts: int) -> list[LoadStep]:
    """Every step in so many equal parts; ``way``: from where to where the load goes in the first one."""
    found: list[LoadStep] = []
    for (start, end), step in zip([way, *pairwise(steps)], steps, strict=True):
        found += [start.between(end, Fraction(k, parts)) for k in range(1, parts)]
        found.append(step)
    return found


def shapes(history: History, every: int) -> set[Shape]:
    """The statuses along the histories, seen after every so many steps."""
    statuses = nx.get_node_attributes(history.graph, "statuses")
    return {tuple(statuses[node] for node in path if node[0] % every == 0) for path in history.paths()}


def _changed(one: set[Shape], other: set[Shape], steps: int) -> int:
    """The first step up to which two sets of histories have different statuses; 0 where they have the same."""
    for number in range(1, steps + 1):
        if {shape[:number] for shape in one} != {shape[:number] for shape in other}:
            return number
    return 0


def _incomparable(history: History) -> str | None:
    """Why comparing a history would tell nothing about its increments, or None."""
    if history.counts[-1] > _MOST:
        return f"there are {history.counts[-1]} histories, too many to compare (at most {_MOST})"
    return history.reasons[0] if history.reasons else None


#: Options of enumerate_roots that a history has for the whole of it, or cannot have.
_OWN = ("stop_after", "proof_path", "resume", "alpha", "method")


@dataclass(frozen=True)
class HistoryProgress:
    """State of a running history, as handed to the ``progress`` callback.

    Attributes
    ----------
    step, steps : int
        The step that is searched, and how many there are.
    stages, waiting : int
        Starts of this step that were searched, and those that are left.
    roots : int
        Roots found so far, in all steps.
    seconds : float

    Examples
    --------
    >>> import enumsol
    >>> seen = []
    >>> history = enumsol.histories(enumsol.gallery.one_node_triangle(), [1, 5], progress=seen.append)
    >>> [(state.step, state.roots) for state in seen]
    [(1, 1), (2, 2)]
    """

    step: int
    steps: int
    stages: int
    waiting: int
    roots: int
    seconds: float


def histories(
    problem: AnyProblem,
    steps: object,
    *,
    arithmetic: str = "verified",
    follow: str | Choice = "all",
    merge: float | None = None,
    refine: bool = False,
    max_halvings: int = 4,
    max_branches: int | None = None,
    max_nodes: int | None = None,
    time_limit: float | None = None,
    executor: Executor | None = None,
    jobs: int | None = None,
    progress: Callable[[HistoryProgress], object] | None = None,
    **options: Any,
) -> History:
    """All histories of solutions that a sequence of loads may leave behind (theory, section 13).

    Every root of a step starts the next step: its tangential displacements are the next step's slip offset, so that
    slip is counted from where the nodes are. The first step starts from the problem's own slip offset.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
    steps : sequence, array, or pandas.DataFrame
        The ends of the steps: alphas of the problem's own load path; loads of shape (n,), or all in one array (k, n);
        `LoadStep` objects; or a table with the columns alpha, friction, or f0 .. f{n-1} (components of the load that
        replace the problem's).
    arithmetic : {"verified", "fast", "exact"}
        Of `enumerate_roots`. "verified": starts are known as balls, and a step is complete only if it is so for every
        start in its ball. "exact": starts are rationals (2D only). "fast" proves nothing, and a body that nothing
        holds does not have it.
    follow : {"all", "nearest", "not running away"} or callable
        Which roots start the next step. "nearest": the one whose contact nodes are nearest to where the step began.
        "not running away": all but those that are proven to run away (see `stability`; the problem needs a mass or a
        mesh). Undecided ones are followed, and the printed history names them. A callable gets the root before (None in
        the first step) and the RootSet, and returns roots or their numbers.
    merge : float, optional
        Roots of a step whose contact nodes are nowhere further apart than this [length] start one stage together, from
        a ball that holds both ends (from the first of both in fast arithmetic). By default, and in exact arithmetic,
        only equal ends are merged.
    refine : bool
        Halve all increments until the statuses along all histories, seen at the given steps, no longer change. In the
        first step the load grows from zero. ``History.refinement`` says what came of it, and from which step on the
        statuses depend on the increments.
    max_halvings : int
        Of ``refine``.
    max_branches : int, optional
        Follow at most this many different starts from any step, those of the first roots.
    max_nodes : int, optional
        Stop when the searches of all steps together have had this many nodes of their trees.
    time_limit : float, optional
        Stop after this many seconds; what was found by then is kept.
    executor : concurrent.futures.Executor, optional
        Of `enumerate_roots`: its workers share each search. The starts of a step are searched one after the other, so
        that limits and ends are counted in one order.
    jobs : int, optional
        Number of processes that work, instead of an ``executor``; a script then needs ``if __name__ == "__main__":``.
    progress : callable, optional
        Called with a HistoryProgress after every search.
    **options
        Further keyword arguments of `enumerate_roots`: ``tolerance``, ``engine``.

    Returns
    -------
    History

    Raises
    ------
    InvalidArgumentError
        An argument cannot be used; of a step its number is named.
    Interrupted, OutOfMemoryError
        On Ctrl-C, or where the memory does not suffice; ``partial`` is the history as far as it was found.

    Examples
    --------
    One node is pressed, pulled to one side until it slips, and let go:

    >>> import enumsol
    >>> import numpy as np
    >>> problem = enumsol.ContactProblem(np.eye(2), [[1, 0]], [[0, 1]], [1, 0], friction=0.5, load_slope=[0, 1])
    >>> history = enumsol.histories(problem, [0.25, 1, 0])
    >>> print(history)
    History of 3 steps: 1 history (verified)
    step      alpha  roots  from  histories  dissipated
       1       0.25      1     1          1           0
       2          1      1     1          1        0.25
       3          0      1     1          1        0.25
    tree
    1.0 stick
    2.0 slip+
    3.0 stick
    complete: yes (proven), unique until step 3
    """
    given: Any = problem
    check_is_problem(given)
    arguments.one_of(arithmetic, "arithmetic", ("fast", "verified", "exact"))
    if not callable(follow):
        arguments.one_of(follow, "follow", ("all", "nearest", _RESTING))
        if follow == _RESTING:
            from enumsol.roots.stability import Stabilities  # sparse graphs and solvers come with it

            Stabilities(problem)  # refused before the search
    tolerance = None if merge is None else arguments.nonnegative_number(merge, "merge")
    if tolerance is not None and arithmetic == "exact":
        raise InvalidArgumentError('merge is given with arithmetic "exact", in which only equal ends are merged')
    for name in _OWN:
        if name in options:
            raise InvalidArgumentError(f"{name} is an option of enumerate_roots that histories does not take")
    arguments.instance_of(refine, bool, "refine")
    arguments.optional_executor(executor, jobs)
    arguments.optional_callable(progress, "progress")
    counts = arguments.optional_count(max_branches, "max_branches"), arguments.optional_count(max_nodes, "max_nodes")
    limits = _Limits(Deadline.after(time.perf_counter(), arguments.optional_seconds(time_limit)).deadline, *counts)
    fitted = steps_of(problem, steps)
    with workers_of(executor, jobs) as pool:
        search = {"arithmetic": arithmetic, "executor": pool, **options}

        begun = [_Growing(problem, fitted, follow, tolerance, limits, search, progress)]
        halvings = arguments.optional_count(max_halvings, "max_halvings") or 0

        def grown(several: Sequence[LoadStep]) -> History:
            begun.append(_Growing(problem, several, follow, tolerance, limits, search, progress))
            return begun[-1].run()

        def work() -> History:
            if not refine:
                return grown(fitted)
            return refined(grown, fitted, way_to(problem, fitted[0]), halvings)

        def rest(ending: Ending) -> History:
            return begun[-1].history(str(Stop(StopReason.of(ending))))

        return keeping("histories", work, rest, lambda _: begun[-1].so_far)


@dataclass
class _Limits(Deadline):
    max_branches: int | None = None
    max_nodes: int | None = None
    started: float = field(default_factory=time.perf_counter)
    nodes: int = 0

    def reached(self) -> str | None:
        """Why nothing more is searched, or None."""
        if self.max_nodes is not None and self.nodes >= self.max_nodes:
            return f"stopped after max_nodes = {counted(self.max_nodes, 'node')}"
        return "stopped by the time limit" if self.over else None

    def left(self) -> dict[str, Any]:
        """Nodes and time that one search may still take, as options of enumerate_roots."""
        seconds = self.remaining()
        nodes = None if self.max_nodes is None else self.max_nodes - self.nodes
        return {"max_nodes": nodes, "time_limit": None if seconds is None else max(seconds, 1e-3)}


@dataclass
class _Waiting:
    """A start that is to be searched, and the nodes whose ends it is."""

    start: SlipStart
    parents: list[Node]


class _Growing:
    """One history while it is made."""

    def __init__(
        self,
        problem: AnyProblem,
        steps: Sequence[LoadStep],
        follow: str | Choice,
        merge: float | None,
        limits: _Limits,
        search: dict[str, Any],
        progress: Callable[[HistoryProgress], object] | None,
    ) -> None:
        self.problem, self.steps, self.follow, self.merge = problem, steps, follow, merge
        self.limits, self.search, self.progress = limits, search, progress
        self.stages: list[Stage] = []
        self.parents: list[tuple[Node, ...]] = []  # of each stage
        self.followed: set[Node] = set()
        self.reasons: list[str] = []
        self.rounding = Rounding()
        self.node_of: dict[int, list[Node]] = {}  # of each stage, in the order of its roots
        self.bases: dict[bytes, Any] = {}
        self.ends: dict[Any, SlipStart] = {}

    def run(self) -> History:
        """Step by step, all starts of one before the next."""
        if self.search["arithmetic"] != "fast":
            with suppress(NotEnclosedError):
                _ = self.problem.on_springs.enclosure  # made once, for all steps
        waiting = [_Waiting(SlipStart.of(self.problem), [])]
        for number, step in enumerate(self.steps, 1):
            waiting = self._step(number, step, waiting)
            if not waiting:
                break
        if self.follow == _RESTING:
            for stage in self.stages:
                self._verdicts(stage)
        return self.history()

    @property
    def so_far(self) -> str:
        """Words on the step that was reached and the number of roots so far."""
        found = counted(sum(len(stage.roots) for stage in self.stages), "root")
        return f" in step {self.stages[-1].step if self.stages else 1}; {found} so far"

    def _step(self, number: int, step: LoadStep, waiting: list[_Waiting]) -> list[_Waiting]:
        """Search a step from all its starts; the starts of the next step."""
        following: list[_Waiting] = []
        count = 0
        for k, item in enumerate(waiting):
            if (why := self.limits.reached()) is not None:
                self.reasons.append(f"step {number}: {why}, {counted(len(waiting) - k, 'start')} not searched")
                break
            stage = self._stage(number, step, item)
            nodes = [(number, count + j) for j in range(len(stage.roots))]
            count += len(nodes)
            # added before the stage itself, so that an interruption leaves no stage without them
            self.parents[len(self.stages) :] = [tuple(item.parents)]
            self.node_of[stage.number] = nodes
            self.stages.append(stage)
            whence = f" from root {', '.join(map(named, item.parents))}" if item.parents else ""
            self.reasons += [f"step {number}{whence}: {reason}" for reason in stage.reasons]
            if number < len(self.steps):
                self._ends(stage, item, nodes, following)
            if self.progress is not None:
                roots = sum(len(other.roots) for other in self.stages)
                seconds = time.perf_counter() - self.limits.started
                left = len(waiting) - k - 1
                self.progress(HistoryProgress(number, len(self.steps), k + 1, left, roots, seconds))
        most = self.limits.max_branches
        if most is not None and len(following) > most:
            self.reasons.append(f"step {number}: max_branches = {most} of {len(following)} different ends are followed")
            following = following[:most]
        self.followed.update(node for item in following for node in item.parents)
        return following

    def _stage(self, number: int, step: LoadStep, item: _Waiting) -> Stage:
        problem = restarted(self._base(step), item.start)
        alpha = step.exact_alpha if step.alpha is None else step.alpha
        roots = enumerate_roots(problem, alpha, **self.search, **self.limits.left())
        self.limits.nodes += roots.stats.nodes + roots.stats.selections
        return Stage(len(self.stages), number, item.start, roots, problem, self._open(problem, alpha, roots, item))

    def _base(self, step: LoadStep) -> Any:
        """The problem with the step's load and friction, made once for all steps that have the same."""
        key = b"|".join(b"" if part is None else part.tobytes() for part in (step.load, step.friction))
        if key not in self.bases:
            start = SlipStart.of(self.problem)
            self.bases[key] = restarted(self.problem, start, step.load, step.friction)
        return self.bases[key]

    def _open(self, problem: AnyProblem, alpha: Alpha, roots: RootSet, item: _Waiting) -> tuple[str, ...]:
        """Why a stage is not complete, in words."""
        reasons = []
        if roots.families:
            found = counted(len(roots.families), "family", "families")
            reasons.append(f"{found} of solutions, which are not followed")
        if roots.stopped is not None:
            reasons.append(roots.stopped)
        elif roots.undecided:
            reasons.append(self._undecided(problem, alpha, roots, item))
        return tuple(reasons)

    def _undecided(self, problem: AnyProblem, alpha: Alpha, roots: RootSet, item: _Waiting) -> str:
        first = roots.undecided[0]
        text = f"{counted(len(roots.undecided), 'part')} undecided ({first.reason})"
        if item.start.radius is None or self.search["arithmetic"] != "verified":
            return text
        radius = float(np.max(item.start.radius))
        middle = restarted(problem, SlipStart(item.start.offset))
        alone = enumerate_roots(middle, alpha, **self.search, **self.limits.left())
        self.limits.nodes += alone.stats.nodes + alone.stats.selections
        known = f"its start is known within {radius:.1e} only"
        if not alone.complete:
            return f"{text}; {known}, and its midpoint alone leaves something undecided, too"
        # in 3D there is no exact arithmetic
        cure = 'arithmetic "exact" may decide it' if item.start.offset.ndim == 1 else _CURE
        return f"{text}, because {known}: its midpoint alone is decided; {cure}"

    def _ends(self, stage: Stage, item: _Waiting, nodes: list[Node], following: list[_Waiting]) -> None:
        """Add where the followed roots of a stage leave the contact nodes to the starts of the next step."""
        chosen = self._chosen(stage, item)
        why = "it runs away" if self.follow == _RESTING else "by the user's choice"
        for k, (root, node) in enumerate(zip(stage.roots, nodes, strict=True)):
            if k not in chosen:
                self.reasons.append(f"step {stage.step}: root {named(node)} is not followed, {why}")
                continue
            case = case_of(stage, root)
            start = self.ends.get(case) if case is not None else None
            start = start or start_after(stage, root, self.rounding)
            if start is None:
                self.reasons.append(f"step {stage.step}: root {named(node)} is known too little to start another step")
                continue
            if case is not None:
                self.ends[case] = start
            for other in following:
                joined = self._joined(other.start, start)
                if joined is not None:
                    other.start = joined
                    other.parents.append(node)
                    break
            else:
                following.append(_Waiting(start, [node]))

    def _joined(self, one: SlipStart, other: SlipStart) -> SlipStart | None:
        """The start of both, if they are equal or within the user's tolerance."""
        if one.key == other.key:
            return one
        if self.merge is None or np.max(np.abs(one.offset - other.offset)) > self.merge:
            return None
        return one if self.search["arithmetic"] == "fast" else one.hull(other)

    def _chosen(self, stage: Stage, item: _Waiting) -> set[int]:
        roots = stage.roots
        if self.follow == "all" or not len(roots):
            return set(range(len(roots)))
        if self.follow == _RESTING:
            verdicts = self._verdicts(stage)
            return {k for k in range(len(roots)) if verdicts is None or verdicts[k].verdict != "runs away"}
        before = self._root(item.parents[0]) if item.parents else None
        if self.follow == "nearest":
            start = np.zeros(len(contact_displacements(stage.problem, roots[0])))
            if before is not None:
                start = contact_displacements(before.problem, before)
            far = [float(np.linalg.norm(contact_displacements(stage.problem, root) - start)) for root in roots]
            return {int(np.argmin(far))}
        assert callable(self.follow)
        return _numbers(self.follow(before, roots), roots)

    def _verdicts(self, stage: Stage) -> Sequence[Stability] | None:
        """The verdicts on the roots of a stage, or None where the time is over."""
        try:
            with within(self.limits):
                return stage.roots.stability()
        except TimeOverError:
            return None

    def _root(self, node: Node) -> Root:
        stage = next(s for s in self.stages if node in self.node_of[s.number])
        return stage.roots[self.node_of[stage.number].index(node)]

    def history(self, *more: str) -> History:
        """Histories found so far, with more reasons why something may be missing."""
        return History(
            self.problem,
            tuple(self.steps),
            self.search["arithmetic"],
            tuple(self.stages),
            tuple(self.parents[: len(self.stages)]),
            frozenset(self.followed),
            (*self.reasons, *more),
            time.perf_counter() - self.limits.started,
        )


def named(node: Node) -> str:
    """A node as it is printed: its step and its number in it."""
    return f"{node[0]}.{node[1]}"


def _numbers(answer: object, roots: RootSet) -> set[int]:
    """The numbers of the roots that a callable chose.

    Raises
    ------
    InvalidArgumentError
        It returned something else.
    """
    items = [answer] if isinstance(answer, Root) or arguments.exact_number(answer) is not None else answer
    found = set()
    for item in items if isinstance(items, Iterable) else (items,):
        own = [k for k, root in enumerate(roots) if root is item]
        number = arguments.exact_number(item) if not own else own[0]
        if number is None or number != int(number) or not 0 <= number < len(roots):
            raise InvalidArgumentError(
                f"follow returned {arguments.shown(item)}; "
                "expected roots of the RootSet that it was given, or their numbers"
            )
        found.add(int(number))
    return found
