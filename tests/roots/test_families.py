"""Continua of solutions: several nodes, dimension 2, touching and not touching isolated roots."""

import numpy as np
import pytest
from compare import METHODS

import enumsol
from enumsol import ContactProblem, PiecewiseSmoothEquation
from enumsol.roots import components

TRIANGLE = np.array([[2.0, -1.0], [-1.0, 2.0]])  # one-node problem: det of slip- vanishes at F = 2


def separate_nodes(loads, frictions, blocks=None):
    """One-node problems side by side, degrees of freedom (normal..., tangential...)."""
    p = len(loads)
    A = np.zeros((2 * p, 2 * p))
    for i in range(p):
        A[np.ix_([i, p + i], [i, p + i])] = TRIANGLE if blocks is None else blocks[i]
    f = np.array(loads, dtype=float).T.ravel()
    eye = np.eye(2 * p)
    return ContactProblem(A, eye[:p], eye[p:], f, friction=(np.array(frictions, dtype=float), 0.0))


def assert_all_roots(problem, family):
    """Corners and random convex combinations of every polytope solve H = 0."""
    equation = PiecewiseSmoothEquation(problem)
    rng = np.random.default_rng(0)
    for part in family.polytopes:
        weights = np.vstack([np.eye(len(part.vertices)), rng.dirichlet(np.ones(len(part.vertices)), size=20)])
        for point in np.einsum("ij,jkl->ikl", weights, part.vertices):
            forces = point.T.ravel()
            u = np.linalg.solve(
                problem.A.toarray(), problem.f - problem.Bn.T @ point[:, 0] - problem.Bt.T @ point[:, 1]
            )
            residual = equation.residual(np.concatenate([u, forces]), 0.0)
            assert np.max(np.abs(residual)) < 1e-12


@pytest.mark.parametrize(("arithmetic", "method"), METHODS)
def test_dimension_two(arithmetic, method):
    problem = separate_nodes([(1, -2), (1, -2)], [2, 2])
    roots = enumsol.enumerate_roots(problem, 0.0, arithmetic, method)
    assert len(roots) == 0
    (family,) = roots.families
    assert (family.dimension, family.index, len(family.polytopes)) == (2, 1, 1)
    corners = [[[a, -2 * a], [b, -2 * b]] for a in (0, 1) for b in (0, 1)]
    np.testing.assert_allclose(family.vertices, corners, atol=1e-14)
    assert_all_roots(problem, family)


@pytest.mark.parametrize(("arithmetic", "method"), METHODS)
def test_dimension_three(arithmetic, method):
    roots = enumsol.enumerate_roots(separate_nodes([(1, -2)] * 3, [2] * 3), 0.0, arithmetic, method)
    (family,) = roots.families
    assert (len(roots), family.dimension, family.index, len(family.vertices)) == (0, 3, 1, 8)


@pytest.mark.parametrize(("arithmetic", "method"), METHODS)
def test_three_separate_families(arithmetic, method):
    # the second node has three roots of its own, so nothing joins the three segments
    problem = separate_nodes([(1, -2), (1.5, -4)], [2, 5])
    roots = enumsol.enumerate_roots(problem, 0.0, arithmetic, method)
    assert len(roots) == 0
    assert sorted(family.index for family in roots.families) == [-1, 1, 1]
    assert roots.index_sum == 1
    for family in roots.families:
        assert (family.dimension, len(family.vertices), len(family.polytopes)) == (1, 2, 1)
        assert_all_roots(problem, family)


