"""Gallery problems: closed forms, geometry, root counts by brute force where p is small, the registry."""

import math
from functools import partial

import numpy as np
import pytest
from alike import assert_close, assert_same
from complete import all_roots
from effort import some
from oracles import brute_force, condense
from refusals import bad_argument

import enumsol
from enumsol import fem, gallery

OPEN, STICK, SLIP_PLUS, SLIP_MINUS = range(4)


def roots_of(problem, alpha):
    """Selections that hold, by brute force."""
    return brute_force(*condense(problem, alpha))[0]


def test_one_node_closed_form_does_not_depend_on_assembly():
    problem = gallery.one_node_triangle((1.5, -4.0), (2.0, 3.0))
    assert np.array_equal(problem.A.toarray(), [[5.5, -2.5], [-2.5, 5.5]])
    assert np.array_equal(problem.f, [1.5, -4.0])


@pytest.mark.parametrize(("alpha", "count"), [(1.0, 1), (2.5, 1), (2.7, 3), (5.0, 3), (40.0, 3)])
def test_one_node_roots(alpha, count):
    roots = roots_of(gallery.one_node_triangle(), alpha)
    assert len(roots) == count
    if count == 3:
        normal = {root.codes[0]: root.forces[0] for root in roots}
        assert normal == {OPEN: 0.0, STICK: pytest.approx(1.5), SLIP_MINUS: pytest.approx(1 / (alpha - 2))}


@pytest.mark.slow
def test_one_node_criterion():
    rng = np.random.default_rng(0)
    seen = set()
    for _ in range(some(20, of=50)):
        lame = tuple(rng.uniform(0.1, 3.0, 2))
        f = rng.normal(size=2) * (1.0, 3.0)
        s = (lame[0] + 3 * lame[1]) * f[0] + (lame[0] + lame[1]) * f[1]
        two_branches = s < 0 < f[0]
        counts = {len(roots_of(gallery.one_node_triangle(tuple(f), lame), alpha)) for alpha in (0.1, 1.0, 5.0, 1e3)}
        assert counts <= ({1, 3} if two_branches else {1})
        seen.add(two_branches)
    assert seen == {True, False}


def test_two_node_square_agrees_with_scikit_fem():
    lame = (1.3, 0.7)
    square = gallery.two_node_square(lame=lame)
    assembled = fem.contact_problem(
        [[0, 0], [1, 0], [0, 1], [1, 1]], [[0, 1, 2], [1, 3, 2]], lame, contact=[0, 1], normals=[[0, -1], [1, 0]],
        held=[2, 3], forces=[[-3, -1], [1, -1], [0, 0], [0, 0]],
    )  # fmt: skip
    assert_close(square, assembled, "condensed.S", "condensed.g0", rtol=1e-13, atol=1e-13)
    assert_same(square, assembled, "coordinates")


def test_two_node_square_is_exact_for_simple_coefficients():
    A = gallery.two_node_square().A.toarray()
    assert np.array_equal(2 * A, np.round(2 * A))


@pytest.mark.parametrize(("alpha", "count"), [(1.0, 1), (2.9, 1), (3.1, 5), (3.8, 5), (3.9, 3), (20.0, 3)])
def test_two_node_square_with_the_loads_of_example_6_4(alpha, count):
    assert len(roots_of(gallery.two_node_square(), alpha)) == count


@pytest.mark.parametrize(
    ("sign", "alpha", "count"), [(-1, 1.0, 1), (-1, 1.6, 3), (-1, 2.8, 1), (1, -1.5, 1), (1, -1.0, 3), (1, 1.6, 1)]
)
def test_two_node_square_on_the_loading_path_of_example_6_7(sign, alpha, count):
    slope = ((0.1, sign * 1.1), (0.2, sign * 0.8))
    problem = gallery.two_node_square((0.4, 0.2), (1.8, -0.1), friction=4.0, load_slope=slope)
    expected = [0.1 * alpha + 0.4, sign * 1.1 * alpha + 0.2, 0.2 * alpha + 1.8, sign * 0.8 * alpha - 0.1]
    assert np.allclose(problem.load_at(alpha), expected, rtol=1e-14)
    assert len(roots_of(problem, alpha)) == count


