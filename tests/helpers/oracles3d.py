"""Oracles for contact with friction in 3D, from S, g, F alone: one node in closed form, and Newton's method.

S is (3p, 3p) and g (3p,), all normals first, then both tangents; F is (p, 2); a solution is an array (3p,) like g.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Unitless:
    """w = g - S y for y = (lambda_n, tau) without units: the discs have radius lambda_n, and y' S y <= 1 at solutions.

    ``tangents`` holds, node by node, the places of its tau in y (none where the coefficient is 0).
    """

    S: np.ndarray
    g: np.ndarray
    tangents: list[list[int]]
    rows: list[int]
    forces: np.ndarray  # lambda[rows] = forces * y
    p: int

    @classmethod
    def of(cls, S, g, F):
        p = len(F)
        rows, tangents, weights = list(range(p)), [], [1.0] * p
        for i in range(p):
            tangents.append([])
            for k in range(2):
                if F[i, k] > 0:
                    tangents[i].append(len(rows))
                    rows.append((k + 1) * p + i)
                    weights.append(F[i, k])
        D = np.array(weights)
        for i in range(p):
            mine = [i, *tangents[i]]
            D[mine] *= np.exp(-0.5 * np.mean(np.log(np.diagonal(S)[[rows[j] for j in mine]] * D[mine] ** 2)))
        scaled, load = D[:, None] * S[np.ix_(rows, rows)] * D, D * g[rows]
        size = np.sqrt(load @ np.linalg.solve(scaled, load)) or 1.0
        return cls(scaled, load / size, tangents, rows, D * size, p)

    def forces_of(self, y):
        lam = np.zeros(3 * self.p)
        lam[self.rows] = self.forces * y
        return lam

    def unknowns_of(self, lam):
        return lam[self.rows] / self.forces


def violation(S, g, F, lam):
    """The largest violation of contact, disc and maximum dissipation, without units."""
    unit = Unitless.of(S, g, F)
    others = np.setdiff1d(np.arange(len(lam)), unit.rows)
    if np.any(lam[others] != 0):
        return np.inf
    y = unit.unknowns_of(lam)
    w = unit.g - unit.S @ y
    worst = 0.0
    for i, t in enumerate(unit.tangents):
        n, tau, v = y[i], y[t], w[t]
        worst = max(worst, -n, w[i], abs(n * w[i]), np.linalg.norm(tau) - n, abs(n * np.linalg.norm(v) - tau @ v))
    return float(worst)


def slack(S, g, F, lam):
    """How far a solution is from the border of its statuses, without units."""
    unit = Unitless.of(S, g, F)
    y = unit.unknowns_of(lam)
    w = unit.g - unit.S @ y
    least = np.inf
    for i, t in enumerate(unit.tangents):
        if -w[i] > y[i]:
            least = min(least, -w[i])
            continue
        n, room, v = y[i], y[i] - np.linalg.norm(y[t]), np.linalg.norm(w[t])
        least = min(least, n) if not t else min(least, n, max(room, v))
    return float(least)


def index(S, g, F, lam):
    """Sign of the Jacobian's determinant of the natural map y - P(y + w)."""
    unit = Unitless.of(S, g, F)
    _, D = _natural_map(unit, unit.unknowns_of(lam)[None], np.ones((1, unit.p)))
    return int(np.sign(np.linalg.det(D[0])))


# -- one node ----------------------------------------------------------------------------------------------------------


def one_node(S, g, F):
    """All solutions of one node as {status: [lambda, ...]}, and how near the problem is to one with another number."""
    unit = Unitless.of(S, g, F)
    S, g, m = unit.S, unit.g, len(unit.g)
    found = {"open": [], "stick": [], "slip": []}
    near = [abs(g[0])]
    if g[0] < 0:
        found["open"].append(np.zeros(3))
    y = np.linalg.solve(S, g)
    room = y[0] - np.linalg.norm(y[1:])
    near.append(abs(y[0]) if m == 1 else abs(room))
    if room > 0:
        found["stick"].append(unit.forces_of(y))
    directions = [np.array([1.0]), np.array([-1.0])] if m == 2 else []
    if m == 3:
        angles, gap = _slip_angles(S, g)
        near.append(gap)
        directions = [np.array([np.cos(phi), np.sin(phi)]) for phi in angles]
    for d in directions:
        stiffness = S[0, 0] + S[0, 1:] @ d
        if stiffness == 0:
            near.append(0.0)
            continue
        n = g[0] / stiffness
        along = d @ (g[1:] - n * (S[1:, 0] + S[1:, 1:] @ d))
        near.append(min(abs(stiffness), abs(along)))
        if n > 0 and along > 0:
            found["slip"].append(unit.forces_of(n * np.array([1.0, *d])))
    return found, min(near)


