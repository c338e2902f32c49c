"""A stopped search that meets a continuum lists all of it, and its proof holds as much."""

import functools
from concurrent.futures import ThreadPoolExecutor
from unittest import mock

import numpy as np
import pytest
from complete import accepted_report
from effort import some
from generators import integer_problem, singular_problem
from oracles import exact_solutions
from proof_tools import bytes_of, copied, leaves_of, proof_of, records_of
from rational_checker import check_records

from enumsol import ContactProblem, enumerate_roots
from enumsol.proof.writer import FLUSH_EVERY, KeptRecords, ProofWriter
from enumsol.search import setup
from enumsol.search.certifiers.verified import VerifiedCertifier
from enumsol.support.deadlines import TimeOverError


def pulled_apart():
    """Two nodes of a chain, of which one only just rests at the limit of sliding: a segment of roots."""
    A = 2 * np.eye(4) - np.eye(4, k=2) - np.eye(4, k=-2)
    return ContactProblem(A, np.eye(4)[:2], np.eye(4)[2:], [1, 0, -2, 0], friction=2)


def at_the_limit(*loads):
    """Nodes that do not feel each other, where F = 2 makes slip+ singular, so that every one has a segment of roots."""
    p = len(loads)
    A = np.kron(np.array([[2.0, -1], [-1, 2]]), np.eye(p))
    rows = np.eye(2 * p)
    return ContactProblem(A, rows[:p], rows[p:], A @ np.append(np.zeros(p), loads), friction=2)


def beside_a_root():
    """A node with a segment of roots beside one with three roots."""
    A = np.kron(np.array([[2.0, -1], [-1, 2]]), np.eye(2))
    return ContactProblem(A, np.eye(4)[:2], np.eye(4)[2:], [1, 1.5, -2, -4], friction=np.array([2.0, 5.0]))


def drawn(kind, p, seed):
    return kind(np.random.default_rng([seed, p] if kind is singular_problem else seed), p)


PROBLEMS = {
    "pulled apart": pulled_apart,
    "one at the limit": lambda: at_the_limit(-1),
    "two at the limit": lambda: at_the_limit(-1, -2),
    "beside roots": beside_a_root,
} | {
    f"{kind.__name__}, {p} nodes, seed {seed}": functools.partial(drawn, kind, p, seed)
    for kind, cases in (
        (integer_problem, ((1, 313), (2, 34), (3, 121), (3, 278))),
        (singular_problem, ((1, 0), (2, 0), (2, 2), (2, 4), (2, 13), (3, 2), (3, 5), (3, 8), (3, 12), (3, 13))),
    )
    for p, seed in cases
}
#: Those whose trees take longer, and those whose trees are small.
LONG = [f"singular_problem, {p} nodes, seed {seed}" for p, seed in ((2, 4), (3, 12), (3, 13))]
FEW = ("one at the limit", "two at the limit", "beside roots", "integer_problem, 2 nodes, seed 34")


@functools.cache
def known(name):
    """The problem, all its solutions in rationals, and the whole search."""
    problem = PROBLEMS[name]()
    found = enumerate_roots(problem, 0)
    assert found.complete
    assert found.families
    return problem, exact_solutions(problem, 0), found


def check(name, found):
    """What is listed is isolated, or on a continuum, and so often; the proof says the same, to another checker too."""
    problem, components, whole = known(name)
    isolated = [component for component in components if component.dimension == 0]
    continua = [component for component in components if component.dimension > 0]
    for root in found:
        point = np.concatenate([root.lambda_n, root.lambda_t])
        assert sum(component.distance(point) < 1e-9 for component in isolated) == 1
        assert all(component.distance(point) > 1e-9 for component in continua)
    for family in found.families:
        points = [vertex.ravel(order="F") for vertex in family.vertices]
        on = [component for component in continua if all(component.distance(point) < 1e-9 for point in points)]
        assert len(on) == 1
        assert len(points) == len(on[0].vertices)
        assert family.dimension == on[0].dimension
    assert len(found) <= len(isolated)
    assert len(found.families) <= len(continua)
    assert found.at_least <= len(components)
    if found.complete:
        assert (len(found), len(found.families)) == (len(isolated), len(continua))
        assert [family.index for family in found.families] == [family.index for family in whole.families]
    assert found.complete != bool(found.undecided)
    report = accepted_report(problem, found.proof)
    assert (report.roots, report.families, report.complete) == (len(found), len(found.families), found.complete)
    assert report.undecided == len(found.undecided)
    records = records_of(found.proof)
    if name in FEW:
        assert check_records(problem, records) == records[-1]


