"""How far a solution is from a fixed point of Psi (theory, section 11.3)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.fixed_points.state import scaled_unknowns, slips_of
from enumsol.fixed_points.system import ContactSystem, checked_problem
from enumsol.fixed_points.tresca import node_values, solve_scaled
from enumsol.fixed_points.tresca_newton import TrescaData
from enumsol.support.arguments import positive_number

if TYPE_CHECKING:
    from enumsol.fixed_points.system import Problem


def fixed_point_residual(problem: Problem, root: Any) -> float:
    """Distance by which Psi moves a root, relative to the load [-].

    The largest change of a contact force when the Tresca problem with the root's normal forces as slip bounds, and
    the coefficients at its slips, is solved, with displacements at the root as the body itself has them: what S has
    lost by rounding does not count (theory, (11.12)).

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
    root : Root, FixedPoint or other
        With alpha, lambda_n, lambda_t and u_t.

    Raises
    ------
    InvalidArgumentError
        The root has no forces, or belongs to another problem (its arrays have other shapes).
    """
    body = checked_problem(problem)
    if not hasattr(root, "alpha"):
        raise InvalidArgumentError(
            f"root is a {type(root).__name__} without alpha; expected a root of enumerate_roots or a fixed point"
        )
    system = ContactSystem.at(body, root.alpha)
    x = scaled_unknowns(system, root, "root")
    slip = system.scaled(node_values(slips_of(root, body.p, "root"), "slip", body.p), system.length, "slip")
    corrected, _ = system.corrected(x)
    data = TrescaData(corrected, np.maximum(system.split(x)[0], 0.0), system.coefficients(slip))
    image, _, _ = solve_scaled(data, x)
    return float(np.max(np.abs(image - x)[: system.m]))


def is_fixed_point(problem: Problem, root: Any, tolerance: float = 1e-8) -> bool:
    """True if a root is a fixed point of Psi within a tolerance (theory, section 11.3).

    With coefficients that do not depend on the solution the fixed points are exactly the solutions with Coulomb
    friction; every root of `enumerate_roots` is one.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
    root : Root, FixedPoint or other
        With alpha, lambda_n, lambda_t and u_t.
    tolerance : float
        Largest change of a contact force, relative to the load [-].

    Raises
    ------
    InvalidArgumentError
        The root has no forces, or belongs to another problem; the tolerance is not positive.

    Examples
    --------
    >>> import enumsol
    >>> problem = enumsol.gallery.one_node_triangle()
    >>> [enumsol.is_fixed_point(problem, root) for root in enumsol.enumerate_roots(problem, 5)]
    [True, True, True]
    """
    tolerance = positive_number(tolerance, "tolerance")
    return fixed_point_residual(problem, root) <= tolerance
