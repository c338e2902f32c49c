"""Processes of ``--jobs`` that are ended in the middle of a result or a task."""

import errno
import inspect
import multiprocessing.popen_spawn_posix
import subprocess
import sys
import threading
from concurrent.futures import BrokenExecutor, ThreadPoolExecutor
from typing import ClassVar

import pytest
from command_line import assert_refused, run
from effort import some
from loky import ProcessPoolExecutor
from refusals import bad_argument

import enumsol
from enumsol.cli import common
from enumsol.support import workers as pool
from enumsol.support.deadlines import heard_by, tell
from enumsol.support.workers import RenewedPool

SCRIPT = """
import time
from enumsol.cli.common import workers

if __name__ == "__main__":
    for _ in range({rounds}):
        with workers(2) as pool:
            futures = [pool.submit({call}) for _ in range(8)]
            {wait}
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("call", "wait"),
    [("bytes, 2**27", "futures[0].result()"), ("len, bytes(2**26)", "time.sleep(0.5)"), ("time.sleep, 600", "pass")],
    ids=["result", "task", "work"],
)
def test_leaving_never_waits(call, wait, tmp_path):
    # without its end such a program never ends
    output_of(tmp_path / "script.py", SCRIPT.format(call=call, wait=wait, rounds=some(1, of=3)))


def output_of(file, program):
    """What a program prints that ends within a time, and without an error."""
    file.write_text(program)
    done = subprocess.run([sys.executable, file], capture_output=True, timeout=100, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


TOLD = """
import time
from enumsol.cli.common import workers
from enumsol.support.deadlines import heard_by, tell

def work(seconds):
    start = time.monotonic()
    while time.monotonic() < start + seconds:
        tell("columns", 3, 40)
        time.sleep(0.05)

if __name__ == "__main__":
    heard = []
    with workers(2) as pool:
        pool.submit(work, 2.5).result()  # nobody listens
        with heard_by(lambda *told: heard.append(told)):
            pool.submit(work, 0.5).result()
            assert not heard
            pool.submit(work, 4.5).result()
    print(set(heard), len(heard))
