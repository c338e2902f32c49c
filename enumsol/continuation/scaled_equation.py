"""Base of the condensed equations in 2D and 3D: paths of friction and load, variables without units, and the metric.

Friction and load are affine in alpha or the user's own callables, condensed to the contact nodes.

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
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from enumsol.condensation.condensed import condensation_of, solved
from enumsol.condensation.factorization import RHS_BLOCK
from enumsol.errors import InvalidArgumentError
from enumsol.model.problem import check_is_problem
from enumsol.model.statuses import FRICTIONLESS, OPEN, STATUS_TOLERANCE, contact_status, space_status
from enumsol.roots.local_branch import LocalBranchTest, NodeSlips, coherent_orientation
from enumsol.support.arguments import alpha_value, optional_callable
from enumsol.support.array_arguments import real_array

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from enumsol.model.problem import ContactProblem
    from enumsol.model.problem3d import AnyProblem, ContactProblem3D
    from enumsol.model.statuses import ContactStatus
    from enumsol.support.array_types import AlphaLike, Codes, Floats, Mask


PathFunction = Callable[[float], Any]
#: A problem in 2D or 3D.
Body = TypeVar("Body", "ContactProblem", "ContactProblem3D")


@dataclass(frozen=True)
class SmoothPath:
    """Friction and load as callables of alpha, in place of the affine paths of a problem.

    Give friction, load or both, each with its derivative; what is not given is taken from the problem.

    Attributes
    ----------
    F, dF : callable or None
        Friction coefficients and their derivative at alpha: a number or a (p,) array, in 3D also (p, 2) [-].
    f, df : callable or None
        Load and its derivative at alpha, (n,) arrays [force].

    Raises
    ------
    InvalidArgumentError
        A function comes without its derivative, or none is given.

    Examples
    --------
    >>> import enumsol
    >>> smooth = enumsol.SmoothPath(F=lambda alpha: alpha**2, dF=lambda alpha: 2 * alpha)
    >>> problem = enumsol.gallery.one_node_triangle()
    >>> enumsol.newton(problem, 2, start=(1.0, -3.5), smooth_path=smooth).statuses  # F = 4
    (ContactStatus.STICK,)
    """

    F: PathFunction | None = None
    dF: PathFunction | None = None  # noqa: N815 (the name is part of the public interface)
    f: PathFunction | None = None
    df: PathFunction | None = None

    def __post_init__(self) -> None:
        for name in ("F", "dF", "f", "df"):
            optional_callable(getattr(self, name), f"SmoothPath.{name}")
        if (self.F is None) != (self.dF is None) or (self.f is None) != (self.df is None):
            raise InvalidArgumentError(
                "SmoothPath has a function without its derivative; expected F with dF, f with df"
            )
        if self.F is None and self.f is None:
            raise InvalidArgumentError("SmoothPath has neither F nor f; expected at least one of them")

    def problem_at(self, problem: Body, alpha: AlphaLike) -> Body:
        """The problem, in 2D or 3D, with friction and load frozen at alpha, to enumerate roots on the path."""
        check_is_problem(problem)
        exact = alpha_value(alpha)
        value, shape = float(exact), problem.affine_friction[0].shape
        F = problem.friction_at(exact) if self.F is None else _coefficients(self.F, value, "F", shape)
        f = problem.load_at(exact) if self.f is None else _evaluate(self.f, value, "f", (problem.n,))
        friction = F if len(shape) == 1 else (F[:, 0], F[:, 1])
        return problem.replace(f=f, load_slope=None, friction=friction, friction_slope=0.0)


@dataclass(frozen=True)
class PathValues:
    """Condensed load g, friction F and their derivatives at one alpha: arrays (2p,), (p,), (2p,), (p,).

    In 3D the shapes are (3p,), (p, 2), (3p,), (p, 2). Of a body that nothing holds, g ends with the r loads h of its
    equilibrium as a whole, and dg with their derivatives.
    """

    g: Floats
    F: Floats
    dg: Floats
    dF: Floats  # noqa: N815 (as above)


class ParameterPath:
    """Friction and load over alpha, condensed to the contact nodes; a load by callables costs 2 p n products per alpha.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
    smooth : SmoothPath or None
        None: the problem's own friction and load, affine in alpha, also where friction would be negative (iterates).
    alpha : float
        The start of the path, at which a smooth one is checked.

    Raises
    ------
    InvalidArgumentError
        A function of the smooth path gives no friction or no load at the start, or another derivative than its own.
    """

    def __init__(self, problem: AnyProblem, smooth: SmoothPath | None, alpha: float) -> None:
        self.problem: Any = problem
        self._smooth, self._start = smooth, alpha
        self.condensed = condensed = condensation_of(problem)
        (g0, g1), (h0, h1) = (condensed.g0, condensed.g1), condensed.h
        self._load = np.append(g0, h0), np.append(g1, h1)
        if smooth is not None:
            self._check_start(alpha)
            self._check_derivatives(smooth, alpha)

    def _check_start(self, alpha: float) -> None:
        """Refuse values that are not admissible friction or load at the start of the path."""
        values = self.at(alpha)
        if not (np.all(np.isfinite(values.F)) and np.all(values.F >= 0)):
            place = int(np.argmin(np.isfinite(values.F) & (values.F >= 0)))
            node = place // (values.F.size // self.problem.p)
            raise InvalidArgumentError(
                f"SmoothPath.F gives {values.F.flat[place]:g} for contact node {self.problem.node_ids[node]} at "
                f"alpha = {alpha:g}; expected F >= 0"
            )
        if not np.all(np.isfinite(values.g)):
            raise InvalidArgumentError(f"SmoothPath.f is not finite at alpha = {alpha:g}; expected a load")

    @cached_property
    def _influence(self) -> Floats:
        """B A^{-1}, shape (2p, n), and N' of a body that nothing holds: dense, but only few rows."""
        problem = self.problem
        B = problem.contact_rows
        rows = np.empty(B.shape)
        for start in range(0, B.shape[0], RHS_BLOCK):
            block = B[start : start + RHS_BLOCK].T.toarray()
            rows[start : start + RHS_BLOCK] = problem.on_springs.factorization.solve(block).T
        return np.vstack([rows, problem.modes.N.T])

    def at(self, alpha: float) -> PathValues:
        """Values at alpha."""
        problem, smooth = self.problem, self._smooth
        (g0, dg), (F0, dF) = self._load, problem.affine_friction
        g, F = g0 + alpha * dg, F0 + alpha * dF
        if smooth is not None and smooth.F is not None and smooth.dF is not None:
            F, dF = _coefficients(smooth.F, alpha, "F", F.shape), _coefficients(smooth.dF, alpha, "dF", F.shape)
        if smooth is not None and smooth.f is not None and smooth.df is not None:
            offset = np.concatenate([problem.gap, problem.slip_offset.ravel(order="F")])
            g = self._influence @ _evaluate(smooth.f, alpha, "f", (problem.n,))
            g[: len(offset)] -= offset
            dg = self._influence @ _evaluate(smooth.df, alpha, "df", (problem.n,))
        return PathValues(g, F, dg, dF)

    @cached_property
    def frictionless(self) -> Mask:
        """Nodes, in 3D nodes and axes, with F = 0 and dF = 0 at the start, assumed to stay without friction."""
        values = self.at(self._start)
        return np.asarray((values.F == 0) & (values.dF == 0))

    def _check_derivatives(self, smooth: SmoothPath, alpha: float) -> None:
        """Compare the derivatives with central differences at the start: a wrong one stalls the corrections later."""
        # near the cube root of the rounding unit, the best step of a central difference
        step = 1e-5 * max(abs(alpha), 1.0)
        for name, function, derivative, shape, evaluate in (
            ("F", smooth.F, smooth.dF, self.problem.affine_friction[0].shape, _coefficients),
            ("f", smooth.f, smooth.df, (self.problem.n,), _evaluate),
        ):
            if function is None or derivative is None:
                continue
            given = evaluate(derivative, alpha, f"d{name}", shape)
            ahead = evaluate(function, alpha + step, name, shape)
            behind = evaluate(function, alpha - step, name, shape)
            if not np.all(np.isfinite(ahead) & np.isfinite(behind)):
                continue  # the start lies on the border of the functions' domain
            scale = max(np.max(np.abs(given)), np.max(np.abs(ahead)) / max(abs(alpha), 1.0))
            error = np.max(np.abs(given - (ahead - behind) / (2 * step)))
            # wrong formulas differ by more than this share of the size
            if error > 1e-4 * scale:
                raise InvalidArgumentError(
                    f"SmoothPath.d{name} at alpha = {alpha:g} differs by {error:.2g} from a central difference of "
                    f"{name}; expected the derivative of {name} with respect to alpha"
                )


