"""Branch graphs of random problems in 3D against searches at single alphas and against Newton's method.

    PYTHONPATH=tests/helpers python tools/random_space_graphs.py [--nodes P] [--first SEED] [--last SEED]
        [--alphas N] [--starts N] [--max-nodes N] [--plane]

Prints for every problem what the tree took, arcs and vertices, why the graph is not complete, whether the proof is
verified, and at how many alphas the graph is wrong: its roots are not those of enumerate_roots, or Newton's method from
random starts finds a root that is not on it. Friction, or load, or both depend on alpha. Of a graph that is not
complete the number of roots must be at least what it says. With --plane the problems are those of a plane, written in
3D with a second tangent that nothing loads.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter

import numpy as np
from oracles3d import newton_set
from problems3d import in_space, random_over_alpha, random_plane_over_alpha, unmatched

import enumsol


def differs(graph: enumsol.BranchGraph, alpha: float) -> bool | None:
    """Whether the roots of a graph at an alpha are not all; None where a search does not tell."""
    found = enumsol.enumerate_roots(graph.problem, alpha)
    if not found.complete:
        return None
    if not graph.complete:
        return graph.at_least(alpha) > len(found)
    roots = graph.roots_at(alpha)
    if not roots.complete or graph.multiplicity_at(alpha) != len(found) or len(roots) != len(found):
        return True
    gaps = [np.abs(a.lambda_t - b.lambda_t).max() for a, b in zip(roots, found, strict=True)]
    return max(gaps, default=0.0) > 1e-9 or [a.index for a in roots] != [b.index for b in found]


def off_the_graph(graph: enumsol.BranchGraph, alpha: float, starts: int, rng: np.random.Generator) -> tuple[int, int]:
    """Roots that Newton's method finds from random starts, and how many of them a complete graph does not have."""
    data = graph.problem.condensed
    found = newton_set(data.S, data.free_displacements(alpha), graph.problem.friction_at(alpha), starts, rng)
    missed = unmatched(list(graph.roots_at(alpha)), found)[0] if graph.complete and found else []
    return len(found), len(missed)


def main() -> None:
    """Parse the options, then one line a problem."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name, default in (("nodes", 2), ("first", 0), ("last", 9), ("alphas", 10), ("starts", 0), ("max-nodes", 1000)):
        parser.add_argument(f"--{name}", type=int, default=default)
    parser.add_argument("--plane", action="store_true")
    options = parser.parse_args()
    for seed in range(options.first, options.last + 1):
        start = time.process_time()
        given = options.nodes, seed
        problem = in_space(random_plane_over_alpha(*given)) if options.plane else random_over_alpha(*given)
        graph = enumsol.branch_graph(problem, (0, 1), max_nodes=options.max_nodes)
        made = time.process_time()
        proof = graph.proof
        report = None if proof is None else enumsol.verify(problem, proof)
        checked = time.process_time()
        kinds = ", ".join(f"{count} {kind}" for kind, count in Counter(v.kind.value for v in graph.vertices).items())
        rng = np.random.default_rng(seed)
        alphas = rng.uniform(0, 1, options.alphas).tolist()
        told = Counter(differs(graph, alpha) for alpha in alphas)
        met = [off_the_graph(graph, alpha, options.starts, rng) for alpha in alphas if options.starts]
        print(
            f"p = {options.nodes}, seed {seed}: {graph.stats.nodes} nodes, {len(graph.arcs)} arcs, vertices: {kinds}; "
            f"complete {graph.complete} {list(graph.reasons[:2])}, verified {None if report is None else report.ok}, "
            f"CPU {made - start:.1f} s and {checked - made:.1f} s; of {len(alphas)} alphas {told[True]} differ, "
            f"{told[None]} not told; Newton's method found {sum(n for n, _ in met)} roots, "
            f"{sum(n for _, n in met)} of them not on the graph",
            flush=True,
        )


if __name__ == "__main__":
    main()
