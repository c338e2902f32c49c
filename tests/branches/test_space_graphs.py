"""Branch graphs of problems in 3D (theory, sections 12.9 and 12.10)."""

import re
from dataclasses import replace
from fractions import Fraction
from functools import partial
from itertools import count, pairwise, product
from math import sqrt
from types import SimpleNamespace

import numpy as np
import pytest
from alike import assert_same
from complete import all_roots, complete_report, graph_over_alpha, only_root, read_back, whole_graph
from effort import some
from interruptions import CtrlC, interrupted
from problems3d import (
    SLIDING,
    OneNode,
    forces,
    from_compliance,
    in_space,
    random_compliance,
    random_over_alpha,
    random_plane_over_alpha,
    sliding_node,
)
from refusals import bad_argument, refusal

import enumsol
from enumsol.arithmetic.balls import Ball
from enumsol.branches.claims import uniqueness_bound
from enumsol.branches.elements import VertexKind
from enumsol.branches.space import chains, pieces, space_graph
from enumsol.branches.space.chains import chain_through
from enumsol.branches.space.make_curved import unordered
from enumsol.branches.space.pieces import runs_and_turns
from enumsol.continuation.path_data import PathStatus
from enumsol.search.space.curve_proposals import border_of_zeta, curve_point, placed, unplaced
from enumsol.support.deadlines import Deadline, TimeOverError, within
from enumsol.trusted.space.curve_parts import CurveMotion, Run, Turn, orders
from enumsol.trusted.space.curve_runs import CurveChain
from enumsol.trusted.space.sector_rows import OPEN, STICK
from enumsol.trusted.space.solution_curve import SLIP, AlphaProblem

#: SLIDING sticks as soon as alpha is the length of (3/2, 1).
STUCK = sqrt(3.25)
SLIPPING, STICKING = enumsol.ContactStatus.SLIP, enumsol.ContactStatus.STICK


@pytest.fixture(scope="module")
def graph():
    return enumsol.branch_graph(SLIDING, (1.78, 1.82), max_nodes=60)


def test_a_node_that_slips_until_it_sticks(graph):
    assert graph.complete
    assert [v.kind for v in graph.vertices] == ["end", "transition", "end"]
    vertex = graph.transitions[0]
    low, high = vertex.enclosure
    assert low**2 < Fraction(13, 4) < high**2
    assert high - low < 1e-8
    assert vertex.active == (frozenset({SLIPPING, STICKING}),)
    assert vertex.lambda_t == pytest.approx(np.array([[1.5, 1.0]]), abs=1e-8)
    assert [arc.statuses for arc in graph.arcs] == [(SLIPPING,), (STICKING,)]
    assert {(arc.index, arc.grazing) for arc in graph.arcs} == {(1, False)}
    assert len(graph.branches) == len(graph.components) == 1
    assert graph.multiplicity_at(1.8) == graph.at_least(1.8) == 1
    assert graph.uniqueness_limit is None
    assert graph.steps[1:] == ([1, 1, 1], [1, 1])


def test_below_the_bound_of_the_stiffness_there_is_one_root():
    """For one node by its closed form, and for random ones, orthotropic, by enumeration (theory, (5.9))."""
    S = np.array([[2.0, 0.5, 0.0], [0.5, 3.0, 0.0], [0.0, 0.0, 1.0]])
    one = from_compliance(S, np.ones(3), (0.1, 0.2), friction_slope=(0.5, 0.25))
    inverse = 3.0 / (2.0 * 3.0 - 0.25)  # of S, in the normal component
    expected = min((1 / sqrt(inverse * 3.0) - F0) / F1 for F0, F1 in ((0.1, 0.5), (0.2, 0.25)))
    assert uniqueness_bound(one, (0.0, 9.0)) == pytest.approx(expected)
    assert uniqueness_bound(one, (0.0, 0.25)) == 0.25
    assert uniqueness_bound(one, (2.0, 3.0)) is None
    rng = np.random.default_rng(5)
    for _ in range(some(5, of=60)):
        p = int(rng.integers(1, 3))
        slope = tuple(rng.uniform(0.2, 1.0, (2, p)))
        g = rng.normal(size=3 * p) * 3
        problem = from_compliance(random_compliance(rng, p), g, 0.0, friction_slope=slope)
        bound = uniqueness_bound(problem, (0.0, 100.0))
        only_root(problem, 0.999 * bound)


