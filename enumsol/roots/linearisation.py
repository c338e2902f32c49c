"""Condition and derivative of a regular root, computed on demand: large sets of roots seldom need them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from enumsol.model.statuses import FRICTIONLESS, SLIP_MINUS, SLIP_PLUS
from enumsol.support.immutable import Sealed

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from enumsol.condensation.condensed import CondensedProblem
    from enumsol.selections.float_selections import FloatSelections
    from enumsol.selections.solution import Codes


@dataclass(frozen=True)
class SelectionTangent(Sealed):
    """The linear system of a regular root's selection.

    Attributes
    ----------
    floats : FloatSelections
        Solver of the system at the root's alpha.
    condensed : CondensedProblem
    codes : tuple of p status codes
    force, w : (2p,) arrays
        lambda and w at the root, in the problem's units.
    """

    floats: FloatSelections
    condensed: CondensedProblem
    codes: Codes
    force: NDArray[np.float64]
    w: NDArray[np.float64]

    def condition(self) -> float:
        """Condition number of the scaled matrix."""
        return self.floats.condition(self.codes)

    def derivative(self) -> NDArray[np.float64] | None:
        """d(lambda_n, lambda_t)/d alpha in the selection, shape (p, 2): M(alpha) lambda = b(alpha) differentiated.

        Where a coefficient is zero but its slope is not, the branch is followed to the side on which F >= 0; None where
        a node with such a coefficient does not slip, since the branch may then stick.
        """
        floats, condensed, p = self.floats, self.condensed, self.floats.p
        system = floats.system
        change = np.zeros(2 * p)
        for i, code in enumerate(self.codes):
            if code in (SLIP_PLUS, SLIP_MINUS):
                change[p + i] = (1.0 if code == SLIP_PLUS else -1.0) * condensed.F1[i] * self.force[i]
            elif code == FRICTIONLESS and condensed.F1[i] != 0:
                slip = self.w[p + i] / system.length[p + i]
                if abs(slip) <= floats.tolerance:
                    return None
                change[p + i] = float(np.sign(slip)) * condensed.F1[i] * self.force[i]
        change /= system.force
        rows, E = floats.reduced(self.codes)
        if len(rows):
            rhs = (condensed.g1 / system.length - system.S @ change)[rows]
            change = change + E @ np.linalg.solve(system.S[rows] @ E, rhs)
        change = change * system.force
        return np.column_stack([change[:p], change[p:]])
