"""enumerate_roots: every solution at one alpha (theory, sections 2-5); is_unique: whether there is only one.

The oracle for small p solves all 4^p selections, block by block.
"""

from __future__ import annotations

import math
import time
from itertools import product
from math import prod
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from enumsol.errors import InvalidArgumentError, TooLargeError
from enumsol.model.contact_body import ContactBody
from enumsol.model.problem import ContactProblem
from enumsol.model.statuses import FINAL, INEQUALITIES, OPEN, SLIP_MINUS, SLIP_PLUS, STICK
from enumsol.roots.components import (
    RootBuilder,
    RootComponent,
    apart,
    closed_component,
    connected_components,
    in_order,
    named,
    root_family,
)
from enumsol.roots.enumeration import Enumeration, not_begun
from enumsol.roots.root_set import RootSet
from enumsol.search.certifiers.protocol import UndecidedPart
from enumsol.search.outcome import SearchLimits, SearchProgress, Stop, StopReason
from enumsol.search.solvers import BEYOND_DOUBT, Arithmetic, Solvers
from enumsol.selections.float_selections import SIGN_TOLERANCE
from enumsol.selections.solution import SelectionSolution, SelectionSolver
from enumsol.support import arguments
from enumsol.support.deadlines import Deadline, TimeOverError, keeping, look, within
from enumsol.support.messages import counted
from enumsol.support.workers import workers_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from concurrent.futures import Executor
    from pathlib import Path

    from typing_extensions import TypeIs

    from enumsol.condensation.condensed import ScaledSystem
    from enumsol.model.problem3d import AnyProblem, ContactProblem3D
    from enumsol.roots.root import Root, RootFamily
    from enumsol.support.array_types import Alpha, AlphaLike, Codes, Floats, Mask, NDArray
    from enumsol.support.deadlines import Ending


#: Selections solved together in floats, and between two reports of progress.
BLOCK = 2048


def all_codes(F_positive: tuple[bool, ...]) -> Iterator[Codes]:
    """Every selection: four statuses per node, two (open, in contact) where F = 0."""
    return product(*(FINAL[positive] for positive in F_positive))


def refuse_if_too_large(F_positive: tuple[bool, ...], limit: int, per_second: float) -> int:
    """Number of selections.

    Raises
    ------
    TooLargeError
        There are more than ``limit``; the message estimates the cost.
    """
    count = prod(len(FINAL[positive]) for positive in F_positive)
    if count > limit:
        hours = count / per_second / 3600
        raise TooLargeError(
            f'method="exhaustive" would solve {count:.3g} selections (about {hours:.3g} hours); the limit is {limit} '
            'selections: use method="tree"'
        )
    return count


def exhaustive_float(system: ScaledSystem, solver: SelectionSolver) -> Iterator[tuple[int, SelectionSolution | None]]:
    """Selections examined so far with a solution found, or with None after every block; in floats.

    A vectorised solve screens every block; what it cannot refuse clearly (all conditions nearly hold, or the matrix is
    nearly singular) is decided by ``solver``.
    """
    total = refuse_if_too_large(solver.F_positive, 4**11, 20_000.0)
    codes = all_codes(solver.F_positive)
    done = 0
    while done < total:
        block = np.array([next(codes) for _ in range(min(BLOCK, total - done))], dtype=np.int8)
        for row in block[_candidates(system, block)]:
            look()
            solution = solver.solve(tuple(int(c) for c in row))
            if solution is not None:
                yield done, solution
        done += len(block)
        yield done, None


def _candidates(system: ScaledSystem, block: NDArray[np.int8]) -> Mask:
    """Mask of the selections of a block that may hold a root."""
    p, F, S, g = system.p, system.F, system.S, system.g
    M, b = selection_systems(S, g, F, block)
    # rows and columns of comparable size, so that the reciprocal condition means something
    scale = np.max(np.abs(M), axis=2)
    M /= scale[:, :, None]
    singular = np.linalg.svd(M, compute_uv=False)
    # with a smaller reciprocal condition the screen does not trust a float solution
    doubtful = singular[:, -1] <= 1e-9 * singular[:, 0]
    M[doubtful] = np.eye(2 * p)
    force = np.linalg.solve(M, (b / scale)[:, :, None])[:, :, 0]
    w = g - force @ S
    size = BEYOND_DOUBT * (1.0 + np.max(np.abs(force), axis=1, keepdims=True))
    n, t, wn, wt = force[:, :p], force[:, p:], w[:, :p], w[:, p:]
    reach = F * n * (1 + BEYOND_DOUBT) + size
    rows = [n + size, t, reach - t, reach + t, size - wn, wt + size, size - wt]  # in the order of RowKind
    broken = INEQUALITIES[block] & (np.stack(rows, axis=-1) < 0)
    return np.asarray(doubtful | ~np.any(broken, axis=(1, 2)))


