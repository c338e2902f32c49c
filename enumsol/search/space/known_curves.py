"""Curves of solutions that a tree over alpha knows, their boxes, and where further curves are looked for."""

from __future__ import annotations

from fractions import Fraction
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.balls import Ball
from enumsol.arithmetic.rationals import simplest
from enumsol.search.space.curve_proposals import placed
from enumsol.trusted.space.curve_runs import KnownCurve
from enumsol.trusted.space.pieces import lie_along
from enumsol.trusted.space.solution_curve import AlphaProblem

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from enumsol.condensation.enclosure import CondensedEnclosure
    from enumsol.search.space.piece_multipliers import AlphaPoint
    from enumsol.support.array_types import Floats, Mask
    from enumsol.trusted.space.curve_chains import CurveChain
    from enumsol.trusted.space.leaves import Open, SpaceRoot
    from enumsol.trusted.space.pieces import AlphaPiece
    from enumsol.trusted.space.solution_curve import SolutionCurve

#: Pieces of undecided statuses at most at which a first curve is sought; where solutions are sampled, as shares of the
#: interval, if more than one curve may be needed.
_SOUGHT, _SAMPLED = 8, (Fraction(15, 16), Fraction(1, 2), Fraction(1, 16))


def joined(ranges: Iterable[tuple[Fraction, Fraction]]) -> list[tuple[Fraction, Fraction]]:
    """Ranges in their order, those that touch as one."""
    found: list[tuple[Fraction, Fraction]] = []
    for low, high in sorted(ranges):
        if found and low <= found[-1][1]:
            found[-1] = found[-1][0], max(high, found[-1][1])
        else:
            found.append((low, high))
    return found


