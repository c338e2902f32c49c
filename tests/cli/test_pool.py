"""Processes of ``--jobs`` that are ended in the middle of a result or a task."""

import errno
import multiprocessing.popen_spawn_posix
import subprocess
import sys

import pytest
from effort import some

from enumsol.cli.pool import RenewedPool

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
    script = tmp_path / "script.py"
    script.write_text(SCRIPT.format(call=call, wait=wait, rounds=some(1, of=3)))
    # without its end such a program never ends
    done = subprocess.run([sys.executable, script], capture_output=True, timeout=100, text=True, check=False)
    assert done.returncode == 0, done.stderr


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
    script = tmp_path / "script.py"
    script.write_text(TOLD)
    done = subprocess.run([sys.executable, script], capture_output=True, timeout=100, text=True, check=False)
    assert done.returncode == 0, done.stderr
    what, count = done.stdout.rsplit(" ", 1)
    assert what == "{('columns in a worker', 3, 40)}"
    assert 1 <= int(count) <= 3


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
