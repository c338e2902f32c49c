"""Mutation testing of proofs: an accepted mutant is still a proof, by exact judgement; a damaged file is refused."""

import base64
import functools
import json
import struct

import numpy as np
import pytest
from generators import integer_problem
from hypothesis import HealthCheck, assume, given, settings, strategies as st
from proof_tools import Judge, bytes_of, copied, multipliers, proof_of, records_of, with_multipliers
from rational_checker import check_records

from enumsol import Proof, ProofFormatError, enumerate_roots, gallery, verify

NAMES = ("one-node-6.1", "one-node-6.3", "two-node-5", "two-node-6.4", "degenerate")
QUICK = settings(max_examples=80, deadline=None, suppress_health_check=list(HealthCheck), derandomize=True)


@functools.cache
def case(name):
    if name == "degenerate":
        problem, alpha = integer_problem(np.random.default_rng(34), 2), 0.0
    else:
        entry = gallery.get(name)
        problem, alpha = entry.build(), entry.alpha
    roots = enumerate_roots(problem, alpha)
    return problem, records_of(roots.proof), bytes_of(roots.proof)


def _change_number(draw, value):
    """A number near or far from the given one."""
    how = draw(st.sampled_from(("sign", "scale", "ulp", "small", "zero", "any")))
    return {
        "sign": -value,
        "scale": value * draw(st.sampled_from((0.5, 2.0, 1e-3, 1e3))),
        "ulp": float(np.nextafter(value, np.inf if draw(st.booleans()) else -np.inf)),
        "small": value * (1 + draw(st.floats(-1e-3, 1e-3))),
        "zero": 0.0,
        "any": draw(st.floats(-1e3, 1e3)),
    }[how]


def _mutate(draw, records):
    """Change one thing in the records."""
    k = draw(st.integers(0, len(records) - 1))
    record = records[k]
    how = draw(st.sampled_from(("inside", "inside", "inside", "drop", "repeat", "swap", "copy")))
    if how == "drop":
        del records[k]
    elif how == "repeat":
        records.insert(k, copied(record))
    elif how in ("swap", "copy"):
        other = draw(st.integers(0, len(records) - 1))
        if how == "swap":
            records[k], records[other] = records[other], records[k]
        else:
            records[k] = copied(records[other])
    elif isinstance(record, dict):
        key = draw(st.sampled_from(sorted(record)))
        value = record[key]
        if isinstance(value, list):
            value[draw(st.integers(0, len(value) - 1))] += draw(st.integers(-3, 3))
        elif isinstance(value, int):
            record[key] = value + draw(st.integers(-2, 2))
        elif key == "alpha":
            record[key] = draw(st.sampled_from(("5/1", "4999999/1000000", "7/2", "5000001/1000000", "-1/1", "2/1")))
        else:
            record[key] = draw(st.sampled_from(("problem", "condensed", "")))
    elif record[0] == "b":
        if draw(st.booleans()):
            record[1] += draw(st.integers(-1, 1))
        elif record[2]:
            record[2] = draw(st.permutations(record[2])) if draw(st.booleans()) else [*record[2][1:], 4]
    elif record[0] in ("x", "X"):
        rows, values = multipliers(record)
        assume(rows)
        j = draw(st.integers(0, len(rows) - 1))
        if draw(st.integers(0, 3)):
            values[j] = _change_number(draw, values[j])
        else:
            rows[j] = draw(st.integers(0, 20))
        kind = draw(st.sampled_from((record[0], record[0], "x", "X", "n", "N", "u")))
        records[k] = [kind, *with_multipliers(record, rows, values)[1:]] if kind in ("x", "X") else [kind]
    elif record[0] == "r":
        part = record[draw(st.integers(1, 2))]
        j = draw(st.integers(0, len(part) - 1))
        part[j] = _change_number(draw, part[j])
        record[3] = draw(st.sampled_from((record[3], record[3], record[3], -record[3], 0)))
    elif record[0] == "D":
        point = draw(st.sampled_from(record[1]))
        point[draw(st.integers(0, len(point) - 1))] = draw(st.sampled_from(("0/1", "1/1", "3/2", "-1/1")))
    else:
        records[k] = [draw(st.sampled_from(("n", "N", "u", "z")))]


@pytest.mark.few(3)
@pytest.mark.parametrize("name", NAMES)
@QUICK
@given(data=st.data())
def test_an_accepted_mutant_is_still_a_proof(name, data):
    problem, records, _ = case(name)
    changed = copied(records)
    for _ in range(data.draw(st.integers(1, 2))):
        assume(changed)
        _mutate(data.draw, changed)
    report = verify(problem, proof_of(changed))
    assert report.ok == (not report.failures)
    if report.ok and report.data == "problem":
        assert Judge(problem).valid(changed)
        assert check_records(problem, changed) == changed[-1]
    elif report.ok:
        # certified are S and g as computed, which the exact judge does not know; nothing else may have changed
        assert changed[0]["data"] == "condensed"
        assert Judge(problem).valid([{**changed[0], "data": "problem"}, *changed[1:]])


@pytest.mark.parametrize("name", NAMES)
def test_some_mutants_are_accepted(name):
    # or else the test above would say nothing: other order of children, harmless changes of multipliers and radii
    problem, records, _ = case(name)
    for k, record in enumerate(records[1:-1], start=1):
        changed = copied(records)
        if record[0] == "r" and any(record[2]):
            changed[k][2] = [2 * r for r in record[2]]
        elif record[0] == "x":
            rows, values = multipliers(record)
            changed[k] = with_multipliers(record, rows[::-1], values[::-1])
        else:
            continue
        assert verify(problem, proof_of(changed)).complete
        assert Judge(problem).valid(changed)


