"""Where the contact nodes are at a root: the start of the next step of a history (theory, section 13.2)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.ball_arrays import Ball

if TYPE_CHECKING:
    from fractions import Fraction

    from numpy.typing import NDArray

    from enumsol.condensation.enclosure import CondensedEnclosure


def tangential_positions(
    enclosure: CondensedEnclosure, alpha: Fraction, forces: Ball, still: NDArray[np.bool_], before: Ball
) -> Ball:
    """Bt u at a root whose forces lie in a ball, for every slip offset in a ball.

    A node with u_t = 0 for certain stays where it was: its ball is carried over unchanged. Any other is where the load
    and the forces move it, theory, (13.2), whatever its own offset was.

    Parameters
    ----------
    enclosure : CondensedEnclosure
        Of the step's problem.
    alpha : Fraction
    forces : Ball of shape (2p,) or (3p,)
        lambda: normal components first [force].
    still : (p,) or (2p,) bool array
        Tangential components for which u_t = 0 at the root, whatever the data in their balls are.
    before : Ball of the same shape
        The slip offset [length].
    """
    p = len(enclosure.problem.gap)
    S = Ball(enclosure.S, enclosure.S_rad)
    with np.errstate(over="ignore", invalid="ignore"):
        moved = (enclosure.moved_freely(alpha) - (S @ forces[:, None])[:, 0])[p:]
    return Ball(np.where(still, before.mid, moved.mid), np.where(still, before.rad, moved.rad))
