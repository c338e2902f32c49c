"""Bodies that weak springs hold almost free: what counts as converged is near a proven root, whatever the springs."""

from types import SimpleNamespace

import numpy as np
import pytest
from alike import assert_same
from complete import all_roots, limit_of, read_back
from problems3d import block_on_springs

import enumsol
from enumsol import fem
from enumsol.fixed_points import Outcome, fixed_point_residual

PLANE, SQUARE = fem.rectangle(4, 2), fem.rectangle(4, 4)


def plane(rng, spring, mesh=PLANE):
    """A block pressed on the ground and pulled, every node on springs."""
    forces = np.zeros_like(mesh.points)
    top = mesh.points[:, 1] > np.max(mesh.points[:, 1]) - 1e-9
    forces[top] = np.array([0.3, -1.0]) * rng.uniform(0.2, 1.0, (np.count_nonzero(top), 2))
    return fem.contact_problem(
        mesh.points, mesh.triangles, tuple(rng.uniform(0.5, 2.0, 2)), contact=mesh.bottom, normals=(0.0, -1.0),
        springs=(spring, spring), forces=forces, friction=rng.uniform(0.2, 0.7),
    )  # fmt: skip


def square(rng, spring):
    """The same with more contact nodes."""
    return plane(rng, spring, SQUARE)


def distance(found, roots):
    """From the nearest root, relative to the largest force."""
    apart = []
    for root in roots:
        largest = np.max(np.abs(root.lambda_n))
        pairs = ((root.lambda_n, found.lambda_n), (root.lambda_t, found.lambda_t))
        apart.append(max(float(np.max(np.abs(one - other))) for one, other in pairs) / largest)
    return min(apart)


def check(found, roots):
    """Converged is near a root; what is not says so, and that rounding is the reason."""
    if found.converged:
        assert found.rounding <= found.tolerance
        assert distance(found, roots) < 10 * found.tolerance
    else:
        assert found.outcome is Outcome.ROUNDING
        assert "rounding still changes contact forces by" in found.why
        assert found.tolerance < found.rounding < 1e-5
        assert distance(found, roots) < 1e-4


@pytest.mark.few(5, 2)
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("spring", [0.1, 1e-3, 1e-6, 1e-8])
def test_proven_roots_in_2d(spring, seed):
    problem = plane(np.random.default_rng([seed, 41]), spring)
    roots = all_roots(problem, 0)
    found = enumsol.successive_approximations(problem, 0)
    check(found, roots)
    assert found.converged or spring < 1e-3


@pytest.mark.few(3, 2)
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("spring", [0.1, 1e-3])
def test_proven_roots_in_3d(spring, seed):
    problem = block_on_springs(np.random.default_rng([seed, 41]), spring)
    roots = enumsol.enumerate_roots(problem, 0, max_nodes=900)  # with weak springs others may stay undecided
    assert len(roots) == 1
    found = limit_of(problem, 0)
    check(found, roots)


def planted(rng, spring):
    """A problem in 3D with a solution that is known to rounding, of open, sticking and sliding nodes."""
    body = block_on_springs(rng, spring)
    u, p = rng.normal(size=body.n), body.p
    normal = rng.uniform(0.5, 2.0, p) * (np.arange(p) != 0)
    angle, F = rng.uniform(0.0, 2 * np.pi, p), 0.3
    along = np.array([np.cos(angle), np.sin(angle)])
    slides = np.arange(p) % 3 == 1
    tangential = along * F * normal * np.where(slides, 1.0, 0.5)
    offsets = np.array([body.Bt1 @ u, body.Bt2 @ u]) - along * np.where(slides | (normal == 0), 0.1, 0.0)
    load = body.A @ u + body.contact_rows.T @ np.concatenate([normal, *tangential])
    gap = body.Bn @ u + 0.2 * (normal == 0)
    problem = body.replace(f=load, gap=gap, friction=F, slip_offset=offsets.T)
    return problem, SimpleNamespace(lambda_n=normal, lambda_t=tangential.T)


@pytest.mark.few(2, 2)
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("spring", [1e-4, 1e-6, 1e-8])
def test_planted_solutions_in_3d(spring, seed):
    problem, solution = planted(np.random.default_rng([seed, 43]), spring)
    found = enumsol.successive_approximations(problem, 0)
    check(found, [solution])
    assert found.converged or spring < 1e-4


def test_uncertain_forces_are_told_and_kept(tmp_path):
    problem = plane(np.random.default_rng(3), 1e-8)
    found = enumsol.successive_approximations(problem, 0)
    assert (found.outcome, found.converged) == (Outcome.ROUNDING, False)
    assert_same(read_back(found, tmp_path / "limit.npz", problem), found, "outcome", "rounding", "why")
    # with a tolerance that can be had it is a solution
    loose = limit_of(problem, 0, tolerance=1e-6)
    assert distance(loose, enumsol.enumerate_roots(problem, 0)) < 1e-5


@pytest.mark.parametrize("spring", [1e-4, 1e-6])
def test_mixing_is_corrected_too(spring):
    problem = plane(np.random.default_rng([0, 41]), spring)
    check(enumsol.successive_approximations(problem, 0, anderson=3), enumsol.enumerate_roots(problem, 0))


def moved(rng, problem, found, size):
    """The state with its forces off by ``size`` of the largest, in directions that S resists least but one."""
    held = np.tile(found.lambda_n > 0, found.forces.size // problem.p)
    directions = np.linalg.eigh(problem.condensed.S[np.ix_(held, held)])[1][:, : np.count_nonzero(held) // 2]
    change = np.zeros(held.size)
    change[held] = directions @ rng.normal(size=directions.shape[1])
    forces = found.forces + change * size * np.max(np.abs(found.forces)) / np.max(np.abs(change))
    normal, tangential = np.split(forces, [problem.p])
    lambda_t = tangential.reshape(-1, problem.p).T.reshape(found.lambda_t.shape)
    return SimpleNamespace(alpha=0, lambda_n=normal, lambda_t=lambda_t, u_t=found.u_t)


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("spring", [1e-1, 1e-4, 1e-5, 1e-6, 1e-7])
@pytest.mark.parametrize("body", [square, block_on_springs])
def test_roots_and_limits_are_fixed_points_and_nothing_beside_them(body, spring):
    for seed in range(2):
        rng = np.random.default_rng([seed, 41])
        problem = body(rng, spring)
        roots = enumsol.enumerate_roots(problem, 0, max_nodes=100)
        found = enumsol.successive_approximations(problem, 0)
        assert len(roots) or (body is block_on_springs and spring < 0.1)  # with weak springs some stay undecided
        for root in roots:
            assert enumsol.is_fixed_point(problem, root)
        # where rounding kept the iteration from its tolerance it is as near as it says
        assert fixed_point_residual(problem, found) < (1e-9 if found.converged else 10 * found.rounding)
        for size in (1e-3, 1e-5, 1e-6):
            assert not enumsol.is_fixed_point(problem, moved(rng, problem, found, size))
        for bound in (0.0, 1.001 * found.lambda_n, 0.5 * found.lambda_n):
            other = enumsol.solve_tresca(problem, bound, 0)
            assert distance(other, [found]) < 1e-9 or not enumsol.is_fixed_point(problem, other)
