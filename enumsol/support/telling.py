"""What a long call is at: loops that may be long tell it, and whoever shows progress hears of it.

As with time limits (``support.deadlines``), nothing has to be handed through what is between the two, and where nobody
listens nothing is done. Only the thread or the process that listens is heard.
"""

from __future__ import annotations

from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    #: Takes what is done, how much of it, and of how much; both are zero where that is not known.
    Listener = Callable[[str, int, int], object]

_listener: ContextVar[Listener | None] = ContextVar("listener", default=None)


@contextmanager
def heard_by(listener: Listener | None) -> Iterator[None]:
    """Inside, this listener hears what is told, and no other one."""
    token = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(token)


def tell(work: str, done: int = 0, of: int = 0) -> None:
    """Tell what is done, as the plural of what is counted ("columns of S in rationals"), and how much of it."""
    listener = _listener.get()
    if listener is not None:
        listener(work, done, of)


def tell_part(part: str) -> Listener | None:
    """A listener for a part of the work, which puts the part's name behind what it hears; None where nobody listens."""
    listener = _listener.get()
    return None if listener is None else lambda work, done, of: listener(f"{work} {part}", done, of)