def test_values_along_arcs_are_those_of_the_closed_form(graph):
    for alpha in (1.78, 1.795, 1.8025):
        n, t = graph.arcs[0].values(alpha)
        assert [*n, *t[0]] == pytest.approx(sliding_node(alpha), abs=1e-12)
        u_n, u_t = graph.arcs[0].displacements(alpha)
        assert u_n.tolist() == [0.0]
        assert u_t[0] == pytest.approx([3.0 - 2.0 * t[0, 0], 4.0 - 4.0 * t[0, 1]], abs=1e-12)
    assert graph.arcs[1].displacements(1.805)[1].tolist() == [[0.0, 0.0]]


def test_roots_are_those_of_a_search(graph):
    for alpha in (1.78, 1.8, 1.82):
        found, known = graph.roots_at(alpha), enumsol.enumerate_roots(SLIDING, alpha)
        assert found.complete
        assert [root.index for root in found] == [root.index for root in known] == [1]
        assert found[0].lambda_t == pytest.approx(known[0].lambda_t, abs=1e-12)
        assert found[0].statuses == known[0].statuses
    assert [root.statuses for root in graph.starting_points()] in ([(SLIPPING,)], [(STICKING,)])


def test_roots_within_the_bounds_of_a_vertex_are_undecided(graph):
    found = graph.roots_at(float(graph.transitions[0].exact))
    assert not found.complete
    assert len(found.undecided) == 1
    assert found.at_least == 1


@pytest.mark.slow
def test_the_only_solutions_of_pieces_lie_on_a_curve_that_passes_all_of_them():
    problem = enumsol.gallery.block3d(1, 1, 1)
    graph = whole_graph(problem, (0.5, 1.0))
    assert (complete_report(problem, graph.proof).curves, len(graph.branches)) == (1, 1)
    for alpha in (0.5, 0.7, 1.0):
        found, known = graph.roots_at(alpha), enumsol.enumerate_roots(problem, alpha)
        assert found.complete
        assert [root.statuses for root in found] == [root.statuses for root in known]
        assert found[0].lambda_t == pytest.approx(known[0].lambda_t, abs=1e-9)


def test_without_such_a_curve_that_they_are_the_only_ones_makes_no_graph(monkeypatch):
    problem = enumsol.gallery.block3d(1, 1, 1)
    monkeypatch.setattr(space_graph, "chain_through", lambda *_: None)
    graph = enumsol.branch_graph(problem, (0.5, 1.0), max_nodes=40)
    assert not graph.complete
    assert (graph.arcs, graph.at_least(0.75)) == ((), 1)


def test_its_proof_is_verified(graph):
    complete_report(SLIDING, graph.proof)


def test_files_frames_and_figures(graph, tmp_path):
    read = read_back(graph, tmp_path / "graph.json")
    assert read.complete
    assert_same(read, graph, "problem.fingerprint", "steps")
    for one, other in zip(graph.arcs, read.arcs, strict=True):
        assert np.array_equal(one.state(one.sample)[0], other.state(one.sample)[0])
    assert {"lambda_t1", "lambda_t2"} < set(graph.vertices_frame().columns)
    assert graph.to_frame()["statuses"].tolist() == ["slip", "stick"]
    graph.write_graphml(tmp_path / "graph.graphml")
    figure = graph.plot("lambda_t", nodes=[0], zoom=False)
    heights = [y for line in figure.axes[0].lines for y in np.asarray(line.get_ydata()).tolist()]
    assert max(heights) == pytest.approx(STUCK, abs=1e-6)


def test_a_damaged_file_is_refused(graph, tmp_path):
    place = tmp_path / "graph.json"
    graph.save(place)
    damaged = re.sub(r'"borders": \[\[', '"borders": [[0.0], [', place.read_text(encoding="utf-8"), count=1)
    place.write_text(damaged, encoding="utf-8")
    bad_argument("damaged", enumsol.BranchGraph.load, place)


def test_a_search_that_is_cut_short_is_not_complete():
    graph = enumsol.branch_graph(SLIDING, (1.78, 1.82), max_nodes=1)
    assert not graph.complete
    assert "max_nodes = 1" in graph.reasons[0] or graph.reasons[0].startswith("stopped")
    assert graph.proof is None
    refusal(enumsol.IncompleteGraphError, "not complete", graph.multiplicity_at, 1.8)


def test_what_was_found_is_kept_when_the_time_is_over_or_somebody_interrupts():
    graph = enumsol.branch_graph(SLIDING, (1.78, 1.82), time_limit=1e-9)
    assert not graph.complete
    assert "time limit" in graph.reasons[0]
    assert graph.at_least(1.8) in (0, 1)
    stop = CtrlC(lambda step, share: step == "arcs" or share > 0.5)
    partial = interrupted("kept", enumsol.branch_graph, SLIDING, (1.78, 1.82), max_nodes=60, progress=stop)
    assert not partial.complete
    assert partial.stats.nodes > 0
    assert f"interrupted after {partial.stats.nodes} nodes" in partial.reasons[0]
    assert partial.proof is None


