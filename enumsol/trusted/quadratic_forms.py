"""The trusted core of convex quadratic forms: what given multipliers prove (theory, sections 6.1, 6.2 and 6.12).

Rows of a partial assignment, each times its multiplier, add up to y on S lambda - g and to c on lambda. What the
multipliers prove of the energy, or of another form, holds for every S, g and F in the balls. Other forms are these.

At every solution lambda_n w_n = 0, lambda_t w_n = 0, (lambda_t - F lambda_n) w_t >= 0 and (lambda_t + F lambda_n) w_t
>= 0, node by node. With multipliers mu, nu and alpha, beta >= 0 of a node, D maps its (lambda_n, lambda_t) to
(mu lambda_n + nu lambda_t, F (beta - alpha) lambda_n + (alpha + beta) lambda_t), and

    q = (D lambda)'(S lambda - g) + sum of weight (a'lambda - b)^2 over the equations of a partial assignment

is at most zero at every solution in it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.balls import ROOT_TINY, SAFE, TINY, UNIT, Ball, gamma, least_eigenvalue, upper_norm
from enumsol.trusted.selection import Numbers, joined
from enumsol.trusted.status_rows import CONTACT, OPEN, SLIP_MINUS, SLIP_PLUS, STICK, UNDECIDED

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.condensation.enclosure import EnclosedSystem
    from enumsol.support.array_types import Floats

#: Steps of refinement; forms may be hardly convex.
_REFINEMENTS = 3


def equations_of(system: EnclosedSystem, codes: Sequence[int]) -> tuple[Ball, Ball]:
    """Equations a'lambda = b that the statuses of a partial assignment impose, for the data of an enclosure.

    Returns
    -------
    a, b : Ball (m, 2p) and Ball (m,)
    """
    p, status = system.p, np.asarray(codes, dtype=np.intp)
    still = np.flatnonzero((status == UNDECIDED) & (system.F == 0))
    closed, held = np.flatnonzero((status != OPEN) & (status != UNDECIDED)), np.flatnonzero(status == STICK)
    separate = np.flatnonzero(status == OPEN)
    turning = np.flatnonzero((status != OPEN) & (status != STICK) & (status != CONTACT) & (status != UNDECIDED))
    # w_n = 0, w_t = 0, lambda = 0, lambda_t -+ F lambda_n = 0 (or lambda_t = 0 without friction)
    moved = np.concatenate([closed, p + held])
    forces = np.concatenate([separate, p + separate, p + still, p + turning])
    k, m = len(moved), len(moved) + len(forces)
    a, b = Ball.exact(np.zeros((m, 2 * p))), Ball.exact(np.zeros(m))
    a[:k], b[:k] = Ball(system.S[moved], system.S_rad[moved]), Ball(system.g[moved], system.g_rad[moved])
    a[np.arange(k, m), forces] = 1.0
    side = (np.where(status == SLIP_MINUS, 1.0, 0.0) - np.where(status == SLIP_PLUS, 1.0, 0.0))[turning]
    F = Ball(side * system.F[turning], np.abs(side) * system.F_rad[turning])
    a[np.arange(m - len(turning), m), turning] = F
    return a, b


def multiplied(rows: Numbers, F: Numbers, multipliers: Numbers) -> Numbers:
    """D' applied to a row for every component of w, (2p, k), with multipliers (4, p); all of them floats or balls."""
    p, (mu, nu, alpha, beta) = F.shape[0], (multipliers[k] for k in range(4))
    left, right, twice = joined(mu, nu), joined(F * (beta - alpha), alpha + beta), np.tile(np.arange(p), 2)
    found: Numbers = rows[twice] * left[:, None] + rows[p + twice] * right[:, None]
    return found


