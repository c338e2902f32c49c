"""Worker processes of ``jobs=`` and ``--jobs``: a pool of loky that is made anew when one of them dies."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import time
from concurrent.futures import BrokenExecutor, Executor, Future
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection, wait as wait_for
from typing import TYPE_CHECKING, Any

import loky

from enumsol.support.deadlines import heard_by, listening

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from enumsol.support.deadlines import Listener

#: A task tells what it is at once it has taken so long, and no more often than this [seconds].
_QUIET, _PAUSE = 2.0, 1.0


class RenewedPool(Executor):
    """A process pool that can be made anew (see ``enumsol.support.workers.Crew``).

    Parameters
    ----------
    jobs : int
        Number of processes.
    """

    def __init__(self, jobs: int) -> None:
        self._max_workers = jobs
        self._pool: Any = None
        #: What workers tell, and who hears it: whoever listened when the last task was submitted.
        self._told, self._channel = multiprocessing.Pipe(duplex=False)
        self._listener: Listener | None = None
        threading.Thread(target=self._hear, daemon=True).start()

    def renew(self) -> None:
        """Start the processes, in the place of those that were there.

        Raises
        ------
        OSError
            The system starts no more processes.
        """
        self.shutdown()
        before = set(multiprocessing.active_children())
        with _ignoring_interrupts():
            # spawned, not forked: a progress bar runs in a thread of its own
            context = multiprocessing.get_context("spawn")
            self._pool = loky.ProcessPoolExecutor(
                self._max_workers, context=context, initializer=_begin, initargs=(self._channel,)
            )
            try:
                self._pool.submit(int)  # all start with the first task
            except BrokenExecutor:
                pass  # that one died already the search finds out
            except OSError:
                for process in set(multiprocessing.active_children()) - before:  # loky does not end these
                    process.kill()
                    process.join()
                raise

    def submit(self, function: Callable[..., Any], /, *arguments: Any, **named: Any) -> Future[Any]:
        """The future of a call.

        Raises
        ------
        BrokenExecutor
            A process died; `renew` starts others.
        """
        if self._pool is None:
            raise BrokenExecutor("there are no processes")
        self._listener = listening()
        future: Future[Any] = self._pool.submit(_telling, function, *arguments, **named)
        return future

    def _hear(self) -> None:
        """Pass on what workers tell, so that their pipe never fills, until the pool is shut down."""
        while (message := self._told.recv()) is not None:
            listener = self._listener
            if listener is not None:
                listener(*message)
        self._told.close()

    def __exit__(self, *error: object) -> None:
        """Shut down for good."""
        self.shutdown()
        self._listener = None
        self._channel.send(None)
        self._channel.close()

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = True) -> None:
        """End the processes at once, whatever they do."""
        if self._pool is not None:
            self._pool.shutdown(wait, kill_workers=True)
            self._pool = None


#: In a worker: where it tells what it is at.
_to_parent: list[Connection] = []


def _begin(channel: Connection) -> None:
    """In a worker: tell the process that started it, and do not outlive it, which may be killed."""
    _to_parent.append(channel)
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_wait_and_end, args=(parent.sentinel,), daemon=True).start()


def _telling(function: Callable[..., Any], *arguments: Any, **named: Any) -> Any:
    """In a worker: a task, which tells what it is at if it takes long."""
    due = [time.monotonic() + _QUIET]

    def told(work: str, done: int, of: int) -> None:
        if time.monotonic() >= due[0]:
            due[0] = time.monotonic() + _PAUSE
            with suppress(OSError):  # the process that listened has ended
                # short: a message is written to the pipe in one piece
                _to_parent[0].send((f"{work[:200]} in a worker", done, of))

    with heard_by(told if _to_parent else None):
        return function(*arguments, **named)


def _wait_and_end(sentinel: int) -> None:
    wait_for([sentinel])
    os._exit(1)


@contextmanager
def _ignoring_interrupts() -> Iterator[None]:
    """A terminal sends Ctrl-C to the workers too: processes born while it is ignored go on ignoring it."""
    if threading.current_thread() is not threading.main_thread():
        yield  # no other thread may change what a signal does
        return
    handler = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
