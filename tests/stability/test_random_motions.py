"""Verdicts on random linearized motions against all sets of sliding nodes, in floats."""

from collections import Counter

import numpy as np
import pytest
from growing_motions import growing_motions
from linear_motions import random_motion, setting

from enumsol.search.stability import StabilitySearch
from enumsol.trusted.running_away import everywhere


def verdict(proven):
    if proven.growing:
        return "runs away"
    return "undecided" if proven.gaps or not everywhere(proven.ranges) else "does not run away"


def compared(seeds, **kind):
    """Counts of verdicts; none of them contradicts the judge, and rates are those that it finds."""
    counts = Counter()
    for seed in seeds:
        data = random_motion(np.random.default_rng(seed), **kind)
        judged = growing_motions(*data)
        stiffness, motions = setting(*data)
        proven = StabilitySearch(stiffness, motions).run()
        said = verdict(proven)
        counts[said] += 1
        if said != "undecided":
            assert (said == "runs away") == bool(judged), seed
        for leaf in (leaf for _, _, leaves in proven.ranges for leaf in leaves):
            assert leaf.holds(stiffness, motions)
        for _, motion in proven.growing:
            low, high = motion.mu
            assert any(low * (1 - 1e-6) <= mu <= high * (1 + 1e-6) for mu, *_ in judged), seed
    return counts


def test_sixty_random_motions():
    counts = compared([(1, k) for k in range(60)])
    assert counts["undecided"] <= 1, counts
    assert min(counts["runs away"], counts["does not run away"]) >= 5


@pytest.mark.slow
def test_motions_with_touching_nodes():
    counts = compared([(2, k) for k in range(30)], touching=True)
    assert counts["undecided"] <= 2, counts


@pytest.mark.slow
def test_degrees_of_freedom_without_mass():
    counts = compared([(3, k) for k in range(20)], massless=True)
    assert counts["undecided"] <= 1, counts


@pytest.mark.long
@pytest.mark.parametrize("part", range(8))
def test_two_thousand_random_motions(part):
    counts = compared([(4, part, k) for k in range(250)])
    assert counts["undecided"] <= 5, counts


@pytest.mark.long
@pytest.mark.parametrize("part", range(3))
def test_three_hundred_with_touching_nodes(part):
    counts = compared([(5, part, k) for k in range(100)], touching=True)
    assert counts["undecided"] <= 2, counts
