"""Bodies in 3D: closed forms, rigid motions, patch test, loads, turned bodies, meshes of boxes, bad input."""

import numpy as np
import pytest
from parted_meshes import constant_stress
from parted_solids import NORMALS, rotation
from refusals import bad_argument

from enumsol import fem
from enumsol.fem.solid_problems import facet_vectors, solid_mesh
from enumsol.model.cells import boundary_facets

KINDS = ("hexahedra", "tetrahedra")


def distorted(kind, counts=(3, 2, 2), size=(2.0, 1.0, 1.5), seed=1):
    """A box whose nodes are moved, and the box."""
    mesh = fem.box(*counts, size, kind)
    return mesh.points + np.random.default_rng(seed).uniform(-0.08, 0.08, mesh.points.shape), mesh


def tensor_products(counts, size, lame):
    """Stiffness of a box of hexahedra by products of matrices of intervals, in the numbering of box."""

    def assembled(count, length, local):
        matrix = np.zeros((count + 1, count + 1))
        for i in range(count):
            matrix[i : i + 2, i : i + 2] += local(length / count)
        return matrix

    mass, stiff, mixed = (
        [assembled(n, a, local) for n, a in zip(counts, size, strict=True)]
        for local in (
            lambda h: h * np.array([[1 / 3, 1 / 6], [1 / 6, 1 / 3]]),
            lambda h: np.array([[1, -1], [-1, 1]]) / h,
            lambda _: np.array([[-0.5, -0.5], [0.5, 0.5]]),  # of N_a' N_b
        )
    )

    def gradients(i, j):
        """Integrals of d_i N_a d_j N_b."""
        factors = list(mass)
        if i == j:
            factors[i] = stiff[i]
        else:
            factors[i], factors[j] = mixed[i], mixed[j].T
        return np.kron(factors[2], np.kron(factors[1], factors[0]))

    lam, mu = lame
    laplace = sum(gradients(k, k) for k in range(3))
    size = len(laplace)
    A = np.zeros((size, 3, size, 3))
    for i in range(3):
        for j in range(3):
            A[:, i, :, j] = lam * gradients(i, j) + mu * gradients(j, i) + (mu * laplace if i == j else 0.0)
    return A.reshape(3 * size, 3 * size)


def test_hexahedra_of_a_box_are_tensor_products():
    counts, size, lame = (3, 2, 2), (2.0, 1.0, 1.5), (1.3, 0.7)
    mesh = fem.box(*counts, size)
    A = fem.solid_stiffness(mesh.points, mesh.cells, lame).toarray()
    assert np.allclose(A, tensor_products(counts, size, lame), rtol=0, atol=1e-14 * np.max(A) * 10)


def test_one_tetrahedron_has_the_closed_form():
    rng = np.random.default_rng(3)
    for _ in range(10):
        corners, (lam, mu) = rng.normal(size=(4, 3)), rng.uniform(0.1, 3.0, 2)
        # gradients of the barycentric coordinates are the rows of an inverse
        g = np.linalg.inv(np.column_stack([np.ones(4), corners]))[1:].T
        volume = abs(np.linalg.det(corners[1:] - corners[0])) / 6
        K = lam * np.einsum("ai,bj->aibj", g, g) + mu * np.einsum("aj,bi->aibj", g, g)
        K += mu * np.einsum("ab,ij->aibj", g @ g.T, np.eye(3))
        A = fem.solid_stiffness(corners, [[2, 0, 1, 3]], (lam, mu)).toarray()
        assert np.allclose(A, volume * K.reshape(12, 12), rtol=1e-10, atol=1e-10 * np.max(A))


@pytest.mark.parametrize("kind", KINDS)
def test_kernel_holds_the_rigid_motions_only(kind):
    points, mesh = distorted(kind)
    A = fem.solid_stiffness(points, mesh.cells, (1.0, 0.5)).toarray()
    shifts = [np.tile(e, (len(points), 1)) for e in np.eye(3)]
    turns = [np.cross(e, points) for e in np.eye(3)]
    motions = np.stack([motion.ravel() for motion in shifts + turns], axis=1)
    assert np.max(np.abs(A @ motions)) < 1e-13 * np.max(A) * 10
    values = np.linalg.eigvalsh(A)
    assert np.sum(np.abs(values) < 1e-12 * values[-1]) == 6
    assert values[6] > 1e-4 * values[-1]


