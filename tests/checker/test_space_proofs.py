"""Proofs about problems in 3D: accepted as they are, refused with a reason when they were tampered with."""

import numpy as np
import pytest
from complete import accepted_report, complete_report
from effort import some
from problems3d import from_compliance
from proof_tools import leaves_of, of_kind, proof_of, put, records_of, replaced, why_refused
from refusals import bad_argument
from space_proofs import RANDOM, Truth, case, mutant, random_problem, values_of, with_values

import enumsol
from enumsol import Proof, ProofFormatError, enumerate_roots, gallery, verify
from enumsol.model.sectors import DEEPEST, SECTORS
from enumsol.trusted.space.sector_rows import OPEN, STICK

BLOCKS = [("block", cells, alpha) for cells in ((2, 1, 2), (3, 2, 2)) for alpha in (0.5, 1.0, 3.0)]
NAMES = [*RANDOM, "end", "one tangent", *BLOCKS]
SEVERAL = (2, 0)


def refused(name, records):
    """The reasons why tampered records are refused."""
    return why_refused(case(name)[0], records)


def changed(path, value):
    """The reasons why those of the problem with several roots are refused with another value at a path."""
    return refused(SEVERAL, put(case(SEVERAL)[2], path, value))


@pytest.mark.few(5, 3)
@pytest.mark.parametrize("name", NAMES, ids=str)
def test_proofs_are_accepted(name):
    problem, alpha, records, data = case(name)
    report = complete_report(problem, Proof(data))
    roots = enumerate_roots(problem, alpha)
    assert (report.roots, report.families, report.alpha) == (len(roots), 0, alpha)
    assert report.leaves == len(leaves_of(records))
    assert sum(root.index for root in roots) == 1


@pytest.mark.parametrize("name", RANDOM, ids=str)
def test_the_count_is_known(name):
    problem, _, _, data = case(name)
    assert verify(problem, Proof(data)).roots == RANDOM[name]


def test_a_root_on_the_end_of_a_sector_counts_once():
    problem, _, records, _ = case("end")
    assert len(of_kind(records, "r")) == 2
    assert verify(problem, proof_of(records)).roots == 1
    assert "the leaves give" in refused("end", put(records, (-1, "roots"), 2))


def test_roots_that_cannot_be_told_apart_leave_the_count_open(monkeypatch):
    problem, _, records, _ = case("end")
    monkeypatch.setattr("enumsol.trusted.space.leaves.same_root", lambda one, other: None)
    report = accepted_report(problem, proof_of(put(records, (-1, "roots"), 2)))
    assert not report.complete
    assert (report.roots, report.undecided) == (2, 1)


def test_the_unloaded_body():
    problem = from_compliance(np.eye(3), np.zeros(3), (0.5, 0.5))
    report = complete_report(problem, enumerate_roots(problem, 0.0).proof)
    assert (report.roots, report.leaves) == (1, 1)
    header = case((1, 0))[2][0]
    assert "not unloaded" in refused((1, 0), [header, ["z"], {"roots": 1, "undecided": 0, "leaves": 1}])


def test_undecided_leaves_are_counted():
    problem = case(SEVERAL)[0]
    found = enumerate_roots(problem, 0.0, max_nodes=3)
    report = accepted_report(problem, found.proof)
    assert not report.complete
    assert report.undecided == len(found.undecided) > 0


# -- other problems and other kinds ------------------------------------------------------------------------------------


def test_plane_and_space_are_told_apart():
    plane, space = gallery.one_node_triangle(), case((1, 0))[0]
    in_plane, in_space = enumerate_roots(plane, 5.0).proof, enumerate_roots(space, 0.0).proof
    graph = enumsol.branch_graph(plane, (4, 5)).proof
    for problem, proof in ((plane, in_space), (space, in_plane), (space, graph)):
        report = verify(problem, proof)
        assert not report.ok
        assert "another problem" in report.failures[0]
    bad_argument(r"problem is a dict; expected a ContactProblem", verify, {}, in_space)


