"""The time that a call may take, what it is at, and what is kept where it is ended: long loops ask and tell here.

A limit belongs to a call in its thread, whoever set it, and may move while it holds. Nothing has to be handed through
what is between the call and the loop, and code that is called without a limit never stops. In the same way whoever
shows progress hears of it; where nobody listens nothing is done. Only the thread or the process that listens is heard.
"""

from __future__ import annotations

import threading
import time
from concurrent.futures import Future, wait
from contextlib import contextmanager
from contextvars import ContextVar, copy_context
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

from enumsol.errors import Interrupted, OutOfMemoryError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    Listener = Callable[[str, int, int], object]
    #: Types of the errors that end a call from outside.
    Ending = type[Interrupted] | type[OutOfMemoryError]

_Result = TypeVar("_Result")


class TimeOverError(Exception):
    """The time is over; whoever set the limit catches this and keeps what was found."""


@dataclass
class Deadline:
    """A deadline of its own.

    Attributes
    ----------
    deadline : time.perf_counter() value or None
    """

    deadline: float | None = None

    @property
    def over(self) -> bool:
        """True if the deadline has passed."""
        return self.deadline is not None and time.perf_counter() > self.deadline

    def remaining(self) -> float | None:
        """Seconds until the deadline."""
        return None if self.deadline is None else self.deadline - time.perf_counter()

    @classmethod
    def after(cls, started: float, limit: float | None) -> Deadline:
        """When a call has to end that began then and may take so many seconds."""
        return cls(None if limit is None else started + limit)

    def extended(self, started: float) -> Deadline:
        """Until when what was found may be put together: somewhat more time than the limit."""
        if self.deadline is None:
            return self
        # a fifth and two seconds are promised; what does not look at the clock needs the rest
        return Deadline(self.deadline + 0.15 * (self.deadline - started) + 1.2)

    def part(self, share: float) -> Deadline:
        """The end of a share of the time that is left."""
        now = time.perf_counter()
        return self if self.deadline is None else Deadline(now + share * (self.deadline - now))


_current: ContextVar[Deadline | None] = ContextVar("deadline", default=None)


@contextmanager
def within(limits: Deadline) -> Iterator[None]:
    """Inside, `look` raises once the deadline of these limits has passed; other limits do not count there."""
    token = _current.set(limits)
    try:
        yield
    finally:
        _current.reset(token)


def current() -> float | None:
    """The deadline that holds here."""
    limits = _current.get()
    return None if limits is None else limits.deadline


def remaining() -> float | None:
    """The seconds that are left here."""
    limits = _current.get()
    return None if limits is None else limits.remaining()


def over() -> bool:
    """True if the time is over."""
    limits = _current.get()
    return limits is not None and limits.over


def look() -> None:
    """Raise TimeOverError if the time is over."""
    if over():
        raise TimeOverError


def attended(work: Callable[[], _Result], size: int, name: str, given_up: threading.Event | None = None) -> _Result:
    """Result of one long call into compiled code; Ctrl-C and the end of the time end the wait for it at once.

    Nothing can interrupt such a call, so it runs in a thread of its own (it must release the interpreter's lock, as
    factorizations do). Once nobody waits any longer, it runs to its end, and what it returns is dropped.

    Parameters
    ----------
    work : callable
    size : number of entries that it works on; a short call needs no thread
    name : what is told of it
    given_up : Event, optional
        Set once nobody waits any longer, for a call that can be asked to end.

    Raises
    ------
    TimeOverError
        The deadline that holds here has passed.
    """
    if size < 50_000:  # sparse matrices with fewer entries are factorized in some hundredths of a second
        return work()
    tell(name)
    done: Future[_Result] = Future()
    context = copy_context()

    def run() -> None:
        try:
            done.set_result(context.run(work))
        except Exception as error:  # noqa: BLE001 (raised again where it is waited for)
            done.set_exception(error)

    try:
        threading.Thread(target=run, daemon=True).start()
        while not wait([done], 0.05).done:
            look()
        return done.result()
    finally:
        if given_up is not None:
            given_up.set()


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


def listening() -> Listener | None:
    """Whoever hears what is told here, for work that is done elsewhere."""
    return _listener.get()


def tell_part(part: str) -> Listener | None:
    """A listener for a part of the work, which puts the part's name behind what it hears; None where nobody listens."""
    listener = _listener.get()
    return None if listener is None else lambda work, done, of: listener(f"{work} {part}", done, of)


def keeping(
    name: str, work: Callable[[], _Result], rest: Callable[[Ending], _Result], said: Callable[[_Result], str]
) -> _Result:
    """The result of a call, or an error that holds what was found before Ctrl-C, or until there was no memory.

    Python raises KeyboardInterrupt between any two instructions, also where a result is put together. So ``rest`` puts
    it together anew, from what ``work`` left; it begins again if it is itself interrupted.

    Parameters
    ----------
    name : str
        Of the call, for the message.
    work : callable
        The call. What it sets in its context, such as deadlines, is forgotten even if it does not come to its end.
    rest : callable
        Gives the result of what was found so far, in a moment. It may be called several times.
    said : callable
        Gives the rest of the message, from the partial result.

    Raises
    ------
    Interrupted, OutOfMemoryError
        ``partial`` is what ``rest`` gives.
    """
    ending: Ending
    try:
        return copy_context().run(work)
    except KeyboardInterrupt:
        ending = Interrupted
    except MemoryError:
        ending = OutOfMemoryError
    # here the error is gone, and with it what the frames of the work held
    # somebody waits for the result: what takes longer to be put together is left out
    end = Deadline(time.perf_counter() + 1.0)
    # it begins again if Ctrl-C comes meanwhile: somebody may press it twice, and `timeout` sends it twice
    for _ in range(8):
        try:
            partial = copy_context().run(_within, end, rest, ending)
            message = f"{name} {ending.happened}{said(partial)}"
            break
        except KeyboardInterrupt:
            continue
        except MemoryError:
            raise OutOfMemoryError(f"{name} {OutOfMemoryError.happened}, and nothing could be kept", None) from None
    else:
        raise KeyboardInterrupt
    raise ending(message, partial)


def _within(end: Deadline, rest: Callable[[Ending], _Result], ending: Ending) -> _Result:
    with within(end):
        return rest(ending)
