"""The condensed problem in rationals, at one alpha and for all of them (theory, sections 4 and 7)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from math import lcm
from typing import Any

import numpy as np
from flint import fmpq, fmpq_mat

from enumsol.arithmetic.rationals import is_positive_definite, rational, rational_matrix
from enumsol.condensation.data import EXACT_DOF_LIMIT, ProblemData
from enumsol.condensation.unloaded import solved, vanishing_alpha
from enumsol.errors import InvalidProblemError, TooLargeError
from enumsol.support.array_types import Alpha, Indices, NDArray
from enumsol.support.deadlines import look, tell

#: Most degrees of freedom for which "fast" condenses without rounding; beyond, S and g as computed in floats are used.
FAST_EXACT_DOF = 24


def check_definite(S: fmpq_mat) -> None:
    """Nothing; refuses an S, an fmpq_mat, that is not positive definite: no bound on the energy holds.

    Raises
    ------
    InvalidProblemError
        It is not.
    TimeOverError
        The deadline that holds here has passed.
    """

    def at(done: int, of: int) -> None:
        look()
        tell("pivots of S in rationals", done, of)

    if not is_positive_definite(S, at):
        raise InvalidProblemError(
            "the condensed compliance S = B A^-1 B' is not positive definite, in rational arithmetic; expected A "
            "positive definite and contact rows [Bn; Bt] that are independent (is a contact node listed twice?)"
        )


@dataclass(frozen=True)
class ExactSystem:
    """The condensed problem at one alpha in rationals: w = g - S lambda.

    Attributes
    ----------
    S : fmpq_mat (2p + r, 2p + r)
        Of a body that nothing holds S and g are bordered by G and h (theory, section 14.2); of others r = 0.
    g, F : tuples of 2p + r and p fmpq
    reach : tuple of r fmpq
        Bounds of the coordinates q of a rigid displacement.
    """

    S: Any
    g: tuple[Any, ...]
    F: tuple[Any, ...]
    reach: tuple[Any, ...] = ()

    @property
    def p(self) -> int:
        """Number of contact nodes."""
        return len(self.F)

    @property
    def contact_compliance(self) -> Any:
        """S without the border, fmpq_mat (2p, 2p)."""
        size = 2 * self.p
        return fmpq_mat([row[:size] for row in self.S.tolist()[:size]])

    def along(self, direction: tuple[Any, ...]) -> ExactSystem:
        """System of what changes with g along a direction: neither h nor the bounds of a rigid displacement."""
        zeros = (fmpq(0),) * len(self.reach)
        return ExactSystem(self.S, (*direction[: 2 * self.p], *zeros), self.F, zeros)

    def moved(self, point: tuple[Any, ...]) -> list[Any]:
        """w = g - S lambda."""
        product = self.S * fmpq_mat([[v] for v in point])
        return [g - v for g, v in zip(self.g, product.entries(), strict=True)]

    @classmethod
    def from_problem(cls, problem: ProblemData, alpha: Alpha) -> ExactSystem:
        """Condense at one alpha without any rounding.

        Raises
        ------
        InvalidArgumentError
            Friction is negative there.
        TooLargeError
            The problem has more than EXACT_DOF_LIMIT degrees of freedom.
        """
        problem.friction_at(alpha)
        return ExactCondensed.beside_zero(problem, None).system(rational(alpha))


class UncondensedSystem:
    """Problem at one alpha in rationals, condensed only where S or g is asked for: one selection takes neither.

    S has as many digits as det A, and 2p columns; the equations of one selection have the digits of the data and one
    right-hand side.

    Parameters
    ----------
    problem : ContactProblem
        A body that is held.
    alpha : float or Fraction
    index : callable
        The sign of det M of a selection where it is known, else 0.

    Attributes
    ----------
    F : tuple of fmpq

    Raises
    ------
    InvalidArgumentError
        Friction is negative there.
    TooLargeError
        The problem has more than EXACT_DOF_LIMIT degrees of freedom.
    """

    reach: tuple[Any, ...] = ()

    def __init__(
        self, problem: ProblemData, alpha: Alpha, index: Callable[[tuple[int, ...]], int] = lambda _: 0
    ) -> None:
        problem.friction_at(alpha)
        _check_size(problem)
        self._problem, self._alpha, self.p, self.index = problem, alpha, problem.p, index
        a = rational(alpha)
        self.F = tuple(rational(x) + a * rational(y) for x, y in zip(*problem.affine_friction, strict=True))
        self._moved: dict[tuple[Any, ...], list[Any]] = {}

    @cached_property
    def _condensed(self) -> ExactSystem:
        return ExactSystem.from_problem(self._problem, self._alpha)

    @property
    def S(self) -> Any:  # noqa: N802 (the field's letter)
        """S, fmpq_mat (2p, 2p)."""
        return self._condensed.S

    @property
    def g(self) -> tuple[Any, ...]:
        """g, a tuple of 2p fmpq."""
        return self._condensed.g

    def along(self, direction: tuple[Any, ...]) -> ExactSystem:
        """The system whose g is a direction."""
        return self._condensed.along(direction)

    @cached_property
    def _matrices(self) -> tuple[list[Any], list[Any], list[Any], list[Any]]:
        """A and B, by their rows, f(alpha), and gap and slip offset."""
        given, alpha = _Given.of(self._problem), rational(self._alpha)
        return given.A.tolist(), given.B.tolist(), [x + alpha * y for x, y in given.loads.tolist()], given.offset

    def solved(
        self, turned: Callable[[NDArray[Any]], NDArray[Any]], unknown: Indices, sign: int
    ) -> tuple[list[Any], list[Any], int] | None:
        """The unknowns y of a selection, u, and the sign of det M; None where M is singular.

        With u the displacements, M y = g_R is what remains when u is eliminated from

            A u + B'E y = f(alpha),      B_R u = o_R       (o: gap and slip offset),

        and det M is det of this matrix times (-1)^k / det A, k the number of unknowns.

        Parameters
        ----------
        turned : function that gives K E for the rows of K, an object array of shape (n, 2p)
        unknown : int array, the k rows R
        sign : that of det M if it is known, else 0: det takes longer than the solution
        """
        A, B, f, offset = self._matrices
        tell("a selection in rationals")
        columns = turned(np.array(B, dtype=object).T).tolist()
        size = len(unknown)
        K = [[*row, *more] for row, more in zip(A, columns, strict=True)]
        K += [[*B[r], *([fmpq(0)] * size)] for r in unknown]
        matrix = fmpq_mat(K)
        if not sign:
            det = matrix.det()
            if det == 0:
                return None
            sign = (1 if det > 0 else -1) * (-1) ** size
        right = fmpq_mat([[x] for x in (*f, *(offset[r] for r in unknown))])
        found = matrix.solve(right).entries()
        return found[len(A) :], found[: len(A)], sign

    def keep(self, point: tuple[Any, ...], u: list[Any]) -> None:
        """Keep w = B u - o at a point, for `moved`."""
        _, B, _, offset = self._matrices
        self._moved[point] = [
            sum((x * y for x, y in zip(row, u, strict=True) if x != 0), -o) for row, o in zip(B, offset, strict=True)
        ]

    def moved(self, point: tuple[Any, ...]) -> list[Any]:
        """w = g - S lambda."""
        if point not in self._moved:
            return self._condensed.moved(point)
        return self._moved[point]


@dataclass(frozen=True)
class ExactCondensed:
    """The condensed problem in rationals: w = g0 + alpha g1 - S lambda, F = F0 + alpha F1.

    Of a body that nothing holds S and g are bordered by G and h (theory, section 14.2), and have r rows more.

    Attributes
    ----------
    rows : tuple of 2p tuples of 2p fmpq
        S, in tuples: what a graph answers is computed from it again and again, and a matrix of flint can be written to.
    g0, g1 : tuples of 2p fmpq
    F0, F1 : tuples of p fmpq
    condensed_exactly : bool
        S and g follow from A, Bn, Bt, f without rounding; otherwise they are the floats computed in CondensedProblem.
    zero : Fraction or None
        The alpha at which g(alpha) = 0, where lambda = 0 is the only solution and every selection holds; found where
        the checker finds it. Nothing is special about it where nothing holds the body.
    reach : tuple of r fmpq
        Bounds of the coordinates of a rigid displacement; none of a body that is held.
    friction_unit, force : int and fmpq
        See ``integers``.
    """

    rows: tuple[tuple[Any, ...], ...]
    g0: tuple[Any, ...]
    g1: tuple[Any, ...]
    F0: tuple[Any, ...]
    F1: tuple[Any, ...]
    condensed_exactly: bool
    zero: Fraction | None
    reach: tuple[Any, ...] = ()
    friction_unit: int = 1
    force: Any = 1

    @classmethod
    def from_problem(cls, problem: ProblemData) -> ExactCondensed:
        """Condense A, Bn, Bt, f, load_slope, gap, slip_offset and friction without any rounding; on springs, with G, h.

        Raises
        ------
        TooLargeError
            The problem has more than EXACT_DOF_LIMIT degrees of freedom.
        """
        return cls.beside_zero(problem, vanishing_alpha(problem, "problem"))

    @classmethod
    def beside_zero(cls, problem: ProblemData, zero: Fraction | None) -> ExactCondensed:
        """Condensation where ``zero`` is known already, or not asked for; as ``from_problem``."""
        given, r = _Given.of(problem.on_springs), problem.modes.r
        rows, g0, g1, F0, F1 = given.condensed
        if r:
            N = rational_matrix(problem.modes.N)
            G, h = (given.B * N).transpose().tolist(), (N.transpose() * given.loads).tolist()
            bordered = [(*row, *(mode[k] for mode in G)) for k, row in enumerate(rows)]
            rows = (*bordered, *((*mode, *([fmpq(0)] * r)) for mode in G))
            g0, g1 = (*g0, *(load for load, _ in h)), (*g1, *(change for _, change in h))
        reach = tuple(rational(float(x)) for x in problem.modes.reach(problem.rigid_reach))
        return cls(rows, g0, g1, F0, F1, condensed_exactly=True, zero=zero, reach=reach)

    @property
    def S(self) -> Any:  # noqa: N802 (the field's letter)
        """S as a new fmpq_mat (2p, 2p)."""
        return fmpq_mat([list(row) for row in self.rows])

    @classmethod
    def from_condensed(cls, problem: ProblemData) -> ExactCondensed:
        """The exact values of S, g and F as computed in floats."""
        condensed = problem.condensed
        vectors = (condensed.g0, condensed.g1, condensed.F0, condensed.F1)
        g0, g1, F0, F1 = (tuple(rational(v) for v in part) for part in vectors)
        rows = tuple(map(tuple, rational_matrix(condensed.S).tolist()))
        zero = vanishing_alpha(problem, "condensed")
        return cls(rows, g0, g1, F0, F1, condensed_exactly=False, zero=zero)

    @property
    def p(self) -> int:
        """Number of contact nodes."""
        return len(self.F0)

    @cached_property
    def loaded(self) -> bool:
        """True if g depends on alpha."""
        return any(v != 0 for v in self.g1)

    @cached_property
    def unloaded(self) -> bool:
        """True if g = 0 for every alpha, so that lambda = 0 is the only solution."""
        return not self.reach and not self.loaded and all(v == 0 for v in self.g0)

    @cached_property
    def frictionless(self) -> tuple[bool, ...]:
        """Nodes with F = 0 for every alpha."""
        return tuple(a == 0 and b == 0 for a, b in zip(self.F0, self.F1, strict=True))

    @cached_property
    def origin(self) -> Any:
        """``zero`` as fmpq, or None."""
        return None if self.zero is None else rational(self.zero)

    @cached_property
    def integers(self) -> ExactCondensed:
        """Data as integers over common denominators: forces are in units of ``force``, F in ``friction_unit`` parts."""
        dS = lcm(*(int(v.q) for row in self.rows for v in row))
        dg = lcm(*(int(v.q) for v in (*self.g0, *self.g1)))
        dF = lcm(*(int(v.q) for v in (*self.F0, *self.F1)))
        rows = tuple(tuple(_times(v, dS) for v in row) for row in self.rows)
        g0, g1 = (tuple(_times(v, dg) for v in part) for part in (self.g0, self.g1))
        F0, F1 = (tuple(_times(v, dF) for v in part) for part in (self.F0, self.F1))
        return replace(self, rows=rows, g0=g0, g1=g1, F0=F0, F1=F1, friction_unit=dF, force=fmpq(dS, dg))

    def at(self, alpha: object) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
        """g and F at an alpha of any exact field."""
        g = tuple(a + b * alpha for a, b in zip(self.g0, self.g1, strict=True))
        F = tuple(a + b * alpha for a, b in zip(self.F0, self.F1, strict=True))
        return g, F

    def system(self, alpha: object) -> ExactSystem:
        """The condensed problem at an alpha of any exact field."""
        return ExactSystem(self.S, *self.at(alpha), self.reach)


#: S as a tuple of rows, g0, g1, F0, F1.
_Parts = tuple[tuple[Any, ...], tuple[Any, ...], tuple[Any, ...], tuple[Any, ...], tuple[Any, ...]]


def _times(value: fmpq, factor: int) -> Any:
    return value.p * (factor // value.q)


@dataclass(frozen=True)
class _Given:
    """A problem's data without any rounding.

    Attributes
    ----------
    A, B : fmpq_mat (n, n) and (2p, n)
    loads : fmpq_mat (n, 2)
        f and load_slope.
    offset : list of 2p fmpq
        Gap and slip offset.
    friction : pair of tuples of p fmpq
    """

    A: Any
    B: Any
    loads: Any
    offset: list[Any]
    friction: tuple[tuple[Any, ...], ...]

    @classmethod
    def of(cls, problem: ProblemData) -> _Given:
        """Read them.

        Raises
        ------
        TooLargeError
            The problem has more than EXACT_DOF_LIMIT degrees of freedom.
        """
        _check_size(problem)
        slope = np.zeros(problem.n) if problem.load_slope is None else problem.load_slope
        start = problem.slip_offset if problem.exact_offset is None else problem.exact_offset
        A, B = (rational_matrix(M.toarray()) for M in (problem.A, problem.contact_rows))
        loads = rational_matrix(np.column_stack([problem.f, slope]))
        offset, *friction = ([rational(x) for x in part] for part in ((*problem.gap, *start), *problem.affine_friction))
        return cls(A, B, loads, offset, tuple(map(tuple, friction)))

    @property
    def condensed(self) -> _Parts:
        """S as a tuple of rows, g0, g1, F0 and F1."""
        rhs = [[*row, *load] for row, load in zip(self.B.transpose().tolist(), self.loads.tolist(), strict=True)]
        table, size = (self.B * solved(self.A, fmpq_mat(rhs))).tolist(), self.B.nrows()
        g0 = tuple(row[size] - o for row, o in zip(table, self.offset, strict=True))
        g1 = tuple(row[size + 1] for row in table)
        F0, F1 = self.friction
        return tuple(tuple(row[:size]) for row in table), g0, g1, F0, F1


def _check_size(problem: ProblemData) -> None:
    if problem.n > EXACT_DOF_LIMIT:
        raise TooLargeError(
            f'arithmetic="exact" condenses at most n = {EXACT_DOF_LIMIT} degrees of freedom in rationals and the '
            f"problem has n = {problem.n}; use another arithmetic, or problem.at_contact_nodes(), the same body up to "
            "rounding"
        )
