"""Points of known curves for leaves in 3D whose solutions are one arc (theory, section 12.9).

Nothing here is trusted: what is proposed is proven, or the tree goes on.
"""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from enumsol.model.sectors import DEEPEST, SECTORS, level_of, places
from enumsol.search.space.space_fathoming import without_sectors
from enumsol.trusted.space.solution_curve import curve_point

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from enumsol.support.array_types import Codes, Floats, Mask
    from enumsol.trusted.space.curve_runs import CurveParts, KnownCurve
    from enumsol.trusted.space.leaf_arcs import LeafArc
    from enumsol.trusted.space.solution_curve import AlphaProblem

#: Where points are taken, as shares of a curve's parts in a leaf, and the level of the sectors around them.
_PLACES, _POINTED = (0.5, 0.25, 0.75), 12


def _turning(codes: Codes) -> list[int]:
    return [i for i, code in enumerate(codes) if code > SECTORS]


def slides(parts: CurveParts, codes: Codes) -> Mask:
    """In which parts of a curve the statuses of a leaf hold, and those in sectors do not stick all the time, (N,)."""
    return np.asarray(parts.held(without_sectors(codes)) & ~np.any(parts.sticking[:, _turning(codes)], axis=1))


def beside(parts: CurveParts, codes: Codes, centre: Floats, angle: Floats | float, radius: Floats) -> NDArray[np.intp]:
    """Which parts of a curve have the statuses of a leaf, and directions within angles from those at its middle."""
    there = np.flatnonzero(slides(parts, codes))
    if not len(there):
        return there
    theta = parts.thetas[0][there][:, _turning(codes)]
    turned = np.arctan2(centre[:, 0] * theta[:, :, 1] - centre[:, 1] * theta[:, :, 0], np.sum(centre * theta, axis=2))
    return there[np.all(np.abs(turned - angle) < radius, axis=1)]


def points_on(arc: LeafArc, known: KnownCurve, parts: CurveParts, codes: Codes) -> list[tuple[Fraction, Codes]]:
    """Points of a curve that seem to be on the arc of a leaf, as alphas and leaves of narrow sectors."""
    chosen, found = beside(parts, codes, arc.centre, arc.angle, arc.radius), []
    for k in [chosen[int(share * (len(chosen) - 1))] for share in _PLACES] if len(chosen) else []:
        box = known.chain.links[parts.links[k]].curve.box
        near = curve_point(known.problem, box.centre + parts.t.mid[k] * box.direction, box.border)
        if near is not None:
            found.append((Fraction(float(near.x[-1])), _narrow(known.problem, near.x, codes, _turning(codes))))
    return found


def _narrow(problem: AlphaProblem, x: Floats, codes: Codes, nodes: Sequence[int]) -> Codes:
    """A leaf of narrow sectors around a solution, (zeta, alpha)."""
    leaf, p = list(codes), len(codes)
    y = (problem.unplaced(x)[:-1] / problem.ratio.mid)[p : 3 * p].reshape(2, p)
    for i in nodes:
        up = DEEPEST + 2 - max(_POINTED, level_of(codes[i] - SECTORS))
        leaf[i] = SECTORS + (1 << (DEEPEST + 2 - up)) + (int(places(y[:, i])) >> up)
    return tuple(leaf)
