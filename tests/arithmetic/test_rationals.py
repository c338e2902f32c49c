"""Rational numbers with which intervals are cut."""

from fractions import Fraction

import numpy as np

from enumsol.arithmetic.rationals import simplest


def test_the_simplest_number_between_two_others():
    assert simplest(Fraction(1, 3), Fraction(2, 3)) == Fraction(1, 2)
    assert simplest(Fraction(5, 8), Fraction(11, 16)) == Fraction(5, 8)
    assert simplest(Fraction(-1, 3), Fraction(1, 5)) == 0
    rng = np.random.default_rng(1)
    for _ in range(200):
        low, high = sorted(Fraction(int(n), 1000) for n in rng.choice(5000, 2, replace=False))
        found = simplest(low, high)
        assert low <= found <= high
        # none with half its denominator is there
        half = found.denominator // 2
        assert found.denominator & (found.denominator - 1) == 0
        assert not half or -(-low * half // 1) > high * half


def test_between_numbers_beyond_the_range_of_floats():
    for power in (-2000, 2000):
        step = Fraction(2) ** power
        assert simplest(3 * step, 5 * step) == 4 * step
