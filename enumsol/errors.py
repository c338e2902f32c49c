"""Errors of enumsol: every one a subclass of EnumsolError with one sentence that says what to mend."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from enumsol.roots.root_set import RootSet


class EnumsolError(Exception):
    """Base class of all errors that enumsol raises on purpose."""


class InvalidProblemError(EnumsolError, ValueError):
    """A contact problem's data (or a file that should hold them) cannot be used as given."""


class InvalidArgumentError(EnumsolError, ValueError):
    """An argument of a call cannot be used as given."""


class TooLargeError(EnumsolError, ValueError):
    """The work asked for is beyond a stated limit; the message gives an estimate of its cost."""


class MissingDependencyError(EnumsolError, ImportError):
    """An optional package is needed for this call and is not installed."""


class Interrupted(EnumsolError, KeyboardInterrupt):  # noqa: N818 (the name is part of the public interface)
    """Ctrl-C during a search; what was found so far is in ``partial``.

    Attributes
    ----------
    partial : RootSet
        The roots found before the interruption, with ``complete`` False.
    """

    def __init__(self, message: str, partial: RootSet | Any) -> None:
        super().__init__(message)
        self.partial = partial
