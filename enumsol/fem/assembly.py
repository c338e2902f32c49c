"""A plane body on a rigid foundation: stiffness, loads, and the ContactProblem.

Cells are triangles or quadrilaterals of first or second order, with 3, 6, 4, 8 or 9 nodes in the order of VTK, or both
as in `PartedMesh`. Degrees of freedom before constraints are ``2 node + component``. A problem is put together from
plain arrays::

    loads = edge_forces(points, top_edges, (0.3, -1.0))
    problem = contact_problem(
        points, triangles, (1.0, 1.0), held=left, contact=bottom, normals=(0.0, -1.0), forces=loads
    )
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import scipy.sparse as sp

from enumsol.errors import InvalidArgumentError
from enumsol.fem import meshes
from enumsol.fem.bases import FLAT, between_corners, facet_basis, isotropic, nodal_basis
from enumsol.fem.meshes import ROUNDING, SAME, unit_vectors, vectors_of_all
from enumsol.fem.restrained import Body, Supports, axes_of, gathered, movable, problem_of
from enumsol.model.cells import numbers_of_nodes
from enumsol.model.mesh import BodyMesh
from enumsol.support.arguments import shown
from enumsol.support.array_arguments import array_of, plain_array, real_matrix

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import scipy.sparse as sp
    from skfem import CellBasis, DiscreteField, Mesh
    from skfem.assembly.dofs import DofsView
    from skfem.assembly.form.form import FormExtraParams

    from enumsol.fem.restrained import Tangents
    from enumsol.model.problem import ContactProblem
    from enumsol.model.problem3d import AnyProblem
    from enumsol.support.array_types import ArrayLike, Floats, Integers, Mask

    Field = ArrayLike | Callable[[Floats], ArrayLike]


def stiffness(points: ArrayLike, cells: ArrayLike, lame: tuple[float, float]) -> sp.csc_array:
    """Stiffness of the unconstrained body in plane strain, (2N, 2N).

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
    lam, mu = meshes.lame_coefficients(lame, 2)
    return nodal_basis(*plane_mesh(points, cells)).stiffness(isotropic(np.array([lam, mu]), 3))


def plane_mesh(points: ArrayLike, cells: ArrayLike) -> tuple[Floats, Integers]:
    """Points (N, 2) and cells as arrays.

    Raises
    ------
    InvalidArgumentError
        They are not of the form that `stiffness` takes.
    """
    nodes = meshes.positions(points, 2)
    return nodes, meshes.elements(cells, "cells", numbers_of_nodes(2), len(nodes))


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
    lam, mu = meshes.lame_coefficients(lame, 2)
    nodes = meshes.positions(corners, 2)
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
    nodes = meshes.positions(points, 2)
    ends = meshes.elements(edges, "edges", (2, 3), len(nodes))
    density = meshes.vectors_of_all(traction, "traction", (len(ends), 2))
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
    values = meshes.vectors_of_all(density, "density", (len(bodies), 2))
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
    fixed = meshes.held_mask(held, nodes.shape)
    touching = meshes.node_numbers(contact, "contact", len(nodes))
    if np.any(entirely := np.all(fixed[touching], axis=1)):
        node = int(touching[np.argmax(entirely)])
        raise InvalidArgumentError(f"contact names node {node}, which is held; expected free nodes only")
    body = Body.of_nodes(stiffness(nodes, bodies, lame), fixed, springs, forces, forces_slope)
    normal = meshes.unit_vectors(meshes.vectors_of_all(normals, "normals", (len(touching), 2)), "normals")
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
        mesh=lambda motion, _: BodyMesh(nodes, bodies, motion, lame=lame),
    )
    return cast("ContactProblem", problem)


