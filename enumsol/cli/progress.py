"""stdout and stderr that may be full, closed, or read by nobody any more, and progress on them.

One line says that what was printed got lost; tracebacks, and the interpreter's complaint when it empties its buffers at
exit, do not.
"""

from __future__ import annotations

import contextlib
import io
import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cached_property
from threading import Lock, Timer
from typing import TYPE_CHECKING, Any, Self, TextIO, cast

from enumsol.errors import OutputError
from enumsol.support.deadlines import heard_by
from enumsol.support.messages import visible

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from rich.progress import Progress, TaskID

    from enumsol.search.outcome import SearchProgress


class _Guarded:
    """A standard stream in which a failure to write is an OutputError, or nothing at all.

    Parameters
    ----------
    stream : text or binary stream
    name : str or None
        Of the stream in the error; None passes failures over: there is nowhere left to tell of them.
    closed : bool
        The stream was closed before the program began; ``stream`` stands in for it and is written to by nobody.
    """

    def __init__(self, stream: Any, name: str | None, *, closed: bool = False) -> None:
        self._stream = stream
        self._name = name
        self._empty = "" if isinstance(stream, io.TextIOBase) else b""
        self._failure = OutputError(f"{name} is closed; expected a terminal, a pipe or a file") if closed else None

    def write(self, data: str | bytes) -> int:
        if data == self._empty:
            return 0  # a library that asks whether the stream takes text or bytes; a full disk would refuse even that
        try:
            if self._failure is None:
                return int(self._stream.write(data))
        except OSError as error:
            self._fail(error)
        self._tell()
        return len(data)

    def flush(self) -> None:
        try:
            if self._failure is None:
                self._stream.flush()
        except OSError as error:
            self._fail(error)
            self._tell()

    @cached_property
    def buffer(self) -> _Guarded:
        return _Guarded(self._stream.buffer, self._name, closed=self._failure is not None)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def _tell(self) -> None:
        if self._name is not None and self._failure is not None:
            raise self._failure

    def _fail(self, error: OSError) -> None:
        """Take note of a failure, and write what is still in the buffer nowhere: it must not fail again at exit."""
        if isinstance(error, BrokenPipeError):
            self._failure = OutputError(f"{self._name} was closed by its reader before everything was written")
        else:
            self._failure = OutputError(
                f"{self._name} cannot be written ({error.strerror}); expected a place with free space"
            )
        self._failure.__cause__ = error
        with contextlib.suppress(OSError, ValueError):
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self._stream.fileno())
            os.close(nowhere)


@contextlib.contextmanager
def guarded_streams() -> Iterator[None]:
    """Standard streams of which stdout fails with OutputError and stderr without a word."""
    before = sys.stdout, sys.stderr
    with open(os.devnull, "w", encoding="utf-8") as nowhere:
        # None when the program was started with a closed stream, whatever the annotations of sys say
        out, err = (
            _Guarded(nowhere if stream is None else stream, name, closed=stream is None)
            for stream, name in zip(before, ("stdout", None), strict=True)
        )
        sys.stdout, sys.stderr = cast("TextIO", out), cast("TextIO", err)
        try:
            yield
        finally:
            sys.stdout, sys.stderr = before


def say(text: str, *, err: bool = False) -> None:
    """Print a text, and the end of a line where it has none: the one place where text leaves for the terminal.

    What a terminal would obey, in names from files and arguments, is printed as an escape.
    """
    pour(visible(text, keep="\n\t"), err=err)


def pour(text: str, *, err: bool = False) -> None:
    """Write data as they are, for another program to read; on a terminal they are text, as in `say`."""
    stream = sys.stderr if err else sys.stdout
    if stream.isatty():
        text = visible(text, keep="\n\t")
    coding = getattr(stream, "encoding", None) or "utf-8"
    stream.write(text.encode(coding, "backslashreplace").decode(coding) + ("" if text.endswith("\n") else "\n"))
    stream.flush()


_QUIET = ContextVar("enumsol_quiet", default=False)


def is_quiet() -> bool:
    """True if texts, notes and progress are left out."""
    return _QUIET.get()


def set_quiet(value: bool) -> bool:
    """Take the option of the command that is running."""
    if value:
        _QUIET.set(True)
    return value


@contextmanager
def loud_again() -> Iterator[None]:
    """A block that begins loud, and after which everything is as before."""
    token = _QUIET.set(False)
    try:
        yield
    finally:
        _QUIET.reset(token)


#: Work shorter than this shows no progress [seconds].
_PROGRESS_DELAY = 1.0


