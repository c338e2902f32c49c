"""newton and follow in 3D, against enumerations, closed forms of one node and the conditions written out."""

import numpy as np
import oracles3d
import pytest
from alike import assert_close, assert_same
from complete import read_back
from effort import some
from problems3d import OneNode, forces, from_compliance, in_space, random_coupled
from refusals import bad_argument

import enumsol
from enumsol.continuation import SmoothPath, follow, newton, start_tangents
from enumsol.continuation.condensed_equation import SLIP, DiscEquation
from enumsol.continuation.newton import equation_on
from enumsol.model.statuses import OPEN, STICK


def random_path_problem(seed, p=None, load=True):
    """A problem with orthotropic friction whose load changes with alpha, or whose friction grows from nothing."""
    rng = np.random.default_rng([seed, 29])
    p = int(rng.integers(1, 4)) if p is None else p
    S, g, F = random_coupled(rng, p)
    A = np.linalg.inv(S)
    if load:
        return from_compliance(S, g, (F[:, 0], F[:, 1]), load_slope=A @ rng.normal(size=3 * p))
    return from_compliance(S, g, (0 * F[:, 0], 0 * F[:, 1]), friction_slope=(F[:, 0], F[:, 1]))


def violation(problem, point):
    """Of the conditions at one point, by the definitions alone."""
    S, g = problem.condensed.S, problem.condensed.free_displacements(point.alpha)
    return oracles3d.violation(S, g, problem.friction_at(point.alpha), forces(point))


def crossings(problem, path, alpha):
    """Roots at alpha where a path crosses it."""
    found = []
    for k in range(len(path) - 1):
        first, last = path.alpha[k], path.alpha[k + 1]
        if (first - alpha) * (last - alpha) <= 0 and first != last:
            share = (alpha - first) / (last - first)
            found.append(newton(problem, alpha, (1 - share) * forces(path[k]) + share * forces(path[k + 1])))
    return found


@pytest.mark.parametrize("seed", [1, 4, 5])
def test_newton_finds_enumerated_roots_with_their_indices_and_statuses(seed):
    problem = random_path_problem(seed)
    for root in enumsol.enumerate_roots(problem, 0.5, "fast"):
        start = root if seed % 2 else forces(root) * 1.001
        found = newton(problem, 0.5, start)
        assert_same(found, root, "statuses", "index")
        assert found.regular
        assert forces(found) == pytest.approx(forces(root), rel=1e-9, abs=1e-9)
        assert_close(found, root, "u_t", rtol=1e-8, atol=1e-9)
        assert violation(problem, found) < 1e-10


def test_a_just_sticking_node_has_two_statuses_and_no_index():
    problem = from_compliance(np.eye(3), np.array([1.0, 0.5, 0.0]), 0.5)
    root = newton(problem, 0)
    assert root.active == (frozenset({enumsol.ContactStatus.STICK, enumsol.ContactStatus.SLIP}),)
    assert (root.index, root.regular, root.margin) == (None, False, 0.0)


@pytest.mark.parametrize("r", [None, 0.3])
@pytest.mark.parametrize("seed", range(2))
def test_gradients_are_those_of_differences(seed, r):
    rng = np.random.default_rng(seed)
    problem = from_compliance(*random_coupled(rng, 2)[:2], (1.3, [0.7, 0.0]), friction_slope=(0.4, [-0.2, 0.0]))
    equation = equation_on(problem, None, 0.3, (-1, 1), r, 0.7)
    assert isinstance(equation, DiscEquation)
    x, step = rng.normal(size=7), 1e-6
    x[:2] = np.abs(x[:2])
    for codes in ((STICK, SLIP), (SLIP, STICK), (SLIP, SLIP), (OPEN, SLIP), (STICK, OPEN)):
        rows = equation.selection(codes)
        changes, slopes = [], []
        for unit in np.eye(7) * step:
            changes.append(equation.selection_residual(rows, x + unit) - equation.selection_residual(rows, x - unit))
            ahead, behind = equation.slacks(codes, x + unit), equation.slacks(codes, x - unit)
            slopes.append(np.where(np.isfinite(ahead), ahead, 0.0) - np.where(np.isfinite(behind), behind, 0.0))
        assert equation.jacobian(rows, x) == pytest.approx(np.array(changes).T / (2 * step), abs=1e-7)
        direction = rng.normal(size=7)
        rates = np.einsum("jik,j->ik", np.array(slopes) / (2 * step), direction)
        assert equation.slack_rates(codes, x, direction) == pytest.approx(rates, abs=1e-6)
        assert equation.slack_gradients(codes, x)[1, 0] @ direction == pytest.approx(rates[1, 0], abs=1e-6)


# -- one node: alpha is a function of the angle of slip ----------------------------------------------------------------


