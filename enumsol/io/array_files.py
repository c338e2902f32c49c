"""Problems in directories of MatrixMarket files, NumPy archives and fclib files; `enumsol.io` describes the layouts."""

from __future__ import annotations

import json
import math
import re
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from enumsol.errors import InvalidProblemError, MissingDependencyError
from enumsol.io.arrays import (
    FORMAT_VERSION,
    LAYOUT_2D,
    LAYOUT_3D,
    arrays_of,
    check_names,
    layout_of,
    problem_from_arrays,
    refusing,
)
from enumsol.model.problem import ContactProblem
from enumsol.support.files import DAMAGE, Content, write_file, write_files
from enumsol.support.saved import archive_arrays, check_shape, check_size, is_label, json_from

if TYPE_CHECKING:
    from pathlib import Path

    import h5py

    from enumsol.io.arrays import Layout
    from enumsol.model.problem3d import AnyProblem, ContactProblem3D
    from enumsol.support.array_types import Floats, NDArray

    Problem = ContactProblem | ContactProblem3D

#: Most entries of a table that is stored densely, for every byte of the directory: most of them may be left out.
_OF_TABLE = 16
#: Numbers to the end of a file; without backtracking.
_NUMBERS = re.compile(
    rb"\s*+(?:[+-]?(?:\d++(?:\.\d*+)?+(?:e[+-]?\d++)?+|\.\d++(?:e[+-]?\d++)?+|nan|inf(?:inity)?+)(?:\s++|\Z))*+\Z",
    re.IGNORECASE,
)
_LABELS = "node_ids.json"
#: Digits after which a float64 is read back as itself.
_DIGITS = 17


def read_directory(path: Path) -> AnyProblem:
    """The problem in a directory of .mtx files."""
    files = {file.stem: file for file in sorted(path.glob("*.mtx")) if not file.name.startswith("_")}
    if not files:
        raise InvalidProblemError("the directory has no MatrixMarket files; expected A.mtx, Bn.mtx, Bt.mtx and f.mtx")
    layout = layout_of(files)
    check_names(files, layout, ".mtx")
    with refusing((OSError,), "a file in it cannot be read", "readable files"):
        room = sum(file.stat().st_size for file in files.values())
    arrays: dict[str, Any] = {name: _values(name, file, layout, room) for name, file in files.items()}
    if (path / _LABELS).exists():
        arrays["node_ids"] = _labels_of_file(path / _LABELS)
    return problem_from_arrays(arrays, layout)


def write_directory(problem: AnyProblem, path: Path) -> None:
    """Write a problem into a directory, which is made if need be; an earlier problem there is replaced."""
    from scipy.io import mmwrite  # slow to import

    columns = {name: array if array.ndim == 2 else array[:, None] for name, array in arrays_of(problem).items()}
    try:
        labels = json.dumps(list(problem.node_ids))
        kept = json.loads(labels) == list(problem.node_ids)
    except (TypeError, ValueError):
        kept = False
    if not kept:
        raise InvalidProblemError("node_ids cannot be kept in node_ids.json; expected integers, floats or strings")
    stale = [file for file in path.glob("*.mtx") if file.stem not in columns and not file.name.startswith("_")]
    names = [file.stem for file in stale]
    layout = LAYOUT_2D if all(name in LAYOUT_2D.known for name in names) else LAYOUT_3D
    check_names([*layout.required, *names], layout, ".mtx")
    files: dict[Path, Content] = {path / _LABELS: labels + "\n"}
    for name, matrix in columns.items():
        text = BytesIO()  # scipy's writer ignores errors of the disk
        mmwrite(text, matrix, field="real", precision=_DIGITS)
        files[path / f"{name}.mtx"] = text.getvalue()
    is_new = not path.exists()
    path.mkdir(exist_ok=True)
    try:
        write_files(files)
    except OSError:
        if is_new:
            path.rmdir()
        raise
    for file in stale:  # of an earlier problem
        file.unlink()


