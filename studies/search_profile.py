"""Where does the time of a search go? Programs, copies of states, choices, certificate and proof, before and now.

Verified enumeration of the gallery's wedge (p = 14) and of blocks with p = 32, 64 and 100, the condensed problem made
outside the clock. Functions of the package are wrapped by clocks that count the time in them without that in wrapped
ones below. What a wrapper itself costs is left out of the clock as far as it can be, and the rest is measured on an
empty function and taken off. Whole seconds are the process time of runs without clocks; the parts are those of runs
with clocks, in proportion. Every round is a new process and makes every problem anew; the least of the rounds counts.

``--save FILE`` measures one round with the installed version and keeps in FILE the least of what it holds and this; it
works with older versions of the package too. ``--against PYTHON`` names the interpreter of an environment with an older
version: its rounds and those of this version alternate, and results/search_profile.before.json is made anew. Without it
the columns "before" are those of the file that ``--before`` names; a fixed piece of work timed in both tells whether
the times compare.

Table: results/search_profile.csv; figure: results/search_profile.png.

Run: python studies/search_profile.py [--rounds 3] [--before FILE | --against PYTHON --label NAME]
"""

from __future__ import annotations

import argparse
import functools
import json
import os
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from statistics import geometric_mean
from unittest.mock import patch

import numpy as np
from _output import RESULTS, report

KEPT = RESULTS / "search_profile.before.json"
ROUNDS = 3
WARM_UP = "wedge 14, F = 2.2"
REST, ENCLOSURE = "rest", "enclosure"
#: Parts of the time and what they mean.
PARTS = {
    "QPs": "relaxations solved",
    "copies": "states copied for children",
    "choice": "node branched on, presolve, order of children",
    "exclusion": "multipliers and inequality of a pruned leaf",
    "selections": "verified solves of complete selections",
    "proof": "records encoded and compressed",
    "ends": "scaling, constant data of the programs, result",
    REST: "Python of the tree, freeing memory",
    ENCLOSURE: "balls for S and g, once a problem",
}


