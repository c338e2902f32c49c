"""What is proven at one value of a map, and between two: where the solution is unique (theory, section 13.5)."""

from __future__ import annotations

import time
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

from enumsol.arithmetic.balls import UNIT
from enumsol.condensation.enclosure import NotEnclosedError
from enumsol.search.data_boxes import BoxSearch, throughout
from enumsol.support.deadlines import Deadline, TimeOverError, within

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from fractions import Fraction

    from enumsol.model.problem import ContactProblem
    from enumsol.support.array_types import Alpha


@dataclass(frozen=True)
class MapFold:
    """A fold on one row of a map.

    Attributes
    ----------
    alpha : float
    statuses : tuple of tuples of str
        Of the arcs that meet there, in order: by them folds of neighbouring rows are matched.
    """

    alpha: float
    statuses: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class MapRow:
    """What is proven at one value of the second parameter: a branch graph over alpha, in numbers.

    Attributes
    ----------
    value : float
    alphas : tuple of Fraction
        Where the number of solutions changes.
    at_alphas, between : tuples of int
        Numbers of solutions at these alphas, and between them.
    exact : bool
        These are the numbers and not lower bounds.
    folds : tuple of MapFold
    complete : bool
    reasons : tuple of str
    limit : float or None
        Up to which alpha the solution is unique, from the first one; None: throughout, or not known.
    unique : bool or None
        Whether there is one solution at every alpha; None: not known.
    seconds : float
    within : float or None
        Of a body that nothing holds: the numbers are those of solutions whose rigid displacement is within this bound
        [length].
    """

    value: float
    alphas: tuple[Fraction, ...]
    at_alphas: tuple[int, ...]
    between: tuple[int, ...]
    exact: bool
    folds: tuple[MapFold, ...]
    complete: bool
    reasons: tuple[str, ...]
    limit: float | None
    unique: bool | None
    seconds: float
    within: float | None = None

    def count_at(self, alpha: Alpha) -> int:
        """Number of solutions at an alpha of the interval; a lower bound where the row is not exact."""
        for k, critical in enumerate(self.alphas):
            if alpha == critical:
                return self.at_alphas[k]
            if alpha < critical:
                return self.between[k - 1]
        return self.between[-1]


@dataclass(frozen=True)
class MapStrip:
    """The part of a map between two neighbouring values of the second parameter.

    Attributes
    ----------
    low, high : float
        The two values.
    boxes : tuple of ((alpha, alpha), (value, value))
        Rectangles, borders included, in which every problem is proven to have exactly one solution.
    unique : tuple of (alpha, alpha)
        Ranges over which this is proven for every value from ``low`` to ``high``.
    tried : int
        Boxes that were tried.
    seconds : float
    """

    low: float
    high: float
    boxes: tuple[tuple[tuple[float, float], tuple[float, float]], ...]
    unique: tuple[tuple[float, float], ...]
    tried: int
    seconds: float

    def share(self, first: float, last: float) -> float:
        """Of a range of alpha the part over which the solution is proven to be unique for every value between."""
        covered = sum(max(0.0, min(b, last) - max(a, first)) for a, b in self.unique)
        return covered / (last - first) if last > first else float(any(a <= first <= b for a, b in self.unique))


def ranges_of_one(rows: tuple[MapRow, MapRow]) -> list[tuple[float, float]]:
    """The ranges of alpha in which both rows have one solution, as far as they say."""
    ends = sorted({alpha for row in rows for alpha in row.alphas})
    found: list[tuple[float, float]] = []
    for low, high in pairwise(ends):
        if any(row.count_at((low + high) / 2) != 1 for row in rows):
            continue
        if found and found[-1][1] == float(low) and all(row.count_at(low) == 1 for row in rows):
            found[-1] = (found[-1][0], float(high))
        else:
            found.append((float(low), float(high)))
    return found


def map_strip(
    make: Callable[[float], ContactProblem],
    values: tuple[float, float],
    ranges: Sequence[tuple[float, float]],
    most: int,
    seconds: float | None,
) -> MapStrip:
    """One strip of a map (a module-level function, so that other processes can import it).

    Parameters
    ----------
    make : of a value, a problem whose load, gap and friction are affine in it
    values : two neighbours
    ranges : of alpha, in which boxes are tried
    most : number of boxes that are tried at most
    seconds : or until this time is over, or None
    """
    started = time.perf_counter()
    search = None
    low, high = values
    with suppress(NotEnclosedError, TimeOverError), within(Deadline.after(started, seconds)):
        search = BoxSearch((make(low), make(high)))
        search.run(ranges, most)
    boxes = [] if search is None else sorted(search.found)
    slack = 8 * UNIT * max(abs(low), abs(high))

    def value(share: float, inward: int) -> float:
        """Of the second parameter; rounded into the box."""
        return low if share == 0 else high if share == 1 else low + share * (high - low) + inward * slack

    return MapStrip(
        low=low,
        high=high,
        boxes=tuple((box.alphas, (value(box.shares[0], 1), value(box.shares[1], -1))) for box in boxes),
        unique=tuple(throughout(boxes)),
        tried=0 if search is None else search.tried,
        seconds=time.perf_counter() - started,
    )
