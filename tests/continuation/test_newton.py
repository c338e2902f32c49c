from functools import partial

import numpy as np
import pytest
from alike import assert_same
from compare import forces
from path_problems import stable_problem
from refusals import bad_argument, refusal

import enumsol
from enumsol import gallery
from enumsol.continuation import NotConverged, SmoothPath, newton

enumerate_roots = partial(enumsol.enumerate_roots, arithmetic="fast")


@pytest.mark.parametrize(("start", "lambda_n"), [(None, 0.0), ((1.4, -3.9), 1.5), ((0.35, -1.7), 1 / 3)])
def test_start_decides_which_of_three_roots(start, lambda_n):
    root = newton(gallery.one_node_triangle(), 5.0, start)
    assert isinstance(root, enumsol.Root)
    assert root.lambda_n == pytest.approx([lambda_n], abs=1e-13)


@pytest.mark.few(10, 0)
@pytest.mark.parametrize("seed", range(25))
def test_random_starts_end_at_enumerated_roots_or_say_why_not(seed):
    problem = stable_problem(seed)
    roots = enumerate_roots(problem, 2.0, method="exhaustive")
    rng = np.random.default_rng(seed)
    scale = max(np.max(np.abs(root.lambda_n)) for root in roots) + 1.0
    converged = 0
    for _ in range(5):
        start = scale * rng.normal(size=(problem.p, 2))
        try:
            found = newton(problem, 2.0, start)
        except NotConverged:
            assert refusal(NotConverged, "try another start", newton, problem, 2.0, start).history
            continue
        converged += 1
        assert any(np.allclose(forces(found), forces(root), atol=1e-9) for root in roots)
    assert converged


def test_a_root_is_its_own_limit_for_every_r():
    problem = stable_problem(3)
    for root in enumerate_roots(problem, 2.0):
        for r in (1e-3, 1.0, 1e3, None):
            found = newton(problem, 2.0, root, r=r)
            assert_same(found, root, "statuses", "index")
            assert found.lambda_n == pytest.approx(root.lambda_n, abs=1e-12)


def test_failure_carries_its_history():
    problem, message = gallery.get("two-node-5").build(), r"alpha = 5 .*limit of 1 iteration was"
    error = refusal(NotConverged, message, newton, problem, 5.0, [3.0, -2.0, 40.0, 5.0], max_iterations=1)
    (step,) = error.history
    assert step.residual > 0


def test_continuum_gives_an_irregular_root():
    root = newton(gallery.get("one-node-6.3").build(), 2.0, [0.5, -1.0])
    assert (root.regular, root.index) == (False, None)
    assert 0 < root.lambda_n[0] <= 1


def test_smooth_path_value_is_used():
    path = SmoothPath(F=lambda a: 1 + a * a, dF=lambda a: 2 * a)
    root = newton(gallery.one_node_triangle(), 2.0, [0.35, -1.7], smooth_path=path)
    assert root.lambda_n == pytest.approx([1 / 3])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"alpha": np.nan}, "finite"),
        ({"alpha": -1.0}, "contact node 0"),
        ({"alpha": 1.0, "start": [1.0]}, r"start has shape \(1,\)"),
        ({"alpha": 1.0, "r": 0.0}, "r is 0"),
    ],
)
def test_bad_arguments(arguments, message):
    bad_argument(message, newton, gallery.one_node_triangle(), **arguments)
