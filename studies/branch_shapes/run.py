"""Which parameters show closed branches, branches that go back and forth, bifurcations that a push destroys?

A random search over loads, load slopes and friction of the two-node square (every graph in exact arithmetic, proven
complete), chains of two coupled triangles under equal loads, and a mirror-symmetric pair of nodes that is not of the
gallery and shows the pitchfork proper. The best finds are pinned in tests/branches.

Read the column ``parameters``: the most remarkable squares of each kind, then all bifurcations of the symmetric pairs
with what a push of 0.001 leaves of them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from enumsol import ContactProblem, branch_graph, gallery

if TYPE_CHECKING:
    from shared.results import Run

COUNT, SMOKE_COUNT = 1500, 40
INTERVAL, SYMMETRIC_INTERVAL = (0.0, 5.0), (0.0, 10.0)
PUSH = 1e-3
#: Squares of each kind that are listed.
LISTED = 4
COUPLINGS = (0.05, 0.1, 0.2, 0.4, 0.8)


def random_square(rng):
    """Loads and options of a two-node square, with one decimal each."""

    def draw(low, high):
        return float(np.round(rng.uniform(low, high), 1))

    loads = [(draw(0, 4), draw(-6, 6)) for _ in range(2)]
    slopes = tuple((draw(-1.5, 0.5), draw(-1, 1)) for _ in range(2))
    return loads, {"friction": draw(0, 1), "friction_slope": draw(0.5, 2), "load_slope": slopes}


def squares(count):
    """Rows for the most remarkable squares, and how many showed what."""
    rng = np.random.default_rng(5)
    closed, turning, incomplete = [], [], 0
    for _ in range(count):
        loads, options = random_square(rng)
        graph = branch_graph(gallery.two_node_square(*loads, **options), INTERVAL, "exact")
        incomplete += not graph.complete
        for branch in graph.branches:
            length = branch.interval[1] - branch.interval[0]
            if branch.closed:
                closed.append((len(branch.arcs), length, loads, options, branch))
            elif len(branch.folds) >= 2:
                turning.append((len(branch.folds), length, loads, options, branch))
    rows = [
        {
            "shows": kind,
            "parameters": f"two_node_square({loads[0]}, {loads[1]}, {options})",
            "arcs": len(branch.arcs),
            "folds": alphas(branch.folds),
            "length": length,
            "detail": f"{number} {'arcs' if branch.closed else 'folds'}",
        }
        for kind, found in (("closed branch", closed), ("goes back and forth", turning))
        for number, length, loads, options, branch in sorted(found, key=lambda item: item[:2], reverse=True)[:LISTED]
    ]
    note = (
        f"{count} squares, {incomplete} not complete; {len(closed)} closed branches, {len(turning)} branches with two "
        "folds or more"
    )
    return rows, note


def alphas(vertices):
    return " ".join(f"{v.alpha:.5g}" for v in vertices) or "-"


def symmetric(couplings):
    """(name, problem) of pairs of nodes under equal or mirrored loads."""
    for coupling in couplings:
        for f in ((1.5, -4.0), (0.5, -3.0)):
            yield f"chain(2, {coupling}, {f})", gallery.chain(2, coupling, f)
    A = [[21.0, 10.0, 6.0, 5.0], [10.0, 22.0, -5.0, 2.0], [6.0, -5.0, 21.0, -10.0], [5.0, 2.0, -10.0, 22.0]]
    rows = np.eye(4)
    yield "mirror-symmetric pair (own)", ContactProblem(A, rows[[0, 2]], rows[[1, 3]], [1.0, 3.0, 1.0, -3.0])


def bifurcations(couplings):
    """One row per bifurcation of a symmetric pair, with what is left after a push on one node."""
    rows = []
    for name, problem in symmetric(couplings):
        graph = branch_graph(problem, SYMMETRIC_INTERVAL, "exact")
        push = np.array([0.0, 0.0, PUSH, 0.0])
        moved = ContactProblem(problem.A, problem.Bn, problem.Bt, problem.f + push)
        after = branch_graph(moved, SYMMETRIC_INTERVAL, "exact")
        for v in graph.bifurcations:
            left = sum(arc.head == v.number for arc in graph.arcs)
            right = sum(arc.tail == v.number for arc in graph.arcs)
            rows.append(
                {
                    "shows": f"{v.kind}, {left} to {right} arcs",
                    "parameters": name,
                    "arcs": len(graph.arcs),
                    "folds": alphas(graph.folds),
                    "length": 0.0,
                    "detail": f"at {v.alpha:.6g}; {len(after.bifurcations)} left after a push of {PUSH:g}",
                }
            )
    return rows


def main(run: Run) -> None:
    rows, note = squares(SMOKE_COUNT if run.smoke else COUNT)
    run.table("branch_search", rows + bifurcations(COUPLINGS[: 1 if run.smoke else None]), note)
