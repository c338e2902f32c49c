"""What depends smoothly on alpha over a short interval, in balls of many digits (theory, section 7.14).

Alpha is given by tau in [-1, 1]; the unknowns of linear equations are polynomials in tau, with balls around zero for
what is left of them and of their slopes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from flint import arb

from enumsol.arithmetic.balls import SAFE, UNIT, upper_sum
from enumsol.trusted.arcs.many_digits import column, matrix, uppers

if TYPE_CHECKING:
    from enumsol.support.array_types import Floats

#: Powers of tau in the unknowns.
_TERMS = 12
#: Bound of how much M may change over an interval; of this the norm is chosen where that is small enough; and steps
#: to such a norm.
_LARGEST_SHIFT, _SMALL_SHIFT, _STEPS = 0.5, 0.25, 20
#: Rises that count as none where norms are chosen.
_NO_RISE = 1e-250
#: Covers underflow of some products.
_SUBNORMAL = 2.0**-1070


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
    def solution(cls, y: Any, rise: Any, P: Any, sizes: Floats | None = None) -> Smooth | None:
        """The unknowns of M y = g, with y and their slopes ``rise`` at tau = 0 and P = M(0)^{-1} M'.

        They are y + tau (I + tau P)^{-1} rise (theory, (7.16)). None where P is too large. ``sizes`` are at least those
        of the entries of P, if they are known.
        """
        terms = [y, rise]
        while len(terms) <= _TERMS:
            terms.append(-(P * terms[-1]))
        rest = P * terms[-1]
        found = _norm(uppers(rise)[:, 0], uppers(P) if sizes is None else sizes)
        if found is None:
            return None
        u, k = found
        norm = float(np.max(uppers(rest)[:, 0] / u)) * SAFE
        # ||P^m d|| times bounds of (I + tau P)^-1, and of the slope of tau^(m + 1) (I + tau P)^-1
        growths = 1.0 / (1.0 - k), (_TERMS + 1) / (1.0 - k) + k / (1.0 - k) ** 2
        errors = [u * (norm * growth * (1.0 + 16 * UNIT) * SAFE) + _SUBNORMAL for growth in growths]
        left, left_slope = (column([arb(0, float(e)) for e in error]) for error in errors)
        return cls(terms, left, left_slope, k)

    def mapped(self, C: Any, C1: Any, c: Any, c1: Any) -> Smooth:
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
        """One of them."""
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
    least = u = sizes / largest + 1e-3 if largest > _NO_RISE else np.ones(len(sizes))
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


def joined(*parts: Any) -> Any:
    """Matrices beside one another."""
    return matrix([[x for row in rows for x in row] for rows in zip(*(part.tolist() for part in parts), strict=True)])


def columns_of(X: Any, *counts: int) -> list[Any]:
    """A matrix cut into matrices of so many columns."""
    rows, found, first = X.tolist(), [], 0
    for count in counts:
        found.append(matrix([row[first : first + count] for row in rows]))
        first += count
    return found