def folds_met(load, most):
    """Follow the slipping branch through folds of random nodes; how many were passed."""
    met = 0
    for seed in range(1000):
        node = OneNode(seed, load)
        for phi in node.folds():
            near, fold = [node.at(phi + turn) for turn in (-0.05, -0.02, 0.02, 0.05)], node.alpha(phi)
            if None in near or (not load and fold < 0.1):
                continue
            span = (fold - 1.0 if load else 0.05, fold + 1.0)
            if not all(span[0] < one[0] < span[1] for one in near):
                continue
            alpha, n, t = near[-1]
            paths = [follow(node.problem, (alpha, [n], [t]), sign, span) for sign in (1, -1)]
            inner = [item for path in paths for item in path.folds if not item.nodes]
            assert min(abs(item.alpha - fold) for item in inner) <= 1e-12 * max(1.0, abs(fold))
            assert not any(item.local_test.exists for item in inner)
            met += 1
            if met == most:
                return met
    return met


def test_a_fold_of_one_node_is_that_of_the_closed_form():
    assert folds_met(False, 1) == 1


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("load", [False, True])
def test_many_folds_of_one_node_are_those_of_the_closed_form(load):
    assert folds_met(load, some(3, of=6)) == some(3, of=6)


# -- paths -------------------------------------------------------------------------------------------------------------


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("seed", [4, pytest.param(1, marks=pytest.mark.slow), pytest.param(9, marks=pytest.mark.slow)])
@pytest.mark.parametrize("load", [False, True])
def test_paths_hold_solutions_and_lead_back(seed, load):
    problem = random_path_problem(seed, p=2, load=load)
    span, middle = ((-2.0, 2.0), 0.05) if load else ((0.1, 2.0), 1.05)
    for root in enumsol.enumerate_roots(problem, middle, "fast"):
        path = follow(problem, root, 1, span)
        assert path.status == "interval left"
        assert max(violation(problem, point) for point in path) < 1e-9
        back = follow(problem, path[-1], -1, span)
        found = crossings(problem, back, middle)
        assert any(np.allclose(forces(one), forces(root), rtol=1e-7, atol=1e-7) for one in found)


@pytest.mark.slow
def test_the_jammed_and_the_sliding_root_lie_on_one_branch_and_the_open_one_on_another():
    problem = enumsol.gallery.get("one-node-3d-3").build().replace(friction=0.0, friction_slope=1.0)
    jammed, sliding, free = enumsol.enumerate_roots(problem, 5)
    path = follow(problem, jammed, -jammed.index, (0.5, 6))
    assert (path.status, path.alpha[-1]) == ("interval left", 6)
    (fold,) = path.folds
    assert 0.5 < fold.alpha < 5
    assert any(np.allclose(forces(one), forces(sliding), atol=1e-9) for one in crossings(problem, path, 5.0))
    apart = follow(problem, free, -free.index, (0.5, 6))
    assert apart.alpha[-1] == 0.5
    assert not apart.transitions
    # as many as the enumeration has on both sides of the fold
    for alpha, count in ((fold.alpha - 1e-3, 1), (fold.alpha + 1e-3, 3)):
        assert len(enumsol.enumerate_roots(problem, alpha)) == count


@pytest.mark.parametrize("across", [1.0, 0.0])
@pytest.mark.parametrize("seed", range(2))
def test_a_problem_in_2d_with_a_second_tangent_that_nothing_loads_has_the_same_path(seed, across):
    rng, p = np.random.default_rng(seed), 2
    M = rng.normal(size=(2 * p, 2 * p))
    A, rows = np.linalg.inv(M @ M.T + 0.3 * np.eye(2 * p)), np.eye(2 * p)
    f, slope = A @ (3 * rng.normal(size=2 * p)), A @ rng.normal(size=2 * p)
    F = rng.uniform(0.3, 3, p)
    flat = enumsol.ContactProblem(0.5 * (A + A.T), rows[:p], rows[p:], f, friction=F, load_slope=slope)
    solid = in_space(flat).replace(friction=(F, across * F))
    for root in enumsol.enumerate_roots(flat, 0.1, "fast"):
        plane = follow(flat, root, 1, (-3, 3))
        start = (0.1, root.lambda_n, np.column_stack([root.lambda_t, np.zeros(p)]))
        space = follow(solid, start, 1, (-3, 3))
        turns, expected = ([item.alpha for item in path.transitions] for path in (space, plane))
        assert turns == pytest.approx(expected, abs=1e-8)
        assert len(space.folds) == len(plane.folds)
        assert space.alpha[-1] == pytest.approx(plane.alpha[-1])
        assert space.lambda_t[-1, :, 0] == pytest.approx(plane.lambda_t[-1], abs=1e-8)
        assert not np.any(space.lambda_t[..., 1])


