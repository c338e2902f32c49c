"""Part "missed": roots at evenly spaced alphas, linked into branches, against the exact graph.

An arc without a sample is missed, a branch when all its arcs are, a transition or fold when an arc at it is. A link
between roots of different branches is wrong. What a sampling does see of a transition is that it lies between two
samples.

The problems are twelve paths with several roots, random paths as they come, and three on which a closed branch is
short. Times are relative to the branch graph in verified arithmetic, which misses nothing.
"""

from __future__ import annotations

from functools import partial

from enumsol import branch_graph, link_samples
from samples_vs_graph.thin import INTERVAL, thin_problem
from shared.clock import timed
from shared.figures import BLUE, GREEN, GREY, ORANGE, RED, panels
from shared.paths import exact_path, located, paths
from shared.random_paths import random_path
from shared.results import series

SAMPLES, SMOKE_SAMPLES = (10, 30, 100, 300, 1000), (10, 30)
#: Lengths in alpha of closed branches beside an open one.
THIN = (1.0, 0.1, 0.01)
SEEDS = range(100, 104)
COUNTS = ("transitions", "arcs", "branches")
ARITHMETICS = {"fast": (GREY, "v"), "verified": (GREEN, "D"), "exact": ("black", "*")}


def sampled_paths(smoke):
    """The paths with their graphs in rational arithmetic."""
    found = paths(smoke=smoke)
    for p in (2,) if smoke else (2, 3, 4):
        for loading in (False, True):
            for seed in SEEDS[: 1 if smoke else None]:
                found.append(exact_path(*random_path(seed, p, loading=loading)))
    return found + [exact_path(thin_problem(length), INTERVAL) for length in THIN[: 1 if smoke else None]]


def table(problems, samples):
    """One row per number of samples, and one per arithmetic of the exact graph."""
    totals = totals_of(problems)
    rows = [{"method": "samples", "samples": count, **sampled(problems, count)} for count in samples]
    rows += [{"method": f"graph, {name}", "samples": "-", **graphs(problems, name)} for name in ARITHMETICS]
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


def totals_of(problems):
    """What there is to be found."""
    return {
        "transitions": sum(len(located(path.graph)) for path in problems),
        "arcs": sum(len(path.graph.arcs) for path in problems),
        "branches": sum(len(path.graph.branches) for path in problems),
    }


def sampled(problems, count):
    """Sums over all problems of what so many samples miss."""
    row = dict.fromkeys(("seconds", "roots", *COUNTS, "wrong links", "links left open"), 0)
    for problem, (low, high), graph in problems:
        # an irregular grid has no sample on a vertex by accident
        alphas = [low + (high - low) * (k + 0.381966) / count for k in range(count)]
        linked, seconds = timed(link_samples, problem, alphas)
        missed = linked.missed(graph)
        branch = partial(branch_of, graph, linked)
        row["seconds"] += seconds
        row["roots"] += linked.graph.number_of_nodes()
        row["arcs"] += len(missed.arcs)
        row["branches"] += len(missed.branches)
        row["transitions"] += unseen(graph, set(missed.arcs))
        row["wrong links"] += sum(branch(a) != branch(b) for a, b in linked.graph.edges)
        row["links left open"] += len(linked.ambiguous)
    return row


def unseen(graph, missed):
    """Transitions and folds at which an arc ends that has no sample."""
    ends = {v for k in missed for v in (graph.arcs[k].tail, graph.arcs[k].head)}
    return sum(v.number in ends for v in located(graph))


def branch_of(graph, linked, node):
    """The graph's branch on which a sampled root lies."""
    root = linked.graph.nodes[node]
    (arc,) = [arc for arc in graph.arcs_at(root["alpha"]) if arc.statuses == root["statuses"]]
    return graph.branch_of[arc.number]


def graphs(problems, arithmetic):
    """The same for branch graphs: what they lack of the one in rationals."""
    row = dict.fromkeys(("seconds", *COUNTS), 0)
    for problem, interval, exact in problems:
        graph, seconds = timed(branch_graph, problem, interval, arithmetic)
        row["seconds"] += seconds
        row["arcs"] += len({key(arc) for arc in exact.arcs} - {key(arc) for arc in graph.arcs})
        row["branches"] += max(len(exact.branches) - len(graph.branches), 0)
        row["transitions"] += max(len(located(exact)) - len(located(graph)), 0)
    return {**row, "roots": "-", "wrong links": "-", "links left open": "-"}


def key(arc):
    """An arc's statuses and bounds; those of a graph for S and g as computed differ in the last digits."""
    return arc.statuses, f"{arc.lo:.9g}", f"{arc.hi:.9g}"


def draw(rows):
    """Left: what is missed against samples. Right: the same against time, with the exact graphs."""
    figure, (left, right) = panels(1, 2, (10.5, 4.4), sharey=True)
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
    for name, (colour, marker) in ARITHMETICS.items():
        row = next(row for row in rows if row["method"] == f"graph, {name}")
        right.plot(row["time ratio"], row["transitions missed %"], marker, color=colour, markersize=9, label=name)
    offset = {"xytext": (4, 6), "textcoords": "offset points", "fontsize": 8, "color": BLUE}
    for row in chosen:
        right.annotate(str(row["samples"]), (row["time ratio"], row["transitions missed %"]), **offset)
    right.set_xlabel("time (proven branch graph: 1), with the number of samples")
    right.legend(frameon=False, fontsize=9, title="branch graph, arithmetic", title_fontsize=9)
    for axis in (left, right):
        axis.set_xscale("log")
        axis.set_ylim(-0.03 * top, 1.05 * top)
    # room for the last label
    right.set_xlim(right=2.0 * chosen[-1]["time ratio"])
    return figure


def conclusions(rows, problems):
    """What samples and graphs miss, and how many samples the proven graph is worth."""
    chosen = [row for row in rows if row["method"] == "samples"]
    exact = [row for row in rows if row["method"] != "samples"]
    totals = totals_of(problems)
    yield (
        f"sampling: {len(problems)} problems, {totals['transitions']} transitions and folds, {totals['arcs']} arcs, "
        f"{totals['branches']} branches; time 1: the branch graph in verified arithmetic"
    )
    yield (
        f"samples {series(chosen, 'samples')}: missed transitions and folds {series(chosen, 'transitions missed')}, "
        f"arcs {series(chosen, 'arcs missed')}, branches {series(chosen, 'branches missed')}; wrong links "
        f"{series(chosen, 'wrong links')}, pairs left open {series(chosen, 'links left open')}; "
        f"time {series(chosen, 'time ratio')}"
    )
    yield (
        "exact branch graphs in fast, verified and exact arithmetic: missed transitions and folds "
        f"{series(exact, 'transitions missed')}, arcs {series(exact, 'arcs missed')}; "
        f"time {series(exact, 'time ratio')}"
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


def main(run):
    problems = sampled_paths(run.smoke)
    rows = table(problems, SMOKE_SAMPLES if run.smoke else SAMPLES)
    run.table("accuracy_sampling", rows, *conclusions(rows, problems))
    run.figure("accuracy_sampling", draw(rows))
