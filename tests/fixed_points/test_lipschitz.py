"""Bounds on the Lipschitz constant of Psi against differences of its values, closed forms and enumerated roots."""

import numpy as np
import pytest
from alike import assert_close
from complete import limit_of
from effort import some
from generators import dense_compliance, from_condensed
from problems3d import from_compliance, random_compliance
from refusals import bad_argument, bad_problem

import enumsol
from enumsol import ContactProblem3D, FrictionTable, SlipMean


def test_closed_form_of_one_node():
    # S^-1 of [[a, c], [c, b]]: C1^2 = F^2 b^2 / (a b - c^2)
    a, b, c, F = 2.0, 3.0, 1.0, 0.4
    estimate = enumsol.lipschitz_estimate(from_condensed(np.array([[a, c], [c, b]]), np.ones(2), [F]), 0)
    np.testing.assert_allclose(estimate.C1, F * b / np.sqrt(a * b - c * c))
    assert estimate.C2 == 0.0
    np.testing.assert_allclose(estimate.factor, 1.0 / estimate.C1)
    spatial = np.array([[a, c, 0.0], [c, b, 0.0], [0.0, 0.0, 0.1]])
    orthotropic = enumsol.lipschitz_estimate(from_compliance(spatial, np.ones(3), (F, 0.2)), 0)
    np.testing.assert_allclose(orthotropic.C1, estimate.C1)
    assert orthotropic.anisotropy == pytest.approx(2.0)


def test_it_is_the_bound_of_the_branch_graph_or_better(rng):
    problem = enumsol.gallery.get("two-node-5").build()
    bound = enumsol.branch_graph(problem, (0.0, 5.0)).uniqueness_bound
    assert enumsol.lipschitz_estimate(problem, 1.0).factor >= bound * (1 - 1e-12)


@pytest.mark.slow
def test_below_the_bound_there_is_one_root(rng):
    for _ in range(some(35, of=100)):
        p = int(rng.integers(1, 5))
        S, F = dense_compliance(rng, p), rng.uniform(0.1, 3.0, p)
        problem = from_condensed(S, rng.normal(size=2 * p), F)
        factor = enumsol.lipschitz_estimate(problem, 0).factor
        small = from_condensed(S, rng.normal(size=2 * p), 0.999 * factor * F)
        assert enumsol.lipschitz_estimate(small, 0).unique
        assert len(enumsol.enumerate_roots(small, 0)) == 1


@pytest.mark.slow
def test_the_constant_bounds_differences_of_psi(rng):
    for _ in range(some(10, of=30)):
        p = int(rng.integers(1, 4))
        S, g = random_compliance(rng, p), rng.normal(size=3 * p)
        m, L = rng.uniform(0.2, 2.0, p), 0.05

        def friction(node, slip, L=L):
            return 0.2 + L * np.sin(slip), 0.3 + L * np.cos(slip)

        problem = from_compliance(S, g, friction, areas=m)
        estimate = enumsol.lipschitz_estimate(problem, 0, lipschitz=L)
        assert not estimate.sampled
        D = np.linalg.inv(np.linalg.inv(S)[:p, :p])
        root = np.tile(np.sqrt(m), 2)
        c_phi = np.sqrt(np.linalg.eigvalsh(root[:, None] * S[p:, p:] * root)[-1])

        def size(slips, forces, D=D, m=m, c_phi=c_phi):
            return max(np.sqrt(m @ slips**2) / c_phi, np.sqrt(forces @ D @ forces))

        # inputs as Psi gives them, for which the energy bound holds
        inputs = []
        for _ in range(2):
            rough = enumsol.solve_tresca(problem, rng.uniform(0, 1, p), 0, slip=rng.uniform(0, 1, p))
            inputs.append((np.hypot(*rough.u_t.T), rough.lambda_n))
        images = []
        for slip, bound in inputs:
            image = enumsol.solve_tresca(problem, np.maximum(bound, 0.0), 0, slip=slip)
            images.append((np.hypot(*image.u_t.T), image.lambda_n))
        before = size(inputs[0][0] - inputs[1][0], inputs[0][1] - inputs[1][1])
        after = size(images[0][0] - images[1][0], images[0][1] - images[1][1])
        assert after <= estimate.constant * before * (1 + 1e-9)


@pytest.mark.slow
def test_iterations_contract_at_least_as_much_as_the_estimate_says(rng):
    for _ in range(some(8, of=20)):
        p = int(rng.integers(1, 5))
        S, g, F = random_compliance(rng, p), rng.normal(size=3 * p), rng.uniform(0.1, 1.0, (p, 2))
        factor = 0.9 * enumsol.lipschitz_estimate(from_compliance(S, g, (F[:, 0], F[:, 1])), 0).factor
        small = from_compliance(S, g, (factor * F[:, 0], factor * F[:, 1]))
        estimate = enumsol.lipschitz_estimate(small, 0)
        assert estimate.contracts
        found = limit_of(small, 0, start=rng.uniform(0, 5, p))
        forces = found.increments[:, 1]
        steps = forces[1:][forces[1:] > 1e-9] / forces[:-1][forces[1:] > 1e-9]
        assert np.all(steps <= estimate.C1 * (1 + 1e-6))


