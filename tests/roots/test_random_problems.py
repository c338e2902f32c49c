"""Tree, exhaustive method and an independent brute force agree on generic random problems."""

import numpy as np
import pytest
from compare import differences_from_brute_force
from complete import all_roots
from effort import some
from generators import FRICTION, friction, random_problem
from oracles import brute_force, condense

import enumsol

CHUNK = some(60, of=150)


def check(seed, count, sizes, methods=("tree", "exhaustive")):
    """Number of problems with more than one root."""
    rng = np.random.default_rng(seed)
    several = 0
    for k in range(count):
        problem = random_problem(rng, int(rng.choice(sizes)))
        found, border, singular = brute_force(*condense(problem, 0.0))
        # a generic problem: the oracle itself is sure of every selection
        assert border > 1e-10, (seed, k)
        assert not singular, (seed, k)
        assert sum(root.sign for root in found) == 1, (seed, k)
        several += len(found) > 1
        for method in methods:
            roots = enumsol.enumerate_roots(problem, 0.0, "fast", method)
            assert not differences_from_brute_force(roots, found), (seed, k, method)
            assert (roots.index_sum, len(roots) % 2, roots.complete) == (1, 1, False)
    return several


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("seed", range(3))
def test_up_to_four_nodes(seed):
    assert check(seed, CHUNK, (1, 2, 3, 4)) >= CHUNK / 3


@pytest.mark.long
def test_six_nodes():
    assert check(100, 25, (6,)) >= 25 / 3


@pytest.mark.slow
def test_five_nodes_tree_only():
    assert check(200, some(15, of=50), (5,), methods=("tree",)) >= some(4, of=17)


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("method", ["tree", "exhaustive"])
def test_exact_arithmetic(method):
    rng = np.random.default_rng(300)
    for _ in range(some(30, of=60)):
        problem = random_problem(rng, int(rng.choice((1, 2, 3))))
        found, _, _ = brute_force(*condense(problem, 0.0))
        roots = all_roots(problem, 0.0, "exact", method)
        assert not differences_from_brute_force(roots, found)
        assert roots.index_sum == 1


def test_the_generator_covers_the_range_of_friction():
    rng = np.random.default_rng(0)
    F = np.concatenate([friction(rng, 2) for _ in range(300)])
    assert FRICTION[0] <= np.min(F) < 0.1
    assert 25.0 < np.max(F) <= FRICTION[1]
