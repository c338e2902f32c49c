"""Meshes from files: gmsh by hand and by meshio, VTU, groups with and without names, files that are no body."""

import sys
from pathlib import Path

import meshio
import numpy as np
import pytest
from refusals import bad_argument, refusal

from enumsol import MissingDependencyError, fem, gallery, successive_approximations, write_vtu

MESHES = Path(__file__).parent / "meshes"
GMSH_2 = MESHES / "tetrahedra.22.msh"


def described(kind, **options):
    """A box as meshio has it, with its bottom and top, and that box."""
    mesh = fem.box(3, 2, 2, (2.0, 1.0, 1.0), kind)
    cell, facet = {"hexahedra": ("hexahedron", "quad"), "tetrahedra": ("tetra", "triangle")}[kind]
    blocks = [(cell, mesh.cells), (facet, mesh.facets["bottom"]), (facet, mesh.facets["top"])]
    return meshio.Mesh(mesh.points, blocks, **options), mesh


def facets(mesh):
    return {name: rows.tolist() for name, rows in mesh.facets.items()}


def test_a_gmsh_file_written_by_hand():
    mesh = fem.read_solid(GMSH_2)
    assert mesh.points.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]]  # the lone node is left out
    assert facets(mesh) == {"floor": [[0, 1, 2]], "lid": [[1, 2, 4], [1, 3, 4]]}
    problem = fem.solid_contact_problem(
        mesh.points, mesh.cells, (1, 1), contact=mesh.facets["floor"], held=mesh.nodes("lid"), friction=0.5
    )
    assert problem.node_ids == (0,)


def test_a_gmsh_file_of_version_4():
    mesh = fem.read_solid(MESHES / "tetrahedra.41.msh")
    assert len(mesh.points) == 5
    assert facets(mesh) == {"floor": [[0, 1, 2]], "lid": [[1, 2, 4]]}


@pytest.mark.parametrize("kind", ["hexahedra", "tetrahedra"])
def test_gmsh_files_with_physical_groups(tmp_path, kind):
    tags = {"gmsh:physical": [np.full(n, tag) for n, tag in _sizes(kind, (1, 5, 6))]}
    tags["gmsh:geometrical"] = tags["gmsh:physical"]
    names = {"floor": np.array([5, 2]), "body": np.array([1, 3])}
    given, mesh = described(kind, cell_data=tags, field_data=names)
    given.write(tmp_path / "body.msh", file_format="gmsh22", binary=False)
    read = fem.read_solid(str(tmp_path / "body.msh"))
    assert np.allclose(read.points, mesh.points, rtol=0, atol=1e-15)
    assert np.array_equal(read.part("floor"), mesh.facets["bottom"])
    assert np.array_equal(read.part("6"), mesh.facets["top"])  # a group without a name
    before, after = (fem.solid_stiffness(m.points, m.cells, (1.0, 0.5)) for m in (mesh, read))
    assert np.allclose(before.toarray(), after.toarray(), rtol=0, atol=1e-13)


def _sizes(kind, tags):
    _, mesh = described(kind)
    return list(zip((len(mesh.cells), len(mesh.facets["bottom"]), len(mesh.facets["top"])), tags, strict=True))


def test_vtu_files_with_groups_in_cell_data(tmp_path):
    part = [np.full(n, tag) for n, tag in _sizes("hexahedra", (0, 1, 2))]
    given, mesh = described("hexahedra", cell_data={"part": part})
    given.write(tmp_path / "body.vtu")
    assert [*fem.read_solid(tmp_path / "body.vtu").facets] == ["boundary"]
    read = fem.read_solid(tmp_path / "body.vtu", groups="part")
    assert np.array_equal(read.part("1"), mesh.facets["bottom"])
    assert np.array_equal(read.part("2"), mesh.facets["top"])
    message = r"body\.vtu: groups is 'parts'; .* \(found part\)"
    bad_argument(message, fem.read_solid, tmp_path / "body.vtu", groups="parts")


def test_cell_sets_of_a_mesh_in_memory():
    given, mesh = described("tetrahedra", cell_sets={"some": [None, [0, 3], [1]], "body": [[0, 1], None, None]})
    read = fem.read_solid(given)
    assert [*read.facets] == ["some"]
    assert np.array_equal(read.part("some"), [*mesh.facets["bottom"][[0, 3]], mesh.facets["top"][1]])


