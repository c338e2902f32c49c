"""Mutation testing of what graph proofs say of arcs: a mutant that is accepted as a whole is true."""

import functools
import random
from contextlib import suppress
from fractions import Fraction

import numpy as np
import pytest
from arc_oracle import ArcOracle, assignments, claims, recount
from branches.test_degenerate import pair
from checker.test_graph_mutants import PATHS
from complete import accepted_report
from effort import some
from graph_proofs import GRAPHS
from path_problems import generic_problem, one_node, planted_corner, together
from proof_tools import copied, of_kind, proof_of, records_of, why_refused

from enumsol import branch_graph, gallery, verify

ORIGINALS = {
    "triangle": lambda: (gallery.one_node_triangle(), (0.0, 10.0)),
    "fold": lambda: (one_node((1.5, -4.0)), (0.0, 9.0)),
    "loading": PATHS["loading"],
    "unloaded": PATHS["unloaded"],
    "both": PATHS["both"],
    "held by contact": GRAPHS["held by contact"],
    "many digits": lambda: (together(np.random.default_rng(2), push=1e-13), (0.0, 6.0)),
    "open": lambda: (planted_corner(np.random.default_rng(5), 1, "both"), (0.0, 4.0)),
}
#: Mutants of every original in the suite.
MUTANTS = some(50, of=120)


@functools.cache
def original(name):
    """Problem, records, what the checker says of them, and the oracle."""
    problem, interval = ORIGINALS[name]()
    records = records_of(branch_graph(problem, interval).proof)
    return problem, records, verify(problem, proof_of(records)), ArcOracle(problem)


# -- mutations ---------------------------------------------------------------------------------------------------------


def _moved(rng, value):
    """An alpha beside another."""
    if isinstance(value, str):
        near = Fraction(value) + Fraction(rng.choice((-1, 1)), 10 ** rng.randrange(1, 70))
        return str(np.float64(0.5)) if rng.random() < 0.1 else str(near)
    how = rng.randrange(5)
    if how == 0:
        return float(np.nextafter(value, rng.choice((-np.inf, np.inf))))
    if how == 1:
        return value + rng.choice((-1, 1)) * 10.0 ** -rng.randrange(1, 15)
    if how == 2:
        return value * rng.choice((0.5, 0.9, 1.1, 2.0, -1.0))
    return rng.uniform(-1.0, 10.0) if how == 3 else str(value)


def change_part(rng, records):
    parts = records[rng.choice([k for k in of_kind(records, "w") if records[k][4]])][4]
    k, how = rng.randrange(len(parts)), rng.randrange(7)
    part = parts[k]
    if how == 0:  # of another kind
        kind, sign = rng.choice("hneu"), rng.choice((-1, 1))
        fitted = {"h": [sign], "e": [sign, rng.randrange(3), rng.randrange(2), part[1], part[1]]}
        parts[k] = [kind, part[1], *fitted.get(kind, [])]
    elif how == 1:
        del parts[k]
    elif how == 2:
        parts.insert(k, copied(part))
    elif how == 3:
        j = rng.randrange(len(parts))
        parts[k], parts[j] = parts[j], part
    elif how == 4 and k:  # one part, of the kind of one of two, for both
        kept = parts[k - 1] if rng.random() < 0.5 else part
        parts[k - 1 : k + 1] = [[kept[0], part[1], *kept[2:]]]
    else:
        place = rng.randrange(1, len(part))
        if place in (1, 5, 6):
            part[place] = _moved(rng, part[place])
        else:
            part[place] = {2: -part[place], 3: rng.randrange(4)}.get(place, 1 - part[place])


