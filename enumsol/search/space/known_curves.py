"""Curves of solutions that a tree over alpha knows, their boxes, and leaves that they decide (theory, section 12.9).

Nothing here is trusted: what is proposed is proven, or the tree goes on.
"""

from __future__ import annotations

import math
from fractions import Fraction
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.balls import Ball
from enumsol.arithmetic.rationals import simplest
from enumsol.model.sectors import DEEPEST, SECTORS, holding, level_of, parts_around, places, span, width_of
from enumsol.proof.curve_records import OnCurve, ThroughCurveBox
from enumsol.proof.leaves import NoRoot
from enumsol.search.certifiers.protocol import ERRORS
from enumsol.search.outcome import joined
from enumsol.search.space.curve_proposals import curve_point, placed, unplaced
from enumsol.search.space.space_fathoming import without_sectors
from enumsol.trusted.space.pieces import lie_along

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from enumsol.proof.records import Record
    from enumsol.search.space.piece_proposals import AlphaPoint, ExaminedPiece
    from enumsol.support.array_types import Codes, Floats, Mask
    from enumsol.trusted.space.curve_runs import CurveChain, CurveParts
    from enumsol.trusted.space.leaves import Open, SpaceRoot
    from enumsol.trusted.space.pieces import AlphaPiece, LeafArc
    from enumsol.trusted.space.solution_curve import AlphaProblem

    Bounds = tuple[Fraction, Fraction]

#: Pieces of undecided statuses at most at which a first curve is sought.
_SOUGHT = 8
#: Around the directions of known curves sectors get more room by this share of what these turn by, and are no narrower
#: than those of a level; a sector is cut so if no more than this share of it is left.
_ROOM, _NARROWEST, _LEFT = 0.5, 9, 0.5


class CurveWantedError(Exception):
    """A tree goes on with another curve, if there is one.

    Attributes
    ----------
    x : (m + 1,) array or None
        A solution, forces and alpha in the units of the problem, through which it is wanted; None: through any.
    """

    def __init__(self, x: Floats | None) -> None:
        super().__init__()
        self.x = x


class Curves:
    """Curves that are known over an interval of alpha, and for what further ones were asked.

    Parameters
    ----------
    given : AlphaProblem
    interval : (a, b), Fractions

    Attributes
    ----------
    known : list of CurveChain
    ends : list of (Fraction, Fraction)
        Ranges of alpha around the ends of curves, in their order.
    sampled : bool
        Curves through any solutions were asked for.
    final : bool
        No further curve is to be followed.
    tried : set of (low, high, codes)
        Pieces of alpha and leaves at whose middle a curve was asked for; no codes where no status was known.
    interval : as given
    """

    def __init__(self, given: AlphaProblem, interval: Bounds) -> None:
        self._given, self.interval = given, interval
        self.sampled = self.final = False
        self.tried: set[tuple[Fraction, Fraction, Codes]] = set()
        self.known: list[CurveChain] = []
        self.ends: list[Bounds] = []
        #: The curve of every box, numbered as in a proof, and which one of its links it is.
        self._boxes: list[tuple[CurveChain, int]] = []

    # -- further curves --------------------------------------------------------------------------------------------

    def take(self, chain: CurveChain) -> None:
        """Add a curve to those that are known."""
        self._boxes += [(chain, k) for k in range(len(chain.links))]
        self.known.append(chain)
        curves = [link.curve for known in self.known for link in known.links]
        boxes = [curve.box for curve in curves]
        self._c, self._d, self._e = (
            np.array([getattr(box, name) for box in boxes]) for name in ("centre", "direction", "border")
        )
        self._b = np.array([curve.reach for curve in curves])
        self._h = np.array([box.half for box in boxes])
        # so near to the ends of curves nothing is searched
        room = Fraction(2.0**-14) * (self.interval[1] - self.interval[0])
        ends = [end for curve in self.known for end in curve.gaps]
        whole = joined((low - room, high + room) for low, high in ends)
        self.ends = [(simplest(low, low + room / 2), simplest(high - room / 2, high)) for low, high in whole]

    def sample(self) -> None:
        """Ask for curves through any solutions, once."""
        if not self.sampled:
            raise CurveWantedError(None)

    @property
    def sought_enough(self) -> bool:
        """True if no further curve through the middle of a piece of undecided statuses is asked for."""
        return sum(not codes for _, _, codes in self.tried) >= _SOUGHT

    def seek(self, piece: AlphaPiece, middle: AlphaPoint) -> None:
        """Ask for a curve through a solution in the middle of a piece, if one is found there, once."""
        if self.sought_enough or (piece.low, piece.high, ()) in self.tried:
            return
        forces = middle.solution()
        self._ask(piece, (), None if forces is None else np.append(forces, float(middle.alpha)))

    def _ask(self, piece: AlphaPiece, codes: Codes, x: Floats | None) -> None:
        """Ask for a curve through a solution once; none is where a known one seems to pass through it."""
        asked = piece.low, piece.high, codes
        if asked in self.tried:
            return
        self.tried.add(asked)
        if x is not None and not self.final and not self.is_known(x):
            raise CurveWantedError(x)

    # -- boxes -----------------------------------------------------------------------------------------------------

    def is_known(self, x: Floats) -> bool:
        """True if a solution seems to lie on a known curve; no claim."""
        if not self._boxes:
            return False
        return bool(np.any(self._around(placed(self._given, x), np.zeros_like(x))))

    def _around(self, x: Floats, rad: Floats) -> Mask:
        """Which boxes seem to hold a point, and all that is within a radius of it along t; no claim."""
        off = x - self._c
        t = np.sum(self._e * off, axis=1)
        beside = np.abs(off - t[:, None] * self._d)
        along = np.abs(t) + np.abs(self._e) @ rad
        return np.asarray((along <= self._h) & np.all(beside <= self._b, axis=1))

    def run(self, piece: AlphaPiece, found: SpaceRoot | Open) -> tuple[int, int] | None:
        """The first and the last of the boxes in which forces lie."""
        for ends in piece.places(found, self._given) if self._boxes else ():
            sides = [np.flatnonzero(self._around(end.mid, end.rad)).tolist() for end in ends]
            runs = {(min(pair), max(pair)) for pair in product(sides[0], sides[-1])}
            # a few rows of boxes of one curve, the shortest first, and no longer ones
            for first, last in sorted(runs, key=lambda run: run[1] - run[0])[:4]:
                (one, begin), (other, end) = self._boxes[first], self._boxes[last]
                near = one is other and last - first < 64
                if near and lie_along(ends, [link.curve for link in one.links[begin : end + 1]], ERRORS):
                    return first, last
        return None

    def box(self, piece: AlphaPiece, found: SpaceRoot | Open) -> int | None:
        """The box in which a root in a point of alpha lies."""
        run = self.run(piece, found)
        return None if run is None or run[0] != run[1] else run[0]

    def met(self, piece: AlphaPiece, codes: Codes, root: SpaceRoot) -> int | None:
        """The box of a root of a leaf in a point of alpha; where there is none, a curve is asked for once."""
        number = self.box(piece, root)
        if number is None:
            self._ask(piece, codes, middle_of(piece, root))
        return number

    def runs_through(self, number: int, piece: AlphaPiece) -> bool:
        """True if the curve of a box has no end over a piece."""
        return self._boxes[number][0].runs_through(piece.low, piece.high)


