"""The natural map of a problem in 3D, y - P(y + rho w), in balls: P, its derivatives, and Krawczyk's operator on sets.

What boxes with one solution (theory, section 12.7) and boxes of curves of solutions (theory, section 12.8) share.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball, upper_norm, upper_sum
from enumsol.support.array_types import Floats, Indices, Mask

#: What a writer of proofs asks for beyond what a checker does.
MARGIN = 2.0**-10
#: Places of the unit matrix in blocks of both components of tau.
_BOTH = [[1], [2]], [[1], [2]]


@dataclass(frozen=True)
class Corners:
    """Derivatives of P in a box: those in ``core`` plus sum t_k u_k v_k', |t_k| <= 1/2, u_k and v_k columns."""

    core: Ball
    u: Floats
    v: Floats


@dataclass(frozen=True)
class Discs:
    """P: lambda_n to at least 0, tau to the disc of radius F lambda_n; F may depend on one more argument.

    Where F is negative, P is continued by what slip gives.

    Attributes
    ----------
    tau : (p, 2) array of int
        Places of the tau of every node in y, -1 where there is none.
    F : Ball of shape (p,)
        All that occur.
    slope : Ball of shape (p,), or None
        The derivative of F with respect to the last argument; None where there is no such argument.
    """

    tau: Indices
    F: Ball
    slope: Ball | None = None

    def projected(self, z: Ball) -> Ball:
        """P of a ball of arguments."""
        out = Ball(np.zeros_like(z.mid), np.zeros_like(z.rad))
        p, has = len(self.tau), self.tau >= 0
        n, n_rad, tangent = np.maximum(z.mid[:p], 0.0), z.rad[:p], self.tangents(z)
        out.mid[:p], out.rad[:p] = n, n_rad
        F, F_size = np.abs(self.F.mid), np.abs(self.F.mid) + self.F.rad
        most, length = self.F.mid * n, np.linalg.norm(tangent.mid, axis=1)
        share = np.where(length <= most, 1.0, most / length)
        # |P(z) - P(z')| <= |z_t - z_t'| + |r - r'| for discs of the radii r and r'
        reach, rounded = F_size * (n + n_rad), 16 * UNIT * (np.abs(most) + length)
        away = upper_norm(tangent.rad, axis=1)
        # r e with a negative r: |e - e'| <= 2 |z_t - z_t'| / |z_t|
        turned = np.where(length > away, 4.0 * away * reach / (length - away), np.inf)
        off = away + np.where((self.F.mid - self.F.rad < 0) & np.any(tangent.rad > 0, axis=1), turned, 0.0)
        off = (off + (reach - F * n) + rounded) * SAFE + TINY
        places = self.tau[has]
        out.mid[places] = (share[:, None] * tangent.mid)[has]
        out.rad[places] = np.broadcast_to(off[:, None], has.shape)[has]
        return out

    def tangents(self, z: Ball) -> Ball:
        """tau of every node, (p, 2); 0 where there is none."""
        has = self.tau >= 0
        return Ball(np.where(has, z.mid[self.tau], 0.0), np.where(has, z.rad[self.tau], 0.0))

    def corners(self, z: Ball, past: Ball | None = None) -> Corners | None:
        """All derivatives of P at points of a box, and their convex hull; None where there is no bound.

        ``past``: bounds of |z_t| - F z_n of every node at these points, if more is known than the box tells.

        ``core`` has a column more than rows, for the derivative with respect to the argument of F, if there is one.
        """
        if not z.finite:
            return None
        m, width = len(z.mid), len(z.mid) + (self.slope is not None)
        core = Ball(np.zeros((m, width)), np.zeros((m, width)))
        found = _Blocks.of(self, z, past)
        if found is None:
            return None
        block, u, v = found.middle, found.u, found.v
        rows = np.column_stack([np.arange(len(self.tau)), self.tau])
        columns = rows if self.slope is None else np.column_stack([rows, np.full(len(rows), m)])
        there = (rows >= 0)[:, :, None] & (columns >= 0)[:, None, :]
        to = tuple(np.broadcast_to(x, there.shape)[there] for x in (rows[:, :, None], columns[:, None, :]))
        core.mid[to], core.rad[to] = block.mid[there], block.rad[there]
        k = np.flatnonzero(found.paired)
        U, V = np.zeros((m, len(k))), np.zeros((width, len(k)))
        for matrix, places, vectors in ((U, rows[k], u[k]), (V, columns[k], v[k])):
            number, part = np.nonzero(places >= 0)
            matrix[places[number, part], number] = vectors[number, part]
        return Corners(core, U, V)


