"""newton and follow for bodies that nothing holds, in 2D and 3D: enumerations, weak springs, the conditions as such."""

import numpy as np
import pytest
from alike import assert_close, assert_same
from complete import all_roots, read_back
from effort import some
from helpers.floating_bodies import held_by_springs, pushed_block, violation
from helpers.floating_oracle import block_on_table, random_body
from helpers.floating_space import known_body
from refusals import bad_argument, refusal

import enumsol
from enumsol.continuation import SmoothPath, follow, newton
from enumsol.continuation.condensed_equation import SLIP
from enumsol.continuation.newton import equation_on
from enumsol.model.statuses import OPEN, SLIP_MINUS, SLIP_PLUS, STICK


def solves(problem, path, within):
    """Whether all points of a path solve the problem, from A, B and f as they are."""
    for point in path:
        forces = np.concatenate([point.lambda_n, point.lambda_t.ravel(order="F")])
        u = problem.on_springs.condensed.displacement(point.alpha, forces)
        u += problem.rigid_modes @ point.rigid_coordinates
        if violation(problem, point.alpha, u, point.lambda_n, point.lambda_t) >= within:
            return False
    return True


def test_a_block_is_pushed_until_it_slides_to_the_bound():
    problem = pushed_block(max_rigid_displacement=3.0)
    path = follow(problem, newton(problem, 0), interval=(0, 2))
    assert path.status == "rigid bound"
    assert "along rigid mode 0" in path.message
    assert path[-1].alpha == pytest.approx(1.0, abs=1e-12)
    assert path[-1].rigid_coordinates == pytest.approx([3.0, 0.0, 0.0], abs=1e-12)
    assert all(status.value == "slip+" for status in path[-1].statuses)
    assert solves(problem, path, 1e-9)
    for alpha in (0.5, 0.9):
        (root,) = enumsol.enumerate_roots(problem, alpha)
        k = int(np.argmin(np.abs(path.alpha - alpha)))
        found = newton(problem, alpha, np.r_[path[k].lambda_n, path[k].lambda_t])
        assert_same(found, root, "statuses", "index")
        assert_close(found, root, "u", "rigid_displacement", atol=1e-12)


def test_how_far_a_block_may_slide_costs_no_steps():
    near, far = (pushed_block(1, max_rigid_displacement=most) for most in (3.0, 3e6))
    paths = [follow(problem, newton(problem, 0), interval=(0, 2)) for problem in (near, far)]
    assert len(paths[0]) == len(paths[1])
    assert paths[1][-1].rigid_coordinates[0] == pytest.approx(3e6)


def test_a_block_slides_until_it_meets_a_wall():
    # two nodes in a row, the first on the ground, the second 5 before a wall without friction
    A, N = 16.0 * np.array([[1, 0, -1, 0], [0, 1, 0, -1], [-1, 0, 1, 0], [0, -1, 0, 1]]), np.tile(np.eye(2), (2, 1))
    problem = enumsol.ContactProblem(
        *(A, [[0, -1, 0, 0], [0, 0, 1, 0]], [[1, 0, 0, 0], [0, 0, 0, 1]], [0, -1, 0, 0]), gap=[0, 5],
        friction=np.array([0.25, 0.0]), load_slope=[0.25, 0, 0, 0], rigid_modes=N, max_rigid_displacement=50.0,
    )  # fmt: skip
    path = follow(problem, newton(problem, 0.2), interval=(0, 2))
    assert path.status == "interval left"
    assert solves(problem, path, 1e-9)
    places = [(item.alpha, path[item.point].u_t[0]) for item in path.transitions]
    assert np.allclose(places, [(1.0, 0.0), (1.0, 5.0)], atol=1e-9)
    assert path[-1].lambda_n == pytest.approx([1.0, 0.25])


def test_a_path_does_not_depend_on_the_basis_of_the_modes():
    problem = pushed_block()
    N = problem.rigid_modes @ np.array([[1, 2, 0], [0, 1, -1], [1, 0, 4]])
    bodies = problem, problem.replace(rigid_modes=N)
    one, two = (follow(body, enumsol.enumerate_roots(body, 0)[0], interval=(0, 0.95)) for body in bodies)
    assert_close(one, two, "arclength", "lambda_t", atol=1e-9)


def test_paths_on_weak_springs_tend_to_it():
    bodies = pushed_block(), held_by_springs(pushed_block(), 1e-5)
    free, weak = (follow(body, newton(body, 0), interval=(0, 0.98)) for body in bodies)
    assert [item.after for item in free.transitions] == [item.after for item in weak.transitions]
    for one, two in zip(free.transitions, weak.transitions, strict=True):
        assert one.alpha == pytest.approx(two.alpha, abs=1e-4)
        assert one.local_test.signs == two.local_test.signs


def paths_of(seed):
    """Paths from all roots of a random body, both ways, all of whose points are checked."""
    problem, paths = random_body(seed), []
    problem = problem.replace(load_slope=np.random.default_rng(seed).integers(-1, 2, problem.n).astype(float))
    for root in enumsol.enumerate_roots(problem, 0.5):
        found = newton(problem, 0.5, root)
        assert found.statuses == root.statuses or not root.regular
        assert found.index == root.index or not root.regular
        assert np.allclose(found.u, root.u, atol=1e-9)
        for direction in (1, -1):
            path = follow(problem, root, direction, interval=(0, 1))
            assert path.status in ("interval left", "rigid bound")
            assert solves(problem, path, 1e-7)
            reach = problem.modes.reach(problem.rigid_reach) * (1 + 1e-9)
            assert np.all(np.abs(path.rigid_coordinates) <= reach)
            if path.status == "interval left":
                ends = enumsol.enumerate_roots(problem, float(round(path.alpha[-1])))
                assert ends.families or any(np.allclose(end.lambda_n, path.lambda_n[-1], atol=1e-6) for end in ends)
            paths.append(path)
    return paths


