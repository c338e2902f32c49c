"""Displacements on a mesh: scikit-fem's basis of the cells of each kind, by nodes; stresses, and norms."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from enumsol.errors import InvalidArgumentError
from enumsol.fem.meshes import cell_name, check_every_node_is_used, check_facets
from enumsol.model.cells import KINDS, by_kind
from enumsol.support.arguments import instance_of
from enumsol.support.array_arguments import vector_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from skfem import BilinearForm, CellBasis, DiscreteField, FacetBasis
    from skfem.assembly.form.form import FormExtraParams
    from skfem.element import Element

    from enumsol.model.problem3d import AnyProblem, ContactProblem3D
    from enumsol.support.array_types import ArrayLike, Floats, Integers, Mask


#: An area or volume below this share of the squared or cubed extent of its cell is rounding.
FLAT = 1e-14
#: Quadrature of degree two on triangles, at the nodes between corners: the nodes that can be in contact.
_BETWEEN = (np.array([[0.5, 0.5, 0.0], [0.0, 0.5, 0.5]]), np.full(3, 1 / 6))

#: Simplices that a cell of so many corners consists of, by dimension.
SIMPLICES = {
    (2, 3): [[0, 1, 2]],
    (2, 4): [[0, 1, 2], [0, 2, 3]],
    (3, 4): [[0, 1, 2, 3]],
    (3, 8): [[0, 1, 2, 6], [0, 2, 3, 6], [0, 3, 7, 6], [0, 7, 4, 6], [0, 4, 5, 6], [0, 5, 1, 6]],
}


@dataclass(frozen=True)
class Block:
    """The cells of one kind.

    Attributes
    ----------
    basis : skfem.CellBasis
        Of nodal vectors.
    dofs : (m, dimension) int array
        scikit-fem's number of each component of each node of these cells.
    nodes : (m,) int array
        These nodes, in order.
    rows : (k,) int array
        Which cells of the mesh they are.
    corners : (v,) int array
        The nodes that are corners of cells, in order: scikit-fem's vertices.
    """

    basis: CellBasis
    dofs: Integers
    nodes: Integers
    rows: Integers
    corners: Integers

    @cached_property
    def ours(self) -> Integers:
        """The number here of each degree of freedom of scikit-fem."""
        ours = np.empty(self.dofs.size, dtype=np.int64)
        dimension = self.dofs.shape[1]
        ours[self.dofs] = dimension * self.nodes[:, None] + np.arange(dimension)
        return ours

    def on_facets(self, numbers: Integers, *, lumped: bool) -> Any:
        """The `facet_basis` of these facets; it is slow to make, and so kept for everything that acts on them."""
        key = (numbers.tobytes(), lumped)
        if key not in self._on_facets:
            self._on_facets[key] = facet_basis(self.basis, numbers, lumped=lumped)
        return self._on_facets[key]

    @cached_property
    def _on_facets(self) -> dict[tuple[bytes, bool], Any]:
        return {}

    @property
    def outer(self) -> dict[tuple[int, ...], int]:
        """scikit-fem's numbers of the facets that belong to one of these cells only, by their corners."""
        mesh = self.basis.mesh
        numbers = mesh.boundary_facets()
        keys = np.sort(self.corners[mesh.facets[:, numbers]], axis=0).T.tolist()
        return {tuple(key): int(number) for key, number in zip(keys, numbers, strict=True)}