class Display:
    """A progress bar on stderr, shown on a terminal when the work lasts, also if nothing is told of it.

    Inside, it hears what long calls tell of themselves (``support.deadlines``), and says it behind the bar.

    Parameters
    ----------
    title : str
        What is going on.
    steps : mapping, optional
        Work that fills the bar when it is told, and from which to which share.
    told : callable, optional
        What `show` takes, of what the display is called with.
    """

    def __init__(
        self,
        title: str,
        steps: Mapping[str, tuple[float, float]] | None = None,
        told: Callable[..., tuple[Any, ...]] = lambda *shown: shown,
    ) -> None:
        self._title, self._steps, self._of = title, {} if steps is None else steps, told
        self._work, self._hearing = "", heard_by(self.hear)
        self._started = self._begun = self._told = time.perf_counter()
        self._step, self._share, self._note, self._completed = "", 0.0, "", 0.0
        self._progress: Progress | None = None
        self._task: TaskID | None = None
        self._shown = sys.stderr.isatty() and not is_quiet()
        # the bar may appear while the work goes on
        self._drawing, self._timer = Lock(), Timer(_PROGRESS_DELAY, self._draw)
        self._timer.daemon = True

    def __enter__(self) -> Self:
        """Begin to listen; the bar appears later."""
        self._hearing.__enter__()
        if self._shown:
            self._timer.start()
        return self

    def show(self, share: float, note: str, step: tuple[str, float, float] = ("", 0.0, 1.0)) -> None:
        """Show how much is done, and a note behind it.

        ``step`` names a step of the work, and says from which to which share of the bar it goes; ``share`` is that of
        the step, and what is left is said of the step alone.
        """
        self._told = time.perf_counter()
        name, first, last = step
        if name != self._step:
            self._begun = self._told if self._step else self._started
            self._step = name
        self._share, self._note, self._work = share, note, ""
        self._completed = max(self._completed, first + share * (last - first))
        self._draw()

    def __call__(self, *state: object) -> None:
        """Show the state of the work."""
        self.show(*self._of(*state))

    def hear(self, work: str, done: int, of: int) -> None:
        """Show what a long call is at: behind the bar, or as a step that fills it."""
        told = f"{done:,} of {of:,} {work}" if of else work
        if of and work in self._steps:
            self.show(done / of, told, (work, *self._steps[work]))
        else:
            self._work = told
            self._draw()

    def _draw(self) -> None:
        now = time.perf_counter()
        with self._drawing:
            if not self._shown or (self._progress is None and now - self._started < _PROGRESS_DELAY):
                return
            if self._progress is None or self._task is None:
                self._progress, self._task = _progress_bar(self._title, self.counts)
            self._progress.update(self._task, completed=self._completed)
            self._progress.start()

    def counts(self) -> str:
        """The text behind the bar; its clock goes on while nothing new is reported."""
        now = time.perf_counter()
        said = ", ".join(part for part in (self._note, self._work) if part)
        left = remaining(self._told - self._begun, self._share, now - self._told)
        of = " of this step" if self._step and left else ""
        return f"{said}  {now - self._started:.0f} s{left}{of}"

    def count(self, unit: str) -> Callable[[int, int], None]:
        """A callback that takes how many are done, and of how many."""
        return lambda done, of: self.show(done / max(of, 1), f"{done:,} of {of:,} {unit}")

    def __exit__(self, *error: Any) -> None:
        """Take the bar away."""
        self._hearing.__exit__(*error)
        self._timer.cancel()
        with self._drawing:
            self._shown = False
            if self._progress is not None:
                self._progress.stop()


def remaining(seconds: float, share: float, since: float = 0.0) -> str:
    """The time left, if the rest is done as fast as the part so far, which was told some time ago.

    Nothing before enough is done to tell, nor once that time has passed.
    """
    if not 0.02 <= share < 1.0:  # a smaller part of the work says nothing about the rest
        return ""
    left = seconds * (1.0 - share) / share - since
    if left < 0.5:
        return ""
    for unit, size in (("h", 3600.0), ("min", 60.0)):
        if left >= 2 * size:
            return f", about {left / size:.0f} {unit} left"
    return f", about {left:.0f} s left"


def search_display() -> Display:
    """Progress of a search: the callback of enumerate_roots."""

    def told(state: SearchProgress) -> tuple[float, str]:
        resumed = f" and {state.resumed:,} from the file" if state.resumed else ""
        return state.covered, f"nodes {state.nodes:,}{resumed}  roots {state.solutions:,}"

    return Display("searching", told=told)


def _progress_bar(title: str, counts: Callable[[], str]) -> tuple[Progress, TaskID]:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn
    from rich.text import Text

    class Counts(ProgressColumn):
        """Asked for several times a second."""

        def render(self, task: Task) -> Text:
            return Text(counts())

    progress = Progress(
        TextColumn(title),
        BarColumn(bar_width=24),
        TextColumn("{task.percentage:.2f}%"),
        Counts(),
        console=Console(stderr=True),
        transient=True,
        refresh_per_second=4,
    )
    return progress, progress.add_task("", total=1.0)
