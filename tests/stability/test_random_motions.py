"""Verdicts on random linearized motions against all sets of sliding nodes, in floats."""

from collections import Counter

import numpy as np
import pytest
from growing_motions import growing_in_space, growing_motions
from linear_motions import random_motion, random_motion_in_space, setting, setting_in_space

from enumsol.search.stability import StabilitySearch
from enumsol.trusted.running_away import NoMotion, left_open
from enumsol.trusted.status_rows import OPEN, STICK


def verdict(proven):
    if proven.growing:
        return "runs away"
    return "undecided" if proven.gaps or left_open(proven.leaves) else "does not run away"


def compared(seeds, *, in_space=False, **kind):
    """Counts of verdicts; none of them contradicts the judge, and rates are those that it finds."""
    counts = Counter()
    for seed in seeds:
        rng = np.random.default_rng(seed)
        if in_space:
            data = random_motion_in_space(rng)
            judged, (stiffness, motions) = growing_in_space(*data[:-1]), setting_in_space(*data)
        else:
            data = random_motion(rng, **kind)
            judged, (stiffness, motions) = growing_motions(*data), setting(*data)
        proven = StabilitySearch(stiffness, motions).run()
        said = verdict(proven)
        counts[said] += 1
        if said != "undecided":
            assert (said == "runs away") == bool(judged), seed
        for leaf in proven.leaves:
            assert leaf.holds(stiffness, motions)
        for own, _ in proven.growing:
            assert any(own.low * (1 - 1e-6) <= mu <= own.high * (1 + 1e-6) for mu, *_ in judged), seed
    return counts


def test_sixty_random_motions():
    counts = compared([(1, k) for k in range(60)])
    assert counts["undecided"] <= 1, counts
    assert min(counts["runs away"], counts["does not run away"]) >= 5


@pytest.mark.slow
def test_motions_with_touching_nodes():
    counts = compared([(2, k) for k in range(30)], touching=True)
    assert counts["undecided"] <= 2, counts


def test_degrees_of_freedom_without_mass():
    counts = compared([(3, k) for k in range(12)], massless=True)
    assert not counts["undecided"], counts


@pytest.mark.long
@pytest.mark.parametrize("part", range(8))
def test_two_thousand_random_motions(part):
    counts = compared([(4, part, k) for k in range(250)])
    assert counts["undecided"] <= 5, counts


def test_no_range_without_end_hides_what_grows_where_some_nodes_have_no_mass():
    tried = 0
    for k in range(120):
        data = random_motion(rng := np.random.default_rng((9, k)), massless=True)
        if not (judged := growing_motions(*data)):
            continue
        stiffness, motions = setting(*data)
        size, low = len(motions.signed), 0.5 * max(mu for mu, *_ in judged)
        for weights in (
            np.eye(size),
            np.diag(rng.uniform(0.2, 2, size)),
            np.eye(size) - 0.3 * rng.random((size, size)),
        ):
            for beside in (None, 0.0, 0.5 * low):
                tried += 1
                none = np.zeros((size, size))
                assert not NoMotion(low, np.inf, beside, (), (), weights, (none, none)).holds(stiffness, motions), k
    assert tried >= 30


@pytest.mark.long
@pytest.mark.parametrize("part", range(2))
def test_five_hundred_with_degrees_of_freedom_without_mass(part):
    counts = compared([(8, part, k) for k in range(250)], massless=True)
    assert counts["undecided"] <= 5, counts


@pytest.mark.long
@pytest.mark.parametrize("part", range(3))
def test_three_hundred_with_touching_nodes(part):
    counts = compared([(5, part, k) for k in range(100)], touching=True)
    assert counts["undecided"] <= 2, counts


@pytest.mark.parametrize(("press", "shear", "code"), [(-0.2, 0.1, STICK), (0.2, 0.1, OPEN), (-0.2, 0.4, None)])
def test_a_node_that_touches_in_space_sticks_or_is_open(press, shear, code):
    """The slip of one node, mu = F A_nt - A_tt = 0.35, presses on another one, or leaves it; slips are not proven."""
    A = np.eye(6) * 2
    A[1, 1], A[0, 1], A[1, 3], A[1, 4] = 1.0, 0.9, press, shear
    A = np.triu(A) + np.triu(A, 1).T
    rows, F = np.eye(6), np.array([[1.5, 1.5], [1.0, 2.0]])
    W = np.stack([rows[[1, 4]], rows[[2, 5]]], axis=1) * F[:, :, None]
    data = A, np.eye(6), rows[[0, 3]], W, ["limit", "touching"], np.array([[1.0, 0.0], [1.0, 0.0]])
    growing = StabilitySearch(*setting_in_space(*data, F)).run().growing
    judged = [mu for mu, *_ in growing_in_space(*data)]
    assert judged
    assert [own.way.touching for own, _ in growing] == ([(code,)] if code is not None else [])
    if code is not None:
        [(own, _)] = growing
        assert any(own.low * (1 - 1e-6) <= mu <= own.high * (1 + 1e-6) for mu in judged)
        assert code == OPEN or own.low == pytest.approx(0.35)


@pytest.mark.slow
def test_nodes_that_touch_in_space():
    counts = compared([(6, k) for k in range(12)], in_space=True)
    assert counts["does not run away"], counts


@pytest.mark.long
@pytest.mark.parametrize("part", range(2))
def test_two_hundred_with_a_node_that_touches_in_space(part):
    counts = compared([(7, part, k) for k in range(100)], in_space=True)
    assert counts["undecided"] <= 10, counts