"""


@pytest.mark.slow
def test_what_a_worker_is_at_is_heard_if_it_takes_long(tmp_path):
    what, count = output_of(tmp_path / "script.py", TOLD).rsplit(" ", 1)
    assert what == "{('columns in a worker', 3, 40)}"
    assert 1 <= int(count) <= 3


class Threads(ThreadPoolExecutor):
    """A pool of threads in the place of one of processes; what it is given at first dies, if so told."""

    def __init__(self, size, context, initializer, initargs):
        super().__init__(size, initializer=initializer, initargs=initargs)
        self.died = False

    def submit(self, function, /, *arguments, **named):
        if function is int and not self.died:
            self.died = True
            raise BrokenExecutor("a process died")
        return super().submit(function, *arguments, **named)

    def shutdown(self, wait, *, kill_workers):
        super().shutdown(wait, cancel_futures=kill_workers)


def at_columns(count):
    """A task that tells what it is at."""
    for k in range(count):
        tell("columns " * 100, k, count)
    return count


def test_what_tasks_tell_is_heard_by_whoever_listened_when_they_were_submitted(monkeypatch):
    monkeypatch.setattr("loky.ProcessPoolExecutor", Threads)
    monkeypatch.setattr(pool, "_to_parent", [])
    monkeypatch.setattr(pool, "_QUIET", 0.0)
    monkeypatch.setattr(pool, "_PAUSE", 0.0)
    heard, all_heard = [], threading.Event()

    def listener(*told):
        heard.append(told)
        if len(heard) == 3:
            all_heard.set()

    with RenewedPool(2) as tasks:
        with pytest.raises(BrokenExecutor, match="there are no processes"):
            tasks.submit(at_columns, 1)
        # one that died at once is left to the search, which starts others
        tasks.renew()
        with heard_by(listener):
            assert tasks.submit(at_columns, 3).result() == 3
        assert all_heard.wait(60)
        # nobody listens
        assert tasks.submit(at_columns, count=2).result() == 2
    # a message is not longer than what a pipe takes at once
    assert heard == [(("columns " * 100)[:200] + " in a worker", k, 3) for k in range(3)]


def test_a_system_that_starts_no_more_processes(monkeypatch):
    started = multiprocessing.popen_spawn_posix.Popen.__init__
    processes = []

    def one_only(self, process):
        if processes:
            raise OSError(errno.EAGAIN, "Resource temporarily unavailable")
        processes.append(process)
        started(self, process)

    monkeypatch.setattr("multiprocessing.popen_spawn_posix.Popen.__init__", one_only)
    with pytest.raises(OSError, match="temporarily unavailable"):
        RenewedPool(2).renew()
    # what was started already does not stay
    assert not processes[0].is_alive()


# -- more jobs than there are processors -------------------------------------------------------------------------------


@pytest.fixture
def three_processors(monkeypatch):
    monkeypatch.setattr(common, "processors", lambda: 3)


@pytest.fixture
def started(monkeypatch):
    """Sizes of the pools that are made, none of which has more than one process."""
    sizes = []

    def pool(size, **options):
        sizes.append(size)
        return ProcessPoolExecutor(1, **options)

    monkeypatch.setattr("loky.ProcessPoolExecutor", pool)
    return sizes


ROOTS = ("roots", "gallery:one-node-6.1", "--alpha", 5)
TABLE = ("table", "gallery:one-node-6.1", "--alphas", "1,2")


@pytest.mark.slow
@pytest.mark.parametrize("verb", [ROOTS, TABLE])
def test_more_jobs_than_processors(capsys, three_processors, started, verb):
    status, out, err = run(capsys, *verb, "--jobs", 1_000_000)
    assert status == 0
    assert "complete: yes" in out
    assert started == [3]
    assert err == "enumsol: note: --jobs is 1000000; 3 are used, as many as this machine can keep busy\n"


@pytest.mark.parametrize("jobs", [2, 3])
def test_as_many_jobs_as_there_are_processors_need_no_word(capsys, three_processors, started, jobs):
    status, _, err = run(capsys, *ROOTS, "--jobs", jobs)
    assert (status, err, started) == (0, "", [jobs])


def test_windows_waits_for_no_more_than_61(capsys, monkeypatch):
    monkeypatch.setattr(common, "processors", lambda: 128)
    assert common.capped(100) == 100
    monkeypatch.setattr(common.sys, "platform", "win32")
    assert common.capped(100) == 61
    assert capsys.readouterr().err.startswith("enumsol: note: --jobs is 100; 61 are used, ")


def test_a_command_on_a_system_that_starts_no_more_processes(capsys, monkeypatch, three_processors):
    class Refusing(ProcessPoolExecutor):
        def submit(self, *_):
            raise BlockingIOError(11, "Resource temporarily unavailable")

    monkeypatch.setattr("loky.ProcessPoolExecutor", Refusing)
    found = run(capsys, *ROOTS, "--jobs", 2)
    assert_refused(*found, "--jobs is 2", "starts no more processes (Resource temporarily unavailable)")


# -- jobs= in Python ---------------------------------------------------------------------------------------------------

SQUARE = enumsol.gallery.two_node_square()
#: Whatever takes an executor, and what is compared of its result.
WITH_JOBS = {
    "enumerate_roots": (lambda **o: enumsol.enumerate_roots(SQUARE, 3.5, **o), len),
    "branch_graph": (lambda **o: enumsol.branch_graph(SQUARE, (3, 4), **o), repr),
    "multiplicity_table": (lambda **o: enumsol.multiplicity_table(SQUARE, [1, 3.5], **o)["roots"].tolist(), repr),
    "histories": (lambda **o: enumsol.histories(SQUARE, [1, 3.5], **o), repr),
    "multiplicity_map": (lambda **o: enumsol.multiplicity_map(SQUARE, (3, 4), {"gap": [0, 0.1]}, **o), repr),
}  # fmt: skip


class Renewed(ThreadPoolExecutor):
    """Renewed in the place of processes, which take a second to start."""

    made: ClassVar[list] = []

    def __init__(self, jobs):
        super().__init__(jobs)
        self.made.append(jobs)

    def renew(self):
        """Nothing dies."""


@pytest.mark.parametrize("name", WITH_JOBS)
def test_jobs_in_python_are_those_of_the_command_line(name, monkeypatch):
    call, of = WITH_JOBS[name]
    monkeypatch.setattr(pool, "RenewedPool", Renewed)
    monkeypatch.setattr(Renewed, "made", [])
    assert of(call(jobs=3)) == of(call())
    assert of(call(jobs=1)) == of(call())
    assert Renewed.made == [3]
    bad_argument("jobs is 0; expected an integer of at least 1", call, jobs=0)
    with ThreadPoolExecutor(1) as other:
        bad_argument("executor and jobs are both given", call, jobs=2, executor=other)


def test_nothing_takes_an_executor_without_jobs():
    public = {name: getattr(enumsol, name) for name in enumsol.__all__}
    takes = {n for n, f in public.items() if inspect.isfunction(f) and "executor" in inspect.signature(f).parameters}
    assert takes == WITH_JOBS.keys()


@pytest.mark.slow
def test_jobs_are_processes(tmp_path):
    program = """
import enumsol

if __name__ == "__main__":
    roots = enumsol.enumerate_roots(enumsol.gallery.get("wedge-8-5").build(), 3, jobs=2)
    print(len(roots), roots.complete)
"""
    assert output_of(tmp_path / "script.py", program) == "5 True\n"
