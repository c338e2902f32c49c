"""Lookahead near the root of a long tree: the children of all undecided nodes are solved (theory, section 5.5).

A child costs almost half as much as a node of the tree, so this pays in long trees only, and near their roots. Nothing
that is proven depends on it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from enumsol.model.statuses import CONTACT, FRICTIONLESS, OPEN, UNDECIDED
from enumsol.relaxation.engine import PRUNE_MARGIN

if TYPE_CHECKING:
    from enumsol.relaxation.engine import Relaxation
    from enumsol.search.nodes import Relaxations
    from enumsol.support.array_types import Codes

#: A search begins again with lookahead after so many nodes; after fewer, trees do that are soon done.
NODES = 1000
#: Share of the tree below which it does, and decisions down to which it then looks ahead: with larger shares trees
#: begin again that are soon done, and deeper clips take twice as many nodes (studies/branching_rule).
_DEPTHS = ((5e-4, 12), (0.05, 6))
#: What is added to the shares, and the weight of three children beside two (studies/branching_rule).
_LEAST, _LATER = 1e-2, 0.05
#: Number of decisions that a status took; of the others two.
_DECISIONS = {UNDECIDED: 0, OPEN: 1, CONTACT: 1, FRICTIONLESS: 1}


class Lookahead:
    """The rule by which one search branches.

    Parameters
    ----------
    relaxations : Relaxations

    Attributes
    ----------
    depth : int
        Partial assignments with at most so many decisions are branched on by their solved children; -1: none.
    """

    def __init__(self, relaxations: Relaxations) -> None:
        self._relaxations = relaxations
        self.depth = -1

    @property
    def pays(self) -> bool:
        """True if it may pay: relaxations do not solve the children of all nodes anyway, as those of 3D do."""
        return not self._relaxations.engine.solves_children

    def begins(self, nodes: int, covered: float) -> bool:
        """True if a search that has done such a share of the tree had better look ahead; it does from then on."""
        if self.pays and nodes >= NODES:
            self.depth = next((depth for share, depth in _DEPTHS if covered < share), -1)
        return self.depth >= 0

    def choose(self, codes: Codes, relaxation: Relaxation) -> int:
        """The contact node to branch on, -1 when all are decided."""
        node = self._best(codes, relaxation) if _decisions(codes) <= self.depth else -1
        return relaxation.choose(codes) if node < 0 else node

    def _best(self, codes: Codes, relaxation: Relaxation) -> int:
        """The undecided node with the largest product of the shares of the gap that its children close, as in (5.7)."""
        best, most = -1, 0.0
        for node, code in enumerate(codes):
            if code not in (UNDECIDED, CONTACT):
                continue
            children = self._relaxations.splitting.children(codes, node, relaxation)
            open_, worth = 0, _LATER if len(children) > 2 else 1.0
            for child in children:
                share = self._share(node, child, relaxation)
                open_, worth = open_ + (share < 1.0), worth * (share + _LEAST)
                if worth <= most:
                    break  # the shares of the others are at most 1
            else:
                if open_ <= 1:
                    return node
                best, most = node, worth
        return best

    def _share(self, node: int, code: int, relaxation: Relaxation) -> float:
        """The share of the gap to pruning that a child closes."""
        child = relaxation.child(*self._relaxations.rows.of(node, code), last=False)
        if child.pruned or child.stalled:
            return float(child.pruned)
        gap = max(PRUNE_MARGIN - relaxation.bound, 1e-300)
        return min(max((child.bound - relaxation.bound) / gap, 0.0), 1.0)

    def learn(self, codes: Codes, node: int) -> bool:
        """Take the rule of an earlier search from how it branched there; False once its rule is known.

        Of a search that looked ahead all its first branchings tell that, down to the depth to which it did.
        """
        decisions = _decisions(codes)
        depth = next((depth for _, depth in reversed(_DEPTHS) if decisions <= depth), -1)
        relaxation = None if depth < 0 else self._relaxations.energy(codes)
        if relaxation is None:
            return False
        if relaxation.forced(codes) or (plain := relaxation.choose(codes)) == (ahead := self._best(codes, relaxation)):
            return True
        if node == ahead:
            self.depth = depth
        return node not in (plain, ahead) or node == ahead


def _decisions(codes: Codes) -> int:
    return sum(_DECISIONS.get(code, 2) for code in codes)
