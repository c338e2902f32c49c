"""The one table of cells: every kind with its nodes in the order of VTK, its facets, and its names elsewhere.

A new element begins with an entry of `KINDS`; docs/architecture.md lists the other places that it touches.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.support.array_types import Floats, Integers

#: Cosine of the angle up to which the boundary of a solid counts as smooth across an edge.
_SMOOTH = float(np.cos(np.radians(20.0)))


@dataclass(frozen=True, eq=False)
class CellKind:
    """A kind of cell. Its nodes are its corners, then those on its edges, on its facets, and inside.

    Attributes
    ----------
    name : what messages call several of them
    file_name, file_facets : str
        What meshio calls such cells and their facets.
    corners : how many of the nodes are corners
    facets : (k, m) int array
        Nodes of each facet: corners, in 3D counterclockwise as seen from outside a cell of positive volume, then the
        nodes between them in the same order, then that inside.
    mesh, element : scikit-fem's classes; of "MeshQuadS2" it has the element only
    degree : of the quadrature of the stiffness
    places : (k, d) array or None
        Places of the nodes in the reference cell where scikit-fem's order differs.
    simplex : whether the nodes may come in any order
    turned : list of int
        In 3D, the nodes of a cell of the other orientation in the order of one of this orientation.
    """

    name: str
    file_name: str
    file_facets: str
    corners: int
    facets: Integers
    mesh: str
    element: str
    degree: int
    places: Floats | None = None
    simplex: bool = False
    turned: list[int] = field(default_factory=list)

    @property
    def outline(self) -> list[int]:
        """Nodes of a plane cell along its outline."""
        return [int(node) for facet in self.facets for node in (facet[0], *facet[2:])]


#: Corners of the reference hexahedron (0, 1)^3, its edges by pairs of corners, and its facets.
HEXAHEDRON = np.array(
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], dtype=np.float64
)
_EDGES = np.array([[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]])
_SIDES_27 = np.array(
    [
        [3, 0, 4, 7, 11, 16, 15, 19, 20],
        [1, 2, 6, 5, 9, 18, 13, 17, 21],
        [0, 1, 5, 4, 8, 17, 12, 16, 22],
        [2, 3, 7, 6, 10, 19, 14, 18, 23],
        [0, 3, 2, 1, 11, 10, 9, 8, 24],
        [4, 5, 6, 7, 12, 13, 14, 15, 25],
    ]
)
_TRIQUADRATIC = np.concatenate(
    [HEXAHEDRON, HEXAHEDRON[_EDGES].mean(axis=1), HEXAHEDRON[_SIDES_27[:, :4]].mean(axis=1), [[0.5, 0.5, 0.5]]]
)
_EDGES_OF_QUADRILATERAL = np.array([[0, 1, 4], [1, 2, 5], [2, 3, 6], [3, 0, 7]])
_TURNED_TETRAHEDRON = [0, 2, 1, 3, 6, 5, 4, 7, 9, 8]
_TURNED_HEXAHEDRON = [0, 3, 2, 1, 4, 7, 6, 5, 11, 10, 9, 8, 15, 14, 13, 12, 16, 19, 18, 17, 22, 23, 20, 21, 24, 25, 26]

#: By dimension and nodes of a cell.
KINDS: dict[tuple[int, int], CellKind] = {
    (2, 3): CellKind(
        *("triangles", "triangle", "line", 3, np.array([[0, 1], [1, 2], [2, 0]])),
        *("MeshTri1", "ElementTriP1", 0),
        simplex=True,
    ),
    (2, 4): CellKind(
        *("quadrilaterals", "quad", "line", 4, _EDGES_OF_QUADRILATERAL[:, :2]),
        *("MeshQuad1", "ElementQuad1", 3),
    ),
    (2, 6): CellKind(
        *("quadratic triangles", "triangle6", "line3", 3, np.array([[0, 1, 3], [1, 2, 4], [2, 0, 5]])),
        *("MeshTri2", "ElementTriP2", 4),
    ),
    (2, 8): CellKind(
        *("quadratic quadrilaterals with 8 nodes", "quad8", "line3", 4, _EDGES_OF_QUADRILATERAL),
        *("MeshQuadS2", "ElementQuadS2", 5),
    ),
    (2, 9): CellKind(
        *("quadratic quadrilaterals", "quad9", "line3", 4, _EDGES_OF_QUADRILATERAL),
        *("MeshQuad2", "ElementQuad2", 5),
    ),
    (3, 4): CellKind(
        *("tetrahedra", "tetra", "triangle", 4, np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])),
        *("MeshTet1", "ElementTetP1", 0),
        simplex=True,
        turned=_TURNED_TETRAHEDRON[:4],
    ),
    (3, 10): CellKind(
        *("quadratic tetrahedra", "tetra10", "triangle6", 4),
        np.array([[0, 2, 1, 6, 5, 4], [0, 1, 3, 4, 8, 7], [1, 2, 3, 5, 9, 8], [0, 3, 2, 7, 9, 6]]),
        *("MeshTet2", "ElementTetP2", 4),
        turned=_TURNED_TETRAHEDRON,
    ),
    (3, 8): CellKind(
        *("hexahedra", "hexahedron", "quad", 8),
        np.array([[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]),
        *("MeshHex1", "ElementHex1", 3, HEXAHEDRON),
        turned=_TURNED_HEXAHEDRON[:8],
    ),
    (3, 27): CellKind(
        *("quadratic hexahedra", "hexahedron27", "quad9", 8, _SIDES_27),
        *("MeshHex2", "ElementHex2", 5, _TRIQUADRATIC),
        turned=_TURNED_HEXAHEDRON,
    ),
}
#: Nodes of a triangle among those of the quadrilateral that it is, by the number of nodes of a quadrilateral.
TRIANGLES = {4: [0, 1, 2], 8: [0, 1, 2, 4, 5, 7], 9: [0, 1, 2, 4, 5, 7]}
#: Nodes of the quadrilateral that a triangle is among quadrilaterals.
_QUADRILATERALS = {4: [0, 1, 2, 2], 8: [0, 1, 2, 2, 3, 4, 2, 5], 9: [0, 1, 2, 2, 3, 4, 2, 5, 2]}


def numbers_of_nodes(dimension: int) -> tuple[int, ...]:
    """Numbers of nodes that cells may have, in ascending order."""
    return tuple(sorted(nodes for d, nodes in KINDS if d == dimension))


def as_quadrilaterals(triangles: Integers, nodes: int) -> Integers:
    """Triangles among quadrilaterals of 4, 8 or 9 nodes: the last corner is named twice.

    So is every node that a quadrilateral has between the two or inside.
    """
    return triangles[:, _QUADRILATERALS[nodes]]


def by_kind(dimension: int, cells: Integers) -> list[tuple[Integers, Integers]]:
    """The rows of cells that are of one kind, and their nodes, for each kind that there is.

    Triangles among quadrilaterals are a kind of their own.

    Raises
    ------
    InvalidArgumentError
        The cells have a number of nodes that no kind has.
    """
    count = cells.shape[1]
    if (dimension, count) not in KINDS:
        known = ", ".join(map(str, numbers_of_nodes(dimension)))
        raise InvalidArgumentError(f"cells have {count} nodes each; expected one of {known} in {dimension}D")
    if dimension == 3 or count not in TRIANGLES:
        return [(np.arange(len(cells)), cells)]
    triangular = cells[:, 2] == cells[:, 3]
    rows, others = np.flatnonzero(triangular), np.flatnonzero(~triangular)
    parts = [(rows, cells[rows][:, TRIANGLES[count]]), (others, cells[others])]
    return [part for part in parts if len(part[0])]


def boundary_facets(dimension: int, cells: Integers) -> Integers:
    """Facets (k, m) that belong to one cell only; in 3D counterclockwise as seen from outside the body."""
    parts = []
    for _, nodes in by_kind(dimension, cells):
        local = KINDS[dimension, nodes.shape[1]].facets
        parts.append(nodes[:, local].reshape(-1, local.shape[1]))
    facets = np.concatenate(parts)
    _, first, count = np.unique(np.sort(facets, axis=1), axis=0, return_index=True, return_counts=True)
    return np.asarray(facets[np.sort(first[count == 1])])


def facet_rows(facets: Integers, among: Integers, corners: int) -> list[int]:
    """The row of each of the facets ``among`` others, by their first ``corners`` nodes in any order; -1 for none."""
    known = {tuple(key): row for row, key in enumerate(np.sort(among[:, :corners], axis=1).tolist())}
    return [known.get(tuple(key), -1) for key in np.sort(facets[:, :corners], axis=1).tolist()]


def facet_outlines(facets: Integers) -> Integers:
    """Nodes (k, m) along the edges of facets of solids, from corner to corner by what lies between them."""
    outline = KINDS[2, facets.shape[1]].outline
    return facets[:, outline]


def outline_edges(points: Floats, faces: Integers) -> Integers:
    """Edges (k, 2) of outlines of boundary facets at which the surface of a solid bends by more than 20 degrees."""
    after = np.roll(faces, -1, axis=1)
    edges = np.sort(np.stack([faces, after], axis=2).reshape(-1, 2), axis=1)
    # twice the area of each face as a vector along its normal
    normals = np.sum(np.cross(points[faces], points[after]), axis=1)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(np.float64).tiny)
    of_face = np.repeat(np.arange(len(faces)), faces.shape[1])
    order = np.lexsort((edges[:, 1], edges[:, 0]))
    edges, of_face = edges[order], of_face[order]
    pair = np.flatnonzero(np.all(edges[1:] == edges[:-1], axis=1))
    bends = np.sum(normals[of_face[pair]] * normals[of_face[pair + 1]], axis=1) < _SMOOTH
    return np.asarray(edges[pair[bends]])


def contact_nodes(dimension: int, facets: Integers) -> Integers:
    """Nodes (k, m) of facets that can be in contact: all, but of triangles of second order those between corners.

    A uniform pressure on a triangle with six nodes has no part at its corners.
    """
    return facets[:, 3:] if (dimension, facets.shape[1]) == (3, 6) else facets
