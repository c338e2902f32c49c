"""One branch of solutions followed over alpha in floats, selection by selection; nothing here is trusted.

Where the problem has one solution it is the whole graph (theory, section 7.15).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from enumsol.model.statuses import ACROSS, FRICTIONLESS, SLIP_MINUS, SLIP_PLUS, UNDECIDED
from enumsol.search.reduction import NEAR, Reduction
from enumsol.support.deadlines import look
from enumsol.trusted.selection import Selection

if TYPE_CHECKING:
    from collections.abc import Callable

    from enumsol.arithmetic.balls import Ball
    from enumsol.condensation.condensed import ScaledSystem
    from enumsol.support.array_types import Codes, Floats
    from enumsol.trusted.arcs.selection_balls import ArcSystem


#: Where a chain begins, beside the end of its interval, by its length; steps to an event, and how close is near enough.
_BESIDE, _STEPS, _CLOSE = 1e-7, 40, 1e-12


@dataclass(frozen=True)
class Link:
    """A selection and where it seems to hold."""

    low: float
    high: float
    codes: Codes


class LoadedSystem:
    """The condensed problem as a function of alpha in floats, the middle of balls.

    Parameters
    ----------
    arcs : ArcSystem
    units : ScaledSystem
        Of the body, or of that on springs, with the same units.
    start : callable, optional
        Gives the selection of a root at an alpha, or None; by default it is sought as of a body that is held.
    """

    def __init__(
        self,
        arcs: ArcSystem[Ball],
        units: ScaledSystem,
        start: Callable[[float], Codes | None] | None = None,
    ) -> None:
        self.S, self.g0, self.g1 = arcs.S.mid, arcs.g0.mid, arcs.g1.mid
        self.F0, self.F1, self.reach = arcs.F0, arcs.F1, arcs.reach
        self._units, self._start = units, start

    @property
    def p(self) -> int:
        """Number of contact nodes."""
        return len(self.F0)

    def at(self, alpha: float) -> ScaledSystem:
        """The system at one alpha."""
        return replace(self._units, g=self.g0 + alpha * self.g1, F=np.maximum(self.F0 + alpha * self.F1, 0.0))

    def selection(self, alpha: float) -> Codes | None:
        """The selection of a root at an alpha, or None."""
        if self._start is not None:
            return self._start(alpha)
        system, reduction = self.at(alpha), self.reduction(alpha)
        found = reduction.solution((np.zeros(2 * system.p), system.g)) or reduction.solution(None)
        return None if found is None else tuple(found[1])

    def reduction(self, alpha: float) -> Reduction:
        """The problem at one alpha with all nodes free."""
        return Reduction(self.at(alpha), (UNDECIDED,) * self.p, tuple(range(self.p)), {})


class SelectionCurve:
    """A selection's solution as a function of alpha."""

    def __init__(self, system: LoadedSystem, codes: Codes) -> None:
        self._system, self.rows = system, Selection(codes, len(system.reach))
        self._slope = self.rows.columns(system.S, system.F1, 0)

    def at(self, alpha: float) -> tuple[Floats, Floats, Floats, Floats, Floats, Floats]:
        """lambda, w and the conditions, then their slopes.

        Raises
        ------
        numpy.linalg.LinAlgError
            The selection is singular.
        """
        system, rows = self._system, self.rows
        F, F1 = system.F0 + alpha * system.F1, system.F1
        W, dW = rows.columns(system.S, F), self._slope
        g, M = system.g0 + alpha * system.g1, W[rows.unknown]
        y = np.asarray(np.linalg.solve(M, g[rows.unknown]))
        dy = np.asarray(np.linalg.solve(M, system.g1[rows.unknown] - dW[rows.unknown] @ y))
        w, dw = g - W @ y, np.asarray(system.g1 - W @ dy - dW @ y)
        force, slope = rows.forces(y, F), rows.forces(dy, F) + rows.forces(y, F1, unit=0)
        widens, cones = np.zeros(len(rows.conditions)), len(rows.moving) + len(rows.closed)
        widens[cones : cones + 2 * len(rows.stick)] = np.tile(F1[rows.stick] * y[rows.normal], 2)
        bounds = (system.reach, 0.0 * system.reach) if len(system.reach) else (None, None)
        return force, w, rows.slacks(y, w, F, bounds[0]), slope, dw, rows.slacks(dy, dw, F, bounds[1]) + widens


