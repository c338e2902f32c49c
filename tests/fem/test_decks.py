"""Meshes of decks, what types of elements stand for, and other files of text that meshio reads in part."""

import meshio
import numpy as np
import pytest
from parted_meshes import grid
from refusals import bad_argument

from enumsol import fem

NODES = "".join(f"{k + 1}, {x}., {y}.\n" for k, (y, x) in enumerate(np.ndindex(3, 3)))
CELLS = ["1, 1, 2, 5, 4\n", "2, 2, 3, 6, 5\n", "3, 4, 5, 8, 7\n", "4, 5, 6, 9, 8\n"]
DECK = (
    "*HEADING\nby hand\n** nodes\n*NODE, NSET=ALL\n" + NODES + "** cells\n*ELEMENT, TYPE=CPS4, ELSET=BODY\n"
    + "".join(CELLS) + "*NSET, NSET=FLOOR\n1, 2, 3\n** end\n*NSET, NSET=ROOF, GENERATE\n7, 9, 1\n"
    "*ELSET, ELSET=LOW\n1, 2\n*STEP\n*NODE PRINT, NSET=FLOOR\nU\n*END STEP\n"
)  # fmt: skip


@pytest.fixture
def deck(tmp_path):
    def written(old="", new="", **others):
        assert old in DECK
        for name, text in others.items():
            (tmp_path / f"{name}.inp").write_text(text)
        (tmp_path / "deck.inp").write_text(DECK.replace(old, new, 1))
        return tmp_path / "deck.inp"

    return written


COMMENT = "** a comment\n"
WHOLE = [
    ("", ""),
    ("1, 2, 3\n** end", "1, 2,\n3,\n** end"),
    ("*STEP\n", "*STEP\n*ELEMENT OUTPUT\n** comments\nS, E\n"),
    ("*ELSET, ELSET=LOW\n1, 2\n", "*ELSET, ELSET=LOW, GENERATE\n1, 2, 1\n"),
    ("*ELSET, ELSET=LOW\n1, 2\n", "*ELSET, ELSET=LOW\nBODY\n"),
    (NODES, NODES + "10, 7., 7.\n"),
    (CELLS[2], COMMENT + CELLS[2]),
    (NODES[:30], NODES[:30] + COMMENT),
    ("** cells\n", "*NODE\n11, 5., 5.\n"),
    ("1, 2, 3\n", "1, 2,\n** right half\n3\n"),
    ("1, 2, 3\n", "1, 2\n*NSET, NSET=FLOOR\n3\n"),
    ("1, 2, 3\n", "1, 2\n*nset, nset=Floor\n3\n"),
    ("1, 2, 3\n", "1 , 2 , 3\n"),
    ("ELSET=LOW\n1, 2\n", "ELSET=LOW\n1,\n** and\n2\n"),
    ("".join(CELLS), "".join(CELLS[:3]) + "*ELEMENT, TYPE=CPS4, ELSET=BODY\n" + CELLS[3]),
    ("*STEP\n", "*STEP\n*CLOAD\nFLOOR, 1, 2.\n*NO SUCH CARD\n"),
]


@pytest.mark.parametrize(("old", "new"), WHOLE)
def test_decks_that_are_read_whole(deck, old, new):
    mesh = fem.read_mesh(deck(old, new))
    assert (len(mesh.points), len(mesh.cells)) == (9, 4)
    assert mesh.labels.tolist() == [1, 2, 3, 4]
    assert mesh.types == ("CPS4",)
    assert mesh.nodes("FLOOR").tolist() == [0, 1, 2]
    assert mesh.nodes("ROOF").tolist() == [6, 7, 8]
    assert len(mesh.body("LOW")) == (4 if "\nBODY" in new else 2)


def test_a_deck_that_includes_its_mesh_is_read_whole(deck):
    (place := deck(mesh=DECK)).write_text("*INCLUDE, INPUT=mesh.inp\n*STEP\n*END STEP\n")
    mesh = fem.read_mesh(place)
    assert len(mesh.cells) == 4
    assert mesh.nodes("FLOOR").tolist() == [0, 1, 2]


def test_sets_of_sets(deck):
    mesh = fem.read_mesh(deck("*STEP\n", "*NSET, NSET=HELD\nFLOOR, ROOF\n*STEP\n"))
    assert mesh.nodes("HELD").tolist() == [0, 1, 2, 6, 7, 8]


def test_surfaces_are_facets(deck):
    """Beside the facets of node sets, by the faces of elements."""
    mesh = fem.read_mesh(deck("*STEP\n", "*SURFACE, NAME=SIDE\n1, S4\n3, S4\n*STEP\n"))
    assert sorted(mesh.part("SIDE").tolist()) == [[3, 0], [6, 3]]
    assert np.sort(mesh.part("FLOOR"), axis=1).tolist() == [[0, 1], [1, 2]]


@pytest.mark.parametrize(
    ("new", "message"),
    [
        ("*NMAP, NSET=A\n1, 3, 1\n*STEP\n", r"deck.inp line 27: \*NMAP makes or moves nodes"),
        ("*INSTANCE, NAME=A, PART=P\n0., 1., 0.\n*STEP\n", r"line 27: \*INSTANCE is of the part P, which is not"),
        ("*NSET, NSET=ALL\nNONE\n", "line 28: there is no set of nodes named 'NONE'; expected"),
    ],
)
def test_decks_that_cannot_be_read(deck, new, message):
    place = deck("*STEP\n", new)
    assert str(bad_argument(message, fem.read_mesh, place)).startswith(f"{place}: ")


