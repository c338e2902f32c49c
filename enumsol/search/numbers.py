"""Numbers with which the form of theory, (6.9), is definite, as far as floats tell; nothing here is trusted."""

from __future__ import annotations

import enum
from typing import TYPE_CHECKING

import numpy as np

from enumsol.search.definite import DEFINITE, AnalyticCentres
from enumsol.search.descent import Descent

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from enumsol.search.definite import Nodes

    Array = NDArray[np.float64]


class WeightSource(enum.Enum):
    """Where numbers are sought: mu = kappa = 1 and nu = 0 only; near analytic centres besides; or by descent."""

    PLAIN = enum.auto()
    CENTRES = enum.auto()
    DESCENT = enum.auto()


def weights_of(R: Array, nodes: Nodes, sought: WeightSource = WeightSource.CENTRES) -> Array | None:
    """mu, kappa, nu, theta / F and tau for which (6.9) is definite, as a proof has them; None where none were found.

    Parameters
    ----------
    R : (k, k) array
    nodes : Nodes
    sought : where; analytic centres serve where the form has to serve any theta, and the others hardly or not at all

    Returns
    -------
    (count + 4 b,) array
    """
    b, F, share, n = len(nodes.F), nodes.F, nodes.first, nodes.normal
    T = F[:, None] * R[nodes.tangential]
    tau = np.where(nodes.wide, np.maximum(np.sqrt(np.sum(T * T, axis=1)), DEFINITE), 0.0)
    form = R.copy()
    form[n] -= share[:, None] * T
    wide = np.flatnonzero(nodes.wide)
    form -= 0.5 * (T[wide] / tau[wide, None]).T @ T[wide]
    form[n, n] -= 0.5 * tau
    try:
        if np.linalg.eigvalsh(0.5 * (form + form.T))[0] > DEFINITE:
            return np.concatenate([np.ones(nodes.count + b), np.zeros(b), share, tau])
        if sought is WeightSource.PLAIN:
            return None
        with np.errstate(all="ignore"):
            search = Descent if sought is WeightSource.DESCENT and not len(wide) else AnalyticCentres
            return search(R, nodes).numbers()
    except np.linalg.LinAlgError:
        return None
