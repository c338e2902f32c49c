"""What does a scene make the program do? Modules, time, memory, programs solved and arithmetic, before and now.

Every case runs in new processes, some rounds of all cases in turn, so that a change of the machine's load meets all of
them. The figures are medians: process time of ``import enumsol`` and of the whole run from the interpreter's start, and
the peak resident size. A large body is read from a file, as matrices of another code would be.

``--against PYTHON`` names the interpreter of an environment with an older version: every case then runs there too, in
turn with this version, and what was measured is kept in results/requirements.before.json. Without it the columns
"before" are those kept; their times are those of the machine of that day, and the time of ``import numpy`` then and now
tells whether they compare. The peak is read from /proc, so this study needs Linux.

Table: results/requirements.csv; figure: results/requirements.png.

Run: python studies/requirements.py [--rounds 5] [--against PYTHON --label NAME]
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import os
import re
import statistics
import subprocess
import sys
import tempfile
import time
from itertools import product
from pathlib import Path

from _output import RESULTS, report

#: Libraries worth a column; what else is loaded is Python's own, or comes with one of them.
LIBRARIES = (
    "numpy",
    "scipy.sparse",
    "scipy.linalg",
    "scipy.optimize",
    "clarabel",
    "cvxpy",
    "flint",
    "networkx",
    "pandas",
    "skfem",
    "matplotlib",
    "typer",
    "rich",
)
#: Cells of a body with 50,240 degrees of freedom, and its contact nodes.
BODY, CONTACT = (160, 156), 40
KEPT = RESULTS / "requirements.before.json"
ROUNDS = 5
MEASURED = ("import s", "import MB", "run s", "wall s", "peak MB")


def enumerated(name):
    def run(_):
        import enumsol

        entry = enumsol.gallery.get(name)
        problem = entry.build()
        return counts(enumsol.enumerate_roots(problem, entry.alpha), problem)

    return run


def block(p):
    def run(_):
        import enumsol

        problem = enumsol.gallery.clamped_block(p, p // 2)
        return counts(enumsol.enumerate_roots(problem, 3.0), problem)

    return run


def body(arithmetic):
    def run(file):
        import enumsol

        problem = enumsol.read_problem(file)
        return counts(enumsol.enumerate_roots(problem, 1.0, arithmetic), problem)

    return run


def graph(name, interval):
    def run(_):
        import enumsol

        problem = enumsol.gallery.get(name).build()
        found = enumsol.branch_graph(problem, interval)
        return {"n": problem.n, "p": problem.p, "complete": found.complete}

    return run


def table(_):
    import enumsol

    problem = enumsol.gallery.get("two-node-6.4").build()
    found = enumsol.multiplicity_table(problem, [0.1 + k / 3 for k in range(29)])
    return {"n": problem.n, "p": problem.p, "complete": bool(found["complete"].all())}


def followed(_):
    import enumsol

    problem = enumsol.gallery.get("one-node-6.1").build()
    path = enumsol.follow(problem, enumsol.newton(problem, 1.0), interval=(0.0, 20.0))
    return {"n": problem.n, "p": problem.p, "complete": path.status == "interval left"}


def checked(_):
    import enumsol

    problem = enumsol.gallery.get("wedge-14-5").build()
    roots = enumsol.enumerate_roots(problem, 2.2)
    return {**counts(roots, problem), "complete": enumsol.verify(problem, roots.proof).complete}


def command(*arguments):
    def run(_):
        from enumsol.cli import main

        with contextlib.redirect_stdout(io.StringIO()):
            status = main(list(arguments))
        return {"complete": status == 0}

    return run


def import_only(_):
    return {}


CASES = {
    "import enumsol": import_only,
    "one node": enumerated("one-node-6.1"),
    "two nodes": enumerated("two-node-6.4"),
    "chain 4": enumerated("chain-4"),
    "wedge 14": enumerated("wedge-14-5"),
    "wedge 14, proof checked": checked,
    "block 14": block(14),
    "block 32": block(32),
    "block 64": block(64),
    "body, fast": body("fast"),
    "body, verified": body("verified"),
    "graph, one node": graph("one-node-6.1", (0.0, 20.0)),
    "graph, two nodes": graph("two-node-6.4", (0.0, 10.0)),
    "table of 29 alphas, two nodes": table,
    "follow, one node": followed,
    "one node on a corner (exact)": enumerated("one-node-6.3"),
    "enumsol --help": command("--help"),
    "enumsol gallery list": command("gallery", "list"),
    "enumsol roots, one node": command("roots", "gallery:one-node-6.1", "--alpha", "5"),
}


def counts(roots, problem):
    stats = roots.stats
    return {
        "n": problem.n,
        "p": problem.p,
        "complete": roots.complete,
        "all selections": f"{4.0**problem.p:.2g}",
        "nodes": stats.nodes,
        "QPs": stats.qps + stats.fallback_qps,
        "selections solved": stats.selections,
        "by balls": getattr(stats.escalations, "balls", 0),
        "by rationals": getattr(stats.escalations, "rationals", 0),
    }


def memory(field):
    """VmRSS or VmHWM of this process in MB; the peak of getrusage would begin with that of the parent process."""
    return int(re.search(rf"{field}:\s+(\d+) kB", Path("/proc/self/status").read_text())[1]) / 1024


def child(name, file):
    """What one case did, as JSON on stdout; nothing that enumsol does not load itself is loaded before it ends."""
    there, started = set(sys.modules), time.process_time()
    import enumsol  # noqa: F401  # the import is what is measured

    imported = {"import s": time.process_time() - started, "import MB": memory("VmRSS")}
    done = CASES[name](file)
    loaded = {
        "run s": time.process_time(),
        "peak MB": memory("VmHWM"),
        "modules": len(set(sys.modules) - there),
        "libraries": [library for library in LIBRARIES if library in sys.modules],
    }
    print(json.dumps({**done, **imported, **loaded}))


def new_process(python, *arguments):
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    started = time.perf_counter()
    done = subprocess.run([python, *arguments], check=True, stdout=subprocess.PIPE, text=True, env=environment)
    return time.perf_counter() - started, done.stdout


def write_body(file):
    from enumsol import gallery, write_problem

    write_problem(gallery.clamped_block(*BODY, contact=CONTACT), file)


def measure(rounds, pythons):
    """Medians of all cases, and of the process time of ``import numpy``, for every interpreter."""
    me, yardstick = str(Path(__file__).resolve()), "import time, numpy; print(time.process_time())"
    seen = {python: {name: [] for name in CASES} for python in pythons}
    numpy_seconds = {python: [] for python in pythons}
    with tempfile.TemporaryDirectory() as directory:
        file = str(Path(directory) / "body.npz")
        new_process(sys.executable, me, "--write-body", file)
        for _, python in product(range(rounds), pythons):
            numpy_seconds[python].append(float(new_process(python, "-c", yardstick)[1]))
        for _, name, python in product(range(rounds), CASES, pythons):
            wall, answer = new_process(python, me, "--case", name, file)
            seen[python][name].append({**json.loads(answer), "wall s": wall})
    return [
        {
            "numpy s": statistics.median(numpy_seconds[python]),
            "rounds": rounds,
            "cases": {name: summary(runs) for name, runs in seen[python].items()},
        }
        for python in pythons
    ]


def summary(runs):
    """Medians of the runs of one case; spread is (longest - shortest) / median of the whole run."""
    seconds = [run["run s"] for run in runs]
    medians = {key: statistics.median(run[key] for run in runs) for key in MEASURED}
    return {**runs[-1], **medians, "spread": (max(seconds) - min(seconds)) / medians["run s"]}


def merged(now, before):
    """One row a case; before is a dash where there was nothing measured."""
    for name, case in now["cases"].items():
        old = before["cases"].get(name, {}) if before else {}
        dropped = [library for library in old.get("libraries", ()) if library not in case["libraries"]]
        yield {
            "case": name,
            **{key: case.get(key, "-") for key in ("n", "p", "all selections")},
            **both(("nodes", "QPs", "selections solved"), old, case),
            **{key: case.get(key, "-") for key in ("by balls", "by rationals", "complete")},
            **both(("modules", "import s", "run s", "wall s", "peak MB"), old, case),
            "libraries": " ".join(case["libraries"]),
            "no longer loaded": " ".join(dropped) or "-",
        }


def both(keys, old, new):
    """Columns before and now."""
    pairs = ((" before", old), ("", new))
    return {f"{key}{when}": source.get(key, "-") for key in keys for when, source in pairs}


BLUE, GREY = "#1f5fa8", "#9a9a9a"
#: What is drawn, the label of its axis, and the ticks.
PANELS = (
    ("run s", "process time of the whole run [s]", (0.03, 0.1, 0.3, 1, 3)),
    ("peak MB", "peak memory [MB]", (10, 30, 100, 300, 1000)),
)


def draw(rows):
    """Process time and peak memory of every case, before (grey) and now (blue)."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.5, 6.2), layout="constrained")
    axes = figure.subplots(1, 2, sharey=True)
    places = range(len(rows))[::-1]
    for axis, (key, label, ticks) in zip(axes, PANELS, strict=True):
        for place, row in zip(places, rows, strict=True):
            old, new = row[f"{key} before"], row[key]
            if old != "-":
                axis.plot([old, new], [place, place], color="#d0d0d0", linewidth=2, zorder=1)
                axis.plot(old, place, "o", color=GREY, markersize=8, label="before" if place == 0 else None)
            axis.plot(new, place, "o", color=BLUE, markersize=4.5, label="now" if place == 0 else None)
        axis.set_xscale("log")
        axis.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
        axis.set_xticks([], minor=True)
        axis.set_xlabel(label)
        axis.grid(visible=True, color="#ececec", linewidth=0.6)
        axis.tick_params(length=0)
        axis.spines[["top", "right", "left"]].set_visible(False)
    axes[0].set_yticks(list(places), [row["case"] for row in rows])
    axes[1].legend(frameon=False, loc="lower right")
    figure.savefig(RESULTS / "requirements.png", dpi=150)


