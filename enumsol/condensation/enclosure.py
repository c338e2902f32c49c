"""Rigorous enclosures of the condensed problem, from the user's own A, Bn, Bt, f (theory, section 4.4).

S and g as computed, with the bounds of their errors, are in ``condensation.products``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from enumsol.arithmetic.balls import (
    SAFE,
    TINY,
    UNIT,
    Ball,
    dense_eigenvalue_bound,
    gamma,
    sparse_eigenvalue_bound,
    upper_norm,
)
from enumsol.condensation.data import CondensableData, exactly_at
from enumsol.condensation.products import Products, scaled
from enumsol.errors import EnumsolError
from enumsol.support.arguments import alpha_value
from enumsol.support.array_types import AlphaLike, Floats, Mask
from enumsol.support.deadlines import attended
from enumsol.support.immutable import Sealed


class NotEnclosedError(EnumsolError):
    """The data could not be enclosed: A or S is positive definite only within rounding, or float64 overflows."""


@dataclass(frozen=True)
class CondensedEnclosure(Sealed):
    """Balls that hold S, g0 and g1 of a problem for its exact data (theory, section 4.4).

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
    def from_problem(cls, problem: CondensableData, products: Products | None = None) -> CondensedEnclosure:
        """Enclose S and g from the problem's own matrices; ``products`` of it are taken if they are known.

        Raises
        ------
        NotEnclosedError
            A is positive definite only within rounding.
        """
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            enclosed = cls._from_problem(problem, products)
        return enclosed._finite()

    def restarted(self, problem: CondensableData, products: Products) -> CondensedEnclosure:
        """The enclosure of a problem of the same body with another load or slip offset: S is what it is here.

        Raises
        ------
        NotEnclosedError
            Something over- or underflows.
        """
        if not products.bounded:
            raise NotEnclosedError(_OVERFLOW)
        bound = self.stiffness_bound
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            g0, g0_rad, g1, g1_rad, *free = _displaced(problem, products, products.radii(bound))
        S = self.S, self.S_rad
        return CondensedEnclosure(*S, g0, g0_rad, g1, g1_rad, bound, problem, (free[0], free[1]))._finite()

    def moved_freely(self, alpha: Fraction) -> Ball:
        """B A^-1 f(alpha), where the contact nodes would be without contact, shape (2p,) [length]."""
        if self.free is None:
            raise AssertionError(_PART)
        value, slack = float_at(alpha)
        with np.errstate(over="ignore", invalid="ignore"):
            moved = Ball(np.array(value), np.array(slack)) * Ball(self.g1, self.g1_rad) + Ball(*self.free)
        if not np.all(np.isfinite(moved.mid)) or not np.all(np.isfinite(moved.rad)):
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
    def _from_problem(cls, problem: CondensableData, products: Products | None) -> CondensedEnclosure:
        products = Products.of(problem) if products is None else products
        if not products.bounded:
            raise NotEnclosedError(_OVERFLOW)
        scale, size = products.scale, len(products.mid)
        A, _ = scaled(sp.csr_array(problem.A), scale, scale)
        estimate = _smallest_eigenvalue(problem, scale)
        bound = attended(
            lambda: sparse_eigenvalue_bound(sp.csc_array(A), estimate), A.nnz, "bound of the smallest eigenvalue of A"
        )
        if not bound > 0:
            raise NotEnclosedError(
                "A is positive definite only within rounding: its smallest eigenvalue, after scaling to a unit "
                "diagonal, could not be proven positive"
            )
        mid, rad = products.mid, products.radii(bound)
        S, S_rad = mid[:, :size], rad[:, :size]
        # the exact S is symmetric and lies in both triangles' balls
        sym = 0.5 * (S + S.T)
        S_rad = (np.maximum(S_rad, S_rad.T) + np.abs(S - S.T) + 2 * UNIT * np.abs(sym)) * SAFE
        g0, g0_rad, g1, g1_rad, *free = _displaced(problem, products, rad)
        return cls(sym, S_rad, g0, g0_rad, g1, g1_rad, bound, problem, (free[0], free[1]))

    def at(self, alpha: AlphaLike, force: Floats, length: Floats) -> EnclosedSystem:
        """The enclosed system of a 2D problem at one alpha, in units given by powers of two (see ScaledSystem)."""
        a = alpha if isinstance(alpha, Fraction) else Fraction(alpha_value(alpha))
        exact = exactly_at(a, *self.problem.affine_friction)
        F, inexact = nearest_floats(exact)
        F_rad = np.where(inexact, 2 * UNIT * F + TINY, 0.0)
        S, S_rad, g, g_rad = self.in_units(a, force, length)
        return EnclosedSystem(S, S_rad, g, g_rad, F, F_rad)

    def constant_load(self, side: float) -> CondensedEnclosure:
        """The same with g = side g1 at every alpha, ``side`` 1 or -1: what solutions are beside a zero of g."""
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
        if not np.all(pair >= _LEAST_PAIR) or not all(np.all(np.isfinite(array)) for array in (S, S_rad)):
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
        value, slack = float_at(alpha)
        with np.errstate(over="ignore", invalid="ignore"):
            g = self.g0 + value * self.g1
            size = np.abs(value * self.g1)
            g_rad = (self.g0_rad + (abs(value) + slack) * self.g1_rad + slack * np.abs(self.g1)) * SAFE
            g_rad = (g_rad + 4 * UNIT * (size + np.abs(g))) * SAFE + TINY
            arrays = g / length, g_rad / length + TINY
        if not all(np.all(np.isfinite(array)) for array in arrays):
            raise NotEnclosedError(_OVERFLOW)
        return arrays