def test_tables_and_samples(rng):
    S, g = random_compliance(rng, 2), rng.normal(size=6)
    table = enumsol.FrictionTable([0.0, 1.0, 3.0], [0.3, 0.1, 0.2])
    by_table = enumsol.lipschitz_estimate(from_compliance(S, g, table), 0)
    assert by_table.lipschitz == pytest.approx(0.2)
    assert by_table.anisotropy == 1.0
    assert not by_table.sampled
    sampled = enumsol.lipschitz_estimate(from_compliance(S, g, lambda node, slip: 0.01 * np.exp(-slip)), 0)
    assert sampled.sampled
    assert 0.009 < sampled.lipschitz <= 0.01
    assert not sampled.unique
    no_axis = enumsol.lipschitz_estimate(from_compliance(S, g, lambda node, slip: (0.01 * np.exp(-slip), 0.0)), 0)
    assert no_axis.C2 > 1e100


def test_the_slip_constant_where_slips_are_means():
    table = enumsol.FrictionTable([0.0, 1.0], [0.3, 0.2])
    problem = enumsol.gallery.block3d(4, 4, 2, friction=table, multipliers="elements", ratio=2)
    p, mean, m, S = problem.p, problem.slip_mean, problem.areas, problem.condensed.S
    g, inverse = problem.condensed.g0, np.linalg.inv(S)
    T = np.vstack([mean.T1.toarray(), mean.T2.toarray()])
    root = np.tile(np.sqrt(mean.weights.T @ m), 2)[:, None] * T
    c_phi = np.linalg.norm(root @ np.linalg.inv(np.linalg.cholesky(problem.A.toarray())).T, 2)
    c_0 = np.sqrt(np.linalg.eigvalsh(inverse[:p, :p] / np.sqrt(np.outer(m, m)))[-1])
    c_inf = np.sqrt(max(np.linalg.eigvalsh(S[np.ix_([p + i, 2 * p + i], [p + i, 2 * p + i])])[-1] for i in range(p)))
    estimate = enumsol.lipschitz_estimate(problem, 0)
    np.testing.assert_allclose(estimate.C2, 0.1 * c_0 * c_inf * c_phi * np.sqrt(g @ inverse @ g), rtol=1e-9)


def test_without_friction_everything_is_unique():
    estimate = enumsol.lipschitz_estimate(from_compliance(np.eye(3), np.ones(3), 0.0), 0)
    assert estimate.C1 == 0.0
    assert estimate.factor == np.inf
    assert estimate.unique


def test_units_do_not_matter(rng):
    S, g = random_compliance(rng, 3), rng.normal(size=9)
    one = enumsol.lipschitz_estimate(from_compliance(S, g, enumsol.FrictionTable([0, 1], [0.3, 0.2])), 0)
    table = enumsol.FrictionTable([0, 1e3], [0.3, 0.2])
    mm = enumsol.lipschitz_estimate(from_compliance(1e3 * S, 1e3 * g, table, areas=np.full(3, 1e6)), 0)
    assert_close(mm, one, "C1", "C2", "uniqueness", "factor", rtol=1e-9, atol=0)


def test_bad_arguments():
    problem = from_compliance(np.eye(3), np.ones(3), lambda node, slip: 0.1)
    bad_argument("areas has shape", enumsol.lipschitz_estimate, problem, 0, areas=[1.0, 2.0])
    bad_argument("lipschitz is -1", enumsol.lipschitz_estimate, problem, 0, lipschitz=-1.0)


def test_a_tiny_coefficient_is_not_taken_for_none():
    estimates = [enumsol.lipschitz_estimate(enumsol.gallery.block3d(2, 2, 1, friction=F), 0) for F in (0.5, 1e-200)]
    assert estimates[1].factor == pytest.approx(0.5e200 * estimates[0].factor)


# -- friction that falls steeply with the slip -------------------------------------------------------------------------


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
    message = f"weights that add up to {found} in row 0; expected 1"
    bad_problem(message, SlipMean, ROWS[3:], ROWS[3:], np.zeros((1, 2)), weights)


def test_areas_count_by_their_ratios_only():
    problem = enumsol.gallery.block3d(2, 2, 1)
    areas = np.linspace(1.0, 3.0, problem.p)
    first, *others = (enumsol.lipschitz_estimate(problem, 0, areas=k * areas).C1 for k in (1.0, 1e-300, 1e300))
    assert others == pytest.approx([first, first])
    for wrong in (0.0, np.where(areas > 1, 1.0, 1e-200)):
        message = r"areas has the values .*; expected areas > 0"
        bad_argument(message, enumsol.lipschitz_estimate, problem, 0, areas=wrong)


def test_a_lipschitz_constant_is_checked_where_it_is_not_needed_too():
    bad_argument("lipschitz is -1", enumsol.lipschitz_estimate, enumsol.gallery.one_node_triangle(), 0, lipschitz=-1)


def test_no_overflow_where_bounds_are_tiny_or_huge():
    problem = enumsol.gallery.block3d(2, 2, 1)
    for bound in (5e-324, 1e90):
        assert enumsol.solve_tresca(problem, bound, 0).residual < 1e-11
    bad_argument(r"slip_bound has the value 1.7e\+308; expected at most", enumsol.solve_tresca, problem, 1.7e308, 0)
