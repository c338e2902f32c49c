"""Displacements on a mesh of one kind of cell: scikit-fem's basis, and its degrees of freedom by nodes.

Degrees of freedom here are ``dimension node + component``; scikit-fem has an order of its own.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from enumsol.errors import InvalidArgumentError
from enumsol.fem.mesh_checks import check_every_node_is_used

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Integers = NDArray[np.int64]

#: Corners of the reference hexahedron (0, 1)^3.
HEXAHEDRON = np.array(
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], dtype=np.float64
)
#: An area or volume below this share of the squared or cubed extent of its cell is rounding.
FLAT = 1e-14
#: Degree of the quadrature on facets: tractions and normals of quadratic curved edges.
FACET_DEGREE = 5


@dataclass(frozen=True)
class CellKind:
    """A kind of cell, with the names that scikit-fem has for it.

    Attributes
    ----------
    name : in messages
    mesh, element : scikit-fem's classes; of "MeshQuadS2" it has the element only
    corners, facet_corners : nodes of a cell, and of a facet of it, that are corners
    degree : of the quadrature of its stiffness
    simplex : whether the corners may come in any order
    """

    name: str
    mesh: str
    element: str
    corners: int
    facet_corners: int
    degree: int
    simplex: bool = False


#: By dimension and nodes of a cell, which are in the order of VTK; gmsh's is the same for all of these.
KINDS = {
    (2, 3): CellKind("triangles", "MeshTri1", "ElementTriP1", 3, 2, 0, simplex=True),
    (2, 4): CellKind("quadrilaterals", "MeshQuad1", "ElementQuad1", 4, 2, 3),
    (2, 6): CellKind("quadratic triangles", "MeshTri2", "ElementTriP2", 3, 2, 4),
    (2, 8): CellKind("quadratic quadrilaterals with 8 nodes", "MeshQuadS2", "ElementQuadS2", 4, 2, 5),
    (2, 9): CellKind("quadratic quadrilaterals", "MeshQuad2", "ElementQuad2", 4, 2, 5),
    (3, 4): CellKind("tetrahedra", "MeshTet1", "ElementTetP1", 4, 3, 0, simplex=True),
    (3, 8): CellKind("hexahedra", "MeshHex1", "ElementHex1", 8, 4, 3),
}


#: Nodes of each facet of a cell: corners, in 3D counterclockwise as seen from outside a cell of positive volume, then
#: the node between them. By dimension and nodes of a cell.
CELL_FACETS = {
    (2, 3): np.array([[0, 1], [1, 2], [2, 0]]),
    (2, 4): np.array([[0, 1], [1, 2], [2, 3], [3, 0]]),
    (2, 6): np.array([[0, 1, 3], [1, 2, 4], [2, 0, 5]]),
    (2, 8): np.array([[0, 1, 4], [1, 2, 5], [2, 3, 6], [3, 0, 7]]),
    (2, 9): np.array([[0, 1, 4], [1, 2, 5], [2, 3, 6], [3, 0, 7]]),
    (3, 4): np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]),
    (3, 8): np.array([[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]),
}


@dataclass(frozen=True)
class NodalBasis:
    """A basis of scikit-fem and what its degrees of freedom are.

    Attributes
    ----------
    basis : skfem.CellBasis
        Of nodal vectors.
    dofs : (N, dimension) int array
        scikit-fem's number of each component of each node.
    corners : (v,) int array
        The nodes that are corners of cells, in order: scikit-fem's vertices.
    """

    basis: Any
    dofs: Integers
    corners: Integers

    def matrix(self, assembled: Any) -> sp.csc_array:
        """A matrix that scikit-fem assembled, renumbered and made exactly symmetric."""
        entries = sp.coo_array(assembled)
        row, column = self._ours[entries.coords[0]], self._ours[entries.coords[1]]
        A = sp.csc_array((entries.data, (row, column)), shape=entries.shape)
        return sp.csc_array(0.5 * (A + A.T))

    def vectors(self, assembled: Any) -> Floats:
        """A vector that scikit-fem assembled, by nodes: (N, dimension)."""
        return np.asarray(np.asarray(assembled)[self.dofs])

    def facet_numbers(self, facets: Integers, name: str) -> Integers:
        """scikit-fem's numbers of facets on the boundary, (k,), that are given by their nodes, corners first.

        Raises
        ------
        InvalidArgumentError
            One is no facet on the boundary of the body, or comes twice.
        """
        mesh = self.basis.mesh
        outer = mesh.boundary_facets()
        keys = np.sort(self.corners[mesh.facets[:, outer]], axis=0).T.tolist()
        known = {tuple(key): int(number) for key, number in zip(keys, outer, strict=True)}
        rows = np.sort(facets[:, : len(mesh.facets)], axis=1)
        numbers = np.array([known.get(tuple(key), -1) for key in rows.tolist()], dtype=np.int64)
        if np.any(numbers < 0):
            k = int(np.argmin(numbers))
            raise InvalidArgumentError(
                f"{name} row {k}, nodes {facets[k].tolist()}, is no facet on the boundary of the body; "
                "expected facets of one cell each"
            )
        if len(np.unique(numbers)) != len(numbers):
            raise InvalidArgumentError(f"{name} names a facet twice; expected distinct facets")
        return numbers

    def on_facets(self, numbers: Integers) -> Any:
        """scikit-fem's basis on facets of these numbers."""
        from skfem import FacetBasis  # as below

        return FacetBasis(self.basis.mesh, self.basis.elem, facets=numbers, intorder=FACET_DEGREE)

    def stiffness(self, lam: float, mu: float) -> sp.csc_array:
        """Stiffness of a linear elastic body with these Lame coefficients, in 2D in plane strain."""
        from skfem import BilinearForm  # as below
        from skfem.helpers import ddot, div, sym_grad
        from skfem.models.elasticity import linear_elasticity

        def energy(u: Any, v: Any, _: Any) -> Any:
            # as linear_elasticity has it, which makes an identity of every quadrature point and is slow in 3D
            return lam * div(u) * div(v) + 2.0 * mu * ddot(sym_grad(u), sym_grad(v))

        plane = self.dofs.shape[1] == 2
        form = linear_elasticity(lam, mu) if plane else BilinearForm(energy)
        with np.errstate(over="ignore", invalid="ignore"):  # problems refuse what is not finite
            return self.matrix(form.assemble(self.basis))

    def volume_forces(self, density: Floats) -> Floats:
        """Nodal forces (N, dimension) of a force per volume that is constant on each cell, (M, dimension)."""
        from skfem import LinearForm  # as below
        from skfem.helpers import dot

        form = LinearForm(lambda v, w: dot(w.density, v))
        return self.vectors(form.assemble(self.basis, density=np.asarray(density).T[:, :, None]))

    @cached_property
    def _ours(self) -> Integers:
        ours = np.empty(self.dofs.size, dtype=np.int64)
        ours[self.dofs.ravel()] = np.arange(self.dofs.size)
        return ours


