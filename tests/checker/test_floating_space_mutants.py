"""Forged proofs about bodies in 3D that nothing holds are refused; nothing excludes what holds a solution."""

from fractions import Fraction

import numpy as np
import pytest
from helpers.floating_space import known_body
from helpers.proof_tools import copied, leaves_of, proof_of, records_of

import enumsol
from enumsol.condensation.floating_space import FloatingSpace
from enumsol.model.sectors import SECTORS, nearest
from enumsol.trusted.space import sector_rows as sr
from enumsol.trusted.space.resultants import floating_margin, is_unbalanced_in_space

PROBLEM = known_body(113).problem
RECORDS = records_of(enumsol.enumerate_roots(PROBLEM, 0).proof)


def refusal(records, problem=PROBLEM):
    report = enumsol.verify(problem, proof_of(records))
    assert not report.ok
    return " ".join(report.failures)


def places(kind, records=RECORDS):
    return [k for k, record in enumerate(records) if isinstance(record, list) and record[0] == kind]


def test_the_proof_itself_is_accepted():
    assert enumsol.verify(PROBLEM, proof_of(RECORDS)).complete


@pytest.mark.parametrize("bound", [15.0, 60.0, 30, None, "30.0"])
def test_another_bound_in_the_header(bound):
    records = copied(RECORDS)
    records[0]["max_rigid_displacement"] = bound
    assert "bound of the rigid displacement" in refusal(records)


def test_a_body_on_springs_or_with_other_modes_is_another_problem():
    for other in (PROBLEM.on_springs, PROBLEM.replace(rigid_modes=2 * PROBLEM.rigid_modes)):
        assert "another problem" in refusal(RECORDS, other)


def test_exclusions_are_needed_as_they_are():
    for place in places("x")[:4]:
        records = copied(RECORDS)
        records[place] = ["x", [], ""]
        assert "do not exclude" in refusal(records)


@pytest.mark.slow
def test_a_root_cannot_be_left_out_or_moved():
    for place in places("r"):
        records = copied(RECORDS)
        records[place] = ["n"]
        records[-1]["roots"] -= 1
        assert "it holds a root" in refusal(records)
        records = copied(RECORDS)
        records[place][3] *= -1
        assert refusal(records)
        records = copied(RECORDS)
        records[place][1][0] += 1.0
        assert refusal(records)


def test_leaves_that_rest_on_a_body_that_is_held():
    for leaf in (["z"], ["m", [], [], [], [], 1], ["l", [], [], [], [], [], 1], ["D", [], 0]):
        records = copied(RECORDS)
        records[leaves_of(RECORDS)[0][0]] = leaf
        assert "unknown kind" in refusal(records)


def test_a_direction_of_imbalance_is_tested():
    problem = known_body(1).problem
    problem = problem.replace(f=problem.f - 50 * (problem.Bn.sum(axis=0) @ problem.rigid_modes) @ problem.rigid_modes.T)
    records = records_of(enumsol.enumerate_roots(problem, 0).proof)
    (place, *_) = places("i", records)
    for forged in ([0.0] * 2, [-z for z in records[place][1]]):
        wrong = copied(records)
        wrong[place] = ["i", forged]
        assert "in balance" in refusal(wrong, problem)
    wrong[place] = ["i", [1.0] * 3]
    assert refusal(wrong, problem)


def _status(known, system, node, rng):
    """A code of a node, complete or not, that the known solution has."""
    force, F = known.lambda_n[node], np.array(known.problem.friction).T[node]
    tau = known.lambda_t[node] / F / force if force > 0 else np.zeros(2)
    if rng.random() < 0.3:
        return sr.UNDECIDED
    if force == 0:
        return sr.OPEN
    if rng.random() < 0.3:
        return sr.CONTACT
    if np.hypot(*tau) < 0.99:
        return sr.STICK
    number = nearest(*tau, 6)
    number = 64 + (number - 64 - 1) % 64 if rng.random() < 0.5 else number
    return SECTORS + number


def test_what_holds_a_solution_is_not_excluded():
    """Whatever the multipliers are. Sectors are the two around the direction; only those with it inside are used."""
    tried = 0
    for seed in range(6):
        known, rng = known_body(seed), np.random.default_rng(seed)
        ones = np.ones(known.problem.p)
        system = FloatingSpace.of(known.problem, Fraction(0), ones, ones)
        free = system.reaching(np.full_like(system.reach, np.inf))
        for _ in range(12):
            codes = [_status(known, system, node, rng) for node in range(known.problem.p)]
            if not all(_inside(known, node, code) for node, code in enumerate(codes)):
                continue
            rows = [row for node, code in enumerate(codes) for row in _rows(node, code)]
            signs = [sr.row_sign(codes[row[1]], row) for row in rows]
            for scale in (0.1, 1.0, 10.0):
                values = scale * rng.normal(size=len(rows))
                values = np.where(np.array(signs) == sr.NONNEGATIVE, np.abs(values), values)
                for within in (system, free):
                    assert not floating_margin(within, codes, rows, values) > 0
            for z in rng.normal(size=(10, len(system.reach))):
                assert not is_unbalanced_in_space(system, codes, z)
            tried += 1
    assert tried > 30


def _rows(node, code):
    """Some rows that a node imposes."""
    rows = [(sr.GAP, node, 0), (sr.FORCE, node, 0), *((sr.TANGENT, node, 8 + k) for k in range(8))]
    rows += [(sr.TAU, node, k) for k in (0, 1)] if code == sr.OPEN else []
    rows += [(sr.SLIP, node, k) for k in (0, 1)] if code == sr.STICK else []
    if code > SECTORS:
        rows += [(kind, node, code - SECTORS) for kind in (sr.CHORD, sr.LEFT, sr.RIGHT)]
    return [row for row in rows if sr.row_sign(code, row) != sr.FORBIDDEN]


def _inside(known, node, code):
    if code <= SECTORS:
        return True
    F = np.array(known.problem.friction).T[node]
    tau = known.lambda_t[node] / F
    (x, y), (p, q) = sr.direction(code - SECTORS), sr.direction(sr.end_number(code - SECTORS))
    return x * tau[1] - y * tau[0] > 0 and tau[0] * q - tau[1] * p > 0
