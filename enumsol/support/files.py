"""Files: errors of the operating system as errors of this package, and files of arrays with a report."""

from __future__ import annotations

import contextlib
import errno
import io
import json
import os
import secrets
import struct
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from enum import Enum
from pathlib import Path
from typing import Any

from enumsol.errors import InvalidArgumentError, OutputError
from enumsol.support.messages import shortened

#: Errors of the operating system for a file that can be opened but not written to.
_NO_ROOM = frozenset((errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EPIPE))


#: What Python and its libraries raise on files that are damaged or are something else.
DAMAGE = (
    ArithmeticError,
    AssertionError,
    AttributeError,
    EOFError,
    LookupError,
    MemoryError,
    RuntimeError,
    SyntaxError,
    TypeError,
    ValueError,
    struct.error,
    zipfile.BadZipFile,
    zlib.error,
)


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


#: Content of a file, or a function that writes it there.
Content = bytes | str | Callable[[Path], object]


def write_files(files: Mapping[Path, Content]) -> None:
    """Write files, of which none is changed unless all can be written; within ``writing``.

    Each is written beside its place and renamed, with the mode and the owner of the file that it replaces. What is no
    regular file (a pipe, a device, or the process's own stdout) is written where it is, and a link is followed.
    """
    made: dict[Path, Path] = {}
    try:
        for place, content in files.items():
            target = Path(os.path.realpath(place))
            if _is_written_in_place(place, target):
                _write(place, content)
            else:
                made[target] = beside = target.with_name(f".{secrets.token_hex(8)}.part")
                _write_beside(beside, target, content)
        for target, beside in made.items():
            beside.replace(target)
    finally:
        for beside in made.values():
            beside.unlink(missing_ok=True)


def write_file(place: Path, content: Content, name: str) -> None:
    """Write one file, which the argument ``name`` of a call is (see ``write_files``; errors as of ``writing``)."""
    with writing(place, name):
        write_files({place: content})


def _is_written_in_place(place: Path, target: Path) -> bool:
    """True if a file cannot be replaced by another one; PermissionError where it may not be written at all."""
    try:
        status = place.stat()
    except FileNotFoundError:
        return False
    if not os.access(place, os.W_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    streams = []
    for number in (0, 1, 2):
        with contextlib.suppress(OSError):  # it is closed
            streams.append(os.fstat(number))
    is_open = any(os.path.samestat(status, stream) for stream in streams)
    return is_open or not place.is_file() or not os.access(target.parent, os.W_OK)


def _write(place: Path, content: Content) -> None:
    if callable(content):
        content(place)
    else:
        place.write_bytes(content.encode(errors="backslashreplace") if isinstance(content, str) else content)


def _write_beside(beside: Path, target: Path, content: Content) -> None:
    _write(beside, content)
    with beside.open("rb+") as file:
        os.fsync(file.fileno())  # some systems notice only here that there is no room
    if target.exists():
        status = target.stat()
        with contextlib.suppress(OSError, AttributeError):  # another user's file, or a system without owners
            os.chown(beside, status.st_uid, status.st_gid)
        beside.chmod(status.st_mode & 0o7777)


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


def check_replaceable(place: Path, name: str, start: bytes, kind: str) -> None:
    """Refuse the name of a new file of some kind under which there is a file of another kind.

    Raises
    ------
    InvalidArgumentError
        The file is not empty and does not begin as files of that kind do; ``name`` says which argument it is.
    """
    if unreadable(place) is None:
        with place.open("rb") as file:
            found = file.read(len(start))
        if not start.startswith(found):
            raise InvalidArgumentError(
                f"{name} is {place}, a file that is not {kind}; expected a new name, or {kind} to be replaced (delete "
                "the file first if it is no longer needed)"
            )


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
    except DAMAGE as error:
        missing = f"{error} is missing" if isinstance(error, KeyError) else str(error)
        reason = shortened(missing).rstrip(".") or type(error).__name__
        raise InvalidArgumentError(
            f"{place} does not hold {content} ({reason}); expected a file of {writer}"
        ) from error


def plain_value(value: object) -> Any:
    """Lists of arrays, values of enumerations and texts of fractions, which JSON does not have."""
    if hasattr(value, "tolist"):  # arrays of numpy, which is not imported for --help
        return value.tolist()
    return value.value if isinstance(value, Enum) else str(value)


def write_arrays(place: Path, version: int, report: Mapping[str, Any], arrays: Mapping[str, Any]) -> None:
    """Write arrays, and a report that JSON can hold, to a .npz file (errors as of ``writing``)."""
    import numpy as np  # what writes other files does without

    meta = np.array(json.dumps({"format": version, **report}, default=plain_value))
    packed = io.BytesIO()
    np.savez_compressed(packed, allow_pickle=False, meta=meta, **arrays)
    write_file(place, packed.getvalue(), "path")


def read_arrays(place: Path, version: int, names: Sequence[str]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Report and arrays of a file of ``write_arrays``, within ``reading``.

    Raises
    ------
    InvalidArgumentError
        The file has another version.
    """
    from enumsol.support.saved import archive_arrays, json_from  # numpy, which is not imported for --help

    with place.open("rb") as file:
        data = archive_arrays(file)
    report = json_from(str(data["meta"]))
    arrays = {name: data[name] for name in names}
    if report["format"] != version:
        raise InvalidArgumentError(f"{place} has format {report['format']!r}; this version reads format {version}")
    return report, arrays
