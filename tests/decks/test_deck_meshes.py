"""Meshes of decks: bodies, elements that only carry names, others that are refused, and meshio where it reads well."""

import meshio
import numpy as np
import pytest
from alike import assert_same
from parted_meshes import grid
from parted_solids import solid
from refusals import bad_argument, bad_problem
from written_decks import written

import enumsol
from enumsol import fem

#: Two tetrahedra on a triangle, as gmsh writes a body with names for surfaces and lines.
POINTS = "1,0,0,0\n2,1,0,0\n3,0,1,0\n4,0,0,1\n5,0,0,-1\n6,5,5,5\n"
SOLID = f"*Heading\n body.inp\n*NODE\n{POINTS}******* E L E M E N T S *************\n"
GMSH = (
    SOLID + "*ELEMENT, type=T3D2, ELSET=Line1\n1, 1, 2\n2, 6, 1\n*ELEMENT, type=CPS3, ELSET=Surface1\n3, 1, 2, 4\n"
    "*ELEMENT, type=CPS3, ELSET=Surface2\n4, 1, 3, 5\n5, 2, 3, 5\n*ELEMENT, type=C3D4, ELSET=Volume1\n"
    "6, 1, 2, 3, 4\n7, 1, 3, 2, 5\n*ELSET,ELSET=Floor\n4, 5,\n*ELSET,ELSET=Body\n6, 7,\n*NSET,NSET=Tip\n4,\n"
)
SHELL = "*SHELL SECTION, ELSET=FLOOR, MATERIAL=M\n0.1\n"
SECTION = "*SOLID SECTION, ELSET=VOLUME1, MATERIAL=M\n"


#: Faces of a hexahedron in the manual.
FACES = ["1234", "5876", "1562", "2673", "3784", "4851"]


def mesh_of(folder, text):
    return fem.read_mesh(written(folder, text))


def parts(mesh):
    return {name: sorted(sorted(row) for row in rows.tolist()) for name, rows in mesh.facets.items()}


def test_elements_that_carry_names_only(tmp_path):
    mesh = mesh_of(tmp_path, GMSH + SECTION)
    assert parts(mesh) == {
        "Surface1": [[0, 1, 3]], "Surface2": [[0, 2, 4], [1, 2, 4]], "Floor": [[0, 2, 4], [1, 2, 4]]
    }  # fmt: skip
    assert {name: rows.tolist() for name, rows in mesh.bodies.items()} == {"Volume1": [0, 1], "Body": [0, 1]}
    assert mesh.labels.tolist() == [6, 7]
    assert mesh.types == ("C3D4",)
    assert mesh.nodes("Tip").tolist() == [3]
    assert len(mesh.points) == 5  # node 6 belongs to a line alone


def test_lines_of_plane_meshes(tmp_path):
    text = (
        "*NODE\n1,0,0\n2,1,0\n3,0,1\n*ELEMENT,TYPE=T3D2,ELSET=BOTTOM\n1,1,2\n*ELEMENT,TYPE=CPS3,ELSET=FACE\n2,1,2,3\n"
    )
    mesh = mesh_of(tmp_path, text)
    assert parts(mesh) == {"BOTTOM": [[0, 1]]}
    assert mesh.types == ("CPS3",)
    quadratic = "*NODE\n1,0,0\n2,1,0\n3,0,1\n4,.5,0\n5,.5,.5\n6,0,.5\n*ELEMENT,TYPE=T3D3,ELSET=BOTTOM\n1,1,4,2\n"
    mesh = mesh_of(tmp_path, quadratic + "*ELEMENT,TYPE=CPE6,ELSET=FACE\n2,1,2,3,4,5,6\n")
    assert mesh.part("BOTTOM").tolist() == [[0, 1, 3]]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (SECTION, SHELL, r"line 16: .* type CPS3 are plane stress and carry something .\*SHELL SECTION, line 2\d.;"),
        (SECTION, "*SOLID SECTION, ELSET=LINE1, MATERIAL=M\n", "line 11: elements of type T3D2 are trusses and carry"),
        ("type=CPS3, ELSET=Surface1\n3, 1, 2, 4", "type=S3\n3, 1, 2, 6", "type S3 are shells, 1 element"),
        ("type=CPS3, ELSET=Surface1\n3, 1, 2, 4", "type=R3D3\n3, 1, 2, 6", "type R3D3 are rigid surfaces, 1"),
        ("type=C3D4", "type=S4", "line 19: elements of type S4 are shells and carry something"),
    ],
)  # fmt: skip
def test_elements_that_carry_something(tmp_path, old, new, message):
    text = GMSH + SECTION
    assert old in text
    bad_argument(message, mesh_of, tmp_path, text.replace(old, new, 1))


