"""Long calls tell what they are at, how far, and of how much; what a listener raises ends them at once."""

import numpy as np
import pytest
from interruptions import CtrlC, interrupted
from problems3d import SLIDING

import enumsol
from enumsol import ContactProblem, gallery
from enumsol.condensation.exact import ExactSystem
from enumsol.support.deadlines import heard_by, tell, tell_part
from enumsol.support.messages import counted, shortened
from enumsol.trusted.arcs.precise import system_in_many_digits


def told_by(work):
    """What is told, in order: for every kind of work its (done, of)."""
    said = {}
    with heard_by(lambda name, done, of: said.setdefault(name, []).append((done, of))):
        work()
    return said


def closed_gap(n=30):
    """A body that touches without load: a degenerate root, which only rationals decide."""
    A = np.diag(np.arange(1.0, n + 1)) + 0.1
    return ContactProblem(A, np.eye(n)[:1], np.eye(n)[1:2], A @ np.eye(n)[1], friction=0.5)


def test_who_listens_hears_and_who_does_not_is_left_alone():
    tell("work", 1, 2)
    assert tell_part("of it") is None
    inner = []

    def parts():
        with heard_by(tell_part("of search 3")):
            tell("leaves", 1, 2)
        with heard_by(inner.append):
            pass
        with heard_by(None):
            tell("leaves", 2, 2)

    assert told_by(parts) == {"leaves of search 3": [(1, 2)]}


def test_condensing_tells_every_few_columns():
    problem = gallery.wedge(4, 4)
    columns = told_by(lambda: ExactSystem.from_problem(problem, 1))["columns of A^-1 B' in rationals"]
    assert columns == [(k, 2 * problem.p + 2) for k in range(0, 2 * problem.p + 2, 4)]
    bits = told_by(lambda: system_in_many_digits(problem))["bits of A^-1 B'"]
    assert len(bits) > 2
    assert bits == sorted(bits)
    assert "columns of A^-1 B'" in told_by(lambda: gallery.wedge(3, 3).enclosure)


def test_checkers_tell_leaves_the_interval_and_selections(monkeypatch):
    monkeypatch.setattr("enumsol.checker.walk._REPORT_EVERY", 1)
    square = gallery.two_node_square()
    proof = enumsol.enumerate_roots(square, 3.5).proof
    count = enumsol.verify(square, proof).leaves
    assert told_by(lambda: enumsol.verify(square, proof))["leaves"] == [(k, count) for k in range(1, count + 1)]
    proof = enumsol.branch_graph(square, (0.0, 10.0)).proof
    said = told_by(lambda: enumsol.verify(square, proof))
    for name in ("per cent of the interval", "selections followed"):
        assert said[name] == sorted(said[name])
        assert all(done <= of for done, of in said[name])


def test_a_graph_in_3d_tells_how_far_it_follows_a_curve():
    said = told_by(lambda: enumsol.branch_graph(SLIDING, (1.79, 1.795)))
    for name in ("steps along a curve", "boxes of a curve cut into arcs"):
        assert said[name] == sorted(said[name])
        assert said[name][0][0] == 0
        assert all(done < of == said[name][0][1] for done, of in said[name])
    with heard_by(CtrlC(lambda name, done, of: name == "steps along a curve")):
        partial = interrupted("interrupted", enumsol.branch_graph, SLIDING, (1.79, 1.795))
    # the first node was not finished
    assert (partial.stats.nodes, partial.complete) == (0, False)
    assert partial.open_ranges


def test_ctrl_c_in_the_middle_of_a_selection_in_rationals_keeps_what_was_found():
    problem = closed_gap()
    assert any(not root.regular for root in enumsol.enumerate_roots(problem, 0.0))
    with heard_by(CtrlC(lambda name, done, of: name == "a selection in rationals")):
        assert not interrupted("interrupted", enumsol.enumerate_roots, problem, 0.0).complete


def test_ctrl_c_ends_condensing_between_two_groups_of_columns():
    seen = []

    def stop(name, done, of):
        seen.append(done)
        if done:
            raise KeyboardInterrupt

    with heard_by(stop), pytest.raises(KeyboardInterrupt):
        ExactSystem.from_problem(gallery.wedge(4, 4), 1)
    assert seen == [0, 4]


# -- words in messages -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("number", "words", "text"),
    [
        (0, ("root",), "0 roots"),
        (1, ("root",), "1 root"),
        (2, ("vertex", "vertices"), "2 vertices"),
        (1, ("leaf covers", "leaves cover"), "1 leaf covers"),
    ],
)
def test_a_number_and_its_noun(number, words, text):
    assert counted(number, *words) == text


def test_printed_results_count_one_of_a_kind():
    problem = enumsol.gallery.one_node_triangle()
    graph = enumsol.branch_graph(problem, (0, 10))
    assert "path, 1 arc, alpha" in repr(graph)
    path = enumsol.follow(problem, graph.starting_points()[1], -1, interval=(0, 10))
    assert [line for line in repr(path).splitlines() if line.endswith("of them 1 fold")]
    assert "1 arcs" not in repr(graph)


def test_texts_of_other_packages_are_one_short_line():
    assert shortened("a\n  b") == "a b"
    long = shortened("x" * 5000)
    assert len(long) == 200
    assert long.endswith("x...")