def conclusions(rows, now, before):
    case = {row["case"]: row for row in rows}
    start, large, small = case["import enumsol"], case["body, verified"], case["one node"]
    spread = statistics.median(source["spread"] for source in now["cases"].values())
    yield (
        f"{now['rounds']} rounds; the process times of one case differ by {100 * spread:.0f} % (median over the "
        "cases): smaller differences between before and now mean nothing"
    )
    yield (
        f"import enumsol: {start['import s']:.2g} s, {start['peak MB']:.0f} MB, {start['modules']} modules, "
        f"libraries: {start['libraries'] or 'none'}"
    )
    if before:
        change = small["run s"] / small["run s before"] - 1
        yield (
            f"  before ({before['label']}): {start['import s before']:.2g} s, {start['peak MB before']:.0f} MB, "
            f"{start['modules before']} modules. numpy and scipy are loaded when a problem is made: the whole run of "
            f"one node takes {small['run s']:.2f} s, before {small['run s before']:.2f} s ({100 * change:+.0f} %)"
        )
    dense = 8.0 * large["n"] ** 2 / 2**20
    for name in ("body, fast", "body, verified"):
        yield (
            f"{name}, n = {large['n']}, p = {large['p']}: peak {case[name]['peak MB']:.0f} MB"
            + (f", before {case[name]['peak MB before']:.0f} MB" if before else "")
            + f"; one node has {small['peak MB']:.0f} MB, a dense A alone {dense:.0f} MB"
        )
    rational = [row["case"] for row in rows if row["by rationals"] not in ("-", 0)]
    flint = [row["case"] for row in rows if "flint" in row["libraries"].split()]
    yield f"cases with selections decided in rationals: {', '.join(rational) or 'none'}"
    yield f"cases that load rational arithmetic: {', '.join(flint) or 'none'}"
    unused = [name for name in LIBRARIES if not any(name in row["libraries"].split() for row in rows)]
    yield f"loaded by no case: {', '.join(unused)}"
    if before:
        pair = (now["numpy s"], before["numpy s"])
        verdict = "times compare" if max(pair) < 1.25 * min(pair) else "times before and now do not compare"
        yield f"import numpy: {pair[0]:.3f} s, in the process that measured before {pair[1]:.3f} s: {verdict}"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    parser.add_argument("--against", metavar="PYTHON", help="interpreter of an environment with an older version")
    parser.add_argument("--label", default="an older version", help="name of that version")
    # what the processes of the study are told
    parser.add_argument("--case", nargs=2, help=argparse.SUPPRESS)
    parser.add_argument("--write-body", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.case:
        child(*given.case)
    elif given.write_body:
        write_body(given.write_body)
    else:
        now, *old = measure(given.rounds, [sys.executable, *([given.against] if given.against else [])])
        if old:
            KEPT.write_text(json.dumps({"label": given.label, **old[0]}, indent=1) + "\n", encoding="utf-8")
        before = json.loads(KEPT.read_text(encoding="utf-8")) if KEPT.exists() else None
        rows = list(merged(now, before))
        draw(rows)
        report("requirements", rows, *conclusions(rows, now, before))


if __name__ == "__main__":
    main()
