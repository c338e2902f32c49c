"""The trusted forms in 3D that bound in place of the energy (theory, section 12.2).

At every solution lambda_n w_n = 0, and tau . v = lambda_n |v| is at least lambda_n c . v for every vector c that is no
longer than one, node by node.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball
from enumsol.trusted.quadratic_forms import QuadraticForm
from enumsol.trusted.space.sector_rows import sector_margin

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.condensation.space_condensed import EnclosedSpace
    from enumsol.support.array_types import Floats
    from enumsol.trusted.space.sector_rows import Row


@dataclass(frozen=True, eq=False)
class SlipForm(QuadraticForm):
    """q(y) = - sum over all nodes of mu lambda_n w_n + kappa tau . v - lambda_n c . v; theory, section 12.2.

    It is at most zero at every solution, since |c| is at most kappa.

    Attributes
    ----------
    numbers : (m + p,) array
        mu and kappa of all nodes, and the components of c, one for each tau, in their order in y.
    """

    numbers: Floats

    @classmethod
    def of(cls, system: EnclosedSpace, numbers: Floats) -> SlipForm:
        """The form of given multipliers.

        Raises
        ------
        ValueError
            There are not as many numbers as a form has, or the c of a node is longer than its kappa.
        """
        tau, p = system.tau, len(system.tau)
        if numbers.shape != (len(system.g) + p,):
            raise ValueError(f"a form has {len(numbers)} numbers; expected {len(system.g) + p}")
        mu, kappa, c = np.split(numbers, [p, 2 * p])
        place = np.where(tau >= 0, tau - p, len(c))
        first, second = np.append(c, 0.0)[place].T
        if not np.all(np.hypot(first, second) * SAFE + TINY <= kappa):
            raise ValueError("the vector c of a node is longer than its kappa")
        # units are powers of two: what is rounded is less than TINY
        with np.errstate(over="ignore", invalid="ignore"):
            share = Ball(c / system.unit[p:], np.full(len(c), TINY))
            node, axis = np.nonzero(tau >= 0)
            weight = np.append(mu, np.zeros(len(c)))
            weight[tau[node, axis]] = kappa[node]
            S, g, factor = Ball(system.S, system.S_rad), Ball(system.g, system.g_rad), Ball.exact(weight)
            H, h = S * factor[:, None], g * factor
            for k in range(2):
                n = np.flatnonzero(tau[:, k] >= 0)
                t = tau[n, k]
                H[n] = H[n] - S[t] * share[t - p][:, None]
                h[n] = h[n] - g[t] * share[t - p]
            mid = 0.5 * (H.mid + H.mid.T)
            rad = 0.5 * (H.rad + H.rad.T) * (1 + 4 * UNIT) + 4 * UNIT * np.abs(mid) + TINY
        return cls(system, mid, rad, h.mid, h.rad, 0.0, 0.0, numbers)

    def margin(self, codes: Sequence[int], rows: Sequence[Row], values: Floats, errors: float = 1.0) -> float:
        """See ``sector_margin``."""
        return sector_margin(cast("EnclosedSpace", self.system), codes, rows, values, errors, self)
