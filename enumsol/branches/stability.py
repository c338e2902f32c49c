"""Which arcs of a branch graph run away (theory, section 15): verdicts over ranges of alpha."""

from __future__ import annotations

import heapq
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from enumsol.roots.stability import Stabilities, rate_bounds
from enumsol.search.growing_motions import crossing_near, zero_near
from enumsol.search.stability import Proven, StabilitySearch
from enumsol.support.deadlines import look
from enumsol.trusted.motions_of_body import friction_over
from enumsol.trusted.running_away import Growing, left_open

if TYPE_CHECKING:
    from collections.abc import Sequence

    import scipy.sparse as sp

    from enumsol.branches.elements import Arc
    from enumsol.branches.space.slip_directions import SlipDirections
    from enumsol.model.problem3d import AnyProblem
    from enumsol.roots.stability import Verdict
    from enumsol.support.array_types import ArrayLike
    from enumsol.trusted.motions_of_body import Setting

#: Parts of an arc that are tried, which decides how much time an arc costs along which nothing is proven; and how short
#: they are at the end, relative to the arc, about an alpha at which the verdict changes.
_PARTS, _SHORTEST = 160, 2.0**-12
#: Parts that are left then are searched as a whole, with at most so many programs, until that fails so often.
_PROGRAMS, _FAILURES = 20, 16


@dataclass(frozen=True)
class Span:
    """A range of alpha on an arc with one verdict.

    Attributes
    ----------
    low, high : float
    verdict : "runs away", "does not run away" or "undecided"
        The first two are proven for every alpha between them. A short undecided range between two others encloses
        the alpha at which the verdict changes.
    growth : (float, float) or None
        Bounds of the growth rate of a motion in the range [1 / time].

    Examples
    --------
    >>> import enumsol
    >>> graph = enumsol.branch_graph(enumsol.gallery.one_node_triangle(), (0, 3))
    >>> [span] = graph.stability()[2]
    >>> round(span.low, 4), span.high, span.verdict
    (2.6667, 3.0, 'runs away')
    """

    low: float
    high: float
    verdict: Verdict
    growth: tuple[float, float] | None = None


