"""A condensed problem in 3D at one alpha in the variables in which every node is isotropic (theory, section 12.1).

Of a body that nothing holds, too (theory, section 14.6).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball, gamma, nearest, upper_norm
from enumsol.condensation.condensed import LARGEST_NUMBER, UNIT_EXPONENT, cholesky_factor, load_unit, node_units
from enumsol.condensation.data import exactly_at
from enumsol.condensation.enclosure import EnclosedSystem, NotEnclosedError, RigidRows, coefficients, of_compliance
from enumsol.errors import InvalidProblemError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from enumsol.condensation.data import ProblemData
    from enumsol.condensation.enclosure import CondensedEnclosure
    from enumsol.support.array_types import Floats, Indices, Mask

    _Variables = tuple[Ball, Indices, tuple[Floats, Floats, Indices, Floats]]

#: Coefficients between 2^-9 and 2^8 keep tau as it is: S loses no more than twice so many binary digits by them.
_NEAR_ONE = 8
#: Smaller coefficients than this, but for 0, would make tau overflow float64, as units beyond theirs would.
LEAST_FRICTION = 2.0**-UNIT_EXPONENT
#: Points of an interval whose data are kept.
_KEPT = 256


class FrictionUnits:
    """What systems in 3D share: units of tau, by which S keeps its condition whatever F is (theory, section 12.1).

    Attributes
    ----------
    tau : (p, 2) array of int
        Where in y the components of tau are; -1 where they do not occur.
    unit : (m,) array
        A tau is ``unit`` times its entry in y and a v its entry in w over ``unit``; powers of two, 1 for normals.
    """

    tau: Indices
    unit: Floats

    @cached_property
    def row_unit(self) -> Floats:
        """Factors that take rows on (lambda_n, tau) and (w_n, v) to rows on y and w, shape (2 m,)."""
        return np.concatenate([self.unit, 1.0 / self.unit])

    def tangential(self, values: Floats) -> Floats:
        """The parts of y or w that belong to tau, shape (p, 2), 0 where it does not occur."""
        return np.where(self.tau >= 0, values[self.tau], 0.0)

    @cached_property
    def tau_units(self) -> Floats:
        """Units of tau, shape (p, 2), 1 where it does not occur."""
        return np.where(self.tau >= 0, self.unit[self.tau], 1.0)

    @cached_property
    def disc_scale(self) -> Floats:
        """By what |tau| <= lambda_n is multiplied so that nothing in it is large, shape (p,)."""
        return np.asarray(1.0 / np.maximum(np.max(self.tau_units, axis=1), 1.0))

    @cached_property
    def slip_scale(self) -> Floats:
        """By what v is multiplied so that its larger component has the size of w_t, shape (p,)."""
        return np.asarray(np.min(self.tau_units, axis=1))

    @cached_property
    def tau_scale(self) -> Floats:
        """By what entries of y are multiplied to give tau times ``disc_scale``, shape (p, 2)."""
        return self.tau_units * self.disc_scale[:, None]

    def slips(self, w: Floats) -> Floats:
        """v times ``slip_scale``, shape (p, 2)."""
        return self.tangential(w) * (self.slip_scale[:, None] / self.tau_units)


def friction_units(F: Floats) -> Floats:
    """Powers of two that take coefficients to a size near one; 1 where they have it or are 0."""
    exponent = np.frexp(F)[1]
    return np.ldexp(1.0, np.where(np.abs(exponent) > _NEAR_ONE, -exponent, 0))


@dataclass(frozen=True)
class SpaceSystem(FrictionUnits):
    """w = g - S y without units, y = (lambda_n, tau) with lambda_t = F tau, w = (w_n, v) with v = F w_t.

    Components of tau whose coefficient is 0 do not occur. All normals come first, then the tau node by node, in the
    units of FrictionUnits.

    Attributes
    ----------
    S : (m, m) symmetric positive definite array
    g : (m,) array
    F : (p, 2) array
        Friction coefficients in the units of tau: lambda_t is F times the entry in y.
    tau, unit : arrays
        See FrictionUnits.
    force, length : (p,) arrays
        Forces of a node are ``force`` times the scaled ones, displacements ``length`` times; powers of two.
    """

    S: Floats = field(repr=False)
    g: Floats
    F: Floats
    tau: Indices
    unit: Floats
    force: Floats
    length: Floats

    @classmethod
    def in_middle(cls, enclosed: EnclosedSpace, units: tuple[Floats, Floats]) -> SpaceSystem:
        """System in the middle of balls, in units of force and length, (p,) each."""
        return cls(enclosed.S, enclosed.g, enclosed.F, enclosed.tau, enclosed.unit, *units)

    @classmethod
    def scaled(cls, S: Floats, g: Floats, F: Floats) -> SpaceSystem:
        """From S (3p, 3p) and g (3p,), all normals first, then both tangents, and coefficients F (p, 2).

        Raises
        ------
        InvalidProblemError
            S is not positive definite to working precision, or a coefficient is too small or too large for float64.
        """
        p = len(F)
        if (why := _out_of_range(F)) is not None:
            raise InvalidProblemError(why)
        factor = node_units(S, p)
        tau, rows, node, axis = places(F > 0)
        units = friction_units(F)
        F = F * units
        unit = np.concatenate([np.ones(p), units[node, axis]])
        weight = np.concatenate([factor, factor[node] * F[node, axis]])
        S = weight[:, None] * S[np.ix_(rows, rows)] * weight
        g = weight * g[rows]
        size = load_unit(g, cholesky_factor(S))
        return cls(S, g / size, F, tau, unit, factor * size, size / factor)

    @property
    def p(self) -> int:
        """Number of contact nodes."""
        return len(self.F)


def _out_of_range(F: Floats) -> str | None:
    """Why coefficients are too small or too large for float64, or None."""
    for wrong, limit in (
        (F[F > LARGEST_NUMBER], f"where float64 overflows; expected at most {LARGEST_NUMBER:g}"),
        (F[(F > 0) & (F < LEAST_FRICTION)], f"where float64 underflows; expected 0, or at least {LEAST_FRICTION:.1e}"),
    ):
        if len(wrong):
            return f"a friction coefficient is {wrong[0]:g}, {limit}"
    return None


def places(occurs: Mask) -> tuple[Indices, Indices, Indices, Indices]:
    """Places of the components of tau in y, (p, 2); the rows of S in 3p that y takes; nodes and axes of its tau."""
    p = len(occurs)
    node, axis = np.nonzero(occurs)
    tau = np.full((p, 2), -1, dtype=np.intp)
    tau[node, axis] = p + np.arange(len(node))
    return tau, np.concatenate([np.arange(p), (1 + axis) * p + node]), node, axis


_OVERFLOW = "the condensed problem over- or underflows float64; expected data in other units"


@dataclass(frozen=True)
class PieceTurn:
    """How a problem changes along a piece of alpha: with s from -1 to 1 by ``g + s g_turn`` and ``disc + s disc_turn``.

    Attributes
    ----------
    g, g_turn : Ball of shape (m,)
    disc, disc_turn : Ball of shape (p,)
    """

    g: Ball
    g_turn: Ball
    disc: Ball
    disc_turn: Ball


#: Stands for the discs at one alpha, all of the radius one.
_ONES = Ball.exact(np.ones(0))


@dataclass(frozen=True)
class EnclosedSpace(EnclosedSystem, FrictionUnits):
    """A SpaceSystem as balls: S, g and F for the data as given, at one alpha or at all alpha of a piece.

    Over a piece lambda_t is F tau with one F, so that S is the same everywhere and |tau| is at most the radius of a
    disc times lambda_n. g, h and these radii are affine in alpha; here they are the balls of the whole piece (theory,
    sections 12.9 and 14.14). In ``turn`` g is bordered by h.

    Attributes
    ----------
    tau, unit : arrays
        As in SpaceSystem.
    discs : Ball of shape (p,)
        Radii of the discs of tau over lambda_n, by default one; of an AlphaSpace F(alpha) over F.
    turn : PieceTurn or None
        Change of g and discs along a piece of alpha; None at one alpha.
    """

    tangents = 2

    tau: Indices
    unit: Floats
    discs: Ball = field(kw_only=True, default_factory=lambda: _ONES)
    turn: PieceTurn | None = field(kw_only=True, default=None)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.discs is _ONES:
            object.__setattr__(self, "discs", Ball.exact(np.ones(len(self.F))))

    @cached_property
    def inverse_friction(self) -> Ball:
        """1 / F, shape (p, 2), 1 where F is 0: what takes an entry of w to the displacement of a row in its units."""
        F = np.where(self.F > 0, self.F, 1.0)
        return Ball(1.0 / F, (2.0 * self.F_rad / F + 2 * UNIT) / F * SAFE)

    def forces_of(self, y: Ball, force: Floats) -> Ball:
        """Forces (3p,), all normals first, of scaled ones y, with units of force (p,); 0 where there is no friction."""
        return self._by_node(y, self.balls[2], force, 0.0)

    def displacements_of(self, w: Ball, length: Floats) -> Ball:
        """Displacements (3p,) of scaled ones w, with units of length (p,); unbounded where there is no friction."""
        return self._by_node(w, self.inverse_friction, length, np.inf)

    def _by_node(self, scaled: Ball, factors: Ball, unit: Floats, missing: float) -> Ball:
        """All normal components, then both tangential ones times their factors; zeros stay exact."""
        p, nodes = self.p, np.arange(self.p)
        found = Ball(np.zeros(3 * p), np.full(3 * p, missing))
        for k, at in enumerate([nodes, *self.tau.T]):
            has = np.flatnonzero(at >= 0)
            own = scaled[at[has]]
            part = own * factors[has, k - 1] if k else own
            rad = np.where((own.mid == 0) & (own.rad == 0), 0.0, part.rad * unit[has] + TINY)
            found[k * p + has] = Ball(part.mid * unit[has], rad)
        return found

    @property
    def end_discs(self) -> tuple[Ball, ...]:
        """``discs`` at both ends of the piece, between which they are affine in alpha; once where there is no piece."""
        turn = self.turn
        return (self.discs,) if turn is None else (turn.disc - turn.disc_turn, turn.disc + turn.disc_turn)

    @cached_property
    def largest_discs(self) -> Floats:
        """Upper bounds of ``discs``."""
        return np.where(self.discs.rad > 0, self.discs.size, self.discs.mid)

    @cached_property
    def references(self) -> Floats:
        """F of the first component with friction, (p,), as lambda_t is F tau; 1 where there is none."""
        found = np.ones(len(self.tau))
        for k in (1, 0):
            has = self.tau[:, k] >= 0
            found[has] = self.F[has, k] / self.unit[self.tau[has, k]]
        return found

    @of_compliance
    def largest_norm(self) -> float:
        """Upper bound on the norm of every S in the enclosure."""
        return float(upper_norm(self.S) + upper_norm(self.S_rad)) * SAFE

    @of_compliance
    def product_error(self) -> Floats:
        """By how much a computed S y, with the terms of a sum that it is part of, may be off, as a factor of |y|."""
        return np.asarray((gamma(len(self.g) + 4) * np.abs(self.S) + self.S_rad) * SAFE)

    @classmethod
    def of_floats(cls, system: SpaceSystem) -> EnclosedSpace:
        """S and g as they were computed."""
        S, g, F = system.S, system.g, system.F
        return cls(S, np.zeros_like(S), g, np.zeros_like(g), F, np.zeros_like(F), system.tau, system.unit)

    @classmethod
    def of_problem(cls, enclosure: CondensedEnclosure, alpha: Fraction, force: Floats, length: Floats) -> EnclosedSpace:
        """Balls for the exact data at alpha, in units of the nodes given by powers of two (see SpaceSystem).

        Raises
        ------
        NotEnclosedError
            Something over- or underflows.
        """
        pairs = zip(*(part.T for part in enclosure.problem.affine_friction), strict=True)
        axes = [coefficients(exactly_at(alpha, *pair)) for pair in pairs]
        F, F_rad = (np.stack(part, axis=1) for part in zip(*((F.mid, F.rad) for F in axes), strict=True))
        return _enclosed(enclosure, alpha, (force, length), _variables(F, F_rad))


@dataclass(frozen=True, eq=False)
class AlphaSpace:
    """A problem over an interval of alpha, in variables that do not depend on alpha (theory, section 12.9).

    lambda_t is F tau with the float F next to the coefficients at ``reference``.

    Attributes
    ----------
    enclosure : CondensedEnclosure of a problem whose nodes have coefficients of constant ratios
        The problem's own.
    reference : Fraction
        An alpha at which every node with friction somewhere on the interval has it.
    units : force and length, (p,) arrays of powers of two (see SpaceSystem)

    Raises
    ------
    NotEnclosedError
        Something over- or underflows, or a ratio changes with alpha.
    """

    enclosure: CondensedEnclosure
    reference: Fraction
    units: tuple[Floats, Floats]

    @cached_property
    def _friction(self) -> tuple[Floats, Floats]:
        """F with radii."""
        return _references(self.enclosure.problem, self.reference)

    @cached_property
    def _variables(self) -> _Variables:
        return _variables(*self._friction)

    @cached_property
    def fixed(self) -> EnclosedSpace:
        """S, F and the places of tau, which do not depend on alpha, with g at ``reference``."""
        return _enclosed(self.enclosure, self.reference, self.units, self._variables)

    @cached_property
    def _quotients(self) -> list[tuple[Fraction, Fraction]]:
        """Coefficients over F as affine functions of alpha, of every node; 1 and 0 without any."""
        found = []
        for by, *values in self._nodes:
            axis = 0 if by[0] else 1
            reference = Fraction(by[axis])
            value, slope = values[axis]
            found.append((value / reference, slope / reference) if reference else (Fraction(1), Fraction(0)))
        return found

    @cached_property
    def _nodes(self) -> list[tuple[list[float], tuple[Fraction, Fraction], tuple[Fraction, Fraction]]]:
        """F of every node, and both its coefficients as affine functions of alpha."""
        F = self._friction[0].tolist()
        return [(by, one, other) for by, (one, other, _) in zip(F, node_friction(self.enclosure.problem), strict=True)]

    def discs(self, alpha: Fraction, change: Fraction = Fraction(1)) -> Ball:
        """Coefficients at alpha over F, (p,)."""
        return nearest([change * value + alpha * slope for value, slope in self._quotients])

    def at(self, alpha: Fraction) -> EnclosedSpace:
        """The data at a point, the last of which are kept."""
        found = self._points.get(alpha)
        if found is None:
            found = self._points[alpha] = self.over(alpha, alpha)
            if len(self._points) > _KEPT:
                del self._points[next(iter(self._points))]
        return found

    @cached_property
    def _points(self) -> dict[Fraction, EnclosedSpace]:
        return {}

    def over(self, low: Fraction, high: Fraction) -> EnclosedSpace:
        """Balls for the exact data over a piece, or at a point.

        Raises
        ------
        NotEnclosedError
            Something over- or underflows, or a coefficient is negative there, or positive where F is 0.
        """
        for by, *values in self._nodes:
            ends = [value + end * slope for value, slope in values for end in (low, high)]
            if min(ends) < 0 or (not any(by) and max(ends) > 0):
                raise NotEnclosedError("a coefficient of friction is negative, or begins to be positive, over a piece")
        middle, half = (low + high) / 2, (high - low) / 2
        (weight, rows), length, held = self._variables[:2], np.tile(self.units[1], 3), self.fixed
        g, g_rad = self.enclosure.load_in_units(middle, length)
        disc, disc_turn, step = self.discs(middle), self.discs(half, Fraction(0)), nearest([half])[0]
        with np.errstate(over="ignore", invalid="ignore"):
            whole = load = weight * Ball(g, g_rad)[rows]
            along = None
            if half:
                turn = Ball(self.enclosure.g1 / length, self.enclosure.g1_rad / length * SAFE + TINY)[rows]
                turn = weight * (turn * step)
                whole = Ball(load.mid, (load.rad + turn.size) * SAFE)
                along = PieceTurn(load, turn, disc, disc_turn)
        if not whole.finite:
            raise NotEnclosedError(_OVERFLOW)
        rigid = self._rigid(middle)
        if along is not None:
            turn = rigid.slope * step
            turn = Ball(turn.mid, np.where(rigid.slope.size > 0, turn.rad, 0.0))
            along = replace(along, g=Ball.joined(along.g, rigid.h), g_turn=Ball.joined(along.g_turn, turn))
            rigid = replace(rigid, h=Ball(rigid.h.mid, (rigid.h.rad + turn.size) * SAFE))
        discs = Ball(disc.mid, (disc.rad + disc_turn.size) * SAFE)
        return replace(held, g=whole.mid, g_rad=whole.rad, rows=rigid, discs=discs, turn=along, fixed=held)

    @cached_property
    def moved(self) -> Ball:
        """Displacements of the contact nodes by rigid displacements of size one in the problem's units, (3p, r)."""
        ones = np.ones(len(self.enclosure.g0))
        rows = RigidRows.of(self.enclosure.problem, self.reference, ones, ones)
        return Ball(*(part.T / rows.unit for part in (rows.G.mid, rows.G.rad)))

    def _rigid(self, alpha: Fraction) -> RigidRows:
        """Equilibrium of the body as a whole at alpha, on (lambda_n, tau)."""
        force, length = self.units
        rows = RigidRows.of(self.enclosure.problem, alpha, np.tile(force, 3), np.tile(length, 3))
        weight, own, _ = self._variables
        return _on_tau(rows, own, weight)


