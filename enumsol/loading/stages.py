"""One stage of a history: the roots of one step from one start, and where each of them leaves the contact nodes."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.arithmetic.balls import SAFE, UNIT, Ball
from enumsol.condensation.enclosure import NotEnclosedError
from enumsol.model.restart import SlipStart
from enumsol.model.statuses import ContactStatus
from enumsol.trusted.positions import certain_statuses, tangential_positions

if TYPE_CHECKING:
    from collections.abc import Hashable

    from numpy.typing import NDArray

    from enumsol.roots.root import Root
    from enumsol.roots.root_set import RootSet

    Array = NDArray[np.float64]

#: A start is stated with a larger radius than was found, so that a checker on another processor, whose rounding is
#: different, finds its own ball inside: by this share, and by this many times what rounding has left in the first step.
_WIDER, _ROUNDINGS = 2.0**-5, 2.0


@dataclass(frozen=True, eq=False)
class Stage:
    """The roots of one step from one start.

    Attributes
    ----------
    number : int
        In the order in which the stages of a history were searched.
    step : int
        From 1.
    start : SlipStart
    roots : RootSet
    problem : ContactProblem or ContactProblem3D
        The step's own: its load, its friction and the start as slip offset.
    reasons : tuple of str
        Why it is not proven that nothing else solves this step, each one sentence.
    """

    number: int
    step: int
    start: SlipStart
    roots: RootSet
    problem: Any
    reasons: tuple[str, ...]

    @property
    def largest_radius(self) -> float:
        """How far the start may be from its midpoint, at most [length]."""
        return 0.0 if self.start.radius is None else float(np.max(self.start.radius))


@dataclass
class Rounding:
    """What rounding alone has left of the positions: the largest radius among those of the first step [length]."""

    first: float = 0.0

    def widened(self, found: Ball, before: SlipStart) -> SlipStart:
        """A ball as a start, stated wider (see above); what was carried over unchanged stays as it was."""
        kept = (found.mid == before.ball.mid) & (found.rad == before.ball.rad)
        if before.radius is None:
            self.first = max(self.first, float(np.max(found.rad, initial=0.0)))
        more = found.rad * _WIDER + _ROUNDINGS * np.minimum(self.first, found.rad)
        more += 8 * UNIT * np.abs(found.mid)
        radius = np.where(kept, found.rad, (found.rad + more) * SAFE)
        offset, radius = (values.reshape(before.offset.shape, order="F") for values in (found.mid, radius))
        return SlipStart(offset, radius if np.any(radius) else None)


def start_after(stage: Stage, root: Root, rounding: Rounding) -> SlipStart | None:
    """The start of the next step after a root; None where it cannot be enclosed (theory, section 13.2)."""
    arithmetic = stage.roots.arithmetic
    if arithmetic == "fast":
        return SlipStart(stage.start.offset + root.u_t)
    if arithmetic == "exact":
        if root.exact_slips is None:
            return None
        pairs = zip(stage.start.rationals, root.exact_slips, strict=True)
        return SlipStart.of_rationals(tuple(before + slip for before, slip in pairs))
    found = _enclosed_positions(stage, root)
    return None if found is None else rounding.widened(found, stage.start)


def case_of(stage: Stage, root: Root) -> Hashable | None:
    """Equal for regular roots of one step whose ends are the same functions of the same balls; None: not known.

    In 2D what a regular root of a selection is depends on the offsets of its sticking nodes only.
    """
    if stage.roots.arithmetic != "verified" or not root.regular or root.u_t.ndim > 1:
        return None
    ball = stage.start.ball
    sticking = [k for k, status in enumerate(root.statuses) if status is ContactStatus.STICK]
    return stage.step, root.statuses, tuple(ball.mid[sticking].tolist()), tuple(ball.rad[sticking].tolist())


def _enclosed_positions(stage: Stage, root: Root) -> Ball | None:
    if root.enclosure is None or stage.roots.certified_data != "problem":
        return None
    low, high = root.enclosure.u_t[..., 0].ravel(order="F"), root.enclosure.u_t[..., 1].ravel(order="F")
    still = (low == 0) & (high == 0)
    before = stage.start.ball
    if np.all(still):
        return before
    try:
        enclosure = stage.problem.enclosure
        forces = _forces(root)
        codes = certain_statuses(forces, _middle(low, high)) if root.u_t.ndim == 1 else None
        moved = tangential_positions(enclosure, Fraction(root.alpha), forces, still, before, codes)
    except NotEnclosedError:
        return None
    return moved if np.all(np.isfinite(moved.rad)) else None


def _forces(root: Root) -> Ball:
    """lambda as a ball: all normal components, then the tangential ones, direction by direction."""
    assert root.enclosure is not None
    bounds = [root.enclosure.lambda_n, root.enclosure.lambda_t]
    low, high = (np.concatenate([b[..., k].ravel(order="F") for b in bounds]) for k in (0, 1))
    return _middle(low, high)


def _middle(low: Array, high: Array) -> Ball:
    """Balls that hold what lies between bounds."""
    mid = 0.5 * low + 0.5 * high
    return Ball(mid, np.maximum(high - mid, mid - low) * SAFE)


def dissipated(root: Root) -> float:
    """The work of friction in a step, the sum of lambda_t . u_t over the nodes [force times length]."""
    return float(np.sum(root.lambda_t * root.u_t))


def contact_displacements(problem: Any, root: Root) -> Array:
    """Bn u and Bt u in one column, by which roots of one step are near each other [length]."""
    return np.concatenate([root.u_n + problem.gap, (root.u_t + problem.slip_offset).ravel()])
