"""Displacements on a mesh: shape functions of cells of each kind, and what is integrated of them; stresses, norms."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from enumsol.errors import InvalidArgumentError
from enumsol.fem.meshes import cell_name, check_every_node_is_used, check_facets
from enumsol.model.cells import KINDS, boundary, by_kind, corner_keys, node_counts
from enumsol.model.mesh import assembled
from enumsol.support.arguments import instance_of
from enumsol.support.array_arguments import vector_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from skfem import CellBasis, FacetBasis

    from enumsol.model.cells import CellKind
    from enumsol.model.problem3d import AnyProblem, ContactProblem3D
    from enumsol.support.array_types import ArrayLike, Floats, Integers, Mask


#: An area or volume below this share of the squared or cubed extent of its cell is rounding.
FLAT = 1e-14
#: Quadrature of degree two on triangles, at the nodes between corners: the nodes that can be in contact.
_BETWEEN = (np.array([[0.5, 0.5, 0.0], [0.0, 0.5, 0.5]]), np.full(3, 1 / 6))
#: Least degree of quadrature of axisymmetric bodies.
AXISYMMETRIC_DEGREE = 3
#: Degree of quadrature on facets: normals of quadratic curved edges.
_ON_FACETS = 5
#: Cells that may have incompatible modes, by their forms and degrees of quadrature.
_INCOMPATIBLE = (("quadrilateral", 3), ("hexahedron", 3))
#: Numbers that arrays hold at a time while stiffness is integrated.
_AT_ONCE = 4_000_000

#: Simplices that a cell of so many corners consists of, by dimension.
SIMPLICES = {
    (2, 3): [[0, 1, 2]],
    (2, 4): [[0, 1, 2], [0, 2, 3]],
    (3, 4): [[0, 1, 2, 3]],
    (3, 6): [[0, 1, 2, 5], [0, 1, 5, 4], [0, 4, 5, 3]],
    (3, 8): [[0, 1, 2, 6], [0, 2, 3, 6], [0, 3, 7, 6], [0, 7, 4, 6], [0, 4, 5, 6], [0, 5, 1, 6]],
}
#: Components of strains and stresses, in this order, by their number: in the plane, of axisymmetric bodies, in 3D.
COMPONENTS = {
    3: ((0, 0), (1, 1), (0, 1)),
    4: ((0, 0), (1, 1), (2, 2), (0, 1)),
    6: ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)),
}


@dataclass(frozen=True)
class Block:
    """The cells of one kind.

    Attributes
    ----------
    kind : CellKind
    rows : (k,) int array
        Which cells of the mesh they are.
    nodes : (k, a) int array
    corners : (k, a, d) array
        Places of the nodes.
    degree : of the quadrature
    """

    kind: CellKind
    rows: Integers
    nodes: Integers
    corners: Floats
    degree: int

    @cached_property
    def _reference(self) -> tuple[Floats, Floats, Floats]:
        places, weights = self.kind.quadrature(self.degree)
        return self.kind.values(places), self.kind.slopes(places), weights

    @property
    def values(self) -> Floats:
        """Shape functions at the points of quadrature, (a, q)."""
        return self._reference[0]

    @cached_property
    def jacobians(self) -> Floats:
        """Derivatives of the position, (k, q, d, d)."""
        return np.asarray(np.einsum("mai,akq->mqik", self.corners, self._reference[1]))

    @cached_property
    def dx(self) -> Floats:
        """Weights of the points, (k, q), which add up to areas or volumes."""
        return np.asarray(np.abs(np.linalg.det(self.jacobians)) * self._reference[2])

    @property
    def places(self) -> Floats:
        """Positions of the points, (k, q, d)."""
        return np.asarray(np.einsum("mai,aq->mqi", self.corners, self.values))

    def gradients(self, some: slice) -> Floats:
        """Derivatives of the shape functions with respect to the position, (k, q, a, d)."""
        slopes = np.moveaxis(self._reference[1], 2, 0)
        return np.asarray(slopes[None] @ np.linalg.inv(self.jacobians[some]))

    def some(self, each: int) -> Iterator[slice]:
        """Cells a few at a time, if ``each`` numbers are held of one."""
        step = max(1, _AT_ONCE // each)
        return (slice(first, first + step) for first in range(0, len(self.rows), step))


@dataclass(frozen=True)
class NodalBasis:
    """Shape functions on all cells of a mesh.

    Attributes
    ----------
    blocks : tuple of Block
    points : (N, d) array
    cells : (M, k) int array
    thickness : (M,) array or None
        Thickness of a plane body, cell by cell; stiffness, tractions and forces per volume are multiplied by it. None
        stands for 1 [length].
    axisymmetric : bool
        x is the distance from the axis, and everything is multiplied by the length of the circumference.
    incompatible : (M,) bool array or None
        Quadrilaterals with 4 and hexahedra with 8 nodes that have incompatible modes (theory, section 11.10).
    """

    blocks: tuple[Block, ...]
    points: Floats
    cells: Integers
    thickness: Floats | None = None
    axisymmetric: bool = False
    incompatible: Mask | None = None

    @property
    def shape(self) -> tuple[int, int]:
        """(N, d)."""
        return self.points.shape[0], self.points.shape[1]

    @property
    def count(self) -> int:
        """Number of cells."""
        return len(self.cells)

    @property
    def sizes(self) -> Floats:
        """Areas or volumes of the cells, (M,)."""
        sizes, plain = np.empty(self.count), replace(self, thickness=None)
        for block in self.blocks:
            sizes[block.rows] = np.sum(plain.weights(block), axis=1)
        return sizes

    def weights(self, block: Block) -> Floats:
        """Weights of the points of quadrature of cells, (k, q), by which whatever is integrated is multiplied."""
        if self.axisymmetric:
            return np.asarray(2.0 * np.pi * block.places[:, :, 0] * block.dx)
        return block.dx if self.thickness is None else block.dx * self.thickness[block.rows, None]

    def strains(self, block: Block, some: slice) -> Floats:
        """Strains of the nodal displacements of cells, (k, q, s, a d): shears are angles (theory, section 11.6)."""
        return self._strains(block, some, block.gradients(some), block.values)

    def _strains(self, block: Block, some: slice, G: Floats, values: Floats) -> Floats:
        count, points, nodes, d = G.shape
        B = np.zeros((count, points, self.components, nodes, d))
        for row, (i, j) in enumerate(COMPONENTS[self.components]):
            if j < d:
                B[:, :, row, :, i] = G[..., j]
            else:  # around the axis, u_r / r
                B[:, :, row, :, 0] = values.T / block.places[some, :, :1]
            if i != j:
                B[:, :, row, :, j] = G[..., i]
        return B.reshape(count, points, self.components, nodes * d)

    @property
    def components(self) -> int:
        """Number of components of strains."""
        return 6 if self.shape[1] == 3 else 4 if self.axisymmetric else 3

    def stiffness(self, elasticity: Floats) -> sp.csc_array:
        """Stiffness of a linear elastic body, (d N, d N), of (s, s) moduli of all cells or (M, s, s) of each."""
        moduli = np.broadcast_to(elasticity, (self.count, self.components, self.components))
        parts = []
        with np.errstate(over="ignore", invalid="ignore"):  # problems refuse what is not finite
            for block in self.blocks:
                weights, d = self.weights(block), self.shape[1]
                size = block.nodes.shape[1] * d
                for some in block.some(size * (size + 2 * self.components * weights.shape[1])):
                    B = self.strains(block, some)
                    D = moduli[block.rows[some], None] * weights[some, :, None, None]
                    flat = (len(B), -1, size)
                    K = B.reshape(flat).transpose(0, 2, 1) @ (D @ B).reshape(flat)
                    if self.incompatible is not None and (block.kind.form, block.kind.degree) in _INCOMPATIBLE:
                        K -= self._relieved(block, some, B, D) * self.incompatible[block.rows[some], None, None]
                    dofs = (d * block.nodes[some, :, None] + np.arange(d)).reshape(len(B), size)
                    parts.append((dofs, K))
            return _symmetric(parts, self.shape[0] * self.shape[1])

    def _relieved(self, block: Block, some: slice, B: Floats, D: Floats) -> Floats:
        """Stiffness that incompatible modes take off cells when they are condensed, (k, a d, a d)."""
        middle = np.full((1, block.kind.places.shape[1]), 0.5)
        centre = np.einsum("mai,akq->mik", block.corners[some], block.kind.slopes(middle))
        ratio = np.linalg.det(centre)[:, None] / np.linalg.det(block.jacobians[some])
        # of 4 x (1 - x) in each direction of the reference, with the derivatives of its middle
        slopes = 4.0 - 8.0 * block.kind.quadrature(block.degree)[0]
        G = ratio[:, :, None, None] * slopes[None, :, :, None] * np.linalg.inv(centre)[:, None]
        own = self._strains(block, some, G, np.zeros((G.shape[2], G.shape[1])))
        wide, narrow = own.reshape(len(B), -1, own.shape[3]), B.reshape(len(B), -1, B.shape[3])
        inner = wide.transpose(0, 2, 1) @ (D @ own).reshape(wide.shape)
        mixed = wide.transpose(0, 2, 1) @ (D @ B).reshape(narrow.shape)
        return np.asarray(mixed.transpose(0, 2, 1) @ np.linalg.solve(inner, mixed))

    def gram(self) -> sp.csc_array:
        """Products of functions and of their gradients, (N, N): those of one component in H^1."""
        parts = []
        for block in self.blocks:
            for some in block.some(block.values.size * (self.shape[1] + block.nodes.shape[1])):
                G, weights = block.gradients(some), block.dx[some]
                K = np.einsum("mqai,mqbi,mq->mab", G, G, weights, optimize=True)
                K += np.einsum("aq,bq,mq->mab", block.values, block.values, weights, optimize=True)
                parts.append((block.nodes[some], K))
        return _symmetric(parts, self.shape[0])

    def on_part(
        self, facets: Integers, name: str, traction: Callable[[Floats], Floats | float], *, lumped: bool = False
    ) -> Floats:
        """Nodal forces (N, d) of tractions on facets, from outward unit normals (d, k, q) at points of quadrature.

        With ``lumped``, integrals over triangles of second order use the nodes between corners only, so that the
        integrals of 1 are positive there and zero at corners.

        Raises
        ------
        InvalidArgumentError
            One of the facets is not on the boundary of the body, has another number of nodes, or is given twice.
        """
        total, (outer, owners) = np.zeros(self.shape), self._outer
        found = self.facet_numbers(facets, name)
        for rows, nodes in by_kind(self.shape[1] - 1, outer[found]) if len(found) else []:
            kind, owner = KINDS[self.shape[1] - 1, nodes.shape[1]], owners[found[rows]]
            between = lumped and (self.shape[1], nodes.shape[1]) == (3, 6)
            places, weights = _BETWEEN if between else kind.quadrature(_ON_FACETS)
            places = places.T if between else places
            tangents = np.einsum("mai,akq->kimq", self.points[nodes], kind.slopes(places))
            plane = len(tangents) == 1
            across = (
                np.stack([tangents[0, 1], -tangents[0, 0]]) if plane else np.cross(tangents[0], tangents[1], axis=0)
            )
            areas = np.linalg.norm(across, axis=0)
            normals = self._signs[owner, None] * across / areas
            share, shapes = areas * weights, kind.values(places)
            if self.axisymmetric:
                share = share * 2.0 * np.pi * (self.points[nodes, 0] @ shapes)
            elif self.thickness is not None:
                share = share * self.thickness[owner, None]
            values = np.broadcast_to(traction(normals), normals.shape) * share
            np.add.at(total, nodes, np.einsum("dmq,aq->mad", values, shapes))
        return total

    def facet_numbers(self, facets: Integers, name: str) -> Integers:
        """Rows among the facets of the boundary of facets that are given by their nodes, corners first.

        Raises
        ------
        InvalidArgumentError
            As in `on_part`.
        """
        d, outer = self.shape[1], self._outer[0]
        if facets.shape[1] > outer.shape[1] or (len(facets) and (d - 1, facets.shape[1]) not in KINDS):
            raise InvalidArgumentError(
                f"{name} has facets of {facets.shape[1]} nodes; expected {outer.shape[1]}, as the cells have"
            )
        found = [self._numbers.get(tuple(key), -1) for key in corner_keys(d, facets).tolist()]
        check_facets(found, facets, name)
        numbers = np.array(found, dtype=np.int64)
        own, expected = (np.max(node_counts(rows), initial=0) for rows in (facets, outer[numbers]))
        if own != expected:
            raise InvalidArgumentError(f"{name} has facets of {own} nodes; expected {expected}, as the cells have")
        return numbers

    @cached_property
    def _outer(self) -> tuple[Integers, Integers]:
        return boundary(self.shape[1], self.cells)

    @cached_property
    def _numbers(self) -> dict[tuple[int, ...], int]:
        """Rows of the facets on the boundary by their corners."""
        return {tuple(key): row for row, key in enumerate(corner_keys(self.shape[1], self._outer[0]).tolist())}

    @cached_property
    def _signs(self) -> Floats:
        """1.0 for cells whose nodes are in the order of a positive volume, -1.0 for others, (M,)."""
        signs = np.empty(self.count)
        for block in self.blocks:
            signs[block.rows] = np.sign(np.linalg.det(block.jacobians[:, 0]))
        return signs

    def volume_forces(self, density: Floats, slopes: Floats | None = None) -> Floats:
        """Nodal forces (N, d) of a force per volume on each cell: constant, (M, d), plus (M, d, d) times the place."""
        total = np.zeros(self.shape)
        for block in self.blocks:
            shares = self.weights(block) @ block.values.T
            np.add.at(total, block.nodes, shares[:, :, None] * density[block.rows, None])
            if slopes is not None:
                fine = replace(block, degree=block.degree + 2)
                forces = np.einsum("mij,mqj->mqi", slopes[block.rows], fine.places) * self.weights(fine)[:, :, None]
                np.add.at(total, block.nodes, np.einsum("aq,mqi->mai", fine.values, forces))
        return total

    def stressed(self, moduli: Floats, nodes: Floats, cells: Floats) -> tuple[Floats, Floats]:
        """Nodal forces (N, d) that hold off stresses (M, s) times a field, and the means of these stresses, (M, s).

        The field is the sum of values of nodes, (N,), and of cells, (M,).
        """
        total, means = np.zeros(self.shape), np.empty((self.count, self.components))
        for block in self.blocks:
            field = nodes[block.nodes] @ block.values + cells[block.rows, None]
            weights = self.weights(block)
            means[block.rows] = (
                moduli[block.rows] * (np.sum(field * weights, axis=1) / np.sum(weights, axis=1))[:, None]
            )
            for some in block.some(self.components * self.shape[1] * block.values.size):
                B, own = self.strains(block, some), field[some] * weights[some]
                forces = np.einsum("mqsk,ms,mq->mk", B, moduli[block.rows[some]], own, optimize=True)
                np.subtract.at(total, block.nodes[some], forces.reshape(len(forces), -1, self.shape[1]))
        return total, means

    def means(self, u: Floats) -> Floats:
        """Mean strains of the cells, (M, s), of displacements (N, d) of the nodes."""
        found = np.empty((self.count, self.components))
        for block in self.blocks:
            for some in block.some(self.components * self.shape[1] * block.values.size):
                moved = u[block.nodes[some]].reshape(len(block.rows[some]), -1)
                weights = self.weights(block)[some]
                strains = np.einsum("mqsk,mk,mq->ms", self.strains(block, some), moved, weights, optimize=True)
                found[block.rows[some]] = strains / np.sum(weights, axis=1)[:, None]
        return found


def _symmetric(parts: list[tuple[Integers, Floats]], size: int) -> sp.csc_array:
    """The matrix of these parts, as of `assembled`, made exactly symmetric."""
    A = assembled(parts, size)
    return sp.csc_array(0.5 * (A + A.T))


def isotropic(lame: Floats, components: int) -> Floats:
    """Moduli (..., s, s) of Lame coefficients (..., 2)."""
    lam, mu = np.moveaxis(np.asarray(lame), -1, 0)[:, ..., None, None]
    direct = np.diag([float(i == j) for i, j in COMPONENTS[components]])
    along = np.outer(np.diag(direct), np.diag(direct))
    return np.asarray(lam * along + mu * (np.eye(components) + direct))


def nodal_basis(nodes: Floats, cells: Integers, degree: int = 0, labels: Integers | None = None) -> NodalBasis:
    """Basis of displacements, whose quadrature is that of stiffness matrices, or of a higher degree.

    ``labels`` (M,) are the numbers by which messages name cells; by default their rows.

    Raises
    ------
    InvalidArgumentError
        A node belongs to no cell, a cell is flat, folded or inside out at a corner, two overlap that share a facet, or
        do not fit together at one.
    """
    kinds = by_kind(nodes.shape[1], cells)
    check_every_node_is_used(cells, len(nodes), "cells", "cell")
    blocks = tuple(_block(nodes, rows, nodes_of, degree, labels) for rows, nodes_of in kinds)
    refuse_wrong_sides(nodes, cells, labels)
    body = NodalBasis(blocks, nodes, cells)
    if len(kinds) > 1:
        refuse_misfits(nodes, *body._outer, labels)
    return body


def _block(points: Floats, rows: Integers, cells: Integers, degree: int, labels: Integers | None) -> Block:
    kind = KINDS[points.shape[1], cells.shape[1]]
    block = Block(kind, rows, cells, points[cells], max(kind.degree, degree))
    wrong = _folded(block)
    if np.any(wrong):
        raise InvalidArgumentError(
            f"{cell_name(int(rows[np.argmax(wrong)]), labels)} is flat, folded or inside out at a corner; expected "
            "proper cells with their nodes in the order of VTK"
        )
    return block


def facet_basis(basis: CellBasis, facets: Integers, *, lumped: bool = False) -> FacetBasis:
    """scikit-fem's basis on facets; see `NodalBasis.on_part`."""
    from skfem import FacetBasis  # scikit-fem takes a while to import

    if lumped and between_corners(basis.elem):
        return FacetBasis(basis.mesh, basis.elem, facets=facets, quadrature=_BETWEEN)
    return FacetBasis(basis.mesh, basis.elem, facets=facets, intorder=_ON_FACETS)


