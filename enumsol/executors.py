"""Tasks for the workers of a concurrent.futures executor, and what is known when a worker dies.

Executors report a lost worker in many ways: BrokenProcessPool, dask's KilledWorker, a cancelled future. An error that a
task here raises itself comes back in an `_OwnError`; any other error in a future was raised by the executor.
"""

from __future__ import annotations

from concurrent.futures import BrokenExecutor, CancelledError
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable
    from concurrent.futures import Executor, Future

_P = ParamSpec("_P")
_T = TypeVar("_T")

#: Characters of an executor's own message that are passed on.
_LONGEST = 160


class WorkerLost(Exception):  # noqa: N818 (callers turn it into a WorkerError, which holds what was found)
    """The executor lost a worker, or takes no tasks.

    Attributes
    ----------
    what : str
        What happened, in a few words; the error's text adds the executor's own message.
    """

    def __init__(self, what: str, said: BaseException | None = None) -> None:
        super().__init__(what if said is None else f"{what} ({_one_line(said)})")
        self.what = what


class _OwnError(Exception):
    """Carries the task's own error out of the worker."""

    def __init__(self, error: Exception) -> None:
        super().__init__(error)
        self.error = error


def submit(executor: Executor, function: Callable[_P, _T], *args: _P.args, **kwargs: _P.kwargs) -> Future[_T]:
    """The future of a call that a worker makes; `result_of` gives its result.

    Raises
    ------
    WorkerLost
        The executor takes no task: it is broken, was shut down, or can start no worker.
    """
    try:
        return executor.submit(_call, function, *args, **kwargs)
    except BrokenExecutor as error:
        raise WorkerLost("a worker died", error) from error
    except (RuntimeError, OSError) as error:
        raise WorkerLost("the executor takes no tasks", error) from error


def result_of(future: Future[_T]) -> _T:
    """Wait for a task and return its result; an error that the task raised is raised here.

    Raises
    ------
    WorkerLost
        There is no result: the worker died, ran out of memory, or the task was cancelled.
    """
    try:
        error = future.exception()
    except CancelledError as cancelled:
        raise WorkerLost("a task was cancelled") from cancelled
    if error is None:
        return future.result()
    if isinstance(error, _OwnError):
        raise error.error from error
    if isinstance(error, KeyboardInterrupt):
        raise error
    if isinstance(error, MemoryError):
        raise WorkerLost("a worker ran out of memory") from error
    raise WorkerLost("a worker died", error) from error


def has_result(future: Future[Any]) -> bool:
    """Whether the result is available without waiting."""
    return future.done() and not future.cancelled() and future.exception() is None


def _call(function: Callable[..., Any], *args: Any, **kwargs: Any) -> Any:
    """Run a task, in the worker."""
    try:
        return function(*args, **kwargs)
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