def change_box(rng, records):
    boxes = of_kind(records, "w")
    k = rng.choice(boxes)
    how = rng.randrange(6)
    if how == 0:
        del records[k]
    elif how == 1:
        records.insert(k, copied(records[k]))
    elif how == 2:
        j = rng.choice(boxes)
        records[k], records[j] = records[j], records[k]
    elif how == 3:
        records[k][3] = 1 - records[k][3]
        if records[k][3] == 1 and rng.random() < 0.5:
            records[k][1:3] = [str(Fraction(x)) for x in records[k][1:3]]
    elif how == 4:
        place = rng.choice((1, 2))
        records[k][place] = _moved(rng, records[k][place])
    elif k + 1 in boxes and records[k][4]:  # one box for two
        records[k][2] = records[k + 1][2]
        records[k][4] += records[k + 1][4]
        del records[k + 1]


def _end(records, trace):
    """The place behind a trace and its boxes."""
    boxes = of_kind(records, "w")
    return next(k for k in range(trace + 1, len(records)) if k not in boxes)


def change_trace(rng, records):
    k = rng.choice(of_kind(records, "t"))
    last, how = _end(records, k), rng.randrange(7)
    if how == 0:
        del records[k:last]
    elif how == 1:
        records[last:last] = copied(records[k:last])
    elif how == 2:
        j = rng.randrange(len(records[k][1]))
        records[k][1] = [*records[k][1][:j], rng.randrange(7), *records[k][1][j + 1 :]]
    elif how == 3:
        records[k][4] = rng.choice((-1, 0, 1))
    elif how == 4:
        place = rng.choice((2, 3))
        records[k][place] = _moved(rng, records[k][place])
    elif how == 5:  # too short, or too long, with its first or last box
        place = rng.choice((2, 3))
        box = records[k + 1 if place == 2 else last - 1]
        if box[0] == "w" and box[4]:
            records[k][place] = box[place - 1] = value = _moved(rng, records[k][place])
            if place == 3:
                box[4][-1][1] = value
    else:
        other = rng.choice(of_kind(records, "t"))
        records[k][1], records[other][1] = records[other][1], records[k][1]


def remove_arc(rng, records):
    """An arc and its events are nowhere; the partners of the events may be removed as well."""
    k = rng.choice(of_kind(records, "t"))
    codes = [records[k][1]]
    if rng.random() < 0.6:
        codes.append(rng.choice([records[j][1] for j in of_kind(records, "t")]))
    for j in of_kind(records, "t"):
        for box in records[j + 1 : _end(records, j)] if records[j][1] in codes else ():
            box[4] = [["n", part[1]] if part[0] in "he" else part for part in box[4]]


def hide_selection(rng, records):
    """A surviving selection is removed, or is left to halves that do not follow; its trace may vanish, too."""
    handed = of_kind(records, "s")
    if not handed:
        return
    k = rng.choice(handed)
    codes = [*assignments(records)[k]]
    if rng.random() < 0.5:
        records[k] = rng.choice([["p", "5"], ["x", "", ""]])
    else:
        del records[k]
    if rng.random() < 0.7:
        for j in reversed(of_kind(records, "t")):
            if records[j][1] == codes:
                del records[j : _end(records, j)]


def add_selection(rng, records):
    """A selection that is no leaf of the tree, of arcs that no leaf refers to, with the trace of another or none."""
    handed = of_kind(records, "s")
    if not handed or not of_kind(records, "t"):
        return
    p = records[0]["p"]
    codes = [rng.randrange(5) for _ in range(p)]
    records.insert(rng.choice(handed), ["q", [codes], [1.0] * 3 * p, []])
    first = rng.choice(of_kind(records, "t"))
    last = _end(records, first)
    block = copied(records[first:last])
    block[0][1] = codes
    if rng.random() < 0.5:
        for box in block[1:]:
            box[4] = [["n", part[1]] for part in box[4]]
    if rng.random() < 0.8:
        records[last:last] = block


def change_head(rng, records):
    heads = [record for record in records if isinstance(record, dict)]
    record = rng.choice(heads)
    key = rng.choice(sorted(record))
    value = record[key]
    if key == "interval":
        place = rng.randrange(2)
        record[key][place] = str(Fraction(value[place]) + rng.choice((-1, 1)))
    elif key in ("force", "length"):
        shift = rng.choice((-300, -3, -1, 1, 3, 300))
        record["force"] = [x + shift for x in record["force"]]
        record["length"] = [x - shift * rng.randrange(2) for x in record["length"]]
    elif isinstance(value, int):
        record[key] = value + rng.choice((-1, 1))


