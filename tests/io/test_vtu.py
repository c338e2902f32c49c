"""VTU files: what ParaView is given, read back by meshio and as XML; bodies, patches, points alone; bad input."""

import sys
from types import SimpleNamespace
from xml.etree import ElementTree

import meshio
import numpy as np
import pytest
from parted_meshes import constant_stress
from parted_solids import held_in_part, on_bottom
from refusals import bad_argument, bad_problem, refusal

import enumsol
from enumsol import BodyMesh, ContactProblem3D, MissingDependencyError, OutputError, fem, gallery, write_vtu


def some_state(problem, seed=0):
    """Forces and displacements that belong together but solve nothing."""
    rng = np.random.default_rng(seed)
    p = problem.p
    normal, tangential = rng.random(p), rng.normal(size=(p, 2))
    forces = np.concatenate([normal, *tangential.T])
    u = problem.condensed.displacement(1.0, forces)
    u_t = np.stack([problem.Bt1 @ u, problem.Bt2 @ u], axis=1)
    return SimpleNamespace(
        u=u, lambda_n=normal, lambda_t=tangential, u_n=problem.Bn @ u, u_t=u_t,
        statuses=[("open", "stick", "slip")[k % 3] for k in range(p)], forces=forces,
    )  # fmt: skip


def written(problem, state, folder):
    """What meshio reads of a state that was written."""
    write_vtu(problem, state, folder / "p.vtu")
    return meshio.read(folder / "p.vtu")


@pytest.mark.parametrize("cells", ["hexahedra", "tetrahedra"])
def test_a_body_with_forces_on_nodes(tmp_path, cells):
    def spiral(x):
        angle = 2 * x[0] + x[1]
        return np.array([np.cos(angle), np.sin(angle), 0.0])

    mesh = fem.box(3, 2, 2, cells=cells)
    loads = fem.facet_forces(mesh.points, mesh.facets["top"], (0.3, 0.2, -1.0))
    problem = on_bottom(mesh, forces=loads, axes=spiral)
    state = some_state(problem)
    picture = written(problem, state, tmp_path)
    assert ElementTree.parse(tmp_path / "p.vtu").getroot().attrib["type"] == "UnstructuredGrid"
    assert np.array_equal(picture.points, mesh.points)
    (body, surface), kinds = picture.cells, {"hexahedra": ["hexahedron", "quad"], "tetrahedra": ["tetra", "triangle"]}
    assert [body.type, surface.type] == kinds[cells]
    assert np.array_equal(body.data, problem.mesh.cells)
    assert np.array_equal(surface.data, mesh.facets["bottom"])
    assert [np.unique(part).tolist() for part in picture.cell_data["contact_surface"]] == [[0], [1]]
    data = picture.point_data
    assert np.array_equal(data["displacement"], problem.mesh.displacements(state.u))
    contact = np.array(problem.node_ids)
    others = np.setdiff1d(np.arange(len(mesh.points)), contact)
    assert np.array_equal(data["lambda_n"][contact], state.lambda_n)
    assert np.array_equal(data["pressure"][contact], state.lambda_n / problem.areas)
    assert np.array_equal(data["status"][contact], np.arange(problem.p) % 3)
    assert np.array_equal(data["u_t2"][contact], state.u_t[:, 1])
    assert all(np.all(np.isnan(data[name][others])) for name in ("lambda_n", "pressure", "status", "u_n", "lambda_t1"))
    # forces on the body in global axes are those of the equations, -B' lambda; slip is the displacement along the floor
    on_body = problem.mesh.displacements(-problem.contact_rows.T @ state.forces)
    assert np.allclose(data["contact_force"], on_body, rtol=0, atol=1e-14)
    assert np.allclose(data["friction_force"], on_body * [1, 1, 0], rtol=0, atol=1e-14)
    assert np.allclose(data["slip"][contact], data["displacement"][contact] * [1, 1, 0], rtol=0, atol=1e-14)
    assert not np.any(data["slip"][others])


