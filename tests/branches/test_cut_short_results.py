"""Whatever a result that was cut short prints or returns is true of the complete one (random problems and limits)."""

import re
from functools import cache

import numpy as np
import pandas as pd
import pytest
from complete import read_back, whole_graph
from cut_short import false_claims_of_graph, false_claims_of_roots
from generators import integer_problem as integer_data, random_problem, singular_problem
from interruptions import CtrlC, interrupted
from path_problems import generic_problem, integer_problem, mirrored_problem

from enumsol import branch_graph, enumerate_roots, gallery, multiplicity_table
from enumsol.branches import ways
from enumsol.branches.enclosed import tracing

KINDS = ("friction", "load", "both")
INTERVAL = (0.0, 3.0)


def _problem(rng, seed):
    if seed % 4 == 3:
        return mirrored_problem(rng, load=bool(seed % 8 == 3))
    make = generic_problem if seed % 4 == 0 else integer_problem
    return make(rng, int(rng.integers(1, 4)), KINDS[seed % 3])


@pytest.mark.few(4, 3)
@pytest.mark.parametrize("seed", range(40))
def test_a_graph_cut_short_at_random_claims_nothing_false(seed, tmp_path):
    rng = np.random.default_rng(7000 + seed)
    problem = _problem(rng, seed)
    arithmetic = ("verified", "exact", "fast")[seed % 3]
    full = whole_graph(problem, INTERVAL, "exact")
    limits = {1, *(int(k) for k in rng.integers(1, max(full.stats.nodes, 3), size=5))}
    for limit in sorted(limits):
        graph = branch_graph(problem, INTERVAL, arithmetic, max_nodes=limit)
        assert list(false_claims_of_graph(graph, full)) == []
    read = read_back(graph, tmp_path / "graph.json")
    assert list(false_claims_of_graph(read, full)) == []
    assert (read.summary(), repr(read)) == (graph.summary(), repr(graph))


@cache
def complete_graph(name):
    return whole_graph(gallery.get(name).build(), (0.0, 5.0))


def stopped(full, when, call=1, arithmetic="verified"):
    """What is kept of a graph, whose claims the complete one confirms, if somebody presses Ctrl-C at this report."""
    stop = CtrlC(when, call=call)
    partial = interrupted("interrupted", branch_graph, full.problem, (0.0, 5.0), arithmetic, progress=stop)
    assert list(false_claims_of_graph(partial, full)) == []
    return partial


@pytest.mark.few(0, 1)
@pytest.mark.parametrize(
    "name", ["two-node-6.4", pytest.param("chain-4", marks=pytest.mark.slow), "one-node-6.3", "wedge-8-3"]
)
def test_gallery_graphs_cut_short_claim_nothing_false(name):
    full = complete_graph(name)
    for limit in np.unique(np.geomspace(1, full.stats.nodes, 5).astype(int)):
        graph = branch_graph(full.problem, (0.0, 5.0), max_nodes=int(limit))
        assert list(false_claims_of_graph(graph, full)) == []


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("calls", [1, 2, 3])
def test_a_graph_cut_short_by_an_interruption_claims_nothing_false(calls):
    stopped(complete_graph("wedge-8-3"), lambda stage, share: stage == "search", calls)


@pytest.mark.parametrize("calls", [1, 5, 12])
@pytest.mark.parametrize("name", ["two-node-6.4", "chain-4", "one-node-6.3"])
def test_an_interruption_while_arcs_are_worked_out_keeps_those_that_are_done(name, calls):
    full = complete_graph(name)
    partial = stopped(full, lambda stage, share: stage == "arcs", min(calls, full.stats.selections))
    assert "interrupted after the arcs of" in partial.reasons[0]


@pytest.mark.slow
def test_an_interruption_keeps_the_selections_of_a_group_that_are_finished(monkeypatch):
    full = complete_graph("wedge-8-3")
    monkeypatch.setattr(tracing, "over_parts", CtrlC(call=6, then=tracing.over_parts))
    partial = interrupted("interrupted", branch_graph, full.problem, (0.0, 5.0))
    done = int(re.search(r"the arcs of (\d+) of", partial.reasons[0])[1])
    assert 0 < done < full.stats.selections
    assert partial.arcs
    assert list(false_claims_of_graph(partial, full)) == []


def test_exact_algebra_stops_soon_after_an_interrupted_search(monkeypatch):
    full = complete_graph("chain-4")
    assert full.stats.selections > 8
    monkeypatch.setattr(ways, "_SELECTIONS_AFTER_INTERRUPT", 0)
    partial = stopped(full, lambda stage, share: stage == "search" and share == 1.0, arithmetic="fast")
    assert "the arcs of 8 of" in partial.reasons[1]


def _body(rng, seed):
    p = int(rng.integers(1, 4))
    return (random_problem, integer_data, singular_problem)[seed % 3](rng, p)


@pytest.mark.few(5, 3)
@pytest.mark.parametrize("seed", range(60))
def test_a_search_cut_short_at_random_claims_nothing_false(seed):
    rng = np.random.default_rng(8000 + seed)
    problem = _body(rng, seed)
    full = enumerate_roots(problem, 0.0, "exact")
    cuts = [{"max_nodes": int(k)} for k in {1, *rng.integers(1, max(full.stats.nodes, 3), size=4)}]
    for options in [*cuts, {"stop_after": 1}, {"stop_after": 2}, {"stop_after": 1, "method": "exhaustive"}]:
        given = {"arithmetic": "exact" if "method" in options else ("verified", "exact")[seed % 2], **options}
        roots = enumerate_roots(problem, 0.0, **given)
        assert list(false_claims_of_roots(roots, full)) == []
        table = multiplicity_table(problem, [0.0], **given).iloc[0]
        assert table["roots"] + table["families"] <= len(full) + len(full.families)
        assert bool(table["complete"]) == (roots.stopped is None)
        assert table["complete"] != pd.isna(table["index_sum"])
