"""Places where a regular root in 3D leaves the contact nodes, by its leaf (theory, section 13.2)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.arithmetic.balls import Ball, upper_norm
from enumsol.condensation.space_condensed import EnclosedSpace, FloatingSpace, SpaceSystem
from enumsol.model.sectors import DEEPEST, SECTORS, places
from enumsol.trusted.space.leaves import ROUNDED_ANGLE, Leaf, SpaceRoot, turned
from enumsol.trusted.space.sector_rows import FRICTIONLESS, OPEN, SLIP_MINUS, SLIP_PLUS, STICK

if TYPE_CHECKING:
    from collections.abc import Sequence
    from fractions import Fraction

    from enumsol.condensation.enclosure import CondensedEnclosure
    from enumsol.support.array_types import Floats

#: The level of the sectors around directions of slip, or that at which they are so many times as wide as these are
#: uncertain: narrow, so that the leaf contracts at once, and wide enough to hold the directions for certain.
_LEVEL, _SHARE = 17, 64.0
#: More than the angle between any two directions.
_ANY = 4.0


def leaf_positions(problem: Any, alpha: Fraction, forces: Ball, codes: Sequence[int]) -> Ball | None:
    """Bt u of the components with friction that move, (2p,) [length]; all others are unbounded.

    None where no leaf is proven to hold the root.

    Parameters
    ----------
    problem : ContactProblem3D
        Its slip offset may be a ball.
    alpha : Fraction
    forces : Ball of shape (3p,)
        lambda at the root, normal components first [force].
    codes : p status codes
        Statuses that hold for certain: open, stick, any other one for slip.
    """
    enclosure = problem.on_springs.enclosure
    enclosed, length = _scaled(problem, enclosure, alpha)
    p = enclosed.p
    pairs = forces[p:].mid.reshape(2, p).T, forces[p:].rad.reshape(2, p).T
    tau = Ball(*pairs) * enclosed.inverse_friction * Ball.exact(enclosed.tau_scale)
    size, wide = np.linalg.norm(tau.mid, axis=1), upper_norm(tau.rad, axis=1)
    # up to 1/2 arcsin is at most 1.05 times as large as its argument; otherwise any angle
    angle = np.where(wide < 0.5 * size, 1.1 * wide / np.where(size > 0, size, 1.0), _ANY)
    codes = [_code(*node) for node in zip(codes, enclosed.tau.tolist(), tau.mid.tolist(), angle.tolist(), strict=True)]
    along = np.isin(codes, (SLIP_PLUS, SLIP_MINUS))
    # along one axis the force's sign is known where its angle is
    if np.any(angle[along] >= _ANY):
        return None
    leaf = Leaf(enclosed, codes)
    root = leaf.settle()
    if not isinstance(root, SpaceRoot):
        return None
    # the root's directions lie where the leaf has no other one
    away = np.abs(turned(root.centre, tau.mid[leaf.turning])) + angle[leaf.turning] + ROUNDED_ANGLE
    if not np.all(away < root.reach):
        return None
    # no force and no direction depends on the offsets of components that move: without these w is where they move to
    moves = np.array([code != STICK for code in codes])
    beside = enclosure.without_offsets(np.concatenate([moves, moves]))
    w = Leaf(_scaled(problem, beside, alpha)[0], codes).displacements(root)
    if w is None:
        return None
    found = Ball(np.zeros(2 * p), np.full(2 * p, np.inf))
    for k in range(2):
        nodes = np.flatnonzero(moves & (enclosed.tau[:, k] >= 0))
        part = w[enclosed.tau[nodes, k]] * enclosed.inverse_friction[nodes, k]
        found[k * p + nodes] = Ball(part.mid * length[nodes], part.rad * length[nodes])
    return found


def _scaled(problem: Any, enclosure: CondensedEnclosure, alpha: Fraction) -> tuple[EnclosedSpace, Floats]:
    """The problem as balls, in units of forces and displacements of its own; the latter, (p,)."""
    system = SpaceSystem.scaled(enclosure.S, enclosure.moved_freely(alpha).mid, problem.friction_at(alpha))
    units = alpha, system.force, system.length
    if problem.modes is None:
        return EnclosedSpace.of_problem(enclosure, *units), system.length
    return FloatingSpace.of(problem, *units, enclosure), system.length


def _code(code: int, tau: Sequence[int], force: Sequence[float], angle: float) -> int:
    """The code of a leaf for a node whose tangential force over its coefficients is known but for an angle."""
    occurs = [k for k in range(2) if tau[k] >= 0]
    if code == OPEN or not occurs:
        return OPEN if code == OPEN else FRICTIONLESS
    if code == STICK:
        return STICK
    if len(occurs) == 1:
        return SLIP_PLUS if force[occurs[0]] > 0 else SLIP_MINUS
    level = max(2, min(_LEVEL, -math.ceil(math.log2(angle * _SHARE + 2.0**-_LEVEL))))
    place = math.floor(float(places(np.array(force))))
    return SECTORS + (1 << level) + (place >> (DEEPEST + 2 - level))
