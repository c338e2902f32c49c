"""Tresca problems by a semismooth Newton method (theory, (11.3)), or by Clarabel (theory, section 11.2)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp
from scipy.linalg import LinAlgError, cho_factor, cho_solve, eigh
from scipy.optimize import linprog

from enumsol.errors import EnumsolError, MissingDependencyError
from enumsol.fixed_points.system import ContactSystem, checked_problem, driven
from enumsol.support.array_types import Floats, Mask
from enumsol.support.conic import conic_answer

if TYPE_CHECKING:
    from enumsol.fixed_points.system import Problem

#: The residual below which a point counts as the solution [unit of the scaled system, in which solutions have size 1],
#: and the one below which the method stops.
ACCEPTED, ROUNDING = 1e-11, 1e-15
#: Where normals and sticking forces resist a rigid displacement less, relative to all forces, they do not at all.
_FREE = 1e-10
#: Forces, displacements, slip bounds and what is left of these [as above] that count as zero where it is asked how a
#: body may move on: above what is left of forces at an accepted point (``ACCEPTED``).
_TIGHT = 1e-8


class TrescaNotSolved(EnumsolError, ArithmeticError):  # noqa: N818 (reads as what happened)
    """No solver came close to the solution of a Tresca problem; the message says how close."""


class TrescaNotFeasible(TrescaNotSolved):
    """No forces within the slip bounds hold a body that nothing else holds: the Tresca problem has no solution.

    Attributes
    ----------
    motion : (r,) array
        Coordinates of a rigid displacement, with 1 as its largest component, along which the load drives the body.
    """

    def __init__(self, data: TrescaData, motion: Floats) -> None:
        system = data.system
        self.motion = system.unit_motion(motion)
        words = driven(system.problem, system.alpha, data.bound * system.force, data.F, self.motion)
        super().__init__(f"no forces within the slip bounds hold the body: {words}")


@dataclass(frozen=True)
class TrescaData:
    """A Tresca problem in the variables y = (lambda_n, tau), lambda_t = F tau.

    Attributes
    ----------
    system : ContactSystem
    bound : (p,) array
        Scaled slip bounds s >= 0.
    F : (p, d) array
        Friction coefficients; where F s is 0 or negligible, tau does not occur (theory, section 11.1).
    """

    system: ContactSystem
    bound: Floats
    F: Floats

    @property
    def occurs(self) -> Mask:
        """Which tau occur, shape (p, d)."""
        with np.errstate(over="ignore"):
            # far below rounding, far above underflow
            return np.asarray(self.F * self.bound[:, None] > 1e-100)

    def steps(self) -> tuple[Floats, Floats]:
        """Factors r of (11.3), by node: for normals and for tangents, each (p,)."""
        normal, tangential = self.system.split(np.diagonal(self.system.S))
        largest = np.max(self.F**2 * tangential, axis=1)
        return 1.0 / normal, 1.0 / np.where(largest > 0, largest, 1.0)

    def residual(self, x: Floats) -> float:
        """The largest entry of (11.3) and of the equilibrium of the body as a whole, in forces."""
        return self._residual(x, self.system.moves(x))

    def _residual(self, x: Floats, w: Floats) -> float:
        normal, tangential = self.system.split(x)
        w_n, v, tau = self._in_tau(x, w)
        r_n, r_t = self.steps()
        moved = tau + r_t[:, None] * v
        size = np.linalg.norm(moved, axis=1)
        projected = moved * (self.bound / np.maximum(size, self.bound, where=size > 0, out=np.ones_like(size)))[:, None]
        gap_n = normal - np.maximum(normal + r_n * w_n, 0.0)
        gap_t = np.where(self.occurs, self.F * (tau - projected), tangential)
        rest = np.max(np.abs(self.system.imbalance(x)), initial=0.0)
        return float(max(np.max(np.abs(gap_n)), np.max(np.abs(gap_t)), rest))

    def newton(self, start: Floats) -> tuple[Floats, float]:
        """The best point of a Newton method from x, and its residual, which the caller judges."""
        system = self.system
        normal, tangential = system.split(start)
        x = system.joined(normal, np.where(self.occurs, tangential, 0.0), start[system.m :])
        w = system.moves(x)
        best, least, stalled = x, self._residual(x, w), 0
        # from a near start it needs two to five
        for _ in range(30):
            if least <= ROUNDING or (least <= ACCEPTED and stalled):
                break
            try:
                x = x + self._step(x, w)
            except LinAlgError:
                break
            w = system.moves(x)
            residual = self._residual(x, w)
            if not np.isfinite(residual):
                break
            stalled = stalled + 1 if residual >= 0.5 * least else 0
            if residual < least:
                best, least = x, residual
        return best, least

    def proximal(self, start: Floats) -> tuple[Floats, float]:
        """The best point of a proximal point method from x, and its residual: slower than Newton's alone.

        The solutions for (S + rho, g + rho lambda), and with springs of the compliance rho that carry no force at q,
        converge to that of the problem from everywhere, and Newton's method finds them where it does not find the
        solution itself: rho grows until it does, and shrinks after that.
        """
        system, m = self.system, self.system.m
        best, least = start, self.residual(start)
        x, rho = best, 1e-3  # the diagonal of S is near 1
        for _ in range(60):
            if least <= ACCEPTED:
                break
            S, g, h = system.S + rho * np.eye(m), system.g + rho * x[:m], system.h + rho * x[m:]
            near = replace(self, system=replace(system, S=S, g=g, h=h, compliance=rho))
            found, inner = near.newton(x)
            if inner > ACCEPTED:
                rho *= 8.0
                continue
            x, rho = found, max(0.125 * rho, 1e-14)
            residual = self.residual(x)
            if residual < least:
                best, least = x, residual
        return best, least

    def free_motion(self, x: Floats) -> Floats | None:
        """A scaled rigid displacement by which a solution x may move a little and remain one; None if there is none.

        Normals with a force and nodes that stick do not move, and no slip turns. Of the others, nodes that touch must
        not penetrate, and those that begin to slip must do so along their friction force: one linear program for each
        direction that is left, and its opposite.
        """
        system, modes = self.system, self.system.modes
        if not modes:
            return None
        p, d = system.p, system.tangents
        normal, _ = system.split(x)
        w_n, v, tau = self._in_tau(x, system.moves(x))
        along_n = system.G[:, :p].T
        # bounds come from computed normal forces, of which those that count as zero resist no slip
        rubs = self.F * self.bound[:, None] > _TIGHT
        along_t = np.where(rubs, self.F, 0.0)[:, :, None] * system.G[:, p:].reshape(modes, d, p).T
        size = np.linalg.norm(tau, axis=1)
        slides = np.any(rubs, axis=1) & (size >= (1.0 - _TIGHT) * self.bound)
        way = np.divide(tau, size[:, None], out=np.zeros_like(tau), where=slides[:, None])
        forward = np.einsum("pd,pdr->pr", way, along_t)
        turning = (along_t - way[:, :, None] * forward[:, None, :]).reshape(-1, modes)
        held = np.concatenate([along_n[normal > _TIGHT], turning])
        _, values, rows = np.linalg.svd(np.concatenate([held, np.zeros((modes, modes))]))
        free = rows[values <= _TIGHT]
        touching = (normal <= _TIGHT) & (np.abs(w_n) <= _TIGHT)
        begins = slides & (np.linalg.norm(v, axis=1) <= _TIGHT)
        limits = np.concatenate([along_n[touching], -forward[begins]]) @ free.T
        for aim in np.concatenate([np.eye(len(free)), -np.eye(len(free))]):
            found = linprog(-aim, A_ub=limits, b_ub=np.zeros(len(limits)), bounds=(-1.0, 1.0))
            if found.success and aim @ found.x > _TIGHT:
                return np.asarray(free.T @ found.x)
        return None

    def unresisted(self, motion: Floats) -> Floats | None:
        """A scaled rigid displacement along which no forces within the bounds withstand the load, near a given one.

        It proves, within rounding, that there are none in balance but beyond `largest_forces` (theory, section 14.10).
        What moves normals, or nodes of large bounds, hardly at all is left out if that makes no difference. None: no
        such displacement is found.
        """
        system = self.system
        most = np.minimum(self.bound, system.largest_forces[: system.p])
        spans = np.concatenate([np.ones((system.p, 1)), self.F * most[:, None]], axis=1).T.ravel() * system.G
        size = np.linalg.norm(spans, axis=0)
        large = np.concatenate([np.ones(system.p, dtype=bool), np.tile(most >= 1e3, system.tangents)]) & (size > 0)
        spans = spans[:, large] / size[large]
        z = motion / (np.linalg.norm(motion) or 1.0)
        # how close to a plane directions may be that are meant to be in it
        for nearly in (0.1, 1e-3, 0.0):
            tight = spans[:, np.abs(spans.T @ z) <= nearly]
            candidate = z - tight @ (np.linalg.pinv(tight) @ z)
            along_n, along_t = system.split(system.G.T @ candidate)
            work, against = float(system.h @ candidate), float(most @ np.linalg.norm(self.F * along_t, axis=1))
            lifted = float(np.sum(np.maximum(along_n, 0.0))) * float(system.largest_forces[0])
            if work - against > max(lifted, 1e-10 * system.load_energy):
                return np.asarray(candidate)
        return None

    def _in_tau(self, x: Floats, w: Floats) -> tuple[Floats, Floats, Floats]:
        """w_n, v = F w_t and tau at a point; zero where tau does not occur."""
        (_, lambda_t), (w_n, w_t) = self.system.split(x), self.system.split(w)
        tau = np.divide(lambda_t, self.F, out=np.zeros_like(lambda_t), where=self.occurs)
        return w_n, np.where(self.occurs, self.F * w_t, 0.0), tau

    def _step(self, x: Floats, w: Floats) -> Floats:
        """Newton step of (11.3).

        Some directions of lambda move by known steps: normals that open, and sliding pairs along z = tau + r v. In the
        others, the columns of Q, the equation is Q' S dlambda + shift = Q' w weight, symmetric positive definite: for
        normals in contact and for sticking tau w vanishes after the step; across z the derivative of the projection
        is delta = s / |z|, which gives the shift (1 - delta) / r and the weight 1 / delta for columns times delta^1/2.
        A rigid displacement adds -Q' G' dq, by which G dlambda restores the equilibrium of the body as a whole; where
        no column resists it, it stays as it is.
        """
        system, m = self.system, self.system.m
        known, Q, shift, weight = self._directions(x, w)
        step = np.append(known, np.zeros(system.modes))
        solve = self._solver(Q, shift)
        step[:m] += Q @ solve(weight * (Q.T @ w) - Q.T @ (system.S @ known))
        if system.modes:
            resisted = (system.G @ Q).T
            values, vectors = eigh(resisted.T @ solve(resisted))
            values, rest = values + system.compliance, system.imbalance(x) - system.G @ step[:m]
            kept = vectors[:, values > _FREE]
            step[m:] = kept @ (kept.T @ rest / values[values > _FREE])
            step[:m] += Q @ solve(resisted @ step[m:])
        return step

    def _solver(self, Q: sp.csc_array, shift: Floats) -> Callable[[Floats], Floats]:
        """Solves with Q' S Q + shift."""
        matrix = Q.T @ self.system.S @ Q
        if len(matrix) == 0:
            return lambda right: right
        matrix[np.diag_indices_from(matrix)] += shift
        factor = cho_factor(matrix, lower=True, overwrite_a=True, check_finite=False)
        return lambda right: np.asarray(cho_solve(factor, right, check_finite=False))

    def _directions(self, x: Floats, w: Floats) -> tuple[Floats, sp.csc_array, Floats, Floats]:
        """Known part of dlambda in a Newton step, Q, and the shift and the weight of its equations."""
        p, d = self.system.p, self.system.tangents
        normal, _ = self.system.split(x)
        w_n, v, tau = self._in_tau(x, w)
        r_n, r_t = self.steps()
        moved = tau + r_t[:, None] * v
        size = np.linalg.norm(moved, axis=1)
        sliding = (size > self.bound) & np.any(self.occurs, axis=1)
        along = np.divide(moved, size[:, None], out=np.zeros_like(moved), where=sliding[:, None])
        active = normal + r_n * w_n > 0

        known = np.zeros((1 + d, p))
        known[0] = np.where(active, 0.0, -normal)
        known[1:] = (self.F * along * (np.where(sliding, self.bound, 0.0) - np.sum(along * tau, axis=1))[:, None]).T

        node_n = np.flatnonzero(active)
        node_s, axis_s = np.nonzero(self.occurs & ~sliding[:, None])
        node_a = np.flatnonzero(sliding & np.all(self.occurs, axis=1) & (d == 2))
        delta = self.bound[node_a] / size[node_a]
        root = np.sqrt(delta)
        across = root[:, None] * self.F[node_a] * np.stack([-along[node_a, -1], along[node_a, 0]], axis=1)
        counts = np.cumsum([0, len(node_n), len(node_s), len(node_a)])
        columns = [np.arange(counts[k], counts[k + 1]) for k in range(3)]
        Q = sp.csc_array(
            (
                np.concatenate([np.ones(len(node_n)), self.F[node_s, axis_s], across[:, 0], across[:, 1]]),
                (
                    np.concatenate([node_n, (1 + axis_s) * p + node_s, p + node_a, 2 * p + node_a]),
                    np.concatenate([columns[0], columns[1], columns[2], columns[2]]),
                ),
            ),
            shape=((1 + d) * p, counts[-1]),
        )
        ones = np.ones(counts[2])
        shift = np.concatenate([0.0 * ones, (1.0 - delta) / r_t[node_a]])
        return known.ravel(), Q, shift, np.concatenate([ones, 1.0 / delta])


