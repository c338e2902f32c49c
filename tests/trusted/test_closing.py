"""The test that closes a subtree, against all selections in rationals."""

from itertools import product

import numpy as np
import pytest
from rational_closings import Closings, Reduced
from rational_forms import Data, Forms, Refused, _value, exact
from touching import touching_problem

from enumsol.condensation.enclosure import CondensedEnclosure
from enumsol.trusted.uniqueness import closed_solution, only_solution, same_solution


def system_of(problem):
    """In balls, in floats, and in rationals."""
    scaled, data = problem.condensed.at(0.0).scaled, Data(problem)
    forms = Forms(data.S, data.load(0), data.friction(0))
    return CondensedEnclosure.from_problem(problem).at(0.0, scaled.force, scaled.length), scaled, forms


@pytest.mark.few(7, 7)
@pytest.mark.parametrize("seed", range(30))
def test_what_is_proven_is_so(seed):
    rng = np.random.default_rng(seed)
    proven = 0
    for _ in range(6):
        problem = touching_problem(rng, int(rng.integers(1, 4)))
        system, scaled, forms = system_of(problem)
        friction = [F > 0 for F in problem.friction]
        selection = tuple(int(rng.integers(4)) if positive else int(rng.choice([0, 4])) for positive in friction)
        free = tuple(i for i in range(problem.p) if rng.random() < 0.7)
        # units of lambda are powers of two: forces of size one
        # some of the others slide
        selection = tuple(
            int(rng.choice([7, 8])) if positive and i not in free and rng.random() < 0.4 else code
            for i, (code, positive) in enumerate(zip(selection, friction, strict=True))
        )
        core = tuple(6 if i in free else code for i, code in enumerate(selection))
        try:
            reduced = Reduced(forms, core, friction)
        except Refused:
            continue
        points = reduced.solutions()
        selection, force = near(points[0], selection, free, forms, friction)
        force = force / scaled.force
        rubbing = [i for i in free if friction[i]]
        kappa, nu = rng.choice([0.5, 1.0, 1.5], size=len(rubbing)), rng.choice([-0.5, 0.0, 0.0, 0.5], size=len(rubbing))
        tau = rng.choice([0.0, 0.0, 0.5, 1.0], size=len(rubbing))
        share = np.where(tau > 0, 0.0, rng.choice([-1.0, 0.0, 0.5, 1.0], size=len(rubbing)))
        for k, i in enumerate(rubbing):
            if selection[i] in (2, 3):
                share[k], tau[k] = 5 - 2 * selection[i], 0.0
            elif selection[i] == 1 and tau[k] == 0 and rng.random() < 0.8:
                share[k] = np.clip(force[problem.p + i] / force[i] / problem.friction[i], -1, 1)
        mu = rng.choice([0.5, 1.0, 1.5], size=len(reduced.free))
        numbers = np.concatenate([mu, kappa, nu, share, tau])
        ball = closed_solution(system, selection, free, numbers, force)
        assert ball is None or ball.core == core
        if ball is None:
            continue
        proven += 1
        assert ball.index == (1 if reduced.determinant > 0 else -1)
        (point,) = points
        for k, value in enumerate(point):
            x = float(value) / scaled.force[k]
            assert abs(x - ball.force.mid[k]) <= ball.force.rad[k] + 1e-14 * (1 + abs(x))
            w = float(forms.move(1, k)[-1] + sum((a * b for a, b in zip(forms.move(1, k), point, strict=False)), 0))
            w /= scaled.length[k]
            assert abs(w - ball.w.mid[k]) <= ball.w.rad[k] + 1e-14 * (1 + abs(w))
        judge = Closings(forms, friction, [[exact(float(x)) for x in unit] for unit in (scaled.length, scaled.force)])
        judge.serves(judge.numbers(numbers.tolist(), selection, reduced), reduced, point)
        values = [v for i in reduced.fixed for v in judge.conditions(core[i], i, point)]
        values += [judge.slides(core[i], i, point) for i in reduced.sliding]
        assert not ball.is_root or all(v > 0 for v in values)
        assert not ball.is_excluded or any(v < 0 for v in values)
    assert proven


