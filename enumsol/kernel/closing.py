"""The trusted test of closed subtrees: one reduced solution where some contact nodes are free (theory, section 6.11).

Some nodes have a status, others are free: they may have any; and others slide: they are open or slip in one direction.
Eliminating the equations of the fixed nodes leaves the reduced problem of the others, w = h - R x. Where its matrix
passes a test of definiteness it has exactly one solution, which is enclosed without knowing the statuses of its nodes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, dense_eigenvalue_bound, upper_norm
from enumsol.kernel.ball_arrays import Ball, determinant_sign, solution
from enumsol.kernel.point import row_balls, solve_selection
from enumsol.kernel.rows import (
    BACKWARD,
    CONDITIONS,
    FORWARD,
    FRICTIONLESS,
    OPEN,
    SLIP_MINUS,
    SLIP_PLUS,
    STICK,
    UNDECIDED,
    refines,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from enumsol.arithmetic.balls import Array
    from enumsol.condensation.enclosure import EnclosedSystem
    from enumsol.kernel.point import VerifiedSelection

    Codes = tuple[int, ...]

#: Radii of forces by the largest force, beyond which a solution is hardly placed.
_WIDE = 1e-3


def core_of(selection: Sequence[int], free: Sequence[int]) -> Codes:
    """The selection with its free nodes undecided."""
    chosen = set(free)
    return tuple(UNDECIDED if i in chosen else code for i, code in enumerate(selection))


@dataclass(frozen=True)
class ClosedSolution:
    """The one solution of a reduced problem as balls, in scaled units.

    Attributes
    ----------
    core : status codes, UNDECIDED at the free nodes, FORWARD or BACKWARD at those that slide
    force, force_rad, w, w_rad : (2p,) arrays
        lambda and w = g - S lambda.
    possible : per node the final codes that may hold there; those of a fixed node that holds strictly are its own only
    sign : int
        Sign of the determinant of the fixed nodes' equations: the index, if the conditions below hold strictly.
    slack, slack_rad : arrays
        The conditions of the fixed nodes, and of every sliding one: the sign of its slip, unless it is open.
    regular : VerifiedSelection or None
        Its selection's solution, where its balls were taken for it.
    """

    core: Codes
    force: Array
    force_rad: Array
    w: Array
    w_rad: Array
    possible: tuple[frozenset[int], ...]
    sign: int
    slack: Array
    slack_rad: Array
    regular: VerifiedSelection | None = None

    @property
    def is_root(self) -> bool:
        """All conditions hold strictly: exactly one root has this core."""
        return bool(np.all(self.slack > self.slack_rad))

    @property
    def is_excluded(self) -> bool:
        """A condition is broken strictly: no root has this core."""
        return bool(np.any(self.slack < -self.slack_rad))

    @property
    def is_wide(self) -> bool:
        """The balls hardly tell where it lies."""
        return bool(np.max(self.force_rad, initial=0.0) > _WIDE * np.max(np.abs(self.force), initial=0.0))


def final_codes(friction: bool) -> tuple[int, ...]:
    """The final codes of a node."""
    return (OPEN, STICK, SLIP_PLUS, SLIP_MINUS) if friction else (OPEN, FRICTIONLESS)


def closed_solution(
    system: EnclosedSystem, selection: Codes, free: Sequence[int], weights: Array, force: Array
) -> ClosedSolution | None:
    """The only solution of the reduced problem, or None where that is not proven.

    Parameters
    ----------
    system : EnclosedSystem
    selection : final codes, those of the free nodes only name a point near the solution; FORWARD or BACKWARD where a
        node slides
    free : ascending nodes, none of which slides
    weights : numbers of the form of theory, (6.9), as ``Weights.of`` takes them
    force : (2p,) array, lambda near the solution; only lambda_n of nodes that are free or slide is read
    """
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        reduced = Reduced.of(system, selection, free)
        numbers = None if reduced is None else Weights.of(reduced, weights)
        return None if reduced is None or numbers is None else reduced.enclosed(numbers, force)


def only_solution(
    system: EnclosedSystem,
    selection: Codes,
    free: Sequence[int],
    weights: Array,
    point: Sequence[Any],
    w: Sequence[Any],
) -> int:
    """The determinant's sign of the fixed nodes' equations if a solution of the reduced problem is its only one.

    0 where that is not proven.

    Parameters
    ----------
    system, selection, free, weights : as for ``closed_solution``
    point, w : 2p rationals each, lambda in units of force and w in units of length
        At a solution of the reduced problem that has the statuses of the selection at the nodes that do not slide.
    """
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        reduced = Reduced.of(system, selection, free)
        numbers = None if reduced is None else Weights.of(reduced, weights)
        numbers = None if reduced is None or numbers is None else numbers.at(reduced, point, w)
        return reduced.sign if reduced is not None and numbers is not None and reduced.least(numbers) > 0 else 0


def same_solution(
    one: Codes, one_possible: Sequence[frozenset[int]], other: Codes, other_possible: Sequence[frozenset[int]]
) -> bool | None:
    """Whether two solutions, each the only one of its core, are the same; None where that is open.

    The solution of one core solves that of another if it has the statuses of its fixed nodes. A solution in a complete
    selection is one whose core is complete.
    """
    if any(not a & b for a, b in zip(one_possible, other_possible, strict=True)):
        return False
    for core, possible in ((one, other_possible), (other, one_possible)):
        if all(all(refines(c, code) for c in held) for code, held in zip(core, possible, strict=True)):
            return True
    return None


_SLIDING = (FORWARD, BACKWARD)
_SIGNS = {SLIP_PLUS: 1, SLIP_MINUS: -1}


@dataclass(frozen=True)
class Weights:
    """The numbers of the form of theory, (6.9).

    Attributes
    ----------
    mu : one number a node
    kappa, nu, share, tau : one number for every free node with friction
    slope : Ball
        theta there.
    friction : Ball
        F there.
    normal : places of lambda_n of free nodes with friction
    """

    mu: Array
    kappa: Array
    nu: Array
    share: Array
    tau: Array
    slope: Ball
    friction: Ball
    normal: NDArray[np.intp]

    @classmethod
    def of(cls, reduced: Reduced, numbers: Array) -> Weights | None:
        """From one array: mu of all nodes, then kappa, nu, theta / F and tau of the free ones with friction.

        mu and kappa are positive, |nu| F <= mu, |theta| <= F; theta = +-F at nodes that slip in the selection; tau is
        not negative, and theta = 0 where it is positive. None where this is not so.
        """
        system, m, normal = reduced.system, len(reduced.nodes), np.flatnonzero(reduced.tangential >= 0)
        if len(numbers) != m + 4 * len(normal) or not np.all(np.isfinite(numbers)):
            return None
        mu, (kappa, nu, share, tau) = numbers[:m], numbers[m:].reshape(4, -1)
        nodes = reduced.nodes[normal]
        friction = Ball(system.F[nodes], system.F_rad[nodes])
        sides = np.array([_SIGNS.get(reduced.selection[i], 0) for i in nodes])
        wrong = (np.abs(share) > 1) | ((sides != 0) & (share != sides)) | ((tau > 0) & (share != 0))
        wrong |= np.abs(nu) * friction.size * SAFE + TINY > mu[normal]
        if np.any(wrong) or np.any(mu <= 0) or np.any(kappa <= 0) or np.any(tau < 0):
            return None
        turned = friction * Ball.exact(share)
        whole = np.abs(share) == 1
        slope = Ball(np.where(whole, share * friction.mid, turned.mid), np.where(whole, friction.rad, turned.rad))
        return cls(mu, kappa, nu, share, tau, slope, friction, normal)

    def at(self, reduced: Reduced, point: Sequence[Any], w: Sequence[Any]) -> Weights | None:
        """With theta = lambda_t / lambda_n where lambda_n > 0 at a rational solution; None if they do not serve it."""
        p, slope = reduced.system.p, Ball(self.slope.mid.copy(), self.slope.rad.copy())
        for k, i in enumerate(self.normal):
            node = int(reduced.nodes[i])
            if self.tau[k] > 0:
                continue
            if point[node] != 0:
                ratio = point[p + node] / point[node]
                slope.mid[k] = int(ratio.p) / int(ratio.q)
                slope.rad[k] = 2 * UNIT * abs(slope.mid[k]) + TINY
            elif self.beyond(k, *_bounds(w[node], w[p + node])) > 0:
                return None
        return replace(self, slope=slope)

    def beside(self, x: Ball, tangential: NDArray[np.intp]) -> Weights:
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

    def moved(self, change: Array) -> float:
        """Upper bound of ||D'delta||, |delta| <= change."""
        m, n = len(self.mu), self.normal
        along = self.mu * change[:m]
        along[n] += self.kappa * self.slope.size * change[m:]
        across = np.abs(self.nu) * change[n] + self.kappa * change[m:]
        return float(upper_norm(np.concatenate([along, across]) * SAFE + TINY) * SAFE)


