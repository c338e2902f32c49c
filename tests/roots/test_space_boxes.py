"""Degenerate roots in 3D that boxes settle: complete results, several roots, resumed and spread searches."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import oracles3d
import pytest
from alike import anew
from complete import accepted_report, all_roots
from effort import some
from problems3d import bounds, degenerate_integers, forces, from_compliance, unmatched
from space_proofs import random_problem
from trees import by_the_tree

from enumsol import enumerate_roots, verify
from enumsol.search.space.open_leaves import Cause


def settled(problem):
    """Roots by the tree, if they are all; the checker agrees in any case."""
    with by_the_tree():
        roots = enumerate_roots(problem, 0, max_nodes=200)
    report = accepted_report(problem, roots.proof)
    assert (report.complete, report.roots) == (roots.complete, len(roots))
    return roots if roots.complete else None


@pytest.mark.few(1, 0)
@pytest.mark.parametrize("part", range(3))
def test_degenerate_problems_are_complete(part):
    rng, complete = np.random.default_rng(part), 0
    for seed in range(10 * part, 10 * part + some(5, of=10)):
        problem, lam, _, F, _ = degenerate_integers(seed)
        roots = settled(problem)
        if roots is None:
            continue
        complete += 1
        known = np.ravel(lam, order="F")
        (held,) = [root for root in roots if np.all((bounds(root)[0] <= known) & (known <= bounds(root)[1]))]
        assert not held.regular
        assert held.index in (1, -1)
        assert roots.index_sum == 1
        S, g = problem.condensed.S, problem.condensed.free_displacements(0)
        assert unmatched(roots, oracles3d.newton_set(S, g, F, 20, rng))[0] == []
    assert complete > some(0, of=2)


def test_several_roots_are_degenerate():
    """A node that just sticks beside one with three solutions: three roots, none of them regular."""
    one, other = degenerate_integers(47)[0], random_problem(1, 22)
    S, g, F = np.zeros((6, 6)), np.zeros(6), np.zeros((2, 2))
    for k, problem in enumerate((one, other)):
        S[k::2, k::2] = problem.condensed.S
        g[k::2], F[k] = problem.condensed.free_displacements(0), problem.friction_at(0)[0]
    roots = settled(from_compliance(S, g, tuple(F.T)))
    assert sorted(root.index for root in roots) == [-1, 1, 1]
    assert not any(root.regular for root in roots)
    assert all(len(root.active[0]) == 2 for root in roots)


@pytest.mark.few(2)
@pytest.mark.parametrize("step", [1e-15, 1e-13, 1e-11, 1e-8])
def test_nearly_degenerate_roots_are_found_once(step):
    complete = 0
    for seed in (1, 2, 7, 47):
        problem, *_ = degenerate_integers(seed)
        S, g = problem.condensed.S, problem.condensed.free_displacements(0)
        moved = g + step * np.random.default_rng(seed).normal(size=len(g))
        roots = settled(from_compliance(S, moved, tuple(problem.friction_at(0).T)))
        if roots is not None:
            complete += 1
            assert roots.index_sum == 1
            gaps = [np.max(np.abs(forces(a) - forces(b))) for k, a in enumerate(roots) for b in roots[:k]]
            assert min(gaps, default=1.0) > 1e-3
    assert complete > 2


@pytest.mark.slow
def test_resumed_and_spread_searches_give_the_same(tmp_path):
    problem, path = degenerate_integers(2)[0], tmp_path / "boxes.proof"
    with by_the_tree():
        first = enumerate_roots(problem, 0)
        enumerate_roots(problem, 0, max_nodes=40, proof_path=path)
        resumed = enumerate_roots(problem, 0, proof_path=path, resume=True)
        again = enumerate_roots(problem, 0, proof_path=path, resume=True)
        with ThreadPoolExecutor(1) as pool:
            spread = enumerate_roots(problem, 0, executor=pool)
    assert first.complete
    assert (again.stats.nodes, again.complete) == (0, True)
    assert resumed.stats.resumed > 0
    for roots in (resumed, again, spread):
        assert (len(roots), roots.complete) == (len(first), True)
        assert [root.active for root in roots] == [root.active for root in first]
        assert np.allclose(forces(roots[0]), forces(first[0]), atol=1e-12)
        assert verify(problem, roots.proof).complete


def test_fast_arithmetic_takes_boxes_as_well():
    with by_the_tree():
        (root,) = enumerate_roots(degenerate_integers(2)[0], 0, arithmetic="fast")
    assert (root.enclosure, root.regular) == (None, False)


@pytest.mark.parametrize("seed", [48, 68])
def test_what_stays_open_says_why_and_the_hint_helps(seed):
    """Two roots meet at the solution: with another load there are none or both, beside those that are known."""
    problem, lam, *_ = degenerate_integers(seed)
    roots = enumerate_roots(problem, 0, max_nodes=200)
    (region,) = roots.undecided
    assert region.reason == Cause.EQUALITY.value
    assert "perturb the load" in region.hint
    low, high = region.bounds.lambda_n.T
    assert np.all((low - 1e-12 <= lam[:, 0]) & (lam[:, 0] <= high + 1e-12))
    assert (len(roots), roots.at_least, roots.index_sum) == (1, 1, None)
    sums = set()
    for sign in (-1, 1):
        change = 1e-4 * sign * np.max(np.abs(problem.f)) * np.random.default_rng(5).normal(size=problem.n)
        near = all_roots(anew(problem, f=problem.f + change), 0)
        assert near.index_sum == 1
        sums.add(len(near))
    assert sums == {1, 3}
