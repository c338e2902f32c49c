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
