"""Points that an audit is given: followed paths, frames and CSV files, sorted into runs with their row numbers."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import IO, TYPE_CHECKING, Any, Literal, cast

import numpy as np

from enumsol.continuation.path import Path
from enumsol.errors import InvalidArgumentError
from enumsol.model.problem import ContactProblem
from enumsol.support.messages import counted
from enumsol.support.saved import table_text

if TYPE_CHECKING:
    import pandas as pd

    from enumsol.model.problem3d import AnyProblem
    from enumsol.support.array_types import Floats, Indices


#: How the names of columns tell the contact nodes apart; "auto" takes the one for which all columns are there.
Columns = Literal["auto", "rows", "labels"]
_FORCES = ("lambda_n", "lambda_t")
_FORCES_3D = ("lambda_n", "lambda_t1", "lambda_t2")
#: Names of columns that an error lists.
_LISTED = 12


@dataclass(frozen=True)
class PointRun:
    """Points of one path in the order in which they were computed.

    Attributes
    ----------
    path : int or str
        What the source calls the path; 0 where it has one path without a name.
    rows : (m,) array
        Row of every point in its frame or file, counted from 0 as ``frame.iloc`` does (row 0 of a file is the first
        one below the names of the columns), or its number in its Path.
    alpha : (m,) array
    forces : (m, 2p) array
        lambda_n and lambda_t [force]; in 3D (m, 3p): lambda_n and both components of lambda_t.
    rigid : (m, r) array
        Of a body that nothing holds, coordinates of its rigid displacement; r is 0 for others.
    """

    path: Any
    rows: Indices
    alpha: Floats
    forces: Floats
    rigid: Floats


def read_points(
    source: object, problem: AnyProblem, *, columns: Columns = "auto", name: str | None = None
) -> tuple[PointRun, ...]:
    """The runs of points in a source; none where it holds no point.

    Parameters
    ----------
    source : Path, sequence of Path, pandas.DataFrame, file name or open text file of a CSV, or list of PointRun
        Frames and files have the columns alpha, lambda_n_X and lambda_t_X (in 3D lambda_t1_X and lambda_t2_X), one X
        a contact node, and may name several paths in a column ``path``; of a body that nothing holds rigid_0, rigid_1,
        .. as well. Others are ignored.
    problem : ContactProblem or ContactProblem3D
    columns : {"auto", "rows", "labels"}
        Whether X is the node's row number or its label in ``problem.node_ids``. "auto": the one for which all columns
        are there; a source that has all columns for both, and different ones for a node, is refused.
    name : str, optional
        What errors call the source; default: the file's name, or "path" for what is no file.

    Raises
    ------
    InvalidArgumentError
        The source is of another kind or cannot be read, a column is missing or named ambiguously, a value is not a
        finite number, or the path of a row is not named.
    """
    if columns not in ("auto", "rows", "labels"):
        raise InvalidArgumentError(f"columns is {columns!r}; expected 'auto', 'rows' or 'labels'")
    if isinstance(source, Path):
        source = [source]
    if isinstance(source, Sequence) and not isinstance(source, str):
        if all(isinstance(item, PointRun) for item in source):
            for run in source:
                _check_nodes(run.forces.shape[1] // len(_forces(problem)), problem.p)
                _check_modes(run.rigid.shape[1], problem)
            return tuple(source)
        if all(isinstance(item, Path) for item in source):
            return tuple(_from_path(k, path, problem) for k, path in enumerate(source))
    if isinstance(source, (str, os.PathLike)) or hasattr(source, "read"):
        place = os.fspath(source) if isinstance(source, (str, os.PathLike)) else getattr(source, "name", "the file")
        name = name or str(place)
        source = _read_csv(cast("str | IO[str]", source), name)
    if hasattr(source, "columns") and hasattr(source, "iloc"):
        return _from_frame(cast("pd.DataFrame", source), problem, columns, name or "path")
    kind = type(source).__name__
    raise InvalidArgumentError(f"path is a {kind}; expected a Path, several of them, a DataFrame or a CSV file")


def _from_path(number: int, path: Path, problem: AnyProblem) -> PointRun:
    _check_nodes(path.lambda_n.shape[1], problem.p)
    found, wanted = ("3D" if solid else "2D" for solid in (path.lambda_t.ndim == 3, len(_forces(problem)) == 3))
    if found != wanted:
        raise InvalidArgumentError(f"path {number} is one in {found}; expected a path in {wanted}, as the graph is")
    parts = [path.lambda_t] if path.lambda_t.ndim == 2 else [path.lambda_t[:, :, 0], path.lambda_t[:, :, 1]]
    forces = np.hstack([path.lambda_n, *parts])
    rigid = np.zeros((len(path), 0)) if path.rigid_coordinates is None else path.rigid_coordinates
    _check_modes(rigid.shape[1], problem)
    finite = np.isfinite(path.alpha) & np.all(np.isfinite(np.hstack([forces, rigid])), axis=1)
    if not np.all(finite):
        raise InvalidArgumentError(
            f"path {number} is not finite at point {int(np.argmin(finite))}; expected finite numbers"
        )
    return PointRun(number, np.arange(len(path)), path.alpha, forces, rigid)


def _forces(problem: AnyProblem) -> tuple[str, ...]:
    """Names of the forces of a contact node."""
    return _FORCES if isinstance(problem, ContactProblem) else _FORCES_3D


def _check_nodes(found: int, p: int) -> None:
    if found != p:
        raise InvalidArgumentError(f"path has {found} contact nodes; expected the graph's {p}")


def _check_modes(found: int, problem: AnyProblem) -> None:
    if found != problem.modes.r:
        raise InvalidArgumentError(
            f"path has a rigid displacement of {counted(found, 'coordinate')}; expected the graph's {problem.modes.r}"
        )


def _read_csv(source: str | os.PathLike[str] | IO[str], name: str) -> pd.DataFrame:
    """The texts of the file, unconverted: files and frames are converted in one place."""
    import pandas as pd  # slow to import, used here only

    try:
        # a header of its own: a row longer than the names would otherwise shift the columns under them
        table = pd.read_csv(table_text(source), header=None, dtype=str, na_filter=False, skipinitialspace=True)
    except OSError as error:
        raise InvalidArgumentError(
            f"{name} cannot be read ({error.strerror or error}); expected a CSV file of points"
        ) from error
    except ValueError as error:
        why = str(error).strip().removeprefix("Error tokenizing data. C error: ")
        raise InvalidArgumentError(f"{name}: {why}; expected a CSV file of points, with commas") from error
    frame = table.iloc[1:].reset_index(drop=True)
    frame.columns = pd.Index([str(title).strip() for title in table.iloc[0]])
    return frame


def _from_frame(frame: pd.DataFrame, problem: AnyProblem, columns: Columns, name: str) -> tuple[PointRun, ...]:
    titles = _titles(frame, problem, columns, name)
    values = np.column_stack([_numbers(frame, title, name) for title in titles])
    rigid = _rigid(frame, problem, name)
    return tuple(
        PointRun(path, rows, values[rows, 0], values[rows, 1:], rigid[rows])
        for path, rows in _rows_by_path(frame, name).items()
    )


def _rigid(frame: pd.DataFrame, problem: AnyProblem, name: str) -> Floats:
    """Columns with the coordinates of the rigid displacement, (rows, r)."""
    known, titles = list(frame.columns), [f"rigid_{mode}" for mode in range(problem.modes.r)]
    for title in titles:
        if known.count(title) != 1:
            raise InvalidArgumentError(
                f"{name} has {known.count(title) or 'no'} column{'s' if title in known else ''} {title!r}; expected "
                "one for every coordinate of the rigid displacement of a body that nothing holds"
            )
    columns = [_numbers(frame, title, name) for title in titles]
    return np.reshape(columns, (len(titles), len(frame))).T


# -- names of columns --------------------------------------------------------------------------------------------------


def _titles(frame: pd.DataFrame, problem: AnyProblem, columns: Columns, name: str) -> list[str]:
    """Names of the columns with alpha, lambda_n and lambda_t of the nodes in the order of their rows."""
    known = [title if isinstance(title, str) else repr(title) for title in frame.columns]
    ways = _ways(problem, columns, name)
    lacking = {way: [title for title in titles if title not in known] for way, titles in ways.items()}
    whole = [way for way in ways if not lacking[way]]
    if not whole:
        least = min(ways, key=lambda way: len(lacking[way]))
        expected = " or ".join(f"{_span(ways[way])} by {_MEANING[way]}" for way in ways)
        raise InvalidArgumentError(
            f"{name} has no column {lacking[least][0]!r}; expected {expected}; found {_listed(known)}"
        )
    if len(whole) > 1:
        raise InvalidArgumentError(
            f"{name} has columns that fit the nodes' row numbers ({_span(ways['rows'])}) as well as their labels "
            f"({_span(ways['labels'])}), and these differ; expected columns=rows or columns=labels to say which"
        )
    titles = ways[whole[0]]
    count = Counter(known)
    twice = [title for title in titles if count[title] > 1]
    if twice:
        raise InvalidArgumentError(f"{name} has {count[twice[0]]} columns {twice[0]!r}; expected one")
    return titles


_MEANING = {"rows": "row number", "labels": "label"}


def _ways(problem: AnyProblem, columns: Columns, name: str) -> dict[str, list[str]]:
    """The admissible ways to name the nodes, with all names of columns; one where both are the same."""
    rows = [str(row) for row in range(problem.p)]
    labels = [str(label) for label in problem.node_ids]
    distinct = len(set(labels)) == len(labels)
    if columns == "labels" and not distinct:
        raise InvalidArgumentError(f"{name}: columns=labels, but two labels are the same text; expected columns=rows")
    ways = {"rows": rows} if columns != "labels" else {}
    if columns != "rows" and distinct and labels not in ways.values():
        ways["labels"] = labels
    return {
        way: ["alpha", *(f"{force}_{node}" for force in _forces(problem) for node in nodes)]
        for way, nodes in ways.items()
    }


def _span(titles: Sequence[str]) -> str:
    """Names of columns, those between the first and the last node of many left out."""
    alpha = titles[0]
    parts = [list(part) for _, part in groupby(titles[1:], key=lambda title: title.split("_", 2)[1])]
    p = len(parts[0])
    return ", ".join([alpha, *(", ".join(part) if p <= 3 else f"{part[0]}, .., {part[-1]}" for part in parts)])


def _listed(known: Sequence[str]) -> str:
    more = f" and {len(known) - _LISTED} more" if len(known) > _LISTED else ""
    return (", ".join(known[:_LISTED]) or "none") + more


# -- cells -------------------------------------------------------------------------------------------------------------


def _numbers(frame: pd.DataFrame, title: str, name: str) -> Floats:
    """A column as finite floats."""
    column = frame[title]
    if column.dtype.kind in "iuf":
        values = column.to_numpy(dtype=np.float64, na_value=np.nan)
    else:
        values = np.array([_number(cell, f"{name}: {title}", row) for row, cell in enumerate(column)], dtype=np.float64)
    finite = np.isfinite(values)
    if not np.all(finite):
        row = int(np.argmin(finite))
        found = "empty or nan" if np.isnan(values[row]) else values[row]
        raise InvalidArgumentError(f"{name}: {title} is not finite in row {row} ({found}); expected a finite number")
    return values


def _number(cell: float | str, what: str, row: int) -> float:
    if _empty(cell):
        return np.nan
    try:
        return float(cell)
    except (TypeError, ValueError):
        raise InvalidArgumentError(f"{what} is not numeric in row {row} ({str(cell)!r}); expected a number") from None


def _empty(cell: float | str) -> bool:
    if isinstance(cell, str):
        return not cell.strip()
    import pandas as pd  # slow to import, used here only

    return bool(pd.api.types.is_scalar(cell) and pd.isna(cell))


def _rows_by_path(frame: pd.DataFrame, name: str) -> dict[Any, Indices]:
    """Rows of every path, paths in the order of their first rows."""
    if "path" not in frame.columns:
        return {0: np.arange(len(frame))} if len(frame) else {}
    if list(frame.columns).count("path") > 1:
        raise InvalidArgumentError(f"{name} has several columns 'path'; expected one")
    cells = frame["path"].tolist()
    unnamed = [row for row, cell in enumerate(cells) if _empty(cell)]
    if unnamed:
        # whether it belongs to the path above or to none is not guessed
        more = f" and {len(unnamed) - 1} more" if len(unnamed) > 1 else ""
        raise InvalidArgumentError(
            f"{name}: path is empty in row {unnamed[0]}{more}; expected the name of its path in every row, or no "
            "column 'path' for a single one"
        )
    rows: dict[Any, list[int]] = {}
    for row, path in enumerate(_names(cells)):
        rows.setdefault(path, []).append(row)
    return {path: np.array(members) for path, members in rows.items()}


def _names(cells: Sequence[Any]) -> list[int] | list[str]:
    """Names of paths: int where all are whole numbers (a frame may hold them as floats, a file as texts), else text."""
    texts = [str(int(cell)) if isinstance(cell, float) and cell.is_integer() else str(cell).strip() for cell in cells]
    numbers = [int(text) if text.removeprefix("-").isdecimal() else None for text in texts]
    whole = [number for number, text in zip(numbers, texts, strict=True) if number is not None and str(number) == text]
    return whole if len(whole) == len(texts) else texts
