"""Lines of decks as cards: how both programs take blanks, cases, comments, commas and included files; hostile files."""

import numpy as np
import pytest
from refusals import bad_argument
from written_decks import SQUARE, labels, read, written

from enumsol.decks import cards
from enumsol.decks.reading import described
from enumsol.support.deadlines import heard_by

NODES = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
WAYS = [
    "*NODE\n1, 0., 0., 0.\n2, 1., 0., 0.\n3, 1., 1., 0.\n4, 0., 1.\n*ELEMENT, TYPE=CPS4, ELSET=BODY\n1, 1, 2, 3, 4\n",
    "*node\n1,0,0\n2,1,0\n3,1,1\n4,0,1\n*Element, Type=cps4, elset=Body\n1,1,2,3,4",
    " * NODE , \n1 ,0.,\t0.,\n\n2,1.,,\n 3,1.,1.,0.,\n4,,1.,\n*ELEMENT,TYPE = CPS4 ,ELSET= BODY\n1,1,2,3,4,\n",
    "** c\n*NODE\n** c\n1,0,0\n2,1,0\n**\n3,1,1\n4,0,1\n** c\n*ELEMENT,TYPE=CPS4,ELSET=BODY\n ** c\n1,1,2,3,4\n** end",
    "*NODE\n1,0,0\n2,1,0\n*NODE\n3,1,1\n*NODE\n4,0,1\n*ELEMENT,TYPE=CPS4,ELSET=BODY\n1,1,2,\n3,4\n",
    "*NODE\n1,0,0\n2,1.E+0,0\n3,1.0D0,10.d-1\n4,+0.,.1e1\n*ELEMENT,\n** c\nTYPE=CPS4,\n ELSET=BODY\n1,1,\n2,3,4\n",
    "*ELEMENT,TYPE=CPS4,ELSET=BODY\n1,1,2,3,4\n*NODE\n4,0,1\n3,1,1\n2,1,0\n1,0,0\n",
    "*NODE\n1,0,0\n2,1,0\n3,1,1\n4,0,1\n1,0,0\n*ELEMENT,TYPE=CPS4\n1,1,2,3,4\n*ELSET,ELSET=BODY\n1\n",
]


@pytest.mark.parametrize("text", [*WAYS, SQUARE.replace("\n", "\r\n"), SQUARE.replace("\n", "\r"), "\ufeff" + SQUARE])
def test_ways_to_write_one_square(tmp_path, text):
    deck = read(tmp_path, text)
    order = np.argsort(deck.node_labels)
    assert deck.node_labels[order].tolist() == [1, 2, 3, 4]
    assert deck.points[order].tolist() == NODES
    (block,) = deck.blocks
    assert (block.type.name, block.labels.tolist()) == ("CPS4", [1])
    assert deck.node_labels[block.nodes].tolist() == [[1, 2, 3, 4]]
    assert deck.element_sets["BODY"].tolist() == [0]


def test_places_of_lines_behind_comments(tmp_path):
    text = "*NODE\n** c\n1,0,0\n\n** c\n2,1,0\n** c\n\n3,x,0\n"
    bad_argument(r"^model.inp line 9: \*NODE has 'x'; expected a number", read, tmp_path, text)


def test_characters_of_other_encodings(tmp_path):
    """Comments and names in Latin 1 and UTF-8; names compare in upper case, and as written in quotes."""
    text = SQUARE + '** grün\n*NSET, NSET=Fläche\n1, 2\n*NSET, NSET="a b"\nfläche\n'
    for encoding in ("latin-1", "utf-8"):
        deck = read(tmp_path, text.encode(encoding))
        assert {name: labels(deck, rows) for name, rows in deck.node_sets.items()} == {"FLÄCHE": [1, 2], "a b": [1, 2]}
    assert deck.spelled["FLÄCHE"] == "Fläche"


def test_included_files(tmp_path):
    """Anywhere, also within the data of a card, from folders below, and by INPUT of other cards."""
    files = {
        "sub/sets.inc": "*Nset, nset=A\n1\n*Include, input=more.inc\n",
        "sub/more.inc": "2,\n",
        "top.txt": "3\n4\n",
    }
    text = SQUARE + "*INCLUDE, INPUT=sub\\sets.inc\n3\n*NSET, NSET=TOP, INPUT=top.txt\n"
    deck = read(tmp_path, text, files)
    assert labels(deck, deck.node_sets["A"]) == [1, 2, 3]
    assert labels(deck, deck.node_sets["TOP"]) == [3, 4]


def test_places_of_included_lines(tmp_path):
    files = {"sets.inc": "** c\n*NSET, NSET=A\n1, B\n"}
    bad_argument(
        "^sets.inc line 3: there is no set of nodes named 'B'",
        read,
        tmp_path,
        f"*INCLUDE,INPUT=sets.inc\n{SQUARE}",
        files,
    )
    bad_argument(
        r"^model.inp line 3: \*NSET has '1.5'; expected an int", read, tmp_path, "*NSET,NSET=A,GENERATE\n1,2\n1.5\n"
    )


