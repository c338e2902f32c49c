"""Part "wedge": what does a whole loading path cost? Complete graphs of wedges against 1,000 samples, and against p."""

from __future__ import annotations

import time

import numpy as np

from enumsol import branch_graph, enumerate_roots, gallery
from shared.loads import OBLIQUE
from shared.results import yes

INTERVAL = (0.0, 5.0)
SIZES, SMOKE_SIZES = (4, 6, 8, 10, 12, 14, 16), (4, 6)
DRAWN, SMOKE_DRAWN = 14, 6
#: Samples that are timed; the time of 1,000 follows in proportion.
SAMPLES, SMOKE_SAMPLES = 50, 5


def row(problem, graph, seconds, samples):
    """One wedge."""
    alphas = np.linspace(*INTERVAL, samples).tolist()
    start = time.perf_counter()
    counts = [len(enumerate_roots(problem, alpha, "fast")) for alpha in alphas]
    sampled = (time.perf_counter() - start) * 1000 / samples
    return {
        "p": problem.p,
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
        "counts agree": yes(counts == [graph.multiplicity_at(alpha) for alpha in alphas]),
        "balanced": yes(not graph.reasons),
    }


def main(run):
    samples, rows = SMOKE_SAMPLES if run.smoke else SAMPLES, []
    drawn = SMOKE_DRAWN if run.smoke else DRAWN
    for p in SMOKE_SIZES if run.smoke else SIZES:
        problem = gallery.wedge(4, p // 2, OBLIQUE)
        start = time.perf_counter()
        graph = branch_graph(problem, INTERVAL)
        rows.append(row(problem, graph, time.perf_counter() - start, samples))
        if p == drawn:
            run.figure(f"branch_wedge_{p}", graph.plot("lambda_n"))
    note = f"alpha in {INTERVAL}, pull {OBLIQUE}, one core; 1,000 samples scaled from {samples}"
    run.table("branch_wedge", rows, note)
