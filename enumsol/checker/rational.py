"""The condensed problem in rationals, as the checker computes it; the search condenses by code of its own."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from flint import fmpq, fmpq_mat

from enumsol.arithmetic.rationals import is_positive_definite, rational
from enumsol.condensation.affine import exactly_at
from enumsol.condensation.enclosure import NotEnclosedError
from enumsol.condensation.free_displacements import exact_matrices, free_displacements, solved
from enumsol.kernel.rows import (
    FORBIDDEN,
    FRICTIONLESS,
    NONNEGATIVE,
    OPEN,
    SLIP_MINUS,
    SLIP_PLUS,
    STICK,
)

if TYPE_CHECKING:
    from collections.abc import Sequence
    from fractions import Fraction

    import numpy as np
    from numpy.typing import NDArray

    from enumsol.problem import ContactProblem

Vector = list[Any]


class RationalSystem:
    """S, g and F of a problem at alpha, all rational; S from a solve with the whole of A.

    Parameters
    ----------
    problem : ContactProblem
    alpha : Fraction

    Raises
    ------
    NotEnclosedError
        S is not positive definite: the energy bound and all that rests on it need that. Or the problem has more than
        EXACT_DOF_LIMIT degrees of freedom.
    """

    def __init__(self, problem: ContactProblem, alpha: Fraction) -> None:
        self.p, a = problem.p, rational(alpha)
        A, B = exact_matrices(problem)
        self.S = B * solved(A, B.transpose())
        if not is_positive_definite(self.S):
            raise NotEnclosedError("the condensed compliance S is not positive definite in rational arithmetic")
        self.g: Vector = [x + a * y for x, y in zip(*free_displacements(problem), strict=True)]
        self.F: Vector = [rational(F) for F in exactly_at(alpha, *problem.friction)]
        self._inverse: Any = None

    def slip(self, point: Vector) -> Vector:
        """W = g - S lambda."""
        moved = (self.S * fmpq_mat([[x] for x in point])).entries()
        return [g - m for g, m in zip(self.g, moved, strict=True)]

    def holds(self, codes: Sequence[int], point: Vector) -> bool:
        """Whether lambda satisfies every equation and condition of the selection."""
        w, p = self.slip(point), self.p
        return all(_holds(code, point[i], point[p + i], w[i], w[p + i], self.F[i]) for i, code in enumerate(codes))

    def equations(self, codes: Sequence[int]) -> tuple[Any, Vector]:
        """Matrix and right-hand side of the selection's 2p equations in lambda."""
        p, rows, rhs = self.p, [], []
        S = self.S.tolist()
        for i, code in enumerate(codes):
            normal, tangent = [fmpq(0)] * (2 * p), [fmpq(0)] * (2 * p)
            if code == OPEN:
                normal[i] = tangent[p + i] = fmpq(1)
                rows += [normal, tangent]
                rhs += [fmpq(0), fmpq(0)]
            elif code == STICK:
                rows += [S[i], S[p + i]]
                rhs += [self.g[i], self.g[p + i]]
            else:
                turn = {SLIP_PLUS: self.F[i], SLIP_MINUS: -self.F[i], FRICTIONLESS: fmpq(0)}[code]
                tangent[i], tangent[p + i] = -turn, fmpq(1)
                rows += [S[i], tangent]
                rhs += [self.g[i], fmpq(0)]
        return fmpq_mat(rows), rhs

    def conditions(self, codes: Sequence[int], point: Vector) -> Vector:
        """The selection's inequalities at a point, as values that must not be negative."""
        p, w = self.p, self.slip(point)
        values = []
        for i, code in enumerate(codes):
            n, t, F = point[i], point[p + i], self.F[i]
            if code == OPEN:
                values.append(-w[i])
            elif code == STICK:
                values += [n, F * n - t, F * n + t]
            else:
                values.append(n)
                if code != FRICTIONLESS:
                    values.append(w[p + i] if code == SLIP_PLUS else -w[p + i])
        return values

    def energy_bound_positive(
        self, signs: NDArray[np.int8], rows: Sequence[int], values: Sequence[float], units: Sequence[Fraction]
    ) -> bool:
        """The dual inequality in rationals: 4 (y'b + z'd) + v'S^{-1}v < 0 for the rows as equations a_j'lambda = b_j.

        ``units`` turns the multiplier of a row kind and node into the problem's units, flattened as kind * p + node.
        """
        p, S = self.p, self.S.tolist()
        v, total = list(self.g), fmpq(0)
        for row, value in zip(rows, values, strict=True):
            kind, i = divmod(row, p)
            allowed = int(signs[i, kind])
            if allowed == FORBIDDEN or (allowed == NONNEGATIVE and value < 0):
                return False
            u = rational(value) * rational(units[row])
            if kind in (0, 2, 3):
                v[i] += u * (fmpq(1) if kind == 0 else self.F[i])
            if kind in (1, 2, 3):
                v[p + i] += -u if kind == 2 else u
            if kind >= 4:
                # the row is sign * w[k] = sign * (g - S lambda)[k]
                k, sign = (i, -1) if kind == 4 else (p + i, 1 if kind == 5 else -1)
                v = [x - sign * u * s for x, s in zip(v, S[k], strict=True)]
                total -= sign * u * self.g[k]
        if self._inverse is None:
            self._inverse = self.S.inv()
        column = fmpq_mat([[x] for x in v])
        return bool(4 * total > (column.transpose() * (self._inverse * column))[0, 0])


def _holds(code: int, n: Any, t: Any, w_n: Any, w_t: Any, F: Any) -> bool:
    if code == OPEN:
        return bool(n == 0 and t == 0 and w_n <= 0)
    if w_n != 0 or n < 0:
        return False
    if code == STICK:
        return bool(w_t == 0 and -F * n <= t <= F * n)
    if code == SLIP_PLUS:
        return bool(t == F * n and w_t >= 0)
    if code == SLIP_MINUS:
        return bool(t == -F * n and w_t <= 0)
    return bool(code == FRICTIONLESS and F == 0 and t == 0)
