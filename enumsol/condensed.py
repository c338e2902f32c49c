"""Condensation to the contact nodes: S = B A^{-1} B', g(alpha) and F(alpha) (theory, section 4)."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from enumsol.errors import InvalidArgumentError, InvalidProblemError
from enumsol.problem import Alpha, finite_alpha

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from enumsol.problem import ContactProblem

#: A pivot of A below this fraction of its diagonal entry is rounding: A is singular in float64.
PIVOT_TOLERANCE = 64 * float(np.finfo(np.float64).eps)
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
        scaling = sp.diags_array(self._scale)
        self._scaled = sp.csc_array(scaling @ A @ scaling)
        options = {"SymmetricMode": True, "Equil": False}
        try:
            self._lu = spla.splu(self._scaled, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
        except RuntimeError as error:  # SuperLU: "Factor is exactly singular"
            raise InvalidProblemError(_RIGID.format(ratio=0.0)) from error

    def check_positive_definite(self) -> None:
        """Raise InvalidProblemError unless every pivot is positive and above rounding."""
        order = np.argsort(self._lu.perm_c)
        pivots = self._lu.U.diagonal() / self._scaled.diagonal()[order]
        if not np.array_equal(self._lu.perm_r, self._lu.perm_c) or np.min(pivots) < -PIVOT_TOLERANCE:
            raise InvalidProblemError(
                "A is not positive definite (an elimination pivot is negative); expected the stiffness of a stable body"
            )
        if np.min(pivots) <= PIVOT_TOLERANCE:
            raise InvalidProblemError(_RIGID.format(ratio=max(float(np.min(pivots)), 0.0)))

    def solve(self, rhs: NDArray[np.float64]) -> NDArray[np.float64]:
        """A^{-1} rhs for rhs of shape (n,) or (n, k), with one step of iterative refinement."""
        d = self._scale if rhs.ndim == 1 else self._scale[:, None]
        x = d * self._lu.solve(d * rhs)
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
        return cls(S, g / size, system.F, factor * size, size / factor, cholesky)

    @property
    def p(self) -> int:
        """Number of contact nodes."""
        return len(self.F)


def _cholesky(S: NDArray[np.float64]) -> NDArray[np.float64]:
    try:
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