class ArcStabilities:
    """Verdicts on arcs of one problem.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
    mass : (n, n) array_like or sparse, or None
        In place of ``problem.inertia``.

    Raises
    ------
    InvalidArgumentError
        The problem has no mass.
    InvalidProblemError
        The mass cannot be used.
    """

    def __init__(self, problem: AnyProblem, mass: ArrayLike | sp.sparray | sp.spmatrix | None = None) -> None:
        self._problem, self._asked = problem, Stabilities(problem, mass)
        self._constant = not np.any(problem.affine_friction[1])
        #: Proofs at some alphas of the arc, by the contact rows of the part that they are about.
        self._hints: dict[tuple[int, ...], list[Proven]] = {}
        self._directions: SlipDirections | None = None
        #: After so many parts were searched as a whole in vain.
        self._failures = _FAILURES

    def spans(self, arc: Arc, arcs: Sequence[Arc] = ()) -> tuple[Span, ...]:
        """Verdicts along an arc, from its lower end to its upper one; ``arcs`` are all of its graph, for 3D."""
        look()
        if arc.grazing or arc.dimension:
            return (Span(arc.lo, arc.hi, "undecided"),)
        self._hints, self._failures = {}, _FAILURES
        if self._asked.body.tangents > 1:
            from enumsol.branches.space.slip_directions import SlipDirections  # for graphs in 3D only

            self._directions = SlipDirections(arc, arcs)
        if self._constant and (self._directions is None or not self._directions.turning):
            found = self._piece(arc, arc.lo, arc.hi)
            return (found or Span(arc.lo, arc.hi, "undecided"),)
        return tuple(_joined(self._divided(arc)))

    def _divided(self, arc: Arc) -> list[Span]:
        """Verdicts in parts of an arc, halved where nothing is proven, the longest first."""
        left, found = [(-arc.length, arc.lo, arc.hi)], list[Span]()
        for count in range(2 * _PARTS):
            if not left:
                break
            look()
            if count == _PARTS:
                self._failures = 0
            _, low, high = heapq.heappop(left)
            known, middle = self._piece(arc, low, high), 0.5 * (low + high)
            if known is None and high - low > _SHORTEST * arc.length and low < middle < high:
                for ends in ((low, middle), (middle, high)):
                    heapq.heappush(left, (ends[0] - ends[1], *ends))
            else:
                found.append(known or Span(low, high, "undecided"))
        return sorted((*found, *(Span(low, high, "undecided") for _, low, high in left)), key=lambda span: span.low)

    def _piece(self, arc: Arc, low: float, high: float) -> Span | None:
        """The verdict in a part of an arc, if it is one that can be proven there at once."""
        middle = 0.5 * (low + high)
        whole, at = self._settings(arc, low, high), self._settings(arc, middle, middle)
        if whole is None or at is None:
            return None
        quiet = True
        for k, setting in enumerate(whole):
            verdict = self._verdict(setting, at[k])
            if isinstance(verdict, tuple):
                return Span(low, high, "runs away", verdict)
            quiet = quiet and verdict
        return Span(low, high, "does not run away") if quiet else None

    def _settings(self, arc: Arc, low: float, high: float) -> list[Setting] | None:
        """Parts of the body for all alpha of a range, or, in floats in 3D, at one; None where they are not enclosed."""
        active = [frozenset({status}) for status in arc.statuses]
        known = self._directions
        directions = None
        if known is not None:
            directions = known.at(low) if low == high else known.over(low, high)
            if directions is None:
                return None
        return list(self._asked.settings_of(active, friction_over(self._problem, low, high), directions))

    def _verdict(self, setting: Setting, at: Setting) -> bool | tuple[float, float]:
        """Bounds of a growth rate in a range of alpha, or whether nothing grows; ``at`` is the same at its middle."""
        hints = self._hints.setdefault(tuple(setting.rows), [])
        for hint in hints:
            extended = _extended(hint, setting)
            if extended is not False:
                return extended
        known = [found for hint in hints if (found := _extended(hint, at)) is not False]
        if not known:
            proven = StabilitySearch(at.stiffness, at.motions).run()
        elif known[0] is not True or self._failures == _FAILURES:
            return False  # the range is too long
        else:
            # numbers that serve in the middle may leave no room where others do
            proven = StabilitySearch(setting.stiffness, setting.motions, most_programs=_PROGRAMS).run()
        extended = _extended(proven, setting)
        if known and extended is False:
            self._failures += 1
        else:
            hints[:] = [proven, *hints[:3]]
        return extended


def _extended(proven: Proven, setting: Setting) -> bool | tuple[float, float]:
    """A proof at one alpha, if it holds for a range of them."""
    stiffness, motions = setting.stiffness, setting.motions
    for tried, _ in proven.growing:
        crossing = crossing_near(stiffness, motions, tried)
        if crossing is not None:
            return rate_bounds(crossing.low, crossing.high)
        at = zero_near(stiffness, motions, tried)
        if at is None:
            continue
        # between such powers of two motions are looked for, so that K(mu) is enclosed at few mu
        for step in (1 / 32, 1 / 8, 1 / 2):
            place = float(np.log2(at)) / step
            below = np.floor(place - 0.25)
            low, high = (float(np.exp2(step * (below + k))) for k in (0, 1 if place - below < 0.75 else 2))
            wider = Growing(low, high, tried.way)
            if wider.found(stiffness, motions) is not None:
                return rate_bounds(low, high)
    if proven.growing or proven.gaps or left_open(proven.leaves) is not None:
        return False
    return all(leaf.holds(stiffness, motions) for leaf in proven.leaves)


def _joined(spans: Sequence[Span]) -> list[Span]:
    """Neighbours with the same verdict as one."""
    joined: list[Span] = []
    for span in spans:
        if joined and joined[-1].verdict == span.verdict:
            last = joined.pop()
            both = (last.growth, span.growth)
            growth = (min(b[0] for b in both if b), max(b[1] for b in both if b)) if all(both) else None
            joined.append(Span(last.low, span.high, span.verdict, growth))
        else:
            joined.append(span)
    return joined
