"""Derivatives of the projection onto discs in boxes (theory, (12.11)), against differences of P itself."""

from fractions import Fraction

import numpy as np
import pytest

from enumsol.arithmetic.balls import Ball, gamma
from enumsol.trusted.space.natural_map import Directions, Discs, Extent

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


def around(z):
    """All points of a ball, with an argument of F that stays."""
    n = len(z.mid) + 1
    nothing = np.zeros(n)
    wide = Ball.exact(np.append(z.mid, 0.0)), Ball.exact(nothing), 0.0, Ball.exact(np.zeros((n, 0)))
    return Extent(*wide, nothing[:0], np.append(z.rad, 0.0))


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
        found = Discs(TAU, F, F1).corners(around(box))
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
    core = Discs(np.array([[1, 2]]), Ball.exact(np.ones(1)), np.zeros(1)).corners(around(box)).core
    most = np.sqrt(2) * wide / 2
    assert np.max(core.rad[1:, 0]) <= 1.01 * most
    # beta = 1 / |z_t| changes as well
    assert np.max(core.rad[1:, 1:]) <= 1.01 * (0.5 * most + 0.5 * most)


@pytest.mark.few(2, 4)
@pytest.mark.parametrize("seed", range(20))
def test_derivatives_of_nodes_that_slip_turn_as_their_rates_say(seed):
    """At z + t along + moves b + s they are the middle, t rates and no more than what else is bounded."""
    rng = np.random.default_rng([seed, 123])
    F0, F1, alpha, width = (
        rng.uniform(-0.1, 0.5, 4),
        rng.normal(size=4),
        rng.uniform(0, 0.3),
        10.0 ** rng.uniform(-3, -1),
    )
    z = np.append(rng.normal(size=M), alpha)
    z[:4] = rng.uniform(0.2, 1.0, 4)
    z[4:M] *= 3
    along, moves = rng.normal(size=M + 1), rng.normal(size=(M + 1, 5))
    half, radius, side = width, 0.3 * width * rng.uniform(0, 1, 5), 0.1 * width * rng.uniform(0, 1, M + 1)
    extent = Extent(Ball.exact(z), Ball.exact(along), half, Ball.exact(moves), radius, side)
    near = extent.near
    found = Discs(TAU, Ball.exact(F0) + near[M] * Ball.exact(F1), F1).corners(extent)
    turns, slipping = found.turns, [i for i in range(4) if i in found.turns.rows[:, 0]]
    assert slipping
    rest = found.still.rad + np.zeros((M, M + 1))
    rates = np.zeros((M, M + 1))
    for q, i in enumerate(slipping):
        rows, columns = turns.rows[q], turns.columns[q]
        assert rows[0] == i
        there = np.ix_(rows >= 0, columns >= 0)
        to = np.ix_(rows[rows >= 0], columns[columns >= 0])
        rest[to] += np.sum(turns.rest[q][:, None, None] * np.abs(turns.matrices[q]), axis=0)[there]
        rates[to] += np.sum(turns.rates[q][:, None, None] * turns.matrices[q], axis=0)[there]
    Y, Z, d = rng.normal(size=(7, M)), rng.normal(size=(M + 1, 6)), rng.normal(size=6)
    most, most_along = turns.bounds(Y, Z, d)
    for _ in range(20):
        t, b = half * rng.uniform(-1, 1), radius * rng.uniform(-1, 1, 5)
        at = z + t * along + moves @ b + side * rng.uniform(-1, 1, M + 1)
        off = derivative(at[:M], at[M], F0, F1) - found.still.mid
        own = np.array([k for i in slipping for k in (i, *TAU[i][TAU[i] >= 0])])
        assert np.all((np.abs(off - t * rates) <= rest + 1e-7)[own])
        D = np.zeros((M, M + 1))
        D[own] = off[own]
        # what is left of the second order is not in the bounds
        lost = np.abs(Y) @ (found.still.rad + 1e-7) @ np.abs(Z)
        assert np.all(np.abs(Y @ D @ Z) <= most + lost)
        assert np.all(np.abs(Y @ D @ Z @ d) <= most_along + lost @ np.abs(d))


