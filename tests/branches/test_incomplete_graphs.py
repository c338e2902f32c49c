"""A branch graph that is not complete says what it found and lower bounds, and nothing more."""

import json
import re

import pytest
from command_line import printed
from complete import read_back
from refusals import refusal

from enumsol import branch_graph, gallery
from enumsol.branches.claims import Standing
from enumsol.errors import IncompleteGraphError

INTERVAL = (0.0, 10.0)
GRAPH = ("graph", "gallery:two-node-6.4", "--no-stability", "--from", 0, "--to", 10)
#: Nodes after which the search over two-node-6.4 has found nothing, one arc, and two arcs.
CUTS = {1: 0, 7: 1, 11: 2}
#: How many solutions these arcs prove at alpha = 5, where there are three: all indices add up to +1, so that there is
#: one, another beside an arc of index -1, and another beside two of which one has index -1 (theory, section 7.13).
LEAST = {0: 1, 1: 2, 2: 3}


@pytest.fixture(scope="module")
def problem():
    return gallery.two_node_square(f1=(1, -3), f2=(1, -1))


@pytest.fixture(scope="module", params=CUTS, ids=lambda nodes: f"{CUTS[nodes]}-arcs")
def cut(request, problem):
    graph = branch_graph(problem, INTERVAL, max_nodes=request.param)
    assert len(graph.arcs) == CUTS[request.param]
    return graph


def test_it_gives_no_critical_alpha_and_no_number_of_solutions(cut):
    with pytest.raises(IncompleteGraphError, match=r"not complete \(stopped after max_nodes"):
        _ = cut.uniqueness_limit
    refusal(IncompleteGraphError, rf"at least {LEAST[len(cut.arcs)]} at alpha = 5", cut.multiplicity_at, 5.0)
    with pytest.raises(IncompleteGraphError, match="not complete"):
        _ = cut.steps
    assert cut.at_least(5.0) == LEAST[len(cut.arcs)]
    assert cut.claims.standing is Standing.INCOMPLETE


def test_what_the_cut_broke_is_neither_jump_nor_fold_nor_transition(cut):
    assert cut.jumps == cut.folds == cut.transitions == cut.bifurcations == ()
    assert {v.kind for v in cut.vertices} <= {"unsettled", "end"}
    assert all(v.index_left is None for v in cut.vertices if v.kind == "unsettled")


def test_its_text_claims_neither_uniqueness_nor_a_jump(cut, capsys):
    nodes = next(n for n, arcs in CUTS.items() if arcs == len(cut.arcs))
    out = printed(capsys, *GRAPH, "--max-nodes", nodes, status=3)
    assert "not complete" in out.splitlines()[0]
    assert not re.search("one solution (throughout|below)|jump|fold|bifurcation", out)
    assert ("several solutions at or right above alpha = 3" in out) == (len(cut.arcs) > 0)
    assert ("whether there is one is not known" in out) == (len(cut.arcs) == 0)
    assert out.splitlines()[-1] == f"complete: no (stopped after max_nodes = {nodes} node{'s' * (nodes != 1)})"


def test_its_json_claims_neither_uniqueness_nor_a_jump(cut, capsys):
    nodes = next(n for n, arcs in CUTS.items() if arcs == len(cut.arcs))
    found = json.loads(printed(capsys, *GRAPH, "--max-nodes", nodes, "--json", "-", status=3))
    assert (found["complete"], found["standing"]) == (False, "incomplete")
    assert found["uniqueness_limit"] is found["unique_throughout"] is None
    assert found["jumps"] == found["folds"] == found["bifurcations"] == []
    assert found["multiplicity"]["exact"] is False
    assert {vertex["kind"] for vertex in found["vertex_list"]} <= {"unsettled", "end"}


def test_its_table_calls_the_ends_of_its_arcs_unsettled(cut):
    frame = cut.to_frame()
    assert len(frame) == len(cut.arcs)
    if len(frame):
        # at the first alpha nothing was cut off
        assert set(frame["kind_from"][frame["alpha_from"] > 0]) == {"unsettled"}
        assert set(frame["kind_from"]) <= {"unsettled", "end"}
        assert set(cut.vertices_frame()["kind"]) == {"unsettled", "end"}


@pytest.mark.few(2)
def test_its_plot_shows_a_lower_bound_and_says_that_it_is_not_complete(cut, tmp_path):
    figure = cut.plot(file=tmp_path / "cut.png")
    assert (tmp_path / "cut.png").stat().st_size > 0
    assert "complete: no" in figure.axes[0].get_title("left")
    assert "at least" in figure.axes[-1].get_ylabel()
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert "fold" not in labels
    assert ("not followed further" in labels) == bool(cut.arcs)


def test_it_is_read_back_with_the_same_claims(cut, tmp_path):
    read = read_back(cut, tmp_path / "cut.json")
    assert read.summary() == cut.summary()
    with pytest.raises(IncompleteGraphError):
        _ = read.uniqueness_limit


def test_a_complete_graph_still_answers(problem):
    graph = branch_graph(problem, INTERVAL)
    assert graph.claims.standing is Standing.PROVEN
    assert (graph.uniqueness_limit, graph.multiplicity_at(3.5), graph.at_least(3.5)) == (3.0, 5, 5)
    assert graph.steps[2] == [1, 5, 3]
    assert [v.alpha for v in graph.jumps] == [pytest.approx(3.82842712474619)]


def test_fast_arithmetic_that_ran_to_its_end_is_not_proven(problem, capsys):
    graph = branch_graph(problem, INTERVAL, "fast")
    assert graph.claims.standing is Standing.NOT_PROVEN
    assert graph.uniqueness_limit == 3.0
    assert "one solution below alpha = 3, not proven" in printed(capsys, *GRAPH, "--arithmetic", "fast")
    assert json.loads(json.dumps(graph.summary()))["standing"] == "not proven"


def test_roots_of_an_incomplete_graph_are_a_part(cut):
    roots = cut.roots_at(5.0)
    assert not roots.complete
    assert roots.index_sum is None
    assert roots.at_least == len(roots) == len(cut.arcs)
    assert ("at least" in repr(roots)) == bool(cut.arcs)  # of nothing, zero is no bound
    assert not cut.arcs or f"at least {len(cut.arcs)} exist" in repr(roots)


def test_a_search_cut_short_gives_lower_bounds_in_text_and_table(capsys):
    out = printed(capsys, "roots", "gallery:wedge-14-5", "--alpha", 2.2, "--stop-after", 2, status=3)
    assert "2 roots found, at least 2 exist" in out
    assert "index sum: unknown" in out
    out = printed(capsys, "table", "gallery:wedge-14-5", "--alphas", 2.2, "--max-nodes", 150, status=3)
    row = out.splitlines()[1].split()
    assert row[1].startswith(">=")
    assert "?" in row
