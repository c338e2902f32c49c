"""docs/proof_format.md suffices: a checker written from it alone accepts proofs of small problems, and no forgery."""

import ast
import functools
import json
import re
from fractions import Fraction
from itertools import product
from pathlib import Path

import numpy as np
import pytest
import rational_arcs
import rational_checker
import rational_closings
import rational_floating
import rational_forms
import rational_pieces
import rational_references
import rational_zeros
from alike import anew
from complete import all_roots
from effort import some
from generators import integer_problem, random_problem, singular_problem
from graph_proofs import GRAPHS, accepted, cut_in_two, graph, refused, three_with_everything, triangle, without_arcs
from proof_tools import (
    MAGIC,
    Judge,
    bytes_of,
    in_rationals,
    leaves_of,
    multipliers,
    of_kind,
    proof_of,
    put,
    records_of,
    replaced,
    sealed,
    with_multipliers,
)
from rational_checker import check, check_records
from rational_forms import Refused, fingerprint
from touching import beside_a_loaded_node

from enumsol import enumerate_roots, gallery, verify
from enumsol.proof.curve_records import PARTS
from enumsol.proof.leaves import leaves_of as kinds_in
from enumsol.proof.records import Tree
from enumsol.trusted.space.sector_rows import FORBIDDEN, FREE, NONNEGATIVE, row_sign
from enumsol.trusted.status_rows import STILL, row_table

DOCUMENT = Path(__file__).parents[2] / "docs" / "proof_format.md"


POINTS = {
    "one-node-6.1": lambda: (gallery.get("one-node-6.1").build(), 5.0),
    "fold": lambda: (gallery.get("one-node-6.1").build(), 8 / 3),
    "near a fold": lambda: (gallery.get("one-node-6.1").build(), 8 / 3 - 1e-10),
    "exact fold": lambda: (gallery.get("one-node-6.1").build(), Fraction(8, 3)),
    "family": lambda: (gallery.get("one-node-6.3").build(), 2.0),
    "five roots": lambda: (gallery.get("two-node-6.4").build(), 3.5),
    "27 roots": lambda: (gallery.chain(3), 5.0),
    "unloaded": lambda: (triangle(f=[0.0, 0.0]), 5.0),
    "unloaded at 3": lambda: (triangle(f=[-3.0, 6.0], load_slope=[1.0, -2.0], friction=2.0), 3.0),
    "frictionless": lambda: (triangle(friction=0.0), 1.0),
    "everything": lambda: (three_with_everything(), Fraction(7, 3)),
    "all statuses": lambda: (integer_problem(np.random.default_rng(20), 2), 0.0),
    "grazing": lambda: (beside_a_loaded_node(3, slides=True, grazing=True), 0.0),
    "sides": lambda: (beside_a_loaded_node(3, slides=True, grazing=True, friction=1.0), 0.0),
}


@functools.cache
def point(name):
    """Problem, records and enumeration."""
    problem, alpha = POINTS[name]()
    roots = all_roots(problem, alpha)
    return problem, records_of(roots.proof), roots


# -- the checker is another program ------------------------------------------------------------------------------------


