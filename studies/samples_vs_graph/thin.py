"""Part "thin": can a branch hide between samples? Closed branches of any length in alpha, against 1,000 samples.

F = 1.5 alpha, f = (4 - alpha, -c): stick and slip- exist where 1.5 alpha (4 - alpha) > c, a closed branch of length
2 sqrt(4 - c / 1.5) about alpha = 2 beside an open branch that is there for every alpha.
"""

from __future__ import annotations

import time

import numpy as np

from enumsol import ContactProblem, branch_graph, link_samples
from shared.results import yes

INTERVAL = (0.0, 4.0)
LENGTHS, SMOKE_LENGTHS = (1.0, 1e-1, 1e-2, 1e-3, 1e-4, 1e-6), (1.0, 1e-3)
SAMPLES, SMOKE_SAMPLES = 1000, 50


def thin_problem(length):
    """One node with a closed branch of that length."""
    c = 1.5 * (4.0 - 0.25 * length**2)
    A = [[2.0, -1.0], [-1.0, 2.0]]
    return ContactProblem(A, [[1, 0]], [[0, 1]], [4.0, -c], friction=0.0, friction_slope=1.5, load_slope=[-1.0, 0.0])


def row(graph, seconds, length, samples):
    """What a graph and samples show of one closed branch."""
    (closed,) = [branch for branch in graph.branches if branch.closed]
    start = time.perf_counter()
    linked = link_samples(graph.problem, np.linspace(*INTERVAL, samples).tolist())
    return {
        "length": length,
        "found": closed.interval[1] - closed.interval[0],
        "complete": yes(graph.complete),
        "graph s": seconds,
        "samples": samples,
        "samples s": time.perf_counter() - start,
        "samples see it": yes(closed.number not in linked.missed(graph).branches),
    }


def main(run):
    samples, rows = SMOKE_SAMPLES if run.smoke else SAMPLES, []
    for length in SMOKE_LENGTHS if run.smoke else LENGTHS:
        start = time.perf_counter()
        graph = branch_graph(thin_problem(length), INTERVAL, "exact")
        rows.append(row(graph, time.perf_counter() - start, length, samples))
        if length == 1.0:
            run.figure("branch_thin", graph.plot("lambda_n"))
    hidden = ", ".join(f"{row['length']:g}" for row in rows if row["samples see it"] == "no")
    run.table("branch_thin", rows, f"branches of length {hidden or '-'} are missed by {samples} samples")
