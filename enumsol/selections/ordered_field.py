"""All solutions of selections at one exact alpha, rational or irrational (theory, section 7.4)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from flint import fmpq

from enumsol.arithmetic.rationals import to_fraction
from enumsol.model.statuses import STICK, RowKind
from enumsol.selections.polytopes import dot
from enumsol.selections.rational_selections import ExactSelections
from enumsol.support.deadlines import look

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from enumsol.condensation.exact import ExactCondensed
    from enumsol.selections.polytopes import Form, Point, Table
    from enumsol.selections.solution import Codes


class FiberSelections(ExactSelections):
    """Solver of selections at one alpha in any exact ordered field.

    Unlike its base class it keeps the four statuses where F = 0 at the end of an interval, as the limits of arcs need
    them; nodes with F = 0 throughout are FRICTIONLESS.

    Parameters
    ----------
    exact : ExactCondensed
    alpha : fmpq or NumberFieldElement
    push : direction that replaces g, in the perturbations that give the local degree
    """

    def __init__(self, exact: ExactCondensed, alpha: Any, push: tuple[Any, ...] | None = None) -> None:
        system = exact.system(alpha)
        super().__init__(system if push is None else system.along(push))
        self.exact, self.alpha = exact, alpha
        self.F_positive = tuple(not without for without in exact.frictionless)

    @staticmethod
    def _solved(M: NDArray[Any], b: Sequence[Any]) -> tuple[Sequence[Any], int] | None:
        """y with M y = b, and sign det M; None where it is zero."""
        table = [[*row, value] for row, value in zip(M.tolist(), b, strict=True)]
        det = row_reduce(table)[0]
        return None if det == 0 else ([row[-1] for row in table], 1 if det > 0 else -1)

    def forms(self, codes: Codes) -> tuple[list[Form], list[Form]]:
        """Equations and inequalities (>= 0) of a selection as forms over lambda."""
        equations, inequalities = super().forms(codes)
        # where F = 0 the cone of a sticking node does not imply lambda_n >= 0
        return equations, inequalities + [
            self.form(RowKind.NORMAL_FORCE, i) for i, code in enumerate(codes) if code == STICK
        ]

    def _slacks(self, codes: Codes, point: Point) -> list[Any]:
        """Values of the inequalities of ``forms`` at a point."""
        return super()._slacks(codes, point) + [point[i] for i, code in enumerate(codes) if code == STICK]

    def moved(self, point: Point) -> list[Any]:
        """w = g - S lambda."""
        return [g - dot(row, point) for g, row in zip(self.system.g, self._S, strict=True)]

    # -- the field -------------------------------------------------------------------------------------------------

    @staticmethod
    def row_reduced(table: Table) -> tuple[Table, list[int]]:
        """Rows of the reduced row echelon form that are not zero, and their pivot columns."""
        pivots = row_reduce(table)[1]
        return table[: len(pivots)], pivots

    @staticmethod
    def as_float(number: Any) -> float:
        """The nearest float."""
        return as_float(number)

    def pushed(self, direction: tuple[Any, ...]) -> FiberSelections:
        """The solver whose g is a direction."""
        return FiberSelections(self.exact, self.alpha, direction)


def as_float(value: Any) -> float:
    """The nearest float of a field element."""
    return float(to_fraction(value)) if isinstance(value, fmpq) else float(value)


def row_reduce(table: list[list[Any]]) -> tuple[Any, list[int]]:
    """Reduce a table to row echelon form in place; its determinant (a last column left out) and pivots."""
    det: Any = fmpq(1)
    pivots: list[int] = []
    columns = len(table[0]) if table else 0
    for column in range(columns):
        look()
        rank = len(pivots)
        pivot = next((r for r in range(rank, len(table)) if table[r][column] != 0), None)
        if pivot is None:
            continue
        if pivot != rank:
            table[rank], table[pivot] = table[pivot], table[rank]
            det = -det
        head = table[rank][column]
        det = det * head
        table[rank] = [v / head for v in table[rank]]
        for r, row in enumerate(table):
            if r != rank and row[column] != 0:
                factor = row[column]
                table[r] = [v - factor * u for v, u in zip(row, table[rank], strict=True)]
        pivots.append(column)
    full = pivots == list(range(len(table)))
    return (det if full else fmpq(0)), pivots
