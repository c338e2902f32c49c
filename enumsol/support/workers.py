"""Tasks for the workers of a concurrent.futures executor, and a pool of processes; if a worker dies, only time is lost.

Executors report a lost worker in many ways: BrokenProcessPool, dask's KilledWorker, a cancelled future. An error that a
task here raises itself comes back in an `_OwnError`; any other error in a future was raised by the executor.
"""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import threading
import time
import warnings
from collections import deque
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait as wait_for
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any, TypeVar

from enumsol.errors import InvalidArgumentError
from enumsol.support.deadlines import heard_by, listening

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterator

    from enumsol.support.deadlines import Listener

    #: A key, a function that other processes can import, and its arguments.
    Call = tuple["Key", Callable[..., Any], tuple[Any, ...]]

Key = TypeVar("Key")
#: Characters of an executor's own message that are passed on.
_LONGEST = 160
#: Workers of an executor that does not tell their number; seconds after which a cluster is asked again.
_UNKNOWN, _ASKED_AFTER = 16, 10.0
#: A task of a pool tells what it is at once it has taken so long, and no more often than this [seconds].
_QUIET, _PAUSE = 2.0, 1.0
#: Seconds that a broken pool has to end the tasks that it was handed; it forgets one that comes while it breaks.
_PATIENCE = 1.0


@dataclass(eq=False)
class Job:
    """A call that a worker makes."""

    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    result: Any = None
    tries: int = 0


class Crew:
    """The workers of an executor. Where one dies its tasks are done again: by others, or in the calling process.

    Parameters
    ----------
    executor : Executor
        One with a method ``renew`` is asked for new workers when it is broken.

    Attributes
    ----------
    redone : int
        Tasks that were lost and done again.
    """

    def __init__(self, executor: Executor) -> None:
        self._executor: Executor | None = executor
        self._near = isinstance(getattr(executor, "_max_workers", None), int)
        self.redone = 0
        #: Workers, and when a cluster was last asked for their number.
        self._count, self._asked = _UNKNOWN, -_ASKED_AFTER
        self._renewals = 0
        self._told = False
        #: Futures, each with the number of renewals before it was handed out; the last pool that is known to be broken.
        self._out: dict[Job, tuple[Future[Any], int]] = {}
        self._broken = -1
        self._here: deque[Job] = deque()
        self._done: SimpleQueue[tuple[Job, Future[Any]]] = SimpleQueue()

    @property
    def room(self) -> int:
        """Number of further tasks that should be handed out: enough to keep all workers busy."""
        return 4 * self.workers - len(self._out) - len(self._here)

    @property
    def workers(self) -> int:
        """Number of workers, as far as the executor tells; a cluster is asked now and then, since they come and go."""
        workers = getattr(self._executor, "_max_workers", None)
        if isinstance(workers, int):
            return workers
        # the client of a cluster of Dask, or an executor that it made
        threads = getattr(getattr(self._executor, "_client", self._executor), "nthreads", None)
        if callable(threads) and (now := time.monotonic()) >= self._asked + _ASKED_AFTER:
            self._count, self._asked = max(sum(threads().values()), 1), now
        return self._count

    @property
    def near(self) -> bool:
        """True for a pool of this machine, to which handing out a task costs little."""
        return self._near

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Job:
        """Hand out a task."""
        job = Job(function, arguments)
        self._hand_out(job)
        return job

    def next(self, seconds: float | None = None) -> Job | None:
        """A task that is done; an error that it raised is raised here. None when the time is over before."""
        while self._out or self._here:
            if self._here and self._done.empty():
                job = self._here.popleft()
                job.result = job.function(*job.arguments)
                return job
            forgotten = [job for job, (_, pool) in self._out.items() if pool <= self._broken]
            patience = seconds
            if forgotten:
                patience = _PATIENCE if seconds is None else min(seconds, _PATIENCE)
            try:
                job, future = self._done.get(timeout=patience)
            except Empty:
                if not forgotten or seconds == 0:
                    return None
                for job in forgotten:
                    del self._out[job]
                    self._lost(job)
                continue
            if self._out.get(job, (None, 0))[0] is future and self._finished(job, *self._out.pop(job)):
                return job
        raise AssertionError("no task was handed out")

    def cancel(self) -> None:
        """Forget what has not been done; what has not begun never will."""
        for future, _ in self._out.values():
            future.cancel()
        self._out.clear()
        self._here.clear()

    def _finished(self, job: Job, future: Future[Any], pool: int) -> bool:
        """True if there is a result; otherwise the task is handed out again."""
        try:
            job.result = _result_of(future)
        except _Lost as loss:
            if isinstance(loss.__cause__, BrokenExecutor):
                self._broken = max(self._broken, pool)
            self._tell(f"{loss}; what it had to do is done again")
            self._lost(job)
            return False
        return True

    def _lost(self, job: Job) -> None:
        """Hand out once more what was lost."""
        self.redone += 1
        self._hand_out(job)

    def _hand_out(self, job: Job) -> None:
        while self._executor is not None and job.tries < 3:  # then it is done by the calling process
            try:
                future = _submitted(self._executor, job)
            except _Lost as loss:
                if isinstance(loss.__cause__, BrokenExecutor):
                    self._broken = self._renewals
                if self._renewed():
                    self._tell(f"{loss}; what it had to do is done again")
                    continue
                self._executor = None
                self._tell(f"{loss}; the calling process does the rest", again=True)
                break
            job.tries += 1
            self._out[job] = future, self._renewals
            future.add_done_callback(lambda done: self._done.put((job, done)))
            return
        self._here.append(job)

    def _tell(self, what: str, *, again: bool = False) -> None:
        """Warn of the first loss, and when there is nobody left."""
        if again or not self._told:
            warnings.warn(what, RuntimeWarning, stacklevel=2)
        self._told = True

    def _renewed(self) -> bool:
        """True if there are new workers in the place of a broken pool."""
        renew = getattr(self._executor, "renew", None)
        self._renewals += 1
        if renew is None or self._renewals > 20:
            return False
        try:
            renew()
        except OSError:
            return False  # the system starts no more
        return True