def _values(name: str, file: Path, layout: Layout, room: int) -> sp.coo_array | NDArray[Any]:
    from scipy.io import mminfo, mmread  # slow to import

    with refusing(
        (ValueError, OverflowError, OSError), f"{file.name} is not a readable MatrixMarket file", "a complete one"
    ):
        content = file.read_bytes()
        rows, columns, entries = mminfo(BytesIO(content))[:3]
        _check(content, rows, columns, entries, None if name in layout.matrices else _OF_TABLE * room)
        check_shape("it", (rows, columns), room)
        if name not in layout.matrices and name not in layout.tables and 1 not in (rows, columns):
            raise InvalidProblemError(f"{file.name} holds a {rows} x {columns} matrix; expected a vector in one column")
        values: Any = mmread(BytesIO(content), spmatrix=False)
    if name in layout.matrices:
        return values
    dense = np.asarray(values.toarray() if sp.issparse(values) else values)
    if name in layout.tables:
        return dense
    return dense.reshape(()) if name in layout.broadcast and dense.size == 1 else dense.ravel()


def _check(content: bytes, rows: int, columns: int, entries: int, largest: int | None) -> None:
    """Refuse what scipy's reader crashes on or takes memory for: words that are no numbers, and counts out of range."""
    start = 0
    while content[start : start + 1] in (b"%", b"\n", b"\r"):
        start = content.find(b"\n", start) + 1 or len(content)
    if _NUMBERS.match(content, start) is None:
        raise ValueError("a word in it is not a number")
    if entries > len(content) or (largest is not None and rows * columns > largest):
        raise ValueError(f"it cannot hold {rows} x {columns} entries")


def _labels_of_file(file: Path) -> list[Any]:
    with refusing((ValueError, OSError), f"{file.name} is not JSON", "a list of labels"):
        labels = json_from(file.read_bytes())
    if not isinstance(labels, list) or not all(map(is_label, labels)):
        raise InvalidProblemError(f"{file.name} holds something else; expected a list of integers, floats or strings")
    return labels


# -- NumPy archives ----------------------------------------------------------------------------------------------------

_VERSION = "enumsol_format"
_PARTS = ("data", "indices", "indptr", "shape", "format")


def read_archive(path: Path) -> AnyProblem:
    """The problem in a .npz file."""
    arrays = _load(path)
    version = arrays.pop(_VERSION, np.array(FORMAT_VERSION))
    if version.ndim or version.dtype.kind not in "iu" or not 1 <= int(version) <= FORMAT_VERSION:
        raise InvalidProblemError(
            f"{_VERSION} is {version}; expected a whole number up to {FORMAT_VERSION} (is it from a newer enumsol?)"
        )
    named: dict[str, Any] = dict(arrays)
    layout = layout_of(named)
    room = sum(array.size for array in arrays.values())
    for name in layout.matrices:
        parts = {part: named.pop(f"{name}_{part}") for part in _PARTS if f"{name}_{part}" in named}
        if parts and name in named:
            raise InvalidProblemError(f"{name} is given as a matrix and in sparse parts; expected only one of them")
        if parts:
            named[name] = _matrix(name, parts, room)
    check_names(named, layout)
    if "node_ids" in named:
        named["node_ids"] = _labels(named["node_ids"])
    return problem_from_arrays(named, layout)


def write_archive(problem: AnyProblem, path: Path) -> None:
    """Write a problem with its matrices in sparse parts."""
    arrays: dict[str, NDArray[Any]] = {_VERSION: np.array(FORMAT_VERSION)}
    for name, value in arrays_of(problem).items():
        if sp.issparse(value):
            arrays |= {f"{name}_{part}": np.asarray(getattr(value, part)) for part in _PARTS}
        else:
            arrays[name] = value
    labels = np.array(problem.node_ids)
    if labels.dtype.kind not in "iufU" or _labels(labels) != list(problem.node_ids):
        raise InvalidProblemError(
            "node_ids cannot be kept in a .npz file; expected labels that are all integers, all floats or all strings"
        )
    arrays["node_ids"] = labels
    packed = BytesIO()
    np.savez_compressed(packed, allow_pickle=False, **arrays)
    write_file(path, packed.getvalue(), "path")


def _load(path: Path) -> dict[str, NDArray[Any]]:
    damaged = refusing(
        (*DAMAGE, OSError), "it is not a readable .npz archive", "a complete one, by numpy.savez or write_problem"
    )
    with path.open("rb") as file, damaged:
        if file.read(2) != b"PK":
            raise InvalidProblemError("it is not a .npz archive despite its name; expected what numpy.savez writes")
        file.seek(0)
        arrays = archive_arrays(file)
    for name, array in arrays.items():
        if array is None:
            raise InvalidProblemError(
                f"{name} is a pickled Python object, which is never loaded; expected an array of numbers, or for a "
                f"sparse matrix its parts {', '.join(f'{name}_{part}' for part in _PARTS)}"
            )
        if not isinstance(array, np.ndarray):
            raise InvalidProblemError(f"its member {name} is not a NumPy array; expected arrays only")
    return arrays


