"""The trusted test in 3D that a box holds exactly one solution, regular or not (theory, section 12.7).

Krawczyk's operator is applied to the natural map y - P(y + rho w), whose zeros are the solutions. P has corners where a
status changes; what counts is a set of matrices that holds all its derivatives in the box. Boxes bound forces
and displacements at once, by y - rho w.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, Ball, determinant_sign, smaller, solution, upper_sum
from enumsol.trusted.same_roots import told_apart
from enumsol.trusted.space.natural_map import MARGIN, Discs, Step, are_steps, middle_inverse
from enumsol.trusted.space.space_uniqueness import LARGEST_UNIT, LooseSolution

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from enumsol.condensation.space_condensed import EnclosedSpace
    from enumsol.support.array_types import Floats, Indices
    from enumsol.trusted.same_roots import Apart
    from enumsol.trusted.space.leaves import SpaceRoot

    _AnyLeaf = tuple[tuple[int, ...], "SpaceRoot | BoxedSolution"]


#: Steps towards the zero of a box, and halvings of a box that may hold too much.
_STEPS, _HALVINGS = 8, 24
#: Size of the box that is tried first, relative to the forces that would hold one node alone; and how often a set
#: around a box is made larger.
_FIRST, _WIDENINGS = 1.0, 6
#: Where rho is tried between compliance and stiffness, as an exponent of the latter.
_SHARES = 0.5, 1.0


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
        return cls(centre, radius, rho, _displacements(system, Ball.exact(centre)))

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
    if not _moderate(system) or not finite or not np.all(box.radius > 0) or not np.all(box.rho > 0):
        return None
    with np.errstate(all="ignore"):
        found = _NaturalMap.of(system, box.rho)
        return None if found is None else found.solution(box, errors)


def box_around(system: EnclosedSpace, y: Floats) -> Box | None:
    """A box, as large as is found, that seems to hold one solution, near scaled forces y; no claim."""
    if not _moderate(system) or not np.all(np.isfinite(y)):
        return None
    with np.errstate(all="ignore"):
        for rho in proposed_rho(system):
            found = _NaturalMap.of(system, rho)
            box = None if found is None else found.proposed(y)
            if box is not None:
                return box
    return None


def is_inside(y: Ball, w: Ball, box: Box, errors: float = 1.0) -> bool:
    """True if all solutions with such forces and displacements lie in a box (``errors``: see ``solution_in_box``)."""
    with np.errstate(all="ignore"):
        away = (y - Ball.exact(box.centre)) - Ball.exact(box.rho) * (w - box.w)
        share = 1.0 - (errors - 1.0) * MARGIN
        return bool(np.all(away.size * SAFE <= share * box.radius))


def _displacements(system: EnclosedSpace, y: Ball) -> Ball:
    S, g = Ball(system.S, system.S_rad), Ball(system.g, system.g_rad)
    return g - (S @ y[:, None])[:, 0]


def proposed_rho(system: EnclosedSpace) -> list[Floats]:
    """rho, one for lambda_n and one for tau of every node, scaled: between 1 / S_ii and the stiffness S^-1_ii."""
    soft = system.unit**2 / np.diagonal(system.S)
    try:
        stiff = np.diagonal(np.linalg.inv(system.S)) * system.unit**2
    except np.linalg.LinAlgError:
        return []
    found = []
    for share in _SHARES:
        rho = soft ** (1.0 - share) * stiff**share
        for t in system.tau:
            rho[t[t >= 0]] = np.min(rho[t[t >= 0]], initial=np.inf)
        found.append(rho / system.unit**2)
    return found


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


def _moderate(system: EnclosedSpace) -> bool:
    return bool(np.max(np.maximum(system.unit, 1.0 / system.unit)) <= LARGEST_UNIT)


@dataclass(frozen=True, eq=False)
class _NaturalMap:
    """N(y) = y - P(y + rho w) in (lambda_n, tau) without units (theory, (12.10)), y = c + T zeta, T = (I + rho S)^-1.

    rho is one number for lambda_n and one for tau of every node, the same for both components: which ones does not
    matter for what is proven.

    Attributes
    ----------
    S, g, T : Balls
    rho : (m,) array
    free : Ball
        2 T - I, by which y + rho w changes with zeta.
    """

    system: EnclosedSpace
    S: Ball
    g: Ball
    rho: Floats
    T: Ball
    free: Ball
    discs: Discs

    @classmethod
    def of(cls, system: EnclosedSpace, rho: Floats) -> _NaturalMap | None:
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
        if T is None or not T.finite:
            return None
        return cls(system, S, g, rho, T, T + T - whole, Discs(system.tau, Ball.exact(np.ones(len(system.tau)))))

    # -- boxes -----------------------------------------------------------------------------------------------------

    def solution(self, box: Box, errors: float) -> BoxedSolution | None:
        unit = self.system.unit
        centre = box.centre * unit
        found = self._mapped(centre, box.radius * unit, errors)
        # det T is positive, as S is positive definite
        index = 0 if found is None else determinant_sign(Ball.exact(found[0].Y))
        near = self._closer(centre) if index else None
        if near is None:
            return None
        y, w = near
        y, w = Ball(y.mid / unit, y.rad / unit * SAFE + TINY), Ball(w.mid * unit, w.rad * unit * SAFE + TINY)
        if not is_inside(y, w, box):
            return None
        gone = self._surely_open(w)
        y.mid[gone] = y.rad[gone] = 0.0
        return BoxedSolution.of(self.system, y, smaller(w, _displacements(self.system, y)), index, box=box)

    def proposed(self, y: Floats) -> Box | None:
        """A large box that holds one solution, around a point that is as near to it as floats can be."""
        unit = self.system.unit
        centre = self._zero(y * unit)
        if centre is None:
            return None
        radius = np.full(len(y), _FIRST * float(np.max(np.abs(self.g.mid) / np.diagonal(self.S.mid))))
        for _ in range(_HALVINGS):
            if self._mapped(centre, radius, 2.0) is not None:
                return Box.of(self.system, centre / unit, radius / unit, self.rho / unit**2)
            radius *= 0.5
        return None

    def _zero(self, point: Floats) -> Floats | None:
        """A zero of the natural map near a point, by Newton's method."""
        for _ in range(_STEPS):
            step = self._step(point, np.zeros(len(point)))
            if step is None:
                return None
            point = point + self.T.mid @ step.move.mid
        return point

    def _mapped(self, centre: Floats, radius: Floats, errors: float) -> tuple[Step, Floats] | None:
        """The step around a box, and a reach of zeta, with which it maps a set that holds the box into its interior."""
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

    def _closer(self, centre: Floats) -> tuple[Ball, Ball] | None:
        """Bounds of y and w of a solution near a point, as narrow as floats can give; None where none is proven."""
        point = self._zero(centre)
        near = None if point is None else self._step(point, np.zeros(len(centre)))
        if point is None or near is None:
            return None
        radius = np.full(len(point), 4.0 * float(np.max(near.move.size)) + TINY)
        for _ in range(_STEPS):
            found = self._mapped(point, radius, 1.0)
            if found is not None:
                return self._placed(point, found[1])
            radius *= 4.0
        return None

    def _placed(self, centre: Floats, reach: Floats) -> tuple[Ball, Ball]:
        """y and w where |zeta| <= reach: w = w_c - S T zeta, and rho S T = I - T."""
        y, w = self._forces_and_displacements(centre)
        moved = Ball.exact(np.eye(len(centre))) - self.T
        slips = upper_sum(moved.size * reach, axis=1) / self.rho * SAFE
        return Ball(y.mid, upper_sum(self.T.size * reach, axis=1) * SAFE), Ball(w.mid, (w.rad + slips) * SAFE)

    def _forces_and_displacements(self, centre: Floats) -> tuple[Ball, Ball]:
        point = Ball.exact(centre)
        return point, self.g - (self.S @ point[:, None])[:, 0]

    def _surely_open(self, w: Ball) -> Indices:
        """Places of the forces of nodes that are open at every solution with such displacements."""
        tau = self.discs.tau
        gone = [i for i in range(len(tau)) if w.mid[i] + w.rad[i] < 0]
        return np.array([k for i in gone for k in (i, *tau[i]) if k >= 0], dtype=np.intp)

    # -- the operator ----------------------------------------------------------------------------------------------

    def _step(self, centre: Floats, radius: Floats) -> Step | None:
        """Krawczyk's operator for |zeta| <= radius; None where its middle matrix is singular."""
        point, w = self._forces_and_displacements(centre)
        z = point + Ball.exact(self.rho) * w
        wide = Ball(z.mid, (z.rad + upper_sum(self.free.size * radius, axis=1)) * SAFE)
        corners = self.discs.corners(wide)
        if corners is None:
            return None
        found = middle_inverse(self.T - corners.core @ self.free)
        if found is None:
            return None
        Y, E = found
        inverse = Ball.exact(Y)
        move = (inverse @ (self.discs.projected(z) - point)[:, None])[:, 0]
        G, V = inverse @ Ball.exact(corners.u), Ball.exact(corners.v.T) @ self.free
        nothing = np.zeros(len(V.mid))
        return Step(move, E, G, V, Y, np.zeros(len(centre)), nothing, nothing)
