"""Condition and derivative of a regular root, computed on demand: large sets of roots seldom need them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from enumsol.condensation.condensed import FloatingCondensation
from enumsol.model.statuses import FRICTIONLESS, SLIP_MINUS, SLIP_PLUS
from enumsol.support.immutable import Sealed

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from enumsol.condensation.condensed import Condensation
    from enumsol.selections.float_selections import FloatSelections
    from enumsol.selections.solution import Codes

    Array = NDArray[np.float64]


@dataclass(frozen=True)
class SelectionTangent(Sealed):
    """The linear system of a regular root's selection.

    Of a body that nothing holds it has the coordinates of the rigid displacement among its unknowns, and the
    equilibrium of the body as a whole among its equations (theory, (14.3)).

    Attributes
    ----------
    floats : FloatSelections
        Solver of the system at the root's alpha, of the body on springs where nothing holds it.
    condensed : Condensation
        Of the 2D problem.
    friction_slope : (p,) array
    codes : tuple of p status codes
    force, w : (2p,) arrays
        lambda and w at the root, in the problem's units.
    """

    floats: FloatSelections
    condensed: Condensation
    friction_slope: Array
    codes: Codes
    force: Array
    w: Array

    def condition(self) -> float:
        """Condition number of the scaled matrix."""
        M, _, E = self.floats.matrix(self.codes)
        M = self._bordered(M, self.floats.reduced(self.codes)[0], E, 1.0 / np.sqrt(np.diagonal(self.floats.system.S)))
        return float(np.linalg.cond(M)) if len(M) else 1.0

    @cached_property
    def rates(self) -> tuple[Array, Array] | None:
        """d(lambda_n, lambda_t)/d alpha and d(u_n, u_t)/d alpha in the selection: M lambda = b differentiated.

        Both have shape (p, 2). Where a coefficient is zero but its slope is not, the branch is followed to the side on
        which F >= 0; None where a node with such a coefficient does not slip, since the branch may then stick.
        """
        floats, condensed, p = self.floats, self.condensed, self.floats.p
        system = floats.system
        change: Array = np.zeros(2 * p)
        for i, code in enumerate(self.codes):
            if code in (SLIP_PLUS, SLIP_MINUS):
                change[p + i] = (1.0 if code == SLIP_PLUS else -1.0) * self.friction_slope[i] * self.force[i]
            elif code == FRICTIONLESS and self.friction_slope[i] != 0:
                slip = self.w[p + i] / system.length[p + i]
                if abs(slip) <= floats.tolerance:
                    return None
                change[p + i] = float(np.sign(slip)) * self.friction_slope[i] * self.force[i]
        change /= system.force
        rows, E = floats.reduced(self.codes)
        load, G = condensed.g1 / system.length, self._moves
        rhs = np.append((load - system.S @ change)[rows], self._load - G @ change)
        rigid: Array = np.zeros(len(G))
        if len(rhs):
            matrix = self._bordered(system.S[rows] @ E, rows, E)
            found = np.asarray(np.linalg.solve(matrix, rhs), dtype=np.float64)
            change, rigid = change + E @ found[: len(rows)], found[len(rows) :]
        move = (load - system.S @ change + G.T @ rigid) * system.length
        change = change * system.force
        return change.reshape(2, p).T, move.reshape(2, p).T

    def _bordered(self, matrix: Array, rows: NDArray[np.intp], E: Array, size: Array | float = 1.0) -> Array:
        """The matrix of the selection, whose rows are those of S times ``size``, with q and equilibrium as a whole."""
        G = self._moves
        return np.block([[matrix, -(G * size)[:, rows].T], [G @ E, np.zeros((len(G), len(G)))]])

    @cached_property
    def _moves(self) -> Array:
        """G in the units of ``floats`` and of rigid displacements, shape (r, 2p)."""
        if not isinstance(self.condensed, FloatingCondensation):
            return np.zeros((0, 2 * self.floats.p))
        system = self.floats.system
        return np.asarray(self.condensed.moves * self.condensed.node_scale * np.sqrt(system.force / system.length))

    @property
    def _load(self) -> Array:
        """The derivative of h in the same units, shape (r,)."""
        if not isinstance(self.condensed, FloatingCondensation):
            return np.zeros(0)
        unit = np.sqrt(self.floats.system.force[0] * self.floats.system.length[0])
        return np.asarray(np.linalg.solve(self.condensed.mixing, self.condensed.h[1]) / unit)
