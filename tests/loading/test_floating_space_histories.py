"""Histories of bodies in 3D that nothing holds: the same in the plane, Newton from many starts, blocks, positions."""

from fractions import Fraction

import numpy as np
import pytest
from complete import accepted_report, complete_report, read_back
from helpers.floating_space import known_body

import enumsol
from enumsol.arithmetic.balls import Ball
from enumsol.model.restart import SlipStart, restarted
from enumsol.model.sectors import SECTORS
from enumsol.trusted.positions import tangential_positions
from enumsol.trusted.space.leaf_positions import leaf_positions
from enumsol.trusted.space.sector_rows import OPEN, STICK


def loads_near(known, rng, count, *, plane=False):
    """Loads that forces within friction balance, after the one of the known solution."""
    problem, loads = known.problem, [known.problem.f]
    F = np.stack(problem.friction, axis=1)
    for _ in range(count - 1):
        pressed, way = known.lambda_n * rng.uniform(0.6, 1.4, problem.p), rng.normal(size=(problem.p, 2))
        if plane:
            way[:, 1] = 0.0
        way *= (rng.uniform(0, 1, problem.p) / np.linalg.norm(way, axis=1))[:, None]
        first, second = (F * pressed[:, None] * way).T
        held = problem.Bn.T @ pressed + problem.Bt1.T @ first + problem.Bt2.T @ second
        loads.append(problem.A @ (known.u + 0.3 * rng.normal(size=problem.n)) + held)
    return loads


def in_the_plane(problem):
    """The same problem in 2D, where there is friction along the first axis only."""
    (F, _), matrices = problem.friction, (problem.A, problem.Bn, problem.Bt1, problem.f)
    given = {"gap": problem.gap, "friction": F, "slip_offset": problem.slip_offset[:, 0]}
    modes = {"rigid_modes": problem.rigid_modes, "max_rigid_displacement": problem.max_rigid_displacement}
    return enumsol.ContactProblem(*matrices, **given, **modes)


@pytest.mark.few(2, 4)
@pytest.mark.parametrize("seed", [10, 5, 1, 2, 3, 6, 7, 8, 9, 11, 12, 13])
def test_friction_along_one_axis_is_that_of_the_plane(seed):
    """Seeds 5 and 10 branch; in the plane positions are rationals."""
    known = known_body(seed, plane=True)
    loads = loads_near(known, np.random.default_rng(seed), 3, plane=True)
    space = enumsol.histories(known.problem, loads)
    plane = enumsol.histories(in_the_plane(known.problem), loads, arithmetic="exact")
    assert complete_report(known.problem, space.proof).unique_until == space.unique_until == plane.unique_until
    assert space.counts == plane.counts
    for stage in space.all_stages:
        low, high = (part.reshape(2, -1)[0] for part in (stage.start.ball.low, stage.start.ball.high))
        exact = [other.start.rationals for other in plane.stages(stage.step)]
        balls = [zip(low, start, high, strict=True) for start in exact]
        assert any(all(Fraction(a) <= x <= Fraction(b) for a, x, b in ball) for ball in balls)


def newton_misses(seed, count=20):
    """What Newton's method finds from many starts in a step of a random history, and its search does not list.

    Also the history and how many solutions were found, each of which is one of the step from the middle of its start.
    """
    known, rng, found, missed = known_body(seed), np.random.default_rng(seed), 0, []
    problem = known.problem
    history = enumsol.histories(problem, loads_near(known, rng, 3))
    for stage in history.all_stages:
        for _ in range(count):
            forces = rng.uniform(0, 2, problem.p), rng.normal(size=2 * problem.p)
            start = np.concatenate([*forces, 3 * rng.normal(size=problem.modes.r)])
            try:
                root = enumsol.newton(stage.problem, 0, start)
            except enumsol.NotConverged:
                continue
            if np.max(np.abs(root.rigid_displacement)) > problem.rigid_reach:
                continue
            found += 1
            alike = [np.allclose(root.lambda_t, one.lambda_t, atol=1e-6) for one in stage.roots]
            if not stage.reasons and not any(alike):
                missed.append(root)
    return history, found, missed