#: Smallest quotient of units, far above underflow.
_LEAST_PAIR = 2.0**-1000
_OVERFLOW = "the condensed problem over- or underflows float64; expected data in other units"
_PART = "these balls are not those of a whole problem"
_POWERS = "units of force and length must be powers of two"


def nearest_floats(exact: Sequence[Fraction]) -> tuple[Floats, Mask]:
    """Friction coefficients in floats, and which of them are rounded.

    Raises
    ------
    NotEnclosedError
        One over- or underflows.
    """
    try:
        F = np.array([float(x) for x in exact])
    except OverflowError:
        raise NotEnclosedError(_OVERFLOW) from None
    inexact = np.array([Fraction(x) != y for x, y in zip(F.tolist(), exact, strict=True)])
    if np.any(inexact & (F == 0)):
        raise NotEnclosedError("a friction coefficient underflows float64")
    return F, inexact


def float_at(alpha: Fraction) -> tuple[float, float]:
    """The float next to alpha, and how far it may be away.

    Raises
    ------
    NotEnclosedError
        There is none.
    """
    try:
        value = float(alpha)
    except OverflowError:
        raise NotEnclosedError(_OVERFLOW) from None
    return value, 0.0 if Fraction(value) == alpha else 2 * UNIT * abs(value) + TINY


def _displaced(problem: CondensableData, products: Products, rad: Floats) -> tuple[Floats, ...]:
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


def _smallest_eigenvalue(problem: CondensableData, scale: Floats) -> float:
    """Estimate of the smallest eigenvalue of the scaled A by inverse iteration."""
    vector = np.random.default_rng(1).normal(size=problem.n)
    value = 1.0
    for _ in range(4):
        vector /= np.linalg.norm(vector)
        image = problem.factorization.solve(vector / scale, refined=False) / scale
        value = 1.0 / float(np.linalg.norm(image))
        vector = image
    return value


@dataclass(frozen=True)
class EnclosedSystem:
    """The condensed problem at one alpha as balls, in scaled units: w = g - S lambda.

    Attributes
    ----------
    S, S_rad : (2p, 2p) arrays
    g, g_rad : (2p,) arrays
    F, F_rad : (p,) arrays
    """

    S: Floats
    S_rad: Floats
    g: Floats
    g_rad: Floats
    F: Floats
    F_rad: Floats

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
        """S, g and F."""
        return Ball(self.S, self.S_rad), Ball(self.g, self.g_rad), Ball(self.F, self.F_rad)

    @cached_property
    def smallest_eigenvalue(self) -> float:
        """Proven lower bound on the smallest eigenvalue of every S in the enclosure.

        Raises
        ------
        NotEnclosedError
            S is not proven positive definite.
        """
        with np.errstate(over="ignore", invalid="ignore"):
            bound = (dense_eigenvalue_bound(self.S) - float(upper_norm(self.S_rad))) / SAFE
        if not bound > 0:
            raise NotEnclosedError("the condensed compliance S is positive definite only within rounding")
        return bound

    @property
    def reach(self) -> Floats:
        """Bounds of the coordinates of a rigid displacement; none of a body that is held."""
        return np.zeros(0)

    @property
    def rigid_unit(self) -> Floats:
        """Units of the coordinates of a rigid displacement; none of a body that is held."""
        return np.zeros(0)

    @property
    def largest_work(self) -> float:
        """A bound of the work of the load on a rigid displacement; none of a body that is held."""
        return 0.0

    @property
    def largest_unknowns(self) -> float:
        """A bound of the norm of all unknowns at a root."""
        return self.largest_forces

    @cached_property
    def largest_forces(self) -> float:
        """A bound of the norm of lambda at a root: ||g|| / mu, by theory, (5.2)."""
        return float(upper_norm(np.abs(self.g) + self.g_rad) / self.smallest_eigenvalue * SAFE)

    @cached_property
    def inverse(self) -> Floats:
        """Approximate inverse of S; no claim rests on its accuracy."""
        return np.asarray(np.linalg.inv(self.S))

    @cached_property
    def form_error(self) -> float:
        """kappa with |fl(x'S x) - x'S x| <= kappa ||x||^2 for every S in the enclosure.

        Two roundings of inner products of 2p terms would ask for gamma(4p + 2); what is more covers underflow in them.
        """
        size = 4 * len(self.g) + 4
        return float((upper_norm(self.S_rad) + gamma(size) * upper_norm(self.S)) * SAFE)
