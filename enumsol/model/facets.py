"""Facets of cells with nodes in the order of VTK, by dimension and number of nodes, and the boundary of a mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.model.body2d import triangles_apart

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Integers = NDArray[np.int64]

#: Nodes of each facet of a cell: corners, in 3D counterclockwise as seen from outside a cell of positive volume, then
#: the nodes between them in the same order, then that inside. By dimension and nodes of a cell.
CELL_FACETS = {
    (2, 3): np.array([[0, 1], [1, 2], [2, 0]]),
    (2, 4): np.array([[0, 1], [1, 2], [2, 3], [3, 0]]),
    (2, 6): np.array([[0, 1, 3], [1, 2, 4], [2, 0, 5]]),
    (2, 8): np.array([[0, 1, 4], [1, 2, 5], [2, 3, 6], [3, 0, 7]]),
    (2, 9): np.array([[0, 1, 4], [1, 2, 5], [2, 3, 6], [3, 0, 7]]),
    (3, 4): np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]),
    (3, 8): np.array([[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]),
    (3, 10): np.array([[0, 2, 1, 6, 5, 4], [0, 1, 3, 4, 8, 7], [1, 2, 3, 5, 9, 8], [0, 3, 2, 7, 9, 6]]),
    (3, 27): np.array(
        [
            [3, 0, 4, 7, 11, 16, 15, 19, 20],
            [1, 2, 6, 5, 9, 18, 13, 17, 21],
            [0, 1, 5, 4, 8, 17, 12, 16, 22],
            [2, 3, 7, 6, 10, 19, 14, 18, 23],
            [0, 3, 2, 1, 11, 10, 9, 8, 24],
            [4, 5, 6, 7, 12, 13, 14, 15, 25],
        ]
    ),
}
#: Corners of the facets of solids, by the number of nodes of a facet.
_CORNERS = {3: 3, 4: 4, 6: 3, 9: 4}


def by_kind(dimension: int, cells: Integers) -> list[tuple[Integers, Integers]]:
    """The rows of cells that are of one kind, and their nodes, for each kind that there is.

    Raises
    ------
    InvalidArgumentError
        The cells have a number of nodes that no kind has.
    """
    count = cells.shape[1]
    if (dimension, count) not in CELL_FACETS:
        known = ", ".join(str(nodes) for d, nodes in CELL_FACETS if d == dimension)
        raise InvalidArgumentError(f"cells have {count} nodes each; expected one of {known} in {dimension}D")
    return triangles_apart(cells) if dimension == 2 else [(np.arange(len(cells)), cells)]


def boundary_facets(dimension: int, cells: Integers) -> Integers:
    """Facets (k, m) that belong to one cell only; in 3D counterclockwise as seen from outside the body."""
    parts = []
    for _, nodes in by_kind(dimension, cells):
        local = CELL_FACETS[dimension, nodes.shape[1]]
        parts.append(nodes[:, local].reshape(-1, local.shape[1]))
    facets = np.concatenate(parts)
    _, first, count = np.unique(np.sort(facets, axis=1), axis=0, return_index=True, return_counts=True)
    return np.asarray(facets[np.sort(first[count == 1])])


def outlines(facets: Integers) -> Integers:
    """Nodes (k, m) along the edges of facets of solids, from corner to corner by what lies between them."""
    corners = _CORNERS[facets.shape[1]]
    if facets.shape[1] == corners:
        return facets
    pairs = np.stack([facets[:, :corners], facets[:, corners : 2 * corners]], axis=2)
    return np.asarray(pairs.reshape(len(facets), -1))
