"""Structured triangle meshes of rectangles and trapezoids."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.fem.named_parts import PartedMesh
from enumsol.support.arguments import positive_integer, positive_number
from enumsol.support.array_arguments import plain_array

if TYPE_CHECKING:
    from enumsol.support.array_types import ArrayLike, Floats, Integers

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
        """The same with its sides as parts named bottom, top, left and right, for `mesh_problem`."""
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
