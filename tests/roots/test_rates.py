"""The problem of rates against the equilibria beside one under a load that is a little larger."""

import numpy as np
import pytest

import enumsol

#: How much of the rate the load is changed by: far less than any slack of the equilibria below.
STEP = 1e-6


def equilibrium(rng):
    """A problem with an equilibrium at which nodes are open, stuck or at their limit, and that equilibrium."""
    p = int(rng.integers(1, 5))
    n = 2 * p + int(rng.integers(0, 3))
    X = rng.normal(size=(n, n))
    A = X @ X.T + 10.0 ** rng.uniform(-2, 0) * np.eye(n)
    rows = np.eye(n)
    F = rng.choice([0.3, 0.8, 2.0], size=p)
    kinds = rng.choice(["open", "stuck", "limit", "limit"], size=p)
    signs = rng.choice([-1.0, 1.0], size=p)
    lambda_n = np.where(kinds == "open", 0.0, rng.uniform(1, 2, p))
    stuck = rng.uniform(-0.5, 0.5, p)
    lambda_t = F * lambda_n * np.where(kinds == "limit", signs, np.where(kinds == "stuck", stuck, 0.0))
    u_n = np.where(kinds == "open", -rng.uniform(0.5, 1, p), 0.0)
    u_t = np.where(kinds == "limit", signs * rng.uniform(0.5, 1, p), np.where(kinds == "open", rng.normal(size=p), 0))
    u = np.concatenate([u_n, u_t, rng.normal(size=n - 2 * p)])
    f = A @ u + rows[:p].T @ lambda_n + rows[p : 2 * p].T @ lambda_t
    problem = enumsol.ContactProblem(A, rows[:p], rows[p : 2 * p], f, friction=F, friction_slope=0)
    return problem, beside(problem, u)[0]


def beside(problem, u):
    """Equilibria near a displacement."""
    return [root for root in enumsol.enumerate_roots(problem, 0) if np.max(np.abs(root.u - u)) < 1e-3]


def check(problem, root, load_rate, friction_rate=0.0, step=STEP):
    """The ways to go on are the equilibria beside the root under a load and with friction that changed a little."""
    found = enumsol.rates(problem, root, load_rate, friction_rate)
    if not found.complete:
        return found
    later = problem.replace(
        f=problem.f + step * load_rate, friction=problem.friction + step * friction_rate, slip_offset=root.u_t
    )
    near = beside(later, root.u)
    assert len(near) == len(found.ways)
    assert found.jumps == (not near)
    for way in found.ways:
        rates = [(other.u - root.u) / step for other in near]
        forces = [(other.lambda_n - root.lambda_n) / step for other in near]
        best = int(np.argmin([np.max(np.abs(rate - way.u)) for rate in rates]))
        assert rates[best] == pytest.approx(way.u, rel=1e-3, abs=1e-3)
        assert forces[best] == pytest.approx(way.lambda_n, rel=1e-3, abs=1e-3)
    return found


@pytest.mark.parametrize("seed", range(40))
def test_ways_to_go_on_are_the_equilibria_of_a_small_step(seed):
    rng = np.random.default_rng(seed)
    problem, root = equilibrium(rng)
    assert check(problem, root, rng.normal(size=problem.n)).complete


@pytest.mark.parametrize("seed", range(12))
def test_friction_that_changes(seed):
    rng = np.random.default_rng([1, seed])
    problem, root = equilibrium(rng)
    friction_rate = rng.normal(size=problem.p)
    assert check(problem, root, rng.normal(size=problem.n), friction_rate).complete
    assert check(problem, root, np.zeros(problem.n), np.abs(friction_rate)).complete


def touching(rng):
    """Integers, so that nodes that touch without force do so exactly, and the root there."""
    p = int(rng.integers(1, 4))
    n = 2 * p + int(rng.integers(0, 2))
    X = rng.integers(-2, 3, size=(n, max(1, n - 2)))
    A = X @ X.T / 4.0 + np.eye(n) * 0.125
    F = rng.choice([0.0, 0.5, 2.0, 4.0], size=p, p=[0.1, 0.3, 0.3, 0.3])
    kinds = ["touching", *(str(rng.choice(["touching", "stuck", "limit"])) for _ in range(p - 1))]
    w, lam = np.zeros(2 * p), np.zeros(2 * p)
    for i, kind in enumerate(kinds):
        s = float(rng.choice([-1, 1]))
        w[p + i] = s if kind != "stuck" else 0.0
        lam[i] = 0.0 if kind == "touching" else 2.0
        lam[p + i] = s * F[i] * lam[i] * (0.5 if kind == "stuck" else 1.0)
    u = np.concatenate([w, rng.integers(-1, 2, n - 2 * p)])
    rows = np.eye(n)
    problem = enumsol.ContactProblem(A, rows[:p], rows[p : 2 * p], A @ u + rows[: 2 * p].T @ lam, friction=F)
    [root] = beside(problem, u)
    return problem, root


