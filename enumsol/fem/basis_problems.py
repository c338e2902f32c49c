"""From a basis and a matrix of scikit-fem to a contact problem."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.fem.bases import between_corners, facet_basis
from enumsol.fem.mesh_checks import SAME, unit_vectors, vectors_of_all
from enumsol.fem.restrained import Body, Supports, axes_of, movable, problem_of
from enumsol.support.arguments import shown
from enumsol.support.array_arguments import plain_array, real_array, real_matrix

if TYPE_CHECKING:
    from collections.abc import Callable

    import scipy.sparse as sp
    from skfem import CellBasis, DiscreteField, Mesh
    from skfem.assembly.dofs import DofsView
    from skfem.assembly.form.form import FormExtraParams

    from enumsol.fem.restrained import Tangents
    from enumsol.model.problem3d import AnyProblem
    from enumsol.support.array_types import ArrayLike, Floats, Integers, Mask

    Field = ArrayLike | Callable[[Floats], ArrayLike]

#: Nodal integrals of normals below this share of the largest are rounding.
_NO_PRESSURE = 1e-6


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
    supports = Supports(fixed[dofs], moved[dofs])
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
    if np.min(shares) <= _NO_PRESSURE * np.max(shares):
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
    if np.min(lengths) <= _NO_PRESSURE * np.max(lengths):
        raise InvalidArgumentError(
            f"the normals around contact node {nodes[np.argmin(lengths)]} cancel; expected normals, or parts of the "
            "boundary without a fold"
        )
    return vectors


def _vector(value: object, name: str, size: int) -> Floats:
    if value is None:
        return np.zeros(size)
    array = real_array(value, name, error=InvalidArgumentError)
    if array.shape != (size,):
        raise InvalidArgumentError(f"{name} has shape {array.shape}; expected ({size},), as the basis has")
    return array
