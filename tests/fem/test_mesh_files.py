"""Plane meshes from files: gmsh by hand in two versions, node sets, groups of points, files that are no plane body."""

from pathlib import Path
from shutil import copy

import meshio
import numpy as np
import pytest
from alike import assert_close, assert_same
from parted_meshes import grid
from refusals import bad_argument, bad_problem

from enumsol import enumerate_roots, fem

MESHES = Path(__file__).parent / "meshes"
GMSH_2 = MESHES / "plane.22.msh"
SQUARE = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
QUAD, LINE = ("quad", [[0, 1, 2, 3]]), ("line", [[0, 1]])


def test_gmsh_version_2():
    mesh = fem.read_mesh(GMSH_2)
    assert mesh.points.tolist() == SQUARE.tolist()  # the lone node is left out, and z
    assert {name: part.tolist() for name, part in mesh.facets.items()} == {"floor": [[0, 1]], "lid": [[2, 3]]}
    assert mesh.nodes("corner").tolist() == [1]
    assert "nodes   corner (1)" in repr(mesh)
    moved = {"corner": (0, "free")}
    problem = fem.mesh_problem(str(GMSH_2), young=1, poisson=0, contact="floor", clamp="lid", displacement=moved)
    assert problem.node_ids == (0, 1)


def test_gmsh_version_4_of_second_order():
    """Edges of second order, in the order of the file: ends, then the node between."""
    mesh = fem.read_mesh(MESHES / "curved.41.msh")
    assert mesh.cells.tolist() == [[0, 1, 2, 3, 4, 5]]
    assert mesh.part("floor").tolist() == [[0, 1, 3]]
    problem = fem.mesh_problem(mesh, young=1, poisson=0, contact="floor", spring={"floor": (1, 1)})
    # the curved edge bulges downward: its middle normal is straight, the others lean outward
    assert problem.node_ids == (0, 3, 1)
    normals = problem.Bn.toarray()[[0, 1, 2], :].reshape(3, 6, 2)
    assert np.allclose(normals[1, 3], [0, -1])
    assert normals[0, 0, 0] < -0.1
    assert np.allclose(normals[0, 0] * [-1, 1], normals[2, 1])


def test_node_sets_of_abaqus():
    mesh = fem.read_mesh(MESHES / "plane.inp")
    assert mesh.nodes("POINT").tolist() == [2]
    assert np.sort(mesh.part("FLOOR"), axis=1).tolist() == [[0, 1]]
    bad_argument("no facets named 'POINT'; expected one of FLOOR", mesh.part, "POINT")
    bad_argument("no facets or nodes named 'lid'; expected one of FLOOR, POINT", mesh.nodes, "lid")


@pytest.mark.parametrize("kind", [6, 8, 9, (3, 4), (6, 8), (6, 9)])
def test_cells_of_other_kinds(kind, tmp_path):
    body = grid(3, 2, kind, 2.0, 1.0, shake=0.05)
    cells = cells_of_meshio(body.cells)
    edges = [("line" if kind == (3, 4) else "line3", body.facets[name]) for name in ("bottom", "left")]
    tags = [*(np.zeros(len(rows), int) for _, rows in cells), np.full(3, 1), np.full(2, 2)]
    names = {"all": np.array([0, 2]), "bottom": np.array([1, 1]), "left": np.array([2, 1])}
    data = {"gmsh:physical": tags, "gmsh:geometrical": tags}
    points = np.c_[body.points, np.zeros(len(body.points))]
    made = meshio.Mesh(points, [*cells, *edges], cell_data=data, field_data=names)
    made.write(tmp_path / "body.msh", file_format="gmsh22", binary=False)
    read = fem.read_mesh(tmp_path / "body.msh")
    assert_same(read, body, "cells")
    given = {"young": 2.0, "poisson": 0.3, "contact": "bottom", "clamp": "left", "friction": 0.4}
    problems = [fem.mesh_problem(mesh, **given, body_force=(0.1, -1)) for mesh in (read, body)]
    one, two = (enumerate_roots(problem, 0)[0] for problem in problems)
    assert np.max(one.lambda_n) > 0.1
    assert_close(one, two, "lambda_n", rtol=1e-12)


def cells_of_meshio(cells):
    """Triangles among quadrilaterals apart, by meshio's names."""
    names = {3: "triangle", 4: "quad", 6: "triangle6", 8: "quad8", 9: "quad9"}
    repeated = cells[:, -1] == cells[:, -2]
    if not np.any(repeated):
        return [(names[cells.shape[1]], cells)]
    triangles, others = cells[repeated][:, : 3 if cells.shape[1] == 4 else 6], cells[~repeated]
    return [(names[part.shape[1]], part) for part in (triangles, others)]