def test_what_the_package_writes_it_reads(tmp_path):
    """The picture of a body has its contact facets as cells."""
    problem = gallery.block3d(2, 2, 1)
    write_vtu(problem, successive_approximations(problem, 1), tmp_path / "p.vtu")
    read = fem.read_solid(tmp_path / "p.vtu")
    assert np.array_equal(read.points, problem.mesh.points)
    assert np.array_equal(read.facets["boundary"], problem.mesh.facets)


POINTS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1.0]])
TETRA, FACET = ("tetra", [[0, 1, 2, 3]]), ("triangle", [[0, 1, 2]])
PYRAMID, HEXAHEDRON = ("pyramid", [[0, 1, 2, 3, 4]]), ("hexahedron", [[0, 1, 2, 3, 0, 1, 2, 3]])


@pytest.mark.parametrize(
    ("cells", "message"),
    [
        ([TETRA], "the mesh has no contact facets: no triangle cells on its boundary"),
        ([FACET], "the mesh has no tetrahedra, wedges or hexahedra"),
        ([("line", [[0, 1]])], "the mesh has no tetrahedra, wedges or hexahedra"),
        ([TETRA, FACET, PYRAMID], "of type pyramid; expected some of tetra, .*mesh all of a body by one"),
        ([("tetra10", [[0, 1, 2, 3, 4, 0, 1, 2, 3, 4]]), FACET], "triangle cells beside tetra10; .* of type triangle6"),
        ([TETRA, FACET, HEXAHEDRON], "cells row 1 names a node twice, as one that is collapsed to a pyramid"),
        ([TETRA, FACET, ("quad", [[0, 1, 2, 3]])], "the mesh has quad cells beside tetra; expected facets of type tri"),
        ([TETRA, ("triangle", [[0, 1, 4]])], "facets of boundary have nodes of no cell"),
        ([("tetra", [[0, 1, 2, 9]]), FACET], r"the cells name nodes from 0 to 9; expected them in 0 \.\. 4"),
        ([("tetra", [[0, 1, 2, 2]]), FACET], "cells row 0 names a node twice; expected distinct nodes"),
    ],
)
def test_meshes_that_are_no_body_are_refused(cells, message):
    bad_argument(message, fem.read_solid, meshio.Mesh(POINTS, cells))


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("p.msh", "no mesh"),
        ("p.msh", GMSH_2.read_text()[:200]),
        ("p.msh", GMSH_2.read_text().replace("2.2 0 8", "9.9 0 8")),
        ("p.vtu", "<VTKFile"),
        ("p.vtu", "<VTKFile type='PolyData'/>"),
        ("p.xyzzy", "what is this"),
        ("p.stl", ""),
    ],
)
def test_files_that_meshio_cannot_read(tmp_path, capsys, name, text):
    (tmp_path / name).write_text(text)
    assert str(bad_argument("expected", fem.read_solid, tmp_path / name)).startswith(f"{tmp_path / name}: ")
    assert capsys.readouterr() == ("", "")


def test_other_arguments(tmp_path, monkeypatch):
    bad_argument("there is no such file; expected a mesh that meshio reads", fem.read_solid, tmp_path / "nowhere.msh")
    bad_argument("it is a directory; expected a mesh that meshio reads", fem.read_solid, tmp_path)
    (tmp_path / "secret.msh").touch()
    with monkeypatch.context() as patched:  # the user who runs the tests may read everything

        def refused(*_):
            raise PermissionError(13, "Permission denied")

        patched.setattr("pathlib.Path.open", refused)
        message = r"secret\.msh: it cannot be read \(Permission denied\); expected"
        bad_argument(message, fem.read_solid, tmp_path / "secret.msh")
    bad_argument("source is a int; expected the name of a file or a meshio", fem.read_solid, 3)
    monkeypatch.setitem(sys.modules, "netCDF4", None)
    (tmp_path / "p.exo").touch()
    message = r"p\.exo: meshio needs netCDF4 for this format, which is not inst"
    refusal(MissingDependencyError, message, fem.read_solid, tmp_path / "p.exo")
    monkeypatch.setitem(sys.modules, "meshio", None)
    message = r'need the package meshio, .* "enumsol\[meshes\]"'
    refusal(MissingDependencyError, message, fem.read_solid, tmp_path / "p.msh")
