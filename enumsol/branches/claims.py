"""What a branch graph may claim: the one place that knows how far its statements reach (theory, section 7.13).

Arcs and settled vertices of any graph are solutions, whatever cut the search short: each arc is one of regular roots,
and no two of them meet between their ends. So a graph that is not complete gives lower bounds, which
``branches.lower_bounds`` counts. The number of solutions, uniqueness and a critical alpha need a graph without gaps.
Texts, JSON, plots and Python all ask here.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.algebraic import CriticalAlpha
from enumsol.arithmetic.rationals import rational
from enumsol.branches.lower_bounds import least_at, least_steps
from enumsol.model.problem import ContactProblem
from enumsol.support.messages import counted

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from enumsol.branches.elements import Arc, Vertex
    from enumsol.model.problem3d import ContactProblem3D


class Standing(enum.Enum):
    """How far the statements of a branch graph reach."""

    PROVEN = "proven"
    NOT_PROVEN = "not proven"
    INCOMPLETE = "incomplete"


@dataclass(frozen=True)
class Multiplicity:
    """A number of solutions (isolated roots and families together), or a lower bound of it.

    Attributes
    ----------
    count : int
    exact : bool
        ``count`` is the number itself; otherwise it is a lower bound.
    """

    count: int
    exact: bool

    def __str__(self) -> str:
        return str(self.count) if self.exact else f"at least {self.count}"


@dataclass(frozen=True)
class MultiplicitySteps:
    """The number of solutions as a step function of alpha, or a lower bound of it.

    Attributes
    ----------
    alphas : tuple of Fraction
        Critical alphas, rounded to floats, in order. Where these are lower bounds: the floats at which they change, on
        the safe side of a critical alpha that is no float or not known exactly, and the first and last float.
    at : tuple of int
        Values at these alphas (at the critical ones themselves, unless these are lower bounds).
    between : tuple of int
        Values on the open intervals between them (one fewer).
    exact : bool
        Whether these are the numbers of solutions and not lower bounds.
    """

    alphas: tuple[Fraction, ...]
    at: tuple[int, ...]
    between: tuple[int, ...]
    exact: bool


@dataclass(frozen=True)
class Uniqueness:
    """Up to which alpha the solution is unique.

    Attributes
    ----------
    known : bool
        False for a graph with gaps: then only ``several_by`` is known.
    throughout : bool or None
        One solution at every alpha of the interval; None when that is not known.
    limit : float or None
        The alpha up to which there is one solution, from the interval's first alpha on; None when there is one
        throughout, and when that is not known.
    several_by : float or None
        There are several solutions at this alpha or right above it, so that the limit is not larger. None when no
        second solution was found.
    none_by : float or None
        There is no solution at this alpha or right above it, which happens to a body that nothing holds only. None when
        there is always one, and for a graph with gaps.
    """

    known: bool
    throughout: bool | None
    limit: float | None
    several_by: float | None
    none_by: float | None = None


class Claims:
    """What the arcs and vertices that were found prove.

    Parameters
    ----------
    vertices : sequence of Vertex, in the order of alpha
    arcs : sequence of Arc
    interval : (Fraction, Fraction)
    standing : Standing
    held : bool
        The body is held, so that the indices of all solutions add up to +1.
    """

    def __init__(
        self,
        vertices: Sequence[Vertex],
        arcs: Sequence[Arc],
        interval: tuple[Fraction, Fraction],
        standing: Standing,
        *,
        held: bool = True,
    ) -> None:
        self._vertices, self._arcs, self._interval = vertices, arcs, interval
        self.standing, self._held = standing, held

    def __repr__(self) -> str:
        low, high = map(float, self._interval)
        arcs, vertices = counted(len(self._arcs), "arc"), counted(len(self._vertices), "vertex", "vertices")
        return f"Claims of {arcs} and {vertices} for alpha in [{low:g}, {high:g}]: {self.standing.value}"

    @property
    def whole(self) -> bool:
        """Whether nothing is known to be missing: counts are then exact and not lower bounds."""
        return self.standing is not Standing.INCOMPLETE

    def multiplicity(self, alpha: Fraction) -> Multiplicity:
        """Number of solutions at an alpha of the interval, or its lower bound.

        It is a bound, too, where bounds of a vertex do not tell on which side of the alpha it lies.
        """
        point = CriticalAlpha.rational(rational(alpha))
        at = [v.exact for v in self._vertices if v.exact.compare(point) == 0]
        if not self.whole or not all(place.is_rational for place in at):
            return Multiplicity(least_at(alpha, self._vertices, self._arcs, held=self._held), exact=False)
        over = sum(arc.passes_over(point) for arc in self._arcs)
        return Multiplicity(over + len(at), exact=True)

    def steps(self) -> MultiplicitySteps:
        """The number of solutions over the whole interval, or its lower bound."""
        if not self.whole:
            alphas, least, between = least_steps(self._interval, self._vertices, self._arcs, held=self._held)
            return MultiplicitySteps(tuple(map(Fraction, alphas)), tuple(least), tuple(between), exact=False)
        groups: list[list[Vertex]] = []
        for v in self._vertices:
            if groups and groups[-1][0].exact.compare(v.exact) == 0:
                groups[-1].append(v)
            else:
                groups.append([v])
        place = {v.number: k for k, group in enumerate(groups) for v in group}
        over, between = _cover(((place[arc.tail], place[arc.head]) for arc in self._arcs), len(groups))
        at = [passing + len(group) for group, passing in zip(groups, over, strict=True)]
        places = [Fraction(group[0].alpha) for group in groups]
        # where nothing holds the body there may be no solution at an end, and no vertex
        first, last = self._interval
        outer = [CriticalAlpha.rational(rational(end)) for end in (first, last)]
        if not groups or groups[0][0].exact.compare(outer[0]) > 0:
            places, at, between = [first, *places], [0, *at], [0, *between] if groups else []
        if not groups or groups[-1][0].exact.compare(outer[1]) < 0:
            places, at, between = [*places, last], [*at, 0], [*between, 0]
        return MultiplicitySteps(tuple(places), tuple(at), tuple(between), exact=True)

    def uniqueness(self) -> Uniqueness:
        """Up to which alpha the solution is unique, or what is known about it."""
        steps = self.steps()
        behind = (*steps.between, 1)
        found = [float(x) for x, n, m in zip(steps.alphas, steps.at, behind, strict=False) if max(n, m) > 1]
        # a continuum is one solution to be counted, and many to be told apart
        found += [v.alpha for v in self._vertices if v.family is not None] + [
            arc.lo for arc in self._arcs if arc.dimension
        ]
        several = min(found, default=None)
        if not self.whole:
            return Uniqueness(known=False, throughout=None, limit=None, several_by=several)
        none = min(
            (float(x) for x, n, m in zip(steps.alphas, steps.at, behind, strict=False) if min(n, m) == 0), default=None
        )
        limit = min((end for end in (several, none) if end is not None), default=None)
        return Uniqueness(known=True, throughout=limit is None, limit=limit, several_by=several, none_by=none)

    def sentences(self, bound: float | None) -> list[str]:
        """What a user asks first, as lines of text.

        Parameters
        ----------
        bound : float or None
            An alpha up to which uniqueness follows without any search.
        """
        found = self.uniqueness()
        if not found.known and found.several_by is None:
            line = "no second solution was found; whether there is one is not known"
        elif not found.known:
            line = f"several solutions at or right above alpha = {found.several_by:.8g}; where they begin is not known"
        elif found.limit is None:
            line = "one solution throughout"
        elif found.limit > self._interval[0]:
            line = f"one solution below alpha = {found.limit:.8g}"
        elif found.limit == found.several_by:
            line = "several solutions from the first alpha on"
        else:
            line = "no solution at or right above the first alpha"
        if found.none_by is not None and found.none_by > self._interval[0]:
            line += f"; none at or right above alpha = {found.none_by:.8g}"
        several = found.several_by
        if found.none_by is not None and several is None:
            line += "; nowhere several"
        elif found.none_by is not None and several is not None and several > found.none_by:
            line += f"; several at or right above alpha = {several:.8g}"
        if self.standing is Standing.NOT_PROVEN:
            line += ", not proven"
        lines = [line]
        if bound is not None:
            lines.append(
                f"up to alpha = {bound:.8g} the stiffness alone rules out a second solution (estimate in floats)"
            )
        return lines


def uniqueness_bound(problem: ContactProblem | ContactProblem3D, interval: tuple[float, float]) -> float | None:
    """An alpha up to which uniqueness follows without any search (theory, section 5.6), if there is one."""
    (a, b), p, condensed = interval, problem.p, problem.condensed
    # in 3D both coefficients of every node
    lines = problem.friction if isinstance(problem, ContactProblem) else (problem.friction, problem.friction_slope)
    F0, F1 = map(np.array, lines)
    if not condensed.definite:  # within rounding, and the bound nearly zero
        return None
    inverse = np.linalg.inv(condensed.S)
    product = np.linalg.eigvalsh(inverse[:p, :p])[-1] * np.linalg.eigvalsh(condensed.S[p:, p:])[-1]
    largest = 1.0 / float(np.sqrt(product))
    if np.any(F0 + a * F1 >= largest):
        return None
    rising = F1 > 0
    reached = (largest - F0[rising]) / F1[rising]
    return min(b, float(np.min(reached, initial=np.inf)))


def _cover(spans: Iterable[tuple[int, int]], count: int) -> tuple[list[int], list[int]]:
    """How many of some arcs pass over each of ``count`` critical alphas, and over each interval between two of them."""
    through, beside = np.zeros((2, count + 1), dtype=int)
    for tail, head in spans:
        beside[tail] += 1
        beside[head] -= 1
        through[tail + 1] += 1
        through[head] -= 1
    return np.cumsum(through)[:-1].tolist(), np.cumsum(beside)[:-2].tolist()
