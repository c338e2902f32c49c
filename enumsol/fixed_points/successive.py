"""Successive approximations for Coulomb friction: fixed points of Psi (theory, section 11.3; paper, Section 3).

Anderson's mixing of the last iterates may speed them up.
"""

from __future__ import annotations

import time
from collections import deque
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.fixed_points.result import FixedPoint, Outcome
from enumsol.fixed_points.system import ContactSystem, checked_problem
from enumsol.fixed_points.tresca import node_values, scaled_unknowns, slips_of, solve_scaled
from enumsol.fixed_points.tresca_solvers import TrescaData, TrescaNotFeasible, TrescaNotSolved
from enumsol.model.problem3d import ContactProblem3D, warn_of_jumps
from enumsol.support.arguments import optional_callable, positive_integer, positive_number
from enumsol.support.array_arguments import real_array
from enumsol.support.deadlines import keeping
from enumsol.support.messages import counted

if TYPE_CHECKING:
    from collections.abc import Callable

    from enumsol.fixed_points.system import Problem
    from enumsol.support.array_types import AlphaLike, Floats


class AndersonMixing:
    """x_(k+1) = Psi(x_k) - sum_j gamma_j (Psi(x_(j+1)) - Psi(x_j)), gamma of least squares over the residuals.

    Parameters
    ----------
    depth : int
        Differences that are kept; 0 is plain iteration.
    """

    def __init__(self, depth: int) -> None:
        self._residuals: deque[Floats] = deque(maxlen=depth + 1)
        self._images: deque[Floats] = deque(maxlen=depth + 1)
        self._least = np.inf

    def next(self, x: Floats, image: Floats) -> Floats:
        """The next iterate after x with Psi(x) = image; its entries are not negative."""
        residual = image - x
        size = float(np.linalg.norm(residual))
        if size > 10.0 * self._least:
            self._residuals.clear()
            self._images.clear()
        self._least = min(self._least, size)
        self._residuals.append(residual)
        self._images.append(image)
        if len(self._residuals) < 2:
            return image
        steps = np.diff(np.array(self._residuals), axis=0).T
        # differences of residuals that depend on each other to this degree are dropped
        gamma = np.linalg.lstsq(steps, residual, rcond=1e-10)[0]
        return np.maximum(image - np.diff(np.array(self._images), axis=0).T @ gamma, 0.0)


#: Small increments are rounding if none of so many following ones is smaller.
_PATIENCE = 20


@dataclass(frozen=True)
class FixedPointProgress:
    """State of running successive approximations, as handed to the ``progress`` callback.

    Attributes
    ----------
    iteration : int
        Tresca problems solved so far.
    increment : float
        Last increment relative to the tolerance: converged at 1.
    seconds : float
        Wall time so far.
    """

    iteration: int
    increment: float
    seconds: float


