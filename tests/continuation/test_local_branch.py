from fractions import Fraction
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from path_problems import one_node, stable_problem
from problems3d import from_compliance, in_space
from refusals import bad_argument

import enumsol
from enumsol import ContactStatus, gallery
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


# -- in 3D -------------------------------------------------------------------------------------------------------------

OPEN, STICK, SLIP = ContactStatus.OPEN, ContactStatus.STICK, ContactStatus.SLIP


@pytest.mark.parametrize("seed", range(4))
def test_a_problem_in_2d_written_in_3d_has_the_same_signs(seed):
    problem = stable_problem(seed)
    flat, solid = (enumerate_roots(one, 5.0) for one in (problem, in_space(problem)))
    assert len(flat) == len(solid)
    for one, other in zip(flat, solid, strict=True):
        tests = [root.local_branch_test() for root in (one, other)]
        assert [test.exists for test in tests] == [True, True]
        assert [sign for _, sign in tests[1].signs] == [sign for _, sign in tests[0].signs] == [other.index]


def between(p, kinds, seed):
    """Random nodes of which each has two statuses, and where their forces and displacements are."""
    rng = np.random.default_rng([seed, 77, p])
    X = rng.normal(size=(3 * p, 3 * p))
    F, angle = 10 ** rng.uniform(-0.5, 0.8, (p, 2)), rng.uniform(0, 2 * np.pi, p)
    d, loaded = np.column_stack([np.cos(angle), np.sin(angle)]), np.array([kind[0] is STICK for kind in kinds])
    lambda_n, lambda_t, u_t = loaded * 1.0, loaded[:, None] * F * d, ~loaded[:, None] * d / F
    S = X @ X.T + 0.05 * np.eye(3 * p)
    forces = np.concatenate([lambda_n, *lambda_t.T])
    g = S @ forces + np.concatenate([np.zeros(p), *u_t.T])
    root = SimpleNamespace(alpha=0, active=tuple(map(frozenset, kinds)), lambda_t=lambda_t, u_t=u_t)
    return S, g, F, root, forces


def counts_near(S, g, F, forces, size=1e-6):
    """Numbers of roots near forces, after changes of g."""
    rng, counts = np.random.default_rng(0), set()
    for _ in range(8):
        moved = from_compliance(S, g + size * rng.normal(size=len(g)), tuple(F.T))
        found = enumsol.enumerate_roots(moved, 0)
        if not found.complete:
            continue
        near = (np.concatenate([root.lambda_n, *root.lambda_t.T]) - forces for root in found)
        counts.add(sum(bool(np.max(np.abs(off)) < 1e3 * size) for off in near))
    return counts


@pytest.mark.parametrize(
    ("p", "seeds"),
    [
        (1, (0, 2, 3)),
        pytest.param(1, range(16, 24), marks=pytest.mark.slow),
        pytest.param(2, range(4), marks=pytest.mark.slow),
        pytest.param(1, range(24), marks=pytest.mark.long),
        pytest.param(2, range(100), marks=pytest.mark.long),
    ],
)
def test_where_statuses_meet_in_3d_against_enumeration(p, seeds):
    """Where signs are equal there is one root near by whatever the load, and elsewhere there are none, or several."""
    answers = set()
    for seed in seeds:
        kinds = [((STICK, SLIP), (OPEN, SLIP))[(seed >> k) % 2] for k in range(p)]
        S, g, F, root, forces = between(p, kinds, seed)
        test = local_branch_test(from_compliance(S, g, tuple(F.T)), root)
        assert (len(test.signs), test.premise) == (2**p, True)
        found = counts_near(S, g, F, forces)
        assert (found == {1}) == test.exists, seed
        answers.add(test.exists)
    assert answers == {True, False}


def test_a_node_without_friction_has_one_status_in_contact():
    S, g, _, root, _ = between(2, [(STICK, SLIP), (OPEN, SLIP)], 0)
    test = local_branch_test(from_compliance(S, g, 0.0), root)
    assert (test.exists, test.premise, len(test.signs)) == (True, False, 2)


def test_all_directions_of_slip_cannot_be_listed():
    S, g, F, root, _ = between(1, [(OPEN, SLIP)], 0)
    still = SimpleNamespace(**{**vars(root), "active": (frozenset((OPEN, STICK, SLIP)),)})
    with pytest.raises(enumsol.TooLargeError, match="touches without load and rests at alpha = 0"):
        local_branch_test(from_compliance(S, g, tuple(F.T)), still)


def test_a_root_of_another_dimension_is_refused():
    plane, space = gallery.one_node_triangle(), gallery.one_node_3d()
    roots = [enumsol.enumerate_roots(problem, 1)[0] for problem in (plane, space)]
    bad_argument("root is one in 3D; expected one in 2D", local_branch_test, plane, roots[1])
    bad_argument("root is one in 2D; expected one in 3D", local_branch_test, space, roots[0])
