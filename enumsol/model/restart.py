"""A body in the next step of a history: another load, friction and slip offset, on the factors of the first."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any, TypeVar

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball
from enumsol.model.contact_body import ContactBody
from enumsol.support.array_types import Floats
from enumsol.support.immutable import Sealed, sealed

_Body = TypeVar("_Body", bound=ContactBody)


@dataclass(frozen=True, eq=False)
class SlipStart(Sealed):
    """From where slip is counted: the tangential positions of the contact nodes at the beginning of a step.

    Attributes
    ----------
    offset : (p,) array, in 3D (p, 2) [length]
    radius : array of the same shape, or None
        How far the positions may be from ``offset``; None: not at all.
    exact : tuple of Fraction, or None
        The positions where arithmetic is exact and floats do not hold them.
    """

    offset: Floats
    radius: Floats | None = None
    exact: tuple[Fraction, ...] | None = None

    @classmethod
    def of(cls, problem: ContactBody) -> SlipStart:
        """Start of a problem."""
        return cls(problem.slip_offset, problem.offset_radius, problem.exact_offset)

    @classmethod
    def of_rationals(cls, values: tuple[Fraction, ...]) -> SlipStart:
        """Exact positions, in 2D."""
        offset = np.array([float(value) for value in values])
        inexact = [Fraction(x) != value for x, value in zip(offset.tolist(), values, strict=True)]
        if not any(inexact):
            return cls(offset)
        return cls(offset, np.where(inexact, 2 * UNIT * np.abs(offset) + TINY, 0.0), values)

    @property
    def ball(self) -> Ball:
        """Offset and radius in one column: all nodes' first, then all nodes' second components."""
        mid = self.offset.ravel(order="F")
        return Ball(mid, np.zeros_like(mid) if self.radius is None else self.radius.ravel(order="F"))

    @property
    def rationals(self) -> tuple[Fraction, ...]:
        """The offset without rounding, in 2D."""
        return tuple(map(Fraction, self.offset.tolist())) if self.exact is None else self.exact

    @property
    def key(self) -> tuple[Any, ...]:
        """Equal for starts from which the same step follows."""
        return self.exact, self.offset.tobytes(), None if self.radius is None else self.radius.tobytes()

    def hull(self, other: SlipStart) -> SlipStart:
        """A ball that holds both."""
        parts = (self, other)
        radii = [np.zeros_like(part.offset) if part.radius is None else part.radius for part in parts]
        offset = 0.5 * self.offset + 0.5 * other.offset
        far = [np.abs(part.offset - offset) + rad for part, rad in zip(parts, radii, strict=True)]
        radius = np.maximum(*far) * SAFE + 4 * UNIT * np.abs(offset) + TINY
        same = (self.offset == other.offset) & (radii[0] == radii[1])
        offset, radius = np.where(same, self.offset, offset), np.where(same, radii[0], radius)
        return SlipStart(offset, radius if np.any(radius) else None)

    def holds(self, other: Ball) -> bool:
        """True if every position in a ball, in one column as ``ball``, is one of these."""
        own = self.ball
        far = (np.abs(own.mid - other.mid) * (1 + 4 * UNIT) + other.rad) * SAFE
        return bool(np.all((far <= own.rad) | ((own.mid == other.mid) & (other.rad <= own.rad))))


def restarted(problem: _Body, start: SlipStart, load: Floats | None = None, friction: Floats | None = None) -> _Body:
    """The problem with another slip offset, and where they are given with another load and other coefficients.

    Nothing that depends on the matrices alone is computed again, their enclosure if it is known.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
    start : SlipStart
    load : (n,) array, which does not depend on alpha, or None
    friction : (p,) array, in 3D (p, 2), which does not depend on alpha, or None
    """
    given: dict[str, Any] = {
        "_origin": problem._origin or problem,
        "slip_offset": sealed(start.offset.reshape(problem.slip_offset.shape) + 0.0),
        "offset_radius": None if start.radius is None else sealed(start.radius.reshape(start.offset.shape)),
        "exact_offset": start.exact,
    }
    if friction is not None:
        given |= problem.constant_friction(friction)
    if load is not None:
        given |= {"f": sealed(load + 0.0), "load_slope": None}
    return afresh(problem, **given)


def afresh(problem: _Body, **known: Any) -> _Body:
    """Copy of a problem without what it has computed, but for the factors of A, on whose accuracy no bound rests.

    ``known`` are attributes that are other ones in the copy.
    """
    other, kind = object.__new__(type(problem)), type(problem)
    # not copy.copy, which leaves the factorization behind as pickles have to
    kept = {
        name: value
        for name, value in problem.__dict__.items()
        if name == "factorization" or not isinstance(getattr(kind, name, None), cached_property)
    }
    other.__setstate__(kept | {"_origin": None} | known)
    return other
