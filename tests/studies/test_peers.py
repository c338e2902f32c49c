"""The parts of the study of peers that no peer has: one problem put in another form, and deflated Newton."""

import numpy as np
import pytest

import enumsol

NAMES = ("two-node-6.4", "wedge-8-5")


def system_and_forces(name):
    entry = enumsol.gallery.get(name)
    problem = entry.build()
    system = problem.condensed.at(entry.alpha).scaled
    roots = enumsol.enumerate_roots(problem, entry.alpha)
    return system, np.array([[*root.lambda_n, *root.lambda_t] for root in roots]) / system.force


@pytest.mark.parametrize("name", NAMES)
def test_every_root_solves_the_complementarity_problem(name):
    from peers.problems import complementarity, forces

    system, x = system_and_forces(name)
    M, q = complementarity(system)
    n, t, w = x[:, : system.p], x[:, system.p :], system.g - x @ system.S
    z = np.hstack([n, system.F * n - t, np.maximum(-w[:, system.p :], 0.0)])
    assert np.all(z > -1e-9)
    assert np.all(z @ M.T + q > -1e-9)
    assert np.max(np.abs(z * (z @ M.T + q))) < 1e-9
    assert np.allclose(forces(system, z) / system.force, x, rtol=0, atol=1e-14)


@pytest.mark.parametrize("name", NAMES)
def test_newtons_equation_vanishes_at_roots_only_and_has_its_jacobian(name):
    from peers.deflation import residual_and_jacobian

    system, roots = system_and_forces(name)
    assert all(np.max(np.abs(residual_and_jacobian(system, x)[0])) < 1e-12 for x in roots)
    rng = np.random.default_rng(1)
    for x in rng.normal(size=(20, 2 * system.p)):
        value, jacobian = residual_and_jacobian(system, x)
        step = 1e-7 * rng.normal(size=len(x))
        assert np.max(np.abs(value)) > 1e-3
        assert np.allclose(residual_and_jacobian(system, x + step)[0] - value, jacobian @ step, rtol=0, atol=1e-12)


def test_deflation_leaves_the_roots_that_it_has_found():
    from peers.deflation import deflated_newton

    system, known = system_and_forces("two-node-6.4")
    found = np.array(deflated_newton(system, 40, 40)[0]) / system.force
    assert len(found) == len(known) == 5
    assert all(np.min(np.max(np.abs(known - x), axis=1)) < 1e-8 for x in found)
    assert len(deflated_newton(system, 40, 1)[0]) < 5
