"""Searches spread over workers: parts of bounded size, shared anew; one proof whatever the number of workers."""

import pickle
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor

import pytest
from compare import differences
from complete import accepted_report, all_roots
from generators import named
from interruptions import CtrlC, interrupted
from proof_tools import by_forms, bytes_of, records_of

from enumsol import enumerate_roots, gallery, verify
from enumsol.search import nodes as policy, parts, setup
from enumsol.support.workers import Crew


@pytest.fixture
def small_parts(monkeypatch):
    monkeypatch.setattr(setup, "NODES", 16)
    monkeypatch.setattr(setup, "FIRST", 8)


@pytest.fixture(scope="module")
def wedge():
    problem, alpha = named("wedge-14-5")
    return problem, alpha, enumerate_roots(problem, alpha)


class Watched(ThreadPoolExecutor):
    """Keeps the nodes of every part and those who searched it."""

    def __init__(self, size):
        super().__init__(size)
        self.parts = []

    def submit(self, function, /, *arguments):
        future = super().submit(function, *arguments)
        future.add_done_callback(lambda done: self.parts.append(done.result()))
        return future


@pytest.mark.parametrize("near", [True, False])
def test_no_part_is_long_and_no_worker_waits(small_parts, monkeypatch, wedge, near):
    problem, alpha, whole = wedge
    monkeypatch.setattr(Crew, "near", near)
    seen, before = [], Crew.next

    def watched(self, seconds=None):
        # when the search waits either the workers have enough to do, or there is no more
        seen.append((self.room - (0 if spread._known else 3 * self.workers), len(spread._waiting)))
        return before(self, seconds)

    def made(*arguments):
        nonlocal spread
        spread = setup.SpreadSearch(*arguments)
        return spread

    spread = None
    monkeypatch.setattr(Crew, "next", watched)
    monkeypatch.setattr("enumsol.roots.enumeration.SpreadSearch", made)
    with Watched(2) as executor:
        found = enumerate_roots(problem, alpha, executor=executor)
    assert not differences(found, whole, rtol=1e-12)
    nodes = [part.nodes for part in executor.parts if part is not None]
    # parts are longer where handing them out costs more
    assert max(nodes) <= 16 if near else 16 < max(nodes) <= 16 << parts.DOUBLED
    assert sum(nodes) == found.stats.nodes - 8
    assert found.stats.nodes == pytest.approx(whole.stats.nodes, rel=0.05)
    assert all(room <= 0 or not waiting for room, waiting in seen)
    assert any(waiting for _, waiting in seen)
    assert verify(problem, found.proof).complete


def test_what_workers_need_is_sent_once_or_twice(small_parts, wedge):
    problem, alpha, _ = wedge
    sent = []

    class Sizes(ThreadPoolExecutor):
        def submit(self, function, /, *arguments):
            sent.append(len(pickle.dumps(arguments)))
            return super().submit(function, *arguments)

    with Sizes(2) as executor:
        enumerate_roots(problem, alpha, executor=executor)
    whole = len(pickle.dumps(problem))
    assert sum(size > whole for size in sent) <= 2 * 8
    assert len(sent) > 40


def check_one_proof(problem, alpha, whole):
    proofs = []
    for pool in (ProcessPoolExecutor(2), ThreadPoolExecutor(1), ThreadPoolExecutor(3)):
        with pool as executor:
            found = enumerate_roots(problem, alpha, executor=executor)
        assert not differences(found, whole, rtol=1e-9)
        assert found.stats.redone == 0
        proofs.append(bytes_of(found.proof))
    assert proofs == proofs[:1] * 3
    assert verify(problem, found.proof).complete
    return found


@pytest.mark.slow
def test_one_proof(small_parts, wedge):
    check_one_proof(*wedge)


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("nodes", [0, 100])
def test_one_proof_with_forms(small_parts, tree_only, monkeypatch, nodes):
    monkeypatch.setattr(policy, "FORM_AFTER", nodes)
    problem = gallery.clamped_block(32, 16)
    whole = enumerate_roots(problem, 0.3)
    found = check_one_proof(problem, 0.3, whole)
    assert len(by_forms(records_of(found.proof))) > 20
    # begun again, not only went on: the records of the search with the energy are gone
    assert found.stats.nodes == pytest.approx(whole.stats.nodes, rel=0.1)


@pytest.mark.parametrize("most", [1, 5, 100, 333])
def test_the_limit_on_nodes_is_exact(small_parts, wedge, most):
    problem, alpha, whole = wedge
    with ThreadPoolExecutor(2) as executor:
        found, again = (enumerate_roots(problem, alpha, executor=executor, max_nodes=most) for _ in range(2))
    assert found.stats.nodes == most
    left = f"{len(found.undecided)} subtree{'s' * (len(found.undecided) > 1)}"
    assert found.stopped == f"stopped after max_nodes = {most} node{'s' * (most > 1)}, {left} not examined"
    assert bytes_of(found.proof) == bytes_of(again.proof)
    report = accepted_report(problem, found.proof)
    assert (report.roots, report.undecided) == (len(found), len(found.undecided))
    assert len(found) <= found.at_least <= len(whole)


def test_an_interruption_keeps_what_came_in(small_parts, wedge, tmp_path):
    problem, alpha, whole = wedge
    path, stop = tmp_path / "x.proof", CtrlC(lambda progress: progress.covered > 0.6)
    with ThreadPoolExecutor(2) as executor:
        options = {"executor": executor, "proof_path": path}
        partial = interrupted("interrupted", enumerate_roots, problem, alpha, progress=stop, **options)
        assert 0 < len(partial) <= len(whole)
        found = all_roots(problem, alpha, resume=True, **options)
    assert not differences(found, whole, rtol=1e-12)


@pytest.mark.slow
def test_dask(small_parts, monkeypatch, wedge):
    distributed = pytest.importorskip("distributed")
    problem, alpha, whole = wedge
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as cluster,
        distributed.Client(cluster) as client,
    ):
        found = enumerate_roots(problem, alpha, executor=client.get_executor())
    monkeypatch.setattr(Crew, "near", False)
    with ThreadPoolExecutor(1) as executor:
        alone = enumerate_roots(problem, alpha, executor=executor)
    assert not differences(found, whole, rtol=1e-12)
    assert bytes_of(found.proof) == bytes_of(alone.proof)
    assert verify(problem, found.proof).complete
