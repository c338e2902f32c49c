from fractions import Fraction
from functools import partial

import numpy as np
import pytest
from path_problems import one_node, stable_problem

import enumsol
from enumsol import gallery
from enumsol.continuation import SmoothPath, follow, local_branch_test, newton

enumerate_roots = partial(enumsol.enumerate_roots, arithmetic="fast")


def roots_near(problem, root, size):
    """Numbers of roots close to one after changes of the load, by the enumeration: the oracle of the test."""
    rng = np.random.default_rng(0)
    counts = set()
    for _ in range(12):
        moved = problem.replace(f=problem.f + size * rng.normal(size=problem.n))
        found = enumerate_roots(moved, root.alpha, method="exhaustive")
        counts.add(sum(bool(np.max(np.abs(other.lambda_n - root.lambda_n)) < 100 * size) for other in found))
    return counts


def test_regular_roots_have_a_branch():
    problem = stable_problem(0)
    for root in enumerate_roots(problem, 5.0):
        test = local_branch_test(problem, root)
        assert (test.exists, test.premise, test.signs) == (True, True, ((root.statuses, root.index),))
        assert "exists" in str(test)


def test_fold_has_none_and_names_the_selection():
    # the tip of the fold between stick and slip- of the one-node problem
    problem = one_node((1.0, -3.0), friction=3.0)
    root = next(r for r in enumerate_roots(problem, 0.0) if r.lambda_n[0] > 0.5)
    test = local_branch_test(problem, root)
    assert not test.exists
    assert {sign for _, sign in test.signs} == {1, -1}
    assert len(test.differing) == 1
    assert roots_near(problem, root, 1e-5) == {0, 2}


def test_a_root_reports_it():
    problem = gallery.one_node_triangle()
    roots = enumsol.enumerate_roots(problem, Fraction(8, 3))
    assert [root.local_branch_test().exists for root in roots] == [True, False]
    fold = roots[1].local_branch_test()
    assert fold.premise
    assert fold == local_branch_test(problem, roots[1])
    for root in enumerate_roots(stable_problem(3), 5.0):
        assert root.local_branch_test().exists == root.regular
    assert newton(problem, 5.0).local_branch_test().exists
    smooth = SmoothPath(F=lambda a: a * a, dF=lambda a: 2 * a)
    assert newton(problem, 0.0, smooth_path=smooth).local_branch_test().premise is False


def test_transition_between_equal_signs_has_a_branch():
    # paper, Example 6.2: stick to slip+ at alpha = 14/3
    problem = one_node((1.0, 3.0), friction=3.0)
    root = enumerate_roots(problem, 0.0)[0]
    assert len(root.active[0]) == 2
    assert local_branch_test(problem, root).exists
    assert roots_near(problem, root, 1e-5) == {1}


def test_zero_friction_fails_the_premise_only():
    problem = gallery.one_node_triangle(f=(1.0, 1.0))
    test = local_branch_test(problem, newton(problem, 0.0))
    assert (test.exists, test.premise) == (True, False)
    assert "Theorem 4.1" in str(test)


@pytest.mark.parametrize("r", [1e-2, 1.0, 1e2])
def test_transitions_of_a_path_report_it_for_every_r(r):
    problem = gallery.one_node_triangle()
    path = follow(problem, newton(problem, 5.0, [1.5, -4.0]), -1, (0, 20), enumsol.ContinuationOptions(r=r))
    (transition,) = path.transitions
    assert not transition.local_test.exists
    assert transition in path.folds
