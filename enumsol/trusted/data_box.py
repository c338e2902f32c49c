"""The trusted test of a box of data: every problem in it has exactly one solution (theory, section 13.5).

The data depend on two parameters s and t from -1 to 1: alpha and the second parameter of a map. What is of first order
in them is kept as such, and only the rest is bounded.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball, Inverse
from enumsol.condensation.enclosure import CondensedEnclosure, EnclosedSystem
from enumsol.support.array_types import Codes, Floats, Indices
from enumsol.trusted.over_interval import PieceNumbers, definite
from enumsol.trusted.selection import Selection, Unknowns
from enumsol.trusted.status_rows import CONDITIONS, OPEN, final_codes
from enumsol.trusted.uniqueness_weights import Components, Weights


@dataclass(frozen=True, eq=False)
class Expansion:
    """Numbers that depend on s and t: ``value + s along + t across + rest``, |rest| bounded, for all s, t in [-1, 1].

    Attributes
    ----------
    value, along, across : Ball
    rest : array
    """

    value: Ball
    along: Ball
    across: Ball
    rest: Floats

    @property
    def ball(self) -> Ball:
        """Ball that holds all of them."""
        return Ball(self.value.mid, (self.value.rad + self.along.size + self.across.size + self.rest) * SAFE + TINY)

    def __getitem__(self, item: Any) -> Expansion:
        return Expansion(self.value[item], self.along[item], self.across[item], self.rest[item])

    def __add__(self, other: Expansion) -> Expansion:
        rest = (self.rest + other.rest) * SAFE
        return Expansion(self.value + other.value, self.along + other.along, self.across + other.across, rest)

    def __neg__(self) -> Expansion:
        return Expansion(-self.value, -self.along, -self.across, self.rest)

    def __sub__(self, other: Expansion) -> Expansion:
        return self + -other

    def __mul__(self, other: Expansion) -> Expansion:
        second = (self.along * other.along).size + (self.across * other.across).size
        second += (self.along * other.across + self.across * other.along).size
        rest = second + self.ball.size * other.rest + self.rest * (other.ball.size + other.rest)
        return Expansion(
            self.value * other.value,
            self.value * other.along + self.along * other.value,
            self.value * other.across + self.across * other.value,
            rest * (1 + 8 * UNIT) * SAFE + TINY,
        )

    def times(self, factor: Ball) -> Expansion:
        """A constant times these numbers."""
        rest = factor.size * self.rest * SAFE + TINY
        return Expansion(self.value * factor, self.along * factor, self.across * factor, rest)


@dataclass(frozen=True, eq=False)
class DataBox:
    """Problems with one S, whose g and F depend on s and t, in the units of ``system``.

    Attributes
    ----------
    system : EnclosedSystem
        With g and F as balls that hold those of all problems.
    g, F : Expansion
    """

    system: EnclosedSystem
    g: Expansion
    F: Expansion

    @classmethod
    def between(
        cls,
        enclosures: tuple[CondensedEnclosure, CondensedEnclosure],
        alphas: tuple[float, float],
        shares: tuple[float, float],
        force: Floats,
        length: Floats,
    ) -> DataBox:
        """The problems between two with the same A, Bn and Bt, on which load, gap and friction depend affinely.

        Parameters
        ----------
        enclosures : of the two problems
        alphas : from where to where
        shares : from 0 (the first problem) to 1 (the second one)
        force, length : (2p,) arrays, powers of two
            Units.

        Raises
        ------
        NotEnclosedError
            Something over- or underflows.
        """
        first = enclosures[0].at(0.5 * (alphas[0] + alphas[1]), force, length)
        s, s_rad = _middle(alphas)
        t, t_rad = _middle(shares)
        # a + s a' at the one end, b + s b' at the other
        corners = [
            [Ball(e.g0 / length, e.g0_rad / length + TINY), Ball(e.g1 / length, e.g1_rad / length + TINY)]
            for e in enclosures
        ]
        g = _bilinear(corners[0], corners[1], s, s_rad, t, t_rad)
        coefficients = [[Ball.exact(part) for part in e.problem.affine_friction] for e in enclosures]
        F = _bilinear(coefficients[0], coefficients[1], s, s_rad, t, t_rad)
        g_ball, F_ball = g.ball, F.ball
        system = EnclosedSystem(first.S, first.S_rad, g_ball.mid, g_ball.rad, F_ball.mid, F_ball.rad)
        return cls(system, g, F)

    @property
    def rubbing(self) -> Indices:
        """Nodes with friction."""
        return np.flatnonzero(self.system.F > 0)


@dataclass(frozen=True)
class Throughout:
    """A solution for every data of a box, as far as the statuses of some nodes hold.

    Attributes
    ----------
    force, w : Expansion of shape (2p,)
    broken : nodes whose status is not proven to hold everywhere
    """

    force: Expansion
    w: Expansion
    broken: tuple[int, ...]


def solution_throughout(
    box: DataBox, selection: Codes, loose: Sequence[int], weights: Floats, force: Floats
) -> Throughout | None:
    """A solution of the reduced problem of the loose nodes for all data of a box; None where that is not proven.

    Parameters
    ----------
    box : DataBox
    selection : final codes, those of loose nodes only name a point near the solution
    loose : ascending nodes whose status may be another one elsewhere in the box
    weights : numbers of the form of theory, (6.9), of the reduced problem of the loose nodes
    force : (2p,) array, lambda near the solution; only lambda_n of loose nodes is read
    """
    system = box.system
    if any(code not in final_codes(F > 0) for code, F in zip(selection, system.F, strict=True)):
        return None
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        chosen = set(loose)
        fixed = Selection([OPEN if i in chosen else code for i, code in enumerate(selection)])
        (S, _, F), rows = system.balls, fixed.unknown
        inverse = Inverse.of(fixed.matrix(S, F)) if len(rows) else None
        if len(rows) and inverse is None:
            return None
        load, still = box.g[:, None], Ball.exact(np.zeros((2 * box.system.p, 1)))
        if not chosen:
            forces, w = _expanded(box, fixed, inverse, load, still)
            return _told(box, selection, chosen, forces[:, 0], w[:, 0])
        nodes = np.array(sorted(chosen), dtype=np.intp)
        at = Unknowns(system.p, nodes, system.F[nodes] > 0, np.zeros(len(nodes), dtype=np.intp))
        # the forces of the fixed nodes change by -moved dx, and w by -across dx
        columns = S[:, at.places]
        none = np.zeros(columns.shape)
        unit = Expansion(columns, Ball.exact(none), Ball.exact(none), none)
        moved, across = (change.ball for change in _expanded(box, fixed, inverse, unit, Ball.exact(none)))
        part = Components(system, selection, at, across[at.places])
        numbers = Weights.of(part, weights)
        least = 0.0 if numbers is None else part.least(numbers)
        if numbers is None or not least > 0:
            return None
        x = part.point(force, numbers)
        still.mid[at.places, 0] = x.mid
        forces, w = (found[:, 0] for found in _expanded(box, fixed, inverse, load, still))
        moves = across.size @ x.rad * SAFE + TINY
        near = w.ball[at.places]
        reach = part.distance(x.mid, Ball(near.mid, (near.rad + moves[at.places]) * SAFE), numbers) / least * SAFE
        if not np.isfinite(reach):
            return None
        radius = (x.rad + reach) * SAFE
        further = (moved.size @ radius) * SAFE + TINY
        further[at.places] += radius
        forces = Expansion(forces.value, forces.along, forces.across, (forces.rest + further) * SAFE)
        w = Expansion(w.value, w.along, w.across, (w.rest + across.size @ radius * SAFE) * SAFE + TINY)
        return _told(box, selection, chosen, forces, w)


def only_throughout(box: DataBox, found: Throughout, numbers: PieceNumbers, margin: float = 0.0) -> bool:
    """True if a solution that is known for all data of a box is everywhere the only one.

    Parameters
    ----------
    box : DataBox
    found : Throughout
        Nothing is proven where a status is broken.
    numbers : PieceNumbers
        Of the form of the whole problem.
    margin : the smallest eigenvalue must be larger than this, relative to the largest entry
    """
    p, (S, _, F) = box.system.p, box.system.balls
    if found.broken or not numbers.usable or not numbers.serve(F.size):
        return False
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        theta, off = slopes(box, found, numbers)
        kept = np.concatenate([np.arange(p), p + box.rubbing])
        form = numbers.form(S, Ball.exact(theta)) - numbers.taken(S, off)
        return definite(form[np.ix_(kept, kept)], margin)


def slopes(box: DataBox, found: Throughout, numbers: PieceNumbers) -> tuple[Floats, Floats]:
    """theta of every node, and how far from it one may be that serves the solution, whichever that is."""
    p, F = box.system.p, box.system.balls[2]
    n, t, w_n, w_t = found.force[:p], found.force[p:], found.w[:p].ball, found.w[p:].ball
    # any theta: one of them serves
    theta, off = np.zeros(p), F.size.copy()
    least = (n.ball.mid - n.ball.rad) / SAFE
    loaded = least > 0
    ratio = np.where(loaded, t.value.mid / np.where(loaded, n.value.mid, 1.0), 0.0)
    # |lambda_t / lambda_n - theta| = |lambda_t - theta lambda_n| / lambda_n
    apart = (t - n.times(Ball.exact(ratio))).ball.size / np.where(loaded, least, 1.0) * SAFE + TINY
    known = loaded & (apart < off)
    theta, off = np.where(known, ratio, theta), np.where(known, apart, off)
    side = np.where(w_t.mid - w_t.rad > 0, 1.0, np.where(w_t.mid + w_t.rad < 0, -1.0, 0.0))
    theta, off = np.where(side != 0, side * F.mid, theta), np.where(side != 0, F.rad, off)
    # the least theta that the gap of an open node allows: (mu + side nu F) |w_n| >= kappa (F - side theta) |w_t|
    gap = np.maximum(-(w_n.mid + w_n.rad), 0.0) / SAFE
    turn = np.where(side != 0, side * numbers.nu, -np.abs(numbers.nu))
    room = (numbers.mu + np.minimum(turn * F.low, turn * F.high) - 8 * UNIT * numbers.mu) / SAFE
    spared = np.maximum(room, 0.0) * gap / (numbers.kappa * w_t.size + TINY) / SAFE
    least = np.maximum(F.size - spared, 0.0) * (1 + 8 * UNIT)
    opened = (gap > 0) & ((least == 0) | ((side != 0) & (least < F.low / SAFE)))
    return np.where(opened, side * least, theta), np.where(opened, 0.0, off)


def _told(box: DataBox, selection: Codes, loose: set[int], force: Expansion, w: Expansion) -> Throughout | None:
    """The solution, and at which fixed nodes a condition may not hold."""
    p = box.system.p
    n, t, w_n, w_t = force[:p], force[p:], w[:p], w[p:]
    bound = box.F * n
    rows = [part.ball for part in (n, t, bound - t, bound + t, -w_n, w_t, -w_t)]
    if not all(row.finite for row in rows):
        return None
    broken = [
        i
        for i, code in enumerate(selection)
        if i not in loose and not all(rows[kind].mid[i] > rows[kind].rad[i] for kind in CONDITIONS[code][1])
    ]
    return Throughout(force, w, tuple(broken))


def _expanded(
    box: DataBox, fixed: Selection, inverse: Inverse | None, load: Expansion, put: Ball
) -> tuple[Expansion, Expansion]:
    """lambda and w = load - S lambda that solve the equations of the fixed nodes, with given forces at the others.

    ``load`` and ``put`` have the shape (2p, k).
    """
    (S, _, F), rows = box.system.balls, fixed.unknown
    none = np.zeros_like(put.mid)
    force = Expansion(put, Ball.exact(none), Ball.exact(none), none)
    if inverse is not None:
        coefficients, T = (box.F.value, box.F.along, box.F.across), S[rows]

        def forces(y: Floats, order: int) -> Ball:
            found: Ball = fixed.forces(Ball.exact(y), coefficients[order], unit=int(order == 0))
            return found

        right = (load.value - S @ put)[rows], load.along[rows], load.across[rows]
        z = inverse.near(right[0].mid)
        turned = [forces(z, k) for k in (1, 2)]
        turns = [inverse.near(right[k + 1].mid - (T @ turned[k]).mid) for k in (0, 1)]
        parts = [forces(z, 0), *(forces(y, 0) + turn for y, turn in zip(turns, turned, strict=True))]
        second = [forces(turns[0], 1), forces(turns[1], 2), forces(turns[0], 2) + forces(turns[1], 1)]
        reach = (np.abs(z) + np.abs(turns[0]) + np.abs(turns[1])) * SAFE
        none_of = np.zeros_like(box.F.rest)
        second.append(fixed.forces(Ball(np.zeros_like(z), reach), Ball(none_of, box.F.rest), unit=0))
        rest = [(one - T @ part).size for one, part in zip(right, parts, strict=True)]
        missed = np.sum([*rest, load.rest[rows], *((T @ part).size for part in second)], axis=0) * SAFE + TINY
        error = inverse.solve(Ball(np.zeros_like(missed), missed)).size
        left = fixed.forces(Ball(np.zeros_like(error), error), F).size
        left = np.sum([left, *(part.size for part in second)], axis=0) * SAFE + TINY
        left[np.setdiff1d(np.arange(len(left)), np.concatenate([rows, fixed.p + fixed.slip]))] = 0.0
        force = Expansion(parts[0] + put, parts[1], parts[2], left)
    w_rest = (load.rest + S.size @ force.rest * SAFE) * SAFE + TINY
    found = Expansion(
        load.value - S @ force.value, load.along - S @ force.along, load.across - S @ force.across, w_rest
    )
    # zero by the equations
    found.value[rows], found.along[rows], found.across[rows], found.rest[rows] = 0.0, 0.0, 0.0, 0.0
    return force, found


def _middle(ends: tuple[float, float]) -> tuple[Ball, Ball]:
    """The middle of an interval and half its length, rounded upwards."""
    middle = 0.5 * (ends[0] + ends[1])
    half = max(ends[1] - middle, middle - ends[0])
    return Ball.exact(np.full(1, middle)), Ball.exact(np.full(1, half * (1 + 4 * UNIT) + TINY))


def _bilinear(first: Sequence[Ball], second: Sequence[Ball], a: Ball, a_rad: Ball, c: Ball, c_rad: Ball) -> Expansion:
    """(1 - y) (first[0] + x first[1]) + y (second[0] + x second[1]) with x = a + s a_rad and y = c + t c_rad."""
    one, other = first[0] + a * first[1], second[0] + a * second[1]
    turn = second[1] - first[1]
    return Expansion(
        one + c * (other - one), a_rad * (first[1] + c * turn), c_rad * (other - one), (a_rad * c_rad * turn).size
    )
