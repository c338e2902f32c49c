"""Leaves that close a subtree: forged ones are refused, and any mutant that is accepted is still a proof."""

import functools
from itertools import product

import numpy as np
import pytest
from proof_tools import copied, proof_of, records_of
from rational_checker import Refused, check_records
from touching import beside_a_loaded_node, row_of_discs, touching_problem

from enumsol import enumerate_roots, verify
from enumsol.checker.stability import stability_radius
from enumsol.search import closing, solvers

MUTANTS = 150


@functools.cache
def cases(kind):
    """Problems with records of proofs that have such leaves."""
    if kind in ("slides", "sides"):
        return cases_with_sides(kind)
    if kind == "factors":
        return cases_with_factors()
    found = []
    with pytest.MonkeyPatch.context() as patch:
        before = closing.Closer.closed

        def closed(self, codes, relaxation):
            self._alert, self._wait = True, 0
            return before(self, codes, relaxation)

        patch.setattr(closing.Closer, "closed", closed)
        if kind == "m":
            patch.setattr(solvers, "EXACT_DOF_LIMIT", 0)
        for seed in range(60):
            rng = np.random.default_rng(seed)
            problem = touching_problem(rng, int(rng.integers(2, 4)))
            roots = enumerate_roots(problem, 0)
            records = records_of(roots.proof)
            if roots.certified_data == "problem" and roots.complete and leaves(records, kind):
                found.append((problem, records))
    assert len(found) > 5
    return found


def cases_with_sides(kind):
    """Proofs in which undecided nodes are split by sides."""
    found = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(closing, "_MANY", 1)
        rows = [row_of_discs(k, weights=(2.0, 3.0), friction=F) for k, F in product((4, 5), (0.6, 0.9, 1.2))]
        chains = [beside_a_loaded_node(3, slides=True, grazing=True, friction=F) for F in (2.5, 4.0)]
        for problem in rows + chains:
            records = records_of(enumerate_roots(problem, 0).proof)
            if leaves(records, kind):
                found.append((problem, records))
    assert len(found) > 5
    return found


def cases_with_factors():
    """Proofs in which the terms of contact nodes are multiplied by numbers of their own."""
    found = []
    for limit, slides, friction in product((0, 250), (False, True), (0.875, 1.25, 1.75, 2.5)):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(solvers, "EXACT_DOF_LIMIT", limit)
            problem = beside_a_loaded_node(3, slides=slides, grazing=True, friction=friction)
            records = records_of(enumerate_roots(problem, 0).proof)
        if leaves(records, "factors"):
            found.append((problem, records))
    assert len(found) > 5
    assert {records[k][0] for _, records in found for k in leaves(records, "factors")} == {"m", "M"}
    return found


def weights_in(record):
    """Place of the weights in a record, and how many of them are tau, for leaves at whose root nothing is decided."""
    return (3, len(record[2])) if record[0] == "m" else (2, len(record[1]))


def leaves(records, kind):
    """Numbers of the records of a kind: "m", "M", "m" with sliding nodes, or with factors; "b" with sides."""
    chosen = [(k, record) for k, record in enumerate(records) if isinstance(record, list)]
    if kind == "factors":
        closed = [(k, record, *weights_in(record)) for k, record in chosen if record[0] in ("m", "M")]
        return [k for k, record, place, size in closed if len(record[place]) > size]
    if kind == "slides":
        return [k for k, record in chosen if record[0] == "m" and max(record[1]) > 6]
    if kind == "sides":
        return [k for k, record in chosen if record[0] == "b" and max(record[2]) > 6]
    return [k for k, record in chosen if record[0] == kind]


def accepted(problem, records):
    report = verify(problem, proof_of(records))
    assert report.ok == (not report.failures)
    if report.ok:
        assert check_records(problem, records) == records[-1]
    return report.ok


KINDS = ["m", "M", "slides", "sides", "factors"]


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


def test_forged_roots_are_refused():
    for problem, records in cases("m"):
        for k in leaves(records, "m"):
            record = records[k]
            forgeries = [[record[0], *record[1:5], [0.0] * (2 * problem.p), 1]] if len(record) == 5 else [record[:5]]
            if len(record) == 7:
                forgeries += [[*record[:6], -record[6]], [*record[:5], [-1.0] * (2 * problem.p), record[6]]]
            for forged in forgeries:
                assert not accepted(problem, [*records[:k], forged, *records[k + 1 :]])


def test_forged_factors_are_refused():
    for problem, records in cases("factors"):
        for k in leaves(records, "factors"):
            place, size = weights_in(records[k])
            weights = records[k][place]
            forgeries = [weights[:size], weights[:-1], [*weights, 1.0], weights[:size] + [0.0] * (len(weights) - size)]
            forgeries += [[*weights[:-1], x] for x in (-weights[-1], 0.0, 1e200, 1e-200, True, "1")]
            for forged in forgeries:
                record = [*records[k][:place], forged, *records[k][place + 1 :]]
                assert not verify(problem, proof_of([*records[:k], record, *records[k + 1 :]])).ok


def test_forged_counts_are_refused():
    for problem, records in cases("M"):
        for k in leaves(records, "M"):
            forged = [*records[k][:3], 1 - records[k][3]]
            footer = {**records[-1], "roots": records[-1]["roots"] + 1 - 2 * records[k][3]}
            assert not accepted(problem, [*records[:k], forged, *records[k + 1 :]])
            assert not accepted(problem, [*records[:k], forged, *records[k + 1 : -1], footer])


def test_a_root_counted_twice_is_refused():
    for problem, records in cases("m"):
        footer = {**records[-1], "roots": records[-1]["roots"] + 1}
        assert not accepted(problem, [*records[:-1], footer])


def test_a_smaller_core_needs_its_own_proof():
    # the fixed nodes of a leaf must have their codes in its assignment
    problem = beside_a_loaded_node(3, slides=True, grazing=True)
    records = records_of(enumerate_roots(problem, 0).proof)
    for k in leaves(records, "m"):
        for free in ([], records[k][2][1:], records[k][2][:-1]):
            tau = records[k][3][: len(free)]
            forged = ["m", records[k][1], free, tau, *records[k][4:]]
            assert not accepted(problem, [*records[:k], forged, *records[k + 1 :]])


def test_the_independent_checker_refuses_as_well():
    problem, records = cases("M")[0]
    (k, *_) = leaves(records, "M")
    forged = [*records[k][:3], 1 - records[k][3]]
    with pytest.raises(Refused):
        check_records(problem, [*records[:k], forged, *records[k + 1 :]])


def test_proofs_with_closed_subtrees_have_no_stability_radius():
    for kind in ("m", "M"):
        problem, records = cases(kind)[0]
        assert stability_radius(problem, proof_of(records)) == 0
