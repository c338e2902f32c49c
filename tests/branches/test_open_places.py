"""What a graph leaves open is told with the reason and with a remedy, and the remedy helps."""

import re

import numpy as np
import pytest
from branches.test_degenerate import pair
from path_problems import generic_problem

from enumsol import ContactProblem, branch_graph, enumerate_roots, gallery
from enumsol.branches import ways
from enumsol.branches.enclosed import following, tracing
from enumsol.errors import IncompleteGraphError


def large_pitchfork(n=256):
    """A pitchfork of two nodes, and degrees of freedom that nothing touches."""
    small = pair(0.0)
    A, rows = np.eye(n), np.zeros((2, 2, n))
    A[:4, :4], rows[0, :, :4], rows[1, :, :4] = small.A.toarray(), small.Bn.toarray(), small.Bt.toarray()
    load = np.append(small.f, np.zeros(n - 4))
    return ContactProblem(A, *rows, load, friction=small.friction, node_ids=["left", "right"])


@pytest.mark.slow
def test_a_large_body_is_decided_at_its_contact_nodes():
    problem = large_pitchfork()
    graph = branch_graph(problem, (2.5, 3.5))
    (reason,) = graph.reasons
    assert "conditions of contact nodes left and right vanish there" in reason or "several contact nodes" in reason
    assert "problem.at_contact_nodes()" in reason
    assert graph.completeness() == f"complete: no ({reason})"
    with pytest.raises(IncompleteGraphError, match=re.escape(reason)):
        graph.multiplicity_at(3.25)
    small = branch_graph(problem.at_contact_nodes(), (2.5, 3.5))
    assert small.complete
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
