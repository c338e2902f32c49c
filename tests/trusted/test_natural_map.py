"""Derivatives of the projection onto discs in boxes (theory, (12.12) and (12.17)), against differences of P itself."""

import numpy as np
import pytest

from enumsol.arithmetic.balls import Ball
from enumsol.trusted.space.natural_map import Discs

#: Nodes with two tangents, and with one of either direction.
TAU = np.array([[4, 8], [5, 9], [6, -1], [-1, 7]])
M = 12
_STEPS = 1e-6 * np.eye(M + 1), -1e-6 * np.eye(M + 1)


def projected(z, F):
    """By the definition; a negative radius as theory, section 12.8, has it."""
    out = np.zeros(M)
    for i, places in enumerate(TAU):
        t = places[places >= 0]
        out[i] = max(z[i], 0.0)
        most, length = F[i] * out[i], np.linalg.norm(z[t])
        out[t] = z[t] if length <= most else most * z[t] / length
    return out


def derivative(z, alpha, F0, F1):
    """Central differences, (M, M + 1)."""
    sides = [[projected(y[:M], F0 + y[M] * F1) for y in np.append(z, alpha) + step] for step in _STEPS]
    return np.transpose(np.subtract(*sides)) / 2e-6


def is_smooth(z, F, by=1e-4):
    """Whether no status changes near a point."""
    sizes = [np.linalg.norm(z[places[places >= 0]]) for places in TAU]
    return all(abs(z[i]) > by and abs(size - F[i] * max(z[i], 0.0)) > by for i, size in enumerate(sizes))


@pytest.mark.few(2, 4)
@pytest.mark.parametrize("seed", range(30))
def test_derivatives_lie_in_the_hull_of_their_box(seed):
    rng = np.random.default_rng([seed, 121])
    F0, F1 = rng.uniform(-0.2, 1.0, 4), rng.normal(size=4)
    width, kinds = 10.0 ** rng.uniform(-2, -0.3), 0
    for _ in range(5):
        z, alpha = rng.normal(size=M), rng.uniform(0, 0.3)
        z[:4] += 0.5
        box = Ball(z, width * rng.uniform(0, 1, M))
        reach = 0.1 * width
        F = Ball(F0 + alpha * F1, np.abs(F1) * reach + 1e-15)
        found = Discs(TAU, F, Ball.exact(F1)).corners(box)
        if found is None:
            continue
        kinds += 1
        for _ in range(5):
            at, there = z + box.rad * rng.uniform(-1, 1, M), alpha + reach * rng.uniform(-1, 1)
            if not is_smooth(at, F0 + there * F1):
                continue
            off = derivative(at, there, F0, F1) - found.core.mid
            # of every node by itself
            for i, places in enumerate(TAU):
                rows = [i, *places[places >= 0]]
                own = [k for k in range(found.u.shape[1]) if np.any(found.u[rows, k])]
                assert len(own) <= 1
                term = sum((np.outer(found.u[rows, k], found.v[:, k]) for k in own), np.zeros((len(rows), M + 1)))
                beyond = min(np.max(np.abs(off[rows] - t * term) - found.core.rad[rows]) for t in (-0.5, 0.0, 0.5))
                assert beyond <= 1e-7
    assert kinds >= 2


@pytest.mark.parametrize("seed", range(3))
def test_directions_of_a_narrow_box_are_bounded_to_first_order(seed):
    # one node that slips, pushed aside by a small angle: derivatives turn by that angle and not by more
    rng = np.random.default_rng([seed, 122])
    angle, wide = rng.uniform(0, 2 * np.pi), 1e-3
    z = np.array([1.0, 2 * np.cos(angle), 2 * np.sin(angle)])
    box = Ball(z, np.array([0.0, wide, wide]))
    core = Discs(np.array([[1, 2]]), Ball.exact(np.ones(1))).corners(box).core
    most = np.sqrt(2) * wide / 2
    assert np.max(core.rad[1:, 0]) <= 1.01 * most
    # beta = 1 / |z_t| changes as well
    assert np.max(core.rad[1:, 1:]) <= 1.01 * (0.5 * most + 0.5 * most)
