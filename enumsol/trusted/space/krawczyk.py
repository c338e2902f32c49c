"""The trusted test that a set holds one solution, or one curve of them: Krawczyk's operator on the natural map in 3D.

A box at one alpha (theory, section 12.7) is a curve's box (theory, section 12.8) without length and without the
equation of the curve's parameter.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball
from enumsol.trusted.space.natural_map import Discs, Extent, upper_product

if TYPE_CHECKING:
    from collections.abc import Callable

    from enumsol.support.array_types import Floats

#: What a writer of proofs asks for beyond what a checker does.
MARGIN = 2.0**-10
#: How often a set around a box, or the box of an arc, is made larger; how often its image is taken again.
WIDENINGS, _IMAGES = 6, 2


@dataclass(frozen=True)
class Step:
    """x - Y N(x), N the natural map, for all x = c + t d + b within a radius of a point c, |t| <= h.

    Every value is c + t d + move + t drift + E b + sum (a_k + t b_k + t_k V_k b) G_k with |t_k| <= 1/2, the a_k of
    ``first``, and all other numbers within the bounds below. Without d, h is 0.

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
        """Shares s > 0 that are more than ``xi`` makes of them, if there are any; any would do in a proof."""
        more = 1.0 + 4.0 * MARGIN
        asked = more * (0.5 * self.V.size @ radius + self.along * h + moved * np.abs(self.first))
        try:
            found = np.linalg.solve(np.eye(len(self.V.mid)) - more * self.slopes, asked)
        except np.linalg.LinAlgError:
            return None
        return np.asarray(found + TINY) if np.all(found >= 0) else None

    def balanced(self, h: float, moved: float, room: float) -> Floats | None:
        """A radius with which the step may contract, with as much room; None where there is none."""
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
        """True if the step maps all G s + b with |b| <= radius and |s| <= shares to such with less of both."""
        more = SAFE * (1.0 + (errors - 1.0) * MARGIN)
        xi, left = self.xi(radius, shares, h, moved), self.left(radius, shares, h, moved)
        return bool(np.all(xi * more < shares) and np.all(left * SAFE * more < radius))


def split_off(G: Ball, vector: Ball) -> tuple[Floats, Ball]:
    """Numbers s, and the rest of a ball of vectors without G s, which is small where it lies near the columns of G."""
    if not G.shape[1]:
        return np.zeros(0), vector
    s = np.asarray(np.linalg.lstsq(G.mid, vector.mid)[0])
    return s, vector - (Ball.exact(G.mid) @ Ball.exact(s[:, None]))[:, 0]


@dataclass(frozen=True, eq=False)
class NaturalMap:
    """N(x) = y - P(z) around the points c + t d, |t| <= half, and the equation border (x - c) = t if there is one.

    y and the arguments of P, z and that of F behind them, are affine in the n components of x. At one alpha n is m and
    there is no border; along a curve x has alpha, too.

    Attributes
    ----------
    part, moves : Balls of shapes (m, n) and (m + 1, n)
        Derivatives of y and of the arguments of P.
    y, z : Balls of shapes (m,) and (m + 1,)
        Both at c.
    discs : callable
        P for all values of the argument of F in a ball.
    d : (n,) array
    half : float
    border : (n - m, n) array
    """

    part: Ball
    moves: Ball
    y: Ball
    z: Ball
    discs: Callable[[Ball], Discs]
    d: Floats
    half: float
    border: Floats

    @cached_property
    def zd(self) -> Ball:
        """Change of the arguments of P with t."""
        return (self.moves @ Ball.exact(self.d)[:, None])[:, 0]

    def extent(self, radius: Floats | None = None, side: Floats | None = None) -> Extent:
        """All arguments of P at x = c + t d + b, |b| <= radius, and no farther away from those than a side."""
        none, nothing = np.zeros(len(self.d)), np.zeros(len(self.z.mid))
        beside = none if radius is None else radius, nothing if side is None else side
        return Extent(self.z, self.zd, self.half, self.moves, *beside)

    def beside(self, step: Step, shares: Floats) -> Floats:
        """Bounds of what G s changes of the arguments of P."""
        if not len(shares):
            return np.zeros(len(self.z.mid))
        return upper_product((self.moves @ Ball.exact(step.G.mid)).size, shares) * SAFE

    def mapped(self, radius: Floats, errors: float) -> Contraction | None:
        """The operator around a box, if it maps sets that hold the box into their interiors."""
        return self.tried(radius, errors, np.zeros(len(self.z.mid)))[1]

    def tried(self, radius: Floats, errors: float, side: Floats) -> tuple[Step | None, Contraction | None]:
        """The operator around a box, and what it proves, if it does.

        ``side``: what arguments of P are farther away there from those of c than t d and b move them, as far as is
        known.
        """
        step = None
        for _ in range(WIDENINGS):
            step = self.step(self.extent(radius, side))
            shares = None if step is None else step.shares(radius, self.half)
            if step is None or shares is None:
                return step, None
            needed = self.beside(step, shares)
            if np.all(needed <= side):
                proven = step.contracts(radius, shares, errors, self.half)
                return step, Contraction(self, radius, step, shares) if proven else None
            side = np.maximum(side, needed) * (1.0 + MARGIN)
        return step, None

    def step(self, extent: Extent) -> Step | None:
        """Krawczyk's operator where the arguments of P are in an extent.

        None where its middle matrix is singular or there is no bound of derivatives.
        """
        m, n, near = len(self.y.mid), len(self.d), extent.near
        corners = self.discs(near[m]).corners(extent)
        if corners is None:
            return None
        B = self.part - corners.still @ self.moves
        # what turns is multiplied by the middle of ``moves``
        B = Ball.joined(Ball(B.mid, (B.rad + corners.wide @ self.moves.rad) * SAFE), Ball.exact(self.border))
        found = middle_inverse(B)
        if found is None:
            return None
        Y, E = found
        turned, turning = corners.turns.bounds(Y[:, :m], self.moves.mid, self.d)
        inverse, d = Ball.exact(Y), Ball.exact(self.d)[:, None]
        move = (inverse[:, :m] @ self._moved[:, None])[:, 0]
        drift = (inverse @ (B @ d - Ball.exact(np.eye(n, 1, -m))))[:, 0]
        G, V = inverse[:, :m] @ Ball.exact(corners.u), Ball.exact(corners.v.T) @ self.moves
        # what goes along the columns of G is a matter of the shares
        (first, move), (along, rest) = split_off(G, move), split_off(G, drift)
        pushed = 0.5 * (V @ d)[:, 0].size
        E, drifts = (E + turned) * SAFE, (rest.size + turning) * SAFE
        return Step(move, E, G, V, Y, drifts, first, (np.abs(along) + pushed) * SAFE)

    @cached_property
    def _moved(self) -> Ball:
        """-N(c)."""
        return self.discs(self.z[-1]).projected(self.z[:-1]) - self.y