def _bounds(w_n: Any, w_t: Any) -> tuple[float, float, float]:
    """-w_n >= 0 from below, and from above w_t and -w_t where they are positive, of rationals."""
    try:
        gap, slip = -int(w_n.p) / int(w_n.q), int(w_t.p) / int(w_t.q)
    except OverflowError:
        return 0.0, np.inf, np.inf
    size = abs(slip) * SAFE + TINY
    return max(gap / SAFE - TINY, 0.0), size * bool(w_t > 0), size * bool(w_t < 0)


@dataclass(frozen=True)
class Reduced:
    """w = h - R x on the nodes that are free or slide, by elimination of the fixed ones.

    Attributes
    ----------
    nodes : int array
        Those that are free, then those that slide.
    places : int array
        Of x in lambda: lambda_n of all these nodes, then lambda_t of the free ones with friction.
    tangential : int array
        Place of lambda_t among them, for all nodes; -1 where there is none.
    turn : Ball
        lambda_t of a sliding node is so many times its lambda_n, +-F; zero for free nodes.
    E, Z : Ball
        lambda = E y + P x, and y = Z (1, -x): the fixed nodes' forces for x.
    R, h : Ball
    """

    system: EnclosedSystem
    selection: Codes
    nodes: NDArray[np.intp]
    places: NDArray[np.intp]
    tangential: NDArray[np.intp]
    rows: NDArray[np.intp]
    turn: Ball
    E: Ball
    Z: Ball
    R: Ball
    h: Ball
    sign: int

    @classmethod
    def of(cls, system: EnclosedSystem, selection: Codes, free: Sequence[int]) -> Reduced | None:
        """None where the fixed nodes' equations are not proven regular, or a node cannot have its code."""
        chosen = set(free)
        for i, (code, F) in enumerate(zip(selection, system.F, strict=True)):
            if code not in final_codes(F > 0) and not (code in _SLIDING and F > 0 and i not in chosen):
                return None
        p, status = system.p, np.array(core_of(selection, free), dtype=np.intp)
        slides = np.isin(status, _SLIDING)
        nodes = np.concatenate([np.array(free, dtype=np.intp), np.flatnonzero(slides)])
        rubbing = (system.F[nodes] > 0) & ~slides[nodes]
        places = np.concatenate([nodes, p + nodes[rubbing]])
        tangential = np.full(len(nodes), -1, dtype=np.intp)
        tangential[rubbing] = len(nodes) + np.arange(np.count_nonzero(rubbing))
        closed = np.flatnonzero((status != OPEN) & (status != UNDECIDED) & ~slides)
        held = p + np.flatnonzero(status == STICK)
        slip = np.where(np.isin(status, (SLIP_PLUS, FORWARD)), 1.0, 0.0)
        slip -= np.where(np.isin(status, (SLIP_MINUS, BACKWARD)), 1.0, 0.0)
        E, E_rad = np.zeros((2 * p, len(closed) + len(held))), np.zeros((2 * p, len(closed) + len(held)))
        column = np.arange(len(closed))
        E[closed, column] = 1.0
        E[p + closed, column], E_rad[p + closed, column] = (slip * system.F)[closed], (abs(slip) * system.F_rad)[closed]
        E[held, len(closed) + np.arange(len(held))] = 1.0
        forms, rows = Ball(E, E_rad), np.concatenate([closed, held])
        S, g = Ball(system.S, system.S_rad), Ball(system.g, system.g_rad)
        M = S[rows] @ forms
        sign = determinant_sign(M)
        turn = Ball((slip * system.F)[nodes], (abs(slip) * system.F_rad)[nodes])
        across = S[:, places]
        side = np.flatnonzero(slides[nodes])
        turned = across[:, side] + S[:, p + nodes[side]] * turn[side]
        across.mid[:, side], across.rad[:, side] = turned.mid, turned.rad
        above = across[rows]
        right = Ball(np.column_stack([g.mid[rows], above.mid]), np.column_stack([g.rad[rows], above.rad]))
        Z = solution(M, right) if sign else None
        if Z is None:
            return None
        moved = (S[places] @ forms) @ Z
        R, h = across[places] - moved[:, 1:], g[places] - moved[:, 0]
        return cls(system, selection, nodes, places, tangential, rows, turn, forms, Z, R, h, sign)

    def form(self, numbers: Weights) -> Ball:
        """D'R, of which (6.9) is the symmetric part."""
        R, n, t = self.R, np.flatnonzero(self.tangential >= 0), self.tangential[self.tangential >= 0]
        form = Ball(R.mid.copy(), R.rad.copy())
        along = R[: len(self.nodes)] * Ball.exact(numbers.mu[:, None])
        turned = (numbers.slope * Ball.exact(numbers.kappa))[:, None]
        across = R[n] * Ball.exact(numbers.nu[:, None]) + R[t] * Ball.exact(numbers.kappa[:, None])
        for rows, part in ((np.arange(len(self.nodes)), along), (n, along[n] - R[t] * turned), (t, across)):
            form.mid[rows], form.rad[rows] = part.mid, part.rad
        return form

    def least(self, numbers: Weights) -> float:
        """Lower bound of the smallest eigenvalue of Q (theory, (6.9)), at most 0 where none positive is proven."""
        if not len(self.places):
            return 1.0
        used = np.flatnonzero(numbers.tau > 0)
        normal, tau = numbers.normal[used], numbers.tau[used]
        # weights at least kappa F / sqrt(tau), for any rounding
        weight = numbers.kappa[used] * numbers.friction.size[used] / np.sqrt(tau) * SAFE + TINY
        T = self.R[self.tangential[normal]] * Ball.exact(weight[:, None])
        square = Ball(T.mid.T, T.rad.T) @ T
        Q = self.form(numbers) - Ball(0.5 * square.mid, 0.5 * square.rad)
        Q.mid[normal, normal] -= 0.5 * tau
        Q.rad[normal, normal] += UNIT * (np.abs(Q.mid[normal, normal]) + tau)
        mid = 0.5 * (Q.mid + Q.mid.T)
        # the symmetric part of the form lies in the mean of both triangles
        rad = (np.maximum(Q.rad, Q.rad.T) + 4 * UNIT * np.abs(mid)) * SAFE
        if not (np.all(np.isfinite(mid)) and np.all(np.isfinite(rad))):
            return 0.0
        return float((dense_eigenvalue_bound(mid) - upper_norm(rad)) / SAFE)

    def enclosed(self, numbers: Weights, force: Array) -> ClosedSolution | None:
        """The solution as a ball, None where it is not proven to exist and to be the only one."""
        if len(self.nodes) == self.system.p and not any(code in _SLIDING for code in self.selection):
            # all nodes are free: where its selection holds strictly, that is closer than (6.10) if Q is hardly definite
            root = solve_selection(self.system, self.selection)
            if root is not None and root.is_root:
                # R is S and h is g: so these are x and w here, and w is closer than R times the radii of x gives it
                x = Ball(root.force[self.places], root.force_rad[self.places])
                w = Ball(root.w[self.places], root.w_rad[self.places])
                numbers = numbers.beside(x, self.tangential[numbers.normal])
                alone = self._alone(x, w, numbers, self.least(numbers))
                return None if alone is None else replace(alone, regular=root)
        least = self.least(numbers)
        if not least > 0:
            return None
        x = self._point(force, numbers)
        reach = self._distance(x.mid, self._displacements(x), numbers) / least * SAFE
        if not np.isfinite(reach):
            return None
        x = Ball(x.mid, (x.rad + reach) * SAFE)
        w = self._displacements(x)
        for i, node in enumerate(self.nodes):
            # open at every solution
            if self.selection[node] == OPEN and w.mid[i] + w.rad[i] < 0:
                x.rad[[i, self.tangential[i]] if self.tangential[i] >= 0 else i] = 0.0
        return self._alone(x, self._displacements(x), numbers, least)

    def _alone(self, x: Ball, w: Ball, numbers: Weights, least: float) -> ClosedSolution | None:
        """The solution that is known to lie in a ball, if Q is definite for every theta that it may have there."""
        n, t = numbers.normal, self.tangential[numbers.normal]
        off = np.array([numbers.off(k, x[a], x[b], w[a], w[b]) for k, (a, b) in enumerate(zip(n, t, strict=True))])
        # at each of them Q is not smaller than this
        if not least > upper_norm(numbers.kappa * off * upper_norm(self.R[t].size, axis=1)) * SAFE:
            return None
        return self._solution(x, w)

    def _displacements(self, x: Ball) -> Ball:
        """w of the free components."""
        return self.h - (self.R @ Ball(x.mid[:, None], x.rad[:, None]))[:, 0]

    def _point(self, force: Array, numbers: Weights) -> Ball:
        """Forces in the cones, with the statuses of the selection, near the given ones."""
        mid = np.array([0.0 if self.selection[i] == OPEN else max(float(force[i]), 0.0) for i in self.nodes])
        turned = Ball.exact(mid[self.tangential >= 0]) * numbers.slope
        radii = np.where(mid[self.tangential >= 0] > 0, turned.rad, 0.0)
        return Ball(np.concatenate([mid, turned.mid]), np.concatenate([np.zeros(len(mid)), radii]))

    def _distance(self, point: Array, w: Ball, numbers: Weights) -> float:
        """Bound of the numerator of theory, (6.10), for a point that is a solution with another h."""
        size, change = w.size, np.zeros(len(self.places))
        up, down = np.maximum(w.mid + w.rad, 0.0) * SAFE, np.maximum(w.rad - w.mid, 0.0) * SAFE
        gap = np.maximum(-(w.mid + w.rad), 0.0) / SAFE
        if not np.all(np.isfinite(size)):
            return np.inf
        for i, node in enumerate(self.nodes):
            code, t = self.selection[node], self.tangential[i]
            apart = code == OPEN or (code in _SLIDING and point[i] == 0)
            change[i] = up[i] if apart else size[i]
            if t >= 0:
                slips = {STICK: size[t], SLIP_PLUS: down[t], SLIP_MINUS: up[t]}
                change[t] = numbers.beyond(t - len(self.nodes), gap[i], up[t], down[t]) if apart else slips[code]
        return numbers.moved(change)

    def _solution(self, x: Ball, w_free: Ball) -> ClosedSolution:
        system, p = self.system, self.system.p
        y = self.Z[:, 0] - (self.Z[:, 1:] @ Ball(x.mid[:, None], x.rad[:, None]))[:, 0]
        force = (self.E @ Ball(y.mid[:, None], y.rad[:, None]))[:, 0]
        free = [int(node) for node in self.nodes if self.selection[node] not in _SLIDING]
        core = core_of(self.selection, free)
        status = np.array(core)
        fixed = (status != UNDECIDED) & ~np.isin(status, _SLIDING)
        idle = np.concatenate([~fixed | (status == OPEN), ~fixed | (status == OPEN) | (status == FRICTIONLESS)])
        force.mid[idle], force.rad[idle] = 0.0, 0.0
        force.mid[self.places], force.rad[self.places] = x.mid, x.rad
        side = np.flatnonzero(np.isin(status[self.nodes], _SLIDING))
        turned = x[side] * self.turn[side]
        force.mid[p + self.nodes[side]], force.rad[p + self.nodes[side]] = turned.mid, turned.rad
        S, g = Ball(system.S, system.S_rad), Ball(system.g, system.g_rad)
        w = g - (S @ Ball(force.mid[:, None], force.rad[:, None]))[:, 0]
        w.mid[self.places], w.rad[self.places] = w_free.mid, w_free.rad
        w.mid[self.rows], w.rad[self.rows] = 0.0, 0.0
        values, radii = row_balls(system, force.mid, force.rad, w.mid, w.rad)
        tests = [(values[kind, i], radii[kind, i]) for i in np.flatnonzero(fixed) for kind in CONDITIONS[core[i]][1]]
        tests += [self._slides(core[node], values[:, node], radii[:, node]) for node in self.nodes[side]]
        slack, slack_rad = (np.array(part) for part in (zip(*tests, strict=True) if tests else ((), ())))
        possible = tuple(
            frozenset((core[i],)) if fixed[i] else self._possible(i, values[:, i], radii[:, i]) for i in range(p)
        )
        return ClosedSolution(core, force.mid, force.rad, w.mid, w.rad, possible, self.sign, slack, slack_rad)

    @staticmethod
    def _slides(code: int, values: Array, radii: Array) -> tuple[float, float]:
        """What tells that a sliding node slips in its direction or is open, with its radius."""
        forward = 5 if code == FORWARD else 6
        separate, slips = (values[4], radii[4]), (values[forward], radii[forward])
        if values[4] > radii[4]:
            return separate
        loaded = values[0] > radii[0]
        return slips if loaded or slips[0] > slips[1] else (0.0, 0.0)

    def _possible(self, node: int, values: Array, radii: Array) -> frozenset[int]:
        """Final codes of a node that its balls do not exclude."""
        high, low = values + radii, values - radii
        return frozenset(
            code
            for code in final_codes(self.system.F[node] > 0)
            if all(low[k] <= 0 <= high[k] for k in CONDITIONS[code][0])
            and all(high[k] >= 0 for k in CONDITIONS[code][1])
        )
