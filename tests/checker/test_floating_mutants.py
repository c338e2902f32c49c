"""Forged proofs about bodies that nothing holds are refused; exclusions hold no solution whatever the multipliers."""

import dataclasses
from fractions import Fraction

import numpy as np
import pytest
from helpers.floating_oracle import Oracle, block_on_table, random_body
from helpers.proof_tools import copied, leaves_of, multipliers, proof_of, records_of, with_multipliers

import enumsol
from enumsol.condensation.floating import FloatingSystem, RigidRows
from enumsol.trusted.exclusion import exclusion_margin
from enumsol.trusted.status_rows import FORBIDDEN, FREE, row_signs

PROBLEM = block_on_table(cells=2, push=0.5, max_rigid_displacement=4.0)
RECORDS = records_of(enumsol.enumerate_roots(PROBLEM, 0).proof)
SLIDING = block_on_table(cells=1, push=1.0, max_rigid_displacement=4.0)


def refusal(records, problem=PROBLEM):
    report = enumsol.verify(problem, proof_of(records))
    assert not report.ok
    return " ".join(report.failures)


def test_the_proof_itself_is_accepted():
    assert enumsol.verify(PROBLEM, proof_of(RECORDS)).complete


@pytest.mark.parametrize("bound", [2.0, 8.0, 4, None, "4.0"])
def test_another_bound_in_the_header(bound):
    records = copied(RECORDS)
    records[0]["max_rigid_displacement"] = bound
    assert "bound of the rigid displacement" in refusal(records)
    del records[0]["max_rigid_displacement"]
    assert "bound of the rigid displacement" in refusal(records)


@pytest.mark.parametrize(
    "change",
    [
        {"max_rigid_displacement": 2.0},
        {"max_rigid_displacement": 8.0},
        {"rigid_modes": 2 * PROBLEM.rigid_modes},
        {"rigid_modes": PROBLEM.rigid_modes[:, [1, 0, 2]]},
    ],
)
def test_another_problem(change):
    assert "another problem" in refusal(RECORDS, dataclasses.replace(PROBLEM, **change))


def test_a_body_on_springs_is_another_problem():
    assert "another problem" in refusal(RECORDS, PROBLEM.on_springs)


@pytest.mark.slow
def test_every_exclusion_is_needed_as_it_is():
    for place, _ in leaves_of(RECORDS):
        if RECORDS[place][0] != "x":
            continue
        rows, values = multipliers(RECORDS[place])
        for forged in ([0.0] * len(values), [-v for v in values]):
            records = copied(RECORDS)
            records[place] = with_multipliers(records[place], rows, forged)
            assert "do not exclude" in refusal(records)


def test_leaves_that_rest_on_a_body_that_is_held():
    empty = with_multipliers(["x", "", ""], [], [])[1:]
    one = [[0] * 3, [], [[], [], [], [], []], [0.0] * 6]
    for leaf in (["z"], ["X", *empty], ["m", *one], ["M", [0] * 3, [[]], 0], ["a", [0] * 3, [], [], *empty, [], [], 1]):
        place = leaves_of(RECORDS)[0][0]
        records = copied(RECORDS)
        records[place] = leaf
        assert "unknown kind" in refusal(records)


def test_a_root_cannot_be_left_out_or_added():
    kinds = [record[0] for record in RECORDS[1:-1]]
    place = 1 + kinds.index("r")
    records = copied(RECORDS)
    records[place] = ["n"]
    records[-1]["roots"] = 0
    assert refusal(records)
    records[place] = ["N"]
    assert "it holds a root" in refusal(records)
    for index in range(1, 3):
        records = copied(RECORDS)
        records[place][index][0] += 1.0 if index == 1 else -records[place][index][0]
        assert refusal(records)
    records = copied(RECORDS)
    records[place][3] *= -1
    assert refusal(records)


