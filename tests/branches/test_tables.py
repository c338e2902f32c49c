"""multiplicity_table and link_samples."""

from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from fractions import Fraction

import networkx as nx
import numpy as np
import pandas as pd
import pytest
from interruptions import CtrlC, interrupted
from path_problems import generic_problem
from problems3d import SLIDING, in_space, random_plane_over_alpha
from refusals import bad_argument

from enumsol import enumerate_roots, gallery
from enumsol.branches import branch_graph, link_samples, multiplicity_table, samples
from enumsol.errors import InvalidArgumentError
from enumsol.support.arguments import even_alphas

ALPHAS = [0.5, 2.0, 3.5, 5.0, 7.5]


@pytest.fixture(scope="module")
def square():
    return gallery.get("two-node-6.4").build()


def assert_as_alone(table, problem):
    """A table is that of a run in this process, but for the seconds that it took."""
    tables = [one.drop(columns="seconds") for one in (table, multiplicity_table(problem, ALPHAS))]
    pd.testing.assert_frame_equal(*tables)


def test_evenly_spaced_alphas_are_those_that_their_decimals_say():
    """-1 + 5 * 0.2 is 0, where numpy.linspace gives -1.1e-16; the ends are those that are given."""
    problem = gallery.get("clamped-block-8").build().replace(friction=0.3, friction_slope=0)
    table = multiplicity_table(problem, (-1, 0.2), samples=7)
    assert table["alpha"].tolist() == [-1, -0.8, -0.6, -0.4, -0.2, 0, 0.2]
    assert even_alphas(("1/3", 0.1 + 1), 3) == [Fraction(1, 3), Fraction(43, 60), 1.1]
    with pytest.raises(InvalidArgumentError, match="samples is 1"):
        multiplicity_table(problem, (0, 1), samples=1)
    with pytest.raises(InvalidArgumentError, match="alphas is"):
        multiplicity_table(problem, [0, 0.5, 1], samples=3)


def test_the_table_counts_roots_families_and_kinds(square):
    table = multiplicity_table(square, ALPHAS)
    assert table["alpha"].tolist() == ALPHAS
    assert table["roots"].tolist() == [1, 1, 5, 3, 3]
    assert (table["index_sum"] == 1).all()
    assert table["complete"].all()
    assert not multiplicity_table(square, ALPHAS, arithmetic="fast")["complete"].any()
    assert multiplicity_table(square, [3.5], arithmetic="exact")["complete"].all()
    assert table["with_stick"].tolist() == [0, 0, 2, 1, 1]
    family = multiplicity_table(gallery.get("one-node-6.3").build(), [2.0])
    assert family[["roots", "families"]].to_numpy().tolist() == [[0, 1]]


def test_the_table_says_which_searches_were_cut_short(square):
    table = multiplicity_table(square, [0.5, 3.5], max_nodes=10)
    assert list(table["stopped"].notna()) == [False, True]
    assert table["stopped"][1].startswith("stopped after max_nodes = 10 nodes")
    assert list(table["complete"]) == [True, False]
    assert table["undecided"][1] > 0


def test_the_table_agrees_with_the_graph(rng):
    problem = generic_problem(rng, 3, "load")
    graph = branch_graph(problem, (0.0, 6.0))
    alphas = rng.uniform(0.0, 6.0, size=20).tolist()
    assert multiplicity_table(problem, alphas)["roots"].tolist() == [graph.multiplicity_at(a) for a in alphas]


@pytest.mark.parametrize("pool", [ThreadPoolExecutor, ProcessPoolExecutor])
def test_a_parallel_run_gives_the_same_table(square, pool):
    seen = []
    with pool(2) as executor:
        table = multiplicity_table(square, ALPHAS, executor=executor, progress=lambda *state: seen.append(state))
    assert_as_alone(table, square)
    assert seen[-1] == (5, 5)


@pytest.mark.slow
def test_two_dask_workers_give_the_same_table(square):
    import distributed

    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as cluster,
        distributed.Client(cluster) as client,
    ):
        table = multiplicity_table(square, ALPHAS, executor=client)
    assert_as_alone(table, square)


def test_an_interruption_keeps_what_was_done(square):
    stops = [CtrlC(lambda done, total: done == 3) for _ in range(2)]
    partial = interrupted("3 of 5", multiplicity_table, square, ALPHAS, progress=stops[0])
    assert partial["alpha"].tolist() == ALPHAS[:3]
    with ThreadPoolExecutor(1) as executor:
        partial = interrupted("interrupted", multiplicity_table, square, ALPHAS, executor=executor, progress=stops[1])
    assert len(partial) == 3


def test_bad_alphas_are_refused_before_any_work(square):
    bad_argument("alpha", multiplicity_table, square, [1.0, np.nan])
    bad_argument("friction", multiplicity_table, square, [1.0, -1.0])
    assert len(multiplicity_table(square, [])) == 0
    bad_argument("empty", link_samples, square, [])


