"""Collects the points of a continuation and makes a Path of them."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from enumsol.continuation.path_data import PathData, PathStats, PathStatus, PointKind, Transition
from enumsol.errors import TooLargeError
from enumsol.roots.local_branch import coherent_orientation

if TYPE_CHECKING:
    from enumsol.continuation.condensed_equation import CondensedEquation, Vector
    from enumsol.continuation.continuation_options import ContinuationOptions
    from enumsol.continuation.parameter_path import SmoothPath
    from enumsol.continuation.transitions import CurvePoint, Kink
    from enumsol.roots.local_branch import LocalBranchTest

#: Slip along a tangent, for the name of a frictionless node that starts to slip: any small step serves.
_AHEAD = 1e-6


@dataclass
class PathRecorder:
    """The points and counts of a path while it is followed."""

    equation: CondensedEquation
    points: list[CurvePoint] = field(default_factory=list)
    kinds: list[PointKind] = field(default_factory=list)
    steps: list[float] = field(default_factory=list)
    corrections: list[int] = field(default_factory=list)
    arclength: list[float] = field(default_factory=list)
    transitions: list[Transition] = field(default_factory=list)
    stats: PathStats = field(default_factory=PathStats)
    started: float = field(default_factory=time.perf_counter)

    def add(self, point: CurvePoint, kind: PointKind, step: float = 0.0, corrections: int = 0) -> None:
        """Append a point; a point equal to the last one replaces it (the end of a path at a step or a transition)."""
        length = self.equation.norm(point.x - self.points[-1].x) if self.points else 0.0
        self.arclength.append(length + (self.arclength[-1] if self.arclength else 0.0))
        self.points.append(point)
        self.kinds.append(kind)
        self.steps.append(step)
        self.corrections.append(corrections)

    def add_kink(self, kink: Kink) -> None:
        """Append a transition point, with its local branch test."""
        equation, before, after = self.equation, kink.before, kink.after
        self.add(after, PointKind.TRANSITION)
        scale = equation.alpha_scale
        self.transitions.append(
            Transition(
                point=len(self.points) - 1,
                alpha=equation.alpha(after.x),
                before=equation.statuses(before.codes, self._slip(before, -_AHEAD)),
                after=equation.statuses(after.codes, self._slip(after, _AHEAD)),
                nodes=tuple(i for i, (a, b) in enumerate(zip(before.codes, after.codes, strict=True)) if a != b),
                dalpha_before=float(before.tangent[-1] * scale),
                dalpha_after=float(after.tangent[-1] * scale),
                local_test=self._local_test(after.x),
                alternatives=kink.alternatives,
            )
        )

    def count(self, **changes: int) -> None:
        """Add to the counts of the statistics."""
        self.stats = replace(self.stats, **{name: getattr(self.stats, name) + n for name, n in changes.items()})

    def path(
        self,
        status: PathStatus,
        message: str,
        *,
        orientation: int,
        interval: tuple[float, float],
        options: ContinuationOptions,
        next_step: float,
        smooth_path: SmoothPath | None,
    ) -> PathData:
        """The path so far."""
        equation, p = self.equation, self.equation.p
        forces = np.array([equation.forces(point.x) for point in self.points])
        w = np.array([equation.displacements(point.x) for point in self.points])
        return PathData(
            alpha=np.array([equation.alpha(point.x) for point in self.points]),
            lambda_n=forces[:, :p],
            lambda_t=forces[:, p:],
            u_n=w[:, :p],
            u_t=w[:, p:],
            codes=np.array([point.codes for point in self.points], dtype=np.int8),
            kinds=tuple(self.kinds),
            steps=np.array(self.steps),
            corrections=np.array(self.corrections, dtype=np.int64),
            arclength=np.array(self.arclength),
            transitions=tuple(self.transitions),
            status=status,
            message=message,
            orientation=orientation,
            interval=interval,
            options=replace(options, alpha_scale=equation.alpha_scale),
            next_step=next_step,
            stats=replace(self.stats, seconds=time.perf_counter() - self.started),
            node_ids=equation.problem.node_ids,
            _names=tuple(
                equation.statuses(point.codes, slip) for point, slip in zip(self.points, w[:, p:], strict=True)
            ),
            _problem=equation.problem,
            _smooth_path=smooth_path,
        )

    def _slip(self, point: CurvePoint, step: float) -> Vector:
        return self.equation.w(point.x + step * point.tangent)[self.equation.p :]

    def _local_test(self, x: Vector) -> LocalBranchTest | None:
        equation = self.equation
        F, slip = equation.at(x).F, equation.w(x)[equation.p :]
        try:
            return coherent_orientation(equation.S, F, equation.active(x), slip, equation.alpha(x))
        except TooLargeError:
            return None
