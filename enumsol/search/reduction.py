"""The reduced problem of the nodes that have no status, in floats (theory, section 6.11); nothing here is trusted."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from enumsol.search.definite import Nodes, weights_of
from enumsol.statuses import BACKWARD, FORWARD, FRICTIONLESS, OPEN, SLIP_MINUS, SLIP_PLUS, STICK

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from enumsol.condensation.condensed import ScaledSystem
    from enumsol.selections.solution import Codes

    Array = NDArray[np.float64]

#: A condition of a scaled problem within this of zero may hold as an equation; only the choice of what to try rests on
#: it.
NEAR = 1e-9
_NEWTON_STEPS = 16


class Reduction:
    """The reduced problem of the nodes that are not fixed, w = h - R x, in floats.

    Parameters
    ----------
    system : ScaledSystem
    codes : status codes; nodes with a final one that are neither free nor slide are fixed
    free : ascending nodes
    sliding : FORWARD or BACKWARD for other nodes
    """

    def __init__(self, system: ScaledSystem, codes: Codes, free: tuple[int, ...], sliding: dict[int, int]) -> None:
        p, S, F = system.p, system.S, system.F
        self.system, self.free = system, (*free, *sorted(sliding))
        chosen = set(self.free)
        fixed = [i for i in range(p) if i not in chosen and codes[i] != OPEN]
        stuck = [i for i in fixed if codes[i] == STICK]
        self.nodes = np.array(self.free, dtype=np.intp)
        self.slides = np.arange(len(self.nodes)) >= len(free)
        self.rubbing = (F[self.nodes] > 0) & ~self.slides
        self.places = np.concatenate([self.nodes, p + self.nodes[self.rubbing]])
        self.tangential = np.where(self.rubbing, len(self.free) + np.cumsum(self.rubbing) - 1, -1)
        self.turn = np.array([(sliding.get(i, 0) == FORWARD) - (sliding.get(i, 0) == BACKWARD) for i in self.free])
        self.turn = self.turn * F[self.nodes]
        rows = np.array(fixed + [p + i for i in stuck], dtype=np.intp)
        self.E = np.zeros((2 * p, len(rows)))
        for k, i in enumerate(fixed):
            self.E[i, k] = 1.0
            if codes[i] in (SLIP_PLUS, SLIP_MINUS):
                self.E[p + i, k] = F[i] if codes[i] == SLIP_PLUS else -F[i]
        for k, i in enumerate(stuck, start=len(fixed)):
            self.E[p + i, k] = 1.0
        across = S[:, self.places]
        across[:, : len(self.free)] += S[:, p + self.nodes] * self.turn
        self.M = M = S[rows] @ self.E
        self.sign = int(np.linalg.slogdet(M)[0])
        # a singular matrix is refused by whoever proves something of it
        self.Z = np.linalg.solve(M, np.column_stack([system.g[rows], across[rows]]))
        moved = S[self.places] @ self.E @ self.Z
        self.R, self.h = across[self.places] - moved[:, 1:], system.g[self.places] - moved[:, 0]

    @cached_property
    def sensitivity(self) -> float:
        """How much a fixed node's force changes at most with a component of w."""
        return float(np.max(np.abs(np.linalg.inv(self.M)), initial=0.0))

    def forces(self, x: Array) -> Array:
        """lambda for the forces of the nodes that are free or slide."""
        force = np.asarray(self.E @ (self.Z[:, 0] - self.Z[:, 1:] @ x))
        force[self.places] = x
        turned = self.turn != 0
        force[self.system.p + self.nodes[turned]] = (self.turn * x[: len(self.free)])[turned]
        return force

    def solution(self, force: Array, w: Array) -> tuple[Array, list[int]] | None:
        """Forces and statuses that solve the reduced problem up to NEAR, by Newton's method; None if there are none."""
        x, v = force[self.places], w[self.places]
        for _ in range(_NEWTON_STEPS):
            codes = [self._status(i, x, v) for i in range(len(self.free))]
            x = self._selected(codes)
            if x is None:
                return None
            v = self.h - self.R @ x
            if self._solves(x, v):
                return x, [self._named(i, x, v) for i in range(len(self.free))]
        return None

    def _status(self, i: int, x: Array, v: Array) -> int:
        """The status whose test functions are active at a point (theory, (1.7))."""
        if x[i] + v[i] <= 0:
            return OPEN
        t = self.tangential[i]
        if t < 0:
            return FRICTIONLESS
        bound = self.system.F[self.free[i]] * x[i]
        if x[t] + v[t] > bound:
            return SLIP_PLUS
        return SLIP_MINUS if x[t] + v[t] < -bound else STICK

    def _selected(self, codes: list[int]) -> Array | None:
        """The forces of the reduced problem's selection; None where its matrix is singular."""
        F, rows, columns = self.system.F, [], []
        for i, code in enumerate(codes):
            if code == OPEN:
                continue
            column = np.zeros(len(self.places))
            column[i] = 1.0
            if code in (SLIP_PLUS, SLIP_MINUS):
                column[self.tangential[i]] = F[self.free[i]] * (1 if code == SLIP_PLUS else -1)
            rows.append(i)
            columns.append(column)
            if code == STICK:
                rows.append(int(self.tangential[i]))
                columns.append(np.eye(len(self.places))[rows[-1]])
        if not rows:
            return np.zeros(len(self.places))
        E = np.column_stack(columns)
        try:
            return np.asarray(E @ np.linalg.solve(self.R[rows] @ E, self.h[rows]))
        except np.linalg.LinAlgError:
            return None

    def _solves(self, x: Array, v: Array) -> bool:
        m, t = len(self.free), self.tangential
        if np.min(x[:m], initial=0.0) < -NEAR or np.max(v[:m], initial=0.0) > NEAR:
            return False
        sliding = t >= 0
        bound = self.system.F[self.nodes][sliding] * x[:m][sliding]
        xt, vt = x[t[sliding]], v[t[sliding]]
        apart = np.minimum(np.abs(xt - np.sign(vt) * bound), np.abs(vt))
        return bool(
            np.all(np.minimum(x[:m], -v[:m]) <= NEAR)
            and np.all(np.abs(xt) <= bound + NEAR)
            and np.max(apart, initial=0.0) <= NEAR
        )

    def _named(self, i: int, x: Array, v: Array) -> int:
        """The first status that holds up to NEAR: of those that do, one whose equations are regular with others'."""
        if x[i] <= NEAR:
            return OPEN
        t = self.tangential[i]
        if t < 0:
            return FRICTIONLESS
        if abs(v[t]) <= NEAR:
            return STICK
        return SLIP_PLUS if v[t] > 0 else SLIP_MINUS

    # -- the test of definiteness ----------------------------------------------------------------------------------

    def weights(self, x: Array, v: Array, *, exactly: bool, factors: bool) -> Array | None:
        """Numbers for which the form of theory, (6.9), is definite at a solution, as a proof has them, or None.

        Parameters
        ----------
        x, v : forces and displacements
        exactly : for a proof that knows the solution exactly
        factors : see ``weights_of``
        """
        if not len(self.places):
            return np.zeros(0)
        normal = np.flatnonzero(self.rubbing)
        tangential, F = self.tangential[normal], self.system.F[self.nodes[normal]]
        n, t, gap, slip = x[normal], x[tangential], -v[normal], v[tangential]
        slip = np.where(np.abs(slip) > NEAR, slip, 0.0)
        share = np.where(slip != 0, np.sign(slip), np.clip(t / np.where(n > NEAR, F * n, 1.0), -1.0, 1.0))
        share = np.where((n <= NEAR) & ((gap > NEAR) | (slip == 0)), np.nan, share)
        wide = self.resting(x, v)[normal] & (not exactly)
        nodes = Nodes(len(self.nodes), normal, tangential, F, share, wide, np.where(gap > NEAR, gap, 0.0), slip)
        return weights_of(self.R, nodes, factors=factors)

    def resting(self, x: Array, v: Array) -> NDArray[np.bool_]:
        """Nodes with friction, and free, that touch without load at a solution and do not slide."""
        n, t = np.arange(len(self.nodes)), self.tangential
        return np.asarray(self.rubbing & (x[n] <= NEAR) & (np.abs(v[n]) <= NEAR) & (np.abs(v[t]) <= NEAR))