@pytest.fixture(scope="module")
def two_curves():
    """A problem that has a curve through the whole interval and one that has a fold, and its graph."""
    return graph_over_alpha(2, 1)


def check_part(part, whole):
    """Arcs lie on those of the whole graph, each on one, and counts are lower bounds."""
    assert len(part.arcs) > 0
    for arc in part.arcs:
        forces = [other.state(arc.sample)[0] for other in whole.arcs if other.lo <= arc.sample <= other.hi]
        assert sum(bool(np.allclose(arc.state(arc.sample)[0], other, rtol=0, atol=1e-9)) for other in forces) == 1
    for alpha in np.linspace(0.01, 0.99, 21).tolist():
        over_alpha = [arc for arc in part.arcs if arc.lo < alpha < arc.hi]
        assert len(over_alpha) <= part.at_least(alpha) <= whole.multiplicity_at(alpha)


@pytest.mark.few(1, 3)
@pytest.mark.parametrize(
    ("where", "call"),
    [(chains, 20), (pieces, 8), (chains, 2), (pieces, 2)],
    ids=["second curve", "its arcs", "first curve", "arcs"],
)
@pytest.mark.parametrize("over", [TimeOverError, KeyboardInterrupt])
def test_what_is_known_of_a_curve_is_kept(where, call, over, two_curves, monkeypatch):
    problem, whole = two_curves
    calls = count()

    def look():
        if next(calls) >= call:
            raise over

    monkeypatch.setattr(where, "look", look)
    if over is TimeOverError:
        part = enumsol.branch_graph(problem, (0, 1))
        assert "the time" in part.reasons[0]
    else:
        part = interrupted("kept", enumsol.branch_graph, problem, (0, 1))
    assert not part.complete
    # the tree is searched before curves are cut into arcs
    assert (part.proof is None) == (where is chains or over is KeyboardInterrupt)
    check_part(part, whole)
    # an open end inside the interval is told
    ends = [v.alpha for v in part.vertices if v.kind is VertexKind.UNSETTLED]
    assert ends
    assert any("not followed beyond" in reason and f"{ends[0]:.5g}"[:4] in reason for reason in part.reasons)


def test_an_interruption_of_continuation_interrupts_the_graph(monkeypatch):
    def follow(*_):
        raise enumsol.Interrupted("follow was interrupted", None)

    monkeypatch.setattr(chains, "follow", follow)
    partial = interrupted("curves found so far", enumsol.branch_graph, SLIDING, (1.78, 1.82), max_nodes=60)
    assert (len(partial.arcs), partial.at_least(1.8)) == (0, 1)
    assert partial.open_ranges == (partial.exact_interval,)


def test_the_time_may_be_over_during_continuation(monkeypatch):
    deadline = Deadline()

    def end_time(*arguments):
        deadline.deadline = -1.0
        return follow(*arguments)

    follow = chains.follow
    monkeypatch.setattr(chains, "follow", end_time)
    given, interval = AlphaProblem.of(SLIDING.enclosure), (Fraction(49, 100), Fraction(51, 100))
    with within(deadline), pytest.raises(TimeOverError):
        chain_through(given, SLIDING, np.append(sliding_node(0.5), 0.5), interval)


@pytest.mark.slow
def test_a_curve_that_is_not_proven_to_be_whole_is_kept_as_far_as_it_is(two_curves, monkeypatch):
    problem, whole = two_curves
    follow = space_graph.chain_through

    def cut_short(*arguments):
        chain = follow(*arguments)
        if chain is None or chain.closed:
            return chain
        return CurveChain.of(chain.links[:-1], chain.joints[:-1], (Fraction(0), Fraction(1)))

    monkeypatch.setattr(space_graph, "chain_through", cut_short)
    part = enumsol.branch_graph(problem, (0, 1), max_nodes=100)
    assert not part.complete
    assert len(part.components) == 2
    assert part.at_least(0.6) == 3
    check_part(part, whole)
    report = enumsol.verify(problem, part.proof) if part.proof else None
    assert report is None or (report.ok and not report.complete)


