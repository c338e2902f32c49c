"""Extreme data: complete, or undecided with a reason; where exact arithmetic can tell, the count is right."""

from fractions import Fraction

import numpy as np
import pandas as pd
import pytest
from generators import integer_problem

import enumsol
from enumsol import (
    ContactProblem,
    ContinuationOptions,
    audit,
    branch_graph,
    enumerate_roots,
    fem,
    follow,
    gallery,
    newton,
    verify,
)
from enumsol.arithmetic import balls
from enumsol.condensation import enclosure
from enumsol.continuation import NotConverged, start_tangents
from enumsol.continuation.equation import PiecewiseSmoothEquation
from enumsol.search import solvers
from enumsol.search.solvers import Solvers
from enumsol.trusted.at_alpha import exclusion_margin


def check(problem, alpha, *, exact=True, roots=None):
    """The verified roots: complete, with a proof, as many as in exact arithmetic; or open with reasons."""
    found = enumerate_roots(problem, alpha)
    report = verify(problem, found.proof)
    assert report.ok
    assert report.complete == found.complete
    if not found.complete:
        assert found.undecided
        assert all(item.reason and item.hint for item in found.undecided)
        return found
    assert found.index_sum in (1, None)
    if exact:
        other = enumerate_roots(problem, alpha, "exact")
        assert (len(found), len(found.families)) == (len(other), len(other.families))
        assert [root.statuses for root in found] == [root.statuses for root in other]
    assert roots is None or len(found) == roots
    return found


@pytest.mark.parametrize("exponent", [-12, -6, 6, 12])
def test_stiffness(exponent):
    size = 10.0**exponent
    lame = (size, size)
    assert check(gallery.one_node_triangle((1.5 * size, -4 * size), lame=lame), 5.0, roots=3).complete
    assert check(gallery.clamped_block(4, 2, lame=lame), 2.0, roots=1).complete
    pull, springs = (0.0, 5e-4 * size), (0.04 * size, 0.02 * size)
    assert check(gallery.wedge(2, 3, pull=pull, springs=springs, lame=lame), 1.0, roots=3).complete


@pytest.mark.parametrize("exponent", [-12, -8, -4, 4, 8, 12])
def test_alpha(exponent):
    few, many = (1, 1) if exponent < 0 else (3, 3)
    for alpha in (10.0**exponent, Fraction(10) ** exponent):
        assert check(gallery.one_node_triangle(), alpha, roots=few).complete
        assert check(gallery.two_node_square((1.0, -4.0), (1.5, -3.5)), alpha, roots=many).complete
        assert check(gallery.clamped_block(4, 2), alpha, roots=1).complete
    slope = ((0.1, -1.1), (0.2, -0.8))
    assert check(gallery.two_node_square((0.4, 0.2), (1.8, -0.1), friction=4.0, load_slope=slope), alpha).complete


@pytest.mark.parametrize("exponent", [-40, 30])
def test_alpha_beyond_reason(exponent):
    # far out the count may stay open, but it says so
    for problem in (gallery.one_node_triangle(), gallery.two_node_square(), gallery.clamped_block(3, 2)):
        check(problem, 10.0**exponent)


def lame(nu, modulus=1.0):
    """Lame coefficients of Poisson's ratio and Young's modulus."""
    return modulus * nu / ((1 + nu) * (1 - 2 * nu)), modulus / (2 * (1 + nu))


@pytest.mark.parametrize("nu", [0.49, 0.4999999])
def test_nearly_incompressible(nu):
    assert check(gallery.clamped_block(4, 2, lame=lame(nu)), 1.0, roots=1).complete
    assert check(gallery.wedge(2, 3, lame=lame(nu)), 1.0).complete
    larger = check(gallery.clamped_block(16, 8, lame=lame(nu)), 1.0, exact=False)
    assert larger.complete
    assert larger.certified_data == "problem"


