"""The projection P of the natural map y - P(y + rho w) of a problem in 3D, and its derivatives on sets, in balls.

See theory, sections 12.7 and 12.8.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np

from enumsol.arithmetic.balls import ROOT_TINY, SAFE, TINY, UNIT, Ball, gamma, upper_norm, upper_sum
from enumsol.support.array_types import Floats, Indices, Mask

#: Places of the unit matrix in blocks of both components of tau.
_BOTH = [[1], [2]], [[1], [2]]


@dataclass(frozen=True)
class Extent:
    """Points z + t along + moves b + s with |t| <= half, |b| <= radius and |s| <= side.

    Attributes
    ----------
    z, along : Balls of shape (n,)
    half : float
    moves : Ball of shape (n, k)
    radius, side : (k,) and (n,) arrays
    """

    z: Ball
    along: Ball
    half: float
    moves: Ball
    radius: Floats
    side: Floats

    @cached_property
    def near(self) -> Ball:
        """A ball of all these points."""
        wide = self.along.size * self.half + upper_product(self.moves.size, self.radius) + self.side
        return Ball(self.z.mid, (self.z.rad + wide) * SAFE)

    @cached_property
    def _padded(self) -> tuple[Floats, Floats, Floats]:
        """Middles of ``along`` and ``moves``, and what is added to products with both, with zeros at the end."""
        k = gamma(16)
        blurred = upper_product(self.moves.rad + k * np.abs(self.moves.mid), self.radius)
        added = self.z.rad + self.side + blurred + (self.along.rad + k * np.abs(self.along.mid)) * self.half
        none = np.zeros((1, len(self.radius)))
        return np.append(self.along.mid, 0.0), np.vstack([self.moves.mid, none]), np.append(added * SAFE, 0.0)

    def products(self, rows: Floats, places: Indices) -> tuple[Floats, Floats]:
        """Numbers r and bounds of a (x - z) - t r for rows a, where x is a point with t, both (p, K).

        Parameters
        ----------
        rows : (p, K, l) array
        places : (p, l) array of int
            Of their entries, -1 where there is none.
        """
        along, moves, added = self._padded
        rates = np.sum(rows * along[places][:, None, :], axis=2)
        beside = upper_sum(np.abs(rows @ moves[places]) * self.radius, axis=2)
        return rates, (beside + upper_sum(np.abs(rows) * added[places][:, None, :], axis=2)) * SAFE


@dataclass(frozen=True)
class Turns:
    """Sums over nodes and k of (t rates + s) times a matrix, |t| <= half and |s| <= rest, the same t in all of them.

    Attributes
    ----------
    rows, columns : (q, 3) and (q, 4) arrays of int
        Places of the matrices of every node, -1 where there is none.
    matrices : (q, K, 3, 4) array
    left, right : (q, K - 1, 3) and (q, K - 1, 4) arrays
        All matrices but the first are products of one column and one row, up to rounding these.
    rates, rest : (q, K) arrays
    half : float
    """

    rows: Indices
    columns: Indices
    matrices: Floats
    left: Floats
    right: Floats
    rates: Floats
    rest: Floats
    half: float

    @cached_property
    def size(self) -> Floats:
        """Bounds of the sums of every node, (q, 3, 4)."""
        most = (np.abs(self.rates) * self.half + self.rest) * SAFE
        return np.asarray(upper_sum(most[:, :, None, None] * np.abs(self.matrices), axis=1))

    def bounds(self, Y: Floats, Z: Floats, d: Floats | None = None) -> tuple[Floats, Floats]:
        """Bounds of |Y D Z| and |Y D Z d| for all these D, up to rounding, for which ``size`` times gamma serves."""
        m, n = len(Y), Z.shape[1]
        before = np.hstack([Y, np.zeros((m, 1))])[:, self.rows]
        after = np.vstack([Z, np.zeros((1, n))])[self.columns]
        of_nodes = before.transpose(1, 0, 2)
        # |Y u v' Z| is |Y u| |v' Z|
        beside = np.abs(of_nodes @ self.left.transpose(0, 2, 1)).transpose(1, 0, 2).reshape(m, -1)
        beyond = (np.abs(self.right @ after) * self.rest[:, 1:, None]).reshape(-1, n)
        first = of_nodes @ ((self.rest[:, 0, None, None] * self.matrices[:, 0]) @ after)
        most = np.sum(np.abs(first, out=first), axis=0) + beside @ beyond
        moved = after @ (np.zeros(n) if d is None else d)
        ends = (self.matrices @ moved[:, None, :, None])[..., 0] * self.rest[:, :, None]
        along = np.sum(np.abs(of_nodes @ ends.transpose(0, 2, 1)), axis=(0, 2))
        if self.half:
            # t is the same for all nodes and matrices
            turned = np.sum(self.rates[:, :, None, None] * self.matrices, axis=1)
            most = most + np.abs(before.reshape(m, -1) @ (turned @ after).reshape(-1, n)) * self.half
            along = along + np.abs(before.reshape(m, -1) @ (turned @ moved[:, :, None]).ravel()) * self.half
        return most * SAFE, along * SAFE


@dataclass(frozen=True)
class Corners:
    """Derivatives of P in a set: those in ``still``, plus ``turns``, plus sum t_k u_k v_k', |t_k| <= 1/2.

    u_k and v_k are columns. ``still`` has room for the rounding of ``turns.bounds``.
    """

    still: Ball
    turns: Turns
    u: Floats
    v: Floats

    @property
    def core(self) -> Ball:
        """A ball of all of them without the sum."""
        return Ball(self.still.mid, (self.still.rad + self.wide) * SAFE)

    @cached_property
    def wide(self) -> Floats:
        """Bounds of what ``turns`` adds."""
        out, turns = np.zeros_like(self.still.rad), self.turns
        there = (turns.rows >= 0)[:, :, None] & (turns.columns >= 0)[:, None, :]
        to = tuple(np.broadcast_to(x, there.shape)[there] for x in (turns.rows[:, :, None], turns.columns[:, None, :]))
        out[to] = turns.size[there]
        return out


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
    slope : (p,) array
        The derivative of F with respect to the last argument.
    kept : int
        So many last components of y are kept as they are: rigid displacements (theory, section 14.14).
    """

    tau: Indices
    F: Ball
    slope: Floats
    kept: int = 0

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
        first = len(z.mid) - self.kept
        out[first:] = z[first:]
        return out

    def tangents(self, z: Ball) -> Ball:
        """tau of every node, (p, 2); 0 where there is none."""
        has = self.tau >= 0
        return Ball(np.where(has, z.mid[self.tau], 0.0), np.where(has, z.rad[self.tau], 0.0))

    def corners(self, extent: Extent) -> Corners | None:
        """All derivatives of P at points of a set, and their convex hull; None where there is no bound.

        ``still`` has a column more than rows, for the derivative with respect to the argument of F.

        Parameters
        ----------
        extent : Extent
            The points, and of F the argument there.
        """
        if not extent.near.finite:
            return None
        slips = Slips(self, extent)
        found = _Blocks.of(slips)
        if found is None:
            return None
        rows, columns, m = slips.places[:, :3], slips.places, len(extent.near.mid) - 1
        core = Ball(np.zeros((m, m + 1)), np.zeros((m, m + 1)))
        block, u, v = found.middle, found.u, found.v
        same = np.arange(m - self.kept, m)
        core.mid[same, same] = 1.0
        there = (rows >= 0)[:, :, None] & (columns >= 0)[:, None, :]
        to = tuple(np.broadcast_to(x, there.shape)[there] for x in (rows[:, :, None], columns[:, None, :]))
        core.mid[to], core.rad[to] = (part[there] for part in (block.mid, block.rad))
        k = np.flatnonzero(found.paired)
        U, V = np.zeros((m, len(k))), np.zeros((m + 1, len(k)))
        for matrix, places, vectors in ((U, rows[k], u[k]), (V, columns[k], v[k])):
            number, part = np.nonzero(places >= 0)
            matrix[places[number, part], number] = vectors[number, part]
        return Corners(core, found.turns, U, V)