@dataclass(frozen=True)
class _Blocks:
    """Derivatives of P of every node, by (n, t1, t2) and the argument of F if there is one.

    To those that are ``paired``, t u v' with |t| <= 1/2 is to be added.

    Attributes
    ----------
    mid, rad : (p, 3, 3 or 4) arrays
    u, v : (p, 3) and (p, 3 or 4) arrays
    paired : (p,) bool array
    """

    mid: Floats
    rad: Floats
    u: Floats
    v: Floats
    paired: Mask

    @property
    def middle(self) -> Ball:
        """With u v' / 2 in the middle of its t."""
        added = 0.5 * (self.u[:, :, None] * self.v[:, None, :]) * self.paired[:, None, None]
        mid = self.mid + added
        return Ball(mid, self.rad + 2 * UNIT * np.abs(mid) * (added != 0))

    @classmethod
    def of(cls, discs: Discs, z: Ball, past: Ball | None = None) -> Self | None:
        """Of all points of a box; None where there is no bound. ``past`` as for ``Discs.corners``."""
        p, width = len(discs.tau), 3 if discs.slope is None else 4
        low, high = _outwards(z.mid[:p], z.rad[:p])
        F_low, F_high = _outwards(discs.F.mid, discs.F.rad)
        # of the discs' radii
        least = F_low * np.where(F_low >= 0, np.maximum(low, 0.0), high) - TINY
        least, most = np.where(least > 0, least / SAFE, least * SAFE), np.maximum(F_high, 0.0) * high * SAFE + TINY
        at = Directions.of(discs.tangents(z))
        touches, loose, sticks, slips = high >= 0, low <= 0, at.least <= most, at.most >= least
        if past is not None:
            sticks &= ~(past.mid > past.rad * SAFE)
            slips &= ~(past.mid < -past.rad * SAFE)
        rubs = np.any(discs.tau >= 0, axis=1) & touches
        unknown = rubs & slips & (~(at.least > 0) | (loose & sticks))
        if np.any(unknown & (F_low < 0)):
            return None
        sliding = rubs & slips & ~unknown
        blocks = cls(
            np.zeros((p, 3, width)),
            np.zeros((p, 3, width)),
            np.zeros((p, 3)),
            np.zeros((p, width)),
            (touches & loose & ~unknown) | (sliding & sticks),
        )
        blocks.mid[:, 0, 0] = touches & ~loose
        blocks.mid[rubs & ~slips, *_BOTH] = 1.0
        blocks.u[:, 0], blocks.v[:, 0] = touches & loose, 1.0
        F_size = np.maximum(np.abs(F_low), np.abs(F_high))
        change = Ball.exact(np.zeros(p)) if discs.slope is None else discs.slope
        widest = (change.size * high * SAFE)[:, None]
        if np.any(unknown):
            # any mixture of 0, of the unit matrix and of slips in any direction
            blocks.mid[unknown & loose, 0, 0] = blocks.rad[unknown & loose, 0, 0] = 0.5
            blocks.rad[unknown, 1:, 0] = F_size[unknown, None]
            blocks.rad[unknown, 1:, 1:3] = 0.5
            blocks.rad[unknown, 1:, 3:] = widest[unknown, None]
            blocks.mid[unknown, *_BOTH] = 0.5
        if not np.any(sliding):
            return blocks
        # times the direction, by lambda_n and by the argument of F where the node slips
        normal, normal_rad = 0.5 * (np.maximum(low, 0.0) + high), 0.5 * (high - np.maximum(low, 0.0)) * SAFE
        pushed = change * Ball(normal, normal_rad + 4 * UNIT * normal)
        along, also = (
            (x[:, None] * (at.turn + 4 * UNIT) + rad[:, None] * np.abs(at.e)) * SAFE
            for x, rad in ((F_size, discs.F.rad), (pushed.size, pushed.rad))
        )
        blocks.rad[sliding, 1:, 0] = along[sliding]
        blocks.rad[sliding, 1:, 3:] = np.where(loose[:, None], widest, also)[sliding, :, None]
        ratio_low = np.where(least >= 0, least / at.most / SAFE, least / at.least * SAFE)
        ratio_high = np.minimum(1.0, most / at.least * SAFE)
        blocks.slide(at, (ratio_low, ratio_high), (discs.F.mid, pushed.mid), sliding, sticks, loose)
        return blocks

    def slide(
        self,
        at: Directions,
        ratios: tuple[Floats, Floats],
        factors: tuple[Floats, Floats],
        sliding: Mask,
        sticks: Mask,
        loose: Mask,
    ) -> None:
        """Fill in nodes whose tau has a direction and that slip at some points of the box.

        Parameters
        ----------
        ratios : bounds of that of the disc's radius and |tau| where they slip
        factors : what the direction is multiplied by where they slip, by lambda_n and by the argument of F
        sticks, loose : nodes that may stick, or be open, too
        """
        low, high = (ratio[:, None, None] for ratio in ratios)
        across, size = np.abs(at.across), np.maximum(np.abs(low), np.abs(high))
        rounded = 16 * UNIT * (1.0 + size)
        F, pushed = factors
        # or stick: 1 - t (e e' + (1 - ratio) (1 - e e')), and t F e for lambda_n
        limit = sliding & sticks
        if np.any(limit):
            self.mid[limit, *_BOTH] = 1.0
            lost = (at.bent + (1.0 - low) * (across + at.bent) + rounded) * SAFE
            self.rad[limit, 1:, 1:3] = lost[limit]
            self.u[limit, 1:], self.v[limit, 1:3], self.v[limit, 0] = at.e[limit], -at.e[limit], F[limit]
            self.v[limit, 3:] = pushed[limit, None]
        # or open: t times those of slip
        graze = sliding & loose
        if np.any(graze):
            spread = 0.5 * np.abs(high) + np.maximum(-low, 0.0)
            self.mid[graze, 1:, 1:3] = (0.5 * high * at.across)[graze]
            self.rad[graze, 1:, 1:3] = ((spread * across + size * at.bent + rounded) * SAFE)[graze]
            self.u[graze, 1:] = (F[:, None] * at.e)[graze]
        # or nothing else
        only = sliding & ~sticks & ~loose
        self.mid[only, 1:, 0] = F[only, None] * at.e[only]
        self.mid[only, 1:, 3:] = (pushed[only, None] * at.e[only])[:, :, None]
        self.mid[only, 1:, 1:3] = (0.5 * (low + high) * at.across)[only]
        half = 0.5 * (high - low) * SAFE + 4 * UNIT * size
        self.rad[only, 1:, 1:3] = ((half * across + size * at.bent + rounded) * SAFE)[only]


