"""Every branch of a graph followed by the paper's Algorithm 5.1 with its settings, from each end of the branch."""

from __future__ import annotations

import math

import numpy as np

from enumsol import ContinuationOptions, follow, follow_all
from enumsol.auditing import follow_arc
from enumsol.continuation import start_tangents
from paper_examples.one_node import MINUS, OPEN, STICK


def paper_options(h_max):
    """The defaults are the paper's settings but for h_max; its alpha is not scaled."""
    return ContinuationOptions(h_max=h_max, alpha_scale=1.0)


def walks(problem, graph, options):
    """Paths from every end of a branch on the interval's border into the interval."""
    return [
        follow_arc(problem, graph, v.number, arc.number, options=options)
        for v in graph.vertices
        if v.border
        for arc in graph.arcs
        if v.number in (arc.tail, arc.head)
    ]


def vertical_walk(problem, graph, options):
    """Up the vertical segment of 6.3, from the bifurcation on the grazing branch."""
    (point,) = graph.bifurcations
    tangents = start_tangents(problem, point, graph.interval, options)
    up = min(range(len(tangents)), key=lambda k: abs(tangents[k].dalpha))
    return follow(problem, point, 1, graph.interval, options, tangent=up)


def check_passages(graph, paths):
    """Every transition and fold was passed, in both directions; their number."""
    passed = [(item.alpha, item.before, item.after) for path in paths for item in path.transitions]
    turning = [*graph.transitions, *graph.folds]
    for v in turning:
        here = [(before, after) for alpha, before, after in passed if math.isclose(alpha, v.alpha, rel_tol=1e-9)]
        meeting = [arc for arc in graph.arcs if v.number in (arc.tail, arc.head)]
        ways = {(arc.statuses, other.statuses) for arc in meeting for other in meeting if arc is not other}
        assert len(ways) == 2, (v, ways)
        assert ways <= set(here), (v, ways, here)
    return len(turning)


def continuation_row(example, problem, graph, h_max):
    """One example with one h_max: what was passed, and what the audit says of following everything."""
    options = paper_options(h_max)
    paths = walks(problem, graph, options)
    assert all(path.status == "interval left" for path in paths)
    count = check_passages(graph, paths)
    if graph.families:
        up = vertical_walk(problem, graph, options)
        down = next(path for path in paths if path.transitions)
        names = [path.selections for path in (up, down)]
        assert names == [((MINUS,), (STICK,)), ((STICK,), (MINUS,), (OPEN,))], names
        count += 2
    result = follow_all(problem, graph.interval, options, graph=graph)
    assert result.complete, result
    assert not result.failures, result
    return {
        "example": example,
        "h_max": h_max,
        "transitions": count,
        "passed both ways": "all",
        "points": sum(len(path) for path in result.paths),
        "rejected": result.stats.rejected,
        "corrections": result.stats.corrections,
        "arcs": len(graph.arcs),
        "missed": len(result.report.missed) + len(result.report.missed_families),
        "jumps": len(result.report.jumps),
        "distance": result.report.max_distance,
    }


def draw(title, problem, graph):
    """The graph with the accepted steps of one walk along every branch as dots."""
    figure = graph.plot("lambda_n", zoom=False, figsize=(7.5, 2.2 + 2.5 * problem.p))
    paths = []
    for path in walks(problem, graph, paper_options(1.0)):
        if not any(same_ends(path, other) for other in paths):
            paths.append(path)
    for node in range(problem.p):
        axis = figure.axes[node]
        for path in paths:
            dots = [k for k, kind in enumerate(path.kinds) if kind != "transition"]
            axis.plot(path.alpha[dots], path.lambda_n[dots, node], ".", color="black", markersize=4, zorder=3.5)
    figure.axes[0].set_title(f"{title}; dots: accepted steps, h_max = 1", fontsize=9, loc="left")
    return figure


def same_ends(path, other):
    """Whether one path is the other walked back."""

    def end(one, k):
        return np.concatenate([[one.alpha[k]], one.lambda_n[k]])

    return np.allclose(end(path, 0), end(other, -1), atol=1e-6) and np.allclose(end(path, -1), end(other, 0), atol=1e-6)
