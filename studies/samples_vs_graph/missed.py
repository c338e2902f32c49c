"""Part 2 of accuracy_vs_speed: sampled against exact branch graphs.

Roots at evenly spaced alphas are linked into branches and measured against the exact graph: an arc without a sample is
missed, a branch when all its arcs are, a transition or fold when an arc at it is. A link between roots of different
branches is wrong. What a sampling does see of a transition is that it lies between two samples.

The problems are the twelve paths of the continuation study, random paths as they come, and three on which a closed
branch is short. Times are relative to the branch graph in verified arithmetic, which misses nothing.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import branch_thin
from _output import RESULTS
from _random_paths import random_path
from _trade_paths import BLUE, GREEN, GREY, ORANGE, RED, Path, exact_graph, located, paths, series, timed

from enumsol import branch_graph, link_samples

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from typing import Any

SAMPLES = (10, 30, 100, 300, 1000)
#: Lengths in alpha of closed branches beside an open one (see branch_thin).
THIN = (1.0, 0.1, 0.01)
SEEDS = range(100, 104)
COUNTS = ("transitions", "arcs", "branches")


def sampled_paths() -> list[Path]:
    found = list(paths())
    for p in (2, 3, 4):
        for loading in (False, True):
            for seed in SEEDS:
                problem, interval = random_path(seed, p, loading=loading)
                found.append(Path(problem, interval, exact_graph(problem, interval)))
    for length in THIN:
        problem = branch_thin.problem(length)
        found.append(Path(problem, (0.0, 4.0), exact_graph(problem, (0.0, 4.0))))
    return found


def table(problems: Sequence[Path]) -> list[dict[str, Any]]:
    """One row a number of samples, and one an arithmetic of the exact graph."""
    totals = {
        "transitions": sum(len(located(path.graph)) for path in problems),
        "arcs": sum(len(path.graph.arcs) for path in problems),
        "branches": sum(len(path.graph.branches) for path in problems),
    }
    rows = [{"method": "samples", "samples": count, **_sampled(problems, count)} for count in SAMPLES]
    rows += [
        {"method": f"graph, {arithmetic}", "samples": "-", **_graphs(problems, arithmetic)}
        for arithmetic in ("fast", "verified", "exact")
    ]
    unit = next(row["seconds"] for row in rows if row["method"] == "graph, verified")
    return [
        {
            "method": row["method"],
            "samples": row["samples"],
            "time ratio": row["seconds"] / unit,
            "roots": row["roots"],
            **{f"{name} missed": row[name] for name in COUNTS},
            **{f"{name} missed %": 100.0 * row[name] / totals[name] for name in COUNTS},
            "wrong links": row["wrong links"],
            "links left open": row["links left open"],
        }
        for row in rows
    ]


def _sampled(problems: Sequence[Path], count: int) -> dict[str, Any]:
    row = dict.fromkeys(("seconds", "roots", *COUNTS, "wrong links", "links left open"), 0)
    for problem, (low, high), graph in problems:
        # an irregular grid has no sample on a vertex by accident
        alphas = [low + (high - low) * (k + 0.381966) / count for k in range(count)]
        linked, seconds = timed(link_samples, problem, alphas)
        missed = linked.missed(graph)
        row["seconds"] += seconds
        row["roots"] += linked.graph.number_of_nodes()
        row["arcs"] += len(missed.arcs)
        row["branches"] += len(missed.branches)
        row["transitions"] += _unseen(graph, set(missed.arcs))
        row["wrong links"] += sum(_branch(graph, linked, a) != _branch(graph, linked, b) for a, b in linked.graph.edges)
        row["links left open"] += len(linked.ambiguous)
    return row


def _unseen(graph, missed: set[int]) -> int:
    """Transitions and folds at which an arc ends that has no sample."""
    ends = {v for k in missed for v in (graph.arcs[k].tail, graph.arcs[k].head)}
    return sum(v.number in ends for v in located(graph))


def _branch(graph, linked, node) -> int:
    root = linked.graph.nodes[node]
    (arc,) = [arc for arc in graph.arcs_at(root["alpha"]) if arc.statuses == root["statuses"]]
    return graph.branch_of[arc.number]


def _graphs(problems: Sequence[Path], arithmetic: str) -> dict[str, Any]:
    """The same for branch graphs: what they lack of the one in rationals."""
    row = dict.fromkeys(("seconds", *COUNTS), 0)
    for problem, interval, exact in problems:
        graph, seconds = timed(partial(branch_graph, problem, interval, arithmetic))
        row["seconds"] += seconds
        row["arcs"] += len({_key(arc) for arc in exact.arcs} - {_key(arc) for arc in graph.arcs})
        row["branches"] += max(len(exact.branches) - len(graph.branches), 0)
        row["transitions"] += max(len(located(exact)) - len(located(graph)), 0)
    return {**row, "roots": "-", "wrong links": "-", "links left open": "-"}


def _key(arc) -> tuple[Any, ...]:
    # the bounds of a graph for S and g as computed differ in the last digits
    return arc.statuses, f"{arc.lo:.9g}", f"{arc.hi:.9g}"


def draw(rows: Sequence[dict[str, Any]]) -> None:
    """Left: what is missed against samples. Right: the same against time, with the exact graphs."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.5, 4.4), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    chosen = [row for row in rows if row["method"] == "samples"]
    for name, colour, style in (("transitions", BLUE, "-o"), ("arcs", ORANGE, "-s"), ("branches", RED, "-^")):
        shares = [row[f"{name} missed %"] for row in chosen]
        label = "transitions and folds" if name == "transitions" else name
        left.plot([row["samples"] for row in chosen], shares, style, color=colour, markersize=5, label=label)
        right.plot([row["time ratio"] for row in chosen], shares, style, color=colour, markersize=5)
    left.set_xlabel("samples on the interval")
    left.set_ylabel("missed [% of all]")
    left.legend(frameon=False, fontsize=9)
    top = left.get_ylim()[1]
    marks = (("fast", GREY, "v"), ("verified", GREEN, "D"), ("exact", "black", "*"))
    for name, colour, marker in marks:
        row = next(row for row in rows if row["method"] == f"graph, {name}")
        right.plot(row["time ratio"], row["transitions missed %"], marker, color=colour, markersize=9, label=name)
    for row in chosen:
        right.annotate(
            str(row["samples"]),
            (row["time ratio"], row["transitions missed %"]),
            xytext=(4, 6),
            textcoords="offset points",
            fontsize=8,
            color=BLUE,
        )
    right.set_xlabel("time (proven branch graph: 1), with the number of samples")
    right.legend(frameon=False, fontsize=9, title="branch graph, arithmetic", title_fontsize=9)
    for axis in (left, right):
        axis.set_xscale("log")
        axis.set_ylim(-0.03 * top, 1.05 * top)
        axis.grid(visible=True, color="#e4e4e4", linewidth=0.6)
    # room for the last label
    right.set_xlim(right=2.0 * chosen[-1]["time ratio"])
    figure.savefig(RESULTS / "accuracy_sampling.png", dpi=150)


