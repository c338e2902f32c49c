"""Graphs searched by executors, cut short, and with a lost worker: the search without workers is the judge."""

import os
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor

import pytest
from complete import whole_graph
from dying import DyingExecutor
from interruptions import CtrlC, interrupted
from proof_tools import bytes_of
from refusals import bad_argument

import enumsol
from enumsol import branch_graph, gallery, verify
from enumsol.search import subintervals as interval_search


def through_zero():
    """A load that vanishes inside the interval, which is cut there."""
    w = gallery.wedge(4, 4)
    return enumsol.ContactProblem(w.A, w.Bn, w.Bt, 0 * w.f, friction=0.8, load_slope=w.f), (-1, 2)


PROBLEMS = {
    "friction": lambda: (gallery.get("wedge-8-5").build(), (0, 5)),
    "load": through_zero,
    "exact data": lambda: (gallery.get("chain-2").build(), (0, 8)),
}


@pytest.fixture(scope="module")
def executors():
    with ProcessPoolExecutor(1) as one, ProcessPoolExecutor(2) as two, ThreadPoolExecutor(3) as threads:
        yield one, two, threads


@pytest.fixture(scope="module")
def wedge():
    problem = gallery.get("wedge-8-5").build()
    return problem, branch_graph(problem, (0, 5), "fast")


def shape(graph):
    vertices = [(v.kind, v.alpha, v.selections) for v in graph.vertices]
    return vertices, [(arc.tail, arc.head, arc.selections) for arc in graph.arcs]


@pytest.mark.slow
@pytest.mark.parametrize("name", PROBLEMS)
def test_the_same_graph_and_proof_as_without_workers(name, executors):
    problem, interval = PROBLEMS[name]()
    alone = whole_graph(problem, interval)
    assert verify(problem, alone.proof).ok
    for executor in executors:
        graph = whole_graph(problem, interval, executor=executor)
        assert bytes_of(graph.proof) == bytes_of(alone.proof)
        assert (*shape(graph), graph.stats.nodes) == (*shape(alone), alone.stats.nodes)


@pytest.mark.slow
def test_many_small_trees(executors, monkeypatch):
    """One piece searched by many trees; threads, since processes would not see the smaller size."""
    monkeypatch.setattr(interval_search, "LARGEST_TREE", 40)
    problem = gallery.get("wedge-8-5").build()
    alone, graph = (branch_graph(problem, (0, 5), executor=executor) for executor in (None, executors[2]))
    assert bytes_of(graph.proof) == bytes_of(alone.proof)
    assert verify(problem, graph.proof).ok


@pytest.mark.parametrize("arithmetic", ["fast", "exact"])
def test_other_arithmetics(arithmetic, executors):
    problem = gallery.get("two-node-6.4").build()
    alone, graph = (branch_graph(problem, (0, 8), arithmetic, executor=e) for e in (None, executors[1]))
    assert shape(graph) == shape(alone)


@pytest.mark.parametrize("most", [1, 60, 700])
def test_a_limit_on_nodes_leaves_the_same_graph(most, executors, wedge):
    problem, _ = wedge
    alone = branch_graph(problem, (0, 5), "fast", max_nodes=most)
    graph = branch_graph(problem, (0, 5), "fast", max_nodes=most, executor=executors[1])
    assert not graph.complete
    assert graph.reasons == alone.reasons
    assert f"max_nodes = {most}" in graph.reasons[0]
    assert shape(graph) == shape(alone)


def test_a_limit_on_time(executors, wedge):
    graph = branch_graph(wedge[0], (0, 5), time_limit=1e-9, executor=executors[1])
    assert "time limit" in graph.closing_line
    assert not graph.complete


def check_partial(partial, whole):
    """Not complete, and nothing that is not in the whole."""
    assert (partial.complete, partial.proof) == (False, None)
    found = {codes for arc in partial.arcs for codes in arc.selections}
    assert found <= {codes for arc in whole.arcs for codes in arc.selections}
    return len(partial.arcs)


@pytest.mark.slow
def test_an_interruption_keeps_what_was_found(executors, wedge):
    problem, whole = wedge
    for executor in executors:
        stop = CtrlC(lambda stage, share: stage == "search", call=2)
        partial = interrupted("kept", branch_graph, problem, (0, 5), "fast", progress=stop, executor=executor)
        assert check_partial(partial, whole) > 0


@pytest.mark.parametrize("healthy", [0, 1, 4])
def test_a_lost_worker_costs_time_and_nothing_else(healthy, wedge):
    problem, whole = wedge
    with ProcessPoolExecutor(2) as pool, pytest.warns(RuntimeWarning, match="a worker died"):
        graph = branch_graph(problem, (0, 5), "fast", executor=DyingExecutor(pool, healthy, os._exit, 1))
    assert not graph.reasons
    assert check_partial(graph, whole) == len(whole.arcs)


def test_an_executor_that_was_shut_down(wedge):
    pool = ThreadPoolExecutor(1)
    pool.shutdown()
    with pytest.warns(RuntimeWarning, match="takes no tasks"):
        whole_graph(wedge[0], (0, 5), executor=pool)
    bad_argument("executor", branch_graph, wedge[0], (0, 5), executor=3)


@pytest.mark.slow
def test_progress_reaches_the_end(executors, wedge):
    seen = []
    branch_graph(wedge[0], (0, 5), progress=lambda *state: seen.append(state), executor=executors[1])
    shares = [share for stage, share in seen if stage == "search"]
    assert shares == [*sorted(shares[:-1]), 1.0]
