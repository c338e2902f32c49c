"""Tetrahedra and hexahedra of second order: closed forms, turned and curved bodies, both orders compared, files."""

import meshio
import numpy as np
import pytest
import skfem
from alike import assert_close, assert_same
from complete import only_root
from parted_meshes import constant_stress
from parted_solids import NORMALS, moved, rotation, solid
from refusals import bad_argument
from skfem.models.elasticity import linear_elasticity

import enumsol
from enumsol import fem
from enumsol.fem.bases import isotropic, nodal_basis

STEEL = {"young": 2.0, "poisson": 0.3}
LAME = fem.lame(**STEEL)
SECOND = (10, 18, 27)


def normals_of(problem):
    """Normals (p, 3) of the contact rows."""
    axes = np.eye(3)[problem.mesh.dofs % 3]
    return problem.Bn @ axes


def total(root, problem):
    """Contact forces on the body, added up."""
    rows = np.concatenate([root.lambda_n, root.lambda_t[:, 0], root.lambda_t[:, 1]])
    return -(problem.contact_rows.T @ rows) @ np.eye(3)[problem.mesh.dofs % 3]


def same_places(one, two):
    """Which contact nodes of the first problem lie where those of the second do."""
    order = [int(np.argmin(np.linalg.norm(one.coordinates - place, axis=1))) for place in two.coordinates]
    assert_close(one, two, "coordinates", order=order)
    return order


@pytest.mark.few(0, 1, 4)
@pytest.mark.parametrize("kind", [4, 6, 8, *SECOND])
def test_patch_test(kind):
    """Constant stress is in equilibrium with its own tractions, on distorted cells."""
    mesh = solid((2, 2, 2), kind, (2.0, 1.5, 1.0), shake=0.08)
    gradient = np.array([[0.2, -0.1, 0.3], [0.4, 0.3, 0.0], [-0.2, 0.1, 0.5]])
    loads = {name: constant_stress(gradient, LAME) @ n for name, n in NORMALS.items()}
    A = nodal_basis(mesh.points, mesh.cells).stiffness(isotropic(LAME, 6))
    problem = fem.mesh_problem(mesh, **STEEL, contact="bottom", load=loads, spring={"top": (1, 1)})
    assert problem.n == mesh.points.size
    assert np.allclose(A @ (mesh.points @ gradient.T).ravel(), problem.f, rtol=0, atol=1e-13)
    values = np.linalg.eigvalsh(A.toarray())
    assert np.sum(values < 1e-10) == 6


@pytest.mark.parametrize("kind", SECOND)
def test_a_uniform_pressure_on_a_block_between_walls(kind):
    """Uniaxial strain: every contact node carries the pressure times its area, all of them positive."""
    mesh = solid((2, 2, 2), kind, (1.5, 1.0, 1.0), shake=0.1)
    walls = ["left", "right", "front", "back"]
    problem = fem.mesh_problem(
        mesh, **STEEL, contact="bottom", symmetry=walls, displacement={"top": ("free", "free", -0.01)}, friction=0.3
    )
    assert np.isclose(problem.areas.sum(), 1.5)
    assert np.min(problem.areas) > 0
    found = enumsol.successive_approximations(problem, 0)
    assert np.allclose(found.lambda_n, (LAME[0] + 2 * LAME[1]) * 0.01 * problem.areas, rtol=1e-7)
    assert np.allclose(found.lambda_t, 0, atol=1e-9)


