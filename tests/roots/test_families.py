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
    return ContactProblem(A, eye[:p], eye[p:], f, friction=np.array(frictions, dtype=float))


def assert_all_roots(problem, family):
    """Corners and random convex combinations of every polytope solve H = 0."""
    equation = PiecewiseSmoothEquation(problem)
    rng = np.random.default_rng(0)
    for part in family.polytopes:
        weights = np.vstack([np.eye(len(part.vertices)), rng.dirichlet(np.ones(len(part.vertices)), size=20)])
        for point in np.einsum("ij,jkl->ikl", weights, part.vertices):
            load = problem.f - problem.Bn.T @ point[:, 0] - problem.Bt.T @ point[:, 1]
            x = np.concatenate([np.linalg.solve(problem.A.toarray(), load), point.T.ravel()])
            assert np.max(np.abs(equation.residual(x, 0.0))) < 1e-12


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


#: Loads, coefficients of friction, and the dimension and number of vertices of the one family that there is.
ONE_FAMILY = {
    "of dimension three": ([(1, -2)] * 3, [2] * 3, 3, 8),
    # paper, Example 6.3, ends in open (grazing) and in stick, both regular selections with their own root there
    "touched by roots": ([(1, -2)], [2], 1, 2),
    # node 1 carries no load: four statuses hold there all along the segment
    "beside a node at rest": ([(1, -2), (0, 0)], [2, 1], 1, 2),
}


@pytest.mark.parametrize("case", ONE_FAMILY)
@pytest.mark.parametrize(("arithmetic", "method"), METHODS)
def test_one_family(arithmetic, method, case):
    loads, frictions, dimension, vertices = ONE_FAMILY[case]
    roots = enumsol.enumerate_roots(separate_nodes(loads, frictions), 0.0, arithmetic, method)
    (family,) = roots.families
    assert (len(roots), roots.index_sum, family.index) == (0, 1, 1)
    assert (family.dimension, len(family.polytopes), len(family.vertices)) == (dimension, 1, vertices)


@pytest.mark.parametrize(("arithmetic", "method"), METHODS)
def test_three_separate_families(arithmetic, method):
    # the second node has three roots of its own, so nothing joins the three segments
    problem = separate_nodes([(1, -2), (1.5, -4)], [2, 5])
    roots = enumsol.enumerate_roots(problem, 0.0, arithmetic, method)
    assert (len(roots), roots.index_sum) == (0, 1)
    assert sorted(family.index for family in roots.families) == [-1, 1, 1]
    for family in roots.families:
        assert (family.dimension, len(family.vertices), len(family.polytopes)) == (1, 2, 1)
        assert_all_roots(problem, family)


@pytest.mark.parametrize(("arithmetic", "method"), METHODS)
def test_family_and_isolated_root_apart(arithmetic, method):
    # node 0 in contact pushes node 1's friction below its fold: found by planting a segment, then adding a far root
    A = np.array([[5.0, 1.0, 0.0, -1.0], [1.0, 4.0, 1.0, 1.0], [0.0, 1.0, 3.0, -1.0], [-1.0, 1.0, -1.0, 4.0]])
    eye = np.eye(4)
    problem = ContactProblem(A, eye[:2], eye[2:], [0.0, 2.0, -3.0, 8.0], friction=np.array([2.0, 4.0]))
    roots = enumsol.enumerate_roots(problem, 0.0, arithmetic, method)
    (root,), (family,) = roots, roots.families
    assert (family.dimension, roots.index_sum) == (1, 1)
    away = np.abs(family.vertices - np.stack([root.lambda_n, root.lambda_t], axis=1))
    assert np.min(np.max(away, axis=(1, 2))) > 0.1
    assert_all_roots(problem, family)


@pytest.mark.parametrize("method", ["tree", "exhaustive"])
@pytest.mark.parametrize("limit", [1, 8, 4096])
def test_index_where_very_many_selections_hold(monkeypatch, limit, method):
    # above the limit the index comes from the reduced problem, or from a search on the perturbed one
    monkeypatch.setattr(components, "MAX_LOCAL_SELECTIONS", limit)
    for loads, frictions, indices in (
        ([(1, -2), (0, 0), (0, 0)], [2, 1, 1], {1}),  # a family with two bystanders
        ([(1.5, -4), (0, 0), (0, 0)], [5, 1, 1], {1, -1}),  # three roots with two bystanders
        ([(1, -2), (1.5, -4)], [2, 5], {1, -1}),
    ):
        roots = enumsol.enumerate_roots(separate_nodes(loads, frictions), 0.0, "fast", method)
        assert {item.index for item in (*roots, *roots.families)} == indices
        assert roots.index_sum == 1


@pytest.mark.parametrize("method", ["tree", "exhaustive"])
def test_singular_selection_that_holds_at_one_point(method):
    # slip- of node 0 is singular at F = 2 and, with zero load, holds at lambda = 0 alone
    roots = enumsol.enumerate_roots(separate_nodes([(0, 0), (1, -1)], [2, 2]), 0.0, "exact", method)
    assert (len(roots), roots.families, roots[0].index) == (1, (), 1)
    assert {s.value for s in roots[0].active[0]} == {"open", "stick", "slip+", "slip-"}


@pytest.mark.parametrize("method", ["tree", "exhaustive"])
def test_floats_that_are_not_quite_singular(method):
    # exact data decide: at the float below and above F = 2 there is no family
    for F, count in ((np.nextafter(2.0, 0), 1), (2.0, 0), (np.nextafter(2.0, 3), 2)):
        roots = enumsol.enumerate_roots(separate_nodes([(1, -2)], [F]), 0.0, "exact", method)
        assert (len(roots), len(roots.families), roots.index_sum) == (count, int(F == 2.0), 1)


def test_repr_of_a_family():
    text = repr(enumsol.enumerate_roots(separate_nodes([(1, -2)], [2]), 0.0, "exact"))
    assert "0 roots, 1 family (exact, tree)" in text
    assert "family 0: dimension 1, 1 polytope, 2 vertices, index +1" in text
    assert text.endswith("complete: yes (proven)")