def _matrix(name: str, parts: dict[str, NDArray[Any]], room: int) -> sp.csc_array | sp.csr_array:
    missing = [f"{name}_{part}" for part in _PARTS if part not in parts]
    if missing:
        raise InvalidProblemError(
            f"{', '.join(missing)} is missing of the sparse parts of {name}; "
            f"expected {', '.join(f'{name}_{part}' for part in _PARTS)}"
        )
    kind, shape = str(parts["format"]), parts["shape"]
    if kind not in ("csc", "csr"):
        raise InvalidProblemError(f'{name}_format is {kind!r}; expected "csc" or "csr"')
    if shape.shape != (2,) or shape.dtype.kind not in "iu":
        raise InvalidProblemError(f"{name}_shape is {shape.tolist()}; expected two whole numbers")
    for part in ("indices", "indptr"):
        if parts[part].ndim != 1 or parts[part].dtype.kind not in "iu":
            raise InvalidProblemError(f"{name}_{part} is not a list of whole numbers; expected those of scipy.sparse")
    if parts["data"].ndim != 1 or parts["data"].dtype.kind not in "iufb":
        raise InvalidProblemError(f"{name}_data is not a list of real numbers; expected those of scipy.sparse")
    build = sp.csc_array if kind == "csc" else sp.csr_array
    with refusing((ValueError,), f"{name} cannot be made", "a matrix of this problem"):
        check_shape(f"{name}_shape", map(int, shape), room)
    with refusing((ValueError,), f"the sparse parts of {name} do not fit together", f"those of one {kind} matrix"):
        matrix = build((parts["data"], parts["indices"], parts["indptr"]), shape=(int(shape[0]), int(shape[1])))
        matrix.check_format(full_check=True)
    return matrix


def _labels(array: NDArray[Any]) -> list[Any]:
    if array.ndim != 1 or array.dtype.kind not in "iufU":
        raise InvalidProblemError(
            f"node_ids has shape {array.shape} and type {array.dtype}; expected (p,) integers, floats or strings"
        )
    return list(array.tolist())


# -- fclib -------------------------------------------------------------------------------------------------------------
# Problems in the HDF5 format of the Frictional Contact Library (fclib), in two and three dimensions.
#
# The layout is that of fclib.h (github.com/FrictionalContactLibrary/fclib): a group ``/fclib_global`` or
# ``/fclib_local``
# with ``spacedim``, sparse matrices as groups of ``m``, ``n``, ``nz``, ``nzmax``, ``p``, ``i``, ``x``, and a group
# ``vectors``. There r and u hold normal and one or two tangential components contact by contact, the gap u_N >= 0
# opens,
# r_N >= 0 presses, and friction acts against u_T, so that its (u_N, u_T) are our (-u_n, -u_t) and its r our lambda.
#
# - global: M v = H r + f, u = H' v + w. Read as A = M, [Bn; Bt] = -H', gap and slip_offset from w, friction mu.
# - local: u = W r + q. It knows no displacements of a body; for u = -W v it is the contact problem with A = W,
#   [Bn; Bt] = W and load -q: nothing is inverted, forces and contact displacements are those of the file, while the
#   problem's u means nothing. W must be positive definite.
#
# mu is isotropic and depends neither on alpha nor on the slip. Equality constraints (G, b; V, R, s) are refused, and
# so is what leads to another file: external storage, links, virtual datasets.

#: Endings of fclib files.
FCLIB = (".h5", ".hdf5")
#: Components of a contact, by the dimension of space, in words.
_COMPONENTS = {2: "two", 3: "three"}
#: What the compliance of a local problem stands for.
_READ_AS = {2: "A, Bn and Bt", 3: "A, Bn, Bt1 and Bt2"}


