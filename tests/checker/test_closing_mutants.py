"""Leaves that close a subtree: forged ones are refused, and any mutant that is accepted is still a proof."""

import functools
from itertools import product

import numpy as np
import pytest
from effort import some
from generators import integer_problem, random_problem
from proof_tools import copied, in_rationals, proof_of, put, records_of, replaced
from rational_checker import check_records
from rational_forms import Refused
from touching import beside_a_loaded_node, row_of_discs, touching_problem
from trees import above_known_roots, every_subtree

from enumsol import enumerate_roots, verify
from enumsol.search import fathoming as closing, solvers

MUTANTS = some(30, of=75)


@functools.cache
def cases(kind):
    """Problems with records of proofs that have such leaves."""
    found, most = [], {"m": some(2, of=5), "counted": some(2, of=5), "a": some(5, of=15)}.get(kind, 5)
    with pytest.MonkeyPatch.context() as patch:
        for problem in problems(kind, patch):
            roots = enumerate_roots(problem, 0)
            records = records_of(roots.proof)
            if roots.certified_data == "problem" and roots.complete and leaves(records, kind):
                found.append((problem, records))
    assert len(found) > most
    return found


def problems(kind, patch):
    """Problems whose proofs are likely to have such leaves, each with rationals or without."""
    if kind in ("slides", "sides"):
        patch.setattr(closing, "_MANY", 1)
        unequal = (2.0, 3.0), (2.0, 3.0, 2.5), (2.0, 2.0, 3.0)
        for limit, weights, stiffness in product((0, 250), unequal, (64.0, 256.0)):
            patch.setattr(solvers, "EXACT_DOF_LIMIT", limit)
            yield row_of_discs(5, weights=weights, friction=0.9, stiffness=stiffness)
        return
    if kind in ("m", "any theta"):
        patch.setattr(solvers, "EXACT_DOF_LIMIT", 0)
    if kind == "any theta":
        for slides, friction, k in product((False, True), (0.25, 0.5, 0.75), (2, 3)):
            yield beside_a_loaded_node(k, slides=slides, grazing=False, friction=friction)
        return
    makers = (random_problem, integer_problem, touching_problem) if kind == "a" else (touching_problem,)
    with above_known_roots() if kind == "a" else every_subtree():
        for seed in range(some(24, of=60) if kind == "a" else some(30, of=60)):
            rng = np.random.default_rng([6, seed] if kind == "a" else seed)
            yield makers[seed % len(makers)](rng, int(rng.integers(2, 4)))


def numbers_in(record):
    """mu, and kappa, nu, theta / F and tau in rows, of a leaf "m" of which all nodes have friction."""
    sliding, numbers = sum(code > 6 for code in record[1]), record[3]
    m = len(record[2]) + sliding
    return numbers[:m], np.reshape(numbers[m:], (4, -1)).tolist()


def leaves(records, kind):
    """Numbers of the records of a kind: "m", "m" in rationals, "m" with sliding nodes, or any theta; "b" with sides."""
    chosen = [(k, record) for k, record in enumerate(records) if isinstance(record, list)]
    if kind == "any theta":
        return [
            k
            for k, record in chosen
            if record[0] == "m" and k not in in_rationals(records, "m") and any(numbers_in(record)[1][3])
        ]
    if kind == "slides":
        return [k for k, record in chosen if record[0] == "m" and max(record[1]) > 6]
    if kind == "sides":
        return [k for k, record in chosen if record[0] == "b" and max(record[2]) > 6]
    if kind in ("m", "counted"):
        counted = in_rationals(records, "m")
        return [k for k, record in chosen if record[0] == "m" and (k in counted) == (kind == "counted")]
    return [k for k, record in chosen if record[0] == kind]


def accepted(problem, records):
    report = verify(problem, proof_of(records))
    assert report.ok == (not report.failures)
    if report.ok:
        assert check_records(problem, records) == records[-1]
    return report.ok


KINDS = ["a", "m", "counted", "slides", "sides", "any theta"]


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("kind", KINDS)
def test_both_checkers_accept(kind):
    for problem, records in cases(kind):
        assert accepted(problem, records)


def changed(record, rng):
    """The record with one entry changed."""
    record = copied(record)
    entries = [k for k in range(1, len(record)) if not isinstance(record[k], list) or record[k]]
    k = int(rng.choice(entries))
    if not isinstance(record[k], list):
        record[k] = int(rng.integers(-1, 3))
        return record
    j = int(rng.integers(len(record[k])))
    value = record[k][j]
    if isinstance(value, int):
        how = rng.integers(3)
        if how == 0:
            del record[k][j]
        else:
            record[k][j] = int(rng.integers(0, 9)) if how == 1 else value + int(rng.integers(-1, 2))
    else:
        scale = float(rng.choice([0.0, -1.0, 0.5, 2.0, 1e3, 1e-3, 1 + 1e-6]))
        record[k][j] = value * scale if rng.random() < 0.8 else float(rng.normal())
    return record


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("kind", KINDS)
def test_an_accepted_mutant_is_still_a_proof(kind):
    rng, refused = np.random.default_rng(5), 0
    for n in range(MUTANTS):
        problem, records = cases(kind)[n % len(cases(kind))]
        records = copied(records)
        k = int(rng.choice(leaves(records, kind)))
        records[k] = changed(records[k], rng)
        if rng.random() < 0.2:
            records[k] = records[k][: len(records[k]) - int(rng.integers(1, 4))]
        refused += not accepted(problem, records)
    assert MUTANTS / 4 < refused < MUTANTS