@dataclass(frozen=True)
class Directions:
    """Directions e = x / |x| of points x in rectangles, one or none for every node.

    Attributes
    ----------
    least, most : (p,) arrays
        Bounds of |x|. Nothing else is said where ``least`` is not positive.
    e : (p, 2) array
        That of the middle.
    turn : (p, 2) array
        How far any other one is from it, component by component.
    across, bent : (p, 2, 2) arrays
        1 - e e' of the middle, and how far any other one is from it up to rounding; so for e e'.
    """

    least: Floats
    most: Floats
    e: Floats
    turn: Floats
    across: Floats
    bent: Floats

    @classmethod
    def of(cls, x: Ball) -> Directions:
        """Of points in balls of shape (p, 2); where a component is 0 without radius, e has one component."""
        length = np.linalg.norm(x.mid, axis=1)
        e = x.mid / np.where(length > 0, length, 1.0)[:, None]
        side = np.column_stack([-e[:, 1], e[:, 0]])
        # along the middle's direction, and beside it
        along, beside = (upper_sum(np.abs(one) * x.rad, axis=1) * (1.0 + 16 * UNIT) for one in (e, side))
        rounded = 8 * UNIT * length
        least = (length - along) / SAFE - rounded - TINY
        ahead = length + along
        most = np.sqrt(ahead * ahead + beside * beside) * SAFE * SAFE + rounded
        # the sine of the angle, by its tangent or by a disc around the middle
        sine = np.minimum(beside / least, upper_norm(x.rad, axis=1) / length * (1.0 + 8 * UNIT)) * SAFE
        sine = np.where(np.any((x.mid == 0) & (x.rad == 0), axis=1), 0.0, sine)[:, None]
        a, b = np.abs(e), np.abs(side)
        # e' = e cos + side sin, and 1 - cos <= sin^2
        turn = (sine * sine * a + sine * b) * SAFE + 8 * UNIT
        one, other = sine[:, :, None], a[:, :, None] * b[:, None, :]
        straight = a[:, :, None] * a[:, None, :] + b[:, :, None] * b[:, None, :]
        bent = (one * one * straight + one * (other + np.swapaxes(other, 1, 2))) * SAFE
        return cls(least, most, e, turn, side[:, :, None] * side[:, None, :], bent)


def middle_inverse(M: Ball) -> tuple[Floats, Floats] | None:
    """Y, about the inverse of the middle of M, and a bound of |I - Y M|; None where that middle is singular."""
    try:
        Y = np.asarray(np.linalg.inv(M.mid), dtype=np.float64)
    except np.linalg.LinAlgError:
        return None
    if not np.all(np.isfinite(Y)):
        return None
    return Y, (Ball.exact(np.eye(len(Y))) - Ball.exact(Y) @ M).size


