"""Functions that depend smoothly on alpha over a short interval, in balls of many digits (theory, section 7.14).

Alpha is given by tau in [-1, 1]; the unknowns of linear equations are polynomials in tau, with balls around zero for
what is left of them and of their slopes. Conditions whose slopes have one sign are known from their values at both
ends. With one more column and one more row a matrix M is regular where det M has a simple zero: functions that have the
signs of the conditions and of det M are then smooth, and known over a whole box around the zero (under Zeros of the
determinant).
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from flint import arb, arb_mat, ctx, fmpq

from enumsol.arithmetic.balls import SAFE, UNIT, upper_sum
from enumsol.trusted.arcs.over_parts import OverInterval

if TYPE_CHECKING:
    from collections.abc import Sequence
    from contextlib import AbstractContextManager

    from enumsol.support.array_types import Floats, NDArray

    Signs = NDArray[np.int8]
    Number = float | Fraction
    Pair = tuple[Any, ...]

#: Bits of the arithmetic.
PRECISION = 320


def upper(value: arb) -> float:
    """At least the size of all numbers in a ball."""
    return float(np.nextafter(float(abs(value).upper()), np.inf))


def uppers(values: arb_mat) -> Floats:
    """Upper bounds of the sizes of all entries of a matrix."""
    sizes = np.array([[float(abs(x).upper()) for x in row] for row in values.tolist()])
    bounds: Floats = np.nextafter(sizes, np.inf)
    return bounds


def precision() -> AbstractContextManager[object]:
    """The precision of flint's balls, for a while."""
    context: AbstractContextManager[object] = ctx.workprec(PRECISION)
    return context


def matrix(rows: list[list[Any]]) -> Any:
    """A matrix of balls, by its rows."""
    return arb_mat(len(rows), len(rows[0]) if rows else 0, [x for row in rows for x in row])


def column(values: Sequence[Any]) -> Any:
    """A matrix with one column."""
    return arb_mat(len(values), 1, list(values))


def ball_of(alpha: Fraction) -> Any:
    """A ball that holds a fraction."""
    return arb(fmpq(alpha.numerator, alpha.denominator))


def sign_of(value: arb) -> int:
    """Sign of all numbers in a ball, 0 where it is not proven."""
    return int(value > 0) - int(value < 0)


def signs_of(values: arb_mat) -> Signs:
    """Signs of the balls in a column."""
    return np.array([sign_of(values[k, 0]) for k in range(values.nrows())], dtype=np.int8)


#: Powers of tau in the unknowns: more of them allow longer intervals, and cost a product each.
_TERMS = 12
#: Bound of how much M may change over an interval; of this the norm is chosen where that is small enough; and steps
#: to such a norm.
_LARGEST_SHIFT, _SMALL_SHIFT, _STEPS = 0.5, 0.25, 20


