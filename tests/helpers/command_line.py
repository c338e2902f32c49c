"""The command line in the process of the tests, in one of its own, and at a terminal."""

import contextlib
import os
import pty
import select
import subprocess
import sys
import time

from enumsol.cli import main


def run(capsys, *arguments):
    status = main([str(argument) for argument in arguments])
    out, err = capsys.readouterr()
    return status, out, err


def printed(capsys, *arguments, status=0, note=None):
    """What a command prints that ends with this status, and with a note or with nothing beside it."""
    ended, out, err = run(capsys, *arguments)
    assert ended == status
    assert err == "" if note is None else note in err
    return out


def call(*arguments, **options):
    command = [sys.executable, "-m", "enumsol", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False, **options)


def assert_one_line(err, *parts):
    """An error is told in one line, which says all of this."""
    assert err.startswith("enumsol: error: ")
    assert err.count("\n") == 1, err
    for part in parts:
        assert part in err


def assert_refused(status, out, err, *parts):
    assert (status, out) == (2, "")
    assert_one_line(err, *parts)
    assert not err.endswith(".\n")


@contextlib.contextmanager
def on_terminal(*arguments):
    """The command with a terminal for its stderr, and a reader of that terminal."""
    master, slave = pty.openpty()
    command = [sys.executable, "-m", "enumsol", *map(str, arguments)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=slave, text=True)
    os.close(slave)
    shown = bytearray()

    def wait_for(pattern, seconds=60.0):
        end = time.monotonic() + seconds
        while time.monotonic() < end and pattern not in shown:
            if select.select([master], [], [], 0.2)[0]:
                shown.extend(os.read(master, 4096))
        assert pattern in shown, shown.decode(errors="replace")

    try:
        yield process, wait_for
    finally:
        process.kill()
        process.wait()
        process.stdout.close()
        os.close(master)
