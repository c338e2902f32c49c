"""Tresca problems: both fast solvers against CVXPY on the problem in u, closed forms, and bad arguments."""

import numpy as np
import pytest
from effort import some
from generators import dense_compliance, from_condensed
from problems3d import from_compliance, random_compliance
from refusals import bad_argument, refusal
from scipy.optimize import nnls

import enumsol
from enumsol import ContactProblem3D
from enumsol.fixed_points import tresca


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
        solvers = ("newton", "clarabel", "cvxpy")
        newton, clarabel, reference = (enumsol.solve_tresca(problem, bound, 0, solver=solver) for solver in solvers)
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
    rough, _ = tresca.interior_point(data)
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


@pytest.mark.parametrize("make", [random_2d, random_3d])
def test_the_proximal_point_method_converges_to_the_same_from_far_away(rng, make, monkeypatch):
    """Also where Newton's method fails with its first weights: these grow until it does not."""
    whole, weights = tresca.TrescaData.newton, []

    def newton(data, start):
        weights.append(data.system.compliance)
        return (start, np.inf) if 0 < data.system.compliance < 0.05 and len(weights) < 4 else whole(data, start)

    monkeypatch.setattr(tresca.TrescaData, "newton", newton)
    for _ in range(5):
        problem, bound = make(rng)
        system = tresca.ContactSystem.at(problem, 0)
        data = tresca.TrescaData(system, bound / system.force, system.coefficients(np.zeros(problem.p)))
        expected, _ = data.newton(np.zeros(system.m))
        weights.clear()
        found, residual = data.proximal(100.0 * rng.normal(size=system.m))
        assert residual <= tresca.ACCEPTED
        np.testing.assert_allclose(found, expected, atol=1e-9)
        assert weights[:4] == [0.001, 0.008, 0.064, 0.008]
        assert np.all(np.diff(weights[2:]) < 0)


def test_no_solver_is_an_error(rng, monkeypatch):
    problem, bound = random_3d(rng)
    monkeypatch.setattr(tresca.TrescaData, "newton", lambda data, start: (start, np.inf))
    monkeypatch.setattr(tresca, "interior_point", lambda data: (None, np.zeros(0)))
    message = "the Tresca problem at alpha = 0 was not solved"
    refusal(enumsol.fixed_points.TrescaNotSolved, message, enumsol.solve_tresca, problem, bound, 0)


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


# -- hard problems -----------------------------------------------------------------------------------------------------


def violation(S, g, bound, F, found):
    """The largest violation of (theory, section 11.2), forces relative to the load's and displacements to the free.

    Of every pair of conditions, one of which holds with equality, the better one counts.
    """
    p = len(bound)
    energy = np.sqrt(g @ np.linalg.solve(S, g))
    force = max(np.max(np.abs(found.forces)), np.max(energy / np.sqrt(np.diagonal(S))))
    length = np.max(np.abs(g))
    w = (g.astype(np.longdouble) - S.astype(np.longdouble) @ found.forces.astype(np.longdouble)).astype(float)
    w_n, w_t = w[:p], w[p:].reshape(2, p).T
    worst = max(np.max(w_n) / length, -np.min(found.lambda_n) / force, 0.0)
    worst = max(worst, np.max(np.minimum(np.abs(found.lambda_n) / force, np.abs(w_n) / length)))
    for i in range(p):
        axes = F[i] > 0
        assert not np.any(found.lambda_t[i][~axes])
        if bound[i] == 0 or not np.any(axes):
            assert not np.any(found.lambda_t[i])
            continue
        f, v = F[i][axes], (F[i] * w_t[i])[axes]
        tau, size = found.lambda_t[i][axes] / f, np.linalg.norm(v)
        worst = max(worst, (np.linalg.norm(tau) - bound[i]) * np.max(f) / force)
        slides = np.max(f * np.abs(tau - bound[i] * v / max(size, 1e-300))) / force
        worst = max(worst, min(size / (length * np.max(f)), slides))
    return worst


def solved(problem, bound, F, **options):
    """A Tresca problem that is solved as its conditions say."""
    found = enumsol.solve_tresca(problem, bound, 0, **options)
    S, g = problem.condensed.S, problem.condensed.free_displacements(0)
    assert violation(S, g, bound, F, found) < 1e-3


def hard(rng, coefficients):
    """A problem with S of condition up to 1e9, coefficients of several sizes, and bounds from 0 to 1e12 loads."""
    p = int(rng.choice([1, 2, 3, 5, 8, 15]))
    Q, _ = np.linalg.qr(rng.standard_normal((3 * p, 3 * p)))
    spread = 10.0 ** rng.choice([0, 3, 6, 9])
    values = np.geomspace(1, spread, 3 * p) if rng.random() < 0.5 else np.where(rng.random(3 * p) < 0.5, 1, spread)
    A = (Q * values) @ Q.T
    A = 0.5 * (A + A.T)
    rows, f = np.eye(3 * p), rng.standard_normal(3 * p)
    grazing = np.linalg.solve(A, f)[:p] * (rng.random(p) < 0.7) * (rng.random() < 0.5)
    F = rng.choice(coefficients, size=(p, 2)).astype(float)
    problem = ContactProblem3D(A, rows[:p], rows[p : 2 * p], rows[2 * p :], f, grazing, (F[:, 0], F[:, 1]))
    S, g = problem.condensed.S, problem.condensed.free_displacements(0)
    size = np.sqrt(g @ np.linalg.solve(S, g)) / np.sqrt(np.diagonal(S)[:p])
    return problem, size * rng.choice([0, 1e-300, 1e-12, 1e-3, 1, 1, 1e3, 1e12], size=p), F


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("solver", ["newton", "clarabel"])
def test_hard_problems_are_solved(rng, solver):
    for _ in range(some(50, of=150)):
        problem, bound, F = hard(rng, [0, 1e-3, 0.1, 0.5, 0.5, 1, 3, 30])
        solved(problem, bound, F, solver=solver)


@pytest.mark.long
def test_extreme_coefficients_are_solved_or_refused(rng):
    unsolved = 0
    for _ in range(60):
        problem, bound, F = hard(rng, [0, 1e-6, 0.5, 1e6])
        try:
            solved(problem, bound, F)
        except enumsol.fixed_points.TrescaNotSolved:
            unsolved += 1
    assert unsolved <= 3


def test_no_load_gives_no_forces_wherever_the_start_is(rng):
    problem, bound, _ = hard(rng, [0.5])
    rows = [problem.Bn, problem.Bt1, problem.Bt2]
    unloaded = ContactProblem3D(problem.A, *rows, np.zeros(problem.n), friction=0.5)
    near = enumsol.solve_tresca(ContactProblem3D(problem.A, *rows, 1e-17 * problem.f, friction=0.5), bound, 0)
    assert np.any(near.forces)
    assert not np.any(enumsol.solve_tresca(unloaded, bound, 0, start=near).forces)
    assert not np.any(enumsol.solve_tresca(unloaded, bound, 0, solver="clarabel").forces)