def _variables(F: Floats, F_rad: Floats) -> _Variables:
    """By what the rows that y takes are multiplied, where they are among 3p, and F, its radii, ``tau`` and ``unit``.

    Raises
    ------
    NotEnclosedError
        A coefficient is too small or too large for float64.
    """
    if (why := _out_of_range(F)) is not None:
        raise NotEnclosedError(why)
    scale, (tau, rows, node, axis), ones = friction_units(F), places(F > 0), np.ones(len(F))
    F, F_rad = F * scale, F_rad * scale
    weight = Ball(np.append(ones, F[node, axis]), np.append(0.0 * ones, F_rad[node, axis]))
    return weight, rows, (F, F_rad, tau, np.append(ones, scale[node, axis]))


def _enclosed(
    enclosure: CondensedEnclosure, alpha: Fraction, units: tuple[Floats, Floats], variables: _Variables
) -> EnclosedSpace:
    """Balls for the data at alpha in these variables, in units of force and length of the nodes, (p,) each."""
    (weight, rows, of_friction), (force, length) = variables, (np.tile(unit, 3) for unit in units)
    S, S_rad, g, g_rad = enclosure.in_units(alpha, force, length)
    with np.errstate(over="ignore", invalid="ignore"):
        scaled = Ball(S, S_rad)[np.ix_(rows, rows)] * weight[:, None] * weight
        load = weight * Ball(g, g_rad)[rows]
        own = _on_tau(RigidRows.of(enclosure.problem, alpha, force, length), rows, weight)
    if not (scaled.finite and load.finite):
        raise NotEnclosedError(_OVERFLOW)
    # the exact S is symmetric
    S_rad = np.maximum(scaled.rad, scaled.rad.T) + np.abs(scaled.mid - scaled.mid.T)
    S = np.tril(scaled.mid) + np.tril(scaled.mid, -1).T
    return EnclosedSpace(S, S_rad * SAFE, load.mid, load.rad, *of_friction, rows=own)


