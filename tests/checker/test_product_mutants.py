"""Forged forms of products and leaves "e" and "j" of proofs in 3D: refused, or what they say is true."""

import functools

import numpy as np
import pytest
from complete import all_roots
from problems3d import from_compliance, soft_or_coupled
from proof_tools import copied, of_kind, proof_of, put_in_all, records_of, refused, replaced
from trees import products_at_once

from enumsol import verify
from enumsol.model.sectors import SECTORS

_CODES, _CENTRE, _NUMBERS = 1, 2, 3


@functools.cache
def proven():
    """Problem and records of a proof with such leaves of both kinds."""
    S, g, F = soft_or_coupled(8, 2)
    problem = from_compliance(S, g, (F[:, 0], F[:, 1]))
    with products_at_once():
        roots = all_roots(problem, 0)
    return problem, records_of(roots.proof)


def products(records):
    """Places of the forms of products."""
    return [k for k in of_kind(records, "q") if len(records[k]) == 4]


def test_the_proof_has_all_of_them_and_is_accepted():
    problem, records = proven()
    assert len(of_kind(records, "q")) >= 2
    assert of_kind(records, "j")
    assert len(of_kind(records, "e")) > 3
    assert verify(problem, proof_of(records)).complete


@pytest.mark.parametrize(
    ("entry", "function"),
    [
        (_NUMBERS, lambda values: [-value for value in values]),
        (_NUMBERS, lambda values: values[:-1]),
        (_NUMBERS, lambda values: [*values, 1.0]),
        (_NUMBERS, lambda values: [0.0] * len(values)),
        (_NUMBERS, lambda values: None),
        (_NUMBERS, lambda values: [1e300 * value for value in values]),
        (_CENTRE, lambda values: [value + 10.0 for value in values]),
        (_CENTRE, lambda values: values[:-1]),
        (_CENTRE, lambda values: "centre"),
        (_CODES, lambda codes: [6, *codes[1:]]),
        (_CODES, lambda codes: [0] * len(codes)),
        (_CODES, lambda codes: [float(code) for code in codes]),
        (_CODES, lambda codes: codes[:-1]),
        (_CODES, lambda codes: [code + 4 if code > SECTORS else code for code in codes]),
        (_CODES, lambda codes: [SECTORS + 1 if code > SECTORS else code for code in codes]),
    ],
)
def test_changed_forms_are_refused(entry, function):
    problem, records = proven()
    assert refused(problem, put_in_all(records, products(records), entry, function))


@pytest.mark.parametrize(
    ("entry", "function"),
    [
        (1, lambda values: [value + 1.0 for value in values]),
        (2, lambda values: [0.5 * value for value in values]),
        (2, lambda values: [1e6 * value for value in values]),
        (3, lambda values: [-value for value in values]),
        (4, lambda values: [value + 1e-3 for value in values]),
        (5, lambda values: [0.0 for _ in values]),
        (6, lambda index: -index),
    ],
)
def test_changed_boxes_are_refused(entry, function):
    problem, records = proven()
    assert refused(problem, put_in_all(records, of_kind(records, "j"), entry, function))


def test_a_form_that_is_left_out_or_stands_elsewhere():
    problem, records = proven()
    forms = products(records)
    without = [record for k, record in enumerate(records) if k not in forms]
    first_for_all = [record for k, record in enumerate(records) if k not in forms[1:]]
    assert refused(problem, without)
    assert refused(problem, first_for_all)


def test_leaves_that_say_something_else():
    """A leaf that holds a root is said to hold none; one of the energy is said to be one of a form."""
    problem, records = proven()
    first = of_kind(records, "q")[0]
    for k in of_kind(records, "j", "x"):
        # one of the energy may be one of a form, but not before any form was declared
        assert refused(problem, replaced(records, k, ["e"])) or (records[k][0] == "x" and k > first)


@pytest.mark.few(1, 2)
@pytest.mark.parametrize("part", range(4))
def test_random_changes(part):
    """What is accepted has the roots that there are."""
    problem, records = proven()
    rng, accepted = np.random.default_rng(part), 0
    forms = products(records)
    for _ in range(15):
        changed = copied(records)
        record = changed[forms[int(rng.integers(len(forms)))]]
        entry = int(rng.integers(2, 4))
        k = int(rng.integers(len(record[entry])))
        record[entry][k] *= float(rng.choice([-1.0, 0.0, 0.5, 2.0, 1 + 1e-9]))
        record[entry][k] += float(rng.choice([0.0, 1e-9, 1e-3, 1.0]))
        report = verify(problem, proof_of(changed))
        if report.ok:
            accepted += 1
            assert report.roots == records[-1]["roots"]
    assert accepted < 15