def test_patches_are_data_of_facets(tmp_path):
    mesh = fem.box(4, 4, 1, cells="tetrahedra")
    facets = mesh.facets["bottom"]
    held = np.unique(facets[np.max(mesh.points[facets][:, :, 0], axis=1) < 0.3])
    labels = np.where(np.isin(facets, held).all(axis=1), 100, fem.blocks(mesh.points, facets, 2))
    problem = fem.solid_contact_problem(
        mesh.points, mesh.cells, (1, 1), contact=facets, held=held, multipliers="elements", patches=labels
    )
    assert np.array_equal(problem.mesh.rows == -1, labels == 100)
    picture = written(problem, state := some_state(problem), tmp_path)
    inside, surface = picture.cell_data["lambda_n"]
    assert np.all(np.isnan(inside))
    row_of = {label: row for row, label in enumerate(problem.node_ids)}
    expected = [state.lambda_n[row_of[label]] if label != 100 else np.nan for label in labels]
    assert np.array_equal(surface, expected, equal_nan=True)
    force = picture.cell_data["contact_force"][1]
    assert np.allclose(force[:, 2], np.nan_to_num(expected))  # the floor pushes up
    t1, t2 = state.lambda_t[problem.mesh.rows].T
    assert np.allclose(force[:, :2], np.where(labels[:, None] == 100, 0, np.stack([-t1, t2], axis=1)))
    assert set(picture.point_data) == {"displacement"}


def test_contact_nodes_alone(tmp_path):
    problem = gallery.one_node_3d()
    picture = written(problem, state := some_state(problem), tmp_path)
    assert picture.cells[0].type == "vertex"
    assert np.array_equal(picture.points, problem.coordinates)
    assert picture.point_data["lambda_n"] == state.lambda_n
    assert "contact_force" not in picture.point_data


def test_contact_nodes_of_a_plane_body_alone(tmp_path):
    wedge = gallery.wedge(2, 2)
    problem = wedge.replace(mesh=None)
    root = enumsol.enumerate_roots(problem, 0.0)[0]
    picture = written(problem, root, tmp_path)
    assert [block.type for block in picture.cells] == ["vertex"]
    assert np.array_equal(picture.points, np.pad(problem.coordinates, ((0, 0), (0, 1))))
    assert np.array_equal(picture.point_data["lambda_n"], root.lambda_n)
    nowhere = problem.replace(coordinates=None)
    bad_argument("problem has neither mesh nor coordinates", write_vtu, nowhere, root, tmp_path / "q.vtu")
    bad_argument("state is empty; expected at least one", write_vtu, problem, [], tmp_path / "q.vtu")


def test_directions_that_the_rows_do_not_tell_are_left_out(tmp_path):
    mesh = fem.box(2, 2, 1)
    problem = on_bottom(mesh, held=held_in_part(mesh), multipliers="elements", axes=(0.6, 0.8, 0))
    data = written(problem, some_state(problem), tmp_path).cell_data
    assert "pressure" in data
    assert "contact_force" not in data


def no_mesh(problem, **more):
    return ContactProblem3D(*(getattr(problem, name) for name in ("A", "Bn", "Bt1", "Bt2", "f")), **more)


def no_facets(problem):
    mesh = problem.mesh
    return no_mesh(problem, mesh=BodyMesh.of_dofs(mesh.points, mesh.cells, mesh.dofs))


PATCHES = gallery.block3d(4, 2, 1, multipliers="elements", ratio=2)


def test_a_mesh_without_facets_will_do_for_nodes(tmp_path):
    problem = gallery.block3d(2, 1, 1)
    picture = written(no_facets(problem), some_state(problem), tmp_path)
    assert len(picture.cells) == 1
    assert np.array_equal(np.flatnonzero(~np.isnan(picture.point_data["lambda_n"])), problem.node_ids)


@pytest.mark.parametrize(
    ("problem", "change", "name", "message"),
    [
        (PATCHES, {}, "p.vtk", r"path is '.*p\.vtk'; expected a name that ends in \.vtu"),
        (PATCHES, {}, "no/such/p.vtu", "path .* cannot be written"),
        (PATCHES, {"u_n": None}, "p.vtu", "state is a SimpleNamespace without u_n; expected u, lambda_n, lambda_t"),
        (PATCHES, {"lambda_t": np.zeros(2)}, "p.vtu", r"lambda_t of the state has shape \(2,\); expected \(2, 2\)"),
        (PATCHES, {"u": np.zeros(3)}, "p.vtu", r"u of the state has shape \(3,\); expected"),
        (no_mesh(PATCHES), {}, "p.vtu", "problem has neither mesh nor coordinates"),
        (no_facets(PATCHES), {}, "p.vtu", "problem has contact rows of more than one node, and its mesh has no facets"),
        (gallery.two_node_square(), {}, "p.vtu", r"lambda_t of the state has shape \(2, 2\); expected \(2,\)"),
        ("block", {}, "p.vtu", "problem is a str; expected a ContactProblem or ContactProblem3D"),
    ],
)
def test_bad_arguments_are_named(tmp_path, problem, change, name, message):
    state = vars(some_state(PATCHES)) | change
    state = SimpleNamespace(**{key: value for key, value in state.items() if value is not None})
    bad_argument(message, write_vtu, problem, state, tmp_path / name)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(sys.platform != "linux", reason="needs /dev/full")
