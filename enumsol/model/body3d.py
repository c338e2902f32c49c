"""What a problem in 3D keeps of its discretization: the mesh, and how slips are averaged."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from enumsol.errors import InvalidArgumentError, InvalidProblemError
from enumsol.support.array_arguments import real_array, real_matrix
from enumsol.support.immutable import Immutable, Sealed, SealedMatrix, sealed

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

#: Nodes of a cell, and of a facet.
_CELLS, _FACETS = (4, 8, 10, 27), (3, 4, 6, 9)
#: How far from 1 weights of a mean may add up to.
_SUM_TOLERANCE = 1e-9


@dataclass(frozen=True)
class BodyMesh(Sealed):
    """The mesh a problem was made of, for pictures, files and norms.

    Attributes
    ----------
    points : (N, 3) array [length]
    cells : (M, k) array of int
        Tetrahedra (k = 4 or 10) or hexahedra (k = 8 or 27), in the order of VTK.
    dofs : (n,) array of int
        The degree of freedom ``3 node + component`` that each entry of u is; the others are held at 0.
    facets : (k, m) array of int or None
        Contact surface: corners counterclockwise as seen from outside (m = 3 or 4), then nodes between them and inside
        (m = 6 or 9).
    rows : (k,) array of int or None
        Where contact rows stand for patches, the row of each facet (-1: held); None where they stand for nodes.

    Raises
    ------
    InvalidProblemError
        An array is not of that form.

    Examples
    --------
    >>> import enumsol
    >>> mesh = enumsol.gallery.block3d(1, 1, 1).mesh
    >>> mesh.points.shape, mesh.cells.shape, mesh.dofs.shape
    ((8, 3), (1, 8), (12,))
    """

    points: NDArray[np.float64]
    cells: NDArray[np.int64]
    dofs: NDArray[np.int64]
    facets: NDArray[np.int64] | None = None
    rows: NDArray[np.int64] | None = None

    def __post_init__(self) -> None:
        points = real_array(self.points, "mesh_points")
        if points.ndim != 2 or points.shape[1] != 3:
            raise InvalidProblemError(f"mesh_points has shape {points.shape}; expected (N, 3)")
        cells = _numbers(self.cells, "mesh_cells", len(points))
        if cells.ndim != 2 or cells.shape[1] not in _CELLS:
            raise InvalidProblemError(
                f"mesh_cells has shape {cells.shape}; expected (M, k) with k among {', '.join(map(str, _CELLS))}"
            )
        dofs = _numbers(self.dofs, "mesh_dofs", points.size)
        if dofs.ndim != 1 or len(np.unique(dofs)) != len(dofs):
            raise InvalidProblemError(
                f"mesh_dofs has shape {dofs.shape} or repeats a number; expected (n,) distinct ones"
            )
        facets = rows = None
        if self.facets is not None:
            facets = _numbers(self.facets, "mesh_facets", len(points))
            if facets.ndim != 2 or facets.shape[1] not in _FACETS:
                raise InvalidProblemError(
                    f"mesh_facets has shape {facets.shape}; expected (k, m) with m among {', '.join(map(str, _FACETS))}"
                )
        if self.rows is not None:
            rows = _numbers(self.rows, "mesh_rows", None, least=-1)
            if facets is None or rows.shape != facets.shape[:1]:
                raise InvalidProblemError(
                    f"mesh_rows has shape {rows.shape}; expected (k,), one for each of mesh_facets"
                )
        self.__setstate__({"points": points, "cells": cells, "dofs": dofs, "facets": facets, "rows": rows})

    def displacements(self, u: ArrayLike) -> NDArray[np.float64]:
        """Displacement of every point, shape (N, 3), for u of shape (n,) [length].

        Raises
        ------
        InvalidArgumentError
            u is not that.
        """
        full = np.zeros(self.points.size)
        full[self.dofs] = _displacement(u, len(self.dofs))
        return full.reshape(-1, 3)

    def check(self, n: int, p: int) -> BodyMesh:
        """The mesh, which has to be one of a problem with n degrees of freedom and p contact rows."""
        if len(self.dofs) != n:
            raise InvalidProblemError(f"mesh names {len(self.dofs)} degrees of freedom; expected n = {n}")
        if self.rows is not None:
            _numbers(self.rows, "mesh_rows", p, least=-1)
        return self


class SlipMean(Immutable):
    """The slip that coefficients depend on, as weighted means of ``|u_t|``: the return operator r_h (paper, Section 3).

    The slips are ``weights @ |(T1 u, T2 u) - offset|``.

    Parameters
    ----------
    T1, T2 : (q, n) array_like or sparse
        Tangential displacements at q places of the contact surface.
    offset : (q, 2) array_like
        Tangential positions from which slip is counted there [length].
    weights : (p, q) array_like or sparse
        Of nonnegative rows that add up to one.

    Raises
    ------
    InvalidProblemError
        An argument is not of that form.

    Examples
    --------
    >>> import enumsol
    >>> problem = enumsol.gallery.block3d(4, 4, 1, multipliers="elements", ratio=2)
    >>> problem.slip_mean.weights.sum(axis=1)
    array([1., 1., 1., 1.])
    """

    def __init__(
        self,
        T1: ArrayLike | sp.sparray | sp.spmatrix,
        T2: ArrayLike | sp.sparray | sp.spmatrix,
        offset: ArrayLike,
        weights: ArrayLike | sp.sparray | sp.spmatrix,
    ) -> None:
        given = {"T1": T1, "T2": T2, "weights": weights}
        matrices = {name: sp.csr_array(real_matrix(value, f"slip_mean_{name}")) for name, value in given.items()}
        self.offset = sealed(real_array(offset, "slip_mean_offset"))
        self._parts = {name: SealedMatrix.of(matrix) for name, matrix in matrices.items()}
        self.check(matrices["T1"].shape[1], matrices["weights"].shape[0])
        if np.any(matrices["weights"].data < 0):
            raise InvalidProblemError("slip_mean has a negative weight; expected weights >= 0")
        sums = np.asarray(matrices["weights"].sum(axis=1)).ravel()
        if np.any(np.abs(sums - 1.0) > _SUM_TOLERANCE):
            row = int(np.argmax(np.abs(sums - 1.0)))
            raise InvalidProblemError(f"slip_mean has weights that add up to {sums[row]:g} in row {row}; expected 1")
        self._freeze()

    @property
    def T1(self) -> sp.csr_array:  # noqa: N802 (the field's letter)
        """Displacements along the first tangent, sparse (q, n); a new object, whose parts are read-only."""
        return self._parts["T1"].matrix()

    @property
    def T2(self) -> sp.csr_array:  # noqa: N802 (as above)
        """Displacements along the second tangent, sparse (q, n); a new object as T1 is."""
        return self._parts["T2"].matrix()

    @property
    def weights(self) -> sp.csr_array:
        """Weights, sparse (p, q); a new object as T1 is."""
        return self._parts["weights"].matrix()

    def __call__(self, u: ArrayLike) -> NDArray[np.float64]:
        """Slip of the p contact rows, shape (p,), for u of shape (n,) [length].

        Raises
        ------
        InvalidArgumentError
            u is not that.
        """
        v = _displacement(u, self._parts["T1"].shape[1])
        return np.asarray(self.weights @ np.hypot(self.T1 @ v - self.offset[:, 0], self.T2 @ v - self.offset[:, 1]))

    def check(self, n: int, p: int) -> SlipMean:
        """The mean, which has to be one of a problem with n degrees of freedom and p contact rows."""
        q = self._parts["T1"].shape[0]
        found = (*(self._parts[name].shape for name in ("T1", "T2")), self.offset.shape, self._parts["weights"].shape)
        if found != (expected := ((q, n), (q, n), (q, 2), (p, q))):
            raise InvalidProblemError(f"slip_mean has T1, T2, offset, weights of shapes {found}; expected {expected}")
        return self

    def __repr__(self) -> str:
        (p, q), n = self._parts["weights"].shape, self._parts["T1"].shape[1]
        return f"SlipMean of |u_t| at {q} places for {p} contact rows and {n} degrees of freedom"


def _displacement(u: ArrayLike, n: int) -> NDArray[np.float64]:
    array = real_array(u, "u", error=InvalidArgumentError)
    if array.shape != (n,):
        raise InvalidArgumentError(f"u has shape {array.shape}; expected ({n},)")
    return array


def _numbers(value: Any, name: str, count: int | None, least: int = 0) -> NDArray[np.int64]:
    array = real_array(value, name)
    most = 2**53 if count is None else count
    if np.any(array != np.round(array)) or np.any(array < least) or np.any(array >= most):
        found = f"{least} or more" if count is None else f"{least} .. {count - 1}"
        raise InvalidProblemError(f"{name} holds other numbers than {found}; expected whole ones in that range")
    return array.astype(np.int64)
