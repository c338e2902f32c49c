"""From a mesh of a body in 3D to its contact problem (theory, section 11.6).

Bodies of P1 tetrahedra or Q1 hexahedra: their stiffness, body forces and tractions; the contact surface,
where multipliers live, local axes and the return operator r_h. Degrees of freedom before constraints are
``3 node + component``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, cast

import numpy as np
import scipy.sparse as sp

from enumsol.errors import InvalidArgumentError, InvalidProblemError
from enumsol.fem import meshes, restrained
from enumsol.fem.bases import FLAT, isotropic, nodal_basis
from enumsol.fem.meshes import blocks
from enumsol.model.cells import KINDS, boundary_facets, by_kind, facet_rows
from enumsol.model.mesh import BodyMesh
from enumsol.model.problem3d import ContactProblem3D, SlipMean
from enumsol.support.arguments import one_of, positive_integer
from enumsol.support.array_arguments import plain_array, real_array

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from enumsol.support.array_types import ArrayLike, Floats, Integers, Mask

    Field = ArrayLike | Callable[[Floats], ArrayLike]

#: How far axes may be from right angles and length one, for rounding.
AXES_TOLERANCE = 1e-10
_GAUSS_3 = (0.5 - np.sqrt(0.15), 0.5, 0.5 + np.sqrt(0.15)), (5 / 18, 8 / 18, 5 / 18)


def solid_mesh(
    points: ArrayLike, cells: ArrayLike, kinds: tuple[int, ...] = (4, 8), labels: Integers | None = None
) -> tuple[Floats, Integers]:
    """Points (N, 3) and cells (M, k) of positive volume, k among ``kinds``; they may come in any orientation.

    ``labels`` (M,) are the numbers by which messages name cells; by default their rows. What the nodes of second order
    (10 or 27 in all) do to a cell is checked by `nodal_basis`.

    Raises
    ------
    InvalidArgumentError
        The mesh is not valid: shapes, node numbers, a node in no cell, a cell that is flat or inside out.
    """
    nodes = meshes.positions(points, 3)
    bodies = meshes.elements(cells, "cells", kinds, len(nodes))
    for rows, own in by_kind(3, bodies):
        kind, first = KINDS[3, own.shape[1]], KINDS[3, KINDS[3, own.shape[1]].corners]
        corners = nodes[own[:, : kind.corners]]
        size = np.max(np.ptp(corners, axis=1), axis=1) ** 3
        slopes = first.slopes(first.places[: 1 if kind.corners == 4 else None])
        # of the parallelepipeds that the three edges at each corner span
        volumes = np.linalg.det(np.einsum("mai,akq->mqik", corners, slopes))
        ordered = np.sort(own, axis=1)
        _refuse(
            np.any(ordered[:, 1:] == ordered[:, :-1], axis=1),
            "names a node twice, as one that is collapsed to a pyramid does; expected distinct nodes, or one that is "
            "collapsed to a wedge or a tetrahedron",
            rows,
            labels,
        )
        turned = np.all(volumes < 0, axis=1)
        own[turned] = own[turned][:, kind.turned]
        bodies[rows, : own.shape[1]], bodies[rows, own.shape[1] :] = own, own[:, -1:]
        volumes[turned] *= -1
        _refuse(np.max(np.abs(volumes), axis=1) <= FLAT * size, "has no volume; expected proper cells", rows, labels)
        _refuse(
            np.min(volumes, axis=1) <= FLAT * size,
            "is turned inside out at a corner; expected corners in the order of VTK",
            rows,
            labels,
        )
    meshes.check_every_node_is_used(bodies, len(nodes), "cells", "cell")
    return nodes, bodies


def _refuse(wrong: Mask, found: str, rows: Integers, labels: Integers | None) -> None:
    if np.any(wrong):
        raise InvalidArgumentError(f"{meshes.cell_name(int(rows[np.argmax(wrong)]), labels)} {found}")


def outward(facets: Integers, cells: Integers) -> Integers:
    """Facets with their corners in the body's order: counterclockwise as seen from outside.

    Raises
    ------
    InvalidArgumentError
        One is not a facet on the boundary of the body, or comes twice; they have another number of corners.
    """
    outer = boundary_facets(3, cells)
    rows = facet_rows(3, facets, outer)
    meshes.check_facets(rows, facets, "contact")
    return outer[rows]


def facet_vectors(nodes: Floats, facets: Integers) -> Floats:
    """Normals of facets times their areas (of the projection for quadrilaterals that are not plane), (k, 3)."""
    corners = nodes[facets]
    if facets.shape[1] == 3:
        return np.asarray(0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    return np.asarray(0.5 * np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]))


def facet_quadrature(nodes: Floats, facets: Integers) -> tuple[Floats, Floats]:
    """Quadrature of degree 2 on triangles, 5 in each direction on quadrilaterals.

    Returns
    -------
    values : (q, 3) or (q, 4) array
        Shape functions of the corners at the q points of a facet [-].
    weights : (k, q) array
        Weights of the points of each facet, which add up to its area [length^2].
    """
    if facets.shape[1] == 3:
        values = np.full((3, 3), 1.0 / 6.0) + 0.5 * np.eye(3)
        areas = np.linalg.norm(facet_vectors(nodes, facets), axis=1)
        return values, np.tile(areas[:, None] / 3.0, (1, 3))
    corners, (points, gauss) = nodes[facets], _GAUSS_3
    shapes, weights = [], []
    for i, j in np.ndindex(3, 3):
        x, y = points[i], points[j]
        along_x = np.array([-(1 - y), 1 - y, y, -y]) @ corners
        along_y = np.array([-(1 - x), -x, x, 1 - x]) @ corners
        shapes.append([(1 - x) * (1 - y), x * (1 - y), x * y, (1 - x) * y])
        weights.append(gauss[i] * gauss[j] * np.linalg.norm(np.cross(along_x, along_y), axis=1))
    return np.array(shapes), np.stack(weights, axis=1)


@dataclass(frozen=True)
class ContactSurface:
    """Facets on the boundary of a body, with quadrature.

    Attributes
    ----------
    points : (N, 3) array
    facets : (k, 3) or (k, 4) int array
        Counterclockwise as seen from outside.
    """

    points: Floats
    facets: Integers

    @cached_property
    def nodes(self) -> Integers:
        """The m nodes of the facets, in order."""
        return np.unique(self.facets)

    @cached_property
    def quadrature(self) -> tuple[Floats, Floats]:
        """Shape functions (q, corners) at the points of every facet, and their weights (k, q)."""
        return facet_quadrature(self.points, self.facets)

    @cached_property
    def shares(self) -> Floats:
        """Integral of each corner's shape function over each facet, (k, corners) [length^2]."""
        values, weights = self.quadrature
        return weights @ values

    @property
    def areas(self) -> Floats:
        """Areas of the facets, (k,) [length^2]."""
        return np.asarray(self.shares.sum(axis=1))

    @cached_property
    def vectors(self) -> Floats:
        """Outward normals of the facets times their areas, (k, 3) [length^2]."""
        return facet_vectors(self.points, self.facets)

    def interpolation(self) -> sp.csr_array:
        """Values at all k q quadrature points, facet by facet, of a function given on all nodes: (k q, N)."""
        values, weights = self.quadrature
        count, each = weights.size, weights.shape[1]
        columns = np.repeat(self.facets, each, axis=0)
        rows = np.repeat(np.arange(count), self.facets.shape[1])
        data = np.tile(values, (len(self.facets), 1))
        return sp.csr_array((data.ravel(), (rows, columns.ravel())), shape=(count, len(self.points)))

    def return_operator(self) -> sp.csr_array:
        """r_h (paper, (3.4), (3.5)): values at the m nodes from those at the k q quadrature points, (m, k q).

        The value at a node is the mean over the facets that share it: nonnegative weights that add up to one.
        """
        _, weights = self.quadrature
        local = np.searchsorted(self.nodes, self.facets)
        rows = np.repeat(local, weights.shape[1], axis=1)
        places = np.arange(weights.size).reshape(weights.shape)
        columns = np.tile(places, (1, self.facets.shape[1]))
        data = np.tile(weights, (1, self.facets.shape[1]))
        sums = sp.csr_array((data.ravel(), (rows.ravel(), columns.ravel())), shape=(len(self.nodes), weights.size))
        return sp.csr_array(sp.diags_array(1.0 / np.asarray(sums.sum(axis=1)).ravel()) @ sums)


