"""Deformed bodies: displacements and forces in global axes against those of the rows, marks by status; 2D and 3D."""

import re

import numpy as np
import pytest
from matplotlib.text import Text
from parted_meshes import grid
from parted_solids import solid
from problems3d import from_compliance
from refusals import bad_argument, bad_problem

import enumsol
from enumsol import BodyMesh, fem
from enumsol.model.cells import boundary_facets, facet_outlines, outline_edges
from enumsol.model.shapes import (
    body_mesh,
    body_moves,
    contact_forces,
    own_scales,
    round_scale,
    row_weights,
    slip_directions,
)
from enumsol.roots.body_plots import draw_bodies
from enumsol.support.plotting import new_figure


@pytest.fixture(scope="module")
def wedge():
    problem = enumsol.gallery.wedge(4, 4, (4e-4, 1e-3))
    return problem, enumsol.enumerate_roots(problem, 3.0)


def test_displacements_and_forces_in_global_axes(wedge):
    problem, roots = wedge
    mesh = body_mesh(problem)
    c, s = np.cos(np.radians(20)), np.sin(np.radians(20))
    normals = np.repeat([[-c, -s], [c, -s]], 4, axis=0)
    tangents = np.repeat([[-s, c], [s, c]], 4, axis=0)
    assert len(roots) == 5
    for root in roots:
        moves = row_weights(problem) @ mesh.displacements(root.u)
        np.testing.assert_allclose(np.sum(moves * normals, axis=1) - problem.gap, root.u_n, atol=1e-12)
        np.testing.assert_allclose(np.sum(moves * tangents, axis=1), root.u_t, atol=1e-12)
        forces = contact_forces(problem, root.lambda_n, root.lambda_t)
        expected = np.zeros_like(forces)
        expected[list(problem.node_ids)] = -(root.lambda_n[:, None] * normals + root.lambda_t[:, None] * tangents)
        np.testing.assert_allclose(forces, expected, atol=1e-12 * max(np.max(root.lambda_n), 1e-30))
    np.testing.assert_allclose(row_weights(problem) @ mesh.points, problem.coordinates, atol=1e-15)


def test_turned_degrees_of_freedom_of_the_square():
    problem = enumsol.gallery.two_node_square()
    root = enumsol.enumerate_roots(problem, 3.5)[0]
    moves = problem.mesh.displacements(root.u)
    # node 0: normal (0, -1), tangent (1, 0); node 1: normal (1, 0), tangent (0, 1); the others are clamped
    np.testing.assert_allclose(moves[0], [root.u_t[0], -root.u_n[0]])
    np.testing.assert_allclose(moves[1], [root.u_n[1], root.u_t[1]])
    assert not np.any(moves[2:])


def test_what_is_drawn(wedge):
    problem, roots = wedge
    root = next(root for root in roots if len(set(root.statuses)) > 1)
    (ax,) = root.plot_body(scale=20).axes
    assert "displacements times 20" in ax.get_title()
    (arrows,) = [part for part in ax.collections if hasattr(part, "U")]
    assert len(arrows.U) == np.count_nonzero(root.lambda_n)
    mesh = body_mesh(problem)
    moved = row_weights(problem) @ (mesh.points + 20 * mesh.displacements(root.u))
    drawn = np.concatenate([np.stack(line.get_data(), axis=1) for line in ax.lines])
    assert {tuple(point) for point in drawn.round(9)} == {tuple(point) for point in moved.round(9)}
    tips = np.stack([arrows.X + arrows.U, arrows.Y + arrows.V], axis=1)
    assert {tuple(tip) for tip in tips.round(9)} <= {tuple(point) for point in moved.round(9)}
    entries = {text.get_text() for text in ax.get_legend().get_texts()}
    assert entries == {*(status.value for status in root.statuses), "contact force on the body"}


