"""The condensed problem of a body that nothing holds in rationals, as the checker computes it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from flint import fmpq, fmpq_mat

from enumsol.arithmetic.rationals import rational
from enumsol.checker.hull import HullTooLargeError, hull_of_selections
from enumsol.checker.rational import RationalSystem, Vector

if TYPE_CHECKING:
    from collections.abc import Sequence
    from fractions import Fraction

    from enumsol.model.problem import ContactProblem


class FloatingRationalSystem(RationalSystem):
    """S, g and F of the body on springs, and the rows of its equilibrium as a whole (theory, section 14.2).

    Points have 2p + r numbers: the contact forces, then -q.

    Parameters
    ----------
    problem : ContactProblem
    alpha : Fraction
    """

    def __init__(self, problem: ContactProblem, alpha: Fraction) -> None:
        super().__init__(problem.on_springs, alpha)
        modes, a = problem.modes, rational(alpha)
        if modes is None:
            raise AssertionError("the body is held")
        columns = [[rational(x) for x in column] for column in modes.N.T.tolist()]
        rows = problem.contact_rows.toarray().tolist()
        slope = [0.0] * problem.n if problem.load_slope is None else problem.load_slope.tolist()
        load = [rational(x) + a * rational(y) for x, y in zip(problem.f.tolist(), slope, strict=True)]
        #: G, a row for each mode, and h.
        self.G = [[_dot(row, column) for row in rows] for column in columns]
        self.h = [sum((x * y for x, y in zip(load, column, strict=True)), fmpq(0)) for column in columns]
        self.reach = [rational(float(x)) for x in modes.reach(problem.rigid_reach)]

    @property
    def size(self) -> int:
        """Numbers of a point."""
        return 2 * self.p + len(self.G)

    def row(self, kind: int, node: int) -> tuple[Vector, Any]:
        """A row as an affine function of a point."""
        form, constant = super().row(kind, node)
        if kind < 4:
            return [*form, *(self.zero for _ in self.G)], constant
        # w = g - S lambda + G'q
        place, sign = (node, -1) if kind == 4 else (self.p + node, 1 if kind == 5 else -1)
        return [*form, *(-sign * mode[place] for mode in self.G)], constant

    def equations(self, codes: Sequence[int]) -> tuple[Any, Vector]:
        """Matrix and right-hand side of the selection's equations and of G lambda = h."""
        M, b = super().equations(codes)
        none = [self.zero for _ in self.G]
        return fmpq_mat([*M.tolist(), *([*mode, *none] for mode in self.G)]), [*b, *self.h]

    def conditions(self, codes: Sequence[int], point: Vector) -> Vector:
        """The selection's inequalities at a point, then the bounds of the rigid displacement."""
        return [*self.contact_conditions(codes, point), *self.bounds(point)]

    def contact_conditions(self, codes: Sequence[int], point: Vector) -> Vector:
        """The selection's inequalities at a point."""
        return super().conditions(codes, point)

    def bounds(self, point: Vector) -> Vector:
        """What is left to the bounds of the rigid displacement."""
        moved = list(zip(point[2 * self.p :], self.reach, strict=True))
        return [*(most - x for x, most in moved), *(most + x for x, most in moved)]

    def rests_on_reach(self, codes: Sequence[int], points: Sequence[Sequence[Fraction]]) -> bool:
        """Whether a selection, which holds these points, holds others without the bounds.

        True as well if it has too many candidate vertices to find out.
        """
        if points:
            ends = [[rational(x) for x in point[2 * self.p :]] for point in points]
            return any(abs(x) == most for end in ends for x, most in zip(end, self.reach, strict=True))
        try:
            return any(point[-1] > 0 for point in hull_of_selections(_Shares(self), codes).points)
        except HullTooLargeError:
            return True


class _Shares:
    """Points (s x, s) with x in a selection without the bounds, 0 <= s <= 1, and s x within the bounds.

    Parameters
    ----------
    system : FloatingRationalSystem
    """

    def __init__(self, system: FloatingRationalSystem) -> None:
        self._system, self.size = system, system.size + 1

    def equations(self, codes: Sequence[int]) -> tuple[Any, Vector]:
        """Matrix and right-hand side, which is zero."""
        M, b = self._system.equations(codes)
        return fmpq_mat([[*row, -x] for row, x in zip(M.tolist(), b, strict=True)]), [fmpq(0)] * len(b)

    def conditions(self, codes: Sequence[int], point: Vector) -> Vector:
        """The selection's inequalities times s, then the bounds of s x and of s."""
        *x, share = point
        there, constant = (self._system.contact_conditions(codes, at) for at in (x, [fmpq(0)] * len(x)))
        scaled = [value + (share - 1) * more for value, more in zip(there, constant, strict=True)]
        return [*scaled, *self._system.bounds(x), share, 1 - share]


def _dot(row: list[float], column: Vector) -> Any:
    return sum((rational(x) * y for x, y in zip(row, column, strict=True) if x), fmpq(0))
