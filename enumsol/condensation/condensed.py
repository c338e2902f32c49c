"""Condensation to the contact nodes: S = B A^{-1} B', g(alpha) and F(alpha) (theory, section 4.1)."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Self

import numpy as np

from enumsol.arithmetic.balls import factor_above
from enumsol.errors import InvalidArgumentError, InvalidProblemError, NotHeldError
from enumsol.support.arguments import alpha_value
from enumsol.support.immutable import Sealed, sealed

if TYPE_CHECKING:
    from enumsol.condensation.data import ProblemData
    from enumsol.support.array_types import Alpha, AlphaLike, Floats

#: Units of force and length lie between 2^-900 and 2^900; products and quotients of two of them and proofs need that.
UNIT_EXPONENT = 900
#: Friction coefficients, and given forces and slips beside those of the load: squares of them, times contact forces,
#: must not overflow.
LARGEST_NUMBER = 1e100
#: How many roundings for every row of S, with a unit diagonal, its eigenvalues may be off by.
_ROUNDINGS = 4
#: Rigid displacements whose contact nodes move less, squared and relative to the largest, move none.
_MODE_RANK = 1e-14


@dataclass(frozen=True)
class CondensedSystem:
    """The condensed problem at one alpha: w = g - S lambda, with lambda and w stacked as (normal, tangential).

    Attributes
    ----------
    S : (2p, 2p) symmetric positive definite compliance [length / force]
    g : (2p,) free displacements relative to gap and slip offset [length]
    F : (p,) friction coefficients [-]
    """

    S: Floats
    g: Floats
    F: Floats

    @property
    def p(self) -> int:
        """Number of contact nodes."""
        return len(self.F)

    @cached_property
    def scaled(self) -> ScaledSystem:
        """System without units (see ScaledSystem)."""
        return ScaledSystem.from_system(self)

    @cached_property
    def proposals(self) -> ScaledSystem:
        """System without units for floats that only propose, where rationals decide (see ScaledSystem.from_system)."""
        return ScaledSystem.from_system(self, proposals=True)


@dataclass(frozen=True)
class ScaledSystem:
    """A CondensedSystem without units, on which all tolerances of float arithmetic act.

    Forces are ``lambda = force * lambda_scaled`` and displacements ``w = length * w_scaled``, one factor per node for
    each, so that friction coefficients are unchanged, the compliance has a diagonal near one, and
    ``g' S^{-1} g`` lies in [1, 4) unless g = 0. All factors are powers of two: scaling makes no rounding error.

    Attributes
    ----------
    S : (2p, 2p) array
    g : (2p,) array
    F : (p,) array
    force, length : (2p,) arrays
        Factors of forces and displacements.
    """

    S: Floats
    g: Floats
    F: Floats
    force: Floats
    length: Floats
    cholesky: Floats = field(repr=False)

    @classmethod
    def from_system(cls, system: CondensedSystem, *, proposals: bool = False) -> ScaledSystem:
        """Scale a condensed system; ``proposals``: one that need not be right, for rationals decide.

        Raises
        ------
        InvalidProblemError
            S is not positive definite beyond rounding: floats tell nothing. For proposals it is moved until it is
            (theory, (4.9)). Or the problem over- or underflows float64.
        """
        node = node_units(system.S, system.p)
        factor = np.concatenate([node, node])
        S = system.S * factor[:, None] * factor[None, :]
        S = lifted(S) if proposals else S
        g = system.g * factor
        cholesky = np.asarray(np.linalg.cholesky(S)) if proposals else cholesky_factor(S)
        size = load_unit(g, cholesky)
        with np.errstate(over="ignore", divide="ignore"):
            units = np.concatenate([factor * size, size / factor])
        if not np.all((units >= 2.0**-UNIT_EXPONENT) & (units <= 2.0**UNIT_EXPONENT)):
            raise InvalidProblemError(
                f"the load makes contact forces and displacements of size {np.min(units):.1e} to {np.max(units):.1e}, "
                f"where float64 over- or underflows; expected data in other units"
            )
        if np.max(system.F) > LARGEST_NUMBER:
            raise InvalidProblemError(
                f"a friction coefficient is {np.max(system.F):g}, where float64 overflows; expected at most "
                f"{LARGEST_NUMBER:g}"
            )
        return cls(S, g / size, system.F, factor * size, size / factor, cholesky)

    @property
    def p(self) -> int:
        """Number of contact nodes."""
        return len(self.F)


def node_units(S: Floats, p: int) -> Floats:
    """Powers of two, shape (p,), that scale the compliance of every node near one, alike in all its directions."""
    return np.asarray(np.exp2(-np.round(0.5 * np.mean(np.log2(np.diagonal(S).reshape(-1, p)), axis=0))))


def load_unit(g: Floats, cholesky: Floats) -> float:
    """The power of two that scales g' S^{-1} g into [1, 4); 1 where g = 0."""
    largest = float(np.max(np.abs(g)))
    if largest == 0:
        return 1.0
    # two steps, so that squaring neither overflows nor underflows
    first = np.exp2(np.floor(np.log2(largest)))
    energy = float(np.linalg.norm(np.linalg.solve(cholesky, g / first)))
    return float(first * np.exp2(np.floor(np.log2(energy))))


