"""The points of a continuation as they are collected, with transitions and counts; and points that end a path."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.continuation.path_data import RIGID, PathStats, PathStatus, PointKind, Transition
from enumsol.continuation.transitions import (
    FORWARD_TOLERANCE,
    Kink,
    TangentPoint,
    curve_tangent,
    same_curve,
    smooth_newton,
)
from enumsol.errors import TooLargeError

if TYPE_CHECKING:
    from enumsol.continuation.scaled_equation import ScaledEquation
    from enumsol.roots.local_branch import LocalBranchTest
    from enumsol.support.array_types import Codes, Floats

    #: A point x, its codes, and whether it is one of another path.
    Landmark = tuple[Floats, Codes, bool]


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
            # a small step along the tangent names a frictionless node that starts to slip
            before=equation.statuses(before.codes, self._slip(before, -1e-6)),
            after=equation.statuses(after.codes, self._slip(after, 1e-6)),
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
        """Attributes of a Path with the points so far, by their names."""
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


#: Two points closer than this are the same point of the solution set: located points agree to about 1e-10.
SAME_POINT = 1e-7


@dataclass(frozen=True)
class Landmarks:
    """Points at which a path closes, or has been before.

    Attributes
    ----------
    equation : ScaledEquation
    origin : TangentPoint
        The start of the path.
    tolerance : float
        Accuracy to which points are located.
    points : list of Landmark
    """

    equation: ScaledEquation
    origin: TangentPoint
    tolerance: float
    points: list[Landmark]

    def add(self, point: TangentPoint) -> None:
        """Add a transition point of the path itself."""
        self.points.append((point.x, point.codes, False))

    def between(self, start: TangentPoint, end: TangentPoint, sign: int) -> tuple[TangentPoint, PathStatus] | None:
        """The start, or a point of another path, that lies on a piece of one curve, and how the path ends there."""
        if self._passed(start, end, self.origin.x, self.origin.codes, sign) is not None:
            return self.origin, PathStatus.CLOSED
        for x, codes, foreign in self.points:
            if foreign and (point := self._passed(start, end, x, codes, sign)) is not None:
                return point, PathStatus.VISITED
        return None

    def status_of(self, kink: Kink, *, moved: bool) -> PathStatus | None:
        """Status with which a path that has ``moved`` ends at a transition point; None if that is no landmark."""
        equation, x, origin = self.equation, kink.before.x, self.origin
        at_origin = equation.norm(x - origin.x) <= SAME_POINT and kink.after.codes == origin.codes
        if moved and at_origin and equation.dot(kink.after.tangent, origin.tangent) > 0:
            return PathStatus.CLOSED
        for known, codes, foreign in self.points:
            same = codes == kink.after.codes or (foreign and codes == kink.before.codes)
            if same and equation.norm(x - known) <= SAME_POINT:
                return PathStatus.VISITED
        return None

    def _passed(
        self, start: TangentPoint, end: TangentPoint, x: Floats, codes: Codes, sign: int
    ) -> TangentPoint | None:
        """A known point with its tangent, if the piece from start to end of one curve goes through it."""
        equation = self.equation
        if codes != start.codes or equation.dot(x - start.x, start.tangent) <= FORWARD_TOLERANCE:
            return None
        if equation.dot(end.x - x, end.tangent) < -FORWARD_TOLERANCE:
            return None
        tangent = curve_tangent(equation, codes, x, sign)
        if tangent is None:
            return None
        middle = TangentPoint(x, codes, tangent)
        if not equation.single_valued and not self._on_piece(start, end, middle):
            return None
        on = same_curve(equation, start, middle, sharp=True) and same_curve(equation, middle, end, sharp=True)
        return middle if on else None

    def _on_piece(self, start: TangentPoint, end: TangentPoint, point: TangentPoint) -> bool:
        """True if the curve between two points runs through a third one, and not beside it on another curve."""
        equation, row = self.equation, self.equation.metric @ point.tangent
        chord = end.x - start.x
        along = float(row @ chord)
        share = float(row @ (point.x - start.x)) / along if along > 0 else 0.5
        near = start.x + min(max(share, 0.0), 1.0) * chord
        x = smooth_newton(equation, point.codes, near, row, float(row @ point.x), self.tolerance)
        return x is not None and equation.norm(x - point.x) <= SAME_POINT