def successive_approximations(
    problem: Problem,
    alpha: AlphaLike,
    start: object = None,
    tolerance: float = 1e-10,
    max_iterations: int = 1000,
    anderson: int = 0,
    progress: Callable[[FixedPointProgress], object] | None = None,
) -> FixedPoint:
    """A solution of the contact problem with Coulomb friction as a limit of Tresca problems (theory, section 11.3).

    Every iterate solves the Tresca problem whose slip bounds are the normal forces of the one before, and whose
    coefficients, where they depend on the solution, are those at its slips. Convergence is certain only where Psi
    contracts (`lipschitz_estimate`); every limit is a solution, but others may exist.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
    alpha : float, Fraction or str
        Parameter of friction and load.
    start : None, float, (p,) array_like, pair, or object with lambda_n and u_t
        Slip bounds to begin with [force]; None is 0, a first iterate without friction, and of a body that nothing holds
        the normal forces of the body whose nodes stick whatever the forces are. A pair gives slip bounds and
        slips [length]; a root, a FixedPoint or a TrescaSolution gives its own.
    tolerance : float
        Converged when the distance from the limit, estimated by the last increment and the contraction seen (theory,
        section 11.7), is at most this fraction: of normal forces in the norm of (theory, (11.4)) of the load's, and
        each of the largest; where coefficients depend on the slips, also of slips of the largest, and of coefficients
        of the largest one. What S loses by rounding is corrected until it changes no force by more.
    max_iterations : int
    anderson : int
        Depth of Anderson's mixing; 0 is plain iteration. With mixing, limits may be fixed points that repel Psi.
    progress : callable or None
        Called with a FixedPointProgress after every iteration.

    Returns
    -------
    FixedPoint
        Of the last iterate; ``converged`` and ``why`` say how it ended. Of a body that nothing holds it has
        ``rigid_coordinates`` and ``rigid_displacement``, which may exceed ``max_rigid_displacement``; its outcome may
        be "not feasible": no forces within the slip bounds that the iteration came to hold the body (theory, section
        14.10).

    Raises
    ------
    InvalidArgumentError
        An argument is not of the stated form, or alpha makes a coefficient negative.
    InvalidProblemError
        A friction function returns something else than finite numbers >= 0.
    NotHeldError
        Some rigid displacement of a body that nothing holds moves no contact node.
    Interrupted, OutOfMemoryError
        On Ctrl-C, or where the memory does not suffice; ``partial`` is the FixedPoint of the last iterate.

    Warns
    -----
    FrictionJumpWarning
        A coefficient that depends on the slip seems to jump.

    Examples
    --------
    >>> import enumsol
    >>> problem = enumsol.gallery.one_node_triangle()
    >>> for start in (0, 10):  # two of the three solutions at alpha = 5
    ...     limit = enumsol.successive_approximations(problem, 5, start)
    ...     print(limit.outcome, [str(status) for status in limit.statuses], limit.lambda_n.round(9))
    converged ['open'] [0.]
    converged ['stick'] [1.5]
    """
    body = checked_problem(problem)
    tolerance = positive_number(tolerance, "tolerance")
    limit = positive_integer(max_iterations, "max_iterations")
    depth = positive_integer(anderson, "anderson", least=0, most=1000)
    optional_callable(progress, "progress")
    system = ContactSystem.at(body, alpha)
    return _Iteration(system, tolerance, depth, progress).run(start, limit)


