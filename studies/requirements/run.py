"""What does a case make the program do, before and now: modules, time, memory, programs solved, arithmetic?

Every case (``cases.py``) runs in new processes, some rounds of all cases in turn, so that a change of the machine's
load meets all of them. The figures are medians: process time of ``import enumsol`` and of the whole run from the
interpreter's start, and the peak resident size. A large body is read from a file, as matrices of another code would be.

``--against PYTHON`` names the interpreter of an environment with an older version: every case then runs there too, in
turn with this version, and what was measured is kept in requirements.before.json. Without it the columns "before" are
those of that file; their times are those of the machine of that day, and the time of ``import numpy`` then and now
tells whether they compare. The peak is read from /proc, so this study needs Linux.

Read ``libraries``: what a case loads; and ``peak MB`` beside that of "one node". The first note tells which differences
of times mean nothing.
"""

from __future__ import annotations

import json
import statistics
import tempfile
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING

from enumsol import gallery, write_problem
from requirements.cases import CASES
from requirements.notes import conclusions, draw, merged
from shared.versions import before, interpreters, new_process, version_options

if TYPE_CHECKING:
    from argparse import ArgumentParser

    from shared.results import Run

#: Cells of a body with 50,240 degrees of freedom, and its contact nodes.
BODY, SMOKE_BODY, CONTACT = (160, 156), (40, 8), 40
ROUNDS = 5
#: The cases that the conclusions name, and one command.
SMOKE_CASES = ("import enumsol", "one node", "body, fast", "body, verified", "enumsol gallery list")
MEASURED = ("import s", "import MB", "run s", "wall s", "peak MB")
#: What every program with numpy takes.
YARDSTICK = "import time, numpy; print(time.process_time())"


def options(parser: ArgumentParser) -> None:
    version_options(parser, ROUNDS)


def measure(rounds, pythons, names, cells):
    """Medians of all cases, and of the process time of ``import numpy``, for every interpreter."""
    child = str(Path(__file__).with_name("cases.py").resolve())
    seen = [{name: [] for name in names} for _ in pythons]
    numpy_seconds = [[] for _ in pythons]
    with tempfile.TemporaryDirectory() as directory:
        file = str(Path(directory) / "body.npz")
        write_problem(gallery.clamped_block(*cells, contact=CONTACT), file)
        for _, (k, python) in product(range(rounds), enumerate(pythons)):
            numpy_seconds[k].append(float(new_process(python, "-c", YARDSTICK)[1]))
        for _, name, (k, python) in product(range(rounds), names, enumerate(pythons)):
            wall, answer = new_process(python, child, name, file)
            seen[k][name].append({**json.loads(answer), "wall s": wall})
    return [
        {
            "numpy s": statistics.median(times),
            "rounds": rounds,
            "alone": True,
            "cases": {name: summary(runs) for name, runs in cases.items()},
        }
        for times, cases in zip(numpy_seconds, seen, strict=True)
    ]


def summary(runs):
    """Medians of the runs of one case; spread is (longest - shortest) / median of the whole run."""
    seconds = [run["run s"] for run in runs]
    medians = {key: statistics.median(run[key] for run in runs) for key in MEASURED}
    return {**runs[-1], **medians, "spread": (max(seconds) - min(seconds)) / medians["run s"]}


def main(run: Run) -> None:
    given = run.options
    names, cells = (SMOKE_CASES, SMOKE_BODY) if run.smoke else (tuple(CASES), BODY)
    now, *old = measure(given.rounds, interpreters(given), names, cells)
    earlier = before(run.path("requirements.before.json"), given.label, old[0] if old else None)
    rows = list(merged(now, earlier))
    run.table("requirements", rows, *conclusions(rows, now, earlier))
    run.figure("requirements", draw(rows))
