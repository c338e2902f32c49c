"""Proposals to show that a root is alone below an assignment (theory, section 6.13); nothing here is trusted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.balls import factor_above
from enumsol.model.statuses import CONTACT, FRICTIONLESS, OPEN, SLIP_MINUS, SLIP_PLUS, STICK
from enumsol.search.definite import DEFINITE, Descent, Nodes
from enumsol.trusted.selection import Unknowns
from enumsol.trusted.status_rows import refines, slip_directions
from enumsol.trusted.uniqueness import numbers_of

if TYPE_CHECKING:
    from enumsol.condensation.condensed import ScaledSystem
    from enumsol.relaxation.engine import Relaxation
    from enumsol.support.array_types import Codes, Floats, Indices


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


@dataclass(frozen=True)
class LoneProposal:
    """The selection of a known root, and the numbers and strengths that may prove it alone."""

    selection: Codes
    weights: Floats
    strengths: Floats


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
        self._system, self._known = system, known
        nodes, own = numbers_of(codes, (F > 0).tolist())
        self._nodes = nodes
        at = Unknowns(system.p, nodes, own, slip_directions(codes)[nodes])
        self.places = at.places
        self.R = at.columns(system.S[at.places], F)
        self.touching = np.isin(status[nodes], _TOUCHING)
        self.stuck = status[nodes[own]] == STICK
        self.nodes = self._at_root(nodes, at.normal)
        self.spare = self._spare(relaxation)

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

    def _spare(self, relaxation: Relaxation) -> Floats:
        """Strengths of squares that mu and nu of each node allow at most; zero where they need not allow any."""
        nodes, p, system, spare = self._nodes, self._system.p, self._system, np.zeros((2, len(self._nodes)))
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

    def proposal(self, *, descent: bool = False) -> LoneProposal | None:
        """Proposal that may be proven, or None."""
        numbers = self.numbers(descent=descent)
        if numbers is None:
            return None
        p, count, b = self._system.p, self.nodes.count, len(self.nodes.F)
        mu, nu = numbers[:count], np.zeros(count)
        nu[self.nodes.normal] = numbers[count + b : count + 2 * b]
        strengths = np.zeros((2, p))
        strengths[0, self._nodes] = np.where(self.touching, _STIFF, mu * self.spare[0] + nu * self.spare[1])
        strengths[1, self._nodes[self.nodes.normal[self.stuck]]] = _STIFF
        return LoneProposal(self._known.selection, numbers[: count + 3 * b], strengths)
