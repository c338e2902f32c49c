"""Nodes, elements, sets, surfaces, parts and instances of decks."""

import numpy as np
import pytest
from refusals import bad_argument
from written_decks import SQUARE, labels, read, unused

from enumsol.decks.cards import DeckPlace

GRID = "*NODE\n" + "".join(f"{1 + k},{k % 4},{k // 4}\n" for k in range(12)) + "*ELEMENT,TYPE=CPE4,ELSET=ALL\n"
GRID += "".join(f"{10 * k},{a},{a + 1},{a + 5},{a + 4}\n" for k, a in enumerate((1, 2, 3, 5, 6, 7), 1))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("*NSET,NSET=A\n1,2,3\n", [1, 2, 3]),
        ("*NSET,NSET=A\n3,1\n2,2,\n", [1, 2, 3]),
        ("*NSET,NSET=A\n1\n*NSET,NSET=a\n2\n", [1, 2]),
        ("*NSET,NSET=A,GENERATE\n2,11,4\n", [2, 6, 10]),
        ("*NSET,GENERATE,NSET=A\n1,3\n12,12\n", [1, 2, 3, 12]),
        ("*NSET,NSET=A,GENERATE\n1,5,2\n*NSET,NSET=A\n12\n", [1, 3, 5, 12]),
        ("*NSET,NSET=B\n1,2\n*NSET,NSET=A\nB,7\n", [1, 2, 7]),
        ("*NSET,NSET=A\nB,C\n*NSET,NSET=B\n1\n*NSET,NSET=C\nB,5\n", [1, 5]),
        ("*NSET,NSET=A,ELSET=ALL\n", list(range(1, 13))),
        ("*ELSET,ELSET=E\n10\n*NSET,NSET=A,ELSET=E\n12\n", [1, 2, 5, 6, 12]),
        ("*NODE,NSET=A\n13,9,9\n14,9,8\n*NSET,NSET=A\n1\n", [1, 13, 14]),
        ("*NSET,NSET=A,UNSORTED,INTERNAL\n2\n", [2]),
    ],
)
def test_sets_of_nodes(tmp_path, text, expected):
    deck = read(tmp_path, GRID + text)
    assert labels(deck, deck.node_sets["A"]) == expected
    assert unused(deck) == []


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("*ELSET,ELSET=A\n10,20\n", [10, 20]),
        ("*ELSET,ELSET=A,GENERATE\n20,60,20\n", [20, 40, 60]),
        ("*ELSET,ELSET=A\nALL\n", [10, 20, 30, 40, 50, 60]),
        ("*ELSET,ELSET=B\n50\n*ELSET,ELSET=A\nB,\n10,\n", [10, 50]),
        ("*ELEMENT,TYPE=CPE3,ELSET=A\n70,1,2,5\n*ELEMENT,TYPE=CPE4,ELSET=A\n80,1,2,6,5\n", [70, 80]),
    ],
)
def test_sets_of_elements(tmp_path, text, expected):
    deck = read(tmp_path, GRID + text)
    assert deck.element_labels[deck.element_sets["A"]].tolist() == expected
    assert labels(deck, deck.nodes_of("1", None)) == [1]
    assert deck.elements_of("20", None).tolist() == [1]


def test_members_that_do_not_exist_are_named(tmp_path):
    """Both programs take such sets; a range of 1e9 numbers takes no memory."""
    deck = read(tmp_path, GRID + "*NSET,NSET=A\n1,70,80\n*ELSET,ELSET=B,GENERATE\n10,1000000010\n")
    assert labels(deck, deck.node_sets["A"]) == [1]
    assert len(deck.element_sets["B"]) == 6
    assert unused(deck) == [
        "line 21: *NSET set A: 70 and 80 not used: there are no such nodes",
        "line 24: *ELSET set B: 999999995 numbers not used: there are no such elements",
    ]


