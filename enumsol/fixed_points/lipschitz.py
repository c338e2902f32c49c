"""How much Psi contracts, and up to which friction the solution is unique (theory, section 11.5), in floats."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
from scipy.linalg import eigh

from enumsol.condensation.factorization import RHS_BLOCK
from enumsol.errors import InvalidArgumentError
from enumsol.fixed_points.system import ContactSystem, checked_problem
from enumsol.fixed_points.tresca import node_values
from enumsol.model.problem3d import ContactProblem3D, FrictionTable, SlipMean
from enumsol.support.arguments import nonnegative_number

if TYPE_CHECKING:
    from enumsol.fixed_points.system import Problem
    from enumsol.support.array_types import Alpha, AlphaLike, ArrayLike, Floats


#: Smallest ratio of two areas.
_LEAST_SHARE = 1e-100


@dataclass(frozen=True)
class LipschitzEstimate:
    """Bounds on the Lipschitz constant of Psi at one alpha, from eigenvalues in floats (theory, section 11.5).

    Attributes
    ----------
    C1, C2 : float
        The two parts of the Lipschitz constant, (theory, (11.8)): by the slip bounds, and by the dependence of the
        coefficients on the slip [-].
    uniqueness : float
        The left-hand side of (theory, (11.9)) [-].
    factor : float
        The solution is still unique with all coefficients multiplied by less than this, if they do not depend on
        the solution; inf without friction [-].
    lipschitz, anisotropy : float
        L [1 / length] and kappa [-] as used.
    sampled : bool
        L, kappa and the largest coefficients of a friction function come from samples, and are no bounds.
    """

    C1: float
    C2: float
    uniqueness: float
    factor: float
    lipschitz: float
    anisotropy: float
    sampled: bool

    @property
    def constant(self) -> float:
        """C1 + C2: below 1 Psi contracts in the norm of (theory, section 11.5)."""
        return self.C1 + self.C2

    @property
    def contracts(self) -> bool:
        """True if Psi is known to contract; then successive approximations converge from every start."""
        return self.constant < 1.0 and not self.sampled

    @property
    def unique(self) -> bool:
        """True if uniqueness follows, and not from samples."""
        return min(self.constant, self.uniqueness) < 1.0 and not self.sampled


@dataclass(frozen=True)
class _Coefficients:
    """Over all slips: largest coefficients (p, d), Lipschitz constant [1 / length], largest ratio of F1 and F2."""

    F: Floats
    lipschitz: float = 0.0
    anisotropy: float = 1.0
    sampled: bool = False

    @property
    def per_change(self) -> float:
        """Lipschitz constant of v -> |F v| - |F' v| for F, F' of slips a unit apart (theory, section 11.5)."""
        return self.lipschitz if self.anisotropy == 1.0 else self.lipschitz * (1.0 + self.anisotropy)


@dataclass(frozen=True)
class _SlipDependence:
    """The slips that coefficients depend on, by tangential displacements at other places where they are means."""

    S_tt: Floats
    mean: SlipMean | None
    rows: sp.csr_array | None = None
    root: Floats | None = None

    @classmethod
    def of(cls, body: Problem, S_tt: Floats) -> _SlipDependence:
        """Slips of a problem; compliances are condensed to the degrees of freedom that occur in the means."""
        mean = body.slip_mean if isinstance(body, ContactProblem3D) and body.depends_on_solution else None
        if mean is None:
            return cls(S_tt, None)
        rows = sp.csr_array(sp.vstack([mean.T1, mean.T2]))
        used = np.unique(rows.indices)
        unit = sp.csc_array((np.ones(len(used)), (used, np.arange(len(used)))), shape=(body.n, len(used)))
        starts = range(0, len(used), RHS_BLOCK)
        solve = body.factorization.solve
        compliance = np.hstack([solve(unit[:, k : k + RHS_BLOCK].toarray())[used] for k in starts])
        return cls(S_tt, mean, sp.csr_array(rows[:, used]), np.linalg.cholesky(0.5 * (compliance + compliance.T)))

    def reach(self, body: ContactProblem3D, alpha: Alpha, load: float, c_inf: Floats) -> Floats:
        """Bounds on the slips of a solution, by the energy bound, shape (p,) [length]."""
        if self.mean is None or self.rows is None or self.root is None:
            return c_inf * load
        q = len(self.mean.offset)
        moved = np.sqrt(np.sum((self.rows @ self.root).reshape(2, q, -1) ** 2, axis=(0, 2)))
        u = body.condensed.displacement(alpha, np.zeros(len(self.S_tt) // 2 * 3))
        free = np.hypot(self.mean.T1 @ u - self.mean.offset[:, 0], self.mean.T2 @ u - self.mean.offset[:, 1])
        return np.asarray(self.mean.weights @ (free + moved * load))

    def largest(self, weights: Floats) -> float:
        """Largest sum of weights * slip^2 over displacements of unit energy, weights of shape (p,)."""
        if self.mean is None or self.rows is None or self.root is None:
            return _largest(_weighted(self.S_tt, np.tile(np.sqrt(weights), len(self.S_tt) // len(weights))))
        scaled = sp.diags_array(np.tile(self.mean.weights.T @ weights, 2)) @ self.rows
        return _largest(self.root.T @ (self.rows.T @ scaled).toarray() @ self.root)


def lipschitz_estimate(
    problem: Problem, alpha: AlphaLike, *, areas: ArrayLike | None = None, lipschitz: float | None = None
) -> LipschitzEstimate:
    """Bounds on the Lipschitz constant of Psi, and whether uniqueness follows (theory, section 11.5).

    Dense eigenvalue problems are solved, in a time that grows like p^3.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
    alpha : float, Fraction or str
    areas : (p,) array_like or None
        Areas m_i that the contact rows stand for [length^2]; None: those of the problem, or 1.
    lipschitz : float or None
        A Lipschitz constant of a friction function in the slip, if one is known [1 / length]; None: the largest slope
        among samples.

    Raises
    ------
    InvalidArgumentError
        An argument is not of the stated form, or alpha makes a coefficient negative.
    NotHeldError
        Nothing holds the body, so that its slips are not bounded by an energy (theory, section 14.10).

    Examples
    --------
    >>> import enumsol
    >>> estimate = enumsol.lipschitz_estimate(enumsol.gallery.one_node_triangle(), alpha=0.5)
    >>> estimate.unique, round(estimate.C1, 3), round(0.5 * estimate.factor, 3)  # unique for F below that
    (True, 0.577, 0.866)
    """
    body = checked_problem(problem)
    body.check_held("lipschitz_estimate", "whose slips no energy bounds")
    p = body.p
    known = body.areas if areas is None and isinstance(body, ContactProblem3D) else areas
    m = np.ones(p) if known is None else _relative(node_values(known, "areas", p))
    given = None if lipschitz is None else nonnegative_number(lipschitz, "lipschitz")
    system = ContactSystem.at(body, alpha)
    S = body.condensed.S
    g = body.condensed.free_displacements(system.alpha)
    d = system.tangents
    # S is inverted in units in which its diagonal is near 1
    units = np.tile(np.sqrt(system.force / system.length), 1 + d)
    inverse = _weighted(np.asarray(np.linalg.inv(system.S), dtype=np.float64), units)
    inverse_nn, S_tt = inverse[:p, :p], S[p:, p:]
    load = max(float(g @ inverse @ g), 0.0) ** 0.5
    blocks = S_tt.reshape(d, p, d, p)[:, np.arange(p), :, np.arange(p)]
    c_inf = np.sqrt(np.linalg.eigvalsh(blocks)[:, -1])

    slips = _SlipDependence.of(body, S_tt)
    reach = slips.reach(body, system.alpha, load, c_inf) if isinstance(body, ContactProblem3D) else c_inf * load
    used = _coefficients(system, reach, given)
    most_F = float(np.max(used.F)) or 1.0  # taken out, so that squares of tiny coefficients do not underflow
    F = used.F / most_F
    C1 = most_F * min(_force_part(inverse_nn, S_tt, F, theta) for theta in _weights(inverse_nn, blocks, F, m))
    C2 = second = 0.0
    if used.lipschitz > 0:
        c_0 = np.sqrt(_largest(inverse_nn / np.sqrt(np.outer(m, m))))
        c_phi = np.sqrt(slips.largest(m))
        C2 = float(used.per_change * c_0 * np.max(c_inf) * c_phi * load)
        most = np.sqrt(np.diagonal(inverse_nn)) * load
        both = slips.largest(most) * _largest(_weighted(S_tt, np.tile(np.sqrt(most), d)))
        second = float(used.per_change * np.sqrt(both))
    return LipschitzEstimate(
        C1=C1,
        C2=C2,
        uniqueness=C1 + second,
        factor=float("inf") if C1 == 0 else 1.0 / C1,
        lipschitz=used.lipschitz,
        anisotropy=used.anisotropy,
        sampled=used.sampled,
    )


def _relative(areas: Floats) -> Floats:
    """Areas as shares of the largest: a factor of all of them has no effect."""
    shares = areas / np.max(areas) if np.all(areas > 0) else np.zeros(1)
    if np.min(shares) < _LEAST_SHARE:
        raise InvalidArgumentError(
            f"areas has the values {np.min(areas):g} to {np.max(areas):g}; expected areas > 0, the smallest at least "
            f"{_LEAST_SHARE:g} of the largest"
        )
    return np.asarray(shares)


def _force_part(inverse_nn: Floats, S_tt: Floats, F: Floats, theta: Floats) -> float:
    """c_n c_t of (theory, (11.6)) for weights theta of shape (p,)."""
    c_n = _largest(_weighted(inverse_nn, theta))
    c_t = _largest(_weighted(S_tt, (F / theta[:, None]).ravel(order="F")))
    return float(np.sqrt(c_n * c_t))


def _weights(inverse_nn: Floats, blocks: Floats, F: Floats, m: Floats) -> list[Floats]:
    """Weights theta to choose from (theory, section 11.5), of shape (p,) each."""
    tangential = np.max(F**2 * np.diagonal(blocks, axis1=1, axis2=2), axis=1)
    balanced = (np.maximum(tangential, 1e-12 * np.max(tangential)) / np.diagonal(inverse_nn)) ** 0.25
    return [1.0 / np.sqrt(m), balanced] if np.any(tangential) else [1.0 / np.sqrt(m)]


def _coefficients(system: ContactSystem, reach: Floats, lipschitz: float | None) -> _Coefficients:
    """Coefficients as (theory, section 11.5) needs them, for slips up to ``reach`` of shape (p,) [length]."""
    body = system.problem
    if not isinstance(body, ContactProblem3D):
        return _Coefficients(body.friction_at(system.alpha)[:, None])
    if isinstance(body.law, FrictionTable):
        slips = np.tile(body.law.slip, (body.p, 1)).T
    else:
        slips = np.linspace(0.0, 1.0, 257 if body.depends_on_solution else 2)[:, None] * reach
    F = np.array([body.coefficients(system.alpha, slip) for slip in slips])
    most, least = np.max(F, axis=0), np.min(F, axis=0)
    ratio = float(np.max(np.max(F, axis=2) / np.maximum(np.min(F, axis=2), 1e-300)))
    if not body.depends_on_solution:
        return _Coefficients(most, anisotropy=ratio)
    step = np.diff(slips, axis=0)[:, :, None]
    if isinstance(body.law, FrictionTable) or lipschitz is None:
        slope = float(np.max(np.abs(np.diff(F, axis=0)) / np.where(step > 0, step, np.inf), initial=0.0))
        return _Coefficients(most, slope, ratio, sampled=not isinstance(body.law, FrictionTable))
    slope = lipschitz
    between = 0.5 * slope * np.max(step, axis=0)
    most, least = most + between, np.maximum(least - between, 1e-300)
    return _Coefficients(most, slope, float(np.max(np.max(most, axis=1) / np.min(least, axis=1))))


def _weighted(matrix: Floats, weights: Floats) -> Floats:
    return np.asarray(weights[:, None] * matrix * weights[None, :])


def _largest(matrix: Floats) -> float:
    """Largest eigenvalue of a symmetric positive semidefinite matrix."""
    last = len(matrix) - 1
    return max(float(eigh(matrix, eigvals_only=True, subset_by_index=(last, last))[0]), 0.0)