@dataclass(frozen=True)
class SurfaceRows:
    """The p contact rows: the displacement that each stands for, and its position.

    Attributes
    ----------
    means : (p, N) csr_array
        Displacement of each row as a weighted mean of nodal ones.
    areas : (p,) array
        Area that each row stands for [length^2].
    places : (p, 3) array
        Contact nodes, or centroids of patches [length].
    vectors : (p, 3) array
        Outward normals times areas, summed over the facets of each row [length^2].
    labels : list
        Node numbers, or labels of patches.
    rows_of_facets : (k,) int array or None
        Row of each facet's patch, -1 where it is held; None for multipliers on nodes.
    """

    means: sp.csr_array
    areas: Floats
    places: Floats
    vectors: Floats
    labels: list[int]
    rows_of_facets: Integers | None = None


def on_nodes(surface: ContactSurface, held: Mask) -> SurfaceRows:
    """A row for every node of the surface that is not held entirely (L^H = W^h).

    Raises
    ------
    InvalidArgumentError
        A node is held in some components only, or all are held.
    """
    nodes = surface.nodes
    partly = np.any(held[nodes], axis=1) & ~np.all(held[nodes], axis=1)
    if np.any(partly):
        raise InvalidArgumentError(
            f"contact node {nodes[np.argmax(partly)]} is held in some components only, which makes its rows dependent; "
            "expected contact nodes that are free or held entirely (springs can stand in for a support)"
        )
    free = nodes[~np.all(held[nodes], axis=1)]
    if not len(free):
        raise InvalidArgumentError("contact has held nodes only; expected free ones")
    facets, shares, count = surface.facets, surface.shares, len(surface.points)
    areas = restrained.gathered(facets, shares, np.ones((len(facets), 1)), count)[free, 0]
    vectors = restrained.gathered(facets, np.ones_like(shares), surface.vectors, count)[free]
    return SurfaceRows(restrained.means_of_nodes(free, count), areas, surface.points[free], vectors, free.tolist())