@pytest.mark.few(2, 4)
@pytest.mark.parametrize("seed", range(30))
def test_bounds_of_what_turns_hold_in_exact_arithmetic(seed):
    rng, exact = np.random.default_rng([seed, 124]), np.vectorize(Fraction, otypes=[object])
    scale, width, half = 10.0 ** rng.uniform(-6, 6, 4), 10.0 ** rng.uniform(-9, -1), rng.choice([0.0, 1e-3])
    z = Ball(rng.normal(size=M + 1), width * rng.uniform(0, 1, M + 1))
    z.mid[:4], z.mid[4:M] = rng.uniform(0.2, 1.0, 4), 3 * z.mid[4:M]
    along, moves = Ball.exact(rng.normal(size=M + 1)), Ball.exact(rng.normal(size=(M + 1, 5)))
    extent = Extent(z, along, half, moves, width * rng.uniform(0, 1, 5), np.zeros(M + 1))
    F0, F1, near = rng.uniform(0.1, 0.5, 4), rng.normal(size=4) * 0.1, extent.near
    turns = Discs(TAU, Ball.exact(F0) + near[M] * Ball.exact(F1), F1).corners(extent).turns
    Y, Z, d = scale[0] * rng.normal(size=(3, M)), scale[1] * rng.normal(size=(M + 1, 2)), scale[2] * rng.normal(size=2)
    before, after = np.hstack([Y, np.zeros((3, 1))])[:, turns.rows], np.vstack([Z, np.zeros((1, 2))])[turns.columns]
    products = [
        [exact(before[:, q]) @ exact(matrix) @ exact(after[q]) for matrix in turns.matrices[q]]
        for q in range(len(turns.rows))
    ]
    rates, rest, lost = exact(turns.rates), exact(turns.rest), gamma(8 * 4 + 64)
    for found, last in zip(turns.bounds(Y, Z, d), (np.eye(2), d[:, None]), strict=True):
        terms = [(one @ exact(last), k, q) for q, of_node in enumerate(products) for k, one in enumerate(of_node)]
        true = sum(rest[q, k] * np.abs(one) for one, k, q in terms)
        true = true + Fraction(half) * np.abs(sum(rates[q, k] * one for one, k, q in terms))
        rounded = sum(np.abs(before[:, q]) @ turns.size[q] @ np.abs(after[q]) for q in range(len(turns.rows)))
        room = (lost * rounded @ np.abs(last)).reshape(found.shape)
        true = true.reshape(found.shape)
        assert np.all(true <= exact(found) + exact(room))
        assert np.all(exact(found) <= true * Fraction(1.0 + 1e-9) + exact(room))


def test_a_ratio_whose_changes_cancel_is_known_to_second_order():
    # friction grows as much as the normal force falls: F z_n = (1 + t) (1 - t), and |z_t| does not change
    half = 0.01
    extent = Extent(
        Ball.exact(np.array([1.0, 2.0, 0.0, 0.0])),
        Ball.exact(np.array([-1.0, 0.0, 0.0, 1.0])),
        half,
        Ball.exact(np.zeros((4, 0))),
        np.zeros(0),
        np.zeros(4),
    )
    F = Ball.exact(np.ones(1)) + extent.near[3:]
    turns = Discs(np.array([[1, 2]]), F, np.ones(1)).corners(extent).turns
    assert abs(turns.rates[0, 1]) <= 1e-15
    # by itself each of the two changes the ratio by 0.005
    assert turns.rest[0, 1] <= 4 * half**2


@np.errstate(all="ignore")
@pytest.mark.parametrize("middle", [(0.0, 0.0), (1e-200, 0.0), (3e-163, -2e-162), (0.0, 1e-12)])
def test_tangents_around_zero_may_slip(middle):
    # P has the disc of radius 0.1 there, and z_t may be ten times as long, in all directions
    z = np.array([1.0, *middle])
    box = Ball(z, np.array([0.1, 1.0, 0.5]))
    found = Discs(np.array([[1, 2]]), Ball.exact(np.full(1, 0.1)), np.zeros(1)).corners(around(box))
    # (12.11) where z_t = (1, 0) and (0, 0.5), and the identity
    for D in ([[1, 0, 0], [0.1, 0, 0], [0, 0, 0.1]], [[1, 0, 0], [0, 0.2, 0], [0.1, 0, 0]], np.eye(3)):
        assert np.all(np.abs(D - found.core.mid[:, :3]) <= found.core.rad[:, :3])
    at = Directions.of(Ball(z[None, 1:], box.rad[None, 1:]))
    assert at.least[0] <= 0
    assert at.most[0] >= np.hypot(1.0, 0.5)


@np.errstate(all="ignore")
def test_one_tangent_around_zero_may_slip():
    box = Ball(np.array([1.0, 0.0]), np.array([0.0, 1.0]))
    for places in ([1, -1], [-1, 1]):
        core = Discs(np.array([places]), Ball.exact(np.full(1, 0.1)), np.zeros(1)).corners(around(box)).core
        for slip in (-0.1, 0.1):
            assert np.all(np.abs([slip, 0.0] - core.mid[1, :2]) <= core.rad[1, :2])
