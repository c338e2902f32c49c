"""Forms with products of rows of neighbouring nodes, and an interior-point method that finds the best one. Floats only.

Rows r_a, r_b >= 0 of a partial assignment have r_a r_b >= 0 at every solution in it. With multipliers u >= 0 of such
products, of any sign where a product vanishes at every solution, q = - sum of u r_a r_b = x'M x, x = (lambda, 1), is at
most zero at every solution. The best form makes t as large as it can be with M - t e e' >= 0 on the equations of the
assignment, e'x = 1, where the mean curvature of q relative to S is one. If t > 0 there is no solution.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve, eigvalsh, solve_triangular

from enumsol.arithmetic.balls import factor_above
from enumsol.model.statuses import RowKind
from enumsol.relaxation.engine import EQUALITY, row_normals

#: Kinds of rows that are imposed as inequalities; the cones stand for lambda_n >= 0 where both are.
KINDS = (
    RowKind.NORMAL_FORCE,
    RowKind.CONE_PLUS,
    RowKind.CONE_MINUS,
    RowKind.PENETRATION,
    RowKind.SLIP_FORWARD,
    RowKind.SLIP_BACKWARD,
)
#: What products of rows of one node are: zero at every solution, or not negative by the law of friction.
ZERO, FRICTION, IMPOSED = range(3)
COMPLEMENTARY = (
    (RowKind.CONE_PLUS, RowKind.PENETRATION, ZERO),
    (RowKind.CONE_MINUS, RowKind.PENETRATION, ZERO),
    (RowKind.CONE_PLUS, RowKind.SLIP_BACKWARD, FRICTION),
    (RowKind.CONE_MINUS, RowKind.SLIP_FORWARD, FRICTION),
)
#: The least multipliers that a program begins with; the relative gap and the part of the first residual at which it
#: ends; most steps.
FRESH, GAP, RESIDUAL, STEPS = 1e-3, 0.3, 1e-5, 40


@dataclass
class Form:
    """The end of a program: whether it excludes, its multipliers, t and the number of its steps."""

    excluded: bool
    u: np.ndarray
    t: float
    steps: int


class NeighbourForms:
    """Programs for the forms of one system.

    Parameters
    ----------
    system : ScaledSystem
    reach : int
        Rows of nodes at most so far apart are multiplied; 0: of one node only.
    """

    def __init__(self, system, reach):
        p, self.F = len(system.F), system.F
        self.programs, self.steps, self.seconds, self.multipliers = 0, 0, 0.0, 0
        offset = np.concatenate([np.zeros(4 * p), -system.g[:p], system.g[p:], -system.g[p:]])
        self.L = np.linalg.cholesky(system.S)
        normals = row_normals(p, system.F, system.S, np.arange(7 * p))
        turned = solve_triangular(self.L, normals.T, lower=True).T
        length = np.linalg.norm(turned, axis=1)
        #: Rows in L'lambda and 1, of length one; the last is 1.
        self.rows = np.vstack([np.column_stack([turned, offset]) / length[:, None], np.eye(2 * p + 1)[-1:]])
        #: Two rows of every product, and what it is; the last is that of 1 with itself, whose multiplier is t.
        self.a, self.b, self.kind = np.array(list(_products(p, reach))).T
        length = np.append(length, 1.0)
        zero = -0.5 / np.append(system.F, 1.0)[np.where(self.kind == ZERO, self.a % p, p)]
        start = np.select([self.kind == ZERO, self.kind == FRICTION], [zero, 0.5], 0.0)
        start[-1] = 0.0
        #: The multipliers with which the form is the energy.
        self.energy = start * length[self.a] * length[self.b]

    def solve(self, modes, u):
        """The best form below rows with modes (a dict), from the multipliers u."""
        begin = time.process_time()
        program, live = self.program(modes)
        first = program.inside(u[live]) if program.size > 1 else None
        found = Form(False, u, -1.0, 0)
        if first is not None:
            excluded, values, steps = program.maximise(first)
            found = Form(excluded, np.zeros(len(u)), float(values[-1]), steps)
            found.u[live[:-1]] = values[:-1]
        self.programs, self.steps = self.programs + 1, self.steps + found.steps
        self.seconds, self.multipliers = self.seconds + time.process_time() - begin, self.multipliers + len(live)
        return found

    def program(self, modes):
        """The program below rows with modes, and the numbers of its products."""
        size = self.rows.shape[1] - 1
        equal = [row for row, mode in modes.items() if mode == EQUALITY]
        C = self.rows[equal]
        Q, R = np.linalg.qr(C[:, :size].T, mode="complete")
        k = len(equal)
        point = Q[:, :k] @ np.linalg.lstsq(R[:k].T, -C[:, size], rcond=None)[0]
        basis = np.column_stack([np.vstack([Q[:, k:], np.zeros(size - k)]), np.append(point, 1.0)])
        rows = self.rows @ basis
        moves = np.linalg.norm(rows[:, :-1], axis=1) > 1e-9
        imposed = np.zeros(len(rows), dtype=bool)
        imposed[[row for row, mode in modes.items() if mode != EQUALITY]] = True
        moves[-1] = imposed[-1] = True
        holds = (self.kind != IMPOSED) | (imposed[self.a] & imposed[self.b])
        live = np.flatnonzero(moves[self.a] & moves[self.b] & holds)
        used, place = np.unique(np.concatenate([self.a[live], self.b[live]]), return_inverse=True)
        return Program(rows[used], place[: len(live)], place[len(live) :], self.kind[live] != ZERO), live

    def in_lambda(self, form, modes):
        """H, h and k of a form in lambda, made definite by squares of the equations; None where it is not."""
        count = len(self.rows)
        G = np.bincount(self.a * count + self.b, -0.5 * form.u, count * count).reshape(count, count)
        M = self.rows.T @ ((G + G.T) @ self.rows)
        C = self.rows[[row for row, mode in modes.items() if mode == EQUALITY]]
        for weight in 10.0 ** np.arange(7):
            K = M + weight * (C.T @ C)
            if factor_above(K[:-1, :-1], 1e-6) is not None:
                H = self.L @ K[:-1, :-1] @ self.L.T
                return 0.5 * (H + H.T), -2.0 * self.L @ K[:-1, -1], float(K[-1, -1])
        return None


def _products(p, reach):
    for i in range(p):
        for s, t, kind in COMPLEMENTARY:
            yield s * p + i, t * p + i, kind
        yield RowKind.CONE_PLUS * p + i, RowKind.CONE_MINUS * p + i, IMPOSED
        for slip in (RowKind.SLIP_FORWARD, RowKind.SLIP_BACKWARD):
            yield RowKind.NORMAL_FORCE * p + i, slip * p + i, IMPOSED
        for j in range(i + 1, min(p, i + reach + 1)):
            for s in KINDS:
                for t in KINDS:
                    yield s * p + i, t * p + j, IMPOSED
        for s in KINDS:
            yield s * p + i, 7 * p, IMPOSED
    yield 7 * p, 7 * p, ZERO


class Program:
    """A primal-dual interior-point method: predictor and corrector in the direction of Helmberg, Kojima and Monteiro.

    Parameters
    ----------
    A : (k, n + 1) array
        Rows in coordinates of the assignment's equations and 1.
    ka, kb : (m,) arrays
        The two rows of every product.
    signed : (m,) array
        Whether its multiplier is at least zero.
    """

    def __init__(self, A, ka, kb, signed):
        self.A, self.ka, self.kb, self.signed, self.size = A, ka, kb, signed, A.shape[1]
        self.traces = -np.einsum("ij,ij->i", A[ka, :-1], A[kb, :-1])
        self.cost = np.eye(len(ka))[-1]
        self._flat = ka * len(A) + kb

    def matrix(self, u):
        """M - t e e'."""
        k = len(self.A)
        G = np.bincount(self._flat, -0.5 * u, k * k).reshape(k, k)
        return self.A.T @ ((G + G.T) @ self.A)

    def inside(self, start):
        """Multipliers near given ones with which M - t e e' is definite and the mean curvature one; or None."""
        for fresh in FRESH * 0.1 ** np.arange(6):
            u = np.where(self.signed, np.maximum(start, fresh), start)
            total = float(self.traces @ u)
            if total <= 0:
                continue
            u *= (self.size - 1) / total
            u[-1] = 0.0
            M = self.matrix(u)
            L = factor_above(M[:-1, :-1], 0.0)
            if L is not None:
                z = solve_triangular(L, M[:-1, -1], lower=True)
                t = float(M[-1, -1] - z @ z)
                u[-1] = t - 0.5 * abs(t) - 1e-6
                return u
        return None

    def maximise(self, u):
        """Whether t became positive, the multipliers, and the number of steps."""
        signed, residual, X = self.signed, 1.0, None
        for step in range(STEPS):
            if u[-1] > 1e-12 * float(np.sum(np.abs(u))):
                return True, u, step
            Z = self.matrix(u)
            L = factor_above(Z, 0.0)
            if L is None:
                return False, u, step
            inverse = cho_solve((L, True), np.eye(self.size))
            if X is None:
                X, x = inverse / inverse[-1, -1], np.where(signed, 1.0 / inverse[-1, -1] / u, 0.0)
            gap = float(np.sum(X * Z) + x @ u)
            if gap < GAP * abs(u[-1]) and residual < RESIDUAL:
                return False, u, step
            try:
                moved = self._step(X, x, u, Z, L, inverse, gap)
            except LinAlgError:
                return False, u, step
            X, x, u, done = moved
            residual *= 1.0 - done
        return False, u, STEPS

    def _step(self, X, x, u, Z, L, inverse, gap):
        """One step, and which part of the residual it removes."""
        signed, point = self.signed, (X, x, u, inverse, self._factor(X, x, u, inverse))
        mu = gap / (self.size + np.sum(signed))
        du, dX, dx, dZ = self._direction(point, 0.0, 0.0, 0.0)
        a, b = self._lengths(X, dX, x, dx), self._lengths(Z, dZ, u, du)
        after = float(np.sum((X + a * dX) * (Z + b * dZ)) + (x + a * dx) @ (u + b * du))
        target = mu * min(max((after / gap) ** 2, 1e-3), 0.8)
        second = dX @ dZ @ inverse
        du, dX, dx, dZ = self._direction(point, target, 0.5 * (second + second.T), np.where(signed, dx * du / u, 0.0))
        a, b = 0.9 * self._lengths(X, dX, x, dx), 0.9 * self._lengths(Z, dZ, u, du)
        return X + a * dX, x + a * dx, u + b * du, a

    def _factor(self, X, x, u, inverse):
        """The matrix of the normal equations, factorized: products of rank two need entries of two matrices only."""
        ka, kb = self.ka, self.kb
        AX, AZ = self.A @ X @ self.A.T, self.A @ inverse @ self.A.T
        across = AX[np.ix_(ka, kb)] * AZ[np.ix_(kb, ka)]
        normal = AX[np.ix_(ka, ka)] * AZ[np.ix_(kb, kb)] + AX[np.ix_(kb, kb)] * AZ[np.ix_(ka, ka)]
        normal = 0.25 * (normal + across + across.T)
        diagonal = np.diagonal(normal) * (1 + 1e-10) + np.where(self.signed, x / u, 0.0)
        normal[np.diag_indices(len(u))] = diagonal
        return cho_factor(normal, overwrite_a=True, check_finite=False)

    def _direction(self, point, target, second, one):
        X, x, u, inverse, factor = point
        signed = self.signed
        centre = self._inner(inverse) + np.where(signed, 1 / u, 0.0)
        right = self.cost + target * centre - self._inner(second) - one
        du, border = cho_solve(factor, np.column_stack([right, self.traces]), check_finite=False).T
        du = du - (self.traces @ du) / (self.traces @ border) * border
        dZ = self.matrix(du)
        turned = X @ dZ @ inverse
        dX = target * inverse - X - 0.5 * (turned + turned.T) - second
        return du, dX, np.where(signed, target / u - x - x / u * du - one, 0.0), dZ

    def _inner(self, K):
        """Inner products of the derivatives of M with a symmetric matrix."""
        return -np.einsum("ij,ij->i", self.A[self.ka] @ K, self.A[self.kb]) if np.ndim(K) else 0.0

    def _lengths(self, K, change, v, dv):
        """The longest step, at most one, that leaves a matrix definite and numbers positive."""
        L, signed = np.linalg.cholesky(K), self.signed
        turned = solve_triangular(L, solve_triangular(L, change, lower=True).T, lower=True)
        least = min(float(eigvalsh(turned, subset_by_index=(0, 0))[0]), float(np.min(dv[signed] / v[signed])))
        return 1.0 if least >= -1.0 else -1.0 / least


def by_clarabel(program):
    """The largest t, by CVXPY and Clarabel, and seconds of the solver; None where CVXPY is not installed."""
    try:
        import cvxpy as cp
    except ImportError:
        return None
    A, size = program.A, program.size
    products = np.einsum("ki,kj->ijk", A[program.ka], A[program.kb])
    flat = -0.5 * (products + products.transpose(1, 0, 2)).reshape(size * size, -1)
    u = cp.Variable(len(program.ka))
    M = cp.reshape(flat @ u, (size, size), order="C")
    rules = [M >> 0, u[program.signed] >= 0, program.traces @ u == size - 1]
    problem = cp.Problem(cp.Maximize(u[-1]), rules)
    problem.solve(solver=cp.CLARABEL)
    t = np.inf if u.value is None else float(u.value[-1])  # without bound where no point has the rows
    return t, problem.solver_stats.solve_time