def test_all_roots_side_by_side(wedge):
    problem, roots = wedge
    figure = roots.plot_bodies(scale=3)
    assert [ax.get_title() for ax in figure.axes] == [f"root {k}: index {r.index:+d}" for k, r in enumerate(roots)]
    assert "displacements times 3" in figure.get_suptitle()
    # the free wedge moves a hundred times as far as the jammed one: each has a scale of its own, and says so
    figure = roots.plot_bodies()
    assert "every body with an enlargement of its own" in figure.get_suptitle()
    sizes = [np.max(np.linalg.norm(problem.mesh.displacements(root.u), axis=1)) for root in roots]
    assert max(sizes) > 8 * min(sizes)
    for k, (ax, root, size) in enumerate(zip(figure.axes, roots, sizes, strict=True)):
        head, scale = ax.get_title().split("; displacements times ")
        assert head == f"root {k}: index {root.index:+d}"
        assert 0.03 * body_mesh(problem).size < float(scale) * size < 0.0801 * body_mesh(problem).size
    many = enumsol.enumerate_roots(enumsol.gallery.chain(3), 5.0).plot_bodies()
    assert len(many.axes) == 12
    assert "the first 12 of 27 roots" in many.get_suptitle()


@pytest.mark.slow
def test_in_space():
    problem = enumsol.gallery.get("wedge3d-8-5").build()
    roots = enumsol.enumerate_roots(problem, 2.0)
    mesh = body_mesh(problem)
    for root in roots:
        moves = problem.mesh.displacements(root.u)
        np.testing.assert_allclose(mesh.displacements(root.u), moves)
        forces = contact_forces(problem, root.lambda_n, root.lambda_t)
        # forces on the whole body are in balance with load and stiffness: the work on any motion is that of the rows
        slips = np.stack([problem.Bt1 @ root.u, problem.Bt2 @ root.u], axis=1)
        work = root.lambda_n @ (problem.Bn @ root.u) + np.sum(root.lambda_t * slips)
        assert np.sum(forces * moves) == pytest.approx(-work, rel=1e-9, abs=1e-18)
    (ax,) = roots[0].plot_body().axes
    assert ax.name == "3d"
    assert len(roots.plot_bodies().axes) == len(roots)


@pytest.mark.parametrize(("kind", "nodes"), [(4, 3), (8, 4), (10, 6), (27, 8)])
def test_outlines_of_the_boundary_enclose_the_body(kind, nodes):
    mesh = solid((3, 2, 2), kind)
    faces = facet_outlines(boundary_facets(3, mesh.cells))
    corners = mesh.points[faces]
    # every face lies in one of the six sides of the box
    flat = [np.all(corners[:, :, axis] == side, axis=1) for axis in range(3) for side in (0.0, 1.0)]
    assert np.all(np.any(flat, axis=0))
    assert faces.shape == (2 * (3 * 2 + 3 * 2 + 2 * 2) * (1 if kind in (8, 27) else 2), nodes)
    # along the outline neighbours are near: each step is half of one along an edge
    steps = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
    assert np.max(steps) < 0.8 * (1 if nodes < 5 else 0.5)


@pytest.mark.parametrize("kind", [(3, 4), (6, 8), (6, 9)])
def test_bodies_with_cells_of_two_kinds(kind, tmp_path):
    """Pictures and files; the page draws a large body by the edges of its boundary."""
    import meshio

    from enumsol.report.parts import body_record, boundary_edges

    mesh, where = grid(3, 2, kind), {"contact": "bottom", "clamp": "left", "load": {"top": (0.1, -0.3)}}
    problem = fem.mesh_problem(mesh, young=2, poisson=0.3, friction=0.4, **where)
    root = enumsol.enumerate_roots(problem, 0)[0]
    assert root.plot_body().axes
    enumsol.write_vtu(problem, root, tmp_path / "p.vtu")
    triangles, others = meshio.read(tmp_path / "p.vtu").cells
    assert (len(triangles), len(others)) == (6, 3)
    assert (triangles.type, others.type) == ("triangle6" if kind[0] == 6 else "triangle", f"quad{kind[1]}".rstrip("4"))
    record, _ = body_record(problem)
    edges = boundary_edges(np.array(record["cells"]))
    assert len(edges) == 10 * (1 if kind == (3, 4) else 2)
    assert np.all(np.isin(edges, np.unique(np.concatenate([part.ravel() for part in mesh.facets.values()]))))
    enumsol.write_problem(problem, tmp_path / "p.npz")
    assert enumsol.read_problem(tmp_path / "p.npz").fingerprint == problem.fingerprint