@pytest.mark.parametrize("length", [1.0, 2.0])
@pytest.mark.parametrize("traction", [(0.3, -1.0), (1.0, -0.3), (0.0, -1.0)])
def test_clamped_block_has_one_root(length, traction):
    problem = gallery.clamped_block(4, 3, length, traction=traction)
    for alpha in (1.0, 2.0, 5.0, 10.0):
        assert len(roots_of(problem, alpha)) == 1


def test_clamped_block_geometry_and_load():
    problem = gallery.clamped_block(4, 3, length=2.0, height=0.5, traction=(0.3, -1.0), gap=0.1, friction=0.4)
    assert (problem.p, problem.n) == (4, 2 * 4 * 4)
    assert np.allclose(problem.coordinates, [[0.5, 0], [1, 0], [1.5, 0], [2, 0]])
    assert np.all(problem.gap == 0.1)
    # a unit displacement up moves every contact node away from the floor, one to the right slips forward
    assert np.array_equal(problem.Bn @ np.tile([0.0, 1.0], 16), -np.ones(4))
    assert np.array_equal(problem.Bt @ np.tile([1.0, 0.0], 16), np.ones(4))
    # of the top's total load, half an edge goes to the clamped corner
    assert np.allclose(problem.f.reshape(-1, 2).sum(axis=0), np.array([0.3, -1.0]) * 2.0 * (1 - 1 / 8))


def test_clamped_block_with_fewer_contact_nodes():
    fine = gallery.clamped_block(12, 3, contact=4)
    assert np.allclose(fine.coordinates[:, 0], [0.25, 0.5, 0.75, 1.0])
    assert fine.n == gallery.clamped_block(12, 3).n


