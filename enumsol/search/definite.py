"""Numbers with which the form of theory, (6.9), is definite: near analytic centres, and for many nodes by descent.

Nothing here is trusted.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from enumsol.arithmetic.balls import factor_above
from enumsol.support.array_types import Floats, Indices, Mask
from enumsol.support.deadlines import look

#: Smallest eigenvalue below which a form counts as not definite.
DEFINITE = 1e-10
#: Smallest eigenvalue, as a share of R's diagonal, that is worth the search for it.
_WORTH = 1e-5
#: Smallest eigenvalue at which Newton's method need not go on.
_CLEARLY = 1e-3
#: Steps of Newton's method.
_STEPS = 40
#: What the weight of the objective is multiplied by, once so little is left of the Newton decrement, or a step raises t
#: by less than this share of it.
_GROWTH, _CENTRED, _STALLED = 5.0, 1.0, 0.1
#: More components of x are not tried: a step costs as much as many nodes of the tree.
_LARGEST = 300
#: Of the way to the border, where the length of a step is sought first, and for so many steps.
_INSIDE, _SHARES = 0.9, 8
#: Of the gap that a node has, what at first may serve for its slip; largest theta / F that Newton's method begins with.
SHARED, _CHOSEN = 0.5, 0.999
#: Smallest eigenvalue, relative to H and the mean of the numbers, at which descent may end; and that is any use.
_ENOUGH, _JUST = 5e-4, 1e-6
#: Smallest eigenvalue with plain numbers, relative to S or H, below which no better ones are sought; the same where
#: squares count: on blocks worse ones were not mended.
HOPELESS, _HOPELESS_SQUARES = -4.0, -1.0
#: Rounds, steps of each, and the weight of H in one by what lacked before it; after so many rounds in a row that each
#: leave more than this share of what lacks there is no other.
_ROUNDS, _EVALUATIONS, _ABOVE, _IN_VAIN, _SLOW = 16, 15, 1.05, 2, 0.9
#: Nodes whose numbers move, in turn, where there are more than so many, or all: 16 suffice for most of the blocks.
_MOVING, _FEW = (16, 32), 64
#: So many rows take less time by Lanczos' method.
_MANY_ROWS = 1000
#: The objective where M is not definite.
_BEYOND = 1e10


@dataclass(frozen=True)
class Nodes:
    """The nodes of a reduced problem at a solution.

    Attributes
    ----------
    count : nodes
    normal, tangential : (b,) arrays
        Places in x of lambda_n and lambda_t of the nodes with friction.
    F : (b,) array
    share : (b,) array
        lambda_t / (F lambda_n) where lambda_n > 0, and the sign of w_t where w_n = lambda_n = 0; not finite elsewhere.
    wide : (b,) bool array
        Of these others, those where the form has to serve any theta; where it has not, theta may be chosen.
    gap, slip : (b,) arrays
        -w_n and w_t, of nodes where theta may be chosen.
    """

    count: int
    normal: Indices
    tangential: Indices
    F: Floats
    share: Floats
    wide: Mask
    gap: Floats
    slip: Floats

    @property
    def chosen(self) -> Indices:
        """Nodes with friction where theta may be chosen."""
        return np.flatnonzero(~np.isfinite(self.share) & ~self.wide)

    @property
    def first(self) -> Floats:
        """A share for every node with friction; where it may be chosen, the least in size that is clearly allowed."""
        size = self.F * np.abs(self.slip)
        least = 1.0 - np.minimum(SHARED * self.gap, size) / np.where(size > 0, size, np.inf)
        chosen = np.sign(self.slip) * np.where(size > 0, least, 0.0)
        return np.where(np.isfinite(self.share), self.share, chosen)


class AnalyticCentres:
    """The largest t for which M - t I is positive semidefinite, by a path of analytic centres.

    M is linear in z = (mu, kappa, nu, rho, tau): rho = kappa theta where theta may be chosen, tau where the form has to
    serve any. It is the symmetric part of D'R, with -tau / 2 at the lambda_n of wide nodes, and beside it rows kappa F
    r_t / sqrt(2) and diag(tau) for these: (6.9) is its Schur complement. The sum of all mu and kappa is fixed, and C z
    >= 0 says what else is asked of them.
    """

    def __init__(self, R: Floats, nodes: Nodes) -> None:
        self._nodes, m, b = nodes, nodes.count, len(nodes.F)
        n, t, F, c, wide = nodes.normal, nodes.tangential, nodes.F, nodes.chosen, np.flatnonzero(nodes.wide)
        ends = np.cumsum([0, m, b, b, len(c), len(wide)])
        self._mu, self._kappa, self._nu, self._rho, self._tau = (slice(*ends[k : k + 2]) for k in range(5))
        self._size, self._k = int(ends[-1]), len(R) + len(wide)
        # each term is the symmetric part of u v'
        eye, theta = np.eye(self._k), np.where(np.isfinite(nodes.share), F * nodes.share, 0.0)
        V = np.pad(R, ((0, 0), (0, len(wide))))
        lower, turned = eye[len(R) :], eye[t] - theta[:, None] * eye[n]
        turned[wide] += np.sqrt(2.0) * F[wide, None] * lower
        self._U = np.concatenate([eye[:m], turned, eye[t], -eye[n[c]], lower, -0.5 * eye[n[wide]]]).T
        self._V = np.concatenate([V[:m], V[t], V[n], V[t[c]], lower, eye[n[wide]]]).T
        self._of = np.concatenate([np.arange(self._size), np.arange(self._size)[self._tau]])
        self._C = self._conditions()
        self._scale = float(np.mean(np.abs(np.diag(R))))

    def _conditions(self) -> Floats:
        nodes, c = self._nodes, self._nodes.chosen
        z, F = np.eye(self._size), nodes.F[:, None]
        mu, kappa, nu, rho = z[nodes.normal], z[self._kappa], z[self._nu], z[self._rho]
        plain, fixed = np.setdiff1d(np.arange(nodes.count), nodes.normal), np.setdiff1d(np.arange(len(F)), c)
        rows = [z[plain], mu + F * nu, mu - F * nu, kappa[fixed], F[c] * kappa[c] + rho, F[c] * kappa[c] - rho]
        side, slip = np.sign(nodes.slip[c])[:, None], np.abs(nodes.slip[c])
        # where a node is open with a slip: (mu +- nu F) |w_n| > (kappa F -+ rho) |w_t|
        apart = slip > 0
        share = (slip / np.where(apart, nodes.gap[c], 1.0))[:, None]
        rows += [(mu[c] + side * F[c] * nu[c] - share * (F[c] * kappa[c] - side * rho))[apart], z[self._tau]]
        return np.concatenate(rows)

    def _start(self) -> Floats:
        nodes, z = self._nodes, np.zeros(self._size + 1)
        z[self._mu], z[self._kappa], z[self._tau] = 1.0, 1.0, self._scale
        # a share of one is on the border
        z[self._rho] = (np.clip(nodes.first, -_CHOSEN, _CHOSEN) * nodes.F)[nodes.chosen]
        z[-1] = np.linalg.eigvalsh(self._matrix(z))[0] - 0.5 * self._scale
        return z

    def _matrix(self, z: Floats) -> Floats:
        M = (self._U * z[self._of]) @ self._V.T
        M = 0.5 * (M + M.T)
        M[np.diag_indices_from(M)] -= z[-1]
        return np.asarray(M)

    def numbers(self) -> Floats | None:
        """mu, kappa, nu and theta / F, or None."""
        if self._k > _LARGEST or not 0 < self._scale < np.inf:
            return None
        z, parts = self._start(), self._k + len(self._C)
        if not np.all(self._C @ z[:-1] > 0):
            return None
        weight, after = parts / self._scale, 0
        for _ in range(_STEPS):
            look()
            before = z[-1]
            z, decrement = self._moved(z, weight)
            if z[-1] > DEFINITE:
                # two steps farther from the border where it is not far yet: enclosures are wide near it
                after += 1
                if after > 2 or decrement < _CENTRED or z[-1] > _CLEARLY:
                    return self._found(z)
            elif decrement < _CENTRED or z[-1] - before < _STALLED * abs(before):
                # near a centre no t is larger by more than this
                if z[-1] + 2.0 * parts / weight < _WORTH * self._scale:
                    return None
                weight *= _GROWTH
        return self._found(z) if z[-1] > DEFINITE else None

    def _found(self, z: Floats) -> Floats:
        nodes, tau = self._nodes, np.zeros(len(self._nodes.F))
        share = np.where(np.isfinite(nodes.share), nodes.share, 0.0)
        share[nodes.chosen] = np.clip(z[self._rho] / (nodes.F * z[self._kappa])[nodes.chosen], -1.0, 1.0)
        tau[nodes.wide] = z[self._tau]
        return np.concatenate([z[self._mu], z[self._kappa], z[self._nu], share, tau])

    def _moved(self, z: Floats, weight: float) -> tuple[Floats, float]:
        """A Newton step for -weight t - log det(M - t I) - sum log(C z), as long as serves, and its decrement."""
        gradient, hessian = self._derivatives(z, weight)
        step = np.asarray(-np.linalg.solve(hessian, gradient)[:-1], dtype=np.float64)
        decrement = float(np.sqrt(max(-float(gradient[:-1] @ step), 0.0)))
        L = np.asarray(np.linalg.cholesky(self._matrix(z)), dtype=np.float64)
        half = np.linalg.solve(L, self._matrix(step))
        rates = np.linalg.eigvalsh(np.linalg.solve(L, half.T))
        rates = np.concatenate([rates, (self._C @ step[:-1]) / (self._C @ z[:-1])])
        return z + _share(rates, weight * step[-1]) * step, decrement

    def _derivatives(self, z: Floats, weight: float) -> tuple[Floats, Floats]:
        """Gradient and second derivatives, with a row for the sum of mu and kappa."""
        P = np.linalg.inv(self._matrix(z))
        PU, PV = P @ self._U, P @ self._V
        UU, VV, UV = self._U.T @ PU, self._V.T @ PV, self._U.T @ PV
        slopes = self._C / (self._C @ z[:-1])[:, None]
        size, gather = self._size, np.equal.outer(np.arange(self._size), self._of).astype(float)
        hessian = np.zeros((size + 2, size + 2))
        hessian[:size, :size] = gather @ (0.5 * (UU * VV + UV * UV.T)) @ gather.T + slopes.T @ slopes
        hessian[:size, size] = hessian[size, :size] = -gather @ np.sum(PU * PV, axis=0)
        hessian[size, size] = np.sum(P * P)
        hessian[: self._nu.start, -1] = hessian[-1, : self._nu.start] = 1.0
        gradient = np.concatenate([-gather @ np.diag(UV) - np.sum(slopes, axis=0), [np.trace(P) - weight, 0.0]])
        return gradient, hessian


def _share(rates: Floats, gain: float) -> float:
    """s > 0 at which -gain s - sum log(1 + s rates) is least, nearly."""
    low, high = 0.0, min(-1.0 / min(float(np.min(rates)), -1e-9), 1e3)
    s = min(1.0, _INSIDE * high)
    for _ in range(_SHARES):
        terms = rates / (1.0 + s * rates)
        slope = -gain - float(np.sum(terms))
        low, high = (s, high) if slope < 0 else (low, s)
        ahead = s - slope / float(np.sum(terms * terms))
        s = ahead if low < ahead < high else 0.5 * (low + high)
    return low if low > 0 else s


@dataclass(frozen=True)
class Descent:
    """Numbers for which the form is definite, by descent on a path: of all nodes, or of some while others' are fixed.

    M is Q of (6.9) plus so many times H, the symmetric part of R, on a basis of changes of x. -log det M, less what
    scaling all numbers alike adds, is lowered by a quasi-Newton method from mu = kappa = 1 and nu = 0; the multiple of
    H begins at what makes M definite, and falls with what Q lacks relative to H. The variables are the logarithms of mu
    and kappa, and the artanh of nu F / mu. Where theta may be chosen it is the least in size that these allow.

    Attributes
    ----------
    nodes : Nodes, none of them wide
        Those whose numbers are sought.
    spare : (2, m) array or None
        The squares of their w_n count, times mu times the first and nu times the second of these.
    x, w : (c, k) arrays
        Changes of their components of x, lambda_n first, and of -w, for a basis.
    H, rest : (k, k) arrays
        H, and what other nodes add to M.
    others : int, float
        How many mu and kappa other nodes have, and their sum.
    size : int
        Components of x of all nodes.
    """

    nodes: Nodes
    spare: Floats | None
    x: Floats
    w: Floats
    H: Floats
    rest: Floats
    others: tuple[int, float]
    size: int

    @classmethod
    def of(cls, R: Floats, nodes: Nodes, spare: Floats | None = None) -> Descent:
        """For all nodes of a reduced problem with R, its symmetric part positive definite."""
        return cls(nodes, spare, np.eye(len(R)), R, 0.5 * (R + R.T), np.zeros_like(R), (0, 0.0), len(R))

    def numbers(self) -> Floats | None:
        """mu, kappa, nu, theta / F and tau as a proof has them, or None.

        With many nodes only those move where x is largest in what lacks most.

        Raises
        ------
        numpy.linalg.LinAlgError
            H is not positive definite; or so many rows are far from what descent mends.
        """
        mu, _, nu = self._parts
        z, hopeless = np.zeros(nu.stop), HOPELESS
        if self.spare is not None:
            # what mu begins with where squares count
            z[mu], hopeless = np.log(3.0), _HOPELESS_SQUARES
        least, mode = self._least(z)
        for many in _MOVING if self.nodes.count > _FEW else (self.nodes.count,):
            if least > _ENOUGH or least < hopeless:
                break
            part, places = self._some(z, least, mode, many)
            z[places] = part._followed(z[places], least)
            least, mode = self._least(z)
        return self._as_written(z) if least > _JUST else None

    def _followed(self, z: Floats, least: float) -> Floats:
        """Numbers at the end of the path."""
        from scipy.optimize import minimize  # not for problems that need no numbers

        options, vain = {"maxiter": _EVALUATIONS, "maxfun": _EVALUATIONS, "maxcor": _EVALUATIONS}, 0
        for _ in range(_ROUNDS):
            if least > _ENOUGH or vain == _IN_VAIN:
                break
            weight, before = _ABOVE * max(-least, 0.0) + _ENOUGH, least
            z = minimize(self._objective, z, args=(weight,), jac=True, method="L-BFGS-B", options=options).x
            least = self._least(z)[0]
            vain = vain + 1 if least < _SLOW * before else 0
        return z

    def _some(self, z: Floats, least: float, mode: Floats, many: int) -> tuple[Descent, Indices]:
        """The descent of some nodes' numbers, and their places in z.

        With them M changes by their components of x times these and those of w only: log det M on a basis.
        """
        nodes, m, form = self.nodes, self.nodes.count, self._form(z)
        if many == m:
            return self, np.arange(len(z))
        size = mode[:m] ** 2
        size[nodes.normal] += mode[nodes.tangential] ** 2
        some = np.sort(np.argsort(size)[-many:])
        rubs = np.flatnonzero(np.isin(nodes.normal, some))
        rows, places = np.append(some, nodes.tangential[rubs]), np.append(some, m + rubs)
        kept = np.delete(z[: self._parts[1].stop], places)
        weight = (_ABOVE * max(-least, 0.0) + _ENOUGH) * self._mean(z)
        turned = np.linalg.solve(form + weight * self.H, np.concatenate([self.x[rows], self.w[rows]]).T)
        basis = np.linalg.qr(turned)[0]
        own = replace(
            nodes,
            count=many,
            normal=np.searchsorted(some, nodes.normal[rubs]),
            tangential=many + np.arange(len(rubs)),
            **{name: getattr(nodes, name)[rubs] for name in ("F", "share", "wide", "gap", "slip")},
        )
        part = replace(
            self,
            nodes=own,
            spare=None if self.spare is None else self.spare[:, some],
            x=basis[rows],
            w=self.w[rows] @ basis,
            H=basis.T @ self.H @ basis,
            rest=np.zeros((basis.shape[1],) * 2),
            others=(len(kept), float(np.sum(np.exp(kept)))),
        )
        places = np.append(places, m + len(nodes.F) + rubs)
        return replace(part, rest=basis.T @ form @ basis - part._form(z[places])), places

    @cached_property
    def _parts(self) -> tuple[slice, slice, slice]:
        """Places of mu, kappa and nu."""
        m, b = self.nodes.count, len(self.nodes.F)
        return slice(0, m), slice(m, m + b), slice(m + b, m + 2 * b)

    @cached_property
    def _chosen(self) -> tuple[Floats, Floats, Floats]:
        """Theta, or zero where it is chosen; the side where it is; and what a gap gives there."""
        nodes, chosen = self.nodes, ~np.isfinite(self.nodes.share)
        side = np.where(chosen, np.sign(nodes.slip), 0.0)
        give = SHARED * nodes.gap / np.where(side != 0, np.abs(nodes.slip), np.inf)
        return nodes.F * np.where(chosen, 0.0, nodes.share), side, give

    def _split(self, z: Floats) -> tuple[Floats, Floats, Floats, Floats, Floats]:
        """mu, kappa, nu, kappa theta, and the side of theta where it is chosen and not zero."""
        nodes, (fixed, sides, give) = self.nodes, self._chosen
        mu, kappa = (np.exp(z[part]) for part in self._parts[:2])
        nu = mu[nodes.normal] / nodes.F * np.tanh(z[self._parts[2]])
        # (mu +- nu F) |w_n| >= kappa (F -+ theta) |w_t|
        size = nodes.F * kappa - give * (mu[nodes.normal] + sides * nodes.F * nu)
        side = np.where(size > 0, sides, 0.0)
        return mu, kappa, nu, np.where(side != 0, side * size, kappa * fixed), side

    def _mean(self, z: Floats) -> float:
        """The mean of all mu and kappa."""
        own, (count, total) = z[: self._parts[1].stop], self.others
        return float(total + np.sum(np.exp(own))) / (count + len(own))

    def _form(self, z: Floats) -> Floats:
        x, w, n, t = self.x, self.w, self.nodes.normal, self.nodes.tangential
        mu, kappa, nu, rho, _ = self._split(z)
        form = np.zeros_like(w)
        form[: len(mu)] = mu[:, None] * w[: len(mu)]
        form[n] -= rho[:, None] * w[t]
        form[t] = nu[:, None] * w[n] + kappa[:, None] * w[t]
        form = form if len(x) == self.size else x.T @ form
        form = 0.5 * (form + form.T) + self.rest
        if self.spare is not None:
            strength = mu * self.spare[0]
            strength[n] += nu * self.spare[1, n]
            # |nu F| <= mu: strengths are not negative but by rounding
            root = np.sqrt(np.maximum(strength, 0.0))[:, None] * w[: len(mu)]
            form += root.T @ root
        return np.asarray(form)

    def _least(self, z: Floats) -> tuple[float, Floats]:
        """The smallest eigenvalue relative to H, and to the mean of mu and kappa, and its eigenvector."""
        from scipy.linalg import cho_solve, eigh  # not for problems that need no numbers
        from scipy.sparse.linalg import LinearOperator, eigsh

        form, H = self._form(z) / self._mean(z), self.H
        if len(H) < _MANY_ROWS:
            values, modes = eigh(form, H, subset_by_index=[0, 0], check_finite=False)
        else:
            # of what is worse the factorization fails
            L = np.linalg.cholesky(form - HOPELESS * H)
            inverse = LinearOperator(H.shape, lambda x: cho_solve((L, True), x, check_finite=False), dtype=float)
            start = np.random.default_rng(0).normal(size=len(H))
            values, modes = eigsh(form, 1, H, sigma=HOPELESS, OPinv=inverse, v0=start, tol=1e-3)
        return float(values[0]), np.asarray(modes[:, 0])

    def _objective(self, z: Floats, weight: float) -> tuple[float, Floats]:
        look()
        x, w, H, n, t, F = self.x, self.w, self.H, self.nodes.normal, self.nodes.tangential, self.nodes.F
        mu, kappa, nu, _, side = self._split(z)
        (fixed, _, give), mean = self._chosen, self._mean(z)
        M = self._form(z) + weight * mean * H
        L = factor_above(M)
        if L is None:
            return _BEYOND, np.zeros_like(z)
        P = np.linalg.inv(M)
        Px, Pw = x @ P, w @ P
        # slopes of -log det M, which are -tr(P dM)
        by_mu, by_kappa, by_nu = (-np.sum(w[i] * Px[j], axis=1) for i, j in ((slice(len(mu)),) * 2, (t, t), (n, t)))
        if self.spare is not None:
            squares = np.sum((w * Pw)[: len(mu)], axis=1)
            by_mu, by_nu = by_mu - self.spare[0] * squares, by_nu - self.spare[1, n] * squares[n]
        by_rho = np.sum(w[t] * Px[n], axis=1)
        by_kappa += by_rho * np.where(side != 0, side * F, fixed)
        by_mu[n] -= by_rho * side * give
        by_nu -= by_rho * abs(side) * give * F
        common = (self.size / mean - weight * float(np.sum(H * P))) / (self.others[0] + len(mu) + len(kappa))
        slope = np.concatenate([(by_mu + common) * mu, (by_kappa + common) * kappa, by_nu * mu[n] / F])
        slope[n] += by_nu * nu
        slope[self._parts[2]] *= 1.0 - np.tanh(z[self._parts[2]]) ** 2
        return float(self.size * np.log(mean) - 2.0 * np.sum(np.log(np.diag(L)))), slope

    def _as_written(self, z: Floats) -> Floats:
        mu, kappa, nu, rho, _ = self._split(z)
        share, mean = np.clip(rho / (kappa * self.nodes.F), -1.0, 1.0), self._mean(z)
        return np.concatenate([mu / mean, kappa / mean, nu / mean, share, np.zeros_like(share)])