@dataclass(frozen=True, eq=False)
class Smooth:
    """Functions of tau, the entries of columns.

    Attributes
    ----------
    terms : list of columns
        Coefficients of the powers of tau.
    left, left_slope : columns
        Balls that hold what is left, and its slopes.
    shift : float
        Bound of how much the matrix changes of the equations that they solve.
    """

    terms: list[Any]
    left: Any
    left_slope: Any
    shift: float = 0.0

    @classmethod
    def solution(cls, y: arb_mat, rise: arb_mat, P: arb_mat, sizes: Floats) -> Smooth | None:
        """The unknowns of M y = g, with y and their slopes ``rise`` at tau = 0 and P = M(0)^{-1} M'.

        They are y + tau (I + tau P)^{-1} rise (theory, (7.17)). None where P is too large. ``sizes`` are at least those
        of the entries of P.
        """
        terms = [y, rise]
        while len(terms) <= _TERMS:
            terms.append(-(P * terms[-1]))
        rest = P * terms[-1]
        found = _norm(uppers(rise)[:, 0], sizes)
        if found is None:
            return None
        u, k = found
        norm = float(np.max(uppers(rest)[:, 0] / u)) * SAFE
        # ||P^m d|| times bounds of (I + tau P)^-1, and of the slope of tau^(m + 1) (I + tau P)^-1
        growths = 1.0 / (1.0 - k), (_TERMS + 1) / (1.0 - k) + k / (1.0 - k) ** 2
        # covers underflow of some products
        errors = [u * (norm * growth * (1.0 + 16 * UNIT) * SAFE) + 2.0**-1070 for growth in growths]
        left, left_slope = (column([arb(0, float(e)) for e in error]) for error in errors)
        return cls(terms, left, left_slope, k)

    def mapped(self, C: arb_mat, C1: arb_mat, c: arb_mat, c1: arb_mat) -> Smooth:
        """(c + tau c1) + (C + tau C1) times these functions."""
        before = [None, *self.terms]
        terms = [
            (C * term if term is not None else c * 0) + (C1 * last if last is not None else c * 0)
            for term, last in zip([*self.terms, None], before, strict=True)
        ]
        terms[0], terms[1] = terms[0] + c, terms[1] + c1
        turned = C + C1 * arb(0, 1)
        return Smooth(terms, turned * self.left, C1 * self.left + turned * self.left_slope, self.shift)

    def entry(self, i: int) -> Smooth:
        """A single function among them."""
        return Smooth(
            [column([x[i, 0]]) for x in self.terms], *(column([x[i, 0]]) for x in (self.left, self.left_slope))
        )

    @cached_property
    def values(self) -> Any:
        """All values."""
        found = self.left
        for k, term in enumerate(self.terms):
            found = found + term * _power(k)
        return found

    @cached_property
    def slopes(self) -> Any:
        """All slopes."""
        found = self.left_slope
        for k, term in enumerate(self.terms[1:]):
            found = found + term * (_power(k) * (k + 1))
        return found

    def times(self, factor: Smooth) -> Smooth:
        """Every one of them times the one function ``factor``."""
        scalars = [term[0, 0] for term in factor.terms]
        nothing = self.left * 0
        terms = [nothing] * (len(self.terms) + len(scalars) - 1)
        for i, term in enumerate(self.terms):
            for j, scalar in enumerate(scalars):
                terms[i + j] = terms[i + j] + term * scalar
        # (f + e) (p + r) - f p = e (p + r) + f r
        whole, whole_slope = factor.values[0, 0], factor.slopes[0, 0]
        left, left_slope = factor.left[0, 0], factor.left_slope[0, 0]
        smooth = Smooth(self.terms, nothing, nothing)
        rest = self.left * whole + smooth.values * left
        rest_slope = (
            self.left * whole_slope + self.left_slope * whole + smooth.slopes * left + smooth.values * left_slope
        )
        return Smooth(terms, rest, rest_slope)

    def minus(self, other: Smooth) -> Smooth:
        """The difference of functions of equally many terms."""
        terms = [a - b for a, b in zip(self.terms, other.terms, strict=True)]
        return Smooth(terms, self.left - other.left, self.left_slope - other.left_slope)


def _norm(sizes: Floats, P: Floats) -> tuple[Floats, float] | None:
    """u > 0 and k with ||P|| <= k in the norm max |x| / u; None where k is too large.

    u has the proportions of ``sizes``, unless k is smaller with some parts of it larger.
    """
    largest = float(np.max(sizes))
    # rises that count as none where norms are chosen
    least = u = sizes / largest + 1e-3 if largest > 1e-250 else np.ones(len(sizes))
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(_STEPS):
            grown = upper_sum(P * u, axis=1)
            k = float(np.max(grown / u)) * SAFE
            if k < _SMALL_SHIFT:
                break
            u = np.maximum(least, grown / _SMALL_SHIFT)
    return (u, k) if k < _LARGEST_SHIFT and np.all(np.isfinite(u)) else None


def _power(k: int) -> Any:
    """All values of tau^k."""
    return arb(1) if k == 0 else arb(0.5, 0.5) if k % 2 == 0 else arb(0, 1)


def joined(*parts: arb_mat) -> Any:
    """Matrices beside one another."""
    return matrix([[x for row in rows for x in row] for rows in zip(*(part.tolist() for part in parts), strict=True)])


def columns_of(X: arb_mat, *counts: int) -> list[Any]:
    """A matrix cut into matrices of so many columns."""
    rows, found, first = X.tolist(), [], 0
    for count in counts:
        found.append(matrix([row[first : first + count] for row in rows]))
        first += count
    return found