def test_linked_samples_follow_the_branches(square):
    graph = branch_graph(square, (0.0, 8.0))
    linked = link_samples(square, np.linspace(0.05, 7.95, 80))
    assert all(data["heuristic"] for _, _, data in linked.graph.edges(data=True))
    missed = linked.missed(graph)
    assert missed.arcs == missed.branches == missed.components == ()
    # no link joins roots of different exact branches
    place = {}
    for (sample, root), data in linked.graph.nodes(data=True):
        arcs = [a for a in graph.arcs_at(linked.root_sets[sample].alpha) if a.statuses == data["statuses"]]
        place[sample, root] = graph.branch_of[arcs[0].number]
    assert all(place[a] == place[b] for a, b in linked.graph.edges)
    assert "80 samples" in repr(linked)


def test_links_follow_a_transition_by_a_vanishing_test_function():
    problem = gallery.get("one-node-6.2").build()
    told = []
    linked = link_samples(problem, [4.0, 4.5, 4.9, 5.5], progress=lambda *at: told.append(at))
    assert told == [(k, 4) for k in (1, 2, 3, 4)]
    assert [data["rule"] for *_, data in linked.graph.edges(data=True)] == ["selection", "flip", "selection"]
    assert len(linked.branches) == 1


def test_what_samples_miss_is_named(square):
    graph = branch_graph(square, (0.0, 8.0))
    missed = link_samples(square, [1.0, 2.0]).missed(graph)
    assert len(missed.arcs) == 4
    assert missed.branches == missed.components == (1,)
    family = branch_graph(gallery.get("one-node-6.3").build(), (0.0, 5.0))
    assert link_samples(family.problem, [1.0, 3.0]).missed(family).families == 1


def rules(linked):
    return [data["rule"] for *_, data in linked.graph.edges(data=True)]


@pytest.mark.few(4, 20)
@pytest.mark.parametrize("seed", range(100, 124))
def test_a_problem_in_2d_written_in_3d_has_the_same_links(seed):
    problem, alphas = random_plane_over_alpha(2, seed), np.linspace(0.05, 3.95, 14)
    plane, space = link_samples(problem, alphas), link_samples(in_space(problem), alphas)
    places = []
    for flat, solid in zip(plane.root_sets, space.root_sets, strict=True):
        near = [[np.allclose(a.lambda_n, b.lambda_n, atol=1e-7) for b in solid] for a in flat]
        assert len(flat) == len(solid)
        assert [row.count(True) for row in near] == [1] * len(flat)
        places.append([row.index(True) for row in near])
    edges = {frozenset((s, places[s][r]) for s, r in edge) for edge in plane.graph.edges}
    assert edges == set(map(frozenset, space.graph.edges))
    assert (sorted(rules(plane)), len(plane.ambiguous)) == (sorted(rules(space)), len(space.ambiguous))


def test_in_3d_links_follow_a_transition_and_none_is_missed():
    """SLIDING sticks as soon as alpha is the length of (3/2, 1), 1.803."""
    linked = link_samples(SLIDING, [1.78, 1.79, 1.81, 1.82])
    assert rules(linked) == ["selection", "flip", "selection"]
    assert linked.missed(branch_graph(SLIDING, (1.78, 1.82))).arcs == ()
    # predicted from either side within a tenth of the step
    slips, sticks = (linked.root_sets[k][0] for k in (1, 2))
    for root, other in ((slips, sticks), (sticks, slips)):
        assert samples._vanishing(SLIDING, root, 0, other) == pytest.approx(np.sqrt(3.25), abs=2e-3)


def test_of_several_roots_with_the_same_statuses_none_is_chosen():
    left, right = (enumerate_roots(SLIDING, alpha, "fast")[0] for alpha in (1.78, 1.79))
    graph = nx.Graph()
    assert samples._link(graph, SLIDING, 0, [left, left], [right]) == [((0, 0), (1, 0)), ((0, 1), (1, 0))]
    assert graph.number_of_edges() == 0


@pytest.mark.slow
def test_in_3d_no_link_joins_roots_of_different_branches():
    problem = gallery.wedge3d(2, 1, 2)
    graph, linked = branch_graph(problem, (0, 4)), link_samples(problem, np.linspace(0.05, 3.95, 40))
    assert linked.missed(graph).branches == linked.ambiguous == ()
    place = {}
    for node, data in linked.graph.nodes(data=True):
        (arc,) = (arc for arc in graph.arcs_at(data["alpha"]) if arc.statuses == data["statuses"])
        place[node] = graph.branch_of[arc.number]
    assert all(place[a] == place[b] for a, b in linked.graph.edges)
    assert [len(branch) for branch in linked.branches] == [40, 32, 32]
