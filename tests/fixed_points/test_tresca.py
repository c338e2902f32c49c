"""Tresca problems: both fast solvers against CVXPY on the problem in u, closed forms, and bad arguments."""

import numpy as np
import pytest
from generators import dense_compliance, from_condensed
from problems3d import from_compliance, random_compliance
from refusals import bad_argument
from scipy.optimize import nnls

import enumsol
from enumsol.fixed_points import clarabel_solver, tresca


def random_3d(rng):
    p = int(rng.integers(1, 5))
    F = tuple(10.0 ** rng.uniform(-2, 2, p) * (rng.random(p) > 0.15) for _ in range(2))
    problem = from_compliance(random_compliance(rng, p), rng.normal(size=3 * p), F)
    return problem, np.abs(rng.normal(size=p)) * (rng.random(p) > 0.2)


def random_2d(rng):
    p = int(rng.integers(1, 6))
    F = 10.0 ** rng.uniform(-2, 2, p) * (rng.random(p) > 0.15)
    return from_condensed(dense_compliance(rng, p), rng.normal(size=2 * p), F), np.abs(rng.normal(size=p))


@pytest.mark.slow
@pytest.mark.parametrize("make", [random_2d, random_3d])
def test_three_solvers_agree(rng, make):
    for _ in range(10):
        problem, bound = make(rng)
        newton = enumsol.solve_tresca(problem, bound, 0)
        clarabel = enumsol.solve_tresca(problem, bound, 0, solver="clarabel")
        reference = enumsol.solve_tresca(problem, bound, 0, solver="cvxpy")
        size = np.max(np.abs(newton.forces)) or 1.0
        assert newton.solver == "newton"
        assert newton.residual < 1e-10
        np.testing.assert_allclose(clarabel.forces, newton.forces, atol=1e-9 * size)
        np.testing.assert_allclose(reference.forces, newton.forces, atol=1e-5 * size)


@pytest.mark.parametrize("make", [random_2d, random_3d])
def test_the_reference_is_made_canonical_once(rng, make):
    problem, _ = make(rng)
    reference = enumsol.fixed_points.TrescaReference(problem)
    assert reference.program.is_dcp(dpp=True)  # or CVXPY would do it anew for every value of the parameters
    F = problem.friction_at(0).reshape(problem.p, -1)
    for bound in rng.uniform(0.1, 2.0, (3, problem.p)):
        normal, tangential, u = reference.solve(bound, F, problem.load_at(0))
        found = enumsol.solve_tresca(problem, bound, 0)
        np.testing.assert_allclose(normal, found.lambda_n, atol=1e-5)
        np.testing.assert_allclose(tangential, found.lambda_t.reshape(problem.p, -1), atol=1e-5)
        np.testing.assert_allclose(u, found.u, atol=1e-5)


def test_clarabel_alone_comes_close(rng):
    problem, bound = random_3d(rng)
    system = tresca.ContactSystem.at(problem, 0)
    data = tresca.TrescaData(system, bound / system.force, system.coefficients(np.zeros(problem.p)))
    rough, _ = clarabel_solver.interior_point(data)
    assert data.residual(rough) < 1e-6


def test_newton_that_fails_hands_over_to_clarabel(rng, monkeypatch):
    problem, bound = random_3d(rng)
    expected = enumsol.solve_tresca(problem, bound, 0)
    whole = tresca.TrescaData.newton

    def newton(data, start):
        return whole(data, start) if np.any(start) else (start, np.inf)

    monkeypatch.setattr(tresca.TrescaData, "newton", newton)
    found = enumsol.solve_tresca(problem, bound, 0)
    assert found.solver == "clarabel"
    np.testing.assert_allclose(found.forces, expected.forces, atol=1e-9)


def test_no_solver_is_an_error(rng, monkeypatch):
    problem, bound = random_3d(rng)
    monkeypatch.setattr(tresca.TrescaData, "newton", lambda data, start: (start, np.inf))
    monkeypatch.setattr(clarabel_solver, "interior_point", lambda data: (None, np.zeros(0)))
    with pytest.raises(enumsol.fixed_points.TrescaNotSolved, match="the Tresca problem at alpha = 0 was not solved"):
        enumsol.solve_tresca(problem, bound, 0)


