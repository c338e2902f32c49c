"""Orthotropic friction coefficients of 3D problems: constant, or functions of the slip |u_t| (paper, Section 2)."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from enumsol.errors import FrictionJumpWarning, InvalidProblemError
from enumsol.model.contact_body import span, vector
from enumsol.support.arguments import exact_number, shown
from enumsol.support.array_arguments import plain_array, real_array
from enumsol.support.array_types import ArrayLike, Floats
from enumsol.support.immutable import Immutable, Sealed, sealed

_EXPECTED = "expected a number, a pair (F1, F2) of numbers or (p,) arrays, a FrictionTable, or a callable F(node, slip)"
#: Slips per node at which a function is sampled for jumps; bisections of the largest step; the share of the step
#: that must be left for it to count as a jump.
_JUMP_SAMPLES, _JUMP_BISECTIONS, _JUMP_SHARE = 33, 40, 0.5


class FrictionLaw(Protocol):
    """Coefficients of all contact nodes for given slips."""

    @property
    def depends_on_slip(self) -> bool:
        """True if the coefficients depend on the solution."""

    def at(self, slip: Floats) -> Floats:
        """Coefficients F1, F2 at slips (p,) [length], shape (p, 2) [-]."""


@dataclass(frozen=True)
class ConstantFriction(Sealed):
    """Coefficients that do not depend on the solution, values of shape (p, 2)."""

    values: Floats
    depends_on_slip = False

    def at(self, slip: Floats) -> Floats:
        """Coefficients at a slip: the same for every slip."""
        return self.values

    def __str__(self) -> str:
        return f"F1 in {span(self.values[:, 0])}, F2 in {span(self.values[:, 1])}"


class FrictionTable(Immutable):
    """Coefficients as piecewise linear functions of the slip ``|u_t|``, constant beyond the last one.

    Parameters
    ----------
    slip : (k,) array_like
        Slips, increasing, the first one 0 [length].
    F1 : (k,) or (p, k) array_like
        Coefficient in the first axis at these slips, for all nodes or for each [-].
    F2 : (k,) or (p, k) array_like or None
        Likewise in the second axis; None: as F1 (isotropic).

    Raises
    ------
    InvalidProblemError
        The slips do not increase from 0, or a coefficient is negative or of the wrong shape.

    Examples
    --------
    >>> import enumsol
    >>> enumsol.FrictionTable(slip=[0, 0.1, 1], F1=[0.6, 0.4, 0.3])
    FrictionTable of 3 slips up to 1: F1 in [0.3, 0.6], F2 in [0.3, 0.6], by a table of |u_t|
    """

    depends_on_slip = True

    def __init__(self, slip: ArrayLike, F1: ArrayLike, F2: ArrayLike | None = None) -> None:
        knots = real_array(slip, "slip of the friction table")
        if knots.ndim != 1 or len(knots) < 2 or knots[0] != 0 or np.any(np.diff(knots) <= 0):
            raise InvalidProblemError(
                f"slip of the friction table is {shown(slip)}; expected at least two slips that increase from 0"
            )
        self.slip = sealed(knots)
        self.F1 = _column(F1, "F1", len(knots))
        self.F2 = self.F1 if F2 is None else _column(F2, "F2", len(knots))
        self._freeze()

    def at(self, slip: Floats) -> Floats:
        """Coefficients F1, F2 at slips (p,) [length], shape (p, 2) [-]."""
        return np.stack([self._interpolated(values, slip) for values in (self.F1, self.F2)], axis=1)

    def _interpolated(self, values: Floats, slip: Floats) -> Floats:
        if values.ndim == 1:
            return np.interp(slip, self.slip, values)
        return np.array([np.interp(s, self.slip, row) for s, row in zip(slip, values, strict=True)])

    def check_nodes(self, p: int) -> None:
        """Raise InvalidProblemError unless the table fits p contact nodes."""
        for name, values in (("F1", self.F1), ("F2", self.F2)):
            if values.ndim == 2 and len(values) != p:
                raise InvalidProblemError(
                    f"{name} of the friction table has shape {values.shape}; expected ({len(self.slip)},) or "
                    f"(p, {len(self.slip)}) = ({p}, {len(self.slip)})"
                )

    def __repr__(self) -> str:
        return f"FrictionTable of {len(self.slip)} slips up to {self.slip[-1]:g}: {self}"

    def __str__(self) -> str:
        return f"F1 in {span(self.F1)}, F2 in {span(self.F2)}, by a table of |u_t|"


@dataclass(frozen=True)
class FrictionFunction:
    """Coefficients given by a callable ``F(node, slip)``.

    Attributes
    ----------
    function : callable
        Of the row number of a contact node and its slip ``|u_t|`` [length]; returns one coefficient, or F1 and F2 [-].
    labels : tuple
        Names of the contact nodes, for messages.
    """

    function: Callable[[int, float], Any]
    labels: tuple[Any, ...]
    depends_on_slip = True

    def at(self, slip: Floats) -> Floats:
        """Coefficients F1, F2 at slips (p,) [length], shape (p, 2) [-].

        Raises
        ------
        InvalidProblemError
            The callable returns something else than one or two finite numbers >= 0.
        """
        return np.array([self._pair(node, value) for node, value in enumerate(slip.tolist())])

    def _pair(self, node: int, slip: float) -> tuple[float, float]:
        found = self.function(node, slip)
        values = np.full(2, np.nan)
        with np.errstate(over="ignore"), suppress(InvalidProblemError, TypeError, ValueError, OverflowError):
            numbers = plain_array(found, "friction", error=InvalidProblemError)
            if numbers.dtype.kind in "fiuO":
                values = np.broadcast_to(numbers.astype(np.float64), (2,))
        if not np.all(np.isfinite(values) & (values >= 0)):
            raise InvalidProblemError(
                f"friction returns {shown(found)} at contact node {self.labels[node]} for slip {slip:g}; "
                "expected one coefficient or a pair (F1, F2), finite and >= 0"
            )
        return float(values[0]), float(values[1])

    def __str__(self) -> str:
        return f"{getattr(self.function, '__name__', type(self.function).__name__)}(node, |u_t|)"


def friction_law(value: object, p: int, labels: tuple[Any, ...]) -> FrictionLaw:
    """The coefficients of p contact nodes from a number, pair, FrictionTable or callable.

    Raises
    ------
    InvalidProblemError
        It is none of these, or has the wrong shape.
    """
    if isinstance(value, FrictionTable):
        value.check_nodes(p)
        return value
    if callable(value):
        return FrictionFunction(value, labels)
    return ConstantFriction(friction_pair(value, "friction", p))


def friction_pair(value: object, name: str, p: int) -> Floats:
    """A number, or a pair of numbers or arrays, as an array of shape (p, 2).

    Raises
    ------
    InvalidProblemError
        It is neither.
    """
    if exact_number(value) is not None:
        value = (value, value)
    if not isinstance(value, (tuple, list)) or len(value) != 2:
        found = f"a {type(value).__name__} of length {len(value)}" if isinstance(value, (tuple, list)) else shown(value)
        expected = _EXPECTED if name == "friction" else "expected a number, or a pair of numbers or (p,) arrays"
        raise InvalidProblemError(f"{name} is {found}; {expected}")
    return np.stack([vector(value[k], f"{name} F{k + 1}", p, broadcast=True) for k in range(2)], axis=1)


def warn_of_jumps(law: FrictionLaw, reach: Floats, labels: tuple[Any, ...]) -> None:
    """Warn where a coefficient seems to jump as a function of the slip, for slips up to ``reach`` of shape (p,).

    The largest step between neighbouring samples of every node is bisected: a step that does not get smaller with the
    distance is a jump. A function that jumps need not have a fixed point (paper, Section 3).
    """
    shares = np.linspace(0.0, 1.0, _JUMP_SAMPLES)
    values = np.array([law.at(share * reach) for share in shares])
    step = np.max(np.abs(np.diff(values, axis=0)), axis=2)
    where = np.argmax(step, axis=0)
    low, high = shares[where] * reach, shares[where + 1] * reach
    at_low, at_high = law.at(low), law.at(high)
    for _ in range(_JUMP_BISECTIONS):
        middle = 0.5 * (low + high)
        at_middle = law.at(middle)
        first = _size(at_middle - at_low) >= _size(at_high - at_middle)
        low, high = np.where(first, low, middle), np.where(first, middle, high)
        at_low, at_high = np.where(first[:, None], at_low, at_middle), np.where(first[:, None], at_middle, at_high)
    largest, scale = np.max(step, axis=0), np.max(np.abs(values), axis=(0, 2))
    jumps = (_size(at_high - at_low) > _JUMP_SHARE * largest) & (largest > 1e-6 * scale)
    if np.any(jumps):
        node = int(np.argmax(jumps))
        warnings.warn(
            f"friction jumps by {_size(at_high - at_low)[node]:.3g} near slip {high[node]:.6g} at contact node "
            f"{labels[node]}; expected a Lipschitz function of the slip, without which there may be no fixed point",
            FrictionJumpWarning,
            stacklevel=9,  # the caller of successive_approximations
        )


def _size(change: Floats) -> Floats:
    return np.asarray(np.max(np.abs(change), axis=1))


def _column(value: ArrayLike, name: str, count: int) -> Floats:
    array = real_array(value, f"{name} of the friction table")
    if array.ndim not in (1, 2) or array.shape[-1] != count:
        raise InvalidProblemError(
            f"{name} of the friction table has shape {array.shape}; expected ({count},) or (p, {count})"
        )
    if np.min(array) < 0:
        raise InvalidProblemError(f"{name} of the friction table has the value {np.min(array):g}; expected F >= 0")
    return sealed(array)
