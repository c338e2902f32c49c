"""The trusted test of closed subtrees: one reduced solution where some contact nodes are free (theory, section 6.11).

Some nodes have a status, others are free: they may have any; and others slide: they are open or slip in one direction.
Eliminating the equations of the fixed nodes leaves the reduced problem of the others, w = h - R x. Where its matrix
passes a test of definiteness it has exactly one solution, which is enclosed without knowing the statuses of its nodes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, dense_eigenvalue_bound, upper_norm
from enumsol.kernel.ball_arrays import Ball, determinant_sign, solution
from enumsol.kernel.point import row_balls
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

    Codes = tuple[int, ...]


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

    @property
    def is_root(self) -> bool:
        """All conditions hold strictly: exactly one root has this core."""
        return bool(np.all(self.slack > self.slack_rad))

    @property
    def is_excluded(self) -> bool:
        """A condition is broken strictly: no root has this core."""
        return bool(np.any(self.slack < -self.slack_rad))


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
    weights : tau of the free nodes, positive, or 0 where a node is open by more than its slip bound (theory, (6.9));
        then omega of the components of x, all positive, unless all are 1
    force : (2p,) array, lambda near the solution; only that of nodes that are free or slide is read
    """
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        reduced = Reduced.of(system, selection, free)
        numbers = None if reduced is None else reduced.numbers(weights)
        return None if reduced is None or numbers is None else reduced.enclosed(*numbers, force)


