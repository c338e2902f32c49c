"""Contact and ties of nodes that are given one by one: rows by hand, whole facets, closed forms of nearest points."""

from dataclasses import replace

import meshio
import numpy as np
import pytest
from alike import assert_close
from parted_meshes import grid
from parted_solids import solid
from refusals import bad_argument
from two_bodies import blocks, boxes, shifted, stacked, together

import enumsol
from enumsol import fem

LAME = fem.lame(young=2.0, poisson=0.3)
ENDS = ["upper.top", "lower.bottom"]
ALONE = [("ALONE", "lower.top")]


def with_nodes(mesh, nodes):
    return replace(mesh, node_sets={"ALONE": np.asarray(nodes)})


def free_columns(rows, held):
    d = rows.shape[0]
    keep = np.ones(rows.shape[2] // d, dtype=bool)
    keep[np.unique(held)] = False
    return rows[:, :, np.repeat(keep, d)]


def assert_same_roots(one, two):
    pairs = list(zip(enumsol.enumerate_roots(one, 0), enumsol.enumerate_roots(two, 0), strict=True))
    assert pairs
    for ours, theirs in pairs:
        assert ours.statuses == theirs.statuses
        assert_close(ours, theirs, "lambda_n", "lambda_t", atol=1e-12)


# -- rows by hand ------------------------------------------------------------------------------------------------------


def test_two_nodes_against_a_body_are_rows_by_hand():
    upper, lower = fem.rectangle(4, 2), fem.rectangle(4, 2)
    mesh = together(("upper", shifted(upper.parted(), (0.1, 1.01))), ("lower", lower.parted()))
    count, two = len(upper.points), upper.bottom[[1, 3]]
    rows = np.zeros((2, 2, 4 * count))  # directions, nodes, displacements
    for row, (node, left) in enumerate(zip(two, count + lower.top[[1, 3]], strict=True)):
        for axis, way in enumerate(([0, -1], [1, 0])):
            for other, share in ((node, 1.0), (left, -0.6), (left + 1, -0.4)):
                rows[axis, row, [2 * other, 2 * other + 1]] = share * np.array(way)
    load = {"upper.right": (-0.3, -0.4)}
    problem = stacked(with_nodes(mesh, two), pairs=ALONE, clamp=ENDS, load=load)
    Bn, Bt = free_columns(rows, np.concatenate([upper.top, count + lower.bottom]))
    expected = enumsol.ContactProblem(problem.A, Bn, Bt, problem.f, gap=0.01, friction=0.3)
    assert_close(problem, expected, "Bn", "Bt", "gap", atol=1e-12)
    assert_same_roots(problem, expected)


def test_two_nodes_against_a_body_at_rest_are_those_on_a_foundation():
    upper, lower = fem.rectangle(4, 2), fem.rectangle(1, 1, 3.0)
    mesh = together(("upper", shifted(upper.parted(), (1.0, 1.0))), ("lower", lower.parted()))
    problem = stacked(
        with_nodes(mesh, upper.bottom[[0, 2]]),
        pairs=ALONE, clamp=[*ENDS, "lower.top"], load={"upper.right": (-0.3, -0.4)},
    )  # fmt: skip
    forces = fem.edge_forces(upper.points, fem.edges_along(upper.right), (-0.3, -0.4))
    expected = fem.contact_problem(
        upper.points, upper.triangles, LAME,
        contact=upper.bottom[[0, 2]], normals=(0, -1), held=upper.top, forces=forces, friction=0.3,
    )  # fmt: skip
    assert_close(problem, expected, "Bn", "Bt", "gap", atol=1e-12)
    assert_same_roots(problem, expected)


def test_two_nodes_of_a_solid_are_rows_by_hand():
    mesh = boxes(8, 2, 1, 0.01)
    bottom = np.unique(mesh.facets["upper.bottom"])
    points = mesh.points
    two = [node for node in bottom if tuple(points[node, :2]) in ((0.5, 0.5), (1.0, 0.5))]
    load = {"upper.right": (-0.2, 0.1, -0.4)}
    problem = stacked(with_nodes(mesh, two), pairs=ALONE, clamp=ENDS, load=load)
    top = np.unique(mesh.facets["lower.top"])
    rows = np.zeros((3, 2, points.size))
    for row, node in enumerate(two):
        shares = np.prod(1 - np.abs(points[top, :2] - points[node, :2]), axis=1)  # bilinear on the unit square
        for axis, way in enumerate(([0, 0, -1], [1, 0, 0], [0, -1, 0])):
            for other, share in ((node, 1.0), *zip(top, -shares, strict=True)):
                rows[axis, row, 3 * other : 3 * other + 3] = share * np.array(way)
    rows = free_columns(rows, [*mesh.facets["upper.top"].ravel(), *mesh.facets["lower.bottom"].ravel()])
    expected = enumsol.ContactProblem3D(problem.A, *rows, problem.f, gap=0.01, friction=0.3)
    assert_close(problem, expected, "Bn", "Bt1", "Bt2", "gap", atol=1e-12)
    assert problem.areas is None  # no pressure of single nodes
    assert_same_roots(problem, expected)


# -- nodes of whole facets ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("plane", ["strain", "axisymmetric"])
@pytest.mark.parametrize("kind", [3, 6, (3, 4)])
def test_the_nodes_of_whole_facets_are_those_of_the_facets(kind, plane):
    mesh = blocks(kind, 3, 2, 0.01)
    mesh = replace(mesh, points=mesh.points + np.eye(2)[0])
    whole = stacked(mesh, clamp=ENDS, plane=plane)
    order = np.argsort(whole.node_ids)
    same = stacked(with_nodes(mesh, np.sort(whole.node_ids)), pairs=ALONE, clamp=ENDS, plane=plane)
    assert list(same.node_ids) == sorted(whole.node_ids)
    assert_close(whole, same, "Bn", "Bt", "gap", order=order, atol=1e-12)
    assert np.array_equal(whole.A.toarray(), same.A.toarray())


@pytest.mark.parametrize("kind", [4, 8, 10])
def test_the_nodes_of_whole_facets_are_those_of_the_facets_in_3d(kind):
    mesh = boxes(kind, 2, 1, 0.01)
    whole = stacked(mesh, clamp=ENDS)
    same = stacked(with_nodes(mesh, np.sort(whole.node_ids)), pairs=ALONE, clamp=ENDS)
    order = np.argsort(whole.node_ids)
    assert_close(whole, same, "Bn", "Bt1", "Bt2", "gap", order=order, atol=1e-12)


def test_one_ring_of_nodes_carries_the_force_of_the_whole_circumference():
    mesh = blocks(4, 2, 2)
    mesh = replace(mesh, points=mesh.points + np.eye(2)[0])
    middle = [node for node in np.unique(mesh.facets["upper.bottom"]) if np.isclose(mesh.points[node, 0], 2.0)]
    problem = stacked(
        with_nodes(mesh, middle), pairs=ALONE, plane="axisymmetric", clamp="lower.bottom", friction=0.0,
        pressure={"upper.top": 0.1}, max_rigid_displacement="auto",
    )  # fmt: skip
    (root,) = enumsol.enumerate_roots(problem, 0)
    assert np.allclose(root.lambda_n, 0.1 * np.pi * (3.0**2 - 1.0**2), rtol=1e-10)


@pytest.mark.parametrize("mesh", [blocks(4, 3, 2), boxes(8, 2, 1)], ids=["2d", "3d"])
def test_ties_of_nodes_are_those_of_their_facets(mesh):
    given = {"contact": "lower.bottom", "pairs": (), "clamp": "upper.top"}
    nodes = np.unique(mesh.facets["upper.bottom"])
    whole = stacked(mesh, tie=[("upper.bottom", "lower.top")], **given)
    same = stacked(with_nodes(mesh, nodes), tie=ALONE, **given)
    assert_close(whole, same, "A", "Bn", "f", atol=1e-12)


@pytest.mark.parametrize("nodes", [None, [0, 3]], ids=["facets", "nodes"])
def test_files_of_pairs_have_the_forces_on_the_contact_nodes(tmp_path, nodes):
    mesh = boxes(8, 2, 1)
    load = {"upper.right": (-0.2, 0.1, -0.4)}
    if nodes is not None:
        mesh = with_nodes(mesh, np.unique(mesh.facets["upper.bottom"])[nodes])
    problem = stacked(mesh, clamp=ENDS, load=load, **({} if nodes is None else {"pairs": ALONE}))
    (root,) = enumsol.enumerate_roots(problem, 0)
    enumsol.write_vtu(problem, root, tmp_path / "p.vtu")
    data = meshio.read(tmp_path / "p.vtu").point_data
    own = np.array(problem.node_ids)
    assert np.array_equal(data["lambda_n"][own], root.lambda_n)
    assert np.allclose(data["contact_force"][own][:, 2], root.lambda_n, rtol=0, atol=1e-13)  # upwards
    assert ("pressure" in data) == (nodes is None)


# -- nearest points ----------------------------------------------------------------------------------------------------


def over_a_hill(body, tip, kind, corner=0):
    """A body whose corner node, the only contact node, is at a point above the curved top of another one."""
    d = body.points.shape[1]
    small = grid(1, 1, kind, 0.1, 0.1) if d == 2 else solid((1, 1, 1), kind, (0.1, 0.1, 0.1))
    mesh = together(("upper", shifted(small, np.asarray(tip) - small.points[corner])), ("lower", body))
    scene = fem.mesh_scene(with_nodes(mesh, [corner]), young=2.0, poisson=0.3, friction=0.3, pairs=ALONE, clamp=ENDS)
    return scene.gaps, scene.contacts.rows.normals


def curved(kind, d):
    """A body of two cells a side over (0, 2)^(d - 1), its top at 1 - |x - 1|^2 / 8, which second order has exactly."""
    body = grid(2, 1, kind, 2.0, 1.0) if d == 2 else solid((2, 2, 1), kind, (2.0, 2.0, 1.0))
    points = body.points.copy()
    points[:, -1] *= 1 - np.sum((points[:, :-1] - 1) ** 2, axis=1) / 8
    return type(body)(points, body.cells, body.facets)


@pytest.mark.parametrize(
    ("kind", "at"), [(9, (0.3,)), (6, (1.7,)), (9, (1.0,)), (10, (0.3, 1.6)), (10, (1.0, 1.0)), (27, (0.7, 1.9))]
)
@pytest.mark.parametrize("gap", [0.2, 0.0])
def test_the_normal_is_that_of_the_nearest_point_of_a_curved_body(kind, at, gap):
    at = np.array(at)
    slope = (at - 1) / 4
    normal = np.array([*slope, 1.0]) / np.sqrt(1 + slope @ slope)
    foot = np.array([*at, 1 - np.sum((at - 1) ** 2) / 8])
    gaps, normals = over_a_hill(curved(kind, len(at) + 1), foot + gap * normal, kind)
    assert np.allclose(gaps, gap, rtol=0, atol=1e-9)
    assert np.allclose(normals, -normal, rtol=0, atol=1e-7)


@pytest.mark.parametrize(
    ("tip", "gap", "normal"),
    [((1.0, 1.2), 0.2, (0, 1)), ((0.5, 1.0), 0.5 / np.sqrt(2), (-1, 1)), ((1.9, 0.6), 0.5 / np.sqrt(2), (1, 1))],
)
def test_on_a_roof_the_normal_is_that_of_the_slope_and_at_its_ridge_the_mean_of_both(tip, gap, normal):
    roof = grid(2, 1, 3, 2.0, 1.0)
    x, y = roof.points.T
    points = np.stack([x, np.where(y == 0, -0.5, 1 - np.abs(x - 1))], axis=1)
    gaps, normals = over_a_hill(type(roof)(points, roof.cells, roof.facets), tip, 3)
    assert np.allclose(gaps, gap, rtol=0, atol=1e-9)
    assert np.allclose(normals, -np.array(normal) / np.linalg.norm(normal), rtol=0, atol=1e-9)


# -- what is wrong -----------------------------------------------------------------------------------------------------


def test_nodes_beyond_the_other_body_are_named_in_a_note():
    upper, lower = fem.rectangle(4, 2, 2.0), fem.rectangle(2, 2)
    mesh = together(("upper", shifted(upper.parted(), (0, 1))), ("lower", lower.parted()))
    problem = stacked(with_nodes(mesh, upper.bottom), pairs=ALONE, clamp=ENDS)
    assert problem.p == 3
    assert any(note.startswith("2 of 5 nodes of ALONE face nothing of lower.top") for note in problem.notes)


def test_nodes_that_all_face_nothing_are_refused():
    mesh = with_nodes(blocks(4), [0])
    mesh = replace(mesh, points=mesh.points + np.where(np.arange(len(mesh.points))[:, None] < 9, [9.0, 0.0], 0.0))
    bad_argument("ALONE of the pair ALONE:lower.top has no node that faces", stacked, mesh, pairs=ALONE, clamp=ENDS)


def test_nodes_alone_are_faced_by_nobody():
    mesh = with_nodes(blocks(4), [0, 2])
    pairs = [("lower.top", "ALONE")]
    bad_argument("the mesh has no facets named 'ALONE'", stacked, mesh, pairs=pairs, clamp=ENDS)