def basis_contact_problem(
    basis: CellBasis,
    stiffness: ArrayLike | sp.sparray | sp.spmatrix,
    *,
    contact: str | ArrayLike | Callable[[Floats], ArrayLike],
    held: ArrayLike | DofsView = (),
    displacements: ArrayLike | None = None,
    normals: Field | None = None,
    tangents: Tangents = None,
    forces: ArrayLike | None = None,
    forces_slope: ArrayLike | None = None,
    gap: ArrayLike | Callable[[Floats], float] = 0.0,
    **more: Any,
) -> AnyProblem:
    """Contact problem of a body that scikit-fem assembled, in 2D or 3D; the held degrees of freedom are eliminated.

    ``u`` of the problem and of its roots holds the degrees of freedom of the basis that are not held, in their order.
    The contact nodes are all nodes of the contact facets that are not held, corners first, then those on edges; of
    tetrahedra of second order those on edges only, as in `mesh_problem`.

    Parameters
    ----------
    basis : skfem.CellBasis
        A basis of vectors at nodes, such as ``Basis(mesh, ElementVector(ElementTriP2()))``, with m degrees of freedom.
    stiffness : (m, m) array_like or sparse
        Of the body before its supports, with springs if there are any [force / length].
    contact : name, array of facet numbers, or callable
        The contact boundary, as scikit-fem's ``mesh.normalize_facets`` takes it.
    held : array of int or bool, or skfem.DofsView
        Numbers of degrees of freedom with given displacements, a mask of them, or what ``basis.get_dofs`` returns.
    displacements : (m,) array_like or None
        Displacements of the held degrees of freedom, other entries are not read; default 0 [length].
    normals : (d,) or (p, d) array_like, callable of a position, or None
        Directions out of the body, scaled to length one; default the outward normals of the facets around, averaged
        with the node's shape function as weight.
    tangents : array_like or None
        In 2D as in `contact_problem`; in 3D a pair of (3,) or (p, 3) arrays, by default as in `solid_contact_problem`.
    forces, forces_slope : (m,) array_like or None
        Load vector and its derivative with respect to alpha [force].
    gap : float, (p,) array_like, or callable of a position
        Initial gap along the normals [length].
    **more
        friction, friction_slope, slip_offset, node_ids and, in 3D, areas, as in `ContactProblem` and
        `ContactProblem3D`.

    Returns
    -------
    ContactProblem or ContactProblem3D
        With ``coordinates`` the positions of the contact nodes.

    Raises
    ------
    InvalidArgumentError
        An argument has the wrong shape; the basis has no vectors at nodes; facets are not on the boundary; a contact
        node is held in some components only; a uniform pressure would pull at a contact node or not act on it, as at
        the corners of ElementHexS2.
    InvalidProblemError
        The body is free to move as a rigid body, or the data are not admissible.

    Examples
    --------
    >>> from skfem import Basis, ElementTriP2, ElementVector, MeshTri
    >>> from skfem.models.elasticity import linear_elasticity
    >>> from enumsol import fem
    >>> mesh = MeshTri().refined(2).with_defaults()
    >>> basis = Basis(mesh, ElementVector(ElementTriP2()))
    >>> problem = fem.basis_contact_problem(
    ...     basis, linear_elasticity(1, 1).assemble(basis), contact="bottom", held=basis.get_dofs("left"), friction=0.5
    ... )
    >>> problem.n, problem.p
    (144, 8)
    """
    dofs, places = _nodes_of(basis)
    A = real_matrix(stiffness, "stiffness", error=InvalidArgumentError)
    if A.shape != (dofs.size, dofs.size):
        raise InvalidArgumentError(
            f"stiffness has shape {A.shape}; expected {(dofs.size, dofs.size)}, as the basis has"
        )
    fixed = _held(held, dofs.size)
    moved = np.where(fixed, _vector(displacements, "displacements", dofs.size), 0.0)
    supports = replace(Supports.none(dofs.shape), fixed=fixed[dofs], values=moved[dofs])
    facets = _facets(basis.mesh, contact)
    touching = _touching(basis, facets, dofs)
    _check_pressed(basis, facets, dofs, touching)
    nodes = movable(touching, _normals(basis, facets, touching, dofs, places, normals), supports)
    at = places[nodes.nodes]
    more = {"gap": [gap(place) for place in at] if callable(gap) else gap, "coordinates": at, **more}
    more.setdefault("node_ids", nodes.nodes.tolist())
    slope = None if forces_slope is None else _vector(forces_slope, "forces_slope", dofs.size)
    body = Body(A, _vector(forces, "forces", dofs.size), slope, supports, dofs)
    return problem_of(body, nodes, axes_of(tangents, nodes.normals), **more)


def _nodes_of(basis: CellBasis) -> tuple[Integers, Floats]:
    """Degrees of freedom of every node (N, d), and the positions of the nodes (N, d)."""
    try:
        dimension = int(basis.mesh.dim())
        blocks = (basis.nodal_dofs, basis.facet_dofs, basis.edge_dofs, basis.interior_dofs)
        parts = [np.asarray(block).T.reshape(-1, dimension) for block in blocks if np.size(block)]
        dofs = np.concatenate(parts).astype(np.int64)
        where = np.asarray(basis.doflocs)[:, dofs]  # (d, N, components)
        apart = np.max(np.abs(where - where[:, :, :1]))
        vectors = (
            dofs.size == basis.N and dimension in (2, 3) and apart <= SAME * np.max(np.ptp(where[:, :, 0], axis=1))
        )
    except (AttributeError, TypeError, ValueError, IndexError):
        vectors = False
    if not vectors:
        raise InvalidArgumentError(
            f"basis is a {type(basis).__name__} whose degrees of freedom are not vectors at nodes; "
            "expected skfem.Basis(mesh, ElementVector(...)) in 2D or 3D"
        )
    return dofs, np.ascontiguousarray(where[:, :, 0].T)


