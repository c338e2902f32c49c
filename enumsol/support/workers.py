"""Tasks for the workers of a concurrent.futures executor; if a worker dies, only time is lost.

Executors report a lost worker in many ways: BrokenProcessPool, dask's KilledWorker, a cancelled future. An error that a
task here raises itself comes back in an `_OwnError`; any other error in a future was raised by the executor.
"""

from __future__ import annotations

import warnings
from collections import deque
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from contextlib import contextmanager
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any, TypeVar

from enumsol.errors import InvalidArgumentError

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterator

    #: A key, a function that other processes can import, and its arguments.
    Call = tuple["Key", Callable[..., Any], tuple[Any, ...]]

Key = TypeVar("Key")
#: Characters of an executor's own message that are passed on.
_LONGEST = 160
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
        self.redone = 0
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
        workers = getattr(self._executor, "_max_workers", None)
        most = 4 * workers if isinstance(workers, int) else 64
        return most - len(self._out) - len(self._here)

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
    from enumsol.support.pool import RenewedPool  # loky: only for several processes

    with RenewedPool(jobs) as pool:
        try:
            pool.renew()
        except OSError as error:
            raise InvalidArgumentError(
                f"{name} is {jobs}, and the system starts no more processes ({error.strerror}); expected fewer"
            ) from error
        yield pool
