"""The balls of S, g and F hold the exact rational values, and are narrow."""

from fractions import Fraction

import numpy as np
import pytest
import scipy.sparse as sp
from exact_balls import holds
from generators import dense_compliance, fe_compliance, from_condensed
from oracles import exact_condense
from problems3d import from_compliance

from enumsol import ContactProblem, gallery
from enumsol.arithmetic import balls
from enumsol.condensation.enclosure import CondensedEnclosure, NotEnclosedError, product
from enumsol.condensation.space_condensed import AlphaSpace


def units(problem, force=3, length=-2):
    """Binary units as a proof may choose them: one pair for both directions of every node."""
    exponent = np.arange(problem.p) % 5
    return np.ldexp(1.0, np.tile(force + exponent, 2)), np.ldexp(1.0, np.tile(length - exponent, 2))


def misses(problem, alpha):
    """Which of the exact S, g and F have entries outside their balls."""
    system = problem.enclosure.at(alpha, *units(problem))
    S, g, F = exact_condense(problem, alpha)
    force, length = ([Fraction(x) for x in array.tolist()] for array in units(problem))
    exact = {
        "S": [[x * by / unit for x, by in zip(row, force, strict=True)] for row, unit in zip(S, length, strict=True)],
        "g": [x / unit for x, unit in zip(g, length, strict=True)],
        "F": F,
    }
    return [name for name in exact if not holds(*(getattr(system, name + end) for end in ("", "_rad")), exact[name])]


def dense_problem(rng, n, p, decades):
    """A full A of condition 10^decades, general rows, a load slope, gaps and slip offsets."""
    Q, _ = np.linalg.qr(rng.normal(size=(n, n)))
    A = (Q * 10 ** rng.uniform(-decades / 2, decades / 2, size=n)) @ Q.T
    rows = rng.normal(size=(2 * p, n))
    size = 10 ** rng.uniform(-3, 3, size=4)
    return ContactProblem(
        0.5 * (A + A.T), rows[:p], rows[p:], size[0] * rng.normal(size=n), gap=size[1] * rng.normal(size=p),
        friction=rng.uniform(0, 2, size=p), friction_slope=rng.uniform(0, 1, size=p),
        load_slope=size[2] * rng.normal(size=n),
        slip_offset=size[3] * rng.normal(size=p),
    )  # fmt: skip


@pytest.mark.parametrize("decades", [1, 6, 9])
def test_random_problems(decades):
    rng = np.random.default_rng(decades)
    for _ in range(12):
        problem = dense_problem(rng, int(rng.integers(4, 9)), int(rng.integers(1, 3)), decades)
        for alpha in (0.0, 0.1, Fraction(1, 3), Fraction(10**30, 7), Fraction(1, 10**400)):
            assert not misses(problem, alpha)


def test_badly_scaled_stiffness():
    rng = np.random.default_rng(5)
    for _ in range(10):
        X = rng.normal(size=(6, 7))
        scale = 10 ** rng.uniform(-20, 20, size=6)
        A = X @ X.T * np.outer(scale, scale)
        rows = np.eye(6)[rng.permutation(6)[:4]]
        problem = ContactProblem(0.5 * (A + A.T), rows[:2], rows[2:], scale * rng.normal(size=6), gap=1e-3)
        assert not misses(problem, Fraction(7, 3))


@pytest.mark.parametrize("make", [dense_compliance, fe_compliance])
def test_condensed_data(make):
    rng = np.random.default_rng(11)
    for _ in range(8):
        p = int(rng.integers(1, 4))
        assert not misses(from_condensed(make(rng, p), rng.normal(size=2 * p), rng.uniform(0, 3, size=p)), 0.7)


def test_sparse_body():
    problem = gallery.clamped_block(3, 2, gap=1e-5, friction=0.25, friction_slope=0.5)
    assert not misses(problem, Fraction(22, 7))


@pytest.mark.parametrize("name", ["clamped-block-16", "clamped-block-32", "wedge-14-3", "wedge-20-5"])
def test_balls_of_bodies_are_a_few_ulps_wide(name):
    balls = gallery.get(name).build().enclosure
    ulp = np.spacing(np.sqrt(np.outer(np.diagonal(balls.S), np.diagonal(balls.S))))
    assert np.max(balls.S_rad / ulp) <= 16
    assert np.max(balls.g0_rad / np.spacing(np.max(np.abs(balls.g0)))) <= 64


def test_balls_of_a_soft_body_are_a_few_ulps_wide():
    # the smallest eigenvalue of A is 4e-10 of its diagonal; with residuals of three halves of the working precision the
    # balls were 1e5 ulps wide
    balls = gallery.clip(12, 1).enclosure
    assert np.max(balls.S_rad / np.spacing(np.max(np.abs(balls.S)))) <= 64
    assert not misses(gallery.clip(2, 1), Fraction(1, 3))


