"""Selections over short intervals of alpha in balls of many digits (theory, section 7.14).

Where several conditions vanish within the rounding of double arithmetic, S and g are computed from the problem's own
data in balls of many_digits.PRECISION bits, and the events are told apart there. Over a short interval the unknowns and
their slopes are enclosed at once; conditions whose slopes have one sign are known from their values at both ends.
`verified_in_many_digits` solves selections at one alpha that other arithmetics leave open (theory, section 6.3).
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from functools import partial
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
    upper,
    uppers,
)
from enumsol.trusted.arcs.selection_balls import ArcSystem
from enumsol.trusted.arcs.taylor import AlphaFunctions
from enumsol.trusted.at_alpha import VerifiedSelection, conditions_of
from enumsol.trusted.selection import Selection

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from enumsol.model.problem import ContactProblem
    from enumsol.model.rigid_modes import RigidModes
    from enumsol.support.array_types import Floats, NDArray
    from enumsol.trusted.arcs.taylor import ShortExpansion

    Signs = NDArray[np.int8]
    Number = float | Fraction


def system_in_many_digits(problem: ContactProblem) -> ArcSystem[NDArray[Any]] | None:
    """The condensed problem over alpha from the problem's own data.

    None where A is not proven positive definite or has too many entries, or the units of a rigid displacement under- or
    overflow.

    Raises
    ------
    TimeOverError
        The deadline that holds here has passed.
    """
    with precision():
        table = refined_table(problem.on_springs) if affordable(problem) else None
        if table is None:
            return None
        whole, size = as_objects(table), len(table)
        offset = np.concatenate([problem.gap, problem.slip_offset.ravel(order="F")])
        held = ArcSystem(whole[:, :size], whole[:, size], whole[:, size + 1], *problem.affine_friction)
        held = replace(held, g0=held.g0 - held.exact(offset))
        return held if problem.held else _bordered(held, problem, problem.modes)


def _bordered(
    held: ArcSystem[NDArray[Any]], problem: ContactProblem, modes: RigidModes
) -> ArcSystem[NDArray[Any]] | None:
    """System of the body that nothing holds, from the one on springs; None where its bounds over- or underflow."""
    N, most = modes.N, modes.reach(problem.rigid_reach)
    slope = np.zeros(problem.n) if problem.load_slope is None else problem.load_slope
    G, loads = products(problem.contact_rows, N), products(N.T, np.column_stack([problem.f, slope])).T
    # units of q in which the rows of G are as large as S
    sizes = np.array([[abs(float(x.mid())) for x in row] for row in G])
    largest = float(np.max(uppers(matrix(held.S.tolist()))))
    exponents = [round(float(np.log2(largest / size))) if size > 0 < largest else 0 for size in np.max(sizes, axis=0)]
    unit = as_objects([arb((1, exponent)) for exponent in exponents])
    reach = np.ldexp(most, [-exponent for exponent in exponents])
    exactly = np.array_equal(np.ldexp(reach, exponents), most)
    return held.bordered((G * unit).T, *(loads * unit), reach) if exactly else None


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

    def __init__(self, system: ArcSystem[NDArray[Any]], codes: Sequence[int]) -> None:
        self.system = system
        self.rows = rows = Selection(codes, len(system.reach))
        with precision():
            parts = []
            for (M, b, C, c), unit in zip(system.equations(rows), (1, 0), strict=True):
                # the last function is one
                table = matrix([*C.tolist(), [arb(0)] * len(rows.unknown)])
                parts.append((matrix(M.tolist()), column(b.tolist()), table, column([*c.tolist(), arb(unit)])))
        constant = not np.any(system.F1[[*rows.slip, *rows.stick]])
        self.functions = AlphaFunctions(*zip(*parts, strict=True), constant)

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

    def forces(self, alpha: Fraction) -> tuple[NDArray[Any], NDArray[Any]] | None:
        """lambda and w as 2p arb each."""
        system, rows, contact = self.system, self.rows, 2 * self.rows.p
        with precision():
            a = ball_of(alpha)
            solved = self.functions.solve(a)
            if solved is None:
                return None
            force = rows.forces(as_objects(solved.entries()), self.friction(a), arb(0))
            w = system.g0 + a * system.g1 - system.S @ force
            w[rows.unknown] = arb(0)
            return force[:contact], w[:contact]

    def friction(self, alpha: arb) -> NDArray[Any]:
        """F at an alpha, p arb."""
        first, slope = (self.system.exact(part) for part in (self.system.F0, self.system.F1))
        return np.asarray(first + alpha * slope)

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
                W0, W1 = (matrix(rows.columns(system.S[p:], system.exact(F), unit).tolist()) for F, unit in parts)
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


def verified_in_many_digits(
    problem: ContactProblem, alpha: Fraction, force: Floats, length: Floats
) -> Callable[[Sequence[int]], VerifiedSelection | None] | None:
    """Function that gives the verified solution of a complete selection at one alpha.

    It is in units of every row given by powers of two, and None where the selection's matrix is not proven regular.
    None in place of the function where ``system_in_many_digits`` is, or where the slip offset is not the floats that
    the problem has.

    Raises
    ------
    TimeOverError
        The deadline that holds here has passed.
    """
    system = system_in_many_digits(problem) if problem.offset_radius is None else None
    return None if system is None else partial(_verified, system, alpha, (force, length))


def _verified(
    system: ArcSystem[NDArray[Any]], alpha: Fraction, units: tuple[Floats, Floats], codes: Sequence[int]
) -> VerifiedSelection | None:
    selection = PreciseSelection(system, codes)
    with precision():
        a = ball_of(alpha)
        found, sign = selection.forces(alpha), selection.functions.determinant_sign(a)
        if found is None or not sign:
            return None
        force, w = (values / system.exact(unit) for values, unit in zip(found, units, strict=True))
        balls = (_in_floats(values) for values in (force, w, conditions_of(codes, force, w, selection.friction(a))))
        return VerifiedSelection(*balls, sign)


def _in_floats(values: NDArray[Any]) -> Ball:
    """Balls in double arithmetic that hold balls of many digits; exact zeros stay so."""
    mid = np.array([float(x.mid()) for x in values])
    known = np.array([x == 0 for x in values], dtype=bool)
    away = np.array([upper(x - arb(m)) for x, m in zip(values, mid.tolist(), strict=True)])
    with np.errstate(over="ignore", invalid="ignore"):
        return Ball(mid, np.where(known, 0.0, np.maximum(away * SAFE, _RADIUS * np.abs(mid)) + TINY))
