"""The trusted test in 3D that a box of forces holds exactly one solution, regular or not (theory, section 12.7).

Krawczyk's operator is applied to the natural map y - P(y + rho w), whose zeros are the solutions. P has corners where a
status changes; what counts is a set of matrices that holds all its derivatives in the box.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.ball_arrays import Ball, determinant_sign
from enumsol.arithmetic.balls import SAFE, TINY, upper_sum
from enumsol.trusted.space.natural_map import MARGIN, Discs, Step, middle_inverse
from enumsol.trusted.space.space_uniqueness import LARGEST_UNIT, LooseSolution

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from enumsol.condensation.space_condensed import EnclosedSpace
    from enumsol.trusted.space.leaves import SpaceRoot

    Array = NDArray[np.float64]

#: Steps towards the zero of a box, and halvings of a box that may hold too much.
_STEPS, _HALVINGS = 8, 24
#: Size of the box that is tried first, relative to the forces that would hold one node alone; and how often a set
#: around a box is made larger.
_FIRST, _WIDENINGS = 1.0, 6


@dataclass(frozen=True)
class BoxedSolution(LooseSolution):
    """The one solution in a box of forces, of shape (m,); its index is +1 or -1."""

    box: Ball


def solution_in_box(system: EnclosedSpace, box: Ball, errors: float = 1.0) -> BoxedSolution | None:
    """The only solution in a box of scaled forces, or None where that is not proven.

    Parameters
    ----------
    system : EnclosedSpace
    box : Ball of shape (m,), with positive radii
    errors : 1 proves; a writer of proofs takes more, so that a checker comes to the same answer
    """
    if not _moderate(system) or not np.all(np.isfinite(box.mid)) or not np.all(box.rad > 0):
        return None
    with np.errstate(all="ignore"):
        return _NaturalMap(system).solution(box, errors)


def box_around(system: EnclosedSpace, y: Array) -> Ball | None:
    """A box of scaled forces, as large as is found, that seems to hold one solution, near y; no claim."""
    if not _moderate(system) or not np.all(np.isfinite(y)):
        return None
    with np.errstate(all="ignore"):
        return _NaturalMap(system).proposed(y)


def is_inside(y: Ball, box: Ball, errors: float = 1.0) -> bool:
    """Whether all of a ball lies in a box (for ``errors`` see ``solution_in_box``)."""
    share = 1.0 - (errors - 1.0) * MARGIN
    return bool(np.all((np.abs(y.mid - box.mid) + y.rad) * SAFE <= share * box.rad))


def apart_in_boxes(
    regular: Sequence[SpaceRoot], boxed: Iterable[tuple[tuple[int, ...], BoxedSolution]]
) -> tuple[list[tuple[tuple[int, ...], BoxedSolution]], list[tuple[int, ...]]]:
    """Solutions of boxes, each once, that are not among regular ones; and leaves of those that may be all the same.

    A solution that lies in the box of another one is that one; where bounds of forces do not meet there are two. The
    result does not depend on the order in which the leaves are given.
    """
    kept: list[tuple[tuple[int, ...], BoxedSolution]] = []
    doubtful = []
    for codes, one in sorted(boxed, key=lambda leaf: leaf[0]):
        answers = [_same(other, one) for other in regular] + [_same(one, other) for _, other in kept]
        if True in answers:
            continue
        if None in answers:
            doubtful.append(codes)
        kept.append((codes, one))
    return kept, doubtful


def _same(one: SpaceRoot | BoxedSolution, other: BoxedSolution) -> bool | None:
    """Whether two solutions are the same; None where that is open."""
    if np.any(np.abs(one.y.mid - other.y.mid) > (one.y.rad + other.y.rad) * SAFE):
        return False
    inside = is_inside(one.y, other.box) or (isinstance(one, BoxedSolution) and is_inside(other.y, one.box))
    return True if inside else None


def _moderate(system: EnclosedSpace) -> bool:
    return bool(np.max(np.maximum(system.unit, 1.0 / system.unit)) <= LARGEST_UNIT)


class _NaturalMap:
    """N(y) = y - P(y + rho w) in (lambda_n, tau) without units (theory, (12.10)).

    rho is one number for lambda_n and one for tau of every node: which ones does not matter for what is proven.
    """

    def __init__(self, system: EnclosedSpace) -> None:
        self.system = system
        self.unit = system.unit
        # powers of two: what is rounded is less than TINY
        pair = np.outer(self.unit, self.unit)
        self.S = Ball(system.S / pair, system.S_rad / pair * SAFE + TINY)
        self.g = Ball(system.g / self.unit, system.g_rad / self.unit * SAFE + TINY)
        self.tau = [places[places >= 0] for places in system.tau]
        rho = 1.0 / np.diagonal(self.S.mid)
        for t in self.tau:
            rho[t] = np.min(rho[t], initial=np.inf)
        self.rho = rho
        moved = self.S * Ball.exact(rho[:, None])
        self.free = Ball.exact(np.eye(len(rho))) - moved
        self._discs = Discs(self.tau, Ball.exact(np.ones(len(self.tau))))

    # -- boxes -----------------------------------------------------------------------------------------------------

    def solution(self, box: Ball, errors: float) -> BoxedSolution | None:
        centre, radius = box.mid * self.unit, box.rad * self.unit
        found = self._mapped(centre, radius, errors)
        index = 0 if found is None else determinant_sign(Ball.exact(found[0].Y))
        y = self._closer(centre) if index else None
        if y is None or not is_inside(y, Ball(centre, radius)):
            return None
        y = Ball(y.mid / self.unit, y.rad / self.unit * SAFE + TINY)
        gone = self._surely_open(self._displacements(y))
        y.mid[gone] = y.rad[gone] = 0.0
        return BoxedSolution.of(self.system, y, self._displacements(y), index, box=box)

    def _displacements(self, y: Ball) -> Ball:
        S, g = Ball(self.system.S, self.system.S_rad), Ball(self.system.g, self.system.g_rad)
        return g - (S @ y[:, None])[:, 0]

    def proposed(self, y: Array) -> Ball | None:
        """A large box that holds one solution, around a point that is as near to it as floats can be."""
        centre = self._zero(y * self.unit)
        if centre is None:
            return None
        radius = np.full(len(y), _FIRST * float(np.max(np.abs(self.g.mid) * self.rho)))
        for _ in range(_HALVINGS):
            if self._mapped(centre, radius, 2.0) is not None:
                return Ball(centre / self.unit, radius / self.unit)
            radius *= 0.5
        return None

    def _zero(self, point: Array) -> Array | None:
        """A zero of the natural map near a point, by Newton's method."""
        for _ in range(_STEPS):
            step = self._step(point, np.zeros(len(point)))
            if step is None:
                return None
            point = point + step.move.mid
        return point

    def _mapped(self, centre: Array, radius: Array, errors: float) -> tuple[Step, Array] | None:
        """The step around a box, and shares, with which it maps a set that holds the box into its interior."""
        reach = radius
        for _ in range(_WIDENINGS):
            step = self._step(centre, reach)
            shares = None if step is None else step.shares(radius)
            if step is None or shares is None:
                return None
            needed = step.reach(radius, shares)
            if np.all(needed <= reach):
                return (step, reach) if step.contracts(radius, shares, errors) else None
            reach = np.maximum(reach, needed) * (1.0 + MARGIN)
        return None

    def _closer(self, centre: Array) -> Ball | None:
        """Bounds of a solution near a point, as narrow as floats can give; None where none is proven to be there."""
        point = self._zero(centre)
        near = None if point is None else self._step(point, np.zeros(len(centre)))
        if point is None or near is None:
            return None
        radius = np.full(len(point), 4.0 * float(np.max(near.move.size)) + TINY)
        for _ in range(_STEPS):
            found = self._mapped(point, radius, 1.0)
            if found is not None:
                return Ball(point, found[1])
            radius *= 4.0
        return None

    def _surely_open(self, w: Ball) -> NDArray[np.intp]:
        """Places of the forces of nodes that are open at every solution with such displacements."""
        gone = [i for i in range(len(self.tau)) if w.mid[i] + w.rad[i] < 0]
        return np.array([k for i in gone for k in (i, *self.tau[i])], dtype=np.intp)

    # -- the operator ----------------------------------------------------------------------------------------------

    def _step(self, centre: Array, radius: Array) -> Step | None:
        """Krawczyk's operator in a box; None where its middle matrix is singular."""
        m = len(centre)
        point = Ball.exact(centre)
        w = self.g - (self.S @ point[:, None])[:, 0]
        z = point + Ball.exact(self.rho) * w
        wide = Ball(z.mid, (z.rad + upper_sum(self.free.size * radius, axis=1)) * SAFE)
        corners = self._discs.corners(wide)
        if corners is None:
            return None
        M = Ball.exact(np.eye(m)) - corners.core @ self.free
        found = middle_inverse(M)
        if found is None:
            return None
        Y, E = found
        inverse = Ball.exact(Y)
        move = (inverse @ (self._discs.projected(z) - point)[:, None])[:, 0]
        G, V = inverse @ Ball.exact(corners.u), Ball.exact(corners.v.T) @ self.free
        nothing = np.zeros(len(V.mid))
        return Step(move, E, G, V, Y, np.zeros(m), nothing, nothing)
