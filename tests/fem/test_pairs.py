"""Two bodies in one mesh: patch tests, balance, matrices by hand, curved facets against closed forms."""

from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from alike import assert_close, assert_same
from complete import all_roots
from parted_meshes import grid
from parted_solids import rotation
from refusals import bad_argument, bad_problem
from two_bodies import blocks, boxes, shifted, stacked, together

import enumsol
from enumsol import fem
from enumsol.fem.contacts import faced

E, NU = 2.0, 0.3
STEEL = {"young": E, "poisson": NU}
PLANE_KINDS = (3, 6, 9, (3, 4))
SOLID_KINDS = (4, 8, 10, pytest.param(27, marks=pytest.mark.slow))


ROLLERS = {2: ["lower.bottom", "lower.left", "upper.left"]}
ROLLERS[3] = [*ROLLERS[2], "lower.front", "upper.front"]
ENDS = ["upper.top", "lower.bottom"]


def pressed(mesh, **more):
    """On rollers, under uniform pressure; the upper body stands on the lower one but for a weak spring."""
    given = {"symmetry": ROLLERS[mesh.points.shape[1]], "pressure": {"upper.top": 0.1}}
    return stacked(mesh, **{"friction": 0, **given, "spring": {"upper.top": (1e-7, 1e-7)}} | more)


def forces_on_nodes(problem, lambda_n, lambda_t):
    """Contact forces on all nodes, (N, d)."""
    forces = -problem.contact_rows.T @ np.concatenate([lambda_n, np.ravel(lambda_t, order="F")])
    return np.asarray(problem.mesh.motion @ forces).reshape(problem.mesh.points.shape)


# -- the patch test ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", PLANE_KINDS)
def test_a_constant_pressure_passes_exactly_where_meshes_match(kind):
    problem = pressed(blocks(kind, shake=0.05))
    (root,) = all_roots(problem, 0)
    assert np.array_equal(problem.gap, np.zeros(problem.p))
    assert np.allclose(fem.cell_stresses(problem, root.u), np.diag([0.0, -0.1]), rtol=0, atol=1e-6)
    assert np.isclose(root.lambda_n.sum(), 0.2, rtol=1e-6)


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("kind", SOLID_KINDS)
def test_a_constant_pressure_passes_exactly_in_3d(kind):
    problem = pressed(boxes(kind, *((1, 1) if kind == 27 else (2, 2))))
    (root,) = enumsol.enumerate_roots(problem, 0)
    assert np.allclose(fem.cell_stresses(problem, root.u), np.diag([0.0, 0.0, -0.1]), rtol=0, atol=1e-6)
    assert np.allclose(root.lambda_n, 0.1 * problem.areas, rtol=1e-5)