def spread(executor: Executor | None, calls: Iterator[Call[Key]]) -> Generator[tuple[Key, Any]]:
    """Results of calls with the keys of these, as workers finish them; without an executor made here, one by one.

    A limited number of calls is taken and handed out ahead of those whose results are awaited.
    """
    if executor is None:
        for key, function, arguments in calls:
            yield key, function(*arguments)
        return
    crew = Crew(executor)
    running: dict[Job, Key] = {}
    try:
        while True:
            while crew.room > 0 and (call := next(calls, None)) is not None:
                key, function, arguments = call
                running[crew.submit(function, *arguments)] = key
            if not running:
                return
            if (job := crew.next()) is not None:
                yield running.pop(job), job.result
    finally:
        crew.cancel()


_local = threading.local()


def kept_in_thread(key: bytes, packed: bytes | None) -> Any:
    """The object of a key, in a worker; every thread unpacks it once. None where it has another one and gets none."""
    if getattr(_local, "key", None) != key:
        if packed is None:
            return None
        _local.kept, _local.key = pickle.loads(packed), key
    return _local.kept


class _Lost(Exception):  # noqa: N818 (it never leaves this module)
    """The executor lost a worker, or takes no tasks."""

    def __init__(self, what: str, said: BaseException | None = None) -> None:
        super().__init__(what if said is None else f"{what} ({_one_line(said)})")


class _OwnError(Exception):
    """Carries the task's own error out of the worker."""

    def __init__(self, error: Exception) -> None:
        super().__init__(error)
        self.error = error


def _submitted(executor: Executor, job: Job) -> Future[Any]:
    try:
        return executor.submit(_call, job.function, *job.arguments)
    except BrokenExecutor as error:
        raise _Lost("a worker died", error) from error
    except (RuntimeError, OSError) as error:
        raise _Lost("the executor takes no tasks", error) from error


def _result_of(future: Future[Any]) -> Any:
    try:
        error = future.exception()
    except CancelledError as cancelled:
        raise _Lost("a task was cancelled") from cancelled
    if error is None:
        return future.result()
    if isinstance(error, _OwnError):
        raise error.error from error
    if isinstance(error, KeyboardInterrupt):
        raise error
    if isinstance(error, MemoryError):
        raise _Lost("a worker ran out of memory") from error
    raise _Lost("a worker died", error) from error


def _call(function: Callable[..., Any], *arguments: Any) -> Any:
    """Run a task, in the worker."""
    try:
        return function(*arguments)
    except MemoryError:
        # about the worker, not about the task
        raise
    except Exception as error:
        raise _OwnError(error) from error


def _one_line(error: BaseException) -> str:
    text = " ".join(str(error).split()).rstrip(".")
    if not text:
        return type(error).__name__
    return text if len(text) <= _LONGEST else f"{type(error).__name__}, {text[:_LONGEST]} ..."


# -- a pool -----------------------------------------------------------------------------------------------------------


class RenewedPool(Executor):
    """The processes of ``jobs=`` and ``--jobs``: a pool of loky that can be made anew (see `Crew`).

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
        import loky  # takes a while

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


@contextmanager
def workers_of(executor: Executor | None, jobs: int | None, name: str = "jobs") -> Iterator[Executor | None]:
    """The executor that is given, or one of that many processes, ended at once on the way out; None for one job.

    Raises
    ------
    InvalidArgumentError
        The system starts no more processes.
    """
    if jobs is None or jobs == 1:
        yield executor
        return
    with RenewedPool(jobs) as pool:
        try:
            pool.renew()
        except OSError as error:
            raise InvalidArgumentError(
                f"{name} is {jobs}, and the system starts no more processes ({error.strerror}); expected fewer"
            ) from error
        yield pool
