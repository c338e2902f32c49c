"""Long calls tell what they are at, how far, and of how much; what a listener raises ends them at once."""

import numpy as np
import pytest
from interruptions import CtrlC, interrupted

import enumsol
from enumsol import ContactProblem, gallery
from enumsol.condensation.exact import ExactSystem
from enumsol.support.deadlines import heard_by, tell, tell_part
from enumsol.trusted.arcs.precise import PreciseSystem


def told_by(work):
    """What is told, in order: for every kind of work its (done, of)."""
    said = {}
    with heard_by(lambda name, done, of: said.setdefault(name, []).append((done, of))):
        work()
    return said


def closed_gap(n=30):
    """A body that touches without load: a degenerate root, which only rationals decide."""
    A = np.diag(np.arange(1.0, n + 1)) + 0.1
    return ContactProblem(A, np.eye(n)[:1], np.eye(n)[1:2], A @ np.eye(n)[1], friction=(0.5, 0.0))


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
    bits = told_by(lambda: PreciseSystem.of(problem))["bits of A^-1 B'"]
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