def test_sets_of_a_mesh_in_memory():
    cells = [("triangle", [[0, 1, 2], [0, 2, 3]]), ("line", [[0, 1], [1, 2]])]
    mesh = fem.read_mesh(meshio.Mesh(SQUARE, cells, cell_sets={"wall": [None, [1]]}, point_sets={"two": [0, 2]}))
    assert [*mesh.facets] == ["wall"]
    assert mesh.nodes("two").tolist() == [0, 2]
    nameless = fem.read_mesh(meshio.Mesh(SQUARE, cells))
    assert [*nameless.facets] == ["boundary"]
    bad_argument(r"expected one of boundary \(the file names no parts .* in gmsh phys", nameless.part, "floor")
    lifted = fem.read_mesh(meshio.Mesh(np.c_[SQUARE, np.full(4, 3.0)], cells))
    assert lifted.points.tolist() == SQUARE.tolist()


def test_groups_of_formats_that_number_them(tmp_path):
    """Medit in a file, SU2 and gmsh's VTK as meshio reads them; numbers that group nothing are no names."""
    body = grid(2, 1, 3)
    edges = {"7": body.part("bottom").tolist(), "8": body.part("left").tolist()}
    cells = [("triangle", body.cells), ("line", edges["7"] + edges["8"])]
    tags = [np.full(len(body.cells), 1), np.array([7, 7, 8])]

    def given(name, groups):
        return meshio.Mesh(body.points, cells, cell_data={name: groups})

    given("medit:ref", tags).write(tmp_path / "p.mesh")
    for source in (tmp_path / "p.mesh", given("su2:tag", tags)):
        assert {part: rows.tolist() for part, rows in fem.read_mesh(source).facets.items()} == edges
    columns = [part[:, None] for part in tags]  # as meshio reads scalars of some VTK files
    assert [*fem.read_mesh(given("CellEntityIds", columns)).facets] == ["7", "8"]
    assert [*fem.read_mesh(given("medit:ref", [tags[0], np.full(3, 7)])).facets] == ["boundary"]


def test_families_of_med_files(tmp_path):
    """A family is a set of cells in the same groups, and so for points."""
    pytest.importorskip("h5py")
    body = grid(2, 1, 3)
    edges = np.concatenate([body.part("bottom"), body.part("left")])
    points = np.zeros(len(body.points), int)
    points[[0, 5]] = [1, 2]
    given = meshio.Mesh(
        body.points, [("triangle", body.cells), ("line", edges)], point_data={"point_tags": points},
        cell_data={"cell_tags": [np.zeros(len(body.cells), int), np.array([-1, -2, -3])]},
    )  # fmt: skip
    given.cell_tags = {-1: ["floor"], -2: ["floor", "shoe"], -3: ["wall"]}
    given.point_tags = {1: ["pin"], 2: ["pin", "peg"]}
    given.write(tmp_path / "p.med")
    read = fem.read_mesh(tmp_path / "p.med")
    assert {name: sorted(rows.tolist()) for name, rows in read.facets.items()} == {
        "floor": edges[:2].tolist(), "shoe": edges[1:2].tolist(), "wall": edges[2:].tolist()
    }  # fmt: skip
    assert {name: rows.tolist() for name, rows in read.node_sets.items()} == {"pin": [0, 5], "peg": [5]}


QUAD8, TRIANGLE6 = ("quad8", [[0, 1, 2, 3] * 2]), ("triangle6", [[0, 1, 2] * 2])
TRIANGLE10, LIFTED = ("triangle10", [[0, 1, 2] * 3 + [0]]), np.c_[SQUARE, [0, 0, 0, 1]]