def exhaustive_exact(solver: SelectionSolver) -> Iterator[tuple[int, SelectionSolution | None]]:
    """Selections examined so far with the last one's solution, or None; in rationals, one linear solve each."""
    refuse_if_too_large(solver.F_positive, 4**7, 1_000.0)
    for done, codes in enumerate(all_codes(solver.F_positive), start=1):
        yield done, solver.solve(codes)


def selection_systems(S: Floats, g: Floats, F: Floats, codes: NDArray[np.int8]) -> tuple[Floats, Floats]:
    """Linear systems M lambda = b of condensed selections (theory, section 2.3).

    Parameters
    ----------
    S, g, F : condensed compliance (2p, 2p), displacements (2p,) and friction (p,)
    codes : (k, p) integer array of status codes

    Returns
    -------
    M : (k, 2p, 2p) array
    b : (k, 2p) array
        Rows: lambda_n = 0 and lambda_t = 0 (open); w_n = 0 and w_t = 0 (stick); w_n = 0 and lambda_t = +-F lambda_n.
    """
    k, p = codes.shape
    node = np.arange(p)
    closed, stick = codes != OPEN, codes == STICK
    slip = np.where(codes == SLIP_PLUS, 1.0, 0.0) - np.where(codes == SLIP_MINUS, 1.0, 0.0)
    M = np.zeros((k, 2 * p, 2 * p))
    held = np.concatenate([closed, stick], axis=1)
    M += held[:, :, None] * S
    M[:, np.arange(2 * p), np.arange(2 * p)] += ~held
    M[:, p + node, node] -= slip * F
    return M, held * g


Method = Literal["tree", "exhaustive"]


