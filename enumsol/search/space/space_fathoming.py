"""In 3D: one certificate, before the tree or in it, that there is one solution only (theory, section 12.6).

Nothing here is trusted: the certifier proves what is proposed, or the tree is searched.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import scipy.linalg

from enumsol.arithmetic.balls import factor_above
from enumsol.model.sectors import SECTORS
from enumsol.model.statuses import CONTACT, OPEN, STICK, UNDECIDED
from enumsol.search.definite import HOPELESS
from enumsol.search.nodes import TreeCloser
from enumsol.search.reduction import NEAR
from enumsol.search.space.space_newton import Isotropic
from enumsol.support.deadlines import look
from enumsol.trusted.space.sector_rows import leaf_code
from enumsol.trusted.space.space_uniqueness import equations, moderate_units

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.condensation.space_condensed import EnclosedSpace, SpaceSystem
    from enumsol.relaxation.engine import Relaxation
    from enumsol.support.array_types import Codes, Floats, Mask


#: Level of the sectors in which a regular solution is sought.
_LEVEL = 20
#: Slack and smallest eigenvalue that fast arithmetic asks for.
_CLEAR = 1e-6


def without_sectors(codes: Codes) -> tuple[int, ...]:
    """Statuses, with contact for a sector."""
    return tuple(CONTACT if code > SECTORS else code for code in codes)


class SpaceClosing(Protocol):
    """A certifier that can close the whole tree, or parts of it."""

    enclosed: EnclosedSpace

    def close(self, numbers: Floats, codes: Codes | None, normal: Floats) -> list[Any] | None:
        """The only solution, as a list; None if not proven.

        Parameters
        ----------
        numbers : of the form, as ``trusted.space.space_uniqueness.Numbers.of`` takes them
        codes : of a leaf that holds the solution, if it is regular
        normal : (p,) array, lambda_n near the solution
        """

    def alone_in(self, codes: Codes, numbers: Floats, leaf: Codes) -> list[Any] | None:
        """The root of a leaf, as a list, if no other solution has the statuses of an assignment; None if not proven."""


class SpaceCloser(TreeCloser):
    """Tries once before the tree, and then at every assignment that allows the statuses of a regular solution.

    Parameters
    ----------
    system : SpaceSystem
    certifier : SpaceClosing
    regular : bool
        Plain numbers and regular solutions only.
    """

    def __init__(self, system: SpaceSystem, certifier: SpaceClosing, *, regular: bool = False) -> None:
        super().__init__()
        self._system, self._certifier, self._regular = system, certifier, regular
        #: Smallest eigenvalue of Q relative to S, and slack of a solution, that are asked for.
        self._enough, self._least = (_CLEAR, _CLEAR) if regular else (1e-9, NEAR)
        #: Assignments of statuses that were tried in vain.
        self._tried: set[Codes] = set()

    def whole(self) -> list[Any] | None:
        """The only solution, as a list; None where that is not proven."""
        with np.errstate(all="ignore"):
            return self._whole()

    def again(self, codes: Codes, relaxation: Relaxation | None) -> list[Any] | None:
        """The only solution, proven again where an earlier search has proven it."""
        return self.whole() if all(code == UNDECIDED for code in codes) else self._alone(codes)

    def closed(self, codes: Codes, relaxation: Relaxation | None) -> list[Any] | None:
        """The regular solution that is known, if it is proven to be the only one below an assignment."""
        del relaxation
        return self._alone(codes)

    def _alone(self, codes: Codes) -> list[Any] | None:
        """The regular solution that is known, if it is proven to be the only one with the statuses of an assignment.

        Sectors count as contact: each assignment of statuses is tried once.
        """
        statuses, found = without_sectors(codes), None
        with np.errstate(all="ignore"):
            point = self._point
            if point is None or point.slack <= self._least or statuses in self._tried:
                return None
            if not all(map(_allows, statuses, point.codes)):
                return None
            held = equations(self._certifier.enclosed, statuses, 1024.0).mid  # times the largest entry of S
            numbers = point.numbers(self._enough, better=False, held=held)
            if numbers is not None:
                found = self._certifier.alone_in(statuses, numbers, point.codes)
        if found is None:
            self._tried.add(statuses)
        return found

    @cached_property
    def _point(self) -> Point | None:
        """A solution in floats."""
        found = solved(self._system)
        return None if found is None else found[0]

    def _whole(self) -> list[Any] | None:
        system, point = self._system, self._point
        if point is None or (self._regular and point.slack < _CLEAR):
            return None
        # a tree would not end at a degenerate solution: numbers are sought there whatever they cost
        better = not self._regular and (system.p >= 8 or point.slack <= NEAR)
        numbers = point.numbers(self._enough, better=better)
        if numbers is None:
            return None
        found = self._certifier.close(numbers, point.codes, point.n) if point.slack > 0 else None
        if found is None and not self._regular:
            found = self._certifier.close(numbers, None, point.n)
        return found


def solved(system: SpaceSystem, near: Floats | None = None) -> tuple[Point, Floats] | None:
    """A solution in floats, and its forces in isotropic variables, near those of another one; or None."""
    if not moderate_units(system.unit):
        return None
    problem = Isotropic.of(system)
    y = problem.solution(near)
    return None if y is None else (Point.of(system, problem, y), y)


@dataclass(frozen=True)
class Point:
    """A solution in floats.

    Attributes
    ----------
    n : (p,) array
        lambda_n, 0 where it is within rounding of that.
    gap, slip : (p,) and (p, 2) arrays
        -w_n of open nodes, 0 elsewhere, and v.
    theta : (p, 2) array
        A theta that serves the solution; at open nodes that of length one.
    wide : (p,) bool array
        Nodes that touch without load and rest.
    codes : codes of a leaf that holds it
    slack : float
        The least slack of its conditions.
    """

    system: SpaceSystem
    n: Floats
    gap: Floats
    slip: Floats
    theta: Floats
    wide: Mask
    codes: Codes
    slack: float

    @classmethod
    def of(cls, system: SpaceSystem, problem: Isotropic, y: Floats) -> Point:
        """The solution of forces y, (m,), which solve the problem up to rounding."""
        p, w = system.p, problem.displacements(y)
        n, gap = np.maximum(y[:p], 0.0), np.maximum(-w[:p], 0.0)
        tau, v = system.tangential(y), system.tangential(w)
        rubs, size, length = np.any(system.tau >= 0, axis=1), np.linalg.norm(v, axis=1), np.linalg.norm(tau, axis=1)
        loaded, slip, room = n > NEAR, size * system.slip_scale, (n - length) * system.disc_scale
        slides = rubs & (slip > NEAR)
        # exactly on the border of the disc, or clearly inside
        border = loaded & rubs & (slides | (length > (1.0 - NEAR) * n))
        divisor = np.where(loaded, np.where(border, length, n), np.where(slides, size, np.inf))
        theta = np.where(loaded[:, None], tau, v) / divisor[:, None]
        held = rubs & (slip <= room)
        slack = np.where(n < gap, gap, np.where(rubs, np.minimum(n, np.where(held, room, slip)), n))
        status = np.where(n < gap, OPEN, np.where(held, STICK, CONTACT)).tolist()
        codes = tuple(leaf_code(*node, _LEVEL) for node in zip(status, system.tau.tolist(), tau.tolist(), strict=True))
        apart = ~loaded & (gap > NEAR)
        wide = rubs & ~loaded & ~apart & ~slides
        open_gap = np.where(apart, gap, 0.0)
        return cls(system, np.where(loaded, n, 0.0), open_gap, v, theta, wide, codes, float(np.min(slack)))

    def leaf(self, level: int) -> Codes:
        """``codes`` with sectors of a level that hold those there."""
        up = _LEVEL - level
        return tuple(SECTORS + (code - SECTORS >> up) if code > SECTORS else code for code in self.codes)

    # -- numbers ---------------------------------------------------------------------------------------------------

    def numbers(self, enough: float, *, better: bool, held: Floats | None = None) -> Floats | None:
        """Numbers for which Q is definite, as a proof has them; plain ones, or better ones if these are asked for.

        Parameters
        ----------
        enough : smallest eigenvalue relative to S from which Q counts as definite
        better : whether better numbers than the plain ones are sought
        held : rows whose squares are added to Q
        """
        tau, opened, size = self.system.tau, self.gap > 0, np.linalg.norm(self.slip, axis=1)
        # half of the gap of an open node may serve for its slip
        need = 1.0 - 0.5 * self.gap / np.where(size > 0, size, 1.0)
        theta = np.where(opened[:, None], self.theta * np.maximum(need, 0.0)[:, None], self.theta)
        theta = np.where((tau >= 0) & ~self.wide[:, None], theta, 0.0)
        form = DefiniteForm(self.system, [theta], opened, self.wide.astype(np.float64), held=held)
        found = form.best(enough, better=better, hopeless=HOPELESS if self.slack > NEAR else -np.inf)
        if found is None:
            return None
        mu, kappa, nu = found
        wide = np.where(self.wide, kappa * np.maximum(form.reach, NEAR), 0.0)
        return np.concatenate([mu, kappa, wide, nu[tau >= 0], theta[tau >= 0]])


def _allows(code: int, final: int) -> bool:
    """True if a node of a (partial) status, which is not a sector, may have a final one."""
    return code in (UNDECIDED, final) or (code == CONTACT and final != OPEN)


class DefiniteForm:
    """Q = (D'S + S D) / 2 less what is lost, as a function of logarithms of mu and kappa, and of nu; no claim.

    Where a node is open nu = 0 and mu is at least kappa, so that a theta which serves for mu = kappa does so whatever
    they are; in place of log mu there is log (mu / kappa) >= 0. Elsewhere nu = mu z / (1 + |z|^2)^(1/2) for a z in the
    plane, over the largest radius of the disc.

    Parameters
    ----------
    system : SpaceSystem
    turns : (p, 2) arrays
        theta, or theta times the radii of the discs at both ends of a piece of alpha: the form is to be definite for
        each.
    opened : (p,) bool array
    off : (p,) array
        How far these may be off.
    discs : (p,) array, optional
        Largest radii of the discs, one by default.
    held : rows whose squares are added to Q

    Attributes
    ----------
    reach : (p,) array
        Norms of the rows of S that give v, where ``off`` is positive.
    """

    def __init__(
        self,
        system: SpaceSystem,
        turns: Sequence[Floats],
        opened: Mask,
        off: Floats,
        discs: Floats | None = None,
        held: Floats | None = None,
    ) -> None:
        self._held = None if held is None else held.T @ held
        self._system, self._S, self._open, self._off = system, system.S, opened, off
        self._discs = np.ones(system.p) if discs is None else discs
        tau = system.tau
        self._unit = system.tau_units
        self._turns = [turn / self._unit for turn in turns]
        rows = [np.where((tau[:, k] >= 0)[:, None], system.S[tau[:, k]] / self._unit[:, k, None], 0.0) for k in (0, 1)]
        self._rows = np.stack(rows, axis=1)
        self.reach = np.where(off > 0, np.sqrt(np.sum(self._rows**2, axis=(1, 2))), 0.0)
        self._pushes = (tau >= 0) & ~self._open[:, None]

    def best(self, enough: float, *, better: bool, hopeless: float = HOPELESS) -> tuple[Floats, Floats, Floats] | None:
        """mu, kappa and nu for which the smallest eigenvalue relative to S is more than ``enough``, or None.

        Plain ones, or better ones if these are asked for and plain ones are not below ``hopeless``.
        """
        logs, shares = np.zeros((2, self._system.p)), np.zeros((self._system.p, 2))
        plain = self._numbers(logs, shares)
        if all(factor_above(self._matrix(turn, *plain) - enough * self._S) is not None for turn in self._turns):
            return plain
        least = self.least(logs, shares)
        if least <= enough and better and least > hopeless:
            logs, shares, least = self.improved(logs, shares, least)
        return self._numbers(logs, shares) if least > enough else None

    def least(self, logs: Floats, shares: Floats) -> float:
        """The smallest eigenvalue of Q relative to S."""
        numbers = self._numbers(logs, shares)
        try:
            forms = (self._matrix(turn, *numbers) for turn in self._turns)
            first = {"eigvals_only": True, "subset_by_index": [0, 0]}
            return min(float(scipy.linalg.eigh(form, self._S, **first)[0]) for form in forms)
        except (np.linalg.LinAlgError, ValueError):
            return -np.inf

    def improved(self, logs: Floats, shares: Floats, least: float) -> tuple[Floats, Floats, float]:
        """Better numbers: those with the largest soft minimum of the eigenvalues of Q relative to S."""
        from scipy.optimize import Bounds, minimize  # seldom needed

        x, left = np.concatenate([logs.ravel(), shares.ravel()]), 60
        least_x = np.full_like(x, -np.inf)
        least_x[: self._system.p][self._open] = 0.0
        bounds = Bounds(least_x, np.inf)
        # columns in which S is the unit matrix
        columns = np.linalg.inv(np.linalg.cholesky(self._S)).T
        # the smallest eigenvalue counts more sharply in each round
        for hardness in 10.0, 20.0, 40.0:
            if left <= 0 or least > 1e-2:  # no evaluation left, or good enough
                break
            options = {"maxfun": min(20, left), "maxiter": 20}
            given = columns, hardness
            try:
                found = minimize(self._value, x, given, method="L-BFGS-B", jac=True, bounds=bounds, options=options)
            except np.linalg.LinAlgError:  # a step beyond all bounds
                break
            left -= max(int(found.nfev), 1)
            x, least = found.x, self.least(*self._split(found.x))
        return *self._split(x), least

    def _split(self, x: Floats) -> tuple[Floats, Floats]:
        p = self._system.p
        return x[: 2 * p].reshape(2, p), x[2 * p :].reshape(p, 2)

    def _numbers(self, logs: Floats, shares: Floats) -> tuple[Floats, Floats, Floats]:
        logs = np.stack([np.where(self._open, logs[0] + logs[1], logs[0]), logs[1]])
        mu, kappa = np.exp(logs - np.mean(logs))
        most = mu / self._discs
        return mu, kappa, np.where(self._pushes, most[:, None] * self._disc(shares)[0] * (1.0 - NEAR), 0.0)

    @staticmethod
    def _disc(shares: Floats) -> tuple[Floats, Floats]:
        root = np.sqrt(1.0 + np.sum(shares * shares, axis=1, keepdims=True))
        return shares / root, root

    def _matrix(self, turn: Floats, mu: Floats, kappa: Floats, nu: Floats) -> Floats:
        look()  # its eigenvalues take seconds where there are some hundred nodes, and many such matrices are tried
        S, tau, p = self._S, self._system.tau, self._system.p
        form = S.copy()
        form[:p] = mu[:, None] * S[:p]
        for k in range(2):
            has = tau[:, k] >= 0
            t = tau[has, k]
            form[:p][has] -= (kappa[has] * turn[has, k])[:, None] * S[t]
            form[t] = kappa[has, None] * S[t] + (nu[has, k] * self._unit[has, k])[:, None] * S[:p][has]
        lost = np.flatnonzero(self._off > 0)
        reach, share = np.maximum(self.reach[lost], NEAR), kappa[lost] * self._off[lost]
        for k in range(2):
            rows = self._rows[lost, k] * np.sqrt(share / reach)[:, None]
            form -= 0.5 * rows.T @ rows
        form[lost, lost] -= 0.5 * share * reach
        if self._held is not None:
            form += self._held
        return 0.5 * (form + form.T)

    def _value(self, x: Floats, columns: Floats, hardness: float) -> tuple[float, Floats]:
        """The logarithm of sum exp(-hardness e) over the eigenvalues e, by the hardness, and its gradient."""
        logs, shares = self._split(x)
        mu, kappa, nu = self._numbers(logs, shares)
        found = [np.linalg.eigh(columns.T @ self._matrix(turn, mu, kappa, nu) @ columns) for turn in self._turns]
        least = min(sizes[0] for sizes, _ in found)
        parts = [np.exp(-hardness * (sizes - least)) for sizes, _ in found]
        total, gradient = sum(float(np.sum(part)) for part in parts), np.zeros_like(x)
        for turn, (_, vectors), part in zip(self._turns, found, parts, strict=True):
            turned = columns @ vectors
            gradient += self._gradient(turn, (turned * (part / total)) @ turned.T, mu, kappa, nu, shares)
        return float(np.log(total) / hardness - least), gradient

    def _gradient(self, turn: Floats, P: Floats, mu: Floats, kappa: Floats, nu: Floats, shares: Floats) -> Floats:
        tau, p, SP = self._system.tau, self._system.p, self._S @ P
        node = np.arange(p)
        by_mu, by_kappa, by_nu = np.diagonal(SP)[:p].copy(), np.zeros(p), np.zeros((p, 2))
        for k in range(2):
            has = tau[:, k] >= 0
            t = tau[has, k]
            by_kappa[has] += SP[t, t] - turn[has, k] * SP[t, node[has]]
            by_nu[has, k] = SP[node[has], t] * self._unit[has, k]
        for i in np.flatnonzero(self._off > 0):
            reach, rows = max(self.reach[i], NEAR), self._rows[i]
            by_kappa[i] -= 0.5 * self._off[i] * (reach * P[i, i] + float(np.sum((rows @ P) * rows)) / reach)
        by_nu = np.where(self._pushes, by_nu, 0.0)
        logs = np.stack([by_mu * mu + np.sum(by_nu * nu, axis=1), by_kappa * kappa])
        logs -= np.mean(logs)
        logs[1] += np.where(self._open, logs[0], 0.0)
        z, root = self._disc(shares)
        pulled = by_nu * (mu / self._discs)[:, None] * (1.0 - NEAR)
        pulled = (pulled - z * np.sum(z * pulled, axis=1, keepdims=True)) / root
        return -np.concatenate([logs.ravel(), pulled.ravel()])
