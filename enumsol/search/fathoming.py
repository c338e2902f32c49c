"""When a subtree may be closed by its only possible solution, and what is proposed for it (theory, section 6.11).

Nothing here is trusted: the certifier proves what is proposed, or the subtree is branched on.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from enumsol.model.statuses import (
    BACKWARD,
    CONTACT,
    FORWARD,
    FRICTIONLESS,
    OPEN,
    SLIDING,
    SLIP_MINUS,
    SLIP_PLUS,
    STICK,
    UNDECIDED,
)
from enumsol.search.nodes import TreeCloser
from enumsol.search.reduction import NEAR, KnownRoot, Lone, Proposal, Reduction, WeightSource
from enumsol.selections.solution import ActiveSets, SelectionSolution

if TYPE_CHECKING:
    from enumsol.condensation.condensed import ScaledSystem
    from enumsol.relaxation.engine import Relaxation
    from enumsol.search.certifiers.protocol import Certifier
    from enumsol.search.reduction import Point
    from enumsol.support.array_types import Codes, Floats

#: So many nodes that slide without load make a search begin again.
_MANY = 3
#: With fewer contact nodes other numbers than plain ones are sought only once the tree has so many nodes.
_FEW, _LONG = 48, 512


class Closer(TreeCloser):
    """Tries to close nodes of the tree: all where tries succeed, fewer and fewer where they fail.

    The whole problem comes first, before there is a tree. Where plain numbers fail and nodes are few, numbers are
    sought only when the tree has turned out to be long: that costs as much as many of its nodes.

    Parameters
    ----------
    system : ScaledSystem
    certifier : Certifier
    """

    def __init__(self, system: ScaledSystem, certifier: Certifier) -> None:
        super().__init__()
        self._system, self._certifier, self.sliding = system, certifier, certifier.sliding
        self._alert = self._began_again = False
        self._touching = 0
        self._wait = self._pause = 0
        #: Tries of the whole problem that are left, by the number of nodes after which they are due.
        self._tries = [(0, WeightSource.DESCENT)]
        if certifier.plain or system.p < _FEW:
            self._tries = [(0, WeightSource.PLAIN), (_LONG, WeightSource.DESCENT)][: 1 if certifier.plain else 2]
        self._whole: Proposal | None = None
        #: The regular solution that was found for the whole problem, and the same where it is worth a try in the tree.
        self._regular: KnownRoot | None = None
        self.known: KnownRoot | None = None
        self._told, self._bound = 1, 0.0

    def whole(self) -> list[SelectionSolution] | None:
        """All solutions of the problem, if one certificate proves that there is one only."""
        codes, lone = (UNDECIDED,) * self._system.p, self._certifier.lone and self._system.p >= _FEW
        proposal, self._whole = self._whole, None
        if proposal is None and self._due(0):
            sought = self._tries.pop(0)[1]
            # a regular solution is tried with the same numbers below, and what is left out of the form besides
            proposal = self._proposed(WeightSource.PLAIN if lone else sought)
            if proposal is not None and proposal.weights is None and lone and self._regular is None:
                proposal = self._proposed(sought)
        found = None
        if proposal is not None and proposal.weights is not None:
            found = self._certifier.closed(codes, proposal, self._near(proposal))
        if found is None and lone and self._regular is not None:
            found = self._alone(codes, self._regular, self.relaxed(codes), descent=True)
        return found

    def begins_again(self, nodes: int) -> bool:
        """True if so much has become known after some nodes that a search had better begin again."""
        # a try costs as much as some nodes: short trees are none the better for it
        if nodes >= 256 and self._system.p >= _FEW:
            self.known = self._regular
        if self._due(nodes):
            self._whole = self._proposed(self._tries.pop(0)[1])
            if self._whole is not None and self._whole.weights is not None:
                return True
        if self._began_again or (self._touching < _MANY and len(self._certifier.sliding) < _MANY):
            return False
        self._began_again = True
        self._wait = self._pause = 0
        return True

    def _due(self, nodes: int) -> bool:
        return bool(self._tries) and nodes >= self._tries[0][0]

    def _proposed(self, sought: WeightSource) -> Proposal | None:
        """Proposal of the only solution of the whole problem; takes note of where it is degenerate."""
        system, p = self._system, self._system.p
        codes, exactly = (UNDECIDED,) * p, self._certifier.exactly
        none: Floats = np.zeros(2 * p)
        # blocks with many nodes mostly stick: one to 16 steps from w = 0, where a third of the tries from w = g fail
        stuck = np.asarray(np.linalg.solve(system.S, system.g), dtype=np.float64)
        near: Point = (none, system.g) if p < _FEW else (stuck, none)
        proposal = propose(system, codes, near, exactly=exactly, sought=sought)
        # with many contact nodes the solution is sought along a path, too
        if proposal is None and (p >= 24 or sought is WeightSource.DESCENT):
            proposal = propose(system, codes, None, exactly=exactly, sought=sought)
        if proposal is None:
            return None
        force, w = self._near(proposal)
        self._regular = KnownRoot(proposal.selection, force, w) if proposal.strict and self._certifier.lone else None
        self._touching = int(np.count_nonzero((np.abs(force[:p]) <= NEAR) & (np.abs(w[:p]) <= NEAR)))
        self._alert = self._alert or self._touching > 0
        self._certifier.sliding |= without_load(system, force, w)
        return proposal

    def _near(self, proposal: Proposal) -> Point:
        return proposal.force, self._system.g - self._system.S @ proposal.force

    def met(self, answer: object) -> None:
        """Take note of what a complete selection holds: a degenerate solution makes every node worth a try."""
        strict = answer is None or (isinstance(answer, SelectionSolution) and answer.strict)
        self._alert = self._alert or not strict or self._certifier.hard

    def again(self, codes: Codes, relaxation: Relaxation | None) -> list[SelectionSolution] | None:
        """The solutions of a subtree that was closed in an earlier search."""
        if all(code == UNDECIDED for code in codes):
            self._whole = self._proposed(WeightSource.PLAIN if self._certifier.plain else WeightSource.DESCENT)
            return self.whole()
        return self._tried(codes, relaxation)

    def _tried(self, codes: Codes, relaxation: Relaxation | None) -> list[SelectionSolution] | None:
        system, certifier = self._system, self._certifier
        near = (np.zeros(2 * system.p), system.g)
        if relaxation is not None:
            near = relaxation.forces, relaxation.displacements
        sought = WeightSource.PLAIN if certifier.plain else WeightSource.CENTRES
        proposal = propose(system, codes, near, exactly=certifier.exactly, sought=sought)
        return certifier.closed(codes, proposal, near)

    def closed(self, codes: Codes, relaxation: Relaxation | None) -> list[SelectionSolution] | None:
        """The solutions of a subtree that can be closed, None where it has to be searched."""
        if self.known is not None and (found := self._above_known(codes, relaxation)) is not None:
            return found
        # at a solution without slip the energy is zero, and that is its minimum
        alert = self._alert or bool(self._certifier.sliding)
        if not alert and (relaxation is None or abs(relaxation.bound) > NEAR):
            return None
        if max(codes) < CONTACT or not (alert or _touches(codes, relaxation)):
            return None
        if self._wait > 0 and (CONTACT in codes or UNDECIDED in codes):
            self._wait -= 1
            return None
        found = self._tried(codes, relaxation)
        self._pause = 2 * self._pause + 1 if found is None else 0
        self._wait = self._pause
        return found

    def _above_known(self, codes: Codes, relaxation: Relaxation | None) -> list[SelectionSolution] | None:
        """The known root, if it is proven to be the only one; a few tries between the whole problem and its leaf."""
        p, known = self._system.p, self.known
        if known is None or relaxation is None:
            return None
        told = sum(code != UNDECIDED for code in codes)
        if (told < self._told and relaxation.bound < self._bound) or not known.below(codes):
            return None
        # the next try comes with a quarter more of the nodes decided, or with half the distance of the bound from zero
        self._told, self._bound = told + max(1, p // 4), 0.5 * relaxation.bound
        return self._alone(codes, known, relaxation if relaxation.form is None else self.relaxed(codes))

    def _alone(
        self, codes: Codes, known: KnownRoot, relaxation: Relaxation | None, *, descent: bool = False
    ) -> list[SelectionSolution] | None:
        if relaxation is None:
            return None
        proposal = Lone(self._system, codes, known, relaxation).proposal(descent=descent)
        return None if proposal is None else self._certifier.alone(codes, proposal)


def _touches(codes: Codes, relaxation: Relaxation | None) -> bool:
    """True if undecided nodes touch without load at the minimiser."""
    if relaxation is None:
        return False
    p = len(codes)
    forces, w = relaxation.forces[:p], relaxation.displacements[:p]
    return any(code >= CONTACT and forces[i] <= NEAR and w[i] >= -NEAR for i, code in enumerate(codes))


def holds_below(codes: Codes, active: ActiveSets) -> bool:
    """True if a solution lies below an assignment: at every node a final code holds that refines its code."""
    return all(
        bool(held - {OPEN}) if code == CONTACT else bool(held) if code > FRICTIONLESS else code in held
        for code, held in zip(codes, active, strict=True)
    )


def propose(
    system: ScaledSystem,
    codes: Codes,
    near: Point | None,
    *,
    exactly: bool,
    sought: WeightSource = WeightSource.CENTRES,
) -> Proposal | None:
    """Proposal that may close a subtree, or None.

    Parameters
    ----------
    system : ScaledSystem
    codes : of the subtree
    near : (2p,) arrays, lambda and w near its solution; None where nothing is known of it
    exactly : for a proof in rationals, in which statuses need not hold strictly; otherwise nodes whose status does not
        hold strictly are freed, or slide
    sought : as for ``weights_of``
    """
    free = tuple(i for i, code in enumerate(codes) if code not in _FINAL and code not in SLIDING)
    sliding = {i: code for i, code in enumerate(codes) if code in SLIDING}
    for _ in range(2):
        try:
            reduction = Reduction(system, codes, free, sliding)
        except np.linalg.LinAlgError:
            return None
        found = reduction.solution(near)
        if found is None:
            return None
        x, named = found
        force = reduction.forces(x)
        w = system.g - system.S @ force
        near = force, w
        selection = list(codes)
        for i, code in zip(reduction.free, named, strict=True):
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
    v = reduction.h - reduction.R @ x
    weights = reduction.weights(x, v, exactly=exactly, sought=sought)
    least = float(np.min(slack[fixed], initial=np.inf))
    strict = bool(np.all(np.abs(slack) > NEAR))
    hopeless = weights is None and len(reduction.nodes) == sum(code not in _FINAL for code in codes)
    hopeless = hopeless and not np.any(reduction.resting(x, v))
    return Proposal(tuple(selection), sliding, free, force, weights, hopeless, strict, least, reduction)


def without_load(system: ScaledSystem, force: Floats, w: Floats) -> dict[int, int]:
    """FORWARD or BACKWARD for the nodes with friction that touch without load and slide."""
    p = system.p
    rests = (np.abs(force[:p]) <= NEAR) & (np.abs(w[:p]) <= NEAR) & (np.abs(w[p:]) > NEAR) & (system.F > 0)
    return {int(i): FORWARD if w[p + i] > 0 else BACKWARD for i in np.flatnonzero(rests)}


_FINAL = (OPEN, STICK, SLIP_PLUS, SLIP_MINUS, FRICTIONLESS)


def _slack(system: ScaledSystem, selection: list[int], force: Floats, w: Floats) -> Floats:
    """Every node's least slack of the conditions of its status."""
    p = system.p
    n, t, u, v = force[:p], force[p:], -w[:p], w[p:]
    cone = system.F * n - np.abs(t)
    slack = {OPEN: u, STICK: cone, SLIP_PLUS: np.minimum(n, v), SLIP_MINUS: np.minimum(n, -v), FRICTIONLESS: n}
    return np.array([slack[code][i] for i, code in enumerate(selection)])