class Curves:
    """Curves that are known over an interval of alpha.

    Parameters
    ----------
    enclosure : CondensedEnclosure
    interval : (a, b), Fractions
    more : callable, optional
        Called with a solution (forces and alpha, in the units of the problem) that lies in no known box; gives the
        curve through it, as far as it is proven, if it is new.
    solutions : callable, optional
        Called with an alpha; gives forces of solutions there, in the units of the problem, not necessarily all.

    Attributes
    ----------
    known : list of KnownCurve
    more : as given
        None once no further curve is to be followed.
    sampled : bool
        Solutions were sampled.
    sought : int
        How often a curve through the middle of a piece was looked for.
    ends : list of (Fraction, Fraction)
        Ranges of alpha around the ends of curves, in their order.
    """

    def __init__(
        self,
        enclosure: CondensedEnclosure,
        interval: tuple[Fraction, Fraction],
        more: Callable[[Floats], CurveChain | None] | None = None,
        solutions: Callable[[Fraction], Sequence[Floats]] | None = None,
    ) -> None:
        self._given, self._interval = AlphaProblem.of(enclosure), interval
        self.more, self._solutions = more, solutions
        self.known: list[KnownCurve] = []
        self.sampled, self.sought = False, 0
        self.ends: list[tuple[Fraction, Fraction]] = []
        #: The curve of every box, numbered as in a proof.
        self._boxes: list[SolutionCurve] = []
        self._owner: list[int] = []

    # -- further curves --------------------------------------------------------------------------------------------

    def take(self, known: KnownCurve) -> None:
        """Add a curve to those that are known."""
        links = known.chain.links
        self._boxes += [link.curve for link in links]
        self._owner += [len(self.known)] * len(links)
        self.known.append(known)
        boxes = [curve.box for curve in self._boxes]
        self._c, self._d, self._e = (
            np.array([getattr(box, name) for box in boxes]) for name in ("centre", "direction", "border")
        )
        self._b = np.array([curve.reach for curve in self._boxes])
        self._h = np.array([box.half for box in boxes])
        # so near to the ends of curves nothing is searched
        room = Fraction(2.0**-14) * (self._interval[1] - self._interval[0])
        ends = [end for curve in self.known for end in curve.chain.gaps]
        whole = joined((low - room, high + room) for low, high in ends)
        self.ends = [(simplest(low, low + room / 2), simplest(high - room / 2, high)) for low, high in whole]

    def follow(self, x: Floats) -> bool:
        """True if a new curve through a solution was followed; none is where a known one seems to pass through it."""
        chain = None if self.more is None or self.is_known(x) else self.more(x)
        if chain is not None:
            self.take(KnownCurve(self._given, chain))
        return chain is not None

    def sample(self) -> bool:
        """True if there are new curves through the solutions at some alphas, which are looked for once."""
        self.sampled, known = True, len(self.known)
        low, high = self._interval
        for alpha in (low + share * (high - low) for share in _SAMPLED):
            for forces in () if self._solutions is None else self._solutions(alpha):
                self.follow(np.append(forces, float(alpha)))
        return len(self.known) > known

    @property
    def sought_enough(self) -> bool:
        """True if no further curve through the middle of a piece is looked for."""
        return self.sought == _SOUGHT

    def seek(self, point: Callable[[], AlphaPoint]) -> bool:
        """True if there is a new curve through a solution at a point of alpha."""
        self.sought += 1
        at = point()
        forces = at.solution()
        return forces is not None and self.follow(np.append(forces, float(at.alpha)))

    # -- boxes -----------------------------------------------------------------------------------------------------

    def is_known(self, x: Floats) -> bool:
        """True if a solution seems to lie on a known curve; no claim."""
        if not self._boxes:
            return False
        return bool(np.any(self._around(placed(self._given, x), np.zeros_like(x))))

    def _around(self, x: Floats, rad: Floats) -> Mask:
        """Which boxes seem to hold a point, and all that is within a radius of it along t; no claim."""
        off = x - self._c
        t = np.sum(self._e * off, axis=1)
        beside = np.abs(off - t[:, None] * self._d)
        along = np.abs(t) + np.abs(self._e) @ rad
        return np.asarray((along <= self._h) & np.all(beside <= self._b, axis=1))

    def run(self, piece: AlphaPiece, found: SpaceRoot | Open) -> tuple[int, int] | None:
        """The first and the last of the boxes in which forces lie."""
        for ends in piece.places(found, self._given) if self._boxes else ():
            sides = [np.flatnonzero(self._around(end.mid, end.rad)).tolist() for end in ends]
            runs = {(min(pair), max(pair)) for pair in product(sides[0], sides[-1])}
            # a few rows of boxes of one curve, the shortest first, and no longer ones
            for first, last in sorted(runs, key=lambda run: run[1] - run[0])[:4]:
                near = last - first < 64 and self._owner[first] == self._owner[last]
                if near and lie_along(ends, self._boxes[first : last + 1], 2.0):
                    return first, last
        return None

    def box(self, piece: AlphaPiece, found: SpaceRoot | Open) -> int | None:
        """The box in which a root in a point of alpha lies."""
        run = self.run(piece, found)
        return None if run is None or run[0] != run[1] else run[0]

    def met(self, piece: AlphaPiece, root: SpaceRoot) -> int | None:
        """The box of a root in a point of alpha, along whose curve new ones are put if there is none."""
        number = self.box(piece, root)
        if number is None and self.follow(middle_of(piece, root)):
            number = self.box(piece, root)
        return number

    def runs_through(self, number: int, piece: AlphaPiece) -> bool:
        """True if the curve of a box has no end over a piece."""
        return self.known[self._owner[number]].chain.runs_through(piece.low, piece.high)


def middle_of(piece: AlphaPiece, root: SpaceRoot) -> Floats:
    """Forces and alpha of a root in the middle of a piece, in the units of the problem.

    Of a body that nothing holds the forces are followed by its rigid displacement.
    """
    y = root.y if root.rigid is None else Ball.joined(root.y, -root.rigid)
    return np.concatenate([piece.forces(y).mid, piece.rigid(y).mid, [float(piece.middle)]])