GIVEN = {"young": 2.0, "poisson": 0.3, "contact": "FLOOR", "clamp": "ROOF", "friction": 0.3, "gap": -0.01}


def test_plane_stress_has_to_be_said(deck):
    message = "plane is not given, and the cells are elements of type CPS4, .*expected plane = 'stress', or 'strain'"
    bad_argument(message, fem.mesh_problem, deck(), **GIVEN)
    strain = fem.mesh_scene(deck(), **GIVEN, plane="strain")
    assert strain.notes == []
    assert "plane strain" in str(strain)
    assert fem.mesh_problem(deck(), **GIVEN, plane="stress").fingerprint != strain.problem().fingerprint


@pytest.mark.parametrize(
    ("name", "what"), [("S4", "shells"), ("S4R", "shells"), ("M3D4", "membranes"), ("R3D4", "rigid surfaces")]
)
def test_elements_of_other_bodies(deck, name, what):
    bad_argument(f"elements of type {name}, which are {what}; expected solid", fem.read_mesh, deck("CPS4", name))


@pytest.mark.parametrize("kind", [3, 4])
def test_types_that_meshio_writes_mean_nothing(tmp_path, kind):
    """It writes rigid or axisymmetric elements for plane cells."""
    body = grid(2, 1, kind)
    cells = [({3: "triangle", 4: "quad"}[kind], body.cells)]
    meshio.Mesh(body.points, cells, point_sets={"FLOOR": [0, 1, 2], "ROOF": [3, 4, 5]}).write(tmp_path / "body.inp")
    scene = fem.mesh_scene(tmp_path / "body.inp", **GIVEN)
    assert scene.mesh.types == ()
    assert scene.notes == []


def test_reduced_and_incompatible_elements_are_noted(deck):
    (note,) = fem.mesh_scene(deck("CPS4", "CPS4R"), **GIVEN, plane="stress").notes
    assert note.startswith("elements of type CPS4R are taken as CPS4, with full integration and without incompatible")
    assert note in fem.mesh_problem(deck("CPS4", "CPS4R"), **GIVEN, plane="stress").notes


def test_collapsed_and_folded_elements_by_their_numbers(deck):
    """With the numbers of the file, in 2D and in 3D."""
    folded = deck("4, 5, 6, 9, 8\n", "44, 5, 9, 6, 8\n")
    bad_argument("element 44 is flat, folded or inside out", fem.mesh_problem, folded, **GIVEN, plane="strain")
    points = "1,0,0,0\n2,1,0,0\n3,0,1,0\n4,0,0,1\n5,1,0,1\n6,0,1,1\n"
    folded.write_text(f"*NODE\n{points}*ELEMENT, TYPE=C3D8\n11, 1, 2, 3, 4, 5, 5, 5, 5\n*NSET, NSET=A\n1, 2, 3\n")
    bad_argument("element 11 names a node twice as a pyramid does", fem.read_mesh, folded)


@pytest.mark.parametrize(
    ("suffix", "text", "message"),
    [
        (
            "bdf",
            "BEGIN BULK\nGRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\nGRID,3,,0.,1.,0.\nGRID,4,,1.,1.,0.\nCTRIA3,1,1,1,2,3\n"
            "CTRIA3*,2,1,2,4,3\nENDDATA\n",
            "meshio reads 1 of 2 cells of two or three dimensions",
        ),
        (
            "msh",
            "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n3\n1 0 0 0\n2 1 0 0\n3 0 1 0\n$EndNodes\n"
            "$Elements\n2\n1 2 2 1 1 1 2 3\n2 1 2 2 2 1 2\n$EndElements\n"
            "$Nodes\n3\n1 0 0 0\n2 2 0 0\n3 0 1 0\n$EndNodes\n",
            "meshio reads 3 of 6 nodes; expected a file that it reads whole",
        ),
        (
            "su2",
            "NDIME= 2\nNELEM= 1\n5 0 1 2 0\n5 1 3 2 1\nNPOIN= 4\n0 0\n1 0\n0 1\n1 1\nNMARK= 1\nMARKER_TAG= 3\n"
            "MARKER_ELEMS= 1\n3 0 1\n",
            "meshio left out a part of it .could not parse line.; expected a format that it reads whole",
        ),
    ],
)
def test_other_files_that_are_read_in_part(tmp_path, suffix, text, message):
    (tmp_path / f"part.{suffix}").write_text(text)
    bad_argument(message, fem.read_mesh, tmp_path / f"part.{suffix}")


@pytest.mark.parametrize(
    ("suffix", "options"),
    [
        *(("msh", {"file_format": "gmsh22", "binary": binary}) for binary in (True, False)),
        *((suffix, {}) for suffix in ("bdf", "mesh", "vtk", "vtu", "inp")),
    ],
)
@pytest.mark.parametrize("dimension", [2, 3])
def test_files_that_meshio_writes_are_read_whole(tmp_path, suffix, options, dimension):
    if dimension == 2:
        body = grid(3, 2, 3)
        cells = [("triangle", body.cells), ("line", body.part("bottom"))]
    else:
        body = fem.box(2, 2, 2)
        cells = [("hexahedron", body.cells), ("quad", body.part("bottom"))]
    points = np.c_[body.points, np.zeros((len(body.points), 3 - dimension))]
    meshio.Mesh(points, cells).write(tmp_path / f"body.{suffix}", **options)
    read = fem.read_mesh(tmp_path / f"body.{suffix}")
    assert (len(read.points), len(read.cells)) == (len(body.points), len(body.cells))
