"""What do step length, tolerance and sampling trade? Work against audit distance and what is missed.

Every branch of twelve problems (gallery and random, friction and loading paths) is followed from one starting point in
both directions, with checked steps and with the algorithm as printed (``check_steps=False``), for step lengths h_max
and tolerances eps. The audit against the exact branch graph tells how far points are from it, how often a path jumped
to another branch, and which transitions and arcs were not found. Sampled enumerations, linked from each alpha to the
next, are measured against the same graphs.

Times are process times relative to the default settings. Table: results/continuation_trade.csv; figure:
results/continuation_trade.png.

Run: python studies/continuation_trade.py
"""

from __future__ import annotations

import time

import numpy as np
from _output import RESULTS, report
from _random_paths import random_path

from enumsol import ContinuationOptions, audit, branch_graph, follow, gallery, link_samples

GALLERY = (
    ("one-node-6.1", (0.0, 20.0)),
    ("two-node-6.4", (0.0, 10.0)),
    ("two-node-6.7-minus", (-3.0, 3.0)),
    ("chain-2-coupled", (0.0, 8.0)),
)
#: (seed, p, loading path): random problems with several roots, folds and transitions.
RANDOM = (
    (15, 3, False),
    (18, 3, False),
    (7, 4, False),
    (21, 4, False),
    (3, 3, True),
    (15, 3, True),
    (14, 4, True),
    (17, 4, True),
)
LENGTHS = (0.1, 0.25, 0.5, 1.0, 2.5, 5.0)
TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-6, 1e-9, 1e-12)
#: Step length at which the tolerances are compared.
FIXED_LENGTH = 0.1
SAMPLES = (10, 30, 100, 300, 1000)
#: A transition is found when the path has one within this of it.
NEAR = 1e-4


def cases():
    for name, interval in GALLERY:
        problem = gallery.get(name).build()
        yield problem, interval, branch_graph(problem, interval, "exact")
    for seed, p, loading in RANDOM:
        problem, interval = random_path(seed, p, loading=loading)
        yield problem, interval, branch_graph(problem, interval)


def options_for(h_max, eps, *, check):
    return ContinuationOptions(h_max=h_max, h_init=min(0.05, h_max), eps=eps, eps_prime=eps, check_steps=check)


def followed(problems, options):
    """Sums over all problems of what one setting of the continuation gives."""
    row = dict.fromkeys(("points", "corrections", "seconds", "jumps", "off", "missed transitions", "missed arcs"), 0)
    distance, stalled = 0.0, 0
    for problem, interval, graph in problems:
        started = time.process_time()
        paths = [
            follow(problem, start, direction, interval, options)
            for start in graph.starting_points()
            for direction in (1, -1)
        ]
        row["seconds"] += time.process_time() - started
        found = audit(paths, graph, tolerance=max(1e-5, 10 * options.eps))
        row["points"] += sum(map(len, paths))
        row["corrections"] += sum(path.stats.corrections for path in paths)
        row["jumps"] += len(found.jumps)
        row["off"] += len(found.off)
        row["missed arcs"] += len(found.missed)
        row["missed transitions"] += missed_transitions(graph, paths)
        stalled += sum(path.status in ("stalled", "dead end", "step limit") for path in paths)
        distance = max(distance, found.max_distance)
    return {**row, "distance": distance, "stalled": stalled}


def missed_transitions(graph, paths):
    """Transitions and folds of the graph that no path located."""
    located = np.array(
        [[item.alpha, *path.lambda_n[item.point]] for path in paths for item in path.transitions]
    ).reshape(-1, 1 + graph.problem.p)
    count = 0
    for v in (*graph.transitions, *graph.folds):
        there = np.append(v.alpha, v.lambda_n)
        count += not len(located) or np.min(np.max(np.abs(located - there), axis=1)) > NEAR * max(1.0, *abs(there))
    return count


