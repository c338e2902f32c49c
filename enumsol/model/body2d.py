"""What a problem in 2D keeps of its discretization: the mesh, for pictures and files."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from enumsol.errors import InvalidArgumentError, InvalidProblemError
from enumsol.support.array_arguments import real_array, real_matrix
from enumsol.support.immutable import Immutable, SealedMatrix, sealed

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Floats = NDArray[np.float64]

#: How far products of the columns of a motion may be from those of orthonormal ones.
_ORTHONORMAL = 1e-8
#: Corners and midside nodes of a cell along its outline, by the number of its nodes, in the order of VTK.
OUTLINES = {
    3: (0, 1, 2),
    4: (0, 1, 2, 3),
    6: (0, 3, 1, 4, 2, 5),
    8: (0, 4, 1, 5, 2, 6, 3, 7),
    9: (0, 4, 1, 5, 2, 6, 3, 7),
}


#: Nodes of a triangle among those of the quadrilateral that it is, by the number of nodes of a quadrilateral.
_TRIANGLE = {4: [0, 1, 2], 8: [0, 1, 2, 4, 5, 7], 9: [0, 1, 2, 4, 5, 7]}
#: Nodes of the quadrilateral that a triangle is among quadrilaterals.
_QUADRILATERAL = {4: [0, 1, 2, 2], 8: [0, 1, 2, 2, 3, 4, 2, 5], 9: [0, 1, 2, 2, 3, 4, 2, 5, 2]}


def as_quadrilaterals(triangles: NDArray[np.int64], nodes: int) -> NDArray[np.int64]:
    """Triangles among quadrilaterals of 4, 8 or 9 nodes: the last corner is named twice.

    So is every node that a quadrilateral has between the two or inside.
    """
    return triangles[:, _QUADRILATERAL[nodes]]


def triangles_apart(cells: NDArray[np.int64]) -> list[tuple[NDArray[np.int64], NDArray[np.int64]]]:
    """Rows of the triangles among quadrilaterals with their nodes, and of the others, where there are any."""
    count = cells.shape[1]
    triangular = cells[:, 2] == cells[:, 3] if count in _TRIANGLE else np.zeros(len(cells), dtype=bool)
    rows, others = np.flatnonzero(triangular), np.flatnonzero(~triangular)
    apart = [(rows, cells[rows][:, _TRIANGLE[count]])] if len(rows) else []
    return [*apart, (others, cells[others])] if len(others) else apart


class PlaneMesh(Immutable):
    """The mesh a problem in 2D was made of; the displacements of its nodes are ``motion @ u + offset``.

    Parameters
    ----------
    points : (N, 2) array_like
        Positions of the nodes [length].
    cells : (M, k) array_like of int
        Triangles (k = 3 or 6) or quadrilaterals (k = 4, 8 or 9), in the order of VTK; a triangle among quadrilaterals
        names its last corner twice.
    motion : (2 N, n) array_like or sparse
        Row ``2 node + component`` gives that component of the node's displacement from u, in global axes; its columns
        are orthonormal, so that its transpose takes nodal forces to the problem's right-hand side.
    offset : (N, 2) array_like or None
        Prescribed displacements [length]; None: no node is moved.

    Raises
    ------
    InvalidProblemError
        An array is not of that form.

    Examples
    --------
    >>> import enumsol
    >>> mesh = enumsol.gallery.clamped_block(2, 1).mesh
    >>> mesh.points.shape, mesh.cells.shape, mesh.motion.shape
    ((6, 2), (4, 3), (12, 8))
    """

    def __init__(
        self,
        points: ArrayLike,
        cells: ArrayLike,
        motion: ArrayLike | sp.sparray | sp.spmatrix,
        offset: ArrayLike | None = None,
    ) -> None:
        self.points = sealed(real_array(points, "mesh_points"))
        if self.points.ndim != 2 or self.points.shape[1] != 2:
            raise InvalidProblemError(f"mesh_points has shape {self.points.shape}; expected (N, 2)")
        count = len(self.points)
        numbers = real_array(cells, "mesh_cells")
        if numbers.ndim != 2 or numbers.shape[1] not in OUTLINES:
            raise InvalidProblemError(
                f"mesh_cells has shape {numbers.shape}; expected (M, k) with k among {', '.join(map(str, OUTLINES))}"
            )
        if np.any(numbers != np.round(numbers)) or np.any(numbers < 0) or np.any(numbers >= count):
            raise InvalidProblemError(f"mesh_cells holds other numbers than 0 .. {count - 1}; expected node numbers")
        self.cells = sealed(numbers.astype(np.int64))
        self._motion = SealedMatrix.of(sp.csr_array(real_matrix(motion, "mesh_motion")))
        if self._motion.shape[0] != 2 * count:
            raise InvalidProblemError(
                f"mesh_motion has shape {self._motion.shape}; expected 2 N = {2 * count} rows, two a node"
            )
        off = sp.csr_array(self.motion.T @ self.motion - sp.eye_array(self._motion.shape[1]))
        if np.max(np.abs(off.data), initial=0.0) > _ORTHONORMAL:
            raise InvalidProblemError("mesh_motion has columns that are not orthonormal; expected orthonormal ones")
        self.offset = None if offset is None else sealed(real_array(offset, "mesh_offset"))
        if self.offset is not None and self.offset.shape != (count, 2):
            raise InvalidProblemError(f"mesh_offset has shape {self.offset.shape}; expected (N, 2) = ({count}, 2)")
        self._freeze()

    @classmethod
    def of_dofs(
        cls, points: ArrayLike, cells: ArrayLike, dofs: ArrayLike, offset: ArrayLike | None = None
    ) -> PlaneMesh:
        """The mesh of a problem whose entries of u are the components ``2 node + component`` in ``dofs``, (n,)."""
        columns, size = np.asarray(dofs, dtype=np.int64), 2 * len(np.asarray(points))
        count = len(columns)
        motion = sp.csr_array((np.ones(count), (columns, np.arange(count))), shape=(size, count))
        return cls(points, cells, motion, offset)

    @property
    def motion(self) -> sp.csr_array:
        """Displacements of the nodes from u, sparse (2 N, n); a new object, whose parts are read-only."""
        return self._motion.matrix()

    def displacements(self, u: ArrayLike) -> Floats:
        """Displacement of every node, shape (N, 2), for u of shape (n,) [length].

        Raises
        ------
        InvalidArgumentError
            u is not that.
        """
        array = real_array(u, "u", error=InvalidArgumentError)
        if array.shape != (self._motion.shape[1],):
            raise InvalidArgumentError(f"u has shape {array.shape}; expected ({self._motion.shape[1]},)")
        moved = np.asarray(self.motion @ array).reshape(-1, 2)
        return moved if self.offset is None else moved + self.offset

    def check(self, n: int) -> PlaneMesh:
        """The mesh, which has to be one of a problem with n degrees of freedom."""
        if self._motion.shape[1] != n:
            raise InvalidProblemError(f"mesh moves by {self._motion.shape[1]} degrees of freedom; expected n = {n}")
        return self

    def __repr__(self) -> str:
        return f"PlaneMesh of {len(self.points)} nodes and {len(self.cells)} cells"
