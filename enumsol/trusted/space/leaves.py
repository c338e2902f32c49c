"""The trusted core in 3D: what a leaf holds, by Krawczyk's operator on balls (theory, section 12.3).

A leaf gives every node a status: open, in contact without friction, slip+ or slip- along one axis, stick, or a sector
of slip directions. What is concluded here holds for all data in the balls.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.balls import SAFE, UNIT, Ball, determinant_sign, nearly_singular, rough_inverse
from enumsol.trusted.at_alpha import Apart, told_apart
from enumsol.trusted.space.leaf_equations import (
    ROUNDED_ANGLE,
    Drift,
    Leaf,
    State,
    are_outside,
    around_middle,
    drift_in,
    is_broken,
    patterns,
    slacks,
    span_in,
    turned,
    with_free_bounds,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from enumsol.condensation.space_condensed import EnclosedSpace
    from enumsol.support.array_types import Floats

    _RootLeaf = tuple[tuple[int, ...], "SpaceRoot"]


#: Contractions of a box before the leaf is given up.
_CONTRACTIONS = 10
#: Contractions of a box that holds exactly one zero, down to rounding; and over a piece of alpha, where the zero moves.
_REFINEMENTS, _OVER_PIECE = 60, 2


def _cut(angle: Floats, radius: Floats, reach: Floats, move: Ball) -> tuple[Floats, Floats]:
    """The part of a box of angles that lies within ``move`` of its centre."""
    low, high = np.maximum(move.mid - move.rad, -radius), np.minimum(move.mid + move.rad, radius)
    middle = 0.5 * (low + high)
    # low, high, their middle and the new centre are rounded by less than a unit each
    return angle + middle, np.maximum(high - middle, middle - low) * SAFE + 4 * UNIT * reach


@dataclass(frozen=True)
class SpaceRoot:
    """Exactly one root in a box of directions, regular: all conditions hold strictly.

    Attributes
    ----------
    y, w : Ball of shape (m,)
        Forces (lambda_n, tau) and displacements, scaled.
    centre : (q, 2) array
        A direction for every node in a sector; angles count from there.
    angle, angle_rad : (q,) arrays
        The root's directions.
    reach : (q,) array
        There is no other root with these statuses and angles up to ``reach``.
    index : int
    slack : float
        A lower bound of the least slack.
    rigid : Ball of shape (r,), or None
        Of a body that nothing holds, the coordinates q of its rigid displacement.
    drift : Drift or None
        Over a piece of alpha.
    """

    y: Ball
    w: Ball
    centre: Floats
    angle: Floats
    angle_rad: Floats
    reach: Floats
    index: int
    slack: float
    rigid: Ball | None = None
    drift: Drift | None = None

    def away_from(self, centre: Floats, angle: Floats | float) -> Floats:
        """Bounds of angles between its directions and those at an angle from other ones, (q,)."""
        return np.asarray(np.abs(turned(centre, self.centre) + self.angle - angle) + self.angle_rad + ROUNDED_ANGLE)


@dataclass(frozen=True)
class LastBox:
    """The last box of a leaf that is not settled: all unknowns but s, and the state there, None if it is not known."""

    leaf: Leaf
    angle: Floats
    radius: Floats
    state: State | None


@dataclass(frozen=True)
class Open:
    """A leaf that is not settled, with bounds of all solutions in it.

    Attributes
    ----------
    y, w : Ball of shape (m,), or None
        As in SpaceRoot; None where the linear system is not proven regular in the box.
    centre : (q, 2) array
    angle, angle_rad : (q,) arrays
        As in SpaceRoot.
    last : LastBox or None
        What a search looks at to tell what stands in the way.
    drift : Drift or None
        Over a piece of alpha, where it is known.
    span : pair of floats
        Over a piece of alpha, bounds of s, from -1 to 1, at all solutions in it.
    rigid : Ball of shape (r,), or None
        As in SpaceRoot; None where y is.
    """

    y: Ball | None
    w: Ball | None
    centre: Floats
    angle: Floats
    angle_rad: Floats
    last: LastBox | None = None
    drift: Drift | None = None
    span: tuple[float, float] = (-1.0, 1.0)
    rigid: Ball | None = None

    def bounds_more(self, other: Open) -> bool:
        """True if this leaves less of a piece open than ``other``, or has bounds where that has none."""
        shorter = self.span[1] - self.span[0] < other.span[1] - other.span[0]
        return self.y is not None and (other.y is None or shorter)


def settle(system: EnclosedSpace, codes: Sequence[int]) -> SpaceRoot | Open | None:
    """Contents of a leaf: exactly one root in its box, no root (None), or it is not settled."""
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        leaf = Leaf(system, codes)
        found = contents(leaf)
        loosened = leaf.loosened() if isinstance(found, Open) else None
        again = found if loosened is None else contents(loosened)
        return found if isinstance(again, Open) and isinstance(found, Open) and found.bounds_more(again) else again


def unsettled(system: EnclosedSpace, codes: Sequence[int]) -> Open:
    """A leaf of which nothing is known but its sectors."""
    leaf = Leaf(system, codes)
    return Open(None, None, leaf.centre, np.zeros(len(leaf.half)), leaf.half)


def contents(leaf: Leaf) -> SpaceRoot | Open | None:
    """Contents of a leaf as ``settle`` has them, with the normal forces left free that are.

    Angles in what follows are the values of the free unknowns, too, after those of the directions.
    """
    q, turns, radius = len(leaf.turning), leaf.widened, np.r_[leaf.widened, leaf.room]
    angle = np.zeros(len(radius))
    state, rough = None, False
    for _ in range(_CONTRACTIONS):
        if leaf.free:
            cut = with_free_bounds(leaf, angle, radius)
            if cut is None:
                return None
            angle, radius = cut
            if not np.all(np.isfinite(radius)):
                break
        reach = np.r_[turns, np.abs(angle[q:]) + radius[q:]]
        state = leaf.over(angle, radius) or state
        if state is None:
            break
        if is_broken(leaf, state.y, state.w, angle, radius) or np.any(are_outside(leaf, angle, radius)):
            return None
        if not len(angle):
            return _root(leaf, state, angle, radius, reach)
        new_angle, new_radius = angle, radius
        move = krawczyk(leaf, angle, radius, state, rough=rough)
        if move is not None:
            if np.any(np.abs(move.mid) > (move.rad + radius) * SAFE):
                return None
            new_angle, new_radius = _cut(angle, radius, reach, move)
            # the box holds exactly one zero
            if np.all(move.size < radius):
                return _refined(leaf, new_angle, new_radius, reach)
        if np.any(new_radius <= 0.9 * radius):
            angle, radius = new_angle, new_radius
        elif rough or (move is not None and not nearly_singular(state.J.mid)):
            break
        else:
            rough = True
    return _left_open(leaf, angle, radius, state)


def krawczyk(leaf: Leaf, angle: Floats, radius: Floats, state: State, *, rough: bool = False) -> Ball | None:
    """Krawczyk's operator: a ball of psi - angle for all zeros psi in a box over which the state is known.

    ``rough``: only in the directions in which dG/dpsi is surely not singular, so that those of other nodes are cut.
    """
    q = len(angle)
    point = leaf.over(angle, np.zeros(q), still=True)
    if point is None or not (state.J.finite and point.J.finite):
        return None
    try:
        Y = np.asarray(rough_inverse(state.J) if rough else np.linalg.inv(point.J.mid), dtype=np.float64)
    except np.linalg.LinAlgError:
        return None
    _, along, move = around_middle(leaf, Y, q, (angle, radius), (state, point))
    # from the middle of a piece to any alpha, the angles held, then to any angles
    return Ball(move.mid, (move.rad + along.size) * SAFE) if leaf.piece else move


def _refined(leaf: Leaf, angle: Floats, radius: Floats, reach: Floats) -> SpaceRoot | Open | None:
    """The one zero of a box, enclosed as closely as floats can."""
    for _ in range(_OVER_PIECE if leaf.piece else _REFINEMENTS):
        if np.any(are_outside(leaf, angle, radius)):
            return None
        state = leaf.over(angle, radius)
        move = None if state is None else krawczyk(leaf, angle, radius, state)
        if move is None:
            break
        new_angle, new_radius = _cut(angle, radius, reach, move)
        # the zero lies in both boxes, angle by angle: an angle that rounding keeps from becoming narrower stays
        narrower = new_radius < radius
        done = not np.any(new_radius <= 0.9 * radius)
        angle, radius = np.where(narrower, new_angle, angle), np.where(narrower, new_radius, radius)
        if done:
            break
    state = leaf.over(angle, radius)
    if state is None:
        return _left_open(leaf, angle, radius, None)
    if is_broken(leaf, state.y, state.w, angle, radius) or np.any(are_outside(leaf, angle, radius)):
        return None
    return _root(leaf, state, angle, radius, reach)


def _left_open(leaf: Leaf, angle: Floats, radius: Floats, state: State | None) -> Open | None:
    """Bounds of a leaf that is not settled; None if nothing is known of it."""
    m, q, last = len(leaf.system.g), len(leaf.turning), LastBox(leaf, angle, radius, state)
    y, w = (None, None) if state is None else (state.y[:m], state.w[:m])
    rigid = None if state is None or not len(leaf.system.reach) else -state.y[m:]
    span = span_in(leaf, angle, radius)
    if span is None:
        return None
    drift, possible = drift_in(leaf, angle, radius)
    if not possible:
        return None
    angle, radius = angle[:q], radius[:q]
    low, high = np.maximum(angle - radius, -leaf.half), np.minimum(angle + radius, leaf.half)
    box = 0.5 * (low + high), 0.5 * np.abs(high - low) * SAFE + 4 * UNIT
    return Open(y, w, leaf.centre, *box, last, drift, span, rigid)


def _root(leaf: Leaf, state: State, angle: Floats, radius: Floats, reach: Floats) -> SpaceRoot | Open | None:
    """The one zero of a box as a root, if all conditions hold strictly and its index is proven."""
    slack = slacks(leaf, state.y, state.w, angle, radius)
    turning = leaf.equations(angle) if np.all(slack > 0) else None
    sign = 0 if turning is None else turning.sign * determinant_sign(state.J)
    if not sign:
        return _left_open(leaf, angle, radius, state)
    least = float(np.min(slack)) if len(slack) else np.inf
    m, modes, q = len(leaf.system.g), len(leaf.system.reach), len(leaf.turning)
    # with the columns of q in place of those of -q, and with the rows of equilibrium of the other sign
    sign = -sign if (modes + len(leaf.free)) % 2 else sign
    drift = drift_in(leaf, angle, radius)[0]
    box = angle[:q], radius[:q], reach[:q]
    rigid = -state.y[m:] if modes else None
    return SpaceRoot(state.y[:m], state.w[:m], leaf.centre, *box, sign, least, rigid, drift)


def same_root(one: SpaceRoot, other: SpaceRoot) -> bool | None:
    """True if two roots of leaves with the same statuses up to sectors are one; None where that is open.

    The leaves have the same nodes open, sticking and slipping. They are one if one root's directions lie in the box in
    which the other is the only root; they are two if their forces differ.
    """
    if _apart(one.y, other.y) or (one.rigid is not None and other.rigid is not None and _apart(one.rigid, other.rigid)):
        return False
    return True if np.all(one.away_from(other.centre, 0.0) < other.reach) else None


def _apart(one: Ball, other: Ball) -> bool:
    return bool(np.any(np.abs(one.mid - other.mid) > (one.rad + other.rad) * SAFE))


def distinct_roots(found: Iterable[_RootLeaf]) -> Apart[_RootLeaf]:
    """Leaves by the roots that they hold, whatever the order in which they are given."""

    def same(other: _RootLeaf, one: _RootLeaf) -> bool | None:
        return same_root(one[1], other[1]) if patterns(other[0]) == patterns(one[0]) else False

    return told_apart(sorted(found, key=lambda leaf: leaf[0]), same)
