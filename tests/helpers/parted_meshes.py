"""Plane meshes with named sides, of every kind of cell, made without the package."""

import numpy as np

from enumsol.fem.meshes import PartedMesh

#: Pairs of corners between which second-order cells have nodes, by corners of the cell.
EDGES = {3: ((0, 1), (1, 2), (2, 0)), 4: ((0, 1), (1, 2), (2, 3), (3, 0))}


def constant_stress(gradient, lame):
    """The stress of a constant gradient of the displacement, in the plane or in space."""
    (lam, mu), strain = lame, (gradient + gradient.T) / 2
    return lam * np.trace(strain) * np.eye(len(gradient)) + 2 * mu * strain


def grid(nx, ny, kind, length=1.0, height=1.0, shake=0.0, seed=0):
    """A rectangle of triangles (3, 6) or quadrilaterals (4, 8, 9) with four sides, distorted inside.

    Two kinds, as (3, 4): every second quadrilateral is cut into triangles.
    """
    x, y = np.meshgrid(np.linspace(0, length, nx + 1), np.linspace(0, height, ny + 1))
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    number = np.arange(len(points)).reshape(ny + 1, nx + 1)
    quads = np.stack([number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]], axis=-1).reshape(-1, 4)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    cells = triangles if kind in (3, 6) else quads
    if isinstance(kind, tuple):
        cut, kind = np.arange(len(quads)) % 2 == 0, kind[1]
        cells = np.concatenate([triangles[np.tile(cut, 2)][:, [0, 1, 2, 2]], quads[~cut]])
    sides = {"bottom": number[0], "top": number[-1], "left": number[:, 0], "right": number[:, -1]}
    edges = {name: np.stack([line[:-1], line[1:]], axis=1) for name, line in sides.items()}
    if kind in (6, 8, 9):
        points, cells, edges = _second_order(points, cells, edges, kind)
    inside = np.all((points > 1e-9) & (points < np.array([length, height]) - 1e-9), axis=1)
    points[inside] += np.random.default_rng(seed).uniform(-shake, shake, (inside.sum(), 2))
    return PartedMesh(points, cells, edges)


def _second_order(points, cells, edges, kind):
    points, between = list(points), {}

    def middle(one, two):
        key = (min(one, two), max(one, two))
        if key not in between:
            between[key] = len(points)
            points.append((points[one] + points[two]) / 2)
        return between[key]

    rows = []
    for cell in cells.tolist():
        corners = list(dict.fromkeys(cell))  # a triangle among quadrilaterals repeats its last node
        row = corners + [middle(corners[a], corners[b]) for a, b in EDGES[len(corners)]]
        row += row[-1:] * (kind - len(row) if len(corners) < len(cell) else 0)
        if kind == 9 and len(row) == 8:
            row.append(len(points))
            points.append(np.mean([points[node] for node in cell], axis=0))
        rows.append(row)
    edges = {name: np.array([[a, b, middle(a, b)] for a, b in part.tolist()]) for name, part in edges.items()}
    return np.array(points), np.array(rows), edges


def moved(mesh, change):
    """The mesh with its points changed."""
    return PartedMesh(change(mesh.points), mesh.cells, mesh.facets, mesh.node_sets)


def doubled(mesh):
    """A body whose left side lies on x = 0, together with its mirror image."""
    on_axis = np.isclose(mesh.points[:, 0], 0)
    number = np.where(on_axis, np.arange(len(on_axis)), len(on_axis) + np.cumsum(~on_axis) - 1)
    points = np.concatenate([mesh.points, mesh.points[~on_axis] * [-1, 1]])
    facets = {name: np.concatenate([part, number[part]]) for name, part in mesh.facets.items() if name != "left"}
    return PartedMesh(points, np.concatenate([mesh.cells, number[mesh.cells]]), facets)
