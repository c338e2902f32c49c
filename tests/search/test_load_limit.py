"""Loads at the limit of what contact can hold: named, listed as a family where that is proven, no endless search."""

from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction

import numpy as np
import pytest
from flint import fmpq_mat
from helpers.floating_oracle import Oracle, block_on_table, random_body, rational, vertices
from scipy.spatial.transform import Rotation

import enumsol
from enumsol.search.setup import LIMIT_TOLERANCE, load_limit

NAMED = "the load is at the limit of what contact can hold"


def notes(problem, **options):
    return " ".join(enumsol.enumerate_roots(problem, 0, **options).notes)


@pytest.mark.parametrize(("push", "families"), [(0.75, 0), (1.0, 1), (1.25, 0)])
@pytest.mark.parametrize("arithmetic", ["verified", "exact"])
def test_the_limit_is_named_and_its_family_listed(push, families, arithmetic):
    problem = block_on_table(push=push)
    roots = enumsol.enumerate_roots(problem, 0, arithmetic=arithmetic)
    oracle = Oracle(problem)
    assert (len(roots), len(roots.families)) == (len(oracle.points), oracle.families)
    assert oracle.families == families
    assert roots.complete
    assert (NAMED in repr(roots)) == (push == 1.0)
    assert "change the load or the friction coefficients" in repr(roots) or push != 1.0


@pytest.mark.parametrize("nodes", [1, 5])
def test_the_family_is_there_before_the_tree(nodes):
    problem = block_on_table(cells=20, push=1.0)
    roots = enumsol.enumerate_roots(problem, 0, max_nodes=nodes)
    assert (len(roots), len(roots.families), roots.at_least, roots.complete) == (0, 1, 1, False)
    (part,) = roots.families[0].polytopes
    # all slip forward, and the body is pushed as far as is asked; the closed form of the forces' sums
    assert {str(status) for status in part.statuses} == {"slip+"}
    normal, across = np.moveaxis(part.vertices, 2, 0)
    assert np.allclose(across, 0.25 * normal, rtol=0, atol=1e-12)
    assert np.allclose(normal.sum(axis=1), 21)
    assert np.max(part.rigid_coordinates[:, 0]) == roots.rigid_bound.largest
    report = enumsol.verify(problem, roots.proof)
    assert report.ok
    assert (report.roots, report.families, report.complete) == (0, 1, False)


def exact_share(problem):
    """What the load exceeds friction by, exactly, for a flat table along x and one coefficient."""
    f = [Fraction(x) for x in problem.f.tolist()]
    return sum(f[::2]) + Fraction(float(problem.friction[0])) * sum(f[1::2])


def test_a_load_that_rounding_puts_beyond_the_limit():
    problem = enumsol.gallery.block_on_table(8, 2, push=1.0)
    beyond = exact_share(problem)
    assert abs(beyond) < 1e-14
    # the bound is used, instead of rationals that find out whether it is needed
    roots = enumsol.enumerate_roots(problem, 0, max_nodes=400)
    assert roots.complete
    assert beyond <= 0 or (len(roots), len(roots.families)) == (0, 0)
    assert len(roots.families) == (beyond == 0)
    assert NAMED in repr(roots)
    report = enumsol.verify(problem, roots.proof)
    assert report.complete
    assert (report.within is not None) == roots.rigid_bound.needed


def large_block(push=1.0):
    """Beyond 250 degrees of freedom: no rationals."""
    return enumsol.gallery.block_on_table(14, 8, push=push)


@pytest.mark.parametrize("workers", [0, 2])
def test_a_search_without_hope_ends(workers):
    problem = large_block()
    assert problem.n > 250
    with ThreadPoolExecutor(2) as executor:
        roots = enumsol.enumerate_roots(problem, 0, executor=executor if workers else None)
    assert "at the limit of what contact can hold, where rounding decides" in roots.stopped
    assert not roots.complete
    assert roots.stats.nodes < 2000
    assert NAMED in repr(roots)
    assert any("hold the body by a spring" in part.hint for part in roots.undecided)
    report = enumsol.verify(problem, roots.proof)
    assert report.ok
    assert not report.complete


@pytest.mark.parametrize("space", [False, True])
def test_a_search_that_might_not_end_does(space, monkeypatch):
    monkeypatch.setattr("enumsol.search.setup._AT_LIMIT", 240 if space else 30)
    flat = block_on_table(cells=20, push=1.0)
    problem = enumsol.gallery.block_on_table3d(2, push=(0.6, 0.8)) if space else flat
    roots = enumsol.enumerate_roots(problem, 0)
    assert 30 <= roots.stats.nodes < 100
    assert "at the limit" in roots.stopped
    assert NAMED in repr(roots)
    assert len(roots.families) == (not space)
    # so does one that has more time; another number of nodes is kept
    assert enumsol.enumerate_roots(problem, 0, time_limit=60).stats.nodes == roots.stats.nodes
    longer = enumsol.enumerate_roots(problem, 0, max_nodes=64)
    assert longer.stats.nodes == 64
    assert "max_nodes" in longer.stopped
    assert NAMED in repr(longer)


