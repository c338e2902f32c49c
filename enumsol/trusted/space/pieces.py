"""The trusted core in 3D over a piece of alpha: no solution, all in a box, or on one arc (theory, section 12.9)."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from math import ceil, floor
from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball
from enumsol.trusted.space.force_bound import is_unbalanced_in_space
from enumsol.trusted.space.krawczyk import MARGIN, WIDENINGS
from enumsol.trusted.space.leaf_equations import (
    Leaf,
    around_middle,
    by_parameter,
    chosen_parameter,
    condition_rates,
    patterns,
    slacks,
    with_free_bounds,
)
from enumsol.trusted.space.leaves import Open, SpaceRoot, settle
from enumsol.trusted.space.sector_margins import swept_margin
from enumsol.trusted.space.space_uniqueness import is_complete, only_on_curve

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.condensation.space_condensed import AlphaSpace, EnclosedSpace
    from enumsol.support.array_types import Codes, Floats
    from enumsol.trusted.space.curve_runs import CurveChain, LinkRange
    from enumsol.trusted.space.sector_rows import Row
    from enumsol.trusted.space.solution_curve import AlphaProblem, SolutionCurve

#: By how much more than is needed the box of an arc is made wider.
_ROOM = 1.125
#: How often a piece is narrowed for a leaf, to which multiples of its half, and where that is too little.
_NARROWINGS, _GRID, _NARROWER = 8, 1 << 12, Fraction(3, 2)
#: Halvings of the way through a box.
_STEPS = 16


@dataclass(frozen=True, eq=False)
class AlphaPiece:
    """A problem over a piece of alpha.

    Attributes
    ----------
    space : AlphaSpace
    low, high : Fraction
    """

    space: AlphaSpace
    low: Fraction
    high: Fraction

    @property
    def middle(self) -> Fraction:
        """Middle of the piece."""
        return (self.low + self.high) / 2

    @cached_property
    def whole(self) -> EnclosedSpace:
        """The data over all of it."""
        return self.space.over(self.low, self.high)

    @cached_property
    def ends(self) -> tuple[EnclosedSpace, EnclosedSpace]:
        """The data at both ends."""
        return self.space.at(self.low), self.space.at(self.high)

    def margin(
        self, codes: Sequence[int], rows: Sequence[Row], values: Floats | tuple[Floats, Floats], errors: float = 1.0
    ) -> float:
        """Proven lower bound on the energy over a partial assignment and the piece; positive: there is no solution.

        ``values`` are the multipliers of rows at both ends, between which they are affine in alpha.
        """
        return swept_margin(self.ends, self.space.at(self.middle), codes, rows, (values[0], values[1]), errors)

    def is_unbalanced(self, codes: Sequence[int], z: Floats) -> bool:
        """True if at no alpha of the piece any forces below a partial assignment are in balance with the load, by z.

        Of a body that nothing holds.
        """
        return all(not end.held and is_unbalanced_in_space(end, codes, z) for end in self.ends)

    def forces(self, y: Ball) -> Ball:
        """Forces in the units of the problem, (3p,), all normals first, of scaled ones."""
        return self.space.fixed.forces_of(y, self.space.units[0])

    def displacements(self, y: Ball, w: Ball, alpha: Ball) -> Ball:
        """Bounds of displacements w, (3p,), at all alpha of a ball; y of ``rigid``."""
        system, p = self.space.fixed, len(self.space.units[0])
        found = system.displacements_of(w, self.space.units[1])
        # where there is no friction they follow from the forces
        missing = np.concatenate([(1 + k) * p + np.flatnonzero(system.tau[:, k] < 0) for k in (0, 1)])
        if len(missing):
            data = self.space.enclosure
            S, g0, g1 = Ball(data.S, data.S_rad), Ball(data.g0, data.g0_rad), Ball(data.g1, data.g1_rad)
            pushed = (S[missing] @ self.forces(y)[:, None])[:, 0]
            found[missing] = g0[missing] + alpha * g1[missing] - pushed
            if not system.held:
                found[missing] = found[missing] + (self.space.moved[missing] @ self.rigid(y)[:, None])[:, 0]
        return found

    @cached_property
    def alphas(self) -> Ball:
        """All alpha of the piece."""
        middle = float(self.middle)
        # the middle as a float, and ends rounded outwards
        off = max(self.high - Fraction(middle), Fraction(middle) - self.low)
        return Ball(np.array(middle), np.array(float(off) * (1.0 + 4 * UNIT) + TINY))

    def held(self, codes: Sequence[int]) -> SpaceRoot | Open | None:
        """Answer for a leaf at every alpha of the piece: exactly one root, none (None), or it is not settled."""
        return settle(self.whole, codes)

    def narrowed(self, codes: Sequence[int]) -> tuple[AlphaPiece, SpaceRoot | Open | None]:
        """A part of the piece with all alpha at which a leaf holds roots, and what it holds there."""
        piece, found = self, self.held(codes)
        for _ in range(_NARROWINGS):
            if not isinstance(found, Open) or piece.low == piece.high:
                break
            low, high = (
                Fraction(end(share * _GRID), _GRID) for end, share in zip((floor, ceil), found.span, strict=True)
            )
            if high - low > _NARROWER:
                break
            middle, half = piece.middle, (piece.high - piece.low) / 2
            ends = middle + max(low, Fraction(-1)) * half, middle + min(high, Fraction(1)) * half
            if ends[0] == ends[1]:
                break
            piece = AlphaPiece(self.space, *ends)
            found = piece.held(codes)
        return piece, found

    def lies_on(
        self, known: CurveChain, run: LinkRange, codes: Sequence[int], numbers: Floats, errors: float = 1.0
    ) -> bool:
        """True if all solutions with the statuses of an assignment, at every alpha of the piece, are those of a run.

        Parameters
        ----------
        known, run : links of a curve that pass every alpha of the piece
        codes : (partial) status codes; a sector counts as contact
        numbers : of the form (see ``PieceWeights.of``)
        errors : see ``only_on_curve``
        """
        if not known.passes(run, self.low, self.high):
            return False
        parts = known.over(run, self.low, self.high)
        return only_on_curve(self.whole, (self.low, self.high), codes, numbers, parts, errors)

    @cached_property
    def point(self) -> AlphaPiece:
        """The middle alone."""
        return self.over(self.middle, self.middle)

    def wider(self, factor: int, interval: tuple[Fraction, Fraction]) -> AlphaPiece:
        """The piece and so many times its length on both sides, as far as that is within an interval."""
        more = factor * (self.high - self.low)
        low, high = max(self.low - more, interval[0]), min(self.high + more, interval[1])
        return AlphaPiece(self.space, low, high) if factor else self

    def over(self, low: Fraction, high: Fraction) -> AlphaPiece:
        """Another piece, or one alpha alone."""
        return AlphaPiece(self.space, low, high)

    def arc(self, codes: Sequence[int], errors: float = 1.0, found: SpaceRoot | Open | None = None) -> LeafArc | None:
        """The arc on which all roots of a leaf lie at all alpha of the piece, if it is proven that there is one.

        ``found``: what the leaf holds, if it is known.
        """
        found = self.held(codes) if found is None else found
        return None if found is None else arc_of(self.whole, codes, found, errors)

    def root_at(self, alpha: Fraction, codes: Codes) -> tuple[AlphaPiece, SpaceRoot | None]:
        """The only root of a leaf at some alpha of the piece, and that alpha as a piece; None where there is none."""
        at = self.over(alpha, alpha)
        # beyond the piece nothing is known of friction, and it may vanish at an end
        held = self.low <= alpha <= self.high and is_complete(at.whole, codes)
        found = at.held(codes) if held else None
        return at, found if isinstance(found, SpaceRoot) else None

    def holds_all(
        self, codes: Sequence[int], given: AlphaProblem, curves: Sequence[SolutionCurve], errors: float = 1.0
    ) -> bool:
        """True if all roots of a leaf are on the curve of some boxes, at every alpha of the piece."""
        piece, found = self.narrowed(codes)
        return found is None or any(lie_along(ends, curves, errors) for ends in piece.places(found, given))

    def place(self, found: SpaceRoot | Open, given: AlphaProblem) -> Ball | None:
        """Bounds of (zeta, alpha) of what a leaf holds, (m + 1,); None where there are none."""
        if found.y is None or found.w is None:
            return None
        y = found.y if found.rigid is None else Ball.joined(found.y, -found.rigid)
        return self._placed(y, found.w, self.alphas, given)

    def places(self, found: SpaceRoot | Open, given: AlphaProblem) -> list[tuple[Ball, ...]]:
        """Bounds of (zeta, alpha) of what a leaf holds: all of it lies in each of these, or between two of them."""
        place = self.place(found, given)
        if found.drift is None:
            return [] if place is None else [(place,)]
        # alpha is affine in s
        middle, half = (self._rounded(part) for part in (self.middle, (self.high - self.low) / 2))
        ends = []
        for both, s in found.drift:
            m = len(both.mid) // 2
            ends.append(self._placed(both[:m], both[m:], middle + half * s, given))
        return [] if place is None else [(place,), tuple(ends)]

    @staticmethod
    def _rounded(number: Fraction) -> Ball:
        near = float(number)
        return Ball(np.array(near), np.array(float(abs(number - Fraction(near))) * (1.0 + 4 * UNIT) + TINY))

    def rigid(self, y: Ball) -> Ball:
        """Coordinates q of the rigid displacement, (r,), in the problem's units, of y with -q behind its forces."""
        if self.whole.held:
            return y[:0]
        q, unit = -y[len(self.whole.g) :], self.whole.rows.unit
        return Ball(q.mid * unit, q.rad * unit + TINY)

    def _placed(self, y: Ball, w: Ball, alpha: Ball, given: AlphaProblem) -> Ball:
        q = self.rigid(y)
        forces, moved = self.forces(y), self.displacements(y, w, alpha)
        # the body is in balance with the load
        still = Ball.exact(np.zeros(len(q.mid)))
        return Ball.joined(given.coordinates(Ball.joined(forces, q), Ball.joined(moved, still)), alpha[None])