@pytest.mark.parametrize("ny", [1, 4, 7])
def test_wedge_geometry(ny):
    angle = math.radians(20.0)
    problem = gallery.wedge(4, ny)
    left, right = np.split(problem.coordinates, 2)
    assert problem.p == 2 * ny
    assert np.allclose(right[:, 0], 0.5 + right[:, 1] * math.tan(angle))
    assert np.allclose(left, right * [-1, 1])
    assert np.all(np.diff(right[:, 1]) > 0) if ny > 1 else right[0, 1] == 0
    # pulling the body straight out: both sides leave their walls and slide out
    up = np.tile([0.0, 1.0], problem.n // 2)
    assert np.allclose(problem.Bn @ up, -math.sin(angle))
    assert np.allclose(problem.Bt @ up, math.cos(angle))
    assert np.all(problem.gap < 0)


def test_wedge_is_symmetric():
    S = gallery.wedge(4, 3).condensed.S
    mirror = np.concatenate([np.arange(3, 6), np.arange(3), np.arange(9, 12), np.arange(6, 9)])
    assert np.allclose(S, S[np.ix_(mirror, mirror)], rtol=1e-10)


def test_small_wedge_jams_slides_or_is_free():
    roots = roots_of(gallery.wedge(4, 2), 1.0)
    assert {root.codes for root in roots} == {(OPEN,) * 4, (STICK,) * 4, (SLIP_PLUS,) * 4}


def test_wedge_roots_scale_with_pull_and_press():
    first = roots_of(gallery.wedge(4, 2), 1.0)
    second = roots_of(gallery.wedge(4, 2, pull=(0.0, 5.0), press=5.0), 1.0)
    for one, other in zip(first, second, strict=True):
        assert one.codes == other.codes
        assert np.allclose(1e4 * one.forces, other.forces, rtol=1e-9, atol=0)


@pytest.mark.parametrize("coupling", [0.0, 0.05])
@pytest.mark.parametrize("p", [1, 2, 3, 4])
def test_chain_has_three_roots_a_node(p, coupling):
    roots = roots_of(gallery.chain(p, coupling), 5.0)
    assert len(roots) == 3**p
    assert min(root.slack for root in roots) > 0.05


def test_chain_couples_neighbours_only():
    A = gallery.chain(4, 0.5).A.toarray() - gallery.chain(4).A.toarray()
    assert np.array_equal(A[::2, ::2], 0.5 * np.array([[1, -1, 0, 0], [-1, 2, -1, 0], [0, -1, 2, -1], [0, 0, -1, 1]]))
    assert np.array_equal(A[1::2, 1::2], A[::2, ::2])
    assert not np.any(A[::2, 1::2])


@pytest.mark.parametrize("name", gallery.GALLERY)
def test_registry_builds(name):
    entry = gallery.get(name)
    problem = entry.build()
    assert entry.name == name
    assert entry.summary
    assert problem.coordinates.shape == (problem.p, entry.dimension)
    assert np.all(problem.friction_at(entry.alpha) > 0)
    if entry.dimension == 3:
        assert name in {"one-node-3d", "one-node-3d-3", f"block3d-{problem.p}", f"wedge3d-{problem.p}-{entry.roots}"}
        if problem.p < 16 and "wedge" not in name:  # those in tests/roots
            assert len(all_roots(problem, entry.alpha)) == entry.roots
    elif problem.p <= 4 and entry.roots is not None:
        roots = roots_of(problem, entry.alpha)
        assert len(roots) == entry.roots
        assert min(root.slack for root in roots) > 1e-3


def test_unknown_name_is_answered_with_close_ones():
    bad_argument(r"'wedge-14'; did you mean .*wedge-14-3", gallery.get, "wedge-14")
    bad_argument(r"'zzz'; expected one of one-node-6\.1, .*chain-8", gallery.get, "zzz")


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: gallery.one_node_triangle(f=(1.0,)), r"f is \(1\.0,\); expected two finite numbers"),
        (lambda: gallery.one_node_triangle(lame=(1.0, 0.0)), r"lame is \(1\.0, 0\.0\); expected Lame coefficients"),
        (lambda: gallery.two_node_square(f2="ab"), "f2 is 'ab'; expected two finite numbers"),
        (lambda: gallery.two_node_square(load_slope=(1.0, 2.0, 3.0)), "load_slope is .* expected two pairs"),
        (lambda: gallery.two_node_square(load_slope=(1.0, 2.0)), r"load_slope\[0\] is 1\.0; expected two"),
        (lambda: gallery.clamped_block(0, 2), "nx is 0; expected an integer of at least 1"),
        (lambda: gallery.clamped_block(2, 2.5), r"ny is 2\.5; expected an integer"),
        (lambda: gallery.clamped_block(2, 2, length=-1.0), r"length is -1\.0; expected a finite number > 0"),
        (lambda: gallery.clamped_block(2, 2, traction=(0.0, math.nan)), "traction is .* expected two finite numbers"),
        (lambda: gallery.clamped_block(2, 2, gap="wide"), "gap is 'wide'; expected a finite number"),
        (lambda: gallery.clamped_block(6, 2, contact=4), "contact is 4; expected a divisor of nx = 6"),
        (lambda: gallery.wedge(2, 2, half_angle=85.0), r"half_angle is 85\.0; expected degrees between 0 and 80"),
        (lambda: gallery.wedge(2, 2, springs=(0.0, 1.0)), r"springs is \(0\.0, 1\.0\); expected two stiffnesses > 0"),
        (lambda: gallery.wedge(2, 2, press=math.inf), "press is inf; expected a finite number"),
        (lambda: gallery.chain(0), "p is 0; expected an integer of at least 1"),
        (lambda: gallery.chain(2, coupling=-0.1), r"coupling is -0\.1; expected a finite number >= 0"),
    ],
)
def test_bad_arguments_are_named(build, message):
    bad_argument(message, build)


