"""Forces and displacements of one selection as rational functions of alpha (theory, sections 4 and 7)."""

from __future__ import annotations

from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any

from flint import fmpq, fmpq_mat, fmpz_mat, fmpz_poly

from enumsol.arithmetic.algebraic import integer_polynomial
from enumsol.arithmetic.rationals import as_objects
from enumsol.model.statuses import RowKind
from enumsol.support.deadlines import look
from enumsol.trusted.selection import Selection

if TYPE_CHECKING:
    from enumsol.condensation.exact import ExactCondensed
    from enumsol.support.array_types import Codes


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
        self._cache: dict[tuple[RowKind, int], Any] = {}

    @property
    def _selection(self) -> Selection:
        """Made where it is needed: what a graph keeps holds no arrays that can be written to."""
        return Selection(self.codes, len(self.exact.reach))

    @cached_property
    def det(self) -> Any:
        """A polynomial with the sign of the determinant."""
        return self._solution[0]

    @property
    def singular(self) -> bool:
        """True if the determinant vanishes for every alpha."""
        return bool(self.det.is_zero())

    @property
    def numerators(self) -> list[Any]:
        """Numerators of the reduced unknowns (adj(M) b up to positive factors)."""
        return self._solution[1]

    def _matrix(self, alpha: int) -> tuple[Any, Any]:
        """Integer matrix and right-hand side of the reduced system at an integer alpha, columns times dF."""
        data, rows = self.exact.integers, self._selection.unknown
        S = as_objects([data.rows[r] for r in rows])
        F = as_objects([a + alpha * b for a, b in zip(data.F0, data.F1, strict=True)])
        unit = data.friction_unit
        return self._selection.columns(S, F, unit).tolist(), [[data.g0[r] + alpha * data.g1[r]] for r in rows]

    @cached_property
    def _solution(self) -> tuple[Any, list[Any]]:
        """Determinant and unknowns by evaluation and interpolation."""
        exact, size = self.exact, len(self._selection.unknown)
        slips = sum(1 for i in self._selection.slip if exact.F1[i] != 0)
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
        """Numerators of lambda in units of ``integers.force`` (a slipping node's unknown is lambda_n / dF)."""
        data = self.exact.integers
        F = as_objects([fmpz_poly([a, b]) for a, b in zip(data.F0, data.F1, strict=True)])
        unknowns = as_objects(self.numerators)
        return list(self._selection.forces(unknowns, F, fmpz_poly([]), data.friction_unit))

    def margins(self) -> list[Any]:
        """Distances of the rigid displacement from its bounds on both sides, (2r,), of a body that nothing holds."""
        data, found = self.exact.integers, []
        for moved, most in zip(self._forces[2 * self.exact.p :], self.exact.reach, strict=True):
            # both times the denominators of the bound and of the unit of forces
            whole, part = most.p * data.force.q * self.det, data.force.p * most.q * moved
            found += [integer_polynomial(whole + side * part) for side in (-1, 1)]
        return found

    def _displacement(self, row: int) -> Any:
        data = self.exact.integers
        total = self.det * fmpz_poly([data.g0[row], data.g1[row]])
        for s, force in zip(data.rows[row], self._forces, strict=True):
            if not force.is_zero():
                total -= force * s
        return total

    def _cone(self, node: int, direction: int) -> Any:
        """F lambda_n - direction * lambda_t of a node."""
        data = self.exact.integers
        bound = self._forces[node] * fmpz_poly([data.F0[node], data.F1[node]])
        return bound - direction * data.friction_unit * self._forces[self.exact.p + node]

    def forces_at(self, alpha: fmpq) -> tuple[Any, ...] | None:
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
