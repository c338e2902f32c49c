"""Fixed points of bodies that nothing holds: against enumeration in rationals, and the conditions as they are."""

from dataclasses import dataclass

import numpy as np
import pytest
from alike import assert_close, assert_same
from complete import limit_of, read_back
from helpers.floating_bodies import violation
from helpers.floating_oracle import Oracle, block_on_table, random_body
from helpers.floating_space import known_body, on_weak_springs
from refusals import bad_argument, refusal
from scipy.optimize import linprog

import enumsol
from enumsol.fixed_points import FixedPoint, Outcome, TrescaNotFeasible, fixed_point_residual

ALPHAS = (0, 0.25, 0.5)


def checked(problem, alpha, found):
    """A limit that satisfies the conditions, and still does where the body is said to move on."""
    data = found.lambda_n, found.lambda_t, found.coefficients
    size = 1 + np.max(np.abs(found.u)) + np.max(np.abs(found.forces))
    assert violation(problem, alpha, found.u, *data) < 1e-8 * size**2
    if found.free_motion is not None:
        moved = found.u + 1e-5 * problem.rigid_modes @ found.free_motion
        assert violation(problem, alpha, moved, *data) < 1e-8 * size**2


@dataclass
class Known:
    """A solution known otherwise."""

    alpha: float
    lambda_n: np.ndarray
    lambda_t: np.ndarray
    u_t: np.ndarray


def kept_of(seed):
    """What became of a random body in the plane, beside all its solutions in rationals."""
    problem, alpha = random_body(seed), ALPHAS[seed % 3]
    oracle = Oracle(problem, alpha)
    try:
        found = enumsol.successive_approximations(problem, alpha, max_iterations=200)
    except enumsol.NotHeldError:  # a rigid displacement moves no contact node
        return None
    forces, u = oracle.forces
    for row, moved in zip(forces, u, strict=True):
        slip = problem.Bt @ moved - problem.slip_offset
        root = Known(alpha, row[: problem.p], row[problem.p :], slip)
        assert fixed_point_residual(problem, root) < 1e-9
    if found.converged:
        checked(problem, alpha, found)
        if not oracle.families and not found.beyond_bound:
            assert found.free_motion is None
            here = np.concatenate([found.lambda_n, found.lambda_t, found.u])
            away = np.max(np.abs(np.hstack([forces, u]) - here), axis=1)
            assert np.min(away) < 1e-6 * (1 + np.max(np.abs(here)))
    elif found.outcome is Outcome.NOT_HELD:
        assert not len(forces)
        assert not oracle.families
        assert found.why.startswith("there is no solution")
    else:
        assert found.outcome in (Outcome.NOT_FEASIBLE, Outcome.CYCLE, Outcome.ITERATION_LIMIT)
    return found.outcome


@pytest.mark.few(0, 8)
@pytest.mark.parametrize("seed", range(40_000, 40_300))
def test_limits_are_among_all_solutions_in_rationals(seed):
    kept_of(seed)


@pytest.mark.slow
def test_every_outcome_is_among_them():
    found = {kept_of(seed) for seed in (91, 116, 125, 196, 274)}
    assert {Outcome.CONVERGED, Outcome.NOT_HELD, Outcome.NOT_FEASIBLE} <= found


@pytest.mark.few(3, 10)
@pytest.mark.parametrize("seed", range(300))
def test_a_known_solution_in_space_is_a_fixed_point(seed):
    known = known_body(seed)
    problem, p = known.problem, known.problem.p
    slip = (problem.contact_rows @ known.u)[p:].reshape(2, p).T - problem.slip_offset
    assert fixed_point_residual(problem, Known(0, known.lambda_n, known.lambda_t, slip)) < 1e-9
    found = enumsol.successive_approximations(problem, 0, max_iterations=300)
    if found.converged:
        checked(problem, 0, found)
    else:
        assert found.outcome in (Outcome.NOT_FEASIBLE, Outcome.CYCLE, Outcome.ITERATION_LIMIT)


def is_feasible(problem, alpha, bound):
    """Whether some forces within slip bounds hold a body in the plane, by a linear program in other unknowns."""
    F, N = problem.friction_at(alpha), problem.rigid_modes
    resultants = (problem.contact_rows @ N).T
    limits = [(0, None)] * problem.p + [(-s, s) for s in F * bound]
    return linprog(np.zeros(2 * problem.p), A_eq=resultants, b_eq=N.T @ problem.load_at(alpha), bounds=limits).success