def nodal_basis(nodes: Floats, cells: Integers, degree: int = 0) -> NodalBasis:
    """Basis of displacements, with quadrature for stiffness matrices or of a higher degree.

    Raises
    ------
    InvalidArgumentError
        A node belongs to no cell, or a cell is flat, folded or inside out at a corner.
    """
    # scikit-fem takes a while to import and is needed for meshes only
    import skfem
    from skfem.quadrature import get_quadrature

    dimension = nodes.shape[1]
    kind = KINDS[dimension, cells.shape[1]]
    check_every_node_is_used(cells, len(nodes), "cells", "cell")
    # sorted here, so that scikit-fem neither renumbers nor logs
    rows = np.sort(cells, axis=1) if kind.simplex else cells
    if kind.corners == 8:  # scikit-fem has an order of its own
        places = skfem.ElementHex1.doflocs
        rows = rows[:, [int(np.argmin(np.linalg.norm(HEXAHEDRON - place, axis=1))) for place in places]]
    element = getattr(skfem, kind.element)()
    order = max(kind.degree, degree)
    _check_jacobians(nodes[rows], element, get_quadrature(element, order)[0])
    mesh_class = _serendipity() if kind.mesh == "MeshQuadS2" else getattr(skfem, kind.mesh)
    mesh = mesh_class(np.ascontiguousarray(nodes.T), np.ascontiguousarray(rows.T))
    basis = skfem.Basis(mesh, skfem.ElementVector(element), intorder=order)
    dofs = np.empty(nodes.shape, dtype=np.int64)
    local = basis.element_dofs.reshape(cells.shape[1], dimension, len(cells))
    dofs[rows.T] = np.swapaxes(local, 1, 2)
    return NodalBasis(basis, dofs, np.unique(cells[:, : kind.corners]))


@cache
def _serendipity() -> Any:
    """A mesh class of quadrilaterals without a node inside, like scikit-fem's MeshQuad2 but for its element."""
    import skfem  # as above

    names = {
        "__annotations__": {"elem": type},
        "elem": skfem.ElementQuadS2,
        "bndelem": property(lambda mesh: skfem.ElementLineP2()),
    }
    return dataclass(repr=False)(type("MeshQuadS2", (skfem.MeshQuad2,), names))


def _check_jacobians(corners: Floats, element: Any, quadrature: Floats) -> None:
    """Refuse cells whose area or volume vanishes or changes its sign at a corner or a quadrature point."""
    places = np.concatenate([element.refdom.init_refdom()[0], quadrature], axis=1)
    slopes = [np.broadcast_to(element.lbasis(places, i)[1], places.shape) for i in range(corners.shape[1])]
    with np.errstate(all="ignore"):  # what over- or underflows is refused below
        values = np.linalg.det(np.einsum("mai,akq->mqik", corners, np.stack(slopes)))
    extents = np.max(np.ptp(corners, axis=1), axis=1) ** corners.shape[2]
    wrong = np.min(np.abs(values), axis=1) <= FLAT * extents
    wrong |= np.abs(np.sum(np.sign(values), axis=1)) < values.shape[1]
    if np.any(wrong):
        raise InvalidArgumentError(
            f"cells row {int(np.argmax(wrong))} is flat, folded or inside out at a corner; expected proper cells with "
            "their nodes in the order of VTK or gmsh"
        )


def boundary_facets(dimension: int, cells: Integers) -> Integers:
    """Facets (k, m) that belong to one cell only; in 3D counterclockwise as seen from outside the body."""
    local = CELL_FACETS[dimension, cells.shape[1]]
    facets = cells[:, local].reshape(-1, local.shape[1])
    _, first, count = np.unique(np.sort(facets, axis=1), axis=0, return_index=True, return_counts=True)
    return np.asarray(facets[np.sort(first[count == 1])])
