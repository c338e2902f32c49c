"""Within the stability radius the perturbed problem has the same roots, by exact enumeration."""

from fractions import Fraction

import numpy as np
import pytest
from effort import some
from generators import fe_compliance, from_condensed, planted_load, random_load
from oracles import exact_condense
from proof_tools import copied, proof_of, records_of

from enumsol import ContactProblem, enumerate_roots, gallery
from enumsol.checker.stability import LARGEST, stability_radius


def outline(roots):
    return sorted((tuple(s.value for s in root.statuses), root.index) for root in roots)


def sizes(S, g):
    root = np.sqrt(np.diagonal(S))
    return np.outer(root, root), root * np.max(np.abs(g) / root)


def perturbed(rng, S, g, F, radius, *, corner):
    """Data at a relative distance of at most radius, in a corner of the box or anywhere in it."""
    S_size, g_size = sizes(S, g)

    def step(shape):
        return rng.choice([-1.0, 1.0], size=shape) if corner else rng.uniform(-1, 1, size=shape)

    change = step(S.shape)
    change = np.triu(change) + np.triu(change, 1).T
    return S + radius * change * S_size, g + radius * step(g.shape) * g_size, F * (1 + radius * step(F.shape))


def condensed(problem):
    S, g, F = exact_condense(problem, 0)
    return np.array(S, dtype=float), np.array(g, dtype=float), np.array(F, dtype=float)


@pytest.mark.slow
@pytest.mark.parametrize(("p", "count"), [(1, some(6, of=12)), (2, some(4, of=8)), (3, some(2, of=4))])
def test_perturbed_problems_have_the_same_roots(p, count):
    rng = np.random.default_rng([1, p])
    useful = several = 0
    for _ in range(count):
        S = fe_compliance(rng, p) if p > 1 else np.array([[2.0, 0.7], [0.7, 1.5]])
        F = rng.uniform(0.3, 5.0, size=p)
        g = planted_load(rng, S, F) if rng.random() < 0.7 else None
        problem = from_condensed(S, random_load(rng, p) if g is None else g, F)
        roots = enumerate_roots(problem, 0.0)
        radius = stability_radius(problem, roots.proof)
        assert 0 <= radius <= LARGEST
        useful += radius > 1e-8
        several += len(roots) > 1
        if not radius:
            continue
        S, g, F = condensed(problem)
        for trial in range(6):
            # inverting S rounds: stay a hair inside, and check that
            moved = from_condensed(*perturbed(rng, S, g, F, 0.999 * radius, corner=trial % 2 == 0))
            S1, g1, F1 = condensed(moved)
            S_size, g_size = sizes(S, g)
            assert np.all(np.abs(S1 - S) <= radius * S_size)
            assert np.all(np.abs(g1 - g) <= radius * g_size)
            assert np.all(np.abs(F1 - F) <= radius * F)
            exact = enumerate_roots(moved, 0.0, "exact", "exhaustive")
            assert not exact.families
            assert outline(exact) == outline(roots)
    assert useful >= 0.7 * count
    assert several >= count / 4


def test_one_node_reaches_a_fair_share_of_the_true_radius():
    # at alpha = 5 the closed form has three roots as long as alpha > 8/3; nothing but alpha moves
    problem = gallery.one_node_triangle()
    for alpha in (3.0, 5.0, 20.0):
        radius = stability_radius(problem, enumerate_roots(problem, alpha).proof)
        truth = (alpha - 8 / 3) / alpha
        assert truth / 200 < radius < truth


def test_degenerate_roots_have_no_radius():
    problem = gallery.get("one-node-6.3").build()
    assert stability_radius(problem, enumerate_roots(problem, 2.0).proof) == 0.0
    unloaded = ContactProblem(np.eye(2), [[1.0, 0.0]], [[0.0, 1.0]], [0.0, 0.0])
    assert stability_radius(unloaded, enumerate_roots(unloaded, 1.0).proof) == 0.0


def test_radius_shrinks_next_to_a_change_of_status():
    problem = gallery.one_node_triangle()
    radii = []
    for exponent in (1, 3, 5, 7, 9):
        alpha = Fraction(8, 3) + Fraction(1, 10**exponent)
        radii.append(stability_radius(problem, enumerate_roots(problem, alpha).proof))
        assert radii[-1] <= 10.0**-exponent
    assert radii == sorted(radii, reverse=True)
    assert radii[-1] > 1e-12


def test_no_radius_without_a_complete_proof():
    problem = gallery.one_node_triangle()
    roots = enumerate_roots(problem, 5.0, max_nodes=2)
    assert stability_radius(problem, roots.proof) == 0.0
    records = copied(records_of(enumerate_roots(problem, 5.0).proof))
    records[-1]["roots"] += 1
    assert stability_radius(problem, proof_of(records)) == 0.0


def test_larger_bodies_have_one():
    for name in ("wedge-8-3", "clamped-block-16"):
        entry = gallery.get(name)
        problem = entry.build()
        assert stability_radius(problem, enumerate_roots(problem, entry.alpha).proof) > 1e-12