def test_one_node_3d_has_the_compliance_and_free_displacement_of_the_public_test():
    problem = gallery.one_node_3d()
    W = np.array([[15.0, -1.0, -2.0], [-1.0, 14.0, 1.0], [-2.0, 1.0, 16.0]])
    assert np.array_equal(problem.A.toarray(), W)
    assert np.allclose(problem.condensed.S, W, rtol=1e-15)
    assert np.allclose(problem.condensed.g0, [1.0, -2.0, -3.0], rtol=1e-15)
    # sliding with friction 0.1 by hand: u_n = 0 and r_t = -0.1 r_n u_t / |u_t| leave one equation for the direction
    q, angle = np.array([-1.0, 2.0, 3.0]), np.linspace(0, 2 * np.pi, 100_001)
    pull = np.stack([np.ones_like(angle), -0.1 * np.cos(angle), -0.1 * np.sin(angle)])
    normal = -q[0] / (W[0] @ pull)
    u = (W @ pull) * normal + q[:, None]
    along = np.cos(angle) * u[1] + np.sin(angle) * u[2]
    across = np.cos(angle) * u[2] - np.sin(angle) * u[1]
    found = int(np.argmin(np.abs(across) + np.where(along > 0, 0, 10)))
    w = problem.condensed.free_displacements(0) - problem.condensed.S @ (pull[:, found] * normal[found])
    assert np.allclose(w, -u[:, found], atol=1e-12)
    assert normal[found] > 0
    assert abs(w[0]) < 1e-14


def test_block3d_geometry_and_load():
    problem = gallery.block3d(4, 3, 2, pull=(0.1, 0.2, -1.0), size=(2.0, 1.5, 0.5), friction=(0.5, 0.3), gap=0.1)
    assert (problem.p, problem.n) == (16, 3 * 4 * 4 * 3)
    assert np.array_equal(np.unique(problem.coordinates[:, 0]), [0.5, 1.0, 1.5, 2.0])
    assert not np.any(problem.coordinates[:, 2])
    assert np.all(problem.gap == 0.1)
    # the top carries the traction, of which the clamped side takes its share
    assert np.allclose(problem.f.reshape(-1, 3).sum(axis=0), np.array([0.1, 0.2, -1.0]) * 3.0 * (1 - 1 / 8))
    assert np.array_equal(problem.friction_at(7.0), np.tile([0.5, 0.3], (16, 1)))
    assert np.array_equal(gallery.block3d(1, 1, 1).friction_at(2.0), [[2.0, 1.2], [2.0, 1.2]])
    # hexahedra and tetrahedra tell much the same of a load without contact
    whole, cut = (gallery.block3d(6, 6, 6, cells=cells).condensed.g0 for cells in ("hexahedra", "tetrahedra"))
    assert np.linalg.norm(whole - cut) < 0.2 * np.linalg.norm(whole)


def test_block3d_is_its_own_mirror_image():
    """Mirrored at y = 1/2 under a pull in the plane: nodes change places, second tangents their sign."""
    problem = gallery.block3d(3, 3, 2, pull=(0.5, 0.0, -1.0))
    rows = np.arange(12).reshape(4, 3)[::-1].ravel()
    mirror = np.concatenate([rows, 12 + rows, 24 + rows])
    sign = np.repeat([1.0, 1.0, -1.0], 12)
    S = problem.condensed.S
    assert np.allclose(S, sign[:, None] * S[np.ix_(mirror, mirror)] * sign, rtol=0, atol=1e-13)
    assert np.allclose(problem.condensed.g0, sign * problem.condensed.g0[mirror], rtol=0, atol=1e-13)


