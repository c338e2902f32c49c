"""The test that closes a subtree, against all selections in rationals."""

import numpy as np
import pytest
from rational_closings import Closings, Reduced
from rational_forms import Data, Forms, Refused, exact
from touching import touching_problem

from enumsol.condensation.enclosure import CondensedEnclosure
from enumsol.kernel.closing import closed_solution, definite_sign, same_solution


def system_of(problem):
    scaled = problem.condensed.at(0.0).scaled
    return CondensedEnclosure.from_problem(problem).at(0.0, scaled.force, scaled.length), scaled


@pytest.mark.parametrize("seed", range(30))
def test_what_is_proven_is_so(seed):
    rng = np.random.default_rng(seed)
    proven = 0
    for _ in range(6):
        problem = touching_problem(rng, int(rng.integers(1, 4)))
        system, scaled = system_of(problem)
        data = Data(problem)
        forms, friction = Forms(data.S, data.load(0), data.friction(0)), [F > 0 for F in problem.friction[0]]
        selection = tuple(int(rng.integers(4)) if positive else int(rng.choice([0, 4])) for positive in friction)
        free = tuple(i for i in range(problem.p) if rng.random() < 0.7)
        # units of lambda are powers of two: forces of size one
        # some of the others slide
        selection = tuple(
            int(rng.choice([7, 8])) if positive and i not in free and rng.random() < 0.4 else code
            for i, (code, positive) in enumerate(zip(selection, friction, strict=True))
        )
        tau = rng.choice([0.0, 0.1, 0.5, 1.0, 2.0], size=len(free))
        force = rng.normal(size=2 * problem.p)
        sliding = sum(code > 6 for code in selection)
        rubbing = sum(friction[i] for i in free)
        omega = rng.choice([0.5, 1.0, 1.5], size=(len(free) + sliding + rubbing) * int(rng.integers(2)))
        numbers = np.concatenate([tau, omega])
        ball = closed_solution(system, selection, free, numbers, force)
        core = tuple(6 if i in free else code for i, code in enumerate(selection))
        sign = definite_sign(system, selection, free, numbers)
        assert ball is None or (ball.sign == sign != 0 and ball.core == core)
        if sign:
            units = scaled.length[: problem.p] / scaled.force[: problem.p]
            weights = {i: exact(float(t * units[i])) for i, t in zip(free, tau, strict=True)}
            reduced = Reduced(forms, core, friction)
            omega = [exact(float(x)) for x in numbers[len(free) :]] or [exact(1.0)] * len(reduced.places)
            assert reduced.definite(weights | dict.fromkeys(reduced.sliding, exact(0.0)), omega)
            assert (reduced.determinant > 0) == (sign > 0)
        if ball is None:
            continue
        proven += 1
        (point,) = reduced.solutions()
        for k, value in enumerate(point):
            x = float(value) / scaled.force[k]
            assert abs(x - ball.force[k]) <= ball.force_rad[k] + 1e-14 * (1 + abs(x))
            w = float(forms.move(1, k)[-1] + sum((a * b for a, b in zip(forms.move(1, k), point, strict=False)), 0))
            w /= scaled.length[k]
            assert abs(w - ball.w[k]) <= ball.w_rad[k] + 1e-14 * (1 + abs(w))
        judge = Closings(forms, friction, (scaled.length, scaled.force))
        values = [v for i in reduced.fixed for v in judge.conditions(core[i], i, point)]
        values += [judge.slides(core[i], i, point) for i in reduced.sliding]
        assert not ball.is_root or all(v > 0 for v in values)
        assert not ball.is_excluded or any(v < 0 for v in values)
    assert proven


def test_bad_proposals_prove_nothing():
    problem = touching_problem(np.random.default_rng(3), 3)
    system, _ = system_of(problem)
    assert np.all(system.F > 0)
    assert definite_sign(system, (1, 1, 1), (), np.zeros(0)) == 1
    assert definite_sign(system, (7, 1, 8), (), np.zeros(0)) == 1
    # a free node does not slide
    assert definite_sign(system, (7, 1, 8), (0,), np.ones(1)) == 0
    for selection in ((4, 1, 1), (1, 1, 6), (0, 5, 0), (9, 1, 1), (-1, 1, 1)):
        assert definite_sign(system, selection, (), np.zeros(0)) == 0
        assert closed_solution(system, selection, (0, 1), np.ones(2), np.zeros(6)) is None
    free, near = (0, 1, 2), np.zeros(6)
    for weight in (np.inf, np.nan, -1.0, 1e300, 1e-300):
        tau = np.array([weight, 1.0, 1.0])
        assert definite_sign(system, (1, 1, 1), free, tau) == 0
        assert closed_solution(system, (1, 1, 1), free, tau, near) is None
    assert definite_sign(system, (1, 1, 1), free, np.ones(2)) == 0
    # too few of the six factors, both signs of zero, and ranges that overflow
    proven, tau = (3, 1, 1), np.array([1.2, 1.7, 0.35])
    assert definite_sign(system, proven, free, tau) == definite_sign(system, proven, free, np.r_[tau, np.ones(6)]) == 1
    for omega in (np.ones(2), np.ones(7), np.r_[0.0, np.ones(5)], np.r_[-0.0, np.ones(5)], np.r_[-1.0, np.ones(5)]):
        assert definite_sign(system, proven, free, np.r_[tau, omega]) == 0
    for factor in (np.inf, np.nan, 1e308, 1e-308, 5e-324):
        for k in range(6):
            omega = np.ones(6)
            omega[k] = factor
            assert definite_sign(system, proven, free, np.r_[tau, omega]) == 0
            assert closed_solution(system, proven, free, np.r_[tau, omega], near) is None
    for factor in (1e308, 1e-308):
        assert definite_sign(system, proven, free, np.r_[tau, np.full(6, factor)]) == 0


def test_which_solutions_are_the_same():
    def sets(*codes):
        return tuple(frozenset(held) for held in codes)

    one = (1, 6, 6), sets({1}, {0, 1}, {2})
    assert same_solution(*one, (1, 6, 2), sets({1}, {0, 1, 2}, {2})) is True
    assert same_solution(*one, (1, 0, 2), sets({1}, {0}, {2})) is True
    assert same_solution(*one, (1, 2, 6), sets({1}, {2}, {2, 3})) is False
    assert same_solution(*one, (3, 6, 6), sets({3}, {0}, {2})) is False
    # a node that slides: open or slip+, open or slip-
    slides = (7, 6, 8), sets({0, 2}, {1}, {0})
    assert same_solution(*slides, (0, 1, 3), sets({0}, {1}, {3})) is False
    assert same_solution(*slides, (2, 6, 6), sets({2}, {1}, {0, 3})) is True
    assert same_solution(*slides, (6, 6, 0), sets({0, 1, 2}, {1, 2}, {0})) is True
    assert same_solution(*slides, (6, 1, 6), sets({0, 1}, {1}, {0, 1})) is True
    assert same_solution(*slides, (1, 6, 6), sets({1, 2}, {1}, {0, 1})) is None
    # neither surely has the other one's statuses
    assert same_solution((1, 6, 6), sets({1}, {0, 1}, {0, 1}), (6, 0, 6), sets({1, 2}, {0}, {0, 1})) is None


def test_the_independent_judge_refuses():
    data = Data(touching_problem(np.random.default_rng(3), 2))
    with pytest.raises(Refused):
        Reduced(Forms(data.S * 0, data.load(0), data.friction(0)), (1, 6), [True, True])
