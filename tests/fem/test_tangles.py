"""Meshes that cover a place twice are refused, with cells by their numbers; what only touches is not, but noted."""

from dataclasses import replace

import numpy as np
import pytest
from parted_meshes import grid
from parted_solids import solid
from refusals import bad_argument
from two_bodies import blocks, boxes, shifted, together

from enumsol import fem

GIVEN = {"young": 2.0, "poisson": 0.3, "contact": "bottom", "clamp": "top", "friction": 0.3, "gap": -0.01}
PAIR = {**GIVEN, "contact": (), "pairs": [("upper.bottom", "lower.top")], "clamp": ["upper.top", "lower.bottom"]}


def dragged(mesh, node, to):
    points = mesh.points.copy()
    points[node] = to
    return replace(mesh, points=points)


def cells_around(mesh, node):
    return np.flatnonzero(np.any(mesh.cells == node, axis=1)).tolist()


def test_a_node_that_was_dragged_over_its_neighbours():
    """As in a file that was written by hand: cells are inside out, and none is flat."""
    mesh = dragged(grid(6, 3, 3, 2.0), 10, (1.41, 0.37))
    message = f"cells row ({'|'.join(map(str, cells_around(mesh, 10)))}) overlaps cells row [0-9]+, for both are on the"
    bad_argument(message, fem.mesh_scene, mesh, **GIVEN)
    numbered = replace(mesh, labels=np.arange(101, 101 + len(mesh.cells)))
    bad_argument("^element 1[0-9][0-9] overlaps element 1[0-9][0-9], for both", fem.mesh_scene, numbered, **GIVEN)


@pytest.mark.parametrize("kind", [3, 6])
def test_every_builder_refuses_them(kind):
    mesh = grid(3, 3, kind, 3.0, 3.0)
    node = int(np.argmin(np.linalg.norm(mesh.points - 1.0, axis=1)))
    middles = {6: np.flatnonzero(np.any(mesh.cells[:, :3] == node, axis=1))}.get(kind, [])
    assert kind == 3 or len(middles)
    points = mesh.points.copy()
    points[node] = (2.4, 1.3)
    if kind == 6:  # edges stay straight
        for a, b, k in ((0, 1, 3), (1, 2, 4), (2, 0, 5)):
            points[mesh.cells[:, k]] = (points[mesh.cells[:, a]] + points[mesh.cells[:, b]]) / 2
    bad_argument("cells row [0-9]+ overlaps cells row", fem.stiffness, points, mesh.cells, (1.0, 1.0))


@pytest.mark.parametrize("kind", [4, 10])
def test_tetrahedra_inside_out(kind):
    """Tetrahedra may come in any orientation, so that their volumes say nothing."""
    mesh = solid((3, 3, 3), kind)
    corner = int(np.argmin(np.linalg.norm(mesh.points - 1 / 3, axis=1)))
    points = mesh.points.copy()
    points[corner] = (0.9, 0.45, 0.4)
    if kind == 10:
        for k, (a, b) in enumerate(((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)), 4):
            points[mesh.cells[:, k]] = (points[mesh.cells[:, a]] + points[mesh.cells[:, b]]) / 2
    tangled = replace(mesh, points=points)
    bad_argument("cells row [0-9]+ overlaps cells row [0-9]+", fem.mesh_scene, tangled, **GIVEN)


@pytest.mark.parametrize("kind", [8, 27])
def test_hexahedra_inside_out(kind):
    mesh = solid((2, 2, 2), kind)
    corner = int(np.argmin(np.linalg.norm(mesh.points - 0.5, axis=1)))
    message = "cells row [0-9]+ is (flat, folded or|turned) inside out"
    bad_argument(message, fem.mesh_scene, dragged(mesh, corner, (1.4, 0.5, 0.5)), **GIVEN)


@pytest.mark.parametrize("mesh", [grid(2, 2, 3), grid(2, 2, 4), solid((2, 1, 1), 8), solid((1, 1, 1), 4)])
def test_a_cell_that_is_there_twice(mesh):
    """As gmsh's version 2.2 writes cells of two groups."""
    doubled = replace(mesh, cells=np.concatenate([mesh.cells, mesh.cells[1:2]]))
    last = len(mesh.cells)
    message = f"cells row (1 overlaps cells row {last}|{last} overlaps cells row 1),"
    bad_argument(message, fem.mesh_scene, doubled, **GIVEN)


def wound(turns, kind):
    """A strip around a circle; what overlaps shares no facet."""
    flat = grid(24, 2, kind)
    angle, radius = 2 * np.pi * turns * flat.points[:, 0], 1.0 + 0.5 * flat.points[:, 1]
    return replace(flat, points=np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1))


@pytest.mark.parametrize("kind", [3, 4, 6, 8, 9])
def test_a_strip_that_winds_over_itself(kind):
    message = "cells row [0-9]+ overlaps other cells of its body, whose boundary is inside of it at"
    bad_argument(message, fem.mesh_scene, wound(-1.1, kind), **GIVEN)
    assert fem.mesh_scene(wound(-0.9, kind), **GIVEN).notes == []


