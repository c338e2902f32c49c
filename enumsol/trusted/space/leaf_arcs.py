"""The trusted test that the solutions of a leaf in 3D over a piece of alpha are one arc (theory, section 12.9)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, Ball
from enumsol.trusted.space.leaf_conditions import by_parameter, chosen_parameter, condition_rates, slacks
from enumsol.trusted.space.leaf_equations import (
    ROUNDED_ANGLE,
    Leaf,
    around_middle,
    patterns,
    turned,
    with_free_bounds,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.condensation.space_condensed import EnclosedSpace
    from enumsol.support.array_types import Codes, Floats
    from enumsol.trusted.space.leaves import Open, SpaceRoot

#: How often the box of an arc is made wider, and by how much more than is needed.
_WIDENINGS, _ROOM = 6, 1.125
#: What a writer of proofs asks for beyond what a checker does, of the size of a box.
_MARGIN = 2.0**-10


@dataclass(frozen=True, eq=False)
class LeafArc:
    """Solutions with the statuses of a leaf over a piece of alpha, those of the leaf among them, that are one arc.

    Attributes
    ----------
    statuses : codes, one for all sectors
    centre : (q, 2) array
        A direction for every node in a sector.
    angle, radius : (q,) arrays
        All solutions with these statuses, with angles up to ``radius`` from ``angle``, are on the arc; of a body that
        nothing holds, those within the bounds of its rigid displacement.
    """

    statuses: Codes
    centre: Floats
    angle: Floats
    radius: Floats

    def has(self, root: SpaceRoot, codes: Codes) -> bool:
        """True if the root of a leaf, at an alpha of the piece, is on the arc."""
        if patterns(codes) != self.statuses:
            return False
        shift = turned(self.centre, root.centre)
        away = np.abs(shift + root.angle - self.angle) + root.angle_rad + ROUNDED_ANGLE
        return bool(np.all(away <= self.radius))


def arc_of(system: EnclosedSpace, codes: Sequence[int], found: SpaceRoot | Open, errors: float = 1.0) -> LeafArc | None:
    """The arc on which all solutions of a leaf over a piece of alpha lie, as a connected part of it.

    Parameters
    ----------
    system : over a piece of alpha
    codes : complete
    found : what ``settle`` says of the leaf
    errors : 1 proves; a writer of proofs takes more
    """
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        leaf, box = Leaf(system, codes), (found.angle, found.angle_rad, 1.0 + (errors - 1.0) * _MARGIN)
        arc = _arc_in(leaf, *box)
        loosened = leaf.loosened() if arc is None else None
        return arc if loosened is None else _arc_in(loosened, *box)


def _box_of_all(leaf: Leaf, angle: Floats, radius: Floats) -> tuple[Floats, Floats] | None:
    """A box of all unknowns but s that holds all zeros with angles in a box; None if there is none, or no such."""
    if not leaf.free:
        return angle, radius
    cut = with_free_bounds(leaf, np.r_[angle, np.zeros(len(leaf.room))], np.r_[radius, leaf.room])
    return cut if cut is not None and np.all(np.isfinite(cut[1])) else None


def _arc_in(leaf: Leaf, angle: Floats, radius: Floats, errors: float) -> LeafArc | None:
    """The arc, if every condition holds all along it or changes its sign once at most.

    Zeros z = (psi, s) of the equations are a graph over one of these unknowns, z_k: with (12.22d), u being the other
    ones, the right-hand side maps a box of u into its interior for every z_k, so that there is one zero for each of
    them, and these are an arc. A normal force that is left free is between psi and s, and so are rigid modes that the
    equations leave free. ``angle``, ``radius``: a box that holds the directions of all solutions.
    """
    box = _box_of_all(leaf, angle, radius) if leaf.piece else None
    if box is None:
        return None
    (angle, radius), turning, q = box, len(angle), len(box[0])
    point = leaf.over(angle, 0.0 * radius, still=True)
    chosen = None if point is None or not point.whole_J.finite else chosen_parameter(point, radius)
    if point is None or chosen is None:
        return None
    k, Y = chosen
    others = np.delete(np.arange(q + 1), k)
    psi = others[others < q]
    for _ in range(_WIDENINGS):
        state, sizes = leaf.over(angle, radius), np.r_[radius, 1.0]
        if state is None or not state.whole_J.finite:
            return None
        room, reach = sizes[others], Ball(np.zeros(1), sizes[k : k + 1])[0]
        left, along, start = around_middle(leaf, Y, k, (angle, radius), (state, point))
        beside = left @ Ball(np.zeros(q), room) + start
        needed = (beside + along * reach).size * errors
        if np.all(needed < room) or (k < q and not needed[-1] < 1.0):
            break
        radius = radius.copy()
        radius[psi] = np.maximum(radius[psi], _ROOM * needed[: len(psi)])
        # solutions at wider angles may have other forces
        cut = _box_of_all(leaf, angle[:turning], radius[:turning])
        if cut is None:
            return None
        radius[turning:] = np.maximum(radius, (np.abs(cut[0] - angle) + cut[1]) * SAFE)[turning:]
    # u' = (I - Y J_u) u' - Y J_k, and I - Y J_u is a contraction in the norm of the box
    wide = left.size @ room * SAFE
    share = 1.0 - float(np.max(wide / room, initial=0.0)) * SAFE
    if state is None or not (np.all(needed < room) and share > 0):
        return None
    most = float(np.max(along.size / room, initial=0.0)) / share * SAFE
    rate = Ball(along.mid, (along.rad + wide * most) * SAFE + TINY)
    m, over = len(leaf.E), (state, point)
    middle, turn = by_parameter(leaf, over, k, beside, along)
    bounds, rates = middle + turn * reach, by_parameter(leaf, over, k, beside, rate)[1]
    s_rate = rate[-1] if k < q else Ball.exact(np.array(1.0))
    holding = slacks(leaf, bounds[:m], bounds[m:], angle, radius) > 0
    mid, rad = condition_rates(leaf, bounds[:m], (rates[:m], rates[m:], s_rate), angle, radius)
    if not np.all(holding | (np.abs(mid) > rad * errors * SAFE)):
        return None
    return LeafArc(patterns(leaf.codes), leaf.centre, angle[:turning], radius[:turning])
