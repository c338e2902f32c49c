"""From a mesh of a body in 3D to its contact problem (theory, section 11.6)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, cast

import numpy as np
import scipy.sparse as sp

from enumsol.errors import InvalidArgumentError
from enumsol.fem.construction import problem_of
from enumsol.fem.mesh_checks import elements, held_mask, nodal_vectors, spring_stiffnesses
from enumsol.fem.restrained import ContactRows, Supports, displacements_along, plain_dofs
from enumsol.fem.solid_geometry import outward, solid_mesh
from enumsol.fem.solid_meshes import blocks
from enumsol.fem.solids import solid_stiffness
from enumsol.fem.surfaces import ContactSurface, Multipliers, local_axes, on_nodes, on_patches
from enumsol.model.mesh import BodyMesh
from enumsol.model.slip_mean import SlipMean
from enumsol.support.arguments import one_of, positive_integer
from enumsol.support.array_arguments import plain_array, real_array

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.model.problem3d import ContactProblem3D
    from enumsol.support.array_types import ArrayLike, Floats, Integers, Mask


def solid_contact_problem(
    points: ArrayLike,
    cells: ArrayLike,
    lame: tuple[float, float],
    *,
    contact: ArrayLike,
    normals: ArrayLike | None = None,
    axes: Any = None,
    held: ArrayLike = (),
    springs: ArrayLike | None = None,
    forces: ArrayLike | None = None,
    forces_slope: ArrayLike | None = None,
    gap: ArrayLike = 0.0,
    friction: Any = 0.5,
    friction_slope: Any = 0.0,
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
    mask = held_mask(held, nodes.shape)
    rows = _rows(surface, mask, one_of(multipliers, "multipliers", ("nodes", "elements")), ratio, patches)
    normal, first, second = local_axes(rows, normals, axes)
    A = solid_stiffness(nodes, bodies, lame)
    if springs is not None:
        A = sp.csc_array(A + sp.diags_array(spring_stiffnesses(springs, nodes.shape).ravel()))
    dofs, free = plain_dofs(nodes.shape), np.flatnonzero(~mask.ravel())
    of_facets, mean = rows.rows_of_facets, None
    if of_facets is not None:
        weights = sp.csr_array(rows.means[:, surface.nodes] @ surface.return_operator())
        offset = real_array(slip_offset, "slip_offset")
        mean = SlipMean(*_slips(surface, of_facets, (first, second), offset, dofs, free), weights)
    problem = problem_of(
        A,
        nodal_vectors(forces, "forces", nodes.shape),
        None if forces_slope is None else nodal_vectors(forces_slope, "forces_slope", nodes.shape),
        dofs,
        ContactRows(rows.means, normal, np.zeros_like(mask)),
        (first, second),
        Supports.held(mask),
        mesh=lambda left: BodyMesh.of_dofs(nodes, bodies, left, None, surface.facets, of_facets, lame),
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
    return elements(contact, "contact", (3, 4), count)


def _rows(surface: ContactSurface, held: Mask, kind: str, ratio: int, patches: Any) -> Multipliers:
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
    T1, T2 = (displacements_along(values, np.where(moving, axis[patch], 0.0), dofs, free) for axis in axes)
    if offset.shape != (len(axes[0]), 2):
        offset = np.zeros((len(axes[0]), 2))  # ContactProblem3D refuses a wrong shape
    return T1, T2, np.where(moving, offset[patch], 0.0)
