"""The problem's matrices in rationals, and g solved from them: for the checker, and for the alpha at which g vanishes.

The search has its own code for this (``condensation.exact``), but for `solved`.
"""

from __future__ import annotations

from typing import Any

from flint import fmpq_mat

from enumsol.arithmetic.rationals import rational, rational_matrix
from enumsol.condensation.data import EXACT_DOF_LIMIT, ProblemData
from enumsol.condensation.enclosure import NotEnclosedError
from enumsol.support.deadlines import look, tell

#: Right-hand sides that are solved for together: with 170 degrees of freedom half a second, beside 0.14 s for one.
_COLUMNS = 4


def free_displacements(problem: ProblemData) -> tuple[list[Any], list[Any]]:
    """g0 = B A^-1 f - (gap, slip_offset) and g1 = B A^-1 load_slope, 2p fmpq each.

    Raises
    ------
    NotEnclosedError
        A is singular, or has more than EXACT_DOF_LIMIT degrees of freedom.
    """
    A, B = exact_matrices(problem)
    slope = [0.0] * problem.n if problem.load_slope is None else problem.load_slope.tolist()
    loads = fmpq_mat([[rational(x), rational(y)] for x, y in zip(problem.f.tolist(), slope, strict=True)])
    moved = (B * solved(A, loads)).tolist()
    offset = problem.gap.tolist() + problem.slip_offset.tolist()
    return [row[0] - rational(o) for row, o in zip(moved, offset, strict=True)], [row[1] for row in moved]


def exact_matrices(problem: ProblemData) -> tuple[Any, Any]:
    """A and B = [Bn; Bt] as fmpq_mat.

    Raises
    ------
    NotEnclosedError
        A has more than EXACT_DOF_LIMIT degrees of freedom.
    """
    if problem.n > EXACT_DOF_LIMIT:
        raise NotEnclosedError(
            f"the problem has n = {problem.n} degrees of freedom; expected at most {EXACT_DOF_LIMIT} for rational "
            "arithmetic"
        )
    return rational_matrix(problem.A.toarray()), rational_matrix(problem.contact_rows.toarray())


def solved(A: Any, rhs: Any) -> Any:
    """A^-1 rhs, a few columns at a time: no slower than all at once, and it can report its progress and be stopped.

    Raises
    ------
    NotEnclosedError
        A is singular.
    TimeOverError
        The deadline that holds here has passed.
    """
    rows, parts = rhs.tolist(), []
    for start in range(0, rhs.ncols(), _COLUMNS):
        look()
        tell("columns of A^-1 B' in rationals", start, rhs.ncols())
        try:
            parts.append(A.solve(fmpq_mat([row[start : start + _COLUMNS] for row in rows])).tolist())
        except ZeroDivisionError:
            raise NotEnclosedError("A is singular in rational arithmetic") from None
    return fmpq_mat([[x for part in line for x in part] for line in zip(*parts, strict=True)])