def on_patches(surface: ContactSurface, patches: ArrayLike, held: Mask) -> SurfaceRows:
    """A row for every patch of facets that is not held entirely: its mean displacement.

    Raises
    ------
    InvalidArgumentError
        ``patches`` are not (k,) integers, or all are held.
    InvalidProblemError
        The rows are dependent: the condition (paper, (3.1)) fails.
    """
    labels = plain_array(patches, "patches", error=InvalidArgumentError)
    if labels.shape != (len(surface.facets),) or labels.dtype.kind not in "iu":
        raise InvalidArgumentError(
            f"patches has shape {labels.shape} and type {labels.dtype}; expected ({len(surface.facets)},) integers, "
            "a label for every facet"
        )
    names, of_facet = np.unique(labels, return_inverse=True)
    rows = np.repeat(of_facet, surface.facets.shape[1])
    shape = (len(names), len(surface.points))
    sums = sp.csr_array((surface.shares.ravel(), (rows, surface.facets.ravel())), shape=shape)
    free_nodes = ~np.all(held, axis=1)
    kept = np.flatnonzero(np.asarray((sums @ sp.diags_array(free_nodes.astype(np.float64))).sum(axis=1)) > 0)
    if not len(kept):
        raise InvalidArgumentError("contact has held nodes only; expected free ones")
    areas = np.bincount(of_facet, surface.areas).astype(np.float64)
    means = sp.csr_array((sp.diags_array(1.0 / areas) @ sums)[kept])
    _check_independent(means[:, np.intersect1d(surface.nodes, np.flatnonzero(free_nodes))])
    vectors = np.zeros((len(names), 3))
    np.add.at(vectors, of_facet, surface.vectors)
    row_of_patch = np.full(len(names), -1)
    row_of_patch[kept] = np.arange(len(kept))
    return SurfaceRows(
        means, areas[kept], means @ surface.points, vectors[kept], names[kept].tolist(), row_of_patch[of_facet]
    )


