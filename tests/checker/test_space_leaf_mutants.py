"""Forged leaves "l" in 3D: refused, or what they say is true."""

import functools

import numpy as np
import pytest
from complete import all_roots
from effort import some
from problems3d import degenerate_integers
from proof_tools import copied, of_kind, proof_of, put, put_in_all, records_of, refused, replaced
from trees import by_the_tree

from enumsol import verify
from enumsol.search.space.space_search import SpaceSolvers

_BOX, _BOX_RAD, _RHO, _MID, _RAD, _INDEX = range(1, 7)
SEEDS = (2, 7, 47, 26)


@functools.cache
def proven(seed):
    """Problem, records of a proof with such leaves, and their places."""
    problem, *_ = degenerate_integers(seed)
    with by_the_tree():
        records = records_of(all_roots(problem, 0).proof)
    return problem, records, of_kind(records, "l")


def times(factor):
    return lambda values: [factor * value for value in values]


def shifted(step):
    return lambda values: [value + step for value in values]


def shorter(values):
    return values[:-1]


def longer(values):
    return [*values, 1.0]


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("seed", SEEDS)
def test_changed_leaves_are_refused(seed):
    problem, records, places = proven(seed)
    assert places
    assert verify(problem, proof_of(records)).complete
    changes = {
        _INDEX: (lambda index: -index, float, 0),
        _MID: (shifted(1e-3), None),
        _RAD: (times(0.0), times(-1.0)),
        _BOX: (shifted(1.0), shorter, "box"),
        _BOX_RAD: (*map(times, (0.0, -1.0, 1e6, 1e-300)), longer, lambda values: [True] * len(values)),
        _RHO: (*map(times, (0.0, -1.0, 1e300)), longer),
    }
    for entry, values in changes.items():
        for number, value in enumerate(values):
            assert refused(problem, put_in_all(records, places, entry, value)), (entry, number)


@pytest.mark.few(1, 1)
@pytest.mark.parametrize("seed", SEEDS)
def test_one_rho_of_both_components_is_changed(seed):
    problem, records, places = proven(seed)
    tau = SpaceSolvers(problem, 0.0, "verified").system.tau
    pairs = tau[np.all(tau >= 0, axis=1)]
    assert len(pairs)
    for k in pairs.ravel():
        for factor in (8.0, 1 + 2.0**-52):
            assert refused(problem, put(records, (places[0], _RHO, int(k)), lambda rho, by=factor: by * rho))


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("seed", SEEDS)
def test_boxes_at_other_leaves(seed):
    """Leaves that hold nothing, or a regular root, and parts of the tree that are not decided, said to be in a box."""
    (problem, records, places), refusals = proven(seed), 0
    leaves = of_kind(records, "r", "x")
    for k in leaves[:: max(1, len(leaves) // 6)]:
        record = records[k]
        report = verify(problem, proof_of(replaced(records, k, records[places[0]])))
        # where a complete leaf holds nothing, all of it lies in the box
        assert not report.ok or (record[0] == "x" and report.roots == records[-1]["roots"])
        refusals += not report.ok
    assert refusals


@pytest.mark.few(2, 0)
@pytest.mark.parametrize("seed", SEEDS)
def test_leaves_that_are_left_out(seed):
    """A leaf with the root is said to hold nothing, or is not there, and the counts are as before or fit that."""
    problem, records, places = proven(seed)
    assert refused(problem, replaced(records, places[0], ["n"]))
    assert refused(problem, replaced(records, places[0]))
    assert refused(problem, put(records, (-1, "roots"), lambda roots: roots + 1))
    changed = put(replaced(records, places[0], ["u", "open"]), (-1, "undecided"), lambda undecided: undecided + 1)
    assert not verify(problem, proof_of(changed)).complete


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("part", range(4))
def test_random_changes(part):
    """Accepted, at most, where the box is one of the same root."""
    rng, seed = np.random.default_rng(part), SEEDS[part]
    problem, records, places = proven(seed)
    known, system = records[places[0]], SpaceSolvers(problem, 0.0, "verified").system
    accepted = 0
    for _ in range(count := some(8, of=20)):
        changed = copied(records)
        record = changed[places[int(rng.integers(len(places)))]]
        entry = int(rng.integers(1, 6))
        k = int(rng.integers(len(record[entry])))
        record[entry][k] *= float(rng.choice([-1.0, 0.0, 0.5, 2.0, 100.0, 1 + 1e-9]))
        record[entry][k] += float(rng.choice([0.0, 1e-12, 1e-6, 1e-3, 1.0]))
        report = verify(problem, proof_of(changed))
        if report.ok:
            accepted += 1
            assert (report.complete, report.roots) == (True, changed[-1]["roots"])
            mid, rad = np.array(record[_MID]), np.array(record[_RAD])
            assert np.all(np.abs(mid - known[_MID]) <= rad + np.array(known[_RAD]))
            # zeta = (I + rho S) (y - c) of the known root, and what its radius adds
            S = system.S / np.outer(system.unit, system.unit)
            map_ = np.eye(len(mid)) + np.array(record[_RHO])[:, None] * S
            away = np.abs(map_ @ (np.array(known[_MID]) - record[_BOX]))
            assert np.all(away <= record[_BOX_RAD] + np.abs(map_) @ known[_RAD])
    assert accepted < count