def most_work(problem):
    """The most work along motions that no contact forces promote, exactly; None where K is flat, or all there is."""
    N, (F, _), p = problem.rigid_modes, problem.affine_friction, problem.p
    G = problem.contact_rows.toarray() @ N  # of small whole numbers and their quarters
    rays = [list(map(rational, G[i] + side * F[i] * G[p + i])) for i in range(p) for side in (-1, 1)]
    if fmpq_mat(rays).rank() < len(rays[0]):
        return None
    pressing = [sum(column, rational(0)) for column in zip(*rays, strict=True)]
    corners = vertices([(pressing, rational(1))], [([-x for x in ray], rational(0)) for ray in rays])
    h = list(map(rational, N.T @ problem.f))
    return max((sum((x * y for x, y in zip(z, h, strict=True)), rational(0)) for z in corners), default=None)


@pytest.mark.few(4, 10)
@pytest.mark.parametrize("first", range(0, 1000, 20))
def test_limits_of_random_bodies_against_rationals(first):
    for problem in map(random_body, range(first, first + 20)):
        work = most_work(problem)
        if work is not None and np.any(problem.rigid_modes.T @ problem.f):
            assert (load_limit(problem, 0) is not None) == (work == 0)


@pytest.mark.parametrize("share", [0.0, 0.5, 1 - 1e-6, 1.0, 1 + 1e-6, 1.5])
@pytest.mark.parametrize("angle", [0.0, 0.3, 2.0])
def test_the_limit_in_space_is_a_disc(share, angle):
    push = share * np.cos(angle), share * np.sin(angle)
    for cells in (1, 3):
        found = load_limit(enumsol.gallery.block_on_table3d(cells, cells, push=push), 0)
        assert (found is not None) == (share == 1.0)


UNITS = (1e6, 1.0), (1e-250, 1.0), (1e250, 1.0), (1.0, 1e-14), (1.0, 1e14)


@pytest.mark.parametrize("angle", np.linspace(0.1, 6.0, 7))
def test_the_limit_does_not_depend_on_units_axes_or_the_basis_of_the_modes(angle):
    change = Rotation.from_euler("z", angle).as_matrix() * 3
    for push in (0.999, 1.0, 1.001):
        problem = enumsol.gallery.block_on_table(3, 2, push=push)
        f, Bn, Bt = problem.f, problem.Bn, problem.Bt
        scaled = [problem.replace(f=factor * f, Bn=rows * Bn, Bt=rows * Bt) for factor, rows in UNITS]
        turned = problem.replace(rigid_modes=problem.rigid_modes @ change)
        assert all((load_limit(p, 0) is not None) == (push == 1.0) for p in (problem, *scaled, turned))


def test_a_load_over_the_edge_is_at_the_limit_of_tilting():
    problem = block_on_table(cells=2)
    for shares, limit in (((1, 1, 1), False), ((2, 1, 0), False), ((3, 0, 0), True), ((3.5, 0, -0.5), False)):
        f = problem.f.copy()
        f[7::2] = -np.array(shares)
        tilted = problem.replace(f=f)
        found = load_limit(tilted, 0)
        assert (found is not None) == limit
        assert (NAMED in notes(tilted)) == limit
        # held at the edge alone, or not at all
        oracle = Oracle(tilted)
        assert bool(oracle.families) == limit
        assert bool(oracle.parts) == (shares[2] >= 0)


def test_what_is_no_limit():
    # without friction the body slides freely, without load it floats: nothing is nearly held
    frictionless, unloaded = block_on_table(friction=0.0), block_on_table(press=0.0)
    assert load_limit(frictionless, 0) is None
    assert load_limit(unloaded, 0) is None
    assert load_limit(block_on_table(press=-1.0), 0) is None
    assert load_limit(block_on_table(press=1e308), 0) is None
    assert load_limit(block_on_table(press=2.0**1020, push=1.0), 0) is not None
    pushed = block_on_table(push=1.0)
    assert abs(load_limit(pushed, 0).beyond) < LIMIT_TOLERANCE
    nearly = pushed.replace(friction=0.25 * (1 + 1e-6))
    assert load_limit(nearly, 0) is None
    assert notes(nearly) == ""


def test_a_history_keeps_the_note(tmp_path):
    problem = block_on_table(cells=1, push=1.0)
    found = enumsol.histories(problem, [problem.f], arithmetic="exact")
    (stage,) = found.stages(1)
    assert NAMED in " ".join(stage.roots.notes)
    found.save(tmp_path / "history.json")
    (again,) = enumsol.History.load(tmp_path / "history.json", problem).stages(1)
    assert (again.roots.notes, again.roots.rigid_bound) == (stage.roots.notes, stage.roots.rigid_bound)
