"""How large is the tree, and how does it grow with the number of contact nodes p?

Fast searches of clamped blocks under three tractions, of length 1 and 2, with friction from 0.3 to 10, and of wedges
with three and five roots. A search is cut at a number of nodes or seconds (column "cut"); figure and table show it with
what it had done by then.

Read ``nodes / p``: where it stays level, the tree grows no faster than the body. The dotted line is 8 p.
"""

from __future__ import annotations

from collections import defaultdict
from typing import TYPE_CHECKING

import numpy as np

import enumsol
from shared.figures import panels
from shared.loads import DRAGGED, PRESSED, STRAIGHT, block, oblique_wedge, straight_wedge

if TYPE_CHECKING:
    from shared.results import Run

SIZES, SMOKE_SIZES = (8, 14, 20, 32, 48, 64, 100), (8, 14)
LENGTHS = (1.0, 2.0)
FRICTION = (0.3, 1.0, 3.0, 10.0)
#: Trees of larger wedges are cut long before they end.
LARGEST_WEDGE = 64
MAX_NODES = 20_000
TIME_LIMIT = 12.0


def problems(p):
    """Loaded bodies with p contact nodes."""
    for traction in (PRESSED, STRAIGHT, DRAGGED):
        for length in LENGTHS:
            for F in FRICTION:
                yield block(p, traction, F, length)
    if p <= LARGEST_WEDGE:
        yield straight_wedge(p)
        yield oblique_wedge(p)


def row(loaded):
    """One search."""
    problem = loaded.build()
    problem.condensed  # noqa: B018 (made once, outside the clock)
    roots = enumsol.enumerate_roots(problem, loaded.alpha, "fast", max_nodes=MAX_NODES, time_limit=TIME_LIMIT)
    stats = roots.stats
    return {
        "p": loaded.p,
        "problem": loaded.name,
        "F": loaded.alpha,
        "roots": len(roots),
        "nodes": stats.nodes,
        "nodes / p": stats.nodes / loaded.p,
        "QPs": stats.qps,
        "fallback": stats.fallback_qps,
        "seconds": stats.seconds,
        "us a node": 1e6 * stats.seconds / stats.nodes,
        "cut": "yes" if roots.stopped else "",
    }


def conclusions(rows):
    """The longest trees of blocks with one root, and the slowest blocks that finished."""
    blocks = [row for row in rows if row["F"] >= 1 and row["problem"].startswith("block")]
    single = [row for row in blocks if row["roots"] == 1 and row["p"] <= 32]
    worst = max(single, key=lambda row: row["nodes / p"])
    others = [row for row in single if "(1, -0.3)" not in row["problem"]]
    yield (
        f"Single-root blocks, F >= 1, p <= 32: at most {worst['nodes / p']:.1f} p nodes ({worst['problem']}, "
        f"F = {worst['F']:g}); without traction (1, -0.3) {max(row['nodes / p'] for row in others):.1f} p."
    )
    finished = [row for row in blocks if not row["cut"]]
    slowest = {p: max(row["seconds"] for row in finished if row["p"] == p) for p in {row["p"] for row in finished}}
    yield (
        "Slowest finished block with F >= 1: "
        + ", ".join(f"{slowest[p]:.2f} s at p = {p}" for p in sorted(slowest) if p >= 32 or p == max(slowest))
        + f"; {sum(not row['cut'] for row in rows)} of {len(rows)} searches finished within {MAX_NODES} nodes and "
        f"{TIME_LIMIT:g} s."
    )


def draw(rows):
    """Median, least and largest nodes / p and seconds against p."""
    figure, axes = panels(1, 2, (10, 4))
    groups = defaultdict(list)
    for line in rows:
        groups["wedge" if "wedge" in line["problem"] else f"block, F = {line['F']:g}"].append(line)
    for axis, column in zip(axes, ("nodes / p", "seconds"), strict=True):
        for (name, group), marker in zip(groups.items(), "osv^D", strict=True):
            sizes = sorted({line["p"] for line in group})
            values = [[line[column] for line in group if line["p"] == p] for p in sizes]
            (curve,) = axis.loglog(sizes, [np.median(v) for v in values], marker=marker, label=name)
            ends = [min(v) for v in values], [max(v) for v in values]
            axis.fill_between(sizes, *ends, color=curve.get_color(), alpha=0.1)
        axis.set(xlabel="contact nodes p", ylabel=column)
    axes[0].axhline(8, color="black", linewidth=0.8, linestyle=":")
    axes[0].legend(frameon=False)
    return figure


def main(run: Run) -> None:
    sizes = SMOKE_SIZES if run.smoke else SIZES
    rows = [row(loaded) for p in sizes for loaded in problems(p)]
    run.table("search_size", rows, *conclusions(rows))
    run.figure("search_size", draw(rows))
