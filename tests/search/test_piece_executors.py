"""Graphs in 3D searched by executors, cut short, and with a lost worker: the same whatever the workers are."""

import os
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor

import pytest
from complete import complete_report, graph_over_alpha, whole_graph
from dying import DyingExecutor
from interruptions import CtrlC, interrupted
from problems3d import random_over_alpha
from proof_tools import bytes_of

from enumsol import branch_graph
from enumsol.branches.space import space_graph as cover
from enumsol.search.space import piece_tree


@pytest.fixture(scope="module")
def executors():
    with ProcessPoolExecutor(1) as one, ProcessPoolExecutor(2) as two, ThreadPoolExecutor(3) as threads:
        yield one, two, threads


@pytest.fixture
def small_tasks(monkeypatch):
    """Threads search tasks of few nodes from the root of the tree on; processes would not see this."""
    monkeypatch.setattr(piece_tree, "NODES", 1)
    with ThreadPoolExecutor(1) as one, ThreadPoolExecutor(3) as three:
        yield one, three


@pytest.fixture
def curves_met_late(monkeypatch):
    """No solutions are sampled, so that every curve but the first one is met at a leaf; gives what the tasks wanted."""
    monkeypatch.setattr(cover, "_SAMPLED", ())
    wanted, examined = [], piece_tree.PieceWorker.__call__

    def noted(*arguments):
        answer = examined(*arguments)
        wanted.append(answer.wanted)
        return answer

    monkeypatch.setattr(piece_tree.PieceWorker, "__call__", noted)
    return wanted


def arcs_of(graph):
    """What a graph has, whatever the leaves of its proof are."""
    kinds = [(v.kind, v.selections) for v in graph.vertices]
    return kinds, [(arc.tail, arc.head, arc.selections, arc.index) for arc in graph.arcs]


def same(one, other):
    """Whether graphs have the same arcs after the same search, and the same proof."""
    assert arcs_of(one) == arcs_of(other)
    assert (one.stats.nodes, one.reasons) == (other.stats.nodes, other.reasons)
    assert [v.alpha for v in one.vertices] == [v.alpha for v in other.vertices]
    assert (one.proof is None) == (other.proof is None)
    return one.proof is None or bytes_of(one.proof) == bytes_of(other.proof)


def test_small_tasks_give_the_same_curves(small_tasks):
    problem, alone = graph_over_alpha(1, 3)
    seen = []
    one, three = (
        whole_graph(problem, (0, 1), executor=executor, progress=lambda *state: seen.append(state))
        for executor in small_tasks
    )
    assert same(one, three)
    assert arcs_of(one) == arcs_of(alone)
    complete_report(problem, one.proof)
    shares = [share for stage, share in seen if stage == "search"]
    assert shares[: len(shares) // 2] == shares[len(shares) // 2 :] == sorted(shares[: len(shares) // 2])
    assert shares[-1] == pytest.approx(1.0)


@pytest.mark.slow
def test_curves_that_are_met_late_are_the_same(small_tasks, curves_met_late):
    problem = random_over_alpha(2, 1)
    alone = whole_graph(problem, (0, 1))
    one, three = (whole_graph(problem, (0, 1), executor=executor) for executor in small_tasks)
    assert any(curves_met_late)
    assert not all(curves_met_late)
    assert same(one, three)
    assert len(alone.components) == 2
    assert sorted(arcs_of(one)[0]) == sorted(arcs_of(alone)[0])
    complete_report(problem, one.proof)


@pytest.mark.slow
def test_the_same_graph_and_proof_with_any_workers(executors):
    problem, alone = graph_over_alpha(2, 1)
    first, *others = (whole_graph(problem, (0, 1), executor=executor) for executor in executors)
    assert all(same(first, other) for other in others)
    assert arcs_of(first) == arcs_of(alone)
    complete_report(problem, first.proof)


@pytest.mark.parametrize("most", [1, 9])
def test_a_limit_on_nodes_leaves_the_same_graph(small_tasks, most):
    one, three = (
        branch_graph(random_over_alpha(1, 3), (0, 1), max_nodes=most, executor=executor) for executor in small_tasks
    )
    assert same(one, three)
    assert one.stats.nodes == most
    assert f"max_nodes = {most}" in one.reasons[0]


def test_a_limit_on_time(small_tasks):
    graph = branch_graph(random_over_alpha(1, 3), (0, 1), time_limit=1e-9, executor=small_tasks[1])
    assert not graph.complete
    assert "time limit" in graph.reasons[0]


def test_what_was_found_is_kept_when_somebody_interrupts(small_tasks):
    stop = CtrlC(lambda step, share: step == "search" and share > 0.5)
    partial = interrupted("kept", branch_graph, random_over_alpha(1, 3), (0, 1), progress=stop, executor=small_tasks[1])
    assert not partial.complete
    assert len(partial.arcs) > 0
    assert partial.proof is None


@pytest.mark.slow
@pytest.mark.parametrize("healthy", [0, 2])
def test_a_lost_worker_costs_time_and_nothing_else(healthy):
    problem, alone = graph_over_alpha(2, 1)
    with ProcessPoolExecutor(2) as pool, pytest.warns(RuntimeWarning, match="a worker died"):
        graph = whole_graph(problem, (0, 1), executor=DyingExecutor(pool, healthy, os._exit, 1))
    assert arcs_of(graph) == arcs_of(alone)
