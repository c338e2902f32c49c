"""Part 3 of accuracy_vs_speed: step length and tolerance of continuation against the exact branch graph.

Every branch of the twelve paths is followed from one starting point in both directions, with checked steps and with the
algorithm as printed (``check_steps=False``), for step lengths h_max and tolerances eps. The audit against the exact
branch graph tells how far points are from it, how often a path jumped to another branch, and which arcs were not found;
a transition or fold is missed when no path located one within NEAR of it.

Times are relative to the default settings: checked steps, h_max = 1, eps = 1e-6.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from _output import RESULTS
from _trade_paths import BLUE, GREY, ORANGE, Path, located, paths, series, timed

from enumsol import ContinuationOptions, audit, follow

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from typing import Any

LENGTHS = (0.1, 0.25, 0.5, 1.0, 2.5, 5.0)
TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-6, 1e-9, 1e-12)
#: Step length and tolerance of the default settings, and the step length at which printed steps' tolerances are tried.
DEFAULT_LENGTH, DEFAULT_TOLERANCE, SHORT = 1.0, 1e-6, 0.1
CHECKED, PRINTED = "checked steps", "as printed"
#: A transition is found when a path has one within this of it.
NEAR = 1e-4
COUNTS = ("points", "corrections", "off", "jumps", "missed transitions", "missed arcs", "stalled")


def table() -> list[dict[str, Any]]:
    """One row a setting, summed over all paths."""
    rows: list[dict[str, Any]] = []
    known: dict[ContinuationOptions, dict[str, Any]] = {}
    for study, steps, length in (
        ("h_max", CHECKED, None),
        ("h_max", PRINTED, None),
        ("eps", CHECKED, DEFAULT_LENGTH),
        ("eps", PRINTED, SHORT),
    ):
        for value in LENGTHS if study == "h_max" else TOLERANCES:
            h_max, eps = (value, DEFAULT_TOLERANCE) if study == "h_max" else (length, value)
            options = ContinuationOptions(
                h_max=h_max, h_init=min(0.05, h_max), eps=eps, eps_prime=eps, check_steps=steps == CHECKED
            )
            if options not in known:
                known[options] = _followed(paths(), options)
            rows.append({"varied": study, "steps": steps, "h_max": h_max, "eps": eps, **known[options]})
    default = next(row for row in rows if _is_default(row))["seconds"]
    return [{**row, "time ratio": row.pop("seconds") / default} for row in rows]


def _is_default(row: dict[str, Any]) -> bool:
    return row["steps"] == CHECKED and row["h_max"] == DEFAULT_LENGTH and row["eps"] == DEFAULT_TOLERANCE


def _followed(problems: Sequence[Path], options: ContinuationOptions) -> dict[str, Any]:
    """Sums over all problems of what one setting gives."""
    row: dict[str, Any] = {"seconds": 0.0, "distance": 0.0, **dict.fromkeys(COUNTS, 0)}
    for problem, interval, graph in problems:
        followed, seconds = timed(_both_ways, problem, graph.starting_points(), interval, options)
        found = audit(followed, graph, tolerance=max(1e-5, 10 * options.eps))
        row["seconds"] += seconds
        row["distance"] = max(row["distance"], found.max_distance)
        row["points"] += sum(map(len, followed))
        row["corrections"] += sum(path.stats.corrections for path in followed)
        row["off"] += len(found.off)
        row["jumps"] += len(found.jumps)
        row["missed transitions"] += _missed_transitions(graph, followed)
        row["missed arcs"] += len(found.missed)
        row["stalled"] += sum(path.status in ("stalled", "dead end", "step limit") for path in followed)
    return row


def _both_ways(problem, starts, interval, options):
    return [follow(problem, start, direction, interval, options) for start in starts for direction in (1, -1)]


def _missed_transitions(graph, followed) -> int:
    """Transitions and folds of the graph that no path located."""
    there = np.array(
        [[item.alpha, *path.lambda_n[item.point]] for path in followed for item in path.transitions]
    ).reshape(-1, 1 + graph.problem.p)
    count = 0
    for v in located(graph):
        want = np.append(v.alpha, v.lambda_n)
        count += not len(there) or np.min(np.max(np.abs(there - want), axis=1)) > NEAR * max(1.0, *abs(want))
    return int(count)


COLOURS = {CHECKED: BLUE, PRINTED: ORANGE}


def draw(rows: Sequence[dict[str, Any]]) -> None:
    """Above step lengths, below tolerances: time, distance to the exact arc, and what went wrong."""
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    figure = Figure(figsize=(11.5, 6.8), layout="constrained")
    axes = figure.subplots(2, 3)
    for (study, label), line in zip((("h_max", "step length h_max"), ("eps", "tolerance eps")), axes, strict=True):
        for steps, colour in COLOURS.items():
            chosen = [row for row in rows if row["varied"] == study and row["steps"] == steps]
            values = [row[study] for row in chosen]
            for axis, name, style in (
                (line[0], "time ratio", "-o"),
                (line[1], "distance", "-o"),
                (line[2], "missed transitions", "-s"),
                (line[2], "jumps", ":o"),
            ):
                axis.plot(values, [row[name] for row in chosen], style, color=colour, markersize=5)
        for axis, title in zip(line, ("time (default: 1)", "largest distance to the exact arc", "count"), strict=True):
            axis.set_xscale("log")
            axis.set_xlabel(label)
            axis.set_ylabel(title)
            axis.grid(visible=True, color="#e4e4e4", linewidth=0.6)
        line[0].set_ylim(bottom=0.0)
        line[1].set_yscale("log")
        line[1].set_ylim(1e-14, 10)
        line[2].set_ylim(-2, 1.35 * max(row["missed transitions"] for row in rows))
    kinds = [Line2D([], [], color=colour, marker="o", markersize=5, label=name) for name, colour in COLOURS.items()]
    # the tolerances of the two kinds of steps are tried at different step lengths
    names = {CHECKED: f"{CHECKED}, h_max = {DEFAULT_LENGTH:g}", PRINTED: f"{PRINTED}, h_max = {SHORT:g}"}
    short = [Line2D([], [], color=COLOURS[k], marker="o", markersize=5, label=name) for k, name in names.items()]
    counts = [
        Line2D([], [], color=GREY, linestyle=style, marker=marker, markersize=5, label=name)
        for name, style, marker in (("transitions and folds missed", "-", "s"), ("jumps", ":", "o"))
    ]
    axes[0, 0].legend(handles=kinds, frameon=False, fontsize=9)
    axes[1, 0].legend(handles=short, frameon=False, fontsize=9)
    for axis in axes[:, 2]:
        axis.legend(handles=counts, frameon=False, fontsize=9, loc="upper left")
    figure.savefig(RESULTS / "accuracy_continuation.png", dpi=150)


def conclusions(rows: Sequence[dict[str, Any]]) -> Iterator[str]:
    def part(study: str, steps: str) -> list[dict[str, Any]]:
        return [row for row in rows if row["varied"] == study and row["steps"] == steps]

    graphs = [path.graph for path in paths()]
    arcs, vertices = sum(len(graph.arcs) for graph in graphs), sum(len(located(graph)) for graph in graphs)
    yield (
        f"continuation: {len(graphs)} problems, {arcs} arcs, {vertices} transitions and folds; "
        f"time 1: {CHECKED}, h_max = {DEFAULT_LENGTH:g}, eps = {DEFAULT_TOLERANCE:g}"
    )
    for study, steps in (("h_max", CHECKED), ("h_max", PRINTED), ("eps", CHECKED), ("eps", PRINTED)):
        chosen = part(study, steps)
        distances = " ".join(f"{row['distance']:.0e}" for row in chosen)
        yield (
            f"{steps}, {study} {series(chosen, study)}: jumps {series(chosen, 'jumps')}, missed transitions and folds "
            f"{series(chosen, 'missed transitions')}, missed arcs {series(chosen, 'missed arcs')}, paths not finished "
            f"{series(chosen, 'stalled')}; largest distance {distances}; "
            f"time {series(chosen, 'time ratio')}"
        )
