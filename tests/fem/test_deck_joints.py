"""Constraints in decks against the same by hand: ties, couplings, rigid bodies, equations, springs, axes of nodes."""
# ruff: noqa: E501 (tables of decks)

import numpy as np
import pytest
from small_decks import CONTACT, HELD, MATERIALS, MESH, assert_same, by_hand, deck, step

import enumsol

DOWN = "*BOUNDARY\nTOP, 2, 2, -0.01\n"
SIDE = {"SIDE": (0.0, None)}
FREE = HELD.replace("TOP, 2, 2\n", "")
#: A third block, beside the upper one, whose left side is where the right side of the upper one is.
THIRD = """*NODE
21, 2., 1.
22, 3., 1.
23, 2., 3.
24, 3., 3.
*ELEMENT, TYPE={type}, ELSET=THIRD
21, 21, 22, 24, 23
*SURFACE, NAME=LEFT
21, S4
"""
POINT = "*NODE, NSET=REF\n99, 1., 4.\n"
MORE = MATERIALS + "*SOLID SECTION, ELSET=THIRD, MATERIAL=SOFT\n"


@pytest.fixture
def read(tmp_path):
    def read(text, **options):
        (tmp_path / "model.inp").write_text(text)
        return enumsol.read_deck(tmp_path / "model.inp", **options)

    return read


