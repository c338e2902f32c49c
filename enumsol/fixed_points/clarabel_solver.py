"""Tresca problems by Clarabel on the condensed problem: a QP in 2D, second-order cones in 3D (theory, (11.2))."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

if TYPE_CHECKING:
    from enumsol.fixed_points.newton import TrescaData, Vector

#: Tolerance of Clarabel; Newton's method improves the result.
TOLERANCE = 1e-11


def interior_point(data: TrescaData) -> Vector | None:
    """Scaled forces that solve a Tresca problem to about 1e-9, from scratch; None if Clarabel fails.

    Components of lambda_t that do not occur are left out, so that every cone has an interior.
    """
    import clarabel  # takes a while to import

    system, occurs = data.system, data.occurs
    p = system.p
    node_one = np.flatnonzero(np.sum(occurs, axis=1) == 1)
    node_two = np.flatnonzero(np.sum(occurs, axis=1) == 2)
    free = np.concatenate([np.ones(p, dtype=bool), occurs.T.ravel()])
    column = np.cumsum(free) - 1
    axis = np.argmax(occurs[node_one], axis=1)
    F = data.F[node_one, axis]
    # 0 <= lambda_n;  |lambda_t| <= s F for one axis;  (s, lambda_t / F) in the second-order cone for two
    parts = [(np.arange(p), np.arange(p), -np.ones(p))]
    first = p
    interval = column[(1 + axis) * p + node_one]
    for sign in (1.0, -1.0):
        parts.append((first + np.arange(len(node_one)), interval, np.full(len(node_one), sign)))
        first += len(node_one)
    for k in range(2 if len(node_two) else 0):
        rows = first + 3 * np.arange(len(node_two)) + 1 + k
        parts.append((rows, column[(1 + k) * p + node_two], -1.0 / data.F[node_two, k]))
    size = first + 3 * len(node_two)
    offset = np.zeros(size)
    offset[p:first] = np.tile(data.bound[node_one] * F, 2)
    offset[first::3] = data.bound[node_two]
    rows, columns, values = (np.concatenate(part) for part in zip(*parts, strict=True))
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.direct_solve_method = "faer"  # the Hessian is dense, for which the default is several times slower
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = TOLERANCE
    answer = clarabel.DefaultSolver(
        sp.csc_matrix(np.triu(system.S[np.ix_(free, free)])),
        -system.g[free],
        sp.csc_matrix((values, (rows, columns)), shape=(size, int(np.sum(free)))),
        offset,
        [clarabel.NonnegativeConeT(first), *[clarabel.SecondOrderConeT(3)] * len(node_two)],
        settings,
    ).solve()
    found = np.array(answer.x)
    if not np.all(np.isfinite(found)):
        return None
    forces = np.zeros(len(system.g))
    forces[free] = found
    return forces
