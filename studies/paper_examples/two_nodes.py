"""Loads of the paper's Examples 6.4 to 6.7 on the gallery's square of two nodes: which of the printed facts it shows.

The paper's coordinates were never published: its printed numbers are not to be expected here, they stand beside ours.
"""

from __future__ import annotations

from itertools import pairwise

from shared.results import yes

#: Example -> gallery name and interval.
TWO_NODES = {
    "6.4": ("two-node-6.4", (0.0, 10.0)),
    "6.5": ("two-node-6.5", (0.0, 10.0)),
    "6.6": ("two-node-6.6", (0.0, 10.0)),
    "6.7, slopes -1.1, -0.8": ("two-node-6.7-minus", (-3.0, 3.0)),
    "6.7, slopes +1.1, +0.8": ("two-node-6.7-plus", (-3.0, 3.0)),
}
PRINTED = {
    "6.4": "three branches; at alpha = 5 at least five roots (1 + 2 + 2)",
    "6.5": "three branches; on one of them lambda_n1 stays while alpha goes back and forth",
    "6.6": "node 1 grazing, node 2 open for all alpha; vertical segment at alpha = 1.3333",
    "6.7": "piecewise linear branch; at most five roots, five values of lambda_n2 at a = 1.6",
}


def own_row(example, graph):
    """One example: what is printed and what our geometry shows."""
    return {
        "loads of": example,
        "printed, for the paper's geometry": PRINTED[example[:3]],
        "shown by ours": shown(example, graph),
        "ours: branches": len(graph.branches),
        "arcs": len(graph.arcs),
        "most roots": max(graph.steps[2]),
        "folds": " ".join(f"{v.alpha:.6g}" for v in graph.folds) or "-",
        "transitions": " ".join(f"{v.alpha:.6g}" for v in graph.transitions) or "-",
        "roots over alpha": roots_over(graph),
        "unique up to": "everywhere" if graph.uniqueness_limit is None else f"{graph.uniqueness_limit:.6g}",
        "complete": "proven" if graph.complete else "no",
    }


def shown(example, graph):
    """The printed facts of the example, each with yes or no for this geometry."""
    most = max(graph.steps[2])
    if "6.4" in example:
        return f"three branches: {yes(len(graph.branches) == 3)}; at least five roots: {yes(most >= 5)}"
    if "6.5" in example:
        constant = any(stays(branch, node) for branch in graph.branches for node in range(2))
        return f"three branches: {yes(len(graph.branches) == 3)}; lambda_n1 stays while alpha turns: {yes(constant)}"
    if "6.6" in example:
        grazing = any(arc.grazing for arc in graph.arcs)
        return f"grazing branch: {yes(grazing)}; bifurcation with a vertical segment: {yes(graph.families)}"
    return f"one piecewise linear branch: {yes(len(graph.branches) == 1)}; at most five roots: {yes(most <= 5)}"


def stays(branch, node):
    """Whether lambda_n of a node is the same at two neighbouring folds of the branch."""
    values = [round(float(v.lambda_n[node]), 12) for v in branch.folds]
    return any(a == b for a, b in pairwise(values))


def roots_over(graph):
    """Number of roots between critical alphas as text: 1 on 0..3, 5 on 3..3.83, .."""
    alphas, _, between = graph.steps
    merged = []
    for k, count in enumerate(between):
        if not merged or merged[-1][1] != count:
            merged.append((float(alphas[k]), count))
    ends = [start for start, _ in merged[1:]] + [graph.interval[1]]
    return ", ".join(f"{count} on {start:.4g}..{end:.4g}" for (start, count), end in zip(merged, ends, strict=True))