def broken(chain, x, interval):
    """Links of a curve below alpha = 1, or above 1.1, on the side of a point x; none for one between these."""
    alphas = [float(joint.alphas[0]) for joint in chain.joints]
    kept = [k for k, alpha in enumerate(alphas) if (alpha > 1.1 if x[-1] > 1.1 else alpha < 1.0)]
    if len(kept) < 2 or 1.0 <= x[-1] <= 1.1:
        return None
    first, last = kept[0], kept[-1]
    return CurveChain.of(chain.links[first:last], chain.joints[first : last + 1], interval)


def test_beside_ends_of_curves_all_solutions_are_known(monkeypatch):
    """As if the curve could not be followed through its middle; the tree finds both parts."""
    follow, interval = space_graph.chain_through, (Fraction(1, 2), Fraction(3, 2))
    monkeypatch.setattr(chains, "_TRUST", 0.2)
    monkeypatch.setattr(space_graph, "chain_through", lambda *given: broken(follow(*given), given[2], interval))
    graph = enumsol.branch_graph(SLIDING, interval, max_nodes=200)
    ((low, high),) = graph.open_ranges
    assert 0.5 < low < high < 1.5
    (reason,) = graph.reasons
    assert "nothing is proven beyond 2 ends of curves there" in reason
    assert [v.kind for v in graph.vertices].count(VertexKind.UNSETTLED) == 2
    report = enumsol.verify(SLIDING, graph.proof)
    assert (report.ok, report.complete, report.curves) == (True, False, 2)
    assert report.open >= 3
    for alpha in (0.5, float(low) - 1e-6, float(high) + 1e-6, 1.5):
        assert graph.multiplicity_at(alpha) == len(all_roots(SLIDING, alpha)) == 1
    middle = float(low + high) / 2
    refusal(enumsol.IncompleteGraphError, "not complete", graph.multiplicity_at, middle)
    assert graph.at_least(middle) == 1


@pytest.mark.long
def test_beside_a_point_in_which_branches_of_a_symmetric_body_meet():
    """Seven solutions below, of which three become one there."""
    problem = enumsol.gallery.wedge3d(2, 2, 2)
    graph = enumsol.branch_graph(problem, ("0.8955", "0.8985"))
    ((low, high),) = graph.open_ranges
    assert high - low < 1e-6
    assert enumsol.verify(problem, graph.proof).ok
    for alpha, number in ((0.8955, 7), (float(low) - 1e-5, 7), (float(high) + 1e-5, 5), (0.8985, 5)):
        assert graph.multiplicity_at(alpha) == len(all_roots(problem, alpha)) == number


# -- what is left open -------------------------------------------------------------------------------------------------


def loaded_by_alpha():
    """One node under alpha times a load: it rests without load at alpha = 0, and slips everywhere else."""
    rows = np.eye(3)
    data = np.diag([1.0, 0.5, 0.25]), rows[:1], rows[1:2], rows[2:]
    return enumsol.ContactProblem3D(*data, np.zeros(3), friction=0.5, load_slope=np.array([1.0, 0.75, 0.25]))


@pytest.fixture(scope="module")
def through_zero():
    """Where no load acts it is left open what the curve does."""
    return enumsol.branch_graph(loaded_by_alpha(), (-0.25, 0.125))


def test_outside_of_ranges_that_are_left_open_all_solutions_are_known(through_zero):
    ((low, high),) = through_zero.open_ranges
    assert -0.01 < low < 0 < high < 0.01
    assert not through_zero.complete
    for alpha in (-0.25, -0.1, float(low) - 1e-9, float(high) + 1e-9, 0.125):
        known, found = enumsol.enumerate_roots(loaded_by_alpha(), alpha), through_zero.roots_at(alpha)
        assert known.complete
        assert found.complete
        assert through_zero.multiplicity_at(alpha) == len(found) == len(known) == 1
        assert found[0].statuses == known[0].statuses
    for alpha in (low, 0, high):
        assert through_zero.at_least(alpha) == 1
        refusal(enumsol.IncompleteGraphError, "at least 1", through_zero.multiplicity_at, alpha)
        assert not through_zero.roots_at(alpha).complete
    refusal(enumsol.IncompleteGraphError, "not complete", getattr, through_zero, "steps")


def test_ranges_that_are_left_open_are_told(through_zero, tmp_path):
    ((low, high),) = through_zero.open_ranges
    words = f"alpha in [{float(low):.8g}, {float(high):.8g}]"
    assert f"left open: {words}" in repr(through_zero)
    assert f"left open: {words}" in through_zero._repr_html_()
    assert f"all solutions are known but for {words}" in through_zero.claims.sentences(None)
    assert through_zero.summary()["open_ranges"] == [[float(low), float(high)]]
    read = read_back(through_zero, tmp_path / "graph.json")
    assert read.open_ranges == through_zero.open_ranges
    assert read.multiplicity_at(0.1) == 1