def test_another_problem_and_another_alpha():
    assert "another problem" in why_refused(random_problem(1, 23), case((1, 22))[2])
    for alpha in ("3", "1/2"):
        # a proof may hold elsewhere but not say something wrong there; roots move with friction
        refused(BLOCKS[1], put(case(BLOCKS[1])[2], (0, "alpha"), alpha))


def test_friction_beyond_floats_negative_or_a_function_is_refused():
    S, g = np.eye(3), np.array([1.0, 2.0, 0.5])
    problem = from_compliance(S, g, (0.5, 0.5), friction_slope=(1e300, 1.0))
    records = records_of(enumerate_roots(problem, 0.0).proof)
    for alpha, reason in (("1" + "0" * 20, "underflows float64"), ("-1", "negative")):
        assert reason in why_refused(problem, put(records, (0, "alpha"), alpha))
    by_slip = from_compliance(S, g, lambda node, slip: 0.5 + 0.1 * node / (1 + slip))
    assert "depends on the solution" in why_refused(by_slip, records)


def test_units_need_one_product():
    assert "common scaling" in changed((0, "force", 0), lambda exponent: exponent + 1)


# -- the tree ----------------------------------------------------------------------------------------------------------


def sectors_at(records):
    """Branchings into sectors."""
    return [k for k in of_kind(records, "b") if min(records[k][2]) > SECTORS or len(records[k][2]) == 5]


