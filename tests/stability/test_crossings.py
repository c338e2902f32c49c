"""Ranges of mu in which a motion grows (theory, section 15.4), against all sets of sliding nodes in floats."""

import dataclasses
from collections import Counter

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp
from growing_motions import growing_motions
from linear_motions import random_motion, setting

import enumsol
from enumsol.branches.stability import ArcStabilities
from enumsol.search.growing_motions import crossing_near
from enumsol.search.stability import StabilitySearch
from enumsol.trusted.running_away import Crossing

#: One node at its limit that K(0) pushes on: A, M, Bn, Bt, F, kinds and signs.
ONE_NODE = (
    np.array([[2.0, 1.0], [1.0, 2.0]]),
    np.eye(2),
    np.array([[1.0, 0.0]]),
    np.array([[0.0, 1.0]]),
    np.array([3.0]),
    ["limit"],
    np.array([1.0]),
)


def proven_crossings(seeds):
    """Crossings that the search proposes and that hold, with all mu at which the judge finds motions."""
    for seed in seeds:
        data = random_motion(np.random.default_rng(seed))
        stiffness, motions = setting(*data)
        growing = StabilitySearch(stiffness, motions).run().growing
        for known, _ in growing:
            found = crossing_near(stiffness, motions, known)
            if found is not None:
                yield stiffness, motions, found, [mu for mu, *_ in growing_motions(*data)]


@pytest.mark.slow
def test_in_a_crossing_a_motion_grows():
    count = 0
    for stiffness, motions, crossing, judged in proven_crossings([(11, k) for k in range(24)]):
        assert crossing.holds(stiffness, motions)
        assert any(crossing.low <= mu <= crossing.high for mu in judged)
        count += 1
    assert count


@pytest.mark.slow
def test_crossings_anywhere():
    rng, accepted = np.random.default_rng(5), 0
    for k in range(30):
        data = random_motion(rng)
        stiffness, motions = setting(*data)
        if not motions.limits:
            continue
        judged = None
        for low in (0.0, *(10.0 ** rng.uniform(-3, 3, 3))):
            L = motions.slopes.mid.T @ stiffness.at(float(low)).mid @ motions.moves.mid
            exact = scipy.linalg.eig(L.T)
            push = np.abs(exact[1][:, int(np.argmin(exact[0].real))].real)
            for high in low + 10.0 ** rng.uniform(-2, 5, 3):
                tried = Crossing(float(low), float(high), push)
                if tried.holds(stiffness, motions):
                    accepted += 1
                    judged = [mu for mu, *_ in growing_motions(*data)] if judged is None else judged
                    assert any(tried.low <= mu <= tried.high for mu in judged), k
    assert accepted


@pytest.mark.slow
def test_counted_ways_to_go_on_anywhere():
    """What is counted under any load, at either end, is not one only where the judge finds a motion in between."""
    rng, accepted = np.random.default_rng(7), Counter()
    for k in range(60):
        data = random_motion(rng)
        stiffness, motions = setting(*data)
        if not motions.limits:
            continue
        judged = None
        for _ in range(6):
            low, high = sorted(10.0 ** rng.uniform(-3, 4, 2))
            tried = Crossing(float(low), float(high), load=rng.normal(size=motions.limits))
            if tried.holds(stiffness, motions):
                judged = [mu for mu, *_ in growing_motions(*data)] if judged is None else judged
                accepted[motions.limits] += 1
                assert any(tried.low <= mu <= tried.high for mu in judged), k
    assert accepted.total() >= 10
    assert max(accepted) >= 2


def test_a_motion_that_no_weights_find():
    """L(0) has a column of positive entries, so that no weighted rows are negative; the ways to go on do not add up."""
    L = np.array([[0.56, -2.24], [0.20, -0.96]])
    F = np.array([1.0, 1.0])
    K = np.block([[9 * np.eye(2), np.zeros((2, 2))], [np.zeros((2, 2)), 4 * np.eye(2)]])
    K[:2, 2:] = K[2:, 2:] - L  # T'K R = K_tt - K_nt
    K[2:, :2] = K[:2, 2:].T
    assert np.linalg.eigvalsh(K)[0] > 0
    data = (K, np.eye(4), np.eye(4)[:2], np.eye(4)[2:], F, ["limit", "limit"], np.ones(2))
    stiffness, motions = setting(*data)
    crossing = crossing_near(stiffness, motions, StabilitySearch(stiffness, motions).run().growing[0][0])
    assert crossing.push is None
    assert crossing.holds(stiffness, motions)
    assert any(crossing.low <= mu <= crossing.high for mu, *_ in growing_motions(*data))
    for change in ({"low": 0.0}, {"load": np.zeros(2)}, {"load": crossing.load[:1]}, {"load": None}, {"high": np.inf}):
        assert not dataclasses.replace(crossing, **change).holds(stiffness, motions)