@pytest.mark.slow
def test_paths_of_random_bodies_run_between_enumerated_roots():
    paths = [path for seed in range(14, some(22, of=120)) for path in paths_of(seed)]
    assert len(paths) > some(2, of=35)


def path_in_3d(seed):
    """A problem in 3D and a path from its known solution, all of whose points are checked."""
    body = known_body(seed, p=2)
    problem = body.problem.replace(load_slope=np.random.default_rng(seed).normal(size=body.problem.n))
    held = problem.modes.held
    q = np.linalg.solve(problem.rigid_modes[held], body.u[held])
    root = newton(problem, 0, np.concatenate([body.lambda_n, *body.lambda_t.T, q]))
    assert np.allclose(root.u, body.u, atol=1e-9)
    path = follow(problem, root, interval=(-0.3, 0.3))
    assert path.status in ("interval left", "rigid bound")
    assert solves(problem, path, 1e-6)
    return problem, path


@pytest.mark.few(0, 2)
@pytest.mark.parametrize("seed", range(3))
def test_newton_and_follow_in_3d(seed):
    path_in_3d(seed)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 2, 5])
def test_paths_in_3d_end_at_enumerated_roots(seed):
    problem, path = path_in_3d(seed)
    roots = all_roots(problem, path.alpha[-1])
    assert any(np.allclose(root.lambda_n, path.lambda_n[-1], atol=1e-7) for root in roots)


@pytest.mark.parametrize(
    ("problem", "selections"),
    [
        (pushed_block(), [(STICK, SLIP_PLUS, OPEN), (SLIP_MINUS, STICK, STICK), (SLIP_PLUS,) * 3]),
        (known_body(3, p=3, r=2).problem, [(STICK, SLIP, OPEN), (SLIP, STICK, STICK), (SLIP,) * 3]),
    ],
)
def test_gradients_are_those_of_differences(problem, selections):
    problem = problem.replace(load_slope=np.random.default_rng(1).normal(size=problem.n))
    equation, rng = equation_on(problem, None, 0.3, (-1, 1), None, 0.7), np.random.default_rng(2)
    x = rng.normal(size=equation.m + equation.modes + 1)
    x[: equation.p] = np.abs(x[: equation.p])
    step, axes = 1e-6, np.eye(len(x))
    for codes in selections:
        rows = equation.selection(codes)
        J = equation.jacobian(rows, x)
        for k, axis in enumerate(axes):
            more, less = (equation.selection_residual(rows, x + side * axis) for side in (step, -step))
            assert J[:, k] == pytest.approx((more - less) / (2 * step), abs=1e-7)
            ahead, behind = (equation.slacks(codes, x + side * axis) for side in (step, -step))
            rates, both = equation.slack_rates(codes, x, axis), np.isfinite(ahead)
            assert rates[both] == pytest.approx((ahead[both] - behind[both]) / (2 * step), abs=1e-7)
            for which in np.argwhere(both):
                gradient = equation.slack_gradients(codes, x)[tuple(which)]
                assert gradient[k] == pytest.approx(rates[tuple(which)], abs=1e-12)


def test_a_smooth_path_and_the_affine_one_are_the_same():
    problem = pushed_block(1)
    smooth = SmoothPath(f=problem.load_at, df=lambda alpha: problem.load_slope)
    fixed = problem.replace(load_slope=None)
    one = follow(problem, newton(problem, 0.5), interval=(0.2, 0.9))
    two = follow(fixed, newton(fixed, 0.5, smooth_path=smooth), interval=(0.2, 0.9), smooth_path=smooth)
    assert [item.alpha for item in one.transitions] == pytest.approx([item.alpha for item in two.transitions])
    assert one.lambda_t[-1] == pytest.approx(two.lambda_t[-1])


def test_files_frames_and_a_larger_bound(tmp_path):
    problem = pushed_block(1, max_rigid_displacement=1.0)
    path = follow(problem, newton(problem, 0), interval=(0, 2))
    loaded = read_back(path, tmp_path / "path.npz")
    assert_same(loaded, path, "rigid_coordinates")
    assert path.to_frame()["rigid_0"].iloc[-1] == pytest.approx(1.0)
    further = loaded.resume(problem.replace(max_rigid_displacement=2.0))
    assert further.status == "rigid bound"
    assert further.rigid_coordinates[-1, 0] == pytest.approx(2.0)
    assert len(further) == len(path) + 1
    again = follow(problem, path[3], interval=(0, 2), visited=[path])
    assert again.status == "visited"


def test_a_body_that_contact_cannot_hold_is_refused():
    # one node touches: turning about it moves no contact node
    problem = block_on_table(1)
    data = {"gap": 0, "slip_offset": 0, "friction": 0.25, "friction_slope": 0, "node_ids": None}
    one = problem.replace(Bn=problem.Bn[:1], Bt=problem.Bt[:1], **data)
    refusal(enumsol.NotHeldError, "moves no contact node", newton, one, 0)


def test_starts_have_rigid_coordinates():
    problem = pushed_block(max_rigid_displacement=1.0)
    root = newton(problem, 0)
    values = (0, root.lambda_n, root.lambda_t)
    assert len(follow(problem, (*values, root.rigid_coordinates), interval=(0, 0.1)))
    bad_argument(r"tuple of 3; expected .*rigid_coordinates", follow, problem, values)
    bad_argument("coordinate of rigid mode 0; expected at most 1", follow, problem, (*values, [2.0, 0.0, 0.0]))