@dataclass(frozen=True, eq=False)
class AlphaFunctions:
    """Functions of alpha with the signs of a selection's conditions; the last has that of det M times a constant.

    The equations are M X = g. Without a border X has one column y, and the functions are c + C y, the last of them 1.
    With one, M has the column b and the row d more, and X the columns (v, mu) and (x, rho), where M v + mu b = 0,
    d v = 1, and M x + rho b = g, d x = 0: the functions are mu (c + C x) - rho C v, and mu.

    Attributes
    ----------
    M, g, C, c : pairs of arb_mat
        At alpha = 0, and by how much they grow with alpha.
    constant : bool
        Neither M nor C depends on alpha.
    """

    M: Pair
    g: Pair
    C: Pair
    c: Pair
    constant: bool = False

    @cached_property
    def lines(self) -> Pair | None:
        """The functions as c0 + alpha c1, where neither M nor C depends on alpha; else None."""
        if not self.constant:
            return None
        if not self.M[0].nrows():
            return self.c
        try:
            y0, y1 = (self.M[0].solve(g) for g in self.g)
        except ZeroDivisionError:
            return None
        return self.c[0] + self.C[0] * y0, self.c[1] + self.C[0] * y1

    @cached_property
    def _constant_index(self) -> int:
        """Sign of det M where M does not depend on alpha."""
        return sign_of(self.M[0].det()) if self.M[0].nrows() else 1

    def solve(self, a: arb, algorithm: str | None = None) -> arb_mat | None:
        """Unknowns for every alpha in a ball; None where M is not proven regular."""
        M, g = (part[0] + part[1] * a for part in (self.M, self.g))
        try:
            X: arb_mat = M.solve(g, algorithm=algorithm) if M.nrows() else g
        except ZeroDivisionError:
            return None
        return X

    def signs_by(self, a: arb, algorithm: str | None) -> Signs | None:
        """Signs of the functions over a ball; None where M is not proven regular."""
        if self.lines is not None:
            return signs_of(self.lines[0] + self.lines[1] * a)
        X = self.solve(a, algorithm)
        if X is None:
            return None
        C, c = (part[0] + part[1] * a for part in (self.C, self.c))
        if X.ncols() == 1:
            return signs_of(c + C * X)
        (v, x), last = columns_of(X, 1, 1), X.nrows() - 1
        return signs_of((c + C * x) * v[last, 0] - (C * v) * x[last, 0])

    @cached_property
    def _signs(self) -> dict[Fraction, Signs | None]:
        return {}

    def signs_at(self, alpha: Fraction) -> Signs | None:
        """1 or -1 where a function is positive or negative at an alpha, else 0; None where it is not regular."""
        if alpha not in self._signs:
            with precision():
                # the faster way gives wider balls
                signs = self.signs_by(ball_of(alpha), "lu")
                self._signs[alpha] = (
                    self.signs_by(ball_of(alpha), None) if signs is None or not np.all(signs) else signs
                )
        return self._signs[alpha]

    def expansion(self, low: Fraction, high: Fraction) -> ShortExpansion | None:
        """The functions over an interval (theory, (7.17)); None where it is too long. In the precision of many digits.

        By the powers of tau, with what is left of the unknowns.
        """
        middle, radius = ball_of((low + high) / 2), ball_of((high - low) / 2)
        if self.lines is not None:
            constant, slope = self.lines
            values, near = constant + slope * ball_of(low).union(ball_of(high)), constant + slope * middle
            return ShortExpansion(self, low, high, values, slope * radius, self._constant_index, near=near)
        (M, M1), (g, g1), (C, C1), (c, c1) = (
            (part[0] + part[1] * middle, part[1] * radius) for part in (self.M, self.g, self.C, self.c)
        )
        size, count = M.nrows(), g.ncols()
        if not size:
            return ShortExpansion(self, low, high, c + c1 * arb(0, 1), c1, 1, near=c)
        try:
            solved = M.solve(joined(g, g1, M1))
        except ZeroDivisionError:
            return None
        *parts, P = columns_of(solved, *(1,) * (2 * count), size)
        sizes = uppers(P)
        pairs = zip(parts[:count], parts[count:], strict=True)
        found = [one for x, x1 in pairs if (one := Smooth.solution(x, x1 - P * x, P, sizes)) is not None]
        if len(found) < count:
            return None
        *turning, y = found
        free, sign, shift = y.mapped(C, C1, c, c1), sign_of(M.det()), max(one.shift for one in found)
        if not turning:
            return ShortExpansion(self, low, high, free.values, free.slopes, sign, shift=shift, near=free.terms[0])
        (v,), nothing = turning, c * 0
        turn = v.mapped(C, C1, nothing, nothing)
        whole = free.times(v.entry(size - 1)).minus(turn.times(y.entry(size - 1)))
        # all solutions of the equations are x + s v; the last row is that of mu
        lines = list(zip(free.values.entries(), turn.values.entries(), strict=True))[:-1]
        nowhere = all(_none_above([(a.upper(), (side * b).upper()) for a, b in lines]) for side in (1, -1))
        return ShortExpansion(self, low, high, whole.values, whole.slopes, sign, shift=shift, nowhere=nowhere)

    def bordered(self, alpha: arb, radius: arb) -> AlphaFunctions | None:
        """With a border that takes away the zero of det M closest to an alpha; None where none is found.

        What is proven with it holds for any border.
        """
        border = _nearest_pole(self.M[0] + self.M[1] * alpha, self.M[1] * radius)
        if border is None:
            return None
        size = self.M[0].nrows()
        nothing = [0.0] * size
        M, M1 = (
            matrix([*([*row, arb(x)] for row, x in zip(M.tolist(), b, strict=True)), [*map(arb, d), arb(0)]])
            for M, (b, d) in zip(self.M, (border, (nothing, nothing)), strict=True)
        )
        g, g1 = (
            matrix([*([arb(0), x] for (x,) in g.tolist()), [arb(one), arb(0)]])
            for g, one in zip(self.g, (1, 0), strict=True)
        )
        # the last function is mu
        C, C1 = (matrix([[*row, arb(0)] for row in part.tolist()]) for part in self.C)
        return AlphaFunctions((M, M1), (g, g1), (C, C1), self.c)


