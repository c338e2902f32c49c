"""A worker that dies costs time and nothing else: its tasks are done again."""

import os
import pickle
import signal
import subprocess
import sys
import time
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import pytest
from complete import complete_report
from documents import ROOT
from dying import DyingExecutor
from proof_tools import bytes_of

import enumsol
from enumsol import Proof, enumerate_roots, gallery, multiplicity_table, verify, write_problem
from enumsol.search import setup
from enumsol.support import workers
from enumsol.support.workers import Crew, RenewedPool

#: What takes a process down.
DEATHS = {"os._exit": (os._exit, 1), "SIGKILL": (signal.raise_signal, signal.SIGKILL)}
#: A task that no machine has the memory for.
TOO_MUCH = (bytearray, 2**62)
ALPHAS = [0.0, 1.0, 2.0, 3.5, 5.0, 7.0]


@pytest.fixture(autouse=True)
def small_tasks(monkeypatch):
    monkeypatch.setattr(setup, "NODES", 8)
    monkeypatch.setattr(setup, "FIRST", 8)


@pytest.fixture(scope="module")
def square():
    return gallery.two_node_square()


def bereaved(call, *arguments, healthy, last=DEATHS["os._exit"], **options):
    """What a call comes to that loses a process after so many tasks, and is told so."""
    with ProcessPoolExecutor(2) as pool, pytest.warns(RuntimeWarning, match="a worker died"):
        return call(*arguments, executor=DyingExecutor(pool, healthy, *last), **options)


def check(found, problem, alpha):
    """Nothing is missing, and the proof is that of a search whose workers live."""
    with ThreadPoolExecutor(1) as pool:
        whole = enumerate_roots(problem, alpha, found.arithmetic, executor=pool)
    assert [root.statuses for root in found] == [root.statuses for root in whole]
    assert (found.complete, found.stats.nodes) == (whole.complete, whole.stats.nodes)
    if found.proof is not None:
        assert found.complete
        assert bytes_of(found.proof) == bytes_of(whole.proof)
        assert verify(problem, found.proof).complete


# -- enumerate_roots ---------------------------------------------------------------------------------------------------


@pytest.mark.few(4)
@pytest.mark.parametrize("healthy", [0, 1, 12])
@pytest.mark.parametrize("death", DEATHS)
def test_a_process_that_dies(wedge, death, healthy, tmp_path):
    path = tmp_path / "p"
    found = bereaved(enumerate_roots, *wedge, healthy=healthy, last=DEATHS[death], proof_path=path)
    check(found, *wedge)
    assert found.stats.redone > 0
    assert bytes_of(Proof.load(path)) == bytes_of(found.proof)


@pytest.mark.parametrize("pool", [ProcessPoolExecutor, ThreadPoolExecutor])
def test_a_worker_that_runs_out_of_memory(wedge, pool):
    with pool(2) as inner, pytest.warns(RuntimeWarning, match="ran out of memory; what it had to do is done again"):
        found = enumerate_roots(*wedge, executor=DyingExecutor(inner, 12, *TOO_MUCH))
    check(found, *wedge)
    assert found.stats.redone == 1


def test_an_executor_that_was_shut_down(wedge):
    pool = ThreadPoolExecutor(1)
    pool.shutdown()
    with pytest.warns(RuntimeWarning, match=r"takes no tasks .*after shutdown.*; the calling process does the rest"):
        found = enumerate_roots(*wedge, executor=pool)
    check(found, *wedge)
    assert found.stats.redone == 0


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
    with ThreadPoolExecutor(1) as pool, pytest.warns(RuntimeWarning, match="a task was cancelled"):
        found = enumerate_roots(*wedge, executor=Cancelling(pool, 12))
    check(found, *wedge)


class Forgetting(DyingExecutor):
    """Breaks with its first task, and forgets the next, which came at that moment: its future never ends."""

    def submit(self, function, /, *args, **kwargs):
        if len(self.futures) > 1:
            raise BrokenProcessPool("broken")
        future = Future()
        if not self.futures:
            future.set_exception(BrokenProcessPool("broken"))
        self.futures.append(future)
        return future