def test_decks_without_bodies(tmp_path):
    bad_argument("the deck has no elements of bodies; expected solid ones", mesh_of, tmp_path, "*NODE\n1,0,0\n")
    bad_argument("has no elements of bodies", mesh_of, tmp_path, "")
    bad_argument("which are trusses; expected solid", mesh_of, tmp_path, SOLID + "*ELEMENT,TYPE=T3D2\n1,1,2\n")


def test_surfaces_are_facets_of_the_body(tmp_path):
    """Sides of a box of hexahedra by their faces in the deck, where the mesh has them by geometry."""
    box = fem.box(3, 2, 2)
    nodes = "".join(f"{10 + k},{x!r},{y!r},{z!r}\n" for k, (x, y, z) in enumerate(box.points.tolist()))
    cells = "".join(f"{5 + k}," + ",".join(str(10 + node) for node in row) + "\n" for k, row in enumerate(box.cells))
    sides = {"bottom": "S1", "top": "S2", "front": "S3", "right": "S4", "back": "S5", "left": "S6"}
    text = f"*NODE\n{nodes}*ELEMENT,TYPE=C3D8,ELSET=ALL\n{cells}"
    for name, face in sides.items():
        rows = [k for k, row in enumerate(box.cells) if len(set(row) & set(box.facets[name].ravel())) == 4]
        text += f"*SURFACE,NAME={name}\n" + "".join(f"{5 + k},{face}\n" for k in rows)
    mesh = mesh_of(tmp_path, text + "*SURFACE,NAME=all sides\nALL\n*SURFACE,NAME=points,TYPE=NODE\n10,\n11,\n")
    assert np.array_equal(mesh.points, box.points)
    found = parts(mesh)
    assert {name: rows for name, rows in found.items() if name in sides} == parts(box)
    assert found["all sides"] == sorted(row for rows in parts(box).values() for row in rows)
    assert mesh.nodes("points").tolist() == [0, 1]
    clash = "*NSET,NSET=Points\n12\n*SURFACE,NAME=points,TYPE=NODE\n10,\n"
    bad_argument("line 91: the surface POINTS has other nodes than the set POINTS", mesh_of, tmp_path, text + clash)


def test_spelled_names_and_instances(tmp_path):
    """Names as they are written first; of instances behind their own."""
    square = "*Node\n1,0,0\n2,1,0\n3,1,1\n4,0,1\n*Element,type=CPE4,elset=Body\n1,1,2,3,4\n*Surface,name=Top\nbody,s3\n"
    text = f"*Part,name=P\n{square}*End Part\n*Assembly,name=A\n*Instance,name=Low,part=p\n*End Instance\n"
    text += "*Instance,name=Up,part=P\n0,2\n*End Instance\n*Nset,nset=both,instance=Low\n1,2\n"
    text += "*Nset,nset=BOTH,instance=Up\n1\n"
    mesh = mesh_of(tmp_path, text + "*End Assembly\n")
    assert parts(mesh) == {"both": [[0, 1]], "Low.Top": [[2, 3]], "Up.Top": [[6, 7]]}
    assert mesh.nodes("both").tolist() == [0, 1, 4]
    assert [*mesh.bodies] == ["Low.Body", "Up.Body"]


PLANE = [(kind, grid(3, 2, kind, 2.0, 1.0, shake=0.05)) for kind in (3, 4, 6, 8)]


