"""Selections over short intervals of alpha in balls of many digits (theory, section 7.14).

Where several conditions vanish within the rounding of double arithmetic, S and g are computed from the problem's own
data in balls of many_digits.PRECISION bits, and the events are told apart there. Over a short interval the unknowns and
their slopes are enclosed at once; conditions whose slopes have one sign are known from their values at both ends.
`PreciseAtAlpha` solves selections at one alpha that other arithmetics leave open (theory, section 6.3).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from flint import arb, arb_mat

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball, upper_sum
from enumsol.arithmetic.rationals import as_objects
from enumsol.trusted.arcs.many_digits import (
    affordable,
    ball_of,
    column,
    matrix,
    precision,
    products,
    refined_table,
    sign_of,
    upper,
    uppers,
)
from enumsol.trusted.arcs.taylor import AlphaFunctions
from enumsol.trusted.at_alpha import VerifiedSelection
from enumsol.trusted.selection import Selection, row_values
from enumsol.trusted.status_rows import CONDITIONS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.model.problem import ContactProblem
    from enumsol.model.rigid_modes import RigidModes
    from enumsol.support.array_types import Floats, NDArray
    from enumsol.trusted.arcs.taylor import ShortExpansion

    Signs = NDArray[np.int8]
    Number = float | Fraction


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
    """A selection as a function of alpha, in balls of many digits.

    Parameters
    ----------
    system : PreciseSystem
    codes : p status codes, complete

    Attributes
    ----------
    rows : Selection
    functions : AlphaFunctions
    """

    def __init__(self, system: PreciseSystem, codes: Sequence[int]) -> None:
        self.system = system
        self.rows = rows = Selection(codes, len(system.reach))
        with precision():
            parts = []
            for load, F, unit in ((system.g0, system.F0, 1), (system.g1, system.F1, 0)):
                at, friction = as_objects(load), as_objects(F)
                W = rows.columns(system.rows, friction, unit)
                C, c = rows.inequalities(W, at, friction, arb(0), unit, as_objects(system.reach))
                # the last function is one
                table = matrix([*C.tolist(), [arb(0)] * len(rows.unknown)])
                M, g = matrix(W[rows.unknown].tolist()), column(at[rows.unknown].tolist())
                parts.append((M, g, table, column([*c.tolist(), arb(unit)])))
        constant = not any(system.F1[i] != 0 for i in (*rows.slip.tolist(), *rows.stick.tolist()))
        M, g, C, c = zip(*parts, strict=True)
        self.functions = AlphaFunctions(M, g, C, c, constant)

    def expansion(self, low: Number, high: Number) -> ShortExpansion | None:
        """The conditions over [low, high], also where the matrix may be singular; None where that is too long."""
        first, last = Fraction(low), Fraction(high)
        with precision():
            found = self.functions.expansion(first, last)
            # where a matrix changes by no more than this over an interval, no zero of its determinant is near
            if found is not None and found.shift <= 2.0**-4:
                return found
            # a zero of det M is near, or lies between them
            middle, radius = ball_of((first + last) / 2), ball_of((last - first) / 2)
            lines = self.functions.bordered(middle + radius / 16 if found is None else middle, radius)
            bordered = None if lines is None else lines.expansion(first, last)
            return bordered if found is None or (bordered is not None and bordered.shift < found.shift / 2) else found

    def forces(self, alpha: Fraction) -> tuple[list[Any], list[Any]] | None:
        """lambda and w as 2p arb each."""
        system, rows, contact = self.system, self.rows, 2 * self.rows.p
        with precision():
            a = ball_of(alpha)
            solved = self.functions.solve(a)
            if solved is None:
                return None
            F = as_objects([F0 + a * F1 for F0, F1 in zip(system.F0, system.F1, strict=True)])
            forces = rows.forces(as_objects(solved.entries()), F, arb(0)).tolist()
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
                parts, (M0, M1) = ((system.F0, 1), (system.F1, 0)), self.functions.M
                W0, W1 = (matrix(rows.columns(system.rows[p:], as_objects(F), unit).tolist()) for F, unit in parts)
                place = {row: k for k, row in enumerate(rows.unknown.tolist())}
                units = arb_mat(len(place), len(stick))
                for j, i in enumerate(stick):
                    units[place[p + i], j] = arb(1)
                try:
                    slopes = (W0 + W1 * a) * (M0 + M1 * a).solve(units)
                except ZeroDivisionError:
                    return None
                sizes = [[upper(slopes[k, j]) for j in range(len(stick))] for k in range(p)]
                spread = upper_sum(np.array(sizes) * offset.rad[stick] * SAFE, axis=1)
            mid = np.array([float(x.mid()) for x in moved])
            rad = np.array([upper(x - arb(m)) for x, m in zip(moved, mid.tolist(), strict=True)])
            return Ball(mid, (rad + spread) * SAFE)


#: Radii in double arithmetic, relative to the numbers: beyond their rounding, since another factorization of A leads to
#: other last bits.
_RADIUS = 8 * UNIT


@dataclass(frozen=True, eq=False)
class PreciseAtAlpha:
    """The condensed problem at one alpha in balls of many digits, in scaled units: w = g - S lambda.

    Attributes
    ----------
    S : object array (2p, 2p) of arb
    g, F : object arrays of 2p and p arb
    """

    S: NDArray[Any]
    g: NDArray[Any]
    F: NDArray[Any]

    @classmethod
    def of(cls, problem: ContactProblem, alpha: Fraction, force: Floats, length: Floats) -> PreciseAtAlpha | None:
        """Condensed from the problem's own data, in units of every row given by powers of two.

        None where A is not proven positive definite or has too many entries, or where the slip offset is not the floats
        that the problem has.

        Raises
        ------
        TimeOverError
            The deadline that holds here has passed.
        """
        if problem.offset_radius is not None or not affordable(problem):
            return None
        system = PreciseSystem.of(problem)
        if system is None:
            return None
        with precision():
            a = ball_of(alpha)
            forces, lengths = (as_objects([arb(float(x)) for x in unit]) for unit in (force, length))
            S = system.rows * forces[:, None] / lengths[None, :]
            g = (as_objects(system.g0) + a * as_objects(system.g1)) / lengths
            return cls(S, g, as_objects(system.F0) + a * as_objects(system.F1))

    def solve(self, codes: Sequence[int]) -> VerifiedSelection | None:
        """The verified solution of a complete selection, or None when its matrix is not proven regular."""
        selection, rows = Selection(codes), None
        with precision():
            columns = selection.columns(self.S, self.F)
            rows = selection.unknown
            y, sign, w = np.empty(0, dtype=object), 1, self.g.copy()
            if len(rows):
                M = matrix(columns[rows].tolist())
                sign = sign_of(M.det())
                try:
                    y = as_objects(M.solve(column(self.g[rows].tolist())).entries())
                except ZeroDivisionError:
                    return None
                w = self.g - columns @ y
                w[rows] = arb(0)
            if not sign:
                return None
            force = selection.forces(y, self.F, arb(0))
            kinds, nodes = np.array([(kind, i) for i, code in enumerate(codes) for kind in CONDITIONS[code][1]]).T
            slack = row_values(force, w, self.F)[kinds, nodes]
            return VerifiedSelection(_in_floats(force), _in_floats(w), _in_floats(slack), sign)


def _in_floats(values: NDArray[Any]) -> Ball:
    """Balls in double arithmetic that hold balls of many digits; exact zeros stay so."""
    mid = np.array([float(x.mid()) for x in values])
    known = np.array([x == 0 for x in values], dtype=bool)
    away = np.array([upper(x - arb(m)) for x, m in zip(values, mid.tolist(), strict=True)])
    with np.errstate(over="ignore", invalid="ignore"):
        return Ball(mid, np.where(known, 0.0, np.maximum(away * SAFE, _RADIUS * np.abs(mid)) + TINY))
