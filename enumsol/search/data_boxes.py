"""Boxes of data that have one solution: problems between two neighbours on a map, cut until a proof succeeds.

What is proposed here is proven by the trusted core, or not claimed (theory, section 13.5).
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from enumsol.condensation.condensed import CondensedSystem, ScaledSystem
from enumsol.condensation.enclosure import NotEnclosedError
from enumsol.errors import InvalidProblemError
from enumsol.model.statuses import UNDECIDED
from enumsol.search.fathoming import Proposal, propose
from enumsol.search.reduction import Reduction, WeightSource
from enumsol.support.deadlines import look
from enumsol.trusted.data_box import DataBox, Throughout, only_throughout, solution_throughout
from enumsol.trusted.over_interval import PieceNumbers

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.model.problem import ContactProblem


#: Rounds in which nodes are freed, and how many may be free: so many, or one for so many nodes.
_ROUNDS, _FEW_LOOSE, _NODES_FOR_ONE = 4, 6, 8
#: Boxes without numbers at their middle are cut so often, and numbers are sought so many times.
_VAIN_CUTS, _TRIES = 2, 24
#: The form must be definite by this, so that rounding on another processor decides nothing.
_MARGIN = 1e-9


@dataclass(frozen=True, order=True)
class Box:
    """A rectangle of alpha and the second parameter.

    Attributes
    ----------
    alphas : (low, high)
    shares : (low, high)
        Of the way from the first problem (0) to the second one (1).
    """

    alphas: tuple[float, float]
    shares: tuple[float, float]

    def halves(self, along: bool) -> tuple[Box, Box] | None:
        """Both, of alpha or of the share; None where floats end."""
        low, high = self.alphas if along else self.shares
        middle = 0.5 * (low + high)
        if not low < middle < high:
            return None
        ends = (low, middle), (middle, high)
        first, second = (Box(part, self.shares) if along else Box(self.alphas, part) for part in ends)
        return first, second


class BoxSearch:
    """The problems between two with the same A, Bn and Bt, whose load, gap and friction change affinely.

    Parameters
    ----------
    problems : pair of ContactProblem

    Attributes
    ----------
    found : list of Box
        Proven to have one solution throughout.
    tried : int

    Raises
    ------
    NotEnclosedError
        One of them has no enclosure.
    """

    def __init__(self, problems: tuple[ContactProblem, ContactProblem]) -> None:
        self._enclosures = problems[0].enclosure, problems[1].enclosure
        self._tries, self._last = _TRIES, None  # type: int, PieceNumbers | None
        self.found: list[Box] = []
        self.tried = 0

    def run(self, ranges: Sequence[tuple[float, float]], most: int) -> None:
        """Find boxes of alphas in these ranges that are proven to have one solution; so many are tried at most.

        Raises
        ------
        TimeOverError
            At the deadline.
        """
        waiting = [(low - high, Box((low, high), (0.0, 1.0)), _VAIN_CUTS) for low, high in ranges if low < high]
        heapq.heapify(waiting)
        while waiting and self.tried < most:
            look()
            # the largest first
            size, box, cuts = heapq.heappop(waiting)
            self.tried += 1
            try:
                data, system = self._data(box)
                outcome = self._one_solution(data, system)
            except (InvalidProblemError, NotEnclosedError, np.linalg.LinAlgError):
                continue
            if outcome:
                self.found.append(box)
                continue
            cuts -= outcome is None
            halves = box.halves(_longer(data)) if cuts >= 0 else None
            for half in halves or ():
                heapq.heappush(waiting, (0.5 * size, half, cuts))

    def _data(self, box: Box) -> tuple[DataBox, ScaledSystem]:
        """The box and the problem at its middle."""
        alpha, share = 0.5 * sum(box.alphas), 0.5 * sum(box.shares)
        loads = [enclosure.g0 + alpha * enclosure.g1 for enclosure in self._enclosures]
        bounds = [enclosure.problem.affine_friction for enclosure in self._enclosures]
        F = [first + alpha * slope for first, slope in bounds]
        g, F_middle = ((1.0 - share) * one + share * other for one, other in (loads, F))
        S = self._enclosures[0].S
        system = ScaledSystem.from_system(CondensedSystem(S, g, np.maximum(F_middle, 0.0)))
        data = DataBox.between(self._enclosures, box.alphas, box.shares, system.force, system.length)
        return data, system

    def _one_solution(self, data: DataBox, system: ScaledSystem) -> bool | None:
        """Whether there is proven to be one throughout; None where it seems that no numbers serve the middle."""
        proposal = self._proposed(system)
        found = None if proposal is None else _located(data, system, proposal)
        if proposal is None or found is None:
            return False
        if any(only_throughout(data, found, numbers, _MARGIN) for numbers in self._numbers(system.p)):
            return True
        if not self._tries:
            return None
        self._tries -= 1
        self._last = _sought(data, proposal)
        return None if self._last is None else only_throughout(data, found, self._last, _MARGIN)

    def _numbers(self, p: int) -> list[PieceNumbers]:
        """Plain ones, and those that were found last."""
        plain = PieceNumbers(np.ones(p), np.ones(p), np.zeros(p))
        return [plain] if self._last is None else [plain, self._last]

    @staticmethod
    def _proposed(system: ScaledSystem) -> Proposal | None:
        """The solution at the middle of a box."""
        codes, zero = (UNDECIDED,) * system.p, np.zeros(2 * system.p)
        for near in ((zero, system.g), None):
            found = propose(system, codes, near, exactly=False, sought=WeightSource.PLAIN)
            if found is not None:
                return found
        return None


def _longer(data: DataBox) -> bool:
    """True if the data change more with alpha than with the second parameter."""
    size = float(np.linalg.norm(data.g.value.mid)) + np.finfo(float).tiny
    along, across = (
        float(np.linalg.norm(g.mid)) / size + float(np.max(np.abs(F.mid), initial=0.0))
        for g, F in ((data.g.along, data.F.along), (data.g.across, data.F.across))
    )
    return bool(along >= across)


def _sought(data: DataBox, proposal: Proposal) -> PieceNumbers | None:
    """Numbers that serve the solution at the middle."""
    reduction, p, rubbing = proposal.reduction, data.system.p, data.rubbing
    x = proposal.force[reduction.places]
    found = reduction.weights(x, reduction.h - reduction.R @ x, exactly=False, sought=WeightSource.DESCENT)
    if found is None:
        return None
    kappa, nu = np.ones(p), np.zeros(p)
    kappa[rubbing], nu[rubbing] = found[p : p + 2 * len(rubbing)].reshape(2, -1)
    return PieceNumbers(found[:p], kappa, nu)


def _located(data: DataBox, system: ScaledSystem, proposal: Proposal) -> Throughout | None:
    """The solution throughout a box: nodes whose status may change are freed until all others' conditions hold."""
    loose: set[int] = set()
    weights = np.zeros(0)
    for _ in range(_ROUNDS):
        found = solution_throughout(data, proposal.selection, sorted(loose), weights, proposal.force)
        if found is None or not found.broken:
            return found
        loose |= set(found.broken)
        if len(loose) > max(_FEW_LOOSE, system.p // _NODES_FOR_ONE):
            return None
        codes = tuple(UNDECIDED if i in loose else code for i, code in enumerate(proposal.selection))
        reduction = Reduction(system, codes, tuple(sorted(loose)), {})
        x = proposal.force[reduction.places]
        numbers = reduction.weights(x, reduction.h - reduction.R @ x, exactly=False)
        if numbers is None:
            return None
        weights = numbers
    return None


def throughout(boxes: Sequence[Box]) -> list[tuple[float, float]]:
    """The ranges of alpha over which boxes cover all shares from 0 to 1, joined where they touch."""
    ends = sorted({end for box in boxes for end in box.alphas})
    found: list[tuple[float, float]] = []
    for low, high in pairwise(ends):
        reach = 0.0
        for first, last in sorted(box.shares for box in boxes if box.alphas[0] <= low and high <= box.alphas[1]):
            if first > reach:
                break
            reach = max(reach, last)
        if reach < 1.0:
            continue
        if found and found[-1][1] == low:
            found[-1] = (found[-1][0], high)
        else:
            found.append((low, high))
    return found