def between_corners(element: object) -> bool:
    """True if facets are triangles of second order, of which the nodes between corners can be in contact."""
    from skfem import ElementTetP2  # as above

    return isinstance(getattr(element, "elem", element), ElementTetP2)


def _folded(block: Block) -> Mask:
    """Cells whose area or volume vanishes or changes its sign at a corner or a quadrature point."""
    corners, d = block.corners, block.corners.shape[2]
    ends = block.kind.slopes(block.kind.places[: block.kind.corners])
    with np.errstate(all="ignore"):  # what over- or underflows is among them
        at_ends = np.linalg.det(np.einsum("mai,akq->mqik", corners, ends))
        values = np.concatenate([at_ends, np.linalg.det(block.jacobians)], axis=1)
    extents = np.max(np.ptp(corners, axis=1), axis=1) ** d
    flat = np.min(np.abs(values), axis=1) <= FLAT * extents
    return np.asarray(flat | (np.abs(np.sum(np.sign(values), axis=1)) < values.shape[1]))


def corners_of(dimension: int, cells: Integers) -> list[tuple[Integers, Integers]]:
    """The rows of the cells of each kind, and their corners."""
    kinds = by_kind(dimension, cells)
    return [(rows, nodes[:, : KINDS[dimension, nodes.shape[1]].corners]) for rows, nodes in kinds]


