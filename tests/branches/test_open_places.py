"""What a graph leaves open is told with the reason and with a remedy, and the remedy helps."""

import re
from fractions import Fraction
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from branches.test_degenerate import pair
from branches.test_lower_bounds import padded
from complete import whole_graph
from path_problems import generic_problem
from problems3d import SLIDING, OneNode
from refusals import refusal

from enumsol import ContactProblem, branch_graph, enumerate_roots, gallery
from enumsol.arithmetic.rationals import rational
from enumsol.branches import known_selections, ways
from enumsol.branches.elements import DEFECT, named
from enumsol.branches.enclosed import following, tracing
from enumsol.branches.enclosed.cutting import AlphaBox, ArcPart, ArcPartKind, Trace
from enumsol.branches.enclosed.joining import join
from enumsol.branches.gluing import glue
from enumsol.branches.known_selections import KnownSelections
from enumsol.branches.space import space_graph as cover
from enumsol.condensation.exact import ExactCondensed
from enumsol.errors import IncompleteGraphError
from enumsol.model.statuses import OPEN, SLIP_PLUS, STATUSES
from enumsol.selections.solution import VertexLimitError


@pytest.mark.parametrize("kinds", ["hn", "nh", "he", "ne"])
def test_an_arc_without_an_end_names_its_statuses(kinds):
    codes = (OPEN, OPEN, SLIP_PLUS)
    rows = SimpleNamespace(codes=codes, conditions=[(0, 4), (2, 0)])
    parts = [
        ArcPart(ArcPartKind(kind), low, low + 0.5, condition=0, zero=(low + 0.2, low + 0.3), rising=kinds[0] == "h")
        for kind, low in zip(kinds, (0.0, 0.5), strict=True)
    ]
    trace = Trace(SimpleNamespace(rows=rows), 0.0, 1.0, boxes=[AlphaBox(0.0, 1.0, tuple(parts))])
    joined = join([trace], (Fraction(0), Fraction(1)), None, lambda *_: None)
    (reason,) = [text for text in joined.reasons if "no event" in text]
    assert reason == f"the selection 2 open, 1 slip+ begins or ends at no event near alpha = 0.5; {DEFECT}"


@pytest.mark.slow
def test_a_large_body_is_decided_at_its_contact_nodes():
    problem = padded(pair(0.0), 256).replace(node_ids=["left", "right"])
    graph = branch_graph(problem, (2.5, 3.5))
    (reason,) = graph.reasons
    assert "conditions of contact nodes left and right vanish there" in reason or "several contact nodes" in reason
    assert "problem.at_contact_nodes()" in reason
    assert graph.closing_line == f"complete: no ({reason})"
    refusal(IncompleteGraphError, re.escape(reason), graph.multiplicity_at, 3.25)
    small = whole_graph(problem.at_contact_nodes(), (2.5, 3.5))
    assert {small.multiplicity_at(alpha) for alpha in (2.75, 3.25)} == {3, 5}
    assert graph.at_least(3.25) <= small.multiplicity_at(3.25)


def test_at_contact_nodes_is_the_same_body():
    problem = gallery.dovetail()
    problem = problem.replace(
        gap=1e-4 * np.arange(problem.p) / problem.p, slip_offset=np.linspace(-1e-3, 1e-3, problem.p)
    )
    small = problem.at_contact_nodes()
    assert (small.n, small.p, small.node_ids) == (2 * problem.p, problem.p, problem.node_ids)
    for ours, theirs in zip(enumerate_roots(small, 0.2), enumerate_roots(problem, 0.2), strict=True):
        assert ours.statuses == theirs.statuses
        np.testing.assert_allclose(ours.lambda_n, theirs.lambda_n, rtol=1e-9, atol=1e-9 * np.max(theirs.lambda_n))


@pytest.fixture
def by_balls_alone(monkeypatch):
    """Nothing is left to exact algebra."""
    monkeypatch.setattr(ways, "FAST_EXACT_DOF", 0)
    monkeypatch.setattr(ways, "LARGEST_EXACT_WORK", 0)


