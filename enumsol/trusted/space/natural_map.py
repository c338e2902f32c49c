"""The natural map of a problem in 3D, y - P(y + rho w), in balls: P, its derivatives, and Krawczyk's operator on sets.

What boxes with one solution (theory, section 12.7) and boxes of curves of solutions (theory, section 12.8) share.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.ball_arrays import Ball
from enumsol.arithmetic.balls import SAFE, TINY, UNIT, upper_norm, upper_sum

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

#: What a writer of proofs asks for beyond what a checker does.
MARGIN = 2.0**-10


@dataclass(frozen=True)
class Corners:
    """Derivatives of P in a box: those in ``core`` plus sum t_k u_k v_k', |t_k| <= 1/2, u_k and v_k columns."""

    core: Ball
    u: Array
    v: Array


@dataclass(frozen=True)
class Discs:
    """P: lambda_n to at least 0, tau to the disc of radius F lambda_n; F may depend on one more argument.

    Where F is negative, P is continued by what slip gives.

    Attributes
    ----------
    tau : places of the tau of every node in y, none, one or two
    F : Ball of shape (p,)
        All that occur.
    slope : Ball of shape (p,), or None
        The derivative of F with respect to the last argument; None where there is no such argument.
    """

    tau: Sequence[NDArray[np.intp]]
    F: Ball
    slope: Ball | None = None

    def projected(self, z: Ball) -> Ball:
        """P of a ball of arguments."""
        out = Ball(np.zeros_like(z.mid), np.zeros_like(z.rad))
        p = len(self.tau)
        out.mid[:p], out.rad[:p] = np.maximum(z.mid[:p], 0.0), z.rad[:p]
        for i, t in enumerate(self.tau):
            if len(t):
                F, F_rad = float(self.F.mid[i]), float(self.F.rad[i])
                most = F * float(out.mid[i])
                length = float(np.linalg.norm(z.mid[t]))
                share = 1.0 if length <= most else most / length
                out.mid[t] = share * z.mid[t]
                # |P(z) - P(z')| <= |z_t - z_t'| + |r - r'| for discs of the radii r and r'
                more = (abs(F) + F_rad) * (float(out.mid[i]) + z.rad[i]) - abs(F) * float(out.mid[i])
                rounded = 16 * UNIT * (abs(most) + length)
                away = float(upper_norm(z.rad[t]))
                if F - F_rad < 0:
                    # r e with a negative r: |e - e'| <= 2 |z_t - z_t'| / |z_t|
                    reach = (abs(F) + F_rad) * (float(out.mid[i]) + z.rad[i])
                    turned = 4.0 * away * reach / (length - away) if length > away else np.inf
                    away = away + (turned if away > 0 else 0.0)
                out.rad[t] = (away + more + rounded) * SAFE + TINY
        return out

    def corners(self, z: Ball) -> Corners | None:
        """All derivatives of P at points of a box, and their convex hull; None where there is no bound.

        ``core`` has a column more than rows, for the derivative with respect to the argument of F, if there is one.
        """
        m = len(z.mid)
        width = m if self.slope is None else m + 1
        core = Ball(np.zeros((m, width)), np.zeros((m, width)))
        pairs: list[tuple[Array, Array]] = []
        for i, t in enumerate(self.tau):
            found = self._corner(core, z, i, t)
            if found is None:
                return None
            pairs += found
        u = np.array([pair[0] for pair in pairs]).reshape(-1, m).T
        v = np.array([pair[1] for pair in pairs]).reshape(-1, width).T
        for a, b in pairs:
            half = 0.5 * np.outer(a, b)
            core.mid[...] += half
            core.rad[...] += 2 * UNIT * np.abs(core.mid) * (half != 0)
        return Corners(core, u, v)

    def _corner(self, core: Ball, z: Ball, i: int, t: NDArray[np.intp]) -> list[tuple[Array, Array]] | None:
        """Put a node's derivatives into the core; u and v if there is a term t u v' with t from 0 to 1."""
        low, high = _outwards(float(z.mid[i]), float(z.rad[i]))
        u, v = np.zeros(core.shape[0]), np.zeros(core.shape[1])
        if high < 0:
            return []
        loose = low <= 0
        v[i] = 1.0
        if not len(t):
            core.mid[i, i], u[i] = (0.0, 1.0) if loose else (1.0, 0.0)
            return [(u, v)] if loose else []
        F, F_rad = float(self.F.mid[i]), float(self.F.rad[i])
        F_low, F_high = _outwards(F, F_rad)
        F_size = max(abs(F_low), abs(F_high))
        # of the discs' radii
        least_disc = F_low * (max(low, 0.0) if F_low >= 0 else high) - TINY
        most_disc = max(F_high, 0.0) * high * SAFE + TINY
        least_disc = least_disc / SAFE if least_disc > 0 else least_disc * SAFE
        length, away = float(np.linalg.norm(z.mid[t])), float(upper_norm(z.rad[t]))
        least, most = (length - away) / SAFE - 8 * UNIT * length - TINY, (length + away) * SAFE + 8 * UNIT * length
        sticks, slips = least <= most_disc, most >= least_disc
        if not slips:
            core.mid[i, i] = core.mid[t, t] = 1.0
            return []
        block = np.ix_(t, t)
        if not least > 0 or (loose and sticks):
            if F_low < 0:
                return None
            # any mixture of 0, of the unit matrix and of slips in any direction
            core.mid[i, i], core.rad[i, i] = (0.5, 0.5) if loose else (1.0, 0.0)
            core.rad[t, i] = F_size
            core.rad[block] = 0.5
            core.mid[t, t] = 0.5
            if self.slope is not None:
                core.rad[t, -1] = float(self.slope[i].size) * high * SAFE
            return []
        disc = least_disc, most_disc, least, most
        return self._sliding(core, z, i, length, away, disc, sticks=sticks)

    def _sliding(
        self,
        core: Ball,
        z: Ball,
        i: int,
        length: float,
        away: float,
        disc: tuple[float, float, float, float],
        *,
        sticks: bool,
    ) -> list[tuple[Array, Array]]:
        """Those of a node whose tau has a direction, and that slips at some points of the box.

        ``length`` and ``away``: of the middle of its tau, and by how much that may be off; ``disc``: the least and the
        largest radius of its disc, and the least and the largest length of its tau; ``sticks``: it may stick, too.
        """
        t, least_disc, most_disc, least, most = self.tau[i], *disc
        low, high = _outwards(float(z.mid[i]), float(z.rad[i]))
        loose = low <= 0
        F, F_rad = float(self.F.mid[i]), float(self.F.rad[i])
        F_size = max(map(abs, _outwards(F, F_rad)))
        u, v = np.zeros(core.shape[0]), np.zeros(core.shape[1])
        v[i] = 1.0
        block = np.ix_(t, t)
        # with respect to the argument of F: e times this where the node slips
        change = Ball.exact(np.zeros(())) if self.slope is None else self.slope[i]
        e = z.mid[t] / length
        # directions of the box are no farther from e
        turn = (2.0 * away / length if len(t) > 1 else 0.0) * SAFE + 8 * UNIT
        across = np.eye(len(t)) - np.outer(e, e) if len(t) > 1 else np.zeros((1, 1))
        # of e e' and of 1 - e e'
        bent = 3.0 * turn if len(t) > 1 else 0.0
        ratio_low, ratio_high = _quotient(least_disc, least, most), min(1.0, _quotient(most_disc, most, least, up=True))
        normal, normal_rad = 0.5 * (max(low, 0.0) + high), 0.5 * (high - max(low, 0.0)) * SAFE
        pushed = change * Ball(np.array(normal), np.array(normal_rad + 4 * UNIT * normal))
        core.rad[t, i] = (F_size * turn + F_rad + 4 * UNIT * F_size) * SAFE
        if self.slope is not None:
            core.rad[t, -1] = (float(pushed.size) * turn + float(pushed.rad) + 4 * UNIT * float(pushed.size)) * SAFE
        if sticks:
            # 1 - t (e e' + (1 - ratio) (1 - e e')), and t F e for lambda_n
            core.mid[i, i] = core.mid[t, t] = 1.0
            core.rad[block] = (bent + (1.0 - ratio_low) * (len(t) > 1) + 8 * UNIT) * SAFE
            u[t], v[t] = e, -e
            v[i] = F
            if self.slope is not None:
                v[-1] = float(pushed.mid)
            return [(u, v)]
        size = max(abs(ratio_low), abs(ratio_high))
        if loose:
            # t times those of slip
            core.mid[block] = 0.5 * ratio_high * across
            spread = 0.5 * abs(ratio_high) + max(-ratio_low, 0.0)
            core.rad[block] = (spread * np.abs(across) + size * bent + 8 * UNIT) * SAFE
            if self.slope is not None:
                core.rad[t, -1] = float(change.size) * high * SAFE
            u[i], u[t] = 1.0, F * e
            return [(u, v)]
        core.mid[i, i], core.mid[t, i] = 1.0, F * e
        if self.slope is not None:
            core.mid[t, -1] = float(pushed.mid) * e
        middle, half = 0.5 * (ratio_low + ratio_high), 0.5 * (ratio_high - ratio_low) * SAFE + 4 * UNIT * size
        core.mid[block] = middle * across
        core.rad[block] = (half * np.abs(across) + size * bent + 8 * UNIT * max(size, 1.0)) * SAFE
        return []


