"""What docs/proof_format.md does not allow is refused: other types, names, entries and texts, and other lines.

Every value of real proofs is written in all ways in which it may not be written, once for each kind of record; both
checkers refuse each of them, as does a search that is to go on with such a file.
"""

import base64
import functools
import json
import zlib
from contextlib import nullcontext
from fractions import Fraction
from functools import reduce
from itertools import groupby
from operator import getitem
from unittest import mock

import numpy as np
import pytest
import space_proofs
from complete import proven_roots
from generators import fe_compliance, from_condensed, integer_problem, random_problem, through_the_unloaded_state
from graph_proofs import cut_in_two, forms_at_once, triangle
from proof_tools import MAGIC, bytes_of, closed, of_kind, proof_of, put, records_of, sealed
from rational_checker import check
from rational_forms import Refused
from refusals import bad_argument
from touching import beside_a_loaded_node
from trees import above_known_roots, by_the_tree

from enumsol import Proof, ProofFormatError, branch_graph, enumerate_roots, gallery, verify
from enumsol.checker.graph_checker import GraphChecker
from enumsol.checker.plane_checker import Checker
from enumsol.checker.space_checker import SpaceChecker
from enumsol.checker.space_graph import SpaceGraphChecker
from enumsol.proof.leaves import leaves_of
from enumsol.proof.records import CutPiece, Tree
from enumsol.search import nodes as forms

POINTS = {
    "roots": lambda: (triangle(), 5.0),
    "fold": lambda: (triangle(), Fraction(8, 3)),
    "family": lambda: (gallery.get("one-node-6.3").build(), 2.0),
    "unloaded": lambda: (triangle(f=[0.0, 0.0]), 5.0),
    "sides": lambda: (beside_a_loaded_node(2, slides=True, grazing=True, friction=1.0), 0.0),
    "touching": lambda: (beside_a_loaded_node(2, slides=True, grazing=True), 0.0),
    "no root": lambda: (integer_problem(np.random.default_rng(143), 2), 0.0),
    "in rationals": lambda: (integer_problem(np.random.default_rng(143), 2), 0.0),
    "forms": lambda: (slipping(), 0.0),
    "cut short": lambda: (gallery.chain(2), 5.0),
    "one certificate": lambda: (slipping(), 0.0),
    "alone": lambda: (random_problem(np.random.default_rng(32), 2), 0.0),
}
GRAPHS = {
    "graph": lambda: (triangle(), (0.0, 5.0)),
    "halves": lambda: (triangle(), (0.0, 5.0)),
    "forms beside the unloaded state": through_the_unloaded_state,
}
SPACE = {"sectors": (1, 22), "one tangent": "one tangent", "one leaf in space": None}
CASES = [*POINTS, *GRAPHS, *SPACE]
#: Kinds of records that others have as well.
LONG = ("family", "touching", "no root", "halves", "forms beside the unloaded state", "sectors")


def slipping():
    """Two nodes that slip."""
    rng = np.random.default_rng(0)
    S = fe_compliance(rng, 2)
    return from_condensed(S, S @ [0.5, 0.8, 0.7, -0.4], [0.3, 0.2])


@functools.cache
def case(name):
    """Problem and records."""
    if name == "one leaf in space":
        problem = gallery.block3d(2, 2, 1, friction=(0.4, 0.25))
        return problem, records_of(enumerate_roots(problem, 0, max_nodes=1).proof)
    if name in SPACE:
        problem, _, records, _ = space_proofs.case(SPACE[name])
        return problem, closed(records)
    if name in GRAPHS:
        problem, interval = GRAPHS[name]()
        with forms_at_once() if "forms" in name else nullcontext():
            records = records_of(branch_graph(problem, interval).proof)
        return problem, cut_in_two(records) if name == "halves" else records
    problem, alpha = POINTS[name]()
    if name == "alone":
        with above_known_roots():
            return problem, records_of(enumerate_roots(problem, alpha).proof)
    early = mock.patch.multiple(forms, NODES=0, MORE=-2.0) if name == "forms" else nullcontext()
    with early, nullcontext() if name in ("one certificate", "touching") else by_the_tree():
        roots = enumerate_roots(problem, alpha, max_nodes=4 if name == "cut short" else None)
    header, *records, footer = records_of(roots.proof)
    if name == "in rationals":
        records = [
            [*record, "rational"] if record[0] in "xn" and record[-1] != "rational" else record for record in records
        ]
    return problem, [header, *records, footer]