REFUSED = [
    ("*NSET\n1\n", "line 21: .NSET has no NSET; expected NSET=NAME"),
    ("*ELSET,ELSET=\n1\n", "line 21: .ELSET has no ELSET"),
    ("*NSET,NSET=A\nB\n", "line 22: there is no set of nodes named 'B'; expected one of A"),
    ("*ELSET,ELSET=A\n10,\nB\n", "line 23: there is no set of elements named 'B'"),
    ("*NSET,NSET=A\nB\n*NSET,NSET=B\nA\n", "the set A contains itself"),
    ("*ELSET,ELSET=A\nA\n", "line 21: the set A contains itself"),
    ("*NSET,NSET=A,GENERATE\n5,1\n", "line 22: .NSET goes from 5 to 1 by 1; expected a step of at least 1"),
    ("*NSET,NSET=A,GENERATE\n1,5,0\n", "goes from 1 to 5 by 0"),
    ("*NSET,NSET=A,GENERATE\n1,5,1,1\n", "has 4 numbers; expected first, last and step"),
    ("*NSET,NSET=A,INSTANCE=I\n1\n", "line 21: the instance I is not in the deck; expected one of none"),
    ("*NODE\n1,5,5\n", "line 21: node 1 is given again, at another position"),
    ("*NODE\n1.5,5,5\n", "line 22: .NODE has a line that begins with no number of a node"),
    ("*NODE\n-1,5,5\n", "begins with no number of a node"),
    ("*NODE\n13,0,0,0,0,0,0,0\n", "line 22: .NODE has 8 numbers in a line; expected 0 to 7"),
    ("*NODE,SYSTEM=C\n13,1,90\n", "has positions in the system C; expected SYSTEM=R"),
    ("*NMAP,NSET=A\n1,10,1\n", "line 21: .NMAP makes or moves nodes"),
    ("*SYSTEM\n1,2\n", "line 21: .SYSTEM makes or moves"),
    ("*ELEMENT,TYPE=CPE4\n10,1,2,6,5\n", "line 21: element 10 is given twice"),
    ("*ELEMENT,TYPE=CPE3\n70,1,2,99\n", "line 21: element 70 has the node 99, which is not in the deck"),
    ("*ELEMENT,TYPE=CPE4\n70,1,2,6\n80,1,2,6,5\n", "line 22: .ELEMENT has 9 numbers for one element; expected 5"),
    ("*ELEMENT,TYPE=CPE4\n70,1,2,6,5\n80,1,2,6,5,9\n", "line 23: .ELEMENT has 6 numbers for one element; expected 5"),
    ("*ELEMENT,TYPE=CPE4\n70,1,2,6\n", "line 22: .ELEMENT has 4 numbers for one element; expected 5"),
    ("*ELEMENT,TYPE=CPE3\n70,1,B,6\n", "line 22: .ELEMENT has 'B'; expected an integer"),
    ("*ELEMENT\n70,1,2,6\n", "line 21: .ELEMENT has no TYPE"),
    ("*ELEMENT,TYPE=U1\n70,1\n", "line 21: .ELEMENT has elements of type U1, which are not known; .* or --ignore U1"),
    ("*SURFACE,NAME=S\nALL,S5\n", "line 22: .SURFACE names the face S5 of elements of type CPE4; expected S1 to S4"),
    ("*SURFACE,NAME=S\n10,SPOS\n", "names the face SPOS of elements of type CPE4"),
    ("*SURFACE,NAME=S\n10,N\n", "names the face N of elements"),
    (
        "*SURFACE,NAME=S,TYPE=CUTTING SURFACE\n10,S1\n",
        "line 21: .SURFACE is of type CUTTING SURFACE, which",
    ),
    ("*SURFACE\n10,S1\n", "line 21: .SURFACE has no NAME"),
    ("*SURFACE,NAME=S\nB,S1\n", "line 22: there is no set of elements named 'B'"),
    ("*SURFACE,NAME=S,TYPE=NODE\nALL\n", "line 22: there is no set of nodes named 'ALL'"),
]


