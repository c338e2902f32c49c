"""Histories of bodies that nothing holds, in exact arithmetic: rationals step by step, and weak springs."""

from fractions import Fraction

import numpy as np
import pytest
from alike import assert_close
from flint import fmpq
from floating_oracle import Oracle, random_body, rational
from helpers.floating_bodies import held_by_springs, pushed_block
from refusals import refusal

import enumsol


def compared(problem, alphas):
    """The history, every search of which has the solutions of the oracle, which carries its own positions."""
    history = enumsol.histories(problem, alphas, arithmetic="exact")
    starts = {tuple(Fraction(x) for x in problem.slip_offset.tolist())}
    Bt = [[rational(x) for x in row] for row in problem.Bt.toarray().tolist()]
    for step, alpha in enumerate(alphas, 1):
        stages = history.stages(step)
        assert {stage.start.rationals for stage in stages} == starts
        starts = set()
        for stage in stages:
            oracle = Oracle(problem, alpha, [fmpq(x.numerator, x.denominator) for x in stage.start.rationals])
            assert (len(stage.roots), len(stage.roots.families)) == (len(oracle.points), oracle.families)
            assert bool(stage.reasons) == bool(oracle.families)
            forces = sorted(np.r_[root.lambda_n, root.lambda_t].tolist() for root in stage.roots)
            assert np.allclose(forces, np.reshape(sorted(oracle.forces[0].tolist()), np.shape(forces)), atol=1e-9)
            for point in oracle.points:
                moved = [sum((a * x for a, x in zip(row, point, strict=False)), fmpq(0)) for row in Bt]
                starts.add(tuple(Fraction(int(x.p), int(x.q)) for x in moved))
        if not starts:
            break
    return history


@pytest.mark.few(1, 1)
@pytest.mark.parametrize("seeds", [(5, 8, 14), (16, 17, 21), (23, 25, 27), (30, 31, 42), range(8), range(50, 58)])
def test_random_bodies_against_rationals_step_by_step(seeds):
    found = [compared(random_body(seed), [0.25, 0.5, 0.0]) for seed in seeds]
    assert any(history.counts[-1] for history in found)


def test_a_block_slides_a_little_and_stays_there():
    history = compared(pushed_block(1), [0.5, 0.9, 0.0, 1.5])
    assert (history.counts, history.unique_until) == ((1, 1, 1, 0), 3)
    for said in ("none reaches the last step", "nothing solves step 4", "rigid displacements"):
        assert said in str(history)


def test_sliding_for_good_is_a_family_that_is_not_followed():
    history = compared(pushed_block(1, max_rigid_displacement=4.0), [0.5, 1.0, 0.0])
    assert len(history.stages(3)) == 0
    assert "family of solutions, which are not followed" in history.reasons[0]
    assert "within rigid displacements of 4" in history.closing_line


def test_weak_springs_tend_to_it():
    bodies = pushed_block(1), held_by_springs(pushed_block(1), 1e-7)
    free, weak = (enumsol.histories(body, [0.5, 0.9, -0.5], arithmetic="exact") for body in bodies)
    assert free.counts == weak.counts == (1, 1, 1)
    for step in (1, 2, 3):
        (one,), (two,) = free.roots(step), weak.roots(step)
        assert one.statuses == two.statuses
        assert_close(one, two, "lambda_t", atol=1e-6)
        assert_close(one, two, "u", atol=1e-5)


def test_other_arithmetics_and_3d_are_refused():
    for problem in (pushed_block(1), enumsol.gallery.block_on_table3d(1, 1, 1)):
        refusal(enumsol.NotHeldError, "but in 2D and in exact arithmetic", enumsol.histories, problem, [0.5])