def node_friction(
    problem: ProblemData,
) -> Iterator[tuple[tuple[Fraction, Fraction], tuple[Fraction, Fraction], Fraction]]:
    """Both coefficients of every node as affine functions of alpha, and the ratio of the second one to the first.

    That is 0 where a node does not have both.

    Raises
    ------
    NotEnclosedError
        The ratio changes with alpha.
    """
    for node, numbers in zip(problem.node_ids, np.hstack(problem.affine_friction).tolist(), strict=True):
        one, other, one_slope, other_slope = map(Fraction, numbers)
        if one * other_slope != other * one_slope:
            raise NotEnclosedError(
                f"the ratio of the coefficients of friction of contact node {node} changes with alpha; expected a "
                "constant one"
            )
        both = any((one, one_slope)) and any((other, other_slope))
        ratio = (other / one if one else other_slope / one_slope) if both else Fraction(0)
        yield (one, one_slope), (other, other_slope), ratio


def _references(problem: ProblemData, alpha: Fraction) -> tuple[Floats, Floats]:
    """Coefficients at alpha, (p, 2), with radii: the first of a node that occurs is a float, the other one follows.

    Raises
    ------
    NotEnclosedError
        The ratio of both changes with alpha, or there is only one, which changes; or the other one over- or underflows.
    """
    found = np.zeros((2, problem.p, 2))
    for i, (first, second, ratio) in enumerate(node_friction(problem)):
        if any(first) != any(second) and (first[1] or second[1]):
            raise NotEnclosedError(_ONE_AXIS.format(problem.node_ids[i]))
        at = [part[0] + alpha * part[1] for part in (first, second)]
        reference, k = (Fraction(float(at[0])), 0) if at[0] else (Fraction(float(at[1])), 1)
        found[0, i, k] = float(reference)
        if k == 0 and at[1]:
            other = coefficients([reference * ratio])
            found[0, i, 1], found[1, i, 1] = other.mid[0], other.rad[0]
    return found[0], found[1]


#: What is said of a node that is refused.
_ONE_AXIS = (
    "contact node {} has friction along one axis only, which changes with alpha; expected both, or a constant one"
)


def _on_tau(rows: RigidRows, own: Indices, weight: Ball) -> RigidRows:
    """Rows that act on (lambda_n, tau): some columns of G, each times its weight."""
    G = rows.G[:, own]
    product = G * weight
    # zeros are exact
    return replace(rows, G=Ball(product.mid, np.where(G.size > 0, product.rad, 0.0)))
