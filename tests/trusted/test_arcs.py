"""What the kernel says of a selection over alpha is true: against rationals at points, and isolated roots."""

from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from effort import some
from exact_arcs import Truth, arc_system, beside, check_slopes, exact_of, interval_at, random_cases, two_zeros, widened

from enumsol.arithmetic.rationals import rational
from enumsol.trusted.arcs.over_parts import bernstein_values, expansions, over_parts, signs_beyond, to_bernstein
from enumsol.trusted.arcs.selection_balls import ArcSelection


def selections(count):
    """Random selections in balls, and the truth about them."""
    options = {"integers": 0.3, "scales": (0, 0, 0, -200, 200), "ills": (0, 0, 4, 9)}
    for rng, data, codes in random_cases(range(count), **options):
        if rng.random() < 0.4:
            system, exact = widened(rng, data, 10.0 ** -int(rng.integers(2, 14)))
        else:
            system, exact = arc_system(data), exact_of(data)
        yield rng, ArcSelection(system, list(codes)), Truth(exact, codes)


def expansion_of(selection, low, high):
    """That of one selection over one interval."""
    return expansions([(selection, low, high)])[0]


def parts(rng, low, high, count=4):
    """Some parts of an interval, the whole one and points among them."""
    yield low, high
    yield (low, low) if rng.random() < 0.5 else (high, high)
    for _ in range(count):
        ends = sorted(float(np.clip(x, low, high)) for x in low + (high - low) * rng.random(2))
        yield ends[0], ends[1]


def index_at(truth, alpha):
    """Sign of det M at an alpha."""
    (index,) = truth.signs(truth.det, alpha, alpha)
    return index


@pytest.mark.slow
def test_claims_over_parts_are_true():
    made = dict.fromkeys(("conditions", "regular", "none", "slopes", "index", "ends", "zeros"), 0)
    for rng, selection, truth in selections(some(60, of=150)):
        low, high = interval_at(rng, truth)
        expansion = expansion_of(selection, low, high)
        if expansion is None:
            continue
        for a, b in (*parts(rng, low, high), *beside(rng, truth, low, high)):
            known = expansion.over(a, b)
            assert truth.is_true(known, a, b), (selection.rows.codes, a, b, known)
            made["regular"] += known.regular
            made["none"] += known.none
            made["conditions"] += int(known.regular) * int(np.count_nonzero(known.conditions))
            if known.index:
                made["index"] += 1
                assert truth.signs(truth.det, a, b) == {known.index}
            if not known.regular:
                continue
            for k, end in product(range(len(known.slopes)), (0, 1)):
                sign = int(known.ends[end][k])
                made["ends"] += sign != 0
                alpha = (a, b)[end]
                assert not sign or truth.signs(truth.conditions[k], alpha, alpha) == {sign * index_at(truth, alpha)}
            check_slopes(truth, expansion, known, a, b, made)
    assert min(made.values()) > some(2, of=10), made


@pytest.mark.slow
def test_series_and_their_slopes_lie_within_their_errors():
    compared = 0
    for rng, selection, truth in selections(some(100, of=600)):
        low, high = interval_at(rng, truth)
        expansion = expansion_of(selection, low, high)
        if expansion is None:
            continue
        series = expansion
        v = series.bordered.mid[-1]
        middle, radius = Fraction(series.middle), Fraction(series.radius)
        for tau in (Fraction(-1), Fraction(1), Fraction(float(rng.uniform(-1, 1)))):
            found = truth.conditions_at(rational(middle + tau * radius), v)
            assert found is not None  # N is regular throughout
            compared += 1
            values, slopes = ([Fraction(int(x.p), int(x.q)) for x in part] for part in found)
            for k, row in enumerate(series.coefficients.tolist()):
                polynomial = [Fraction(x) for x in row]
                near = sum(c * tau**j for j, c in enumerate(polynomial))
                rise = sum(j * c * tau ** (j - 1) for j, c in enumerate(polynomial) if j)
                assert abs(near - values[k]) <= Fraction(float(series.error[k]))
                assert abs(rise - slopes[k] * radius) <= Fraction(float(series.slope_error[k]))
    assert compared > some(130, of=800)


