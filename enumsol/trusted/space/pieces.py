"""The trusted core in 3D over a piece of alpha: no solution, or all of them in a box (theory, section 12.9)."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball
from enumsol.condensation.space_condensed import PieceSpace
from enumsol.trusted.space.leaves import Open, SpaceRoot, settle
from enumsol.trusted.space.sector_rows import sector_margin
from enumsol.trusted.space.space_uniqueness import only_root, only_solution_in_space

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from enumsol.condensation.enclosure import CondensedEnclosure
    from enumsol.trusted.space.sector_rows import Row
    from enumsol.trusted.space.solution_curve import AlphaProblem, CurveBox

    Array = NDArray[np.float64]

#: What a writer of proofs asks for beyond what a checker does, of the size of a box.
_MARGIN = 2.0**-10


@dataclass(frozen=True, eq=False)
class AlphaPiece:
    """A problem over a piece of alpha.

    Attributes
    ----------
    enclosure : CondensedEnclosure
    low, high : Fraction
    units : force and length, (p,) arrays of powers of two
    """

    enclosure: CondensedEnclosure
    low: Fraction
    high: Fraction
    units: tuple[Array, Array]

    @property
    def middle(self) -> Fraction:
        """Where the float F is taken that makes tau of lambda_t."""
        return (self.low + self.high) / 2

    def at(self, low: Fraction, high: Fraction) -> PieceSpace:
        """A part of the piece, or a point of it, in the variables of the whole."""
        return PieceSpace.over(self.enclosure, (low, high), self.middle, self.units)

    @cached_property
    def whole(self) -> PieceSpace:
        """All of it."""
        return self.at(self.low, self.high)

    @cached_property
    def ends(self) -> tuple[PieceSpace, PieceSpace]:
        """Both ends."""
        return self.at(self.low, self.low), self.at(self.high, self.high)

    def margin(self, codes: Sequence[int], rows: Sequence[Row], values: Array, errors: float = 1.0) -> float:
        """Proven lower bound on the energy over a partial assignment and the piece; positive: there is no solution.

        With fixed multipliers the bound is concave in alpha, so that it is least at an end.
        """
        least = np.inf
        for end in self.ends:
            least = min(least, sector_margin(end, codes, rows, values, errors))
            if not least > 0:
                break
        return least

    def forces(self, y: Ball) -> Ball:
        """Forces in the units of the problem, (3p,), all normals first, of scaled ones."""
        system, (force, _), p = self.whole, self.units, len(self.units[0])
        found = Ball(np.zeros(3 * p), np.zeros(3 * p))
        # powers of two but for F: what is rounded besides is less than TINY
        found[:p] = Ball(y.mid[:p] * force, y.rad[:p] * force + TINY)
        for k in (0, 1):
            nodes = np.flatnonzero(system.tau[:, k] >= 0)
            part = y[system.tau[nodes, k]] * Ball(system.F[nodes, k], system.F_rad[nodes, k])
            found[(1 + k) * p + nodes] = Ball(part.mid * force[nodes], part.rad * force[nodes] + TINY)
        return found

    def displacements(self, y: Ball, w: Ball) -> Ball:
        """The same of displacements w, (3p,), at all alpha of the piece."""
        system, (_, length), p = self.whole, self.units, len(self.units[0])
        found = Ball(np.zeros(3 * p), np.zeros(3 * p))
        found[:p] = Ball(w.mid[:p] * length, w.rad[:p] * length + TINY)
        for k in (0, 1):
            nodes = np.flatnonzero(system.tau[:, k] >= 0)
            F = Ball(system.F[nodes, k], system.F_rad[nodes, k])
            size = length[nodes]
            part = w[system.tau[nodes, k]] * _inverse(F)
            found[(1 + k) * p + nodes] = Ball(part.mid * size, part.rad * size + TINY)
        # where there is no friction they follow from the forces
        missing = np.concatenate([(1 + k) * p + np.flatnonzero(system.tau[:, k] < 0) for k in (0, 1)])
        if len(missing):
            data = self.enclosure
            S, g0, g1 = Ball(data.S, data.S_rad), Ball(data.g0, data.g0_rad), Ball(data.g1, data.g1_rad)
            pushed = (S[missing] @ self.forces(y)[:, None])[:, 0]
            found[missing] = g0[missing] + self.alphas * g1[missing] - pushed
        return found

    @cached_property
    def alphas(self) -> Ball:
        """All alpha of the piece."""
        middle = float(self.middle)
        # the middle as a float, and ends rounded outwards
        off = max(self.high - Fraction(middle), Fraction(middle) - self.low)
        return Ball(np.array(middle), np.array(float(off) * (1.0 + 4 * UNIT) + TINY))

    def held(self, codes: Sequence[int]) -> SpaceRoot | Open | None:
        """What a leaf holds at every alpha of the piece: exactly one root, none (None), or it is not settled."""
        return settle(self.whole, codes)

    def has_one(self, numbers: Array, leaf: Sequence[int], wider: float, normal: Array, errors: float = 1.0) -> bool:
        """Whether there is exactly one solution at every alpha of the piece.

        Parameters
        ----------
        numbers : of the form (see ``SpaceWeights.of``)
        leaf : codes of a leaf that holds the solutions, or none: then they are near ``normal``
        wider : by how much of an angle its sectors are wider, on both sides
        normal : (p,) array, lambda_n, scaled
        """
        if leaf:
            return only_root(self.whole, numbers, leaf, errors, wider) is not None
        return only_solution_in_space(self.whole, numbers, normal, errors) is not None

    @cached_property
    def point(self) -> AlphaPiece:
        """The middle alone."""
        return AlphaPiece(self.enclosure, self.middle, self.middle, self.units)

    def meets(self, codes: Sequence[int], given: AlphaProblem, box: CurveBox, errors: float = 1.0) -> bool:
        """Whether the roots of a leaf, one at every alpha, are an arc that is in a box at the middle of the piece."""
        if not isinstance(self.held(codes), SpaceRoot):
            return False
        there = self.point.held(codes)
        return isinstance(there, SpaceRoot) and self.point.lies_in(self.point.place(there, given), box, errors)

    def holds_all(self, codes: Sequence[int], given: AlphaProblem, box: CurveBox, errors: float = 1.0) -> bool:
        """Whether all roots of a leaf are in a box, at every alpha of the piece."""
        found = self.held(codes)
        place = None if found is None else self.place(found, given)
        return found is None or self.lies_in(place, box, errors)

    def place(self, found: SpaceRoot | Open, given: AlphaProblem) -> Ball | None:
        """Bounds of (zeta, alpha) of what a leaf holds, (3p + 1,); None where there are none."""
        if found.y is None or found.w is None:
            return None
        zeta = given.coordinates(self.forces(found.y), self.displacements(found.y, found.w))
        return Ball.joined(zeta, self.alphas[None])

    def lies_in(self, place: Ball | None, box: CurveBox, errors: float = 1.0) -> bool:
        """Whether all points within bounds lie in a box around a curve.

        A point x lies in it if |t| <= h and |x - c - t d| <= b, t = e'(x - c); see ``CurveBox``.
        """
        if place is None:
            return False
        x = place - Ball.exact(box.centre)
        share = 1.0 - (errors - 1.0) * _MARGIN
        d, e, n = box.direction, box.border, len(box.centre)
        along = (Ball.exact(e[None, :]) @ x[:, None])[0, 0]
        if not (abs(along.mid) + along.rad) * SAFE <= share * box.half:
            return False
        # x - c - d e'(x - c), of every number once
        turn = Ball.exact(np.eye(n)) - Ball.exact(d[:, None]) * Ball.exact(e[None, :])
        beside = (turn @ x[:, None])[:, 0]
        return bool(np.all(beside.size * SAFE <= share * box.radius))


def _inverse(F: Ball) -> Ball:
    """1 / F of positive numbers."""
    inverse = 1.0 / F.mid
    # |1 / x - 1 / m| = |x - m| / (x m)
    return Ball(inverse, (F.rad / (F.mid - F.rad) * inverse + 4 * UNIT * inverse) * SAFE)
