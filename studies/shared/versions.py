"""Two versions of the package beside each other, each in processes of its own, taking turns.

What was measured of the older version is kept as JSON among the results, and read again when no older version is named.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from argparse import ArgumentParser, Namespace
    from pathlib import Path
    from typing import Any


def version_options(parser: ArgumentParser, rounds: int) -> None:
    """Options of a study that compares versions."""
    parser.add_argument("--rounds", type=int, default=rounds, help="how often everything is measured")
    parser.add_argument("--against", metavar="PYTHON", help="interpreter of an environment with an older version")
    parser.add_argument("--label", default="an older version", help="name of that version")


def interpreters(given: Namespace) -> list[str]:
    """Path of the interpreter that runs, and of that with an older version where one is named."""
    found = [sys.executable, *([given.against] if given.against else [])]
    homes = [new_process(python, "-c", "import enumsol; print(enumsol.__file__)")[1] for python in found]
    if len(set(homes)) < len(homes):
        print("both interpreters import the same enumsol: differences between before and now are noise")
    return found


def new_process(python: str, *arguments: str) -> tuple[float, str]:
    """Wall time and output of a new process with one thread."""
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    started = time.perf_counter()
    done = subprocess.run([python, *arguments], check=True, stdout=subprocess.PIPE, text=True, env=environment)
    return time.perf_counter() - started, done.stdout


def before(file: Path, label: str, measured: dict[str, Any] | None) -> dict[str, Any] | None:
    """What the older version took: as just measured, and then kept in the file, or as the file has it, if any."""
    if measured is not None:
        text = json.dumps({"label": label, **measured}, indent=1)
        file.write_text(text + "\n", encoding="utf-8")
    return json.loads(file.read_text(encoding="utf-8")) if file.exists() else None
