"""Line 10: a worker process that dies gives an EnumsolError with what was found, not BrokenProcessPool."""

import csv
import json
import os
import pickle
import signal
import subprocess
import sys
import time
from concurrent.futures import CancelledError, Future, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import pytest
from cli.test_cli import run
from dying import DyingExecutor

import enumsol
from enumsol import EnumsolError, enumerate_roots, gallery, multiplicity_table, verify, write_problem

#: What takes a process down.
DEATHS = {"os._exit": (os._exit, 1), "SIGKILL": (signal.raise_signal, signal.SIGKILL)}
#: A task that no machine has the memory for.
TOO_MUCH = (bytearray, 2**62)
ALPHAS = [0.0, 1.0, 2.0, 3.5, 5.0, 7.0]


@pytest.fixture(scope="module")
def wedge():
    entry = gallery.get("wedge-8-5")
    return entry.build(), entry.alpha


@pytest.fixture(scope="module")
def square():
    return gallery.two_node_square()


def check_partial(partial, problem, alpha):
    """Cut short, without a claim, and true of the whole."""
    assert not partial.complete
    assert "subtrees not examined" in partial.stopped
    assert partial.undecided
    assert repr(partial).splitlines()[-1].startswith("complete: no (")
    whole = enumerate_roots(problem, alpha)
    assert {root.statuses for root in partial} <= {root.statuses for root in whole}
    # the proof holds for what was finished and counts the rest
    report = verify(problem, partial.proof)
    assert report.ok
    assert not report.complete
    assert (report.roots, report.undecided) == (len(partial), len(partial.undecided))


# -- enumerate_roots ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("death", DEATHS)
def test_a_process_that_dies_leaves_what_was_found(wedge, death, tmp_path):
    problem, alpha = wedge
    with ProcessPoolExecutor(2) as pool, pytest.raises(enumsol.WorkerError, match="a worker died") as caught:
        enumerate_roots(problem, alpha, executor=DyingExecutor(pool, 12, *DEATHS[death]), proof_path=tmp_path / "p")
    assert isinstance(caught.value, EnumsolError)
    assert str(caught.value).count("\n") == 0
    partial = caught.value.partial
    assert len(partial) > 0
    assert f"{len(partial)} root{'s' * (len(partial) != 1)} so far" in str(caught.value)
    check_partial(partial, problem, alpha)


def test_a_pool_that_is_dead_from_the_first_task_on(wedge):
    problem, alpha = wedge
    with ProcessPoolExecutor(2) as pool, pytest.raises(enumsol.WorkerError, match="0 roots so far") as caught:
        enumerate_roots(problem, alpha, executor=DyingExecutor(pool, 0, *DEATHS["os._exit"]))
    check_partial(caught.value.partial, problem, alpha)
    assert len(caught.value.partial) == 0


@pytest.mark.parametrize("pool", [ProcessPoolExecutor, ThreadPoolExecutor])
def test_a_worker_that_runs_out_of_memory(wedge, pool):
    problem, alpha = wedge
    with pool(2) as inner, pytest.raises(enumsol.WorkerError, match="ran out of memory") as caught:
        enumerate_roots(problem, alpha, executor=DyingExecutor(inner, 12, *TOO_MUCH))
    check_partial(caught.value.partial, problem, alpha)
    assert "ran out of memory" in caught.value.partial.stopped


def test_an_executor_that_was_shut_down(wedge):
    problem, alpha = wedge
    pool = ThreadPoolExecutor(1)
    pool.shutdown()
    with pytest.raises(enumsol.WorkerError, match=r"takes no tasks .*after shutdown") as caught:
        enumerate_roots(problem, alpha, executor=pool)
    check_partial(caught.value.partial, problem, alpha)


class Cancelling(DyingExecutor):
    """Cancels a task instead."""

    def submit(self, function, /, *args, **kwargs):
        if len(self.futures) != self.healthy:
            return super().submit(function, *args, **kwargs)
        future = Future()
        future.cancel()
        self.futures.append(future)
        return future


