"""The trusted test in 3D that the solutions in a box of forces and alpha are one curve (theory, section 12.8).

Of a body that nothing holds, the coordinates of its rigid displacement are among the forces (theory, section 14.14).

Krawczyk's operator is applied to the natural map with alpha as one more unknown and one linear equation more, for all
values of that equation's right-hand side, the curve's parameter, at once.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball, determinant_sign, solution, upper_norm
from enumsol.condensation.condensed import node_units
from enumsol.condensation.enclosure import NotEnclosedError, RigidRows
from enumsol.model.sectors import SECTORS
from enumsol.trusted.space.natural_map import (
    MARGIN,
    Corners,
    Directions,
    Discs,
    Extent,
    Step,
    are_steps,
    middle_inverse,
    split_off,
    upper_product,
)
from enumsol.trusted.space.sector_rows import FRICTIONLESS, OPEN, STICK

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from enumsol.condensation.enclosure import CondensedEnclosure

    Array = NDArray[np.float64]

#: Slip in any direction, as in continuation.
SLIP = SECTORS + 1
#: How often a set around a box is made larger, its image taken again.
_WIDENINGS, _IMAGES = 6, 2
#: What a writer of proofs asks for.
ERRORS = 2.0
#: What is proposed: how much more room the radii have than the curve seems to need, in the hope that this suffices for
#: what the room itself adds; the least radius relative to the largest; and steps of Newton's method.
_ROOMS, _LEAST, _STEPS = (1.2, 1.3, 1.5, 1.5, 1.5, 1.5, 1.5), 1e-3, 8
#: Of the radii with which the step seems to contract, what is tried first; and by how much larger than they need to be
#: radii are at least that are as large as they may be.
_OF_LIMIT, _TWICE = 0.8, 2.0
#: Between both, shares of the logarithm that are tried.
_SHARES = (0.6, 0.3, 0.0)
#: That a longer box has this room, too: (1 - e h)^2 / (k a) where the step contracts by e h + k r and moves by a.
_ROOM = 5.0
#: Loads whose exponents are larger have no unit of their own.
_LARGEST = 200
#: Factors of the steps of the natural map at a node that changes its status; how wide corners may be without them, and
#: how much wider in a shorter box with those of a longer one.
_TURNED, _AS_WIDE = 0.5, 1.05
_FACTORS = (1.0, 4.0, 16.0, 64.0, 256.0, 0.25, 0.0625, 0.015625)


@dataclass(frozen=True, eq=False)
class CurveBox:
    """All x = (zeta, alpha) with |t| <= half and |x - centre - t direction| <= radius.

    zeta are the coordinates of AlphaProblem and t = border (x - centre). All arrays have shape (m + 1,), in the units
    of forces, all normals first, but for ``rho``, (m,): steps of the natural map relative to those of AlphaProblem,
    positive. What is said does not depend on them. m is 3p, and of a body that nothing holds r more.
    """

    centre: Array
    direction: Array
    border: Array
    half: float
    radius: Array
    rho: Array


@dataclass(frozen=True, eq=False)
class AlphaProblem:
    """A problem in 3D for all alpha, as balls: q w = g0 + alpha g1 - S y, and y / q in discs (F0 + alpha F1) lambda_n.

    q is 1 but for the second component of nodes with two coefficients that are not the same: then it is their ratio,
    which must not depend on alpha. Solutions are looked for in the coordinates zeta = y / q - rho q w, with the steps
    rho of the natural map (theory, section 12.8).

    Of a body that nothing holds y has its rigid displacement, too, the last r of m = 3p + r components: those of w are
    h - G y, and those of zeta that displacement itself (theory, section 14.14). Of others m is 3p.

    Attributes
    ----------
    S, g0, g1 : Balls of shapes (m, m), (m,) and (m,), in units of the nodes
    F0, F1 : (p,) arrays
        Exact, those of the first component that has friction.
    ratio, inverse : Balls of shape (m,)
        q and 1 / q.
    tau : places of the tau of every node, none, one or two
    force, length : (m,) arrays, powers of two
        Forces and displacements of the problem are as many times those here.
    rho : (m,) array
        Steps of the natural map: one for lambda_n and one for tau of every node.
    turned : Ball of shape (m, m)
        1 + rho S q, by which y / q is multiplied in zeta.
    part, offset : Balls of shapes (m, m + 1) and (m,)
        y / q is part (zeta, alpha) + offset.
    reach : (r,) array
        Bounds of the coordinates of the rigid displacement, in the problem's units.
    """

    S: Ball
    g0: Ball
    g1: Ball
    F0: Array
    F1: Array
    ratio: Ball
    inverse: Ball
    tau: Sequence[NDArray[np.intp]]
    force: Array
    length: Array
    rho: Array
    turned: Ball
    part: Ball
    offset: Ball
    reach: Array

    @classmethod
    def of(cls, enclosure: CondensedEnclosure, steps: Array | None = None) -> AlphaProblem:
        """Map of a problem whose nodes have coefficients of one ratio for all alpha.

        ``steps``: positive, (m,), rho in the units of the problem (force / length), the same for both components of
        tau of a node; by default some that serve.

        Raises
        ------
        NotEnclosedError
            The ratio of a node depends on alpha, the steps are none, or something over- or underflows.
        """
        problem, p = enclosure.problem, enclosure.problem.p
        coefficients, slopes = np.array(problem.friction), np.array(problem.friction_slope)
        occurs = (coefficients != 0) | (slopes != 0)
        tau = [np.array([(1 + k) * p + i for k in range(2) if occurs[k, i]], dtype=np.intp) for i in range(p)]
        first = np.where(occurs[0], 0, 1), np.arange(p)
        factor = np.tile(node_units(enclosure.S, p), 3)
        size = _power(np.max(np.maximum(np.abs(enclosure.g0), np.abs(enclosure.g1)) * factor))
        force, length = factor * size, size / factor
        with np.errstate(over="ignore", invalid="ignore"):
            pair = force[:, None] / length[None, :]
            data = [
                Ball(enclosure.S * pair, enclosure.S_rad * pair + TINY),
                Ball(enclosure.g0 / length, enclosure.g0_rad / length + TINY),
                Ball(enclosure.g1 / length, enclosure.g1_rad / length + TINY),
            ]
            rows, work = RigidRows.of(problem, Fraction(0), force, length), float(force[0] * length[0])
            data = _bordered(data, rows)
            ratio = Ball.joined(_ratios(problem, occurs), Ball.exact(np.ones(len(rows.unit))))
            force, length = np.append(force, rows.unit), np.append(length, work / rows.unit)
            S, g0, g1 = (part * ratio if part.mid.ndim == 1 else ratio[:, None] * part for part in data)
            inverse = Ball(1.0 / ratio.mid, (2.0 * ratio.rad / ratio.mid + 2 * UNIT) / ratio.mid * SAFE)
            inverse = Ball(inverse.mid, np.where((ratio.mid == 1) & (ratio.rad == 0), 0.0, inverse.rad))
        if not (S.finite and g0.finite and g1.finite):
            raise NotEnclosedError("the condensed problem over- or underflows float64; expected data in other units")
        m = len(force)
        # the steps of a proof may be any floats
        with np.errstate(over="ignore", invalid="ignore"):
            rho = _steps(S.mid / inverse.mid, tau) if steps is None else steps / (force / length)
            turned = Ball.exact(rho[:, None]) * S * ratio + Ball.exact(np.eye(m))
            right = Ball.exact(rho)[:, None] * Ball.beside(g1[:, None], g0[:, None])
            found = solution(turned, Ball.beside(Ball.exact(np.eye(m)), right)) if turned.finite else None
        if found is None:
            raise NotEnclosedError("forces and displacements of the condensed problem cannot be told apart")
        part, offset = found[:, : m + 1], found[:, m + 1]
        F0, F1, reach = coefficients[first], slopes[first], rows.reach * rows.unit
        given = cls(S, g0, g1, F0, F1, ratio, inverse, tau, force, length, rho, turned, part, offset, reach)
        if not are_steps(rho, given.places):
            raise NotEnclosedError("expected positive steps, the same for both tangential directions of a node")
        return given

    @property
    def p(self) -> int:
        """Number of contact nodes."""
        return len(self.F0)

    @property
    def m(self) -> int:
        """Number of forces, and of coordinates of a rigid displacement."""
        return len(self.force)

    def discs(self, alpha: Ball) -> Discs:
        """The projection P for all alpha of a ball."""
        return Discs(self.places, self.friction(alpha), self.F1, len(self.reach))

    def within(self, x: Ball) -> bool:
        """True if the rigid displacement is within its bounds, and not at them, at all points (zeta, alpha) of a ball.

        Its coordinates are components of zeta at solutions.
        """
        return bool(np.all(x[self.rigid].size * SAFE < self.reach))

    @property
    def rigid(self) -> slice:
        """Places of the coordinates of the rigid displacement in (zeta, alpha)."""
        return slice(3 * self.p, self.m)

    @property
    def steps(self) -> Array:
        """rho in the units of the problem, (m,), which are powers of two times those here."""
        return np.asarray(self.rho * (self.force / self.length))

    @cached_property
    def places(self) -> NDArray[np.intp]:
        """Places of the tau of every node, (p, 2), -1 where there is none."""
        return np.array([[*t, -1, -1][:2] for t in self.tau], dtype=np.intp)

    @cached_property
    def plain_moves(self) -> Array:
        """Middle of ``moves`` for the steps of the natural map as they are."""
        return self.moves(np.ones(self.m)).mid

    def moves(self, rho: Array) -> Ball:
        """The derivative of (z, alpha) with respect to (zeta, alpha), (m + 1, m + 1), for steps relative to its own.

        z = y / q + rho' q w is (1 + r) y / q - r zeta where rho' is r times the step of zeta.
        """
        m = self.m
        out = Ball(np.eye(m + 1), np.zeros((m + 1, m + 1)))
        out[:m] = _one_more(rho)[:, None] * self.part - Ball.exact(rho[:, None] * np.eye(m, m + 1))
        return out

    def forces_at(self, x: Ball) -> Ball:
        """y / q at points (zeta, alpha)."""
        m = self.m
        near = Ball.exact(self.part.mid @ x.mid + self.offset.mid)
        # with what is rounded there as the right-hand side
        missing = x[:m] + Ball.exact(self.rho) * (self.g0 + x[m] * self.g1) - (self.turned @ near[:, None])[:, 0]
        return near + (self.part[:, :m] @ missing[:, None])[:, 0]

    def arguments(self, x: Ball, y: Ball, rho: Array) -> Ball:
        """z at points (zeta, alpha) with forces y / q, for steps relative to its own."""
        return _one_more(rho) * y - Ball.exact(rho) * x[: len(rho)]

    # -- coordinates -----------------------------------------------------------------------------------------------

    def coordinates(self, forces: Ball, w: Ball) -> Ball:
        """zeta of forces and displacements, all in the units of the problem."""
        force, step = Ball.exact(self.force), Ball.exact(self.rho)
        y, v = forces * Ball.exact(1.0 / self.force), w * Ball.exact(1.0 / self.length)
        return force * (self.inverse * y - step * (self.ratio * v))

    def placed(self, x: Array) -> Array:
        """(zeta, alpha) of forces and alpha, (..., m + 1), in floats."""
        y = x[..., :-1] / self.force
        w = self.g0.mid + x[..., -1:] * self.g1.mid - y @ self.S.mid.T
        return np.append((self.inverse.mid * y - self.rho * w) * self.force, x[..., -1:], axis=-1)

    def unplaced(self, x: Array) -> Array:
        """Forces and alpha of (zeta, alpha), (..., m + 1), in floats."""
        q, unit = self.ratio.mid, np.append(self.force, 1.0)
        y = (x / unit) @ self.part.mid.T + self.offset.mid
        return np.append(y * q * self.force, x[..., -1:], axis=-1)

    @cached_property
    def _turn(self) -> Array:
        """The derivative of (zeta, alpha) with respect to forces and alpha, in floats."""
        force, m = self.force, self.m
        J = np.eye(m + 1)
        S = self.S.mid * (self.rho * force)[:, None] / force
        J[:m, :m], J[:m, m] = np.diag(self.inverse.mid) + S, -self.rho * self.g1.mid * force
        return J

    def border_of_forces(self, border: Array) -> Array:
        """The row by (forces, alpha) of one by (zeta, alpha), (..., m + 1), in floats."""
        return np.asarray(border @ self._turn)

    def border_of_zeta(self, border: Array) -> Array:
        """The row by (zeta, alpha) of one by (forces, alpha), (m + 1,), in floats."""
        return np.asarray(np.linalg.solve(self._turn.T, border))

    def friction(self, alpha: Ball) -> Ball:
        """Coefficients for all alpha of a ball, (p,)."""
        return Ball.exact(self.F0) + alpha * Ball.exact(self.F1)

    def past(self, z: Ball, along: Ball, half: float, side: Array) -> Ball:
        """Bounds of |z_t| - F z_n of every node, (p,), at all (z, alpha) + t along + s with |t| <= half, |s| <= side.

        By derivatives, so that changes of |z_t| and of F z_n along t cancel; without bounds where z_t may vanish.
        """
        p, m = self.p, self.m
        near = Ball(z.mid, (z.rad + along.size * half + side) * SAFE)
        plain = self.discs(near[m])
        F1 = Ball.exact(self.F1)
        with np.errstate(all="ignore"):
            at = Directions.of(plain.tangents(near[:m]))
        known = (at.least > 0) & (plain.F.mid > plain.F.rad * SAFE)
        e, pushed = Ball(at.e, np.where(known[:, None], at.turn, 0.0)), F1 * near[:p]
        slope = -(plain.F * along[:p]) - pushed * along[m]
        moved = plain.F.size * side[:p] + pushed.size * side[m]
        for k in (0, 1):
            has = self.places[:, k] >= 0
            there, rate = self.places[has, k], e[has, k]
            slope[has] = slope[has] + rate * along[there]
            moved[has] += rate.size * side[there]
        tangent = plain.tangents(z[:m])
        length = np.linalg.norm(tangent.mid, axis=1)
        length = Ball(length, (upper_norm(tangent.rad, axis=1) + 8 * UNIT * length) * SAFE + TINY)
        here = length - self.friction(z[m]) * z[:p] + Ball(np.zeros(p), np.full(p, half)) * slope
        return Ball(here.mid, np.where(known & np.isfinite(here.mid), (here.rad + moved) * SAFE + TINY, np.inf))

    def statuses(self, z: Ball) -> tuple[int | None, ...]:
        """The status that every node has strictly at all arguments (z, alpha) of P, None where it has none."""
        p, rubs, plain = self.p, np.any(self.places >= 0, axis=1), self.discs(z[-1])
        low, high = z.mid[:p] - z.rad[:p] * SAFE, z.mid[:p] + z.rad[:p] * SAFE
        tangent = plain.tangents(z[:-1])
        length, away = np.linalg.norm(tangent.mid, axis=1), upper_norm(tangent.rad, axis=1)
        least, most = (length - away) / SAFE - 8 * UNIT * length, (length + away) * SAFE + 8 * UNIT * length
        F_low, F_high = (plain.F.mid - plain.F.rad) / SAFE, (plain.F.mid + plain.F.rad) * SAFE
        touches = low > 0
        sticks = touches & rubs & (F_low > 0) & (most < F_low * low / SAFE)
        slips = touches & rubs & ~sticks & (least > np.maximum(F_high, 0.0) * high * SAFE)
        codes = np.select([high < 0, touches & ~rubs, sticks, slips], [OPEN, FRICTIONLESS, STICK, SLIP], -1)
        return tuple(None if code < 0 else code for code in codes.tolist())


def _ratios(problem: Any, occurs: NDArray[np.bool_]) -> Ball:
    """Ratios of both coefficients, at the second component of nodes with two; 1 elsewhere, (3p,)."""
    p = problem.p
    coefficients, slopes = np.array(problem.friction), np.array(problem.friction_slope)
    ratio = Ball.exact(np.ones(3 * p))
    for i in np.flatnonzero(np.all(occurs, axis=0)):
        (one, one_slope), (other, other_slope) = [
            (Fraction(float(coefficients[k, i])), Fraction(float(slopes[k, i]))) for k in range(2)
        ]
        if one * other_slope != other * one_slope:
            raise NotEnclosedError(
                f"the ratio of the coefficients of friction of contact node {problem.node_ids[i]} changes with "
                "alpha; expected a constant one"
            )
        q = other / one if one else other_slope / one_slope
        exact = Fraction(float(q)) == q
        ratio.mid[2 * p + i], ratio.rad[2 * p + i] = float(q), 0.0 if exact else 2 * UNIT * abs(float(q))
    return ratio


def _bordered(data: Sequence[Ball], rows: RigidRows) -> list[Ball]:
    """S, g0 and g1 with the rows of the body as a whole, as (14.9) has them."""
    (S, g0, g1), G, none = data, rows.G, np.zeros((len(rows.unit),) * 2)
    mid = np.block([[S.mid, -G.mid.T], [G.mid, none]])
    return [
        Ball(mid, np.block([[S.rad, G.rad.T], [G.rad, none]])),
        Ball.joined(g0, rows.h),
        Ball.joined(g1, rows.slope),
    ]


def _one_more(rho: Array) -> Ball:
    """1 + rho, which is a float for powers of two near one."""
    total = 1.0 + rho
    exact = (total - rho == 1.0) & (total - 1.0 == rho)
    return Ball(total, np.where(exact, 0.0, UNIT * total))


def _steps(S: Array, tau: Sequence[NDArray[np.intp]]) -> Array:
    m = 3 * len(tau)
    held, G = S[:m, :m], S[m:, :m]
    rho = np.sqrt(np.diagonal(np.linalg.inv(held)) / np.diagonal(held))
    for t in tau:
        rho[t] = np.min(rho[t], initial=np.inf)
    # as far as the forces would move the body on springs; a rigid displacement may move no contact node
    stiffness = np.diagonal(G @ np.linalg.solve(held, G.T))
    return np.append(rho, 1.0 / np.where(stiffness > 0, stiffness, 1.0))


def _power(size: float) -> float:
    """The power of two next to a size; 1 where a load of it may over- or underflow with others."""
    exponent = float(np.round(np.log2(size))) if size > 0 else 0.0
    return float(2.0**exponent) if abs(exponent) < _LARGEST else 1.0


@dataclass(frozen=True, eq=False)
class SolutionCurve:
    """The solutions in a box: one for every t from -half to half, and they are continuous in t.

    Attributes
    ----------
    box : CurveBox
    sign : int
        Of the bordered determinant: alpha increases with t where a root's index is this, and decreases otherwise.
    found : what was proven, in the units of the nodes
    """

    box: CurveBox
    sign: int
    found: _Proven

    @property
    def problem(self) -> AlphaProblem:
        """Whose solutions they are."""
        return self.found.near.problem

    @cached_property
    def spread(self) -> Array:
        """The solution at t is no farther from centre + t direction, (m + 1,)."""
        return np.asarray(self.found.spread[0] * self.found.near.unit)

    @property
    def reach(self) -> Array:
        """Distance from centre + t direction of the set in which the curve has the only solutions, (m + 1,)."""
        found = self.found
        return np.asarray(found.step.reach(found.radius, found.shares) * found.near.unit)

    @cached_property
    def slope(self) -> Ball:
        """A ball, (m + 1,), of all (x(t) - x(t')) / (t - t'); without bounds where none are known."""
        return Ball(self.box.direction.copy(), self.found.slope * self.found.near.unit)

    @cached_property
    def statuses(self) -> tuple[int | None, ...]:
        """p codes: OPEN, STICK, SLIP or FRICTIONLESS where it holds strictly along all of the curve."""
        return self.found.statuses

    def at(self, t: float | Ball) -> Ball:
        """Bounds of the solution at t, or of those at all t of a ball."""
        where = t if isinstance(t, Ball) else Ball.exact(np.array(float(t)))
        point = Ball.exact(self.box.centre) + where * Ball.exact(self.box.direction)
        return Ball(point.mid, (point.rad + self.spread) * SAFE)

    def holds(self, x: Ball, share: float = 1.0) -> bool:
        """True if all points of a ball lie in the set in which the curve has the only solution for every t.

        It is larger than the box where nodes change their status: the curve bends there by more than the radius.
        ``share`` is of the size of that set; what a ball leaves of the box is bounded by every number of the ball once.
        """
        found, unit = self.found, Ball.exact(1.0 / self.found.near.unit)
        if not self.parameter(x).size <= share * self.box.half:
            return False
        off = unit * (x - Ball.exact(self.box.centre))
        turn, shares_of, rest_of = self._beside
        beside = (turn @ Ball.exact(off.mid)[:, None])[:, 0]
        radius = share * found.radius
        if np.all((beside.size + upper_product(turn.size, off.rad)) * SAFE <= radius):
            return True
        # G s + b: what the ball adds has an s of its own
        room = share * found.shares - upper_product(shares_of.size, off.rad) * SAFE
        if not len(room) or np.any(room < 0):
            return False
        G = found.step.G.mid
        s = np.clip(np.linalg.lstsq(G / radius[:, None], beside.mid / radius)[0], -room, room)
        rest = beside - (Ball.exact(G) @ Ball.exact(s[:, None]))[:, 0]
        return bool(np.all((rest.size + upper_product(rest_of.size, off.rad)) * SAFE <= radius))

    @cached_property
    def _beside(self) -> tuple[Ball, Ball, Ball]:
        """1 - d e' in the units of the nodes, and the same times P and 1 - G P, with P near the inverse of G."""
        near, G = self.found.near, self.found.step.G.mid
        turn = Ball.exact(np.eye(len(near.c))) - Ball.exact(near.d[:, None]) * Ball.exact(near.e[None, :])
        shares_of = Ball.exact(np.asarray(np.linalg.pinv(G), dtype=np.float64)) @ turn
        return turn, shares_of, turn - Ball.exact(G) @ shares_of

    def parameter(self, x: Ball) -> Ball:
        """Bounds of t at points within a ball."""
        return parameter_in(self.box, x)

    @property
    def stretch(self) -> float:
        """Factor by which a box that is found as this one was may about be longer; no claim."""
        found = self.found
        if not found.near.half:
            return 1.0
        radius, (spread, _, closer) = found.radius, found.spread
        with np.errstate(all="ignore"):
            whole, least = (float(np.max(step.E @ radius / radius)) for step in (found.step, closer))
            share = float(np.max(spread / radius))
            # the step contracts by e h + k r for boxes of length h and radius r
            k = max((whole - least) / (1.0 - share), 0.0) if share < 1 else 0.0
            most = 1.0 / (max(least - k * share, 0.0) + np.sqrt(_ROOM * k * share * max(1.0 - least, 0.0)))
        return float(most) if most > 0 else 1.0

    @property
    def rises(self) -> int:
        """The sign of d alpha / dt along all of the curve; 0 where it is not known, or changes."""
        low, high = self.slope.mid[-1] - self.slope.rad[-1] * SAFE, self.slope.mid[-1] + self.slope.rad[-1] * SAFE
        return int(low > 0) - int(high < 0)

    @property
    def index(self) -> int:
        """Index of its roots; 0 where it is not known, or changes."""
        return self.sign * self.rises

    @property
    def alphas(self) -> tuple[Fraction, Fraction]:
        """Between them are all alpha of the curve."""
        box = self.box
        reach = Fraction(abs(float(box.direction[-1]))) * Fraction(box.half) + Fraction(float(self.spread[-1]))
        return Fraction(float(box.centre[-1])) - reach, Fraction(float(box.centre[-1])) + reach


def parameter_in(box: CurveBox, x: Ball) -> Ball:
    """Bounds of t = border (x - centre) at all points of a ball."""
    return (Ball.exact(box.border[None]) @ (x - Ball.exact(box.centre))[:, None])[0, 0]


def lies_in(box: CurveBox, x: Ball) -> bool:
    """True if all points of a ball lie in a box."""
    t = parameter_in(box, x)
    beside = (x - Ball.exact(box.centre)) - t * Ball.exact(box.direction)
    return bool(t.size <= box.half and np.all(beside.size <= box.radius))


def only_curve(problem: AlphaProblem, box: CurveBox, errors: float = 1.0) -> SolutionCurve | None:
    """The curve that the solutions in a box are, or None where that is not proven.

    Parameters
    ----------
    problem : AlphaProblem
    box : CurveBox
        With positive radii and steps, one for both components of tau of a node.
    errors : 1 proves; a writer of proofs takes more, so that a checker comes to the same answer
    """
    arrays = (box.centre, box.direction, box.border, box.radius)
    if not all(array.shape == (problem.m + 1,) and np.all(np.isfinite(array)) for array in arrays):
        return None
    if not np.isfinite(box.half) or box.half < 0 or not np.all(box.radius > 0):
        return None
    # those of the problem are steps of a natural map, and so are both together
    if box.rho.shape != (problem.m,) or not are_steps(box.rho, problem.places):
        return None
    with np.errstate(all="ignore"):
        near = _CurveMap(problem, box.centre, box.direction, box.border, box.half, box.rho)
        found = near.mapped(box.radius / near.unit, errors)
        return None if found is None else found.curve(box)


def curve_around(
    problem: AlphaProblem,
    x: Array,
    direction: Array,
    border: Array,
    half: float,
    changing: Sequence[int] = (),
    *,
    rho: Array | None = None,
    roomy: bool = True,
) -> SolutionCurve | None:
    """The curve that runs near x, in a box that is proposed; as ``only_curve`` proves it with ``ERRORS``.

    Parameters
    ----------
    changing : nodes whose status changes in the box
    rho : steps of the natural map relative to those of the problem; ``corner_steps`` by default
    roomy : whether its radii are to be as large as they may be
    """
    with np.errstate(all="ignore"):
        steps = corner_steps(problem, x, direction, border, half, changing)[0] if rho is None else rho
        return _CurveMap(problem, x, direction, border, half, steps).proposed(roomy=roomy)


def corner_steps(
    problem: AlphaProblem,
    x: Array,
    direction: Array,
    border: Array,
    half: float,
    changing: Sequence[int],
    known: tuple[Array, float] | None = None,
) -> tuple[Array, float]:
    """Steps for ``curve_around`` where nodes change their statuses, and how wide corners are with them.

    ``known``: what is returned for a longer box around the same corner: mostly it serves for all of them.
    """
    rho, best = np.ones(problem.m), 0.0
    if not len(changing):
        return rho, best
    with np.errstate(all="ignore"):

        def turned(steps: Array) -> float:
            return _CurveMap(problem, x, direction, border, half, steps).turned()

        if known is not None and known[1] < 1.0 and turned(known[0]) <= _AS_WIDE * known[1]:
            return known
        best = turned(rho)
        # all nodes alike, then each of them by itself
        for nodes in [changing, *([[i] for i in changing] if len(changing) > 1 else [])]:
            if best < _TURNED:
                continue
            tau = [int(t) for i in nodes for t in problem.tau[i]]
            found: list[tuple[float, Array]] = []
            for factor in _FACTORS:
                for places in (list(nodes), tau, [*nodes, *tau]):
                    other = rho.copy()
                    other[places] *= factor
                    found.append((turned(other), other))
            best, rho = min(found, key=lambda pair: pair[0])
        return rho, best


@dataclass(frozen=True, eq=False)
class CurvePoint:
    """A solution x as floats have it, the direction of its curve, and statuses by the signs of their conditions.

    z are the arguments of P there, and alpha.
    """

    x: Array
    direction: Array
    statuses: tuple[int | None, ...]
    z: Array


def curve_point(problem: AlphaProblem, x: Array, border: Array) -> CurvePoint | None:
    """The point of a solution's curve near x with border (x' - x) = 0; no claim.

    Its direction has the product 1 with the border; at a change of statuses it is that of one side.
    """
    m, unit = problem.m, np.append(problem.force, 1.0)
    x, row, asked = x / unit, border * unit, np.zeros((m + 1, 2))
    asked[m, 1] = 1.0
    with np.errstate(all="ignore"):
        for _ in range(_STEPS):
            y = problem.part.mid @ x + problem.offset.mid
            z = np.append(2.0 * y - x[:m], x[m])
            projected, D = _projected(problem, z)
            asked[:m, 0] = projected - y
            B = np.vstack([problem.part.mid - D @ problem.plain_moves, row])
            try:
                found = np.linalg.solve(B, asked)
            except np.linalg.LinAlgError:
                return None
            x = x + found[:, 0]
            if np.all(np.abs(found[:, 0]) <= 4 * UNIT * np.max(np.abs(x))):
                break
        statuses = problem.statuses(Ball.exact(z))
    return CurvePoint(x * unit, found[:, 1] * unit, statuses, z) if np.all(np.isfinite(found)) else None


def _projected(problem: AlphaProblem, z: Array) -> tuple[Array, Array]:
    """P of arguments (z, alpha) and a derivative of it, (m,) and (m, m + 1), in floats."""
    p, m = problem.p, len(z) - 1
    has, nodes, F = problem.places >= 0, np.arange(p), problem.F0 + z[m] * problem.F1
    normal, tangent = np.maximum(z[:p], 0.0), np.where(has, z[problem.places], 0.0)
    most, length = F * normal, np.linalg.norm(tangent, axis=1)
    touches = z[:p] > 0
    sticks = touches & (length <= most)
    ratio = np.where(sticks, 1.0, most / np.where(length > 0, length, 1.0))
    e = np.where(sticks, 0.0, 1.0)[:, None] * tangent / np.where(length > 0, length, 1.0)[:, None]
    P, D, kept = np.zeros(m), np.zeros((m, m + 1)), np.arange(3 * p, m)
    P[kept], D[kept, kept] = z[kept], 1.0
    P[:p], D[nodes, nodes] = normal, touches
    for k in (0, 1):
        own = nodes[has[:, k]]
        at = problem.places[own, k]
        P[at] = ratio[own] * tangent[own, k]
        D[at, own] = np.where(touches, F, 0.0)[own] * e[own, k]
        D[at, m] = (problem.F1 * normal)[own] * e[own, k]
        for j in (0, 1):
            both = own[has[own, j]]
            D[problem.places[both, k], problem.places[both, j]] = ratio[both] * ((k == j) - e[both, k] * e[both, j])
    return P, D


@dataclass(frozen=True, eq=False)
class _Proven:
    """Krawczyk's operator around a box, in the units of the nodes, and shares with which it contracts."""

    near: _CurveMap
    radius: Array
    step: Step
    shares: Array

    def curve(self, box: CurveBox) -> SolutionCurve | None:
        """The curve in the box; None where the sign of the determinant is not proven."""
        sign = determinant_sign(Ball.exact(self.step.Y))
        return SolutionCurve(box, sign, self) if sign else None

    @cached_property
    def spread(self) -> tuple[Array, Array, Step]:
        """Bounds of the distances from c + t d of all solutions, of (z, alpha) there, and the operator for those."""
        with np.errstate(all="ignore"):
            near, half, step, shares, radius = self.near, self.near.half, self.step, self.shares, self.radius
            for _ in range(_IMAGES):
                for _ in range(_IMAGES):
                    radius, shares = step.left(radius, shares, half), step.xi(radius, shares, half)
                extent = near.extent(radius, near.beside(step, shares))
                wide = extent.near.rad
                # the same solutions, whatever the shares are
                radius = step.reach(radius, shares)
                if not half:
                    # derivatives at a point are known but for rounding
                    return radius, wide, step
                closer = near.step(extent)
                found = None if closer is None else closer.shares(radius, half)
                if closer is None or found is None:
                    return radius, wide, step
                step, shares = closer, np.zeros(len(closer.along))
            return radius, wide, step

    @cached_property
    def statuses(self) -> tuple[int | None, ...]:
        """Codes where a status holds strictly along all of the curve."""
        with np.errstate(all="ignore"):
            return self.near.problem.statuses(Ball(self.near.z.mid, self.spread[1]))

    @cached_property
    def slope(self) -> Array:
        """Bound of the distance of differences over t from d; infinite where none is known."""
        with np.errstate(all="ignore"):
            step = self.spread[2]
            radius = step.balanced(1.0, 0.0, 1.1)
            if radius is not None:
                radius = np.maximum(radius, UNIT * np.max(radius)) + TINY
                shares = step.shares(radius, 1.0, 0.0)
                if shares is not None and step.contracts(radius, shares, 1.0, 1.0, 0.0):
                    for _ in range(_IMAGES):
                        radius, shares = step.left(radius, shares, 1.0, 0.0), step.xi(radius, shares, 1.0, 0.0)
                    return step.reach(radius, shares)
            return np.full(len(self.near.d), np.inf)


class _CurveMap:
    """The natural map along c + t d, |t| <= half, with the equation border (x - c) = t, in units of the nodes."""

    def __init__(
        self, problem: AlphaProblem, centre: Array, direction: Array, border: Array, half: float, rho: Array
    ) -> None:
        self.problem, self.half, self.rho = problem, half, rho
        self.unit = np.append(problem.force, 1.0)
        self.c, self.d, self.e = centre / self.unit, direction / self.unit, border * self.unit
        self.Z = problem.moves(rho)
        x = Ball.exact(self.c)
        self.alpha = x[-1]
        self.y = problem.forces_at(x)
        #: (z, alpha) there.
        self.z = Ball.joined(problem.arguments(x, self.y, rho), x[-1:])
        self.zd = (self.Z @ Ball.exact(self.d)[:, None])[:, 0]

    # -- boxes -----------------------------------------------------------------------------------------------------

    def turned(self) -> float:
        """Width of corners relative to what the test bears: less than 1 where it bears them."""
        step = self.step(self.extent())
        if step is None or not np.all(np.isfinite(step.slopes)):
            return np.inf
        return float(np.max(np.abs(np.linalg.eigvals(step.slopes)), initial=0.0))

    def proposed(self, *, roomy: bool) -> SolutionCurve | None:
        """The curve in a box with radii of about what it needs, or as large as they may be."""
        step = straight = self.step(self.extent())
        found = None
        for room in _ROOMS:
            radius = None if step is None else step.balanced(self.half, 1.0, room)
            if step is None or radius is None:
                return None
            radius = np.maximum(radius, _LEAST * np.max(radius)) + TINY
            shares = step.shares(radius, self.half)
            if shares is None:
                return None
            side = self.beside(step, shares)
            step, found = self.tried(radius, ERRORS, side)
            if found is not None and not roomy and np.any(side):
                # a checker begins without a side, from where another treatment of a corner may be come to
                found = self.mapped(radius, ERRORS)
            if found is not None:
                break
        if found is None or straight is None:
            return None
        if roomy:
            # parts of the curve are to have room beside it
            larger = (self.mapped(factor * found.radius, ERRORS) for factor in self._factors(straight, found))
            found = next((one for one in larger if one is not None), None)
        if found is None:
            return None
        unit = self.unit
        return found.curve(
            CurveBox(self.c * unit, self.d * unit, self.e / unit, self.half, found.radius * unit, self.rho)
        )

    def _factors(self, straight: Step, found: _Proven) -> list[float]:
        """By what a radius is multiplied, the first one with which the step may still contract."""
        radius = found.radius
        most = float(np.max(np.abs(self.d))) * self.half / float(np.max(radius))
        none, once = (float(np.max(step.E @ radius / radius)) for step in (straight, found.step))
        moved = float(np.max((straight.move.size + straight.drift * self.half) / radius))
        # it contracts by e + k r; the larger r at which what it leaves is r
        k, free = max(once - none, 0.0), max(1.0 - none, 0.0)
        limit = (free + np.sqrt(max(free * free - 4.0 * k * moved, 0.0))) / (2.0 * k) if k > 0 else np.inf
        most = max(min(most, _OF_LIMIT * float(limit)), _TWICE)
        return [_TWICE * (most / _TWICE) ** share for share in (_SHARES if most > _TWICE else _SHARES[-1:])]

    def mapped(self, radius: Array, errors: float) -> _Proven | None:
        """The operator around a box, if it maps sets that hold the box into their interiors."""
        return self.tried(radius, errors, np.zeros(len(self.c)))[1]

    def tried(self, radius: Array, errors: float, side: Array) -> tuple[Step | None, _Proven | None]:
        """The operator around a box, and what it proves, if it does.

        ``side``: what (z, alpha) are farther away there from those of c than t d and b move them, as far as is known.
        """
        step = None
        for _ in range(_WIDENINGS):
            step = self.step(self.extent(radius, side))
            shares = None if step is None else step.shares(radius, self.half)
            if step is None or shares is None:
                return step, None
            needed = self.beside(step, shares)
            if np.all(needed <= side):
                proven = step.contracts(radius, shares, errors, self.half)
                return step, _Proven(self, radius, step, shares) if proven else None
            side = np.maximum(side, needed) * (1.0 + MARGIN)
        return step, None

    def extent(self, radius: Array | None = None, side: Array | None = None) -> Extent:
        """All (z, alpha) at x = c + t d + b and no farther away from those than a side."""
        nothing = np.zeros(len(self.c))
        return Extent(
            self.z, self.zd, self.half, self.Z, nothing if radius is None else radius, nothing if side is None else side
        )

    def beside(self, step: Step, shares: Array) -> Array:
        """Bounds of what G s changes of (z, alpha)."""
        if not len(shares):
            return np.zeros(len(self.c))
        return upper_product((self.Z @ Ball.exact(step.G.mid)).size, shares) * SAFE

    # -- the operator ----------------------------------------------------------------------------------------------

    def step(self, extent: Extent) -> Step | None:
        """Krawczyk's operator where (z, alpha) are in an extent.

        None where its middle matrix is singular or there is no bound of derivatives.
        """
        m = len(self.c) - 1
        near = extent.near
        corners = self.problem.discs(near[m]).corners(near[:m], extent)
        if corners is None:
            return None
        B = self._bordered(corners)
        found = middle_inverse(B)
        if found is None:
            return None
        Y, E = found
        turned, turning = corners.turns.bounds(Y[:, :m], self.Z.mid, self.d)
        inverse = Ball.exact(Y)
        move = (inverse[:, :m] @ self._moved[:, None])[:, 0]
        d = Ball.exact(self.d)[:, None]
        drift = (inverse @ (B @ d - Ball.exact(np.eye(m + 1)[:, m:])))[:, 0]
        if not corners.u.shape[1]:
            none = np.zeros(0)
            G, V = Ball.exact(np.zeros((m + 1, 0))), Ball.exact(np.zeros((0, m + 1)))
            return Step(move, (E + turned) * SAFE, G, V, Y, (drift.size + turning) * SAFE, none, none)
        G, V = inverse[:, :m] @ Ball.exact(corners.u), Ball.exact(corners.v.T) @ self.Z
        # what goes along the columns of G is a matter of the shares
        first, move = split_off(G, move)
        along, rest = split_off(G, drift)
        pushed = 0.5 * (V @ d)[:, 0].size
        drifts = (rest.size + turning) * SAFE
        return Step(move, (E + turned) * SAFE, G, V, Y, drifts, first, (np.abs(along) + pushed) * SAFE)

    @cached_property
    def _moved(self) -> Ball:
        """-N(c)."""
        return self.problem.discs(self.alpha).projected(self.z[:-1]) - self.y

    def _bordered(self, corners: Corners) -> Ball:
        B = self.problem.part - corners.still @ self.Z
        # what turns is multiplied by the middle of Z
        return Ball.joined(Ball(B.mid, (B.rad + corners.wide @ self.Z.rad) * SAFE), Ball.exact(self.e[None]))
