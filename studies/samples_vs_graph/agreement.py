"""Part "agreement": does the graph hold the roots that an enumeration finds? At random alphas, on random problems."""

from __future__ import annotations

import numpy as np

from enumsol import branch_graph, enumerate_roots, gallery
from shared.random_paths import random_path
from shared.results import yes

COUNT, SMOKE_COUNT = 200, 5
PROBLEMS, SMOKE_PROBLEMS = 30, 4
WEDGES = ("wedge-14-5", "wedge-14-3")


def problems(smoke):
    """Name, problem and interval."""
    for seed in range(SMOKE_PROBLEMS if smoke else PROBLEMS):
        loading = seed % 2 == 1
        name = f"random {seed} ({'load' if loading else 'friction'})"
        yield name, *random_path(seed, 1 + seed // 2 % 4, loading=loading)
    for name in () if smoke else WEDGES:
        yield name, gallery.get(name).build(), (0.0, 5.0)


def agrees(ours, theirs):
    """Whether two sets of roots are the same: statuses, degrees and forces."""
    return len(ours) == len(theirs) and all(
        a.statuses == b.statuses
        and a.index == b.index
        and np.allclose(a.lambda_n, b.lambda_n, rtol=1e-7, atol=1e-9)
        and np.allclose(a.lambda_t, b.lambda_t, rtol=1e-7, atol=1e-9)
        for a, b in zip(ours, theirs, strict=True)
    )


def row(name, problem, interval, count):
    """One problem."""
    graph = branch_graph(problem, interval)
    alphas = np.random.default_rng(1).uniform(*interval, size=count).tolist()
    return {
        "problem": name,
        "p": problem.p,
        "arcs": len(graph.arcs),
        "branches": len(graph.branches),
        "alphas": count,
        "agree": sum(agrees(graph.roots_at(alpha), enumerate_roots(problem, alpha, "fast")) for alpha in alphas),
        "balanced": yes(not graph.reasons),
    }


def main(run):
    count = SMOKE_COUNT if run.smoke else COUNT
    rows = [row(*problem, count) for problem in problems(run.smoke)]
    total, same = (sum(row[name] for row in rows) for name in ("alphas", "agree"))
    run.table("branch_agreement", rows, f"{same} of {total} root sets agree")
