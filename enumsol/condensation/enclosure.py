"""Rigorous enclosures of the condensed problem, from the user's own A, Bn, Bt, f (theory, section 4.4).

`Products` are B A^{-1} [B', f, load_slope] in floats, with what bounds their errors.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from typing import Any, ClassVar, Self, TypeVar

import numpy as np
import scipy.sparse as sp

from enumsol.arithmetic.balls import (
    SAFE,
    TINY,
    UNIT,
    Ball,
    SlicedMatrix,
    gamma,
    least_eigenvalue,
    nearest,
    sparse_eigenvalue_bound,
    upper_norm,
)
from enumsol.condensation.data import ProblemData, exactly_at
from enumsol.errors import EnumsolError
from enumsol.support.arguments import alpha_value
from enumsol.support.array_types import AlphaLike, Floats, Mask
from enumsol.support.deadlines import attended, look, tell
from enumsol.support.immutable import Sealed

_Value = TypeVar("_Value")


class NotEnclosedError(EnumsolError):
    """The data could not be enclosed: A or S is positive definite only within rounding, or float64 overflows."""


@dataclass(frozen=True)
class Products(Sealed):
    """S = B A^{-1} B' and what the loads move, as computed, before anything is known of A's smallest eigenvalue.

    With X an approximation of A^{-1} K, K = [B', f, load_slope], R = K - A X its residual and Y an approximation of
    A^{-1} R,

        B A^{-1} K  =  B X  +  B Y  +  B A^{-1} (R - A Y),      |b_i' A^{-1} z|  <=  ||A^{-1} b_i|| ||z||,

    where ||A^{-1} b_i|| <= ||X_i + Y_i|| + ||(R - A Y)_i|| / lambda_min(A). So the error is that of the rounding of two
    sums and of second order in the residual, which is computed in more than the working precision.

    Attributes
    ----------
    mid : (m, m + 2) array
        B X + B Y, of loads divided by ``lift``.
    rounded : (m, m + 2) array
        Bounds of its rounding errors.
    lengths, left : (m + 2,) arrays
        Bounds of ||X + Y|| and ||R - A Y||, A scaled by ``scale`` to a diagonal near one.
    scale : (n,) array of powers of two
    lift : (2,) array of powers of two
    still : (2,) bool array
        Loads that are zero.
    bounded : bool
        Whether the data could be scaled without rounding. Without it nothing bounds the errors.
    """

    mid: Floats
    rounded: Floats
    lengths: Floats
    left: Floats
    scale: Floats
    lift: Floats
    still: Mask
    bounded: bool

    @classmethod
    def of(cls, problem: ProblemData, *, refined: bool = True) -> Products:
        """Products of a problem; if they are not refined, Y = 0, and the error is of first order in the residual."""
        return cls._of(problem, problem.contact_rows.shape[0], refined=refined)

    def with_loads_of(self, problem: ProblemData) -> Products:
        """Products for another load on the same matrices: only the columns of the load are solved for."""
        loads, rows = self._of(problem, 0), len(self.mid)
        columns = {
            name: np.concatenate([getattr(self, name)[..., :rows], getattr(loads, name)], axis=-1)
            for name in ("mid", "rounded", "lengths", "left")
        }
        return replace(loads, **columns, bounded=self.bounded and loads.bounded)

    @classmethod
    def _of(cls, problem: ProblemData, columns: int, *, refined: bool = True) -> Products:
        """Products with the first columns of B' and with the loads."""
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            # np.ldexp, and not a power function, gives powers of two by definition
            exponent = -np.round(0.5 * np.log2(problem.A.diagonal())).astype(int)
            scale = np.ldexp(1.0, exponent)
            A, exact_A = scaled(sp.csr_array(problem.A), scale, scale)
            B, exact_B = scaled(problem.contact_rows, np.ones(problem.contact_rows.shape[0]), scale)
            slope = np.zeros(problem.n) if problem.load_slope is None else problem.load_slope
            loads = np.column_stack([problem.f, slope])
            # loads of size one, so that norms of their residuals neither overflow nor underflow
            size = np.max(np.where(loads != 0, np.frexp(loads)[1] + exponent[:, None], -1000), axis=0)
            lift = np.clip(size, -1000, 1000)
            power = exponent[:, None] - lift
            K = sp.hstack([B.T[:, :columns], sp.csc_array(np.ldexp(loads, power))], format="csc")
            exact_loads = np.array_equal(np.ldexp(np.ldexp(loads, power), -power), loads)

            def solve(columns: Floats) -> Floats:
                # not refined: what is left is bounded
                return np.asarray(problem.factorization.solve(columns / scale[:, None], refined=False) / scale[:, None])

            k = gamma(int(np.max(np.diff(B.indptr))) + 1)
            B_size, sliced = abs(B), SlicedMatrix(A) if refined else None
            mid, rounded = np.empty((B.shape[0], K.shape[1])), np.empty((B.shape[0], K.shape[1]))
            lengths, left = np.empty(K.shape[1]), np.empty(K.shape[1])
            width = problem.factorization.columns
            for start in range(0, K.shape[1], width):
                look()
                tell("columns of A^-1 B'", start, K.shape[1])
                part = slice(start, min(start + width, K.shape[1]))
                given = K[:, part].toarray()
                X = solve(given)
                if sliced is None:
                    image, Y = product(A, X), np.zeros_like(X)
                    rest = given - image.mid
                    R_rad, rest_rad = image.rad, 2 * UNIT * np.abs(rest)
                else:
                    R, R_rad = sliced.residual(X, given)
                    Y = solve(R)
                    rest, rest_rad = sliced.residual(Y, R)
                mid[:, part] = B @ X + B @ Y
                left[part] = upper_norm((np.abs(rest) + rest_rad + R_rad) * SAFE, axis=0) * SAFE
                sizes = np.abs(X) + np.abs(Y)
                rounded[:, part] = (k * (B_size @ sizes) * (1 + 2 * k) + 2 * UNIT * np.abs(mid[:, part])) * SAFE
                lengths[part] = upper_norm(sizes, axis=0) * SAFE
            bounded = exact_A and exact_B and exact_loads
            return cls(mid, rounded, lengths, left, scale, np.ldexp(1.0, lift), ~np.any(loads, axis=0), bounded)

    def radii(self, bound: float) -> Floats:
        """Bounds of all errors, for a lower bound on the smallest eigenvalue of the scaled A."""
        rows = len(self.mid)
        lengths = (self.lengths[:rows] + self.left[:rows] / bound) * SAFE
        return (self.rounded + lengths[:, None] * self.left) * SAFE + (len(self.scale) + 2) * TINY


def scaled(matrix: sp.csr_array, left: Floats, right: Floats) -> tuple[sp.csr_array, bool]:
    """diag(left) matrix diag(right) for powers of two, and whether that is exact."""
    rows = np.repeat(np.arange(matrix.shape[0]), np.diff(matrix.indptr))
    factor = left[rows] * right[matrix.indices]
    data = matrix.data * factor
    exact = bool(np.all(np.isfinite(data))) and np.array_equal(data / factor, matrix.data)
    return sp.csr_array((data, matrix.indices, matrix.indptr), shape=matrix.shape), exact


def product(left: Floats | sp.csr_array, right: Floats) -> Ball:
    """The product of two matrices, the first of which may be sparse, with the error of its sums; zeros are exact."""
    mid = np.asarray(left @ right)
    size = np.asarray(abs(left) @ np.abs(right))
    terms = int(np.max(np.diff(sp.csr_array(left).indptr))) if sp.issparse(left) else left.shape[1]
    k = gamma(terms + 2)
    # not where ``size`` is zero: it may underflow
    met = left.astype(bool).astype(np.float64) @ (right != 0)
    return Ball(mid, np.where(met > 0, size * k * (1 + 2 * k) * SAFE + TINY, 0.0))


@dataclass(frozen=True)
class CondensedEnclosure(Sealed):
    """Balls that hold S, g0 and g1 for the exact data of a problem (theory, section 4.4), or of its body on springs.

    Attributes
    ----------
    S, S_rad : (2p, 2p) arrays [length / force]
    g0, g0_rad, g1, g1_rad : (2p,) arrays [length]
        With the radius of the slip offset, where the problem has one.
    stiffness_bound : float
        Proven lower bound on the smallest eigenvalue of A after scaling to a diagonal near one.
    free : pair of (2p,) arrays, or None [length]
        B A^-1 f and its radii: g0 without gap and slip offset; None where the balls are not those of a whole problem.
    """

    S: Floats
    S_rad: Floats
    g0: Floats
    g0_rad: Floats
    g1: Floats
    g1_rad: Floats
    stiffness_bound: float
    problem: Any = field(repr=False)  # in 2D or 3D
    free: tuple[Floats, Floats] | None = field(default=None, repr=False)

    @classmethod
    def from_problem(cls, problem: ProblemData, products: Products | None = None) -> CondensedEnclosure:
        """Enclose S and g from the problem's own matrices; ``products`` of it are taken if they are known.

        Of a body that nothing holds these are those of the body on springs.

        Raises
        ------
        NotEnclosedError
            A is positive definite only within rounding.
        """
        if not problem.held:
            return enclosure_of(problem)
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            return cls._from_problem(problem, products)._finite()

    @classmethod
    def as_computed(cls, problem: ProblemData) -> CondensedEnclosure:
        """S and g as computed in floats, as balls of radius zero."""
        c = problem.condensed
        zero, none = np.zeros_like(c.S), np.zeros_like(c.g0)
        return cls(c.S, zero, c.g0, none, c.g1, none, 0.0, problem)

    def restarted(self, problem: ProblemData, products: Products) -> CondensedEnclosure:
        """The enclosure of a problem of the same body with another load or slip offset: S is what it is here.

        Raises
        ------
        NotEnclosedError
            Something over- or underflows.
        """
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            return self._from_problem(problem, products, self)._finite()

    def moved_freely(self, alpha: Fraction) -> Ball:
        """B A^-1 f(alpha), where the contact nodes would be without contact, shape (2p,) [length]."""
        if self.free is None:
            raise AssertionError(_PART)
        with np.errstate(over="ignore", invalid="ignore"):
            moved = nearest([alpha])[0] * Ball(self.g1, self.g1_rad) + Ball(*self.free)
        if not moved.finite:
            raise NotEnclosedError(_OVERFLOW)
        return moved

    def without_offsets(self, moves: Mask) -> CondensedEnclosure:
        """These balls with a load that lacks the slip offsets of components that move, on which no force depends.

        Their w is then where they move to (theory, section 13.2).

        Parameters
        ----------
        moves : (p,) or, in 3D, (2p,) bool array
        """
        if self.free is None:
            raise AssertionError(_PART)
        own = np.concatenate([np.zeros(len(self.g0) - len(moves), dtype=bool), moves])
        free, rad = self.free
        return replace(self, g0=np.where(own, free, self.g0), g0_rad=np.where(own, rad, self.g0_rad))

    def _finite(self) -> CondensedEnclosure:
        balls = (self.S, self.S_rad, self.g0, self.g0_rad, self.g1, self.g1_rad)
        if not all(np.all(np.isfinite(array)) for array in balls):
            raise NotEnclosedError(_OVERFLOW)
        return self

    @classmethod
    def _from_problem(
        cls, problem: ProblemData, products: Products | None, before: CondensedEnclosure | None = None
    ) -> CondensedEnclosure:
        """Balls of a problem, of the same body as one ``before`` if there is that."""
        products = Products.of(problem) if products is None else products
        if not products.bounded:
            raise NotEnclosedError(_OVERFLOW)
        bound = _stiffness_bound(problem, products.scale) if before is None else before.stiffness_bound
        rad, size = products.radii(bound), len(products.mid)
        g0, g0_rad, g1, g1_rad, *free = _displaced(problem, products, rad)
        load = g0, g0_rad, g1, g1_rad, bound, problem, (free[0], free[1])
        if before is not None:
            return cls(before.S, before.S_rad, *load)
        S, S_rad = products.mid[:, :size], rad[:, :size]
        # the exact S is symmetric and lies in both triangles' balls
        sym = 0.5 * (S + S.T)
        S_rad = (np.maximum(S_rad, S_rad.T) + np.abs(S - S.T) + 2 * UNIT * np.abs(sym)) * SAFE
        return cls(sym, S_rad, *load)

    def at(self, alpha: AlphaLike, force: Floats, length: Floats) -> EnclosedSystem:
        """The enclosed system of a 2D problem at one alpha, in units given by powers of two (see ScaledSystem)."""
        a = alpha if isinstance(alpha, Fraction) else Fraction(alpha_value(alpha))
        F = coefficients(exactly_at(a, *self.problem.affine_friction))
        S, S_rad, g, g_rad = self.in_units(a, force, length)
        return EnclosedSystem(S, S_rad, g, g_rad, F.mid, F.rad, rows=RigidRows.of(self.problem, a, force, length))

    def constant_load(self, side: float) -> CondensedEnclosure:
        """Enclosure with g = side g1 at every alpha, ``side`` 1 or -1: what solutions are beside a zero of g."""
        none = np.zeros_like(self.g1)
        return replace(self, g0=side * self.g1, g0_rad=self.g1_rad, g1=none, g1_rad=none)

    def in_units(self, alpha: Fraction, force: Floats, length: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """S and g(alpha) with radii, in units of every row given by powers of two.

        Raises
        ------
        NotEnclosedError
            Something over- or underflows.
        """
        g, g_rad = self.load_in_units(alpha, length)
        if np.any(np.frexp(force)[0] != 0.5):
            raise AssertionError(_POWERS)
        with np.errstate(over="ignore", invalid="ignore"):
            # scaling rounds nothing but what underflows
            pair = force[:, None] / length[None, :]
            S, S_rad = self.S * pair, self.S_rad * pair + TINY
        if not np.all(pair >= LEAST_PAIR) or not all(np.all(np.isfinite(array)) for array in (S, S_rad)):
            raise NotEnclosedError(_OVERFLOW)
        return S, S_rad, g, g_rad

    def load_in_units(self, alpha: Fraction, length: Floats) -> tuple[Floats, Floats]:
        """g(alpha) with radii, likewise.

        Raises
        ------
        NotEnclosedError
            Something over- or underflows.
        """
        if np.any(np.frexp(length)[0] != 0.5):
            raise AssertionError(_POWERS)
        near = nearest([alpha])
        value, slack = float(near.mid[0]), float(near.rad[0])
        with np.errstate(over="ignore", invalid="ignore"):
            g = self.g0 + value * self.g1
            size = np.abs(value * self.g1)
            g_rad = (self.g0_rad + (abs(value) + slack) * self.g1_rad + slack * np.abs(self.g1)) * SAFE
            g_rad = (g_rad + 4 * UNIT * (size + np.abs(g))) * SAFE + TINY
            arrays = g / length, g_rad / length + TINY
        if not all(np.all(np.isfinite(array)) for array in arrays):
            raise NotEnclosedError(_OVERFLOW)
        return arrays


def enclosure_of(problem: ProblemData) -> CondensedEnclosure:
    """``problem.enclosure``, or that of a body that nothing holds: S and g are those of the body on springs."""
    enclosure: CondensedEnclosure = problem.on_springs.enclosure
    return enclosure if problem.held else replace(enclosure, problem=problem)


#: Smallest quotient of units, far above underflow.
LEAST_PAIR = 2.0**-1000
_OVERFLOW = "the condensed problem over- or underflows float64; expected data in other units"
_PART = "these balls are not those of a whole problem"
_POWERS = "units of force and length must be powers of two"


def coefficients(exact: Sequence[Fraction]) -> Ball:
    """Friction coefficients as balls.

    Raises
    ------
    NotEnclosedError
        One over- or underflows.
    """
    F = nearest(exact)
    if not F.finite:
        raise NotEnclosedError(_OVERFLOW)
    if np.any((F.rad > 0) & (F.mid == 0)):
        raise NotEnclosedError("a friction coefficient underflows float64")
    return F


def _displaced(problem: ProblemData, products: Products, rad: Floats) -> tuple[Floats, ...]:
    """g0, g1 and B A^-1 f, each with its radius, from products with the radii ``rad``."""
    size, offset = len(products.mid), np.concatenate([problem.gap, problem.slip_offset.ravel(order="F")])
    free, free_rad = products.mid[:, size:] * products.lift, rad[:, size:] * products.lift + TINY
    # no load moves nothing, exactly: what covers underflow in a norm would be huge beside a tiny load
    free[:, products.still] = free_rad[:, products.still] = 0.0
    g0 = free[:, 0] - offset
    g0_rad = (free_rad[:, 0] + 2 * UNIT * np.abs(g0)) * SAFE + TINY
    if problem.offset_radius is not None:
        g0_rad[len(problem.gap) :] += problem.offset_radius.ravel(order="F") * SAFE
        g0_rad *= SAFE
    return g0, g0_rad, free[:, 1], free_rad[:, 1], free[:, 0], free_rad[:, 0]


def _stiffness_bound(problem: ProblemData, scale: Floats) -> float:
    """Proven lower bound on the smallest eigenvalue of the scaled A, from an estimate by inverse iteration.

    Raises
    ------
    NotEnclosedError
        None that is positive was found.
    """
    A, _ = scaled(sp.csr_array(problem.A), scale, scale)
    vector = np.random.default_rng(1).normal(size=problem.n)
    value = 1.0
    for _ in range(4):
        vector /= np.linalg.norm(vector)
        image = problem.factorization.solve(vector / scale, refined=False) / scale
        value = 1.0 / float(np.linalg.norm(image))
        vector = image
    bound = attended(
        lambda: sparse_eigenvalue_bound(sp.csc_array(A), value), A.nnz, "bound of the smallest eigenvalue of A"
    )
    if not bound > 0:
        raise NotEnclosedError(
            "A is positive definite only within rounding: its smallest eigenvalue, after scaling to a unit diagonal, "
            "could not be proven positive"
        )
    return bound


def moved_by_modes(problem: ProblemData) -> Ball:
    """B N, by what each rigid mode moves the contact nodes, (2p, r) or (3p, r)."""
    return product(problem.contact_rows, problem.modes.N)


_RIGID_OVERFLOW = "the rows of the rigid modes overflow float64; expected data in other units"


def _in_units(value: Ball, unit: Floats) -> Ball:
    """A ball times powers of two; zeros stay exact."""
    return Ball(value.mid * unit, np.where(value.rad > 0, value.rad * unit + TINY, 0.0))


@dataclass(frozen=True)
class RigidRows:
    """The rows of equilibrium of a body that nothing holds as a whole, G lambda = h, in units given by powers of two.

    With q the coordinates of the rigid displacement N q, G = (B N)' and h = N'f(alpha),

        w = g - S lambda + G'q,    G lambda = h

    where S and g are those of the body held by springs (theory, section 14.2). With mu = -q the two are one system, S
    and g bordered by G and h. Of a body that is held there are none: r = 0.

    Attributes
    ----------
    G : Ball (r, 2p)
    h, slope : Ball (r,)
        At one alpha, and by how much h grows with alpha.
    unit : (r,) array
        Units of the coordinates q of the rigid displacement.
    reach : (r,) array
        How large these can be, in these units.
    """

    G: Ball
    h: Ball
    slope: Ball
    unit: Floats
    reach: Floats

    @classmethod
    def none(cls, size: int) -> RigidRows:
        """The rows of a body that is held, for ``size`` contact forces."""
        nothing = np.zeros(0)
        return cls(Ball.exact(np.zeros((0, size))), Ball.exact(nothing), Ball.exact(nothing), nothing, nothing)

    @classmethod
    def of(cls, problem: ProblemData, alpha: Fraction, force: Floats, length: Floats) -> RigidRows:
        """Rows of a problem at one alpha, enclosed; errors as ``along``."""
        rows = cls.along(problem, force, length)
        if not np.any(rows.slope.size):
            return rows
        with np.errstate(over="ignore", invalid="ignore"):
            h = rows.h + nearest([alpha])[0] * rows.slope
        if not h.finite:
            raise NotEnclosedError(_RIGID_OVERFLOW)
        return replace(rows, h=h)

    @classmethod
    def along(cls, problem: ProblemData, force: Floats, length: Floats) -> RigidRows:
        """Rows of a problem at alpha = 0, enclosed.

        Raises
        ------
        NotEnclosedError
            Something overflows.
        """
        if problem.held:
            return cls.none(len(force))
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            G = moved_by_modes(problem).T
            # the rows of G near one
            size = np.max(np.abs(G.mid) / length, axis=1)
            unit = np.exp2(-np.round(np.log2(np.where(size > 0, size, 1.0))))
            pair = unit[:, None] / length
            rows = Ball(G.mid * pair, np.where(G.rad > 0, G.rad * pair + TINY, 0.0))
            work = float(force[0] * length[0])
            given = [part for part in (problem.f, problem.load_slope) if part is not None]
            loads = [_in_units(product(problem.modes.N.T, part[:, None])[:, 0], unit / work) for part in given]
            most = problem.modes.reach(problem.rigid_reach)
            reach = most / unit
        finite = rows.finite and all(load.finite for load in loads) and np.all(np.isfinite(reach))
        if not (finite and np.all(reach * unit == most)):
            raise NotEnclosedError(_RIGID_OVERFLOW)
        return cls(rows, loads[0], loads[1] if len(loads) > 1 else Ball.exact(np.zeros(len(unit))), unit, reach)


def of_compliance(compute: Callable[[Any], _Value]) -> cached_property[_Value]:
    """A value that follows from S alone, and is that of another system with the same S where one is known."""
    name = compute.__name__

    def value(system: EnclosedSystem) -> _Value:
        found: _Value = compute(system) if system.fixed is None else getattr(system.fixed, name)
        return found

    value.__doc__ = compute.__doc__
    return cached_property(value)


#: Stands for those of a body that is held, of any number of contact forces.
_NO_ROWS = RigidRows.none(0)


@dataclass(frozen=True)
class EnclosedSystem:
    """The condensed problem at one alpha as balls, in scaled units: w = g - S lambda.

    Of a body that nothing holds S and g are those of the body on springs, and rows of its equilibrium come with them.

    Attributes
    ----------
    S, S_rad : (2p, 2p) arrays
    g, g_rad : (2p,) arrays
    F, F_rad : (p,) arrays
    rows : RigidRows, by default none
    fixed : EnclosedSystem or None
        One with the same S, from which comes what follows from that alone.
    tangents : int
        Tangential directions of a contact node: 1 in 2D, 2 in 3D.
    """

    tangents: ClassVar[int] = 1

    S: Floats
    S_rad: Floats
    g: Floats
    g_rad: Floats
    F: Floats
    F_rad: Floats
    rows: RigidRows = field(kw_only=True, default=_NO_ROWS)
    fixed: EnclosedSystem | None = field(kw_only=True, default=None, repr=False)

    def __post_init__(self) -> None:
        if self.rows is _NO_ROWS:
            object.__setattr__(self, "rows", RigidRows.none(len(self.g)))

    @classmethod
    def as_computed(cls, S: Floats, g: Floats, F: Floats, *, exactly: bool = False) -> EnclosedSystem:
        """S and g as they were computed in floats, without radii; F too, or within its rounding."""
        return cls(S, np.zeros_like(S), g, np.zeros_like(g), F, np.zeros_like(F) if exactly else 4 * np.spacing(F))

    @property
    def p(self) -> int:
        """Number of contact nodes."""
        return len(self.F)

    @cached_property
    def balls(self) -> tuple[Ball, Ball, Ball]:
        """S and g, bordered by G and h, and F."""
        if self.held:
            return Ball(self.S, self.S_rad), Ball(self.g, self.g_rad), Ball(self.F, self.F_rad)  # no copy of a large S
        mid, rad = (
            np.block([[own, border.T], [border, np.zeros((len(border),) * 2)]])
            for own, border in ((self.S, self.rows.G.mid), (self.S_rad, self.rows.G.rad))
        )
        return Ball(mid, rad), Ball.joined(Ball(self.g, self.g_rad), self.rows.h), Ball(self.F, self.F_rad)

    @of_compliance
    def smallest_eigenvalue(self) -> float:
        """Proven lower bound on the smallest eigenvalue of every S in the enclosure.

        Raises
        ------
        NotEnclosedError
            S is not proven positive definite.
        """
        with np.errstate(over="ignore", invalid="ignore"):
            bound = least_eigenvalue(Ball(self.S, self.S_rad))
        if not bound > 0:
            raise NotEnclosedError("the condensed compliance S is positive definite only within rounding")
        return bound

    @property
    def held(self) -> bool:
        """True if the body has no rigid modes."""
        return not len(self.rows.reach)

    @property
    def reach(self) -> Floats:
        """Bounds of the coordinates of a rigid displacement, (r,)."""
        return self.rows.reach

    @property
    def rigid_unit(self) -> Floats:
        """Units of the coordinates of a rigid displacement, (r,)."""
        return self.rows.unit

    def reaching(self, reach: Floats) -> Self:
        """System with other bounds of the rigid displacement."""
        return replace(self, rows=replace(self.rows, reach=reach))

    @property
    def largest_work(self) -> float:
        """A bound of h'q, the work of the load on a rigid displacement within the bounds."""
        h, k = self.rows.h.size, gamma(len(self.reach) + 8)
        # what no load works on may be infinite
        return float(h[h > 0] @ self.reach[h > 0]) * (1 + k) * SAFE

    @cached_property
    def largest_forces(self) -> float:
        """A bound of the norm of lambda at a root within the bounds (theory, (14.5)); of a held body ||g|| / mu."""
        mu, g = self.smallest_eigenvalue, float(upper_norm(np.abs(self.g) + self.g_rad))
        if self.held:
            return g / mu * SAFE
        load, k = self.largest_work, gamma(len(self.reach) + 8)
        return float((g + np.hypot(g, 2 * np.sqrt(mu) * np.sqrt(load))) / (2 * mu) * (1 + k) * SAFE)

    @property
    def largest_unknowns(self) -> float:
        """A bound of the norm of all unknowns, (lambda, q), at a root within the bounds."""
        return float(np.hypot(self.largest_forces, upper_norm(self.reach)) * SAFE)

    @cached_property
    def mode_inverse(self) -> Floats:
        """Approximate inverse of G S^-1 G'; no claim rests on its accuracy."""
        G = self.rows.G.mid
        return np.asarray(np.linalg.pinv(G @ self.inverse @ G.T, hermitian=True))

    @of_compliance
    def inverse(self) -> Floats:
        """Approximate inverse of S; no claim rests on its accuracy."""
        return np.asarray(np.linalg.inv(self.S))

    @of_compliance
    def form_error(self) -> float:
        """kappa with |fl(x'S x) - x'S x| <= kappa ||x||^2 for every S in the enclosure.

        Two roundings of inner products of 2p terms would ask for gamma(4p + 2); what is more covers underflow in them.
        """
        size = 4 * len(self.g) + 4
        return float((upper_norm(self.S_rad) + gamma(size) * upper_norm(self.S)) * SAFE)