def refuse_wrong_sides(points: Floats, cells: Integers, labels: Integers | None) -> None:
    """Refuse cells that are on the same side of a facet that they share: duplicates, folds, cells inside out.

    Raises
    ------
    InvalidArgumentError
        There are such; it names two of them.
    """
    dimension = points.shape[1]
    sides: dict[int, list[tuple[Integers, Integers]]] = {}
    for rows, corners in corners_of(dimension, cells):
        simplex = points[corners[:, SIMPLICES[dimension, corners.shape[1]][0]]]
        turned = np.linalg.det(simplex[:, 1:] - simplex[:, :1]) < 0
        for side in KINDS[dimension, corners.shape[1]].sides:
            facets = np.where(turned[:, None], corners[:, side[::-1]], corners[:, side])
            sides.setdefault(len(side), []).append((facets, rows))
    for some in sides.values():
        facets, owners = (np.concatenate(part) for part in zip(*some, strict=True))
        _refuse_same_side(points, facets, owners, labels)


def _refuse_same_side(points: Floats, every: Integers, owner: Integers, labels: Integers | None) -> None:
    """Refuse facets of so many corners that cells on the same side share."""
    # two cells on either side of a facet go around it in opposite directions, the least node first; edges have two ends
    first = np.argmin(every, axis=1)[:, None]
    solid = points.shape[1] == 3
    along = np.take_along_axis(every, (first + 1) % every.shape[1], axis=1)[:, 0] if solid else every[:, 0]
    order = np.lexsort(np.sort(every, axis=1).T)
    keys, along, owner = np.sort(every, axis=1)[order], along[order], owner[order]
    same = np.flatnonzero(np.all(keys[1:] == keys[:-1], axis=1) & (along[1:] == along[:-1]))
    third = np.flatnonzero(np.all(keys[2:] == keys[:-2], axis=1))
    wrong = np.union1d(same, third)
    if not len(wrong):
        return
    # a cell that is inside out is so with all its neighbours
    beside = np.concatenate([owner[wrong], owner[wrong + 1]])
    cell = int(np.argmax(np.bincount(beside)))
    k = int(wrong[np.flatnonzero((owner[wrong] == cell) | (owner[wrong + 1] == cell))[0]])
    other = int(owner[k] if owner[k] != cell else owner[k + 1])
    raise InvalidArgumentError(
        f"{cell_name(cell, labels)} overlaps {cell_name(other, labels)}, for both are on the same side of "
        f"what they share at {place_of(points[keys[k]].mean(axis=0))}, or one of them is inside out; expected cells "
        "that cover the body once"
    )