def definite_sign(system: EnclosedSystem, selection: Codes, free: Sequence[int], weights: Array) -> int:
    """The determinant's sign of the fixed nodes' equations if the reduced form is definite, 0 if not proven.

    Where tau is zero nothing is asked of the node: that it may be so is to be shown otherwise (theory, (6.9)).
    """
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        reduced = Reduced.of(system, selection, free)
        numbers = None if reduced is None else reduced.numbers(weights)
        return reduced.sign if reduced is not None and numbers is not None and reduced.least(*numbers) > 0 else 0


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

    @cached_property
    def _slope(self) -> Array:
        """Upper bounds of the nodes' friction coefficients."""
        return np.asarray((self.system.F + self.system.F_rad)[self.nodes] * SAFE)

    def numbers(self, weights: Array) -> tuple[Array, Array] | None:
        """tau of all nodes, 0 where they slide, and omega of all components; None where these cannot be."""
        size, count = len(self.places), sum(self.selection[node] not in _SLIDING for node in self.nodes)
        tau, omega = weights[:count], weights[count:] if len(weights) > count else np.ones(size)
        if len(tau) < count or len(omega) != size or not np.all(np.isfinite(weights)):
            return None
        if np.any(tau < 0) or np.any(omega <= 0):
            return None
        return np.concatenate([tau, np.zeros(len(self.nodes) - count)]), omega

    def least(self, tau: Array, omega: Array) -> float:
        """Lower bound of the smallest eigenvalue of Q (theory, (6.9)), at most 0 where none positive is proven.

        Parameters
        ----------
        tau : one number a node
        omega : one number a component of x
        """
        if not len(self.places):
            return 1.0
        used = np.flatnonzero((self.tangential >= 0) & (tau > 0))
        R = self.R * Ball.exact(omega[:, None])
        # weights at least F / sqrt(tau), for any rounding
        weight = self._slope[used] / np.sqrt(tau[used]) * SAFE + TINY
        T = R[self.tangential[used]] * Ball.exact(weight[:, None])
        square = Ball(T.mid.T, T.rad.T) @ T
        Q = R - Ball.exact(np.diag(self._diagonal(used, tau))) - Ball(0.5 * square.mid, 0.5 * square.rad)
        mid = 0.5 * (Q.mid + Q.mid.T)
        # the symmetric part of the form lies in the mean of both triangles
        rad = (np.maximum(Q.rad, Q.rad.T) + 4 * UNIT * np.abs(mid)) * SAFE
        if not (np.all(np.isfinite(mid)) and np.all(np.isfinite(rad))):
            return 0.0
        return float((dense_eigenvalue_bound(mid) - upper_norm(rad)) / SAFE)

    def _diagonal(self, used: NDArray[np.intp], tau: Array) -> Array:
        diagonal = np.zeros(len(self.places))
        diagonal[used] = 0.5 * tau[used]
        return diagonal

    def enclosed(self, tau: Array, omega: Array, force: Array) -> ClosedSolution | None:
        """The solution as a ball, None where it is not proven to exist and to be the only one."""
        least = self.least(tau, omega)
        if not least > 0:
            return None
        x = self._point(force)
        reach = self._distance(x.mid, self._displacements(x), omega) / least * SAFE
        if not np.isfinite(reach):
            return None
        x = Ball(x.mid, (x.rad + reach) * SAFE)
        easy = np.flatnonzero((tau == 0) & (self.tangential >= 0))
        if not self._far_from_contact(easy, self._displacements(x), omega):
            return None
        # nodes that are open at all solutions
        x.rad[easy] = x.rad[self.tangential[easy]] = 0.0
        return self._solution(x, self._displacements(x))

    def _displacements(self, x: Ball) -> Ball:
        """w of the free components."""
        return self.h - (self.R @ Ball(x.mid[:, None], x.rad[:, None]))[:, 0]

    def _far_from_contact(self, nodes: NDArray[np.intp], w: Ball, omega: Array) -> bool:
        """Whether nodes are open with omega_n w_n + omega_t F |w_t| < 0."""
        n, t = nodes, self.tangential[nodes]
        away, across = omega[n] * (w.mid[n] + w.rad[n]), omega[t] * (self._slope[nodes] * w.size[t])
        largest = away + across + 8 * UNIT * (omega[n] * (np.abs(w.mid[n]) + w.rad[n]) + across) + TINY
        named_open = all(self.selection[node] == OPEN for node in self.nodes[nodes])
        return named_open and bool(np.all(largest < 0))

    def _point(self, force: Array) -> Ball:
        """Forces in the cones, with the statuses of the selection, near the given ones."""
        p, system = self.system.p, self.system
        mid, rad = np.zeros(len(self.places)), np.zeros(len(self.places))
        for i, node in enumerate(self.nodes):
            code, t = self.selection[node], self.tangential[i]
            if code == OPEN:
                continue
            n = max(float(force[node]), 0.0)
            mid[i] = n
            if code in _SLIDING:
                continue
            if code == STICK:
                bound = max(system.F[node] - system.F_rad[node], 0.0) * n / SAFE
                mid[t] = min(max(float(force[p + node]), -bound), bound)
            elif code in (SLIP_PLUS, SLIP_MINUS):
                mid[t] = (1.0 if code == SLIP_PLUS else -1.0) * system.F[node] * n
                rad[t] = (system.F_rad[node] * n + 2 * UNIT * abs(mid[t])) * SAFE + TINY
        return Ball(mid, rad)

    def _distance(self, point: Array, w: Ball, omega: Array) -> float:
        """Bound of the numerator of theory, (6.10), for a point that is a solution with another h."""
        size, change = w.size, np.zeros(len(self.places))
        up, down = np.maximum(w.mid + w.rad, 0.0) * SAFE, np.maximum(w.rad - w.mid, 0.0) * SAFE
        for i, node in enumerate(self.nodes):
            code, t = self.selection[node], self.tangential[i]
            apart = code == OPEN or (code in _SLIDING and point[i] == 0)
            change[i] = up[i] if apart else size[i]
            if t >= 0:
                change[t] = {OPEN: 0.0, STICK: size[t], SLIP_PLUS: down[t], SLIP_MINUS: up[t]}[code]
        change = change * omega * SAFE + TINY
        rubbing = self.tangential >= 0
        return float((upper_norm(change) + upper_norm(self._slope[rubbing] * change[self.tangential[rubbing]])) * SAFE)

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
