"""stdout and stderr that may be full, closed, or read by nobody any more, and whether results are printed there.

One line says that what was printed got lost; tracebacks, and the interpreter's complaint when it empties its buffers at
exit, do not.
"""

from __future__ import annotations

import contextlib
import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cached_property
from typing import Any, TextIO, cast

from enumsol.errors import OutputError
from enumsol.support.messages import visible


class _Guarded:
    """A standard stream in which a failure to write is an OutputError, or nothing at all.

    Parameters
    ----------
    stream : text or binary stream
    name : str or None
        Of the stream in the error; None passes failures over: there is nowhere left to tell of them.
    closed : bool
        The stream was closed before the program began; ``stream`` stands in for it and is written to by nobody.
    """

    def __init__(self, stream: Any, name: str | None, *, closed: bool = False) -> None:
        self._stream = stream
        self._name = name
        self._empty = "" if isinstance(stream, io.TextIOBase) else b""
        self._failure = OutputError(f"{name} is closed; expected a terminal, a pipe or a file") if closed else None

    def write(self, data: str | bytes) -> int:
        if data == self._empty:
            return 0  # a library that asks whether the stream takes text or bytes; a full disk would refuse even that
        try:
            if self._failure is None:
                return int(self._stream.write(data))
        except OSError as error:
            self._fail(error)
        self._tell()
        return len(data)

    def flush(self) -> None:
        try:
            if self._failure is None:
                self._stream.flush()
        except OSError as error:
            self._fail(error)
            self._tell()

    @cached_property
    def buffer(self) -> _Guarded:
        return _Guarded(self._stream.buffer, self._name, closed=self._failure is not None)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def _tell(self) -> None:
        if self._name is not None and self._failure is not None:
            raise self._failure

    def _fail(self, error: OSError) -> None:
        """Take note of a failure, and write what is still in the buffer nowhere: it must not fail again at exit."""
        if isinstance(error, BrokenPipeError):
            self._failure = OutputError(f"{self._name} was closed by its reader before everything was written")
        else:
            self._failure = OutputError(
                f"{self._name} cannot be written ({error.strerror}); expected a place with free space"
            )
        self._failure.__cause__ = error
        with contextlib.suppress(OSError, ValueError):
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self._stream.fileno())
            os.close(nowhere)


@contextlib.contextmanager
def guarded_streams() -> Iterator[None]:
    """Standard streams of which stdout fails with OutputError and stderr without a word."""
    before = sys.stdout, sys.stderr
    with open(os.devnull, "w", encoding="utf-8") as nowhere:
        # None when the program was started with a closed stream, whatever the annotations of sys say
        out, err = (
            _Guarded(nowhere if stream is None else stream, name, closed=stream is None)
            for stream, name in zip(before, ("stdout", None), strict=True)
        )
        sys.stdout, sys.stderr = cast("TextIO", out), cast("TextIO", err)
        try:
            yield
        finally:
            sys.stdout, sys.stderr = before


def say(text: str, *, err: bool = False) -> None:
    """Print a text, and the end of a line where it has none: the one place where text leaves for the terminal.

    What a terminal would obey, in names from files and arguments, is printed as an escape.
    """
    pour(visible(text, keep="\n\t"), err=err)


def pour(text: str, *, err: bool = False) -> None:
    """Write data as they are, for another program to read; on a terminal they are text, as in `say`."""
    stream = sys.stderr if err else sys.stdout
    if stream.isatty():
        text = visible(text, keep="\n\t")
    coding = getattr(stream, "encoding", None) or "utf-8"
    stream.write(text.encode(coding, "backslashreplace").decode(coding) + ("" if text.endswith("\n") else "\n"))
    stream.flush()


_QUIET = ContextVar("enumsol_quiet", default=False)


def is_quiet() -> bool:
    """True if texts, notes and progress are left out."""
    return _QUIET.get()


def set_quiet(value: bool) -> bool:
    """Take the option of the command that is running."""
    if value:
        _QUIET.set(True)
    return value


@contextmanager
def loud_again() -> Iterator[None]:
    """A block that begins loud, and after which everything is as before."""
    token = _QUIET.set(False)
    try:
        yield
    finally:
        _QUIET.reset(token)
