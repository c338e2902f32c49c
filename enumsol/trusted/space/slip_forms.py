"""The trusted forms in 3D that bound in place of the energy (theory, section 12.2).

At every solution e = -(sum of lambda_n |v|), and |v| is at least c . v for every vector c that is no longer than one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.ball_arrays import Ball
from enumsol.arithmetic.balls import TINY, UNIT, upper_norm
from enumsol.trusted.quadratic_forms import QuadraticForm

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from enumsol.condensation.space_condensed import EnclosedSpace

    Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SlipForm(QuadraticForm):
    """q(y) = e(y) + sum of lambda_n c . v over all nodes, at most zero at every solution; theory, section 12.2.

    Attributes
    ----------
    directions : (m - p,) array
        The components of c, one for each tau, in their order in y.
    """

    directions: Array

    @classmethod
    def of(cls, system: EnclosedSpace, directions: Array) -> SlipForm:
        """The form of given vectors c.

        Raises
        ------
        ValueError
            There are not as many numbers as tau, or the c of a node is longer than one.
        """
        tau, p = system.tau, len(system.tau)
        if directions.shape != (len(system.g) - p,):
            raise ValueError(f"a form has {len(directions)} numbers; expected {len(system.g) - p}")
        place = np.where(tau >= 0, tau - p, len(directions))
        if not np.all(upper_norm(np.append(directions, 0.0)[place], axis=1) <= 1.0):
            raise ValueError("the vector of a node is longer than one")
        S, g = Ball(system.S, system.S_rad), Ball(system.g, system.g_rad)
        H, h = Ball(S.mid.copy(), S.rad.copy()), Ball(g.mid.copy(), g.rad.copy())
        # units are powers of two: what is rounded is less than TINY
        with np.errstate(over="ignore", invalid="ignore"):
            share = Ball(directions / system.unit[p:], np.full(len(directions), TINY))
            for k in range(2):
                n = np.flatnonzero(tau[:, k] >= 0)
                t = tau[n, k]
                H[n] = H[n] - S[t] * share[t - p][:, None]
                h[n] = h[n] - g[t] * share[t - p]
            mid = 0.5 * (H.mid + H.mid.T)
            rad = 0.5 * (H.rad + H.rad.T) * (1 + 4 * UNIT) + 4 * UNIT * np.abs(mid) + TINY
        return cls(system, mid, rad, h.mid, h.rad, 0.0, 0.0, directions)
