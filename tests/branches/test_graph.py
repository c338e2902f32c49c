"""Questions to a graph: branches, jumps, uniqueness, starting points, tables, files, figures."""

import json
from fractions import Fraction

import networkx as nx
import numpy as np
import pytest
from complete import read_back, whole_graph
from path_problems import assert_same_roots, balanced, one_node, sheet_of_one_node
from refusals import bad_argument

from enumsol import enumerate_roots, gallery
from enumsol.branches import BranchGraph, branch_graph
from enumsol.branches.elements import VertexKind


@pytest.fixture(scope="module")
def square():
    return branch_graph(gallery.get("two-node-6.4").build(), (0.0, 8.0), "exact")


def test_the_two_node_square_goes_back_and_forth(square):
    assert square.complete
    assert len(square.branches) == 2
    (turning,) = [branch for branch in square.branches if branch.folds]
    assert [v.alpha for v in turning.folds] == pytest.approx([3.0, 1 + 2 * np.sqrt(2.0), 3.0], abs=1e-14)
    assert [square.multiplicity_at(a) for a in (1.0, 3.5, 5.0)] == [1, 5, 3]


def test_jumps_are_the_folds_that_no_arc_leaves_to_the_right(square):
    assert [v.alpha for v in square.jumps] == [pytest.approx(1 + 2 * np.sqrt(2.0))]


VERY_SHORT = 1.5 * (4 - 2.5e-13)


def sticks_for_a_while(c):
    """F = 1.5 alpha, f_n = 4 - alpha, f_t = -c: stick and slip- exist where 1.5 alpha (4 - alpha) > c."""
    return one_node((4.0, -c), friction=0.0, friction_slope=1.5, load_slope=[-1.0, 0.0])


def only_loop(graph):
    (closed,) = [branch for branch in graph.branches if branch.closed]
    return closed


def test_a_closed_branch_of_any_length():
    for c in (5.5, 5.9999, VERY_SHORT):
        half = float(4 - Fraction(c) / Fraction(3, 2)) ** 0.5
        for arithmetic in ("fast", "exact"):
            graph = balanced(branch_graph(sticks_for_a_while(c), (0.0, 4.0), arithmetic))
            closed = only_loop(graph)
            assert len(closed.arcs) == len(closed.vertices) == 2
            lo, hi = (v.exact.enclosure()[0] for v in sorted(closed.folds, key=lambda v: v.alpha))
            assert float(hi - lo) == pytest.approx(2 * half, rel=1e-9)
            assert graph.multiplicity_at(2.0) == 3
            assert f"  branch {closed.number}: loop, 2 arcs, alpha in [" in repr(graph)


def test_a_branch_on_an_alpha_interval_of_length_1e_6_is_missed_by_samples():
    problem = sticks_for_a_while(VERY_SHORT)
    lo, hi = only_loop(branch_graph(problem, (0.0, 4.0))).interval
    assert 0.99e-6 < hi - lo < 1.01e-6
    samples = np.linspace(0.0, 4.0, 1000).tolist()
    assert not any(lo <= alpha <= hi for alpha in samples)
    assert all(len(enumerate_roots(problem, alpha, "fast")) == 1 for alpha in samples[450:550])


def test_pinned_closed_branch_of_the_two_node_square():
    problem = gallery.two_node_square(
        (3.7, -5.0), (1.1, 3.4), friction=0.9, friction_slope=1.7, load_slope=((-0.8, -0.1), (-1.0, 0.6))
    )
    graph = balanced(whole_graph(problem, (0.0, 5.0), "exact"))
    closed = only_loop(graph)
    assert len(closed.arcs) == 4
    assert closed.interval == pytest.approx((0.398590498429, 2.170936637865), abs=1e-10)


def test_pinned_bifurcation_that_a_perturbation_of_the_load_destroys():
    chain = gallery.chain(2, 0.4, (0.5, -3.0))
    graph = branch_graph(chain, (0.0, 10.0), "exact")
    (corner,) = graph.bifurcations
    assert corner.alpha == 6.0
    assert sum(arc.tail == corner.number for arc in graph.arcs) == 4
    graph = whole_graph(chain.replace(f=chain.f + np.array([0.0, 0.0, 0.001, 0.0])), (0.0, 10.0), "exact")
    assert not graph.bifurcations
    assert len(graph.folds) == 2


def test_the_networkx_graph_holds_vertices_and_arcs(square):
    graph = square.graph
    assert isinstance(graph, nx.MultiGraph)
    assert graph.number_of_edges() == len(square.arcs)
    for _, _, number, data in graph.edges(keys=True, data=True):
        assert data["arc"] is square.arcs[number]
        lo, hi = data["alpha"]
        lambda_n, lambda_t = data["values"](0.5 * (lo + hi))
        assert lambda_n.shape == lambda_t.shape == (2,)
    for number, data in graph.nodes(data=True):
        assert data["alpha"] == square.vertices[number].alpha


def test_arcs_continue_in_their_vertices(square):
    for arc in square.arcs:
        for alpha, vertex in ((arc.lo, square.vertices[arc.tail]), (arc.hi, square.vertices[arc.head])):
            np.testing.assert_allclose(arc.values(alpha), (vertex.lambda_n, vertex.lambda_t), atol=1e-12)
            np.testing.assert_allclose(arc.displacements(alpha), (vertex.u_n, vertex.u_t), atol=1e-12)
        bad_argument("expected a value on the arc", arc.values, arc.hi + 1.0)


