"""A selection near zeros of det M, in balls of many digits (theory, section 7.14, under Zeros of the determinant).

With one more column and one more row, M is regular where det M has a simple zero. Functions that have the signs of the
conditions and of det M are then smooth, and known over a whole box around the zero.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from flint import arb, arb_mat

from enumsol.trusted.arcs.many_digits import ball_of, column, matrix, sign_of, signs_of, uppers
from enumsol.trusted.arcs.taylor import AlphaFunctions, ShortExpansion, Smooth, columns_of, joined

if TYPE_CHECKING:
    from collections.abc import Sequence
    from fractions import Fraction

    from enumsol.support.array_types import NDArray

    Signs = NDArray[np.int8]


@dataclass(frozen=True, eq=False)
class BorderedLines(AlphaFunctions):
    """Equations with the column b and the row d: M v + mu b = 0, d v = 1, and M x + rho b = g, d x = 0.

    mu (c + C x) - rho C v, of every condition, and mu as the last are what is examined (theory, section 7.14).

    Attributes
    ----------
    B, G, C, c : pairs of arb_mat
        The bordered matrix, right-hand sides of (v, mu) and of (x, rho), and the rows of conditions and of mu.
    """

    B: tuple[Any, Any]
    G: tuple[Any, Any]
    C: tuple[Any, Any]
    c: tuple[Any, Any]

    @classmethod
    def near(cls, lines: Sequence[tuple[Any, Any]], alpha: arb, radius: arb) -> BorderedLines | None:
        """With a border that takes away the zero of det M closest to an alpha; None where none is found.

        No claim rests on how well it does so. ``lines``: M, g, C and c of the equations M y = g of a selection and its
        conditions c + C y, each as a pair of matrices: at alpha = 0, and by how much they grow with alpha.
        """
        matrices, loads, turns, constants = lines
        border = _nearest_pole(matrices[0] + matrices[1] * alpha, matrices[1] * radius)
        if border is None:
            return None
        size = matrices[0].nrows()
        nothing = [0.0] * size
        B, B1 = (
            matrix([*([*row, arb(x)] for row, x in zip(M.tolist(), b, strict=True)), [*map(arb, d), arb(0)]])
            for M, (b, d) in zip(matrices, (border, (nothing, nothing)), strict=True)
        )
        G, G1 = (
            matrix([*([arb(0), x] for (x,) in g.tolist()), [arb(one), arb(0)]])
            for g, one in zip(loads, (1, 0), strict=True)
        )
        C, C1 = (matrix([*([*row, arb(0)] for row in part.tolist()), [arb(0)] * (size + 1)]) for part in turns)
        c, c1 = (column([*part.entries(), arb(one)]) for part, one in zip(constants, (1, 0), strict=True))
        return cls((B, B1), (G, G1), (C, C1), (c, c1))

    def signs_by(self, a: arb, algorithm: str | None) -> Signs | None:
        """Signs of the functions over a ball; None where B is not proven regular."""
        try:
            X = (self.B[0] + self.B[1] * a).solve(self.G[0] + self.G[1] * a, algorithm=algorithm)
        except ZeroDivisionError:
            return None
        (q, _), (w, _), ((mu, _), (rho, _)) = self._parts(a, X, X)
        return signs_of(q * mu - w * rho)

    def rise(self, a: arb, k: int) -> tuple[Any, Any] | None:
        """About the value of a function and its slope; no claim rests on them."""
        B = self.B[0] + self.B[1] * a
        try:
            X = B.solve(self.G[0] + self.G[1] * a, algorithm="approx")
            X1 = B.solve(self.G[1] - self.B[1] * X, algorithm="approx")
        except ZeroDivisionError:
            return None
        (q, q1), (w, w1), ((mu, mu1), (rho, rho1)) = self._parts(a, X, X1)
        value = q * mu - w * rho
        slope = q1 * mu + q * mu1 - w1 * rho - w * rho1
        return value[k, 0], slope[k, 0]

    def _parts(self, a: arb, X: arb_mat, X1: arb_mat) -> tuple[Any, Any, Any]:
        """Values and slopes of c + C y, of C v, and of mu and rho, from those of both columns."""
        C, last = self.C[0] + self.C[1] * a, X.nrows() - 1
        (v, y), (v1, y1) = ([column([part[i, j] for i in range(last + 1)]) for j in (0, 1)] for part in (X, X1))
        return (
            (self.c[0] + self.c[1] * a + C * y, self.c[1] + self.C[1] * y + C * y1),
            (C * v, self.C[1] * v + C * v1),
            ((v[last, 0], v1[last, 0]), (y[last, 0], y1[last, 0])),
        )

    def expansion(self, low: Fraction, high: Fraction) -> ShortExpansion | None:
        """The functions over an interval; None where it is too long. In the precision of many digits."""
        middle, radius = ball_of((low + high) / 2), ball_of((high - low) / 2)
        (B, B1), (G, G1), (C, C1), (c, c1) = (
            (part[0] + part[1] * middle, part[1] * radius) for part in (self.B, self.G, self.C, self.c)
        )
        size = B.nrows()
        try:
            solved = B.solve(joined(G, G1, B1))
        except ZeroDivisionError:
            return None
        *parts, P = columns_of(solved, 1, 1, 1, 1, size)
        sizes = uppers(P)
        v, y = (Smooth.solution(x, x1 - P * x, P, sizes) for x, x1 in (parts[::2], parts[1::2]))
        if v is None or y is None:
            return None
        nothing = c * 0
        free, turn = y.mapped(C, C1, c, c1), v.mapped(C, C1, nothing, nothing)
        found = free.times(v.entry(size - 1)).minus(turn.times(y.entry(size - 1)))
        # all solutions of the equations are x + s v; the last row is that of mu
        lines = list(zip(free.values.entries(), turn.values.entries(), strict=True))[:-1]
        nowhere = all(_none_above([(a.upper(), (side * b).upper()) for a, b in lines]) for side in (1, -1))
        sign, shift = sign_of(B.det()), max(v.shift, y.shift)
        return ShortExpansion(self, (low, high), found.values, found.slopes, sign, shift=shift, nowhere=nowhere)


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
