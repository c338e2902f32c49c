"""Problems in NumPy archives (.npz); the layout is described in `enumsol.io`."""

from __future__ import annotations

from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from enumsol.errors import InvalidProblemError
from enumsol.io.arrays import FORMAT_VERSION, arrays_of, check_names, layout_of, problem_from_arrays, refusing
from enumsol.support.files import DAMAGE, write_file
from enumsol.support.saved import archive_arrays, check_shape

if TYPE_CHECKING:
    from pathlib import Path

    from enumsol.model.problem3d import AnyProblem
    from enumsol.support.array_types import NDArray

_VERSION = "enumsol_format"
_PARTS = ("data", "indices", "indptr", "shape", "format")


def read(path: Path) -> AnyProblem:
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


def write(problem: AnyProblem, path: Path) -> None:
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