def _check_independent(means: sp.csr_array) -> None:
    """The condition (paper, (3.1)) for means over patches, by free contact nodes."""
    patches, nodes = means.shape
    unit = sp.csr_array(sp.diags_array(1.0 / np.sqrt(np.asarray(means.multiply(means).sum(axis=1)).ravel())) @ means)
    dependent = patches > nodes
    if not dependent:
        values = np.linalg.eigvalsh((unit @ unit.T).toarray())
        # the Gram matrix squares the singular values: near its rounding decide by those themselves
        dependent = values[0] <= 1e-7 * values[-1] and np.linalg.matrix_rank(unit.toarray()) < patches
    if dependent:
        raise InvalidProblemError(
            f"multipliers on {patches} patches with {nodes} free contact nodes violate condition (3.1) of the paper: "
            "the mean displacements of the patches are dependent; expected fewer and larger patches (a larger ratio)"
        )


def local_axes(multipliers: SurfaceRows, normals: ArrayLike | None, axes: object) -> tuple[Floats, Floats, Floats]:
    """Normals and axes t1, t2 of the rows, each (p, 3); (t1, t2, n) is right-handed where t2 is not given.

    Parameters
    ----------
    multipliers : SurfaceRows
    normals : (3,) or (p, 3) array_like or None
        Scaled to length one; None: the outward normals of the facets around, averaged by area.
    axes : field, pair (t1, t2) of fields, or None
        A field is (3,), (p, 3) or a callable of a position. None: the x axis projected on the tangent plane, or the y
        axis where the normal is nearer than 26 degrees to the x axis.

    Raises
    ------
    InvalidArgumentError
        A normal is zero or points into the body, or the axes are not orthonormal.
    """
    shape = multipliers.places.shape
    if normals is None:
        normal = meshes.unit_vectors(multipliers.vectors, "normals of the contact surface")
    else:
        normal = meshes.unit_vectors(meshes.vectors_of_all(normals, "normals", shape), "normals")
        inward = np.sum(normal * multipliers.vectors, axis=1) <= 0
        if np.any(inward):
            k = int(np.argmax(inward))
            raise InvalidArgumentError(f"normals row {k} does not point out of the body; expected outward normals")
    if axes is None:
        return normal, *restrained.default_axes(normal)
    both = axes if isinstance(axes, tuple) and len(axes) == 2 else (axes,)
    given = [_field(field, multipliers.places) for field in both]
    triples = [normal, *given]
    for i, one in enumerate(triples):
        for j, two in enumerate(triples[: i + 1]):
            with np.errstate(over="ignore", invalid="ignore"):
                off = np.abs(np.sum(one * two, axis=1) - (i == j))
            if not np.all(off <= AXES_TOLERANCE):
                raise _not_orthonormal(i, j, int(np.argmax(off)), one, two)
    return normal, given[0], given[1] if len(given) == 2 else np.cross(normal, given[0])


def _field(value: object, places: Floats) -> Floats:
    if callable(value):
        value = [value(place) for place in places]
    return meshes.vectors_of_all(real_array(value, "axes", error=InvalidArgumentError), "axes", places.shape)


