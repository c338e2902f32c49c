"""The alpha at which g(alpha) = g0 + alpha g1 vanishes, found in one place for the search and for the checker.

There lambda = 0 is the only solution and every selection holds. On either side of it the solutions are alpha's distance
from it times those of the constant load +-g1, so that the search cuts the interval there, and the checker expects
pieces that end there (theory, section 7.8). Both ask this module. It is decided without rounding, in the data that are
certified: a zero of the problem's own g is not one of g as computed in floats, nor the other way round.
"""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from enumsol.condensation.data import EXACT_DOF_LIMIT, ProblemData

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from enumsol.condensation.condensed import CondensedProblem
    from enumsol.condensation.data import Data


class CondensedData(ProblemData, Protocol):
    """A problem's data, as given and condensed in floats."""

    @property
    def condensed(self) -> CondensedProblem:
        """S, g0 and g1 as computed."""


def vanishing_alpha(problem: CondensedData, data: Data) -> Fraction | None:
    """The only alpha at which g vanishes exactly; None when there is none, or when g vanishes for every alpha.

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
    if problem.load_slope is None:
        return None
    if data == "condensed":
        return _of_floats(problem.condensed.g0, problem.condensed.g1)
    if problem.n > EXACT_DOF_LIMIT:
        still = not np.any(problem.gap) and not np.any(problem.slip_offset)
        return _of_floats(problem.f, problem.load_slope) if still else None
    from enumsol.condensation.free_displacements import free_displacements  # python-flint, not needed by all proofs

    zero = _common_zero(*free_displacements(problem))
    return None if zero is None else Fraction(int(zero.p), int(zero.q))


def _of_floats(constant: NDArray[np.float64], slope: NDArray[np.float64]) -> Fraction | None:
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
