"""What docs/proof_format.md says suffices: a checker made from it accepts proofs of bodies that nothing holds."""

import functools

import pytest
from floating_oracle import block_on_table, random_body
from graph_proofs import refused
from proof_tools import bytes_of, leaves_of, multipliers, put, records_of, replaced, with_multipliers
from rational_checker import check
from rational_forms import fingerprint

import enumsol

#: Among their proofs are all kinds of leaves.
SEEDS = (5, 18, 21, 8, 16, 134)


@functools.cache
def of(seed):
    """A problem, its solutions and the records of the proof."""
    problem = random_body(seed)
    roots = enumsol.enumerate_roots(problem, 0.25)
    return problem, roots, records_of(roots.proof)


@pytest.mark.few(2)
@pytest.mark.parametrize("seed", [*SEEDS, *range(100, 110)])
def test_proofs_are_accepted(seed):
    problem, roots, _ = of(seed)
    counts = check(problem, bytes_of(roots.proof))
    assert (counts["roots"], counts["families"], counts["undecided"]) == (len(roots), len(roots.families), 0)
    assert fingerprint(problem) == problem.fingerprint


def test_all_kinds_of_leaves_are_among_them():
    assert {record[0] for seed in SEEDS for record in of(seed)[2][1:-1]} == {*"bxinDroq"}


def forged(record):
    """Leaves that show nothing in place of one."""
    kind, *rest = record
    if kind == "x":
        rows, values = multipliers(record)
        yield with_multipliers(record, rows, [-value for value in values])
        yield with_multipliers(record, [], [])
    elif kind == "i":
        yield ["i", [-x for x in rest[0]]]
        yield ["i", [0.0 for _ in rest[0]]]
    elif kind == "r":
        yield ["r", rest[0], rest[1], -rest[2]]
        yield ["r", [x + 1.0 for x in rest[0]], rest[1], rest[2]]
        yield ["n"]
    elif kind == "D":
        yield ["D", rest[0], rest[1] + 1]
        yield ["D", rest[0][1:], rest[1]]
        yield ["n", "rational"]
    elif kind == "a":
        yield ["a", rest[0] + 1, *rest[1:]]
        yield ["a", rest[0], [], []] if len(rest) == 3 else record[:4]
        yield ["n"]


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", SEEDS[:3])
def test_forgeries_are_refused_by_both(seed):
    problem, _, records = of(seed)
    tried = 0
    for place, _ in leaves_of(records):
        for leaf in forged(records[place]):
            # where balance alone excludes an assignment, rationals need no multipliers
            assert refused(problem, replaced(records, place, leaf)) or leaf[0] == "x"
            tried += 1
    assert tried > 3


def test_another_bound_and_leaves_of_held_bodies_are_refused():
    problem, _, records = of(SEEDS[0])
    for bound in (2.0, None, "8"):
        assert refused(problem, put(records, (0, "max_rigid_displacement"), bound))
    place = leaves_of(records)[0][0]
    for leaf in (["z"], ["x", "", "", "rational"], ["m", [0], [0], [], [], []], ["i", []]):
        assert refused(problem, replaced(records, place, leaf))


@pytest.mark.parametrize(("push", "bound"), [(0.5, 4.0), (1.0, 4.0), (1.25, 1e6)])
def test_a_block_on_a_table(push, bound):
    problem = block_on_table(cells=1, push=push, max_rigid_displacement=bound)
    roots = enumsol.enumerate_roots(problem, 0)
    counts = check(problem, bytes_of(roots.proof))
    assert (counts["roots"], counts["families"]) == (len(roots), len(roots.families))
