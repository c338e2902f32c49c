"""One and two nodes whose growth rates are roots of a linear and of a quadratic equation."""

from fractions import Fraction

import numpy as np
import pytest

import enumsol
from enumsol import ContactProblem

rng_seeds = pytest.mark.parametrize("seed", range(3))


def spd(rng, n):
    X = rng.normal(size=(n, n))
    return X @ X.T + 0.2 * np.eye(n)


def planted(A, w, lam, F, **more):
    """A problem with unit rows, normals first, and a solution that moves these by w and has the forces lam."""
    p = len(F)
    u = np.concatenate([w, np.zeros(len(A) - 2 * p)])
    rows = np.eye(len(A))
    f = A @ u + rows[: 2 * p].T @ lam
    return ContactProblem(A, rows[:p], rows[p : 2 * p], f, friction=F, **more)


def sliding(A, F, s):
    """All nodes slide, with forces of one and displacements of a tenth."""
    p = len(F)
    w = np.concatenate([np.zeros(p), 0.1 * s])
    problem = planted(A, w, np.concatenate([np.ones(p), s * F]), F)
    roots = enumsol.enumerate_roots(problem, 0.0)
    [root] = [root for root in roots if np.allclose(root.u_t, 0.1 * s) and np.allclose(root.lambda_n, 1)]
    return problem, root


def growing(A, M, F, s):
    """mu of one or two sliding nodes by hand: L(mu) = T'(A + mu M) R is affine in mu."""
    p = len(F)
    R = np.vstack([np.zeros((p, p)), np.diag(s)])
    T = R - np.vstack([np.diag(F), np.zeros((p, p))])
    a, m = T.T @ A @ R, T.T @ M @ R
    found = []
    for i in range(p):
        mu = -a[i, i] / m[i, i]
        if mu > 0 and all(a[j, i] + mu * m[j, i] > 0 for j in range(p) if j != i):
            found.append(mu)
    if p == 2:
        mixed = a[0, 0] * m[1, 1] + a[1, 1] * m[0, 0] - a[0, 1] * m[1, 0] - a[1, 0] * m[0, 1]
        for mu in np.roots([np.linalg.det(m), mixed, np.linalg.det(a)]):
            if abs(mu.imag) < 1e-12 and mu.real > 0:
                L = a + mu.real * m
                # L x = 0 has a solution x > 0
                found += [mu.real] if L[0, 0] * L[0, 1] < 0 or L[1, 0] * L[1, 1] < 0 else []
    return sorted(found, reverse=True)


@rng_seeds
@pytest.mark.parametrize("p", [1, 2])
def test_growth_rates_of_a_few_nodes(p, seed):
    rng = np.random.default_rng([p, seed])
    seen = set()
    for _ in range(3):
        A, M = spd(rng, 2 * p), spd(rng, 2 * p)
        F, s = rng.uniform(0.2, 4, p), rng.choice([-1.0, 1.0], p)
        problem, root = sliding(A, F, s)
        found, expected = enumsol.stability(problem, root, mass=M), growing(A, M, F, s)
        seen.add(found.verdict)
        assert found.verdict == ("runs away" if expected else "does not run away")
        np.testing.assert_allclose(np.square(found.growth_rates), expected, rtol=1e-6)
        for (low, high), rate in zip(found.bounds, np.sqrt(expected), strict=True):
            assert low * (1 - 1e-9) <= rate <= high * (1 + 1e-9)
    assert "undecided" not in seen


def test_one_node_by_hand():
    """A_tt - F A_nt = 1 - 1.5 0.9 < 0: the slip feeds itself."""
    A = np.array([[2.0, 0.9], [0.9, 1.0]])
    problem, root = sliding(A, np.array([1.5]), np.ones(1))
    found = enumsol.stability(problem, root, mass=np.eye(2))
    assert found.verdict == "runs away"
    assert found.growth_rates[0] == pytest.approx(np.sqrt(0.35), rel=1e-9)
    np.testing.assert_allclose(np.abs(found.motions[0]), [0, 1], atol=1e-7)
    assert enumsol.stability(problem, root, mass=4 * np.eye(2)).growth_rates[0] == pytest.approx(
        np.sqrt(0.35) / 2, rel=1e-9
    )
    # mass that couples the directions
    assert enumsol.stability(problem, root, mass=[[3, 1.5], [1.5, 1]]).verdict == "does not run away"


def test_coefficients_that_are_no_floats():
    A = np.array([[2.0, 0.9], [0.9, 1.0]])
    problem = ContactProblem(A, [[1, 0]], [[0, 1]], [2, 2], friction=0, friction_slope=1)
    for alpha in (Fraction(1, 3), Fraction(4, 3)):
        for root in enumsol.enumerate_roots(problem, alpha):
            found = enumsol.stability(problem, root, mass=np.eye(2))
            slides = {status.name for status in root.active[0]} in ({"SLIP_PLUS"}, {"SLIP_MINUS"})
            s = 1 if root.lambda_t[0] > 0 else -1
            mu = s * float(alpha) * 0.9 - 1
            assert found.verdict == ("runs away" if slides and mu > 0 else "does not run away")


def test_what_oscillates_is_not_said_to_run_away():
    """Nothing grows along a straight line, and yet slip and stick in turn do (theory, section 15.1)."""
    from stepping import STICK_SLIP_A as A, STICK_SLIP_F as F

    problem = planted(A, np.array([0.0, 0.1]), np.array([1.0, F]), np.array([F]))
    [root] = [root for root in enumsol.enumerate_roots(problem, 0.0) if abs(root.lambda_n[0] - 1) < 1e-9]
    assert enumsol.stability(problem, root, mass=np.eye(4)).verdict == "does not run away"