@pytest.mark.parametrize("kind", [3, 9])
def test_where_meshes_do_not_match_the_pressure_converges(kind):
    """In the mean over the bodies by at least the order 1/2 of what a layer of cells of size h with errors O(1) has."""
    errors = []
    for n in (2, 4, 8):
        problem = pressed(blocks(kind, 3 * n // 2, n))
        found = enumsol.successive_approximations(problem, 0)
        off = fem.cell_stresses(problem, found.u) - np.diag([0.0, -0.1])
        errors.append(np.sqrt(np.mean(np.sum(off**2, axis=(1, 2)))) / 0.1)
        assert np.isclose(found.lambda_n.sum(), 0.2, rtol=1e-6)  # the resultant at once
    assert errors[0] < 0.15
    assert errors[-1] < 0.6 * errors[0]
    assert all(after < before for before, after in pairwise(errors))


# -- balance -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [3, 9, (3, 4)])
def test_forces_and_moments_on_both_sides_balance(kind):
    acting = {"spring": {"upper.top": (0.1, 0.1)}, "load": {"upper.top": (0.05, -0.2)}}
    problem = stacked(blocks(kind, 3, 2), clamp="lower.bottom", **acting)
    (root,) = enumsol.enumerate_roots(problem, 0)
    assert {"slip+", "stick", "open"} & {str(status) for status in root.statuses}
    forces, points = forces_on_nodes(problem, root.lambda_n, root.lambda_t), problem.mesh.points
    upper = np.arange(len(points)) < len(grid(3, 2, kind).points)
    assert forces[upper].sum(axis=0)[1] > 0.1  # pressed upwards
    assert np.allclose(forces[upper].sum(axis=0), -forces[~upper].sum(axis=0), atol=1e-13)
    moments = points[:, 0] * forces[:, 1] - points[:, 1] * forces[:, 0]
    assert np.isclose(moments[upper].sum(), -moments[~upper].sum(), atol=1e-12)
    assert np.linalg.norm(root.lambda_t) > 1e-3


@pytest.mark.parametrize("kind", SOLID_KINDS)
def test_forces_and_moments_balance_in_3d(kind):
    """For any forces, not only those of a solution; the bodies are apart, so that friction has a moment."""
    gap = 0.05
    mesh = boxes(kind, 2, 1, gap)
    problem = stacked(mesh, clamp=ENDS)
    assert np.allclose(problem.gap, gap, rtol=1e-12)
    rng = np.random.default_rng(0)
    lambda_n, lambda_t = rng.uniform(size=problem.p), rng.normal(size=(problem.p, 2))
    forces = forces_on_nodes(problem, lambda_n, lambda_t)
    assert np.allclose(forces.sum(axis=0), 0, atol=1e-13)
    normal = forces_on_nodes(problem, lambda_n, 0 * lambda_t)
    assert np.allclose(np.cross(mesh.points, normal).sum(axis=0), 0, atol=1e-12)
    moment = np.cross(mesh.points, forces).sum(axis=0)
    assert np.all(np.abs(moment[:2]) <= gap * np.abs(lambda_t).sum())
    assert np.isclose(moment[2], 0, atol=1e-12)


# -- the same by hand --------------------------------------------------------------------------------------------------


def test_the_rows_are_those_that_are_written_by_hand():
    """Meshes that match: the example of docs/from_a_mesh.md, by node numbers."""
    upper, lower = fem.rectangle(4, 2), fem.rectangle(4, 2)
    mesh = together(("upper", shifted(upper.parted(), (0, 1))), ("lower", lower.parted()))
    K = fem.stiffness(upper.points, upper.triangles, fem.lame(**STEEL)).toarray()
    size = 2 * len(upper.points)
    A = np.zeros((2 * size, 2 * size))
    A[:size, :size] = A[size:, size:] = K
    Bn, Bt = np.zeros((2, 5, 2 * size))
    for row, (one, two) in enumerate(zip(upper.bottom, size // 2 + lower.top, strict=True)):
        Bn[row, [2 * one + 1, 2 * two + 1]] = -1, 1
        Bt[row, [2 * one, 2 * two]] = 1, -1
    f = np.zeros(2 * size)
    f[:size] = fem.edge_forces(upper.points, fem.edges_along(upper.right), (-0.3, -0.4)).ravel()
    held = np.concatenate([upper.top, size // 2 + lower.bottom])
    free = np.setdiff1d(np.arange(2 * size), [*(2 * held), *(2 * held + 1)])
    expected = enumsol.ContactProblem(A[np.ix_(free, free)], Bn[:, free], Bt[:, free], f[free], gap=0.001, friction=0.5)
    problem = stacked(mesh, gap=0.001, friction=0.5, clamp=ENDS, load={"upper.right": (-0.3, -0.4)})
    assert abs(problem.A - expected.A).max() < 1e-15
    assert_close(problem, expected, "Bn", "Bt", "f", "gap", atol=1e-14)
    pairs = zip(enumsol.enumerate_roots(problem, 0), enumsol.enumerate_roots(expected, 0), strict=True)
    assert all(one.statuses == two.statuses for one, two in pairs)


@pytest.mark.parametrize(("nodes", "weights"), [(2, [0.25, 0.75]), (3, [-0.125, 0.375, 0.75])])
def test_weights_between_nodes_are_the_shape_functions(nodes, weights):
    """A node a quarter from the right end of an edge; written from Lagrange's formula."""
    points = np.array([[0.75, 0.2], [0, 0], [1, 0], [0.5, 0]])
    facets, outward = np.array([[1, 2, 3][:nodes]]), np.tile([0.0, 1.0], (4, 1))
    _, found_weights, gaps = faced(points, np.array([0]), np.array([[0.0, -1.0]]), facets, outward, facets[:0])
    assert np.allclose(found_weights.toarray()[0, [1, 2, 3][:nodes]], weights)
    assert np.allclose(gaps, 0.2)


@pytest.mark.parametrize(("heights", "gap"), [((0.5, 0.2), 0.2), ((0.2, 0.5), 0.2), ((-0.1, 0.3), -0.1)])
def test_of_several_facets_the_nearest_counts(heights, gap):
    """A node at height 0 above two shelves of one part, one behind the other."""
    points = np.array([[0.5, 0.0], *([x, -height] for height in heights for x in (0, 1))])
    facets, outward = np.array([[1, 2], [3, 4]]), np.tile([0.0, 1.0], (5, 1))
    _, _, gaps = faced(points, np.array([0]), np.array([[0.0, -1.0]]), facets, outward, facets[:0])
    assert np.allclose(gaps, gap)
    outward[1 + 2 * int(np.argmin(np.abs(heights))) :][:2] *= -1  # the nearest one turns its back to the node
    _, _, gaps = faced(points, np.array([0]), np.array([[0.0, -1.0]]), facets, outward, facets[:0])
    assert np.allclose(gaps, max(heights))


@pytest.mark.parametrize("seed", range(20))
def test_points_that_are_faced_are_where_lines_cross_in_rationals(seed):
    """Random nodes and normals over a random polygon line, against Cramer's rule without rounding."""
    rng = np.random.default_rng(seed)
    line = np.c_[np.arange(7), rng.integers(-8, 8, 7) / 8]
    points = np.concatenate([np.c_[rng.integers(-8, 56, 6) / 8, rng.integers(12, 24, 6) / 8], line])
    normals = np.array([(a, -b) for a, b in rng.integers(1, 9, (6, 2)) * [rng.choice([-1, 1]), 1]]) / 1.0
    facets = np.stack([np.arange(6, 12), np.arange(7, 13)], axis=1)
    unit = normals / np.linalg.norm(normals, axis=1)[:, None]
    found, found_weights, gaps = faced(points, np.arange(6), unit, facets, np.tile([0.0, 1.0], (13, 1)), facets[:0])
    row = 0
    for k in range(6):
        x, n = ([Fraction(value) for value in vector] for vector in (points[k], normals[k]))
        crossings = []
        for one, two in facets.tolist():
            a, b = ([Fraction(value) for value in points[node]] for node in (one, two))
            t = [q - p for p, q in zip(a, b, strict=True)]
            det = n[1] * t[0] - n[0] * t[1]
            if det:
                d = [p - q for p, q in zip(x, a, strict=True)]
                xi, s = (n[1] * d[0] - n[0] * d[1]) / det, (t[1] * d[0] - t[0] * d[1]) / det
                if 0 <= xi <= 1:
                    crossings.append((abs(s), s, one, two, xi))
        assert found[k] == bool(crossings)
        if crossings:
            _, s, one, two, xi = min(crossings)
            assert np.isclose(gaps[row], float(s) * np.linalg.norm(normals[k]))
            expected = np.zeros(13)
            expected[[one, two]] = 1 - float(xi), float(xi)
            assert np.allclose(found_weights.toarray()[row], expected, atol=1e-8)
            row += 1


@pytest.mark.parametrize("kind", SOLID_KINDS)
def test_linear_fields_are_interpolated_exactly_in_3d(kind):
    """On boxes turned in space: weights times positions are where the line along the normal meets the plane."""
    rng, Q = np.random.default_rng([kind, 1]), rotation(kind)
    flat = boxes(kind, 3, 2, 0.125)
    mesh = fem.SolidMesh(flat.points @ Q.T, flat.cells, flat.facets)
    problem = stacked(mesh, clamp=ENDS)
    assert np.allclose(problem.gap, 0.125, rtol=1e-10)
    gradient = rng.normal(size=(3, 3))
    left = np.asarray(problem.mesh.motion.T @ (mesh.points @ gradient.T).ravel())
    normal = -Q[:, 2]
    # u(x) - u(y) with y - x = 0.125 n
    assert np.allclose(problem.Bn @ left, -0.125 * normal @ gradient @ normal, atol=1e-12)


# -- curved boundaries -------------------------------------------------------------------------------------------------


def arcs(kind, inner, outer, radii=(1.0, 1.0)):
    """A sector of a ring inside another one, over an angle of 1; they touch where both have their radius."""

    def bent(mesh, low):
        angle, radius = 1.0 + mesh.points[:, 0], low + mesh.points[:, 1]
        return type(mesh)(np.c_[radius * np.cos(angle), radius * np.sin(angle)], mesh.cells, mesh.facets)

    one, two = (grid(count, 1, kind, height=0.5) for count in (inner, outer))
    return together(("inner", bent(one, radii[0] - 0.5)), ("outer", bent(two, radii[1])))


@pytest.mark.parametrize("kind", [3, 6, 9])
def test_concentric_arcs_that_match_touch_everywhere(kind):
    mesh = arcs(kind, 4, 4)
    problem = fem.mesh_problem(
        mesh, **STEEL, pairs=[("inner.top", "outer.bottom")], clamp=["inner.bottom", "outer.top"], friction=0.3
    )
    assert problem.p == (5 if kind == 3 else 9)
    assert np.array_equal(problem.gap, np.zeros(problem.p))
    moved = forces_on_nodes(problem, np.ones(problem.p), np.zeros(problem.p))
    assert np.allclose(moved.sum(axis=0), 0, atol=1e-14)


@pytest.mark.parametrize(("kind", "order"), [(3, 2), (9, 3.5)])
def test_gaps_between_arcs_that_do_not_match_converge(kind, order):
    """Radii 1 and 1.1: the gap is 0.1, but for what facets cut off of a circle."""
    errors = []
    for n in (4, 8):
        problem = fem.mesh_problem(
            arcs(kind, n, 3 * n // 2, (1.0, 1.1)), **STEEL, pairs=[("inner.top", "outer.bottom")],
            clamp=["inner.left", "outer.top"], friction=0.3,
        )  # fmt: skip
        inside = np.abs(np.arctan2(problem.coordinates[:, 1], problem.coordinates[:, 0]) - 1.5) < 0.45
        errors.append(np.max(np.abs(problem.gap[inside] - 0.1)))
    assert errors[1] < errors[0] / 2 ** (order - 0.5)


# -- which nodes, and what else may be said of them --------------------------------------------------------------------


def test_nodes_that_face_nothing_have_no_contact():
    wide, narrow = grid(4, 1, 4, 2.0), grid(2, 1, 4, 1.0)
    mesh = together(("upper", shifted(wide, (0, 1.25))), ("lower", narrow))
    problem = stacked(mesh, clamp=ENDS)
    assert np.allclose(problem.coordinates[:, 0], [0, 0.5, 1])
    assert np.allclose(problem.gap, 0.25)


def test_a_given_gap_takes_the_place_of_that_of_the_mesh():
    mesh = blocks(4, gap=0.25)
    given = stacked(mesh, pairs=[("upper.bottom", "lower.top", -0.01)], clamp=ENDS)
    assert np.array_equal(given.gap, np.full(3, -0.01))
    assert np.allclose(stacked(mesh, gap=-0.05, clamp=ENDS).gap, 0.2)


@pytest.mark.parametrize("depth", [0.01, 0.4])
def test_bodies_that_overlap_are_pressed_together(depth):
    problem = stacked(blocks(4, 3, 2, gap=-depth), clamp=ENDS)
    assert problem.p == 4
    assert np.allclose(problem.gap, -depth)


def test_a_foundation_and_a_pair_in_one_problem():
    """Two blocks on a rigid floor: the lower one's nodes first, a chain of forces."""
    springs = dict.fromkeys(("upper.top", "lower.right"), (1e-07, 1e-07))
    given = {"symmetry": ["lower.left", "upper.left"], "pressure": {"upper.top": 0.1}, "spring": springs}
    problem = stacked(blocks(4, 2, 3), contact="lower.bottom", friction=0, **given)
    assert problem.p == 4 + 3
    assert np.allclose(problem.coordinates[:4, 1], 0)
    (root,) = enumsol.enumerate_roots(problem, 0)
    assert np.allclose([root.lambda_n[:4].sum(), root.lambda_n[4:].sum()], 0.2, rtol=1e-5)


def test_a_node_of_two_contacts_belongs_to_the_first():
    """An upper block in the corner of a floor and a wall that are bodies."""
    floor, wall = grid(2, 1, 4, 2.0), grid(1, 2, 4, 1.0, 2.0)
    mesh = together(("block", shifted(grid(2, 2, 4), (0, 1))), ("floor", floor), ("wall", shifted(wall, (-1, 1))))
    data = {**STEEL, "clamp": ["block.right", "floor.bottom", "wall.left"], "friction": 0.3}
    problem = fem.mesh_problem(mesh, **data, pairs=[("block.bottom", "floor.top"), ("block.left", "wall.right")])
    shared = "1 node of block.left belongs to another contact before, and not to the pair block.left:wall.right"
    assert shared in problem.notes
    assert f"note                {shared}" in repr(problem)
    assert len(set(problem.node_ids)) == problem.p == 3 + 2
    assert np.allclose(sorted(problem.coordinates.tolist()), [[0, 1], [0, 1.5], [0, 2], [0.5, 1], [1, 1]])


def test_a_node_at_which_both_parts_end_has_no_contact():
    """A crack from the left to the middle of one body: its tip is a node of both sides."""
    flat = grid(2, 2, 4)
    points = np.concatenate([flat.points, flat.points[[3]]])
    cells = flat.cells.copy()
    cells[2:][cells[2:] == 3] = 9  # above the crack
    sides = {"above": [[9, 4]], "below": [[3, 4]], "left": [[0, 3], [9, 6]]}
    mesh = fem.PartedMesh(points, cells, flat.facets | {name: np.array(rows) for name, rows in sides.items()})
    problem = fem.mesh_problem(mesh, **STEEL, pairs=[("above", "below")], clamp="right", friction=0.3)
    assert problem.node_ids == (9,)
    # the tip is where both faces end; a foundation would be a wall in the crack
    for part, other in (("above", "below"), ("below", "above")):
        message = rf"{part}, a face of a crack .*the pair {part}:{other}"
        bad_argument(message, fem.mesh_problem, mesh, **STEEL, contact=part, clamp="right", friction=0.3)


def test_displacements_that_are_given_on_the_other_body_are_gaps():
    """A clamped block below a block whose lower side is moved by hand, against a rigid obstacle that has moved."""
    push = (0.002, 0.01)
    problem = stacked(blocks(4), clamp="upper.top", displacement={"lower.top": push, "lower.bottom": push})
    upper = shifted(grid(2, 2, 4, 2.0), (0, 1))
    rigid = fem.mesh_problem(upper, **STEEL, contact="bottom", clamp="top", friction=0.3, gap=-push[1])
    (one,) = enumsol.enumerate_roots(problem, 0)
    (two,) = enumsol.enumerate_roots(rigid.replace(slip_offset=push[0]), 0)
    assert_close(one, two, "lambda_n", "lambda_t")
    assert one.statuses == two.statuses


def test_on_a_plane_of_symmetry_the_last_node_does_not_slip():
    problem = pressed(blocks(4), friction=0.4, load={"upper.right": (0.01, 0)})
    (root,) = enumsol.enumerate_roots(problem, 0)
    axis = int(np.argmin(problem.coordinates[:, 0]))
    assert root.u_t[axis] == root.lambda_t[axis] == 0


@pytest.mark.slow
def test_pictures_and_files_of_pairs(tmp_path):
    problem = pressed(blocks(4))
    (root,) = enumsol.enumerate_roots(problem, 0)
    assert root.plot_body() is not None
    enumsol.write_problem(problem, tmp_path / "pair.npz")
    again = enumsol.read_problem(tmp_path / "pair.npz")
    assert_same(again, problem, "fingerprint", "mesh.facets")
    for flat, rows in ((problem, problem.Bn), (again, again.Bn)):
        assert np.allclose(flat.mesh.directions(rows), [0, -1])


@pytest.mark.parametrize(
    ("pairs", "message"),
    [
        ([("upper.bottom", "lower.tpo")], "no facets named 'lower.tpo'; expected one of .*did you mean lower.top"),
        (("upper.bottom", "lower.top"), r"pairs is .*; expected a list of pairs such as \[\['upper', 'lower'\]\]"),
        ("upper.bottom", "pairs is 'upper.bottom'; expected a list of pairs"),
        ([("upper.bottom",)], r"pairs has the entry \('upper.bottom',\); expected two names of parts"),
        ([("upper.bottom", 3)], "pairs has the entry .*; expected two names"),
        ([("lower.top", "lower.top")], "pairs has lower.top with itself; expected two different parts"),
        ([("upper.bottom", "lower.top"), ("lower.top", "upper.bottom")], "pairs has lower.top:upper.bottom twice"),
        ([("upper.bottom", "lower.top", "x")], "gap of the pair upper.bottom:lower.top is 'x'; expected a finite"),
        ([("upper.top", "lower.bottom")], "upper.top of the pair .* has no node that faces a facet of lower.bottom"),
        ([("upper.top", "lower.top")], "upper.top of the pair .* has no node that faces a facet of lower.top along"),
        ([], "contact names no part; expected the contact boundary, or pairs"),
    ],
)
def test_bad_pairs_get_one_sentence(pairs, message):
    bad_argument(message, fem.mesh_problem, blocks(4), **STEEL, pairs=pairs, clamp=ENDS)


def test_bodies_that_share_their_nodes_are_one_body():
    flat = grid(2, 2, 4)
    facets = {**flat.facets, "one": np.array([[3, 4]]), "two": np.array([[4, 3]])}
    mesh = fem.PartedMesh(flat.points, flat.cells, facets)
    bad_argument("not a facet on the boundary", fem.mesh_problem, mesh, **STEEL, pairs=[("one", "two")], clamp="top")


def test_a_body_that_only_contact_holds_is_refused():
    bad_problem("is free to move as a rigid body; expected clamp", stacked, blocks(4), clamp="lower.bottom")