def problems():
    """Name -> (builder, alpha)."""
    from enumsol import gallery

    chosen = {WARM_UP: (lambda: gallery.get("wedge-14-5").build(), 2.2)}
    for p, length, traction, F in (
        (32, 1.0, (1.0, -0.3), 1.0),
        (32, 2.0, (1.0, -0.3), 10.0),
        (64, 1.0, (0.3, -1.0), 3.0),
        (64, 1.0, (1.0, -0.3), 1.0),
        (64, 2.0, (1.0, -0.3), 10.0),
        (100, 1.0, (0.3, -1.0), 3.0),
        (100, 1.0, (1.0, -0.3), 10.0),
        (100, 2.0, (1.0, -0.3), 1.0),
    ):
        name = f"block {p} ({traction[0]:g}, {traction[1]:g}), length {length:g}, F = {F:g}"
        chosen[name] = (partial(gallery.clamped_block, p, p // 2, length, traction=traction), F)
    return chosen


def places():
    """(owner, attribute, part) of what is wrapped; older and newer versions of the package may lack some."""
    from enumsol.proof import proof_file as proof
    from enumsol.relaxation import active_set
    from enumsol.roots import enumerate as driver
    from enumsol.search import solvers as workbench
    from enumsol.search import splitting, tree
    from enumsol.search.certifiers import verified

    yield active_set.ActiveSetRelaxation, "__init__", "QPs"
    yield active_set.ActiveSetRelaxation, "child", "copies"
    yield tree.TreeSearch, "_choose", "choice"
    yield splitting.PlaneSplitting, "children", "choice"
    yield verified.VerifiedCertifier, "excluded", "exclusion"
    yield verified.VerifiedCertifier, "selection", "selections"
    yield workbench.Solvers, "_enclosed", ENCLOSURE
    yield verified, "_margins", ENCLOSURE
    yield verified, "packed", "proof"
    yield verified.VerifiedCertifier, "_leaf", "proof"
    yield verified.VerifiedCertifier, "branching", "proof"
    yield proof.ProofWriter, "close", "proof"
    yield workbench.Solvers, "__init__", "ends"
    yield active_set.ActiveSetEngine, "__init__", "ends"
    yield driver._Enumeration, "_result", "ends"


class Clocks:
    """Seconds in every part, without those of the parts below it."""

    def __init__(self):
        self.seconds, self.calls, self.entered = (dict.fromkeys(PARTS, 0) for _ in range(3))
        self._part, self._since = REST, time.perf_counter()

    def wrapped(self, function, part):
        """The function with its time counted under that part."""
        clock, seconds, calls, entered = time.perf_counter, self.seconds, self.calls, self.entered

        @functools.wraps(function)
        def timed(*arguments, **options):
            now, above = clock(), self._part
            seconds[above] += now - self._since
            calls[above] += 1
            entered[part] += 1
            self._part, self._since = part, clock()
            try:
                return function(*arguments, **options)
            finally:
                seconds[part] += clock() - self._since
                self._part, self._since = above, clock()

        return timed

    def stop(self):
        """Close the last stretch of time."""
        self.seconds[self._part] += time.perf_counter() - self._since

    def corrected(self, inside, outside):
        """Seconds without the wrappers' own, given what a call costs in its part and in the part above it."""
        return {
            part: max(value - self.entered[part] * inside - self.calls[part] * outside, 0.0)
            for part, value in self.seconds.items()
        }

    def install(self, stack, owner, attribute, part):
        """Wrap an attribute of a class or module while the stack is open."""
        kept = vars(owner).get(attribute)
        if isinstance(kept, functools.cached_property):
            stack.enter_context(patch.object(kept, "func", self.wrapped(kept.func, part)))
        elif isinstance(kept, staticmethod):
            stack.enter_context(patch.object(owner, attribute, staticmethod(self.wrapped(kept.__func__, part))))
        elif kept is not None:
            stack.enter_context(patch.object(owner, attribute, self.wrapped(kept, part)))


def wrapper_cost(count=100_000):
    """Seconds that a wrapped call adds to its own part and to the one above it (least of some trials)."""
    trials = []
    for _ in range(5):
        clocks = Clocks()
        empty = clocks.wrapped(_nothing, "QPs")
        started = time.perf_counter()
        for _ in range(count):
            _nothing(None, None)
        plain = time.perf_counter() - started
        clocks._since = time.perf_counter()
        for _ in range(count):
            empty(None, None)
        clocks.stop()
        trials.append((clocks.seconds["QPs"] / count, (clocks.seconds[REST] - plain) / count))
    inside, outside = (min(values) for values in zip(*trials, strict=True))
    return inside, max(outside, 0.0)


def _nothing(first, second):
    del first, second


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


def measure():
    """One round: what every problem takes, without and with clocks."""
    import enumsol

    costs, answer = wrapper_cost(), {}
    # whatever is loaded or made on first use
    build, alpha = problems()[WARM_UP]
    enumsol.enumerate_roots(build(), alpha)
    for name, (build, alpha) in problems().items():
        problem = build()
        problem.condensed  # noqa: B018 (outside the clock)
        start = time.process_time()
        roots = enumsol.enumerate_roots(problem, alpha)
        seconds = time.process_time() - start
        problem = build()
        problem.condensed  # noqa: B018
        clocks = Clocks()
        with ExitStack() as stack:
            for place in places():
                clocks.install(stack, *place)
            clocks._since = time.perf_counter()
            enumsol.enumerate_roots(problem, alpha)
            clocks.stop()
        parts = clocks.corrected(*costs)
        answer[name] = {
            "p": problem.p,
            "roots": len(roots),
            "complete": roots.complete,
            "nodes": roots.stats.nodes,
            "seconds": seconds,
            "parts": parts,
            "clocked": sum(parts.values()),
            "wrappers": 1.0 - sum(parts.values()) / sum(clocks.seconds.values()),
        }
    return {"yardstick": yardstick(), "rounds": 1, "problems": answer}


def least(old, new):
    """The least of two measurements: whole seconds, and the parts of the run with the least sum."""
    merged = {"yardstick": min(old["yardstick"], new["yardstick"]), "rounds": old["rounds"] + new["rounds"]}
    merged["problems"] = {}
    for name, row in new["problems"].items():
        kept = old["problems"].get(name, row)
        better = min(kept, row, key=lambda one: one["clocked"])
        merged["problems"][name] = {**better, "seconds": min(kept["seconds"], row["seconds"])}
    return merged


def save(file):
    """Measure one round and keep in the file the least of what it holds and this."""
    answer = measure()
    if file.exists():
        answer = {**(old := json.loads(file.read_text(encoding="utf-8"))), **least(old, answer)}
    file.write_text(json.dumps(answer, indent=1) + "\n", encoding="utf-8")


def rounds_in_turn(count, files):
    """Rounds of several interpreters in turn, each in a new process with one thread."""
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    for _ in range(count):
        for python, file in files:
            command = [python, str(Path(__file__).resolve()), "--save", str(file)]
            subprocess.run(command, check=True, env=environment)


def merged(now, before):
    """One row a problem: nodes, seconds and the shares of the parts, before and now."""
    for name, new in now["problems"].items():
        old = before["problems"].get(name) if before else None
        row = {"problem": name, "p": new["p"], "roots": new["roots"]}
        for column in ("nodes", "seconds"):
            row |= {f"{column} before": old[column] if old else "-", f"{column} now": new[column]}
        row["time ratio"] = new["seconds"] / old["seconds"] if old else "-"
        row["without enclosure"] = searching(new) / searching(old) if old else "-"
        for when, source in (("before", old), ("now", new)):
            row[f"us/node {when}"] = 1e6 * source["seconds"] / source["nodes"] if source else "-"
        for part in PARTS:
            row |= {f"{part} % before": 100 * share(old, part) if old else "-", f"{part} % now": 100 * share(new, part)}
        yield row


def share(source, part):
    return source["parts"].get(part, 0.0) / source["clocked"]


def searching(source):
    """Seconds without the enclosure, which is made once a problem and serves every alpha."""
    return source["seconds"] - seconds_of(source, ENCLOSURE)


def seconds_of(source, part):
    return share(source, part) * source["seconds"]


COLOURS = ("#1f5fa8", "#7fb2e5", "#e8a33d", "#c0392b", "#7b241c", "#4f7f3c", "#a9c79a", "#9a9a9a", "#e6dccb")


def draw(now, before):
    """Stacked bars for every problem: the parts of the time, relative to the whole before (or now)."""
    from matplotlib.figure import Figure

    names = list(now["problems"])
    figure = Figure(figsize=(11, 1.2 + 0.62 * len(names)), layout="constrained")
    axis = figure.subplots()
    longest = 0.0
    for k, name in enumerate(names):
        bars = [("now", now["problems"][name], 0.19)]
        if before and name in before["problems"]:
            bars.insert(0, ("before", before["problems"][name], -0.19))
        for when, source, shift in bars:
            left, whole = 0.0, bars[0][1]["seconds"]
            for part, colour in zip(PARTS, COLOURS, strict=True):
                width = seconds_of(source, part) / whole
                label = f"{part}: {PARTS[part]}" if (k, when) == (0, "now") else None
                axis.barh(k + shift, width, 0.34, left=left, color=colour, label=label, linewidth=0)
                left += width
            longest = max(longest, left)
            text = f" {when}: {source['seconds']:.2g} s, {source['nodes']} nodes"
            axis.text(left, k + shift, text, va="center", fontsize=8, color="#404040")
    axis.set_yticks(range(len(names)), names)
    axis.invert_yaxis()
    axis.set_xlim(0.0, 1.24 * longest)
    axis.set_xlabel("process time of a verified enumeration, relative to before")
    axis.tick_params(left=False)
    axis.spines[["top", "right", "left"]].set_visible(False)
    figure.legend(loc="outside lower center", ncols=3, frameon=False, fontsize=8)
    figure.savefig(RESULTS / "search_profile.png", dpi=150)


def conclusions(now, before):
    """Notes below the table, all from the data."""
    both = [("now", now)]
    if before:
        both.insert(0, (f"before ({before['label']})", before))
    for when, source in both:
        for p in sorted({row["p"] for row in source["problems"].values()}):
            yield f"{when}, p = {p}: {by_part([row for row in source['problems'].values() if row['p'] == p])}"
    if before:
        names = [name for name in now["problems"] if name in before["problems"]]
        yield from changes(names, [(before["problems"][name], now["problems"][name]) for name in names])
        speed = now["yardstick"] / before["yardstick"]
        verdict = "the times compare" if 0.85 < speed < 1.18 else "the times do not compare"
        yield f"a fixed piece of work took {speed:.2f} times what it took beside the runs before: {verdict}"
    rows = [row for _, source in both for row in source["problems"].values()]
    lost = max(row["wrappers"] for row in rows)
    apart = [row["clocked"] / row["seconds"] for row in rows]
    yield (
        f"taken off for the wrappers: at most {100 * lost:.1f} % of a run; what remains is {min(apart):.2f} to "
        f"{max(apart):.2f} of the time without clocks; least of {now['rounds']} rounds"
    )


def by_part(rows):
    """Share of the enclosure, and the largest parts of the rest."""
    seconds = {part: sum(seconds_of(row, part) for row in rows) for part in PARTS}
    total, once = sum(seconds.values()), seconds.pop(ENCLOSURE)
    first = sorted(seconds, key=seconds.get, reverse=True)[:5]
    return f"{ENCLOSURE} {100 * once / total:.0f} % of the time; of the rest " + ", ".join(
        f"{part} {100 * seconds[part] / (total - once):.0f} %" for part in first
    )


def changes(names, pairs):
    """What is faster and what is slower, in whole, without the enclosure and by part."""
    for label, value in (
        ("time", lambda row: row["seconds"]),
        (f"time without the {ENCLOSURE}", searching),
        ("nodes", lambda row: row["nodes"]),
    ):
        ratio = {name: value(new) / value(old) for name, (old, new) in zip(names, pairs, strict=True)}
        low, high = min(ratio, key=ratio.get), max(ratio, key=ratio.get)
        yield (
            f"{label}, now over before: geometric mean {geometric_mean(ratio.values()):.2f}, from {ratio[low]:.2f} "
            f"({low}) to {ratio[high]:.2f} ({high}); more on {sum(r > 1 for r in ratio.values())} of {len(ratio)}"
        )
    rates = {
        part: geometric_mean(
            (seconds_of(new, part) / new["nodes"]) / (seconds_of(old, part) / old["nodes"]) for old, new in pairs
        )
        for part in PARTS
        if part not in ("selections", "ends", ENCLOSURE)
    }
    yield "time a node, now over before, geometric means: " + ", ".join(f"{k} {v:.2f}" for k, v in rates.items())


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    parser.add_argument("--save", type=Path, metavar="FILE", help="measure one round, keep the least in FILE")
    parser.add_argument("--before", type=Path, default=KEPT, metavar="FILE", help="what an older version took")
    parser.add_argument("--against", metavar="PYTHON", help="interpreter of an environment with an older version")
    parser.add_argument("--label", default="an older version", help="name of that version")
    given = parser.parse_args()
    if given.save:
        save(given.save)
        return
    with tempfile.TemporaryDirectory() as directory:
        files = [(sys.executable, Path(directory) / "now.json")]
        if given.against:
            files.insert(0, (given.against, Path(directory) / "before.json"))
        rounds_in_turn(given.rounds, files)
        found = [json.loads(file.read_text(encoding="utf-8")) for _, file in files]
    if given.against:
        text = json.dumps({"label": given.label, **found[0]}, indent=1)
        given.before.write_text(text + "\n", encoding="utf-8")
    before = json.loads(given.before.read_text(encoding="utf-8")) if given.before.exists() else None
    draw(found[-1], before)
    report("search_profile", list(merged(found[-1], before)), *conclusions(found[-1], before))


if __name__ == "__main__":
    main()
