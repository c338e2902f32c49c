"""Pieces of the interval without a tree: arcs are proven to hold all solutions there (theory, section 7.15)."""

from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction

import numpy as np
import pytest
from branches.test_lower_bounds import KINDS, case, padded
from complete import complete_report, proven_graph, whole_graph
from effort import some
from generators import through_the_unloaded_state
from interruptions import CtrlC, interrupted
from path_problems import generic_problem
from trees import by_the_tree

import enumsol.branches.enclosed.single_branches
from enumsol import branch_graph, enumerate_roots, gallery, verify
from enumsol.branches.enclosed.following import TracedProblem
from enumsol.branches.enclosed.single_branches import ClosedPieces
from enumsol.condensation.data import EXACT_DOF_LIMIT
from enumsol.condensation.unloaded import vanishing_alpha
from enumsol.trusted.arcs.only_branch import only_roots
from enumsol.trusted.over_interval import PieceNumbers


@pytest.fixture(autouse=True, scope="module")
def patient():
    """Small bodies are tried as often as large ones."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("enumsol.branches.enclosed.single_branches._VAIN_TRIES", 100)
        yield


def traced(problem, interval):
    return TracedProblem(problem, tuple(map(Fraction, interval)), vanishing_alpha(problem, "problem"))


def assert_as_by_the_tree(problem, interval, graph):
    """A graph whose arcs are proven without a tree has the arcs and the vertices of that by the tree alone."""
    with by_the_tree():
        other = branch_graph(problem, interval)
    assert graph.stats.nodes == 0 < graph.stats.closed
    assert other.stats.closed == 0 < other.stats.nodes
    arcs, others = ([(arc.statuses, arc.index, arc.tail, arc.head) for arc in one.arcs] for one in (graph, other))
    assert arcs == others
    assert [v.kind for v in graph.vertices] == [v.kind for v in other.vertices]
    assert np.allclose([v.alpha for v in graph.vertices], [v.alpha for v in other.vertices], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    ("traction", "length", "interval"),
    [((0.3, -1.0), 1.0, (0, 3)), ((1.0, -0.3), 2.0, (0, 1)), ((0.0, -1.0), 1.0, (0.5, 5)), ((-0.3, -1.0), 1.0, (0, 1))],
)
def test_blocks_need_no_tree(traction, length, interval):
    problem = gallery.clamped_block(8, 4, length, traction=traction)
    graph = whole_graph(problem, interval)
    assert_as_by_the_tree(problem, interval, graph)
    report = complete_report(problem, graph.proof)
    assert (report.closed, report.leaves) == (graph.stats.closed, 0)
    assert "with one solution, by one certificate" in repr(report)


@pytest.mark.slow
def test_numbers_are_sought_where_plain_ones_do_not_serve():
    problem = gallery.clamped_block(32, 16, 0.5, traction=(1.0, -0.3))
    graph = proven_graph(problem, (1, 2))
    assert graph.stats.nodes == 0
    assert any(np.any(found.closed.numbers.nu) for found in graph.pieces if found.closed is not None)


def test_a_load_that_vanishes_inside():
    small, interval = through_the_unloaded_state()
    body = padded(small.replace(friction=0.5), 25)
    assert_as_by_the_tree(body, interval, proven_graph(body, interval))


def check(seeds):
    """Graphs of random problems against exact ones; the numbers of graphs and of those with closed pieces."""
    graphs = closed = 0
    for seed in seeds:
        problem, interval = case(seed)
        body = padded(problem, 25)
        graph, exact = branch_graph(body, interval), branch_graph(problem, interval, "exact")
        steps, true = graph.claims.steps(), exact.claims.steps()
        if graph.complete:
            assert (steps.at, steps.between) == (true.at, true.between), seed
            assert np.allclose([float(x) for x in steps.alphas], [float(x) for x in true.alphas], atol=1e-9), seed
        if graph.proof is not None:
            assert verify(body, graph.proof).ok, seed
        graphs += 1
        closed += graph.stats.closed > 0
    return graphs, closed


def test_counts_are_the_exact_ones():
    graphs, closed = check(range(300, some(303, of=310)))
    assert closed > 0.4 * graphs


def only_where_alone(seed, count):
    """Whether what the kernel says is true, whatever the numbers; how often it said yes, and of several solutions."""
    rng = np.random.default_rng([15, seed])
    yes = several = 0
    for k in range(count):
        problem = (
            generic_problem(rng, int(rng.integers(1, 4)), KINDS[k % 3]) if k % 2 else case(int(rng.integers(10**6)))[0]
        )
        interval = Fraction(0), Fraction(int(rng.integers(2, 9)))
        bodies, graph = traced(problem, interval), branch_graph(problem, interval, "exact")
        for _ in range(10):
            alpha = interval[1] * Fraction(int(rng.integers(1, 64)), 64)
            if alpha == bodies.origin:
                continue
            side = 0.0 if bodies.origin is None else 1.0 if alpha > bodies.origin else -1.0
            number = graph.multiplicity_at(alpha)
            for arc in [a for a in graph.arcs if a.interval[0] < alpha < a.interval[1]]:
                reach = (arc.interval[1] - arc.interval[0]) * 10.0 ** -rng.uniform(0, 6)
                low, high = max(float(alpha) - reach, arc.interval[0]), min(float(alpha) + reach, arc.interval[1])
                mu, kappa = np.exp(rng.normal(size=(2, problem.p)) * rng.choice([0.0, 0.3, 1.0]))
                F = np.maximum(problem.friction_at(low), problem.friction_at(high))
                nu = rng.choice([0.0, 1.0]) * mu / np.where(F > 0, F, 1.0) * rng.uniform(-1, 1, size=problem.p)
                selection = bodies.selection(arc.selections[0], side)
                (alone,) = only_roots([(selection, low, high)], PieceNumbers(mu, kappa, nu))
                assert not alone or number == 1, (seed, k, float(alpha))
                yes += alone
                several += number > 1
    return yes, several


@pytest.mark.slow
def test_what_the_kernel_says_is_true():
    yes, several = only_where_alone(2, some(8, of=70))
    assert yes > some(8, of=100)
    assert several > some(1, of=25)


def test_numbers_that_are_too_large_are_refused():
    problem = gallery.clamped_block(4, 2)
    body, chain = traced(problem, (0, 1)), branch_graph(problem, (0, 1)).arcs[-1]
    asked = [(body.selection(chain.selections[0], 0.0), *chain.interval)]
    one = np.ones(problem.p)
    numbers = PieceNumbers(one, one, 0.0 * one), PieceNumbers(one, one, 2.0 * one), PieceNumbers(one, 1e6 * one, one)
    assert [only_roots(asked, each) for each in numbers] == [[True], [False], [False]]
    assert PieceNumbers.of(np.concatenate([one, one, -one]), np.zeros(0)).degree == 1
    for bad in ((one, 0.0 * one, one), (np.inf * one, one, one)):
        with pytest.raises(ValueError, match="not positive"):
            PieceNumbers.of(np.concatenate(bad), np.zeros(0))


def test_the_same_with_workers():
    """Some pieces closed, others searched by trees in workers."""
    problem = padded(gallery.get("two-node-6.4").build(), 25)
    graph = branch_graph(problem, (0, 5))
    assert graph.stats.nodes > 0 < graph.stats.closed
    with ThreadPoolExecutor(2) as executor:
        other = branch_graph(problem, (0, 5), executor=executor)
    assert (graph.stats.pieces, graph.stats.nodes) == (other.stats.pieces, other.stats.nodes)
    assert list(graph.proof.records()) == list(other.proof.records())


def test_an_interruption_claims_nothing(monkeypatch):
    monkeypatch.setattr(enumsol.branches.enclosed.single_branches, "only_roots", CtrlC())
    partial = interrupted("interrupted", branch_graph, gallery.clamped_block(8, 4), (0, 3))
    assert not partial.complete
    assert partial.proof is None


def test_the_time_may_be_over_at_once():
    graph = branch_graph(gallery.clamped_block(8, 4), (0, 3), time_limit=1e-9)
    assert not graph.complete
    assert all(graph.at_least(alpha) == 1 for alpha in (0, 1, 3))


@pytest.mark.parametrize("seed", range(4))
def test_closed_pieces_have_one_solution(seed):
    """Also where several conditions vanish at once, without degrees of freedom beside the contact nodes."""
    problem, interval = case(500 + seed)
    closed = ClosedPieces()
    closed.find(traced(problem, interval))
    with by_the_tree():
        for piece in closed.pieces:
            for alpha in (piece.a, piece.middle, piece.b):
                assert len(enumerate_roots(problem, alpha, "exact")) == 1, (seed, float(alpha))


def test_large_bodies_need_no_many_digits(monkeypatch):
    """Where balls in double arithmetic decide everything: with many digits a graph took up to 27 times as long."""
    monkeypatch.setattr("enumsol.trusted.arcs.precise.refined_table", lambda _: pytest.fail("asked for many digits"))
    block = gallery.clamped_block(16, 8)
    assert block.n > EXACT_DOF_LIMIT
    graph = whole_graph(block, (0, 1))
    assert graph.stats.closed > 0