def accepted(problem, proof):
    """Whether the checkers accept a file; in 3D there is one only."""
    try:
        ours = verify(problem, proof).ok
    except ProofFormatError:
        ours = False
    if hasattr(problem, "Bt1"):
        return ours
    try:
        check(problem, bytes_of(proof))
    except Refused:
        assert not ours
    else:
        assert ours
    return ours


# -- values ------------------------------------------------------------------------------------------------------------


class Text(str):
    """What is put into a line as it stands."""


def line_of(record):
    """The record in a line, with every Text as it stands."""
    texts = []

    def held(value):
        if isinstance(value, Text):
            texts.append(value)
            return f"\u0001{len(texts) - 1}"
        if isinstance(value, list):
            return [held(item) for item in value]
        return {key: held(item) for key, item in value.items()} if isinstance(value, dict) else value

    line = json.dumps(held(record), separators=(",", ":"))
    for number, text in enumerate(texts):
        line = line.replace(json.dumps(f"\u0001{number}"), text)
    return line


def places(value, path=()):
    """Paths of all values in a record, itself the first; of lists in it, and of numbers in a list, the last."""
    yield path
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    alike = path and isinstance(value, list) and len({type(item) for item in value}) == 1
    for key, item in [*items][-1:] if alike else items:
        yield from places(item, (*path, key))


def never(value):
    """What may not stand in the place of a value, by its type."""
    yield from (None, {}, [value], Text("NaN"), Text("-Infinity"), Text("1e999"))
    if type(value) is int:
        yield from (float(value), str(value), Text(f"{value}e0"), Text(f"0{value}" if value >= 0 else f"-0{-value}"))
        yield from (Text(f"+{abs(value)}"), Text("1" + "0" * 30), *([bool(value)] if value in (0, 1) else []))
    if type(value) is float:
        yield from (True, str(value), Text(f"+{abs(value)}"), Text(f"0{abs(value)}"), Text(f"{abs(value)}."))
    if isinstance(value, str):
        yield from (1, True, value + " ", " " + value, value + "\n", "+" + value, "\u0661" + value[1:])
        yield from (Text(f"'{value}'"), *([value.upper()] if value.upper() != value else []))
    if isinstance(value, list):
        yield from ([*value, 0], [*value, None], value[:-1] if value else [0], [*value, *value] if value else [[]])
        yield dict(enumerate(value))
    if isinstance(value, dict):
        name, first = next(iter(value.items()))
        yield from (list(value), {k: v for k, v in value.items() if k != name}, {**value, name.upper(): first})
        yield Text(line_of({name: first})[:-1] + "," + line_of(value)[1:])


def variants(records):
    """Lines of proofs with one value changed, in the first record of every kind; and what was changed."""
    kinds = {}
    lines = [line_of(record) for record in records]
    for k, record in enumerate(records):
        kinds.setdefault((record[0] if isinstance(record, list) else tuple(sorted(record)), len(record)), k)
    for k in kinds.values():
        for path in places(records[k]):
            for value in never(reduce(getitem, path, records[k])):
                if not free(records[k], k, path, value):
                    yield [*lines[:k], line_of(put(records[k], path, value)), *lines[k + 1 :]], (k, path, value)


def free(record, k, path, value):
    """Whether the document leaves it free: further names of a header, and a reason."""
    if k == 0 and not path and isinstance(value, dict) and set(record) <= set(value):
        return True
    # what holds in rational arithmetic may be claimed without it
    if isinstance(record, list) and not path and record[-1] == "rational" and value == record[:-1]:
        return True
    return isinstance(record, list) and record[0] == "u" and path == (1,) and type(value) is str  # any reason


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.slow] * (name in LONG)) for name in CASES])
def test_values_of_other_types_and_texts_are_refused(name):
    problem, records = case(name)
    assert accepted(problem, proof_of([line_of(record) for record in records]))
    said = [(what, accepted(problem, proof_of(lines))) for lines, what in variants(records)]
    assert [what for what, ok in said if ok] == []
    assert len(said) > 100