def test_a_motion_that_begins_to_grow_where_the_form_is_definite():
    """At rest the form is definite, and for large growth rates the mass pushes the node on."""
    A, M = np.array([[5.0, 0.4], [0.4, 2.0]]), np.array([[4.0, 0.9], [0.9, 1.0]])
    data = (A, M, np.eye(2)[:1], np.eye(2)[1:], np.array([1.5]), ["limit"], np.ones(1))
    stiffness, motions = setting(*data)
    ((known, _),) = StabilitySearch(stiffness, motions).run().growing
    crossing = crossing_near(stiffness, motions, known)
    assert crossing.holds(stiffness, motions)
    # (2 - 0.6) + mu (1 - 1.35) = 0
    assert crossing.low < 1.4 / 0.35 < crossing.high
    assert not dataclasses.replace(crossing, high=3.9).holds(stiffness, motions)


@pytest.mark.parametrize("change", [{"low": -1.0}, {"high": np.inf}, {"low": np.nan}, {"high": 1e-9}])
def test_ranges_that_make_no_sense(change):
    stiffness, motions = setting(*ONE_NODE)
    crossing = Crossing(0.0, 64.0, np.ones(1))
    assert crossing.holds(stiffness, motions)
    assert not dataclasses.replace(crossing, **change).holds(stiffness, motions)
    for push in (-crossing.push, np.full_like(crossing.push, np.nan), crossing.push[:-1], 0 * crossing.push):
        assert not dataclasses.replace(crossing, push=push).holds(stiffness, motions)


@pytest.mark.slow
def test_verdicts_along_arcs_are_those_of_their_roots():
    problem = enumsol.gallery.get("brake-shoe-9").build()
    graph = enumsol.branch_graph(problem, (0.34, 0.4))
    asked = ArcStabilities(problem)
    for arc in graph.arcs:
        for span in asked.spans(arc):
            if span.verdict == "undecided" or span.low == span.high:
                continue
            alpha = 0.5 * (span.low + span.high)
            there = [root for root in graph.roots_at(alpha) if root.statuses == arc.statuses]
            verdicts = {enumsol.stability(problem, root).verdict for root in there}
            assert verdicts == {span.verdict}
            if span.growth is not None:
                (found,) = [enumsol.stability(problem, root) for root in there]
                assert span.growth[0] <= found.growth_rates[0] <= span.growth[1]


def test_an_arc_of_a_wedge_along_which_two_nodes_slide():
    """Of a wedge with five equilibria; its motions were found at single alphas only (theory, section 15.4)."""
    problem = enumsol.gallery.get("wedge-8-5").build()
    graph = enumsol.branch_graph(problem, (2.5, 3))
    (arc,) = [arc for arc in graph.arcs if [str(of) for of in arc.statuses].count("open") == 6 and arc.index == -1]
    (span,) = ArcStabilities(problem).spans(arc)
    assert span.verdict == "runs away"
    (root,) = [root for root in graph.roots_at(2.75) if root.statuses == arc.statuses]
    assert span.growth[0] <= enumsol.stability(problem, root).growth_rates[0] <= span.growth[1]


def test_parts_of_a_body_do_not_share_what_is_known_of_them():
    """A proof about two nodes at their limit is of no use for a part with one, and is not tried there."""
    two, one = enumsol.gallery.get("two-node-5").build(), enumsol.gallery.one_node_triangle()
    blocks = [sp.block_diag([getattr(body, name) for body in (two, one)]) for name in ("A", "Bn", "Bt")]
    problem = enumsol.ContactProblem(
        *blocks, np.concatenate([two.f, one.f]), friction=0, friction_slope=1, mass=np.eye(two.n + one.n)
    )
    graph = enumsol.branch_graph(problem, (3.05, 3.5))
    for arc, spans in zip(graph.arcs, graph.stability(), strict=True):
        for span in spans:
            alpha = 0.5 * (span.low + span.high)
            (root,) = [root for root in graph.roots_at(alpha) if root.statuses == arc.statuses]
            assert span.verdict in (enumsol.stability(problem, root).verdict, "undecided")


def test_ranges_with_a_gap_exclude_nothing_along_an_arc(monkeypatch):
    problem = enumsol.gallery.get("brake-shoe-9").build()
    graph = enumsol.branch_graph(problem, (0.36, 0.37))
    arc = next(arc for arc in graph.arcs if arc.index == 1 and any("slip" in of.value for of in arc.statuses))
    assert {span.verdict for span in ArcStabilities(problem).spans(arc)} == {"does not run away"}
    run = StabilitySearch.run

    def with_a_gap(search):
        proven = run(search)
        return dataclasses.replace(proven, leaves=proven.leaves[1:])

    monkeypatch.setattr(StabilitySearch, "run", with_a_gap)
    assert {span.verdict for span in ArcStabilities(problem).spans(arc)} == {"undecided"}
