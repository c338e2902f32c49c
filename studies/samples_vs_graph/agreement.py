"""Does the exact graph equal the enumeration? 200 random alphas each, on 30 random problems and the wedge at p = 14.

Run: python studies/branch_agreement.py [alphas for each problem]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from _output import report

from enumsol import enumerate_roots, gallery
from enumsol.branches import branch_graph

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from branches.problems import generic_problem

COUNT = 200


def agrees(ours, theirs):
    return len(ours) == len(theirs) and all(
        a.statuses == b.statuses
        and a.index == b.index
        and np.allclose(a.lambda_n, b.lambda_n, rtol=1e-7, atol=1e-9)
        and np.allclose(a.lambda_t, b.lambda_t, rtol=1e-7, atol=1e-9)
        for a, b in zip(ours, theirs, strict=True)
    )


def problems():
    for seed in range(30):
        rng = np.random.default_rng(seed)
        kind = ("friction", "load", "both")[seed % 3]
        yield f"random {seed} ({kind})", generic_problem(rng, int(rng.integers(1, 5)), kind), (0.0, 6.0)
    yield "wedge-14-5", gallery.get("wedge-14-5").build(), (0.0, 5.0)
    yield "wedge-14-3", gallery.get("wedge-14-3").build(), (0.0, 5.0)


def main():
    count = int(sys.argv[1]) if len(sys.argv) > 1 else COUNT
    rows = []
    for name, problem, interval in problems():
        graph = branch_graph(problem, interval)
        alphas = np.random.default_rng(1).uniform(*interval, size=count).tolist()
        same = sum(agrees(graph.roots_at(alpha), enumerate_roots(problem, alpha, "fast")) for alpha in alphas)
        rows.append(
            {
                "problem": name,
                "p": problem.p,
                "arcs": len(graph.arcs),
                "branches": len(graph.branches),
                "alphas": count,
                "agree": same,
                "balanced": "no" if graph.reasons else "yes",
            }
        )
    total = sum(row["alphas"] for row in rows)
    report("branch_agreement", rows, f"{sum(row['agree'] for row in rows)} of {total} root sets agree")


if __name__ == "__main__":
    main()