def test_a_task_that_was_cancelled(wedge):
    problem, alpha = wedge
    with ThreadPoolExecutor(1) as pool, pytest.raises(enumsol.WorkerError, match="a task was cancelled") as caught:
        enumerate_roots(problem, alpha, executor=Cancelling(pool, 12))
    assert isinstance(caught.value.__cause__.__cause__, CancelledError)
    check_partial(caught.value.partial, problem, alpha)


def test_arithmetic_without_a_proof_says_no_more(wedge):
    problem, alpha = wedge
    with ProcessPoolExecutor(2) as pool, pytest.raises(enumsol.WorkerError) as caught:
        enumerate_roots(problem, alpha, "fast", executor=DyingExecutor(pool, 12, *DEATHS["os._exit"]))
    partial = caught.value.partial
    assert partial.proof is None
    assert partial.stopped
    assert partial.completeness().startswith("complete: no (a worker died")


# -- multiplicity_table ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("death", DEATHS)
def test_a_table_keeps_its_finished_rows(square, death):
    # the loss is found when a task is handed in, or, after the last one, when its result is
    for done in (3, 5):
        with ProcessPoolExecutor(2) as pool, pytest.raises(enumsol.WorkerError, match=f"{done} of 6 alphas") as caught:
            multiplicity_table(square, ALPHAS, executor=DyingExecutor(pool, done, *DEATHS[death]))
        check_rows(caught.value.partial, square)
        assert caught.value.partial["alpha"].tolist() == ALPHAS[:done]


def check_rows(partial, problem):
    """The rows that are there are those of the whole table."""
    whole = multiplicity_table(problem, partial["alpha"])
    assert partial.drop(columns="seconds").to_dict("records") == whole.drop(columns="seconds").to_dict("records")


def check_without_the_third(partial, problem):
    """The other workers live: at least the rows that were finished by then are there, and not the lost one."""
    check_rows(partial, problem)
    assert partial["alpha"].tolist()[:2] == ALPHAS[:2]
    assert ALPHAS[2] not in partial["alpha"].tolist()


def test_a_table_whose_thread_runs_out_of_memory(square):
    with ThreadPoolExecutor(1) as pool, pytest.raises(enumsol.WorkerError, match="ran out of memory") as caught:
        multiplicity_table(square, ALPHAS, executor=DyingExecutor(pool, 2, *TOO_MUCH))
    check_without_the_third(caught.value.partial, square)


def test_dask_workers_that_die(square, wedge):
    import dask
    import distributed

    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 0}),
        distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        with pytest.raises(enumsol.WorkerError, match="of 6 alphas so far") as caught:
            multiplicity_table(square, ALPHAS, executor=DyingExecutor(client.get_executor(), 2, os._exit, 1))
        check_without_the_third(caught.value.partial, square)
        assert isinstance(caught.value.__cause__.__cause__, distributed.scheduler.KilledWorker)
        with pytest.raises(enumsol.WorkerError, match=r"a worker died \(KilledWorker") as caught:
            enumerate_roots(*wedge, executor=DyingExecutor(client.get_executor(), 12, os._exit, 1))
        check_partial(caught.value.partial, *wedge)


# -- what is not a dead worker -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("pool", [ProcessPoolExecutor, ThreadPoolExecutor])
def test_an_error_of_the_task_stays_what_it_is(square, pool):
    with pool(1) as executor, pytest.raises(enumsol.InvalidArgumentError, match="max_nodes is 0"):
        multiplicity_table(square, ALPHAS, executor=executor, max_nodes=0)


def test_errors_with_a_partial_result_survive_a_pickle(square):
    roots = enumerate_roots(square, 3.5)
    for kind in (enumsol.WorkerError, enumsol.Interrupted, enumsol.OutputError):
        again = pickle.loads(pickle.dumps(kind("what happened", roots)))
        assert type(again) is kind
        assert str(again) == "what happened"
        assert [root.statuses for root in again.partial] == [root.statuses for root in roots]


