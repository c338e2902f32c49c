"""Cells of every kind: their stiffness by scikit-fem, several kinds in one mesh, collapsed cells, what does not fit."""

import meshio
import numpy as np
import pytest
import skfem
from parted_meshes import constant_stress, grid
from parted_solids import moved, solid
from refusals import bad_argument
from skfem.models.elasticity import linear_elasticity

import enumsol
from enumsol import fem
from enumsol.fem.bases import isotropic, nodal_basis
from enumsol.fem.meshes import as_cells_have, joined
from enumsol.model.cells import KINDS, by_kind, padded
from enumsol.model.mesh import consistent_mass

STEEL = {"young": 2.0, "poisson": 0.3}
LAME = fem.lame(**STEEL)
#: scikit-fem's mesh and element of each kind that it has, by dimension and nodes.
THEIRS = {
    (2, 3): (skfem.MeshTri1, skfem.ElementTriP1),
    (2, 4): (skfem.MeshQuad1, skfem.ElementQuad1),
    (2, 6): (skfem.MeshTri2, skfem.ElementTriP2),
    (2, 9): (skfem.MeshQuad2, skfem.ElementQuad2),
    (3, 4): (skfem.MeshTet1, skfem.ElementTetP1),
    (3, 10): (skfem.MeshTet2, skfem.ElementTetP2),
    (3, 8): (skfem.MeshHex1, skfem.ElementHex1),
    (3, 27): (skfem.MeshHex2, skfem.ElementHex2),
}


@pytest.mark.parametrize("kind", THEIRS)
def test_stiffness_is_that_of_scikit_fem(kind):
    dimension, nodes = kind
    mesh = grid(2, 1, nodes) if dimension == 2 else solid((1, 1, 1), nodes, shake=0.1)
    points = mesh.points + 0.05 * np.sin(3 * mesh.points[:, ::-1])
    made, element = THEIRS[kind][0], THEIRS[kind][1]()
    cells = np.sort(mesh.cells, axis=1) if nodes <= dimension + 1 else mesh.cells
    places = [np.argmin(np.linalg.norm(KINDS[kind].places - place, axis=1)) for place in element.doflocs]
    cells = cells[:, places]
    basis = skfem.Basis(
        made(points.T.copy(), cells.T.copy()), skfem.ElementVector(element), intorder=KINDS[kind].degree
    )
    theirs = np.empty((len(points), dimension), dtype=int)
    theirs[cells.T] = np.swapaxes(basis.element_dofs.reshape(nodes, dimension, len(cells)), 1, 2)
    expected = linear_elasticity(*LAME).assemble(basis)[theirs.ravel()][:, theirs.ravel()]
    body = nodal_basis(points, mesh.cells)
    assert abs(body.stiffness(isotropic(LAME, body.components)) - expected).max() < 1e-13


@pytest.mark.parametrize(("kind", "exact"), [(6, 1), (18, 2)])
def test_wedges_hold_all_polynomials_of_their_order(kind, exact):
    """The mass of a straight wedge integrates products of them, here against the sums of a prism."""
    places = KINDS[3, kind].places
    M = consistent_mass(places, np.arange(kind)[None], np.ones(1))
    x, y, z = places.T
    for a, b in (((x**exact), z**exact), (x ** (exact - 1) * y, y), (np.ones(kind), x * z)):
        at, weights = np.polynomial.legendre.leggauss(6)
        line = 0.5 * at + 0.5
        X, S, Z = np.meshgrid(line, line, line)
        share = 0.125 * weights[:, None, None] * weights[None, :, None] * weights * (1 - X)
        values = {tuple(x**exact): X**exact, tuple(z**exact): Z**exact, tuple(y): S * (1 - X)}
        values |= {tuple(x ** (exact - 1) * y): X ** (exact - 1) * S * (1 - X), tuple(np.ones(kind)): 1 + 0 * X}
        values |= {tuple(x * z): X * Z}
        assert np.isclose(a @ M @ b, np.sum(values[tuple(a)] * values[tuple(b)] * share), rtol=1e-12)


def second_order(points, blocks):
    """Cells of first order, by their numbers of nodes, as such of second order with straight edges."""
    places, known, made = list(points), {tuple(place): k for k, place in enumerate(points.round(9))}, []
    for cells in blocks:
        kind = KINDS[3, {4: 10, 6: 18, 8: 27}[cells.shape[1]]]
        at = np.einsum("mai,aq->mqi", points[cells], KINDS[3, cells.shape[1]].values(kind.places))
        rows = []
        for places_of in at.round(9):
            for place in map(tuple, places_of):
                if place not in known:
                    known[place] = len(places)
                    places.append(np.array(place))
            rows.append([known[place] for place in map(tuple, places_of)])
        made.append(np.array(rows))
    return np.array(places), made