def test_contact_nodes_of_six_node_triangles_lie_between_their_corners():
    mesh = solid((1, 1, 1), 10)
    problem = fem.mesh_problem(mesh, **STEEL, contact="bottom", clamp="top")
    assert sorted(problem.coordinates.tolist()) == [[0, 0.5, 0], [0.5, 0, 0], [0.5, 0.5, 0], [0.5, 1, 0], [1, 0.5, 0]]
    assert np.allclose(np.sort(problem.areas), [1 / 6] * 4 + [1 / 3])
    whole = fem.mesh_problem(solid((1, 1, 1), 27), **STEEL, contact="bottom", clamp="top")
    assert np.allclose(np.sort(whole.areas) * 36, [1] * 4 + [4] * 4 + [16])


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("kind", SECOND)
def test_springs_are_positive_and_carry_their_share(kind):
    mesh = solid((1, 1, 1), kind, (2.0, 1.0, 1.0))
    bent = moved(mesh, lambda p: p + 0.2 * np.c_[0 * p[:, 0], 0 * p[:, 0], p[:, 0] * p[:, 1] - p[:, 0] ** 2])
    for body in (mesh, bent):
        stiff, plain = (
            fem.mesh_problem(body, **STEEL, contact="bottom", clamp="left", spring={"top": (k, 2 * k)}).A
            for k in (1.0, 1e-9)
        )
        difference = (stiff - plain).toarray()
        assert np.min(np.linalg.eigvalsh(difference)) > -1e-12
    full = fem.mesh_problem(mesh, **STEEL, contact="bottom", spring={"top": (1, 2)}).A
    moves = np.tile(np.eye(3), (len(mesh.points), 1))
    assert np.allclose(moves.T @ full @ moves, np.diag([4, 4, 2]), atol=1e-10)


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("kind", SECOND)
def test_a_turned_body_has_the_same_roots(kind):
    mesh = solid((1, 1, 1), kind)
    loads, axis = np.array([0.3, 0.1, -0.6]), np.array([1.0, 0, 0])
    found = []
    for turn in (np.eye(3), rotation(3)):
        problem = fem.mesh_problem(
            moved(mesh, lambda p, R=turn: p @ R.T), **STEEL, contact="bottom", spring={"top": (0.1, 0.1)},
            load={"top": turn @ loads}, friction=0.4, axis=turn @ axis,
        )  # fmt: skip
        assert np.allclose(normals_of(problem), -turn[:, 2], atol=1e-12)
        found.append(enumsol.successive_approximations(problem, 0))
    assert np.max(found[0].lambda_n) > 0.05
    assert_close(*found, "lambda_n", rtol=1e-7, atol=1e-10)
    assert_close(*found, "lambda_t", rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("kind", SECOND)
def test_contact_forces_balance_the_load(kind):
    push = np.array([0.02, 0.01, -0.3])
    problem = fem.mesh_problem(
        solid((1, 1, 1), kind, (1.0, 1.0, 0.6)), **STEEL, contact="bottom", spring={"top": (1e-6, 1e-6)},
        load={"top": push}, friction=0.5,
    )  # fmt: skip
    assert np.allclose(total(enumsol.successive_approximations(problem, 0), problem), -push, rtol=0, atol=1e-4)


def test_all_roots_on_tetrahedra_of_second_order():
    """Proven to be one, and the one that successive approximations find."""
    problem = fem.mesh_problem(
        solid((1, 1, 1), 10), **STEEL, contact="bottom", spring={"top": (0.1, 0.1)}, load={"top": (0.1, 0.02, -0.3)},
        friction=0.4,
    )  # fmt: skip
    root = only_root(problem, 0, max_nodes=20_000)
    assert_close(root, enumsol.successive_approximations(problem, 0), "lambda_n", rtol=1e-6)


@pytest.mark.slow
def test_first_and_second_order_agree():
    """A clamped block that is pushed along the floor: forces come nearer to each other on finer meshes."""
    data = {**STEEL, "contact": "bottom", "clamp": "left", "load": {"top": (0.05, 0.0, -0.2)}, "friction": 0.3}
    forces = {}
    for kind, counts in ((8, (8, 4, 4)), *((kind, (4, 2, 2)) for kind in SECOND)):
        problem = fem.mesh_problem(solid(counts, kind, (2.0, 1.0, 1.0)), **data)
        forces[kind] = total(enumsol.successive_approximations(problem, 0), problem)
    for kind in SECOND:
        assert np.allclose(forces[kind], forces[8], rtol=0, atol=0.02 * forces[8][2])


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("kind", SECOND)
def test_a_curved_contact_boundary(kind):
    """A shell inside of a cylinder: normals and areas are those of the circle nearly to second order."""
    flat = solid((3, 1, 1), kind, (1.0, 0.5, 0.2))

    def bent(p):
        angle, radius = p[:, 0] - 0.5, 2.0 - p[:, 2]
        return np.c_[radius * np.sin(angle), p[:, 1], -radius * np.cos(angle)]

    mesh = moved(flat, bent)
    problem = fem.mesh_problem(mesh, **STEEL, contact="bottom", clamp="top", gap=-0.001, friction=0.2)
    outward = problem.coordinates * [1, 0, 1] / 2.0
    ends = np.abs(flat.points[list(problem.node_ids), 0] - 0.5) == 0.5
    assert np.allclose(normals_of(problem)[~ends], outward[~ends], atol=3e-4)
    assert np.allclose(normals_of(problem), outward, atol=0.06)
    assert np.isclose(problem.areas.sum(), 2.0 * 0.5, rtol=1e-3)
    assert np.min(problem.areas) > 0
    pressures = enumsol.successive_approximations(problem, 0).lambda_n / problem.areas
    assert np.all(pressures > 0)
    tractions = fem.mesh_problem(mesh, **STEEL, contact="top", spring={"left": (1, 1)}, pressure={"bottom": 0.3})
    force = tractions.f.reshape(-1, 3).sum(axis=0)
    assert np.allclose(force, [0, 0, 0.3 * 0.5 * 4.0 * np.sin(0.5)], atol=1e-4)


def test_tetrahedra_in_any_orientation():
    mesh = solid((1, 1, 1), 10)
    turned = mesh.cells[:, [1, 0, 2, 3, 4, 6, 5, 8, 7, 9]]
    blocks = [("tetra10", turned), ("triangle6", mesh.part("bottom")[:, [1, 0, 2, 3, 5, 4]])]
    read = fem.read_solid(meshio.Mesh(mesh.points, blocks))
    bad_argument("leave free", fem.mesh_problem, read, **STEEL, clamp="boundary", contact="boundary")
    one = fem.mesh_problem(read, **STEEL, contact="boundary", spring={"boundary": (1, 1)})
    two = fem.mesh_problem(mesh, **STEEL, contact="bottom", spring={"bottom": (1, 1)})
    assert abs(one.A - two.A).max() < 1e-14
    assert_close(one, two, "Bn", atol=1e-14)
    volume = np.linalg.det(read.points[read.cells[:, 1:4]] - read.points[read.cells[:, :1]])
    assert np.all(volume > 0)


def test_the_same_from_a_basis_of_scikit_fem():
    mesh = solid((1, 1, 1), 10)
    given = skfem.MeshTet(np.ascontiguousarray(mesh.points[:8].T), np.sort(mesh.cells[:, :4], axis=1).T)
    basis = skfem.Basis(given, skfem.ElementVector(skfem.ElementTetP2()), intorder=4)
    floor, lid, wall = (
        given.facets_satisfying(lambda x, k=k, at=at: np.isclose(x[k], at)) for k, at in ((2, 0), (2, 1), (0, 1))
    )
    push = skfem.LinearForm(lambda v, _: 0.3 * v[0] - 0.6 * v[2]).assemble(basis.boundary(wall))
    one = fem.basis_contact_problem(
        basis, linear_elasticity(*LAME).assemble(basis), contact=floor, held=basis.get_dofs(lid), forces=push,
        friction=0.4,
    )  # fmt: skip
    two = fem.mesh_problem(mesh, **STEEL, contact="bottom", clamp="top", load={"right": (0.3, 0, -0.6)}, friction=0.4)
    assert one.p == two.p == 5
    order = same_places(one, two)
    found = [enumsol.successive_approximations(problem, 0) for problem in (one, two)]
    assert np.max(found[0].lambda_n) > 0.01
    assert_close(*found, "lambda_n", "lambda_t", order=order, rtol=1e-6, atol=1e-10)


# -- files -------------------------------------------------------------------------------------------------------------


@pytest.mark.few(2, 1)
@pytest.mark.parametrize(("kind", "name", "facet"), [(10, "tetra10", "triangle6"), (27, "hexahedron27", "quad9")])
@pytest.mark.parametrize("suffix", ["msh", "vtu"])
def test_files(kind, name, facet, suffix, tmp_path):
    mesh = solid((2, 1, 1), kind, shake=0.05)
    blocks = [(name, mesh.cells), (facet, mesh.part("bottom")), (facet, mesh.part("top"))]
    tags = [np.full(len(rows), tag) for (_, rows), tag in zip(blocks, (1, 5, 6), strict=True)]
    data = {"gmsh:physical": tags, "gmsh:geometrical": tags} if suffix == "msh" else {"part": tags}
    place, options = tmp_path / f"body.{suffix}", {"file_format": "gmsh22"} if suffix == "msh" else {}
    meshio.Mesh(mesh.points, blocks, cell_data=data).write(place, **options)
    read = fem.read_mesh(place, groups=None if suffix == "msh" else "part")
    assert np.array_equal(read.cells, mesh.cells)
    assert np.array_equal(read.part("5"), mesh.part("bottom"))
    one, two = (
        fem.mesh_problem(body, **STEEL, contact=floor, clamp=lid, friction=0.5)
        for body, floor, lid in ((read, "5", "6"), (mesh, "bottom", "top"))
    )
    assert one.fingerprint == two.fingerprint


def test_hexahedra_of_20_nodes_are_completed():
    few, all_nodes = solid((2, 1, 1), 20, shake=0.1), solid((2, 1, 1), 27, shake=0.1)
    corner = few.nodes("left")
    given = meshio.Mesh(
        few.points, [("hexahedron20", few.cells), ("quad8", few.part("bottom")), ("quad8", few.part("top"))],
        cell_sets={"floor": [None, range(2), None], "lid": [None, None, range(2)]}, point_sets={"wall": corner},
    )  # fmt: skip
    read = fem.read_mesh(given)
    assert "2 quadratic hexahedra" in repr(read)
    assert np.array_equal(read.points[: len(few.points)], few.points)
    assert len(read.nodes("wall")) == len(corner) + 1  # with the node inside the facet
    data = {**STEEL, "friction": 0.4}
    one = fem.mesh_problem(read, **data, contact="floor", clamp="wall", load={"lid": (0.1, 0, -0.3)})
    two = fem.mesh_problem(all_nodes, **data, contact="bottom", clamp="left", load={"top": (0.1, 0, -0.3)})
    found = [enumsol.successive_approximations(problem, 0) for problem in (one, two)]
    assert one.n == two.n
    assert_close(*found, "lambda_n", order=same_places(one, two), rtol=1e-6, atol=1e-10)
    lonely = meshio.Mesh(given.points, [*given.cells[:1], ("quad8", [[0, 1, 2, 6, 7, 8, 9, 10]])])
    bad_argument("boundary has facets that belong to no cell", fem.read_mesh, lonely)


@pytest.mark.slow
@pytest.mark.parametrize("kind", SECOND)
def test_problems_of_second_order_are_written_and_drawn(kind, tmp_path):
    problem = fem.mesh_problem(
        solid((1, 1, 1), kind), **STEEL, contact="bottom", clamp="left", load={"top": (0.1, 0, -0.3)}, friction=0.4
    )
    enumsol.write_problem(problem, tmp_path / "p.npz")
    assert_same(enumsol.read_problem(tmp_path / "p.npz"), problem, "fingerprint", "mesh.facets")
    root = enumsol.successive_approximations(problem, 0)
    enumsol.write_vtu(problem, root, tmp_path / "p.vtu")
    picture = meshio.read(tmp_path / "p.vtu")
    kinds = {10: ["tetra10", "triangle6"], 18: ["wedge18", "triangle6"], 27: ["hexahedron27", "quad9"]}
    assert [block.type for block in picture.cells] == kinds[kind]
    assert np.isclose(np.nansum(picture.point_data["lambda_n"]), root.lambda_n.sum())
    assert fem.h1_norms(problem).of_displacement(root.u) > 0


def test_cells_that_are_of_no_kind():
    message = "cells row 0 has 20 nodes; expected one of 4, 6, 8, 10, 18, 27 in 3D"
    bad_argument(message, fem.mesh_problem, solid((1, 1, 1), 20), **STEEL, contact="bottom", clamp="top")


def test_a_curved_tetrahedron_that_folds():
    mesh = solid((1, 1, 1), 10)
    points = mesh.points.copy()
    points[mesh.cells[0, 4]] += 0.9 * (points[mesh.cells[0, 3]] - points[mesh.cells[0, 4]])
    message, folded = r"cells row \d+ is flat, folded or inside out at a corner", moved(mesh, lambda _: points)
    bad_argument(message, fem.mesh_problem, folded, **STEEL, contact="bottom", clamp="top")