class Chains:
    """Branches of solutions that go on with alpha, as far as they were followed.

    Parameters
    ----------
    system : LoadedSystem
    last : float
        End of the interval.
    """

    def __init__(self, system: LoadedSystem, last: float) -> None:
        self.system, self._last = system, last
        self._known: list[list[Link]] = []

    def over(self, low: float, high: float) -> list[Link] | None:
        """The selections of one branch from low to high, in order; None where none was found that goes so far."""
        for chain in self._known:
            if chain[0].low <= low and high <= chain[-1].high:
                return [link for link in chain if link.high >= low and link.low <= high]
        chain = self._followed(low)
        if not chain or chain[-1].high < high:
            return None
        self._known.append(chain)
        return [link for link in chain if link.low <= high]

    @cached_property
    def _most(self) -> int:
        # selections of a chain; more are given up
        return 16 * (self.system.p + 4)

    def _followed(self, first: float) -> list[Link]:
        """The branch of the solution beside an alpha."""
        alpha = first + _BESIDE * (self._last - first)
        try:
            codes = self.system.selection(alpha)
            found: list[Link] = []
            while codes is not None and len(found) < self._most:
                look()
                curve = SelectionCurve(self.system, codes)
                event = self._event(curve, alpha)
                if event is None:
                    break
                end, condition = event
                found.append(Link(found[-1].high if found else first, end, codes))
                if condition is None:
                    break
                codes, alpha = self._beyond(curve, end, condition), end
        except np.linalg.LinAlgError:
            pass
        return found

    def _event(self, curve: SelectionCurve, alpha: float) -> tuple[float, int | None] | None:
        """Alpha at which a condition vanishes next, and which; the end of the interval and None where none does."""
        first = alpha
        for _ in range(_STEPS):
            *_, values, _, _, slopes = curve.at(alpha)
            ahead = np.full(len(values), np.inf)
            falls = slopes < 0
            ahead[falls] = values[falls] / -slopes[falls]
            condition = int(np.argmin(ahead))
            step = max(float(ahead[condition]), first - alpha)
            if abs(step) <= _CLOSE * max(abs(alpha), abs(self._last - first)):
                return alpha, condition
            if not alpha + step < self._last:
                if alpha == self._last:
                    return (alpha, None) if np.min(values) >= -NEAR else None
                step = self._last - alpha
            alpha += step
        return None

    def _beyond(self, curve: SelectionCurve, alpha: float, condition: int) -> Codes | None:
        """The selection behind an event; None where the branch turns back."""
        node, kind = curve.rows.conditions[condition]
        if node >= self.system.p:
            return None  # the rigid displacement reaches its bound
        if (curve.rows.codes[node], kind) not in ACROSS:
            return None  # several conditions vanish together: a node that sticks loses its force
        (code, _), *others = ACROSS[curve.rows.codes[node], kind]
        if others:
            slip = float(curve.at(alpha)[1][self.system.p + node])
            rubs = self.system.F0[node] != 0 or self.system.F1[node] != 0
            code = (SLIP_PLUS if slip > 0 else SLIP_MINUS) if rubs else FRICTIONLESS
        codes = curve.rows.codes
        beyond = SelectionCurve(self.system, (*codes[:node], code, *codes[node + 1 :]))
        *_, values, _, _, slopes = beyond.at(alpha)
        own = [k for k, (i, _) in enumerate(beyond.rows.conditions) if i == node]
        vanishing = min(own, key=lambda k: abs(float(values[k])))
        # by more than this, relative to its size, a condition falls behind an event where the branch turns back
        turns = slopes[vanishing] < -1e-9 * np.max(np.abs(slopes), initial=0.0)
        return None if turns else beyond.rows.codes