@pytest.mark.parametrize("body", [body for _, body in PLANE], ids=[str(kind) for kind, _ in PLANE])
def test_plane_meshes_that_meshio_reads(tmp_path, body):
    same_as_by_meshio(tmp_path, body)


@pytest.mark.parametrize("kind", [4, 10, 8, 20])
def test_solid_meshes_that_meshio_reads(tmp_path, kind):
    same_as_by_meshio(tmp_path, solid((2, 2, 1), kind, shake=0.05))


def same_as_by_meshio(folder, body):
    """A deck with a block of each, sets by numbers and no comments is read alike."""
    place = folder / "body.inp"
    plane = body.points.shape[1] == 2
    names = {3: "triangle", 4: "quad", 6: "triangle6", 8: "quad8"}
    names = names if plane else {4: "tetra", 10: "tetra10", 8: "hexahedron", 20: "hexahedron20"}
    sets = {name: np.unique(rows) for name, rows in body.facets.items()}
    points = np.c_[body.points, np.zeros((len(body.points), 3 - body.points.shape[1]))]
    meshio.Mesh(points, [(names[body.cells.shape[1]], body.cells)], point_sets=sets).write(place)
    by_meshio, own = fem.read_mesh(meshio.read(place)), fem.read_mesh(place)
    assert_same(own, by_meshio, "points", "cells")
    assert parts(own) == parts(by_meshio)
    assert [*own.node_sets] == [*by_meshio.node_sets]
    assert all(np.array_equal(rows, by_meshio.node_sets[name]) for name, rows in own.node_sets.items())


def test_notes_on_other_formulations(tmp_path):
    """A beam of C3D8R, as in bending: the plain element takes its place, and a note says so."""
    box = fem.box(2, 1, 1)
    nodes = "".join(f"{1 + k},{x!r},{y!r},{z!r}\n" for k, (x, y, z) in enumerate(box.points.tolist()))
    cells = "".join(f"{1 + k}," + ",".join(str(1 + node) for node in row) + "\n" for k, row in enumerate(box.cells))
    text = f"*NODE\n{nodes}*ELEMENT,TYPE=C3D8R,ELSET=B\n{cells}*SURFACE,NAME=WALL\n1,S6\n*SURFACE,NAME=TIP\nB,S1\n"
    given = {"young": 210000, "poisson": 0, "contact": "TIP", "clamp": "WALL"}
    (note,) = [note for note in fem.mesh_scene(written(tmp_path, text), **given).notes if "C3D8" in note]
    assert note.startswith("elements of type C3D8R are taken as C3D8, with full integration and without incompatible")
    plain = fem.mesh_scene(written(tmp_path, text.replace("C3D8R", "C3D8")), **given)
    assert not any("C3D8" in note for note in plain.notes)


def test_nodes_and_elements_have_the_names_of_the_deck(tmp_path):
    """In problems and in messages; in front of the numbers of an instance stands its name."""
    square = "*NODE\n11,0,0\n12,1,0\n7,1,1\n9,0,1\n*ELEMENT,TYPE=CPE4,ELSET=B\n3,11,12,7,9\n"
    given = {"young": 1, "poisson": 0, "plane": "strain"}
    sets = "*NSET,NSET=LOW\n11,12\n*NSET,NSET=HIGH\n7,9\n"
    problem = fem.mesh_problem(written(tmp_path, square + sets), **given, contact="LOW", clamp="HIGH")
    assert problem.node_ids == (11, 12)
    text = f"*PART,NAME=P\n{square}{sets}*END PART\n*INSTANCE,NAME=A,PART=P\n*END INSTANCE\n"
    text += "*INSTANCE,NAME=B-1,PART=P\n0,2\n*END INSTANCE\n"
    clamps = {"contact": ["A.LOW", "B-1.LOW"], "clamp": ["A.HIGH", "B-1.HIGH"]}
    problem = fem.mesh_problem(written(tmp_path, text), **given, **clamps)
    assert problem.node_ids == ("A.11", "A.12", "B-1.11", "B-1.12")
    folded = text.replace("\n7,1,1", "\n7,.1,.1")
    bad_argument("element A.3 is flat, folded", fem.mesh_problem, written(tmp_path, folded), **given, **clamps)


