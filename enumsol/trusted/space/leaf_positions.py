"""Places where a regular root in 3D leaves the contact nodes, by its leaf (theory, section 13.2)."""

from __future__ import annotations

from math import ceil, log2
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, Ball, upper_norm, upper_sum
from enumsol.condensation.enclosure import enclosure_of
from enumsol.condensation.space_condensed import EnclosedSpace, SpaceSystem
from enumsol.model.restart import SlipStart, restarted
from enumsol.trusted.space.leaf_equations import ROUNDED_ANGLE, Leaf, State, turned
from enumsol.trusted.space.leaves import SpaceRoot, contents
from enumsol.trusted.space.sector_rows import SLIP_MINUS, SLIP_PLUS, STICK, leaf_code
from enumsol.trusted.space.turning import held_by

if TYPE_CHECKING:
    from collections.abc import Sequence
    from fractions import Fraction

    from enumsol.support.array_types import Floats, Indices

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
    enclosure = enclosure_of(problem)
    system = SpaceSystem.scaled(enclosure.S, enclosure.moved_freely(alpha).mid, problem.friction_at(alpha))
    units, length = (alpha, system.force, system.length), system.length
    enclosed = EnclosedSpace.of_problem(enclosure, *units)
    p = enclosed.p
    pairs = forces[p:].mid.reshape(2, p).T, forces[p:].rad.reshape(2, p).T
    tau = Ball(*pairs) * enclosed.inverse_friction * Ball.exact(enclosed.tau_scale)
    size, wide = np.linalg.norm(tau.mid, axis=1), upper_norm(tau.rad, axis=1)
    # up to 1/2 arcsin is at most 1.05 times as large as its argument; otherwise any angle
    angle = np.where(wide < 0.5 * size, 1.1 * wide / np.where(size > 0, size, 1.0), _ANY)
    nodes = zip(codes, enclosed.tau.tolist(), tau.mid.tolist(), angle.tolist(), strict=True)
    codes = [
        leaf_code(code, places, force, max(2, min(_LEVEL, -ceil(log2(wide * _SHARE + 2.0**-_LEVEL)))))
        for code, places, force, wide in nodes
    ]
    along = np.isin(codes, (SLIP_PLUS, SLIP_MINUS))
    # along one axis the force's sign is known where its angle is
    if np.any(angle[along] >= _ANY):
        return None
    leaf = Leaf(enclosed, codes)
    root = contents(leaf)
    if not isinstance(root, SpaceRoot):
        return None
    # the root's directions lie where the leaf has no other one
    away = np.abs(turned(root.centre, tau.mid[leaf.turning])) + angle[leaf.turning] + ROUNDED_ANGLE
    if not np.all(away < root.reach):
        return None
    # no force and no direction depends on the offsets of components that move: without these w is where they move to
    moves = np.array([code != STICK for code in codes])
    middle = problem if problem.offset_radius is None else restarted(problem, SlipStart(problem.slip_offset))
    known = enclosure_of(middle)
    without = known.without_offsets(np.concatenate([moves, moves]))
    near, beside = (Leaf(EnclosedSpace.of_problem(balls, *units), codes) for balls in (known, without))
    w = _moved(leaf, root, near, beside, _spread(problem, enclosed, length))
    if w is None:
        return None
    found, still = enclosed.displacements_of(w, length)[p:], ~np.concatenate([moves, moves])
    found.mid[still], found.rad[still] = 0.0, np.inf
    return found


def _spread(problem: Any, enclosed: EnclosedSpace, length: Floats) -> Floats:
    """Distance by which the slip offset may be from its middle, scaled, (m,)."""
    spread = np.zeros(len(enclosed.g))
    for k in range(2 if problem.offset_radius is not None else 0):
        nodes = np.flatnonzero(enclosed.tau[:, k] >= 0)
        far = (enclosed.F + enclosed.F_rad)[nodes, k] * problem.offset_radius[nodes, k] / length[nodes]
        spread[enclosed.tau[nodes, k]] = np.where(far > 0, far * SAFE + TINY, 0.0)
    return spread


def _moved(leaf: Leaf, root: SpaceRoot, middle: Leaf, beside: Leaf, spread: Floats) -> Ball | None:
    """Displacements w of ``beside`` at the root, for every offset in a ball (theory, section 13.2), or None.

    Parameters
    ----------
    leaf : Leaf
        For all slip offsets in the ball.
    root : SpaceRoot
        Of this leaf.
    middle, beside : Leaf
        The same for the middle of the ball, and without the offsets of components that move.
    spread : (m,) array
        How far offsets are from there at most.
    """
    angle, reach, m = root.angle, root.angle_rad, len(leaf.system.g)
    if root.rigid is not None:
        # coordinates of modes that are left free are unknowns beside the directions, of the other sign
        free = -root.rigid[np.array(leaf.free, dtype=np.intp) - m]
        angle, reach = np.r_[angle, free.mid], np.r_[reach, free.rad]
    over, point, start = leaf.over(angle, reach), middle.over(angle, 0.0 * reach), beside.over(angle, 0.0 * reach)
    by_load = _by_load(leaf, angle, load := np.flatnonzero(spread))
    if over is None or by_load is None or point is None or start is None or not over.J.finite:
        return None
    try:
        Y = Ball.exact(_slopes(point).mid @ np.linalg.inv(point.J.mid))
    except np.linalg.LinAlgError:
        return None
    (w, G), own = by_load, ~np.isin(load, leaf.rows)
    w[:, own] = 0.0
    found = start.w + (_slopes(over) - Y @ over.J) @ Ball(0.0 * reach, reach) - Y @ point.G
    wide = upper_sum((w - Y @ G).size * spread[load], axis=1)
    return Ball(found.mid, (found.rad + wide) * SAFE)[:m]


def _by_load(leaf: Leaf, angle: Floats, load: Indices) -> tuple[Ball, Ball] | None:
    """Changes by one unit more of some rows of the load to w and to G, (m, k) and (q, k), directions held."""
    turning, q = leaf.equations(angle), len(leaf.turning)
    if turning is None:
        return None
    E, columns = Ball.exact(leaf.E.copy()), np.zeros((len(leaf.E), len(load)))
    columns[load, np.arange(len(load))] = 1.0
    at = leaf.t, np.array(leaf.column, dtype=np.intp)[:, None]
    E.mid[at], E.rad[at] = turning.d, turning.off[:, None]
    SE = leaf.system.balls[0] @ E
    found = held_by(SE[leaf.rows], SE, Ball.exact(columns), leaf.rows)
    if found is None:
        return None
    w, (d, _) = found[1], leaf.directions(angle, np.zeros(q))
    v1, v2 = leaf.slips(w)
    return w, Ball.joined(v1 * d[:, 1][:, None] - v2 * d[:, 0][:, None], w[leaf.free])


def _slopes(state: State) -> Ball:
    """Derivatives of w by all unknowns beside x."""
    return Ball.beside(state.box.dw, state.box.ds)
