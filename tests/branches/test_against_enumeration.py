"""roots_at(alpha) of a graph equals enumerate_roots at that alpha, on generic, degenerate and larger problems."""

from fractions import Fraction

import numpy as np
import pytest
from complete import whole_graph
from effort import some
from path_problems import assert_same_roots, balanced, generic_problem, integer_problem

from enumsol import enumerate_roots, gallery
from enumsol.branches import branch_graph

KINDS = ("friction", "load", "both")


@pytest.mark.few(5, 4)
@pytest.mark.parametrize("seed", range(30))
def test_generic_problems_at_random_alphas(seed):
    rng = np.random.default_rng(seed)
    problem = generic_problem(rng, int(rng.integers(1, 5)), KINDS[seed % 3])
    graph = balanced(branch_graph(problem, (0.0, 6.0)))
    for alpha in rng.uniform(0.0, 6.0, size=12).tolist():
        roots = enumerate_roots(problem, alpha, "fast")
        assert_same_roots(graph.roots_at(alpha), roots)
        assert graph.multiplicity_at(alpha) == len(roots)


@pytest.mark.parametrize("seed", range(9))
def test_exact_arithmetic_proves_generic_graphs_complete(seed):
    rng = np.random.default_rng(100 + seed)
    problem = generic_problem(rng, int(rng.integers(1, 4)), KINDS[seed % 3])
    graph = balanced(whole_graph(problem, (0.0, 6.0), "exact"))
    alpha = Fraction(rng.uniform(0.0, 6.0)).limit_denominator(1000)
    assert_same_roots(graph.roots_at(alpha), enumerate_roots(problem, alpha, "exact"))


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("block", range(6))
def test_degenerate_problems_at_their_critical_alphas_too(block):
    for seed in range(20 * block, 20 * block + some(8, of=20)):
        rng = np.random.default_rng(seed)
        kind = KINDS[seed % 3]
        problem = integer_problem(rng, int(rng.integers(1, 4)), kind)
        interval = (-3, 3) if kind == "load" else (0, 4)
        graph = branch_graph(problem, interval, "exact")
        assert graph.complete, (seed, graph.reasons)
        balanced(graph)
        alphas = [Fraction(x).limit_denominator(997) for x in rng.uniform(*interval, size=2)]
        alphas += [v.enclosure[0] for v in graph.vertices if v.enclosure[0] == v.enclosure[1]]
        for alpha in alphas[:8]:
            roots = enumerate_roots(problem, alpha, "exact")
            assert_same_roots(graph.roots_at(alpha), roots)
            assert graph.multiplicity_at(alpha) == len(roots) + len(roots.families)


@pytest.mark.few(2, 2)
@pytest.mark.parametrize("name", ["two-node-6.4", "two-node-6.5", "two-node-6.6", "two-node-5", "chain-4-coupled"])
def test_gallery_problems(name, rng):
    problem = gallery.get(name).build()
    graph = balanced(branch_graph(problem, (0.0, 8.0)))
    for alpha in rng.uniform(0.0, 8.0, size=10).tolist():
        assert_same_roots(graph.roots_at(alpha), enumerate_roots(problem, alpha, "fast"))


@pytest.mark.slow
def test_the_wedge_over_its_whole_path(rng):
    problem = gallery.get("wedge-14-5").build()
    graph = balanced(branch_graph(problem, (0.0, 5.0)))
    assert graph.stats.nodes < 40_000
    assert max(graph.steps[2]) == 5
    for alpha in rng.uniform(0.0, 5.0, size=12).tolist():
        assert_same_roots(graph.roots_at(alpha), enumerate_roots(problem, alpha, "fast"))
