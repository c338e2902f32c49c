"""One node in 3D: against all solutions in closed form, on the ends of sectors, and at degenerate data."""

import numpy as np
import oracles3d
import pytest
from complete import all_roots
from effort import some
from problems3d import bounds, forces, from_compliance, random_compliance, random_one_node, unmatched, within

import enumsol
from enumsol import ContactProblem3D, enumerate_roots
from enumsol.model.sectors import start_of


def solutions(S, g, F):
    found, near = oracles3d.one_node(S, g, F)
    return found, [lam for group in found.values() for lam in group], near


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("seed", range(6))
def test_random_data_against_the_closed_form(seed):
    rng = np.random.default_rng(seed)
    counts, undecided = set(), 0
    for k in range(some(25, of=50)):
        S, g, F = random_one_node(rng)
        found, wanted, near = solutions(S, g, F)
        assert near > 1e-9, k
        assert sum(oracles3d.index(S, g, F, lam) for lam in wanted) == 1
        roots = enumerate_roots(from_compliance(S, g, tuple(F.T)), 0)
        missed, invented = unmatched(roots, wanted)
        assert not invented, k
        assert all(sum(not unmatched([root], [lam])[0] for lam in wanted) == 1 for root in roots), k
        undecided += not roots.complete
        if not roots.complete:
            continue
        assert (missed, len(roots)) == ([], len(wanted)), k
        assert sorted(root.index for root in roots) == sorted(oracles3d.index(S, g, F, lam) for lam in wanted), k
        if np.any(F > 0):
            names = [name for name, group in found.items() for _ in group]
            assert sorted(root.statuses[0].value for root in roots) == sorted(names), k
        counts.add(len(roots))
    assert counts == {1, 3}
    assert undecided <= 2


@pytest.mark.parametrize("F", [(0.5, 0.5), (0.5, 0.2), (0.0, 0.5), (0.5, 0.0), (0.0, 0.0)])
def test_slip_along_an_axis_of_symmetry_is_one_root(F):
    for load in ([2, 0], [-2, 0], [0, 2], [0, -2]):
        (root,) = all_roots(ContactProblem3D(np.eye(3), *np.eye(3)[:, None], [1, *load], friction=F), 0)
        assert root.statuses[0].value == ("slip" if np.any(np.multiply(F, load)) or not any(F) else "stick")
        np.testing.assert_allclose(forces(root), [1, *(F * np.sign(load))], rtol=0, atol=1e-12)
        low, high = root.slip_angle[0]
        along = F * np.array(load)
        if np.any(along):
            turns = (np.arctan2(along[1], along[0]) - 0.5 * (low + high)) / (2 * np.pi)
            assert abs(turns - round(turns)) <= high - low < 1e-6


@pytest.mark.parametrize("number", range(4, 32))
def test_slip_along_the_end_of_a_sector_is_one_root(number):
    # the end is a rational point: with S = 1 and this load the root slips exactly along it
    direction = np.array([float(x * (1 << 53)) for x in start_of(number)]) / (1 << 53)
    problem = ContactProblem3D(np.eye(3), *np.eye(3)[:, None], [1, *(2 * direction)], friction=0.5)
    (root,) = all_roots(problem, 0)
    np.testing.assert_allclose(forces(root), [1, *(0.5 * direction)], rtol=0, atol=1e-10)


A = np.array([[3, 1, -1], [1, 2, 0], [-1, 0, 4]])
#: A, f, F and the forces of all solutions
DEGENERATE = {
    "grazing": (np.eye(3), [0, 1, 0], (0.5, 0.5), [[0, 0, 0]]),
    "grazing, coupled": (A, A @ [0, 1, 2], (0.5, 2.0), [[0, 0, 0]]),
    "stick at its limit": (np.eye(3), [2, 1, 0], (0.5, 0.5), [[2, 1, 0]]),
    "stick at its limit, orthotropic": (np.eye(3), [5, 6, 2], (2.0, 0.5), [[5, 6, 2]]),
    "stick at its limit on one axis": (np.eye(3), [2, 1, 3], (0.5, 0.0), [[2, 1, 0]]),
    "grazing without friction": (np.eye(3), [0, 1, 2], (0.0, 0.0), [[0, 0, 0]]),
    "no load": (A, [0, 0, 0], (0.5, 2.0), [[0, 0, 0]]),
    "nearly grazing": (np.eye(3), [2.0**-52, 1, 0], (0.5, 0.5), [[2.0**-52, 2.0**-53, 0]]),
}


@pytest.mark.parametrize("name", DEGENERATE)
def test_degenerate_data_are_undecided_or_right(name):
    matrix, f, F, wanted = DEGENERATE[name]
    wanted = [np.array(lam, dtype=float) for lam in wanted]
    S = np.linalg.inv(matrix)
    assert all(oracles3d.violation(S, S @ f, np.array([F]), lam) < 1e-12 for lam in wanted)
    roots = enumerate_roots(ContactProblem3D(matrix, *np.eye(3)[:, None], f, friction=F), 0)
    for root in roots:
        assert any(within(lam, np.transpose(bounds(root))) for lam in wanted)
    assert roots.complete or roots.undecided
    assert not roots.complete or len(roots) == len(wanted)
    assert len(roots) <= len(wanted)


@pytest.mark.slow
def test_degenerate_integer_data():
    rng = np.random.default_rng(7)
    border = 0
    for k in range(some(25, of=60)):
        X = rng.integers(-2, 3, size=(3, 3))
        matrix, f = X @ X.T + np.eye(3), rng.integers(-2, 3, size=3)
        F = rng.choice([0.0, 0.5, 1.0, 2.0], size=2)
        S = np.linalg.inv(matrix)
        _, wanted, near = solutions(S, S @ f, F[None])
        roots = enumerate_roots(ContactProblem3D(matrix, *np.eye(3)[:, None], f, friction=tuple(F)), 0, max_nodes=5000)
        if np.any(f) and near > 1e-9:
            missed, invented = unmatched(roots, wanted)
            assert not invented, k
            assert not roots.complete or not missed, k
        border += near <= 1e-9
        for root in roots:
            assert oracles3d.violation(S, S @ f, F[None], forces(root)) < 1e-6, k
        assert not roots.complete or not np.any(f) or roots.index_sum == 1, k
    assert border > some(1, of=5)


def test_the_limits_of_successive_approximations_are_roots():
    # of three roots of one node two attract: open and the one with the largest force; the root between them never
    rng = np.random.default_rng(1)
    never = []
    for _ in range(some(40, of=80)):
        S, g, F = random_compliance(rng, 1), rng.normal(size=3), np.full((1, 2), 10 ** rng.uniform(0, 1.5))
        if len(solutions(S, g, F)[1]) < 3:
            continue
        problem = from_compliance(S, g, tuple(F.T))
        roots = all_roots(problem, 0)
        limits = [enumsol.successive_approximations(problem, 0, start) for start in (0.0, *(10.0 ** np.arange(-3, 4)))]
        reached = [forces(limit) for limit in limits if limit.converged]
        missed, unreached = unmatched(roots, reached)
        assert not missed
        never.append([roots[k].index for k in unreached])
    assert len(never) >= some(1, of=3)
    assert all(-1 in indices for indices in never)
