"""How large are the problems whose branch graphs are proven for the matrices as given, and what does it cost?

Verified graphs with their proofs, which hold the arcs, and the check of these proofs; one process, one problem after
the other. Columns ``search s``, ``arcs s``, ``proof s`` and ``check s`` are the search over the interval, the arcs in
ball arithmetic with the vertices, writing the proof, and the checker; ``exact arcs s`` is what arcs took as exact
functions of alpha, of S and g as computed, in the same run: the way of graphs of more than 24 degrees of freedom before
there were balls (left out where it takes minutes).

Read ``whole``: the checker found that every solution for every alpha of the interval lies on the arcs, for the
problem's own matrices. ``width`` is the largest of the bounds of critical alphas, relative to alpha.
"""

from __future__ import annotations

import argparse
import resource
from time import process_time
from typing import TYPE_CHECKING

import numpy as np

import enumsol

if TYPE_CHECKING:
    from shared.results import Run


def on_its_way(problem, friction, *, start=0.0):
    """A body whose load grows over alpha, from ``start`` times the load."""
    return enumsol.ContactProblem(
        problem.A,
        problem.Bn,
        problem.Bt,
        start * problem.f,
        gap=problem.gap,
        friction=friction,
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


def options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--large", action="store_true", help="also p = 32 and 64, and n = 8704 (ten minutes)")


def cases(*, smoke, large):
    """(name, problem, interval, whether exact functions are run beside it)."""
    gallery = enumsol.gallery
    wedge = gallery.wedge(4, 7, (4e-4, 1e-3))
    yield "wedge-8-3, friction", gallery.get("wedge-8-3").build(), (0, 3), True
    yield "block p = 6, load", under_load(6, 4), (0, 1), True
    if smoke:
        return
    yield "wedge-14-5, friction", gallery.get("wedge-14-5").build(), (0, 5), True
    yield "wedge p = 14, load", on_its_way(wedge, 2.2), (0, 1), True
    yield "wedge p = 14, load and friction", on_its_way(wedge, (0.5, 2.0), start=0.1), (0, 1), True
    yield "block p = 16, friction", gallery.clamped_block(16, 8), (0.1, 3), True
    if not large:
        return
    yield "block p = 32, friction", gallery.clamped_block(32, 8), (0.1, 3), True
    yield "block p = 64, friction", gallery.clamped_block(64, 8), (0.1, 3), False
    yield "block p = 64, n = 8704, load", under_load(64, 67), (0, 1), False


def row(name, problem, interval, *, exactly):
    """One graph, its proof and the check."""
    problem.condensed, problem.enclosure  # noqa: B018 (made once for all that follows)
    started = process_time()
    graph = enumsol.branch_graph(problem, interval)
    made = process_time()
    proof = graph.proof
    written = process_time()
    report = enumsol.verify(problem, proof)
    checked = process_time()
    exact = np.nan
    if exactly:
        stats = enumsol.branch_graph(problem, interval, "fast").stats
        exact = stats.seconds - stats.search_seconds
    inside = [v for v in graph.vertices if not v.border]
    widths = [float(v.enclosure[1] - v.enclosure[0]) / abs(v.alpha) for v in inside]
    return {
        "case": name,
        "n": problem.n,
        "p": problem.p,
        "arcs": len(graph.arcs),
        "folds": len(graph.folds),
        "complete": graph.complete,
        "whole": report.whole,
        "data": graph.certified_data,
        "nodes": graph.stats.nodes,
        "pieces": graph.stats.pieces,
        "selections": graph.stats.selections,
        "search s": graph.stats.search_seconds,
        "arcs s": made - started - graph.stats.search_seconds,
        "proof s": written - made,
        "check s": checked - written,
        "exact arcs s": exact,
        "proof kB": proof.size / 1000,
        "width": max(widths, default=0.0),
        "peak MB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1000,
    }


def main(run: Run) -> None:
    rows = [row(*case, exactly=exactly) for *case, exactly in cases(smoke=run.smoke, large=run.options.large)]
    ratios = [r["exact arcs s"] / r["arcs s"] for r in rows if np.isfinite(r["exact arcs s"])]
    shares = [r["check s"] / (r["search s"] + r["arcs s"] + r["proof s"]) for r in rows]
    run.table(
        "proven_graphs",
        rows,
        f"complete: {sum(r['complete'] for r in rows)} of {len(rows)}; whole: {sum(r['whole'] for r in rows)}",
        "check / make: " + ", ".join(f"{x:.2f}" for x in shares),
        "arcs as exact functions / in balls: " + ", ".join(f"{x:.1f}" for x in ratios),
    )
