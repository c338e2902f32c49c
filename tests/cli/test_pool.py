"""Processes of ``--jobs`` that are ended in the middle of a result or a task."""

import concurrent.futures
import errno
import subprocess
import sys
from concurrent.futures import BrokenExecutor

import pytest

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


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("call", "wait"),
    [("bytes, 2**27", "futures[0].result()"), ("len, bytes(2**26)", "time.sleep(0.5)"), ("time.sleep, 600", "pass")],
    ids=["result", "task", "work"],
)
def test_leaving_never_waits(call, wait, tmp_path):
    script = tmp_path / "script.py"
    script.write_text(SCRIPT.format(call=call, wait=wait, rounds=3))
    # without its end such a program never ends
    done = subprocess.run([sys.executable, script], capture_output=True, timeout=100, text=True, check=False)
    assert done.returncode == 0, done.stderr


def pool_that_raises(error):
    class Pool(concurrent.futures.Executor):
        def __init__(self, *_, **__):
            pass

        def submit(self, *_):
            raise error

    return Pool


def test_a_process_that_dies_while_a_task_is_handed_in(monkeypatch):
    # the pool's thread closes the pipe between the check that it is whole and the call that uses it
    monkeypatch.setattr(concurrent.futures, "ProcessPoolExecutor", pool_that_raises(OSError("handle is closed")))
    pool = RenewedPool(2)
    pool.renew()
    with pytest.raises(BrokenExecutor, match="a process died"):
        pool.submit(int)


def test_a_system_that_starts_no_more_processes(monkeypatch):
    error = OSError(errno.EAGAIN, "Resource temporarily unavailable")
    monkeypatch.setattr(concurrent.futures, "ProcessPoolExecutor", pool_that_raises(error))
    with pytest.raises(OSError, match="temporarily unavailable"):
        RenewedPool(2).renew()