def test_starting_points_are_regular_roots_on_every_branch(square):
    points = square.starting_points()
    assert len(points) == len(square.branches)
    for branch, root in zip(square.branches, points, strict=True):
        assert root.regular
        assert any(root.statuses == arc.statuses and arc.lo < root.alpha < arc.hi for arc in branch.arcs)


def test_alphas_outside_the_interval_are_refused(square):
    bad_argument("interval", square.roots_at, 8.5)
    bad_argument("interval", square.multiplicity_at, -0.1)


def test_frames_and_summary(square):
    frame = square.to_frame()
    assert len(frame) == len(square.arcs)
    assert set(frame["branch"]) == {branch.number for branch in square.branches}
    vertices = square.vertices_frame()
    assert len(vertices) == 2 * len(square.vertices)
    assert json.loads(json.dumps(square.summary()))["folds"] == [v.alpha for v in square.folds]
    assert "complete: yes (proven)" in repr(square)


@pytest.mark.parametrize("name", ["one-node-6.3", "two-node-6.4", "two-node-6.7-plus"])
@pytest.mark.parametrize("arithmetic", ["fast", "exact"])
def test_a_saved_graph_is_read_back_to_the_last_bit(name, arithmetic, tmp_path):
    interval = (-3.0, 3.0) if "6.7" in name else (0.0, 8.0)
    graph = branch_graph(gallery.get(name).build(), interval, arithmetic)
    back = read_back(graph, tmp_path / "graph.json")
    assert repr(back) == repr(graph)
    assert back.reasons == graph.reasons
    assert back.to_frame().equals(graph.to_frame())
    assert back.vertices_frame().equals(graph.vertices_frame())
    for v, w in zip(graph.vertices, back.vertices, strict=True):
        assert v.exact.compare(w.exact) == 0
    for alpha in (1.3, 2.0, 2.9):
        assert_same_roots(back.roots_at(alpha), graph.roots_at(alpha))
    graph.write_graphml(tmp_path / "graph.graphml")
    assert nx.read_graphml(tmp_path / "graph.graphml").number_of_nodes() == len(graph.vertices)


def test_files_that_are_no_graphs_are_refused(tmp_path):
    file = tmp_path / "graph.json"
    bad_argument("cannot be read", BranchGraph.load, file)
    old, bare = (f'{{"format": "enumsol-branch-graph", "version": {version}}}' for version in (2, 3))
    for text, message in (("{", "JSON"), ("[]", "format"), (old, "version 3"), (bare, "'problem' is missing")):
        file.write_text(text)
        bad_argument(message, BranchGraph.load, file)


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("quantity", ["lambda_n", "lambda_t", "u_n", "u_t"])
def test_figures(square, quantity, tmp_path):
    file = tmp_path / "graph.png"
    figure = square.plot(quantity, file=file)
    assert len(figure.axes) == 3
    assert file.stat().st_size > 10_000
    assert len(square.plot(quantity, [1], multiplicity=False).axes) == 1
    styles = {line.get_linestyle() for line in figure.axes[0].lines}
    assert {"-", "--"} <= styles


@pytest.mark.slow
def test_figures_of_families_and_sheets(tmp_path):
    branch_graph(one_node((1.0, -2.0)), (0.0, 5.0)).plot("u_t", file=tmp_path / "family.png")
    sheet = branch_graph(sheet_of_one_node(), (-1.0, 1.0))
    sheet.plot(file=tmp_path / "sheet.png")
    bad_argument("quantity", sheet.plot, "pressure")
    bad_argument("nodes", sheet.plot, nodes=["x"])


def test_claims_say_what_they_rest_on(square):
    counts = f"{len(square.arcs)} arcs and {len(square.vertices)} vertices"
    low, high = square.interval
    assert repr(square.claims) == f"Claims of {counts} for alpha in [{low:g}, {high:g}]: proven"


def test_kinds_of_vertices_are_texts_too(square, tmp_path):
    (fold, *_) = square.folds
    assert fold.kind is VertexKind.FOLD
    assert fold.kind == "fold"
    assert (str(fold.kind), repr(fold.kind), f"{fold.kind:>5}") == ("fold", "'fold'", " fold")
    assert {v.kind for v in square.vertices} == {"fold", "end"}
    assert set(square.summary()["vertices"]) == {"fold", "end"}
    file = tmp_path / "graph.json"
    square.save(file)
    assert [item["kind"] for item in json.loads(file.read_text())["vertices"]] == [v.kind for v in square.vertices]
    assert all(type(v.kind) is VertexKind for v in BranchGraph.load(file).vertices)
    file.write_text(file.read_text().replace('"kind": "fold"', '"kind": "cusp"', 1))
    bad_argument(r"does not hold a graph \(.*'cusp'", BranchGraph.load, file)


def test_the_first_number_is_that_at_the_first_alpha_also_if_this_is_no_float():
    graph = branch_graph(gallery.two_node_square(), ("1/10", "9/10"))
    assert graph.steps[1:] == ([1, 1], [1])
    assert graph.uniqueness_limit is None
