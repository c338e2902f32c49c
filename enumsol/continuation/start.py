"""Where a continuation starts: its arguments checked, and the equation with the start as a point of it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from enumsol.continuation.condensed_equation import CondensedEquation, DiscEquation
from enumsol.continuation.parameter_path import ParameterPath, SmoothPath
from enumsol.continuation.path_data import ContinuationOptions, PathData
from enumsol.errors import InvalidArgumentError
from enumsol.model.problem import ContactProblem, check_is_problem
from enumsol.support.arguments import alpha_value, instance_of, unbounded_interval
from enumsol.support.array_arguments import real_array

if TYPE_CHECKING:
    from enumsol.continuation.scaled_equation import ScaledEquation
    from enumsol.model.problem3d import AnyProblem
    from enumsol.support.array_types import AlphaLike, Floats


def check_problem(problem: object, smooth_path: SmoothPath | None) -> None:
    """Refuse what continuation does not take.

    Raises
    ------
    InvalidArgumentError
        The problem is none, or the smooth path is none.
    """
    check_is_problem(problem)
    if smooth_path is not None:
        instance_of(smooth_path, SmoothPath, "smooth_path")


def equation_on(
    problem: AnyProblem,
    smooth_path: SmoothPath | None,
    start: float,
    interval: tuple[float, float] = (-math.inf, math.inf),
    r: float | None = None,
    alpha_scale: float = 1.0,
) -> ScaledEquation:
    """The equation of a problem, on its own affine path or a smooth one; for the arguments see ScaledEquation."""
    kind = CondensedEquation if isinstance(problem, ContactProblem) else DiscEquation
    return kind(ParameterPath(problem, smooth_path, start), interval, start, r, alpha_scale)


#: The default alpha scale is this fraction of the interval.
ALPHA_FRACTION = 0.05
#: A change of the problem over the whole interval that is too small to follow: conditions within STATUS_TOLERANCE of
#: zero count as met with equality, and must not all be within it.
RESOLUTION = 1e-6
#: Norm of H above which a start is not a root.
START_TOLERANCE = 1e-6
#: What a start is made of, and of a body that nothing holds this as well.
_NAMES, _RIGID = ("alpha", "lambda_n", "lambda_t"), "rigid_coordinates"


class Start:
    """Validated arguments: the equation, the start as a point of it, interval, options and smooth path."""

    def __init__(
        self,
        problem: AnyProblem,
        start: object,
        interval: tuple[AlphaLike, AlphaLike] | None,
        options: ContinuationOptions | None,
        smooth_path: SmoothPath | None,
    ) -> None:
        check_problem(problem, smooth_path)
        chosen = ContinuationOptions() if options is None else options
        self.options = instance_of(chosen, ContinuationOptions, "options")
        self.smooth_path = smooth_path
        plane = isinstance(problem, ContactProblem)
        modes = problem.modes.r
        alpha, forces, rigid = _start_values(start, (problem.p,) if plane else (problem.p, 2), modes)
        self.interval = _interval(problem, interval, alpha, smooth_path)
        low, high = self.interval
        scale = self.options.alpha_scale
        if scale is None:
            scale = ALPHA_FRACTION * (high - low) if math.isfinite(high - low) else 1.0
        self.equation = equation_on(problem, smooth_path, alpha, self.interval, self.options.r, scale)
        if smooth_path is None and math.isfinite(high - low):
            self._check_resolution(alpha, (high - low) / scale)
        self.x = self._on_solution(alpha, forces, rigid)

    def _check_resolution(self, alpha: float, width: float) -> None:
        """Refuse an interval over which the problem hardly changes."""
        equation = self.equation
        values = equation.at(equation.point(alpha, np.zeros(equation.m)))
        change = max(np.max(np.abs(values.dg)), np.max(np.abs(values.dF) / (1.0 + values.F))) * width
        if 0 < change < RESOLUTION:
            raise InvalidArgumentError(
                f"interval is ({self.interval[0]:.17g}, {self.interval[1]:.17g}), over which friction and load change "
                f"by {change:.1e} of their size; expected at least {RESOLUTION:g} (branch_graph works without rounding)"
            )

    def _on_solution(self, alpha: float, forces: Floats, rigid: Floats) -> Floats:
        equation = self.equation
        x = equation.point(alpha, forces, rigid)
        if np.any(np.abs(rigid) > equation.reach):
            mode = int(np.argmax(np.abs(rigid) / equation.reach))
            raise InvalidArgumentError(
                f"start has {rigid[mode]:g} as coordinate of rigid mode {mode}; expected at most "
                f"{equation.reach[mode]:g} (see max_rigid_displacement)"
            )
        with np.errstate(over="ignore", invalid="ignore"):
            residual = float(np.linalg.norm(equation.residual(x)))
        if not residual <= START_TOLERANCE:
            raise InvalidArgumentError(
                f"start is not a root at alpha = {alpha:g}: the residual of H is {residual:.2e} relative to the load; "
                f"expected at most {START_TOLERANCE:g} (newton(problem, alpha, start) finds the root nearby)"
            )
        return x


def _start_values(start: object, tangential: tuple[int, ...], modes: int) -> tuple[float, Floats, Floats]:
    """alpha, the forces (m,) and rigid coordinates (modes,) of a start whose lambda_t has that shape."""
    values = (*_NAMES, *((_RIGID,) if modes else ()))
    if isinstance(start, tuple) and len(start) == len(values):
        alpha, *given = start
    elif all(getattr(start, name, None) is not None for name in values) and not isinstance(start, PathData):
        alpha, *given = (getattr(start, name) for name in values)
    else:
        found = f"a tuple of {len(start)}" if isinstance(start, tuple) else f"a {type(start).__name__}"
        raise InvalidArgumentError(f"start is {found}; expected a Root, a PathPoint or ({', '.join(values)})")
    parts = []
    for name, part, shape in zip(values[1:], given, (tangential[:1], tangential, (modes,)), strict=False):
        parts.append(np.atleast_1d(real_array(part, f"{name} of start", error=InvalidArgumentError)))
        if parts[-1].shape != shape:
            raise InvalidArgumentError(f"{name} of start has shape {parts[-1].shape}; expected {shape}")
    forces = np.concatenate([part.ravel(order="F") for part in parts[:2]])
    return float(alpha_value(alpha, "alpha of start")), forces, parts[2] if modes else np.zeros(0)


def _interval(
    problem: AnyProblem, interval: tuple[AlphaLike, AlphaLike] | None, start: float, smooth_path: SmoothPath | None
) -> tuple[float, float]:
    affine = smooth_path is None or smooth_path.F is None
    if interval is None:
        return friction_domain(problem) if affine else (-math.inf, math.inf)
    low, high = unbounded_interval(interval)
    if not low <= start <= high:
        raise InvalidArgumentError(f"start has alpha = {start:g}, outside the interval ({low:g}, {high:g})")
    if affine:
        for end in (low, high):
            if math.isfinite(end):
                problem.friction_at(end)
        domain = friction_domain(problem)
        low, high = max(low, domain[0]), min(high, domain[1])
    return low, high


def friction_domain(problem: AnyProblem) -> tuple[float, float]:
    """The range of alpha in which no coefficient F0 + alpha F1 is negative."""
    F0, F1 = problem.affine_friction
    with np.errstate(divide="ignore", invalid="ignore"):
        zero = -F0 / F1
    low = np.max(zero[F1 > 0], initial=-math.inf)
    high = np.min(zero[F1 < 0], initial=math.inf)
    return float(low), float(high)
