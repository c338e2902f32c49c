import itertools

import numpy as np
import pytest
from effort import some
from refusals import bad_argument

import enumsol
from enumsol import ContactStatus, PiecewiseSmoothEquation, enumerate_roots, gallery, sign_array
from enumsol.model.statuses import STATUSES
from enumsol.roots.enumerate import selection_systems

OPEN, STICK, SLIP_PLUS, SLIP_MINUS = STATUSES
NAMES = {OPEN: (-1, -1, -1), STICK: (1, -1, 1), SLIP_PLUS: (1, 1, 1), SLIP_MINUS: (1, -1, -1)}


def random_equation(rng, n=8, p=3, *, r=None):
    X = rng.normal(size=(n, n))
    problem = enumsol.ContactProblem(
        X @ X.T + np.eye(n), rng.normal(size=(p, n)), rng.normal(size=(p, n)), rng.normal(size=n),
        gap=rng.normal(size=p), friction=rng.uniform(0, 2, size=p), friction_slope=rng.uniform(0, 2, size=p),
        load_slope=rng.normal(size=n), slip_offset=rng.normal(size=p),
    )  # fmt: skip
    return PiecewiseSmoothEquation(problem, float(np.exp(rng.normal())) if r is None else r)


def test_sign_arrays_name_the_statuses():
    for status, signs in NAMES.items():
        assert np.array_equal(sign_array([status]), [signs])
    both = sign_array([SLIP_MINUS, OPEN])
    assert both.shape == (2, 3)
    assert both.dtype == np.int8
    assert sign_array([]).shape == (0, 3)


@pytest.mark.slow
def test_the_selection_of_h_is_the_one_that_the_sign_array_names():
    rng = np.random.default_rng(0)
    seen = set()
    negative = 0
    for _ in range(some(14, of=40)):
        equation = random_equation(rng)
        n, p = equation.problem.n, equation.problem.p
        for _ in range(50):
            x = np.concatenate([rng.normal(size=n), rng.normal(size=2 * p) * np.exp(rng.normal())])
            alpha = rng.uniform(0, 3)
            signs = equation.signs(x, alpha)
            assert np.all(signs)
            H = equation.residual(x, alpha)
            selected = equation.selection_residual(signs, x, alpha)
            scale = np.max(np.abs(H)) + np.max(np.abs(x))
            assert np.max(np.abs(H - selected)) <= 1e-14 * scale
            seen.update(map(tuple, signs.tolist()))
            negative += int(np.sum(x[n : n + p] < 0))
    assert seen == set(itertools.product((-1, 1), repeat=3))  # all eight, the fourth piece of P included
    assert negative > some(590, of=1_700)


def test_other_sign_arrays_name_other_functions():
    # at a point with clear signs no other of the four statuses gives the same value
    equation = random_equation(np.random.default_rng(1), p=1)
    n = equation.problem.n
    rng = np.random.default_rng(2)
    for _ in range(200):
        x = rng.normal(size=n + 2)
        x[n] = abs(x[n])
        H = equation.residual(x, 1.0)
        right = [s for s in STATUSES if np.allclose(equation.selection_residual(sign_array([s]), x, 1.0), H)]
        closed, upper, lower = (equation.signs(x, 1.0) > 0)[0]
        if closed:
            assert right == [SLIP_PLUS if upper else STICK if lower else SLIP_MINUS]
        else:
            # theta1 < 0 selects lambda_n = 0; the tangential row is still that of its own signs
            assert STICK not in right
            assert len(right) <= 1


def test_h_is_continuous_and_vanishes_with_the_conditions():
    # the textbook conditions at a root: H = 0 for any r
    for name, alpha in (("one-node-6.1", 5.0), ("two-node-5", 5.0), ("wedge-8-5", 3.0)):
        problem = gallery.get(name).build()
        roots = enumerate_roots(problem, alpha)
        assert len(roots) > 1
        for root in roots:
            x = np.concatenate([root.u, root.lambda_n, root.lambda_t])
            size = np.max(np.abs(problem.f)) + np.max(np.abs(root.lambda_n))
            for r in (1e-3, 1.0, 50.0):
                equation = PiecewiseSmoothEquation(problem, r)
                limit = 1e-12 * (size + r * np.max(np.abs(root.u)))
                assert np.max(np.abs(equation.residual(x, alpha))) < limit
                assert np.max(np.abs(equation.selection_residual(sign_array(root.statuses), x, alpha))) < limit


@pytest.mark.parametrize("r", [0.05, 1.0, 20.0])
def test_points_that_are_no_roots_are_none_for_any_r(r):
    # lambda_n < 0, |lambda_t| > F lambda_n, penetration, friction that pushes: each alone spoils H
    problem = gallery.one_node_triangle()
    equation = PiecewiseSmoothEquation(problem, r)
    root = enumerate_roots(problem, 5.0)[2]
    x = np.concatenate([root.u, root.lambda_n, root.lambda_t])
    assert np.max(np.abs(equation.residual(x, 5.0))) < 1e-13
    for k in range(4):
        for step in (-0.3, 0.3):
            moved = x.copy()
            moved[k] += step
            assert np.max(np.abs(equation.residual(moved, 5.0))) > 1e-3


