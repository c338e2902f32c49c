"""Cards that make nodes and elements, against decks in which they are written out, and wrong ones."""
# ruff: noqa: E501 (tables of decks)

from pathlib import Path

import numpy as np
import pytest

from enumsol.decks.reading import described
from enumsol.errors import InvalidArgumentError

CORNERS = "*NODE\n1, 0., 0.\n5, 4., 0.\n21, 0., 2.\n25, 4., 2.\n"
FILLED = CORNERS + "*NGEN, NSET=LOW\n1, 5\n*NGEN, NSET=HIGH\n21, 25, 1\n*NFILL, NSET=ALL\nLOW, HIGH, 2, 10\n"
SQUARE = "*ELEMENT, TYPE=CPE4\n1, 1, 2, 12, 11\n*ELGEN, ELSET=BODY\n1, 4, 1, 1, 2, 10, 10\n"


@pytest.fixture
def read(tmp_path):
    def read(text, **options):
        Path(tmp_path / "model.inp").write_text(text)
        return described(tmp_path / "model.inp", **options)

    return read


def places(deck):
    return {int(label): point for label, point in zip(deck.node_labels, deck.points.tolist(), strict=True)}


def labels(deck, name):
    return sorted(deck.node_labels[deck.node_sets[name]].tolist())


@pytest.mark.parametrize("bare", [True, False])
def test_a_grid_by_lines_filling_and_rows(read, bare):
    deck = read(FILLED + SQUARE, bare=bare)
    expected = {1 + i + 10 * j: [float(i), float(j), 0.0] for i in range(5) for j in range(3)}
    assert places(deck) == expected
    assert labels(deck, "LOW") == [1, 2, 3, 4, 5]
    assert labels(deck, "ALL") == sorted(expected)
    found = {}
    for block in deck.blocks:
        found |= dict(zip(block.labels.tolist(), deck.node_labels[block.nodes].tolist(), strict=True))
    starts = {1 + i + 10 * j: 1 + i + 10 * j for i in range(4) for j in range(2)}
    assert found == {element: [k, k + 1, k + 11, k + 10] for element, k in starts.items()}
    assert deck.element_labels[deck.element_sets["BODY"]].tolist() == sorted(starts)


def test_layers_of_bricks_by_copies(read):
    deck = read(
        FILLED + "*NCOPY, OLD SET=ALL, CHANGE NUMBER=100, SHIFT, NEW SET=TOP\n0., 0., 1.5\n\n"
        "*ELEMENT, TYPE=C3D8\n1, 1, 2, 12, 11, 101, 102, 112, 111\n*ELGEN, ELSET=SLAB\n1, 4, 1, 1, 2, 10, 10\n"
    )
    at = places(deck)
    assert all(at[k + 100] == [x, y, 1.5] for k, (x, y, _) in at.items() if k < 100)
    assert labels(deck, "TOP") == [k + 100 for k in labels(deck, "ALL")]
    assert len(deck.element_sets["SLAB"]) == 8


def test_three_ways_of_rows_make_layers(read):
    nodes = "*NODE\n" + "".join(
        f"{1 + i + 10 * j + 100 * k}, {i}., {j}., {k}.\n" for i in range(4) for j in range(3) for k in range(3)
    )
    deck = read(
        nodes + "*ELEMENT, TYPE=C3D8\n1, 1, 2, 12, 11, 101, 102, 112, 111\n*ELGEN\n1, 3, 1, 1, 2, 10, 20, 2, 100, 500\n"
    )
    assert deck.element_labels.tolist() == [1, 2, 3, 21, 22, 23, 501, 502, 503, 521, 522, 523]
    last = deck.blocks[-1]
    assert deck.node_labels[last.nodes[-1]].tolist() == [113, 114, 124, 123, 213, 214, 224, 223]


def test_copies_are_turned_and_elements_follow(read):
    deck = read(
        FILLED
        + SQUARE
        + "*NCOPY, OLD SET=ALL, CHANGE NUMBER=200, SHIFT, NEW SET=COPY\n1., 0., 0.\n0., 0., 0., 0., 0., 1., 90.\n"
        "*ELCOPY, ELEMENT SHIFT=300, OLD SET=BODY, SHIFT NODES=200, NEW SET=OTHER\n"
    )
    at = places(deck)
    for k in labels(deck, "ALL"):
        x, y, _ = at[k]
        np.testing.assert_allclose(at[k + 200], [-y, x + 1, 0], atol=1e-12)
    assert deck.element_labels[deck.element_sets["OTHER"]].tolist() == [301, 302, 303, 304, 311, 312, 313, 314]


