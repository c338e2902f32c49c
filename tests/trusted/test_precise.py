"""What the kernel says of a selection in many digits is true: against isolated roots of exact polynomials."""

from fractions import Fraction

import numpy as np
import pytest
from effort import some
from exact_arcs import Truth, beside, check_slopes, exact_of, interval_at, precise_system, random_data, two_zeros
from flint import arb, arb_mat, ctx
from path_problems import generic_problem

from enumsol import ContactProblem
from enumsol.condensation.exact import ExactCondensed
from enumsol.gallery import wedge
from enumsol.trusted.arcs import many_digits as refined
from enumsol.trusted.arcs.many_digits import PRECISION, ball_of, precision, taylor_around, upper
from enumsol.trusted.arcs.precise import NowhereHeld, PreciseSelection, PreciseSystem
from enumsol.trusted.status_rows import FRICTIONLESS


def selections(count, start=0):
    """Random selections of exact data in any units, and the truth about them."""
    for seed in range(start, start + count):
        rng = np.random.default_rng(seed)
        p = int(rng.integers(1, 4))
        scale = int(rng.choice((0, 0, -900, 900, -300)))
        data = random_data(rng, p, integers=rng.random() < 0.4, scale=scale, ill=int(rng.choice((0, 4, 9))))
        codes = rng.integers(0, 4, size=p)
        codes[rng.random(p) < 0.1] = FRICTIONLESS
        codes = codes.tolist()
        yield rng, PreciseSelection(precise_system(data), codes), Truth(exact_of(data), tuple(codes))


def short_interval(rng, truth):
    """An interval about some place of interest, down to 10^-60 long."""
    low, high = interval_at(rng, truth)
    middle = Fraction(low) + (Fraction(high) - Fraction(low)) * Fraction(int(rng.integers(0, 9)), 8)
    if rng.random() < 0.5:
        width = Fraction(1, 10 ** int(rng.integers(1, 60)))
        return middle - width, middle + width * int(rng.integers(1, 5))
    return Fraction(low), Fraction(high)


def check_claims(count, start=0):
    """Numbers of claims of every kind that were made; all are true."""
    made = dict.fromkeys(("conditions", "none", "slopes", "index", "zeros"), 0)
    for rng, selection, truth in selections(count, start):
        low, high = short_interval(rng, truth)
        expansion = selection.expansion(low, high)
        if expansion is None:
            continue
        cuts = sorted(low + (high - low) * Fraction(int(rng.integers(0, 1025)), 1024) for _ in range(4))
        some = ((low, high), (low, low), (cuts[0], cuts[1]), (cuts[2], cuts[3]))
        for a, b in (*some, *beside(rng, truth, low, high)):
            known = expansion.over(a, b)
            assert truth.is_true(known, a, b), (selection.rows.codes, a, b, known)
            made["none"] += known.none
            made["conditions"] += int(known.regular) * int(np.count_nonzero(known.conditions))
            index = known.index
            if not index:
                continue
            made["index"] += 1
            assert truth.signs(truth.det, a, b) == {index}
            check_slopes(truth, expansion, known, a, b, made)
    return made


def test_a_selection_that_holds_nowhere_is_told_at_zeros_of_its_determinant():
    told = 0
    for rng, selection, truth in selections(some(75, of=150), start=5000):
        low, high = (Fraction(end) for end in interval_at(rng, truth))
        for _ in range(60):
            # bisected to where the determinant changes its sign
            middle = (low + high) / 2
            if truth.signs(truth.det, low, middle) >= {-1, 1}:
                high = middle
            elif truth.signs(truth.det, middle, high) >= {-1, 1}:
                low = middle
            else:
                break
        expansion = selection.expansion(low, high)
        if isinstance(expansion, NowhereHeld):
            told += truth.signs(truth.det, low, high) >= {-1, 1}
            for a, b in ((low, high), (low, low), (low, (low + high) / 2)):
                assert truth.is_true(expansion.over(a, b), a, b)
    assert told > some(1, of=3), told


@pytest.mark.slow
def test_claims_over_parts_are_true():
    made = check_claims(some(90, of=300))
    assert min(made.values()) > some(3, of=20), made


@pytest.mark.slow
def test_balls_over_an_interval_hold_the_unknowns_and_their_slopes():
    compared = 0
    for rng, selection, truth in selections(some(80, of=250)):
        low, high = short_interval(rng, truth)
        with precision():
            middle, radius = (low + high) / 2, (high - low) / 2
            solved = selection.solve(ball_of(middle))
            if solved is None or not solved[1].nrows():
                continue
            y, M = solved
            rise = M.solve((selection._g[1] - selection._M[1] * y) * ball_of(radius))
            found = taylor_around(rise, M.solve(selection._M[1] * ball_of(radius)))
            if found is None:
                continue
            bend, left, left_slope = found
            for tau in (Fraction(-1), Fraction(1), Fraction(int(rng.integers(-99, 100)), 100)):
                alpha = middle + tau * radius
                there = selection.solve(ball_of(alpha))
                slope = there[1].solve(selection._g[1] - selection._M[1] * there[0]) * ball_of(radius)
                compared += 1
                t = ball_of(tau)
                ours = y + rise * t - bend * (t * t) + left, rise - bend * (2 * t) + left_slope
                for about, exact in zip(ours, (there[0], slope), strict=True):
                    for i in range(about.nrows()):
                        # the value at one alpha is known to some ninety digits
                        assert about[i, 0].overlaps(exact[i, 0])
    assert compared > some(30, of=100)