@dataclass(frozen=True)
class NodalBasis:
    """Bases of scikit-fem on all cells of a mesh.

    Attributes
    ----------
    blocks : tuple of Block
    shape : (N, dimension)
    thickness : (M,) array or None
        Thickness of a plane body, cell by cell; stiffness, tractions and forces per volume are multiplied by it. None
        stands for 1 [length].
    """

    blocks: tuple[Block, ...]
    shape: tuple[int, int]
    thickness: Floats | None = None

    def matrix(self, form: BilinearForm) -> sp.csc_array:
        """The matrix of a bilinear form of scikit-fem, made exactly symmetric."""
        return self._gathered(lambda block: form.assemble(block.basis))

    def _gathered(self, assembled: Callable[[Block], Any]) -> sp.csc_array:
        rows, columns, data = [], [], []
        for block in self.blocks:
            entries = sp.coo_array(assembled(block))
            rows.append(block.ours[entries.coords[0]])
            columns.append(block.ours[entries.coords[1]])
            data.append(entries.data)
        size = self.shape[0] * self.shape[1]
        places = (np.concatenate(rows), np.concatenate(columns))
        A = sp.csc_array((np.concatenate(data), places), shape=(size, size))
        return sp.csc_array(0.5 * (A + A.T))

    def on_part(self, facets: Integers, name: str, form: Callable[[Any, Any], Any], *, lumped: bool = False) -> Floats:
        """Integrals over facets of a linear form of scikit-fem, by nodes: (N, dimension).

        With ``lumped``, integrals over triangles of second order use the nodes between corners only, so that the
        integrals of 1 are positive there and zero at corners.

        Raises
        ------
        InvalidArgumentError
            One of the facets is not on the boundary of the body, has another number of nodes, or is given twice.
        """
        from skfem import LinearForm  # as below

        total = np.zeros(self.shape)
        for block, numbers in zip(self.blocks, self.facet_numbers(facets, name), strict=True):
            if len(numbers):
                basis = block.on_facets(numbers, lumped=lumped)
                if self.thickness is None:
                    integrals = LinearForm(form).assemble(basis)
                else:
                    of_facets = self.thickness[block.rows][block.basis.mesh.f2t[0, numbers]]
                    scaled = LinearForm(lambda v, w: w.thickness * form(v, w))
                    integrals = scaled.assemble(basis, thickness=of_facets[:, None])
                total[block.nodes] += np.asarray(integrals)[block.dofs]
        return total

    def facet_numbers(self, facets: Integers, name: str) -> list[Integers]:
        """scikit-fem's numbers, block by block, of facets that are given by their nodes, corners first.

        Raises
        ------
        InvalidArgumentError
            As in `on_part`.
        """
        mesh = self.blocks[0].basis.mesh
        corners, count = len(mesh.facets), len(mesh.bndelem.doflocs)
        if facets.shape[1] != count:
            raise InvalidArgumentError(
                f"{name} has facets of {facets.shape[1]} nodes; expected {count}, as the cells have"
            )
        keys = [tuple(key) for key in np.sort(facets[:, :corners], axis=1).tolist()]
        found = [self._outer.get(key, -1) for key in keys]
        check_facets(found, facets, name)
        numbers = np.array(found, dtype=np.int64).reshape(-1, 2)
        return [numbers[numbers[:, 0] == k, 1] for k in range(len(self.blocks))]

    @cached_property
    def _outer(self) -> dict[tuple[int, ...], tuple[int, int]]:
        """Block and number of each facet that belongs to one cell only, by its corners."""
        known: dict[tuple[int, ...], tuple[int, int]] = {}
        for k, block in enumerate(self.blocks):
            for key, number in block.outer.items():
                if known.pop(key, None) is None:  # between cells of two kinds
                    known[key] = (k, number)
        return known

    def stiffness(self, lam: float | Floats, mu: float | Floats) -> sp.csc_array:
        """Stiffness of a linear elastic body with these Lame coefficients, of all cells or of each, in plane strain."""
        from skfem import BilinearForm  # as below
        from skfem.helpers import ddot, div, sym_grad
        from skfem.models.elasticity import linear_elasticity

        def energy(u: DiscreteField, v: DiscreteField, w: FormExtraParams) -> Any:
            # as linear_elasticity has it, which makes an identity of every quadrature point and is slow in 3D
            return w.lam * div(u) * div(v) + 2.0 * w.mu * ddot(sym_grad(u), sym_grad(v))

        uniform = np.ndim(lam) == 0 and self.thickness is None
        factor = np.ones(()) if self.thickness is None else self.thickness
        first, second = (np.broadcast_to(factor * value, self.count) for value in (lam, mu))

        def of_block(block: Block) -> Any:
            own = first[block.rows], second[block.rows]
            if block.basis.Nbfun > 24:  # scikit-fem has a long loop over pairs of functions
                return _solid_stiffness(block.basis, *own)
            if uniform and self.shape[1] == 2:
                return linear_elasticity(float(first[0]), float(second[0])).assemble(block.basis)
            return BilinearForm(energy).assemble(block.basis, lam=own[0][:, None], mu=own[1][:, None])

        with np.errstate(over="ignore", invalid="ignore"):  # problems refuse what is not finite
            return self._gathered(of_block)

    @property
    def count(self) -> int:
        """Number of cells."""
        return sum(len(block.rows) for block in self.blocks)

    def volume_forces(self, density: Floats) -> Floats:
        """Nodal forces (N, dimension) of a force per volume that is constant on each cell, (M, dimension)."""
        from skfem import LinearForm  # as below
        from skfem.helpers import dot

        form, total = LinearForm(lambda v, w: dot(w.density, v)), np.zeros(self.shape)
        each = np.asarray(density) if self.thickness is None else self.thickness[:, None] * density
        for block in self.blocks:
            of_block = each[block.rows].T[:, :, None]
            total[block.nodes] += np.asarray(form.assemble(block.basis, density=of_block))[block.dofs]
        return total


