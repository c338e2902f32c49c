"""Materials, sections and local directions of decks."""

import numpy as np
import pytest
from refusals import bad_argument
from written_decks import SQUARE, read, unused

MATERIAL = "*MATERIAL, NAME=Steel\n"
ENGINEERING = "ENGINEERING CONSTANTS"


def material(folder, text, **options):
    deck = read(folder, SQUARE + MATERIAL + text, **options)
    assert list(deck.materials) == ["STEEL"]
    return deck.materials["STEEL"]


@pytest.mark.parametrize(
    ("text", "kind", "constants"),
    [
        ("*ELASTIC\n210000., 0.3\n", "ISO", [210000, 0.3]),
        ("*elastic, type=iso\n 2.1E5 , .3,\n", "ISO", [210000, 0.3]),
        ("*Elastic, type=ISOTROPIC\n2.1D5, .3, 293.\n", "ISO", [210000, 0.3]),
        ("*ELASTIC\n210000.,0.3,293.\n210000.,0.3,393.\n", "ISO", [210000, 0.3]),
        ("*ELASTIC\n5.\n", "ISO", None),
        ("*ELASTIC,TYPE=ENGINEERING CONSTANTS\n1,2,3,0,0,.1,4,5\n6\n", ENGINEERING, [1, 2, 3, 0, 0, 0.1, 4, 5, 6]),
        ("*ELASTIC,TYPE=ENGINEERINGCONSTANTS\n1,2,3,0,0,0,4,5,\n6,20.\n", ENGINEERING, [1, 2, 3, 0, 0, 0, 4, 5, 6]),
        ("*ELASTIC,TYPE=ORTHO\n9,1,9,1,1,9,4,4,\n4\n", "ORTHO", [9, 1, 9, 1, 1, 9, 4, 4, 4]),
    ],
)  # fmt: skip
def test_elastic(tmp_path, text, kind, constants):
    if constants is None:
        bad_argument(r"line 10: \*ELASTIC has 1 number; expected 2", read, tmp_path, SQUARE + MATERIAL + text)
        return
    own = material(tmp_path, text)
    assert (own.elastic, own.constants.tolist(), own.elastic_place.line) == (kind, constants, 9)


def test_density_and_expansion(tmp_path):
    own = material(tmp_path, "*DENSITY\n7.8e-9,\n*EXPANSION, ZERO=20.\n1.2e-5\n")
    assert (own.density, own.expansion.tolist(), own.zero) == (7.8e-9, [1.2e-5], 20)
    own = material(tmp_path, "*Density\n0.\n*Expansion, type=ORTHO\n1.,2.,3.\n")
    assert (own.density, own.expansion.tolist(), own.zero) == (0, [1, 2, 3], 0)
    own = material(tmp_path, "*ELASTIC\n1,0\n")
    assert (own.density, own.expansion) == (None, None)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("*ELASTIC\n-1., 0.3\n", r"line 10: \*ELASTIC has E = -1 and nu = 0.3; expected Young's modulus > 0"),
        ("*ELASTIC\n1., 0.5\n", "has E = 1 and nu = 0.5; expected .* below 0.5"),
        ("*ELASTIC\n0., 0.\n", "has E = 0 and nu = 0"),
        ("*ELASTIC\n1., 0.3\n2., 0.3, 100.\n", r"line 11: .ELASTIC depends on the temperature .2 different lines"),
        ("*ELASTIC\n", "line 9: .ELASTIC has 0 lines of data; expected 2 numbers"),
        ("*ELASTIC\n1., x\n", "line 10: .ELASTIC has 'x'; expected a number"),
        ("*ELASTIC\n1,.3,20,5\n", "has 4 numbers; expected 2, and a temperature"),
        ("*ELASTIC,TYPE=ANISO\n1,2\n", "line 9: .ELASTIC is of type ANISO, which is not read; expected"),
        ("*ELASTIC,MODULI=INSTANTANEOUS\n1,.3\n", "has the option MODULI, which is not read; expected none but TYPE"),
        ("*ELASTIC,TYPE=ORTHO\n9,1,9,1,1,9,4,4\n", "has 1 line of data; expected 9 numbers"),
        ("*DENSITY\n-7\n", "line 10: .DENSITY is -7; expected a density of at least 0"),
        ("*DENSITY\n7,20\n8,40\n", "line 11: .DENSITY depends on the temperature"),
        ("*EXPANSION,TYPE=ANISO\n1,2\n", "is of type ANISO, which is not read; expected ISO or ORTHO"),
        ("*EXPANSION,TYPE=ORTHO\n1,2\n", "has 2 numbers; expected 3"),
        ("*EXPANSION,ZERO=x\n1\n", "has 'x'; expected a number"),
        ("*MATERIAL,NAME=steel\n", "line 9: .MATERIAL is named STEEL like another one"),
        ("*MATERIAL\n", "line 9: .MATERIAL has no NAME"),
    ],
)  # fmt: skip
def test_materials_that_are_refused(tmp_path, text, message):
    bad_argument(message, read, tmp_path, SQUARE + MATERIAL + text)