@pytest.mark.parametrize("kind", KINDS)
def test_patch_test_on_a_distorted_mesh(kind):
    """A constant stress is in equilibrium with its tractions on the boundary, and with nothing inside."""
    points, mesh = distorted(kind)
    for name, normal in NORMALS.items():  # plane sides: tractions are constant there
        axis = int(np.argmax(np.abs(normal)))
        points[mesh.nodes(name), axis] = mesh.points[mesh.nodes(name), axis]
    gradient, lame = np.random.default_rng(0).normal(size=(3, 3)), (1.3, 0.7)
    stress = constant_stress(gradient, lame)
    A = fem.solid_stiffness(points, mesh.cells, lame)
    force = (A @ (points @ gradient.T).ravel()).reshape(-1, 3)
    tractions = sum(fem.facet_forces(points, mesh.facets[name], stress @ normal) for name, normal in NORMALS.items())
    assert np.allclose(force, tractions, rtol=0, atol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_a_turned_body_has_the_turned_stiffness(kind):
    points, mesh = distorted(kind)
    R = rotation()
    Q = np.kron(np.eye(len(points)), R)
    before = fem.solid_stiffness(points, mesh.cells, (1.3, 0.7)).toarray()
    after = fem.solid_stiffness(points @ R.T + [1.0, -2.0, 3.0], mesh.cells, (1.3, 0.7)).toarray()
    assert np.allclose(after, Q @ before @ Q.T, rtol=0, atol=1e-12 * np.max(before))


@pytest.mark.parametrize("kind", KINDS)
def test_loads_have_the_resultants_and_moments_of_what_they_stand_for(kind):
    mesh = fem.box(3, 2, 4, (2.0, 1.0, 1.5), kind)
    forces = fem.solid_body_forces(mesh.points, mesh.cells, (0.5, 0.0, -2.0))
    assert np.allclose(forces.sum(axis=0), np.array([0.5, 0.0, -2.0]) * 3.0)
    assert np.allclose(np.cross(mesh.points, forces).sum(axis=0), np.cross([1.0, 0.5, 0.75], forces.sum(axis=0)))
    pulled = fem.facet_forces(mesh.points, mesh.facets["top"], (1.0, 2.0, 3.0))
    assert np.allclose(pulled.sum(axis=0), [2.0, 4.0, 6.0])
    assert np.allclose(np.cross(mesh.points, pulled).sum(axis=0), np.cross([1.0, 0.5, 1.5], [2.0, 4.0, 6.0]))
    assert not np.any(np.delete(pulled, mesh.nodes("top"), axis=0))


def test_loads_of_a_twisted_quadrilateral():
    """The saddle z = x y over the unit square: its area by an integral, and equal shares of symmetric corners."""
    corners = [[0, 0, 0], [1, 0, 0], [1, 1, 1], [0, 1, 0]]
    x, w = np.polynomial.legendre.leggauss(40)
    x, w = 0.5 * (x + 1), 0.5 * w
    area = w @ np.sqrt(1 + x[:, None] ** 2 + x[None, :] ** 2) @ w
    forces = fem.facet_forces(corners, [[0, 1, 2, 3]], (0, 0, 1.0))
    assert forces[:, 2].sum() == pytest.approx(area, rel=1e-4)
    assert forces[1, 2] == pytest.approx(forces[3, 2], rel=1e-14)


@pytest.mark.parametrize("kind", KINDS)
def test_box_fills_its_outline(kind):
    mesh = fem.box(3, 2, 4, (2.0, 1.0, 1.5), kind)
    assert len(mesh.points) == 4 * 3 * 5
    assert np.array_equal(mesh.points[mesh.nodes("left")][:, 0], np.zeros(15))
    assert np.array_equal(mesh.points[(2 * 3 + 1) * 4 + 3], [2.0, 0.5, 0.75])
    # outward normals, and no hole between the cells: every inner facet is met twice
    for name, normal in NORMALS.items():
        corners = mesh.points[mesh.facets[name]]
        outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        assert np.all(outward @ normal > 0)
        across = {"left": 8, "right": 8, "front": 12, "back": 12, "bottom": 6, "top": 6}[name]
        assert len(corners) == across * (1 if kind == "hexahedra" else 2)
    assert repr(mesh).splitlines()[0] == "SolidMesh with 60 nodes"


def test_a_name_that_is_close_is_offered():
    mesh = fem.box(1, 1, 1)
    bad_argument(r"no facets named 'botom'; .* \(did you mean bottom\?\)", mesh.part, "botom")
    bad_argument("no facets named 'xyz'; expected one of left, right", mesh.nodes, "xyz")


def test_assembly_stays_sparse():
    mesh = fem.box(12, 12, 12)
    A = fem.solid_stiffness(mesh.points, mesh.cells, (1.0, 1.0))
    assert A.nnz <= 81 * A.shape[0]


def test_cells_turned_inside_out_or_flat_are_refused_and_they_may_have_any_orientation():
    mesh, tetrahedra = fem.box(2, 1, 1), fem.box(1, 1, 1, cells="tetrahedra")
    mirrored = mesh.cells.copy()
    mirrored[1] = mirrored[1][[4, 5, 6, 7, 0, 1, 2, 3]]
    for body, other in ((mesh, mirrored), (tetrahedra, tetrahedra.cells[:, [1, 0, 2, 3]])):
        A, B = (fem.solid_stiffness(body.points, cells, (1, 1)) for cells in (body.cells, other))
        assert np.allclose(A.toarray(), B.toarray(), rtol=0, atol=1e-14 if body is mesh else 1e-15)
    _, turned = solid_mesh(mesh.points, mirrored)
    facets = boundary_facets(3, turned)
    outward = np.sum(facet_vectors(mesh.points, facets) * (mesh.points[facets].mean(axis=1) - 0.5), axis=1)
    assert np.all(outward > 0)
    zigzag = mesh.cells[:, [0, 1, 3, 2, 4, 5, 7, 6]]  # rows of a grid instead of VTK's order
    bad_argument("cells row 0 is turned inside out at a corner", fem.solid_stiffness, mesh.points, zigzag, (1, 1))
    flat = mesh.points * [1, 1, 0]
    bad_argument("cells row 0 has no volume", fem.solid_stiffness, flat, mesh.cells, (1, 1))


BODY = ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 2, 3]])


