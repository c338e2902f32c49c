"""The trusted test in 3D that the solutions in a box of forces and alpha are one curve (theory, section 12.8).

Of a body that nothing holds, the coordinates of its rigid displacement are among the forces (theory, section 14.14).

Krawczyk's operator is applied to the natural map with alpha as one more unknown and one linear equation more, for all
values of that equation's right-hand side, the curve's parameter, at once.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball, determinant_sign, solution, upper_norm
from enumsol.condensation.condensed import node_units
from enumsol.condensation.enclosure import NotEnclosedError, RigidRows
from enumsol.condensation.space_condensed import node_friction
from enumsol.model.sectors import SECTORS
from enumsol.trusted.space.krawczyk import Contraction, NaturalMap
from enumsol.trusted.space.natural_map import Discs, are_steps, outwards, upper_product
from enumsol.trusted.space.sector_rows import FRICTIONLESS, OPEN, STICK

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from enumsol.condensation.data import ProblemData
    from enumsol.condensation.enclosure import CondensedEnclosure

    Array = NDArray[np.float64]

#: Slip in any direction, as in continuation.
SLIP = SECTORS + 1
#: Loads whose exponents are larger have no unit of their own.
_LARGEST = 200


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
            ratio = Ball.joined(_ratios(problem), Ball.exact(np.ones(len(rows.unit))))
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

    @cached_property
    def unit(self) -> Array:
        """Units of (zeta, alpha), (m + 1,)."""
        return np.append(self.force, 1.0)

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

    def friction(self, alpha: Ball) -> Ball:
        """Coefficients for all alpha of a ball, (p,)."""
        return Ball.exact(self.F0) + alpha * Ball.exact(self.F1)

    def lengths(self, z: Ball) -> tuple[Array, Array]:
        """Bounds of |z_t| of every node at all (z, alpha) of a ball, (p,) each; the lower ones may be negative."""
        tangent = self.discs(z[-1]).tangents(z[:-1])
        length, away = np.linalg.norm(tangent.mid, axis=1), upper_norm(tangent.rad, axis=1) * SAFE
        rounded = 8 * UNIT * length + TINY
        return length - away - rounded, length + away + rounded

    def possible(self, z: Ball, gap: Ball | None = None) -> tuple[frozenset[int], ...]:
        """The statuses that every node may have at arguments (z, alpha) of P in a ball.

        ``gap``: bounds of |z_t| - F z_n, (p,), if more is known of it than the ball tells.
        """
        p, rubs, (least, most) = self.p, np.any(self.places >= 0, axis=1), self.lengths(z)
        gap = Ball(np.zeros(p), np.full(p, np.inf)) if gap is None else gap
        (low, high), (F_low, F_high) = outwards(z[:p]), outwards(self.friction(z[-1]))
        # a status is left out where it is refuted: what overflowed refutes nothing
        touches, away = ~(high < 0), np.abs(gap.mid) > gap.rad * SAFE
        outside = (away & (gap.mid > 0)) | (least > np.maximum(F_high, 0.0) * high * SAFE + TINY)
        inside = (away & (gap.mid < 0)) | ((F_low >= 0) & (most < F_low * np.maximum(low, 0.0) / SAFE - TINY))
        codes = OPEN, FRICTIONLESS, STICK, SLIP
        loaded = touches & rubs
        found = np.column_stack([~(low > 0), touches & ~rubs, loaded & ~outside, loaded & ~inside]).tolist()
        return tuple(frozenset(code for code, may in zip(codes, node, strict=True) if may) for node in found)

    def statuses(self, z: Ball) -> tuple[int | None, ...]:
        """The status that every node has strictly at all arguments (z, alpha) of P, None where it has none."""
        return tuple(min(codes) if len(codes) == 1 else None for codes in self.possible(z))


def _ratios(problem: ProblemData) -> Ball:
    """Ratios of both coefficients, at the second component of nodes with two; 1 elsewhere, (3p,)."""
    p = problem.p
    ratio = Ball.exact(np.ones(3 * p))
    for i, (_, _, q) in enumerate(node_friction(problem)):
        if q:
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
    problem : AlphaProblem
        Whose solutions they are.
    found : Contraction
        In the units of the nodes.
    """

    box: CurveBox
    sign: int
    problem: AlphaProblem
    found: Contraction

    @cached_property
    def spread(self) -> Array:
        """The solution at t is no farther from centre + t direction, (m + 1,)."""
        return np.asarray(self.found.spread[0] * self.problem.unit)

    @property
    def reach(self) -> Array:
        """Distance from centre + t direction of the set in which the curve has the only solutions, (m + 1,)."""
        return np.asarray(self.found.reach * self.problem.unit)

    @cached_property
    def slope(self) -> Ball:
        """A ball, (m + 1,), of all (x(t) - x(t')) / (t - t'); without bounds where none are known."""
        return Ball(self.box.direction.copy(), self.found.slope * self.problem.unit)

    @cached_property
    def statuses(self) -> tuple[int | None, ...]:
        """p codes: OPEN, STICK, SLIP or FRICTIONLESS where it holds strictly along all of the curve."""
        with np.errstate(all="ignore"):
            return self.problem.statuses(Ball(self.found.near.z.mid, self.found.spread[1]))

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
        found, unit = self.found, Ball.exact(1.0 / self.problem.unit)
        if not parameter_in(self.box, x).size <= share * self.box.half:
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
        turn = Ball.exact(np.eye(len(near.d))) - Ball.exact(near.d[:, None]) * Ball.exact(near.border)
        shares_of = Ball.exact(np.asarray(np.linalg.pinv(G), dtype=np.float64)) @ turn
        return turn, shares_of, turn - Ball.exact(G) @ shares_of

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


def only_curve(problem: AlphaProblem, box: CurveBox) -> SolutionCurve | None:
    """The curve that the solutions in a box are, or None where that is not proven.

    Parameters
    ----------
    problem : AlphaProblem
    box : CurveBox
        With positive radii and steps, one for both components of tau of a node.
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
        found = map_around(problem, box).mapped(box.radius / problem.unit, 1.0)
        return None if found is None else curve_of(problem, box, found)


def map_around(problem: AlphaProblem, box: CurveBox) -> NaturalMap:
    """The natural map along centre + t direction, in units of the nodes, with the equation border (x - centre) = t."""
    unit = problem.unit
    x, d, border = Ball.exact(box.centre / unit), box.direction / unit, (box.border * unit)[None]
    y = problem.forces_at(x)
    z = Ball.joined(problem.arguments(x, y, box.rho), x[-1:])
    return NaturalMap(problem.part, problem.moves(box.rho), y, z, problem.discs, d, box.half, border)


def curve_of(problem: AlphaProblem, box: CurveBox, found: Contraction) -> SolutionCurve | None:
    """The curve in a box; None where the sign of the determinant is not proven."""
    sign = determinant_sign(Ball.exact(found.step.Y))
    return SolutionCurve(box, sign, problem, found) if sign else None