def corner(second=False):
    """A hexahedron, two wedges beside it, and six tetrahedra above these: facets of both forms are shared."""
    box = fem.box(2, 1, 2, (2, 1, 2))
    tetrahedra = fem.box(1, 1, 1, cells="tetrahedra").cells
    one, two, three = box.cells[0], box.cells[1], box.cells[3]
    number = np.array([three[k] for k in (0, 1, 3, 2, 4, 5, 7, 6)])  # nodes of a box of one cell, by its corners
    blocks = [one[None], two[np.array([[0, 1, 2, 4, 5, 6], [0, 2, 3, 4, 6, 7]])], number[tetrahedra]]
    used = np.unique(np.concatenate([block.ravel() for block in blocks]))
    points, blocks = box.points[used], [np.searchsorted(used, block) for block in blocks]
    return second_order(points, blocks) if second else (points, blocks)


@pytest.mark.parametrize("second", [False, True])
def test_kinds_that_share_facets_pass_the_patch_test(second):
    """Constant stress is in equilibrium with its own tractions, across all kinds of facets."""
    points, blocks = corner(second)
    points = points @ np.array([[1.0, 0.1, 0.2], [-0.1, 1.2, 0.1], [0.0, 0.3, 0.9]])
    body = nodal_basis(points, padded(blocks))
    assert [len(rows) for rows, _ in by_kind(3, body.cells)] == [6, 2, 1]
    gradient = np.array([[0.2, -0.1, 0.3], [0.4, 0.3, 0.0], [-0.2, 0.1, 0.5]])
    stress = constant_stress(gradient, LAME)
    outer = body._outer[0]
    forces = body.on_part(outer, "boundary", lambda n: np.einsum("ij,jkq->ikq", stress, n))
    A = body.stiffness(isotropic(LAME, 6))
    assert np.allclose(A @ (points @ gradient.T).ravel(), forces.ravel(), rtol=0, atol=1e-13)
    assert np.sum(np.linalg.eigvalsh(A.toarray()) < 1e-10) == 6
    # the divergence theorem: what closes the boundary
    assert np.allclose(body.on_part(outer, "boundary", lambda n: n).sum(axis=0), 0, atol=1e-13)
    assert np.isclose(body.sizes.sum(), 3 * np.linalg.det([[1.0, 0.1, 0.2], [-0.1, 1.2, 0.1], [0.0, 0.3, 0.9]]))


def test_a_file_of_several_kinds(tmp_path):
    """Facets of triangles and of quadrilaterals, in one part; forces balance, and stresses are uniform."""
    points, blocks = corner()
    names = [("hexahedron", blocks[0]), ("wedge", blocks[1]), ("tetra", blocks[2])]
    outer = nodal_basis(points, padded(blocks))._outer[0]
    low = outer[np.all(points[outer][:, :, 2] == 0, axis=1)]
    kinds = {nodes.shape[1]: nodes for _, nodes in by_kind(2, low)}
    assert sorted(kinds) == [3, 4]
    names += [("triangle", kinds[3]), ("quad", kinds[4])]
    sets = {"floor": [None, None, None, range(2), range(1)], "back": [None, None, [0], None, None]}
    mesh = fem.read_mesh(meshio.Mesh(points, names, cell_sets=sets))
    assert "6 tetrahedra, 2 wedges, 1 hexahedra" in repr(mesh)
    scene = fem.mesh_scene(
        mesh, **STEEL, contact="floor", spring={"floor": (1, 1)}, body_force=(0, 0, -0.1), friction=0.5
    )
    assert "floor: 3 facets, area 2" in str(scene)
    problem = scene.problem()
    assert np.isclose(problem.areas.sum(), 2.0)
    assert np.isclose(problem.f.sum(), -0.3)
    assert fem.cell_stresses(problem, np.zeros(problem.n)).shape == (9, 3, 3)
    scene.plot(file=tmp_path / "scene.png")


def test_a_mesh_of_wedges_of_15_nodes_is_completed():
    few, all_nodes = solid((2, 1, 2), 15, shake=0.1), solid((2, 1, 2), 18, shake=0.1)
    points, cells = joined(few.points, [few.cells])
    parts = {name: as_cells_have(part, cells, name) for name, part in few.facets.items()}
    bad_argument("lid has facets that belong to no cell", as_cells_have, parts["top"] + 1, cells, "lid")
    mesh = fem.SolidMesh(points, cells, parts)
    assert "8 quadratic wedges" in repr(mesh)
    assert len(points) == len(all_nodes.points)
    data = {**STEEL, "friction": 0.4, "contact": "bottom", "clamp": "top", "pressure": {"right": 0.1}}
    one, two = (fem.mesh_problem(body, **data) for body in (mesh, all_nodes))
    assert one.n == two.n
    assert one.p == two.p == 9  # of triangles with six nodes those between corners
    values = [np.linalg.eigvalsh(problem.A.toarray()) for problem in (one, two)]
    assert np.allclose(*values, rtol=1e-9)


