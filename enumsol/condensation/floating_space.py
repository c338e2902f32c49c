"""The condensed problem in 3D of a body that nothing holds (theory, sections 12.1 and 14.6)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from enumsol.arithmetic.ball_arrays import Ball
from enumsol.condensation.floating import FloatingSystem, RigidRows
from enumsol.condensation.space_condensed import EnclosedSpace, places

if TYPE_CHECKING:
    from fractions import Fraction

    from enumsol.arithmetic.balls import Array


@dataclass(frozen=True)
class FloatingSpace(FloatingSystem, EnclosedSpace):
    """The problem of a body in 3D that nothing holds at one alpha as balls, in the variables of EnclosedSpace.

    S and g are those of the body on springs. The rows G of its equilibrium as a whole act on (lambda_n, tau).
    """

    @classmethod
    def of(cls, problem: Any, alpha: Fraction, force: Array, length: Array) -> Self:
        """That of a problem, in units of the nodes given by powers of two.

        Raises
        ------
        NotEnclosedError
            Something over- or underflows.
        """
        held = EnclosedSpace.of_problem(problem.on_springs.enclosure, alpha, force, length)
        rows = RigidRows.of(problem, alpha, np.tile(force, 3), np.tile(length, 3))
        _, own, node, axis = places(held.F > 0)
        none = np.zeros(held.p)
        weight = Ball(np.r_[none + 1.0, held.F[node, axis]], np.r_[none, held.F_rad[node, axis]])
        G = rows.G[:, own]
        product = G * weight
        # zeros are exact
        rows = replace(rows, G=Ball(product.mid, np.where(G.size > 0, product.rad, 0.0)))
        data = held.S, held.S_rad, held.g, held.g_rad, held.F, held.F_rad, held.tau, held.unit
        return cls(*data, rows=rows)
