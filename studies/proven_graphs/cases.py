"""One case in a process of its own: ``python cases.py NAME [exactly]`` prints what it did and what it took, as JSON."""

from __future__ import annotations

import json
import resource
import sys
from time import process_time

import numpy as np

import enumsol


def on_its_way(problem, friction, *, slope=0.0, start=0.0):
    """A body whose load grows over alpha, from ``start`` times the load."""
    return enumsol.ContactProblem(
        problem.A,
        problem.Bn,
        problem.Bt,
        start * problem.f,
        gap=problem.gap,
        friction=friction,
        friction_slope=slope,
        load_slope=problem.f,
        node_ids=problem.node_ids,
    )


def under_load(cells, rows):
    """A clamped block whose load grows and turns, friction constant."""
    block = enumsol.gallery.clamped_block(cells, rows)
    slope = block.f * np.linspace(0.5, 1.5, block.n)
    return enumsol.ContactProblem(
        block.A, block.Bn, block.Bt, 0.2 * block.f, gap=block.gap, friction=0.5, load_slope=slope
    )


def cases(*, smoke, large):
    """(name, what makes the problem, interval, whether exact functions are run beside it)."""
    gallery = enumsol.gallery

    def wedge():
        return gallery.wedge(4, 7, (4e-4, 1e-3))

    if not smoke:
        yield "wedge-8-3, friction", gallery.get("wedge-8-3").build, (0, 3), True
    yield "block p = 6, load", lambda: under_load(6, 4), (0, 1), True
    if smoke:
        return
    yield "wedge-14-5, friction", gallery.get("wedge-14-5").build, (0, 5), True
    yield "wedge p = 14, load", lambda: on_its_way(wedge(), 2.2), (0, 1), True
    yield "wedge p = 14, load and friction", lambda: on_its_way(wedge(), 0.5, slope=2.0, start=0.1), (0, 1), True
    yield "block p = 16, friction", lambda: gallery.clamped_block(16, 8), (0.1, 3), True
    if not large:
        return
    yield "wedge p = 32, friction", lambda: gallery.wedge(4, 16), (0, 3), False
    yield "block p = 32, friction", lambda: gallery.clamped_block(32, 8), (0.1, 3), True
    yield "block p = 64, friction", lambda: gallery.clamped_block(64, 8), (0.1, 3), False
    yield "block p = 64, n = 8704, load", lambda: under_load(64, 67), (0, 1), False


def measured(problem, interval, *, exactly):
    """One graph, its proof and the check."""
    problem.condensed, problem.enclosure  # noqa: B018 (made once for all that follows)
    last = {}  # when a stage was heard of last

    def progress(stage, _):
        last[stage] = process_time()

    started = process_time()
    graph = enumsol.branch_graph(problem, interval, progress=progress)
    made, searched = process_time(), last["search"]
    proof = graph.proof
    written = process_time()
    report = enumsol.verify(problem, proof)
    checked = process_time()
    exact = np.nan
    if exactly:
        enumsol.branch_graph(problem, interval, "fast", progress=progress)
        exact = process_time() - last["search"]
    inside = [v for v in graph.vertices if not v.border]
    widths = [float(v.enclosure[1] - v.enclosure[0]) / abs(v.alpha) for v in inside]
    return {
        "n": problem.n,
        "p": problem.p,
        "arcs": len(graph.arcs),
        "folds": len(graph.folds),
        "complete": graph.complete,
        "whole": report.complete,
        "data": graph.certified_data,
        "nodes": graph.stats.nodes,
        "pieces": graph.stats.pieces,
        "selections": graph.stats.selections,
        "search s": searched - started,
        "arcs s": made - searched,
        "proof s": written - made,
        "check s": checked - written,
        "exact arcs s": exact,
        "proof kB": proof.size / 1000,
        "width": max(widths, default=0.0),
        "peak MB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1000,
    }


if __name__ == "__main__":
    measured(enumsol.gallery.get("wedge-8-3").build(), (0, 3), exactly=True)  # loads what is used
    case = next(case for case in cases(smoke=False, large=True) if case[0] == sys.argv[1])
    print(json.dumps(measured(case[1](), case[2], exactly=case[3] and "exactly" in sys.argv[2:])))
