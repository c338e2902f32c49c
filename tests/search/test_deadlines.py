"""Time limits are kept in every phase, by a clock that counts pieces of work instead of seconds."""

import inspect
import signal
import threading
import time
from itertools import count

import clarabel
import numpy as np
import pytest
import scipy.sparse as sp
from complete import accepted_report, all_roots
from cut_short import false_claims_of_graph
from graph_proofs import triangle
from interruptions import CtrlC

from enumsol import ContactProblem, branch_graph, enumerate_roots, gallery, verify
from enumsol.branches import gluing
from enumsol.branches.enclosed.tracing import _Tracing
from enumsol.branches.known_selections import KnownSelections
from enumsol.condensation.factorization import Factorization
from enumsol.relaxation.convex_forms import FormAscent
from enumsol.search import nodes as forms
from enumsol.search.solvers import Solvers
from enumsol.search.space.space_fathoming import DefiniteForm
from enumsol.search.subintervals import IntervalSearch
from enumsol.selections.rational_selections import ExactSelections
from enumsol.support.conic import conic_answer
from enumsol.support.deadlines import Deadline, TimeOverError, attended, current, look, over, within


@pytest.fixture
def clock(monkeypatch):
    """The time, which passes only where a test says so."""
    now = [0.0]
    monkeypatch.setattr("time.perf_counter", lambda: now[0])
    return now


@pytest.fixture
def takes(clock, monkeypatch):
    """Has every call of a function take so many seconds."""

    def slow(owner, name, seconds=1.0):
        before = getattr(owner, name)

        def call(*args, **options):
            clock[0] += seconds
            return before(*args, **options)

        static = isinstance(inspect.getattr_static(owner, name), staticmethod)
        monkeypatch.setattr(owner, name, staticmethod(call) if static else call)

    return slow


def kept(limit):
    """What a limit promises."""
    return 1.2 * limit + 2.0


def cut(clock, call, *arguments, time_limit):
    """The result of a call that ends as its limit promises, before it is complete."""
    found = call(*arguments, time_limit=time_limit)
    assert clock[0] <= kept(time_limit)
    assert not found.complete
    return found


def uncoupled(p, load=(1.0, -2.0)):
    """Nodes that do not feel each other, each with a continuum of solutions at alpha = 2."""
    A, rows = np.kron(np.eye(p), [[2.0, -1.0], [-1.0, 2.0]]), np.eye(2 * p)
    return ContactProblem(A, rows[0::2], rows[1::2], np.tile(load, p))


# -- the clock ---------------------------------------------------------------------------------------------------------


def test_a_deadline_holds_where_it_was_set_and_nowhere_else(clock):
    look()
    with within(Deadline(5.0)):
        look()
        assert current() == 5.0
        clock[0] = 6.0
        assert over()
        with pytest.raises(TimeOverError):
            look()
        with within(Deadline()):
            look()
        seen = []
        thread = threading.Thread(target=lambda: seen.append(current()))
        thread.start()
        thread.join()
        assert seen == [None]
    look()
    assert current() is None


def test_a_deadline_may_move_while_it_holds(clock):
    limits = Deadline(5.0)
    with within(limits):
        clock[0] = 6.0
        limits.deadline = 7.0
        look()


@pytest.mark.parametrize("limit", [0.5, 1.0, 60.0, 3600.0])
def test_what_is_added_to_a_limit_is_less_than_what_is_promised(clock, limit):
    assert Deadline.after(3.0, None).extended(3.0).deadline is None
    last = Deadline.after(3.0, limit).extended(3.0)
    assert 3.0 + limit < last.deadline < 3.0 + kept(limit)
    clock[0] = 3.0
    assert last.part(0.5).deadline == pytest.approx((3.0 + last.deadline) / 2)


# -- one long call -----------------------------------------------------------------------------------------------------

LONG = 10**6


@pytest.fixture
def endless():
    """A call that ends when the test does."""
    ended = threading.Event()
    yield ended.wait
    ended.set()


