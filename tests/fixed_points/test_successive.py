"""Successive approximations against solutions known otherwise, and how a run that does not converge is told."""

import re
import warnings

import numpy as np
import pytest
from alike import assert_close, assert_same
from complete import limit_of, read_back
from effort import some
from interruptions import CtrlC, interrupted
from problems3d import from_compliance, random_compliance, violations
from refusals import bad_argument, bad_problem
from scipy.optimize import brentq

import enumsol
from enumsol.fixed_points import FixedPoint, Outcome, TrescaNotSolved, successive
from enumsol.fixed_points.successive import AndersonMixing

# a public test of the contact community: u = W r + q, normal first, r_n >= 0, u_n >= 0; here w = -u, so g = -q, S = W
W = np.array([[15.0, -1.0, -2.0], [-1.0, 14.0, 1.0], [-2.0, 1.0, 16.0]])
Q = np.array([-1.0, 2.0, 3.0])
PUBLIC = from_compliance(W, -Q, 0.1)


def test_the_public_one_contact_problem():
    found = limit_of(PUBLIC, 0)
    reaction = np.concatenate([found.lambda_n, found.lambda_t[0]])
    velocity = W @ reaction + Q
    # sliding, by hand: u_n = 0, |r_t| = F r_n, and r_t points against u_t
    assert reaction[0] > 0
    assert abs(velocity[0]) < 1e-12
    np.testing.assert_allclose(np.hypot(*reaction[1:]), 0.1 * reaction[0], rtol=1e-9)
    np.testing.assert_allclose(reaction[1:] / np.hypot(*reaction[1:]), -velocity[1:] / np.hypot(*velocity[1:]))

    # the direction alone, found by bisection: r_n(phi) from u_n = 0, then u_t along -d(phi)
    def turned(phi):
        d = np.array([np.cos(phi), np.sin(phi)])
        r_n = -Q[0] / (W[0, 0] + 0.1 * W[0, 1:] @ d)
        u_t = W[1:, 0] * r_n + 0.1 * r_n * W[1:, 1:] @ d + Q[1:]
        return u_t[0] * d[1] - u_t[1] * d[0]

    phi = brentq(turned, np.pi, 1.5 * np.pi)
    r_n = -Q[0] / (W[0, 0] + 0.1 * W[0, 1:] @ (np.cos(phi), np.sin(phi)))
    np.testing.assert_allclose(reaction, r_n * np.array([1.0, 0.1 * np.cos(phi), 0.1 * np.sin(phi)]), rtol=1e-8)


def limits(*problems):
    """What successive approximations end with at alpha = 0."""
    return [enumsol.successive_approximations(problem, 0) for problem in problems]


@pytest.mark.slow
def test_random_problems_satisfy_the_equations(rng):
    converged = 0
    for _ in range(count := some(20, of=60)):
        p = int(rng.integers(1, 6))
        S, g = random_compliance(rng, p), rng.normal(size=3 * p)
        F = rng.uniform(0.0, 0.6, (p, 2)) * (rng.random((p, 2)) > 0.1)
        found = enumsol.successive_approximations(from_compliance(S, g, (F[:, 0], F[:, 1])), 0)
        if found.converged:
            converged += 1
            assert max(violations(S, g, F, found.lambda_n, found.lambda_t)) < 1e-8
            assert max(found.residuals.values()) < 1e-8
        else:
            assert found.why.startswith("not converged")
    assert converged > 5 * count / 6


def test_turning_the_axes_of_every_node_changes_nothing(rng):
    p = 4
    S, g, F = random_compliance(rng, p), rng.normal(size=3 * p), rng.uniform(0.0, 0.4, p)
    R = np.eye(3 * p)
    for i, (c, s) in enumerate((np.cos(t), np.sin(t)) for t in rng.uniform(0, 2 * np.pi, p)):
        R[np.ix_([p + i, 2 * p + i], [p + i, 2 * p + i])] = [[c, s], [-s, c]]
    one, other = limits(from_compliance(S, g, (F, F)), from_compliance(R @ S @ R.T, R @ g, (F, F)))
    np.testing.assert_allclose(other.forces, R @ one.forces, atol=1e-9)