@dataclass(frozen=True, eq=False)
class ShortExpansion:
    """Conditions of a selection over a short interval, like ``over_parts.Expansion``.

    Attributes
    ----------
    functions : AlphaFunctions
    low, high : Fraction
    values, slopes : columns
        Those of the functions over the whole interval.
    orientation : int
        Sign of det M where the last function is positive.
    shift : float
        Bound of how much the matrix of the equations changes.
    nowhere : bool
        The selection has no root, whatever the signs of the functions are.
    near : column, optional
        Values of the functions in the middle, where M is regular throughout.
    """

    functions: AlphaFunctions
    low: Fraction
    high: Fraction
    values: Any
    slopes: Any
    orientation: int
    shift: float = 0.0
    nowhere: bool = False
    near: Any = None

    @cached_property
    def _whole(self) -> Signs:
        return signs_of(self.values)

    @cached_property
    def rises(self) -> Signs:
        """Signs of the slopes."""
        return signs_of(self.slopes)

    def over(self, low: Number, high: Number) -> OverInterval:
        """Knowledge of a part of the interval."""
        signs, unknown = self._whole.copy(), np.zeros_like(self._whole)
        found = [self.functions.signs_at(Fraction(alpha)) for alpha in (low, high)]
        first, last = (unknown if end is None else end for end in found)
        # without a change of the slope's sign, values lie between those at the ends
        same = (signs == 0) & (first == last) & ((self.rises != 0) | (low == high))
        signs[same] = first[same]
        # a root has functions that are all positive or zero, or all negative or zero
        none = self.nowhere or bool(np.any(signs < 0) and np.any(signs > 0))
        sign = int(signs[-1])
        index = sign * self.orientation
        signs, first, last, rises = (part[:-1] * (sign or 1) for part in (signs, first, last, self.rises))
        return OverInterval(signs, bool(index), none, index, (first, last), rises * abs(sign))


def _none_above(lines: list[tuple[Any, Any]]) -> bool:
    """True if a + s b is negative for some of these (a, b), at every s >= 0."""
    if any(a < 0 and b <= 0 for a, b in lines):
        return True
    least = [-a / b for a, b in lines if a < 0]
    return any(-a / b < s for a, b in lines if a >= 0 and b < 0 for s in least)


def _nearest_pole(M: arb_mat, M1: arb_mat) -> tuple[list[float], list[float]] | None:
    """A column b = M1 w and a row d, with (M + tau M1) w = 0 and d M^-1 (M + tau M1) = 0 for the tau closest to zero.

    The matrix with this border changes with tau as if this zero of det (M + tau M1) were not there.
    """
    size = M.nrows()
    try:
        P = M.solve(M1, algorithm="approx")
    except ZeroDivisionError:
        return None
    table = np.array([[float(x.mid()) for x in row] for row in P.tolist()])
    if not np.all(np.isfinite(table)):
        return None
    rates, right = np.linalg.eig(table)
    others, left = np.linalg.eig(table.T)
    real = np.flatnonzero((rates.imag == 0.0) & (rates.real != 0.0))
    if not len(real):
        return None
    k = real[np.argmax(np.abs(rates[real]))]
    w, d = right[:, k].real, left[:, np.argmin(np.abs(others - rates[k]))].real
    w = w / np.max(np.abs(w))
    along = float(d @ w)
    b = M1 * column([arb(float(value)) for value in w])
    border = [float(b[i, 0].mid()) for i in range(size)], (d / along).tolist() if along else []
    return border if border[1] and np.all(np.isfinite([*border[0], *border[1]])) else None
