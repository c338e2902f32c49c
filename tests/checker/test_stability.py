"""Within the stability radius the perturbed problem has the same roots, by exact enumeration."""

from fractions import Fraction

import numpy as np
import pytest
from effort import some
from generators import fe_compliance, from_condensed, named, planted_load, random_load
from helpers.floating_oracle import block_on_table, random_body
from oracles import exact_condense
from proof_tools import proof_of, put, records_of

from enumsol import ContactProblem, enumerate_roots, gallery
from enumsol.checker.stability import LARGEST, stability_radius


def sizes(S, g):
    root = np.sqrt(np.diagonal(S))
    return np.outer(root, root), root * np.max(np.abs(g) / root)


def step(rng, shape, corner):
    return rng.choice([-1.0, 1.0], size=shape) if corner else rng.uniform(-1, 1, size=shape)


def perturbed(rng, S, g, F, radius, *, corner):
    """Data at a relative distance of at most radius, in a corner of the box or anywhere in it."""
    S_size, g_size = sizes(S, g)
    change = step(rng, S.shape, corner)
    change = np.triu(change) + np.triu(change, 1).T
    g = g + radius * step(rng, g.shape, corner) * g_size
    return S + radius * change * S_size, g, F * (1 + radius * step(rng, F.shape, corner))


def condensed(problem):
    return tuple(np.array(part, dtype=float) for part in exact_condense(problem, 0))


def selections(roots):
    """Statuses and indices, without names for the slip of nodes that have no friction."""

    def name(status, F):
        return status.value if F > 0 or status.value == "open" else "contact"

    return sorted((tuple(map(name, root.statuses, root.problem.friction_at(0))), root.index) for root in roots)


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
            assert selections(exact) == selections(roots)
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
    records = records_of(enumerate_roots(problem, 5.0).proof)
    assert stability_radius(problem, proof_of(put(records, (-1, "roots"), lambda roots: roots + 1))) == 0.0


def test_larger_bodies_have_one():
    for name in ("wedge-8-3", "clamped-block-16"):
        problem, alpha = named(name)
        assert stability_radius(problem, enumerate_roots(problem, alpha).proof) > 1e-12


def shaken(rng, problem, radius, *, corner):
    """A body that nothing holds with other friction, gap, slip offset and load, within a radius."""
    held = problem.on_springs.condensed
    root = np.sqrt(np.diagonal(held.S))
    h, rows = problem.rigid_modes.T @ problem.f, problem.contact_rows.toarray()
    weights = (np.abs(rows @ problem.rigid_modes).T / root).sum(1)
    size = max(np.max(np.abs(held.g0) / root), np.max(np.abs(h)[weights > 0] / weights[weights > 0], initial=0.0))
    change = rows.T @ step(rng, len(rows), corner) + rng.choice([0.0, 1.0]) * rng.normal(size=problem.n)
    moved = np.abs(rows @ problem.on_springs.factorization.solve(change)) / (root * size)
    lifted = np.abs(problem.rigid_modes.T @ change) / np.where(weights > 0, weights * size, 1.0)
    largest = max(np.max(moved), np.max(lifted[weights > 0], initial=0.0))
    if np.any(lifted[weights == 0] > 0) or largest == 0:
        change, largest = np.zeros(problem.n), 1.0
    f, free = problem.f + 0.499 * radius / largest * change, 0.499 * radius * root * size * step(rng, len(root), corner)
    gap, offset = problem.gap + free[: problem.p], problem.slip_offset + free[problem.p :]
    F = problem.friction_at(0) * (1 + 0.999 * radius * step(rng, problem.p, corner))
    return problem.replace(f=f, gap=gap, slip_offset=offset, friction=F, friction_slope=0.0)


@pytest.mark.few(0, 4)
@pytest.mark.parametrize("seed", range(60))
def test_perturbed_bodies_that_nothing_holds_have_the_same_roots(seed):
    rng = np.random.default_rng(seed)
    problem = random_body(seed + 500)
    problem = problem.replace(friction=problem.friction_at(0), friction_slope=0.0)
    roots = enumerate_roots(problem, 0.0)
    radius = stability_radius(problem, roots.proof)
    if roots.families or not all(root.regular for root in roots):
        assert radius == 0.0
    for trial in range(4 if radius else 0):
        exact = enumerate_roots(shaken(rng, problem, radius, corner=trial % 2 == 0), 0.0, "exact")
        assert not exact.families
        assert selections(exact) == selections(roots)


@pytest.mark.parametrize("push", [0.5, 0.999, 1.0, 1.001])
def test_a_block_that_nothing_holds(push):
    problem = block_on_table(push=push)
    radius = stability_radius(problem, enumerate_roots(problem, 0.0).proof)
    assert (radius > 0) == (push != 1.0)
    # at 1 it slides
    assert radius <= abs(1 - push)