class Slips:
    """How the directions in which nodes slip, and the sizes of their friction, change over a set.

    To first order these are products with rows, in which changes cancel (theory, section 12.8).

    Parameters
    ----------
    discs : Discs
    extent : Extent
        Of z and the argument of F.

    Attributes
    ----------
    at : Directions
    gap : Ball of shape (p,)
        |z_t| - F z_n; without bounds where none are known.
    """

    def __init__(self, discs: Discs, extent: Extent) -> None:
        self.discs, self.extent, p = discs, extent, len(discs.tau)
        self.z = extent.near
        last = len(self.z.mid) - 1
        self.places = np.column_stack([np.arange(p), discs.tau, np.full(p, last)])
        self.change = discs.slope
        tangent = discs.tangents(self.z)
        self.length, self.e, self.side = _middle(tangent)
        self.rows = self._rows()
        self.rates, self.rest = extent.products(self.rows, self.places)
        away = self._most(self.rates, self.rest)
        self.at = Directions.of(tangent, away[:, :2])
        self.wide = np.append(self.z.rad, 0.0)[self.places]
        # of F in the middle: the radius of F holds what its argument changes, too
        self.rounded = np.maximum(discs.F.rad * SAFE - np.abs(self.change) * self.z.rad[last], 0.0) * SAFE
        self.gap = self._gap()

    def _most(self, rates: Floats, rest: Floats) -> Floats:
        return np.asarray((np.abs(rates) * self.extent.half + rest) * SAFE)

    def _rows(self) -> Floats:
        """By which z and the argument of F are multiplied, (p, 6, 4), for what changes with them.

        z_t along its direction in the middle and beside it, z_n, the argument of F, |z_t| - F z_n and F z_n / |z_t|.
        """
        p, F, change = len(self.e), self.discs.F.mid, self.change
        normal, length = self.z.mid[:p], np.where(self.length > 0, self.length, 1.0)
        rows = np.zeros((p, 6, 4))
        rows[:, 0, 1:3], rows[:, 1, 1:3], rows[:, 2, 0], rows[:, 3, 3] = self.e, self.side, 1.0, 1.0
        rows[:, 4] = np.column_stack([-F, self.e, -change * normal])
        beta = F * normal / length
        rows[:, 5] = np.column_stack([F, -beta[:, None] * self.e, change * normal]) / length[:, None]
        return rows

    def _gap(self) -> Ball:
        at, F, normal, change = self.at, self.discs.F, self.z.mid[: len(self.e)], self.change
        off = np.column_stack([F.rad, at.turn, np.abs(change) * self.wide[:, 0]]) + 8 * UNIT * np.abs(self.rows[:, 4])
        disc = F.mid * normal
        rad = self._most(self.rates[:, 4], self.rest[:, 4])
        rad = rad + upper_sum(off * self.wide, axis=1) + self.rounded * np.abs(normal)
        rad = (rad + 16 * UNIT * (self.length + np.abs(disc))) * SAFE
        known = (at.least > 0) & (F.mid > F.rad * SAFE) & np.isfinite(rad)
        return Ball(np.where(known, self.length - disc, 0.0), np.where(known, rad, np.inf))

    def turns(self, k: Indices, ratios: tuple[Floats, Floats]) -> tuple[Turns, Floats, Floats]:
        """Derivatives of nodes k, which only slip: what turns, their middles, and bounds of the rest, (q, 3, 4).

        ``ratios``: bounds of that of the disc's radius and |tau|, of all nodes.
        """
        at, half, wide = self.at, self.extent.half, self.wide[k]
        e, side, turn, length, change = self.e[k], self.side[k], at.turn[k], self.length[k], self.change[k]
        F, F_rad, normal = self.discs.F.mid[k], self.discs.F.rad[k], self.z.mid[k]
        low, high = ratios[0][k], ratios[1][k]
        least, most = at.least[k], at.most[k]
        # of 1 / |z_t|, relative to that of the middle
        bent = np.maximum(most - length, length - least) / least * (1.0 + 8 * UNIT)
        beta = F * normal / length
        off = np.maximum(np.maximum(high - beta, beta - low), 0.0) + 16 * UNIT * np.abs(beta)
        size, F_size = np.maximum(np.abs(low), np.abs(high)), np.abs(F) + F_rad
        more = np.column_stack(
            [
                (F_rad + F_size * bent),
                off[:, None] * np.abs(e) + size[:, None] * (turn + bent[:, None] * (np.abs(e) + turn)),
                np.abs(change) * (wide[:, 0] + (np.abs(normal) + wide[:, 0]) * bent),
            ]
        )
        lost = upper_sum((more / length[:, None] + 16 * UNIT * np.abs(self.rows[k, 5])) * wide, axis=1)
        lost = lost + 32 * UNIT * np.abs(beta) + self.rounded[k] * np.abs(normal) / length
        turned = self.rates[k, 1] / length
        beside = self.rest[k, 1] / least + (bent + 8 * UNIT) * np.abs(turned) * half + 32 * UNIT * (1.0 + bent)
        rates = np.column_stack([turned, self.rates[k, 5], change * self.rates[k, 3], self.rates[k, 2]])
        rests = np.column_stack(
            [
                beside,
                self.rest[k, 5] + lost,
                np.abs(change) * self.rest[k, 3] + self.rounded[k],
                self.rest[k, 2],
            ]
        )
        rests = (rests + 8 * UNIT * np.abs(rates) * half) * SAFE
        both = side[:, :, None] * e[:, None, :] + e[:, :, None] * side[:, None, :]
        M = np.zeros((len(k), 4, 3, 4))
        M[:, 0, 1:, 0], M[:, 0, 1:, 1:3] = F[:, None] * side, -beta[:, None, None] * both
        M[:, 0, 1:, 3], M[:, 1, 1:, 1:3] = (change * normal)[:, None] * side, at.across[k]
        M[:, 2, 1:, 0], M[:, 3, 1:, 3] = e, change[:, None] * e
        columns, lines = np.zeros((len(k), 3, 3)), np.zeros((len(k), 3, 4))
        columns[:, 0, 1:], columns[:, 1:, 1:] = side, e[:, None, :]
        lines[:, 0, 1:3], lines[:, 1, 0], lines[:, 2, 3] = side, 1.0, change
        middle, left = np.zeros((len(k), 3, 4)), np.zeros((len(k), 3, 4))
        middle[:, 0, 0], middle[:, 1:, 0], middle[:, 1:, 3] = 1.0, F[:, None] * e, (change * normal)[:, None] * e
        middle[:, 1:, 1:3] = beta[:, None, None] * at.across[k]
        # to second order
        sine, off, F_off, off_n = np.minimum(self._most(rates, rests), np.array([1.0, *[np.inf] * 3])).T
        a, b, c = np.abs(e), np.abs(side), np.abs(both)
        pushed = np.abs(change) * (np.abs(normal) + wide[:, 0])
        left[:, 1:, 0] = (F_size * sine**2)[:, None] * a + (F_off * sine)[:, None] * b
        left[:, 1:, 3] = (pushed * sine**2)[:, None] * a + (np.abs(change) * off_n * sine)[:, None] * b
        straight = a[:, :, None] * a[:, None, :] + b[:, :, None] * b[:, None, :]
        left[:, 1:, 1:3] = (size * sine**2)[:, None, None] * (straight + sine[:, None, None] * c)
        left[:, 1:, 1:3] += (off * sine)[:, None, None] * c
        found = Turns(self.places[k, :3], self.places[k], M, columns, lines, rates, rests, half)
        left = left + gamma(8 * len(self.e) + 64) * (found.size + np.abs(middle))
        return found, middle, left * SAFE


