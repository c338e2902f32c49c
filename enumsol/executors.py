"""Tasks for the workers of a concurrent.futures executor, and what is known when a worker dies.

Executors say in many ways that a worker is gone: BrokenProcessPool, dask's KilledWorker, a cancelled future. Every
task here carries what it raised itself in an `_OwnError`; whatever else a future holds was said by its executor.
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
        What is the case, in a few words; the text of the error goes on with what the executor says.
    """

    def __init__(self, what: str, said: BaseException | None = None) -> None:
        super().__init__(what if said is None else f"{what} ({_one_line(said)})")
        self.what = what


class _OwnError(Exception):
    """Carries an error of the task itself, out of the worker."""

    def __init__(self, error: Exception) -> None:
        super().__init__(error)
        self.error = error


def submit(executor: Executor, function: Callable[_P, _T], *args: _P.args, **kwargs: _P.kwargs) -> Future[_T]:
    """The future result of a call by a worker; `result_of` reads it.

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
    """The result of a task, waited for; what the task raised is raised here.

    Raises
    ------
    WorkerLost
        The executor has none: the worker died, ran out of memory, or the task was cancelled.
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
    """Whether the result is there without waiting."""
    return future.done() and not future.cancelled() and future.exception() is None


def _call(function: Callable[..., Any], *args: Any, **kwargs: Any) -> Any:
    """Run a task, in the worker."""
    try:
        return function(*args, **kwargs)
    except MemoryError:
        # says something about the worker, not about the task
        raise
    except Exception as error:
        raise _OwnError(error) from error


def _one_line(error: BaseException) -> str:
    text = " ".join(str(error).split()).rstrip(".")
    if not text:
        return type(error).__name__
    return text if len(text) <= _LONGEST else f"{type(error).__name__}, {text[:_LONGEST]} ..."
