"""Searches that go on with the proof of an earlier one: cut anywhere, killed, forged; the uninterrupted one judges."""

import os
import signal
import subprocess
import sys
import textwrap
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from functools import cache
from unittest import mock

import numpy as np
import pytest
import scipy.sparse as sp
from compare import differences
from complete import accepted_report, all_roots, proven_roots
from floating_bodies import pushed_block
from floating_space import known_body
from generators import from_condensed, integer_problem, named
from hypothesis import HealthCheck, given, settings, strategies as st
from problems3d import forces
from proof_fuzz import mutant
from proof_tools import (
    bytes_of,
    copied,
    in_rationals,
    kinds_of,
    multipliers,
    of_kind,
    proof_of,
    put,
    put_in_all,
    records_of,
    with_multipliers,
)
from refusals import bad_argument
from touching import touching_problem
from trees import above_known_roots, by_the_tree

import enumsol
from enumsol import ContactProblem, Interrupted, InvalidArgumentError, Proof, enumerate_roots, gallery, verify
from enumsol.condensation.data import EXACT_DOF_LIMIT
from enumsol.condensation.enclosure import NotEnclosedError
from enumsol.proof.leaves import leaves_of
from enumsol.proof.records import Tree
from enumsol.proof.writer import BESIDE, FLUSH_EVERY, BegunProof
from enumsol.search import nodes as policy
from enumsol.search.setup import Replay

QUICK = settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck), derandomize=True)


def beyond_rationals():
    """A degenerate problem with so many degrees of freedom that it stays undecided."""
    small, m = integer_problem(np.random.default_rng(34), 2), EXACT_DOF_LIMIT
    A, none = sp.block_diag([small.A, sp.eye(m)]), np.zeros((2, m))
    Bn, Bt = sp.hstack([small.Bn, none]), sp.hstack([small.Bt, none])
    return ContactProblem(
        A,
        Bn,
        Bt,
        np.append(small.f, np.zeros(m)),
        gap=small.gap,
        friction=small.friction,
        friction_slope=small.friction_slope,
    ), 0.0


def nearly_singular():
    A = np.array([[1.0, 1.0 - 2.0**-46], [1.0 - 2.0**-46, 1.0]])
    return ContactProblem(A, [[1, 0]], [[0, 1]], [1.0, -1.0], friction=0.5), 0.0


PROBLEMS = {
    "wedge": lambda: named("wedge-8-5"),
    "one node": lambda: (gallery.one_node_triangle(), 5.0),
    "closed": lambda: (touching_problem(np.random.default_rng(1), 3), 0.0),
    "closed in balls": lambda: (touching_problem(np.random.default_rng(4), 3, inner=EXACT_DOF_LIMIT), 0.0),
    "undecided": beyond_rationals,
    "contradiction": lambda: (integer_problem(np.random.default_rng(57), 2), 0.0),
    "no root": lambda: (integer_problem(np.random.default_rng(143), 2), 0.0),
    "nearly singular": nearly_singular,
    "family": lambda: (integer_problem(np.random.default_rng(34), 2), 0.0),
    "border": lambda: (integer_problem(np.random.default_rng(20), 2), 0.0),
    "unloaded": lambda: (from_condensed(np.eye(4), np.zeros(4), np.full(2, 0.5)), 0.0),
    "forms": lambda: (gallery.clamped_block(12, 6), 0.3),
    "one certificate": lambda: (gallery.clamped_block(4, 2), 0.3),
    "alone": lambda: named("wedge-8-5"),
    "in space": lambda: (gallery.get("one-node-3d-3").build(), 0),
    "block in space": lambda: (gallery.get("block3d-4").build(), 0.5),
    "on a table": lambda: (pushed_block(), 0.5),
    "pushed away": lambda: (pushed_block(), 1.5),
    "held by nothing in space": lambda: (known_body(9).problem, 0),
    "closed in space": lambda: (gallery.get("block3d-9").build(), 0.5),
}


#: Those with records that one certificate would do without.
TREES = ("forms", "contradiction", "no root", "border", "block in space")


def searched(name):
    """A context in which the tree is searched where one certificate would do."""
    return above_known_roots() if name == "alone" else by_the_tree() if name in TREES else nullcontext()


