"""Problems in directories of MatrixMarket files; the layout is described in `enumsol.io`."""

from __future__ import annotations

import json
import re
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from enumsol.errors import InvalidProblemError
from enumsol.io.arrays import LAYOUT_2D, LAYOUT_3D, arrays_of, check_names, layout_of, problem_from_arrays, refusing
from enumsol.support.files import Content, write_files
from enumsol.support.saved import check_shape, is_label, json_from

if TYPE_CHECKING:
    from pathlib import Path

    from enumsol.io.arrays import Layout
    from enumsol.model.problem3d import AnyProblem
    from enumsol.support.array_types import NDArray

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


def read(path: Path) -> AnyProblem:
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
        arrays["node_ids"] = _labels(path / _LABELS)
    return problem_from_arrays(arrays, layout)


def write(problem: AnyProblem, path: Path) -> None:
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


def _labels(file: Path) -> list[Any]:
    with refusing((ValueError, OSError), f"{file.name} is not JSON", "a list of labels"):
        labels = json_from(file.read_bytes())
    if not isinstance(labels, list) or not all(map(is_label, labels)):
        raise InvalidProblemError(f"{file.name} holds something else; expected a list of integers, floats or strings")
    return labels