def enumerate_roots(
    problem: AnyProblem,
    alpha: AlphaLike,
    arithmetic: Arithmetic = "verified",
    method: Method = "tree",
    executor: Executor | None = None,
    jobs: int | None = None,
    progress: Callable[[SearchProgress], object] | None = None,
    stop_after: int | None = None,
    max_nodes: int | None = None,
    time_limit: float | None = None,
    proof_path: str | Path | None = None,
    *,
    resume: bool = False,
    tolerance: float = SIGN_TOLERANCE,
    engine: str | None = None,
) -> RootSet:
    """All solutions of the problem at one alpha.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
        In 3D: arithmetic "verified" or "fast", method "tree", and coefficients that do not depend on the solution.
    alpha : float, Fraction, any other real number, or str
        The parameter, read as the exact number that it is; a text is a fraction such as "8/3" or a decimal number,
        which is read as float64.
    arithmetic : {"verified", "fast", "exact"}
        "verified": every root is enclosed and every excluded selection proven by rigorous error bounds for the data as
        given, in rationals where a sign cannot be decided otherwise; what stays open is listed. "fast": float64 with a
        tolerance, never claimed to be complete. "exact": the data are read as exact rationals and everything is
        decided without rounding (small problems).
    method : {"tree", "exhaustive"}
        "tree": pruned search (theory, section 5.4). "exhaustive": all 4^p selections, the oracle for small p.
    executor : concurrent.futures.Executor, optional
        Runs parts of the tree in parallel (method "tree"): roots and proof do not depend on the number of workers. What
        a worker that died had to do is done again, by others or in this process, with a RuntimeWarning.
    jobs : int, optional
        Number of processes that work, instead of an ``executor``; a script then needs ``if __name__ == "__main__":``.
    progress : callable, optional
        Called regularly with a SearchProgress.
    stop_after : int, optional
        Stop when this many roots and families are found; 2 decides about uniqueness.
    max_nodes : int, optional
        Stop after this many nodes of the tree (selections, for the exhaustive method).
    time_limit : float, optional
        Stop after this many seconds; the result is then made of what was found, which takes a fifth of them and two
        seconds at most.
    proof_path : path, optional
        Stream the proof to this file (arithmetic "verified"); by default it is kept, compressed, in memory.
    resume : bool
        Resume from the proof that an earlier search, stopped or killed, left at ``proof_path``. All that it holds is
        proven again; limits apply to what is searched anew. The file is replaced as soon as the new one holds as much.
        Without such a file the search starts from nothing.
    tolerance : float
        For arithmetic "fast": see enumsol.selections.float_selections.SIGN_TOLERANCE.
    engine : {"active-set", "clarabel"}, optional
        Solver of the relaxations; by default the compiled active-set method with clarabel as its fallback.

    Returns
    -------
    RootSet

    Raises
    ------
    InvalidArgumentError
        An argument is out of range, or the file to be resumed belongs to another search.
    TooLargeError
        The exhaustive method or exact arithmetic would take too long; the message says how long.
    Interrupted, OutOfMemoryError
        On Ctrl-C, or where the memory does not suffice; ``partial`` holds what was found.
    OutputError
        There was no space to write the whole proof; ``partial`` holds the result without it.

    Examples
    --------
    >>> import enumsol
    >>> enumsol.enumerate_roots(enumsol.gallery.one_node_triangle(), alpha=5)
    RootSet at alpha = 5: 3 roots (verified, tree)
           index regular    margin max lambda_n  contact
         0    +1     yes  2.04e-01            0  open
         1    -1     yes  6.24e-01      0.33333  slip-
         2    +1     yes  2.70e-01          1.5  stick
    index: the sign of a determinant; regular: no node is between two statuses
    margin: distance to the next change of status, relative to the largest values
    index sum: +1
    complete: yes (proven)
    """
    if not _is_in_space(problem):
        arguments.instance_of(problem, ContactProblem, "problem")
    started, value = time.perf_counter(), arguments.alpha_value(alpha)
    arguments.one_of(arithmetic, "arithmetic", ("fast", "verified", "exact"))
    arguments.one_of(method, "method", ("tree", "exhaustive"))
    arguments.one_of(engine, "engine", (None, "active-set", "clarabel"))
    arguments.optional_executor(executor, jobs)
    arguments.optional_callable(progress, "progress")
    counts = arguments.optional_count(stop_after, "stop_after"), arguments.optional_count(max_nodes, "max_nodes")
    seconds, tolerance = arguments.optional_seconds(time_limit), arguments.share(tolerance)
    if _is_in_space(problem):
        # not for problems in 2D
        from enumsol.roots.space_roots import SpaceEnumeration, check_supported
        from enumsol.search.space.space_search import SpaceSolvers

        check_supported(arithmetic, method, engine)
    _check_proof(arithmetic, method, proof_path, resume)
    search: Enumeration[Any] | None = None

    def nothing(stop: StopReason) -> RootSet:
        return not_begun(problem, value, arithmetic, method, time.perf_counter() - started, stop)

    def work() -> RootSet:
        nonlocal search
        try:
            with within(Deadline.after(started, seconds)):
                if _is_in_space(problem):
                    in_space = SpaceSolvers(problem, value, arithmetic)
                    _ = in_space.enclosed  # before a file is begun
                    search = SpaceEnumeration(in_space, progress, proof_path, resumed=resume, started=started)
                else:
                    solvers = Solvers(problem, value, arithmetic, tolerance, engine)
                    _ = solvers.enclosed  # as above
                    search = _Enumeration(solvers, progress, proof_path, method=method, resumed=resume, started=started)
        except TimeOverError:
            return nothing(StopReason.TIME_LIMIT)
        with workers_of(executor, jobs) as pool:
            return search.run(pool, *counts, seconds)

    def rest(ending: Ending) -> RootSet:
        return nothing(StopReason.of(ending)) if search is None else search.cut_short(ending)

    return keeping("enumerate_roots", work, rest, lambda found: f"; {counted(len(found), 'root')} so far")