@pytest.mark.parametrize("first", [0, 2])
def test_conditions_of_a_body_that_moves_almost_freely_are_known_over_long_intervals(first):
    """All nodes slide: forces vary together, and a thousand times more than displacements do."""
    problem = wedge(4, 4)
    system = PreciseSystem.of(problem)
    assert system is not None
    selection = PreciseSelection(system, (first, *[2] * (problem.p - 1)))
    low, high = Fraction(109, 100), Fraction(111, 100)
    expansion = selection.expansion(low, high)
    assert expansion is not None
    known = expansion.over(low, high)
    inside = [selection.signs_at(low + (high - low) * Fraction(k, 16)) for k in range(17)]
    assert np.all(known.conditions != 0)
    assert all(np.array_equal(signs, known.conditions) for signs in inside)


def test_balls_around_the_smallest_and_largest_numbers():
    with precision():
        for exponent in (-2000, -1074, -1000, 0, 1000):
            size = arb(2) ** exponent
            for rate in (arb(1) / 4, arb(2) ** -30, arb(2) ** -300):
                found = taylor_around(arb_mat([[size]]), arb_mat([[rate]]))
                assert found is not None
                bend, left, left_slope = (part[0, 0] for part in found)
                for tau in (-1, 1):
                    assert (tau * size - bend + left).contains((tau * size / (1 + tau * rate)).mid())
                    assert (size - 2 * tau * bend + left_slope).contains((size / (1 + tau * rate) ** 2).mid())


def test_floats_are_upper_bounds():
    with precision():
        for mid, rad in ((1, 0), (-1, 0.5), (0, 0), (arb(1) / 3, 1e-30), (arb(2) ** -2000, 0), (arb(2) ** 900, 1.0)):
            ball = arb(mid, rad)
            assert arb(upper(ball)) >= abs(ball).upper()
        assert upper(arb(2) ** 2000) == np.inf
        assert not upper(arb("nan")) < np.inf


def _lie_in_their_balls(problem, radius):
    ours, exact = PreciseSystem.of(problem), ExactCondensed.from_problem(problem)
    assert ours is not None
    with ctx.workprec(4 * PRECISION):
        for r, row in enumerate(exact.rows):
            pairs = [(ours.S[r, k], x) for k, x in enumerate(row)]
            pairs += [(ours.g0[r], exact.g0[r]), (ours.g1[r], exact.g1[r])]
            for ball, value in pairs:
                assert ball.contains(arb(value))
                assert float(ball.rad()) <= radius * max(1.0, abs(float(arb(value))))
        for parts in ((ours.F0, exact.F0), (ours.F1, exact.F1)):
            assert all(ball.contains(arb(value)) for ball, value in zip(*parts, strict=True))


@pytest.mark.parametrize(("bits", "radius"), [(refined._RESIDUAL_BITS, 1e-80), (30, 1e-8)])
def test_condensed_data_lie_in_their_balls(bits, radius, monkeypatch):
    """Also where residuals are not small: their second order is bounded."""
    monkeypatch.setattr(refined, "_RESIDUAL_BITS", bits)
    for seed in range(12):
        rng = np.random.default_rng(seed)
        problem = generic_problem(rng, int(rng.integers(1, 4)), ("friction", "load", "both")[seed % 3])
        _lie_in_their_balls(problem, radius)


def test_condensed_data_of_entries_of_all_sizes_lie_in_their_balls():
    rng = np.random.default_rng(5)
    for size in (1e-150, 1.0, 1e150):
        X = rng.normal(size=(6, 6)) * 10.0 ** rng.uniform(-12, 0, size=(6, 6))
        A = (X @ X.T + np.diag(10.0 ** rng.uniform(-6, 6, size=6))) * size
        A = (A + A.T) / 2
        f = np.array([1e-30, 0.0, 1e3, 1.0, -3.0, 1e-300]) * size
        rows = np.eye(6)[:4]
        problem = ContactProblem(A, rows[:2], rows[2:], f, load_slope=np.zeros(6), friction=(0.5, 0.0))
        ours, exact = PreciseSystem.of(problem), ExactCondensed.from_problem(problem)
        assert ours is not None
        with ctx.workprec(4 * PRECISION):
            for r, row in enumerate(exact.rows):
                pairs = [*((ours.S[r, k], x) for k, x in enumerate(row)), (ours.g0[r], exact.g0[r])]
                assert all(ball.contains(arb(value)) for ball, value in pairs)
                assert all(ball.rad() <= arb(2) ** -250 * max(abs(arb(x)) for x in row) for ball, x in pairs[:-1])
                assert ours.g1[r] == 0


@pytest.mark.parametrize("gap", [0.0, 2.0**-52, 2.0**-40, 2.0**-20, 2.0**-4])
def test_two_zeros_close_together_are_not_missed(gap):
    data, codes, condition = two_zeros(gap)
    selection = PreciseSelection(precise_system(data), codes)
    for width in (Fraction(1, 2**100), Fraction(1, 2**20), Fraction(1, 2**10)):
        expansion = selection.expansion(1 - width, 1 + width)
        assert expansion is not None
        known = expansion.over(1 - width, 1 + width)
        assert known.regular
        assert known.conditions[condition] <= 0
        assert known.slopes[condition] == 0
        assert expansion.over(1 - width, 1 - width).conditions[condition] == np.sign(float(width**2) - gap)
