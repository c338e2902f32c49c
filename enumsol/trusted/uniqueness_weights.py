"""The numbers of the trusted form of theory, (6.9), and its least eigenvalue; of closed subtrees and of lone roots."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball
from enumsol.trusted.status_rows import BACKWARD, FORWARD, OPEN, SLIP_MINUS, SLIP_PLUS, STICK, slip_directions
from enumsol.trusted.uniqueness_forms import Multipliers, UniqueForm

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.condensation.enclosure import EnclosedSystem
    from enumsol.support.array_types import Floats, Indices
    from enumsol.trusted.selection import Unknowns

#: Codes of nodes that are open or slip in one direction.
SLIDES = (FORWARD, BACKWARD)


@dataclass(frozen=True)
class Weights:
    """The numbers of the form of theory, (6.9).

    Attributes
    ----------
    mu : one number per node
    kappa, nu, share, tau : one number for every free node with friction
    slope : Ball
        theta there.
    friction : Ball
        F there.
    normal : places of lambda_n of free nodes with friction
    """

    mu: Floats
    kappa: Floats
    nu: Floats
    share: Floats
    tau: Floats
    slope: Ball
    friction: Ball
    normal: Indices

    @classmethod
    def of(cls, part: Components, numbers: Floats) -> Weights | None:
        """From one array: mu of all nodes, then kappa, nu, theta / F and tau of the free ones with friction.

        mu and kappa are positive, |nu| F <= mu, |theta| <= F; theta = +-F at nodes that slip in the selection; tau is
        not negative, and theta = 0 where it is positive. None where this is not so.
        """
        system, m, normal = part.system, len(part.at.nodes), part.at.normal
        if len(numbers) != m + 4 * len(normal) or not np.all(np.isfinite(numbers)):
            return None
        mu, (kappa, nu, share, tau) = numbers[:m], numbers[m:].reshape(4, -1)
        nodes = part.at.nodes[normal]
        friction = system.balls[2][nodes]
        sides = slip_directions(part.selection)[nodes]
        wrong = (np.abs(share) > 1) | ((sides != 0) & (share != sides)) | ((tau > 0) & (share != 0))
        wrong |= np.abs(nu) * friction.size * SAFE + TINY > mu[normal]
        if np.any(wrong) or np.any(mu <= 0) or np.any(kappa <= 0) or np.any(tau < 0):
            return None
        turned = friction * Ball.exact(share)
        whole = np.abs(share) == 1
        slope = Ball(np.where(whole, share * friction.mid, turned.mid), np.where(whole, friction.rad, turned.rad))
        return cls(mu, kappa, nu, share, tau, slope, friction, normal)

    def at(self, part: Components, point: Sequence[Any], w: Sequence[Any]) -> Weights | None:
        """With theta = lambda_t / lambda_n where lambda_n > 0 at a rational solution; None if they do not serve it."""
        p, slope = part.system.p, self.slope.copy()
        for k, i in enumerate(self.normal):
            node = int(part.at.nodes[i])
            if self.tau[k] > 0:
                continue
            if point[node] != 0:
                ratio = point[p + node] / point[node]
                slope.mid[k] = int(ratio.p) / int(ratio.q)
                slope.rad[k] = 2 * UNIT * abs(slope.mid[k]) + TINY
            elif self.beyond(k, *_bounds(w[node], w[p + node])) > 0:
                return None
        return replace(self, slope=slope)

    def beside(self, x: Ball, tangential: Indices) -> Weights:
        """With theta = lambda_t / lambda_n at the middle of a solution's ball where it is not F or -F, nor tau > 0."""
        n, t = x.mid[self.normal], x.mid[tangential]
        told = (self.tau == 0) & (np.abs(self.share) < 1) & (n > 0)
        ratio = np.where(told, t / np.where(told, n, 1.0), self.slope.mid)
        # off says how far that is from theta
        return replace(self, slope=Ball(ratio, np.where(told, 0.0, self.slope.rad)))

    def beyond(self, k: int, gap: float, up: float, down: float) -> float:
        """What w_t of a node that is open is too large for the numbers, if -w_n >= gap and -down <= w_t <= up."""
        excess = 0.0
        for side, size in ((1.0, up), (-1.0, down)):
            left = (1.0 - side * self.share[k]) * self.kappa[k] * self.friction.size[k] * SAFE
            if left > 0 and size > 0:
                normal = self.mu[self.normal[k]] + side * self.nu[k] * self.friction.mid[k]
                normal -= (abs(self.nu[k]) * self.friction.rad[k] + 4 * UNIT * self.mu[self.normal[k]]) * SAFE
                excess = max(excess, size - max(normal, 0.0) * gap / left / SAFE)
        return float(excess * SAFE)

    def off(self, k: int, n: Ball, t: Ball, w_n: Ball, w_t: Ball) -> float:
        """How far theta is at most from one that serves a solution within a node's balls; infinite if that is open."""
        share, F = float(self.share[k]), self.friction[k]
        slips = np.sign(w_t.mid) if abs(w_t.mid) > w_t.rad else 0.0
        if self.tau[k] > 0 or (slips and share == slips):
            return 0.0
        if w_n.mid + w_n.rad < 0:
            up, down = (max(float(side), 0.0) * SAFE for side in (w_t.mid + w_t.rad, w_t.rad - w_t.mid))
            return np.inf if self.beyond(k, -float(w_n.mid + w_n.rad) / SAFE, up, down) > 0 else 0.0
        low = float(n.mid - n.rad) / SAFE
        if low <= 0:
            return np.inf
        slope = self.slope[k]
        if slips:
            return float((abs(slips * F.mid - slope.mid) + F.rad + slope.rad) * SAFE)
        # |lambda_t / lambda_n - theta| = |lambda_t - theta lambda_n| / lambda_n
        apart = t - slope * n
        return float(apart.size / low * SAFE)

    def distances(self, at: Unknowns, x: Ball, w: Ball) -> Floats:
        """How far theta is at most from one that serves a solution within balls, (m,); infinite where that is open."""
        found, t = np.zeros(len(self.mu)), at.tangential
        for k, n in enumerate(self.normal):
            found[n] = self.off(k, x[n], x[t[n]], w[n], w[t[n]])
        return found

    def multipliers(self, at: Unknowns) -> Multipliers:
        """D of all nodes."""
        unit = np.ones((len(self.mu), 1))
        turn, push, kappa = Ball.exact(0.0 * unit), 0.0 * unit, np.ones(len(self.mu))
        turn[self.normal, 0], push[self.normal, 0], kappa[self.normal] = self.slope, self.nu, self.kappa
        return Multipliers(at.tangential[:, None], self.mu, kappa, turn, Ball.exact(push), unit)

    def form(self, part: Components, further: Ball | None = None) -> UniqueForm | None:
        """Q of theory, (6.9), of some components; None where it is not proven definite.

        ``further``: rows whose squares are added to the form.
        """
        off, lost = np.zeros(len(self.mu)), np.zeros(len(self.mu))
        lost[self.normal] = self.tau
        off[self.normal] = np.where(self.tau > 0, self.friction.size, 0.0)
        return UniqueForm.of(part.R, self.multipliers(part.at), off, lost, further)


