"""The trusted kernel: exclusion inequalities and verified solves on an EnclosedSystem (theory, sections 6.2-6.4).

Everything that makes the word "complete" true for a regular problem passes through the functions of this module,
in the search and in the checker alike. Codes and row kinds are plain integers with the meaning documented in
``enumsol.trusted.status_rows``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.ball_arrays import VerifiedSolution, verified_solve
from enumsol.arithmetic.balls import ROOT_TINY, SAFE, TINY, UNIT, gamma, upper_norm
from enumsol.trusted.energy_bounds import margins
from enumsol.trusted.status_rows import (
    CONDITIONS,
    OPEN,
    SLIP_MINUS,
    SLIP_PLUS,
    STICK,
    row_signs,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from enumsol.arithmetic.balls import Array
    from enumsol.condensation.enclosure import EnclosedSystem


def exclusion_margin(
    system: EnclosedSystem, codes: Sequence[int], rows: NDArray[np.intp], values: Array, errors: float = 1.0
) -> float:
    """Proven lower bound on the energy over one partial assignment (see exclusion_margins)."""
    leaf = np.zeros(len(rows), dtype=np.intp)
    return float(exclusion_margins(system, np.array([codes], dtype=np.intp), leaf, rows, values, errors)[0])


def exclusion_margins(
    system: EnclosedSystem,
    codes: NDArray[np.intp],
    leaf: NDArray[np.intp],
    rows: NDArray[np.intp],
    values: Array,
    errors: float = 1.0,
) -> Array:
    """Proven lower bounds on the energy over partial assignments; positive means that one holds no solution.

    With multipliers that combine to y on S lambda - g and to c on lambda, v = g + c + S y and q = g + c,

        min e  >=  -1/4 v'S^{-1}v + y'g  =  1/2 y'(g - c) - 1/4 y'S y - 1/4 q'S^{-1}q

    and, for any x, q'S^{-1}q = 2 x'q - x'S x + r'S^{-1}r with r = q - S x.

    Parameters
    ----------
    system : EnclosedSystem
    codes : (m, p) array of (partial) status codes
    leaf : (k,) array, the assignment to which each multiplier belongs
    rows, values : (k,) arrays of row numbers (kind * p + node) and multipliers. A row that the assignment does not
        impose, or a multiplier of the wrong sign, makes that assignment's bound -inf.
    errors : how often the error bound is subtracted (see energy_bounds)

    Returns
    -------
    (m,) array
    """
    return margins((system,), row_signs(codes, system.F), (system.F, system.F), leaf, rows, values, errors)


@dataclass(frozen=True)
class VerifiedSelection:
    """A selection whose matrix is proven regular for all data in the enclosure, and its one solution as balls.

    Attributes
    ----------
    force, force_rad : (2p,) arrays
        lambda.
    w, w_rad : (2p,) arrays
        w = g - S lambda, exact zeros where the selection sets them.
    slack, slack_rad : arrays
        The selection's inequalities; a root needs all of them to be nonnegative.
    det_sign : int
    """

    force: Array
    force_rad: Array
    w: Array
    w_rad: Array
    slack: Array
    slack_rad: Array
    det_sign: int

    @property
    def is_root(self) -> bool:
        """All conditions hold strictly: exactly one root, regular."""
        return bool(np.all(self.slack > self.slack_rad))

    @property
    def is_excluded(self) -> bool:
        """Some condition is broken strictly: no root."""
        return bool(np.any(self.slack < -self.slack_rad))


def solve_selection(system: EnclosedSystem, codes: Sequence[int]) -> VerifiedSelection | None:
    """The verified solution of a complete selection, or None when its matrix is not proven regular."""
    with np.errstate(over="ignore", invalid="ignore"):
        return _solve_selection(system, codes)


def holds_no_root(system: EnclosedSystem, codes: Sequence[int], ball: VerifiedSelection | None) -> bool:
    """Whether a complete selection is proven to hold no root; ``ball`` is its verified solution, if it has one.

    The one criterion of the search, which writes such a leaf, and of the checker, which reads it.
    """
    return (ball is not None and ball.is_excluded) or contradicts(system, codes)


def contradicts(system: EnclosedSystem, codes: Sequence[int]) -> bool:
    """Whether the equations M z = b of a complete selection are proven to hold for no forces that a root can have.

    At a root lambda' S lambda <= g' lambda, so that ||z|| <= ||lambda|| <= ||g|| / mu with mu the smallest eigenvalue
    of S. Any vector y with |y'b| > ||M'y|| ||g|| / mu excludes that; the one tried is close to the left null vectors of
    a singular or nearly singular M. Where the equations miss a continuum of solutions by d, the margin is of order d,
    that of the energy only of order d^2.
    """
    with np.errstate(over="ignore", divide="ignore", invalid="ignore", under="ignore"):
        parts = _Equations.of(system, np.asarray(codes, dtype=np.intp))
        b, b_rad = system.g[parts.rows], system.g_rad[parts.rows]
        if not len(b) or not np.all(np.isfinite(parts.M)):
            return False
        try:
            U, sizes, _ = np.linalg.svd(parts.M)
        except np.linalg.LinAlgError:
            return False
        sizes = np.maximum(sizes / np.max(np.abs(system.S)), UNIT)
        y = U @ ((b @ U) / sizes**2)
        # its length does not matter
        y /= np.max(np.abs(y))
        y_abs, k = np.abs(y), gamma(len(b) + 2)
        least = abs(float(y @ b)) - float(y_abs @ (b_rad + k * np.abs(b))) * (1 + 2 * k) * SAFE - TINY
        product = np.abs(y @ parts.M) + y_abs @ (parts.M_rad + k * np.abs(parts.M)) * (1 + 2 * k) * SAFE
        reach = upper_norm(np.abs(system.g) + system.g_rad) / system.smallest_eigenvalue * SAFE
        return bool(least > upper_norm(product) * reach * SAFE + ROOT_TINY)


@dataclass(frozen=True)
class _Equations:
    """M z = g[rows] of a complete selection: z holds lambda_n of the closed nodes, then lambda_t of the sticking ones.

    Attributes
    ----------
    closed, across, held : int arrays
        Places of lambda_n of the closed nodes, of their lambda_t, and of lambda_t of the sticking nodes.
    slipping, uncertain : arrays
        lambda_t / lambda_n of the closed nodes as a ball.
    M, M_rad : square arrays
    """

    closed: NDArray[np.intp]
    across: NDArray[np.intp]
    held: NDArray[np.intp]
    slipping: Array
    uncertain: Array
    M: Array
    M_rad: Array

    @property
    def rows(self) -> NDArray[np.intp]:
        return np.concatenate([self.closed, self.held])

    @classmethod
    def of(cls, system: EnclosedSystem, status: NDArray[np.intp]) -> _Equations:
        p = system.p
        closed, held = np.flatnonzero(status != OPEN), p + np.flatnonzero(status == STICK)
        across = p + closed
        slip = np.where(status == SLIP_PLUS, 1.0, 0.0) - np.where(status == SLIP_MINUS, 1.0, 0.0)
        # lambda = E z: columns e_i + slip F e_(p+i), then e_(p+i) of the sticking nodes
        slipping = (slip * system.F)[closed]
        uncertain = (np.abs(slip) * system.F_rad)[closed]
        turning = np.abs(slipping)
        rows = np.concatenate([closed, held])
        S_rows, rad_rows = system.S[rows], system.S_rad[rows]
        normal, tangential = S_rows[:, closed], S_rows[:, across]
        M = np.hstack([normal + tangential * slipping, S_rows[:, held]])
        left = rad_rows[:, closed] + rad_rows[:, across] * (turning + uncertain)
        left += np.abs(tangential) * (2 * uncertain + 4 * UNIT * turning) + 4 * UNIT * np.abs(normal)
        M_rad = np.hstack([left, rad_rows[:, held]]) * SAFE + TINY
        return cls(closed, across, held, slipping, uncertain, M, M_rad)


def _solve_selection(system: EnclosedSystem, codes: Sequence[int]) -> VerifiedSelection | None:
    p, S = system.p, system.S
    status = np.asarray(codes, dtype=np.intp)
    parts = _Equations.of(system, status)
    rows, closed, across, held = parts.rows, parts.closed, parts.across, parts.held
    slipping, uncertain, M, M_rad = parts.slipping, parts.uncertain, parts.M, parts.M_rad
    turning = np.abs(slipping)
    if not len(rows):
        zero = np.zeros(2 * p)
        return _conditions(system, status, zero, zero, system.g, system.g_rad, 1)
    # scale the columns by powers of two, so that the unknowns are comparable in the contraction
    scale = np.ldexp(1.0, -np.frexp(np.max(np.abs(M), axis=0) + TINY)[1])
    # what underflows in the scaling is less than TINY
    solved = verified_solve(M * scale, M_rad * scale + TINY, system.g[rows], system.g_rad[rows])
    if solved is None:
        return None
    y, y_rad, sign = solved.y * scale, solved.radius * scale + TINY, solved.sign
    count = len(closed)
    force, force_rad = np.zeros(2 * p), np.zeros(2 * p)
    force[closed], force_rad[closed] = y[:count], y_rad[:count]
    force[across] = slipping * y[:count]
    turned = turning * y_rad[:count] + uncertain * (np.abs(y[:count]) + y_rad[:count])
    force_rad[across] = (turned + 2 * UNIT * np.abs(force[across])) * SAFE + np.where(turning > 0, TINY, 0.0)
    force[held], force_rad[held] = y[count:], y_rad[count:]
    w = system.g - S @ force
    size = gamma(2 * p + 2)
    w_rad = system.g_rad + np.abs(S) @ (force_rad + size * np.abs(force)) + system.S_rad @ (np.abs(force) + force_rad)
    w_rad = (w_rad * (1 + size) + 2 * UNIT * np.abs(w) + size * np.abs(system.g)) * SAFE + TINY
    w[rows], w_rad[rows] = 0.0, 0.0
    found = _conditions(system, status, force, force_rad, w, w_rad, sign)
    if found.is_root or found.is_excluded:
        return found
    w_rad = np.fmin(w_rad, _closer(system, parts, solved, scale, force, force_rad))
    w_rad[rows] = 0.0
    return _conditions(system, status, force, force_rad, w, w_rad, sign)


def _closer(
    system: EnclosedSystem, parts: _Equations, solved: VerifiedSolution, scale: Array, force: Array, force_rad: Array
) -> Array:
    """Radii of g - S lambda in which errors of lambda cancel: those of a solution of ill-conditioned equations do.

    With lambda = E (y + e), e = R rest + (I - R M) e: S E R is not large where S E and R are.
    """
    S, size = system.S, gamma(2 * system.p + 2)
    moved = np.hstack([S[:, parts.closed] + S[:, parts.across] * parts.slipping, S[:, parts.held]]) * scale
    product, reach = moved @ solved.inverse, np.abs(moved)
    k = gamma(moved.shape[1] + 8)
    # what rounds off in the inverse and in both products, and what is left of e
    beside = (np.abs(solved.inverse) * k + solved.rounded) @ solved.rest + solved.defect @ solved.radius
    error = (np.abs(product) @ solved.rest) * (1 + k) + (reach @ beside) * (1 + k) ** 3
    # of F, where E is a ball, and of S and g; then of g - S lambda as it is computed
    turned = np.zeros_like(force)
    turned[parts.across] = parts.uncertain * (np.abs(force[parts.closed]) + force_rad[parts.closed])
    turned[parts.across] += 4 * UNIT * np.abs(parts.slipping) * (np.abs(force[parts.closed]) + force_rad[parts.closed])
    most = np.abs(force) + force_rad
    error += system.g_rad + system.S_rad @ most + np.abs(S) @ (turned + size * most)
    return (error * (1 + size) + size * np.abs(system.g)) * SAFE * SAFE + TINY


def row_balls(
    system: EnclosedSystem, force: Array, force_rad: Array, w: Array, w_rad: Array
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Values of all rows, shape (7, p), for balls of lambda and w, and their radii."""
    p = system.p
    (n, t), (n_rad, t_rad) = force.reshape(2, p), force_rad.reshape(2, p)
    reach = system.F * n
    cone_rad = system.F * n_rad + system.F_rad * (np.abs(n) + n_rad) + t_rad
    cone_rad = (cone_rad + 4 * UNIT * (np.abs(reach) + np.abs(t))) * SAFE + TINY
    values = np.stack([n, t, reach - t, reach + t, -w[:p], w[p:], -w[p:]])
    radii = np.stack([n_rad, t_rad, cone_rad, cone_rad, w_rad[:p], w_rad[p:], w_rad[p:]])
    return values, radii


def _conditions(
    system: EnclosedSystem,
    codes: NDArray[np.intp],
    force: Array,
    force_rad: Array,
    w: Array,
    w_rad: Array,
    sign: int,
) -> VerifiedSelection:
    values, radii = row_balls(system, force, force_rad, w, w_rad)
    kinds, nodes = np.array([(kind, i) for i, code in enumerate(codes.tolist()) for kind in CONDITIONS[code][1]]).T
    return VerifiedSelection(force, force_rad, w, w_rad, values[kinds, nodes], radii[kinds, nodes], sign)