@pytest.mark.parametrize(("text", "message"), REFUSED)
def test_what_is_refused(tmp_path, text, message):
    bad_argument(message, read, tmp_path, GRID + text)


def test_elements_over_several_lines(tmp_path):
    """As programs write them: ten or sixteen numbers in a line, with or without a comma at its end."""
    nodes = "*NODE\n" + "".join(f"{k},{k},{k * k},{k**3 % 7}\n" for k in range(1, 28))
    for width, comma in ((10, ","), (16, ""), (7, ",")):
        text = nodes + "*ELEMENT,TYPE=C3D20\n"
        for label in (5, 6):
            every = [label, *range(label, 20 + label)]
            parts = [every[k : k + width] for k in range(0, 21, width)]
            text += "".join(",".join(map(str, part)) + comma + "\n" for part in parts)
        (block,) = read(tmp_path, text).blocks
        assert block.labels.tolist() == [5, 6]
        assert (block.nodes + 1).tolist() == [[*range(5, 25)], [*range(6, 26)]]
    text = nodes + "*ELEMENT,TYPE=C3D27\n1," + "".join(f"{k},\n" if k % 9 == 0 else f"{k}," for k in range(1, 28))
    assert (read(tmp_path, text).blocks[0].nodes + 1).tolist() == [[*range(1, 28)]]


def test_surfaces(tmp_path):
    """Of sets and of single elements, continued, of nodes, and of all faces that belong to one element only."""
    text = "*SURFACE,NAME=S,TYPE=ELEMENT\nALL,S1\n10,S4\n*surface,name=s\n40,s4\n*SURFACE,NAME=FREE\nALL\n"
    text += "*NSET,NSET=N\n1,2\n*SURFACE,NAME=P,TYPE=NODE\nN,1.\n4,\n"
    deck = read(tmp_path, GRID + text)
    assert deck.surfaces["S"].faces.tolist() == [[0, 0], [0, 3], [1, 0], [2, 0], [3, 0], [3, 3], [4, 0], [5, 0]]
    assert deck.surfaces["FREE"].faces.tolist() == [
        [0, 0], [0, 3], [1, 0], [2, 0], [2, 1], [3, 2], [3, 3], [4, 2], [5, 1], [5, 2]
    ]  # fmt: skip
    assert labels(deck, deck.surfaces["P"].nodes) == [1, 2, 4]


PARTS = (
    "*Heading\n*Part, name=Low\n" + SQUARE + "*Nset, nset=Top\n3, 4\n*Surface, name=Face\nBODY, S3\n*End Part\n"
    "*Part, name=Up\n" + SQUARE + "*Nset, nset=Top\n3, 4\n*Solid Section, elset=BODY, material=M\n*End Part\n"
    "*Assembly, name=A\n*Instance, name=Low-1, part=LOW\n*End Instance\n"
    "*Instance, name=Up-1, part=Up\n0., 1., 0.\n*End Instance\n"
    "*Instance, name=Up-2, part=Up\n1., 0., 0.\n0., 0., 0., 0., 0., 5., 90.\n*Nset, nset=Own\n1\n*End Instance\n"
    "*Node\n7, 9., 9., 9.\n*Nset, nset=Held, instance=Low-1\n1, 2\n*Nset, nset=HELD, instance=Up-1, generate\n3, 4\n"
    "*Nset, nset=Mixed\nUp-2.Top, Low-1.1, 7\n*Elset, elset=Both, instance=Low-1\nBODY\n*Elset, elset=Both\nUp-1.1\n"
    "*Surface, name=S\nUp-2.BODY, S1\nUp-1.1, S2\n*Nset, nset=Twice, instance=Up-1\nTop\n*End Assembly\n"
)


