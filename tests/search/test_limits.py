"""Searches cut short, watched, interrupted, and run by executors."""

import multiprocessing
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from itertools import product

import numpy as np
import pytest
from compare import differences, forces, statuses
from generators import named
from interruptions import CtrlC, interrupted
from refusals import refusal

import enumsol
from enumsol import gallery
from enumsol.branches import branch_graph
from enumsol.search.outcome import Stop, StopReason


def test_stop_after(wedge):
    whole = enumsol.enumerate_roots(*wedge, "fast")
    assert len(whole) == 5
    nodes = []
    for count in (1, 2, 3):
        part = enumsol.enumerate_roots(*wedge, "fast", stop_after=count)
        assert statuses(part) < statuses(whole)
        assert part.undecided
        assert (len(part), part.complete) == (count, False)
        assert repr(part).splitlines()[-1].startswith("complete: no (stopped after enough roots")
        nodes.append(part.stats.nodes)
    assert nodes == sorted(nodes)
    assert nodes[-1] < whole.stats.nodes
    more = enumsol.enumerate_roots(*wedge, "fast", stop_after=6)
    assert more.stopped is None
    assert not differences(more, whole)


def test_stop_after_counts_roots_and_not_selections():
    # the unloaded neighbours make 4^2 selections of every root
    problem = gallery.chain(3, 0.0)
    problem = problem.replace(f=[*problem.f[:2], *np.zeros(4)])
    for method, (most, count) in product(("tree", "exhaustive"), ((None, 3), (2, 2))):
        assert len(enumsol.enumerate_roots(problem, 5.0, "fast", method, stop_after=most)) == count


def test_max_nodes(wedge):
    roots = enumsol.enumerate_roots(*wedge, "fast", max_nodes=40)
    assert (roots.stats.nodes, roots.complete) == (40, False)
    assert "max_nodes = 40" in roots.stopped
    # what was not examined is listed, in the user's terms
    assert roots.undecided
    known = {None, "contact", *enumsol.ContactStatus}
    assert all(len(item.statuses) == wedge[0].p and set(item.statuses) <= known for item in roots.undecided)


def covers(codes, names):
    """Whether a partial assignment contains a selection."""
    return all(
        code is None or getattr(code, "value", code) == name or (code == "contact" and name != "open")
        for code, name in zip(codes, names, strict=True)
    )


@pytest.mark.parametrize("limit", [1, 7, 40, 100])
def test_every_root_is_found_or_lies_in_an_undecided_part(wedge, limit):
    roots = enumsol.enumerate_roots(*wedge, "fast", max_nodes=limit)
    for names in statuses(enumsol.enumerate_roots(*wedge, "fast")):
        inside = sum(covers(item.statuses, names) for item in roots.undecided)
        assert inside + (names in statuses(roots)) == 1


def test_time_limit(wedge):
    roots = enumsol.enumerate_roots(*wedge, "fast", time_limit=1e-9)
    assert roots.stats.nodes < 100
    assert "time limit" in roots.stopped
    assert not roots.complete


@pytest.mark.parametrize("option", [{"stop_after": 0}, {"max_nodes": 0}, {"max_nodes": 2.5}, {"time_limit": 0.0},
                                    {"time_limit": float("nan")}, {"tolerance": -1.0}, {"tolerance": 1.0},
                                    {"engine": "simplex"}, {"method": "guess"}, {"arithmetic": "double"}])  # fmt: skip
def test_options_out_of_range(option):
    with pytest.raises(enumsol.InvalidArgumentError, match=f"^{next(iter(option))} is .*; expected"):
        enumsol.enumerate_roots(gallery.one_node_triangle(), 1.0, **option)


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("method", ["tree", "exhaustive"])
def test_progress(method):
    seen = []
    problem = gallery.chain(6, 0.0)
    enumsol.enumerate_roots(problem, 5.0, "fast", method, progress=seen.append)
    assert len(seen) >= 2
    assert [s.nodes for s in seen] == sorted(s.nodes for s in seen)
    assert [s.covered for s in seen] == sorted(s.covered for s in seen)
    assert 0 <= seen[0].covered < seen[-1].covered <= 1 + 1e-12
    assert 0 < seen[-1].solutions <= 729
    assert seen[-1].seconds > 0


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("method", ["tree", "exhaustive"])
def test_interruption_keeps_what_was_found(method):
    problem = gallery.chain(6, 0.0)
    stop = CtrlC(lambda progress: progress.covered > 0.3)
    call = enumsol.enumerate_roots, problem, 5.0, "fast", method
    error = refusal(enumsol.Interrupted, "interrupted", *call, progress=stop)
    partial = error.partial
    whole = enumsol.enumerate_roots(problem, 5.0, "fast")
    assert 0 < len(partial) < len(whole)
    assert statuses(partial) < statuses(whole)
    assert not partial.complete
    assert repr(partial).splitlines()[-1].startswith("complete: no (interrupted")
    assert isinstance(error, KeyboardInterrupt)


