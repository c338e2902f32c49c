"""Numbers with which the form of theory, (6.9), is definite, as far as floats tell; nothing here is trusted."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

#: Smallest eigenvalue below which a form counts as not definite.
_DEFINITE = 1e-10
#: Smallest eigenvalue at which Newton's method need not go on.
_CLEARLY = 1e-3
#: Steps with omega = 1, and of Newton's method where that is not enough.
_WEIGHT_STEPS, _STEPS = 6, 40
#: What the weight of the objective is multiplied by, once so little is left of the Newton decrement, or a step raises t
#: by less than this share of it.
_GROWTH, _CENTRED, _STALLED = 10.0, 1.0, 0.03
#: More components of x are not tried: a step costs as much as many nodes of the tree.
_LARGEST = 300
#: Least share of a Newton step, what is tried after a share that leaves the domain, and how much of one that does not
#: is taken.
_LEAST_STEP, _SHORTER, _INSIDE = 1e-6, 0.7, 0.9


def weights_of(
    R: Array,
    F: Array,
    normal: NDArray[np.intp],
    tangential: NDArray[np.intp],
    tied: NDArray[np.intp],
    *,
    factors: bool = True,
) -> Array | None:
    """tau and omega for which Q of theory, (6.9), is definite; None where none were found.

    Parameters
    ----------
    R : (k, k) array
    F : (b,) array, friction coefficients of the nodes that Q counts
    normal, tangential : (b,) arrays, places of their lambda_n and lambda_t in x
    tied : (k,) array of int
        Number of the omega of every component; those with the same number have the same.
    factors : whether omega are sought where 1 will not do

    Returns
    -------
    (b + k,) array, or (b,) array if all omega may be 1
    """
    try:
        tau = tau_of(R, F, normal, tangential)
        return _Barrier(R, F, normal, tangential, tied).numbers() if tau is None and factors else tau
    except np.linalg.LinAlgError:
        return None


def tau_of(R: Array, F: Array, normal: NDArray[np.intp], tangential: NDArray[np.intp]) -> Array | None:
    """The same with omega = 1: tau, or None."""
    symmetric, T = 0.5 * (R + R.T), R[tangential]
    tau = F * np.sqrt(np.sum(T * T, axis=1))
    for _ in range(_WEIGHT_STEPS):
        form = symmetric - 0.5 * (T * (F**2 / tau)[:, None]).T @ T
        form[normal, normal] -= 0.5 * tau
        values, vectors = np.linalg.eigh(form)
        if values[0] > _DEFINITE:
            return np.asarray(tau)
        if not len(tau):
            break
        v = vectors[:, 0]
        # where the smallest eigenvalue is largest, both terms of a node are the same there
        better = F * np.abs(T @ v) / np.maximum(np.abs(v[normal]), 1e-12)
        tau = np.sqrt(tau * np.clip(better, tau / 16, tau * 16))
    return None


class _Barrier:
    """The largest t for which M - t I is positive semidefinite, by a path of analytic centres.

    M = [[H - D, G'], [G, diag(tau)]] with H the symmetric part of omega R, D = diag(tau) / 2 at the lambda_n of the
    counted nodes, G the rows F omega r_t / sqrt(2): (6.9) is its Schur complement, and M is linear in (omega, tau).
    The sum of all omega is fixed.
    """

    def __init__(
        self, R: Array, F: Array, normal: NDArray[np.intp], tangential: NDArray[np.intp], tied: NDArray[np.intp]
    ) -> None:
        self._k, self._b, self._m = len(R), len(F), int(np.max(tied)) + 1
        k, b = self._k, self._b
        self._normal, self._lower = normal, k + np.arange(b)
        self._tied = tied
        # omega of component i comes with the symmetric part of U_i V_i'
        self._U, self._V = np.zeros((k + b, k)), np.zeros((k + b, k))
        self._U[:k], self._V[:k] = np.eye(k), R.T
        self._U[self._lower, tangential] = np.sqrt(2.0) * F
        self._size = float(np.mean(np.abs(np.diag(R))))

    def _matrix(self, z: Array) -> Array:
        m = self._m
        M = (self._U * z[:m][self._tied]) @ self._V.T
        M = 0.5 * (M + M.T)
        M[self._normal, self._normal] -= 0.5 * z[m:-1]
        M[self._lower, self._lower] += z[m:-1]
        M[np.diag_indices_from(M)] -= z[-1]
        return np.asarray(M)

    def numbers(self) -> Array | None:
        """tau and omega, or None."""
        m, parts = self._m, self._k + self._m + 2 * self._b
        if self._k > _LARGEST or not np.all(np.diag(self._V[: self._k]) > 0):
            return None
        z = np.concatenate([np.ones(m), np.full(self._b, self._size), [0.0]])
        z[-1] = np.linalg.eigvalsh(self._matrix(z))[0] - 0.5 * self._size
        weight = parts / self._size
        for _ in range(_STEPS):
            before = z[-1]
            z, decrement = self._moved(z, weight)
            centred = decrement < _CENTRED
            least = z[-1] + np.linalg.eigvalsh(self._matrix(z))[0]
            # farther from the border where it is not far yet: enclosures are wide near it
            if least > (_DEFINITE if centred else _CLEARLY):
                return np.concatenate([z[m:-1], z[:m][self._tied]])
            if centred or z[-1] - before < _STALLED * abs(before):
                # near a centre no t is larger by more than this
                if z[-1] + 2.0 * parts / weight < 0:
                    return None
                weight *= _GROWTH
        return None

    def _moved(self, z: Array, weight: float) -> tuple[Array, float]:
        """A Newton step for -weight t - log det(M - t I) - sum log omega - sum log tau, and its decrement."""
        gradient, hessian = self._derivatives(z, weight)
        step = -np.linalg.solve(hessian, gradient)[:-1]
        decrement, share = float(np.sqrt(max(-float(gradient[:-1] @ step), 0.0))), 1.0
        while share > _LEAST_STEP:
            ahead = z + share * step
            if np.min(ahead[:-1]) > 0 and _is_definite(self._matrix(ahead)):
                # a step to the border is not made to its end
                return (ahead if share == 1.0 else z + _INSIDE * share * step), decrement
            share *= _SHORTER
        return z, decrement

    def _derivatives(self, z: Array, weight: float) -> tuple[Array, Array]:
        """Gradient and second derivatives, with a row for the sum of omega."""
        m, n, t = self._m, self._normal, self._lower
        P = np.linalg.inv(self._matrix(z))
        PU, PV = P @ self._U, P @ self._V
        UU, VV, UV = self._U.T @ PU, self._V.T @ PV, self._U.T @ PV
        nn, tt, nt, square = P[np.ix_(n, n)], P[np.ix_(t, t)], P[np.ix_(n, t)], np.sum(P * P, axis=1)
        gather = np.equal.outer(np.arange(m), self._tied).astype(float)
        hessian = np.zeros((len(z) + 1, len(z) + 1))
        tau = slice(m, -2)
        hessian[:m, :m] = gather @ (0.5 * (UU * VV + UV * UV.T)) @ gather.T
        hessian[:m, tau] = gather @ (PU[t] * PV[t] - 0.5 * PU[n] * PV[n]).T
        hessian[tau, tau] = 0.25 * nn**2 - 0.5 * nt**2 - 0.5 * nt.T**2 + tt**2
        hessian[:m, -2] = -gather @ np.sum(PU * PV, axis=0)
        hessian[tau, -2] = 0.5 * square[n] - square[t]
        hessian[-2, -2] = np.sum(square)
        hessian[:m, -1] = np.sum(gather, axis=1)
        hessian = np.triu(hessian) + np.triu(hessian, 1).T
        hessian[np.arange(len(z) - 1), np.arange(len(z) - 1)] += 1.0 / z[:-1] ** 2
        gradient = np.concatenate([-gather @ np.diag(UV), 0.5 * np.diag(nn) - np.diag(tt), [np.trace(P) - weight, 0.0]])
        gradient[:-2] -= 1.0 / z[:-1]
        return gradient, hessian


def _is_definite(matrix: Array) -> bool:
    try:
        np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        return False
    return True