def change_type(rng, records):
    """Something of another type where a number, text or list is expected."""
    junk = rng.choice((None, True, "x", "1/0", -1, 10**17, 1e308, -1e308, 5e-324, [], {}, [[]], "9" * 3000, 0.1))
    k = rng.choice(of_kind(records, "w") + of_kind(records, "t"))
    target = records[k]
    if target[0] == "w" and target[4] and rng.random() < 0.7:
        target = rng.choice(target[4])
    if target:
        target[rng.randrange(len(target))] = junk


MUTATIONS = (
    *(*[change_part] * 7, *[change_box] * 2, *[change_trace] * 2, remove_arc),
    *(hide_selection, add_selection, change_head, change_type),
)


def mutant(rng, records):
    """Records with one to three changes."""
    records = copied(records)
    for _ in range(rng.choice((1, 1, 2, 3))):
        try:
            rng.choice(MUTATIONS)(rng, records)
        except (IndexError, TypeError, AttributeError, KeyError, ValueError, OverflowError):
            continue  # it does not apply to what is left
    if rng.random() < 0.8:
        with suppress(IndexError, TypeError, KeyError):
            recount(records)
    return records


def judge(name, records):
    """Check a mutant; whether it was accepted as a whole."""
    problem, true, report, oracle = original(name)
    found = verify(problem, proof_of(records))
    assert found.ok == (not found.failures)
    if not found.complete:
        return False
    for codes, side, part, low in claims(records):
        assert oracle.is_true(codes, side, part, low), (codes, side, part, low)
    # nothing is missing and nothing is there twice; selections that hold nowhere may be added
    assert found.selections >= {codes for codes, _, part, _ in claims(true) if part[0] in "he"}
    assert found.interval == report.interval
    assert not report.complete or found.arcs == report.arcs
    return True


# -- tests -------------------------------------------------------------------------------------------------------------


@pytest.mark.few(3, 1)
@pytest.mark.parametrize("name", ORIGINALS)
def test_the_oracle_agrees_with_the_originals(name):
    _, records, report, oracle = original(name)
    assert report.ok
    assert report.complete == (name != "open")
    said = list(claims(records))
    assert all(oracle.is_true(*claim) for claim in said)
    # and disagrees with their opposites
    for codes, side, part, low in said:
        if part[0] in "he":
            assert not oracle.is_true(codes, side, ["n", part[1]], low)
            assert not oracle.is_true(codes, side, [*part[:2], -part[2], *part[3:]], low)
        if part[0] == "n":
            assert not oracle.is_true(codes, side, ["h", part[1], 1], low)


@pytest.mark.few(0, 1)
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] if name == "open" else []) for name in ORIGINALS]
)
def test_mutants_accepted_as_a_whole_are_true(name):
    rng = random.Random(name)
    _, records, report, _ = original(name)
    accepted = [judge(name, mutant(rng, records)) for _ in range(MUTANTS)]
    assert sum(accepted) < MUTANTS / 2
    if report.complete:
        assert any(accepted)


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("name", [name for name in ORIGINALS if name != "open"])
def test_an_arc_removed_with_its_events_is_refused(name):
    _, records, *_ = original(name)
    for k in of_kind(records, "t"):
        for j in of_kind(records, "t"):
            changed, removed = copied(records), 0
            for box in [box for place in {k, j} for box in changed[place + 1 : _end(changed, place)]]:
                removed += sum(part[0] in "he" for part in box[4])
                box[4] = [["n", part[1]] for part in box[4]]
            recount(changed)
            assert judge(name, changed) == (removed == 0)


@pytest.mark.slow
def test_proofs_of_degenerate_graphs_are_accepted():
    for push in (0.0, 1e-12)[: some(1, of=2)]:
        problem = pair(push)
        report = accepted_report(problem, branch_graph(problem, (0.0, 6.0)).proof)
        assert not report.complete
        assert repr(report).endswith("\n  complete: no")


