"""What the kernel says of a selection in many digits is true: against isolated roots of exact polynomials."""

from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from effort import some
from exact_arcs import Truth, beside, check_slopes, exact_of, interval_at, precise_system, random_data, two_zeros
from flint import arb, arb_mat, ctx, fmpq
from path_problems import generic_problem

from enumsol import ContactProblem
from enumsol.arithmetic.algebraic import real_roots
from enumsol.branches.enclosed.zeros import zeros_of
from enumsol.condensation.exact import ExactCondensed
from enumsol.gallery import wedge
from enumsol.trusted.arcs import precise as refined
from enumsol.trusted.arcs.precise import PreciseSelection, system_in_many_digits
from enumsol.trusted.arcs.taylor import PRECISION, Smooth, ball_of, precision, upper, uppers
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


def around_a_pole(rng, truth):
    """An interval of any width in which the determinant vanishes, or None."""
    poles = real_roots(truth.det, fmpq(-10), fmpq(10)) if truth.det.degree() > 0 else []
    if not poles:
        return None
    centre = Fraction(float(poles[int(rng.integers(len(poles)))]))
    width = Fraction(10.0 ** -rng.uniform(0.5, 14))
    return centre - width * int(rng.integers(1, 9)), centre + width * int(rng.integers(1, 9))


def check_claims_around_poles(count, start):
    """The same around zeros of the determinant, of the bordered system."""
    made = dict.fromkeys(("poles", "conditions", "none", "slopes", "index", "zeros"), 0)
    for rng, selection, truth in selections(count, start):
        ends = None if truth.det.is_zero() else around_a_pole(rng, truth)
        expansion = ends and selection.expansion(*ends)
        if not (expansion and expansion.functions.g[0].ncols() == 2):
            continue
        low, high = ends
        made["poles"] += 1
        zeros = [zero for k in range(len(selection.rows.conditions) + 1) for zero in zeros_of(expansion).zeros(k)]
        assert all(low < zero < high for zero in zeros)
        around = [zero + sign * (high - low) / 2**k for zero in zeros for k in (5, 20, 120) for sign in (-1, 1)]
        cuts = sorted([low, high, *(alpha for alpha in around if low < alpha < high)])
        for a, b in (*pairwise(cuts), (low, high), (low, low), *beside(rng, truth, low, high)):
            known = expansion.over(a, b)
            assert truth.is_true(known, a, b), (selection.rows.codes, a, b, known)
            made["none"] += known.none
            if not known.regular:
                continue
            made["conditions"] += int(np.count_nonzero(known.conditions))
            made["index"] += 1
            assert truth.signs(truth.det, a, b) == {known.index}
            check_slopes(truth, expansion, known, a, b, made)
    return made


@pytest.mark.slow
def test_claims_around_zeros_of_the_determinant_are_true():
    made = check_claims_around_poles(some(150, of=400), 5000)
    assert min(made.values()) > some(1, of=10), made


@pytest.mark.parametrize("off", [0.0, 2.0**-20, 2.0**-50])
def test_what_happens_beside_a_zero_of_the_determinant_is_told_apart(off):
    """Two nodes slip alike, but for ``off``; where det M vanishes, one more and the other less, until one is open."""
    S = np.array([[2.0, 1.0, 0.0, -1.0], [1.0, 2.0, -1.0, 0.0], [0.0, -1.0, 4.0, 0.0], [-1.0, 0.0, 0.0, 4.0]])
    data = S, np.array([3.0 + off, 3.0, -10.0, -10.0]), np.zeros(4), np.zeros(2), np.ones(2)
    codes = (3, 3)
    system, truth = precise_system(data), Truth(exact_of(data), codes)
    pole = next(root for root in truth.interesting if 0 < root < 10)
    selection = PreciseSelection(system, codes)
    low, high = Fraction(pole) - Fraction(1, 2**12), Fraction(pole) + Fraction(1, 2**13)
    expansion = selection.expansion(low, high)
    assert expansion.functions.g[0].ncols() == 2
    zeros = sorted(zero for k in range(len(selection.rows.conditions) + 1) for zero in zeros_of(expansion).zeros(k))
    assert len(zeros) == 5
    gaps, apart = [b - a for a, b in pairwise(zeros)], zeros_of(expansion).apart
    assert min(gaps) > apart if off else max(gaps) < apart
    beside = (low, zeros[0] - apart), (zeros[-1] + apart, high)
    cuts = [low, *(zero + gap / 2 for zero, gap in zip(zeros, gaps, strict=False)), high]
    known = {part: expansion.over(*part) for part in [*beside, *(pairwise(cuts) if off else ())]}
    assert all(truth.is_true(said, *part) for part, said in known.items())
    assert all(known[part].holds for part in beside)
    if off:
        first, *between, last = (known[part] for part in pairwise(cuts))
        assert all(said.none for said in between)
        assert [[*map(int, said.slopes[said.doubtful])] for said in (first, last)] == [[-1], [1]]
        made = dict.fromkeys(("slopes", "zeros"), 0)
        for part, said in known.items():
            check_slopes(truth, expansion, said, *part, made)
        assert made["zeros"] == 4
    else:
        # all vanish at the very same alpha
        assert not expansion.over(low, high).regular
        assert not expansion.over(low, high).none