@pytest.mark.slow
def test_forged_roots_are_refused():
    for problem, records in cases("m"):
        for k in leaves(records, "m"):
            record = records[k]
            forgeries = [[record[0], *record[1:5], [0.0] * (2 * problem.p), 1]] if len(record) == 5 else [record[:5]]
            if len(record) == 7:
                forgeries += [[*record[:6], -record[6]], [*record[:5], [-1.0] * (2 * problem.p), record[6]]]
            for forged in forgeries:
                assert not accepted(problem, replaced(records, k, forged))


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("kind", ["any theta", pytest.param("slides", marks=pytest.mark.slow)])
def test_forged_numbers_are_refused(kind):
    for problem, records in cases(kind):
        for k in leaves(records, kind):
            mu, (kappa, nu, share, tau) = numbers_in(records[k])
            numbers = records[k][3]
            forgeries = [numbers[:-1], [*numbers, 1.0]]
            for x in (0.0, -1.0, 1e200, 1e-200, True, "1", None):
                forgeries += [[*numbers[:n], x, *numbers[n + 1 :]] for n in ((0, len(mu)) if kappa else (0,))]
            if kappa:
                most = [2.0 * mu[0] / F for F in problem.friction[:1]] * len(nu)
                forgeries += [mu, [*mu, *kappa], [*mu, *kappa, *most, *share, *tau]]
                forgeries += [[*mu, *kappa, *nu, *([1.5] * len(nu)), *tau]]
            # theta does not serve nodes that may have any
            if any(tau):
                for last in ((*share, *[0.0] * len(nu)), (*[0.5] * len(nu), *tau)):
                    forgeries.append([*mu, *kappa, *nu, *last])
            for forged in forgeries:
                assert not verify(problem, proof_of(put(records, (k, 3), forged))).ok, (forged, numbers)


@pytest.mark.slow
def test_a_lone_root_is_no_other_and_no_wider():
    for problem, records in cases("a"):
        for k in leaves(records, "a"):
            record, p, rubbing = records[k], problem.p, int(np.count_nonzero(problem.friction))
            forgeries = [record[:-1], [*record, 1], put(record, (5,), -record[5]), put(record, (4,), [-1.0] * (2 * p))]
            forgeries += [put(record, (6,), wrong) for wrong in ([-1.0] * (2 * p), [1.0] * p, [1e3] * (2 * p))]
            for forged in forgeries:
                others = replaced(records, k, forged)
                assert not accepted(problem, others) or check_records(problem, others)
            # the whole problem in its place, whatever the numbers
            footer = {"roots": 1, "families": 0, "undecided": 0, "leaves": 1}
            numbers = [1.0] * (p + rubbing) + [0.0] * (2 * rubbing)
            for strength in (0.0, 1.0, 1e3):
                whole = [
                    records[0],
                    ["a", record[1], numbers, *record[3:6], [strength] * p + [0.0] * p, *record[7:]],
                    footer,
                ]
                assert not accepted(problem, whole) or check_records(problem, whole)


@pytest.mark.slow
def test_forged_counts_are_refused():
    """By the independent checker as well."""
    for problem, records in cases("counted"):
        for k in leaves(records, "counted"):
            forged = put(records, (k, 4), 1 - records[k][4])
            for others in (forged, put(forged, (-1, "roots"), records[-1]["roots"] + 1 - 2 * records[k][4])):
                assert not accepted(problem, others)
                with pytest.raises(Refused):
                    check_records(problem, others)
    for problem, records in cases("m"):
        assert not accepted(problem, put(records, (-1, "roots"), records[-1]["roots"] + 1))


def test_a_smaller_core_needs_its_own_proof():
    # the fixed nodes of a leaf must have their codes in its assignment
    problem = beside_a_loaded_node(3, slides=True, grazing=True)
    records = records_of(enumerate_roots(problem, 0).proof)
    for k in leaves(records, "m"):
        mu, rows = numbers_in(records[k])
        for part in (slice(0), slice(1, None), slice(-1)):
            numbers = mu[part] + [x for row in rows for x in row[part]]
            forged = ["m", records[k][1], records[k][2][part], numbers, *records[k][4:]]
            assert not accepted(problem, replaced(records, k, forged))
