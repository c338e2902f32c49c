"""Sparse factorization of the stiffness A, shared by everything that solves with it."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.linalg.lapack import dtrtri
from scipy.sparse.linalg import splu

from enumsol.errors import InvalidProblemError
from enumsol.support.array_types import Floats, Integers
from enumsol.support.deadlines import attended
from enumsol.support.immutable import Immutable, SealedMatrix, sealed

#: A pivot of A below this fraction of its diagonal entry is rounding: A is singular in float64.
PIVOT_TOLERANCE = 64 * float(np.finfo(np.float64).eps)
#: Entries of L from which on blocks of it are made for many right sides; they solve for many of them faster.
LARGE = 2_500_000
#: Right-hand sides solved at once; bounds the dense memory of a condensation to this many vectors of length n.
RHS_BLOCK = 16
#: Numbers in right-hand sides that are solved for at once by blocks.
LONGEST = 2**24


@dataclass(frozen=True, eq=False)
class Supernodes:
    """L and D of A = L D L' in dense blocks: columns of L side by side that have the same rows.

    Products with them are those of dense matrices, where SuperLU solves column by column; columns of right sides that
    are zero above some row, as those of contact nodes, are not worked on there.

    Attributes
    ----------
    blocks : list of (first column, behind the last, rows below, inverse of L among the columns, L' below)
    pivots : (n,) array
    order : (n,) int array
        Rows of L by those of A.
    """

    blocks: list[tuple[int, int, Integers, Floats, Floats]]
    pivots: Floats
    order: Integers

    @classmethod
    def of(cls, L: Any, pivots: Floats, order: Integers) -> Supernodes:
        """Blocks of a unit lower triangular matrix (n, n) in columns."""
        L.sort_indices()
        starts, lengths = L.indptr, np.diff(L.indptr)
        below = L.indices[np.minimum(starts[:-1] + 1, L.nnz - 1)]
        joined = (lengths[1:] == lengths[:-1] - 1) & (below[:-1] == np.arange(1, len(pivots)))
        bounds = np.flatnonzero(np.concatenate([[True], ~joined, [True]]))
        blocks = []
        for first, end in itertools.pairwise(bounds.tolist()):
            width = end - first
            part = np.zeros((width, lengths[first]))
            for k in range(width):
                part[k, k:] = L.data[starts[first + k] : starts[first + k + 1]]
            rows = L.indices[starts[first] + width : starts[first + 1]].copy()
            inverse, _ = dtrtri(part[:, :width].T, lower=1, unitdiag=1)
            blocks.append((first, end, rows, np.tril(inverse), part[:, width:].copy()))
        return cls(blocks, pivots, order)

    def solve(self, rhs: Floats) -> Floats:
        """A^{-1} rhs for rhs of shape (n, k)."""
        x = np.empty(rhs.shape)
        x[self.order] = rhs
        for first, end, rows, inverse, below in self.blocks:
            if np.any(x[first:end]):
                x[first:end] = inverse @ x[first:end]
                x[rows] -= below.T @ x[first:end]
        x /= self.pivots[:, None]
        for first, end, rows, inverse, below in reversed(self.blocks):
            x[first:end] = inverse.T @ (x[first:end] - below @ x[rows])
        return x[self.order]


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

    @property
    def _pivots(self) -> Floats:
        """The pivots relative to the diagonal entries of A, shape (n,)."""
        return self._parts[0]

    @cached_property
    def _parts(self) -> tuple[Floats, Supernodes | None]:
        """The pivots, and L in blocks if it is large and no rows were exchanged.

        Asking SuperLU for U makes sparse copies of L and of U, as large as the factors, which it keeps as long as it
        lives. Nothing else needs them: both are emptied here.
        """
        L, U, order = self._lu.L, self._lu.U, self._lu.perm_c
        pivots = U.diagonal()
        usual = L.nnz < LARGE or np.any(pivots == 0) or not np.array_equal(self._lu.perm_r, order)
        blocks = None if usual else Supernodes.of(L, pivots, order)
        for copy in (L, U):
            copy.data, copy.indices = copy.data[:0].copy(), copy.indices[:0].copy()
            copy.indptr = np.zeros_like(copy.indptr)
        return sealed(np.asarray(pivots / self._diagonal[np.argsort(order)])), blocks

    @property
    def columns(self) -> int:
        """Number of right sides that are best solved for at once."""
        blocks = self._parts[1]
        return RHS_BLOCK if blocks is None else max(RHS_BLOCK, min(4 * RHS_BLOCK, LONGEST // len(blocks.pivots)))

    def _solved(self, rhs: Floats) -> Floats:
        """L D L' x = rhs for the scaled A."""
        if rhs.ndim == 2 and rhs.shape[1] >= RHS_BLOCK and (blocks := self._parts[1]) is not None:
            return blocks.solve(rhs)
        return np.asarray(self._lu.solve(rhs))

    def solve(self, rhs: Floats, *, refined: bool = True) -> Floats:
        """A^{-1} rhs for rhs of shape (n,) or (n, k), by default with one step of iterative refinement."""
        d = self._scale if rhs.ndim == 1 else self._scale[:, None]
        x = d * self._solved(d * rhs)
        if not refined:
            return np.asarray(x)
        residual = rhs - self._A.matrix() @ x
        return np.asarray(x + d * self._solved(d * residual))


_RIGID = (
    "A is singular to working precision (smallest pivot {ratio:.1e} of its diagonal): the body is free to move as a "
    "rigid body or a part is not attached; expected enough degrees of freedom held to exclude rigid motions"
)