@pytest.mark.parametrize("card", ["ELASTIC\n1,.3", "DENSITY\n1", "EXPANSION\n1"])
def test_cards_that_belong_to_a_material(tmp_path, card):
    bad_argument("belongs to no material; expected it behind .MATERIAL", read, tmp_path, f"{SQUARE}*{card}\n")


def test_solid_sections(tmp_path):
    text = "*ORIENTATION,NAME=O\n1,0,0,0,1,0\n*Solid Section, elset=body, material=steel, orientation=o\n0.5,\n"
    deck = read(tmp_path, SQUARE + MATERIAL + text + "*SOLID SECTION, ELSET=REST, MATERIAL=STEEL\n")
    first, second = deck.sections
    assert (first.elements, first.material, first.thickness, first.orientation) == ("BODY", "STEEL", 0.5, "O")
    assert (second.elements, second.thickness, second.orientation) == ("REST", None, "")
    assert (first.place.line, second.place.line) == (11, 13)
    for wrong, message in (
        ("ELSET=BODY\n1.\n", "line 8: .SOLID SECTION has no MATERIAL"),
        ("MATERIAL=M\n1.\n", "has no ELSET"),
        ("ELSET=BODY,MATERIAL=M\n-1.\n", "line 9: .SOLID SECTION has the thickness -1; expected one > 0"),
        ("ELSET=BODY,MATERIAL=M,COMPOSITE\n1.\n", "has the option COMPOSITE, which is not read"),
    ):
        bad_argument(message, read, tmp_path, f"{SQUARE}*SOLID SECTION,{wrong}")


def test_orientations(tmp_path):
    text = "*ORIENTATION,NAME=A\n1,0,0,0,1,0\n*Orientation, name=b, system=cylindrical\n0,0,0,0,0,1\n2, 30.\n"
    deck = read(tmp_path, SQUARE + text + "*ORIENTATION,NAME=C,SYSTEM=R\n2,1,1,1,2,1,1,1,1\n")
    a, b, c = (deck.orientations[name] for name in "ABC")
    assert (a.system, a.points.tolist(), a.origin.tolist(), a.rotation) == (
        "RECTANGULAR", [[1, 0, 0], [0, 1, 0]], [0, 0, 0], None
    )  # fmt: skip
    assert (b.system, b.points.tolist(), b.rotation) == ("CYLINDRICAL", [[0, 0, 0], [0, 0, 1]], (2, 30))
    assert c.origin.tolist() == [1, 1, 1]
    for wrong, message in (
        ("NAME=A\n1,0,0,2,0,0\n", "line 9: .ORIENTATION has points that give no directions"),
        ("NAME=A\n1,0,0,0,1\n", "has 5 numbers in a line; expected 6 to 9"),
        ("NAME=A,SYSTEM=C\n1,0,0,1,0,0\n", "has points that give no directions"),
        ("NAME=A,SYSTEM=SPHERICAL\n1,0,0,1,0,0\n", "has the system SPHERICAL, which is not read"),
        ("NAME=A\n1,0,0,0,1,0\n4,10.\n", "line 10: .ORIENTATION turns about the axis 4; expected 1, 2 or 3"),
        ("NAME=A\n", "has 0 lines of data; expected two points"),
        ("SYSTEM=C\n0,0,0,0,0,1\n", "has no NAME"),
    ):
        bad_argument(message, read, tmp_path, f"{SQUARE}*ORIENTATION,{wrong}")


def test_local_directions_of_an_instance_turn_with_it(tmp_path):
    text = (
        f"*PART,NAME=P\n{SQUARE}*ORIENTATION,NAME=O\n1,0,0,0,1,0\n*SOLID SECTION,ELSET=BODY,MATERIAL=M,ORIENTATION=O\n"
    )
    text += (
        "*END PART\n*ASSEMBLY,NAME=A\n*INSTANCE,NAME=I,PART=P\n0,0,1\n0,0,0,0,0,1,90\n*END INSTANCE\n*END ASSEMBLY\n"
    )
    deck = read(tmp_path, text)
    own = deck.orientations["I.O"]
    assert np.allclose(own.points, [[0, 1, 1], [-1, 0, 1]], atol=1e-15)
    assert own.origin.tolist() == [0, 0, 1]
    assert deck.sections[0].orientation == "I.O"


def test_account_of_materials(tmp_path):
    text = MATERIAL + "*ELASTIC\n210000.,0.3\n*DENSITY\n7.8e-9\n*EXPANSION\n1.2e-5\n"
    text += "*SOLID SECTION,ELSET=BODY,MATERIAL=STEEL\n2.\n"
    deck = read(tmp_path, SQUARE + text + "*NODE PRINT,NSET=A\nU\n*PREPRINT\n*NODEFILE\nU\n")
    assert [entry.became for entry in deck.account][2:7] == [
        "material STEEL", "elastic law of STEEL: iso, 210000, 0.3", "density of STEEL: 7.8e-09",
        "thermal expansion of STEEL: 1.2e-05", "elements of BODY are of STEEL, 2 thick",
    ]  # fmt: skip
    assert unused(deck) == [
        f"line {line}: *{card} not used: it asks for output"
        for line, card in ((17, "NODE PRINT"), (19, "PREPRINT"), (20, "NODEFILE"))
    ]
