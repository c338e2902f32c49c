"""In 2D the fixed points of Psi are the enumerated roots."""

import numpy as np
import pytest
from effort import some
from generators import FRICTION, dense_compliance, fe_compliance, from_condensed
from refusals import bad_argument

import enumsol
from enumsol.fixed_points import fixed_point_residual

MANY_ROOTS = [("one-node-6.1", 5.0, 3), ("two-node-5", 5.0, 5), ("two-node-6.4", 3.5, 5), ("wedge-14-5", 2.2, 5)]


@pytest.mark.parametrize(("name", "alpha", "count"), MANY_ROOTS)
def test_every_root_is_a_fixed_point(name, alpha, count):
    problem = enumsol.gallery.get(name).build()
    roots = enumsol.enumerate_roots(problem, alpha)
    assert len(roots) == count
    for root in roots:
        assert enumsol.is_fixed_point(problem, root)
        assert fixed_point_residual(problem, root) < 1e-8


@pytest.mark.slow
def test_every_root_of_random_problems_is_a_fixed_point(rng):
    several = 0
    for k in range(some(40, of=120)):
        p = int(rng.integers(1, 5))
        S = dense_compliance(rng, p) if k % 2 else fe_compliance(rng, 2 * p)
        p = len(S) // 2
        F = np.exp(rng.uniform(*np.log(FRICTION), p))
        problem = from_condensed(S, rng.normal(size=2 * p), F)
        roots = enumsol.enumerate_roots(problem, 0)
        several += len(roots) > 1
        assert all(enumsol.is_fixed_point(problem, root) for root in roots)
    assert several >= some(1, of=5)


def test_what_is_no_root_is_no_fixed_point():
    problem = enumsol.gallery.get("one-node-6.1").build()
    sticking = enumsol.enumerate_roots(problem, 5.0)[1]
    moved = enumsol.solve_tresca(problem, sticking.lambda_n + 0.1, 5.0)
    assert not enumsol.is_fixed_point(problem, moved)
    other = enumsol.gallery.get("two-node-5").build()
    bad_argument(r"expected \(2,\), as the problem has p = 2", enumsol.is_fixed_point, other, sticking)
    bad_argument("root is a int without alpha", enumsol.is_fixed_point, problem, 3)
