"""Contents of files, within bounds: JSON, TOML, tables, archives of arrays, and the kinds of what was saved.

A file may hold anything. What it says of its size is compared with its bytes before memory is asked for. All functions
raise ValueError, which those who read a file turn into a sentence about it (``support.files.reading``).
"""

from __future__ import annotations

import io
import json
import math
import os
import re
import tomllib
import zipfile
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np

from enumsol.support.arguments import shown

#: Most bytes of a JSON file, which become some twenty times as many in memory, and of a TOML file, which has a
#: thousandth of that where it describes a problem.
LARGEST_JSON, LARGEST_TOML = 1 << 30, 1_000_000
#: Most columns of a table; with two a contact node enough for any body.
MOST_COLUMNS = 100_000
#: A key of TOML of so many parts, for which Python's parser takes a time that grows with the cube of their number.
_LONG_KEY = re.compile(r"""(?<![\w-])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){64}""", re.ASCII)


# -- texts -----------------------------------------------------------------------------------------------------------


def json_from(content: bytes | str) -> Any:
    """Content of a JSON text; names that are given twice, deep nesting and very long numbers are refused."""
    if len(content) > LARGEST_JSON:
        raise ValueError(f"it has more than {LARGEST_JSON} bytes")
    try:
        return _DECODER.decode(content.decode("utf-8") if isinstance(content, bytes) else content)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"it is not JSON: {error}") from error


def toml_from(content: bytes) -> dict[str, Any]:
    """Content of a TOML text; keys of very many parts and deep nesting are refused."""
    if len(content) > LARGEST_TOML:
        raise ValueError(f"it has more than {LARGEST_TOML} bytes")
    text = content.decode("utf-8")
    if _LONG_KEY.search(text) is not None:
        raise ValueError("a key in it has more than 64 parts with dots between them")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None


def table_text(source: str | os.PathLike[str] | IO[Any]) -> IO[str]:
    """The text of a table, from the name of a CSV file or from an open one; very many columns are refused."""
    content = Path(source).read_bytes() if isinstance(source, (str, os.PathLike)) else source.read()
    text = content.decode("utf-8-sig") if isinstance(content, bytes) else content
    columns = 1 + max((line.count(",") for line in text.splitlines()), default=0)
    if columns > MOST_COLUMNS:
        raise ValueError(f"it has {columns} columns, more than {MOST_COLUMNS}")
    return io.StringIO(text)


def _whole(text: str) -> int:
    if len(text) > 300:  # float64 goes to 309
        raise ValueError(f"a whole number in it has {len(text)} digits")
    return int(text)


def once_each(pairs: Iterable[tuple[str, Any]]) -> dict[str, Any]:
    """The object of a JSON text, whose names are all different."""
    given = list(pairs)
    found = dict(given)
    if len(found) != len(given):
        raise ValueError("an object gives a name twice")
    return found


_DECODER = json.JSONDecoder(parse_int=_whole, object_pairs_hook=once_each)


# -- arrays ----------------------------------------------------------------------------------------------------------


def archive_arrays(file: IO[bytes]) -> dict[str, Any]:
    """Arrays of a .npz file, but for names that begin with an underscore; None is a pickled object, never loaded."""
    pickled = _check_archive(file)
    file.seek(0)
    with np.load(file, allow_pickle=False) as archive:
        names = [name for name in archive.files if not name.startswith("_")]
        return {name: None if f"{name}.npy" in pickled else archive[name] for name in names}


def _check_archive(file: IO[bytes]) -> set[str]:
    """Names of the members with pickled objects."""
    pickled = set()
    with zipfile.ZipFile(file) as archive:
        members = archive.infolist()
        for member in members:
            if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
                raise ValueError(f"{member.filename} is compressed as numpy does not")
            check_size(member.filename, member.file_size, member.compress_size)
            if member.filename.endswith(".npy"):
                with archive.open(member) as content:
                    if _is_pickled(member, content):
                        pickled.add(member.filename)
        check_size("it", sum(member.file_size for member in members), file.seek(0, io.SEEK_END))
    return pickled


