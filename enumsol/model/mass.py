"""The mass of a body: consistent mass of a mesh by shape functions, and the check of a matrix that is given."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from enumsol.errors import InvalidProblemError
from enumsol.model.cells import KINDS, by_kind
from enumsol.support.arguments import shown
from enumsol.support.array_arguments import real_matrix

if TYPE_CHECKING:
    from enumsol.support.array_types import ArrayLike, Floats, Integers

#: Asymmetry, and negative eigenvalues relative to the diagonal, up to this are rounding of the user's assembly.
_ROUNDING = 1e-12


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
    if worst > _ROUNDING * largest:
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
    lifted = sp.csc_array(part + sp.diags_array(1e3 * _ROUNDING * part.diagonal()))
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
    dimension, count = points.shape[1], len(points)
    total = sp.csc_array((count, count))
    for rows, nodes in by_kind(dimension, cells):
        kind = KINDS[dimension, nodes.shape[1]]
        X, W = kind.quadrature(2 * int(np.max(np.sum(kind.powers, axis=1))) + dimension)
        N = kind.values(X)
        J = np.abs(np.linalg.det(np.einsum("mai,akq->mqik", points[nodes], kind.slopes(X))))
        if axisymmetric:
            J = J * 2.0 * np.pi * (points[nodes, 0] @ N)
        own = np.einsum("aq,bq,mq->mab", N, N, J * W * density[rows, None], optimize=True)
        places = np.repeat(nodes, nodes.shape[1], axis=1).ravel(), np.tile(nodes, nodes.shape[1]).ravel()
        total = total + sp.csc_array(sp.coo_array((own.ravel(), places), shape=total.shape))
    return total


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
