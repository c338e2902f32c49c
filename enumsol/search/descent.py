"""Numbers with which the form of theory, (6.9), is definite, for many nodes; nothing here is trusted."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.balls import factor_above
from enumsol.support.deadlines import look

if TYPE_CHECKING:
    from enumsol.search.definite import Nodes
    from enumsol.support.array_types import Floats


#: Smallest eigenvalue, relative to H and the mean of the numbers, at which descent may end; and that is any use.
_CLEARLY, _JUST = 2e-3, 1e-6
#: Where no descent is tried; where another round is not, nor where a round leaves more than this share of what lacks.
_HOPELESS, _FAR, _SLOW = -4.0, -0.5, 0.9
#: Both where squares count: on blocks worse ones were not mended, or took longer than the tree.
_HOPELESS_SQUARES, _FAR_SQUARES = -1.0, -0.14
#: Rounds, steps of each, and the weight of H in one by what lacked before it.
_ROUNDS, _STEPS, _ABOVE = 10, 15, 1.2
#: The objective where M is not definite.
_BEYOND = 1e10
#: What mu begins with where squares count.
_BEGINNING = 3.0
#: Of the gap that a node has, what may serve for its slip.
_SHARED = 0.5


class Descent:
    """Numbers for which the form is definite, by descent on a path.

    M is Q of (6.9) plus so many times H, the symmetric part of R. -log det M, less what scaling all numbers alike adds,
    is lowered by a quasi-Newton method from mu = kappa = 1 and nu = 0; the multiple of H begins at what makes M
    definite, and falls with what Q lacks relative to H. The variables are the logarithms of mu and kappa, and the
    artanh of nu F / mu. Where theta may be chosen it is the least in size that these allow.

    Parameters
    ----------
    R : (k, k) array, its symmetric part positive definite
    nodes : Nodes, none of them wide
    spare : (2, m) array, optional
        The squares of the first m components of R d count, times mu times the first and nu times the second of these.

    Raises
    ------
    numpy.linalg.LinAlgError
        The symmetric part of R is not positive definite.
    """

    def __init__(self, R: Floats, nodes: Nodes, spare: Floats | None = None) -> None:
        self._R, self._nodes = R, nodes
        self._spare = None if spare is None else (spare[0], spare[1, nodes.normal])
        m, b, chosen = nodes.count, len(nodes.F), ~np.isfinite(nodes.share)
        self._mu, self._kappa, self._nu = slice(0, m), slice(m, m + b), slice(m + b, m + 2 * b)
        self._fixed = nodes.F * np.where(chosen, 0.0, nodes.share)
        self._side = np.where(chosen, np.sign(nodes.slip), 0.0)
        self._give = _SHARED * nodes.gap / np.where(self._side != 0, np.abs(nodes.slip), np.inf)
        self._H = 0.5 * (R + R.T)
        self._L = np.linalg.cholesky(self._H)

    def numbers(self) -> Floats | None:
        """mu, kappa, nu, theta / F and tau as a proof has them, or None."""
        z = np.zeros(self._nu.stop)
        if self._spare is not None:
            z[self._mu] = np.log(_BEGINNING)
        lowest, far = (_HOPELESS, _FAR) if self._spare is None else (_HOPELESS_SQUARES, _FAR_SQUARES)
        least = self._least(z)
        for _ in range(_ROUNDS):
            if least > _CLEARLY or least < lowest:
                break
            z = self._lowered(z, _ABOVE * max(-least, 0.0) + _CLEARLY)
            least, lowest = self._least(z), max(_SLOW * least, far) if least < 0 else 0.0
        return self._as_written(z) if least > _JUST else None

    def _lowered(self, z: Floats, weight: float) -> Floats:
        from scipy.optimize import minimize  # not for problems that need no numbers

        options = {"maxiter": _STEPS, "maxfun": _STEPS, "maxcor": _STEPS}
        found = minimize(self._objective, z, args=(weight,), jac=True, method="L-BFGS-B", options=options)
        return np.asarray(found.x)

    def _split(self, z: Floats) -> tuple[Floats, Floats, Floats, Floats, Floats]:
        """mu, kappa, nu, kappa theta, and the side of theta where it is chosen and not zero."""
        nodes = self._nodes
        mu, kappa = np.exp(z[self._mu]), np.exp(z[self._kappa])
        nu = mu[nodes.normal] / nodes.F * np.tanh(z[self._nu])
        # (mu +- nu F) |w_n| >= kappa (F -+ theta) |w_t|
        size = nodes.F * kappa - self._give * (mu[nodes.normal] + self._side * nodes.F * nu)
        side = np.where(size > 0, self._side, 0.0)
        return mu, kappa, nu, np.where(side != 0, side * size, kappa * self._fixed), side

    def _form(self, mu: Floats, kappa: Floats, nu: Floats, rho: Floats) -> Floats:
        R, n, t = self._R, self._nodes.normal, self._nodes.tangential
        form = np.zeros_like(R)
        form[: len(mu)] = mu[:, None] * R[: len(mu)]
        form[n] -= rho[:, None] * R[t]
        form[t] = nu[:, None] * R[n] + kappa[:, None] * R[t]
        if self._spare is not None:
            strength = mu * self._spare[0]
            strength[n] += nu * self._spare[1]
            form += R[: len(mu)].T @ (strength[:, None] * R[: len(mu)])
        return 0.5 * (form + form.T)

    def _least(self, z: Floats) -> float:
        """The smallest eigenvalue relative to H, and to the mean of mu and kappa."""
        mu, kappa, nu, rho, _ = self._split(z)
        half = np.linalg.solve(self._L, self._form(mu, kappa, nu, rho))
        relative = np.linalg.solve(self._L, half.T)
        return float(np.linalg.eigvalsh(0.5 * (relative + relative.T))[0] / np.mean(np.concatenate([mu, kappa])))

    def _objective(self, z: Floats, weight: float) -> tuple[float, Floats]:
        look()
        R, H, n, t, F = self._R, self._H, self._nodes.normal, self._nodes.tangential, self._nodes.F
        mu, kappa, nu, rho, side = self._split(z)
        mean, count = np.mean(np.concatenate([mu, kappa])), len(mu) + len(kappa)
        M = self._form(mu, kappa, nu, rho) + weight * mean * H
        L = factor_above(M)
        if L is None:
            return _BEYOND, np.zeros_like(z)
        P = np.linalg.inv(M)
        # slopes of -log det M, which are -tr(P dM)
        by_mu, by_kappa, by_nu = (-np.sum(R[i] * P[j], axis=1) for i, j in ((slice(len(mu)),) * 2, (t, t), (n, t)))
        if self._spare is not None:
            squares = np.sum((R[: len(mu)] @ P) * R[: len(mu)], axis=1)
            by_mu, by_nu = by_mu - self._spare[0] * squares, by_nu - self._spare[1] * squares[n]
        by_rho = np.sum(R[t] * P[n], axis=1)
        by_kappa += by_rho * np.where(side != 0, side * F, self._fixed)
        by_mu[n] -= by_rho * side * self._give
        by_nu -= by_rho * abs(side) * self._give * F
        common = (len(R) / mean - weight * float(np.sum(H * P))) / count
        slope = np.concatenate([(by_mu + common) * mu, (by_kappa + common) * kappa, by_nu * mu[n] / F])
        slope[n] += by_nu * nu
        slope[self._nu] *= 1.0 - np.tanh(z[self._nu]) ** 2
        return float(len(R) * np.log(mean) - 2.0 * np.sum(np.log(np.diag(L)))), slope

    def _as_written(self, z: Floats) -> Floats:
        mu, kappa, nu, rho, _ = self._split(z)
        share = np.clip(rho / (kappa * self._nodes.F), -1.0, 1.0)
        mean = np.mean(np.concatenate([mu, kappa]))
        return np.concatenate([mu / mean, kappa / mean, nu / mean, share, np.zeros_like(share)])