def test_incompressible_to_within_rounding():
    # 1 - 2 nu = 2e-10: the enclosure gives up, and what is certified is S and g as computed, or rationals
    small = check(gallery.clamped_block(4, 2, lame=lame(0.4999999999)), 1.0, roots=1)
    assert small.complete
    large = check(gallery.clamped_block(16, 8, lame=lame(0.4999999999)), 1.0, exact=False)
    if large.certified_data == "condensed":
        assert "S and g as computed" in repr(large)
        assert "as computed" in repr(verify(gallery.clamped_block(16, 8, lame=lame(0.4999999999)), large.proof))


@pytest.mark.parametrize("distance", [1e-4, 1e-8])
def test_a_node_next_to_another(distance):
    # a block on four contact nodes, two of which almost are one point: slender triangles and nearly equal rows of S
    x = np.array([0.0, 0.4, 0.4 + distance, 0.8, 1.0])
    points = np.array([[a, b] for b in (0.0, 0.5, 1.0) for a in x])
    cells = [(row * 5 + k, k) for row in range(2) for k in range(4)]
    triangles = [t for c, _ in cells for t in ((c, c + 1, c + 5), (c + 1, c + 6, c + 5))]
    problem = fem.contact_problem(
        points,
        triangles,
        (1.0, 1.0),
        contact=[1, 2, 3, 4],
        normals=(0.0, -1.0),
        held=[0, 5, 10],
        forces=fem.edge_forces(points, [(k, k + 1) for k in range(10, 14)], (0.3, -1.0)),
    )
    found = check(problem, 1.0)
    assert found.complete


def almost_dependent(seed, exponent, **more):
    """Two contact nodes whose rows differ by 10^-exponent; from 8 on S is definite only far within rounding."""
    rng = np.random.default_rng([seed, 2])
    rows, X = rng.normal(size=(4, 6)), rng.normal(size=(6, 8))
    rows[[1, 3]] = rows[[0, 2]] + 10.0**-exponent * rows[[1, 3]]
    return ContactProblem(X @ X.T, rows[:2], rows[2:], rng.normal(size=6), friction=1.0, **more)


@pytest.mark.parametrize("exponent", [4, 6, 8, 9])
def test_rows_that_are_almost_dependent(exponent):
    for seed in range(6):
        # floats only propose: whether they can factorize S depends on the processor, and the answer must not
        assert check(almost_dependent(seed, exponent), 0.0).complete


def test_no_load():
    for cells in (3, 16):
        problem = gallery.clamped_block(cells, 2, traction=(0.0, 0.0))
        found = check(problem, 1.0, roots=1, exact=cells < 4)
        assert found.complete
        assert not found[0].regular
        assert not np.any(found[0].lambda_n)
    # no load at this alpha alone
    path = ContactProblem(np.eye(2), [[1.0, 0.0]], [[0.0, 1.0]], [1.0, -1.0], friction=0.5, load_slope=[-3.0, 3.0])
    assert check(path, Fraction(1, 3), roots=1).complete
    assert check(path, 1 / 3, roots=1).complete


def test_load_that_leaves_the_contact_nodes_at_rest():
    problem = ContactProblem(np.eye(4), [[1.0, 0, 0, 0]], [[0.0, 1, 0, 0]], [0.0, 0.0, 1.0, 2.0], friction=1.0)
    assert check(problem, 0.0, roots=1).complete


def test_nodes_without_friction():
    rng = np.random.default_rng(4)
    for k in range(12):
        base = integer_problem(rng, 1 + k % 3)
        F = base.friction[0] * (rng.random(base.p) < 0.5)
        problem = ContactProblem(base.A, base.Bn, base.Bt, base.f, friction=(F, 0.0))
        assert check(problem, 0.0).complete
    block = gallery.clamped_block(4, 2, friction=((0.0, 0.5, 0.0, 0.5), 0.0))
    assert check(block, 0.0).complete
    assert check(gallery.clamped_block(4, 2), 0, roots=1).complete


