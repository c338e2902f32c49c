"""Forces and displacements of one selection as rational functions of alpha (theory, sections 4 and 7)."""

from __future__ import annotations

from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any

from flint import fmpq, fmpq_mat, fmpz_mat, fmpz_poly

from enumsol.arithmetic.algebraic import integer_polynomial
from enumsol.model.statuses import OPEN, SLIP_MINUS, SLIP_PLUS, STICK, RowKind
from enumsol.support.deadlines import look

if TYPE_CHECKING:
    from enumsol.condensation.exact import ExactCondensed
    from enumsol.selections.solution import Codes


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
    exact : ExactCondensed
    codes : status codes, FRICTIONLESS for the nodes in contact with F = 0 throughout
    """

    def __init__(self, exact: ExactCondensed, codes: Codes) -> None:
        self.exact, self.codes = exact, codes
        self._closed = [i for i, c in enumerate(codes) if c != OPEN]
        self._stuck = [i for i, c in enumerate(codes) if c == STICK]
        self._cache: dict[tuple[RowKind, int], Any] = {}

    @cached_property
    def det(self) -> Any:
        """A polynomial with the sign of the determinant."""
        return self._solution[0]

    @property
    def singular(self) -> bool:
        """Whether the determinant vanishes for every alpha."""
        return bool(self.det.is_zero())

    @property
    def numerators(self) -> list[Any]:
        """Numerators of the reduced unknowns (adj(M) b up to positive factors)."""
        return self._solution[1]

    def _matrix(self, alpha: int) -> tuple[Any, Any]:
        """Integer matrix and right-hand side of the reduced system at an integer alpha."""
        data, p = self.exact.integers, self.exact.p
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

    @cached_property
    def _solution(self) -> tuple[Any, list[Any]]:
        """Determinant and unknowns by evaluation and interpolation."""
        exact, size = self.exact, len(self._closed) + len(self._stuck)
        slips = sum(1 for i, c in enumerate(self.codes) if c in (SLIP_PLUS, SLIP_MINUS) and exact.F1[i] != 0)
        needed = slips + 1 + int(exact.loaded)
        if size == 0:
            return fmpz_poly([1]), []
        nodes: list[int] = []
        values: list[list[Any]] = []
        zeros = trial = 0
        while len(nodes) < needed:
            look()
            matrix, rhs = self._matrix(trial)
            M = fmpz_mat(matrix)
            det = M.det()
            if det != 0:
                nodes.append(trial)
                values.append([det, *((v * det).p for v in M.solve(fmpz_mat(rhs)).entries())])
            else:
                zeros += 1
                if zeros > slips:
                    return fmpz_poly([]), []
            trial = -trial if trial > 0 else 1 - trial
        table = (_interpolation(tuple(nodes)) * fmpz_mat(values)).transpose().tolist()
        determinant, *unknowns = (fmpz_poly(row) for row in table)
        return determinant, unknowns

    # -- quantities ------------------------------------------------------------------------------------------------

    def row(self, kind: RowKind, node: int) -> Any:
        """A row of a node: a selection requires that it vanishes, or that it is not negative."""
        key = (kind, node)
        if key not in self._cache:
            self._cache[key] = integer_polynomial(self._row(kind, node))
        return self._cache[key]

    def _row(self, kind: RowKind, node: int) -> Any:
        p = self.exact.p
        match kind:
            case RowKind.NORMAL_FORCE:
                return self._forces[node]
            case RowKind.TANGENTIAL_FORCE:
                return self._forces[p + node]
            case RowKind.PENETRATION:
                return -self._displacement(node)
            case RowKind.SLIP_FORWARD:
                return self._displacement(p + node)
            case RowKind.SLIP_BACKWARD:
                return -self.row(RowKind.SLIP_FORWARD, node)
            case _:
                return self._cone(node, 1 if kind == RowKind.CONE_PLUS else -1)

    @cached_property
    def _forces(self) -> list[Any]:
        """Numerators of lambda in units of ``_Integers.force`` (a slipping node's unknown is lambda_n / dF)."""
        data, p, unknowns = self.exact.integers, self.exact.p, self.numerators
        forces = [fmpz_poly([])] * (2 * p)
        for k, i in enumerate(self._closed):
            forces[i] = unknowns[k] * data.friction_unit
            direction = _direction(self.codes[i])
            if direction:
                forces[p + i] = unknowns[k] * fmpz_poly([direction * data.F0[i], direction * data.F1[i]])
        for k, i in enumerate(self._stuck, start=len(self._closed)):
            forces[p + i] = unknowns[k] * data.friction_unit
        return forces

    def _displacement(self, row: int) -> Any:
        data = self.exact.integers
        total = self.det * fmpz_poly([data.g0[row], data.g1[row]])
        for s, force in zip(data.S[row], self._forces, strict=True):
            if not force.is_zero():
                total -= force * s
        return total

    def _cone(self, node: int, direction: int) -> Any:
        """F lambda_n - direction * lambda_t of a node."""
        data = self.exact.integers
        bound = self._forces[node] * fmpz_poly([data.F0[node], data.F1[node]])
        return bound - direction * data.friction_unit * self._forces[self.exact.p + node]

    def forces_at(self, alpha: Any) -> tuple[Any, ...] | None:
        """lambda at a rational alpha, exactly; None where the quotients are 0 / 0 and no limit exists there."""
        det, force, shift = self.det, self.exact.integers.force, fmpz_poly([-alpha.p, alpha.q])
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
