"""What holds a body: degrees of freedom with given displacements are eliminated, at contact nodes set apart.

A contact row needs both components of its node. Where one of them is held at zero, as on a plane of symmetry, it stays
in the problem as a degree of freedom of its own that nothing moves: it is uncoupled from the body, its displacement is
zero in every solution, and so is the tangential force along it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from enumsol.errors import InvalidArgumentError

if TYPE_CHECKING:
    from enumsol.support.array_types import Floats, Integers, Mask

#: Components of unit normals below this are rounding of a right angle.
RIGHT_ANGLE = 1e-9


@dataclass(frozen=True)
class Supports:
    """Displacements that are given, by nodes and components.

    Attributes
    ----------
    fixed : (N, dimension) bool array
    values : (N, dimension) array
        Displacements of the fixed components, 0 elsewhere [length].
    """

    fixed: Mask
    values: Floats

    @classmethod
    def held(cls, mask: Mask) -> Supports:
        """Held at zero."""
        return cls(mask, np.zeros(mask.shape))


@dataclass(frozen=True)
class ContactRows:
    """What the p contact rows stand for.

    Attributes
    ----------
    means : (p, N) csr_array
        The displacement of each row as a weighted mean of nodal ones; in pairs less that of what it faces.
    normals : (p, dimension) array
        Of length one.
    apart : (N, dimension) bool array
        Fixed components that stay in the problem.
    """

    means: sp.csr_array
    normals: Floats
    apart: Mask


@dataclass(frozen=True)
class ContactNodes(ContactRows):
    """Contact nodes that can move: each row stands for one.

    Attributes
    ----------
    nodes : (p,) int array
    kept : (p,) int array
        Which of the nodes that were asked for these are.
    """

    nodes: Integers
    kept: Integers


def movable(nodes: Integers, normals: Floats, supports: Supports, means: sp.csr_array | None = None) -> ContactNodes:
    """Contact nodes without those that are held entirely.

    ``means`` (p, N) are the displacements of the rows, relative to what each faces, by nodes; without them those of the
    nodes. A component of a row is held if it is at all of its nodes.

    Raises
    ------
    InvalidArgumentError
        All are held, or one is held in a component that is not perpendicular to its normal, or displaced in one.
    """
    means = means_of_nodes(nodes, len(supports.fixed)) if means is None else means
    fixed = np.asarray(abs(means) @ (~supports.fixed).astype(np.float64)) == 0
    kept = np.flatnonzero(~np.all(fixed, axis=1))
    if not len(kept):
        raise InvalidArgumentError("contact has held nodes only; expected free ones")
    nodes, fixed, normals, means = nodes[kept], fixed[kept], normals[kept], sp.csr_array(means[kept])
    moved = np.asarray(means @ supports.values) != 0
    wrong = np.any(fixed & ((np.abs(normals) > RIGHT_ANGLE) | moved), axis=1)
    if np.any(wrong):
        raise InvalidArgumentError(
            f"contact node {nodes[np.argmax(wrong)]} is held or displaced in some components only, which makes its "
            "rows dependent; expected contact nodes that are free, held entirely, or held at zero across their normal "
            "(as on a plane of symmetry)"
        )
    touched = np.any(fixed, axis=1)
    normals = np.where(fixed, 0.0, normals)
    normals[touched] /= np.linalg.norm(normals[touched], axis=1)[:, None]
    apart = np.zeros_like(supports.fixed)
    apart[nodes] = fixed
    return ContactNodes(means, normals, apart, nodes, kept)


def means_of_nodes(nodes: Integers, count: int) -> sp.csr_array:
    """Displacements of these nodes among ``count``, (p, count)."""
    return sp.csr_array((np.ones(len(nodes)), (np.arange(len(nodes)), nodes)), shape=(len(nodes), count))


def check_axes(contact: ContactRows, tangents: tuple[Floats, ...]) -> None:
    """Refuse tangential axes at planes of symmetry that are neither along nor across them."""
    if not isinstance(contact, ContactNodes):
        return  # of rows that stand for patches nothing is held in some components only
    apart = contact.apart[contact.nodes]
    for tangent in tangents:
        across = np.linalg.norm(np.where(apart, tangent, 0.0), axis=1)
        oblique = (across > RIGHT_ANGLE) & (np.linalg.norm(np.where(apart, 0.0, tangent), axis=1) > RIGHT_ANGLE)
        if np.any(oblique):
            raise InvalidArgumentError(
                f"axes are oblique to the plane of symmetry at contact node {contact.nodes[np.argmax(oblique)]}; "
                "expected one along it and one across it"
            )


@dataclass(frozen=True)
class Restrained:
    """Matrices and vectors by the degrees of freedom that are left.

    Attributes
    ----------
    A, f, load_slope : as in `ContactProblem`
    left : (n,) int array
        The degree of freedom of the body that each is.
    """

    A: sp.csc_array
    f: Floats
    load_slope: Floats | None
    left: Integers


def displacements_along(means: sp.csr_array, directions: Floats, dofs: Integers, left: Integers) -> sp.csr_array:
    """Components along directions (k, dimension) of the means (k, N) of nodal displacements, by what is left."""
    entries = means.tocoo()
    row, node = entries.coords
    data = entries.data[:, None] * directions[row]
    shape, columns = (means.shape[0], dofs.size), dofs[node]
    every = sp.csr_array((data.ravel(), (np.repeat(row, dofs.shape[1]), columns.ravel())), shape=shape)
    rows = sp.csr_array(every[:, left])
    rows.eliminate_zeros()
    return rows


def restrained(
    A: sp.csc_array, forces: Floats, forces_slope: Floats | None, dofs: Integers, supports: Supports, apart: Mask
) -> Restrained:
    """The body by the degrees of freedom that are left, in the order of the rows of A.

    ``dofs`` (N, dimension) are the rows of A that the components of the nodes are.
    """
    fixed, uncoupled, moved = np.zeros(len(forces), bool), np.zeros(len(forces), bool), np.zeros(len(forces))
    fixed[dofs], uncoupled[dofs], moved[dofs] = supports.fixed, apart, np.where(supports.fixed, supports.values, 0.0)
    left = np.flatnonzero(~fixed | uncoupled)
    load = forces - A @ moved if np.any(moved) else forces
    kept = np.where(uncoupled, 0.0, 1.0)[left]
    stiffness = sp.csc_array(A[left][:, left])
    if np.any(uncoupled):
        coupled = sp.diags_array(kept)
        own = sp.diags_array(np.where(kept == 0, stiffness.diagonal(), 0.0))
        stiffness = sp.csc_array(coupled @ stiffness @ coupled + own)
    slope = None if forces_slope is None else kept * forces_slope[left]
    return Restrained(stiffness, kept * load[left], slope, left)


def gathered(cells: Integers, shares: Floats, density: Floats, count: int) -> Floats:
    """Nodal forces (count, dimension): ``shares`` (k, corners) of the densities (k, dimension) on cells."""
    forces = np.zeros((count, density.shape[1]))
    for corner in range(cells.shape[1]):
        np.add.at(forces, cells[:, corner], shares[:, corner, None] * density)
    return forces


def plain_dofs(shape: tuple[int, ...]) -> Integers:
    """Degrees of freedom ``dimension node + component``, of shape (N, dimension)."""
    return np.arange(shape[0] * shape[1]).reshape(shape)
