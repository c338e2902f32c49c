"""When a subtree may be closed by its only possible solution, and what is proposed for it (theory, section 6.11).

Nothing here is trusted: the certifier proves what is proposed, or the subtree is branched on.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from enumsol.search.reduction import NEAR, Reduction
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
    UNDECIDED,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from enumsol.condensation.condensed import ScaledSystem
    from enumsol.relaxation.engine import Relaxation
    from enumsol.selections.solution import ActiveSets, Codes

    Array = NDArray[np.float64]

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
    weights : numbers for which the form of theory, (6.9), is definite, or None
    hopeless : nor would a proof in rationals find any, which frees no nodes and need not serve all theta of one
    strict : every status in the proof holds strictly
    least : least slack of the conditions of the fixed nodes
    reduction : Reduction
    """

    selection: Codes
    sliding: dict[int, int]
    free: tuple[int, ...]
    force: Array
    weights: Array | None
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
        self._alert = self._began_again = self._looked = False
        self._touching = 0
        self._wait = self._pause = 0

    @property
    def sliding(self) -> dict[int, int]:
        """Those of the certifier."""
        return self._certifier.sliding

    def begins_again(self, system: ScaledSystem, nodes: int) -> bool:
        """Whether so much has become known after some nodes that a search had better begin again; once at most."""
        if self._began_again:
            return False
        if not self._looked and nodes >= system.p:
            self._looked = True
            self._look(system)
        if self._touching < _MANY and len(self._certifier.sliding) < _MANY:
            return False
        self._began_again = True
        self._wait = self._pause = 0
        return True

    def whole(self, nodes: int) -> list[SelectionSolution] | None:
        """No try about the whole tree."""
        del nodes
        return None

    def _look(self, system: ScaledSystem) -> None:
        """Take note of a degenerate solution, if Newton's method finds one."""
        whole = Reduction(system, (UNDECIDED,) * system.p, tuple(range(system.p)), {})
        found = whole.solution(*start(system, None))
        if found is not None:
            force, p = whole.forces(found[0]), system.p
            w = system.g - system.S @ force
            self._touching = int(np.count_nonzero((np.abs(force[:p]) <= NEAR) & (np.abs(w[:p]) <= NEAR)))
            self._alert = self._alert or self._touching > 0
            self._certifier.sliding |= without_load(system, force, w)

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
        if self._wait > 0 and (CONTACT in codes or UNDECIDED in codes):
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
    system: ScaledSystem,
    codes: Codes,
    force: Array,
    w: Array,
    *,
    exactly: bool,
    factors: bool = True,
) -> Proposal | None:
    """What may close a subtree, or None.

    Parameters
    ----------
    system : ScaledSystem
    codes : of the subtree
    force, w : (2p,) arrays, lambda and w near its solution
    exactly : for a proof in rationals, in which statuses need not hold strictly; otherwise nodes whose status does not
        hold strictly are freed, or slide
    factors : as for ``weights_of``
    """
    free = tuple(i for i, code in enumerate(codes) if code not in _FINAL and code not in SLIDING)
    sliding = {i: code for i, code in enumerate(codes) if code in SLIDING}
    for _ in range(2):
        try:
            reduction = Reduction(system, codes, free, sliding)
        except np.linalg.LinAlgError:
            return None
        found = reduction.solution(force, w)
        if found is None:
            return None
        x, named = found
        force = reduction.forces(x)
        w = system.g - system.S @ force
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
    weights = reduction.weights(x, v, exactly=exactly, factors=factors)
    least = float(np.min(slack[fixed], initial=np.inf))
    strict = bool(np.all(np.abs(slack) > NEAR))
    hopeless = weights is None and len(reduction.nodes) == sum(code not in _FINAL for code in codes)
    hopeless = hopeless and not np.any(reduction.resting(x, v))
    return Proposal(tuple(selection), sliding, free, force, weights, hopeless, strict, least, reduction)


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