def test_instances_of_parts(tmp_path):
    """Moved, and then turned by 90 degrees about the z axis."""
    deck = read(tmp_path, PARTS)
    assert deck.points.tolist()[:9] == [[9, 9, 9], *([x, y, 0] for y, x in ((0, 0), (0, 1), (1, 1), (1, 0))),
                                        *([x, y, 0] for y, x in ((1, 0), (1, 1), (2, 1), (2, 0)))]  # fmt: skip
    assert np.allclose(deck.points[9:], [[0, 1, 0], [0, 2, 0], [-1, 2, 0], [-1, 1, 0]], atol=1e-15)
    assert [deck.node_name(row) for row in (0, 1, 12)] == ["7", "LOW-1.1", "UP-2.4"]
    assert [deck.element_name(row) for row in (0, 2)] == ["LOW-1.1", "UP-2.1"]
    sets = {name: rows.tolist() for name, rows in deck.node_sets.items()}
    assert sets == {
        "HELD": [1, 2, 7, 8], "MIXED": [0, 1, 11, 12], "TWICE": [7, 8], "LOW-1.TOP": [3, 4], "UP-1.TOP": [7, 8],
        "UP-2.TOP": [11, 12], "UP-2.OWN": [9],
    }  # fmt: skip
    assert deck.element_sets["BOTH"].tolist() == [0, 1]
    assert deck.surfaces["S"].faces.tolist() == [[1, 1], [2, 0]]
    assert deck.surfaces["LOW-1.FACE"].faces.tolist() == [[0, 2]]
    assert [section.elements for section in deck.sections] == ["UP-1.BODY", "UP-2.BODY"]
    assert [deck.spelled[name] for name in ("HELD", "UP-2.TOP")] == ["Held", "Up-2.Top"]
    for name, rows in (("Up-1.3", [7]), ("low-1.top", [3, 4]), ("7", [0]), ("held", [1, 2, 7, 8])):
        assert deck.nodes_of(name, None).tolist() == rows
    here = DeckPlace("here", 3)
    bad_argument("^here line 3: node 'Up-1.9' is not in the deck; expected a number or", deck.nodes_of, "Up-1.9", here)
    bad_argument("^here line 3: element '1' is not in the deck", deck.elements_of, "1", here)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("part=Up\n0.", "part=Down\n0.", "line 30: .INSTANCE is of the part DOWN, .* expected one of LOW, UP"),
        ("name=Up-1, part", "name=low-1, part", "is named LOW-1 like another one"),
        ("*Part, name=Up\n", "*Part, name=Low\n", "is named LOW like another one"),
        ("*End Part\n*Part, name=Up\n", "*Part, name=Up\n", "line 14: .PART begins before LOW ends"),
        ("*End Instance\n*Node\n", "*Node\n", "line 33: UP-2 does not end; expected .END INSTANCE"),
        ("0., 0., 5., 90.\n", "0., 0., 0., 90.\n", "turns about two points that are one"),
        ("0., 0., 5., 90.\n", "0., 0., 5.\n", "line 35: .INSTANCE has 6 numbers in a line; expected 7"),
        ("0., 1., 0.\n", "0., 1., 0.\n0,0,0,0,0,1,5\n1,2\n", "has 3 lines of data; expected a translation and a rot"),
        ("instance=Low-1\n1, 2", "instance=Low-9\n1, 2", "the instance LOW-9 is not in the deck; expected"),
        ("Up-2.Top, ", "Up-2.Side, ", "there is no set of nodes named 'Up-2.Side'"),
    ],
)  # fmt: skip
def test_parts_and_instances_that_are_refused(tmp_path, old, new, message):
    assert old in PARTS
    bad_argument(message, read, tmp_path, PARTS.replace(old, new, 1))


def test_parts_without_an_instance_are_named(tmp_path):
    deck = read(tmp_path, PARTS.replace("*Assembly", "*Part, name=Lone\n*Node\n1,5,5\n*End Part\n*Assembly", 1))
    assert unused(deck) == ["line 27: *PART part Lone not used: there is no *INSTANCE of it"]
    assert len(deck.points) == 13