def cholesky_factor(S: Floats) -> Floats:
    """L with S = L L', for an S that is positive definite beyond rounding (theory, (4.9)).

    Raises
    ------
    InvalidProblemError
        S is not. A factorization of S itself may succeed all the same, by accident and on some processors only.
    """
    if not _definite(S):
        raise InvalidProblemError(
            "the condensed compliance S = B A^-1 B' is not positive definite to working precision; expected contact "
            "rows [Bn; Bt] that are independent beyond rounding (are two contact nodes almost the same point?)"
        )
    return np.asarray(np.linalg.cholesky(S))


def lifted(S: Floats) -> Floats:
    """S, or where it is not positive definite beyond rounding the least S + t diag(S) that surely is."""
    if _definite(S):
        return S
    root = np.sqrt(np.diagonal(S))
    least = 2.0 * _rounding(S) - float(np.linalg.eigvalsh(S / root[:, None] / root)[0])
    return np.asarray(S + least * np.diag(np.diagonal(S)))


def _definite(S: Floats) -> bool:
    """True if S less its rounding is positive definite."""
    return factor_above(S - _rounding(S) * np.diag(np.diagonal(S))) is not None


def _rounding(S: Floats) -> float:
    """Eigenvalues of S with a unit diagonal that may be rounding are smaller."""
    return _ROUNDINGS * len(S) * float(np.finfo(np.float64).eps)