@pytest.mark.parametrize("name", CASES)
def test_at_every_place_one_value_of_another_type_is_refused(name):
    """Of all such values another one at every place."""
    problem, records = case(name)
    by_place = [list(group) for _, group in groupby(variants(records), key=lambda variant: variant[1][:2])]
    said = [group[number % len(group)] for number, group in enumerate(by_place)]
    assert [what for lines, what in said if accepted(problem, proof_of(lines))] == []
    assert len(said) > 15


@pytest.mark.slow
def test_every_kind_of_record_is_among_them():
    kinds = {record[0] for name in CASES for record in case(name)[1] if isinstance(record, list)}
    assert kinds == {*leaves_of(Tree.PLANE), "b", "p", "q", "s", "t", "w"}


@pytest.mark.parametrize("checker", [Checker, SpaceChecker, GraphChecker, SpaceGraphChecker])
def test_every_kind_of_leaf_has_a_test_in_its_checker(checker):
    kinds = {kind for tree in checker.trees for kind in leaves_of(tree).values()}
    # what cuts pieces ends no subtree in 3D
    assert kinds - {CutPiece} <= set(checker.tests.func(object.__new__(checker)))


def test_multipliers_have_one_text():
    """The last character of a text in base64 may have bits that stand for nothing."""
    problem, records = next(case(name) for name in POINTS if texts_to_spare(case(name)[1]))
    k = texts_to_spare(records)[0]
    text, alphabet = records[k][2], "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/"
    last = len(text.rstrip("=")) - 1
    other = text[:last] + alphabet[alphabet.index(text[last]) + 1] + text[last + 1 :]
    assert base64.b64decode(other) == base64.b64decode(text)
    assert not accepted(problem, proof_of(put(records, (k, 2), other)))


def texts_to_spare(records):
    return [k for k in of_kind(records, "x") if records[k][2].endswith("=")]


def test_points_are_written_in_lowest_terms():
    """At 8/3 sticking and slipping are the same, with lambda_n = 3/2 and lambda_t = -4."""
    problem, records = case("fold")
    k = of_kind(records, "D")[0]
    assert records[k][1] == [["3/2", "-4/1"]]
    for place, text in ((0, "6/4"), (0, "03/2"), (0, "3/02"), (1, "-4"), (1, "4/-1"), (0, "+3/2")):
        assert not accepted(problem, proof_of(put(records, (k, 1, 0, place), text)))


# -- lines -------------------------------------------------------------------------------------------------------------

LINES = {
    "CRLF": lambda text: text.replace(b"\n", b"\r\n"),
    "CR": lambda text: text.replace(b"\n", b"\r"),
    "one CR": lambda text: text.replace(b"\n", b"\r\n", 1),
    "a CR between tokens": lambda text: text.replace(b",", b",\r", 1),
    "a blank before": lambda text: b" " + text,
    "a blank behind": lambda text: text.replace(b"\n", b" \n", 1),
    "a tabulator": lambda text: text.replace(b"\n", b"\t\n", 1),
    "a form feed": lambda text: text.replace(b"\n", b"\x0c\n", 1),
    "an empty line": lambda text: text.replace(b"\n", b"\n\n", 1),
    "an empty line at the end": lambda text: text + b"\n",
    "an empty line at the beginning": lambda text: b"\n" + text,
    "a byte order mark": lambda text: b"\xef\xbb\xbf" + text,
    "no last line feed": lambda text: text[:-1],
    "two records in a line": lambda text: text.replace(b"\n", b"", 1),
    "two records and a comma": lambda text: text.replace(b"\n", b",", 1),
    "a record in two lines": lambda text: text.replace(b",", b",\n", 1),
    "more behind the footer": lambda text: text + b"{}\n",
    "the footer twice": lambda text: text + text.splitlines(keepends=True)[-1],
    "a zero byte": lambda text: text.replace(b"\n", b"\0\n", 1),
    "UTF-16": lambda text: text.decode().encode("utf-16"),
    "a comma too many": lambda text: text.replace(b"}", b",}", 1),
    "a comment": lambda text: text.replace(b"\n", b"//\n", 1),
    "a character that is not ASCII": lambda text: text.replace(b"{", '{"\u00e4":1,'.encode(), 1),
    "half of one": lambda text: text.replace(b"{", b'{"\xc3":1,', 1),
    "a control character": lambda text: text.replace(b"{", b'{"\x01":1,', 1),
}
ALLOWED = {
    "as it is": lambda text: text,
    "blanks inside": lambda text: text.replace(b",", b", ").replace(b":", b" :\t"),
    "a further name in the header": lambda text: text.replace(b"{", b'{"program":["x",1.5,null,true],', 1),
    "one that is not ASCII": lambda text: text.replace(b"{", b'{"\\u00e4":1,', 1),
    "names in another order": lambda text: b"".join(
        json.dumps(dict(reversed(record.items())) if isinstance(record, dict) else record).encode() + b"\n"
        for record in map(json.loads, text.splitlines())
    ),
}


