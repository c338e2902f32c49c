"""Meshes with named parts, in 2D and 3D, and structured ones: triangles in rectangles and trapezoids, boxes in 3D.

Here, too: blocks of facets of a surface, and checks of arguments that describe meshes and what acts on their nodes.
Each gives the value in a plain type and raises InvalidArgumentError for anything else.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.model.cells import KINDS, boundary_facets, by_kind, facet_rows, node_counts, padded
from enumsol.support.arguments import finite_number, one_of, positive_integer, positive_number, shown
from enumsol.support.array_arguments import array_of, plain_array, real_array, short_vector
from enumsol.support.array_types import ArrayLike, Floats, Integers, Mask, NDArray

if TYPE_CHECKING:
    from collections.abc import Mapping

    Cells = Literal["hexahedra", "tetrahedra"]

#: The name of all facets where nothing names groups of them.
ALL = "boundary"


@dataclass(frozen=True)
class PartedMesh:
    """A mesh with named parts: sets of facets, and sets of nodes. In 3D it is a `SolidMesh`.

    Attributes
    ----------
    points : (N, d) array
        Positions of the nodes [length].
    cells : (M, k) int array
        Nodes of each cell, in the order of VTK: its corners, then those on its edges, on its facets, and inside. In 2D
        3 or 6 nodes of triangles, 4, 8 or 9 of quadrilaterals; in 3D 4 or 10 of tetrahedra, 8 or 27 of hexahedra. Among
        quadrilaterals a triangle is one whose last corner is named twice (a, b, c, c), in second order with this corner
        for the node between the two and for that inside, too.
    facets : mapping of names to (k, m) int arrays
        Nodes of the facets of parts of the boundary: corners, then, in second order, the nodes between them, then that
        inside.
    node_sets : mapping of names to (k,) int arrays
        Nodes of parts that are given by nodes.
    bodies : mapping of names to (k,) int arrays
        Rows of the cells of named parts of the body: materials, or several bodies.
    labels : (M,) array or None
        Numbers of the cells in the file that they are from, where it gives such; of instances of parts, text.
    node_labels : tuple of N int or str, or None
        Names of the nodes in the file that they are from, where it gives such. Those that are not in the file are named
        by nodes around them, as in "1/2/6/5".
    types : tuple of str
        What the file calls the elements that the cells are, as in Abaqus; they stand for a formulation.
    """

    points: Floats
    cells: Integers
    facets: Mapping[str, Integers]
    node_sets: Mapping[str, Integers] = field(default_factory=lambda: MappingProxyType({}))
    bodies: Mapping[str, Integers] = field(default_factory=lambda: MappingProxyType({}))
    labels: Integers | None = None
    types: tuple[str, ...] = ()
    node_labels: tuple[int | str, ...] | None = None

    def node_names(self, rows: Integers) -> list[int] | list[str]:
        """Names of nodes in the file that the mesh is from, all numbers or all text; or else their rows."""
        if self.node_labels is None:
            return [int(row) for row in rows]
        names = [self.node_labels[row] for row in rows]
        numbers = [name for name in names if isinstance(name, int)]
        return numbers if len(numbers) == len(names) else [str(name) for name in names]

    def body(self, name: str) -> Integers:
        """Rows of the cells of this name.

        Raises
        ------
        InvalidArgumentError
            There are none.
        """
        return self._named(name, "cells", self.bodies)

    def part(self, name: str) -> Integers:
        """Facets of this name.

        Raises
        ------
        InvalidArgumentError
            There are none.
        """
        return self._named(name, "facets", self.facets)

    def nodes(self, name: str) -> Integers:
        """Nodes of this name, or of the facets of this name, in order.

        Raises
        ------
        InvalidArgumentError
            There are none.
        """
        what = "facets or nodes" if self.node_sets else "facets"
        return np.unique(self._named(name, what, {**self.facets, **self.node_sets}))

    def _named(self, name: str, what: str, known: Mapping[str, Integers]) -> Integers:
        if name in known:
            return known[name]
        close = difflib.get_close_matches(str(name), known, n=1)
        several = [part for part in re.split(r"[\s,;]+", str(name)) if part]
        hint = f" (did you mean {close[0]}?)" if close else ""
        if len(several) > 1 and all(part in known for part in several):
            hint = f" (give {' and '.join(several)} one by one)"
        elif [*known] == [ALL]:
            hint = " (the file names no parts of its boundary; in gmsh physical groups do)"
        elif what == "cells":
            hint = hint or " (in gmsh, physical groups of surfaces, in 3D of volumes, name parts of the body)"
        raise InvalidArgumentError(
            f"the mesh has no {what} named {shown(name)}; expected one of {', '.join(known) or 'none'}{hint}"
        )

    def __repr__(self) -> str:
        parts = ", ".join(f"{name} ({len(part)})" for name, part in self.facets.items()) or "none"
        dimension = self.points.shape[1]
        kinds = [
            f"{len(rows)} {KINDS[dimension, cells.shape[1]].name}" for rows, cells in by_kind(dimension, self.cells)
        ]
        lines = [
            f"{type(self).__name__} with {len(self.points)} nodes",
            f"  cells   {', '.join(kinds)}",
            f"  facets  {parts}",
        ]
        if self.bodies:
            lines.insert(2, "  bodies  " + ", ".join(f"{name} ({len(rows)})" for name, rows in self.bodies.items()))
        if self.node_sets:
            lines.append("  nodes   " + ", ".join(f"{name} ({len(part)})" for name, part in self.node_sets.items()))
        return "\n".join(lines)


class SolidMesh(PartedMesh):
    """A mesh of tetrahedra or hexahedra with named sets of facets.

    Attributes
    ----------
    points : (N, 3) array
        Positions of the nodes [length].
    cells : (M, k) int array
        Nodes of each tetrahedron (k = 4 or 10) or hexahedron (k = 8 or 27), in the order of VTK.
    facets : mapping of names to (k, m) int arrays
        Nodes of the triangles (m = 3 or 6) or quadrilaterals (m = 4 or 9) of parts of the boundary.
    node_sets, bodies, labels, types, node_labels
        As in `PartedMesh`.
    """


@dataclass(frozen=True, eq=False)
class FileMesh:
    """A mesh as a file has it, in its own numbers of nodes, of which a `PartedMesh` is made.

    Attributes
    ----------
    points : (N, d) array
    kinds : list of str
        Kinds of all cells, by meshio's names.
    blocks : list of (m, k) int arrays
        Cells of bodies by their kinds, in the order of VTK.
    facets, node_sets, bodies, labels, types
        As in `PartedMesh`.
    node_labels : list of int or str, or None
        Numbers of the nodes in a deck, behind the names of instances; None for other files.
    """

    points: Floats
    kinds: list[str]
    blocks: list[Integers]
    facets: Mapping[str, Integers]
    node_sets: Mapping[str, Integers]
    bodies: Mapping[str, Integers]
    labels: NDArray[Any] | None = None
    types: tuple[str, ...] = ()
    node_labels: list[int] | list[str] | None = None


#: Largest number of cells along one side of a mesh.
MOST_CELLS = 10_000


@dataclass(frozen=True)
class Mesh:
    """A mesh of nx by ny cells, each cut into two triangles; node (i, j) has the number ``j (nx + 1) + i``.

    Attributes
    ----------
    points : (N, 2) array
        Positions of the nodes [length].
    triangles : (M, 3) int array
        Nodes of each triangle, counterclockwise.
    bottom, top, left, right : int arrays
        Nodes of the four sides with their corners, from left to right or from bottom to top.
    """

    points: Floats
    triangles: Integers
    bottom: Integers
    top: Integers
    left: Integers
    right: Integers

    def parted(self) -> PartedMesh:
        """Mesh with its sides as parts named bottom, top, left and right, for `mesh_problem`."""
        sides = {name: edges_along(getattr(self, name)) for name in ("bottom", "top", "left", "right")}
        return PartedMesh(self.points, self.triangles, MappingProxyType(sides))


def rectangle(nx: int, ny: int, length: float = 1.0, height: float = 1.0) -> Mesh:
    """Mesh of (0, length) x (0, height), every cell cut from its lower left to its upper right corner.

    Parameters
    ----------
    nx, ny : int
        Cells along x and y, 1 to MOST_CELLS.
    length, height : float
        Lengths of the sides [length].

    Raises
    ------
    InvalidArgumentError
        A number is not positive.

    Examples
    --------
    >>> from enumsol import fem
    >>> mesh = fem.rectangle(2, 1)
    >>> mesh.points.shape, mesh.triangles.shape, mesh.top.tolist()
    ((6, 2), (4, 3), [3, 4, 5])
    """
    nx, ny = (positive_integer(count, name, most=MOST_CELLS) for name, count in (("nx", nx), ("ny", ny)))
    length, height = positive_number(length, "length"), positive_number(height, "height")
    x, y = np.meshgrid(np.linspace(0.0, length, nx + 1), np.linspace(0.0, height, ny + 1))
    return _structured(nx, ny, x, y, mirrored=False)


def trapezoid(nx: int, ny: int, bottom: float, top: float, height: float) -> Mesh:
    """Mesh of a trapezoid symmetric about x = 0; for even nx the mesh is its own mirror image.

    Parameters
    ----------
    nx, ny : int
        Cells across and along y, 1 to MOST_CELLS.
    bottom, top : float
        Widths at y = 0 and at y = height [length].
    height : float
        Height [length].

    Raises
    ------
    InvalidArgumentError
        A number is not positive.

    Examples
    --------
    >>> from enumsol import fem
    >>> mesh = fem.trapezoid(2, 1, bottom=1.0, top=2.0, height=1.0)
    >>> mesh.points[mesh.top].tolist()
    [[-1.0, 1.0], [0.0, 1.0], [1.0, 1.0]]
    """
    nx, ny = (positive_integer(count, name, most=MOST_CELLS) for name, count in (("nx", nx), ("ny", ny)))
    bottom, top = positive_number(bottom, "bottom"), positive_number(top, "top")
    height = positive_number(height, "height")
    across, y = np.meshgrid(np.linspace(-0.5, 0.5, nx + 1), np.linspace(0.0, height, ny + 1))
    x = across * (bottom + (top - bottom) * y / height)
    return _structured(nx, ny, x, y, mirrored=True)


def edges_along(nodes: ArrayLike) -> Integers:
    """Edges between consecutive nodes, (k - 1, 2), as for the nodes of a side of a mesh.

    Parameters
    ----------
    nodes : (k,) int array
        Nodes in their order along a line.

    Raises
    ------
    InvalidArgumentError
        The nodes are not an array (k,) of integers.

    Examples
    --------
    >>> from enumsol import fem
    >>> fem.edges_along([3, 4, 5]).tolist()
    [[3, 4], [4, 5]]
    """
    line = plain_array(nodes, "nodes", error=InvalidArgumentError)
    if line.ndim != 1 or line.dtype.kind not in "iu":
        raise InvalidArgumentError(
            f"nodes has shape {line.shape} and type {line.dtype}; expected (k,) node numbers (integers)"
        )
    return np.stack([line[:-1], line[1:]], axis=1)


def _structured(nx: int, ny: int, x: Floats, y: Floats, *, mirrored: bool) -> Mesh:
    number = np.arange((nx + 1) * (ny + 1)).reshape(ny + 1, nx + 1)
    a, b = number[:-1, :-1].ravel(), number[:-1, 1:].ravel()
    c, d = number[1:, 1:].ravel(), number[1:, :-1].ravel()
    rising = np.stack([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)], axis=1)
    falling = np.stack([np.stack([a, b, d], axis=1), np.stack([b, c, d], axis=1)], axis=1)
    column = np.tile(np.arange(nx), ny)
    turned = mirrored & (column >= (nx + 1) // 2)
    triangles = np.where(turned[:, None, None], falling, rising).reshape(-1, 3)
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    return Mesh(points, triangles, number[0], number[-1], number[:, 0], number[:, -1])


#: Most cells along one side of a box.
MOST_CELLS_OF_A_SIDE = 1_000
#: The six tetrahedra of a cell: ways along its edges from its first corner to the opposite one.
_PATHS = ((0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6))


def box(nx: int, ny: int, nz: int, size: ArrayLike = (1.0, 1.0, 1.0), cells: Cells = "hexahedra") -> SolidMesh:
    """Mesh of (0, a) x (0, b) x (0, c) with nx by ny by nz cells and its six sides.

    Node (i, j, k) has the number ``(k (ny + 1) + j) (nx + 1) + i``. The sides are named left and right (x = 0, a),
    front and back (y = 0, b), bottom and top (z = 0, c).

    Parameters
    ----------
    nx, ny, nz : int
        Cells along x, y and z, 1 to MOST_CELLS_OF_A_SIDE.
    size : (3,) array_like
        Lengths a, b, c of the sides [length].
    cells : {"hexahedra", "tetrahedra"}
        Whole cells, or six tetrahedra of each that share its diagonal; those of neighbours fit together.

    Raises
    ------
    InvalidArgumentError
        An argument is not of the stated form.

    Examples
    --------
    >>> from enumsol import fem
    >>> fem.box(4, 3, 2, cells="tetrahedra")
    SolidMesh with 60 nodes
      cells   144 tetrahedra
      facets  left (12), right (12), front (16), back (16), bottom (24), top (24)
    """
    counts = [
        positive_integer(count, name, most=MOST_CELLS_OF_A_SIDE) for name, count in (("nx", nx), ("ny", ny), ("nz", nz))
    ]
    lengths = short_vector(size, "size", 3)
    if np.min(lengths) <= 0:
        raise InvalidArgumentError(f"size is {shown(size)}; expected three lengths > 0")
    one_of(cells, "cells", (KINDS[3, 8].name, KINDS[3, 4].name))
    z, y, x = np.meshgrid(*(np.linspace(0.0, lengths[k], counts[k] + 1) for k in (2, 1, 0)), indexing="ij")
    points = np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)
    number = np.arange(len(points)).reshape(z.shape)
    low, high = slice(None, -1), slice(1, None)
    corners = [(k, j, i) for k in (low, high) for j, i in ((low, low), (low, high), (high, high), (high, low))]
    hexahedra = np.stack([number[corner].ravel() for corner in corners], axis=1)
    bodies = hexahedra if cells == "hexahedra" else hexahedra[:, np.array(_PATHS)].reshape(-1, 4)
    return SolidMesh(points, bodies, _sides(points, bodies, lengths))


def _sides(points: Floats, cells: Integers, size: Floats) -> Any:
    facets = boundary_facets(3, cells)
    corners = points[facets]
    names = (("left", "right"), ("front", "back"), ("bottom", "top"))
    return MappingProxyType(
        {
            name: facets[np.all(corners[:, :, axis] == place, axis=1)]
            for axis, pair in enumerate(names)
            for name, place in zip(pair, (0.0, size[axis]), strict=True)
        }
    )


def blocks(points: ArrayLike, facets: ArrayLike, ratio: int) -> Integers:
    """Labels (k,) of facets in a rectangular grid, joined to blocks of ratio by ratio cells of the grid.

    The grid lies in a plane perpendicular to an axis, its cells are quadrilaterals or pairs of triangles, and need not
    be equally large. Where ratio does not divide their number along a side the last blocks are smaller. Blocks are
    numbered along the first of the two axes, then along the second.

    Parameters
    ----------
    points : (N, 3) array_like
        Positions of the nodes [length].
    facets : (k, 3) or (k, 4) array_like of int
        Nodes of each facet.
    ratio : int
        Cells along the side of a block: the ratio H/h of the paper.

    Raises
    ------
    InvalidArgumentError
        The facets form no such grid.

    Examples
    --------
    >>> from enumsol import fem
    >>> mesh = fem.box(4, 2, 1)
    >>> fem.blocks(mesh.points, mesh.facets["bottom"], ratio=2).tolist()
    [0, 0, 1, 1, 0, 0, 1, 1]
    """
    nodes = positions(points, 3)
    surface = elements(facets, "facets", (3, 4), len(nodes))
    width = positive_integer(ratio, "ratio")
    low, high = nodes[surface].min(axis=1), nodes[surface].max(axis=1)
    same = SAME * max(float(np.max(high.max(axis=0) - low.min(axis=0))), np.finfo(np.float64).tiny)
    flat = np.max(high, axis=0) - np.min(low, axis=0) <= same
    if np.sum(flat) != 1:
        raise _no_grid("they do not lie in one plane perpendicular to an axis")
    axes = np.flatnonzero(~flat)
    starts = np.stack([_steps(low[:, axis], same) for axis in axes], axis=1)
    ends = np.stack([_steps(high[:, axis], same) for axis in axes], axis=1)
    counts = starts.max(axis=0) + 1
    # every cell of the grid is filled by one quadrilateral or two triangles, which lie in no other cell
    filled = np.bincount(starts[:, 1] * counts[0] + starts[:, 0], minlength=int(np.prod(counts)))
    if np.any(starts != ends) or np.any(filled != (1 if surface.shape[1] == 4 else 2)):
        raise _no_grid("they do not fill a rectangular grid")
    block = starts // min(width, int(counts.max()))
    return np.asarray(block[:, 1] * (block[:, 0].max() + 1) + block[:, 0])


def _steps(values: Floats, same: float) -> Integers:
    """For each value how many smaller ones there are, not counting those that are the same."""
    order = np.argsort(values, kind="stable")
    step = np.concatenate([[0], np.cumsum(np.diff(values[order]) > same)])
    ranks = np.empty(len(values), dtype=np.int64)
    ranks[order] = step
    return ranks


def _no_grid(found: str) -> InvalidArgumentError:
    return InvalidArgumentError(
        f"ratio needs contact facets in a rectangular grid, and {found}; expected patches, a label for every facet"
    )


#: Coordinates that differ by less than this share of the extent of a mesh are equal, gaps below it are none, and so is
#: what is left of Newton's equation where a line meets a facet: much larger, nodes of a fine mesh would be one.
SAME = 1e-9
#: Components of directions, places in a facet and integrals of normals below this share of the largest are rounding of
#: coordinates, of which files often have six digits.
ROUNDING = 1e-6
#: Largest coordinates of which areas and volumes are computed, by dimension.
LARGEST_COORDINATE = {2: 1e150, 3: 1e100}


def positions(points: ArrayLike, dimension: int) -> Floats:
    """Positions of nodes, (N, dimension), small enough for areas and volumes."""
    nodes = real_array(points, "points", error=InvalidArgumentError)
    if nodes.ndim != 2 or nodes.shape[1] != dimension:
        raise InvalidArgumentError(f"points has shape {nodes.shape}; expected (N, {dimension})")
    size, most = float(np.max(np.abs(nodes), initial=0.0)), LARGEST_COORDINATE[dimension]
    if size > most:
        power = {2: "square", 3: "cube"}[dimension]
        raise InvalidArgumentError(
            f"points has the coordinate {size:g}, whose {power} overflows; expected at most {most:g}"
        )
    return nodes


def elements(value: ArrayLike, name: str, corners: int | tuple[int, ...], count: int) -> Integers:
    """Nodes of each element, (k, corners) with k >= 1, all below ``count``."""
    array = plain_array(value, name, error=InvalidArgumentError)
    numbers = (corners,) if isinstance(corners, int) else corners
    if array.ndim != 2 or array.shape[1] not in numbers or len(array) == 0:
        expected = " or ".join(f"(k, {number})" for number in numbers)
        raise InvalidArgumentError(f"{name} has shape {array.shape}; expected {expected} node numbers, k >= 1")
    return node_numbers(array.ravel(), name, count, distinct=False).reshape(array.shape)


def node_numbers(value: ArrayLike, name: str, count: int, *, distinct: bool = True) -> Integers:
    """Node numbers below ``count``, (k,) with k >= 1."""
    array = plain_array(value, name, error=InvalidArgumentError)
    if array.ndim != 1 or array.size == 0 or array.dtype.kind not in "iu":
        raise InvalidArgumentError(
            f"{name} has shape {array.shape} and type {array.dtype}; expected at least one node number (integers)"
        )
    if np.min(array) < 0 or np.max(array) >= count:
        raise InvalidArgumentError(
            f"{name} has node numbers from {np.min(array)} to {np.max(array)}; expected them in 0 .. {count - 1}"
        )
    if distinct and len(np.unique(array)) != len(array):
        raise InvalidArgumentError(f"{name} names a node twice; expected distinct nodes")
    return array.astype(np.int64)


def cell_name(row: int, labels: Integers | None = None) -> str:
    """Name of a cell in messages: its number in the file, if that is known, or its row."""
    return f"cells row {row}" if labels is None else f"element {labels[row]}"


def check_every_node_is_used(cells: Integers, count: int, name: str, kind: str) -> None:
    """Raise InvalidArgumentError if a node belongs to no cell: it would have no stiffness."""
    used = np.unique(cells)
    if len(used) != count:
        lone = int(np.setdiff1d(np.arange(count), used)[0])
        raise InvalidArgumentError(f"{name} leave node {lone} out; expected every node in some {kind}")


def check_facets(found: Sequence[object], facets: Integers, name: str) -> None:
    """Raise InvalidArgumentError if a facet of the boundary is found twice, or -1 for one that is none."""
    if -1 in found:
        k = found.index(-1)
        raise InvalidArgumentError(
            f"{name} row {k}, nodes {facets[k].tolist()}, is not a facet on the boundary of the body; "
            "expected facets of one cell each"
        )
    if len(set(found)) != len(found):
        raise InvalidArgumentError(f"{name} names a facet twice; expected distinct facets")


def lame_coefficients(value: object, dimension: int) -> tuple[float, float]:
    """Value as the Lame coefficients (l, m) of a body, in plane strain or in 3D, that make its energy positive."""
    lam, mu = (float(entry) for entry in short_vector(value, "lame", 2))
    if not (mu > 0 and dimension * lam + 2 * mu > 0):
        bulk = {2: "l + m", 3: "3 l + 2 m"}[dimension]
        raise InvalidArgumentError(
            f"lame is {shown(value)}; expected Lame coefficients (l, m) with m > 0 and {bulk} > 0"
        )
    return lam, mu


def lame(young: float, poisson: float, plane: Literal["strain", "stress"] = "strain") -> tuple[float, float]:
    """Lame coefficients l, m of a material, as the functions of this package take them [force / length^2].

    Parameters
    ----------
    young : float
        Young's modulus, > 0 [force / length^2].
    poisson : float
        Poisson's ratio, above -1 and below 0.5 [-].
    plane : {"strain", "stress"}
        For plane stress l is the one with which the formulas of plane strain give the stiffness of a thin plate.

    Raises
    ------
    InvalidArgumentError
        An argument is not of the stated form.

    Examples
    --------
    >>> from enumsol import fem
    >>> fem.lame(young=2.5, poisson=0.25)
    (1.0, 1.0)
    """
    E, nu = positive_number(young, "young"), finite_number(poisson, "poisson")
    if not -1 < nu < 0.5:
        raise InvalidArgumentError(f"poisson is {nu:g}; expected Poisson's ratio, above -1 and below 0.5")
    stress = one_of(plane, "plane", ("strain", "stress")) == "stress"
    return E * nu / ((1 + nu) * (1 - (nu if stress else 2 * nu))), E / (2 * (1 + nu))


def held_mask(held: ArrayLike, shape: tuple[int, ...]) -> Mask:
    """Mask (N, dimension) of held components, of node numbers or a mask."""
    array = plain_array(held, "held", error=InvalidArgumentError)
    mask = np.zeros(shape, dtype=bool)
    if array.size == 0:
        return mask
    if array.dtype == bool:
        if array.shape != shape:
            raise InvalidArgumentError(f"held has shape {array.shape}; expected {shape} for a mask of components")
        return array
    mask[node_numbers(array, "held", shape[0], distinct=False)] = True
    return mask


def vectors_of_all(value: object, name: str, shape: tuple[int, ...]) -> Floats:
    """Vectors (k, dimension), one each or one for all."""
    if real_array(value, name, error=InvalidArgumentError).ndim == 1:
        return np.tile(short_vector(value, name, shape[1]), (shape[0], 1))
    return array_of(value, name, shape, f"({shape[1]},) or {shape}")


def unit_vectors(vectors: Floats, name: str) -> Floats:
    """Vectors (k, dimension) scaled to length one."""
    lengths = np.linalg.norm(vectors, axis=1)
    if np.any(lengths == 0):
        raise InvalidArgumentError(f"{name} row {int(np.argmin(lengths))} is zero; expected directions")
    return np.asarray(vectors / lengths[:, None])


def spring_stiffnesses(springs: ArrayLike, shape: tuple[int, ...]) -> Floats:
    """Stiffnesses of springs to the ground, (N, dimension)."""
    values = vectors_of_all(springs, "springs", shape)
    if np.min(values) < 0:
        raise InvalidArgumentError(f"springs has the value {np.min(values):g}; expected stiffnesses >= 0")
    return values


def nodal_vectors(forces: ArrayLike | None, name: str, shape: tuple[int, ...]) -> Floats:
    """Forces on all nodes in the order of degrees of freedom, (dimension N,); zero for None."""
    if forces is None:
        return np.zeros(shape[0] * shape[1])
    return array_of(forces, name, shape, f"{shape}, a force for every node").ravel()


# -- cell blocks -------------------------------------------------------------------------------------------------------
# Cells as files hold them, in blocks of one type each, as the one table of cells that a mesh has.
#
# Quadrilaterals and hexahedra that name nodes twice become the triangles, wedges and tetrahedra that they are, and
# solids
# of second order without nodes on their quadrilateral facets get them.

#: Numbers of nodes of solids that are completed, and those that they have then.
COMPLETED = {20: 27, 15: 18}
#: Numbers of nodes of pyramids.
_PYRAMIDS = (5, 13)


def joined(points: Floats, blocks: Sequence[Integers], labels: Integers | None = None) -> tuple[Floats, Integers]:
    """Points and cells (M, k) of blocks of cells, each (m, n) in the order of VTK, as `PartedMesh` has them.

    Solids may have 15 or 20 nodes, too. The new nodes have the last numbers; nodes of no cell are kept. ``labels`` (M,)
    are the numbers by which messages name cells; by default their rows.

    Raises
    ------
    InvalidArgumentError
        A cell names its last node twice and is no triangle, wedge or tetrahedron.
    """
    from enumsol.decks.elements import shape_of  # not for bodies that are made, of one kind of cells
    from enumsol.decks.faces import uncollapsed

    dimension = points.shape[1]
    rows, parts, first = [], [], 0
    for block in blocks:
        shape = shape_of(dimension, block.shape[1])
        kinds = [(np.arange(len(block)), block)] if shape is None else [k[1:] for k in uncollapsed(shape, block)]
        for own, nodes in kinds:
            twice = (node_counts(nodes) < nodes.shape[1]) | (nodes.shape[1] in _PYRAMIDS)
            if np.any(twice):
                name = cell_name(int(first + own[np.argmax(twice)]), labels)
                how = " as a pyramid does, of which there is no kind" if nodes.shape[1] in _PYRAMIDS else ""
                raise InvalidArgumentError(f"{name} names a node twice{how}; expected distinct nodes")
            rows.append(first + own)
            parts.append(nodes)
        first += len(block)
    if dimension == 3:
        points, parts = completed(points, parts)
    cells = padded(parts)
    return points, np.asarray(cells[np.argsort(np.concatenate(rows), kind="stable")])


def completed(points: Floats, parts: Sequence[Integers]) -> tuple[Floats, list[Integers]]:
    """Hexahedra with 20 nodes as such with 27, and wedges with 15 as such with 18, of the same shape.

    The new nodes have the last numbers. On facets with eight nodes a uniform pressure pulls at the corners; on those
    with nine it presses on every node.
    """
    known: dict[tuple[int, ...], int] = {}
    places: list[Floats] = []
    found = []
    for cells in parts:
        count = COMPLETED.get(cells.shape[1])
        if count is None:
            found.append(cells)
            continue
        kind = KINDS[3, count]
        added = []
        for side in kind.sides:
            if len(side) == 9:
                keys = np.sort(cells[:, side[:4]], axis=1).tolist()
                at = 0.5 * points[cells[:, side[4:8]]].sum(axis=1) - 0.25 * points[cells[:, side[:4]]].sum(axis=1)
                added.append(_numbers(keys, at, known, places, len(points)))
        if kind.form == "hexahedron":
            inside = 0.25 * (points[cells[:, 8:20]].sum(axis=1) - points[cells[:, :8]].sum(axis=1))
            added.append(_numbers(cells.tolist(), inside, known, places, len(points)))
        found.append(np.concatenate([cells, np.stack(added, axis=1)], axis=1))
    return np.concatenate([points, *(place[None] for place in places)]), found


def completing(dimension: int, cells: Integers, count: int) -> list[tuple[Integers, Floats]]:
    """Nodes from ``count`` on, which complete cells as in `completed`, by those that their cells have without them.

    Returns
    -------
    list of (k, 1 + s) int array and (s,) array
        Each row a node and others, and the values of their shape functions there.
    """
    found = []
    for _, nodes in by_kind(dimension, cells):
        kind = KINDS[dimension, nodes.shape[1]]
        around = [(side[8], side[:8], np.repeat([-0.25, 0.5], 4)) for side in kind.sides if len(side) == 9]
        if nodes.shape[1] == 27:
            around.append((26, np.arange(20), np.repeat([-0.25, 0.25], [8, 12])))
        for own, others, shares in around:
            new = nodes[nodes[:, own] >= count]
            found.append((np.column_stack([new[:, own], new[:, others]]), shares))
    return found


def _numbers(
    keys: list[list[int]], places: Floats, known: dict[tuple[int, ...], int], new: list[Floats], first: int
) -> Integers:
    """Numbers of nodes of these keys; those that are not known are new, at their places."""
    found = []
    for key, place in zip(keys, places, strict=True):
        number = known.setdefault(tuple(key), first + len(new))
        if number == first + len(new):
            new.append(place)
        found.append(number)
    return np.array(found, dtype=np.int64)


def as_cells_have(facets: Integers, cells: Integers, name: str) -> Integers:
    """Facets of solids with the nodes that completed cells have there.

    Raises
    ------
    InvalidArgumentError
        One is no facet of a cell.
    """
    kinds = by_kind(3, cells)
    every = padded([nodes[:, side] for _, nodes in kinds for side in KINDS[3, nodes.shape[1]].sides])
    rows = facet_rows(3, facets, every)
    if -1 in rows:
        raise InvalidArgumentError(f"{name} has facets that belong to no cell; expected facets of the body")
    return np.asarray(every[rows])
