"""Forms other than the energy over pieces of the interval: the same graphs, and proofs that both checkers accept."""

from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction

import numpy as np
import pytest
from complete import complete_report, proven_graph
from generators import through_the_unloaded_state
from graph_proofs import forms_at_once, refused, without_arcs
from oracles import exact_solutions
from path_problems import generic_problem
from proof_tools import by_forms, of_kind, proof_of, records_of, replaced
from rational_checker import check_records

from enumsol import branch_graph, gallery, verify
from enumsol.relaxation.active_set import ActiveSetEngine, IntervalSystem, PieceForm
from enumsol.search import interval_tree
from enumsol.search.interval_tree import PairedTerms, better_form
from enumsol.trusted.exclusion import exclusion_margin
from enumsol.trusted.over_interval import EnclosedPiece

KINDS = ("friction", "load", "both")


def with_forms(problem, interval):
    with forms_at_once():
        return branch_graph(problem, interval)


def shape(graph):
    return sorted((arc.selections, arc.index, round(arc.lo, 9), round(arc.hi, 9)) for arc in graph.arcs)


@pytest.mark.few(2)
@pytest.mark.parametrize("kind", KINDS)
def test_graphs_and_both_checkers_agree(kind):
    forms = 0
    for seed in range(8):
        rng = np.random.default_rng(seed)
        problem = generic_problem(rng, int(rng.integers(1, 4)), kind)
        graph, plain = with_forms(problem, (0.5, 4.0)), branch_graph(problem, (0.5, 4.0))
        assert graph.complete
        assert shape(graph) == shape(plain)
        records = records_of(graph.proof)
        report = complete_report(problem, graph.proof)
        if problem.p < 3:
            assert check_records(problem, without_arcs(records)) == report.selections
        forms += len(by_forms(records))
    assert forms > 10


def test_beside_the_unloaded_state():
    problem, interval = through_the_unloaded_state()
    graph = with_forms(problem, interval)
    records = records_of(graph.proof)
    assert by_forms(records)
    assert check_records(problem, records) == verify(problem, graph.proof).selections


def test_where_friction_vanishes_the_energy_is_kept():
    condensed = gallery.get("wedge-8-3").build().condensed
    assert better_form(IntervalSystem.from_problem(condensed, 0.0, 2.0, None)) is None


@pytest.mark.slow
def test_a_piece_with_solutions_is_not_excluded_by_any_form():
    tried = 0
    for seed in range(30):
        rng = np.random.default_rng(seed)
        problem = generic_problem(rng, int(rng.integers(1, 3)), KINDS[seed % 3])
        a = Fraction(int(rng.integers(1, 8)), 4)
        b = a + Fraction(int(rng.integers(1, 8)), 8)
        units = np.ones(2 * problem.p)
        piece = EnclosedPiece.from_enclosure(problem.enclosure, a, b, units, units, None)
        for alpha in (a, (3 * a + b) / 4, b):
            for codes in {codes for c in exact_solutions(problem, alpha) for codes, *_ in c.parts}:
                form = rng.normal(size=(4, problem.p)) * 0.3
                form[0] += 1.0
                form[2:] = np.abs(form[2:])
                within = piece.with_form(form)
                tried += all(one.smallest_eigenvalue > 0 for one in within.forms)
                for _ in range(20):
                    rows = np.arange(9 * problem.p)[rng.random(9 * problem.p) < 0.7]
                    values = rng.normal(size=len(rows)) * 10.0 ** rng.uniform(-3, 2)
                    # the sign that most rows allow
                    values = np.where(rng.random(len(rows)) < 0.8, np.abs(values), values)
                    assert not exclusion_margin(within, codes, rows, values) > 0
    assert tried > 50


def test_a_form_is_the_same_over_shorter_pieces():
    problem = generic_problem(np.random.default_rng(3), 3, "both")
    long, short = (IntervalSystem.from_problem(problem.condensed, a, 2.0, None) for a in (1.0, 1.5))
    multipliers = np.abs(np.random.default_rng(1).normal(size=(4, 3))) * 0.1 + [[1], [0], [0.5], [0.5]]
    kept = PairedTerms.of(multipliers, long.F_lo)
    np.testing.assert_allclose(kept.multipliers(long.F_lo), multipliers, rtol=1e-14, atol=1e-15)
    H = PieceForm.of(long, multipliers).H / long.scaled.force[:, None] / long.scaled.force
    again = PieceForm.of(short, kept.multipliers(short.F_lo)).H / short.scaled.force[:, None] / short.scaled.force
    np.testing.assert_allclose(again / again[0, 0], H / H[0, 0], rtol=1e-12, atol=1e-14)


def test_the_relaxation_with_a_form_bounds_it_from_below():
    """With no rows on, over [a, b] and at fixed alphas."""
    for seed in range(10):
        rng = np.random.default_rng(seed)
        problem = generic_problem(rng, 2, "load")
        system = IntervalSystem.from_problem(problem.condensed, 1.0, 2.0, None)
        form = PieceForm.of(system, np.array([[1.2, 0.9], [0.1, -0.1], [0.4, 0.5], [0.5, 0.6]]))
        relaxation = ActiveSetEngine.over(system, form).root([], [])
        loads = [form.h + tau * form.half for tau in np.linspace(-1, 1, 21)]
        least = min(-0.25 * h @ np.linalg.solve(form.H, h) for h in loads)
        assert relaxation.bound <= least + 1e-12
        assert relaxation.bound >= least - 0.26 * form.half @ np.linalg.solve(form.H, form.half) - 2e-3


def test_forms_that_make_no_sense_are_refused():
    problem = generic_problem(np.random.default_rng(2), 2, "both")
    records = without_arcs(records_of(with_forms(problem, (0.5, 4.0)).proof))
    (k, *_) = of_kind(records, "q")
    form = records[k]
    codes, numbers = form[1], form[2]
    others = [["q", codes, [*mu, *numbers[2:]], []] for mu in (["x", 1.0], [1e308] * 2, [0.0] * 2, [-1.0] * 2)]
    others += [["q", codes, None, []], form[:3], [*form, 0.0], ["q", codes, numbers, [0.0]], ["q", [6], numbers, []]]
    others += [["q", [6, 5], numbers, []], ["q", [], numbers, []], ["q", codes, numbers[:7], []]]
    others += [["q", codes, [*numbers[:4], -1.0, *numbers[5:]], []]]
    for changed in others:
        assert refused(problem, replaced(records, k, changed))
    assert not verify(problem, proof_of(replaced(records, k))).ok
    # a form that no leaf needs changes nothing
    assert verify(problem, proof_of([*records[:k], form, form, *records[k:]])).ok


def test_the_proof_does_not_depend_on_the_workers():
    problem = generic_problem(np.random.default_rng(5), 3, "both")
    with forms_at_once(), ThreadPoolExecutor(2) as executor:
        alone, parallel = (branch_graph(problem, (0.5, 4.0), executor=one) for one in (None, executor))
        assert records_of(parallel.proof) == records_of(alone.proof)


@pytest.mark.slow
def test_trees_that_are_given_up_change_nothing_but_the_pieces(monkeypatch):
    problem = gallery.get("wedge-8-3").build()
    plain = branch_graph(problem, (0.0, 3.0))
    monkeypatch.setattr(interval_tree, "MOST_CUT", 4)
    graph = proven_graph(problem, (0.0, 3.0))
    assert graph.stats.pieces > plain.stats.pieces
    assert shape(graph) == shape(plain)