def test_friction_that_vanishes_at_a_fraction():
    # exactly zero at 1/3, positive to the right, negative to the left; floats near 1/3 are on one side
    problem = gallery.clamped_block(3, 2, friction=(-1.0, 3.0))
    assert check(problem, Fraction(1, 3), roots=1).complete
    assert check(problem, Fraction(1, 3) + Fraction(1, 10**25), roots=1).complete
    with pytest.raises(enumsol.InvalidArgumentError, match="expected F >= 0"):
        enumerate_roots(problem, 1 / 3)


def test_friction_that_underflows_is_refused():
    triangle = gallery.one_node_triangle()
    slight = ContactProblem(triangle.A, triangle.Bn, triangle.Bt, triangle.f, friction=(0.0, 1e-300))
    with pytest.raises(enumsol.InvalidArgumentError, match="too small for float64"):
        enumerate_roots(slight, Fraction(1, 10**100))


@pytest.mark.parametrize("gap", [-1e-12, -1e-3, -1.0, -1e6, 1e-12, 1e6])
def test_press_fits_and_gaps(gap):
    assert check(gallery.clamped_block(4, 2, gap=gap), 1.0).complete


def test_loads_of_all_sizes():
    for size in (1e-250, 1e-100, 1e100, 1e250):
        problem = gallery.one_node_triangle((1.5 * size, -4 * size))
        assert check(problem, 5.0, roots=3).complete


def test_nothing_can_be_proven_about_a_body_on_the_verge(monkeypatch):
    # S definite only within rounding and too large for rationals: one undecided entry, and not 4^p of them
    monkeypatch.setattr(solvers, "EXACT_DOF_LIMIT", 0)
    monkeypatch.setattr(enclosure, "dense_eigenvalue_bound", lambda S: 0.0)
    problem = gallery.clamped_block(16, 8)
    found = enumerate_roots(problem, 1.0)
    monkeypatch.undo()
    assert not found.complete
    assert len(found.undecided) == 1
    assert "within rounding" in found.undecided[0].reason
    report = verify(problem, found.proof)
    assert report.ok
    assert report.undecided == 1


# -- regressions found by studies/extremes -----------------------------------------------------------------------------


def rescaled(problem, stiffness=1.0, load=1.0):
    """The problem in other units of stiffness and load."""
    gap, offset = (load / stiffness * part for part in (problem.gap, problem.slip_offset))
    A, f = stiffness * problem.A, load * problem.f
    return ContactProblem(A, problem.Bn, problem.Bt, f, gap, problem.friction, None, offset)


def test_values_of_a_root_lie_within_their_enclosure():
    # S and g in floats are less accurate than their enclosure: a node that is open by 7e-23 must not penetrate
    found = check(gallery.one_node_triangle((1.0 + 1e-16, -2.0)), 3.0)
    problems = [gallery.two_node_square(gap_free, (1.0, -1.0)) for gap_free in ((1.0, -3.0), (1e-9, -3.0))]
    rng = np.random.default_rng(0)
    for _ in range(30):
        base = integer_problem(rng, 3)
        problems.append(rescaled(base, *(10.0 ** rng.uniform(-12, 12, 2))))
    for problem in problems:
        for root in (*enumerate_roots(problem, 1.0), *found):
            for name in ("lambda_n", "lambda_t", "u_n", "u_t"):
                bounds, value = getattr(root.enclosure, name), getattr(root, name)
                assert np.all((bounds[:, 0] <= value) & (value <= bounds[:, 1]))
            assert np.all(root.u_n <= 0) or not root.regular


def test_the_unloaded_root_has_an_enclosure():
    (root,) = enumerate_roots(gallery.clamped_block(3, 2, traction=(0.0, 0.0)), 1.0)
    assert not np.any(root.enclosure.lambda_n)
    assert not np.any(root.enclosure.u_t)


@pytest.mark.parametrize("load", [1e-250, 1e-200])
def test_a_tiny_load_needs_no_rationals(load):
    # the radius of a load slope that is zero must not be that of the load's underflow
    found = enumerate_roots(rescaled(gallery.wedge(2, 3), load=load), 1.0)
    assert found.complete
    assert len(found) == 3
    assert found.stats.escalations.rationals == 0