def nodal_basis(nodes: Floats, cells: Integers, degree: int = 0, labels: Integers | None = None) -> NodalBasis:
    """Basis of displacements, whose quadrature is that of stiffness matrices, or of a higher degree.

    ``labels`` (M,) are the numbers by which messages name cells; by default their rows.

    Raises
    ------
    InvalidArgumentError
        A node belongs to no cell, a cell is flat, folded or inside out at a corner, or two overlap that share a facet.
    """
    kinds = by_kind(nodes.shape[1], cells)
    used = np.unique(np.concatenate([nodes_of.ravel() for _, nodes_of in kinds]))
    check_every_node_is_used(used, len(nodes), "cells", "cell")
    blocks = tuple(_block(nodes, rows, nodes_of, degree, labels) for rows, nodes_of in kinds)
    refuse_wrong_sides(nodes, cells, labels)
    return NodalBasis(blocks, (nodes.shape[0], nodes.shape[1]))


def _block(points: Floats, rows: Integers, cells: Integers, degree: int, labels: Integers | None) -> Block:
    # scikit-fem takes a while to import and is needed for meshes only
    import skfem
    from skfem.quadrature import get_quadrature

    dimension = points.shape[1]
    kind = KINDS[dimension, cells.shape[1]]
    nodes, local = np.unique(cells, return_inverse=True)
    local = local.reshape(cells.shape)
    # sorted here, so that scikit-fem neither renumbers nor logs
    ordered = np.sort(local, axis=1) if kind.simplex else local
    element = getattr(skfem, kind.element)()
    if kind.places is not None:
        places = kind.places
        ordered = ordered[:, [int(np.argmin(np.linalg.norm(places - place, axis=1))) for place in element.doflocs]]
    order = max(kind.degree, degree)
    wrong = _folded(points[nodes][ordered], element, get_quadrature(element, order)[0])
    if np.any(wrong):
        raise InvalidArgumentError(
            f"{cell_name(int(rows[np.argmax(wrong)]), labels)} is flat, folded or inside out at a corner; expected "
            "proper cells with their nodes in the order of VTK"
        )
    mesh_class = _serendipity() if kind.mesh == "MeshQuadS2" else getattr(skfem, kind.mesh)
    mesh = mesh_class(np.ascontiguousarray(points[nodes].T), np.ascontiguousarray(ordered.T))
    basis = skfem.Basis(mesh, skfem.ElementVector(element), intorder=order)
    dofs = np.empty((len(nodes), dimension), dtype=np.int64)
    dofs[ordered.T] = np.swapaxes(basis.element_dofs.reshape(cells.shape[1], dimension, len(cells)), 1, 2)
    return Block(basis, dofs, nodes, rows, np.unique(cells[:, : kind.corners]))


def facet_basis(basis: CellBasis, facets: Integers, *, lumped: bool = False) -> FacetBasis:
    """scikit-fem's basis on facets; see `NodalBasis.on_part`."""
    from skfem import FacetBasis  # as above

    if lumped and between_corners(basis.elem):
        return FacetBasis(basis.mesh, basis.elem, facets=facets, quadrature=_BETWEEN)
    return FacetBasis(basis.mesh, basis.elem, facets=facets, intorder=5)  # normals of quadratic curved edges


def between_corners(element: object) -> bool:
    """True if facets are triangles of second order, of which the nodes between corners can be in contact."""
    from skfem import ElementTetP2  # as above

    return isinstance(getattr(element, "elem", element), ElementTetP2)


def _solid_stiffness(basis: CellBasis, lam: Floats, mu: Floats) -> sp.coo_array:
    """The stiffness in 3D that the form of the energy gives, for all pairs of functions of a cell at once."""
    # degrees of freedom of a cell are node by node, and a gradient is that of one component
    slopes = np.stack([basis.basis[j][0].grad[0] for j in range(0, basis.Nbfun, 3)])
    nodes, _, cells, points = slopes.shape
    G = slopes.transpose(2, 0, 1, 3).reshape(cells, 3 * nodes, points)
    T = ((G * basis.dx[:, None]) @ G.transpose(0, 2, 1)).reshape(cells, nodes, 3, nodes, 3)
    lam, mu = lam[:, None, None, None, None], mu[:, None, None, None, None]
    K = lam * T + mu * T.transpose(0, 1, 4, 3, 2)
    K += mu * np.einsum("maibi,jk->majbk", T, np.eye(3))
    dofs = basis.element_dofs.T
    places = (np.repeat(dofs, basis.Nbfun, axis=1).ravel(), np.tile(dofs, basis.Nbfun).ravel())
    return sp.coo_array((K.ravel(), places), shape=(basis.N, basis.N))


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


