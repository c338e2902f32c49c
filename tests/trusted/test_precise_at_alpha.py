"""Selections at one alpha in balls of many digits: what they enclose, and what they decide."""

from fractions import Fraction
from itertools import product

import numpy as np
import pytest
import scipy.sparse as sp
from complete import complete_report, proven_roots
from exact_balls import holds
from proof_tools import proof_of, put, records_of, why_refused

import enumsol
from enumsol import ContactProblem
from enumsol.arithmetic.rationals import rational
from enumsol.condensation.exact import ExactSystem
from enumsol.selections.rational_selections import ExactSelections
from enumsol.trusted.arcs.precise import verified_in_many_digits
from enumsol.trusted.at_alpha import solve_selection


def nearly_singular(n, **changes):
    """One node whose slipping selection has det M = 2^-54 / 11, and other numbers that are as small.

    With A = (20 3; 3 1), F = fl(1/3) and f = (3, 1), M of slip+ is (1 - 3 F) / 11 = 2^-54 / 11 and g_n is the
    penetration 2^-57 of the gap alone: lambda_n = 11 / 8 and w_t = 1 - 11 / 24. The other degrees of freedom rest.
    """
    A = sp.block_diag([np.array([[20.0, 3.0], [3.0, 1.0]]), sp.eye(n - 2)]).tocsr()
    rows = sp.eye(n).tocsr()
    data = {"gap": -(2.0**-57), "friction": 1 / 3, "friction_slope": 0.0} | changes
    return ContactProblem(A, rows[:1], rows[1:2], np.array([3.0, 1.0, *np.zeros(n - 2)]), **data)


def scaled(problem, alpha):
    system = problem.condensed.at(alpha).scaled
    return system, verified_in_many_digits(problem, Fraction(alpha), system.force, system.length)


def test_balls_hold_the_solution_in_rationals_and_know_its_signs(rng):
    for _ in range(4):
        p = int(rng.integers(1, 4))
        n = 2 * p + int(rng.integers(0, 3))
        X = rng.integers(-2, 3, size=(n, n))
        A, F = X @ X.T + np.eye(n), rng.integers(0, 4, size=p) / 2
        f, gap = rng.integers(-2, 3, size=n).astype(float), rng.integers(0, 2, size=p).astype(float)
        rows = np.eye(n)[: 2 * p]
        problem = ContactProblem(A, rows[:p], rows[p:], f, gap=gap, load_slope=f / 3, friction=F, friction_slope=0.1)
        alpha = Fraction(int(rng.integers(0, 4)), 3)
        system, precise = scaled(problem, alpha)
        exact = ExactSelections(ExactSystem.from_problem(problem, alpha))
        for codes in product(range(4), repeat=p):
            found, expected = precise(codes), exact.solve_equations(codes)
            assert (found is None) == (expected is None)
            if expected is None:
                continue
            point, sign = expected
            units = [exact.forces(point) / system.force, exact.displacements(point) / system.length]
            for ball, floats in zip((found.force, found.w), units, strict=True):
                assert np.allclose(ball.mid, floats, rtol=1e-12, atol=1e-300)
            force = [x / rational(u) for x, u in zip(point, system.force.tolist(), strict=True)]
            assert holds(found.force.mid, found.force.rad, force)
            assert found.index == sign
            signs = sorted(np.sign([float(v) for v in exact._slacks(codes, point)]))
            ours = np.where(np.abs(found.slack.mid) > found.slack.rad, np.sign(found.slack.mid), 0.0)
            assert sorted(ours) == signs


def test_a_singular_selection_is_none():
    problem = ContactProblem([[2.0, 1.0], [1.0, 1.0]], [[1, 0]], [[0, 1]], [1.0, 0.5], friction=1.0)
    _, precise = scaled(problem, 0.0)
    # S = (1 -1; -1 2), so that S_nn + F S_nt = 0
    assert precise((2,)) is None
    assert precise((3,)) is not None


def test_double_arithmetic_leaves_open_what_many_digits_decide():
    problem = nearly_singular(2)
    system, precise = scaled(problem, 0.0)
    enclosed = problem.enclosure.at(0.0, system.force, system.length)
    for codes, root in (((1,), False), ((2,), True)):
        ball = solve_selection(enclosed, codes)
        assert ball is None or not (ball.is_root or ball.is_excluded)
        found = precise(codes)
        assert (found.is_root, found.is_excluded) == (root, not root)


@pytest.mark.parametrize("n", [26, 260])
def test_a_body_of_any_size_is_complete_without_rationals(n):
    problem = nearly_singular(n)
    roots = proven_roots(problem, 0.0)
    (root,) = roots
    assert roots.stats.escalations.rationals == 0
    assert np.isclose(root.lambda_n[0], 11 / 8, rtol=1e-12)
    assert [str(status) for status in root.statuses] == ["slip+"]
    if n < 100:
        (exact,) = enumsol.enumerate_roots(problem, 0.0, arithmetic="exact")
        assert exact.statuses == root.statuses


def test_the_proof_of_a_problem_that_differs_by_less_than_double_arithmetic_sees_is_refused():
    problem, other = nearly_singular(26), nearly_singular(26, gap=2.0**-57)
    records = records_of(enumsol.enumerate_roots(problem, 0.0).proof)
    complete_report(problem, proof_of(records))
    assert why_refused(other, put(records, (0, "problem"), other.fingerprint))