@pytest.mark.parametrize("f", [(5e-324, 1.0e-323), (1e-300, 1e-305)])
def test_loads_next_to_underflow_are_refused(f):
    # units beyond 2^-900 were written into a proof that the checker then refused
    with pytest.raises(enumsol.InvalidProblemError, match="other units"):
        enumerate_roots(gallery.one_node_triangle(f), 1.0)


@pytest.mark.parametrize("arithmetic", ["fast", "verified", "exact"])
def test_huge_friction(arithmetic):
    for F in (1e20, 1e99):
        problem = ContactProblem(np.eye(2), [[1.0, 0.0]], [[0.0, 1.0]], [1.0, 0.5], friction=F)
        assert len(enumerate_roots(problem, 0.0, arithmetic)) == 1
    with pytest.raises(enumsol.InvalidProblemError, match="friction coefficient is 1e"):
        enumerate_roots(
            ContactProblem(np.eye(2), [[1.0, 0.0]], [[0.0, 1.0]], [1.0, 0.5], friction=1e200), 0.0, arithmetic
        )


@pytest.mark.parametrize("exponent", [8, 9])
def test_a_compliance_that_is_definite_by_accident_is_refused(exponent):
    # of some the Cholesky factorization succeeds, which ones depends on the processor
    for seed in range(20):
        problem = almost_dependent(seed, exponent)
        for call in (
            lambda problem=problem: enumerate_roots(problem, 0.0, "fast"),
            lambda problem=problem: enumsol.successive_approximations(problem, 0.0),
        ):
            with pytest.raises(enumsol.InvalidProblemError, match="independent beyond rounding"):
                call()


def test_the_checker_finds_better_bounds_than_the_search():
    # a body almost free to move: an approximate inverse of S has a small residual on one of its sides only
    problem = gallery.wedge(2, 2, springs=(1e-8, 1e-8))
    margins = pytest.importorskip("enumsol.search.certifiers._margin").Margins
    found = Solvers(problem, 1.0, "verified", 1e-9)
    system, rng = found.enclosed, np.random.default_rng(1)
    search = margins((system,), system.F, system.F)
    p, compared = problem.p, 0
    for _ in range(200):
        # rows -w_n >= 0 of all nodes and cones, with the multipliers of any size that no exclusion would have
        rows = np.concatenate([2 * p + np.arange(p), 3 * p + np.arange(p), 4 * p + np.arange(p)])
        values = 10.0 ** rng.uniform(-3, 3, len(rows))
        bounds = search.margin((6,) * p, rows, values), exclusion_margin(system, (6,) * p, rows, values)
        compared += np.isfinite(bounds[0])
        assert bounds[1] >= bounds[0]
    assert compared
    assert verify(problem, enumerate_roots(problem, 1.0, max_nodes=400).proof).ok


def test_large_bodies_are_certified_as_given():
    # ||L|| ||U|| in the Frobenius norm grows with n; sums of rows and columns of |L| |U| do not
    problem = gallery.clamped_block(60, 60, contact=4)
    assert balls._factor_error(problem.A) < 1e-11
    found = enumerate_roots(problem, 1.0)
    assert found.complete
    assert found.certified_data == "problem"


R = (1e-12, 1e-6, 1e6, 1e12)


@pytest.mark.parametrize("r", R)
def test_solutions_do_not_depend_on_r(r):
    for name in ("one-node-6.1", "two-node-6.4", "wedge-8-3", "clamped-block-8"):
        entry = gallery.get(name)
        problem = entry.build()
        roots = enumerate_roots(problem, entry.alpha)
        largest = max(float(np.max(root.lambda_n)) for root in roots)
        for root in roots:
            assert newton(problem, entry.alpha, root, r=r).statuses == root.statuses
        for start in (None, np.full(2 * problem.p, 0.3 * largest)):
            try:
                found = newton(problem, entry.alpha, start, r=r)
            except NotConverged:
                continue
            # at r = 1e-12 any point with lambda_n > 0 passed for a root
            assert found.regular
            assert any(np.allclose(found.lambda_n, root.lambda_n, atol=1e-8 * largest) for root in roots)