def test_arcs_and_bias(read):
    text = "*NODE\n1, 2., 0.\n9, 0., 2.\n100, 0., 0.\n*NGEN, LINE=C, NSET=ARC\n1, 9, 4, 100\n"
    np.testing.assert_allclose(places(read(text))[5], [2**0.5, 2**0.5, 0])
    np.testing.assert_allclose(places(read(text.replace("4, 100", "4, , 0., 0., 0.")))[5], [2**0.5, 2**0.5, 0])
    far = places(read(text.replace("4, 100", "4, , 0., 0., 0., 0., 0., -1.")))[5]  # the long way round
    np.testing.assert_allclose(far, [-(2**0.5), -(2**0.5), 0])
    deck = read("*NODE, NSET=A\n1, 0.\n*NODE, NSET=B\n5, 7.\n*NFILL, BIAS=0.5\nA, B, 3, 1\n")
    assert [places(deck)[k][0] for k in (2, 3)] == [1.0, 3.0]  # parts of 1, 2 and 4: smaller at the first set


WRONG = {
    "a node that is not there": ("*NGEN\n1, 7\n", r"line 7: \*NGEN names the node 7, which does not stand before it"),
    "numbers that do not lead there": ("*NGEN\n1, 5, 3\n", r"line 7: \*NGEN goes from 1 to 5 by 3"),
    "far too many": ("*NGEN\n1, 999999999999\n", r"line 7: \*NGEN goes from 1 to 999999999999"),
    "a parabola": ("*NGEN, LINE=P\n1, 5\n", r"line 6: \*NGEN makes nodes on other lines"),
    "no centre": ("*NGEN, LINE=C\n1, 5, 1, 21\n", r"line 7: \*NGEN has ends of an arc at different distances"),
    "a set that is not there": ("*NFILL\nLOW, HIGH, 2, 10\n", r"line 7: \*NFILL names the set LOW"),
    "other numbers of nodes": ("*NSET, NSET=A\n1\n*NSET, NSET=B\n21, 25\n*NFILL\nA, B, 2, 10\n", r"line 11: \*NFILL fills 2 intervals between 1 and 2"),
    "no intervals": ("*NFILL\n1, 21\n", r"line 7: \*NFILL has 2 entries"),
    "a bias below 0": ("*NFILL, BIAS=-1.\n1, 21, 2, 1\n", r"line 6: \*NFILL has BIAS=-1"),
    "a mirror": ("*NCOPY, OLD SET=A, CHANGE NUMBER=1, REFLECT=MIRROR\n", r"line 6: \*NCOPY has the option REFLECT"),
    "a copy that stays": ("*NSET, NSET=A\n1\n*NCOPY, OLD SET=A, CHANGE NUMBER=1\n", r"line 8: \*NCOPY has no SHIFT"),
    "a copy of one number": ("*NSET, NSET=A\n1\n*NCOPY, OLD SET=A, CHANGE NUMBER=x, SHIFT\n", r"line 8: \*NCOPY has CHANGE NUMBER=x"),
    "an element that is not there": ("*ELGEN\n1, 3\n", r"line 7: \*ELGEN names the element 1"),
    "no elements": ("*ELEMENT, TYPE=CPE4\n1, 1, 5, 25, 21\n*ELGEN\n1, 0\n", r"line 9: \*ELGEN makes 0 times 1 times 1 elements"),
    "a billion elements": ("*ELEMENT, TYPE=CPE4\n1, 1, 5, 25, 21\n*ELGEN\n1, 1000, 1, 1, 1000, 1, 1, 1000\n", r"line 9: \*ELGEN makes 1000 times"),
    "a node of made elements": ("*ELEMENT, TYPE=CPE4\n1, 1, 5, 25, 21\n*ELGEN\n1, 2\n", r"line 9: element 2 has the node 2, which is not in the deck"),
    "a copy of no elements": ("*ELCOPY, ELEMENT SHIFT=3, OLD SET=E, SHIFT NODES=2\n", r"line 6: \*ELCOPY names the set E"),
    "a number below 1": ("*NSET, NSET=A\n1\n*NCOPY, OLD SET=A, CHANGE NUMBER=-5, SHIFT\n", r"line 8: \*NCOPY makes the number -4"),
    "a set of nodes of elements": ("*ELEMENT, TYPE=CPE4, ELSET=E\n1, 1, 5, 25, 21\n*NSET, NSET=A, ELSET=E\n*NCOPY, OLD SET=A, CHANGE NUMBER=5, SHIFT\n", r"line 9: \*NCOPY names the set A, of nodes of elements"),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_what_cannot_be_made_is_refused_with_its_line(read, name):
    cards, words = WRONG[name]
    with pytest.raises(InvalidArgumentError, match=words) as found:
        read(CORNERS + cards)
    assert "\n" not in str(found.value)
