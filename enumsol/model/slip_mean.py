"""The slip that coefficients of friction depend on, as weighted means over the contact surface."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from enumsol.errors import InvalidProblemError
from enumsol.support.array_arguments import real_array, real_matrix, vector_of
from enumsol.support.immutable import Immutable, SealedMatrix, sealed

if TYPE_CHECKING:
    from enumsol.support.array_types import ArrayLike, Floats

#: How far from 1 weights of a mean may add up to.
_SUM_TOLERANCE = 1e-9


class SlipMean(Immutable):
    """The slip that coefficients depend on, as weighted means of ``|u_t|``: the return operator r_h (paper, Section 3).

    The slips are ``weights @ |(T1 u, T2 u) - offset|``.

    Parameters
    ----------
    T1, T2 : (q, n) array_like or sparse
        Tangential displacements at q places of the contact surface.
    offset : (q, 2) array_like
        Tangential positions from which slip is counted there [length].
    weights : (p, q) array_like or sparse
        Of nonnegative rows that add up to one.

    Raises
    ------
    InvalidProblemError
        An argument is not of that form.

    Examples
    --------
    >>> import enumsol
    >>> problem = enumsol.gallery.block3d(4, 4, 1, multipliers="elements", ratio=2)
    >>> problem.slip_mean.weights.sum(axis=1)
    array([1., 1., 1., 1.])
    """

    def __init__(
        self,
        T1: ArrayLike | sp.sparray | sp.spmatrix,
        T2: ArrayLike | sp.sparray | sp.spmatrix,
        offset: ArrayLike,
        weights: ArrayLike | sp.sparray | sp.spmatrix,
    ) -> None:
        given = {"T1": T1, "T2": T2, "weights": weights}
        matrices = {name: sp.csr_array(real_matrix(value, f"slip_mean_{name}")) for name, value in given.items()}
        self.offset = sealed(real_array(offset, "slip_mean_offset"))
        self._parts = {name: SealedMatrix.of(matrix) for name, matrix in matrices.items()}
        self.check(matrices["T1"].shape[1], matrices["weights"].shape[0])
        if np.any(matrices["weights"].data < 0):
            raise InvalidProblemError("slip_mean has a negative weight; expected weights >= 0")
        sums = np.asarray(matrices["weights"].sum(axis=1)).ravel()
        if np.any(np.abs(sums - 1.0) > _SUM_TOLERANCE):
            row = int(np.argmax(np.abs(sums - 1.0)))
            raise InvalidProblemError(f"slip_mean has weights that add up to {sums[row]:g} in row {row}; expected 1")
        self._freeze()

    @property
    def T1(self) -> sp.csr_array:  # noqa: N802 (the field's letter)
        """Displacements along the first tangent, sparse (q, n); a new object, whose parts are read-only."""
        return self._parts["T1"].matrix()

    @property
    def T2(self) -> sp.csr_array:  # noqa: N802 (as above)
        """Displacements along the second tangent, sparse (q, n); a new object as T1 is."""
        return self._parts["T2"].matrix()

    @property
    def weights(self) -> sp.csr_array:
        """Weights, sparse (p, q); a new object as T1 is."""
        return self._parts["weights"].matrix()

    def __call__(self, u: ArrayLike) -> Floats:
        """Slip of the p contact rows, shape (p,), for u of shape (n,) [length].

        Raises
        ------
        InvalidArgumentError
            u is not that.
        """
        v = vector_of(u, "u", self._parts["T1"].shape[1])
        return np.asarray(self.weights @ np.hypot(self.T1 @ v - self.offset[:, 0], self.T2 @ v - self.offset[:, 1]))

    def check(self, n: int, p: int) -> SlipMean:
        """The mean, which has to be one of a problem with n degrees of freedom and p contact rows."""
        q = self._parts["T1"].shape[0]
        found = (*(self._parts[name].shape for name in ("T1", "T2")), self.offset.shape, self._parts["weights"].shape)
        if found != (expected := ((q, n), (q, n), (q, 2), (p, q))):
            raise InvalidProblemError(f"slip_mean has T1, T2, offset, weights of shapes {found}; expected {expected}")
        return self

    def __repr__(self) -> str:
        (p, q), n = self._parts["weights"].shape, self._parts["T1"].shape[1]
        return f"SlipMean of |u_t| at {q} places for {p} contact rows and {n} degrees of freedom"
