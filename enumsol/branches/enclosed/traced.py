"""Selections of a problem over alpha in ball arithmetic, for its data as given (theory, section 7.14)."""

from __future__ import annotations

from fractions import Fraction
from functools import cached_property, partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.branches.enclosed.tracing import trace
from enumsol.condensation.data import EXACT_DOF_LIMIT
from enumsol.support.deadlines import TimeOverError, over
from enumsol.trusted.arcs.many_digits import affordable
from enumsol.trusted.arcs.precise import PreciseSelection, PreciseSystem
from enumsol.trusted.arcs.selection_balls import ArcSelection, ArcSystem

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from numpy.typing import NDArray

    from enumsol.branches.enclosed.arc_parts import ArcPart, Trace
    from enumsol.model.problem import ContactProblem
    from enumsol.selections.solution import Codes

    Array = NDArray[np.float64]
    Bounds = tuple[Fraction, Fraction]

#: Events are not sharpened when their bounds are this narrow, relative to alpha.
_NARROW = 2.0**-60
#: Error of the values at a vertex, relative to the largest, up to which balls in double arithmetic will do where many
#: digits cost much.
_CLOSE = 2.0**-20


class TracedProblem:
    """Selections of one problem over alpha, in double arithmetic and, where that is affordable, in many digits.

    Parameters
    ----------
    problem : ContactProblem
    interval : (Fraction, Fraction)
    origin : Fraction or None
        The alpha at which g vanishes. Solutions on either side of it are those of a constant load times the distance.

    Raises
    ------
    NotEnclosedError
        A is positive definite only within rounding.
    """

    def __init__(self, problem: ContactProblem, interval: Bounds, origin: Fraction | None) -> None:
        self.problem, self.interval = problem, interval
        self.origin = origin if origin is not None and interval[0] <= origin <= interval[1] else None
        scaled = problem.condensed.at(float(sum(interval) / 2)).scaled if self.origin is None else None
        if scaled is None:
            # the load at the end that is farther away
            far = max(interval, key=lambda end: abs(end - Fraction(self.origin or 0)))
            scaled = problem.condensed.at(float(far)).scaled
        self.units = scaled
        self.force, self.length = scaled.force, scaled.length
        self._systems = {
            side: ArcSystem.of(problem.enclosure, self.force, self.length, side)
            for side in ((0.0,) if self.origin is None else (-1.0, 1.0))
        }
        self._selections: dict[tuple[Codes, float], ArcSelection] = {}
        self._precise: dict[tuple[Codes, float], PreciseSelection] = {}

    @property
    def sparing(self) -> bool:
        """Many digits cost much here, and are asked for only where balls in double arithmetic do not decide."""
        return self.problem.n > EXACT_DOF_LIMIT

    def __reduce__(self) -> tuple[Any, ...]:
        """Made again: balls of many digits cannot be pickled."""
        return type(self), (self.problem, self.interval, self.origin)

    @cached_property
    def _precise_system(self) -> PreciseSystem | None:
        return PreciseSystem.of(self.problem) if affordable(self.problem) else None

    def selection(self, codes: Codes, side: float) -> ArcSelection:
        """A selection in double arithmetic."""
        if (codes, side) not in self._selections:
            self._selections[codes, side] = ArcSelection(self._systems[side], codes)
        return self._selections[codes, side]

    def precise(self, codes: Codes, side: float) -> PreciseSelection | None:
        """A selection in many digits; None where the body is too large for them, and once the time is over."""
        try:
            if over() or self._precise_system is None:
                return None
        except TimeOverError:
            return None
        if (codes, side) not in self._precise:
            system = self._precise_system.constant_load(side) if side else self._precise_system
            self._precise[codes, side] = PreciseSelection(system, codes)
        return self._precise[codes, side]

    # -- traces ----------------------------------------------------------------------------------------------------

    def spans(self, pieces: Iterable[Bounds]) -> list[tuple[float, float, float]]:
        """Pieces of the interval joined where they touch, rounded outward, with the side of the origin."""
        merged: list[list[Fraction]] = []
        for a, b in sorted(pieces):
            if merged and merged[-1][1] >= a and merged[-1][1] != self.origin:
                merged[-1][1] = max(b, merged[-1][1])
            else:
                merged.append([a, b])
        found = []
        for a, b in merged:
            inside = self.origin is not None and a < self.origin < b
            for x, y in pairwise((a, self.origin, b) if inside and self.origin is not None else (a, b)):
                side = 0.0 if self.origin is None else 1.0 if y > self.origin else -1.0
                found.append((_down(x), -_down(-y), side))
        return found

    def trace(self, where: Mapping[Codes, Iterable[Bounds]], found: list[Trace]) -> None:
        """Where selections hold on pieces of the interval, of every selection its own.

        ``found`` takes the traces; on Ctrl-C those of the selections that are finished.
        """
        trace(
            [
                (self.selection(codes, side), low, high, partial(self.precise, codes, side), side)
                for codes, pieces in where.items()
                for low, high, side in self.spans(pieces)
            ],
            found,
            sharpened=not self.sparing,
        )

    def sharpen(self, found: Trace, part: ArcPart) -> Bounds | None:
        """Narrower bounds of an event's zero; None where there is no need or no means."""
        low, high = (Fraction(end) for end in part.zero)
        width = Fraction(_NARROW * max(abs(float(low)), abs(float(high))))
        if high - low <= width:
            return None
        precise = self.precise(found.selection.rows.codes, found.side)
        return None if precise is None else precise.enclosed(part.condition, low, high, width / 4)

    # -- values ----------------------------------------------------------------------------------------------------

    def values(self, codes: Codes, alpha: Fraction, *, precisely: bool) -> tuple[Array, Array] | None:
        """lambda [force] and w [length] of a selection's solution, 2p each; None where it is not proven regular.

        ``precisely`` asks for many digits, to be rounded last, where they are affordable and make a difference.
        """
        factor, side = Fraction(1), 0.0
        if self.origin is not None:
            if alpha == self.origin:
                return np.zeros(2 * self.problem.p), np.zeros(2 * self.problem.p)
            factor, side = abs(alpha - self.origin), 1.0 if alpha > self.origin else -1.0
        enclosed = self.selection(codes, side).at(float(alpha)) if self.sparing or not precisely else None
        close = enclosed is not None and all(_is_close(part.mid, part.rad) for part in enclosed[:2])
        precise = self.precise(codes, side) if precisely and not close else None
        if precise is not None:
            found = precise.forces(alpha)
            if found is not None:
                return tuple(np.array([float(v.mid()) for v in part]) * float(factor) for part in found)  # type: ignore[return-value]
        enclosed = enclosed or self.selection(codes, side).at(float(alpha))
        if enclosed is None:
            return None
        forces, w, _ = enclosed
        return forces.mid * self.force * float(factor), w.mid * self.length * float(factor)

    def slip_signs(self, codes: Codes, alpha: Fraction, nodes: Sequence[int]) -> Mapping[int, int]:
        """Signs of w_t of some nodes at a selection's solution, 0 where they are not proven."""
        side = 0.0 if self.origin is None else 1.0 if alpha > self.origin else -1.0
        enclosed = self.selection(codes, side).at(float(alpha)) if alpha != self.origin else None
        if enclosed is None:
            return dict.fromkeys(nodes, 0)
        w, p = enclosed[1], self.problem.p
        return {i: int(w.mid[p + i] > 2 * w.rad[p + i]) - int(w.mid[p + i] < -2 * w.rad[p + i]) for i in nodes}


def _is_close(middle: Array, radius: Array) -> bool:
    return bool(np.max(radius) <= _CLOSE * np.max(np.abs(middle)))


def _down(value: Fraction) -> float:
    """The largest float that is not larger."""
    rounded = float(value)
    return rounded if Fraction(rounded) <= value else float(np.nextafter(rounded, -np.inf))