def test_what_a_long_call_returns_or_raises():
    assert attended(current, LONG, "work") is None
    with within(Deadline(5.0)):
        assert attended(current, LONG, "work") == 5.0
    with pytest.raises(ZeroDivisionError):
        attended(lambda: 1 // 0, LONG, "work")


def test_a_long_call_is_not_waited_for_beyond_the_limit(clock, endless):
    def work():
        clock[0] = 6.0
        endless()

    with within(Deadline(5.0)), pytest.raises(TimeOverError):
        attended(work, LONG, "work")


def test_a_long_call_ends_at_once_on_ctrl_c(endless):
    def work():
        signal.raise_signal(signal.SIGINT)
        endless()

    with pytest.raises(KeyboardInterrupt):
        attended(work, LONG, "work")


@pytest.mark.parametrize("build", [lambda: gallery.clamped_block(8, 4), lambda: gallery.block3d(2, 2, 2)])
def test_a_body_that_is_not_condensed_in_time(clock, takes, monkeypatch, tmp_path, build):
    monkeypatch.setattr(Factorization, "columns", 1)
    takes(Factorization, "solve")
    problem = build()
    roots = enumerate_roots(problem, 0, time_limit=4.0, proof_path=tmp_path / "p")
    assert clock[0] <= kept(4.0)
    assert (len(roots), roots.complete, roots.unique, roots.proof) == (0, False, None, None)
    assert "0 roots found (verified, tree)\nundecided: the time was over before the body was" in str(roots)
    assert not any(tmp_path.iterdir())
    assert enumerate_roots(problem, 0, time_limit=1000.0).complete


@pytest.mark.parametrize("arithmetic", ["verified", "fast"])
def test_a_body_that_is_not_condensed_in_time_has_a_graph_of_nothing(clock, takes, monkeypatch, arithmetic):
    monkeypatch.setattr(Factorization, "columns", 1)
    takes(Factorization, "solve")
    problem = gallery.clamped_block(8, 4)
    graph = branch_graph(problem, (0, 1), arithmetic, time_limit=4.0)
    assert clock[0] <= kept(4.0)
    assert (len(graph.arcs), len(graph.vertices), graph.complete, graph.proof) == (0, 0, False, None)
    assert "complete: no (stopped by the time limit before the body was condensed" in str(graph)
    assert list(false_claims_of_graph(graph, branch_graph(problem, (0, 1), arithmetic))) == []


# -- roots -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("arithmetic", ["verified", "exact"])
@pytest.mark.parametrize("limit", [10, 30, 100, 300])
def test_many_solutions_at_one_alpha(clock, takes, arithmetic, limit):
    """Every elimination takes a second: in the leaves of the tree, and where their solutions are joined."""
    takes(ExactSelections, "row_reduced")
    takes(ExactSelections, "solve_equations")
    roots = cut(clock, enumerate_roots, uncoupled(4), 2, arithmetic, time_limit=limit)
    assert "time limit" in str(roots)
    assert roots.at_least <= 1  # it is one continuum
    if roots.proof is not None:
        assert verify(uncoupled(4), roots.proof).ok


def test_what_was_not_joined_in_time_is_listed(clock, takes):
    """The search ends in time, and then it takes too long to find which solutions are connected."""
    problem = uncoupled(3)
    assert len(all_roots(problem, 2, "exact").families) == 1
    takes(ExactSelections, "active", 40.0)
    roots = enumerate_roots(problem, 2, "exact", time_limit=100.0)
    assert roots.undecided
    assert not roots.complete
    assert "time limit" in roots.stopped
    assert roots.at_least <= 1


def test_a_form_is_not_sought_beyond_the_limit(clock, takes, tree_only, monkeypatch):
    monkeypatch.setattr(forms, "FORM_AFTER", 0)
    takes(FormAscent, "_candidate")
    problem = gallery.clamped_block(12, 6)
    accepted_report(problem, cut(clock, enumerate_roots, problem, 0.3, time_limit=4.0).proof)


def test_the_time_runs_from_the_beginning_of_the_call(clock, takes):
    takes(Solvers, "__init__", 7.0)
    roots = enumerate_roots(triangle(), 5.0, time_limit=5.0)
    assert roots.stats.nodes == 0
    assert roots.stats.seconds >= 7.0
    assert "time limit" in roots.stopped


@pytest.mark.parametrize("arithmetic", ["fast", "exact"])
def test_the_exhaustive_method(clock, takes, arithmetic):
    solver = Solvers(uncoupled(4), 2.0, arithmetic, 1e-9)
    takes(type(solver.exact if arithmetic == "exact" else solver.floats), "solve")
    takes(ExactSelections, "row_reduced")
    roots = cut(clock, enumerate_roots, uncoupled(4), 2, arithmetic, "exhaustive", time_limit=20)
    assert "time limit" in roots.stopped


# -- graphs ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("limit", [5, 20, 60])
def test_arcs_by_exact_algebra(clock, takes, limit):
    takes(KnownSelections, "add")
    graph = cut(clock, branch_graph, gallery.chain(4), (0, 10), time_limit=limit)
    assert graph.arcs
    (reason,) = graph.reasons
    assert reason.startswith("stopped by the time limit after the arcs of ")
    assert graph.proof is None


@pytest.mark.parametrize("name", ["active_at", "members"])
def test_arcs_that_are_joined(clock, takes, name):
    """Joining takes longer than anything before: what is left is open, and what is said is true."""
    takes(KnownSelections, name)
    problem, whole = gallery.chain(3), branch_graph(gallery.chain(3), (0, 10))
    clock[0] = 0.0
    graph = cut(clock, branch_graph, problem, (0, 10), time_limit=20.0)
    for alpha in (1.0, 2.0, 3.0, 4.5, 7.0, 10.0):
        assert graph.at_least(alpha) <= whole.multiplicity_at(alpha)
    settled = {(v.alpha, v.kind) for v in graph.vertices if v.kind != "unsettled"}
    assert settled <= {(v.alpha, v.kind) for v in whole.vertices}


@pytest.mark.parametrize("name", ["solve", "active"])
def test_continua_and_grazing_arcs(clock, takes, name):
    takes(ExactSelections, name)
    graph = cut(clock, branch_graph, uncoupled(3), (0, 4), time_limit=30.0)
    assert all(v.kind == "unsettled" for v in graph.vertices if v.alpha == 2.0)


@pytest.mark.parametrize("limit", [10, 40])
def test_arcs_in_balls(clock, takes, limit):
    problem = gallery.get("wedge-8-5").build()
    whole = branch_graph(problem, (0, 3))
    assert whole.arcs_by == "balls"
    takes(_Tracing, "_box")
    graph = cut(clock, branch_graph, problem, (0, 3), time_limit=limit)
    assert clock[0] < 60
    assert graph.reasons[0].startswith("stopped by the time limit after the arcs of ")
    assert all(graph.at_least(alpha) <= whole.multiplicity_at(alpha) for alpha in (0.5, 1.5, 2.2, 3.0))


def test_no_exact_algebra_is_begun_after_the_limit(clock, takes, monkeypatch):
    """The search takes the whole time."""
    problem = gallery.get("wedge-8-5").build()
    takes(IntervalSearch, "run", 100.0)
    monkeypatch.setattr(gluing, "glue", None)
    graph = branch_graph(problem, (0, 3), time_limit=10.0)
    assert "time limit" in graph.reasons[0]


@pytest.mark.few(1, 1)
@pytest.mark.parametrize("name", ["chain", "continua", "corners", "balls"])
def test_wherever_the_time_is_over_nothing_false_is_claimed(name, monkeypatch):
    """Every look at the clock takes a second."""
    problem, interval = {
        "chain": lambda: (gallery.chain(2, 0.1), (0, 10)),
        "continua": lambda: (uncoupled(2), (0, 4)),
        "corners": lambda: (uncoupled(2, (1.5, -4.0)), (0, 5)),
        "balls": lambda: (gallery.wedge(2, 3, (0, 5e-4), half_angle=5.0), (0, 1)),
    }[name]()
    whole, ticks, ended = branch_graph(problem, interval), count(), set()
    assert whole.complete
    for limit in np.unique(np.geomspace(1, 2000, 8).astype(int)).tolist():
        with monkeypatch.context() as patch:
            patch.setattr("time.perf_counter", lambda: float(next(ticks)))
            graph = branch_graph(problem, interval, time_limit=limit)
        ended.add(graph.complete)
        assert list(false_claims_of_graph(graph, whole)) == [], limit
    assert ended == {True, False}


class Endless:
    """A program of Clarabel's that goes on until it is asked to end."""

    ended = threading.Event()

    def __init__(self, *_):
        self.asked = None

    def set_termination_callback(self, asked):
        self.asked = asked

    def solve(self):
        while not self.asked(None):
            time.sleep(0.001)
        self.ended.set()


@pytest.mark.parametrize("error", [TimeOverError, KeyboardInterrupt])
def test_a_conic_program_is_left_at_once_and_ends_with_its_iteration(monkeypatch, error):
    monkeypatch.setattr(clarabel, "DefaultSolver", Endless)
    monkeypatch.setattr("enumsol.support.deadlines.look", CtrlC(then=None) if error is KeyboardInterrupt else look)
    Endless.ended.clear()
    empty = sp.csc_matrix((1, 1))
    with within(Deadline(0.0)), pytest.raises(error):
        conic_answer((empty, np.zeros(1)), (empty, np.zeros(1)), [], 10**9)
    assert Endless.ended.wait(60)


def test_a_conic_program_is_solved_in_a_thread_as_it_is_without_one():
    def answer(size):
        limits = sp.csc_matrix([[1.0, 1.0], [-1.0, 0.0]]), np.array([1.0, 0.0])
        objective = sp.identity(2, format="csc"), np.array([-1.0, -3.0])
        return conic_answer(objective, limits, [clarabel.NonnegativeConeT(2)], size, max_iter=50)

    small, large = answer(1), answer(10**9)
    assert small.x == large.x == pytest.approx([0.0, 1.0], abs=1e-6)


def test_better_numbers_for_one_certificate_in_3d_are_sought_while_there_is_time(clock, takes):
    takes(DefiniteForm, "_gradient")
    cut(clock, enumerate_roots, gallery.block3d(3, 3, 2, friction=5.0), 0, time_limit=3.0)
    assert clock[0] > 3.0
