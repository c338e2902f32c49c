"""Tresca problems by Clarabel on the condensed problem: a QP in 2D, second-order cones in 3D (theory, (11.2))."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

if TYPE_CHECKING:
    from enumsol.fixed_points.tresca_newton import TrescaData, Vector

#: Tolerance of Clarabel; Newton's method improves the result.
TOLERANCE = 1e-11


def interior_point(data: TrescaData) -> tuple[Vector | None, Vector]:
    """The x that solves a Tresca problem to about 1e-9, from scratch, None if Clarabel fails; and a rigid displacement.

    If no forces balance the load on a body that nothing holds, they do not along the latter, scaled and of shape (r,).
    Components of lambda_t that do not occur are left out, so that every cone has an interior.
    """
    import clarabel  # takes a while to import

    system, occurs = data.system, data.occurs
    p = system.p
    bound = np.minimum(data.bound, _reach(data))
    node_one = np.flatnonzero(np.sum(occurs, axis=1) == 1)
    node_two = np.flatnonzero(np.sum(occurs, axis=1) == 2)
    free = np.concatenate([np.ones(p, dtype=bool), occurs.T.ravel()])
    column = np.cumsum(free) - 1
    axis = np.argmax(occurs[node_one], axis=1)
    F = data.F[node_one, axis]
    # 0 <= lambda_n;  |lambda_t| <= s F for one axis;  (s, lambda_t / F), scaled, in the second-order cone for two
    least = np.min(data.F[node_two], axis=1)
    parts = [(np.arange(p), np.arange(p), -np.ones(p))]
    first = p
    interval = column[(1 + axis) * p + node_one]
    for sign in (1.0, -1.0):
        parts.append((first + np.arange(len(node_one)), interval, np.full(len(node_one), sign)))
        first += len(node_one)
    for k in range(2 if len(node_two) else 0):
        rows = first + 3 * np.arange(len(node_two)) + 1 + k
        parts.append((rows, column[(1 + k) * p + node_two], -least / data.F[node_two, k]))
    size = first + 3 * len(node_two)
    offset = np.zeros(size)
    offset[p:first] = np.tile(bound[node_one] * F, 2)
    offset[first::3] = bound[node_two] * least
    rows, columns, values = (np.concatenate(part) for part in zip(*parts, strict=True))
    limits = sp.csc_matrix((values, (rows, columns)), shape=(size, int(np.sum(free))))
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.direct_solve_method = "faer"  # the Hessian is dense, for which the default is several times slower
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = TOLERANCE
    settings.tol_infeas_abs = settings.tol_infeas_rel = TOLERANCE
    answer = clarabel.DefaultSolver(
        sp.csc_matrix(np.triu(system.S[np.ix_(free, free)])),
        -system.g[free],
        sp.csc_matrix(sp.vstack([system.G[:, free], limits])),
        np.append(system.h, offset),
        [
            clarabel.ZeroConeT(system.modes),
            clarabel.NonnegativeConeT(first),
            *[clarabel.SecondOrderConeT(3)] * len(node_two),
        ],
        settings,
    ).solve()
    found, rigid = np.array(answer.x), -np.array(answer.z)[: system.modes]
    if not (np.all(np.isfinite(found)) and np.all(np.isfinite(rigid))):
        return None, np.zeros(system.modes)
    forces = np.zeros(system.m)
    forces[free] = found
    return np.append(forces, rigid), rigid


def _reach(data: TrescaData) -> Vector:
    """Sizes that |tau| cannot exceed, by `largest_forces`, shape (p,): larger bounds are none.

    With them the solver meets no numbers that are large for no reason.
    """
    most = data.system.split(data.system.largest_forces)[1]
    with np.errstate(over="ignore"):
        tau = np.divide(most, data.F, out=np.zeros_like(most), where=data.occurs)
        return np.asarray(2.0 * np.sum(tau, axis=1))
