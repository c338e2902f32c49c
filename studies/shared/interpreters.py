"""Other Python interpreters, in which codes are installed that this one does not have."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys


def interpreter(library: str, more: str | None = None) -> str | None:
    """A Python that has a library: this one, another one that was named, or that of the system."""
    found = [sys.executable, more, shutil.which("python3", path="/usr/bin"), shutil.which("python3")]
    for python in filter(None, found):
        if call(python, "-c", f"import {library}").returncode == 0:
            return python
    return None


def call(*command: str, seconds: int | None = None, folder: str | None = None) -> subprocess.CompletedProcess[str]:
    """Run a command with one thread, without the environment of this Python; killed after so many CPU seconds.

    ``folder`` is where it runs.
    """
    hidden = ("PYTHONPATH", "PYTHONWARNINGS", "VIRTUAL_ENV")
    environment = {name: value for name, value in os.environ.items() if name not in hidden} | {"OMP_NUM_THREADS": "1"}
    if seconds is not None:
        command = ("sh", "-c", f'ulimit -t {seconds}; exec "$@"', "sh", *command)
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False, cwd=folder)
