"""Equivalent problems: other units, another order, tangents the other way round."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from enumsol import ContactProblem

if TYPE_CHECKING:
    from collections.abc import Callable


def rescaled(
    problem: ContactProblem, stiffness: float = 1.0, load: float = 1.0, nodes: Any = None, dofs: Any = None
) -> ContactProblem:
    """The problem in other units of stiffness and load, of every contact row pair, and of every degree of freedom.

    With D = diag(dofs), C = diag(nodes): stiffness D A D, C B D, load D f; forces change by load / C, displacements by
    C load / stiffness. Exactly equivalent for powers of two, up to rounding of the data for others.
    """
    c = np.ones(problem.p) if nodes is None else np.asarray(nodes, dtype=float)
    d = np.ones(problem.n) if dofs is None else np.asarray(dofs, dtype=float)
    D, C = sp.diags_array(d), sp.diags_array(c)
    length = load / stiffness
    slope = None if problem.load_slope is None else load * d * problem.load_slope
    return ContactProblem(
        sp.csc_array(stiffness * (D @ problem.A @ D)),
        C @ problem.Bn @ D,
        C @ problem.Bt @ D,
        load * d * problem.f,
        gap=length * c * problem.gap,
        friction=problem.friction,
        friction_slope=problem.friction_slope,
        load_slope=slope,
        slip_offset=length * c * problem.slip_offset,
    )


def permuted(problem: ContactProblem, order: Any) -> ContactProblem:
    """The contact nodes in another order, and the degrees of freedom backwards."""
    back = np.arange(problem.n)[::-1]
    order = np.asarray(order)
    slope = None if problem.load_slope is None else problem.load_slope[back]
    return ContactProblem(
        problem.A[:, back][back],
        problem.Bn[order][:, back],
        problem.Bt[order][:, back],
        problem.f[back],
        gap=problem.gap[order],
        friction=problem.friction[order],
        friction_slope=problem.friction_slope[order],
        load_slope=slope,
        slip_offset=problem.slip_offset[order],
    )


def mirrored(problem: ContactProblem) -> ContactProblem:
    """All tangents the other way round: slip+ and slip- change places."""
    return ContactProblem(
        problem.A,
        problem.Bn,
        -problem.Bt,
        problem.f,
        gap=problem.gap,
        friction=problem.friction,
        friction_slope=problem.friction_slope,
        load_slope=problem.load_slope,
        slip_offset=-problem.slip_offset,
    )


def backwards(problem: ContactProblem) -> tuple[ContactProblem, Callable[[Any], Any]]:
    """Partner for an invariance: nodes and unknowns in reverse order, tangents turned, other units."""
    other = rescaled(mirrored(permuted(problem, np.arange(problem.p)[::-1])), 3.0, 7.0)
    swap = {"slip+": "slip-", "slip-": "slip+"}
    return other, lambda statuses: [swap.get(s, s) for s in reversed(statuses)]
