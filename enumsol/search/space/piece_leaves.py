"""Leaves over a piece of alpha in 3D: records of those that are decided by known curves (theory, section 12.9).

Nothing here is trusted: what is proposed is proven, or the tree goes on.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from enumsol.model.sectors import DEEPEST, SECTORS, level_of, parts_around, places, span, width_of
from enumsol.proof.curve_records import OnCurve, ThroughCurveBox
from enumsol.proof.leaves import NoRoot
from enumsol.search.space.curve_proposals import curve_point, unplaced
from enumsol.search.space.piece_multipliers import unbalanced
from enumsol.search.space.space_fathoming import without_sectors

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from enumsol.proof.records import Record
    from enumsol.search.space.known_curves import Curves
    from enumsol.search.space.piece_certificates import ExaminedPiece
    from enumsol.support.array_types import Codes, Floats, Mask
    from enumsol.trusted.space.curve_runs import CurveParts, KnownCurve
    from enumsol.trusted.space.leaves import Open, SpaceRoot
    from enumsol.trusted.space.pieces import AlphaPiece, LeafArc
    from enumsol.trusted.space.solution_curve import AlphaProblem

#: Around the directions of known curves sectors get more room by this share of what these turn by, and are no narrower
#: than those of a level; a sector is cut so if no more than this share of it is left.
_ROOM, _NARROWEST, _LEFT = 0.5, 9, 0.5


def _turning(codes: Codes) -> list[int]:
    return [i for i, code in enumerate(codes) if code > SECTORS]


def slides(parts: CurveParts, codes: Codes) -> Mask:
    """Mask of the parts of a curve where a leaf's statuses hold and those in sectors do not always stick, (N,)."""
    return np.asarray(parts.held(without_sectors(codes)) & ~np.any(parts.sticking[:, _turning(codes)], axis=1))


def beside(parts: CurveParts, codes: Codes, centre: Floats, angle: Floats | float, radius: Floats) -> NDArray[np.intp]:
    """Parts of a curve that have the statuses of a leaf, and directions within angles from those at its middle."""
    there = np.flatnonzero(slides(parts, codes))
    if not len(there):
        return there
    theta = parts.thetas[0][there][:, _turning(codes)]
    turned = np.arctan2(centre[:, 0] * theta[:, :, 1] - centre[:, 1] * theta[:, :, 0], np.sum(centre * theta, axis=2))
    return there[np.all(np.abs(turned - angle) < radius, axis=1)]


def points_on(arc: LeafArc, known: KnownCurve, parts: CurveParts, codes: Codes) -> list[tuple[Fraction, Codes]]:
    """Points of a curve that seem to be on the arc of a leaf, as alphas and leaves of narrow sectors."""
    chosen, found = beside(parts, codes, arc.centre, arc.angle, arc.radius), []
    # in the middle of the parts, then at a quarter from their ends
    for k in [chosen[int(share * (len(chosen) - 1))] for share in (0.5, 0.25, 0.75)] if len(chosen) else []:
        box = known.chain.links[parts.links[k]].curve.box
        near = curve_point(known.problem, box.centre + parts.t.mid[k] * box.direction, box.border)
        if near is not None:
            found.append((Fraction(float(near.x[-1])), _narrow(known.problem, near.x, codes, _turning(codes))))
    return found


def _narrow(problem: AlphaProblem, x: Floats, codes: Codes, nodes: Sequence[int]) -> Codes:
    """A leaf of narrow sectors around a solution, (zeta, alpha)."""
    leaf, p = list(codes), len(codes)
    y = (unplaced(problem, x)[:-1] / problem.ratio.mid)[p : 3 * p].reshape(2, p)
    for i in nodes:
        # sectors of this level around the point, or narrower ones
        up = DEEPEST + 2 - max(12, level_of(codes[i] - SECTORS))
        leaf[i] = SECTORS + (1 << (DEEPEST + 2 - up)) + (int(places(y[:, i])) >> up)
    return tuple(leaf)


