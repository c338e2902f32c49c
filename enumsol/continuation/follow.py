"""Piecewise smooth Moore-Penrose continuation (Algorithm 5.1): one branch of solutions from a start."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.checks import finite_alpha
from enumsol.continuation.condensed_equation import CondensedEquation
from enumsol.continuation.errors import AmbiguousStart
from enumsol.continuation.follower import Follower
from enumsol.continuation.options import ContinuationOptions
from enumsol.continuation.parameter_path import AffinePath, CallablePath, SmoothPath
from enumsol.continuation.path import Path
from enumsol.continuation.tangents import Tangent, admissible_tangents, curve_tangent
from enumsol.continuation.transitions import ACTIVE_TOLERANCE, CurvePoint
from enumsol.errors import InvalidArgumentError
from enumsol.problem import ContactProblem

if TYPE_CHECKING:
    from enumsol.continuation.condensed_equation import Vector
    from enumsol.continuation.parameter_path import ParameterPath

#: The default alpha scale is this fraction of the interval.
ALPHA_FRACTION = 0.05
#: A change of the problem over the whole interval that is too small to follow: conditions within STATUS_TOLERANCE of
#: zero count as met with equality, and must not all be within it.
RESOLUTION = 1e-6
#: Norm of H above which a start is not a root.
START_TOLERANCE = 1e-6


def follow(
    problem: ContactProblem,
    start: Any,
    direction: int = +1,
    interval: tuple[float, float] | None = None,
    options: ContinuationOptions | None = None,
    smooth_path: SmoothPath | None = None,
    *,
    tangent: int | None = None,
    visited: Sequence[Path] = (),
) -> Path:
    """The branch of solutions through a start, in one direction, by Algorithm 5.1.

    Predictions along the tangent are corrected by the piecewise smooth Moore-Penrose method. When corrections fail even
    for the shortest step, the selection is changed at the test function that vanishes next (Step 8). Transition points
    are located by the sign changes of the test functions. With ``options.check_steps`` every step is accepted only as
    the proven-in-floats continuation of the one before, so that long steps cannot jump to another branch unnoticed.

    Works on the problem condensed to its contact nodes: A is factorised once for 2p + a few right-hand sides, a
    correction costs one dense solve of size 2p + 1. The arclength is defined in ContinuationOptions.

    Parameters
    ----------
    problem : ContactProblem
    start : Root, PathPoint, or tuple (alpha, lambda_n, lambda_t)
        A root, for example of enumerate_roots, newton or ``graph.starting_points()``.
    direction : {+1, -1}
        +1 is the positively oriented tangent of Definition 5.1; alpha then increases where the root's index is +1.
    interval : (float, float) or None
        Range of alpha; infinite ends are allowed. None: all alpha with F >= 0.
    options : ContinuationOptions or None
    smooth_path : SmoothPath or None
        Friction and load that are not affine in alpha.
    tangent : int or None
        Index into `start_tangents` of the direction to take, at a start where several are admissible.
    visited : sequence of Path
        The path ends where it arrives at one of them.

    Returns
    -------
    Path
        Its ``status`` and ``message`` say why it ended.

    Raises
    ------
    AmbiguousStart
        Several tangents, or none, have the asked orientation at a degenerate start; the error lists them.
    InvalidArgumentError
        The start is not a root or an argument is out of range.
    Interrupted
        On Ctrl-C; ``partial`` holds the path so far.
    """
    if direction not in (1, -1):
        raise InvalidArgumentError(f"direction is {direction!r}; expected +1 or -1")
    setup = _Setup(problem, start, interval, options, smooth_path)
    chosen = _choose(setup, direction, tangent)
    first = CurvePoint(setup.x, chosen.codes, chosen.vector)
    sign = chosen.orientation or direction
    return Follower(setup.equation, first, sign, setup.interval, setup.options, smooth_path, visited).run()


def start_tangents(
    problem: ContactProblem,
    start: Any,
    interval: tuple[float, float] | None = None,
    options: ContinuationOptions | None = None,
    smooth_path: SmoothPath | None = None,
) -> tuple[Tangent, ...]:
    """All tangents along which solutions leave a root, in the order of their selections (Remark 5.1).

    Two at a regular root and at an ordinary transition point; more at a bifurcation point. ``tangent=k`` of `follow`
    takes the k-th. Parameters are those of `follow`.
    """
    setup = _Setup(problem, start, interval, options, smooth_path)
    return admissible_tangents(setup.equation, setup.x, ACTIVE_TOLERANCE)


def resume_path(
    path: Path,
    problem: ContactProblem | None,
    interval: tuple[float, float] | None,
    options: ContinuationOptions | None,
    smooth_path: SmoothPath | None,
) -> Path:
    """Go on from the end of a path; see Path.resume."""
    if problem is None:
        raise InvalidArgumentError("problem is missing; a path loaded from a file needs it: path.resume(problem)")
    if path.status in ("closed", "dead end"):
        raise InvalidArgumentError(f"the path cannot go on: {path.message}")
    setup = _Setup(problem, path[-1], interval or path.interval, options or path.options, smooth_path)
    codes = tuple(int(code) for code in path.codes[-1])
    vector = curve_tangent(setup.equation, codes, setup.x, path.orientation)
    if vector is None:
        raise InvalidArgumentError("the path ends where its tangent is not unique; start anew with follow(tangent=...)")
    first = CurvePoint(setup.x, codes, vector)
    follower = Follower(setup.equation, first, path.orientation, setup.interval, setup.options, smooth_path, ())
    follower.h = min(max(path.next_step, setup.options.h_min), setup.options.h_max)
    return path.joined(follower.run())


class _Setup:
    """Validated arguments: the equation, the start as a point of it, interval and options."""

    def __init__(
        self,
        problem: ContactProblem,
        start: Any,
        interval: tuple[float, float] | None,
        options: ContinuationOptions | None,
        smooth_path: SmoothPath | None,
    ) -> None:
        if not isinstance(problem, ContactProblem):
            raise InvalidArgumentError(f"problem is a {type(problem).__name__}; expected a ContactProblem")
        self.options = options or ContinuationOptions()
        alpha, forces = _start_values(start, problem.p)
        self.interval = _interval(problem, interval, alpha, smooth_path)
        low, high = self.interval
        scale = self.options.alpha_scale
        if scale is None:
            scale = ALPHA_FRACTION * (high - low) if math.isfinite(high - low) else 1.0
        path: ParameterPath = AffinePath(problem) if smooth_path is None else CallablePath(problem, smooth_path, alpha)
        self.equation = CondensedEquation(path, self.interval, alpha, self.options.r, scale)
        if smooth_path is None and math.isfinite(high - low):
            self._check_resolution(alpha, (high - low) / scale)
        self.x = self._on_solution(alpha, forces)

    def _check_resolution(self, alpha: float, width: float) -> None:
        """Refuse an interval over which the problem changes by little more than what counts as equal."""
        equation = self.equation
        values = equation.at(equation.point(alpha, np.zeros(2 * equation.p)))
        change = max(np.max(np.abs(values.dg)), np.max(np.abs(values.dF) / (1.0 + values.F))) * width
        if 0 < change < RESOLUTION:
            raise InvalidArgumentError(
                f"interval is ({self.interval[0]:.17g}, {self.interval[1]:.17g}), over which friction and load change "
                f"by {change:.1e} of their size; expected at least {RESOLUTION:g} (branch_graph works without rounding)"
            )

    def _on_solution(self, alpha: float, forces: Vector) -> Vector:
        equation = self.equation
        x = equation.point(alpha, forces)
        residual = float(np.linalg.norm(equation.residual(x)))
        if not residual <= START_TOLERANCE:
            raise InvalidArgumentError(
                f"start is not a root at alpha = {alpha:g}: the residual of H is {residual:.2e} relative to the load; "
                f"expected at most {START_TOLERANCE:g} (newton(problem, alpha, start) finds the root nearby)"
            )
        return x


def _start_values(start: Any, p: int) -> tuple[float, Vector]:
    if isinstance(start, tuple) and len(start) == 3:
        alpha, lambda_n, lambda_t = start
    elif all(hasattr(start, name) for name in ("alpha", "lambda_n", "lambda_t")) and not isinstance(start, Path):
        alpha, lambda_n, lambda_t = start.alpha, start.lambda_n, start.lambda_t
    else:
        raise InvalidArgumentError(
            f"start is a {type(start).__name__}; expected a Root, a PathPoint or (alpha, lambda_n, lambda_t)"
        )
    parts = [np.atleast_1d(np.asarray(part, dtype=np.float64)) for part in (lambda_n, lambda_t)]
    if any(part.shape != (p,) or not np.all(np.isfinite(part)) for part in parts):
        raise InvalidArgumentError(f"start has contact forces of shape {parts[0].shape}; expected finite arrays ({p},)")
    return finite_alpha(alpha), np.concatenate(parts)


def _interval(
    problem: ContactProblem, interval: tuple[float, float] | None, start: float, smooth_path: SmoothPath | None
) -> tuple[float, float]:
    affine = smooth_path is None or smooth_path.F is None
    if interval is None:
        return friction_domain(problem) if affine else (-math.inf, math.inf)
    low, high = (float(end) for end in interval)
    if not low < high:
        raise InvalidArgumentError(f"interval is ({low:g}, {high:g}); expected two numbers, the first the smaller")
    if not low <= start <= high:
        raise InvalidArgumentError(f"start has alpha = {start:g}, outside the interval ({low:g}, {high:g})")
    if affine:
        for end in (low, high):
            if math.isfinite(end):
                problem.friction_at(end)
        domain = friction_domain(problem)
        low, high = max(low, domain[0]), min(high, domain[1])
    return low, high


def friction_domain(problem: ContactProblem) -> tuple[float, float]:
    """The range of alpha in which no coefficient F0 + alpha F1 is negative."""
    F0, F1 = problem.friction
    with np.errstate(divide="ignore", invalid="ignore"):
        zero = -F0 / F1
    low = np.max(zero[F1 > 0], initial=-math.inf)
    high = np.min(zero[F1 < 0], initial=math.inf)
    return float(low), float(high)


def _choose(setup: _Setup, direction: int, index: int | None) -> Tangent:
    tangents = admissible_tangents(setup.equation, setup.x, ACTIVE_TOLERANCE)
    if index is not None:
        if not 0 <= index < len(tangents):
            raise InvalidArgumentError(f"tangent is {index}; expected an index below {len(tangents)} of start_tangents")
        return tangents[index]
    fitting = [t for t in tangents if t.orientation == direction]
    if len(fitting) != 1:
        listing = "; ".join(f"{k}: {t!r}" for k, t in enumerate(tangents)) or "none"
        raise AmbiguousStart(
            f"at the start {len(fitting)} of {len(tangents)} admissible tangents have orientation {direction:+d}; "
            f"expected one; choose with tangent=k among {listing}",
            tangents,
        )
    return fitting[0]