@pytest.mark.parametrize("turned", [False, True])
def test_collapsed_hexahedra_are_wedges_and_tetrahedra(turned):
    """However a deck collapses them, and in second order, too."""
    prism = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1]], dtype=float)
    if turned:
        prism = prism * [1, 1, -1]
    ways = [[0, 1, 2, 2, 3, 4, 5, 5], [0, 0, 1, 2, 3, 3, 4, 5], [0, 1, 1, 2, 3, 4, 4, 5], [0, 1, 2, 0, 3, 4, 5, 3]]
    ways += [[0, 1, 4, 3, 2, 2, 5, 5]]  # the edge that two quadrilaterals share
    for way in ways:
        _, cells = joined(prism, [np.array([way])])
        (kind,) = by_kind(3, cells)
        assert kind[1].shape == (1, 6)
        given = meshio.Mesh(prism, [("hexahedron", [way]), ("triangle", [[0, 1, 2]])])
        mesh = fem.read_mesh(given)
        assert np.isclose(nodal_basis(mesh.points, mesh.cells).sizes.sum(), 0.5)
    for way in ([0, 1, 2, 2, 3, 3, 3, 3], [0, 0, 0, 0, 1, 2, 3, 3], [0, 1, 2, 0, 3, 3, 3, 3]):
        _, cells = joined(prism[:4], [np.array([way])])
        assert cells.shape == (1, 4)
        assert np.isclose(abs(np.linalg.det(np.diff(prism[cells[0]], axis=0))), 1.0)
    with pytest.raises(fem.meshes.InvalidArgumentError, match="names a node twice"):
        joined(prism, [np.array([[0, 1, 2, 3, 4, 4, 4, 4]])])


def test_a_collapsed_hexahedron_of_20_nodes():
    """The nodes between its corners are those of the wedge of 15 nodes."""
    wedge = solid((1, 1, 1), 15)
    row = wedge.cells[0]
    hexahedron = [*row[[0, 1, 2, 2, 3, 4, 5, 5]], *row[[6, 7]], row[2], row[8], *row[[9, 10]], row[5], row[11]]
    hexahedron += [*row[[12, 13, 14, 14]]]
    points, cells = joined(wedge.points, [np.array([hexahedron]), wedge.cells[1:]])
    again, expected = joined(wedge.points, [wedge.cells])
    assert np.array_equal(cells[:, :15], expected[:, :15])
    assert np.array_equal(points[cells], again[expected])


def test_collapsed_quadrilaterals_are_triangles():
    for way in ([0, 1, 2, 2], [0, 0, 1, 2], [0, 1, 1, 2], [0, 1, 2, 0]):
        cells = joined(np.zeros((5, 2)), [np.array([way, [0, 1, 2, 4]])])[1]
        assert sorted(set(cells[0].tolist())) == [0, 1, 2]
        assert cells[1].tolist() == [0, 1, 2, 4]
    cells = joined(np.zeros((9, 2)), [np.array([[0, 1, 2, 2, 3, 4, 2, 5]])])[1]
    assert cells.tolist() == [[0, 1, 2, 3, 4, 5]]


def test_what_shares_corners_but_no_facet_is_refused():
    """A quadrilateral against two triangles, and first against second order."""
    box = fem.box(2, 1, 1)
    tetrahedra = box.cells[1][fem.meshes._PATHS,].reshape(-1, 4)
    blocks = [box.cells[:1], tetrahedra]
    bad_argument(
        "cells row 4 and cells row 0 .* do not fit together, as one has a triangle",
        nodal_basis,
        box.points,
        padded(blocks),
    )
    points = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [2, 0.0], [1, 0.5], [1.5, 0.0], [1.5, 0.5]])
    cells = padded([np.array([[0, 1, 2, 3]]), np.array([[1, 4, 2, 6, 7, 5]])])
    bad_argument("one is of first and one of second order", nodal_basis, points, cells)


def test_bodies_of_first_and_of_second_order():
    """A block of hexahedra presses on one of tetrahedra of second order: the pressure is that of its load."""
    upper, lower = solid((1, 1, 1), 8), moved(solid((2, 2, 2), 10), lambda p: p * [1, 1, 1] - [0, 0, 1])
    count = len(upper.points)
    facets = {f"upper.{name}": part for name, part in upper.facets.items()}
    facets |= {f"lower.{name}": part + count for name, part in lower.facets.items()}
    mesh = fem.SolidMesh(
        np.concatenate([upper.points, lower.points]), padded([upper.cells, lower.cells + count]), facets
    )
    sides = [f"{body}.{side}" for body in ("upper", "lower") for side in ("left", "front")]
    problem = fem.mesh_problem(
        mesh, **STEEL, pairs=[("lower.top", "upper.bottom")], symmetry=[*sides, "lower.bottom"],
        spring={"upper.top": (1e-9, 1e-9)}, pressure={"upper.top": 0.2}, friction=0.3,
    )  # fmt: skip
    assert problem.p == 16
    assert np.isclose(problem.areas.sum(), 1.0)
    root = enumsol.successive_approximations(problem, 0)
    assert np.isclose(root.lambda_n.sum(), 0.2, rtol=1e-6)
    assert np.allclose(fem.cell_stresses(problem, root.u)[:1, 2, 2], -0.2, rtol=1e-6)
