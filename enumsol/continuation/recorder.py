"""Collects the points of a continuation, with the transitions between them and the counts of its steps."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.continuation.path_data import RIGID, PathStats, PointKind, Transition
from enumsol.errors import TooLargeError

if TYPE_CHECKING:
    from enumsol.continuation.scaled_equation import ScaledEquation
    from enumsol.continuation.transitions import Kink, TangentPoint
    from enumsol.roots.local_branch import LocalBranchTest
    from enumsol.support.array_types import Floats

#: Slip along a tangent, for the name of a frictionless node that starts to slip: any small step serves.
_AHEAD = 1e-6


@dataclass(frozen=True)
class _Recorded:
    """A point of a path, and all that is recorded of it: an interruption comes before or after it."""

    point: TangentPoint
    kind: PointKind
    step: float = 0.0
    corrections: int = 0
    transition: Transition | None = None


@dataclass
class PathRecorder:
    """The points and counts of a path while it is followed."""

    equation: ScaledEquation
    points: list[_Recorded] = field(default_factory=list)
    stats: PathStats = field(default_factory=PathStats)
    started: float = field(default_factory=time.perf_counter)

    def add(self, point: TangentPoint, kind: PointKind, step: float = 0.0, corrections: int = 0) -> None:
        """Append a point."""
        self.points.append(_Recorded(point, kind, step, corrections))

    def add_kink(self, kink: Kink) -> None:
        """Append a transition point, with its local branch test."""
        equation, before, after = self.equation, kink.before, kink.after
        scale = equation.alpha_scale
        transition = Transition(
            point=len(self.points),
            alpha=equation.alpha(after.x),
            before=equation.statuses(before.codes, self._slip(before, -_AHEAD)),
            after=equation.statuses(after.codes, self._slip(after, _AHEAD)),
            nodes=tuple(i for i, (a, b) in enumerate(zip(before.codes, after.codes, strict=True)) if a != b),
            dalpha_before=float(before.tangent[-1] * scale),
            dalpha_after=float(after.tangent[-1] * scale),
            local_test=self._local_test(after.x),
            alternatives=kink.alternatives,
        )
        self.points.append(_Recorded(after, PointKind.TRANSITION, transition=transition))

    @property
    def last(self) -> TangentPoint:
        """The point that was added last."""
        return self.points[-1].point

    def count(self, **changes: int) -> None:
        """Add to the counts of the statistics."""
        self.stats = replace(self.stats, **{name: getattr(self.stats, name) + n for name, n in changes.items()})

    def found(self) -> dict[str, Any]:
        """Attributes of a PathData with the points so far, by the names of its attributes."""
        equation, p, points = self.equation, self.equation.p, [one.point for one in self.points]
        forces = np.array([equation.forces(point.x) for point in points])
        w = np.array([equation.displacements(point.x) for point in points])
        lengths = [equation.norm(after.x - before.x) for before, after in pairwise(points)]
        return {
            "alpha": np.array([equation.alpha(point.x) for point in points]),
            **dict(
                zip(("lambda_n", "lambda_t", "u_n", "u_t"), (*equation.split(forces), *equation.split(w)), strict=True)
            ),
            "codes": np.array([point.codes for point in points], dtype=np.int8),
            "kinds": tuple(one.kind for one in self.points),
            "steps": np.array([one.step for one in self.points]),
            "corrections": np.array([one.corrections for one in self.points], dtype=np.int64),
            "arclength": np.cumsum([0.0, *lengths]),
            "transitions": tuple(one.transition for one in self.points if one.transition is not None),
            "stats": replace(self.stats, seconds=time.perf_counter() - self.started),
            "node_ids": equation.problem.node_ids,
            "_names": tuple(equation.statuses(one.codes, w[k, p:]) for k, one in enumerate(points)),
            "_problem": equation.problem,
            RIGID: np.array([equation.rigid(point.x) for point in points]) if equation.modes else None,
        }

    def _slip(self, point: TangentPoint, step: float) -> Floats:
        return self.equation.w(point.x + step * point.tangent)[self.equation.p :]

    def _local_test(self, x: Floats) -> LocalBranchTest | None:
        try:
            return self.equation.local_test(x)
        except TooLargeError:
            return None