def _bounds(w_n: Any, w_t: Any) -> tuple[float, float, float]:
    """-w_n >= 0 from below, and from above w_t and -w_t where they are positive, of rationals."""
    try:
        gap, slip = -int(w_n.p) / int(w_n.q), int(w_t.p) / int(w_t.q)
    except OverflowError:
        return 0.0, np.inf, np.inf
    size = abs(slip) * SAFE + TINY
    return max(gap / SAFE - TINY, 0.0), size * bool(w_t > 0), size * bool(w_t < 0)


@dataclass(frozen=True)
class Components:
    """Components x of lambda and those of w that belong to them, which change by -R d where x changes by d.

    Attributes
    ----------
    system : EnclosedSystem
    selection : status codes; those of the nodes below name the slip at a solution
    at : Unknowns
        Which components.
    R : Ball
    """

    system: EnclosedSystem
    selection: tuple[int, ...]
    at: Unknowns
    R: Ball

    def point(self, force: Floats, numbers: Weights) -> Ball:
        """Forces in the cones, with the statuses of the selection, near the given ones."""
        mid = np.array([0.0 if self.selection[i] == OPEN else max(float(force[i]), 0.0) for i in self.at.nodes])
        turned = Ball.exact(mid[self.at.tangential >= 0]) * numbers.slope
        radii = np.where(mid[self.at.tangential >= 0] > 0, turned.rad, 0.0)
        return Ball(np.concatenate([mid, turned.mid]), np.concatenate([np.zeros(len(mid)), radii]))

    def distance(self, point: Floats, w: Ball, numbers: Weights) -> float:
        """Bound of the numerator of theory, (6.10), for a point that is a solution with another h."""
        size, change = w.size, np.zeros(len(self.at.places))
        up, down = np.maximum(w.high, 0.0) * SAFE, np.maximum(w.rad - w.mid, 0.0) * SAFE
        gap = np.maximum(-w.high, 0.0) / SAFE
        if not np.all(np.isfinite(size)):
            return np.inf
        for i, node in enumerate(self.at.nodes):
            code, t = self.selection[node], self.at.tangential[i]
            apart = code == OPEN or (code in SLIDES and point[i] == 0)
            change[i] = up[i] if apart else size[i]
            if t >= 0:
                slips = {STICK: size[t], SLIP_PLUS: down[t], SLIP_MINUS: up[t]}
                change[t] = numbers.beyond(t - len(self.at.nodes), gap[i], up[t], down[t]) if apart else slips[code]
        return numbers.multipliers(self.at).moved(change)
