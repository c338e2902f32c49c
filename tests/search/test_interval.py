"""The search over an interval: what it may exclude, and what it says when it is stopped."""

from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from flint import fmpq
from interruptions import CtrlC, interrupted
from path_problems import generic_problem, one_node
from refusals import bad_argument, refusal

from enumsol import ContactProblem, gallery
from enumsol.branches import branch_graph, ways
from enumsol.branches.gluing import glue
from enumsol.branches.known_selections import KnownSelections
from enumsol.condensation.exact import ExactCondensed
from enumsol.errors import IncompleteGraphError, TooLargeError
from enumsol.model.statuses import CONTACT, OPEN, SLIP_MINUS, SLIP_PLUS, STICK, UNDECIDED
from enumsol.relaxation.active_set import ActiveSetEngine, IntervalSystem
from enumsol.search import subintervals as interval_search
from enumsol.search.certifiers.interval_certifiers import ExactIntervalCertifier, VerifiedIntervalCertifier
from enumsol.search.interval_tree import EmptyLeaf
from enumsol.search.subintervals import IntervalCertifier, IntervalSearch, Piece

BELOW = {UNDECIDED: (OPEN, STICK, SLIP_PLUS, SLIP_MINUS), CONTACT: (STICK, SLIP_PLUS, SLIP_MINUS)}


def searched(problem, end, certifier=None, **options):
    """A search over [0, end], which has been run."""
    ends = Fraction(0), Fraction(end)
    search = IntervalSearch(problem.condensed, ends, None, certifier or IntervalCertifier(), **options)
    search.run()
    return search


def below(codes):
    """Complete selections under a partial assignment."""
    return set(product(*(BELOW.get(code, (code,)) for code in codes)))


@pytest.mark.parametrize("largest", [3, 2048])
@pytest.mark.parametrize("kind", ["friction", "load", "both"])
def test_leaves_cover_all_selections_over_the_whole_interval(kind, largest, monkeypatch):
    monkeypatch.setattr(interval_search, "LARGEST_TREE", largest)
    rng = np.random.default_rng(7)
    for _ in range(6):
        search = searched(generic_problem(rng, 3, kind), 6)
        everything = set(product(range(4), repeat=3))
        for alpha in map(Fraction, rng.uniform(0.0, 6.0, size=20)):
            over = [part for part in search.pieces if part.piece.a <= alpha <= part.piece.b]
            leaves = [below(leaf.codes) for part in over for leaf in part.empty]
            leaves += [{codes} for part in over for codes in part.selections]
            assert set().union(*leaves) == everything


@pytest.mark.parametrize("kind", ["friction", "load", "both"])
def test_every_leaf_the_engine_prunes_is_proven_in_rationals(kind):
    rng = np.random.default_rng(11)
    for _ in range(5):
        problem = generic_problem(rng, 3, kind)
        certifier = ExactIntervalCertifier(ExactCondensed.from_problem(problem))
        for part in searched(problem, 6).pieces:
            for leaf in part.empty:
                assert certifier.excluded(part.piece, part.system, leaf)


def test_many_selections_at_one_alpha_are_handed_on_once():
    """Seven nodes of a wedge that slides in lift off at one alpha: 128 selections hold there and nowhere else."""
    w = gallery.wedge(4, 7, (4e-4, 1e-3))
    problem = ContactProblem(w.A, w.Bn, w.Bt, 0 * w.f, gap=w.gap, friction=2.2, load_slope=w.f)
    search = searched(problem, 1, VerifiedIntervalCertifier(problem, ExactCondensed.from_condensed(problem), None))
    assert len(search.selections) >= 128
    assert sum(len(part.selections) for part in search.pieces) <= 1.2 * len(search.selections)
    assert len(search.pieces) < 40