class _Iteration:
    def __init__(
        self,
        system: ContactSystem,
        tolerance: float,
        depth: int,
        progress: Callable[[FixedPointProgress], object] | None,
    ) -> None:
        self.system, self.tolerance, self.progress = system, tolerance, progress
        body = system.problem
        self.depends = isinstance(body, ContactProblem3D) and body.depends_on_solution
        areas = body.areas if isinstance(body, ContactProblem3D) and body.areas is not None else np.ones(body.p)
        self.slip_weights = np.sqrt(areas) * system.length
        # sqrt(work) of the scaled system: the product of the force and the length factor is the same at every node
        self.work = float(np.sqrt(system.force[0] * system.length[0]))
        self.depth, self.mixing = depth, AndersonMixing(depth)
        self.recent: deque[Floats] = deque(maxlen=13)  # cycles of up to 12
        self.increments: list[tuple[float, float]] = []
        self.sizes: list[float] = []
        self.largest_slip = 0.0
        self.rounding = float("nan")
        self.motion: Floats | None = None
        self.started = time.perf_counter()

    def run(self, start: object, limit: int) -> FixedPoint:
        system = self.system
        self.bound, self.slip = self._start(start)
        self.data = TrescaData(system, self.bound, system.coefficients(self.slip))
        given = hasattr(start, "lambda_t")
        self.x = scaled_unknowns(system, start) if given else np.zeros(system.m + system.modes)
        return keeping(
            "successive_approximations",
            partial(self._iterated, start, limit),
            lambda _: self._result(Outcome.INTERRUPTED, None),
            lambda found: f" after {counted(found.iterations, 'iteration')}",
        )

    def _iterated(self, start: object, limit: int) -> FixedPoint:
        system = self.system
        outcome, period = Outcome.ROUNDING, None
        try:
            if start is None and system.modes:
                outcome = Outcome.NOT_HELD
                unbounded = np.full(system.p, 1e100)  # no force reaches it
                self.x, _, _ = solve_scaled(replace(self.data, bound=unbounded), self.x)
                self.bound, self.slip = self._image()
                outcome = Outcome.ROUNDING
            # one or two corrections for the rounding of S are enough unless it is almost singular
            for _ in range(6):
                ended, period = self._iterate(limit)
                better = self._rounding(ended)
                settled = ended is Outcome.CONVERGED and self.rounding <= self.tolerance
                if settled or ended not in (Outcome.CONVERGED, Outcome.ROUNDING):
                    outcome = ended
                    break
                self.system = better
                self.recent.clear()
                self.sizes.clear()
                self.mixing = AndersonMixing(self.depth)
        except TrescaNotFeasible as error:
            self.motion = error.motion
            outcome = Outcome.NOT_HELD if outcome is Outcome.NOT_HELD else Outcome.NOT_FEASIBLE
        except TrescaNotSolved:
            outcome = Outcome.NOT_SOLVED
        return self._result(outcome, period)

    def _iterate(self, limit: int) -> tuple[Outcome, int | None]:
        """Outcome of the iteration with this system, and the length of a cycle."""
        while len(self.increments) < limit:
            self.data = TrescaData(self.system, self.bound, self.system.coefficients(self.slip))
            self.x, _, _ = solve_scaled(self.data, self.x)
            image, image_slip = self._image()
            if self._increment(self.data, self.slip, image, image_slip) <= 1.0:
                return Outcome.CONVERGED, None
            if self._stalled():
                return Outcome.ROUNDING, None
            period = self._period(np.concatenate([image, image_slip] if self.depends else [image]))
            if period is not None:
                return Outcome.CYCLE, period
            self.bound, self.slip = self._next(self.bound, self.slip, image, image_slip)
        return Outcome.ITERATION_LIMIT, None

    def _rounding(self, ended: Outcome) -> ContactSystem:
        """The corrected system; ``rounding`` becomes what rounding changes a force by, relative to the largest."""
        better, change = self.system.corrected(self.x)
        unit = np.tile(self.system.force, 1 + self.system.tangents)
        largest = float(np.max(np.abs(self.x[: self.system.m] * unit)))
        moved = float(np.max(np.maximum(np.abs(change), self.system.noise(self.x)) * unit))
        self.rounding = moved / largest if largest > 0 else 0.0
        if ended is Outcome.ROUNDING:
            self.rounding = max(self.rounding, *self.sizes[-_PATIENCE:])
        return better

    def _start(self, start: object) -> tuple[Floats, Floats]:
        """Scaled slip bounds and slips to begin with."""
        system, p = self.system, self.system.p
        slip: Any = 0.0
        if start is None:
            bound: Any = 0.0
        elif hasattr(start, "lambda_n") and hasattr(start, "u_t"):
            bound = np.maximum(real_array(start.lambda_n, "lambda_n of start", error=InvalidArgumentError), 0.0)
            slip = slips_of(start, p, "start")
        elif isinstance(start, tuple) and len(start) == 2 and any(np.ndim(part) == 1 for part in start):
            bound, slip = start
        else:
            bound = start
        return (
            system.scaled(node_values(bound, "start", p), system.force, "start"),
            system.scaled(node_values(slip, "slips of start", p), system.length, "slips of start"),
        )

    def _image(self) -> tuple[Floats, Floats]:
        """Psi of the iterate: scaled normal forces and slips."""
        return np.maximum(self.system.split(self.x)[0], 0.0), self.system.slip(self.x)

    def _increment(self, data: TrescaData, slip: Floats, image: Floats, image_slip: Floats) -> float:
        """Distance at which the limit may be, relative to the tolerance: at most 1 has converged."""
        system = self.system
        force = system.force_norm(image - data.bound)
        change = float(np.linalg.norm(self.slip_weights * (image_slip - slip)))
        if not self.increments and self.depends:
            self._look_for_jumps(image_slip)
        self.increments.append((change, force * self.work))
        self.largest_slip = max(self.largest_slip, float(np.linalg.norm(self.slip_weights * image_slip)))
        relative = [force / system.load_energy] if system.load_energy > 0 else [0.0]
        moved, largest = np.abs(image - data.bound) * system.force, float(np.max(image * system.force))
        relative.append(float(np.max(moved)) / (largest or 1.0) if np.any(moved) else 0.0)
        if self.depends:
            relative.append(change / (self.largest_slip or 1.0))
            # where coefficients are steep, slips that hardly change are not enough
            F = system.coefficients(image_slip)
            relative.append(float(np.max(np.abs(F - data.F)) / (np.max(F) or 1.0)))
        increment = self._reach(max(relative)) / self.tolerance
        if self.progress is not None:
            self.progress(FixedPointProgress(len(self.increments), increment, time.perf_counter() - self.started))
        return increment

    def _reach(self, moved: float) -> float:
        """Distance from the limit for an increment, by the contraction seen in the last ones (theory, (11.11))."""
        self.sizes.append(moved)
        recent = self.sizes[-6:]
        if self.depth or not recent[0]:  # mixed iterates do not shrink as those of Psi do
            return moved
        ratio = (moved / recent[0]) ** (1.0 / (len(recent) - 1)) if len(recent) > 1 else 1.0
        # a factor nearer to 1, and one that is not known
        q = min(ratio, 1.0 - 1e-3)
        return moved * max(1.0, q / (1.0 - q))

    def _stalled(self) -> bool:
        """True if increments are small and shrink no more: rounding."""
        last, before = self.sizes[-_PATIENCE:], self.sizes[:-_PATIENCE]
        return bool(before) and min(before) <= min(1e-6, *last)

    def _look_for_jumps(self, slip: Floats) -> None:
        body = self.system.problem
        reach = 2.0 * float(np.max(slip * self.system.length))
        if isinstance(body, ContactProblem3D) and reach > 0:
            warn_of_jumps(body.law, np.full(body.p, reach), body.node_ids)

    def _period(self, image: Floats) -> int | None:
        """Length of the cycle that the iterates run through, if they do."""
        if self.depth:
            return None
        earlier = list(self.recent)[::-1]
        self.recent.append(image)
        if len(earlier) < 2:
            return None
        distances = np.linalg.norm(np.array(earlier) - image, axis=1)
        same = np.flatnonzero(distances[1:] <= 1e-9 * distances[0])
        return int(same[0]) + 2 if len(same) else None

    def _next(self, bound: Floats, slip: Floats, image: Floats, image_slip: Floats) -> tuple[Floats, Floats]:
        if not self.depends:
            return self.mixing.next(bound, image), image_slip
        p = len(bound)
        mixed = self.mixing.next(np.concatenate([bound, slip]), np.concatenate([image, image_slip]))
        return mixed[:p], mixed[p:]

    def _result(self, outcome: Outcome, period: int | None) -> FixedPoint:
        motion = self.motion
        if motion is None and (free := self.data.free_motion(self.x)) is not None:
            motion = self.system.unit_motion(free)
        return FixedPoint.of(
            self.data,
            self.x,
            outcome=outcome,
            iterations=len(self.increments),
            slip=self.system.slip(self.x) * self.system.length,
            increments=np.array(self.increments).reshape(-1, 2),
            tolerance=self.tolerance,
            rounding=self.rounding,
            period=period,
            free_motion=motion,
        )


