"""What the condensed equations in 2D and 3D share: variables without units, and the metric of the path.

The first block of H is linear in u and is eliminated once and for all: w = g(alpha) - S lambda (theory, section 8.1).
What is left has m + 1 unknowns x = (lambda, alpha), m = 2p or in 3D 3p, scaled so that

- the energy of the load is one: forces are measured by G / s_i and displacements by G s_i, where s_i^2 is the geometric
  mean of the node's normal and tangential compliances and G^2 the largest g' S^-1 g on the interval,
- alpha is measured by ``alpha_scale``.

Lengths are those of the metric W = diag(S, 1) in these variables: the arclength ds of a path satisfies

    ds^2 = d lambda' S d lambda / G^2 + (d alpha / alpha_scale)^2.

On a friction path its first part is the elastic energy of the change of displacement. Signs of determinants of the full
Jacobian of H bordered by a tangent are those of the condensed one, because A is positive definite.

Of a body that nothing holds, x = (lambda, q, alpha) has its rigid displacement as well, and H the equilibrium of the
body as a whole (theory, section 14.7); m counts the forces, and there are m + r equations. r is 0 for other bodies.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from enumsol.condensation.condensed import solved
from enumsol.model.statuses import FRICTIONLESS, OPEN
from enumsol.roots.local_branch import LocalBranchTest, NodeSlips, coherent_orientation

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from enumsol.continuation.parameter_path import ParameterPath, PathValues
    from enumsol.model.statuses import ContactStatus
    from enumsol.support.array_types import Codes, Floats, Mask


#: A condition within this of zero counts as met with equality; forces and displacements are of size one after scaling,
#: points are converged to about 1e-12.
STATUS_TOLERANCE = 1e-9


class ScaledEquation(ABC):
    """H, its selections, their conditions and the metric of the path.

    Points x have shape (m + r + 1,): scaled lambda (all normals first), q and alpha. Selections are named by rows of
    booleans, one for every node, or, at solutions, by status codes.

    Parameters
    ----------
    path : ParameterPath
    interval : (float, float)
        Where the load is measured; may be infinite.
    start : float
        An alpha on the path.
    r : float or None
        The r of H [force / length]; None for each node's own stiffness.
    alpha_scale : float
        Change of alpha that counts as one.
    """

    #: A selection has one solution at most for an alpha at which it is regular.
    single_valued: bool
    #: The statuses on the other side of the conditions of every status, in their order.
    neighbours: Mapping[int, Sequence[Sequence[int]]]

    def __init__(
        self,
        path: ParameterPath,
        interval: tuple[float, float] = (-math.inf, math.inf),
        start: float = 0.0,
        r: float | None = None,
        alpha_scale: float = 1.0,
    ) -> None:
        self.path = path
        self.problem = path.problem
        self.p = self.problem.p
        self.alpha_scale = alpha_scale
        condensed = path.condensed
        sigma, self.S = condensed.node_scale, condensed.balanced
        self.m = len(sigma)
        #: L of theory, section 14.7.
        self._mixing = condensed.mixing
        #: Of theory, (14.9); without rigid modes S.
        self.bordered = condensed.bordered
        self._energy = np.eye(len(self.bordered))
        self._energy[: self.m, : self.m] = self.S
        self.without = path.frictionless
        self.frictionless = self.without if self.without.ndim == 1 else np.all(self.without, axis=1)
        self._load = load = self._load_energy(interval, start, sigma)
        self.force, self.length = load / sigma, load * sigma
        # the r of each row in scaled variables
        self.r = np.ones(len(sigma)) if r is None else r * sigma**2
        self._last: tuple[float, PathValues] | None = None

    def _load_energy(self, interval: tuple[float, float], start: float, sigma: Floats) -> float:
        low, high = interval
        samples = [start]
        if math.isfinite(low) and math.isfinite(high):
            samples += list(np.linspace(low, high, 9))
        loads = np.array([self._per_unit(self.path.at(alpha).g, sigma, 1.0) for alpha in samples])
        loads = loads[np.all(np.isfinite(loads), axis=1)]
        size = float(np.max(np.abs(loads), initial=0.0))
        if size == 0:
            return 1.0
        # loads of size one: their squares neither overflow nor underflow
        loads = loads / size
        forces = solved(self._energy, loads.T)
        energy = float(np.max(np.einsum("ij,ji->i", loads, forces)))
        return size * math.sqrt(energy) if energy > 0 else size

    def _per_unit(self, values: Floats, length: Floats | float, load: float) -> Floats:
        """Displacements (m,) by their units, followed by loads of the body as a whole (r,) by theirs."""
        return np.append(values[: self.m] / length, np.linalg.solve(self._mixing, values[self.m :]) / load)

    # -- values ----------------------------------------------------------------------------------------------------

    @cached_property
    def metric(self) -> Floats:
        """W, shape (m + r + 1, m + r + 1)."""
        W = np.zeros((len(self._energy) + 1,) * 2)
        W[:-1, :-1] = self._energy
        W[-1, -1] = 1.0
        return W

    def dot(self, a: Floats, b: Floats) -> float:
        """Inner product of two vectors in the metric W."""
        return float(a[:-1] @ (self._energy @ b[:-1]) + a[-1] * b[-1])

    def norm(self, a: Floats) -> float:
        """Length of a vector."""
        return math.sqrt(max(self.dot(a, a), 0.0))

    def point(self, alpha: float, forces: Floats, rigid: Floats | None = None) -> Floats:
        """The scaled point x of unscaled alpha, lambda (m,) and q (r,), by default zero."""
        q = np.zeros(self.modes) if rigid is None else self._mixing.T @ rigid / self._load
        return np.concatenate([forces / self.force, q, [alpha / self.alpha_scale]])

    def point_of(self, alpha: float, forces: Floats, moves: Floats) -> Floats:
        """The scaled point x of a solution: q follows from its displacements, the unscaled (u_n, u_t), shape (m,)."""
        x = self.point(alpha, forces)
        if self.modes:
            rest = moves / self.length - self.w(x)
            x[self.m : -1] = np.linalg.lstsq(-self.bordered[: self.m, self.m :], rest, rcond=None)[0]
        return x

    def alpha(self, x: Floats) -> float:
        """Unscaled alpha."""
        return float(x[-1] * self.alpha_scale)

    def forces(self, x: Floats) -> Floats:
        """Unscaled lambda, shape (m,)."""
        return np.asarray(x[: self.m] * self.force)

    @property
    def modes(self) -> int:
        """r, the number of rigid modes."""
        return len(self._mixing)

    def rigid(self, x: Floats) -> Floats:
        """Unscaled q, shape (r,): coordinates of the rigid displacement."""
        return np.asarray(self.rigid_rows @ x)

    @cached_property
    def rigid_rows(self) -> Floats:
        """q by x, shape (r, m + r + 1)."""
        rows = np.zeros((self.modes, self.m + self.modes + 1))
        rows[:, self.m : -1] = self._load * np.linalg.inv(self._mixing).T
        return rows

    @cached_property
    def reach(self) -> Floats:
        """Bounds of the components of q, (r,)."""
        return self.problem.modes.reach(self.problem.rigid_reach) if self.modes else np.zeros(0)

    def moves_rigidly(self, tangent: Floats) -> bool:
        """True if a curve with this unit tangent changes the rigid displacement alone."""
        others = np.delete(tangent, slice(self.m, self.m + self.modes))
        # parts of a unit tangent that are rounding
        return self.modes > 0 and bool(np.max(np.abs(others)) <= 1e-9)

    def at(self, x: Floats) -> PathValues:
        """Scaled values of the paths; derivatives are with respect to the scaled alpha."""
        alpha = self.alpha(x)
        if self._last is None or self._last[0] != alpha:
            raw = self.path.at(alpha)
            a = self.alpha_scale
            g, dg = (self._per_unit(one, self.length, self._load) for one in (raw.g, raw.dg * a))
            scaled = type(raw)(g, raw.F, dg, raw.dF * a)
            self._last = (alpha, scaled)
        return self._last[1]

    def w(self, x: Floats) -> Floats:
        """Scaled (u_n, u_t), shape (m,)."""
        return np.asarray(self.at(x).g[: self.m] - self.bordered[: self.m] @ x[:-1])

    def _slopes(self, x: Floats) -> Floats:
        """Gradients of w with respect to x, shape (m, m + r + 1)."""
        return np.column_stack([-self.bordered, self.at(x).dg])[: self.m]

    def left(self, x: Floats) -> Floats:
        """Scaled h - G lambda, what contact does not carry of the load on the body as a whole, shape (r,)."""
        return np.asarray(self.at(x).g[self.m :] - self.bordered[self.m :] @ x[:-1])

    def displacements(self, x: Floats) -> Floats:
        """Unscaled (u_n, u_t), shape (m,)."""
        return np.asarray(self.w(x) * self.length)

    def split(self, values: Floats) -> tuple[Floats, Floats]:
        """Normal and tangential parts of arrays (..., m or more): (..., p) both, in 3D (..., p, 2) the latter."""
        p = self.p
        normal, tangential = values[..., :p], values[..., p : self.m]
        if tangential.shape[-1] == p:
            return normal, tangential
        return normal, np.stack([tangential[..., :p], tangential[..., p:]], axis=-1)

    # -- H and its selections ----------------------------------------------------------------------------------------

    def residual(self, x: Floats) -> Floats:
        """H(x) for each node's own r, shape (m + r,).

        Solutions do not depend on r, and neither may the decision whether x is one: a tiny r would make any
        displacement small, and a huge one any rounding error large.
        """
        return self._projected(x, np.ones(self.m))

    def merit(self, x: Floats) -> float:
        """Norm of H(x) for the given r, which its Newton directions lower."""
        return float(np.linalg.norm(self._projected(x, self.r)))

    @abstractmethod
    def _projected(self, x: Floats, r: Floats) -> Floats:
        """H(x) with these r by row, shape (m + r,)."""

    @abstractmethod
    def selection_at(self, x: Floats) -> Mask:
        """Rows of the selection that is active at x; they depend on the r of H."""

    @abstractmethod
    def selection(self, codes: Codes) -> Mask:
        """Rows of the selection in which the nodes have these statuses."""

    @abstractmethod
    def selection_residual(self, rows: Mask, x: Floats) -> Floats:
        """The named selection function of H, shape (m + r,), its rows scaled by positive factors to size one."""

    @abstractmethod
    def jacobian(self, rows: Mask, x: Floats) -> Floats:
        """Gradient of the named selection function (see selection_residual), shape (m + r, m + r + 1)."""

    # -- statuses and their conditions -------------------------------------------------------------------------------

    @abstractmethod
    def slacks(self, codes: Codes, x: Floats) -> Floats:
        """Values that are >= 0 where the statuses hold, shape (p, 2); infinite where there is one condition."""

    @abstractmethod
    def slack_gradients(self, codes: Codes, x: Floats) -> Floats:
        """Gradients of all slacks with respect to x, shape (p, 2, m + r + 1); zero where there is one condition."""

    def slack_rates(self, codes: Codes, x: Floats, tangent: Floats) -> Floats:
        """Derivatives of the slacks along a tangent, shape (p, 2); zero where there is one condition."""
        return np.asarray(self.slack_gradients(codes, x) @ tangent)

    def across(self, code: int, k: int) -> Sequence[int]:
        """The statuses on the other side of the k-th condition of a status; none where it has no such condition."""
        conditions = self.neighbours[code]
        return conditions[k] if k < len(conditions) else ()

    def flip(self, codes: Codes, x: Floats, which: tuple[int, int]) -> Codes:
        """Statuses after one slack vanished: a node that comes into contact slips at once."""
        i, k = which
        new = self.neighbours[codes[i]][k][0]
        if codes[i] == OPEN:
            new = FRICTIONLESS if self.frictionless[i] else self._touching(i, x)
        return (*codes[:i], new, *codes[i + 1 :])

    @abstractmethod
    def _touching(self, i: int, x: Floats) -> int:
        """Status of node i, which has friction and comes into contact."""

    @abstractmethod
    def active(self, x: Floats, tolerance: float = STATUS_TOLERANCE) -> tuple[frozenset[int], ...]:
        """Per node the status codes whose equations and conditions hold within the tolerance."""

    def codes(self, x: Floats, prefer: Codes | None = None, tolerance: float = STATUS_TOLERANCE) -> Codes:
        """Statuses at a solution by the signs of the test functions; ``prefer`` is kept where it holds too."""
        found = self._codes(x)
        if prefer is None:
            return found
        active = self.active(x, tolerance)
        return tuple(old if old in held else new for old, new, held in zip(prefer, found, active, strict=True))

    @abstractmethod
    def _codes(self, x: Floats) -> Codes:
        """Statuses at a solution, which do not depend on the r of H."""

    @abstractmethod
    def statuses(self, codes: Sequence[int], slip: Floats) -> tuple[ContactStatus, ...]:
        """Names of the statuses; that of a frictionless node in contact follows from its u_t, ``slip`` (m - p,)."""

    # -- signs of determinants ---------------------------------------------------------------------------------------

    def index(self, codes: Codes, x: Floats, singular: float) -> int:
        """Sign of the selection's determinant at fixed alpha, 0 where it is singular; rows scaled to length one."""
        J = self.jacobian(self.selection(codes), x)[:, :-1]
        size = np.linalg.norm(J, axis=1, keepdims=True)
        J = J / np.where(size > 0, size, 1.0)
        if not np.all(np.isfinite(J)) or np.linalg.svd(J, compute_uv=False)[-1] <= singular:
            return 0
        return int(np.linalg.slogdet(J)[0])

    def local_test(self, x: Floats) -> LocalBranchTest:
        """The local branch test at a point of a path (theory, section 3.2).

        Raises
        ------
        TooLargeError
            Too many selections hold there.
        """
        F, (slip, force) = self.at(x).F, (self.split(part)[1] for part in (self.w(x), x[:-1]))
        slips = NodeSlips.of(F, force, slip) if F.ndim == 2 else None
        return coherent_orientation(self.bordered, F, self.active(x), slip, self.alpha(x), slips=slips)