@pytest.mark.parametrize(("multipliers", "p"), [("elements", 8), ("nodes", 18)])
def test_wedge3d_geometry_and_load(multipliers, p):
    slope = math.radians(20.0)
    problem = gallery.wedge3d(2, 2, 3, (0.1, 0.2, 0.3), multipliers=multipliers, size=(1.0, 2.0, 3.0))
    x, y, z = problem.coordinates.T
    assert problem.p == p
    assert np.allclose(np.abs(x), 0.5 + z * math.tan(slope))
    assert np.max(z) == (1.5 if multipliers == "elements" else 2.0)
    if multipliers == "elements":
        assert np.allclose(problem.coordinates[:4], problem.coordinates[4:] * [-1, 1, 1])
        assert gallery.wedge3d(2, 2, 3, ratio=2).p == 2
    # rigid motions in terms of the local axes: across, along the notch and out of it
    across, along, out = (np.tile(direction, problem.n // 3) for direction in np.eye(3))
    side, c, s = np.sign(x), math.cos(slope), math.sin(slope)
    expected = {"Bn": (side * c, 0 * y, -s), "Bt1": (side * s, 0 * y, c), "Bt2": (0 * y, -side, 0)}
    for name, values in expected.items():
        for motion, value in zip((across, along, out), values, strict=True):
            assert np.allclose(getattr(problem, name) @ motion, value, atol=1e-12), name
    # springs and load are what was asked for in all
    top = 1.0 * 2.0 + 2.0 * 3.0 * math.tan(slope) * 2.0
    assert np.allclose(problem.f.reshape(-1, 3).sum(axis=0), np.array([0.1, 0.2, 0.3]) * top)
    stiffness = [motion @ (problem.A @ motion) for motion in (across, along, out)]
    assert np.allclose(stiffness, [0.04, 0.04, 0.02])
    assert np.all(problem.gap == -5e-4)
    assert np.array_equal(problem.friction_at(2.0), np.tile([2.0, 1.2], (p, 1)))


wedge3d = partial(gallery.wedge3d, 1, 1, 2)


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: gallery.one_node_3d(W=np.eye(2)), r"W has shape \(2, 2\); expected \(3, 3\)"),
        (lambda: gallery.one_node_3d(W=-np.eye(3)), "W is not symmetric positive definite"),
        (lambda: gallery.one_node_3d(W=np.triu(np.ones((3, 3)))), "W is not symmetric positive definite"),
        (lambda: gallery.one_node_3d(q=(1, 2)), r"q is \(1, 2\); expected three finite numbers"),
        (lambda: gallery.block3d(0, 1, 1), "nx is 0; expected an integer of at least 1"),
        (lambda: gallery.block3d(1, 1, 1, pull=(0, 1)), r"pull is \(0, 1\); expected three finite numbers"),
        (lambda: gallery.block3d(1, 1, 1, gap="wide"), "gap is 'wide'; expected a finite number"),
        (lambda: gallery.wedge3d(1, 1, 1), "nz is 1; expected an integer of at least 2"),
        (lambda: wedge3d(springs=(1, 1, 0)), r"springs is \(1, 1, 0\); expected three stiffnesses > 0"),
        (lambda: wedge3d(half_angle=81), "half_angle is 81; expected degrees between 0 and 80"),
        (lambda: wedge3d(pull=(0, 1)), r"pull is \(0, 1\); expected three finite numbers"),
        (lambda: wedge3d(press=math.nan), "press is nan; expected a finite number"),
        (lambda: wedge3d(multipliers="facets"), "multipliers is 'facets'; expected"),
    ],
)
def test_bad_arguments_of_problems_in_3d_are_named(build, message):
    bad_argument(message, build)


def test_functions_for_2d_say_what_takes_problems_in_3d():
    what = r"is a ContactProblem3D; .* \(problems in 3D are taken by enum"
    bad_argument(what, enumsol.PiecewiseSmoothEquation, gallery.block3d(1, 1, 1))
