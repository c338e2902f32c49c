"""Deflated semismooth Newton from many starts.

The equation is theory, (1.5), in the condensed forces without units. It is multiplied by the product over all roots
found of 1 + 1 / |x - root|^2, so that a start does not lead to one of them again; a Newton step of the product is a
multiple of that of the equation (P. E. Farrell, A. Birkisson, S. W. Funke, SIAM J. Sci. Comput. 37 (2015) A2026).
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from enumsol.condensation.condensed import ScaledSystem

#: A step stops at this residual, and a start at this many steps or this far out; forces are of size one.
RESIDUAL, STEPS, FAR = 1e-10, 100, 1e6
#: Points nearer than this are one.
APART = 1e-6


def residual_and_jacobian(system: ScaledSystem, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """H and an element of its generalized Jacobian at forces x (2p,)."""
    p, S, F = system.p, system.S, system.F
    n, t, w = x[:p], x[p:], system.g - S @ x
    y, bound = t + w[p:], F * n
    closed, upper, lower = n + w[:p] > 0, y > bound, y < -bound
    projected = np.minimum(bound, y) + np.maximum(-bound, y) - y
    value = np.concatenate([np.where(closed, -w[:p], n), t - projected])
    eye = np.eye(p)
    normal = np.where(closed[:, None], S[:p], np.hstack([eye, 0 * eye]))
    # t - projected: one bound for each of the two that y has passed, and y itself as often as is left
    slip = upper.astype(float) - lower.astype(float)
    times = 1.0 - upper - lower
    trial = np.hstack([0 * eye, eye]) - S[p:]
    tangential = np.hstack([-np.diag(slip * F), eye]) - times[:, None] * trial
    return value, np.vstack([normal, tangential])


def solve(system: ScaledSystem, x: np.ndarray, roots: list[np.ndarray]) -> np.ndarray | None:
    """A zero of the deflated equation from x, or None."""
    for _ in range(STEPS):
        value, jacobian = residual_and_jacobian(system, x)
        if np.max(np.abs(value)) <= RESIDUAL:
            return x
        try:
            step = np.linalg.solve(jacobian, -value)
        except np.linalg.LinAlgError:
            return None
        turn = 0.0
        for root in roots:
            away = x - root
            square = away @ away
            turn -= 2.0 * (away @ step) / (square * (square + 1.0)) if square else np.inf
        x = x + step / (1.0 - turn)
        if not np.max(np.abs(x)) < FAR:
            return None
    return None


def deflated_newton(system: ScaledSystem, starts: int, in_vain: int, seed: int = 0) -> tuple[list[np.ndarray], float]:
    """Forces (2p,) with units, from zero and from random points of the ellipsoid of theory, (5.3).

    Ends after ``in_vain`` starts in a row without a new root; second comes the CPU time until the last one.
    """
    started, last, vain = time.process_time(), 0.0, 0
    rng = np.random.default_rng(seed)
    centre = 0.5 * np.linalg.solve(system.S, system.g)
    radius = np.sqrt(0.5 * (system.g @ centre))
    roots: list[np.ndarray] = []
    for k in range(starts):
        ball = rng.normal(size=len(centre))
        ball *= rng.uniform() ** (1.0 / len(ball)) / np.linalg.norm(ball)
        x = centre + radius * np.linalg.solve(system.cholesky.T, ball) if k else np.zeros(len(centre))
        found = solve(system, x, roots)
        if found is not None and all(np.max(np.abs(found - root)) > APART for root in roots):
            roots.append(found)
            last, vain = time.process_time() - started, 0
        else:
            vain += 1
        if vain == in_vain:
            break
    return [system.force * root for root in roots], last
