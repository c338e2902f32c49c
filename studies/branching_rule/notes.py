"""Conclusions and figure of the study of branching rules, all from its table."""

from __future__ import annotations

import statistics

from branching_rule.rules import BASE, ONE_STEP, RULES, TAKEN
from shared.figures import BLUE, GREY, RED, panels

MEASURES = ("nodes", "QPs", "fast s", "verified s")
#: Share of the gap below which the package takes a tree to be slow.
SLOW = 0.04


def ratios(rows, rule, column, base=BASE):
    """Problem -> value of the rule over that of another one, where both finished."""
    table = {(row["rule"], row["problem"], row["F"]): row for row in rows if not row["cut"]}
    return {
        f"{problem}, F = {F:g}": row[column] / table[base, problem, F][column]
        for (name, problem, F), row in table.items()
        if name == rule and (base, problem, F) in table
    }


def mean(values):
    """Geometric mean."""
    return statistics.geometric_mean(values)


def conclusions(rows, max_nodes):
    """Every rule against the largest violation, then the numbers of candidates against the package's."""
    number = len({(row["problem"], row["F"]) for row in rows})
    yield f"Ratios to the rule {BASE!r}, geometric means over the problems that both finish:"
    for rule in RULES:
        nodes = ratios(rows, rule, "nodes")
        if rule == BASE or not nodes:
            continue
        worst = max(nodes, key=nodes.get)
        yield (
            f"{rule}: "
            + ", ".join(f"{column} {mean(ratios(rows, rule, column).values()):.2f}" for column in MEASURES)
            + f"; more nodes on {sum(value > 1 for value in nodes.values())} of {len(nodes)}, at worst "
            f"{nodes[worst]:.2f} times as many ({worst})"
            + (f"; {number - len(nodes)} cut at {max_nodes} nodes" if len(nodes) < number else "")
        )
    yield from against_taken(rows)
    for column in ("fast s", "verified s"):
        lost = [f"{name} ({value:.2f})" for name, value in ratios(rows, TAKEN, column).items() if value > 1.0]
        yield f"{column}: {TAKEN!r}, the package's, takes longer than {BASE!r} on: {'; '.join(lost) or 'none'}"


def slow_conclusions(rows):
    """Nodes by the rule for slow trees over those by the other one, where the share is small and where it is not."""
    for slow in (True, False):
        both = [line for line in rows if "-" not in (line["nodes, slow"], line["nodes, others"])]
        chosen = {
            f"{line['problem']}, F = {line['F']:g}": line["nodes, slow"] / line["nodes, others"]
            for line in both
            if (line["share"] < SLOW) == slow
        }
        if chosen:
            worst = max(chosen, key=chosen.get)
            yield (
                f"share {'below' if slow else 'of at least'} {SLOW}: the rule for slow trees takes "
                f"{mean(chosen.values()):.2f} times as many nodes, from {min(chosen.values()):.3f} to "
                f"{chosen[worst]:.2f} ({worst})"
            )


def against_taken(rows):
    """How the numbers of candidates compare by time: in the mean, in sum and at worst, where all of them finish."""
    rules = (BASE, *ONE_STEP.values())
    common = set.intersection(*(set(ratios(rows, rule, "nodes")) for rule in rules))
    yield f"By time, on the {len(common)} problems that every number of candidates finishes:"
    for column in ("fast s", "verified s"):
        over = {rule: {k: v for k, v in ratios(rows, rule, column, TAKEN).items() if k in common} for rule in rules}
        sums = dict.fromkeys(rules, 0.0)
        for row in rows:
            if row["rule"] in sums and f"{row['problem']}, F = {row['F']:g}" in common:
                sums[row["rule"]] += row[column]
        yield f"{column}, over {TAKEN!r}: " + "; ".join(
            f"{rule}: mean {mean(over[rule].values()):.2f}, sum {sums[rule] / sums[TAKEN]:.2f}, "
            f"from {min(over[rule].values()):.2f} to {max(over[rule].values()):.2f}"
            for rule in rules
            if rule != TAKEN
        )


def draw(rows):
    """Nodes and seconds of every rule relative to the largest violation, a dot a problem, a bar the mean."""
    figure, axes = panels(1, 2, (11, 4.6), sharey=True)
    names = [rule for rule in RULES if ratios(rows, rule, "nodes") and rule != BASE]
    colours = {"block": BLUE, "wedge": RED}
    titles = {"nodes": "nodes of the tree", "verified s": "process time, verified"}
    for axis, (column, title) in zip(axes, titles.items(), strict=True):
        for k, rule in enumerate(names):
            values = ratios(rows, rule, column)
            for name, value in values.items():
                axis.plot(k, value, "o", color=colours[name[:5]], alpha=0.55, markersize=5, markeredgewidth=0)
            axis.plot([k - 0.3, k + 0.3], [mean(values.values())] * 2, color="black", linewidth=2)
        axis.axhline(1.0, color=GREY, linewidth=0.8, zorder=0)
        axis.set_yscale("log")
        axis.set_yticks([0.1, 0.2, 0.5, 1, 2, 5, 10], ["0.1", "0.2", "0.5", "1", "2", "5", "10"])
        axis.set_xticks(range(len(names)), names, rotation=35, ha="right")
        axis.set_title(title, fontsize=10)
    axes[0].set_ylabel(f"relative to {BASE}")
    for name, colour in colours.items():
        axes[1].plot([], [], "o", color=colour, label=f"{name}s", markeredgewidth=0)
    axes[1].plot([], [], color="black", linewidth=2, label="geometric mean")
    axes[1].legend(frameon=False, loc="upper left", fontsize=9)
    return figure
