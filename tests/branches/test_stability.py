"""Which arcs run away: verdicts of graphs, and that what follows shows them."""

import time

import numpy as np
import pytest

import enumsol
from enumsol.support.deadlines import Deadline, TimeOverError, within

QUIET, AWAY = "does not run away", "runs away"


@pytest.fixture
def triangle():
    return enumsol.branch_graph(enumsol.gallery.one_node_triangle(), (0, 3))


@pytest.fixture
def square():
    return enumsol.branch_graph(enumsol.gallery.two_node_square(), (0, 10))


def test_verdicts_of_arcs_are_those_of_their_roots(square):
    found = square.stability()
    assert len(found) == len(square.arcs)
    for arc, spans in zip(square.arcs, found, strict=True):
        assert (spans[0].low, spans[-1].high) == (arc.lo, arc.hi)
        assert all(a.high == b.low for a, b in zip(spans, spans[1:], strict=False))
    alpha = 3.5
    roots = square.roots_at(alpha)
    by_statuses = {
        arc.statuses: span.verdict
        for arc, spans in zip(square.arcs, found, strict=True)
        for span in spans
        if span.low <= alpha <= span.high
    }
    assert {root.statuses: one.verdict for root, one in zip(roots, roots.stability(), strict=True)} == by_statuses
    assert sorted(by_statuses.values()) == [QUIET] * 2 + [AWAY] * 3


def test_a_mass_that_is_given_counts_and_stays(triangle):
    assert triangle.verdicts is None
    once = triangle.stability(mass=np.eye(2))
    assert triangle.verdicts is not None
    assert triangle.stability() == once == triangle.verdicts
    assert [spans[0].verdict for spans in once] == [QUIET, QUIET, AWAY]
    assert once[2][0].growth[0] < once[2][0].growth[1]


def test_what_is_cut_short_goes_on(square):
    with within(Deadline(time.perf_counter() - 1)), pytest.raises(TimeOverError):
        square.stability()
    assert square.verdicts is None
    with pytest.raises(enumsol.InvalidProblemError):
        square.stability(mass=-np.eye(square.problem.n))
    found = square.stability()
    square._found["verdicts"] = [*found[:2]]  # as if it had been cut short there
    assert square.verdicts is None
    assert square.stability() == found


def test_no_mass_and_3d_are_refused():
    problem = enumsol.ContactProblem(np.eye(2), [[1, 0]], [[0, 1]], [1, 2], friction=0.5)
    graph = enumsol.branch_graph(problem, (0, 1))
    with pytest.raises(enumsol.InvalidArgumentError, match="no mass and no mesh; expected mass"):
        graph.stability()
    space = enumsol.branch_graph(enumsol.gallery.one_node_3d(), (0, 1))
    with pytest.raises(enumsol.InvalidArgumentError, match=r"roots_at\(alpha\)\.stability\(\)"):
        space.stability()