def lie_along(ends: Sequence[Ball], curves: Sequence[SolutionCurve], errors: float = 1.0) -> bool:
    """True if all between two bounds, or within one, is on the curve of some boxes, in one box after the other.

    The sets in which curves are the only solutions are convex: what is between two bounds that lie in one does so, too.
    ``errors``: 1 proves, a writer of proofs takes more.
    """
    if not curves:
        return False
    low, high, room = ends[0], ends[-1], 1.0 - (errors - 1.0) * MARGIN
    if not curves[0].holds(low, room):
        low, high = high, low
    place, share = low, 0.0
    for curve in curves[:-1]:
        if not curve.holds(place, room):
            return False
        # as far as this box has all of it
        step = 1.0 - share
        for _ in range(_STEPS):
            step *= 0.5
            ahead = _between(low, high, share + step)
            if curve.holds(ahead, room):
                place, share = ahead, share + step
    return curves[-1].holds(place, room) and curves[-1].holds(high, room)


def _between(low: Ball, high: Ball, share: float) -> Ball:
    """A ball of (1 - share) x + share y for all x and y of two balls."""
    rest = 1.0 - share
    return low * Ball.exact(np.array(rest)) + high * Ball.exact(np.array(share))


# -- arcs of leaves ----------------------------------------------------------------------------------------------------


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
        same = patterns(codes) == self.statuses
        return same and bool(np.all(root.away_from(self.centre, self.angle) <= self.radius))


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
        leaf, box = Leaf(system, codes), (found.angle, found.angle_rad, 1.0 + (errors - 1.0) * MARGIN)
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

    Zeros z = (psi, s) of the equations are a graph over one of these unknowns, z_k: with (12.22), u being the other
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
    for _ in range(WIDENINGS):
        state, sizes = leaf.over(angle, radius), np.r_[radius, 1.0]
        if state is None or not state.whole_J.finite:
            return None
        room, reach = sizes[others], Ball(np.zeros(1), sizes[k : k + 1])[0]
        left, along, beside = around_middle(leaf, Y, k, (angle, radius), (state, point))
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