def stiffness(points=BODY[0], cells=BODY[1], lame=(1, 1)):
    return fem.solid_stiffness(points, cells, lame)


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: stiffness([[0, 0]], [[0, 0, 0, 0]]), r"points has shape \(1, 2\); expected \(N, 3\)"),
        (lambda: stiffness(cells=[[0, 1, 2]]), r"cells has shape .* \(k, 4\) or \(k, 8\) node"),
        (lambda: stiffness(cells=[[0, 1, 2, 4]]), r"cells has node numbers from 0 to 4; .* 0 \.\. 3"),
        (lambda: stiffness(cells=[[0, 1, 2, 2]]), "cells row 0 has 3 nodes; expected one of"),
        (lambda: stiffness([*BODY[0], [1, 1, 1]]), "cells leave node 4 out; .* some cell"),
        (lambda: stiffness(lame=(-1, 1)), r"lame is \(-1, 1\); .* 3 l \+ 2 m > 0"),
        (lambda: stiffness([[1e120] * 3] * 4), "whose cube overflows"),
        (lambda: fem.solid_body_forces(*BODY, (1, 2)), r"density is \(1, 2\); expected three finite numbers"),
        (lambda: fem.facet_forces(BODY[0], [[0, 1]], (1, 2, 3)), r"facets has shape \(1, 2\); expected \(k, 3\) or"),
        (lambda: fem.facet_forces(BODY[0], [[0, 1, 2]], [[1, 2]]), r"traction has shape \(1, 2\); expected \(3,\) or"),
        (lambda: fem.box(0, 1, 1), "nx is 0; expected an integer of at least 1"),
        (lambda: fem.box(1, 1, 1, (1, 0, 1)), r"size is \(1, 0, 1\); expected three lengths > 0"),
        (lambda: fem.box(1, 1, 1, cells="prisms"), "cells is 'prisms'; expected"),
    ],
)
def test_bad_arguments_are_named(build, message):
    bad_argument(message, build)
