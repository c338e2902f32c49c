"""A problem in rationals, condensed or not, as the checker computes it; the search has its own code for this."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from flint import fmpq, fmpq_mat

from enumsol.arithmetic.rationals import is_positive_definite, rational
from enumsol.condensation.data import exactly_at
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


class RationalBody:
    """The matrices of a problem at alpha in rationals, not condensed: for single points.

    S has as many digits as det A, and 2p columns; the displacements of one point take one solve with A.

    Parameters
    ----------
    problem : ContactProblem
        A body that is held, with the slip offset that it has in floats.
    alpha : Fraction

    Raises
    ------
    NotEnclosedError
        The problem has more than EXACT_DOF_LIMIT degrees of freedom.
    """

    def __init__(self, problem: ContactProblem, alpha: Fraction) -> None:
        self.p, a = problem.p, rational(alpha)
        self._A, B = exact_matrices(problem)
        self._B: list[Vector] = B.tolist()
        self.F: Vector = [rational(F) for F in exactly_at(alpha, *problem.friction)]
        slope = [0.0] * problem.n if problem.load_slope is None else problem.load_slope.tolist()
        self._f = [rational(x) + a * rational(y) for x, y in zip(problem.f.tolist(), slope, strict=True)]
        self._offset = [rational(x) for x in problem.gap.tolist() + problem.slip_offset.tolist()]
        self._moved: dict[tuple[Any, ...], Vector] = {}

    def point(self, codes: Sequence[int]) -> Vector | None:
        """The only lambda that solves a selection's equations; None where they are singular.

        Of A u + B'lambda = f and of w = B u - offset = 0 in the rows of the selection, with u and those forces as
        unknowns that the statuses leave free.
        """
        p = self.p
        closed = [i for i, code in enumerate(codes) if code]
        held = [p + i for i, code in enumerate(codes) if code == 1]
        turn = [{2: self.F[i], 3: -self.F[i]}.get(codes[i], fmpq(0)) for i in closed]
        columns = [
            [x + f * y for x, y in zip(self._B[i], self._B[p + i], strict=True)]
            for i, f in zip(closed, turn, strict=True)
        ]
        columns += [self._B[k] for k in held]
        rows = closed + held
        table = [[*row, *(c[k] for c in columns)] for k, row in enumerate(self._A.tolist())]
        table += [[*self._B[r], *([fmpq(0)] * len(rows))] for r in rows]
        right = [*self._f, *(self._offset[r] for r in rows)]
        try:
            solved = fmpq_mat(table).solve(fmpq_mat([[x] for x in right])).entries()
        except ZeroDivisionError:
            return None
        u, y = solved[: len(self._f)], solved[len(self._f) :]
        point = [fmpq(0)] * (2 * p)
        for i, f, force in zip(closed, turn, y, strict=False):
            point[i], point[p + i] = force, f * force
        for k, force in zip(held, y[len(closed) :], strict=True):
            point[k] = force
        self._moved[tuple(point)] = self._displaced(u)
        return point

    def moved(self, point: Sequence[Any]) -> Vector:
        """w at a point: where the forces on the contact nodes are these.

        Raises
        ------
        NotEnclosedError
            A is singular.
        """
        if tuple(point) not in self._moved:
            load = list(self._f)
            for force, row in zip(point, self._B, strict=True):
                if force != 0:
                    load = [x - force * b for x, b in zip(load, row, strict=True)]
            self._moved[tuple(point)] = self._displaced(solved(self._A, fmpq_mat([[x] for x in load])).entries())
        return self._moved[tuple(point)]

    def _displaced(self, u: Vector) -> Vector:
        pairs = zip(self._B, self._offset, strict=True)
        return [sum((b * x for b, x in zip(row, u, strict=True) if b != 0), -o) for row, o in pairs]

    def least(self, code: int, node: int, point: Sequence[Any]) -> Any:
        """The smallest of the numbers that a final code wants not to be negative at a node, at a point."""
        p, w = self.p, self.moved(point)
        bound, t = self.F[node] * point[node], point[p + node]
        rows = (point[node], t, bound - t, bound + t, -w[node], w[p + node], -w[p + node])
        return min(rows[kind] for kind in CONDITIONS[code][1])
