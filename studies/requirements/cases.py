"""One case in a process of its own: ``python cases.py NAME FILE`` prints what it did and what it took, as JSON.

Nothing is imported here that enumsol does not load itself: what is in memory at the end is what the case needs.
"""

from __future__ import annotations

import contextlib
import io
import json
import re
import sys
import time
from pathlib import Path

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


def main(name, file):
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


if __name__ == "__main__":
    main(*sys.argv[1:])