def _not_orthonormal(i: int, j: int, row: int, one: Floats, two: Floats) -> InvalidArgumentError:
    names = ("the normal", "t1", "t2")
    one, two = np.clip(one, -1e150, 1e150), np.clip(two, -1e150, 1e150)  # squares do not overflow
    found = (
        f"{names[i]} has length {np.linalg.norm(one[row]):.6g}"
        if i == j
        else f"the cosine between {names[i]} and {names[j]} is {float(one[row] @ two[row]):.3g}"
    )
    return InvalidArgumentError(
        f"axes are not orthonormal at contact row {row}: {found}; "
        "expected t1 (and t2, if given) of length one, perpendicular to the normal and to each other"
    )


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
    lam, mu = meshes.lame_coefficients(lame, 3)
    return nodal_basis(*solid_mesh(points, cells)).stiffness(isotropic(np.array([lam, mu]), 6))


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
    values = meshes.vectors_of_all(density, "density", (len(bodies), 3))
    return nodal_basis(nodes, bodies).volume_forces(values)


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
    nodes = meshes.positions(points, 3)
    surface = meshes.elements(facets, "facets", (3, 4), len(nodes))
    density = meshes.vectors_of_all(traction, "traction", (len(surface), 3))
    values, weights = facet_quadrature(nodes, surface)
    return restrained.gathered(surface, weights @ values, density, len(nodes))


def solid_contact_problem(
    points: ArrayLike,
    cells: ArrayLike,
    lame: tuple[float, float],
    *,
    contact: ArrayLike,
    normals: ArrayLike | None = None,
    axes: object = None,
    held: ArrayLike = (),
    springs: ArrayLike | None = None,
    forces: ArrayLike | None = None,
    forces_slope: ArrayLike | None = None,
    gap: ArrayLike = 0.0,
    friction: object = 0.5,
    friction_slope: object = 0.0,
    slip_offset: ArrayLike = 0.0,
    node_ids: Sequence[Any] | None = None,
    multipliers: Literal["nodes", "elements"] = "nodes",
    ratio: int = 1,
    patches: ArrayLike | None = None,
) -> ContactProblem3D:
    """Contact problem of a body of P1 tetrahedra or Q1 hexahedra; the held degrees of freedom are eliminated.

    Contact rows come in the order of node numbers or of the labels of patches; nodes and patches that are held
    entirely have none.

    Parameters
    ----------
    points, cells, lame
        Mesh and Lame coefficients, see `solid_stiffness`.
    contact : (k, 3) or (k, 4) array_like of int
        Facets of the contact surface, on the boundary of the body.
    normals : (3,) or (p, 3) array_like or None
        Directions out of the body at the contact rows, scaled to length one; default the outward normals of the facets
        around, averaged by area.
    axes : field, pair (t1, t2) of fields, or None
        Principal axis t1 of the friction: (3,), (p, 3), or a callable of a position (3,) that returns (3,). Of length
        one and perpendicular to the normal; t2 = n x t1, unless a tuple of two fields is given. Default: the x axis
        projected on the tangent plane, or the y axis where the normal is nearer than 26 degrees to the x axis.
    held : array_like of int, or (N, 3) array of bool
        Nodes held fixed in all components, or a mask of the held components.
    springs : (3,) or (N, 3) array_like or None
        Stiffness of springs from every node to the ground in x, y and z, at least 0 [force / length].
    forces, forces_slope : (N, 3) array_like or None
        Nodal forces and their derivative with respect to alpha (sums of `facet_forces` and `solid_body_forces`).
    gap, friction, friction_slope, slip_offset
        As in `ContactProblem3D`, by contact rows.
    node_ids : sequence or None
        Labels of the contact rows; default the node numbers or the labels of the patches.
    multipliers : {"nodes", "elements"}
        Forces on the contact nodes, or resultant forces on patches of facets: piecewise constant multipliers on a
        coarser mesh. A row then is the mean displacement of a patch, with constant normal and axes, and coefficients
        that depend on the slip take its mean by the return operator r_h.
    ratio : int
        For elements on a rectangular grid of facets: patches of ratio by ratio cells (H/h), see `blocks`.
    patches : (k,) array_like of int or None
        For elements on any surface: the label of each facet's patch.

    Returns
    -------
    ContactProblem3D
        With ``coordinates`` (contact nodes, or centroids of patches), ``areas`` and ``mesh``; for elements with
        ``slip_mean``.

    Raises
    ------
    InvalidArgumentError
        An argument has the wrong shape; a contact facet is not on the boundary; the axes are not orthonormal; a contact
        node is held in some components only.
    InvalidProblemError
        The multipliers violate (paper, (3.1)), the body is free to move as a rigid body, or the data of
        ContactProblem3D are not admissible.

    Examples
    --------
    >>> from enumsol import fem
    >>> mesh = fem.box(4, 4, 2)
    >>> loads = fem.facet_forces(mesh.points, mesh.facets["top"], (0.3, 0.1, -1.0))
    >>> problem = fem.solid_contact_problem(
    ...     mesh.points, mesh.cells, (1, 1), contact=mesh.facets["bottom"], held=mesh.nodes("left"), forces=loads,
    ...     friction=(0.5, 0.3), multipliers="elements", ratio=2,
    ... )
    >>> problem.n, problem.p
    (180, 4)
    """
    nodes, bodies = solid_mesh(points, cells)
    surface = ContactSurface(nodes, outward(_contact_facets(contact, len(nodes)), bodies))
    mask = meshes.held_mask(held, nodes.shape)
    rows = _rows(surface, mask, one_of(multipliers, "multipliers", ("nodes", "elements")), ratio, patches)
    normal, first, second = local_axes(rows, normals, axes)
    body = restrained.Body.of_nodes(solid_stiffness(nodes, bodies, lame), mask, springs, forces, forces_slope)
    dofs, free = restrained.plain_dofs(nodes.shape), np.flatnonzero(~mask.ravel())
    of_facets, mean = rows.rows_of_facets, None
    if of_facets is not None:
        weights = sp.csr_array(rows.means[:, surface.nodes] @ surface.return_operator())
        offset = real_array(slip_offset, "slip_offset")
        mean = SlipMean(*_slips(surface, of_facets, (first, second), offset, dofs, free), weights)
    problem = restrained.problem_of(
        body,
        restrained.ContactRows(rows.means, normal, np.zeros_like(mask)),
        (first, second),
        mesh=lambda motion, _: BodyMesh(nodes, bodies, motion, None, surface.facets, of_facets, lame),
        gap=gap,
        friction=friction,
        friction_slope=friction_slope,
        slip_offset=slip_offset,
        node_ids=rows.labels if node_ids is None else node_ids,
        coordinates=rows.places,
        areas=rows.areas,
        slip_mean=mean,
    )
    return cast("ContactProblem3D", problem)