# -- on the command line -----------------------------------------------------------------------------------------------


def dying_workers(healthy):
    """In place of `enumsol.cli.common.workers`: a pool that loses a process after so many tasks."""

    @contextmanager
    def workers(jobs):
        with ProcessPoolExecutor(jobs) as pool:
            yield DyingExecutor(pool, healthy, os._exit, 1)

    return workers


def one_line(err):
    assert err.startswith("enumsol: error: a worker died (")
    assert err.count("\n") == 1
    return err


def test_roots_prints_and_writes_what_was_found(capsys, monkeypatch, tmp_path):
    monkeypatch.setattr("enumsol.cli.roots.workers", dying_workers(12))
    json_file, csv_file, proof = tmp_path / "r.json", tmp_path / "r.csv", tmp_path / "r.proof"
    status, out, err = run(
        capsys,
        *("roots", "gallery:wedge-8-5", "--alpha", 3, "--jobs", 2),
        *("--json", json_file, "--csv", csv_file, "--proof", proof),
    )
    assert status == 71
    one_line(err)
    content = json.loads(json_file.read_text())
    count = len(content["roots"])
    assert 0 < count < 5
    assert f"{count} root" in out
    assert f"{count} root{'s' * (count != 1)} so far" in err
    assert out.splitlines()[-1].startswith("complete: no (a worker died, ")
    assert content["complete"] is False
    assert content["stopped"].startswith("a worker died, ")
    assert len({row["root"] for row in csv.DictReader(csv_file.read_text().splitlines())}) == count
    # the proof says what it lacks
    status, out, _ = run(capsys, "verify", "gallery:wedge-8-5", proof)
    assert status == 3
    assert out.splitlines()[-1].strip() == "complete: no"


def test_table_prints_and_writes_what_was_done(capsys, monkeypatch, tmp_path):
    monkeypatch.setattr("enumsol.cli.table.workers", dying_workers(3))
    json_file, csv_file = tmp_path / "t.json", tmp_path / "t.csv"
    status, out, err = run(
        capsys,
        *("table", "gallery:two-node-6.4", "--alphas", "0,1,2,3.5,5", "--jobs", 2),
        *("--json", json_file, "--csv", csv_file),
    )
    assert status == 71
    assert "3 of 5 alphas so far" in one_line(err)
    assert out.splitlines()[-1] == "complete: no (a worker was lost after 3 of 5 alphas)"
    content = json.loads(json_file.read_text())
    assert [row["alpha"] for row in content["rows"]] == [0.0, 1.0, 2.0]
    assert content["complete"] is False
    assert content["completeness"] == "complete: no (a worker was lost after 3 of 5 alphas)"
    assert len(csv_file.read_text().splitlines()) == 4


def test_the_status_is_documented(capsys):
    for verb in ("roots", "table"):
        _, out, _ = run(capsys, verb, "--help")
        assert "71 when a process of --jobs died" in " ".join(out.split())


def spawned(pid):
    """Worker processes of a process, without the one that tracks its resources."""
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    return [int(child) for child in children if "spawn_main" in Path(f"/proc/{child}/cmdline").read_text()]


@pytest.mark.skipif(sys.platform != "linux", reason="the worker is found in /proc")
def test_a_worker_killed_from_outside(tmp_path):
    # 3^12 roots take minutes: whenever the worker is killed, the search is not over
    file = tmp_path / "chain.npz"
    write_problem(gallery.chain(12, 0.05), file)
    command = [sys.executable, "-m", "enumsol", "roots", str(file), "--alpha", "5", "--jobs", "2"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        while process.poll() is None and not spawned(process.pid):
            time.sleep(0.05)
        os.kill(spawned(process.pid)[0], signal.SIGKILL)
        out, err = process.communicate(timeout=300)
    finally:
        process.kill()
        process.communicate()
    assert process.returncode == 71
    one_line(err)
    assert out.splitlines()[-1].startswith("complete: no (a worker died, ")
