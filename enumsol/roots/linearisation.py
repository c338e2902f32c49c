"""What is computed of a regular root on demand: its condition and derivative, and the signs of u_t.

Large sets of roots seldom need the first two. The signs, from the enclosure or from rationals, name the slip of nodes
without friction.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from enumsol.condensation.condensed import Condensation, FloatingCondensation
from enumsol.condensation.data import EXACT_DOF_LIMIT
from enumsol.model.statuses import FRICTIONLESS, SLIP_MINUS, SLIP_PLUS, STATUSES, STICK, ContactStatus
from enumsol.support.immutable import Sealed

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from enumsol.model.problem import ContactProblem
    from enumsol.selections.float_selections import FloatSelections
    from enumsol.selections.solution import ActiveSets
    from enumsol.support.array_types import Alpha, Codes, Floats, Indices


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
    friction_slope: Floats
    codes: Codes
    force: Floats
    w: Floats

    def condition(self) -> float:
        """Condition number of the scaled matrix."""
        M, _, E = self.floats.matrix(self.codes)
        M = self._bordered(M, self.floats.reduced(self.codes)[0], E, 1.0 / np.sqrt(np.diagonal(self.floats.system.S)))
        return float(np.linalg.cond(M)) if len(M) else 1.0

    @cached_property
    def rates(self) -> tuple[Floats, Floats] | None:
        """d(lambda_n, lambda_t)/d alpha and d(u_n, u_t)/d alpha in the selection: M lambda = b differentiated.

        Both have shape (p, 2). Where a coefficient is zero but its slope is not, the branch is followed to the side on
        which F >= 0; None where a node with such a coefficient does not slip, since the branch may then stick.
        """
        floats, condensed, p = self.floats, self.condensed, self.floats.p
        system = floats.system
        change: Floats = np.zeros(2 * p)
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
        rigid: Floats = np.zeros(len(G))
        if len(rhs):
            matrix = self._bordered(system.S[rows] @ E, rows, E)
            found = np.asarray(np.linalg.solve(matrix, rhs), dtype=np.float64)
            change, rigid = change + E @ found[: len(rows)], found[len(rows) :]
        move = (load - system.S @ change + G.T @ rigid) * system.length
        change = change * system.force
        return change.reshape(2, p).T, move.reshape(2, p).T

    def _bordered(self, matrix: Floats, rows: Indices, E: Floats, size: Floats | float = 1.0) -> Floats:
        """The matrix of the selection, whose rows are those of S times ``size``, with q and equilibrium as a whole."""
        G = self._moves
        return np.block([[matrix, -(G * size)[:, rows].T], [G @ E, np.zeros((len(G), len(G)))]])

    @cached_property
    def _moves(self) -> Floats:
        """G in the units of ``floats`` and of rigid displacements, shape (r, 2p)."""
        if not isinstance(self.condensed, FloatingCondensation):
            return np.zeros((0, 2 * self.floats.p))
        system = self.floats.system
        return np.asarray(self.condensed.moves * self.condensed.node_scale * np.sqrt(system.force / system.length))

    @property
    def _load(self) -> Floats:
        """The derivative of h in the same units, shape (r,)."""
        if not isinstance(self.condensed, FloatingCondensation):
            return np.zeros(0)
        unit = np.sqrt(self.floats.system.force[0] * self.floats.system.length[0])
        return np.asarray(np.linalg.solve(self.condensed.mixing, self.condensed.h[1]) / unit)


@dataclass(frozen=True)
class SlipSigns:
    """Signs of u_t at a root of one selection.

    Attributes
    ----------
    problem : ContactProblem
    alpha : float or Fraction
    codes : tuple of p status codes
        The root's selection, which is regular where a sign has to be found in rationals.
    known : tuple of p (int or None)
        Signs that the enclosure, rationals or the tolerance of fast arithmetic decide; None where they do not.
    """

    problem: ContactProblem
    alpha: Alpha
    codes: Codes
    known: tuple[int | None, ...]

    def sign(self, node: int) -> int | None:
        """-1, 0 or 1; None where it would take rationals and the problem is too large for them."""
        known = self.known[node]
        return known if known is not None or self._exact is None else self._exact[node]

    @cached_property
    def _exact(self) -> tuple[int, ...] | None:
        """All signs in rationals; None when the problem is too large for them."""
        if self.problem.n > EXACT_DOF_LIMIT or not self.problem.known_exactly:
            return None
        from enumsol.condensation.exact import exact_system  # python-flint, not for fast arithmetic
        from enumsol.selections.rational_selections import ExactSelections

        solver = ExactSelections(exact_system(self.problem, self.alpha))
        solution = solver.solve(self.codes)
        return None if solution is None else solver.slip_signs(solution.vertices[0])


def slip_names(sign: int | None) -> frozenset[ContactStatus]:
    """Statuses of a node in contact without friction by the sign of its u_t: all three where that is 0 or not known."""
    if not sign:
        return frozenset(STATUSES[code] for code in (STICK, SLIP_PLUS, SLIP_MINUS))
    return frozenset((STATUSES[SLIP_PLUS if sign > 0 else SLIP_MINUS],))


def named_statuses(
    active: ActiveSets, slip_sign: Callable[[int], int | None]
) -> tuple[tuple[ContactStatus, ...], tuple[frozenset[ContactStatus], ...]]:
    """Of every node the first status that holds, and all; ``slip_sign`` gives the sign of u_t without friction."""
    names = tuple(
        frozenset(
            name
            for code in codes
            for name in (slip_names(slip_sign(node)) if code == FRICTIONLESS else (STATUSES[code],))
        )
        for node, codes in enumerate(active)
    )
    return tuple(next(status for status in STATUSES if status in held) for held in names), names


def sign_over(signs: Iterable[int]) -> int:
    """The sign of u_t on a polytope whose corners have these signs; 0 where it takes both or none."""
    found = set(signs) - {0}
    return found.pop() if len(found) == 1 else 0
