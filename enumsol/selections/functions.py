"""The condensed problem for all alpha in rationals, and selections as rational functions of it (theory, 4 and 7)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import lcm
from typing import TYPE_CHECKING, Any

import numpy as np
from flint import fmpq, fmpq_mat, fmpz_mat, fmpz_poly

from enumsol.arithmetic.algebraic import integer_polynomial
from enumsol.errors import TooLargeError
from enumsol.selections.rationals import EXACT_DOF_LIMIT, rational
from enumsol.statuses import OPEN, SLIP_MINUS, SLIP_PLUS, STICK

if TYPE_CHECKING:
    from enumsol.problem import ContactProblem
    from enumsol.selections.solution import Codes

#: Most degrees of freedom for which "fast" condenses without rounding; beyond, S and g as computed in floats are used.
FAST_EXACT_DOF = 24


@dataclass(frozen=True)
class ExactPath:
    """The condensed problem in rationals: w = g0 + alpha g1 - S lambda, F = F0 + alpha F1.

    Attributes
    ----------
    S : fmpq_mat (2p, 2p)
    g0, g1 : tuples of 2p fmpq
    F0, F1 : tuples of p fmpq
    condensed_exactly : bool
        S and g follow from A, Bn, Bt, f without rounding; otherwise they are the floats computed in CondensedProblem.
    """

    S: Any
    g0: tuple[Any, ...]
    g1: tuple[Any, ...]
    F0: tuple[Any, ...]
    F1: tuple[Any, ...]
    condensed_exactly: bool

    @classmethod
    def from_problem(cls, problem: ContactProblem, *, exact: bool) -> ExactPath:
        """Condense in rationals (``exact``), or read the condensed floats as rationals.

        Raises
        ------
        TooLargeError
            Exact condensation of more than EXACT_DOF_LIMIT degrees of freedom.
        """
        F0, F1 = (tuple(rational(v) for v in part) for part in problem.friction)
        if not exact:
            c = problem.condensed
            g0, g1 = (tuple(rational(v) for v in part) for part in (c.g0, c.g1))
            return cls(_rational_matrix(c.S), g0, g1, F0, F1, condensed_exactly=False)
        if problem.n > EXACT_DOF_LIMIT:
            raise TooLargeError(
                f'arithmetic="exact" condenses at most n = {EXACT_DOF_LIMIT} degrees of freedom in rationals and the '
                f"problem has n = {problem.n}; use another arithmetic, or condense the body to its contact nodes first"
            )
        p = problem.p
        B = _rational_matrix(np.vstack([problem.Bn.toarray(), problem.Bt.toarray()]))
        slope = np.zeros(problem.n) if problem.load_slope is None else problem.load_slope
        loads = _rational_matrix(np.column_stack([problem.f, slope]))
        rhs = [[*row, *load] for row, load in zip(B.transpose().tolist(), loads.tolist(), strict=True)]
        table = (B * _rational_matrix(problem.A.toarray()).solve(fmpq_mat(rhs))).tolist()
        offset = [rational(v) for v in (*problem.gap, *problem.slip_offset)]
        g0 = tuple(row[2 * p] - o for row, o in zip(table, offset, strict=True))
        g1 = tuple(row[2 * p + 1] for row in table)
        return cls(fmpq_mat([row[: 2 * p] for row in table]), g0, g1, F0, F1, condensed_exactly=True)

    @property
    def p(self) -> int:
        """Number of contact nodes."""
        return len(self.F0)

    @cached_property
    def loaded(self) -> bool:
        """Whether g depends on alpha."""
        return any(v != 0 for v in self.g1)

    @cached_property
    def unloaded(self) -> bool:
        """Whether g = 0 for every alpha."""
        return not self.loaded and all(v == 0 for v in self.g0)

    @cached_property
    def frictionless(self) -> tuple[bool, ...]:
        """Nodes with F = 0 for every alpha."""
        return tuple(a == 0 and b == 0 for a, b in zip(self.F0, self.F1, strict=True))

    @cached_property
    def origin(self) -> Any:
        """The alpha at which g(alpha) = 0, where lambda = 0 is the only solution and every selection holds; or None."""
        at = None
        for a, b in zip(self.g0, self.g1, strict=True):
            if b == 0:
                if a != 0:
                    return None
            elif at is None:
                at = -a / b
            elif at != -a / b:
                return None
        return at

    @cached_property
    def integers(self) -> _Integers:
        """The same data as integers over common denominators."""
        S = self.S.tolist()
        dS = lcm(*(int(v.q) for row in S for v in row))
        dg = lcm(*(int(v.q) for v in (*self.g0, *self.g1)))
        dF = lcm(*(int(v.q) for v in (*self.F0, *self.F1)))
        return _Integers(
            [[_times(v, dS) for v in row] for row in S],
            [_times(v, dg) for v in self.g0],
            [_times(v, dg) for v in self.g1],
            [_times(v, dF) for v in self.F0],
            [_times(v, dF) for v in self.F1],
            dF,
            fmpq(dS, dg),
        )

    def at(self, alpha: Any) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
        """g and F at an alpha of any exact field."""
        g = tuple(a + b * alpha for a, b in zip(self.g0, self.g1, strict=True))
        F = tuple(a + b * alpha for a, b in zip(self.F0, self.F1, strict=True))
        return g, F


@dataclass(frozen=True)
class _Integers:
    """Integer data: S = S_int / dS, g = g_int / dg, F = F_int / dF."""

    S: list[list[Any]]
    g0: list[Any]
    g1: list[Any]
    F0: list[Any]
    F1: list[Any]
    friction_unit: int  # dF
    force: Any  # dS / dg


def _times(value: Any, factor: int) -> Any:
    return value.p * (factor // value.q)


def _rational_matrix(array: np.ndarray[Any, Any]) -> Any:
    rows, columns = array.shape
    return fmpq_mat(rows, columns, [fmpq(*float(v).as_integer_ratio()) for v in array.ravel()])


@lru_cache(maxsize=64)
def _interpolation(nodes: tuple[int, ...]) -> Any:
    """Integer multiple (by a positive number) of the inverse Vandermonde matrix."""
    inverse = fmpq_mat([[fmpq(x) ** k for k in range(len(nodes))] for x in nodes]).inv()
    return inverse.numer_denom()[0]


class SelectionFunctions:
    """Forces and displacements of one selection as rational functions of alpha.

    Every method returns a primitive integer polynomial whose quotient by ``det``, up to a positive constant factor, is
    the quantity; ``det`` has the sign of the determinant of the reduced selection matrix. Cost: one determinant and
    one solve in integers for every degree, then a matrix product.

    Parameters
    ----------
    path : ExactPath
    codes : status codes, FRICTIONLESS for the nodes in contact with F = 0 throughout
    """

    def __init__(self, path: ExactPath, codes: Codes) -> None:
        self.path, self.codes = path, codes
        self._closed = [i for i, c in enumerate(codes) if c != OPEN]
        self._stuck = [i for i, c in enumerate(codes) if c == STICK]
        self._cache: dict[tuple[str, int], Any] = {}
        self._unknowns: list[Any] = []
        self._solve()

    @property
    def singular(self) -> bool:
        """Whether the determinant vanishes for every alpha."""
        return bool(self.det.is_zero())

    @property
    def numerators(self) -> list[Any]:
        """Numerators of the reduced unknowns (adj(M) b up to positive factors)."""
        return list(self._unknowns)

    def _matrix(self, alpha: int) -> tuple[Any, Any]:
        """Integer matrix and right-hand side of the reduced system at an integer alpha."""
        data, p = self.path.integers, self.path.p
        rows = self._closed + [p + i for i in self._stuck]
        matrix = []
        slips = [(i, _direction(self.codes[i]) * (data.F0[i] + alpha * data.F1[i])) for i in self._closed]
        for r in rows:
            S = data.S[r]
            matrix.append(
                [S[i] * data.friction_unit + f * S[p + i] if f != 0 else S[i] * data.friction_unit for i, f in slips]
            )
            matrix[-1] += [S[p + i] * data.friction_unit for i in self._stuck]
        return matrix, [[data.g0[r] + alpha * data.g1[r]] for r in rows]

    def _solve(self) -> None:
        """Determinant and unknowns by evaluation and interpolation."""
        path, size = self.path, len(self._closed) + len(self._stuck)
        slips = sum(1 for i, c in enumerate(self.codes) if c in (SLIP_PLUS, SLIP_MINUS) and path.F1[i] != 0)
        needed = slips + 1 + int(path.loaded)
        if size == 0:
            self.det = fmpz_poly([1])
            return
        nodes: list[int] = []
        values: list[list[Any]] = []
        zeros = trial = 0
        while len(nodes) < needed:
            matrix, rhs = self._matrix(trial)
            M = fmpz_mat(matrix)
            det = M.det()
            if det != 0:
                nodes.append(trial)
                values.append([det, *((v * det).p for v in M.solve(fmpz_mat(rhs)).entries())])
            else:
                zeros += 1
                if zeros > slips:
                    self.det = fmpz_poly([])
                    return
            trial = -trial if trial > 0 else 1 - trial
        table = (_interpolation(tuple(nodes)) * fmpz_mat(values)).transpose().tolist()
        self.det, *self._unknowns = (fmpz_poly(row) for row in table)

    # -- quantities ------------------------------------------------------------------------------------------------

    def normal_force(self, node: int) -> Any:
        """lambda_n of a node."""
        return self._get("n", node)

    def gap(self, node: int) -> Any:
        """w_n of an open node."""
        return self._get("gap", node)

    def slip(self, node: int) -> Any:
        """w_t of a node that does not stick."""
        return self._get("slip", node)

    def cone(self, node: int, direction: int) -> Any:
        """F lambda_n - direction * lambda_t of a node."""
        return self._get("cone+" if direction > 0 else "cone-", node)

    def _get(self, kind: str, node: int) -> Any:
        key = (kind, node)
        if key not in self._cache:
            if kind == "n":
                value = self._forces[node]
            elif kind in ("gap", "slip"):
                value = self._displacement(node if kind == "gap" else self.path.p + node)
            else:
                value = self._cone(node, 1 if kind == "cone+" else -1)
            self._cache[key] = integer_polynomial(value)
        return self._cache[key]

    @cached_property
    def _forces(self) -> list[Any]:
        """Numerators of lambda in units of ``_Integers.force`` (a slipping node's unknown is lambda_n / dF)."""
        data, p = self.path.integers, self.path.p
        forces = [fmpz_poly([])] * (2 * p)
        for k, i in enumerate(self._closed):
            forces[i] = self._unknowns[k] * data.friction_unit
            direction = _direction(self.codes[i])
            if direction:
                forces[p + i] = self._unknowns[k] * fmpz_poly([direction * data.F0[i], direction * data.F1[i]])
        for k, i in enumerate(self._stuck, start=len(self._closed)):
            forces[p + i] = self._unknowns[k] * data.friction_unit
        return forces

    def _displacement(self, row: int) -> Any:
        data = self.path.integers
        total = self.det * fmpz_poly([data.g0[row], data.g1[row]])
        for s, force in zip(data.S[row], self._forces, strict=True):
            if not force.is_zero():
                total -= force * s
        return total

    def _cone(self, node: int, direction: int) -> Any:
        data = self.path.integers
        bound = self._forces[node] * fmpz_poly([data.F0[node], data.F1[node]])
        return bound - direction * data.friction_unit * self._forces[self.path.p + node]

    def forces_at(self, alpha: Any) -> tuple[Any, ...] | None:
        """lambda at a rational alpha, exactly; None where the quotients are 0 / 0 and no limit exists there."""
        det, force, shift = self.det, self.path.integers.force, fmpz_poly([-alpha.p, alpha.q])
        numerators = self._forces
        while det(alpha) == 0:
            if any(f(alpha) != 0 for f in numerators):
                return None
            det = det // shift
            numerators = [f // shift for f in numerators]
        below = fmpq(det(alpha))
        return tuple(force * f(alpha) / below for f in numerators)


def _direction(code: int) -> int:
    return {SLIP_PLUS: 1, SLIP_MINUS: -1}.get(code, 0)
