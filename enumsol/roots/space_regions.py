"""Leaves in 3D that stayed undecided, put together where they touch (theory, section 12.5)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball, smaller, solution, upper_norm
from enumsol.model.sectors import SECTORS
from enumsol.model.statuses import OPEN, SLIP_MINUS, SLIP_PLUS, STICK
from enumsol.support.deadlines import over, tell
from enumsol.trusted.space.leaves import Open, SpaceRoot, settle, unsettled

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.condensation.space_condensed import EnclosedSpace
    from enumsol.support.array_types import Codes, Floats, Indices, Mask
    from enumsol.trusted.space.space_uniqueness import LooseSolution


@dataclass(frozen=True)
class Region:
    """Leaves that touch, and what bounds every root in them.

    Attributes
    ----------
    codes : tuple of Codes
    y, w : Ball of shape (m,)
        Forces and displacements, scaled.
    slip_angle : (p, 2) array
        Bounds of the angles of v, the lower one in [-pi, pi); nan where no leaf slips in a sector.
    """

    codes: tuple[Codes, ...]
    y: Ball
    w: Ball
    slip_angle: Floats


@dataclass(frozen=True)
class _Boxes:
    """Bounds of the roots of N leaves: of (y, w), (N, 2 m), and of angles, (N, p), nan where a node does not slip."""

    low: Floats
    high: Floats
    angle: Floats
    radius: Floats
    in_sector: Mask

    def touching(self, one: int, others: Indices) -> Mask:
        """Which of the others may have a root in common with one, or roots that are connected."""
        meet = np.all((self.low[others] <= self.high[one]) & (self.high[others] >= self.low[one]), axis=1)
        turn = np.abs(np.remainder(self.angle[others] - self.angle[one] + np.pi, 2 * np.pi) - np.pi)
        apart = self.in_sector[others] & self.in_sector[one] & (turn > self.radius[others] + self.radius[one])
        return np.asarray(meet & ~np.any(apart, axis=1))


def regions_of(system: EnclosedSpace, leaves: Sequence[Codes]) -> list[Region]:
    """Undecided leaves as regions, in the order of their first leaves.

    Two leaves touch if their bounds of forces and displacements meet and, at every node that slips in both, those of
    its direction. Statuses may differ: at a border of two statuses the bounds of both leaves meet. Leaves left
    when the time is over get the bounds that all solutions have.
    """
    boxes = _boxes(system, leaves)
    left = np.arange(len(leaves))
    regions = []
    while len(left):
        members, waiting = [], [int(left[0])]
        left = left[1:]
        while waiting:
            tell("undecided leaves joined", len(leaves) - len(left) - len(waiting), len(leaves))
            one = waiting.pop()
            members.append(one)
            touching = boxes.touching(one, left)
            waiting += left[touching].tolist()
            left = left[~touching]
        members.sort()
        m = len(system.g)
        both = _ball(np.min(boxes.low[members], axis=0), np.max(boxes.high[members], axis=0))
        angles = [_hull(boxes.angle[members, i], boxes.radius[members, i]) for i in range(boxes.angle.shape[1])]
        codes = tuple(leaves[k] for k in members)
        regions.append(Region(codes, both[:m], both[m:], np.array(angles)))
    return regions


def with_zeros(system: EnclosedSpace, codes: Codes, y: Ball, w: Ball) -> tuple[Ball, Ball]:
    """Forces and displacements of a leaf without radii where its statuses say that they are 0."""
    tau, p, code = system.tau, len(system.tau), np.array(codes)
    done = []
    for ball, normal, tangential in ((y, code == OPEN, code == OPEN), (w, code != OPEN, code == STICK)):
        zero = np.zeros(len(ball.mid), dtype=bool)
        zero[:p] = normal
        zero[tau[tangential][tau[tangential] >= 0]] = True
        done.append(Ball(np.where(zero, 0.0, ball.mid), np.where(zero, 0.0, ball.rad)))
    return done[0], done[1]


def slip_angles(system: EnclosedSpace, codes: Codes, leaf: SpaceRoot | Open | None) -> tuple[Floats, Floats]:
    """Directions of v as angles and radii, (p,) each; nan where a node does not slip against friction."""
    angle, radius = np.full((2, len(codes)), np.nan)
    for i, code in enumerate(codes):
        if code in (SLIP_PLUS, SLIP_MINUS):
            angle[i] = (0.0 if code == SLIP_PLUS else np.pi) + (0.0 if system.tau[i, 0] >= 0 else 0.5 * np.pi)
            radius[i] = 1e-15
    turning = [i for i, code in enumerate(codes) if code > SECTORS]
    if leaf is not None:
        angle[turning] = np.arctan2(leaf.centre[:, 1], leaf.centre[:, 0]) + leaf.angle
        radius[turning] = leaf.angle_rad * SAFE + 1e-14
    return angle, radius


def loose_angles(system: EnclosedSpace, found: LooseSolution) -> tuple[Floats, Floats]:
    """Directions of v as angles and radii, (p,) each; nan where a node does not slip against friction for certain."""
    angle, radius = np.full((2, len(found.slip)), np.nan)
    for i in np.flatnonzero(found.slip):
        t = system.tau[i]
        if not np.any(t >= 0):
            continue
        scale = system.slip_scale[i] / system.unit[t]
        v, r = np.where(t >= 0, found.w.mid[t] * scale, 0.0), np.where(t >= 0, found.w.rad[t] * scale, 0.0)
        known, wide = float(np.linalg.norm(v)), float(upper_norm(r * SAFE + TINY))
        angle[i] = np.arctan2(v[1], v[0])
        # sin x >= 2 x / pi
        radius[i] = 0.5 * np.pi * wide / known * SAFE + 1e-14 if known > wide * SAFE else np.pi
    return angle, radius


def _boxes(system: EnclosedSpace, leaves: Sequence[Codes]) -> _Boxes:
    count, p, m = len(leaves), len(system.tau), len(system.g)
    low, high = np.empty((2, count, 2 * m))
    angle, radius = np.empty((2, count, p))
    everywhere = _energy_bounds(system)
    modes, (S, g, _) = len(system.reach), system.balls
    for k, codes in enumerate(leaves):
        tell("undecided leaves bounded", k, count)
        leaf = unsettled(system, codes) if over() else settle(system, codes)
        angle[k], radius[k] = slip_angles(system, codes, leaf)
        y = everywhere if leaf is None or leaf.y is None else smaller(leaf.y, everywhere)
        # with -q, which is known no better here, as the last unknowns of a body that nothing holds
        all_y = Ball.joined(y, Ball(np.zeros(modes), system.reach))
        w = (g - (S @ all_y[:, None])[:, 0])[:m]
        y, w = with_zeros(system, codes, y, w if leaf is None or leaf.w is None else smaller(leaf.w, w))
        mid, rad = np.concatenate([y.mid, w.mid]), np.concatenate([y.rad, w.rad]) * SAFE
        low[k], high[k] = mid - rad, mid + rad
    # lambda_n >= 0 and w_n <= 0
    low[:, :p], high[:, m : m + p] = np.maximum(low[:, :p], 0.0), np.minimum(high[:, m : m + p], 0.0)
    return _Boxes(np.minimum(low, high), high, angle, radius, np.array(leaves) > SECTORS)


def _energy_bounds(system: EnclosedSpace) -> Ball:
    """All y with e(y) <= 0: an ellipsoid around S^{-1} g / 2 through 0.

    Of a body that nothing holds e(y) <= h'q, which is at most the product of the load and the bounds of q.
    """
    m = len(system.g)
    S, g = Ball(system.S, system.S_rad), Ball(system.g, system.g_rad)
    inverse = solution(S, Ball.exact(np.eye(m)))
    if inverse is None:
        return Ball(np.zeros(m), np.full(m, system.largest_forces))
    middle = (inverse @ Ball(0.5 * g.mid[:, None], 0.5 * g.rad[:, None]))[:, 0]
    energy = float((g[None] @ middle[:, None]).size[0, 0]) * 0.5 + system.largest_work
    reach = np.sqrt(np.diagonal(inverse.size) * energy) * (1.0 + 4 * UNIT)
    return Ball(middle.mid, (middle.rad + reach) * SAFE + TINY)


def _ball(low: Floats, high: Floats) -> Ball:
    """The ball between bounds."""
    mid = low + 0.5 * (high - low)
    return Ball(mid, np.maximum(high - mid, mid - low) * SAFE)


def _hull(angle: Floats, radius: Floats) -> Floats:
    """The shortest arc that holds some arcs, the nan left out; nan where there is none."""
    known = np.isfinite(radius)
    if not np.any(known):
        return np.full(2, np.nan)
    start = np.remainder(angle[known] - radius[known] + np.pi, 2 * np.pi) - np.pi
    order = np.argsort(start)
    start, end = start[order], (start + 2.0 * radius[known])[order]
    # how far the arcs that begin no later reach, once round included
    reach = np.maximum.accumulate(np.concatenate([end - 2 * np.pi, end]))[len(end) - 1 :]
    gaps = np.append(start, start[0] + 2 * np.pi) - reach
    widest = int(np.argmax(gaps))
    if not gaps[widest] > 0:
        return np.array([-np.pi, np.pi])
    low = start[widest % len(start)]
    high = reach[widest] + (2 * np.pi if reach[widest] < low else 0.0)
    return np.array([low, high])
