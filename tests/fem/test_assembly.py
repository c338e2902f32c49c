"""Assembly of plane-strain bodies: closed forms, rigid motions, patch test, loads, elimination, bad input."""

import numpy as np
import pytest
import scipy.linalg
from parted_meshes import constant_stress
from refusals import bad_argument, bad_problem

from enumsol import fem, gallery


@pytest.fixture
def distorted():
    mesh = fem.rectangle(4, 3, 2.0, 1.0)
    rng = np.random.default_rng(1)
    return mesh.points + rng.uniform(-0.06, 0.06, mesh.points.shape), mesh.triangles


def test_one_triangle_has_the_closed_form():
    rng = np.random.default_rng(0)
    for _ in range(10):
        lam, mu, leg = rng.uniform(0.1, 3.0, 3)
        A = fem.stiffness([[0, 0], [leg, 0], [0, leg]], [[0, 1, 2]], (lam, mu)).toarray()
        # the paper's one-node problem: normal (0, -1), tangent (1, 0) at the right angle
        turn = np.array([[0.0, -1.0], [1.0, 0.0]])
        expected = 0.5 * np.array([[lam + 3 * mu, -(lam + mu)], [-(lam + mu), lam + 3 * mu]])
        assert np.allclose(turn @ A[:2, :2] @ turn.T, expected, rtol=1e-13, atol=1e-13)


def test_scikit_fem_and_closed_form_agree_on_any_triangle():
    rng = np.random.default_rng(2)
    for _ in range(20):
        corners, lame = rng.normal(size=(3, 2)), tuple(rng.uniform(0.1, 3.0, 2))
        A = fem.stiffness(corners, [[2, 0, 1]], lame).toarray()
        assert np.allclose(fem.triangle_stiffness(corners, lame), A, rtol=1e-10, atol=1e-10 * np.max(A))


def test_kernel_holds_the_rigid_motions_only(distorted):
    points, triangles = distorted
    A = fem.stiffness(points, triangles, (1.0, 0.5)).toarray()
    x, y = points.T
    zero, one = np.zeros_like(x), np.ones_like(x)
    motions = np.stack([np.stack(pair, axis=1).ravel() for pair in ((one, zero), (zero, one), (-y, x))], axis=1)
    assert np.max(np.abs(A @ motions)) < 1e-13 * np.max(A)
    values = np.linalg.eigvalsh(A)
    assert np.sum(np.abs(values) < 1e-12 * values[-1]) == 3
    assert values[3] > 1e-4 * values[-1]


def test_patch_test_on_a_distorted_mesh(distorted):
    points, triangles = distorted
    lam, mu = 1.3, 0.7
    gradient = np.array([[0.2, -0.1], [0.4, 0.3]])
    force = (fem.stiffness(points, triangles, (lam, mu)) @ (points @ gradient.T).ravel()).reshape(-1, 2)
    mesh = fem.rectangle(4, 3)
    boundary = np.concatenate([mesh.bottom[:-1], mesh.right[:-1], mesh.top[:0:-1], mesh.left[:0:-1]])
    edges = np.stack([boundary, np.roll(boundary, -1)], axis=1)
    along = points[edges[:, 1]] - points[edges[:, 0]]
    outward = np.stack([along[:, 1], -along[:, 0]], axis=1) / np.linalg.norm(along, axis=1)[:, None]
    # constant stress is in equilibrium with its own tractions on the boundary, and with nothing inside
    tractions = outward @ constant_stress(gradient, (lam, mu))
    assert np.allclose(force, fem.edge_forces(points, edges, tractions), rtol=0, atol=1e-13)


def test_body_forces_have_the_weight_of_the_body(distorted):
    _, triangles = distorted
    forces = fem.body_forces(fem.rectangle(4, 3, 2.0, 1.5).points, triangles, (0.0, -2.0))
    assert np.allclose(forces.sum(axis=0), [0.0, -2.0 * 3.0])
    assert np.all(forces[:, 1] < 0)


def test_held_degrees_of_freedom_are_eliminated(distorted):
    points, triangles = distorted
    mesh = fem.rectangle(4, 3)
    contact = mesh.bottom[1:]
    forces = fem.body_forces(points, triangles, (0.1, -1.0))
    problem = fem.contact_problem(
        points, triangles, (1.0, 1.0), held=mesh.left, contact=contact, normals=(0.0, -2.0), forces=forces, gap=0.1
    )
    free = np.setdiff1d(np.arange(40), [*(2 * mesh.left), *(2 * mesh.left + 1)])
    A = fem.stiffness(points, triangles, (1.0, 1.0)).toarray()
    assert np.allclose(problem.A.toarray(), A[np.ix_(free, free)], rtol=1e-15)
    assert np.array_equal(problem.f, forces.ravel()[free])
    assert problem.node_ids == tuple(int(node) for node in contact)
    assert np.array_equal(problem.coordinates, points[contact])
    u = np.random.default_rng(0).normal(size=40)
    assert np.allclose(problem.Bn @ u[free], -u[2 * contact + 1])
    assert np.allclose(problem.Bt @ u[free], u[2 * contact])


