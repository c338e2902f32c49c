"""What stands in the way of a leaf in 3D that is not settled, what is halved for it, and boxes that hold its solution.

Nothing here is trusted.
"""

from __future__ import annotations

from enum import Enum
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.balls import nearly_singular
from enumsol.search.certifiers.protocol import ERRORS
from enumsol.search.reduction import NEAR
from enumsol.search.space.space_fathoming import Point
from enumsol.search.space.space_newton import Isotropic
from enumsol.trusted.space.boxed_solution import Box, BoxedSolution, BoxProblem, is_inside, solution_in_box
from enumsol.trusted.space.leaf_equations import with_free_bounds
from enumsol.trusted.space.leaves import Open, settle
from enumsol.trusted.space.space_uniqueness import moderate_units
from enumsol.trusted.space.turning import turned_by

if TYPE_CHECKING:
    from enumsol.condensation.space_condensed import EnclosedSpace, SpaceSystem
    from enumsol.support.array_types import Floats
    from enumsol.trusted.space.leaves import LastBox

#: Boxes of directions narrower than this hold a point, and forces known no better are not known; neither is halved for.
_POINT = 2.0**-24
#: Directions that change no G by more (scaled) are not halved, nor for a linear system that they change by no more.
_NEGLIGIBLE, _SINGULAR = 2.0**-44, 2.0**-36


class Cause(Enum):
    """Why a leaf is not settled."""

    EQUALITY = "a condition holds with equality, or nearly so, at what may be a root"
    DIRECTIONS = "slip directions are not isolated, or hardly so, at what may be a root: a fold or a continuum is near"
    EQUATIONS = "the equations of its statuses are singular, or nearly so, for some slip directions: the body may wedge"
    RIGID = "the equations of its statuses leave the body free to move as a whole, or nearly so"
    ROUNDING = "rounding leaves the forces there open: the body is almost free to move"


def obstacle(found: Open) -> tuple[Cause, int | None]:
    """The cause in the middle of the leaf's last box, and the rigid mode that is free for it, if one is."""
    last = found.last
    if last is None:
        return Cause.EQUALITY, None
    leaf, angle, modes = last.leaf, last.angle, len(last.leaf.system.reach)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        point = leaf.over(angle, np.zeros(len(angle)))
        if last.state is None or point is None:
            return (Cause.RIGID, _free_mode(last)) if modes else (Cause.EQUATIONS, None)
        if modes and leaf.free and nearly_singular(point.J.mid):
            return Cause.RIGID, _free_mode(last)
        if not np.all(point.y.rad <= _POINT):
            return Cause.ROUNDING, None
        return (Cause.DIRECTIONS if len(angle) and nearly_singular(point.J.mid) else Cause.EQUALITY), None


def _free_mode(last: LastBox) -> int:
    """The rigid mode that moves most along what the equations in the middle leave free."""
    leaf, angle = last.leaf, last.angle
    point, q = leaf.over(angle, np.zeros(len(angle))), len(leaf.turning)
    if leaf.free and point is not None and point.J.finite:
        along = np.linalg.svd(point.J.mid)[2][-1][q:]
        return leaf.free[int(np.argmax(np.abs(along)))] - len(leaf.system.g)
    _, _, rows = np.linalg.svd(leaf.middle_matrix(turned_by(leaf.centre, angle[:q])[0]))
    return int(np.argmax(np.abs(rows[-1][-len(leaf.system.reach) :])))


def sector_to_halve(found: Open) -> int | None:
    """The node whose sector is to be halved, the widest; None where that is not expected to help."""
    last = found.last
    if last is None:
        return None
    q = len(last.leaf.turning)
    if not q or (last.state is not None and np.all(last.radius[:q] < _POINT)):
        return None
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        worth = _worth_halving(last)
    return last.leaf.turning[int(np.argmax(worth))] if np.any(worth) else None


def _worth_halving(last: LastBox) -> Floats:
    """Gains expected of halving each sector; 0 where smaller ones would be left open, too."""
    leaf, angle, radius, state = last.leaf, last.angle, last.radius, last.state
    point, q = leaf.over(angle, np.zeros(len(angle))), len(leaf.half)
    if state is not None and point is not None and np.all(point.y.rad <= _POINT):
        # the width, where it changes more than what is not known anyway
        known = np.maximum(_NEGLIGIBLE, point.G.rad)[:, None]
        moves = np.any(state.J.size * radius > known, axis=0)
        # what free unknowns may be depends on all directions
        return np.where(moves[:q] | np.any(moves[q:]), leaf.half, 0.0)
    # the change of the linear system, where it keeps that from being regular
    if not leaf.rows:
        return leaf.half
    widths = leaf.directions(angle, radius)[0].rad / leaf.system.unit[leaf.t]
    changes = np.max(np.sum(np.abs(leaf.system.balls[0].mid[leaf.rows][:, leaf.t]) * widths, axis=2), axis=0)
    turning = leaf.equations(angle)
    worth = changes if turning is None else np.max(turning.coupling(radius[:q]), axis=0)
    return worth if changes[int(np.argmax(worth))] > _SINGULAR else np.zeros_like(worth)


