"""The contact surface of a body in 3D: where multipliers live, local axes, and the return operator r_h."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from enumsol.errors import InvalidArgumentError, InvalidProblemError
from enumsol.fem.construction import default_axes
from enumsol.fem.mesh_checks import unit_vectors, vectors_of_all
from enumsol.fem.restrained import gathered, means_of_nodes
from enumsol.fem.solid_geometry import facet_quadrature, facet_vectors
from enumsol.support.array_arguments import plain_array, real_array

if TYPE_CHECKING:
    from collections.abc import Callable

    from enumsol.support.array_types import ArrayLike, Floats, Integers, Mask

    Field = ArrayLike | Callable[[Floats], ArrayLike]

#: How far axes may be from right angles and length one, for rounding.
AXES_TOLERANCE = 1e-10


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
class Multipliers:
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


def on_nodes(surface: ContactSurface, held: Mask) -> Multipliers:
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
    areas = gathered(facets, shares, np.ones((len(facets), 1)), count)[free, 0]
    vectors = gathered(facets, np.ones_like(shares), surface.vectors, count)[free]
    return Multipliers(means_of_nodes(free, count), areas, surface.points[free], vectors, free.tolist())


def on_patches(surface: ContactSurface, patches: ArrayLike, held: Mask) -> Multipliers:
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
    return Multipliers(
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


def local_axes(multipliers: Multipliers, normals: ArrayLike | None, axes: Any) -> tuple[Floats, Floats, Floats]:
    """Normals and axes t1, t2 of the rows, each (p, 3); (t1, t2, n) is right-handed where t2 is not given.

    Parameters
    ----------
    multipliers : Multipliers
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
        normal = unit_vectors(multipliers.vectors, "normals of the contact surface")
    else:
        normal = unit_vectors(vectors_of_all(normals, "normals", shape), "normals")
        inward = np.sum(normal * multipliers.vectors, axis=1) <= 0
        if np.any(inward):
            k = int(np.argmax(inward))
            raise InvalidArgumentError(f"normals row {k} does not point out of the body; expected outward normals")
    if axes is None:
        return normal, *default_axes(normal)
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


def _field(value: Any, places: Floats) -> Floats:
    if callable(value):
        value = [value(place) for place in places]
    return vectors_of_all(real_array(value, "axes", error=InvalidArgumentError), "axes", places.shape)


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