@dataclass(frozen=True, eq=False)
class QuadraticForm:
    """q(y) = y'H y - h'y + k for all data of an enclosure; what follows from S alone is that of the system.

    Attributes
    ----------
    system : EnclosedSystem, in 3D EnclosedSpace
        m components of y.
    H, H_rad : (m, m) arrays, H symmetric
    h, h_rad : (m,) arrays
    k, k_rad : float
    """

    system: EnclosedSystem
    H: Floats
    H_rad: Floats
    h: Floats
    h_rad: Floats
    k: float
    k_rad: float

    @classmethod
    def energy(cls, system: EnclosedSystem) -> QuadraticForm:
        """The energy: H = S, h = g, k = 0."""
        return QuadraticForm(system, system.S, system.S_rad, system.g, system.g_rad, 0.0, 0.0)

    @cached_property
    def smallest_eigenvalue(self) -> float:
        """Proven lower bound on the smallest eigenvalue of every H; not positive when none was found."""
        if self.H is self.system.S:
            return self.system.smallest_eigenvalue
        with np.errstate(over="ignore", invalid="ignore"):
            return least_eigenvalue(Ball(self.H, self.H_rad))

    @cached_property
    def inverse(self) -> Floats:
        """Approximate inverse of H; bounds hold however accurate it is."""
        return self.system.inverse if self.H is self.system.S else np.asarray(np.linalg.inv(self.H))

    @cached_property
    def form_error(self) -> float:
        """kappa with |fl(x'H x) - x'H x| <= kappa ||x||^2 for every H."""
        size = 4 * len(self.h) + 4
        return float((upper_norm(self.H_rad) + gamma(size) * upper_norm(self.H)) * SAFE)


@dataclass(frozen=True, eq=False)
class EnclosedForm(QuadraticForm):
    """The form of a partial assignment in 2D; y is lambda, m = 2p.

    Attributes
    ----------
    codes : (partial) status codes whose equations enter
    multipliers : (4, p) array
        mu, nu, alpha and beta of every node.
    weight : float
        That of the equations.
    """

    codes: tuple[int, ...]
    multipliers: Floats
    weight: float

    @property
    def F_rad(self) -> Floats:  # noqa: N802 (the field's letter)
        """Radius of F, that of the system."""
        return self.system.F_rad

    @classmethod
    def of(cls, system: EnclosedSystem, codes: Sequence[int], multipliers: Floats, weight: float) -> EnclosedForm:
        """The form of a partial assignment.

        Parameters
        ----------
        system : EnclosedSystem
        codes : (partial) status codes whose equations enter
        multipliers : (4, p) array
            mu, nu, alpha and beta; the last two are at least zero.
        weight : float
            That of the equations, at least zero; each is divided by the square of its length.
        """
        numbers, F, k = Ball.exact(multipliers), Ball(system.F, system.F_rad), Ball.exact(np.zeros((1, 1)))
        form = multiplied(Ball(system.S, system.S_rad), F, numbers)
        h = multiplied(Ball(system.g, system.g_rad)[:, None], F, numbers)[:, 0]
        a, b = equations_of(system, codes)
        if weight and len(b.mid):
            # any positive numbers are exact weights
            factor = Ball.exact(weight / np.maximum(np.einsum("ij,ij->i", a.mid, a.mid), TINY))
            weighted = a * factor[:, None]
            form, h = form + weighted.T @ a, h + ((weighted + weighted).T @ b[:, None])[:, 0]
            k = (b * factor)[None] @ b[:, None]
        H = 0.5 * (form.mid + form.mid.T)
        H_rad = (0.5 * (form.rad + form.rad.T) + 2 * UNIT * np.abs(H)) * SAFE
        constant = float(k.mid[0, 0]), float(k.rad[0, 0])
        return cls(system, H, H_rad, h.mid, h.rad, *constant, tuple(codes), multipliers, weight)


def energy_bounds(
    system: EnclosedSystem, y: Floats, c: Floats, c_rad: Floats, errors: float = 1.0, enough: float = 0.0
) -> Floats:
    """Lower bounds on the energy for multipliers y (m, 2p) on S lambda - g and c, a ball, on lambda.

    By theory, (6.2); where that proves nothing, by (6.1), which loses less to large multipliers: with v = g + c + S y
    and any x, e >= y'g - (2 x'v - x'S x + r'S^{-1}r) / 4, r = v - S x.

    ``errors`` is how often the error bound is subtracted: once proves the bound. A writer of proofs subtracts it twice,
    so that a checker, which sums in another order, finds a positive bound too. The second bound is not sought where the
    first one is more than ``enough``.
    """
    bounds = _energy_bounds(system, y, c, c_rad, errors)
    short = np.flatnonzero(~(bounds > enough))
    if len(short):
        second = form_bounds(QuadraticForm.energy(system), y[short], c[short], c_rad[short], errors)
        bounds[short] = np.fmax(bounds[short], second)
    return bounds


