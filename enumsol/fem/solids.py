"""Linear elastic bodies of P1 tetrahedra or Q1 hexahedra: stiffness by scikit-fem, body forces and tractions.

Degrees of freedom before constraints are ``3 node + component``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import scipy.sparse as sp

from enumsol.fem.bases import nodal_basis
from enumsol.fem.mesh_checks import elements, lame_coefficients, positions, vectors_of_all
from enumsol.fem.restrained import gathered
from enumsol.fem.solid_geometry import facet_quadrature, shape_volumes, solid_mesh

if TYPE_CHECKING:
    from enumsol.support.array_types import ArrayLike, Floats


def solid_stiffness(points: ArrayLike, cells: ArrayLike, lame: tuple[float, float]) -> sp.csc_array:
    """Stiffness of the unconstrained body, (3N, 3N), assembled by scikit-fem.

    Parameters
    ----------
    points : (N, 3) array_like
        Positions of the nodes [length].
    cells : (M, 4) or (M, 8) array_like of int
        Nodes of each tetrahedron, or of each hexahedron in the order of VTK; in any orientation.
    lame : (float, float)
        Lame coefficients l, m with m > 0, 3 l + 2 m > 0 [force / length^2].

    Returns
    -------
    csc_array of shape (3N, 3N)
        Its kernel holds the rigid motions [force / length].

    Raises
    ------
    InvalidArgumentError
        The mesh is not valid (shapes, node numbers, a cell without volume or inside out, a node in no cell) or the
        coefficients are not admissible.

    Examples
    --------
    >>> from enumsol import fem
    >>> mesh = fem.box(2, 1, 1)
    >>> fem.solid_stiffness(mesh.points, mesh.cells, lame=(1, 1)).shape
    (36, 36)
    """
    lam, mu = lame_coefficients(lame, 3)
    return nodal_basis(*solid_mesh(points, cells)).stiffness(lam, mu)


def solid_body_forces(points: ArrayLike, cells: ArrayLike, density: ArrayLike) -> Floats:
    """Nodal forces of a body force constant on each cell, (N, 3) [force].

    Parameters
    ----------
    points, cells
        The mesh, see `solid_stiffness`.
    density : (3,) or (M, 3) array_like
        Force per volume in x, y and z, one for all or one for each cell [force / length^3].

    Raises
    ------
    InvalidArgumentError
        The mesh is not valid, or density has the wrong shape.

    Examples
    --------
    >>> from enumsol import fem
    >>> mesh = fem.box(1, 1, 1)
    >>> fem.solid_body_forces(mesh.points, mesh.cells, density=(0, 0, -8)).sum(axis=0).round(12).tolist()
    [0.0, 0.0, -8.0]
    """
    nodes, bodies = solid_mesh(points, cells)
    values = vectors_of_all(density, "density", (len(bodies), 3))
    return gathered(bodies, shape_volumes(nodes, bodies), values, len(nodes))


def facet_forces(points: ArrayLike, facets: ArrayLike, traction: ArrayLike) -> Floats:
    """Nodal forces of tractions constant on each facet, (N, 3) [force].

    Parameters
    ----------
    points : (N, 3) array_like
        Positions of the nodes [length].
    facets : (k, 3) or (k, 4) array_like of int
        Nodes of each loaded triangle or (bilinear) quadrilateral, one after the other along its outline.
    traction : (3,) or (k, 3) array_like
        Force per area in x, y and z, one for all or one for each facet [force / length^2].

    Raises
    ------
    InvalidArgumentError
        An argument has the wrong shape, or a node number is out of range.

    Examples
    --------
    >>> from enumsol import fem
    >>> corners = [[0, 0, 0], [6, 0, 0], [0, 1, 0]]
    >>> fem.facet_forces(corners, [[0, 1, 2]], traction=(0, 0, -1)).round(12)[:, 2].tolist()
    [-1.0, -1.0, -1.0]
    """
    nodes = positions(points, 3)
    surface = elements(facets, "facets", (3, 4), len(nodes))
    density = vectors_of_all(traction, "traction", (len(surface), 3))
    values, weights = facet_quadrature(nodes, surface)
    return gathered(surface, weights @ values, density, len(nodes))
