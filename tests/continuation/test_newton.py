from functools import partial

import numpy as np
import pytest
from refusals import bad_argument

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
def test_random_starts_end_at_enumerated_roots_or_say_why_not(seed, random_problems):
    problem = random_problems(seed)
    roots = enumerate_roots(problem, 2.0, method="exhaustive")
    rng = np.random.default_rng(seed)
    scale = max(np.max(np.abs(root.lambda_n)) for root in roots) + 1.0
    converged = 0
    for _ in range(5):
        start = scale * rng.normal(size=(problem.p, 2))
        try:
            found = newton(problem, 2.0, start)
        except NotConverged:
            with pytest.raises(NotConverged, match="try another start") as caught:
                newton(problem, 2.0, start)
            assert caught.value.history
            continue
        converged += 1
        assert any(
            np.allclose(found.lambda_n, root.lambda_n, atol=1e-9)
            and np.allclose(found.lambda_t, root.lambda_t, atol=1e-9)
            for root in roots
        )
    assert converged


def test_a_root_is_its_own_limit_for_every_r(random_problems):
    problem = random_problems(3)
    for root in enumerate_roots(problem, 2.0):
        for r in (1e-3, 1.0, 1e3, None):
            found = newton(problem, 2.0, root, r=r)
            assert found.statuses == root.statuses
            assert found.index == root.index
            assert found.lambda_n == pytest.approx(root.lambda_n, abs=1e-12)


def test_failure_carries_its_history():
    with pytest.raises(NotConverged, match=r"alpha = 5 .*limit of 1 iteration was") as caught:
        newton(gallery.get("two-node-5").build(), 5.0, [3.0, -2.0, 40.0, 5.0], max_iterations=1)
    assert len(caught.value.history) == 1
    assert caught.value.history[0].residual > 0


def test_continuum_gives_an_irregular_root():
    root = newton(gallery.get("one-node-6.3").build(), 2.0, [0.5, -1.0])
    assert not root.regular
    assert root.index is None
    assert 0 < root.lambda_n[0] <= 1


def test_smooth_path_value_is_used():
    problem = gallery.one_node_triangle()
    path = SmoothPath(F=lambda a: 1 + a * a, dF=lambda a: 2 * a)
    root = newton(problem, 2.0, [0.35, -1.7], smooth_path=path)
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
