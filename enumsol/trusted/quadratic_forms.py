"""The trusted core of quadratic forms other than the energy: bounds over partial assignments (theory, section 6.12).

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

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, dense_eigenvalue_bound, gamma, upper_norm
from enumsol.trusted.status_rows import CONTACT, OPEN, SLIP_MINUS, SLIP_PLUS, STICK, UNDECIDED

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.condensation.enclosure import EnclosedSystem
    from enumsol.support.array_types import Floats


@dataclass(frozen=True)
class Equations:
    """Equations a'lambda = b of a partial assignment, for the data of an enclosure.

    Attributes
    ----------
    a, a_rad : (m, 2p) arrays
    b, b_rad : (m,) arrays
    """

    a: Floats
    a_rad: Floats
    b: Floats
    b_rad: Floats

    @classmethod
    def of(cls, system: EnclosedSystem, codes: Sequence[int]) -> Equations:
        """Equations that the statuses impose, node by node."""
        p, status = system.p, np.asarray(codes, dtype=np.intp)
        still = np.flatnonzero((status == UNDECIDED) & (system.F == 0))
        closed, held = np.flatnonzero((status != OPEN) & (status != UNDECIDED)), np.flatnonzero(status == STICK)
        separate = np.flatnonzero(status == OPEN)
        turning = np.flatnonzero((status != OPEN) & (status != STICK) & (status != CONTACT) & (status != UNDECIDED))
        # w_n = 0, w_t = 0, lambda = 0, lambda_t -+ F lambda_n = 0 (or lambda_t = 0 without friction)
        moved = np.concatenate([closed, p + held])
        forces = np.concatenate([separate, p + separate, p + still, p + turning])
        m = len(moved) + len(forces)
        a, a_rad = np.zeros((m, 2 * p)), np.zeros((m, 2 * p))
        b, b_rad = np.zeros(m), np.zeros(m)
        k = len(moved)
        a[:k], a_rad[:k], b[:k], b_rad[:k] = system.S[moved], system.S_rad[moved], system.g[moved], system.g_rad[moved]
        a[np.arange(k, m), forces] = 1.0
        slip = np.where(status == SLIP_PLUS, 1.0, 0.0) - np.where(status == SLIP_MINUS, 1.0, 0.0)
        rows = np.arange(m - len(turning), m)
        a[rows, turning] = -(slip * system.F)[turning]
        a_rad[rows, turning] = (np.abs(slip) * system.F_rad)[turning]
        return cls(a, a_rad, b, b_rad)


@dataclass(frozen=True, eq=False)
class QuadraticForm:
    """q(y) = y'H y - h'y + k for all data of an enclosure, as ``energy_bounds.form_bounds`` takes it.

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

    @cached_property
    def smallest_eigenvalue(self) -> float:
        """Proven lower bound on the smallest eigenvalue of every H; not positive when none was found."""
        with np.errstate(over="ignore", invalid="ignore"):
            if not (np.all(np.isfinite(self.H)) and np.all(np.isfinite(self.H_rad))):
                return 0.0
            return float((dense_eigenvalue_bound(self.H) - float(upper_norm(self.H_rad))) / SAFE)

    @cached_property
    def inverse(self) -> Floats:
        """Approximate inverse of H; bounds hold however accurate it is."""
        return np.asarray(np.linalg.inv(self.H))

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
    F_rad : (p,) array
        As of the system.
    """

    codes: tuple[int, ...]
    multipliers: Floats
    weight: float
    F_rad: Floats

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
        S, S_rad, g, g_rad = system.S, system.S_rad, system.g, system.g_rad
        p = system.p
        mu, nu, alpha, beta = multipliers
        one_sided = beta - alpha
        tau, s = system.F * one_sided, alpha + beta
        tau_rad = np.abs(one_sided) * system.F_rad * (1 + 4 * UNIT) + 4 * UNIT * np.abs(tau) + TINY
        left = np.concatenate([mu, nu])
        right, right_rad = np.concatenate([tau, s]), np.concatenate([tau_rad, 2 * UNIT * s])

        def combined(value: Floats, radius: Floats) -> tuple[Floats, Floats]:
            """D' applied to what has a row for every component of w."""
            shape = (-1,) + (1,) * (value.ndim - 1)
            first, second = np.concatenate([value[:p], value[:p]]), np.concatenate([value[p:], value[p:]])
            first_rad, second_rad = np.concatenate([radius[:p]] * 2), np.concatenate([radius[p:]] * 2)
            a, b, b_rad = (x.reshape(shape) for x in (left, right, right_rad))
            size = np.abs(a * first) + np.abs(b * second)
            error = 4 * UNIT * size + np.abs(a) * first_rad + (np.abs(b) + b_rad) * second_rad + b_rad * np.abs(second)
            return a * first + b * second, error * SAFE + TINY

        DS, DS_rad = combined(S, S_rad)
        h, h_rad = combined(g, g_rad)
        H = 0.5 * (DS + DS.T)
        H_rad = (0.5 * (DS_rad + DS_rad.T) + 2 * UNIT * np.abs(H)) * SAFE
        k = k_rad = 0.0
        equations = Equations.of(system, codes)
        if weight and len(equations.b):
            a, a_rad, b, b_rad = equations.a, equations.a_rad, equations.b, equations.b_rad
            a_size, b_size, error = np.abs(a), np.abs(b), gamma(len(b) + 6)
            # any positive numbers are exact weights
            factor = weight / np.maximum(np.einsum("ij,ij->i", a, a), TINY)
            weighted = factor[:, None] * a_size
            square = a.T @ (factor[:, None] * a)
            H = H + 0.5 * (square + square.T)
            across = weighted.T @ a_rad
            spread = across + across.T + a_rad.T @ (factor[:, None] * a_rad) + error * (a_size.T @ weighted)
            H_rad = (H_rad + spread * (1 + error) + 2 * UNIT * np.abs(H)) * SAFE + TINY
            turned = 2.0 * (a.T @ (factor * b))
            off = 2.0 * (weighted.T @ (b_rad + error * b_size) + a_rad.T @ (factor * (b_size + b_rad)))
            h = h + turned
            h_rad = (h_rad + off * (1 + error) + 2 * UNIT * np.abs(h)) * SAFE + TINY
            k = float(np.sum(factor * b * b))
            k_rad = float(np.sum(factor * b_rad * (2 * b_size + b_rad)) + error * k) * (1 + error) * SAFE + TINY
        return cls(system, H, H_rad, h, h_rad, k, k_rad, tuple(codes), multipliers, weight, system.F_rad)