def sampled(problems, count):
    """The same for linked samples: wrong links are jumps, vertices without a sample on both sides are not seen."""
    row = {"points": 0, "seconds": 0.0, "jumps": 0, "missed transitions": 0, "missed arcs": 0}
    for problem, interval, graph in problems:
        # an irregular grid has no sample on a vertex by accident
        low, high = interval
        alphas = low + (high - low) * (np.arange(count) + 0.381966) / count
        started = time.process_time()
        linked = link_samples(problem, alphas)
        row["seconds"] += time.process_time() - started
        row["points"] += linked.graph.number_of_nodes()
        missed = set(linked.missed(graph).arcs)
        row["missed arcs"] += len(missed)
        row["missed transitions"] += sum(
            any(v.number in (graph.arcs[k].tail, graph.arcs[k].head) for k in missed)
            for v in (*graph.transitions, *graph.folds)
        )
        row["jumps"] += sum(
            branch_of(graph, linked.graph.nodes[a]) != branch_of(graph, linked.graph.nodes[b])
            for a, b in linked.graph.edges
        )
    return row


def branch_of(graph, node):
    (arc,) = [arc for arc in graph.arcs_at(node["alpha"]) if arc.statuses == node["statuses"]]
    return graph.branch_of[arc.number]


def table(problems):
    rows = []
    for kind, check in (("checked steps", True), ("as printed", False)):
        settings = [(h_max, options_for(h_max, 1e-6, check=check)) for h_max in LENGTHS]
        rows += [{"study": f"h_max, {kind}", "value": h, **followed(problems, options)} for h, options in settings]
    study = f"eps, as printed, h_max = {FIXED_LENGTH:g}"
    settings = [(eps, options_for(FIXED_LENGTH, eps, check=False)) for eps in TOLERANCES]
    rows += [{"study": study, "value": eps, **followed(problems, options)} for eps, options in settings]
    rows += [{"study": "samples", "value": count, **sampled(problems, count)} for count in SAMPLES]
    default = next(row["seconds"] for row in rows if row["study"] == "h_max, checked steps" and row["value"] == 1.0)
    columns = ("points", "corrections", "distance", "off", "jumps", "missed transitions", "missed arcs", "stalled")
    return [
        {
            "study": row["study"],
            "value": row["value"],
            "time ratio": row["seconds"] / default,
            **{name: row.get(name, "-") for name in columns},
        }
        for row in rows
    ]


BLUE, ORANGE, RED, GREY = "#1f5fa8", "#d9730d", "#c23b4b", "#555555"
#: Kinds of rows drawn in each column of the figure, with their colours; and the measures of work with their styles.
COLUMNS = (
    ("h_max", "step length", (("h_max, checked", BLUE, "checked"), ("h_max, as printed", ORANGE, "as printed"))),
    ("eps", f"tolerance, as printed, h_max = {FIXED_LENGTH:g}", (("eps", ORANGE, "as printed"),)),
    ("samples", "sampled enumerations", (("samples", BLUE, "samples"),)),
)
WORK = (("time ratio", "-o"), ("corrections", "--s"), ("points", ":^"))
MISSED = (("missed transitions", "--s"), ("jumps", "-o"))


