"""What a page says first: how many solutions there are where, read back and compared with the numbers."""

import re
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest

from enumsol import branch_graph, gallery
from enumsol.branches.claims import MultiplicitySteps

WORDS = ["none", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve"]


def steps_of(alphas, at, between, exact=True):
    return MultiplicitySteps(tuple(map(Fraction, alphas)), tuple(at), tuple(between), exact)


@pytest.mark.parametrize(
    ("alphas", "at", "between", "words"),
    [
        ([-1, -0.79, -0.005, 1], [1, 2, 2, 1], [1, 3, 1], "three solutions for alpha between -0.79 and -0.005, one "
         "elsewhere; two at -0.79 and two at -0.005"),
        ([0, 1, 2], [1, 1, 2], [1, 2], "two solutions for alpha between 1 and 2, one elsewhere"),
        ([0, 1], [3, 3], [3], "three solutions throughout"),
        ([0, 1, 2], [1, 2, 1], [1, 1], "one solution throughout; two at 1"),
        ([0, 1, 2], [1, 1, 1], [1, 1], ""),
        ([0, 1, 2, 3], [0, 1, 1, 2], [0, 1, 2], "two solutions for alpha between 2 and 3, one between 1 and 2, none "
         "elsewhere; one at 1 and one at 2"),
        ([0, 1, 1 + 1e-9, 2], [1, 3, 4, 3], [1, 5, 3], "three solutions for alpha between 1 and 2, one elsewhere; "
         "three to five near 1"),
        ([0, 1, 1 + 1e-9, 2], [1, 2, 3, 3], [1, 3, 3], "three solutions for alpha between 1 and 2, one elsewhere"),
    ],
)  # fmt: skip
def test_examples(alphas, at, between, words):
    assert steps_of(alphas, at, between).sentence() == words


def test_lower_bounds_are_called_so():
    bound = steps_of([0, 1, 2], [1, 3, 3], [1, 3], exact=False)
    assert bound.sentence() == "at least three solutions for alpha between 1 and 2, at least one elsewhere"
    assert steps_of([0, 1, 2], [1, 2, 1], [1, 1], exact=False).sentence() == ""
    assert steps_of([0, 1, 2], [3, 1, 3], [3, 3], exact=False).sentence() == (
        "at least three solutions throughout; at least one at 1"
    )
    assert steps_of([0.5], [2], [], exact=False).sentence() == steps_of([], [], [], exact=False).sentence() == ""


def read(words, alpha, ends):
    """The number that a sentence says of an alpha, and whether it is a lower bound."""
    main, _, single = words.partition("; ")
    for number, place in re.findall(r"(\w+) at (-?[\d.]+)", single):
        if float(place) == alpha:
            return WORDS.index(number)
    said, number = {}, None
    for part in re.split(r", | and (?=between)", main.replace("at least ", "").replace("perhaps ", "")):
        start = re.match(r"(\w+) (?:solutions? )?(?:for alpha )?(?=between|elsewhere|throughout)", part)
        number = WORDS.index(start[1].replace("no", "none") if start[1] == "no" else start[1]) if start else number
        if not (spans := re.findall(r"between (-?[\d.]+) and (-?[\d.]+)", part)):
            said["rest"] = number
        for low, high in spans:
            if float(low) < alpha < float(high) or (alpha in ends and alpha in (float(low), float(high))):
                return number
    return said["rest"]


@pytest.mark.parametrize("exact", [True, False])
def test_sentences_say_what_the_numbers_say(exact):
    draws, spoken = np.random.default_rng(5), 0
    for _ in range(400):
        count = int(draws.integers(2, 7))
        alphas = [0, *sorted(draws.choice(np.arange(1, 100), count - 2, replace=False).tolist()), 100]
        at, between = draws.integers(0, 4, count).tolist(), draws.integers(0, 4, count - 1).tolist()
        words = steps_of(alphas, at, between, exact).sentence()
        if not words or "other numbers" in words:
            continue
        spoken += 1
        middles = [(a + b) / 2 for a, b in pairwise(alphas)]
        for alpha, true in [*zip(middles, between, strict=True), *zip(alphas, at, strict=True)]:
            told = read(words, alpha, (0, 100))
            assert told == true if exact else told <= true, (words, alpha, true)
    assert spoken > 100


def test_many_ranges_are_not_all_named():
    alphas, between = range(21), [1, 5] * 10
    words = steps_of(alphas, [1] * 21, between).sentence()
    assert words == "five solutions for alpha between 1 and 2, between 3 and 4 and in 8 more ranges, fewer elsewhere"
    assert steps_of(alphas, [7] * 21, between).sentence().endswith("fewer elsewhere; other numbers at single alphas")
    bound = steps_of(alphas, [1] * 21, between, exact=False).sentence()
    assert bound.startswith("at least five solutions")
    assert bound.endswith("at least one elsewhere")


@pytest.mark.parametrize(
    ("alphas", "between", "start"),
    [
        ([0, 1, 2, 6], [3, 1, 3], 4),  # the widest of those with most
        ([0, 1, 1.001, 4], [1, 5, 3], 2.5005),  # not one that no slider finds
        ([0, 1e-3, 2e-3], [1, 2], 1.5e-3),
        ([0, 1, 2, 4], [1, 3, 3], 2.5),
        ([0, 2, 3, 4], [3, 3, 3], 2.5),  # 2 is critical
    ],
)
def test_a_page_opens_in_the_middle_of_the_widest_range_with_most(alphas, between, start):
    assert steps_of(alphas, [1] * len(alphas), between).busiest() == pytest.approx(start)


def test_a_graph_says_it_first():
    square = gallery.two_node_square()
    whole, cut = branch_graph(square, (0, 10)), branch_graph(square, (0, 10), max_nodes=8)
    fast = branch_graph(square, (0, 10), "fast")
    first = "five solutions for alpha between 3 and 3.828, three between 3.828 and 10, one elsewhere"
    assert whole.claims.sentences(None)[0].startswith(first)
    assert fast.claims.sentences(None)[0].startswith(first)
    assert fast.claims.sentences(None)[0].endswith(", not proven")
    assert cut.reasons
    assert all("at least" in line or "solutions for" not in line for line in cut.claims.sentences(None))
