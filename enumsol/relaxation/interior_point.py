"""Slower relaxations, for nodes on which the active-set method gives no answer, or none that balls prove."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
from scipy.linalg import solve_triangular

from enumsol.model.statuses import CONTACT, UNDECIDED
from enumsol.relaxation.engine import EQUALITY, PRUNE_MARGIN, Relaxation, row_terms
from enumsol.support.conic import conic_answer

if TYPE_CHECKING:
    from enumsol.condensation.condensed import ScaledSystem
    from enumsol.support.array_types import Codes, Floats, Indices
    from enumsol.trusted.quadratic_forms import EnclosedForm


class InteriorPointEngine:
    """Clarabel's direct interface, one solve from scratch a node."""

    name = "clarabel"
    solves_children = False
    #: Its multipliers are smaller than those of other engines, and balls may prove more of them.
    softens = False

    def __init__(self, system: ScaledSystem) -> None:
        self.system = system
        p = system.p
        start, index, value = row_terms(p, system.F)
        terms = sp.csr_array((value, index, start), shape=(len(start) - 1, 4 * p)).toarray()
        # a row is n'lambda - b with w = g - S lambda
        self.normals = terms[:, : 2 * p] - terms[:, 2 * p :] @ system.S
        self.offsets = -terms[:, 2 * p :] @ system.g
        norms = np.sqrt(np.sum(self.lower(self.normals.T) ** 2, axis=0))
        self.norms = np.where(norms > 0, norms, 1.0)

    def lower(self, rhs: Floats) -> Floats:
        """L^{-1} rhs with S = L L'."""
        return np.asarray(solve_triangular(self.system.cholesky, rhs, lower=True))

    def dual_bound(self, rows: Indices, values: Floats) -> float:
        """Lower bound on the energy that the multipliers prove (theory, (6.1), in floats)."""
        v = self.system.g + self.normals[rows].T @ values
        return float(values @ self.offsets[rows] - 0.25 * np.sum(self.lower(v) ** 2))

    def root(self, rows: list[int], modes: list[int]) -> Relaxation:
        """The relaxation with the given rows on."""
        return self.solved(dict(zip(rows, modes, strict=True)))

    def bounding(self, form: EnclosedForm) -> None:
        """None: a fallback bounds the energy only."""
        del form

    def solved(self, on: dict[int, int]) -> Relaxation:
        """The relaxation with these rows and their modes, solved from scratch."""
        import clarabel  # a fallback: most searches never need it

        equal = [row for row, mode in on.items() if mode == EQUALITY]
        other = [row for row, mode in on.items() if mode != EQUALITY]
        order = np.array(equal + other, dtype=np.intp)
        scale = 1.0 / self.norms[order]
        answer = conic_answer(
            (sp.csc_matrix(np.triu(2.0 * self.system.S)), -self.system.g),
            (sp.csc_matrix(-self.normals[order] * scale[:, None]), -self.offsets[order] * scale),
            [clarabel.ZeroConeT(len(equal)), clarabel.NonnegativeConeT(len(other))],
            self.system.S.size,
        )
        found = clarabel.SolverStatus
        infeasible = answer.status in (found.PrimalInfeasible, found.AlmostPrimalInfeasible)
        solved = answer.status in (found.Solved, found.AlmostSolved)
        values = np.array(answer.z) * scale
        values[len(equal) :] = np.maximum(values[len(equal) :], 0.0)
        if infeasible:
            values = self._scaled_ray(order, values)
        usable = bool((infeasible or solved) and np.all(np.isfinite(values)))
        bound = self.dual_bound(order, values) if usable else -np.inf
        return _InteriorPointRelaxation(self, on, order, values, bound, np.array(answer.x) if solved else None)

    def _scaled_ray(self, rows: Indices, values: Floats) -> Floats:
        """An infeasibility certificate, stretched so that the bound it proves is as large as it can be."""
        direction = self.normals[rows].T @ values
        rate = float(values @ self.offsets[rows])
        a, g = self.lower(direction), self.lower(self.system.g)
        slope, curvature = rate - 0.5 * float(a @ g), 0.25 * float(a @ a)
        if slope <= 0:
            return values
        # an exact ray has curvature 0: stop where the bound is large enough
        needed = 2.0 * (0.25 * float(g @ g) + PRUNE_MARGIN) / slope
        return values * (min(needed, 0.5 * slope / curvature) if curvature > 0 else needed)