def _is_pickled(member: zipfile.ZipInfo, content: IO[bytes]) -> bool:
    """True if an array is one of objects; refused where it is larger than the member that holds it."""
    if not content.peek(6).startswith(np.lib.format.MAGIC_PREFIX):  # type: ignore[attr-defined]
        return False  # no array, which is said where it is read
    readers = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
    version = np.lib.format.read_magic(content)
    if version not in readers:
        raise ValueError(f"{member.filename} is written in a format {version} of arrays")
    shape, _, dtype = readers[version](content)
    if not dtype.hasobject and (min(shape, default=0) < 0 or math.prod(shape) * dtype.itemsize > member.file_size):
        raise ValueError(f"{member.filename} declares the shape {shape}, and has {member.file_size} bytes")
    return bool(dtype.hasobject)


def check_size(name: str, size: int, stored: int) -> None:
    """Refuse what claims to be so many bytes, and cannot be, or should not, by those that are stored of it.

    A byte of deflate stands for 1032 at most. What is large and compresses further than 200 times is made to be
    expanded, or is better kept in sparse parts.
    """
    if size > 1032 * stored + (1 << 12) or (size > 1 << 31 and size > 200 * stored):
        raise ValueError(f"{name} stands for {size} bytes, of which {stored} are stored")


def check_shape(name: str, shape: Iterable[int], room: int) -> None:
    """Refuse a sparse matrix with more rows or columns than a file has room for: each has a number in it."""
    rows, columns = shape
    if max(rows, columns) > room:
        raise ValueError(f"{name} has the shape {(rows, columns)}, for which there are too few numbers in the file")


# -- kinds -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Maybe:
    """A value of this kind, or none."""

    kind: Kind


class Array:
    """An array, or lists of numbers in lists, of this shape; None stands for any length."""

    def __init__(self, *shape: int | None) -> None:
        self.shape = shape

    def __call__(self, value: object) -> bool:
        """True if a value is such an array."""
        if isinstance(value, (list, np.ndarray)):
            array = np.asarray(value)  # ValueError where lists have different lengths
            if not array.size:
                return None in self.shape or 0 in self.shape
            same = len(array.shape) == len(self.shape) and all(
                wanted in (None, size) for size, wanted in zip(array.shape, self.shape, strict=True)
            )
            return same and array.dtype.kind in "iuf"
        return False


#: Kinds of values, see `check_kind`.
Kind = type | set[str] | range | Maybe | Array | list[Any] | tuple[Any, ...] | dict[str, Any] | Callable[[Any], bool]
_FRACTION = re.compile(r"-?[0-9]{1,4300}(/0*[1-9][0-9]{0,4299})?", re.ASCII)


def is_number(value: object) -> bool:
    """True if a value is a number, which may be infinite or nan."""
    return type(value) in (int, float)


def is_fraction(value: object) -> bool:
    """True if a value is the text of a fraction within bounds, such as "-8/3"."""
    return type(value) is str and _FRACTION.fullmatch(value) is not None


def is_label(value: object) -> bool:
    """True if a value may be the label of a node."""
    return type(value) in (int, float, str)


def check_kind(value: Any, kind: Kind, where: str) -> None:
    """Refuse a value of a saved structure that is of another kind than what is written there.

    Parameters
    ----------
    value : what JSON gave
    kind : any
        A type (float: any finite number); a set of texts; a range of whole numbers; a predicate; `Maybe`; `Array`; a
        list with the kind of all items; a tuple with the kinds of each; an object with the kinds by name, where
        a name that ends in "?" may be missing.
    where : what messages call the value

    Raises
    ------
    ValueError
        It says where the first such value stands, and what it is.
    """
    match kind:
        case Maybe():
            if value is not None:
                check_kind(value, kind.kind, where)
            return
        case dict():
            _check_is(type(value) is dict, value, where)
            for name, part in kind.items():
                plain = name.removesuffix("?")
                if plain in value:
                    check_kind(value[plain], part, f"{where}.{plain}")
                elif plain == name:
                    raise ValueError(f"{where} lacks {name}")
            return
        case list() | tuple():
            _check_is(type(value) is list and (isinstance(kind, list) or len(value) == len(kind)), value, where)
            for k, item in enumerate(value):
                check_kind(item, kind[0 if isinstance(kind, list) else k], f"{where}[{k}]")
            return
        case set():
            fits = type(value) is str and value in kind
        case range():
            fits = type(value) is int and value in kind
        case type():
            fits = is_number(value) and -math.inf < value < math.inf if kind is float else type(value) is kind
        case _:
            fits = kind(value)
    _check_is(fits, value, where)


def _check_is(fits: bool, value: object, where: str) -> None:
    if not fits:
        raise ValueError(f"{where} is {shown(value)}")