RIGID = {"rigid": {"P": "ABOVE"}, "reference": {"P": (1.0, 4.0)}}
RIGHT = {
    "an equation": (deck(contact=CONTACT + "*EQUATION\n2\n14, 2, 1., 16, 2, -1.\n", held=FREE, steps=step("*CLOAD\n15, 2, -1.\n")),
        {"pressure": None, "displacement": SIDE, "force": {"MIDDLE": (0, -1)}, "max_rigid_displacement": "auto",
         "equations": [{"terms": [[9, "y", 1.0], [11, "y", -1.0]]}]}),
    "an equation of three terms in two lines": (deck(contact=CONTACT + "*EQUATION\n3\n14, 2, 1., 15, 2, -2.\n16, 2, 1.\n", steps=step(DOWN.replace("TOP", "16") ), held=FREE),
        {"pressure": None, "displacement": {**SIDE, "LAST": (None, -0.01)}, "max_rigid_displacement": "auto",
         "equations": [{"terms": [[9, "y", 1.0], [10, "y", -2.0], [11, "y", 1.0]]}]}),
    "equations of a set": (deck(contact=CONTACT + "*EQUATION\n2\nTWO, 2, 1., 14, 2, -1.\n", mesh=MESH + "*NSET, NSET=TWO\n15, 16\n", held=FREE, steps=step("*BOUNDARY\n14, 2, 2, -0.01\n")),
        {"pressure": None, "displacement": {**SIDE, "FIRST": (None, -0.01)},
         "equations": [{"terms": [[10, "y", 1.0], [9, "y", -1.0]]}, {"terms": [[11, "y", 1.0], [9, "y", -1.0]]}]}),
    "nodes that are tied": (deck(contact=CONTACT + "*MPC\nTIE, 16, 15\n", steps=step(DOWN.replace("TOP", "14")), held=FREE),
        {"pressure": None, "displacement": {**SIDE, "FIRST": (None, -0.01)},
         "equations": [{"terms": [[11, c, 1.0], [10, c, -1.0]]} for c in "xy"]}),
    "a rigid coupling with a force and a moment": (deck(mesh=MESH + POINT, contact=CONTACT + "*COUPLING, REF NODE=99, SURFACE=ABOVE, CONSTRAINT NAME=C\n*KINEMATIC\n1, 2\n6\n", held=FREE, steps=step("*CLOAD\n99, 2, -1.\n99, 6, 0.2\n")),
        {"pressure": None, "displacement": SIDE, "force": {"P": (0, -1)}, "moment": {"P": 0.2}, "max_rigid_displacement": "auto", **RIGID}),
    "a rigid coupling that is moved and turned": (deck(mesh=MESH + POINT, contact=CONTACT + "*COUPLING, REF NODE=REF, SURFACE=ABOVE, CONSTRAINT NAME=C\n*KINEMATIC\n", held="*BOUNDARY\nBOTTOM, 1, 2\n", steps=step("*BOUNDARY\n99, 1, 1, 0.\n99, 2, 2, -0.02\nREF, 6, 6, 0.001\n")),
        {"pressure": None, "displacement": {"P": (0.0, -0.02, 0.001)}, **RIGID}),
    "a rigid body of nodes": (deck(mesh=MESH + POINT, contact=CONTACT + "*RIGID BODY, NSET=TOP, REF NODE=99\n", held=FREE, steps=step("*BOUNDARY\n99, 1, 2, 0.\n99, 2, 2, 0.\n*CLOAD\n99, 6, 0.2\n")),
        {"pressure": None, "displacement": {**SIDE, "P": (0.0, 0.0, None)}, "moment": {"P": 0.2}, **RIGID}),
    "a rigid body of elements, held": (deck(mesh=MESH + "*NODE\n99, 0., -1.\n98, 0., -1.\n", contact=CONTACT + "*RIGID BODY, ELSET=LOWER, REF NODE=99, ROT NODE=98\n", held=HELD.replace("BOTTOM, 1, 2", "99, 1, 3\n98, 1, 3")),
        {"clamp": "LOWEST"}),
    "a force that is distributed": (deck(mesh=MESH + POINT, contact=CONTACT + "*COUPLING, REF NODE=99, SURFACE=ABOVE, CONSTRAINT NAME=C\n*DISTRIBUTING\n1, 2\n", held=FREE, steps=step("*CLOAD\n99, 2, -1.\n")),
        {"pressure": None, "displacement": SIDE, "force": {"P": (0, -1)}, "max_rigid_displacement": "auto", "coupling": {"P": "ABOVE"}, "reference": {"P": (1.0, 4.0)}}),
    "a spring to the ground": (deck(mesh=MESH + "*ELEMENT, TYPE=SPRING1, ELSET=S\n91, 16\n92, 13\n", contact=CONTACT + "*SPRING, ELSET=S\n1\n5.\n"),
        {"node_spring": {"EDGE": (5.0, 0.0)}}),
    "a spring along a line to a point that is held": (deck(mesh=MESH + POINT + "*ELEMENT, TYPE=SPRINGA, ELSET=S\n91, 15, 99\n", contact=CONTACT + "*SPRING, ELSET=S\n\n5.\n", steps=step("*DLOAD\n12, P2, 2.\n"), held=FREE + "*BOUNDARY\n99, 1, 2\n"),
        {"displacement": SIDE, "node_spring": {"MIDDLE": (0.0, 5.0)}, "max_rigid_displacement": "auto"}),
    "a spring between two nodes": (deck(mesh=MESH + "*ELEMENT, TYPE=SPRING2, ELSET=S\n91, 13, 3\n", contact=CONTACT + "*SPRING, ELSET=S\n1, 1\n5.\n"),
        {"node_spring": {"8:2": (5.0, 0.0)}}),
    "a tie": (deck(mesh=MESH + THIRD, materials=MORE, contact=CONTACT + "*TIE, NAME=T, POSITION TOLERANCE=0.1\nLEFT, RIGHT\n", steps=step(DOWN + "*CLOAD\n24, 1, -1.\n")),
        {"pressure": None, "force": {"FAR": (-1, 0)}, "tie": [("LEFT", "RIGHT")], "third": True}),
    "a pair that is tied": (deck(mesh=MESH + THIRD, materials=MORE, contact=CONTACT + "*SURFACE INTERACTION, NAME=GLUE\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TIED\n*CONTACT PAIR, INTERACTION=GLUE\nLEFT, RIGHT\n", steps=step(DOWN + "*CLOAD\n24, 1, -1.\n")),
        {"pressure": None, "force": {"FAR": (-1, 0)}, "tie": [("LEFT", "RIGHT")], "third": True}),
    "rollers on a slope": (deck(contact=CONTACT + "*TRANSFORM, NSET=TOP, TYPE=R\n1., 0.5, 0., -0.5, 1., 0.\n"),
        {"transform": {"TOP": {"rectangular": (1.0, 0.5)}}}),
    "supports around an axis": (deck(contact=CONTACT + "*TRANSFORM, NSET=TOP, TYPE=C\n-1., -5., 0., -1., -5., 1.\n"),
        {"transform": {"TOP": {"cylindrical": (-1.0, -5.0)}}}),
}  # fmt: skip
PARTS = {"nodes": {"MIDDLE": [10], "LAST": [11], "FIRST": [9], "EDGE": [8, 11], "LOWEST": list(range(6))}}