def _slip_angles(S, g):
    """Angles at which v is parallel to d, and how near two of them are to each other, or others to being real.

    Times the normal stiffness along d, the condition is a trigonometric polynomial of degree 2: a quartic in z =
    exp(i phi), which is the one in tan(phi / 2) with no direction singled out. Zeros on the unit circle are angles.
    """
    n = g[0]
    one, x, y = np.array([0, 1, 0]), np.array([0.5, 0, 0.5]), np.array([-0.5j, 0, 0.5j])  # z times 1, cos and sin
    stiffness = S[0, 0] * one + S[0, 1] * x + S[0, 2] * y
    v1 = g[1] * stiffness - n * (S[1, 0] * one + S[1, 1] * x + S[1, 2] * y)
    v2 = g[2] * stiffness - n * (S[2, 0] * one + S[2, 1] * x + S[2, 2] * y)
    quartic = np.convolve(v1, y) - np.convolve(v2, x)
    zeros = np.roots(quartic / (np.max(np.abs(quartic)) or 1.0))
    zeros = zeros[np.abs(zeros) > 1e-9]
    distance = np.abs(np.log(np.abs(zeros)))
    on_circle = distance < 1e-7
    apart = [abs(a - b) for k, a in enumerate(zeros) for b in zeros[:k]]
    near = min([*apart, *distance[~on_circle], np.inf if len(zeros) else 0.0])
    return [_polished(quartic, float(np.angle(z))) for z in zeros[on_circle]], near


def _polished(quartic, phi):
    """A zero of sum c_k exp(i k phi), k = 2 .. -2, by Newton's method from near it."""
    orders = np.arange(2, -3, -1)
    for _ in range(3):
        terms = quartic * np.exp(1j * orders * phi)
        slope = float(np.sum(1j * orders * terms).real)
        phi -= float(np.sum(terms).real) / slope if slope else 0.0
    return phi


# -- Newton's method from many starts ----------------------------------------------------------------------------------


def newton_set(S, g, F, starts, rng, steps=50):
    """Solutions that a semismooth Newton method finds from random starts, each tested by its conditions."""
    unit = Unitless.of(S, g, F)
    m, p = len(unit.g), unit.p
    y = rng.standard_normal((starts, m)) * 10.0 ** rng.uniform(-1.5, 1.5, (starts, 1))
    y[:, :p] = np.where(rng.random((starts, p)) < 0.7, np.abs(y[:, :p]), -np.abs(y[:, :p]))
    rho = 10.0 ** rng.uniform(-1.5, 1.5, (starts, p))
    found = []
    for _ in range(steps):
        H, D = _natural_map(unit, y, rho)
        size = np.linalg.norm(H, axis=1)
        done = size < 1e-13 * (1 + np.linalg.norm(y, axis=1))
        for row in y[done]:
            if all(np.max(np.abs(row - other)) > 1e-7 for other in found):
                found.append(row)
        keep = ~done & (size < 1e8)
        if not np.any(keep):
            break
        y, rho = y[keep], rho[keep]
        # a singular matrix is moved a little: only the conditions decide what is a solution
        y = y - np.linalg.solve(D[keep] + 1e-14 * np.eye(m), H[keep][:, :, None])[:, :, 0]
    solutions = [unit.forces_of(np.where(np.abs(row) > 1e-13, row, 0.0)) for row in found]
    return [lam for lam in solutions if violation(S, g, F, lam) < 1e-9]


def _natural_map(unit, y, rho):
    """H and its Jacobians for y (N, m): y - P(y + rho w), P into lambda_n >= 0 and the discs of radius lambda_n."""
    S, N, m = unit.S, *y.shape
    w = unit.g - y @ S
    H, D = y.copy(), np.broadcast_to(np.eye(m), (N, m, m)).copy()
    for i, t in enumerate(unit.tangents):
        r = rho[:, i]
        closed = y[:, i] + r * w[:, i] > 0
        H[closed, i] = -(r * w[:, i])[closed]
        D[closed, i] = r[closed, None] * S[i]
        if not t:
            continue
        radius = np.maximum(y[:, i], 0.0)
        z = y[:, t] + r[:, None] * w[:, t]
        length = np.linalg.norm(z, axis=1)
        inside = length <= radius
        e = z / np.where(length > 0, length, 1.0)[:, None]
        dz = np.eye(m)[t] - r[:, None, None] * S[t]
        turn = (np.eye(len(t)) - e[:, :, None] * e[:, None, :]) / np.where(length > 0, length, 1.0)[:, None, None]
        H[:, t] = np.where(inside[:, None], -r[:, None] * w[:, t], y[:, t] - radius[:, None] * e)
        slip = np.eye(m)[t] - radius[:, None, None] * (turn @ dz)
        slip[:, :, i] -= np.where(y[:, i] > 0, 1.0, 0.0)[:, None] * e
        D[:, t] = np.where(inside[:, None, None], r[:, None, None] * S[t], slip)
    return H, D
