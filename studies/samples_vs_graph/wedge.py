"""What does a whole loading path cost? Complete graphs of wedges against 1,000 sampled enumerations, and against p.

Run: python studies/branch_wedge.py [samples to time; the time of 1,000 follows in proportion]
"""

from __future__ import annotations

import sys
import time

import numpy as np
from _output import RESULTS, report

from enumsol import enumerate_roots, gallery
from enumsol.branches import branch_graph

INTERVAL = (0.0, 5.0)
PULL = (4e-4, 1e-3)


def main():
    samples = int(sys.argv[1]) if len(sys.argv) > 1 else 50
    rows = []
    RESULTS.mkdir(exist_ok=True)
    for p in (4, 6, 8, 10, 12, 14, 16):
        problem = gallery.wedge(4, p // 2, PULL)
        start = time.perf_counter()
        graph = branch_graph(problem, INTERVAL)
        seconds = time.perf_counter() - start
        alphas = np.linspace(*INTERVAL, samples).tolist()
        start = time.perf_counter()
        counts = [len(enumerate_roots(problem, alpha, "fast")) for alpha in alphas]
        sampled = (time.perf_counter() - start) * 1000 / samples
        agree = counts == [graph.multiplicity_at(alpha) for alpha in alphas]
        rows.append(
            {
                "p": p,
                "graph s": seconds,
                "search s": graph.stats.search_seconds,
                "tree nodes": graph.stats.nodes,
                "pieces": graph.stats.pieces,
                "selections": graph.stats.selections,
                "arcs": len(graph.arcs),
                "branches": len(graph.branches),
                "folds": len(graph.folds),
                "most roots": max(graph.steps[2]),
                "1000 samples s": sampled,
                "counts agree": "yes" if agree else "no",
                "balanced": "no" if graph.reasons else "yes",
            }
        )
        if p == 14:
            graph.plot(file=RESULTS / "branch_wedge_14.png")
    report("branch_wedge", rows, f"alpha in {INTERVAL}, pull {PULL}, one core; 1,000 samples scaled from {samples}")


if __name__ == "__main__":
    main()
