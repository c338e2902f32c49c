"""Certificates that were changed: none says what is not so."""

import dataclasses

import numpy as np
import pytest
from growing_motions import growing_motions
from linear_motions import random_motion, setting

from enumsol.arithmetic.balls import Ball
from enumsol.search.stability import StabilitySearch
from enumsol.trusted.running_away import Behaviour, Growing, Motions, NoMotion, Touching, covers, left_open


def numbers(rng, value):
    """A number of an end of a range, changed."""
    factor = float(np.exp(rng.normal()))
    return float(rng.choice([value * factor, -value, 0.0, np.inf, np.nan, value + rng.normal(), 1e300, 1e-300]))


def indices(rng, values, count):
    """Indices, with one more, one less, one twice or one that is none."""
    values, at = list(values), int(rng.integers(-1, count + 1))
    return tuple([[*values, at], values[1:], values + values[:1], sorted({*values, at})][rng.integers(4)])


def matrix(rng, given):
    """A matrix with entries changed, of another sign or shape, or without one that is finite."""
    changed = given.copy()
    at = tuple(rng.integers(0, size) for size in given.shape)
    changed[at] = rng.choice([np.nan, np.inf, -1.0, 1.0, rng.normal() * 10, -changed[at], 0.0])
    return [changed, given + rng.normal(size=given.shape) * 0.3, -given, 2 * given, given[:-1], given * 0][
        rng.integers(6)
    ]


def mutant_of_no_motion(rng, leaf):
    k, field = len(leaf.weights), rng.choice(["low", "high", "beside", "slides", "stays", "weights", "products"])
    old = getattr(leaf, field)
    if field == "products":
        new = (matrix(rng, old[0]), old[1]) if rng.random() < 0.5 else (old[0], matrix(rng, old[1]))
    elif field == "weights":
        new = matrix(rng, old)
    elif field in ("slides", "stays"):
        new = indices(rng, old, k)
    else:
        new = numbers(rng, 1.0 if old is None or not np.isfinite(old) else old)
        new = None if field == "beside" and rng.random() < 0.3 else new
    return dataclasses.replace(leaf, **{field: new})


def mutant_of_growing(rng, leaf, motions):
    field = rng.choice(["low", "high", "slides", "touching"])
    if field == "touching":
        codes = tuple(rng.integers(-1, 5, len(motions.touching) + rng.integers(2)))
        return dataclasses.replace(leaf, way=dataclasses.replace(leaf.way, touching=codes))
    if field == "slides":
        changed = indices(rng, leaf.way.slides, motions.limits)
        return dataclasses.replace(leaf, way=dataclasses.replace(leaf.way, slides=changed))
    return dataclasses.replace(leaf, **{field: numbers(rng, getattr(leaf, field))})


def check(seed, count):
    """Mutants of certificates of one problem, and of any numbers at all; how many were accepted."""
    rng = np.random.default_rng(seed)
    data = random_motion(rng, touching=seed[-1] % 2 == 1)
    stiffness, motions = setting(*data)
    judged = [mu for mu, *_ in growing_motions(*data)]
    proven = StabilitySearch(stiffness, motions).run()
    k, accepted = len(motions.signed), 0
    leaves = list(proven.leaves)
    leaves = leaves or [NoMotion(0.0, 1.0, None, (), (), np.eye(k), (np.zeros((k, k)),) * 2)]
    growing = [certificate for certificate, _ in proven.growing]
    growing = growing or [Growing(0.5, 2.0, Behaviour(tuple(range(motions.limits)), (0,) * len(motions.touching)))]
    for _ in range(count):
        if rng.random() < 0.7:
            leaf = mutant_of_no_motion(rng, leaves[rng.integers(len(leaves))])
            held = leaf.holds(stiffness, motions)
            accepted += held
            # a leaf that decides nothing speaks about all motions of its range
            if held and not leaf.slides and not leaf.stays:
                assert not any(leaf.low <= mu <= leaf.high for mu in judged), (seed, leaf)
        else:
            said = mutant_of_growing(rng, growing[rng.integers(len(growing))], motions)
            found = said.found(stiffness, motions)
            accepted += found is not None
            assert found is None or any(said.low * (1 - 1e-6) <= mu <= said.high * (1 + 1e-6) for mu in judged), seed
    return accepted


def test_hundreds_of_mutants():
    assert sum(check((11, k), 30) for k in range(12)) > 0


@pytest.mark.long
def test_two_thousand_mutants():
    assert sum(check((12, k), 40) for k in range(60)) > 0


def one_node(F, touching=False, A=((1.0, 0.9), (0.9, 1.0))):
    kinds = ["touching" if touching else "limit"]
    return setting(np.array(A), np.eye(2), np.eye(2)[:1], np.eye(2)[1:], np.array([F]), kinds, np.ones(1))