def _evaluate(function: PathFunction, alpha: float, name: str, shape: tuple[int, ...]) -> Floats:
    what = f"the value of SmoothPath.{name} at alpha = {alpha:g}"
    value = real_array(function(alpha), what, error=InvalidArgumentError, finite=False)
    if value.shape != shape:
        raise InvalidArgumentError(
            f"SmoothPath.{name} gives shape {value.shape} at alpha = {alpha:g}; expected {shape}"
        )
    return value


def _coefficients(function: PathFunction, alpha: float, name: str, shape: tuple[int, ...]) -> Floats:
    """Coefficients of all nodes, and in 3D of both axes, also where one number, or one for every node, is given."""

    def spread(given: float) -> Floats:
        what = f"the value of SmoothPath.{name} at alpha = {given:g}"
        value = real_array(function(given), what, error=InvalidArgumentError, finite=False)
        if value.ndim == 0:
            return np.full(shape, float(value))
        return np.column_stack([value, value]) if len(shape) == 2 and value.shape == shape[:1] else value

    return _evaluate(spread, alpha, name, shape)


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
            forward, *others, _ = self.neighbours[OPEN][k]
            backward = bool(others) and not self.w(x)[self.p + i] > 0
            new = FRICTIONLESS if self.frictionless[i] else others[0] if backward else forward
        return (*codes[:i], new, *codes[i + 1 :])

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

    def statuses(self, codes: Sequence[int], slip: Floats) -> tuple[ContactStatus, ...]:
        """Names of the statuses; that of a frictionless node in contact follows from its u_t, ``slip`` (m - p,)."""
        if self.m == 2 * self.p:
            return tuple(map(contact_status, codes, slip.tolist()))
        return tuple(map(space_status, codes, slip.reshape(2, -1).T))

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