def refuse_misfits(points: Floats, facets: Integers, owners: Integers, labels: Integers | None) -> None:
    """Refuse cells of several kinds that meet at facets which do not fit together, though they share their corners.

    ``facets`` (k, m) and ``owners`` (k,) are those of the boundary (`enumsol.model.cells.boundary`).

    Raises
    ------
    InvalidArgumentError
        A facet of first order meets one of second order, or a triangle a part of a quadrilateral; it names both cells.
    """
    keys = [tuple(key) for key in corner_keys(points.shape[1], facets).tolist()]
    known: dict[tuple[int, ...], int] = {}
    for row, key in enumerate(keys):
        parts = [key] if len(key) == 2 or key[0] < 0 else [key, *((-1, *key[:k], *key[k + 1 :]) for k in range(4))]
        for part in parts:
            other = known.setdefault(part, row)
            if other == row or (part != key and keys[other] != part):
                continue
            one, two = (cell_name(int(owners[k]), labels) for k in (other, row))
            what = "one is of first and one of second order" if keys[other] == key else "one has a triangle there"
            raise InvalidArgumentError(
                f"{one} and {two} share corners at {place_of(points[[*part[part[0] < 0 :]]].mean(axis=0))}, but do not "
                f"fit together, as {what}; expected cells that share whole facets, or bodies that share no nodes"
            )


