"""Which step length and tolerance should continuation have, and what goes wrong with others?

Every branch of twelve paths is followed from one starting point in both directions, with checked steps and with the
algorithm as printed (``check_steps=False``), for step lengths h_max and tolerances eps. The audit against the exact
branch graph tells how far points are from it, how often a path jumped to another branch, and which arcs were not found;
a transition or fold is missed when no path located one near it.

Read ``jumps`` and ``missed ...`` (both should be 0) beside ``time ratio``, where the default settings are 1: checked
steps, h_max = 1, eps = 1e-6.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from enumsol import ContinuationOptions, audit, follow
from shared.clock import timed
from shared.figures import BLUE, GREY, ORANGE, panels
from shared.paths import located, paths
from shared.results import series

if TYPE_CHECKING:
    from shared.results import Run

LENGTHS, SMOKE_LENGTHS = (0.1, 0.25, 0.5, 1.0, 2.5, 5.0), (1.0, 5.0)
TOLERANCES, SMOKE_TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-6, 1e-9, 1e-12), (1e-6,)
#: Step length and tolerance of the default settings, and the step length at which printed steps' tolerances are tried.
DEFAULT_LENGTH, DEFAULT_TOLERANCE, SHORT = 1.0, 1e-6, 0.1
CHECKED, PRINTED = "checked steps", "as printed"
#: What is varied, the kind of steps, and the step length where tolerances are varied.
VARIED = (("h_max", CHECKED, None), ("h_max", PRINTED, None), ("eps", CHECKED, DEFAULT_LENGTH), ("eps", PRINTED, SHORT))
#: A transition is found when a path has one within this of it.
NEAR = 1e-4
COUNTS = ("points", "corrections", "off", "jumps", "missed transitions", "missed arcs", "stalled")
COLOURS = {CHECKED: BLUE, PRINTED: ORANGE}


def table(problems, lengths, tolerances):
    """One row per setting, summed over all paths."""
    rows, known = [], {}
    for study, steps, length in VARIED:
        for value in lengths if study == "h_max" else tolerances:
            h_max, eps = (value, DEFAULT_TOLERANCE) if study == "h_max" else (length, value)
            checked = steps == CHECKED
            options = ContinuationOptions(
                h_max=h_max, h_init=min(0.05, h_max), eps=eps, eps_prime=eps, check_steps=checked
            )
            if options not in known:
                known[options] = followed(problems, options)
            rows.append({"varied": study, "steps": steps, "h_max": h_max, "eps": eps, **known[options]})
    unit = next(row["seconds"] for row in rows if is_default(row))
    return [{**row, "time ratio": row["seconds"] / unit} for row in rows]


def is_default(row):
    return row["steps"] == CHECKED and row["h_max"] == DEFAULT_LENGTH and row["eps"] == DEFAULT_TOLERANCE


def followed(problems, options):
    """Sums over all problems of what one setting gives."""
    row = {"seconds": 0.0, "distance": 0.0, **dict.fromkeys(COUNTS, 0)}
    for problem, interval, graph in problems:
        ways, seconds = timed(both_ways, problem, graph.starting_points(), interval, options)
        found = audit(ways, graph, tolerance=max(1e-5, 10 * options.eps))
        row["seconds"] += seconds
        row["distance"] = max(row["distance"], found.max_distance)
        row["points"] += sum(map(len, ways))
        row["corrections"] += sum(path.stats.corrections for path in ways)
        row["off"] += len(found.off)
        row["jumps"] += len(found.jumps)
        row["missed transitions"] += missed_transitions(graph, ways)
        row["missed arcs"] += len(found.missed)
        row["stalled"] += sum(path.status in ("stalled", "dead end", "step limit") for path in ways)
    return row


def both_ways(problem, starts, interval, options):
    """The paths from all starting points."""
    return [follow(problem, start, direction, interval, options) for start in starts for direction in (1, -1)]


def missed_transitions(graph, ways):
    """Transitions and folds of the graph that no path located."""
    there = np.array([[item.alpha, *path.lambda_n[item.point]] for path in ways for item in path.transitions])
    count = 0
    for v in located(graph):
        want = np.append(v.alpha, v.lambda_n)
        near = NEAR * max(1.0, *abs(want))
        count += not len(there) or np.min(np.max(np.abs(there - want), axis=1)) > near
    return int(count)


def draw(rows):
    """Above step lengths, below tolerances: time, distance to the exact arc, and what went wrong."""
    figure, axes = panels(2, 3, (11.5, 6.8))
    for study, line in zip(("h_max", "eps"), axes, strict=True):
        for steps, colour in COLOURS.items():
            chosen = [row for row in rows if row["varied"] == study and row["steps"] == steps]
            for axis, name, style in (
                (line[0], "time ratio", "-o"),
                (line[1], "distance", "-o"),
                (line[2], "missed transitions", "-s"),
                (line[2], "jumps", ":o"),
            ):
                axis.plot([row[study] for row in chosen], [row[name] for row in chosen], style, color=colour, ms=5)
        label = {"h_max": "step length h_max", "eps": "tolerance eps"}[study]
        for axis, title in zip(line, ("time (default: 1)", "largest distance to the exact arc", "count"), strict=True):
            axis.set(xscale="log", xlabel=label, ylabel=title)
        line[0].set_ylim(bottom=0.0)
        line[1].set(yscale="log", ylim=(1e-14, 10))
        line[2].set_ylim(-2, max(1.35 * max(row["missed transitions"] for row in rows), 10))
    legends(axes)
    return figure


def legends(axes):
    """What colours and styles mean; the tolerances of the two kinds of steps are tried at different step lengths."""
    from matplotlib.lines import Line2D

    lengths = {CHECKED: DEFAULT_LENGTH, PRINTED: SHORT}
    for axis, names in (
        (axes[0, 0], {steps: steps for steps in COLOURS}),
        (axes[1, 0], {steps: f"{steps}, h_max = {lengths[steps]:g}" for steps in COLOURS}),
    ):
        handles = [Line2D([], [], color=COLOURS[k], marker="o", ms=5, label=name) for k, name in names.items()]
        axis.legend(handles=handles, frameon=False, fontsize=9)
    styles = (("transitions and folds missed", "-", "s"), ("jumps", ":", "o"))
    counts = [Line2D([], [], color=GREY, ls=style, marker=marker, ms=5, label=name) for name, style, marker in styles]
    for axis in axes[:, 2]:
        axis.legend(handles=counts, frameon=False, fontsize=9, loc="upper left")


def conclusions(rows, graphs):
    arcs, vertices = sum(len(graph.arcs) for graph in graphs), sum(len(located(graph)) for graph in graphs)
    yield (
        f"continuation: {len(graphs)} problems, {arcs} arcs, {vertices} transitions and folds; "
        f"time 1: {CHECKED}, h_max = {DEFAULT_LENGTH:g}, eps = {DEFAULT_TOLERANCE:g}"
    )
    for study, steps, _ in VARIED:
        chosen = [row for row in rows if row["varied"] == study and row["steps"] == steps]
        distances = " ".join(f"{row['distance']:.0e}" for row in chosen)
        yield (
            f"{steps}, {study} {series(chosen, study)}: jumps {series(chosen, 'jumps')}, missed transitions and folds "
            f"{series(chosen, 'missed transitions')}, missed arcs {series(chosen, 'missed arcs')}, paths not finished "
            f"{series(chosen, 'stalled')}; largest distance {distances}; "
            f"time {series(chosen, 'time ratio')}"
        )


def main(run: Run) -> None:
    problems = paths(smoke=run.smoke)
    values = (SMOKE_LENGTHS, SMOKE_TOLERANCES) if run.smoke else (LENGTHS, TOLERANCES)
    rows = table(problems, *values)
    run.table("accuracy_continuation", rows, *conclusions(rows, [path.graph for path in problems]))
    run.figure("accuracy_continuation", draw(rows))