def interior_point(data: TrescaData) -> tuple[Floats | None, Floats]:
    """The x that solves a Tresca problem to about 1e-9, from scratch, None if Clarabel fails; and a rigid displacement.

    If no forces balance the load on a body that nothing holds, they do not along the latter, scaled and of shape (r,).
    Components of lambda_t that do not occur are left out, so that every cone has an interior.
    """
    import clarabel  # takes a while to import

    system, occurs = data.system, data.occurs
    p = system.p
    bound = np.minimum(data.bound, _reach(data))
    node_one = np.flatnonzero(np.sum(occurs, axis=1) == 1)
    node_two = np.flatnonzero(np.sum(occurs, axis=1) == 2)
    free = np.concatenate([np.ones(p, dtype=bool), occurs.T.ravel()])
    column = np.cumsum(free) - 1
    axis = np.argmax(occurs[node_one], axis=1)
    F = data.F[node_one, axis]
    # 0 <= lambda_n;  |lambda_t| <= s F for one axis;  (s, lambda_t / F), scaled, in the second-order cone for two
    least = np.min(data.F[node_two], axis=1)
    parts = [(np.arange(p), np.arange(p), -np.ones(p))]
    first = p
    interval = column[(1 + axis) * p + node_one]
    for sign in (1.0, -1.0):
        parts.append((first + np.arange(len(node_one)), interval, np.full(len(node_one), sign)))
        first += len(node_one)
    for k in range(2 if len(node_two) else 0):
        rows = first + 3 * np.arange(len(node_two)) + 1 + k
        parts.append((rows, column[(1 + k) * p + node_two], -least / data.F[node_two, k]))
    size = first + 3 * len(node_two)
    offset = np.zeros(size)
    offset[p:first] = np.tile(bound[node_one] * F, 2)
    offset[first::3] = bound[node_two] * least
    rows, columns, values = (np.concatenate(part) for part in zip(*parts, strict=True))
    limits = sp.csc_matrix((values, (rows, columns)), shape=(size, int(np.sum(free))))
    tolerances = ("tol_gap_abs", "tol_gap_rel", "tol_feas", "tol_infeas_abs", "tol_infeas_rel")
    answer = conic_answer(
        (sp.csc_matrix(np.triu(system.S[np.ix_(free, free)])), -system.g[free]),
        (sp.csc_matrix(sp.vstack([system.G[:, free], limits])), np.append(system.h, offset)),
        [
            clarabel.ZeroConeT(system.modes),
            clarabel.NonnegativeConeT(first),
            *[clarabel.SecondOrderConeT(3)] * len(node_two),
        ],
        system.S.size,
        direct_solve_method="faer",  # the Hessian is dense, for which the default is several times slower
        **dict.fromkeys(tolerances, 1e-11),
    )
    found, rigid = np.array(answer.x), -np.array(answer.z)[: system.modes]
    if not (np.all(np.isfinite(found)) and np.all(np.isfinite(rigid))):
        return None, np.zeros(system.modes)
    forces = np.zeros(system.m)
    forces[free] = found
    return np.append(forces, rigid), rigid


