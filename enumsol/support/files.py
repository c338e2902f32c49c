"""Files: errors of the operating system as errors of this package, and files of arrays with a report."""

from __future__ import annotations

import errno
import json
import os
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from enumsol.errors import InvalidArgumentError, OutputError

#: Errors of the operating system for a file that can be opened but not written to.
_NO_ROOM = frozenset((errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EPIPE))


@contextmanager
def writing(place: Path, name: str) -> Iterator[None]:
    """A block that writes a file, which the argument ``name`` of a call is.

    Raises
    ------
    OutputError
        There is no space left for it, or the device failed.
    InvalidArgumentError
        No such file can be created.
    """
    try:
        yield
    except OSError as error:
        if error.errno in _NO_ROOM:
            reason = os.strerror(error.errno)  # some libraries replace it by a longer text
            raise OutputError(
                f"{name} {place} cannot be written ({reason}); expected a place with free space"
            ) from error
        raise InvalidArgumentError(
            f"{name} {place} cannot be written ({error.strerror or error}); expected a path for a new file"
        ) from error


def unreadable(place: Path) -> str | None:
    """Why a place is no file that can be read, in the words of a message; None if it is one.

    A pipe is none: what reads it would wait for who writes it.
    """
    try:
        if place.is_dir():
            return "it is a directory"
        if place.exists() and not place.is_file():
            return "it is not a regular file"
        with place.open("rb"):
            return None
    except FileNotFoundError:
        return "there is no such file"
    except OSError as error:
        return f"it cannot be read ({error.strerror or error})"


@contextmanager
def reading(place: Path, content: str, writer: str) -> Iterator[None]:
    """A block that reads a file of ``content`` that ``writer`` wrote.

    Raises
    ------
    InvalidArgumentError
        The file cannot be read, or holds something else.
    """
    try:
        yield
    except InvalidArgumentError:
        raise
    except OSError as error:
        reason = error.strerror or error
        raise InvalidArgumentError(f"{place} cannot be read ({reason}); expected a file of {writer}") from error
    except (LookupError, ValueError, TypeError, AttributeError, EOFError, zipfile.BadZipFile) as error:
        raise InvalidArgumentError(f"{place} does not hold {content} ({error}); expected a file of {writer}") from error


def write_arrays(place: Path, version: int, report: Mapping[str, Any], arrays: Mapping[str, Any]) -> None:
    """Write arrays, and a report that JSON can hold, to a .npz file (errors as of ``writing``)."""
    import numpy as np  # what writes other files does without

    meta = np.array(json.dumps({"format": version, **report}))
    with writing(place, "path"), place.open("wb") as stream:
        np.savez_compressed(stream, allow_pickle=False, meta=meta, **arrays)


def read_arrays(place: Path, version: int, names: Sequence[str]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Report and arrays of a file of ``write_arrays``, within ``reading``.

    Raises
    ------
    InvalidArgumentError
        The file has another version.
    """
    import numpy as np  # as above

    with np.load(place, allow_pickle=False) as data:
        report = json.loads(str(data["meta"]))
        arrays = {name: data[name] for name in names}
    if report["format"] != version:
        raise InvalidArgumentError(f"{place} has format {report['format']!r}; this version reads format {version}")
    return report, arrays