@dataclass(frozen=True)
class CondensedProblem(Sealed):
    """A problem in 2D or 3D condensed to its contact forces for all alpha: S, and g(alpha) = g0 + alpha g1.

    Of a body that nothing holds S and g are those of the body on springs, with its equilibrium as a whole: with q the
    coordinates of the rigid displacement, w = g - S lambda + G'q and G lambda = h (theory, (14.2)).

    Attributes
    ----------
    S : (m, m) array
        B A^{-1} B' with B the contact rows, m = 2p or 3p: all normals, then all tangents [length / force].
    g0, g1 : (m,) arrays
        B A^{-1} f - (gap, slip_offset), and B A^{-1} load_slope [length].
    """

    S: Floats
    g0: Floats
    g1: Floats
    problem: ProblemData = field(repr=False)

    @classmethod
    def from_problem(cls, problem: ProblemData) -> Self:
        """Condense with one sparse factorization; dense columns of length n are made a block at a time."""
        offset = np.concatenate([problem.gap, problem.slip_offset.ravel(order="F")])
        products = problem.products
        size = len(products.mid)
        # what overflows is found and named below
        with np.errstate(over="ignore", invalid="ignore"):
            S = 0.5 * (products.mid[:, :size] + products.mid[:, :size].T)
            free = np.where(products.still, 0.0, products.mid[:, size:] * products.lift)
            g0, g1 = free[:, 0] - offset, free[:, 1]
        if not (np.all(np.isfinite(S)) and np.all(np.isfinite(g0)) and np.all(np.isfinite(g1))):
            raise InvalidProblemError("A, f: the condensed problem overflows float64; expected data in smaller units")
        return cls(S, g0, g1, problem)

    @cached_property
    def definite(self) -> bool:
        """True if S is positive definite beyond rounding."""
        units = node_units(self.S, len(self.problem.gap))
        factor = np.tile(units, len(self.S) // len(units))
        return _definite(self.S * factor[:, None] * factor)

    @cached_property
    def node_scale(self) -> Floats:
        """Roots of the geometric means of every node's normal and tangential compliances, as often, shape (m,)."""
        p = len(self.problem.gap)
        compliances = np.diagonal(self.S).reshape(-1, p)
        count = len(compliances)
        return sealed(np.tile(np.prod(compliances, axis=0) ** (0.5 / count), count))

    @cached_property
    def balanced(self) -> Floats:
        """S in units in which every node has compliance one, shape (m, m)."""
        scale = self.node_scale
        return sealed(np.asarray(self.S / scale[:, None] / scale[None, :]))

    @cached_property
    def G(self) -> Floats:  # noqa: N802 (the field's letter)
        """(B N)', shape (r, m)."""
        return sealed(np.asarray((self.problem.contact_rows @ self.problem.modes.N).T))

    @cached_property
    def h(self) -> tuple[Floats, Floats]:
        """N'f at alpha = 0 and its derivative, shapes (r,)."""
        N, slope = self.problem.modes.N, self.problem.load_slope
        change = np.zeros(N.shape[1]) if slope is None else N.T @ slope
        return sealed(np.asarray(N.T @ self.problem.f)), sealed(np.asarray(change))

    @cached_property
    def mixing(self) -> Floats:
        """L with L L' = G S^-1 G', the units of rigid displacements (theory, section 14.7), shape (r, r).

        Raises
        ------
        NotHeldError
            Some rigid displacement moves no contact node.
        """
        if self.problem.held:
            return sealed(np.zeros((0, 0)))
        G = self.G / self.node_scale
        size = np.linalg.norm(G, axis=1)
        values, vectors = np.linalg.eigh(G @ G.T / np.outer(*(np.where(size > 0, size, 1.0),) * 2))
        if values[0] <= _MODE_RANK * values[-1]:
            raise NotHeldError(
                f"rigid mode {int(np.argmax(np.abs(vectors[:, 0])))}, perhaps with others, moves no contact node: "
                "contact cannot hold the body; expected a body that every rigid mode moves at its contact nodes"
            )
        return sealed(np.asarray(np.linalg.cholesky(G @ solved(self.balanced, G.T))))

    @cached_property
    def moves(self) -> Floats:
        """G in the units of ``balanced`` and of ``mixing``, shape (r, m); raises as ``mixing``."""
        return sealed(np.asarray(np.linalg.solve(self.mixing, self.G / self.node_scale)))

    @cached_property
    def bordered(self) -> Floats:
        """The matrix of theory, (14.9), shape (m + r, m + r), of a held body ``balanced``; raises as ``mixing``."""
        if self.problem.held:
            return self.balanced
        G = self.moves
        return sealed(np.block([[self.balanced, -G.T], [G, np.zeros((len(G), len(G)))]]))

    def free_displacements(self, alpha: AlphaLike) -> Floats:
        """g(alpha), shape (m,) [length].

        Raises
        ------
        InvalidArgumentError
            alpha is not finite, or too large.
        """
        value = float(alpha_value(alpha))
        with np.errstate(over="ignore", invalid="ignore"):
            g = self.g0 + value * self.g1
        if not np.all(np.isfinite(g)):
            raise InvalidArgumentError(f"alpha = {value:g} makes the load overflow float64; expected a smaller value")
        return np.asarray(g)

    def displacement(self, alpha: AlphaLike, forces: Floats) -> Floats:
        """u = A^{-1} (f(alpha) - B' lambda), shape (n,), for forces of shape (m,); less any rigid displacement."""
        problem = self.problem.on_springs
        rhs = problem.load_at(alpha) - problem.contact_rows.T @ forces
        return np.asarray(problem.factorization.solve(np.asarray(rhs)))

    @property
    def F0(self) -> Floats:  # noqa: N802 (as above)
        """Friction coefficients at alpha = 0, shape (p,), in 3D (p, 2) [-]."""
        return self.problem.affine_friction[0]

    @property
    def F1(self) -> Floats:  # noqa: N802 (as above)
        """Derivatives of the friction coefficients with respect to alpha, shape (p,), in 3D (p, 2) [-]."""
        return self.problem.affine_friction[1]

    def at(self, alpha: Alpha) -> CondensedSystem:
        """The condensed system at one alpha, in 2D.

        Raises
        ------
        InvalidArgumentError
            alpha is not finite or makes a friction coefficient negative.
        """
        F = self.problem.friction_at(alpha)
        return CondensedSystem(self.S, self.free_displacements(alpha), F)


def solved(S: Floats, right: Floats) -> Floats:
    """S^-1 times columns; of least length where S is singular within rounding."""
    try:
        found = np.linalg.solve(S, right)
    except np.linalg.LinAlgError:
        found = np.full(right.shape, np.nan)
    return np.asarray(found if np.all(np.isfinite(found)) else np.linalg.lstsq(S, right, rcond=None)[0])


def condensation_of(problem: ProblemData) -> CondensedProblem:
    """``problem.condensed``, or that of a body that nothing holds."""
    condensed: CondensedProblem = problem.on_springs.condensed
    return condensed if problem.held else replace(condensed, problem=problem)