def _reach(data: TrescaData) -> Floats:
    """Sizes that |tau| cannot exceed, by `largest_forces`, shape (p,): larger bounds are none.

    With them the solver meets no numbers that are large for no reason.
    """
    most = data.system.split(data.system.largest_forces)[1]
    with np.errstate(over="ignore"):
        tau = np.divide(most, data.F, out=np.zeros_like(most), where=data.occurs)
        return np.asarray(2.0 * np.sum(tau, axis=1))


class TrescaReference:
    """Minimise u' A u / 2 - f' u + sum_i s_i ``|F_i u_t,i|`` subject to Bn u <= gap.

    Slip bounds, coefficients and load are parameters, so that CVXPY canonicalizes the problem only once
    for many solutions. The multipliers of the constraints are the contact forces.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D

    Attributes
    ----------
    program : cvxpy.Problem

    Raises
    ------
    MissingDependencyError
        CVXPY is not installed.
    """

    def __init__(self, problem: Problem) -> None:
        problem = checked_problem(problem)
        try:
            import cvxpy
        except ImportError as error:
            raise MissingDependencyError(
                "solver is 'cvxpy', but CVXPY is not installed; install it with: pip install 'enumsol[cvxpy]'"
            ) from error

        cp: Any = cvxpy  # its names are gathered at run time, and a type checker does not see them
        offsets = problem.slip_offset.reshape(problem.p, -1)
        d = offsets.shape[1]
        tangents = [problem.contact_rows[(1 + k) * problem.p : (2 + k) * problem.p] for k in range(d)]
        self._u = cp.Variable(problem.n)
        slips = cp.Variable((problem.p, d))
        self._work = cp.Parameter((problem.p, d), nonneg=True)
        self._load = cp.Parameter(problem.n)
        self._normal = problem.Bn @ self._u <= problem.gap
        self._tangential = [tangents[k] @ self._u - offsets[:, k] == slips[:, k] for k in range(d)]
        friction = cp.sum(cp.norm(cp.multiply(self._work, slips), axis=1))
        energy = 0.5 * cp.quad_form(self._u, cp.psd_wrap(sp.csc_matrix(problem.A)))
        self.program: Any = cp.Problem(
            cp.Minimize(energy - self._load @ self._u + friction), [self._normal, *self._tangential]
        )

    def solve(self, bound: Floats, F: Floats, load: Floats) -> tuple[Floats, Floats, Floats]:
        """Contact forces and displacement for slip bounds and coefficients of friction.

        Parameters
        ----------
        bound : (p,) array
            Slip bounds s >= 0 [force].
        F : (p, d) array
            Friction coefficients in the d = 1 or 2 tangents [-].
        load : (n,) array
            f [force].

        Returns
        -------
        lambda_n : (p,) array [force]
        lambda_t : (p, d) array [force]
        u : (n,) array [length]

        Raises
        ------
        TrescaNotSolved
            There is no solution: no forces within the bounds hold a body that nothing else holds.
        """
        self._work.value, self._load.value = bound[:, None] * F, load
        settings: dict[str, Any] = {"tol_gap_abs": 1e-11, "tol_gap_rel": 1e-11, "tol_feas": 1e-11}
        self.program.solve(solver="CLARABEL", **settings)
        if self._u.value is None:
            raise TrescaNotSolved(f"CVXPY found no solution of the Tresca problem (status: {self.program.status})")
        tangential = np.stack([constraint.dual_value for constraint in self._tangential], axis=1)
        return np.asarray(self._normal.dual_value), tangential, np.asarray(self._u.value)
