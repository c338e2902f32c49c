"""Curves of solutions in boxes (theory, section 12.8), against a closed form of one node and enumerations."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from problems3d import SLIDING, forces, from_compliance, random_compliance, sliding_node

import enumsol
from enumsol.arithmetic.balls import Ball
from enumsol.branches.space.pieces import status_margin
from enumsol.condensation.enclosure import NotEnclosedError
from enumsol.search.space.curve_proposals import (
    border_of_forces,
    border_of_zeta,
    curve_around,
    curve_point,
    placed,
    unplaced,
)
from enumsol.trusted.space.natural_map import Extent, Slips
from enumsol.trusted.space.sector_rows import OPEN, STICK
from enumsol.trusted.space.solution_curve import (
    SLIP,
    AlphaProblem,
    CurveBox,
    lies_in,
    only_curve,
    parameter_in,
)

GIVEN = AlphaProblem.of(SLIDING.enclosure)


def box_of(given, x, half):
    x = placed(given, x)
    point = curve_point(given, x, np.eye(len(x))[-1])
    border = point.direction / (point.direction @ point.direction)
    curve = curve_around(given, point.x, point.direction, border, half, roomy=True)
    return None if curve is None else curve.box


def sliding(alpha):
    """The point of the curve of the sliding node."""
    return placed(GIVEN, np.append(sliding_node(alpha), alpha))


@pytest.fixture(scope="module")
def box():
    """One around alpha = 1/2 on that curve."""
    return box_of(GIVEN, np.append(sliding_node(0.5), 0.5), 0.02)


@pytest.mark.parametrize("seed", [0, 1])
def test_coordinates_are_those_of_forces_and_displacements(seed):
    """Against their definition, with the compliance as the problem has it; the second axis has half the friction."""
    rng = np.random.default_rng(seed)
    S, g = random_compliance(rng, 2), 100.0 * rng.normal(size=6)
    problem = from_compliance(S, g, 0.0, friction_slope=(1.0, 0.5), load_slope=rng.normal(size=6))
    given, alpha = AlphaProblem.of(problem.enclosure), 0.7
    y, q = rng.normal(size=6), np.array([1.0, 1.0, 1.0, 1.0, 0.5, 0.5])
    w = problem.condensed.free_displacements(alpha) - problem.condensed.S @ y
    expected = y / q - given.rho * (q * w / given.length) * given.force
    x = np.append(y, alpha)
    assert placed(given, x) == pytest.approx(np.append(expected, alpha), rel=1e-12)
    assert unplaced(given, placed(given, x)) == pytest.approx(x, rel=1e-11)
    ball = given.coordinates(Ball.exact(y), Ball.exact(w))
    assert np.all(np.abs(ball.mid - expected) <= 1e-12 * np.max(np.abs(expected)))
    border, step = rng.normal(size=7), rng.normal(size=7)
    change = placed(given, x + step) - placed(given, x)
    assert border_of_forces(given, border) @ step == pytest.approx(border @ change, rel=1e-10)
    assert border_of_zeta(given, border_of_forces(given, border)) == pytest.approx(border, rel=1e-10)


def test_what_is_past_the_limit_of_stick_is_bounded_along_a_direction():
    """|z_t| - F z_n at points of a tube lies in its bounds, which no product of intervals reaches."""
    rng = np.random.default_rng(2)
    z, along, half, side = np.array([1.0, 0.3, 0.4, 0.5]), np.array([2.0, 0.6, 0.8, 0.0]), 0.05, np.full(4, 1e-3)

    def gap(z):
        extent = Extent(Ball.exact(z), Ball.exact(along), half, Ball.exact(np.zeros((4, 0))), np.zeros(0), side)
        with np.errstate(all="ignore"):
            return Slips(GIVEN.discs(extent.near[-1]), extent).gap

    bounds = gap(z)
    seen = []
    for t, s in zip(rng.uniform(-half, half, 500), rng.uniform(-1, 1, (500, 4)) * side, strict=True):
        n, *tangent, alpha = z + t * along + s
        seen.append(np.hypot(*tangent) - (GIVEN.F0[0] + alpha * GIVEN.F1[0]) * n)
    low, high = bounds.mid[0] - bounds.rad[0], bounds.mid[0] + bounds.rad[0]
    assert low <= min(seen)
    assert max(seen) <= high
    # |z_t| alone changes by 0.1
    assert high - low < 0.02
    assert np.isinf(gap(np.array([1.0, 0.0, 0.0, 0.5])).rad[0])


def test_the_margin_of_statuses_is_positive_where_they_hold():
    given = AlphaProblem.of(enumsol.gallery.block3d(1, 1, 1).enclosure)
    rng, seen = np.random.default_rng(5), set()
    for _ in range(50):
        z = np.append(rng.normal(size=3 * given.p), rng.uniform(0, 2))
        codes = given.statuses(Ball.exact(z))
        seen.update(codes)
        for i, code in enumerate(codes):
            for other in (OPEN, STICK, SLIP):
                assert (status_margin(given, z, [i], [other]) > 0) == (code == other)
        least = min(status_margin(given, z, [i], [code]) for i, code in enumerate(codes))
        assert status_margin(given, z, range(given.p), codes) == least
    assert seen == {OPEN, STICK, SLIP}


def test_the_curve_is_that_of_the_closed_form(box):
    curve = only_curve(GIVEN, box)
    assert (curve.index, curve.rises, len(curve.statuses)) == (1, 1, 1)
    for alpha in np.linspace(0.49, 0.51, 9):
        x = Ball.exact(sliding(alpha))
        assert lies_in(box, x)
        at = curve.at(parameter_in(box, x))
        assert np.all(np.abs(at.mid - x.mid) <= at.rad + 1e-12)


def test_slopes_are_those_between_points_of_the_curve(box):
    curve, change = only_curve(GIVEN, box), sliding(0.505) - sliding(0.495)
    slope = change / (curve.box.border @ change)
    assert np.all(np.abs(slope - curve.slope.mid) <= curve.slope.rad + 1e-9)


def test_friction_may_be_negative_beside_the_interval():
    start = np.array([1.0, 0.0, 0.0, 0.0])
    curve = only_curve(GIVEN, box_of(GIVEN, start, 0.01))
    assert curve.alphas[0] < 0 < curve.alphas[1]
    at = curve.at(0.0)
    assert np.all(np.abs(at.mid - placed(GIVEN, start)) <= at.rad + 1e-14)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_solutions_in_a_box_are_those_of_its_curve(seed):
    rng = np.random.default_rng([seed, 5])
    S, g = random_compliance(rng, 2), rng.normal(size=6)
    g[:2] += 1.0
    problem = from_compliance(S, g, 0.0, friction_slope=1.0)
    given = AlphaProblem.of(problem.enclosure)
    root = enumsol.enumerate_roots(problem, 0.75)[0]
    boxes = (box_of(given, np.append(forces(root), 0.75), half) for half in 0.1 ** np.arange(1, 6))
    box = next(filter(None, boxes))
    curve = only_curve(given, box)
    low, high = (float(end) for end in curve.alphas)
    seen = 0
    for alpha in np.linspace(low, high, 9):
        for other in enumsol.enumerate_roots(problem, Fraction(float(alpha))):
            x = Ball(placed(given, np.append(forces(other), alpha)), np.full(7, 1e-12))
            if lies_in(box, x):
                at = curve.at(parameter_in(box, x))
                assert np.all(np.abs(at.mid - x.mid) <= at.rad + x.rad)
                seen += 1
    assert seen >= 5


def test_no_curve_is_seen_where_there_may_be_two_or_none(box):
    wide = replace(box, half=2.0, radius=np.full(4, 5.0))
    away = replace(box, centre=box.centre + np.array([0.5, 0.0, 0.0, 0.0]))
    thin = replace(box, radius=1e-9 * box.radius)
    assert [only_curve(GIVEN, other) for other in (wide, away, thin)] == [None] * 3


def test_what_is_no_box_is_refused(box):
    others = {"half": -1.0}, {"half": np.nan}, {"radius": 0 * box.radius}, {"rho": -box.rho}, {"centre": box.centre[1:]}
    for wrong in others:
        assert only_curve(GIVEN, replace(box, **wrong)) is None


def test_both_components_of_a_tangential_force_have_one_step():
    """With two the natural map has another curve of zeros, which are no solutions (theory, (12.10))."""

    def found(ratio, steps):
        low, x, high = (placed(GIVEN, np.append(sliding_node(alpha, ratio), alpha)) for alpha in (0.49, 0.5, 0.51))
        box = CurveBox(x, (high - low) / 0.02, np.eye(4)[3], 0.01, np.full(4, 0.05), np.array(steps))
        return only_curve(GIVEN, box)

    for steps in ([1.0, 1.0, 1.0], [2.0, 1.5, 1.5]):
        at = found(1.0, steps).at(0.0)
        assert np.all(np.abs(at.mid - sliding(0.5)) <= at.rad + 1e-12)
    for ratio in (1.0, 8.0):
        for steps in ([1.0, 1.0, 8.0], [1.0, 0.125, 1.0], [1.0, 1.0, 1.0 + 2.0**-52]):
            assert found(ratio, steps) is None


def test_steps_of_the_coordinates_that_are_none():
    for factors in ([1, 1, 8], [1, 0.125, 1], [0, 1, 1], [1, -1, -1], [np.nan, 1, 1], [np.inf, 1, 1]):
        with pytest.raises(NotEnclosedError, match=r"steps|told apart"):
            AlphaProblem.of(SLIDING.enclosure, GIVEN.steps * factors)
    assert AlphaProblem.of(SLIDING.enclosure, GIVEN.steps * [3, 2, 2]).steps == pytest.approx(GIVEN.steps * [3, 2, 2])


def test_a_fold_lies_in_a_box():
    # the gallery's node sticks up to a fold, and slips back from it
    problem = enumsol.gallery.get("one-node-3d-3").build().replace(friction=0.0, friction_slope=1.0)
    given = AlphaProblem.of(problem.enclosure)
    jammed, *_ = enumsol.enumerate_roots(problem, 5)
    path = enumsol.follow(problem, jammed, -jammed.index, (0.5, 6))
    (fold,) = path.folds
    k = fold.point
    line = placed(given, np.column_stack([path.lambda_n, *np.moveaxis(path.lambda_t, 2, 0), path.alpha]))
    before, after = (line[k] + 1e-3 * (line[n] - line[k]) for n in (k - 1, k + 1))
    ahead, behind = (one / np.linalg.norm(one) for one in (line[k] - before, after - line[k]))
    border = (ahead + behind) / np.linalg.norm(ahead + behind)
    chord = after - before
    length = float(border @ chord)
    box = curve_around(given, before + 0.5 * chord, chord / length, border, 0.6 * length, [0]).box
    curve = only_curve(given, box)
    assert (curve.rises, curve.statuses) == (0, (None,))
    side = 0.5 * min(before[-1] - fold.alpha, after[-1] - fold.alpha, key=abs)
    counts = []
    for alpha in (fold.alpha + side, fold.alpha - side):
        roots = enumsol.enumerate_roots(problem, Fraction(alpha))
        inside = [root for root in roots if lies_in(box, Ball.exact(placed(given, np.append(forces(root), alpha))))]
        counts.append(len(inside))
    assert counts == [2, 0]


def test_a_box_near_a_corner_is_taken_if_a_checker_shows_it_without_a_guess():
    e, A = np.eye(3), [[5.25, -4, 0], [-4, 5.25, 0], [0, 0, 1.25]]
    data = {"friction": (2.0, 1.0), "friction_slope": (-1.0, -0.5), "load_slope": [1, 2, 1]}
    given = AlphaProblem.of(enumsol.ContactProblem3D(A, e[:1], e[1:2], e[2:], [2, -5, -1], **data).enclosure)
    x = np.array([2.9986325370611766, -3.00269126764778, -0.0027139271375546115, 0.998643025293231])
    d = np.array([0.5651579670684634, 1.0965476128867346, 1.1140677107885602, 0.5570456365767223])
    border, shown = np.array([0.15038130783348774, 0.26167978671193165, 0.28176922598145937, 0.563968987695235]), 0
    # for the first of these a box with a guess of what is beside it served
    for half in 0.0006431023222115313 * np.array([1.0, 0.5, 0.25, 0.125, 2.0**-6, 2.0**-9]):
        curve = curve_around(given, x, d, border, half, rho=np.ones(3), roomy=False)
        assert curve is None or only_curve(given, curve.box) is not None
        shown += curve is not None
    assert shown