def triangle():
    """Records that may be changed, and the place of the trace of the open node."""
    records = copied(original("triangle")[1])
    return records, next(k for k in of_kind(records, "t") if records[k][1] == [0])


def test_a_status_that_a_node_cannot_have_is_refused():
    records, k = triangle()
    last = _end(records, k)
    records[last:last] = [["t", [4], *records[k][2:]], *copied(records[k + 1 : last])]
    records.insert(of_kind(records, "s")[0], ["q", [[4]], [1.0] * 3, []])
    recount(records)
    assert "cannot have" in why_refused(original("triangle")[0], records)


@pytest.mark.parametrize(("place", "beyond"), [(2, -1.0), (3, 11.0), (2, -5e-324), (3, 10.000000000000002)])
def test_traces_that_reach_beyond_their_pieces_are_refused(place, beyond):
    records, k = triangle()
    records[k][place] = records[k + 1][place - 1] = beyond
    if place == 3:
        records[k + 1][4][-1][1] = beyond
    assert "its selection does not survive there" in why_refused(original("triangle")[0], records)


def with_boxes(*boxes):
    """What the judge says of the triangle's records with other boxes in the first trace."""
    records, _ = triangle()
    first = of_kind(records, "t")[0]
    records[first + 1 : _end(records, first)] = boxes
    return judge("triangle", records)


EXTREME = (1.7e308, -1.7e308, 5e-324, 1e-300, "1" + 308 * "0", "1/" + 3999 * "9", 3, True, None, "x", [1])


@pytest.mark.parametrize("value", EXTREME, ids=lambda value: str(value)[:12])
def test_extreme_and_senseless_numbers_are_refused(value):
    assert not with_boxes(["w", 0.0, value, 0, [["h", value, 1]]])
    assert not with_boxes(["w", "0", value, 1, [["h", value, 1]]])
    for first in (value, 1.0):
        assert not with_boxes(["w", 0.0, 10.0, 0, [["e", 10.0, 1, 0, 1, first, value]]])


def test_bounds_as_fractions_of_a_problem_without_many_digits_are_refused(monkeypatch):
    """They are looked at after all traces, together with others."""
    problem, records, _, _ = original("triangle")
    records = copied(records)
    events = [part for k in of_kind(records, "w") for part in records[k][4] if part[0] == "e"]
    for part in events:
        part[5:7] = [str(Fraction(bound)) for bound in part[5:7]]
    assert events
    assert verify(problem, proof_of(records)).complete
    monkeypatch.setattr("enumsol.trusted.arcs.precise.affordable", lambda _: False)
    assert "too large for it" in why_refused(problem, records)


def test_boxes_without_parts_are_refused():
    last = ["w", 0.0, 10.0, 0, [["h", 10.0, 1]]]
    assert with_boxes(last)
    assert not with_boxes(["w", 0.0, 10.0, 0, []], last)


@pytest.mark.parametrize("exponents", [(900, -900), (-900, 900), (900, 900), (-900, -900)])
def test_units_in_which_everything_overflows_prove_nothing(exponents):
    records, _ = triangle()
    head = next(record for record in records if isinstance(record, dict) and "traces" in record)
    head["force"], head["length"] = ([exponent] * 2 for exponent in exponents)
    assert not judge("triangle", records)


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("part", range(3))
def test_whole_proofs_have_the_arcs_of_exact_algebra(part):
    whole = 0
    for seed in range(14 * part, 14 * part + 14):
        rng = np.random.default_rng(seed)
        problem = generic_problem(rng, int(rng.integers(1, 3)), ("friction", "load", "both")[seed % 3])
        if seed % 4 == 3:
            problem = planted_corner(rng, 1, "both")
        graph = branch_graph(problem, (0.0, 4.0))
        report = accepted_report(problem, graph.proof)
        whole += report.complete
        assert not report.complete or report.arcs == len(graph.arcs)
    assert whole > 6