@pytest.mark.slow
def test_bodies_in_space_are_compared_in_one_view():
    problem = enumsol.gallery.get("wedge3d-4-9").build()
    roots = enumsol.enumerate_roots(problem, 3.0)
    figure = roots.plot_bodies()
    (limits,) = {(ax.get_xlim(), ax.get_ylim(), ax.get_zlim()) for ax in figure.axes}
    low, high = np.array(limits).T
    for ax, root in zip(figure.axes, roots, strict=True):
        moved = problem.mesh.points + float(ax.get_title().rpartition(" ")[2]) * problem.mesh.displacements(root.u)
        assert np.all((low <= moved) & (moved <= high))
    entries = {text.get_text() for text in figure.legends[0].get_texts()}
    assert entries == {"open", "stick", "slip", "contact force on the body", "direction of slip", "undeformed"}


def test_two_states_of_a_solid_are_drawn_in_one_view():
    problem = enumsol.gallery.block3d(1, 1, 1)
    roots = [enumsol.enumerate_roots(problem, alpha)[0] for alpha in (0.5, 1.0)]
    figure = draw_bodies(roots, scale=3.0)
    (limits,) = {(ax.get_xlim(), ax.get_ylim(), ax.get_zlim()) for ax in figure.axes}
    low, high = np.array(limits).T
    for root in roots:
        moved = problem.mesh.points + 3.0 * problem.mesh.displacements(root.u)
        assert np.all((low <= moved) & (moved <= high))
    assert "displacements times 3" in figure.get_suptitle()
    bad_argument("ax is plane and the body is not; .* projection '3d'", roots[0].plot_body, new_figure().subplots())
    bad_argument("there are no isolated roots to draw", draw_bodies, [])


@pytest.mark.slow
def test_slips_in_global_axes():
    problem = enumsol.gallery.get("wedge3d-4-9").build()
    for root in enumsol.enumerate_roots(problem, 3.0):
        rows, ways = slip_directions(problem, root.u_t, root.statuses)
        assert rows.tolist() == [i for i, status in enumerate(root.statuses) if str(status) == "slip"]
        # the first axes point out of the notch along its walls, the second ones along y and -y
        s, c = np.sin(np.radians(20)), np.cos(np.radians(20))
        for i, way in zip(rows, ways, strict=True):
            side = -1 if problem.coordinates[i, 0] < 0 else 1
            expected = root.u_t[i, 0] * np.array([side * s, 0, c]) + root.u_t[i, 1] * np.array([0, -side, 0])
            np.testing.assert_allclose(way, expected / np.linalg.norm(expected), atol=1e-9)


@pytest.mark.parametrize("kind", [4, 8, 10, 27])
def test_the_outline_of_a_box_is_its_edges(kind):
    mesh = solid((3, 2, 2), kind)
    edges = outline_edges(mesh.points, facet_outlines(boundary_facets(3, mesh.cells)))
    along, size = mesh.points[edges], mesh.points.max(axis=0)
    # both ends lie in the same two of the six sides, and the lengths add up to those of the twelve edges
    assert np.all(np.sum(np.all((along == 0) | (along == size), axis=1), axis=1) == 2)
    assert np.sum(np.linalg.norm(along[:, 1] - along[:, 0], axis=1)) == pytest.approx(4 * np.sum(size))