@dataclass(frozen=True)
class Step:
    """x - Y N(x), N the natural map, for all x = c + t d + b within a radius of a point c, |t| <= h.

    It is c + t d + move + t drift + E b + sum (a_k + t b_k + t_k V_k b) G_k, |t_k| <= 1/2, for some of these numbers
    within bounds. Without d, h is 0.

    Attributes
    ----------
    move : Ball of shape (m,)
    E : (m, m) array
        Upper bounds.
    G, V : Balls of shapes (m, k) and (k, m)
    Y : (m, m) array
    drift : (m,) array
        Upper bounds.
    first : (k,) array
        The numbers a.
    along : (k,) array
        Upper bounds of |b|.
    """

    move: Ball
    E: Floats
    G: Ball
    V: Ball
    Y: Floats
    drift: Floats
    first: Floats
    along: Floats

    @cached_property
    def slopes(self) -> Floats:
        """Bounds of V G / 2."""
        return np.asarray(0.5 * (self.V @ Ball.exact(self.G.mid)).size)

    def shares(self, radius: Floats, h: float = 0.0, moved: float = 1.0) -> Floats | None:
        """s > 0 for which what is called xi below is less; no claim. None where there is none."""
        more = 1.0 + 4.0 * MARGIN
        asked = more * (0.5 * self.V.size @ radius + self.along * h + moved * np.abs(self.first))
        try:
            found = np.linalg.solve(np.eye(len(self.V.mid)) - more * self.slopes, asked)
        except np.linalg.LinAlgError:
            return None
        return np.asarray(found + TINY) if np.all(found >= 0) else None

    def balanced(self, h: float, moved: float, room: float) -> Floats | None:
        """A radius with which the step seems to contract, with as much room; no claim. None where there is none."""
        G, V, m = np.abs(self.G.mid), self.V.size, len(self.move.mid)
        more = 1.0 + 8.0 * MARGIN
        K = np.block([[room * self.E, room * (self.E @ G + self.G.rad)], [0.5 * more * V, more * self.slopes]])
        first = moved * np.abs(self.first) + self.along * h
        asked = room * np.concatenate([moved * self.move.size + self.drift * h, first])
        try:
            found = np.linalg.solve(np.eye(len(K)) - K, asked)
        except np.linalg.LinAlgError:
            return None
        return np.asarray(found[:m]) if np.all(found >= 0) and np.all(np.isfinite(found)) else None

    def reach(self, radius: Floats, shares: Floats) -> Floats:
        """Bounds of G s + b with |b| <= radius and |s| <= shares."""
        return (radius + upper_product(np.abs(self.G.mid), shares)) * SAFE

    def xi(self, radius: Floats, shares: Floats, h: float = 0.0, moved: float = 1.0) -> Floats:
        """Bounds of the shares of what comes out; without what does not depend on b and t where ``moved`` is 0."""
        own = upper_product(self.slopes, shares) + 0.5 * upper_product(self.V.size, radius)
        return np.asarray((own + self.along * h + moved * np.abs(self.first)) * SAFE)

    def left(self, radius: Floats, shares: Floats, h: float = 0.0, moved: float = 1.0) -> Floats:
        """Bounds of the rest of what comes out; without ``move`` where ``moved`` is 0."""
        out = moved * self.move.size + upper_product(self.E, self.reach(radius, shares)) + self.drift * h
        return np.asarray((out + upper_product(self.G.rad, self.xi(radius, shares, h, moved))) * SAFE)

    def contracts(self, radius: Floats, shares: Floats, errors: float, h: float = 0.0, moved: float = 1.0) -> bool:
        """Whether the step maps all G s + b with |b| <= radius and |s| <= shares to such with less of both."""
        more = SAFE * (1.0 + (errors - 1.0) * MARGIN)
        xi, left = self.xi(radius, shares, h, moved), self.left(radius, shares, h, moved)
        return bool(np.all(xi * more < shares) and np.all(left * SAFE * more < radius))


def split_off(G: Ball, vector: Ball) -> tuple[Floats, Ball]:
    """Numbers s, and the rest of a ball of vectors without G s, which is small where it lies near the columns of G."""
    if not G.shape[1]:
        return np.zeros(0), vector
    s = np.asarray(np.linalg.lstsq(G.mid, vector.mid)[0])
    return s, vector - (Ball.exact(G.mid) @ Ball.exact(s[:, None]))[:, 0]


def upper_product(matrix: Floats, vector: Floats) -> Floats:
    """Upper bound of a product without negative entries."""
    return np.asarray(upper_sum(matrix * vector, axis=1))


def _outwards(middle: Floats, radius: Floats) -> tuple[Floats, Floats]:
    low, high = middle - radius, middle + radius
    return low - 2 * UNIT * np.abs(low) - TINY, high + 2 * UNIT * np.abs(high) + TINY
