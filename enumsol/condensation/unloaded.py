"""Where g(alpha) = g0 + alpha g1 vanishes, at one alpha or at all, found in one place for the search and the checker.

There lambda = 0 is the only solution and every selection holds. On either side of it the solutions are alpha's distance
from it times those of the constant load +-g1, so that the search cuts the interval there, and the checker expects
pieces that end there (theory, section 7.8). Both ask this module. It is decided without rounding, in the data that are
certified: a zero of the problem's own g is not one of g as computed in floats, nor the other way round. For that the
problem's matrices and g are here in rationals, from which the checker condenses, too; the search has its own code for
this (``condensation.exact``), but for `solved`.
"""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.condensation.data import EXACT_DOF_LIMIT, Data, ProblemData
from enumsol.condensation.enclosure import NotEnclosedError
from enumsol.support.deadlines import look, tell

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flint import fmpq, fmpq_mat

    from enumsol.support.array_types import Floats

#: Right-hand sides that are solved for together: with 170 degrees of freedom half a second, beside 0.14 s for one.
_COLUMNS = 4


def vanishing_alpha(problem: ProblemData, data: Data) -> Fraction | None:
    """The only alpha at which g vanishes exactly; None when there is none, or when g vanishes for every alpha.

    None of a body that nothing holds: it may still be moved there (theory, section 14.8).

    Parameters
    ----------
    problem : ContactProblem
    data : {"problem", "condensed"}
        Which g: the one of A, Bn, Bt, f, load_slope, gap and slip_offset as given, or g as computed in floats.

    Notes
    -----
    "problem", with more than EXACT_DOF_LIMIT degrees of freedom: only a load that vanishes while there is neither gap
    nor slip offset is recognised.

    Raises
    ------
    NotEnclosedError
        "problem": A is singular.
    """
    if problem.load_slope is None or not problem.held:
        return None
    if data == "condensed":
        return _of_floats(problem.condensed.g0, problem.condensed.g1)
    if problem.n > EXACT_DOF_LIMIT:
        still = not np.any(problem.gap) and not np.any(problem.slip_offset)
        return _of_floats(problem.f, problem.load_slope) if still else None
    zero = _common_zero(*free_displacements(problem))
    return None if zero is None else Fraction(int(zero.p), int(zero.q))


def never_loaded(problem: ProblemData) -> bool:
    """True if g is known to vanish at every alpha, for A, Bn, Bt, f, load_slope, gap and slip_offset as given.

    With more than EXACT_DOF_LIMIT degrees of freedom only where all loads, gap and slip offset are zero.
    """
    parts = (problem.f, problem.load_slope, problem.gap, problem.slip_offset)
    if not any(part is not None and np.any(part) for part in parts):
        return True
    if problem.n > EXACT_DOF_LIMIT:
        return False
    try:
        g = problem.enclosure
    except NotEnclosedError:
        return False
    if np.any(np.abs(g.g0) > g.g0_rad) or np.any(np.abs(g.g1) > g.g1_rad):
        return False
    return not any(x != 0 for part in free_displacements(problem) for x in part)


def _of_floats(constant: Floats, slope: Floats) -> Fraction | None:
    """The only alpha at which constant + alpha slope vanishes, exactly."""
    zero = _common_zero(*([Fraction(x) for x in part.tolist()] for part in (constant, slope)))
    return None if zero is None else Fraction(zero)


def _common_zero(g0: Sequence[Any], g1: Sequence[Any]) -> Any:
    """The only zero that all x + alpha y have in common, for rationals of any kind; None if there is none."""
    zero = None
    for x, y in zip(g0, g1, strict=True):
        if y == 0:
            if x != 0:
                return None
        elif zero is None:
            zero = -x / y
        elif x + zero * y != 0:
            return None
    return zero


def free_displacements(problem: ProblemData) -> tuple[list[fmpq], list[fmpq]]:
    """g0 = B A^-1 f - (gap, slip_offset) and g1 = B A^-1 load_slope, 2p fmpq each.

    Raises
    ------
    NotEnclosedError
        A is singular, or has more than EXACT_DOF_LIMIT degrees of freedom.
    """
    A, B = exact_matrices(problem)
    from flint import fmpq_mat  # as below

    from enumsol.arithmetic.rationals import rational

    slope = [0.0] * problem.n if problem.load_slope is None else problem.load_slope.tolist()
    loads = fmpq_mat([[rational(x), rational(y)] for x, y in zip(problem.f.tolist(), slope, strict=True)])
    moved = (B * solved(A, loads)).tolist()
    offset = problem.gap.tolist() + problem.slip_offset.tolist()
    return [row[0] - rational(o) for row, o in zip(moved, offset, strict=True)], [row[1] for row in moved]


def exact_matrices(problem: ProblemData) -> tuple[fmpq_mat, fmpq_mat]:
    """A and B = [Bn; Bt] as fmpq_mat.

    Raises
    ------
    NotEnclosedError
        A has more than EXACT_DOF_LIMIT degrees of freedom.
    """
    from enumsol.arithmetic.rationals import rational_matrix  # python-flint, not needed by all problems

    if problem.n > EXACT_DOF_LIMIT:
        raise NotEnclosedError(
            f"the problem has n = {problem.n} degrees of freedom; expected at most {EXACT_DOF_LIMIT} for rational "
            "arithmetic"
        )
    return rational_matrix(problem.A.toarray()), rational_matrix(problem.contact_rows.toarray())


def solved(A: fmpq_mat, rhs: fmpq_mat) -> fmpq_mat:
    """A^-1 rhs, a few columns at a time: no slower than all at once, and it can report its progress and be stopped.

    Raises
    ------
    NotEnclosedError
        A is singular.
    TimeOverError
        The deadline that holds here has passed.
    """
    from flint import fmpq_mat  # as above

    rows = rhs.tolist()
    parts: list[list[list[fmpq]]] = []
    for start in range(0, rhs.ncols(), _COLUMNS):
        look()
        tell("columns of A^-1 B' in rationals", start, rhs.ncols())
        try:
            parts.append(A.solve(fmpq_mat([row[start : start + _COLUMNS] for row in rows])).tolist())
        except ZeroDivisionError:
            raise NotEnclosedError("A is singular in rational arithmetic") from None
    return fmpq_mat([[x for part in line for x in part] for line in zip(*parts, strict=True)])