def test_a_solid_that_winds_over_itself():
    flat = solid((16, 1, 1), 8)
    angle, radius = -2 * np.pi * 1.1 * flat.points[:, 0], 1.0 + 0.5 * flat.points[:, 1]
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), -flat.points[:, 2]], axis=1)
    options = {**GIVEN, "contact": "front", "clamp": "back"}
    bad_argument("cells row [0-9]+ overlaps other cells", fem.mesh_scene, replace(flat, points=points), **options)


@pytest.mark.parametrize(
    "mesh", [blocks(3, gap=-0.05), blocks(9, gap=-0.05), boxes(8, gap=-0.03), boxes(10, 2, 3, -0.03)]
)
def test_bodies_may_overlap_by_a_press_fit(mesh):
    assert fem.mesh_scene(mesh, **PAIR).notes == []


def slit(kind):
    """A crack along the middle of a block, from its left side to its centre; upper and lower are its faces."""
    mesh = grid(4, 4, kind, 2.0, 2.0)
    on = np.flatnonzero((np.abs(mesh.points[:, 1] - 1) < 1e-9) & (mesh.points[:, 0] < 1 - 1e-9))
    twin = np.arange(len(mesh.points) + len(on))
    twin[on] = len(mesh.points) + np.arange(len(on))
    above = mesh.points[mesh.cells].mean(axis=1)[:, 1] > 1
    cells = np.where(above[:, None], twin[mesh.cells], mesh.cells)
    points = np.concatenate([mesh.points, mesh.points[on]])
    facets = {"bottom": mesh.part("bottom"), "top": mesh.part("top")}
    sides = grid(4, 4, kind, 2.0, 2.0)
    every = sides.cells
    edges = [(0, 1), (1, 2), (2, 3), (3, 0)] if kind == 4 else [(0, 1), (1, 2), (2, 0)]
    tip = int(np.flatnonzero(np.all(np.abs(mesh.points - 1) < 1e-9, axis=1))[0])
    along = set(on.tolist()) | {tip}
    below = [(c[a], c[b]) for c in every[~above].tolist() for a, b in edges if {c[a], c[b]} <= along]
    facets |= {"lower": np.array(below), "upper": twin[np.array(below)]}
    return fem.PartedMesh(points, cells, facets)


@pytest.mark.parametrize("kind", [3, 4])
def test_nodes_of_a_crack_are_noted_unless_they_are_a_pair(kind):
    mesh = slit(kind)
    scene = fem.mesh_scene(mesh, **GIVEN)
    (note,) = scene.notes
    assert note == (
        "2 places of the body have several nodes, at (0, 1) and elsewhere, which neither the mesh joins nor a pair: "
        "a crack that nothing closes"
    )
    assert scene.problem().notes == (note,)
    assert note in str(scene)
    assert fem.mesh_scene(mesh, **GIVEN, pairs=[("lower", "upper")]).notes == []


def test_bodies_that_only_seem_to_be_joined_are_noted():
    mesh = together(("left", grid(2, 2, 4)), ("right", shifted(grid(2, 2, 4), (1, 0))))
    options = {**GIVEN, "contact": ["left.bottom", "right.bottom"], "clamp": ["left.top", "right.top"]}
    (note,) = fem.mesh_scene(mesh, **options).notes
    assert note.startswith("2 places of the body with the boundary left.bottom,")
    assert note.endswith("which neither the mesh joins nor a pair: bodies that pass through each other there")
    options["contact"] = "left.bottom"
    joined = fem.mesh_scene(mesh, **options, pairs=[("right.left", "left.right")]).notes
    assert not any("places" in note for note in joined)


def covered(points, cells, places):
    """How many simplices each place is well inside of."""
    counts = np.zeros(len(places), dtype=int)
    for ends in points[cells]:
        inner = np.linalg.solve((ends[1:] - ends[0]).T, (places - ends[0]).T)
        counts += np.min(np.vstack([inner, 1 - inner.sum(axis=0)]), axis=0) > 0.01
    return counts


@pytest.mark.parametrize("dimension", [2, 3])
def test_what_covers_a_place_twice_is_refused_and_nothing_else(dimension):
    """Nodes moved at random; places that two cells cover, or a cell that has changed its orientation, as the oracle."""
    rng = np.random.default_rng(dimension)
    mesh = grid(3, 3, 3) if dimension == 2 else solid((2, 2, 1), 4)
    options, outcomes = (GIVEN | {"spring": {"left": (1, 1)}}), []

    def orientation(points):
        ends = points[mesh.cells]
        return np.sign(np.linalg.det(ends[:, 1:] - ends[:, :1]))

    for _ in range(24):
        points = mesh.points + rng.uniform(-1, 1, mesh.points.shape) * rng.choice([0.02, 0.1, 0.3])
        places = rng.uniform(points.min(axis=0), points.max(axis=0), (1000, dimension))
        twice = np.any(covered(points, mesh.cells, places) > 1)
        tangled = twice or np.any(orientation(points) != orientation(mesh.points))
        outcomes.append(bool(tangled))
        moved = replace(mesh, points=points)
        if tangled:
            bad_argument("cells row [0-9]+ (overlaps|is flat)", fem.mesh_scene, moved, **options)
        else:
            fem.mesh_scene(moved, **options)
    assert 4 < sum(outcomes) < 20
