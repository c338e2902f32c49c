"""Real algebraic numbers: isolation, comparison and signs."""

from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from flint import fmpq, fmpz_poly

from enumsol.arithmetic.algebraic import (
    CriticalAlpha,
    NumberFieldElement,
    exact_value,
    merge,
    rational_between,
    real_roots,
    variations,
)

X = fmpz_poly([0, 1])


def roots(poly, a, b):
    return sorted(float(r) for r in real_roots(poly, fmpq(a), fmpq(b)))


def test_all_roots_of_random_products_are_isolated_once(rng):
    for _ in range(50):
        factors = {(int(rng.integers(-20, 20)), int(rng.integers(1, 9))) for _ in range(int(rng.integers(1, 7)))}
        poly = fmpz_poly([1])
        for p, q in factors:
            poly *= (q * X - p) ** int(rng.integers(1, 4))
        expected = sorted({Fraction(p, q) for p, q in factors if -2 <= Fraction(p, q) <= 2})
        assert roots(poly * (X**2 + 1), -2, 2) == [float(x) for x in expected]


def test_roots_at_the_ends_and_at_points_of_bisection_count_once():
    assert roots(X * (X - 1) * (2 * X - 1) * (4 * X - 1), 0, 1) == [0.0, 0.25, 0.5, 1.0]
    assert roots(X**2 * (X - 1) ** 3, 0, 1) == [0.0, 1.0]
    assert roots(X - 3, 3, 3) == [3.0]
    assert roots(X**2 + 1, -5, 5) == []


def test_irrational_roots_are_the_nearest_floats():
    # by powers of the points half-way to the neighbours: cube roots of libraries are off by a unit, on some processors
    for degree, value in ((2, 2), (3, 5), (5, 7)):
        (found,) = roots(X**degree - value, 0, 2)
        low, high = (Fraction(found) + Fraction(np.nextafter(found, end)) for end in (0.0, 2.0))
        assert (low / 2) ** degree < value < (high / 2) ** degree


def test_close_roots_are_told_apart_and_equal_ones_are_not():
    tiny = fmpz_poly([-1, 10**40])
    near = real_roots((X**2 - 2) * tiny, fmpq(0), fmpq(2))
    same = real_roots((X**2 - 2) * (X**2 - 3), fmpq(0), fmpq(2))
    groups = merge([*near, *same])
    assert [len(group) for group in groups] == [1, 2, 1]
    shifted = real_roots(10**60 * (X**2 - 2) - 1, fmpq(0), fmpq(2))[0]
    (root, *_) = groups[1]
    assert (shifted.compare(root), root.compare(shifted), float(shifted)) == (1, -1, float(root))


def test_signs_at_an_irrational_number():
    square = X**2 - 2
    root = real_roots(square, fmpq(0), fmpq(2))[0]
    polynomials = square * (X + 5), 10**50 * square + 1, 10**50 * square - 1, fmpz_poly([])
    assert [root.sign_of(polynomial) for polynomial in polynomials] == [0, 1, -1, 0]


def test_a_rational_number_lies_strictly_between(rng):
    for _ in range(30):
        poly = fmpz_poly([int(c) for c in rng.integers(-30, 30, size=6)])
        if poly.degree() < 1:
            continue
        groups = merge(real_roots(poly, fmpq(-3), fmpq(3)))
        for (a, *_), (b, *_) in pairwise(groups):
            between = CriticalAlpha.rational(rational_between(a, b))
            assert (a.compare(between), between.compare(b)) == (-1, -1)


def test_variations_bound_the_number_of_roots():
    poly = (X - 1) * (X - 2) * (X - 3)
    assert variations(poly, fmpq(0), fmpq(4)) >= 3
    assert variations(poly, fmpq(3, 2), fmpq(5, 2)) == 1
    assert variations(poly, fmpq(4), fmpq(9)) == 0


def test_the_number_field_is_an_ordered_field():
    root = real_roots(X**2 - 2, fmpq(0), fmpq(2))[0]
    a = exact_value(root)
    assert isinstance(a, NumberFieldElement)
    assert a * a == 2
    assert 1 / a == a / 2
    assert fmpq(7, 5) < a < fmpq(3, 2)
    assert -a < 0
    assert not a - a
    assert float(3 - a) == pytest.approx(3 - np.sqrt(2.0), abs=1e-15)
    with pytest.raises(ZeroDivisionError):
        a / (a * a - 2)


def test_a_rational_root_of_a_composite_polynomial_is_recognised():
    found = real_roots((3 * X - 8) * (X**2 - 7) * (X**2 - 8), fmpq(0), fmpq(20))
    assert exact_value(next(root for root in found if 2.66 < float(root) < 2.7)) == fmpq(8, 3)
