"""Can a branch hide between samples? Closed branches of one node, of any length in alpha, against 1,000 samples.

F = 1.5 alpha, f = (4 - alpha, -c): stick and slip- exist where 1.5 alpha (4 - alpha) > c, a closed branch of length
2 sqrt(4 - c / 1.5) about alpha = 2 beside an open branch that is there for every alpha.

Run: python studies/branch_thin.py
"""

from __future__ import annotations

import time

import numpy as np
from _output import RESULTS, report

from enumsol import ContactProblem
from enumsol.branches import branch_graph, link_samples

SAMPLES = 1000


def problem(length):
    c = 1.5 * (4.0 - 0.25 * length**2)
    A = [[2.0, -1.0], [-1.0, 2.0]]
    return ContactProblem(A, [[1, 0]], [[0, 1]], [4.0, -c], friction=(0.0, 1.5), load_slope=[-1.0, 0.0])


def main():
    rows = []
    RESULTS.mkdir(exist_ok=True)
    for length in (1.0, 1e-1, 1e-2, 1e-3, 1e-4, 1e-6):
        start = time.perf_counter()
        graph = branch_graph(problem(length), (0.0, 4.0), "exact")
        seconds = time.perf_counter() - start
        (closed,) = [branch for branch in graph.branches if branch.closed]
        start = time.perf_counter()
        linked = link_samples(graph.problem, np.linspace(0.0, 4.0, SAMPLES).tolist())
        sampled = time.perf_counter() - start
        missed = linked.missed(graph)
        rows.append(
            {
                "length": length,
                "found": closed.interval[1] - closed.interval[0],
                "complete": "yes" if graph.complete else "no",
                "graph s": seconds,
                "samples": SAMPLES,
                "samples s": sampled,
                "samples see it": "no" if closed.number in missed.branches else "yes",
            }
        )
        if length == 1.0:
            graph.plot(file=RESULTS / "branch_thin.png")
    hidden = [row["length"] for row in rows if row["samples see it"] == "no"]
    report(
        "branch_thin", rows, f"branches of length {', '.join(f'{v:g}' for v in hidden)} are missed by {SAMPLES} samples"
    )


if __name__ == "__main__":
    main()