@pytest.mark.parametrize("name", [pytest.param(k, marks=pytest.mark.slow) if k in LONG else k for k in PROBLEMS])
def test_wherever_a_search_is_stopped_its_proof_says_what_it_lists(name):
    problem, _, whole = known(name)
    part, last = 0, whole.stats.nodes
    # early, where a limit changes most, at even distances from there on, and at the end
    for nodes in sorted({*range(1, min(8, last) + 1), *np.linspace(1, last, some(8, of=last)).astype(int).tolist()}):
        found = enumerate_roots(problem, 0, max_nodes=nodes)
        check(name, found)
        part += bool(found.families) and not found.complete
    assert found.complete
    assert part


@pytest.mark.parametrize("name", FEW)
def test_workers_leave_continua_whole(name):
    problem, _, whole = known(name)
    with ThreadPoolExecutor(2) as executor, mock.patch.multiple(setup, NODES=3, FIRST=2):
        for nodes in range(1, whole.stats.nodes + 1, 2):
            check(name, enumerate_roots(problem, 0, max_nodes=nodes, executor=executor))


@pytest.mark.parametrize("name", FEW)
def test_a_search_that_goes_on_and_is_stopped_again(name, tmp_path):
    path = tmp_path / "a.proof"
    problem, _, whole = known(name)
    for nodes in range(1, whole.stats.nodes, 3):
        path.unlink(missing_ok=True)
        check(name, enumerate_roots(problem, 0, max_nodes=nodes, proof_path=path))
        for more in (1, 2, None):
            found = enumerate_roots(problem, 0, max_nodes=more, proof_path=path, resume=True)
            check(name, found)
        assert found.complete


@pytest.mark.parametrize("name", FEW)
def test_what_the_file_holds_behind_subtrees_that_are_left_belongs_to_continua_in_them(name, tmp_path):
    # the file of a search with workers whose time was over: undecided subtrees come before others
    path = tmp_path / "a.proof"
    problem, _, whole = known(name)
    records = records_of(whole.proof)
    leaves = [place for place, _ in leaves_of(records)]
    kept = 0
    for open_leaves in range(2, len(leaves)):
        begun = copied(records)
        for place in leaves[:open_leaves]:
            begun[place] = ["u", "the time was over"]
        path.write_bytes(bytes_of(proof_of(begun)))
        found = enumerate_roots(problem, 0, max_nodes=1, proof_path=path, resume=True)
        check(name, found)
        kept += found.stats.resumed > 0 and bool(found.families) and not found.complete
    assert kept


def test_enough_roots():
    for name in FEW:
        for enough in (1, 2):
            found = enumerate_roots(known(name)[0], 0, stop_after=enough)
            check(name, found)
            assert len(found) + len(found.families) >= enough or found.complete


@pytest.mark.parametrize("late", ["joining", "deciding"])
def test_without_time_to_know_a_continuum_nothing_is_listed_that_may_belong_to_it(late, monkeypatch):
    problem, _, _ = known("one at the limit")
    decide = VerifiedCertifier.selection
    solved = []

    def selection(certifier, codes):
        solved.append(codes)
        if late == "deciding" and len(solved) > before:
            raise TimeOverError
        return decide(certifier, codes)

    monkeypatch.setattr(VerifiedCertifier, "selection", selection)
    before = 100
    enumerate_roots(problem, 0, max_nodes=3)
    before = len(solved) - 1  # the last one is decided after the search
    solved.clear()
    if late == "joining":
        monkeypatch.setattr("enumsol.roots.enumerate._Enumeration._continua", mock.Mock(side_effect=TimeOverError))
    found = enumerate_roots(problem, 0, max_nodes=3)
    assert found.proof is None
    assert not found.complete
    assert not len(found)
    assert not found.families
    assert any("before it was known with which others" in part.reason for part in found.undecided)


def test_records_that_are_kept_packed_come_out_as_they_went_in():
    packed, plain = KeptRecords(packed=True), KeptRecords()
    for k in range(2 * FLUSH_EVERY + 3):
        for kept in (packed, plain):
            kept.write(["u", str(k)])
    assert len(packed._records) == 2 + 3
    texts = []
    for kept in (packed, plain):
        writer = ProofWriter()
        kept.release(writer)
        texts.append(records_of(writer.close()))
    assert texts[0] == texts[1]