def text_of(records):
    return "".join(line_of(record) + "\n" for record in closed(records)).encode()


@pytest.mark.parametrize("how", [*LINES, *ALLOWED])
def test_lines_that_are_written_otherwise_are_refused_unless_the_document_leaves_them_free(how):
    for name in CASES:
        problem, records = case(name)
        written = (LINES | ALLOWED)[how](text_of(records))
        assert accepted(problem, sealed(zlib.compress(written))) is (how in ALLOWED), name


@pytest.mark.parametrize("name", CASES)
def test_containers_that_are_written_otherwise_are_refused(name):
    problem, records = case(name)
    body = zlib.compress(text_of(records))
    raw = zlib.compressobj(wbits=-15)
    for other in (body + b"\n", body + body, b"\n" + body, raw.compress(text_of(records)) + raw.flush(), body[:-1]):
        assert not accepted(problem, sealed(other))
    for magic in (MAGIC.replace(b"\n", b"\r\n"), MAGIC.upper(), MAGIC.strip(), b"\xef\xbb\xbf" + MAGIC, b" " + MAGIC):
        assert not accepted(problem, sealed(body, magic))
    data = bytes_of(sealed(body))
    for other in (data + b"\n", data[:-32] + data[-32:].hex().encode(), data[:-32]):
        assert not accepted(problem, Proof(other))


# -- resume ------------------------------------------------------------------------------------------------------------

HEADERS = {
    "version": [True, 1.0, "1", None],
    "p": [1.0, True, "1", None],
    "alpha": [5, 5.0, "5/1", " 5", "+5"],
    "kind": [None, "point", "space", True],
    "format": ["ENUMSOL-PROOF"],
    "data": ["PROBLEM"],
    "force": [[1.0, 1.0]],
}


@pytest.mark.parametrize(("name", "value"), [(name, value) for name, values in HEADERS.items() for value in values])
def test_a_search_does_not_go_on_with_another_header(name, value, tmp_path):
    problem, records = case("roots")
    place = tmp_path / "begun.proof"
    proof_of([{**records[0], name: value}, *records[1:]]).save(place)
    bad_argument("proof_path", enumerate_roots, problem, 5.0, proof_path=place, resume=True)


@pytest.mark.parametrize("name", ["roots", "sides", "sectors"])
def test_a_search_goes_on_with_lines_as_they_are_written_only(name, tmp_path):
    problem, records = case(name)
    alpha = float(Fraction(records[0]["alpha"]))
    place, whole = tmp_path / "begun.proof", enumerate_roots(problem, alpha)
    header, *rest = (line_of(record).encode() + b"\n" for record in records)
    for change, resumed in ((b"\n", True), (b"\r\n", False), (b" \n", False)):
        sealed(zlib.compress(header + b"".join(rest).replace(b"\n", change))).save(place)
        again = proven_roots(problem, alpha, proof_path=place, resume=True)
        assert len(again) == len(whole)
        assert (again.stats.resumed > 0) is resumed
