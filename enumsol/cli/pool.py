"""Worker processes of ``--jobs``: a pool of loky that is made anew when one of them dies."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from concurrent.futures import BrokenExecutor, Executor
from contextlib import contextmanager
from multiprocessing.connection import wait as wait_for
from typing import TYPE_CHECKING, Any

import loky

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from concurrent.futures import Future


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
            self._pool = loky.ProcessPoolExecutor(self._max_workers, context=context, initializer=_end_with_parent)
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
        future: Future[Any] = self._pool.submit(function, *arguments, **named)
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = True) -> None:
        """End the processes at once, whatever they do."""
        if self._pool is not None:
            self._pool.shutdown(wait, kill_workers=True)
            self._pool = None


def _end_with_parent() -> None:
    """In a worker: do not outlive the process that started it, which may be killed."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_wait_and_end, args=(parent.sentinel,), daemon=True).start()


def _wait_and_end(sentinel: int) -> None:
    wait_for([sentinel])
    os._exit(1)


@contextmanager
def _ignoring_interrupts() -> Iterator[None]:
    """A terminal sends Ctrl-C to the workers too: processes born while it is ignored go on ignoring it."""
    handler = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
