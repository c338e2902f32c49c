"""Norms on a mesh: known functions, the supremum that defines the dual norm, powers of h, bad input."""

import numpy as np
import pytest
import scipy.linalg
from refusals import bad_argument

from enumsol import fem, gallery


@pytest.mark.parametrize("cells", ["hexahedra", "tetrahedra"])
def test_norm_of_a_linear_displacement(cells):
    problem = gallery.block3d(4, 3, 2, size=(2.0, 1.5, 1.0), cells=cells)
    norms = fem.h1_norms(problem)
    u = (problem.mesh.points[:, :1] * [1.0, 2.0, 2.0]).ravel()[problem.mesh.dofs]
    # |u| = 3 x on (0, 2) x (0, 1.5) x (0, 1): squares 9 x^2 and 9
    assert norms.of_displacement(u) ** 2 == pytest.approx(9 * (8 / 3 * 1.5 + 2 * 1.5))
    assert norms.of_slip(np.full(problem.p, 2.0)) ** 2 == pytest.approx(4 * problem.areas.sum())


def test_norm_of_forces_is_the_supremum():
    problem = gallery.block3d(3, 2, 2, multipliers="elements", ratio=1)
    norms = fem.h1_norms(problem)
    G, Bn = norms.G.toarray(), problem.Bn.toarray()
    rng = np.random.default_rng(0)
    mu = rng.normal(size=problem.p)
    tried = [abs(mu @ Bn @ v) / norms.of_displacement(v) for v in rng.normal(size=(200, problem.n))]
    assert max(tried) <= norms.of_force(mu)
    # the square is the eigenvalue of the pair (b b', G)
    b = Bn.T @ mu
    assert norms.of_force(mu) ** 2 == pytest.approx(scipy.linalg.eigh(np.outer(b, b), G, eigvals_only=True)[-1])


@pytest.mark.slow
def test_smooth_pressures_have_a_norm_that_hardly_depends_on_the_mesh_and_rough_ones_lose_half_a_power():
    smooth, rough = [], []
    for n in (4, 8, 16):
        problem = gallery.block3d(n, n, max(n // 4, 2), size=(1, 1, 0.5))
        norms = fem.h1_norms(problem)
        smooth.append(norms.of_force(problem.areas * problem.coordinates[:, 0]))
        checker = np.round(problem.coordinates[:, :2] * n).astype(int).sum(axis=1) % 2
        rough.append(norms.of_force(problem.areas * (2 * checker - 1)))
    assert np.ptp(smooth) < 0.1 * max(smooth)
    # oscillating at the scale of the mesh: the norm of H^(-1/2) falls, about like h^(1/2)
    assert np.all(np.array(rough[:-1]) / rough[1:] > 1.3)


def test_bad_arguments_are_named():
    bad_argument("problem has no mesh or no areas", fem.h1_norms, gallery.one_node_3d())
    bad_argument("problem is a ContactProblem; expected a ContactProblem3D", fem.h1_norms, gallery.one_node_triangle())
    norms = fem.h1_norms(gallery.block3d(1, 1, 1))
    bad_argument(r"mu has shape \(3,\); expected \(2,\)", norms.of_force, [1, 2, 3])
