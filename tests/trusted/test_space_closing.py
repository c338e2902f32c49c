"""What the test of an only solution in 3D concludes holds for all data in wide balls (theory, section 12.6)."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from effort import some
from problems3d import from_compliance, random_compliance

from enumsol.model.statuses import UNDECIDED
from enumsol.search.space.space_fathoming import SpaceCloser
from enumsol.search.space.space_newton import Isotropic
from enumsol.search.space.space_search import SpaceSolvers
from enumsol.trusted.space.leaves import SpaceRoot
from enumsol.trusted.space.space_uniqueness import (
    LARGEST_UNIT,
    LooseSolution,
    SpaceWeights,
    lone_root,
    only_solution_in_space,
)


def proposed(solvers):
    """All that is proposed where nothing is proven."""
    taken = []
    SpaceCloser(solvers.system, SimpleNamespace(close=lambda *given: taken.append(given))).whole()
    return taken


def random_solvers(rng, degenerate):
    p = int(rng.integers(1, 4))
    S = random_compliance(rng, p)
    F = 10.0 ** rng.uniform(-0.5, 0.2, (p, 2))
    if rng.random() < 0.3:
        F[rng.integers(p), rng.integers(2)] = 0.0
    g = rng.normal(size=3 * p)
    if degenerate:
        lam, w = np.zeros((p, 3)), np.zeros((p, 3))
        for i in range(p):
            n, d = rng.exponential() + 0.2, rng.normal(size=2)
            tau, kind = d / np.hypot(*d), rng.integers(4)
            lam[i] = [0, 0, 0] if kind < 2 else [n, *(n * F[i] * tau)]
            w[i] = [0, 0, 0] if kind in (1, 2) else [0, *(tau / np.where(F[i] > 0, F[i], 1.0))]
        g = S @ lam.ravel(order="F") + w.ravel(order="F")
    return SpaceSolvers(from_compliance(S, g, tuple(F.T)), 0.0, "verified")


def a_member(enclosed, rng):
    """S and g in the balls, mostly far from their middles."""
    signs = rng.choice([-1.0, 1.0, 0.3], enclosed.S.shape)
    S = enclosed.S + np.triu(signs) * enclosed.S_rad + np.triu(signs, 1).T * enclosed.S_rad.T
    return S, enclosed.g + rng.choice([-1.0, 1.0, 0.3], len(enclosed.g)) * enclosed.g_rad


@pytest.mark.slow
@pytest.mark.parametrize("degenerate", [False, True])
def test_solutions_for_all_data_lie_in_the_balls(degenerate):
    rng, concluded, nearest = np.random.default_rng(4), {SpaceRoot: 0, LooseSolution: 0}, 0.0
    for _ in range(some(20, of=60)):
        solvers = random_solvers(rng, degenerate)
        width = 10.0 ** rng.uniform(-9, -3.5)
        S, g = solvers.enclosed.S, solvers.enclosed.g
        enclosed = replace(solvers.enclosed, S_rad=np.full_like(S, width), g_rad=np.full_like(g, width))
        for numbers, codes, normal in proposed(solvers):
            whole = (UNDECIDED,) * len(normal)
            found = only_solution_in_space(enclosed, numbers, normal)
            if codes:
                found = lone_root(enclosed, whole, numbers, codes)
            if found is None:
                continue
            concluded[type(found)] += 1
            for _ in range(5):
                member, load = a_member(enclosed, rng)
                system = replace(solvers.system, S=member, g=load)
                problem = Isotropic.of(system)
                y = problem.solution()
                w = problem.displacements(y)
                off = np.abs(y / system.unit - found.y.mid) - found.y.rad
                assert np.max(off) <= 1e-9
                nearest = max(nearest, float(np.max((off + found.y.rad) / (found.y.rad + 1e-12))))
                assert np.all(np.abs(w * system.unit - found.w.mid) <= found.w.rad + 1e-8)
                if isinstance(found, LooseSolution):
                    pairs = (np.column_stack([part[: system.p], system.tangential(part)]) for part in (y, w))
                    statuses(found, *pairs, system.tau >= 0)
    assert concluded[LooseSolution] > some(5, of=20)
    assert degenerate or concluded[SpaceRoot] > some(5, of=20)
    # balls are not so wide that this would not tell
    assert nearest > 0.02


def statuses(found, y, w, taus):
    """Statuses that clearly hold are among those that may."""
    for i in range(len(y)):
        n, room, slip = y[i, 0], y[i, 0] - np.linalg.norm(y[i, 1:]), np.linalg.norm(w[i, 1:])
        assert found.open[i] or n > -1e-9
        assert found.open[i] or w[i, 0] > -1e-8
        if w[i, 0] < -1e-8:
            assert found.open[i]
        elif n > 1e-8 and np.any(taus[i]):
            assert found.stick[i] or slip > 0
            assert found.stick[i] or room < 1e-8
            assert found.slip[i] or slip < 1e-8


@pytest.mark.slow
def test_the_form_is_definite_for_all_data_and_theta():
    rng, least = np.random.default_rng(8), []
    for _ in range(some(25, of=80)):
        solvers = random_solvers(rng, degenerate=rng.random() < 0.5)
        S, g = solvers.enclosed.S, solvers.enclosed.g
        enclosed = replace(solvers.enclosed, S_rad=np.full_like(S, 10.0 ** rng.uniform(-6, -2.5)), g_rad=0 * g)
        for values, _, _ in proposed(solvers)[:1]:
            numbers = SpaceWeights.of(enclosed, values)
            form = None if numbers is None else numbers.form(enclosed)
            if form is None:
                continue
            for _ in range(5):
                Q = of_member(enclosed, a_member(enclosed, rng)[0], numbers, rng)
                sizes = np.linalg.eigvalsh(Q)
                assert sizes[0] >= form.least
                least.append(form.least / sizes[0])
    assert len(least) > some(30, of=100)
    assert max(least) > 0.5


def of_member(enclosed, S, numbers, rng):
    """Q for one S, with any theta where the numbers serve any, node by node from its definition."""
    m, Q = len(S), np.zeros_like(S)
    for i, places in enumerate(enclosed.tau):
        t = places[places >= 0]
        theta, nu = numbers.theta[i][places >= 0], numbers.nu[i][places >= 0]
        if numbers.wide[i] > 0:
            theta = rng.normal(size=len(t))
            theta /= np.linalg.norm(theta)
        unit = enclosed.unit[t]
        pushed = numbers.mu[i] * np.eye(m)[i] + (nu * unit) @ np.eye(m)[t]
        Q += np.outer(pushed, S[i])
        for k, theta_k, unit_k in zip(t, theta, unit, strict=True):
            turned = unit_k * np.eye(m)[k] - theta_k * np.eye(m)[i]
            Q += numbers.kappa[i] * np.outer(turned, S[k] / unit_k)
    return 0.5 * (Q + Q.T)


def test_numbers_are_refused_where_they_make_no_sense():
    enclosed = SpaceSolvers(from_compliance(np.eye(6), np.ones(6), ((0.5, 0.3), (0.2, 0.0))), 0.0, "verified").enclosed
    # two nodes, the second one with one tau: mu, kappa, wide; nu; theta
    right = np.array([1.0, 1, 1, 1, 0, 0, *(0.0, 0, 0), *(0.6, 0.8, -1)])
    assert SpaceWeights.of(enclosed, right) is not None
    for place, value in (
        *((0, 0.0), (1, -1.0), (2, 0.0), (3, -0.0), (4, -1e-9), (4, 1.0), (5, 1e-9), (6, 1.1), (7, -1.1), (8, 1.01)),
        *((9, 0.61), (10, 0.9), (11, 1.001), (11, -1.0 - 1e-12), (0, np.nan), (3, np.inf), (11, np.nan), (6, -np.inf)),
    ):
        numbers = right.copy()
        numbers[place] = value
        assert SpaceWeights.of(enclosed, numbers) is None, (place, value)
    long = np.concatenate([right[:6], [0.8, 0.7], right[8:]])
    for numbers in (right[:-1], np.append(right, 0.0), right[:0], right.reshape(2, 6), long):
        assert SpaceWeights.of(enclosed, numbers) is None


def test_points_that_make_no_sense():
    solvers = SpaceSolvers(from_compliance(np.eye(3), np.array([1.0, 0.1, 0]), 0.5), 0.0, "verified")
    (numbers, _, normal) = proposed(solvers)[-1]
    assert only_solution_in_space(solvers.enclosed, numbers, normal) is not None
    for point in ([np.nan], [np.inf], [1.0, 1.0], []):
        assert only_solution_in_space(solvers.enclosed, numbers, np.array(point)) is None
    # a point far away is as good, but for the width of the balls
    far = only_solution_in_space(solvers.enclosed, numbers, normal + 0.3)
    assert far is None or np.all(np.abs(far.y.mid[0] - normal) <= far.y.rad[0])


def test_units_beyond_the_largest_are_refused():
    solvers = SpaceSolvers(from_compliance(np.eye(3), np.ones(3), 0.5), 0.0, "verified")
    numbers, codes, normal = proposed(solvers)[0]
    unit = np.where(np.arange(3) > 0, 2.0 * LARGEST_UNIT, 1.0)
    assert lone_root(solvers.enclosed, (UNDECIDED,) * len(codes), numbers, codes) is not None
    for enclosed in (replace(solvers.enclosed, unit=units) for units in (unit, 1.0 / unit)):
        assert lone_root(enclosed, (UNDECIDED,) * len(codes), numbers, codes) is None
        assert only_solution_in_space(enclosed, numbers, normal) is None