def test_condition_decides_and_says_so():
    # an elastic bar of soft links in a stiff frame: condition up to 1e18 after any diagonal scaling
    for exponent, fine in ((6, True), (17, False)):
        soft = 2.0 ** -round(exponent * 3.32)
        A = np.array([[1.0, -1.0 + soft, 0], [-1.0 + soft, 1.0, 0], [0, 0, 1.0]])
        rows = np.eye(3)
        try:
            problem = ContactProblem(A, rows[:1], rows[2:], [1.0, 0.5, 0.25])
        except ValueError:
            assert not fine
            continue
        if fine:
            assert not misses(problem, 1.0)
        else:
            with pytest.raises(NotEnclosedError, match="within rounding"):
                CondensedEnclosure.from_problem(problem)


def test_eigenvalue_bounds_are_below_the_eigenvalue():
    rng = np.random.default_rng(3)
    for n in (1, 2, 5, 20, 60):
        for decades in (0, 4, 8, 12):
            Q, _ = np.linalg.qr(rng.normal(size=(n, n)))
            A = (Q * 10 ** rng.uniform(-decades, 0, size=n)) @ Q.T
            A = 0.5 * (A + A.T)
            least = float(np.linalg.eigvalsh(A)[0])
            for bound in (balls.dense_eigenvalue_bound(A), balls.sparse_eigenvalue_bound(sp.csc_array(A), least)):
                # eigvalsh itself is off by a few ulps of the largest
                assert bound <= least + 1e-13
                assert bound > 0.2 * least or least < 1e-11


def test_indefinite_matrices_get_no_positive_bound():
    rng = np.random.default_rng(4)
    for n in (2, 6, 20):
        Q, _ = np.linalg.qr(rng.normal(size=(n, n)))
        values = rng.uniform(0.5, 1.0, size=n)
        for least in (-1.0, -1e-6, -1e-15, 0.0):
            values[0] = least
            A = (Q * values) @ Q.T
            A = 0.5 * (A + A.T)
            assert balls.dense_eigenvalue_bound(A) <= 1e-15
            for estimate in (1e-3, 1e-9, 1e-14):
                assert balls.sparse_eigenvalue_bound(sp.csc_array(A), estimate) <= 1e-15


def test_residual_is_enclosed():
    rng = np.random.default_rng(6)
    for _ in range(10):
        n, m = int(rng.integers(1, 7)), 3
        A = rng.normal(size=(n, n)) * 10 ** rng.uniform(-8, 8, size=(n, 1)) * (rng.random((n, n)) < 0.7)
        X = rng.normal(size=(n, m)) * 10 ** rng.uniform(-12, 12, size=(1, m))
        K = A @ X * (1 + 2.0**-50 * rng.normal(size=(n, m)))
        value, radius = balls.SlicedMatrix(sp.csr_array(A)).residual(X, K)
        exact = [[Fraction(x) for x in row] for row in K.tolist()]
        for i, j in np.ndindex(n, m):
            exact[i][j] -= sum(Fraction(a) * Fraction(x) for a, x in zip(A[i].tolist(), X[:, j].tolist(), strict=True))
        assert holds(value, radius, exact)
        # about twice the working precision, beside the residual itself
        sizes = np.outer(np.sum(np.abs(A), axis=1), np.max(np.abs(X), axis=0))
        assert np.all(radius - 4e-16 * np.abs(value) <= 1e-26 * sizes + 1e-280)


def test_what_overflows_is_refused():
    problem = ContactProblem(np.eye(2), [[1.0, 0.0]], [[0.0, 1.0]], [1.0, 1.0], load_slope=[1e200, 0.0])
    one = np.ones(2)
    beyond = [(Fraction(10) ** exponent, one, one) for exponent in (200, 400)]
    beyond.append((1.0, np.ldexp(one, 900), np.ldexp(one, -900)))
    for arguments in beyond:
        with pytest.raises(NotEnclosedError, match="underflows float64"):
            problem.enclosure.at(*arguments)
    with pytest.raises(AssertionError, match="powers of two"):
        problem.enclosure.at(1.0, 3.0 * one, one)


def test_friction_that_underflows_is_refused():
    problem = ContactProblem(np.eye(2), [[1.0, 0.0]], [[0.0, 1.0]], [1.0, 1.0])
    with pytest.raises(NotEnclosedError, match="underflows"):
        problem.enclosure.at(Fraction(1, 10**400), np.ones(2), np.ones(2))


@pytest.mark.parametrize("of", [np.array, sp.csr_array])
def test_products_that_underflow_are_not_exact_zeros(of):
    left, right = of([[1e-200, 0.0], [1.0, 0.0]]), np.array([[1e-200, 0.0], [3.0, 0.0]])
    found = product(left, right)
    assert found.mid[0, 0] == 0
    assert found.rad[0, 0] > 0
    assert not np.any(found[:, 1].size)


@pytest.mark.parametrize(("coefficient", "ratio", "alpha"), [(1.0, 5e-324, "-9/10"), (1.0, 2.0**1023, "1")])
def test_a_second_coefficient_over_alpha_that_under_or_overflows_is_refused(coefficient, ratio, alpha):
    one = np.array([coefficient])
    problem = from_compliance(np.eye(3), np.ones(3), (one, one * ratio))
    problem = problem.replace(friction_slope=(one, one * ratio))
    space = AlphaSpace(CondensedEnclosure.from_problem(problem), Fraction(alpha), (np.ones(1), np.ones(1)))
    with pytest.raises(NotEnclosedError, match="flows"):
        _ = space.fixed
