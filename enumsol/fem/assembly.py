"""A plane-strain body of P1 triangles on a rigid foundation: stiffness by scikit-fem, loads, and the ContactProblem.

Degrees of freedom before constraints are ``2 node + component``. A problem is put together from plain arrays::

    loads = edge_forces(points, top_edges, (0.3, -1.0))
    problem = contact_problem(
        points, triangles, (1.0, 1.0), held=left, contact=bottom, normals=(0.0, -1.0), forces=loads
    )
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from enumsol.body2d import PlaneMesh
from enumsol.errors import InvalidArgumentError
from enumsol.fem.mesh_checks import (
    check_every_node_is_used,
    elements,
    held_mask,
    lame_coefficients,
    nodal_vectors,
    node_numbers,
    positions,
    spring_stiffnesses,
    unit_vectors,
    vectors_of_all,
)
from enumsol.fem.numbering import by_nodes, gathered
from enumsol.problem import ContactProblem

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray


def stiffness(points: ArrayLike, triangles: ArrayLike, lame: tuple[float, float]) -> sp.csc_array:
    """Stiffness of the unconstrained body in plane strain, (2N, 2N), assembled by scikit-fem.

    Parameters
    ----------
    points : (N, 2) array_like
        Positions of the nodes [length].
    triangles : (M, 3) array_like of int
        Nodes of each triangle, in any orientation.
    lame : (float, float)
        Lame coefficients l, m [force / length^2].

    Returns
    -------
    csc_array of shape (2N, 2N)
        Its kernel holds the rigid motions [force / length, per unit thickness].

    Raises
    ------
    InvalidArgumentError
        The mesh is not valid (shapes, node numbers, a triangle without area) or the coefficients are not admissible.

    Examples
    --------
    >>> from enumsol import fem
    >>> mesh = fem.rectangle(2, 1)
    >>> fem.stiffness(mesh.points, mesh.triangles, lame=(1, 1)).shape
    (12, 12)
    """
    # scikit-fem takes a while to import and is needed for meshes only
    from skfem import Basis, ElementTriP1, ElementVector, MeshTri
    from skfem.models.elasticity import linear_elasticity

    lam, mu = lame_coefficients(lame, 2)
    nodes = positions(points, 2)
    cells = elements(triangles, "triangles", 3, len(nodes))
    _check_areas(nodes, cells)
    check_every_node_is_used(cells, len(nodes), "triangles", "triangle")
    # sorted here, so that scikit-fem neither renumbers nor logs
    mesh = MeshTri(np.ascontiguousarray(nodes.T), np.ascontiguousarray(np.sort(cells, axis=1).T))
    basis = Basis(mesh, ElementVector(ElementTriP1()), intorder=0)
    return by_nodes(linear_elasticity(lam, mu).assemble(basis), basis)


def triangle_stiffness(corners: ArrayLike, lame: tuple[float, float]) -> NDArray[np.float64]:
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
    lam, mu = lame_coefficients(lame, 2)
    nodes, cells = positions(corners, 2), np.array([[0, 1, 2]])
    if nodes.shape != (3, 2):
        raise InvalidArgumentError(f"corners has shape {nodes.shape}; expected (3, 2)")
    _check_areas(nodes, cells)
    opposite = np.roll(nodes, -2, axis=0) - np.roll(nodes, -1, axis=0)
    # gradients of the shape functions times twice the area, up to a sign that all share
    g = np.stack([-opposite[:, 1], opposite[:, 0]], axis=1)
    K = lam * np.einsum("ai,bj->aibj", g, g) + mu * np.einsum("aj,bi->aibj", g, g)
    K += mu * np.einsum("ab,ij->aibj", g @ g.T, np.eye(2))
    return np.asarray(K.reshape(6, 6) / (2.0 * abs(float(_double_areas(nodes, cells)[0]))))


def edge_forces(points: ArrayLike, edges: ArrayLike, traction: ArrayLike) -> NDArray[np.float64]:
    """Nodal forces of tractions constant on each edge, (N, 2) [force, per unit thickness].

    Parameters
    ----------
    points : (N, 2) array_like
        Positions of the nodes [length].
    edges : (k, 2) array_like of int
        The two nodes of each loaded edge.
    traction : (2,) or (k, 2) array_like
        Force per length of edge in x and y, one for all or one for each edge [force / length].

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
    nodes = positions(points, 2)
    ends = elements(edges, "edges", 2, len(nodes))
    density = vectors_of_all(traction, "traction", (len(ends), 2))
    lengths = np.linalg.norm(nodes[ends[:, 1]] - nodes[ends[:, 0]], axis=1)
    return gathered(ends, np.tile(0.5 * lengths[:, None], 2), density, len(nodes))


