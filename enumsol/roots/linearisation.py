"""What is computed of a regular root on demand: its condition and derivative, and the signs of u_t.

Large sets of roots seldom need the first two. The signs, from the enclosure or from rationals, name the slip of nodes
without friction.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from enumsol.condensation.condensed import CondensedProblem, condensation_of
from enumsol.condensation.data import EXACT_DOF_LIMIT
from enumsol.model.statuses import FRICTIONLESS, OPEN, SLIP_MINUS, SLIP_PLUS, STATUSES, STICK, ContactStatus
from enumsol.support.immutable import Sealed

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from enumsol.model.problem import ContactProblem
    from enumsol.model.problem3d import AnyProblem
    from enumsol.selections.float_selections import FloatSelections
    from enumsol.selections.solution import ActiveSets
    from enumsol.support.array_types import Alpha, Codes, Floats, Indices


@dataclass(frozen=True)
class SelectionTangent(Sealed):
    """The equations of a regular root's statuses, linearised there.

    Of a body that nothing holds they have the coordinates of the rigid displacement among their unknowns, and the
    equilibrium of the body as a whole among them (theory, (14.3)).

    Attributes
    ----------
    condensed : CondensedProblem
    friction : F and its derivative at the root's alpha, (p,), in 3D (p, 2)
    codes : tuple of p status codes
        In 3D a sector, or slip along one axis, stands for slip in the direction that the root has.
    force, w : (m,) arrays
        lambda and w at the root, in the problem's units.
    floats : FloatSelections or None
        In 2D, solver of the system at the root's alpha, of the body on springs where nothing holds it.
    """

    condensed: CondensedProblem
    friction: tuple[Floats, Floats]
    codes: Codes
    force: Floats
    w: Floats
    floats: FloatSelections | None = None

    @classmethod
    def at(
        cls,
        problem: AnyProblem,
        alpha: Alpha,
        codes: Codes,
        force: Floats,
        w: Floats,
        floats: FloatSelections | None = None,
    ) -> SelectionTangent:
        """Tangent of a selection of a problem at an alpha."""
        F0, F1 = problem.affine_friction
        return cls(condensation_of(problem), (F0 + float(alpha) * F1, F1), codes, force, w, floats)

    def condition(self) -> float:
        """In 2D, the condition number of the scaled matrix."""
        if self.floats is None:
            raise ValueError("the condition number is that of a selection in 2D")
        M, _, E = self.floats.matrix(self.codes)
        M = self._bordered(self.floats, M, E)
        return float(np.linalg.cond(M)) if len(M) else 1.0

    def _bordered(self, floats: FloatSelections, matrix: Floats, E: Floats) -> Floats:
        """The matrix of the selection with q and equilibrium as a whole."""
        system, rows = floats.system, floats.reduced(self.codes)[0]
        G = np.asarray(self.condensed.moves * self.condensed.node_scale * np.sqrt(system.force / system.length))
        size = 1.0 / np.sqrt(np.diagonal(system.S))
        return np.block([[matrix, -(G * size)[:, rows].T], [G @ E, np.zeros((len(G), len(G)))]])

    @cached_property
    def rates(self) -> tuple[Floats, Floats] | None:
        """d(lambda_n, lambda_t)/d alpha and d(u_n, u_t)/d alpha with these statuses (theory, (7.8)).

        Both have shape (p, 2), in 3D (p, 3). Where the coefficients of a node are zero but their slope is not, the
        branch is followed to the side on which F >= 0; None where such a node does not slip, since the branch may then
        stick.
        """
        condensed, p, m = self.condensed, len(self.codes), len(self.force)
        scale, matrix = condensed.node_scale, condensed.bordered
        g1, J = condensed.g1 / scale, np.eye(len(matrix))
        right: Floats = np.zeros(len(matrix))
        if len(matrix) > m:
            J[m:], right[m:] = matrix[m:], np.linalg.solve(condensed.mixing, condensed.h[1])
        for i, code in enumerate(self.codes):
            if code == OPEN:
                continue
            J[i], right[i] = matrix[i], g1[i]
            found = self._tangential(i, code, matrix, g1)
            if found is None:
                return None
            rows, J[rows], right[rows] = found[0], *found[1:]
        change = np.linalg.solve(J, right)
        move = (g1 - matrix[:m] @ change) * scale
        return (change[:m] / scale).reshape(-1, p).T, move.reshape(-1, p).T

    def _tangential(self, i: int, code: int, matrix: Floats, g1: Floats) -> tuple[Indices, Floats, Floats] | None:
        """The tangential equations of a node in contact: their rows and right-hand sides; None where it may stick."""
        p, scale = len(self.codes), self.condensed.node_scale
        F, dF = (one.reshape(p, -1)[i] for one in self.friction)
        t, held, n = p * (1 + np.arange(len(F))) + i, F > 0, self.force[i] * scale[i]
        w, J = (self.w / scale)[t], np.eye(len(matrix))[t]
        if code == STICK:
            without = bool(np.any(~held & (dF != 0)))
            return None if without else (t[held], matrix[t[held]], g1[t[held]])
        if not np.any(held):
            # it may stick if it is known to move less than this, by the largest displacement
            still = np.linalg.norm(w[dF != 0]) <= 1e-9 * np.max(np.abs(self.w / scale))
            return None if still and np.any(dF != 0) else (t, J, n * dF * _unit(np.abs(dF) * w))
        if len(F) == 1:
            d, across = np.array([-1.0 if code == SLIP_MINUS else 1.0]), np.zeros((1, 1))
        else:
            d = _unit(F * w)
            across = n * F[:, None] * (np.eye(2) - np.outer(d, d)) / np.linalg.norm(F * w)
        # lambda_t = lambda_n F d with the direction d of F w
        J += across @ (F[:, None] * matrix[t])
        J[:, i] -= F * d
        return t, J, n * dF * d + across @ (F * g1[t] + dF * w)


def _unit(vector: Floats) -> Floats:
    size = float(np.linalg.norm(vector))
    return vector / size if size > 0 else vector


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
        from enumsol.condensation.exact import ExactSystem  # python-flint, not for fast arithmetic
        from enumsol.selections.rational_selections import ExactSelections

        solver = ExactSelections(ExactSystem.from_problem(self.problem, self.alpha))
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
    """First status that holds at every node, and all of them; ``slip_sign`` gives the sign of u_t without friction."""
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
