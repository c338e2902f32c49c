"""Types of elements, their faces by the numbers of CalculiX' manual, and elements that are collapsed."""

from itertools import combinations

import numpy as np
import pytest
from written_decks import read

from enumsol.decks.elements import element_type, shape_of
from enumsol.decks.faces import face_nodes, free_faces, uncollapsed

#: Corners of cells with edges of length one, in the order of both programs.
CUBE = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
PLACES = {
    "C3D4": [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)],
    "C3D6": [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (0, 1, 1)],
    "C3D5": [*CUBE[:4], (0, 0, 1)],
    "C3D8": CUBE,
    "CPS3": [(0, 0, 0), (1, 0, 0), (0, 1, 0)],
    "CPS4": CUBE[:4],
}
#: Faces S1, S2, ... in the manual, by numbers of nodes.
MANUAL = {
    "C3D4": ["123", "142", "243", "341"],
    "C3D6": ["123", "456", "1254", "2365", "3146"],
    "C3D5": ["1234", "152", "253", "354", "451"],
    "C3D8": ["1234", "5876", "1562", "2673", "3784", "4851"],
    "CPS3": ["12", "23", "31"],
    "CPS4": ["12", "23", "34", "41"],
}
#: Nodes between corners, behind these, as pairs of corners in the figures of the manual.
BETWEEN = {
    "C3D10": ("C3D4", "12 23 31 14 24 34"),
    "C3D15": ("C3D6", "12 23 31 45 56 64 14 25 36"),
    "C3D13": ("C3D5", "12 23 34 41 15 25 35 45"),
    "C3D20": ("C3D8", "12 23 34 41 56 67 78 85 15 26 37 48"),
    "CPS6": ("CPS3", "12 23 31"),
    "CPS8": ("CPS4", "12 23 34 41"),
}


def places_of(name):
    """Positions of all nodes of a type."""
    if name in PLACES:
        return np.array(PLACES[name], dtype=float)
    corners, edges = BETWEEN[name]
    at = np.array(PLACES[corners], dtype=float)
    return np.array([*at, *(at[[int(end) - 1 for end in edge]].mean(axis=0) for edge in edges.split())])


@pytest.mark.parametrize("name", [*PLACES, *BETWEEN])
def test_faces_have_the_numbers_of_the_manual(tmp_path, name):
    """Corners as the manual lists them; what lies between two corners of the face follows in their order."""
    at = places_of(name)
    nodes = "".join(f"{k},{x},{y},{z}\n" for k, (x, y, z) in enumerate(at, 1))
    row = ",".join(str(k) if k % 9 else f"{k},\n" for k in range(1, len(at) + 1)).replace("\n,", "\n")
    corners = BETWEEN.get(name, (name, ""))[0]
    sides = "".join(f"*SURFACE,NAME=F{k}\n1,S{k}\n" for k in range(1, len(MANUAL[corners]) + 1))
    deck = read(tmp_path, f"*NODE\n{nodes}*ELEMENT,TYPE={name},ELSET=E\n1,{row}\n{sides}*SURFACE,NAME=FREE\nE\n")
    for k, digits in enumerate(MANUAL[corners], 1):
        ((shape, found),) = face_nodes(deck, deck.surfaces[f"F{k}"].faces)
        expected = [int(digit) - 1 for digit in digits]
        assert sorted(found[0, : shape.corners].tolist()) == sorted(expected)
        ends = found[0, : shape.corners]
        pairs = list(zip(ends, np.roll(ends, -1), strict=True))[: 1 if shape.dimension == 1 else None]
        between = [(at[a] + at[b]) / 2 for a, b in pairs if name in BETWEEN]
        assert np.allclose(at[found[0, shape.corners :]], np.reshape(between, (-1, 3)))
    assert deck.surfaces["FREE"].faces[:, 1].tolist() == list(range(len(MANUAL[corners])))