@pytest.mark.parametrize("name", NAMES)
def test_any_flipped_bit_is_refused(name):
    problem, _, data = case(name)
    rng = np.random.default_rng(1)
    bits = np.arange(8 * len(data)) if len(data) < 500 else rng.choice(8 * len(data), size=2000, replace=False)
    for bit in bits.tolist():
        flipped = bytearray(data)
        flipped[bit // 8] ^= 1 << bit % 8
        with pytest.raises(ProofFormatError):
            verify(problem, Proof(bytes(flipped)))


# -- fuzzing -----------------------------------------------------------------------------------------------------------

WORDS = st.sampled_from(
    ("b", "x", "X", "n", "N", "r", "D", "z", "u", "", "AAAA", "AAAAAA==", "é", "1/1", "1/0", "-f/3", "1e999", "inf")
)
NUMBERS = st.one_of(
    st.integers(-8, 8),
    st.sampled_from((10**30, -(10**30), 2**31, 2**63, 1e308, -1e308, 5e-324, 0.5)),
    st.floats(-10, 10),
)
VALUES = st.recursive(
    st.one_of(st.none(), st.booleans(), NUMBERS, WORDS),
    lambda inner: st.one_of(
        st.lists(inner, max_size=5), st.dictionaries(st.sampled_from(("roots", "leaves", "p", "q")), inner, max_size=3)
    ),
    max_leaves=12,
)
LITERALS = st.sampled_from(
    ("NaN", "Infinity", '["r",[NaN,NaN],[Infinity,1],1]', '["x","",""', "[" * 5000, "}", "", "\x00")
)


def survives(problem, records):
    """The checker answers or names a format error; the report refuses."""
    try:
        report = verify(problem, proof_of(records))
    except ProofFormatError:
        return
    assert not report.ok
    assert repr(report)


@settings(QUICK, max_examples=200)
@given(st.lists(st.one_of(VALUES, LITERALS), max_size=6))
def test_arbitrary_records(records):
    survives(case("two-node-5")[0], records)


@settings(QUICK, max_examples=200)
@given(st.data())
def test_arbitrary_records_within_a_proof(data):
    problem, records, _ = case(data.draw(st.sampled_from(NAMES)))
    changed = copied(records)
    k = data.draw(st.integers(1, len(records) - 2))
    kind = changed[k][0]
    changed[k] = data.draw(
        st.one_of(
            VALUES,
            LITERALS,
            st.lists(VALUES, max_size=4).map(lambda tail: [kind, *tail]),
            st.tuples(st.sampled_from("bxXnNrDz"), st.lists(VALUES, max_size=4)).map(lambda pair: [pair[0], *pair[1]]),
        )
    )
    assume(changed[k] != records[k])
    try:
        report = verify(problem, proof_of(changed))
    except ProofFormatError:
        return
    assert not report.ok or Judge(problem).valid([json.loads(r) if isinstance(r, str) else r for r in changed])


@settings(QUICK, max_examples=150)
@given(st.data())
def test_arbitrary_headers(data):
    problem, records, _ = case("one-node-6.1")
    changed = copied(records)
    key = data.draw(st.sampled_from([*sorted(changed[0]), "more"]))
    value = data.draw(
        st.one_of(
            VALUES,
            st.lists(st.integers(-1000, 1000), min_size=2, max_size=2),
            st.integers(-900, 900).map(lambda e: [e, e]),
        )
    )
    changed[0][key] = value
    try:
        report = verify(problem, proof_of(changed))
    except ProofFormatError:
        return
    if report.ok:
        assert Judge(problem).valid(changed)


@pytest.mark.parametrize("exponent", [-901, -900, -600, -540, 0, 540, 600, 900, 901])
@pytest.mark.parametrize("other", [-900, 0, 900])
def test_extreme_units(exponent, other):
    for name in ("one-node-6.1", "one-node-6.3"):
        problem, records, _ = case(name)
        changed = copied(records)
        changed[0]["force"], changed[0]["length"] = [exponent] * 2, [other] * 2
        assert not verify(problem, proof_of(changed)).ok or Judge(problem).valid(changed)


@pytest.mark.parametrize(
    "alpha",
    [
        "1e999999999",
        "nan",
        "inf",
        "1/0",
        "",
        "5",
        " 5",
        "0x5",
        "5.0",
        5,
        5.0,
        None,
        ["5"],
        "9" * 5000,
        "1" + "0" * 3999,
    ],
)
def test_alpha_is_a_plain_fraction(alpha):
    problem, records, _ = case("one-node-6.1")
    changed = copied(records)
    changed[0]["alpha"] = alpha
    assert verify(problem, proof_of(changed)).ok == (alpha == "5")


def test_zero_bytes_and_noise():
    problem = case("one-node-6.1")[0]
    rng = np.random.default_rng(2)
    for size in (0, 1, 10, 100, 1000, 100_000):
        for content in (bytes(size), rng.bytes(size), b"enumsol-proof 1\n" + rng.bytes(size)):
            with pytest.raises(ProofFormatError):
                verify(problem, Proof(content))


def test_odd_texts_for_multipliers():
    problem, records, _ = case("one-node-6.1")
    k = next(k for k, record in enumerate(records[:-1]) if k and record[0] == "x")
    ok = base64.b64encode(struct.pack("<d", 1.0)).decode()
    for rows, values in (
        ("AAA=", ok),
        ("AAAAAA==", "AAAA"),
        ("AAAAAA==", ok[:-1]),
        ("é", "é"),
        (1, 2),
        (None, ok),
        ([], {}),
    ):
        changed = copied(records)
        changed[k] = ["x", rows, values]
        survives(problem, changed)
