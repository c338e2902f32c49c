"""Strongly coupled nodes in 3D: against Newton's method from many starts, and against successive approximations."""

import numpy as np
import oracles3d
import pytest
from problems3d import forces, from_compliance, random_coupled, unmatched

import enumsol
from enumsol import enumerate_roots


@pytest.mark.parametrize(("seed", "p"), [(4, 2), (6, 2), (3, 3), (6, 3)])
def test_newton_from_many_starts_finds_no_other(seed, p):
    rng = np.random.default_rng(seed)
    counts, complete = set(), 0
    for k in range(10):
        S, g, F = random_coupled(rng, p)
        found = oracles3d.newton_set(S, g, F, 100 * p, rng)
        roots = enumerate_roots(from_compliance(S, g, tuple(F.T)), 0)
        missed, _ = unmatched(roots, found)
        assert len(found) - len(missed) <= len(roots)
        for root in roots:
            lam = forces(root)
            assert oracles3d.violation(S, g, F, lam) < 1e-9, k
            assert oracles3d.index(S, g, F, lam) == root.index, k
        complete += roots.complete
        if roots.complete:
            assert not missed, k
            assert roots.index_sum == 1, k
        counts.add(len(roots))
    assert max(counts) >= 3
    assert complete >= 9


def test_what_successive_approximations_reach():
    # every limit is a root, and roots of index -1 are limits of none
    rng = np.random.default_rng(5)
    several = 0
    for _ in range(30):
        S, g, F = random_coupled(rng, 2)
        problem = from_compliance(S, g, tuple(F.T))
        roots = enumerate_roots(problem, 0)
        if not roots.complete or len(roots) < 3:
            continue
        several += 1
        starts = [0.0, *(root.lambda_n for root in roots), *rng.exponential(size=(6, 2))]
        limits = [enumsol.successive_approximations(problem, 0, start, max_iterations=300) for start in starts]
        missed, _ = unmatched(roots, [forces(limit) for limit in limits if limit.converged])
        assert not missed
        # from starts beside the roots themselves
        away = [enumsol.successive_approximations(problem, 0, s, max_iterations=300) for s in [0.0, *starts[-6:]]]
        _, unreached = unmatched(roots, [forces(limit) for limit in away if limit.converged])
        assert {k for k, root in enumerate(roots) if root.index == -1} <= set(unreached)
    assert several >= 3
