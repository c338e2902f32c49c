"""Multipliers are rounded before they are written, where they prove as much."""

import numpy as np
from generators import named
from proof_tools import leaves_of, multipliers, proof_of, records_of

from enumsol import enumerate_roots, verify
from enumsol.proof.proof_file import coarse
from enumsol.search.certifiers.protocol import RecordedBound
from enumsol.search.solvers import Solvers
from enumsol.selections.float_selections import SIGN_TOLERANCE


def test_shortened():
    values = np.append(np.random.default_rng(1).normal(size=1000) * 10.0 ** np.arange(-300, 300, 0.6), [0.0, 1.5])
    values.flags.writeable = False
    short = coarse(values)
    assert np.all(np.abs(short - values) <= 2.0**-21 * np.abs(values))
    assert np.array_equal(np.sign(short), np.sign(values))
    assert not np.any(short.view(np.uint64) & np.uint64(0xFFFFFFFF))
    assert np.array_equal(coarse(short), short)
    assert coarse(np.array([1 - 2.0**-53, np.finfo(float).max])).tolist() == [1.0, np.inf]


def test_a_proof_has_rounded_multipliers():
    problem, alpha = named("wedge-14-5")
    found = enumerate_roots(problem, alpha)
    values = np.concatenate([multipliers(record)[1] for record in records_of(found.proof)[1:-1] if record[0] == "x"])
    assert len(values) > 5000
    assert np.mean(values == coarse(values)) > 0.9
    assert verify(problem, found.proof).complete


def test_multipliers_that_exclude_only_as_they_are_stay_as_they_are():
    problem, alpha = named("wedge-8-5")
    records = records_of(enumerate_roots(problem, alpha).proof)
    solvers = Solvers(problem, alpha, "verified", SIGN_TOLERANCE)

    class Written(list):
        write = list.append

    rounded = kept = 0
    for k, codes in leaves_of(records):
        if records[k][0] != "x":
            continue
        rows, values = map(np.array, multipliers(records[k]))
        certifier = solvers.certifier(written := Written())
        # the largest factor with which they exclude, to the last bit
        low, high = 1.0, 1e9
        assert not certifier.excluded(codes, RecordedBound(rows, high * values))
        while low < (middle := 0.5 * (low + high)) < high:
            written.clear()
            if certifier.excluded(codes, RecordedBound(rows, middle * values)):
                low, records[k] = middle, list(written[0])
            else:
                high = middle
        given, stored = low * values, np.array(multipliers(records[k])[1])
        if np.array_equal(stored, given):
            kept += 1
        else:
            assert np.array_equal(stored, coarse(given))
            rounded += 1
    assert kept > 10
    assert rounded > 10
    # whichever were written, they are those that were proven
    assert verify(problem, proof_of(records)).complete