def middle_inverse(M: Ball) -> tuple[Array, Array] | None:
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
    E: Array
    G: Ball
    V: Ball
    Y: Array
    drift: Array
    first: Array
    along: Array

    @cached_property
    def slopes(self) -> Array:
        """Bounds of V G / 2."""
        return np.asarray(0.5 * (self.V @ Ball.exact(self.G.mid)).size)

    def shares(self, radius: Array, h: float = 0.0, moved: float = 1.0) -> Array | None:
        """s > 0 for which what is called xi below is less; no claim. None where there is none."""
        more = 1.0 + 4.0 * MARGIN
        asked = more * (0.5 * self.V.size @ radius + self.along * h + moved * np.abs(self.first))
        try:
            found = np.linalg.solve(np.eye(len(self.V.mid)) - more * self.slopes, asked)
        except np.linalg.LinAlgError:
            return None
        return np.asarray(found + TINY) if np.all(found >= 0) else None

    def balanced(self, h: float, moved: float, room: float) -> Array | None:
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

    def reach(self, radius: Array, shares: Array) -> Array:
        """Bounds of G s + b with |b| <= radius and |s| <= shares."""
        return (radius + upper_product(np.abs(self.G.mid), shares)) * SAFE

    def xi(self, radius: Array, shares: Array, h: float = 0.0, moved: float = 1.0) -> Array:
        """Bounds of the shares of what comes out; without what does not depend on b and t where ``moved`` is 0."""
        own = upper_product(self.slopes, shares) + 0.5 * upper_product(self.V.size, radius)
        return np.asarray((own + self.along * h + moved * np.abs(self.first)) * SAFE)

    def left(self, radius: Array, shares: Array, h: float = 0.0, moved: float = 1.0) -> Array:
        """Bounds of the rest of what comes out; without ``move`` where ``moved`` is 0."""
        out = moved * self.move.size + upper_product(self.E, self.reach(radius, shares)) + self.drift * h
        return np.asarray((out + upper_product(self.G.rad, self.xi(radius, shares, h, moved))) * SAFE)

    def contracts(self, radius: Array, shares: Array, errors: float, h: float = 0.0, moved: float = 1.0) -> bool:
        """Whether the step maps all G s + b with |b| <= radius and |s| <= shares to such with less of both."""
        more = SAFE * (1.0 + (errors - 1.0) * MARGIN)
        xi, left = self.xi(radius, shares, h, moved), self.left(radius, shares, h, moved)
        return bool(np.all(xi * more < shares) and np.all(left * SAFE * more < radius))


def split_off(G: Ball, vector: Ball) -> tuple[Array, Ball]:
    """Numbers s, and the rest of a ball of vectors without G s, which is small where it lies near the columns of G."""
    if not G.shape[1]:
        return np.zeros(0), vector
    s = np.asarray(np.linalg.lstsq(G.mid, vector.mid)[0])
    return s, vector - (Ball.exact(G.mid) @ Ball.exact(s[:, None]))[:, 0]


def upper_product(matrix: Array, vector: Array) -> Array:
    """Upper bound of a product without negative entries."""
    return np.asarray(upper_sum(matrix * vector, axis=1))


def _outwards(middle: float, radius: float) -> tuple[float, float]:
    low, high = middle - radius, middle + radius
    return low - 2 * UNIT * abs(low) - TINY, high + 2 * UNIT * abs(high) + TINY


def _quotient(disc: float, near: float, far: float, *, up: bool = False) -> float:
    """A bound of a disc's radius over a length between ``near`` and ``far``, which are positive."""
    if up:
        return disc / far * SAFE if disc >= 0 else disc / near / SAFE
    return disc / far / SAFE if disc >= 0 else disc / near * SAFE
