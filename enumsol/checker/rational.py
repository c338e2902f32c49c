"""The condensed problem in rationals, as the checker computes it; the search has its own code for this."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from flint import fmpq, fmpq_mat

from enumsol.arithmetic.rationals import is_positive_definite, rational
from enumsol.condensation.affine import exactly_at
from enumsol.condensation.enclosure import NotEnclosedError
from enumsol.condensation.free_displacements import exact_matrices, free_displacements, solved
from enumsol.trusted.status_rows import CONDITIONS, FORBIDDEN, NONNEGATIVE

if TYPE_CHECKING:
    from collections.abc import Sequence
    from fractions import Fraction

    import numpy as np
    from numpy.typing import NDArray

    from enumsol.model.problem import ContactProblem

Vector = list[Any]


class RationalSystem:
    """S, g and F of a problem at alpha, all rational; S from a solve with the whole of A.

    Parameters
    ----------
    problem : ContactProblem
    alpha : Fraction
    definite : S is proven positive definite already

    Raises
    ------
    NotEnclosedError
        S is not positive definite: the energy bound and all that rests on it need that. Or the problem has more than
        EXACT_DOF_LIMIT degrees of freedom.
    """

    def __init__(self, problem: ContactProblem, alpha: Fraction, *, definite: bool = False) -> None:
        self.p, a = problem.p, rational(alpha)
        A, B = exact_matrices(problem)
        self.S = B * solved(A, B.transpose())
        if not definite and not is_positive_definite(self.S):
            raise NotEnclosedError("the condensed compliance S is not positive definite in rational arithmetic")
        self.g: Vector = [x + a * y for x, y in zip(*free_displacements(problem), strict=True)]
        self.F: Vector = [rational(F) for F in exactly_at(alpha, *problem.friction)]
        self._S: list[Vector] = self.S.tolist()
        self._inverse: Any = None
        self.zero = fmpq(0)

    @property
    def size(self) -> int:
        """Numbers of a point."""
        return 2 * self.p

    def row(self, kind: int, node: int) -> tuple[Vector, Any]:
        """A row of ``trusted.status_rows`` as an affine function of lambda: 2p coefficients, and what is added."""
        p, form = self.p, [fmpq(0)] * (2 * self.p)
        if kind >= 4:
            k, sign = (node, -1) if kind == 4 else (p + node, 1 if kind == 5 else -1)
            return [-sign * s for s in self._S[k]], sign * self.g[k]
        if kind != 1:
            form[node] = fmpq(1) if kind == 0 else self.F[node]
        if kind != 0:
            form[p + node] = fmpq(-1 if kind == 2 else 1)
        return form, fmpq(0)

    def equations(self, codes: Sequence[int]) -> tuple[Any, Vector]:
        """Matrix and right-hand side of the selection's 2p equations in lambda."""
        rows = [self.row(kind, i) for i, code in enumerate(codes) for kind in CONDITIONS[code][0]]
        return fmpq_mat([form for form, _ in rows]), [-constant for _, constant in rows]

    def conditions(self, codes: Sequence[int], point: Vector) -> Vector:
        """The selection's inequalities at a point, as values that must not be negative."""
        rows = [self.row(kind, i) for i, code in enumerate(codes) for kind in CONDITIONS[code][1]]
        moved = (fmpq_mat([form for form, _ in rows]) * fmpq_mat([[x] for x in point])).entries()
        return [x + constant for x, (_, constant) in zip(moved, rows, strict=True)]

    def node_conditions(self, code: int, node: int, point: Vector) -> Vector:
        """The inequalities of a final code at a node, at a point."""
        rows = [self.row(kind, node) for kind in CONDITIONS[code][1]]
        return [sum((a * x for a, x in zip(form, point, strict=True) if x != 0), constant) for form, constant in rows]

    def energy_bound_positive(
        self, signs: NDArray[np.int8], rows: Sequence[int], values: Sequence[float], units: Sequence[Fraction]
    ) -> bool:
        """The dual inequality in rationals: 4 (y'b + z'd) + v'S^{-1}v < 0 for the rows as equations a_j'lambda = b_j.

        ``units`` turns the multiplier of a row kind and node into the problem's units, flattened as kind * p + node.
        """
        v, total = list(self.g), fmpq(0)
        for row, value in zip(rows, values, strict=True):
            kind, i = divmod(row, self.p)
            allowed = int(signs[i, kind])
            if allowed == FORBIDDEN or (allowed == NONNEGATIVE and value < 0):
                return False
            u = rational(value) * rational(units[row])
            form, constant = self.row(kind, i)
            v = [x + u * a for x, a in zip(v, form, strict=True)]
            total -= u * constant
        if self._inverse is None:
            self._inverse = self.S.inv()
        column = fmpq_mat([[x] for x in v])
        return bool(4 * total > (column.transpose() * (self._inverse * column))[0, 0])