@dataclass(frozen=True)
class _Blocks:
    """Derivatives of P of every node, by (n, t1, t2) and the argument of F.

    To those that are ``paired``, t u v' with |t| <= 1/2 is to be added.

    Attributes
    ----------
    mid, rad : (p, 3, 4) arrays
    u, v : (p, 3) and (p, 4) arrays
    paired : (p,) bool array
    turns : Turns
        Of nodes that only slip.
    """

    mid: Floats
    rad: Floats
    u: Floats
    v: Floats
    paired: Mask
    turns: Turns

    @property
    def middle(self) -> Ball:
        """With u v' / 2 in the middle of its t."""
        added = 0.5 * (self.u[:, :, None] * self.v[:, None, :]) * self.paired[:, None, None]
        mid = self.mid + added
        return Ball(mid, self.rad + 2 * UNIT * np.abs(mid) * (added != 0))

    @classmethod
    def of(cls, slips_of: Slips) -> Self | None:
        """Derivatives at all points of a set; None where there is no bound."""
        z, F, at, change = slips_of.z, slips_of.discs.F, slips_of.at, np.abs(slips_of.change)
        p, tau = len(F.mid), slips_of.discs.tau
        low, high = outwards(z[:p])
        F_low, F_high = outwards(F)
        # of the discs' radii
        least = F_low * np.where(F_low >= 0, np.maximum(low, 0.0), high) - TINY
        least, most = np.where(least > 0, least / SAFE, least * SAFE), np.maximum(F_high, 0.0) * high * SAFE + TINY
        gap_low, gap_high = outwards(slips_of.gap)
        touches, loose = high >= 0, low <= 0
        sticks, slips = (at.least <= most) & (gap_low <= 0), (at.most >= least) & (gap_high >= 0)
        rubs = np.any(tau >= 0, axis=1) & touches
        unknown = rubs & slips & (~(at.least > 0) | (loose & sticks))
        if np.any(unknown & (F_low < 0)):
            return None
        sliding = rubs & slips & ~unknown
        ratio_low = np.where(least >= 0, least / at.most / SAFE, least / at.least * SAFE)
        ratio_high = np.minimum(1.0, most / at.least * SAFE)
        # the ratio is 1 - (|z_t| - F z_n) / |z_t|, and where the node slips this is less than one
        known = np.isfinite(slips_of.gap.rad)
        lost = (np.maximum(gap_high, 0.0) / np.where(known, at.least, 1.0) + 4 * UNIT) * SAFE
        kept = np.maximum(gap_low, 0.0) / np.where(known, at.most, 1.0) / SAFE - 4 * UNIT
        ratio_low = np.where(known, np.maximum(ratio_low, 1.0 - lost), ratio_low)
        ratio_high = np.where(known, np.minimum(ratio_high, 1.0 - kept), ratio_high)
        turns, middle, left = slips_of.turns(
            only := np.flatnonzero(sliding & ~sticks & ~loose), (ratio_low, ratio_high)
        )
        blocks = cls(
            np.zeros((p, 3, 4)),
            np.zeros((p, 3, 4)),
            np.zeros((p, 3)),
            np.zeros((p, 4)),
            (touches & loose & ~unknown) | (sliding & sticks),
            turns,
        )
        blocks.mid[:, 0, 0] = touches & ~loose
        blocks.mid[rubs & ~slips, *_BOTH] = 1.0
        blocks.u[:, 0], blocks.v[:, 0] = touches & loose, 1.0
        F_size = np.maximum(np.abs(F_low), np.abs(F_high))
        widest = (change * high * SAFE)[:, None]
        if np.any(unknown):
            # any mixture of 0, of the unit matrix and of slips in any direction
            blocks.mid[unknown & loose, 0, 0] = blocks.rad[unknown & loose, 0, 0] = 0.5
            blocks.rad[unknown, 1:, 0] = F_size[unknown, None]
            blocks.rad[unknown, 1:, 1:3] = 0.5
            blocks.rad[unknown, 1:, 3] = widest[unknown]
            blocks.mid[unknown, *_BOTH] = 0.5
        blocks.mid[only], blocks.rad[only] = middle, left
        cornered = sliding & (sticks | loose)
        if np.any(cornered):
            # times the direction, by lambda_n and by the argument of F where the node slips
            normal, normal_rad = 0.5 * (np.maximum(low, 0.0) + high), 0.5 * (high - np.maximum(low, 0.0)) * SAFE
            pushed = Ball.exact(slips_of.change) * Ball(normal, normal_rad + 4 * UNIT * normal)
            along, also = (
                (x[:, None] * (at.turn + 4 * UNIT) + rad[:, None] * np.abs(at.e)) * SAFE
                for x, rad in ((F_size, F.rad), (pushed.size, pushed.rad))
            )
            blocks.rad[cornered, 1:, 0] = along[cornered]
            blocks.rad[cornered, 1:, 3] = np.where(loose[:, None], widest, also)[cornered]
            blocks.slide(at, (ratio_low, ratio_high), (F.mid, pushed.mid), sliding & sticks, sliding & loose)
        return blocks

    def slide(
        self,
        at: Directions,
        ratios: tuple[Floats, Floats],
        factors: tuple[Floats, Floats],
        limit: Mask,
        graze: Mask,
    ) -> None:
        """Fill in nodes whose tau has a direction and that slip at some points, but not at all of them.

        Parameters
        ----------
        ratios : bounds of that of the disc's radius and |tau| where they slip
        factors : what the direction is multiplied by where they slip, by lambda_n and by the argument of F
        limit, graze : nodes that may stick, or be open, too
        """
        low, high = (ratio[:, None, None] for ratio in ratios)
        across, size = np.abs(at.across), np.maximum(np.abs(low), np.abs(high))
        rounded = 16 * UNIT * (1.0 + size)
        F, pushed = factors
        # or stick: 1 - t (e e' + (1 - ratio) (1 - e e')), and t F e for lambda_n
        if np.any(limit):
            self.mid[limit, *_BOTH] = 1.0
            lost = (at.bent + (1.0 - low) * (across + at.bent) + rounded) * SAFE
            self.rad[limit, 1:, 1:3] = lost[limit]
            self.u[limit, 1:], self.v[limit, 1:3], self.v[limit, 0] = at.e[limit], -at.e[limit], F[limit]
            self.v[limit, 3] = pushed[limit]
        # or open: t times those of slip
        if np.any(graze):
            spread = 0.5 * np.abs(high) + np.maximum(-low, 0.0)
            self.mid[graze, 1:, 1:3] = (0.5 * high * at.across)[graze]
            self.rad[graze, 1:, 1:3] = ((spread * across + size * at.bent + rounded) * SAFE)[graze]
            self.u[graze, 1:] = (F[:, None] * at.e)[graze]


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
    def of(cls, x: Ball, away: Floats | None = None) -> Directions:
        """Directions of points in balls of shape (p, 2); where a component is 0 without radius, e has one component.

        ``away``: bounds, (p, 2), of how far they are from the middle along its direction and beside it, if known.
        """
        length, e, side = _middle(x)
        # along the middle's direction, and beside it
        along, beside = (upper_sum(np.abs(one) * x.rad, axis=1) * (1.0 + 16 * UNIT) for one in (e, side))
        if away is not None:
            also = (away + 16 * UNIT * np.max(x.rad, axis=1)[:, None]) * SAFE
            along, beside = np.minimum(along, also[:, 0]), np.minimum(beside, also[:, 1])
        rounded = 8 * UNIT * length
        least = (length - along) / SAFE - rounded - ROOT_TINY
        ahead = length + along
        most = np.sqrt(ahead * ahead + beside * beside) * SAFE * SAFE + rounded + ROOT_TINY
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


