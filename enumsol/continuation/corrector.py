"""Corrections: the Moore-Penrose corrector (theory, (8.5)) and smooth Newton corrections inside one selection."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from enumsol.condensation.condensed import solved

if TYPE_CHECKING:
    from enumsol.continuation.continuation_options import ContinuationOptions
    from enumsol.continuation.scaled_equation import ScaledEquation
    from enumsol.support.array_types import Codes, Floats

#: Corrections longer than this diverge: solutions have forces of size one at most, and steps are not much longer.
MAX_CORRECTION = 1e6


@dataclass(frozen=True)
class Correction:
    """Result of the corrections of one step.

    Attributes
    ----------
    x : (m + 1,) array
    count : int
        Number of corrections.
    converged : bool
    residual : float
        Norm of H at x.
    tangent : (m + 1,) array
        Unit tangent of the last selection, turned from the prediction's by less than a right angle a correction.
    """

    x: Floats
    count: int
    converged: bool
    residual: float
    tangent: Floats


def moore_penrose(equation: ScaledEquation, x: Floats, tangent: Floats, options: ContinuationOptions) -> Correction:
    """Steps 3-6 of the paper's Algorithm 5.1 from x: Newton's method across selections with a rotating tangent."""
    size = len(x) - 1
    T: Floats = tangent
    residual = np.inf
    for count in range(1, options.k_max + 2):
        rows = equation.selection_at(x)
        J = equation.jacobian(rows, x)
        bordered = np.vstack([J, equation.metric @ T])
        right = np.zeros((size + 1, 2))
        right[:size, 0] = J @ T
        right[:size, 1] = equation.selection_residual(rows, x)
        if not (np.all(np.isfinite(bordered)) and np.all(np.isfinite(right))):
            break
        try:
            steps: Floats = np.asarray(np.linalg.solve(bordered, right), dtype=np.float64)
        except np.linalg.LinAlgError:
            break  # a selection whose gradient does not fit the tangent: a shorter step is tried
        if not np.max(np.abs(steps)) <= MAX_CORRECTION:
            break
        turned: Floats = np.asarray(T - steps[:, 0], dtype=np.float64)
        length = equation.norm(turned)
        x = x - steps[:, 1]
        if length == 0:
            break
        T = turned / length
        residual = float(np.linalg.norm(equation.residual(x)))
        if residual < options.eps and equation.norm(steps[:, 1]) < options.eps_prime:
            return Correction(x, count, True, residual, T)
    return Correction(x, count, False, residual, T)


def smooth_newton(
    equation: ScaledEquation, codes: Codes, x: Floats, row: Floats | tuple[int, int], value: float, tolerance: float
) -> Floats | None:
    """Point of a selection's solution curve at which one more condition holds, by Newton's method from x.

    Parameters
    ----------
    codes : statuses that name the selection
    row : (m + 1,) array, or (node, k)
        The condition: ``row @ x = value``, or a slack of `ScaledEquation.slacks` that shall be ``value``.
    tolerance : float
        Length of the last correction.

    Returns
    -------
    (m + 1,) array, or None when it does not converge
    """
    rows = equation.selection(codes)
    last = np.inf
    # quadratic convergence needs about five
    for _ in range(20):
        if isinstance(row, tuple):
            gradient = equation.slack_gradients(codes, x)[row]
            defect = equation.slacks(codes, x)[row] - value
        else:
            gradient, defect = row, row @ x - value
        matrix = np.vstack([equation.jacobian(rows, x), gradient])
        right = np.append(equation.selection_residual(rows, x), defect)
        if not (np.all(np.isfinite(matrix)) and np.all(np.isfinite(right))):
            return None
        # of least length where a vertical segment ends in a bifurcation point
        step = solved(matrix, right)
        if not np.max(np.abs(step)) <= MAX_CORRECTION:
            return None
        x = x - step
        length = equation.norm(step)
        # corrections this short that no longer get shorter have reached rounding
        if length <= tolerance or 0.5 * last < length <= 1e-8:
            return x
        last = length
    return None