def test_figures_and_pages_show_ranges_that_are_left_open(through_zero, graph, tmp_path):
    shown = {}
    for name, found in (("open", through_zero), ("whole", graph)):
        figure = found.plot(zoom=False)
        labels = [text.get_text() for text in figure.legends[0].get_texts()]
        shown[name] = "solutions may be missing" in labels, [len(axis.patches) > 0 for axis in figure.axes[:1]]
        enumsol.write_report(found, tmp_path / f"{name}.html")
    assert shown == {"open": (True, [True]), "whole": (False, [False])}
    ((low, high),) = through_zero.open_ranges
    page = (tmp_path / "open.html").read_text(encoding="utf-8")
    words = f"alpha in [{float(low):.8g}, {float(high):.8g}]"
    assert f"may be missing for {words}, and only there" in page
    assert f"but for {words}" in page
    assert f'"open_ranges":[[{float(low)!r},{float(high)!r}]]' in page.replace(" ", "")
    page = (tmp_path / "whole.html").read_text(encoding="utf-8")
    assert '"open_ranges":[]' in page.replace(" ", "")


@pytest.mark.few(0, 3)
@pytest.mark.parametrize(("p", "seed"), [(2, 2), (1, 9), (2, 3), (2, 6), (2, 9), (2, 14), (2, 27), (2, 31)])
def test_counts_of_random_graphs_with_gaps_are_those_of_searches_elsewhere(p, seed, monkeypatch):
    """Pieces that are left open although shorter ones would decide them."""
    monkeypatch.setattr(space_graph, "PieceTree", partial(space_graph.PieceTree, smallest=2.0**-5))
    problem = random_over_alpha(p, seed) if seed % 2 else in_space(random_plane_over_alpha(p, seed))
    graph = enumsol.branch_graph(problem, (0, 1), max_nodes=250)
    assert graph.reasons[0].startswith("solutions may be missing")
    assert 0 < sum(high - low for low, high in graph.open_ranges) < Fraction(1, 2)
    compared = 0
    for alpha in np.linspace(0.013, 0.987, 9).tolist():
        if not any(low <= alpha <= high for low, high in graph.open_ranges):
            known, found = enumsol.enumerate_roots(problem, alpha, max_nodes=3000), graph.roots_at(alpha)
            assert known.complete
            assert graph.multiplicity_at(alpha) == len(known) == len(found)
            assert found.complete
            compared += 1
    assert compared > 3


def test_a_graph_without_gaps_leaves_nothing_open_and_one_cut_short_all(graph):
    assert graph.open_ranges == ()
    part = enumsol.branch_graph(SLIDING, (1.78, 1.82), max_nodes=1)
    assert part.open_ranges == (part.exact_interval,)
    assert "left open" not in repr(part)


def test_an_arc_that_is_too_short_leaves_no_solution_at_the_border():
    part = enumsol.branch_graph(loaded_by_alpha(), (0.0, 0.125))
    assert any("shorter than its ends are known" in reason for reason in part.reasons)
    assert part.at_least(0) == 1
    assert [v.alpha for v in part.vertices if v.border] == [0.125]
    assert part.claims.uniqueness().several_by is None


def test_what_is_refused():
    bad_argument('arithmetic is "fast" for a problem in 3D', enumsol.branch_graph, SLIDING, (1, 2), "fast")
    bad_argument("executor", enumsol.branch_graph, SLIDING, (1, 2), executor=3)
    bad_argument("expected F >= 0", enumsol.branch_graph, SLIDING, (-1, 2))


def test_friction_that_curves_cannot_take_is_named_by_its_node():
    problem = enumsol.gallery.block3d(1, 1, 1)  # its nodes are 1 and 3
    for coefficients, slopes, why in (
        ((0.1, 0.2), (0.5, 0.1), "the ratio of the coefficients of friction of contact node 1 changes with alpha"),
        ((0.0, 0.2), (0.0, 0.1), "contact node 1 has friction along one axis only, which changes with alpha"),
    ):
        graph = enumsol.branch_graph(problem.replace(friction=coefficients, friction_slope=slopes), (0, 1))
        assert (len(graph.arcs), graph.complete) == (0, False)
        assert [reason.split(";")[0] for reason in graph.reasons] == [why]
        assert graph.open_ranges == (graph.exact_interval,)


# -- what happens along a curve ----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def sliding():
    """SLIDING as balls, and its curve for alpha near 1/2."""
    given, interval = AlphaProblem.of(SLIDING.enclosure), (Fraction(49, 100), Fraction(51, 100))
    return given, chain_through(given, SLIDING, np.append(sliding_node(0.5), 0.5), interval)