def _energy_bounds(system: EnclosedSystem, y: Floats, c: Floats, c_rad: Floats, errors: float) -> Floats:
    """Lower bounds of the energy by theory, (6.2) and (6.3)."""
    S, g = system.S, system.g
    # every inner product of up to 2p terms below is off by at most k times that of the absolute values
    k = gamma(4 * len(g) + 16)
    q = g + c
    q_abs, y_abs = np.abs(q), np.abs(y)
    q_rad = (system.g_rad + c_rad + 2 * UNIT * q_abs) * SAFE
    # Any x is a choice; a good one needs S x near q, which a computed inverse gives from the left, not its transpose.
    # The step of refinement makes a checker's bound better than that of the search, which does without.
    x = q @ system.inverse.T
    x += (q - x @ S) @ system.inverse.T
    Sx, Sy = x @ S, y @ S
    first, cross = dots(y, g - c), dots(x, q)
    y_form, x_form = dots(y, Sy), dots(x, Sx)
    first_error = dots(y_abs, k * (np.abs(g) + np.abs(c)) + system.g_rad + c_rad)
    cross_error = dots(np.abs(x), k * q_abs + q_rad)
    y_lost, x_lost, rest = _lost(system.form_error, y), _lost(system.form_error, x), q - Sx
    rest_norm = np.sqrt(dots(rest, rest)) + np.sqrt(dots(q_rad, q_rad)) + k * np.sqrt(dots(q, q))
    rest_norm = (rest_norm + np.sqrt(system.form_error * x_lost) + ROOT_TINY) * (1 + k) * SAFE
    tail = rest_norm * rest_norm / system.smallest_eigenvalue
    total = 0.5 * first - 0.25 * y_form - 0.5 * cross + 0.25 * x_form
    error = 0.5 * (first_error + cross_error) + 0.25 * (y_lost + x_lost + tail)
    error += 8 * UNIT * (np.abs(first) + np.abs(y_form) + np.abs(cross) + np.abs(x_form))
    return np.asarray(total - errors * error * (1 + k) * SAFE * SAFE - TINY)


def form_bounds(form: QuadraticForm, y: Floats, c: Floats, c_rad: Floats, errors: float) -> Floats:
    """Lower bounds on q for multipliers y (m, 2p) on S lambda - g and c, a ball, on lambda; as energy_bounds."""
    S, S_rad, g, g_rad = form.system.S, form.system.S_rad, form.system.g, form.system.g_rad
    k = gamma(4 * len(g) + 16)
    y_abs = np.abs(y)
    v = form.h + c + y @ S
    size = np.abs(form.h) + np.abs(c) + y_abs @ np.abs(S)
    v_rad = (form.h_rad + c_rad + y_abs @ S_rad + k * size) * (1 + k) * SAFE
    x = v @ form.inverse.T
    # until the rest is that of rounding, which its bound covers: a checker, which adds up in another order, then finds
    # nearly the same
    for _ in range(_REFINEMENTS):
        x += (v - x @ form.H) @ form.inverse.T
    Hx = x @ form.H
    x_abs, rest = np.abs(x), v - Hx
    x_lost, cross, x_form, first = _lost(form.form_error, x), dots(x, v), dots(x, Hx), y @ g
    rest_norm = np.sqrt(dots(rest, rest)) + np.sqrt(dots(v_rad, v_rad)) + k * np.sqrt(dots(v, v))
    rest_norm = (rest_norm + np.sqrt(form.form_error * x_lost) + ROOT_TINY) * (1 + k) * SAFE
    tail = rest_norm * rest_norm / form.smallest_eigenvalue
    total = form.k + first - 0.5 * cross + 0.25 * x_form
    error = form.k_rad + y_abs @ (g_rad + k * np.abs(g)) + 0.5 * dots(x_abs, v_rad + k * np.abs(v))
    error += 0.25 * (x_lost + tail)
    error += 8 * UNIT * (abs(form.k) + np.abs(first) + np.abs(cross) + np.abs(x_form))
    return np.asarray(total - errors * error * (1 + k) * SAFE * SAFE - TINY)


def _lost(form_error: float, x: Floats) -> Floats:
    """By how much computed x'S x may be off; |x|^2 may underflow where S is large."""
    scaled = np.sqrt(form_error) * x
    return np.asarray(dots(scaled, scaled) * SAFE + TINY)


def dots(a: Floats, b: Floats) -> Floats:
    """Inner products of the rows of two arrays."""
    return np.asarray(np.vecdot(a, b))