def test_the_checker_imports_nothing_of_the_package():
    names = set()
    modules = (
        *(rational_checker, rational_arcs, rational_closings, rational_floating),
        *(rational_forms, rational_pieces, rational_references, rational_zeros),
    )
    for module in modules:
        tree = ast.parse(Path(module.__file__).read_text(encoding="utf-8"))
        names |= {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
        names |= {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    standard = {"base64", "fractions", "functools", "hashlib", "itertools", "json", "math", "re", "struct", "zlib"}
    assert names == standard | {"flint", "numpy", *(module.__name__ for module in modules[1:])}


@pytest.mark.slow
def test_the_document_names_what_the_proofs_hold():
    text = DOCUMENT.read_text(encoding="utf-8")
    seen = [record for name in POINTS for record in point(name)[1]] + [r for name in GRAPHS for r in graph(name)[1]]
    for words in (record if isinstance(record, dict) else record[:1] for record in seen):
        assert all(f'"{word}"' in text or f'["{word}"' in text for word in words), words


def section(number):
    """The text of a section of the document."""
    return re.search(rf"^### {re.escape(number)} .*?(?=^##)", DOCUMENT.read_text(encoding="utf-8"), re.M | re.S).group()


#: By the letters of the document's table of records.
TREES = {
    **{"p": Tree.PLANE, "s": Tree.SPACE, "g": Tree.GRAPH, "i": Tree.PIECE},
    **{"P": Tree.FLOATING_PLANE, "S": Tree.FLOATING_SPACE, "G": Tree.FLOATING_GRAPH, "I": Tree.FLOATING_PIECE},
}


@pytest.mark.parametrize("letter", TREES)
def test_the_document_has_a_row_for_every_kind_of_leaf(letter):
    rows = re.findall(r'^\| `\["(\w)".* \| (\w+) \|$', section("5.3"), re.M)
    assert all(set(trees) <= set(TREES) for _, trees in rows)
    assert {kind for kind, trees in rows if letter in trees} - {"b", "p", "q"} == set(kinds_in(TREES[letter])) - {"p"}


LEAVES = sorted(
    {record for tree in TREES.values() for record in kinds_in(tree).values()}, key=lambda record: record.__name__
)


@pytest.mark.parametrize("kind", LEAVES, ids=lambda kind: kind.__name__)
def test_the_document_gives_the_numbers_of_entries(kind):
    rows = re.findall(rf'^\| `(\["{kind.kind}".*?)` \|', section("5.3"), re.M)
    sizes = {len(json.loads(re.sub(r'"?(\w+)"?', r'"\1"', row))) for row in rows}
    rational = {size + 1 for size in sizes} if kind.kind in "xn" else set()
    assert set(kind.sizes) <= sizes | rational


def test_the_document_says_which_multipliers_are_allowed_in_2d():
    told = dict(re.findall(r"(\d(?:, F[>=]0)?) +([E+.]{7})", section("4.4")))
    for code, row in enumerate(row_table()):
        name = {6: "6, F>0", STILL: "6, F=0"}.get(code, str(code))
        assert told[name] == "".join(".+E"[entry] for entry in row), name


def test_the_document_says_which_multipliers_are_allowed_in_3d():
    """Of rows that a node may have; those of sectors in a sector itself and in others."""
    told = dict(re.findall(r"^    ([\d, +i]+?) +([E+.abc]{10})(?:  |$)", section("4.5"), re.M))
    signs = {"E": FREE, "+": NONNEGATIVE, ".": FORBIDDEN, "a": FREE, "b": NONNEGATIVE, "c": NONNEGATIVE}
    tangential = {0: "23456", 1: "23456", 2: "45", 3: "45", 4: "", 5: "456", 6: "456", 8 + 9: "6789"}
    for code, kinds in tangential.items():
        (row,) = (row for name, row in told.items() if str(code) in name.split(", ") or (code > 8 and "i" in name))
        for kind in (0, 1, *map(int, kinds)):
            number = 9 if kind >= 6 else (-1 if code == 3 else 1) if kind in (4, 5) else 0
            assert row_sign(code, (kind, 0, number)) == signs[row[kind]], (code, kind)
    other = {(code, kind): row_sign(code, (kind, 0, {2: -1, 3: 1}[code])) for code in (2, 3) for kind in (4, 5)}
    assert other == {(2, 4): NONNEGATIVE, (2, 5): FORBIDDEN, (3, 4): NONNEGATIVE, (3, 5): FORBIDDEN}
    # the halves of sector 4 are 8 and 9
    assert [row_sign(8 + 9, (kind, 0, 4)) for kind in (7, 8, 9)] == [NONNEGATIVE] * 3
    assert [row_sign(8 + 9, (kind, 0, 8)) for kind in (7, 8, 9)] == [FORBIDDEN] * 3


def test_the_document_has_a_line_for_every_kind_of_part_of_a_curve():
    told = dict(re.findall(r'^- `\["(\w)", (.*?)\]`', section("8.2"), re.M))
    assert {kind: len(boxes.split(",")) for kind, boxes in told.items()} == PARTS


# -- accepted ----------------------------------------------------------------------------------------------------------


def assert_counted(problem, roots):
    """The proof is accepted, and has these roots."""
    counts = check(problem, bytes_of(roots.proof))
    assert (counts["roots"], counts["families"], counts["undecided"]) == (len(roots), len(roots.families), 0)


@pytest.mark.parametrize("name", POINTS)
def test_point_proofs_are_accepted(name):
    problem, _, roots = point(name)
    assert_counted(problem, roots)


def test_every_kind_of_leaf_is_among_them():
    kinds = {record[0] for name in POINTS for record in point(name)[1][1:-1]}
    assert kinds == {"b", "x", "r", "n", "D", "z", "m"}


@pytest.mark.few(5, 2)
@pytest.mark.parametrize("make", [random_problem, integer_problem, singular_problem])
@pytest.mark.parametrize("p", [1, 2, 3])
def test_point_proofs_of_random_problems_are_accepted(make, p):
    for seed in range(some(3, of=6)):
        problem = make(np.random.default_rng([seed, p]), p)
        roots = enumerate_roots(problem, 0.0)
        assert_counted(problem, roots)


def test_a_search_cut_short_counts_what_is_undecided():
    problem = gallery.chain(3)
    roots = enumerate_roots(problem, 5.0, max_nodes=12)
    assert check(problem, bytes_of(roots.proof))["undecided"] == len(roots.undecided) > 0


@pytest.mark.parametrize("name", ["near a fold", "five roots", "everything"])
def test_leaves_that_ask_for_rationals(name):
    problem, records, _ = point(name)
    places = {*of_kind(records, "x", "n")} - {*in_rationals(records, "x", "n")}
    changed = [[*record, "rational"] if k in places else record for k, record in enumerate(records)]
    assert changed != records
    assert accepted(problem, changed)
    assert verify(problem, proof_of(changed)).complete


@pytest.mark.slow
@pytest.mark.parametrize("name", GRAPHS)
def test_graph_proofs_are_accepted(name):
    problem, _, made = graph(name)
    assert check(problem, bytes_of(made.proof)) == verify(problem, made.proof).selections


@pytest.mark.parametrize("name", ["friction", "load", "both", "everything"])
def test_graph_proofs_in_halves_are_accepted(name):
    problem, records, _ = graph(name)
    halves = cut_in_two(records)
    assert accepted(problem, halves)
    assert verify(problem, proof_of(halves)).ok


def test_fingerprints():
    for problem in (*(point(name)[0] for name in POINTS), gallery.wedge(3, 7)):
        assert fingerprint(problem) == problem.fingerprint


def test_solutions_at_samples_are_among_the_selections_of_a_graph_proof():
    codes = {"open": 0, "stick": 1, "slip+": 2, "slip-": 3}
    for name in ("friction", "load", "both"):
        problem, records, made = graph(name)
        selections = check_records(problem, records)
        for alpha in np.random.default_rng(1).uniform(*made.interval, 6):
            for root in enumerate_roots(problem, float(alpha)):
                assert set(product(*([codes[s.value] for s in active] for active in root.active))) <= selections


def test_the_example_of_the_document_is_a_proof():
    problem, records, _ = point("one-node-6.1")
    block = DOCUMENT.read_text(encoding="utf-8").partition("## 11.")[2]
    text = " ".join(line for line in block.splitlines() if line.startswith("    "))
    example, decoder = [], json.JSONDecoder()
    while "{" in text or "[" in text:
        text = text[min(text.find(bracket) for bracket in "{[" if bracket in text) :]
        record, end = decoder.raw_decode(text)
        example.append(record)
        text = text[end:]
    example[0]["problem"] = problem.fingerprint
    assert check_records(problem, example) == records[-1]
    assert verify(problem, proof_of(example)).complete


# -- refused -----------------------------------------------------------------------------------------------------------


def counted(records, more):
    """The records with so many roots more in the footer."""
    return put(records, (-1, "roots"), lambda roots: roots + more)


@pytest.mark.parametrize("name", ["one-node-6.1", "five roots", "everything"])
def test_forged_exclusions(name):
    problem, records, _ = point(name)
    roots = of_kind(records, "r")
    for k in of_kind(records, "x"):
        rows, values = multipliers(records[k])
        for forged in (
            ([], []),
            (rows, [0.0] * len(rows)),
            (rows, [-1e3 * value for value in values]),
            (rows, [1e-9 * value for value in values]),
            ([*rows, 7 * problem.p], [*values, 0.0]),
        ):
            assert refused(problem, replaced(records, k, with_multipliers(records[k], *forged)))
        assert refused(problem, counted(replaced(records, roots[0], records[k]), -1))


@pytest.mark.parametrize("name", ["one-node-6.1", "near a fold", "five roots", "everything"])
def test_forged_roots(name):
    problem, records, _ = point(name)
    for k in of_kind(records, "r"):
        _, mid, rad, index = records[k]
        others = [["r", [m + 1.0 for m in mid], rad, index], ["r", mid, rad, -index], ["r", mid[1:], rad[1:], index]]
        if any(rad):  # where all nodes are open the root is the point zero, to the last bit
            others.append(["r", [m + 3 * r * (r == max(rad)) for m, r in zip(mid, rad, strict=True)], rad, index])
        vertex = [f"{Fraction(m).numerator:x}/{Fraction(m).denominator:x}".replace("0x", "") for m in mid]
        for other in (*others, ["r", mid, [-1.0, *rad[1:]], index], ["n"], ["n", "rational"], ["D", [vertex], 1]):
            assert refused(problem, counted(replaced(records, k, other), -(other[0] == "n")))
    for k in of_kind(records, "n"):
        root = ["r", [0.0] * (2 * problem.p), [10.0] * (2 * problem.p), 1]
        assert refused(problem, counted(replaced(records, k, root), 1))


@pytest.mark.parametrize("name", ["family", "all statuses"])
def test_forged_polytopes(name):
    problem, records, _ = point(name)
    for k in of_kind(records, "D"):
        _, points, dimension = records[k]
        moved = [["1/3", *points[0][1:]], *points[1:]]
        others = [["D", other, dimension] for other in (moved, [*points, points[0]], points[1:])]
        for other in (*others, ["D", points, dimension + 1], ["n", "rational"], ["n"]):
            assert refused(problem, replaced(records, k, other))


@pytest.mark.parametrize("name", ["one-node-6.1", "five roots", "family", "27 roots", "frictionless"])
def test_forged_trees_and_counts(name):
    problem, records, _ = point(name)
    for k, _ in leaves_of(records)[:6]:
        assert refused(problem, replaced(put(records, (-1, "leaves"), lambda leaves: leaves - 1), k))
    for k in of_kind(records, "b")[:6]:
        _, node, children = records[k]
        others = [children[:-1], [*children[:-1], children[0]], [0, 5, 4], [1, 2], [6], [c + 1 for c in children], []]
        for other in others:
            assert refused(problem, put(records, (k, 2), other))
        for other in (-1, node + problem.p):
            assert refused(problem, put(records, (k, 1), other))
    for key, change in product(records[-1], (1, -1)):
        assert refused(problem, put(records, (-1, key), records[-1][key] + change))
    assert refused(problem, [*records, records[-1]])
    for count in (0, 1, len(records) // 2, len(records) - 1):
        assert refused(problem, records[:count])


@pytest.mark.slow
def test_every_multiplier_counts_by_exact_judgement():
    """Halved, doubled, turned, and those of another leaf: accepted only where they still prove the leaf."""
    for name in ("one-node-6.1", "five roots")[: some(1, of=2)]:
        problem, records, _ = point(name)
        judge, held = Judge(problem), []
        excluded = of_kind(records, "x")
        for k in excluded:
            rows, values = multipliers(records[k])
            forged = [with_multipliers(records[k], rows[::-1], values[::-1]), *(records[other] for other in excluded)]
            for j, factor in product(range(len(rows)), (0.5, 2.0, -1.0)):
                altered = [v * factor if i == j else v for i, v in enumerate(values)]
                forged.append(with_multipliers(records[k], rows, altered))
            for record in forged:
                changed = replaced(records, k, record)
                held.append(verify(problem, proof_of(changed)).ok)
                assert held[-1] == judge.valid(changed) or not held[-1]
        assert {True, False} == set(held)


def test_swapped_children_prove_nothing():
    """The order of the children says which subtree is which."""
    for name in ("one-node-6.1", "five roots", "all statuses"):
        problem, records, _ = point(name)
        for k in of_kind(records, "b"):
            changed = replaced(records, k, [*records[k][:2], records[k][2][::-1]])
            assert not verify(problem, proof_of(changed)).ok or Judge(problem).valid(changed)


def test_the_proof_of_a_neighbour():
    """The same problem but for one bit of its load."""
    problem, _, roots = point("one-node-6.1")
    near = anew(problem, f=np.nextafter(problem.f, np.inf))
    for other in (near, point("five roots")[0]):
        assert "another problem" in verify(other, roots.proof).failures[0]


def test_a_loaded_body_is_not_unloaded():
    problem, records, _ = point("one-node-6.1")
    assert refused(problem, [records[0], ["z"], {"roots": 1, "families": 0, "undecided": 0, "leaves": 1}])


@pytest.mark.parametrize("name", ["one-node-6.1", "five roots"])
def test_forged_headers(name):
    problem, records, _ = point(name)
    p, force = problem.p, records[0]["force"]
    for key, value in (
        *(
            ("version", 1),
            ("version", 3),
            ("format", "another"),
            ("problem", "0" * 64),
            ("p", p + 1),
            ("data", "other"),
        ),
        *(("alpha", "-1"), ("alpha", "1/0"), ("alpha", 5), ("alpha", "9/2")),
        *(("force", [force[0] + 1, *force[1:]]), ("force", [901] * len(force))),
    ):
        assert refused(problem, put(records, (0, key), value)), (key, value)


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("arcs", [True, False])
@pytest.mark.parametrize("name", ["friction", "load", "both", "unloaded", "everything"])
def test_forged_graph_proofs(name, arcs):
    problem, records, _ = graph(name)
    if not arcs:
        records = without_arcs(records)
        assert accepted(problem, records)
        assert verify(problem, proof_of(records)).ok
    assert refused(problem, put(records, (0, "interval", 1), lambda end: str(Fraction(end) + 1)))
    for k in of_kind(records, "x", "s"):
        assert refused(problem, replaced(records, k))
    for k in of_kind(records, "x"):
        rows, values = multipliers(records[k])
        for others in ((rows, [0.0] * len(rows)), (rows, [-value for value in values])):
            assert refused(problem, replaced(records, k, with_multipliers(records[k], *others)))
    certificate = records[of_kind(records, "x")[0]]
    for k in of_kind(records, "s"):
        changed = replaced(records, k, certificate)
        changed[-1]["leaves"] += 1
        changed[-1]["selections"] -= 1
        assert refused(problem, changed)
    for k in pieces(records):
        assert refused(problem, put(records, (k, "piece", 1), lambda end: str(Fraction(end) - 1)))
        assert refused(problem, replaced(records, k, {**records[k], "roots": [[6] * problem.p]}))
    for key in records[-1]:
        assert refused(problem, put(records, (-1, key), records[-1][key] + 1))


def pieces(records):
    return [k for k, record in enumerate(records) if "piece" in record]


def test_halves_out_of_order_or_missing():
    problem, records, _ = graph("friction")
    halves = cut_in_two(records)
    _, second, third = pieces(halves)
    last = next(k for k, record in enumerate(halves) if "traces" in record)
    head, left, right, arcs = halves[:second], halves[second:third], halves[third:last], halves[last:-1]
    footer = halves[-1]
    for kept in ([], arcs):
        counts = footer if kept else without_arcs(halves)[-1]
        assert accepted(problem, [*head, *left, *right, *kept, counts])
        assert refused(problem, [*head, *right, *left, *kept, counts])
        assert refused(problem, [*head, *left, *kept, {**counts, "pieces": 2}])
    assert refused(problem, [*head, *left, *arcs, *right, footer])


def test_containers():
    problem, records, roots = point("one-node-6.1")
    data = bytes_of(roots.proof)
    body = data[len(MAGIC) : -32]
    proofs = [sealed(body + b"more"), sealed(body[:-3])]
    proofs.append(proof_of([*records[:-1], json.dumps(records[-1]) + " "], magic=b"enumsol-proof 2\n"))
    proofs.append(proof_of([records[0], '["r",[NaN,0.0],[Infinity,1.0],1]', *records[2:]]))
    for forged in (data[:-1], data[:-32] + bytes(32), bytes([data[0] ^ 1]) + data[1:], *map(bytes_of, proofs)):
        with pytest.raises(Refused):
            check(problem, forged)
    assert check(problem, data) == records[-1]
