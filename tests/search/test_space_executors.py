"""Searches in 3D run by executors, cut short, and with a lost worker: the serial search is the judge."""

import os
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor

import numpy as np
import pytest
import scipy.linalg
from complete import accepted_report, all_roots, complete_report
from dying import DyingExecutor
from interruptions import CtrlC, interrupted
from problems3d import from_compliance, random_coupled
from proof_tools import bytes_of, kinds_of

import enumsol
from enumsol import enumerate_roots, gallery, verify
from enumsol.search import setup

pytestmark = pytest.mark.usefixtures("tree_only")


def three_nodes():
    """Three nodes that do not influence each other, with three roots each: 27 roots."""
    one = gallery.get("one-node-3d-3").build()
    S, g = one.condensed.S, one.condensed.free_displacements(0)
    place = [0, 3, 6, 1, 4, 7, 2, 5, 8]
    S, g = scipy.linalg.block_diag(S, S, S)[np.ix_(place, place)], np.tile(g, 3)[place]
    return from_compliance(S, g, tuple(np.tile(one.friction_at(0), (3, 1)).T))


def coupled(seed, p, least):
    """A random problem with at least so many roots."""
    rng = np.random.default_rng(seed)
    while True:
        S, g, F = random_coupled(rng, p)
        problem = from_compliance(S, g, tuple(F.T))
        if len(enumerate_roots(problem, 0, max_nodes=2000)) >= least:
            return problem


PROBLEMS = {
    "one node": lambda: (gallery.get("one-node-3d-3").build(), 0),
    "block": lambda: (gallery.get("block3d-9").build(), 0.5),
    "coupled": lambda: (coupled(11, 3, 3), 0),
    "three nodes": lambda: (three_nodes(), 0),
}


@pytest.fixture(scope="module")
def many():
    problem = three_nodes()
    roots = all_roots(problem, 0)
    assert len(roots) == 27
    return problem, roots


@pytest.fixture(scope="module")
def executors():
    with ProcessPoolExecutor(2) as two, ProcessPoolExecutor(1) as one, ThreadPoolExecutor(3) as threads:
        yield two, one, threads


def values(root):
    """All numbers of a root, nan where it has none."""
    box = root.enclosure
    bounds = () if box is None else (box.lambda_n, box.lambda_t, box.u_n, box.u_t)
    parts = (root.lambda_n, root.lambda_t, root.u_n, root.u_t, root.slip_angle, *bounds)
    return [root.index, root.margin, *(x for part in parts for x in np.nan_to_num(part, nan=99.0).ravel())]


def assert_equal(one, other):
    """The same roots to the last bit."""
    assert [root.statuses for root in one] == [root.statuses for root in other]
    assert [values(root) for root in one] == [values(root) for root in other]


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("name", PROBLEMS)
def test_the_same_roots_and_one_proof_whatever_the_number_of_workers(name, executors):
    problem, alpha = PROBLEMS[name]()
    alone = enumerate_roots(problem, alpha)
    together = [enumerate_roots(problem, alpha, executor=executor) for executor in executors]
    for roots in together:
        assert_equal(roots, alone)
        assert roots.complete
        assert roots.index_sum == alone.index_sum == 1
        assert bytes_of(roots.proof) == bytes_of(together[0].proof)
        assert roots.stats.nodes == pytest.approx(alone.stats.nodes, rel=0.15)
    # subtrees start cold: other multipliers, of as many leaves but for ties
    assert complete_report(problem, together[0].proof).roots == len(alone)


@pytest.mark.long
def test_fast_arithmetic(executors, many):
    problem, _ = many
    assert_equal(enumerate_roots(problem, 0, "fast", executor=executors[0]), enumerate_roots(problem, 0, "fast"))


def test_an_unloaded_body_and_one_that_cannot_be_enclosed(executors):
    free = from_compliance(np.eye(6), np.zeros(6), 0.5)
    assert len(enumerate_roots(free, 0, executor=executors[0])) == 1
    thin = enumsol.ContactProblem3D(np.eye(3), [[1, 0, 0]], [[1, 1e-7, 0]], [[0, 0, 1]], [1, 1, 1], friction=0.5)
    for executor in (None, executors[0]):
        roots = enumerate_roots(thin, 0, executor=executor)
        (part,) = roots.undecided
        assert "within rounding" in part.reason
        assert verify(thin, roots.proof).complete is False


def check_cut_short(partial, many):
    """Not complete and true of the whole; the proof holds for what was finished."""
    problem, whole = many
    assert not partial.complete
    assert partial.undecided
    assert repr(partial).splitlines()[-1].startswith("complete: no (")
    known = [values(root) for root in whole]
    assert all(values(root) in known for root in partial)
    assert len(partial) <= partial.at_least <= len(whole)
    report = accepted_report(problem, partial.proof)
    left = kinds_of(partial.proof).count("u")
    assert (report.complete, report.roots, report.undecided) == (False, len(partial), left)


@pytest.mark.slow
@pytest.mark.parametrize("limits", [{"stop_after": 2}, {"max_nodes": 3}, {"time_limit": 1e-9}])
def test_limits(limits, executors, many):
    roots = enumerate_roots(many[0], 0, executor=executors[0], **limits)
    check_cut_short(roots, many)
    assert roots.stopped
    if "stop_after" in limits:
        assert 2 <= len(roots) < 27


@pytest.mark.slow
def test_an_interruption_keeps_what_was_found(executors, many, monkeypatch):
    monkeypatch.setattr(setup, "NODES", 16)
    problem, whole = many
    stop = CtrlC(lambda progress: progress.covered > 0.5)
    partial = interrupted("roots so far", enumerate_roots, problem, 0, executor=executors[1], progress=stop)
    known = [values(root) for root in whole]
    assert 0 < len(partial) < 27
    assert all(values(root) in known for root in partial)
    assert (partial.complete, partial.proof) == (False, None)


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("healthy", [0, 3])
def test_a_lost_worker_costs_time_and_nothing_else(healthy, many):
    with ProcessPoolExecutor(2) as pool, pytest.warns(RuntimeWarning, match="a worker died"):
        found = all_roots(many[0], 0, executor=DyingExecutor(pool, healthy, os._exit, 1))
    assert_equal(found, many[1])
    assert verify(many[0], found.proof).complete


@pytest.mark.long
def test_tables(executors):
    def table(executor=None):
        found = enumsol.multiplicity_table(problem, [0.0, 0.5, 1.0, 1.5], executor=executor)
        assert found["complete"].all()
        return found.drop(columns="seconds").to_dict("records")

    problem = gallery.get("block3d-4").build()
    with ProcessPoolExecutor(1) as pool, pytest.warns(RuntimeWarning, match="a worker died"):
        again = table(DyingExecutor(pool, 2, os._exit, 1))
    assert again == table(executors[0]) == table()
