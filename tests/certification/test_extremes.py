"""Extreme data: complete, or undecided with a reason; where exact arithmetic can tell, the count is right."""

from fractions import Fraction

import numpy as np
import pytest
from generators import integer_problem

import enumsol
from enumsol import ContactProblem, enumerate_roots, fem, gallery, verify
from enumsol.certification import enclosure
from enumsol.enumeration import exact_selections


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


def test_rows_that_are_almost_dependent():
    rng = np.random.default_rng(2)
    for exponent in (4, 6, 8):
        rows = rng.normal(size=(4, 6))
        rows[1] = rows[0] + 10.0**-exponent * rows[1]
        rows[3] = rows[2] + 10.0**-exponent * rows[3]
        X = rng.normal(size=(6, 8))
        check(ContactProblem(X @ X.T, rows[:2], rows[2:], rng.normal(size=6), friction=1.0), 0.0)


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
    with pytest.raises(enumsol.InvalidArgumentError, match="too small for float64"):
        enumerate_roots(gallery.one_node_triangle(), Fraction(1, 10**400))


@pytest.mark.parametrize("gap", [-1e-12, -1e-3, -1.0, -1e6, 1e-12, 1e6])
def test_press_fits_and_gaps(gap):
    assert check(gallery.clamped_block(4, 2, gap=gap), 1.0).complete


def test_loads_of_all_sizes():
    for size in (1e-250, 1e-100, 1e100, 1e250):
        problem = gallery.one_node_triangle((1.5 * size, -4 * size))
        assert check(problem, 5.0, roots=3).complete


def test_nothing_can_be_proven_about_a_body_on_the_verge(monkeypatch):
    # S definite only within rounding and too large for rationals: one undecided entry, and not 4^p of them
    monkeypatch.setattr(exact_selections, "EXACT_DOF_LIMIT", 0)
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