@pytest.mark.few(2, 12)
@pytest.mark.parametrize("seed", range(300))
def test_bounds_within_which_nothing_holds_the_body_are_told_apart(seed):
    rng = np.random.default_rng(seed)
    problem = random_body(seed + 1000)
    bound = 10.0 ** rng.uniform(-2, 1) * rng.uniform(0, 1, problem.p)
    try:
        found = enumsol.solve_tresca(problem, bound, 0)
    except TrescaNotFeasible as error:
        assert not is_feasible(problem, 0, bound)
        moved = problem.rigid_modes @ error.motion
        rows = problem.contact_rows @ moved
        assert np.max(np.abs(moved)) == pytest.approx(1.0)
        # the load does more work along it than all forces that are allowed
        assert np.max(rows[: problem.p]) < 1e-6
        assert problem.f @ moved > (bound * problem.friction_at(0)) @ np.abs(rows[problem.p :])
    except enumsol.NotHeldError:
        return
    else:
        assert is_feasible(problem, 0, bound)
        size = 1 + np.max(np.abs(found.u)) + np.max(np.abs(found.forces))
        data = found.lambda_n, found.lambda_t, found.coefficients
        assert violation(problem, 0, found.u, *data, bound=bound) < 1e-8 * size**2


@pytest.mark.parametrize("push", [0.0, 0.5, 0.99])
def test_a_block_on_a_table(push):
    problem = block_on_table(push=push)
    (root,) = enumsol.enumerate_roots(problem, 0)
    found = limit_of(problem, 0)
    assert found.free_motion is None
    assert_close(found, root, "u", "lambda_t", rtol=1e-7, atol=1e-9)
    assert all(enumsol.is_fixed_point(problem, state) for state in (root, found))


def test_a_block_that_slides_or_is_lifted():
    slides = limit_of(block_on_table(push=1.0), 0)
    assert slides.free_motion == pytest.approx([1.0, 0.0, 0.0], abs=1e-6)
    assert "the body may move on along rigid mode 0 with the same forces" in slides.why

    gone = enumsol.successive_approximations(block_on_table(push=1.1), 0)
    assert (gone.outcome, gone.converged) == (Outcome.NOT_FEASIBLE, False)
    assert gone.free_motion == pytest.approx([1.0, 0.0, 0.0], abs=1e-6)
    # 3 nodes with 1 each, pushed at all of them by 1.1 times what friction can hold
    told = "rigid mode 0 the load drives it with 0.825, and friction within these bounds resists with at most 0.75"
    assert told in " ".join(gone.why.split())
    problem = block_on_table()
    lifted = enumsol.successive_approximations(problem.replace(f=-problem.f), 0)
    assert lifted.outcome is Outcome.NOT_HELD
    assert "however large friction is, along rigid mode 1" in lifted.why
    assert not np.any(lifted.lambda_n)

    # whether friction that grows with the slip could hold it is another matter
    table = enumsol.FrictionTable([0.0, 1.0], [0.0, 0.5], [0.0, 0.5])
    smooth = enumsol.gallery.block_on_table3d(1).replace(friction=table)
    found = enumsol.successive_approximations(smooth, 0)
    assert found.outcome is Outcome.NOT_HELD
    assert "with the coefficients of friction at zero slip" in found.why


def test_a_limit_beyond_the_bound_is_told():
    problem = random_body(60_135)
    found = limit_of(problem, 0.25)
    assert found.beyond_bound
    assert "beyond the bound 8 of rigid displacements" in found.why
    checked(problem, 0.25, found)
    assert len(enumsol.enumerate_roots(problem, 0.25)) == 0
    wider = problem.replace(max_rigid_displacement=16.0)
    (root,) = enumsol.enumerate_roots(wider, 0.25)
    np.testing.assert_allclose(root.u, found.u, atol=1e-7)
    assert not enumsol.successive_approximations(wider, 0.25).beyond_bound


def test_without_friction_it_may_move_on():
    found = limit_of(block_on_table(friction=0.0), 0)
    assert np.abs(found.free_motion) == pytest.approx([1.0, 0.0, 0.0], abs=1e-6)


