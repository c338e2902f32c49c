"""Families, sheets, grazing, origins, corners: vertices that are not generic."""

import itertools
from fractions import Fraction
from math import isqrt

import numpy as np
import pytest
from complete import whole_graph
from effort import some
from path_problems import assert_same_roots, balanced, mirrored_problem, one_node, sheet_of_one_node, uncoupled

from enumsol import ContactProblem, enumerate_roots, gallery, verify
from enumsol.branches import branch_graph
from enumsol.model.statuses import ContactStatus


def test_a_sheet_is_one_edge_with_families_at_every_alpha():
    graph = whole_graph(sheet_of_one_node(), (0.25, 1.0), "exact")
    (sheet,) = graph.sheets
    assert (sheet.dimension, sheet.index) == (1, 1)
    assert len(graph.arcs) == 1
    (family,) = graph.roots_at(0.5).families
    np.testing.assert_allclose(family.vertices[:, 0, 0], [0.0, 0.5])
    with pytest.raises(ValueError, match="sheet"):
        sheet.values(0.5)


def test_a_load_that_passes_zero_has_every_selection_there():
    graph = whole_graph(sheet_of_one_node(), (-1.0, 1.0), "exact")
    (origin,) = [v for v in graph.vertices if v.alpha == 0.0]
    assert len(origin.active[0]) == 4
    assert (origin.index_left, origin.index_right) == (1, 1)
    graph = balanced(
        branch_graph(
            one_node((0.0, 0.0), friction=2.0, friction_slope=1.0, load_slope=[1.5, -4.0]), (-1.0, 2.0), "exact"
        )
    )
    assert [v.alpha for v in graph.folds] == [pytest.approx(2 / 3, abs=1e-15)]
    assert len(graph.roots_at(0.0)) == 1
    assert len(graph.roots_at(0.0)[0].active[0]) == 4


def test_an_origin_in_many_nodes_needs_no_list_of_all_selections():
    problem = uncoupled(*[[0.0, 0.0]] * 8, friction=0.5, load_slope=np.tile([1.0, 0.25], 8))
    assert len(whole_graph(problem, (-1.0, 1.0), "exact").arcs) == 2


def test_an_unloaded_body_rests():
    graph = whole_graph(uncoupled([0.0, 0.0], [0.0, 0.0]), (0.0, 2.0), "exact")
    assert len(graph.arcs) == 1
    assert np.all(graph.arcs[0].values(1.0)[0] == 0)


def test_a_node_without_friction_is_not_split_by_its_slip():
    graph = whole_graph(one_node((1.0, 0.0), friction=0.0, load_slope=[0.0, 1.0]), (-1.5, 1.5), "exact")
    assert len(graph.arcs) == 1
    assert graph.arcs[0].statuses[0] in (ContactStatus.STICK, ContactStatus.SLIP_MINUS, ContactStatus.SLIP_PLUS)


def test_friction_that_starts_at_zero_is_glued_at_the_border():
    for f in ((1.5, 7.0), (1.5, -0.5), (1.0, 0.0)):
        graph = whole_graph(one_node(f), (0.0, 9.0), "exact")
        assert_same_roots(graph.roots_at(0), enumerate_roots(one_node(f), 0, "exact"))


def test_corners_of_uncoupled_nodes():
    graph = balanced(branch_graph(uncoupled([1.5, -4.0], [1.5, -4.0]), (0.0, 4.0), "exact"))
    at = [v for v in graph.vertices if v.enclosure[0] == Fraction(8, 3)]
    assert sorted(v.kind for v in at) == ["bifurcation", "fold", "fold"]
    (corner,) = graph.bifurcations
    assert len(corner.selections) == 4
    assert sum(arc.tail == corner.number for arc in graph.arcs) == 4
    assert graph.multiplicity_at(3.0) == 9


def test_a_family_of_dimension_two():
    graph = balanced(branch_graph(uncoupled([1.0, -2.0], [1.0, -2.0]), (0.0, 4.0), "exact"))
    (family,) = graph.families
    assert (family.dimension, family.index, len(family.vertices)) == (2, 1, 4)
    assert_same_roots(graph.roots_at(2), enumerate_roots(uncoupled([1.0, -2.0], [1.0, -2.0]), 2, "exact"))


def test_grazing_and_a_fold_elsewhere():
    graph = balanced(branch_graph(uncoupled([1.0, -2.0], [1.5, -4.0]), (0.0, 4.0), "exact"))
    assert sum(arc.grazing for arc in graph.arcs) == 4
    assert graph.multiplicity_at(3.0) == 6


