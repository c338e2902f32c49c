"""Whether results are printed: --quiet leaves files, JSON, errors and the exit status."""

from __future__ import annotations

from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

_QUIET = ContextVar("enumsol_quiet", default=False)


def is_quiet() -> bool:
    """Whether texts, notes and progress are left out."""
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
