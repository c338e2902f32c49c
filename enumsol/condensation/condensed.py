"""Condensation to the contact nodes: S = B A^{-1} B', g(alpha) and F(alpha) (theory, section 4)."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from enumsol.errors import InvalidArgumentError, InvalidProblemError
from enumsol.problem import Alpha, finite_alpha

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from enumsol.problem import ContactProblem

#: A pivot of A below this fraction of its diagonal entry is rounding: A is singular in float64.
PIVOT_TOLERANCE = 64 * float(np.finfo(np.float64).eps)
#: Units of force and length lie between 2^-900 and 2^900; products and quotients of two of them and proofs need that.
UNIT_EXPONENT = 900
#: Squares of friction coefficients, times contact forces, must not overflow.
LARGEST_FRICTION = 1e100
#: Right-hand sides solved at once; bounds the dense memory of a condensation to this many vectors of length n.
RHS_BLOCK = 16


class Factorization:
    """Sparse symmetric factorization A = L D L' with diagonal pivots, after scaling A to unit diagonal.

    Parameters
    ----------
    A : (n, n) csc_array, symmetric
    """

    def __init__(self, A: sp.csc_array) -> None:
        self._A = A
        diagonal = A.diagonal()
        if np.any(diagonal <= 0):
            row = int(np.argmin(diagonal))
            raise InvalidProblemError(
                f"A is not positive definite: its diagonal entry {row} is {diagonal[row]:g}; expected a positive value"
            )
        # powers of two: the scaling itself makes no rounding error
        self._scale = np.exp2(-np.round(0.5 * np.log2(diagonal)))
        self._diagonal = self._scale * diagonal * self._scale
        scaling = sp.diags_array(self._scale)
        options = {"SymmetricMode": True, "Equil": False}
        try:
            # the scaled copy of A is not kept: the factors are all that solving needs
            self._lu = splu(
                sp.csc_array(scaling @ A @ scaling),
                permc_spec="MMD_AT_PLUS_A",
                diag_pivot_thresh=0.0,
                options=options,
            )
        except RuntimeError as error:  # SuperLU: "Factor is exactly singular"
            raise InvalidProblemError(_RIGID.format(ratio=0.0)) from error

    def check_positive_definite(self) -> None:
        """Raise InvalidProblemError unless every pivot is positive and above rounding."""
        pivots = self._pivots
        if not np.array_equal(self._lu.perm_r, self._lu.perm_c) or np.min(pivots) < -PIVOT_TOLERANCE:
            raise InvalidProblemError(
                "A is not positive definite (an elimination pivot is negative); expected the stiffness of a stable body"
            )
        if np.min(pivots) <= PIVOT_TOLERANCE:
            raise InvalidProblemError(_RIGID.format(ratio=max(float(np.min(pivots)), 0.0)))

    @cached_property
    def _pivots(self) -> NDArray[np.float64]:
        """The pivots relative to the diagonal entries of A, shape (n,).

        Asking SuperLU for U makes sparse copies of L and of U, as large as the factors, which it keeps as long as it
        lives. Nothing else needs them: both are emptied here.
        """
        L, U = self._lu.L, self._lu.U
        pivots = U.diagonal() / self._diagonal[np.argsort(self._lu.perm_c)]
        for copy in (L, U):
            copy.data, copy.indices = copy.data[:0].copy(), copy.indices[:0].copy()
            copy.indptr = np.zeros_like(copy.indptr)
        return np.asarray(pivots)

    def solve(self, rhs: NDArray[np.float64], *, refined: bool = True) -> NDArray[np.float64]:
        """A^{-1} rhs for rhs of shape (n,) or (n, k), by default with one step of iterative refinement."""
        d = self._scale if rhs.ndim == 1 else self._scale[:, None]
        x = d * self._lu.solve(d * rhs)
        if not refined:
            return np.asarray(x)
        residual = rhs - self._A @ x
        return np.asarray(x + d * self._lu.solve(d * residual))


_RIGID = (
    "A is singular to working precision (smallest pivot {ratio:.1e} of its diagonal): the body is free to move as a "
    "rigid body or a part is not attached; expected enough degrees of freedom held to exclude rigid motions"
)


@dataclass(frozen=True)
class CondensedSystem:
    """The condensed problem at one alpha: w = g - S lambda, with lambda and w stacked as (normal, tangential).

    Attributes
    ----------
    S : (2p, 2p) symmetric positive definite compliance [length / force]
    g : (2p,) free displacements relative to gap and slip offset [length]
    F : (p,) friction coefficients [-]
    """

    S: NDArray[np.float64]
    g: NDArray[np.float64]
    F: NDArray[np.float64]

    @property
    def p(self) -> int:
        """Number of contact nodes."""
        return len(self.F)

    @cached_property
    def scaled(self) -> ScaledSystem:
        """The same problem without units (see ScaledSystem)."""
        return ScaledSystem.from_system(self)


@dataclass(frozen=True)
class ScaledSystem:
    """A CondensedSystem without units, on which all tolerances of float arithmetic act.

    Forces are ``lambda = force * lambda_scaled`` and displacements ``w = length * w_scaled``, one factor a node for
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

    S: NDArray[np.float64]
    g: NDArray[np.float64]
    F: NDArray[np.float64]
    force: NDArray[np.float64]
    length: NDArray[np.float64]
    cholesky: NDArray[np.float64] = field(repr=False)

    @classmethod
    def from_system(cls, system: CondensedSystem) -> ScaledSystem:
        """Scale a condensed system."""
        p = system.p
        diagonal = np.log2(np.diagonal(system.S))
        node = np.exp2(-np.round(0.25 * (diagonal[:p] + diagonal[p:])))
        factor = np.concatenate([node, node])
        S = system.S * factor[:, None] * factor[None, :]
        g = system.g * factor
        cholesky = _cholesky(S)
        largest = float(np.max(np.abs(g)))
        size = 1.0
        if largest > 0:
            # two steps, so that squaring neither overflows nor underflows
            first = np.exp2(np.floor(np.log2(largest)))
            energy = float(np.linalg.norm(np.linalg.solve(cholesky, g / first)))
            size = float(first * np.exp2(np.floor(np.log2(energy))))
        with np.errstate(over="ignore", divide="ignore"):
            units = np.concatenate([factor * size, size / factor])
        if not np.all((units >= 2.0**-UNIT_EXPONENT) & (units <= 2.0**UNIT_EXPONENT)):
            raise InvalidProblemError(
                f"the load makes contact forces and displacements of size {np.min(units):.1e} to {np.max(units):.1e}, "
                f"where float64 over- or underflows; expected data in other units"
            )
        if np.max(system.F) > LARGEST_FRICTION:
            raise InvalidProblemError(
                f"a friction coefficient is {np.max(system.F):g}, where float64 overflows; expected at most "
                f"{LARGEST_FRICTION:g}"
            )
        return cls(S, g / size, system.F, factor * size, size / factor, cholesky)

    @property
    def p(self) -> int:
        """Number of contact nodes."""
        return len(self.F)


