"""The paper's Examples 6.1 to 6.3 and all one-node problems against their closed form."""

from fractions import Fraction

import numpy as np
import pytest
from complete import whole_graph
from effort import some
from path_problems import balanced, one_node

from enumsol.branches import branch_graph
from enumsol.model.statuses import ContactStatus

OPEN, STICK, MINUS = ContactStatus.OPEN, ContactStatus.STICK, ContactStatus.SLIP_MINUS
BOTH = pytest.mark.parametrize("arithmetic", ["fast", "exact"])


@BOTH
def test_example_6_1_has_an_open_branch_and_a_fold(arithmetic):
    graph = balanced(branch_graph(one_node((1.5, -4.0)), (0.0, 20.0), arithmetic))
    assert graph.complete == (arithmetic == "exact")
    assert len(graph.branches) == len(graph.components) == 2
    (fold,) = graph.folds
    assert abs(fold.alpha - 8 / 3) <= 1e-14
    assert fold.enclosure == (Fraction(8, 3), Fraction(8, 3))
    arcs = {arc.statuses[0]: arc for arc in graph.arcs}
    assert set(arcs) == {OPEN, STICK, MINUS}
    assert arcs[OPEN].interval == (0.0, 20.0)
    assert arcs[STICK].interval == arcs[MINUS].interval == (fold.alpha, 20.0)
    assert (arcs[OPEN].index, arcs[STICK].index, arcs[MINUS].index) == (1, 1, -1)
    for alpha in np.linspace(fold.alpha, 20.0, 50):
        assert arcs[STICK].values(alpha)[0][0] == pytest.approx(1.5, rel=1e-15)
        assert arcs[STICK].values(alpha)[1][0] == pytest.approx(-4.0, rel=1e-15)
        assert arcs[MINUS].values(alpha)[0][0] == pytest.approx(1 / (alpha - 2), rel=1e-14)
    assert [graph.multiplicity_at(a) for a in (1.0, fold.alpha - 1e-15, fold.alpha + 1e-15, 5.0)] == [1, 1, 3, 3]
    assert graph.multiplicity_at(Fraction(8, 3)) == 2
    assert graph.uniqueness_limit == fold.alpha
    assert 0 < graph.uniqueness_bound < fold.alpha


@BOTH
def test_example_6_2_is_one_branch(arithmetic):
    graph = balanced(branch_graph(one_node((1.5, 7.0)), (0.0, 20.0), arithmetic))
    assert len(graph.branches) == 1
    assert graph.uniqueness_limit is None
    (transition,) = graph.transitions
    assert abs(transition.alpha - 14 / 3) <= 1e-14


@BOTH
def test_example_6_3_joins_two_branches_by_a_vertical_segment(arithmetic):
    graph = balanced(branch_graph(one_node((1.0, -2.0)), (0.0, 20.0), arithmetic))
    assert len(graph.components) == 1
    (family,) = graph.families
    (vertex,) = graph.bifurcations
    assert vertex.alpha == family.alpha == 2.0
    assert vertex.kind == "family"
    np.testing.assert_allclose(family.vertices, [[[0.0, 0.0]], [[1.0, -2.0]]], atol=0)
    assert family.index == 1
    # three arcs meet the segment: grazing from the left, grazing and stick to the right
    left = [arc for arc in graph.arcs if arc.head == vertex.number]
    right = [arc for arc in graph.arcs if arc.tail == vertex.number]
    assert [(arc.statuses[0], arc.grazing, arc.index) for arc in left] == [(OPEN, True, 1)]
    assert sorted((arc.statuses[0].value, arc.grazing, arc.index) for arc in right) == [
        ("open", True, 0),
        ("stick", False, 1),
    ]
    assert graph.roots_at(2.0).families[0].dimension == 1
    assert [graph.multiplicity_at(a) for a in (1.0, 2.0, 3.0)] == [1, 1, 2]
    root = graph.roots_at(3.0)[0]
    assert (root.lambda_n[0], root.u_n[0]) == (0.0, 0.0)


def test_a_small_perturbation_destroys_the_bifurcation_of_example_6_3():
    graph = balanced(branch_graph(one_node((0.98, -2.0)), (0.0, 20.0), "exact"))
    assert len(graph.branches) == 2
    assert not graph.bifurcations
    (fold,) = graph.folds
    assert abs(fold.alpha - 2 / 0.98) <= 1e-14


def closed_form(lame, f):
    """Arcs (status, lo, hi) over [0, 20] of the one-node problem, from the paper's case distinction."""
    lam, mu = (Fraction(v) for v in lame)
    f_n, f_t = (Fraction(v) for v in f)
    k = (lam + mu) / (lam + 3 * mu)
    end = Fraction(20)
    arcs = []
    s = f_n + k * f_t  # free normal displacement up to a positive factor
    if s < 0:
        arcs.append(("open", Fraction(0), end))
    bound = abs(f_t) / f_n if f_n > 0 else None
    slip = "slip-" if f_t < 0 else "slip+"
    if bound is not None and bound <= end:
        arcs.append(("stick", bound, end))
    if s > 0 and f_t != 0:
        # one branch: it slips until it sticks, or for all alpha
        arcs.append((slip, Fraction(0), end if bound is None else min(bound, end)))
    elif s < 0 and bound is not None and bound < end:
        arcs.append((slip, bound, end))
    return sorted((name, lo, hi) for name, lo, hi in arcs if lo < hi)


@pytest.mark.slow
def test_random_one_node_problems_equal_the_closed_form(rng):
    folds = 0
    for _ in range(some(50, of=120)):
        lame = tuple((rng.integers(1, 32, size=2) / 8).tolist())
        f = tuple((rng.integers(-64, 65, size=2) / 16).tolist())
        if f[0] + (lame[0] + lame[1]) / (lame[0] + 3 * lame[1]) * f[1] == 0 or f[1] == 0:
            continue
        graph = balanced(whole_graph(one_node(f, lame=lame), (0.0, 20.0), "exact"))
        found = sorted(
            (arc.statuses[0].value, *(graph.vertices[v].enclosure[0] for v in (arc.tail, arc.head)))
            for arc in graph.arcs
        )
        assert found == closed_form(lame, f)
        folds += len(graph.folds)
        for arc in graph.arcs:
            if arc.statuses[0] in (MINUS, ContactStatus.SLIP_PLUS):
                k = (lame[0] + lame[1]) / (lame[0] + 3 * lame[1])
                alpha = 0.5 * (arc.lo + arc.hi)
                sign = -1.0 if arc.statuses[0] is MINUS else 1.0
                expected = (f[0] + k * f[1]) / (1 + sign * k * alpha)
                assert arc.values(alpha)[0][0] == pytest.approx(expected, rel=1e-13)
                assert arc.values(alpha)[1][0] == pytest.approx(sign * alpha * expected, rel=1e-13)
    assert folds > some(3, of=10)


def test_the_bifurcation_of_case_jjj_lies_where_the_paper_puts_it():
    for lam, mu in ((1.0, 1.0), (3.0, 1.0), (0.5, 0.25), (7.0, 2.0)):
        f = (lam + mu, -(lam + 3 * mu))
        graph = balanced(branch_graph(one_node(f, lame=(lam, mu)), (0.0, 20.0), "exact"))
        (vertex,) = graph.bifurcations
        assert abs(vertex.alpha - (lam + 3 * mu) / (lam + mu)) <= 1e-14
        assert len(graph.components) == 1
