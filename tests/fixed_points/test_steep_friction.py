"""Coefficients that depend on the slip, where they are steep, and where slips are means at other places."""

import warnings

import numpy as np
import pytest
from refusals import bad_argument

import enumsol
from enumsol import ContactProblem3D, FrictionTable, SlipMean

ROWS = np.eye(4)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::enumsol.FrictionJumpWarning")
@pytest.mark.parametrize("anderson", [0, 5])
def test_converged_means_coefficients_at_the_slips(rng, anderson):
    converged = 0
    for _ in range(30):
        p = int(rng.integers(1, 4))
        Q, _ = np.linalg.qr(rng.standard_normal((3 * p, 3 * p)))
        A = (Q * 10.0 ** rng.uniform(0, 1, 3 * p)) @ Q.T
        rows, f = np.eye(3 * p), rng.standard_normal(3 * p)
        f[:p] = 2 * np.abs(f[:p])
        table = FrictionTable([0, 10.0 ** rng.uniform(-13, -1), 1], [rng.uniform(0.5, 1.5), 0.3, 0.3])
        problem = ContactProblem3D(0.5 * (A + A.T), rows[:p], rows[p : 2 * p], rows[2 * p :], f, friction=table)
        limit = enumsol.successive_approximations(problem, 0, anderson=anderson, max_iterations=100)
        slips = np.linalg.norm(limit.u_t, axis=1)
        off = np.max(np.abs(problem.coefficients(0, slips) - limit.coefficients))
        assert limit.residuals["coefficients"] == off
        if limit.converged:
            converged += 1
            assert off < 1e-9
    assert converged > 15


def with_distant_slip(friction):
    """One contact node, whose friction depends on how far an unconnected point moves: by 10."""
    mean = SlipMean(ROWS[3:], np.zeros((1, 4)), np.zeros((1, 2)), [[1.0]])
    return ContactProblem3D(
        np.eye(4), ROWS[:1], ROWS[1:2], ROWS[2:3], [1.0, 0.5, 0.0, 10.0], friction=friction, slip_mean=mean
    )


def test_estimate_of_a_function_of_mean_slips_covers_all_of_them():
    """F rises only beyond the slips that the contact node itself can have."""
    problem = with_distant_slip(lambda node, slip: 0.1 + max(0.0, slip - 5.0))
    limit = enumsol.successive_approximations(problem, 0)
    assert limit.coefficients[0, 0] == pytest.approx(5.1)
    estimate = enumsol.lipschitz_estimate(problem, 0, lipschitz=1.0)
    fixed = enumsol.lipschitz_estimate(with_distant_slip(5.1), 0)
    assert not fixed.unique
    assert fixed.C1 <= estimate.C1 < 3 * fixed.C1
    assert not estimate.unique


@pytest.mark.parametrize(("weights", "found"), [([[2.0]], "2"), ([[0.5]], "0.5"), ([[0.0]], "0")])
def test_weights_of_a_mean_add_up_to_one(weights, found):
    with pytest.raises(enumsol.InvalidProblemError, match=f"weights that add up to {found} in row 0; expected 1"):
        SlipMean(ROWS[3:], ROWS[3:], np.zeros((1, 2)), weights)


def test_areas_count_by_their_ratios_only():
    problem = enumsol.gallery.block3d(2, 2, 1)
    areas = np.linspace(1.0, 3.0, problem.p)
    first, *others = (enumsol.lipschitz_estimate(problem, 0, areas=k * areas).C1 for k in (1.0, 1e-300, 1e300))
    assert others == pytest.approx([first, first])
    for wrong in (0.0, np.where(areas > 1, 1.0, 1e-200)):
        with pytest.raises(enumsol.InvalidArgumentError, match=r"areas has the values .*; expected areas > 0"):
            enumsol.lipschitz_estimate(problem, 0, areas=wrong)


def test_a_lipschitz_constant_is_checked_where_it_is_not_needed_too():
    bad_argument("lipschitz is -1", enumsol.lipschitz_estimate, enumsol.gallery.one_node_triangle(), 0, lipschitz=-1)


def test_no_overflow_where_bounds_are_tiny_or_huge():
    problem = enumsol.gallery.block3d(2, 2, 1)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert enumsol.solve_tresca(problem, 5e-324, 0).residual < 1e-11
        assert enumsol.solve_tresca(problem, 1e90, 0).residual < 1e-11
        bad_argument(r"slip_bound has the value 1.7e\+308; expected at most", enumsol.solve_tresca, problem, 1.7e308, 0)