def is_swept(found: Open) -> bool:
    """True if rather the piece of alpha stands in the way than the widths of sectors."""
    last = found.last
    if last is None or not last.leaf.piece:
        return False
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        return _changes_along_piece(last)


def _changes_along_piece(last: LastBox) -> bool:
    """True if dG/dpsi changes more along the piece than over the angles."""
    leaf, angle, radius, state = last.leaf, last.angle, last.radius, last.state
    if not np.all(np.isfinite(radius)):
        # whether a free unknown would be bounded in the middle of the piece
        cut = with_free_bounds(leaf, angle, radius, still=True)
        return cut is None or bool(np.all(np.isfinite(cut[1])))
    point = leaf.over(angle, 0.0 * radius, still=True)
    if point is None or not len(angle):
        return True
    if state is None or not state.J.finite:
        return leaf.over(angle, radius, still=True) is not None
    try:
        Y = np.asarray(np.linalg.inv(point.J.mid), dtype=np.float64)
    except np.linalg.LinAlgError:
        return False
    over = leaf.second(Y, (state, point), angle, radius)
    turned, swept = (np.max(part[:, :-1] @ radius / radius) for part in over)
    return bool(swept > turned)


class KnownBoxes:
    """Looks for the solution near a leaf that is left open, and for a box in which it is the only one.

    A leaf that would be halved otherwise is worth a look now and then: less and less often where that is in vain.

    Parameters
    ----------
    system : SpaceSystem
    enclosed : EnclosedSpace
    """

    def __init__(self, system: SpaceSystem, enclosed: EnclosedSpace) -> None:
        self._system, self._enclosed = system, enclosed
        self._found: list[BoxedSolution] = []
        self._passed: list[Floats] = []
        self._wait = self._pause = 0

    @cached_property
    def _problem(self) -> Isotropic:
        return Isotropic.of(self._system)

    def holding(self, leaf: Open, *, halved: bool) -> BoxedSolution | None:
        """The one solution that an open leaf can have, which is ``halved`` otherwise, if that is proven."""
        y, w = leaf.y, leaf.w
        if y is None or w is None:
            return None
        for known in self._found:
            if is_inside(y, w, known.box, ERRORS):
                return known
        if halved:
            # forces known no better than this, relative to the largest, tell no solution near which to look
            if not np.max(y.rad) <= 0.1 * np.max(np.abs(y.mid) + y.rad):
                return None
            if self._wait > 0:
                self._wait -= 1
                return None
        found = self._sought(y.mid, halved=halved)
        self._pause = 2 * self._pause + 1 if found is None else 0
        self._wait = self._pause
        return found if found is not None and is_inside(y, w, found.box, ERRORS) else None

    def _sought(self, y: Floats, *, halved: bool) -> BoxedSolution | None:
        """A new solution near a point, in a box of its own; near a leaf to be ``halved``, one that no leaf settles."""
        with np.errstate(all="ignore"):
            found, unit = self._problem.near(y * self._system.unit), self._system.unit
            if found is None:
                return None
            near = found / unit
            # nearer ones are the same solution
            size = 1e-6 * float(np.max(np.abs(near)))
            if any(np.max(np.abs(near - other)) <= size for other in self._passed):
                return None
            point = Point.of(self._system, self._problem, near * unit)
            self._passed.append(near)
            # a regular root is settled by a leaf that is narrow enough, unless rounding hides it
            if halved and point.slack > NEAR and not isinstance(settle(self._enclosed, point.codes), Open):
                return None
            box = box_around(self._enclosed, near)
        proven = None if box is None else solution_in_box(self._enclosed, box, ERRORS)
        if proven is not None:
            self._found.append(proven)
        return proven


# -- boxes that may hold one solution (theory, section 12.7) -----------------------------------------------------------

#: Size of the box that is tried first, by the forces that would hold one node alone, and how often it is halved.
_FIRST, _HALVINGS = 1.0, 24
#: Where rho is tried between compliance and stiffness, as an exponent of the latter.
_SHARES = 0.5, 1.0


def box_around(system: EnclosedSpace, y: Floats) -> Box | None:
    """A box, as large as is found, that seems to hold one solution, near scaled forces y."""
    if not moderate_units(system.unit) or not np.all(np.isfinite(y)):
        return None
    with np.errstate(all="ignore"):
        for rho in proposed_rho(system):
            problem = BoxProblem.of(system, rho)
            centre = None if problem is None else problem.zero(y * system.unit)
            if problem is None or centre is None:
                continue
            near = problem.around(centre)
            radius = np.full(len(y), _FIRST * float(np.max(np.abs(problem.g.mid) / np.diagonal(problem.S.mid))))
            for _ in range(_HALVINGS):
                if near.mapped(radius, ERRORS) is not None:
                    return Box.of(system, centre / system.unit, radius / system.unit, rho)
                radius *= 0.5
    return None


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