@pytest.mark.parametrize("name", RIGHT)
def test_constraints_of_decks_are_those_that_they_describe(read, name):
    text, options = RIGHT[name]
    options = dict(options)
    parts = {key: dict(value) for key, value in PARTS.items()}
    if options.pop("third", False):
        parts = {"third": True, "nodes": {"FAR": [15]}}
        options |= {
            "young": {"UPPER": 100.0, "LOWER": 300.0, "THIRD": 100.0},
            "poisson": {"UPPER": 0.3, "LOWER": 0.2, "THIRD": 0.3},
            "density": {"UPPER": 2.0, "LOWER": 3.0, "THIRD": 2.0},
        }
    assert_same(read(text).problem(), by_hand(parts, **options))


WRONG = {
    "an equation that ends": (deck(contact=CONTACT + "*EQUATION\n3\n14, 2, 1., 16, 2, -1.\n"), r"line \d+: \*EQUATION has 2 of 3 terms"),
    "an equation of half a term": (deck(contact=CONTACT + "*EQUATION\n2\n14, 2, 1., 16, 2\n"), r"line \d+: \*EQUATION has 5 entries in a line; expected 3 for each term"),
    "an equation of sets of different sizes": (deck(contact=CONTACT + "*EQUATION\n2\nTOP, 2, 1., SIDE, 2, -1.\n"), r"line \d+: \*EQUATION has sets of different sizes"),
    "an equation of a rotation": (deck(contact=CONTACT + "*EQUATION\n2\n14, 6, 1., 16, 2, -1.\n"), r"line \d+: \*EQUATION has component 6 of node 14"),
    "nodes that stay in a plane": (deck(contact=CONTACT + "*MPC\nPLANE, 14, 15, 16\n"), r"line \d+: \*MPC is of type PLANE; expected TIE, PIN or BEAM"),
    "half a coupling": (deck(mesh=MESH + POINT, contact=CONTACT + "*COUPLING, REF NODE=99, SURFACE=ABOVE, CONSTRAINT NAME=C\n*KINEMATIC\n1, 1\n"), r"line \d+: \*COUPLING couples the components 1; expected all displacements, 1 to 2"),
    "a coupling of nothing": (deck(mesh=MESH + POINT, contact=CONTACT + "*COUPLING, REF NODE=99, SURFACE=NOWHERE, CONSTRAINT NAME=C\n*KINEMATIC\n"), r"line \d+: \*COUPLING names NOWHERE; expected a surface"),
    "a force that is distributed by weights": (deck(mesh=MESH + POINT, contact=CONTACT + "*COUPLING, REF NODE=99, SURFACE=ABOVE, CONSTRAINT NAME=C\n*DISTRIBUTING, WEIGHTING METHOD=CUBIC\n"), r"line \d+: \*DISTRIBUTING has WEIGHTING METHOD=CUBIC"),
    "a rigid body about its mean": (deck(mesh=MESH + POINT, contact=CONTACT + "*RIGID BODY, NSET=TOP, REF NODE=99, POSITION=CENTER OF MASS\n"), r"line \d+: \*RIGID BODY has the option POSITION"),
    "no coupling": (deck(contact=CONTACT + "*KINEMATIC\n1, 2\n"), r"line \d+: \*KINEMATIC stands without \*COUPLING"),
    "a rigid body without a node": (deck(contact=CONTACT + "*RIGID BODY, NSET=TOP\n"), r"line \d+: \*RIGID BODY has no REF NODE"),
    "a rigid body of nothing": (deck(mesh=MESH + POINT, contact=CONTACT + "*RIGID BODY, REF NODE=99\n"), r"line \d+: \*RIGID BODY has no NSET, ELSET or ANALYTICAL SURFACE"),
    "a rigid body of a surface that is none": (deck(contact=CONTACT + "*NODE\n99, 0., 9.\n*RIGID BODY, ANALYTICAL SURFACE=A, REF NODE=99\n"), r"line \d+: element 'A' is not in the deck"),
    "a force on a node of no body": (deck(mesh=MESH + POINT, steps=step("*CLOAD\n99, 2, 1.\n")), r"line \d+: \*CLOAD loads node 99, which belongs to no body"),
    "a tie of nothing": (deck(contact=CONTACT + "*TIE, NAME=T\nLEFT, RIGHT\n"), r"line \d+: \*TIE names LEFT; expected a surface"),
    "a tie of one surface": (deck(contact=CONTACT + "*TIE, NAME=T\nRIGHT\n"), r"line \d+: \*TIE names RIGHT; expected two surfaces"),
    "a spring that softens": (deck(contact=CONTACT + "*SPRING, ELSET=S\n1\n-5.\n"), r"line \d+: \*SPRING has the stiffness -5"),
    "a spring to a node that is free": (deck(mesh=MESH + POINT + "*ELEMENT, TYPE=SPRINGA, ELSET=S\n91, 15, 99\n", contact=CONTACT + "*SPRING, ELSET=S\n5.\n"), r"line \d+: \*SPRING ends at node 99, which belongs to no body and is not held in component 2"),
    "a spring with a curve": (deck(contact=CONTACT + "*SPRING, ELSET=S, NONLINEAR\n1\n5., 0.1\n"), r"line \d+: \*SPRING has NONLINEAR"),
    "a spring of solid elements": (deck(contact=CONTACT + "*SPRING, ELSET=UPPER\n1\n5.\n"), r"line \d+: \*SPRING is given for elements of type CPE4"),
    "axes out of the plane": (deck(contact=CONTACT + "*TRANSFORM, NSET=TOP, TYPE=R\n1., 0., 1., 0., 1., 0.\n"), r"line \d+: \*TRANSFORM turns out of the plane"),
    "axes of a sphere": (deck(contact=CONTACT + "*TRANSFORM, NSET=TOP, TYPE=S\n1., 0., 1., 0., 1., 0.\n"), r"line \d+: \*TRANSFORM has TYPE=S"),
    "axes of three numbers": (deck(contact=CONTACT + "*TRANSFORM, NSET=TOP\n1., 0., 1.\n"), r"line \d+: \*TRANSFORM has 3 numbers in a line; expected 6"),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_constraints_that_cannot_be_used_are_refused_with_their_line(read, name):
    text, words = WRONG[name]
    with pytest.raises(enumsol.InvalidProblemError, match=words) as found:
        read(text).problem()
    assert "\n" not in str(found.value)


def test_supports_of_nodes_of_no_body_are_told(read):
    model = read(deck(mesh=MESH + POINT, held=HELD + "*BOUNDARY\n99, 1, 3\n"))
    assert_same(model.problem(), by_hand())
    assert "*BOUNDARY             1 node of no body not used" in str(model)
    assert np.all(model.problem().node_ids == np.array([11, 12, 13]))
