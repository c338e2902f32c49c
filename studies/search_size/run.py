"""How large is the tree? Nodes, relaxations and seconds against p, for clamped blocks and wedges.

Blocks under three tractions, of length 1 and 2, friction from 0.3 to 10, and the wedge with 3 and 5 roots. Searches are
cut off at a number of nodes or seconds (column "cut"), so that the study ends in a few minutes; the picture shows them
with what they had done by then.

Run: python studies/search_size.py [largest p]
"""

from __future__ import annotations

import sys
from collections import defaultdict

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from _output import RESULTS, report

import enumsol
from enumsol import gallery

SIZES = (8, 14, 20, 32, 48, 64, 100)
TRACTIONS = ((0.3, -1.0), (0.0, -1.0), (1.0, -0.3))
LENGTHS = (1.0, 2.0)
FRICTION = (0.3, 1.0, 3.0, 10.0)
MAX_NODES = 20_000
TIME_LIMIT = 12.0


def problems(p):
    """(name, problem, alpha)."""
    for traction in TRACTIONS:
        for length in LENGTHS:
            problem = gallery.clamped_block(p, p // 2, length, traction=traction)
            for F in FRICTION:
                yield f"block ({traction[0]:g}, {traction[1]:g}) length {length:g}", problem, F
    if p <= 64:
        yield "wedge, straight pull", gallery.wedge(4, p // 2), 1.0
        yield "wedge, oblique pull", gallery.wedge(4, p // 2, (4e-4, 1e-3)), 2.2


def run(p):
    for name, problem, alpha in problems(p):
        problem.condensed  # noqa: B018 (made once, outside the clock)
        roots = enumsol.enumerate_roots(problem, alpha, "fast", max_nodes=MAX_NODES, time_limit=TIME_LIMIT)
        stats = roots.stats
        yield {
            "p": p,
            "problem": name,
            "F": alpha,
            "roots": len(roots),
            "nodes": stats.nodes,
            "nodes / p": stats.nodes / p,
            "QPs": stats.qps,
            "fallback": stats.fallback_qps,
            "seconds": stats.seconds,
            "us a node": 1e6 * stats.seconds / stats.nodes,
            "cut": "yes" if roots.stopped else "",
        }


def picture(rows):
    figure, axes = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    groups = defaultdict(list)
    for row in rows:
        groups["wedge" if "wedge" in row["problem"] else f"block, F = {row['F']:g}"].append(row)
    for (name, group), marker in zip(groups.items(), "osv^D", strict=False):
        for axis, column in zip(axes, ("nodes / p", "seconds"), strict=True):
            sizes = sorted({row["p"] for row in group})
            values = [[row[column] for row in group if row["p"] == p] for p in sizes]
            (line,) = axis.loglog(sizes, [np.median(v) for v in values], marker=marker, label=name)
            axis.fill_between(
                sizes, [min(v) for v in values], [max(v) for v in values], color=line.get_color(), alpha=0.1
            )
    axes[0].axhline(8, color="black", linewidth=0.8, linestyle=":")
    for axis, column in zip(axes, ("nodes / p", "seconds"), strict=True):
        axis.set(xlabel="contact nodes p", ylabel=column)
    axes[0].legend(frameon=False)
    figure.savefig(RESULTS / "search_size.png", dpi=120)


def main(largest: int = SIZES[-1]) -> None:
    rows = [row for p in SIZES if p <= largest for row in run(p)]
    single = [
        row
        for row in rows
        if row["roots"] == 1 and row["F"] >= 1 and row["p"] <= 32 and row["problem"].startswith("block")
    ]
    worst = max(single, key=lambda row: row["nodes / p"])
    others = [row for row in single if "(1, -0.3)" not in row["problem"]]
    finished = sum(not row["cut"] for row in rows)
    slowest = {
        p: max(
            (
                r["seconds"]
                for r in rows
                if r["p"] == p and r["F"] >= 1 and r["problem"].startswith("block") and not r["cut"]
            ),
            default=np.nan,
        )
        for p in (32, 64, 100)
    }
    report(
        "search_size",
        rows,
        f"Single-root blocks, F >= 1, p <= 32: at most {worst['nodes / p']:.1f} p nodes ({worst['problem']}, "
        f"p = {worst['p']}, F = {worst['F']:g}); without traction (1, -0.3) "
        f"{max(row['nodes / p'] for row in others):.1f} p.",
        "Slowest finished block with F >= 1: "
        + ", ".join(f"{t:.2f} s at p = {p}" for p, t in slowest.items() if np.isfinite(t))
        + f"; {finished} of {len(rows)} searches finished within {MAX_NODES} nodes and {TIME_LIMIT:g} s.",
    )
    picture(rows)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:2]))
