"""Problems in the HDF5 format of the Frictional Contact Library (fclib), in two dimensions.

The layout is that of fclib.h (github.com/FrictionalContactLibrary/fclib): a group ``/fclib_global`` or ``/fclib_local``
with ``spacedim``, sparse matrices as groups of ``m``, ``n``, ``nz``, ``nzmax``, ``p``, ``i``, ``x``, and a group
``vectors``. There r and u hold (normal, tangential) contact by contact, the gap u_N >= 0 opens, r_N >= 0 presses, and
friction acts against u_T, so its (u_N, u_T) are (-u_n, -u_t) here, and its r is lambda.

- global: M v = H r + f, u = H' v + w. Read as A = M, [Bn; Bt] = -H', gap and slip_offset from w, friction mu.
- local: u = W r + q. It knows no displacements of a body; for u = -W v it is the contact problem with A = W,
  [Bn; Bt] = W and load -q: nothing is inverted, forces and contact displacements are those of the file, while the
  problem's u means nothing. W must be positive definite.

mu does not depend on alpha. Equality constraints (G, b; V, R, s) and three dimensions are refused.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from enumsol.errors import InvalidProblemError, MissingDependencyError
from enumsol.io.layouts import refusing
from enumsol.problem import ContactProblem

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from enumsol.problem3d import ContactProblem3D

SUFFIXES = (".h5", ".hdf5")


def read(path: Path) -> ContactProblem:
    """The global or local problem in an fclib file; the global one if there are both."""
    h5py = _h5py()
    try:
        file = h5py.File(path, "r")
    except OSError as error:
        raise InvalidProblemError("it is not a readable HDF5 file; expected an fclib problem, complete") from error
    # h5py reports damage by any of these
    damage = (OSError, KeyError, ValueError, RuntimeError, TypeError)
    with file, refusing(damage, "its HDF5 data cannot be read", "a complete fclib problem"):
        if "fclib_global" in file:
            return _global(file["fclib_global"])
        if "fclib_local" in file:
            return _local(file["fclib_local"])
        raise InvalidProblemError(
            f"it holds {', '.join(file) or 'nothing'}; expected a group named fclib_global or fclib_local"
        )


def write(problem: ContactProblem | ContactProblem3D, path: Path) -> None:
    """Write a global problem; node labels and coordinates are not stored."""
    if not isinstance(problem, ContactProblem):
        raise InvalidProblemError(
            "fclib files of problems in 3D are not written yet; expected another format (.npz, MatrixMarket directory)"
        )
    h5py = _h5py()
    F0, F1 = problem.friction
    if np.any(F1) or (problem.load_slope is not None and np.any(problem.load_slope)):
        raise InvalidProblemError(
            "friction or load depends on alpha, which fclib cannot hold; "
            "expected a constant friction and no load_slope, or another format (.npz, MatrixMarket directory)"
        )
    rows = sp.csr_array(sp.vstack([problem.Bn, problem.Bt], format="csr"))
    interleaved = np.arange(2 * problem.p).reshape(2, -1).T.ravel()
    H = sp.csc_array(-rows[interleaved].T)
    with h5py.File(path, "w") as file:
        group = file.create_group("fclib_global")
        group["spacedim"] = np.array([2], dtype=np.int32)
        _write_matrix(group.create_group("M"), problem.A)
        _write_matrix(group.create_group("H"), H)
        vectors = group.create_group("vectors")
        vectors["f"] = problem.f
        vectors["w"] = np.column_stack([problem.gap, problem.slip_offset]).ravel()
        vectors["mu"] = F0
        group.create_group("info")["title"] = np.bytes_(f"contact problem with {problem.p} nodes, written by enumsol")


def _h5py() -> Any:
    try:
        import h5py  # an extra
    except ImportError as error:
        raise MissingDependencyError.of("fclib files", "h5py", "fclib") from error
    return h5py


def _global(group: Any) -> ContactProblem:
    _two_dimensional(group)
    if "G" in group:
        raise InvalidProblemError("it has equality constraints (G, b); expected a problem without them")
    M, H = _matrix(group, "M", symmetric=True), _matrix(group, "H")
    if H.shape[0] != M.shape[0] or H.shape[1] % 2 or not H.shape[1]:
        raise InvalidProblemError(f"H has shape {H.shape}; expected {M.shape[0]} rows and two columns a contact")
    vectors = _child(group, "vectors")
    w, mu = _vector(vectors, "w", H.shape[1]), _vector(vectors, "mu", H.shape[1] // 2)
    B = sp.csr_array(-H.T)
    return ContactProblem(
        M,
        B[0::2],
        B[1::2],
        _vector(vectors, "f", M.shape[0]),
        gap=w[0::2],
        friction=(mu, 0.0),
        slip_offset=w[1::2],
    )


def _local(group: Any) -> ContactProblem:
    _two_dimensional(group)
    if "V" in group or "R" in group:
        raise InvalidProblemError("it has equality constraints (V, R, s); expected a problem without them")
    W = _matrix(group, "W", symmetric=True)
    if W.shape[0] != W.shape[1] or W.shape[0] % 2:
        raise InvalidProblemError(f"W has shape {W.shape}; expected a square matrix with two rows a contact")
    vectors = _child(group, "vectors")
    q, mu = _vector(vectors, "q", W.shape[0]), _vector(vectors, "mu", W.shape[0] // 2)
    rows = sp.csr_array(W)
    try:
        return ContactProblem(W, rows[0::2], rows[1::2], -q, friction=(mu, 0.0))
    except InvalidProblemError as error:
        raise InvalidProblemError(f"its W, read as A, Bn and Bt, cannot be used: {error}") from error


def _two_dimensional(group: Any) -> None:
    spacedim = _integer(group, "spacedim")
    if spacedim != 2:
        raise InvalidProblemError(f"it is a problem in {spacedim} dimensions; expected spacedim = 2")


def _matrix(group: Any, name: str, *, symmetric: bool = False) -> sp.csc_array:
    parts = _child(group, name)
    m, n, nz = (_integer(parts, key) for key in ("m", "n", "nz"))
    p, i, x = (np.asarray(_child(parts, key)[()]).ravel() for key in ("p", "i", "x"))
    with refusing((ValueError, TypeError), f"{name} is no sparse matrix", "consistent m, n, nz, p, i, x"):
        if nz >= 0:
            row, column = _triplets(name, p[:nz], i[:nz], (m, n), symmetric=symmetric)
            return sp.csc_array(sp.coo_array((x[:nz], (row, column)), shape=(m, n)))
        if nz not in (-1, -2):
            raise InvalidProblemError(f"{name}/nz is {nz}; expected -1 (columns), -2 (rows) or the number of triplets")
        matrix = (sp.csc_array if nz == -1 else sp.csr_array)((x, i, p), shape=(m, n))
        matrix.check_format(full_check=True)
        return sp.csc_array(matrix)


def _triplets(
    name: str, p: NDArray[Any], i: NDArray[Any], shape: tuple[int, int], *, symmetric: bool
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Rows and columns of triplets: fclib.h calls p the rows, CSparse, which fclib casts to, calls them the columns."""
    fits = [
        (row, column)
        for row, column in ((i, p), (p, i))
        if not len(row) or (np.max(row) < shape[0] and np.max(column) < shape[1])
    ]
    if not fits or (len(fits) == 2 and not symmetric and not np.array_equal(p, i)):
        raise InvalidProblemError(
            f"{name} is stored as triplets whose rows and columns cannot be told apart; "
            "expected compressed columns or rows"
        )
    return fits[0]


def _write_matrix(group: Any, matrix: sp.csc_array) -> None:
    for key, value in (("nzmax", matrix.nnz), ("m", matrix.shape[0]), ("n", matrix.shape[1]), ("nz", -1)):
        group[key] = np.array([value], dtype=np.int32)
    group["p"] = matrix.indptr.astype(np.int32)
    group["i"] = matrix.indices.astype(np.int32)
    group["x"] = matrix.data


def _child(group: Any, name: str) -> Any:
    if name not in group:
        found = ", ".join(group) or "nothing"
        raise InvalidProblemError(f"{group.name}/{name} is missing (found {found}); expected an fclib problem")
    return group[name]


def _integer(group: Any, name: str) -> int:
    value = np.asarray(_child(group, name)[()])
    if value.size != 1 or value.dtype.kind not in "iu":
        raise InvalidProblemError(f"{group.name}/{name} is {value.tolist()}; expected one whole number")
    return int(value.ravel()[0])


def _vector(group: Any, name: str, size: int) -> NDArray[Any]:
    value = np.asarray(_child(group, name)[()])
    if value.shape != (size,):
        raise InvalidProblemError(f"{group.name}/{name} has shape {value.shape}; expected ({size},)")
    return value