def test_motion_is_that_of_differences(sliding):
    given, chain = sliding
    for joint in chain.joints:
        alpha, border = joint.at(0.0).mid[-1], np.array([0.0, 0.0, 0.0, 1.0])
        speed = CurveMotion(joint, border).speed((SLIP,))
        step = 1e-5
        there, here = (placed(given, np.append(sliding_node(a), a)) for a in (alpha + step, alpha - step))
        assert speed.mid[:3] * given.force == pytest.approx((there - here)[:3] / (2 * step), abs=1e-8)
        assert np.all(speed.rad < 1e-6)
        assert speed.mid[3] == pytest.approx(1.0)


@pytest.mark.parametrize("row", [0, 1])
def test_second_derivatives_are_those_of_differences(sliding, row):
    # with a border along a force, alpha is a function of that force
    given, chain = sliding
    joint = chain.joints[1]
    alpha, border = joint.at(0.0).mid[-1], np.zeros(4)
    border[1 + row] = 1.0
    steps = np.array([-1e-3, 0.0, 1e-3])
    force = np.array([sliding_node(alpha + s)[1 + row] for s in steps])
    first = np.polyfit(force - force[1], steps, 2)
    border = border_of_zeta(given, border)
    assert np.sign(first[0]) == CurveMotion(joint, border).bends((SLIP,))
    assert CurveMotion(joint, border).speed((SLIP,)).mid[3] == pytest.approx(first[1], rel=1e-4)


def test_only_the_condition_between_two_statuses_decides(sliding):
    _, chain = sliding
    motion = CurveMotion(chain.links[0].curve)
    assert motion.possible == (frozenset({SLIP}),)
    # |z_t| - alpha z_n falls while alpha rises
    assert motion.decides((SLIP,), 0, STICK) in (0, -motion.rises((SLIP,)))
    assert motion.decides((SLIP,), 0, SLIP) == 0


def test_vertices_of_the_same_bounds_are_not_in_an_order(graph):
    # a transition changes no number, a fold does
    vertex = graph.transitions[0]
    fold = replace(vertex, kind=VertexKind.FOLD)
    assert unordered([vertex, vertex]) == unordered([vertex, fold]) == unordered([fold]) == []
    ((reason, *ranges),) = unordered([fold, vertex, fold])
    assert "stayed open" in reason
    assert ranges == [vertex.enclosure] * 2


def test_counts_along_random_graphs_are_those_of_searches():
    problem, graph = graph_over_alpha(2, 2)
    for alpha in np.linspace(0.03, 0.97, 4).tolist():
        known, found = enumsol.enumerate_roots(problem, alpha), graph.roots_at(alpha)
        assert known.complete
        assert graph.multiplicity_at(alpha) == len(known) == len(found)
        assert found.complete
        for one, other in zip(known, found, strict=True):
            assert one.lambda_n == pytest.approx(other.lambda_n, abs=1e-10)


def test_runs_and_turns_alternate(sliding):
    _, chain = sliding
    parts = runs_and_turns(chain)
    assert [type(part) for part in parts] == [Run]
    assert not any(isinstance(part, Turn) for part in parts)
    assert parts[0].index == 1


def there_and_back(chain):
    """The parts of a chain that turns back once, which is settled: there is an arc of either index."""
    parts = runs_and_turns(chain)
    assert [type(part) for part in parts] == [Run, Turn, Run]
    assert parts[1].settled
    assert sorted((parts[0].index, parts[2].index)) == [-1, 1]
    return parts


@pytest.mark.slow
def test_both_nodes_of_a_symmetric_wedge_change_their_status_at_one_fold():
    problem = enumsol.gallery.wedge3d(2, 1, 2)
    given, interval = AlphaProblem.of(problem.enclosure), (Fraction(844, 1000), Fraction(849, 1000))
    root = enumsol.enumerate_roots(problem, 0.8485)[0]
    chain = chain_through(given, problem, np.append(forces(root), 0.8485), interval)
    assert chain.whole
    _, turn, _ = there_and_back(chain)
    low, high = turn.alphas
    assert set(turn.selections) == {(SLIP, SLIP), (STICK, STICK)}
    assert high - low < 1e-8
    # the box of the corner: its curve bends away from the line in its middle, and what is beside it is not held
    corner = next(link.curve for link in chain.links if None in link.curve.statuses)
    point = curve_point(given, corner.at(0.0).mid, corner.box.border)
    assert corner.holds(Ball.exact(point.x))
    assert not corner.holds(Ball.exact(point.x + 0.1 * unplaced(given, point.x)))
    away = Fraction(1, 10**5)
    counts = [len(enumsol.enumerate_roots(problem, alpha)) for alpha in (low - away, high + away)]
    assert counts == [1, 3]


