"""Mutation testing of graph proofs: a mutant that is accepted names every selection that holds somewhere, exactly."""

import functools
from contextlib import nullcontext
from fractions import Fraction

import numpy as np
import pytest
from generators import through_the_unloaded_state
from graph_proofs import forms_at_once, without_arcs
from hypothesis import HealthCheck, assume, given, settings, strategies as st
from oracles import exact_solutions
from proof_tools import copied, multipliers, proof_of, records_of, with_multipliers
from rational_checker import check_records

from enumsol import ContactProblem, branch_graph, gallery, verify

QUICK = settings(max_examples=120, deadline=None, suppress_health_check=list(HealthCheck), derandomize=True)
SAMPLES = 25


def two_loads():
    """Two nodes, load and friction vary, in several pieces."""
    problem = gallery.two_node_square((1.0, -3.0), (1.0, -1.0))
    slope = np.array([0.1, -0.3, 0.2, 0.1])
    data = {"friction": (0.5, 0.8), "load_slope": slope}
    return ContactProblem(problem.A, problem.Bn, problem.Bt, problem.f, **data), (0.0, 6.0)


PATHS = {
    "friction": lambda: (gallery.get("two-node-6.4").build(), (0.0, 6.0)),
    "loading": lambda: (gallery.get("two-node-6.7-minus").build(), (-3.0, 3.0)),
    "unloaded": through_the_unloaded_state,
    "both": two_loads,
}


#: The same with forms in place of the energy.
BY_FORMS = {
    "forms, friction": lambda: (PATHS["friction"]()[0], (0.5, 6.0)),
    "forms, loading": PATHS["loading"],
    "forms, both": PATHS["both"],
}


@functools.cache
def case(name):
    """The problem, its proof's records, and per alpha the selections that hold there, in rationals."""
    problem, interval = (PATHS | BY_FORMS)[name]()
    with forms_at_once() if name in BY_FORMS else nullcontext():
        graph = branch_graph(problem, interval)
    a, b = (Fraction(end) for end in interval)
    alphas = {a + (b - a) * Fraction(k, SAMPLES) for k in range(SAMPLES + 1)}
    alphas |= {Fraction(float(v.alpha)) for v in graph.vertices} | {Fraction(0)}
    holding = {
        alpha: {codes for c in exact_solutions(problem, alpha) for codes, *_ in c.parts}
        for alpha in sorted(alphas)
        if a <= alpha <= b
    }
    return problem, without_arcs(records_of(graph.proof)), holding  # arcs are forged in test_rational_arcs


def _mutate_codes(draw, record):
    place, codes = draw(st.integers(0, len(record[1]) - 1)), record[1]
    record[1] = codes[:place] + str(draw(st.integers(0, 6))) + codes[place + 1 :]


def _mutate_values(draw, record):
    rows, values = multipliers(["x", *record[2:]])
    assume(rows)
    j = draw(st.integers(0, len(rows) - 1))
    how = draw(st.sampled_from(("sign", "scale", "all", "row", "drop")))
    if how == "sign":
        values[j] = -values[j]
    elif how == "scale":
        values[j] *= draw(st.sampled_from((0.0, 0.5, 2.0, 1e3, 1 + 1e-9)))
    elif how == "all":
        values = [v * draw(st.sampled_from((1e-6, 0.5, 2.0, 1e6))) for v in values]
    elif how == "row":
        rows[j] = draw(st.integers(0, 20))
    else:
        del rows[j], values[j]
    record[2:] = with_multipliers(["x", "", ""], rows, values)[1:]


def _mutate_header(draw, record):
    if "interval" in record:
        place = draw(st.integers(0, 1))
        shift = Fraction(draw(st.sampled_from((-1, 1))), 4)
        record["interval"][place] = str(Fraction(record["interval"][place]) + shift)
    elif "piece" in record:
        key = draw(st.sampled_from(("piece", "force", "length", "roots")))
        place = draw(st.integers(0, len(record[key]) - 1))
        if key == "piece":
            record[key][place] = str(Fraction(record[key][place]) + Fraction(draw(st.integers(-2, 2)), 8))
        elif key == "roots":
            record[key][place] = "5" + record[key][place][1:]
        else:
            shift = draw(st.integers(-3, 3))
            record["force"] = [x + shift for x in record["force"]]
            record["length"] = [x - shift * draw(st.integers(0, 1)) for x in record["length"]]
    else:
        key = draw(st.sampled_from(sorted(record)))
        record[key] += draw(st.integers(-1, 1))


def mutate(draw, records):
    """Change one thing."""
    k = draw(st.integers(0, len(records) - 1))
    record = records[k]
    how = draw(st.sampled_from(("inside", "inside", "inside", "drop", "repeat", "swap", "kind")))
    if how == "drop":
        del records[k]
    elif how == "repeat":
        records.insert(k, copied(record))
    elif how == "swap":
        other = draw(st.integers(0, len(records) - 1))
        records[k], records[other] = records[other], records[k]
    elif isinstance(record, dict):
        _mutate_header(draw, record)
    elif how == "kind" and record[0] != "q":
        kind = draw(st.sampled_from("scxf"))
        records[k] = [kind, *record[1:]] if kind in "xf" else [kind, record[1]]
    elif record[0] in ("x", "f") and draw(st.booleans()):
        _mutate_values(draw, record)
    elif record[0] == "q":
        values, j = record[draw(st.integers(1, 4))], draw(st.integers(0, len(record[1]) - 1))
        values[j] = values[j] * draw(st.sampled_from((-1.0, 0.5, 1 + 1e-9, 2.0, 30.0))) + draw(
            st.sampled_from((0.0, 0.1))
        )
    else:
        _mutate_codes(draw, record)


def recount(records):
    """Make the counts at the end fit, as somebody would who wants to be believed."""
    lists = [record for record in records if isinstance(record, list)]
    claim = {
        "pieces": sum(isinstance(record, dict) and "piece" in record for record in records),
        "leaves": sum(record[0] in ("x", "f") for record in lists),
        "selections": len({record[1] for record in lists if record[0] == "s"}),
    }
    if isinstance(records[-1], dict) and "pieces" in records[-1]:
        records[-1] = claim


@pytest.mark.few(1)
@pytest.mark.parametrize("name", [*PATHS, *BY_FORMS])
def test_accepted_mutants_name_every_selection_that_holds(name):
    problem, original, holding = case(name)
    accepted = []

    @QUICK
    @given(st.data())
    def check(data):
        records = copied(original)
        for _ in range(data.draw(st.integers(1, 3))):
            mutate(data.draw, records)
        if data.draw(st.booleans()):
            recount(records)
        report = verify(problem, proof_of(records))
        if not report.ok:
            assert report.failures
            return
        accepted.append(records != original)
        assert check_records(problem, records) == report.selections
        a, b = report.interval
        for alpha, codes in holding.items():
            if a <= alpha <= b:
                assert codes <= report.selections

    check()
    assert any(accepted)


def test_the_originals_name_every_selection_that_holds():
    for name in (*PATHS, *BY_FORMS):
        problem, records, holding = case(name)
        report = verify(problem, proof_of(records))
        assert report.ok
        assert set().union(*holding.values()) <= report.selections
        # and there is something to lose: selections that hold at some alphas only
        assert len({frozenset(codes) for codes in holding.values()}) > 1
        by_forms = sum(isinstance(record, list) and record[0] == "f" for record in records)
        assert (by_forms > 0) == (name in BY_FORMS)