@pytest.mark.slow
def test_claims_over_parts_are_true():
    made = check_claims(some(90, of=300))
    assert min(made.values()) > some(3, of=20), made


def value_at(smooth, tau):
    """Values and slopes of smooth functions at a ball of tau."""
    value, slope = smooth.left, smooth.left_slope
    for k, term in enumerate(smooth.terms):
        value = value + term * tau**k
        slope = slope + (term * (k * tau ** (k - 1)) if k else 0 * term)
    return value, slope


@pytest.mark.slow
def test_balls_over_an_interval_hold_the_unknowns_and_their_slopes():
    compared = 0
    for rng, selection, truth in selections(some(80, of=250)):
        low, high = short_interval(rng, truth)
        with precision():
            middle, radius = (low + high) / 2, (high - low) / 2
            functions = selection.functions
            y, M1 = functions.solve(ball_of(middle)), functions.M[1]
            if y is None or not y.nrows():
                continue
            M = functions.M[0] + M1 * ball_of(middle)
            rise = M.solve((functions.g[1] - M1 * y) * ball_of(radius))
            P = M.solve(M1 * ball_of(radius))
            found = Smooth.solution(y, rise, P, uppers(P))
            if found is None:
                continue
            for tau in (Fraction(-1), Fraction(1), Fraction(int(rng.integers(-99, 100)), 100)):
                alpha = middle + tau * radius
                there = functions.solve(ball_of(alpha))
                M = functions.M[0] + M1 * ball_of(alpha)
                slope = M.solve(functions.g[1] - M1 * there) * ball_of(radius)
                compared += 1
                t = ball_of(tau)
                ours = value_at(found, t)
                for about, exact in zip(ours, (there, slope), strict=True):
                    for i in range(about.nrows()):
                        # the value at one alpha is known to some ninety digits
                        assert about[i, 0].overlaps(exact[i, 0])
    assert compared > some(30, of=100)


@pytest.mark.parametrize("first", [0, 2])
def test_conditions_of_a_body_that_moves_almost_freely_are_known_over_long_intervals(first):
    """All nodes slide: forces vary together, and a thousand times more than displacements do."""
    problem = wedge(4, 4)
    system = system_in_many_digits(problem)
    assert system is not None
    selection = PreciseSelection(system, (first, *[2] * (problem.p - 1)))
    low, high = Fraction(109, 100), Fraction(111, 100)
    expansion = selection.expansion(low, high)
    assert expansion is not None
    known = expansion.over(low, high)
    inside = [selection.functions.signs_at(low + (high - low) * Fraction(k, 16)) for k in range(17)]
    assert np.all(known.conditions != 0)
    assert all(np.array_equal(signs[:-1], known.conditions) for signs in inside)


def test_balls_around_the_smallest_and_largest_numbers():
    with precision():
        for exponent in (-2000, -1074, -1000, 0, 1000):
            size = arb(2) ** exponent
            for rate in (arb(1) / 4, arb(2) ** -30, arb(2) ** -300):
                found = Smooth.solution(arb_mat([[0]]), arb_mat([[size]]), arb_mat([[rate]]), uppers(arb_mat([[rate]])))
                assert found is not None
                for tau in (-1, 1):
                    value, slope = (part[0, 0] for part in value_at(found, arb(tau)))
                    assert value.contains((tau * size / (1 + tau * rate)).mid())
                    assert slope.contains((size / (1 + tau * rate) ** 2).mid())


def test_floats_are_upper_bounds():
    with precision():
        for mid, rad in ((1, 0), (-1, 0.5), (0, 0), (arb(1) / 3, 1e-30), (arb(2) ** -2000, 0), (arb(2) ** 900, 1.0)):
            ball = arb(mid, rad)
            assert arb(upper(ball)) >= abs(ball).upper()
        assert upper(arb(2) ** 2000) == np.inf
        assert not upper(arb("nan")) < np.inf


def _lie_in_their_balls(problem, radius):
    ours, exact = system_in_many_digits(problem), ExactCondensed.from_problem(problem)
    assert ours is not None
    with ctx.workprec(4 * PRECISION):
        for r, row in enumerate(exact.rows):
            pairs = [(ours.S[r, k], x) for k, x in enumerate(row)]
            pairs += [(ours.g0[r], exact.g0[r]), (ours.g1[r], exact.g1[r])]
            for ball, value in pairs:
                assert ball.contains(arb(value))
                assert float(ball.rad()) <= radius * max(1.0, abs(float(arb(value))))
        for parts in ((ours.F0, exact.F0), (ours.F1, exact.F1)):
            assert all(arb(number) == arb(value) for number, value in zip(*parts, strict=True))


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
        problem = ContactProblem(A, rows[:2], rows[2:], f, load_slope=np.zeros(6), friction=0.5)
        ours, exact = system_in_many_digits(problem), ExactCondensed.from_problem(problem)
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
