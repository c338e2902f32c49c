from dataclasses import dataclass, field
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from path_problems import stable_problem
from refusals import bad_argument

import enumsol
from enumsol import branch_graph, gallery
from enumsol.auditing import audit, follow_all, follow_arc
from enumsol.auditing.graph_map import GraphMap
from enumsol.continuation import ContinuationOptions, follow, newton

enumerate_roots = partial(enumsol.enumerate_roots, arithmetic="fast")

OPEN, STICK, MINUS = (enumsol.ContactStatus(name) for name in ("open", "stick", "slip-"))


@dataclass
class Arc:
    number: int
    statuses: tuple
    lo: float
    hi: float
    tail: int
    head: int
    force: object
    dimension: int = 0

    def values(self, alpha):
        n, t = self.force(alpha)
        return np.array([n]), np.array([t])


@dataclass
class Vertex:
    number: int
    alpha: float
    lambda_n: np.ndarray
    lambda_t: np.ndarray
    family: object = None


@dataclass
class Graph:
    """The paper's Example 6.1 in closed form, sharing nothing with the package but the problem."""

    problem: object
    interval: tuple = (0.0, 20.0)
    arcs: tuple = field(init=False)
    vertices: tuple = field(init=False)
    branches: tuple = field(init=False)
    complete: bool = True
    reasons: tuple = ()

    def __post_init__(self):
        fold = 8 / 3
        forces = [lambda a: (0.0, 0.0), lambda a: (1.5, -4.0), lambda a: (1 / (a - 2), -a / (a - 2))]
        ends = [(0, forces[0]), (20, forces[0]), (fold, forces[1]), (20, forces[1]), (20, forces[2])]
        self.vertices = tuple(
            Vertex(k, float(a), *(np.array([value]) for value in force(a))) for k, (a, force) in enumerate(ends)
        )
        self.arcs = (
            Arc(0, (OPEN,), 0.0, 20.0, 0, 1, forces[0]),
            Arc(1, (STICK,), fold, 20.0, 2, 3, forces[1]),
            Arc(2, (MINUS,), fold, 20.0, 2, 4, forces[2]),
        )
        self.branches = tuple(
            SimpleNamespace(number=k, arcs=arcs) for k, arcs in ((0, self.arcs[:1]), (1, self.arcs[1:]))
        )

    def starting_points(self):
        roots = enumerate_roots(self.problem, 5.0)
        return [next(r for r in roots if r.statuses[0] is s) for s in (OPEN, MINUS)]


@pytest.fixture
def graph():
    return Graph(gallery.one_node_triangle())


@pytest.fixture
def path(graph):
    return follow(graph.problem, newton(graph.problem, 5.0, [1.5, -4.0]), -1, (0, 20))


def test_points_lie_on_the_closed_form(graph, path):
    report = audit(path, graph)
    assert report.ok
    assert report.max_distance < 1e-12
    assert report.visited == {1, 2}


def test_missed_branch_is_named(graph, path):
    report = audit(path, graph)
    assert not report.complete
    (missed,) = report.missed
    assert (missed.arc, missed.branch, missed.interval) == (0, 0, (0.0, 20.0))
    assert "arc 0 of branch 0" in repr(report)


def test_planted_jump_is_found_and_located(graph, path, tmp_path):
    frame = path.to_frame()
    late = frame.index[frame["alpha"].gt(10) & frame["status_0"].eq("slip-")]
    frame.loc[late, ["lambda_n_0", "lambda_t_0"]] = 0.0
    frame.to_csv(tmp_path / "points.csv", index=False)
    report = audit(tmp_path / "points.csv", graph)
    assert not report.ok
    assert not report.off
    (jump,) = report.jumps
    assert jump.branches == (1, 0)
    assert jump.point == late[0] - 1
    assert jump.alpha[0] < 10 < jump.alpha[1]
    assert jump.way == np.inf
    assert report.to_frame()["jump"].sum() == 1