def leaf(k, weights=None, **more):
    zero = np.zeros((k, k))
    fields = {"low": 0.0, "high": 1.0, "beside": None, "slides": (), "stays": (), "products": (zero, zero)}
    return NoMotion(**(fields | more), weights=np.eye(k) if weights is None else weights)


def test_forged_weights():
    """A range in which the node runs away: no sign, product or decision hides it."""
    stiffness, motions = one_node(2.0)
    [growing] = StabilitySearch(stiffness, motions).run().growing
    mu = 0.5 * (growing[0].low + growing[0].high)
    assert mu == pytest.approx(0.8)
    assert not leaf(1).holds(stiffness, motions)
    assert not leaf(1, products=(np.array([[-9.0]]),) * 2).holds(stiffness, motions)
    for weights in (-np.eye(1), 0 * np.eye(1), np.full((1, 1), np.nan)):
        assert not leaf(1, weights, low=0.75, high=0.85).holds(stiffness, motions)
    # K is known to be less than its value at the end, and is more above it
    assert leaf(1, low=1.0, high=2.0, beside=0.9).holds(stiffness, motions)
    assert not leaf(1, low=0.0, high=2.0, beside=1.0).holds(stiffness, motions)
    assert leaf(1, low=0.0, high=0.7, beside=1.0, weights=-np.eye(1)).holds(stiffness, motions)
    # that it stays or slides are two things, and both are needed
    stays = leaf(1, high=np.inf, beside=-0.01, stays=(0,))
    assert stays.holds(stiffness, motions)
    assert left_open([stays]) == (0.0, np.inf)
    assert not leaf(1, stays=(0,), slides=(0,)).holds(stiffness, motions)
    assert not leaf(1, stays=(0, 0)).holds(stiffness, motions)
    assert not leaf(1, stays=(1,)).holds(stiffness, motions)


@pytest.mark.parametrize("high", [1.0, np.inf])
def test_slopes_that_overflow_prove_nothing(high):
    """A slope of K between two ends that are as near as floats can be."""
    stiffness, motions = one_node(0.5)
    assert leaf(1, low=0.5, high=high, beside=0.0).holds(stiffness, motions)
    assert not leaf(1, low=5e-324, high=high, beside=0.0).holds(stiffness, motions)


@pytest.mark.parametrize("value", [0.0, np.nan])
def test_no_form_is_definite_in_a_component_that_moves_nothing(value):
    stiffness, motions = one_node(0.5)
    none = Ball.exact(np.full((2, 1), value))
    for more in ({"high": 1.0}, {"low": 1.0, "high": np.inf, "beside": 0.0}):
        assert leaf(1, **more).holds(stiffness, motions)
        assert not leaf(1, **more).holds(stiffness, Motions(none, none, motions.signed))


def test_ranges_that_leave_something_out():
    one = leaf(2, slides=(0,)), leaf(2, stays=(0,), slides=(1,)), leaf(2, stays=(0, 1))
    assert covers(one)
    assert not covers(one[:2])
    assert not covers(one[1:])
    assert not covers([])
    whole = leaf(2), leaf(2, low=1.0, high=np.inf)
    assert left_open(whole) is None
    assert left_open([whole[0], leaf(2, low=1.5, high=np.inf)]) == (1.0, 1.5)
    assert left_open(whole[:1]) == (1.0, np.inf)
    assert left_open(whole[1:]) == (0.0, 1.0)
    assert left_open([]) == (0.0, np.inf)


def test_a_node_that_touches_and_leans():
    """The share of friction of a node that touches is not negative, nor is it larger than friction allows."""
    stiffness, motions = one_node(0.5, touching=True)
    assert leaf(2).holds(stiffness, motions)
    for lean, other, admitted in ((0.4, 0.0, True), (0.6, 0.0, False), (0.0, 0.1, False), (-0.4, 0.0, True)):
        assert leaf(2, np.array([[1.0, lean], [other, 1]]))._admitted(motions) == admitted
    [node] = motions.touching
    for F in (0.0, -1.0):
        none = Motions(
            motions.moves,
            motions.slopes,
            motions.signed,
            (Touching(node.leaves, node.slides, Ball.exact(np.array(F))),),
        )
        for share in (-1.0, -1e-3):
            leans = leaf(2, np.array([[1.0, 0.0], [0, share]]), slides=())
            assert not leans._admitted(none)


def test_nodes_that_may_stick():
    """Where a node may stick at its limit or not, no force of it has a sign for sure, and nothing surely grows."""
    data = random_motion(np.random.default_rng(4))
    data = (*data[:5], ["limit"] * len(data[4]), data[6])
    data[4][data[4] == 0] = 0.5
    k = len(data[4])
    stiffness, motions = setting(*data, unsure=(0,))
    weights = np.eye(k) - 0.01 * (1 - np.eye(k))
    assert k == 1 or not leaf(k, weights)._admitted(motions)
    weights[0, 1:] = 0.0
    assert leaf(k, weights)._admitted(motions)
    assert Growing(0.5, 2.0, Behaviour((0,))).found(stiffness, motions) is None