def is_unique(problem: AnyProblem, alpha: AlphaLike, **options: Any) -> bool | None:
    """True if the problem has one solution at one alpha, False if it has not, both proven; None when that stayed open.

    True if all selections are accounted for and one solution is left: by one certificate where that serves (theory,
    section 6.11), otherwise by the search. False as soon as two solutions are proven, or a continuum. The search then
    stops, so that False often costs little.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
    alpha : float, Fraction, any other real number, or str
        As for `enumerate_roots`.
    **options
        Of `enumerate_roots`, but for ``stop_after``. ``RootSet.unique`` of its result is this answer, and the result
        tells what stayed open. Arithmetic "fast" proves nothing and gives None.

    Returns
    -------
    bool or None

    Raises
    ------
    InvalidArgumentError, TooLargeError, Interrupted, OutputError
        As `enumerate_roots`.

    Examples
    --------
    >>> import enumsol
    >>> problem = enumsol.gallery.two_node_square()
    >>> enumsol.is_unique(problem, 1), enumsol.is_unique(problem, 3.5), enumsol.is_unique(problem, 3.5, max_nodes=1)
    (True, False, None)
    """
    return enumerate_roots(problem, alpha, stop_after=2, **options).unique


def _is_in_space(problem: object) -> TypeIs[ContactProblem3D]:
    """True if it is a problem in 3D, whose class is not loaded for others."""
    return isinstance(problem, ContactBody) and not isinstance(problem, ContactProblem)


def _in_doubt(core: Codes) -> UndecidedPart:
    hint = "perturb the load, or take problem.at_contact_nodes() of a body that is held"
    return UndecidedPart(core, "a root in it may be the same as another one", hint, examined=True)


def _not_joined(codes: Codes, stop: Stop) -> UndecidedPart:
    when = "the search was ended" if stop.interrupted else "the time was over"
    reason = f"{when} before it was known with which others its solution is connected"
    ended = stop if stop.interrupted else Stop(StopReason.TIME_LIMIT)
    return UndecidedPart(codes, reason, ended.remedy, examined=True)


def _alone(solution: SelectionSolution) -> bool:
    """True if no other selection's solution is connected with it, or it is distinguished from these in another way."""
    return solution.possible is not None or (solution.strict and solution.det_sign != 0)


class _Enumeration(Enumeration[Solvers]):
    """One call of enumerate_roots in 2D."""

    #: Closed roots that may be the same as others.
    doubtful: Sequence[Codes] = ()

    def _enough(self, stop_after: int) -> Callable[[list[Any]], bool]:
        known = [0, 0]

        def enough(solutions: list[Any]) -> bool:
            # several selections may hold at one root: count roots, and only when something was added
            if len(solutions) >= stop_after and len(solutions) != known[0]:
                known[:] = [len(solutions), sum(len(part) for part, _ in self._components())]
            return known[1] >= stop_after

        return enough

    def _examined(self) -> int:
        return self.outcome.nodes + self.outcome.selections

    def _search(self, limits: SearchLimits, executor: Executor | None) -> None:
        if self.method == "exhaustive":
            try:
                with within(limits):
                    self._exhaustive(limits)
            except TimeOverError:
                self.outcome.stopped = Stop(StopReason.TIME_LIMIT)
        else:
            super()._search(limits, executor)

    def _exhaustive(self, limits: SearchLimits) -> None:
        outcome, reported = self.outcome, self.started
        floats, exact = self.solvers.floats, self.solvers.exact if self.arithmetic == "exact" else None
        stream = exhaustive_float(self.solvers.scaled, floats) if exact is None else exhaustive_exact(exact)
        total = math.prod(4 if positive else 2 for positive in (exact or floats).F_positive)
        for outcome.selections, solution in stream:
            if solution is not None:
                outcome.solutions.append(solution)
            now = time.perf_counter()
            due = now - reported > 0.1 or (solution is None and outcome.selections % BLOCK == 0)
            if self.progress is not None and (due or outcome.selections == total):
                reported = now
                share = outcome.selections / total
                state = SearchProgress(outcome.selections, share, len(outcome.solutions), now - self.started)
                self.progress(state)
            if solution is not None and limits.enough is not None and limits.enough(outcome.solutions):
                outcome.stopped = Stop(StopReason.ENOUGH_ROOTS)
            elif limits.max_nodes is not None and limits.max_nodes <= outcome.selections < total:
                outcome.stopped = Stop(StopReason.NODE_LIMIT, limits.max_nodes, "selection")
            elif limits.over and outcome.selections < total:
                outcome.stopped = Stop(StopReason.TIME_LIMIT)
            if outcome.stopped is not None:
                return

    def _joined(self) -> list[tuple[list[RootComponent], SelectionSolver]]:
        """Components of what was found, before the time is over; then of what belongs to no others in any case."""
        outcome = self.outcome
        try:
            if not outcome.late:
                return self._components()
        except TimeOverError:
            outcome.late = True
        stop = outcome.stopped = outcome.stopped or Stop(StopReason.TIME_LIMIT)
        left = [_not_joined(s.codes, stop) for s in outcome.solutions if not _alone(s)]
        alone = list(filter(_alone, outcome.solutions))
        outcome.undecided, outcome.solutions = [*outcome.undecided, *left], alone
        return self._components()

    def _continua(self) -> list[Codes]:
        """Complete selections that hold on the families of which solutions were found."""
        families = (c for components, _ in self._components() for c in components if c.dimension > 0)
        return [solution.codes for family in families for solution in family.solutions]

    def _components(self) -> list[tuple[list[RootComponent], SelectionSolver]]:
        """Components of the root set with the solver whose points they hold."""
        solutions, closed, self.doubtful = apart(self.outcome.solutions)
        exact, floats = [s for s in solutions if s.exact], [s for s in solutions if not s.exact]
        perturbed = self.solvers.floats if self.problem.held else None
        parts: list[tuple[list[RootComponent], SelectionSolver]] = []
        if floats or closed:
            components = connected_components(floats, self.solvers.floats, perturbed)
            parts.append(([*components, *map(closed_component, closed)], self.solvers.floats))
        if exact and self.solvers.exact is not None:
            parts.append((connected_components(exact, self.solvers.exact, perturbed), self.solvers.exact))
        return parts

    def _root(self, component: RootComponent, values: SelectionSolver) -> Root:
        solvers, verified = self.solvers, self.certifier.certified.verified
        about = self.problem, self.alpha, values, solvers.floats, verified, solvers.rigid_unit
        return RootBuilder(*about).root(component)

    def _result(self) -> RootSet:
        outcome, solvers = self.outcome, self.solvers
        roots: list[Root] = []
        families: list[RootFamily] = []
        separate, joinable = 0, False
        if self.unloaded:
            roots, separate = [self._rest()], 1
        for components, solver in self._joined():
            # what joins a component that was not examined whole is not known
            separate += sum(c.whole for c in components)
            joinable = joinable or not all(c.whole for c in components)
            roots += [self._root(c, solver) for c in components if c.dimension == 0]
            proven = solver is not solvers.floats
            families += [root_family(self.alpha, c, solver, proven=proven) for c in components if c.dimension > 0]
        roots, families = in_order(roots, families)
        whole = outcome.stopped is None and not outcome.undecided and not self.doubtful
        separate -= len(self.doubtful)
        undecided = [named(part) for part in [*outcome.undecided, *map(_in_doubt, self.doubtful)]]
        at_least = None if whole else self._at_least(separate + int(joinable))
        return self._root_set(roots, undecided, at_least, solvers.data, families)


