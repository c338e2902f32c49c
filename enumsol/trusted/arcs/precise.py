"""Selections over short intervals of alpha in balls of many digits (theory, section 7.14).

Where several conditions vanish within the rounding of double arithmetic, S and g are computed from the problem's own
data in balls of taylor.PRECISION bits, and the events are told apart there. Over a short interval the unknowns and
their slopes are enclosed at once; conditions whose slopes have one sign are known from their values at both ends.
`verified_in_many_digits` solves selections at one alpha that other arithmetics leave open (theory, section 6.3).

S, g0 and g1 come from solutions in floats that exact residuals refine: the factors of A in double arithmetic give some
thirty bits of A^-1 K more with every step, K = [B', f, load_slope]. The residuals are integers: nothing is rounded, and
the matrix A is touched only where it has entries.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from functools import cached_property, partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from flint import arb, arb_mat, fmpz_mat

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball, upper_sum
from enumsol.arithmetic.rationals import as_objects
from enumsol.condensation.enclosure import NotEnclosedError, scaled
from enumsol.support.deadlines import look, tell
from enumsol.trusted.arcs.selection_balls import ArcSystem
from enumsol.trusted.arcs.taylor import AlphaFunctions, ball_of, column, matrix, precision, sign_of, upper, uppers
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
    h, change = loads * unit
    return held.bordered((G * unit).T, h, change, reach) if exactly else None


class PreciseSelection:
    """A selection as a function of alpha, in balls of many digits.

    Parameters
    ----------
    system : ArcSystem
        In many digits.
    codes : p status codes, complete

    Attributes
    ----------
    rows : Selection
    """

    def __init__(self, system: ArcSystem[NDArray[Any]], codes: Sequence[int]) -> None:
        self.system, self.rows = system, Selection(codes, len(system.reach))

    @cached_property
    def functions(self) -> AlphaFunctions:
        """Its conditions over alpha."""
        system, rows = self.system, self.rows
        with precision():
            parts = []
            for (M, b, C, c), unit in zip(system.equations(rows), (1, 0), strict=True):
                # the last function is one
                table = matrix([*C.tolist(), [arb(0)] * len(rows.unknown)])
                parts.append((matrix(M.tolist()), column(b.tolist()), table, column([*c.tolist(), arb(unit)])))
        constant = not np.any(system.F1[[*rows.slip, *rows.stick]])
        matrices, loads, tables, values = zip(*parts, strict=True)
        return AlphaFunctions(matrices, loads, tables, values, constant)

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
        """lambda and w as 2p arb each; None where the selection is not proven regular."""
        system, rows, contact = self.system, self.rows, slice(2 * self.rows.p)
        with precision():
            F, g = self.friction(alpha), system.g0 + ball_of(alpha) * system.g1
            W, y = rows.columns(system.S, F), np.empty(0, dtype=object)
            if len(rows.unknown):
                try:
                    solved = matrix(W[rows.unknown].tolist()).solve(column(g[rows.unknown].tolist()))
                except ZeroDivisionError:
                    return None
                y = as_objects(solved.entries())
                g = g - W @ y
                g[rows.unknown] = arb(0)
            return rows.forces(y, F, arb(0))[contact], g[contact]

    def index(self, alpha: Fraction) -> int:
        """Sign of det M, 0 where it is not proven."""
        with precision():
            M = matrix(self.rows.matrix(self.system.S, self.friction(alpha)).tolist())
            return sign_of(M.det()) if M.nrows() else 1

    def friction(self, alpha: Fraction) -> NDArray[Any]:
        """F at an alpha, p arb."""
        with precision():
            first, slope = (self.system.exact(part) for part in (self.system.F0, self.system.F1))
            return np.asarray(first + ball_of(alpha) * slope)

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
        found, index = selection.forces(alpha), selection.index(alpha)
        if found is None or not index:
            return None
        force, w = (values / system.exact(unit) for values, unit in zip(found, units, strict=True))
        slack = conditions_of(codes, force, w, selection.friction(alpha))
        return VerifiedSelection(_in_floats(force), _in_floats(w), _in_floats(slack), index)


def _in_floats(values: NDArray[Any]) -> Ball:
    """Balls in double arithmetic that hold balls of many digits; exact zeros stay so."""
    mid = np.array([float(x.mid()) for x in values])
    known = np.array([x == 0 for x in values], dtype=bool)
    away = np.array([upper(x - arb(m)) for x, m in zip(values, mid.tolist(), strict=True)])
    with np.errstate(over="ignore", invalid="ignore"):
        return Ball(mid, np.where(known, 0.0, np.maximum(away * SAFE, _RADIUS * np.abs(mid)) + TINY))


def products(left: Floats | sp.sparray, right: Floats) -> NDArray[Any]:
    """The product of two matrices of floats, the first of which may be sparse, in balls."""
    rows, factors = sp.csr_array(left), np.array([[arb(x) for x in row] for row in right.tolist()], dtype=object)
    found = np.full((rows.shape[0], right.shape[1]), arb(0), dtype=object)
    for i, (first, last) in enumerate(pairwise(rows.indptr)):
        for value, j in zip(rows.data[first:last].tolist(), rows.indices[first:last], strict=True):
            found[i] = found[i] + arb(value) * factors[j]
    return found


#: Residuals are refined to this many bits, beside columns of size one; the error of S has twice as many.
_RESIDUAL_BITS = 170
#: Bits behind the point of solutions.
_SOLUTION_BITS = 208
#: Most steps; a step that gains fewer bits is the last.
_STEPS, _LEAST_GAIN = 40, 4
#: Rows of A that are multiplied together.
_ROWS = 128


def affordable(problem: ContactProblem) -> bool:
    """True if a problem is small enough for balls of many digits: by the entries of A and the number of rows."""
    # most products of an entry of A with one of a solution in a step: some ten seconds for all steps
    return bool(problem.A.nnz * (problem.contact_rows.shape[0] + 2) <= 2**24)


def refined_table(problem: ContactProblem) -> list[list[Any]] | None:
    """B A^-1 [B', f, load_slope] in balls, 2p rows of 2p + 2 arb; None where A is not proven positive definite.

    With X an approximation of A^-1 K and E = K - A X, without rounding,

        k_i' A^-1 k_j  =  k_i' x_j + x_i' e_j + e_i' A^-1 e_j,       |e_i' A^-1 e_j|  <=  ||e_i|| ||e_j|| / mu(A).

    Raises
    ------
    TimeOverError
        The deadline that holds here has passed.
    """
    try:
        bound = problem.enclosure.stiffness_bound
    except NotEnclosedError:
        return None
    scale = problem.products.scale
    A, _ = scaled(sp.csr_array(problem.A), scale, scale)
    slope = np.zeros(problem.n) if problem.load_slope is None else problem.load_slope
    K = _columns(np.column_stack([problem.contact_rows.toarray().T, problem.f, slope]), scale)
    entries = _ScaledIntegers.of(*_parts(A.data))
    X, E, bits = _refined(problem, A, entries, K, scale)
    size = problem.contact_rows.shape[0]
    first = fmpz_mat(K.values.T[:size].tolist()) * fmpz_mat(X.tolist())
    second = fmpz_mat(X.T[:size].tolist()) * fmpz_mat(E.tolist())
    lengths = [arb((sum(e * e for e in column), -2 * bits)).sqrt() for column in E.T.tolist()]
    table = []
    for i in range(size):
        row = []
        for j in range(size + 2):
            rest = (lengths[i] * lengths[j] / arb(bound)).upper()
            value = arb((int(first[i, j]), -K.bits - _SOLUTION_BITS)) + arb((int(second[i, j]), -_SOLUTION_BITS - bits))
            row.append((value + arb(0, rest)) * arb((1, K.units[i] + K.units[j])))
        table.append(row)
    return table


class _ScaledIntegers(NamedTuple):
    """Numbers as integers, values * 2^-bits; the columns of a matrix may have units, 2^unit, beside that."""

    values: NDArray[Any]
    bits: int
    units: list[int]

    @classmethod
    def of(cls, whole: NDArray[Any], exponent: NDArray[Any], units: NDArray[Any] | None = None) -> _ScaledIntegers:
        """The numbers whole * 2^exponent."""
        exponent = np.where(whole != 0, exponent if units is None else exponent - units, 0)
        bits = -int(np.min(exponent, initial=0))
        return cls(
            whole.astype(object) << (exponent + bits).astype(object), bits, [] if units is None else units.tolist()
        )


def _columns(floats: Floats, scale: Floats) -> _ScaledIntegers:
    """The columns of K, A's scaling applied, in units in which their largest entries are near one."""
    whole, exponent = _parts(floats)
    # a product by a power of two, without the underflow that floats may have
    exponent = exponent + np.frexp(scale)[1][:, None] - 1
    largest = np.max(np.where(whole != 0, exponent + 53, -(2**30)), axis=0)
    return _ScaledIntegers.of(whole, exponent, np.where(np.any(whole, axis=0), largest, 0))


def _parts(floats: Floats) -> tuple[NDArray[Any], NDArray[Any]]:
    """Integers m and e with floats = m 2^e."""
    mantissa, exponent = np.frexp(floats)
    return np.ldexp(mantissa, 53).astype(np.int64), exponent.astype(np.int64) - 53


def _refined(
    problem: ContactProblem, A: sp.csr_array, entries: _ScaledIntegers, K: _ScaledIntegers, scale: Floats
) -> tuple[NDArray[Any], NDArray[Any], int]:
    """X times 2^_SOLUTION_BITS, the exact residual K - A X times 2^bits, and bits."""
    bits = entries.bits + _SOLUTION_BITS + K.bits
    E = K.values << (bits - K.bits)
    X = np.zeros_like(E)
    before = np.inf
    for _ in range(_STEPS):
        sizes = np.array([max((abs(e).bit_length() for e in column), default=0) for column in E.T.tolist()])
        largest = int(np.max(sizes, initial=0)) - bits
        if largest <= -_RESIDUAL_BITS or largest > before - _LEAST_GAIN:
            break
        before = largest
        tell("bits of A^-1 B'", max(-largest, 0), _RESIDUAL_BITS)
        # bits of a residual that floats are given
        drop = np.maximum(sizes - 60, 0)
        floats = (E >> drop.astype(object)).astype(float)
        step = np.asarray(problem.factorization.solve(floats / scale[:, None], refined=False) / scale[:, None])
        if not np.all(np.isfinite(step)):
            break
        whole, exponent = _parts(step)
        shift = np.where(whole != 0, exponent + drop - (bits - _SOLUTION_BITS), 0)
        dX = whole.astype(object) << np.maximum(shift, 0).astype(object) >> np.maximum(-shift, 0).astype(object)
        X = X + dX
        E = E - (_product(A, entries.values, dX) << K.bits)
    return X, E, bits


def _product(A: sp.csr_array, entries: NDArray[Any], X: NDArray[Any]) -> NDArray[Any]:
    """A X in integers; every row of A has an entry."""
    parts = []
    for start in range(0, A.shape[0], _ROWS):
        look()
        ends = A.indptr[start : start + _ROWS + 1]
        part = slice(ends[0], ends[-1])
        terms = entries[part, None] * X[A.indices[part]]
        parts.append(np.add.reduceat(terms, ends[:-1] - ends[0], axis=0))
    return np.concatenate(parts)