def test_mask_of_held_components_and_springs(distorted):
    points, triangles = distorted
    held = np.zeros((20, 2), dtype=bool)
    held[15:, 1] = True
    springs = np.zeros((20, 2))
    springs[19, 0] = 3.0
    arguments = {"contact": [0, 1], "normals": [[0, -1], [-1, -1]], "held": held}
    problem = fem.contact_problem(points, triangles, (1.0, 1.0), springs=springs, **arguments)
    assert problem.n == 35
    assert np.allclose(problem.Bn.toarray()[1, 2:4], -np.sqrt(0.5))
    bad_problem("free to move as a rigid body", fem.contact_problem, points, triangles, (1.0, 1.0), **arguments)


def test_mesh_is_counterclockwise_and_fills_its_outline():
    for mesh, area in ((fem.rectangle(3, 2, 2.0, 0.5), 1.0), (fem.trapezoid(4, 3, 1.0, 2.0, 1.0), 1.5)):
        a, b, c = (mesh.points[mesh.triangles[:, k]] for k in range(3))
        areas = 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
        assert np.all(areas > 0)
        assert np.isclose(areas.sum(), area)


def test_assembly_stays_sparse():
    mesh = fem.rectangle(99, 99)
    A = fem.stiffness(mesh.points, mesh.triangles, (1.0, 1.0))
    assert A.shape == (20_000, 20_000)
    assert A.nnz < 14 * A.shape[0]


TRIANGLE = ([[0, 0], [1, 0], [0, 1]], [[0, 1, 2]], (1.0, 1.0))


def at_one_node(**options):
    return fem.contact_problem(*TRIANGLE, **({"contact": [0], "normals": (0, -1), "held": [1, 2]} | options))


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: fem.stiffness([[0, 0, 0]], [[0, 0, 0]], (1, 1)), r"points has shape \(1, 3\); expected \(N, 2\)"),
        (lambda: fem.stiffness([[0, "a"]], [[0, 1, 2]], (1, 1)), "points is not an array of real numbers"),
        (lambda: fem.stiffness(TRIANGLE[0], [[0, 1]], (1, 1)), r"cells has shape \(1, 2\); expected \(k, 3\) or"),
        (lambda: fem.stiffness(TRIANGLE[0], [[0, 1, 3]], (1, 1)), r"cells has node numbers from 0 to 3; .* 0 \.\. 2"),
        (lambda: fem.stiffness([[0, 0], [1, 0], [2, 0]], [[0, 1, 2]], (1, 1)), "cells row 0 is flat"),
        (lambda: fem.stiffness([*TRIANGLE[0], [1, 1]], [[0, 1, 2]], (1, 1)), "cells leave node 3 out"),
        (lambda: fem.stiffness(*TRIANGLE[:2], (1, -1)), r"lame is \(1, -1\)"),
        (lambda: fem.edge_forces(TRIANGLE[0], [[0, 1]], [1.0]), r"traction is \[1\.0\]; expected two finite numbers"),
        (lambda: at_one_node(held=[0, 1]), "contact names node 0"),
        (lambda: at_one_node(contact=[0, 0]), "contact names a node twice"),
        (lambda: at_one_node(contact=[0.5]), "contact has .* float64; expected"),
        (lambda: at_one_node(normals=(0, 0)), "normals row 0 is zero"),
        (lambda: at_one_node(tangents=(1, 1)), "tangents row 0 is not perpendicular"),
        (lambda: at_one_node(springs=(1, -1)), "springs has the value -1; expected stiffnesses >= 0"),
        (lambda: at_one_node(forces=[1.0]), r"forces has shape \(1,\); expected \(3, 2\)"),
    ],
)
def test_bad_arguments_are_named(build, message):
    bad_argument(message, build)


# -- norms -------------------------------------------------------------------------------------------------------------


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


def test_bad_arguments_of_norms_are_named():
    bad_argument("problem has no mesh or no areas", fem.h1_norms, gallery.one_node_3d())
    bad_argument("problem is a ContactProblem; expected a ContactProblem3D", fem.h1_norms, gallery.one_node_triangle())
    norms = fem.h1_norms(gallery.block3d(1, 1, 1))
    bad_argument(r"mu has shape \(3,\); expected \(2,\)", norms.of_force, [1, 2, 3])