def read_fclib(path: Path) -> Problem:
    """The global or local problem in an fclib file; the global one if there are both."""
    h5py = MissingDependencyError.imported("h5py", "fclib files", "fclib")
    try:
        file = h5py.File(path, "r")
    except OSError as error:
        raise InvalidProblemError("it is not a readable HDF5 file; expected an fclib problem, complete") from error
    # h5py reports damage by any of these
    damage = (OSError, KeyError, ValueError, RuntimeError, TypeError, MemoryError)
    with file, refusing(damage, "its HDF5 data cannot be read", "a complete fclib problem"):
        if "fclib_global" in file:
            return _global(child(file, "fclib_global"))
        if "fclib_local" in file:
            return _local(child(file, "fclib_local"))
        raise InvalidProblemError(
            f"it holds {', '.join(file) or 'nothing'}; expected a group named fclib_global or fclib_local"
        )


def write_fclib(problem: Problem, path: Path) -> None:
    """Write a global problem; node labels, coordinates, areas and meshes have no place in it."""
    h5py = MissingDependencyError.imported("h5py", "fclib files", "fclib")
    if not problem.held:
        raise InvalidProblemError(
            "the body is held by nothing, and fclib has no place for rigid_modes; "
            "expected a body that is held, or another format (.npz, MatrixMarket directory)"
        )
    if problem.depends_on_alpha:
        raise InvalidProblemError(
            "friction or load depends on alpha, which fclib cannot hold; "
            "expected a constant friction and no load_slope, or another format (.npz, MatrixMarket directory)"
        )
    offsets = np.column_stack([problem.gap, problem.slip_offset])
    dimension = offsets.shape[1]
    interleaved = np.arange(dimension * problem.p).reshape(dimension, -1).T.ravel()
    H = sp.csc_array(-problem.contact_rows[interleaved].T)
    mu = _isotropic(problem)
    written = BytesIO()
    with h5py.File(written, "w") as file:
        group = file.create_group("fclib_global")
        group["spacedim"] = np.array([dimension], dtype=np.int32)
        _write_matrix(group.create_group("M"), problem.A)
        _write_matrix(group.create_group("H"), H)
        vectors = group.create_group("vectors")
        vectors["f"] = problem.f
        vectors["w"] = offsets.ravel()
        vectors["mu"] = mu
        group.create_group("info")["title"] = np.bytes_(f"contact problem with {problem.p} nodes, written by enumsol")
    write_file(path, written.getvalue(), "path")


def _isotropic(problem: Problem) -> Floats:
    """The coefficient of every node."""
    if isinstance(problem, ContactProblem):
        F: Floats = problem.friction
        return F
    if problem.depends_on_solution:
        raise InvalidProblemError(
            "friction depends on the slip, which fclib cannot hold; expected constant coefficients"
        )
    F1, F2 = problem.friction
    if not np.array_equal(F1, F2):
        raise InvalidProblemError("friction is orthotropic, which fclib cannot hold; expected F1 = F2 at every node")
    return np.asarray(F1)