def _cholesky(S: NDArray[np.float64]) -> NDArray[np.float64]:
    try:
        # a pivot of the size of rounding may be positive by accident: the relaxations factorize 2 S, and would fail
        np.linalg.cholesky(2.0 * S)
        return np.asarray(np.linalg.cholesky(S))
    except np.linalg.LinAlgError as error:
        raise InvalidProblemError(
            "the condensed compliance S = B A^-1 B' is not positive definite to working precision; expected contact "
            "rows [Bn; Bt] that are independent beyond rounding (are two contact nodes almost the same point?)"
        ) from error


@dataclass(frozen=True)
class CondensedProblem:
    """The problem condensed for all alpha: S, g(alpha) = g0 + alpha g1, F(alpha) = F0 + alpha F1.

    Attributes
    ----------
    S : (2p, 2p) array
        B A^{-1} B' with B stacking Bn and Bt [length / force].
    g0, g1 : (2p,) arrays
        B A^{-1} f - (gap, slip_offset), and B A^{-1} load_slope [length].
    F0, F1 : (p,) arrays
        Friction coefficients and their slopes [-].
    """

    S: NDArray[np.float64]
    g0: NDArray[np.float64]
    g1: NDArray[np.float64]
    F0: NDArray[np.float64]
    F1: NDArray[np.float64]
    problem: ContactProblem = field(repr=False)

    @classmethod
    def from_problem(cls, problem: ContactProblem) -> CondensedProblem:
        """Condense with one sparse factorization; dense memory stays at RHS_BLOCK vectors of length n."""
        B = sp.csr_array(sp.vstack([problem.Bn, problem.Bt], format="csr"))
        size = B.shape[0]
        offset = np.concatenate([problem.gap, problem.slip_offset])
        slope = problem.load_slope
        S = np.empty((size, size))
        # what overflows is found and named below
        with np.errstate(over="ignore", invalid="ignore"):
            for start in range(0, size, RHS_BLOCK):
                stop = min(start + RHS_BLOCK, size)
                S[:, start:stop] = B @ problem.factorization.solve(B[start:stop].T.toarray())
            S = 0.5 * (S + S.T)
            g0 = B @ problem.factorization.solve(problem.f) - offset
            g1 = np.zeros(size) if slope is None else B @ problem.factorization.solve(slope)
        F0, F1 = problem.friction
        if not (np.all(np.isfinite(S)) and np.all(np.isfinite(g0)) and np.all(np.isfinite(g1))):
            raise InvalidProblemError("A, f: the condensed problem overflows float64; expected data in smaller units")
        for array in (S, g0, g1):
            array.setflags(write=False)
        return cls(S, g0, g1, F0, F1, problem)

    def at(self, alpha: Alpha) -> CondensedSystem:
        """The condensed system at one alpha.

        Raises
        ------
        InvalidArgumentError
            alpha is not finite or makes a friction coefficient negative.
        """
        value = finite_alpha(alpha)
        F = self.problem.friction_at(alpha)
        with np.errstate(over="ignore", invalid="ignore"):
            g = self.g0 + value * self.g1
        if not np.all(np.isfinite(g)):
            raise InvalidArgumentError(f"alpha = {value:g} makes the load overflow float64; expected a smaller value")
        return CondensedSystem(self.S, g, F)

    def displacement(self, alpha: Alpha, forces: NDArray[np.float64]) -> NDArray[np.float64]:
        """u = A^{-1} (f(alpha) - B' lambda), shape (n,), for forces of shape (2p,)."""
        problem, p = self.problem, self.problem.p
        rhs = problem.load_at(alpha) - problem.Bn.T @ forces[:p] - problem.Bt.T @ forces[p:]
        return problem.factorization.solve(np.asarray(rhs))