def test_orders_of_changes_lead_from_one_selection_to_the_other():
    first, last = (STICK, SLIP, STICK), (SLIP, SLIP, OPEN)
    between = ((STICK, SLIP, OPEN), (SLIP, SLIP, STICK))
    assert sorted(orders(first, last)) == [[first, middle, last] for middle in between]


# -- folds -------------------------------------------------------------------------------------------------------------


def around(alpha, reach):
    """The interval of that reach around alpha."""
    return Fraction(alpha) - Fraction(reach), Fraction(alpha) + Fraction(reach)


@pytest.mark.parametrize("way", [1, -1])
def test_folds_of_one_node_are_those_of_the_closed_form(way):
    # with the load's slope reversed alpha falls before the fold and rises after it, or the other way round
    node = OneNode(1, load=True)
    phi = node.folds()[0]
    problem = node.problem.replace(load_slope=way * node.problem.load_slope)
    fold, given = way * node.alpha(phi), AlphaProblem.of(problem.enclosure)
    alpha, n, t = node.at(phi + 0.02)
    chain = chain_through(given, problem, np.array([n, *t, way * alpha]), around(fold, Fraction(1, 500)))
    before, turn, after = there_and_back(chain)
    low, high = turn.alphas
    assert turn.selections == ((SLIP,),)
    assert high - low < 1e-12
    assert low - Fraction(1, 10**14) < Fraction(fold) < high + Fraction(1, 10**14)
    assert before.rises == -after.rises


@pytest.mark.parametrize(("seed", "most"), [(7, 80), (9, 80)])
def test_a_graph_around_the_fold_of_one_node_is_complete(seed, most):
    """Node 7 passes a point at which the equations of its status are singular; node 9 has no contact but two slips."""
    node = OneNode(seed, load=True)
    fold = node.alpha(node.folds()[0])
    graph = enumsol.branch_graph(node.problem, around(fold, Fraction(37, 100)), max_nodes=most)
    assert graph.complete
    (found,) = [vertex for vertex in graph.vertices if vertex.kind is VertexKind.FOLD]
    low, high = map(Fraction, found.enclosure)
    near = Fraction(1e-12 * max(1.0, abs(fold)))
    assert low - near <= Fraction(fold) <= high + near
    assert high - low <= 2 * near


@pytest.mark.long
@pytest.mark.parametrize("first", range(0, 500, 20))
def test_graphs_of_many_nodes_are_complete_and_have_the_folds_of_the_closed_form(first):
    for seed, load in product(range(first, first + 20), (True, False)):
        node = OneNode(seed, load)
        folds = sorted(node.alpha(phi) for phi in node.folds())
        if not folds:
            continue
        interval = (folds[0] - 0.37 if load else 0.0, folds[-1] + 0.37)
        graph = enumsol.branch_graph(node.problem, interval, max_nodes=1000)
        assert graph.complete, (seed, load)
        smooth = [v for v in graph.vertices if v.kind is VertexKind.FOLD and len(v.selections) == 1]
        assert np.allclose(sorted(float(sum(v.enclosure)) / 2 for v in smooth), folds, rtol=1e-12, atol=1e-12), (
            seed,
            load,
        )


def test_a_curve_is_whole_over_an_interval_in_which_continuation_has_to_take_very_short_steps():
    node = OneNode(20, load=True)
    phi = node.folds()[-1]
    fold, (alpha, n, t) = node.alpha(phi), node.at(phi + 0.01)
    interval = around(fold, 5 * abs(alpha - fold))
    chain = chain_through(AlphaProblem.of(node.problem.enclosure), node.problem, np.array([n, *t, alpha]), interval)
    assert chain.whole
    assert chain.joints[0].alphas[1] < interval[0] or chain.joints[0].alphas[0] > interval[1]


def test_no_curve_is_followed_from_where_continuation_goes_neither_way(monkeypatch):
    """From a fold, for example (node 258 with a load): the skeleton would be one point."""
    node = OneNode(20, load=True)
    alpha, n, t = node.at(node.folds()[-1])
    still = SimpleNamespace(
        lambda_n=np.array([[n]]), lambda_t=t[None, None], alpha=[alpha], status=PathStatus.STALLED, transitions=[]
    )
    still.rigid_coordinates = None
    monkeypatch.setattr(chains, "_path", lambda *_: still)
    given = AlphaProblem.of(node.problem.enclosure)
    assert chain_through(given, node.problem, np.array([n, *t, alpha]), around(alpha, 1)) is None


