"""Worker processes of ``--jobs``: a pool that is made anew when one of them dies."""

from __future__ import annotations

import concurrent.futures
import multiprocessing
import os
import signal
import threading
from concurrent.futures import BrokenExecutor, Executor
from contextlib import contextmanager, suppress
from multiprocessing.connection import wait
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator
    from concurrent.futures import Future, ProcessPoolExecutor
    from multiprocessing.connection import Connection
    from multiprocessing.process import BaseProcess


class RenewedPool(Executor):
    """A process pool that can be made anew (see ``enumsol.support.workers.Crew``).

    Parameters
    ----------
    jobs : int
        Number of processes.
    """

    def __init__(self, jobs: int) -> None:
        self._max_workers = jobs
        self._pool: ProcessPoolExecutor | None = None

    def renew(self) -> None:
        """Start the processes, in the place of those that were there.

        Raises
        ------
        OSError
            The system starts no more processes.
        """
        self.shutdown(wait=False, cancel_futures=True)
        with _ignoring_interrupts():
            # spawned, not forked: a progress bar runs in a thread of its own
            context = multiprocessing.get_context("spawn")
            self._pool = concurrent.futures.ProcessPoolExecutor(
                self._max_workers, mp_context=context, initializer=_end_with_parent
            )
            # all start with the first task, before the thread that watches them: one that died while another was being
            # started would end that thread with a traceback
            setattr(self._pool, "_safe_to_dynamically_spawn_children", False)  # noqa: B010 (not in the stubs)
            with suppress(BrokenExecutor):  # that one died already the search finds out
                self.submit(int)

    def submit(self, function: Callable[..., Any], /, *arguments: Any, **named: Any) -> Future[Any]:
        """The future of a call.

        Raises
        ------
        BrokenExecutor
            A process died; `renew` starts others.
        OSError
            The system starts no more processes.
        """
        if self._pool is None:
            raise BrokenExecutor("there are no processes")
        try:
            return self._pool.submit(function, *arguments, **named)
        except OSError as error:
            if error.errno is not None:
                raise
            # not the system's: the pool closed its pipes while this call was using them, because a process died
            raise BrokenExecutor("a process died") from error

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Stop the processes."""
        if self._pool is not None:
            self._pool.shutdown(wait=wait, cancel_futures=cancel_futures)
            self._pool = None

    def end(self, processes: Iterable[BaseProcess]) -> None:
        """End the processes at once, whatever they do.

        One that is ended while it sends a result leaves a part of it in the pipe, and one that is sent a task takes no
        more of it. The pool's threads would wait for the rest as long as the pipes have another end: in this process.
        """
        names = ("_result_queue", "_call_queue", "_executor_manager_thread")
        results, calls, manager = (getattr(self._pool, name, None) for name in names)
        self.shutdown(wait=False, cancel_futures=True)
        for process in processes:
            process.terminate()
        for process in processes:
            process.join()
        _close(getattr(results, "_writer", None))
        if manager is not None:
            manager.join(timeout=1.0)  # newer Pythons close the other pipe in this thread: two that close it collide
        _close(getattr(calls, "_reader", None))


def _close(end: Connection | None) -> None:
    if end is not None:
        with suppress(OSError):  # the pool closed it
            end.close()


def _end_with_parent() -> None:
    """In a worker: do not outlive the process that started it, which may be killed."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_wait_and_end, args=(parent.sentinel,), daemon=True).start()


def _wait_and_end(sentinel: int) -> None:
    wait([sentinel])
    os._exit(1)


@contextmanager
def _ignoring_interrupts() -> Iterator[None]:
    """A terminal sends Ctrl-C to the workers too: processes born while it is ignored go on ignoring it."""
    handler = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