def place_of(at: Floats) -> str:
    """A position in words."""
    return f"({', '.join(f'{float(value) + 0.0:.6g}' for value in at)})"


def cell_stresses(problem: AnyProblem, u: ArrayLike) -> Floats:
    """Mean stress of every cell of the body, (M, d, d), for displacements u of shape (n,) [force / length^2].

    Those of the strains with the moduli that the problem was made with, less what a change of temperature takes off. In
    2D these are the components in the plane; of axisymmetric bodies (M, 3, 3) along the radius, the axis and around it.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
        With a mesh that knows its Lame coefficients, as `contact_problem`, `solid_contact_problem` and `mesh_problem`
        make it.
    u : (n,) array_like
        For example ``root.u`` [length].

    Raises
    ------
    InvalidArgumentError
        The problem has no such mesh, or u has another shape.

    Examples
    --------
    >>> import enumsol
    >>> from enumsol import fem
    >>> mesh = fem.rectangle(2, 2).parted()
    >>> problem = fem.mesh_problem(
    ...     mesh, young=1, poisson=0, clamp="left", contact="bottom", load={"right": (1, 0)}, friction=0.5
    ... )
    >>> free = problem.factorization.solve(problem.f)
    >>> fem.cell_stresses(problem, free)[:, 0, 0].round(6).tolist()  # pulled to the right by 1
    [1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0]
    """
    mesh = problem.mesh
    if mesh is None or not mesh.has_material:
        raise InvalidArgumentError(
            "the problem has no mesh with Lame coefficients; expected one made by fem.contact_problem, "
            "fem.solid_contact_problem or fem.mesh_problem, or BodyMesh(..., lame=...)"
        )
    body = nodal_basis(mesh.points, mesh.cells, AXISYMMETRIC_DEGREE if mesh.axisymmetric else 0)
    body = replace(body, axisymmetric=mesh.axisymmetric)
    moduli: Any = mesh.elasticity if mesh.lame is None else isotropic(mesh.lame, body.components)
    values = np.einsum("mst,mt->ms", moduli, body.means(mesh.displacements(u)))
    if mesh.initial_stress is not None:
        values = values + mesh.initial_stress
    if mesh.stress_slope is not None:
        values = values + np.asarray(u)[-1] * mesh.stress_slope
    d = 3 if mesh.axisymmetric else mesh.points.shape[1]
    stresses = np.zeros((len(mesh.cells), d, d))
    for row, (i, j) in enumerate(COMPONENTS[body.components]):
        stresses[:, i, j] = stresses[:, j, i] = values[:, row]
    return stresses