@pytest.mark.parametrize(
    ("points", "cells", "message"),
    [
        (SQUARE, [QUAD], "the mesh has no contact facets: no line cells on its boundary"),
        (SQUARE, [LINE], r"the mesh has no triangles or quadrilaterals; expected a body in 2D \(gmsh writes only"),
        (SQUARE, [QUAD8, TRIANGLE6, LINE], "has line cells beside quad8 and triangle6; expected facets of type line3"),
        (SQUARE, [TRIANGLE10, LINE], r"type triangle10; .*for cells of higher order set Mesh\.ElementOrder = 2"),
        (SQUARE, [QUAD, ("line3", [[0, 1, 2]])], "the mesh has line3 cells beside quad; expected facets of type line"),
        (LIFTED, [QUAD, LINE], "plane cells and z from 0 to 1; expected a plane mesh with the same"),
        (SQUARE, [("quad", [[0, 1, 2, 9]]), LINE], "the cells name nodes from 0 to 9"),
        (SQUARE, [("triangle", [[0, 1, 2]]), ("line", [[0, 3]])], "facets of boundary have nodes of no cell"),
        (SQUARE, [QUAD, ("line", [[0, 77]])], r"boundary names nodes from 0 to 77; expected them in 0 \.\. 3"),
        (SQUARE[:, :1], [QUAD, LINE], r"points has shape \(4, 1\)"),
        (SQUARE * np.nan, [QUAD, LINE], "points has the value nan"),
    ],
)
def test_meshes_that_are_no_plane_body(points, cells, message):
    bad_argument(message, fem.read_mesh, meshio.Mesh(points, cells))


@pytest.mark.parametrize(
    ("points", "cell"),
    [
        (SQUARE, [0, 2, 1, 3]),
        (SQUARE[[0, 1, 2, 1]], [0, 1, 2, 3]),
        ([[0, 0], [1, 0], [0.1, 0.1], [0, 1]], [0, 1, 2, 3]),
        ([[0, 0], [1, 0], [2, 0], [3, 0]], [0, 1, 2, 3]),
    ],
)
def test_cells_that_are_folded_or_flat(points, cell):
    mesh = fem.read_mesh(meshio.Mesh(points, [("quad", [cell]), LINE]))
    given = {"young": 1, "poisson": 0, "contact": "boundary", "spring": {"boundary": (1, 1)}}
    bad_argument("cells row 0 is flat, folded or inside out at a corner", fem.mesh_problem, mesh, **given)


def test_a_curved_edge_that_folds_its_cell():
    points = [[0, 0], [1, 0], [0, 1], [0.5, 0.6], [0.5, 0.5], [0, 0.5]]
    bad_argument("cells row 0 is flat, folded or inside out", fem.stiffness, points, [[0, 1, 2, 3, 4, 5]], (1, 1))


# -- TOML ------------------------------------------------------------------------------------------------------------

TOML = """
mesh = "body.msh"
young = 2.5
poisson = 0.25
contact = "floor"
clamp = ["lid"]
friction = 0.1
friction_slope = 0.5
load.floor = [0.0, -1e-3]
"""


@pytest.fixture
def toml(tmp_path):
    copy(GMSH_2, tmp_path / "body.msh")

    def written(text):
        (tmp_path / "body.toml").write_bytes(text if isinstance(text, bytes) else text.encode())
        return tmp_path / "body.toml"

    return written


def test_a_toml_file_is_a_call(toml, tmp_path):
    one = fem.read_mesh_problem(toml(TOML))
    two = fem.mesh_problem(
        tmp_path / "body.msh", young=2.5, poisson=0.25, contact="floor", clamp=["lid"], friction=0.1,
        friction_slope=0.5,
        load={"floor": (0, -1e-3)},
    )  # fmt: skip
    assert one.fingerprint == two.fingerprint


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("young", "yuong", "there is no option 'yuong'; did you mean young?"),
        ("clamp", "xyzzy", "there is no option 'xyzzy'; expected some of mesh, young"),
        ("young = 2.5\n", "", "young is missing"),
        ('mesh = "body.msh"\n', "", "mesh is missing; expected the name of a mesh file in quotes"),
        ("body.msh", "other.msh", r"other\.msh: there is no such file; expected a mesh"),
        ("2.5", "'2.5'", r"young is '2\.5'; expected a finite number"),
        ("2.5", "true", "young is True; expected"),
        ("2.5", "1979-05-27", "young is datetime"),
        ("young", "young young", "it is not a TOML file"),
        ("floor = [0.0", "floor = [nan", "load of floor is .*; expected two finite numbers"),
    ],
)
def test_toml_files_that_describe_no_problem(toml, old, new, message):
    place = toml(TOML.replace(old, new, 1))
    assert str(bad_problem(message, fem.read_mesh_problem, place)).startswith(f"{place}: ")


@pytest.mark.parametrize("text", [b"\xff\xfe", b"a = " + b"[" * 100_000, b"a" * 2_000_000, b"a = " + b"9" * 9_000])
def test_hostile_toml_files(toml, text):
    assert len(str(bad_problem(r"body\.toml: ", fem.read_mesh_problem, toml(text)))) < 700
