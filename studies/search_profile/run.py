"""Where does the time of a search go, before and now?

Verified enumeration of the gallery's wedge (p = 14) and of blocks with p = 32, 64 and 100, the condensed problem made
outside the clock. Whole seconds are the least process time of some runs; the parts are those of further runs, sampled
every millisecond (``sampler.py``), in proportion. Every round is a new process and makes every problem anew; the least
of the rounds counts.

``--against PYTHON`` names the interpreter of an environment with an older version: its rounds and those of this version
alternate, and search_profile.before.json is made anew. Without it the columns "before" are those of that file; a fixed
piece of work timed in both tells whether the times compare.

Read ``time ratio`` (now over before) and ``without enclosure``, which leaves out what is made once a problem and serves
every alpha; then the share of each part.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import enumsol
from enumsol import gallery
from search_profile.notes import conclusions, draw, merged
from search_profile.sampler import PARTS, sampled, unknown_functions
from shared.clock import timed
from shared.loads import DRAGGED, PRESSED, Loaded, block
from shared.versions import before, interpreters, new_process, version_options

if TYPE_CHECKING:
    from shared.results import Run

STUDIES = Path(__file__).parents[1]
ROUNDS = 3
#: p, length, traction and friction of the blocks.
BLOCKS = (
    (32, 1.0, DRAGGED, 1.0),
    (32, 2.0, DRAGGED, 10.0),
    (64, 1.0, PRESSED, 3.0),
    (64, 1.0, DRAGGED, 1.0),
    (64, 2.0, DRAGGED, 10.0),
    (100, 1.0, PRESSED, 3.0),
    (100, 1.0, DRAGGED, 10.0),
    (100, 2.0, DRAGGED, 1.0),
)
#: A problem is searched again until so much process time was sampled [seconds].
SAMPLED, SMOKE_SAMPLED = 1.0, 0.05


def options(parser: argparse.ArgumentParser) -> None:
    version_options(parser, ROUNDS)
    # how the study calls itself: measure one round, and keep the least of what FILE holds and this
    parser.add_argument("--save", type=Path, metavar="FILE", help=argparse.SUPPRESS)


def problems(smoke: bool) -> list[Loaded]:
    """The loaded bodies."""
    wedge = gallery.get("wedge-14-5")
    first = Loaded("wedge 14", 14, wedge.build, wedge.alpha)
    return [first, *(block(p, traction, F, length) for p, length, traction, F in BLOCKS[: 1 if smoke else None])]


def yardstick():
    """Process seconds of a fixed piece of work in Python and numpy, least of some trials."""
    matrix, trials = np.eye(200) + 0.5, []
    for _ in range(7):
        start = time.process_time()
        vector, total = np.ones(200), 0
        for k in range(2000):
            vector = matrix @ vector
            vector /= np.max(vector)
            total += sum(range(k % 100))
        trials.append(time.process_time() - start)
    return min(trials)


def ready(loaded):
    """The problem, condensed."""
    problem = loaded.build()
    problem.condensed  # noqa: B018 (outside the clock)
    return problem


def measure(smoke):
    """One round: what every problem takes, and in which parts."""
    chosen, answer = problems(smoke), {}
    first = ready(chosen[0])
    # whatever is loaded or made on first use; and whether the table of functions still holds
    unknown = unknown_functions(lambda: enumsol.enumerate_roots(first, chosen[0].alpha))
    for loaded in chosen:
        problem = ready(loaded)
        roots, seconds = timed(enumsol.enumerate_roots, problem, loaded.alpha)
        parts = dict.fromkeys(PARTS, 0.0)
        while sum(parts.values()) < (SMOKE_SAMPLED if smoke else SAMPLED):
            problem = ready(loaded)
            with sampled(parts):
                enumsol.enumerate_roots(problem, loaded.alpha)
        answer[f"{loaded.name}, F = {loaded.alpha:g}"] = {
            "p": problem.p,
            "roots": len(roots),
            "complete": roots.complete,
            "nodes": roots.stats.nodes,
            "seconds": seconds,
            "parts": parts,
            "clocked": sum(parts.values()),
        }
    return {"yardstick": yardstick(), "rounds": 1, "unknown": unknown, "problems": answer}


def least(old, new):
    """Two measurements as one: the least of whole seconds, the sums of the samples."""
    merged = {**new, "yardstick": min(old["yardstick"], new["yardstick"]), "rounds": old["rounds"] + new["rounds"]}
    merged["problems"] = {}
    for name, row in new["problems"].items():
        kept = old["problems"][name]
        parts = {part: kept["parts"][part] + row["parts"][part] for part in PARTS}
        merged["problems"][name] = {
            **row,
            "seconds": min(kept["seconds"], row["seconds"]),
            "parts": parts,
            "clocked": kept["clocked"] + row["clocked"],
        }
    return merged


def save(file, smoke):
    """Measure one round and keep it in the file, together with what it holds."""
    answer = measure(smoke)
    if file.exists():
        answer = least(json.loads(file.read_text(encoding="utf-8")), answer)
    file.write_text(json.dumps(answer, indent=1) + "\n", encoding="utf-8")


def main(run: Run) -> None:
    given = run.options
    if given.save:
        save(given.save, run.smoke)
        return
    smoke = ["--smoke"] if run.smoke else []
    with tempfile.TemporaryDirectory() as directory:
        files = [(python, Path(directory) / f"{k}.json") for k, python in enumerate(interpreters(given))]
        for _ in range(given.rounds):
            for python, file in files:
                new_process(python, str(STUDIES), "search_profile", "--save", str(file), *smoke)
        now, *old = (json.loads(file.read_text(encoding="utf-8")) for _, file in files)
    earlier = before(run.path("search_profile.before.json"), given.label, old[0] if old else None)
    run.table("search_profile", list(merged(now, earlier)), *conclusions(now, earlier))
    run.figure("search_profile", draw(now, earlier))
