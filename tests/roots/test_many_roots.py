"""Chains with 3^p roots: the count, the values, and memory that grows with the answer only."""

import itertools
import tracemalloc

import numpy as np
import pytest
from compare import statuses
from effort import some

import enumsol
from enumsol import gallery


def all_of_chain(p, coupling):
    """The roots of a chain at alpha = 5: every node is open, sticks or slips, whatever the others do."""
    roots = enumsol.enumerate_roots(gallery.chain(p, coupling), 5.0, "fast")
    assert (len(roots), roots.index_sum) == (3**p, 1)
    assert statuses(roots) == set(itertools.product(("open", "stick", "slip-"), repeat=p))
    return roots


def test_uncoupled_chain_of_six():
    alpha = 5.0
    roots = all_of_chain(6, 0.0)
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
    assert (len(roots), roots.index_sum) == (3**p, 1)
    return peak / len(roots)


@pytest.mark.slow
def test_memory_of_a_coupled_chain_grows_like_its_answer():
    enumsol.enumerate_roots(gallery.chain(2, 0.01), 5.0, "fast")  # imports and caches
    small, large = _peak(3), _peak(5)  # bytes per root; a root of the larger problem holds 5 / 3 as many numbers
    assert large < 1.1 * 5 / 3 * small


@pytest.mark.slow
def test_a_long_chain_with_coupling():
    all_of_chain(some(6, of=8), 0.01)


def test_stop_after_two_of_very_many():
    roots = enumsol.enumerate_roots(gallery.chain(30, 0.01), 5.0, "fast", stop_after=2)
    assert (len(roots), roots.complete) == (2, False)
    assert "enough" in roots.stopped


@pytest.mark.parametrize("coupling", [0.0, 0.05])
def test_tree_equals_exhaustive_on_a_chain(coupling):
    exhaustive = enumsol.enumerate_roots(gallery.chain(4, coupling), 5.0, "fast", "exhaustive")
    assert statuses(exhaustive) == statuses(all_of_chain(4, coupling))