def body_forces(points: ArrayLike, triangles: ArrayLike, density: ArrayLike) -> NDArray[np.float64]:
    """Nodal forces of a body force constant on each triangle, (N, 2) [force, per unit thickness].

    Parameters
    ----------
    points : (N, 2) array_like
        Positions of the nodes [length].
    triangles : (M, 3) array_like of int
        Nodes of each triangle.
    density : (2,) or (M, 2) array_like
        Force per area in x and y, one for all or one for each triangle [force / length^2].

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
    nodes = positions(points, 2)
    cells = elements(triangles, "triangles", 3, len(nodes))
    values = vectors_of_all(density, "density", (len(cells), 2))
    third = np.abs(_double_areas(nodes, cells)) / 6.0
    return gathered(cells, np.tile(third[:, None], 3), values, len(nodes))


def contact_problem(
    points: ArrayLike,
    triangles: ArrayLike,
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
    friction: float | tuple[ArrayLike, ArrayLike] = (0.0, 1.0),
    slip_offset: ArrayLike = 0.0,
    node_ids: Sequence[Any] | None = None,
) -> ContactProblem:
    """Contact problem of a plane-strain P1 body; the held degrees of freedom are eliminated.

    Parameters
    ----------
    points, triangles, lame
        Mesh and Lame coefficients, see `stiffness`.
    contact : (p,) array_like of int
        The contact nodes, in the order of the rows of Bn and Bt. None of them may be held.
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
    gap, friction, slip_offset
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
    nodes = positions(points, 2)
    free = np.flatnonzero(~held_mask(held, nodes.shape).ravel())
    touching = node_numbers(contact, "contact", len(nodes))
    A = stiffness(nodes, triangles, lame)
    if springs is not None:
        A = sp.csc_array(A + sp.diags_array(spring_stiffnesses(springs, nodes.shape).ravel()))
    normal = unit_vectors(vectors_of_all(normals, "normals", (len(touching), 2)), "normals")
    tangent = _tangents(tangents, normal)
    return ContactProblem(
        sp.csc_array(A[free][:, free]),
        _contact_rows(touching, normal, free, len(nodes)),
        _contact_rows(touching, tangent, free, len(nodes)),
        nodal_vectors(forces, "forces", nodes.shape)[free],
        gap=gap,
        friction=friction,
        load_slope=None if forces_slope is None else nodal_vectors(forces_slope, "forces_slope", nodes.shape)[free],
        slip_offset=slip_offset,
        node_ids=[int(node) for node in touching] if node_ids is None else node_ids,
        coordinates=nodes[touching],
        mesh=PlaneMesh.of_dofs(nodes, triangles, free),
    )


def _contact_rows(
    contact: NDArray[np.int64], direction: NDArray[np.float64], free: NDArray[np.int64], count: int
) -> sp.csr_array:
    p = len(contact)
    column = np.full(2 * count, -1, dtype=np.int64)
    column[free] = np.arange(len(free))
    where = column[np.stack([2 * contact, 2 * contact + 1], axis=1)]
    if np.any(where < 0):
        node = int(contact[np.argmax(np.any(where < 0, axis=1))])
        raise InvalidArgumentError(f"contact names node {node}, which is held; expected free nodes only")
    rows = np.repeat(np.arange(p), 2)
    return sp.csr_array((direction.ravel(), (rows, where.ravel())), shape=(p, len(free)))


def _tangents(tangents: ArrayLike | None, normal: NDArray[np.float64]) -> NDArray[np.float64]:
    if tangents is None:
        return np.stack([-normal[:, 1], normal[:, 0]], axis=1)
    tangent = unit_vectors(vectors_of_all(tangents, "tangents", normal.shape), "tangents")
    skew = np.abs(np.sum(tangent * normal, axis=1))
    if np.any(skew > 1e-12):  # of unit vectors, the cosine of the angle between them, up to rounding
        k = int(np.argmax(skew))
        raise InvalidArgumentError(f"tangents row {k} is not perpendicular to normals row {k}; expected right angles")
    return tangent


def _double_areas(nodes: NDArray[np.float64], cells: NDArray[np.int64]) -> NDArray[np.float64]:
    first, second = nodes[cells[:, 1]] - nodes[cells[:, 0]], nodes[cells[:, 2]] - nodes[cells[:, 0]]
    return np.asarray(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])


def _check_areas(nodes: NDArray[np.float64], cells: NDArray[np.int64]) -> None:
    areas = np.abs(_double_areas(nodes, cells))
    corners = nodes[cells]
    sides = np.max(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2), axis=1)
    flat = areas <= 1e-14 * sides**2  # relative to the longest side: no area beyond rounding
    if np.any(flat):
        k = int(np.argmax(flat))
        raise InvalidArgumentError(f"triangles row {k} has no area; expected proper triangles")
