"""Errors of enumsol: every one a subclass of EnumsolError with one sentence about what to fix."""

from __future__ import annotations

from importlib import import_module
from typing import Any, ClassVar, Self


class EnumsolError(Exception):
    """Base class of all errors that enumsol raises on purpose.

    Examples
    --------
    >>> import enumsol
    >>> try:
    ...     enumsol.enumerate_roots(enumsol.gallery.one_node_triangle(), -1)
    ... except enumsol.EnumsolError as error:
    ...     print(type(error).__name__, "--", error)
    InvalidArgumentError -- friction at alpha = -1 is -1 at contact node 0; expected F >= 0
    """


class InvalidProblemError(EnumsolError, ValueError):
    """A contact problem's data (or a file that should hold them) cannot be used as given."""


class InvalidArgumentError(EnumsolError, ValueError):
    """An argument of a call cannot be used as given."""


class TooLargeError(EnumsolError, ValueError):
    """The work asked for is beyond a stated limit; the message gives an estimate of its cost."""


class NoSuchItemError(EnumsolError, IndexError):
    """A list of results was asked for an item beyond its end.

    Examples
    --------
    >>> import enumsol
    >>> enumsol.enumerate_roots(enumsol.gallery.one_node_triangle(), 5)[9]
    Traceback (most recent call last):
        ...
    enumsol.errors.NoSuchItemError: there is no root 9: there are 3 roots; expected a number from 0 to 2, ...
    """


class NotHeldError(EnumsolError, ValueError):
    """A call is not available for a body that nothing holds (one with ``rigid_modes``).

    Examples
    --------
    >>> import enumsol
    >>> block = enumsol.gallery.block_on_table()
    >>> try:
    ...     block.condensed
    ... except enumsol.NotHeldError as error:
    ...     print(error)
    condensation cannot take a body that nothing holds (rigid_modes is given); expected a body held by supports or \
springs
    """


class IncompleteGraphError(EnumsolError, ValueError):
    """A branch graph with gaps was asked a question that only a graph without gaps can answer.

    Examples
    --------
    >>> import enumsol
    >>> graph = enumsol.branch_graph(enumsol.gallery.two_node_square(), (0, 10), max_nodes=1)
    >>> graph.multiplicity_at(5)
    Traceback (most recent call last):
        ...
    enumsol.errors.IncompleteGraphError: ...
    >>> graph.at_least(5)
    1
    """


class MissingDependencyError(EnumsolError, ImportError):
    """An optional package is needed for this call and is not installed."""

    @classmethod
    def imported(cls, module: str, what: str, extra: str) -> Any:
        """The module that something needs, of a package that comes with an extra of this one; or this error."""
        try:
            return import_module(module)
        except ImportError as error:
            raise cls.of(what, module.partition(".")[0], extra) from error

    @classmethod
    def of(cls, what: str, package: str, extra: str) -> Self:
        """The error that something needs a package, which comes with an extra of this one."""
        return cls(
            f"{what} need the package {package}, which is not installed; "
            f'install it with: pip install "enumsol[{extra}]"'
        )


class _PartialResultError(EnumsolError):
    """Base of the errors that hold what was found before they were raised.

    Attributes
    ----------
    happened : str
        What became of the call, for messages; of errors that end it from outside.
    """

    happened: ClassVar[str]

    def __init__(self, message: str, partial: object = None) -> None:
        super().__init__(message)
        self.partial: Any = partial

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (str(self), self.partial)  # a worker process may send it back


class Interrupted(_PartialResultError, KeyboardInterrupt):  # noqa: N818 (the name is part of the public interface)
    """Ctrl-C during a search; what was found so far is in ``partial``.

    Attributes
    ----------
    partial : RootSet
        The roots found before the interruption, with ``complete`` False. For functions other than enumerate_roots: what
        they would have returned, as far as they got.
    """

    happened = "was interrupted"


class OutOfMemoryError(_PartialResultError, MemoryError):
    """The memory did not suffice for a search; what was found so far is in ``partial``.

    Attributes
    ----------
    partial : RootSet or None
        As of Interrupted; None where the memory did not suffice to put it together either.
    """

    happened = "ran out of memory"


class OutputError(_PartialResultError):
    """A result cannot be written: the disk is full, or the reader of the output is gone.

    Attributes
    ----------
    partial : RootSet or None
        For enumerate_roots with a ``proof_path``: the result of the search, which went on without a proof.
    """


class FrictionJumpWarning(UserWarning):
    """A friction coefficient that depends on the solution seems to jump."""