def test_jump_of_the_printed_algorithm_is_found(graph, path):
    """With long steps and without checks, corrections beyond the fold converge to the open branch."""
    options = ContinuationOptions(check_steps=False, h_max=0.5)
    jumped = follow(graph.problem, path[0], -1, (0, 20), options)
    (jump,) = audit(jumped, graph).jumps
    assert jump.branches == (1, 0)
    assert jump.alpha[1] < 8 / 3 < jump.alpha[0]
    assert audit(follow(graph.problem, path[0], -1, (0, 20), ContinuationOptions(h_max=0.5)), graph).ok


def test_planted_wrong_point_is_off(graph, path):
    frame = path.to_frame()
    frame.loc[3, "lambda_n_0"] += 1e-3
    report = audit(frame, graph)
    assert report.off == (3,)
    assert report.distances[3] > 1e-4


def test_every_half_of_the_path_misses_an_arc(graph, path):
    half = path.to_frame().iloc[: path.folds[0].point]
    assert {item.arc for item in audit(half, graph).missed} == {0, 2}


def test_follow_all_with_the_closed_form(graph):
    result = follow_all(graph.problem, (0, 20), graph=graph)
    assert result.complete
    assert result.reseeded == 0
    assert not result.failures
    assert result.stats.accepted > 0


def test_follow_all_makes_its_own_graph_and_tells_how_many_arcs_it_has_visited():
    told = []
    result = follow_all(gallery.one_node_triangle(), (0, 20), progress=lambda *at: told.append(at))
    assert result.complete
    assert [of for _, of in told] == [len(result.graph.arcs)] * len(result.paths)
    assert told[-1][0] == len(result.graph.arcs)
    assert sorted(told) == told


def test_follow_all_keeps_what_failed(graph):
    result = follow_all(graph.problem, (0, 20), ContinuationOptions(max_steps=2), graph=graph)
    # every arc is on some path all the same: paths begin again on those that are missing
    assert result.complete
    assert result.reseeded > 0
    assert len(result.failures) == sum(path.status.value == "step limit" for path in result.paths) > 0
    bad_argument(
        "graph has 1 contact nodes; expected the problem's 2",
        follow_all,
        gallery.two_node_square(),
        (0, 20),
        graph=graph,
    )


@pytest.mark.parametrize(
    ("source", "message"), [(3, "path is a int"), ("missing.csv", "CSV"), ("frame", "no column 'lambda_t_0'")]
)
def test_bad_arguments(graph, path, source, message):
    given = path.to_frame().drop(columns="lambda_t_0") if source == "frame" else source
    bad_argument(message, audit, given, graph)


def test_a_graph_that_does_not_say_whether_it_is_complete_is_refused(graph, path):
    parts = {name: getattr(graph, name) for name in ("problem", "interval", "arcs", "vertices", "branches", "complete")}
    bad_argument("graph is a SimpleNamespace, which has no reasons", audit, path, SimpleNamespace(**parts))


