"""Proofs of graphs in 3D leaf by leaf: every kind of leaf is accepted, and forged ones, curves and headers are not."""

import functools
from fractions import Fraction

import pytest
from complete import accepted_report, all_roots
from problems3d import random_over_alpha
from proof_tools import of_kind, proof_of, put, records_of, replaced, why_refused

from enumsol import verify
from enumsol.branches.space.space_graph import ByCurves
from enumsol.gallery import wedge3d
from enumsol.search.space.piece_proposals import ExaminedPiece
from enumsol.support.deadlines import Deadline

INTERVAL = Fraction(0), Fraction(1)
#: Of a wedge, with a leaf that only its equations show to be without a root.
WEDGED = Fraction(55, 64), Fraction(7, 8)


@functools.cache
def leaf_by_leaf(p, seed):
    """A problem and the records of its proof without certificates for a piece: every selection is a leaf.

    With no node of a random problem it is that of a wedge.
    """
    cover = ByCurves(random_over_alpha(p, seed), INTERVAL) if p else ByCurves(wedge3d(2, 1, 2), WEDGED)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ExaminedPiece, "numbers", lambda *_: None)
        patch.setattr(ExaminedPiece, "is_hopeful", lambda *_: False)
        cover.run(100, Deadline(), None, None)
    return cover.problem, records_of(cover.proof())


#: Problems with leaves of these kinds: arcs, boxes in a row, and selections without roots.
ARCS, ROWS, NONE = (2, 7), (1, 5), (0, 0)


@pytest.mark.parametrize(("name", "kinds"), [(ARCS, "pbtx"), (ROWS, "bkx"), (NONE, "bknx")])
def test_leaves_say_that_all_solutions_lie_on_a_curve(name, kinds):
    problem, records = leaf_by_leaf(*name)
    assert {record[0] for record in records if isinstance(record, list)} >= {"w", *kinds}
    told = []
    report = verify(problem, proof_of(records), progress=told.append)
    curves, alphas = (1, (0.1, 0.5, 0.9)) if name != NONE else (3, (0.86, 0.8671875, 0.874))
    assert (report.complete, report.curves, report.open) == (True, curves, 0)
    assert told == [report.leaves] == [records[-1]["leaves"]]
    counts = [len(all_roots(problem, alpha)) for alpha in alphas]
    assert counts == [curves] * 3


def test_open_leaves_are_gaps():
    problem, records = leaf_by_leaf(*ROWS)
    k = of_kind(records, "k")[0]
    report = accepted_report(problem, proof_of(put(replaced(records, k, ["u", "no time"]), (-1, "gaps"), 1)))
    assert not report.complete
    assert (report.curves, report.open) == (1, 1)
    assert "1 curve; left open in 1 piece of alpha" in repr(report)
    assert repr(report).endswith("complete: no")


def cut_short(records):
    """Without the last box of its curve, and the point behind that."""
    place = records.index({"tree": True})
    (header, curve), boxes = records[:2], records[2 : place - 2]
    return [header, {"curve": curve["curve"] - 1}, *boxes, *records[place:]]


def test_where_a_curve_ends_inside_the_interval_an_arc_says_nothing():
    problem, records = leaf_by_leaf(*ARCS)
    short = put(cut_short(records), (-1, "gaps"), 1)
    assert why_refused(problem, short).count("not proven to be an arc through its box") == len(of_kind(records, "t"))


def test_an_end_inside_the_interval_is_a_gap():
    problem, records = leaf_by_leaf(*ROWS)
    curve, place = cut_short(records), records.index({"tree": True}) - 2
    tree = [{"tree": True}, ["u", "no time"], {"curves": 1, "arcs": None, "leaves": 1, "gaps": 2}]
    report = accepted_report(problem, proof_of([*curve[:place], *tree]))
    assert (report.complete, report.curves, report.open) == (False, 1, 2)
    for gaps in (0, 1):
        forged = [*curve[:place], *tree[:-1], {"curves": 1, "arcs": None, "leaves": 1, "gaps": gaps}]
        assert "the counts at the end" in why_refused(problem, forged)


def test_a_curve_alone_says_nothing():
    problem, records = leaf_by_leaf(*ROWS)
    place = records.index({"tree": True}) + 1
    claim = {"curves": 1, "arcs": None, "leaves": 1, "gaps": 0}
    assert "claimed where statuses are still open" in why_refused(problem, [*records[:place], ["n"], claim])
    assert "the tree breaks off" in why_refused(problem, records[:place])


@pytest.mark.parametrize("begin", [{"tree": 1}, {"tree": 1.0}, {"tree": "true"}, {"tree": False}, {"tree": [True]}, {}])
def test_a_tree_begins_with_true_itself(begin):
    problem, records = leaf_by_leaf(*ROWS)
    forged = replaced(records, records.index({"tree": True}), begin)
    assert "the tree over alpha is missing" in why_refused(problem, forged)