def test_a_direction_of_imbalance_is_tested():
    problem = block_on_table(cells=2, push=1.25)
    records = records_of(enumsol.enumerate_roots(problem, 0).proof)
    places = [k for k, record in enumerate(records) if isinstance(record, list) and record[0] == "i"]
    assert places
    for place in places:
        for forged in ([-x for x in records[place][1]], [0.0] * 3):
            changed = copied(records)
            changed[place][1] = forged
            assert "may be in balance with the load" in refusal(changed, problem)
        for forged in (records[place][1][:2], ["1", 0, 0], 1.0):
            changed = copied(records)
            changed[place][1] = forged
            assert "expected 3 numbers" in refusal(changed, problem)


def test_a_direction_of_imbalance_means_nothing_for_a_body_that_is_held():
    held = PROBLEM.on_springs
    records = records_of(enumsol.enumerate_roots(held, 0).proof)
    records[1] = ["i", [1.0, 0.0, 0.0]]
    report = enumsol.verify(held, proof_of([records[0], records[1], {**records[-1], "leaves": 1, "roots": 0}]))
    assert "unknown kind" in " ".join(report.failures)


def test_a_proof_with_huge_multipliers_is_accepted():
    # once a bound that was positive, but too small, was taken in place of a better one
    problem = random_body(32146)
    roots = enumsol.enumerate_roots(problem, 0)
    assert roots.complete
    assert enumsol.verify(problem, roots.proof).complete


def test_a_family_is_as_long_as_the_bound():
    records = records_of(enumsol.enumerate_roots(SLIDING, 0).proof)
    assert enumsol.verify(SLIDING, proof_of(records)).within == 4.0
    place = next(k for k, record in enumerate(records) if isinstance(record, list) and record[0] == "D")
    for point in range(len(records[place][1])):
        forged = copied(records)
        forged[place][1][point][-1] = "1/1"
        assert "not those that are claimed" in refusal(forged, SLIDING)
        forged[place][1][point].pop()
        assert "expected points of 7 fractions" in refusal(forged, SLIDING)


def enclosed(problem):
    system = problem.on_springs.condensed.at(0).scaled
    held = problem.on_springs.enclosure.at(0, system.force, system.length)
    return FloatingSystem.on(held, RigidRows.of(problem, Fraction(0), system.force, system.length))


@pytest.mark.slow
def test_no_multipliers_exclude_a_solution():
    rng, tried = np.random.default_rng(0), 0
    for seed in range(25):
        problem = random_body(seed)
        oracle = Oracle(problem)
        if not oracle.parts:
            continue
        system = enclosed(problem)
        free = system.reaching(np.full(problem.modes.r, np.inf))
        best = _proposals(problem)
        for codes, _ in oracle.parts:
            final = [0 if c == 0 else (4 if F == 0 else c) for c, F in zip(codes, oracle.F, strict=True)]
            signs = row_signs(np.array(final), system.F).T.ravel()
            allowed = np.flatnonzero(signs != FORBIDDEN)
            for size in (1e-3, 1.0, 1e3):
                values = rng.normal(size=len(allowed)) * size * (rng.random(len(allowed)) < 0.7)
                values = np.where(signs[allowed] == FREE, values, np.abs(values))
                assert not exclusion_margin(system, final, allowed, values) > 0
                assert not exclusion_margin(free, final, allowed, values) > 0
                tried += 1
            for rows, values in best(final):
                assert not exclusion_margin(system, final, rows, values) > 0
                assert not exclusion_margin(free, final, rows, values) > 0
    assert tried > 30


def _proposals(problem):
    """Multipliers that the relaxation of a selection ends with, times some factors."""
    from enumsol.search.floating_solvers import FloatingSolvers
    from enumsol.search.splitting import ImposedRows, PlaneSplitting

    solvers = FloatingSolvers(problem, 0, "verified", 1e-9)
    rows = ImposedRows(PlaneSplitting(solvers.scaled.F), problem.p)

    def best(codes):
        relaxation = solvers._engine.root(*rows.over(tuple(codes), range(problem.p)))
        if relaxation.stalled or relaxation.pruned:
            return
        found, values = relaxation.multipliers()
        for factor in (1.0, 1.0 + 1e-9, 1e3, 1e6):
            yield found, values * factor

    return best