def test_a_quarter_turn_exchanges_orthotropic_coefficients(rng):
    p = 3
    S, g, F = random_compliance(rng, p), rng.normal(size=3 * p), rng.uniform(0.0, 0.4, (p, 2))
    turned = np.concatenate([np.arange(p), np.arange(2 * p, 3 * p), np.arange(p, 2 * p)])
    other = from_compliance(S[np.ix_(turned, turned)], g[turned], (F[:, 1], F[:, 0]))
    one, other = limits(from_compliance(S, g, (F[:, 0], F[:, 1])), other)
    np.testing.assert_allclose(other.forces, one.forces[turned], atol=1e-9)


def test_permuted_nodes(rng):
    p = 4
    S, g, F = random_compliance(rng, p), rng.normal(size=3 * p), rng.uniform(0.0, 0.4, p)
    order = rng.permutation(p)
    rows = np.concatenate([order, p + order, 2 * p + order])
    permuted = from_compliance(S[np.ix_(rows, rows)], g[rows], (F[order], F[order]))
    one, other = limits(from_compliance(S, g, (F, F)), permuted)
    np.testing.assert_allclose(other.lambda_n, one.lambda_n[order], atol=1e-10)


def test_friction_that_depends_on_the_slip(rng):
    p = 3
    S, g = random_compliance(rng, p), rng.normal(size=3 * p)

    def friction(node, slip):
        return 0.2 + 0.1 * np.exp(-slip), 0.1 + 0.02 * node / (1.0 + slip)

    found = limit_of(from_compliance(S, g, friction), 0)
    slip = np.hypot(*found.u_t.T)
    np.testing.assert_allclose(found.slip, slip)
    F = np.array([friction(i, s) for i, s in enumerate(slip)])
    np.testing.assert_allclose(found.coefficients, F, atol=1e-8)
    assert max(violations(S, g, F, found.lambda_n, found.lambda_t)) < 1e-8
    # frozen at the limit the coefficients give the same solution
    frozen = enumsol.successive_approximations(from_compliance(S, g, (F[:, 0], F[:, 1])), 0)
    np.testing.assert_allclose(frozen.forces, found.forces, atol=1e-7)


def test_a_table_is_the_function_it_samples(rng):
    S, g = random_compliance(rng, 2), rng.normal(size=6)
    table = enumsol.FrictionTable([0.0, 0.5, 2.0], [0.4, 0.3, 0.1], [0.2, 0.2, 0.1])

    def function(node, slip):
        return tuple(np.interp(slip, [0.0, 0.5, 2.0], column) for column in ([0.4, 0.3, 0.1], [0.2, 0.2, 0.1]))

    one, other = limits(*(from_compliance(S, g, F) for F in (table, function)))
    np.testing.assert_allclose(one.forces, other.forces, atol=1e-10)


def test_friction_and_load_at_alpha(rng):
    S, g, slope = random_compliance(rng, 2), rng.normal(size=6), rng.normal(size=6)
    A = np.linalg.inv(S)
    problem = from_compliance(S, g, (0.1, 0.2), friction_slope=(0.3, 0.1), load_slope=A @ slope)
    same = from_compliance(S, g + 0.5 * slope, (0.25, 0.25))
    one, other = enumsol.successive_approximations(problem, 0.5), enumsol.successive_approximations(same, 0)
    np.testing.assert_allclose(one.forces, other.forces, atol=1e-10)
    np.testing.assert_allclose(problem.A @ one.u, problem.load_at(0.5) - one.forces, atol=1e-10)