def test_jacobian_agrees_with_finite_differences():
    rng = np.random.default_rng(7)
    for _ in range(30):
        equation = random_equation(rng)
        p = equation.problem.p
        signs = rng.choice([-1, 1], size=(p, 3))
        x, alpha, h = rng.normal(size=equation.size), rng.uniform(0.5, 3), 1e-6
        J = equation.selection_jacobian(signs, x, alpha)
        assert J.shape == (equation.size, equation.size + 1)
        columns = []
        for e in np.eye(equation.size):
            ahead, behind = (equation.selection_residual(signs, x + t * e, alpha) for t in (h, -h))
            columns.append((ahead - behind) / (2 * h))
        ahead, behind = (equation.selection_residual(signs, x, alpha + t) for t in (h, -h))
        columns.append((ahead - behind) / (2 * h))
        dense = J.toarray()
        assert np.max(np.abs(dense - np.column_stack(columns))) < 1e-8 * np.max(np.abs(dense))


def test_jacobian_is_that_of_h_near_a_point_with_clear_signs():
    rng = np.random.default_rng(8)
    equation = random_equation(rng)
    for _ in range(20):
        x, alpha, h = rng.normal(size=equation.size), 1.5, 1e-7
        if np.min(np.abs(equation.test_functions(x, alpha))) < 1e-4:
            continue
        J = equation.selection_jacobian(equation.signs(x, alpha), x, alpha).toarray()
        direction = rng.normal(size=equation.size + 1)
        ahead = equation.residual(x + h * direction[:-1], alpha + h * direction[-1])
        behind = equation.residual(x - h * direction[:-1], alpha - h * direction[-1])
        assert np.allclose((ahead - behind) / (2 * h), J @ direction, rtol=1e-6, atol=1e-6)


def test_test_functions_and_split():
    problem = gallery.one_node_triangle()
    equation = PiecewiseSmoothEquation(problem, 2.0)
    assert equation.size == 4
    x = np.array([0.25, -0.5, 3.0, -1.0])
    # theta1 = lambda_n + r u_n, theta2,3 = lambda_t + r u_t -+ F lambda_n with F = 2
    assert np.array_equal(equation.test_functions(x, 2.0), [[3.5, -8.0, 4.0]])
    assert np.array_equal(equation.signs(x, 2.0), [[1, -1, 1]])
    u, lambda_n, lambda_t = equation.split(x)
    assert (u.tolist(), lambda_n.tolist(), lambda_t.tolist()) == ([0.25, -0.5], [3.0], [-1.0])


@pytest.mark.parametrize("r", [0.0, -1.0, np.nan, np.inf])
def test_r_must_be_positive(r):
    bad_argument(r"r is .*; expected a finite number > 0", PiecewiseSmoothEquation, gallery.one_node_triangle(), r)


def test_wrong_shapes_get_one_sentence():
    equation = PiecewiseSmoothEquation(gallery.one_node_triangle())
    bad_argument(r"x has shape \(3,\); expected \(n \+ 2p,\) = \(4,\)", equation.residual, np.zeros(3), 1.0)
    for signs in ([[1, 1]], [[1, 0, 1]], [1, 1, 1]):
        message = r"signs has .*; expected \(p, 3\) = \(1, 3\) with entries -1 or 1"
        bad_argument(message, equation.selection_residual, signs, np.zeros(4), 1.0)


def test_condensed_systems_hold_the_roots_of_their_selections():
    problem = gallery.two_node_square((1.0, -4.0), (1.5, -3.5))
    system = problem.condensed.at(5.0)
    codes = np.array(list(itertools.product(range(4), repeat=2)), dtype=np.int8)
    M, b = selection_systems(system.S, system.g, system.F, codes)
    assert M.shape == (16, 4, 4)
    roots = enumerate_roots(problem, 5.0)
    assert len(roots) == 5
    for root in roots:
        k = int(np.flatnonzero(np.all(codes == [STATUSES.index(s) for s in root.statuses], axis=1))[0])
        forces = np.concatenate([root.lambda_n, root.lambda_t])
        assert np.linalg.solve(M[k], b[k]) == pytest.approx(forces, rel=1e-12)
        # and the sign of the determinant is the index of a regular root (theory, section 6.7)
        assert np.sign(np.linalg.det(M[k])) == root.index


def test_statuses_print_as_their_values():
    assert [str(status) for status in STATUSES] == ["open", "stick", "slip+", "slip-"]
    assert repr(SLIP_PLUS) == "ContactStatus.SLIP_PLUS"
    assert ContactStatus("slip-") is SLIP_MINUS
