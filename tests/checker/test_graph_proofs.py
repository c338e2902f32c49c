"""Proofs of branch graphs are right about which selections hold; forgeries are in test_proof_format."""

from collections import Counter

import numpy as np
import pytest
from complete import accepted_report, whole_graph
from graph_proofs import GRAPHS, graph as made

from enumsol import branch_graph, enumerate_roots, gallery, verify
from enumsol.branches.proof_records import trees
from enumsol.proof.records import Branching
from enumsol.trusted.status_rows import children_of, is_covering


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


def test_trees_are_made_again_from_their_leaves():
    """Of several assignments; a checker reads them as trees below these, with the same leaves."""
    rng, sizes = np.random.default_rng(3), Counter()
    for _ in range(300):
        friction = [bool(rng.random() < 0.8) for _ in range(int(rng.integers(1, 5)))]
        roots = refined(rng, (6,) * len(friction), friction)
        roots = [root for root in roots if rng.random() < 0.6] or roots[:1]
        leaves = [leaf for root in roots for leaf in refined(rng, root, friction)]
        mixed, found, waiting = [leaves[k] for k in rng.permutation(len(leaves))], [], roots[::-1]
        for record in trees(roots, mixed, friction):
            codes = waiting.pop()
            if isinstance(record, Branching):
                assert is_covering(codes[record.node], record.children, friction=friction[record.node])
                waiting += record.below(codes)[::-1]
            else:
                assert record == codes
                found.append(record)
        assert not waiting
        assert sorted(found) == sorted(leaves)
        sizes[len(roots) > 1, len(leaves) > len(roots)] += 1
    assert min(sizes[several, deep] for several in (True, False) for deep in (True, False)) > 10


def test_leaves_that_are_those_of_no_tree():
    for leaves in ([(0, 6), (5, 0), (1, 5), (2, 5)], [(0, 6), (5, 0)], [(6, 0), (0, 6)]):
        with pytest.raises(AssertionError, match="no tree"):
            list(trees([(6, 6)], leaves, [True, True]))


def refined(rng, root, friction):
    """Leaves of a random tree below a partial assignment."""
    nodes = [i for i, code in enumerate(root) if children_of(code, friction=friction[i])]
    if not nodes or rng.random() < 0.3:
        return [root]
    node = int(rng.choice(nodes))
    children = children_of(root[node], friction=friction[node])
    return [leaf for c in children for leaf in refined(rng, (*root[:node], c, *root[node + 1 :]), friction)]
