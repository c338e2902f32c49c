"""Chains with 3^p roots: the count, the values, and memory that grows with the answer only."""

import itertools
import tracemalloc

import numpy as np
import pytest
from compare import statuses
from effort import some

import enumsol
from enumsol import gallery


def test_uncoupled_chain_of_six():
    alpha = 5.0
    roots = enumsol.enumerate_roots(gallery.chain(6, 0.0), alpha, "fast")
    assert len(roots) == 729
    assert statuses(roots) == set(itertools.product(("open", "stick", "slip-"), repeat=6))
    assert roots.index_sum == 1
    value = {"open": 0.0, "stick": 1.5, "slip-": 1 / (alpha - 2)}
    for root in roots:
        expected = [value[s.value] for s in root.statuses]
        np.testing.assert_allclose(root.lambda_n, expected, rtol=1e-12, atol=0)
        assert root.index == (-1) ** sum(s.value == "slip-" for s in root.statuses)


def _peak(p):
    problem = gallery.chain(p, 0.01)
    problem.condensed  # noqa: B018 (made once, not part of the answer)
    tracemalloc.start()
    try:
        roots = enumsol.enumerate_roots(problem, 5.0, "fast")
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert len(roots) == 3**p
    assert roots.index_sum == 1
    return peak / len(roots)


@pytest.mark.slow
def test_memory_of_a_coupled_chain_grows_like_its_answer():
    enumsol.enumerate_roots(gallery.chain(2, 0.01), 5.0, "fast")  # imports and caches
    small, large = _peak(3), _peak(5)  # bytes per root; a root of the larger problem holds 5 / 3 as many numbers
    assert large < 1.1 * 5 / 3 * small


@pytest.mark.slow
def test_a_long_chain_with_coupling():
    p = some(6, of=8)
    roots = enumsol.enumerate_roots(gallery.chain(p, 0.01), 5.0, "fast")
    assert len(roots) == 3**p
    assert statuses(roots) == set(itertools.product(("open", "stick", "slip-"), repeat=p))
    assert roots.index_sum == 1


def test_stop_after_two_of_very_many():
    roots = enumsol.enumerate_roots(gallery.chain(30, 0.01), 5.0, "fast", stop_after=2)
    assert len(roots) == 2
    assert not roots.complete
    assert "enough" in roots.stopped


@pytest.mark.parametrize("coupling", [0.0, 0.05])
def test_tree_equals_exhaustive_on_a_chain(coupling):
    problem = gallery.chain(4, coupling)
    tree = enumsol.enumerate_roots(problem, 5.0, "fast")
    assert len(tree) == 81
    assert statuses(tree) == statuses(enumsol.enumerate_roots(problem, 5.0, "fast", "exhaustive"))