@pytest.mark.parametrize(("arithmetic", "method"), METHODS)
def test_family_and_isolated_root_apart(arithmetic, method):
    # node 0 in contact pushes node 1's friction below its fold: found by planting a segment, then adding a far root
    A = np.array([[5.0, 1.0, 0.0, -1.0], [1.0, 4.0, 1.0, 1.0], [0.0, 1.0, 3.0, -1.0], [-1.0, 1.0, -1.0, 4.0]])
    eye = np.eye(4)
    problem = ContactProblem(A, eye[:2], eye[2:], [0.0, 2.0, -3.0, 8.0], friction=(np.array([2.0, 4.0]), 0.0))
    roots = enumsol.enumerate_roots(problem, 0.0, arithmetic, method)
    assert len(roots) == 1
    (family,) = roots.families
    assert (family.dimension, roots.index_sum) == (1, 1)
    gap = np.min(
        np.max(np.abs(family.vertices - np.stack([roots[0].lambda_n, roots[0].lambda_t], axis=1)), axis=(1, 2))
    )
    assert gap > 0.1
    assert_all_roots(problem, family)


@pytest.mark.parametrize(("arithmetic", "method"), METHODS)
def test_roots_that_touch_a_family_belong_to_it(arithmetic, method):
    # paper, Example 6.3, ends in open (grazing) and in stick, both regular selections with their own root there
    roots = enumsol.enumerate_roots(separate_nodes([(1, -2)], [2]), 0.0, arithmetic, method)
    assert (len(roots), len(roots.families)) == (0, 1)
    assert roots.index_sum == 1


@pytest.mark.parametrize(("arithmetic", "method"), METHODS)
def test_a_bystander_at_rest_does_not_split_a_family(arithmetic, method):
    # node 1 carries no load: four statuses hold there all along the segment
    roots = enumsol.enumerate_roots(separate_nodes([(1, -2), (0, 0)], [2, 1]), 0.0, arithmetic, method)
    assert len(roots) == 0
    (family,) = roots.families
    assert (family.dimension, len(family.polytopes), len(family.vertices), family.index) == (1, 1, 2, 1)


@pytest.mark.parametrize("limit", [1, 8, 4096])
def test_index_where_very_many_selections_hold(monkeypatch, limit):
    # above the limit the index comes from a search on the perturbed problem
    monkeypatch.setattr(components, "MAX_LOCAL_SELECTIONS", limit)
    for loads, frictions, indices in (
        ([(1, -2), (0, 0), (0, 0)], [2, 1, 1], {1}),  # a family with two bystanders
        ([(1.5, -4), (0, 0), (0, 0)], [5, 1, 1], {1, -1}),  # three roots with two bystanders
        ([(1, -2), (1.5, -4)], [2, 5], {1, -1}),
    ):
        roots = enumsol.enumerate_roots(separate_nodes(loads, frictions), 0.0, "fast")
        assert {item.index for item in (*roots, *roots.families)} == indices
        assert roots.index_sum == 1


@pytest.mark.parametrize("method", ["tree", "exhaustive"])
def test_singular_selection_that_holds_at_one_point(method):
    # slip- of node 0 is singular at F = 2 and, with zero load, holds at lambda = 0 alone
    roots = enumsol.enumerate_roots(separate_nodes([(0, 0), (1, -1)], [2, 2]), 0.0, "exact", method)
    assert (len(roots), roots.families) == (1, ())
    assert {s.value for s in roots[0].active[0]} == {"open", "stick", "slip+", "slip-"}
    assert roots[0].index == 1


@pytest.mark.parametrize("method", ["tree", "exhaustive"])
def test_floats_that_are_not_quite_singular(method):
    # exact data decide: at the float below and above F = 2 there is no family
    for F, count in ((np.nextafter(2.0, 0), 1), (2.0, 0), (np.nextafter(2.0, 3), 2)):
        roots = enumsol.enumerate_roots(separate_nodes([(1, -2)], [F]), 0.0, "exact", method)
        assert (len(roots), len(roots.families)) == (count, int(F == 2.0))
        assert roots.index_sum == 1


def test_repr_of_a_family():
    text = repr(enumsol.enumerate_roots(separate_nodes([(1, -2)], [2]), 0.0, "exact"))
    assert "0 roots, 1 family (exact, tree)" in text
    assert "family 0: dimension 1, 1 polytope, 2 vertices, index +1" in text
    assert text.endswith("complete: yes (proven)")