@pytest.mark.few(1, 3)
@pytest.mark.parametrize("seed", range(100, 112))
def test_newton_finds_no_other_solutions(seed):
    history, found, missed = newton_misses(seed)
    assert not missed
    assert found
    report = accepted_report(history.problem, history.proof)
    assert (report.complete, report.unique_until) == (history.complete, history.unique_until)
    assert history.complete, history


def pushed_to_and_fro(shares):
    """A block on a table and a load for every step: pushed along x by these shares of what friction can hold."""
    block = enumsol.gallery.block_on_table3d(1, 1, 1, push=(1.0, 0.0))
    push, aside = block.f.copy(), np.zeros(block.n)
    push[2::3] = 0.0
    aside[1::3] = push[::3]
    return block, [block.f - push + c * push + 0.1 * (k % 3) * aside for k, c in enumerate(shares)]


@pytest.mark.slow
def test_a_block_is_pushed_to_and_fro_and_then_away(tmp_path):
    block, loads = pushed_to_and_fro([0.3, 0.6, -0.6, 1.2, 0.0])
    history = enumsol.histories(block, loads)
    assert (history.counts, history.complete, history.unique_until) == ((1, 1, 1, 0, 0), True, 3)
    report = complete_report(block, history.proof)
    assert report.unique_until == 3
    assert report.within is None or f"rigid displacements of {report.within:g}" in history.closing_line
    radii = [stage.largest_radius for stage in history.all_stages]
    assert 0 < radii[-1] < 1e-9
    again = read_back(history, tmp_path / "h.json", block)
    assert repr(again) == repr(history)
    assert complete_report(block, again.proof)


def test_a_load_that_is_held_is_not_decided():
    block, loads = pushed_to_and_fro([0.5, 0.5])
    history = enumsol.histories(block, [loads[0], loads[0]])
    assert (history.complete, history.unique_until) == (False, 1)
    assert accepted_report(block, history.proof).complete is False
    assert "its start is known within" in history.reasons[0]


@pytest.mark.slow
def test_every_offset_in_a_ball_leads_into_the_ball_of_positions():
    """All four nodes slip: the equations of the statuses leave three modes free, which directions determine."""
    block, loads = pushed_to_and_fro([0.3, 0.95])
    problem, radius, rng = block.replace(f=loads[1]), 1e-9, np.random.default_rng(1)
    first = enumsol.enumerate_roots(block.replace(f=loads[0]), 0)[0]
    offset = first.u_t
    (root,) = enumsol.enumerate_roots(problem.replace(slip_offset=offset), 0)
    named = {"open": OPEN, "stick": STICK, "slip": SECTORS + 1}
    codes = [named[str(status)] for status in root.statuses]
    assert codes.count(SECTORS + 1) == 4
    still = np.tile(np.array(codes) == STICK, 2)
    start = SlipStart(offset, np.full_like(offset, radius))
    wide = restarted(problem, start)
    forces, rigid = np.concatenate([root.lambda_n, root.lambda_t.T.ravel()]), root.rigid_coordinates
    known = Ball(forces, np.full(len(forces), 1e-6)), Ball(rigid, np.full(len(rigid), 1e-6))
    by_leaf = leaf_positions(wide, Fraction(0), known[0], codes)
    assert by_leaf is not None
    by_forces = tangential_positions(wide, Fraction(0), known[0], still, start.ball, rigid=known[1])
    assert np.all(by_leaf.rad < np.minimum(20 * radius, 0.01 * by_forces.rad))
    for _ in range(2):
        other = offset + radius * rng.choice([-0.999, 0.999], offset.shape)
        (one,) = enumsol.enumerate_roots(problem.replace(slip_offset=other), 0)
        moved = (other + one.u_t).T.ravel()
        for ball in (by_leaf, by_forces):
            assert np.all(np.abs(moved - ball.mid)[~still] <= ball.rad[~still])
        # without the rigid displacement nothing is known
    unknown = tangential_positions(wide, Fraction(0), known[0], still, start.ball)
    assert np.all(np.isinf(unknown.rad[~still]))
