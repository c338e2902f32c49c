"""The trusted bounds of a convex quadratic form from given multipliers, in floats (theory, sections 6.2 and 6.12).

Rows of a partial assignment, each times its multiplier, add up to y on S lambda - g and to c on lambda. What the
multipliers prove holds for every S, g and F in the balls.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.arithmetic.balls import ROOT_TINY, SAFE, TINY, UNIT, gamma

if TYPE_CHECKING:
    from enumsol.condensation.enclosure import EnclosedSystem
    from enumsol.support.array_types import Floats

#: Steps of refinement; forms may be hardly convex.
_REFINEMENTS = 3


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
        second = form_bounds(EnergyForm.of(system), y[short], c[short], c_rad[short], errors)
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


@dataclass(frozen=True)
class EnergyForm:
    """The energy with the fields of an EnclosedForm: H = S, h = g, k = 0."""

    system: EnclosedSystem
    H: Floats
    h: Floats
    h_rad: Floats
    inverse: Floats
    form_error: float
    smallest_eigenvalue: float
    k: float = 0.0
    k_rad: float = 0.0

    @classmethod
    def of(cls, system: EnclosedSystem) -> EnergyForm:
        """The energy of an enclosed problem."""
        own = system.inverse, system.form_error, system.smallest_eigenvalue
        return cls(system, system.S, system.g, system.g_rad, *own)


def form_bounds(form: Any, y: Floats, c: Floats, c_rad: Floats, errors: float) -> Floats:
    """Lower bounds on q for multipliers y (m, 2p) on S lambda - g and c, a ball, on lambda; as energy_bounds.

    ``form`` is an EnclosedForm, or what else has its fields.
    """
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
