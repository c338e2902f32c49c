"""Proofs of graphs in 3D say how curves are cut into arcs, and the checker proves it again (theory, section 12.10)."""

import functools
import pickle

import numpy as np
import pytest
from complete import accepted_report, complete_report, whole_graph
from problems3d import OneNode, random_over_alpha
from proof_tools import copied, of_kind, proof_of, put, records_of, replaced, why_refused

from enumsol import ProofFormatError, gallery, verify
from enumsol.branches.elements import VertexKind
from enumsol.checker import space_graph

PROBLEMS = {
    "fold": (lambda: OneNode(1, load=True).problem, (-3, 3)),
    "transitions": (lambda: random_over_alpha(2, 6), (0, 1)),
    "two curves": (lambda: random_over_alpha(2, 1), (0, 1)),
    "block": (lambda: gallery.block3d(2, 1, 1), (0, 2)),
}


#: Curves by what the proofs give of them.
KNOWN = {}


@functools.cache
def proven(name):
    """A problem, its graph, and the records of that proof."""
    build, interval = PROBLEMS[name]
    problem = build()
    graph = whole_graph(problem, interval)
    return problem, graph, records_of(graph.proof)


@pytest.fixture(autouse=True)
def followed_once(monkeypatch):
    """Of proofs that differ in the parts of their curves, boxes that are the same are tested once whether they join."""
    whole, known = space_graph.chain_of, KNOWN

    def chain_of(given, boxes, points, interval):
        data = [vars(box) for box in (*boxes, *points)]
        key = pickle.dumps((given.force, given.S.mid, given.g1.mid, data, interval))
        if key not in known:
            known[key] = whole(given, boxes, points, interval)
        return known[key]

    monkeypatch.setattr(space_graph, "chain_of", chain_of)


def cuts(records):
    """Where the parts of curves are."""
    tree = records.index({"tree": True})
    return [k for k in range(tree) if isinstance(records[k], list) and records[k][0] != "w"]


def of_curves(records):
    """The same of the curves alone: where there are solutions beside them is left open."""
    tree = records.index({"tree": True})
    return [*records[: tree + 1], ["u", "not searched"], {**records[-1], "leaves": 1, "gaps": 1}]


@pytest.mark.parametrize("name", PROBLEMS)
def test_a_proof_has_the_arcs_of_its_graph(name):
    problem, graph, records = proven(name)
    report = complete_report(problem, graph.proof)
    assert (report.arcs, report.open) == (len(graph.arcs), 0)
    assert records[-1]["arcs"] == len(graph.arcs)
    assert f"lies on {report.arcs} arcs of {report.curves} curve" in repr(report)


def test_all_kinds_of_parts_occur():
    found = [records[k] for name in PROBLEMS for records in [proven(name)[2]] for k in cuts(records)]
    kinds = {(record[0], record[1] is None) for record in found}
    assert kinds >= {("s", True), ("s", False), ("h", True), ("h", False), ("f", False), ("c", True), ("c", False)}


def test_without_parts_a_proof_says_nothing_of_arcs():
    problem, _, records = proven("fold")
    parts = {*cuts(records), *(k for k, record in enumerate(records) if record == {"parts": True})}
    kept = [record for k, record in enumerate(records) if k not in parts]
    report = complete_report(problem, proof_of(put(kept, (-1, "arcs"), None)))
    assert (report.arcs, report.curves) == (None, 1)
    assert "lies on 1 curve\n" in repr(report)


def test_an_open_part_is_a_gap():
    """A part with a fold, or a change of statuses, that is not decided; what follows it in the walk is left out."""
    problem, graph, records = proven("fold")
    (fold,) = of_kind(records, "f")
    opened = replaced(records, fold, ["u", records[fold][1]])
    report = accepted_report(problem, proof_of(put(put(opened, (-1, "gaps"), 1), (-1, "arcs"), len(graph.arcs))))
    assert (report.complete, report.open, report.arcs) == (False, 1, len(graph.arcs))


