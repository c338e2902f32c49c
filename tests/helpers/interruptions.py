"""Ctrl-C pressed on the way, and what is kept of the result."""

from refusals import refusal

from enumsol import Interrupted


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
