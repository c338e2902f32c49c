"""When a subtree may be closed by its only possible solution, and what is proposed for it (theory, section 6.11).

Nothing here is trusted: the certifier proves what is proposed, or the subtree is branched on.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from enumsol.selections.solution import SelectionSolution
from enumsol.statuses import (
    BACKWARD,
    CONTACT,
    FORWARD,
    FRICTIONLESS,
    OPEN,
    SLIDING,
    SLIP_MINUS,
    SLIP_PLUS,
    STICK,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from enumsol.condensation.condensed import ScaledSystem
    from enumsol.relaxation.engine import Relaxation
    from enumsol.selections.solution import ActiveSets, Codes

    Array = NDArray[np.float64]

#: A condition of a scaled problem within this of zero may hold as an equation; only the choice of what to try rests on
#: it.
NEAR = 1e-9
#: Smallest eigenvalue below which a form counts as not definite.
_DEFINITE = 1e-10
_NEWTON_STEPS, _WEIGHT_STEPS = 16, 6
#: So many nodes that slide without load make a search begin again.
_MANY = 3


@dataclass(frozen=True)
class Proposal:
    """The only solution that a subtree may have, as far as floats tell.

    Attributes
    ----------
    selection : final codes, of a selection that holds there up to rounding
    sliding : FORWARD or BACKWARD for nodes that in the proof are open or slip that way
    free : ascending nodes that have no status in the proof
    force : (2p,) array, lambda
    tau : one number a free node for the test of definiteness; 0 where a node need not be in it
    strict : every status in the proof holds strictly
    least : least slack of the conditions of the fixed nodes
    sign : of the determinant of the fixed nodes' equations
    """

    selection: Codes
    sliding: dict[int, int]
    free: tuple[int, ...]
    force: Array
    tau: Array
    strict: bool
    least: float
    sign: int

    @property
    def named(self) -> Codes:
        """The selection with the codes of the sliding nodes."""
        return tuple(self.sliding.get(i, code) for i, code in enumerate(self.selection))


class Closing(Protocol):
    """A certifier that can close a subtree.

    Attributes
    ----------
    hard : bool
        A complete selection was met that is degenerate, or nearly so.
    sliding : dict
        FORWARD or BACKWARD for nodes that touch without load and slide at a solution met.
    """

    hard: bool
    sliding: dict[int, int]

    def closed(self, codes: Codes, relaxation: Relaxation | None) -> list[SelectionSolution] | None:
        """The solutions below a partial assignment, none or one, if it can hold one only; None if not proven."""


class Closer:
    """Which nodes of the tree are worth a try: all where tries succeed, fewer and fewer where they fail.

    Parameters
    ----------
    certifier : Closing
    """

    def __init__(self, certifier: Closing) -> None:
        self._certifier = certifier
        self._alert = self._began_again = False
        self._wait = self._pause = 0

    def begins_again(self) -> bool:
        """Whether so much has become known that a search had better begin again; once at most."""
        if self._began_again or len(self._certifier.sliding) < _MANY:
            return False
        self._began_again = True
        self._wait = self._pause = 0
        return True

    def met(self, answer: object) -> None:
        """Take note of what a complete selection holds: a degenerate solution makes every node worth a try."""
        strict = answer is None or (isinstance(answer, SelectionSolution) and answer.strict)
        self._alert = self._alert or not strict or self._certifier.hard

    def again(self, codes: Codes, relaxation: Relaxation | None) -> list[SelectionSolution] | None:
        """The solutions of a subtree that was closed in an earlier search."""
        return self._certifier.closed(codes, relaxation)

    def closed(self, codes: Codes, relaxation: Relaxation | None) -> list[SelectionSolution] | None:
        """The solutions of a subtree that can be closed, None where it has to be searched."""
        # at a solution without slip the energy is zero, and that is its minimum
        alert = self._alert or bool(self._certifier.sliding)
        if not alert and (relaxation is None or abs(relaxation.bound) > NEAR):
            return None
        if max(codes) < CONTACT or not (alert or _touches(codes, relaxation)):
            return None
        if self._wait > 0:
            self._wait -= 1
            return None
        found = self._certifier.closed(codes, relaxation)
        self._pause = 2 * self._pause + 1 if found is None else 0
        self._wait = self._pause
        return found


def _touches(codes: Codes, relaxation: Relaxation | None) -> bool:
    """Whether undecided nodes touch without load at the minimiser."""
    if relaxation is None:
        return False
    p = len(codes)
    forces, w = relaxation.forces[:p], relaxation.displacements[:p]
    return any(code >= CONTACT and forces[i] <= NEAR and w[i] >= -NEAR for i, code in enumerate(codes))


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
        slides = np.arange(len(self.nodes)) >= len(free)
        self.rubbing = (F[self.nodes] > 0) & ~slides
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
        M = S[rows] @ self.E
        self.sign = int(np.linalg.slogdet(M)[0])
        # a singular matrix is refused by whoever proves something of it
        self.Z = np.linalg.solve(M, np.column_stack([system.g[rows], across[rows]]))
        moved = S[self.places] @ self.E @ self.Z
        self.R, self.h = across[self.places] - moved[:, 1:], system.g[self.places] - moved[:, 0]

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

    def weights(self, counted: NDArray[np.bool_]) -> Array | None:
        """tau for which Q of theory, (6.9), is definite, 0 at nodes that do not count; None if none was found."""
        m = len(self.places)
        symmetric = 0.5 * (self.R + self.R.T)
        if not m:
            return np.zeros(0)
        used = np.flatnonzero(counted & self.rubbing)
        F, T = self.system.F[self.nodes[used]], self.R[self.tangential[used]]
        tau = F * np.sqrt(np.sum(T * T, axis=1) / 1.0)
        for _ in range(_WEIGHT_STEPS):
            form = symmetric - 0.5 * (T * (F**2 / tau)[:, None]).T @ T
            form[used, used] -= 0.5 * tau
            values, vectors = np.linalg.eigh(form)
            if values[0] > _DEFINITE:
                result = np.zeros(len(self.free))
                result[used] = tau
                return result
            if not len(used):
                break
            v = vectors[:, 0]
            # where the smallest eigenvalue is largest, both terms of a node are the same there
            better = F * np.abs(T @ v) / np.maximum(np.abs(v[used]), 1e-12)
            tau = np.sqrt(tau * np.clip(better, tau / 16, tau * 16))
        return None


def holds_below(codes: Codes, active: ActiveSets) -> bool:
    """Whether a solution lies below an assignment: at every node a final code holds that refines its code."""
    return all(
        bool(held - {OPEN}) if code == CONTACT else bool(held) if code > FRICTIONLESS else code in held
        for code, held in zip(codes, active, strict=True)
    )


def start(system: ScaledSystem, relaxation: Relaxation | None) -> tuple[Array, Array]:
    """lambda and w from which the solution of a reduced problem is sought."""
    if relaxation is None:
        return np.zeros(2 * system.p), system.g
    return relaxation.forces, relaxation.displacements


def propose(
    system: ScaledSystem, codes: Codes, force: Array, w: Array, *, exactly: bool, sides: bool = True
) -> Proposal | None:
    """What may close a subtree, or None.

    Parameters
    ----------
    system : ScaledSystem
    codes : of the subtree
    force, w : (2p,) arrays, lambda and w near its solution
    exactly : for a proof in rationals, in which statuses need not hold strictly; otherwise nodes whose status does not
        hold strictly are freed, or slide
    sides : nodes that are open or slip in one direction slide; otherwise they are free
    """
    free = tuple(i for i, code in enumerate(codes) if code not in _FINAL and (code not in SLIDING or not sides))
    sliding = {} if not sides else {i: code for i, code in enumerate(codes) if code in SLIDING}
    for _ in range(2):
        try:
            reduction = Reduction(system, codes, free, sliding)
        except np.linalg.LinAlgError:
            return None
        found = reduction.solution(force, w)
        if found is None:
            return None
        force = reduction.forces(found[0])
        w = system.g - system.S @ force
        selection = list(codes)
        for i, code in zip(reduction.free, found[1], strict=True):
            selection[i] = code
            if i in sliding and code == FRICTIONLESS:
                selection[i] = SLIDING[sliding[i]][1]
        slack = _slack(system, selection, force, w)
        fixed = np.array([i for i in range(system.p) if i not in set(reduction.free)], dtype=np.intp)
        loose = [int(i) for i in fixed if abs(slack[i]) <= NEAR]
        if exactly or not loose or np.min(slack[fixed]) < -NEAR:
            break
        resting = without_load(system, force, w)
        sliding |= {i: resting[i] for i in loose if codes[i] in SLIDING.get(resting.get(i, 0), ())}
        free = tuple(sorted({*free, *loose} - sliding.keys()))
    tau = reduction.weights(_counted(reduction, selection, force, w, exactly=exactly))
    if tau is None:
        return None
    least = float(np.min(slack[fixed], initial=np.inf))
    strict = bool(np.all(np.abs(slack) > NEAR))
    return Proposal(tuple(selection), sliding, free, force, tau[: len(free)], strict, least, reduction.sign)


def without_load(system: ScaledSystem, force: Array, w: Array) -> dict[int, int]:
    """FORWARD or BACKWARD for the nodes with friction that touch without load and slide."""
    p = system.p
    rests = (np.abs(force[:p]) <= NEAR) & (np.abs(w[:p]) <= NEAR) & (np.abs(w[p:]) > NEAR) & (system.F > 0)
    return {int(i): FORWARD if w[p + i] > 0 else BACKWARD for i in np.flatnonzero(rests)}


_FINAL = (OPEN, STICK, SLIP_PLUS, SLIP_MINUS, FRICTIONLESS)


def _slack(system: ScaledSystem, selection: list[int], force: Array, w: Array) -> Array:
    """Every node's least slack of the conditions of its status."""
    p = system.p
    n, t, u, v = force[:p], force[p:], -w[:p], w[p:]
    cone = system.F * n - np.abs(t)
    slack = {OPEN: u, STICK: cone, SLIP_PLUS: np.minimum(n, v), SLIP_MINUS: np.minimum(n, -v), FRICTIONLESS: n}
    return np.array([slack[code][i] for i, code in enumerate(selection)])


def _counted(reduction: Reduction, selection: list[int], force: Array, w: Array, *, exactly: bool) -> NDArray[np.bool_]:
    """Free nodes that the test of definiteness has to count (theory, (6.9))."""
    p, nodes = reduction.system.p, reduction.nodes
    apart = w[nodes] + reduction.system.F[nodes] * np.abs(w[p + nodes])
    resting = np.array([selection[i] == OPEN for i in nodes], dtype=bool)
    if not exactly:
        return ~(resting & (apart < -NEAR))
    held = (np.abs(w[nodes]) <= NEAR) & (np.abs(w[p + nodes]) <= NEAR) & (np.abs(force[p + nodes]) <= NEAR)
    return ~((resting & (apart <= NEAR)) | held)
