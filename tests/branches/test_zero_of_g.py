"""A branch graph whose load g vanishes exactly inside its interval has a proof, and the checker accepts it."""

from fractions import Fraction

import numpy as np
import pytest
from complete import accepted_report
from generators import vanishing_problem
from oracles import exact_condense
from proof_tools import records_of

from enumsol import ContactProblem, branch_graph, verify
from enumsol.branches.enclosed import tracing
from enumsol.condensation.unloaded import vanishing_alpha

INTERVAL = (0.0, 10.0)
ZEROS = [Fraction(0), Fraction(10), Fraction(4), Fraction(1, 3), Fraction(22, 7), Fraction(-3), Fraction(5, 2)]


@pytest.fixture(autouse=True)
def few_boxes(monkeypatch):
    """What stays open beside the zero stays so for any number of boxes, and takes most of the time."""
    monkeypatch.setattr(tracing, "_MOST_BOXES", 20)


def assert_proven(problem, interval=INTERVAL):
    """The graph is complete, has a proof, and the checker accepts it."""
    graph = branch_graph(problem, interval)
    assert "complete: yes (proven" in repr(graph)
    return graph, accepted_report(problem, graph.proof)


def ends_of_pieces(graph):
    pieces = [record["piece"] for record in records_of(graph.proof)[1:-1] if "piece" in record]
    return {Fraction(end) for piece in pieces for end in piece}


@pytest.mark.long
def test_the_example_of_the_report():
    A = [[3, 1, -1], [1, 3, 1], [-1, 1, 3]]
    data = {"slip_offset": 1.0, "friction": 0.0, "load_slope": [1, 1, -1]}
    problem = ContactProblem(A, [[1, 0, 0]], [[0, 1, 0]], [0, -4, -4], **data)
    graph, report = assert_proven(problem)
    assert ends_of_pieces(graph) == {0, 4, 10}
    assert (report.pieces, report.data) == (2, "problem")


@pytest.mark.few(0, 3)
@pytest.mark.parametrize("zero", ZEROS, ids=str)
@pytest.mark.parametrize(("friction", "friction_slope"), [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)])
@pytest.mark.parametrize("p", [1, 2])
def test_g_vanishes_by_load_and_offsets_together(p, zero, friction, friction_slope):
    rng = np.random.default_rng([4, p, zero.numerator + 3, zero.denominator])
    for inner in (0, 2):
        problem = vanishing_problem(rng, p, zero, inner=inner, friction=friction, friction_slope=friction_slope)
        graph, _ = assert_proven(problem)
        assert (zero in ends_of_pieces(graph)) == (0 <= zero <= 10)


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("zero", ZEROS, ids=str)
def test_g_that_almost_vanishes(zero):
    rng = np.random.default_rng([5, zero.numerator + 3, zero.denominator])
    for p in (1, 2):
        exact = vanishing_problem(rng, p, zero, friction=1.0)
        problem = exact.replace(f=[np.nextafter(exact.f[0], np.inf), *exact.f[1:]])
        assert_proven(problem)
        assert vanishing_alpha(problem, "problem") != zero


@pytest.mark.parametrize("zero", [Fraction(0), Fraction(4), Fraction(1, 3)], ids=str)
def test_data_beyond_exact_graphs(zero):
    # beyond 24 degrees of freedom arcs are followed in balls, for the g of the data as given
    rng = np.random.default_rng([6, zero.numerator, zero.denominator])
    for p in (1, 2):
        problem = vanishing_problem(rng, p, zero, inner=25 - 2 * p, friction=0.5)
        graph, report = assert_proven(problem)
        assert report.data == "problem"
        assert vanishing_alpha(problem, "problem") == zero
        assert zero in ends_of_pieces(graph)


def test_the_zero_is_that_of_an_independent_condensation():
    rng = np.random.default_rng(7)
    for zero in ZEROS:
        problem = vanishing_problem(rng, 2, zero, inner=1)
        assert vanishing_alpha(problem, "problem") == zero
        assert not any(exact_condense(problem, zero)[1])
        assert any(exact_condense(problem, zero + 1)[1])
    constant = ContactProblem(np.eye(2), [[1, 0]], [[0, 1]], [1.0, 2.0])
    always = ContactProblem(np.eye(3), [[1, 0, 0]], [[0, 1, 0]], [0, 0, 1.0], load_slope=[0, 0, 1.0])
    never = ContactProblem(np.eye(2), [[1, 0]], [[0, 1]], [1.0, 2.0], load_slope=[0.0, 1.0])
    for problem in (constant, always, never):
        assert vanishing_alpha(problem, "problem") is None
        assert vanishing_alpha(problem, "condensed") is None


def test_search_and_checker_ask_one_place(monkeypatch):
    # told of another alpha, both cut there: neither decides anew
    from enumsol.checker import graph_checker
    from enumsol.condensation import exact as path

    problem = ContactProblem(np.eye(2), [[1, 0]], [[0, 1]], [1.0, 2.0], load_slope=[1.0, 1.0], friction=1.0)
    graph, report = assert_proven(problem)
    assert report.pieces == 1
    for module in (path, graph_checker):
        monkeypatch.setattr(module, "vanishing_alpha", lambda problem, data: Fraction(5, 7))
    assert Fraction(5, 7) in ends_of_pieces(branch_graph(problem, INTERVAL))
    assert "is not the next one" in verify(problem, graph.proof).failures[0]
