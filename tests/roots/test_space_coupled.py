"""Strongly coupled nodes in 3D: against Newton's method from many starts, and against successive approximations."""

import numpy as np
import oracles3d
import pytest
from problems3d import forces, from_compliance, random_coupled, unmatched

import enumsol
from enumsol import enumerate_roots


@pytest.mark.few(0, 1)
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


@pytest.mark.long
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
        assert unmatched(roots, [forces(limit) for limit in limits if limit.converged])[0] == []
        # from starts beside the roots themselves
        away = [enumsol.successive_approximations(problem, 0, s, max_iterations=300) for s in [0.0, *starts[-6:]]]
        _, unreached = unmatched(roots, [forces(limit) for limit in away if limit.converged])
        assert {k for k, root in enumerate(roots) if root.index == -1} <= set(unreached)
    assert several >= 3


#: lambda_n, tau / lambda_n and w of a node at a border: grazing, stick at its limit along an axis and beside it
BORDERS = {
    "grazing": (0, (0, 0), (0, 1, -2)),
    "stick at its limit": (1, (1, 0), (0, 0, 0)),
    "stick at its limit, oblique": (5, (0.6, 0.8), (0, 0, 0)),
}
REGULAR = {"open": (0, (0, 0), (-1, 0, 1)), "stick": (2, (0.5, 0), (0, 0, 0)), "slip": (1, (-1, 0), (0, -1, 0))}


@pytest.mark.parametrize("beside", REGULAR)
@pytest.mark.parametrize("border", BORDERS)
def test_a_node_at_a_border_is_undecided_or_right(border, beside):
    rng = np.random.default_rng(9)
    X = rng.integers(-1, 2, size=(6, 6))
    A, F, nodes = X @ X.T + np.eye(6), np.array([[1.0, 1.0], [0.5, 2.0]]), (BORDERS[border], REGULAR[beside])
    lam, w = np.zeros(6), np.zeros(6)
    for i, (n, tau, here) in enumerate(nodes):
        lam[[i, 2 + i, 4 + i]] = n * np.array([1, *(F[i] * tau)])
        w[[i, 2 + i, 4 + i]] = here
    f, S, rows = A @ w + lam, np.linalg.inv(A), np.eye(6)
    assert oracles3d.violation(S, S @ f, F, lam) < 1e-12
    problem = enumsol.ContactProblem3D(A, rows[:2], rows[2:4], rows[4:], f, friction=tuple(F.T))
    roots = enumerate_roots(problem, 0, max_nodes=400)
    here = [root for root in roots if unmatched([root], [lam]) == ([], [])]
    assert here or roots.undecided
    assert not roots.complete or (len(here) == 1 and roots.index_sum == 1)
    for root in roots:
        assert oracles3d.violation(S, S @ f, F, forces(root)) < 1e-9
    if not here:
        # the part of the tree that may hold it is among those left open
        assert any(str(part.statuses[1]) in (beside, "None", "contact") for part in roots.undecided)