BOMB = {f"x{k}": f"*INCLUDE,INPUT=x{k + 1}\n" * 4 for k in range(9)} | {"x9": "** end\n"}
DEEP = {f"x{k}": f"*INCLUDE,INPUT=x{k + 1}\n" for k in range(30)} | {"x30": "** end\n"}
HOSTILE = [
    (
        "*INCLUDE,INPUT=a.inc\n",
        {"a.inc": "*INCLUDE,INPUT=model.inp\n"},
        "a.inc line 1: .INCLUDE names model.inp, which incl",
    ),
    ("*INCLUDE,INPUT=model.inp\n", {}, "model.inp line 1: .INCLUDE names model.inp, which includes it"),
    ("*INCLUDE,INPUT=../../etc/passwd\n", {}, "outside of the folder of the deck; expected a file in it"),
    ("*INCLUDE,INPUT=/etc/passwd\n", {}, "names '/etc/passwd', outside of the folder"),
    (SQUARE + "*INCLUDE,INPUT=lost.inc\n", {}, "line 8: .INCLUDE names 'lost.inc': there is no such file; expected"),
    (SQUARE + "*INCLUDE\n", {}, r"line 8: .INCLUDE names no file; expected INPUT=FILE"),
    (SQUARE + "*INCLUDE,INPUT=.\n", {}, "names '.': it is a directory"),
    ("*INCLUDE,INPUT=x0\n", BOMB, "is one too many; expected at most 1000 included files"),
    ("*INCLUDE,INPUT=x0\n", DEEP, "nested at most 20 deep"),
    (SQUARE.encode() + bytes(range(256)), {}, "it is a binary file; expected a deck"),
    (SQUARE + "*HEADING\na\0b\n", {}, "it is a binary file; expected a deck"),
    (SQUARE.encode("utf-16"), {}, "it is a binary file; expected a deck"),
    ("a mesh\n1 2 3\n", {}, "line 1: 'a mesh' is no keyword; expected a deck of CalculiX or Abaqus"),
    (SQUARE + "*NODE\n9,nan,0\n", {}, "line 9: .NODE has 'nan'; expected a number"),
    (SQUARE + "*NODE\n9,1e999,0\n", {}, "line 9: .NODE has '1e999'; expected a number"),
    (SQUARE + "*NODE\n9,1_0,0\n", {}, "line 9: .NODE has '1_0'; expected a number"),
    (SQUARE + "*NSET,NSET=A,GENERATE\n1," + "9" * 400 + "\n", {}, "expected an integer"),
    (SQUARE + "*NSET,NSET=A\n" + "9" * 400 + "\n", {}, "expected an integer"),
    (SQUARE + "*ELEMENT,TYPE=CPS3\n1,2,3," + "9" * 40 + "\n", {}, "expected an integer"),
]


@pytest.mark.parametrize(("text", "files", "message"), HOSTILE)
def test_hostile_decks(tmp_path, text, files, message):
    assert len(str(bad_argument(message, read, tmp_path, text, files))) < 400


def test_a_link_out_of_the_folder(tmp_path):
    (tmp_path / "in").mkdir()
    (tmp_path / "out.inc").write_text("*NSET,NSET=A\n1\n")
    (tmp_path / "in" / "link.inc").symlink_to(tmp_path / "out.inc")
    bad_argument("outside of the folder", read, tmp_path / "in", SQUARE + "*INCLUDE,INPUT=link.inc\n")


def test_lines_and_files_that_are_too_long(tmp_path, monkeypatch):
    """A sparse file of 500 MB has one line: no more of it is read than what shows that."""
    place = written(tmp_path, SQUARE + "*NSET,NSET=A\n1," + " " * 200_000)
    bad_argument("line 9 has more than 100,000 characters; expected a deck", described, place)
    with place.open("r+b") as file:
        file.truncate(500_000_000)
    bad_argument("line 9 has more than 100,000 characters", described, place)
    monkeypatch.setattr(cards, "MOST_BYTES", 1_000)
    place.write_text(SQUARE * 30)
    bad_argument("the deck has more than 1,000 bytes", described, place)


def test_places_that_are_no_files(tmp_path):
    bad_argument("there is no such file", described, tmp_path / "lost.inp")
    bad_argument("it is a directory", described, tmp_path)


def test_progress_of_long_decks(tmp_path):
    heard = []
    with heard_by(lambda *said: heard.append(said)):
        read(tmp_path, SQUARE + "*NSET, NSET=A\n1\n** c\n" * 2_000)
    assert [done for _, done, _ in heard] == sorted(done for _, done, _ in heard)
    assert heard[-1][0] == "lines of model.inp"
    assert 3_000 < heard[-1][1] < heard[-1][2] == 6_008


def test_misspelt_and_unknown_cards(tmp_path):
    bad_argument(
        r"line 8: \*NODDE is not read, .*; expected \*NODE, or --ignore NODDE", read, tmp_path, SQUARE + "*NODDE\n"
    )
    bad_argument(r"\*NODDE is not read, .*; expected \*NODE", read, tmp_path, SQUARE + "*NODDE\n", bare=True)
    text = SQUARE + "*NO SUCH THING, A=B\n1, 2\n"
    bad_argument(
        r"line 8: \*NO SUCH THING is not read, .*expected other cards, or --ignore NOSUCHTHING", read, tmp_path, text
    )
    for ignore in ("NOSUCHTHING", "no such thing", "*NO SUCH THING"):
        deck = read(tmp_path, text, ignore=[ignore])
        assert [entry.became for entry in deck.account if not entry.used] == ["not used, as you say"]
    assert len(read(tmp_path, text, bare=True).points) == 4
    bad_argument(
        "has the option COLOUR, which is not read; expected none but",
        read,
        tmp_path,
        SQUARE + "*NSET,NSET=A,COLOUR=2\n1\n",
    )
    bad_argument("has the option X, which is not read; expected none", read, tmp_path, SQUARE + "*END PART, X\n")