def test_nodes_that_touch_without_force_open_stick_or_slip():
    counts, several = {"opens": 0, "slides": 0, "sticks": 0}, 0
    for seed in range(24):
        rng = np.random.default_rng([2, seed])
        problem, root = touching(rng)
        friction_rate = np.where(problem.friction > 0, rng.normal(size=problem.p), 0.0)
        found = check(problem, root, rng.normal(size=problem.n), friction_rate, 2.0**-24)
        assert found.complete, found.reason
        several += len(found.ways) > 1
        unloaded = [i for i, active in enumerate(root.active) if "OPEN" in str(active)]
        for way in found.ways:
            counts["opens"] += len(way.opens)
            counts["slides"] += len(set(unloaded) & {*way.slides})
            counts["sticks"] += len(set(unloaded) - {*way.slides} - {*way.opens})
            assert {*way.opens} <= {*unloaded}
    assert min(*counts.values(), several) >= 2, (counts, several)


def test_in_space_friction_changes_along_axes():
    """A node slides on where friction along an axis becomes less, and sticks where it becomes more."""
    A, rows = np.diag([2.0, 1.0, 4.0]), np.eye(3)
    friction, lam, w = (0.5, 0.25), np.array([2.0, 0.6, 0.4]), np.array([0.0, 1.2, 3.2])
    problem = enumsol.ContactProblem3D(A, rows[:1], rows[1:2], rows[2:], A @ w + lam, friction=friction)
    [root] = beside(problem, w)
    (more,) = enumsol.rates(problem, root, np.zeros(3), [[0.0, 1.0]]).ways
    assert (more.slides, np.max(np.abs(more.u))) == ((), 0)
    (way,) = enumsol.rates(problem, root, np.zeros(3), [[0.0, -1.0]]).ways
    # to first order it goes on along d / F = (1.2, 3.2), where d'(y_t / F) = d_2^2 lambda_n F_2' / F_2
    along = np.array([1.2, 3.2])
    assert way.u[1] / way.u[2] == pytest.approx(along[0] / along[1])
    y = -A @ way.u
    assert 0.6 * y[1] / 0.5 + 0.8 * y[2] / 0.25 == pytest.approx(-0.64 * 2 / 0.25)


def test_a_taper_that_slides_jumps_when_it_is_pulled_harder():
    problem = enumsol.gallery.get("taper-8").build()
    sliding = enumsol.enumerate_roots(problem, alpha=0.2)[1]
    assert enumsol.rates(problem, sliding, problem.f).jumps
    back = enumsol.rates(problem, sliding, -problem.f)
    assert back.ways
    assert back.complete


def test_a_body_that_nothing_holds_goes_on_in_balance():
    problem = enumsol.gallery.block_on_table()
    root = enumsol.enumerate_roots(problem, alpha=0)[0]
    (way,) = enumsol.rates(problem, root, problem.f).ways
    forces = np.concatenate([way.lambda_n, way.lambda_t])
    out_of_balance = problem.rigid_modes.T @ (problem.f - problem.contact_rows.T @ forces)
    assert out_of_balance == pytest.approx(0, abs=1e-9 * np.max(np.abs(problem.f)))


def test_bad_rates_are_refused():
    problem = enumsol.gallery.one_node_triangle()
    roots = enumsol.enumerate_roots(problem, alpha=5)
    with pytest.raises(enumsol.errors.EnumsolError, match="load_rate has shape"):
        enumsol.rates(problem, roots[0], [1.0])
    with pytest.raises(enumsol.errors.InvalidArgumentError, match="root solves another problem"):
        enumsol.rates(problem.replace(gap=1.0), roots[0], [1.0, 0.0])
    with pytest.raises(enumsol.errors.InvalidArgumentError, match=r"friction_rate has shape \(2,\)"):
        enumsol.rates(problem, roots[0], [1.0, 0.0], [1.0, 2.0])
    smooth = problem.replace(friction=0.0, friction_slope=0.0)
    held = enumsol.enumerate_roots(smooth.replace(f=[1.0, 0.0]), alpha=0)
    with pytest.raises(enumsol.errors.InvalidArgumentError, match="is loaded and has no friction at root"):
        enumsol.rates(held[0].problem, held[0], [1.0, 0.0], 1.0)
    fast = enumsol.enumerate_roots(problem, alpha=5, arithmetic="fast")
    assert not enumsol.rates(problem, fast[0], [1.0, 0.0]).complete