def _folded(corners: Floats, element: Element, quadrature: Floats) -> Mask:
    """Cells whose area or volume vanishes or changes its sign at a corner or a quadrature point."""
    places = np.concatenate([element.refdom.init_refdom()[0], quadrature], axis=1)
    slopes = [np.broadcast_to(element.lbasis(places, i)[1], places.shape) for i in range(corners.shape[1])]
    with np.errstate(all="ignore"):  # what over- or underflows is among them
        values = np.linalg.det(np.einsum("mai,akq->mqik", corners, np.stack(slopes)))
    extents = np.max(np.ptp(corners, axis=1), axis=1) ** corners.shape[2]
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
    dimension, sides, owners = points.shape[1], [], []
    for rows, corners in corners_of(dimension, cells):
        kind = KINDS[dimension, corners.shape[1]]
        facets = corners[:, kind.facets]
        simplex = points[corners[:, SIMPLICES[dimension, kind.corners][0]]]
        turned = np.linalg.det(simplex[:, 1:] - simplex[:, :1]) < 0
        facets[turned] = facets[turned][:, :, ::-1]
        sides.append(facets.reshape(-1, facets.shape[2]))
        owners.append(np.repeat(rows, facets.shape[1]))
    every, owner = np.concatenate(sides), np.concatenate(owners)
    # two cells on either side of a facet go around it in opposite directions, the least node first; edges have two ends
    first = np.argmin(every, axis=1)[:, None]
    along = np.take_along_axis(every, (first + 1) % every.shape[1], axis=1)[:, 0] if dimension == 3 else every[:, 0]
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


def place_of(at: Floats) -> str:
    """A position in words."""
    return f"({', '.join(f'{float(value) + 0.0:.6g}' for value in at)})"


def cell_stresses(problem: AnyProblem, u: ArrayLike) -> Floats:
    """Mean stress of every cell of the body, (M, d, d), for displacements u of shape (n,) [force / length^2].

    ``sigma = lambda tr(epsilon) I + 2 mu epsilon`` with the Lame coefficients that the problem was made with. In 2D
    these are the components in the plane.

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
    if mesh is None or mesh.lame is None:
        raise InvalidArgumentError(
            "the problem has no mesh with Lame coefficients; expected one made by fem.contact_problem, "
            "fem.solid_contact_problem or fem.mesh_problem, or BodyMesh(..., lame=...)"
        )
    moved = mesh.displacements(u)
    body = nodal_basis(mesh.points, mesh.cells)
    dimension = moved.shape[1]
    stresses = np.empty((len(mesh.cells), dimension, dimension))
    for block in body.blocks:
        values = np.empty(block.dofs.size)
        values[block.dofs] = moved[block.nodes]
        gradient: Any = block.basis.interpolate(values).grad  # (d, d, cells, points)
        mean = np.sum(gradient * block.basis.dx, axis=-1) / np.sum(block.basis.dx, axis=-1)
        strain = 0.5 * np.moveaxis(mean + np.swapaxes(mean, 0, 1), -1, 0)
        lam, mu = mesh.lame[block.rows].T[:, :, None, None]
        trace = np.trace(strain, axis1=1, axis2=2)[:, None, None]
        stresses[block.rows] = lam * trace * np.eye(dimension) + 2.0 * mu * strain
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
    from skfem import BilinearForm  # as above
    from skfem.helpers import ddot, dot, grad

    from enumsol.model.problem3d import ContactProblem3D  # not for problems in 2D

    instance_of(problem, ContactProblem3D, "problem")
    if problem.mesh is None or problem.areas is None:
        raise InvalidArgumentError("problem has no mesh or no areas; expected one made of a mesh")

    def product(u: object, v: object, _: object) -> Any:
        return dot(u, v) + ddot(grad(u), grad(v))

    # products of linear functions have degree two: exact on tetrahedra and parallelepipeds
    body = nodal_basis(problem.mesh.points, problem.mesh.cells, degree=2)
    motion = problem.mesh.motion
    G = sp.csc_array(motion.T @ body.matrix(BilinearForm(product)) @ motion)
    return MeshNorms(G, problem.Bn, problem.areas)
