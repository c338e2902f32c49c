"""The one table of cells: every kind with its nodes in the order of VTK, its facets, and its names elsewhere.

A new element begins with an entry of `KINDS`; docs/architecture.md lists the other places that it touches.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.support.array_types import Floats, Integers

#: Cosine of the angle up to which the boundary of a solid counts as smooth across an edge.
_SMOOTH = float(np.cos(np.radians(20.0)))


#: Cells without sides of their own.
_NONE = np.zeros((0, 1), dtype=np.int64)


@dataclass(frozen=True, eq=False)
class CellKind:
    """A kind of cell. Its nodes are its corners, then those on its edges, on its facets, and inside.

    Attributes
    ----------
    name : what messages call several of them
    file_name : what meshio calls them
    corners : how many of the nodes are corners
    form : "line", "triangle", "quadrilateral", "tetrahedron", "wedge" or "hexahedron"
    facets : (k, m) int array
        Nodes of each facet: corners, in 3D counterclockwise as seen from outside a cell of positive volume, then the
        nodes between them in the same order, then that inside; a facet of fewer nodes than another repeats its last.
    places : (n, d) array
        Of the nodes in the reference cell.
    powers : (n, d) int array
        Exponents of the monomials that the shape functions are sums of.
    degree : of the quadrature of the stiffness
    turned : list of int
        In 3D, the nodes of a cell of the other orientation in the order of one of this orientation.
    """

    name: str
    file_name: str
    corners: int
    form: str
    facets: Integers
    places: Floats
    powers: Integers
    degree: int
    turned: list[int] = field(default_factory=list)

    @property
    def outline(self) -> list[int]:
        """Nodes of a plane cell along its outline."""
        return [int(node) for facet in self.facets for node in (facet[0], *facet[2:])]

    @property
    def sides(self) -> list[Integers]:
        """The nodes of each facet, none repeated."""
        return [facet[:count] for facet, count in zip(self.facets, node_counts(self.facets), strict=True)]

    @cached_property
    def _coefficients(self) -> Floats:
        """Coefficients of the monomials in the shape functions, (n, n): whole numbers for all kinds here."""
        inverse: Floats = np.linalg.inv(np.prod(self.places[:, None] ** self.powers, axis=2))
        return np.round(inverse)

    def values(self, places: Floats) -> Floats:
        """Shape functions (n, q) at places (q, d) of the reference."""
        return np.asarray((np.prod(places[:, None] ** self.powers, axis=2) @ self._coefficients).T)

    def slopes(self, places: Floats) -> Floats:
        """Their derivatives (n, d, q)."""
        found = []
        for k in range(self.powers.shape[1]):
            less = self.powers.copy()
            less[:, k] = np.maximum(less[:, k] - 1, 0)
            found.append((self.powers[:, k] * np.prod(places[:, None] ** less, axis=2) @ self._coefficients).T)
        return np.stack(found, axis=1)

    def quadrature(self, degree: int) -> tuple[Floats, Floats]:
        """Places (q, d) and weights (q,) that integrate polynomials of this degree over the reference."""
        if self.form in ("triangle", "tetrahedron"):
            from skfem.quadrature import get_quadrature  # scikit-fem takes a while to import
            from skfem.refdom import RefTet, RefTri

            places, weights = get_quadrature(RefTri if self.form == "triangle" else RefTet, degree)
            return np.asarray(places.T), np.asarray(weights)
        along, share = np.polynomial.legendre.leggauss(max(2, degree // 2 + 1))
        line, share = 0.5 * along[:, None] + 0.5, 0.5 * share
        if self.form == "wedge":
            base, of_base = KINDS[2, 3].quadrature(degree)
            places = np.concatenate([np.repeat(base, len(line), axis=0), np.tile(line, (len(base), 1))], axis=1)
            return places, np.outer(of_base, share).ravel()
        places, weights = line, share
        for _ in range(1, self.powers.shape[1]):
            places = np.concatenate([np.repeat(places, len(line), axis=0), np.tile(line, (len(places), 1))], axis=1)
            weights = np.outer(weights, share).ravel()
        return places, weights


#: Corners of the reference hexahedron (0, 1)^3, its edges by pairs of corners, and its facets.
HEXAHEDRON = np.array(
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], dtype=np.float64
)
_SIMPLEX = np.concatenate([np.zeros((1, 3)), np.eye(3)])
_WEDGE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1]], dtype=np.float64)
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
_SIDES_18 = np.array(
    [
        [0, 2, 1, 8, 7, 6, 6, 6, 6],
        [3, 4, 5, 9, 10, 11, 11, 11, 11],
        [0, 1, 4, 3, 6, 13, 9, 12, 15],
        [1, 2, 5, 4, 7, 14, 10, 13, 16],
        [2, 0, 3, 5, 8, 12, 11, 14, 17],
    ]
)
#: Edges of cells by pairs of corners, in the order of the nodes between them; by the form of a cell.
EDGES = {
    "line": [[0, 1]],
    "triangle": [[0, 1], [1, 2], [2, 0]],
    "quadrilateral": [[0, 1], [1, 2], [2, 3], [3, 0]],
    "tetrahedron": [[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]],
    "wedge": [[0, 1], [1, 2], [2, 0], [3, 4], [4, 5], [5, 3], [0, 3], [1, 4], [2, 5]],
    "hexahedron": [[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]],
}
_EDGES_OF_QUADRILATERAL = np.array([[0, 1, 4], [1, 2, 5], [2, 3, 6], [3, 0, 7]])
_TURNED_TETRAHEDRON = [0, 2, 1, 3, 6, 5, 4, 7, 9, 8]
_TURNED_WEDGE = [0, 2, 1, 3, 5, 4, 8, 7, 6, 11, 10, 9, 12, 14, 13, 17, 16, 15]
_TURNED_HEXAHEDRON = [0, 3, 2, 1, 4, 7, 6, 5, 11, 10, 9, 8, 15, 14, 13, 12, 16, 19, 18, 17, 22, 23, 20, 21, 24, 25, 26]


def _second(corners: Floats, form: str, sides: Integers = _NONE, inside: bool = False) -> Floats:
    """Places of corners, of the middles of edges and of those sides that have nine nodes, and of the middle."""
    own = [side[:4] for side in sides if len(np.unique(side)) == 9]
    middles = [corners[edge].mean(axis=0) for edge in [*EDGES[form], *own]]
    return np.array([*corners, *middles, *([corners.mean(axis=0)] if inside else [])])


def _sums(dimension: int, degree: int) -> Integers:
    """Exponents of all monomials up to a degree."""
    return np.array([e for e in np.ndindex(*(degree + 1,) * dimension) if sum(e) <= degree])


def _products(dimension: int, degree: int) -> Integers:
    """Exponents of all monomials up to a degree in each variable."""
    return np.array(list(np.ndindex(*(degree + 1,) * dimension)))


def _prisms(degree: int) -> Integers:
    return np.array([(*e, k) for e in _sums(2, degree).tolist() for k in range(degree + 1)])


_SQUARE = HEXAHEDRON[:4, :2]
_QUADS = [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]
_TETRAHEDRON = np.array([[0, 2, 1, 6, 5, 4], [0, 1, 3, 4, 8, 7], [1, 2, 3, 5, 9, 8], [0, 3, 2, 7, 9, 6]])
#: By dimension and nodes of a cell; those of dimension one are the edges of plane bodies.
KINDS: dict[tuple[int, int], CellKind] = {
    (1, 2): CellKind("lines", "line", 2, "line", _NONE, _SQUARE[:2, :1], _sums(1, 1), 1),
    (1, 3): CellKind("quadratic lines", "line3", 2, "line", _NONE, np.array([[0.0], [1.0], [0.5]]), _sums(1, 2), 3),
    (2, 3): CellKind(
        *("triangles", "triangle", 3, "triangle", np.array([[0, 1], [1, 2], [2, 0]])),
        *(_SIMPLEX[:3, :2], _sums(2, 1), 0),
    ),
    (2, 4): CellKind(
        *("quadrilaterals", "quad", 4, "quadrilateral", _EDGES_OF_QUADRILATERAL[:, :2]),
        *(_SQUARE, _products(2, 1), 3),
    ),
    (2, 6): CellKind(
        *("quadratic triangles", "triangle6", 3, "triangle", np.array([[0, 1, 3], [1, 2, 4], [2, 0, 5]])),
        *(_second(_SIMPLEX[:3, :2], "triangle"), _sums(2, 2), 4),
    ),
    (2, 8): CellKind(
        *("quadratic quadrilaterals with 8 nodes", "quad8", 4, "quadrilateral", _EDGES_OF_QUADRILATERAL),
        *(_second(_SQUARE, "quadrilateral"), _products(2, 2)[:-1], 5),
    ),
    (2, 9): CellKind(
        *("quadratic quadrilaterals", "quad9", 4, "quadrilateral", _EDGES_OF_QUADRILATERAL),
        *(_second(_SQUARE, "quadrilateral", inside=True), _products(2, 2), 5),
    ),
    (3, 4): CellKind(
        *("tetrahedra", "tetra", 4, "tetrahedron", _TETRAHEDRON[:, :3], _SIMPLEX, _sums(3, 1), 0),
        turned=_TURNED_TETRAHEDRON[:4],
    ),
    (3, 10): CellKind(
        *("quadratic tetrahedra", "tetra10", 4, "tetrahedron", _TETRAHEDRON),
        *(_second(_SIMPLEX, "tetrahedron"), _sums(3, 2), 4),
        turned=_TURNED_TETRAHEDRON,
    ),
    (3, 6): CellKind(
        *("wedges", "wedge", 6, "wedge"),
        np.array([[0, 2, 1, 1], [3, 4, 5, 5], [0, 1, 4, 3], [1, 2, 5, 4], [2, 0, 3, 5]]),
        *(_WEDGE, _prisms(1), 3),
        turned=_TURNED_WEDGE[:6],
    ),
    (3, 18): CellKind(
        *("quadratic wedges", "wedge18", 6, "wedge", _SIDES_18),
        *(_second(_WEDGE, "wedge", _SIDES_18), _prisms(2), 5),
        turned=_TURNED_WEDGE,
    ),
    (3, 8): CellKind(
        *("hexahedra", "hexahedron", 8, "hexahedron", np.array(_QUADS), HEXAHEDRON, _products(3, 1), 3),
        turned=_TURNED_HEXAHEDRON[:8],
    ),
    (3, 27): CellKind(
        *("quadratic hexahedra", "hexahedron27", 8, "hexahedron", _SIDES_27),
        *(_second(HEXAHEDRON, "hexahedron", _SIDES_27, inside=True), _products(3, 2), 5),
        turned=_TURNED_HEXAHEDRON,
    ),
}


def numbers_of_nodes(dimension: int) -> tuple[int, ...]:
    """Numbers of nodes that cells may have, in ascending order."""
    return tuple(sorted(nodes for d, nodes in KINDS if d == dimension))


def padded(parts: Sequence[Integers], width: int = 0) -> Integers:
    """Cells of all parts, or facets, (k, m): those of fewer nodes than m repeat their last."""
    width = max([width, *(part.shape[1] for part in parts)])
    return np.concatenate([part[:, np.minimum(np.arange(width), part.shape[1] - 1)] for part in parts])


def node_counts(cells: Integers) -> Integers:
    """Numbers of nodes of cells or facets, (k,), the last node counted once."""
    last = cells[:, ::-1] == cells[:, -1:]
    repeated = np.where(np.all(last, axis=1), cells.shape[1], np.argmin(last, axis=1))
    return np.asarray(cells.shape[1] - repeated + 1)


def by_kind(dimension: int, cells: Integers) -> list[tuple[Integers, Integers]]:
    """The rows of cells that are of one kind, and their nodes, for each kind that there is.

    The kind of a cell is its number of nodes; where it has fewer than others it repeats its last.

    Raises
    ------
    InvalidArgumentError
        There is a number of nodes that no kind has.
    """
    counts = node_counts(cells)
    found = []
    for count in np.unique(counts).tolist():
        rows = np.flatnonzero(counts == count)
        if (dimension, count) not in KINDS:
            known = ", ".join(map(str, numbers_of_nodes(dimension)))
            raise InvalidArgumentError(
                f"cells row {rows[0]} has {count} nodes; expected one of {known} in {dimension}D, the last repeated "
                "where other cells have more"
            )
        found.append((rows, cells[rows, :count]))
    return found


def boundary(dimension: int, cells: Integers) -> tuple[Integers, Integers]:
    """Facets (k, m) that belong to one cell only, and the rows of these cells, (k,).

    In 3D they are counterclockwise as seen from outside a cell of positive volume.
    """
    parts, owners = [], []
    for rows, nodes in by_kind(dimension, cells):
        local = KINDS[dimension, nodes.shape[1]].facets
        parts.append(nodes[:, local].reshape(-1, local.shape[1]))
        owners.append(np.repeat(rows, len(local)))
    facets, owner = padded(parts), np.concatenate(owners)
    repeated = np.arange(facets.shape[1]) >= node_counts(facets)[:, None]
    keys = np.sort(np.where(repeated, -1, facets), axis=1)
    _, first, count = np.unique(keys, axis=0, return_index=True, return_counts=True)
    outer = np.sort(first[count == 1])
    return np.asarray(facets[outer]), owner[outer]


def boundary_facets(dimension: int, cells: Integers) -> Integers:
    """Facets (k, m) of `boundary`."""
    return boundary(dimension, cells)[0]


def corner_keys(dimension: int, facets: Integers) -> Integers:
    """Corners of the facets of bodies of this dimension in ascending order, after -1 where they have fewer."""
    keys = np.full((len(facets), 2 if dimension == 2 else 4), -1)
    for rows, nodes in by_kind(dimension - 1, facets) if len(facets) else []:
        corners = KINDS[dimension - 1, nodes.shape[1]].corners
        keys[rows, keys.shape[1] - corners :] = np.sort(nodes[:, :corners], axis=1)
    return keys


def facet_rows(dimension: int, facets: Integers, among: Integers) -> list[int]:
    """The row of each of the facets ``among`` others, by their corners in any order; -1 for none."""
    known = {tuple(key): row for row, key in enumerate(corner_keys(dimension, among).tolist())}
    return [known.get(tuple(key), -1) for key in corner_keys(dimension, facets).tolist()]


def facet_outlines(facets: Integers) -> Integers:
    """Nodes (k, m) along the edges of facets of solids, or of plane cells, by what lies between corners.

    Outlines of fewer nodes than others repeat their last.
    """
    outlines = []
    for rows, nodes in by_kind(2, facets):
        outlines.append((rows, nodes[:, KINDS[2, nodes.shape[1]].outline]))
    found = padded([nodes for _, nodes in outlines])
    return found[np.argsort(np.concatenate([rows for rows, _ in outlines]), kind="stable")]


def lines_along(facets: Integers) -> Integers:
    """Nodes (k, 2) or (k, 3) of the edges of plane bodies from end to end."""
    return facets if facets.shape[1] == 2 else facets[:, [0, 2, 1]]


def edges_of(outlines: Integers) -> Integers:
    """Edges of outlines of facets, (k, 2), each once."""
    edges = np.sort(np.stack([outlines, np.roll(outlines, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    return np.unique(edges[edges[:, 0] != edges[:, 1]], axis=0)


def outline_edges(points: Floats, faces: Integers) -> Integers:
    """Edges (k, 2) of outlines of boundary facets at which the surface of a solid bends by more than 20 degrees."""
    after = np.roll(faces, -1, axis=1)
    edges = np.sort(np.stack([faces, after], axis=2).reshape(-1, 2), axis=1)
    # twice the area of each face as a vector along its normal
    normals = np.sum(np.cross(points[faces], points[after]), axis=1)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(np.float64).tiny)
    of_face = np.repeat(np.arange(len(faces)), faces.shape[1])
    whole = edges[:, 0] != edges[:, 1]
    edges, of_face = edges[whole], of_face[whole]
    order = np.lexsort((edges[:, 1], edges[:, 0]))
    edges, of_face = edges[order], of_face[order]
    pair = np.flatnonzero(np.all(edges[1:] == edges[:-1], axis=1))
    bends = np.sum(normals[of_face[pair]] * normals[of_face[pair + 1]], axis=1) < _SMOOTH
    return np.asarray(edges[pair[bends]])


def contact_nodes(dimension: int, facets: Integers) -> Integers:
    """Nodes of facets that can be in contact, in order: all, but of triangles of second order those between corners.

    A uniform pressure on a triangle with six nodes has no part at its corners.
    """
    kinds = [nodes for _, nodes in by_kind(dimension - 1, facets)]
    own = [nodes[:, 3:] if (dimension, nodes.shape[1]) == (3, 6) else nodes for nodes in kinds]
    return np.unique(np.concatenate([nodes.ravel() for nodes in own]))
