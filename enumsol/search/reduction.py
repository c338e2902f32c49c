"""Forms that leave a subtree one solution, in floats: of nodes without a status, and at a known root.

The reduced problem of the nodes that have no status (theory, section 6.11), and the form that shows a known root to be
alone below an assignment (theory, section 6.13). Nothing here is trusted.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.balls import factor_above
from enumsol.model.statuses import CONTACT, FRICTIONLESS, OPEN, SLIP_MINUS, SLIP_PLUS, STICK
from enumsol.proof.leaves import Alone
from enumsol.proof.records import NOWHERE
from enumsol.search.definite import DEFINITE, AnalyticCentres, Descent, Nodes
from enumsol.support.deadlines import look
from enumsol.trusted.exclusion import Terms
from enumsol.trusted.selection import Selection, Unknowns
from enumsol.trusted.status_rows import refines, slip_directions
from enumsol.trusted.uniqueness import numbers_of

if TYPE_CHECKING:
    from enumsol.condensation.condensed import ScaledSystem
    from enumsol.relaxation.engine import Relaxation
    from enumsol.support.array_types import Codes, Floats, Indices, Mask

    #: lambda and w, (2p,) arrays each.
    Point = tuple[Floats, Floats]


#: A condition of a scaled problem within this of zero may hold as an equation; only the choice of what to try rests on
#: it.
NEAR = 1e-9
#: Steps of Newton's method for few nodes; one more for so many more of these; at most.
_NEWTON_STEPS, _NODES_A_STEP, _MOST_STEPS = 16, 4, 40


class WeightSource(enum.Enum):
    """Where numbers are sought: mu = kappa = 1 and nu = 0 only; near analytic centres besides; or by descent."""

    PLAIN = enum.auto()
    CENTRES = enum.auto()
    DESCENT = enum.auto()


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
        fixed = Selection([OPEN if i in chosen else code for i, code in enumerate(codes)])
        self.nodes = np.array(self.free, dtype=np.intp)
        slides = np.arange(len(self.nodes)) >= len(free)
        self.rubbing = (F[self.nodes] > 0) & ~slides
        directions = slip_directions([sliding.get(i, OPEN) for i in self.free])
        self._at = Unknowns(p, self.nodes, self.rubbing, directions)
        self.places, self.tangential = self._at.places, self._at.tangential
        self._friction, self._F = F[self.nodes], F[self.nodes[self.rubbing]]
        rows = fixed.unknown
        self.E = fixed.forces(np.eye(len(rows)), F)
        across = self._at.columns(S, F)
        self.M = M = S[rows] @ self.E
        self.sign = int(np.linalg.slogdet(M)[0])
        # a singular matrix is refused by whoever proves something of it
        self.Z = np.linalg.solve(M, np.column_stack([system.g[rows], across[rows]]))
        moved = S[self.places] @ self.E @ self.Z
        self.R, self.h = across[self.places] - moved[:, 1:], system.g[self.places] - moved[:, 0]

    @cached_property
    def sensitivity(self) -> float:
        """Largest change of a fixed node's force with a component of w."""
        return float(np.max(np.abs(np.linalg.inv(self.M)), initial=0.0))

    def forces(self, x: Floats) -> Floats:
        """lambda for the forces of the nodes that are free or slide."""
        force = np.asarray(self.E @ (self.Z[:, 0] - self.Z[:, 1:] @ x))
        self._at.put(x, self.system.F, force)
        return force

    def solution(self, near: tuple[Floats, Floats] | None) -> tuple[Floats, list[int]] | None:
        """Forces and statuses that solve the reduced problem up to NEAR, or None.

        By Newton's method from lambda and w; ``near`` None: from far away, along F from frictionless contact.
        """
        x = self._along_friction() if near is None else self._newton(near[0][self.places], near[1][self.places], 1.0)
        return None if x is None else (x, self._named(x))

    def _along_friction(self) -> Floats | None:
        """A solution with share F of the friction, the share going from 0 to 1."""
        x, share, step = np.zeros(len(self.places)), 0.0, 0.0
        while True:
            ahead = min(share + step, 1.0)
            found = self._newton(x, self.h - self.R @ x, ahead)
            if found is not None and ahead == 1.0:
                return found
            if found is not None:
                x, share, step = found, ahead, 1.5 * step if step else 0.25
            else:
                step *= 0.5
                # the least step
                if step < 1 / 64:
                    return None

    def _newton(self, x: Floats, v: Floats, share: float) -> Floats | None:
        """A solution with this share of the friction; steps are shortened once a set of statuses comes again."""
        seen, damped, residual = set[bytes](), False, np.inf
        for _ in range(min(_NEWTON_STEPS + len(self.free) // _NODES_A_STEP, _MOST_STEPS)):
            look()
            codes = self._statuses(x, v, share)
            damped = damped or codes.tobytes() in seen
            seen.add(codes.tobytes())
            ahead = self._selected(codes, share)
            if ahead is None:
                return None
            if damped:
                ahead = self._shortened(x, ahead, residual, share)
                if ahead is None:
                    return None
            x, v = ahead, self.h - self.R @ ahead
            residual = self._residual(x, v, share)
            if residual <= NEAR:
                return x
        return None

    def _shortened(self, x: Floats, ahead: Floats, residual: float, share: float) -> Floats | None:
        """A point on the way at which the residual is less."""
        part = 1.0
        # the least part of a step; the residual has to fall by a share of what a step promises
        while part >= 1 / 64:
            point = x + part * (ahead - x)
            if self._residual(point, self.h - self.R @ point, share) < (1.0 - 1e-4 * part) * residual:
                return point
            part *= 0.5
        return None

    def _statuses(self, x: Floats, v: Floats, share: float) -> Indices:
        """The statuses whose test functions are active at a point (theory, (1.7))."""
        m, t = len(self.free), self.tangential[self.rubbing]
        codes = np.where(x[:m] + v[:m] > 0, FRICTIONLESS, OPEN)
        loaded = codes[self.rubbing] != OPEN
        bound, reach = share * self._F * x[:m][self.rubbing], x[t] + v[t]
        slips = np.where(reach > bound, SLIP_PLUS, np.where(reach < -bound, SLIP_MINUS, STICK))
        codes[self.rubbing] = np.where(loaded, slips, OPEN)
        return codes

    def _selected(self, codes: Indices, share: float) -> Floats | None:
        """The forces of the reduced problem's selection; None where its matrix is singular."""
        closed, stuck = np.flatnonzero(codes != OPEN), self.tangential[codes == STICK]
        x, rows = np.zeros(len(self.places)), np.concatenate([closed, stuck])
        slips = np.flatnonzero((codes == SLIP_PLUS) | (codes == SLIP_MINUS))
        turn = np.where(codes == SLIP_PLUS, share, -share) * self._friction
        across = self.R[rows]
        M = across[:, rows]
        M[:, np.searchsorted(closed, slips)] += across[:, self.tangential[slips]] * turn[slips]
        try:
            x[rows] = np.linalg.solve(M, self.h[rows])
        except np.linalg.LinAlgError:
            return None
        x[self.tangential[slips]] = turn[slips] * x[slips]
        return x

    def _residual(self, x: Floats, v: Floats, share: float) -> float:
        """Largest error of a point: its conditions are min(lambda_n, -w_n) = 0, and of the slip likewise."""
        m, t = len(self.free), self.tangential[self.rubbing]
        bound = share * self._F * np.maximum(x[:m][self.rubbing], 0.0)
        apart = np.abs(np.minimum(x[:m], -v[:m])), np.abs(x[t] - np.clip(x[t] + v[t], -bound, bound))
        residual = float(max(np.max(part, initial=0.0) for part in apart))
        return residual if np.isfinite(residual) else np.inf

    def _named(self, x: Floats) -> list[int]:
        """The first status that holds up to NEAR: of those that do, one whose equations are regular with others'."""
        v, m, t = self.h - self.R @ x, len(self.free), self.tangential[self.rubbing]
        codes = np.full(m, FRICTIONLESS)
        codes[self.rubbing] = np.where(np.abs(v[t]) <= NEAR, STICK, np.where(v[t] > 0, SLIP_PLUS, SLIP_MINUS))
        codes[x[:m] <= NEAR] = OPEN
        return [int(code) for code in codes]

    # -- the test of definiteness ----------------------------------------------------------------------------------

    def weights(
        self, x: Floats, v: Floats, *, exactly: bool, sought: WeightSource = WeightSource.CENTRES
    ) -> Floats | None:
        """Numbers for which the form of theory, (6.9), is definite at a solution, as a proof has them, or None.

        Parameters
        ----------
        x, v : forces and displacements
        exactly : for a proof that knows the solution exactly
        sought : see ``weights_of``
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
        return weights_of(self.R, nodes, sought)

    def resting(self, x: Floats, v: Floats) -> Mask:
        """Nodes with friction, and free, that touch without load at a solution and do not slide."""
        n, t = np.arange(len(self.nodes)), self.tangential
        return np.asarray(self.rubbing & (x[n] <= NEAR) & (np.abs(v[n]) <= NEAR) & (np.abs(v[t]) <= NEAR))


def weights_of(R: Floats, nodes: Nodes, sought: WeightSource = WeightSource.CENTRES) -> Floats | None:
    """mu, kappa, nu, theta / F and tau for which (6.9) is definite, as a proof has them; None where none were found.

    Parameters
    ----------
    R : (k, k) array
    nodes : Nodes
    sought : where; analytic centres serve where the form has to serve any theta, and the others hardly or not at all

    Returns
    -------
    (count + 4 b,) array
    """
    b, F, share, n = len(nodes.F), nodes.F, nodes.first, nodes.normal
    T = F[:, None] * R[nodes.tangential]
    tau = np.where(nodes.wide, np.maximum(np.sqrt(np.sum(T * T, axis=1)), DEFINITE), 0.0)
    form = R.copy()
    form[n] -= share[:, None] * T
    wide = np.flatnonzero(nodes.wide)
    form -= 0.5 * (T[wide] / tau[wide, None]).T @ T[wide]
    form[n, n] -= 0.5 * tau
    try:
        # LAPACK may factorize what is not a number
        if np.all(np.isfinite(form)) and factor_above(0.5 * (form + form.T), DEFINITE) is not None:
            return np.concatenate([np.ones(nodes.count + b), np.zeros(b), share, tau])
        if sought is WeightSource.PLAIN:
            return None
        with np.errstate(all="ignore"):
            if sought is WeightSource.DESCENT and not len(wide):
                return Descent.of(R, nodes).numbers()
            return AnalyticCentres(R, nodes).numbers()
    except np.linalg.LinAlgError:
        return None


@dataclass(frozen=True)
class Proposal:
    """The only solution that a subtree may have, as far as floats tell.

    Attributes
    ----------
    selection : final codes, of a selection that holds there up to rounding
    sliding : FORWARD or BACKWARD for nodes that in the proof are open or slip that way
    free : ascending nodes that have no status in the proof
    force : (2p,) array, lambda
    weights : numbers for which the form of theory, (6.9), is definite, or None
    hopeless : nor would a proof in rationals find any, which frees no nodes and need not serve all theta of one
    strict : every status in the proof holds strictly
    least : least slack of the conditions of the fixed nodes
    reduction : Reduction
    """

    selection: Codes
    sliding: dict[int, int]
    free: tuple[int, ...]
    force: Floats
    weights: Floats | None
    hopeless: bool
    strict: bool
    least: float
    reduction: Reduction

    @property
    def numbers(self) -> list[float]:
        """The weights as a proof has them."""
        return [] if self.weights is None else self.weights.tolist()

    @property
    def named(self) -> Codes:
        """The selection with the codes of the sliding nodes."""
        return tuple(self.sliding.get(i, code) for i, code in enumerate(self.selection))


#: Strength of what vanishes: S has a diagonal near one.
_STIFF = 1e3
#: Of the strengths that are allowed: small forces are known to 1e-4 of their size. What is added to squares of gaps.
_MOST, _WIDER = 0.999, 1e-9
_TOUCHING = (STICK, SLIP_PLUS, SLIP_MINUS, FRICTIONLESS, CONTACT)


@dataclass(frozen=True)
class KnownRoot:
    """A root whose conditions hold strictly, as far as floats tell: its selection, lambda and w."""

    selection: Codes
    force: Floats
    w: Floats

    def below(self, codes: Codes) -> bool:
        """True if the root lies below an assignment."""
        return all(refines(mine, code) for mine, code in zip(self.selection, codes, strict=True))


class Lone:
    """The form of theory, (6.13), below an assignment at a known root, in floats.

    Parameters
    ----------
    system : ScaledSystem
    codes : of an assignment above the root
    known : KnownRoot
    relaxation : Relaxation
        Of that assignment; it bounds the gaps.
    """

    def __init__(self, system: ScaledSystem, codes: Codes, known: KnownRoot, relaxation: Relaxation) -> None:
        F, status = system.F, np.array(codes)
        self._system, self._known, self._relaxation = system, known, relaxation
        nodes, own = numbers_of(codes, (F > 0).tolist())
        self._nodes = nodes
        at = Unknowns(system.p, nodes, own, slip_directions(codes)[nodes])
        self.places = at.places
        self.R = at.columns(system.S[at.places], F)
        self.touching = np.isin(status[nodes], _TOUCHING)
        self.stuck = status[nodes[own]] == STICK
        self.nodes = self._at_root(nodes, at.normal)
        self.spare = self._spare()

    def _at_root(self, nodes: Indices, normal: Indices) -> Nodes:
        known, chosen = self._known, nodes[normal]
        (n, t), (w_n, slip) = (a.reshape(2, -1)[:, chosen] for a in (known.force, known.w))
        F, codes = self._system.F[chosen], np.array(known.selection)[chosen]
        share = np.where(codes == SLIP_PLUS, 1.0, np.where(codes == SLIP_MINUS, -1.0, np.nan))
        stick = codes == STICK
        share[stick] = np.clip(t[stick] / (F[stick] * n[stick]), -1.0, 1.0)
        tangential = len(nodes) + np.arange(len(normal))
        wide = np.zeros(len(normal), dtype=bool)
        return Nodes(len(nodes), normal, tangential, F, share, wide, np.where(codes == OPEN, -w_n, 0.0), slip)

    def _spare(self) -> Floats:
        """Strengths of squares that mu and nu of each node allow at most; zero where they need not allow any."""
        nodes, p, system, spare = self._nodes, self._system.p, self._system, np.zeros((2, len(self._nodes)))
        relaxation = self._relaxation
        if relaxation.form is not None:
            return spare
        reach = np.sqrt(max(-relaxation.bound, 0.0) + _WIDER)
        gaps = np.maximum(-relaxation.displacements[nodes], 0.0) + reach * np.sqrt(np.diagonal(system.S)[nodes])
        loaded = (np.array(self._known.selection)[nodes] != OPEN) & ~self.touching
        spare[0] = np.where(loaded, self._known.force[nodes] / gaps, 0.0)
        spare[1, self.nodes.normal] = np.where(loaded, self._known.force[p + nodes] / gaps, 0.0)[self.nodes.normal]
        return spare * _MOST

    def numbers(self, *, descent: bool) -> Floats | None:
        """mu, kappa, nu, theta / F and tau with which the form is definite, or None."""
        b, count = len(self.nodes.F), self.nodes.count
        share = self.nodes.first
        normal, tangential = self.R[:count], self.R[count:]
        # a product of a matrix with itself takes half of the time
        vanishing = self.R[np.concatenate([self.touching, self.stuck])]
        fixed = _STIFF * (vanishing.T @ vanishing)
        fixed[count:] += tangential
        fixed[self.nodes.normal] -= (share * self.nodes.F)[:, None] * tangential
        costs = np.sqrt(self.spare[0])[:, None] * normal
        by_mu = costs.T @ costs
        by_mu[:count] += normal
        # what loaded nodes lose by a gap grows with mu, the share of the slip falls
        for mu in (1.0, 3.0, 10.0):
            form = fixed + mu * by_mu
            if factor_above(0.5 * (form + form.T), DEFINITE) is not None:
                return np.concatenate([np.full(count, mu), np.ones(b), np.zeros(b), share, np.zeros(b)])
        if not descent:
            return None
        try:
            return Descent.of(self.R, self.nodes, self.spare).numbers()
        except np.linalg.LinAlgError:
            return None

    def proposal(self, *, descent: bool = False) -> Alone | None:
        """The record that may hold, without an enclosure and with all multipliers of the relaxation; or None."""
        numbers = self.numbers(descent=descent)
        if numbers is None:
            return None
        p, count, b = self._system.p, self.nodes.count, len(self.nodes.F)
        mu, nu = numbers[:count], np.zeros(count)
        nu[self.nodes.normal] = numbers[count + b : count + 2 * b]
        strengths = np.zeros((2, p))
        strengths[0, self._nodes] = np.where(self.touching, _STIFF, mu * self.spare[0] + nu * self.spare[1])
        strengths[1, self._nodes[self.nodes.normal[self.stuck]]] = _STIFF
        terms = Terms(*self._relaxation.multipliers())
        return Alone(self._known.selection, numbers[: count + 3 * b], NOWHERE, strengths, terms)