def solid_at_rest():
    """A tetrahedron three of whose corners are held, pressed on the ground by the fourth, which sticks."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
    mesh = BodyMesh(points, [[0, 1, 2, 3]], np.eye(12)[:, :3])
    stiffness, normal, (along, across) = np.diag([3.0, 5.0, 7.0]), [[0, 0, -1.0]], np.eye(3)[:2]
    load = np.array([0.1, 0.2, -1.1]) / 3
    return enumsol.ContactProblem3D(stiffness, normal, along[None], across[None], load, friction=2.0, mesh=mesh)


@pytest.mark.parametrize("problem", [enumsol.gallery.two_node_square(), solid_at_rest()], ids=["2D", "3D"])
def test_rounding_is_not_enlarged(problem):
    """What stays of a load that contact forces cancel is drawn as no displacement, beside moving bodies and alone."""
    roots = enumsol.enumerate_roots(problem, 3.5)
    for root in roots:
        moves = body_moves(problem, root.u, root.alpha)
        assert np.array_equal(moves, np.zeros_like(moves)) == (np.max(np.abs(root.u)) < 1e-15), root
    still = [root for root in roots if np.max(np.abs(root.u)) < 1e-15]
    assert still
    for figure in (roots.plot_bodies(), *(root.plot_body() for root in still)):
        scales = re.findall(r"displacements times (\S+)", " ".join(text.get_text() for text in figure.findobj(Text)))
        assert scales
        assert all(float(scale) < 1e3 for scale in scales)


def test_scales_are_round():
    assert own_scales([0.08, 0.02, 0.0], 1.0) == (1.0, 1.0, 1.0)
    assert own_scales([0.08, 0.002, 0.0], 1.0) == (1.0, 20.0, 1.0)
    assert own_scales([0.0, 0.0], 1.0) == (1.0, 1.0)
    assert [round_scale(x, 1.0, 0.08) for x in (0.08, 0.081, 0.03, 0.0016, 0.0)] == [1.0, 0.5, 2.0, 50.0, 1.0]


def test_without_a_mesh_the_picture_is_refused():
    square = enumsol.gallery.two_node_square()
    problem = square.replace(mesh=None)
    bad_argument("no mesh", enumsol.enumerate_roots(problem, 3.5)[0].plot_body)
    assert problem.fingerprint == square.fingerprint


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"points": np.zeros((4, 1))}, "mesh_points has shape"),
        ({"cells": [[0, 1]]}, "mesh_cells has shape"),
        ({"cells": [[0, 1, 4]]}, "other numbers than 0 .. 3"),
        ({"cells": [[0, 1, 0.5]]}, "other numbers than 0 .. 3"),
        ({"motion": np.zeros((7, 4))}, "mesh_motion has shape"),
        ({"offset": np.zeros((3, 2))}, "mesh_offset has shape"),
    ],
)
def test_a_mesh_that_does_not_fit_is_refused(change, message):
    parts = {"points": np.zeros((4, 2)), "cells": [[0, 1, 2]], "motion": np.eye(8)[:, :4], "offset": None}
    bad_problem(message, BodyMesh, **{**parts, **change})
    small = BodyMesh(np.zeros((1, 2)), [[0, 0, 0]], np.eye(2))
    bad_problem("expected n = 4", enumsol.gallery.two_node_square().replace, mesh=small)


@pytest.mark.parametrize("place", ["p.npz", "folder"])
def test_files_keep_the_mesh(tmp_path, place):
    square = enumsol.gallery.two_node_square()
    offset = np.arange(8.0).reshape(4, 2)
    mesh = BodyMesh(square.mesh.points, square.mesh.cells, square.mesh.motion, offset)
    problem = square.replace(mesh=mesh)
    enumsol.write_problem(problem, tmp_path / place)
    back = enumsol.read_problem(tmp_path / place).mesh
    for name in ("points", "cells", "offset"):
        assert np.array_equal(getattr(back, name), getattr(mesh, name))
    assert (back.motion != mesh.motion).nnz == 0
    enumsol.branch_graph(problem, (0, 2)).save(tmp_path / "graph.json")
    kept = enumsol.BranchGraph.load(tmp_path / "graph.json").problem.mesh
    assert np.array_equal(kept.displacements([1, 2, 3, 4]), mesh.displacements([1, 2, 3, 4]))


def test_part_of_a_mesh_in_a_file_is_refused(tmp_path):
    arrays = {"A": np.eye(2), "Bn": [[1, 0]], "Bt": [[0, 1]], "f": [1, 1], "mesh_points": np.zeros((3, 2))}
    np.savez(tmp_path / "part.npz", **arrays)
    bad_problem("mesh_cells, mesh_motion is missing", enumsol.read_problem, tmp_path / "part.npz")


def test_vtu_of_a_plane_body(wedge, tmp_path):
    meshio = pytest.importorskip("meshio")
    problem, roots = wedge
    root = roots[2]
    enumsol.write_vtu(problem, root, tmp_path / "wedge.vtu")
    back = meshio.read(tmp_path / "wedge.vtu")
    assert [block.type for block in back.cells] == ["triangle"]
    np.testing.assert_allclose(back.point_data["displacement"][:, :2], problem.mesh.displacements(root.u))
    nodes = list(problem.node_ids)
    np.testing.assert_allclose(back.point_data["lambda_n"][nodes], root.lambda_n)
    names = [("open", "stick", "slip+", "slip-")[int(code)] for code in back.point_data["status"][nodes]]
    assert names == [status.value for status in root.statuses]
    assert np.isnan(np.delete(back.point_data["lambda_n"], nodes)).all()
    work = np.sum(back.point_data["contact_force"] * back.point_data["displacement"])
    rows = root.lambda_n @ (problem.Bn @ root.u) + root.lambda_t @ (problem.Bt @ root.u)
    assert work == pytest.approx(-rows, rel=1e-9)


def test_prescribed_displacements_move_nodes_too():
    points, offset = [[0, 0], [1, 0], [0, 1]], [[0, 0], [0.5, 0], [0, 0]]
    mesh = BodyMesh.of_dofs(points, [[0, 1, 2]], [0, 5], offset)
    assert mesh.displacements([2.0, 3.0]).tolist() == [[2, 0], [0.5, 0], [0, 3]]
    problem = enumsol.ContactProblem(np.eye(2), [[1, 0]], [[0, 1]], [1, 1], mesh=mesh)
    assert body_mesh(problem).displacements(np.array([2.0, 3.0])).tolist() == [[2, 0], [0.5, 0], [0, 3]]


# -- bodies in 3D ------------------------------------------------------------------------------------------------------


def test_arrows_point_along_the_slips():
    problem = enumsol.gallery.get("block3d-9").build()
    root = enumsol.enumerate_roots(problem, 0.5)[0]
    body, ax = root.plot().axes
    assert body.name == "3d"
    (alone,) = root.plot(new_figure().subplots()).axes
    assert alone.name != "3d"
    slides = [str(status) == "slip" for status in root.statuses]
    (arrows,) = [part for part in ax.collections if hasattr(part, "U")]
    # the axes of the gallery's block are x and -y
    expected = root.u_t[slides] * [1.0, -1.0]
    expected /= np.linalg.norm(expected, axis=1)[:, None]
    np.testing.assert_allclose(np.stack([arrows.U, arrows.V], axis=1), expected, atol=1e-12)
    np.testing.assert_allclose(arrows.XY, problem.coordinates[slides][:, :2])
    assert sum(len(line.get_xdata()) for line in ax.lines) == problem.p
    *entries, ways = [text.get_text() for text in ax.get_legend().get_texts()]
    assert entries == ["open (1)", "stick (4)", "slip (4)"]
    low, high = map(float, re.fullmatch(r"direction of slip \((.*) to (.*)\)", ways).groups())
    slips = np.linalg.norm(root.u_t[slides], axis=1)
    assert (low, high) == (pytest.approx(slips.min(), rel=5e-3), pytest.approx(slips.max(), rel=5e-3))
    # arrows are long enough to be seen, nothing of them is cut off, and the legend hides none
    length = np.hypot(arrows.U, arrows.V) / arrows.scale
    np.testing.assert_allclose(length, 0.15 * np.ptp(problem.coordinates, axis=0).max())
    ends = arrows.XY + np.stack([arrows.U, arrows.V], axis=1) / arrows.scale
    ax.figure.draw_without_rendering()
    assert np.all(ax.bbox.count_contains(ax.transData.transform(ends)) == len(ends))
    assert ax.get_legend().get_window_extent().x0 >= ax.bbox.x1
    # contact is below, and that is where the body is seen from
    assert body.elev < -15


def test_without_a_mesh_the_local_axes_are_drawn():
    root = enumsol.enumerate_roots(enumsol.gallery.one_node_3d(), 0)[0]
    (arrows,) = [part for part in root.plot().axes[0].collections if hasattr(part, "U")]
    np.testing.assert_allclose([arrows.U[0], arrows.V[0]], root.u_t[0] / np.linalg.norm(root.u_t))


def test_without_coordinates_there_is_no_picture():
    root = enumsol.enumerate_roots(from_compliance(np.eye(3), np.ones(3), 0.3), 0)[0]
    bad_argument("the problem has no coordinates", root.plot)


def test_what_is_known_in_2d_only_is_refused():
    root = enumsol.enumerate_roots(enumsol.gallery.one_node_3d(), 0)[0]
    assert isinstance(root, enumsol.Root)
    for name in ("condition", "signs"):
        bad_argument(f"{name} is asked of a root in 3D; expected one in 2D", getattr, root, name)


def test_a_root_in_2d_is_plotted_as_its_body():
    root = enumsol.enumerate_roots(enumsol.gallery.two_node_square(), 3.5)[0]
    assert root.slip_angle is None
    assert [ax.get_title() for ax in root.plot().axes] == [ax.get_title() for ax in root.plot_body().axes]