@pytest.mark.slow
def test_processes():
    # spawn: nothing is inherited, everything travels by pickle
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(2, mp_context=context) as executor:
        for name in ("wedge-8-5", "one-node-6.3"):
            problem, alpha = named(name)
            serial = enumsol.enumerate_roots(problem, alpha, "fast")
            parallel = enumsol.enumerate_roots(problem, alpha, "fast", executor=executor)
            assert not differences(parallel, serial, rtol=1e-12)
            assert [forces(r).tolist() for r in parallel] == [forces(r).tolist() for r in serial]


def test_parallel_search_of_an_unloaded_body():
    with ThreadPoolExecutor(2) as executor:
        roots = enumsol.enumerate_roots(gallery.chain(8, 0.1, f=(0.0, 0.0)), 1.0, "fast", executor=executor)
    assert (len(roots), roots.index_sum) == (1, 1)


def test_the_exhaustive_method_stops_at_max_nodes_without_a_root():
    roots = enumsol.enumerate_roots(gallery.clamped_block(6, 3), 1.0, "exact", "exhaustive", max_nodes=10)
    assert (roots.stats.selections, roots.complete) == (10, False)
    assert "max_nodes = 10" in roots.stopped


# -- reasons why a search ended early ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("stop", "sentence"),
    [
        (Stop(StopReason.NODE_LIMIT, 40), "stopped after max_nodes = 40 nodes"),
        (Stop(StopReason.NODE_LIMIT, 40, "selection"), "stopped after max_nodes = 40 selections"),
        (Stop(StopReason.ENOUGH_ROOTS, unexamined=0), "stopped after enough roots, 0 subtrees not examined"),
        (Stop(StopReason.TIME_LIMIT, unexamined=7), "stopped by the time limit, 7 subtrees not examined"),
        (Stop(StopReason.INTERRUPTED, 0), "interrupted after 0 nodes"),
        (Stop(StopReason.INTERRUPTED, 3, arcs_of=9), "interrupted after the arcs of 3 of 9 selections"),
    ],
    ids=str,
)
def test_the_sentence_that_a_stop_gives(stop, sentence):
    assert str(stop) == sentence
    assert stop.interrupted == sentence.startswith("interrupted")


def test_every_reason_has_a_sentence_of_its_own():
    sentences = {str(Stop(reason, 1)) for reason in StopReason} - {""}
    assert len(sentences) == len(StopReason)


def test_results_show_the_sentence_and_nothing_is_decided_by_it(monkeypatch):
    monkeypatch.setattr(Stop, "__str__", lambda stop: f"interrupted? not examined? {stop.reason.name}")
    problem, alpha = gallery.get("wedge-8-5").build(), 3.0
    cut = enumsol.enumerate_roots(problem, alpha, max_nodes=40)
    assert cut.stopped.endswith("NODE_LIMIT")
    assert enumsol.verify(problem, cut.proof).ok
    partial = interrupted("interrupted", enumsol.enumerate_roots, problem, alpha, progress=CtrlC())
    assert (partial.stopped.endswith("INTERRUPTED"), partial.proof) == (True, None)
    assert branch_graph(problem, (0.0, 1.0), max_nodes=5).reasons[0].endswith("NODE_LIMIT")
    partial = interrupted("interrupted", branch_graph, problem, (0.0, 1.0), progress=CtrlC())
    assert partial.reasons[0].endswith("INTERRUPTED")


@pytest.mark.parametrize(
    ("limit", "hint"),
    [({"max_nodes": 1}, "raise the limit of nodes"), ({"stop_after": 1}, "search without stop_after")],
)
def test_what_a_search_left_is_told_with_what_lets_it_get_there(wedge, limit, hint):
    hints = {part.hint for part in enumsol.enumerate_roots(*wedge, **limit).undecided}
    assert hints == {hint}


@pytest.mark.parametrize("problem", [gallery.block_on_table(), gallery.block_on_table3d()], ids=["2D", "3D"])
def test_where_nothing_holds_a_body_it_is_told_what_may_hold_it(problem):
    (hint,) = {part.hint for part in enumsol.enumerate_roots(problem, 1, max_nodes=1).undecided}
    assert hint.startswith("raise the limit of nodes, or hold the body by a spring or a fixed point")
    assert "smaller max_rigid_displacement" in hint