@pytest.mark.long
@pytest.mark.parametrize("first", range(0, 500, 20))
def test_folds_of_many_nodes_are_those_of_the_closed_form(first):
    for seed, load in product(range(first, first + 20), (True, False)):
        node = OneNode(seed, load)
        given = AlphaProblem.of(node.problem.enclosure)
        for phi in node.folds():
            fold = node.alpha(phi)
            assert any(fold_is_found(node, given, phi, way) for way in (1e-3, -1e-3, 1e-2, -1e-2)), (seed, load, fold)


def fold_is_found(node, given, phi, way):
    """Whether a curve that begins beside a fold turns there once, at the alpha of the closed form."""
    there, fold = node.at(phi + way), node.alpha(phi)
    if there is None:
        return False
    alpha, n, t = there
    chain = chain_through(given, node.problem, np.array([n, *t, alpha]), around(fold, 5 * abs(alpha - fold)))
    if chain is None or not chain.whole:
        return False
    turns = [part for part in runs_and_turns(chain) if isinstance(part, Turn)]
    if len(turns) != 1:
        # the curve ends before it turns, or turns again where the node loses contact
        return False
    (turn,) = turns
    low, high = turn.alphas
    near = Fraction(1e-12 * max(1.0, abs(fold)))
    assert low - near <= Fraction(fold) <= high + near
    assert abs((low + high) / 2 - Fraction(fold)) <= near
    assert high - low < 1e-9
    return turn.settled and len(turn.selections) == 1


# -- problems in 2D written in 3D --------------------------------------------------------------------------------------


def check_the_same(plane, space):
    """A graph in 3D has the vertices and the arcs of that in 2D, of which it is a rewriting, as far as it is told."""
    assert plane.complete
    critical = sorted({float(vertex.exact) for vertex in plane.vertices})
    for a, b in pairwise(critical):
        middle, count = 0.5 * (a + b), plane.multiplicity_at(0.5 * (a + b))
        assert sum(arc.lo < middle < arc.hi for arc in space.arcs) == count
        assert space.at_least(middle) <= count
        assert not space.complete or space.multiplicity_at(middle) == count
    for one, other in ((plane, space), (space, plane)):
        for vertex in one.vertices:
            assert any(vertex.kind == v.kind and close(vertex, v) for v in other.vertices), vertex


def close(one, other):
    (low, high), (a, b) = one.enclosure, other.enclosure
    reach = Fraction(1, 10**12)
    return low <= b + reach and a <= high + reach and high - low < 1e-8


@pytest.mark.parametrize(
    ("p", "seed"),
    [
        pytest.param(1, 1, marks=pytest.mark.slow),
        # sticks, and moves no more, over boxes that are as narrow as rounding errors
        pytest.param(1, 102, marks=pytest.mark.slow),
        *(pytest.param(1, seed, marks=pytest.mark.long) for seed in range(2, 40)),
        *(pytest.param(2, seed, marks=pytest.mark.long) for seed in range(12)),
        *(pytest.param(3, seed, marks=pytest.mark.long) for seed in range(6)),
    ],
)
def test_a_second_tangent_that_nothing_loads_changes_nothing(p, seed):
    problem = random_plane_over_alpha(p, seed)
    space = enumsol.branch_graph(in_space(problem), (0, 1), max_nodes=100)
    check_the_same(enumsol.branch_graph(problem, (0, 1)), space)


@pytest.mark.long
def test_two_folds_at_one_alpha_are_found_and_their_order_is_left_open():
    # sticking and slipping along one line; at alpha = 3 two branches turn back
    problem = enumsol.gallery.two_node_square()
    space = enumsol.branch_graph(in_space(problem), (0, 10), max_nodes=2000)
    check_the_same(enumsol.branch_graph(problem, (0, 10)), space)
    assert len(space.reasons) == 1
    assert "at the smaller alpha stayed open" in space.reasons[0]


@pytest.mark.parametrize("seed", [3071, 3078])
def test_a_corner_at_which_a_curve_bends_far_out_of_its_box_is_told_to_rounding(seed):
    graph = enumsol.branch_graph(random_over_alpha(2, seed), (0, 1), max_nodes=400)
    (vertex,) = [vertex for vertex in graph.vertices if not vertex.border]
    assert vertex.kind is VertexKind.TRANSITION
    assert vertex.enclosure[1] - vertex.enclosure[0] < 1e-10
    assert graph.complete
