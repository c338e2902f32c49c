"""Geometry of tetrahedra and hexahedra: their facets, volumes, and quadrature on facets.

Corners of hexahedra and quadrilaterals are in the order of VTK: around the bottom, then around the top above it.
"""

from __future__ import annotations

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.fem.bases import FLAT
from enumsol.fem.mesh_checks import cell_name, check_every_node_is_used, elements, positions
from enumsol.model.cells import HEXAHEDRON, KINDS, boundary_facets, facet_rows
from enumsol.support.array_types import ArrayLike, Floats, Integers, Mask

_GAUSS_2 = (0.5 - np.sqrt(1 / 12), 0.5 + np.sqrt(1 / 12)), (0.5, 0.5)
_GAUSS_3 = (0.5 - np.sqrt(0.15), 0.5, 0.5 + np.sqrt(0.15)), (5 / 18, 8 / 18, 5 / 18)


def solid_mesh(
    points: ArrayLike, cells: ArrayLike, kinds: tuple[int, ...] = (4, 8), labels: Integers | None = None
) -> tuple[Floats, Integers]:
    """Points (N, 3) and cells (M, k) of positive volume, k among ``kinds``; they may come in any orientation.

    ``labels`` (M,) are the numbers by which messages name cells; by default their rows. What the nodes of second order
    (10 or 27 in all) do to a cell is checked by `nodal_basis`.

    Raises
    ------
    InvalidArgumentError
        The mesh is not valid: shapes, node numbers, a node in no cell, a cell that is flat or inside out.
    """
    nodes = positions(points, 3)
    bodies = elements(cells, "cells", kinds, len(nodes))
    kind = KINDS[3, bodies.shape[1]]
    corners = nodes[bodies[:, : kind.corners]]
    size = np.max(np.ptp(corners, axis=1), axis=1) ** 3
    volumes = _tetrahedron_volumes(corners)[:, None] if kind.corners == 4 else _corner_volumes(corners)
    ordered = np.sort(bodies, axis=1)
    _refuse(
        np.any(ordered[:, 1:] == ordered[:, :-1], axis=1) & (kind.corners == 8),
        "names a node twice, as one that is collapsed to a wedge or a pyramid does; expected distinct nodes: mesh all "
        "of the body by tetrahedra, or by hexahedra",
        labels,
    )
    turned = np.all(volumes < 0, axis=1)
    bodies[turned] = bodies[turned][:, kind.turned]
    volumes[turned] *= -1
    _refuse(np.max(np.abs(volumes), axis=1) <= FLAT * size, "has no volume; expected proper cells", labels)
    _refuse(
        np.min(volumes, axis=1) <= FLAT * size,
        "is turned inside out at a corner; expected hexahedra with corners in the order of VTK",
        labels,
    )
    check_every_node_is_used(bodies, len(nodes), "cells", "cell")
    return nodes, bodies


def _refuse(wrong: Mask, found: str, labels: Integers | None) -> None:
    if np.any(wrong):
        raise InvalidArgumentError(f"{cell_name(int(np.argmax(wrong)), labels)} {found}")


def _tetrahedron_volumes(corners: Floats) -> Floats:
    edges = corners[:, 1:] - corners[:, :1]
    return np.asarray(np.linalg.det(edges) / 6.0)


def _corner_volumes(corners: Floats) -> Floats:
    """Volumes (M, 8) of the parallelepipeds that the three edges at each corner of a hexahedron span."""
    return np.stack([_jacobians(corners, corner)[1] for corner in HEXAHEDRON], axis=1)


def _jacobians(corners: Floats, place: Floats) -> tuple[Floats, Floats]:
    """Shape functions (8,) of the hexahedron at a place of the reference, and the determinants (M,) there."""
    factors = np.where(HEXAHEDRON == 1, place, 1.0 - place)
    slopes = np.where(HEXAHEDRON == 1, 1.0, -1.0)
    gradients = np.stack([slopes[:, k] * np.prod(np.delete(factors, k, axis=1), axis=1) for k in range(3)])
    return np.prod(factors, axis=1), np.asarray(np.linalg.det(np.einsum("ka,mai->mki", gradients, corners)))


def shape_volumes(nodes: Floats, cells: Integers) -> Floats:
    """Integral of every corner's shape function over its cell, (M, 4) or (M, 8) [length^3]."""
    corners = nodes[cells]
    if cells.shape[1] == 4:
        return np.tile(_tetrahedron_volumes(corners)[:, None] / 4.0, (1, 4))
    points, weights = _GAUSS_2
    total = np.zeros(cells.shape)
    for i, j, k in np.ndindex(2, 2, 2):
        values, determinants = _jacobians(corners, np.array([points[i], points[j], points[k]]))
        total += weights[i] * weights[j] * weights[k] * determinants[:, None] * values
    return total


def outward(facets: Integers, cells: Integers) -> Integers:
    """Facets with their corners in the body's order: counterclockwise as seen from outside.

    Raises
    ------
    InvalidArgumentError
        One is not a facet on the boundary of the body, or comes twice; they have another number of corners.
    """
    boundary = boundary_facets(3, cells)
    if facets.shape[1] != boundary.shape[1]:
        name = KINDS[3, cells.shape[1]].name
        raise InvalidArgumentError(
            f"contact has facets of {facets.shape[1]} nodes; expected {boundary.shape[1]}, as {name} have"
        )
    rows = facet_rows(facets, boundary, facets.shape[1])
    if -1 in rows:
        k = rows.index(-1)
        raise InvalidArgumentError(
            f"contact row {k}, nodes {facets[k].tolist()}, is not a facet on the boundary of the body; "
            "expected facets of one cell each"
        )
    if len(set(rows)) != len(rows):
        raise InvalidArgumentError("contact names a facet twice; expected distinct facets")
    return boundary[rows]


def facet_vectors(nodes: Floats, facets: Integers) -> Floats:
    """Normals of facets times their areas (of the projection for quadrilaterals that are not plane), (k, 3)."""
    corners = nodes[facets]
    if facets.shape[1] == 3:
        return np.asarray(0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    return np.asarray(0.5 * np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]))


def facet_quadrature(nodes: Floats, facets: Integers) -> tuple[Floats, Floats]:
    """Quadrature of degree 2 on triangles, 5 in each direction on quadrilaterals.

    Returns
    -------
    values : (q, 3) or (q, 4) array
        Shape functions of the corners at the q points of a facet [-].
    weights : (k, q) array
        Weights of the points of each facet, which add up to its area [length^2].
    """
    if facets.shape[1] == 3:
        values = np.full((3, 3), 1.0 / 6.0) + 0.5 * np.eye(3)
        areas = np.linalg.norm(facet_vectors(nodes, facets), axis=1)
        return values, np.tile(areas[:, None] / 3.0, (1, 3))
    corners, (points, gauss) = nodes[facets], _GAUSS_3
    shapes, weights = [], []
    for i, j in np.ndindex(3, 3):
        x, y = points[i], points[j]
        along_x = np.array([-(1 - y), 1 - y, y, -y]) @ corners
        along_y = np.array([-(1 - x), -x, x, 1 - x]) @ corners
        shapes.append([(1 - x) * (1 - y), x * (1 - y), x * y, (1 - x) * y])
        weights.append(gauss[i] * gauss[j] * np.linalg.norm(np.cross(along_x, along_y), axis=1))
    return np.array(shapes), np.stack(weights, axis=1)
