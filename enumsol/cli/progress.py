"""Progress on stderr."""

from __future__ import annotations

import sys
import time
from threading import Lock, Timer
from typing import TYPE_CHECKING, Any, Self

from enumsol.cli.streams import is_quiet
from enumsol.support.deadlines import heard_by

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from rich.progress import Progress, TaskID

    from enumsol.search.outcome import SearchProgress

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
