"""The condensed equation of a problem in 2D or 3D."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from enumsol.continuation.condensed_equation import CondensedEquation
from enumsol.continuation.parameter_path import AffinePath, CallablePath, SmoothPath
from enumsol.continuation.space_equation import SpaceEquation
from enumsol.model.problem import ContactProblem, check_is_problem
from enumsol.support.arguments import instance_of

if TYPE_CHECKING:
    from enumsol.continuation.scaled_equation import ScaledEquation


def check_problem(problem: Any, smooth_path: SmoothPath | None) -> None:
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
    problem: Any,
    smooth_path: SmoothPath | None,
    start: float,
    interval: tuple[float, float] = (-math.inf, math.inf),
    r: float | None = None,
    alpha_scale: float = 1.0,
) -> ScaledEquation:
    """The equation of a problem, on its own affine path or a smooth one; for the arguments see ScaledEquation."""
    path = AffinePath(problem) if smooth_path is None else CallablePath(problem, smooth_path, start)
    kind = CondensedEquation if isinstance(problem, ContactProblem) else SpaceEquation
    return kind(path, interval, start, r, alpha_scale)
