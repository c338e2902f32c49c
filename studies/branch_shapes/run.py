"""Closed branches, branches that go back and forth, bifurcations that a push destroys: which parameters show them.

A random search over loads, load slopes and friction of the two-node square (every graph in exact arithmetic, proven
complete), chains of two coupled triangles under equal loads, and a mirror-symmetric pair of nodes that is not of the
gallery and shows the pitchfork proper. The best finds are pinned in tests/branches.

Run: python studies/branch_search.py [number of squares]
"""

from __future__ import annotations

import sys

import numpy as np
from _output import report

from enumsol import ContactProblem, gallery
from enumsol.branches import branch_graph

COUNT = 1500
PUSH = 1e-3


def random_square(rng):
    def draw(low, high):
        return float(np.round(rng.uniform(low, high), 1))

    loads = [(draw(0, 4), draw(-6, 6)) for _ in range(2)]
    slopes = tuple((draw(-1.5, 0.5), draw(-1, 1)) for _ in range(2))
    return loads, {"friction": (draw(0, 1), draw(0.5, 2)), "load_slope": slopes}


def squares(count):
    """Rows for the most remarkable squares, and how many showed what."""
    rng = np.random.default_rng(5)
    closed, turning, incomplete = [], [], 0
    for _ in range(count):
        loads, options = random_square(rng)
        graph = branch_graph(gallery.two_node_square(*loads, **options), (0.0, 5.0), "exact")
        incomplete += not graph.complete
        for branch in graph.branches:
            item = (len(branch.arcs), branch.interval[1] - branch.interval[0], loads, options, branch)
            if branch.closed:
                closed.append(item)
            elif len(branch.folds) >= 2:
                turning.append((len(branch.folds), *item[1:]))
    rows = []
    for kind, found in (("closed branch", closed), ("goes back and forth", turning)):
        for number, length, loads, options, branch in sorted(found, key=lambda item: item[:2], reverse=True)[:4]:
            rows.append(
                {
                    "shows": kind,
                    "parameters": f"two_node_square({loads[0]}, {loads[1]}, {options})",
                    "arcs": len(branch.arcs),
                    "folds": " ".join(f"{v.alpha:.5g}" for v in branch.folds),
                    "length": length,
                    "detail": f"{number} {'arcs' if branch.closed else 'folds'}",
                }
            )
    note = f"{count} squares, {incomplete} not complete: {len(closed)} closed branches, {len(turning)} with folds"
    return rows, note


def symmetric():
    """(name, problem) of pairs of nodes under equal or mirrored loads."""
    for coupling in (0.05, 0.1, 0.2, 0.4, 0.8):
        for f in ((1.5, -4.0), (0.5, -3.0)):
            yield f"chain(2, {coupling}, {f})", gallery.chain(2, coupling, f)
    A = [[21.0, 10.0, 6.0, 5.0], [10.0, 22.0, -5.0, 2.0], [6.0, -5.0, 21.0, -10.0], [5.0, 2.0, -10.0, 22.0]]
    rows = np.eye(4)
    yield "mirror-symmetric pair (own)", ContactProblem(A, rows[[0, 2]], rows[[1, 3]], [1.0, 3.0, 1.0, -3.0])


def bifurcations():
    rows = []
    for name, problem in symmetric():
        graph = branch_graph(problem, (0.0, 10.0), "exact")
        push = np.array([0.0, 0.0, PUSH, 0.0])
        moved = ContactProblem(problem.A, problem.Bn, problem.Bt, problem.f + push)
        after = branch_graph(moved, (0.0, 10.0), "exact")
        for v in graph.bifurcations:
            left = sum(arc.head == v.number for arc in graph.arcs)
            right = sum(arc.tail == v.number for arc in graph.arcs)
            rows.append(
                {
                    "shows": f"{v.kind}, {left} to {right} arcs",
                    "parameters": name,
                    "arcs": len(graph.arcs),
                    "folds": " ".join(f"{w.alpha:.5g}" for w in graph.folds) or "-",
                    "length": 0.0,
                    "detail": f"at {v.alpha:.6g}; {len(after.bifurcations)} left after a push of {PUSH:g}",
                }
            )
    return rows


def main():
    count = int(sys.argv[1]) if len(sys.argv) > 1 else COUNT
    rows, note = squares(count)
    report("branch_search", rows + bifurcations(), note)


if __name__ == "__main__":
    main()
