"""Mutation testing of graph proofs: a mutant that is accepted names every selection that holds somewhere, exactly."""

import functools
import struct
from contextlib import nullcontext, suppress
from fractions import Fraction

import numpy as np
import pytest
from arc_oracle import recount
from complete import accepted_report
from effort import some
from graph_proofs import GRAPHS, forms_at_once, without_arcs
from oracles import exact_solutions
from proof_fuzz import mutant
from proof_tools import by_forms, copied, proof_of, records_of
from rational_checker import check_records

from enumsol import ProofFormatError, branch_graph, gallery, verify

SAMPLES = 25


def two_loads():
    """Two nodes, load and friction vary, in several pieces."""
    problem = gallery.two_node_square((1.0, -3.0), (1.0, -1.0))
    slope = np.array([0.1, -0.3, 0.2, 0.1])
    return problem.replace(friction=0.5, friction_slope=0.8, load_slope=slope), (0.0, 6.0)


PATHS = {"friction": GRAPHS["friction"], "loading": GRAPHS["load"], "unloaded": GRAPHS["unloaded"], "both": two_loads}
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
    inside = sorted(alpha for alpha in alphas if a <= alpha <= b)
    holding = {alpha: {codes for c in exact_solutions(problem, alpha) for codes, *_ in c.parts} for alpha in inside}
    return problem, without_arcs(records_of(graph.proof)), holding  # arcs are forged in test_rational_arcs


@pytest.mark.few(0, 2)
@pytest.mark.parametrize("name", [*PATHS, *BY_FORMS])
def test_accepted_mutants_name_every_selection_that_holds(name):
    problem, original, holding = case(name)
    rng, accepted = np.random.default_rng([3, len(name)]), 0
    for _ in range(some(25, of=60)):
        records = copied(original)
        for _ in range(int(rng.integers(1, 4))):
            with suppress(ValueError, TypeError, struct.error):  # it does not apply to what is left
                records = records_of(mutant(rng, records, None, ("nudge", "nudge", "nudge", "order", "numbers"))[0])
        if rng.random() < 0.5:
            recount(records)
        try:
            report = verify(problem, proof_of(records))
        except ProofFormatError:
            continue
        if not report.ok:
            assert report.failures
            continue
        accepted += records != original
        assert check_records(problem, records) == report.selections
        a, b = report.interval
        assert all(codes <= report.selections for alpha, codes in holding.items() if a <= alpha <= b)
    assert accepted


@pytest.mark.few(0, 2)
@pytest.mark.parametrize("name", [*PATHS, *BY_FORMS])
def test_the_originals_name_every_selection_that_holds(name):
    problem, records, holding = case(name)
    report = accepted_report(problem, proof_of(records))
    assert set().union(*holding.values()) <= report.selections
    # and there is something to lose: selections that hold at some alphas only
    assert len({frozenset(codes) for codes in holding.values()}) > 1
    assert bool(by_forms(records)) == (name in BY_FORMS)