def test_gap_and_slip_offset_shift_the_free_displacements(rng):
    S, g = random_compliance(rng, 2), rng.normal(size=6)
    gap, offset = rng.normal(size=2), rng.normal(size=(2, 2))
    free = g + np.concatenate([gap, offset[:, 0], offset[:, 1]])
    one, other = limits(from_compliance(S, g, 0.3), from_compliance(S, free, 0.3, gap=gap, slip_offset=offset))
    assert_close(other, one, "forces", "u_t", rtol=1e-7, atol=1e-10)


def test_a_decoupled_second_tangent_gives_the_roots_in_2d():
    flat = enumsol.gallery.get("one-node-6.1").build()
    S, g = flat.condensed.S, flat.condensed.g0
    spatial = np.eye(3)
    spatial[:2, :2] = S
    problem = from_compliance(spatial, np.append(g, 0.0), 5.0)
    for root in enumsol.enumerate_roots(flat, 5.0):
        start = enumsol.solve_tresca(problem, root.lambda_n, 0)
        np.testing.assert_allclose((start.lambda_n, start.lambda_t[:, 0]), (root.lambda_n, root.lambda_t), atol=1e-12)
        assert enumsol.is_fixed_point(problem, start)


def test_anderson_needs_fewer_iterations_where_psi_contracts_slowly():
    # s -> 1 - 0.9 s
    S = np.array([[1.0, 0.9, 0.0], [0.9, 2.0, 0.0], [0.0, 0.0, 1.0]])
    problem = from_compliance(S, np.array([1.0, 9.0, 0.0]), 1.0)
    plain, mixed = limit_of(problem, 0), limit_of(problem, 0, anderson=4)
    np.testing.assert_allclose(mixed.forces, plain.forces, atol=1e-8)
    assert mixed.iterations < 0.1 * plain.iterations


def test_anderson_solves_a_linear_map_in_as_many_steps_as_it_has_dimensions(rng):
    M, b = 0.3 * rng.random((4, 4)), rng.random(4)
    limit = np.linalg.solve(np.eye(4) - M, b)
    mixing, x = AndersonMixing(4), np.zeros(4)
    for _ in range(6):
        x = mixing.next(x, M @ x + b)
    np.testing.assert_allclose(x, limit, rtol=1e-8)


def test_contraction_is_what_the_iterates_show():
    # slip in one direction: Psi is affine, s -> a - b s with b = 0.4 (S = [[1, -0.4], ...])
    S = np.array([[1.0, 0.4, 0.0], [0.4, 1.0, 0.0], [0.0, 0.0, 1.0]])
    found = limit_of(from_compliance(S, np.array([1.0, 3.0, 0.0]), 1.0), 0)
    np.testing.assert_allclose(found.contraction[1:8], 0.4, rtol=1e-6)
    np.testing.assert_allclose(found.contraction_factor, 0.4, rtol=1e-3)
    np.testing.assert_allclose(found.lambda_n, 1.0 / 1.4, rtol=1e-9)


def test_a_cycle_is_recognised():
    # the same with b = 2: s -> max(0, 1 - 2 s) has the repelling fixed point 1/3 and the cycle 0, 1
    S = np.array([[1.0, 2.0, 0.0], [2.0, 5.0, 0.0], [0.0, 0.0, 1.0]])
    problem = from_compliance(S, np.array([1.0, 30.0, 0.0]), 1.0)
    found = enumsol.successive_approximations(problem, 0, start=0.2)
    assert (found.converged, found.outcome, found.period) == (False, Outcome.CYCLE, 2)
    assert "repeats 2 iterates" in found.why
    mixed = limit_of(problem, 0, start=0.2, anderson=2)
    np.testing.assert_allclose(mixed.lambda_n, 1.0 / 3.0, rtol=1e-8)


def test_the_limit_of_iterations_is_told():
    found = enumsol.successive_approximations(PUBLIC, 0, max_iterations=2)
    assert (found.outcome, found.iterations) == (Outcome.ITERATION_LIMIT, 2)
    assert "not converged within 2 iterations" in found.why
    assert "not converged" in repr(found)


