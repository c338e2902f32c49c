"""Rules that choose the contact node to branch on: the package's with other numbers of candidates, and two more.

full lookahead
    The children's programs of the first candidates are solved; the solutions of the chosen one are kept.
pseudo-costs
    The mean gain of earlier branchings of the same node into the same status, once each of its children has been seen
    often enough; until then full lookahead.

The measure by which a candidate is chosen is the same for all.
"""

from __future__ import annotations

import math
from collections import defaultdict
from functools import partial

import numpy as np

from enumsol.model.statuses import CONTACT, OPEN, SLIP_MINUS, SLIP_PLUS, STICK, UNDECIDED
from enumsol.relaxation.active_set import ActiveSetEngine
from enumsol.relaxation.engine import BRANCHING_CANDIDATES, PRUNE_MARGIN, status_rows

#: Part of the gap below which a child's gain makes no difference, and the weight of nodes with three children: those of
#: the package's rule.
LEAST, LATER = 1e-3, 0.05


class Lookahead(ActiveSetEngine):
    """Branches on the candidate whose children's solved programs, or means of earlier ones, close most of the gap.

    Parameters
    ----------
    system : ScaledSystem
    looked_at : int
        How many nodes are looked at, those with the largest violation.
    trust : float
        How often each child of a node must have been seen before the means are taken for it.
    """

    def __init__(self, system, looked_at, trust=math.inf):
        super().__init__(system)
        self.F, self.looked_at, self.trust = system.F, looked_at, trust
        self.solved = 0
        self.seen = defaultdict(lambda: [0, 0.0])  # row numbers of a child -> how often, and the sum of its shares

    def root(self, rows, modes):
        """The relaxation with the given rows on."""
        self.solved += 1
        return Looking(self, super().root(rows, modes))


class Looking:
    """A relaxation of the package with another choice; children solved for the choice are kept."""

    def __init__(self, engine, inner):
        self._engine, self._inner, self._ready = engine, inner, {}

    def __getattr__(self, name):
        return getattr(self._inner, name)

    def child(self, rows, modes, *, last):
        """The relaxation with further rows switched on."""
        key = (*rows, *modes)
        if key in self._ready:
            return self._ready.pop(key)
        engine, before = self._engine, self.bound
        engine.solved += 1
        answer = Looking(engine, self._inner.child(rows, modes, last=last))
        seen = engine.seen[key]
        seen[0] += 1
        seen[1] += closed(answer, before)
        return answer

    def choose(self, codes):
        """The contact node to branch on, -1 when all are decided."""
        best, chosen = -1.0, (-1, {})
        for node, violation in self._candidates(np.array(codes)):
            shares, solved = self._shares(node, codes[node])
            if solved and sum(share >= 1.0 for share in shares) >= len(shares) - 1:
                chosen = node, solved
                break
            value = measure(shares) * max(violation, 1e-12)
            if value > best:
                best, chosen = value, (node, solved)
        self._ready = chosen[1]
        return chosen[0]

    def _candidates(self, codes):
        """The undecided nodes that violate complementarity most, with their violation (as the package measures it)."""
        F, force, w, p = self._engine.F, self.forces, self.displacements, len(codes)
        slip = F * force[:p] * np.abs(w[p:]) - force[p:] * w[p:]
        violation = np.where(codes == UNDECIDED, slip - force[:p] * w[:p], 0.0) + slip
        nodes = np.flatnonzero(codes >= CONTACT)
        nodes = nodes[np.argsort(-violation[nodes], kind="stable")][: self._engine.looked_at]
        return [(int(i), float(violation[i])) for i in nodes]

    def _shares(self, node, code):
        """What each child closes of the gap, and the children's relaxations as far as they had to be solved."""
        codes = (OPEN, CONTACT) if code == UNDECIDED else (STICK, SLIP_PLUS, SLIP_MINUS)
        keys = [self._key(node, child) for child in codes]
        seen = [self._engine.seen[key] for key in keys]
        if min(count for count, _ in seen) >= self._engine.trust:
            return [total / count for count, total in seen], {}
        half = [len(key) // 2 for key in keys]
        solved = {key: self.child(list(key[:n]), list(key[n:]), last=False) for key, n in zip(keys, half, strict=True)}
        return [closed(answer, self.bound) for answer in solved.values()], solved

    def _key(self, node, code):
        rows = status_rows(code, friction=True)
        return (*(kind * len(self._engine.F) + node for kind, _ in rows), *(mode for _, mode in rows))


def closed(relaxation, before):
    """Part of the gap between the parent's bound and pruning that a child closes."""
    if relaxation.pruned or relaxation.stalled:
        return float(relaxation.pruned)
    return min(1.0, max(0.0, relaxation.bound - before) / max(PRUNE_MARGIN - before, 1e-300))


def measure(shares):
    """The measure of the package's rule: the product of the shares, less for three of them."""
    return (LATER if len(shares) > 2 else 1.0) * math.prod(share + LEAST for share in shares)


BASE = "largest violation"
#: Number of candidates whose children are bounded by one step of the dual method -> name of the rule.
ONE_STEP = {k: f"one step, {k}" for k in (4, 8, 16, 24, 40)} | {10**4: "one step, all"}
#: The package's own.
TAKEN = ONE_STEP[BRANCHING_CANDIDATES]
#: Rule -> what makes its engine for a system.
RULES = {
    BASE: partial(ActiveSetEngine, candidates=1),
    **{name: partial(ActiveSetEngine, candidates=k) for k, name in ONE_STEP.items()},
    "full lookahead, 4": partial(Lookahead, looked_at=4),
    "full lookahead, 12": partial(Lookahead, looked_at=12),
    "pseudo-costs after 1": partial(Lookahead, looked_at=12, trust=1),
    "pseudo-costs after 4": partial(Lookahead, looked_at=12, trust=4),
}