def von_mises(stresses: Floats) -> Floats:
    """The equivalent stress of von Mises of stresses (M, 3, 3), (M,)."""
    deviator = stresses - np.trace(stresses, axis1=1, axis2=2)[:, None, None] * np.eye(3) / 3.0
    return np.asarray(np.sqrt(1.5 * np.sum(deviator**2, axis=(1, 2))))


@dataclass(frozen=True, eq=False)
class MeshNorms:
    """Norms of a problem in 3D whose mesh is known.

    Attributes
    ----------
    G : (n, n) csc_array
        Gram matrix of H^1 on the free degrees of freedom: mass and gradients [length^3, length].
    Bn : (p, n) csr_array
        Normal contact rows of the problem.
    areas : (p,) array
        Area of each contact row [length^2].
    """

    G: sp.csc_array
    Bn: sp.csr_array
    areas: Floats

    @cached_property
    def dual(self) -> Floats:
        """Bn G^-1 Bn', (p, p)."""
        from enumsol.condensation.factorization import Factorization  # scipy's solvers come with the first use

        factorization, p = Factorization(self.G), self.Bn.shape[0]
        columns = [  # some at a time: the dense blocks stay small
            self.Bn @ factorization.solve(self.Bn[start : start + 64].T.toarray()) for start in range(0, p, 64)
        ]
        matrix = np.hstack(columns)
        return np.asarray(0.5 * (matrix + matrix.T))

    def of_displacement(self, u: ArrayLike) -> float:
        """||u||_1 for u of shape (n,)."""
        v = vector_of(u, "u", self.G.shape[0])
        return float(np.sqrt(v @ (self.G @ v)))

    def of_force(self, mu: ArrayLike) -> float:
        """||mu||_(-1/2,h) for normal forces mu of shape (p,): the supremum of mu' Bn v over ||v||_1 = 1."""
        v = vector_of(mu, "mu", len(self.areas))
        return float(np.sqrt(v @ self.dual @ v))

    def of_slip(self, phi: ArrayLike) -> float:
        """||phi||_0 for slips of shape (p,), the root of sum_i m_i phi_i^2 (theory, (11.4))."""
        v = vector_of(phi, "phi", len(self.areas))
        return float(np.sqrt(self.areas @ v**2))


def h1_norms(problem: ContactProblem3D) -> MeshNorms:
    """Norms on the mesh of a problem, such as `solid_contact_problem` makes.

    Parameters
    ----------
    problem : ContactProblem3D
        With ``mesh`` and ``areas``.

    Raises
    ------
    InvalidArgumentError
        It has no mesh or no areas.

    Examples
    --------
    >>> import enumsol
    >>> norms = enumsol.fem.h1_norms(enumsol.gallery.block3d(2, 2, 2))
    >>> norms.dual.shape
    (6, 6)
    """
    from enumsol.model.problem3d import ContactProblem3D  # not for problems in 2D

    instance_of(problem, ContactProblem3D, "problem")
    if problem.mesh is None or problem.areas is None:
        raise InvalidArgumentError("problem has no mesh or no areas; expected one made of a mesh")
    # products of linear functions have degree two: exact on tetrahedra and parallelepipeds
    gram = nodal_basis(problem.mesh.points, problem.mesh.cells, degree=2).gram()
    motion = problem.mesh.motion
    G = sp.csc_array(motion.T @ sp.kron(gram, sp.eye_array(3)) @ motion)
    return MeshNorms(G, problem.Bn, problem.areas)