@pytest.mark.long
def test_an_exact_solution_that_is_the_only_one():
    proven = several = 0
    for seed in range(200):
        rng = np.random.default_rng(seed)
        problem = touching_problem(rng, int(rng.integers(1, 4)))
        if seed % 2:
            problem = problem.replace(friction=8.0 * problem.friction, friction_slope=0.0)
        system, _, forms = system_of(problem)
        friction, free = [F > 0 for F in problem.friction], tuple(range(problem.p))
        reduced = Reduced(forms, (6,) * problem.p, friction)
        points, rubbing = reduced.solutions(), [i for i in free if friction[i]]
        for point in points:
            w = [_value(forms.move(1, k), point) for k in range(2 * problem.p)]
            codes = tuple(status(friction[i], point, w, i, problem.p) for i in free)
            share = [5.0 - 2 * codes[i] if codes[i] in (2, 3) else float(rng.choice([-1, 0, 0.5, 1])) for i in rubbing]
            none = np.zeros(len(rubbing))
            numbers = np.concatenate([np.ones(len(free) + len(rubbing)), none, share, none])
            if only_solution(system, codes, free, numbers, point, w):
                proven += 1
                assert len(points) == 1
            several += len(points) > 1
    assert proven > 50
    assert several > 2


def near(point, selection, free, forms, friction):
    """The selection with the statuses of a solution at the free nodes, and lambda."""
    p = len(selection)
    w = [_value(forms.move(1, k), point) for k in range(2 * p)]
    codes = tuple(status(friction[i], point, w, i, p) if i in free else code for i, code in enumerate(selection))
    return codes, np.array([float(x) for x in point])


def status(friction, point, w, i, p):
    if point[i] == 0:
        return 0
    return 4 if not friction else 1 if w[p + i] == 0 else 2 if w[p + i] > 0 else 3


def test_bad_numbers_prove_nothing():
    problem = touching_problem(np.random.default_rng(3), 3)
    system, *_ = system_of(problem)
    assert np.all(system.F > 0)
    near, none = np.zeros(6), np.zeros(0)
    assert closed_solution(system, (1, 1, 1), (), none, near).index == 1
    assert closed_solution(system, (7, 1, 8), (), np.ones(2), near) is not None
    # a free node does not slide
    assert closed_solution(system, (7, 1, 8), (0,), np.r_[np.ones(3), 0, 0, 1], near) is None
    for selection in ((4, 1, 1), (1, 1, 6), (0, 5, 0), (9, 1, 1), (-1, 1, 1)):
        assert closed_solution(system, selection, (), none, near) is None
    free, proven = (0, 1, 2), (0, 0, 0)
    good = np.concatenate([np.ones(6), np.zeros(6), np.ones(3)])
    assert closed_solution(system, proven, free, good, near) is not None
    # of mu, kappa, nu, theta / F and tau
    places = dict.fromkeys((np.inf, np.nan, 1e300, 1e308), range(0, 15, 3))
    places |= {-1e-300: (0, 3, 9, 12), 1e-300: (0, 3, 12), 0.0: (0, 3), -1.0: (0, 3, 9, 12)}
    for wrong, where in places.items():
        for k in where:
            numbers = good.copy()
            numbers[k] = wrong
            assert closed_solution(system, proven, free, numbers, near) is None, (wrong, k)
    for size in (0, 3, 14, 16):
        assert closed_solution(system, proven, free, np.ones(size), near) is None
    for k, side in product(range(3), (-0.5, 0.5, 1.0)):
        numbers = good.copy()
        numbers[9 + k] = side
        # theta is chosen or any, not both
        assert closed_solution(system, proven, free, numbers, near) is None
        # and that of a node that slips is F
        assert closed_solution(system, (3, 3, 3), free, np.r_[good[:9], np.full(3, side), np.zeros(3)], near) is None


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