@pytest.mark.usefixtures("by_balls_alone")
def test_where_boxes_were_used_up_a_short_interval_decides(monkeypatch):
    monkeypatch.setattr(following, "EXACT_DOF_LIMIT", 0)  # as if the body were large
    problem = generic_problem(np.random.default_rng(3), 2, "friction")
    monkeypatch.setattr(tracing, "_MOST_BOXES", 2)
    graph = branch_graph(problem, (0.0, 6.0))
    reason = graph.reasons[0]
    assert "one of them was cut into as many boxes as are tried; a graph over a short interval" in reason
    low, high = (float(end) for end in re.search(r"\[(.*), (.*)\] is", reason).groups())
    middle = 0.5 * (low + high)
    assert branch_graph(problem, (middle, middle + 2.0**-10 * (high - low))).complete


@pytest.mark.usefixtures("by_balls_alone")
def test_exact_arithmetic_decides_what_balls_cannot():
    graph = branch_graph(pair(0.0), (2.9, 3.1))
    assert not graph.complete
    assert all(reason.endswith('; arithmetic="exact" decides it, which may take long') for reason in graph.reasons)
    assert branch_graph(pair(0.0), (2.9, 3.1), "exact").complete


@pytest.mark.usefixtures("by_balls_alone")
@pytest.mark.few(0)
@pytest.mark.parametrize(("interval", "elsewhere"), [((2.5, 3.0), (2.5, 2.9)), ((3.0, 3.5), (3.1, 3.5))])
def test_an_event_at_an_end_is_told_by_another_end(interval, elsewhere):
    problem = gallery.two_node_square()  # a fold at 3
    graph = branch_graph(problem, interval)
    assert all("an interval that ends elsewhere decides it" in reason for reason in graph.reasons)
    assert branch_graph(problem, elsewhere).complete


def test_a_continuum_with_too_many_vertices_is_named_with_its_statuses(monkeypatch):
    problem = ContactProblem(np.eye(2), [[1.0, 0.0]], [[0.0, 1.0]], [1.0, 1.0], load_slope=[0.0, 1.0])
    known = KnownSelections(ExactCondensed.from_problem(problem), rational(0), rational(1), cut_short=False)
    monkeypatch.setattr(known_selections, "selection_arcs", _refused)
    known.add((3,))
    (reason,) = known.reasons
    assert reason == "the selection slip-: as many as that; data that differ by a little may leave fewer"


def _refused(*_):
    raise VertexLimitError("as many as that")


def states(codes):
    return [STATUSES[code] for code in codes]


def test_what_contradicts_a_search_is_told_as_a_defect():
    problem = gallery.two_node_square()
    graph = whole_graph(problem, (0.0, 10.0), "exact")
    exact = ExactCondensed.from_problem(problem)
    held = {codes for arc in graph.arcs for codes in arc.selections}
    inner = [vertex for vertex in graph.vertices if not vertex.border]
    joined = {
        codes for codes in held if any(all(s in a for s, a in zip(states(codes), v.active, strict=True)) for v in inner)
    }
    assert joined
    for left_out in sorted(joined):
        known = KnownSelections(exact, rational(0), rational(10), cut_short=False)
        glue(known, held - {left_out})
        text = named(left_out)
        assert any(text in reason and reason.endswith("please report it") for reason in known.reasons), left_out
    assert named((0, 1)) == "the selection 1 open, 1 stick"


@pytest.fixture
def gap_in_space(monkeypatch):
    """The reason that a graph in 3D gives for its only gap after a change of the search; it is complete otherwise."""

    def told(name, value, problem, ends):
        monkeypatch.setattr(cover, name, value)
        graph = branch_graph(problem, ends, max_nodes=60)
        assert not graph.complete
        (reason,) = graph.reasons
        low, high = (float(end) for end in re.search(r"\[(.*), (.*)\]: ", reason).groups())
        assert ends[0] <= low < high <= ends[1]
        return reason

    return told


def test_a_curve_in_space_that_is_not_whole_is_told(gap_in_space):
    reason = gap_in_space("chain_through", lambda *_: None, SLIDING, (1.78, 1.82))
    assert ": no curve through a solution there was proven; another interval, or data" in reason


@pytest.mark.slow
def test_a_piece_in_space_that_is_too_short_is_told(gap_in_space):
    whole = partial(cover.PieceTree, smallest=1.0)
    reason = gap_in_space("PieceTree", whole, OneNode(3, load=True).problem, (-0.5, 0.5))
    assert ": pieces of alpha as short as are tried left statuses undecided; a graph over a short interval" in reason