def test_what_was_reached_is_kept_where_a_tresca_problem_is_not_solved(monkeypatch):
    solved, calls = successive.solve_scaled, []

    def until_the_third(data, start, *more):
        calls.append(start)
        if len(calls) == 3:
            raise TrescaNotSolved("the residual is 1")
        return solved(data, start, *more)

    two = enumsol.successive_approximations(PUBLIC, 0, max_iterations=2)
    monkeypatch.setattr(successive, "solve_scaled", until_the_third)
    found = enumsol.successive_approximations(PUBLIC, 0)
    assert (found.outcome, found.converged, found.iterations) == (Outcome.NOT_SOLVED, False, 2)
    assert "stopped after 2 iterations: a Tresca problem was not solved" in found.why
    np.testing.assert_array_equal(found.forces, two.forces)


def test_mixing_takes_slips_where_friction_depends_on_them():
    table = enumsol.FrictionTable([0, 0.1], [0.5, 0.3])
    problem = enumsol.gallery.block3d(2, 2, 1, friction=table)
    plain, mixed = (limit_of(problem, 0, anderson=depth) for depth in (0, 3))
    np.testing.assert_allclose(mixed.forces, plain.forces, atol=1e-7 * np.max(plain.lambda_n))
    np.testing.assert_allclose(mixed.slip, plain.slip, rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize("start", [None, 0.5, [0.5, 0.1], (np.ones(2), np.zeros(2))])
def test_starts_of_any_kind(start, rng):
    problem = from_compliance(random_compliance(rng, 2), rng.normal(size=6), 0.2)
    plain = enumsol.successive_approximations(problem, 0)
    np.testing.assert_allclose(enumsol.successive_approximations(problem, 0, start).forces, plain.forces, atol=1e-8)
    assert enumsol.successive_approximations(problem, 0, start=plain).iterations == 1


def test_zero_load_and_no_friction():
    nothing = limit_of(from_compliance(W, 0.0 * Q, 0.3), 0, start=1.0)
    assert np.all(nothing.forces == 0)
    smooth = limit_of(from_compliance(W, -Q, 0.0), 0)
    np.testing.assert_allclose(smooth.lambda_n, 1.0 / 15.0)


def test_interrupted_keeps_the_last_iterate():
    stop = CtrlC(lambda state: state.iteration == 3)
    partial = interrupted("interrupted", enumsol.successive_approximations, PUBLIC, 0, progress=stop)
    assert (partial.outcome, partial.iterations) == (Outcome.INTERRUPTED, 3)
    assert partial.lambda_n[0] == pytest.approx(0.066, abs=1e-3)


def test_progress_is_told_every_iteration():
    seen = []
    found = enumsol.successive_approximations(PUBLIC, 0, progress=seen.append)
    assert [state.iteration for state in seen] == list(range(1, found.iterations + 1))
    assert seen[-1].increment <= 1.0 < seen[-2].increment


def test_saved_and_loaded(tmp_path, rng):
    problem = from_compliance(random_compliance(rng, 2), rng.normal(size=6), (0.2, 0.1))
    found = enumsol.successive_approximations(problem, 0)
    again = read_back(found, tmp_path / "limit.npz", problem)
    assert repr(again) == repr(found)
    assert_same(again, found, "lambda_n", "lambda_t", "u_n", "u_t", "u", "slip", "increments")
    np.testing.assert_array_equal(again.contraction, found.contraction)  # of which some are nan
    bad_argument("is about other contact nodes", FixedPoint.load, tmp_path / "limit.npz", from_compliance(W, Q, 0.1))
    (tmp_path / "other.npz").write_bytes(b"PK")
    bad_argument("does not hold a fixed point", FixedPoint.load, tmp_path / "other.npz", problem)
    bad_argument("cannot be read", FixedPoint.load, tmp_path / "none.npz", problem)


def test_frames(rng):
    problem = from_compliance(random_compliance(rng, 2), rng.normal(size=6), (0.2, 0.1), node_ids=["a", "b"])
    frame = enumsol.successive_approximations(problem, 0).to_frame()
    assert list(frame["node"]) == ["a", "b"]
    assert {"F1", "F2", "lambda_n", "lambda_t1", "lambda_t2", "u_n", "u_t1", "u_t2", "status"} <= set(frame.columns)
    flat = enumsol.gallery.get("one-node-6.1").build()
    assert {"F", "lambda_n", "lambda_t", "u_n", "u_t"} <= set(enumsol.successive_approximations(flat, 1).to_frame())


@pytest.mark.parametrize("bad", [-0.1, np.nan, np.inf, "x", (1.0, 2.0, 3.0), None])
def test_a_function_that_returns_no_coefficients(bad):
    problem = from_compliance(W, -Q, lambda node, slip: bad, node_ids=["toe"])
    message = r"friction returns .* at contact node toe for slip 0; expected"
    bad_problem(message, enumsol.successive_approximations, problem, 0)


def test_a_function_that_jumps_is_warned_of():
    problem = from_compliance(W, -Q, lambda node, slip: 0.3 if slip < 1.0 else 0.1)
    with pytest.warns(enumsol.FrictionJumpWarning, match="jumps by 0.2 near slip 1 at contact node 0") as caught:
        enumsol.successive_approximations(problem, 0)
    assert caught[0].filename == __file__


def test_a_steep_function_is_not_warned_of():
    problem = from_compliance(W, -Q, lambda node, slip: 0.1 + 0.2 / (1.0 + np.exp(min(400.0, 40.0 * (slip - 1.0)))))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert enumsol.successive_approximations(problem, 0).converged


def test_errors_of_the_users_own_function_come_through():
    def broken(node, slip):
        raise ZeroDivisionError("mine")

    with pytest.raises(ZeroDivisionError, match="mine"):
        enumsol.successive_approximations(from_compliance(W, -Q, broken), 0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"tolerance": 0.0}, "tolerance is 0"),
        ({"max_iterations": 0}, "max_iterations is 0"),
        ({"anderson": -1}, "anderson is -1"),
        ({"start": [1.0, 2.0]}, r"start has shape \(2,\)"),
        ({"start": -1.0}, "start is -1"),
        ({"start": (np.ones(1), -np.ones(1))}, "slips of start is -1"),
        ({"progress": 3}, "progress is 3"),
        ({"alpha": np.inf}, "alpha is inf"),
    ],
)
def test_bad_arguments(change, message):
    arguments = {"problem": PUBLIC, "alpha": 0} | change
    bad_argument(message, enumsol.successive_approximations, **arguments)


@pytest.mark.parametrize(
    ("problem", "alpha"),
    [
        (enumsol.gallery.block3d(4, 4, 1), 0.3),
        (enumsol.gallery.block3d(4, 4, 1, friction=enumsol.FrictionTable([0, 0.1], [0.5, 0.3])), 0),
        (enumsol.gallery.wedge(2, 2), 1),
    ],
)
def test_a_printed_result_is_readable_in_a_terminal(problem, alpha):
    text = repr(enumsol.successive_approximations(problem, alpha))
    lines = text.splitlines()
    assert max(map(len, lines)) <= 110
    assert max(len(line) for line in lines if "residuals" in line or "converged" in line) <= 80
    heading = next(line.split() for line in lines if "status" in line)
    assert heading[:2] == ["node", "status"]
    assert "slip_bound" not in heading
    depends = getattr(problem, "depends_on_solution", False)
    assert ("in slips" in text) == ("F1" in heading) == depends
    assert ("at all nodes" in text) == (not depends)
    assert not any("-0.0e" in line or re.search(r"e-1[6-9]\b", line) for line in lines[lines.index(lines[-3]) :])
