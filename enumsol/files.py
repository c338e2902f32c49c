"""Files that are written: what the operating system says against it, as errors of ours."""

from __future__ import annotations

import errno
import os
from contextlib import contextmanager
from typing import TYPE_CHECKING

from enumsol.errors import InvalidArgumentError, OutputError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

#: What the operating system says when a file can be opened and not be written to.
_NO_ROOM = frozenset((errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EPIPE))


@contextmanager
def writing(place: Path, name: str) -> Iterator[None]:
    """A block that writes a file, which the argument ``name`` of a call is.

    Raises
    ------
    OutputError
        There is no room for it, or the device failed.
    InvalidArgumentError
        There can be no such file.
    """
    try:
        yield
    except OSError as error:
        if error.errno in _NO_ROOM:
            reason = os.strerror(error.errno)  # some libraries put a long story in its place
            raise OutputError(f"{name} {place} cannot be written ({reason}); expected a place with room") from error
        raise InvalidArgumentError(
            f"{name} {place} cannot be written ({error.strerror or error}); expected a path for a new file"
        ) from error
