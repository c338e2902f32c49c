"""What do two contact nodes show? Exact branch graphs of the gallery's square, loads of the paper's Examples 6.4-6.7.

The geometry is our own (the paper's coordinates were never published), so that the paper's printed facts describe what
such problems can show; the last column says which of them this geometry shows. Figures: results/branch_two_node_*.png.

Run: python studies/branch_two_node.py
"""

from __future__ import annotations

from itertools import pairwise

from _output import RESULTS, report

from enumsol import gallery
from enumsol.branches import branch_graph

CASES = (
    ("two-node-6.4", (0.0, 10.0)),
    ("two-node-6.5", (0.0, 10.0)),
    ("two-node-6.6", (0.0, 10.0)),
    ("two-node-6.7-minus", (-3.0, 3.0)),
    ("two-node-6.7-plus", (-3.0, 3.0)),
)


def shown(name, graph):
    """The printed facts of the example, each with yes or no for this geometry."""
    largest = max(graph.steps[2])
    if "6.4" in name:
        return f"three branches: {yes(len(graph.branches) == 3)}; at least five roots: {yes(largest >= 5)}"
    if "6.5" in name:
        constant = any(
            len(branch.folds) > 1 and any(stays(branch, node) for node in range(2)) for branch in graph.branches
        )
        return f"three branches: {yes(len(graph.branches) == 3)}; lambda_n1 stays while alpha turns: {yes(constant)}"
    if "6.6" in name:
        grazing = any(arc.grazing for arc in graph.arcs)
        return f"grazing branch: {yes(grazing)}; bifurcation with a vertical segment: {yes(bool(graph.families))}"
    return f"one piecewise linear branch: {yes(len(graph.branches) == 1)}; at most five roots: {yes(largest <= 5)}"


def stays(branch, node):
    """Whether lambda_n of a node is the same at two neighbouring folds of the branch."""
    values = [round(float(v.lambda_n[node]), 12) for v in branch.folds]
    return any(a == b for a, b in pairwise(values))


def yes(fact):
    return "yes" if fact else "no"


def main():
    rows = []
    RESULTS.mkdir(exist_ok=True)
    for name, interval in CASES:
        graph = branch_graph(gallery.get(name).build(), interval, "exact")
        graph.plot(file=RESULTS / f"branch_two_node_{name.removeprefix('two-node-')}.png")
        rows.append(
            {
                "problem": name,
                "branches": len(graph.branches),
                "arcs": len(graph.arcs),
                "transitions": len(graph.transitions),
                "folds": " ".join(f"{v.alpha:.6g}" for v in graph.folds) or "-",
                "most roots": max(graph.steps[2]),
                "unique up to": "everywhere" if graph.uniqueness_limit is None else f"{graph.uniqueness_limit:.6g}",
                "complete": yes(graph.complete),
                "printed facts shown": shown(name, graph),
            }
        )
    report("branch_two_node", rows, "own geometry: the paper's figures are not to be matched")


if __name__ == "__main__":
    main()
