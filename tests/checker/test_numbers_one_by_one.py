"""One number of a proof after the other is another one: what is still accepted is accepted by judges, too.

The judges share no code with enumsol: of points and graphs in 2D rational_checker, of histories history_judge.
"""

import functools
import random

import pytest
from checker.test_arc_mutants import original
from checker.test_strict_records import case as written
from effort import some
from floating_histories import case as floating_history
from helpers.floating_bodies import pushed_block
from helpers.floating_oracle import block_on_table, random_body
from history_judge import judge_history
from loading.test_floating_histories import pulls_and_positions, two_weights
from proof_fuzz import each_number
from proof_tools import bytes_of, proof_of, records_of, replaced
from rational_checker import check_records, records_of as read_records
from rational_forms import Refused

import enumsol
from enumsol import ProofFormatError
from enumsol.branches import ways


def of_point(problem):
    return problem, records_of(enumsol.enumerate_roots(problem, 0).proof)


def closed(problem, ends):
    """The proof of a graph with a piece that is closed by its arcs, as of large bodies."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ways, "FAST_EXACT_DOF", 0)
        return problem, records_of(enumsol.branch_graph(problem, ends).proof)


def of_history(problem, steps):
    return problem, records_of(enumsol.histories(problem, steps).proof)


def pulled_weights(tangents):
    problem, known = two_weights(tangents), pulls_and_positions(tangents, 3, 1)
    loads = [problem.f.copy() for _ in known]
    for load, (pull, _) in zip(loads, known, strict=True):
        load[1 : 1 + tangents] = pull
    return problem, loads


PROOFS = {
    **{
        name: functools.partial(written, name)
        for name in ("roots", "family", "in rationals", "forms", "sides", "alone")
    },
    **{f"floating {seed}": lambda seed=seed: of_point(random_body(seed)) for seed in (54, 8)},
    "floating, closed": lambda: closed(pushed_block(1), (0.25, 0.75)),
    "block": lambda: of_point(block_on_table(cells=1, push=0.5, max_rigid_displacement=4.0)),
    **{name: functools.partial(written, name) for name in ("graph", "halves", "forms beside the unloaded state")},
    **{f"arcs, {name}": lambda name=name: original(name)[:2] for name in ("fold", "held by contact")},
}
HISTORIES = {
    "pushed block": lambda: of_history(pushed_block(1), [0.9, 0.9]),
    **{f"floating {seed}": lambda seed=seed: of_history(*floating_history(seed)) for seed in (3, 16, 45)},
    "in space": lambda: of_history(*pulled_weights(2)),
}


@functools.cache
def known(name):
    return (PROOFS | HISTORIES)[name]()


def accepted(problem, records):
    """What the checker says of a proof, or None where it refuses it."""
    try:
        report = enumsol.verify(problem, proof_of(records))
    except ProofFormatError:
        return None
    return report if report.ok else None


def forged(name, most=4):
    """Some of the forged proofs, as many of every kind of record."""
    problem, records = known(name)
    found = {}
    for place, changed in each_number(records):
        kind = records[place][0] if isinstance(records[place], list) else tuple(records[place])
        found.setdefault(kind, []).append((place, changed))
    rng, count = random.Random(len(name)), some(most, of=40)
    for kind in found.values():
        for place, changed in rng.sample(kind, min(count, len(kind))):
            yield problem, replaced(records, place, changed), (records[place], changed)


@pytest.mark.few(4, 4)
@pytest.mark.parametrize("name", PROOFS)
def test_points_and_graphs_in_the_plane(name):
    check_records(*known(name))
    tried = 0
    for problem, records, what in forged(name):
        tried += 1
        if accepted(problem, records) is not None:
            try:
                check_records(problem, records)
            except Refused as error:
                pytest.fail(f"{error}: {what}")
    assert tried > 10


def test_a_graph_with_huge_multipliers():
    """Of a body with five rigid modes; multipliers of equilibrium that exclude a leaf are some 1e26."""
    problem = random_body(73)
    graph = enumsol.branch_graph(problem, (0, 0.5))
    assert graph.complete
    assert check_records(problem, records_of(graph.proof)) == accepted(problem, records_of(graph.proof)).selections


def said(problem, records):
    return judge_history(problem, read_records(bytes_of(proof_of(records))))


@pytest.mark.few(2, 3)
@pytest.mark.parametrize("name", HISTORIES)
def test_histories(name):
    problem, records = known(name)
    report = accepted(problem, records)
    assert said(problem, records) == (report.complete, report.unique_until)
    for problem, records, what in forged(name, 2):
        report = accepted(problem, records)
        if report is not None:
            try:
                complete, unique = said(problem, records)
            except Refused as error:
                pytest.fail(f"{error}: {what}")
            assert (report.complete, report.unique_until) <= (complete, unique), what


@pytest.mark.few(4, 10)
@pytest.mark.parametrize("seed", range(100, 140))
def test_histories_of_random_bodies(seed):
    problem, steps = floating_history(seed)
    history = enumsol.histories(problem, steps)
    found = judge_history(problem, read_records(bytes_of(history.proof)))
    assert found == (history.complete, history.unique_until)