def conclusions(rows: Sequence[dict[str, Any]], problems: Sequence[Path]) -> Iterator[str]:
    chosen = [row for row in rows if row["method"] == "samples"]
    graphs = [row for row in rows if row["method"] != "samples"]
    arcs = sum(len(path.graph.arcs) for path in problems)
    vertices = sum(len(located(path.graph)) for path in problems)
    branches = sum(len(path.graph.branches) for path in problems)
    yield (
        f"sampling: {len(problems)} problems, {vertices} transitions and folds, {arcs} arcs, {branches} branches; "
        "time 1: the branch graph in verified arithmetic"
    )
    yield (
        f"samples {series(chosen, 'samples')}: missed transitions and folds {series(chosen, 'transitions missed')}, "
        f"arcs {series(chosen, 'arcs missed')}, branches {series(chosen, 'branches missed')}; wrong links "
        f"{series(chosen, 'wrong links')}, pairs left open {series(chosen, 'links left open')}; "
        f"time {series(chosen, 'time ratio')}"
    )
    yield (
        "exact branch graphs in fast, verified and exact arithmetic: missed transitions and folds "
        f"{series(graphs, 'transitions missed')}, arcs {series(graphs, 'arcs missed')}; "
        f"time {series(graphs, 'time ratio')}"
    )
    cheaper = [row for row in chosen if row["time ratio"] <= 1.0]
    if cheaper:
        row = cheaper[-1]
        yield (
            f"the most samples that cost no more than the proven graph: {row['samples']}, with "
            f"{row['transitions missed %']:.0f} % of the transitions and folds missed"
        )
    else:
        yield f"{chosen[0]['samples']} samples already cost more than the proven graph"