@pytest.mark.parametrize(
    ("name", "kind", "forged", "why"),
    [
        (ARCS, "t", lambda record: ["t", record[1] - 1, *record[2:]], "not proven to be an arc through its box"),
        (ARCS, "t", lambda record: [*record[:4], record[2], record[5]], "not proven to be an arc through its box"),
        (
            ARCS,
            "t",
            lambda record: [*record[:2], *[record[4]] * 3, record[5]],
            "not proven to be an arc through its box",
        ),
        (ARCS, "t", lambda record: [*record[:5], [0] * len(record[5])], "not proven to be an arc through its box"),
        (ARCS, "t", lambda record: [*record[:4], "7", record[5]], "a point of an arc is not over its piece"),
        (ARCS, "t", lambda record: [*record[:4], 0.5, record[5]], "an arc is over no piece"),
        (ARCS, "t", lambda record: [*record[:5], [6] * len(record[5])], "the leaf of a point of an arc is none"),
        (ARCS, "t", lambda record: ["t", 1000, *record[2:]], "there is no box 1000"),
        (ARCS, "t", lambda record: ["t", True, *record[2:]], "there is no box True"),
        (ARCS, "t", lambda _: ["n"], "not proven to hold no root"),
        (NONE, "n", lambda _: ["q"], "unknown kind of record 'q'"),
        (NONE, "n", lambda _: [], "the tree breaks off"),
        (ARCS, "x", lambda _: ["x", [], "", ""], "its multipliers do not exclude it"),
        (ARCS, "x", lambda record: ["x", record[1][1:], *record[2:]], "rows and"),
        (ARCS, "x", lambda record: ["x", *record[2:], record[2]], "its form was not declared"),
        (ROWS, "k", lambda _: ["n"], "not proven to hold no root"),
        (ROWS, "k", lambda record: ["k", record[2], record[2]], "not proven to lie in its boxes"),
        (ROWS, "k", lambda record: ["k", record[2], record[1]], "not proven to lie in its boxes"),
        (ROWS, "k", lambda record: ["k", record[1], -1], "there is no box -1"),
        (ROWS, "k", lambda record: [*record, [1.0]], "a form over a piece cannot be read: expected"),
        (ARCS, "p", lambda _: ["p", "1"], "a piece is not cut within"),
        (ARCS, "p", lambda _: ["p", "1/0"], "a piece is cut nowhere"),
        (ARCS, "p", lambda _: ["p", 0.5], "a piece is cut nowhere"),
        (ROWS, "b", lambda record: ["b", 0, record[2][1:]], "does not cover the assignment"),
    ],
)
def test_forged_leaves_are_refused(name, kind, forged, why):
    problem, records = leaf_by_leaf(*name)
    k = of_kind(records, kind)[0]
    assert why in why_refused(problem, replaced(records, k, forged(records[k])))


def test_the_check_ends_after_many_failures():
    problem, records = leaf_by_leaf(*ROWS)
    place, parts, nothing = records.index({"tree": True}) + 1, 64, ["x", [], "", ""]
    cuts = [part for k in range(1, parts) for part in (["p", f"{k}/{parts}"], nothing)]
    claim = {"curves": 1, "arcs": None, "leaves": parts, "gaps": 0}
    said = why_refused(problem, [*records[:place], *cuts, nothing, claim])
    assert said.count("its multipliers do not exclude it") == 20
    assert "the check ends after 20 failures" in said


@pytest.mark.parametrize(
    ("path", "value", "why"),
    [
        ((0, "data"), "condensed", "certifies the problem's own data only"),
        ((0, "interval"), ["0"], "is not an interval"),
        ((0, "interval"), ["1", "0"], "an interval is empty"),
        ((0, "interval"), ["-1000", "1"], "friction is negative in the interval"),
        ((0, "length"), lambda length: [length[0] + 1, *length[1:]], "no common scaling of energy"),
        ((0, "force"), None, "the units are not 2 binary exponents"),
        ((0, "steps"), lambda steps: [0, *steps[1:]], "a step is not positive"),
        ((0, "steps"), lambda steps: steps[1:], "expected 6 numbers"),
        ((1, "curve"), 0, "curve 1 has 0 boxes"),
        ((1, "curve"), True, "curve 1 has True boxes"),
        ((1, "curve"), 1, "the tree over alpha is missing"),
        ((1, "curve"), lambda count: count + 1, "is no box"),
        ((2, 1), [0.0], "a box around a curve cannot be read"),
        ((3, 2), lambda direction: [-x for x in direction], "curve 1 is not proven to be one"),
        ((3, 6), lambda half: 0.5 * half, "curve 1 is not proven to be one"),
        ((-1, "curves"), 2, "the counts at the end"),
        ((-1, "leaves"), True, "the counts at the end"),
        ((-1,), None, "the counts at the end are missing"),
    ],
)
def test_forged_headers_curves_and_counts_are_refused(path, value, why):
    problem, records = leaf_by_leaf(*ARCS)
    assert why in why_refused(problem, put(records, path, value))


def test_what_belongs_to_no_tree_or_curve_is_refused():
    problem, records = leaf_by_leaf(*ROWS)
    place = records.index({"tree": True})
    assert "the tree over alpha is missing" in why_refused(problem, replaced(records, place))
    assert "records follow after the end" in why_refused(problem, [*records, records[-1]])
    twice = put([records[0], *records[1:place], *records[1:]], (-1, "curves"), 2)
    assert "two curves may be the same" in why_refused(problem, twice)
