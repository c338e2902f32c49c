"""Decks with one card more or less, against the same problem described by hand, and in one sentence where it cannot be."""
# ruff: noqa: E501 (tables of decks)

from pathlib import Path

import numpy as np
import pytest
from small_decks import CONTACT, HELD, MATERIALS, MESH, PRESSED, assert_same, by_hand, deck, step

import enumsol
from enumsol import fem

DECKS = Path(__file__).parents[1] / "decks"
SIDE = {"SIDE": (0.0, None)}
TOP = {"TOP": (None, -0.01)}
DOWN = "*BOUNDARY\nTOP, 2, 2, -0.01\n"
PUSH = "*DLOAD\n12, P2, 2.\n"


@pytest.fixture
def read(tmp_path):
    def read(text, **options):
        (tmp_path / "model.inp").write_text(text)
        return enumsol.read_deck(tmp_path / "model.inp", **options)

    return read


#: The upper block with its underside a little above the lower one.
LIFTED = (
    MESH.replace("11, 0., 1.", "11, 0., 1.004")
    .replace("12, 1., 1.", "12, 1., 1.004")
    .replace("13, 2., 1.", "13, 2., 1.004")
)
#: Decks by what is special about them, with the options that describe the same.
RIGHT = {
    "plain": (deck(), {}),
    "a support by one component after the other": (
        deck(held="*BOUNDARY\nBOTTOM, 1\nBOTTOM, 2\nSIDE, 1, 1\n*BOUNDARY\nTOP, 2\n"), {}
    ),
    "supports by names": (deck(held="*BOUNDARY\nBOTTOM, ENCASTRE\nSIDE, XSYMM\nTOP, 2\n"), {}),
    "supports by numbers of nodes": (deck(held="*BOUNDARY\n1, PINNED\n2, 1, 2\n3, 1, 3\n11, 1\n14, 1\nTOP, 2\n"), {}),
    "a support of the third component in the plane": (deck(held=HELD + "*BOUNDARY\nALL, 3, 3\n"), {}),
    "a displacement in the step only": (deck(held="*BOUNDARY\nBOTTOM, 1, 2\n", steps=step(
        "*BOUNDARY\nSIDE, 1, 1, 0.\nTOP, 2, 2, -0.01\n" + PUSH)), {}),
    "supports that begin anew": (deck(held="*BOUNDARY\nALL, 1, 2\n", steps=step(
        "*BOUNDARY, OP=NEW\nBOTTOM, 1, 2\nSIDE, 1\nTOP, 2, 2, -0.01\n" + PUSH)), {}),
    "supports to which others are added": (deck(held="*BOUNDARY\nBOTTOM, 1, 2\n", steps=step(
        "*BOUNDARY, OP=MOD\nSIDE, 1\nTOP, 2, 2, -0.01\n" + PUSH)), {}),
    "a force": (deck(steps=step(DOWN + "*CLOAD\n13, 1, -0.5\n")), {"pressure": None, "force": {"NODE": (-0.5, 0)}}),
    "forces on a set that add up": (deck(steps=step(DOWN + "*CLOAD\nEDGE, 1, -0.5\n*CLOAD\n13, 1, -0.25\n16, 1, -0.25\n"),
        mesh=MESH + "*NSET, NSET=EDGE\n13, 16\n"), {"pressure": None, "force": {"EDGE": (-0.75, 0)}}),
    "pressure on a set of elements": (deck(mesh=MESH + "*ELSET, ELSET=LAST\n12\n", steps=step(DOWN + "*DLOAD\nLAST, P2, 2.\n")), {}),
    "pressure on a surface": (deck(steps=step(DOWN + "*DSLOAD\nRIGHT, P, 2.\n")), {}),
    "pressure on another surface": (deck(steps=step("*DSLOAD, OP=NEW\nABOVE, P, 3.\n"), held="*BOUNDARY\nBOTTOM, 1, 2\nSIDE, 1\n"),
        {"displacement": SIDE, "pressure": {"ABOVE": 3.0}, "max_rigid_displacement": "auto"}),
    "gravity": (deck(steps=step(DOWN + "*DLOAD\nUPPER, GRAV, 9.81, 0., -1., 0.\nLOWER, GRAV, 9.81, 0., -1.\n")),
        {"pressure": None, "body_force": {"UPPER": (0, -2 * 9.81), "LOWER": (0, -3 * 9.81)}}),
    "gravity of all": (deck(mesh=MESH + "*ELSET, ELSET=EVERY\nUPPER, LOWER\n", steps=step(DOWN + "*DLOAD\nEVERY, GRAV, 9.81, 1., 0., 0.\n")),
        {"pressure": None, "body_force": {"UPPER": (2 * 9.81, 0), "LOWER": (3 * 9.81, 0)}}),
    "gravity of all elements": (deck(steps=step(DOWN + "*DLOAD\n, GRAV, 9.81, 1., 0., 0.\n")), {"pressure": None, "body_force": {"UPPER": (2 * 9.81, 0), "LOWER": (3 * 9.81, 0)}}),
    "rotation": (deck(steps=step(DOWN + "*DLOAD\nUPPER, Centrif, 0.5, 1., 2., 0., 0., 0., 1.\n12, P2, 2.\n")), {"centrifugal": {"UPPER": (2 * 0.5, 1, 2, 0, 0, 0, 1)}}),
    "rotation of all elements about an axis in the plane": (deck(steps=step(DOWN + "*DLOAD\n, CENTRIF, 0.5, 1., 0., 0., 0., 1.\n")),
        {"pressure": None, "centrifugal": {"UPPER": (2 * 0.5, 1, 0, 0, 0, 1, 0), "LOWER": (3 * 0.5, 1, 0, 0, 0, 1, 0)}}),
    "forces per volume": (deck(steps=step(DOWN + "*DLOAD\nUPPER, BX, 0.5\nUPPER, BY, -0.25\n12, P2, 2.\n")), {"body_force": {"UPPER": (0.5, -0.25)}}),
    "force per volume of an element": (deck(steps=step(DOWN + "*DLOAD\n12, BX, 0.5\n")), {"pressure": None, "body_force": {"LAST": (0.5, 0)}}),
    "an amplitude": (deck(materials="*AMPLITUDE, NAME=RISE\n0., 0., 0.5, 0.5,\n2., 2.\n" + MATERIALS,
        steps=step("*BOUNDARY\nTOP, 2, 2, -0.01\n*DLOAD, AMPLITUDE=RISE\n12, P2, 2.\n")), {}),
    "an amplitude of a displacement over a longer step": (deck(materials=MATERIALS + "*AMPLITUDE, NAME=RISE\n0., 0., 4., 1.\n",
        steps="*STEP\n*STATIC\n0.1, 2.\n*BOUNDARY, AMPLITUDE=RISE\nTOP, 2, 2, -0.02\n" + PUSH + "*END STEP\n"), {}),
    "a smooth amplitude": (deck(materials=MATERIALS + "*Section Controls, name=EC-1, hourglass=ENHANCED\n1., 1., 1.\n"
        "*AMPLITUDE, NAME=RISE, DEFINITION=SMOOTH STEP\n0., 0., 4., 1.\n",
        steps=step("*BOUNDARY\nTOP, 2, 2, -0.01\n*DLOAD, AMPLITUDE=RISE\n12, P2, 10.\n")), {"pressure": {"RIGHT": 1.03515625}}),
    "a smooth amplitude at the end of a time": (deck(materials=MATERIALS + "*AMPLITUDE, NAME=RISE, DEFINITION=SMOOTH STEP\n0., 0., 0.5, 0.1, 1., 2.\n",
        steps=step("*BOUNDARY\nTOP, 2, 2, -0.01\n*DLOAD, AMPLITUDE=RISE\n12, P2, 1.\n")), {}),
    "plane stress and a thickness": (deck(type="CPS4", materials=MATERIALS.replace("MATERIAL=SOFT\n*SOLID", "MATERIAL=SOFT\n0.5,\n*SOLID").replace("MATERIAL=HARD\n", "MATERIAL=HARD\n0.5\n")),
        {"plane": "stress", "thickness": 0.5}),
    "no friction": (deck(contact="*SURFACE INTERACTION, NAME=DRY\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=HARD\n*CONTACT PAIR, INTERACTION=DRY\nUNDER, ON\n"), {"friction": 0.0}),
    "friction with a stiffness of sticking": (deck(contact=CONTACT.replace("0.3\n", "0.25, 1E6\n").replace("*FRICTION", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=EXPONENTIAL\n0.001, 10.\n*FRICTION")), {"friction": 0.25}),
    "the pair the other way round": (deck(contact=CONTACT.replace("UNDER, ON", "ON, UNDER")), {"pairs": [("ON", "UNDER")]}),
    "a clearance": (deck(contact=CONTACT + "*CLEARANCE, SLAVE=UNDER, MASTER=ON, VALUE=0.004\n"), {"pairs": [("UNDER", "ON", 0.004)]}),
    "a press fit": (deck(contact=CONTACT + "*CLEARANCE, MASTER=ON, SLAVE=UNDER, VALUE=-0.004\n"), {"pairs": [("UNDER", "ON", -0.004)]}),
    "contact of a surface of nodes": (deck(mesh=MESH + "*SURFACE, NAME=POINTS, TYPE=NODE\n11\n12\n13\n", contact=CONTACT.replace("UNDER", "POINTS")), {}),
    "contact of nodes without facets": (deck(mesh=MESH + "*SURFACE, NAME=CORNERS, TYPE=NODE\n11\n13\n", contact=CONTACT.replace("UNDER", "CORNERS")), {"pairs": [("CORNERS", "ON")]}),
    "gaps that are closed": (deck(mesh=LIFTED, contact=CONTACT.replace("DRY\nUNDER", "DRY, ADJUST=0.01\nUNDER")), {}),
    "a press fit that is taken away": (deck(mesh=LIFTED.replace("1.004", "0.996"), contact=CONTACT.replace("DRY\nUNDER", "DRY, ADJUST=0.\nUNDER")), {}),
    "named surfaces of all contacts": (deck(contact="*SURFACE INTERACTION, NAME=DRY\n*FRICTION\n0.3\n*CONTACT\n*CONTACT INCLUSIONS\nUNDER, ON\n*CONTACT PROPERTY ASSIGNMENT\n , , DRY\n"), {}),
    "properties of one of all contacts": (deck(mesh=LIFTED.replace("1.004", "0.996"), contact="*CONTACT\n*CONTACT INCLUSIONS\nUNDER, ON\n*CONTACT PROPERTY ASSIGNMENT\nON, UNDER, DRY\n*SURFACE INTERACTION, NAME=DRY\n*FRICTION\n0.3\n"), {}),
    "all contacts without friction": (deck(contact="*CONTACT\n*CONTACT INCLUSIONS\nUNDER, ON\n"), {"friction": 0.0}),
    "gaps of a set that are closed": (deck(mesh=LIFTED + "*NSET, NSET=LOW\n11, 12, 13\n", contact=CONTACT.replace("DRY\nUNDER", "DRY, ADJUST=LOW\nUNDER")), {}),
    "a press fit that is taken up in the step": (deck(mesh=LIFTED.replace("1.004", "1."), contact=CONTACT + "*CLEARANCE, MASTER=ON, SLAVE=UNDER, VALUE=-0.004\n",
        steps=step(DOWN + PUSH + "*Contact Interference, shrink\nUNDER, ON\n")), {"pairs": [("UNDER", "ON", -0.004)]}),
    "dampers": (deck(contact=CONTACT.replace("*CONTACT PAIR", "*CONTACT DAMPING, DEFINITION=DAMPING COEFFICIENT\n1.\n*CONTACT PAIR")), {}),
    "a behavior that changes": (deck(steps=step("*CHANGE SURFACE BEHAVIOR, INTERACTION=DRY\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n1E6\n" + DOWN + PUSH)), {}),
    "a pair that is taken out and put back": (deck(steps=step("*MODEL CHANGE, TYPE=CONTACT PAIR, REMOVE\nUNDER, ON\n*MODEL CHANGE, TYPE=CONTACT PAIR, ADD\nUNDER, ON\n" + DOWN + PUSH)), {}),
    "one of two pairs that is taken out": (deck(contact=CONTACT + "*CONTACT PAIR, INTERACTION=DRY\nRIGHT, ABOVE\n", steps=step("*Model change, type=CONTACT PAIR, remove\nRIGHT, ABOVE\n" + DOWN + PUSH)), {}),
    "friction that changes in the step": (deck(steps=step("*CHANGE FRICTION, INTERACTION=DRY\n*FRICTION\n0.1\n" + DOWN + PUSH)), {"friction": 0.1}),
    "friction that changes to none": (deck(steps=step("*CHANGE FRICTION, INTERACTION=DRY\n*FRICTION\n0.\n" + DOWN + PUSH)), {"friction": 0.0}),
}  # fmt: skip
PARTS = {
    "nodes": {"EDGE": [8, 11], "NODE": [8], "POINTS": [6, 7, 8], "CORNERS": [6, 8]},
    "bodies": {"LAST": [3]},
}


@pytest.mark.parametrize("name", RIGHT)
def test_decks_are_the_problems_that_they_describe(read, name):
    text, options = RIGHT[name]
    assert_same(read(text).problem(), by_hand(PARTS, **options))
    lower = "\n".join(line if line.startswith("**") else line.lower() for line in text.splitlines())
    assert_same(read(lower).problem(), by_hand(PARTS, **options))


#: Decks that are refused, with words of the one sentence that says why.
WRONG = {
    "no contact": (deck(contact=""), r"model.inp has no \*CONTACT PAIR; expected contact"),
    "no step": (deck(steps=""), r"model.inp has no \*STEP"),
    "a step without an end": (deck(steps="*STEP\n*STATIC\n"), r"line \d+: \*STEP has no \*END STEP"),
    "a step in a step": (deck(steps="*STEP\n*STATIC\n*STEP\n"), r"line \d+: \*STEP begins before the step before it"),
    "a step of no kind": (deck(steps="*STEP\n*END STEP\n"), r"line \d+: \*END STEP ends step 1, which has no \*STATIC"),
    "large displacements": (deck(steps=step(DOWN, ", NLGEOM")), r"line \d+: \*STEP has NLGEOM"),
    "vibrations about a state": (deck(steps=step(DOWN, ", PERTURBATION")), r"line \d+: \*STATIC stands in a step with PERTURBATION"),
    "dynamics": (deck(steps="*STEP\n*DYNAMIC\n1., 1.\n*END STEP\n"), r"line \d+: \*DYNAMIC"),
    "plasticity": (deck(materials=MATERIALS.replace("*DENSITY\n2.", "*PLASTIC\n1., 0.")), r"line \d+: \*PLASTIC .*--ignore PLASTIC"),
    "rubber": (deck(materials=MATERIALS.replace("*DENSITY\n2.", "*HYPERELASTIC, NEO HOOKE\n1., 0.1")), r"line \d+: \*HYPERELASTIC"),
    "no such set": (deck(held="*BOUNDARY\nBOTOM, 1, 2\n"), r"line \d+: .*BOTOM"),
    "no such component": (deck(held="*BOUNDARY\nBOTTOM, 0, 2\n"), r"line \d+: \*BOUNDARY has the components 0, 2"),
    "a temperature as displacement": (deck(held="*BOUNDARY\nBOTTOM, 11, 11, 20.\n"), r"line \d+: \*BOUNDARY has the components 11"),
    "a velocity": (deck(steps=step("*BOUNDARY, TYPE=VELOCITY\nTOP, 2, 2, 1.\n")), r"line \d+: \*BOUNDARY has TYPE=VELOCITY"),
    "two displacements of one node": (deck(steps=step(DOWN + "*BOUNDARY\n15, 2, 2, 0.01\n")), r"line \d+: \*BOUNDARY gives component 2 of node 15 the value 0.01, .*-0.01"),
    "a displacement across the plane": (deck(steps=step("*BOUNDARY\nTOP, 3, 3, 0.1\n")), r"line \d+: \*BOUNDARY moves node 14 in component 3"),
    "a force across the plane": (deck(steps=step("*CLOAD\n16, 3, 0.1\n")), r"line \d+: \*CLOAD loads node 16 in component 3"),
    "a force that is no number": (deck(steps=step("*CLOAD\n16, 1, much\n")), r"line \d+: \*CLOAD has 'much'; expected a number"),
    "a force without a value": (deck(steps=step("*CLOAD\n16, 1\n")), r"line \d+: \*CLOAD has 2 entries in a line; expected 3"),
    "a force outside of steps": (deck(steps="*CLOAD\n16, 1, 1.\n" + PRESSED), r"line \d+: \*CLOAD stands outside of steps"),
    "a force that follows": (deck(steps=step("*CLOAD, FOLLOWER\n16, 1, 1.\n")), r"line \d+: \*CLOAD has FOLLOWER"),
    "two pressures on one face": (deck(steps=step(PUSH + "*DLOAD\n12, P2, 1.\n")), r"line \d+: \*DLOAD gives P2 of element 12 the value 1, .* 2 in the same step"),
    "a load that is none": (deck(steps=step("*DLOAD\n12, HP, 1.\n")), r"line \d+: \*DLOAD has the load HP"),
    "a face that is none": (deck(steps=step("*DLOAD\n12, P5, 1.\n")), r"line \d+: \*DLOAD loads P5 of element 12 of type CPE4, which has 4 faces"),
    "a pressure on nothing": (deck(steps=step("*DLOAD\n, P2, 1.\n")), r"line \d+: \*DLOAD has a line without a node, an element or a set"),
    "gravity without a direction": (deck(steps=step("*DLOAD\nUPPER, GRAV, 9.81\n")), r"line \d+: \*DLOAD has GRAV without a direction"),
    "gravity in a long direction": (deck(steps=step("*DLOAD\nUPPER, GRAV, 9.81, 0., -2., 0.\n")), r"line \d+: \*DLOAD has GRAV with a direction of length 2"),
    "rotation about no axis": (deck(steps=step("*DLOAD\nUPPER, CENTRIF, 0.5, 1., 2., 0.\n")), r"line \d+: \*DLOAD has CENTRIF without a direction; expected the speed squared, a point on the axis and three numbers"),
    "rotation about a long axis": (deck(steps=step("*DLOAD\nUPPER, CENTRIF, 0.5, 1., 2., 0., 0., 0., 2.\n")), r"line \d+: \*DLOAD has CENTRIF with a direction of length 2"),
    "rotation about two axes": (deck(steps=step("*DLOAD\nUPPER, CENTRIF, 0.5, 1., 2., 0., 0., 0., 1.\n11, CENTRIF, 0.5, 1., 0., 0., 0., 0., 1.\n")), r"line \d+: \*DLOAD has CENTRIF on element 11, as model.inp line \d+ has already; expected one axis"),
    "rotation without density": (deck(materials=MATERIALS.replace("*DENSITY\n2.\n", ""), steps=step("*DLOAD\nUPPER, CENTRIF, 0.5, 1., 2., 0., 0., 0., 1.\n")), r"line \d+: \*DLOAD has CENTRIF on elements of SOFT, which has no \*DENSITY"),
    "a pressure on a beam": (deck(mesh=MESH + "*ELEMENT, TYPE=B31, ELSET=BEAMS\n90, 4, 5\n", steps=step("*DLOAD\n90, P1, 2.\n")), r"line \d+: \*DLOAD loads P1 of element 90 of type B31, which is no body; expected elements of bodies"),
    "gravity without density": (deck(materials=MATERIALS.replace("*DENSITY\n2.\n", ""), steps=step("*DLOAD\nUPPER, GRAV, 9.81, 0., -1., 0.\n")), r"line \d+: \*DLOAD has GRAV on elements of SOFT, which has no \*DENSITY"),
    "a surface that is none": (deck(steps=step("*DSLOAD\nRIGTH, P, 1.\n")), r"line \d+: there is no surface of faces RIGTH"),
    "a traction": (deck(steps=step("*DSLOAD\nRIGHT, TRVEC, 1., 1., 0.\n")), r"line \d+: \*DSLOAD has the load TRVEC"),
    "an amplitude that is none": (deck(steps=step("*DLOAD, AMPLITUDE=RISE\n12, P2, 1.\n")), r"line \d+: \*DLOAD names the amplitude RISE; expected one of none"),
    "an amplitude backwards": (deck(materials=MATERIALS + "*AMPLITUDE, NAME=A\n1., 0., 0., 1.\n"), r"line \d+: \*AMPLITUDE has no pairs of rising times"),
    "a periodic amplitude": (deck(materials=MATERIALS + "*AMPLITUDE, NAME=A, DEFINITION=PERIODIC\n1., 1., 1., 1.\n"), r"line \d+: \*AMPLITUDE is no table"),
    "no such interaction": (deck(contact=CONTACT.replace("INTERACTION=DRY\nUNDER", "INTERACTION=WET\nUNDER")), r"line \d+: \*CONTACT PAIR names the interaction WET; expected one of DRY"),
    "no such surface": (deck(contact=CONTACT.replace("ON\n", "OFF\n").replace("FRICTIOFF", "FRICTION")), r"line \d+: \*CONTACT PAIR names OFF"),
    "one surface": (deck(contact=CONTACT.replace(", ON", "")), r"line \d+: \*CONTACT PAIR names UNDER; expected two surfaces"),
    "friction below 0": (deck(contact=CONTACT.replace("0.3", "-0.3")), r"line \d+: \*FRICTION has the coefficient -0.3"),
    "friction without limit": (deck(contact=CONTACT.replace("*FRICTION\n0.3", "*FRICTION, ROUGH")), r"line \d+: \*FRICTION has ROUGH"),
    "friction of nothing": (deck(contact="*FRICTION\n0.3\n"), r"line \d+: \*FRICTION stands without \*SURFACE INTERACTION"),
    "friction in a step": (deck(steps=step("*FRICTION\n0.1\n")), r"line \d+: \*FRICTION stands in a step without \*CHANGE FRICTION"),
    "another interaction changes": (deck(steps=step("*CHANGE FRICTION, INTERACTION=WET\n*FRICTION\n0.1\n")), r"line \d+: \*CHANGE FRICTION names the interaction WET"),
    "surfaces that cannot part": (deck(contact=CONTACT.replace("*FRICTION", "*SURFACE BEHAVIOR, NO SEPARATION\n*FRICTION")), r"line \d+: \*SURFACE BEHAVIOR has NO SEPARATION"),
    "large displacements, and how to do without": (deck(steps=step(DOWN, ", NLGEOM=YES")), r"line \d+: \*STEP has NLGEOM.*--ignore NLGEOM \(in Python"),
    "a frequency analysis": (deck(steps=PRESSED + "*STEP\n*FREQUENCY\n5\n*END STEP\n"), r"line \d+: \*FREQUENCY is another analysis than \*STATIC.*--ignore FREQUENCY"),
    "a surface of nodes that others face": (deck(mesh=MESH + "*SURFACE, NAME=POINTS, TYPE=NODE\n4\n6\n", contact=CONTACT.replace("UNDER, ON", "UNDER, POINTS")), r"line \d+: \*SURFACE POINTS has node 4, which belongs to no facet whose nodes are all in it; expected the nodes of whole facets"),
    "a surface of nodes and of faces": (deck(mesh=MESH + "*SURFACE, NAME=UNDER, TYPE=NODE\n11\n"), r"line \d+: \*SURFACE gives UNDER as nodes and as faces, also in model.inp line \d+"),
    "a surface of faces and of nodes": (deck(mesh=MESH + "*SURFACE, NAME=P, TYPE=NODE\n11\n*SURFACE, NAME=P\n11, S1\n"), r"line \d+: \*SURFACE gives P as nodes and as faces"),
    "a surface of nodes of no body": (deck(mesh=MESH + "*NODE\n99, 9., 9.\n*SURFACE, NAME=POINTS, TYPE=NODE\n99\n", contact=CONTACT.replace("UNDER", "POINTS")), r"line \d+: \*SURFACE POINTS has no node of a body"),
    "elements that are taken out": (deck(steps=step("*MODEL CHANGE, TYPE=ELEMENT, REMOVE\n11\n")), r"line \d+: \*MODEL CHANGE changes other things"),
    "a pair that is none is taken out": (deck(steps=step("*MODEL CHANGE, TYPE=CONTACT PAIR, REMOVE\nON, UNDER\n")), r"line \d+: \*MODEL CHANGE names the pair ON:UNDER; .* UNDER:ON"),
    "all pairs are taken out": (deck(steps=step("*MODEL CHANGE, TYPE=CONTACT PAIR, REMOVE\nUNDER, ON\n")), r"line \d+: no pair is in contact in step 1"),
    "an interference of no pair": (deck(steps=step("*CONTACT INTERFERENCE\nUNDER, OF\n")), r"line \d+: \*CONTACT INTERFERENCE names the pair UNDER:OF"),
    "an interference by an amplitude": (deck(steps=step("*CONTACT INTERFERENCE, AMPLITUDE=A\nUNDER, ON\n")), r"line \d+: \*CONTACT INTERFERENCE has the option AMPLITUDE"),
    "a behavior of nothing changes": (deck(steps=step("*CHANGE SURFACE BEHAVIOR, INTERACTION=WET\n")), r"line \d+: \*CHANGE SURFACE BEHAVIOR names the interaction WET"),
    "a behavior in a step": (deck(steps=step("*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=HARD\n")), r"line \d+: \*SURFACE BEHAVIOR stands in a step without \*CHANGE SURFACE BEHAVIOR"),
    "all that is outside": (deck(contact="*CONTACT\n*CONTACT INCLUSIONS, ALL EXTERIOR\n"), r"line \d+: \*CONTACT INCLUSIONS has ALL EXTERIOR; expected the surfaces"),
    "a surface with nothing": (deck(contact="*CONTACT\n*CONTACT INCLUSIONS\nUNDER,\n"), r"line \d+: \*CONTACT INCLUSIONS has UNDER:; expected two named surfaces"),
    "inclusions in nothing": (deck(contact="*CONTACT INCLUSIONS\nUNDER, ON\n"), r"line \d+: \*CONTACT INCLUSIONS has UNDER:ON; expected two named surfaces behind \*CONTACT"),
    "properties of no pair": (deck(contact="*CONTACT\n*CONTACT INCLUSIONS\nUNDER, ON\n*CONTACT PROPERTY ASSIGNMENT\nUNDER, ABOVE, DRY\n"), r"line \d+: \*CONTACT PROPERTY ASSIGNMENT gives DRY to UNDER:ABOVE"),
    "all contacts of a step": (deck(steps=step("*CONTACT\n")), r"line \d+: \*CONTACT stands in a step"),
    "an adjustment of no set": (deck(contact=CONTACT.replace("DRY\nUNDER", "DRY, ADJUST=BOTTUM\nUNDER")), r"line \d+: node 'BOTTUM' is not in the deck"),
    "a clearance of no pair": (deck(contact=CONTACT + "*CLEARANCE, SLAVE=ON, MASTER=UNDER, VALUE=0.1\n"), r"line \d+: \*CLEARANCE names the pair ON:UNDER; .* UNDER:ON"),
    "a clearance of no size": (deck(contact=CONTACT + "*CLEARANCE, SLAVE=UNDER, MASTER=ON\n"), r"line \d+: \*CLEARANCE has no VALUE"),
    "contact in a step": (deck(steps=step("*CONTACT PAIR, INTERACTION=DRY\nUNDER, ON\n")), r"line \d+: \*CONTACT PAIR stands in a step"),
    "two coefficients of one surface": (deck(contact=CONTACT + "*SURFACE INTERACTION, NAME=WET\n*CONTACT PAIR, INTERACTION=WET\nUNDER, RIGHT\n"), r"line \d+: the surface UNDER has friction"),
    "elements of no material": (deck(materials=MATERIALS.replace("*SOLID SECTION, ELSET=UPPER, MATERIAL=SOFT\n", "")), r"element 11 and 1 others have no \*SOLID SECTION"),
    "no such material": (deck(materials=MATERIALS.replace("MATERIAL=SOFT", "MATERIAL=SOFTER")), r"line \d+: \*SOLID SECTION names the material SOFTER"),
    "an unknown card": (deck(steps=step("*CREEP LOAD\n1.\n")), r"line \d+: \*CREEP LOAD is not read, .*--ignore CREEPLOAD"),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_what_cannot_be_used_is_refused_in_one_sentence_with_its_line(read, name):
    text, words = WRONG[name]
    with pytest.raises(enumsol.InvalidProblemError, match=words) as found:
        read(text).problem()
    assert "\n" not in str(found.value)
    assert "model.inp" in str(found.value)


def test_gaps_beyond_the_distance_stay(read):
    far = read(deck(mesh=LIFTED, contact=CONTACT.replace("DRY\nUNDER", "DRY, ADJUST=0.002\nUNDER"))).problem()
    assert far.node_ids == (11, 12, 13)
    np.testing.assert_allclose(far.gap, 0.004, rtol=1e-9)
    np.testing.assert_allclose(far.coordinates[:, 1], 1.004)


def test_what_is_ignored_is_said(read):
    text = deck(
        materials=MATERIALS.replace("*DENSITY\n2.", "*PLASTIC\n1., 0."), steps=step(DOWN + PUSH, ", NLGEOM, INC=100")
    )
    model = read(text, ignore=["plastic", "NLGEOM"])
    assert_same(model.problem(), by_hand(density=None))
    assert "*PLASTIC              not used, as you say" in str(model)
    assert "NLGEOM is ignored: displacements are small" in str(model)


def test_a_load_on_elements_that_are_ignored_is_refused_with_their_line(read):
    beams = "*ELEMENT, TYPE=B31, ELSET=BEAMS\n90, 4, 5\n"
    text = deck(mesh=MESH + beams, steps=step("*DLOAD\n90, P1, 2.\n"))
    words = r"element '90' is not in the deck, whose elements of model.inp line 39 are left out; expected a number"
    with pytest.raises(enumsol.InvalidProblemError, match=words):
        read(text, ignore=["B31"])


def test_the_step_of_an_analysis_that_is_ignored_is_left_out_as_a_whole(read):
    other = "*STEP, PERTURBATION\n*FREQUENCY\n5\n*BOUNDARY\nTOP, 2, 2\n*END STEP\n"
    model = read(deck(steps=PRESSED + other), ignore=["FREQUENCY"])
    assert model.step_count == 1
    assert "left out as a whole" in str(model)
    assert_same(model.problem(), by_hand())


def test_the_account_names_every_card_with_its_line(read):
    text = deck(steps=step(DOWN + PUSH + "*NODE FILE\nU\n"))
    told = str(read(text))
    for number, line in enumerate(text.splitlines(), 1):
        if line.startswith("*") and not line.startswith(("*HEADING", "*END", "*STATIC")):
            name = line.split(",")[0]
            rows = [row for row in told.splitlines() if f" {name} " in row]
            assert any(str(number) in row.split("*")[0] for row in rows), (number, line)
    assert "not used" in next(row for row in told.splitlines() if "*NODE FILE" in row)


# -- histories ---------------------------------------------------------------------------------------------------------

SIDEWAYS = step("*BOUNDARY\nSIDE, 1, 1, 0.\n" + DOWN)


def test_loads_of_steps_stay_are_replaced_and_end(read):
    steps = [
        step(DOWN + "*CLOAD\n16, 1, 1.\n13, 1, 2.\n"),
        step("*CLOAD\n16, 1, 5.\n"),
        step("*CLOAD, OP=NEW\n16, 1, 3.\n*DLOAD\n12, P2, 1.\n"),
        step("*DLOAD, OP=NEW\n11, BX, 1.\n"),
    ]
    model = read(deck(steps="".join(steps)))
    parts = {"nodes": {"A": [11], "B": [8]}, "bodies": {"FIRST": [2]}}
    options = [
        {"force": {"A": (1, 0), "B": (2, 0)}},
        {"force": {"A": (5, 0), "B": (2, 0)}},
        {"force": {"A": (3, 0)}, "pressure": {"RIGHT": 1.0}},
        {"force": {"A": (3, 0)}, "body_force": {"FIRST": (1, 0)}},
    ]
    by_steps = [by_hand(parts, **{"pressure": None, **each}) for each in options]
    for number, other in enumerate(by_steps, 1):
        assert_same(model.problem(number), other)
    np.testing.assert_allclose([given.load for given in model.steps()], [other.f for other in by_steps], atol=1e-12)


@pytest.mark.parametrize(
    ("first", "second", "words"),
    [
        ("*DSLOAD\nRIGHT, P, 2.\n", "*DLOAD, OP=NEW\n12, BX, 1.\n", r"\*DLOAD with OP=NEW follows loads by \*DSLOAD"),
        (
            "*DLOAD\nUPPER, GRAV, 9.81, 0., -1., 0.\n",
            "*DLOAD\nUPPER, GRAV, 9.81, 1., 0., 0.\n",
            "gravity in another direction",
        ),
    ],
)
def test_steps_that_programs_read_differently_are_refused(read, first, second, words):
    with pytest.raises(enumsol.InvalidProblemError, match=rf"line \d+: .*{words}"):
        read(deck(steps=step(DOWN + first) + step(second)))


def test_gravity_that_begins_anew_turns(read):
    turned = step(DOWN + "*DLOAD\nUPPER, GRAV, 9.81, 0., -1., 0.\n") + step(
        "*DLOAD, OP=NEW\nUPPER, GRAV, 9.81, 1., 0., 0.\n"
    )
    assert_same(read(deck(steps=turned)).problem(2), by_hand(pressure=None, body_force={"UPPER": (2 * 9.81, 0)}))


def test_amplitudes_end_with_their_step_unless_they_are_of_all_time(read):
    table = "*AMPLITUDE, NAME={}{}\n0., 0., 1., 0.5, 2., 1., 3., 0.25\n"
    materials = MATERIALS + table.format("OWN", "") + table.format("ALL", ", TIME=TOTAL TIME")
    first = step(DOWN + "*CLOAD, AMPLITUDE=OWN\n16, 1, 8.\n*CLOAD, AMPLITUDE=ALL\n13, 1, 8.\n")
    model = read(deck(materials=materials, steps=first + step("") + step("")))
    parts = {"nodes": {"A": [11], "B": [8]}}
    for number, (own, of_all) in enumerate([(4, 4), (4, 8), (4, 2)], 1):
        assert_same(model.problem(number), by_hand(parts, pressure=None, force={"A": (own, 0), "B": (of_all, 0)}))


def test_a_motion_of_nodes_without_contact_and_friction_are_steps_of_a_history(read):
    second = step("*BOUNDARY\nTOP, 2, 2, -0.02\n*CHANGE FRICTION, INTERACTION=DRY\n*FRICTION\n0.1\n")
    model = read(deck(steps=PRESSED + second))
    first, then = by_hand(), by_hand(friction=0.1, displacement={"SIDE": (0.0, None), "TOP": (None, -0.02)})
    found = enumsol.histories(model.problem(1), model.steps())
    expected = enumsol.histories(first, [enumsol.LoadStep(load=p.f, friction=p.friction) for p in (first, then)])
    assert (found.complete, found.counts) == (True, expected.counts)
    assert [step.friction.max() for step in model.steps()] == [0.3, 0.1]


@pytest.mark.parametrize(
    ("cards", "what"),
    [
        ("*BOUNDARY, OP=NEW\nBOTTOM, 1, 2\nSIDE, 1\n", "what is held"),
        ("*BOUNDARY\nBOTTOM, 2, 2, 0.01\n", "the displacement of nodes that are in contact or faced by such"),
    ],
)
def test_steps_that_change_more_than_loads_are_refused(read, cards, what):
    base = MESH.replace("*ELEMENT, TYPE={type}, ELSET=LOWER", "*ELEMENT, TYPE={type}, ELSET=LOWER")
    held = HELD if "NEW" in cards else HELD.replace("BOTTOM, 1, 2", "LOWEST, 1, 2")
    mesh = base + "*NSET, NSET=LOWEST\n1, 2, 3, 4, 5, 6\n"
    cards = cards if "NEW" in cards else cards.replace("BOTTOM", "LOWEST")
    with pytest.raises(enumsol.InvalidProblemError, match=rf"line \d+: step 2 changes {what}"):
        read(deck(mesh=mesh, held=held, steps=PRESSED + step(cards))).steps()


def test_steps_with_other_pairs_in_contact_are_no_history(read):
    """As many rows in both, of the nodes of the other body in the second."""
    out, back = (f"*MODEL CHANGE, TYPE=CONTACT PAIR, {word}\n" for word in ("REMOVE", "ADD"))
    first = step(out + "ON, UNDER\n" + DOWN + PUSH)
    second = step(out + "UNDER, ON\n" + back + "ON, UNDER\n")
    contact = CONTACT + "*CONTACT PAIR, INTERACTION=DRY\nON, UNDER\n"
    plain = read(deck(contact=contact, steps=first + second))  # nodes that face each other: the same laws
    assert_same(plain.problem(1), by_hand())
    assert_same(plain.problem(2), by_hand(pairs=[("ON", "UNDER")]))
    assert len(plain.steps()) == 2
    mesh = MESH.replace("2, 1., 0.\n", "2, 1.2, 0.\n", 1).replace("5, 1., 1.\n", "5, 1.2, 1.\n", 1)
    model = read(deck(mesh=mesh, contact=contact, steps=first + second))
    assert model.problem(1).p == model.problem(2).p
    with pytest.raises(enumsol.InvalidProblemError, match=r"line \d+: step 2 changes which pairs are in contact"):
        model.steps()


def test_of_several_steps_one_is_named(read):
    model = read(deck(steps=PRESSED + step("*DLOAD\n12, P2, 4.\n")))
    with pytest.raises(enumsol.InvalidArgumentError, match="has 2 steps; expected a history of them"):
        model.problem()
    with pytest.raises(enumsol.InvalidArgumentError, match="step is 3; expected one of 1 to 2"):
        model.problem(3)
    assert_same(model.problem(2), by_hand(pressure={"RIGHT": 4.0}))
    assert model.step_count == 2


# -- bodies in 3D ------------------------------------------------------------------------------------------------------


def cube(first_node, element, z):
    """A brick of 20 nodes at a height, as lines of *NODE and *ELEMENT."""
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    ends = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
    points = np.array([*corners, *(np.mean([corners[a], corners[b]], axis=0) for a, b in ends)]) + np.array([0, 0, z])
    numbers = [first_node + k for k in range(20)]
    nodes = "".join(f"{n}, {x}, {y}, {w}\n" for n, (x, y, w) in zip(numbers, points.tolist(), strict=True))
    first, rest = ", ".join(map(str, numbers[:14])), ", ".join(map(str, numbers[14:]))
    return nodes, f"{element}, {first},\n{rest}\n", dict(zip(numbers, points.tolist(), strict=True))


def test_bricks_of_20_nodes_are_held_and_loaded_at_the_nodes_that_the_deck_names(read):
    lower, upper = cube(1, 1, 0.0), cube(101, 2, 1.0)
    places = {**lower[2], **upper[2]}

    def those(condition):
        return "\n".join(str(n) for n, place in places.items() if condition(n, *place)) + "\n"

    text = (
        f"*NODE\n{lower[0]}{upper[0]}*ELEMENT, TYPE=C3D20, ELSET=BODY\n{lower[1]}{upper[1]}"
        f"*NSET, NSET=BOTTOM\n{those(lambda n, x, y, z: z == 0)}*NSET, NSET=LEFT\n{those(lambda n, x, y, z: n > 100 and x == 0)}"
        f"*NSET, NSET=FRONT\n{those(lambda n, x, y, z: n > 100 and y == 0)}*NSET, NSET=TOP\n{those(lambda n, x, y, z: z == 2)}"
        "*SURFACE, NAME=UNDER\n2, S1\n*SURFACE, NAME=ON\n1, S2\n"
        "*MATERIAL, NAME=M\n*ELASTIC\n100., 0.3\n*SOLID SECTION, ELSET=BODY, MATERIAL=M\n"
        + CONTACT
        + "*BOUNDARY\nBOTTOM, 1, 3\nLEFT, 1\nFRONT, 2\nTOP, 3\n"
        + step("*BOUNDARY\nTOP, 3, 3, -0.01\n*CLOAD\nLEFT, 2, 0.5\nTOP, 1, 0.25\n")
    )
    model = read(text)
    scene = model.scene()
    fixed, points = scene.held.fixed, scene.mesh.points
    # the nodes in the middle of facets, which the deck cannot name, are held as those around them
    assert len(points) == 40 + 13 + 1
    for axis, near in enumerate((points[:, 0] == 0, points[:, 1] == 0)):
        assert np.all(fixed[near & (points[:, 2] > 1), axis])
    assert np.all(fixed[points[:, 2] == 2, 2])
    assert np.all(fixed[points[:, 2] == 0])
    # forces act on the 8 nodes that it names
    np.testing.assert_allclose(scene.forces.sum(axis=0), [8 * 0.25, 8 * 0.5, 0])
    assert np.count_nonzero(np.any(scene.forces, axis=1)) == 13
    problem = model.problem()
    roots = enumsol.enumerate_roots(problem, 0)
    assert roots.complete
    assert {node for node in problem.node_ids if isinstance(node, int)} <= set(range(101, 121))


def test_a_deck_of_parts_and_instances():
    model = enumsol.read_deck(DECKS / "instances.inp")
    problem = model.problem()
    assert problem.node_ids == tuple(f"BLOCK-2.{k}" for k in (1, 2, 3, 4))
    box = fem.box(1, 1, 1)
    points = np.concatenate([box.points, box.points + np.array([0, 0, 1])])
    facets = {"under": box.facets["bottom"] + 8, "on": box.facets["top"], "above": box.facets["top"] + 8}
    mesh = fem.SolidMesh(points, np.concatenate([box.cells, box.cells + 8]), {**facets, "foot": box.facets["bottom"]})
    other = fem.mesh_problem(
        mesh, young=210000, poisson=0.3, pairs=[("under", "on")], friction=0.2, clamp="foot",
        displacement={"above": (0.001, 0, -0.001)}, pressure={"above": 10.0},
    )  # fmt: skip
    one, two = (enumsol.enumerate_roots(body, 0) for body in (problem, other))
    assert (one.complete, len(one)) == (two.complete, len(two)) == (True, 1)
    order = [int(np.argmin(np.linalg.norm(other.coordinates - place, axis=1))) for place in problem.coordinates]
    np.testing.assert_allclose(one[0].lambda_n, two[0].lambda_n[order], rtol=1e-9)
    np.testing.assert_allclose(problem.areas, other.areas[order])


def test_options_that_change_nothing_are_said(read):
    contact = CONTACT.replace("DRY\nUNDER", "DRY, TYPE=SURFACE TO SURFACE, SMALL SLIDING\nUNDER")
    model = read(deck(contact=contact, steps=step(DOWN + PUSH, ", INC=100").replace("*STATIC", "*STATIC, DIRECT")))
    assert_same(model.problem(), by_hand())
    for card, option in (("*STEP", "INC"), ("*STATIC", "DIRECT"), ("*CONTACT PAIR", "TYPE")):
        assert f"; {option} is not used" in next(row for row in str(model).splitlines() if f" {card} " in row)


# -- temperatures, and axisymmetric bodies -----------------------------------------------------------------------------

WARM = MATERIALS.replace("*DENSITY\n2.", "*EXPANSION\n1E-3\n*DENSITY\n2.").replace(
    "*DENSITY\n3.", "*EXPANSION, ZERO=20.\n2E-3\n*DENSITY\n3."
)
COLD = "*INITIAL CONDITIONS, TYPE=TEMPERATURE\nALL, 20.\n"
EXPANSION = {"expansion": {"UPPER": 1e-3, "LOWER": 2e-3}}


def test_temperatures_of_steps_strain_the_body(read):
    steps = (
        step(DOWN + "*TEMPERATURE\nALL, 30.\n")
        + step("*TEMPERATURE, OP=NEW\nTOP, 25.\n")
        + step("*TEMPERATURE\n14, 21.\n")
    )
    model = read(deck(materials=WARM, contact=CONTACT + COLD, steps=steps))
    for number, change in enumerate(([10.0] * 12, [0.0] * 9 + [5.0] * 3, [0.0] * 9 + [1.0, 5.0, 5.0]), 1):
        assert_same(model.problem(number), by_hand(pressure=None, temperature=change, **EXPANSION))
    assert len(model.steps()) == 3


def test_temperatures_without_initial_ones_count_from_0_and_amplitudes_count(read):
    steps = step(DOWN + PUSH + "*TEMPERATURE, AMPLITUDE=HALF\nALL, 10.\n")
    model = read(deck(materials=WARM + "*AMPLITUDE, NAME=HALF\n0., 0., 1., 0.5\n", steps=steps))
    assert_same(model.problem(), by_hand(temperature=[5.0] * 12, **EXPANSION))


def test_temperatures_where_nothing_expands_are_said_not_to_be_used(read):
    model = read(deck(steps=step(DOWN + PUSH + "*TEMPERATURE\nALL, 10.\n")))
    assert_same(model.problem(), by_hand())
    assert "*TEMPERATURE          not used: no material has *EXPANSION" in str(model)
    text = deck(
        steps=step(DOWN + PUSH + "*TEMPERATURE\nALL, 10.\n"), materials=MATERIALS.replace("2.", "2.\n*EXPANSION\n0.")
    )
    model = read(text + "\n")
    assert_same(model.problem(), by_hand())
    assert "*TEMPERATURE          not used: no material has *EXPANSION" in str(model)


@pytest.mark.parametrize(
    ("cards", "words"),
    [
        (
            {"materials": WARM.replace("1E-3", "1E-3, 1E-3, 1E-3").replace("*EXPANSION\n", "*EXPANSION, TYPE=ORTHO\n")},
            "EXPANSION of SOFT has 3 coefficients",
        ),
        (
            {"contact": CONTACT + COLD.replace("TYPE=TEMPERATURE", "TYPE=STRESS")},
            r"\*INITIAL CONDITIONS has TYPE=STRESS",
        ),
        ({"contact": CONTACT + COLD.replace("ALL", "EVERY")}, "EVERY"),
        ({"steps": step("*TEMPERATURE, FILE=heat\n")}, r"\*TEMPERATURE has FILE"),
        ({"steps": step("*TEMPERATURE\nALL\n")}, r"\*TEMPERATURE has 1 entries in a line; expected 2"),
    ],
)
def test_temperatures_that_cannot_be_used_are_refused(read, cards, words):
    given = {"materials": WARM, "steps": step(DOWN + "*TEMPERATURE\nALL, 10.\n"), **cards}
    with pytest.raises(enumsol.InvalidProblemError, match=rf"line \d+: .*{words}"):
        read(deck(**given)).problem()


def test_axisymmetric_elements_are_bodies_of_the_whole_circumference(read):
    steps = step(DOWN + PUSH + "*CLOAD\n13, 1, -0.5\n")
    model = read(deck(type="CAX4", held=HELD.replace("SIDE, 1\n", "SIDE, 1\n1, 1\n"), steps=steps))
    assert_same(model.problem(), by_hand(PARTS, plane="axisymmetric", force={"NODE": (-0.5, 0)}))
