"""The loop of the paper's Algorithm 5.1: predictions, corrections, step control, checks of steps, stop conditions."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np

from enumsol.continuation.path_data import PathStatus, PointKind, Tangent
from enumsol.continuation.recorder import SAME_POINT, Landmarks, PathRecorder
from enumsol.continuation.transitions import (
    FORWARD_TOLERANCE,
    RATE_TOLERANCE,
    Correction,
    Kink,
    TangentPoint,
    confirm,
    continuations,
    curve_tangent,
    moore_penrose,
    next_kink,
    orientation,
    passed_kink,
    same_curve,
    smooth_newton,
    turning_point,
)
from enumsol.errors import InvalidArgumentError, TooLargeError
from enumsol.model.statuses import STATUS_TOLERANCE
from enumsol.search.outcome import Stop, StopReason
from enumsol.support.deadlines import keeping, look
from enumsol.support.messages import counted

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from enumsol.continuation.newton import Start
    from enumsol.continuation.recorder import Landmark
    from enumsol.support.array_types import Floats
    from enumsol.support.deadlines import Ending

_Path = TypeVar("_Path")
#: How a path ended, and why in a sentence.
_Stop = tuple[PathStatus, str]


@dataclass(frozen=True)
class _Step:
    """An accepted step: its end, the transition point passed on the way, if there was one, and how it was found."""

    end: TangentPoint
    kink: Kink | None
    length: float
    corrections: int


#: Why a path ended, in a sentence.
_SENTENCES = {
    PathStatus.STEP_LIMIT: "the limit of {steps} was reached at alpha = {alpha:g}; path.resume() continues",
    PathStatus.FRICTION: "a friction coefficient becomes negative beyond alpha = {alpha:g}; expected F >= 0",
    PathStatus.RIGID_BOUND: (
        "the body moves as a whole along rigid mode {mode}, by which max_rigid_displacement was reached at "
        "alpha = {alpha:g}: contact does not hold it there"
    ),
    PathStatus.INTERVAL_LEFT: (
        "alpha left the interval ({low:g}, {high:g}) at {alpha:g}; path.resume(interval=...) continues"
    ),
    PathStatus.CLOSED: "the path returned to its start at alpha = {alpha:g}: a closed branch",
    PathStatus.VISITED: "the path arrived at a point already visited, at alpha = {alpha:g}",
    PathStatus.STALLED: (
        "no step of length {least:g} or more was accepted at alpha = {alpha:g} ({reason}); a smaller h_min or h_init "
        "may pass, and branch_graph shows which arcs meet there"
    ),
    PathStatus.DEAD_END: (
        "no continuation keeps the orientation at alpha = {alpha:g}, where {others}; start anew there with "
        "follow(tangent=k)"
    ),
}


class Follower(Generic[_Path]):
    """State of a continuation.

    Parameters
    ----------
    make : callable
        Makes a path of its attributes.
    start : Start
    first : TangentPoint
        The start and the direction in which to leave it.
    sign : {+1, -1}
        Orientation kept along the path.
    visited : sequence of Landmark
        Points of other paths.
    """

    def __init__(
        self, make: Callable[..., _Path], start: Start, first: TangentPoint, sign: int, visited: Sequence[Landmark] = ()
    ) -> None:
        self._make, self._smooth_path = make, start.smooth_path
        self.equation, self.options, self.interval = start.equation, start.options, start.interval
        self.current, self.sign = first, sign
        self.h = self.options.h_init
        self._in_place, self._friction_ends = 0, False
        (low, high), margin, scale = self.interval, self.options.overshoot, self.equation.alpha_scale
        self._low, self._high = (low - margin) / scale, (high + margin) / scale
        self._landmarks = Landmarks(self.equation, first, self.options.transition_tolerance, [*visited])
        self.record = PathRecorder(self.equation)
        self.record.add(first, PointKind.START)

    def run(self) -> _Path:
        """Follow until a stop condition is met."""
        return keeping("follow", self._followed, self._cut_short, lambda path: f" {self._so_far}")

    def _followed(self) -> _Path:
        stop = None
        while stop is None:
            look()
            stop = self._advance()
        return self._path(stop)

    def _cut_short(self, ending: Ending) -> _Path:
        """The path to its last point."""
        return self._path((PathStatus.INTERRUPTED, f"{Stop(StopReason.of(ending))} {self._so_far}"))

    @property
    def _so_far(self) -> str:
        return f"at alpha = {self.equation.alpha(self.record.last.x):g}; path.resume() continues"

    def _path(self, stop: _Stop) -> _Path:
        return self._make(
            **self.record.found(),
            status=stop[0],
            message=stop[1],
            orientation=self.sign,
            interval=self.interval,
            options=replace(self.options, alpha_scale=self.equation.alpha_scale),
            next_step=self.h,
            _smooth_path=self._smooth_path,
        )

    def _stop(self, status: PathStatus, alpha: float | None = None, **words: object) -> _Stop:
        """The end of the path at an alpha, by default the current one."""
        at = self.equation.alpha(self.current.x) if alpha is None else alpha
        return status, _SENTENCES[status].format(alpha=at, **words)

    def _stalled(self, reason: str) -> _Stop:
        return self._stop(PathStatus.STALLED, reason=reason, least=self.options.h_min)

    # -- one step of the paper's Algorithm 5.1 -----------------------------------------------------------------------

    def _advance(self) -> _Stop | None:
        if self.record.stats.accepted >= self.options.max_steps:
            return self._stop(PathStatus.STEP_LIMIT, steps=counted(self.options.max_steps, "step"))
        if self.equation.moves_rigidly(self.current.tangent):
            return self._slide()
        step = self._step()
        if step is None:
            return self._change_selection()
        self._in_place = 0
        return self._take(step)

    def _slide(self) -> _Stop | None:
        """Go straight to the next transition point, or to the bound, where the body moves as a whole at fixed forces.

        All conditions are affine along this line (theory, section 14.7).
        """
        equation, start = self.equation, self.current
        q, rates = equation.rigid(start.x), equation.rigid(start.tangent)
        room = np.divide(
            np.copysign(equation.reach, rates) - q, rates, out=np.full(len(q), np.inf), where=np.abs(rates) > 0
        )
        slacks, falls = equation.slacks(start.codes, start.x), equation.slack_rates(start.codes, start.x, start.tangent)
        falling = falls < -RATE_TOLERANCE
        ahead = float(np.min(np.maximum(slacks[falling], 0.0) / -falls[falling], initial=np.inf))
        length = min(ahead, float(np.min(room)))
        end = TangentPoint(start.x + length * start.tangent, start.codes, start.tangent)
        if ahead == length:
            return self._leave(end)
        stop = self._return(start, end)
        if stop is not None:
            return stop
        self._end(end)
        return self._stop(PathStatus.RIGID_BOUND, mode=int(np.argmin(room)))

    def _step(self) -> _Step | None:
        """Steps 2-7 and 9: an accepted step, or None when even the shortest one fails."""
        options, h, shortened = self.options, self.h, False
        while True:
            self._friction_ends = False
            prediction = self.current.x + h * self.current.tangent
            correction = moore_penrose(self.equation, prediction, self.current.tangent, options)
            self.record.count(corrections=correction.count)
            if correction.converged:
                found = self._judge(correction, h)
                if found is not None:
                    self.record.count(accepted=1)
                    longer = correction.count - 1 < options.k_thr and not shortened
                    self.h = min(options.h_inc * h, options.h_max) if longer else h
                    return found
                self.record.count(refused=1)
            else:
                self.record.count(not_converged=1)
            if h <= options.h_min:
                return None
            h, shortened = max(options.h_dec * h, options.h_min), True

    def _judge(self, correction: Correction, h: float) -> _Step | None:
        """The step that ends at the corrected point, or None when it does not continue the path."""
        self._friction_ends = bool(np.any(self.equation.at(correction.x).F < 0)) and self._inside(correction.x)
        if self._friction_ends:
            return None
        if not self.options.check_steps:
            return self._unchecked(correction, h)
        end = self._end_point(self._corrected(correction))
        if end is None:
            return None
        if end.codes == self.current.codes:
            if not same_curve(self.equation, self.current, end, sharp=h <= self.options.h_min):
                return None
            return _Step(end, None, h, correction.count)
        kink = confirm(self.equation, self.current, end, self.sign, self.options.transition_tolerance)
        return None if kink is None else _Step(end, kink, h, correction.count)

    def _corrected(self, correction: Correction) -> TangentPoint | None:
        """A corrected point with its statuses and the tangent there; None where it has none."""
        tolerance = max(STATUS_TOLERANCE, 10 * correction.residual)
        codes = self.equation.codes(correction.x, self.current.codes, tolerance)
        tangent = curve_tangent(self.equation, codes, correction.x, self.sign)
        return None if tangent is None else TangentPoint(correction.x, codes, tangent)

    def _end_point(self, near: TangentPoint | None) -> TangentPoint | None:
        """The solution beside a corrected point, converged to rounding; None when it is not admissible.

        H is small near the tip of a fold even without a solution: only the conditions of a converged point decide.
        """
        if near is None:
            return None
        equation, codes, row = self.equation, near.codes, self.equation.metric @ near.tangent
        x = smooth_newton(equation, codes, near.x, row, float(row @ near.x), self.options.transition_tolerance)
        # conditions may be negative by this much at a point that is converged to rounding
        if x is None or np.min(equation.slacks(codes, x)) < -1e-12:
            return None
        tangent = curve_tangent(equation, codes, x, self.sign)
        return None if tangent is None else TangentPoint(x, codes, tangent)

    def _unchecked(self, correction: Correction, h: float) -> _Step | None:
        """The step as the paper's Algorithm 5.1 takes it: any converged correction, with the tangent of its last."""
        end, kink = self._corrected(correction), None
        if end is None:
            return None
        if end.codes != self.current.codes:
            kink = confirm(self.equation, self.current, end, self.sign, self.options.transition_tolerance)
        if self.equation.dot(end.tangent, correction.tangent) < 0:
            end = TangentPoint(end.x, end.codes, -end.tangent)
            self.sign = orientation(self.equation, end.codes, end.x, end.tangent)
        return _Step(end, kink, h, correction.count)

    def _change_selection(self) -> _Stop | None:
        """Step 8: go to the next transition point of the current curve and leave it on another selection."""
        equation, options = self.equation, self.options
        if self._friction_ends:
            return self._stop(PathStatus.FRICTION)
        arrival = next_kink(equation, self.current, self.sign, options.transition_tolerance)
        if arrival is None and not options.check_steps:
            # how far behind a transition point may lie; steps are refused beyond it
            reach = 100.0 * max(options.h_min, options.eps)
            arrival = passed_kink(equation, self.current, self.sign, options.transition_tolerance, reach)
        if arrival is None:
            return self._stalled("no transition point was found ahead")
        return self._leave(arrival)

    def _leave(self, arrival: TangentPoint) -> _Stop | None:
        """Leave a transition point of the current curve."""
        equation, options = self.equation, self.options
        moved = equation.norm(arrival.x - self.current.x) > SAME_POINT
        self._in_place = 0 if moved else self._in_place + 1
        # many selections meet at this point
        if self._in_place > 32:
            return self._stalled("the selection changes repeatedly at one point")
        try:
            keep, others = continuations(equation, arrival, self.sign)
        except TooLargeError as error:
            return self._stalled(str(error))
        if not keep:
            self._end(arrival)
            count = counted(len(others), "other direction leaves", "other directions leave")
            return self._stop(PathStatus.DEAD_END, others=count)
        index = self._index(keep)
        chosen = keep[index]
        alternatives = (*(t for k, t in enumerate(keep) if k != index), *others)
        self.record.count(selection_changes=1)
        kink = Kink(arrival, TangentPoint(arrival.x, chosen.codes, chosen.vector), alternatives)
        self.h = options.h_init
        return self._enter(self.current, kink)

    def _index(self, tangents: Sequence[Tangent]) -> int:
        if self.options.choose is None or len(tangents) == 1:
            return 0
        index = self.options.choose(tangents)
        if not 0 <= index < len(tangents):
            raise InvalidArgumentError(f"options.choose gave {index!r}; expected an index below {len(tangents)}")
        return index

    # -- accepting points, and stop conditions -----------------------------------------------------------------------

    def _take(self, step: _Step) -> _Stop | None:
        origin = self.current
        if step.kink is not None:
            stop = self._enter(origin, step.kink)
            if stop is not None:
                return stop
            origin = step.kink.after
        stop = self._piece(origin, step.end)
        if stop is not None:
            return stop
        self.record.add(step.end, PointKind.STEP, step.length, step.corrections)
        self.current = step.end
        return None

    def _enter(self, start: TangentPoint, kink: Kink) -> _Stop | None:
        """Go from ``start`` on its curve to a transition point and through it."""
        stop = self._piece(start, kink.before)
        if stop is not None:
            return stop
        arrived = self._known(kink)
        self.record.add_kink(kink)
        self.current = kink.after
        self._landmarks.add(kink.after)
        return arrived

    def _piece(self, start: TangentPoint, end: TangentPoint) -> _Stop | None:
        """Stop conditions met between two points of one curve; the path is ended there. A fold is recorded."""
        fold = turning_point(self.equation, start, end, self.options.transition_tolerance)
        if fold is not None:
            stop = self._border(start, fold) or self._beyond(start, fold) or self._return(start, fold)
            if stop is not None:
                return stop
            arrived = self._known(Kink(fold, fold))
            self.record.add_kink(Kink(fold, fold))
            self.current = start = fold
            self._landmarks.add(fold)
            if arrived is not None:
                return arrived
        return self._border(start, end) or self._beyond(start, end) or self._return(start, end)

    def _return(self, start: TangentPoint, end: TangentPoint) -> _Stop | None:
        """The stop at the start or at a point of another path that lies between two points of one curve."""
        found = self._landmarks.between(start, end, self.sign)
        if found is None:
            return None
        point, status = found
        self._end(point)
        return self._stop(status, self.equation.alpha(point.x))

    def _known(self, kink: Kink) -> _Stop | None:
        """The stop at a transition point that is the start, or was passed before in either direction."""
        status = self._landmarks.status_of(kink, moved=len(self.record.points) > 1)
        return None if status is None else self._stop(status, self.equation.alpha(kink.before.x))

    def _beyond(self, start: TangentPoint, end: TangentPoint) -> _Stop | None:
        """The stop where a body that nothing holds comes to the bound of its rigid displacement."""
        equation = self.equation
        here, there = equation.rigid(start.x), equation.rigid(end.x)
        sides = np.where(there < 0, -equation.reach, equation.reach)
        for mode in np.argsort(-np.abs(there - here) / np.maximum(np.abs(sides - here), 1e-300)):
            if abs(there[mode]) <= equation.reach[mode]:
                continue
            row, side = equation.rigid_rows[mode] / equation.reach[mode], math.copysign(1.0, there[mode])
            x = smooth_newton(equation, end.codes, end.x, row, side, self.options.transition_tolerance)
            if x is not None:
                self._end(TangentPoint(x, end.codes, end.tangent))
            return self._stop(PathStatus.RIGID_BOUND, mode=int(mode))
        return None

    def _inside(self, x: Floats) -> bool:
        return bool(self._low <= x[-1] <= self._high)

    def _border(self, start: TangentPoint, end: TangentPoint) -> _Stop | None:
        if self._inside(end.x):
            return None
        value = self._low if end.x[-1] < self._low else self._high
        row = np.zeros(len(end.x))
        row[-1] = 1.0
        # the statuses of the end: without checks they may differ from those of the start
        x = smooth_newton(self.equation, end.codes, end.x, row, value, self.options.transition_tolerance)
        if x is not None:
            x[-1] = value
            self._end(TangentPoint(x, end.codes, end.tangent))
        low, high = self.interval
        return self._stop(PathStatus.INTERVAL_LEFT, self.equation.alpha_scale * value, low=low, high=high)

    def _end(self, point: TangentPoint) -> None:
        if self.equation.norm(point.x - self.record.last.x) > FORWARD_TOLERANCE:
            self.record.add(point, PointKind.END)
        self.current = point