def middle_of(piece: AlphaPiece, root: SpaceRoot) -> Floats:
    """Forces and alpha of a root in the middle of a piece, in the units of the problem.

    Of a body that nothing holds the forces are followed by its rigid displacement.
    """
    y = root.y if root.rigid is None else Ball.joined(root.y, -root.rigid)
    return np.concatenate([piece.forces(y).mid, piece.rigid(y).mid, [float(piece.middle)]])


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


def points_on(arc: LeafArc, known: CurveChain, parts: CurveParts, codes: Codes) -> list[tuple[Fraction, Codes]]:
    """Points of a curve that seem to be on the arc of a leaf, as alphas and leaves of narrow sectors."""
    chosen, found = beside(parts, codes, arc.centre, arc.angle, arc.radius), []
    # in the middle of the parts, then at a quarter from their ends
    for k in [chosen[int(share * (len(chosen) - 1))] for share in (0.5, 0.25, 0.75)] if len(chosen) else []:
        box = known.links[parts.links[k]].curve.box
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
        leaf[i] = SECTORS + holding(y[:, i], max(12, level_of(codes[i] - SECTORS)))
    return tuple(leaf)


def around_curves(at: ExaminedPiece, codes: Codes, curves: Sequence[CurveChain]) -> tuple[int, Sequence[int]] | None:
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


def settled(
    curves: Curves, at: ExaminedPiece, codes: Codes, piece: AlphaPiece, found: SpaceRoot | Open | None
) -> Record | None:
    """The record of a leaf that has no root, or none that is not known; ``found`` is what it holds over a piece."""
    if found is None:
        return NoRoot()
    if (without := at.unbalanced(codes)) is not None:
        return without
    run = curves.run(piece, found)
    return _on_arc(curves, at, codes, piece, found) if run is None else OnCurve(*run)


def through(
    curves: Curves,
    piece: AlphaPiece,
    codes: Codes,
    found: SpaceRoot | Open,
    number: int,
    point: tuple[Fraction, Codes, SpaceRoot],
) -> ThroughCurveBox | None:
    """The record of a leaf whose arc has a point, an alpha with the leaf and the root there, in a curve's box."""
    alpha, there, root = point
    if not curves.runs_through(number, piece):
        return None
    # as a checker has it: no wider than is needed
    arc = piece.arc(codes, found=found)
    if arc is None or not arc.has(root, there):
        return None
    return ThroughCurveBox(number, str(piece.low), str(piece.high), str(alpha), there)


def _on_arc(
    curves: Curves, at: ExaminedPiece, codes: Codes, piece: AlphaPiece, held: SpaceRoot | Open
) -> Record | None:
    """The record of a leaf whose roots lie on an arc that has a point of a known curve."""
    half = np.abs(held.angle) + held.angle_rad
    # as long as it is, then by its length longer on both sides
    for factor in 0, 1:
        whole = piece.wider(factor, curves.interval)
        runs = at.along(curves.known, whole)
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
                number = None if root is None else curves.box(place, root)
                if root is None or number is None or not arc.has(root, there):
                    continue
                record = through(curves, whole, codes, found, number, (alpha, there, root))
                if record is not None:
                    return record
    return None