def roots_of_selections(problem: ContactProblem, alpha: Alpha, selections: Sequence[Codes], *, whole: bool) -> RootSet:
    """The roots that complete selections are proven to have at one alpha (arithmetic "verified", without a proof).

    Parameters
    ----------
    problem : ContactProblem
    alpha : float or Fraction
    selections : codes of complete selections
    whole : no others hold
    """
    solvers = Solvers(problem, alpha, "verified", SIGN_TOLERANCE)
    search = _Enumeration(solvers, None, None, method="graph")
    search.writer, search.unloaded, outcome = None, solvers.unloaded(), search.outcome
    for codes in () if search.unloaded else selections:
        outcome.selections += 1
        found = search.certifier.selection(codes)
        if isinstance(found, UndecidedPart):
            outcome.undecided.append(found)
        elif found is not None:
            outcome.solutions.append(found)
    if not whole:
        outcome.stopped = Stop(StopReason.GRAPH_INCOMPLETE)
    return search._result()


def _check_proof(arithmetic: str, method: str, proof_path: str | Path | None, resume: bool) -> None:
    arguments.instance_of(resume, bool, "resume")
    if resume and proof_path is None:
        raise InvalidArgumentError("resume is True without proof_path; expected the file of the proof to resume from")
    if method == "exhaustive" and arithmetic == "verified":
        raise InvalidArgumentError(
            'method is "exhaustive" with arithmetic "verified"; expected "fast" or "exact" arithmetic for the oracle'
        )
    if proof_path is not None and arithmetic != "verified":
        raise InvalidArgumentError(
            f'proof_path is given with arithmetic {arithmetic!r}; expected "verified", which alone writes proofs'
        )
    if proof_path is not None:
        arguments.file_path(proof_path, "proof_path")