def _contact_facets(contact: ArrayLike, count: int) -> Integers:
    if plain_array(contact, "contact", error=InvalidArgumentError).size == 0:
        raise InvalidArgumentError("contact has no facets; expected (k, 3) or (k, 4) node numbers of the surface")
    return meshes.elements(contact, "contact", (3, 4), count)


def _rows(surface: ContactSurface, held: Mask, kind: str, ratio: int, patches: ArrayLike | None) -> SurfaceRows:
    width = positive_integer(ratio, "ratio")
    if kind == "nodes":
        if width != 1 or patches is not None:
            raise InvalidArgumentError('ratio and patches are for multipliers="elements"; expected neither for "nodes"')
        return on_nodes(surface, held)
    if patches is not None and width != 1:
        raise InvalidArgumentError(f"ratio is {width} and patches are given; expected only one of them")
    labels = blocks(surface.points, surface.facets, width) if patches is None else patches
    return on_patches(surface, labels, held)


def _slips(
    surface: ContactSurface,
    of_facets: Integers,
    axes: tuple[Floats, ...],
    offset: Floats,
    dofs: Integers,
    free: Integers,
) -> tuple[sp.csr_array, sp.csr_array, Floats]:
    """T1, T2 and the offset of a SlipMean at all quadrature points; patches that are held entirely have slip 0."""
    values = surface.interpolation()
    patch = np.repeat(of_facets, values.shape[0] // len(surface.facets))
    moving = (patch >= 0)[:, None]
    every = (
        restrained.displacements_along(values, np.where(moving, axis[patch], 0.0), dofs, dofs.size) for axis in axes
    )
    T1, T2 = (restrained.reduced(rows[:, free]) for rows in every)
    if offset.shape != (len(axes[0]), 2):
        offset = np.zeros((len(axes[0]), 2))  # ContactProblem3D refuses a wrong shape
    return T1, T2, np.where(moving, offset[patch], 0.0)
