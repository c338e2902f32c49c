"""Rigid surfaces in decks, of elements and of lines, against rigid foundations by hand."""

import numpy as np
import pytest

import enumsol
from enumsol import fem

PLANE = """*NODE
11, 0., 1.
12, 1., 1.
13, 2., 1.
14, 0., 3.
15, 1., 3.
16, 2., 3.
*ELEMENT, TYPE={type}, ELSET=UPPER
11, 11, 12, 15, 14
12, 12, 13, 16, 15
*NSET, NSET=TOP
14, 15, 16
*SURFACE, NAME=UNDER
11, S1
12, S1
"""
SOLID = """*NODE
1, 0., 0., 1.
2, 1., 0., 1.
3, 1., 1., 1.
4, 0., 1., 1.
5, 0., 0., 3.
6, 1., 0., 3.
7, 1., 1., 3.
8, 0., 1., 3.
*ELEMENT, TYPE=C3D8, ELSET=UPPER
11, 1, 2, 3, 4, 5, 6, 7, 8
*NSET, NSET=TOP
5, 6, 7, 8
*SURFACE, NAME=UNDER
11, S1
"""
REST = """*MATERIAL, NAME=SOFT
*ELASTIC
100., 0.3
*SOLID SECTION, ELSET=UPPER, MATERIAL=SOFT
*SURFACE INTERACTION, NAME=DRY
*FRICTION
0.3
*CONTACT PAIR, INTERACTION=DRY
UNDER, FLOOR
*BOUNDARY
99, 1, 6
*STEP
*STATIC
*BOUNDARY
{moves}*END STEP
"""
#: A floor a little below, by elements; the nodes from left to right have it below their left.
LINES = """*NODE
21, -1., 0.9
22, 1.2, 0.9
23, 3., 0.9
99, 0., 0.
*ELEMENT, TYPE={rigid}, ELSET=RIGID
21, 21, 22
22, 22, 23
*SURFACE, NAME=FLOOR
RIGID, SPOS
*RIGID BODY, REF NODE=99, ELSET=RIGID
"""
SEGMENTS = """*NODE
99, 0., 0.
*SURFACE, TYPE=SEGMENTS, NAME=FLOOR
START, -1., 0.9
LINE, 3., 0.9
*RIGID BODY, REF NODE=99, ANALYTICAL SURFACE=FLOOR
"""
FACETS = """*NODE
21, -1., -1., 0.9
22, 3., -1., 0.9
23, 3., 3., 0.9
24, -1., 3., 0.9
99, 0., 0., 0.
*ELEMENT, TYPE=R3D3, ELSET=RIGID
21, 21, 22, 23
22, 21, 23, 24
*SURFACE, NAME=FLOOR
RIGID, SPOS
*RIGID BODY, REF NODE=99, ELSET=RIGID
"""
#: Lines along x, swept along y.
SWEPT = """*NODE
99, 0., 0., 0.
*SURFACE, TYPE=CYLINDER, NAME=FLOOR
0., 0., 0.9, 1., 0., 0.9
0., 1., 0.9
START, -1., 0.
LINE, 3., 0.
*RIGID BODY, REF NODE=99, ANALYTICAL SURFACE=FLOOR
"""


@pytest.fixture
def read(tmp_path):
    def read(text):
        (tmp_path / "model.inp").write_text(text)
        return enumsol.read_deck(tmp_path / "model.inp")

    return read


def by_hand(body, down=-0.2, aside=0.0, rise=0.0, plane="strain"):
    """The upper block alone over a floor that is 0.1 lower, which may rise and move aside."""
    if body == PLANE:
        points = np.array([[0, 1], [1, 1], [2, 1], [0, 3], [1, 3], [2, 3]], dtype=float)
        cells, below, top = np.array([[0, 1, 4, 3], [1, 2, 5, 4]]), np.array([[0, 1], [1, 2]]), np.array([3, 4, 5])
        options = {"displacement": {"TOP": (aside, down)}, "plane": plane}
    else:
        points = np.array([[x, y, z] for z in (1, 3) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))], dtype=float)
        cells, below, top = np.arange(8)[None], np.array([[0, 3, 2, 1]]), np.arange(4, 8)
        options = {"displacement": {"TOP": (aside, 0.0, down)}}
    mesh = fem.PartedMesh(points, cells, {"UNDER": below}, {"TOP": top}, {})
    gap = 0.1 - rise
    return fem.mesh_problem(mesh, young=100.0, poisson=0.3, contact="UNDER", friction=0.3, gap=gap, **options)


MOVES = {2: "TOP, 1, 1, 0.\nTOP, 2, 2, -0.2\n", 3: "TOP, 1, 2, 0.\nTOP, 3, 3, -0.2\n"}
FLOORS = {
    "elements": (PLANE.format(type="CPE4") + LINES.format(rigid="R2D2"), "strain"),
    "elements in plane stress": (PLANE.format(type="CPS4") + LINES.format(rigid="R2D2"), "stress"),
    "lines": (PLANE.format(type="CPE4") + SEGMENTS, "strain"),
    "a line without its end": (
        PLANE.format(type="CPE4") + SEGMENTS.replace("LINE, 3.", "LINE, 1., 0.9\nLINE, 3."),
        "strain",
    ),
    "elements the other way round": (
        PLANE.format(type="CPE4")
        + LINES.format(rigid="R2D2")
        .replace("21, 22\n", "22, 21\n")
        .replace("22, 23\n", "23, 22\n")
        .replace("SPOS", "SNEG"),
        "strain",
    ),
    "an element that is its reference": (
        PLANE.format(type="CPE4")
        + LINES.format(rigid="R2D2").replace("99, 0., 0.\n", "").replace("NODE=99", "NODE=21"),
        "strain",
    ),
}