def around_curves(at: ExaminedPiece, codes: Codes, curves: Sequence[KnownCurve]) -> tuple[int, Sequence[int]] | None:
    """A node in a sector, and the part of that around the directions of known curves, then what is left of it."""
    nodes = [i for i, code in enumerate(codes) if code > SECTORS]
    towards = [parts.thetas[0][slides(parts, codes)][:, nodes] for _, parts in at.along(curves)]
    where = np.concatenate([places(theta) for theta in towards]) if nodes and towards else np.zeros((0, 0))
    spans = np.array([span(codes[i] - SECTORS) for i in nodes], dtype=float).reshape(-1, 2)
    where = where[np.all((where >= spans[:, 0]) & (where < spans[:, 1]), axis=1)] if len(where) else where
    if not len(where):
        return None
    low, high = np.min(where, axis=0), np.max(where, axis=0)
    room = np.maximum(_ROOM * (high - low), np.ldexp(1.0, DEEPEST + 2 - _NARROWEST))
    k = int(np.argmax((spans[:, 1] - spans[:, 0]) / (high - low + room)))
    number, half = codes[nodes[k]] - SECTORS, 0.5 * float(room[k])
    level = DEEPEST + 2 - math.floor(math.log2(half))
    children = parts_around(number, low[k] - half, high[k] + half, level)
    if width_of(children[0]) > _LEFT * width_of(number):
        return None
    return nodes[k], [SECTORS + child for child in children]


class PieceLeaves:
    """Records of leaves that known curves decide.

    Parameters
    ----------
    curves : Curves
    interval : (a, b), Fractions
    """

    def __init__(self, curves: Curves, interval: tuple[Fraction, Fraction]) -> None:
        self._curves, self._interval = curves, interval

    def settled(
        self, at: ExaminedPiece, codes: Codes, piece: AlphaPiece, found: SpaceRoot | Open | None
    ) -> Record | None:
        """The record of a leaf that has no root, or none that is not known; ``found`` is what it holds over a piece."""
        if found is None:
            return NoRoot()
        if (without := unbalanced(at.piece, codes)) is not None:
            return without
        run = self._curves.run(piece, found)
        return self._on_arc(at, codes, piece, found) if run is None else OnCurve(*run)

    def through(
        self,
        piece: AlphaPiece,
        codes: Codes,
        found: SpaceRoot | Open,
        number: int,
        point: tuple[Fraction, Codes, SpaceRoot],
    ) -> ThroughCurveBox | None:
        """The record of a leaf whose arc has a point, an alpha with the leaf and the root there, in a curve's box."""
        alpha, there, root = point
        if not self._curves.runs_through(number, piece):
            return None
        # as a checker has it: no wider than is needed
        arc = piece.arc(codes, found=found)
        if arc is None or not arc.has(root, there):
            return None
        return ThroughCurveBox(number, str(piece.low), str(piece.high), str(alpha), there)

    def _on_arc(self, at: ExaminedPiece, codes: Codes, piece: AlphaPiece, held: SpaceRoot | Open) -> Record | None:
        """The record of a leaf whose roots lie on an arc that has a point of a known curve."""
        half = np.abs(held.angle) + held.angle_rad
        # as long as it is, then by its length longer on both sides
        for factor in 0, 1:
            whole = piece.wider(factor, self._interval)
            runs = at.along(self._curves.known, whole)
            # directions of a known curve in the leaf, or somewhat beside it
            if not any(len(beside(parts, codes, held.centre, 0.0, 1.5 * half)) for _, parts in runs):
                continue
            found = whole.held(codes) if factor else held
            arc = None if found is None else whole.arc(codes, 2.0, found)
            if found is None or arc is None:
                continue
            for known, parts in runs:
                for alpha, there in points_on(arc, known, parts, codes):
                    place, root = whole.root_at(alpha, there)
                    number = None if root is None else self._curves.box(place, root)
                    if root is None or number is None or not arc.has(root, there):
                        continue
                    record = self.through(whole, codes, found, number, (alpha, there, root))
                    if record is not None:
                        return record
        return None
