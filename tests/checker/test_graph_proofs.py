"""Proofs of branch graphs are right about which selections hold; forgeries are in test_proof_format."""

from collections import Counter
from itertools import product

import numpy as np
import pytest
from complete import accepted_report, whole_graph
from graph_proofs import GRAPHS, graph as made

from enumsol import branch_graph, enumerate_roots, gallery, verify
from enumsol.checker.graph_checker import covers
from enumsol.trusted.status_rows import children_of


@pytest.fixture(scope="module", params=["load", "friction", "cut", "unloaded", "both"])
def proven(request):
    """A problem, its graph, and whether branches meet: only exact algebra decides where, which is in no proof."""
    if request.param == "cut":
        # a wedge whose interval is searched in several pieces, about S and g as computed
        problem = gallery.get("wedge-8-5").build()
        return problem, whole_graph(problem, (0.0, 5.0)), False
    problem, _, graph = made(request.param)
    return problem, graph, request.param == "friction"


@pytest.mark.few(0, 2)
def test_a_verified_graph_is_complete_and_its_proof_verifies(proven):
    problem, graph, meets = proven
    report = accepted_report(problem, graph.proof)
    assert report.complete == (not meets)
    assert repr(report).endswith("\n  complete: no" if meets else "\n  complete: yes")
    assert report.data == graph.certified_data
    assert report.leaves > 0


@pytest.mark.few(0, 2)
def test_statuses_of_all_roots_are_among_the_selections_handed_on(proven):
    problem, graph, _ = proven
    selections = verify(problem, graph.proof).selections
    a, b = graph.interval
    codes = {"open": 0, "stick": 1, "slip+": 2, "slip-": 3}
    for alpha in np.random.default_rng(1).uniform(a, b, 12):
        for root in enumerate_roots(problem, float(alpha), "fast"):
            assert tuple(codes[status.value] for status in root.statuses) in selections


def test_fast_graphs_have_no_proof():
    problem, interval = GRAPHS["friction"]()
    graph = branch_graph(problem, interval, "fast")
    assert graph.proof is None
    assert not graph.complete


def covered(roots, leaves, friction):
    return covers(*(np.array(part, dtype=np.uint8).reshape(-1, len(friction)) for part in (roots, leaves)), friction)


def test_cover_of_a_tree_by_its_leaves():
    assert covered([(6, 6)], [(0, 6), (5, 0), (1, 5), (2, 5), (3, 5)], [True, True])
    assert not covered([(6, 6)], [(0, 6), (5, 0), (1, 5), (2, 5)], [True, True])
    assert covered([(6,)], [(0,), (4,)], [False])
    assert not covered([(6,)], [(0,), (4,)], [True])
    assert not covered([(6,)], [], [True])
    assert covered([(0, 6), (5, 0)], [(0, 6), (1, 0), (2, 0), (3, 0)], [True, True])
    assert not covered([(0, 6), (5, 0)], [(0, 6), (1, 0), (2, 0)], [True, True])
    # a leaf that is coarser than a root was not found below it
    assert not covered([(0, 0)], [(0, 6)], [True, True])


def selections_in(codes, friction):
    """Complete selections of a partial assignment, one by one."""
    final = {6: (0, 1, 2, 3), 5: (1, 2, 3)}
    choices = [final.get(c, (c,)) if F or c < 5 else (0, 4) for c, F in zip(codes, friction, strict=True)]
    return set(product(*choices))


def test_covers_against_a_list_of_all_selections():
    rng, outcomes = np.random.default_rng(3), Counter()
    for _ in range(300):
        friction = [bool(rng.random() < 0.8) for _ in range(int(rng.integers(1, 5)))]
        roots = refined(rng, (6,) * len(friction), friction)
        roots = [root for root in roots if rng.random() < 0.6] or roots[:1]
        leaves = [leaf for root in roots for leaf in refined(rng, root, friction)]
        if rng.random() < 0.5:
            del leaves[int(rng.integers(len(leaves)))]
        wanted = set().union(*(selections_in(root, friction) for root in roots))
        had = set().union(*(selections_in(leaf, friction) for leaf in leaves))
        found = covered(roots, leaves + leaves[:1], friction)
        assert found == (wanted <= had)
        outcomes[found] += 1
    assert min(outcomes.values()) > 100


def refined(rng, root, friction):
    """Leaves of a random tree below a partial assignment."""
    nodes = [i for i, code in enumerate(root) if children_of(code, friction=friction[i])]
    if not nodes or rng.random() < 0.3:
        return [root]
    node = int(rng.choice(nodes))
    children = children_of(root[node], friction=friction[node])
    return [leaf for c in children for leaf in refined(rng, (*root[:node], c, *root[node + 1 :]), friction)]