def test_hexahedra_of_27_nodes_in_the_order_of_abaqus():
    """Node 21 in the middle, then those of faces S1 to S6; VTK has them by -x, +x, -y, +y, -z, +z and the middle."""
    corners = np.array(CUBE, dtype=float)
    edges = [corners[[int(end) - 1 for end in edge]].mean(axis=0) for edge in BETWEEN["C3D20"][1].split()]
    sides = [corners[[int(node) - 1 for node in face]].mean(axis=0) for face in MANUAL["C3D8"]]
    at = np.array([*corners, *edges, corners.mean(axis=0), *sides])
    shape = shape_of(3, 27)
    vtk = at[list(shape.to_vtk)]
    assert np.allclose(2 * vtk[20:], [(0, 1, 1), (2, 1, 1), (1, 0, 1), (1, 2, 1), (1, 1, 0), (1, 1, 2), (1, 1, 1)])
    assert np.allclose(vtk[:20], at[:20])
    assert all(np.allclose(at[face[8]], at[list(face[:4])].mean(axis=0)) for face in shape.faces)


TYPES = [
    ("C3D8", "solid", 8, "C3D8"), ("C3D8I", "solid", 8, "C3D8"), ("C3D8RH", "solid", 8, "C3D8"),
    ("C3D20R", "solid", 20, "C3D20"), ("C3D10M", "solid", 10, "C3D10"), ("C3D4H", "solid", 4, "C3D4"),
    ("C3D6", "solid", 6, "C3D6"), ("C3D15", "solid", 15, "C3D15"), ("C3D27", "solid", 27, "C3D27"),
    ("CPS4R", "plane stress", 4, "CPS4"), ("CPS6M", "plane stress", 6, "CPS6"), ("CPE3", "plane strain", 3, "CPE3"),
    ("CPE8R", "plane strain", 8, "CPE8"), ("CPE4I", "plane strain", 4, "CPE4"), ("CAX4", "axisymmetric", 4, "CAX4"),
    ("CAX8RH", "axisymmetric", 8, "CAX8"), ("CAX6", "axisymmetric", 6, "CAX6"), ("S4", "shells", 4, "S4"),
    ("S8R5", "shells", 8, "S8"), ("STRI65", "shells", 6, "STRI65"), ("STRI3", "shells", 3, "STRI3"),
    ("M3D4R", "membranes", 4, "M3D4"), ("R3D4", "rigid surfaces", 4, "R3D4"), ("T3D2", "trusses", 2, "T3D2"),
    ("B31", "beams", 2, "B31"), ("B32R", "beams", 3, "B32"), ("SPRINGA", "springs", 2, "SPRINGA"),
    ("SAX1", "shells", 2, "SAX1"), ("SAX2", "shells", 3, "SAX2"), ("MASS", "point masses", 1, "MASS"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "family", "nodes", "plain"), TYPES)
def test_types(name, family, nodes, plain):
    kind = element_type(name)
    assert (kind.name, kind.family, kind.shape.nodes, kind.plain) == (name, family, nodes, plain)
    assert kind.is_body == (family in ("solid", "plane stress", "plane strain", "axisymmetric"))


UNKNOWN = ["C3D7", "U1", "XYZ", "C3D", "CPS5", "DC3D8", "CPEG4", "AC3D8", "", "S5", "8C3D", "C3D8X"]


@pytest.mark.parametrize("name", UNKNOWN)
def test_types_that_are_not_known(name):
    assert element_type(name) is None


def volume(name, at):
    """Of a tetrahedron, a wedge, a pyramid or a hexahedron with plane faces, by the divergence theorem."""
    faces = [[int(digit) - 1 for digit in face] for face in MANUAL[name]]
    centre = at.mean(axis=0)
    return sum(
        abs(np.linalg.det([at[face[0]] - centre, at[face[k]] - centre, at[face[k + 1]] - centre])) / 6
        for face in faces
        for k in range(1, len(face) - 1)
    )


NAMES = {"wedge": "C3D6", "tetra": "C3D4", "pyramid": "C3D5", "hexahedron": "C3D8"}


def collapses():
    """Every way to let two or more corners of a cube be one that leaves a wedge, a tetrahedron or a pyramid."""
    cube = np.array(CUBE)
    edges = [pair for pair in combinations(range(8), 2) if np.abs(cube[pair[0]] - cube[pair[1]]).sum() == 1]
    sides = [[k for k in range(8) if cube[k, axis] == value] for axis in range(3) for value in (0, 1)]
    for a, b in combinations(edges, 2):
        if set(a) & set(b) or not any(set(a) | set(b) == set(side) for side in sides):
            continue
        yield "wedge", (a, b if (min(a[0], b[0]), max(a[0], b[0])) in edges else b[::-1])
    yield from (("pyramid", (side,)) for side in sides)
    for side in sides:
        yield from (("tetra", (side, edge)) for edge in edges if not set(edge) & set(side))


