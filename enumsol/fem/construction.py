"""The contact problem of a body in 2D or 3D from its matrices, supports and contact rows: all builders end here."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.fem.mesh_checks import unit_vectors, vectors_of_all
from enumsol.fem.restrained import check_axes, displacements_along, restrained
from enumsol.model.problem import ContactProblem
from enumsol.support.arguments import shown

if TYPE_CHECKING:
    from collections.abc import Callable

    import scipy.sparse as sp

    from enumsol.fem.restrained import ContactRows, Supports
    from enumsol.model.mesh import BodyMesh
    from enumsol.model.problem3d import ContactProblem3D
    from enumsol.support.array_types import Floats, Integers

#: Cosine of the angle between axes that are perpendicular up to rounding, by dimension.
_SKEW = {2: 1e-12, 3: 1e-10}
#: Normals nearer to the x axis than this cosine take the y axis for the default of t1.
_NEAR_X = 0.9


def problem_of(
    A: sp.csc_array,
    forces: Floats,
    forces_slope: Floats | None,
    dofs: Integers,
    contact: ContactRows,
    axes: tuple[Floats, ...],
    supports: Supports,
    mesh: Callable[[Integers], BodyMesh] | None = None,
    modes: Floats | None = None,
    **more: Any,
) -> ContactProblem | ContactProblem3D:
    """The problem of a body with these contact rows.

    Parameters
    ----------
    A, forces, forces_slope, dofs, supports
        As in `restrained`.
    contact : ContactRows
    axes : tuple of one or two (p, dimension) arrays
        Tangents of the contact rows, see `axes_of`.
    mesh : callable or None
        What the problem keeps of its mesh, from the degrees of freedom that are left.
    modes : (d N, r) array or None
        Rigid motions that nothing holds.
    **more
        As in `ContactProblem` and `ContactProblem3D`.

    Returns
    -------
    ContactProblem or ContactProblem3D

    Raises
    ------
    InvalidArgumentError
        An axis is oblique to the plane of symmetry on which its node lies.
    InvalidProblemError
        The body is free to move as a rigid body, or the data are not admissible.
    """
    check_axes(contact, axes)
    body = restrained(A, forces, forces_slope, dofs, supports, contact.apart)
    rows = (displacements_along(contact.means, axis, dofs, body.left) for axis in (contact.normals, *axes))
    arrays: tuple[Any, ...] = (body.A, *rows, body.f)
    more |= {"load_slope": body.load_slope, "mesh": None if mesh is None else mesh(body.left)}
    more["rigid_modes"] = None if modes is None else modes[body.left]
    if dofs.shape[1] == 2:
        return ContactProblem(*arrays, **more)
    from enumsol.model.problem3d import ContactProblem3D  # not for problems in 2D

    return ContactProblem3D(*arrays, **more)


def axes_of(tangents: Any, normals: Floats) -> tuple[Floats, ...]:
    """One tangent (p, 2) or two (p, 3) for normals (p, 2) or (p, 3).

    Parameters
    ----------
    tangents : array_like, pair of them, or None
        In 2D (2,) or (p, 2), by default a quarter turn of the normals counterclockwise; in 3D a pair of (3,) or (p, 3),
        by default `default_axes`.

    Raises
    ------
    InvalidArgumentError
        They have the wrong shape or are not perpendicular to the normals and to each other.
    """
    return _plane_axes(tangents, normals) if normals.shape[1] == 2 else _space_axes(tangents, normals)


def default_axes(normal: Floats) -> tuple[Floats, Floats]:
    """Axes t1, t2 for normals (p, 3): the x axis projected, or the y axis where the normal is near the x axis."""
    start = np.where(np.abs(normal[:, :1]) > _NEAR_X, [[0.0, 1.0, 0.0]], [[1.0, 0.0, 0.0]])
    first = unit_vectors(start - np.sum(start * normal, axis=1)[:, None] * normal, "axes")
    return first, np.cross(normal, first)


def _plane_axes(tangents: Any, normal: Floats) -> tuple[Floats]:
    if tangents is None:
        return (np.stack([-normal[:, 1], normal[:, 0]], axis=1),)
    tangent = unit_vectors(vectors_of_all(tangents, "tangents", normal.shape), "tangents")
    skew = np.abs(np.sum(tangent * normal, axis=1))
    if np.any(skew > _SKEW[2]):
        k = int(np.argmax(skew))
        raise InvalidArgumentError(f"tangents row {k} is not perpendicular to normals row {k}; expected right angles")
    return (tangent,)


def _space_axes(tangents: Any, normal: Floats) -> tuple[Floats, Floats]:
    if tangents is None:
        return default_axes(normal)
    if not (isinstance(tangents, (tuple, list)) and len(tangents) == 2):
        raise InvalidArgumentError(f"tangents is {shown(tangents)}; expected a pair of directions (t1, t2)")
    one, two = (unit_vectors(vectors_of_all(axis, "tangents", normal.shape), "tangents") for axis in tangents)
    products = [np.sum(a * b, axis=1) for a, b in ((one, two), (one, normal), (two, normal))]
    if np.max(np.abs(products)) > _SKEW[3]:
        raise InvalidArgumentError("tangents are not perpendicular to each other and to the normals")
    return one, two
