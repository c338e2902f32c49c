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


@pytest.mark.parametrize("seed", range(40))
def test_ways_to_go_on_are_the_equilibria_of_a_small_step(seed):
    rng = np.random.default_rng(seed)
    problem, root = equilibrium(rng)
    load_rate = rng.normal(size=problem.n)
    found = enumsol.rates(problem, root, load_rate)
    assert found.complete
    near = beside(problem.replace(f=problem.f + STEP * load_rate, slip_offset=root.u_t), root.u)
    assert len(near) == len(found.ways)
    assert found.jumps == (not near)
    for way in found.ways:
        rates = [(other.u - root.u) / STEP for other in near]
        forces = [(other.lambda_n - root.lambda_n) / STEP for other in near]
        best = int(np.argmin([np.max(np.abs(rate - way.u)) for rate in rates]))
        assert rates[best] == pytest.approx(way.u, rel=1e-3, abs=1e-3)
        assert forces[best] == pytest.approx(way.lambda_n, rel=1e-3, abs=1e-3)


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
    fast = enumsol.enumerate_roots(problem, alpha=5, arithmetic="fast")
    assert not enumsol.rates(problem, fast[0], [1.0, 0.0]).complete