@dataclass(frozen=True, eq=False)
class Contraction:
    """Krawczyk's operator around a box, and shares with which it contracts."""

    near: NaturalMap
    radius: Floats
    step: Step
    shares: Floats

    @property
    def reach(self) -> Floats:
        """Distance from c + t d of the set that is mapped into its interior, (n,)."""
        return self.step.reach(self.radius, self.shares)

    @cached_property
    def spread(self) -> tuple[Floats, Floats, Step]:
        """Bounds of the distances from c + t d of all solutions and of arguments of P, and the operator for those."""
        with np.errstate(all="ignore"):
            near, half, step, shares, radius = self.near, self.near.half, self.step, self.shares, self.radius
            for _ in range(_IMAGES):
                for _ in range(_IMAGES):
                    radius, shares = step.left(radius, shares, half), step.xi(radius, shares, half)
                extent = near.extent(radius, near.beside(step, shares))
                wide = extent.near.rad
                # the same solutions, whatever the shares are
                radius = step.reach(radius, shares)
                if not half:
                    # derivatives at a point are known but for rounding
                    return radius, wide, step
                closer = near.step(extent)
                found = None if closer is None else closer.shares(radius, half)
                if closer is None or found is None:
                    return radius, wide, step
                step, shares = closer, np.zeros(len(closer.along))
            return radius, wide, step

    @cached_property
    def slope(self) -> Floats:
        """Bound of the distance of differences over t from d; infinite where none is known."""
        with np.errstate(all="ignore"):
            step = self.spread[2]
            radius = step.balanced(1.0, 0.0, 1.1)
            if radius is not None:
                radius = np.maximum(radius, UNIT * np.max(radius)) + TINY
                shares = step.shares(radius, 1.0, 0.0)
                if shares is not None and step.contracts(radius, shares, 1.0, 1.0, 0.0):
                    for _ in range(_IMAGES):
                        radius, shares = step.left(radius, shares, 1.0, 0.0), step.xi(radius, shares, 1.0, 0.0)
                    return step.reach(radius, shares)
            return np.full(len(self.near.d), np.inf)


def middle_inverse(M: Ball) -> tuple[Floats, Floats] | None:
    """Y, about the inverse of the middle of M, and a bound of |I - Y M|; None where that middle is singular."""
    try:
        Y = np.asarray(np.linalg.inv(M.mid), dtype=np.float64)
    except np.linalg.LinAlgError:
        return None
    if not np.all(np.isfinite(Y)):
        return None
    return Y, (Ball.exact(np.eye(len(Y))) - Ball.exact(Y) @ M).size
