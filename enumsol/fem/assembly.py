"""A plane body on a rigid foundation: stiffness by scikit-fem, loads, and the ContactProblem.

Cells are triangles or quadrilaterals of first or second order, with 3, 6, 4, 8 or 9 nodes in the order of VTK, or both
as in `PartedMesh`. Degrees of freedom before constraints are ``2 node + component``. A problem is put together from
plain arrays::

    loads = edge_forces(points, top_edges, (0.3, -1.0))
    problem = contact_problem(
        points, triangles, (1.0, 1.0), held=left, contact=bottom, normals=(0.0, -1.0), forces=loads
    )
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

import numpy as np
import scipy.sparse as sp

from enumsol.errors import InvalidArgumentError
from enumsol.fem import mesh_checks
from enumsol.fem.bases import FLAT, nodal_basis
from enumsol.fem.restrained import Body, axes_of, gathered, movable, problem_of
from enumsol.model.cells import numbers_of_nodes
from enumsol.model.mesh import BodyMesh

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.model.problem import ContactProblem
    from enumsol.support.array_types import ArrayLike, Floats, Integers


def stiffness(points: ArrayLike, cells: ArrayLike, lame: tuple[float, float]) -> sp.csc_array:
    """Stiffness of the unconstrained body in plane strain, (2N, 2N), assembled by scikit-fem.

    Parameters
    ----------
    points : (N, 2) array_like
        Positions of the nodes [length].
    cells : (M, k) array_like of int
        Nodes of each cell: its corners, then the nodes on its edges, then the one inside; triangles have 3 or 6 nodes,
        quadrilaterals 4, 8 or 9. Edges with three nodes may be curved.
    lame : (float, float)
        Lame coefficients l, m [force / length^2]; for plane stress those of `lame`.

    Returns
    -------
    csc_array of shape (2N, 2N)
        Its kernel holds the rigid motions [force / length, per unit thickness].

    Raises
    ------
    InvalidArgumentError
        The mesh is not valid (shapes, node numbers, a cell that is flat, folded or inside out) or the coefficients are
        not admissible.

    Examples
    --------
    >>> from enumsol import fem
    >>> mesh = fem.rectangle(2, 1)
    >>> fem.stiffness(mesh.points, mesh.triangles, lame=(1, 1)).shape
    (12, 12)
    """
    lam, mu = mesh_checks.lame_coefficients(lame, 2)
    return nodal_basis(*plane_mesh(points, cells)).stiffness(lam, mu)


def plane_mesh(points: ArrayLike, cells: ArrayLike) -> tuple[Floats, Integers]:
    """Points (N, 2) and cells as arrays.

    Raises
    ------
    InvalidArgumentError
        They are not of the form that `stiffness` takes.
    """
    nodes = mesh_checks.positions(points, 2)
    return nodes, mesh_checks.elements(cells, "cells", numbers_of_nodes(2), len(nodes))


def triangle_stiffness(corners: ArrayLike, lame: tuple[float, float]) -> Floats:
    """Stiffness (6, 6) of one P1 triangle in closed form, without quadrature: simple data give exact entries.

    Parameters
    ----------
    corners : (3, 2) array_like
        Positions of the corners, in any orientation [length].
    lame : (float, float)
        Lame coefficients l, m [force / length^2].

    Raises
    ------
    InvalidArgumentError
        The triangle has no area, or an argument is not of the stated form.

    Examples
    --------
    >>> from enumsol import fem
    >>> fem.triangle_stiffness([[0, 0], [1, 0], [0, 1]], lame=(1, 1))[0].tolist()
    [2.0, 1.0, -1.5, -0.5, -0.5, -0.5]
    """
    lam, mu = mesh_checks.lame_coefficients(lame, 2)
    nodes = mesh_checks.positions(corners, 2)
    if nodes.shape != (3, 2):
        raise InvalidArgumentError(f"corners has shape {nodes.shape}; expected (3, 2)")
    doubled = float(abs(np.linalg.det(nodes[1:] - nodes[0])))
    if doubled <= FLAT * np.max(np.ptp(nodes, axis=0)) ** 2:
        raise InvalidArgumentError("corners span no area; expected a proper triangle")
    opposite = np.roll(nodes, -2, axis=0) - np.roll(nodes, -1, axis=0)
    # gradients of the shape functions times twice the area, up to a sign that all share
    g = np.stack([-opposite[:, 1], opposite[:, 0]], axis=1)
    K = lam * np.einsum("ai,bj->aibj", g, g) + mu * np.einsum("aj,bi->aibj", g, g)
    K += mu * np.einsum("ab,ij->aibj", g @ g.T, np.eye(2))
    return np.asarray(K.reshape(6, 6) / (2.0 * doubled))


def edge_forces(points: ArrayLike, edges: ArrayLike, traction: ArrayLike) -> Floats:
    """Nodal forces of tractions constant on each edge, (N, 2) [force, per unit thickness].

    Parameters
    ----------
    points : (N, 2) array_like
        Positions of the nodes [length].
    edges : (k, 2) or (k, 3) array_like of int
        The two ends of each loaded edge and, for edges of second order, which may be curved, the node between them.
    traction : (2,) or (k, 2) array_like
        Force per length of edge in x and y, one for all or one for each edge [force / length, per unit thickness].

    Raises
    ------
    InvalidArgumentError
        An argument has the wrong shape, or a node number is out of range.

    Examples
    --------
    >>> from enumsol import fem
    >>> fem.edge_forces([[0, 0], [2, 0]], [[0, 1]], traction=(0, -1)).tolist()
    [[0.0, -1.0], [0.0, -1.0]]
    """
    nodes = mesh_checks.positions(points, 2)
    ends = mesh_checks.elements(edges, "edges", (2, 3), len(nodes))
    density = mesh_checks.vectors_of_all(traction, "traction", (len(ends), 2))
    if ends.shape[1] == 3:
        return gathered(ends, _quadratic_shares(nodes[ends]), density, len(nodes))
    lengths = np.linalg.norm(nodes[ends[:, 1]] - nodes[ends[:, 0]], axis=1)
    return gathered(ends, np.tile(0.5 * lengths[:, None], 2), density, len(nodes))


def _quadratic_shares(corners: Floats) -> Floats:
    """Integrals (k, 3) of the shape functions over quadratic edges with nodes (k, 3, 2), by three Gauss points."""
    shares = np.zeros(corners.shape[:2])
    for place, weight in ((-np.sqrt(0.6), 5 / 9), (0.0, 8 / 9), (np.sqrt(0.6), 5 / 9)):
        shapes = np.array([place * (place - 1) / 2, place * (place + 1) / 2, 1 - place**2])
        along = np.array([place - 0.5, place + 0.5, -2 * place]) @ corners
        shares += weight * np.linalg.norm(along, axis=1)[:, None] * shapes
    return shares


def body_forces(points: ArrayLike, cells: ArrayLike, density: ArrayLike) -> Floats:
    """Nodal forces of a body force constant on each cell, (N, 2) [force, per unit thickness].

    Parameters
    ----------
    points, cells
        The mesh, see `stiffness`.
    density : (2,) or (M, 2) array_like
        Force per area in x and y, one for all or one for each cell [force / length^2, per unit thickness].

    Raises
    ------
    InvalidArgumentError
        An argument has the wrong shape, or a node number is out of range.

    Examples
    --------
    >>> from enumsol import fem
    >>> fem.body_forces([[0, 0], [3, 0], [0, 2]], [[0, 1, 2]], density=(0, -1)).tolist()
    [[0.0, -1.0], [0.0, -1.0], [0.0, -1.0]]
    """
    nodes, bodies = plane_mesh(points, cells)
    values = mesh_checks.vectors_of_all(density, "density", (len(bodies), 2))
    if bodies.shape[1] == 3:
        corners = nodes[bodies]
        third = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 6.0
        return gathered(bodies, np.tile(third[:, None], 3), values, len(nodes))
    return nodal_basis(nodes, bodies).volume_forces(values)


def contact_problem(
    points: ArrayLike,
    cells: ArrayLike,
    lame: tuple[float, float],
    *,
    contact: ArrayLike,
    normals: ArrayLike,
    tangents: ArrayLike | None = None,
    held: ArrayLike = (),
    springs: ArrayLike | None = None,
    forces: ArrayLike | None = None,
    forces_slope: ArrayLike | None = None,
    gap: ArrayLike = 0.0,
    friction: ArrayLike | None = None,
    friction_slope: ArrayLike | None = None,
    slip_offset: ArrayLike = 0.0,
    node_ids: Sequence[Any] | None = None,
) -> ContactProblem:
    """Contact problem of a plane body; the held degrees of freedom are eliminated.

    `mesh_problem` does the same by the names of parts, and finds normals and gaps.

    Parameters
    ----------
    points, cells, lame
        Mesh and Lame coefficients, see `stiffness`.
    contact : (p,) array_like of int
        The contact nodes, in the order of the rows of Bn and Bt. None of them may be held, except in a component across
        the normal, as on a plane of symmetry; such a component stays in the problem, uncoupled and at rest.
    normals : (2,) or (p, 2) array_like
        Directions out of the body at the contact nodes, one for all or one each; scaled to length one.
    tangents : (2,) or (p, 2) array_like or None
        Tangential directions, perpendicular to the normals; default (-n_y, n_x), a quarter turn counterclockwise.
    held : array_like of int, or (N, 2) array of bool
        Nodes held fixed in both components, or a mask of the held components.
    springs : (2,) or (N, 2) array_like or None
        Stiffness of springs from every node to the ground in x and y, at least 0 [force / length]. An elastic
        support where nothing is held.
    forces, forces_slope : (N, 2) array_like or None
        Nodal forces and their derivative with respect to alpha (sums of `edge_forces` and `body_forces`).
    gap, friction, friction_slope, slip_offset
        As in `ContactProblem`.
    node_ids : sequence or None
        Labels of the contact nodes; default their node numbers.

    Returns
    -------
    ContactProblem
        With ``coordinates`` the positions of the contact nodes, and ``mesh``.

    Raises
    ------
    InvalidArgumentError
        An argument has the wrong shape or names a node that does not exist or is held.
    InvalidProblemError
        The body is free to move as a rigid body, or the data of ContactProblem are not admissible.

    Examples
    --------
    >>> from enumsol import fem
    >>> mesh = fem.rectangle(4, 2)
    >>> loads = fem.edge_forces(mesh.points, fem.edges_along(mesh.top), (0.3, -1.0))
    >>> problem = fem.contact_problem(
    ...     mesh.points, mesh.triangles, (1, 1), contact=mesh.bottom[1:], normals=(0, -1), held=mesh.left, forces=loads
    ... )
    >>> problem.n, problem.p
    (24, 4)
    """
    nodes, bodies = plane_mesh(points, cells)
    fixed = mesh_checks.held_mask(held, nodes.shape)
    touching = mesh_checks.node_numbers(contact, "contact", len(nodes))
    if np.any(entirely := np.all(fixed[touching], axis=1)):
        node = int(touching[np.argmax(entirely)])
        raise InvalidArgumentError(f"contact names node {node}, which is held; expected free nodes only")
    body = Body.of_nodes(stiffness(nodes, bodies, lame), fixed, springs, forces, forces_slope)
    normal = mesh_checks.unit_vectors(mesh_checks.vectors_of_all(normals, "normals", (len(touching), 2)), "normals")
    contact_nodes = movable(touching, normal, body.supports)
    problem = problem_of(
        body,
        contact_nodes,
        axes_of(tangents, contact_nodes.normals),
        gap=gap,
        friction=friction,
        friction_slope=friction_slope,
        slip_offset=slip_offset,
        node_ids=[int(node) for node in touching] if node_ids is None else node_ids,
        coordinates=nodes[touching],
        mesh=lambda left: BodyMesh.of_dofs(nodes, bodies, left, lame=lame),
    )
    return cast("ContactProblem", problem)
