"""Errors of enumsol: every one a subclass of EnumsolError with one sentence that says what to mend."""

from __future__ import annotations

from typing import Any


class EnumsolError(Exception):
    """Base class of all errors that enumsol raises on purpose."""


class InvalidProblemError(EnumsolError, ValueError):
    """A contact problem's data (or a file that should hold them) cannot be used as given."""


class InvalidArgumentError(EnumsolError, ValueError):
    """An argument of a call cannot be used as given."""


class TooLargeError(EnumsolError, ValueError):
    """The work asked for is beyond a stated limit; the message gives an estimate of its cost."""


class IncompleteGraphError(EnumsolError, ValueError):
    """A branch graph with gaps was asked for what only a graph without gaps can tell."""


class MissingDependencyError(EnumsolError, ImportError):
    """An optional package is needed for this call and is not installed."""


class Interrupted(EnumsolError, KeyboardInterrupt):  # noqa: N818 (the name is part of the public interface)
    """Ctrl-C during a search; what was found so far is in ``partial``.

    Attributes
    ----------
    partial : RootSet, BranchGraph, Path or DataFrame
        What the interrupted call would have returned, as far as it came; ``complete`` is False where there is one.
    """

    def __init__(self, message: str, partial: Any) -> None:
        super().__init__(message)
        self.partial = partial
