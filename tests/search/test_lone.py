"""Roots that are proven to be alone below an assignment, against all selections and against the tree without them."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from compare import assert_as_exhaustive, differences
from effort import some
from generators import random_problem
from proof_tools import records_of
from rational_checker import check_records
from touching import problem_of_any_kind, touching_problem
from trees import above_known_roots, by_the_tree

from enumsol import enumerate_roots, gallery, verify
from enumsol.checker.stability import stability_radius
from enumsol.search import fathoming as closing, parallel
from enumsol.search.fathoming_in_contact import KnownRoot


def kinds(proof):
    return [record[0] for record in records_of(proof)[1:-1]]


@pytest.mark.few(0, 1)
@pytest.mark.parametrize(
    ("size", "traction", "alpha"),
    [((128, 16, 2), (1.0, -0.3), 2.0), pytest.param((256, 16, 4), (0.3, -1.0), 5.0, marks=pytest.mark.slow)],
)
def test_blocks_that_are_not_definite_take_one_node(size, traction, alpha, monkeypatch):
    monkeypatch.setattr(closing.Reduction, "weights", lambda *_, **__: None)
    problem = gallery.clamped_block(*size, traction=traction)
    roots = enumerate_roots(problem, alpha, max_nodes=1)
    assert roots.by_one_certificate
    assert kinds(roots.proof) == ["a"]
    assert verify(problem, roots.proof).complete
    assert stability_radius(problem, roots.proof) > 0
    if size[0] < 200:
        with by_the_tree():
            tree = enumerate_roots(problem, alpha)
        assert tree.stats.nodes > 1000
        assert not differences(roots, tree)


def problems(seed):
    rng = np.random.default_rng([24, seed])
    return problem_of_any_kind(rng, int(rng.integers(1, 5)), seed % 4, (0.05, 3.0), planted=seed % 8 == 3)


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("part", range(3))
def test_all_selections_find_the_same(part):
    lone = several = 0
    for seed in range(40 * part, 40 * part + some(20, of=40)):
        problem = problems(seed)
        with above_known_roots():
            roots = enumerate_roots(problem, 0)
        exact = assert_as_exhaustive(problem, 0, roots)
        found = kinds(roots.proof).count("a")
        if found or seed % 10 == 0:
            assert check_records(problem, records_of(roots.proof)) == records_of(roots.proof)[-1]
        lone += found
        several += found and len(exact) > 1
    assert lone > some(3, of=8)
    assert several > 0


@pytest.mark.long
def test_the_tree_without_them_finds_the_same():
    fewer = 0
    for seed in range(50):
        rng = np.random.default_rng([25, seed])
        p = int(rng.integers(4, 9))
        problem = random_problem(rng, p) if seed % 2 else touching_problem(rng, p)
        with by_the_tree():
            tree = enumerate_roots(problem, 0)
        with above_known_roots():
            roots = enumerate_roots(problem, 0)
        assert not differences(roots, tree)
        assert verify(problem, roots.proof).complete
        assert roots.stats.nodes <= tree.stats.nodes or roots.stats.closed
        fewer += roots.stats.nodes < tree.stats.nodes
    assert fewer > 10


@pytest.mark.slow
def test_workers_know_the_root(monkeypatch):
    monkeypatch.setattr(parallel, "FIRST", 8)
    monkeypatch.setattr(parallel, "NODES", 16)
    problem = gallery.get("wedge-8-5").build()
    with above_known_roots(), ThreadPoolExecutor(2) as executor:
        alone, together = enumerate_roots(problem, 2.2), enumerate_roots(problem, 2.2, executor=executor)
    assert "a" in kinds(alone.proof)
    assert "a" in kinds(together.proof)
    assert not differences(alone, together)
    assert verify(problem, together.proof).complete
    assert check_records(problem, records_of(together.proof)) == records_of(together.proof)[-1]


def test_what_lies_below():
    problem = gallery.wedge(4, 4)
    scaled = problem.condensed.at(1.0).scaled
    known = KnownRoot((0,) * problem.p, np.zeros(2 * problem.p), scaled.g)
    assert known.below((6,) * problem.p)
    assert not known.below((5,) + (6,) * (problem.p - 1))
    assert known.below((7,) + (8,) * (problem.p - 1))