def test_a_limit_on_nodes_is_kept_to():
    problem = gallery.get("wedge-8-5").build()
    for most in (1, 10, 100, 500):
        search = searched(problem, 5, max_nodes=most)
        assert search.stopped
        assert most <= search.nodes <= most + 4
        # what was not examined is still there
        assert search.pieces[-1].cut


def test_a_leaf_that_holds_a_solution_cannot_be_excluded(rng):
    problem = one_node((1.5, -4.0))
    certifier = ExactIntervalCertifier(ExactCondensed.from_problem(problem))
    piece = Piece(Fraction(2), Fraction(4))
    system = IntervalSystem.from_problem(problem.condensed, 2.0, 4.0, None)
    for codes in ((OPEN,), (STICK,), (SLIP_MINUS,), (CONTACT,), (UNDECIDED,)):
        for _ in range(200):
            values = rng.normal(size=9) * 10.0 ** rng.uniform(-3, 2)
            assert not certifier.excluded(piece, system, EmptyLeaf(codes, np.arange(9), values))


def test_the_relaxation_on_a_loading_path_bounds_the_energy_from_below(rng):
    """With no rows on, the minimum over [a, b] is no larger than the least minimum at fixed alphas."""
    for _ in range(10):
        problem = generic_problem(rng, 2, "load")
        system = IntervalSystem.from_problem(problem.condensed, 1.0, 2.0, None)
        relaxation = ActiveSetEngine.over(system).root([], [])
        loads = [system.g + tau * system.half for tau in np.linspace(-1, 1, 21)]
        least = min(-0.25 * g @ np.linalg.solve(system.S, g) for g in loads)
        assert relaxation.bound <= least + 1e-12
        assert relaxation.bound >= least - 0.26 * system.half @ np.linalg.solve(system.S, system.half) - 2e-3


def test_a_stopped_search_is_not_complete():
    problem = gallery.get("wedge-8-3").build()
    graph = branch_graph(problem, (0.0, 5.0), max_nodes=50)
    assert (graph.complete, graph.roots_at(1.0).complete) == (False, False)
    assert "max_nodes = 50" in graph.closing_line
    graph = branch_graph(problem, (0.0, 5.0), time_limit=1e-9)
    assert "time limit" in graph.closing_line


def test_bad_arguments_are_refused_by_name():
    problem = one_node((1.5, -4.0))
    for interval in ((1.0, 1.0), (2.0, 1.0), (0.0,), 3.0):
        bad_argument("interval", branch_graph, problem, interval)
    bad_argument(r"interval\[1\] is inf", branch_graph, problem, (0.0, np.inf))
    bad_argument("arithmetic", branch_graph, problem, (0.0, 1.0), "sloppy")
    bad_argument("max_nodes", branch_graph, problem, (0.0, 1.0), max_nodes=0)
    bad_argument("time_limit", branch_graph, problem, (0.0, 1.0), time_limit=0.0)
    bad_argument("ContactProblem", branch_graph, None, (0.0, 1.0))
    refusal(TooLargeError, "exact", branch_graph, gallery.clamped_block(16, 16, contact=2), (0.0, 1.0), "exact")


def test_negative_friction_in_the_interval_is_refused_with_node_and_alpha():
    bad_argument(r"node 0 .* alpha = -1 .*zero at alpha = 0", branch_graph, one_node((1.5, -4.0)), (-1.0, 1.0))
    falling = one_node((1.5, -4.0), friction=4.0, friction_slope=-1.0)
    bad_argument(r"node 0 .* alpha = 5 .*zero at alpha = 4", branch_graph, falling, (0.0, 5.0))
    branch_graph(falling, (0.0, 4.0))


def test_progress_reaches_the_end_of_both_stages():
    seen = {}
    branch_graph(gallery.get("two-node-6.4").build(), (0.0, 8.0), progress=lambda *state: seen.update([state]))
    assert seen == {"search": 1.0, "arcs": 1.0}


