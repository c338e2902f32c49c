"""Distance of a point from the solutions of a singular selection: a polytope at every alpha of a sheet."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from enumsol.continuation.condensed_equation import STATUS_TOLERANCE

if TYPE_CHECKING:
    from enumsol.continuation.condensed_equation import Codes, CondensedEquation, Vector

#: Singular values of a selection's matrix below this fraction of the largest are zero: on a sheet they are so exactly.
_RANK = 1e-10


def selection_distance(equation: CondensedEquation, codes: Codes, x: Vector) -> float:
    """Distance of x from the solutions of one selection at the alpha of x; infinite when it has none there.

    The solutions are x + y for all y that solve the selection's equations and keep its conditions, both affine in y.
    In the coordinates of the metric y is the least solution of the equations and a part in their kernel, at right
    angles to it; the shortest such part is a least-distance problem (Lawson and Hanson, Solving Least Squares Problems,
    chapter 23).
    """
    rows = equation.selection(codes)
    to_metric = np.linalg.inv(np.linalg.cholesky(equation.S).T)
    left, sizes, right = np.linalg.svd(equation.jacobian(rows, x)[:, :-1] @ to_metric)
    rank = int(np.sum(sizes > _RANK * sizes[0]))
    residual = left.T @ equation.selection_residual(rows, x)
    if np.linalg.norm(residual[rank:]) > STATUS_TOLERANCE:
        return math.inf
    step = -right[:rank].T @ (residual[:rank] / sizes[:rank])
    kernel = to_metric @ right[rank:].T
    base = x + np.append(to_metric @ step, 0.0)
    slacks = equation.slacks(codes, base)
    which = [(int(i), int(k)) for i, k in np.argwhere(np.isfinite(slacks))]
    rates = np.array([equation.slack_gradient(codes, base, pair)[:-1] @ kernel for pair in which])
    needed = -np.array([slacks[pair] for pair in which]) - STATUS_TOLERANCE
    return math.hypot(float(np.linalg.norm(step)), _least_norm(rates, needed))


def _least_norm(matrix: Vector, bounds: Vector) -> float:
    """Norm of the shortest z with matrix @ z >= bounds; infinite when there is none."""
    if not matrix.shape[1] or np.all(bounds <= 0):
        return 0.0 if np.all(bounds <= 0) else math.inf
    from scipy.optimize import nnls  # only sheets need it

    target = np.zeros(matrix.shape[1] + 1)
    target[-1] = 1.0
    system = np.vstack([matrix.T, bounds])
    weights, length = nnls(system, target)
    if length <= STATUS_TOLERANCE:
        return math.inf
    rest = system @ weights - target
    return float(np.linalg.norm(rest[:-1]) / -rest[-1])
