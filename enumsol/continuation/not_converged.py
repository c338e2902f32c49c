"""Errors of continuation, with what a user needs to proceed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from enumsol.errors import EnumsolError, InvalidArgumentError
from enumsol.support.messages import counted

if TYPE_CHECKING:
    from collections.abc import Sequence


@dataclass(frozen=True)
class NewtonIteration:
    """One iteration of the piecewise smooth Newton method.

    Attributes
    ----------
    residual : float
        Norm of H before the step, in forces relative to the load [-].
    step : float
        Fraction of the Newton step that was taken.
    changes : int
        Contact nodes whose selection differs from that of the iteration before.
    """

    residual: float
    step: float
    changes: int


class NotConverged(EnumsolError, ArithmeticError):  # noqa: N818 (the name is part of the public interface)
    """Newton's method found no root from this start; the message says why and what may help.

    Attributes
    ----------
    alpha : float
    history : tuple of NewtonIteration
    reason : str

    Examples
    --------
    >>> import enumsol
    >>> try:
    ...     enumsol.newton(enumsol.gallery.one_node_triangle(), 5, start=(-8.0, 3.0), max_iterations=1)
    ... except enumsol.NotConverged as error:
    ...     error.alpha, len(error.history)
    (5.0, 1)
    """

    def __init__(self, alpha: float, history: Sequence[NewtonIteration], reason: str) -> None:
        self.alpha = alpha
        self.history = tuple(history)
        self.reason = reason
        last = f"residual {self.history[-1].residual:.2e}" if self.history else "no iteration"
        super().__init__(
            f"Newton's method did not converge at alpha = {alpha:g} "
            f"({reason}; {counted(len(self.history), 'iteration')}, {last}); "
            "try another start, for example a root at a nearby alpha, or enumerate_roots, which needs no start"
        )


class AmbiguousStart(InvalidArgumentError):  # noqa: N818 (reads as a state of the start)
    """The direction does not single out one tangent at the start; ``tangents`` lists all that are admissible.

    Attributes
    ----------
    tangents : tuple of Tangent
        Pass the index of one of them as ``tangent=`` to `follow`.
    """

    def __init__(self, message: str, tangents: Sequence[Any]) -> None:
        super().__init__(message)
        self.tangents = tuple(tangents)
