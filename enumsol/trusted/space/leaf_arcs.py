"""The trusted test that the solutions of a leaf in 3D over a piece of alpha are one arc (theory, section 12.9)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball
from enumsol.model.sectors import SECTORS
from enumsol.trusted.space.leaves import ROUNDED_ANGLE, Leaf, Open, SpaceRoot, turned

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.condensation.space_condensed import EnclosedSpace
    from enumsol.support.array_types import Codes, Floats

#: How often the box of an arc is made wider, and by how much more than is needed.
_WIDENINGS, _ROOM = 6, 1.125
#: What a writer of proofs asks for beyond what a checker does, of the size of a box.
_MARGIN = 2.0**-10


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
        leaf, box = _ArcLeaf(system, codes), (found.angle, found.angle_rad, 1.0 + (errors - 1.0) * _MARGIN)
        arc = leaf.arc(*box)
        loosened = leaf.loosened() if arc is None else None
        return arc if loosened is None else loosened.arc(*box)


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
        if _pattern(codes) != self.statuses:
            return False
        shift = turned(self.centre, root.centre)
        away = np.abs(shift + root.angle - self.angle) + root.angle_rad + ROUNDED_ANGLE
        return bool(np.all(away <= self.radius))


def _pattern(codes: Sequence[int]) -> Codes:
    """Statuses, one code for all sectors."""
    return tuple(min(code, SECTORS) for code in codes)


class _ArcRates(NamedTuple):
    """Along an arc: bounds of y and w, and of their derivatives and those of s, by the parameter of the arc."""

    y: Ball
    w: Ball
    y_rate: Ball
    w_rate: Ball
    s_rate: Ball


class _ArcLeaf(Leaf):
    """Zeros z = (psi, s) of the equations of a leaf as a graph over one of these unknowns, z_k.

    A normal force that is left free is between psi and s, and so are rigid modes that the equations leave free.

    With (12.22d), u being the other ones, the right-hand side maps a box of u into its interior, for every z_k: there
    is one zero for each of them, and these are an arc.
    """

    def arc(self, angle: Floats, radius: Floats, errors: float) -> LeafArc | None:
        """The arc, if every condition holds all along it or changes its sign once at most.

        ``angle``, ``radius``: a box that holds the directions of all solutions.
        """
        box = self._around_free(angle, radius) if self.piece else None
        if box is None:
            return None
        (angle, radius), turning, q = box, len(angle), len(box[0])
        point = self._state(angle, 0.0 * radius, still=True)
        if point is None or not point.whole_J.finite:
            return None
        J, sizes = point.whole_J.mid, np.r_[radius, 1.0]
        k = int(np.argmax(np.abs(np.linalg.svd(J * sizes)[2][-1]))) if q else 0
        others = np.delete(np.arange(q + 1), k)
        try:
            Y = np.asarray(np.linalg.inv(np.delete(J, k, axis=1)), dtype=np.float64)
        except np.linalg.LinAlgError:
            return None
        psi, state = others[others < q], None
        for _ in range(_WIDENINGS):
            state = self._state(angle, radius)
            if state is None or not state.whole_J.finite:
                return None
            room, reach = np.r_[radius, 1.0][others], Ball(np.zeros(1), np.r_[radius, 1.0][k : k + 1])[0]
            left, along, point_G = self._around(Y, k, angle, radius, state, point)
            beside = left @ Ball(np.zeros(q), room) + point_G
            needed = (beside + along * reach).size * errors
            if np.all(needed < room) or (k < q and not needed[-1] < 1.0):
                break
            radius = radius.copy()
            radius[psi] = np.maximum(radius[psi], _ROOM * needed[: len(psi)])
            # solutions at wider angles may have other forces
            cut = self._around_free(angle[:turning], radius[:turning])
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
        slopes = Ball.beside(state.box.slope, state.box.lone)
        values = Ball.joined(point.y, point.w) + (slopes[:, others] @ beside[:, None])[:, 0]
        values = values + ((slopes[:, others] @ along[:, None])[:, 0] + slopes[:, k]) * reach
        rates = (slopes[:, others] @ rate[:, None])[:, 0] + slopes[:, k]
        m = len(point.y.mid)
        fixed = m + np.array([*self.rows, *self.loose], dtype=np.intp)
        for part in (values, rates):
            part.mid[fixed], part.rad[fixed] = 0.0, 0.0
        s_rate = rate[-1] if k < q else Ball.exact(np.array(1.0))
        found = _ArcRates(values[:m], values[m:], rates[:m], rates[m:], s_rate)
        holding = self._slacks(found.y, found.w, angle, radius) > 0
        mid, rad = self._rates(found, angle, radius)
        if not np.all(holding | (np.abs(mid) > rad * errors * SAFE)):
            return None
        return LeafArc(_pattern(self.codes), self.centre, angle[:turning], radius[:turning])

    def _around_free(self, angle: Floats, radius: Floats) -> tuple[Floats, Floats] | None:
        """A box of all unknowns but s that holds all zeros with angles in a box; None if there is none, or no such."""
        if not self.free:
            return angle, radius
        modes = np.array(self.free[len(self.loose) :], dtype=np.intp) - len(self.system.g)
        wide = np.r_[np.full(len(self.loose), np.inf), self.system.reach[modes]]
        cut = self._cut_free(np.r_[angle, np.zeros(len(wide))], np.r_[radius, wide])
        return cut if cut is not None and np.all(np.isfinite(cut[1])) else None

    def _rates(self, along: _ArcRates, angle: Floats, radius: Floats) -> tuple[Floats, Floats]:
        """Bounds of how the conditions of ``_slacks`` change along the arc."""
        turn, tau, unit, scale = self.system.turn, self.system.tau, self.system.unit, self.system.disc_scale
        assert turn is not None
        found = [-along.w_rate[i] for i in self.open] + [along.y_rate[i] for i in self.closed]
        for i in self.stick:
            t = [int(k) for k in tau[i] if k >= 0]
            if t:
                size = Ball.exact(np.array(scale[i]))
                disc = turn.disc[i] + turn.disc_turn[i] * Ball(np.zeros(1), np.ones(1))[0]
                most = (disc * along.y_rate[i] + turn.disc_turn[i] * along.s_rate * along.y[i]) * size
                units = Ball.exact(unit[t] * scale[i])
                rubbed = along.y[t] * units
                length = float(np.linalg.norm(rubbed.mid)) / SAFE - float(np.linalg.norm(rubbed.rad)) * SAFE
                # (tau . tau') / |tau| is tau' times a vector of length one that is within rad of that in the middle
                towards = rubbed.mid / max(float(np.linalg.norm(rubbed.mid)), TINY)
                turned = 2.0 * float(np.linalg.norm(rubbed.rad)) / length * SAFE if length > 0 else 2.0
                direction = Ball(towards, np.full(len(t), min(turned, 2.0) + 8 * UNIT))
                found.append(most - (direction[None] @ (along.y_rate[t] * units)[:, None])[0, 0])
        found += [Ball.exact(np.array(sign)) * along.w_rate[int(np.max(tau[i]))] for i, sign in self.sliding]
        if np.all(np.isfinite(self.system.reach)):
            # the bounds of the rigid displacement
            found += [side[k] for side in (-along.y_rate, along.y_rate) for k in range(len(self.system.g), len(self.E))]
        mid, rad = (np.array([getattr(part, name) for part in found]).reshape(-1) for name in ("mid", "rad"))
        # v is along d at zeros of G, so that what turns d does not change v . d
        d, _ = self._directions(angle, radius)
        v1, v2 = self._slips(along.w_rate)
        ahead = v1 * d[:, 0] + v2 * d[:, 1]
        return np.concatenate([mid, ahead.mid]), np.concatenate([rad, ahead.rad])
