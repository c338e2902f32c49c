"""Searches that look ahead near the root of the tree: the roots of the other rule, proofs that hold, the same tree."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from compare import assert_as_exhaustive, differences
from complete import proven_roots
from generators import named, random_problem
from proof_tools import by_forms, bytes_of, records_of

from enumsol import enumerate_roots
from enumsol.search import nodes, setup

LOOKING = nodes.Lookahead._best


@pytest.fixture
def soon(monkeypatch):
    """Searches look ahead down to six decisions once they have a hundred nodes; tells how often they did."""
    chosen = []

    def counted(self, codes, relaxation):
        chosen.append(LOOKING(self, codes, relaxation))
        return chosen[-1]

    monkeypatch.setattr(nodes, "FORM_AFTER", 100)
    monkeypatch.setattr(nodes, "NODES", 100)
    monkeypatch.setattr(nodes, "_DEPTHS", ((1.0, 6),))
    monkeypatch.setattr(nodes.Lookahead, "_best", counted)
    return chosen


def test_random_problems_have_the_roots_of_all_selections(soon, monkeypatch):
    monkeypatch.setattr(nodes, "FORM_AFTER", 0)
    monkeypatch.setattr(nodes, "NODES", 0)
    rng, several, looked = np.random.default_rng(5), 0, 0
    for _ in range(40):
        problem = random_problem(rng, int(rng.integers(3, 6)))
        found = proven_roots(problem, 0.0)
        assert_as_exhaustive(problem, 0.0, found)
        several += len(found) > 1
        looked += bool(soon)
        soon.clear()
    assert several > 5
    assert looked > 5


@pytest.mark.parametrize("name", ["wedge-8-5", "wedge-14-5"])
def test_the_roots_are_those_of_the_other_rule(name, soon, monkeypatch):
    problem, alpha = named(name)
    ahead = proven_roots(problem, alpha)
    assert soon
    monkeypatch.setattr(nodes, "NODES", 10**9)
    plain = proven_roots(problem, alpha)
    assert not differences(ahead, plain, rtol=1e-9)
    assert ahead.stats.nodes != plain.stats.nodes


def test_the_tree_is_the_same_with_workers(soon, monkeypatch):
    problem, alpha = named("wedge-14-5")
    monkeypatch.setattr(setup, "NODES", 16)
    monkeypatch.setattr(setup, "FIRST", 8)
    found = []
    for workers in (1, 2):
        with ThreadPoolExecutor(workers) as executor:
            found.append(proven_roots(problem, alpha, executor=executor))
        assert soon
        soon.clear()
    assert bytes_of(found[0].proof) == bytes_of(found[1].proof)
    assert not differences(found[0], enumerate_roots(problem, alpha), rtol=1e-9)


@pytest.mark.parametrize("share", [0.3, 0.8])
def test_a_resumed_search_learns_the_rule_from_its_file(share, soon, tmp_path):
    (problem, alpha), path = named("wedge-14-5"), tmp_path / "x.proof"
    whole = enumerate_roots(problem, alpha, proof_path=path)
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    soon.clear()
    found = proven_roots(problem, alpha, proof_path=path, resume=True)
    assert soon
    assert not differences(found, whole, rtol=1e-9)
    # all but the nodes after which the search began again
    assert found.stats.resumed > 100
    assert found.stats.resumed + found.stats.nodes == whole.stats.nodes - 100


def test_a_resumed_search_that_did_not_look_ahead_does_not(soon, monkeypatch, tmp_path):
    (problem, alpha), path = named("wedge-14-5"), tmp_path / "x.proof"
    monkeypatch.setattr(nodes, "NODES", 10**9)
    whole = enumerate_roots(problem, alpha, proof_path=path)
    path.write_bytes(path.read_bytes()[:-2000])
    found = proven_roots(problem, alpha, proof_path=path, resume=True)
    assert found.stats.resumed + found.stats.nodes == whole.stats.nodes


def test_a_search_decides_once_and_goes_on_where_it_stands(monkeypatch):
    problem, alpha = named("wedge-14-5")
    plain, asked = enumerate_roots(problem, alpha), []
    begins = nodes.Lookahead.begins

    def noted(self, covered):
        asked.append(begins(self, covered))
        return asked[-1]

    monkeypatch.setattr(nodes, "NODES", 100)
    monkeypatch.setattr(nodes, "_DEPTHS", ())
    monkeypatch.setattr(nodes.Lookahead, "begins", noted)
    found = enumerate_roots(problem, alpha)
    assert asked == [False]
    assert found.stats.nodes == plain.stats.nodes
    assert bytes_of(found.proof) == bytes_of(plain.proof)


def test_a_search_with_few_nodes_left_keeps_what_it_found(soon):
    problem, alpha = named("wedge-14-5")
    before = [enumerate_roots(problem, alpha, max_nodes=count) for count in (99, 100, 150)]
    assert not soon
    assert len(before[0]) >= 1
    assert all(len(found) >= len(before[0]) for found in before)
    enumerate_roots(problem, alpha, max_nodes=200)
    assert soon


@pytest.mark.usefixtures("tree_only")
def test_a_search_with_a_form_that_pays_does_not_look_ahead(soon, monkeypatch):
    (problem, alpha), looked, pay = named("wedge-14-5"), [], nodes.Forms.pay

    def noted(self, *arguments):
        looked.append(len(soon))
        return pay(self, *arguments)

    monkeypatch.setattr(nodes, "NODES", 50)
    monkeypatch.setattr(nodes, "MORE", -2.0)
    monkeypatch.setattr(nodes.Forms, "pay", noted)
    found = proven_roots(problem, alpha)
    # until then it did
    assert looked == [len(soon)]
    assert soon
    assert by_forms(records_of(found.proof))
