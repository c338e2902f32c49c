"""The trusted test in 3D that a box at one alpha holds exactly one solution, regular or not (theory, section 12.7).

Boxes bound forces and displacements at once, by y - rho w.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, Ball, determinant_sign, smaller, solution
from enumsol.trusted.at_alpha import told_apart
from enumsol.trusted.space.krawczyk import MARGIN, NaturalMap
from enumsol.trusted.space.natural_map import Discs, are_steps, upper_product
from enumsol.trusted.space.space_uniqueness import LooseSolution, displacements, moderate_units

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from enumsol.condensation.space_condensed import EnclosedSpace
    from enumsol.support.array_types import Floats
    from enumsol.trusted.at_alpha import Apart
    from enumsol.trusted.space.leaves import SpaceRoot

    _AnyLeaf = tuple[tuple[int, ...], "SpaceRoot | BoxedSolution"]


#: Steps towards the zero of a box: with more the bounds of a solution are hardly narrower.
_STEPS = 8


@dataclass(frozen=True, eq=False)
class Box:
    """The y with |(y - c) - rho (w - w_c)| <= r, component by component; scaled.

    Attributes
    ----------
    centre, radius, rho : (m,) arrays
    w : Ball of shape (m,)
        The displacements w_c of the centre.
    """

    centre: Floats
    radius: Floats
    rho: Floats
    w: Ball

    @classmethod
    def of(cls, system: EnclosedSpace, centre: Floats, radius: Floats, rho: Floats) -> Box:
        """The box of one problem."""
        return cls(centre, radius, rho, displacements(system, Ball.exact(centre)))

    @property
    def numbers(self) -> tuple[Floats, Floats, Floats]:
        """Centre, radius and rho."""
        return self.centre, self.radius, self.rho


@dataclass(frozen=True)
class BoxedSolution(LooseSolution):
    """The one solution in a box; its index is +1 or -1."""

    box: Box


def solution_in_box(system: EnclosedSpace, box: Box, errors: float = 1.0) -> BoxedSolution | None:
    """The only solution in a box, or None where that is not proven.

    Parameters
    ----------
    system : EnclosedSpace
        S is proven positive definite.
    box : Box
        Its radius and rho are positive; both components of tau of a node have the same rho but for units.
    errors : 1 proves; a writer of proofs takes more, so that a checker comes to the same answer
    """
    finite = all(np.all(np.isfinite(numbers)) for numbers in box.numbers)
    if not moderate_units(system.unit) or not finite or not np.all(box.radius > 0) or not np.all(box.rho > 0):
        return None
    with np.errstate(all="ignore"):
        found = BoxProblem.of(system, box.rho)
        return None if found is None else found.solution(box, errors)


def is_inside(y: Ball, w: Ball, box: Box, errors: float = 1.0) -> bool:
    """True if all solutions with such forces and displacements lie in a box (``errors``: see ``solution_in_box``)."""
    with np.errstate(all="ignore"):
        away = (y - Ball.exact(box.centre)) - Ball.exact(box.rho) * (w - box.w)
        share = 1.0 - (errors - 1.0) * MARGIN
        return bool(np.all(away.size * SAFE <= share * box.radius))


def apart_in_boxes(regular: Sequence[_AnyLeaf], boxed: Iterable[_AnyLeaf]) -> Apart[_AnyLeaf]:
    """Leaves by their solutions in boxes, without those whose solutions are among regular ones.

    A solution that lies in the box of another one is that one; where bounds of forces do not meet there are two. The
    result does not depend on the order in which the leaves are given.
    """
    return told_apart(sorted(boxed, key=lambda leaf: leaf[0]), lambda a, b: _same(a[1], b[1]), regular)


def _same(one: SpaceRoot | BoxedSolution, other: SpaceRoot | BoxedSolution) -> bool | None:
    """True if two solutions are the same; None where that is open."""
    if np.any(np.abs(one.y.mid - other.y.mid) > (one.y.rad + other.y.rad) * SAFE):
        return False
    pairs = ((one, other), (other, one))
    inside = any(isinstance(b, BoxedSolution) and is_inside(a.y, a.w, b.box) for a, b in pairs)
    return True if inside else None


@dataclass(frozen=True, eq=False)
class BoxProblem:
    """A problem at one alpha in (lambda_n, tau) without units, with y = c + T zeta and T = (I + rho S)^-1.

    rho is one number for lambda_n and one for tau of every node, the same for both components: which ones does not
    matter for what is proven. See theory, section 12.7.

    Attributes
    ----------
    S, g, T : Balls
    rho : (m,) array
    """

    system: EnclosedSpace
    S: Ball
    g: Ball
    rho: Floats
    T: Ball

    @classmethod
    def of(cls, system: EnclosedSpace, rho: Floats) -> BoxProblem | None:
        """With these rho, scaled; None where they do not serve or T is not enclosed."""
        # powers of two: what is rounded is less than TINY
        pair = np.outer(system.unit, system.unit)
        S = Ball(system.S / pair, system.S_rad / pair * SAFE + TINY)
        g = Ball(system.g / system.unit, system.g_rad / system.unit * SAFE + TINY)
        rho = rho * system.unit**2
        if not are_steps(rho, system.tau):
            return None
        whole = Ball.exact(np.eye(len(rho)))
        T = solution(whole + S * Ball.exact(rho[:, None]), whole)
        return None if T is None or not T.finite else cls(system, S, g, rho, T)

    def around(self, centre: Floats) -> NaturalMap:
        """The natural map around a point, without border; no argument of F."""
        m, y = len(centre), Ball.exact(centre)
        z, none = y + Ball.exact(self.rho) * self._w(centre), Ball.exact(np.zeros((1, m)))
        moves = Ball.joined(self.T + self.T - Ball.exact(np.eye(m)), none)
        return NaturalMap(
            self.T, moves, y, Ball.joined(z, none[0, :1]), self._discs, np.zeros(m), 0.0, np.zeros((0, m))
        )

    def _discs(self, _: Ball) -> Discs:
        p = len(self.system.tau)
        return Discs(self.system.tau, Ball.exact(np.ones(p)), np.zeros(p))

    def _w(self, centre: Floats) -> Ball:
        return self.g - (self.S @ Ball.exact(centre)[:, None])[:, 0]

    def zero(self, point: Floats) -> Floats | None:
        """A zero of the natural map near a point, by Newton's method."""
        for _ in range(_STEPS):
            near = self.around(point)
            step = near.step(near.extent())
            if step is None:
                return None
            point = point + self.T.mid @ (step.move.mid + step.G.mid @ step.first)
        return point

    def solution(self, box: Box, errors: float) -> BoxedSolution | None:
        """The one solution in a box, or None where that is not proven."""
        unit = self.system.unit
        found = self.around(box.centre * unit).mapped(box.radius * unit, errors)
        # det T is positive, as S is positive definite
        index = 0 if found is None else determinant_sign(Ball.exact(found.step.Y))
        near = self._closer(box.centre * unit) if index else None
        if near is None:
            return None
        y, w = near
        y, w = Ball(y.mid / unit, y.rad / unit * SAFE + TINY), Ball(w.mid * unit, w.rad * unit * SAFE + TINY)
        if not is_inside(y, w, box):
            return None
        for i in np.flatnonzero(w.mid[: len(self.system.tau)] + w.rad[: len(self.system.tau)] < 0):
            # open at every solution with such displacements
            gone = [i, *(t for t in self.system.tau[i] if t >= 0)]
            y.mid[gone] = y.rad[gone] = 0.0
        return BoxedSolution.of(self.system, y, smaller(w, displacements(self.system, y)), index, box=box)

    def _closer(self, centre: Floats) -> tuple[Ball, Ball] | None:
        """Bounds of y and w of a solution near a point, as narrow as floats can give; None where none is proven."""
        point = self.zero(centre)
        near = None if point is None else self.around(point)
        step = None if near is None else near.step(near.extent())
        if point is None or near is None or step is None:
            return None
        size = step.move.size + np.abs(step.G.mid @ step.first)
        radius = np.full(len(point), 4.0 * float(np.max(size)) + TINY)
        for _ in range(_STEPS):
            found = near.mapped(radius, 1.0)
            if found is not None:
                return self._placed(point, found.reach)
            radius *= 4.0
        return None

    def _placed(self, centre: Floats, reach: Floats) -> tuple[Ball, Ball]:
        """y and w where |zeta| <= reach: w = w_c - S T zeta, and rho S T = I - T."""
        w, moved = self._w(centre), Ball.exact(np.eye(len(centre))) - self.T
        slips = upper_product(moved.size, reach) / self.rho * SAFE
        return Ball(centre, upper_product(self.T.size, reach) * SAFE), Ball(w.mid, (w.rad + slips) * SAFE)