@pytest.mark.parametrize(
    ("name", "kind", "forged", "why"),
    [
        ("fold", "s", lambda _: ["f", None, None, None], "a place on a curve is missing"),
        ("fold", "s", lambda _: ["h", None], "is no part of a curve"),
        ("fold", "s", lambda _: ["q", None], "is no part of a curve"),
        ("fold", "s", lambda _: [], "is no part of a curve"),
        ("fold", "s", lambda _: ["s", ["x"]], "is no box"),
        ("fold", "f", lambda record: ["s", record[1]], "not proven which way alpha goes"),
        ("fold", "f", lambda record: ["f", record[1], record[3], record[2]], "not proven which way alpha goes"),
        ("fold", "f", lambda record: ["f", record[1], record[2], record[2]], "not proven which way alpha goes"),
        ("fold", "f", lambda record: ["f", record[2], *record[2:]], "not proven to hold it"),
        (
            "fold",
            "f",
            lambda record: ["f", record[1], record[1], record[3]],
            "a place is not proven to be on its curve",
        ),
        ("fold", "f", lambda record: ["f", None, *record[2:]], "a part of a curve has no box"),
        ("fold", "c", lambda record: ["s", record[1]], "not proven which way alpha goes"),
        ("fold", "c", lambda record: ["c", *record[1:3], record[2], None], "changes its statuses between two places"),
        ("transitions", "c", lambda record: ["c", record[1], record[3], *record[3:]], "two places"),
        ("transitions", "h", lambda record: ["s", record[1]], "not proven which way alpha goes"),
        ("block", "c", lambda record: ["f", *record[1:4]], "not proven which way alpha goes"),
    ],
)
def test_forged_parts_are_refused(name, kind, forged, why):
    problem, _, records = proven(name)
    k = of_kind(records, kind)[0]
    assert why in why_refused(problem, replaced(records, k, forged(records[k])))


def test_a_middle_beside_its_part_is_refused():
    """The first half of a part, halved at the place at which that itself was: one half of it would run backwards."""
    problem, _, records = proven("fold")
    halved = of_kind(records, "h")
    pairs = [(k, k + 1) for k in halved if k + 1 in halved]
    assert pairs
    for one, other in pairs:
        forged = replaced(records, other, ["h", records[other][1], records[one][2]])
        assert "beside the part" in why_refused(problem, forged)


@pytest.mark.parametrize("name", PROBLEMS)
def test_arcs_are_counted(name):
    problem, _, records = proven(name)
    records = of_curves(records)
    assert accepted_report(problem, proof_of(records)).arcs == records[-1]["arcs"]
    for claim in (records[-1]["arcs"] + 1, None, True):
        assert "the counts at the end" in why_refused(problem, put(records, (-1, "arcs"), claim))
    last = cuts(records)[-1]
    assert "is no part" in why_refused(problem, [*records[:last], *records[last + 1 :]])


def mutated(rng, records):
    """Records with one part of a curve changed: its kind, a box, a number, or its place among the others."""
    found, places = copied(records), cuts(records)
    k, j = rng.choice(places, 2)
    how = rng.integers(5)
    boxes = [(a, b) for a in places for b in range(1, len(found[a])) if found[a][b] is not None]
    if how == 0:
        found[k] = copied(found[j])
    elif how == 1:
        del found[k]
    elif how == 2:
        found.insert(k, copied(found[j]))
    elif how == 3 and len(boxes) > 1:
        (a, b), (c, d) = (boxes[i] for i in rng.choice(len(boxes), 2))
        found[a][b] = copied(found[c][d])
    elif boxes:
        a, b = boxes[rng.integers(len(boxes))]
        part = found[a][b][rng.integers(1, 6)]
        i = rng.integers(len(part))
        part[i] = float(part[i] * rng.choice([-1.0, 0.0, 0.5, 1.0 + 1e-9, 2.0]) + rng.choice([0.0, 1e-12, 1e-3]))
    return found


@pytest.mark.few(1, 3)
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", PROBLEMS)
def test_mutants_say_nothing_wrong(name, seed):
    """What is accepted has as many arcs as the graph."""
    problem, graph, records = proven(name)
    records = of_curves(records)
    rng, accepted = np.random.default_rng(seed), 0
    for _ in range(10):
        mutant = mutated(rng, records)
        try:
            report = verify(problem, proof_of(mutant))
        except ProofFormatError:
            continue
        accepted += report.ok
        assert not report.ok or report.arcs == len(graph.arcs)
    assert accepted < 10


def test_folds_are_between_two_arcs():
    _, graph, records = proven("fold")
    smooth = [v for v in graph.vertices if v.kind is VertexKind.FOLD and len(v.selections) == 1]
    assert len(smooth) == len(of_kind(records, "f")) == 1
