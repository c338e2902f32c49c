"""Forces of cells, gathered on their nodes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


def gathered(
    cells: NDArray[np.int64], shares: NDArray[np.float64], density: NDArray[np.float64], count: int
) -> NDArray[np.float64]:
    """Nodal forces (count, dimension): ``shares`` (k, corners) of the densities (k, dimension) on cells."""
    forces = np.zeros((count, density.shape[1]))
    for corner in range(cells.shape[1]):
        np.add.at(forces, cells[:, corner], shares[:, corner, None] * density)
    return forces