def test_a_task_that_a_broken_pool_forgets(square, wedge, monkeypatch):
    monkeypatch.setattr(workers, "_PATIENCE", 0.05)
    with pytest.warns(RuntimeWarning, match="a worker died"):
        check_table(multiplicity_table(square, ALPHAS, executor=Forgetting(None, 0)), square)
    with pytest.warns(RuntimeWarning, match="a worker died"):
        check(enumerate_roots(*wedge, executor=Forgetting(None, 0)), *wedge)


class Renewed(ThreadPoolExecutor):
    """Forgets its first task, breaks with the second, and takes all others."""

    def __init__(self):
        super().__init__(1)
        self.taken = 0

    def renew(self):
        """It is as good as a new one."""

    def submit(self, function, /, *args, **kwargs):
        self.taken += 1
        if self.taken == 2:
            raise BrokenProcessPool("broken")
        return Future() if self.taken == 1 else super().submit(function, *args, **kwargs)


def test_patience_is_for_what_was_forgotten_alone(monkeypatch):
    """Where no time is given, what takes longer than it is waited for."""
    monkeypatch.setattr(workers, "_PATIENCE", 0.05)
    with Renewed() as executor, pytest.warns(RuntimeWarning, match="a worker died"):
        found, redone = results(executor, (pow, 2, 3), (time.sleep, 0.3))
    assert (set(found), redone) == ({8, None}, 1)


def test_arithmetic_without_a_proof(wedge):
    found = bereaved(enumerate_roots, *wedge, "fast", healthy=12)
    check(found, *wedge)
    assert found.proof is None


def test_limits_hold_when_a_worker_dies(wedge):
    found = bereaved(enumerate_roots, *wedge, healthy=3, max_nodes=100)
    left = len(found.undecided)
    assert (found.stats.nodes, verify(wedge[0], found.proof).undecided) == (100, left)
    assert found.stopped == f"stopped after max_nodes = 100 nodes, {left} subtrees not examined"


# -- pools that are made anew ------------------------------------------------------------------------------------------


def dies_once(home, mark, value):
    """A task that takes its process down the first time, unless it is that process."""
    if os.getpid() != home and not os.path.exists(mark):
        Path(mark).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return value, os.getpid()


def dies_in_workers(home):
    """A task that takes every process down but one."""
    if os.getpid() != home:
        os._exit(1)
    return home


def results(pool, *calls):
    """What calls come to, and how many were made again."""
    crew = Crew(pool)
    for call in calls:
        crew.submit(*call)
    return [crew.next().result for _ in calls], crew.redone


#: Processes that are not forked import this module by its path from the root: only `python -m pytest` has that.
_ALONE = pytest.mark.skipif(
    "PYTEST_XDIST_WORKER" in os.environ or str(ROOT) not in sys.path, reason="run by the test below"
)


@_ALONE
@pytest.mark.skipif(sys.platform == "win32", reason="kill -9")
def test_a_pool_is_made_anew(tmp_path):
    pool = RenewedPool(2)
    pool.renew()
    mark = str(tmp_path / "mark")
    with pool, pytest.warns(RuntimeWarning, match="a worker died"):
        found, redone = results(pool, *((dies_once, os.getpid(), mark, k) for k in range(6)))
    assert sorted(value for value, _ in found) == list(range(6))
    # the work went on in processes, not here
    assert os.getpid() not in {pid for _, pid in found}
    assert redone > 0


@_ALONE
def test_what_kills_every_worker_is_done_here():
    pool = RenewedPool(1)
    pool.renew()
    with pool, pytest.warns(RuntimeWarning, match="a worker died"):
        assert results(pool, (dies_in_workers, os.getpid())) == ([os.getpid()], 3)