@pytest.mark.parametrize("second", [False, True])
def test_collapsed_hexahedra(second):
    """In every position, each is what it is by geometry: its volume, and right-handed; 12, 6 and 24 ways."""
    at = places_of("C3D20" if second else "C3D8")
    ends = [[int(end) - 1 for end in edge] for edge in BETWEEN["C3D20"][1].split()]
    counts = {}
    for kind, groups in collapses():
        number = np.arange(8)
        for group in groups:
            number[list(group)] = group[0]
        nodes = number
        if second:
            pairs = [tuple(sorted(number[edge])) for edge in ends]
            firsts = {pair: 8 + pairs.index(pair) for pair in pairs}
            nodes = np.array([*number, *(a if a == b else firsts[a, b] for a, b in pairs)])
        ((shape, rows, found),) = uncollapsed(shape_of(3, len(at)), nodes[None])
        assert rows.tolist() == [0]
        assert shape.form == kind
        assert shape.nodes == (len(np.unique(nodes)))
        own = at[found[0, : shape.corners]]
        assert np.isclose(volume(NAMES[kind], own), {"wedge": 1 / 2, "pyramid": 1 / 3, "tetra": 1 / 6}[kind])
        assert np.linalg.det(own[[1, 2 if kind != "pyramid" else 3, 3 if kind != "pyramid" else 4]] - own[0]) > 0
        if second:
            between = {frozenset(pair): number for pair, number in firsts.items()}
            edges = next(edges for corners, edges in BETWEEN.values() if corners == NAMES[kind])
            for k, edge in enumerate(edges.split()):
                corners = [found[0, int(end) - 1] for end in edge]
                assert found[0, shape.corners + k] == between[frozenset(corners)]
        counts[kind] = counts.get(kind, 0) + 1
    assert counts == {"wedge": 12, "pyramid": 6, "tetra": 24}


def test_collapsed_quadrilaterals():
    for turn in range(4):
        nodes = np.roll([5, 6, 7, 7], turn)
        ((shape, _, found),) = uncollapsed(shape_of(2, 4), nodes[None])
        assert (shape.name, sorted(found[0].tolist())) == ("triangle", [5, 6, 7])
        middles = {frozenset((5, 6)): 8, frozenset((6, 7)): 9, frozenset((7, 5)): 10, frozenset((7,)): 7}
        second = [*nodes, *(middles[frozenset((nodes[k], nodes[(k + 1) % 4]))] for k in range(4))]
        ((shape, _, found),) = uncollapsed(shape_of(2, 8), np.array([second]))
        a, b, c = found[0, :3].tolist()
        assert shape.name == "triangle6"
        assert found[0, 3:].tolist() == [middles[frozenset(pair)] for pair in ((a, b), (b, c), (c, a))]


def test_what_is_collapsed_to_no_element_stays():
    rows = np.array([[1, 2, 3, 4], [1, 2, 2, 2], [1, 2, 1, 3], [1, 1, 2, 3]])
    kept, triangles = uncollapsed(shape_of(2, 4), rows)
    assert (kept[0].name, kept[1].tolist(), kept[2].tolist()) == ("quad", [0, 1, 2], rows[:3].tolist())
    assert (triangles[0].name, triangles[1].tolist()) == ("triangle", [3])


def test_free_faces_of_collapsed_and_neighbouring_elements(tmp_path):
    """A cube cut into a wedge that is a collapsed hexahedron, and a wedge: 9 faces outside, and one between."""
    nodes = "".join(f"{k},{x},{y},{z}\n" for k, (x, y, z) in enumerate(CUBE, 1))
    text = f"*NODE\n{nodes}*ELEMENT,TYPE=C3D8,ELSET=A\n1,1,2,3,3,5,6,7,7\n*ELEMENT,TYPE=C3D6,ELSET=B\n2,1,3,4,5,7,8\n"
    deck = read(tmp_path, text + "*SURFACE,NAME=OUT\nA\nB\n")
    assert deck.surfaces["OUT"].faces.tolist() == free_faces(deck).tolist()
    assert free_faces(deck).tolist() == [[0, 0], [0, 1], [0, 2], [0, 3], [1, 0], [1, 1], [1, 3], [1, 4]]
    areas = {shape.name: len(found) for shape, found in face_nodes(deck, free_faces(deck))}
    assert areas == {"triangle": 4, "quad": 4}
