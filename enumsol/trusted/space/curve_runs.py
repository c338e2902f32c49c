"""The trusted bounds in 3D of the solutions along a curve, at every alpha of a piece (theory, section 12.9)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball, upper_norm
from enumsol.trusted.space.natural_map import upper_product
from enumsol.trusted.space.sector_rows import OPEN, STICK, UNDECIDED

if TYPE_CHECKING:
    from collections.abc import Sequence
    from fractions import Fraction

    from numpy.typing import NDArray

    from enumsol.trusted.space.curve_chains import CurveChain
    from enumsol.trusted.space.solution_curve import AlphaProblem

    Array = NDArray[np.float64]
    Flags = NDArray[np.bool_]

#: Parts of a run at least, and for every link that comes to the piece; into how many a part is cut at most; how often.
_PARTS, _OF_LINK, _CUT, _CUTS = 64, 4, 64, 24


class Run(NamedTuple):
    """Links of a curve, one after the other, by the numbers of the first and the last one.

    Along a closed curve the last one may come first: the links between go through the curve's first point.
    """

    first: int
    last: int


@dataclass(frozen=True, eq=False)
class CurveParts:
    """Short parts of a curve, N of them, that hold a solution for every alpha of a piece.

    Attributes
    ----------
    alpha : Ball of shape (N,)
        Within the piece.
    F : Ball of shape (N, p)
        Friction at these alphas.
    z : Ball of shape (N, m)
        Arguments of P at all solutions of a part: y / q + rho q w (see AlphaProblem).
    rho : (N, m) array
    rubs : (p, 2) bool array
        Axes along which there is friction.
    links : (N,) array of ints
    t : Ball of shape (N,)
        Parameters of the links there.
    """

    alpha: Ball
    F: Ball
    z: Ball
    rho: Array
    rubs: Flags
    links: NDArray[np.intp]
    t: Ball

    @cached_property
    def open(self) -> Flags:
        """Mask of nodes open all along a part, (N, p): z_n <= 0, so that no force acts."""
        p = len(self.rubs)
        return self.z.mid[:, :p] + self.z.rad[:, :p] * SAFE <= 0

    @cached_property
    def touching(self) -> Flags:
        """Mask of nodes that touch all along a part, (N, p): z_n >= 0, so that w_n = 0."""
        p = len(self.rubs)
        return self.z.mid[:, :p] - self.z.rad[:, :p] * SAFE >= 0

    @cached_property
    def sticking(self) -> Flags:
        """Mask of nodes that stick all along a part, (N, p): |z_t| <= F z_n, so that w = 0."""
        p = len(self.rubs)
        most = upper_norm(self.tangents.size, axis=2)
        normal = (self.z.mid[:, :p] - self.z.rad[:, :p] * SAFE) / SAFE
        least = (self.F.mid - self.F.rad * SAFE) / SAFE
        return np.asarray(self.touching & (least >= 0) & (most * SAFE <= least * normal / SAFE - TINY))

    @cached_property
    def tangents(self) -> Ball:
        """z_t of every node, (N, p, 2), 0 where there is no friction along an axis."""
        return self._tangents(self.z)

    def _tangents(self, x: Ball) -> Ball:
        p = len(self.rubs)
        both = (np.stack([part[:, p : 2 * p], part[:, 2 * p : 3 * p]], axis=2) for part in (x.mid, x.rad))
        return Ball(*(np.where(self.rubs, part, 0.0) for part in both))

    @cached_property
    def slips(self) -> tuple[Ball, Ball]:
        """w_n and q w_t where a node is open, (N, p) and (N, p, 2), in the same unit: there z is rho w.

        Without bounds where rho, a product of two numbers of a proof, may have over- or underflowed.
        """
        p, inverse = len(self.rubs), 1.0 / self.rho
        known = (self.rho > TINY) & (self.rho < 1.0 / TINY)
        w = self.z * Ball(inverse, np.where(known, 4 * UNIT * inverse, np.inf))
        return w[:, :p], self._tangents(w)

    @cached_property
    def thetas(self) -> tuple[Array, Array]:
        """A theta that serves every solution of a part, (N, p, 2), and how far others of them are from it, (N, p).

        theta = z_t / max(|z_t|, F z_n) with z_n at least 0. Within a ball its derivatives by z_t and by F z_n are at
        most 1 over the least of this maximum; where that may vanish the distance is infinite.
        """
        p = len(self.rubs)
        normal, tangent = np.maximum(self.z.mid[:, :p], 0.0), self.tangents
        disc, length = np.abs(self.F.mid) * normal, np.linalg.norm(tangent.mid, axis=2)
        away = upper_norm(tangent.rad, axis=2)
        change = (self.F.size * self.z.rad[:, :p] + self.F.rad * normal) * SAFE + 4 * UNIT * disc + TINY
        divisor = np.maximum(length, disc)
        least = np.maximum(length * (1.0 - 8 * UNIT) - away * SAFE, disc * (1.0 - 8 * UNIT) - change * SAFE) / SAFE
        known = least > 0
        far = (away + change) / np.where(known, least, 1.0) * SAFE * SAFE + 32 * UNIT
        theta = tangent.mid / np.where(divisor > 0, divisor, 1.0)[:, :, None]
        return theta, np.where(known, far, np.inf)

    def held(self, codes: Sequence[int]) -> Flags:
        """Mask of parts in which all solutions have the statuses of an assignment, (N,); a sector counts as contact."""
        held = np.ones(len(self.alpha.mid), dtype=bool)
        for i, code in enumerate(codes):
            if code != UNDECIDED:
                known = self.open if code == OPEN else self.sticking if code == STICK else self.touching
                held &= known[:, i]
        return held

    def allowed(self, codes: Sequence[int]) -> bool:
        """True if they have them in all parts."""
        return bool(np.all(self.held(codes)))


class _Links(NamedTuple):
    """Numbers of all links of a curve: its solutions are at x = c + t d + b, |b| <= radius, t between two points.

    z, slope and wide are those of the arguments of P, (links, m); alpha, rate and reach of alpha, (links,).
    """

    t: Ball
    alpha: Array
    rate: Array
    reach: Array
    z: Ball
    slope: Ball
    wide: Array
    rho: Array


@dataclass(frozen=True, eq=False)
class KnownCurve:
    """A curve, whose links pass alphas.

    Attributes
    ----------
    problem : AlphaProblem
    chain : CurveChain
    """

    problem: AlphaProblem
    chain: CurveChain

    def places(self, run: Run) -> NDArray[np.intp] | None:
        """The links of a run; None where there are no such links."""
        count, (first, last) = len(self.chain.links), run
        if not (0 <= first < count and 0 <= last < count) or (last < first and not self.chain.closed):
            return None
        return np.arange(first, last + 1 + (count if last < first else 0)) % count

    def passes(self, run: Run, low: Fraction, high: Fraction) -> bool:
        """True if a run passes every alpha of a piece: its ends lie on either side of it, or at its ends."""
        if self.places(run) is None:
            return False
        start, end = self.chain.joints[run.first].alphas, self.chain.joints[run.last + 1].alphas
        return (start[1] <= low and high <= end[0]) or (end[1] <= low and high <= start[0])

    @cached_property
    def _links(self) -> _Links:
        found = []
        with np.errstate(all="ignore"):
            for link in self.chain.links:
                curve, near, radius = link.curve, link.curve.found.near, link.curve.found.spread[0]
                begin, end = (float(link.start.mid - link.start.rad * SAFE), float(link.end.mid + link.end.rad * SAFE))
                t = 0.5 * (begin + end), 0.5 * (end - begin) * SAFE + 4 * UNIT * (abs(begin) + abs(end))
                m, wide = self.problem.m, upper_product(near.moves.size, radius) * SAFE
                z, along, rho = near.z[:m], near.zd[:m], self.problem.rho * curve.box.rho
                numbers = z.mid, z.rad, along.mid, along.rad, wide[:m], rho
                found.append((*t, curve.box.centre[m], near.d[m], radius[m], *numbers))
        t_mid, t_rad, alpha, rate, reach, *rest = map(np.array, zip(*found, strict=True))
        z_mid, z_rad, slope, slope_rad, wides, steps = rest
        return _Links(Ball(t_mid, t_rad), alpha, rate, reach, Ball(z_mid, z_rad), Ball(slope, slope_rad), wides, steps)

    @cached_property
    def joint_alphas(self) -> tuple[Array, Array]:
        """Bounds of alpha at the points between two links, and at both ends."""
        bounds = [joint.alphas for joint in self.chain.joints]
        low, high = (np.array([float(pair[k]) for pair in bounds]) for k in (0, 1))
        return np.nextafter(low, -np.inf), np.nextafter(high, np.inf)

    def over(self, run: Run, low: Fraction, high: Fraction) -> CurveParts:
        """The part of a run with alphas in a piece, in parts in its order; none where it does not come there."""
        links, places = self._links, self.places(run)
        assert places is not None
        where, t, wanted = places, links.t[places], _PARTS
        least, most = (float(np.nextafter(float(x), y)) for x, y in ((low, -np.inf), (high, np.inf)))
        for k in range(_CUTS):
            alpha = self._alphas(where, t)
            # what overflows is not known to be beyond the piece, and stays
            beyond = (alpha.mid + alpha.rad * SAFE < least) | (alpha.mid - alpha.rad * SAFE > most)
            where, t, alpha = where[~beyond], t[~beyond], alpha[~beyond]
            wanted = wanted if k else max(_PARTS, _OF_LINK * len(where))
            if len(where) >= wanted or not len(where):
                break
            # a power of two
            count = min(1 << (-(-wanted // len(where)) - 1).bit_length(), _CUT)
            shares = (2.0 * np.arange(count) + 1.0) / count - 1.0
            mid = (t.mid[:, None] + shares * t.rad[:, None]).ravel()
            # of the sum and of the product
            rad = np.repeat(t.rad / count * SAFE + 2 * UNIT * (np.abs(t.mid) + t.rad), count)
            t, where = Ball(mid, rad), np.repeat(where, count)
        order = np.lexsort((t.mid, np.argsort(places)[np.searchsorted(np.sort(places), where)]))
        where, t = where[order], t[order]
        alpha = self._alphas(where, t)
        # the solutions that are spoken of have their alphas in the piece
        begin, end = np.maximum(alpha.mid - alpha.rad * SAFE, least), np.minimum(alpha.mid + alpha.rad * SAFE, most)
        rounded = 2 * UNIT * (np.abs(begin) + np.abs(end))
        alpha = Ball(0.5 * (begin + end), (0.5 * np.maximum(end - begin, 0.0) + rounded) * SAFE + TINY)
        z = links.z[where] + t[:, None] * links.slope[where]
        F = Ball.exact(self.problem.F0) + alpha[:, None] * Ball.exact(self.problem.F1)
        z = Ball(z.mid, (z.rad + links.wide[where]) * SAFE)
        return CurveParts(alpha, F, z, links.rho[where], self._rubs, where, t)

    @cached_property
    def _rubs(self) -> Flags:
        p = self.problem.p
        return np.array([[(1 + k) * p + i in t for k in (0, 1)] for i, t in enumerate(self.problem.tau)])

    def _alphas(self, where: NDArray[np.intp], t: Ball) -> Ball:
        links = self._links
        alpha = Ball.exact(links.alpha[where]) + t * Ball.exact(links.rate[where])
        return Ball(alpha.mid, (alpha.rad + links.reach[where]) * SAFE)
