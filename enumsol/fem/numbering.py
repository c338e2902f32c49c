"""Matrices and forces numbered as ``dimension node + component``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

if TYPE_CHECKING:
    from numpy.typing import NDArray


def by_nodes(assembled: Any, basis: Any) -> sp.csc_array:
    """A matrix that scikit-fem assembled on a basis of nodal vectors, renumbered and made exactly symmetric."""
    matrix = sp.coo_array(assembled)
    ours = np.empty(matrix.shape[0], dtype=np.int64)
    ours[basis.nodal_dofs.T.ravel()] = np.arange(matrix.shape[0])
    row, column = ours[matrix.coords[0]], ours[matrix.coords[1]]
    A = sp.csc_array((matrix.data, (row, column)), shape=matrix.shape)
    return sp.csc_array(0.5 * (A + A.T))


def gathered(
    cells: NDArray[np.int64], shares: NDArray[np.float64], density: NDArray[np.float64], count: int
) -> NDArray[np.float64]:
    """Nodal forces (count, dimension): ``shares`` (k, corners) of the densities (k, dimension) on cells."""
    forces = np.zeros((count, density.shape[1]))
    for corner in range(cells.shape[1]):
        np.add.at(forces, cells[:, corner], shares[:, corner, None] * density)
    return forces