def fixed_point_residual(problem: Problem, root: object) -> float:
    """Distance by which Psi moves a root, relative to the load [-].

    The largest change of a contact force when the Tresca problem with the root's normal forces as slip bounds, and
    the coefficients at its slips, is solved, with displacements at the root as the body itself has them: what S has
    lost by rounding does not count (theory, (11.12)).

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
    root : Root, FixedPoint or other
        With alpha, lambda_n, lambda_t and u_t.

    Raises
    ------
    InvalidArgumentError
        The root has no forces, or belongs to another problem (its arrays have other shapes).
    """
    body = checked_problem(problem)
    if not hasattr(root, "alpha"):
        raise InvalidArgumentError(
            f"root is a {type(root).__name__} without alpha; expected a root of enumerate_roots or a fixed point"
        )
    system = ContactSystem.at(body, root.alpha)
    x = scaled_unknowns(system, root, "root")
    slip = system.scaled(node_values(slips_of(root, body.p, "root"), "slip", body.p), system.length, "slip")
    corrected, _ = system.corrected(x)
    data = TrescaData(corrected, np.maximum(system.split(x)[0], 0.0), system.coefficients(slip))
    image, _, _ = solve_scaled(data, x)
    return float(np.max(np.abs(image - x)[: system.m]))


def is_fixed_point(problem: Problem, root: object, tolerance: float = 1e-8) -> bool:
    """True if a root is a fixed point of Psi within a tolerance (theory, section 11.3).

    With coefficients that do not depend on the solution the fixed points are exactly the solutions with Coulomb
    friction; every root of `enumerate_roots` is one.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
    root : Root, FixedPoint or other
        With alpha, lambda_n, lambda_t and u_t.
    tolerance : float
        Largest change of a contact force, relative to the load [-].

    Raises
    ------
    InvalidArgumentError
        The root has no forces, or belongs to another problem; the tolerance is not positive.

    Examples
    --------
    >>> import enumsol
    >>> problem = enumsol.gallery.one_node_triangle()
    >>> [enumsol.is_fixed_point(problem, root) for root in enumsol.enumerate_roots(problem, 5)]
    [True, True, True]
    """
    tolerance = positive_number(tolerance, "tolerance")
    return fixed_point_residual(problem, root) <= tolerance