@pytest.mark.slow
def test_a_stack_says_of_each_what_it_says_alone():
    """Selections of all sizes, singular and overflowing ones among them, and parts of series of both lengths."""
    asked = [(selection, *interval_at(rng, truth)) for rng, selection, truth in selections(200)]
    asked += [(selection, 1e300, 1.7e308) for selection, _, _ in asked[::20]]
    alone = [expansion_of(*one) for one in asked]
    together = expansions(asked)
    pairs = [pair for pair in zip(together, alone, strict=True) if pair != (None, None)]
    assert 100 < len(pairs) < len(asked)
    assert {one.coefficients.shape[1] for one, _ in pairs} == {3, 17}
    for one, other in pairs:
        off = np.sum(np.abs(one.coefficients - other.coefficients), axis=1)
        assert np.all(off <= one.error + other.error)
    parts = [(one, one.low, 0.5 * one.low + 0.5 * one.high) for one, _ in pairs]
    for part, known in zip(parts, over_parts(parts), strict=True):
        other = part[0].over(*part[1:])
        assert (known.regular, known.none, known.index) == (other.regular, other.none, other.index)
        for ours, theirs in ((known.conditions, other.conditions), (known.slopes, other.slopes)):
            assert np.array_equal(ours, theirs)
        assert all(np.array_equal(*ends) for ends in zip(known.ends, other.ends, strict=True))


@pytest.mark.slow
def test_signs_from_bernstein_polynomials_are_right_to_the_last_bit():
    proven = 0
    for seed in range(count := some(80, of=250)):
        rng = np.random.default_rng(seed)
        coefficients = rng.normal(size=17) * 10.0 ** rng.uniform(-18, 0, size=17)
        low, high = np.sort(rng.uniform(-1, 1, size=2)) if seed % 3 else np.repeat(rng.uniform(-1, 1), 2)
        at = Fraction(float(low)) + (Fraction(float(high)) - Fraction(float(low))) * Fraction(seed % 7, 6)
        # zero within rounding at one point
        coefficients[0] -= float(sum(Fraction(float(c)) * at**k for k, c in enumerate(coefficients)))
        exact = [Fraction(float(c)) for c in coefficients]
        error = np.array([136 * 2.0**-53 * np.sum(np.abs(coefficients)) * 1.001])
        ends = np.array([low]), np.array([high])
        sign = int(signs_beyond(bernstein_values(coefficients[None, None], *ends), error)[0, 0])
        proven += sign != 0
        (values,) = to_bernstein(16, *ends)
        for j in range(17):
            x = Fraction(float(low)) + (Fraction(float(high)) - Fraction(float(low))) * Fraction(j, 16)
            value = sum(c * x**k for k, c in enumerate(exact))
            assert not sign or value * sign > 0
            # numbers of Bernstein polynomials of tau are those of low + (high - low) j / degree
            assert abs(Fraction(float(values[1, j])) - x) <= Fraction(2) ** -48
    assert proven < count


@pytest.mark.slow
def test_single_alphas():
    regular = 0
    for rng, selection, truth in selections(some(100, of=300)):
        low, high = interval_at(rng, truth)
        alpha = float(rng.choice((low, high, 0.5 * (low + high))))
        found = selection.at(alpha)
        if found is None:
            continue
        regular += 1
        index = index_at(truth, alpha)
        assert index != 0
        for k in range(len(truth.conditions)):
            sign = selection.sign_at(alpha, k)
            assert not sign or truth.signs(truth.conditions[k], alpha, alpha) == {sign * index}
    assert regular > some(50, of=150)


@pytest.mark.slow
def test_an_interval_of_two_neighbouring_floats_and_one_of_any_length():
    for _, selection, truth in selections(some(30, of=60)):
        for low, high in ((1.0, float(np.nextafter(1.0, 2.0))), (-1e6, 1e9), (0.0, 5e-324), (1e300, 1.7e308)):
            expansion = expansion_of(selection, low, high)
            if expansion is not None:
                assert truth.is_true(expansion.over(low, high), low, high)


@pytest.mark.parametrize("gap", [0.0, 2.0**-52, 2.0**-40, 2.0**-20, 2.0**-4])
def test_two_zeros_close_together_are_not_missed(gap):
    data, codes, condition = two_zeros(gap)
    selection = ArcSelection(arc_system(data), codes)
    for width in (2.0**-30, 2.0**-20, 2.0**-10, 0.5):
        expansion = expansion_of(selection, 1.0 - width, 1.0 + width)
        assert expansion is not None
        known = expansion.over(1.0 - width, 1.0 + width)
        assert known.regular
        assert known.conditions[condition] == (-1 if width**2 < gap > 2.0**-48 else 0)
        if width**2 > gap:  # else a multiple of the condition may fall
            assert known.slopes[condition] == 0
        if width**2 > 16 * gap:
            assert expansion.over(1.0 + width / 2, 1.0 + width).slopes[condition] == 1