@pytest.mark.parametrize("seed", range(8))
def test_a_selection_left_out_by_the_search_is_noticed(seed):
    """Gluing finds it by the statuses that hold at a neighbour's end, unless it has no neighbour at all."""
    rng = np.random.default_rng(seed)
    problem = generic_problem(rng, 3, ("friction", "load", "both")[seed % 3])
    graph = branch_graph(problem, (0.0, 6.0), "exact")
    present = {codes for arc in graph.arcs for codes in arc.selections}
    for codes in present:
        known = KnownSelections(graph.exact, fmpq(0), fmpq(6), cut_short=False)
        glue(known, present - {codes})
        neighbours = any(codes in v.selections and len(v.selections) > 1 for v in graph.vertices)
        assert bool(known.reasons) == neighbours


def test_an_interrupted_search_keeps_its_arcs():
    stop = CtrlC(lambda stage, share: stage == "search", call=2)
    partial = interrupted("interrupted", branch_graph, gallery.get("wedge-8-5").build(), (0.0, 5.0), progress=stop)
    assert partial.arcs
    assert (partial.complete, partial.proof) == (False, None)
    assert any("interrupted" in reason for reason in partial.reasons)


@pytest.mark.parametrize(("boxes", "followed"), [(500, False), (1, True)])
def test_after_an_interrupted_search_not_all_is_followed(boxes, followed, tree_only, monkeypatch):
    """Only until so many boxes are made, and the graph says so."""
    monkeypatch.setattr(ways, "_BOXES_AFTER_INTERRUPT", boxes)
    stop = CtrlC(lambda stage, share: stage == "search", call=4)
    partial = interrupted("interrupted", branch_graph, gallery.get("wedge-8-3").build(), (0.0, 3.0), progress=stop)
    reasons = partial.reasons
    assert any("interrupted after" in reason and "nodes" in reason for reason in reasons)
    assert any("the arcs of 8 of" in reason for reason in reasons) == followed
    assert partial.arcs


@pytest.mark.few(0, 3)
@pytest.mark.parametrize("nodes", [20, 60, 150, 300, 600])
@pytest.mark.parametrize("name", ["chain-4", "chain-4-coupled", "two-node-6.4"])
def test_a_graph_cut_short_says_what_it_found_and_no_more(name, nodes):
    graph = branch_graph(gallery.get(name).build(), (0.0, 5.0), "fast", max_nodes=nodes)
    assert all(0 <= arc.tail < len(graph.vertices) and 0 <= arc.head < len(graph.vertices) for arc in graph.arcs)
    assert not graph.complete
    assert repr(graph).splitlines()[-1].startswith("complete: ")
    steps = graph.claims.steps()
    assert (len(steps.alphas), steps.exact) == (len(steps.at), not graph.reasons)
    if graph.reasons:
        for question in ("steps", "uniqueness_limit"):
            refusal(IncompleteGraphError, "not complete", getattr, graph, question)


@pytest.mark.few(0, 2)
@pytest.mark.parametrize("name", ["two-node-6.4", "chain-4", "one-node-6.3"])
def test_a_selection_that_the_search_left_out_is_taken_in_and_told(name):
    problem = gallery.get(name).build()
    whole = branch_graph(problem, (0.0, 5.0), "exact")
    selections = {codes for arc in whole.arcs for codes in arc.selections}
    for missing in sorted(selections)[:: max(1, len(selections) // 6)]:
        known, short = (
            KnownSelections(whole.exact, fmpq(0), fmpq(5), cut_short=cut_short) for cut_short in (False, True)
        )
        (_, arcs, _), (_, few, _) = (glue(given, selections - {missing}) for given in (known, short))
        assert any("left out" in reason for reason in known.reasons) or missing not in known.arcs
        assert all(arc.tail >= 0 and arc.head >= 0 for arc in (*arcs, *few))
        assert missing not in known.arcs or len(arcs) == len(whole.arcs)
        assert missing not in short.arcs
