"""Sparse factorization of the stiffness A, shared by everything that solves with it."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from enumsol.errors import InvalidProblemError
from enumsol.support.array_types import Floats
from enumsol.support.deadlines import attended
from enumsol.support.immutable import Immutable, SealedMatrix, sealed

#: A pivot of A below this fraction of its diagonal entry is rounding: A is singular in float64.
PIVOT_TOLERANCE = 64 * float(np.finfo(np.float64).eps)


class Factorization(Immutable):
    """Sparse symmetric factorization A = L D L' with diagonal pivots, after scaling A to unit diagonal.

    Parameters
    ----------
    A : (n, n) csc_array, symmetric
    """

    def __init__(self, A: sp.csc_array) -> None:
        self._A = SealedMatrix.of(A)
        diagonal = A.diagonal()
        if np.any(diagonal <= 0):
            row = int(np.argmin(diagonal))
            raise InvalidProblemError(
                f"A is not positive definite: its diagonal entry {row} is {diagonal[row]:g}; expected a positive value"
            )
        # powers of two: the scaling itself makes no rounding error
        self._scale = sealed(np.exp2(-np.round(0.5 * np.log2(diagonal))))
        self._diagonal = sealed(self._scale * diagonal * self._scale)
        scaling = sp.diags_array(self._scale)
        options = {"SymmetricMode": True, "Equil": False}
        try:
            # the scaled copy of A is not kept: the factors are all that solving needs
            self._lu = attended(
                lambda: splu(
                    sp.csc_array(scaling @ A @ scaling),
                    permc_spec="MMD_AT_PLUS_A",
                    diag_pivot_thresh=0.0,
                    options=options,
                ),
                A.nnz,
                "factors of A",
            )
        except RuntimeError as error:  # SuperLU: "Factor is exactly singular"
            raise InvalidProblemError(_RIGID.format(ratio=0.0)) from error
        self._freeze()

    def check_positive_definite(self) -> None:
        """Raise InvalidProblemError unless every pivot is positive and above rounding."""
        pivots = self._pivots
        # rows are exchanged where a pivot is zero: in an indefinite matrix, and in a singular one, whose last pivots
        # are what rounding leaves
        exchanged = not np.array_equal(self._lu.perm_r, self._lu.perm_c) and np.min(np.abs(pivots)) > PIVOT_TOLERANCE
        if exchanged or np.min(pivots) < -PIVOT_TOLERANCE:
            raise InvalidProblemError(
                "A is not positive definite (an elimination pivot is negative); expected the stiffness of a stable body"
            )
        if np.min(pivots) <= PIVOT_TOLERANCE:
            raise InvalidProblemError(_RIGID.format(ratio=max(float(np.min(pivots)), 0.0)))

    @cached_property
    def _pivots(self) -> Floats:
        """The pivots relative to the diagonal entries of A, shape (n,).

        Asking SuperLU for U makes sparse copies of L and of U, as large as the factors, which it keeps as long as it
        lives. Nothing else needs them: both are emptied here.
        """
        L, U = self._lu.L, self._lu.U
        pivots = U.diagonal() / self._diagonal[np.argsort(self._lu.perm_c)]
        for copy in (L, U):
            copy.data, copy.indices = copy.data[:0].copy(), copy.indices[:0].copy()
            copy.indptr = np.zeros_like(copy.indptr)
        return sealed(np.asarray(pivots))

    def solve(self, rhs: Floats, *, refined: bool = True) -> Floats:
        """A^{-1} rhs for rhs of shape (n,) or (n, k), by default with one step of iterative refinement."""
        d = self._scale if rhs.ndim == 1 else self._scale[:, None]
        x = d * self._lu.solve(d * rhs)
        if not refined:
            return np.asarray(x)
        residual = rhs - self._A.matrix() @ x
        return np.asarray(x + d * self._lu.solve(d * residual))


_RIGID = (
    "A is singular to working precision (smallest pivot {ratio:.1e} of its diagonal): the body is free to move as a "
    "rigid body or a part is not attached; expected enough degrees of freedom held to exclude rigid motions"
)