@pytest.mark.few(0, 1)
@pytest.mark.parametrize(
    "form", [lambda F: [[F, F]], *(pytest.param(form, marks=pytest.mark.slow) for form in (float, lambda F: [F]))]
)
def test_a_smooth_path_that_is_affine_after_all_leads_where_the_affine_one_does(form):
    problem = enumsol.gallery.get("one-node-3d-3").build().replace(friction=0.0, friction_slope=1.0)
    jammed, *_ = enumsol.enumerate_roots(problem, 5, "fast")
    path = follow(problem, jammed, -1, (2, 5.5))
    # the same friction at the square of alpha
    smooth = SmoothPath(F=lambda alpha: form(alpha**2), dF=lambda alpha: form(2 * alpha))
    start = (5**0.5, jammed.lambda_n, jammed.lambda_t)
    squared = follow(problem, start, -1, (2**0.5, 5.5**0.5), smooth_path=smooth)
    assert squared.folds[0].alpha ** 2 == pytest.approx(path.folds[0].alpha, abs=1e-9)
    assert squared.lambda_t[-1] == pytest.approx(path.lambda_t[-1], abs=1e-8)
    frozen = smooth.problem_at(problem, 2.0)
    assert np.array_equal(frozen.friction_at(0), [[4.0, 4.0]])
    found = newton(problem, 2.0, smooth_path=smooth)
    assert violation(frozen, found) < 1e-9


def test_smooth_loads_in_3d():
    problem = random_path_problem(4, p=2)
    f, slope = problem.f, problem.load_slope
    smooth = SmoothPath(f=lambda alpha: f + np.sin(alpha) * slope, df=lambda alpha: np.cos(alpha) * slope)
    root = enumsol.enumerate_roots(problem, 0, "fast")[0]
    path, bent = follow(problem, root, 1, (-0.5, 0.5)), follow(problem, root, 1, (-0.52, 0.52), smooth_path=smooth)
    inside = [item.alpha for item in path.transitions if abs(item.alpha) < np.sin(0.5)]
    assert np.sin([item.alpha for item in bent.transitions])[: len(inside)] == pytest.approx(inside, abs=1e-9)


def test_files_tables_pictures_and_resumed_paths(tmp_path):
    problem = random_path_problem(1, p=2)
    root = enumsol.enumerate_roots(problem, 0.05, "fast")[0]
    path = follow(problem, root, 1, (-2, 2), enumsol.ContinuationOptions(max_steps=3))
    assert path.status == "step limit"
    longer = path.resume(options=enumsol.ContinuationOptions())
    assert longer.status == "interval left"
    assert longer.lambda_t.shape == (len(longer), 2, 2)
    assert_same(read_back(longer, tmp_path / "path.npz"), longer, "lambda_t", "selections")
    columns = set(longer.to_frame().columns)
    assert {"lambda_n_0", "lambda_t1_0", "lambda_t2_1", "u_t2_0", "status_1"} <= columns
    assert "lambda_t_0" not in columns
    figure = longer.plot(quantity="lambda_t", node=1)
    assert figure.axes[0].get_ylabel() == "|lambda_t| of node 1"
    assert len(start_tangents(problem, root)) == 2
    assert start_tangents(problem, root)[0].dlambda.shape == (2, 3)


def test_a_smooth_path_frozen_at_an_alpha_is_a_problem():
    problem = random_path_problem(1, p=2)
    smooth = SmoothPath(F=lambda alpha: [[alpha, 1.0], [2.0, alpha**2]], dF=lambda alpha: [[1, 0], [0, 2 * alpha]])
    frozen = smooth.problem_at(problem, 3)
    assert frozen.friction_at(7).tolist() == [[3.0, 1.0], [2.0, 9.0]]
    np.testing.assert_array_equal(frozen.load_at(7), problem.load_at(3))


def test_what_is_not_offered_in_3d_is_refused():
    problem = random_path_problem(1, p=1)
    graph = enumsol.branch_graph(enumsol.gallery.one_node_triangle(), (0, 1), "fast")
    path = follow(problem, newton(problem, 0.0), 1, (0, 1))
    bad_argument("path 0 is one in 3D; expected a path in 2D", enumsol.audit, path, graph)
    wrong = SmoothPath(F=lambda alpha: [[alpha, alpha, alpha]], dF=lambda alpha: 1.0)
    bad_argument(r"gives shape \(1, 3\) at alpha = 1; expected \(1, 2\)", newton, problem, 1, smooth_path=wrong)
    bad_argument(r"start has shape \(2,\); expected a Root .* \(3,\) or \(1, 3\)", newton, problem, 0, [1.0, 2.0])
    bad_argument(r"lambda_t of start has shape \(1,\); expected \(1, 2\)", follow, problem, (0.0, [0.0], [0.0]))
    weakening = enumsol.gallery.block3d(1, 1, 1, friction=enumsol.FrictionTable([0, 1], [0.5, 0.4]))
    nothing = (0, np.zeros(weakening.p), np.zeros((weakening.p, 2)))
    for call, start in ((newton, 0), (follow, nothing)):
        bad_argument("depends on the solution", call, weakening, start)