def draw(rows):
    """Work above, what is missed below; one column a study."""
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    figure = Figure(figsize=(11.5, 6.6), layout="constrained")
    axes = figure.subplots(2, 3)
    default = next(row for row in rows if row["study"] == "h_max, checked steps" and row["value"] == 1.0)
    for (label, title, kinds), (work, missed) in zip(COLUMNS, axes.T, strict=True):
        for study, colour, _ in kinds:
            chosen = [row for row in rows if row["study"].startswith(study)]
            values = [row["value"] for row in chosen]
            for axis, measures in ((work, WORK), (missed, MISSED)):
                for name, style in measures:
                    if chosen[0][name] == "-":
                        continue
                    unit = default[name] if axis is work else 1
                    axis.plot(values, [row[name] / unit for row in chosen], style, color=colour, markersize=4)
            if label == "samples":
                missed.plot(values, [row["missed arcs"] for row in chosen], ":^", color=RED, markersize=4)
        work.set_title(title, fontsize=10)
        work.set_yscale("log")
        work.set_ylim(0.04, 40)
        work.set_ylabel("work (h_max = 1, checked: 1)")
        missed.set_ylabel("count, all problems")
        missed.set_xlabel(label)
        top = missed.get_ylim()[1]
        missed.set_ylim(-0.03 * top, 1.45 * top)
        for axis in (work, missed):
            axis.set_xscale("log")
            axis.grid(visible=True, color="#e4e4e4", linewidth=0.6)
        lines = [
            (GREY, style, {"time ratio": "time"}.get(name, name)) for name, style in WORK if chosen[0][name] != "-"
        ]
        lines += [(colour, "-", name) for _, colour, name in kinds] if len(kinds) > 1 else []
        work.legend(handles=[handle(Line2D, *line) for line in lines], fontsize=8, frameon=False, ncols=2)
        names = {"jumps": "wrong links" if label == "samples" else "jumps"}
        lines = [(GREY, style, names.get(name, name)) for name, style in MISSED]
        lines += [(RED, ":^", "missed arcs")] if label == "samples" else []
        lines += [(RED, "-.d", "audit distance")] if label == "eps" else []
        place = "upper left" if label != "samples" else "upper right"
        missed.legend(handles=[handle(Line2D, *line) for line in lines], fontsize=8, frameon=False, loc=place)
    chosen = [row for row in rows if row["study"].startswith("eps")]
    twin = axes[1, 1].twinx()
    distances = [row["distance"] for row in chosen]
    twin.plot([row["value"] for row in chosen], distances, "-.d", color=RED, markersize=4)
    twin.set_yscale("log")
    twin.set_ylabel("audit distance", color=RED)
    figure.savefig(RESULTS / "continuation_trade.png", dpi=150)


def handle(line, colour, style, label):
    """An entry of a legend."""
    marker = style[-1] if style[-1] in "os^d" else ""
    return line([], [], color=colour, linestyle=style.removesuffix(marker), marker=marker, markersize=4, label=label)


def conclusions(rows, problems):
    def part(study):
        return [row for row in rows if row["study"].startswith(study)]

    def total(chosen, name):
        return sum(row[name] for row in chosen)

    graphs = [graph for *_, graph in problems]
    arcs, vertices = sum(len(g.arcs) for g in graphs), sum(len(g.transitions) + len(g.folds) for g in graphs)
    checked, printed, eps, samples = (part(name) for name in ("h_max, checked", "h_max, as", "eps", "samples"))
    ends = f"h_max from {LENGTHS[0]:g} to {LENGTHS[-1]:g}"
    yield f"{len(graphs)} problems, {arcs} arcs, {vertices} transitions and folds; time 1: h_max = 1, checked steps"
    yield (
        f"checked steps, {ends}: {total(checked, 'jumps')} jumps, {total(checked, 'missed transitions')} missed "
        f"transitions, points within {max(row['distance'] for row in checked):.1g} of the graph; "
        f"time {checked[0]['time ratio']:.2g} to {checked[-1]['time ratio']:.2g}"
    )
    yield (
        f"as printed, {ends}: jumps {series(printed, 'jumps')}, missed transitions "
        f"{series(printed, 'missed transitions')}; "
        f"paths not finished {series(printed, 'stalled')}; time {printed[0]['time ratio']:.2g} to "
        f"{printed[-1]['time ratio']:.2g}"
    )
    yield (
        f"eps from {TOLERANCES[0]:g} to {TOLERANCES[-1]:g}: audit distance {eps[0]['distance']:.1g} to "
        f"{eps[-1]['distance']:.1g}, corrections {series(eps, 'corrections')}, jumps {series(eps, 'jumps')}"
    )
    yield (
        f"samples {series(samples, 'value')}: missed arcs {series(samples, 'missed arcs')}, wrong links "
        f"{series(samples, 'jumps')}; time {samples[0]['time ratio']:.2g} to {samples[-1]['time ratio']:.2g}"
    )


def series(rows, name):
    return " ".join(str(row[name]) for row in rows)


def main():
    problems = list(cases())
    rows = table(problems)
    draw(rows)
    report("continuation_trade", rows, *conclusions(rows, problems))


if __name__ == "__main__":
    main()