def test_gaps_between_sectors():
    _, _, records, _ = case(SEVERAL)
    places = sectors_at(records)
    assert places
    for k in places:
        codes = records[k][2]
        j = codes.index(max(codes))
        assert "does not cover" in changed((k, 2), codes[:j] + codes[j + 1 :])
        # its neighbour, another one twice, a wider one
        for code in (codes[j] + 1, codes[j - 1], (codes[j] + SECTORS) // 2):
            assert "does not cover" in changed((k, 2, j), code)


def test_branchings_of_the_wrong_kind():
    _, _, records, _ = case((1, 22))
    first = of_kind(records, "b")[0]
    for record in (["b", 1, [0, 5]], ["b", 0, [0, 4]], ["b", 0, [0, 1, 2, 3]], ["b", -1, [0, 5]], ["b", True, [0, 5]]):
        assert "does not cover" in refused((1, 22), replaced(records, first, record))


def test_sectors_end_at_a_depth():
    _, _, records, _ = case((1, 22))
    deep = [records[0], ["b", 0, [0, 5]], ["u", ""], ["b", 0, [1, *(SECTORS + k for k in range(4, 8))]], ["u", ""]]
    deep += [["b", 0, [SECTORS + code, SECTORS + code + 1]] for code in (8 << k for k in range(DEEPEST))]
    assert "does not cover" in refused((1, 22), deep)


def test_leaves_merged_and_doubled():
    _, _, records, _ = case(SEVERAL)
    for k in of_kind(records, "x", "n", "r"):
        refused(SEVERAL, replaced(records, k))
        refused(SEVERAL, replaced(records, k, records[k], records[k]))
    # a branching replaced by one leaf of its own
    for k in of_kind(records, "b"):
        refused(SEVERAL, replaced(records, k, ["n"]))


@pytest.mark.parametrize("key", ["roots", "undecided", "leaves"])
def test_wrong_counts(key):
    for step in (-1, 1):
        assert "the counts at the end" in changed((-1, key), case(SEVERAL)[2][-1][key] + step)


# -- leaves ------------------------------------------------------------------------------------------------------------


def test_wrong_claims_about_leaves():
    _, _, records, _ = case(SEVERAL)
    codes = dict(leaves_of(records))
    for k in of_kind(records, "r", "n"):
        if records[k][0] == "r":
            assert "it holds a root" in changed((k,), ["n"]), codes[k]
        else:
            assert "it holds no root" in changed((k,), records[of_kind(records, "r")[0]]), codes[k]
    for k in of_kind(records, "x"):
        assert not {5, 6} & set(codes[k]) or "still open" in changed((k,), ["n"])


@pytest.mark.slow
def test_roots_moved_and_turned():
    _, _, records, _ = case(SEVERAL)
    for k in of_kind(records, "r"):
        _, mid, rad, index = records[k]
        for other in (-index, 0, 1.0 * index, str(index)):
            assert "its index is wrong" in changed((k, 3), other)
        for j in np.flatnonzero(np.array(rad) > 1e-200).tolist():
            assert "its enclosure does not hold" in changed((k, 1, j), mid[j] + 8 * rad[j])
        assert "its enclosure does not hold" in changed((k, 2), [0.0] * len(rad))
        assert "expected 6 numbers" in changed((k, 2), [0.0] * (len(rad) - 1))


@pytest.mark.slow
def test_multipliers_of_the_wrong_sign_and_rows_of_others():
    _, _, records, _ = case(SEVERAL)
    for k in of_kind(records, "x"):
        assert "do not exclude" in changed((k,), with_values(records[k], [-v for v in values_of(records[k])]))
        changed((k, 1), [[kind, 1 - node, number] for kind, node, number in records[k][1]])


#: No such node, kind, number or type of number.
NO_ROWS = [
    *([0, 2, 0], [0, -1, 0], [10, 0, 4], [-1, 0, 4], [6, 0, 2**40], [6, 0, 3], [8, 0, 0], [0, 0, 1], [2, 0, 2]),
    *([2, 0, -1], [4, 0, 1], [6, 0, 4.0], [6, 0], "x", None),
]


@pytest.mark.parametrize("row", NO_ROWS, ids=str)
def test_rows_that_do_not_exist(row):
    _, _, records, _ = case(SEVERAL)
    k = of_kind(records, "x")[0]
    # a row that there is but not in this status is refused by its sign
    leaf = with_values(["x", [*records[k][1], row], ""], [*values_of(records[k]), 0.0])
    assert "leaf" in changed((k,), leaf)


def test_multipliers_have_to_be_finite():
    _, _, records, _ = case(SEVERAL)
    k = of_kind(records, "x")[0]
    for value in (np.nan, np.inf, 1e308):
        for rows in (records[k][1], records[k][1] * 3):
            why = changed((k,), with_values(["x", rows, ""], [value] * len(rows)))
            assert ("do not exclude" if np.isfinite(value) else "a multiplier is not finite") in why


# -- mutants -----------------------------------------------------------------------------------------------------------


@pytest.mark.few(0, 1)
@pytest.mark.parametrize(
    "name",
    [
        *((1, 22), SEVERAL, "one tangent"),
        *(pytest.param(name, marks=pytest.mark.slow) for name in ("small friction", (2, 5), "end")),
    ],
    ids=str,
)
def test_no_mutant_is_accepted_with_another_claim(name):
    problem, _, records, data = case(name)
    truth, accepted = Truth(problem), 0
    rng = np.random.default_rng(12)
    for _ in range(some(40, of=120) if name in ((1, 22), SEVERAL) else some(20, of=70)):
        proof, how = mutant(rng, records, data)
        try:
            report = verify(problem, proof)
        except ProofFormatError:
            continue
        if report.ok:
            accepted += 1
            assert truth.agrees(report, proof), how
        else:
            assert report.failures
    # some say the same in another way
    assert 0 < accepted < some(30, of=90)


def test_the_judge_of_mutants_sees_wrong_claims():
    problem, _, records, data = case(SEVERAL)
    report, truth = verify(problem, Proof(data)), Truth(problem)
    assert truth.agrees(report, proof_of(records))
    k = of_kind(records, "r")[0]
    for path, change in (((k, 3), lambda x: -x), ((k, 1, 0), lambda x: x + 0.1), ((-1, "roots"), lambda x: x - 1)):
        assert not truth.agrees(report, proof_of(put(records, path, change)))


def test_leaves_stand_for_all_statuses():
    _, _, records, _ = case(SEVERAL)
    codes = {codes for _, codes in leaves_of(records)}
    assert {code for leaf in codes for code in leaf} >= {OPEN, STICK}
    assert any(code > SECTORS for leaf in codes for code in leaf)
