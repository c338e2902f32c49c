"""Discretization of a problem, as far as it is kept: the mesh, for pictures, files and norms, and its mass."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from enumsol.errors import InvalidArgumentError, InvalidProblemError
from enumsol.model.cells import KINDS, by_kind, numbers_of_nodes
from enumsol.support.arguments import shown
from enumsol.support.array_arguments import array_of, real_array, real_matrix, vector_of
from enumsol.support.array_types import ArrayLike, Floats, Integers
from enumsol.support.immutable import Immutable, SealedMatrix, sealed

#: An asymmetry of A or of the mass up to this fraction of the largest entry is rounding of the user's assembly and is
#: averaged away; so are negative eigenvalues of the mass up to a thousand times as much, relative to its diagonal.
ASYMMETRY_TOLERANCE = 1e-12


class BodyMesh(Immutable):
    """The mesh that a problem was made of; the displacements of its nodes are ``motion @ u + offset``.

    Parameters
    ----------
    points : (N, d) array_like
        Positions of the nodes, d = 2 or 3 [length].
    cells : (M, k) array_like of int
        Triangles (3 or 6 nodes), quadrilaterals (4, 8 or 9), tetrahedra (4 or 10), wedges (6 or 18) and hexahedra (8 or
        27), in the order of VTK; cells of fewer nodes than others repeat their last.
    motion : (d N, n) array_like or sparse
        Row ``d node + component`` gives that component of the node's displacement from u, in global axes; its transpose
        takes nodal forces to the problem's right-hand side. Each entry of u is the component of a node, or what several
        move by, as the motion of a rigid part.
    offset : (N, d) array_like or None
        Prescribed displacements [length]; None: no node is moved.
    facets : (k, m) array_like of int or None
        In 3D, and of pairs of bodies, the contact surface: corners, in 3D counterclockwise as seen from outside, then
        the nodes between them and inside.
    rows : (k,) array_like of int or None
        Where contact rows stand for patches, the row of each facet (-1: held); None where they stand for nodes.
    lame : (2,) or (M, 2) array_like or None
        Lame coefficients of all cells or of each, from which stresses follow (`fem.cell_stresses`); kept as (M, 2)
        [force / length^2].
    elasticity : (s, s), (s s,), (M, s, s) or (M, s s) array_like or None
        Moduli of all cells or of each, where Lame coefficients do not tell them; kept as (M, s, s). s = 3 in 2D (xx,
        yy, xy), s = 4 of axisymmetric bodies (along the radius, the axis, around it, and shear), s = 6 in 3D (xx, yy,
        zz, xy, xz, yz); strains of shear are angles [force / length^2].
    initial_stress : (M, s) array_like or None
        Mean stress of every cell with no displacement, of a change of temperature [force / length^2].
    stress_slope : (M, s) array_like or None
        Its derivative with respect to the last entry of u, which is alpha.

    Raises
    ------
    InvalidProblemError
        An array is not of that form.

    Examples
    --------
    >>> import enumsol
    >>> mesh = enumsol.gallery.clamped_block(2, 1).mesh
    >>> mesh.points.shape, mesh.cells.shape, mesh.motion.shape
    ((6, 2), (4, 3), (12, 8))
    """

    def __init__(
        self,
        points: ArrayLike,
        cells: ArrayLike,
        motion: ArrayLike | sp.sparray | sp.spmatrix,
        offset: ArrayLike | None = None,
        facets: ArrayLike | None = None,
        rows: ArrayLike | None = None,
        lame: ArrayLike | None = None,
        elasticity: ArrayLike | None = None,
        initial_stress: ArrayLike | None = None,
        stress_slope: ArrayLike | None = None,
    ) -> None:
        self.points = sealed(real_array(points, "mesh_points"))
        if self.points.ndim != 2 or self.points.shape[1] not in (2, 3):
            raise InvalidProblemError(f"mesh_points has shape {self.points.shape}; expected (N, 2) or (N, 3)")
        count, d = self.points.shape
        self.cells = _elements(cells, "mesh_cells", numbers_of_nodes(d), count)
        self._motion = SealedMatrix.of(sp.csr_array(real_matrix(motion, "mesh_motion")))
        if self._motion.shape[0] != d * count:
            raise InvalidProblemError(
                f"mesh_motion has shape {self._motion.shape}; expected {d} N = {d * count} rows, {d} for each node"
            )
        self.offset = None if offset is None else _of(offset, "mesh_offset", (count, d), f"(N, {d}) = ({count}, {d})")
        of_facets = numbers_of_nodes(d - 1)
        self.facets = None if facets is None else _elements(facets, "mesh_facets", of_facets, count)
        self.rows = None if rows is None else sealed(_numbers(rows, "mesh_rows", None, least=-1))
        if self.rows is not None and (self.facets is None or self.rows.shape != self.facets.shape[:1]):
            raise InvalidProblemError(
                f"mesh_rows has shape {self.rows.shape}; expected (k,), one for each of mesh_facets"
            )
        self.lame = None if lame is None else _lame(lame, len(self.cells))
        self.elasticity = None if elasticity is None else _elasticity(elasticity, len(self.cells), d)
        shape = len(self.cells), 4 if self.axisymmetric else {2: 3, 3: 6}[d]
        self.initial_stress, self.stress_slope = (
            None if values is None else _of(values, name, shape, f"(M, s) = {shape}")
            for values, name in ((initial_stress, "mesh_stress"), (stress_slope, "mesh_stress_slope"))
        )
        self._freeze()

    @property
    def size(self) -> float:
        """The largest extent of the body [length]."""
        return float(np.max(np.ptp(self.points, axis=0)))

    @property
    def has_material(self) -> bool:
        """True if stresses follow from displacements."""
        return self.lame is not None or self.elasticity is not None

    @property
    def axisymmetric(self) -> bool:
        """True if x is the distance from an axis around which the body turns."""
        return self.elasticity is not None and self.elasticity.shape[1] == 4

    def mass(self) -> sp.csc_array:
        """Consistent mass of the degrees of freedom for a density of one, (n, n) [length^d]."""
        of_nodes = consistent_mass(self.points, self.cells, np.ones(len(self.cells)), axisymmetric=self.axisymmetric)
        return sp.csc_array(self.motion.T @ sp.kron(of_nodes, sp.eye_array(self.points.shape[1])) @ self.motion)

    @classmethod
    def of_dofs(
        cls, points: ArrayLike, cells: ArrayLike, dofs: ArrayLike, *more: ArrayLike | None, **named: ArrayLike | None
    ) -> BodyMesh:
        """The mesh of a problem whose entries of u are the components ``d node + component`` in ``dofs``, (n,).

        The other arguments are offset, facets, rows and lame.

        Raises
        ------
        InvalidProblemError
            They are not distinct components, or another array is not of the form above.
        """
        size = real_array(points, "mesh_points").size
        columns = _numbers(dofs, "mesh_dofs", size)
        if columns.ndim != 1 or len(np.unique(columns)) != len(columns):
            raise InvalidProblemError(
                f"mesh_dofs has shape {columns.shape} or repeats a number; expected (n,) distinct ones"
            )
        count = len(columns)
        motion = sp.csr_array((np.ones(count), (columns, np.arange(count))), shape=(size, count))
        return cls(points, cells, motion, *more, **named)

    @property
    def motion(self) -> sp.csr_array:
        """Displacements of the nodes from u, sparse (d N, n); a new object, whose parts are read-only."""
        return self._motion.matrix()

    @property
    def dofs(self) -> Integers:
        """The component ``d node + component`` that each entry of u is, (n,).

        Raises
        ------
        InvalidArgumentError
            An entry is none: supports turn the axes of its node.
        """
        columns = sp.csc_array(self.motion)
        if np.any(np.diff(columns.indptr) != 1) or np.any(columns.data != 1.0):
            raise InvalidArgumentError("the mesh has nodes whose axes are turned; expected entries of u along x, y, z")
        return np.asarray(columns.indices, dtype=np.int64)

    @cached_property
    def acting(self) -> sp.csr_array:
        """Forces on nodes that stand for forces on u, sparse (d N, n): ``motion.T @ acting`` is the identity.

        A force on the component of a node acts on this node alone; others are spread over nodes that move with them.
        """
        motion = self.motion
        lone = np.flatnonzero(np.diff(motion.indptr) == 1)
        lone = lone[motion.data[motion.indptr[lone]] == 1.0]
        if self.facets is not None:  # of nodes that move as one, those of the contact surface
            lone = lone[np.argsort(~np.isin(lone // self.points.shape[1], self.facets), kind="stable")]
        columns, first = np.unique(motion.indices[motion.indptr[lone]], return_index=True)
        own = sp.csr_array((np.ones(len(columns)), (lone[first], columns)), shape=motion.shape)
        others = np.setdiff1d(np.arange(motion.shape[1]), columns)
        if not len(others):
            return own
        from scipy.sparse.csgraph import connected_components  # scipy's solvers come with it

        part = sp.csc_array(motion)[:, others]
        # where they are coupled, as motions of one rigid part, by their pseudoinverse
        count, of = connected_components(part.T @ part, directed=False)
        for k in range(count):
            group = np.flatnonzero(of == k)
            block = part[:, group]
            nodes = np.unique(block.indices)
            spread = np.linalg.pinv(block[nodes].toarray()).T
            places = (np.repeat(nodes, len(group)), np.tile(others[group], len(nodes)))
            own = own + sp.csr_array((spread.ravel(), places), shape=motion.shape)
        return sp.csr_array(own)

    def directions(self, rows: sp.csr_array) -> Floats:
        """Directions (p, d) in global axes of rows (p, n) that stand for the displacement of one point each.

        Where the contact surface is known, what rows have beside it does not count: the other body of a pair.
        """
        d = self.points.shape[1]
        own = np.ones(len(self.points))
        if self.facets is not None:
            own[:] = 0.0
            own[self.facets] = 1.0
        axes = np.kron(own[:, None], np.eye(d))
        return np.asarray(rows @ (self.acting.T @ axes))

    def displacements(self, u: ArrayLike) -> Floats:
        """Displacement of every node, shape (N, d), for u of shape (n,) [length].

        Raises
        ------
        InvalidArgumentError
            u is not that.
        """
        moved = np.asarray(self.motion @ vector_of(u, "u", self._motion.shape[1])).reshape(self.points.shape)
        return moved if self.offset is None else moved + self.offset

    def check(self, n: int, p: int, dimension: int) -> BodyMesh:
        """The mesh, which has to be one of a problem with n degrees of freedom and p contact rows."""
        if self.points.shape[1] != dimension:
            raise InvalidProblemError(f"mesh_points has shape {self.points.shape}; expected (N, {dimension})")
        if self._motion.shape[1] != n:
            raise InvalidProblemError(f"mesh moves by {self._motion.shape[1]} degrees of freedom; expected n = {n}")
        if self.rows is not None:
            _numbers(self.rows, "mesh_rows", p, least=-1)
        return self

    def __repr__(self) -> str:
        return f"BodyMesh of {len(self.points)} nodes and {len(self.cells)} cells"


def _numbers(value: ArrayLike, name: str, count: int | None, least: int = 0) -> Integers:
    array = real_array(value, name)
    most = 2**53 if count is None else count
    if np.any(array != np.round(array)) or np.any(array < least) or np.any(array >= most):
        found = f"{least} or more" if count is None else f"{least} .. {count - 1}"
        raise InvalidProblemError(f"{name} holds other numbers than {found}; expected whole ones in that range")
    return array.astype(np.int64)


def _of(value: ArrayLike, name: str, shape: tuple[int, ...], expected: str) -> Floats:
    return sealed(array_of(value, name, shape, expected, InvalidProblemError))


def _lame(value: ArrayLike, count: int) -> Floats:
    array = real_array(value, "mesh_lame")
    if array.shape not in ((2,), (count, 2)):
        raise InvalidProblemError(f"mesh_lame has shape {array.shape}; expected (2,) or (M, 2) = ({count}, 2)")
    return sealed(np.tile(array, (count, 1)) if array.ndim == 1 else array)


def _elasticity(value: ArrayLike, count: int, dimension: int) -> Floats:
    array = real_array(value, "mesh_elasticity")
    for size in {2: (3, 4), 3: (6,)}[dimension]:
        if array.size in (size**2, count * size**2) and array.shape[-1] in (size, size**2):
            return sealed(np.array(np.broadcast_to(array.reshape(-1, size, size), (count, size, size))))
    expected = {2: "s = 3 or 4", 3: "s = 6"}[dimension]
    raise InvalidProblemError(f"mesh_elasticity has shape {array.shape}; expected (M, s, s) with {expected}")


def _elements(value: ArrayLike, name: str, sizes: tuple[int, ...], count: int) -> Integers:
    array = _numbers(value, name, count)
    if array.ndim != 2 or array.shape[1] not in sizes:
        raise InvalidProblemError(
            f"{name} has shape {array.shape}; expected (k, m) with m among {', '.join(map(str, sizes))}"
        )
    return sealed(array)


# -- mass --------------------------------------------------------------------------------------------------------------
# The mass of a body: consistent mass of a mesh by shape functions, and the check of a matrix that is given.


def checked_mass(mass: ArrayLike | sp.sparray | sp.spmatrix, A: sp.csc_array, modes: Floats) -> sp.csc_array:
    """A mass matrix for a stiffness, (n, n).

    Parameters
    ----------
    mass : (n, n) array_like or sparse
    A : (n, n) csc_array
    modes : (n, r) array
        Rigid modes of the body.

    Raises
    ------
    InvalidProblemError
        It is not symmetric and positive semidefinite, or some rigid mode has no mass.
    """
    M, n = real_matrix(mass, "mass"), A.shape[0]
    if M.shape != (n, n):
        raise InvalidProblemError(f"mass has shape {M.shape}; expected (n, n) = ({n}, {n})")
    largest = float(np.max(np.abs(M.data), initial=0.0))
    if not largest:
        raise InvalidProblemError("mass is zero; expected a body with a mass")
    worst = float(np.max(np.abs(sp.csc_array(M - M.T).data), initial=0.0))
    if worst > ASYMMETRY_TOLERANCE * largest:
        raise InvalidProblemError(
            f"mass is not symmetric: max|M - M'| = {worst:.3g} where max|M| = {largest:.3g}; "
            "expected a symmetric matrix"
        )
    M = sp.csc_array(0.5 * M + 0.5 * M.T) if worst else M
    M.sort_indices()
    diagonal = M.diagonal()
    if np.any(diagonal < 0):
        row = int(np.argmin(diagonal))
        raise InvalidProblemError(
            f"mass is not positive semidefinite: its diagonal entry {row} is {shown(float(diagonal[row]))}; "
            "expected entries >= 0"
        )
    if not _semidefinite(M, diagonal):
        raise InvalidProblemError("mass is not positive semidefinite; expected a mass matrix M >= 0")
    if modes.shape[1] and np.linalg.eigvalsh(modes.T @ (M @ modes))[0] <= 0:
        raise InvalidProblemError("mass is zero for some of rigid_modes; expected A + mu M > 0 for mu > 0")
    return M


def _semidefinite(M: sp.csc_array, diagonal: Floats) -> bool:
    """True if a matrix has no eigenvalue below zero, up to rounding and relative to its diagonal."""
    from enumsol.condensation.factorization import Factorization  # scipy's solvers come with the first use

    own = np.flatnonzero(diagonal > 0)
    if sp.csr_array(M)[np.flatnonzero(diagonal == 0)].nnz:
        return False
    part = sp.csc_array(sp.csr_array(M)[own][:, own])
    lifted = sp.csc_array(part + sp.diags_array(1e3 * ASYMMETRY_TOLERANCE * part.diagonal()))
    try:
        Factorization(lifted).check_positive_definite()
    except InvalidProblemError:
        return False
    return True


def consistent_mass(points: Floats, cells: Integers, density: Floats, *, axisymmetric: bool = False) -> sp.csc_array:
    """Consistent mass of one component of the nodes, the same for all, (N, N).

    Parameters
    ----------
    points : (N, d) array
    cells : (M, k) int array, in the order of VTK
    density : (M,) array
        Mass per volume, or in 2D per area, of every cell.
    axisymmetric : bool
        x is the distance from the axis, and the mass is that of the whole circumference.
    """
    dimension, parts = points.shape[1], []
    for rows, nodes in by_kind(dimension, cells):
        kind = KINDS[dimension, nodes.shape[1]]
        X, W = kind.quadrature(2 * int(np.max(np.sum(kind.powers, axis=1))) + dimension)
        N = kind.values(X)
        J = np.abs(np.linalg.det(np.einsum("mai,akq->mqik", points[nodes], kind.slopes(X))))
        if axisymmetric:
            J = J * 2.0 * np.pi * (points[nodes, 0] @ N)
        parts.append((nodes, np.einsum("aq,bq,mq->mab", N, N, J * W * density[rows, None], optimize=True)))
    return assembled(parts, len(points))


def assembled(parts: Iterable[tuple[Integers, Floats]], size: int) -> sp.csc_array:
    """Sum (size, size) of matrices of cells: parts have the rows (m, s) of their cells, and matrices (m, s, s)."""
    rows, columns, data = [np.zeros(0, dtype=np.int64)], [np.zeros(0, dtype=np.int64)], [np.zeros(0)]
    for own, K in parts:
        rows.append(np.repeat(own, own.shape[1], axis=1).ravel())
        columns.append(np.tile(own, own.shape[1]).ravel())
        data.append(K.ravel())
    places = (np.concatenate(rows), np.concatenate(columns))
    return sp.csc_array((np.concatenate(data), places), shape=(size, size))


def mass_fingerprint(mass: sp.csc_array) -> str:
    """SHA-256 of a mass: a name, n, and row, column and value of every entry that is not zero, column by column."""
    entries = sp.coo_array(sp.csc_array(mass))
    kept = entries.data != 0
    rows, columns, values = entries.coords[0][kept], entries.coords[1][kept], entries.data[kept]
    order = np.lexsort((rows, columns))
    digest = hashlib.sha256(b"enumsol mass 1" + np.array(mass.shape[0], "<i8").tobytes())
    for part, kind in ((rows, "<i8"), (columns, "<i8"), (values, "<f8")):
        digest.update(part[order].astype(kind).tobytes())
    return digest.hexdigest()