@pytest.mark.long
def test_pools_are_made_anew_in_a_process_of_their_own():
    """A process of the tests was once lost beside them, and all that it had still to do."""
    variables = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    tests = test_a_pool_is_made_anew, test_what_kills_every_worker_is_done_here
    command = [sys.executable, "-m", "pytest", "-n", "0", *(f"{__file__}::{test.__name__}" for test in tests)]
    done = subprocess.run(command, check=False, env=variables, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "passed" in done.stdout


# -- multiplicity_table ------------------------------------------------------------------------------------------------


def check_table(table, problem):
    whole = multiplicity_table(problem, ALPHAS)
    assert table.drop(columns="seconds").to_dict("records") == whole.drop(columns="seconds").to_dict("records")


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("death", DEATHS)
def test_a_table_is_whole(square, death):
    # the loss is found when a task is handed in, or, after the last one, when its result is
    for done in (0, 3, 5):
        check_table(bereaved(multiplicity_table, square, ALPHAS, healthy=done, last=DEATHS[death]), square)


def test_a_table_whose_thread_runs_out_of_memory(square):
    with ThreadPoolExecutor(1) as pool, pytest.warns(RuntimeWarning, match="ran out of memory"):
        table = multiplicity_table(square, ALPHAS, executor=DyingExecutor(pool, 2, *TOO_MUCH))
    check_table(table, square)


@pytest.mark.long
def test_dask_workers_that_die(square, wedge):
    dask, distributed = pytest.importorskip("dask"), pytest.importorskip("distributed")
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 0}),
        distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=":0") as cluster,
        distributed.Client(cluster) as client,
    ):
        with pytest.warns(RuntimeWarning, match=r"a worker died \(KilledWorker"):
            table = multiplicity_table(square, ALPHAS, executor=DyingExecutor(client.get_executor(), 2, os._exit, 1))
        check_table(table, square)
        with pytest.warns(RuntimeWarning, match=r"a worker died \(KilledWorker"):
            found = enumerate_roots(*wedge, executor=DyingExecutor(client.get_executor(), 12, os._exit, 1))
        check(found, *wedge)


# -- what is not a dead worker -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("pool", [ProcessPoolExecutor, ThreadPoolExecutor])
def test_an_error_of_the_task_stays_what_it_is(square, pool):
    with pool(1) as executor, pytest.raises(enumsol.InvalidArgumentError, match="max_nodes is 0"):
        multiplicity_table(square, ALPHAS, executor=executor, max_nodes=0)


def test_errors_with_a_partial_result_survive_a_pickle(square):
    roots = enumerate_roots(square, 3.5)
    for kind in (enumsol.Interrupted, enumsol.OutputError):
        again = pickle.loads(pickle.dumps(kind("what happened", roots)))
        assert (type(again), str(again)) == (kind, "what happened")
        assert [root.statuses for root in again.partial] == [root.statuses for root in roots]


# -- on the command line -----------------------------------------------------------------------------------------------


def spawned(pid):
    """Worker processes of a process, without the one that tracks its resources."""
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    return [int(child) for child in children if "spawn_main" in Path(f"/proc/{child}/cmdline").read_text()]


def lives(pid):
    """Whether a process has not ended; one that ended may wait for whoever inherited it."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="the workers are found in /proc")
def test_workers_end_with_a_command_that_is_killed(tmp_path):
    file = tmp_path / "chain.npz"
    write_problem(gallery.chain(12, 0.05), file)
    process = subprocess.Popen([sys.executable, "-m", "enumsol", "roots", str(file), "--alpha", "5", "--jobs", "2"])
    try:
        while process.poll() is None and len(spawned(process.pid)) < 2:
            time.sleep(0.01)
        workers = spawned(process.pid)
    finally:
        process.kill()
        process.wait()
    assert len(workers) == 2
    while any(lives(pid) for pid in workers):
        time.sleep(0.01)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="the worker is found in /proc")
def test_a_worker_killed_from_outside(tmp_path):
    # 3^6 roots; the worker is killed as soon as it is there
    file, proof = tmp_path / "chain.npz", tmp_path / "chain.proof"
    problem = gallery.chain(6, 0.05)
    write_problem(problem, file)
    command = [sys.executable, "-m", "enumsol", "roots", str(file), "--alpha=5", "--jobs=2", f"--proof={proof}"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        while process.poll() is None and not spawned(process.pid):
            time.sleep(0.01)
        os.kill(spawned(process.pid)[0], signal.SIGKILL)
        out, err = process.communicate(timeout=300)
    finally:
        process.kill()
        process.communicate()
    assert process.returncode == 0
    assert err.startswith("enumsol: warning: a worker died (")
    assert out.splitlines()[-1] == "complete: yes (proven)"
    assert complete_report(problem, Proof.load(proof)).roots == 3**6