def _held(held: ArrayLike | DofsView, count: int) -> Mask:
    from skfem.assembly.dofs import DofsView  # as below

    numbers = held.flatten() if isinstance(held, DofsView) else held
    array = plain_array(numbers, "held", error=InvalidArgumentError)
    mask = np.zeros(count, dtype=bool)
    if array.size == 0:
        return mask
    if array.dtype == bool and array.shape == (count,):
        return array
    if array.dtype.kind not in "iu" or array.ndim != 1 or array.min() < 0 or array.max() >= count:
        raise InvalidArgumentError(
            f"held has shape {array.shape} and type {array.dtype}; expected numbers of degrees of freedom, "
            f"below {count}, or a mask of them"
        )
    mask[array] = True
    return mask


def _facets(mesh: Mesh, contact: object) -> Integers:
    try:
        facets = np.unique(np.asarray(mesh.normalize_facets(contact)))
        known = facets.dtype.kind in "iu" and facets.size > 0 and 0 <= facets[0] <= facets[-1] < mesh.nfacets
    except (AttributeError, KeyError, TypeError, ValueError, IndexError, NotImplementedError):
        known = False
    if not known:
        names = ", ".join(mesh.boundaries or ()) or "none"
        raise InvalidArgumentError(
            f"contact is {shown(contact)}; expected facets as scikit-fem takes them: numbers, a function of "
            f"positions or the name of a boundary (found {names})"
        )
    if np.any(mesh.f2t[1, facets] != -1):
        raise InvalidArgumentError("contact has facets inside the body; expected facets on its boundary")
    return facets.astype(np.int64)


def _touching(basis: CellBasis, facets: Integers, dofs: Integers) -> Integers:
    """Nodes of facets that can be in contact."""
    on_facets = np.zeros(dofs.size, dtype=bool)
    on_facets[basis.get_dofs(facets).flatten()] = True
    if between_corners(basis.elem):
        on_facets[np.asarray(basis.nodal_dofs)] = False
    return np.flatnonzero(np.all(on_facets[dofs], axis=1))


def _check_pressed(basis: CellBasis, facets: Integers, dofs: Integers, touching: Integers) -> None:
    """Refuse nodes that a uniform pressure pulls at, or does not act on."""
    shares = integrals_over(basis, facets, lambda v, _: v[0])[dofs[touching, 0]]
    if np.min(shares) <= ROUNDING * np.max(shares):
        raise InvalidArgumentError(
            f"a uniform pressure pulls at contact node {touching[np.argmin(shares)]} or does not act on it (as at the "
            "corners of ElementHexS2); expected elements whose facets it presses on at every node"
        )


def _normals(
    basis: CellBasis, facets: Integers, touching: Integers, dofs: Integers, places: Floats, given: Field | None
) -> Floats:
    if given is not None:
        values = [given(place) for place in places[touching]] if callable(given) else given
        return unit_vectors(vectors_of_all(values, "normals", (len(touching), dofs.shape[1])), "normals")
    integrals = integrals_over(basis, facets, outward_normal)[dofs[touching]]
    return unit_vectors(pressed(integrals, touching), "normals of the boundary")


def integrals_over(basis: CellBasis, facets: Integers, form: Callable[[Any, Any], Any]) -> Floats:
    """Integrals over facets of a linear form, by degrees of freedom; lumped as in `NodalBasis.on_part`."""
    from skfem import LinearForm  # here, too

    return np.asarray(LinearForm(form).assemble(facet_basis(basis, facets, lumped=True)))


def outward_normal(v: DiscreteField, w: FormExtraParams) -> Any:
    """The linear form whose values at a node are the integral of the outward normal times its shape function."""
    from skfem.helpers import dot  # as above

    return dot(w.n, v)


def pressed(vectors: Floats, nodes: Integers) -> Floats:
    """Nodal normals (p, d), which must not vanish."""
    lengths = np.linalg.norm(vectors, axis=1)
    if np.min(lengths) <= ROUNDING * np.max(lengths):
        raise InvalidArgumentError(
            f"the normals around contact node {nodes[np.argmin(lengths)]} cancel; expected normals, or parts of the "
            "boundary without a fold"
        )
    return vectors


def _vector(value: object, name: str, size: int) -> Floats:
    return np.zeros(size) if value is None else array_of(value, name, (size,), f"({size},), as the basis has")