class SoftenedEngine(InteriorPointEngine):
    """Relaxations whose rows may be violated at a price, so that their multipliers z are small (theory, section 6.2).

    They maximise the bound (6.1) less loss |z|^2. Where that fails, the interior-point method gives the answer.

    Parameters
    ----------
    system : ScaledSystem
    loss : float
        How much of a bound is lost to multipliers of length one, times their length squared; positive.
    """

    name = "softened"
    softens = True

    def __init__(self, system: ScaledSystem, loss: float) -> None:
        super().__init__(system)
        self._loss = loss
        self._lower_normals, self._lower_g = self.lower(self.normals.T).T, self.lower(system.g)
        #: Derivatives of (6.1) at z = 0.
        self._slopes = self.offsets - 0.5 * self._lower_normals @ self._lower_g

    def solved(self, on: dict[int, int]) -> Relaxation:
        """The relaxation with these rows and their modes, solved from scratch."""
        from scipy.optimize import nnls  # most searches need it nowhere

        equal = [row for row, mode in on.items() if mode == EQUALITY]
        order, k = np.array(equal + [row for row, mode in on.items() if mode != EQUALITY], dtype=np.intp), len(equal)
        lower = self._lower_normals[order]
        # the bound less the loss is slopes'z - |R z|^2 / 4, up to a constant
        R: Floats = np.linalg.qr(np.vstack([lower.T, 2.0 * np.sqrt(self._loss) * np.eye(len(order))])).R
        try:
            target = 2.0 * solve_triangular(R, self._slopes[order], trans="T")
            other, _ = nnls(R[k:, k:], target[k:], maxiter=10 * len(order))
            first = solve_triangular(R[:k, :k], target[:k] - R[:k, k:] @ other)
        except (np.linalg.LinAlgError, RuntimeError, ValueError):
            return super().solved(on)  # R is singular, or there were too many steps, or numbers overflowed
        values = np.concatenate([first, other])
        forces = 0.5 * solve_triangular(self.system.cholesky, self._lower_g + values @ lower, lower=True, trans="T")
        bound = self.dual_bound(order, values) - self._loss * float(values @ values)
        return _InteriorPointRelaxation(self, on, order, values, bound, forces)


class _InteriorPointRelaxation:
    """A relaxation that was solved, or not (``forces`` None)."""

    form: EnclosedForm | None = None

    def __init__(
        self,
        engine: InteriorPointEngine,
        on: dict[int, int],
        rows: Indices,
        values: Floats,
        bound: float,
        forces: Floats | None,
    ) -> None:
        self._engine, self._on, self._rows, self._values = engine, on, rows, values
        self.bound = bound
        self.pruned = bound > PRUNE_MARGIN
        self.stalled = forces is None and not self.pruned
        self.forces = np.zeros(len(engine.system.g)) if forces is None else forces
        self.displacements = engine.system.g - engine.system.S @ self.forces

    def multipliers(self) -> tuple[Indices, Floats]:
        """Rows and their multipliers, which prove ``bound``."""
        keep = self._values != 0
        return self._rows[keep], self._values[keep]

    def at(self, i: int) -> tuple[float, float]:
        """Number i of the forces and of the displacements."""
        return float(self.forces[i]), float(self.displacements[i])

    def choose(self, codes: Codes) -> int:
        """The undecided node at which complementarity is violated most, -1 when all are decided."""
        F, forces, w, array = self._engine.system.F, self.forces, self.displacements, np.array(codes)
        open_nodes, p = np.flatnonzero((array == CONTACT) | (array == UNDECIDED)), len(F)
        if not len(open_nodes):
            return -1
        slip = F * forces[:p] * np.abs(w[p:]) - forces[p:] * w[p:]
        # an undecided node's slip counts double: deciding it now saves the slack that it leaves in the energy
        score = np.where(array == UNDECIDED, slip - forces[:p] * w[:p], 0.0) + slip
        return int(open_nodes[np.argmax(score[open_nodes])])

    def forced(self, codes: Codes) -> tuple[int, ...]:
        """None: this method bounds a child only by solving it."""
        return ()

    def child(self, rows: list[int], modes: list[int], *, last: bool) -> Relaxation:
        """The relaxation with further rows switched on, solved from scratch."""
        return self._engine.solved(self._on | dict(zip(rows, modes, strict=True)))