def _middle(x: Ball) -> tuple[Floats, Floats, Floats]:
    """Lengths, directions and directions beside them of the middles of balls of shape (p, 2); any one for length 0."""
    length = np.linalg.norm(x.mid, axis=1)
    # where squares underflow any direction serves
    known = (length > 0.5 * ROOT_TINY)[:, None]
    e = np.where(known, x.mid / np.where(known[:, 0], length, 1.0)[:, None], np.array([1.0, 0.0]))
    return length, e, np.column_stack([-e[:, 1], e[:, 0]])


def are_steps(rho: Floats, tau: Indices) -> bool:
    """True if numbers serve as rho of a natural map: positive, and one for both components of tau of every node.

    Zeros of a map with two numbers there are no solutions (theory, (12.10)).

    Parameters
    ----------
    rho : (m,) array
        In the variables in which discs are round.
    tau : (p, 2) array of int
        See ``Discs``.
    """
    one, other = tau[np.all(tau >= 0, axis=1)].T
    return bool(np.all(np.isfinite(rho)) and np.all(rho > 0) and np.array_equal(rho[one], rho[other]))


def upper_product(matrix: Floats, vector: Floats) -> Floats:
    """Upper bound of a product without negative entries."""
    return np.asarray(upper_sum(matrix * vector, axis=1))


def outwards(ball: Ball) -> tuple[Floats, Floats]:
    """Lower and upper ends of balls, rounded outwards."""
    low, high = ball.mid - ball.rad, ball.mid + ball.rad
    return low - 2 * UNIT * np.abs(low) - TINY, high + 2 * UNIT * np.abs(high) + TINY