def _global(group: h5py.Group) -> Problem:
    dimension = _dimension(group)
    if "G" in group:
        raise InvalidProblemError("it has equality constraints (G, b); expected a problem without them")
    vectors = child(group, "vectors")
    f, w = (numbers(vectors, name) for name in ("f", "w"))
    M, H = _hdf5_matrix(group, "M", f.size, symmetric=True), _hdf5_matrix(group, "H", f.size + w.size)
    if H.shape[0] != M.shape[0] or H.shape[1] % dimension or not H.shape[1]:
        raise InvalidProblemError(
            f"H has shape {H.shape}; expected {M.shape[0]} rows and {_COMPONENTS[dimension]} columns a contact"
        )
    w, mu = _vector(vectors, "w", H.shape[1]), _vector(vectors, "mu", H.shape[1] // dimension)
    return _problem(M, sp.csr_array(-H.T), _vector(vectors, "f", M.shape[0]), w, mu, dimension)


def _local(group: h5py.Group) -> Problem:
    dimension = _dimension(group)
    if "V" in group or "R" in group:
        raise InvalidProblemError("it has equality constraints (V, R, s); expected a problem without them")
    vectors = child(group, "vectors")
    W = _hdf5_matrix(group, "W", numbers(vectors, "q").size, symmetric=True)
    if W.shape[0] != W.shape[1] or W.shape[0] % dimension:
        raise InvalidProblemError(
            f"W has shape {W.shape}; expected a square matrix with {_COMPONENTS[dimension]} rows a contact"
        )
    q, mu = _vector(vectors, "q", W.shape[0]), _vector(vectors, "mu", W.shape[0] // dimension)
    try:
        return _problem(W, sp.csr_array(W), -q, np.zeros(len(q)), mu, dimension)
    except InvalidProblemError as error:
        raise InvalidProblemError(f"its W, read as {_READ_AS[dimension]}, cannot be used: {error}") from error


def _problem(
    A: sp.csc_array, B: sp.csr_array, f: NDArray[Any], w: NDArray[Any], mu: NDArray[Any], dimension: int
) -> Problem:
    """The problem whose rows and offsets come contact by contact."""
    if dimension == 2:
        return ContactProblem(A, B[0::2], B[1::2], f, gap=w[0::2], friction=mu, slip_offset=w[1::2])
    from enumsol.model.problem3d import ContactProblem3D  # not for problems in 2D

    offsets = w.reshape(-1, 3)
    return ContactProblem3D(
        A, B[0::3], B[1::3], B[2::3], f, gap=offsets[:, 0], friction=(mu, mu), slip_offset=offsets[:, 1:]
    )


def _dimension(group: h5py.Group) -> int:
    spacedim = _integer(group, "spacedim")
    if spacedim not in _COMPONENTS:
        raise InvalidProblemError(f"it is a problem in {spacedim} dimensions; expected spacedim = 2 or 3")
    return spacedim


def _hdf5_matrix(group: h5py.Group, name: str, room: int, *, symmetric: bool = False) -> sp.csc_array:
    parts = child(group, name)
    m, n, nz = (_integer(parts, key) for key in ("m", "n", "nz"))
    p, i, x = (numbers(parts, key).ravel() for key in ("p", "i", "x"))
    with refusing((ValueError, TypeError), f"{name} is not a sparse matrix", "consistent m, n, nz, p, i, x"):
        check_shape("it", (m, n), room + p.size + x.size)
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


def _write_matrix(group: h5py.Group, matrix: sp.csc_array) -> None:
    for key, value in (("nzmax", matrix.nnz), ("m", matrix.shape[0]), ("n", matrix.shape[1]), ("nz", -1)):
        group[key] = np.array([value], dtype=np.int32)
    group["p"] = matrix.indptr.astype(np.int32)
    group["i"] = matrix.indices.astype(np.int32)
    group["x"] = matrix.data


def child(group: h5py.Group, name: str) -> Any:
    """A group or dataset of an HDF5 file that stands in the file itself.

    Raises
    ------
    InvalidProblemError
        It is missing, or the file only leads to it by a link.
    """
    if name not in group and group.get(name, getlink=True, default=None) is None:
        found = ", ".join(group) or "nothing"
        raise InvalidProblemError(f"{group.name}/{name} is missing (found {found}); expected an fclib problem")
    link = type(group.get(name, getlink=True)).__name__
    if link != "HardLink":
        raise InvalidProblemError(
            f"{group.name}/{name} is a link ({link}), which is never followed; expected the data in the file itself"
        )
    return group[name]


def numbers(group: h5py.Group, name: str) -> NDArray[Any]:
    """The numbers of a dataset that stand in the file itself, of a size that its bytes can have.

    Raises
    ------
    InvalidProblemError
        They are in another file, or no numbers; or there is no such dataset.
    ValueError
        It claims to be larger than it can be.
    """
    data = child(group, name)
    if not hasattr(data, "dtype") or data.dtype.kind not in "iuf":
        raise InvalidProblemError(f"{group.name}/{name} holds no numbers; expected a dataset of them")
    if data.external or data.is_virtual:
        raise InvalidProblemError(
            f"{group.name}/{name} has its numbers in another file, which is never read; expected them in this one"
        )
    stored, item = data.id.get_storage_size(), data.dtype.itemsize
    for shape in (data.shape or (), data.chunks or ()):
        check_size(f"{group.name}/{name}", item * math.prod(shape), stored)
    return np.asarray(data[()])


def _integer(group: h5py.Group, name: str) -> int:
    value = numbers(group, name)
    if value.size != 1 or value.dtype.kind not in "iu":
        raise InvalidProblemError(f"{group.name}/{name} is {value.tolist()}; expected one whole number")
    return int(value.ravel()[0])


def _vector(group: h5py.Group, name: str, size: int) -> NDArray[Any]:
    value = numbers(group, name)
    if value.shape != (size,):
        raise InvalidProblemError(f"{group.name}/{name} has shape {value.shape}; expected ({size},)")
    return value