@cache
def known(name):
    """The problem, alpha, and what an uninterrupted search found; with forms as early as possible where named so."""
    problem, alpha = PROBLEMS[name]()
    early = mock.patch.multiple(policy, NODES=0, MORE=-2.0) if name == "forms" else nullcontext()
    with early, searched(name):
        return problem, alpha, enumerate_roots(problem, alpha)


def check(name, found):
    """The same roots as without an interruption, and a proof that holds."""
    problem, _, whole = known(name)
    assert found.complete == whole.complete
    if name.endswith("space"):
        assert [root.statuses for root in found] == [root.statuses for root in whole]
        assert all(np.allclose(forces(a), forces(b), rtol=1e-9) for a, b in zip(found, whole, strict=True))
    else:
        assert not differences(found, whole, rtol=1e-9)
    report = accepted_report(problem, found.proof)
    assert (report.complete, report.roots, report.families) == (whole.complete, len(found), len(found.families))


def resumed(name, data, path, **options):
    """The search of a problem, resumed from this file."""
    path.write_bytes(data)
    problem, alpha, _ = known(name)
    found = enumerate_roots(problem, alpha, proof_path=path, resume=True, **options)
    assert os.listdir(path.parent) == [path.name]
    assert bytes_of(Proof.load(path)) == bytes_of(found.proof)
    return found


@pytest.mark.slow
def test_the_problems_have_all_kinds_of_records():
    kinds = {kind for name in PROBLEMS for kind in kinds_of(known(name)[2].proof)}
    # "g": loads that are held, in tests of histories
    assert kinds == {*leaves_of(Tree.PLANE), *leaves_of(Tree.FLOATING_PLANE), "b", "q"} - {"g"}