@pytest.mark.parametrize("r", R)
def test_paths_do_not_depend_on_r(r):
    problem = gallery.get("two-node-6.4").build()
    graph = branch_graph(problem, (0.0, 10.0))
    for start in graph.starting_points():
        path = follow(problem, start, 1, (0.0, 10.0), ContinuationOptions(r=r))
        usual = follow(problem, start, 1, (0.0, 10.0))
        assert audit(path, graph).ok
        assert path.status == usual.status
        assert [t.alpha for t in path.transitions] == pytest.approx([t.alpha for t in usual.transitions])


@pytest.mark.parametrize("r", [1e-12, 1e12])
def test_projections_keep_the_slip_bound(r):
    problem = gallery.one_node_triangle()
    root = next(root for root in enumerate_roots(problem, 5.0) if root.statuses[0].value == "slip-")
    x = np.concatenate([root.u, root.lambda_n, root.lambda_t])
    tangential = PiecewiseSmoothEquation(problem, r).residual(x, 5.0)[-1]
    assert abs(tangential) <= 1e-15 * np.max(np.abs(root.lambda_t))


def test_paths_with_huge_friction_and_tiny_loads():
    problem = gallery.two_node_square()
    for high in (1e6, 1e13):
        graph = branch_graph(problem, (0.0, high))
        for start in graph.starting_points():
            # the gradient of a regular selection is not singular because F is large
            assert len(start_tangents(problem, start, (0.0, high))) == 2
    small = rescaled(problem, load=1e-200)
    graph = branch_graph(small, (0.0, 10.0))
    for start in graph.starting_points():
        for direction in (1, -1):
            assert audit(follow(small, start, direction, (0.0, 10.0)), graph).ok


def test_an_interval_below_the_resolution_is_refused():
    problem = gallery.two_node_square()
    interval = (3.0 - 1e-9, 3.0 + 1e-9)
    graph = branch_graph(problem, interval)
    assert graph.complete
    start = graph.starting_points()[0]
    with pytest.raises(enumsol.InvalidArgumentError, match="branch_graph works without rounding"):
        follow(problem, start, 1, interval)


def test_audit_on_arcs_of_a_few_floats():
    # the difference quotient along an arc between neighbouring floats was 0 / 0
    problem = gallery.two_node_square()
    graph = branch_graph(problem, (3.0 - 1e-15, 3.0 + 1e-15))
    arc = graph.arcs[0]
    lambda_n, lambda_t = arc.values(arc.lo)
    frame = {"alpha": [arc.lo] * 2}
    for i in range(2):
        frame[f"lambda_n_{i}"] = [lambda_n[i] + 0.1] * 2
        frame[f"lambda_t_{i}"] = [lambda_t[i]] * 2
    assert len(audit(pd.DataFrame(frame), graph).off) == 2


def test_graphs_of_contact_rows_that_are_almost_dependent():
    # proven, in rationals where balls and floats tell nothing: not refused, nor a proof that fails
    for seed in range(6):
        for exponent in (6, 8, 9):
            problem = almost_dependent(seed, exponent, load_slope=np.random.default_rng(seed).normal(size=6))
            graph = branch_graph(problem, (0.0, 3.0))
            assert graph.complete
            assert graph.uniqueness_bound is None or (exponent == 6 and graph.uniqueness_bound >= 0.0)
            assert graph.proof is None or verify(problem, graph.proof).ok
            exact = enumerate_roots(problem, Fraction(3, 2), "exact", method="exhaustive")
            assert graph.multiplicity_at(1.5) == len(exact) + len(exact.families)
            assert len(graph.roots_at(1.5)) == len(exact)
            if exponent > 6:
                with pytest.raises(enumsol.InvalidProblemError, match="independent beyond rounding"):
                    branch_graph(problem, (0.0, 3.0), arithmetic="fast")