def test_a_full_disk_is_named(tmp_path):
    (tmp_path / "p.vtu").symlink_to("/dev/full")
    refusal(OutputError, "cannot be written", write_vtu, PATCHES, some_state(PATCHES), tmp_path / "p.vtu")


def test_meshio_is_an_extra(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "meshio", None)
    message = r'VTU files need the package meshio, .* "enumsol\[meshes\]"'
    refusal(MissingDependencyError, message, write_vtu, PATCHES, some_state(PATCHES), tmp_path / "p.vtu")


# -- stresses, and several states --------------------------------------------------------------------------------------


def strained(dimension, **options):
    """A body and the displacements of a homogeneous strain, with the stress that it has everywhere."""
    gradient = np.array([[1e-3, 4e-4, 0.0], [-2e-4, -5e-4, 3e-4], [1e-4, 0.0, 2e-4]])[:dimension, :dimension]
    mesh = fem.rectangle(3, 2).parted() if dimension == 2 else fem.box(2, 2, 1, **options)
    where = {"contact": "bottom", "spring": {"top": (1.0, 1.0)}}
    problem = fem.mesh_problem(mesh, young=2.5, poisson=0.25, friction=0.5, **where)
    stress = constant_stress(gradient, fem.lame(2.5, 0.25))
    return problem, (mesh.points @ gradient.T).ravel()[problem.mesh.dofs], stress


@pytest.mark.parametrize(("dimension", "options"), [(2, {}), (3, {}), (3, {"cells": "tetrahedra"})])
def test_a_homogeneous_strain_has_one_stress_everywhere(tmp_path, dimension, options):
    problem, u, stress = strained(dimension, **options)
    found = fem.cell_stresses(problem, u)
    np.testing.assert_allclose(found, np.broadcast_to(stress, found.shape), atol=1e-12)
    normal = np.zeros(problem.p)
    tangential = normal if dimension == 2 else np.zeros((problem.p, 2))
    state = SimpleNamespace(u=u, lambda_n=normal, lambda_t=tangential, u_n=normal, u_t=tangential)
    back = written(problem, state, tmp_path)
    full = np.zeros((3, 3))
    full[:dimension, :dimension] = stress
    np.testing.assert_allclose(back.cell_data["stress"][0], np.broadcast_to(full.ravel(), (len(found), 9)), atol=1e-12)
    if dimension == 3:
        deviator = stress - np.trace(stress) / 3 * np.eye(3)
        np.testing.assert_allclose(back.cell_data["von_mises"][0], np.sqrt(1.5) * np.linalg.norm(deviator))
        assert np.isnan(back.cell_data["stress"][1]).all()


def test_files_keep_the_lame_coefficients(tmp_path):
    for dimension in (2, 3):
        problem, u, _ = strained(dimension)
        enumsol.write_problem(problem, tmp_path / "p.npz")
        again = enumsol.read_problem(tmp_path / "p.npz")
        np.testing.assert_array_equal(fem.cell_stresses(again, u), fem.cell_stresses(problem, u))


def test_without_lame_coefficients_there_are_no_stresses(tmp_path):
    problem = gallery.two_node_square()
    bad_argument("no mesh with Lame coefficients", fem.cell_stresses, problem, np.zeros(problem.n))
    assert "stress" not in written(problem, enumsol.enumerate_roots(problem, 3.5)[0], tmp_path).cell_data
    mesh = problem.mesh
    bad_problem(r"mesh_lame has shape \(3,\)", BodyMesh, mesh.points, mesh.cells, mesh.motion, lame=[1, 2, 3])


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("name", ["wedge-8-5", "wedge3d-4-9"])
def test_all_roots_in_one_call(tmp_path, name):
    entry = gallery.get(name)
    problem = entry.build()
    roots = enumsol.enumerate_roots(problem, entry.alpha)
    write_vtu(problem, roots, tmp_path / "roots.vtu")
    files = [f"roots-{k}.vtu" for k in range(len(roots))]
    assert sorted(file.name for file in tmp_path.iterdir()) == sorted([*files, "roots.pvd"])
    shown = ElementTree.parse(tmp_path / "roots.pvd").getroot().iter("DataSet")
    assert [(part.get("timestep"), part.get("file")) for part in shown] == [(str(k), f) for k, f in enumerate(files)]
    for root, file in zip(roots, files, strict=True):
        moved = meshio.read(tmp_path / file).point_data["displacement"][:, : problem.mesh.points.shape[1]]
        np.testing.assert_allclose(moved, problem.mesh.displacements(root.u))
    bad_argument("state is empty", write_vtu, problem, [], tmp_path / "none.vtu")