def test_exclusions_in_rationals(tmp_path, monkeypatch):
    def nothing(problem):
        raise NotEnclosedError(f"no balls for {problem.p} nodes")

    monkeypatch.setattr("enumsol.search.solvers.enclosure_of", nothing)
    problem, alpha = PROBLEMS["border"]()
    whole = enumerate_roots(problem, alpha)
    records, data = records_of(whole.proof), bytes_of(whole.proof)
    assert in_rationals(records, "x")
    path = tmp_path / "x.proof"
    for size in (len(data) // 2, len(data)):
        path.write_bytes(data[:size])
        found = proven_roots(problem, alpha, proof_path=path, resume=True)
        assert records_of(found.proof) == records
    assert found.stats.resumed == len(records) - 2


def taken_over(kinds):
    """How many of the records of a proof a search takes over."""
    return sum(kind not in ("q", "z", "u") for kind in kinds)


@pytest.mark.parametrize("name", PROBLEMS)
def test_a_whole_proof_leaves_nothing_to_search(name, tmp_path):
    _, _, whole = known(name)
    found = resumed(name, bytes_of(whole.proof), tmp_path / "x.proof")
    check(name, found)
    kinds = kinds_of(whole.proof)
    assert (found.stats.nodes == 0) is ("u" not in kinds)
    assert found.stats.resumed == taken_over(kinds)
    assert records_of(found.proof) == records_of(whole.proof)
    if taken_over(kinds) and "u" not in kinds:
        assert "in the file, nothing was left to search" in repr(found)


@pytest.mark.long
@settings(QUICK, max_examples=25)
@given(data=st.data())
def test_a_file_cut_anywhere(data, tmp_path_factory):
    name = data.draw(st.sampled_from(list(PROBLEMS)))
    whole = bytes_of(known(name)[2].proof)
    size = data.draw(st.integers(0, len(whole)))
    check(name, resumed(name, whole[:size], tmp_path_factory.mktemp("cut") / "x.proof"))


@pytest.mark.few(0, 2)
@pytest.mark.parametrize("name", PROBLEMS)
def test_as_much_is_taken_as_the_file_holds(name, tmp_path):
    whole, taken = bytes_of(known(name)[2].proof), []
    for size in np.linspace(0, len(whole), 9).astype(int):
        found = resumed(name, whole[:size], tmp_path / "x.proof")
        taken.append(found.stats.resumed)
        check(name, found)
    assert taken == sorted(taken)
    assert taken[-1] == taken_over(kinds_of(whole))


@pytest.mark.long
@settings(QUICK, max_examples=60)
@given(seed=st.integers(0, 2**32), name=st.sampled_from(list(PROBLEMS)))
def test_a_forged_file_never_gives_a_wrong_answer(seed, name, tmp_path_factory):
    _, _, whole = known(name)
    data = bytes_of(whole.proof)
    forged = bytes_of(mutant(np.random.default_rng(seed), records_of(data), data)[0])
    path = tmp_path_factory.mktemp("forged") / "x.proof"
    try:
        found = resumed(name, forged, path)
    except InvalidArgumentError as error:
        found, refusal = None, str(error)
    if found is not None:
        check(name, found)
    else:
        assert "expected the proof of this search" in refusal
        assert path.read_bytes() == forged


def without_subtree(records):
    """The first branching whose first child is branched on loses that child's subtree."""
    changed = copied(records)
    place = next(k for k in range(1, len(changed) - 2) if changed[k][0] == changed[k + 1][0] == "b")
    due, end = 1, place + 1
    while due:
        due += len(changed[end][2]) - 1 if changed[end][0] == "b" else -1
        end += 1
    del changed[place + 1 : end]
    return changed


def altered_multipliers(records):
    for k in of_kind(records, "x"):
        rows, values = multipliers(records[k])
        records = put(records, (k,), with_multipliers(records[k], rows, [-value for value in values]))
    return records


def moved_roots(records):
    return put_in_all(records, of_kind(records, "r"), 1, lambda mid: [value + 1.0 for value in mid])


def no_root_left(records):
    roots = of_kind(records, "r")
    return [["n"] if k in roots else record for k, record in enumerate(records)]


@pytest.mark.parametrize("forge", [without_subtree, altered_multipliers, moved_roots, no_root_left])
def test_forgeries(forge, tmp_path):
    _, _, whole = known("wedge")
    records = records_of(whole.proof)
    forged = forge(records)
    assert forged != records
    found = resumed("wedge", bytes_of(proof_of(forged)), tmp_path / "x.proof")
    check("wedge", found)
    assert found.stats.resumed > 0
    assert (found.stats.nodes > 0) is (forge in (without_subtree, altered_multipliers))


def test_rows_that_do_not_exist_in_space(tmp_path):
    records = records_of(known("block in space")[2].proof)
    for k in of_kind(records, "x")[:4]:
        records[k][1][0] = [3, 0, 5]  # v has no such component
    found = resumed("block in space", bytes_of(proof_of(records)), tmp_path / "x.proof")
    check("block in space", found)
    assert found.stats.nodes > 0


# -- limits ------------------------------------------------------------------------------------------------------------


@pytest.mark.few(4, 2)
@pytest.mark.parametrize("name", ["wedge", "forms", "closed", "block in space"])
@pytest.mark.parametrize("limits", [{"max_nodes": 7}, {"max_nodes": 40}])
def test_a_search_in_small_parts(name, limits, tmp_path):
    problem, alpha, whole = known(name)
    path = tmp_path / "x.proof"
    with searched(name):
        found = enumerate_roots(problem, alpha, proof_path=path, resume=True, **limits)
    assert found.stats.resumed == 0
    parts = 1
    while not found.complete:
        before = found
        found = enumerate_roots(problem, alpha, proof_path=path, resume=True, **limits)
        assert found.stats.nodes <= limits["max_nodes"]
        assert found.stats.resumed > before.stats.resumed
        assert len(found) >= len(before)
        report = accepted_report(problem, found.proof)
        assert report.undecided == len(found.undecided)
        if found.stopped:
            assert f"{len(found.undecided)} subtree" in found.stopped
        parts += 1
    check(name, found)
    assert parts > 1 or whole.stats.nodes < limits["max_nodes"]


def test_what_the_file_holds_is_taken_whatever_the_limits(tmp_path):
    problem, alpha, whole = known("wedge")
    for limits in ({"time_limit": 1e-9}, {"max_nodes": 1}, {"stop_after": 2}):
        found = resumed("wedge", bytes_of(whole.proof), tmp_path / "x.proof", **limits)
        check("wedge", found)
    # undecided leaves in the middle of the file, and a limit that is reached among them: all that follows is kept
    records = records_of(whole.proof)
    for k in of_kind(records, "x")[2:40:3]:
        records[k] = ["u", "left for later"]
    found = resumed("wedge", bytes_of(proof_of(records)), tmp_path / "x.proof", max_nodes=3)
    assert len(found) == len(whole)
    assert not found.complete
    assert verify(problem, found.proof).ok
    assert found.stats.resumed > 0.9 * len(records) - 20
    assert found.stopped == f"stopped after max_nodes = 3 nodes, {len(found.undecided)} subtrees not examined"
    check("wedge", enumerate_roots(problem, alpha, proof_path=tmp_path / "x.proof", resume=True))


def test_a_time_limit_is_about_what_is_searched_anew(tmp_path, monkeypatch):
    problem, alpha, _ = known("wedge")
    path = tmp_path / "x.proof"
    enumerate_roots(problem, alpha, proof_path=path, max_nodes=150)
    now, before = [0.0], Replay._take

    def take(self, stack, record):
        now[0] += 1.0
        return before(self, stack, record)

    monkeypatch.setattr("time.perf_counter", lambda: now[0])
    monkeypatch.setattr(Replay, "_take", take)
    found = enumerate_roots(problem, alpha, proof_path=path, resume=True, time_limit=10.0)
    # the nodes of the search, and those on the way to the root that is known
    assert found.stats.held == now[0] > 150
    assert found.stats.resumed == found.stats.held - found.stats.held_open
    check("wedge", found)


@pytest.mark.few(0, 2)
@pytest.mark.parametrize("name", ["wedge", "forms", "closed", "block in space", "closed in space"])
def test_with_an_executor(name, tmp_path):
    problem, alpha, whole = known(name)
    data = bytes_of(whole.proof)
    with ThreadPoolExecutor(2) as executor:
        for size in (0, len(data) // 3, len(data) - 40, len(data)):
            check(name, resumed(name, data[:size], tmp_path / "x.proof", executor=executor))
        path = tmp_path / "x.proof"
        path.unlink()
        with searched(name):
            found = enumerate_roots(problem, alpha, proof_path=path, executor=executor, max_nodes=2)
        assert found.complete or found.stopped
        check(name, enumerate_roots(problem, alpha, proof_path=path, resume=True))


# -- what is refused ---------------------------------------------------------------------------------------------------


def refused(path, message, problem, alpha, **options):
    before = path.read_bytes() if path.is_file() else None
    bad_argument(message, enumerate_roots, problem, alpha, proof_path=path, resume=True, **options)
    assert before is None or path.read_bytes() == before
    assert os.listdir(path.parent) == [path.name]


def test_files_of_other_searches(tmp_path):
    problem, alpha, whole = known("wedge")
    path = tmp_path / "x.proof"
    whole.proof.save(path)
    refused(path, "belongs to another problem", *known("one node")[:2])
    refused(path, r"is a proof of another kind, 'point'", *known("in space")[:2])
    refused(path, r"belongs to another alpha \('3'; here '5/2'\)", problem, 2.5)
    refused(path, "arithmetic 'exact'; expected \"verified\"", problem, alpha, arithmetic="exact")
    records = records_of(whole.proof)
    for change, message in (
        ({"data": "condensed"}, "another data"),
        ({"version": 3}, "another version"),
        ({"force": [x + 1 for x in records[0]["force"]]}, "other units"),
    ):
        path.write_bytes(bytes_of(proof_of([records[0] | change, *records[1:]])))
        refused(path, message, problem, alpha)
    path.write_bytes(b"enumsol-proof 3\n" + bytes_of(whole.proof)[16:])
    refused(path, "is of another version", problem, alpha)
    for content in (b"My notes on contact.\n", bytes_of(proof_of([[1, 2], ["x"]]))):
        path.write_bytes(content)
        refused(path, "is not a proof", problem, alpha)
    square = gallery.two_node_square()
    enumsol.branch_graph(square, (0, 10)).proof.save(path)
    refused(path, "is a proof of another kind, 'graph'", square, 5)


def test_arguments(tmp_path):
    problem, alpha, _ = known("one node")
    bad_argument("resume is True without proof_path", enumerate_roots, problem, alpha, resume=True)
    with pytest.raises(InvalidArgumentError, match="resume is a str; expected a bool"):
        enumerate_roots(problem, alpha, proof_path=tmp_path / "x", resume="yes")
    bad_argument("cannot be read", enumerate_roots, problem, alpha, proof_path=tmp_path, resume=True)


# -- killed ------------------------------------------------------------------------------------------------------------

#: Searches, and stops for good at a node of the tree, for someone else to kill it.
CHILD = textwrap.dedent("""
    import signal, sys
    from enumsol import enumerate_roots, gallery
    from enumsol.search import nodes as forms
    forms.FORM_AFTER = 100
    path, at, resume = sys.argv[1], int(sys.argv[2]), sys.argv[3] == "resume"
    def wait(progress):
        if progress.nodes + progress.resumed >= at:
            print("here", flush=True)
            signal.pause()
    entry = gallery.get("wedge-14-5")
    enumerate_roots(entry.build(), entry.alpha, proof_path=path, progress=wait, resume=resume)
""")


def killed(path, at, how="begin"):
    """Run a search in a process of its own up to a node, and kill it."""
    command = [sys.executable, "-c", CHILD, str(path), str(at), how]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
        assert process.stdout.readline().strip() == b"here"
        os.kill(process.pid, signal.SIGKILL)
        process.wait()


def length(path):
    return sum(1 for _ in BegunProof(path).records())


@pytest.mark.skipif(sys.platform == "win32", reason="kill -9")
def test_kill_9(tmp_path):
    (problem, alpha), path = named("wedge-14-5"), tmp_path / "x.proof"
    whole = enumerate_roots(problem, alpha)
    killed(path, 320)
    first, data = length(path), path.read_bytes()
    assert first >= 320 - FLUSH_EVERY
    # killed again before it has gone through what the first file holds: that file stays
    killed(path, 128, "resume")
    assert path.read_bytes() == data
    # killed after: it is replaced by one that holds more
    killed(path, 576, "resume")
    second = length(path)
    assert second >= 576 - FLUSH_EVERY - 1
    assert [path.name, path.name + BESIDE][: len(os.listdir(tmp_path))] == sorted(os.listdir(tmp_path))
    found = all_roots(problem, alpha, proof_path=path, resume=True)
    assert not differences(found, whole, rtol=1e-9)
    assert found.stats.resumed >= second - 1
    assert found.stats.resumed + found.stats.nodes == whole.stats.nodes
    assert verify(problem, Proof.load(path)).complete
    assert os.listdir(tmp_path) == [path.name]


@pytest.mark.parametrize("at", [64, 448])
def test_ctrl_c_of_a_resumed_search(at, tmp_path, monkeypatch):
    monkeypatch.setattr(policy, "FORM_AFTER", 1)
    (problem, alpha), path = named("wedge-14-5"), tmp_path / "x.proof"

    def stop(progress):
        if progress.nodes + progress.resumed >= stop.at:
            raise KeyboardInterrupt

    lengths = []
    for stop.at in (320, at):
        before = path.read_bytes() if path.exists() else None
        with pytest.raises(Interrupted):
            enumerate_roots(problem, alpha, proof_path=path, progress=stop, resume=True)
        lengths.append(length(path))
        assert os.listdir(tmp_path) == [path.name]
    assert lengths[1] >= lengths[0] >= 256
    if at < lengths[0]:
        assert path.read_bytes() == before
    else:
        assert lengths[1] > lengths[0]
    found = all_roots(problem, alpha, proof_path=path, resume=True)
    assert found.stats.resumed >= lengths[1] - 1
    assert len(found) == 5


def test_progress_tells_what_came_from_the_file(tmp_path):
    seen = []
    resumed("wedge", bytes_of(known("wedge")[2].proof)[:-5000], tmp_path / "x.proof", progress=seen.append)
    assert [state.resumed for state in seen] == sorted(state.resumed for state in seen)
    assert seen[-1].resumed > 0
    assert all(0 <= state.covered <= 1 for state in seen)