@pytest.mark.parametrize("name", FLOORS)
def test_a_rigid_line_that_is_held_is_a_foundation(read, name):
    text, plane = FLOORS[name]
    rest = REST.replace("99, 1, 6", "21, 1, 6") if "reference" in name else REST
    problem = read(text + rest.format(moves=MOVES[2])).problem()
    assert_same_contact(problem, by_hand(PLANE, plane=plane))


def assert_same_contact(one, two):
    """Two problems have the same contact laws at the same nodes, in the order of their rows."""
    roots, others = (enumsol.enumerate_roots(each, 0) for each in (one, two))
    assert roots.complete
    assert others.complete
    assert len(roots) == len(others) > 0
    assert one.p == two.p
    np.testing.assert_allclose(np.sort(one.gap), np.sort(two.gap), atol=1e-12)
    for root, other in zip(roots, others, strict=True):
        assert sorted(map(str, root.statuses)) == sorted(map(str, other.statuses))
        np.testing.assert_allclose(np.sort(root.lambda_n), np.sort(other.lambda_n), rtol=1e-9)


@pytest.mark.parametrize("name", ["facets", "swept lines"])
def test_a_rigid_surface_that_is_held_is_a_foundation_in_3d(read, name):
    floor = {"facets": FACETS, "swept lines": SWEPT}[name]
    problem = read(SOLID + floor + REST.format(moves=MOVES[3])).problem()
    assert_same_contact(problem, by_hand(SOLID))


def test_a_rigid_line_that_rises_closes_the_gap(read):
    moves = MOVES[2] + "99, 2, 2, 0.03\n"
    problem = read(PLANE.format(type="CPE4") + SEGMENTS + REST.format(moves=moves)).problem()
    assert_same_contact(problem, by_hand(PLANE, rise=0.03))


def test_an_axisymmetric_rigid_line(read):
    text = PLANE.format(type="CAX4") + LINES.format(rigid="RAX2").replace("21, -1.", "21, 0.")
    rest = REST.replace("*BOUNDARY\n99", "*BOUNDARY\n11, 1\n14, 1\n99")
    problem = read(text + rest.format(moves=MOVES[2])).problem()
    assert_same_contact(problem, by_hand(PLANE, plane="axisymmetric"))


def test_a_rigid_surface_of_an_instance_is_turned_with_it(read):
    floor = SEGMENTS.replace("START, -1., 0.9\nLINE, 3., 0.9", "START, -1., 0.\nLINE, 3., 0.")
    parts = (
        f"*PART, NAME=BLOCK\n{PLANE.format(type='CPE4')}*SOLID SECTION, ELSET=UPPER, MATERIAL=SOFT\n*END PART\n"
        f"*PART, NAME=TABLE\n{floor}*END PART\n*ASSEMBLY, NAME=A\n*INSTANCE, NAME=B, PART=BLOCK\n*END INSTANCE\n"
        "*INSTANCE, NAME=T, PART=TABLE\n0., 0.9, 0.\n*END INSTANCE\n*END ASSEMBLY\n"
    )
    rest = REST.replace("*SOLID SECTION, ELSET=UPPER, MATERIAL=SOFT\n", "").replace("UNDER, FLOOR", "B.UNDER, T.FLOOR")
    rest = rest.replace("99, 1, 6", "T.99, 1, 6").format(moves=MOVES[2].replace("TOP", "B.TOP"))
    assert_same_contact(read(parts + rest).problem(), by_hand(PLANE))


WRONG = {
    "a curve": (
        SEGMENTS.replace("LINE, 3., 0.9", "CIRCL, 3., 0.9, 1., 0."),
        r"line \d+: \*SURFACE has CIRCL with 4 numbers; expected LINE",
    ),
    "no line": (SEGMENTS.replace("LINE, 3., 0.9\n", ""), r"line \d+: \*SURFACE has no line"),
    "a line of no length": (SEGMENTS.replace("LINE, 3.", "LINE, -1."), r"line \d+: \*SURFACE has a line of no length"),
    "a revolution": (
        SEGMENTS.replace("SEGMENTS", "REVOLUTION"),
        r"line \d+: \*SURFACE is of type REVOLUTION, which is not read",
    ),
    "a swept line in the plane": (SWEPT, r"line \d+: \*SURFACE FLOOR is not of the dimension of the bodies"),
    "axes in line": (SWEPT.replace("0., 1., 0.9", "2., 0., 0.9"), r"line \d+: \*SURFACE has three points in line"),
    "both sides": (
        LINES.format(rigid="R2D2") + "*SURFACE, NAME=CELLAR\nRIGID, SNEG\n",
        r"line \d+: element 21 of type R2D2 has a surface on both",
    ),
    "no rigid body": (
        LINES.format(rigid="R2D2").replace("*RIGID BODY, REF NODE=99, ELSET=RIGID\n", ""),
        r"line \d+: elements of type R2D2 are rigid lines",
    ),
    "no reference": (SEGMENTS.replace("REF NODE=99, ", ""), r"line \d+: \*RIGID BODY has no REF NODE"),
    "another surface": (
        SEGMENTS.replace("SURFACE=FLOOR", "SURFACE=FLOR"),
        r"line \d+: \*SURFACE FLOOR is of no \*RIGID BODY; expected one with ANALYTICAL SURFACE=FLOOR",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_rigid_surfaces_that_cannot_be_used_are_refused_with_their_line(read, name):
    text, words = WRONG[name]
    with pytest.raises(enumsol.InvalidProblemError, match=words) as found:
        read(PLANE.format(type="CPE4") + text + REST.format(moves=MOVES[2])).problem()
    assert "\n" not in str(found.value)
