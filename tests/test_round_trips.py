"""Whatever ``save`` writes ``load`` reads: every kind of result, whole or cut short."""

import numpy as np
import pytest
from complete import read_back
from helpers.floating_bodies import pushed_block

import enumsol

E = np.eye(3)


def node_in_space(friction, friction_slope, **options):
    data = {"friction": friction, "friction_slope": friction_slope, **options}
    return enumsol.ContactProblem3D(np.diag([1, 0.5, 0.25]), E[:1], E[1:2], E[2:], [1, 1.5, 1], **data)


def sheet():
    A = [[1, 0.5], [0.5, 1]]
    return enumsol.ContactProblem(A, E[:1, :2], E[1:2, :2], [1, 0.5], friction=0.0, friction_slope=1.0)


def unloaded(**options):
    return enumsol.ContactProblem(np.eye(2), E[:1, :2], E[1:2, :2], [0, 0], friction=0.5, **options)


def square():
    return enumsol.gallery.get("two-node-6.4").build()


CUT = {"max_nodes": 2}
GRAPHS = {
    "exact": (square, (0, 8), {"arithmetic": "exact"}),
    "fast": (square, (0, 8), {"arithmetic": "fast"}),
    "verified": (square, (0, 8), {}),
    "verified, cut short": (square, (0, 8), CUT),
    "exact, cut short": (square, (0, 8), {"arithmetic": "exact", **CUT}),
    "by balls": (lambda: enumsol.gallery.get("wedge-8-5").build(), (0, 1), {}),
    "by balls, cut short": (lambda: enumsol.gallery.get("wedge-8-5").build(), (0, 1), CUT),
    "no load": (unloaded, (0, 1), {}),
    "no load in the middle": (lambda: unloaded(load_slope=[1, 0.5]), (-1, 1), {}),
    "a sheet": (sheet, (0, 3), {}),
    "held by nothing": (pushed_block, (0, 1.5), {}),
    "held by nothing, exact": (pushed_block, (0, 1.5), {"arithmetic": "exact"}),
    "held by nothing, cut short": (pushed_block, (0, 1.5), CUT),
    "isotropic": (lambda: node_in_space(0.5, 1.0), (0, 1), {}),
    "orthotropic": (lambda: node_in_space((0.5, 0.25), (1.0, 0.5)), (0, 1), {}),
    "one tangent": (lambda: node_in_space((0.5, 0.0), (1.0, 0.0)), (0, 1), {}),
    "another ratio": (lambda: node_in_space((0.5, 0.2), (1.0, 1.0)), (0, 1), {}),
    "in space, cut short": (lambda: node_in_space(0.5, 1.0), (0, 1), {"max_nodes": 1}),
}


@pytest.mark.parametrize("kind", GRAPHS)
def test_graphs_are_read_back(kind, tmp_path):
    make, interval, options = GRAPHS[kind]
    graph = enumsol.branch_graph(make(), interval, **options)
    again = read_back(graph, tmp_path / "graph.json")
    assert str(again) == str(graph)
    assert again.problem.fingerprint == graph.problem.fingerprint
    assert again.reasons == graph.reasons
    assert len(again.arcs) == len(graph.arcs)
    for one, other in zip(again.arcs, graph.arcs, strict=True):
        middle = 0.5 * (one.lo + one.hi)
        for values, expected in zip(one.state(middle), other.state(middle), strict=True):
            assert np.array_equal(values, expected)


@pytest.mark.slow
def test_they_are_of_many_kinds():
    graphs = {kind: enumsol.branch_graph(make(), interval, **more) for kind, (make, interval, more) in GRAPHS.items()}
    assert {kind for kind, graph in graphs.items() if graph.arcs} > {"exact", "by balls", "isotropic", "orthotropic"}
    assert {kind for kind, graph in graphs.items() if not graph.complete} > {"another ratio", "in space, cut short"}


@pytest.mark.parametrize("make", [square, pushed_block])
def test_paths_and_limits_are_read_back(make, tmp_path):
    problem = make()
    path = enumsol.follow(problem, enumsol.enumerate_roots(problem, 0.5)[0], 1, (0, 2))
    again = read_back(path, tmp_path / "path.npz")
    assert str(again) == str(path)
    assert np.array_equal(again.lambda_n, path.lambda_n)
    for alpha in (0.5, 1.5):
        limit = enumsol.successive_approximations(problem, alpha=alpha)
        assert str(read_back(limit, tmp_path / "limit.npz", problem)) == str(limit)


@pytest.mark.parametrize("options", [{}, {"max_nodes": 1}, {"arithmetic": "fast"}])
@pytest.mark.parametrize("make", [sheet, lambda: node_in_space(0.5, 0.0)])
def test_histories_are_read_back(make, options, tmp_path):
    problem = make()
    history = enumsol.histories(problem, [0.5, 1, 1, 0.5], **options)
    again = read_back(history, tmp_path / "history.json", problem)
    assert str(again) == str(history)
    assert again.reasons == history.reasons


def test_a_history_of_a_body_that_nothing_holds_is_read_back(tmp_path):
    problem = enumsol.gallery.block_on_table()
    history = enumsol.histories(problem, [0.25, 0.5, 1], arithmetic="exact")
    again = read_back(history, tmp_path / "history.json", problem)
    assert str(again) == str(history)
    pairs = [zip(history.stages(k), again.stages(k), strict=True) for k in (1, 2, 3)]
    found = [(stage.roots, other.roots) for pair in pairs for stage, other in pair]
    assert all(one.rigid_bound == two.rigid_bound for one, two in found)
    roots = [pair for one, two in found for pair in zip(one, two, strict=True)]
    assert roots
    assert all(np.array_equal(one.rigid_coordinates, two.rigid_coordinates) for one, two in roots)
    assert all(np.array_equal(one.u, two.u) for one, two in roots)