class TestBranchGraph:
    """Against the exact branch graphs."""

    @pytest.mark.few(0, 1)
    @pytest.mark.parametrize("loading", [False, True])
    @pytest.mark.parametrize("seed", range(5))
    def test_follow_all_visits_every_arc(self, seed, loading):
        problem = stable_problem(seed, loading)
        interval = (-5.0, 5.0) if loading else (0.0, 20.0)
        result = follow_all(problem, interval, graph=branch_graph(problem, interval))
        assert result.complete
        assert result.report.max_distance < 1e-8

    @pytest.mark.few(0, 2)
    @pytest.mark.parametrize(
        "name", ["one-node-6.1", "one-node-6.2", "two-node-6.4", "two-node-6.5", "chain-2-coupled"]
    )
    def test_gallery(self, name):
        problem = gallery.get(name).build()
        result = follow_all(problem, (0.0, 8.0), graph=branch_graph(problem, (0.0, 8.0)))
        assert result.complete
        assert not result.failures

    def test_every_arc_at_the_vertical_segment_can_be_taken(self):
        problem = gallery.get("one-node-6.3").build()
        graph = branch_graph(problem, (0.0, 20.0))
        (family,) = [v for v in graph.vertices if v.family is not None]
        meeting = [arc for arc in graph.arcs if family.number in (arc.tail, arc.head)]
        assert len(meeting) == 3
        for arc in meeting:
            path = follow_arc(problem, graph, family.number, arc.number)
            assert path[0].statuses == arc.statuses
            assert path.alpha[-1] == (20 if arc.tail == family.number else 0)
        result = follow_all(problem, (0.0, 20.0), graph=graph)
        assert result.complete

    @pytest.mark.parametrize("nodes", [1, 2, 3])
    def test_distances_from_sheets(self, nodes):
        """Nodes at which slip is singular for F = 2, and one that is not: polytopes of up to two dimensions."""
        slopes = [[1.0, -2.0], [1.0, 0.5], [2.0, -4.0]][:nodes]
        load = [0.0, 0.0, 1.0, -1.0, 0.0, 0.0][: 2 * nodes]
        A, rows = np.kron(np.eye(nodes), [[2.0, -1.0], [-1.0, 2.0]]), np.eye(2 * nodes)
        problem = enumsol.ContactProblem(A, rows[0::2], rows[1::2], load, friction=2.0, load_slope=np.ravel(slopes))
        graph = branch_graph(problem, (0.25, 2.0), "exact")
        assert max(arc.dimension for arc in graph.sheets) == (2 if nodes == 3 else 1)
        chart, rng = GraphMap(graph, 1e-5), np.random.default_rng(nodes)
        for sheet in graph.sheets:
            for alpha in rng.uniform(sheet.lo, sheet.hi, 4):
                polytopes = [part for family in graph.roots_at(float(alpha)).families for part in family.polytopes]
                for part in polytopes:
                    inside = np.tensordot(rng.dirichlet(np.ones(len(part.vertices))), part.vertices, 1)
                    for size in (0.0, 0.02, 0.5):
                        point = inside + size * rng.normal(size=inside.shape) * chart.equation.force.reshape(2, -1).T
                        x = chart.point(alpha, point[:, 0], point[:, 1])
                        found = min(chart.arc_distance(x, arc) for arc in graph.sheets if arc.lo <= alpha <= arc.hi)
                        assert found == pytest.approx(
                            min(hull_distance(chart, alpha, x, p) for p in polytopes), abs=1e-7
                        )
                        assert found < 1e-8 or size

    def test_every_arc_at_a_bifurcation_can_be_taken(self):
        problem = gallery.get("chain-2").build()
        graph = branch_graph(problem, (0.0, 6.0))
        (vertex,) = graph.bifurcations
        for arc in graph.arcs:
            if vertex.number in (arc.tail, arc.head):
                path = follow_arc(problem, graph, vertex.number, arc.number)
                assert path[1].statuses == arc.statuses
                assert path.alpha[0] == pytest.approx(8 / 3)
        bad_argument("not an arc", follow_arc, problem, graph, vertex.number, 10_000)


def hull_distance(chart, alpha, x, polytope):
    """Distance from the vertices' convex combinations by a general method."""
    from scipy.optimize import LinearConstraint, minimize

    corners = np.array([chart.point(alpha, corner[:, 0], corner[:, 1]) for corner in polytope.vertices])
    count = len(corners)
    done = minimize(
        lambda share: chart.equation.norm(share @ corners - x) ** 2,
        np.full(count, 1 / count),
        bounds=[(0, 1)] * count,
        constraints=[LinearConstraint(np.ones(count), 1, 1)],
        options={"ftol": 1e-18, "maxiter": 1000},
    )
    return chart.equation.norm(done.x @ corners - x)