@pytest.mark.parametrize("make", [lambda: block_on_table(push=0.5), lambda: known_body(1).problem])
def test_three_solvers_agree(make):
    problem = make()
    bound = np.full(problem.p, 2.0)
    one, two, three = (
        enumsol.solve_tresca(problem, bound, 0, solver=solver) for solver in ("newton", "clarabel", "cvxpy")
    )
    for other in (two, three):
        assert_close(other, one, "forces", "u", "rigid_coordinates", rtol=1e-7, atol=1e-6)


def test_the_reference_finds_nothing_where_there_is_nothing():
    call = (enumsol.solve_tresca, block_on_table(push=0.5), 0.0, 0)
    refusal(enumsol.fixed_points.TrescaNotSolved, "CVXPY found no solution", *call, solver="cvxpy")


def test_the_basis_of_the_modes_and_units_do_not_matter():
    problem = block_on_table(push=0.5)
    N = problem.rigid_modes @ np.array([[1, 2, 0], [0, 1, -1], [1, 0, 4]])
    bodies = problem, problem.replace(rigid_modes=N), problem.replace(f=1e-9 * problem.f)
    one, two, three = (enumsol.successive_approximations(body, 0) for body in bodies)
    np.testing.assert_allclose(two.u, one.u, atol=1e-10)
    np.testing.assert_allclose(1e9 * three.u, one.u, atol=1e-10)


def test_weak_springs_tend_to_it():
    problem = known_body(5).problem
    free = enumsol.successive_approximations(problem, 0)
    held = [enumsol.successive_approximations(on_weak_springs(problem, k), 0, free) for k in (1e-3, 1e-5)]
    far = [np.max(np.abs(weak.u - free.u)) for weak in held]
    assert far[0] < 0.1
    assert far[1] < 0.02 * far[0]


def test_friction_that_depends_on_the_slip():
    problem = known_body(5).problem.replace(friction=lambda node, slip: (0.3 + 0.1 * np.exp(-slip), 0.4))
    found = limit_of(problem, 0)
    checked(problem, 0, found)
    expected = problem.coefficients(0, np.linalg.norm(found.u_t, axis=1))
    np.testing.assert_allclose(found.coefficients, expected, atol=1e-9)


@pytest.mark.parametrize("push", [0.5, 1.0, 1.1])
def test_saved_and_loaded(tmp_path, push):
    problem = block_on_table(push=push)
    found = enumsol.successive_approximations(problem, 0)
    again = read_back(found, tmp_path / "found.npz", problem)
    assert repr(again) == repr(found)
    assert_same(again, found, "u")
    held = enumsol.ContactProblem(np.eye(12), problem.Bn, problem.Bt, problem.f)
    assert FixedPoint.load(tmp_path / "found.npz", held).rigid_coordinates is None
    wrong = Known(found.alpha, found.lambda_n, found.lambda_t, found.u_t)
    wrong.rigid_coordinates = np.zeros(2)
    bad_argument("rigid_coordinates of shape", enumsol.successive_approximations, problem, 0, wrong)


def test_a_computed_force_that_is_zero_but_for_rounding_holds_nothing():
    """All load is on one of two nodes, about which the body may turn; the other one just touches."""
    A = [[24, 16, -8, -12, -16, -4], [16, 19, -12, -18, -4, -1], [-8, -12, 16, 4, -8, 8]]
    A += [[-12, -18, 4, 26, 8, -8], [-16, -4, -8, 8, 24, -4], [-4, -1, 8, -8, -4, 9]]
    N, e = np.array([[1, 0, 2], [0, 1, -2], [1, 0, -1], [0, 1, 0], [1, 0, 1], [0, 1, 2.0]]), np.eye(6)
    data = {"friction": 0.75, "rigid_modes": N, "max_rigid_displacement": 1000.0}
    problem = enumsol.ContactProblem(A, [-e[1], -e[3]], [e[0], e[2]], [0, -2, 0, 0, 0, 0], **data)
    assert Oracle(problem).families == 1
    found = limit_of(problem, 0)
    checked(problem, 0, found)
    # along a motion that leaves the pressed node where it is
    moved = N @ found.free_motion
    assert np.max(np.abs(moved[:2])) < 1e-9 < np.max(np.abs(moved))
    assert "may move on" in repr(found)
