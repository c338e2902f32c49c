"""Ctrl-C pressed on the way, and what is kept of the result."""

import sys
from pathlib import Path

from refusals import refusal

import enumsol
from enumsol import Interrupted
from enumsol.support import deadlines

#: Where the lines are that may be interrupted.
ROOT = str(Path(enumsol.__file__).parent)


class CtrlC:
    """A function that presses Ctrl-C once: the first, or so manieth, time that its arguments meet a condition.

    It reports progress, or stands in the place of another function, which does the work until then.
    """

    def __init__(self, when=lambda *_, **__: True, *, call=1, then=lambda *_, **__: None):
        self.when, self.call, self.then, self.calls = when, call, then, 0

    def __call__(self, *arguments, **options):
        if self.when(*arguments, **options):
            self.calls += 1
            if self.calls == self.call:
                raise KeyboardInterrupt
        return self.then(*arguments, **options)


def interrupted(message, call, /, *arguments, **options):
    """What is kept of a result, where the call says that it was interrupted, with this message (a pattern)."""
    return refusal(Interrupted, message, call, *arguments, **options).partial


class AtLine:
    """Raises an error once, at the so manieth line that is run inside of a call which keeps what it found.

    Lines of `keeping` itself do not count, nor what a function does before: with no such line it only counts them.
    """

    def __init__(self, line=None, error=KeyboardInterrupt):
        self.line, self.error, self.lines, self._depth = line, error, 0, 0

    def __enter__(self):
        self._before = sys.gettrace()
        sys.settrace(self._call)
        return self

    def __exit__(self, *_):
        sys.settrace(self._before)

    def _call(self, frame, event, _):
        if frame.f_code is deadlines.keeping.__code__:
            self._depth += 1
            return self._outside
        if frame.f_code is deadlines._within.__code__:
            return None
        return self._inside if self._depth and frame.f_code.co_filename.startswith(ROOT) else None

    def _outside(self, frame, event, _):
        self._depth -= event == "return"
        return self._outside

    def _inside(self, frame, event, _):
        if event == "line":
            self.lines += 1
            if self.lines == self.line:
                sys.settrace(None)
                raise self.error
        return self._inside
