"""Kinds of cells, with nodes in the order of VTK, and the nodes of their facets that can be in contact."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from enumsol.model.facets import CELL_FACETS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Integers = NDArray[np.int64]

#: Corners of the reference hexahedron (0, 1)^3.
HEXAHEDRON = np.array(
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], dtype=np.float64
)
#: Edges of a hexahedron, and its facets with the edges between their corners, by pairs of corners.
_EDGES = np.array(
    [[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]], dtype=np.int64
)
_SIDES, _SIDE_EDGES = CELL_FACETS[3, 27][:, :4], CELL_FACETS[3, 27][:, 4:8]


@dataclass(frozen=True)
class CellKind:
    """A kind of cell, with the names that scikit-fem has for it.

    Attributes
    ----------
    name : in messages
    mesh, element : scikit-fem's classes; of "MeshQuadS2" it has the element only
    corners : nodes of a cell that are corners
    degree : of the quadrature of its stiffness
    places : (k, d) array or None
        Places of the nodes in the reference cell where scikit-fem's order differs.
    simplex : whether the nodes may come in any order
    """

    name: str
    mesh: str
    element: str
    corners: int
    degree: int
    places: Floats | None = None
    simplex: bool = False


_TRIQUADRATIC = np.concatenate(
    [HEXAHEDRON, HEXAHEDRON[_EDGES].mean(axis=1), HEXAHEDRON[_SIDES].mean(axis=1), [[0.5, 0.5, 0.5]]]
)

#: By dimension and nodes of a cell.
KINDS = {
    (2, 3): CellKind("triangles", "MeshTri1", "ElementTriP1", 3, 0, simplex=True),
    (2, 4): CellKind("quadrilaterals", "MeshQuad1", "ElementQuad1", 4, 3),
    (2, 6): CellKind("quadratic triangles", "MeshTri2", "ElementTriP2", 3, 4),
    (2, 8): CellKind("quadratic quadrilaterals with 8 nodes", "MeshQuadS2", "ElementQuadS2", 4, 5),
    (2, 9): CellKind("quadratic quadrilaterals", "MeshQuad2", "ElementQuad2", 4, 5),
    (3, 4): CellKind("tetrahedra", "MeshTet1", "ElementTetP1", 4, 0, simplex=True),
    (3, 8): CellKind("hexahedra", "MeshHex1", "ElementHex1", 8, 3, HEXAHEDRON),
    (3, 10): CellKind("quadratic tetrahedra", "MeshTet2", "ElementTetP2", 4, 4),
    (3, 27): CellKind("quadratic hexahedra", "MeshHex2", "ElementHex2", 8, 5, _TRIQUADRATIC),
}


def contact_nodes(dimension: int, facets: Integers) -> Integers:
    """Nodes (k, m) of facets that can be in contact: all, but of triangles of second order those between corners.

    A uniform pressure on a triangle with six nodes has no part at its corners.
    """
    return facets[:, 3:] if (dimension, facets.shape[1]) == (3, 6) else facets


def completed(points: Floats, cells: Integers) -> tuple[Floats, Integers]:
    """Hexahedra with 20 nodes as such with 27 of the same shape; the new nodes have the last numbers.

    On facets with eight nodes a uniform pressure pulls at the corners; on those with nine it presses on every node.
    """
    corners, between = cells[:, :8], cells[:, 8:]
    sides = np.sort(corners[:, _SIDES], axis=2).reshape(-1, 4)
    _, first, number = np.unique(sides, axis=0, return_index=True, return_inverse=True)
    at = points[corners][:, _SIDES].sum(axis=2), points[between][:, _SIDE_EDGES - 8].sum(axis=2)
    centres = (0.5 * at[1] - 0.25 * at[0]).reshape(-1, 3)[first]
    inside = 0.25 * (points[between].sum(axis=1) - points[corners].sum(axis=1))
    of_sides = len(points) + number.reshape(-1, 6)
    of_cells = len(points) + len(centres) + np.arange(len(cells))
    return np.concatenate([points, centres, inside]), np.concatenate([cells, of_sides, of_cells[:, None]], axis=1)
