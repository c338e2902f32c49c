"""Coulomb friction as a fixed point of Tresca problems, in 2D and 3D (theory, section 11; paper, Sections 2 and 3)."""

from enumsol.fixed_points.lipschitz import LipschitzEstimate, lipschitz_estimate
from enumsol.fixed_points.result import FixedPoint, Outcome
from enumsol.fixed_points.successive import (
    FixedPointProgress,
    fixed_point_residual,
    is_fixed_point,
    successive_approximations,
)
from enumsol.fixed_points.tresca import TrescaSolution, solve_tresca
from enumsol.fixed_points.tresca_solvers import TrescaNotFeasible, TrescaNotSolved, TrescaReference

__all__ = [
    "FixedPoint",
    "FixedPointProgress",
    "LipschitzEstimate",
    "Outcome",
    "TrescaNotFeasible",
    "TrescaNotSolved",
    "TrescaReference",
    "TrescaSolution",
    "fixed_point_residual",
    "is_fixed_point",
    "lipschitz_estimate",
    "solve_tresca",
    "successive_approximations",
]