def irrational_families():
    """Stiffnesses and slip signs of two nodes whose slipping selection is singular at an irrational alpha."""
    for entries in itertools.product(range(-2, 3), repeat=5):
        a, b, c, d, e = entries
        stiffness = np.array([[4.0, a, b, c], [a, 4.0, d, e], [b, d, 4.0, 1.0], [c, e, 1.0, 4.0]])
        if np.linalg.eigvalsh(stiffness)[0] < 0.5:
            continue
        S = np.linalg.inv(stiffness) * round(np.linalg.det(stiffness))
        for signs in itertools.product((1, -1), repeat=2):
            M, L = S[:2, :2], S[:2, 2:] * np.array(signs)
            linear = M[0, 0] * L[1, 1] + M[1, 1] * L[0, 0] - M[0, 1] * L[1, 0] - M[1, 0] * L[0, 1]
            quadratic = [round(v) for v in (np.linalg.det(L), linear, np.linalg.det(M))]
            discriminant = quadratic[1] ** 2 - 4 * quadratic[0] * quadratic[2]
            if quadratic[0] == 0 or discriminant <= 0 or isqrt(discriminant) ** 2 == discriminant:
                continue
            roots = np.roots(quadratic)
            if np.any((roots > 0.2) & (roots < 6)):
                yield stiffness, np.array(signs)


def distance(segment, point):
    """Of a point from a segment."""
    start, along = segment[0], segment[1] - segment[0]
    t = np.clip((point - start) @ along / (along @ along), 0.0, 1.0)
    return float(np.linalg.norm(start + t * along - point))


@pytest.mark.parametrize("y", [(1.0, 1.0), (1.0, 2.0), (3.0, 1.0)])
def test_families_at_irrational_alphas(y):
    """The load keeps lambda_n = y in one slipping selection for every alpha, through its singular one."""
    found = 0
    for stiffness, signs in itertools.islice(irrational_families(), 0, 60, 6):
        moves = stiffness @ np.concatenate([np.zeros(2), 2.0 * signs])
        f = moves + np.concatenate([y, np.zeros(2)])
        slope = np.concatenate([np.zeros(2), signs * np.array(y)])
        problem = ContactProblem(stiffness, np.eye(4)[:2], np.eye(4)[2:], f, load_slope=slope)
        graph = balanced(whole_graph(problem, (0, 6), "exact"))
        vertices = [v for v in graph.vertices if v.family is not None]
        found += len(vertices)
        for v in vertices:
            lo, hi = v.enclosure
            assert lo < hi < lo + Fraction(1, 2**40)
            assert v.family.dimension == 1
            assert min(distance(part.vertices[:, :, 0], np.array(y)) for part in v.family.polytopes) < 1e-12
    assert found >= 5


PAIR = np.array([[21.0, 10.0, 6.0, 5.0], [10.0, 22.0, -5.0, 2.0], [6.0, -5.0, 21.0, -10.0], [5.0, 2.0, -10.0, 22.0]])


def pair(push):
    """A mirror-symmetric pair of nodes, and a push on one of them."""
    rows = np.eye(4)
    return ContactProblem(PAIR, rows[[0, 2]], rows[[1, 3]], np.array([1.0, 3.0, 1.0 + push, -3.0]))


def test_a_pitchfork_and_the_perturbation_that_destroys_it():
    graph = whole_graph(pair(0.0), (0.0, 6.0), "exact")
    (pitchfork,) = [v for v in graph.vertices if v.kind == "bifurcation"]
    left = [arc for arc in graph.arcs if arc.head == pitchfork.number]
    right = [arc for arc in graph.arcs if arc.tail == pitchfork.number]
    assert (pitchfork.alpha, len(left), len(right)) == (3.0, 1, 3)
    assert (pitchfork.index_left, pitchfork.index_right) == (-1, -1)
    moved = balanced(whole_graph(pair(1e-6), (0.0, 6.0), "exact"))
    assert not [v for v in moved.vertices if v.kind == "bifurcation"]


@pytest.mark.slow
def test_mirror_symmetric_problems():
    kinds = set()
    for seed in range(some(30, of=80)):
        rng = np.random.default_rng(seed)
        problem = mirrored_problem(rng, load=bool(seed % 2))
        graph = branch_graph(problem, (0, 6), "exact")
        assert graph.complete, (seed, graph.reasons)
        balanced(graph)
        kinds |= {v.kind for v in graph.vertices}
        for v in graph.vertices:
            lo, hi = v.enclosure
            if lo == hi and v.kind not in ("transition", "end"):
                assert_same_roots(graph.roots_at(lo), enumerate_roots(problem, lo, "exact"))
    assert {"bifurcation", "family", "fold", "transition"} <= kinds


@pytest.mark.slow
def test_a_condition_that_vanishes_everywhere_takes_few_boxes():
    # 936 boxes of each selection that grazes, and 20 kB of proof, where these are cut as long as boxes are tried
    problem = gallery.get("one-node-6.3").build()
    graph = branch_graph(problem, (0.0, 4.0))
    assert graph.complete
    assert any(arc.grazing for arc in graph.arcs)
    proof = graph.proof
    assert proof.size < 5_000
    report = verify(problem, proof)
    assert report.ok
    assert not report.complete
