"""Executors that lose a worker at a known task, without any clock."""

from concurrent.futures import Executor, wait


class DyingExecutor(Executor):
    """Hands tasks to another executor; one of them is replaced by a call that takes the worker down.

    Parameters
    ----------
    inner : Executor
    healthy : int
        Tasks that are run before. They are finished when the worker dies, which it has when the next is handed in.
    last : callable and its arguments
        What the worker does instead of the next task: ``(os._exit, 1)``.
    """

    def __init__(self, inner, healthy, *last):
        self.inner, self.healthy, self.last, self.futures = inner, healthy, last, []
        self._max_workers = getattr(inner, "_max_workers", 1)

    def submit(self, function, /, *args, **kwargs):
        if len(self.futures) == self.healthy:
            wait(self.futures)
            future = self.inner.submit(*self.last)
            wait([future])
        else:
            future = self.inner.submit(function, *args, **kwargs)
        self.futures.append(future)
        return future
