"""Selections over short intervals of alpha in balls of many digits (theory, section 7.14).

Where several conditions vanish within the rounding of double arithmetic, S and g are computed from the problem's own
data in balls of many_digits.PRECISION bits, and the events are told apart there. Over a short interval the unknowns and
their slopes are enclosed at once; conditions whose slopes have one sign are known from their values at both ends.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from flint import arb, arb_mat

from enumsol.arithmetic.balls import SAFE, Ball, upper_sum
from enumsol.arithmetic.rationals import as_objects
from enumsol.trusted.arcs.bordered import BorderedExpansion, BorderedLines, Lines
from enumsol.trusted.arcs.many_digits import (
    ZERO_BITS,
    ball_of,
    column,
    fraction_of,
    matrix,
    precision,
    products,
    refined_table,
    rounded,
    sign_of,
    signs_of,
    upper,
    uppers,
)
from enumsol.trusted.arcs.over_parts import OverInterval
from enumsol.trusted.arcs.taylor import Smooth, columns_of, joined
from enumsol.trusted.selection import Selection

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.model.problem import ContactProblem
    from enumsol.model.rigid_modes import RigidModes
    from enumsol.support.array_types import NDArray

    Signs = NDArray[np.int8]
    Number = float | Fraction

#: Steps of Newton's method from the middle of an interval, enlargements of a zero's bounds.
_STEPS, _WIDENINGS = 8, 6
#: Intervals shorter than this share of alpha are narrow beside the distances at which conditions bend.
_NEAR = Fraction(1, 2**30)
#: Where a matrix changes by no more than this over an interval, no zero of its determinant is near.
_LITTLE = 2.0**-4
#: Zeros are farther apart (tau), or the rounding of floats hides it.
_LEAST_SPLIT = 1e-12


@dataclass(frozen=True, eq=False)
class PreciseSystem:
    """The condensed problem over alpha in balls of many digits: w = g0 + alpha g1 - S lambda.

    Attributes
    ----------
    S : arb_mat, 2p x 2p
    g0, g1 : lists of 2p arb
    F0, F1 : lists of p arb
    reach : list of r arb
        As of ``ArcSystem``, in which S, g0 and g1 have as many rows more.
    """

    S: Any
    g0: list[Any]
    g1: list[Any]
    F0: list[Any]
    F1: list[Any]
    reach: list[Any] = field(default_factory=list)

    @classmethod
    def of(cls, problem: ContactProblem) -> PreciseSystem | None:
        """Condensed from the problem's own data; None where A is not proven positive definite.

        Raises
        ------
        TimeOverError
            The deadline that holds here has passed.
        """
        with precision():
            table = refined_table(problem.on_springs)
            if table is None:
                return None
            size = len(table)
            offset = np.concatenate([problem.gap, problem.slip_offset.ravel(order="F")]).tolist()
            S = matrix([row[:size] for row in table])
            g0 = [row[size] - arb(x) for row, x in zip(table, offset, strict=True)]
            F0, F1 = ([arb(float(x)) for x in part] for part in problem.affine_friction)
            held = cls(S, g0, [row[size + 1] for row in table], F0, F1)
            return held if problem.held else held._bordered(problem, problem.modes)

    def _bordered(self, problem: ContactProblem, modes: RigidModes) -> PreciseSystem:
        """System of the body that nothing holds, from the one on springs."""
        N, slope, r = modes.N, problem.load_slope, modes.r
        G = products(problem.contact_rows, N)
        loads = [[arb(0)] * r if part is None else products(N.T, part[:, None]).ravel() for part in (problem.f, slope)]
        # units of q in which the rows of G are as large as S
        sizes = np.array([[abs(float(x.mid())) for x in row] for row in G])
        largest = float(np.max(uppers(self.S)))
        units = [largest / size if size > 0 < largest else 1.0 for size in np.max(sizes, axis=0)]
        unit = as_objects([arb((1, round(float(np.log2(value))))) for value in units])
        G = G * unit
        rows = [[*row, *(-G[i])] for i, row in enumerate(self.S.tolist())]
        rows += [[*G[:, j], *([arb(0)] * r)] for j in range(r)]
        (g0, g1), reach = loads, modes.reach(problem.rigid_reach)
        return replace(
            self,
            S=matrix(rows),
            g0=[*self.g0, *(g0 * unit)],
            g1=[*self.g1, *(g1 * unit)],
            reach=[arb(float(most)) / one for most, one in zip(reach, unit, strict=True)],
        )

    @cached_property
    def rows(self) -> NDArray[Any]:
        """S as an array."""
        table: NDArray[Any] = as_objects(self.S.tolist())
        return table

    def constant_load(self, side: float) -> PreciseSystem:
        """For the constant load g1 or -g1 (see trusted.over_interval)."""
        return PreciseSystem(self.S, [arb(side) * x for x in self.g1], [arb(0)] * len(self.g1), self.F0, self.F1)


class PreciseSelection:
    """One selection as a function of alpha.

    Parameters
    ----------
    system : PreciseSystem
    codes : p status codes, complete

    Attributes
    ----------
    rows : Selection
    """

    def __init__(self, system: PreciseSystem, codes: Sequence[int]) -> None:
        self.system = system
        self.rows = rows = Selection(codes, len(system.reach))
        self._signs: dict[Fraction, Signs | None] = {}
        with precision():
            parts: tuple[list[Any], ...] = ([], [], [], [])
            for load, F, unit in ((system.g0, system.F0, 1), (system.g1, system.F1, 0)):
                at, friction = as_objects(load), as_objects(F)
                W = rows.columns(system.rows, friction, unit)
                held, free = rows.inequalities(W, at, friction, arb(0), unit, as_objects(system.reach))
                for part, value in zip(parts, (W[rows.unknown], at[rows.unknown], held, free), strict=True):
                    part.append(matrix(value.tolist()) if value.ndim == 2 else column(value.tolist()))
            self._M, self._g, self._C, self._c = (tuple(part) for part in parts)

    @cached_property
    def _lines(self) -> tuple[Any, Any] | None:
        """Conditions c0 + a c1, where neither M nor what they are made of depends on alpha; else None."""
        rows, F1 = self.rows, self.system.F1
        if any(F1[i] != 0 for i in (*rows.slip.tolist(), *rows.stick.tolist())):
            return None
        if not len(rows.unknown):
            return self._c
        try:
            y0, y1 = (self._M[0].solve(g) for g in self._g)
        except ZeroDivisionError:
            return None
        return self._c[0] + self._C[0] * y0, self._c[1] + self._C[0] * y1

    @cached_property
    def _constant_index(self) -> int:
        """Sign of det M where M does not depend on alpha."""
        return sign_of(self._M[0].det()) if self._M[0].nrows() else 1

    def solve(self, a: Any, algorithm: str | None = None) -> tuple[Any, Any] | None:
        """Unknowns for every alpha in a ball, and the matrix; None where that is not proven regular."""
        M = self._M[0] + self._M[1] * a
        if not M.nrows():
            return arb_mat(0, 1), M
        try:
            return M.solve(self._g[0] + self._g[1] * a, algorithm=algorithm), M
        except ZeroDivisionError:
            return None

    def slope(self, a: Any, y: Any, M: Any) -> Any:
        """Slopes of the conditions; no claim rests on them."""
        held = self._c[1] + self._C[1] * y
        if not M.nrows():
            return held
        rise = M.solve(self._g[1] - self._M[1] * y, algorithm="approx")
        return held + (self._C[0] + self._C[1] * a) * rise

    def values(self, a: Any, y: Any) -> Any:
        """Values of the conditions."""
        return self._c[0] + self._c[1] * a + (self._C[0] + self._C[1] * a) * y

    def signs_at(self, alpha: Fraction) -> Signs | None:
        """1 or -1 where a condition is positive or negative at an alpha, else 0; None where it is not regular."""
        if alpha not in self._signs:
            with precision():
                a = ball_of(alpha)
                if self._lines is not None:
                    self._signs[alpha] = signs_of(self._lines[0] + self._lines[1] * a)
                else:
                    # the faster way gives wider balls
                    signs = self._signs_by(a, "lu")
                    self._signs[alpha] = self._signs_by(a, None) if signs is None or not np.all(signs) else signs
        return self._signs[alpha]

    def _signs_by(self, a: Any, algorithm: str | None) -> Signs | None:
        solved = self.solve(a, algorithm)
        return None if solved is None else signs_of(self.values(a, solved[0]))

    def expansion(self, low: Number, high: Number) -> PreciseExpansion | BorderedExpansion | None:
        """The conditions over [low, high], also where the matrix may be singular; None where that is too long."""
        first, last = Fraction(low), Fraction(high)
        with precision():
            middle, radius = ball_of((first + last) / 2), ball_of((last - first) / 2)
            if self._lines is not None:
                constant, slope = self._lines
                values = constant + slope * ball_of(first).union(ball_of(last))
                near = constant + slope * middle
                return PreciseExpansion(self, first, last, values, slope * radius, self._constant_index, near)
            found = self._expansion(first, last, middle, radius)
            if found is not None and found.shift <= _LITTLE:
                return found
            # a zero of det M is near, or lies between them
            off = middle + radius / 16 if found is None else middle
            lines = BorderedLines.near(Lines(self._M, self._g, self._C, self._c), off, radius)
            bordered = None if lines is None else lines.expansion(first, last)
            return bordered if found is None or (bordered is not None and bordered.shift < found.shift / 2) else found

    def _expansion(self, first: Fraction, last: Fraction, middle: Any, radius: Any) -> PreciseExpansion | None:
        """The conditions by the powers of tau, with what is left of the unknowns (theory, (7.17))."""
        M, M1 = self._M[0] + self._M[1] * middle, self._M[1] * radius
        C, C1 = self._C[0] + self._C[1] * middle, self._C[1] * radius
        if not M.nrows():
            near, steep = self._c[0] + self._c[1] * middle, self._c[1] * radius
            return PreciseExpansion(self, first, last, near + steep * arb(0, 1), steep, 1, near)
        g, g1 = self._g[0] + self._g[1] * middle, self._g[1] * radius
        try:
            X = M.solve(joined(g, g1, M1))
        except ZeroDivisionError:
            return None
        y, rise, P = columns_of(X, 1, 1, M.ncols())
        unknowns = Smooth.solution(y, rise - P * y, P)
        if unknowns is None:
            return None
        found = unknowns.mapped(C, C1, self._c[0] + self._c[1] * middle, self._c[1] * radius)
        index = sign_of(M.det())
        return PreciseExpansion(self, first, last, found.values, found.slopes, index, found.terms[0], found.shift)

    def newton(
        self, condition: int, low: Fraction, high: Fraction, width: Fraction, steps: int = _STEPS
    ) -> Fraction | None:
        """Where a condition seems to vanish between two alphas, to a part of ``width``; no claim rests on it."""
        with precision():
            alpha, unit = (low + high) / 2, width / 2**8
            if self._lines is not None:
                constant, slope = (part[condition, 0].mid() for part in self._lines)
                return None if slope == 0 else rounded(fraction_of((-constant / slope).mid()), low, high, unit)
            for _ in range(steps):
                a = ball_of(alpha)
                solved = self.solve(a, "approx")
                if solved is None:
                    return None
                y, M = solved
                rise = self.slope(a, y, M)[condition, 0].mid()
                if not rise.is_finite() or rise == 0:
                    return None
                step = fraction_of((self.values(a, y)[condition, 0] / rise).mid())
                alpha = rounded(alpha - step, low, high, unit)
                # the next step is about the square of this one
                if step * step <= unit * (high - low):
                    break
            return alpha

    def enclosed(
        self, condition: int, low: Fraction, high: Fraction, width: Fraction | None = None
    ) -> tuple[Fraction, Fraction] | None:
        """Bounds of the only zero of a condition between two alphas: its signs there are proven to be opposite.

        They are about ``width`` apart, by default as close as zeros are told apart.
        """
        width = Fraction(1, 2**ZERO_BITS) * (high - low) if width is None else width
        # bounds that are narrow already are so near that one step is enough
        near = high - low <= _NEAR * max(abs(low), abs(high))
        for steps, widenings in ((1, 1), (_STEPS, _WIDENINGS)) if near else ((_STEPS, _WIDENINGS),):
            alpha = self.newton(condition, low, high, width, steps)
            if alpha is None:
                return None
            reach = width
            for _ in range(widenings):
                ends = max(alpha - reach, low), min(alpha + reach, high)
                signs = [self.signs_at(end) for end in ends]
                if all(found is not None for found in signs) and _opposite(signs, condition):
                    return ends
                reach *= 2**20
        return None

    def forces(self, alpha: Fraction) -> tuple[list[Any], list[Any]] | None:
        """lambda and w as 2p arb each."""
        system, rows, contact = self.system, self.rows, 2 * self.rows.p
        with precision():
            a = ball_of(alpha)
            solved = self.solve(a)
            if solved is None:
                return None
            F = as_objects([F0 + a * F1 for F0, F1 in zip(system.F0, system.F1, strict=True)])
            forces = rows.forces(as_objects(solved[0].entries()), F, arb(0)).tolist()
            moved = system.S * column(forces)
            w = [system.g0[r] + a * system.g1[r] - moved[r, 0] for r in range(contact)]
            return forces[:contact], w

    def positions(self, alpha: Fraction, offset: Ball) -> Ball | None:
        """Bt u of all nodes for every slip offset in a ball around the system's own; theory, (13.2).

        The root is an affine function of the offsets of the sticking nodes: its value at the middle of the ball and
        its slopes are computed with many digits, before anything is widened by the radii.
        """
        system, rows = self.system, self.rows
        p, stick = rows.p, rows.stick.tolist()
        found = self.forces(alpha)
        if found is None:
            return None
        with precision():
            a = ball_of(alpha)
            moved = [found[1][p + i] + arb(float(offset.mid[i])) for i in range(p)]
            spread = np.zeros(p)
            if any(offset.rad[i] for i in stick):
                parts = ((system.F0, 1), (system.F1, 0))
                W0, W1 = (matrix(rows.columns(system.rows[p:], as_objects(F), unit).tolist()) for F, unit in parts)
                place = {row: k for k, row in enumerate(rows.unknown.tolist())}
                units = arb_mat(len(place), len(stick))
                for j, i in enumerate(stick):
                    units[place[p + i], j] = arb(1)
                try:
                    slopes = (W0 + W1 * a) * (self._M[0] + self._M[1] * a).solve(units)
                except ZeroDivisionError:
                    return None
                sizes = [[upper(slopes[k, j]) for j in range(len(stick))] for k in range(p)]
                spread = upper_sum(np.array(sizes) * offset.rad[stick] * SAFE, axis=1)
            mid = np.array([float(x.mid()) for x in moved])
            rad = np.array([upper(x - arb(m)) for x, m in zip(moved, mid.tolist(), strict=True)])
            return Ball(mid, (rad + spread) * SAFE)


class PreciseExpansion:
    """Conditions of a selection over a short interval, like ``arcs.Expansion``; it is regular there.

    Attributes
    ----------
    low, high : Fraction
    apart : Fraction
        Zeros closer than this are not told apart.
    shift : float
        Bound of how much the matrix changes.
    rough, final : bool
        A shorter interval gives neither smaller errors, nor does it tell more zeros apart.
    """

    rough, final = False, True

    def __init__(
        self,
        selection: PreciseSelection,
        low: Fraction,
        high: Fraction,
        values: Any,
        slopes: Any,
        index: int,
        near: Any,
        shift: float = 0.0,
    ) -> None:
        self.low, self.high, self.shift = low, high, shift
        self.apart = (high - low) * Fraction(4, 2**ZERO_BITS)
        self._selection, self._index = selection, index
        self._whole, self._rises = signs_of(values), signs_of(slopes)
        self._small = [bool(abs(values[k, 0]) < arb(2) ** -ZERO_BITS) for k in range(values.nrows())]
        # about where conditions vanish, by tau in [-1, 1]
        self._crossings = [
            -float((near[k, 0] / slopes[k, 0]).mid()) if self._rises[k] else np.nan for k in range(values.nrows())
        ]

    def split(self) -> Fraction | None:
        """An alpha below which one condition seems to be negative, and above which another; None where there is none.

        No claim rests on it.
        """
        rising = [tau for tau, rise in zip(self._crossings, self._rises, strict=True) if rise > 0]
        falling = [tau for tau, rise in zip(self._crossings, self._rises, strict=True) if rise < 0]
        if not rising or not falling or max(rising) - min(falling) < _LEAST_SPLIT:
            return None
        tau = 0.5 * (max(rising) + min(falling))
        return self.low + Fraction(1 + tau) * (self.high - self.low) / 2 if abs(tau) < 1.0 else None

    def over(self, low: Number, high: Number) -> OverInterval:
        """What is known over a part of the interval."""
        signs, unknown = self._whole.copy(), np.zeros_like(self._whole)
        found = [self._selection.signs_at(Fraction(alpha)) for alpha in (low, high)]
        ends = tuple(unknown if end is None else end for end in found)
        if found[0] is not None and found[1] is not None:
            # without a change of the slope's sign, values lie between those at the ends
            same = (signs == 0) & (ends[0] == ends[1]) & ((self._rises != 0) | (low == high))
            signs[same] = ends[0][same]
        none = bool(np.any(signs < 0))
        return OverInterval(signs, bool(self._index), none, self._index, (ends[0], ends[1]), self._rises)

    def near(self, condition: int, low: Number, high: Number) -> tuple[Number, Number]:
        """As in arcs.Expansion; bounds are found at once, by ``zero_bounds``."""
        return low, low

    def zeros(self, condition: int) -> list[Fraction]:
        """Alphas inside the interval at which a condition seems to vanish; no claim rests on them."""
        if condition >= len(self._rises) or not self._rises[condition]:
            return []
        width = (self.high - self.low) / 2**ZERO_BITS
        found = self._selection.newton(condition, self.low, self.high, width)
        return [] if found is None or not self.low < found < self.high else [found]

    def flat(self, condition: int) -> bool:
        """True if a condition cannot be distinguished from zero."""
        return self._small[condition] if condition < len(self._small) else False

    def zero_bounds(self, condition: int, slope: int, low: Number, high: Number) -> tuple[Fraction, Fraction]:
        """Bounds of the only zero of a condition in a part, at whose ends it has opposite signs."""
        part = Fraction(low), Fraction(high)
        return self._selection.enclosed(condition, *part) or part


def _opposite(signs: Sequence[Any], condition: int) -> bool:
    return int(signs[0][condition]) * int(signs[1][condition]) < 0
