"""The trusted form (6.9) of a whole problem for all data of a piece (theory, sections 7.15 and 13.5)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball, factor_above, gamma, upper_norm

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PieceNumbers:
    """The numbers of the form of theory, (6.9), for all data of a piece.

    Attributes
    ----------
    mu, kappa, nu : (p,) arrays
        mu and kappa positive; kappa and nu are read at nodes with friction only.
    """

    mu: Array
    kappa: Array
    nu: Array

    @property
    def usable(self) -> bool:
        """Whether they are numbers, and positive where they must be."""
        finite = all(np.all(np.isfinite(part)) for part in (self.mu, self.kappa, self.nu))
        return bool(finite and np.all(self.mu > 0) and np.all(self.kappa > 0))

    def serve(self, largest: Array) -> bool:
        """Whether ``|nu| F <= mu`` for all coefficients up to these."""
        return not np.any(np.abs(self.nu) * largest * SAFE + TINY > self.mu)

    def form(self, S: Ball, theta: Ball) -> Ball:
        """D'S, of which (6.9) is the symmetric part."""
        p = len(self.mu)
        along = S[:p] * Ball.exact(self.mu[:, None])
        turned = (theta * Ball.exact(self.kappa))[:, None]
        across = S[:p] * Ball.exact(self.nu[:, None]) + S[p:] * Ball.exact(self.kappa[:, None])
        along = along - S[p:] * turned
        return Ball.joined(along, across)

    def taken(self, S: Ball, off: Array) -> Ball:
        """What a theta that is off by so much takes from the form at most (theory, (7.18))."""
        p = len(self.mu)
        nodes = np.flatnonzero(off > 0)
        length = upper_norm(S[p + nodes].size, axis=1)
        weight = self.kappa[nodes] * off[nodes] * SAFE
        # weights at least kappa rho / |r|, for any rounding
        T = S[p + nodes] * Ball.exact((np.sqrt(weight / length) * SAFE + TINY)[:, None])
        square = T.T @ T
        taken = Ball(0.5 * square.mid, 0.5 * square.rad)
        taken.mid[nodes, nodes] += 0.5 * weight * length * SAFE
        taken.rad[nodes, nodes] += 4 * UNIT * taken.mid[nodes, nodes]
        return taken


def definite(form: Ball, margin: float) -> bool:
    """Whether the symmetric parts of all matrices in a ball are positive definite.

    ``margin``: their smallest eigenvalue has to be larger than this, relative to the largest entry of the diagonal.
    """
    form = form.symmetric
    if not form.finite:
        return False
    mid = form.mid
    k, largest = gamma(len(mid) + 2), float(np.max(np.abs(np.diagonal(mid)), initial=0.0))
    # a Cholesky factorization that runs to its end proves M >= -gamma trace (Rump 2006)
    slack = k / (1 - k) * float(np.trace(np.abs(mid))) + float(upper_norm(form.rad)) + margin * largest
    shift = (slack + 8 * UNIT * largest) * (1.0 + 8 * UNIT) * SAFE + TINY
    return factor_above(mid, shift) is not None