def test_one_node_sticks_below_and_slides_above_its_bound():
    # S = I: lambda_n = 1; without a bound lambda_t = (3, 4), whose tau = (3 / 0.5, 4 / 2) has length sqrt(40)
    problem = from_compliance(np.eye(3), np.array([1.0, 3.0, 4.0]), (0.5, 2.0))
    stick = enumsol.solve_tresca(problem, 6.4, 0)
    np.testing.assert_allclose(stick.lambda_t, [[3.0, 4.0]])
    np.testing.assert_allclose(stick.u_t, 0.0, atol=1e-12)
    assert [str(s) for s in stick.statuses] == ["stick"]
    slide = enumsol.solve_tresca(problem, 2.0, 0)
    tau = slide.lambda_t[0] / (0.5, 2.0)
    v = slide.u_t[0] * (0.5, 2.0)
    np.testing.assert_allclose(np.linalg.norm(tau), 2.0)
    np.testing.assert_allclose(tau / 2.0, v / np.linalg.norm(v))
    np.testing.assert_allclose(slide.u_t[0], (3.0, 4.0) - slide.lambda_t[0])
    assert [str(s) for s in slide.statuses] == ["slip"]


def test_without_friction_it_is_a_nonnegative_least_squares_problem(rng):
    for _ in range(20):
        p = 4
        S, g = random_compliance(rng, p), rng.normal(size=3 * p)
        found = enumsol.solve_tresca(from_compliance(S, g, 0.0), 1.0, 0)
        L = np.linalg.cholesky(S[:p, :p])
        expected, _ = nnls(L.T, np.linalg.solve(L, g[:p]))
        np.testing.assert_allclose(found.lambda_n, expected, atol=1e-10)
        assert np.all(found.lambda_t == 0)


@pytest.mark.parametrize("scale", [1e-200, 1e-12, 1e12, 1e200])
def test_units_do_not_matter(rng, scale):
    S, g = random_compliance(rng, 3), rng.normal(size=9)
    one = enumsol.solve_tresca(from_compliance(S, g, (0.3, 0.6)), 0.4, 0)
    other = enumsol.solve_tresca(from_compliance(S, scale * g, (0.3, 0.6)), 0.4 * scale, 0)
    np.testing.assert_allclose(other.forces, scale * one.forces, rtol=1e-8)


def test_a_node_that_is_in_effect_two_dimensional(rng):
    S, g = random_compliance(rng, 2), rng.normal(size=6)
    F = (np.array([0.5, 0.3]), np.array([0.0, 0.4]))
    found = enumsol.solve_tresca(from_compliance(S, g, F), 1.0, 0)
    assert found.lambda_t[0, 1] == 0.0
    assert abs(found.lambda_t[0, 0]) <= 0.5 + 1e-12
    reference = enumsol.solve_tresca(from_compliance(S, g, F), 1.0, 0, solver="cvxpy")
    np.testing.assert_allclose(found.forces, reference.forces, atol=1e-6)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"slip_bound": -1.0}, "slip_bound is -1 at index 0; expected values >= 0"),
        ({"slip_bound": [1.0, 2.0, 3.0]}, r"slip_bound has shape \(3,\); expected \(p,\) = \(2,\) or a single number"),
        ({"slip_bound": np.nan}, "slip_bound"),
        ({"alpha": "x"}, "alpha is 'x'"),
        ({"solver": "gurobi"}, "solver is 'gurobi'; expected"),
        ({"slip": [[1.0]]}, "slip has shape"),
        ({"problem": 3}, "problem is a int; expected a ContactProblem or a ContactProblem3D"),
    ],
)
def test_bad_arguments(change, message):
    arguments = {"problem": from_compliance(np.eye(6), np.ones(6), 0.5), "slip_bound": 1.0, "alpha": 0} | change
    bad_argument(message, enumsol.solve_tresca, **arguments)
