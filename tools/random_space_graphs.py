"""Branch graphs of random problems in 3D against searches at single alphas and against Newton's method.

    PYTHONPATH=tests/helpers python tools/random_space_graphs.py [--nodes P] [--first SEED] [--last SEED]
        [--alphas N] [--near N] [--starts N] [--max-nodes N] [--plane]

Prints for every problem what the tree took, arcs and vertices, why the graph is not complete, whether the proof is
verified, and at how many alphas the graph is wrong: its roots are not those of enumerate_roots, or Newton's method from
random starts finds a root that is not on it. Friction, or load, or both depend on alpha. Of a graph that is not
complete the number of roots must be at least what it says, and its roots must be among those of enumerate_roots. With
--near, as many alphas again lie beside vertices inside the interval, 0.1 to 1e-7 away: where branches meet, random
alphas hardly ever come. With --plane the problems are those of a plane, written in 3D with a second tangent that
nothing loads. The last line sums up.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter

import numpy as np
from oracles3d import newton_set
from problems3d import forces, in_space, random_over_alpha, random_plane_over_alpha, unmatched

import enumsol


def differs(graph: enumsol.BranchGraph, found: enumsol.RootSet, roots: enumsol.RootSet) -> bool | None:
    """Whether the roots of a graph at an alpha are not those that a search found; None where one of them is not sure.

    A graph that is not complete has some of the roots.
    """
    alpha = found.alpha
    least = graph.at_least(alpha)
    if not found.complete:
        return None
    if not graph.complete or not roots.complete:
        told = least > len(found) or bool(len(roots) and unmatched(list(found), [forces(r) for r in roots], 1e-9)[0])
        return told or (None if graph.complete else False)
    if graph.multiplicity_at(alpha) != len(found) or len(roots) != len(found):
        return True
    gaps = [np.abs(forces(a) - forces(b)).max() for a, b in zip(roots, found, strict=True)]
    size = max((np.abs(forces(b)).max() for b in found), default=0.0)
    return max(gaps, default=0.0) > 1e-9 * (1 + size) or [a.index for a in roots] != [b.index for b in found]


def by_newton(problem: enumsol.ContactProblem3D, alpha: float, starts: int, rng: np.random.Generator) -> list:
    """Forces that Newton's method finds from random starts."""
    data = problem.condensed
    return newton_set(data.S, data.free_displacements(alpha), problem.friction_at(alpha), starts, rng)


def beside_vertices(graph: enumsol.BranchGraph, count: int, rng: np.random.Generator) -> list[float]:
    """Alphas of the interval on both sides of vertices inside it; none where there are none."""
    inner = [0.5 * (v.enclosure[0] + v.enclosure[1]) for v in graph.vertices if not v.border]
    if not inner:
        return []
    found = rng.choice(inner, count) + rng.choice([-1, 1], count) * 10.0 ** rng.uniform(-7, -1, count)
    low, high = graph.interval
    return [float(alpha) for alpha in found if low < alpha < high]


def main() -> None:
    """Parse the options, then one line a problem."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    numbers = ("nodes", 2), ("first", 0), ("last", 9), ("alphas", 10), ("near", 0), ("starts", 0), ("max-nodes", 1000)
    for name, default in numbers:
        parser.add_argument(f"--{name}", type=int, default=default)
    parser.add_argument("--plane", action="store_true")
    options = parser.parse_args()
    total: Counter = Counter()
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
        alphas += beside_vertices(graph, options.near, rng)
        told, here, most = Counter(), Counter(), 0
        for alpha in alphas:
            found, roots = enumsol.enumerate_roots(problem, alpha), graph.roots_at(alpha)
            different = differs(graph, found, roots)
            told[different] += 1
            most = max(most, len(found))
            if different:
                print(f"DIFFERENT at alpha = {alpha!r}: {roots!r}\n{found!r}", flush=True)
            met = by_newton(problem, alpha, options.starts, rng) if options.starts else []
            here["by search"] += len(found)
            here["by Newton"] += len(met)
            if met and graph.complete and roots.complete:
                missed = unmatched(list(roots), met)[0]
                here["compared"] += len(met)
                here["off"] += len(missed)
                if missed:
                    print(f"OFF THE GRAPH at alpha = {alpha!r}: {[met[k] for k in missed]}", flush=True)
            if met and found.complete and unmatched(list(found), met)[0]:
                here["off search"] += 1
                print(f"OFF THE SEARCH at alpha = {alpha!r}", flush=True)
        verified = None if report is None else report.ok
        print(
            f"p = {options.nodes}, seed {seed}: {graph.stats.nodes} nodes, {len(graph.arcs)} arcs, vertices: {kinds}; "
            f"complete {graph.complete} {list(graph.reasons[:2])}, verified {verified}, "
            f"CPU {made - start:.1f} s, {checked - made:.1f} s and {time.process_time() - checked:.1f} s; up to {most} "
            f"roots; of {len(alphas)} alphas {told[True]} differ, {told[None]} not told; Newton's method found "
            f"{here['by Newton']} of {here['by search']} roots, {here['off']} of {here['compared']} not on the graph",
            flush=True,
        )
        total += here
        total.update(
            problems=1,
            complete=graph.complete,
            verified=bool(verified),
            refused=proof is not None and not verified,
            arcs=len(graph.arcs),
            vertices=sum(not v.border for v in graph.vertices),
            folds=len(graph.folds),
            alphas=len(alphas),
            nodes=graph.stats.nodes,
            differ=told[True],
            untold=told[None],
        )
        total[f"up to {most} roots"] += 1
    print(f"{dict(total)}, CPU {time.process_time():.0f} s", flush=True)


if __name__ == "__main__":
    main()