def test_nodes_of_completed_hexahedra_are_named_by_the_corners_around(tmp_path):
    body = solid((1, 1, 1), 20)
    nodes = "".join(f"{5 + k},{x!r},{y!r},{z!r}\n" for k, (x, y, z) in enumerate(body.points.tolist()))
    row = [str(5 + node) for node in body.cells[0]]
    text = f"*NODE\n{nodes}*ELEMENT,TYPE=C3D20,ELSET=B\n1,{','.join(row[:9])},\n{','.join(row[9:])}\n"
    mesh = mesh_of(tmp_path, text + "*SURFACE,NAME=LOW\nB,S1\n*SURFACE,NAME=HIGH\nB,S2\n")
    corners = {tuple(5 + node for node in body.cells[0][[int(digit) - 1 for digit in face]]) for face in FACES}
    assert {tuple(sorted(map(int, name.split("/")))) for name in mesh.node_labels[20:26]} == {
        tuple(sorted(map(int, face))) for face in corners
    }
    assert mesh.node_labels[:20] == tuple(range(5, 25))
    assert len(set(mesh.node_labels)) == 27
    problem = fem.mesh_problem(mesh, young=1, poisson=0, contact="LOW", clamp="HIGH")
    assert len(problem.node_ids) == 9
    assert all(isinstance(name, str) for name in problem.node_ids)


#: What makes a deck of the mesh of gmsh: a foundation, contact, supports and a step.
LOADED = (
    "*NODE\n21,-1,0,-1\n22,3,0,-1\n23,-1,0,3\n24,0,-1,0\n*ELEMENT,TYPE=C3D4,ELSET=BASE\n50,21,22,23,24\n"
    "*SOLID SECTION,ELSET=BASE,MATERIAL=M\n*MATERIAL,NAME=M\n*ELASTIC\n1.,0.3\n*SURFACE,NAME=UNDER\nSURFACE1,SPOS\n"
    "*SURFACE,NAME=FOUNDATION\n50,S1\n*SURFACE INTERACTION,NAME=DRY\n*FRICTION\n0.2\n"
    "*CONTACT PAIR,INTERACTION=DRY,TYPE=NODE TO SURFACE\nUNDER,FOUNDATION\n*BOUNDARY\n21,1,3\n22,1,3\n23,1,3\n24,1,3\n"
    "5,1,3\n*STEP\n*STATIC\n*CLOAD\n3,2,-1e-3\n*END STEP\n"
)


def test_decks_with_elements_that_carry_names(tmp_path):
    """They need no section, make no plane body, and surfaces may name them."""
    model = enumsol.read_deck(written(tmp_path, GMSH + SECTION + LOADED))
    assert len(model.mesh.cells) == 3
    assert parts(model.mesh)["UNDER"] == [[0, 1, 3]]
    assert parts(model.mesh)["FLOOR"] == [[0, 2, 4], [1, 2, 4]]
    assert model.problem().node_ids == (1, 2, 4)
    twice = GMSH + SECTION + SECTION + LOADED
    bad_problem("line 29: .SOLID SECTION holds element 6, which has one already", problem_of, tmp_path, twice)


def test_elements_that_are_left_out(tmp_path):
    """Their sets are empty then, and their sections are not used; both are said."""
    beams = "*ELEMENT,TYPE=B31,ELSET=BEAMS\n90,1,4\n*BEAM SECTION,ELSET=BEAMS,MATERIAL=M,SECTION=RECT\n1.,1.\n"
    text = GMSH + SECTION + beams + LOADED
    bad_problem("type B31 are beams and carry something .* or --ignore B31", problem_of, tmp_path, text)
    model = enumsol.read_deck(written(tmp_path, text), ignore=["b31"])
    assert "elements of type B31, not used, as you say" in str(model)
    assert "not used: there are no elements of BEAMS" in str(model)
    assert model.problem().p == 3


def problem_of(folder, text):
    return enumsol.read_deck(written(folder, text)).problem()
