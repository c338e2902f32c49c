"""Friction at a solution and the directions of slip that its statuses leave open, in 2D and 3D."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from enumsol.support.immutable import Sealed

if TYPE_CHECKING:
    from enumsol.support.array_types import Floats


@dataclass(frozen=True)
class NodeSlips(Sealed):
    """Where a node slips in 3D, or would: zeta = tau + v with tau = lambda_t / q and v = q u_t, q = F / c.

    c is the mean of a node's coefficients that are not 0, and q is 1 for the others. Forces and displacements are in
    units in which the compliance of the node is one.

    Attributes
    ----------
    direction : (p, 2) array
        zeta over its length, 0 where that is 0.
    share : (p,) array
        Of the lengths of tau and v together, that of tau.
    """

    direction: Floats
    share: Floats

    @classmethod
    def of(cls, F: Floats, tangential: Floats, slip: Floats) -> NodeSlips:
        """At a solution; all arrays are (p, 2)."""
        rubs, q = F > 0, ratios(F)[1]
        tau, v = np.where(rubs, tangential / q, 0.0), np.where(rubs, slip * q, 0.0)
        force, both = np.linalg.norm(tau, axis=1), np.linalg.norm(tau, axis=1) + np.linalg.norm(v, axis=1)
        length = np.linalg.norm(tau + v, axis=1)
        direction = (tau + v) / np.where(length > 0, length, 1.0)[:, None]
        return cls(direction, force / np.where(both > 0, both, 1.0))


def ratios(F: Floats) -> tuple[Floats, Floats]:
    """c, the mean of a node's coefficients that are not 0, and q = F / c, 1 where F = 0; (p,) and F's shape (p, k)."""
    c = np.sum(F, axis=1) / np.maximum(np.sum(F > 0, axis=1), 1)
    return c, np.where(F > 0, F / np.where(c > 0, c, 1.0)[:, None], 1.0)
